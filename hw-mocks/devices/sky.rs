//! The sky over the antenna: satellites, their signals, the geometry.

use nalgebra::{Matrix4, RowVector4};

/// A satellite in view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Satellite {
    /// PRN number.
    pub prn: u8,
    /// Elevation.
    pub elevation_deg: f64,
    /// Azimuth, clockwise from north.
    pub azimuth_deg: f64,
    /// Carrier to noise density.
    pub cn0_dbhz: f64,
}

/// Dilutions of precision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dilution {
    /// Of the position.
    pub pdop: f64,
    /// Of the horizontal position.
    pub hdop: f64,
    /// Of the height.
    pub vdop: f64,
}

/// A GPS sky as over a place at 34 deg north: (PRN, elevation, azimuth) at the start of the bench.
const ALMANAC: [(u8, f64, f64); 12] = [
    (2, 62.0, 145.0),
    (5, 21.0, 48.0),
    (7, 14.0, 196.0),
    (9, 38.0, 302.0),
    (13, 51.0, 231.0),
    (15, 28.0, 171.0),
    (18, 9.0, 330.0),
    (20, 33.0, 92.0),
    (23, 7.0, 17.0),
    (26, 18.0, 266.0),
    (29, 74.0, 24.0),
    (30, 45.0, 66.0),
];

/// Elevation below which the receiver leaves a satellite out.
const MASK_DEG: f64 = 10.0;

/// The satellites in view at a time since the bench was started. They drift as in a real sky, by at most half a degree
/// of azimuth a minute. A bench run is short against their passes, so no satellite rises or sets.
#[must_use]
pub(crate) fn satellites(now_s: f64) -> Vec<Satellite> {
    let minutes = now_s / 60.0;
    let place = |&(prn, elevation, azimuth): &(u8, f64, f64)| {
        let phase = f64::from(prn);
        let elevation_deg: f64 = elevation + 3.0 * ((minutes / 90.0 + phase).sin() - phase.sin());
        Satellite {
            prn,
            elevation_deg,
            azimuth_deg: (azimuth + 0.3 * minutes * phase.cos()).rem_euclid(360.0),
            // 45 dB-Hz overhead and 33 near the horizon, as with a small patch antenna.
            cn0_dbhz: 31.0 + 14.5 * elevation_deg.to_radians().sin(),
        }
    };
    ALMANAC.iter().map(place).collect()
}

/// The satellites that a receiver uses.
#[must_use]
pub(crate) fn usable(satellites: &[Satellite]) -> Vec<Satellite> {
    satellites.iter().filter(|satellite| satellite.elevation_deg >= MASK_DEG).copied().collect()
}

/// Dilution of precision of a geometry: `(H'H)^-1` of the unit vectors; `None` for fewer than four satellites or if
/// they lie in one plane.
#[must_use]
pub fn dilution(used: &[Satellite]) -> Option<Dilution> {
    if used.len() < 4 {
        return None;
    }
    let normal = used.iter().fold(Matrix4::zeros(), |sum: Matrix4<f64>, satellite| {
        let (sin_e, cos_e) = satellite.elevation_deg.to_radians().sin_cos();
        let (sin_a, cos_a) = satellite.azimuth_deg.to_radians().sin_cos();
        let row = RowVector4::new(cos_e * sin_a, cos_e * cos_a, sin_e, 1.0);
        sum + row.transpose() * row
    });
    let q = normal.try_inverse()?;
    let root = |sum: f64| sum.max(0.0).sqrt();
    Some(Dilution {
        pdop: root(q[(0, 0)] + q[(1, 1)] + q[(2, 2)]),
        hdop: root(q[(0, 0)] + q[(1, 1)]),
        vdop: root(q[(2, 2)]),
    })
}
