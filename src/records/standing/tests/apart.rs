//! Runs that the station filed apart, because another module was in the socket than was scanned.

use super::hidden::edit;
use super::*;
use crate::store::as_written;
use crate::store::reader;

/// A run that began with SN-1 at the time that it has as its end, and ended with SN-9 in the socket, where the station files it.
pub(super) fn exchanged(shelf: &Shelf, plan: &str, ended: &str, item: &str, change: impl Fn(&mut Value)) -> PathBuf {
    let run = shelf.open(plan, ended, |record| {
        record["outcome"] = "errored".into();
        record["items"] = json!([{ "name": "cpu", "outcome": item }, { "name": "imu", "outcome": "errored" }]);
        record["other_module"] = json!({ "scanned": "SN-1", "found": "SN-9", "exchanged": true });
        change(record);
    });
    let day = run.ancestors().nth(2).expect("a day");
    let there = day.join(crate::store::UNASSIGNED).join(run.file_name().expect("a name"));
    fs::create_dir_all(day.join(crate::store::UNASSIGNED)).expect("a folder");
    fs::rename(&run, &there).expect("a folder");
    // Other runs of the module keep its folder.
    let _ = fs::remove_dir(run.parent().expect("a folder"));
    close(&there);
    there
}

/// The module was on the bench, and what became of it there is not known: the pass before counts no more.
#[test]
fn no_pass_counts_before_a_run_in_which_the_module_was_exchanged() {
    let cases = [
        ("passed", "ended with another module in the socket, so nothing is known of this one"),
        ("failed", "an item failed, then another module was in the socket, so nothing more is known of this one"),
    ];
    for (item, words) in cases {
        let shelf = Shelf::new();
        shelf.run("functional", ENDED);
        let run = exchanged(&shelf, "functional", "2026-11-28T14:40:05+08:00", item, |_| {});
        let check = |beside: &str| {
            let standing = shelf.standing_at(LATER);
            assert_eq!(standing.to_string(), format!("functional errored 2026-11-28 14:40: {beside}"));
            assert!(!standing.passes() && !standing.passes_beyond_doubt() && standing.was_run());
        };
        check(words);
        assert!(!shelf.ask(LATER, PlanAsked::Named("functional"), BenchKind::Real).passes_beyond_doubt());
        // Neither a stopped run after it nor the way in which it is kept hides it.
        shelf.run_with("functional", "2026-11-28T14:42:05+08:00", |record| record["outcome"] = "aborted".into());
        check(words);
        fs::remove_file(run.join(DIGESTS)).expect("digests");
        check(&format!("record not closed, {words}"));
        // A later pass counts.
        shelf.run("functional", "2026-11-28T14:45:05+08:00");
        assert_eq!(shelf.standing_at(LATER).to_string(), "functional passed 2026-11-28 14:45");
    }
}

/// The power failed before the run was in the chain, and nothing else tells of the module.
#[test]
fn an_exchange_that_the_chain_does_not_name_yet_is_seen() {
    let shelf = Shelf::new();
    exchanged(&shelf, "functional", ENDED, "passed", |_| {});
    let words = "ended with another module in the socket, so nothing is known of this one";
    let only = format!("functional errored 2026-11-28 14:30: {words}");
    assert_eq!(shelf.standing_at(LATER).to_string(), only);
    fs::remove_file(shelf.path().join("2026-11-28/CHAIN")).expect("a chain");
    shelf.run("functional", "2026-11-28T14:20:05+08:00");
    let standing = shelf.standing_at(LATER);
    let words = format!("functional errored 2026-11-28 14:30: not in the chain, {words}");
    assert_eq!((standing.to_string(), standing.passes()), (words, false));
}

/// Another plan, another module, a simulated bench, and a module that never was in the socket leave the pass.
#[test]
fn an_exchange_speaks_of_its_module_and_plan_alone() {
    let after = |plan: &str, change: &dyn Fn(&mut Value)| {
        let shelf = Shelf::new();
        shelf.run("functional", ENDED);
        exchanged(&shelf, plan, "2026-11-28T14:40:05+08:00", "failed", change);
        let standing = shelf.standing_at(LATER);
        assert!(standing.passes_beyond_doubt(), "{standing}");
        standing.to_string()
    };
    let passed = "functional passed 2026-11-28 14:30";
    let words = "an item failed, then another module was in the socket, so nothing more is known of this one";
    assert_eq!(after("burn-in", &|_| {}), format!("{passed}; then burn-in errored 2026-11-28 14:40: {words}"));
    assert_eq!(after("functional", &|record| record["bench"] = json!({ "kind": "simulated" })), passed);
    assert_eq!(after("functional", &|record| record["serial_number"] = "SN-2".into()), passed);
    // As the station files it if SN-9 was there from the start, and as earlier versions filed both.
    assert_eq!(
        after("functional", &|record| record["other_module"] = json!({ "scanned": "SN-1", "found": "SN-9" })),
        passed
    );
}

