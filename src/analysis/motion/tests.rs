use gnc_executive::catalogue::{ItemId, Trace};
use gnc_executive::plan::{Params, Plan};
use gnc_protocol::stream::{ImuSample, SATURATION};
use gnc_rig::Along;

use super::watch::{Spoilt, TurnWatch, Watch, turned_deg};
use super::*;

fn params(id: &str, params: &str) -> Params {
    plan(id, params).items()[3].params.clone()
}

/// A plan with this item behind the items that it needs.
fn plan(id: &str, params: &str) -> Plan {
    let item = |id: &str, more: &str| format!("[[item]]\nid = \"{id}\"\nphase = \"setup\"\n{more}\n");
    // The items that the others need come first.
    let before = ["six-position", "gyro-still", "rotation"].map(|id| item(id, "")).concat();
    let it = item(id, &format!("name = \"it\"\nparams = {{ {params} }}"));
    let text = format!("name = \"p\"\nversion = \"1\"\n{before}{it}");
    let plan = Plan::read("p.toml", text.into_bytes(), &mut |_| Err("no include".into()));
    plan.unwrap_or_else(|mistakes| panic!("{mistakes}"))
}

fn of(id: ItemId, with: &str) -> MotionProgram {
    program(id, &params(id.as_str(), with)).unwrap().unwrap()
}

fn captures(program: &MotionProgram) -> Vec<CaptureHead> {
    let about = program.steps.iter().filter_map(|step| match step {
        MotionStep::Capture { about, .. } | MotionStep::Turn { about, .. } | MotionStep::Receiver { about, .. } => {
            Some(about.clone())
        }
        _ => None,
    });
    about.collect()
}

fn labels(program: &MotionProgram) -> Vec<String> {
    captures(program).into_iter().map(|about| about.label).collect()
}

#[test]
fn every_position_comes_once_and_is_told_beforehand() {
    let six = of(ItemId::SixPosition, "");
    assert_eq!(labels(&six), ["x+", "x-", "y+", "y-", "z+", "z-"]);
    // Six times 300 s at 200 Hz, and 10 s of settling.
    assert_eq!(
        six.to_string(),
        "takes 31 min 00 s of bench time: 6 captures with 360000 samples, the module is laid down 6 times"
    );
    assert_eq!(
        of(ItemId::BiasStability, "duration = \"600 s\"").to_string(),
        "takes 10 min 10 s of bench time: 1 capture with 120000 samples, the module is laid down once"
    );
    for (count, headings) in [("12", 2), ("24", 4)] {
        let many = captures(&of(ItemId::SixPosition, &format!("positions = \"{count}\"")));
        let mut poses: Vec<String> = many.iter().map(|about| format!("{:?}", about.pose)).collect();
        poses.sort();
        poses.dedup();
        assert_eq!((many.len(), poses.len()), (6 * headings, 6 * headings), "each attitude once");
    }
}

#[test]
fn a_turn_is_the_one_of_the_parameters() {
    let turns = captures(&of(ItemId::Rotation, "angle = \"720 deg\", span = \"4 s\", geometry = \"polar\""));
    let expected: Vec<Pose> = [(0, 720.0), (0, -720.0), (1, 720.0), (1, -720.0), (2, 720.0), (2, -720.0)]
        .map(|(axis, angle_deg)| Pose::Rotating { axis, angle_deg, span_s: 4.0, along: Along::Polar })
        .into();
    assert_eq!(turns.iter().map(|about| about.pose.clone()).collect::<Vec<_>>(), expected);
    assert_eq!(turns[5].label, "z- rotation");
}

/// The module turns about the third axis. This axis keeps its direction, and the other two change sides.
#[test]
fn accelerometers_are_turned_about_the_third_axis() {
    // Axes in the local frame (north, west, up) for an axis that is up or down and the heading of the next one.
    let axes = |pose: &Pose| -> [[f64; 3]; 3] {
        let Pose::Still { up, heading_deg } = pose else { panic!("{pose:?}") };
        let top = up.iter().position(|part| *part != 0.0).unwrap();
        let z = [0.0, 0.0, up[top]];
        // Clockwise from north: 90 degrees are east, which is minus west.
        let (sin, cos) = heading_deg.to_radians().sin_cos();
        let next = [cos.round(), -sin.round(), 0.0];
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let mut found = [[0.0; 3]; 3];
        (found[top], found[(top + 1) % 3], found[(top + 2) % 3]) = (z, next, cross(z, next));
        found
    };
    let pairs = captures(&of(ItemId::AccelBias, ""));
    assert_eq!(
        pairs.iter().map(|about| about.label.as_str()).collect::<Vec<_>>(),
        ["x z+", "x z-", "y z+", "y z-", "z x+", "z x-"]
    );
    for (pair, (measured, about)) in pairs.chunks(2).zip([(0, 1), (1, 0), (2, 1)]) {
        let (before, after) = (axes(&pair[0].pose), axes(&pair[1].pose));
        assert_eq!(before[about], after[about], "{}: the axis of the turn stays", pair[0].label);
        assert_eq!(
            before[measured].map(|part| -part + 0.0),
            after[measured].map(|part| part + 0.0),
            "{}",
            pair[0].label
        );
        assert_eq!(before[measured][2], 0.0, "the measured axis is level");
    }
}

