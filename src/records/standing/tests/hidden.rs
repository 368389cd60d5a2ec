//! What people do to hide a failed run from the gate of the next plan.

use super::apart::exchanged;
use super::*;

fn failed(record: &mut Value) {
    record["outcome"] = "failed".into();
}

/// A failure of chosen items, which leaves the pass before it as the run that counts.
fn failed_item(record: &mut Value) {
    (record["selection"], record["outcome"]) = (json!(["cpu"]), Value::Null);
    record["selection_outcome"] = "failed".into();
}

pub(super) fn edit(run: &Path, change: impl Fn(&mut Value)) {
    let path = run.join(RECORD);
    let mut record: Value = serde_json::from_slice(&fs::read(&path).expect("a record")).expect("JSON");
    change(&mut record);
    fs::write(path, serde_json::to_vec_pretty(&record).expect("JSON")).expect("a record");
}

/// A failure after a pass is edited: each edit leaves a doubt that closes the gate, on both kinds of bench.
#[test]
fn no_edit_of_a_record_opens_the_gate() {
    let set = |key: &'static str, value: Value| -> Box<dyn Fn(&mut Value)> {
        Box::new(move |record| record[key] = value.clone())
    };
    let edits = [
        set("outcome", json!("passed")),
        set("serial_number", json!("SN-2")),
        set("plan", serde_json::to_value(plan_info("burn-in", DIGEST)).expect("JSON")),
        set("bench", json!({ "kind": "simulated" })),
        set("recomputed", json!({ "run": "120000-functional", "journal_sha256": "00" })),
        set("schema", json!("gnc-run/1 ")),
        set("other_module", json!({ "scanned": "SN-1", "found": "SN-9" })),
    ];
    for (at, change) in edits.iter().enumerate() {
        for without_digests in [false, true] {
            let shelf = Shelf::new();
            shelf.run("functional", ENDED);
            let run = shelf.run_with("functional", "2026-11-28T14:40:05+08:00", failed);
            edit(&run, change);
            if without_digests {
                fs::remove_file(run.join(DIGESTS)).expect("digests");
            }
            for bench in [BenchKind::Real, BenchKind::Simulated] {
                let standing = shelf.ask(LATER, PlanAsked::Named("functional"), bench);
                assert!(!standing.passes_beyond_doubt(), "edit {at}, {without_digests}: {standing}");
                assert!(standing.to_string().contains("; then functional "), "edit {at}: {standing}");
            }
        }
    }
}

/// The folder of a plan whose name has other characters is known as its own.
#[test]
fn a_plan_with_a_long_or_strange_name_is_known_by_its_folder() {
    let shelf = Shelf::new();
    let plan = "K\u{e4}lte Lauf";
    let day = |run: PathBuf| {
        let folder = run.with_file_name(format!(
            "{}-{}",
            run.file_name().expect("a name").to_string_lossy().split('-').next().expect("a time"),
            name::of_part(plan)
        ));
        fs::rename(&run, &folder).expect("a folder");
        close(&folder);
        folder
    };
    day(shelf.open(plan, ENDED, |_| {}));
    let run = day(shelf.open(plan, "2026-11-28T14:40:05+08:00", failed));
    edit(&run, |record| record["plan"]["name"] = "burn-in".into());
    let ask = || shelf.ask(LATER, PlanAsked::Named(plan), BenchKind::Real);
    assert!(!ask().passes_beyond_doubt(), "{}", ask());
    fs::remove_dir_all(run).expect("a run");
    assert!(!ask().passes_beyond_doubt(), "{}", ask());
}

/// Many harmless runs after a failure cut it from no judgement, and neither does one that is missing.
#[test]
fn no_number_of_later_runs_hides_a_failure() {
    let shelf = Shelf::new();
    shelf.run("functional", ENDED);
    let hidden = shelf.run_with("functional", "2026-11-28T14:31:05+08:00", failed_item);
    for second in 0..60 {
        let ended = format!("2026-11-28T14:40:{second:02}+08:00");
        shelf.run_with("burn-in", &ended, |record| record["outcome"] = "aborted".into());
    }
    let standing = shelf.standing_at(LATER);
    assert!(!standing.passes_beyond_doubt(), "{standing}");
    assert!(standing.to_string().ends_with("; then only cpu failed 2026-11-28 14:31"), "{standing}");
    fs::remove_dir_all(&hidden).expect("a run");
    let newest = shelf.run("burn-in", "2026-11-28T14:45:05+08:00");
    fs::remove_dir_all(newest).expect("a run");
    let standing = shelf.standing_at(LATER);
    assert!(!standing.passes_beyond_doubt(), "{standing}");
    assert!(standing.to_string().ends_with("; then functional 2026-11-28 14:31: record is missing"), "{standing}");
    // Runs that the chain does not name as well: the power failed, or their lines were taken away.
    let shelf = Shelf::new();
    shelf.run("functional", ENDED);
    shelf.open("functional", "2026-11-28T14:31:05+08:00", failed_item);
    for second in 0..60 {
        shelf.open("burn-in", &format!("2026-11-28T14:40:{second:02}+08:00"), |record| {
            record["outcome"] = "aborted".into();
        });
    }
    assert!(!shelf.standing_at(LATER).passes_beyond_doubt(), "{}", shelf.standing_at(LATER));
}

/// A run that the station filed apart, because another module was in the socket, is edited so that it tells of another one.
#[test]
fn an_exchange_that_is_edited_stays_a_doubt() {
    let shelf = Shelf::new();
    shelf.run("functional", ENDED);
    let header = json!({ "schema": "gnc-events/1", "serial_number": "SN-1", "operator": null, "station": "s",
        "program": { "name": "p", "version": "1" }, "bench": { "kind": "real" },
        "plan": plan_info("functional", DIGEST), "selection": null, "loop": null });
    let event = json!({ "seq": 0, "at": LATER, "elapsed_us": 0, "kind": "run_started", "header": header, "items": [] });
    let run = exchanged(&shelf, "functional", "2026-11-28T14:40:05+08:00", "failed", |_| {});
    fs::write(run.join(JOURNAL), format!("{event}\n")).expect("a journal");
    edit(&run, |record| record["serial_number"] = "SN-2".into());
    let standing = shelf.standing_at(LATER);
    assert!(!standing.passes_beyond_doubt(), "{standing}");
}

/// What is no pass is said to be of a simulated bench on a simulated bench too.
#[test]
fn each_simulated_run_is_called_simulated() {
    let simulated = |record: &mut Value| record["bench"]["kind"] = "simulated".into();
    let shelf = Shelf::new();
    shelf.run_with("functional", ENDED, |record| {
        failed_item(record);
        simulated(record);
    });
    let words = |shelf: &Shelf, bench| shelf.ask(LATER, PlanAsked::Named("functional"), bench).to_string();
    assert_eq!(words(&shelf, BenchKind::Simulated), "only cpu failed 2026-11-28 14:30, simulated");
    assert_eq!(words(&shelf, BenchKind::Real), "only cpu failed 2026-11-28 14:30: simulated");
    shelf.run_with("functional", "2026-11-28T14:20:05+08:00", simulated);
    shelf.run_with("functional", "2026-11-28T14:40:05+08:00", |record| {
        failed_item(record);
        simulated(record);
    });
    let both = "functional passed 2026-11-28 14:20, simulated; then only cpu failed 2026-11-28 14:40, simulated";
    assert_eq!(words(&shelf, BenchKind::Simulated), both);
}
