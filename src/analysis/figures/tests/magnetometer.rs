//! Spins in the earth's field, and attitudes over the sphere.

use gnc_protocol::stream::ImuSample;
use gnc_rig::Along;
use nalgebra::{Matrix3, Vector3};

use super::world::{Dice, capture};
use super::*;
use crate::capture::Pose;

/// A magnetometer in its plane of rotation, gauss.
#[derive(Clone, Copy)]
struct Plane {
    radius: f64,
    dx: f64,
    dy: f64,
    ky: f64,
    alpha_deg: f64,
    /// Delay of the samples of Y after X.
    skew_s: f64,
    noise: f64,
}

const PLANE: Plane =
    Plane { radius: 0.32, dx: 0.02, dy: -0.014, ky: 1.03, alpha_deg: 1.5, skew_s: 0.0, noise: 60e-6 * 2.24 };

impl Plane {
    /// A module that turns right-handed about Z: the field turns in the opposite direction in its axes.
    fn spin(&self, label: &str, rate_dps: f64, span_s: f64, dice: &mut Dice) -> Capture {
        let (sin_alpha, cos_alpha) = self.alpha_deg.to_radians().sin_cos();
        let at = |t: f64| {
            let (sin, cos) = (rate_dps.to_radians() * t).sin_cos();
            (self.radius * cos, -self.radius * sin)
        };
        let code = |gauss: f64| (gauss * 1_250_000.0).round() as i32;
        let samples = (0..(span_s * 1000.0) as usize)
            .map(|k| {
                let t = k as f64 / 1000.0;
                let (x, y) = at(t);
                let later = at(t + self.skew_s).1;
                let raw_x = self.dx + x * cos_alpha + y * sin_alpha + self.noise * dice.normal();
                let raw_y = self.dy + later / self.ky + self.noise * dice.normal();
                // The gyroscopes are beyond their range here, which is expected.
                ImuSample { gyro: [0, 0, 8_388_607], mag: [code(raw_x), code(raw_y), 0], ..ImuSample::default() }
            })
            .collect();
        capture(label, 1, Pose::Spinning { axis: 2, rate_dps, along: Along::North }, 1000, samples)
    }

    fn all(&self, dice: &mut Dice) -> Vec<Capture> {
        [("spin +", 5400.0), ("spin -", -5400.0), ("slow spin +", 1800.0), ("slow spin -", -1800.0)]
            .map(|(label, rate_dps)| self.spin(label, rate_dps, 10.0, dice))
            .into()
    }
}

#[test]
fn the_ellipse_is_found_and_corrected() {
    let mut dice = Dice::new(31);
    let found = ask(ItemId::MagnetometerEllipse, "", &PLANE.all(&mut dice), &[]).unwrap();
    complete(ItemId::MagnetometerEllipse, &params(ItemId::MagnetometerEllipse, ""), &found);
    close(&found, "zero_x", PLANE.dx, 5e-5);
    close(&found, "zero_y", PLANE.dy, 5e-5);
    close(&found, "sensitivity_ratio", PLANE.ky * 100.0, 0.02);
    close(&found, "alpha", PLANE.alpha_deg, 0.01);
    close(&found, "radius", PLANE.radius, 5e-5);
    let roll = |name: &str| figure(&found, name).0;
    assert!(
        roll("roll_error_1") < 0.002 && roll("roll_error_2") < 0.002,
        "{} {}",
        roll("roll_error_1"),
        roll("roll_error_2")
    );
    let skew = figure(&found, "skew");
    assert!(skew.0.abs() <= 2.0 * skew.2.expanded().unwrap() && skew.2.expanded().unwrap() < 2.0, "{skew:?}");
    // The print's figures stand beside it: extremes are noisier, and a second harmonic of alpha^2 / 4 stays.
    let printed = &found.details["spins"][0]["as_printed"];
    let second = printed["roll_harmonics_deg"][1].as_f64().unwrap();
    assert!(second > 5.0 * roll("roll_error_2"), "{printed}");
    assert!(matches!(value_of(&found, "lag"), Some(Value::NotAvailable(_))));
    // The points kept for the picture lie on the true circle after the true correction.
    for field in found.details["field"].as_array().unwrap() {
        let numbers =
            |key: &str| -> Vec<f64> { field[key].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect() };
        let (x, y) = (numbers("x_gauss"), numbers("y_gauss"));
        assert!((100..=400).contains(&x.len()), "{} points", x.len());
        let alpha = PLANE.alpha_deg.to_radians();
        for (x, y) in x.into_iter().zip(y) {
            let y = PLANE.ky * (y - PLANE.dy);
            let x = ((x - PLANE.dx) - y * alpha.sin()) / alpha.cos();
            assert!((x.hypot(y) - PLANE.radius).abs() < 7.0 * PLANE.noise, "{x} {y}");
        }
    }
    let mag = ModuleCalibration::of(&[("ellipse".into(), found)]).unwrap().mag.unwrap();
    assert!((mag.ky - PLANE.ky).abs() < 1e-4 && (mag.sin_alpha - PLANE.alpha_deg.to_radians().sin()).abs() < 2e-4);
}