#[test]
fn repeated_items_cycle_the_power_before_each_series() {
    let runs = of(ItemId::BiasRepeatability, "runs = 3, gap = \"600 s\"");
    assert_eq!(labels(&runs), ["run 1", "run 2", "run 3"]);
    let mut powered = 0;
    for step in &runs.steps {
        match step {
            MotionStep::PowerCycle { off_s } => {
                powered += 1;
                assert_eq!(*off_s, 600.0);
            }
            MotionStep::Capture { about, .. } => assert_eq!(about.series, powered),
            _ => {}
        }
    }
    let whole = of(ItemId::ScaleFactorRepeatability, "calibrations = 2");
    let names = labels(&whole);
    assert_eq!(names.len(), 24);
    assert_eq!((names[0].as_str(), names[23].as_str()), ("calibration 1 x+", "calibration 2 z- rotation"));
    let accel = of(ItemId::ScaleFactorRepeatability, "calibrations = 2, sensors = [\"accel\"]");
    assert_eq!(labels(&accel).len(), 12);
}

#[test]
fn a_step_of_a_milli_g_is_a_tilt_of_that_sine() {
    let steps = captures(&of(ItemId::Resolution, "sensors = [\"accel\"], accel_step = \"1 mg\", accel_cycles = 2"));
    let ups = steps.iter().map(|about| match about.pose {
        Pose::Still { up, .. } => up,
        _ => panic!("{about:?}"),
    });
    let ups: Vec<[f64; 3]> = ups.collect();
    assert_eq!(ups.len(), 27);
    for (index, up) in ups.iter().enumerate() {
        assert!((up.iter().map(|part| part * part).sum::<f64>() - 1.0).abs() < 1e-12, "{up:?} is no unit vector");
        // The module is level before and after each step.
        assert_eq!(up[index / 9], [0.0, 0.001, 0.0, -0.001][index % 9 % 4], "{up:?}");
    }
}

#[test]
fn the_magnetometer_spins_in_both_senses_at_two_speeds() {
    let program = of(ItemId::MagnetometerEllipse, "");
    let rates: Vec<f64> = program
        .steps
        .iter()
        .filter_map(|step| if let MotionStep::Spin { rate_dps } = step { Some(*rate_dps) } else { None })
        .collect();
    assert_eq!(rates, [5400.0, -5400.0, 1800.0, -1800.0]);
    assert_eq!(program.steps.last(), Some(&MotionStep::Stop), "nothing spins afterwards");
}

fn still(count: usize) -> Vec<ImuSample> {
    vec![ImuSample { gyro: [100, -50, 83], accel: [0, 0, 160_000], ..ImuSample::default() }; count]
}

#[test]
fn a_module_that_is_moved_is_noticed_within_a_second() {
    let mut watch = Watch::new(Uses::Inertial, true, 200);
    assert_eq!(watch.look(&still(2000)), Ok(()));
    let mut moved = still(400);
    // Two degrees a second about Y.
    moved[150..].iter_mut().for_each(|sample| sample.gyro[1] += 40_000);
    let (index, spoilt) = watch.look(&moved).unwrap_err();
    assert_eq!(index, 199, "at the end of the first block with the motion");
    assert_eq!(spoilt, Spoilt::Moved { channel: "gyro_y".into(), by: "+0.500 deg/s".into() });
}

