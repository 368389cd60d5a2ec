//! Conditions that hold for every run, whatever the faults of the line and the disturbances.

use std::time::Duration;

use gnc_executive::outcome::Outcome;
use gnc_executive::record::{ItemRecord, RunRecord};
use hw_mocks::{Expectation, LineTruth, Personality, Toll};

use super::breach::is_unsafe;
use super::case::{Case, Disturbance, Link};
use super::run::Ran;

/// Faults that only lose or double frames.
const SPOILS_ALONE: [&str; 5] = [
    "lost_bytes_per_million",
    "lost_frames_per_million",
    "flipped_bits_per_million",
    "cut_frames_per_million",
    "doubled_frames_per_million",
];
/// The section of the interface document with the times of answers.
const CONVERSATION: u8 = 7;
/// The board whose frames all come late.
const LATE_BOARD: &str = "late-board";
/// Most frames that the board may send between the station's last look at the line and the end of the run: heartbeats.
const BEHIND_THE_END: u64 = 2;

/// Time after a stop within which a board that hears the station makes the module safe.
const SAFE_AFTER_A_STOP: Duration = Duration::from_millis(300);
/// Time within which the watchdog makes the module safe, if the board does not hear the station.
const SAFE_BY_WATCHDOG: Duration = Duration::from_secs(2);

/// The violations of a run; empty if there are none.
#[must_use]
pub fn violations(case: &Case, ran: &Ran) -> Vec<String> {
    let mut found: Vec<String> = ran.problems.clone();
    let Some(record) = &ran.record else {
        if found.is_empty() {
            found.push("the run left no record".to_owned());
        }
        return found;
    };
    let expected = Personality::from_toml(case.board, &case.text()).ok();
    let Some(expected) = expected.as_ref().and_then(|personality| personality.expect.get("functional")) else {
        found.push(format!("board {} has no expectation for the plan", case.board));
        return found;
    };
    if ran.verdict != Some(record.verdict) {
        found.push(format!("the station ended {:?}, its record says {}", ran.verdict, record.verdict));
    }
    verdicts(case, record, expected, &mut found);
    ends(case, ran, record, &mut found);
    if case.breach.is_empty() && case.board != LATE_BOARD {
        // The board keeps the document, whatever the line, the module and people do.
        // What the line holds back comes late, and nobody can tell why.
        let holds_back = case.kinds.iter().any(|kind| kind.starts_with("delayed") || kind.starts_with("stalled"));
        let told = record.board_breaches.iter().filter(|breach| !(holds_back && breach.section == CONVERSATION));
        found.extend(told.map(|breach| {
            let worst = breach.worst.as_deref().unwrap_or_default();
            format!(
                "a board that keeps the document is called for section {}: {} ({worst})",
                breach.section, breach.what
            )
        }));
    }
    found.extend(losses(case, ran, record));
    found
}

/// Checks the verdicts: a good module never fails and a bad one never passes. An undisturbed run on a clean line ends
/// exactly as expected.
fn verdicts(case: &Case, record: &RunRecord, expected: &Expectation, found: &mut Vec<String>) {
    for item in &record.items {
        let is_bad = expected.items.contains(&item.name);
        // If the fault of a bad module is in the line, it says nothing about the item.
        let may_fail = is_bad && expected.outcome == "failed";
        let failed = item.attempts.iter().any(|attempt| attempt.outcome == Outcome::Failed);
        if (failed || item.outcome == Outcome::Failed) && !may_fail {
            found.push(format!("{} failed, but nothing is wrong with it", item.name));
        }
        if is_bad && item.outcome.is_good() {
            found.push(format!("{} is {}, but it is bad", item.name, item.outcome));
        }
    }
    let reached = expected.items.is_empty() || record.items.iter().any(|item| is_judged(item, expected));
    if expected.outcome != "passed" && record.verdict.passes_module() && reached {
        found.push(format!("a bad module is {}", record.verdict));
    }
    if record.verdict.of_items() == Outcome::Failed && expected.outcome != "failed" {
        found.push("a good module failed".to_owned());
    }
    if case.is_calm() && reached {
        let good = |outcome: Outcome| outcome.is_good() && expected.outcome == "passed";
        if record.verdict.to_string() != expected.outcome && !good(record.verdict.of_items()) {
            found.push(format!("{} instead of {} on a clean line", record.verdict, expected.outcome));
        }
    }
}

/// Whether an item is expected to be bad and was not skipped because of a missing link.
fn is_judged(item: &ItemRecord, expected: &Expectation) -> bool {
    expected.items.contains(&item.name) && item.outcome != Outcome::Skipped
}

