//! The sensor passport of a module: its content, from what the items found. Pure.
//!
//! Key names are the published ones (document 5 of the module's specification); what they mean, which the source leaves
//! open, stands in `docs/passport.schema.json`. What was not measured is null, never a guess.

use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_metrology::earth::STANDARD_GRAVITY_MPS2;
use gnc_protocol::stream::{ACCEL_LSB_PER_G, GYRO_LSB_PER_DPS};
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use crate::figures::calibration::Mag;
use crate::figures::{Calibration, FigureError, Findings};

const AXES: [&str; 3] = ["x", "y", "z"];

/// Who was calibrated where, when and by what.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Date and time of the calibration, RFC 3339.
    pub date: String,
    /// The station and its program with version.
    pub means: String,
    /// The plan with its version.
    pub plan: String,
    /// SHA-256 of the record.
    pub record_sha256: String,
    /// A simulated bench is no evidence about any module.
    pub simulated: bool,
}

/// A sensor passport.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Passport {
    /// Serial number of the module.
    pub device_id: String,
    /// Conditions of the calibration.
    pub conditions: Conditions,
    /// Accelerometers.
    pub accel: Accel,
    /// Gyroscopes.
    pub gyro: Gyro,
    /// Magnetometer; null where it was not calibrated.
    pub magnetometer: Option<Mag>,
    /// Expanded uncertainty.
    pub uncertainty: Uncertainty,
    /// Date, means and record of the calibration.
    pub origin: Origin,
}

/// Conditions of the calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Conditions {
    /// Lowest and highest temperature measured.
    #[serde(rename = "temperature_range_C")]
    pub temperature_range_c: Option<[f64; 2]>,
    /// Supply at the socket.
    #[serde(rename = "supply_V")]
    pub supply_v: Option<f64>,
    /// Conditions of vibration and shock tests (IEC 60068-2-6, -2-64, ISO 16063-31); null where there were none.
    pub vibration_and_shock: Option<String>,
}

/// Accelerometers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Accel {
    /// Measured over nominal scale; rows are sensors, columns axes.
    #[serde(rename = "M_a")]
    pub response: [[f64; 3]; 3],
    /// Measured less true.
    #[serde(rename = "b_a_mg")]
    pub bias_mg: [f64; 3],
    /// Change with temperature.
    pub temp_coeff: TempCoeff,
    /// Allan coefficient N, worst axis.
    #[serde(rename = "VRW_mps2_per_sqrtHz")]
    pub walk_mps2_per_sqrt_hz: Option<f64>,
}

/// Change with temperature.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TempCoeff {
    /// Null until temperature cycles were run.
    #[serde(rename = "b_a_mg_per_C")]
    pub bias_mg_per_c: Option<[f64; 3]>,
}

/// Gyroscopes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gyro {
    /// Measured over nominal scale; rows are sensors, columns axes.
    #[serde(rename = "M_g")]
    pub response: [[f64; 3]; 3],
    /// Measured less true.
    #[serde(rename = "b_g_dps")]
    pub bias_dps: [f64; 3],
    /// Each gyroscope's largest g-sensitivity with its sign.
    #[serde(rename = "K_g_dps_per_g")]
    pub per_g_dps: [f64; 3],
    /// All of it; rows are sensors, columns axes.
    #[serde(rename = "K_g_full_dps_per_g")]
    pub per_g_full_dps: [[f64; 3]; 3],
    /// Allan coefficient N, worst axis.
    #[serde(rename = "ARW_dps_per_sqrtHz")]
    pub walk_dps_per_sqrt_hz: Option<f64>,
    /// Flat part / 0.664, worst axis; null where an axis shows none.
    pub bias_instability_dph: Option<f64>,
}

/// Expanded uncertainty of the compensated output at zero input, worst axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Uncertainty {
    /// Coverage factor of both.
    pub k: f64,
    /// Of the accelerometers.
    #[serde(rename = "U_accel_mg")]
    pub accel_mg: f64,
    /// Of the gyroscopes.
    #[serde(rename = "U_gyro_dps")]
    pub gyro_dps: f64,
}

