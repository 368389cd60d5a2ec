//! Effects of real sensors beside their noise, each against its closed form or its probability law.
//!
//! Bounds are 4.5 standard errors unless stated otherwise.

use std::f64::consts::{PI, TAU};

use gnc_protocol::stream::ImuSample;
use hw_mocks::ModuleAxis;
use hw_mocks::devices::inertial::bandwidth::{Bandwidth, FilterOrder};
use hw_mocks::devices::inertial::faults::{FailedReads, Spikes, Vibration};
use hw_mocks::devices::inertial::noise::AxisNoise;
use hw_mocks::devices::inertial::{SensorFaults, SensorModels, Sensors, TriadFaults};
use hw_mocks::world::Influence;
use nalgebra::{Matrix3, Vector3};

use crate::filtered;
use crate::host::Host;
use crate::sensors::imu;

const DPS: f64 = 20_000.0;
const G: f64 = 160_000.0;
const GAUSS: f64 = 1.25e6;
/// White noise, deg/s sqrt(s): a thousand codes at 200 Hz, so that rounding is negligible.
const WHITE: f64 = 0.004;

const FIRST: Bandwidth = Bandwidth { cutoff_hz: 25.0, order: FilterOrder::First };
const SECOND: Bandwidth = Bandwidth { cutoff_hz: 80.0, order: FilterOrder::Second };

fn order(bandwidth: Bandwidth) -> i32 {
    if bandwidth.order == FilterOrder::First { 1 } else { 2 }
}

/// Perfect sensors; the gyroscopes have white noise and a bandwidth, if any.
fn models(white: f64, bandwidth: Option<Bandwidth>) -> SensorModels {
    let mut models = SensorModels::default();
    for triad in [&mut models.gyro, &mut models.accel, &mut models.mag] {
        triad.noise = Default::default();
        triad.response = Matrix3::identity();
        triad.bias = Vector3::zeros();
        triad.bandwidth = bandwidth;
    }
    models.gyro.noise = [AxisNoise { white, ..AxisNoise::default() }; 3];
    models.gyro_per_g = Matrix3::zeros();
    models.gyro.bias_per_k = 0.0;
    models
}

fn still() -> Influence {
    Influence {
        rate_rps: Vector3::zeros(),
        force: Vector3::new(0.0, 0.0, 9.80665),
        field_gauss: Vector3::new(0.3, 0.1, -0.4),
        temperature_c: 25.0,
    }
}

fn samples(models: SensorModels, faults: SensorFaults, rate_hz: f64, count: u32) -> Vec<ImuSample> {
    let mut sensors = Sensors::new(models, faults, 11);
    sensors.power_on(0.0);
    let mut reader = sensors.reader(rate_hz);
    (1..=count).map(|k| sensors.read(&mut reader, |_| still(), f64::from(k) / rate_hz)).collect()
}

fn gyro_faults(gyro: TriadFaults) -> SensorFaults {
    SensorFaults { gyro, ..SensorFaults::default() }
}

fn rates(samples: &[ImuSample], axis: usize) -> Vec<f64> {
    samples.iter().map(|sample| f64::from(sample.gyro[axis]) / DPS).collect()
}

/// Amplitude of a sinusoid with a whole number of periods in the samples.
fn amplitude(values: &[f64], frequency: f64) -> f64 {
    let (mut cosine, mut sine) = (0.0, 0.0);
    for (index, value) in values.iter().enumerate() {
        let (sin, cos) = (TAU * frequency * index as f64).sin_cos();
        (cosine, sine) = (cosine + value * cos, sine + value * sin);
    }
    2.0 * f64::hypot(cosine, sine) / values.len() as f64
}

/// Mean square, and mean product of neighbours.
fn covariances(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let square = values.iter().map(|v| v * v).sum::<f64>() / n;
    (square, values.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / (n - 1.0))
}

/// A count against its binomial law.
fn assert_share(count: usize, of: usize, share: f64, what: &str) {
    let (n, expected) = (of as f64, of as f64 * share);
    let bound = 4.5 * (n * share * (1.0 - share)).sqrt();
    assert!((count as f64 - expected).abs() < bound, "{what}: {count} of {of}, expected {expected} +- {bound}");
}

