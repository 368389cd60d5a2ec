//! A small records folder of two days, written by the station's own writer and signed with a key.

use std::path::{Path, PathBuf};

use chrono::{DateTime, FixedOffset};
use gnc_executive::event::Event;
use gnc_executive::plan::Plan;
use gnc_records::store::{RecordWriter, RunFolder, StationKey, digest};
use serde_json::{Value, json};

pub(crate) const PLAN: &[u8] =
    b"name = \"small\"\nversion = \"1\"\n[[item]]\nid = \"cpu\"\n[item.limits]\ncore1_register_errors = \"== 0\"\n";

/// The runs: day and time of the start, serial number, and the value that is measured. 0 passes.
const RUNS: [(&str, &str, f64); 4] = [
    ("2026-11-28T09:00:00+08:00", "T-1", 0.0),
    ("2026-11-28T09:10:00+08:00", "T-2", 1.0),
    ("2026-11-28T09:20:00+08:00", "T-2", 0.0),
    ("2026-11-29T08:00:00+08:00", "T-3", 0.0),
];

/// Writes the folder `records` and a key beside it. Returns the path of the public key.
pub(crate) fn write(place: &Path) -> PathBuf {
    let records = place.join("records");
    std::fs::create_dir(&records).expect("a folder");
    let key_file = place.join("station.key");
    let public = StationKey::create(&key_file).expect("a key");
    let key = StationKey::read(&key_file).expect("a key");
    for (started, serial_number, value) in RUNS {
        run(&records, &key, started, serial_number, value);
    }
    public
}

/// A new run without an event: its folder, and the writer of its record.
pub(crate) fn new(
    records: &Path,
    key: &StationKey,
    at: DateTime<FixedOffset>,
    serial_number: &str,
) -> (PathBuf, RecordWriter) {
    let plan = Plan::read("small.toml", PLAN.to_vec(), &mut |name| Err(name.to_owned())).expect("a plan");
    let folder =
        RunFolder::create(records, at, serial_number, "small").expect("a folder").signed_with(Some(key.clone()));
    let path = folder.path().to_owned();
    (path, RecordWriter::without_thread(folder, &plan, Vec::new()).expect("a record"))
}

/// Writes one run.
pub(crate) fn run(records: &Path, key: &StationKey, started: &str, serial_number: &str, value: f64) -> PathBuf {
    let at: DateTime<FixedOffset> = started.parse().expect("a time");
    let (path, writer) = new(records, key, at, serial_number);
    let state = writer.state();
    let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
    for (seq, body) in events(serial_number, value).into_iter().enumerate() {
        let event = event(seq, at, body);
        state.lock().expect("a state").apply(&event).expect("in order");
        let written = async { writer.place().await?.write(event, true).synced().await };
        runtime.block_on(written).expect("an event on disk");
    }
    runtime.block_on(writer.close()).expect("a closed record");
    path
}

pub(crate) fn event(seq: usize, at: DateTime<FixedOffset>, mut body: Value) -> Event {
    body["seq"] = json!(seq);
    body["at"] = json!((at + chrono::TimeDelta::seconds(i64::try_from(seq).expect("few"))).to_rfc3339());
    body["elapsed_us"] = json!(seq * 1_000_000);
    serde_json::from_value(body).expect("an event")
}

pub(crate) fn events(serial_number: &str, value: f64) -> Vec<Value> {
    let outcome = if value == 0.0 { "passed" } else { "failed" };
    let sha256 = digest::of_plan([("small.toml", PLAN)].into_iter());
    let header = json!({
        "schema": "gnc-events/1", "serial_number": serial_number, "operator": null, "station": "bench 1",
        "program": { "name": "gnc-station", "version": "0.1.0" }, "bench": { "kind": "real" }, "selection": null, "loop": null,
        "plan": { "name": "small", "version": "1", "sha256": sha256 },
    });
    let item = json!({
        "name": "cpu", "id": "cpu", "title": "CPU, both cores", "phase": "test", "optional": false, "selected": true,
    });
    let measurement = json!({
        "name": "core1_register_errors", "value": value, "unit": null, "low": 0.0, "high": 0.0, "expected": null,
        "outcome": outcome,
    });
    vec![
        json!({ "kind": "run_started", "header": header, "items": [item] }),
        json!({ "kind": "item_started", "item": "cpu", "attempt": 1 }),
        json!({ "kind": "measured", "item": "cpu", "attempt": 1, "measurement": measurement }),
        json!({ "kind": "attempt_ended", "item": "cpu", "attempt": 1, "outcome": outcome, "error": null }),
        json!({ "kind": "item_ended", "item": "cpu", "outcome": outcome, "cause": null }),
        json!({ "kind": "run_ended", "outcome": outcome }),
    ]
}
