//! Allan deviations of all axes, on compensated data.

use std::collections::BTreeMap;

use gnc_executive::catalogue::noise::{BIAS_INSTABILITY, BIAS_INSTABILITY_BOUND, RANDOM_WALK};
use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_executive::uncertainty::Uncertainty;
use gnc_metrology::allan::{self, Coefficient, DeviationKind, FitQuality, Input, MissingCoefficient, Taus};
use gnc_metrology::{earth, stats};
use serde_json::json;

use super::captures::{AXES, Triad};
use super::stability::{Compensation, unit};
use super::{AnalysisInput, FigureError, Findings};
use crate::details::performance::{self as details, CURVES};

pub(super) fn analyse(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let compensation = Compensation::of(question)?;
    let capture = compensation.at_rest(question)?;
    let rate_hz = f64::from(capture.about.rate_hz);
    let mut findings = Findings::new(json!({
        "equation": "overlapping Allan deviation; dev^2 = 3 Q^2/tau^2 + N^2/tau + (2 ln 2/pi) B^2 + K^2 tau/3 + R^2 tau^2/2",
        "rate_hz": rate_hz, "record_s": capture.samples.len() as f64 / rate_hz,
        "interval": "68.3 %, chi-square with equivalent degrees of freedom (Greenhall), by the noises of the fit",
    }));
    let mut curves = BTreeMap::new();
    for triad in &compensation.triads {
        let series = compensation.blocks(capture, *triad, 1);
        let found = [0, 1, 2].map(|axis| {
            let values: Vec<f64> = series.iter().map(|value| value[axis]).collect();
            // The analysis uses one thread, so that the sums, and so the bits of the figures, do not depend on the
            // machine.
            allan::analyse(&values, Input::Rate, rate_hz, DeviationKind::Oadev, &Taus::Octave, 1)
        });
        let found = found.into_iter().collect::<Result<Vec<_>, _>>().map_err(FigureError::refused(triad.name()))?;
        for (axis, analysis) in AXES.iter().zip(&found) {
            curves.insert(format!("{}_{axis}", triad.name()), curve(analysis, unit(*triad)));
        }
        walks(&mut findings, *triad, &found);
        floors(&mut findings, *triad, &found);
    }
    findings.part(&CURVES, curves);
    Ok(findings)
}

fn curve(analysis: &allan::Analysis, unit: Unit) -> details::AllanCurve {
    let point = |point: &allan::DeviationPoint| details::AllanPoint {
        tau_s: point.tau_s,
        dev: point.dev,
        low: point.low,
        high: point.high,
        edf: Some(point.edf),
        n: point.n,
        noise: point.noise.map(|noise| noise.to_string()),
    };
    let interval =
        |c: Coefficient| details::CoefficientDetails { value: c.value, low: Some(c.low), high: Some(c.high) };
    let c = &analysis.coefficients;
    let reasons = [("Q", c.q), ("N", c.n), ("B", c.b), ("K", c.k), ("R", c.r)];
    details::AllanCurve {
        unit: unit.symbol().to_owned(),
        points: analysis.points.iter().map(point).collect(),
        reasons: reasons.iter().filter_map(|(name, c)| Some(((*name).to_owned(), c.err()?.to_string()))).collect(),
        fit: analysis.fit.as_ref().map(fit_json),
        n_psd: analysis.plateau.map(|plateau| interval(plateau.n())),
        b_upper_bound: c.b_upper_bound,
        b_upper_bound_label:
            "smallest upper end of a 95 % interval / 0.664: an upper bound, whether a flat part is seen or not"
                .to_owned(),
        q: c.q.ok().map(interval),
        n: c.n.ok().map(interval),
        b: c.b.ok().map(interval),
        k: c.k.ok().map(interval),
        r: c.r.ok().map(interval),
    }
}

/// Returns how well a fit of noise terms holds, in the form that records and `compute` share.
pub fn fit_json(fit: &FitQuality) -> serde_json::Value {
    let lines: Vec<_> = fit
        .lines
        .iter()
        .map(|line| json!({ "frequency_hz": line.frequency_hz, "amplitude": line.amplitude }))
        .collect();
    json!({
        "holds": fit.holds, "chi_square": fit.chi_square, "dof": fit.dof, "p": fit.p, "terms": fit.terms,
        "used_from_s": fit.used_from_s, "model_error": fit.model_error,
        "correlation_s": fit.correlation_s, "lines": lines,
    })
}

fn estimate(coefficient: Coefficient, factor: f64, unit: Unit) -> Value {
    let Coefficient { value, low, high } = coefficient;
    Value::estimate(value * factor, unit, Uncertainty::interval(low * factor, high * factor, stats::ONE_SIGMA))
}

fn absent(what: &str, why: MissingCoefficient) -> Value {
    Value::NotAvailable(format!("the record shows no {what}: {why}"))
}

/// Adds N: deg/h sqrt(s) in deg/sqrt(h), mg sqrt(s) in m/s/sqrt(h).
fn walks(findings: &mut Findings, triad: Triad, found: &[allan::Analysis]) {
    let (unit, factor) = match triad {
        Triad::Gyro => (Unit::DegreePerRootHour, 1.0 / 60.0),
        _ => (Unit::MetrePerSecondPerRootHour, 60.0 * earth::STANDARD_GRAVITY_MPS2 / 1e3),
    };
    for (walk, analysis) in triad.of(&RANDOM_WALK).iter().zip(found) {
        let value =
            analysis.coefficients.n.map_or_else(|why| absent("slope of -1/2", why), |n| estimate(n, factor, unit));
        findings.put(walk, value);
    }
}

fn floors(findings: &mut Findings, triad: Triad, found: &[allan::Analysis]) {
    let unit = unit(triad);
    for (floor, analysis) in triad.of(&BIAS_INSTABILITY).iter().zip(found) {
        let value = analysis.coefficients.b.map_or_else(|why| absent("flat part", why), |b| estimate(b, 1.0, unit));
        findings.put(floor, value);
    }
    for (upper, analysis) in triad.of(&BIAS_INSTABILITY_BOUND).iter().zip(found) {
        let bound = analysis.coefficients.b_upper_bound;
        let too_short = || Value::NotAvailable("the record is too short for a bound".into());
        let value = bound.map_or_else(too_short, |bound| Value::number(bound, unit));
        findings.put(upper, value);
    }
}
