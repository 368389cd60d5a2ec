//! Power cuts at every point between the end of a run and its line in the chain, and what must never be closed late.

mod named;

use std::fs;

use chrono::{DateTime, FixedOffset};
use gnc_executive::event::{BenchKind, ProgramVersion};
use gnc_executive::outcome::Outcome;
use gnc_executive::standing::{Flaw, Seal};
use serde_json::json;
use sha2::Digest as _;

use super::*;
use crate::shift::{ShiftBook, ShiftOf};
use crate::standing::Seals;
use crate::store::as_written;
use crate::store::chain::{CHAIN, COUNTER, LateCloses};
use crate::store::recovery::tests::{PLAN_TEXT, close_as, plan_sha256};
use crate::store::{JOURNAL, LOG, PLAN, SIGNATURE};

const DAY: &str = "2026-11-28";
const STATION: &str = "bench 1";
const SEALED: &str = "2026-11-28T16:00:00+08:00";

fn time(text: &str) -> DateTime<FixedOffset> {
    text.parse().unwrap()
}

/// The journal of a whole run of no items that passed.
fn journal(serial_number: &str, station: &str, time: &str) -> String {
    let at = format!("{DAY}T{time}+08:00");
    let header = json!({
        "schema": "gnc-events/1", "serial_number": serial_number, "operator": null, "station": station,
        "program": { "name": "gnc-station", "version": "1.2" }, "bench": { "kind": "real" }, "selection": null, "loop": null,
        "plan": { "name": "functional", "version": "1.0", "sha256": plan_sha256() },
    });
    let begun = json!({ "seq": 0, "at": at, "elapsed_us": 0, "kind": "run_started", "header": header, "items": [] });
    let ended = json!({ "seq": 1, "at": at, "elapsed_us": 5, "kind": "run_ended", "outcome": "passed" });
    format!("{begun}\n{ended}\n")
}

struct Shelf {
    folder: tempfile::TempDir,
}

impl Shelf {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    /// A run that began by the chain, has its end and was not closed.
    fn ended(&self, serial_number: &str, station: &str, time: &str) -> PathBuf {
        let name = format!("{DAY}/{serial_number}/{}-functional", time.replace(':', ""));
        let run = self.path().join(name);
        fs::create_dir_all(run.join(PLAN)).unwrap();
        fs::write(run.join(PLAN).join("01-functional.toml"), PLAN_TEXT).unwrap();
        fs::write(run.join(JOURNAL), journal(serial_number, station, time)).unwrap();
        chain::begin(&run, &Scribe { station, at: self::time(SEALED), key: None, late: None }).unwrap();
        run
    }

    fn closed(&self, serial_number: &str, time: &str) -> PathBuf {
        let run = self.ended(serial_number, STATION, time);
        close_now(&run);
        run
    }

    fn start(&self) -> Vec<String> {
        start_of(self.path(), STATION)
    }

    fn late(&self) -> (usize, Vec<String>) {
        let checked = chain::verify(self.path()).unwrap();
        (checked.late, checked.problems)
    }

    fn seal(&self, run: &Path) -> Seal {
        Seals::new(self.path()).seal(run).unwrap()
    }
}

/// As the station that carried the run out closes it.
fn close_now(run: &Path) {
    let by = Scribe { station: STATION, at: time(SEALED), key: None, late: None };
    let began = chain::begin(run, &by).unwrap();
    close_as(run, &by, None, Some(&began)).unwrap();
}

fn start_of(records: &Path, station: &str) -> Vec<String> {
    let program = ProgramVersion { name: "gnc station".to_owned(), version: "1.3".to_owned(), build: None };
    crate::store::seal_interrupted(
        records,
        &Sealer { station, program: &program, at: time(SEALED), kind: BenchKind::Real, key: None },
    )
}

/// The content of a file, or nothing.
fn keep(file: PathBuf) -> impl Fn() {
    let content = fs::read(&file).ok();
    move || match &content {
        Some(content) => fs::write(&file, content).unwrap(),
        None => drop(fs::remove_file(&file)),
    }
}

