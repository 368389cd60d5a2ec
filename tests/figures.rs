//! The sixty figures of stability and repeatability: five modules of the published table, six axes. Each is compared
//! with a parametric bootstrap of the simulated module's true noise. Samples come from the sensors alone, without
//! frames.

use gnc_analysis::capture::{Capture, CaptureHead, Pose, ReceiverCapture, Timing};
use gnc_analysis::figures::{AnalysisInput, Findings, analyse};
use gnc_executive::catalogue::ItemId;
use gnc_executive::details::Details;
use gnc_executive::measurement::Value;
use gnc_executive::plan::{Params, Plan};
use gnc_executive::quantity::Unit;
use gnc_protocol::stream::Losses;
use hw_mocks::devices::inertial::model::{PUBLISHED, Published};
use hw_mocks::devices::inertial::noise::{AxisNoise, FLICKER_S};
use hw_mocks::devices::inertial::{SensorFaults, SensorModels, Sensors, TriadModel};
use hw_mocks::world::Influence;
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A sample stands for the mean over its interval, so a slow stream shows ten seconds as well as a fast one.
const RATE_HZ: u16 = 10;
const SEED: u64 = 2_022;
const GRAVITY: f64 = 9.7954;

const PLAN: &str = r#"
name = "sixty"
version = "1"
[[item]]
id = "six-position"
phase = "setup"
[[item]]
id = "rotation"
phase = "setup"
[[item]]
id = "gyro-still"
phase = "setup"
[[item]]
id = "bias-stability"
phase = "setup"
params = { rate = "10 Hz" }
[[item]]
id = "bias-repeatability"
phase = "setup"
params = { rate = "10 Hz", dwell = "600 s" }
"#;

/// A calibration with scale factors only: a constant does not affect either figure.
fn calibrated() -> Vec<(String, Findings)> {
    let rows = |value: f64| serde_json::json!([[value, 0.0, 0.0], [0.0, value, 0.0], [0.0, 0.0, value]]);
    let rps = 20_000.0 * 180.0 / std::f64::consts::PI;
    let details = serde_json::json!({ "calibration": {
        "accel": { "matrix": rows(9.80665 / 160_000.0), "offset": [0.0, 0.0, 0.0] },
        "gyro_still": { "bias": [0.0, 0.0, 0.0], "per_force": rows(0.0) },
        "gyro_scale": { "response": rows(rps), "matrix": rows(1.0 / rps) },
    } });
    vec![("calibration".to_owned(), Details::from(details).into())]
}

/// A module at rest with Z up. Its response is perfect here, so that the noise is that of the model.
struct Module {
    models: SensorModels,
    sensors: Sensors,
    now_s: f64,
}

impl Module {
    fn new((gyro, accel): &(Published, Published), seed: u64) -> Self {
        let mut models = SensorModels {
            gyro: TriadModel::gyroscopes(gyro),
            accel: TriadModel::accelerometers(accel),
            gyro_per_g: Matrix3::zeros(),
            ..SensorModels::default()
        };
        models.gyro.response = Matrix3::identity();
        models.accel.response = Matrix3::identity();
        let mut sensors = Sensors::new(models, SensorFaults::default(), seed);
        sensors.power_on(0.0);
        Self { models, sensors, now_s: 0.0 }
    }

    fn capture(&mut self, label: &str, series: u32, span_s: f64) -> Capture {
        let influence = Influence {
            rate_rps: Vector3::zeros(),
            force: Vector3::new(0.0, 0.0, GRAVITY),
            field_gauss: Vector3::zeros(),
            temperature_c: 25.0,
        };
        let n = (span_s * f64::from(RATE_HZ)) as usize;
        let samples: Vec<_> = (0..n)
            .map(|_| {
                self.now_s += 1.0 / f64::from(RATE_HZ);
                self.sensors.sample(&influence, self.now_s, f64::from(RATE_HZ))
            })
            .collect();
        let pose = Pose::Still { up: [0.0, 0.0, 1.0], heading_deg: 0.0 };
        Capture {
            about: CaptureHead { label: label.to_owned(), series, pose, rate_hz: RATE_HZ },
            first_us: 0,
            compensated: Vec::new(),
            losses: Losses { received: samples.len() as u32, ..Losses::default() },
            timing: Timing::even(RATE_HZ, 0, samples.len()),
            samples,
            receiver: ReceiverCapture::default(),
        }
    }
}

