//! The standing of a module, from folders as the station leaves them and as accidents and people change them.

use std::fs;
use std::fs::File;
use std::path::{Path, PathBuf};

use chrono::{DateTime, FixedOffset, TimeDelta};
use gnc_executive::event::{BenchKind, PlanInfo};
use gnc_executive::standing::PlanAsked;
use serde_json::{Value, json};

mod apart;
mod hidden;
mod holes;
mod signed;
mod unreadable;

use super::*;
use crate::store::chain::LateClose;
use crate::store::digest::FileDigests;
use crate::store::{DIGESTS, JOURNAL, RECORD, chain};

const DIGEST: &str = "aa";

fn time(text: &str) -> DateTime<FixedOffset> {
    text.parse().expect("a time")
}

fn plan_info(name: &str, sha256: &str) -> PlanInfo {
    PlanInfo { name: name.to_owned(), version: "1.0".to_owned(), sha256: sha256.to_owned() }
}

/// A records folder.
struct Shelf {
    folder: tempfile::TempDir,
}

impl Shelf {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a folder") }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    /// A run of SN-1 by the plan that ended at a time and passed on a real bench, but for what `change` makes of its
    /// record. It is not closed.
    fn open(&self, plan: &str, ended: &str, change: impl Fn(&mut Value)) -> PathBuf {
        let ended = time(ended);
        let started = ended - TimeDelta::seconds(5);
        let mut record = json!({
            "schema": "gnc-run/1",
            "outcome": "passed",
            "interrupted": false,
            "serial_number": "SN-1",
            "plan": plan_info(plan, DIGEST),
            "bench": { "kind": "real" },
            "selection": null,
            "started": started.to_rfc3339(),
            "finished": ended.to_rfc3339(),
            "items": [{ "name": "cpu", "outcome": "passed" }],
        });
        change(&mut record);
        // A file system that ignores the case of letters has one folder for SN-1 and sn-1.
        let name = format!("{}-{plan}", started.format("%H%M%S"));
        let run = self.path().join(started.format("%Y-%m-%d").to_string()).join("SN-1").join(name);
        fs::create_dir_all(&run).expect("a folder");
        fs::write(run.join(RECORD), serde_json::to_vec_pretty(&record).expect("JSON")).expect("a file");
        run
    }

    fn run_with(&self, plan: &str, ended: &str, change: impl Fn(&mut Value)) -> PathBuf {
        let run = self.open(plan, ended, change);
        close(&run);
        run
    }

    fn run(&self, plan: &str, ended: &str) -> PathBuf {
        self.run_with(plan, ended, |_| {})
    }

    fn standing_at(&self, now: &str) -> Standing {
        let plan = plan_info("functional", DIGEST);
        self.ask(now, PlanAsked::This(&plan), BenchKind::Real)
    }

    fn ask(&self, now: &str, plan: PlanAsked<'_>, bench: BenchKind) -> Standing {
        let question = Question { serial_number: "SN-1", plan, valid_days: 30, bench, now: time(now) };
        read(self.path(), &question, &[]).expect("records")
    }
}

/// Digests, then the chain.
fn close(run: &Path) {
    close_as(run, None);
}

fn close_as(run: &Path, late: Option<&LateClose>) {
    let mut sums = FileDigests::default();
    sums.add_new(run).expect("files");
    fs::write(run.join(DIGESTS), sums.text()).expect("digests");
    let by = chain::Scribe { station: "bench 1", at: time(ENDED), key: None, late };
    chain::append_as(run, &by).expect("a chain");
}

const ENDED: &str = "2026-11-28T14:30:05+08:00";
const LATER: &str = "2026-11-28T15:00:00+08:00";

/// What a run is called that has one flaw, and that it does not pass the module.
#[track_caller]
fn check(change: impl Fn(&mut Value), spoil: impl Fn(&Path, &Path), words: &str) {
    let shelf = Shelf::new();
    let run = shelf.run_with("functional", ENDED, change);
    spoil(shelf.path(), &run);
    let standing = shelf.standing_at(LATER);
    assert_eq!(standing.to_string(), words);
    assert!(!standing.passes() && standing.counts.is_none(), "{standing:?}");
}

