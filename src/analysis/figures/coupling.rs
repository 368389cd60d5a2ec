//! The coupling that calibration leaves. Calibration q is evaluated with the coefficients of the first calibration.
//! With its own coefficients the coupling would be zero by construction.

use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_metrology::triad::nonorthogonality_rad;
use nalgebra::Matrix3;
use serde_json::json;

use super::axes::of_angle;
use super::budget::Budget;
use super::captures::AXES;
use super::json::{matrix, vector};
use super::repeated::{self, CalibrationSeries};
use super::{AnalysisInput, FigureError, Findings};

pub(super) fn analyse(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    let all = repeated::calibrations(question)?;
    let mut findings = Findings::new(json!({
        "equation": "M_q Ka_1 (S_q Kg_1): coupling_ij = element ij over ii; of the calibrations after the first the largest",
        "label": "coupling against the first calibration, so that the mounting of the seat cancels; nonorthogonality is the module's own",
    }));
    let judged = all.iter().map(Judged::of).collect::<Result<Vec<_>, _>>()?;
    for judged in &judged {
        let name = judged.series.triad().name();
        let calibrations: Vec<_> = judged
            .left
            .iter()
            .map(|left| json!({ "after_compensation": matrix(left), "nonorthogonality": vector(&nonorthogonality_rad(left)) }))
            .collect();
        findings.detail(&format!("calibrations_{name}"), calibrations);
        for i in 0..3 {
            for j in (0..3).filter(|j| *j != i) {
                let (q, value) = judged.largest(|left| left[(i, j)] / left[(i, i)]);
                let figure = format!("coupling_{name}_{}{}", AXES[i], AXES[j]);
                let budget = judged.budget(q, i, j).of_largest(judged.left.len());
                findings.figure(figure, value * 1e6, &budget, probability);
            }
        }
    }
    for judged in &judged {
        let name = judged.series.triad().name();
        for (k, (i, j)) in [(0, 1), (0, 2), (1, 2)].into_iter().enumerate() {
            let (q, value) = judged.largest(|left| nonorthogonality_rad(left)[k]);
            let budget = of_angle(&judged.budget(q, i, j), &judged.budget(q, j, i)).of_largest(judged.left.len());
            let figure = format!("nonorthogonality_{name}_{}{}", AXES[i], AXES[j]);
            findings.figure(figure, value * 1e6, &budget, probability);
        }
    }
    sort_by_catalogue(&mut findings.measured);
    Ok(findings)
}

/// Sorts the couplings of both triads before their angles, as in the catalogue.
fn sort_by_catalogue(measured: &mut [(String, Value)]) {
    let spec = gnc_executive::catalogue::ItemId::CrossCoupling.spec();
    measured.sort_by_key(|(name, _)| spec.measurements.iter().position(|other| other.name == name));
}

/// The calibrations after the first, evaluated with its coefficients.
struct Judged<'s> {
    series: &'s CalibrationSeries,
    left: Vec<Matrix3<f64>>,
}

impl<'s> Judged<'s> {
    fn of(series: &'s CalibrationSeries) -> Result<Self, FigureError> {
        let responses = series.responses();
        let inverse = responses.first().and_then(|first| first.try_inverse());
        let inverse = inverse.ok_or_else(|| FigureError::Missing { what: "a first calibration".into() })?;
        Ok(Self { series, left: responses[1..].iter().map(|response| response * inverse).collect() })
    }

    /// Returns the calibration whose figure is farthest from 0 (1 is the one after the first), and the figure.
    fn largest(&self, figure: impl Fn(&Matrix3<f64>) -> f64) -> (usize, f64) {
        let figures = self.left.iter().map(figure).enumerate().map(|(q, value)| (q + 1, value));
        figures.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap_or((1, f64::NAN))
    }

    /// Returns the budget of a coupling. Both calibrations are uncertain. A common part, such as the attitude of a
    /// table that is oriented anew, counts as if it were not common.
    fn budget(&self, q: usize, i: usize, j: usize) -> Budget {
        let of = |k: usize| match self.series {
            CalibrationSeries::Accel(solved) => solved.get(k).map(|solved| solved.response_budget(i, j)),
            CalibrationSeries::Gyro(solved) => solved.get(k).map(|solved| solved.response_budget(i, j)),
        };
        let parts = [of(0), of(q)].map(|budget| budget.map_or((f64::NAN, 1.0), |budget| budget.combined()));
        Budget::new(Unit::PartsPerMillion).a("first calibration", parts[0].0, parts[0].1).a(
            "this calibration",
            parts[1].0,
            parts[1].1,
        )
    }
}