/// One event in each run of this many turns, at any place in the run: 1,600 places have the mean and the deviation of a
/// uniform distribution.
fn assert_one_in_each(run: usize, events: &[bool], what: &str) {
    let places: Vec<f64> = events
        .chunks_exact(run)
        .map(|turns| {
            assert_eq!(turns.iter().filter(|event| **event).count(), 1, "{what}");
            turns.iter().position(|event| *event).unwrap() as f64 / run as f64
        })
        .collect();
    let (n, mean) = (places.len() as f64, places.iter().sum::<f64>() / places.len() as f64);
    let square = places.iter().map(|place| (place - mean).powi(2)).sum::<f64>() / n;
    assert!((mean - 0.5).abs() < 4.5 / (12.0 * n).sqrt() + 1.0 / run as f64, "{what}: {mean}");
    assert!((square - 1.0 / 12.0).abs() < 4.5 * (1.0 / 180.0 / n).sqrt() + 1.0 / run as f64, "{what}: {square}");
}

/// Both orders at both rates: 600 windowed pieces of three axes scatter by 2.4 %, and the window's width adds 1 %.
#[test]
fn the_spectrum_is_that_of_the_filter() {
    const PIECE: usize = 200;
    for bandwidth in [FIRST, SECOND] {
        for rate_hz in [200.0, 1000.0] {
            let samples = samples(models(WHITE, Some(bandwidth)), SensorFaults::default(), rate_hz, 120_000);
            let values = [0, 1, 2].map(|axis| rates(&samples, axis));
            for relative in [0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.47] {
                let (mut sum, mut count) = (0.0, 0.0);
                for piece in values.iter().flat_map(|axis| axis.chunks_exact(PIECE)) {
                    let (mut cosine, mut sine, mut window_square) = (0.0, 0.0, 0.0);
                    for (index, value) in piece.iter().enumerate() {
                        let window = (PI * (index as f64 + 0.5) / PIECE as f64).sin().powi(2);
                        let (sin, cos) = (TAU * relative * index as f64).sin_cos();
                        cosine += value * window * cos;
                        sine += value * window * sin;
                        window_square += window * window;
                    }
                    sum += (cosine * cosine + sine * sine) / window_square / rate_hz;
                    count += 1.0;
                }
                let got = sum / count / (WHITE * WHITE);
                let expected =
                    filtered::density(relative * rate_hz, 1.0 / rate_hz, bandwidth.cutoff_hz, order(bandwidth));
                assert!((got / expected - 1.0).abs() < 0.12, "{bandwidth:?} {rate_hz} {relative}: {got} {expected}");
            }
        }
    }
}

/// The mean of five samples at 1 kHz equals one sample at 200 Hz: variance and covariance of neighbours by integrals
/// over the filter's gain. 30,000 samples of three axes scatter by 0.5 %, the means of five by 1 %.
#[test]
fn a_mean_of_fast_samples_is_a_slow_one() {
    for bandwidth in [FIRST, SECOND] {
        let (cutoff_hz, order) = (bandwidth.cutoff_hz, order(bandwidth));
        let variance = filtered::variance(0.005, cutoff_hz, order);
        let neighbours = variance - filtered::allan_variance(0.005, cutoff_hz, order);
        for (rate_hz, of) in [(200.0, 1), (1000.0, 5)] {
            let samples = samples(models(WHITE, Some(bandwidth)), SensorFaults::default(), rate_hz, 30_000 * of as u32);
            let (mut square, mut product) = (0.0, 0.0);
            for axis in 0..3 {
                let mean = |part: &[f64]| part.iter().sum::<f64>() / of as f64;
                let means: Vec<f64> = rates(&samples, axis).chunks(of).map(mean).collect();
                let (one, other) = covariances(&means);
                (square, product) = (square + one / 3.0, product + other / 3.0);
            }
            let (square, product) = (square / (WHITE * WHITE), product / (WHITE * WHITE));
            assert!((square / variance - 1.0).abs() < 0.03, "{bandwidth:?} {rate_hz}: {square} {variance}");
            assert!((product - neighbours).abs() < 0.03 * variance, "{bandwidth:?} {rate_hz}: {product} {neighbours}");
        }
    }
}

/// The first sample of a stream is as noisy as any: 2,000 streams of three axes scatter by 1.8 %.
#[test]
fn a_stream_begins_with_the_noise_that_it_goes_on_with() {
    let mut sensors = Sensors::new(models(WHITE, Some(SECOND)), SensorFaults::default(), 3);
    let mut square = [0.0; 3];
    for stream in 0..2000 {
        let mut reader = sensors.reader(1000.0);
        for (index, sum) in square.iter_mut().enumerate() {
            let sample = sensors.read(&mut reader, |_| still(), f64::from(stream) + (1 + index) as f64 / 1000.0);
            *sum += sample.gyro.iter().map(|code| (f64::from(*code) / DPS / WHITE).powi(2)).sum::<f64>() / 6000.0;
        }
    }
    let expected = filtered::variance(0.001, 80.0, 2);
    for got in square {
        assert!((got / expected - 1.0).abs() < 0.085, "{got} {expected}");
    }
}

