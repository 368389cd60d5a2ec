//! Details of the items that calibrate: residuals of the positions, the turns, the spins in the field.

use serde::{Deserialize, Serialize};

use super::DetailsPart;

/// Residuals of the accelerometers' fit.
pub const FORCE_RESIDUALS: DetailsPart<Vec<ForceResidual>> = DetailsPart::new("residuals");
/// Residuals of the gyroscopes' fit at rest.
pub const RATE_RESIDUALS: DetailsPart<Vec<RateResidual>> = DetailsPart::new("residuals");
/// The rates of the turns, thinned.
pub const TURNS: DetailsPart<Vec<TableTurn>> = DetailsPart::new("records");
/// The spans over which the turns were summed, in the order of [`TURNS`].
pub const WINDOWS: DetailsPart<Vec<TurnWindow>> = DetailsPart::new("windows");
/// The ellipse of each spin.
pub const SPINS: DetailsPart<Vec<FieldSpin>> = DetailsPart::new("spins");
/// The field of each spin, thinned, in the order of [`SPINS`].
pub const FIELD: DetailsPart<Vec<FieldPoints>> = DetailsPart::new("field");

/// Residual of the accelerometers in a position, m/s^2.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ForceResidual {
    /// Label of its capture.
    pub position: String,
    /// Residual of each axis.
    pub residual_mps2: [f64; 3],
}

/// Residual of the gyroscopes in a position, rad/s.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RateResidual {
    /// Label of its capture.
    pub position: String,
    /// Residual of each axis.
    pub residual_rps: [f64; 3],
}

/// A turn about an axis of the table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TableTurn {
    /// Label of its capture.
    pub capture: String,
    /// The sensor along the axis: x, y, z.
    pub axis: String,
    /// Time since the beginning of the capture.
    pub time_s: Vec<f64>,
    /// Rate of that sensor at nominal scale.
    pub rate_dps: Vec<f64>,
}

/// The span over which a turn was summed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TurnWindow {
    /// Label of the turn.
    pub run: String,
    /// Start of the span, since the beginning of the capture.
    pub start_s: f64,
    /// Length of the span.
    pub span_s: f64,
    /// Largest rate in the span.
    pub peak_dps: Option<f64>,
    /// Sums of the three sensors.
    pub integral_counts_s: [Option<f64>; 3],
}

/// A spin about the vertical axis, and the ellipse of its field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FieldSpin {
    /// Label of its capture.
    pub capture: String,
    /// The rate commanded to the table.
    pub told_dps: f64,
    /// The rate that the field shows.
    pub rate_dps: f64,
    /// Turns seen.
    pub turns: Option<f64>,
    /// Centre of the ellipse, gauss.
    pub centre: [f64; 2],
    /// Semi-axes of the ellipse, gauss.
    pub semi_axes: [f64; 2],
    /// Direction of the large axis from x.
    pub rotation_deg: f64,
    /// Radius of the circle of the corrected field, gauss.
    pub radius: f64,
    /// Zero of x, gauss.
    pub dx: f64,
    /// Zero of y, gauss.
    pub dy: f64,
    /// Factor on y.
    pub ky: f64,
    /// Sine of the departure from a right angle.
    pub sin_alpha: f64,
    /// The departure from a right angle.
    pub alpha_deg: f64,
    /// Standard uncertainties of the correction.
    pub sd: SpinSd,
    /// Root mean square distance of the points from the circle, gauss.
    pub residual_rms: Option<f64>,
    /// Distance of the farthest point, over the radius.
    pub residual_peak_relative: Option<f64>,
    /// Points left out.
    pub rejected: usize,
    /// Points used.
    pub used: usize,
    /// Degrees of freedom of the fit.
    pub dof: usize,
    /// Condition number of the fit.
    pub condition: Option<f64>,
    /// The widest gap between points, seen from the centre.
    pub gap_deg: Option<f64>,
    /// First and second harmonic of the roll angle's error.
    pub roll_harmonics_deg: [Option<f64>; 2],
    /// The same figures by the formulas of the printed method.
    pub as_printed: SpinAsPrinted,
}

/// Standard uncertainties of a spin's correction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpinSd {
    /// Standard uncertainty of the zero of x, gauss.
    pub dx: Option<f64>,
    /// Standard uncertainty of the zero of y, gauss.
    pub dy: Option<f64>,
    /// Standard uncertainty of the factor on y.
    pub ky: Option<f64>,
    /// Standard uncertainty of the sine.
    pub sin_alpha: Option<f64>,
}

/// The figures of a spin by the formulas of the printed method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpinAsPrinted {
    /// Zero of x, gauss.
    pub dx: Option<f64>,
    /// Zero of y, gauss.
    pub dy: Option<f64>,
    /// Factor on y.
    pub ky: Option<f64>,
    /// Root mean square distance of the points from the circle, gauss.
    pub residual_rms: Option<f64>,
    /// Harmonics of the roll angle's error.
    pub roll_harmonics_deg: [Option<f64>; 2],
}

/// Points of the raw field in the plane of rotation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FieldPoints {
    /// Label of its capture.
    pub capture: String,
    /// Field along x at nominal scale.
    pub x_gauss: Vec<f64>,
    /// Field along y at nominal scale.
    pub y_gauss: Vec<f64>,
}
