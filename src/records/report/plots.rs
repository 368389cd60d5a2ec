//! Pictures of what an item found. They use the item's details alone, so that they show what the record holds.
//!
//! Details of an unexpected form (of another version or a damaged record) give no picture; they still stand in the
//! record.

mod field;
mod noise;
mod residuals;
mod rotation;
mod satellites;
mod wander;

use gnc_analysis::details::calibrating::{FIELD, TURNS};
use gnc_analysis::details::performance::{CURVES, SCATTER, SERIES, SPECTRA};
use gnc_executive::catalogue::ItemId;
use gnc_metrology::AXES;
use gnc_plot::Panel;
use serde_json::Value;

/// Keys of details that are drawn and not listed: the numbers are in run.json.
const DRAWN: [&str; 6] = [CURVES.key(), FIELD.key(), TURNS.key(), SCATTER.key(), SERIES.key(), SPECTRA.key()];
/// Points drawn of one curve; more show nothing new on a page.
const MOST_POINTS: usize = 400;
/// Most curves of one picture. A plan may ask for many positions or calibrations, but a reader cannot tell more apart.
const MOST_CURVES: usize = 12;
/// Size of a picture: two pictures fit beside each other on a page.
const SIZE: (f64, f64) = (440.0, 340.0);
/// The pictures of an item.
pub(super) fn of(item: ItemId, details: &Value) -> Vec<Panel> {
    let panels = match item {
        ItemId::SixPosition => residuals::accelerometers(details),
        ItemId::GyroStill => residuals::gyroscopes(details),
        ItemId::Rotation => rotation::records(details),
        ItemId::MagnetometerEllipse => field::circles(details),
        ItemId::Allan => noise::deviations(details),
        ItemId::Psd => noise::spectra(details),
        ItemId::BiasStability => wander::blocks(details),
        ItemId::BiasRepeatability => wander::runs(details),
        ItemId::ScaleFactorRepeatability => wander::scale_factors(details),
        ItemId::Resolution => residuals::steps(details),
        ItemId::GnssAccuracy => satellites::scatter(details),
        _ => None,
    };
    panels.unwrap_or_default().into_iter().map(|panel| panel.sized(SIZE.0, SIZE.1)).collect()
}

/// Whether a key is shown as a picture only.
pub(super) fn is_drawn(key: &str) -> bool {
    DRAWN.contains(&key)
}

/// The smallest and the largest value of each part of a dense curve; `along` is the place of a point on the page.
fn thinned(points: &[(f64, f64)], along: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return Vec::new() };
    if points.len() <= MOST_POINTS {
        return points.to_vec();
    }
    let parts = MOST_POINTS / 2;
    let (from, span) = (along(first.0), along(last.0) - along(first.0));
    let part_of = |point: &(f64, f64)| ((along(point.0) - from) / span * parts as f64) as usize;
    let mut kept = Vec::with_capacity(MOST_POINTS);
    for part in points.chunk_by(|a, b| part_of(a) == part_of(b)) {
        let by_value = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let (low, high) = (part.iter().min_by(by_value), part.iter().max_by(by_value));
        let mut ends: Vec<(f64, f64)> = low.into_iter().chain(high).copied().collect();
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        ends.dedup();
        kept.extend(ends);
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dense_curve_keeps_its_peaks() {
        let mut points: Vec<(f64, f64)> = (1..5000).map(|k| (f64::from(k), 1.0)).collect();
        points[4321].1 = 50.0;
        for along in [f64::log10 as fn(f64) -> f64, |x| x] {
            let kept = thinned(&points, along);
            assert!(kept.len() <= MOST_POINTS + 2 && kept.contains(&points[4321]), "{} points", kept.len());
            assert!(kept.is_sorted_by(|a, b| a.0 < b.0));
        }
    }

    /// Every content of the details gives a page.
    #[test]
    fn other_forms_give_no_picture() {
        for item in ItemId::ALL {
            for details in [
                serde_json::json!(null),
                serde_json::json!({}),
                serde_json::json!({
                    "residuals": 1, "windows": [], "records": [{}], "field": [[]], "spins": {}, "curves": { "gyro_x": 1 },
                    "spectra": { "gyro_x": { "density": [null] } }, "series": [], "steps": [[]], "scatter": "no",
                    "responses_gyro": [[1.0]],
                }),
            ] {
                assert!(of(item, &details).is_empty(), "{item}");
            }
        }
    }
}
