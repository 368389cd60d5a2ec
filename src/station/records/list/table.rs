//! A run as the fields of a list. Names and meanings stay: programs of others read them.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;

use chrono::{DateTime, FixedOffset, SecondsFormat};
use gnc_executive::event::{BenchKind, OtherModule};
use gnc_executive::outcome::Outcome;
use gnc_executive::standing::{Flaw, Seal};
use gnc_executive::verdict::Verdict;
use gnc_records::standing::Seals;
use gnc_records::store::reader::{Found, FoundRun};
use gnc_text::printable;
use serde::Serialize;

/// Between several names in one cell.
const BETWEEN_NAMES: &str = ";";
/// Characters with which a spreadsheet begins a formula, or a number of money.
const FORMULA: [char; 14] =
    ['=', '+', '-', '@', '\t', '\r', '\u{ff1d}', '\u{ff0b}', '\u{ff0d}', '\u{ff20}', '$', '€', '£', '¥'];
/// Words that a spreadsheet reads within numbers, dates and times, at least by their first letters.
const NUMBER_WORDS: [&str; 15] =
    ["e", "am", "pm", "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"];
/// Marks that a spreadsheet reads within numbers, dates and times.
const NUMBER_MARKS: &str = ".,-/: +%'()";

/// A run of the list. What is not known of a run is null.
#[derive(Debug, Default, Serialize)]
pub(super) struct Line<'a> {
    /// `DATE/SERIAL/TIME-PLAN`.
    run: String,
    state: &'static str,
    outcome: Option<Outcome>,
    selection_outcome: Option<Outcome>,
    serial_number: Option<&'a str>,
    /// The number in the socket, if it is not the scanned one. The run is of neither, so `serial_number` is null.
    other_module: Option<String>,
    plan: Option<&'a str>,
    plan_version: Option<&'a str>,
    plan_sha256: Option<&'a str>,
    started: Option<DateTime<FixedOffset>>,
    finished: Option<DateTime<FixedOffset>>,
    elapsed_s: Option<f64>,
    station: Option<&'a str>,
    operator: Option<&'a str>,
    simulated: Option<bool>,
    selection: Option<&'a [String]>,
    /// Numbers of orders, sub-units and others, by their keys.
    numbers: Option<BTreeMap<&'a str, &'a str>>,
    #[serde(rename = "loop")]
    looped: Option<u32>,
    recomputed: Option<&'a str>,
    resumed: Option<&'a str>,
    program_version: Option<&'a str>,
    program_commit: Option<&'a str>,
    error: Option<String>,
    /// How the record of a closed run is kept, whatever the run says.
    seal: Option<&'static str>,
    /// "real", "unproven" or "simulated".
    bench: Option<&'static str>,
    /// The outcome of old samples that were judged by another plan: the module was not tested, so `outcome` and
    /// `selection_outcome` are null.
    rejudged_outcome: Option<Outcome>,
    /// The outcome of a run on an unproven bench, which says nothing of a module: `outcome` and `selection_outcome` are
    /// null, so that a program that knows nothing of such benches counts no pass.
    unproven_outcome: Option<Outcome>,
}

/// The word of a list for how a record is kept; `None` while its station still closes it.
pub(super) fn seal_word(kept: Seal) -> Option<&'static str> {
    match kept {
        Seal::Chained => Some("held"),
        Seal::Flawed(Flaw::NotInChain) => Some("not_in_chain"),
        Seal::Flawed(Flaw::ClosedLate) => Some("closed_late"),
        Seal::Flawed(Flaw::UnderWay | Flaw::NotClosed) => None,
        Seal::Flawed(Flaw::Unreadable) => Some("unreadable"),
        Seal::Flawed(_) => Some("changed"),
    }
}

/// The chain says of a changed run that it was closed, whatever its journal says now. Of one whose record or digests cannot be read
/// nothing is known.
fn state(found: &FoundRun, kept: Option<Seal>) -> Found {
    match kept {
        Some(Seal::Flawed(Flaw::Changed)) => Found::Closed,
        Some(Seal::Flawed(Flaw::Unreadable)) => Found::Unreadable,
        _ => found.state(),
    }
}

