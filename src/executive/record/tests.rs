use serde_json::Value;

use super::*;
use crate::event::BenchInfo;
use crate::journal;
use crate::test_run::{header, small_run};

const SCHEMA: &str = include_str!("../../../docs/run.schema.json");

fn record() -> RunRecord {
    RunRecord::from_state(&small_run(header()).state).unwrap()
}

fn item_files() -> impl Iterator<Item = ItemFile> {
    let state = small_run(header()).state;
    (0..state.rows().len()).filter_map(move |position| ItemFile::from_state(&state, position))
}

#[test]
fn a_record_comes_back_as_it_was() {
    let record = record();
    let json = serde_json::to_string_pretty(&record).unwrap();
    assert_eq!(serde_json::from_str::<RunRecord>(&json).unwrap(), record);
    assert_eq!(record.verdict, Verdict::Module(Outcome::Errored));
    // 27 events, a quarter of a second apart.
    assert_eq!(record.elapsed_s, 6.5);
    let outcomes: Vec<Outcome> = record.items.iter().map(|item| item.outcome).collect();
    assert_eq!(outcomes, [Outcome::Marginal, Outcome::Failed, Outcome::Errored, Outcome::Skipped]);
    assert_eq!(record.items[2].attempts.len(), 2, "every attempt is kept");
    assert_eq!(item_files().map(|file| file.item.name).collect::<Vec<_>>(), ["identity", "sdram", "imu"]);
}

