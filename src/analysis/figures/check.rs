//! A position and a rotation as the board compensates them with the calibration that the module now holds. The results
//! must be gravity and the angle turned.

use gnc_executive::catalogue::ItemId;
use gnc_executive::catalogue::calibration::{ANGLE_ERROR, CROSS_ANGLE, FORCE_ERROR, RATE_ERROR};
use gnc_executive::quantity::Unit;
use gnc_metrology::{earth, stats};
use gnc_protocol::calibration::{CompensatedSample, FORCE_PER_MPS2, RATE_PER_RPS};
use nalgebra::Vector3;
use serde_json::json;

use super::budget::Budget;
use super::calibration::COEFFICIENTS;
use super::captures;
use super::json::vector;
use super::mean::{self, BLOCKS};
use super::{AnalysisInput, FigureError, Findings, clock, place};
use crate::capture::{Capture, Pose};

/// Fewest samples of a capture.
const FEWEST: usize = 8;
/// Channels whose bits of [`CompensatedSample::saturated`] count here, in order.
const CHANNELS: [&str; 6] = ["gyro x", "gyro y", "gyro z", "accel x", "accel y", "accel z"];
const MG: f64 = 1e3 / earth::STANDARD_GRAVITY_MPS2;

pub(super) fn analyse(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    if !question.earlier.iter().any(|(_, findings)| findings.details.get(COEFFICIENTS.key()).is_some()) {
        return Err(FigureError::NotCalibrated { item: ItemId::CalibrationDownload });
    }
    for capture in question.captures {
        sound(capture)?;
    }
    let mut findings = Findings::new(json!({
        "equation": "f - g up and w - w_earth of the position; integral of w about the axis over the turn, less the angle",
        "label": "output of the board, compensated by the coefficients that the module holds",
    }));
    position(question, &mut findings, probability)?;
    turn(question, &mut findings, probability)?;
    Ok(findings)
}

/// Checks that nothing is missing or saturated, and that the board compensated the samples.
fn sound(capture: &Capture) -> Result<(), FigureError> {
    let label = || capture.about.label.clone();
    if capture.losses.any() {
        return Err(FigureError::Lost { label: label(), losses: capture.losses });
    }
    if capture.compensated.len() < FEWEST {
        return Err(FigureError::Short { label: label(), samples: capture.compensated.len(), needed: FEWEST });
    }
    for (bit, name) in CHANNELS.iter().enumerate() {
        let samples = capture.compensated.iter().filter(|sample| sample.saturated & (1 << bit) != 0).count();
        if samples > 0 {
            return Err(FigureError::Saturated { label: label(), channel: (*name).to_owned(), samples });
        }
    }
    Ok(())
}

fn rate_rps(sample: &CompensatedSample) -> Vector3<f64> {
    Vector3::from(sample.rate.map(f64::from)) / RATE_PER_RPS
}

fn force_mps2(sample: &CompensatedSample) -> Vector3<f64> {
    Vector3::from(sample.force.map(f64::from)) / FORCE_PER_MPS2
}

fn mean_of(samples: &[CompensatedSample], of: fn(&CompensatedSample) -> Vector3<f64>) -> Vector3<f64> {
    samples.iter().map(of).sum::<Vector3<f64>>() / samples.len() as f64
}

/// Means of equal parts. Their scatter gives the noise of the whole mean.
fn blocks(samples: &[CompensatedSample], of: fn(&CompensatedSample) -> Vector3<f64>) -> Vec<Vector3<f64>> {
    samples.chunks_exact((samples.len() / BLOCKS).max(1)).map(|part| mean_of(part, of)).collect()
}

