//! The magnetometer over many attitudes: hard and soft iron.

use gnc_executive::bench::BenchSite;
use gnc_executive::catalogue::magnetometer;
use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_protocol::stream::{MAG_LSB_PER_GAUSS, SATURATION};
use serde_json::json;

use super::attitude_field::{Attitude, Field};
use super::budget::Budget;
use super::captures::{self, Triad};
use super::json::{matrix, vector};
use super::mean::MeanVariance;
use super::still_fit::rare_ratio;
use super::{AnalysisInput, FigureError, Findings};
use crate::capture::Capture;

/// Parts of each attitude. Their means are fitted.
const PARTS: usize = 20;

pub(super) fn analyse(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    for capture in question.captures {
        captures::sound([capture], &[Triad::Mag])?;
        question.long_enough(capture, "dwell")?;
    }
    let fixture = BenchSite::fixture(question.site);
    let attitudes = question.captures.iter().map(attitude).collect();
    let top = f64::from(SATURATION) / MAG_LSB_PER_GAUSS;
    let field = Field::of(attitudes, fixture.ambient_u_gauss, top)?;
    let found = &field.found;
    let noise = Noise::of(&field, fixture.ambient_u_gauss);
    let mut findings = Findings::new(json!({
        "equation": "corrected = matrix (raw - centre), |corrected| = field; matrix symmetric, determinant 1; gauss at nominal scale",
        "centre": vector(&found.centre), "matrix": matrix(&found.matrix), "field": found.field,
        "semi_axes": vector(&found.semi_axes), "one_sidedness": found.one_sidedness,
        "attitude_sd": field.between.sd(), "attitude_noise": field.noise.sd(),
        "used": found.used, "dof": field.between.dof, "condition": found.condition, "attitudes": question.captures.len(),
        "label": "the frame of the field alone: it differs from a correction that keeps an axis by a constant of roll",
    }));
    let quantum = 1.0 / MAG_LSB_PER_GAUSS / 12.0_f64.sqrt();
    // `place` is the place of the figure in the covariance of the fit, `factor` turns gauss into the unit.
    let budget = |place: usize, unit: Unit, factor: f64| noise.in_budget(unit, field.per_gauss(place) * factor);
    for (i, measurement) in magnetometer::HARD_IRON.iter().enumerate() {
        let budget = budget(i, Unit::Gauss, 1.0).b("field of the fixture", fixture.field_u_gauss, "gauss", 1.0).b(
            "quantisation",
            quantum,
            "gauss",
            1.0,
        );
        findings.figure(measurement, found.centre[i], &budget, probability);
    }
    let elements = [(0, 0, 3), (1, 1, 6), (2, 2, 8), (0, 1, 4), (0, 2, 5), (1, 2, 7)];
    for ((i, j, place), measurement) in elements.into_iter().zip(&magnetometer::SOFT_IRON) {
        let value = found.matrix[(i, j)] - if i == j { 1.0 } else { 0.0 };
        let budget = budget(place, Unit::PartsPerMillion, 1e6);
        findings.figure(measurement, value * 1e6, &budget, probability);
    }
    let of_field = |unit: Unit, factor: f64| {
        // The error that all attitudes have in common.
        budget(9, unit, factor).b("ambient field", fixture.ambient_u_gauss, "gauss", factor)
    };
    findings.figure(&magnetometer::FIELD_STRENGTH, found.field, &of_field(Unit::Gauss, 1.0), probability);
    match question.site.and_then(|site| site.field_gauss).filter(|field| *field > 0.0) {
        Some(known) => {
            let budget = of_field(Unit::Percent, 100.0 / known);
            findings.figure(&magnetometer::FIELD_ERROR, (found.field / known - 1.0) * 100.0, &budget, probability);
        }
        None => findings.put(&magnetometer::FIELD_ERROR, Value::NotAvailable("the bench file gives no field".into())),
    }
    findings.number(&magnetometer::RESIDUAL, found.residual_relative * 100.0, Unit::Percent);
    findings.number(&magnetometer::COVERAGE_OF_SPHERE, found.coverage * 100.0, Unit::Percent);
    findings.put(&magnetometer::REJECTED, Value::count(field.left_out as u64));
    Ok(findings)
}

/// The parts of a capture, gauss.
fn attitude(capture: &Capture) -> Attitude {
    let means = captures::block_means(capture, Triad::Mag, capture.samples.len() / PARTS);
    Attitude {
        label: capture.about.label.clone(),
        parts: means.into_iter().map(|mean| mean / MAG_LSB_PER_GAUSS).collect(),
    }
}

/// Errors of the attitudes that are independent of each other.
enum Noise {
    /// Noise within the attitudes, and the ambient field from the bench file.
    Known { noise: MeanVariance, ambient_u_gauss: f64 },
    /// The attitudes scatter by more than these two explain; their scatter contains both.
    Seen(MeanVariance),
}

impl Noise {
    fn of(field: &Field, ambient_u_gauss: f64) -> Self {
        let (noise, ambient) = (field.noise, ambient_u_gauss * ambient_u_gauss);
        let variance = noise.variance + ambient;
        // Degrees of freedom of the sum (Welch-Satterthwaite): the ambient field has infinitely many.
        let expected = MeanVariance { variance, dof: noise.dof * (variance / noise.variance).powi(2) };
        if field.between.variance > variance * rare_ratio(field.between.dof, &[expected]) {
            Self::Seen(field.between)
        } else {
            Self::Known { noise, ambient_u_gauss }
        }
    }

    /// Returns the budget of a figure that changes by `per_gauss` where each attitude has an error of one gauss.
    fn in_budget(&self, unit: Unit, per_gauss: f64) -> Budget {
        match self {
            Self::Known { noise, ambient_u_gauss } => Budget::new(unit)
                .a("noise, white and slow", noise.sd() * per_gauss, noise.dof)
                .b("ambient field between attitudes", *ambient_u_gauss, "gauss", per_gauss),
            Self::Seen(between) => {
                Budget::new(unit).a("differences between attitudes", between.sd() * per_gauss, between.dof)
            }
        }
    }
}
