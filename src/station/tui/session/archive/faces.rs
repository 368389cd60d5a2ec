//! One run has one word: each state of a record, over all that speak of it.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use gnc_executive::event::{BenchKind, Event};
use gnc_executive::plan::Plan;
use gnc_records::shift::{ShiftBook, ShiftOf};
use gnc_records::store::{RecordWriter, RunFolder, digest, reader};
use serde_json::json;

use super::{open, runs};
use crate::tui::Lang;
use crate::tui::model::MessageWeight;
use crate::tui::records::word;

const DAY: &str = "2026-11-23";
const TIME: &str = "2026-11-23T08:00:00+08:00";
const PLAN: &str = "name = \"functional\"\nversion = \"1\"\n[[item]]\nid = \"io\"\nlimits.wrong_reads = \"<= 0\"\n";

/// What is done to a record, and what it is called then.
struct State {
    name: &'static str,
    /// What the header of the run has besides.
    header: serde_json::Value,
    /// The outcome with which it ends; `None` if it has no end.
    ends: Option<&'static str>,
    then: fn(&Path),
    /// The word in `records list`.
    listed: &'static str,
    /// The word on the screen.
    screen: &'static str,
    /// What it counts as in the shift; `None` if it does not count.
    shift: Option<&'static str>,
}

/// Files a run, and does to it what makes its state. What is returned holds a run that goes on.
fn record(records: &Path, state: &State) -> (PathBuf, Option<RecordWriter>) {
    let plan = Plan::read("functional.toml", PLAN.into(), &mut |_| Err(String::new())).expect("a plan");
    let mut header = json!({
        "schema": "gnc-events/1", "serial_number": "A", "operator": null, "station": "s",
        "program": { "name": "p", "version": "1" }, "bench": { "kind": "real" }, "selection": null, "loop": null,
        "plan": { "name": "functional", "version": "1", "sha256": "aa" },
    });
    header.as_object_mut().expect("an object").extend(state.header.as_object().cloned().unwrap_or_default());
    let folder = RunFolder::create(records, TIME.parse().expect("a time"), "A", "functional").expect("a folder");
    let run = folder.path().to_owned();
    let writer = RecordWriter::without_thread(folder, &plan, Vec::new()).expect("a record");
    let begin = json!({ "seq": 0, "at": TIME, "elapsed_us": 0, "kind": "run_started", "header": header, "items": [] });
    let end = state
        .ends
        .map(|outcome| json!({ "seq": 1, "at": TIME, "elapsed_us": 5, "kind": "run_ended", "outcome": outcome }));
    let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
    let held = runtime.block_on(async {
        for event in [Some(begin), end].into_iter().flatten() {
            let event: Event = serde_json::from_value(event).expect("an event");
            writer.state().lock().expect("a state").apply(&event).expect("in order");
            writer.place().await.expect("a place").write(event, true).synced().await.expect("on disk");
        }
        if state.ends.is_some() {
            writer.close().await.expect("closed");
            return None;
        }
        Some(writer)
    });
    (state.then)(&run);
    (run, held.filter(|_| state.name == "going on"))
}

fn edit(file: &Path, change: impl Fn(String) -> String) {
    fs::write(file, change(fs::read_to_string(file).expect("a file"))).expect("a file");
}

/// Writes the last line of the chain anew as that of a late close.
fn late(run: &Path) {
    let records = run.ancestors().nth(3).expect("the records");
    let chain = records.join(DAY).join("CHAIN");
    let text = fs::read_to_string(&chain).expect("a chain");
    let (before, last) = text.trim_end().rsplit_once('\n').expect("two lines");
    let mut words: Vec<&str> = last.split(' ').collect();
    words.remove(3);
    words.extend(["late", TIME, "p"]);
    let link = digest::of_bytes(words.join(" ").as_bytes());
    let number = words[0].to_owned();
    words.insert(3, &link);
    fs::write(&chain, format!("{before}\n{}\n", words.join(" "))).expect("a chain");
    fs::write(records.join("COUNTER"), format!("{number} {link}\n")).expect("a counter");
}

/// `records show` calls a run the same by a link to it or to its day, and by `..`.
fn is_the_same_by_all_names(run: &Path, name: &str) {
    let links = tempfile::tempdir().expect("a folder");
    let day = run.ancestors().nth(2).expect("a day");
    symlink(run, links.path().join("run")).expect("a link");
    symlink(day, links.path().join("day")).expect("a link");
    let in_day = run.strip_prefix(day).expect("a run of the day");
    let read = reader::read(run).expect("a run");
    let direct = crate::records::face(run, &read);
    assert!(direct.is_some(), "{name}");
    let own = run.file_name().expect("a name");
    let dotted = [day.join("A/../").join(in_day), run.join("..").join(own), run.join("plan/..")];
    for path in [links.path().join("run"), links.path().join("day").join(in_day)].iter().chain(&dotted) {
        assert_eq!(crate::records::face(path, &read), direct, "{name}: {}", path.display());
    }
}

