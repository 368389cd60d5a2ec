//! The turntable against attitudes and earth rates worked out by hand, and its errors against their stated size.

use std::time::{Duration, Instant};

use gnc_protocol::message::{StreamStart, StreamStop};
use gnc_protocol::stream::ImuSample;
use gnc_protocol::wire::Wire;
use gnc_rig::Along;
use hw_mocks::{ModuleAxis, RunningBench, Sign, Speed, TableModel, TableRefusal, TurntableError};
use nalgebra::Vector3;

use crate::host::{Host, options};

/// A table without any error.
const PERFECT: &str = "[turntable]\naxis_error_arcsec = [0, 0]\nheading_error_arcsec = 0\nmounting_deg = [0, 0, 0]\n\
    attitude_error_arcsec = 0\nrepeatability_arcsec = 0\nangle_error_ppm = 0\nangle_error_arcsec = 0\n\
    rate_error_ppm = 0\nwobble_arcsec = 0\nlever_arm_mm = [0, 0, 0]\n";
const LATITUDE_DEG: f64 = 34.2321;
const EARTH_DPH: f64 = 15.041_07;

/// Lets bench time pass until the module is still.
fn settle(host: &mut Host) {
    let (done, still) = std::sync::mpsc::channel();
    host.bench.wait_still(done);
    for _ in 0..1000 {
        if let Ok(answer) = still.try_recv() {
            return answer.unwrap();
        }
        let came = host.turn();
        host.frames.extend(came);
    }
    panic!("the table never came to rest");
}

fn orient(host: &mut Host, along: Along, axis: ModuleAxis, sign: Sign, heading_deg: f64) {
    host.bench.orient(along, axis, sign, heading_deg).unwrap();
    settle(host);
}

fn rate_dph(host: &Host) -> Vector3<f64> {
    host.bench.truth().influence.rate_rps.map(f64::to_degrees) * 3600.0
}

/// Earth rate by hand: all of it along the polar axis, at any heading; its cosine along north, its sine up.
#[test]
fn orientations_point_where_they_say() {
    let mut host = Host::powered(PERFECT);
    let latitude = f64::to_radians(LATITUDE_DEG);
    for axis in ModuleAxis::ALL {
        for sign in [Sign::Plus, Sign::Minus] {
            let along = |v: Vector3<f64>| v[axis.index()] * sign.factor();
            orient(&mut host, Along::Polar, axis, sign, 77.0);
            assert!((along(rate_dph(&host)) - EARTH_DPH).abs() < 1e-4);
            assert!(rate_dph(&host).norm() < EARTH_DPH + 1e-4);
            orient(&mut host, Along::North, axis, sign, 200.0);
            assert!((along(rate_dph(&host)) - EARTH_DPH * latitude.cos()).abs() < 1e-4);
            assert!(along(host.bench.truth().influence.force).abs() < 1e-9);
            orient(&mut host, Along::Up, axis, sign, 90.0);
            let truth = host.bench.truth();
            assert!((along(truth.influence.force) - truth.gravity).abs() < 1e-9);
            assert!((along(rate_dph(&host)) - EARTH_DPH * latitude.sin()).abs() < 1e-4);
            // The next axis points east, so the third axis measures the earth rate: south for an axis up.
            let third = axis.next().next().index();
            assert!(rate_dph(&host)[axis.next().index()].abs() < 1e-4);
            assert!((rate_dph(&host)[third] - sign.factor() * EARTH_DPH * latitude.cos()).abs() < 1e-4);
            // The attitude of a module laid down by hand.
            let by_table = truth.attitude;
            host.bench.set_axis_up(axis, sign);
            host.bench.set_heading_deg(90.0);
            assert!((host.bench.truth().attitude - by_table).norm() < 1e-9);
        }
    }
    // With Z to the pole, X at heading 0 lies in the meridian plane above: it measures cos(latitude) of gravity.
    orient(&mut host, Along::Polar, ModuleAxis::Z, Sign::Plus, 0.0);
    let truth = host.bench.truth();
    assert!((truth.influence.force.x - truth.gravity * latitude.cos()).abs() < 1e-6, "{}", truth.influence.force);
}