fn nothing(_: &Path, _: &Path) {}

/// A list shows what the journal says, so a word that is changed there counts like one in the record.
#[test]
fn a_journal_that_was_edited_or_added_is_a_change() {
    let shelf = Shelf::new();
    let run = shelf.open("functional", ENDED, |_| {});
    fs::write(run.join(JOURNAL), "failed\n").expect("a journal");
    close(&run);
    let seal = || Seals::new(shelf.path()).seal(&run).expect("a chain");
    assert_eq!(seal(), Seal::Chained);
    fs::write(run.join(JOURNAL), "passed\n").expect("a journal");
    assert_eq!(seal(), Seal::Flawed(Flaw::Changed));
    fs::write(run.join(JOURNAL), "failed\n").expect("a journal");
    assert_eq!(seal(), Seal::Chained);
    let other = shelf.run("functional", "2026-11-28T14:40:05+08:00");
    fs::write(other.join(JOURNAL), "passed\n").expect("a journal");
    assert_eq!(Seals::new(shelf.path()).seal(&other).expect("a chain"), Seal::Flawed(Flaw::Changed));
}

#[test]
fn a_whole_run_on_a_real_bench_counts() {
    let shelf = Shelf::new();
    assert_eq!(shelf.standing_at(LATER).to_string(), "never tested");
    shelf.run("functional", ENDED);
    let standing = shelf.standing_at(LATER);
    assert!(standing.passes());
    assert_eq!(standing.to_string(), "functional passed 2026-11-28 14:30");
}

#[test]
fn what_its_record_says_of_a_run_is_called_what_it_is() {
    let set = |key: &'static str, value: Value| move |record: &mut Value| record[key] = value.clone();
    check(set("bench", json!({ "kind": "simulated" })), nothing, "functional passed 2026-11-28 14:30: simulated");
    let unproven = json!({ "kind": "unproven", "unproven": "port /tmp/board is a pseudo-terminal" });
    check(set("bench", unproven), nothing, "functional passed 2026-11-28 14:30: unproven");
    let earlier = json!({ "run": "120000-functional", "journal_sha256": "00" });
    let rejudged = "functional passed 2026-11-28 14:30: re-judged by other limits";
    check(set("recomputed", earlier), nothing, rejudged);
    let other = "functional passed 2026-11-28 14:30: by another version of the plan";
    check(set("plan", serde_json::to_value(plan_info("functional", "bb")).expect("JSON")), nothing, other);
    check(set("outcome", json!("errored")), nothing, "functional errored 2026-11-28 14:30");
    let broken_off = |record: &mut Value| {
        (record["interrupted"], record["outcome"], record["finished"]) = (true.into(), "aborted".into(), Value::Null);
    };
    check(broken_off, nothing, "functional 2026-11-28 14:30: interrupted");
    // As this version files a selection, and as earlier versions did.
    let selected = |record: &mut Value| {
        (record["selection"], record["outcome"]) = (json!(["identity"]), Value::Null);
        record["selection_outcome"] = "passed".into();
    };
    check(selected, nothing, "only identity passed 2026-11-28 14:30");
    check(set("selection", json!(["identity"])), nothing, "only identity passed 2026-11-28 14:30");
    let items = json!(["a", "b", "c", "d"]);
    check(set("selection", items), nothing, "only 4 items passed 2026-11-28 14:30");
    check(set("serial_number", json!("sn-1")), nothing, "never tested");
}