/// The events of such a run up to the exchange; `seen` is the last one.
fn journal(run: &Path, serial_number: &str, seen: &Value) -> String {
    let plan = reader::when(run).1.split_once('-').expect("a plan").1.to_owned();
    let header = json!({ "schema": "gnc-events/1", "serial_number": serial_number, "operator": null, "station": "s",
        "program": { "name": "p", "version": "1" }, "bench": { "kind": "real" }, "plan": plan_info(&plan, DIGEST),
        "selection": null, "loop": null });
    let begun = json!({ "seq": 0, "at": LATER, "elapsed_us": 0, "kind": "run_started", "header": header, "items": [] });
    let mut seen = seen.clone();
    for (key, value) in
        [("seq", json!(1)), ("at", json!(LATER)), ("elapsed_us", json!(1)), ("kind", json!("other_module"))]
    {
        seen[key] = value;
    }
    format!("{begun}\n{seen}\n")
}

/// As [`exchanged`], with a journal in the same seal.
fn with_journal(shelf: &Shelf, plan: &str, ended: &str, seen: &Value) -> PathBuf {
    let run = exchanged(shelf, plan, ended, "passed", |record| record["other_module"] = seen.clone());
    for file in [DIGESTS, "../../CHAIN", "../../../COUNTER"] {
        fs::remove_file(run.join(file)).expect("a file");
    }
    fs::write(run.join(JOURNAL), journal(&run, "SN-1", seen)).expect("a journal");
    // The chain begins anew, with the runs of this module first.
    for other in reader::newest_of_module(shelf.path(), "SN-1").collect::<Vec<_>>().into_iter().rev() {
        fs::remove_file(other.join(DIGESTS)).expect("digests");
        close(&other);
    }
    close(&run);
    run
}

fn in_exchange() -> Value {
    json!({ "scanned": "SN-1", "found": "SN-9", "exchanged": true })
}

/// A change to the folder of a run.
type Damage = Box<dyn Fn(&Path)>;

/// The record is changed in any way: the journal still names the module that was scanned.
#[test]
fn no_damage_to_the_record_of_an_exchange_gives_the_pass_back() {
    let other_plan = serde_json::to_value(plan_info("burn-in", DIGEST)).expect("JSON");
    let edits: [(&str, Damage); 8] = [
        ("unreadable", Box::new(|run| fs::write(run.join(RECORD), "{\"outcome\": \"err").expect("a record"))),
        ("missing", Box::new(|run| fs::remove_file(run.join(RECORD)).expect("a record"))),
        ("number", Box::new(|run| edit(run, |record| record["serial_number"] = "SN-2".into()))),
        ("plan", Box::new(move |run| edit(run, |record| record["plan"] = other_plan.clone()))),
        ("bench", Box::new(|run| edit(run, |record| record["bench"] = json!({ "kind": "simulated" })))),
        ("exchanged", Box::new(|run| edit(run, |record| record["other_module"]["exchanged"] = false.into()))),
        ("other module", Box::new(|run| edit(run, |record| record["other_module"] = Value::Null))),
        (
            "journal too",
            Box::new(|run| {
                edit(run, |record| record["other_module"]["exchanged"] = false.into());
                let from_the_start = json!({ "scanned": "SN-1", "found": "SN-9" });
                fs::write(run.join(JOURNAL), journal(run, "SN-1", &from_the_start)).expect("a journal");
            }),
        ),
    ];
    for (what, edit) in &edits {
        for without_digests in [false, true] {
            let shelf = Shelf::new();
            shelf.run("functional", ENDED);
            let run = with_journal(&shelf, "functional", "2026-11-28T14:40:05+08:00", &in_exchange());
            edit(&run);
            if without_digests && *what != "journal too" {
                fs::remove_file(run.join(DIGESTS)).expect("digests");
            }
            let standing = shelf.standing_at(LATER);
            assert!(!standing.passes() && standing.was_run(), "{what}, {without_digests}: {standing}");
            assert!(standing.to_string().starts_with("functional "), "{what}: {standing}");
            let gate = shelf.ask(LATER, PlanAsked::Named("functional"), BenchKind::Real);
            assert!(!gate.passes_beyond_doubt(), "{what}, {without_digests}: {gate}");
        }
    }
}

/// What the journal proves to be of another module, or of a module that never was in the socket, blocks no other module.
/// Neither does a run of which nothing can be read: `records verify` tells of it.
#[test]
fn a_damaged_run_apart_blocks_only_the_module_that_its_journal_names() {
    let damages: [(&str, Value, Damage); 4] = [
        ("from the start", json!({ "scanned": "SN-1", "found": "SN-9" }), Box::new(|_| {})),
        (
            "another one",
            in_exchange(),
            Box::new(|run| {
                fs::write(run.join(JOURNAL), journal(run, "SN-2", &in_exchange())).expect("a journal");
            }),
        ),
        ("no journal", in_exchange(), Box::new(|run| fs::remove_file(run.join(JOURNAL)).expect("a journal"))),
        ("removed", in_exchange(), Box::new(|run| fs::remove_dir_all(run).expect("a run"))),
    ];
    for (what, seen, damage) in &damages {
        let shelf = Shelf::new();
        shelf.run("functional", ENDED);
        let run = with_journal(&shelf, "functional", "2026-11-28T14:40:05+08:00", seen);
        fs::write(run.join(RECORD), "{").expect("a record");
        damage(&run);
        let standing = shelf.standing_at(LATER);
        assert!(standing.passes_beyond_doubt(), "{what}: {standing}");
        let told = chain::verify(shelf.path()).expect("a chain").problems.len() + as_written::verify(&run).len();
        assert!(told > 0, "{what}");
    }
}