impl<'a> Line<'a> {
    pub(super) fn of(found: &'a FoundRun, records: &Path, kept: Option<Seal>) -> Self {
        let run = found.run.as_ref().ok();
        // A run at its very start has no whole event yet, which is no error.
        let error = found.run.as_ref().err().filter(|_| !found.running);
        let (tested, rejudged, unproven) = match super::proved(found, kept) {
            verdict if run.is_some_and(|run| run.recomputed.is_some()) => (None, verdict, None),
            verdict if run.is_some_and(|run| run.bench.kind == BenchKind::Unproven) => (None, None, verdict),
            verdict => (verdict, None, None),
        };
        Self {
            run: found.place(records),
            state: state(found, kept).as_str(),
            outcome: tested.and_then(Verdict::of_module),
            selection_outcome: tested.and_then(Verdict::of_selection),
            rejudged_outcome: rejudged.map(Verdict::of_items),
            unproven_outcome: unproven.map(Verdict::of_items),
            serial_number: run.filter(|run| run.other_module.is_none()).map(|run| run.serial_number.as_str()),
            other_module: run.and_then(|run| run.other_module.as_ref()).map(both_numbers),
            plan: run.map(|run| run.plan.name.as_str()),
            plan_version: run.map(|run| run.plan.version.as_str()),
            plan_sha256: run.map(|run| run.plan.sha256.as_str()),
            started: run.map(|run| run.started),
            finished: run.and_then(|run| run.finished),
            elapsed_s: run.map(|run| run.elapsed_s),
            station: run.map(|run| run.station.as_str()),
            operator: run.and_then(|run| run.operator.as_deref()),
            simulated: run.map(|run| run.bench.kind == BenchKind::Simulated),
            bench: run.map(|run| run.bench.kind.as_str()),
            selection: run.and_then(|run| run.selection.as_deref()),
            numbers: run
                .filter(|run| !run.numbers.is_empty())
                .map(|run| run.numbers.iter().map(|number| (number.key.as_str(), number.value.as_str())).collect()),
            looped: run.and_then(|run| run.looped).map(|looped| looped.index),
            recomputed: run.and_then(|run| run.recomputed.as_ref()).map(|earlier| earlier.run.as_str()),
            resumed: run.and_then(|run| run.resumed.as_ref()).map(|earlier| earlier.run.as_str()),
            program_version: run.map(|run| run.program.version.as_str()),
            program_commit: run.and_then(|run| run.program.build.as_ref()).map(|build| build.commit.as_str()),
            error: error.map(|error| gnc_text::with_causes(error)),
            seal: kept.and_then(seal_word),
        }
    }

    fn write(&self, table: &mut csv::Writer<impl Write>) -> io::Result<()> {
        table.write_record(self.cells().map(|(_, cell)| cell)).map_err(of_system)
    }

    /// Each field with its name, in the order of the columns.
    fn cells(&self) -> [(&'static str, String); 27] {
        let text = |text: Option<&str>| text.map(safe).unwrap_or_default();
        let outcome = |outcome: Option<Outcome>| outcome.map(Outcome::as_str).unwrap_or_default().to_owned();
        let time = |time: Option<DateTime<FixedOffset>>| {
            time.map(|time| time.to_rfc3339_opts(SecondsFormat::AutoSi, true)).unwrap_or_default()
        };
        [
            ("run", safe(&self.run)),
            ("state", self.state.to_owned()),
            ("outcome", outcome(self.outcome)),
            ("selection_outcome", outcome(self.selection_outcome)),
            ("serial_number", text(self.serial_number)),
            ("other_module", text(self.other_module.as_deref())),
            ("plan", text(self.plan)),
            ("plan_version", text(self.plan_version)),
            ("plan_sha256", text(self.plan_sha256)),
            ("started", time(self.started)),
            ("finished", time(self.finished)),
            ("elapsed_s", self.elapsed_s.map(|elapsed_s| elapsed_s.to_string()).unwrap_or_default()),
            ("station", text(self.station)),
            ("operator", text(self.operator)),
            ("simulated", self.simulated.map(|simulated| simulated.to_string()).unwrap_or_default()),
            ("selection", text(self.selection.map(|names| names.join(BETWEEN_NAMES)).as_deref())),
            ("numbers", text(self.numbers.as_ref().map(together).as_deref())),
            ("loop", self.looped.map(|index| index.to_string()).unwrap_or_default()),
            ("recomputed", text(self.recomputed)),
            ("resumed", text(self.resumed)),
            ("program_version", text(self.program_version)),
            ("program_commit", text(self.program_commit)),
            ("error", text(self.error.as_deref())),
            ("seal", self.seal.unwrap_or_default().to_owned()),
            ("bench", self.bench.unwrap_or_default().to_owned()),
            ("rejudged_outcome", outcome(self.rejudged_outcome)),
            ("unproven_outcome", outcome(self.unproven_outcome)),
        ]
    }
}

/// All numbers of a run in one cell.
fn together(numbers: &BTreeMap<&str, &str>) -> String {
    numbers.iter().map(|(key, value)| format!("{key}={value}")).collect::<Vec<_>>().join(BETWEEN_NAMES)
}

/// Both numbers of a run whose module is not the one that was scanned.
fn both_numbers(other: &OtherModule) -> String {
    format!("{} was scanned, {} is in the socket", other.scanned, other.found)
}

/// Writes the runs as a table with a head.
pub(super) fn csv(out: impl Write, records: &Path, runs: impl Iterator<Item = FoundRun>) -> io::Result<()> {
    let mut table = csv::Writer::from_writer(out);
    table.write_record(Line::default().cells().map(|(name, _)| name)).map_err(of_system)?;
    let mut seals = Seals::new(records);
    for found in runs {
        let kept = super::kept(&found, &mut seals)?;
        Line::of(&found, records, kept).write(&mut table)?;
    }
    table.flush()
}

/// The error of the system in an error of the table, so that a reader who has seen enough is known.
fn of_system(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        other => io::Error::other(format!("{other:?}")),
    }
}