#[test]
fn how_its_record_is_kept_is_told() {
    let passed = "functional passed 2026-11-28 14:30";
    let same = |_: &mut Value| {};
    check(same, |_, run| fs::remove_file(run.join(DIGESTS)).expect("digests"), &format!("{passed}: record not closed"));
    let no_chain = |records: &Path, _: &Path| fs::remove_file(records.join("2026-11-28/CHAIN")).expect("a chain");
    check(same, no_chain, &format!("{passed}: not in the chain"));
    // The record alone, with its digests made anew, and the line of the chain besides.
    let forge = |run: &Path| {
        let text = fs::read_to_string(run.join(RECORD)).expect("a record").replace("\"cpu\"", "\"cpo\"");
        fs::write(run.join(RECORD), text).expect("a record");
    };
    let seal = |run: &Path| {
        fs::remove_file(run.join(DIGESTS)).expect("digests");
        let mut sums = FileDigests::default();
        sums.add_new(run).expect("files");
        fs::write(run.join(DIGESTS), sums.text()).expect("digests");
    };
    let changed = format!("{passed}: record was changed");
    check(same, |_, run| forge(run), &changed);
    let resealed = |_: &Path, run: &Path| {
        forge(run);
        seal(run);
    };
    check(same, resealed, &changed);
    let chained = |records: &Path, run: &Path| {
        let digest = |run: &Path| crate::store::digest::of_file(&run.join(DIGESTS)).expect("digests");
        let before = digest(run);
        forge(run);
        seal(run);
        let path = records.join("2026-11-28/CHAIN");
        let text = fs::read_to_string(&path).expect("a chain").replace(&before, &digest(run));
        fs::write(path, text).expect("a chain");
    };
    check(same, chained, &changed);
    // Raw samples are not compared: they are large, and `records verify` does that.
    let shelf = Shelf::new();
    let run = shelf.open("functional", ENDED, |_| {});
    fs::write(run.join("attempt-1.mcap"), "samples").expect("a file");
    close(&run);
    fs::write(run.join("attempt-1.mcap"), "other samples").expect("a file");
    assert!(shelf.standing_at(LATER).passes());
}

/// Closed late is no pass, like a record that is not in the chain. A change is told before that.
#[test]
fn a_run_that_was_closed_late_is_no_pass() {
    let shelf = Shelf::new();
    shelf.run("functional", "2026-11-28T14:00:05+08:00");
    let late = |ended: &str, outcome: &str| {
        let run = shelf.open("functional", ended, |record| record["outcome"] = outcome.into());
        close_as(&run, Some(&LateClose::new(time(LATER), "gnc-station-1.3")));
        run
    };
    let run = late(ENDED, "failed");
    let standing = shelf.standing_at(LATER);
    let words = "functional passed 2026-11-28 14:00; then functional failed 2026-11-28 14:30: closed late";
    assert_eq!((standing.to_string().as_str(), standing.passes_beyond_doubt()), (words, false));
    // A newer run of another plan does not hide it.
    shelf.run_with("burn-in", "2026-11-28T14:35:05+08:00", |record| record["outcome"] = "aborted".into());
    let standing = shelf.standing_at(LATER);
    assert_eq!((standing.to_string().as_str(), standing.passes_beyond_doubt()), (words, false));
    fs::remove_dir_all(run).expect("a run");
    fs::remove_dir_all(shelf.path().join("2026-11-28/SN-1/140000-functional")).expect("a run");
    let run = late("2026-11-28T14:40:05+08:00", "passed");
    let standing = shelf.standing_at(LATER);
    assert_eq!(
        (standing.to_string().as_str(), standing.passes()),
        ("functional passed 2026-11-28 14:40: closed late", false)
    );
    fs::write(run.join(RECORD), fs::read_to_string(run.join(RECORD)).expect("a record") + "\n").expect("a record");
    assert_eq!(shelf.standing_at(LATER).to_string(), "functional passed 2026-11-28 14:40: record was changed");
}

