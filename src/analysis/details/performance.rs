//! Details of the items that a calibrated module is measured by: noise, wander, steps, fixes.

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

/// An Allan deviation and the noise coefficients it shows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AllanCurve {
    /// Of the deviation.
    pub unit: String,
    /// By rising averaging time.
    pub points: Vec<AllanPoint>,
    /// Why a coefficient is missing, by its letter.
    pub reasons: BTreeMap<String, String>,
    /// How well the fit of the noise terms holds.
    pub fit: Option<serde_json::Value>,
    /// N by the level part of the spectrum.
    #[serde(rename = "N_psd")]
    pub n_psd: Option<CoefficientDetails>,
    /// The largest B that the record leaves open.
    #[serde(rename = "B_upper_bound")]
    pub b_upper_bound: Option<f64>,
    /// What that is.
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
    /// Upper end of the same.
    pub high: f64,
    /// Equivalent degrees of freedom.
    pub edf: Option<f64>,
    /// Differences averaged.
    pub n: usize,
    /// The noise on which the interval rests.
    pub noise: Option<String>,
}

/// A noise coefficient with its interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CoefficientDetails {
    /// Its value.
    pub value: f64,
    /// Lower end of its interval.
    pub low: Option<f64>,
    /// Upper end of the same.
    pub high: Option<f64>,
}

/// A power spectrum with its level part and its strongest line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpectrumDetails {
    /// Of the density.
    pub unit: String,
    /// Segments averaged.
    pub segments: usize,
    /// From one density to the next, the first of which is that of 0.
    pub frequency_step_hz: Option<f64>,
    /// One-sided.
    pub density: Vec<f64>,
    /// Of the level part.
    pub white: Option<f64>,
    /// Where that begins.
    pub white_from_hz: Option<f64>,
    /// Where that ends.
    pub white_to_hz: Option<f64>,
    /// What stands out most.
    pub strongest_line: SpectralLine,
}

/// A line of a spectrum.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpectralLine {
    /// Where it is.
    pub frequency_hz: f64,
    /// Its density over that of its neighbours.
    pub over_neighbours: Option<f64>,
}

/// Means of a channel's blocks or runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BlockMeans {
    /// Of the means.
    pub unit: String,
    /// Of the means.
    pub mean: f64,
    /// Of the means (n - 1).
    pub sd: Option<f64>,
    /// Degrees of freedom of that, where they are not n - 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dof: Option<f64>,
    /// One for each block or run.
    pub means: Vec<f64>,
}

/// How a channel followed a small step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepResponse {
    /// Triad and axis.
    pub channel: String,
    /// Size of the step.
    pub step: f64,
    /// Its unit.
    pub unit: String,
    /// Seen over true, upwards.
    pub response_up: f64,
    /// Seen over true, downwards.
    pub response_down: f64,
    /// Degrees of freedom of the worse of both.
    pub dof: Option<f64>,
}

/// Fixes about the surveyed antenna, thinned evenly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FixScatter {
    /// One epoch of so many is kept.
    pub every: usize,
    /// Its number from 0.
    pub epoch: Vec<usize>,
    /// East of the antenna.
    pub east_m: Vec<f64>,
    /// North of it.
    pub north_m: Vec<f64>,
    /// Above it; null where the receiver gave no height.
    pub up_m: Vec<Option<f64>>,
}

/// Mean of the fixes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MeanError {
    /// East of the antenna.
    pub east: f64,
    /// North of it.
    pub north: f64,
    /// Above it; null where the receiver gave no height.
    pub up: Option<f64>,
}
