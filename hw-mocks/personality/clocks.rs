//! The clocks of a personality: the board's oscillator, and the timing of the IMU's samples.

use gnc_config::TomlTable;

use super::checks::required_number;
use crate::oscillator::Oscillator;
use crate::sampling::{SamplingFaults, TimeStep};

pub(super) fn oscillator(table: &TomlTable<'_, '_>, d: Oscillator) -> Oscillator {
    Oscillator {
        error_ppm: table.number("clock_error_ppm", (-1e4, 1e4)).unwrap_or(d.error_ppm),
        drift_ppm_per_h: table.number("clock_drift_ppm_per_h", (-1e3, 1e3)).unwrap_or(d.drift_ppm_per_h),
    }
}

pub(super) fn sampling(table: &TomlTable<'_, '_>) -> SamplingFaults {
    let step = |table: &TomlTable<'_, '_>| {
        let (at_s, for_s) = (required_number(table, "at_s", (0.0, 1e6)), required_number(table, "for_s", (0.0, 1e6)));
        let step_us = required_number(table, "step_us", (-1e9, 1e9));
        Some(TimeStep { at_s: at_s?, for_s: for_s?, step_us: step_us? as i64 })
    };
    SamplingFaults {
        rate_error_ppm: table.number("rate_error_ppm", (-5e5, 5e5)).unwrap_or(0.0),
        counted_times: table.flag("counted_times"),
        step: table.within("time_step", step).flatten(),
    }
}