/// Standard normal numbers.
struct Dice(ChaCha8Rng);

impl Dice {
    fn normal(&mut self) -> f64 {
        let (one, other): (f64, f64) = (self.0.random(), self.0.random());
        (-2.0 * (1.0 - one).ln()).sqrt() * (std::f64::consts::TAU * other).cos()
    }
}

/// Exact means of a Gauss-Markov bias over neighbouring blocks: mean and end of a block are jointly normal given its
/// start.
struct Blocks {
    decay: f64,
    /// Mean for a start of 1, deviation of the end, mean per deviation of the end, residual deviation of the mean.
    pull: f64,
    end: f64,
    shared: f64,
    own: f64,
}

impl Blocks {
    fn new(span_s: f64, correlation_s: f64) -> Self {
        let x = span_s / correlation_s;
        let decay = (-x).exp();
        let end = (1.0 - decay * decay).sqrt();
        // Integrals of e^-t, of the covariance of mean and end, and of the mean's variance, given the start.
        let pull = (1.0 - decay) / x;
        let together = (1.0 - decay).powi(2) / x;
        let mean = (2.0 * x - 3.0 + 4.0 * decay - decay * decay) / (x * x);
        let shared = together / end;
        Self { decay, pull, end, shared, own: (mean - shared * shared).max(0.0).sqrt() }
    }

    fn next(&self, value: &mut f64, dice: &mut Dice) -> f64 {
        let (one, other) = (dice.normal(), dice.normal());
        let mean = self.pull * *value + self.shared * one + self.own * other;
        *value = self.decay * *value + self.end * one;
        mean
    }
}

fn deviation(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt()
}

/// The 99.9 % interval of a figure. It follows from mean and spread of the logarithm, which is close to normal. With
/// many replicates, where they are cheap, it follows from their quantiles.
fn interval(mut figures: Vec<f64>) -> (f64, f64) {
    figures.sort_by(f64::total_cmp);
    let n = figures.len();
    if n >= 20_000 {
        return (figures[n / 2000], figures[n - 1 - n / 2000]);
    }
    let logarithms: Vec<f64> = figures.iter().map(|figure| figure.ln()).collect();
    let mean = logarithms.iter().sum::<f64>() / n as f64;
    let spread = 3.29 * deviation(&logarithms);
    ((mean - spread).exp(), (mean + spread).exp())
}

/// The wandering processes, with their deviation: the slow noise, and those of the flicker noise.
fn wandering(noise: &AxisNoise, span_s: f64) -> Vec<(f64, Blocks)> {
    let flicker = FLICKER_S.map(|correlation_s| (noise.flicker, correlation_s));
    let all = [(noise.slow, noise.correlation_s)].into_iter().chain(flicker);
    all.map(|(deviation, correlation_s)| (deviation, Blocks::new(span_s, correlation_s))).collect()
}

/// The standard deviation of the means of an hour under the true noise.
fn stability_of(noise: &AxisNoise, dice: &mut Dice) -> (f64, f64) {
    let processes = wandering(noise, 10.0);
    let white = noise.white / 10.0_f64.sqrt();
    let replicate = |dice: &mut Dice| {
        let mut values: Vec<f64> = processes.iter().map(|_| dice.normal()).collect();
        let mut mean = |dice: &mut Dice| {
            let wander = processes
                .iter()
                .zip(&mut values)
                .map(|((deviation, blocks), value)| deviation * blocks.next(value, dice));
            wander.sum::<f64>() + white * dice.normal()
        };
        let means: Vec<f64> = (0..360).map(|_| mean(dice)).collect();
        deviation(&means)
    };
    interval((0..300).map(|_| replicate(dice)).collect())
}

