//! A small independent world: attitudes, the earth, a module with known errors, seeded noise.

use gnc_protocol::stream::{ImuSample, Losses};
use gnc_rig::Along;
use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::capture::{Capture, CaptureHead, Pose, ReceiverCapture, Timing};

pub(super) const LATITUDE_DEG: f64 = 34.2;
pub(super) const GRAVITY: f64 = 9.7954;
/// Rotation rate of the earth in deg/h, from a textbook.
pub(super) const EARTH_DPH: f64 = 15.041_07;

/// Seeded noise: splitmix64 and Box-Muller.
#[derive(Debug, Clone)]
pub(crate) struct Dice(u64);

impl Dice {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0xD1B5_4A32_D192_ED03)
    }

    pub(crate) fn even(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.even()).ln()).sqrt() * (std::f64::consts::TAU * self.even()).cos()
    }
}

/// Noise of a triad in its unit (deg/s or g): white density (deviation of a mean over 1 s), a Gauss-Markov bias.
#[derive(Debug, Clone, Copy)]
pub(super) struct Noise {
    pub(super) white: f64,
    pub(super) slow: f64,
    pub(super) correlation_s: f64,
    pub(super) turn_on: f64,
}

impl Noise {
    /// Deviation of a mean over a span: white and Gauss-Markov part.
    pub(super) fn of_mean(&self, span_s: f64) -> f64 {
        let x = span_s / self.correlation_s;
        let slow = self.slow * (2.0 / (x * x) * (x - 1.0 + (-x).exp())).sqrt();
        slow.hypot(self.white / span_s.sqrt())
    }
}

/// The module's truth, and the fixture's errors.
#[derive(Debug, Clone)]
pub(super) struct World {
    /// Response in g per g, deg/s per deg/s: 1 on a perfect module.
    pub(super) accel: Matrix3<f64>,
    /// Bias in g.
    pub(super) accel_bias: Vector3<f64>,
    pub(super) accel_noise: Noise,
    pub(super) gyro: Matrix3<f64>,
    /// Bias in deg/s.
    pub(super) gyro_bias: Vector3<f64>,
    /// g-sensitivity in deg/s per g.
    pub(super) per_g: Matrix3<f64>,
    pub(super) gyro_noise: Noise,
    /// Deviation of each attitude, rad.
    pub(super) pose_rad: f64,
    /// How the module's seat is mounted: rotation vector from the table's axes to the module's, rad.
    pub(super) mounting: Vector3<f64>,
    /// Tilt of the table towards north and east, rad.
    pub(super) tilt: [f64; 2],
    /// Relative error of every angle.
    pub(super) angle_error: f64,
    /// Error of every heading, deg.
    pub(super) heading_error_deg: f64,
    pub(super) dice: Dice,
    /// Biases that the last power-on added: gyroscopes, accelerometers.
    pub(super) turn_on: [Vector3<f64>; 2],
    pub(super) slow: [Vector3<f64>; 2],
}

impl World {
    pub(super) fn new(seed: u64) -> Self {
        let mut world = Self {
            accel: Matrix3::new(1.0012, 0.0008, -0.0006, -0.0011, 0.9991, 0.0014, 0.0005, -0.0009, 1.0016),
            accel_bias: Vector3::new(0.005, -0.008, 0.006),
            accel_noise: Noise { white: 0.1e-3, slow: 0.0, correlation_s: 4.0, turn_on: 0.0 },
            gyro: Matrix3::new(1.0021, 0.0009, -0.0012, -0.0014, 0.9986, 0.0007, 0.0011, -0.0016, 1.0008),
            gyro_bias: Vector3::new(0.08, -0.05, 0.06),
            per_g: Matrix3::new(0.012, -0.004, 0.003, 0.002, -0.009, 0.005, -0.003, 0.004, 0.010),
            gyro_noise: Noise { white: 0.0025, slow: 0.0, correlation_s: 4.0, turn_on: 0.0 },
            pose_rad: 0.0,
            mounting: Vector3::zeros(),
            tilt: [0.0; 2],
            angle_error: 0.0,
            heading_error_deg: 0.0,
            dice: Dice::new(seed),
            turn_on: [Vector3::zeros(); 2],
            slow: [Vector3::zeros(); 2],
        };
        world.power_on();
        world
    }