#[test]
fn any_attitude_and_a_small_tilt() {
    let mut host = Host::powered(PERFECT);
    for up in [[1.0, 1.0, 0.0], [-2.0, 0.5, 0.3], [0.0, (0.057_f64).to_radians().sin(), (0.057_f64).to_radians().cos()]]
    {
        host.bench.orient_up(up, 30.0).unwrap();
        settle(&mut host);
        let truth = host.bench.truth();
        let unit = Vector3::from(up).normalize();
        assert!((truth.influence.force - unit * truth.gravity).norm() < 1e-9, "{up:?}: {}", truth.influence.force);
    }
    // 0.057 deg is 1 mg.
    assert!((host.bench.truth().influence.force.y / 9.80665 - 0.994e-3).abs() < 1e-5);
    for up in [[0.0; 3], [f64::NAN, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0]] {
        assert!(matches!(host.bench.orient_up(up, 0.0), Err(TableRefusal::NoDirection { .. })), "{up:?}");
    }
}

/// Three turns forth and back about each axis. The sum of the rate over the samples is the angle, within the table's
/// own error, and the rate peaks at 240 deg/s.
#[test]
fn rotations_turn_by_their_angle() {
    for (text, about) in [(PERFECT, 0.002), ("", 0.02)] {
        let mut host = Host::powered(text);
        for axis in ModuleAxis::ALL {
            orient(&mut host, Along::Polar, axis, Sign::Plus, 0.0);
            let before = host.bench.truth().attitude;
            for angle_deg in [1080.0, -1080.0] {
                host.frames.clear();
                host.ask(&StreamStart { stream: 1, rate_hz: 1000, count: 0, samples_per_frame: 10 });
                host.bench.rotate(angle_deg, 5.0).unwrap();
                settle(&mut host);
                host.ask(&StreamStop { stream: 1 });
                let truth = host.bench.truth();
                assert!((truth.table.rotation_deg - angle_deg).abs() <= about, "{:?}", truth.table);
                let rates: Vec<Vector3<f64>> = host
                    .streamed(1)
                    .iter()
                    .flat_map(|frame| frame.samples.chunks(40).map(ImuSample::from_payload).collect::<Vec<_>>())
                    .map(|sample| Vector3::from(sample.unwrap().gyro.map(|code| f64::from(code) / 20_000.0)))
                    .collect();
                let models = truth.sensors;
                let response = models.gyro.response;
                let sum: Vector3<f64> = rates.iter().sum::<Vector3<f64>>() / 1000.0;
                // Bias, g-sensitivity and the earth over five seconds: 0.1 deg/s at most; 9 deg/h sqrt(s) of noise.
                let turned = response.try_inverse().unwrap() * sum;
                assert!((turned[axis.index()] - truth.table.rotation_deg).abs() < 0.6, "{axis:?}: {turned}");
                let peak = rates.iter().map(|rate| rate[axis.index()].abs()).fold(0.0, f64::max);
                assert!((239.0..242.0).contains(&peak), "{peak}");
            }
            // Back at the start, except for the table's errors.
            assert!((host.bench.truth().attitude - before).norm() < 1e-3);
        }
    }
}

/// The module turns about the table's axis and measures its own mounting: 0.1 deg about Z puts 1.745e-3 of a turn about
/// X onto Y.
#[test]
fn the_mounting_shows_as_coupling() {
    let text = format!("{}\n", PERFECT.replace("mounting_deg = [0, 0, 0]", "mounting_deg = [0, 0, 0.1]"));
    let mut host = Host::powered(&text);
    orient(&mut host, Along::Up, ModuleAxis::X, Sign::Plus, 0.0);
    let axis = host.bench.truth().table.axis_module;
    assert!((axis.y.abs() - 1.745e-3).abs() < 1e-6 && axis.x > 0.999, "{axis}");
    host.bench.spin(100.0).unwrap();
    let (done, awake) = std::sync::mpsc::channel();
    host.bench.sleep(Duration::from_secs(10), done);
    while awake.try_recv().is_err() {
        host.turn();
    }
    let truth = host.bench.truth();
    assert!((truth.influence.rate_rps.y.to_degrees() / 100.0 - axis.y).abs() < 1e-4);
}

