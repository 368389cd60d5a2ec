//! Gravity and rotation of the earth at a place.

use crate::Refusal;

/// Rotation rate of the earth, rad/s (WGS 84): 15.041 deg/h.
pub const EARTH_RATE_RPS: f64 = 7.292_115e-5;

/// Standard gravity, m/s^2, exact by definition: the unit `g`, not the gravity of any place.
pub const STANDARD_GRAVITY_MPS2: f64 = 9.806_65;

/// WGS-84 normal gravity in m/s^2 at a geodetic latitude in degrees and an ellipsoidal height in metres: Somigliana's
/// formula and the second-order height term (NIMA TR8350.2, equations 4-1 and 4-3). The formula leaves out anomalies of
/// tens of ppm, which belong to the uncertainty budget; 100 m of height are 31 ppm.
///
/// # Errors
/// [`Refusal::Parameter`] for a latitude outside +-90 deg or a height outside -500 .. 20,000 m.
pub fn normal_gravity_mps2(latitude_deg: f64, height_m: f64) -> Result<f64, Refusal> {
    const A_M: f64 = 6_378_137.0;
    const FLATTENING: f64 = 1.0 / 298.257_223_563;
    const ECCENTRICITY2: f64 = 6.694_379_990_14e-3;
    const EQUATOR_MPS2: f64 = 9.780_325_335_9;
    const K: f64 = 1.931_852_652_41e-3;
    // omega^2 a^2 b / GM
    const M: f64 = 3.449_786_506_84e-3;
    check_latitude(latitude_deg)?;
    if !(-500.0..=20_000.0).contains(&height_m) {
        return Err(Refusal::Parameter { name: "height (m)", value: height_m, expected: "-500 to 20000" });
    }
    let sin2 = latitude_deg.to_radians().sin().powi(2);
    let surface = EQUATOR_MPS2 * (1.0 + K * sin2) / (1.0 - ECCENTRICITY2 * sin2).sqrt();
    let h = height_m / A_M;
    Ok(surface * (1.0 - 2.0 * (1.0 + FLATTENING + M - 2.0 * FLATTENING * sin2) * h + 3.0 * h * h))
}

/// Component of the earth's rotation along the upward vertical, rad/s (negative in the south).
///
/// # Errors
/// [`Refusal::Parameter`] for a latitude outside +-90 deg.
pub fn vertical_rate_rps(latitude_deg: f64) -> Result<f64, Refusal> {
    check_latitude(latitude_deg)?;
    Ok(EARTH_RATE_RPS * latitude_deg.to_radians().sin())
}

/// Component of the earth's rotation along north, rad/s.
///
/// # Errors
/// [`Refusal::Parameter`] for a latitude outside +-90 deg.
pub fn north_rate_rps(latitude_deg: f64) -> Result<f64, Refusal> {
    check_latitude(latitude_deg)?;
    Ok(EARTH_RATE_RPS * latitude_deg.to_radians().cos())
}

fn check_latitude(latitude_deg: f64) -> Result<(), Refusal> {
    if (-90.0..=90.0).contains(&latitude_deg) {
        return Ok(());
    }
    Err(Refusal::Parameter { name: "latitude (deg)", value: latitude_deg, expected: "-90 to 90" })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of NIMA TR8350.2: equator and pole; and the difference from standard gravity.
    #[test]
    fn gravity_of_the_report() {
        let at = |latitude, height| normal_gravity_mps2(latitude, height).unwrap();
        assert!((at(0.0, 0.0) - 9.780_325_335_9).abs() < 1e-10);
        assert!((at(90.0, 0.0) - 9.832_184_937_8).abs() < 1e-9);
        assert!((at(45.0, 0.0) - 9.806_197_77).abs() < 1e-7, "{}", at(45.0, 0.0));
        assert!((STANDARD_GRAVITY_MPS2 / at(0.0, 0.0) - 1.0 - 2692e-6).abs() < 1e-6);
        assert!((STANDARD_GRAVITY_MPS2 / at(90.0, 0.0) - 1.0 + 2597e-6).abs() < 1e-6);
        assert!((at(34.0, 100.0) / at(34.0, 0.0) - 1.0 + 31.5e-6).abs() < 0.5e-6);
        assert!(normal_gravity_mps2(f64::NAN, 0.0).is_err() && normal_gravity_mps2(0.0, f64::NAN).is_err());
    }

    #[test]
    fn earth_rate_at_34_degrees() {
        let dph = 3600.0_f64.to_degrees();
        assert!((vertical_rate_rps(34.0).unwrap() * dph - 8.41).abs() < 0.01);
        assert!((north_rate_rps(34.0).unwrap() * dph - 12.47).abs() < 0.01);
    }
}
