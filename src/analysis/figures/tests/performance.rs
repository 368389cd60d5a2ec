//! Biases, stability, repeatability, coupling, resolution, noise.

use nalgebra::Vector3;

use super::calibrating::calibrated;
use super::world::{GRAVITY, World};
use super::*;

const SHORT: &str = "dwell = \"60 s\", rate = \"20 Hz\"";

#[test]
fn gyro_bias_is_free_of_the_earth() {
    let mut world = World::new(11);
    let earlier = calibrated(&mut world);
    // The truth after calibration is the later change of the bias: 20 deg/h on Y.
    world.gyro_bias[1] += 20.0 / 3600.0;
    let captures = [world.still("still", 1, "z+", 30.0, 120.0, 20)];
    let text = "dwell = \"120 s\", rate = \"20 Hz\"";
    let found = ask(ItemId::GyroBias, text, &captures, &earlier).unwrap();
    complete(ItemId::GyroBias, &params(ItemId::GyroBias, text), &found);
    for (name, truth) in [("bias_x", 0.0), ("bias_y", 20.0), ("bias_z", 0.0)] {
        let (value, ..) = figure(&found, name);
        assert!((value - truth).abs() < 4.0, "{name} {value}");
    }
    // Without a heading the horizontal part stays, and the figure's label says so.
    let unknown = ask(ItemId::GyroBias, &format!("{text}, heading = \"unknown\""), &captures, &earlier).unwrap();
    assert!(figure(&unknown, "bias_x").2.expanded().unwrap() > 12.0);
    assert!(matches!(value_of(&unknown, "label"), Some(Value::Text(text)) if text.contains("horizontal")));
    let nowhere = params(ItemId::GyroBias, text);
    let question = AnalysisInput { params: &nowhere, site: None, captures: &captures, earlier: &earlier };
    let nowhere = analyse(ItemId::GyroBias, &question).unwrap();
    assert!((figure(&nowhere, "bias_z").0 - 8.45).abs() < 4.0);
    assert!(matches!(value_of(&nowhere, "label"), Some(Value::Text(text)) if text.contains("15.04")));
}

/// A table that is 1 mrad off level cancels, and a coupling of 1e-3 from Z to Y does so too.
#[test]
fn accel_bias_cancels_level_and_coupling() {
    let mut world = World::new(12);
    let earlier = calibrated(&mut world);
    world.tilt = [1e-3, -0.7e-3];
    world.accel[(1, 2)] += 1e-3;
    world.accel_bias += Vector3::new(0.3e-3, -0.5e-3, 0.2e-3);
    let mut captures = Vec::new();
    for (label, axis, heading_deg) in [
        ("x z+", "z+", 0.0),
        ("x z-", "z-", 180.0),
        ("y z+", "z+", 0.0),
        ("y z-", "z-", 0.0),
        ("z x+", "x+", 0.0),
        ("z x-", "x-", 0.0),
    ] {
        captures.push(world.still(label, 1, axis, heading_deg, 60.0, 20));
    }
    let found = ask(ItemId::AccelBias, SHORT, &captures, &earlier).unwrap();
    complete(ItemId::AccelBias, &params(ItemId::AccelBias, SHORT), &found);
    for (name, truth) in [("bias_x", 0.3), ("bias_y", -0.5), ("bias_z", 0.2)] {
        let (value, ..) = figure(&found, name);
        assert!((value - truth).abs() < 0.06, "{name} {value}");
    }
    // With a turn about the axis itself the level error would stay, so that pair is refused.
    let about_itself = [captures[0].clone(), world.still("x z-", 1, "z-", 0.0, 60.0, 20)];
    let refused = ask(ItemId::AccelBias, &format!("{SHORT}, axes = [\"x\"]"), &about_itself, &earlier);
    assert!(matches!(refused, Err(FigureError::Missing { .. })), "{refused:?}");
}

