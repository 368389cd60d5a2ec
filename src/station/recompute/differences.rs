//! The differences between two results, in words.

use gnc_executive::details::Details;
use gnc_executive::measurement::Measurement;
use serde_json::Value;

/// Largest number of differences shown of one attempt; more would only fill the screen.
const MOST: usize = 20;

/// Differences of measurements, in the order of measuring.
pub(super) fn of_measurements(before: &[Measurement], now: &[Measurement]) -> Vec<String> {
    let mut found = Vec::new();
    for (was, is) in before.iter().zip(now) {
        if json(was) == json(is) {
            continue;
        }
        let judged = |measurement: &Measurement| measurement.outcome.map_or("information", |outcome| outcome.as_str());
        let text = if was.name != is.name {
            format!("{} instead of {}", is.name, was.name)
        } else if json(&was.value) != json(&is.value) || was.raw != is.raw {
            // Exactly as written, so that a difference in the last digit shows too.
            format!("{} was {}, is {}", was.name, exact(was), exact(is))
        } else {
            let limits = (was.limit_text(), is.limit_text());
            format!("{} was {} ({}), is {} ({})", was.name, judged(was), limits.0, judged(is), limits.1)
        };
        found.push(text);
    }
    if before.len() != now.len() {
        found.push(format!("{} measurements, but there were {}", now.len(), before.len()));
    }
    shorten(found)
}

/// Differences of details, with their places.
pub(super) fn of_details(before: &[Details], now: &[Details]) -> Vec<String> {
    let mut found = Vec::new();
    if before.len() != now.len() {
        found.push(format!("{} details, but there were {}", now.len(), before.len()));
    }
    for (was, is) in before.iter().zip(now) {
        walk("details ", was, is, &mut found);
    }
    shorten(found)
}

/// Differences of one named value, with their places.
pub(super) fn of_values(name: &str, was: &Value, is: &Value) -> Vec<String> {
    let mut found = Vec::new();
    walk(&format!("{name} "), was, is, &mut found);
    shorten(found)
}

fn walk(place: &str, was: &Value, is: &Value, found: &mut Vec<String>) {
    match (was, is) {
        (Value::Object(a), Value::Object(b)) => {
            for key in a.keys().chain(b.keys().filter(|key| !a.contains_key(*key))) {
                let (was, is) = (a.get(key).unwrap_or(&Value::Null), b.get(key).unwrap_or(&Value::Null));
                walk(&format!("{place}/{key}"), was, is, found);
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            for (index, (was, is)) in a.iter().zip(b).enumerate() {
                walk(&format!("{place}/{index}"), was, is, found);
            }
        }
        _ if json(was) == json(is) => {}
        _ => found.push(format!("{place} was {}, is {}", json(was), json(is))),
    }
}

fn exact(measurement: &Measurement) -> String {
    match &measurement.raw {
        Some(raw) => raw.clone(),
        None => json(&measurement.value),
    }
}

/// A value as JSON. Two numbers print alike only if all their bits are equal.
pub(super) fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

fn shorten(mut found: Vec<String>) -> Vec<String> {
    if found.len() > MOST {
        let more = found.len() - MOST;
        found.truncate(MOST);
        found.push(format!("and {more} more"));
    }
    found
}
