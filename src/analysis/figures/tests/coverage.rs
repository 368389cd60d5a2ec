//! Checks that the intervals hold the truth as often as they say. Modules are calibrated in worlds whose noise,
//! attitudes, gravity, headings, angles and clocks have the errors that the plan states.
//!
//! The run here is short. `cargo bench -p gnc-analysis --bench coverage` does the long run from this same file.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

use gnc_executive::bench::{BenchImperfections, BenchSite, SitePlace};
use gnc_executive::catalogue::ItemId;
use gnc_executive::measurement::Value;
use gnc_executive::plan::{Params, Plan};
pub(super) use gnc_metrology::AXES;
use nalgebra::{Matrix3, Vector3};

use super::world::{Dice, GRAVITY, LATITUDE_DEG, Noise, World};
use crate::capture::Capture;
use crate::figures::{AnalysisInput, Findings, analyse};

pub(super) const PLAN: &str = r#"
name = "coverage"
version = "1"
[[item]]
id = "six-position"
phase = "setup"
params = { dwell = "60 s", rate = "20 Hz", pose_u = "0.003 deg", gravity_u = "30 ppm" }
[[item]]
id = "rotation"
phase = "setup"
params = { turn_rate = "100 Hz", pose_u = "0.003 deg", angle_u = "0.01 deg", clock_u = "12 ppm" }
[[item]]
id = "gyro-still"
phase = "setup"
params = { of = "six-position", heading_u = "0.5 deg" }
"#;
/// How often a figure's interval held the truth.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tally {
    pub(super) name: String,
    /// Trials that gave the figure, and how often its interval held the truth.
    pub(super) given: usize,
    pub(super) held: usize,
    /// Probability that the interval promises.
    pub(super) probability: f64,
    /// Share of each type B term in the variance of its budget, summed over the trials.
    pub(super) shares: BTreeMap<String, f64>,
}

/// A figure of one trial.
pub(super) struct Found {
    pub(super) name: String,
    held: bool,
    probability: f64,
    shares: Vec<(String, f64)>,
}

/// Returns the value of a measurement by its name in records.
pub(super) fn value_of<'f>(findings: &'f Findings, name: &str) -> Option<&'f Value> {
    findings.measured.iter().find(|(measured, _)| *measured == name).map(|(_, value)| value)
}

impl Found {
    pub(super) fn new(item: &str, findings: &Findings, name: &str, truth: f64) -> Self {
        Self::given(item, findings, name, truth).unwrap_or_else(|| panic!("{item} has no interval of {name}"))
    }

    /// Returns a figure of an item; `None` where the item gives the reason in place of the figure.
    pub(super) fn given(item: &str, findings: &Findings, name: &str, truth: f64) -> Option<Self> {
        let known = match value_of(findings, name) {
            Some(Value::Estimate(_, known)) => known,
            Some(Value::NotAvailable(_)) => return None,
            other => panic!("{item} {name} is {other:?}"),
        };
        let number = |value: &serde_json::Value| value.as_f64().expect("a number");
        // Intervals of standard deviations have their own shape and no budget.
        let budget = &findings.details["budget"][name];
        let rows = budget["contributions"].as_array().map_or(&[][..], Vec::as_slice);
        let of_b = rows.iter().filter(|row| row["type"] == "B");
        let shares = of_b.map(|row| {
            let share = (number(&row["u"]) / number(&budget["u"])).powi(2);
            (row["name"].as_str().unwrap_or("").to_owned(), share)
        });
        Some(Self {
            name: format!("{item} {name}"),
            held: known.low <= truth && truth <= known.high,
            probability: known.probability,
            shares: shares.collect(),
        })
    }

    /// Adds the share of a type B term that no budget shows.
    pub(super) fn with_share(mut self, name: &str, share: f64) -> Self {
        self.shares.push((name.to_owned(), share));
        self
    }
}

/// Calibrates `trials` modules.
pub(super) fn run(trials: usize, seed: u64) -> Vec<Tally> {
    let params = params(PLAN);
    tally(trials, |trial| {
        let Calibrated { world, earlier, .. } = Calibrated::new(&params, seed_of(trial, seed));
        truths(&world, &earlier)
    })
}