/// A run is closed, in an empty folder or behind another run; then `undo` makes of it what a power cut leaves. The next
/// start closes it late, and it stays so.
#[track_caller]
fn check(name: &str, undo: impl Fn(&Path, &Path, &[u8])) {
    for others in [0, 1, 2] {
        let shelf = Shelf::new();
        for other in 0..others {
            shelf.closed("SN-0", &format!("10:00:0{other}"));
        }
        let [chain, counter] = [shelf.path().join(DAY).join(CHAIN), shelf.path().join(COUNTER)];
        let run = shelf.ended("SN-1", STATION, "14:30:00");
        let (chain_before, counter_before) = (keep(chain.clone()), keep(counter));
        let length = fs::read(&chain).unwrap().len();
        close_now(&run);
        let line = fs::read(&chain).unwrap()[length..].to_vec();
        chain_before();
        counter_before();
        undo(&run, &chain, &line);
        assert_ne!(shelf.seal(&run), Seal::Chained, "{name}");

        let is_torn = fs::read(&chain).is_ok_and(|text| text.last().is_some_and(|last| *last != b'\n'));
        // What an earlier version left had its name already.
        let early = [LOG, RECORD, crate::report::REPORT].iter().any(|name| run.join(name).exists());
        let early = early && !run.join(DIGESTS).exists();
        // A chain with a counter behind it, and half a line, are mended first.
        let (mended, mut said): (Vec<_>, Vec<_>) =
            shelf.start().into_iter().partition(|line| line.starts_with("COUNTER ") || line.contains("half a line"));
        assert_eq!(
            said.pop_if(|line| line.contains("makes only when it closes a run")).is_some(),
            early,
            "{name}: {said:?}"
        );
        let torn = mended.iter().filter(|line| line.contains("half a line")).count();
        assert_eq!(torn, usize::from(is_torn), "{name}: {mended:?}");
        assert!(
            said.len() == 1 && said[0].contains("SN-1/143000-functional ended at 2026-11-28 14:30:00"),
            "{name}: {said:?}"
        );
        assert!(said[0].contains("closed late now and never counts as a pass; test SN-1 again"), "{name}: {said:?}");
        let holds = || {
            assert_eq!(as_written::verify(&run), Vec::<String>::new(), "{name}");
            assert_eq!(shelf.late(), (1, Vec::new()), "{name}");
            assert_eq!(shelf.seal(&run), Seal::Flawed(Flaw::ClosedLate), "{name}");
            assert_eq!(chain::standing(&run).unwrap(), chain::ChainStanding::Late, "{name}");
            let late = LateCloses::default().of(&run).unwrap().expect("a mark");
            assert_eq!((late.at.as_str(), late.by.as_str()), (SEALED, "gnc_station-1.3"), "{name}");
        };
        holds();
        // A second start changes nothing, and neither do the next runs.
        assert_eq!(shelf.start(), Vec::<String>::new(), "{name}");
        let next = shelf.closed("SN-2", "15:00:00");
        holds();
        assert_eq!(shelf.seal(&next), Seal::Chained, "{name}");
        assert_eq!(chain::verify(shelf.path()).unwrap().runs, others + 2, "{name}");
    }
}

fn without(run: &Path, files: &[&str]) {
    files.iter().for_each(|file| fs::remove_file(run.join(file)).unwrap());
}

#[test]
fn a_power_cut_before_the_digests_closes_the_run_late() {
    let made = [LOG, RECORD, crate::report::REPORT, DIGESTS];
    for count in 0..made.len() {
        check(&format!("{count} files made"), |run, _, _| without(run, &made[count..]));
    }
    for (name, content) in [("half", &b"{\"schema\": \"gnc-r"[..]), ("empty", b""), ("zeros", &[0; 700])] {
        check(&format!("{name} of run.json"), |run, _, _| {
            without(run, &made[2..]);
            fs::write(run.join(RECORD), content).unwrap();
        });
    }
    check("part files", |run, _, _| {
        without(run, &made[3..]);
        fs::write(run.join("SHA256SUMS.part"), "abc").unwrap();
        fs::write(run.join(SIGNATURE), "of other digests").unwrap();
    });
}

