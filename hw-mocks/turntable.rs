//! The simulated turntable: how a table with errors follows the commands to orient, rotate, spin or stop.
//!
//! # How it stands
//! The table's axis can be set up, to the north or parallel to the earth's axis, and the socket can be put on it in any
//! attitude. Each of these has errors, and [`TableModel`] gives their size. For an ideal attitude `A` (local frame into
//! module) the module really lies at `M E A T`. `T` is the alignment of the axis and of its heading, constant all the
//! time. `E` is the error of this orientation (the same whenever it is taken up again) and its repeatability (new each
//! time). `M` is the mounting of the socket. The table turns about its own true axis, so the module sees the turn along
//! `M E` times the commanded axis.
//!
//! # How it moves
//! - Orienting takes `slew_s`: the shortest turn from attitude to attitude, from rest to rest.
//! - A rotation has a trapezoidal rate: ramps of [`TableModel::ramp_share`] of the span at both ends, a tenth, so that 1080 deg in 5 s go up
//!   to 240 deg/s in 0.5 s and down again. It turns by `angle (1 + angle_error_ppm)` and a new error of
//!   `angle_error_arcsec`.
//! - A spin ramps at [`ACCELERATION_DPS2`] to `rate (1 + rate_error_ppm)` and stays there.
//! - A stop ramps down at [`STOP_DPS2`] from any motion. After a stop amid orienting the table must be oriented anew.

use gnc_rig::Along;
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

use crate::motion::{Motion, Profile, Wobble};
use crate::noise::{Dice, RandomStream};
use crate::world::{ModuleAxis, Sign, World};

/// Acceleration of a spin: 5400 deg/s are reached in 3.6 s.
pub(crate) const ACCELERATION_DPS2: f64 = 1500.0;
/// Deceleration of a stop: 5400 deg/s end in 1.8 s.
pub(crate) const STOP_DPS2: f64 = 3000.0;
/// Fastest rate of the table: 15 rev/s and a third more.
pub(crate) const FASTEST_DPS: f64 = 7200.0;
/// Longest rotation: a day. A longer one means a wrong unit.
pub(crate) const LONGEST_S: f64 = 86_400.0;

/// The errors of a table. The defaults are those of a good position table with a socket screwed on by hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableModel {
    /// Tilt of the axis: towards the reference direction (north for [`Along::Up`], else up in the meridian), and to
    /// the left of it.
    pub axis_error_arcsec: [f64; 2],
    /// Error of the heading's zero, about the axis, clockwise.
    pub heading_error_arcsec: f64,
    /// The socket on the table: rotation vector from the plate's axes to the module's, in the module's axes.
    pub mounting_deg: [f64; 3],
    /// Deviation about each axis of the orientation's repeatable error.
    pub attitude_error_arcsec: f64,
    /// Deviation about each axis of the error that is new each time.
    pub repeatability_arcsec: f64,
    /// Relative error of the angle of all rotations, positive if too far.
    pub angle_error_ppm: f64,
    /// Deviation of a rotation's angle, new each time.
    pub angle_error_arcsec: f64,
    /// Relative error of the rate of all spins, positive if too fast.
    pub rate_error_ppm: f64,
    /// Amplitude of the axis's tilt, with two periods a turn.
    pub wobble_arcsec: f64,
    /// Field of the fixture at the magnetometer, in the module's axes: it turns with the module.
    pub field_mgauss: [f64; 3],
    /// The field around the table swings by this part of itself, with a period of 1000 s.
    pub field_swing_ppm: f64,
    /// The vector from the axis to the sensors, in the module's axes.
    pub lever_arm_mm: [f64; 3],
    /// Time that orienting takes; 0: at once.
    pub slew_s: f64,
    /// Part of a rotation's span for each of its two ramps. At 0.5 there is no steady rate between them, and the rate
    /// peaks at twice its mean.
    pub ramp_share: f64,
}

impl Default for TableModel {
    fn default() -> Self {
        Self {
            axis_error_arcsec: [6.0, -4.0],
            heading_error_arcsec: 60.0,
            mounting_deg: [0.012, -0.018, 0.015],
            attitude_error_arcsec: 4.0,
            repeatability_arcsec: 2.0,
            angle_error_ppm: 5.0,
            angle_error_arcsec: 2.0,
            rate_error_ppm: 20.0,
            wobble_arcsec: 2.0,
            field_mgauss: [0.15, -0.1, 0.2],
            field_swing_ppm: 150.0,
            lever_arm_mm: [3.0, -2.0, 4.0],
            slew_s: 6.0,
            ramp_share: 0.1,
        }
    }
}

