//! A run as lines for people: on a terminal, in a file, in a mail.
//!
//! Texts from outside (serial numbers, answers of boards, names in stored records) go through [`printable`]. So a line
//! here cannot move a cursor or hide another line.

mod log;

use std::fmt::Write as _;

use gnc_text::{printable, shortened};

use crate::catalogue::memory::FAULT;
use crate::event::{BenchKind, OtherModule};
use crate::measurement::{Measurement, Reading};
use crate::outcome::{Outcome, words};
use crate::record::{AttemptRecord, BreachRecord, ItemRecord, RunRecord};

pub use log::log_txt;

/// Width of an item's name in a line; most names are shorter.
const NAME_WIDTH: usize = 16;

/// Characters of the reason in an item's line. A board may send a long text, and the record has all of it.
const REASON_CHARACTERS: usize = 120;

/// Characters of a serial number in the verdict: a barcode reader may deliver 10 kB.
const SERIAL_NUMBER_CHARACTERS: usize = 60;

/// Width of the longest outcome.
const OUTCOME_WIDTH: usize = 8;

/// The line of an item that has ended: outcome, name, time, and the reason.
pub fn item_line(item: &ItemRecord) -> String {
    let outcome = words(item.outcome);
    let name = printable(&item.name);
    let time = item.elapsed_s.map(duration).unwrap_or_default();
    let mut line = format!("{outcome:OUTCOME_WIDTH$}  {name:NAME_WIDTH$}  {time:>9}");
    if item.attempts.len() > 1 {
        // Writing to a String cannot fail.
        let _ = write!(line, "  attempt {}", item.attempts.len());
    }
    let why = shortened(&reason(item), REASON_CHARACTERS);
    if !why.is_empty() {
        let _ = write!(line, "  {why}");
    }
    line.trim_end().to_owned()
}

/// The rows of items and measurements that are not good, each with its limit and what to look at; empty if there are
/// none.
pub fn failing_rows(record: &RunRecord) -> String {
    let mut out = String::new();
    for item in record.items.iter().filter(|item| is_bad(item.outcome)) {
        let _ = writeln!(out, "{} {}", printable(&item.name), words(item.outcome));
        out.push_str(&failing_item(item));
    }
    out
}

/// The rows of an item's measurements that are not good, and its error; empty if there are none.
pub fn failing_item(item: &ItemRecord) -> String {
    let mut out = String::new();
    if let Some(attempt) = item.last_attempt() {
        failing_attempt(&mut out, item, attempt);
    }
    out
}

/// The last line of a run: its verdict, and the number of items with each outcome.
pub fn verdict_line(record: &RunRecord) -> String {
    let mut verdict = if record.interrupted { "INTERRUPTED".to_owned() } else { record.verdict.words().to_uppercase() };
    // This stands beside the word itself, since a person may copy only this line.
    let caveats = caveats(record);
    if !caveats.is_empty() {
        let _ = write!(verdict, " ({})", caveats.join(", "));
    }
    let selected = record.items.iter().filter(|item| item.selected);
    let counts: Vec<String> = Outcome::ALL
        .into_iter()
        .map(|outcome| (outcome, selected.clone().filter(|item| item.outcome == outcome).count()))
        .filter(|(_, count)| *count > 0)
        .map(|(outcome, count)| format!("{count} {}", words(outcome)))
        .collect();
    format!(
        "{verdict}  {}  {} {}  {}  in {}",
        shortened(&record.serial_number, SERIAL_NUMBER_CHARACTERS),
        printable(&record.plan.name),
        printable(&record.plan.version),
        counts.join(", "),
        duration(record.elapsed_s)
    )
}

/// The rules of the interface document that the board broke, one line each; empty if there are none.
pub fn breach_lines(record: &RunRecord) -> Vec<String> {
    record.board_breaches.iter().map(breach_line).collect()
}

