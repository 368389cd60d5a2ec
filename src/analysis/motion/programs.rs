//! The program of each item, from its parameters.

use gnc_executive::catalogue::ItemId;
use gnc_executive::plan::{ParamError, Params};
use gnc_executive::quantity::Unit;
use gnc_metrology::AXES;
use gnc_rig::{Along, Orientation};

use super::{MotionProgram, MotionStep, Uses};
use crate::capture::{CaptureHead, Pose};

/// Time without power where an item does not state its own: capacitors are empty and all registers lose their contents.
pub const OFF_S: f64 = 10.0;

/// Returns the program of an item; `None` if the item moves and captures nothing, or uses the captures of another item.
///
/// # Errors
/// An error means that the catalogue has no such parameter: a mistake in this program.
pub fn program(item: ItemId, params: &Params) -> Result<Option<MotionProgram>, ParamError> {
    if matches!(item, ItemId::GyroStill | ItemId::CrossCoupling | ItemId::Allan | ItemId::Psd)
        && params.source("of")?.is_some()
    {
        return Ok(None);
    }
    let steps = match item {
        ItemId::SixPosition | ItemId::GyroStill => positions(params, 1, "", Uses::Inertial)?,
        ItemId::MagnetometerEllipsoid => positions(params, 1, "", Uses::Magnetometer)?,
        ItemId::Rotation => rotations(params, 1, "")?,
        ItemId::GyroBias => level(params, "dwell")?,
        ItemId::BiasStability | ItemId::Allan | ItemId::Psd => level(params, "duration")?,
        ItemId::AccelBias => accel_bias(params)?,
        ItemId::BiasRepeatability => bias_repeatability(params)?,
        ItemId::ScaleFactorRepeatability | ItemId::CrossCoupling => calibrations(params)?,
        ItemId::Resolution => resolution(params)?,
        ItemId::MagnetometerEllipse => spins(params)?,
        ItemId::GnssAccuracy => receiver(params)?,
        ItemId::CalibrationCheck => check(params)?,
        _ => return Ok(None),
    };
    Ok(Some(MotionProgram { steps }))
}

fn seconds(params: &Params, name: &str) -> Result<f64, ParamError> {
    params.quantity(name, Unit::Second)
}

fn hertz(params: &Params, name: &str) -> Result<u16, ParamError> {
    Ok(params.quantity(name, Unit::Hertz)?.round() as u16)
}

/// Returns the orientation with an axis up or down.
fn orientation(axis: usize, positive: bool, heading_deg: f64) -> (Orientation, Pose) {
    let mut up = [0.0; 3];
    up[axis % 3] = if positive { 1.0 } else { -1.0 };
    let orientation = Orientation::Axis { axis: axis as u8 % 3, positive, along: Along::Up, heading_deg };
    (orientation, Pose::Still { up, heading_deg })
}

/// Returns a capture in an attitude: lay down, settle, capture.
fn still(
    params: &Params,
    (orientation, pose): (Orientation, Pose),
    label: String,
    series: u32,
    span_s: f64,
) -> Result<[MotionStep; 3], ParamError> {
    let about = CaptureHead { label, series, pose, rate_hz: hertz(params, "rate")? };
    let settle = MotionStep::Settle { span_s: seconds(params, "settle")? };
    Ok([MotionStep::Lay(orientation), settle, MotionStep::Capture { about, span_s, uses: Uses::Inertial }])
}

/// Each axis up and down, at one heading, two or four.
fn positions(params: &Params, series: u32, prefix: &str, uses: Uses) -> Result<Vec<MotionStep>, ParamError> {
    let headings: &[f64] = match params.choice("positions")? {
        "12" => &[0.0, 180.0],
        "24" => &[0.0, 90.0, 180.0, 270.0],
        _ => &[0.0],
    };
    let dwell_s = seconds(params, "dwell")?;
    let mut steps = Vec::new();
    for heading_deg in headings {
        for (axis, name) in AXES.iter().enumerate() {
            for (positive, sign) in [(true, '+'), (false, '-')] {
                let heading = if headings.len() > 1 { format!(" {heading_deg:.0}") } else { String::new() };
                let label = format!("{prefix}{name}{sign}{heading}");
                steps.extend(still(params, orientation(axis, positive, *heading_deg), label, series, dwell_s)?);
            }
        }
    }
    for step in &mut steps {
        if let MotionStep::Capture { uses: used, .. } = step {
            *used = uses;
        }
    }
    Ok(steps)
}

