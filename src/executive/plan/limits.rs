//! The `[item.limits]` of a plan.

use std::borrow::Cow;

use gnc_config::{Span, TomlEntry, TomlTable, Value, Walk, did_you_mean};
use gnc_text::quoted;

use super::{ItemLimit, Params};
use crate::catalogue::{ItemId, MeasurementSpec};
use crate::limit::{Limit, LimitError, MeasurementKind};
use crate::quantity::Unit;

/// How exactly a key names a measurement; the more exact key counts.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Exactness {
    Pattern,
    Name,
}

/// A limit as written, with its marginal band.
struct Written<'t> {
    limit: (&'t str, Span),
    marginal: Option<(&'t str, Span)>,
}

/// Reads the limits of an item, in the order of the catalogue. `None` if some were refused; there is no second message
/// about missing limits then.
pub(super) fn read(
    walk: &Walk<'_>,
    table: Option<&TomlTable<'_, '_>>,
    id: ItemId,
    params: &Params,
) -> Option<Vec<ItemLimit>> {
    let spec = id.spec();
    let mut chosen: Vec<Option<(Exactness, Limit)>> = vec![None; spec.measurements.len()];
    let mut refused = false;
    for entry in table.into_iter().flat_map(TomlTable::entries) {
        let taken = one(walk, &entry, id, params, &mut chosen);
        refused |= taken.is_none();
    }
    let limits: Vec<ItemLimit> = spec
        .measurements
        .iter()
        .zip(chosen)
        .filter_map(|(measurement, chosen)| {
            chosen.map(|(_, limit)| ItemLimit { measurement: Cow::Borrowed(measurement.name), limit })
        })
        .collect();
    (!refused || !limits.is_empty()).then_some(limits)
}

/// Reads one entry and gives its limit to every measurement that the entry names; `None` if it is refused.
fn one(
    walk: &Walk<'_>,
    entry: &TomlEntry<'_, '_>,
    id: ItemId,
    params: &Params,
    chosen: &mut [Option<(Exactness, Limit)>],
) -> Option<()> {
    let key = entry.key();
    let exactness = if key.contains('*') { Exactness::Pattern } else { Exactness::Name };
    let named = |measurement: &MeasurementSpec| match exactness {
        Exactness::Name => measurement.name == key,
        Exactness::Pattern => matches(key, measurement.name),
    };
    let all: Vec<(usize, &MeasurementSpec)> =
        id.spec().measurements.iter().enumerate().filter(|(_, measurement)| named(measurement)).collect();
    if all.is_empty() {
        unknown(entry, id);
        return None;
    }
    let on: Vec<(usize, &MeasurementSpec)> =
        all.into_iter().filter(|(_, measurement)| params.switch_on(measurement.when)).collect();
    if on.is_empty() {
        let what = format!("{} is not measured with these parameters", quoted(key));
        entry.key_mistake(what, "change the parameters, or leave the limit out");
        return None;
    }
    let written = written(entry)?;
    for (index, measurement) in on {
        let limited = Limited { name: measurement.name, kind: measurement.kind, unit: measurement.unit };
        let limit = parse(walk, key, &written, &limited)?;
        if chosen[index].as_ref().is_none_or(|(before, _)| *before <= exactness) {
            chosen[index] = Some((exactness, limit));
        }
    }
    Some(())
}

/// What is limited.
pub(super) struct Limited<'a> {
    pub(super) name: &'a str,
    pub(super) kind: MeasurementKind,
    pub(super) unit: Unit,
}

/// Reads the limit of a measurement that its key names exactly; `None` if it is refused.
pub(super) fn limit_of(walk: &Walk<'_>, entry: &TomlEntry<'_, '_>, measurement: &Limited<'_>) -> Option<Limit> {
    parse(walk, entry.key(), &written(entry)?, measurement)
}

