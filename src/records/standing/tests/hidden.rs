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

/// The first line of the journal of a run of SN-1.
fn first_event(plan: &str, serial_number: &str) -> String {
    let header = json!({ "schema": "gnc-events/1", "serial_number": serial_number, "operator": null, "station": "s",
        "program": { "name": "p", "version": "1" }, "bench": { "kind": "real" },
        "plan": plan_info(plan, DIGEST), "selection": null, "loop": null });
    let event = json!({ "seq": 0, "at": LATER, "elapsed_us": 0, "kind": "run_started", "header": header, "items": [] });
    format!("{event}\n")
}

/// A run that began, in the chain too, and whose station was killed.
fn begun(shelf: &Shelf, plan: &str, ended: &str) -> PathBuf {
    let run = shelf.open(plan, ended, |_| {});
    fs::remove_file(run.join(RECORD)).expect("a record");
    fs::write(run.join(JOURNAL), first_event(plan, "SN-1")).expect("a journal");
    let by = chain::Scribe { station: "bench 1", at: time(ENDED), key: None, late: None };
    chain::begin(&run, &by).expect("a chain");
    run
}

/// A failed run on a day of its own goes with the folder of its module: the chain of that day still names it.
#[test]
fn a_failure_whose_module_folder_is_gone_is_a_doubt() {
    let shelf = Shelf::new();
    shelf.run("functional", ENDED);
    let failed = shelf.run_with("functional", "2026-11-29T09:00:05+08:00", failed);
    let ask = || shelf.ask("2026-11-29T10:00:00+08:00", PlanAsked::Named("functional"), BenchKind::Real);
    assert!(!ask().passes_beyond_doubt(), "{}", ask());
    let module = failed.parent().expect("a folder");
    fs::rename(module, shelf.path().join("aside")).expect("a folder");
    let said = "functional passed 2026-11-28 14:30; then functional 2026-11-29 09:00: record is missing";
    assert!(!ask().passes_beyond_doubt(), "{}", ask());
    assert_eq!(ask().to_string(), said);
    // A link to the folder elsewhere is no folder.
    std::os::unix::fs::symlink(shelf.path().join("aside"), module).expect("a link");
    assert_eq!(ask().to_string(), said);
    fs::remove_file(module).expect("a link");
    // A later pass counts, and what was before it is no doubt.
    shelf.run("functional", "2026-11-29T09:30:05+08:00");
    assert!(ask().passes_beyond_doubt(), "{}", ask());
}

/// A station is killed at the first failure, and the run goes, alone or with the folder of its module, or is emptied, or gets the
/// journal of another module.
#[test]
fn a_run_that_began_and_is_gone_is_a_doubt() {
    let spoils: [fn(&Path); 5] = [
        |_| {},
        |run| fs::remove_dir_all(run).expect("a run"),
        |run| fs::remove_dir_all(run.parent().expect("a folder")).expect("a module"),
        |run| fs::write(run.join(JOURNAL), "").expect("a journal"),
        |run| fs::write(run.join(JOURNAL), first_event("functional", "SN-2")).expect("a journal"),
    ];
    for (at, spoil) in spoils.into_iter().enumerate() {
        for day in ["2026-11-28T14:40:05+08:00", "2026-11-29T09:00:05+08:00"] {
            let shelf = Shelf::new();
            shelf.run("functional", ENDED);
            let ask = || shelf.ask("2026-11-29T10:00:00+08:00", PlanAsked::Named("functional"), BenchKind::Real);
            let run = begun(&shelf, "functional", day);
            if at == 2 && day.starts_with("2026-11-28") {
                // The pass stands in the same folder.
                continue;
            }
            spoil(&run);
            assert!(!ask().passes_beyond_doubt(), "{at}, {day}: {}", ask());
            assert!(ask().to_string().contains("; then functional 2026-11-2"), "{at}, {day}: {}", ask());
        }
    }
}

/// A run of which two lines say that it was closed has been written by hand, whichever of them is true; and the counter keeps the last
/// line of all.
#[test]
fn a_line_that_was_written_by_hand_is_no_pass() {
    let shelf = Shelf::new();
    let run = shelf.run("functional", ENDED);
    let by = chain::Scribe { station: "bench 1", at: time(ENDED), key: None, late: None };
    let counter = shelf.path().join("COUNTER");
    let counted = fs::read(&counter).expect("a counter");
    let chain_file = shelf.path().join("2026-11-28/CHAIN");
    let line = fs::read_to_string(&chain_file).expect("a chain");
    chain::append_as(&run, &by).expect("a second line");
    assert_eq!(shelf.standing_at(LATER).to_string(), "functional passed 2026-11-28 14:30: record was changed");
    assert_eq!(chain::standing(&run).expect("readable"), chain::ChainStanding::Other);
    // One line, made anew with all that it says, and the counter as it was.
    fs::write(&chain_file, "").expect("a chain");
    fs::remove_file(&counter).expect("a counter");
    let later = chain::Scribe { station: "bench 2", ..by };
    chain::append_as(&run, &later).expect("another line");
    assert!(shelf.standing_at(LATER).passes(), "nothing tells the lines apart");
    assert_ne!(fs::read_to_string(&chain_file).expect("a chain"), line);
    fs::write(&counter, counted).expect("a counter");
    assert_eq!(shelf.standing_at(LATER).to_string(), "functional passed 2026-11-28 14:30: record was changed");
}
