//! Whether log and report say the verdict that the record says. Their other lines depend on the version that wrote them, and on what
//! its station saw when it closed the run, so they are not made again and compared.

use std::path::Path;

use gnc_executive::outcome::Outcome;
use gnc_executive::record::RunRecord;
use gnc_executive::text;

use super::{Known, bytes};
use crate::report::REPORT;
use crate::store::{JOURNAL, LOG};

/// Words of verdicts beside those of outcomes.
const OTHERS: [&str; 3] = ["NOT RUN", "PARTIAL", "INTERRUPTED"];

/// What stands before the verdict in a report, and is nowhere else in it: a text has no such signs there.
const HEADING: &str = "<h1>";

/// The papers that say another verdict, a sentence each.
pub(super) fn unlike(run: &Path, record: &RunRecord, known: &Known) -> Vec<String> {
    let line = text::verdict_line(record);
    let Some(expected) = word_of(&line) else { return Vec::new() };
    let says_another = |file: &str, verdicts: fn(&str, &RunRecord) -> Vec<String>| {
        let text = bytes(run, file).ok().filter(|_| known.contains_key(Path::new(file)));
        let text = text.and_then(|text| String::from_utf8(text).ok()).unwrap_or_default();
        verdicts(&text, record).iter().any(|said| *said != expected)
    };
    let papers = [(LOG, of_log as fn(&str, &RunRecord) -> Vec<String>), (REPORT, of_report)];
    let unlike = papers.into_iter().filter(|(file, verdicts)| says_another(file, *verdicts));
    unlike.map(|(file, _)| format!("{file} does not say what {JOURNAL} says")).collect()
}

/// The verdicts of the lines that name the plan as the last line of a run does.
fn of_log(log: &str, record: &RunRecord) -> Vec<String> {
    let plan = format!("  {} {}  ", gnc_text::printable(&record.plan.name), gnc_text::printable(&record.plan.version));
    log.lines().filter(|line| line.contains(&plan)).filter_map(word_of).collect()
}

/// The verdict in the heading.
fn of_report(report: &str, _: &RunRecord) -> Vec<String> {
    report.split(HEADING).skip(1).filter_map(word_of).collect()
}

/// The word of a verdict with which a text begins.
fn word_of(text: &str) -> Option<String> {
    let outcomes = Outcome::ALL.map(|outcome| outcome.as_str().to_uppercase());
    let mut words = outcomes.iter().map(String::as_str).chain(OTHERS);
    let is_first = |word: &&str| text.strip_prefix(word).is_some_and(|rest| rest.starts_with(' '));
    words.find(is_first).map(str::to_owned)
}