#[test]
fn only_what_is_used_may_not_saturate() {
    // Six in a row are saturation; five may be failed reads.
    let look = |uses, sample: &ImuSample, rows: usize| Watch::new(uses, false, 1000).look(&vec![sample.clone(); rows]);
    let mut sample = still(1).remove(0);
    sample.gyro[2] = -SATURATION - 1;
    assert_eq!(look(Uses::Magnetometer, &sample, 9), Ok(()));
    assert_eq!(look(Uses::Gyro, &sample, 5), Ok(()));
    assert_eq!(look(Uses::Gyro, &sample, 9), Err((5, Spoilt::Saturated { channel: "gyro_z".into() })));
    sample.gyro[2] = 0;
    sample.mag[0] = SATURATION;
    assert_eq!(look(Uses::Inertial, &sample, 9), Ok(()));
    assert_eq!(look(Uses::Magnetometer, &sample, 9), Err((5, Spoilt::Saturated { channel: "mag_x".into() })));
}

/// Samples of a turn about -Z whose rate rises evenly to a peak, and of a sensor that ends at `end_dps`.
fn rising(rate_hz: f64, to_dps: f64, span_s: f64, end_dps: f64) -> Vec<ImuSample> {
    let steps = (span_s * rate_hz) as usize;
    let rows = (0..steps + 40).map(|row| {
        let rate_dps = to_dps * (row as f64 / steps as f64).min(1.0);
        // 20,000 counts for 1 deg/s (interface document); a sensor at its end gives the end of the converter.
        let code = if rate_dps >= end_dps { -SATURATION - 1 } else { -(rate_dps * 20_000.0) as i32 };
        let gyro = [0, 0, code.max(-SATURATION - 1)];
        ImuSample { gyro, accel: [0, 0, 160_000], ..ImuSample::default() }
    });
    rows.collect()
}

/// A table that peaks at 432 deg/s passes 400 deg/s on its way to the saturation at 419.43 deg/s. A sensor that ends at
/// less jumps to the saturation from there, whatever the table does.
#[test]
fn a_table_that_is_too_fast_is_told_from_a_sensor_that_ends_too_early() {
    for (rate_hz, span_s) in [(1000.0, 2.5), (1000.0, 0.3), (200.0, 2.5), (200.0, 0.5)] {
        let look = |end_dps| {
            let spoilt = Watch::new(Uses::Gyro, false, rate_hz as u16).look(&rising(rate_hz, 432.0, span_s, end_dps));
            spoilt.expect_err("saturated").1
        };
        let Spoilt::TooFast { channel, last_dps, rise_dps } = look(419.43) else { panic!("{:?}", look(419.43)) };
        let step_dps = 432.0 / span_s / rate_hz;
        assert_eq!(channel, "gyro_z");
        assert!(last_dps < -419.43 + step_dps + 0.1 && (rise_dps + step_dps).abs() < 0.01, "{last_dps} {rise_dps}");
        for end_dps in [200.0, 300.0, 380.0] {
            assert_eq!(look(end_dps), Spoilt::Saturated { channel: "gyro_z".into() }, "{end_dps} {rate_hz} {span_s}");
        }
    }
}

/// A failed read in the rise changes nothing, and a reading that jumps to the end from rest is the sensor's fault.
#[test]
fn a_rise_is_seen_past_a_failed_read() {
    let mut samples = rising(1000.0, 432.0, 2.5, 419.43);
    let last = samples.iter().position(|sample| sample.gyro[2] < -SATURATION).expect("saturated");
    samples[last - 3].gyro[2] = 0;
    let spoilt = Watch::new(Uses::Gyro, false, 1000).look(&samples).expect_err("saturated").1;
    assert!(matches!(spoilt, Spoilt::TooFast { .. }), "{spoilt:?}");
    let jump: Vec<ImuSample> = still(100).into_iter().chain(samples[last..].to_vec()).collect();
    let spoilt = Watch::new(Uses::Gyro, false, 1000).look(&jump).expect_err("saturated").1;
    assert_eq!(spoilt, Spoilt::Saturated { channel: "gyro_z".into() });
}

/// One read in 50 gives 0 in place of 1 g: a finding of the data gate, not a motion.
#[test]
fn failed_reads_are_no_motion() {
    let mut samples = still(2000);
    for (row, sample) in samples.iter_mut().enumerate() {
        sample.accel[2] = if row > 400 && row % 50 == 7 { 0 } else { 160_000 };
    }
    assert_eq!(Watch::new(Uses::Inertial, true, 200).look(&samples), Ok(()));
}

/// Samples at rest in which `percent` of a hundred reads fail at scattered places, by the finaliser of SplitMix64.
fn with_failed_reads(count: usize, percent: u64, fails: fn(&mut ImuSample)) -> Vec<ImuSample> {
    let drawn = |row: u64| {
        let mut z = (row + 7).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % 100
    };
    let mut samples = still(count);
    samples.iter_mut().zip(0..).filter(|(_, row)| drawn(*row) < percent).for_each(|(sample, _)| fails(sample));
    samples
}

