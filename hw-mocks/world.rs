//! The world around the module: the site, the attitude and motion of the module, the forces on it, and the time.
//!
//! Frames: the local frame is north, west, up (right-handed). The module's axes X, Y, Z are right-handed. The
//! attitude is the rotation that takes a vector's components from the local frame into the module's.

use std::time::Duration;

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

use crate::motion::{Moment, Motion, Profile, Wobble};

/// Earth rate relative to inertial space, rad/s (WGS-84).
pub(crate) const EARTH_RATE_RPS: f64 = 7.292_115e-5;
/// Standard gravity: the unit g, m/s^2 exactly.
pub(crate) const STANDARD_GRAVITY: f64 = 9.806_65;

/// The site of the bench.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrueSite {
    /// Geodetic latitude, north positive.
    pub latitude_deg: f64,
    /// Longitude, east positive.
    pub longitude_deg: f64,
    /// Height above the WGS-84 ellipsoid.
    pub height_m: f64,
    /// Height of the geoid above the ellipsoid, which GNSS sentences subtract.
    pub geoid_m: f64,
    /// Magnetic field north, east and down, in gauss.
    pub field_ned_gauss: [f64; 3],
}

impl Default for TrueSite {
    /// The site that `bench.toml` beside this crate gives as surveyed. The field is that of a place at 34 deg north in
    /// China: 0.535 gauss, 53 deg inclination, 3.5 deg west declination.
    fn default() -> Self {
        Self {
            latitude_deg: 34.2321,
            longitude_deg: 108.9154,
            height_m: 412.0,
            geoid_m: -28.5,
            field_ned_gauss: [0.323, -0.0195, 0.424],
        }
    }
}

impl TrueSite {
    /// WGS-84 normal gravity, m/s^2: Somigliana's formula on the ellipsoid and the second-order height reduction
    /// (NIMA TR8350.2, equations 4-1 and 4-3).
    #[must_use]
    pub fn gravity(&self) -> f64 {
        const EQUATOR: f64 = 9.780_325_335_9;
        const K: f64 = 0.001_931_852_652_41;
        const E2: f64 = 6.694_379_990_14e-3;
        const A_M: f64 = 6_378_137.0;
        const F: f64 = 1.0 / 298.257_223_563;
        const M: f64 = 0.003_449_786_506_84;
        let sin2 = self.latitude_deg.to_radians().sin().powi(2);
        let surface = EQUATOR * (1.0 + K * sin2) / (1.0 - E2 * sin2).sqrt();
        let h = self.height_m / A_M;
        surface * (1.0 - 2.0 * (1.0 + F + M - 2.0 * F * sin2) * h + 3.0 * h * h)
    }

    /// Earth rate in the local frame (north, west, up), rad/s.
    #[must_use]
    pub(crate) fn earth_rate_rps(&self) -> Vector3<f64> {
        let (sin, cos) = self.latitude_deg.to_radians().sin_cos();
        Vector3::new(EARTH_RATE_RPS * cos, 0.0, EARTH_RATE_RPS * sin)
    }

    /// Magnetic field in the local frame (north, west, up), gauss.
    #[must_use]
    pub(crate) fn field_gauss(&self) -> Vector3<f64> {
        let [north, east, down] = self.field_ned_gauss;
        Vector3::new(north, -east, -down)
    }
}

/// An axis of the module.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ModuleAxis {
    /// X.
    X,
    /// Y.
    Y,
    /// Z.
    Z,
}

impl ModuleAxis {
    /// All three, in order.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// The index: 0, 1 or 2.
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }

    /// The unit vector.
    #[must_use]
    pub(crate) fn unit(self) -> Vector3<f64> {
        Vector3::ith(self.index(), 1.0)
    }

    /// The next axis in the order X, Y, Z, X.
    #[must_use]
    pub fn next(self) -> Self {
        Self::ALL[(self.index() + 1) % 3]
    }
}

/// The two senses of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sign {
    /// Along the axis.
    Plus,
    /// Against it.
    Minus,
}

impl Sign {
    /// +1 or -1.
    #[must_use]
    pub fn factor(self) -> f64 {
        match self {
            Self::Plus => 1.0,
            Self::Minus => -1.0,
        }
    }
}

/// Attitude of a still module: `up` with its sign points up, and the next axis (X for Z up, Y for X, Z for Y) points at
/// `heading_deg`, clockwise from north.
#[must_use]
pub fn attitude(up: ModuleAxis, sign: Sign, heading_deg: f64) -> Rotation3<f64> {
    let (sin, cos) = heading_deg.to_radians().sin_cos();
    let reference = Vector3::new(cos, -sin, 0.0);
    let vertical = Vector3::z() * sign.factor();
    // The third axis completes the right-handed set: up x reference, since reference follows up.
    let third = vertical.cross(&reference);
    let mut rows = [Vector3::zeros(); 3];
    rows[up.index()] = vertical;
    rows[up.next().index()] = reference;
    rows[up.next().next().index()] = third;
    let matrix = Matrix3::from_rows(&[rows[0].transpose(), rows[1].transpose(), rows[2].transpose()]);
    Rotation3::from_matrix_unchecked(matrix)
}

/// What acts on the module at one moment, in its axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Influence {
    /// Angular rate relative to inertial space, rad/s.
    pub rate_rps: Vector3<f64>,
    /// Specific force, m/s^2; +g on the axis that points up at rest.
    pub force: Vector3<f64>,
    /// Magnetic field, gauss.
    pub field_gauss: Vector3<f64>,
    /// Temperature of the module, degC.
    pub temperature_c: f64,
}

