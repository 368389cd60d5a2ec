//! Scale factors and couplings of the gyroscopes from turns by a known angle.

use gnc_executive::bench::BenchSite;
use gnc_executive::catalogue::calibration::{BIAS_AT_ATTITUDE, SCALE_ERROR, TURN_MISMATCH};
use gnc_executive::quantity::Unit;
use gnc_metrology::rotation;
use gnc_protocol::stream::{GYRO_LSB_PER_DPS, SATURATION};
use gnc_rig::Along;
use nalgebra::Vector3;
use serde_json::json;

use super::axes::TriadFrames;
use super::budget::Budget;
use super::calibration::{CALIBRATION, GyroScale, ModuleCalibration};
use super::captures::{self, AXES, Triad};
use super::json::{matrix, rows, vector};
use super::rest_noise::{Rest, RestNoise};
use super::six_position::temperatures;
use super::{AnalysisInput, FigureError, Findings, clock, place, thin};
use crate::capture::{Capture, Pose};
use crate::details::calibrating::{TURNS, TableTurn, TurnWindow, WINDOWS};

/// The terms of the plan that the budgets need.
#[derive(Debug, Clone, Copy)]
pub(super) struct RotationTerms {
    angle_rad: f64,
    clock: clock::ClockTerms,
    pose_rad: f64,
    band_percent: f64,
    latitude_deg: Option<f64>,
}

impl RotationTerms {
    pub(super) fn of(question: &AnalysisInput<'_>) -> Result<Self, FigureError> {
        let params = question.params;
        Ok(Self {
            angle_rad: params.quantity("angle_u", Unit::Radian)?,
            clock: clock::ClockTerms::of(question)?,
            pose_rad: params.quantity("pose_u", Unit::Radian)?,
            band_percent: params.quantity("band", Unit::Percent)?,
            latitude_deg: question.site.and_then(|site| site.place).map(|place| place.latitude_deg),
        })
    }
}

/// A calibration with the data of its budgets.
#[derive(Debug)]
pub(super) struct RotationSolution {
    pub(super) found: rotation::RotationCalibration,
    turned_rad: f64,
    /// Time of the longest window, s.
    window_s: f64,
    along: Along,
    /// Noise of the sensors at rest, counts; `None` where the residuals of the fit give it.
    noise: Option<[RestNoise; 3]>,
    known: RotationTerms,
}

/// Returns the turn of a capture: axis, angle, direction of the axis.
fn turn_of(capture: &Capture) -> Option<(usize, f64, Along)> {
    match capture.about.pose {
        Pose::Rotating { axis, angle_deg, along, .. } => Some((usize::from(axis), angle_deg, along)),
        _ => None,
    }
}

/// Computes the calibration from the turns among the captures.
pub(super) fn solve<'c>(
    captures: impl IntoIterator<Item = &'c Capture>,
    known: RotationTerms,
) -> Result<RotationSolution, FigureError> {
    let turns: Vec<(&Capture, usize, f64, Along)> = captures
        .into_iter()
        .filter_map(|capture| turn_of(capture).map(|(axis, angle, along)| (capture, axis, angle, along)))
        .collect();
    let first = turns.first().ok_or_else(|| FigureError::Missing { what: "a turn".into() })?;
    let (angle_deg, along, rate_hz) = (first.2.abs(), first.3, first.0.about.rate_hz);
    for (capture, axis, angle, other) in &turns {
        let unfit = |why: &str| FigureError::Unfit { label: capture.about.label.clone(), why: why.into() };
        if *axis > 2 || (angle.abs() - angle_deg).abs() > 1e-6 || *other != along || capture.about.rate_hz != rate_hz {
            return Err(unfit("axis, angle, geometry or rate differ from those of the others"));
        }
        if (angle_deg / 360.0).fract() != 0.0 || angle_deg == 0.0 {
            return Err(unfit(
                "the angle is no whole number of turns, so that the earth's rotation does not average out",
            ));
        }
        captures::sound([*capture], &[Triad::Gyro])?;
    }
    let data: Vec<(String, [Vec<f64>; 3])> = turns
        .iter()
        .map(|(capture, axis, angle, _)| {
            let label = format!("{}{}", AXES[*axis], if *angle > 0.0 { "+" } else { "-" });
            (label, [0, 1, 2].map(|i| captures::channel(capture, Triad::Gyro, i)))
        })
        .collect();
    let runs: Vec<rotation::RotationRun<'_>> = data
        .iter()
        .map(|(label, channels)| rotation::RotationRun {
            label: label.clone(),
            channels: [&channels[0], &channels[1], &channels[2]],
        })
        .collect();
    let options = rotation::RotationOptions {
        rate_hz: known.clock.rate_hz(f64::from(rate_hz)),
        turns: angle_deg / 360.0,
        axis: match along {
            Along::Polar => rotation::RotationAxis::Polar,
            Along::Up => {
                rotation::RotationAxis::Vertical { latitude_deg: known.latitude_deg.ok_or(FigureError::NoPlace)? }
            }
            Along::North => rotation::RotationAxis::Unknown,
        },
        saturation: Some(f64::from(SATURATION)),
        nominal: Some((nominal(), known.band_percent)),
    };
    let found = rotation::calibrate(&runs, &options).map_err(FigureError::refused("gyroscope calibration"))?;
    // A vertical axis uses all data for parameters, so that only the rest shows the noise.
    let noise = match along {
        Along::Up => RestNoise::of(&rests(&data, &found.windows), options.rate_hz),
        Along::Polar | Along::North => None,
    };
    let longest = found.windows.iter().map(|window| window.end - window.start).max().unwrap_or(0);
    let window_s = longest as f64 / options.rate_hz;
    Ok(RotationSolution { found, turned_rad: angle_deg.to_radians(), window_s, along, noise, known })
}

