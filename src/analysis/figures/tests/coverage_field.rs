//! Checks that the intervals of the magnetometer's figures hold the truth as often as they say. Each trial spins a
//! module on a bench whose seat, axis, fixture and ambient field have the errors that the bench file states, with a
//! sensor whose zero wanders.

use gnc_executive::bench::{BenchImperfections, BenchSite};
use gnc_executive::catalogue::ItemId;
use gnc_executive::plan::Params;
use gnc_protocol::stream::ImuSample;
use gnc_rig::Along;
use nalgebra::{Matrix3, Rotation3, Vector3};

use super::coverage::{Found, Tally, params, tally};
use super::world::{Dice, capture};
use crate::capture::{Capture, Pose};
use crate::figures::{AnalysisInput, analyse};

const PLAN: &str = r#"
name = "coverage"
version = "1"
[[item]]
id = "magnetometer-ellipse"
phase = "setup"
params = { duration = "3 s", turn_rate = "1000 Hz" }
[[item]]
id = "magnetometer-ellipsoid"
phase = "setup"
params = { dwell = "2 s", rate = "100 Hz", positions = "24" }
"#;
/// The earth's field at the bench: along the level axis to the north, and across it, gauss.
const AXIAL: f64 = 0.323;
const ACROSS: f64 = 0.4245;
/// Soft iron and hard iron.
const SOFT: Matrix3<f64> = Matrix3::new(1.012, 0.006, -0.004, 0.006, 0.991, 0.005, -0.004, 0.005, 1.008);
const HARD: Vector3<f64> = Vector3::new(0.020, -0.014, 0.009);
/// White noise of a sample at 1 kHz, and a zero that wanders, gauss.
const WHITE: f64 = 134e-6;
const SLOW: f64 = 8e-6;
const CORRELATION_S: f64 = 0.05;