#[test]
fn stability_and_repeatability_are_those_of_the_noise() {
    let mut world = World::new(13);
    let earlier = calibrated(&mut world);
    (world.gyro_noise.slow, world.gyro_noise.turn_on) = (3.0 / 3600.0, 5.0 / 3600.0);
    (world.accel_noise.slow, world.accel_noise.turn_on) = (0.2e-3, 0.4e-3);
    world.power_on();
    let captures = [world.still("still", 1, "z+", 0.0, 1200.0, 20)];
    let text = "duration = \"1200 s\", rate = \"20 Hz\"";
    let found = ask(ItemId::BiasStability, text, &captures, &earlier).unwrap();
    complete(ItemId::BiasStability, &params(ItemId::BiasStability, text), &found);
    let (gyro, accel) = (world.gyro_noise, world.accel_noise);
    for axis in ["x", "y", "z"] {
        for (name, truth) in [
            (format!("bias_stability_gyro_{axis}"), gyro.of_mean(10.0) * 3600.0),
            (format!("bias_stability_accel_{axis}"), accel.of_mean(10.0) * 1e3),
        ] {
            let (value, _, known) = figure(&found, &name);
            assert!(
                (value / truth - 1.0).abs() < 0.3 && known.low < value && value < known.high,
                "{name} {value} {truth}"
            );
            assert!(known.low * 0.85 < truth && truth < known.high * 1.15, "{name} {known:?} {truth}");
        }
    }
    let runs: Vec<Capture> = (1..=6)
        .map(|run| {
            world.power_on();
            world.still(&format!("run {run}"), run, "z+", 0.0, 60.0, 20)
        })
        .collect();
    let found = ask(ItemId::BiasRepeatability, SHORT, &runs, &earlier).unwrap();
    complete(ItemId::BiasRepeatability, &params(ItemId::BiasRepeatability, SHORT), &found);
    let (value, _, known) = figure(&found, "bias_repeatability_gyro_x");
    assert!((known.high / value - 2.4526).abs() < 1e-3 && (known.low / value - 0.6242).abs() < 1e-3);
    // Each pair of channels is one of six. Together they must match the truth.
    let squares: f64 =
        ["x", "y", "z"].iter().map(|axis| figure(&found, &format!("bias_repeatability_gyro_{axis}")).0.powi(2)).sum();
    let truth = gyro.turn_on.hypot(gyro.of_mean(60.0)) * 3600.0;
    // 15 degrees of freedom: 99.9 % of chi-square over its dof lie between 0.21 and 2.6.
    assert!((0.21..2.6).contains(&(squares / 3.0 / truth / truth)), "{squares} {truth}");
    assert!(matches!(ask(ItemId::BiasRepeatability, SHORT, &runs[1..], &earlier), Err(FigureError::Missing { .. })));
}

#[test]
fn scale_factors_and_couplings_over_calibrations() {
    let mut world = World::new(14);
    let text = "calibrations = 3, dwell = \"60 s\", rate = \"20 Hz\", turn_rate = \"200 Hz\", pose_u = \"0 deg\"";
    let mut captures = Vec::new();
    for (series, factor) in [(1, 1.0), (2, 1.0004), (3, 0.9996)] {
        let original = (world.accel, world.gyro);
        world.accel *= factor;
        world.gyro *= factor;
        if series == 3 {
            world.gyro[(0, 1)] += 5e-4;
            world.accel[(2, 0)] -= 7e-4;
        }
        captures.extend(world.six(&format!("calibration {series} "), series, 60.0, 20));
        captures.extend(world.turns(&format!("calibration {series} "), series, 200));
        (world.accel, world.gyro) = original;
    }
    let found = ask(ItemId::ScaleFactorRepeatability, text, &captures, &[]).unwrap();
    complete(ItemId::ScaleFactorRepeatability, &params(ItemId::ScaleFactorRepeatability, text), &found);
    // Standard deviation of 0, 400, -400 ppm.
    for name in ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"] {
        let value = figure(&found, &format!("scale_factor_repeatability_{name}")).0;
        assert!((value - 400.0).abs() < 40.0, "{name} {value}");
    }
    let coupling = ask(ItemId::CrossCoupling, text, &captures, &[]).unwrap();
    complete(ItemId::CrossCoupling, &params(ItemId::CrossCoupling, text), &coupling);
    assert!((figure(&coupling, "coupling_gyro_xy").0 - 500.0).abs() < 30.0);
    assert!((figure(&coupling, "coupling_accel_zx").0 + 700.0).abs() < 60.0);
    assert!(figure(&coupling, "coupling_gyro_zx").0.abs() < 30.0);
    assert!((figure(&coupling, "nonorthogonality_gyro_xy").0 - 500.0).abs() < 40.0);
}

