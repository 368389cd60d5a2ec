//! Records that give no figure, and the reasons.

use gnc_metrology::sample_clock::{ClockFault, SampleClock};
use gnc_protocol::stream::Losses;

use super::calibrating::{SIX, calibrated};
use super::world::World;
use super::*;

fn six(captures: &[Capture]) -> FigureError {
    ask(ItemId::SixPosition, SIX, captures, &[]).unwrap_err()
}

#[test]
fn positions() {
    let good = World::new(21).six("", 1, 60.0, 20);
    let with = |change: &dyn Fn(&mut Vec<Capture>)| {
        let mut captures = good.clone();
        change(&mut captures);
        six(&captures)
    };
    let lost = with(&|captures| captures[2].losses = Losses { received: 1190, on_board: 2, on_line: 8 });
    assert_eq!(lost.to_string(), "y+: samples are missing: 2 lost on the board, 8 on the line");
    let short = with(&|captures| captures[1].samples.truncate(1100));
    assert_eq!(short.to_string(), "x- has 1100 samples, the plan asks for 1200");
    let missing = with(&|captures| drop(captures.remove(3)));
    assert_eq!(missing.to_string(), "no capture of position y-: 0 of 1");
    let doubled = with(&|captures| captures.push(captures[0].clone()));
    assert_eq!(doubled.to_string(), "x+ does not fit: it is the same attitude as x+");
    // A single such value is a failed read; many in a row are the end of the range.
    let saturated = with(&|captures| captures[4].samples[7..27].iter_mut().for_each(|s| s.accel[2] = 8_388_607));
    assert_eq!(saturated.to_string(), "z+: accel z is saturated in 20 samples");
    let below = with(&|captures| captures[4].samples[7..27].iter_mut().for_each(|s| s.accel[2] = -8_388_608));
    assert!(matches!(below, FigureError::Saturated { samples: 20, .. }));
    // A gyroscope that is not used may have any fault.
    let mut idle = good.clone();
    idle[4].samples[7..27].iter_mut().for_each(|sample| sample.gyro[2] = 8_388_607);
    assert!(ask(ItemId::SixPosition, SIX, &idle, &[]).is_ok());
    let stuck = with(&|captures| captures[0].samples.iter_mut().for_each(|sample| sample.accel[1] = 77));
    assert_eq!(stuck.to_string(), "x+: accel y stands still at 77");
    // 10 mg from the middle on: a table that was pushed.
    let moved = with(&|captures| captures[5].samples[600..].iter_mut().for_each(|sample| sample.accel[0] += 1600));
    assert!(
        matches!(&moved, FigureError::Moved { label, channel, .. } if label == "z-" && channel == "accel x"),
        "{moved}"
    );
    let upside_down = with(&|captures| {
        let (one, other) = (captures[0].samples.clone(), captures[1].samples.clone());
        (captures[0].samples, captures[1].samples) = (other, one);
    });
    assert!(matches!(upside_down, FigureError::Refused { refusal: gnc_metrology::Refusal::WrongSign { .. }, .. }));
    let wrong = with(&|captures| {
        captures[0].about.pose = crate::capture::Pose::Still { up: [2.0, 0.0, 0.0], heading_deg: 0.0 }
    });
    assert!(matches!(wrong, FigureError::Unfit { .. }));
    let question = params(ItemId::SixPosition, SIX);
    let nowhere = AnalysisInput { params: &question, site: None, captures: &good, earlier: &[] };
    assert_eq!(analyse(ItemId::SixPosition, &nowhere), Err(FigureError::NoPlace));
    for error in [lost, short, missing, doubled, saturated, stuck, moved, upside_down, wrong] {
        assert!(!error.try_this().is_empty());
    }
}

#[test]
fn rotations() {
    let good = World::new(22).turns("", 1, 200);
    let refuse = |change: &dyn Fn(&mut Vec<Capture>)| {
        let mut captures = good.clone();
        change(&mut captures);
        ask(ItemId::Rotation, "", &captures, &[]).unwrap_err()
    };
    let lost = refuse(&|captures| captures[0].losses.on_line = 1);
    assert!(matches!(lost, FigureError::Lost { .. }));
    let cut = refuse(&|captures| captures[1].samples.truncate(1000));
    assert!(matches!(cut, FigureError::Refused { refusal: gnc_metrology::Refusal::CutOff { .. }, .. }), "{cut}");
    let missing = refuse(&|captures| drop(captures.remove(5)));
    assert!(
        matches!(missing, FigureError::Refused { refusal: gnc_metrology::Refusal::Missing { .. }, .. }),
        "{missing}"
    );
    let fast = refuse(&|captures| captures[0].samples[700..720].iter_mut().for_each(|s| s.gyro[0] = 8_388_607));
    assert!(matches!(fast, FigureError::Saturated { .. }), "{fast}");
    let nudged =
        refuse(&|captures| captures[2].samples[1500..1600].iter_mut().for_each(|sample| sample.gyro[1] += 40_000));
    assert!(matches!(nudged, FigureError::Refused { .. }), "{nudged}");
    let other = refuse(&|captures| {
        if let crate::capture::Pose::Rotating { angle_deg, .. } = &mut captures[3].about.pose {
            *angle_deg = -720.0;
        }
    });
    assert!(matches!(other, FigureError::Unfit { .. }), "{other}");
    // The angle is wrong by a turn in both directions. Only the band around the nominal scale factor shows it.
    let turns = refuse(&|captures| {
        for capture in captures {
            if let crate::capture::Pose::Rotating { angle_deg, .. } = &mut capture.about.pose {
                *angle_deg *= 2.0 / 3.0;
            }
        }
    });
    assert!(matches!(turns, FigureError::Refused { refusal: gnc_metrology::Refusal::OutOfBand { .. }, .. }), "{turns}");
}