/// Faults as often as the data gate leaves them out, and somewhat more often: only the gate reports them.
#[test]
fn scattered_spikes_and_failed_reads_are_no_motion() {
    let faults: [fn(&mut ImuSample); 6] = [
        |sample| sample.accel[0] += 320_000,
        |sample| sample.accel[0] -= 15_000,
        |sample| sample.accel[2] = 0,
        |sample| sample.accel[2] = SATURATION,
        |sample| sample.gyro[1] = -SATURATION - 1,
        |sample| (sample.gyro, sample.accel) = ([-1; 3], [-1; 3]),
    ];
    for (number, fails) in faults.into_iter().enumerate() {
        for percent in [1, 5, 7] {
            let samples = with_failed_reads(60_000, percent, fails);
            assert_eq!(Watch::new(Uses::Inertial, true, 200).look(&samples), Ok(()), "{number}, {percent} %");
        }
    }
}

/// A real motion is noticed in the block in which it begins, whether reads fail or not.
#[test]
fn motion_among_failed_reads_is_noticed_at_once() {
    let check = |percent, moves: fn(&mut [ImuSample]), channel: &str| {
        let mut samples = with_failed_reads(2000, percent, |sample| sample.accel[0] = SATURATION);
        moves(&mut samples[1000..]);
        let (index, spoilt) = Watch::new(Uses::Inertial, true, 200).look(&samples).unwrap_err();
        let Spoilt::Moved { channel: told, .. } = spoilt else { panic!("{spoilt}") };
        assert_eq!((index, told.as_str()), (1199, channel));
    };
    for percent in [0, 5] {
        // A tilt of 0.7 degrees that stays.
        check(percent, |after| after.iter_mut().for_each(|sample| sample.accel[1] += 1_955), "accel_y");
        // A turn of 90 deg/s for 50 ms: 4.5 degrees.
        check(percent, |after| after[50..60].iter_mut().for_each(|sample| sample.gyro[2] += 90 * 20_000), "gyro_z");
        // A knock of half a g for 40 ms.
        check(percent, |after| after[90..98].iter_mut().for_each(|sample| sample.accel[1] -= 80_000), "accel_y");
    }
}

#[test]
fn the_angle_of_a_turn_is_seen_without_the_bias() {
    // A second of rest, 360 deg/s for a second, a second of rest, at 1 kHz with a bias of 2 deg/s.
    let mut samples = vec![ImuSample { gyro: [0, 0, 40_000], ..ImuSample::default() }; 3000];
    samples[1000..2000].iter_mut().for_each(|sample| sample.gyro[2] += 360 * 20_000);
    let seen_deg = turned_deg(&samples, 2, 1000, 1000);
    assert!((seen_deg - 360.0).abs() < 1e-9, "{seen_deg}");
}

/// The turn of the last test, in frames of 12 samples. Its end is found in the first tenth of a second after it.
#[test]
fn the_end_of_a_turn_is_seen_in_the_samples() {
    let mut samples = vec![ImuSample { gyro: [0, 0, 40_000], ..ImuSample::default() }; 3000];
    samples[1000..2000].iter_mut().for_each(|sample| sample.gyro[2] += 360 * 20_000);
    let mut watch = TurnWatch::new(2, 1000, &samples[..600]);
    let seen = (600..3000).step_by(12).find_map(|length| Some((length, watch.look(&samples[..length])?)));
    assert_eq!(seen, Some((2100, 2000)));
    assert_eq!(TurnWatch::new(2, 1000, &samples[..600]).look(&samples[..1500]), None, "it goes on");
}

