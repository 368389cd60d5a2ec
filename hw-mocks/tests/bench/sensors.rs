//! Sensors against a truth that is computed in another way, and against the published noise figures.

use gnc_protocol::message::{AdRead, StreamStart, StreamStop};
use gnc_protocol::stream::ImuSample;
use gnc_protocol::wire::Wire;
use hw_mocks::devices::inertial::model::{PUBLISHED, Published};
use hw_mocks::devices::inertial::noise::{AxisNoise, NoiseSimulation, variance_of_means};
use hw_mocks::devices::inertial::{SensorFaults, SensorModels, Sensors, TriadModel};
use hw_mocks::world::{Influence, TrueSite, World, attitude};
use hw_mocks::{ModuleAxis, Sign};
use nalgebra::Vector3;

use crate::filtered;
use crate::host::Host;

const G: f64 = 9.80665;

/// Gravity by the international formula of 1980 and the free-air gradient. It differs from the world's formula and is
/// good to 1e-6 at such heights.
fn gravity_1980(latitude_deg: f64, height_m: f64) -> f64 {
    let latitude = latitude_deg.to_radians();
    let sea = 9.780_327 * (1.0 + 0.005_302_4 * latitude.sin().powi(2) - 0.000_005_8 * (2.0 * latitude).sin().powi(2));
    sea - 3.085e-6 * height_m
}

#[test]
fn gravity_agrees_with_the_international_formula() {
    for (latitude_deg, height_m) in [(0.0, 0.0), (34.2321, 412.0), (-52.0, 30.0), (90.0, 1000.0)] {
        let site = TrueSite { latitude_deg, height_m, ..TrueSite::default() };
        assert!((site.gravity() / gravity_1980(latitude_deg, height_m) - 1.0).abs() < 2e-6);
    }
}

/// With Z up and X at a heading clockwise from north: earth rate is 15.041 deg/h cos(lat) along north, sin(lat) up; the
/// field's north component shows on X as cos(heading).
#[test]
fn attitude_resolves_earth_rate_gravity_and_field() {
    let mut world = World::new(TrueSite::default(), std::time::Duration::from_secs(1_795_329_015), 23.0);
    let latitude = world.site.latitude_deg.to_radians();
    let (north_dph, up_dph) = (15.041_07 * latitude.cos(), 15.041_07 * latitude.sin());
    for heading_deg in [0.0, 90.0, 200.0] {
        world.set_heading_deg(heading_deg);
        let seen = world.influence(0.0);
        let heading = f64::to_radians(heading_deg);
        let rate_dph = seen.rate_rps.map(f64::to_degrees) * 3600.0;
        // Y is 90 deg to the left of X when Z is up.
        let expected = Vector3::new(north_dph * heading.cos(), north_dph * heading.sin(), up_dph);
        assert!((rate_dph - expected).norm() < 1e-3, "{heading_deg}: {rate_dph} {expected}");
        assert!((seen.force - Vector3::new(0.0, 0.0, world.site.gravity())).norm() < 1e-9);
        let [north, east, down] = world.site.field_ned_gauss;
        let x = north * heading.cos() + east * heading.sin();
        let y = north * heading.sin() - east * heading.cos();
        assert!((seen.field_gauss - Vector3::new(x, y, -down)).norm() < 1e-12);
    }
    for axis in ModuleAxis::ALL {
        for sign in [Sign::Plus, Sign::Minus] {
            let rotation = attitude(axis, sign, 77.0);
            let matrix = rotation.matrix();
            assert!((matrix.determinant() - 1.0).abs() < 1e-12 && (matrix * matrix.transpose()).trace() - 3.0 < 1e-12);
            let up = rotation * Vector3::z();
            assert!((up[axis.index()] - sign.factor()).abs() < 1e-12);
        }
    }
}