/// Each axis along the table's, turned in both directions.
fn rotations(params: &Params, series: u32, prefix: &str) -> Result<Vec<MotionStep>, ParamError> {
    let along = match params.choice("geometry")? {
        "polar" => Along::Polar,
        _ => Along::Up,
    };
    let mut steps = Vec::new();
    for axis in 0..AXES.len() {
        steps.push(MotionStep::Lay(Orientation::Axis { axis: axis as u8, positive: true, along, heading_deg: 0.0 }));
        steps.push(MotionStep::Settle { span_s: seconds(params, "settle")? });
        for positive in [true, false] {
            steps.push(turn(params, axis, positive, along, series, prefix)?);
        }
    }
    Ok(steps)
}

fn turn(
    params: &Params,
    axis: usize,
    positive: bool,
    along: Along,
    series: u32,
    prefix: &str,
) -> Result<MotionStep, ParamError> {
    let (factor, sign) = if positive { (1.0, '+') } else { (-1.0, '-') };
    let pose = Pose::Rotating {
        axis: axis as u8,
        angle_deg: factor * params.quantity("angle", Unit::Degree)?,
        span_s: seconds(params, "span")?,
        along,
    };
    let label = format!("{prefix}{}{sign} rotation", AXES[axis % 3]);
    let about = CaptureHead { label, series, pose, rate_hz: hertz(params, "turn_rate")? };
    let (ramp_s, rest_s) = (seconds(params, "ramp")?, seconds(params, "rest")?);
    Ok(MotionStep::Turn { about, ramp_s, rest_s, uses: Uses::Gyro })
}

/// Z up for the time that a parameter states.
fn level(params: &Params, span: &str) -> Result<Vec<MotionStep>, ParamError> {
    Ok(still(params, orientation(2, true, 0.0), "still".into(), 1, seconds(params, span)?)?.into())
}

/// Each axis level, and again after the module was turned upside down about the third axis, which keeps its direction.
fn accel_bias(params: &Params) -> Result<Vec<MotionStep>, ParamError> {
    let dwell_s = seconds(params, "dwell")?;
    let mut steps = Vec::new();
    for name in params.choices("axes")? {
        // The axis that is up, and the heading of the axis after it, before and after.
        let (up, after_deg) = match *name {
            // About Y: X, which follows Z, goes to the opposite side.
            "x" => (2, 180.0),
            // About X, which follows Z.
            "y" => (2, 0.0),
            // About Y, which follows X.
            _ => (0, 0.0),
        };
        for (positive, sign, heading_deg) in [(true, '+', 0.0), (false, '-', after_deg)] {
            let label = format!("{name} {}{sign}", AXES[up]);
            steps.extend(still(params, orientation(up, positive, heading_deg), label, 1, dwell_s)?);
        }
    }
    Ok(steps)
}

fn bias_repeatability(params: &Params) -> Result<Vec<MotionStep>, ParamError> {
    let (off_s, dwell_s) = (seconds(params, "gap")?, seconds(params, "dwell")?);
    let mut steps = Vec::new();
    for run in 1..=u32::try_from(params.integer("runs")?).unwrap_or(1) {
        let [lay, settle, capture] = still(params, orientation(2, true, 0.0), format!("run {run}"), run, dwell_s)?;
        if run == 1 {
            steps.push(lay);
        }
        // The first one has a power cycle too, so that all runs begin in the same way.
        steps.extend([MotionStep::PowerCycle { off_s }, settle, capture]);
    }
    Ok(steps)
}

fn calibrations(params: &Params) -> Result<Vec<MotionStep>, ParamError> {
    let sensors = params.choices("sensors")?;
    let mut steps = Vec::new();
    for series in 1..=u32::try_from(params.integer("calibrations")?).unwrap_or(1) {
        let prefix = format!("calibration {series} ");
        steps.push(MotionStep::PowerCycle { off_s: OFF_S });
        if sensors.contains(&"accel") {
            steps.extend(positions(params, series, &prefix, Uses::Inertial)?);
        }
        if sensors.contains(&"gyro") {
            steps.extend(rotations(params, series, &prefix)?);
        }
    }
    Ok(steps)
}

/// Each gyroscope at small rates in both directions in turn, each accelerometer tilted a little both ways. Before and
/// after each step there is a capture without it.
fn resolution(params: &Params) -> Result<Vec<MotionStep>, ParamError> {
    let sensors = params.choices("sensors")?;
    let mut steps = Vec::new();
    for (axis, name) in AXES.iter().enumerate() {
        if sensors.contains(&"gyro") {
            rate_steps(&mut steps, params, axis, name)?;
        }
    }
    for (axis, name) in AXES.iter().enumerate() {
        if sensors.contains(&"accel") {
            tilt_steps(&mut steps, params, axis, name)?;
        }
    }
    Ok(steps)
}