fn breach_line(breach: &BreachRecord) -> String {
    let BreachRecord { section, what, count, worst, safety, .. } = breach;
    let danger = if *safety { "DANGER: " } else { "" };
    let mut line =
        format!("{danger}the board does not keep section {section} of the interface document: {}", printable(what));
    let times = if *count == 1 { "once".to_owned() } else { format!("{count} times") };
    match worst {
        Some(worst) => {
            let _ = write!(line, " ({times}; {})", shortened(worst, REASON_CHARACTERS));
        }
        None => {
            let _ = write!(line, " ({times})");
        }
    }
    line
}

/// What must stand beside the word of every verdict, in a word each: why the record does not speak for the module.
pub fn caveats(record: &RunRecord) -> Vec<&'static str> {
    let all = [
        (record.bench.kind == BenchKind::Simulated, "simulated"),
        (record.bench.kind == BenchKind::Unproven, "unproven"),
        (record.selection.is_some(), "selection"),
        (record.recomputed.is_some(), "re-judged"),
        (record.other_module.is_some(), "other module"),
    ];
    all.into_iter().filter(|(is, _)| *is).map(|(_, word)| word).collect()
}

/// Lines that must stand beside every verdict: why this record does not speak for the module. Empty if it does.
pub fn banners(record: &RunRecord) -> Vec<String> {
    let mut banners = Vec::new();
    if record.bench.kind == BenchKind::Simulated {
        let personality = record.bench.personality.as_deref().unwrap_or("unknown");
        banners.push(format!("SIMULATED BENCH ({}): no evidence about any module", printable(personality)));
    }
    if record.bench.kind == BenchKind::Unproven {
        let why = record.bench.unproven.as_deref().unwrap_or("a program may play the board");
        banners.push(format!("UNPROVEN BENCH ({}): no evidence about any module", printable(why)));
    }
    if let Some(OtherModule { scanned, found, .. }) = &record.other_module {
        let (scanned, found) = (printable(scanned), printable(found));
        banners.push(format!(
            "NOT THE SCANNED MODULE: {scanned} was scanned, {found} is in the socket; this run is filed against neither"
        ));
    }
    if let Some(selection) = &record.selection {
        let names: Vec<_> = selection.iter().map(|name| printable(name)).collect();
        banners.push(format!("SELECTION ({}): not a pass of the module", names.join(", ")));
    }
    if let Some(earlier) = &record.recomputed {
        let run = printable(&earlier.run);
        banners.push(format!("RE-JUDGED (the samples of run {run} by these limits): the module was not tested again"));
    }
    for breach in record.board_breaches.iter().filter(|breach| breach.safety) {
        banners.push(format!("DANGER: {}", printable(&breach.what)));
    }
    if record.interrupted {
        banners.push("INTERRUPTED: the run has no end, and its record shows what is known".to_owned());
    }
    banners
}

/// A measurement as one line: name, value, coverage interval, limit.
pub fn measurement_line(measurement: &Measurement) -> String {
    let mut line = printable(&measurement.name).into_owned();
    if let Some(repeat) = measurement.repeat {
        let _ = write!(line, " ({repeat})");
    }
    let _ = write!(line, " {}", measurement.value_text());
    let known = measurement.uncertainty_text();
    if !known.is_empty() {
        let _ = write!(line, " [{known}]");
    }
    let limit = measurement.limit_text();
    if limit.is_empty() { line } else { format!("{line} ({limit})") }
}

/// A duration for people: "0.31 s", "12.4 s", "2 min 05 s", "1 h 02 min".
pub fn duration(seconds: f64) -> String {
    if !(0.0..3.6e8).contains(&seconds) {
        return "unknown".to_owned();
    }
    // The number is rounded first, so that 59.96 s does not become "60.0 s".
    let whole = seconds.round() as u64;
    if seconds < 9.995 {
        format!("{seconds:.2} s")
    } else if seconds < 59.95 {
        format!("{seconds:.1} s")
    } else if whole < 3600 {
        format!("{} min {:02} s", whole / 60, whole % 60)
    } else {
        let minutes = (seconds / 60.0).round() as u64;
        format!("{} h {:02} min", minutes / 60, minutes % 60)
    }
}