/// A turn that oscillates at 10 Hz, behind a 20 Hz filter: the gain, and the zero crossings. Between samples at 1 kHz a
/// sinusoid is a straight line to 2e-4.
#[test]
fn motion_passes_the_filter() {
    for order in [FilterOrder::First, FilterOrder::Second] {
        let bandwidth = Bandwidth { cutoff_hz: 20.0, order };
        let mut sensors = Sensors::new(models(0.0, Some(bandwidth)), SensorFaults::default(), 1);
        let mut reader = sensors.reader(1000.0);
        let swing = |now_s: f64| Influence {
            rate_rps: Vector3::new((30.0 * (TAU * 10.0 * now_s).sin()).to_radians(), 0.0, 0.0),
            ..still()
        };
        let (ratio, power) = (0.5_f64, if order == FilterOrder::First { 1 } else { 2 });
        let gain = filtered::power(10.0, 20.0, power).sqrt();
        let phase = if power == 1 { ratio.atan() } else { (2.0_f64.sqrt() * ratio / (1.0 - ratio * ratio)).atan() };
        for index in 1..=3000 {
            let now_s = f64::from(index) / 1000.0;
            let got = f64::from(sensors.read(&mut reader, swing, now_s).gyro[0]) / DPS;
            // The mean over the last millisecond is the value at its middle.
            let expected = 30.0 * gain * (TAU * 10.0 * (now_s - 0.0005) - phase).sin();
            assert!(now_s < 1.0 || (got - expected).abs() < 0.03, "{order:?} {now_s}: {got} {expected}");
        }
    }
}

/// From rest to rest the samples sum to the whole angle, whatever the delay: 90 deg in a second, half a second in all.
#[test]
fn a_turn_from_rest_to_rest_keeps_its_angle() {
    let mut sensors = Sensors::new(models(0.0, Some(SECOND)), SensorFaults::default(), 1);
    for rate_hz in [200.0, 1000.0] {
        let mut reader = sensors.reader(rate_hz);
        let turn = |now_s: f64| {
            let rate_dps = (180.0 - 360.0 * (now_s - 1.0).abs()).max(0.0);
            Influence { rate_rps: Vector3::new(0.0, rate_dps.to_radians(), 0.0), ..still() }
        };
        let read = |k: u32| f64::from(sensors.read(&mut reader, turn, f64::from(k) / rate_hz).gyro[1]) / DPS;
        let angle_deg = (1..=(2.0 * rate_hz) as u32).map(read).sum::<f64>() / rate_hz;
        assert!((angle_deg - 90.0).abs() < 1e-4, "{rate_hz}: {angle_deg}");
    }
}

/// 87 Hz has a whole number of periods in two seconds. A gyroscope with an 80 Hz filter averages it over its interval;
/// a magnetometer without a filter shows it unchanged.
#[test]
fn vibration_has_its_amplitude_behind_the_filter() {
    let shaken = Vibration {
        frequency_hz: 87.0,
        rate_dps: Vector3::new(0.5, 0.0, 0.0),
        force_g: Vector3::new(0.0, 0.02, 0.0),
        field_gauss: Vector3::new(0.0, 0.0, 0.01),
    };
    for rate_hz in [200.0, 1000.0] {
        let mut models = models(0.0, Some(SECOND));
        models.mag.bandwidth = None;
        // The accelerations act on the gyroscopes too.
        models.gyro_per_g[(2, 1)] = 0.1;
        let mut faults = SensorFaults::default();
        faults.vibrations[1] = shaken;
        let samples = samples(models, faults, rate_hz, (2.0 * rate_hz) as u32);
        let of = |pick: &dyn Fn(&ImuSample) -> f64| {
            amplitude(&samples.iter().map(pick).collect::<Vec<_>>(), shaken.frequency_hz / rate_hz)
        };
        let passed = (filtered::power(87.0, 80.0, 2) * filtered::power_of_mean(87.0, 1.0 / rate_hz)).sqrt();
        for (got, expected, unit) in [
            (of(&|sample| f64::from(sample.gyro[0]) / DPS), 0.5 * passed, DPS),
            (of(&|sample| f64::from(sample.gyro[2]) / DPS), 0.1 * 0.02 * passed, DPS),
            (of(&|sample| f64::from(sample.accel[1]) / G), 0.02 * passed, G),
            (of(&|sample| f64::from(sample.mag[2]) / GAUSS), 0.01, GAUSS),
            (of(&|sample| f64::from(sample.gyro[1]) / DPS), 0.0, DPS),
        ] {
            // Rounding changes a code by at most one.
            assert!((got - expected).abs() < 1.0 / unit, "{rate_hz}: {got} {expected}");
        }
    }
}

