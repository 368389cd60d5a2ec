//! Files that a person puts into the folder of a run, or exchanges there, before it is closed.

use std::fs;

use chrono::{DateTime, FixedOffset};
use gnc_executive::event::{BenchKind, Event, ProgramVersion};
use gnc_executive::plan::Plan;
use serde_json::{Value, json};

use super::*;
use crate::passport::{PASSPORT, PASSPORT_XML};
use crate::report::REPORT;
use crate::store::{LOG, RECORD, RecordWriter, Sealer, seal_interrupted};

const TEXT: &str =
    "name = \"functional\"\nversion = \"1\"\n[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"<= 0\"\n";

/// Files that no station writes into the folder of this run; `attempt-1.mcap` has the name of one that it may write.
const STRANGERS: [&str; 11] = [
    "01-cpu/attempt-01.mcap",
    "01-cpu/attempt-9.mcap",
    "01-cpu/more/attempt-1.mcap",
    "01-cpu/notes.txt",
    "02-other/item.json",
    "SHA256SUMS.before",
    "certificate.pdf",
    "cut-off.json",
    "item.json",
    "plan/02-more.toml",
    "plan/xx",
];

fn at() -> DateTime<FixedOffset> {
    "2026-11-28T16:00:00+08:00".parse().unwrap()
}

/// The events of a run of one item, at most so many.
fn events(count: usize) -> Vec<Value> {
    let sha256 = digest::of_plan([("functional.toml", TEXT.as_bytes())].into_iter());
    let header = json!({
        "schema": "gnc-events/1", "serial_number": "SN-1", "operator": null, "station": "bench 1",
        "program": { "name": "gnc-station", "version": "1.2" }, "bench": { "kind": "real" }, "selection": null,
        "loop": null, "plan": { "name": "functional", "version": "1", "sha256": sha256 },
    });
    let items = json!([{ "name": "cpu", "id": "cpu", "title": "CPU", "optional": false, "selected": true }]);
    let kinds = [
        json!({ "kind": "run_started", "header": header, "items": items }),
        json!({ "kind": "item_started", "item": "cpu", "attempt": 1 }),
        json!({ "kind": "attempt_ended", "item": "cpu", "attempt": 1, "outcome": "passed", "error": null }),
        json!({ "kind": "item_ended", "item": "cpu", "outcome": "passed", "cause": null }),
        json!({ "kind": "run_ended", "outcome": "passed" }),
    ];
    let stamped = |(seq, mut kind): (usize, Value)| {
        kind["seq"] = json!(seq);
        kind["at"] = json!(at());
        kind["elapsed_us"] = json!(seq);
        kind
    };
    kinds.into_iter().take(count).enumerate().map(stamped).collect()
}

/// Carries out a run up to an event; before the last one `spoil` finds the folder.
fn run(records: &Path, count: usize, spoil: impl Fn(&Path)) -> PathBuf {
    let plan = Plan::read("functional.toml", TEXT.into(), &mut |_| Err(String::new())).unwrap();
    let folder = RunFolder::create(records, at(), "SN-1", "functional").unwrap();
    let path = folder.path().to_owned();
    let writer = RecordWriter::without_thread(folder, &plan, Vec::new()).unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    runtime.block_on(async {
        for (at, event) in events(count).into_iter().enumerate() {
            if at + 1 == count {
                spoil(&path);
            }
            let event: Event = serde_json::from_value(event).unwrap();
            writer.state().lock().unwrap().apply(&event).unwrap();
            writer.place().await.unwrap().write(event, true).synced().await.unwrap();
        }
        writer.close().await.unwrap();
    });
    path
}

fn put(run: &Path, name: &str, text: &str) {
    fs::create_dir_all(run.join(name).parent().unwrap()).unwrap();
    fs::write(run.join(name), text).unwrap();
}

/// Strangers, papers of other hands, an exchanged file of an item and an exchanged plan.
fn spoil(run: &Path) {
    STRANGERS.iter().for_each(|name| put(run, name, "planted"));
    [PASSPORT, PASSPORT_XML, REPORT, RECORD, LOG, "run.json.part"].iter().for_each(|name| put(run, name, "planted"));
    put(run, "01-cpu/item.json", "{\"outcome\":\"better\"}");
    put(run, "01-cpu/attempt-1.mcap", "");
    put(run, "plan/01-functional.toml", "name = \"easier\"");
}

