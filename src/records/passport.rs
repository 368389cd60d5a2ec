//! The sensor passport of a module: its content, computed from what the items found, without I/O.
//!
//! The key names are the published ones (document 5 of the module's specification). The source does not say what they
//! mean; `docs/passport.schema.json` does. A value that was not measured is null, never a guess.
//!
//! [`of_run`] decides which runs have a passport; `xml` writes it as XML with the same content.

mod of_run;
mod xml;

use gnc_analysis::details::ContributionDetails;
use gnc_analysis::figures::calibration::Mag;
use serde::{Deserialize, Serialize};

pub use of_run::{NoPassport, of_run};
pub(crate) use xml::xml_of;
pub use xml::{XmlError, xml};

/// The passport for programs: its file name in a run's folder.
pub const PASSPORT: &str = "passport.json";
/// The passport as XML, with the same content: its file name in a run's folder.
pub const PASSPORT_XML: &str = "passport.xml";

/// Where a calibration comes from: who or what calibrated, when, and by which plan.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Start of the calibration run, RFC 3339.
    pub date: String,
    /// The station and its slave board.
    pub means: String,
    /// The program with its version.
    pub program: String,
    /// The plan with its version.
    pub plan: String,
    /// SHA-256 of the plan with all that it includes.
    pub plan_sha256: String,
    /// Verdict of the run: passed or marginal.
    pub outcome: String,
    /// Whether the bench was simulated. A simulated calibration is not evidence about any module.
    pub simulated: bool,
    /// Whether the link to the board does not prove that there was one, so that a program may have played it. Such a calibration
    /// is not evidence about any module either.
    #[serde(default)]
    pub unproven: bool,
    /// The run whose raw record was judged again by this plan; null if this run captured the samples itself.
    pub recomputed_from: Option<String>,
    /// The interrupted run whose captures were taken over.
    pub resumed_from: Option<String>,
    /// Numbers of orders, sub-units and others that were given for the run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub numbers: Vec<PassportNumber>,
    /// SHA-256 of the lines of SHA256SUMS for all files but the papers.
    pub record_sha256: String,
    /// Number and link of the line that the chain got when the run began: they witness all runs before it. Earlier versions
    /// wrote no such line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chain: Option<String>,
}

/// A number beside the serial number.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassportNumber {
    /// Its key in plan or bench file.
    pub key: String,
    /// Its name for people.
    pub label: String,
    /// The number.
    pub value: String,
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
    pub accel: PassportAccel,
    /// Gyroscopes.
    pub gyro: Gyro,
    /// Magnetometer; null if it was not calibrated.
    pub magnetometer: Option<Mag>,
    /// How the axes of the coefficients lie in the module.
    pub alignment: Alignment,
    /// Expanded uncertainty.
    pub uncertainty: PassportUncertainty,
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
    /// Conditions of vibration and shock tests (IEC 60068-2-6, -2-64, ISO 16063-31); null without such tests.
    pub vibration_and_shock: Option<String>,
}

/// Accelerometers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassportAccel {
    /// Measured over nominal scale; rows are sensors, columns axes.
    #[serde(rename = "M_a")]
    pub response: [[f64; 3]; 3],
    /// Bias: measured less true.
    #[serde(rename = "b_a_mg")]
    pub bias_mg: [f64; 3],
    /// Change with temperature.
    pub temp_coeff: TempCoeff,
    /// Allan coefficient N, worst axis.
    #[serde(rename = "VRW_mps2_per_sqrtHz")]
    pub walk_mps2_per_sqrt_hz: Option<f64>,
    /// White level of the one-sided spectrum of each axis.
    #[serde(rename = "noise_density_ug_per_sqrtHz")]
    pub density_ug_per_sqrt_hz: Option<[f64; 3]>,
}

/// Change with temperature.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TempCoeff {
    /// Null until temperature cycles are run.
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
    /// Bias: measured less true.
    #[serde(rename = "b_g_dps")]
    pub bias_dps: [f64; 3],
    /// Each gyroscope's largest g-sensitivity with its sign.
    #[serde(rename = "K_g_dps_per_g")]
    pub per_g_dps: [f64; 3],
    /// The full g-sensitivity; rows are sensors, columns axes.
    #[serde(rename = "K_g_full_dps_per_g")]
    pub per_g_full_dps: [[f64; 3]; 3],
    /// Allan coefficient N, worst axis.
    #[serde(rename = "ARW_dps_per_sqrtHz")]
    pub walk_dps_per_sqrt_hz: Option<f64>,
    /// White level of the one-sided spectrum of each axis.
    #[serde(rename = "noise_density_dps_per_sqrtHz")]
    pub density_dps_per_sqrt_hz: Option<[f64; 3]>,
    /// Flat part of the Allan deviation / 0.664, worst axis; null if an axis shows no flat part.
    pub bias_instability_dph: Option<f64>,
}

/// How the axes of the coefficients lie in the module. The coefficients are relative to the axes of the table on which
/// the module was calibrated. The seat of the module is mounted on that table with a small rotation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Alignment {
    /// Rotation vector from the table's axes to those of the seat; null if it was not measured.
    pub mounting_deg: Option<[f64; 3]>,
    /// Standard uncertainty of the mounting about each axis.
    pub mounting_u_deg: Option<f64>,
    /// Departures of the angles between the accelerometers' own axes xy, xz, yz from 90 degrees, independent of the
    /// seat.
    pub nonorthogonality_accel_ppm: [f64; 3],
    /// The same for the gyroscopes.
    pub nonorthogonality_gyro_ppm: [f64; 3],
}

/// Expanded uncertainty of the compensated output at zero input, worst axis, with its budget.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassportUncertainty {
    /// Coverage factor of both uncertainties.
    pub k: f64,
    /// Expanded uncertainty of the accelerometers.
    #[serde(rename = "U_accel_mg")]
    pub accel_mg: f64,
    /// Expanded uncertainty of the gyroscopes.
    #[serde(rename = "U_gyro_dps")]
    pub gyro_dps: f64,
    /// The budget of every figure of the calibration.
    pub budget: Vec<PassportBudget>,
}

/// Uncertainty budget of one figure (GUM; Welch-Satterthwaite).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassportBudget {
    /// The item of the plan that measured the figure.
    pub item: String,
    /// Name of the figure in the record.
    pub figure: String,
    /// Unit of `u` and `U`.
    pub unit: String,
    /// Combined standard uncertainty.
    pub u: f64,
    /// Effective degrees of freedom; null means infinite.
    pub dof: Option<f64>,
    /// Coverage factor; null if there is none.
    pub k: Option<f64>,
    /// Expanded uncertainty `k u`.
    #[serde(rename = "U")]
    pub expanded: Option<f64>,
    /// Probability of the interval of `U`.
    pub probability: f64,
    /// The contributions that it combines.
    pub contributions: Vec<ContributionDetails>,
}

#[cfg(test)]
mod tests;