fn is_bad(outcome: Outcome) -> bool {
    matches!(outcome, Outcome::Marginal | Outcome::Failed | Outcome::Errored | Outcome::Aborted)
}

/// The reason for an item's outcome: its cause, its error, its worst value, or the good value nearest to its limit.
pub fn reason(item: &ItemRecord) -> String {
    if let Some(cause) = &item.cause {
        return printable(&cause.to_string()).into_owned();
    }
    let Some(attempt) = item.last_attempt() else { return String::new() };
    if let Some(error) = &attempt.error {
        return printable(&error.text).into_owned();
    }
    let bad = || attempt.measurements.iter().filter(|measurement| measurement.outcome.is_some_and(is_bad));
    // Among equally bad values the first one counts: later ones often follow from it.
    let Some(worst) = bad().rev().max_by_key(|measurement| severity(measurement)) else {
        return nearest_to_limit(attempt).map(measurement_line).unwrap_or_default();
    };
    match bad().count() - 1 {
        0 => measurement_line(worst),
        others => format!("{} and {others} more", measurement_line(worst)),
    }
}

/// The good value with the least room to its limit, as a fraction of the whole room.
fn nearest_to_limit(attempt: &AttemptRecord) -> Option<&Measurement> {
    let judged = attempt.measurements.iter().filter(|measurement| measurement.outcome.is_some());
    judged.min_by(|a, b| room(a).total_cmp(&room(b)))
}

/// Room to the limit: 1 in the middle of the limit or far from a single bound, 0 on a bound. Texts and exact counts
/// have 1.
fn room(measurement: &Measurement) -> f64 {
    let Reading::Number(value) = measurement.value else { return 1.0 };
    match (measurement.low, measurement.high) {
        (Some(low), Some(high)) if high > low => (value - low).min(high - value) / ((high - low) / 2.0),
        (None, Some(bound)) | (Some(bound), None) if bound != 0.0 => ((value - bound) / bound).abs(),
        _ => 1.0,
    }
}

fn severity(measurement: &Measurement) -> usize {
    let rank = |outcome| Outcome::ALL.iter().position(|other| *other == outcome).unwrap_or(0);
    measurement.outcome.map_or(0, rank)
}

/// The one cause that the mismatches of a memory have in common, if they have one.
pub fn common_fault(attempt: &AttemptRecord) -> Option<String> {
    let fault = attempt.measurements.iter().find(|measurement| measurement.name == FAULT.name)?.value_text();
    let is_one = ["one ", "bit "].iter().any(|start| fault.starts_with(start));
    is_one.then(|| printable(&fault).into_owned())
}

fn failing_attempt(out: &mut String, item: &ItemRecord, attempt: &AttemptRecord) {
    let common = common_fault(attempt);
    for measurement in &attempt.measurements {
        let Some(outcome) = measurement.outcome.filter(|outcome| is_bad(*outcome)) else { continue };
        let _ = writeln!(out, "  {:OUTCOME_WIDTH$}  {}", words(outcome), measurement_line(measurement));
        if let Some(spec) = item.id.spec().measurement(&measurement.name).filter(|_| common.is_none()) {
            let _ = writeln!(out, "            look at: {}", spec.look_at);
        }
    }
    if let Some(common) = common {
        let _ = writeln!(out, "            look at: {common}");
    }
    for record in &attempt.error_records {
        let _ = writeln!(out, "  board:    {}", error_record(record));
    }
    if let Some(error) = &attempt.error {
        let _ = writeln!(out, "  error:    {}", printable(&error.text));
        if !error.hint.is_empty() {
            let _ = writeln!(out, "            try: {}", printable(&error.hint));
        }
    }
}

/// An error record of the slave as one line.
fn error_record(record: &crate::event::ErrorRecord) -> String {
    let text = format!(
        "{} at {}: expected {}, got {} (board time {})",
        record.what,
        record.location,
        record.expected,
        record.got,
        duration(record.board_time_us as f64 / 1e6)
    );
    printable(&text).into_owned()
}

#[cfg(test)]
mod tests;