fn position(question: &AnalysisInput<'_>, findings: &mut Findings, p: f64) -> Result<(), FigureError> {
    let missing = || FigureError::Missing { what: "a position".into() };
    let (capture, up, heading_deg) = captures::lying(question.captures).next().ok_or_else(missing)?;
    let needed = (question.params.quantity("dwell", Unit::Second)? * f64::from(capture.about.rate_hz)).floor() as usize;
    let samples = capture.compensated.len();
    if samples < needed {
        return Err(FigureError::Short { label: capture.about.label.clone(), samples, needed });
    }
    let gravity = place::gravity(question.site)?.mps2;
    let (vertical, level) = place::earth_rate(question.site)?;
    let (north, east) = place::north_east(&up, heading_deg);
    let known = question.params.choice("heading")? == "known";
    let earth_rps = up * vertical + if known { north * level } else { Vector3::zeros() };
    let pose_rad = question.params.quantity("pose_u", Unit::Radian)?;
    let gravity_ppm = question.params.quantity("gravity_u", Unit::PartsPerMillion)?;
    let heading_u = if known { question.params.quantity("heading_u", Unit::Radian)? } else { 0.0 };
    let forces = blocks(&capture.compensated, force_mps2);
    let rates = blocks(&capture.compensated, rate_rps);
    let noise = |values: &[Vector3<f64>], i: usize| mean::variance(&[values.iter().map(|value| value[i]).collect()]);
    let force_error = (mean_of(&capture.compensated, force_mps2) - up * gravity) * MG;
    for (i, measurement) in FORCE_ERROR.iter().enumerate() {
        let noise = noise(&forces, i);
        let level = (1.0 - up[i] * up[i]).max(0.0).sqrt();
        // The errors of the calibration's positions are a part of the error that the calibration leaves.
        let budget = Budget::new(Unit::Milligravity)
            .a("noise of the mean", noise.sd() * MG, noise.dof)
            .b("attitude", pose_rad, "rad", level * gravity * MG)
            .b("gravity", gravity_ppm, "ppm", up[i] * gravity * MG * 1e-6);
        findings.figure(measurement, force_error[i], &budget, p);
    }
    let dph = 3600.0 * 1.0_f64.to_degrees();
    let rate_error = (mean_of(&capture.compensated, rate_rps) - earth_rps) * dph;
    for (i, measurement) in RATE_ERROR.iter().enumerate() {
        let noise = noise(&rates, i);
        let left = if known { 0.0 } else { level * (1.0 - up[i] * up[i]).max(0.0).sqrt() };
        let budget = Budget::new(Unit::DegreePerHour)
            .a("noise of the mean", noise.sd() * dph, noise.dof)
            .b("heading", heading_u, "rad", east[i] * level * dph)
            .bound("heading unknown: horizontal earth rate", left * dph, "deg/h", 1.0);
        findings.figure(measurement, rate_error[i], &budget, p);
    }
    findings.detail("position", json!({ "up": vector(&up), "heading_deg": heading_deg, "gravity_mps2": gravity }));
    Ok(())
}

fn turn(question: &AnalysisInput<'_>, findings: &mut Findings, p: f64) -> Result<(), FigureError> {
    let turning = question.captures.iter().find_map(|capture| match capture.about.pose {
        Pose::Rotating { axis, angle_deg, .. } if axis < 3 => Some((capture, usize::from(axis), angle_deg)),
        _ => None,
    });
    let (capture, axis, angle_deg) = turning.ok_or_else(|| FigureError::Missing { what: "a turn".into() })?;
    let clock = clock::ClockTerms::of(question)?;
    let turned = integrate(capture, axis, &clock)?;
    let noise_rad = turned.noise_rad(question);
    let told_rad = angle_deg.to_radians();
    let ppm = |rad: f64| rad / told_rad.abs() * 1e6;
    let angle_u = question.params.quantity("angle_u", Unit::Radian)?;
    let pose_rad = question.params.quantity("pose_u", Unit::Radian)?;
    let budget = |i: usize| {
        let (noise_rad, dof) = noise_rad[i];
        Budget::new(Unit::PartsPerMillion).a("noise of the rate at rest", ppm(noise_rad), dof)
    };
    // The errors of the calibration's angle, clock and attitudes are a part of the error that the calibration leaves.
    let own = budget(axis).b("angle of the table", angle_u, "rad", 1e6 / told_rad.abs());
    let error_ppm = (turned.angle_rad[axis] / told_rad - 1.0) * 1e6;
    findings.figure(&ANGLE_ERROR, error_ppm, &clock.in_budget(own, 1.0), p);
    findings.detail("sample_clock", clock.details());
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let across = turned.angle_rad[i].hypot(turned.angle_rad[j]);
    let earth_rad = earth::EARTH_RATE_RPS * turned.span_s;
    let noisier = if noise_rad[i].0 > noise_rad[j].0 { i } else { j };
    let across_budget = budget(noisier)
        .b("attitude of the axis", pose_rad, "rad", 1e6)
        .bound("rotation of the earth", ppm(earth_rad), "ppm", 1.0)
        .of_length();
    findings.figure(&CROSS_ANGLE, ppm(across), &across_budget, p);
    findings.detail(
        "turn",
        json!({
            "angle_deg": turned.angle_rad.map(f64::to_degrees).as_slice(), "told_deg": angle_deg,
            "start_s": turned.start_s, "span_s": turned.span_s,
        }),
    );
    Ok(())
}