/// A failure after the exchange is what an operator must hear, also if its station closed it late or not at all.
#[test]
fn a_failure_after_an_exchange_is_told_first() {
    let failed = |record: &mut Value| record["outcome"] = "failed".into();
    for closed in [true, false] {
        let shelf = Shelf::new();
        shelf.run("functional", ENDED);
        exchanged(&shelf, "functional", "2026-11-28T14:40:05+08:00", "passed", |_| {});
        let run = shelf.open("functional", "2026-11-28T14:50:05+08:00", failed);
        if closed {
            close_as(&run, Some(&LateClose::new(time(LATER), "gnc-station-1.3")));
        }
        shelf.run_with("functional", "2026-11-28T14:52:05+08:00", |record| record["outcome"] = "aborted".into());
        let standing = shelf.standing_at(LATER);
        let kept = if closed { "closed late" } else { "record not closed" };
        assert_eq!(standing.to_string(), format!("functional failed 2026-11-28 14:50: {kept}"));
        assert!(!standing.passes() && standing.was_run());
    }
}

/// A pass after an exchange that its station could not bring into the chain counts, as the time of the folders tells.
#[test]
fn a_pass_after_an_exchange_without_its_line_counts() {
    let shelf = Shelf::new();
    exchanged(&shelf, "functional", ENDED, "passed", |_| {});
    fs::remove_file(shelf.path().join("2026-11-28/CHAIN")).expect("a chain");
    shelf.run("functional", "2026-11-28T14:40:05+08:00");
    let standing = shelf.standing_at(LATER);
    assert_eq!(
        (standing.to_string().as_str(), standing.passes_beyond_doubt()),
        ("functional passed 2026-11-28 14:40", true)
    );
}

/// The chain of an old day with strangers cannot be read. That says nothing of a module that was tested today.
#[test]
fn an_old_day_that_cannot_be_read_leaves_the_standing() {
    let shelf = Shelf::new();
    let stranger = exchanged(&shelf, "functional", "2026-08-01T14:30:05+08:00", "passed", |record| {
        record["serial_number"] = "SN-2".into();
    });
    shelf.run("functional", ENDED);
    let chain = stranger.join("../../CHAIN");
    fs::remove_file(&chain).expect("a chain");
    fs::create_dir(&chain).expect("a folder in place of the chain");
    assert!(shelf.standing_at(LATER).passes_beyond_doubt());
    // Nor where the day is within the time of a pass.
    assert_eq!(shelf.standing_at("2026-08-10T14:30:00+08:00").counts, None);
}

/// The clock was years behind when the module was exchanged after its pass: the chain tells that it came later.
#[test]
fn an_exchange_on_a_day_before_the_pass_is_found_by_the_chain() {
    let shelf = Shelf::new();
    shelf.run("functional", ENDED);
    exchanged(&shelf, "functional", "2000-01-01T08:00:05+08:00", "passed", |_| {});
    assert!(!shelf.standing_at(LATER).passes(), "{}", shelf.standing_at(LATER));
}

/// Runs of other modules take no place from those of this one, and are not opened if they are older than its pass.
#[test]
fn strangers_are_looked_at_only_behind_the_pass() {
    let shelf = Shelf::new();
    let stranger = |ended: &str| {
        exchanged(&shelf, "functional", ended, "passed", |record| record["serial_number"] = "SN-2".into())
    };
    stranger("2026-08-01T14:30:05+08:00");
    let before = stranger("2026-11-28T14:10:05+08:00");
    let pass = shelf.run("functional", ENDED);
    let clock_back = stranger("2026-11-27T14:30:05+08:00");
    let after = stranger("2026-11-28T14:35:05+08:00");
    let not_closed = stranger("2026-11-28T14:40:05+08:00");
    fs::remove_dir_all(&not_closed).expect("a run");
    fs::create_dir_all(not_closed.with_file_name("144100-functional")).expect("a run");
    let plan = PlanAsked::Named("functional");
    let question = Question { serial_number: "SN-1", plan, valid_days: 30, bench: BenchKind::Real, now: time(LATER) };
    let places = |counted: Option<(u64, &Path)>| {
        crate::standing::apart::places(shelf.path(), &question, counted).expect("records")
    };
    let new = (None, not_closed.with_file_name("144100-functional"));
    assert_eq!(places(Some((3, &pass))), [new.clone(), (Some(5), after.clone()), (Some(4), clock_back.clone())]);
    // Nothing counts: those of the days whose passes could count.
    assert_eq!(places(None), [new, (Some(5), after), (Some(2), before), (Some(4), clock_back)]);
}