/// Levels of a channel: zero, one way, zero, the other way, zero, ...
fn levels(params: &Params, cycles: &str) -> Result<impl Iterator<Item = (usize, f64, char)>, ParamError> {
    let count = 4 * usize::try_from(params.integer(cycles)?).unwrap_or(0) + 1;
    Ok((1..=count).map(|number| match number % 4 {
        2 => (number, 1.0, '+'),
        0 => (number, -1.0, '-'),
        _ => (number, 0.0, '0'),
    }))
}

fn rate_steps(steps: &mut Vec<MotionStep>, params: &Params, axis: usize, name: &str) -> Result<(), ParamError> {
    let (dwell_s, settle_s) = (seconds(params, "dwell")?, seconds(params, "settle")?);
    let (rate_hz, step_dps) = (hertz(params, "rate")?, params.quantity("gyro_step", Unit::DegreePerSecond)?);
    let (orientation, still) = orientation(axis, true, 0.0);
    steps.push(MotionStep::Lay(orientation));
    for (number, sense, sign) in levels(params, "gyro_cycles")? {
        let rate_dps = sense * step_dps;
        let spins = rate_dps != 0.0;
        let pose = if spins { Pose::Spinning { axis: axis as u8, rate_dps, along: Along::Up } } else { still.clone() };
        let about = CaptureHead { label: format!("gyro {name} {number}: {sign}"), series: 1, pose, rate_hz };
        steps.extend(spins.then_some(MotionStep::Spin { rate_dps }));
        steps.push(MotionStep::Settle { span_s: settle_s });
        steps.push(MotionStep::Capture { about, span_s: dwell_s, uses: Uses::Inertial });
        steps.extend(spins.then_some(MotionStep::Stop));
    }
    Ok(())
}

fn tilt_steps(steps: &mut Vec<MotionStep>, params: &Params, axis: usize, name: &str) -> Result<(), ParamError> {
    let (dwell_s, step_g) = (seconds(params, "dwell")?, params.quantity("accel_step", Unit::Gravity)?);
    let top = if axis == 2 { 0 } else { 2 };
    for (number, sense, sign) in levels(params, "accel_cycles")? {
        let sine = sense * step_g;
        let mut up = [0.0; 3];
        (up[axis], up[top]) = (sine, (1.0 - sine * sine).sqrt());
        let attitude = (Orientation::Up { up, heading_deg: 0.0 }, Pose::Still { up, heading_deg: 0.0 });
        steps.extend(still(params, attitude, format!("accel {name} {number}: {sign}"), 1, dwell_s)?);
    }
    Ok(())
}

/// Z to the north, spinning about it, slow and fast, in each direction.
fn spins(params: &Params) -> Result<Vec<MotionStep>, ParamError> {
    let rate_hz = hertz(params, "turn_rate")?;
    let (span_s, settle_s) = (seconds(params, "duration")?, seconds(params, "settle")?);
    let along = Along::North;
    let mut steps = vec![MotionStep::Lay(Orientation::Axis { axis: 2, positive: true, along, heading_deg: 0.0 })];
    for (name, param) in [("spin", "spin"), ("slow spin", "slow_spin")] {
        for sense in params.choices("senses")? {
            let factor = if *sense == "-" { -1.0 } else { 1.0 };
            let rate_dps = factor * params.quantity(param, Unit::DegreePerSecond)?;
            let pose = Pose::Spinning { axis: 2, rate_dps, along };
            let about = CaptureHead { label: format!("{name} {sense}"), series: 1, pose, rate_hz };
            let capture = MotionStep::Capture { about, span_s, uses: Uses::Magnetometer };
            steps.extend([
                MotionStep::Spin { rate_dps },
                MotionStep::Settle { span_s: settle_s },
                capture,
                MotionStep::Stop,
            ]);
        }
    }
    Ok(steps)
}

fn receiver(params: &Params) -> Result<Vec<MotionStep>, ParamError> {
    let pose = Pose::Still { up: [0.0, 0.0, 1.0], heading_deg: 0.0 };
    let about = CaptureHead { label: "sky".into(), series: 1, pose, rate_hz: 0 };
    let (timeout_s, span_s) = (seconds(params, "timeout")?, seconds(params, "duration")?);
    Ok(vec![MotionStep::Receiver { about, timeout_s, span_s }])
}

/// One position and one rotation about the axis that is up, as the module's user gets them.
fn check(params: &Params) -> Result<Vec<MotionStep>, ParamError> {
    let name = params.choice("axis")?;
    let axis = AXES.iter().position(|axis| *axis == name).unwrap_or(2);
    let mut steps =
        still(params, orientation(axis, true, 0.0), format!("{name}+"), 1, seconds(params, "dwell")?)?.to_vec();
    steps.push(turn(params, axis, true, Along::Up, 1, "")?);
    for step in &mut steps {
        if let MotionStep::Capture { uses, .. } | MotionStep::Turn { uses, .. } = step {
            *uses = Uses::Compensated;
        }
    }
    Ok(steps)
}