/// Why the table refuses a command.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TableRefusal {
    /// The table moves.
    #[error("the turntable is moving; stop it first")]
    Moving,
    /// The table spins, so a wait would never end.
    #[error("the turntable spins without end; stop it first")]
    Spinning,
    /// A stop left it between two orientations.
    #[error("the turntable was stopped between two orientations; orient it first")]
    NotOriented,
    /// The direction is zero or not finite.
    #[error("({x}, {y}, {z}) is not a direction", x = up[0], y = up[1], z = up[2])]
    NoDirection {
        /// The given direction.
        up: [f64; 3],
    },
    /// The number is not finite.
    #[error("the {what} must be a finite number, not {value}")]
    NoNumber {
        /// The quantity that it should be.
        what: &'static str,
        /// The given value.
        value: f64,
    },
    /// A span outside its bounds.
    #[error("a span of {span_s} s is not in 0.001 to {LONGEST_S} s")]
    Span {
        /// The given span.
        span_s: f64,
    },
    /// The rate is faster than the table can turn.
    #[error("the turntable turns at up to {FASTEST_DPS} deg/s, but {rate_dps} deg/s are needed")]
    TooFast {
        /// Peak rate of the command.
        rate_dps: f64,
    },
}

/// The true state of the table, for tests.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableTruth {
    /// Its errors.
    pub model: TableModel,
    /// Whether it moves.
    pub moving: bool,
    /// Its axis in the local frame (north, west, up).
    pub axis_local: Vector3<f64>,
    /// Its axis in the module's axes.
    pub axis_module: Vector3<f64>,
    /// Rate about that axis, deg/s.
    pub rate_dps: f64,
    /// The true angle of the last rotation, deg.
    pub rotation_deg: f64,
}

/// A table with a socket on it. Times are true seconds since the bench was started.
#[derive(Debug, Clone)]
pub(crate) struct SimulatedTable {
    model: TableModel,
    seed: u64,
    dice: Dice,
    /// The axis in the module's axes; `None` after a stop amid orienting.
    axis: Option<Unit<Vector3<f64>>>,
    /// The time until which orienting takes.
    slewing_until_s: f64,
    /// Angle of the table at the start of the current motion, rad.
    angle: f64,
    /// Whether the current or last motion is a turn of the table.
    turning: bool,
    rotation_deg: f64,
}

fn arcsec(value: f64) -> f64 {
    (value / 3600.0).to_radians()
}

impl SimulatedTable {
    /// A table under a seed, the module on it with Z up.
    #[must_use]
    pub(crate) fn new(model: TableModel, seed: u64) -> Self {
        let dice = Dice::new(seed, RandomStream::Table);
        let axis = Some(Vector3::z_axis());
        Self { model, seed, dice, axis, slewing_until_s: 0.0, angle: 0.0, turning: false, rotation_deg: 0.0 }
    }

    /// Takes note that the module was laid down by hand: the table's axis is along this one.
    pub(crate) fn laid(&mut self, axis: ModuleAxis) {
        self.axis = Some(Unit::new_unchecked(axis.unit()));
        (self.slewing_until_s, self.turning) = (0.0, false);
    }

    /// Begins to point an axis of the module along a direction.
    ///
    /// # Errors
    /// [`TableRefusal`] if the table moves, or the heading is not a number.
    pub(crate) fn orient(
        &mut self,
        world: &mut World,
        along: Along,
        (axis, sign): (ModuleAxis, Sign),
        heading_deg: f64,
        now_s: f64,
    ) -> Result<(), TableRefusal> {
        self.take_up(world, along, (axis.unit() * sign.factor(), axis), axis.unit(), heading_deg, now_s)
    }

    /// Begins to lay the module so that `up` (module axes, any length) points up. The axis nearest to `up` counts (the
    /// first of equals). The axis after it points at the heading as nearly as possible, and turns are right-handed
    /// about the positive end of the nearest axis. For `up` along an axis all this is as with
    /// [`SimulatedTable::orient`].
    ///
    /// # Errors
    /// [`TableRefusal`] if the table moves, or there is no such direction or heading.
    pub(crate) fn orient_up(
        &mut self,
        world: &mut World,
        up: [f64; 3],
        heading_deg: f64,
        now_s: f64,
    ) -> Result<(), TableRefusal> {
        let given = Vector3::from(up);
        let length = given.norm();
        if !(length.is_finite() && length > 1e-6) {
            return Err(TableRefusal::NoDirection { up });
        }
        let unit = given / length;
        // The first of equals, so that the choice does not depend on the last bit.
        let nearest = ModuleAxis::ALL.into_iter().fold(ModuleAxis::X, |best, axis| {
            if unit[axis.index()].abs() > unit[best.index()].abs() + 1e-9 { axis } else { best }
        });
        let sense = if unit[nearest.index()] < 0.0 { -1.0 } else { 1.0 };
        self.take_up(world, Along::Up, (unit, nearest), unit * sense, heading_deg, now_s)
    }