#[test]
fn an_item_file_stands_alone() {
    for file in item_files() {
        let json = serde_json::to_string(&file).unwrap();
        assert_eq!(serde_json::from_str::<ItemFile>(&json).unwrap(), file);
        assert!(json.starts_with(r#"{"schema":"gnc-run/1","serial_number":"DEMO-1","bench":"real","run_started":"#));
    }
}

#[test]
fn only_a_whole_run_on_a_real_bench_is_evidence() {
    assert!(record().is_evidence());
    let with = |change: &dyn Fn(&mut crate::event::RunHeader)| {
        let mut header = header();
        change(&mut header);
        RunRecord::from_state(&small_run(header).state).unwrap()
    };
    assert!(!with(&|header| header.bench = BenchInfo::simulated("good-1", "max", 7)).is_evidence());
    let unproven = || BenchInfo::real().in_doubt(Some("port /tmp/board is a pseudo-terminal".to_owned()));
    assert!(!with(&|header| header.bench = unproven()).is_evidence());
    assert!(!with(&|header| header.selection = Some(vec!["identity".to_owned()])).is_evidence());
    let earlier = crate::event::EarlierRun { run: "120000-small".to_owned(), journal_sha256: "00".repeat(32) };
    assert!(!with(&|header| header.recomputed = Some(earlier.clone())).is_evidence());
}

#[test]
fn a_run_without_end_is_interrupted() {
    let run = small_run(header());
    let lines: Vec<String> = run.events.iter().map(|event| journal::line(event).unwrap()).collect();
    for kept in 1..lines.len() {
        let state = journal::fold(lines[..kept].concat().as_bytes()).unwrap().state;
        let record = RunRecord::from_state(&state).unwrap();
        assert_eq!(RunRecord::of_folded(state).as_ref(), Some(&record));
        assert!(record.interrupted && record.verdict == Verdict::Module(Outcome::Aborted) && record.finished.is_none());
        assert!(!record.is_evidence());
        validate(&serde_json::to_value(&record).unwrap());
    }
    assert_eq!(RunRecord::from_state(&RunState::new()), None);
    let whole = journal::fold(lines.concat().as_bytes()).unwrap().state;
    assert!(whole.rows().iter().flat_map(|row| &row.attempts).any(|attempt| !attempt.measurements.is_empty()));
    assert_eq!(RunRecord::of_folded(whole.clone()), RunRecord::from_state(&whole));
}

#[test]
fn records_keep_their_schema() {
    validate(&serde_json::to_value(record()).unwrap());
}

/// Programs that only look at `outcome` find no pass in a run of chosen items.
#[test]
fn a_selection_has_no_outcome() {
    let mut header = header();
    header.selection = Some(vec!["identity".to_owned()]);
    let record = RunRecord::from_state(&small_run(header).state).unwrap();
    assert_eq!(record.verdict, Verdict::Selection(Outcome::Errored));
    let json = serde_json::to_value(&record).unwrap();
    assert_eq!((&json["outcome"], &json["selection_outcome"]), (&Value::Null, &Value::from("errored")));
    validate(&json);
    assert_eq!(serde_json::from_value::<RunRecord>(json).unwrap(), record);
    let whole = serde_json::to_value(self::record()).unwrap();
    assert_eq!((&whole["outcome"], whole.get("selection_outcome")), (&Value::from("errored"), None));
}

/// A checker would refuse a good record with an item that the schema does not know.
#[test]
fn the_schema_knows_every_item() {
    let schema: Value = serde_json::from_str(SCHEMA).unwrap();
    let known = &schema["$defs"]["item"]["properties"]["id"]["enum"];
    let items: Vec<&str> = crate::catalogue::ItemId::ALL.iter().map(|item| item.as_str()).collect();
    assert_eq!(*known, Value::from(items));
}

#[test]
fn the_schema_refuses_what_is_wrong() {
    let schema: Value = serde_json::from_str(SCHEMA).unwrap();
    let good = serde_json::to_value(record()).unwrap();
    let change = |pointer: &str, value: Value| {
        let mut record = good.clone();
        *record.pointer_mut(pointer).unwrap() = value;
        !problems(&schema, &schema, &record, "").is_empty()
    };
    assert!(change("/outcome", "PASSED".into()));
    assert!(change("/items/0/attempts/0/measurements/0/outcome", "good".into()));
    assert!(change("/items/0/id", "unknown".into()));
    assert!(change("/plan/sha256", "xyz".into()));
    assert!(change("/started", Value::Null));
}

/// Every field has a description, so that the schema suffices to read a record.
#[test]
fn every_field_has_a_description() {
    fn walk(schema: &Value, path: &str) {
        if let Some(properties) = schema.get("properties").and_then(Value::as_object) {
            for (name, property) in properties {
                let described = property.get("description").is_some();
                assert!(described, "{path}.{name} has no description");
                walk(property, &format!("{path}.{name}"));
            }
        }
        for (name, definition) in schema.get("$defs").and_then(Value::as_object).into_iter().flatten() {
            walk(definition, name);
        }
        for key in ["items", "additionalProperties"] {
            if let Some(inner) = schema.get(key) {
                walk(inner, path);
            }
        }
        for inner in schema.get("anyOf").and_then(Value::as_array).into_iter().flatten() {
            walk(inner, path);
        }
    }
    walk(&serde_json::from_str(SCHEMA).unwrap(), "run");
}

fn validate(record: &Value) {
    let schema: Value = serde_json::from_str(SCHEMA).unwrap();
    let found = problems(&schema, &schema, record, "run");
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// The part of JSON Schema that our schemas use. An unknown keyword is a problem, so that every keyword is checked.
pub(crate) fn problems(root: &Value, schema: &Value, value: &Value, path: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (keyword, rule) in schema.as_object().unwrap() {
        let ok = match keyword.as_str() {
            "$schema" | "$id" | "$defs" | "title" | "description" | "format" => true,
            "$ref" => {
                let target = root.pointer(rule.as_str().unwrap().trim_start_matches('#')).unwrap();
                found.extend(problems(root, target, value, path));
                true
            }
            "type" => {
                let types = rule.as_array().cloned().unwrap_or_else(|| vec![rule.clone()]);
                types.iter().any(|wanted| match wanted.as_str().unwrap() {
                    "null" => value.is_null(),
                    "string" => value.is_string(),
                    "boolean" => value.is_boolean(),
                    "number" => value.is_number(),
                    "integer" => value.is_u64() || value.is_i64(),
                    "array" => value.is_array(),
                    "object" => value.is_object(),
                    other => panic!("type {other}"),
                })
            }
            "enum" => rule.as_array().unwrap().contains(value),
            "const" => rule == value,
            "minimum" => value.as_f64().is_none_or(|number| number >= rule.as_f64().unwrap()),
            "pattern" => {
                let lengths: &[usize] = match rule.as_str().unwrap() {
                    "^[0-9a-f]{64}$" => &[64],
                    "^[0-9a-f]{128}$" => &[128],
                    "^([0-9a-f]{40}|[0-9a-f]{64})$" => &[40, 64],
                    other => panic!("pattern {other}"),
                };
                let is_hex = |text: &str| text.bytes().all(|b| b"0123456789abcdef".contains(&b));
                let hex = |text: &str| lengths.contains(&text.len()) && is_hex(text);
                value.as_str().is_none_or(hex)
            }
            "required" => {
                let names = rule.as_array().unwrap().iter().map(|name| name.as_str().unwrap());
                names.into_iter().all(|name| value.get(name).is_some())
            }
            "properties" => {
                for (name, property) in rule.as_object().unwrap() {
                    if let Some(inner) = value.get(name) {
                        found.extend(problems(root, property, inner, &format!("{path}.{name}")));
                    }
                }
                true
            }
            "additionalProperties" => {
                assert_eq!(rule, &Value::Bool(false));
                let known = schema["properties"].as_object().unwrap();
                value.as_object().is_none_or(|object| object.keys().all(|key| known.contains_key(key)))
            }
            "items" => {
                for (index, inner) in value.as_array().into_iter().flatten().enumerate() {
                    found.extend(problems(root, rule, inner, &format!("{path}[{index}]")));
                }
                true
            }
            "anyOf" => rule.as_array().unwrap().iter().any(|option| problems(root, option, value, path).is_empty()),
            "oneOf" => {
                let fits = |option: &&Value| problems(root, option, value, path).is_empty();
                rule.as_array().unwrap().iter().filter(fits).count() == 1
            }
            "maximum" => value.as_f64().is_none_or(|number| number <= rule.as_f64().unwrap()),
            "minItems" => value.as_array().is_none_or(|values| values.len() as u64 >= rule.as_u64().unwrap()),
            "maxItems" => value.as_array().is_none_or(|values| values.len() as u64 <= rule.as_u64().unwrap()),
            other => panic!("keyword {other}"),
        };
        if !ok {
            found.push(format!("{path}: {keyword} {rule} refuses {value}"));
        }
    }
    found
}
