//! Biases over an hour and from power-on to power-on; scale factors from calibration to calibration.

use std::collections::BTreeMap;

use gnc_plot::{Panel, Series};
use serde::Deserialize;
use serde_json::Value;

use super::{AXES, part, thinned};

#[derive(Deserialize)]
struct Channel {
    unit: String,
    mean: f64,
    means: Vec<f64>,
}

/// Means of blocks over the capture.
pub(super) fn blocks(details: &Value) -> Option<Vec<Panel>> {
    let block_s: f64 = part(details, "block_s")?;
    triads(details, "bias less its mean", "min", |k| (k + 0.5) * block_s / 60.0, true)
}

/// Means of the runs.
pub(super) fn runs(details: &Value) -> Option<Vec<Panel>> {
    triads(details, "bias of each power-on less their mean", "run", |k| k + 1.0, false)
}

/// A panel for the gyroscopes and one for the accelerometers, as lines or as dots.
fn triads(details: &Value, what: &str, x: &str, at: impl Fn(f64) -> f64, lines: bool) -> Option<Vec<Panel>> {
    let channels: BTreeMap<String, Channel> = part(details, "series")?;
    let panel = |(key, name): (&str, &str)| {
        let mut unit = String::new();
        let series: Vec<Series> = AXES
            .iter()
            .enumerate()
            .filter_map(|(hue, axis)| {
                let channel = channels.get(&format!("{key}_{axis}"))?;
                unit.clone_from(&channel.unit);
                let points: Vec<(f64, f64)> =
                    channel.means.iter().enumerate().map(|(k, mean)| (at(k as f64), mean - channel.mean)).collect();
                let series =
                    if lines { Series::line(*axis, thinned(&points, |x| x)) } else { Series::dots(*axis, points) };
                Some(series.hue(hue))
            })
            .collect();
        (!series.is_empty()).then(|| Panel::new(format!("{name}: {what}"), x, unit, series))
    };
    Some([("gyro", "Gyroscopes"), ("accel", "Accelerometers")].into_iter().filter_map(panel).collect())
}

/// Scale factors of the calibrations, as departures from their mean.
pub(super) fn scale_factors(details: &Value) -> Option<Vec<Panel>> {
    let panel = |(key, name): (&str, &str)| {
        let responses: Vec<[[f64; 3]; 3]> = part(details, key)?;
        let series = (0..3).map(|axis| {
            let own: Vec<f64> = responses.iter().map(|response| response[axis][axis]).collect();
            let mean = gnc_metrology::stats::mean(&own);
            let points = own.iter().enumerate().map(|(k, own)| (k as f64 + 1.0, (own / mean - 1.0) * 1e6));
            Series::dots(AXES[axis], points.collect::<Vec<_>>())
        });
        Some(Panel::new(format!("{name}: scale factor less its mean"), "calibration", "ppm", series.collect()))
    };
    let panels = [("responses_gyro", "Gyroscopes"), ("responses_accel", "Accelerometers")];
    Some(panels.into_iter().filter_map(panel).collect())
}