/// Errors have the size that the model gives. The same orientation has the same error, and only the seed decides.
#[test]
fn errors_are_small_and_belong_to_the_orientation() {
    let arcsec = |host: &mut Host, axis| {
        orient(host, Along::Up, axis, Sign::Plus, 0.0);
        let truth = host.bench.truth();
        let up = (truth.influence.force / truth.gravity)[axis.index()];
        up.acos().to_degrees() * 3600.0
    };
    let fixed = PERFECT.replace("attitude_error_arcsec = 0", "attitude_error_arcsec = 20");
    let mut host = Host::powered(&fixed);
    let tilts = ModuleAxis::ALL.map(|axis| arcsec(&mut host, axis));
    assert!(tilts.iter().all(|tilt| (0.5..80.0).contains(tilt)), "{tilts:?}");
    let again = ModuleAxis::ALL.map(|axis| arcsec(&mut host, axis));
    assert!(tilts.iter().zip(&again).all(|(a, b)| (a - b).abs() < 1e-3), "{tilts:?} {again:?}");
    let mut another = Host::powered(&fixed);
    assert!((arcsec(&mut another, ModuleAxis::Y) - tilts[1]).abs() < 1e-3);
    // A tilted axis is tilted in every attitude.
    let mut tilted = Host::powered(&PERFECT.replace("axis_error_arcsec = [0, 0]", "axis_error_arcsec = [30, 0]"));
    assert!(ModuleAxis::ALL.iter().all(|axis| (arcsec(&mut tilted, *axis) - 30.0).abs() < 1e-3));
    assert!((tilted.bench.truth().table.axis_local.x - f64::to_radians(30.0 / 3600.0)).abs() < 1e-9);
}

/// A sensor off the axis of a spin feels w^2 r, with the rate and the lever worked out by hand.
#[test]
fn a_spin_ramps_up_swings_and_stops() {
    let text = PERFECT.replace("lever_arm_mm = [0, 0, 0]", "lever_arm_mm = [10, 0, 0]");
    let mut host = Host::powered(&text);
    orient(&mut host, Along::North, ModuleAxis::Z, Sign::Plus, 0.0);
    host.bench.spin(5400.0).unwrap();
    let pass = |host: &mut Host, span_s: f64| {
        let (done, awake) = std::sync::mpsc::channel();
        host.bench.sleep(Duration::from_secs_f64(span_s), done);
        while awake.try_recv().is_err() {
            host.turn();
        }
        host.bench.truth()
    };
    assert!((pass(&mut host, 1.8).table.rate_dps - 2700.0).abs() < 0.1);
    let spinning = pass(&mut host, 60.0);
    assert!((spinning.table.rate_dps - 5400.0).abs() < 1e-6);
    let swing = (15.0 * std::f64::consts::TAU).powi(2) * 0.01;
    // Gravity turns with it: at most 9.8 in each direction.
    assert!((spinning.influence.force.x + swing).abs() < 9.9, "{}", spinning.influence.force);
    let (done, still) = std::sync::mpsc::channel();
    host.bench.wait_still(done);
    assert_eq!(still.try_recv().unwrap(), Err(TableRefusal::Spinning));
    host.bench.stop();
    let before = host.bench.bench_time_ns();
    settle(&mut host);
    let span_s = (host.bench.bench_time_ns() - before) as f64 * 1e-9;
    assert!((span_s - 1.8).abs() < 1e-3, "{span_s}");
}

#[test]
fn the_table_refuses_what_it_cannot_do() {
    let mut host = Host::powered("good");
    let bench = &mut host.bench;
    assert!(
        matches!(bench.rotate(1080.0, 0.1), Err(TableRefusal::TooFast { rate_dps }) if (rate_dps - 12e3).abs() < 1.0)
    );
    assert_eq!(bench.rotate(10.0, 0.0), Err(TableRefusal::Span { span_s: 0.0 }));
    assert!(matches!(bench.rotate(f64::NAN, 5.0), Err(TableRefusal::NoNumber { what: "angle", .. })));
    assert!(matches!(bench.spin(f64::INFINITY), Err(TableRefusal::NoNumber { what: "rate", .. })));
    assert!(matches!(bench.spin(-8000.0), Err(TableRefusal::TooFast { .. })));
    bench.rotate(1080.0, 5.0).unwrap();
    assert_eq!(bench.orient(Along::Up, ModuleAxis::X, Sign::Plus, 0.0), Err(TableRefusal::Moving));
    assert_eq!(bench.rotate(1080.0, 5.0), Err(TableRefusal::Moving));
    settle(&mut host);
    host.bench.orient(Along::Up, ModuleAxis::X, Sign::Plus, 0.0).unwrap();
    assert_eq!(host.bench.spin(10.0), Err(TableRefusal::Moving));
    host.bench.stop();
    settle(&mut host);
    // The table is stopped at the start of its way, after a tiny motion: its orientation is unknown.
    assert_eq!(host.bench.rotate(10.0, 5.0), Err(TableRefusal::NotOriented));
    orient(&mut host, Along::Up, ModuleAxis::X, Sign::Plus, 0.0);
    host.bench.rotate(10.0, 5.0).unwrap();
    assert_eq!(
        TurntableError::from(TableRefusal::TooFast { rate_dps: 9000.0 }).to_string(),
        "the turntable turns at up to 7200 deg/s, but 9000 deg/s are needed"
    );
}

