//! Whether the files of a run say what its journal says. A station makes them from the journal and only then the digests; a
//! file that was put there before that stands under digests that fit.

mod verdict;

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

use gnc_executive::measurement::{Measurement, Reading};
use gnc_executive::outcome::Outcome;
use gnc_executive::record::{ItemFile, RunRecord};
use gnc_executive::state::{Row, RunState};
use serde_json::Value;

use super::contents::PlanFiles;
use super::reader::MAX_RECORD_BYTES;
use super::unread::says_nothing;
use super::{ITEM, JOURNAL, PLAN, RECORD, item_folder, pending};
use crate::passport::{self, PASSPORT, PASSPORT_XML};

/// Files of a run that are as they were closed, by their names, and their digests.
type Known = HashMap<PathBuf, String>;

/// What the files of a closed run say against its journal, a sentence each. `record_sha256` is the digest of the record, as a
/// passport has it. `known` are the files that are as they were closed; all that is wrong with the others was said. A field that only
/// one of both has is of another version, and says nothing.
pub(super) fn unlike(run: &Path, state: RunState, record_sha256: &str, known: &Known) -> Vec<String> {
    let mut problems = Vec::new();
    problems.extend(plan(run, &state, known));
    problems.extend(items(run, &state, known));
    problems.extend(raw(&state, known));
    problems.extend(judged_otherwise(&state));
    let bytes = bytes(run, RECORD);
    // That it cannot be read was said with its digest.
    let is_unread = bytes.as_ref().is_err_and(says_nothing);
    let stored = bytes.ok().and_then(|bytes| serde_json::from_slice::<RunRecord>(&bytes).ok());
    let record = RunRecord::of_folded(state);
    let is_same = (stored.as_ref().zip(record.as_ref()))
        .is_some_and(|(stored, folded)| folded.clone().closed_like(stored) == *stored);
    if !is_same && !is_unread {
        problems.push(format!("{RECORD} does not say what {JOURNAL} says"));
    }
    if let Some(stored) = stored.filter(|_| is_same) {
        problems.extend(verdict::unlike(run, &stored, known));
    }
    problems.extend(record.and_then(|record| passport(run, &record, record_sha256, known)));
    problems
}

/// A file of the run, under the name that it has now.
fn bytes(run: &Path, file: &str) -> io::Result<Vec<u8>> {
    let path = pending::path(run, file);
    gnc_files::read_below(run, path.strip_prefix(run).unwrap_or(&path), MAX_RECORD_BYTES)
}

fn value(run: &Path, file: &str) -> Option<Value> {
    serde_json::from_slice(&bytes(run, file).ok()?).ok()
}

/// The plan that was filed is the one that the run followed.
fn plan(run: &Path, state: &RunState, known: &Known) -> Option<String> {
    let filed = known.keys().filter(|file| file.starts_with(PLAN)).count();
    (filed > 0 && PlanFiles::count_of(run, state).is_some_and(|count| count != filed))
        .then(|| format!("{PLAN}/ does not hold the plan that {JOURNAL} names"))
}

/// The file of each item.
fn items(run: &Path, state: &RunState, known: &Known) -> Vec<String> {
    let mut problems = Vec::new();
    for (position, row) in state.rows().iter().enumerate() {
        let file = format!("{}/{ITEM}", item_folder(position, &row.planned.name));
        // An item without an end has no file.
        if !known.contains_key(Path::new(&file)) {
            continue;
        }
        // A file that can be read is no longer than the bound, and a journal may say much more.
        let said = ItemFile::from_state(state, position).filter(is_within_bound);
        let said = said.and_then(|item| serde_json::to_value(item).ok());
        let is_same = said.is_some_and(|said| value(run, &file).is_some_and(|stored| agree(&stored, &said)));
        if !is_same {
            problems.push(format!("{} does not say what {JOURNAL} says", gnc_text::shown_path(Path::new(&file))));
        }
    }
    problems
}

/// Whether a file of an item is one that would be read. Nothing of it is kept.
fn is_within_bound(item: &ItemFile) -> bool {
    serde_json::to_writer(Room(MAX_RECORD_BYTES), item).is_ok()
}

/// Takes so many bytes and keeps none.
struct Room(u64);

