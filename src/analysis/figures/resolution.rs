//! Resolution: whether the mean follows a step of the published size in both directions.

use gnc_executive::catalogue::performance::{self, STEP_RESPONSE};
use gnc_executive::quantity::Unit;
use gnc_metrology::{earth, stats};
use gnc_protocol::stream::SATURATION;
use nalgebra::Vector3;
use serde_json::json;

use super::budget::{Budget, finite};
use super::captures::{self, AXES, Triad};
use super::stability::{Compensation, unit};
use super::{AnalysisInput, FigureError, Findings, place};
use crate::capture::{Capture, Pose};
use crate::details::performance::{STEPS, StepResponse};

/// Fewest steps of a direction, so that their scatter means something.
const FEWEST: usize = 2;
/// Least number of bits with which a stream shows the published resolutions. With 16 bits over the published ranges its
/// steps are 0.0122 deg/s and 1.53 mg.
const BITS: f64 = 18.0;
/// Published ranges, deg/s, g and gauss; codes reach a little farther.
const RANGES: [(Triad, f64); 3] = [(Triad::Gyro, 400.0), (Triad::Accel, 50.0), (Triad::Mag, 6.0)];

pub(super) fn analyse(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    let compensation = Compensation::of(question)?;
    let pose_rad = question.params.quantity("pose_u", Unit::Radian)?;
    for capture in question.captures {
        captures::sound([capture], compensation.used())?;
        question.long_enough(capture, "dwell")?;
    }
    for triad in &compensation.triads {
        for axis in 0..3 {
            fine_enough(question.captures, *triad, axis)?;
        }
    }
    let mut findings = Findings::new(json!({
        "equation": "(mean on the step - mean of the levels before and after it) / step, averaged over the steps, the smaller of both senses; at least 50 % shows the resolution",
        "label": "ranges: from the codes at nominal scale, not shown by motion",
    }));
    let mut shown = Vec::new();
    for triad in &compensation.triads {
        for (axis, name) in AXES.iter().enumerate() {
            let Steps { step, up, down } = steps(question, &compensation, *triad, axis)?;
            let worse = if up.mean < down.mean { &up } else { &down };
            // A step of tilt lies between two attitudes; a step of rate does not depend on attitudes.
            let pose_mg = if *triad == Triad::Accel { 1e3 * 2.0_f64.sqrt() } else { 0.0 };
            let budget = Budget::new(Unit::Percent).a("scatter of the steps", worse.sd * 100.0, worse.dof).b(
                "attitudes",
                pose_rad,
                "rad",
                pose_mg / step * 100.0,
            );
            findings.figure(&triad.of(&STEP_RESPONSE)[axis], worse.mean * 100.0, &budget, probability);
            shown.push(StepResponse {
                channel: format!("{} {name}", triad.name()),
                step,
                unit: unit(*triad).symbol().to_owned(),
                response_up: up.mean,
                response_down: down.mean,
                dof: finite(worse.dof),
            });
        }
    }
    findings.part(&STEPS, shown);
    for ((triad, published), measurement) in RANGES.into_iter().zip(&performance::RANGES) {
        let unit = measurement.unit;
        findings.number(measurement, (f64::from(SATURATION) / triad.lsb()).min(published * 1.1), unit);
    }
    Ok(findings)
}