/// Returns the rests before and after the window of each turn.
fn rests(data: &[(String, [Vec<f64>; 3])], windows: &[rotation::RotationWindow]) -> Vec<Rest> {
    let turns = data
        .iter()
        .filter_map(|(label, channels)| Some((windows.iter().find(|window| window.label == *label)?, channels)));
    turns
        .map(|(window, channels)| {
            let part = |range: std::ops::Range<usize>| -> Vec<Vector3<f64>> {
                range.map(|k| Vector3::from_fn(|i, _| channels[i][k])).collect()
            };
            Rest { before: part(0..window.start), after: part(window.end..channels[0].len()) }
        })
        .collect()
}

/// Counts for one rad/s.
fn nominal() -> f64 {
    GYRO_LSB_PER_DPS * 1.0_f64.to_degrees()
}

impl RotationSolution {
    /// Returns the budget of the response of sensor `i` to axis `j` over its own, ppm. With `i == j`: of the scale
    /// factor.
    pub(super) fn response_budget(&self, i: usize, j: usize) -> Budget {
        let own = self.found.response[(i, i)];
        let residual_ppm = self.found.response_sd[(i, j)] / own * 1e6;
        // Two windows of opposite directions: the noise of their difference over twice the angle.
        let per_mean = self.window_s / self.turned_rad / 2.0_f64.sqrt() / own * 1e6;
        let budget = self.noise_in(Budget::new(Unit::PartsPerMillion), i, residual_ppm, per_mean);
        if i == j {
            // The record cannot show an error that both directions share.
            let budget = budget.b("angle of the table", self.known.angle_rad, "rad", 1e6 / self.turned_rad);
            self.known.clock.in_budget(budget, 1.0)
        } else {
            budget.b("attitude of the axis", self.known.pose_rad, "rad", 1e6)
        }
    }

    /// Adds the noise of sensor `i` to the budget of a figure that changes by `per_mean` with the mean of a window,
    /// counts. `residual` is the value from the residuals, where they give one.
    fn noise_in(&self, budget: Budget, i: usize, residual: f64, per_mean: f64) -> Budget {
        let Some(noise) = self.noise.map(|noise| noise[i]) else {
            return budget.a("scatter of the residuals", residual, self.found.dof);
        };
        let [(short, short_dof), (slow, slow_dof)] = [noise.short(self.window_s), noise.slow()];
        budget.a("noise at rest", short * per_mean, short_dof).a(
            "bias that wanders between the rests",
            slow * per_mean,
            slow_dof,
        )
    }

    fn bias_budget(&self, i: usize) -> Budget {
        let dph = 1.0_f64.to_degrees() * 3600.0;
        let per_mean = dph / self.found.response[(i, i)] / 2.0_f64.sqrt();
        let budget = Budget::new(Unit::DegreePerHour);
        let budget = self.noise_in(budget, i, self.found.bias_sd_rps[i] * dph, per_mean);
        let budget = self.known.clock.in_budget(budget, self.found.bias_rps()[i] * dph * 1e-6);
        budget.bound("rotation of the earth, not removed", self.found.earth_bound_rps * dph, "deg/h", 1.0)
    }
}

