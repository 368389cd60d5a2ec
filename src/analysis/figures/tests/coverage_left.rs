//! Checks that the intervals of the errors that calibration leaves hold the truth as often as they say. A module is
//! calibrated as in [`super::coverage`], and the items behind the calibration measure it: biases, resolution,
//! stability, repeatability, and the module's own compensation.
//!
//! The truth is that of these coefficients, since such an item measures the errors of the calibration.

use gnc_executive::catalogue::ItemId;
use gnc_protocol::calibration::CompensatedSample;
use gnc_rig::Along;
use nalgebra::{Matrix3, Rotation3, Vector3};

use super::coverage::{AXES, Calibrated, Found, PLAN, Tally, params, seed_of, tally};
use super::world::{EARTH_DPH, GRAVITY, LATITUDE_DEG, World};
use crate::capture::{Capture, Pose};
use crate::figures::calibration::ModuleCoefficients;

/// The items behind the calibration, in this order.
const LEFT: &str = r#"
[[item]]
id = "gyro-bias"
phase = "setup"
params = { dwell = "60 s", rate = "20 Hz" }
[[item]]
id = "accel-bias"
phase = "setup"
params = { dwell = "30 s", rate = "20 Hz" }
[[item]]
id = "resolution"
phase = "setup"
params = { dwell = "5 s", rate = "20 Hz", gyro_step = "0.02 deg/s" }
[[item]]
id = "bias-stability"
phase = "setup"
params = { duration = "300 s", rate = "20 Hz" }
[[item]]
id = "bias-repeatability"
phase = "setup"
params = { dwell = "10 s", rate = "20 Hz", runs = 4 }
[[item]]
id = "calibration-download"
phase = "setup"
[[item]]
id = "calibration-check"
phase = "setup"
params = { dwell = "60 s", rate = "20 Hz", turn_rate = "100 Hz", angle_u = "0.01 deg", clock_u = "12 ppm" }
"#;
/// Steps of each direction.
const STEPS: usize = 6;
const STEP_DPS: f64 = 0.02;
const STEP_G: f64 = 1e-3;
const G: f64 = 9.80665;

/// Measures `trials` modules.
pub(super) fn run(trials: usize, seed: u64) -> Vec<Tally> {
    let all = params(&format!("{PLAN}{LEFT}"));
    tally(trials, |trial| {
        let mut module = Calibrated::new(&all[..3], seed_of(trial, seed));
        let mut found = Vec::new();
        let left = Left::of(&module);
        let (still, truth_dph) = (module.world.still("still", 1, "z+", 30.0, 60.0, 20), left.rate_dph(&module, 30.0));
        let findings = module.ask(ItemId::GyroBias, &all[3], &[still]);
        for (i, axis) in AXES.iter().enumerate() {
            found.push(Found::new("gyro-bias", &findings, &format!("bias_{axis}"), truth_dph[i]));
        }
        let captures = upside_down(&mut module.world);
        let findings = module.ask(ItemId::AccelBias, &all[4], &captures);
        for (i, axis) in AXES.iter().enumerate() {
            found.push(Found::new("accel-bias", &findings, &format!("bias_{axis}"), left.bias_mg(&module)[i]));
        }
        found.extend(checked(&mut module, &left, &all[9]));
        let captures = steps(&mut module);
        let findings = module.ask(ItemId::Resolution, &all[5], &captures);
        for (i, axis) in AXES.iter().enumerate() {
            for (name, response) in [("gyro", left.gyro), ("accel", left.accel)] {
                let name = format!("step_response_{name}_{axis}");
                found.push(Found::new("resolution", &findings, &name, 100.0 * response[(i, i)]));
            }
        }
        let still = module.world.still("hour", 1, "z+", 0.0, 300.0, 20);
        let findings = module.ask(ItemId::BiasStability, &all[6], &[still]);
        found.extend(spreads(&findings, "bias-stability", "bias_stability", |noise| noise.of_mean(10.0), &module));
        let runs: Vec<Capture> = (1..=4)
            .map(|run| {
                module.world.power_on();
                module.world.still(&format!("run {run}"), run, "z+", 0.0, 10.0, 20)
            })
            .collect();
        let findings = module.ask(ItemId::BiasRepeatability, &all[7], &runs);
        let of_runs = |noise: &super::world::Noise| noise.turn_on.hypot(noise.of_mean(10.0));
        found.extend(spreads(&findings, "bias-repeatability", "bias_repeatability", of_runs, &module));
        found
    })
}