    /// Draws new biases.
    pub(super) fn power_on(&mut self) {
        for (k, noise) in [self.gyro_noise, self.accel_noise].into_iter().enumerate() {
            self.turn_on[k] = Vector3::from_fn(|_, _| noise.turn_on * self.dice.normal());
            self.slow[k] = Vector3::from_fn(|_, _| noise.slow * self.dice.normal());
        }
    }

    fn sample(&mut self, force_g: &Vector3<f64>, rate_dps: &Vector3<f64>, dt: f64) -> ImuSample {
        let noises = [self.gyro_noise, self.accel_noise];
        for (k, noise) in noises.into_iter().enumerate() {
            let decay = (-dt / noise.correlation_s).exp();
            let step = noise.slow * (1.0 - decay * decay).sqrt();
            if noise.slow > 0.0 {
                self.slow[k] = self.slow[k].map(|value| decay * value + step * self.dice.normal());
            }
        }
        let gyro = self.gyro * rate_dps + self.gyro_bias + self.per_g * force_g + self.turn_on[0] + self.slow[0];
        let accel = self.accel * force_g + self.accel_bias + self.turn_on[1] + self.slow[1];
        let root = dt.sqrt();
        let mut codes = |values: Vector3<f64>, white: f64, lsb: f64| -> [i32; 3] {
            let noisy = values.map(|value| ((value + white / root * self.dice.normal()) * lsb).round());
            noisy.map(|code| code.clamp(-8_388_608.0, 8_388_607.0) as i32).into()
        };
        let (gyro, accel) = (codes(gyro, noises[0].white, 20_000.0), codes(accel, noises[1].white, 160_000.0));
        ImuSample { gyro, accel, mag: [1, 2, 3], gyro_temperature: 2510, accel_temperature: 2490 }
    }

    /// North, east and up in module axes: axis `k` is vertical with sign `s`, the next one has the heading.
    fn attitude(k: usize, s: f64, heading_deg: f64) -> [Vector3<f64>; 3] {
        let (sin, cos) = heading_deg.to_radians().sin_cos();
        // Module axes in north, east, up; north x east is down.
        let vertical = Vector3::new(0.0, 0.0, s);
        let next = Vector3::new(cos, sin, 0.0);
        // Right-handed in north, east, up, which is a left-handed triple: the product changes its sign.
        let third = -vertical.cross(&next);
        let mut axes = [Vector3::zeros(); 3];
        axes[k] = vertical;
        axes[(k + 1) % 3] = next;
        axes[(k + 2) % 3] = third;
        [0, 1, 2].map(|c| Vector3::from_fn(|i, _| axes[i][c]))
    }

    /// Still with an axis up (`x+`, `z-`).
    pub(super) fn still(
        &mut self,
        label: &str,
        series: u32,
        axis: &str,
        heading_deg: f64,
        span_s: f64,
        rate_hz: u16,
    ) -> Capture {
        let k = usize::from(axis.as_bytes()[0] - b'x');
        let s = if axis.ends_with('+') { 1.0 } else { -1.0 };
        let mut up = [0.0; 3];
        up[k] = s;
        let frame = Self::attitude(k, s, heading_deg + self.heading_error_deg);
        self.lying(label, series, up, heading_deg, frame, Vector3::zeros(), span_s, rate_hz)
    }

    /// Still and a little tilted, or turning slowly.
    #[allow(clippy::too_many_arguments, reason = "a test's hand")]
    pub(super) fn lying(
        &mut self,
        label: &str,
        series: u32,
        up: [f64; 3],
        heading_deg: f64,
        [north, east, _]: [Vector3<f64>; 3],
        turning_dps: Vector3<f64>,
        span_s: f64,
        rate_hz: u16,
    ) -> Capture {
        let wrong = Vector3::from_fn(|_, _| self.pose_rad * self.dice.normal());
        let upward = Vector3::from(up);
        let true_up = (upward + wrong.cross(&upward) + north * self.tilt[0] + east * self.tilt[1]).normalize();
        let (sin, cos) = LATITUDE_DEG.to_radians().sin_cos();
        let seat = Rotation3::from_scaled_axis(self.mounting);
        let rate_dps = seat * ((north * cos + upward * sin) * EARTH_DPH / 3600.0 + turning_dps);
        let force_g = seat * true_up * GRAVITY / 9.80665;
        let n = (span_s * f64::from(rate_hz)).round() as usize;
        let samples = (0..n).map(|_| self.sample(&force_g, &rate_dps, 1.0 / f64::from(rate_hz))).collect();
        capture(label, series, Pose::Still { up, heading_deg }, rate_hz, samples)
    }

