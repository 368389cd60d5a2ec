//! Measured values with their limits, as numbers and as a picture of their place within the limits.

use gnc_executive::measurement::{Measurement, Reading};
use gnc_executive::outcome::Outcome;

use super::markup::SvgPage;
use super::{class, word};

const WIDTH: f64 = 140.0;
const HEIGHT: f64 = 16.0;
/// Share of the picture on each side that lies beyond the limits.
const BEYOND: f64 = 0.2;

pub(super) fn table(page: &mut SvgPage, measurements: &[Measurement]) {
    if measurements.is_empty() {
        return;
    }
    page.open("table", "");
    page.row("th", &["Measurement", "Value", "Uncertainty", "Limit", "", "Outcome"]);
    for measurement in measurements {
        page.open("tr", measurement.outcome.map_or("", class));
        let repeat = measurement.repeat.map(|repeat| format!(" ({repeat})")).unwrap_or_default();
        page.element("td", "", &format!("{}{repeat}", measurement.name));
        page.element("td", "number", &measurement.value_text());
        page.element("td", "number", &measurement.uncertainty_text());
        page.element("td", "number", &measurement.limit_text());
        page.picture_cell(&gauge(measurement).unwrap_or_default());
        page.element("td", "outcome", measurement.outcome.map_or("information", word));
        page.close("tr");
    }
    page.close("table");
}

/// The place of a value between its limits. A value with a single limit is drawn against zero, or against the limit
/// itself, on the good side.
fn gauge(measurement: &Measurement) -> Option<String> {
    let Reading::Number(value) = measurement.value else { return None };
    let (low, high) = match (measurement.low, measurement.high) {
        (Some(low), Some(high)) if low < high => (low, high),
        (None, Some(high)) if high > 0.0 => (0.0, high),
        (Some(low), None) if low > 0.0 => (low, 2.0 * low),
        _ => return None,
    };
    let span = (high - low) / (1.0 - 2.0 * BEYOND);
    let at = |value: f64| ((value - low) / span + BEYOND).clamp(0.03, 0.97) * WIDTH;
    let colour = match measurement.outcome {
        Some(Outcome::Passed) => "#1e7b34",
        Some(Outcome::Marginal) => "#8a6d00",
        Some(_) => "#b00020",
        None => "#555",
    };
    let band = (at(low), at(high) - at(low));
    let mut svg = format!(
        r##"<svg width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" role="img"><rect x="{:.1}" y="4" width="{:.1}" height="8" fill="#e0e8e0"/>"##,
        band.0, band.1
    );
    for limit in [measurement.low, measurement.high].into_iter().flatten() {
        svg.push_str(&format!(r##"<path d="M{:.1} 1V15" stroke="#555"/>"##, at(limit)));
    }
    svg.push_str(&format!(r#"<circle cx="{:.1}" cy="8" r="4" fill="{colour}"/></svg>"#, at(value)));
    Some(svg)
}