/// By hand: 1080 / (5 - 0.5) = 240 and 1080 / (3 - 0.2) = 386 are within 400 deg/s, 1080 / (3 - 0.5) = 432 is not.
#[test]
fn a_turn_beyond_the_range_is_refused_with_the_arithmetic() {
    let check = |params: &str| -> Vec<String> {
        mistakes(&plan("rotation", params).items()[3]).into_iter().map(|(what, _)| what).collect()
    };
    assert!(check("").is_empty());
    assert!(check("span = \"3 s\", ramp = \"0.2 s\"").is_empty());
    assert_eq!(
        check("span = \"3 s\""),
        [
            "1080 deg in 3 s with ramps of 0.5 s go up to 1080 / (3 - 0.5) = 432 deg/s, and the gyroscopes' range is 400 deg/s"
        ]
    );
    assert_eq!(check("span = \"1 s\", ramp = \"1 s\""), ["two ramps of 1 s do not fit into a turn of 1 s"]);
    let late =
        "name = \"p\"\nversion = \"1\"\n[[item]]\nid = \"six-position\"\nphase = \"setup\"\ntimeout = \"600 s\"\n";
    let late =
        Plan::read("p.toml", late.into(), &mut |_| Err("no include".into())).unwrap().check(mistakes).unwrap_err();
    let text = late.to_string();
    assert!(
        text.contains(
            "p.toml:4:6: six-position takes at least 31 min 00 s of bench time, and its timeout is 10 min 00 s"
        ),
        "{text}"
    );
}

/// By hand: six times an hour at 900 Hz are 19.44 million samples, at 1000 Hz 21.6 million. A record with these could not be read
/// again.
#[test]
fn more_samples_than_a_record_holds_are_refused() {
    let check = |rate: u16| {
        let text = format!(
            "name = \"p\"\nversion = \"1\"\n[[item]]\nid = \"six-position\"\nphase = \"setup\"\ntimeout = \"24 h\"\n\
             params = {{ dwell = \"3600 s\", rate = \"{rate} Hz\" }}\n"
        );
        let plan = Plan::read("p.toml", text.into(), &mut |_| Err("no include".into())).unwrap();
        mistakes(&plan.items()[0]).into_iter().map(|(what, _)| what).collect::<Vec<_>>()
    };
    assert_eq!(check(900), [""; 0]);
    let what = "six-position captures 21600000 samples, and the record of an attempt holds at most 20000000";
    assert_eq!(check(1000), [what]);
}

/// By hand: the rest of a program when some of its captures exist.
#[test]
fn a_program_goes_on_where_it_broke_off() {
    let left = |program: &MotionProgram, labels: &[&str]| -> Vec<String> {
        let actions = program.after(|about| labels.contains(&about.label.as_str()));
        let word = |action: &ResumeAction| match action {
            ResumeAction::Take(step) => format!("take {}", step.about().unwrap().label),
            ResumeAction::Do(step) => match step {
                MotionStep::Lay(orientation) => {
                    format!("lay {}", orientation.to_string().split_whitespace().nth(4).unwrap_or_default())
                }
                MotionStep::PowerCycle { .. } => "cycle".into(),
                step => step.about().map(|about| about.label.clone()).unwrap_or_default(),
            },
        };
        actions.iter().map(word).filter(|word| !word.is_empty()).collect()
    };
    let six = of(ItemId::SixPosition, "");
    assert_eq!(left(&six, &[]).len(), 12, "nothing is there");
    let rest = left(&six, &["x+", "x-", "y+", "y-", "z+"]);
    assert_eq!(rest, ["take x+", "take x-", "take y+", "take y-", "take z+", "lay -Z", "z-"]);
    assert_eq!(left(&six, &["x+", "x-", "y+", "y-", "z+", "z-"]).last().unwrap(), "take z-");
    let turns = of(ItemId::Rotation, "");
    let rest = left(&turns, &["x+ rotation", "x- rotation", "y+ rotation"]);
    assert_eq!(rest[2..], ["take y+ rotation", "lay +Y", "y- rotation", "lay +Z", "z+ rotation", "z- rotation"]);
    let runs = of(ItemId::BiasRepeatability, "runs = 3");
    assert_eq!(left(&runs, &["run 1"]), ["take run 1", "lay +Z", "cycle", "run 2", "cycle", "run 3"]);
    let whole = of(ItemId::ScaleFactorRepeatability, "calibrations = 2, sensors = [\"accel\"]");
    let rest = left(&whole, &["calibration 1 x+", "calibration 1 x-"]);
    assert_eq!(rest[..3], ["cycle", "lay +X", "calibration 1 x+"], "a power-on belongs to one series");
    let first: Vec<String> = ["x+", "x-", "y+", "y-", "z+", "z-"].map(|label| format!("calibration 1 {label}")).into();
    let first: Vec<&str> = first.iter().map(String::as_str).chain(["calibration 2 x+"]).collect();
    assert_eq!(left(&whole, &first)[6..9], ["cycle", "lay +X", "calibration 2 x+"], "nobody lays it as it lay last");
}

