//! The head against the whole record, and a record that must not be read as a whole.

use std::fs;

use gnc_executive::record::RunRecord;
use serde_json::json;

use super::*;
use crate::store::pretty;

fn record(change: impl Fn(&mut serde_json::Value)) -> RunRecord {
    let mut record = json!({
        "schema": "gnc-run/1", "outcome": "passed", "interrupted": false, "serial_number": "SN \n  \"items\": [",
        "plan": { "name": "functional", "version": "1.0", "sha256": "aa" }, "station": "s", "operator": null,
        "program": { "name": "p", "version": "1" }, "bench": { "kind": "real" }, "board": null, "selection": null, "loop": null,
        "started": "2026-11-28T14:30:00+08:00", "finished": "2026-11-28T14:31:00+08:00", "elapsed_s": 60.5,
        "stop": null, "items": [], "notes": [],
    });
    change(&mut record);
    serde_json::from_value(record).unwrap()
}

/// The head of a record as the station writes it, followed by this in place of the items.
fn head_of(record: &RunRecord, behind: &[u8]) -> Option<RunHead> {
    let run = tempfile::tempdir().unwrap();
    let mut text = Vec::new();
    pretty(&mut text, record).unwrap();
    let items = String::from_utf8(text.clone()).unwrap().find(ITEMS).unwrap() + ITEMS.len();
    text.truncate(items);
    text.extend_from_slice(behind);
    fs::write(run.path().join(RECORD), text).unwrap();
    RunHead::read(run.path())
}

/// Nothing behind the head is looked at: here stand no items at all, and more bytes than are read.
#[test]
fn the_head_is_enough() {
    let passed = record(|_| {});
    let expected = RunHead {
        verdict: Verdict::Module(Outcome::Passed),
        plan_sha256: "aa".to_owned(),
        bench: BenchKind::Real,
        rejudged: false,
        elapsed_s: 60.5,
        serial_number: "SN \n  \"items\": [".to_owned(),
        numbers: Vec::new(),
        is_other_module: false,
    };
    let long = vec![0xff; 2 * usize::try_from(MAX_HEAD_BYTES).unwrap()];
    assert_eq!(head_of(&passed, &long), Some(expected.clone()));
    assert_eq!(head_of(&passed, b"]\n}"), Some(expected));
    let rejudged = record(|record| record["recomputed"] = json!({ "run": "r", "journal_sha256": "00" }));
    assert!(head_of(&rejudged, b"").unwrap().rejudged);
    let selection = record(|record| record["selection"] = json!(["cpu"]));
    assert_eq!(head_of(&selection, b"").unwrap().verdict, Verdict::Selection(Outcome::Passed));
    let interrupted = record(|record| record["interrupted"] = true.into());
    assert_eq!(head_of(&interrupted, b""), None);
}

/// A file that is no record of the station is read no further than the bound.
#[test]
fn another_form_is_no_head() {
    let run = tempfile::tempdir().unwrap();
    assert_eq!(RunHead::read(run.path()), None, "no record");
    let compact = serde_json::to_vec(&record(|_| {})).unwrap();
    fs::write(run.path().join(RECORD), compact).unwrap();
    assert_eq!(RunHead::read(run.path()), None);
    let far = record(|record| record["station"] = "s".repeat(1 << 20).into());
    assert_eq!(head_of(&far, b"]\n}"), None);
}
