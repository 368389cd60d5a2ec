//! Each sensor fault has the size and the place that its board states, and changes nothing else.

use gnc_rig::Along;
use hw_mocks::devices::inertial::{SensorFaults, SensorModels, Sensors, TriadFaults};
use hw_mocks::world::{Influence, TrueSite, World};
use hw_mocks::{ModuleAxis, Sign};
use nalgebra::{Matrix3, Vector3};

use crate::host::Host;

const G: f64 = 9.80665;

fn still(rate_dps: f64, force_x_g: f64) -> Influence {
    Influence {
        rate_rps: Vector3::new(rate_dps.to_radians(), 0.0, 0.0),
        force: Vector3::new(force_x_g * G, 0.0, G),
        field_gauss: Vector3::new(0.3, 0.1, -0.4),
        temperature_c: 25.0,
    }
}

/// Modules without noise and bandwidth, so that a fault stands alone.
fn silent(faults: SensorFaults) -> Sensors {
    let mut models = SensorModels::default();
    for triad in [&mut models.gyro, &mut models.accel, &mut models.mag] {
        triad.noise = Default::default();
        triad.response = Matrix3::identity();
        triad.bias = Vector3::zeros();
        triad.bandwidth = None;
    }
    models.gyro_per_g = Matrix3::zeros();
    let mut sensors = Sensors::new(models, faults, 5);
    sensors.power_on(0.0);
    sensors
}

fn gyro(faults: TriadFaults) -> Sensors {
    silent(SensorFaults { gyro: faults, ..SensorFaults::default() })
}

fn accel(faults: TriadFaults) -> Sensors {
    silent(SensorFaults { accel: faults, ..SensorFaults::default() })
}

fn rate_dps(sensors: &mut Sensors, input_dps: f64, now_s: f64) -> f64 {
    f64::from(sensors.sample(&still(input_dps, 0.0), now_s, 200.0).gyro[0]) / 20_000.0
}

fn force_g(sensors: &mut Sensors, input_g: f64, now_s: f64) -> [f64; 3] {
    sensors.sample(&still(0.0, input_g), now_s, 200.0).accel.map(|code| f64::from(code) / 160_000.0)
}

#[test]
fn a_drift_begins_at_each_power_on() {
    let mut sensors = gyro(TriadFaults { drift_per_h: Vector3::new(0.1, 0.0, 0.0), ..TriadFaults::default() });
    for start_s in [0.0, 5000.0] {
        sensors.power_on(start_s);
        for (after_s, expected) in [(1.0, 0.0), (1800.0, 0.05), (3600.0, 0.1)] {
            let got = rate_dps(&mut sensors, 0.0, start_s + after_s);
            assert!((got - expected).abs() < 1e-4, "{after_s}: {got}");
        }
    }
}

/// Twenty-two deg/h up and down each minute: 10 s means show 0.955 of it, whole minutes none.
#[test]
fn a_wander_is_gone_in_whole_periods() {
    let amplitude_dps = 22.0 / 3600.0;
    let mut sensors = gyro(TriadFaults { wander: Vector3::new(amplitude_dps, 0.0, 0.0), ..TriadFaults::default() });
    let means: Vec<f64> = (0..60)
        .map(|block| {
            let at = |k: u32| f64::from(block * 100 + k) * 0.1;
            (0..100).map(|k| rate_dps(&mut sensors, 0.0, at(k))).sum::<f64>() / 100.0
        })
        .collect();
    let square = means.iter().map(|mean| mean * mean).sum::<f64>() / 60.0;
    assert!((square.sqrt() / (amplitude_dps / 2.0_f64.sqrt()) - 0.955).abs() < 0.01, "{}", square.sqrt() * 3600.0);
    assert!(means.chunks(6).all(|minute| minute.iter().sum::<f64>().abs() / 6.0 < 0.03 * amplitude_dps));
}

#[test]
fn a_deadband_swallows_small_rates_and_a_range_clips_large_ones() {
    let mut sensors = gyro(TriadFaults {
        deadband: Vector3::new(0.03, 0.0, 0.0),
        range: Vector3::new(200.0, 0.0, 0.0),
        ..TriadFaults::default()
    });
    for (input, expected) in [(0.029, 0.0), (-0.029, 0.0), (0.031, 0.031), (199.0, 199.0), (-150.0, -150.0)] {
        assert!((rate_dps(&mut sensors, input, 1.0) - expected).abs() < 1e-4, "{input}");
    }
    let code = |sensors: &mut Sensors, input| sensors.sample(&still(input, 0.0), 1.0, 200.0).gyro[0];
    assert_eq!((code(&mut sensors, 201.0), code(&mut sensors, -201.0)), (8_388_607, -8_388_608));
}

#[test]
fn steps_hide_what_is_smaller() {
    let mut sensors = accel(TriadFaults { step: Vector3::new(0.006243, 0.0, 0.0), ..TriadFaults::default() });
    let at = |sensors: &mut Sensors, input| force_g(sensors, input, 1.0)[0];
    assert_eq!((at(&mut sensors, 0.0), at(&mut sensors, 0.001), at(&mut sensors, -0.001)), (0.0, 0.0, 0.0));
    assert!((at(&mut sensors, 0.004) - 0.006243).abs() < 1e-5);
    // Local gravity lies at the middle of a step.
    let gravity = TrueSite::default().gravity() / G;
    assert!(((gravity / 0.006243).fract() - 1.0).abs() < 0.05 || (gravity / 0.006243).fract() < 0.05);
    assert_eq!(force_g(&mut sensors, 0.001, 1.0)[2], 1.0, "the others are as they were");
}

