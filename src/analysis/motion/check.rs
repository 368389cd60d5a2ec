//! Checks of a motion program: turns within the range of the gyroscopes, and time enough for all steps.

use gnc_executive::plan::{Params, PlanItem};
use gnc_executive::quantity::Unit;

use super::{DisplayDuration, GYRO_RANGE_DPS, MotionStep, program};
use crate::capture::{MOST_SAMPLES, Pose};

/// Returns the mistakes in the motion of an item, each with what to try.
#[must_use]
pub fn mistakes(item: &PlanItem) -> Vec<(String, &'static str)> {
    // An item without these parameters has no motion to check.
    let Ok(Some(program)) = program(item.id, &item.params) else { return Vec::new() };
    let mut found = Vec::new();
    let turns = program.steps.iter().any(|step| matches!(step, MotionStep::Turn { .. }));
    if turns && let Some(mistake) = too_fast(&item.params) {
        found.push(mistake);
    }
    if program.span_s() > item.timeout_s {
        let what = format!(
            "{} takes at least {} of bench time, and its timeout is {}",
            item.id,
            DisplayDuration(program.span_s()),
            DisplayDuration(item.timeout_s)
        );
        found.push((what, "raise its timeout, or make its captures shorter"));
    }
    if program.samples() > MOST_SAMPLES as u64 {
        let what = format!(
            "{} captures {} samples, and the record of an attempt holds at most {MOST_SAMPLES}",
            item.id,
            program.samples()
        );
        found.push((what, "capture for a shorter time, or at a lower rate"));
    }
    let most = program.steps.iter().filter_map(|step| match step {
        MotionStep::Capture { about, .. } => match about.pose {
            Pose::Spinning { rate_dps, .. } => Some((about, rate_dps)),
            _ => None,
        },
        _ => None,
    });
    for (about, rate_dps) in most {
        let samples = f64::from(about.rate_hz) * 360.0 / rate_dps.abs().max(f64::MIN_POSITIVE);
        if samples < SAMPLES_A_TURN {
            let what = format!(
                "{rate_dps:+.0} deg/s at {} Hz are {samples:.1} samples a turn, and an ellipse needs {SAMPLES_A_TURN:.0}",
                about.rate_hz
            );
            found.push((what, "spin slower, or sample faster"));
        }
    }
    found
}

/// Fewest samples of a turn. Two turns of the field's second harmonic need four, and half as many again separate it
/// from noise.
const SAMPLES_A_TURN: f64 = 6.0;

/// The rate is a trapezoid: both ramps together count as one of them at full rate, so that the peak is angle / (span -
/// ramp).
fn too_fast(params: &Params) -> Option<(String, &'static str)> {
    let angle_deg = params.quantity("angle", Unit::Degree).ok()?;
    let span_s = params.quantity("span", Unit::Second).ok()?;
    let ramp_s = params.quantity("ramp", Unit::Second).ok()?;
    if 2.0 * ramp_s > span_s {
        let what = format!("two ramps of {ramp_s} s do not fit into a turn of {span_s} s");
        return Some((what, "make the ramps shorter or the turn longer"));
    }
    let peak_dps = angle_deg / (span_s - ramp_s);
    (peak_dps > GYRO_RANGE_DPS).then(|| {
        let what = format!(
            "{angle_deg:.0} deg in {span_s} s with ramps of {ramp_s} s go up to {angle_deg:.0} / ({span_s} - {ramp_s}) = \
             {peak_dps:.0} deg/s, and the gyroscopes' range is {GYRO_RANGE_DPS:.0} deg/s"
        );
        (what, "turn longer or by a smaller angle, or make the ramps shorter")
    })
}
