//! The turntable of a personality.

use gnc_config::TomlTable;

use super::checks::numbers;
use crate::turntable::TableModel;

/// Largest error of a table: a degree. More would be another attitude and not an error.
const MOST_ARCSEC: f64 = 3600.0;

/// Bounds of a ramp's part of a turn. Two ramps have no room for more than half each; below a hundredth the table would jerk.
const SHORTEST_AND_LONGEST_RAMP: (f64, f64) = (0.01, 0.5);

pub(super) fn turntable(table: &TomlTable<'_, '_>) -> TableModel {
    let d = TableModel::default();
    let both = |key: &'static str, most: f64| table.number(key, (-most, most));
    let spread = |key: &'static str| table.number(key, (0.0, MOST_ARCSEC));
    let three =
        |key: &'static str, most: f64| numbers(&table.entry(key)?, "three numbers for X, Y and Z", (-most, most));
    let axis_error = table
        .entry("axis_error_arcsec")
        .and_then(|entry| numbers(&entry, "two numbers, north and east of up", (-MOST_ARCSEC, MOST_ARCSEC)));
    TableModel {
        axis_error_arcsec: axis_error.unwrap_or(d.axis_error_arcsec),
        heading_error_arcsec: both("heading_error_arcsec", 10.0 * MOST_ARCSEC).unwrap_or(d.heading_error_arcsec),
        mounting_deg: three("mounting_deg", 10.0).unwrap_or(d.mounting_deg),
        attitude_error_arcsec: spread("attitude_error_arcsec").unwrap_or(d.attitude_error_arcsec),
        repeatability_arcsec: spread("repeatability_arcsec").unwrap_or(d.repeatability_arcsec),
        angle_error_ppm: both("angle_error_ppm", 1e5).unwrap_or(d.angle_error_ppm),
        angle_error_arcsec: spread("angle_error_arcsec").unwrap_or(d.angle_error_arcsec),
        rate_error_ppm: both("rate_error_ppm", 1e5).unwrap_or(d.rate_error_ppm),
        wobble_arcsec: spread("wobble_arcsec").unwrap_or(d.wobble_arcsec),
        field_mgauss: three("field_mgauss", 100.0).unwrap_or(d.field_mgauss),
        field_swing_ppm: both("field_swing_ppm", 1e5).unwrap_or(d.field_swing_ppm),
        lever_arm_mm: three("lever_arm_mm", 1000.0).unwrap_or(d.lever_arm_mm),
        ramp_share: table.number("ramp_share", SHORTEST_AND_LONGEST_RAMP).unwrap_or(d.ramp_share),
        slew_s: table.number("slew_s", (0.0, 600.0)).unwrap_or(d.slew_s),
    }
}