    /// Begins a rotation by an angle within a span, from rest to rest, right-handed about the module's axis.
    ///
    /// # Errors
    /// [`TableRefusal`] if the table moves, was left between two orientations, or cannot turn so fast.
    pub(crate) fn rotate(
        &mut self,
        world: &mut World,
        angle_deg: f64,
        span_s: f64,
        now_s: f64,
    ) -> Result<(), TableRefusal> {
        finite("angle", angle_deg)?;
        if !(0.001..=LONGEST_S).contains(&span_s) {
            return Err(TableRefusal::Span { span_s });
        }
        fast_enough(angle_deg / (span_s * (1.0 - self.model.ramp_share)))?;
        self.at_rest(world, now_s)?;
        let axis = self.axis.ok_or(TableRefusal::NotOriented)?;
        let error_deg = self.model.angle_error_arcsec / 3600.0 * self.dice.normal();
        self.rotation_deg = angle_deg * (1.0 + self.model.angle_error_ppm * 1e-6) + error_deg;
        let profile = Profile::trapezoid(now_s, self.rotation_deg.to_radians(), span_s, self.model.ramp_share);
        self.turn(world, axis, profile, now_s);
        Ok(())
    }

    /// Begins to spin, right-handed about the module's axis, starting at its present rate.
    ///
    /// # Errors
    /// [`TableRefusal`] while the table is oriented, if it was left between two orientations, or if it cannot turn so
    /// fast.
    pub(crate) fn spin(&mut self, world: &mut World, rate_dps: f64, now_s: f64) -> Result<(), TableRefusal> {
        finite("rate", rate_dps)?;
        fast_enough(rate_dps)?;
        if self.is_slewing(now_s) {
            return Err(TableRefusal::Moving);
        }
        let axis = self.axis.ok_or(TableRefusal::NotOriented)?;
        let true_rps = (rate_dps * (1.0 + self.model.rate_error_ppm * 1e-6)).to_radians();
        let from_rps = world.motion.turn(now_s).rate_rps;
        let profile = Profile::ramp(now_s, from_rps, true_rps, ACCELERATION_DPS2.to_radians());
        self.turn(world, axis, profile, now_s);
        Ok(())
    }

    /// Begins to stop any motion.
    pub(crate) fn stop(&mut self, world: &mut World, now_s: f64) {
        if world.motion.is_still(now_s) {
            return;
        }
        if self.is_slewing(now_s) {
            self.axis = None;
        }
        let from_rps = world.motion.turn(now_s).rate_rps;
        let profile = Profile::ramp(now_s, from_rps, 0.0, STOP_DPS2.to_radians());
        self.turn(world, world.motion.axis(), profile, now_s);
        self.slewing_until_s = 0.0;
    }

    /// The true state.
    #[must_use]
    pub(crate) fn truth(&self, world: &World, now_s: f64) -> TableTruth {
        let attitude = world.motion.attitude(now_s);
        let axis = self.axis.unwrap_or_else(|| world.motion.axis()).into_inner();
        TableTruth {
            model: self.model,
            moving: !world.motion.is_still(now_s),
            axis_local: attitude.inverse() * axis,
            axis_module: axis,
            rate_dps: world.motion.turn(now_s).rate_rps.to_degrees(),
            rotation_deg: self.rotation_deg,
        }
    }

    fn is_slewing(&self, now_s: f64) -> bool {
        now_s < self.slewing_until_s
    }

    fn at_rest(&self, world: &World, now_s: f64) -> Result<(), TableRefusal> {
        if world.motion.is_still(now_s) { Ok(()) } else { Err(TableRefusal::Moving) }
    }

