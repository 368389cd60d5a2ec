//! Records of the turns, with the windows over which they were summed.

use gnc_analysis::details::calibrating::{TURNS, WINDOWS};
use gnc_plot::{Panel, Series};
use serde_json::Value;

use super::MOST_CURVES;

/// Draws both senses of an axis in one picture.
pub(super) fn records(details: &Value) -> Option<Vec<Panel>> {
    let (records, windows) = (TURNS.of(details)?, WINDOWS.of(details)?);
    if records.len() != windows.len() {
        return None;
    }
    let mut axes: Vec<&str> = records.iter().map(|record| record.axis.as_str()).collect();
    axes.dedup();
    let panels = axes.into_iter().take(MOST_CURVES).map(|axis| {
        let turns = records.iter().zip(&windows).filter(|(record, _)| record.axis == axis);
        let curves = turns.take(MOST_CURVES).enumerate().flat_map(|(hue, (record, window))| {
            let points = record.time_s.iter().copied().zip(record.rate_dps.iter().copied());
            let (low, high) = record.rate_dps.iter().fold((0.0_f64, 0.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
            let edges = [window.start_s, window.start_s + window.span_s];
            [Series::line(&record.capture, points).hue(hue)]
                .into_iter()
                .chain(edges.map(|at| Series::dashed("", [(at, low), (at, high)]).hue(hue)))
        });
        Panel::new(format!("Turns about {axis}; dashed: window of the integral"), "s", "deg/s", curves.collect())
    });
    Some(panels.collect())
}