#[test]
fn a_power_cut_within_the_line_of_the_chain_closes_the_run_late() {
    check("no line", |_, _, _| {});
    let length = {
        let shelf = Shelf::new();
        shelf.closed("SN-1", "14:30:00");
        fs::read_to_string(shelf.path().join(DAY).join(CHAIN)).unwrap().lines().last().unwrap().len() + 1
    };
    // Half a name of a run looks like a whole one.
    for bytes in [1, 3, 100, length - 30, length - 10, length - 2] {
        check(&format!("{bytes} bytes of the line"), |_, chain, line| {
            let before = fs::read(chain).unwrap_or_default();
            fs::write(chain, [&before, &line[..bytes]].concat()).unwrap();
        });
    }
    check("zeros", |_, chain, _| {
        let before = fs::read(chain).unwrap_or_default();
        fs::write(chain, [&before[..], &[0; 200], &[0xff; 3]].concat()).unwrap();
    });
}

/// The line is on disk and the counter is not: the run is closed as it should be.
#[test]
fn a_whole_line_without_its_count_is_not_late() {
    let shelf = Shelf::new();
    shelf.closed("SN-0", "10:00:00");
    let counter_before = keep(shelf.path().join(COUNTER));
    let run = shelf.closed("SN-1", "14:30:00");
    counter_before();
    let mended = "COUNTER stood at line 2 and the chain ends at line 4, as a sudden end leaves it; it is mended";
    assert_eq!((shelf.start(), shelf.late()), (vec![mended.to_owned()], (0, Vec::new())));
    assert_eq!((shelf.start(), shelf.seal(&run)), (Vec::new(), Seal::Chained));
}

#[test]
fn a_run_that_no_power_cut_of_this_station_left_is_not_closed_late() {
    let not_said = |name: &str, words: Option<&str>, spoil: &dyn Fn(&Shelf) -> PathBuf| {
        let shelf = Shelf::new();
        shelf.closed("SN-0", "10:00:00");
        shelf.closed("SN-0", "10:00:01");
        let run = spoil(&shelf);
        // Lines that are gone are named.
        let said: Vec<String> = shelf.start().into_iter().filter(|line| !line.contains("lines are missing")).collect();
        assert_eq!(said.len(), usize::from(words.is_some()), "{name}: {said:?}");
        assert!(said.iter().zip(words).all(|(line, words)| line.contains(words)), "{name}: {said:?}");
        assert_eq!(chain::verify(shelf.path()).unwrap().late, 0, "{name}");
        assert_ne!(shelf.seal(&run), Seal::Chained, "{name}");
    };
    let not = |name: &str, spoil: &dyn Fn(&Shelf) -> PathBuf| not_said(name, None, spoil);
    let of_other = Some("was begun as station bench 2 and is not closed");
    not_said("another station's", of_other, &|shelf| shelf.ended("SN-1", "bench 2", "14:30:00"));
    not("named by the chain, without digests", &|shelf| {
        let run = shelf.closed("SN-1", "14:30:00");
        without(&run, &[DIGESTS]);
        run
    });
    let contradicts = Some("is left as it is because its run.json says something else than its journal");
    not_said("a record that says something else", contradicts, &|shelf| {
        let run = shelf.ended("SN-1", STATION, "14:30:00");
        let mut record = RunRecord::from_state(&reader::fold(&run).unwrap()).unwrap();
        record.operator = Some("somebody".to_owned());
        fs::write(run.join(RECORD), serde_json::to_vec(&record).unwrap()).unwrap();
        run
    });
    let changed = Some("is left as it is because it is not as it was sealed: log.txt ");
    not_said("changed behind its digests", changed, &|shelf| {
        let run = shelf.ended("SN-1", STATION, "14:30:00");
        let chain_before = keep(shelf.path().join(DAY).join(CHAIN));
        let counter_before = keep(shelf.path().join(COUNTER));
        close_now(&run);
        chain_before();
        counter_before();
        fs::write(run.join(LOG), "all is well").unwrap();
        run
    });
    not("a chain that lost its lines", &|shelf| {
        fs::remove_file(shelf.path().join(DAY).join(CHAIN)).unwrap();
        shelf.path().join(DAY).join("SN-0/100000-functional")
    });
    not_said("a chain that was lost as a whole", Some("2 runs are closed and"), &|shelf| {
        fs::remove_file(shelf.path().join(DAY).join(CHAIN)).unwrap();
        fs::remove_file(shelf.path().join(COUNTER)).unwrap();
        shelf.path().join(DAY).join("SN-0/100000-functional")
    });
    // An interrupted run gets its line first, and that line hides no loss.
    not("a chain that lost its lines, and an interrupted run", &|shelf| {
        let run = shelf.closed("SN-1", "14:30:00");
        fs::remove_file(shelf.path().join(DAY).join(CHAIN)).unwrap();
        let cut = shelf.ended("SN-2", STATION, "15:00:00");
        let text = journal("SN-2", STATION, "15:00:00");
        fs::write(cut.join(JOURNAL), text.split_inclusive('\n').next().unwrap()).unwrap();
        let is_known = |line: &String| line.contains("was interrupted") || line.contains("lines are missing");
        assert!(shelf.start().iter().all(is_known));
        // The line of the next run hides it neither.
        assert!(shelf.start().is_empty());
        run
    });
    not("from before the chain", &|shelf| {
        let run = shelf.ended("SN-1", STATION, "14:30:00");
        let to = shelf.path().join("2026-11-27/SN-1/143000-functional");
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::rename(run, &to).unwrap();
        to
    });
}

