//! Files that were put into a run before its digests were made.

use std::fs;
use std::path::PathBuf;

use gnc_executive::event::Event;
use serde_json::json;

use super::*;
use crate::store::digest;

const PLAN_TEXT: &str = "name = \"p\"";

/// A folder with a journal of one item that failed once and passed then, and the files that a station makes of it.
fn run() -> (tempfile::TempDir, PathBuf) {
    let place = tempfile::tempdir().unwrap();
    let run = place.path().join("2026-11-28/SN-1/143000-p");
    fs::create_dir_all(run.join(PLAN)).unwrap();
    fs::write(run.join(PLAN).join("01-my~20p.toml"), PLAN_TEXT).unwrap();
    fs::create_dir(run.join("01-cpu")).unwrap();
    fs::write(run.join("01-cpu/attempt-2-3.mcap"), "").unwrap();
    let state = state();
    let item = ItemFile::from_state(&state, 0).unwrap();
    fs::write(run.join("01-cpu").join(ITEM), serde_json::to_string(&item).unwrap()).unwrap();
    let record = RunRecord::from_state(&state).unwrap();
    fs::write(run.join(RECORD), serde_json::to_string(&record).unwrap()).unwrap();
    (place, run)
}

fn state() -> RunState {
    state_of(usize::MAX)
}

/// The state behind so many events.
fn state_of(count: usize) -> RunState {
    let sha256 = digest::of_plan([("my p.toml", PLAN_TEXT.as_bytes())].into_iter());
    let header = json!({
        "schema": "gnc-events/1", "serial_number": "SN-1", "operator": null, "station": "bench 1",
        "program": { "name": "gnc-station", "version": "1" }, "bench": { "kind": "real" }, "selection": null,
        "loop": null, "plan": { "name": "p", "version": "1", "sha256": sha256 },
    });
    let item = json!({
        "name": "cpu", "id": "cpu", "title": "CPU", "phase": "test", "optional": false, "selected": true,
    });
    let ended = |attempt: u32, outcome: &str| json!({ "kind": "attempt_ended", "item": "cpu", "attempt": attempt, "outcome": outcome, "error": null });
    let events = [
        json!({ "kind": "run_started", "header": header, "items": [item] }),
        json!({ "kind": "item_started", "item": "cpu", "attempt": 1 }),
        ended(1, "failed"),
        json!({ "kind": "item_started", "item": "cpu", "attempt": 2 }),
        ended(2, "passed"),
        json!({ "kind": "item_ended", "item": "cpu", "outcome": "passed", "cause": null }),
        json!({ "kind": "run_ended", "outcome": "passed" }),
    ];
    let mut state = RunState::new();
    for (seq, mut body) in events.into_iter().enumerate().take(count) {
        body["seq"] = seq.into();
        body["at"] = "2026-11-28T14:30:00+08:00".into();
        body["elapsed_us"] = seq.into();
        let event: Event = serde_json::from_value(body).unwrap();
        state.apply(&event).unwrap();
    }
    state
}

fn found(change: impl Fn(&Path)) -> Vec<String> {
    let (_place, run) = run();
    change(&run);
    let known = digest::files_below(&run).unwrap().into_iter().map(|file| (file, String::new())).collect();
    unlike(&run, state(), "ab", &known)
}

/// Changes a text in a file.
fn edit(run: &Path, file: &str, from: &str, to: &str) {
    let text = fs::read_to_string(run.join(file)).unwrap();
    assert!(text.contains(from), "{text}");
    fs::write(run.join(file), text.replace(from, to)).unwrap();
}

#[test]
fn files_that_a_station_made_agree() {
    assert_eq!(found(|_| {}), Vec::<String>::new());
    // An earlier or a later version has other fields, and named some files of the plan otherwise.
    assert_eq!(found(|run| edit(run, "01-cpu/item.json", "\"schema\":", "\"more\":1,\"was\":")), Vec::<String>::new());
    let renamed = |run: &Path| {
        fs::rename(run.join("plan/01-my~20p.toml"), run.join("plan/01-my_p.toml~0badcafe")).unwrap();
    };
    assert_eq!(found(renamed), Vec::<String>::new());
}

#[test]
fn files_that_say_something_else_are_named() {
    let item = "01-cpu/item.json does not say what events.jsonl says";
    assert_eq!(found(|run| edit(run, "01-cpu/item.json", "\"failed\"", "\"passed\"")), [item]);
    assert_eq!(found(|run| edit(run, "01-cpu/item.json", "SN-1", "SN-2")), [item]);
    assert_eq!(found(|run| fs::write(run.join("01-cpu/item.json"), "{").unwrap()), [item]);
    let plan = "plan/ does not hold the plan that events.jsonl names";
    assert_eq!(found(|run| edit(run, "plan/01-my~20p.toml", "p", "q")), [plan]);
    assert_eq!(found(|run| fs::write(run.join("plan/02-more.toml"), "x").unwrap()), [plan]);
    let record = "run.json does not say what events.jsonl says";
    assert_eq!(found(|run| edit(run, RECORD, "SN-1", "SN-2")), [record]);
    for file in
        ["01-cpu/attempt-3.mcap", "02-imu/attempt-1.mcap", "x.mcap", "01-cpu/attempt-0.mcap", "00-x/attempt-1.mcap"]
    {
        let put = |run: &Path| {
            fs::create_dir_all(run.join(file).parent().unwrap()).unwrap();
            fs::write(run.join(file), "").unwrap();
        };
        assert_eq!(found(put), [format!("{file} is of no attempt that events.jsonl has")]);
    }
    let none = "passport.json is there, and by events.jsonl the run has none: the plan calibrates nothing";
    assert_eq!(found(|run| fs::write(run.join(PASSPORT), "{}").unwrap()), [none]);
    let alone = "passport.xml is there without passport.json";
    assert_eq!(found(|run| fs::write(run.join(PASSPORT_XML), "<passport/>").unwrap()), [alone]);
}

#[test]
fn values_agree_in_what_both_have() {
    let same = [
        (json!({ "a": 1, "b": [1.0, { "c": null }] }), json!({ "a": 1.0, "b": [1, { "c": null, "d": 4 }] })),
        (json!({ "a": 1 }), json!({ "b": 2 })),
    ];
    assert!(same.iter().all(|(one, other)| agree(one, other) && agree(other, one)));
    let other = [
        (json!({ "a": 1 }), json!({ "a": 2 })),
        (json!([1]), json!([1, 2])),
        (json!({ "a": { "b": "x" } }), json!({ "a": { "b": "y" } })),
        (json!({ "a": null }), json!({ "a": 0 })),
    ];
    assert!(other.iter().all(|(one, other)| !agree(one, other) && !agree(other, one)));
}

/// A power cut may take the line that begins an attempt, and leave its raw file: the station closes the run with it.
#[test]
fn the_file_of_an_attempt_whose_line_was_lost_is_one_of_the_run() {
    let (cut, whole) = (state_of(5), state());
    let file = |name: &str| Known::from([(PathBuf::from(name), String::new())]);
    assert_eq!(raw(&cut, &file("01-cpu/attempt-3.mcap")), Vec::<String>::new());
    assert_eq!(raw(&cut, &file("01-cpu/attempt-4.mcap")).len(), 1);
    assert_eq!(raw(&whole, &file("01-cpu/attempt-3.mcap")).len(), 1);
}
