//! Checks that several tables of a personality need.

use gnc_config::{TomlEntry, TomlTable, did_you_mean};
use gnc_text::quoted;

use crate::world::ModuleAxis;

/// Reads a whole number within bounds.
pub(super) fn whole<T: TryFrom<i64>>(entry: &TomlEntry<'_, '_>, bounds: (i64, i64)) -> Option<T> {
    T::try_from(entry.integer(bounds)?).ok()
}

/// Reads a required whole number within bounds.
pub(super) fn required_whole<T: TryFrom<i64>>(
    table: &TomlTable<'_, '_>,
    key: &'static str,
    (low, high): (i64, i64),
) -> Option<T> {
    whole(&table.required(key, &format!("it may be {low} to {high}"))?, (low, high))
}

/// Reads a required number within bounds.
pub(super) fn required_number(table: &TomlTable<'_, '_>, key: &'static str, (low, high): (f64, f64)) -> Option<f64> {
    table.required(key, &format!("it may be {low} to {high}"))?.number((low, high))
}

/// Number of events from one fault to the next; 0 or no key: no fault.
pub(super) fn count(table: &TomlTable<'_, '_>, key: &'static str) -> u32 {
    table.entry(key).and_then(|entry| whole(&entry, (0, u32::MAX.into()))).unwrap_or(0)
}

/// Whether a line or a bit is high.
pub(super) fn level(table: &TomlTable<'_, '_>) -> Option<bool> {
    Some(required_whole::<u8>(table, "level", (0, 1))? == 1)
}

/// Two different whole numbers.
pub(super) fn pair(entry: &TomlEntry<'_, '_>, bounds: (i64, i64)) -> Option<(u8, u8)> {
    let [one, other] = entry.array("two different whole numbers")?;
    let (a, b) = (whole(&one, bounds), whole(&other, bounds));
    let (a, b): (u8, u8) = (a?, b?);
    if a == b {
        other.mistake(format!("{a} is twice in {}", entry.key()), "write two different numbers");
        return None;
    }
    Some((a, b))
}

/// Reads this many numbers, each within the same bounds.
pub(super) fn numbers<const N: usize>(entry: &TomlEntry<'_, '_>, wanted: &str, bounds: (f64, f64)) -> Option<[f64; N]> {
    let read = entry.array::<N>(wanted)?.map(|element| element.number(bounds));
    read.iter().all(Option::is_some).then(|| read.map(Option::unwrap_or_default))
}

/// X, Y or Z.
pub(super) fn axis(entry: &TomlEntry<'_, '_>) -> Option<ModuleAxis> {
    const NAMES: [&str; 3] = ["x", "y", "z"];
    let name = choice(entry, &NAMES)?;
    NAMES.iter().position(|known| *known == name).map(|index| ModuleAxis::ALL[index])
}

/// Some of the three axes.
pub(super) fn axes(table: &TomlTable<'_, '_>, key: &'static str) -> [bool; 3] {
    let mut set = [false; 3];
    for axis in table.list(key, "a list of \"x\", \"y\" and \"z\"").iter().filter_map(axis) {
        set[axis.index()] = true;
    }
    set
}

/// Reads one of several texts.
pub(super) fn choice<'t>(entry: &TomlEntry<'_, 't>, known: &[&str]) -> Option<&'t str> {
    let text = entry.text()?;
    if known.contains(&text) {
        return Some(text);
    }
    let hint = did_you_mean(text, known.iter().copied(), || format!("it may be {}", known.join(", ")));
    entry.mistake(format!("{} cannot be {}", entry.key(), quoted(text)), hint);
    None
}

/// Reads a text with at most `most` bytes.
pub(super) fn short_text(table: &TomlTable<'_, '_>, key: &'static str, most: usize) -> Option<String> {
    let (text, span) = table.text(key)?;
    if text.len() > most {
        table.mistake_at(span, format!("{key} has {} bytes", text.len()), format!("it may have at most {most}"));
        return None;
    }
    Some(text.to_owned())
}

/// Replaces a default by a value that was read.
pub(super) fn set<T>(place: &mut T, read: Option<T>) {
    if let Some(read) = read {
        *place = read;
    }
}

/// Refuses a key that changes nothing without another one.
pub(super) fn needs(table: &TomlTable<'_, '_>, key: &'static str, other: &'static str) {
    if let Some(entry) = table.entry(key)
        && !table.has(other)
    {
        entry.key_mistake(format!("{key} changes nothing alone"), format!("write {other} beside it"));
    }
}
