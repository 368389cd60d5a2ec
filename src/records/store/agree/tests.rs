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
    fs::write(run.join("log.txt"), gnc_executive::text::log_txt(&record)).unwrap();
    let mut report = Vec::new();
    let passport = passport::of_run(&record, "ab", None);
    crate::report::html(&mut report, &record, &passport, &[], None, None).unwrap();
    fs::write(run.join("report.html"), report).unwrap();
    (place, run)
}

fn state() -> RunState {
    state_with(None, ["failed", "passed", "passed"])
}

/// With a measurement in the second attempt, and the outcomes of both attempts and the item.
fn state_with(measurement: Option<Value>, outcomes: [&str; 3]) -> RunState {
    state_of(usize::MAX, measurement, outcomes)
}

/// The state behind so many events.
fn state_of(count: usize, measurement: Option<Value>, [first, second, whole]: [&str; 3]) -> RunState {
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
    let measured = measurement
        .map(|measurement| json!({ "kind": "measured", "item": "cpu", "attempt": 2, "measurement": measurement }));
    let before = [
        json!({ "kind": "run_started", "header": header, "items": [item] }),
        json!({ "kind": "item_started", "item": "cpu", "attempt": 1 }),
        ended(1, first),
        json!({ "kind": "item_started", "item": "cpu", "attempt": 2 }),
    ];
    let after = [
        ended(2, second),
        json!({ "kind": "item_ended", "item": "cpu", "outcome": whole, "cause": null }),
        json!({ "kind": "run_ended", "outcome": whole }),
    ];
    let mut state = RunState::new();
    for (seq, mut body) in before.into_iter().chain(measured).chain(after).enumerate().take(count) {
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
    for (file, from, to) in [
        ("log.txt", "\nPASSED ", "\nFAILED "),
        ("log.txt", "\nPASSED ", "\nNOT RUN "),
        ("log.txt", "\nPASSED ", "\nPARTIAL "),
        ("report.html", "<h1>PASSED ", "<h1>ERRORED "),
        ("report.html", "<h1>PASSED ", "<h1>INTERRUPTED "),
    ] {
        assert_eq!(
            found(|run| edit(run, file, from, to)),
            [format!("{file} does not say what events.jsonl says")],
            "{to}"
        );
    }
    // A version that writes its papers otherwise.
    for (file, from) in [("log.txt", "\nPASSED "), ("report.html", "<h1>PASSED ")] {
        assert_eq!(found(|run| edit(run, file, from, "\nVerdict: good ")), Vec::<String>::new());
    }
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
    let (cut, whole) = (state_of(5, None, ["failed", "passed", "passed"]), state());
    let file = |name: &str| Known::from([(PathBuf::from(name), String::new())]);
    assert_eq!(raw(&cut, &file("01-cpu/attempt-3.mcap")), Vec::<String>::new());
    assert_eq!(raw(&cut, &file("01-cpu/attempt-4.mcap")).len(), 1);
    assert_eq!(raw(&whole, &file("01-cpu/attempt-3.mcap")).len(), 1);
}

/// A verdict that was edited without its figures, and an outcome that was edited without its verdicts.
#[test]
fn a_journal_that_judges_against_its_own_figures_is_named() {
    let figure = |value: f64, outcome: &str| json!({ "name": "gyro", "value": value, "unit": null, "low": -1.0, "high": 2.0, "expected": null, "outcome": outcome });
    let text = |value: &str, outcome: &str| json!({ "name": "gyro", "value": value, "unit": null, "low": null, "high": null, "expected": "1.2", "outcome": outcome });
    let none = || {
        let mut none = figure(0.0, "passed");
        none["value"] = Value::Null;
        none
    };
    let said = |measurement: Value, outcomes| judged_otherwise(&state_with(Some(measurement), outcomes));
    let passed = ["failed", "passed", "passed"];
    let beyond = "events.jsonl calls gyro of cpu good in attempt 2 although its value is beyond the limit beside it";
    for good in [figure(-1.0, "passed"), figure(2.0, "marginal"), text("1.2", "passed")] {
        assert_eq!(said(good, passed), Vec::<String>::new());
    }
    for bad in [figure(-1.1, "passed"), figure(2.1, "marginal"), text("1.3", "passed"), none()] {
        assert_eq!(said(bad, passed), [beyond]);
    }
    // What fails within its limits may have failed by its coverage interval.
    assert_eq!(said(figure(1.9, "failed"), ["failed", "failed", "failed"]), Vec::<String>::new());
    let in_attempt = "events.jsonl calls attempt 2 of cpu good although gyro in it is not";
    assert_eq!(said(figure(3.0, "failed"), passed), [in_attempt]);
    let last = "events.jsonl calls cpu good although its last attempt is not";
    assert_eq!(said(figure(3.0, "failed"), ["passed", "failed", "passed"]), [last]);
}

/// What is longer than each file that is read is not made at all to be compared.
#[test]
fn what_no_file_may_say_is_not_made() {
    let item = |bytes: usize| {
        let mut item = ItemFile::from_state(&state(), 0).unwrap();
        item.serial_number = "x".repeat(bytes);
        item
    };
    assert!(is_within_bound(&item(1000)));
    assert!(is_within_bound(&item(MAX_RECORD_BYTES as usize / 2)));
    assert!(!is_within_bound(&item(MAX_RECORD_BYTES as usize)));
}