/// The standard deviation of six means of ten minutes, one every twenty, under the true noise. The slow processes go on
/// while the power is off.
fn repeatability_of(noise: &AxisNoise, dice: &mut Dice) -> (f64, f64) {
    let processes = wandering(noise, 600.0);
    let replicate = |dice: &mut Dice| {
        let mut values: Vec<f64> = processes.iter().map(|_| dice.normal()).collect();
        let means: Vec<f64> = (0..6)
            .map(|_| {
                let mut wander = 0.0;
                for ((deviation, blocks), value) in processes.iter().zip(&mut values) {
                    wander += deviation * blocks.next(value, dice);
                    // The gap is as long as a run.
                    *value = blocks.decay * *value + blocks.end * dice.normal();
                }
                noise.turn_on * dice.normal() + wander + noise.white / 600.0_f64.sqrt() * dice.normal()
            })
            .collect();
        deviation(&means)
    };
    interval((0..20_000).map(|_| replicate(dice)).collect())
}

#[test]
fn sixty_figures_are_those_of_the_true_noise() {
    let plan = Plan::read("sixty.toml", PLAN.into(), &mut |_| Err("no includes".to_owned())).unwrap();
    let params = |id: ItemId| -> &Params { &plan.items().iter().find(|item| item.id == id).unwrap().params };
    let earlier = calibrated();
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(SEED));
    let mut wrong = Vec::new();
    let mut figures = 0;
    for (number, published) in (1..).zip(&PUBLISHED) {
        let mut module = Module::new(published, SEED + number);
        let hour = [module.capture("still", 1, 3600.0)];
        let runs: Vec<Capture> = (1..=6)
            .map(|run| {
                module.sensors.power_on(module.now_s);
                module.now_s += 600.0;
                module.capture(&format!("run {run}"), run, 600.0)
            })
            .collect();
        let models = module.models;
        let mut bounds = |noise: &[AxisNoise; 3]| {
            noise.each_ref().map(|noise| (stability_of(noise, &mut dice), repeatability_of(noise, &mut dice)))
        };
        let bounds = [
            ("gyro", Unit::DegreePerSecond, bounds(&models.gyro.noise)),
            ("accel", Unit::Gravity, bounds(&models.accel.noise)),
        ];
        for (id, captures, what) in
            [(ItemId::BiasStability, &hour[..], "stability"), (ItemId::BiasRepeatability, &runs[..], "repeatability")]
        {
            let question = AnalysisInput { params: params(id), site: None, captures, earlier: &earlier };
            let found = analyse(id, &question).unwrap();
            for (sensor, unit, axes) in bounds {
                for (axis, (stability, repeatability)) in ["x", "y", "z"].into_iter().zip(axes) {
                    let (low, high) = if what == "stability" { stability } else { repeatability };
                    let name = format!("bias_{what}_{sensor}_{axis}");
                    let value = found.measured.iter().find(|(measured, _)| *measured == name).map(|(_, value)| value);
                    let Some(Value::Estimate(value, _)) = value else { panic!("no {name}") };
                    let value = value.in_unit(unit).unwrap();
                    figures += 1;
                    if !(low..=high).contains(&value) {
                        wrong.push(format!("module {number} {name}: {value:e}, expected {low:e} to {high:e}"));
                    }
                }
            }
        }
    }
    assert_eq!(figures, 60);
    assert!(wrong.is_empty(), "seed {SEED}\n{}", wrong.join("\n"));
}

/// The models are set from the published table: the middle of each interval is near its figure.
#[test]
fn the_published_table_is_in_the_middle() {
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(SEED));
    for (gyro, _) in &PUBLISHED {
        let noise = TriadModel::gyroscopes(gyro).noise;
        for (axis, noise) in noise.iter().enumerate() {
            let (low, high) = stability_of(noise, &mut dice);
            let published = gyro.stability[axis] / 3600.0;
            assert!(low < published && published < high, "{low:e} {published:e} {high:e}");
            assert!(high / low < 1.6, "an hour tells the stability to some 20 %: {low:e} {high:e}");
            let (low, high) = repeatability_of(noise, &mut dice);
            let published = gyro.repeatability[axis] / 3600.0;
            assert!(low < published && published < high, "{low:e} {published:e} {high:e}");
        }
    }
}