/// A folder without an event says nothing against a module; one that the chain names and that was emptied does.
#[test]
fn a_run_that_was_never_begun_is_no_doubt() {
    let shelf = Shelf::new();
    shelf.run("functional", ENDED);
    let begun = shelf.path().join("2026-11-28/SN-1/144000-functional");
    fs::create_dir_all(begun.join("plan")).expect("a folder");
    fs::write(begun.join("plan/01-functional.toml"), "name").expect("a plan");
    fs::write(begun.join(JOURNAL), "{\"seq\":0,\"at\":\"20").expect("a journal");
    let standing = shelf.standing_at(LATER);
    assert_eq!(
        (standing.to_string().as_str(), standing.passes_beyond_doubt()),
        ("functional passed 2026-11-28 14:30", true)
    );
    let failed =
        shelf.run_with("functional", "2026-11-28T14:50:00+08:00", |record| record["outcome"] = "failed".into());
    for file in [RECORD, DIGESTS] {
        fs::remove_file(failed.join(file)).expect("a file");
    }
    assert!(!shelf.standing_at(LATER).passes_beyond_doubt(), "{}", shelf.standing_at(LATER));
}

/// A list reads the chain of a day once, and a run is closed while it goes on.
#[test]
fn a_run_that_is_closed_during_a_list_is_in_the_chain() {
    let shelf = Shelf::new();
    let mut seals = Seals::new(shelf.path());
    let first = shelf.run("functional", ENDED);
    assert_eq!(seals.seal(&first).expect("a chain"), Seal::Chained);
    let second = shelf.run("functional", "2026-11-28T14:40:00+08:00");
    assert_eq!(seals.seal(&second).expect("a chain"), Seal::Chained);
    // Its digests are there, its line is not yet, and its station holds the folder.
    let third = shelf.open("functional", "2026-11-28T14:50:00+08:00", |_| {});
    fs::write(third.join(DIGESTS), "").expect("digests");
    let folder = File::open(&third).expect("a folder");
    folder.try_lock().expect("a lock");
    assert_eq!(seals.seal(&third).expect("a chain"), Seal::Flawed(Flaw::UnderWay));
    drop(folder);
    assert_eq!(seals.seal(&third).expect("a chain"), Seal::Flawed(Flaw::NotInChain));
}

/// A damaged record is told, with what its journal still says, or its folder.
#[test]
fn a_damaged_record_is_no_run_that_never_was() {
    let damage = |_: &Path, run: &Path| fs::write(run.join(RECORD), "{\"outcome\": \"pas").expect("a record");
    check(|_| {}, damage, "functional 2026-11-28 14:30: record unreadable");
    let header = |serial_number: &str| {
        let (bench, plan) = (json!({ "kind": "real" }), plan_info("functional", DIGEST));
        let header = json!({ "schema": "gnc-events/1", "serial_number": serial_number, "operator": null, "station": "s",
            "program": { "name": "p", "version": "1" }, "bench": bench, "plan": plan, "selection": null, "loop": null });
        let event =
            json!({ "seq": 0, "at": ENDED, "elapsed_us": 0, "kind": "run_started", "header": header, "items": [] });
        format!("{event}\n{{\"seq\":1,")
    };
    let told = |serial_number: &'static str| {
        move |records: &Path, run: &Path| {
            damage(records, run);
            fs::write(run.join(JOURNAL), header(serial_number)).expect("a journal");
        }
    };
    check(|_| {}, told("SN-1"), "functional 2026-11-28 14:30: record was changed");
    // The chain names the folder, which is this module's.
    check(|_| {}, told("SN-2"), "functional 2026-11-28 14:30: record was changed");
}

