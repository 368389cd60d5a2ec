//! The turntable of a personality, checked.

use toml::Spanned;

use super::check::{Mistake, number};
use super::raw;
use crate::turntable::TableModel;

/// Each of some numbers, or the defaults.
fn numbers<const N: usize>(
    values: Option<&[Spanned<f64>; N]>,
    name: &str,
    most: f64,
    default: [f64; N],
) -> Result<[f64; N], Mistake> {
    let mut checked = default;
    for (place, value) in values.into_iter().flatten().enumerate() {
        checked[place] = number(Some(value), name, -most, most, 0.0)?;
    }
    Ok(checked)
}

impl raw::Turntable {
    pub(super) fn check(&self, d: TableModel) -> Result<TableModel, Mistake> {
        // A degree, beyond which it is no error of a table but another attitude.
        const MOST_ARCSEC: f64 = 3600.0;
        let both =
            |value: &Option<Spanned<f64>>, name, most: f64, default| number(value.as_ref(), name, -most, most, default);
        let spread =
            |value: &Option<Spanned<f64>>, name, default| number(value.as_ref(), name, 0.0, MOST_ARCSEC, default);
        Ok(TableModel {
            axis_error_arcsec: numbers(
                self.axis_error_arcsec.as_ref(),
                "axis_error_arcsec",
                MOST_ARCSEC,
                d.axis_error_arcsec,
            )?,
            heading_error_arcsec: both(
                &self.heading_error_arcsec,
                "heading_error_arcsec",
                10.0 * MOST_ARCSEC,
                d.heading_error_arcsec,
            )?,
            mounting_deg: numbers(self.mounting_deg.as_ref(), "mounting_deg", 10.0, d.mounting_deg)?,
            attitude_error_arcsec: spread(
                &self.attitude_error_arcsec,
                "attitude_error_arcsec",
                d.attitude_error_arcsec,
            )?,
            repeatability_arcsec: spread(&self.repeatability_arcsec, "repeatability_arcsec", d.repeatability_arcsec)?,
            angle_error_ppm: both(&self.angle_error_ppm, "angle_error_ppm", 1e5, d.angle_error_ppm)?,
            angle_error_arcsec: spread(&self.angle_error_arcsec, "angle_error_arcsec", d.angle_error_arcsec)?,
            rate_error_ppm: both(&self.rate_error_ppm, "rate_error_ppm", 1e5, d.rate_error_ppm)?,
            wobble_arcsec: spread(&self.wobble_arcsec, "wobble_arcsec", d.wobble_arcsec)?,
            field_mgauss: numbers(self.field_mgauss.as_ref(), "field_mgauss", 100.0, d.field_mgauss)?,
            field_swing_ppm: both(&self.field_swing_ppm, "field_swing_ppm", 1e5, d.field_swing_ppm)?,
            lever_arm_mm: numbers(self.lever_arm_mm.as_ref(), "lever_arm_mm", 1000.0, d.lever_arm_mm)?,
            slew_s: number(self.slew_s.as_ref(), "slew_s", 0.0, 600.0, d.slew_s)?,
        })
    }
}
