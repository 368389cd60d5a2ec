//! The results of a campaign as a table for people.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::Duration;

use gnc_executive::outcome::Outcome;
use gnc_executive::record::RunRecord;

use super::Judged;
use super::case::Disturbance;
use super::judge::counted_losses;

/// Outcomes in the order of the columns.
const COLUMNS: [Outcome; 5] = [Outcome::Passed, Outcome::Marginal, Outcome::Failed, Outcome::Errored, Outcome::Aborted];

#[derive(Default)]
struct Row {
    runs: usize,
    ended: [usize; COLUMNS.len()],
    retries: usize,
    violations: usize,
    longest: Duration,
}

/// Outcomes by faults of the line and by disturbances, first-pass yield, and the longest times.
#[must_use]
pub fn table(all: &[Judged]) -> String {
    let mut rows: BTreeMap<String, Row> = BTreeMap::new();
    for judged in all {
        for name in names(judged) {
            let row = rows.entry(name).or_default();
            row.runs += 1;
            let outcome = judged.ran.record.as_ref().map(|record| record.verdict.of_items());
            if let Some(column) = COLUMNS.iter().position(|column| Some(*column) == outcome) {
                row.ended[column] += 1;
            }
            row.retries += usize::from(judged.ran.record.as_ref().is_some_and(|record| retries(record) > 0));
            row.violations += usize::from(!judged.violations.is_empty());
            row.longest = row.longest.max(judged.ran.took);
        }
    }
    let mut text = format!(
        "{:40} {:>5} {:>6} {:>8} {:>6} {:>7} {:>7} {:>7} {:>10} {:>9}\n",
        "", "runs", "passed", "marginal", "failed", "errored", "aborted", "retried", "violations", "longest"
    );
    for (name, row) in &rows {
        let [passed, marginal, failed, errored, aborted] = row.ended;
        let _ = writeln!(
            text,
            "{name:40} {:5} {passed:6} {marginal:8} {failed:6} {errored:7} {aborted:7} {:7} {:10} {:7.1} s",
            row.runs,
            row.retries,
            row.violations,
            row.longest.as_secs_f64()
        );
    }
    text.push_str(&yields(all));
    text.push_str(&times(all));
    let counted: Vec<(u64, u64)> = all.iter().filter_map(|judged| counted_losses(&judged.case, &judged.ran)).collect();
    let (missing, missable) = counted.iter().fold((0, 0), |(a, b), (c, d)| (a + c, b + d));
    let _ = writeln!(
        text,
        "losses counted on both sides in {} runs: the line spoilt {missable} frames, the station missed {missing}",
        counted.len()
    );
    text
}

/// The rows in which a run counts.
fn names(judged: &Judged) -> Vec<String> {
    let case = &judged.case;
    let happened = judged.ran.since_disturbed.is_some();
    let disturbance = match case.disturbance {
        _ if !happened => "undisturbed",
        Disturbance::None => "undisturbed",
        Disturbance::Stop { again: None } => "stopped in order",
        Disturbance::Stop { again: Some(_) } => "stopped in order, then at once",
        Disturbance::Suspend(_) => "suspended",
        Disturbance::Unplug { back: None } => "unplugged",
        Disturbance::Unplug { back: Some(_) } => "unplugged and plugged in again",
    };
    let line = match case.kinds.as_slice() {
        [] => "clean".to_owned(),
        [one] => one.trim_end_matches("_per_million").replace('_', " "),
        _ => "several faults".to_owned(),
    };
    let board = if case.breach.is_empty() { "keeps the interface document" } else { "breaks one rule of it" };
    let module = if is_good(judged) { "good" } else { "bad" };
    vec![
        "all".to_owned(),
        format!("module: {module}"),
        format!("link: {:?}", case.link).to_lowercase(),
        format!("line: {line}"),
        format!("board: {board}"),
        format!("people: {disturbance}"),
    ]
}

fn is_good(judged: &Judged) -> bool {
    let name = judged.case.board;
    let personality = hw_mocks::Personality::named(name);
    personality.and_then(|p| p.expect.get("functional").map(|expected| expected.outcome == "passed")).unwrap_or(false)
}

/// Number of attempts beyond the first of each item.
fn retries(record: &RunRecord) -> usize {
    record.items.iter().map(|item| item.attempts.len().saturating_sub(1)).sum()
}

/// First-pass yields: a good module that passes only by a second attempt does not count.
fn yields(all: &[Judged]) -> String {
    let of = |clean: bool| {
        let these: Vec<&RunRecord> = all
            .iter()
            .filter(|judged| is_good(judged) && judged.ran.since_disturbed.is_none())
            .filter(|judged| judged.case.breach.is_empty() && judged.case.kinds.is_empty() == clean)
            .filter_map(|judged| judged.ran.record.as_ref())
            .collect();
        let passed = these.iter().filter(|record| record.verdict.passes_module());
        let at_first = passed.clone().filter(|record| retries(record) == 0).count();
        (at_first, passed.count(), these.len())
    };
    let mut text = String::new();
    for (clean, name) in [(true, "clean"), (false, "bad")] {
        let (at_first, passed, runs) = of(clean);
        let _ = writeln!(
            text,
            "undisturbed good modules on a {name} line: {at_first} of {runs} passed at first, {passed} in the end"
        );
    }
    text
}

/// Picks a time of a run, if it has one.
type Pick<'a> = &'a dyn Fn(&Judged) -> Option<Duration>;

fn times(all: &[Judged]) -> String {
    let longest =
        |pick: Pick| all.iter().filter_map(|judged| pick(judged).map(|span| (span, judged.case.number))).max();
    let stopped = |judged: &Judged| {
        let is_stop = matches!(judged.case.disturbance, Disturbance::Stop { .. });
        judged.ran.since_disturbed.filter(|_| is_stop)
    };
    let unplugged = |judged: &Judged| {
        let is_unplugged = matches!(judged.case.disturbance, Disturbance::Unplug { .. });
        judged.ran.since_disturbed.filter(|_| is_unplugged)
    };
    let rows: [(&str, Pick); 4] = [
        ("run", &|judged| Some(judged.ran.took)),
        ("from a stop to the end of the run", &stopped),
        ("from a cable pulled out to the end of the run", &unplugged),
        ("from the end of the run to the module off", &|judged| judged.ran.off_after),
    ];
    let mut text = String::new();
    for (name, pick) in rows {
        if let Some((span, number)) = longest(pick) {
            let _ = writeln!(text, "longest {name}: {:.3} s (run {number})", span.as_secs_f64());
        }
    }
    text
}