/// A run counts for a time and not for a day: seconds after midnight it still does.
#[test]
fn a_pass_counts_as_long_as_the_plan_says() {
    let at = |ended: &str, now: &str| {
        let shelf = Shelf::new();
        shelf.run("functional", ended);
        shelf.standing_at(now)
    };
    assert!(at("2026-11-28T23:59:55+08:00", "2026-11-29T00:00:02+08:00").passes());
    // The same moment in another place.
    assert!(at("2026-11-28T23:59:55+08:00", "2026-11-28T15:59:57+00:00").passes());
    assert!(at(ENDED, "2026-12-28T14:30:05+08:00").passes(), "30 days to the second");
    let old = at(ENDED, "2026-12-28T14:30:06+08:00");
    assert_eq!((old.passes(), old.to_string().as_str()), (false, "functional passed 2026-11-28 14:30: too long ago"));
    // A clock that was set back a little, and one that lost its battery.
    assert!(at(ENDED, "2026-11-28T14:25:00+08:00").passes());
    for now in ["2026-11-28T14:15:00+08:00", "2000-01-01T00:00:00+00:00"] {
        let future = at(ENDED, now);
        let words = "functional passed 2026-11-28 14:30: later than this computer's clock";
        assert_eq!((future.passes(), future.to_string().as_str()), (false, words));
    }
}

/// The newest run is the one that was closed last, not the one with the latest date.
#[test]
fn the_chain_tells_which_run_is_the_newest() {
    let shelf = Shelf::new();
    shelf.run("functional", "2026-11-28T14:30:05+08:00");
    shelf.run_with("functional", "2026-11-28T14:25:05+08:00", |record| record["outcome"] = "failed".into());
    let standing = shelf.standing_at("2026-11-28T14:40:00+08:00");
    assert!(!standing.passes());
    assert!(standing.to_string().starts_with("functional failed 2026-11-28 14:25"), "{standing}");
}

/// The clock is set back after a pass, by an hour or by years, and the module fails: that came later, whatever the folders
/// say. Where the failed run came first, and the clock was ahead then, nothing speaks against the pass.
#[test]
fn the_chain_tells_what_came_after_a_pass() {
    let chosen = |record: &mut Value| {
        (record["selection"], record["outcome"]) = (json!(["cpu"]), Value::Null);
        record["selection_outcome"] = "failed".into();
    };
    for failed in ["2026-11-28T13:30:05+08:00", "2026-11-27T13:30:05+08:00", "2000-01-01T08:00:05+08:00"] {
        let shelf = Shelf::new();
        shelf.run("functional", ENDED);
        shelf.run_with("functional", failed, chosen);
        let standing = shelf.standing_at(LATER);
        let words =
            format!("functional passed 2026-11-28 14:30; then only cpu failed {}", failed[..16].replace('T', " "));
        assert!(standing.to_string().starts_with(&words), "{standing}");
        assert!(!standing.passes_beyond_doubt());
    }
    let shelf = Shelf::new();
    shelf.run_with("functional", "2026-11-28T14:50:05+08:00", chosen);
    shelf.run("functional", ENDED);
    let standing = shelf.standing_at(LATER);
    assert_eq!(
        (standing.to_string().as_str(), standing.passes_beyond_doubt()),
        ("functional passed 2026-11-28 14:30", true)
    );
    // What the chain does not name has the place of its folder.
    shelf.open("functional", "2026-11-28T14:45:05+08:00", |record| record["outcome"] = "failed".into());
    assert!(
        shelf.standing_at(LATER).to_string().contains("; then functional failed 2026-11-28 14:45: record not closed")
    );
}