/// A part that follows small steps, a part that loses them, and a stream too coarse to show any.
#[test]
fn resolution_needs_both_senses_and_fine_codes() {
    let mut world = World::new(15);
    let earlier = calibrated(&mut world);
    // Three cycles of each channel: zero, one way, zero, the other way, ..., zero.
    const SENSES: [f64; 13] = [0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 0.0, -1.0, 0.0];
    let steps = |world: &mut World| {
        let mut captures = Vec::new();
        for axis in 0..3 {
            let mut about = Vector3::zeros();
            about[axis] = 1.0;
            for (number, sense) in SENSES.into_iter().enumerate() {
                let (label, rate_dps) = (format!("gyro {axis} {number}"), 0.05 * sense);
                let frame = [about.yzx(), about.zxy(), about];
                let mut capture = world.lying(&label, 1, about.into(), 0.0, frame, about * rate_dps, 30.0, 20);
                if sense != 0.0 {
                    capture.about.pose =
                        crate::capture::Pose::Spinning { axis: axis as u8, rate_dps, along: gnc_rig::Along::Up };
                }
                captures.push(capture);
            }
        }
        for axis in 0..3 {
            let top = if axis == 2 { 0 } else { 2 };
            for (number, sense) in SENSES.into_iter().enumerate() {
                let (label, sine) = (format!("accel {axis} {number}"), 0.001 * sense);
                let mut up = [0.0; 3];
                (up[axis], up[top]) = (sine, (1.0 - sine * sine).sqrt());
                let frame = [Vector3::zeros(); 3];
                captures.push(world.lying(&label, 1, up, 0.0, frame, Vector3::zeros(), 30.0, 20));
            }
        }
        captures
    };
    // 0.05 deg/s: the earth's horizontal rate of 0.0034 deg/s moves between the attitudes of this small world.
    let text = "gyro_step = \"0.05 deg/s\", dwell = \"30 s\", rate = \"20 Hz\"";
    let captures = steps(&mut world);
    let found = ask(ItemId::Resolution, text, &captures, &earlier).unwrap();
    complete(ItemId::Resolution, &params(ItemId::Resolution, text), &found);
    for name in ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"] {
        let value = figure(&found, &format!("step_response_{name}")).0;
        assert!((85.0..115.0).contains(&value), "{name} {value}");
    }
    // A dead band in one direction: the means of these steps of X are those without a step.
    let mut dead = captures.clone();
    for step in (0..13).filter(|number| SENSES[*number] > 0.0) {
        let first = 3 * SENSES.len();
        dead[first + step].samples = dead[first + step - 1].samples.clone();
    }
    let found = ask(ItemId::Resolution, text, &dead, &earlier).unwrap();
    assert!(figure(&found, "step_response_accel_x").0 < 8.0, "{:?}", figure(&found, "step_response_accel_x"));
    // A wander of the bias by ten steps in all is not a step.
    let mut wandering = captures.clone();
    for (number, capture) in wandering.iter_mut().take(SENSES.len()).enumerate() {
        for sample in &mut capture.samples {
            sample.gyro[0] += (number as f64 / 12.0 * 0.5 * 20_000.0) as i32;
        }
    }
    let found = ask(ItemId::Resolution, text, &wandering, &earlier).unwrap();
    assert!((85.0..115.0).contains(&figure(&found, "step_response_gyro_x").0));
    let few = ask(ItemId::Resolution, text, &captures[..2], &earlier).unwrap_err().to_string();
    assert!(few.contains("(0 there)"), "{few}");
    // Codes of 16 bits, spread over 24: 256 counts.
    let mut coarse = captures;
    for sample in coarse.iter_mut().flat_map(|capture| &mut capture.samples) {
        sample.gyro = sample.gyro.map(|code| code / 256 * 256);
    }
    let refused = ask(ItemId::Resolution, text, &coarse, &earlier);
    assert!(matches!(refused, Err(FigureError::Coarse { bits, .. }) if (15.0..17.0).contains(&bits)), "{refused:?}");
}

