//! Gravity and rotation of the earth at the bench, and the heading of a module.

use gnc_executive::bench::BenchSite;
use gnc_metrology::earth;
use nalgebra::Vector3;

use super::FigureError;

/// Gravity that a figure works with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gravity {
    pub(super) mps2: f64,
    /// Source of the value, for the details.
    pub(super) from: &'static str,
}

/// Returns gravity as measured on the bench, or normal gravity of its place.
pub(super) fn gravity(site: Option<&BenchSite>) -> Result<Gravity, FigureError> {
    let site = site.ok_or(FigureError::NoPlace)?;
    if let Some(mps2) = site.gravity_mps2 {
        return Ok(Gravity { mps2, from: "measured, from the bench file" });
    }
    let place = site.place.ok_or(FigureError::NoPlace)?;
    let mps2 =
        earth::normal_gravity_mps2(place.latitude_deg, place.height_m).map_err(FigureError::refused("gravity"))?;
    Ok(Gravity { mps2, from: "WGS-84 normal gravity of latitude and height" })
}

/// Returns the rotation of the earth, rad/s: along up and along north.
pub(super) fn earth_rate(site: Option<&BenchSite>) -> Result<(f64, f64), FigureError> {
    let latitude_deg = latitude(site)?;
    let rate = |rate: Result<f64, gnc_metrology::Refusal>| rate.map_err(FigureError::refused("latitude"));
    Ok((rate(earth::vertical_rate_rps(latitude_deg))?, rate(earth::north_rate_rps(latitude_deg))?))
}

/// Returns the latitude of the bench.
pub(super) fn latitude(site: Option<&BenchSite>) -> Result<f64, FigureError> {
    Ok(site.and_then(|site| site.place).ok_or(FigureError::NoPlace)?.latitude_deg)
}

/// Returns north and east, level, in the axes of a module at rest.
///
/// The reference axis, the one after the axis that is most nearly vertical, points at `heading_deg` clockwise from
/// north; east of up is north x up.
pub(super) fn north_east(up: &Vector3<f64>, heading_deg: f64) -> (Vector3<f64>, Vector3<f64>) {
    let reference = (up.iamax() + 1) % 3;
    let mut axis = Vector3::zeros();
    axis[reference] = 1.0;
    let level = (axis - up * up.dot(&axis)).normalize();
    let (sin, cos) = heading_deg.to_radians().sin_cos();
    let north = level * cos - level.cross(up) * sin;
    (north, north.cross(up))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Z up, X east: Y is north. Z down, X north: Y is east. X up, Y south: Z is west... all right-handed.
    #[test]
    fn headings_are_clockwise() {
        let near = |a: Vector3<f64>, b: [f64; 3]| assert!((a - Vector3::from(b)).norm() < 1e-12, "{a} {b:?}");
        let (north, east) = north_east(&Vector3::z(), 90.0);
        near(north, [0.0, 1.0, 0.0]);
        near(east, [1.0, 0.0, 0.0]);
        let (north, east) = north_east(&-Vector3::z(), 0.0);
        near(north, [1.0, 0.0, 0.0]);
        near(east, [0.0, 1.0, 0.0]);
        let (north, east) = north_east(&Vector3::x(), 180.0);
        near(north, [0.0, -1.0, 0.0]);
        near(east, [0.0, 0.0, 1.0]);
    }
}