fn added() -> Vec<String> {
    STRANGERS.iter().map(|name| format!("{name} was added")).collect()
}

fn text(run: &Path, name: &str) -> String {
    fs::read_to_string(run.join(name)).unwrap()
}

/// The findings about a folder, without those about the planted raw files, which hold no samples.
fn found(run: &Path) -> Vec<String> {
    let mut found = crate::store::as_written::verify(run);
    found.retain(|problem| !problem.starts_with("01-cpu/attempt-1.mcap: ") && !problem.contains("attempt-9.mcap: "));
    found.retain(|problem| !problem.contains("attempt-01.mcap: ") && !problem.contains("more/attempt-1.mcap: "));
    found
}

#[test]
fn a_run_is_closed_with_what_its_station_wrote() {
    let (clean, spoiled) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let as_written = run(clean.path(), 5, |_| {});
    assert_eq!(crate::store::as_written::verify(&as_written), Vec::<String>::new());
    assert_eq!(crate::store::as_written::of_strangers(&as_written), None);
    let run = run(spoiled.path(), 5, spoil);
    assert_eq!(found(&run), added());
    for name in ["01-cpu/item.json", "plan/01-functional.toml", RECORD, LOG] {
        assert_eq!(text(&run, name), text(&as_written, name), "{name}");
    }
    // No paper is made of a run without a calibration, and none that was put there stays.
    assert!(!run.join(PASSPORT).exists() && !run.join(PASSPORT_XML).exists());
    assert!(!text(&run, REPORT).contains("planted"));
    let sums = FileDigests::read(&run).unwrap().0;
    assert!(sums.get("01-cpu/attempt-1.mcap").is_some(), "raw samples of an attempt belong to the run");
    let (what, _) = crate::store::as_written::of_strangers(&run).unwrap();
    let said = "files in the folder of the run that the station did not write are not sealed with it: 01-cpu/attempt-01.mcap, \
                11 in all";
    assert_eq!(what, said);
}

/// What was exchanged while the run lay there after a kill is made anew from the journal, and the start says what is not of the run.
#[test]
fn a_start_closes_a_run_with_what_its_station_wrote() {
    // The run was cut off behind its item, and once more at its very end.
    for count in [4, 5] {
        let records = tempfile::tempdir().unwrap();
        let other = tempfile::tempdir().unwrap();
        let run = run(records.path(), 4, |_| {});
        let item = text(&run, "01-cpu/item.json");
        if count == 5 {
            let last = serde_json::to_string(&events(5)[4]).unwrap();
            fs::write(run.join(JOURNAL), format!("{}{last}\n", text(&run, JOURNAL))).unwrap();
        }
        let plan = text(&run, "plan/01-functional.toml");
        spoil(&run);
        [RECORD, "cut-off.json", "SHA256SUMS.before"].iter().for_each(|name| fs::remove_file(run.join(name)).unwrap());
        for name in ["01-cpu/attempt-1.mcap", "01-cpu/attempt-9.mcap", "01-cpu/attempt-01.mcap"] {
            fs::remove_file(run.join(name)).unwrap();
        }
        fs::remove_dir_all(run.join("01-cpu/more")).unwrap();
        let program = ProgramVersion { name: "gnc-station".to_owned(), version: "1.3".to_owned(), build: None };
        let by = Sealer { station: "bench 1", kind: BenchKind::Real, program: &program, at: at(), key: None };
        if count == 4 {
            put(&run, "plan/01-functional.toml", &plan);
        }
        let said = seal_interrupted(records.path(), &by);
        let rest = ["01-cpu/notes.txt", "02-other/item.json", "certificate.pdf", "item.json"];
        let more = ["plan/02-more.toml", "plan/xx"];
        // A plan that is not the one of the journal is none of the run.
        let exchanged = (count == 5).then_some("plan/01-functional.toml");
        let expected: Vec<String> =
            rest.into_iter().chain(exchanged).chain(more).map(|name| format!("{name} was added")).collect();
        assert_eq!(found(&run), expected);
        assert_eq!(text(&run, "01-cpu/item.json"), item);
        assert!(!run.join(PASSPORT).exists() && !text(&run, LOG).contains("planted"));
        let first = said.iter().position(|line| line.contains("sealed as interrupted") || line.contains("closed late"));
        let early = &said[first.unwrap() + 1];
        assert!(early.contains("a run (passport.json passport.xml report.html log.txt"), "{said:?}");
        let next = &said[first.unwrap() + 2];
        let what = "did not write are not sealed with it: 01-cpu/notes.txt, ";
        assert!(next.starts_with("2026-11-28/SN-1/160000-functional: files in") && next.contains(what), "{said:?}");
        assert_eq!(seal_interrupted(records.path(), &by), Vec::<String>::new());
        drop(other);
    }
}

