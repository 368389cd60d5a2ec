//! Details of the items that calibrate: what a fit left in each position, the turns, the spins in the field.

use serde::{Deserialize, Serialize};

use super::DetailsPart;

/// What the accelerometers' fit left.
pub const FORCE_RESIDUALS: DetailsPart<Vec<ForceResidual>> = DetailsPart::new("residuals");
/// What the gyroscopes' fit at rest left.
pub const RATE_RESIDUALS: DetailsPart<Vec<RateResidual>> = DetailsPart::new("residuals");
/// The rates of the turns, thinned.
pub const TURNS: DetailsPart<Vec<TableTurn>> = DetailsPart::new("records");
/// The spans over which the turns were summed, in the order of [`TURNS`].
pub const WINDOWS: DetailsPart<Vec<TurnWindow>> = DetailsPart::new("windows");
/// The ellipse of each spin.
pub const SPINS: DetailsPart<Vec<FieldSpin>> = DetailsPart::new("spins");
/// The field of each spin, thinned, in the order of [`SPINS`].
pub const FIELD: DetailsPart<Vec<FieldPoints>> = DetailsPart::new("field");

/// Of a position, m/s^2.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ForceResidual {
    /// Label of its capture.
    pub position: String,
    /// Of each axis.
    pub residual_mps2: [f64; 3],
}

/// Of a position, rad/s.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RateResidual {
    /// Label of its capture.
    pub position: String,
    /// Of each axis.
    pub residual_rps: [f64; 3],
}

/// A turn about an axis of the table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TableTurn {
    /// Label of its capture.
    pub capture: String,
    /// The sensor along the axis: x, y, z.
    pub axis: String,
    /// Since the begin of the capture.
    pub time_s: Vec<f64>,
    /// Of that sensor at nominal scale.
    pub rate_dps: Vec<f64>,
}

/// The span over which a turn was summed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TurnWindow {
    /// Label of the turn.
    pub run: String,
    /// Since the begin of its capture.
    pub start_s: f64,
    /// Its length.
    pub span_s: f64,
    /// Largest rate in it.
    pub peak_dps: Option<f64>,
    /// Sums of the three sensors.
    pub integral_counts_s: [Option<f64>; 3],
}

/// A spin about the vertical axis, and the ellipse that the field went along.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FieldSpin {
    /// Label of its capture.
    pub capture: String,
    /// The rate that the table was told.
    pub told_dps: f64,
    /// The rate that the field shows.
    pub rate_dps: f64,
    /// Turns seen.
    pub turns: Option<f64>,
    /// Of the ellipse, gauss.
    pub centre: [f64; 2],
    /// Of the ellipse, gauss.
    pub semi_axes: [f64; 2],
    /// Of the large axis from x.
    pub rotation_deg: f64,
    /// Of the circle of the corrected field, gauss.
    pub radius: f64,
    /// Zero of x, gauss.
    pub dx: f64,
    /// Zero of y, gauss.
    pub dy: f64,
    /// Factor on y.
    pub ky: f64,
    /// Sine of the departure from a right angle.
    pub sin_alpha: f64,
    /// That departure.
    pub alpha_deg: f64,
    /// Standard uncertainties of the correction.
    pub sd: SpinSd,
    /// Of the points off the circle, gauss.
    pub residual_rms: Option<f64>,
    /// The farthest point, over the radius.
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
    /// The same by the formulas of the printed method.
    pub as_printed: SpinAsPrinted,
}

/// Standard uncertainties of a spin's correction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpinSd {
    /// Of the zero of x, gauss.
    pub dx: Option<f64>,
    /// Of the zero of y, gauss.
    pub dy: Option<f64>,
    /// Of the factor on y.
    pub ky: Option<f64>,
    /// Of the sine.
    pub sin_alpha: Option<f64>,
}

/// What the formulas of the printed method give for a spin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpinAsPrinted {
    /// Zero of x, gauss.
    pub dx: Option<f64>,
    /// Zero of y, gauss.
    pub dy: Option<f64>,
    /// Factor on y.
    pub ky: Option<f64>,
    /// Of the points off the circle, gauss.
    pub residual_rms: Option<f64>,
    /// Harmonics of the roll angle's error.
    pub roll_harmonics_deg: [Option<f64>; 2],
}

/// Points of the raw field in the plane of rotation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FieldPoints {
    /// Label of its capture.
    pub capture: String,
    /// At nominal scale.
    pub x_gauss: Vec<f64>,
    /// At nominal scale.
    pub y_gauss: Vec<f64>,
}
