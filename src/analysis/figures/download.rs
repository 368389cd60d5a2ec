//! The coefficients that go to the module.

use gnc_executive::measurement::Value;
use serde_json::json;

use super::calibration::{COEFFICIENTS, Calibration, Coefficients};
use super::{FigureError, Findings, Question};

/// What the items before found, as the module takes it. Writing and reading back is the procedure's.
pub(super) fn analyse(question: &Question<'_>) -> Result<Findings, FigureError> {
    let calibration = Calibration::of(question.earlier)?;
    let coefficients = Coefficients::of(&calibration)?;
    let mut findings = Findings::new(json!({
        "equation": "f = Ka N + nabla, w = Kg N - epsilon - Gamma f, y' = ky (y - dy), x' = ((x - dx) - y' sin(alpha)) / cos(alpha)",
        "label": if calibration.mag.is_some() {
            "accelerometers, gyroscopes, magnetometer"
        } else {
            "accelerometers and gyroscopes; the magnetometer's are those of a perfect one"
        },
    }));
    findings.part(&COEFFICIENTS, coefficients);
    findings.put("coefficients", Value::count(coefficients.count()));
    Ok(findings)
}