#[test]
fn noise_is_found_over_time_and_frequency() {
    let mut world = World::new(16);
    let earlier = calibrated(&mut world);
    let captures = [world.still("still", 1, "z+", 0.0, 1800.0, 20)];
    let text = "duration = \"1800 s\", rate = \"20 Hz\"";
    let found = ask(ItemId::Allan, text, &captures, &earlier).unwrap();
    complete(ItemId::Allan, &params(ItemId::Allan, text), &found);
    // 0.0025 deg/s at one second is 0.15 deg/sqrt(h); 0.1 mg is 0.0588 m/s/sqrt(h).
    let walk = figure(&found, "angle_random_walk_x").0;
    assert!((walk / 0.15 - 1.0).abs() < 0.03, "{walk}");
    let walk = figure(&found, "velocity_random_walk_z").0;
    assert!((walk / 0.058_84 - 1.0).abs() < 0.03, "{walk}");
    // White noise has no flat part: the record gives no bias instability, but a bound that is labelled as a bound.
    assert!(matches!(value_of(&found, "bias_instability_gyro_x"), Some(Value::NotAvailable(_))));
    assert!(matches!(value_of(&found, "bias_instability_bound_gyro_x"), Some(Value::Number(_))));
    let text = format!("{text}, segment = 1024");
    let found = ask(ItemId::Psd, &text, &captures, &earlier).unwrap();
    complete(ItemId::Psd, &params(ItemId::Psd, &text), &found);
    // One-sided: sqrt(2) N.
    let (value, _, known) = figure(&found, "density_gyro_y");
    let truth = 2.0_f64.sqrt() * 0.0025;
    assert!((value / truth - 1.0).abs() < 0.03 && known.low < value && value < known.high, "{value} {truth}");
    let (value, ..) = figure(&found, "density_accel_x");
    assert!((value / (2.0_f64.sqrt() * 100.0) - 1.0).abs() < 0.03, "{value} ug");
    // A line at 3 Hz, ten times below the noise of a sample, stands out.
    let mut shaken = captures.to_vec();
    for (k, sample) in shaken[0].samples.iter_mut().enumerate() {
        sample.accel[0] += ((k as f64 * 3.0 / 20.0 * std::f64::consts::TAU).sin() * 60.0).round() as i32;
    }
    let found = ask(ItemId::Psd, &text, &shaken, &earlier).unwrap();
    let Some(Value::Number(line)) = value_of(&found, "line_accel_x") else { panic!("no line") };
    assert!(line.number > 30.0, "{line}");
    let at = found.details["spectra"]["accel_x"]["strongest_line"]["frequency_hz"].as_f64().unwrap();
    assert!((at - 3.0).abs() < 0.05 && GRAVITY > 9.0, "{at}");
    // The density of the line stands at its frequency, far over the white level.
    let spectrum = &found.details["spectra"]["accel_x"];
    let bin = (3.0 / spectrum["frequency_step_hz"].as_f64().unwrap()).round() as usize;
    assert!(spectrum["density"][bin].as_f64().unwrap() > 30.0 * spectrum["white"].as_f64().unwrap(), "{bin}");
}
