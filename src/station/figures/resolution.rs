//! Resolution: does the mean follow a step of the published size, in both senses?

use gnc_executive::quantity::Unit;
use gnc_metrology::earth;
use gnc_protocol::stream::SATURATION;
use nalgebra::Vector3;
use serde_json::json;

use super::budget::{Budget, finite};
use super::captures::{self, AXES, Triad};
use super::mean::{self, BLOCKS};
use super::place;
use super::stability::{Compensation, unit};
use super::{FigureError, Findings, Question};
use crate::capture::{Capture, Pose};

/// A stream shows the published resolutions from so many bits: with 16 over the published ranges its steps are
/// 0.0122 deg/s and 1.53 mg.
const BITS: f64 = 18.0;
/// Published ranges, deg/s, g and gauss; codes reach a little farther.
const RANGES: [(Triad, f64); 3] = [(Triad::Gyro, 400.0), (Triad::Accel, 50.0), (Triad::Mag, 6.0)];

pub(super) fn analyse(question: &Question<'_>) -> Result<Findings, FigureError> {
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
        "equation": "(mean on the step - mean without) / step, the smaller of both senses; at least 50 % shows the resolution",
        "label": "ranges: from the codes at nominal scale, not shown by motion",
    }));
    let mut steps = Vec::new();
    for triad in &compensation.triads {
        for (axis, name) in AXES.iter().enumerate() {
            let levels = levels(question, &compensation, *triad, axis)?;
            let responses = [levels.response(1), levels.response(-1)];
            let (response, noise) = if responses[0].0 < responses[1].0 { responses[0] } else { responses[1] };
            let step = levels.step;
            let pose = if *triad == Triad::Accel { pose_rad * 1e3 * 2.0_f64.sqrt() / step * 100.0 } else { 0.0 };
            let budget = Budget::new(Unit::Percent).a("noise of both means", noise.0 * 100.0, noise.1).b(
                "attitudes",
                if pose > 0.0 { 1.0 } else { 0.0 },
                "",
                pose,
            );
            findings.figure(format!("step_response_{}_{name}", triad.name()), response * 100.0, &budget, probability);
            steps.push(json!({
                "channel": format!("{} {name}", triad.name()), "step": step, "unit": unit(*triad).symbol(),
                "response_up": responses[0].0, "response_down": responses[1].0, "dof": finite(noise.1),
            }));
        }
    }
    findings.detail("steps", steps);
    for ((triad, published), (name, unit)) in RANGES.into_iter().zip([
        ("range_gyro", Unit::DegreePerSecond),
        ("range_accel", Unit::Gravity),
        ("range_mag", Unit::Gauss),
    ]) {
        findings.number(name, (f64::from(SATURATION) / triad.lsb()).min(published * 1.1), unit);
    }
    Ok(findings)
}

/// Bits over the range that the codes of a channel show: their common step against all codes.
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

/// Means without a step and on it, in both senses: value, standard uncertainty, degrees of freedom.
struct Levels {
    /// In the unit of the triad, deg/h or mg.
    step: f64,
    still: (f64, f64, f64),
    up: (f64, f64, f64),
    down: (f64, f64, f64),
}

impl Levels {
    /// Response over the step in one sense, with its noise and degrees of freedom.
    fn response(&self, sense: i8) -> (f64, (f64, f64)) {
        let on = if sense > 0 { self.up } else { self.down };
        let change = (on.0 - self.still.0) * f64::from(sense);
        let parts = [(on.1, on.2), (self.still.1, self.still.2)];
        let noise = (on.1.hypot(self.still.1)) / self.step;
        (change / self.step, (noise, gnc_metrology::stats::welch_satterthwaite(&parts)))
    }
}

fn levels(
    question: &Question<'_>,
    compensation: &Compensation,
    triad: Triad,
    axis: usize,
) -> Result<Levels, FigureError> {
    let missing = || FigureError::Missing {
        what: format!("{} {} without a step and on it in both senses", triad.name(), AXES[axis]),
    };
    let (step, [still, up, down]) = match triad {
        Triad::Gyro => {
            let step = question.params.quantity("gyro_step", Unit::DegreePerHour)?;
            let at = |rate_dph: f64| question.captures.iter().find(|capture| turns_at(capture, axis, rate_dph));
            (step, [at(0.0), at(step), at(-step)])
        }
        _ => {
            let step_g = question.params.quantity("accel_step", Unit::Gravity)?;
            let at = |sine: f64| question.captures.iter().find(|capture| tilted(capture, axis, sine));
            // The tilt is one of the local gravity.
            let step_mg = step_g * place::gravity(question.site)?.mps2 / earth::STANDARD_GRAVITY_MPS2 * 1e3;
            (step_mg, [at(0.0), at(step_g), at(-step_g)])
        }
    };
    let level = |capture: Option<&Capture>| -> Result<(f64, f64, f64), FigureError> {
        let capture = capture.ok_or_else(missing)?;
        Ok(mean_of(compensation, capture, triad, axis))
    };
    Ok(Levels { step, still: level(still)?, up: level(up)?, down: level(down)? })
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

fn mean_of(compensation: &Compensation, capture: &Capture, triad: Triad, axis: usize) -> (f64, f64, f64) {
    let [gyro, accel] = [Triad::Gyro, Triad::Accel].map(|triad| captures::mean(capture, triad));
    let value = compensation.apply(triad, &gyro, &accel)[axis];
    let blocks = compensation.blocks(capture, triad, capture.samples.len() / BLOCKS);
    let noise = mean::variance(&[blocks.iter().map(|block| block[axis]).collect()]);
    (value, noise.sd(), noise.dof)
}
