//! The magnetometer over many attitudes: hard and soft iron.

use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_metrology::ellipsoid;
use gnc_protocol::stream::{MAG_LSB_PER_GAUSS, SATURATION};
use serde_json::json;

use super::budget::Budget;
use super::captures::{self, AXES, Triad};
use super::json::{matrix, vector};
use super::{FigureError, Findings, Question};

/// Points taken of each attitude: so many means of its samples.
const POINTS: usize = 20;

pub(super) fn analyse(question: &Question<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    for capture in question.captures {
        captures::sound([capture], &[Triad::Mag])?;
        question.long_enough(capture, "dwell")?;
    }
    let points: Vec<_> = question
        .captures
        .iter()
        .flat_map(|capture| captures::block_means(capture, Triad::Mag, capture.samples.len() / POINTS))
        .map(|mean| mean / MAG_LSB_PER_GAUSS)
        .collect();
    let [x, y, z] = [0, 1, 2].map(|axis| points.iter().map(|point| point[axis]).collect::<Vec<f64>>());
    let top = f64::from(SATURATION) / MAG_LSB_PER_GAUSS;
    let found = ellipsoid::fit(&x, &y, &z, None, Some(top)).map_err(FigureError::refused("ellipsoid"))?;
    let mut findings = Findings::new(json!({
        "equation": "corrected = matrix (raw - centre), |corrected| = field; matrix symmetric, determinant 1; gauss at nominal scale",
        "centre": vector(&found.centre), "matrix": matrix(&found.matrix), "field": found.field,
        "semi_axes": vector(&found.semi_axes), "one_sidedness": found.one_sidedness, "sigma": found.sigma,
        "used": found.used, "dof": found.dof, "condition": found.condition, "attitudes": question.captures.len(),
        "label": "the frame of the field alone: it differs from a correction that keeps an axis by a constant of roll",
    }));
    let dof = found.dof as f64;
    let fit = |u: f64, unit: Unit| Budget::new(unit).a("fit", u, dof);
    for (i, axis) in AXES.iter().enumerate() {
        let budget = fit(found.centre_sd[i], Unit::Gauss);
        findings.figure(format!("hard_iron_{axis}"), found.centre[i], &budget, probability);
    }
    for (i, j) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)] {
        let value = found.matrix[(i, j)] - if i == j { 1.0 } else { 0.0 };
        let budget = fit(found.matrix_sd[(i, j)] * 1e6, Unit::PartsPerMillion);
        findings.figure(format!("soft_iron_{}{}", AXES[i], AXES[j]), value * 1e6, &budget, probability);
    }
    findings.figure("field", found.field, &fit(found.field_sd, Unit::Gauss), probability);
    match question.site.and_then(|site| site.field_gauss).filter(|field| *field > 0.0) {
        Some(field) => {
            let budget = fit(found.field_sd / field * 100.0, Unit::Percent);
            findings.figure("field_error", (found.field / field - 1.0) * 100.0, &budget, probability);
        }
        None => findings.put("field_error", Value::NotAvailable("the bench file gives no field".into())),
    }
    findings.number("residual", found.residual_relative * 100.0, Unit::Percent);
    findings.number("coverage_of_sphere", found.coverage * 100.0, Unit::Percent);
    findings.put("rejected", Value::count(found.rejected as u64));
    Ok(findings)
}