/// The module's true outputs after compensation with the coefficients.
struct Left {
    known: ModuleCoefficients,
    /// Compensated output of a gyroscope for a rate about each axis of the table. `accel` is the same for the
    /// accelerometers.
    gyro: Matrix3<f64>,
    accel: Matrix3<f64>,
}

fn matrix(rows: [[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| rows[row][column])
}

impl Left {
    fn of(module: &Calibrated) -> Self {
        let calibration = crate::figures::ModuleCalibration::of(&module.earlier).expect("it was calibrated");
        let known = ModuleCoefficients::of(&calibration).expect("all of it");
        let seat = Rotation3::from_scaled_axis(module.world.mounting).into_inner();
        // Counts for one deg/s and one g.
        let gyro = matrix(known.gyro_matrix) * module.world.gyro * seat * 20_000.0_f64.to_degrees();
        let accel = matrix(known.accel_matrix) * module.world.accel * seat * 160_000.0 / G;
        Self { known, gyro, accel }
    }

    /// Compensated force without an applied force, m/s^2.
    fn force_offset(&self, world: &World) -> Vector3<f64> {
        matrix(self.known.accel_matrix) * (world.accel_bias + world.turn_on[1]) * 160_000.0
            + Vector3::from(self.known.accel_offset)
    }

    fn bias_mg(&self, module: &Calibrated) -> Vector3<f64> {
        self.force_offset(&module.world) / G * 1e3
    }

    /// Compensated less true rate with Z up and X at this heading, deg/h.
    fn rate_dph(&self, module: &Calibrated, heading_deg: f64) -> Vector3<f64> {
        let world = &module.world;
        let seat = Rotation3::from_scaled_axis(world.mounting);
        let (sin, cos) = LATITUDE_DEG.to_radians().sin_cos();
        let (east, north) = (heading_deg + world.heading_error_deg).to_radians().sin_cos();
        let true_dps = Vector3::new(north * cos, east * cos, sin) * EARTH_DPH / 3600.0;
        let force_mps2 = Vector3::z() * GRAVITY;
        let raw_dps = world.gyro_bias + world.turn_on[0] + world.per_g * (seat * force_mps2) / G;
        let bias_rps = matrix(self.known.gyro_matrix) * raw_dps * 20_000.0
            - Vector3::from(self.known.gyro_offset)
            - matrix(self.known.gyro_per_force) * (self.accel * force_mps2 + self.force_offset(world));
        let left_dps = bias_rps.map(f64::to_degrees) + self.gyro * true_dps - true_dps;
        left_dps * 3600.0
    }
}

/// Each axis level, and again upside down about the third axis.
fn upside_down(world: &mut World) -> Vec<Capture> {
    [
        ("x z+", "z+", 0.0),
        ("x z-", "z-", 180.0),
        ("y z+", "z+", 0.0),
        ("y z-", "z-", 0.0),
        ("z x+", "x+", 0.0),
        ("z x-", "x-", 0.0),
    ]
    .map(|(label, axis, heading_deg)| world.still(label, 1, axis, heading_deg, 30.0, 20))
    .into()
}

/// One position and one turn as the module compensates them.
fn checked(module: &mut Calibrated, left: &Left, params: &gnc_executive::plan::Params) -> Vec<Found> {
    let download = params_free(module);
    module.earlier.push(("calibration-download".to_owned(), download));
    let (still, turn) =
        (module.world.still("position", 1, "z+", 0.0, 60.0, 20), module.world.turn("turn", 1, 2, 1080.0, 100));
    let findings = module.ask(ItemId::CalibrationCheck, params, &[left.compensate(&still), left.compensate(&turn)]);
    let force_mps2 = Vector3::z() * GRAVITY;
    let force_mg = (left.accel * force_mps2 - force_mps2 + left.force_offset(&module.world)) / G * 1e3;
    let rate_dph = left.rate_dph(module, 0.0);
    let put = |name: &str, truth: f64| Found::new("calibration-check", &findings, name, truth);
    let mut found: Vec<Found> =
        AXES.iter().enumerate().map(|(i, axis)| put(&format!("force_error_{axis}"), force_mg[i])).collect();
    found.extend(AXES.iter().enumerate().map(|(i, axis)| put(&format!("rate_error_{axis}"), rate_dph[i])));
    found.push(put("angle_error", (left.gyro[(2, 2)] - 1.0) * 1e6));
    found.push(put("cross_angle", left.gyro[(0, 2)].hypot(left.gyro[(1, 2)]) * 1e6));
    found
}

fn params_free(module: &Calibrated) -> crate::figures::Findings {
    let plan = params(&format!("{PLAN}{LEFT}"));
    module.ask(ItemId::CalibrationDownload, &plan[8], &[])
}

impl Left {
    fn compensate(&self, raw: &Capture) -> Capture {
        let counts = |values: Vector3<f64>, scale: f64| [0, 1, 2].map(|axis| (values[axis] * scale).round() as i32);
        let compensated = raw.samples.iter().map(|sample| {
            let [gyro, accel] = [sample.gyro, sample.accel].map(|codes| Vector3::from(codes.map(f64::from)));
            let force = matrix(self.known.accel_matrix) * accel + Vector3::from(self.known.accel_offset);
            let rate = matrix(self.known.gyro_matrix) * gyro
                - Vector3::from(self.known.gyro_offset)
                - matrix(self.known.gyro_per_force) * force;
            CompensatedSample { rate: counts(rate, 1e8), force: counts(force, 1e6), ..CompensatedSample::default() }
        });
        Capture { compensated: compensated.collect(), samples: Vec::new(), ..raw.clone() }
    }
}

/// Steps of both directions on each channel. An attitude of the table has the same error each time.
fn steps(module: &mut Calibrated) -> Vec<Capture> {
    let Calibrated { world, errors, .. } = module;
    let pose_rad = std::mem::take(&mut world.pose_rad);
    let senses = || [0.0].into_iter().chain([1.0, 0.0, -1.0, 0.0].repeat(STEPS));
    let mut captures = Vec::new();
    for axis in 0..3 {
        let about = Vector3::ith(axis, 1.0);
        for (number, sense) in senses().enumerate() {
            let (label, rate_dps) = (format!("gyro {axis} {number}"), STEP_DPS * sense);
            let frame = [about.yzx(), about.zxy(), about];
            let mut capture = world.lying(&label, 1, about.into(), 0.0, frame, about * rate_dps, 5.0, 20);
            if sense != 0.0 {
                capture.about.pose = Pose::Spinning { axis: axis as u8, rate_dps, along: Along::Up };
            }
            captures.push(capture);
        }
    }
    for axis in 0..3 {
        let top = if axis == 2 { 0 } else { 2 };
        let wrong_rad = [0; 3].map(|_| pose_rad * errors.normal());
        for (number, sense) in senses().enumerate() {
            let (label, sine) = (format!("accel {axis} {number}"), STEP_G * sense);
            let mut up = [0.0; 3];
            (up[axis], up[top]) = (sine, (1.0 - sine * sine).sqrt());
            // `tilt` counts along the first vector of the frame.
            world.tilt[0] = wrong_rad[(sense + 1.0) as usize];
            let frame = [Vector3::ith(axis, 1.0), Vector3::zeros(), Vector3::zeros()];
            captures.push(world.lying(&label, 1, up, 0.0, frame, Vector3::zeros(), 5.0, 20));
        }
    }
    (world.pose_rad, world.tilt) = (pose_rad, [0.0; 2]);
    captures
}

/// Standard deviations of both triads compared with that of the noise.
fn spreads(
    findings: &crate::figures::Findings,
    item: &str,
    figure: &str,
    truth: impl Fn(&super::world::Noise) -> f64,
    module: &Calibrated,
) -> Vec<Found> {
    let world = &module.world;
    let triads = [("gyro", truth(&world.gyro_noise) * 3600.0), ("accel", truth(&world.accel_noise) * 1e3)];
    let names =
        triads.into_iter().flat_map(|(triad, truth)| AXES.map(|axis| (format!("{figure}_{triad}_{axis}"), truth)));
    names.map(|(name, truth)| Found::new(item, findings, &name, truth)).collect()
}

#[cfg(test)]
#[test]
fn intervals_of_what_is_left_hold_the_truth_as_often_as_they_say() {
    const SEED: u64 = 79;
    super::coverage::check(&run(8, SEED), SEED);
}
