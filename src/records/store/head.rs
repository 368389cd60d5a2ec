//! The head of `run.json`: what a search over many runs needs. The record of a calibration has megabytes of items, and a
//! hundred of them would delay the screen.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

use gnc_executive::event::{BenchInfo, BenchKind, EarlierRun, OtherModule, PlanInfo};
use gnc_executive::numbers::GivenNumber;
use gnc_executive::outcome::Outcome;
use gnc_executive::verdict::Verdict;
use serde::Deserialize;

use super::{RECORD, pending};

/// Longest head: before the items stand names, the bench, the board and what it broke, a few kilobytes.
const MAX_HEAD_BYTES: u64 = 256 << 10;
/// Read at once: nearly every head.
const AT_ONCE_BYTES: u64 = 8 << 10;
/// What stands before the items in the form that the station writes. No text of JSON holds a line end, so nothing else in
/// the file looks so.
const ITEMS: &str = "\n  \"items\": [";

/// A run that has an end, in short.
#[derive(Debug, Clone, PartialEq)]
pub struct RunHead {
    /// How it ended.
    pub verdict: Verdict,
    /// Digest of its plan.
    pub plan_sha256: String,
    /// Whether the bench is real.
    pub bench: BenchKind,
    /// Whether old samples were judged again.
    pub rejudged: bool,
    /// Seconds from its start to its end.
    pub elapsed_s: f64,
    /// The scanned serial number.
    pub serial_number: String,
    /// Numbers of orders, sub-units and others.
    pub numbers: Vec<GivenNumber>,
    /// Whether another module than was scanned was in the socket.
    pub is_other_module: bool,
}

/// The fields before the items.
#[derive(Deserialize)]
struct HeadFields {
    outcome: Option<Outcome>,
    #[serde(default)]
    selection_outcome: Option<Outcome>,
    interrupted: bool,
    serial_number: String,
    #[serde(default)]
    numbers: Vec<GivenNumber>,
    plan: PlanInfo,
    bench: BenchInfo,
    #[serde(default)]
    other_module: Option<OtherModule>,
    #[serde(default)]
    recomputed: Option<EarlierRun>,
    selection: Option<Vec<String>>,
    elapsed_s: f64,
}

impl RunHead {
    /// Reads no more than the head of a run's record. `None` if the run has no end or no record, or if another program wrote
    /// the record in another form.
    #[must_use]
    pub fn read(run: &Path) -> Option<Self> {
        let text = beginning(pending::open(run, RECORD).ok()?).ok()?;
        let (head, _) = text.split_once(ITEMS)?;
        let fields: HeadFields =
            serde_json::from_str(&format!("{head}{ITEMS}]}}")).ok().filter(|head: &HeadFields| !head.interrupted)?;
        let outcome = fields.outcome.or(fields.selection_outcome)?;
        Some(Self {
            verdict: Verdict::new(outcome, fields.selection.is_some() || fields.selection_outcome.is_some()),
            plan_sha256: fields.plan.sha256,
            bench: fields.bench.kind,
            rejudged: fields.recomputed.is_some(),
            elapsed_s: fields.elapsed_s,
            serial_number: fields.serial_number,
            numbers: fields.numbers,
            is_other_module: fields.other_module.is_some(),
        })
    }
}

fn beginning(file: File) -> io::Result<String> {
    let mut file = file.take(MAX_HEAD_BYTES);
    let mut bytes = Vec::new();
    while (&mut file).take(AT_ONCE_BYTES).read_to_end(&mut bytes)? > 0 {
        if String::from_utf8_lossy(&bytes).contains(ITEMS) {
            break;
        }
    }
    // The cut may go through a character of the items.
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

#[cfg(test)]
mod tests;