#[test]
fn each_state_has_one_word_on_all_faces() {
    let nothing = |_: &Path| {};
    let of =
        |name, ends, then, listed, screen, shift| State { name, header: json!({}), ends, then, listed, screen, shift };
    let with = |name, header, listed, screen| State {
        name,
        header,
        ends: Some("passed"),
        then: |_| {},
        listed,
        screen,
        shift: None,
    };
    let states = [
        of("passed", Some("passed"), nothing, "passed", "passed", Some("passed")),
        of("failed", Some("failed"), nothing, "failed", "failed", Some("failed")),
        of("errored", Some("errored"), nothing, "errored", "errored", Some("errored")),
        of("stopped", Some("aborted"), nothing, "aborted", "aborted", Some("aborted")),
        of("interrupted", None, nothing, "interrupted", "interrupted", Some("errored")),
        of("going on", None, nothing, "running", "running", None),
        of("closed late", Some("passed"), late, "closed_late", "closed late", Some("errored")),
        of("failed late", Some("failed"), late, "failed", "failed", Some("failed")),
        of(
            "changed",
            Some("passed"),
            |run| edit(&run.join("run.json"), |text| text.replace("\"A\"", "\"B\"")),
            "changed",
            "changed",
            Some("errored"),
        ),
        of(
            "failed and changed",
            Some("failed"),
            |run| edit(&run.join("events.jsonl"), |text| text.replace("failed", "passed")),
            "changed",
            "changed",
            Some("errored"),
        ),
        of(
            "a journal that was cut",
            Some("failed"),
            |run| edit(&run.join("events.jsonl"), |text| format!("{}\n", text.lines().next().expect("a line"))),
            "changed",
            "changed",
            Some("errored"),
        ),
        of(
            "digests that are gone",
            Some("passed"),
            |run| fs::remove_file(run.join("SHA256SUMS")).expect("digests"),
            "changed",
            "changed",
            Some("errored"),
        ),
        of(
            "outside of any chain",
            Some("passed"),
            |run| {
                fs::remove_file(run.ancestors().nth(2).expect("a day").join("CHAIN")).expect("a chain");
                fs::remove_file(run.ancestors().nth(3).expect("records").join("COUNTER")).expect("a counter");
            },
            "not_in_chain",
            "not in chain",
            Some("errored"),
        ),
        with("unproven", json!({ "bench": { "kind": "unproven", "unproven": "x" } }), "unproven", "passed"),
        with("simulated", json!({ "bench": { "kind": "simulated" } }), "passed", "passed"),
        with("rejudged", json!({ "recomputed": { "run": "r", "journal_sha256": "aa" } }), "rejudged", "passed"),
    ];
    for state in states {
        let place = tempfile::tempdir().expect("a folder");
        let records = place.path();
        let (run, held) = record(records, &state);
        let name = state.name;
        assert_eq!(crate::records::listed(records, &run), state.listed, "{name}");
        let lines = runs(records, DAY.to_owned()).expect("a day").lines;
        let line = &lines[0];
        assert_eq!(word(line.face, Lang::En.texts()), state.screen, "{name}");
        assert_eq!(open(run.clone()).expect("a run").2, line.face, "{name}");
        is_the_same_by_all_names(&run, name);
        // A pass that the list calls otherwise has its caveat beside it on the screen.
        let has_caveat = line.unproven || line.rejudged;
        assert_eq!(state.listed.replace('_', " ") == state.screen, !has_caveat, "{name}");
        let of = ShiftOf { records: records.to_owned(), station: "s".into(), kind: BenchKind::Real };
        let time = |text: &str| text.parse().expect("a time");
        let shift = ShiftBook::new(of).shift(time("2026-11-23T06:00:00+08:00"), time("2026-11-23T20:00:00+08:00"));
        let counted = shift.modules.first().map(|module| module.outcome.as_str());
        assert_eq!(counted, state.shift, "{name}");
        drop(held);
    }
}

/// A verification on the screen looks at the chain as the command does, and calls changed only what was changed.
#[test]
fn a_verification_tells_changes_from_what_is_not_known() {
    let sha256 = digest::of_plan([("functional.toml", PLAN.as_bytes())].into_iter());
    let ended = State {
        name: "ended",
        header: json!({ "plan": { "name": "functional", "version": "1", "sha256": sha256 } }),
        ends: Some("passed"),
        then: |_| {},
        listed: "",
        screen: "",
        shift: None,
    };
    let place = tempfile::tempdir().expect("a folder");
    let (run, held) = record(place.path(), &ended);
    assert!(held.is_none());
    let said = |run: &Path| {
        let crate::tui::update::Msg::Verified { checked, .. } = super::verify(run.to_owned()) else {
            unreachable!("another message")
        };
        crate::tui::update::checked_words(Lang::En, &checked)
    };
    assert_eq!(said(&run), (MessageWeight::Info, "as written: digests and journal agree".to_owned()));
    let chain = place.path().join(DAY).join("CHAIN");
    let text = fs::read_to_string(&chain).expect("a chain");
    let begin: String = text.lines().take(1).map(|line| format!("{line}\n")).collect();
    fs::write(&chain, &begin).expect("a chain");
    let (weight, what) = said(&run);
    assert!(weight == MessageWeight::Warning && what.contains("is not in the chain: its station ended"), "{what}");
    fs::remove_file(&chain).expect("a chain");
    fs::create_dir(&chain).expect("a folder");
    let (weight, what) = said(&run);
    assert!(weight == MessageWeight::Error && what.contains("CHAIN: it is a folder"), "{what}");

    let place = tempfile::tempdir().expect("a folder");
    let (run, _held) = record(place.path(), &State { name: "going on", ends: None, ..ended });
    let told = "the run goes on, so it cannot be verified yet".to_owned();
    assert_eq!(said(&run), (MessageWeight::Warning, told));
}