/// By hand: no spin, stop or pause is asked for whose capture exists.
#[test]
fn motions_that_were_captured_are_left_out() {
    let left = |program: &MotionProgram, labels: &[&str]| -> Vec<String> {
        let actions = program.after(|about| labels.contains(&about.label.as_str()));
        let word = |action: &ResumeAction| match (action, action.step()) {
            (ResumeAction::Take(step), _) => format!("take {}", step.about().unwrap().label),
            (_, MotionStep::Lay(_)) => "lay".to_owned(),
            (_, MotionStep::Settle { .. }) => "settle".to_owned(),
            (_, MotionStep::Spin { rate_dps }) => format!("spin {rate_dps:+.0}"),
            (_, MotionStep::Stop) => "stop".to_owned(),
            (_, step) => step.about().unwrap().label.clone(),
        };
        actions.iter().map(word).collect()
    };
    let spins =
        of(ItemId::MagnetometerEllipse, "spin = \"3600 deg/s\", slow_spin = \"36 deg/s\", senses = [\"+\", \"-\"]");
    let all = left(&spins, &[]);
    assert_eq!(all[..5], ["lay", "spin +3600", "settle", "spin +", "stop"], "nothing is there");
    assert_eq!(
        left(&spins, &["spin +", "spin -", "slow spin +"]),
        ["take spin +", "take spin -", "take slow spin +", "lay", "spin -36", "settle", "slow spin -", "stop"]
    );
    // The third one is damaged: the table spins for it alone.
    assert_eq!(
        left(&spins, &["spin +", "spin -", "slow spin -"]),
        ["take spin +", "take spin -", "lay", "spin +36", "settle", "slow spin +", "take slow spin -", "stop"]
    );
    let steps = of(ItemId::Resolution, "sensors = [\"gyro\"], gyro_cycles = 2");
    let labels = labels(&steps);
    let had: Vec<&str> = labels[..2].iter().map(String::as_str).collect();
    let rest = left(&steps, &had);
    assert_eq!(rest[..5], [&*format!("take {}", had[0]), &*format!("take {}", had[1]), "lay", "settle", &*labels[2]]);
    let turns = of(ItemId::Rotation, "");
    assert_eq!(left(&turns, &["x+ rotation"])[..4], ["take x+ rotation", "lay", "settle", "x- rotation"]);
    // Every program is whole where nothing was captured.
    for (program, had) in [(&spins, "no"), (&steps, "no"), (&turns, "no")] {
        let whole: Vec<_> = program.steps.iter().map(ResumeAction::Do).collect();
        assert_eq!(program.after(|about| about.label == had), whole);
    }
}

/// What items say that they leave in the module agrees with what they do with it.
#[test]
fn traces_are_those_of_the_programs() {
    for id in ItemId::ALL {
        let item = |id: &str| format!("[[item]]\nid = \"{id}\"\nphase = \"setup\"\n");
        let before = ["six-position", "gyro-still", "rotation", "magnetometer-ellipse", "calibration-download"]
            .map(item)
            .concat();
        let asks = match id {
            ItemId::Prompt => "[[item.ask]]\nname = \"lid\"\nen = \"Close the lid.\"\nkind = \"done\"\n",
            _ => "",
        };
        let text = format!("name = \"p\"\nversion = \"1\"\n{before}{}name = \"it\"\n{asks}", item(id.as_str()));
        let plan = Plan::read("p.toml", text.into_bytes(), &mut |_| Err("no include".into())).unwrap();
        let item = plan.items().last().unwrap();
        let Some(program) = program(id, &item.params).unwrap() else {
            assert!(!id.leaves(Trace::Heat), "{id} runs again in seconds");
            continue;
        };
        let any = |is: &dyn Fn(&MotionStep) -> bool| program.steps.iter().any(is);
        let cycles = any(&|step| matches!(step, MotionStep::PowerCycle { .. }));
        let samples = any(&|step| matches!(step, MotionStep::Capture { .. } | MotionStep::Turn { .. }));
        let compensated = any(&|step| {
            matches!(
                step,
                MotionStep::Capture { uses: Uses::Compensated, .. } | MotionStep::Turn { uses: Uses::Compensated, .. }
            )
        });
        assert!(id.leaves(Trace::Heat), "{id} takes its time");
        assert_eq!(id.feels(Trace::Heat), samples, "{id}");
        assert_eq!((id.leaves(Trace::PowerOn), id.feels(Trace::PowerOn)), (cycles, cycles), "{id}");
        assert_eq!(id.feels(Trace::Coefficients), compensated, "{id}");
    }
}
