//! Attitude as a function of time. A module is still, or turns about one axis at a rate that is piecewise linear in
//! time. Angles in rad, times in true seconds since the bench was started.

use nalgebra::{Rotation3, Unit, Vector3};

/// One leg of a turn: the rate changes linearly up to the end of the leg.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Leg {
    pub(crate) span_s: f64,
    pub(crate) to_rps: f64,
}

/// Rate over time: from `first_rps` through the legs; the rate of the last leg stays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Profile {
    start_s: f64,
    first_rps: f64,
    legs: [Leg; 3],
}

/// The state of a turn at a moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Turn {
    pub(crate) angle: f64,
    pub(crate) rate_rps: f64,
    pub(crate) acceleration: f64,
}

impl Profile {
    /// A profile without a turn.
    pub(crate) fn still() -> Self {
        Self::steady(0.0, 0.0)
    }

    /// A constant rate forever.
    pub(crate) fn steady(start_s: f64, rate_rps: f64) -> Self {
        Self { start_s, first_rps: rate_rps, legs: [Leg { span_s: 0.0, to_rps: rate_rps }; 3] }
    }

    /// A turn by `angle` in `span_s`, from rest to rest. The ramps up and down take the part `ramp` of the span each.
    pub(crate) fn trapezoid(start_s: f64, angle: f64, span_s: f64, ramp: f64) -> Self {
        let peak_rps = angle / (span_s * (1.0 - ramp));
        let leg = |share, to_rps| Leg { span_s: share * span_s, to_rps };
        Self { start_s, first_rps: 0.0, legs: [leg(ramp, peak_rps), leg(1.0 - 2.0 * ramp, peak_rps), leg(ramp, 0.0)] }
    }

    /// A change from one rate to another, which stays.
    pub(crate) fn ramp(start_s: f64, from_rps: f64, to_rps: f64, acceleration: f64) -> Self {
        let span_s = (to_rps - from_rps).abs() / acceleration;
        let rest = Leg { span_s: 0.0, to_rps };
        Self { start_s, first_rps: from_rps, legs: [Leg { span_s, to_rps }, rest, rest] }
    }

    /// The time at which the turn has ended; `None` if it never does.
    pub(crate) fn end_s(&self) -> Option<f64> {
        let [.., last] = self.legs;
        (last.to_rps == 0.0).then(|| self.start_s + self.legs.iter().map(|leg| leg.span_s).sum::<f64>())
    }

    /// The state of the turn at `now_s`; before its start, the state at the start.
    pub(crate) fn at(&self, now_s: f64) -> Turn {
        let mut left_s = (now_s - self.start_s).max(0.0);
        let (mut angle, mut rate_rps) = (0.0, self.first_rps);
        for leg in &self.legs {
            if left_s < leg.span_s {
                let acceleration = (leg.to_rps - rate_rps) / leg.span_s;
                angle += (rate_rps + 0.5 * acceleration * left_s) * left_s;
                return Turn { angle, rate_rps: rate_rps + acceleration * left_s, acceleration };
            }
            angle += 0.5 * (rate_rps + leg.to_rps) * leg.span_s;
            left_s -= leg.span_s;
            rate_rps = leg.to_rps;
        }
        Turn { angle: angle + rate_rps * left_s, rate_rps, acceleration: 0.0 }
    }
}

/// Tilt of an axis that wobbles twice in a turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Wobble {
    /// Amplitude of the tilt.
    pub(crate) amplitude: f64,
    /// Angle of the table at the start of the turn.
    pub(crate) from: f64,
}

/// How a module lies and turns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Motion {
    base: Rotation3<f64>,
    axis: Unit<Vector3<f64>>,
    profile: Profile,
    wobble: Wobble,
    /// The vector from the axis of the turn to the sensors, in the module's axes, m.
    lever_m: Vector3<f64>,
}

/// The motion of a module at one moment, in its axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Moment {
    /// Takes components from the local frame into the module's.
    pub(crate) attitude: Rotation3<f64>,
    /// Rate relative to the earth, rad/s.
    pub(crate) rate_rps: Vector3<f64>,
    /// Acceleration of the sensors relative to the earth, m/s^2.
    pub(crate) acceleration: Vector3<f64>,
}

impl Motion {
    /// A still module.
    pub(crate) fn still(base: Rotation3<f64>) -> Self {
        let none = Wobble { amplitude: 0.0, from: 0.0 };
        Self::turning(base, Vector3::z_axis(), Profile::still(), none, Vector3::zeros())
    }

    /// A turn from an attitude about an axis of the module.
    pub(crate) fn turning(
        base: Rotation3<f64>,
        axis: Unit<Vector3<f64>>,
        profile: Profile,
        wobble: Wobble,
        lever_m: Vector3<f64>,
    ) -> Self {
        Self { base, axis, profile, wobble, lever_m }
    }

    /// The time at which it has come to rest; `None` if it never does.
    pub(crate) fn end_s(&self) -> Option<f64> {
        self.profile.end_s()
    }