/// Vibration is computed in closed form, motion step by step: the same sinusoid must give the same signal, in amplitude
/// and phase. At 5 kHz a sinusoid of 43 Hz is straight between samples to 3e-4.
#[test]
fn vibration_passes_the_filter_as_motion_does() {
    for bandwidth in [FIRST, SECOND] {
        let mut faults = SensorFaults::default();
        faults.vibrations[0] =
            Vibration { frequency_hz: 43.0, rate_dps: Vector3::new(30.0, 0.0, 0.0), ..Vibration::default() };
        let mut shaken = Sensors::new(models(0.0, Some(bandwidth)), faults, 1);
        let mut moved = Sensors::new(models(0.0, Some(bandwidth)), SensorFaults::default(), 1);
        let (mut of_shaken, mut of_moved) = (shaken.reader(5000.0), moved.reader(5000.0));
        let swing = |now_s: f64| Influence {
            rate_rps: Vector3::new((30.0 * (TAU * 43.0 * now_s).sin()).to_radians(), 0.0, 0.0),
            ..still()
        };
        for index in 1..=5000 {
            let now_s = f64::from(index) / 5000.0;
            let one = f64::from(shaken.read(&mut of_shaken, |_| still(), now_s).gyro[0]) / DPS;
            let other = f64::from(moved.read(&mut of_moved, swing, now_s).gyro[0]) / DPS;
            assert!(now_s < 0.5 || (one - other).abs() < 0.015, "{bandwidth:?} {now_s}: {one} {other}");
        }
    }
}

/// At 50 conversions a second a stream of 200 Hz finds each conversion four times, and its noise is that of means over
/// 20 ms. The accelerometers are a separate chip and are read anew each time.
#[test]
fn a_slow_chip_gives_its_last_conversion_again() {
    let mut models = models(WHITE, None);
    models.gyro.update_rate_hz = Some(50.0);
    models.accel.noise = [AxisNoise { white: 1e-3, ..AxisNoise::default() }; 3];
    let samples = samples(models, SensorFaults::default(), 200.0, 8003);
    // The first three reads find the conversion at time zero.
    let conversions: Vec<&[ImuSample]> = samples[3..].chunks(4).collect();
    assert!(conversions.iter().all(|held| held.iter().all(|sample| sample.gyro == held[0].gyro)));
    let repeated = conversions.windows(2).filter(|pair| pair[0][0].gyro == pair[1][0].gyro).count();
    assert_eq!(repeated, 0, "three axes of a thousand codes each do not come twice");
    assert!(samples.windows(2).all(|pair| pair[0].accel != pair[1].accel));
    let values: Vec<f64> = conversions.iter().map(|held| f64::from(held[0].gyro[0]) / DPS).collect();
    let expected = WHITE * 50.0_f64.sqrt();
    let got = covariances(&values).0.sqrt();
    assert!((got / expected - 1.0).abs() < 4.5 / (2.0 * 2000.0_f64).sqrt(), "{got} {expected}");
}

/// A held conversion shows what acted when it took place, not what acts when it is read.
#[test]
fn a_held_conversion_is_of_its_own_moment() {
    let mut models = models(0.0, None);
    models.gyro.update_rate_hz = Some(64.0);
    let mut sensors = Sensors::new(models, SensorFaults::default(), 1);
    let mut reader = sensors.reader(1000.0);
    let ramp = |now_s: f64| Influence { rate_rps: Vector3::new((10.0 * now_s).to_radians(), 0.0, 0.0), ..still() };
    for index in 1..=2000 {
        let now_s = f64::from(index) / 1000.0;
        let got = f64::from(sensors.read(&mut reader, ramp, now_s).gyro[0]) / DPS;
        let expected = 10.0 * (now_s * 64.0).floor() / 64.0;
        assert!((got - expected).abs() < 1.0 / DPS, "{now_s}: {got} {expected}");
    }
}