/// Parameters of the items of a plan.
pub(super) fn params(plan: &str) -> Vec<Params> {
    let plan = Plan::read("coverage.toml", plan.into(), &mut |_| Err("no includes".into())).expect("the plan is good");
    plan.items().iter().map(|item| item.params.clone()).collect()
}

/// Counts the intervals that hold their truth.
pub(super) fn tally(trials: usize, found: impl Fn(usize) -> Vec<Found>) -> Vec<Tally> {
    let mut tallies: Vec<Tally> = Vec::new();
    for Found { name, held, probability, shares } in (0..trials).flat_map(found) {
        let place = tallies.iter().position(|tally| tally.name == name).unwrap_or_else(|| {
            tallies.push(Tally { name, given: 0, held: 0, probability, shares: BTreeMap::new() });
            tallies.len() - 1
        });
        let tally = &mut tallies[place];
        tally.given += 1;
        tally.held += usize::from(held);
        for (name, share) in shares {
            *tally.shares.entry(name).or_default() += share;
        }
    }
    tallies
}

/// Seed of a trial.
pub(super) fn seed_of(trial: usize, seed: u64) -> u64 {
    seed.wrapping_mul(1_000_003) + trial as u64
}

/// A module that was calibrated on a bench with the errors of its budgets.
pub(super) struct Calibrated {
    pub(super) world: World,
    pub(super) site: BenchSite,
    /// Further errors of the bench.
    pub(super) errors: Dice,
    pub(super) earlier: Vec<(String, Findings)>,
}

impl Calibrated {
    /// `params` are those of [`PLAN`].
    pub(super) fn new(params: &[Params], seed: u64) -> Self {
        let (mut world, site, errors) = world(seed);
        let (six, turns) = (world.six("", 1, 60.0, 20), world.turns("", 1, 100));
        let mut module = Self { world, site, errors, earlier: Vec::new() };
        let items = [(ItemId::SixPosition, &six), (ItemId::Rotation, &turns), (ItemId::GyroStill, &six)];
        for ((id, captures), params) in items.into_iter().zip(params) {
            let findings = module.ask(id, params, captures);
            module.earlier.push((id.to_string(), findings));
        }
        module
    }

    /// Returns the findings of an item after the calibration.
    pub(super) fn ask(&self, id: ItemId, params: &Params, captures: &[Capture]) -> Findings {
        let question = AnalysisInput { params, site: Some(&self.site), captures, earlier: &self.earlier };
        analyse(id, &question).unwrap_or_else(|error| panic!("{id}: {error}"))
    }
}

/// Creates a module and a bench. Their errors are drawn from the distributions of the budgets.
pub(super) fn world(seed: u64) -> (World, BenchSite, Dice) {
    let mut world = World::new(seed);
    let mut errors = Dice::new(seed ^ 0x5EED);
    world.pose_rad = 0.003_f64.to_radians();
    world.heading_error_deg = 0.5 * errors.normal();
    let mounting_u_rad = BenchImperfections::default().mounting_u_rad;
    world.mounting = Vector3::from_fn(|_, _| mounting_u_rad * errors.normal());
    // The clock counts like the angle: both are in every integral.
    world.angle_error = 0.01 / 1080.0 * errors.normal() + 12e-6 * errors.normal();
    world.accel_noise = Noise { white: 0.1e-3, slow: 0.15e-3, correlation_s: 2.0, turn_on: 0.1e-3 };
    world.gyro_noise = Noise { white: 0.0025, slow: 2.0 / 3600.0, correlation_s: 2.0, turn_on: 3.0 / 3600.0 };
    world.power_on();
    let place = SitePlace { latitude_deg: LATITUDE_DEG, longitude_deg: 108.9, height_m: 412.0 };
    let gravity_mps2 = Some(GRAVITY * (1.0 + 30e-6 * errors.normal()));
    let site = BenchSite { name: None, place: Some(place), gravity_mps2, field_gauss: None, fixture: None };
    (world, site, errors)
}