/// No sudden end leaves digests without any chain and counter: the first line comes before the first test. So a version before
/// the chain closed the run, whose papers stay as they are.
#[test]
fn closed_runs_without_any_chain_stay_as_they_are() {
    for (count, words) in [(1, "SN-1/143000-functional is closed and"), (2, "2 runs are closed and")] {
        let shelf = Shelf::new();
        let runs: Vec<_> = (0..count).map(|run| shelf.closed("SN-1", &format!("14:30:0{run}"))).collect();
        fs::remove_file(shelf.path().join(DAY).join(CHAIN)).unwrap();
        fs::remove_file(shelf.path().join(COUNTER)).unwrap();
        let files: Vec<_> = runs.iter().map(|run| fs::read(run.join(DIGESTS)).unwrap()).collect();
        let said = shelf.start();
        assert!(said.len() == 1 && said[0].contains(words) && said[0].contains("left as"), "{said:?}");
        assert!(!shelf.path().join(COUNTER).exists());
        for (run, before) in runs.iter().zip(files) {
            assert_eq!(fs::read(run.join(DIGESTS)).unwrap(), before);
            assert_eq!(as_written::verify(run), Vec::<String>::new());
            assert_eq!(shelf.seal(run), Seal::Flawed(Flaw::NotInChain));
        }
        // Behind the first line of this version there is nothing to say any more.
        shelf.closed("SN-2", "15:00:00");
        assert_eq!(shelf.start(), Vec::<String>::new());
        assert_eq!(shelf.late(), (0, Vec::new()));
    }
}

/// The run that goes on has an end already, and its station is closing it.
#[test]
fn a_run_that_its_station_closes_now_is_left_to_it() {
    let shelf = Shelf::new();
    shelf.closed("SN-0", "10:00:00");
    let run = shelf.ended("SN-1", STATION, "14:30:00");
    let held = closing::hold(fs::File::open(run.join(JOURNAL)).unwrap(), &run).unwrap();
    assert_eq!(shelf.start(), Vec::<String>::new());
    assert_eq!(shelf.seal(&run), Seal::Flawed(Flaw::UnderWay));
    drop(held);
    assert_eq!(shelf.start().len(), 1);
}

/// Another start of the other station does it for its own run.
#[test]
fn each_station_closes_its_own_runs() {
    let shelf = Shelf::new();
    shelf.closed("SN-0", "10:00:00");
    let run = shelf.ended("SN-1", "bench 2", "14:30:00");
    let said = shelf.start();
    assert!(said.len() == 1 && said[0].contains("was begun as station bench 2 and is not closed"), "{said:?}");
    assert_eq!(start_of(shelf.path(), "bench 2").len(), 1);
    assert_eq!(shelf.seal(&run), Seal::Flawed(Flaw::ClosedLate));
}