impl Passport {
    /// From what the items of a run found, oldest first.
    ///
    /// # Errors
    /// [`FigureError::NotCalibrated`] names the item whose results are missing.
    pub fn of(
        device_id: &str,
        supply_v: Option<f64>,
        origin: Origin,
        found: &[(String, Findings)],
    ) -> Result<Self, FigureError> {
        use gnc_executive::catalogue::ItemId;
        let calibration = Calibration::of(found)?;
        let six = part(found, "accel").ok_or(FigureError::NotCalibrated { item: ItemId::SixPosition })?;
        let still = part(found, "gyro_still").ok_or(FigureError::NotCalibrated { item: ItemId::GyroStill })?;
        let missing = FigureError::NotCalibrated { item: ItemId::Rotation };
        let scale = calibration.gyro_scale.ok_or(missing)?;
        let accel = calibration.accel.ok_or(FigureError::NotCalibrated { item: ItemId::SixPosition })?;
        let per_g_full_dps = [0, 1, 2].map(|i| {
            [0, 1, 2].map(|j| {
                number(still, &format!("g_sensitivity_{}{}", AXES[i], AXES[j]), Unit::DegreePerSecondPerGravity)
            })
        });
        let biases =
            |findings: &Findings, unit| [0, 1, 2].map(|i| number(findings, &format!("bias_{}", AXES[i]), unit));
        Ok(Self {
            device_id: device_id.to_owned(),
            conditions: Conditions { temperature_range_c: temperatures(found), supply_v, vibration_and_shock: None },
            accel: Accel {
                response: relative(inverse(&accel.matrix), ACCEL_LSB_PER_G / STANDARD_GRAVITY_MPS2),
                bias_mg: biases(six, Unit::Milligravity),
                temp_coeff: TempCoeff { bias_mg_per_c: None },
                walk_mps2_per_sqrt_hz: worst(found, "velocity_random_walk_", Unit::MetrePerSecondPerRootHour)
                    .map(|walk| walk / 60.0),
            },
            gyro: Gyro {
                response: relative(matrix(&scale.response), GYRO_LSB_PER_DPS * 1.0_f64.to_degrees()),
                bias_dps: biases(still, Unit::DegreePerSecond),
                per_g_dps: per_g_full_dps.map(largest),
                per_g_full_dps,
                walk_dps_per_sqrt_hz: worst(found, "angle_random_walk_", Unit::DegreePerSecondPerRootHertz),
                bias_instability_dph: worst(found, "bias_instability_gyro_", Unit::DegreePerHour),
            },
            magnetometer: calibration.mag,
            uncertainty: uncertainty(six, still),
            origin,
        })
    }
}

/// The newest findings that hold this part of a calibration.
fn part<'f>(found: &'f [(String, Findings)], key: &str) -> Option<&'f Findings> {
    let holds =
        |findings: &&Findings| findings.details.get("calibration").is_some_and(|parts| parts.get(key).is_some());
    found.iter().rev().map(|(_, findings)| findings).find(holds)
}

/// A number in a unit; NaN where there is none.
fn number(findings: &Findings, name: &str, unit: Unit) -> f64 {
    match findings.value(name) {
        Some(Value::Number(quantity) | Value::Estimate(quantity, _)) => quantity.in_unit(unit).unwrap_or(f64::NAN),
        _ => f64::NAN,
    }
}

/// The largest of the three axes; `None` unless all three were found.
fn worst(found: &[(String, Findings)], prefix: &str, unit: Unit) -> Option<f64> {
    let of_item = |findings: &Findings| AXES.map(|axis| number(findings, &format!("{prefix}{axis}"), unit));
    let figures = found.iter().rev().map(|(_, findings)| of_item(findings));
    let figures = figures.into_iter().find(|figures| figures.iter().any(|figure| figure.is_finite()))?;
    figures.iter().all(|figure| figure.is_finite()).then(|| figures.into_iter().fold(0.0, f64::max))
}

/// From the means of the items and their drifts.
fn temperatures(found: &[(String, Findings)]) -> Option<[f64; 2]> {
    let spans = found.iter().filter_map(|(_, findings)| {
        let mean = Some(number(findings, "temperature", Unit::DegreeCelsius)).filter(|mean| mean.is_finite())?;
        let drift = number(findings, "temperature_drift", Unit::DegreeCelsius);
        let half = if drift.is_finite() { drift / 2.0 } else { 0.0 };
        Some((mean - half, mean + half))
    });
    spans.fold(None, |range: Option<[f64; 2]>, (low, high)| match range {
        None => Some([low, high]),
        Some(range) => Some([range[0].min(low), range[1].max(high)]),
    })
}

/// Both with the larger of their coverage factors.
fn uncertainty(six: &Findings, still: &Findings) -> Uncertainty {
    let of = |findings: &Findings, unit: Unit| {
        let known = AXES.iter().filter_map(|axis| match findings.value(&format!("bias_{axis}")) {
            Some(Value::Estimate(quantity, known)) => {
                let known = known.in_unit(quantity.unit, unit)?;
                Some((known.expanded()? / known.k?, known.k?))
            }
            _ => None,
        });
        known.fold((0.0_f64, 0.0_f64), |(u, k), (one, factor)| (u.max(one), k.max(factor)))
    };
    let ((accel, accel_k), (gyro, gyro_k)) = (of(six, Unit::Milligravity), of(still, Unit::DegreePerSecond));
    let k = accel_k.max(gyro_k);
    Uncertainty { k, accel_mg: k * accel, gyro_dps: k * gyro }
}

fn matrix(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| rows[i][j])
}

fn inverse(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    matrix(rows).try_inverse().unwrap_or_else(|| Matrix3::repeat(f64::NAN))
}

fn relative(response: Matrix3<f64>, nominal: f64) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| response[(i, j)] / nominal))
}

fn largest(row: [f64; 3]) -> f64 {
    row.into_iter().fold(0.0, |most: f64, value| if value.abs() > most.abs() { value } else { most })
}

#[cfg(test)]
mod tests;