#[test]
fn turning_right_handed_reads_positive_and_turns_the_field_back() {
    let mut world = World::new(TrueSite::default(), std::time::Duration::ZERO, 23.0);
    world.set_turn(ModuleAxis::Z, 30.0, 1.0);
    let seen = world.influence(4.0);
    assert!((seen.rate_rps.z.to_degrees() - 30.0).abs() < 0.01);
    // After 3 s at 30 deg/s X points west: the north field is on -Y.
    let [north, east, _] = world.site.field_ned_gauss;
    assert!((seen.field_gauss - Vector3::new(-east, -north, seen.field_gauss.z)).norm() < 1e-9, "{}", seen.field_gauss);
}

/// Samples of the raw stream.
pub(crate) fn imu(host: &mut Host, rate_hz: u16, count: u32) -> Vec<ImuSample> {
    host.frames.clear();
    host.ask(&StreamStart { stream: 1, rate_hz, count, samples_per_frame: 0 });
    let mut samples = Vec::new();
    loop {
        // Some samples may have come with the answer.
        samples.clear();
        for frame in host.streamed(1) {
            assert_eq!((frame.head.first as usize, frame.head.dropped), (samples.len(), 0));
            samples.extend(frame.samples.chunks(40).map(|bytes| ImuSample::from_payload(bytes).unwrap()));
        }
        if samples.len() >= count as usize {
            break;
        }
        host.run_until(|frame| frame.header.kind == gnc_protocol::Kind::Stream);
    }
    let stopped = host.ask(&StreamStop { stream: 1 });
    assert_eq!((stopped.produced, stopped.dropped), (count, 0));
    samples
}