/// How a module warms up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeatModel {
    /// Temperature of the room; that of the bench if not given.
    pub room_c: Option<f64>,
    /// Rise above the room under power.
    pub rise_k: f64,
    /// Time constant.
    pub warm_up_s: f64,
}

impl Default for HeatModel {
    fn default() -> Self {
        Self { room_c: None, rise_k: 5.0, warm_up_s: 180.0 }
    }
}

/// The world. Its time is true time since the bench was started.
#[derive(Debug, Clone)]
pub struct World {
    /// The place.
    pub site: TrueSite,
    /// UTC at the start of the bench, seconds since 1970 without leap seconds.
    pub utc_start_s: f64,
    /// Field of the fixture itself, which turns with the module: in its axes, gauss.
    pub fixture_field_gauss: Vector3<f64>,
    /// The ambient field swings by this part of itself, as lifts and trams move.
    pub field_swing: f64,
    /// Temperature of the room, degC.
    pub ambient_c: f64,
    /// Rise of the module's temperature under power, K.
    pub rise_k: f64,
    /// Time constant of that rise, s.
    pub warm_up_s: f64,
    up: ModuleAxis,
    sign: Sign,
    heading_deg: f64,
    pub(crate) motion: Motion,
    powered_s: Option<f64>,
    temperature_c: f64,
    temperature_at_s: f64,
}

impl World {
    /// A cold, still module with Z up and X to the north.
    #[must_use]
    pub fn new(site: TrueSite, utc_start: Duration, ambient_c: f64) -> Self {
        Self {
            site,
            utc_start_s: utc_start.as_secs_f64(),
            fixture_field_gauss: Vector3::zeros(),
            field_swing: 0.0,
            ambient_c,
            rise_k: HeatModel::default().rise_k,
            warm_up_s: HeatModel::default().warm_up_s,
            up: ModuleAxis::Z,
            sign: Sign::Plus,
            heading_deg: 0.0,
            motion: Motion::still(attitude(ModuleAxis::Z, Sign::Plus, 0.0)),
            powered_s: None,
            temperature_c: ambient_c,
            temperature_at_s: 0.0,
        }
    }

    /// The axis that points up or down, as it was laid down by hand.
    #[must_use]
    pub(crate) fn up(&self) -> ModuleAxis {
        self.up
    }

    /// Lays the module down so that `up` points up, keeps the heading, and ends any turning.
    pub(crate) fn set_axis_up(&mut self, up: ModuleAxis, sign: Sign) {
        (self.up, self.sign) = (up, sign);
        self.lay();
    }

    /// Points the reference axis at `heading_deg` and ends any turning.
    pub fn set_heading_deg(&mut self, heading_deg: f64) {
        self.heading_deg = heading_deg;
        self.lay();
    }

    /// Turns the module steadily about one of its own axes, starting at its present attitude.
    pub fn set_turn(&mut self, axis: ModuleAxis, rate_dps: f64, now_s: f64) {
        let none = Wobble { amplitude: 0.0, from: 0.0 };
        let profile = Profile::steady(now_s, rate_dps.to_radians());
        let axis = Unit::new_unchecked(axis.unit());
        self.motion = Motion::turning(self.attitude(now_s), axis, profile, none, Vector3::zeros());
    }

    fn lay(&mut self) {
        self.motion = Motion::still(attitude(self.up, self.sign, self.heading_deg));
    }

    /// The rotation from the local frame into the module's.
    #[must_use]
    pub(crate) fn attitude(&self, now_s: f64) -> Rotation3<f64> {
        self.motion.attitude(now_s)
    }

    /// Switches the module's supply: its temperature follows.
    pub(crate) fn set_powered(&mut self, powered: bool, now_s: f64) {
        self.temperature_c = self.temperature_c(now_s);
        self.temperature_at_s = now_s;
        self.powered_s = powered.then_some(now_s);
    }

    /// Temperature of the module: a first-order lag towards the room temperature, with the module's own heat if it has
    /// power.
    #[must_use]
    pub(crate) fn temperature_c(&self, now_s: f64) -> f64 {
        let target = self.ambient_c + if self.powered_s.is_some() { self.rise_k } else { 0.0 };
        let span_s = (now_s - self.temperature_at_s).max(0.0);
        target + (self.temperature_c - target) * (-span_s / self.warm_up_s).exp()
    }

    /// UTC, seconds since 1970.
    #[must_use]
    pub(crate) fn utc_s(&self, now_s: f64) -> f64 {
        self.utc_start_s + now_s
    }

    /// The field around the module in the local frame, gauss. It changes in steps of a second, so that a still module
    /// has the same input from sample to sample.
    fn ambient_field_gauss(&self, now_s: f64) -> Vector3<f64> {
        const PERIOD_S: f64 = 1000.0;
        let swing = if self.field_swing == 0.0 {
            0.0
        } else {
            self.field_swing * (now_s.floor() / PERIOD_S * std::f64::consts::TAU).sin()
        };
        self.site.field_gauss() * (1.0 + swing)
    }

    /// What acts on the module.
    #[must_use]
    pub fn influence(&self, now_s: f64) -> Influence {
        let Moment { attitude, rate_rps, acceleration } = self.motion.at(now_s);
        Influence {
            rate_rps: attitude * self.site.earth_rate_rps() + rate_rps,
            force: attitude * Vector3::new(0.0, 0.0, self.site.gravity()) + acceleration,
            field_gauss: attitude * self.ambient_field_gauss(now_s) + self.fixture_field_gauss,
            temperature_c: self.temperature_c(now_s),
        }
    }
}