/// Checks the end: a stopped run says so, and the module is off after every run.
fn ends(case: &Case, ran: &Ran, record: &RunRecord, found: &mut Vec<String>) {
    let broken_off =
        record.items.iter().any(|item| item.selected && matches!(item.outcome, Outcome::Aborted | Outcome::NotRun));
    if record.stop.is_some() && broken_off && record.verdict.of_items() != Outcome::Aborted {
        found.push(format!("the run was stopped, but is {}", record.verdict));
    }
    if record.stop.is_some() && !matches!(case.disturbance, Disturbance::Stop { .. }) {
        found.push("the run stopped without a request to stop".to_owned());
    }
    if is_unsafe(case.breach) {
        return;
    }
    if ran.off_after.is_none() {
        found.push("the module is still on".to_owned());
    }
    // On a busy computer these are only figures and not bounds.
    let bound = match case.disturbance {
        // If the cable is plugged in again in time, the run goes on.
        Disturbance::None | Disturbance::Suspend(_) | Disturbance::Unplug { back: Some(_) } => return,
        Disturbance::Stop { .. } => SAFE_AFTER_A_STOP,
        Disturbance::Unplug { back: None } => SAFE_BY_WATCHDOG,
    };
    if let Some(off) = ran.off_since_disturbed.filter(|off| ran.in_memory && case.kinds.is_empty() && *off > bound) {
        found.push(format!("the module was off {off:?} after the disturbance, not within {bound:?}"));
    }
}

/// The losses that the station reports for the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Booked {
    damaged: u64,
    missing: u64,
}

impl Booked {
    /// Reads the note of the run: "the line was not clean: 4 frames received, 0 damaged, 1 missing, ...".
    fn read(record: &RunRecord) -> Self {
        let mut notes = record.notes.iter().rev().filter_map(|note| note.text.strip_prefix("the line was not clean: "));
        let Some(note) = notes.next() else { return Self::default() };
        let count = |what: &str| {
            let part = note.split([',', ';']).find(|part| part.trim_end().ends_with(what));
            part.and_then(|part| part.split_whitespace().next()).and_then(|number| number.parse().ok()).unwrap_or(0)
        };
        Self { damaged: count("damaged"), missing: count("missing") }
    }
}

/// Checks that the station reports exactly the losses that the line made, each where it happened.
fn losses(case: &Case, ran: &Ran, record: &RunRecord) -> Option<String> {
    if !case.breach.is_empty() {
        // Frames that the board does not number, or damages itself, are no losses of the line.
        return None;
    }
    let booked = Booked::read(record);
    let LineTruth { to_host, to_board, can_to_host, can_to_board } = ran.line;
    let deaf = matches!(case.disturbance, Disturbance::Unplug { .. } | Disturbance::Suspend(_));
    let acted = |toll: Toll| toll.spoilt + toll.others > 0;
    let harmed = [to_host, to_board, can_to_host, can_to_board].into_iter().any(acted) || ran.restarts > 0 || deaf;
    // If a computer stands still, timeouts also break off a message of many frames on CAN.
    let undisturbed = case.link == Link::Rs422 || ran.in_memory;
    if undisturbed && !harmed && booked != Booked::default() {
        return Some(format!("the line spoilt nothing, but the station counts {booked:?}"));
    }
    let (missing, missable) = counted_losses(case, ran)?;
    if (missing..=missing + BEHIND_THE_END).contains(&missable) {
        return None;
    }
    Some(format!("the station counts {missing} missing frames, but the line spoilt {missable}"))
}

/// Frames that the station reports as missing, and those that it could miss by the line's own count; `None` unless the
/// two must agree.
pub(super) fn counted_losses(case: &Case, ran: &Ran) -> Option<(u64, u64)> {
    let record = ran.record.as_ref().filter(|record| record.board.is_some())?;
    let LineTruth { to_host, to_board, .. } = ran.line;
    let spoils = |kind: &&str| SPOILS_ALONE.contains(kind);
    // Frames that overtake or come back shift the numbers. Late frames may not have come at the end. A restart or a
    // stop discards the frames on their way.
    let exact = case.link == Link::Rs422
        && case.breach.is_empty()
        && to_host.frames > 0
        && (case.kinds.iter().all(spoils) || to_host.spoilt + to_board.others == 0)
        && !case.kinds.contains(&"overtaken_frames_per_million")
        && ran.restarts == 0
        && case.disturbance == Disturbance::None;
    exact.then(|| (Booked::read(record).missing, to_host.missable))
}