fn mean_and_deviation(samples: &[ImuSample], pick: impl Fn(&ImuSample) -> i32) -> (f64, f64) {
    let count = samples.len() as f64;
    let mean = samples.iter().map(|s| f64::from(pick(s))).sum::<f64>() / count;
    let variance = samples.iter().map(|s| (f64::from(pick(s)) - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean, variance.sqrt())
}

/// `N = M f + b` written out for the published conventions, with the model's numbers and the truth.
#[test]
fn sensors_at_rest_read_the_truth_within_their_noise() {
    let mut host = Host::powered("good");
    host.bench.set_axis_up(ModuleAxis::X, Sign::Minus);
    host.bench.set_heading_deg(123.0);
    let samples = imu(&mut host, 200, 4000);
    let truth = host.bench.truth();
    let force_g = truth.influence.force / G;
    let rate_dps = truth.influence.rate_rps.map(f64::to_degrees);
    assert!((force_g.x + gravity_1980(34.2321, 412.0) / G).abs() < 1e-5);
    for axis in 0..3 {
        let row =
            |matrix: &nalgebra::Matrix3<f64>, v: &Vector3<f64>| (0..3).map(|j| matrix[(axis, j)] * v[j]).sum::<f64>();
        let models = &truth.sensors;
        let gyro = row(&models.gyro.response, &rate_dps) + models.gyro.bias[axis] + row(&models.gyro_per_g, &force_g);
        let (mean, deviation) = mean_and_deviation(&samples, |s| s.gyro[axis]);
        // Bounds: five deviations of the slow bias (4 deg/h) and of the white noise's mean, and the temperature.
        assert!((mean / 20_000.0 - gyro).abs() < 5.0 * 0.0012 + 0.004, "gyro {axis}: {} {gyro}", mean / 20_000.0);
        // 9 deg/h sqrt(s), in means over 5 ms behind two poles at 80 Hz.
        let passed = filtered::variance(0.005, 80.0, 2).sqrt();
        assert!((deviation / 20_000.0 / (0.0025 * passed) - 1.0).abs() < 0.06, "gyro {axis}: {deviation}");
        let accel = row(&models.accel.response, &force_g) + models.accel.bias[axis];
        let (mean, deviation) = mean_and_deviation(&samples, |s| s.accel[axis]);
        assert!((mean / 160_000.0 - accel).abs() < 5.0 * 0.3e-3, "accel {axis}: {} {accel}", mean / 160_000.0);
        assert!((deviation / 160_000.0 / (0.1e-3 * passed) - 1.0).abs() < 0.06, "accel {axis}: {deviation}");
        let mag = row(&models.mag.response, &truth.influence.field_gauss) + models.mag.bias[axis];
        let (mean, deviation) = mean_and_deviation(&samples, |s| s.mag[axis]);
        // White noise 5, five deviations of the slow noise 15, 2 K at 10 microgauss/K, 20 s of the ambient field's
        // swing 8.
        let bound = 5e-6 + 15e-6 + 20e-6 + 8e-6;
        assert!((mean / 1.25e6 - mag).abs() < bound, "mag {axis}: {} {mag}", mean / 1.25e6);
        assert!((deviation / 1.25e6 / 60e-6 - 1.0).abs() < 0.06, "mag {axis}: {deviation}");
    }
    let temperature = f64::from(samples[0].gyro_temperature) / 100.0;
    assert!((23.0..24.5).contains(&temperature), "{temperature}");
}

/// White noise from first differences (Allan deviation at one sample), which drifts cannot raise. Without a bandwidth
/// it grows with the root of the rate; with one it follows the filter's closed form.
#[test]
fn white_noise_follows_the_density_at_every_rate() {
    let mut host = Host::powered("good");
    for (rate_hz, count) in [(50, 4000), (1000, 8000)] {
        let samples = imu(&mut host, rate_hz, count);
        let allan = |pick: fn(&ImuSample) -> i32| {
            let square = |pair: &[ImuSample]| f64::from(pick(&pair[1]) - pick(&pair[0])).powi(2);
            (samples.windows(2).map(square).sum::<f64>() / (2.0 * f64::from(count - 1))).sqrt()
        };
        let expected_gauss = 60e-6 * (f64::from(rate_hz) / 200.0).sqrt();
        let mag_gauss = allan(|sample| sample.mag[1]) / 1.25e6;
        assert!((mag_gauss / expected_gauss - 1.0).abs() < 0.05, "{rate_hz} Hz: {mag_gauss} {expected_gauss}");
        let expected_g = 0.1e-3 * filtered::allan_variance(1.0 / f64::from(rate_hz), 80.0, 2).sqrt();
        let accel_g = allan(|sample| sample.accel[1]) / 160_000.0;
        assert!((accel_g / expected_g - 1.0).abs() < 0.05, "{rate_hz} Hz: {accel_g} {expected_g}");
    }
}

fn still() -> Influence {
    Influence {
        rate_rps: Vector3::zeros(),
        force: Vector3::new(0.0, 0.0, G),
        field_gauss: Vector3::zeros(),
        temperature_c: 25.0,
    }
}

fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (values.len() as f64 - 1.0)).sqrt()
}

/// The mean over a span of the three gyros (deg/h) and accelerometers (mg), sampled at 20 Hz.
fn means(sensors: &mut Sensors, from_s: f64, span_s: f64) -> [f64; 6] {
    let count = (span_s * 20.0) as u32;
    let mut sums = [0.0; 6];
    for index in 1..=count {
        let sample = sensors.sample(&still(), from_s + f64::from(index) / 20.0, 20.0);
        for axis in 0..3 {
            sums[axis] += f64::from(sample.gyro[axis]) / 20_000.0 * 3600.0;
            sums[axis + 3] += f64::from(sample.accel[axis]) / 160_000.0 * 1000.0;
        }
    }
    sums.map(|sum| sum / f64::from(count))
}

/// Ten hours of 10 s means, each hour against the figure of its axis. 360 means scatter by 4 %, and a little more since
/// slow noise correlates neighbours; ten hours scatter by a third of that.
#[test]
fn an_hour_has_the_stated_bias_stability() {
    for (number, published) in (1..).zip(&PUBLISHED) {
        let mut squares = [0.0; 6];
        for hour in 0..10 {
            let mut sensors =
                Sensors::new(SensorModels::published(published), SensorFaults::default(), 100 * number + hour);
            let blocks: Vec<[f64; 6]> = (0..360).map(|k| means(&mut sensors, f64::from(k) * 10.0, 10.0)).collect();
            for (axis, sum) in squares.iter_mut().enumerate() {
                *sum += deviation(&blocks.iter().map(|block| block[axis]).collect::<Vec<_>>()).powi(2) / 10.0;
            }
        }
        let expected = published.0.stability.iter().chain(&published.1.stability);
        for (axis, (square, expected)) in squares.iter().zip(expected).enumerate() {
            let got = square.sqrt();
            assert!((got / expected - 1.0).abs() < 0.07, "module {number} axis {axis}: {got} {expected}");
        }
    }
}

