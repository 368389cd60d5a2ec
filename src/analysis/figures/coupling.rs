//! The coupling that calibration leaves. Calibration q is evaluated with the coefficients of the first calibration.
//! With its own coefficients the coupling would be zero by construction.

use gnc_executive::catalogue::repeated::{COUPLINGS_LEFT, NONORTHOGONALITY_LEFT};
use gnc_executive::catalogue::{COUPLED_PAIRS, SENSOR_PAIRS};
use gnc_executive::quantity::Unit;
use gnc_metrology::triad::nonorthogonality_rad;
use nalgebra::Matrix3;
use serde_json::json;

use super::axes::of_angle;
use super::budget::Budget;
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
        let triad = judged.series.triad();
        let calibrations: Vec<_> = judged
            .left
            .iter()
            .map(|left| json!({ "after_compensation": matrix(left), "nonorthogonality": vector(&nonorthogonality_rad(left)) }))
            .collect();
        findings.detail(&format!("calibrations_{}", triad.name()), calibrations);
        for ((i, j), measurement) in COUPLED_PAIRS.into_iter().zip(triad.of(&COUPLINGS_LEFT)) {
            let (q, value) = judged.largest(|left| left[(i, j)] / left[(i, i)]);
            let budget = judged.budget(q, i, j).of_largest(judged.left.len());
            findings.figure(measurement, value * 1e6, &budget, probability);
        }
    }
    for judged in &judged {
        let angles = judged.series.triad().of(&NONORTHOGONALITY_LEFT);
        for (k, (i, j)) in SENSOR_PAIRS.into_iter().enumerate() {
            let (q, value) = judged.largest(|left| nonorthogonality_rad(left)[k]);
            let budget = of_angle(&judged.budget(q, i, j), &judged.budget(q, j, i)).of_largest(judged.left.len());
            findings.figure(&angles[k], value * 1e6, &budget, probability);
        }
    }
    Ok(findings)
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
