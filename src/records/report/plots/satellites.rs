//! Fixes about the surveyed antenna.

use gnc_analysis::details::performance::{MEAN_ERROR_M, SCATTER};
use gnc_plot::{Panel, Series};
use serde_json::Value;

pub(super) fn scatter(details: &Value) -> Option<Vec<Panel>> {
    let (scatter, mean) = (SCATTER.of(details)?, MEAN_ERROR_M.of(details)?);
    let points = scatter.east_m.iter().copied().zip(scatter.north_m.iter().copied());
    let plane = vec![
        Series::dots("fixes", points),
        Series::dots("mean", [(mean.east, mean.north)]),
        Series::dots("antenna", [(0.0, 0.0)]).hue(5),
    ];
    let over = |values: Vec<Option<f64>>| {
        let points = scatter.epoch.iter().zip(values).filter_map(|(epoch, value)| Some((*epoch as f64, value?)));
        points.collect::<Vec<_>>()
    };
    let some = |values: &[f64]| values.iter().copied().map(Some).collect::<Vec<_>>();
    let time = vec![
        Series::line("east", over(some(&scatter.east_m))),
        Series::line("north", over(some(&scatter.north_m))),
        Series::line("up", over(scatter.up_m.clone())),
    ];
    let each = if scatter.every > 1 { format!(", one epoch of {}", scatter.every) } else { String::new() };
    Some(vec![
        Panel::new(format!("Position about the antenna{each}"), "east, m", "north, m", plane).square(),
        Panel::new(format!("Position over the epochs{each}"), "epoch", "m", time),
    ])
}