/// Sixty power cycles of 10 min, every 20 min, in ten groups of six: an axis's estimate scatters by 14 %.
#[test]
fn power_cycles_have_the_stated_bias_repeatability() {
    for (number, published) in (1..).zip(&PUBLISHED) {
        let mut squares = [0.0; 6];
        for run in 0..10 {
            let mut sensors =
                Sensors::new(SensorModels::published(published), SensorFaults::default(), 100 * number + run);
            let mut cycles = Vec::new();
            for cycle in 0..6 {
                sensors.power_on(f64::from(cycle) * 1200.0);
                cycles.push(means(&mut sensors, f64::from(cycle) * 1200.0, 600.0));
            }
            for (axis, sum) in squares.iter_mut().enumerate() {
                *sum += deviation(&cycles.iter().map(|block| block[axis]).collect::<Vec<_>>()).powi(2) / 10.0;
            }
        }
        let expected = published.0.repeatability.iter().chain(&published.1.repeatability);
        for (axis, (square, expected)) in squares.iter().zip(expected).enumerate() {
            let got = square.sqrt();
            assert!((got / expected - 1.0).abs() < 0.5, "module {number} axis {axis}: {got} {expected}");
        }
    }
}

/// Root of the mean sample variance of a simulation, over many runs, in the sensors' unit.
fn simulated(model: &TriadModel, runs: u64, mut figure: impl FnMut(&mut NoiseSimulation) -> [f64; 3]) -> [f64; 3] {
    let mut squares = [0.0; 3];
    for seed in 0..runs {
        let variances = figure(&mut NoiseSimulation::new(model, seed));
        (0..3).for_each(|axis| squares[axis] += variances[axis] / runs as f64);
    }
    squares.map(f64::sqrt)
}

fn variances(means: &[Vector3<f64>]) -> [f64; 3] {
    [0, 1, 2].map(|axis| deviation(&means.iter().map(|mean| mean[axis]).collect::<Vec<_>>()).powi(2))
}

/// The simulation without frames gives all sixty figures of the five modules: 600 runs scatter by 0.2 and 1.3 %.
#[test]
fn the_bootstrap_has_all_sixty_figures() {
    const RUNS: u64 = 600;
    for (number, (gyro, accel)) in (1..).zip(&PUBLISHED) {
        let models = SensorModels::published(&(*gyro, *accel));
        for (model, published, unit) in [(models.gyro, gyro, 3600.0), (models.accel, accel, 1000.0)] {
            let stability =
                simulated(&model, RUNS, |run| variances(&(0..360).map(|_| run.mean(10.0)).collect::<Vec<_>>()));
            let repeatability = simulated(&model, RUNS, |run| {
                let cycle = |_| {
                    run.power_on();
                    let mean = run.mean(600.0);
                    run.pause(600.0);
                    mean
                };
                variances(&(0..6).map(cycle).collect::<Vec<_>>())
            });
            for axis in 0..3 {
                let (got, expected) = (stability[axis] * unit, published.stability[axis]);
                assert!((got / expected - 1.0).abs() < 0.01, "module {number} axis {axis}: {got} {expected}");
                let (got, expected) = (repeatability[axis] * unit, published.repeatability[axis]);
                assert!((got / expected - 1.0).abs() < 0.065, "module {number} axis {axis}: {got} {expected}");
            }
        }
    }
}