pub(super) fn analyse(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    if question.params.choice("geometry")? == "vertical" {
        place::latitude(question.site)?;
    }
    let solved = solve(question.captures, RotationTerms::of(question)?)?;
    let c = &solved.found;
    let mut findings = Findings::new(details(&solved));
    for (i, measurement) in SCALE_ERROR.iter().enumerate() {
        let error_ppm = (c.response[(i, i)] / nominal() - 1.0) * 1e6;
        findings.figure(measurement, error_ppm, &solved.response_budget(i, i), probability);
    }
    let frames = TriadFrames { response: &c.response, fixture: BenchSite::fixture(question.site) };
    frames.report(&mut findings, |i, j| solved.response_budget(i, j), probability);
    for (i, measurement) in BIAS_AT_ATTITUDE.iter().enumerate() {
        let bias_dph = c.bias_rps()[i].to_degrees() * 3600.0;
        findings.figure(measurement, bias_dph, &solved.bias_budget(i), probability);
    }
    for (i, measurement) in TURN_MISMATCH.iter().enumerate() {
        findings.number(measurement, c.mismatch[i] * 1e6, Unit::PartsPerMillion);
    }
    temperatures(&mut findings, question.captures, Triad::Gyro);
    findings.part(&TURNS, turns(question.captures));
    findings.part(&WINDOWS, windows(question.captures, c));
    let scale = GyroScale { response: rows(&c.response), matrix: rows(&c.matrix) };
    findings.part(&CALIBRATION, ModuleCalibration { gyro_scale: Some(scale), ..ModuleCalibration::default() });
    Ok(findings)
}

/// Returns the rate about the turned axis over time, thinned, for every turn.
fn turns(captures: &[Capture]) -> Vec<TableTurn> {
    let turns = captures.iter().filter_map(|capture| turn_of(capture).map(|(axis, ..)| (capture, axis)));
    turns
        .map(|(capture, axis)| {
            let rates: Vec<f64> =
                captures::channel(capture, Triad::Gyro, axis).iter().map(|code| code / GYRO_LSB_PER_DPS).collect();
            let kept = thin::extremes(&rates);
            let rate_hz = f64::from(capture.about.rate_hz);
            TableTurn {
                capture: capture.about.label.clone(),
                axis: AXES[axis].to_owned(),
                time_s: thin::rounded(kept.iter().map(|place| *place as f64 / rate_hz), 4),
                rate_dps: thin::rounded(kept.iter().map(|place| rates[*place]), 4),
            }
        })
        .collect()
}

/// Returns the span over which each turn was summed.
fn windows(captures: &[Capture], found: &rotation::RotationCalibration) -> Vec<TurnWindow> {
    let rate_hz = captures.first().map_or(f64::NAN, |capture| f64::from(capture.about.rate_hz));
    let window = |window: &rotation::RotationWindow| TurnWindow {
        run: window.label.clone(),
        start_s: window.start as f64 / rate_hz,
        span_s: (window.end - window.start) as f64 / rate_hz,
        peak_dps: Some(window.peak_lsb / GYRO_LSB_PER_DPS),
        integral_counts_s: [0, 1, 2].map(|axis| Some(window.integral_lsb_s[axis])),
    };
    found.windows.iter().map(window).collect()
}

fn details(solved: &RotationSolution) -> serde_json::Value {
    let c = &solved.found;
    json!({
        "equation": "w = Kg N - epsilon, Kg = S^-1, epsilon = Kg b, from six integrals I = S (theta e_j + earth) + b T per sensor",
        "S": matrix(&c.response), "b_at_attitude": vector(&c.bias_lsb),
        "Kg": matrix(&c.matrix), "epsilon_at_attitude_rps": vector(&c.epsilon_rps),
        "S_sd": matrix(&c.response_sd), "Kg_sd": matrix(&c.matrix_sd), "epsilon_sd_rps": vector(&c.bias_sd_rps),
        "as_printed": {
            "k": matrix(&c.response.transpose()),
            "note": "the print indexes the matrix the other way round; its bias, a sum of integrals over 8 pi n, is no rate",
        },
        "geometry": match solved.along {
            Along::Up => "vertical axis: the horizontal earth rate is an unknown of each pair across the axis",
            Along::Polar => "polar axis",
            Along::North => "level axis: the rotation of the earth is not removed from the bias",
        },
        "sample_clock": solved.known.clock.details(),
        "latitude_deg": solved.known.latitude_deg, "turned_rad": solved.turned_rad,
        "mismatch": vector(&c.mismatch), "residual_rms_rad": c.residual_rms_rad,
        "dof": super::budget::finite(c.dof), "condition": c.condition,
        "label": "biases at this attitude: they hold g-sensitivity; bias and g-sensitivity come from still positions",
    })
}
