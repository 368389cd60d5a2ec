//! The residuals of a fit in each position, and how the means follow a step.

use gnc_analysis::details::calibrating::{FORCE_RESIDUALS, RATE_RESIDUALS};
use gnc_analysis::details::performance::{STEPS, StepResponse};
use gnc_metrology::earth::STANDARD_GRAVITY_MPS2;
use gnc_plot::{Mark, Panel, Series};
use serde_json::Value;

use super::super::number;
use super::AXES;

/// Distance between points beside each other in one position.
const OFFSET: f64 = 0.2;

pub(super) fn accelerometers(details: &Value) -> Option<Vec<Panel>> {
    let rows = FORCE_RESIDUALS.of(details)?.into_iter().map(|row| (row.position, row.residual_mps2));
    Some(positions(&rows.collect::<Vec<_>>(), "mg", 1e3 / STANDARD_GRAVITY_MPS2))
}

pub(super) fn gyroscopes(details: &Value) -> Option<Vec<Panel>> {
    let rows = RATE_RESIDUALS.of(details)?.into_iter().map(|row| (row.position, row.residual_rps));
    Some(positions(&rows.collect::<Vec<_>>(), "deg/h", 3600.0 * 1.0_f64.to_degrees()))
}

fn positions(rows: &[(String, [f64; 3])], unit: &str, factor: f64) -> Vec<Panel> {
    let series = AXES.iter().enumerate().map(|(axis, name)| {
        let values = || rows.iter().map(|(_, residual)| residual[axis] * factor);
        let bars = values().map(|value| (value.min(0.0), value.max(0.0))).collect();
        let places = (0..rows.len()).map(|place| place as f64 + (axis as f64 - 1.0) * OFFSET);
        Series::new(*name, Mark::Bars(bars), places.zip(values()))
    });
    let panel = Panel::new("Residuals of the positions", "position", unit, series.collect());
    vec![panel.names(rows.iter().map(|(position, _)| position.clone()))]
}

pub(super) fn steps(details: &Value) -> Option<Vec<Panel>> {
    let rows = STEPS.of(details)?;
    let sense = |name: &str, pick: fn(&StepResponse) -> f64, offset: f64| {
        let points = rows.iter().enumerate().map(|(place, row)| (place as f64 + offset, 100.0 * pick(row)));
        Series::dots(name, points.collect::<Vec<_>>())
    };
    let ends = [-0.6, rows.len() as f64 - 0.4];
    let at = |percent: f64, hue: usize| Series::dashed("", ends.map(|x| (x, percent))).hue(hue);
    let mut sizes: Vec<String> = rows.iter().map(|row| format!("{} {}", number(row.step), row.unit)).collect();
    sizes.dedup();
    let series = vec![
        sense("up", |row| row.response_up, -0.1),
        sense("down", |row| row.response_down, 0.1),
        at(50.0, 1),
        at(100.0, 5),
    ];
    let panel = Panel::new(format!("Response to steps of {}", sizes.join(", ")), "channel", "% of the step", series);
    Some(vec![panel.names(rows.iter().map(|row| row.channel.clone()))])
}
