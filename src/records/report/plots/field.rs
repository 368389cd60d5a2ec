//! The field in the plane of rotation: raw with its ellipse, corrected with its circle, and the residuals.

use gnc_analysis::details::calibrating::{FIELD, FieldSpin, SPINS};
use gnc_metrology::ellipse::Correction;
use gnc_plot::{Panel, Series};
use serde_json::Value;

use super::MOST_CURVES;

/// Points that draw an ellipse.
const CORNERS: u32 = 120;

fn correct(spin: &FieldSpin, (x, y): (f64, f64)) -> (f64, f64) {
    Correction { dx: spin.dx, dy: spin.dy, ky: spin.ky, sin_alpha: spin.sin_alpha }.apply(x, y)
}

fn ellipse(spin: &FieldSpin) -> Vec<(f64, f64)> {
    let (sin, cos) = spin.rotation_deg.to_radians().sin_cos();
    let corner = |(x, y): (f64, f64)| {
        let (along, across) = (spin.semi_axes[0] * x, spin.semi_axes[1] * y);
        (spin.centre[0] + along * cos - across * sin, spin.centre[1] + along * sin + across * cos)
    };
    circle(1.0).into_iter().map(corner).collect()
}

fn circle(radius: f64) -> Vec<(f64, f64)> {
    let angle = |k: u32| f64::from(k) / f64::from(CORNERS) * std::f64::consts::TAU;
    (0..=CORNERS).map(|k| (radius * angle(k).cos(), radius * angle(k).sin())).collect()
}

pub(super) fn circles(details: &Value) -> Option<Vec<Panel>> {
    let (spins, fields) = (SPINS.of(details)?, FIELD.of(details)?);
    let (mut raw, mut corrected, mut left) = (Vec::new(), Vec::new(), Vec::new());
    for (hue, (spin, field)) in spins.iter().zip(&fields).take(MOST_CURVES).enumerate() {
        let points: Vec<(f64, f64)> = field.x_gauss.iter().copied().zip(field.y_gauss.iter().copied()).collect();
        let good: Vec<(f64, f64)> = points.iter().map(|point| correct(spin, *point)).collect();
        let residual = |(x, y): &(f64, f64)| (y.atan2(*x).to_degrees(), (x.hypot(*y) - spin.radius) * 1e3);
        left.push(Series::dots(&spin.capture, good.iter().map(residual)).hue(hue));
        raw.push(Series::dots(&spin.capture, points).hue(hue));
        corrected.push(Series::dots(&spin.capture, good).hue(hue));
    }
    let first = spins.first()?;
    raw.push(Series::dashed("", ellipse(first)).hue(5));
    raw.push(Series::dots("", [(first.centre[0], first.centre[1])]).hue(5));
    corrected.push(Series::dashed("", circle(first.radius)).hue(5));
    corrected.push(Series::dots("", [(0.0, 0.0)]).hue(5));
    let extremes = "nearest and farthest points of each direction";
    Some(vec![
        Panel::new("Field, raw, with its ellipse", "x, gauss", "y, gauss", raw).square(),
        Panel::new("Field, corrected, with its circle", "x', gauss", "y', gauss", corrected).square(),
        Panel::new(format!("Off the circle: {extremes}"), "direction, deg", "mgauss", left),
    ])
}