/// What comes after a pass and is no pass is told beside it; what says nothing against it is not.
#[test]
fn a_doubt_after_a_pass_is_told() {
    let shelf = Shelf::new();
    shelf.run("functional", ENDED);
    let selected = |outcome: &'static str| {
        move |record: &mut Value| {
            (record["selection"], record["outcome"]) = (json!(["cpu"]), Value::Null);
            record["selection_outcome"] = outcome.into();
        }
    };
    shelf.run_with("functional", "2026-11-28T14:40:00+08:00", selected("passed"));
    let simulated = |record: &mut Value| {
        (record["bench"]["kind"], record["outcome"]) = ("simulated".into(), "failed".into());
    };
    shelf.run_with("functional", "2026-11-28T14:41:00+08:00", simulated);
    let unproven = |record: &mut Value| {
        (record["bench"]["kind"], record["outcome"]) = ("unproven".into(), "failed".into());
    };
    shelf.run_with("functional", "2026-11-28T14:41:30+08:00", unproven);
    assert_eq!(shelf.standing_at(LATER).to_string(), "functional passed 2026-11-28 14:30");
    shelf.run_with("functional", "2026-11-28T14:42:00+08:00", selected("failed"));
    let doubted = shelf.standing_at(LATER);
    let words = "functional passed 2026-11-28 14:30; then only cpu failed 2026-11-28 14:42";
    assert_eq!((doubted.passes(), doubted.to_string().as_str()), (true, words));
    // The folder of the run that failed after that was removed.
    let failed =
        shelf.run_with("functional", "2026-11-28T14:43:00+08:00", |record| record["outcome"] = "failed".into());
    assert_eq!(
        shelf.standing_at(LATER).to_string(),
        "functional failed 2026-11-28 14:43",
        "a run that fails is the standing"
    );
    fs::remove_dir_all(failed).expect("a run");
    fs::remove_dir_all(shelf.path().join("2026-11-28/SN-1/144155-functional")).expect("a run");
    let missing = shelf.standing_at(LATER);
    let words = "functional passed 2026-11-28 14:30; then functional 2026-11-28 14:42: record is missing";
    assert_eq!(missing.to_string(), words);
}

#[test]
fn another_plan_is_named_and_this_one_never_was() {
    let shelf = Shelf::new();
    shelf.run("incoming", ENDED);
    assert_eq!(shelf.standing_at(LATER).to_string(), "incoming passed 2026-11-28 14:30; functional never");
    assert!(shelf.ask(LATER, PlanAsked::Named("incoming"), BenchKind::Real).passes());
    // A plan whose name only begins alike is another one.
    shelf.run("functional-short", "2026-11-28T14:40:00+08:00");
    let told = shelf.standing_at(LATER).to_string();
    assert_eq!(told, "functional-short passed 2026-11-28 14:40; functional never");
    // This plan once, too long ago: it is not "never".
    let old = Shelf::new();
    old.run("functional", "2026-09-01T08:00:00+08:00");
    old.run("incoming", ENDED);
    assert_eq!(old.standing_at(LATER).to_string(), "functional passed 2026-09-01 08:00: too long ago");
}

/// A simulated station takes its own runs for what they are there, and a real one takes none of them.
#[test]
fn simulated_runs_count_on_a_simulated_bench_alone() {
    let shelf = Shelf::new();
    shelf.run_with("functional", ENDED, |record| record["bench"]["kind"] = "simulated".into());
    let plan = plan_info("functional", DIGEST);
    let simulated = shelf.ask(LATER, PlanAsked::This(&plan), BenchKind::Simulated);
    let words = "functional passed 2026-11-28 14:30, simulated";
    assert_eq!((simulated.passes(), simulated.to_string().as_str()), (true, words));
    assert!(!shelf.standing_at(LATER).passes());
}

/// A bench that does not prove its board says nothing of a module on any bench, its own included.
#[test]
fn unproven_runs_count_on_no_bench() {
    let shelf = Shelf::new();
    shelf.run_with("functional", ENDED, |record| record["bench"]["kind"] = "unproven".into());
    let plan = plan_info("functional", DIGEST);
    for bench in [BenchKind::Real, BenchKind::Unproven, BenchKind::Simulated] {
        for asked in [PlanAsked::This(&plan), PlanAsked::Named("functional")] {
            let standing = shelf.ask(LATER, asked, bench);
            assert!(standing.counts.is_none() && !standing.passes_beyond_doubt(), "{bench:?}: {standing:?}");
            assert_eq!(standing.to_string(), "functional passed 2026-11-28 14:30: unproven", "{bench:?}");
        }
    }
    // A real pass is one for an unproven bench, which may only not add to it.
    shelf.run("functional", "2026-11-28T14:40:00+08:00");
    assert!(shelf.ask(LATER, PlanAsked::This(&plan), BenchKind::Unproven).passes());
}