/// Every part of the noise exists in every axis: all five modules have more than white noise, and each figure can be
/// made from its parts.
#[test]
fn every_axis_has_every_kind_of_noise() {
    for (gyro, accel) in &PUBLISHED {
        let models = SensorModels::published(&(*gyro, *accel));
        for AxisNoise { white, slow, flicker, turn_on, .. } in models.gyro.noise.into_iter().chain(models.accel.noise) {
            assert!(white > 0.0 && slow > 0.0 && flicker > 0.0 && turn_on > 0.0, "{slow} {flicker} {turn_on}");
        }
    }
    let module = Published { stability: [1.0; 3], repeatability: [1.0; 3] };
    assert!(TriadModel::gyroscopes(&module).noise.iter().all(|noise| noise.slow == 0.0), "white noise alone is more");
}

/// The expectation of a sample variance, by brute force: the mean square of pairwise differences of exact covariances.
#[test]
fn variance_of_means_agrees_with_a_double_sum() {
    for (correlation_s, span_s, every_s, count) in
        [(15.0, 10.0, 10.0, 12), (100.0, 10.0, 25.0, 7), (30.0, 600.0, 1200.0, 6)]
    {
        // Means as sums over a grid that is fine against the correlation time.
        let grid = f64::max(span_s / correlation_s * 20.0, 20.0) as u32;
        let at =
            |mean: u32, point: u32| f64::from(mean) * every_s + (f64::from(point) + 0.5) * span_s / f64::from(grid);
        let covariance = |a: u32, b: u32| {
            let pair = |i, j| (-(at(a, i) - at(b, j)).abs() / correlation_s).exp();
            (0..grid).map(|i| (0..grid).map(|j| pair(i, j)).sum::<f64>()).sum::<f64>() / f64::from(grid * grid)
        };
        let mut sum = 0.0;
        for a in 0..count {
            for b in 0..a {
                sum += covariance(a, a) + covariance(b, b) - 2.0 * covariance(a, b);
            }
        }
        let n = f64::from(count);
        let (expected, got) = (sum / (n * (n - 1.0)), variance_of_means(correlation_s, span_s, every_s, count));
        assert!((got / expected - 1.0).abs() < 5e-3, "{correlation_s} {span_s}: {got} {expected}");
    }
}

/// Mean and end of a Gauss-Markov process are consistent: a 10 s mean drawn at once has the variance of ten 1 s means
/// drawn in a row, and so has the mean that follows.
#[test]
fn a_mean_is_the_mean_of_its_parts() {
    let model = TriadModel::gyroscopes(&PUBLISHED[0].0);
    let two = |parts: u32, runs: u64| {
        simulated(&model, runs, |run| {
            let mut mean = |span_s: f64| {
                (0..parts).map(|_| run.mean(span_s / f64::from(parts))).sum::<Vector3<f64>>() / f64::from(parts)
            };
            let (first, second) = (mean(10.0), mean(10.0));
            let difference: [f64; 3] = (second - first).into();
            difference.map(|value| value * value)
        })
    };
    let (whole, parts, samples) = (two(1, 20_000), two(10, 20_000), two(400, 2000));
    for axis in 0..3 {
        assert!((whole[axis] / parts[axis] - 1.0).abs() < 0.03, "{whole:?} {parts:?}");
        assert!((whole[axis] / samples[axis] - 1.0).abs() < 0.08, "{whole:?} {samples:?}");
    }
}

#[test]
fn codes_saturate_at_24_bits() {
    let mut sensors = Sensors::new(SensorModels::default(), SensorFaults::default(), 3);
    let fast = Influence { rate_rps: Vector3::new(10.0, -10.0, 0.0), ..still() };
    let sample = sensors.sample(&fast, 1.0, 200.0);
    assert_eq!((sample.gyro[0], sample.gyro[1]), (8_388_607, -8_388_608));
}

