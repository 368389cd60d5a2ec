//! Tests the page as a function of the record: its required content, and its safety against hostile texts.

use gnc_executive::catalogue::ItemId;
use gnc_executive::event::{
    BenchInfo, EVENTS_SCHEMA, EarlierRun, Event, EventKind, PlanInfo, PlannedItem, ProgramVersion, RunHeader,
};
use gnc_executive::limit::{Limit, MeasurementKind};
use gnc_executive::measurement::{Measurement, Value};
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::Phase;
use gnc_executive::quantity::{Dimension, Unit};
use gnc_executive::record::RunRecord;
use gnc_executive::state::RunState;
use gnc_executive::uncertainty::Decision;
use gnc_executive::verdict::Verdict;
use serde_json::json;

use super::*;

const NONE: Result<Passport, NoPassport> = Err(NoPassport::NoCalibration);

const HOSTILE: &str = "<script>alert(1)</script>\u{1b}[2J\u{202e}\"'&";

/// A run of one item with one value of 2 deg/s against 0 to 1.
fn record(serial_number: &str) -> RunRecord {
    let header = RunHeader {
        schema: EVENTS_SCHEMA.to_owned(),
        serial_number: serial_number.to_owned(),
        part: None,
        numbers: Vec::new(),
        operator: Some(HOSTILE.to_owned()),
        station: "line-2".to_owned(),
        program: ProgramVersion { name: "gnc-station".to_owned(), version: "0".to_owned(), build: None },
        bench: BenchInfo::simulated("good", "max", 1),
        plan: PlanInfo { name: "functional".to_owned(), version: "1.0".to_owned(), sha256: "0".repeat(64) },
        site: None,
        recomputed: None,
        resumed: None,
        selection: None,
        looped: None,
    };
    let planned = PlannedItem {
        name: "imu".to_owned(),
        id: ItemId::Imu,
        title: "IMU at rest".to_owned(),
        phase: Phase::Test,
        optional: false,
        selected: true,
    };
    let limit = Limit::parse("0 .. 1 deg/s", MeasurementKind::Number(Dimension::AngularRate)).expect("a limit");
    let value = Value::number(2.0, Unit::DegreePerSecond);
    let measurement =
        Measurement::judge("gyro_x", &value, Unit::DegreePerSecond, Some(&limit), Decision::default(), serial_number);
    let item = || "imu".to_owned();
    let kinds = [
        EventKind::RunStarted { header: Box::new(header), items: vec![planned] },
        EventKind::ItemStarted { item: item(), attempt: 1 },
        EventKind::Measured { item: item(), attempt: 1, measurement },
        EventKind::AttemptEnded { item: item(), attempt: 1, outcome: Outcome::Failed, error: None },
        EventKind::ItemEnded { item: item(), outcome: Outcome::Failed, cause: None },
        EventKind::RunEnded(Verdict::Module(Outcome::Failed)),
    ];
    let mut state = RunState::new();
    for (seq, kind) in (0..).zip(kinds) {
        let at = chrono::DateTime::UNIX_EPOCH.fixed_offset();
        state.apply(&Event { seq, at, elapsed_us: seq * 1000, kind }).expect("in order");
    }
    RunRecord::from_state(&state).expect("a run")
}

fn shown(record: &RunRecord, passport: &Result<Passport, NoPassport>, digests: &[(String, String)]) -> String {
    let mut out = Vec::new();
    html(&mut out, record, passport, digests, None, None).expect("memory takes all");
    String::from_utf8(out).expect("text")
}

#[test]
fn a_reader_finds_verdict_value_limit_and_what_to_look_at() {
    let page = shown(&record("SN-1"), &NONE, &[("events.jsonl".to_owned(), "ab".repeat(32))]);
    for expected in [
        "FAILED SN-1",
        "SIMULATED BENCH (good): no evidence about any module",
        "gyro_x 2 deg/s (0 .. 1 deg/s)",
        "Is the module at rest?",
        "events.jsonl",
    ] {
        assert!(page.contains(expected), "{expected} is missing");
    }
}