    /// Begins the motion in which `module` goes along the direction, and the axis after `nearest` at the heading; later
    /// turns are about the axis `about`.
    fn take_up(
        &mut self,
        world: &mut World,
        along: Along,
        (module, nearest): (Vector3<f64>, ModuleAxis),
        about: Vector3<f64>,
        heading_deg: f64,
        now_s: f64,
    ) -> Result<(), TableRefusal> {
        finite("heading", heading_deg)?;
        self.at_rest(world, now_s)?;
        let from = world.motion.attitude(now_s);
        let (direction, zero) = frame(along, world.site.latitude_deg);
        let [towards, left] = self.model.axis_error_arcsec.map(arcsec);
        // A small tilt towards `zero` is a turn about `direction x zero`.
        let west = direction.cross(&zero);
        let tilt = west * towards - zero * left - direction * arcsec(self.model.heading_error_arcsec);
        let reference = rotate_clockwise(zero, direction, heading_deg);
        let ideal = point(module, nearest, direction, reference);
        let seat = self.seat(along, &ideal);
        let target = seat * ideal * Rotation3::from_scaled_axis(tilt).inverse();
        let slew = (target * from.inverse()).scaled_axis();
        let (axis, angle) = Unit::try_new_and_get(-slew, 1e-12).unwrap_or((Vector3::z_axis(), 0.0));
        let span_s = self.model.slew_s;
        self.axis = Some(Unit::new_normalize(seat * about));
        (self.angle, self.turning) = (0.0, false);
        if angle == 0.0 || span_s <= 0.0 {
            world.motion = Motion::still(target);
        } else {
            let profile = Profile::trapezoid(now_s, angle, span_s, 0.5);
            let still = Wobble { amplitude: 0.0, from: 0.0 };
            world.motion = Motion::turning(from, axis, profile, still, self.lever_m());
            self.slewing_until_s = now_s + span_s;
        }
        Ok(())
    }

    /// The socket on the plate in this orientation: `M E`.
    fn seat(&mut self, along: Along, ideal: &Rotation3<f64>) -> Rotation3<f64> {
        // The same orientation has the same error: its dice are seeded by the orientation.
        let key = ideal.matrix().iter().fold(0xcbf2_9ce4_8422_2325 ^ along as u64, |hash: u64, component| {
            (hash ^ ((component * 1e4).round() as i64).cast_unsigned()).wrapping_mul(0x0100_0000_01b3)
        });
        let mut fixed = Dice::new(self.seed ^ key, RandomStream::TablePosition);
        let small = |deviation: f64, dice: &mut Dice| Vector3::from_fn(|_, _| arcsec(deviation) * dice.normal());
        let error = small(self.model.attitude_error_arcsec, &mut fixed)
            + small(self.model.repeatability_arcsec, &mut self.dice);
        let mounting = Vector3::from(self.model.mounting_deg).map(f64::to_radians);
        Rotation3::from_scaled_axis(mounting) * Rotation3::from_scaled_axis(error)
    }

    fn turn(&mut self, world: &mut World, axis: Unit<Vector3<f64>>, profile: Profile, now_s: f64) {
        let base = world.motion.attitude(now_s);
        // Kept within one turn, so that it stays exact for any length of spin.
        if std::mem::replace(&mut self.turning, true) {
            self.angle = (self.angle + world.motion.turn(now_s).angle).rem_euclid(std::f64::consts::TAU);
        }
        let amplitude = if self.is_slewing(now_s) { 0.0 } else { arcsec(self.model.wobble_arcsec) };
        let wobble = Wobble { amplitude, from: self.angle };
        world.motion = Motion::turning(base, axis, profile, wobble, self.lever_m());
    }

    fn lever_m(&self) -> Vector3<f64> {
        Vector3::from(self.model.lever_arm_mm) * 1e-3
    }
}

fn finite(what: &'static str, value: f64) -> Result<(), TableRefusal> {
    if value.is_finite() { Ok(()) } else { Err(TableRefusal::NoNumber { what, value }) }
}

fn fast_enough(rate_dps: f64) -> Result<(), TableRefusal> {
    if rate_dps.abs() <= FASTEST_DPS { Ok(()) } else { Err(TableRefusal::TooFast { rate_dps }) }
}

/// The direction and the zero of its headings, in the local frame (north, west, up).
fn frame(along: Along, latitude_deg: f64) -> (Vector3<f64>, Vector3<f64>) {
    let (sin, cos) = latitude_deg.to_radians().sin_cos();
    match along {
        Along::Up => (Vector3::z(), Vector3::x()),
        Along::North => (Vector3::x(), Vector3::z()),
        Along::Polar => (Vector3::new(cos, 0.0, sin), Vector3::new(-sin, 0.0, cos)),
    }
}

fn rotate_clockwise(zero: Vector3<f64>, about: Vector3<f64>, angle_deg: f64) -> Vector3<f64> {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    zero * cos - about.cross(&zero) * sin
}

/// The attitude in which `module` points along `direction`, and the axis after `nearest` points at `reference` as
/// nearly as possible.
fn point(
    module: Vector3<f64>,
    nearest: ModuleAxis,
    direction: Vector3<f64>,
    reference: Vector3<f64>,
) -> Rotation3<f64> {
    let next = nearest.next().unit();
    // Not parallel to `module`, since `nearest` is the largest component of it.
    let across = (next - module * next.dot(&module)).normalize();
    let in_module = Matrix3::from_columns(&[module, across, module.cross(&across)]);
    let in_local = Matrix3::from_columns(&[direction, reference, direction.cross(&reference)]);
    Rotation3::from_matrix_unchecked(in_module * in_local.transpose())
}