#[test]
fn the_seed_alone_decides_the_samples() {
    let take = |seed| {
        let mut sensors = Sensors::new(SensorModels::default(), SensorFaults::default(), seed);
        sensors.power_on(0.0);
        (1..50).map(|k| sensors.sample(&still(), f64::from(k) * 0.005, 200.0)).collect::<Vec<_>>()
    };
    assert_eq!(take(8), take(8));
    assert_ne!(take(8), take(9));
}

#[test]
fn faults_sit_in_the_axis_they_name() {
    let stuck = imu(&mut Host::powered("gyro-stuck"), 200, 100);
    assert!(stuck.iter().all(|s| s.gyro[0] == stuck[0].gyro[0]));
    assert!(stuck.iter().any(|s| s.gyro[1] != stuck[0].gyro[1]));
    let good = imu(&mut Host::powered("good"), 200, 100);
    assert_eq!(good.iter().map(|s| s.gyro[1]).collect::<Vec<_>>(), stuck.iter().map(|s| s.gyro[1]).collect::<Vec<_>>());
    let saturated = imu(&mut Host::powered("accel-saturated"), 200, 20);
    assert!(saturated.iter().all(|s| s.accel[2] == 8_388_607));
    let dead = imu(&mut Host::powered("gyro-dead"), 200, 20);
    assert!(dead.iter().all(|s| s.gyro[1] == 0));
}

/// 2.5 V at zero, 0.35 V per gauss at the sensor; converter errors below 1 mV.
#[test]
fn ad_reads_the_magnetometer_and_the_switches() {
    let mut host = Host::powered("good");
    host.bench.set_heading_deg(40.0);
    let truth = host.bench.truth();
    let seen = truth.sensors.mag.response * truth.influence.field_gauss + truth.sensors.mag.bias;
    let volts = |host: &mut Host| {
        let reply = host.ask(&AdRead { channels: 0xff, samples: 100 });
        assert_eq!(reply.channels.iter().map(|c| c.channel).collect::<Vec<_>>(), [1, 2, 3, 4, 5, 6, 7, 8]);
        reply.channels.iter().map(|c| f64::from(c.mean_uv) * 1e-6).collect::<Vec<_>>()
    };
    let off = volts(&mut host);
    for axis in 0..3 {
        assert!((off[axis] - 2.5 - 0.35 * seen[axis]).abs() < 1e-3);
    }
    assert!(off[3..].iter().all(|v| (v - 2.0).abs() < 0.04), "{off:?}");
    for (index, nominal_v) in [5.0, 3.3, 1.2, 0.0, 0.0].into_iter().enumerate() {
        host.bench.set_switch(index as u8 + 1, true);
        let on = volts(&mut host);
        assert!((on[index + 3] - nominal_v).abs() < 0.05, "switch {}: {on:?}", index + 1);
        host.bench.set_switch(index as u8 + 1, false);
        assert!((volts(&mut host)[index + 3] - 2.0).abs() < 0.04);
    }
    let mut unwired = Host::powered("dip-unwired");
    unwired.bench.set_switch(2, true);
    assert!((volts(&mut unwired)[4] - 2.0).abs() < 0.04);
    let mut low = Host::powered("rail-low");
    low.bench.set_switch(2, true);
    assert!((volts(&mut low)[4] - 2.9).abs() < 0.002);
}

/// An operator who forgets the second and third request leaves the switches as they were.
#[test]
fn an_operator_forgets_what_the_file_says() {
    let set = |numbers: &[usize]| std::array::from_fn(|index| numbers.contains(&(index + 1)));
    let mut host = Host::powered("[operator]\nswitches_on = [2, 5]\nforgets_from = 2\nforgets = 2\n");
    assert_eq!(host.bench.truth().switches, set(&[2, 5]));
    for (on, expected) in [(None, &[][..]), (Some(1), &[]), (Some(1), &[]), (Some(1), &[1]), (Some(4), &[4])] {
        host.bench.only_switch(on);
        assert_eq!(host.bench.truth().switches, set(expected), "{on:?}");
    }
    let mut careful = Host::powered("");
    careful.bench.only_switch(Some(3));
    assert_eq!(careful.bench.truth().switches, set(&[3]));
}