/// The result of a turn.
struct Turned {
    angle_rad: Vector3<f64>,
    start_s: f64,
    span_s: f64,
    /// Time at rest around the turn. The mean rate of this time is subtracted.
    rest_s: f64,
}

impl Turned {
    /// Standard deviation of the angle about each axis from the noise of the rate, and its degrees of freedom. The
    /// noise is the scatter, in the position, of means over the time of the turn.
    fn noise_rad(&self, question: &AnalysisInput<'_>) -> [(f64, f64); 3] {
        let Some((still, ..)) = captures::lying(question.captures).next() else { return [(f64::NAN, 1.0); 3] };
        let wanted = self.span_s * f64::from(still.about.rate_hz);
        let block = (wanted.round() as usize).min(still.compensated.len() / FEWEST).max(1);
        let means: Vec<Vector3<f64>> =
            still.compensated.chunks_exact(block).map(|part| mean_of(part, rate_rps)).collect();
        let scale = (block as f64 / wanted).min(1.0) * (1.0 + self.span_s / self.rest_s);
        [0, 1, 2].map(|axis| {
            let (_, sd) = stats::mean_sd(&means.iter().map(|mean| mean[axis]).collect::<Vec<f64>>());
            (self.span_s * sd * scale.sqrt(), means.len() as f64 - 1.0)
        })
    }
}

/// Integral of the compensated rate less the rate at rest, over the moving part and a quarter of a second on both
/// sides.
fn integrate(capture: &Capture, axis: usize, clock: &clock::ClockTerms) -> Result<Turned, FigureError> {
    // Windows use the rate that was asked for; time uses the clock as far as it is known.
    let asked_hz = f64::from(capture.about.rate_hz);
    let rate_hz = clock.rate_hz(asked_hz);
    let rates: Vec<Vector3<f64>> = capture.compensated.iter().map(rate_rps).collect();
    let own: Vec<f64> = rates.iter().map(|rate| rate[axis]).collect();
    let block = (0.05 * asked_hz).ceil() as usize;
    let means: Vec<f64> = own.chunks(block.max(1)).map(stats::mean).collect();
    // The turn may fill most of the record, so rest is taken from both ends.
    let edge = (means.len() / 2).min(10);
    let level = f64::midpoint(stats::mean(&means[..edge]), stats::mean(&means[means.len() - edge..]));
    let peak = means.iter().map(|mean| (mean - level).abs()).fold(0.0, f64::max);
    let noise = stats::white_sd(&own) / (block as f64).sqrt();
    let moving = |mean: &&f64| (**mean - level).abs() > (2e-3 * peak).max(8.0 * noise);
    let first = means.iter().position(|mean| moving(&mean));
    let last = means.iter().rposition(|mean| moving(&mean));
    let unfit = |why: &str| FigureError::Unfit { label: capture.about.label.clone(), why: why.into() };
    let (Some(first), Some(last)) = (first, last) else { return Err(unfit("no turn is seen in it")) };
    let margin = (0.25 * asked_hz).ceil() as usize;
    let (start, end) = ((first * block).saturating_sub(margin), ((last + 1) * block + margin).min(rates.len()));
    if first * block < 2 * margin || rates.len() < (last + 1) * block + 2 * margin {
        return Err(unfit("the turn is cut off: it needs half a second of rest before and after it"));
    }
    let rest: Vec<&Vector3<f64>> = rates[..start].iter().chain(&rates[end..]).collect();
    let count = rest.len() as f64;
    let at_rest = rest.iter().fold(Vector3::zeros(), |sum, rate| sum + **rate) / count;
    let turned: Vector3<f64> =
        rates[start..end].iter().fold(Vector3::zeros(), |sum, rate| sum + (rate - at_rest)) / rate_hz;
    let [start_s, span_s, rest_s] = [start, end - start, rest.len()].map(|samples| samples as f64 / rate_hz);
    Ok(Turned { angle_rad: turned, start_s, span_s, rest_s })
}