/// Deviations over many power-ons: estimates from 400 of them scatter by 3.5 %.
#[test]
fn what_is_new_at_each_power_on_has_its_deviation() {
    let faults =
        TriadFaults { scale_turn_on: Vector3::new(0.008, 0.0, 0.0), coupling_turn_on: 0.005, ..TriadFaults::default() };
    let mut sensors = accel(faults);
    let (mut scale, mut coupling) = (0.0, 0.0);
    for _ in 0..400 {
        sensors.power_on(0.0);
        let response = sensors.truth(25.0).accel.response;
        scale += (response[(0, 0)] - 1.0).powi(2) / 400.0;
        coupling += response[(0, 1)].powi(2) / 400.0;
        let others = [(1, 1), (2, 2), (1, 0), (0, 2), (2, 0), (1, 2), (2, 1)];
        assert!(others.iter().all(|(r, c)| response[(*r, *c)] == f64::from(u8::from(r == c))));
    }
    assert!((scale.sqrt() / 0.008 - 1.0).abs() < 0.15, "{}", scale.sqrt());
    assert!((coupling.sqrt() / 0.005 - 1.0).abs() < 0.15, "{}", coupling.sqrt());
}

/// At 15 rev/s 100 microseconds are 0.54 deg: Y measures the field later in the turn than X by this angle.
#[test]
fn a_skew_is_an_angle_that_grows_with_the_rate() {
    let mut sensors = silent(SensorFaults { mag_y_skew_us: 100.0, ..SensorFaults::default() });
    let mut world = World::new(TrueSite::default(), std::time::Duration::ZERO, 25.0);
    world.set_turn(ModuleAxis::Z, 5400.0, 0.0);
    let mut reader = sensors.reader(1000.0);
    let (mut in_phase, mut across, mut x_square) = (0.0, 0.0, 0.0);
    for index in 0..1000 {
        let now_s = f64::from(index) / 1000.0;
        let sample = sensors.read(&mut reader, |moment_s| world.influence(moment_s), now_s);
        // Y a quarter of a turn later equals X: with x = cos and y = -sin the product has the mean sin(skew) / 2.
        let (x, y) = (f64::from(sample.mag[0]), f64::from(sample.mag[1]));
        in_phase += x * y;
        x_square += x * x;
        across += y * y;
    }
    let angle_deg = (in_phase / (x_square * across).sqrt()).asin().to_degrees();
    assert!((angle_deg.abs() - 0.54).abs() < 0.005, "{angle_deg}");
}

/// The module of each board has the stated properties; gyroscopes and accelerometers without the fault are module 1.
#[test]
fn boards_have_the_faults_they_state() {
    let truth = |name: &str| Host::powered(name).bench.truth();
    let good = truth("good").sensors;
    let scatter = truth("gyro-turn-on-scatter").sensors;
    assert!((scatter.gyro.noise[0].turn_on * 3600.0 - 90.0).abs() < 1e-9);
    assert_eq!((scatter.gyro.noise[0].slow, scatter.accel), (good.gyro.noise[0].slow, good.accel));
    let flicker = truth("gyro-flicker").sensors;
    assert!((flicker.gyro.noise[0].flicker * 3600.0 - 9.5).abs() < 1e-9);
    let soft = truth("mag-soft-iron-strong").sensors;
    assert_eq!((soft.mag.response[(0, 0)], soft.mag.bias), (2.0, good.mag.bias));
    assert_ne!(truth("accel-scale-unstable").sensors_now.accel.response, good.accel.response);
    assert_eq!(truth("accel-scale-unstable").sensors_now.gyro.response, good.gyro.response);
}

/// The fault of one axis saturates where a turn about north takes the axis, and not in the horizontal field.
#[test]
fn one_magnetometer_saturates_in_the_vertical_field_only() {
    let mut host = Host::powered("mag-one-axis-saturates");
    let seen = |host: &Host| {
        let truth = host.bench.truth();
        let sensed = truth.sensors_now.mag.response * truth.influence.field_gauss + truth.sensors_now.mag.bias;
        sensed.x * 1.25e6
    };
    for heading_deg in [0.0, 90.0, 180.0, 270.0, 3.5] {
        host.bench.set_heading_deg(heading_deg);
        assert!(seen(&host) < 8_388_607.0, "{heading_deg}: {}", seen(&host));
    }
    let mut most = 0.0_f64;
    for heading_deg in 0..36 {
        host.bench.orient(Along::North, ModuleAxis::Z, Sign::Plus, f64::from(heading_deg) * 10.0).unwrap();
        let (done, still) = std::sync::mpsc::channel();
        host.bench.wait_still(done);
        while still.try_recv().is_err() {
            host.turn();
        }
        most = most.max(seen(&host));
    }
    assert!(most > 8_388_607.0, "{most}");
}
