//! Shifts over midnight and over a jump of the clock, and what counts as a first try.

use std::path::Path;

use gnc_executive::event::Event;
use gnc_executive::plan::Plan;

use super::*;
use crate::store::{RECORD, RecordWriter, RunFolder};

fn at(text: &str) -> DateTime<FixedOffset> {
    DateTime::parse_from_rfc3339(text).expect("a time")
}

fn times(texts: &[&str]) -> Vec<NaiveTime> {
    texts.iter().map(|text| text.parse().expect("a time of day")).collect()
}

/// A place eight hours east of Greenwich whose clock jumps from 02:00 to 03:00 on the 29th of March.
fn east(local: NaiveDateTime) -> Option<DateTime<FixedOffset>> {
    let hour = local.format("%F %H").to_string();
    let zone = FixedOffset::east_opt(8 * 3600)?;
    (hour != "2026-03-29 02").then(|| local.and_local_timezone(zone).earliest()).flatten()
}

#[test]
fn a_shift_begins_at_its_time_of_day_and_goes_on_over_midnight() {
    let begins = times(&["06:00:00", "14:00:00", "22:00:00"]);
    for (now, began) in [
        ("2026-11-23T05:59:59+08:00", "2026-11-22T22:00:00+08:00"),
        ("2026-11-23T06:00:00+08:00", "2026-11-23T06:00:00+08:00"),
        ("2026-11-23T21:59:59+08:00", "2026-11-23T14:00:00+08:00"),
        ("2026-11-24T00:00:02+08:00", "2026-11-23T22:00:00+08:00"),
    ] {
        assert_eq!(begin_of(at(now), &begins, east), at(began), "{now}");
    }
    let now = at("2026-11-23T23:59:59+08:00");
    assert_eq!(begin_of(now, &[], east), at("2026-11-23T00:00:00+08:00"));
    let jumped = begin_of(at("2026-03-29T05:00:00+08:00"), &times(&["02:30:00"]), east);
    assert_eq!(jumped, at("2026-03-29T03:30:00+08:00"));
}

fn run(serial_number: &str, plan: &str, minute: u32, outcome: Outcome) -> WholeRun {
    let started = at(&format!("2026-11-23T08:{minute:02}:00+08:00"));
    WholeRun { serial_number: serial_number.into(), plan: plan.into(), started, outcome }
}

fn count(mut runs: Vec<WholeRun>) -> Shift {
    runs.sort_by_key(|run| run.started);
    Shift::of(at("2026-11-23T06:00:00+08:00"), &runs, |serial_number, _| serial_number == "OLD")
}

#[test]
fn the_last_run_decides_and_the_first_judged_run_is_the_first_try() {
    use Outcome::{Aborted, Errored, Failed, Marginal, Passed};
    let shift = count(vec![
        run("A", "functional", 1, Passed),
        // Failed first, passed then: done and passed, but not at the first try.
        run("B", "functional", 2, Failed),
        run("B", "functional", 9, Passed),
        // An errored and an aborted run are no tries.
        run("C", "functional", 3, Errored),
        run("C", "functional", 4, Aborted),
        run("C", "functional", 5, Marginal),
        run("D", "functional", 6, Failed),
        run("E", "functional", 7, Errored),
        // Judged before this shift.
        run("OLD", "functional", 8, Passed),
    ]);
    let order: Vec<&str> = shift.modules.iter().map(|module| module.serial_number.as_str()).collect();
    assert_eq!(order, ["A", "C", "D", "E", "OLD", "B"]);
    assert_eq!(shift.count(Outcome::is_good), 4);
    assert_eq!(shift.count(|outcome| outcome == Failed), 1);
    assert_eq!(shift.count(|outcome| outcome == Errored), 1);
    assert_eq!(shift.first_pass(), (2, 4));
}

/// A bench that does not prove its board adds nothing to a shift, neither to that of a real bench nor to its own.
#[test]
fn an_unproven_run_is_of_no_shift() {
    let found = |kind: &str| {
        let at = "2026-11-23T08:00:00+08:00";
        let header = serde_json::json!({
            "schema": "gnc-events/1", "serial_number": "A", "operator": null, "station": "s",
            "program": { "name": "p", "version": "1" }, "bench": { "kind": kind }, "selection": null, "loop": null,
            "plan": { "name": "functional", "version": "1.0", "sha256": "aa" },
        });
        let begun = serde_json::json!({ "seq": 0, "at": at, "elapsed_us": 0, "kind": "run_started", "header": header, "items": [] });
        let ended =
            serde_json::json!({ "seq": 1, "at": at, "elapsed_us": 5, "kind": "run_ended", "outcome": "failed" });
        let folded = gnc_executive::journal::fold(format!("{begun}\n{ended}\n").as_bytes()).unwrap();
        let run = Ok(gnc_executive::record::RunRecord::from_state(&folded.state).unwrap());
        FoundRun { path: PathBuf::from("2026-11-23/A/080000-functional"), run, sealed: true, running: false }
    };
    let counts = |run: &str, of: BenchKind| {
        let of = ShiftOf { records: PathBuf::new(), station: "s".into(), kind: of };
        let found = found(run);
        let face = Seals::new(Path::new("")).face(&found);
        WholeRun::of(&found, &of, &face).is_some()
    };
    use BenchKind::{Real, Simulated, Unproven};
    assert!(counts("real", Real) && counts("simulated", Simulated));
    for of in [Real, Simulated, Unproven] {
        assert!(!counts("unproven", of), "{of:?}");
    }
}

