//! The coefficients that go to the module.

use gnc_executive::catalogue::calibration;
use gnc_executive::measurement::Value;
use serde_json::json;

use super::calibration::{COEFFICIENTS, ModuleCalibration, ModuleCoefficients};
use super::{AnalysisInput, FigureError, Findings};

/// Returns the findings of the items before, in the form of the module. The procedure writes them and reads them back.
pub(super) fn analyse(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let calibration = ModuleCalibration::of(question.earlier)?;
    let coefficients = ModuleCoefficients::of(&calibration)?;
    let mut findings = Findings::new(json!({
        "equation": "f = Ka N + nabla, w = Kg N - epsilon - Gamma f, y' = ky (y - dy), x' = ((x - dx) - y' sin(alpha)) / cos(alpha)",
        "label": if calibration.mag.is_some() {
            "accelerometers, gyroscopes, magnetometer"
        } else {
            "accelerometers and gyroscopes; the magnetometer's are those of a perfect one"
        },
    }));
    findings.part(&COEFFICIENTS, coefficients);
    findings.put(&calibration::COEFFICIENTS, Value::count(coefficients.count()));
    Ok(findings)
}