fn parse(walk: &Walk<'_>, key: &str, written: &Written<'_>, measurement: &Limited<'_>) -> Option<Limit> {
    let refuse = |span: &Span, error: &LimitError| {
        // A pattern may match measurements that its writer did not think of.
        let what = if key == measurement.name {
            error.to_string()
        } else {
            format!("{} also limits {}: {error}", quoted(key), measurement.name)
        };
        walk.mistake(span.clone(), what, hint(error, measurement));
    };
    let (text, span) = &written.limit;
    let limit = Limit::parse(text, measurement.kind).map_err(|error| refuse(span, &error)).ok()?;
    match &written.marginal {
        None => Some(limit),
        Some((text, span)) => limit.with_marginal(text).map_err(|error| refuse(span, &error)).ok(),
    }
}

/// The hint of an error. For a missing unit it names the unit in which the measurement is usually shown.
fn hint(error: &LimitError, measurement: &Limited<'_>) -> String {
    match (error, measurement.kind) {
        (LimitError::MissingUnit { number, .. }, MeasurementKind::Number(_)) if measurement.unit != Unit::Count => {
            format!("write \"{number} {}\", if that is the unit you mean", measurement.unit)
        }
        _ => error.hint(),
    }
}

fn written<'t>(entry: &TomlEntry<'_, 't>) -> Option<Written<'t>> {
    let grammar = "a limit is one of: \"<= Q\", \">= Q\", \"Q .. Q\", \"Q +- Q\", \"Q +- N %\", \"== text\"";
    match entry.value() {
        Value::String(text) => Some(Written { limit: (text, entry.span()), marginal: None }),
        Value::Table(_) => entry.table()?.read(|table| {
            let (limit, marginal) = (table.required_text("limit", grammar), table.text("marginal"));
            Some(Written { limit: limit?, marginal })
        }),
        _ => {
            entry.mistake(format!("the limit of {} is not a text in quotes", quoted(entry.key())), grammar);
            None
        }
    }
}

fn unknown(entry: &TomlEntry<'_, '_>, id: ItemId) {
    let key = entry.key();
    let names = || id.spec().measurements.iter().map(|measurement| measurement.name);
    let what = if key.contains('*') {
        format!("{} matches no measurement of {id}", quoted(key))
    } else {
        format!("{id} does not measure {}", quoted(key))
    };
    let hint = did_you_mean(key, names(), || format!("it measures {}", names().collect::<Vec<_>>().join(", ")));
    entry.key_mistake(what, hint);
}

/// Whether a pattern matches a name; `*` in the pattern stands for any letters.
///
/// The work is at most the product of both lengths: the search goes back only to the last `*`.
fn matches(pattern: &str, name: &str) -> bool {
    let (pattern, name) = (pattern.as_bytes(), name.as_bytes());
    let (mut p, mut n) = (0, 0);
    let mut star: Option<(usize, usize)> = None;
    while n < name.len() {
        if pattern.get(p) == Some(&b'*') {
            star = Some((p, n));
            p += 1;
        } else if pattern.get(p) == Some(&name[n]) {
            p += 1;
            n += 1;
        } else if let Some((star_p, star_n)) = star {
            star = Some((star_p, star_n + 1));
            p = star_p + 1;
            n = star_n + 1;
        } else {
            return false;
        }
    }
    pattern[p..].iter().all(|byte| *byte == b'*')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_match_like_a_shell() {
        for (pattern, name, expected) in [
            ("*", "gyro_x", true),
            ("*", "", true),
            ("gyro_*", "gyro_x_noise", true),
            ("timer*_500us_mean", "timer2_500us_mean", true),
            ("timer*_500us_mean", "timer2_1ms_mean", false),
            ("*_noise", "gyro_x_noise", true),
            ("*_noise", "gyro_x_noise_", false),
            ("a*b*c", "aXbXbXc", true),
            ("a*b*c", "aXcXb", false),
            ("gyro_x", "gyro_x", true),
            ("gyro_", "gyro_x", false),
            ("**x**", "gyro_x", true),
        ] {
            assert_eq!(matches(pattern, name), expected, "{pattern} {name}");
        }
    }
}
