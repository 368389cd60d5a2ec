//! `[resume]` of a plan: how a run that takes over captures waits until the module is as warm as it was.

use gnc_config::TomlTable;

use crate::quantity::{Dimension, quantity_at};

/// Longest wait if the plan states none. A module whose heat settles with a time constant of three minutes is within a
/// hundredth of its rise after fourteen; boards with more mass take twice as long.
const WAIT_S: f64 = 1800.0;
/// Bounds of that wait: no wait at all, and a shift.
const WAITS_S: (f64, f64) = (0.0, 28_800.0);
/// Difference of temperature that the plan accepts if it states none: a quarter of the drift that the plans of this station
/// accept within a calibration. A room that is kept at its temperature stays within it from day to day.
const WITHIN_K: f64 = 0.5;
/// Bounds of that difference: the resolution of the thermometers, and a room on another day.
const WITHINS_K: (f64, f64) = (0.01, 20.0);

/// How a resumed run waits for the module's temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResumeRules {
    /// Longest board time that all waits of a run take together.
    pub wait_s: f64,
    /// Difference from the temperature of the captures that are taken over at which the wait ends.
    pub within_k: f64,
}

impl Default for ResumeRules {
    fn default() -> Self {
        Self { wait_s: WAIT_S, within_k: WITHIN_K }
    }
}

/// Reads the table.
pub(super) fn read(table: Option<TomlTable<'_, '_>>) -> ResumeRules {
    let rules = ResumeRules::default();
    let Some(table) = table else { return rules };
    let number = |key: &'static str, dimension, (least, most): (f64, f64), hint: &str| {
        let (quantity, span) = quantity_at(&table, key, dimension)?;
        let value = quantity.si();
        if (least..=most).contains(&value) {
            return Some(value);
        }
        table.mistake_at(span, format!("{key} of {quantity} is out of range"), hint);
        None
    };
    let wait_s = number("wait", Dimension::Time, WAITS_S, "write 0 s to 8 h");
    let within_k = number("within", Dimension::Temperature, WITHINS_K, "write 0.01 degC to 20 degC");
    table.finish();
    ResumeRules { wait_s: wait_s.unwrap_or(rules.wait_s), within_k: within_k.unwrap_or(rules.within_k) }
}
