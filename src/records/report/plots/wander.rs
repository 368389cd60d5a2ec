//! Biases over an hour and from power-on to power-on; scale factors from calibration to calibration.

use gnc_analysis::details::DetailsPart;
use gnc_analysis::details::performance::{ACCEL_RESPONSES, BLOCK_S, GYRO_RESPONSES, SERIES};
use gnc_plot::{Panel, Series};
use serde_json::Value;

use super::{AXES, thinned};

/// Means of blocks over the capture.
pub(super) fn blocks(details: &Value) -> Option<Vec<Panel>> {
    let block_s = BLOCK_S.of(details)?;
    triads(details, "bias minus its mean", "min", |k| (k + 0.5) * block_s / 60.0, true)
}

/// Means of the runs.
pub(super) fn runs(details: &Value) -> Option<Vec<Panel>> {
    triads(details, "bias of each power-on minus their mean", "run", |k| k + 1.0, false)
}

/// A panel for the gyroscopes and one for the accelerometers, as lines or as dots.
fn triads(details: &Value, what: &str, x: &str, at: impl Fn(f64) -> f64, lines: bool) -> Option<Vec<Panel>> {
    let channels = SERIES.of(details)?;
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
    let panel = |(part, name): (&DetailsPart<Vec<[[f64; 3]; 3]>>, &str)| {
        let responses = part.of(details)?;
        let series = (0..3).map(|axis| {
            let own: Vec<f64> = responses.iter().map(|response| response[axis][axis]).collect();
            let mean = gnc_metrology::stats::mean(&own);
            let points = own.iter().enumerate().map(|(k, own)| (k as f64 + 1.0, (own / mean - 1.0) * 1e6));
            Series::dots(AXES[axis], points.collect::<Vec<_>>())
        });
        Some(Panel::new(format!("{name}: scale factor minus its mean"), "calibration", "ppm", series.collect()))
    };
    let panels = [(&GYRO_RESPONSES, "Gyroscopes"), (&ACCEL_RESPONSES, "Accelerometers")];
    Some(panels.into_iter().filter_map(panel).collect())
}