/// A power cut may take the line that says that an attempt began, and leave its raw file.
#[test]
fn the_raw_file_of_an_attempt_that_the_journal_lost_belongs_to_the_run() {
    let event = |value: Value| serde_json::from_value::<Event>(value).unwrap();
    let mut state = RunState::new();
    for value in events(1) {
        state.apply(&event(value)).unwrap();
    }
    let have = |state: &RunState, name: &str| RawNames::of(state).have(Path::new(name));
    assert!(have(&state, "01-cpu/attempt-1.mcap") && !have(&state, "01-cpu/attempt-2.mcap"));
    for value in events(4).into_iter().skip(1) {
        state.apply(&event(value)).unwrap();
    }
    assert!(have(&state, "01-cpu/attempt-1.mcap") && have(&state, "01-cpu/attempt-1-1000.mcap"));
    for other in ["01-cpu/attempt-2.mcap", "01-cpu/attempt-1-1001.mcap", "01-cpu/attempt-1-1.mcap", "attempt-1.mcap"] {
        assert!(!have(&state, other), "{other}");
    }
}

/// A file of a plan is told by its number and the digest of all, also if its name has other letters than a disk takes.
#[test]
fn the_files_of_a_plan_are_found_by_the_digest_of_the_journal() {
    let folder = tempfile::tempdir().unwrap();
    let files = [("приёмка.toml", "a"), ("limits.toml", "b")];
    for (at, (name, text)) in files.iter().enumerate() {
        put(folder.path(), &format!("{PLAN}/{:02}-{}", at + 1, name::of_part(name)), text);
    }
    let sha256 = digest::of_plan(files.iter().map(|(name, text)| (*name, text.as_bytes())));
    let mut value = events(1).remove(0);
    value["header"]["plan"]["sha256"] = json!(sha256);
    let mut state = RunState::new();
    state.apply(&serde_json::from_value(value).unwrap()).unwrap();
    let count = || match PlanFiles::found(folder.path(), &state).unwrap() {
        PlanFiles::Found(files) => files.len(),
        PlanFiles::Written(_) => 0,
    };
    assert_eq!(count(), 2);
    // A third one, one without a number, and one with the number of another.
    for (name, left) in [("03-more.toml", 2), ("xx", 2), ("01-again.toml", 0)] {
        put(folder.path(), &format!("{PLAN}/{name}"), "c");
        assert_eq!(count(), left, "{name}");
    }
}

/// A name that does not tell what the plan was is one that a person may have chosen.
#[test]
fn a_plan_under_a_name_that_tells_nothing_is_none_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let mut state = RunState::new();
    state.apply(&serde_json::from_value(events(1).remove(0)).unwrap()).unwrap();
    for (name, count) in [("01-functional.toml", 1), ("01-functional~deadbeef.toml", 0), ("01-functional~deadbeef", 0)]
    {
        put(folder.path(), &format!("{PLAN}/{name}"), TEXT);
        let PlanFiles::Found(files) = PlanFiles::found(folder.path(), &state).unwrap() else {
            panic!("files that were found")
        };
        assert_eq!(files.len(), count, "{name}");
        std::fs::remove_file(folder.path().join(PLAN).join(name)).unwrap();
    }
}