/// Another module was in the socket: such a run moves before it is closed, and the power may fail between the two steps of
/// the move.
#[test]
fn a_run_of_another_module_is_closed_late_where_it_belongs() {
    let shelf = Shelf::new();
    shelf.closed("SN-0", "10:00:00");
    let run = shelf.ended("SN-1", STATION, "14:30:00");
    let text = journal("SN-1", STATION, "14:30:00");
    let (begun, ended) = text.split_once('\n').unwrap();
    let at = format!("{DAY}T14:30:00+08:00");
    let other =
        json!({ "seq": 1, "at": at, "elapsed_us": 2, "kind": "other_module", "scanned": "SN-1", "found": "SN-9" });
    let ended = ended.replace("\"seq\":1", "\"seq\":2").replace("passed", "errored");
    fs::write(run.join(JOURNAL), format!("{begun}\n{other}\n{ended}")).unwrap();
    let unassigned = shelf.path().join(DAY).join(crate::store::UNASSIGNED);
    fs::create_dir_all(unassigned.join("143000-functional")).unwrap();
    let said = shelf.start();
    assert!(said.len() == 2 && said[0].contains("_unassigned/143000-functional was cut off at its start"), "{said:?}");
    assert_eq!((shelf.late(), run.exists()), ((1, Vec::new()), false));
    // The place that was kept for it is free again.
    let moved = unassigned.join("143000-functional");
    assert_eq!((as_written::verify(&moved), shelf.seal(&moved)), (Vec::new(), Seal::Flawed(Flaw::ClosedLate)));
    assert_eq!(fs::read_dir(&unassigned).unwrap().count(), 1);
}

/// Who puts a folder into the records gets it closed late, and cannot take the mark away.
#[test]
fn the_mark_stays() {
    let shelf = Shelf::new();
    shelf.closed("SN-0", "10:00:00");
    let run = shelf.ended("SN-1", STATION, "14:30:00");
    shelf.start();
    assert!(
        fs::read_to_string(run.join(LOG))
            .unwrap()
            .starts_with("CLOSED LATE: closed late at 2026-11-28 16:00:00 by gnc_station-1.3")
    );
    let report = fs::read_to_string(run.join(crate::report::REPORT)).unwrap();
    let (late, verdict) = (report.find("CLOSED LATE"), report.find("<h1>"));
    assert!(late < verdict && late.is_some() && report.contains("until then its journal could be edited"), "{report}");
    assert!(report.contains("CLOSED LATE") && report.contains("no: closed late"));
    // No file calls it a pass.
    let record: serde_json::Value = serde_json::from_slice(&fs::read(run.join(crate::store::RECORD)).unwrap()).unwrap();
    assert_eq!((&record["outcome"], &record["closed_late"]), (&json!("errored"), &json!("2026-11-28T16:00:00+08:00")));
    assert_eq!(as_written::verify(&run), Vec::<String>::new());
    let chain = shelf.path().join(DAY).join(CHAIN);
    let text = fs::read_to_string(&chain).unwrap();
    let unmarked: String = text.lines().map(|line| line.split(" late ").next().unwrap().to_owned() + "\n").collect();
    assert_ne!(unmarked, text);
    fs::write(&chain, unmarked).unwrap();
    assert_eq!(shelf.seal(&run), Seal::Flawed(Flaw::Changed));
    let problems = shelf.late().1;
    assert!(problems.len() == 1 && problems[0].contains("): it was changed"), "{problems:?}");
    // Words behind a line are no part of it either.
    fs::write(&chain, text.replacen("functional\n", "functional late\n", 1)).unwrap();
    assert!(!shelf.late().1.is_empty());
}

/// The counters of a shift do not take it for a pass.
#[test]
fn a_shift_counts_no_pass() {
    let shelf = Shelf::new();
    shelf.closed("SN-0", "10:00:00");
    shelf.ended("SN-1", STATION, "14:30:00");
    shelf.start();
    let of = ShiftOf { records: shelf.path().to_owned(), station: STATION.to_owned(), kind: BenchKind::Real };
    let shift = ShiftBook::new(of).shift(time("2026-11-28T06:00:00+08:00"), time(SEALED));
    let outcomes: Vec<Outcome> = shift.modules.iter().map(|module| module.outcome).collect();
    assert_eq!(outcomes, [Outcome::Passed, Outcome::Errored]);
}