#[test]
fn a_failed_read_is_of_a_whole_chip_or_of_all() {
    const READS: usize = 51_200;
    for code in FailedReads::CODES {
        let failed = Some(FailedReads { share: 1.0 / 32.0, code });
        let quiet = models(WHITE, None);
        let of_chip = gyro_faults(TriadFaults { failed_reads: failed, ..TriadFaults::default() });
        let read = samples(quiet, of_chip, 200.0, READS as u32);
        assert_one_in_each(32, &read.iter().map(|sample| sample.gyro == [code; 3]).collect::<Vec<_>>(), "one chip");
        let good = samples(quiet, SensorFaults::default(), 200.0, READS as u32);
        for (bad, good) in read.iter().zip(&good) {
            assert_eq!((bad.accel, bad.mag, bad.gyro_temperature), (good.accel, good.mag, good.gyro_temperature));
            assert!(bad.gyro == good.gyro || bad.gyro == [code; 3], "all other reads are as they were");
        }
        let of_bus = SensorFaults { failed_reads: failed, ..SensorFaults::default() };
        let read = samples(quiet, of_bus, 200.0, READS as u32);
        let all = |sample: &&ImuSample| [sample.gyro, sample.accel, sample.mag] == [[code; 3]; 3];
        let none =
            |sample: &&ImuSample| sample.gyro != [code; 3] && sample.accel != [code; 3] && sample.mag != [code; 3];
        assert_eq!(read.iter().filter(all).count() + read.iter().filter(none).count(), READS);
        assert_one_in_each(32, &read.iter().map(|sample| all(&sample)).collect::<Vec<_>>(), "the bus");
    }
}

/// Runs need not be a whole number of turns: 3 % of 100,000 reads are 3,000 runs. If the last turn of one run is the
/// first of the next, both events may fall on it, which happens once in a few thousand.
#[test]
fn any_share_is_kept() {
    let failed_reads = Some(FailedReads { share: 0.03, code: -1 });
    let faults = SensorFaults { failed_reads, ..SensorFaults::default() };
    let read = samples(models(WHITE, None), faults, 200.0, 100_000);
    let count = read.iter().filter(|sample| sample.gyro == [-1; 3]).count();
    assert!((2992..=3001).contains(&count), "{count}");
}

#[test]
fn spikes_have_their_share_size_and_axis() {
    const COUNT: usize = 51_200;
    let upset = |axis| {
        let spikes = Some(Spikes { share: 1.0 / 64.0, size: 50.0, axis });
        let faults = gyro_faults(TriadFaults { spikes, ..TriadFaults::default() });
        let read = samples(models(WHITE, None), faults, 200.0, COUNT as u32);
        let is_spike =
            |sample: &ImuSample, axis: usize, sign: f64| (f64::from(sample.gyro[axis]) / DPS - sign * 50.0).abs() < 1.0;
        let any = |sample: &ImuSample| (0..3).any(|axis| is_spike(sample, axis, 1.0) || is_spike(sample, axis, -1.0));
        assert_one_in_each(64, &read.iter().map(any).collect::<Vec<_>>(), "spikes");
        let spikes = |axis, sign| read.iter().filter(|sample| is_spike(sample, axis, sign)).count();
        [0, 1, 2].map(|axis| [spikes(axis, 1.0), spikes(axis, -1.0)])
    };
    let y = upset(Some(ModuleAxis::Y));
    assert_eq!((y[0], y[2]), ([0, 0], [0, 0]));
    assert_eq!(y[1][0] + y[1][1], COUNT / 64);
    assert_share(y[1][0], COUNT / 64, 0.5, "up");
    for count in upset(None).into_iter().flatten() {
        assert_share(count, COUNT / 64, 1.0 / 6.0, "any axis");
    }
}

/// A converter that ends half a deviation above the mean: 30.85 % of a normal distribution lie beyond, all at one code.
#[test]
fn clipping_on_one_side_takes_what_lies_beyond() {
    const COUNT: usize = 40_000;
    let sigma = WHITE * 200.0_f64.sqrt();
    let high = Vector3::new(f64::INFINITY, 0.5 * sigma, f64::INFINITY);
    let faults = gyro_faults(TriadFaults { clip_high: high, ..TriadFaults::default() });
    let read = samples(models(WHITE, None), faults, 200.0, COUNT as u32);
    let good = samples(models(WHITE, None), SensorFaults::default(), 200.0, COUNT as u32);
    let end = (0.5 * sigma * DPS).round() as i32;
    for (read, good) in read.iter().zip(&good) {
        assert_eq!((read.gyro[0], read.gyro[1], read.gyro[2]), (good.gyro[0], good.gyro[1].min(end), good.gyro[2]));
    }
    assert_share(read.iter().filter(|sample| sample.gyro[1] == end).count(), COUNT, 0.3085, "clipped");
    let low = Vector3::new(0.0, -0.5 * sigma, 0.0);
    let low = TriadFaults { clip_low: low, ..TriadFaults::default() };
    let read = samples(models(WHITE, None), gyro_faults(low), 200.0, COUNT as u32);
    assert_share(read.iter().filter(|sample| sample.gyro[1] == -end).count(), COUNT, 0.3085, "clipped below");
}