fn truths(world: &World, found: &[(String, Findings)]) -> Vec<Found> {
    let mut all = Vec::new();
    let mut put = |k: usize, name: String, truth: f64| {
        let (item, findings) = &found[k];
        all.push(Found::new(item, findings, &name, truth));
    };
    let inverse = |matrix: &Matrix3<f64>| matrix.try_inverse().expect("the module's response is regular");
    let accel_bias = inverse(&world.accel) * (world.accel_bias + world.turn_on[1]) * 1e3;
    let gyro_bias = inverse(&world.gyro) * (world.gyro_bias + world.turn_on[0]);
    let per_g = inverse(&world.gyro) * world.per_g * 3600.0;
    // Each axis in turn is up, with gravity on its own sensor.
    let upright = world.gyro_bias + world.turn_on[0] + world.per_g.diagonal() * GRAVITY / 9.80665;
    let at_attitude = inverse(&world.gyro) * upright * 3600.0;
    let angles = |matrix: &Matrix3<f64>| {
        let between = |i: usize, j: usize| matrix.row(i).transpose().angle(&matrix.row(j).transpose());
        [("xy", 0, 1), ("xz", 0, 2), ("yz", 1, 2)]
            .map(|(name, i, j)| (format!("nonorthogonality_{name}"), (FRAC_PI_2 - between(i, j)) * 1e6))
    };
    for (name, truth) in angles(&world.accel) {
        put(0, name, truth);
    }
    for (name, truth) in angles(&world.gyro) {
        put(1, name, truth);
    }
    for (i, axis) in AXES.iter().enumerate() {
        put(0, format!("bias_{axis}"), accel_bias[i]);
        put(2, format!("bias_{axis}"), gyro_bias[i]);
        put(0, format!("scale_error_{axis}"), (world.accel[(i, i)] - 1.0) * 1e6);
        put(1, format!("bias_at_attitude_{axis}"), at_attitude[i]);
        put(1, format!("scale_error_{axis}"), (world.gyro[(i, i)] - 1.0) * 1e6);
        for (j, other) in AXES.iter().enumerate() {
            put(2, format!("g_sensitivity_{axis}{other}"), per_g[(i, j)]);
            if i != j {
                put(0, format!("coupling_{axis}{other}"), world.accel[(i, j)] / world.accel[(i, i)] * 1e6);
                put(1, format!("coupling_{axis}{other}"), world.gyro[(i, j)] / world.gyro[(i, i)] * 1e6);
            }
        }
    }
    all
}

/// Checks a short run: together the intervals hold as often as they say, and no interval far less often.
///
/// Once in a thousand a good figure misses more often than `worst` says. Figures of one trial share some errors, so
/// that the pooled share may be off by more than a binomial's 3.9 standard errors. Twice that is allowed.
#[cfg(test)]
pub(super) fn check(tallies: &[Tally], seed: u64) {
    let (mut excess, mut variance) = (0.0, 0.0);
    for tally in tallies {
        let (given, p) = (tally.given as f64, tally.probability);
        excess += given * p - tally.held as f64;
        variance += given * p * (1.0 - p);
        let misses = tally.given - tally.held;
        assert!(misses <= worst(tally.given, 1.0 - p), "seed {seed}: {tally:?}");
    }
    assert!(excess < 2.0 * 3.9 * variance.sqrt(), "seed {seed}: {excess} of {}\n{tallies:#?}", variance.sqrt());
}

/// Number of misses that chance exceeds less than once in a thousand times, in `trials` trials that miss with
/// probability `p`.
#[cfg(test)]
fn worst(trials: usize, p: f64) -> usize {
    let (mut term, mut sum, mut misses) = ((1.0 - p).powi(trials as i32), 0.0, 0);
    loop {
        sum += term;
        if sum > 0.999 || misses == trials {
            return misses;
        }
        term *= (trials - misses) as f64 / (misses + 1) as f64 * p / (1.0 - p);
        misses += 1;
    }
}

#[cfg(test)]
#[test]
fn intervals_hold_the_truth_as_often_as_they_say() {
    const TRIALS: usize = 40;
    const SEED: u64 = 77;
    let tallies = run(TRIALS, SEED);
    check(&tallies, SEED);
    let pooled = tallies.iter().map(|tally| tally.held).sum::<usize>() as f64 / (tallies.len() * TRIALS) as f64;
    // 42 figures of 40 modules. The figures of one module share some errors: 1.1 % of deviation at most.
    assert!((0.915..0.985).contains(&pooled), "seed {SEED}: {pooled}\n{tallies:?}");
    // Binomial tables: of 40 trials at 5 % more than 7 miss once in 1400 times, more than 6 once in 300.
    assert_eq!(worst(40, 0.05), 7);
}