impl io::Write for Room {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 = self.0.checked_sub(bytes.len() as u64).ok_or(io::ErrorKind::FileTooLarge)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// What the journal calls good against its own figures: a value beyond the limits that stand beside it, and an attempt with a
/// measurement that is not good. Who edits a verdict alone is found so. A verdict that is worse than the figures is none of these:
/// a coverage interval, or the procedure, may have decided it.
fn judged_otherwise(state: &RunState) -> Vec<String> {
    let mut problems = Vec::new();
    for row in state.rows() {
        let item = gnc_text::printable(&row.planned.name);
        for (number, attempt) in (1..).zip(&row.attempts) {
            for measurement in &attempt.measurements {
                if measurement.outcome.is_some_and(Outcome::is_good) && is_beyond(measurement) {
                    let name = gnc_text::printable(&measurement.name);
                    problems.push(format!(
                        "{JOURNAL} calls {name} of {item} good in attempt {number} although its value is beyond the limit beside it"
                    ));
                }
            }
            let bad = attempt.measurements.iter().find(|one| one.outcome.is_some_and(|outcome| !outcome.is_good()));
            if let Some(bad) = bad.filter(|_| attempt.outcome.is_some_and(Outcome::is_good)) {
                let name = gnc_text::printable(&bad.name);
                problems.push(format!("{JOURNAL} calls attempt {number} of {item} good although {name} in it is not"));
            }
        }
        let last = row.attempts.last().and_then(|attempt| attempt.outcome);
        if row.outcome.is_good() && last.is_some_and(|last| !last.is_good()) {
            problems.push(format!("{JOURNAL} calls {item} good although its last attempt is not"));
        }
    }
    problems
}

/// Whether a value is not within its own limit. A pattern is of the plan's language, and is not compared.
fn is_beyond(measurement: &Measurement) -> bool {
    match &measurement.value {
        Reading::Number(number) => {
            measurement.low.is_some_and(|low| *number < low) || measurement.high.is_some_and(|high| *number > high)
        }
        Reading::Text(text) => {
            measurement.expected.as_ref().is_some_and(|expected| expected != text)
                || !measurement.one_of.is_empty() && !measurement.one_of.contains(text)
        }
        Reading::Null => true,
    }
}

/// Each raw file is of an attempt that the journal has.
fn raw(state: &RunState, known: &Known) -> Vec<String> {
    let raw = known.keys().filter(|file| file.extension().is_some_and(|extension| extension == "mcap"));
    let stray = raw.filter(|file| attempt(file).is_none_or(|(item, attempt)| !has_attempt(state, item, attempt)));
    let mut stray: Vec<_> =
        stray.map(|file| format!("{} is of no attempt that {JOURNAL} has", gnc_text::shown_path(file))).collect();
    stray.sort();
    stray
}

fn has_attempt(state: &RunState, item: usize, attempt: usize) -> bool {
    let row = item.checked_sub(1).and_then(|position| state.rows().get(position));
    // A power cut may take the last lines of a journal and leave the file of the attempt that they began.
    let more = |row: &Row| usize::from(state.is_interrupted() && !row.is_over());
    row.is_some_and(|row| (1..=row.attempts.len() + more(row)).contains(&attempt))
}

/// Number of the item and of the attempt, both from 1, by the path of a raw file: `02-rotation/attempt-1-3.mcap`.
fn attempt(file: &Path) -> Option<(usize, usize)> {
    let folder = file.parent()?.to_str()?;
    let (item, _) = folder.split_once('-').filter(|_| !folder.contains('/'))?;
    let attempt = file.file_stem()?.to_str()?.strip_prefix("attempt-")?;
    let attempt = attempt.split_once('-').map_or(attempt, |(attempt, _)| attempt);
    Some((item.parse().ok()?, attempt.parse().ok()?))
}

/// The passport is the one that follows from the journal, in both of its forms.
fn passport(run: &Path, record: &RunRecord, record_sha256: &str, known: &Known) -> Option<String> {
    let is_known = |file: &str| known.contains_key(Path::new(file));
    if !is_known(PASSPORT) {
        return (is_known(PASSPORT_XML) && !pending::path(run, PASSPORT).exists())
            .then(|| format!("{PASSPORT_XML} is there without {PASSPORT}"));
    }
    let unlike = || Some(format!("{PASSPORT} does not say what {JOURNAL} says"));
    let Some(stored) = value(run, PASSPORT) else { return unlike() };
    let said = match passport::of_run(record, record_sha256, stored["origin"]["chain"].as_str()) {
        Ok(said) => serde_json::to_value(said).ok(),
        Err(why) => return Some(format!("{PASSPORT} is there, and by {JOURNAL} the run has none: {why}")),
    };
    if !said.is_some_and(|said| agree(&stored, &said)) {
        return unlike();
    }
    if !is_known(PASSPORT_XML) {
        return None;
    }
    let xml = bytes(run, PASSPORT_XML).ok();
    let is_same = xml.is_some_and(|xml| passport::xml_of(&stored).is_ok_and(|said| said == xml));
    (!is_same).then(|| format!("{PASSPORT_XML} does not say what {PASSPORT} says"))
}

/// Whether two values are the same in all that both have.
fn agree(one: &Value, other: &Value) -> bool {
    match (one, other) {
        (Value::Object(one), Value::Object(other)) => {
            one.iter().all(|(key, value)| other.get(key).is_none_or(|other| agree(value, other)))
        }
        (Value::Array(one), Value::Array(other)) => {
            one.len() == other.len() && one.iter().zip(other).all(|(one, other)| agree(one, other))
        }
        (Value::Number(one), Value::Number(other)) => one == other || one.as_f64() == other.as_f64(),
        (one, other) => one == other,
    }
}

#[cfg(test)]
mod tests;