/// Items that work with a calibration name the item to run first.
#[test]
fn what_is_not_calibrated() {
    let mut world = World::new(23);
    let earlier = calibrated(&mut world);
    let still = [world.still("still", 1, "z+", 0.0, 60.0, 20)];
    let text = "dwell = \"60 s\", rate = \"20 Hz\"";
    for (left_out, expected) in
        [("six-position", ItemId::SixPosition), ("gyro-still", ItemId::GyroStill), ("rotation", ItemId::Rotation)]
    {
        let some: Vec<_> = earlier.iter().filter(|(name, _)| name != left_out).cloned().collect();
        let refused = ask(ItemId::GyroBias, text, &still, &some);
        assert_eq!(refused, Err(FigureError::NotCalibrated { item: expected }));
        assert!(refused.unwrap_err().try_this().contains(left_out));
        assert_eq!(
            ask(ItemId::CalibrationDownload, "", &[], &some),
            Err(FigureError::NotCalibrated { item: expected })
        );
    }
    let hour = "sensors = [\"accel\"], duration = \"60 s\", rate = \"20 Hz\"";
    assert!(ask(ItemId::BiasStability, hour, &still, &earlier[..1]).is_ok());
    assert!(matches!(ask(ItemId::GyroBias, text, &[], &earlier), Err(FigureError::Missing { .. })));
    assert_eq!(ask(ItemId::Imu, "", &still, &earlier), Err(FigureError::NoAnalysis { item: ItemId::Imu }));
}

/// Motion in the hour, a gap in the hour, a capture that is too short.
#[test]
fn an_hour_that_is_spoilt() {
    let mut world = World::new(24);
    let earlier = calibrated(&mut world);
    let good = [world.still("still", 1, "z+", 0.0, 120.0, 20)];
    let text = "duration = \"120 s\", rate = \"20 Hz\"";
    for item in [ItemId::BiasStability, ItemId::Allan, ItemId::Psd] {
        let with = |change: &dyn Fn(&mut Capture)| {
            let mut captures = good.clone();
            change(&mut captures[0]);
            let text = if item == ItemId::Psd { format!("{text}, segment = 256") } else { text.to_owned() };
            ask(item, &text, &captures, &earlier)
        };
        assert!(with(&|_| ()).is_ok(), "{item}");
        let moved = with(&|capture| capture.samples[1200..].iter_mut().for_each(|sample| sample.accel[1] += 1600));
        assert!(matches!(moved, Err(FigureError::Moved { .. })), "{item} {moved:?}");
        let lost = with(&|capture| capture.losses.on_board = 1);
        assert!(matches!(lost, Err(FigureError::Lost { .. })), "{item}");
        let short = with(&|capture| capture.samples.truncate(2000));
        assert!(matches!(short, Err(FigureError::Short { .. })), "{item}");
    }
    let uneven = ask(ItemId::BiasStability, &format!("{text}, block = \"0.33 s\""), &good, &earlier);
    assert!(matches!(uneven, Err(FigureError::Unfit { .. })), "{uneven:?}");
}

/// Samples off the grid of the board's own time have no known rate, so no item makes a figure of them.
#[test]
fn samples_off_the_boards_own_time_are_refused_everywhere() {
    for item in [ItemId::SixPosition, ItemId::GyroBias, ItemId::BiasStability, ItemId::Allan, ItemId::Rotation] {
        let mut world = World::new(1);
        let mut captures = if item == ItemId::Rotation { world.turns("", 1, 200) } else { world.six("", 1, 10.0, 20) };
        let capture = &mut captures[1];
        let (rate_hz, label) = (capture.about.rate_hz, capture.about.label.clone());
        let mut clock = SampleClock::new(rate_hz);
        for number in 0..capture.samples.len() as u32 {
            // The clock is 30 ppm fast.
            clock.stamp(number, (f64::from(number) / f64::from(rate_hz) * 1e9 / (1.0 + 30e-6)) as u64 / 1000 * 1000);
        }
        capture.timing.board = clock;
        match ask(item, "", &captures, &[]) {
            Err(error @ FigureError::Clock { fault: ClockFault::Rate { error_ppm, .. }, .. }) => {
                assert!((error_ppm - 30.0).abs() < 0.2, "{error_ppm}");
                assert!(error.to_string().starts_with(&format!("{label}: by the board's own time")), "{error}");
                assert!(error.try_this().contains("section 10"), "{}", error.try_this());
            }
            other => panic!("{item}: {other:?}"),
        }
    }
}