/// 100 us of skew look like 0.54 deg of alpha at 15 turns a second. Both directions and two speeds separate them.
#[test]
fn skew_is_no_alpha() {
    let skewed = Plane { skew_s: 100e-6, ..PLANE };
    let mut dice = Dice::new(32);
    let spins = skewed.all(&mut dice);
    let found = ask(ItemId::MagnetometerEllipse, "", &spins, &[]).unwrap();
    close(&found, "alpha", PLANE.alpha_deg, 0.02);
    close(&found, "skew", 100.0, 5.0);
    let apparent = |k: usize| found.details["spins"][k]["alpha_deg"].as_f64().unwrap();
    assert!((apparent(0) - PLANE.alpha_deg + 0.54).abs() < 0.01, "{}", apparent(0));
    let alone = ask(ItemId::MagnetometerEllipse, "senses = [\"+\"]", &spins[..1], &[]).unwrap();
    assert!(matches!(value_of(&alone, "skew"), Some(Value::NotAvailable(_))));
    assert!(alone.details["label"].as_str().unwrap().contains("skew in it"));
}

#[test]
fn bad_spins_are_refused() {
    let mut dice = Dice::new(33);
    let refused = |spin: Capture| ask(ItemId::MagnetometerEllipse, "", &[spin], &[]).unwrap_err();
    let short = refused(PLANE.spin("spin +", 720.0, 1.3, &mut Dice::new(1)));
    assert!(matches!(short, FigureError::Refused { refusal: gnc_metrology::Refusal::FewTurns { .. }, .. }), "{short}");
    let mut stopped = PLANE.spin("spin +", 5400.0, 10.0, &mut dice);
    let last = stopped.samples[6000].mag;
    for sample in &mut stopped.samples[6000..] {
        sample.mag = last.map(|code| code + (168.0 * dice.normal()) as i32);
    }
    let error = refused(stopped);
    assert!(matches!(error, FigureError::Unfit { .. } | FigureError::Refused { .. }), "{error}");
    let strong = refused(Plane { radius: 9.0, ..PLANE }.spin_clamped(&mut dice));
    assert!(
        matches!(strong, FigureError::Refused { refusal: gnc_metrology::Refusal::Saturated { .. }, .. }),
        "{strong}"
    );
    let weak = refused(Plane { radius: 0.0001, ..PLANE }.spin("spin +", 5400.0, 10.0, &mut dice));
    assert!(matches!(weak, FigureError::Refused { .. } | FigureError::Unfit { .. }), "{weak}");
    let slow = {
        let mut spin = PLANE.spin("spin +", 5000.0, 10.0, &mut dice);
        spin.about.pose = Pose::Spinning { axis: 2, rate_dps: 5400.0, along: Along::North };
        refused(spin)
    };
    assert!(matches!(slow, FigureError::Unfit { .. }), "{slow}");
}

impl Plane {
    fn spin_clamped(&self, dice: &mut Dice) -> Capture {
        let mut spin = self.spin("spin +", 5400.0, 10.0, dice);
        for sample in &mut spin.samples {
            sample.mag = sample.mag.map(|code| code.clamp(-8_388_608, 8_388_607));
        }
        spin
    }
}

#[test]
fn hard_and_soft_iron_over_the_sphere() {
    let mut dice = Dice::new(34);
    let soft = Matrix3::new(1.012, 0.006, -0.004, 0.006, 0.991, 0.005, -0.004, 0.005, 1.008);
    let hard = Vector3::new(0.02, -0.014, 0.009);
    let field = Vector3::new(0.3, 0.0, -0.4);
    let mut captures = Vec::new();
    for heading_deg in [0.0, 90.0, 180.0, 270.0_f64] {
        for k in 0..3 {
            for s in [1.0, -1.0] {
                // North, east, up of the attitude, written down by hand for each axis.
                let (sin, cos) = heading_deg.to_radians().sin_cos();
                let (vertical, next) = (Vector3::new(0.0, 0.0, s), Vector3::new(cos, -sin, 0.0));
                let third = vertical.cross(&next);
                let mut in_module = Vector3::zeros();
                (in_module[k], in_module[(k + 1) % 3], in_module[(k + 2) % 3]) =
                    (vertical.dot(&field), next.dot(&field), third.dot(&field));
                let raw = soft * in_module + hard;
                let samples = (0..200)
                    .map(|_| ImuSample {
                        mag: raw.map(|gauss| ((gauss + 60e-6 * dice.normal()) * 1.25e6).round() as i32).into(),
                        ..ImuSample::default()
                    })
                    .collect();
                let mut up = [0.0; 3];
                up[k] = s;
                captures.push(capture(
                    &format!("{k} {s} {heading_deg}"),
                    1,
                    Pose::Still { up, heading_deg },
                    100,
                    samples,
                ));
            }
        }
    }
    let text = "dwell = \"2 s\", rate = \"100 Hz\"";
    let found = ask(ItemId::MagnetometerEllipsoid, text, &captures, &[]).unwrap();
    complete(ItemId::MagnetometerEllipsoid, &params(ItemId::MagnetometerEllipsoid, text), &found);
    close(&found, "hard_iron_x", hard[0], 1e-4);
    close(&found, "hard_iron_y", hard[1], 1e-4);
    close(&found, "hard_iron_z", hard[2], 1e-4);
    let truth = soft.try_inverse().unwrap() * soft.determinant().cbrt();
    close(&found, "soft_iron_xx", (truth[(0, 0)] - 1.0) * 1e6, 200.0);
    close(&found, "soft_iron_xy", truth[(0, 1)] * 1e6, 200.0);
    close(&found, "field", 0.5 * soft.determinant().cbrt(), 1e-4);
    assert!((figure(&found, "field_error").0 - (soft.determinant().cbrt() - 1.0) * 100.0).abs() < 0.02);
    let planar: Vec<Capture> = captures.into_iter().filter(|capture| capture.about.label.starts_with("2 1")).collect();
    assert!(matches!(ask(ItemId::MagnetometerEllipsoid, text, &planar, &[]), Err(FigureError::Refused { .. })));
}