    /// One second of rest, a turn about an axis that points up, rest.
    pub(super) fn turn(&mut self, label: &str, series: u32, axis: u8, angle_deg: f64, rate_hz: u16) -> Capture {
        let wrong = Vector3::from_fn(|_, _| self.pose_rad * self.dice.normal());
        self.turn_about(label, series, axis, angle_deg, rate_hz, &wrong)
    }

    /// The same turn with the axis off by `wrong`.
    fn turn_about(
        &mut self,
        label: &str,
        series: u32,
        axis: u8,
        angle_deg: f64,
        rate_hz: u16,
        wrong: &Vector3<f64>,
    ) -> Capture {
        let (before_s, span_s, ramp_s, after_s) = (1.0, 5.0, 0.5, 4.0);
        let dt = 1.0 / f64::from(rate_hz);
        let true_deg = angle_deg * (1.0 + self.angle_error);
        let peak = true_deg / (span_s - ramp_s);
        let turned = |t: f64| {
            let t = (t - before_s).clamp(0.0, span_s);
            let ramp = |t: f64| peak * t * t / (2.0 * ramp_s);
            if t < ramp_s {
                ramp(t)
            } else if t > span_s - ramp_s {
                true_deg - ramp(span_s - t)
            } else {
                peak * (t - ramp_s / 2.0)
            }
        };
        let k = usize::from(axis);
        let mut spin = Vector3::zeros();
        spin[k] = 1.0;
        let spin = (spin + wrong.cross(&spin)).normalize();
        let (sin, cos) = LATITUDE_DEG.to_radians().sin_cos();
        let n = ((before_s + span_s + after_s) / dt).round() as usize;
        let seat = Rotation3::from_scaled_axis(self.mounting);
        let samples = (0..n)
            .map(|i| {
                let (from, to) = (turned(i as f64 * dt), turned((i + 1) as f64 * dt));
                // Right-handed about up is anticlockwise from above, so the heading falls.
                let [north, _, up] = Self::attitude(k, 1.0, -f64::midpoint(from, to));
                let rate = (north * cos + up * sin) * EARTH_DPH / 3600.0 + spin * ((to - from) / dt);
                self.sample(&(seat * up * GRAVITY / 9.80665), &(seat * rate), dt)
            })
            .collect();
        let pose = Pose::Rotating { axis, angle_deg, span_s, along: Along::Up };
        capture(label, series, pose, rate_hz, samples)
    }

    /// Six positions of `dwell_s` each.
    pub(super) fn six(&mut self, prefix: &str, series: u32, dwell_s: f64, rate_hz: u16) -> Vec<Capture> {
        ["x+", "x-", "y+", "y-", "z+", "z-"]
            .iter()
            .map(|axis| self.still(&format!("{prefix}{axis}"), series, axis, 0.0, dwell_s, rate_hz))
            .collect()
    }

    /// Six turns of 1080 deg.
    pub(super) fn turns(&mut self, prefix: &str, series: u32, rate_hz: u16) -> Vec<Capture> {
        let mut captures = Vec::new();
        for axis in 0..3 {
            // The module is laid down once for both directions.
            let wrong = Vector3::from_fn(|_, _| self.pose_rad * self.dice.normal());
            for (sign, angle_deg) in [("+", 1080.0), ("-", -1080.0)] {
                let label = format!("{prefix}{}{sign} rotation", ["x", "y", "z"][usize::from(axis)]);
                captures.push(self.turn_about(&label, series, axis, angle_deg, rate_hz, &wrong));
            }
        }
        captures
    }
}

/// A capture without losses.
pub(super) fn capture(label: &str, series: u32, pose: Pose, rate_hz: u16, samples: Vec<ImuSample>) -> Capture {
    let losses = Losses { received: samples.len() as u32, ..Losses::default() };
    let about = CaptureHead { label: label.to_owned(), series, pose, rate_hz };
    let timing = Timing::even(rate_hz, 1_000_000, samples.len());
    let receiver = ReceiverCapture::default();
    Capture { about, first_us: 1_000_000, samples, compensated: Vec::new(), losses, receiver, timing }
}