/// A text that a spreadsheet shows as it is. One that a spreadsheet would calculate or shorten has an apostrophe before
/// it, which makes it a text everywhere. A row stays one line, and each character shows itself.
fn safe(text: &str) -> String {
    let is_formula = text.starts_with(FORMULA);
    let text = &*printable(text);
    if is_formula || text.starts_with(FORMULA) || is_number_like(text) { format!("'{text}") } else { text.to_owned() }
}

/// Whether a spreadsheet may take the text for a number, a date, a time or a truth: it would show `0012` as 12.
fn is_number_like(text: &str) -> bool {
    let text = text.trim();
    if text.is_empty() || text.eq_ignore_ascii_case("true") || text.eq_ignore_ascii_case("false") {
        return !text.is_empty();
    }
    let words: Vec<String> = text.split(|mark: char| !mark.is_alphabetic()).map(str::to_lowercase).collect();
    let known = |word: &String| {
        NUMBER_WORDS.iter().any(|known| if known.len() < 3 { word == known } else { word.starts_with(known) })
    };
    text.chars().any(char::is_numeric)
        && words.iter().filter(|word| !word.is_empty()).all(known)
        && text.chars().all(|mark| mark.is_alphanumeric() || NUMBER_MARKS.contains(mark))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_spreadsheet_would_calculate_is_a_text() {
        for text in [
            "=cmd|' /C calc'!A0",
            "+1",
            "-1",
            "@SUM(1)",
            "\t=1",
            "＝1",
            "0012",
            "1E5",
            "12e3",
            "3-4",
            "1/2",
            "12:30",
            "SEP-0001",
            "March 3",
            "3 pm",
            "1,5",
            "50 %",
            "TRUE",
            "false",
            "$12",
            "12345678901234567890",
            "1.0",
            "(5)",
        ] {
            assert_eq!(safe(text), format!("'{}", printable(text)), "{text}");
        }
        for text in [
            "",
            "T-1",
            "SN-0001",
            "4C-0012",
            "functional",
            "Zhang Wei",
            "a=b",
            "2026-11-28/T-1/143015-functional",
            "GNC-POP-26B",
            "MARK-1 x",
            "№ abc",
        ] {
            assert_eq!(safe(text), text, "{text}");
        }
    }

    #[test]
    fn the_table_has_the_fields_of_the_objects_in_their_order() {
        let line = Line { run: "2026-11-28/0012/1-x".to_owned(), serial_number: Some("a,\"b\"\nc"), ..Line::default() };
        let object = serde_json::to_string(&line).unwrap();
        let mut from = 0;
        for (name, _) in line.cells() {
            let at = object[from..].find(&format!("\"{name}\":"));
            from += at.unwrap_or_else(|| panic!("{name} does not follow in {object}"));
        }
        assert_eq!(
            serde_json::from_str::<serde_json::Value>(&object).unwrap().as_object().unwrap().len(),
            line.cells().len()
        );
        let mut table = csv::Writer::from_writer(Vec::new());
        line.write(&mut table).unwrap();
        let text = String::from_utf8(table.into_inner().unwrap()).unwrap();
        assert!(text.contains("\"a,\"\"b\"\"\\nc\""), "{text}");
        assert_eq!(text.lines().count(), 1);
    }
}