/// Neither good items of a selection nor old samples under other limits look like a pass of the module.
#[test]
fn what_is_no_pass_does_not_look_like_one() {
    let mut record = record("SN-1");
    (record.verdict, record.selection) = (Verdict::Selection(Outcome::Passed), Some(vec!["imu".to_owned()]));
    let page = shown(&record, &NONE, &[]);
    for expected in [
        "<header class=\"partial\">",
        ">PARTIAL SN-1<",
        "SELECTION (imu): not a pass of the module",
        "no: simulated, only chosen items were run",
    ] {
        assert!(page.contains(expected), "{expected} is missing");
    }
    assert!(!page.contains("PASSED"));
    (record.verdict, record.selection) = (Verdict::Module(Outcome::Passed), None);
    record.recomputed = Some(EarlierRun { run: "120000-functional".to_owned(), journal_sha256: "00".repeat(32) });
    let page = shown(&record, &NONE, &[]);
    let banner = "RE-JUDGED (the samples of run 120000-functional by these limits): the module was not tested again";
    assert!(page.contains(banner) && page.contains("no: simulated, re-judged by other limits"), "{page}");
    (record.bench, record.recomputed) = (BenchInfo::real(), None);
    assert!(
        shown(&record, &NONE, &[]).contains("yes, as long as its plan says"),
        "a whole run on a real bench may count"
    );
}

/// A serial number with markup, an escape sequence and a reversed direction: the page holds its letters and no markup.
#[test]
fn no_text_becomes_markup() {
    let page = shown(&record(HOSTILE), &NONE, &[]);
    assert!(!page.contains("<script"), "markup got through");
    assert!(!page.contains(['\u{1b}', '\u{202e}']), "a control character got through");
    assert!(page.contains("&lt;script&gt;alert(1)&lt;/script&gt;"));
}

/// Details as the item `allan` writes them, with a unit from elsewhere.
fn allan() -> serde_json::Value {
    let points = [1.0, 10.0, 100.0].map(|tau_s: f64| {
        let dev = 20.0 / tau_s.sqrt();
        json!({ "tau_s": tau_s, "dev": dev, "low": 0.9 * dev, "high": 1.2 * dev, "edf": 9.0, "n": 100, "noise": "white" })
    });
    json!({ "curves": { "gyro_x": {
        "unit": HOSTILE, "points": points, "N": { "value": 20.0, "low": 18.0, "high": 22.0 }, "B": null, "K": null,
    } } })
}

/// The page does not refer to any other place.
#[test]
fn the_page_needs_no_network() {
    let mut record = record("SN-1");
    record.items[0].attempts[0].details = vec![allan().into()];
    record.items[0].id = ItemId::Allan;
    let page = shown(&record, &NONE, &[]).replace("http://www.w3.org/2000/svg", "");
    for place in ["http:", "https:", "src=", "url(", "@import"] {
        assert!(!page.contains(place), "{place}");
    }
}

#[test]
fn details_are_tables_matrices_and_pictures() {
    let mut record = record("SN-1");
    record.items[0].id = ItemId::Allan;
    record.items[0].attempts[0].details = vec![json!({
        "equation": "f = M N + b",
        "matrix": [[1.0, 0.25], [0.0, 1.0]],
        "points": [{ "source": HOSTILE, "value": 1.5e-7 }, { "source": "angle", "type": "B" }],
        "budget": { "scale_x": { "contributions": [{ "name": "table angle", "type": "B", "u": 2.5 }], "U": 5.0, "k": 2.0 } },
        "curves": allan()["curves"],
        "nothing": null,
    }).into()];
    let page = shown(&record, &NONE, &[]);
    for expected in
        ["f = M N + b", ">0.25<", "1.50000e-7", "table angle", "U = 5 with k = 2", "<svg", "not available", ">type<"]
    {
        assert!(page.contains(expected), "{expected} is missing");
    }
    assert!(!page.contains("<script"));
}

#[test]
fn numbers_keep_their_digits() {
    for (value, text) in [(0.1, "0.1"), (1234.5678, "1234.57"), (1e-9, "1.00000e-9"), (-0.0, "0"), (2e6, "2000000")] {
        assert_eq!(number(value), text);
    }
}

/// A reader of a verdict near a limit must see the rule by which it was made.
#[test]
fn the_decision_rule_is_stated() {
    let mut record = record("SN-1");
    assert!(!shown(&record, &NONE, &[]).contains("Decision rule"), "no value has an interval");
    record.items[0].attempts[0].measurements[0].decision = Some(Decision::GuardBand);
    let page = shown(&record, &NONE, &[]);
    assert!(page.contains("guard band by the uncertainty") && !page.contains("simple acceptance"));
}

/// A module that failed has no passport, and the page says why; a plan without calibration gives no such text.
#[test]
fn a_missing_passport_is_explained() {
    let why = Err(NoPassport::Outcome { outcome: Outcome::Failed });
    assert!(shown(&record("SN-1"), &why, &[]).contains("None: the run failed"));
    assert!(!shown(&record("SN-1"), &NONE, &[]).contains("Sensor passport"));
}