/// The record of a run that passed is edited after the run was closed: it is no pass of the shift, though its journal says so.
#[test]
fn a_record_that_was_edited_is_no_pass_of_the_shift() {
    let place = tempfile::tempdir().expect("a folder");
    let records = place.path();
    let run = {
        let text = "name = \"functional\"\nversion = \"1\"\n[[item]]\nid = \"io\"\nlimits.wrong_reads = \"<= 0\"\n";
        let plan = Plan::read("functional.toml", text.into(), &mut |_| Err(String::new())).expect("a plan");
        let header = serde_json::json!({
            "schema": "gnc-events/1", "serial_number": "A", "operator": null, "station": "s",
            "program": { "name": "p", "version": "1" }, "bench": { "kind": "real" }, "selection": null, "loop": null,
            "plan": { "name": "functional", "version": "1", "sha256": "aa" },
        });
        let time = "2026-11-23T08:00:00+08:00";
        let folder = RunFolder::create(records, time.parse().expect("a time"), "A", "functional").expect("a folder");
        let run = folder.path().to_owned();
        let writer = RecordWriter::without_thread(folder, &plan, Vec::new()).expect("a record");
        let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
        runtime.block_on(async {
            for event in [
                serde_json::json!({ "seq": 0, "at": time, "elapsed_us": 0, "kind": "run_started", "header": header, "items": [] }),
                serde_json::json!({ "seq": 1, "at": time, "elapsed_us": 5, "kind": "run_ended", "outcome": "passed" }),
            ] {
                let event: Event = serde_json::from_value(event).expect("an event");
                writer.state().lock().expect("a state").apply(&event).expect("in order");
                writer.place().await.expect("a place").write(event, true).synced().await.expect("on disk");
            }
            writer.close().await.expect("closed");
        });
        run
    };
    let count = || {
        let of = ShiftOf { records: records.to_owned(), station: "s".into(), kind: BenchKind::Real };
        let shift = ShiftBook::new(of).shift(at("2026-11-23T06:00:00+08:00"), at("2026-11-23T09:00:00+08:00"));
        (shift.count(Outcome::is_good), shift.count(|outcome| outcome == Outcome::Errored), shift.first_pass())
    };
    assert_eq!(count(), (1, 0, (1, 1)));
    let record = std::fs::read_to_string(run.join(RECORD)).expect("a record");
    std::fs::write(run.join(RECORD), record.replace("\"A\"", "\"B\"")).expect("a record");
    assert_eq!(count(), (0, 1, (0, 0)));
}

#[test]
fn each_plan_has_its_own_first_try() {
    use Outcome::{Failed, Passed};
    let both = [run("A", "incoming", 1, Passed), run("A", "functional", 2, Passed)];
    assert_eq!(count(both.to_vec()).first_pass(), (1, 1));
    let second_failed = [run("A", "incoming", 1, Passed), run("A", "functional", 2, Failed)];
    assert_eq!(count(second_failed.to_vec()).first_pass(), (0, 1));
    assert_eq!(count(Vec::new()).first_pass(), (0, 0));
}

/// The clock is set back after a pass, by its time service or in the second of two equal hours, and the module fails: that came
/// last, though its folder is the older one.
#[test]
fn what_was_closed_last_is_the_last_run_whatever_the_clock_says() {
    use Outcome::{Failed, Passed};
    let records = tempfile::tempdir().unwrap();
    let of = ShiftOf { records: records.path().to_owned(), station: "s".into(), kind: BenchKind::Real };
    let since = at("2026-11-23T06:00:00+08:00");
    let mut book = ShiftBook { since: Some(since), ..ShiftBook::new(of) };
    for (minute, serial_number, outcome) in [(40, "A", Passed), (45, "B", Passed), (10, "A", Failed)] {
        let folder = records.path().join(format!("2026-11-23/{serial_number}/08{minute}00-functional"));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join(crate::store::DIGESTS), "").unwrap();
        chain::append(&folder).unwrap();
        book.read.insert(folder, Some(run(serial_number, "functional", minute, outcome)));
    }
    let shift = book.shift(since, at("2026-11-23T09:00:00+08:00"));
    let modules: Vec<_> =
        shift.modules.iter().map(|module| (module.serial_number.as_str(), module.outcome, module.first_pass)).collect();
    assert_eq!(modules, [("B", Passed, Some(true)), ("A", Failed, Some(true))]);
}