/// Two per cent a kelvin give 49.2 % in twenty kelvin on X; 10,000 samples scatter by 0.7 %.
#[test]
fn noise_grows_with_the_temperature() {
    let mut models = models(WHITE, None);
    models.gyro.noise_per_k = Vector3::new(0.02, 0.0, -0.02);
    let deviations = |temperature_c: f64| {
        let mut sensors = Sensors::new(models, SensorFaults::default(), 4);
        let influence = Influence { temperature_c, ..still() };
        let samples: Vec<ImuSample> =
            (1..=10_000).map(|index| sensors.sample(&influence, f64::from(index) / 200.0, 200.0)).collect();
        [0, 1, 2].map(|axis| covariances(&rates(&samples, axis)).0.sqrt() / (WHITE * 200.0_f64.sqrt()))
    };
    for (temperature_c, expected) in
        [(25.0, [1.0; 3]), (45.0, [1.491_825, 1.0, 0.670_320]), (5.0, [0.670_320, 1.0, 1.491_825])]
    {
        for (got, expected) in deviations(temperature_c).into_iter().zip(expected) {
            assert!((got / expected - 1.0).abs() < 0.032, "{temperature_c}: {got} {expected}");
        }
    }
}

/// The stream of a board shows its stated faults: of 400 samples at 200 Hz, 12 for 3 %, one or two for 0.25 %.
#[test]
fn boards_of_real_sensors_stream_what_they_state() {
    let stream = |name: &str| imu(&mut Host::powered(name), 200, 400);
    let count = |name: &str, of: &dyn Fn(&ImuSample) -> bool| stream(name).iter().filter(|sample| of(sample)).count();
    let all = |sample: &ImuSample, code| [sample.gyro, sample.accel, sample.mag] == [[code; 3]; 3];
    assert!((11..=13).contains(&count("failed-reads", &|sample| sample.gyro == [0; 3] && !all(sample, 0))));
    assert!((1..=2).contains(&count("failed-reads-few", &|sample| all(sample, -1))));
    assert!((11..=13).contains(&count("mag-failed-reads", &|sample| sample.mag == [8_388_607; 3])));
    let far = |sample: &ImuSample, axis: usize| {
        (f64::from(sample.accel[axis]) / G - if axis == 2 { 1.0 } else { 0.0 }).abs() > 0.2
    };
    assert!((11..=13).contains(&count("accel-spikes", &|sample| (0..3).any(|axis| far(sample, axis)))));
    assert!((1..=2).contains(&count("accel-spikes-few", &|sample| far(sample, 1))));
    assert_eq!(count("accel-clips", &|sample| sample.accel[2] == 158_400), 400);
    assert_eq!(count("accel-clips-beyond", &|sample| sample.accel[2] >= 164_800), 0);
    for (name, stale) in [("gyro-updates-at-50-hz", 299..=300), ("gyro-updates-at-500-hz", 0..=0), ("good", 0..=0)] {
        let held = stream(name).windows(2).filter(|pair| pair[0].gyro == pair[1].gyro).count();
        assert!(stale.contains(&held), "{name}: {held}");
    }
    // 43 Hz has 86 periods in two seconds; noise changes an amplitude by 0.002 deg/s and 0.08 mg.
    let shaken = stream("vibration");
    let passed = (filtered::power(43.0, 80.0, 2) * filtered::power_of_mean(43.0, 0.005)).sqrt();
    let rate_dps = amplitude(&rates(&shaken, 0), 43.0 / 200.0);
    assert!((rate_dps - 0.02 * passed).abs() < 0.009, "{rate_dps}");
    let force_g =
        amplitude(&shaken.iter().map(|sample| f64::from(sample.accel[1]) / G).collect::<Vec<_>>(), 43.0 / 200.0);
    assert!((force_g - 0.002 * passed).abs() < 0.4e-3, "{force_g}");
}
