//! The schema against events; `tests/papers/events.py` checks those of real runs by a validator of others.

use std::collections::BTreeSet;

use serde_json::Value;

use super::*;
use crate::event::{
    BoardBreach, BuildInfo, CapturedSamples, EarlierRun, Event, EventKind, Loop, OtherModule, ProgramVersion,
    RunHeader, StopHow,
};
use crate::numbers::{GivenNumber, NumberKind};
use crate::part::{LimitsChosen, PartName};
use crate::record::tests::problems;
use crate::test_run::{header, small_run};

/// Events of every kind; heads with all and with few fields.
fn events() -> Vec<Value> {
    let earlier = || Some(EarlierRun { run: "143015-small".to_owned(), journal_sha256: "0".repeat(64) });
    let build = BuildInfo { commit: "0".repeat(40), committed: crate::test_run::start(), modified: true };
    let whole = RunHeader {
        program: ProgramVersion { build: Some(build), ..header().program },
        recomputed: earlier(),
        resumed: earlier(),
        selection: Some(vec!["imu".to_owned()]),
        looped: Some(Loop { index: 1, count: None }),
        operator: None,
        part: Some(PartName::new("A", Some("B"))),
        numbers: vec![GivenNumber {
            key: "order".to_owned(),
            kind: NumberKind::Order,
            label: "Order".to_owned(),
            value: "1".to_owned(),
        }],
        ..header()
    };
    let of_run = |header: RunHeader| {
        let run = small_run(header);
        let mut events = run.events.clone();
        let last = run.events.last().unwrap();
        let breach = BoardBreach { section: 9, what: "x".to_owned(), count: 2, worst: None, safety: false };
        let captured = CapturedSamples {
            item: "imu".to_owned(),
            attempt: 1,
            file: "01-imu/attempt-1.mcap".to_owned(),
            bytes: 9,
            sha256: "0".repeat(64),
            journal_sha256: "1".repeat(64),
            signature: None,
        };
        for kind in [
            EventKind::Captured(CapturedSamples { signature: Some("2".repeat(128)), ..captured.clone() }),
            EventKind::Captured(captured),
            EventKind::StopRequested { how: StopHow::AtOnce, by: "SIGTERM".to_owned() },
            EventKind::Prompted {
                item: None,
                text: "turn the module".to_owned(),
                question: None,
                picture_sha256: None,
            },
            EventKind::Answered {
                item: Some("imu".to_owned()),
                answer: String::new(),
                question: Some("lid".to_owned()),
            },
            EventKind::LimitsChosen(LimitsChosen {
                part: Some(PartName::new("A", None)),
                module: PartName::new("A", Some("")),
            }),
            EventKind::LimitsChosen(LimitsChosen { part: None, module: PartName::new("A", None) }),
            EventKind::OtherModule(OtherModule { scanned: "A".to_owned(), found: "B".to_owned(), exchanged: true }),
            EventKind::BoardRebooted { item: None, boot_id: "7".to_owned() },
            EventKind::BoardBreach(BoardBreach { worst: Some("3 ms".to_owned()), safety: true, ..breach.clone() }),
            EventKind::BoardBreach(breach),
        ] {
            events.push(Event { kind, ..last.clone() });
        }
        events
    };
    [header(), whole].into_iter().flat_map(of_run).map(|event| serde_json::to_value(event).unwrap()).collect()
}

#[test]
fn the_stored_schema_is_the_generated_one() {
    let stored: Value = serde_json::from_str(include_str!("../../../../docs/events.schema.json")).unwrap();
    let told = "run: cargo run -p gnc-executive --example events_schema > docs/events.schema.json";
    assert_eq!(stored, events_schema().unwrap(), "{told}");
}

#[test]
fn every_kind_of_event_is_described() {
    let schema = events_schema().unwrap();
    let described: Vec<&str> =
        schema["$defs"].as_object().unwrap().keys().filter_map(|name| name.strip_prefix("event_")).collect();
    let names: BTreeSet<&str> = EventKind::NAMES.into_iter().collect();
    assert_eq!(described, names.into_iter().collect::<Vec<_>>());
    assert_eq!(schema["oneOf"].as_array().unwrap().len(), EventKind::NAMES.len());
    let seen: BTreeSet<String> = events().iter().map(|event| event["kind"].as_str().unwrap().to_owned()).collect();
    assert_eq!(seen.len(), EventKind::NAMES.len(), "{seen:?}");
}

/// Every event is valid. None is without one of its fields, with another one, or with a value that nothing is.
#[test]
fn events_are_valid_and_spoilt_ones_are_not() {
    let schema = events_schema().unwrap();
    let valid = |event: &Value| problems(&schema, &schema, event, "event").is_empty();
    for event in events() {
        assert!(valid(&event), "{event}");
        let kind = format!("event_{}", event["kind"].as_str().unwrap());
        for name in event.as_object().unwrap().keys() {
            let mut spoilt = event.clone();
            spoilt.as_object_mut().unwrap().remove(name);
            let required = schema["$defs"][&kind]["required"].as_array().unwrap();
            assert_eq!(valid(&spoilt), !required.iter().any(|one| one == name), "{name} of {event}");
            let mut spoilt = event.clone();
            spoilt[name] = serde_json::json!([{ "no": "thing" }]);
            assert!(!valid(&spoilt) || name == "details", "{name} of {event}");
        }
        let mut more = event.clone();
        more["more"] = 1.into();
        assert!(!valid(&more), "{event}");
    }
}