/// A kill came behind signed digests: they prove what was then, so they are kept, and the new ones cover them. Where they are not
/// of the key, or the signature is gone, nothing is signed.
#[test]
fn signed_digests_are_kept_when_their_run_is_closed_late() {
    let folder = tempfile::tempdir().unwrap();
    let keys = ["own", "other"].map(|name| {
        StationKey::create(&folder.path().join(name)).unwrap();
        StationKey::read(&folder.path().join(name)).unwrap()
    });
    let [own, other] = &keys;
    let program = ProgramVersion { name: "gnc-station".to_owned(), version: "1.3".to_owned(), build: None };
    for spoil in 0..3 {
        let shelf = Shelf::new();
        let run = shelf.path().join(DAY).join("SN-1/143000-functional");
        fs::create_dir_all(&run).unwrap();
        fs::write(run.join(JOURNAL), journal("SN-1", STATION, "14:30:00")).unwrap();
        let by = Scribe { station: STATION, at: time(SEALED), key: Some(own), late: None };
        let began = chain::begin(&run, &by).unwrap();
        let undo = [CHAIN, "../COUNTER"].map(|name| keep(shelf.path().join(DAY).join(name)));
        close_as(&run, &by, Some(own), Some(&began)).unwrap();
        undo.iter().for_each(|undo| undo());
        let (digests, signature) = (fs::read(run.join(DIGESTS)).unwrap(), fs::read(run.join(SIGNATURE)).unwrap());
        match spoil {
            1 => fs::remove_file(run.join(SIGNATURE)).unwrap(),
            2 => fs::write(run.join(SIGNATURE), other.sign(&digests)).unwrap(),
            _ => {}
        }
        let sealer =
            Sealer { station: STATION, program: &program, at: time(SEALED), kind: BenchKind::Real, key: Some(own) };
        let said = crate::store::seal_interrupted(shelf.path(), &sealer);
        if spoil > 0 {
            let why = "ended, was not closed and is left as it is: SHA256SUMS.sig is missing, or is not of the key of this start";
            assert_eq!(said, [format!("{DAY}/SN-1/143000-functional {why}")]);
            assert_eq!(fs::read(run.join(DIGESTS)).unwrap(), digests);
            continue;
        }
        assert!(said.len() == 1 && said[0].contains("it is closed late now"), "{said:?}");
        assert_eq!(fs::read(run.join(DIGESTS_BEFORE)).unwrap(), digests);
        assert_eq!(fs::read(run.join(SIGNATURE_BEFORE)).unwrap(), signature);
        assert_eq!((as_written::verify(&run), as_written::verify_signature(&run, &[own.public()])), (Vec::new(), None));
        fs::write(run.join(DIGESTS_BEFORE), "").unwrap();
        assert_eq!(as_written::verify(&run), ["SHA256SUMS.before was changed"]);
    }
}