    /// Whether it is at rest from `now_s` on.
    pub(crate) fn is_still(&self, now_s: f64) -> bool {
        self.end_s().is_some_and(|end_s| end_s <= now_s)
    }

    /// The axis of the turn in the module's axes.
    pub(crate) fn axis(&self) -> Unit<Vector3<f64>> {
        self.axis
    }

    /// The state of the turn.
    pub(crate) fn turn(&self, now_s: f64) -> Turn {
        self.profile.at(now_s)
    }

    pub(crate) fn attitude(&self, now_s: f64) -> Rotation3<f64> {
        self.at(now_s).attitude
    }

    /// The motion of the module at `now_s`.
    pub(crate) fn at(&self, now_s: f64) -> Moment {
        let turn = self.profile.at(now_s);
        // A module that turns by +phi sees the world turn by -phi.
        let turned = Rotation3::from_axis_angle(&self.axis, -turn.angle);
        let mut rate_rps = self.axis.into_inner() * turn.rate_rps;
        let mut attitude = turned * self.base;
        if self.wobble.amplitude != 0.0 {
            let (tilt, tilt_by_angle) = self.tilt(turn.angle);
            attitude = turned * Rotation3::from_scaled_axis(-tilt) * self.base;
            // To first order in the tilt: the second order is 1e-9 of the rate for 5 arc seconds.
            rate_rps += turned * tilt_by_angle * turn.rate_rps;
        }
        let spin = self.axis.into_inner() * turn.rate_rps;
        let swing = self.axis.cross(&self.lever_m) * turn.acceleration;
        let acceleration = swing + spin.cross(&spin.cross(&self.lever_m));
        Moment { attitude, rate_rps, acceleration }
    }

    /// Tilt of the wobbling axis since the turn's start, and its derivative by the angle, in the module's axes as they
    /// were at the start.
    fn tilt(&self, angle: f64) -> (Vector3<f64>, Vector3<f64>) {
        let Wobble { amplitude, from } = self.wobble;
        let any = if self.axis.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() };
        let in_rotor = self.axis.cross(&any).normalize();
        // The tilt is fixed to the stator; the rotor has already turned by `from`.
        let first = Rotation3::from_axis_angle(&self.axis, -from) * in_rotor;
        let second = self.axis.cross(&first);
        let at = |angle: f64| {
            let (sin, cos) = (2.0 * angle).sin_cos();
            (first * cos + second * sin) * amplitude
        };
        let (sin, cos) = (2.0 * (from + angle)).sin_cos();
        let by_angle = (second * cos - first * sin) * (2.0 * amplitude);
        (at(from + angle) - at(from), by_angle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The published rotation, worked out by hand: 1080 deg in 5 s with ramps of 10 % peak at 240 deg/s.
    #[test]
    fn a_trapezoid_turns_by_its_angle_and_peaks_where_it_should() {
        let profile = Profile::trapezoid(10.0, 1080.0, 5.0, 0.1);
        assert_eq!(profile.at(9.0), Turn { angle: 0.0, rate_rps: 0.0, acceleration: 480.0 });
        for (now_s, angle, rate) in [
            (10.25, 15.0, 120.0),
            (10.5, 60.0, 240.0),
            (12.5, 540.0, 240.0),
            (14.75, 1065.0, 120.0),
            (20.0, 1080.0, 0.0),
        ] {
            let turn = profile.at(now_s);
            assert!((turn.angle - angle).abs() < 1e-9 && (turn.rate_rps - rate).abs() < 1e-9, "{now_s}: {turn:?}");
        }
        assert_eq!((profile.at(20.0).rate_rps, profile.end_s()), (0.0, Some(15.0)));
        assert_eq!(Profile::ramp(0.0, 0.0, 3.0, 1.0).end_s(), None);
    }

    /// The rate must agree with the change of attitude: `dA/dt = -[w x] A`, by finite differences, with every error on.
    #[test]
    fn attitude_and_rate_belong_together() {
        let base = Rotation3::from_euler_angles(0.3, -0.2, 1.1);
        let axis = Unit::new_normalize(Vector3::new(0.1, 0.9, -0.3));
        let wobble = Wobble { amplitude: 1e-3, from: 0.7 };
        let profile = Profile::trapezoid(0.0, 19.0, 5.0, 0.1);
        let motion = Motion::turning(base, axis, profile, wobble, Vector3::zeros());
        let step_s = 1e-5;
        for now_s in [0.2, 1.3, 2.9, 4.8] {
            let (before, after) = (motion.attitude(now_s - step_s), motion.attitude(now_s + step_s));
            let by_difference = -(after * before.inverse()).scaled_axis() / (2.0 * step_s);
            let rate_rps = motion.at(now_s).rate_rps;
            assert!((by_difference - rate_rps).norm() < 2e-5, "{now_s}: {by_difference} {rate_rps}");
        }
        assert!((motion.attitude(0.0).matrix() - base.matrix()).norm() < 1e-12);
    }
}