/// Checks the bits over the range that the codes of a channel show: their common step against all codes.
fn fine_enough(captures: &[Capture], triad: Triad, axis: usize) -> Result<(), FigureError> {
    let mut step = 0_u64;
    let mut first = None;
    for code in captures.iter().flat_map(|capture| &capture.samples).map(|sample| triad.codes(sample)[axis]) {
        let base = *first.get_or_insert(code);
        step = gcd(step, u64::from(code.abs_diff(base)));
        if step == 1 {
            return Ok(());
        }
    }
    let range = RANGES.iter().find(|(other, _)| *other == triad).map_or(1.0, |(_, range)| range * triad.lsb());
    let bits = (2.0 * range / step.max(1) as f64).log2();
    if bits < BITS {
        return Err(FigureError::Coarse { channel: format!("{} {}", triad.name(), AXES[axis]), bits });
    }
    Ok(())
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// The result of the steps of a channel.
struct Steps {
    /// Size of the step in the unit of the triad, deg/h or mg.
    step: f64,
    up: Response,
    down: Response,
}

/// Response to the steps of one direction. Each step is compared with the mean of the levels before and after it, which
/// removes a wander of the bias.
struct Response {
    /// Mean response over step.
    mean: f64,
    /// Standard deviation of that mean, from the scatter of the steps.
    sd: f64,
    dof: f64,
}

fn steps(
    question: &AnalysisInput<'_>,
    compensation: &Compensation,
    triad: Triad,
    axis: usize,
) -> Result<Steps, FigureError> {
    // The step in the unit of the figure, and as the program states it.
    let (step, told) = match triad {
        Triad::Gyro => {
            let step = question.params.quantity("gyro_step", Unit::DegreePerHour)?;
            (step, step)
        }
        _ => {
            let step_g = question.params.quantity("accel_step", Unit::Gravity)?;
            // The step of tilt is a part of the local gravity.
            (step_g * place::gravity(question.site)?.mps2 / earth::STANDARD_GRAVITY_MPS2 * 1e3, step_g)
        }
    };
    let at = |capture: &Capture, sense: f64| match triad {
        Triad::Gyro => turns_at(capture, axis, sense * told),
        _ => tilted(capture, axis, sense * told),
    };
    let response = |sense: f64| -> Result<Response, FigureError> {
        let each: Vec<f64> = question
            .captures
            .windows(3)
            .filter(|three| at(&three[0], 0.0) && at(&three[1], sense) && at(&three[2], 0.0))
            .map(|three| {
                let [before, on, after] = [0, 1, 2].map(|k| mean_of(compensation, &three[k], triad, axis));
                sense * (on - (before + after) / 2.0) / step
            })
            .collect();
        if each.len() < FEWEST {
            let (name, sign) = (AXES[axis], if sense > 0.0 { '+' } else { '-' });
            let what = format!(
                "{FEWEST} steps of {} {name} in the sense {sign}, each between two levels without one ({} there)",
                triad.name(),
                each.len()
            );
            return Err(FigureError::Missing { what });
        }
        let n = each.len() as f64;
        let (mean, sd) = stats::mean_sd(&each);
        Ok(Response { mean, sd: sd / n.sqrt(), dof: n - 1.0 })
    };
    Ok(Steps { step, up: response(1.0)?, down: response(-1.0)? })
}

fn turns_at(capture: &Capture, axis: usize, wanted_dph: f64) -> bool {
    match capture.about.pose {
        Pose::Still { up, .. } => wanted_dph == 0.0 && up[axis].abs() > 0.99,
        Pose::Spinning { axis: about, rate_dps, .. } => {
            usize::from(about) == axis && (rate_dps * 3600.0 - wanted_dph).abs() < 1e-6 * wanted_dph.abs()
        }
        Pose::Rotating { .. } => false,
    }
}

fn tilted(capture: &Capture, axis: usize, sine: f64) -> bool {
    match capture.about.pose {
        Pose::Still { up, .. } => {
            let third = Vector3::from(up);
            // Only this axis is tilted, and about the next one.
            (third[axis] - sine).abs() < 1e-9 && third.amax() > 0.9 && {
                let small = third.iter().filter(|component| component.abs() > 1e-9 && component.abs() < 0.9).count();
                small == usize::from(sine != 0.0)
            }
        }
        _ => false,
    }
}

fn mean_of(compensation: &Compensation, capture: &Capture, triad: Triad, axis: usize) -> f64 {
    let [gyro, accel] = [Triad::Gyro, Triad::Accel].map(|triad| captures::mean(capture, triad));
    compensation.apply(triad, &gyro, &accel)[axis]
}