/// Figures of an item with their truths.
type Truths = Vec<(&'static str, f64)>;

/// The errors of the bench in one trial.
struct Bench {
    fixture: BenchImperfections,
    seat: Rotation3<f64>,
    own_field: Vector3<f64>,
    runout: [f64; 2],
    axis: f64,
    ambient: f64,
    dice: Dice,
    slow: Vector3<f64>,
}

impl Bench {
    fn new(seed: u64) -> Self {
        let mut dice = Dice::new(seed);
        let fixture = BenchImperfections::default();
        let mounting = Vector3::from_fn(|_, _| fixture.mounting_u_rad * dice.normal());
        Self {
            seat: Rotation3::from_scaled_axis(mounting),
            own_field: Vector3::from_fn(|_, _| fixture.field_u_gauss * dice.normal()),
            runout: [0; 2].map(|_| fixture.runout_u_rad * dice.normal()),
            axis: fixture.axis_u_rad * dice.normal(),
            ambient: fixture.ambient_u_gauss * dice.normal(),
            slow: Vector3::zeros(),
            fixture,
            dice,
        }
    }

    /// One reading of a field in the axes of the table.
    fn read(&mut self, field: Vector3<f64>, dt_s: f64, white: f64) -> ImuSample {
        let decay = (-dt_s / CORRELATION_S).exp();
        let step = SLOW * (1.0 - decay * decay).sqrt();
        self.slow = self.slow.map(|slow| decay * slow + step * self.dice.normal());
        let raw = SOFT * (self.seat * field + self.own_field) + HARD + self.slow;
        let mag = raw.map(|gauss| ((gauss + white * self.dice.normal()) * 1.25e6).round() as i32).into();
        ImuSample { gyro: [0, 0, 8_388_607], mag, ..ImuSample::default() }
    }

    /// A spin about Z, which points to the north.
    fn spin(&mut self, label: &str, rate_dps: f64) -> Capture {
        // An axis that is off by a small angle in the plane of the field moves a part of the field along it to the
        // field across it.
        let across = ACROSS * (1.0 + self.ambient / ACROSS) + AXIAL * self.axis;
        let samples = (0..3000)
            .map(|k| {
                let t_s = f64::from(k) / 1000.0;
                let angle = rate_dps.to_radians() * t_s;
                let (sin, cos) = angle.sin_cos();
                let [a, b] = self.runout.map(|runout| runout * AXIAL);
                // The field turns backwards in the module, and the part from the tilt turns forwards.
                let field = Vector3::new(across * cos + a * cos - b * sin, -across * sin + a * sin + b * cos, AXIAL);
                self.read(field, 0.001, WHITE)
            })
            .collect();
        capture(label, 1, Pose::Spinning { axis: 2, rate_dps, along: Along::North }, 1000, samples)
    }

    fn spins(&mut self) -> Vec<Capture> {
        [("spin +", 5400.0), ("spin -", -5400.0), ("slow spin +", 1800.0), ("slow spin -", -1800.0)]
            .map(|(label, rate_dps)| self.spin(label, rate_dps))
            .into()
    }

    /// Captures with every axis up and down at four headings.
    fn attitudes(&mut self) -> Vec<Capture> {
        let mut captures = Vec::new();
        for (turn, k, sign) in (0..4).flat_map(|turn| (0..3).flat_map(move |k| [(turn, k, 1.0), (turn, k, -1.0)])) {
            let heading_deg = 90.0 * f64::from(turn);
            let (sin, cos) = heading_deg.to_radians().sin_cos();
            // North 0.323, down 0.4245, in the axes of the module: vertical, the next, the third. All components have
            // the error of the ambient field on that day, and each attitude has a field of its own.
            let day = 1.0 + self.ambient / AXIAL.hypot(ACROSS);
            let vertical = -sign * ACROSS * day;
            let (next, third) = (AXIAL * cos * day, AXIAL * sin * sign * day);
            let mut field = Vector3::zeros();
            (field[k], field[(k + 1) % 3], field[(k + 2) % 3]) = (vertical, next, third);
            field += Vector3::from_fn(|_, _| self.fixture.ambient_u_gauss * self.dice.normal());
            let mut up = [0.0; 3];
            up[k] = sign;
            let samples = (0..200).map(|_| self.read(field, 0.01, WHITE / 10.0_f64.sqrt())).collect();
            captures.push(capture(
                &format!("{k} {sign} {heading_deg}"),
                1,
                Pose::Still { up, heading_deg },
                100,
                samples,
            ));
        }
        captures
    }
}

/// The attitudes of a good module, and its bench.
pub(super) fn good_attitudes(seed: u64) -> (BenchSite, Vec<Capture>) {
    let mut bench = Bench::new(seed);
    (site(bench.fixture), bench.attitudes())
}

fn site(fixture: BenchImperfections) -> BenchSite {
    BenchSite { field_gauss: Some(AXIAL.hypot(ACROSS)), fixture: Some(fixture), ..BenchSite::default() }
}

/// Spins `trials` modules. Good modules must not be refused.
pub(super) fn run(trials: usize, seed: u64) -> Vec<Tally> {
    let params = params(PLAN);
    tally(trials, |trial| calibrate(&params, seed.wrapping_mul(1_000_003) + trial as u64))
}

/// Each figure with its truth.
fn calibrate(params: &[Params], seed: u64) -> Vec<Found> {
    let mut bench = Bench::new(seed);
    let site = site(bench.fixture);
    let plane = SOFT.fixed_view::<2, 2>(0, 0);
    let q = plane * plane.transpose();
    let radius = q[(0, 0)].sqrt() * ACROSS;
    // The field along the axis stays on both sensors by their response to Z.
    let zero = |i: usize| HARD[i] + SOFT[(i, 2)] * AXIAL;
    let correction = SOFT.try_inverse().expect("soft iron is regular") * SOFT.determinant().cbrt();
    let figures: [(ItemId, Vec<Capture>, Truths); 2] = [
        (
            ItemId::MagnetometerEllipse,
            bench.spins(),
            vec![
                ("zero_x", zero(0)),
                ("zero_y", zero(1)),
                ("sensitivity_ratio", 100.0 * (q[(0, 0)] / q[(1, 1)]).sqrt()),
                ("alpha", (q[(0, 1)] / (q[(0, 0)] * q[(1, 1)]).sqrt()).asin().to_degrees()),
                ("radius", radius),
                ("skew", 0.0),
            ],
        ),
        (
            ItemId::MagnetometerEllipsoid,
            bench.attitudes(),
            vec![
                ("hard_iron_x", HARD[0]),
                ("hard_iron_y", HARD[1]),
                ("hard_iron_z", HARD[2]),
                ("soft_iron_xx", (correction[(0, 0)] - 1.0) * 1e6),
                ("soft_iron_yy", (correction[(1, 1)] - 1.0) * 1e6),
                ("soft_iron_zz", (correction[(2, 2)] - 1.0) * 1e6),
                ("soft_iron_xy", correction[(0, 1)] * 1e6),
                ("soft_iron_xz", correction[(0, 2)] * 1e6),
                ("soft_iron_yz", correction[(1, 2)] * 1e6),
                ("field", AXIAL.hypot(ACROSS) * SOFT.determinant().cbrt()),
            ],
        ),
    ];
    let mut all = Vec::new();
    for ((id, captures, truths), params) in figures.into_iter().zip(params) {
        let question = AnalysisInput { params, site: Some(&site), captures: &captures, earlier: &[] };
        let findings = analyse(id, &question).unwrap_or_else(|error| panic!("seed {seed}: {id}: {error}"));
        for (name, truth) in truths {
            all.push(Found::new(id.as_str(), &findings, name, truth));
        }
        if id == ItemId::MagnetometerEllipse {
            for harmonic in [0, 1] {
                let spins = findings.details["spins"].as_array().expect("spins");
                let size = |spin: &&serde_json::Value| number(&spin["roll_harmonics_deg"][harmonic]);
                let largest = spins.iter().max_by(|a, b| size(a).total_cmp(&size(b))).expect("a spin");
                let name = ["roll_error_1", "roll_error_2"][harmonic];
                all.push(Found::new(id.as_str(), &findings, name, left_deg(largest, harmonic + 1)));
            }
        }
    }
    all
}

fn number(value: &serde_json::Value) -> f64 {
    value.as_f64().expect("a number")
}

/// The roll error that the correction of a spin leaves where the module turns on a bench without errors: amplitude of
/// `periods` periods a turn, deg.
fn left_deg(spin: &serde_json::Value, periods: usize) -> f64 {
    const PLACES: usize = 360;
    let [dx, dy, ky, sin_alpha] = ["dx", "dy", "ky", "sin_alpha"].map(|name| number(&spin[name]));
    let (mut cosine, mut sine) = (0.0, 0.0);
    for place in 0..PLACES {
        let roll = std::f64::consts::TAU * place as f64 / PLACES as f64;
        let raw = SOFT * Vector3::new(ACROSS * roll.cos(), -ACROSS * roll.sin(), AXIAL) + HARD;
        let y = ky * (raw[1] - dy);
        let x = ((raw[0] - dx) - y * sin_alpha) / (1.0 - sin_alpha * sin_alpha).sqrt();
        let (sin, cos) = ((-y).atan2(x) - roll).sin_cos();
        let error = sin.atan2(cos) * 2.0 / PLACES as f64;
        cosine += error * (roll * periods as f64).cos();
        sine += error * (roll * periods as f64).sin();
    }
    cosine.hypot(sine).to_degrees()
}

/// The long run is `cargo bench -p gnc-analysis --bench coverage`.
#[cfg(test)]
#[test]
fn intervals_of_the_magnetometer_hold_the_truth_as_often_as_they_say() {
    const TRIALS: usize = 20;
    const SEED: u64 = 78;
    let tallies = run(TRIALS, SEED);
    let pooled = tallies.iter().map(|tally| tally.held).sum::<usize>() as f64 / (tallies.len() * TRIALS) as f64;
    // 12 figures of 20 modules, 3.9 standard errors below 95 %.
    assert!(pooled >= 0.895, "seed {SEED}: {pooled}\n{tallies:?}");
    // Once in a thousand a good figure holds in fewer than 15 of 20.
    let worst = tallies.iter().min_by_key(|tally| tally.held).expect("there are figures");
    assert!(worst.held >= 15, "seed {SEED}: {worst:?}");
}