/// A line that cannot be read may be that of a run which looks as if it had none: nothing is written until the chain is put right, and
/// then all is as it was.
#[test]
fn a_chain_that_was_damaged_closes_nothing_late() {
    type Damage = fn(&str) -> String;
    let line_2 = |text: &str| text.lines().nth(1).unwrap().to_owned() + "\n";
    let damages: [(&str, Damage, &str); 5] = [
        ("a word", |text| text.replacen("close", "cl0se", 1), "holds 1 line that cannot be read"),
        (
            "a signature",
            |text| text.replacen("functional\n3", "functional sig aX\n3", 1),
            "holds 1 line that cannot be read",
        ),
        (
            "a line",
            |text| text.lines().enumerate().filter(|(at, _)| *at != 1).map(|(_, line)| format!("{line}\n")).collect(),
            "between line 1 and line 3",
        ),
        ("line ends", |text| text.replace('\n', "\r\n"), "holds 4 lines that cannot be read"),
        (
            "a mark and line ends",
            |text| format!("\u{feff}{}", text.replace('\n', "\r\n")),
            "holds 4 lines that cannot be read",
        ),
    ];
    for (name, damage, why) in damages {
        let shelf = Shelf::new();
        let runs = [shelf.closed("SN-1", "10:00:00"), shelf.closed("SN-2", "11:00:00")];
        let path = shelf.path().join(DAY).join(CHAIN);
        let text = fs::read_to_string(&path).unwrap();
        assert!(line_2(&text).contains(" close "), "{text}");
        let damaged = damage(&text);
        assert_ne!(damaged, text, "{name}");
        fs::write(&path, &damaged).unwrap();
        let said = shelf.start();
        let said: Vec<_> = said.iter().filter(|line| !line.starts_with("COUNTER ")).collect();
        assert!(said.len() == 1 && said[0].contains(why) && said[0].contains("then start again"), "{name}: {said:?}");
        assert_eq!(fs::read_to_string(&path).unwrap(), damaged, "{name}");
        let checked = chain::verify(shelf.path()).unwrap();
        let all = [checked.problems, checked.incomplete].concat();
        assert!(!all.is_empty() && all.iter().all(|line| !line.contains("next start")), "{name}: {all:?}");
        if name.contains("line ends") {
            assert!(all.len() == 1 && all[0].contains("an editor saved the file"), "{name}: {all:?}");
        }
        fs::write(&path, &text).unwrap();
        assert_eq!((shelf.start(), shelf.late()), (Vec::new(), (0, Vec::new())), "{name}");
        for run in runs {
            assert_eq!((as_written::verify(&run), shelf.seal(&run)), (Vec::new(), Seal::Chained), "{name}");
        }
    }
}

/// Lines of the first versions end with the run's name.
#[test]
fn a_line_of_the_first_version_with_another_end_is_none() {
    let shelf = Shelf::new();
    for (serial_number, time) in [("SN-1", "10:00:00"), ("SN-2", "11:00:00")] {
        let run = shelf.ended(serial_number, STATION, time);
        close_now(&run);
    }
    let path = shelf.path().join(DAY).join(CHAIN);
    // Each line as those versions wrote it, of the runs that were closed.
    let (mut text, mut before) = (String::new(), "0".repeat(64));
    let written = fs::read_to_string(&path).unwrap();
    for (at, line) in written.lines().filter(|line| line.contains(" close ")).enumerate() {
        let words: Vec<&str> = line.split(' ').collect();
        let (number, digest, run) = (at + 1, words[2], words[7]);
        let link =
            crate::store::digest::hexadecimal(&sha2::Sha256::digest(format!("{number} {before} {digest} {run}")));
        text.push_str(&format!("{number} {before} {digest} {link} {run}\n"));
        before = link;
    }
    fs::write(shelf.path().join(COUNTER), format!("2 {before}\n")).unwrap();
    fs::write(&path, &text).unwrap();
    assert_eq!(shelf.late(), (0, Vec::new()));
    let saved = text.replace('\n', "\r\n");
    fs::write(&path, &saved).unwrap();
    let problems = shelf.late().1;
    assert!(problems.len() == 1 && problems[0].contains("an editor saved the file"), "{problems:?}");
    let said = shelf.start();
    assert!(said.iter().any(|line| line.contains("holds 2 lines that cannot be read")), "{said:?}");
    assert_eq!(fs::read_to_string(&path).unwrap(), saved);
}

/// Old days stand on another disk: a run that began since is closed late all the same.
#[test]
fn days_that_were_moved_away_stop_no_closing() {
    let shelf = Shelf::new();
    shelf.closed("SN-0", "09:00:00");
    shelf.closed("SN-1", "10:00:00");
    let chain = shelf.path().join(DAY).join(CHAIN);
    let text = fs::read_to_string(&chain).unwrap();
    let kept: String =
        text.lines().enumerate().filter(|(at, _)| *at != 1).map(|(_, line)| format!("{line}\n")).collect();
    fs::write(&chain, kept).unwrap();
    fs::remove_dir_all(shelf.path().join(DAY).join("SN-0")).unwrap();
    let run = shelf.ended("SN-2", STATION, "14:30:00");
    let said = shelf.start();
    assert!(said.len() == 1 && said[0].contains("it is closed late now"), "{said:?}");
    assert_eq!(shelf.seal(&run), Seal::Flawed(Flaw::ClosedLate));
}
