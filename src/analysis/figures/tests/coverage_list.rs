//! Checks that no interval is forgotten: every measurement of the catalogue stands here as one without an interval, or
//! a test covers its interval.

use std::collections::BTreeSet;

use gnc_executive::catalogue::ItemId;

use super::{coverage, coverage_field, coverage_left, coverage_noise, coverage_repeated, coverage_sky};

/// Figures of any item without an interval: shares of bad samples, temperatures, residuals of a fit, counts, bounds.
const PLAIN: [&str; 30] = [
    "failed_reads",
    "stale_samples",
    "spikes",
    "temperature",
    "temperature_drift",
    "residual_rms",
    "residual_peak",
    "residual",
    "coverage_of_sphere",
    "rejected",
    "turns",
    "label",
    "mismatch_x",
    "mismatch_y",
    "mismatch_z",
    "range_gyro",
    "range_accel",
    "range_mag",
    "bias_instability_bound_gyro_x",
    "bias_instability_bound_gyro_y",
    "bias_instability_bound_gyro_z",
    "bias_instability_bound_accel_x",
    "bias_instability_bound_accel_y",
    "bias_instability_bound_accel_z",
    "epochs",
    "effective_epochs",
    // The item does not measure these, and says so.
    "lag",
    "velocity_height",
    "pps_accuracy",
    // Largest line over its neighbours: `line_gyro_x` and so on.
    "line",
];

/// Measurements of more than one item that are tested elsewhere: against 1PPS in `coverage_sky`, against the clock of
/// the computer beside `host_clock`. The board's clock of `gnss` is computed as in `gnss-accuracy`.
const SHARED: [&str; 2] = ["sample_rate_error", "board_clock_error"];

/// Intervals of the magnetometer for which a similar one is tested. An amplitude of the roll is a figure of its angle's
/// noise, the error of the field is that of `field` over the field, and elements of a matrix differ by their axes.
const ALIKE: [(ItemId, &[&str]); 2] = [
    (ItemId::MagnetometerEllipse, &["roll_error_1", "roll_error_2"]),
    (ItemId::MagnetometerEllipsoid, &["field_error", "soft_iron_yy", "soft_iron_zz", "soft_iron_xy", "soft_iron_xz"]),
];

/// Whether a measurement comes with an interval. Items that neither settle before a capture nor state a probability
/// give counts, times and answers of the board, or means of a short capture.
pub(super) fn has_interval(item: ItemId, name: &str) -> bool {
    let no_figures = !item.spec().params.iter().any(|param| ["settle", "coverage"].contains(&param.name));
    SHARED.contains(&name) || !(no_figures || PLAIN.contains(&name) || name.starts_with("line_"))
}

#[test]
fn every_interval_of_the_catalogue_is_tested() {
    let runs = [
        coverage::run(1, 1),
        coverage_field::run(1, 1),
        coverage_left::run(1, 1),
        coverage_repeated::run(1, 1),
        coverage_sky::run(1, 1),
    ];
    let tested: BTreeSet<String> =
        runs.into_iter().flatten().map(|tally| tally.name).chain(coverage_noise::names()).collect();
    for item in ItemId::ALL {
        for measurement in item.spec().measurements {
            let name = measurement.name;
            let alike = ALIKE.iter().any(|(other, names)| *other == item && names.contains(&name));
            if has_interval(item, name) && !SHARED.contains(&name) && !alike {
                assert!(tested.contains(&format!("{item} {name}")), "{item} {name}: add it to the coverage tests");
            }
        }
    }
}