/// At maximum speed a motion needs a caller that lets time pass; waiting is enough, without a request or a stream.
#[test]
fn waiting_for_the_table_never_hangs() {
    const PATIENCE: Duration = Duration::from_secs(20);
    let bench = RunningBench::start(&options("good", Speed::Max)).unwrap();
    let control = bench.control();
    let started = Instant::now();
    control.wait_still().unwrap();
    for axis in ModuleAxis::ALL {
        control.orient(Along::Polar, axis, Sign::Minus, 0.0).unwrap();
        assert!(control.moving().unwrap());
        control.wait_still().unwrap();
        assert!(!control.moving().unwrap());
        control.rotate(-1080.0, 5.0).unwrap();
        assert_eq!(control.rotate(1.0, 5.0), Err(TurntableError::Refused(TableRefusal::Moving)));
        control.wait_still().unwrap();
    }
    control.spin(5400.0).unwrap();
    assert_eq!(control.wait_still(), Err(TurntableError::Refused(TableRefusal::Spinning)));
    control.sleep(Duration::from_secs(180)).unwrap();
    // One thread waits, another one stops the table.
    control.stop().unwrap();
    let waiting = {
        let control = control.clone();
        std::thread::spawn(move || control.wait_still())
    };
    waiting.join().unwrap().unwrap();
    assert!(started.elapsed() < PATIENCE);
    drop(bench);
    assert!(matches!(control.spin(1.0), Err(TurntableError::Gone(_))));
}

/// At true speed a rotation begins when it is ordered, not at the bench's last look.
#[test]
fn a_motion_begins_when_it_is_ordered() {
    let bench = RunningBench::start(&options(&format!("{PERFECT}slew_s = 0.0\n"), Speed::Times(1.0))).unwrap();
    let control = bench.control();
    control.sleep(Duration::from_millis(300)).unwrap();
    let before = control.truth().unwrap().bench_time_ns;
    control.rotate(36.0, 0.2).unwrap();
    control.wait_still().unwrap();
    let span_s = (control.truth().unwrap().bench_time_ns - before) as f64 * 1e-9;
    assert!(span_s >= 0.2, "{span_s}");
    assert_eq!(
        control.truth().unwrap().table.model,
        TableModel { slew_s: 0.0, ..control.truth().unwrap().table.model }
    );
}

/// A turn by 1080 deg in 5 s has a mean rate of 216 deg/s. Ramps of a tenth each give a peak of 216 / 0.9, ramps of a half
/// each one of 216 / 0.5.
#[test]
fn long_ramps_peak_higher() {
    for (ramp, peak_dps) in [("", 240.0), ("ramp_share = 0.1\n", 240.0), ("ramp_share = 0.5\n", 432.0)] {
        let mut host = Host::powered(&format!("{PERFECT}{ramp}"));
        host.bench.rotate(1080.0, 5.0).unwrap();
        let (mut highest_dps, until) = (0.0_f64, host.bench.bench_time_ns() + 6_000_000_000);
        while host.bench.bench_time_ns() < until {
            let (done, _slept) = std::sync::mpsc::channel();
            host.bench.sleep(Duration::from_millis(5), done);
            host.turn();
            highest_dps = highest_dps.max(host.bench.truth().table.rate_dps);
        }
        let truth = host.bench.truth().table;
        assert!((highest_dps - peak_dps).abs() < 1.0, "{ramp}: {highest_dps}");
        assert!((truth.rotation_deg - 1080.0).abs() < 1e-9 && !truth.moving, "{truth:?}");
    }
}
