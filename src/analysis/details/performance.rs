//! Details of the items that measure a calibrated module: noise, wander, steps, fixes.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::DetailsPart;

/// Allan deviations of the channels, `gyro_x` and so on.
pub const CURVES: DetailsPart<BTreeMap<String, AllanCurve>> = DetailsPart::new("curves");
/// Power spectra of the channels.
pub const SPECTRA: DetailsPart<BTreeMap<String, SpectrumDetails>> = DetailsPart::new("spectra");
/// Means of blocks or of runs of the channels.
pub const SERIES: DetailsPart<BTreeMap<String, BlockMeans>> = DetailsPart::new("series");
/// Length of the blocks of [`SERIES`].
pub const BLOCK_S: DetailsPart<f64> = DetailsPart::new("block_s");
/// Responses of the accelerometers in each calibration, counts per unit.
pub const ACCEL_RESPONSES: DetailsPart<Vec<[[f64; 3]; 3]>> = DetailsPart::new("responses_accel");
/// Responses of the gyroscopes in each calibration, counts per unit.
pub const GYRO_RESPONSES: DetailsPart<Vec<[[f64; 3]; 3]>> = DetailsPart::new("responses_gyro");
/// Responses to small steps of the channels.
pub const STEPS: DetailsPart<Vec<StepResponse>> = DetailsPart::new("steps");
/// Fixes about the surveyed antenna.
pub const SCATTER: DetailsPart<FixScatter> = DetailsPart::new("scatter");
/// Mean of the fixes about the surveyed antenna.
pub const MEAN_ERROR_M: DetailsPart<MeanError> = DetailsPart::new("mean_error_m");

/// An Allan deviation and its noise coefficients.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AllanCurve {
    /// Unit of the deviation.
    pub unit: String,
    /// Points by rising averaging time.
    pub points: Vec<AllanPoint>,
    /// Why a coefficient is missing, by its letter.
    pub reasons: BTreeMap<String, String>,
    /// How well the fit of the noise terms holds.
    pub fit: Option<serde_json::Value>,
    /// N from the level part of the spectrum.
    #[serde(rename = "N_psd")]
    pub n_psd: Option<CoefficientDetails>,
    /// The largest B that the record leaves open.
    #[serde(rename = "B_upper_bound")]
    pub b_upper_bound: Option<f64>,
    /// Meaning of that bound, in words.
    #[serde(rename = "B_upper_bound_label")]
    pub b_upper_bound_label: String,
    /// Quantisation.
    #[serde(rename = "Q")]
    pub q: Option<CoefficientDetails>,
    /// Random walk of the angle or the velocity.
    #[serde(rename = "N")]
    pub n: Option<CoefficientDetails>,
    /// Bias instability.
    #[serde(rename = "B")]
    pub b: Option<CoefficientDetails>,
    /// Random walk of the rate or the acceleration.
    #[serde(rename = "K")]
    pub k: Option<CoefficientDetails>,
    /// Ramp.
    #[serde(rename = "R")]
    pub r: Option<CoefficientDetails>,
}

/// A deviation at one averaging time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AllanPoint {
    /// Averaging time.
    pub tau_s: f64,
    /// The deviation.
    pub dev: f64,
    /// Lower end of its 68.3 % interval.
    pub low: f64,
    /// Upper end of the same interval.
    pub high: f64,
    /// Equivalent degrees of freedom.
    pub edf: Option<f64>,
    /// Differences averaged.
    pub n: usize,
    /// Noise type on which the interval rests.
    pub noise: Option<String>,
}

/// A noise coefficient with its interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CoefficientDetails {
    /// Value of the coefficient.
    pub value: f64,
    /// Lower end of the interval.
    pub low: Option<f64>,
    /// Upper end of the interval.
    pub high: Option<f64>,
}

/// A power spectrum with its level part and its strongest line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpectrumDetails {
    /// Unit of the density.
    pub unit: String,
    /// Segments averaged.
    pub segments: usize,
    /// Step from one density to the next. The first density is that of 0.
    pub frequency_step_hz: Option<f64>,
    /// One-sided densities.
    pub density: Vec<f64>,
    /// Density of the level part.
    pub white: Option<f64>,
    /// Frequency at which the level part begins.
    pub white_from_hz: Option<f64>,
    /// Frequency at which the level part ends.
    pub white_to_hz: Option<f64>,
    /// The line that stands out most.
    pub strongest_line: SpectralLine,
}

/// A line of a spectrum.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpectralLine {
    /// Frequency of the line.
    pub frequency_hz: f64,
    /// Density of the line over that of its neighbours.
    pub over_neighbours: Option<f64>,
}

/// Means of a channel's blocks or runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BlockMeans {
    /// Unit of the means.
    pub unit: String,
    /// Mean of the means.
    pub mean: f64,
    /// Standard deviation of the means (n - 1).
    pub sd: Option<f64>,
    /// Degrees of freedom of `sd`, where they are not n - 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dof: Option<f64>,
    /// One mean for each block or run.
    pub means: Vec<f64>,
}

/// The response of a channel to a small step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepResponse {
    /// Triad and axis.
    pub channel: String,
    /// Size of the step.
    pub step: f64,
    /// Unit of the step.
    pub unit: String,
    /// Measured step over true step, upwards.
    pub response_up: f64,
    /// Measured step over true step, downwards.
    pub response_down: f64,
    /// Degrees of freedom of the worse response.
    pub dof: Option<f64>,
}

/// Fixes about the surveyed antenna, thinned evenly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FixScatter {
    /// Stride of the epochs that are kept.
    pub every: usize,
    /// Number of the epoch, from 0.
    pub epoch: Vec<usize>,
    /// East of the antenna.
    pub east_m: Vec<f64>,
    /// North of the antenna.
    pub north_m: Vec<f64>,
    /// Above the antenna; null where the receiver gave no height.
    pub up_m: Vec<Option<f64>>,
}

/// Mean of the fixes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MeanError {
    /// East of the antenna.
    pub east: f64,
    /// North of the antenna.
    pub north: f64,
    /// Above the antenna; null where the receiver gave no height.
    pub up: Option<f64>,
}
