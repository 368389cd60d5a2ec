//! The figures of a run, and their comparison with those of runs that nothing interrupted.

use std::collections::BTreeMap;
use std::path::Path;

use gnc_tests::read_json;

/// Figures differ by more than their expanded uncertainties now and then: of a thousand comparisons, fifty. So many times the
/// uncertainty is three and a half standard deviations.
const FACTOR: f64 = 1.75;

/// Figures by item and name, each with half of its 95 % interval.
pub(crate) type Values = BTreeMap<String, (f64, f64)>;

/// The figures of a run that have an uncertainty.
pub(crate) fn of(run: &Path) -> Values {
    let record = read_json(&run.join("run.json"));
    let mut values = Values::new();
    for item in record["items"].as_array().expect("items") {
        let attempt = item["attempts"].as_array().and_then(|attempts| attempts.last());
        for found in attempt.and_then(|attempt| attempt["measurements"].as_array()).into_iter().flatten() {
            let name =
                format!("{} {}", item["name"].as_str().expect("a name"), found["name"].as_str().expect("a name"));
            let bounds = (found["uncertainty"]["low"].as_f64(), found["uncertainty"]["high"].as_f64());
            if let (Some(value), (Some(low), Some(high))) = (found["value"].as_f64(), bounds) {
                values.insert(name, (value, (high - low) / 2.0));
            }
        }
    }
    values
}

/// The figures that are farther from all those of uninterrupted runs than the uncertainties explain.
pub(crate) fn strange(found: &Values, references: &[Values]) -> Vec<String> {
    let mut strange = Vec::new();
    for (name, (value, u)) in found {
        let near = references
            .iter()
            .filter_map(|reference| reference.get(name))
            .map(|(reference, reference_u)| (value - reference).abs() / (FACTOR * u.hypot(*reference_u)));
        let nearest = near.fold(f64::INFINITY, f64::min);
        if nearest > 1.0 {
            strange.push(format!("{name}: {value} +- {u}, {nearest:.2} times too far"));
        }
    }
    strange
}
