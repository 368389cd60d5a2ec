//! Errors and kills at each place of a run's beginning and closing, and what the next start makes of them.

use std::path::PathBuf;

use serde_json::json;

use super::*;
use crate::resume::{Like, Resumed};
use crate::store::as_written;
use crate::store::chain::{CHAIN, ChainStanding, LateCloses, standing, verify};
use crate::store::closing;
use crate::store::reader::Found;
use crate::store::{PLAN, SIGNATURE};

pub(in crate::store) const DAY: &str = "2026-11-28";
pub(in crate::store) const STATION: &str = "bench 1";

/// The plan that each run follows.
pub(in crate::store) const PLAN_TEXT: &str = "name = \"functional\"";

fn at() -> DateTime<FixedOffset> {
    "2026-11-28T16:00:00+08:00".parse().unwrap()
}

/// Closes a run with what its folder and its journal say, as its station does.
pub(in crate::store) fn close_as(
    run: &Path,
    by: &Scribe<'_>,
    key: Option<&StationKey>,
    began: Option<&chain::Place>,
) -> Result<(), StoreError> {
    let state = reader::fold(run).unwrap();
    let plan = PlanFiles::found(run, &state).unwrap();
    let contents = Contents { state: &Mutex::new(state), plan: &plan, cut_off: &[], made: &[] };
    close(&RunFolder::existing(run).signed_with(key.cloned()), &contents, by, began)
}

/// Digest of the plan of the runs of these tests.
pub(in crate::store) fn plan_sha256() -> String {
    crate::store::digest::of_plan([("functional.toml", PLAN_TEXT.as_bytes())].into_iter())
}

pub(in crate::store) struct Shelf(tempfile::TempDir);

impl Shelf {
    pub(in crate::store) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(in crate::store) fn path(&self) -> &Path {
        self.0.path()
    }

    pub(in crate::store) fn scribe(&self) -> Scribe<'static> {
        Scribe { station: STATION, at: at(), key: None, late: None }
    }

    /// A run of no items with so many of its two events.
    fn run(&self, serial_number: &str, events: usize) -> PathBuf {
        let run = self.path().join(DAY).join(serial_number).join("143000-functional");
        fs::create_dir_all(run.join(PLAN)).unwrap();
        fs::write(run.join(PLAN).join("01-functional.toml"), PLAN_TEXT).unwrap();
        let header = json!({
            "schema": "gnc-events/1", "serial_number": serial_number, "operator": null, "station": STATION,
            "program": { "name": "gnc-station", "version": "1.2" }, "bench": { "kind": "real" }, "selection": null,
            "loop": null, "plan": { "name": "functional", "version": "1.0", "sha256": plan_sha256() },
        });
        let begun =
            json!({ "seq": 0, "at": at(), "elapsed_us": 0, "kind": "run_started", "header": header, "items": [] });
        let ended = json!({ "seq": 1, "at": at(), "elapsed_us": 5, "kind": "run_ended", "outcome": "passed" });
        let journal: String = [begun, ended].iter().take(events).map(|event| format!("{event}\n")).collect();
        fs::write(run.join(JOURNAL), journal).unwrap();
        run
    }

    /// A run of so many events that began by the chain.
    pub(in crate::store) fn begun(&self, serial_number: &str, events: usize, key: Option<&StationKey>) -> PathBuf {
        let run = self.run(serial_number, events);
        chain::begin(&run, &Scribe { station: STATION, at: at(), key, late: None }).unwrap();
        run
    }

    pub(in crate::store) fn close(&self, run: &Path) -> Result<(), StoreError> {
        let by = Scribe { station: STATION, at: at(), key: None, late: None };
        let began = chain::begin(run, &by)?;
        close_as(run, &by, None, Some(&began))
    }

    /// A journal without an end goes on behind the first event.
    pub(in crate::store) fn cut(&self, run: &Path) {
        let journal = fs::read_to_string(run.join(JOURNAL)).unwrap();
        let first = journal.split_inclusive('\n').next().unwrap();
        let found = json!({ "seq": 1, "at": at(), "elapsed_us": 3, "kind": "prompted", "item": null, "text": "x" });
        fs::write(run.join(JOURNAL), format!("{first}{found}\n")).unwrap();
    }

    pub(in crate::store) fn start_by(&self, station: &str, kind: BenchKind, key: Option<&StationKey>) -> Vec<String> {
        let program = ProgramVersion { name: "gnc-station".to_owned(), version: "1.3".to_owned(), build: None };
        seal_within(self.path(), &Sealer { station, program: &program, kind, at: at(), key }, SEAL_FOR)
    }

    fn start_within(&self, time: Duration) -> Vec<String> {
        let program = ProgramVersion { name: "gnc-station".to_owned(), version: "1.3".to_owned(), build: None };
        seal_within(
            self.path(),
            &Sealer { station: STATION, program: &program, kind: BenchKind::Real, at: at(), key: None },
            time,
        )
    }

    pub(in crate::store) fn start(&self) -> Vec<String> {
        self.start_within(SEAL_FOR)
    }

    /// All is as it was written, and the next start has nothing to do.
    #[track_caller]
    pub(in crate::store) fn is_whole(&self, runs: usize) {
        let paths = reader::paths(self.path()).unwrap();
        assert_eq!(paths.len(), runs);
        for run in paths {
            assert_eq!(as_written::verify(&run), Vec::<String>::new());
        }
        assert_eq!(verify(self.path()).unwrap().problems, Vec::<String>::new());
        assert_eq!(self.start(), Vec::<String>::new());
    }
}

fn names(run: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(run).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// The chain refuses the line: no file says any more that the run passed, and the next start closes it late.
#[test]
fn an_error_before_the_line_takes_the_seal_back() {
    let shelf = Shelf::new();
    shelf.close(&shelf.run("SN-0", 2)).unwrap();
    let run = shelf.run("SN-1", 2);
    let by = Scribe { station: STATION, at: at(), key: None, late: None };
    chain::begin(&run, &by).unwrap();
    let chain = shelf.path().join(DAY).join(CHAIN);
    let kept = shelf.path().join("kept");
    fs::rename(&chain, &kept).unwrap();
    fs::create_dir(&chain).unwrap();
    let closed = close_as(&run, &by, None, None);
    assert!(closed.is_err());
    fs::remove_dir(&chain).unwrap();
    fs::rename(&kept, &chain).unwrap();
    assert_eq!(names(&run), [JOURNAL, PLAN]);
    let left = as_written::check(&run);
    assert!(left.problems.is_empty() && left.incomplete.is_some_and(|what| what.starts_with("ended and not closed")));
    assert_eq!(reader::found(run.clone()).state(), Found::Unsealed);
    let said = shelf.start();
    assert!(said.len() == 1 && said[0].contains("it is closed late now and never counts as a pass"), "{said:?}");
    assert_eq!(standing(&run).unwrap(), ChainStanding::Late);
    shelf.is_whole(2);
}

/// A kill between digests and line leaves papers that say passed; those of the late close say what it is.
#[test]
fn papers_of_a_run_that_is_closed_late_say_so() {
    let shelf = Shelf::new();
    shelf.close(&shelf.run("SN-0", 2)).unwrap();
    let chain = shelf.path().join(DAY).join(CHAIN);
    let run = shelf.run("SN-1", 2);
    shelf.close(&run).unwrap();
    let text = fs::read_to_string(&chain).unwrap();
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    fs::write(&chain, lines[..3].concat()).unwrap();
    fs::write(
        shelf.path().join("COUNTER"),
        lines[2].split(' ').enumerate().fold(String::new(), |text, (at, word)| match at {
            0 => format!("{word} "),
            3 => text + word + "\n",
            _ => text,
        }),
    )
    .unwrap();
    assert!(!fs::read_to_string(run.join(crate::report::REPORT)).unwrap().contains("CLOSED LATE"));
    // It has begun by the chain, so that it is not called slipped in; a folder that was slipped in is.
    let checked = verify(shelf.path()).unwrap();
    let expected = "2026-11-28/SN-1/143000-functional is not in the chain: its station ended, or could not write, while it \
                    closed the run; the next start goes on";
    assert_eq!((checked.problems, checked.incomplete), (Vec::new(), vec![expected.to_owned()]));
    let slipped = shelf.path().join(DAY).join("SN-7");
    fs::rename(run.parent().unwrap(), &slipped).unwrap();
    let checked = verify(shelf.path()).unwrap();
    assert!(checked.problems.iter().any(|problem| problem.contains("or it was slipped in")), "{checked:?}");
    assert_eq!(checked.incomplete, Vec::<String>::new());
    fs::rename(&slipped, run.parent().unwrap()).unwrap();
    assert!(LateCloses::default().lacks(&run).unwrap());
    assert_eq!(shelf.start().len(), 1);
    assert!(fs::read_to_string(run.join(crate::report::REPORT)).unwrap().contains("CLOSED LATE"));
    assert!(fs::read_to_string(run.join(crate::store::LOG)).unwrap().contains("CLOSED LATE"));
    shelf.is_whole(2);
}

#[test]
fn a_folder_that_never_began_goes() {
    let shelf = Shelf::new();
    shelf.close(&shelf.run("SN-0", 2)).unwrap();
    for journal in [None, Some(&b""[..]), Some(b"{\"seq\":0,\"at\":\"2026")] {
        let run = shelf.run("SN-1", 0);
        fs::remove_file(run.join(JOURNAL)).unwrap();
        if let Some(journal) = journal {
            fs::write(run.join(JOURNAL), journal).unwrap();
        }
        assert_eq!(
            shelf.start(),
            [format!(
                "{DAY}/SN-1/143000-functional was cut off at its start, before its first event: nothing was tested; its \
                 folder is removed"
            )]
        );
        assert!(!run.parent().unwrap().exists(), "the folder of its module goes too");
        shelf.is_whole(1);
    }
    // A run that the chain names stays, also one of an earlier version, which wrote no line of its beginning.
    let emptied = shelf.run("SN-1", 0);
    let line = fs::read_to_string(shelf.path().join(DAY).join(CHAIN)).unwrap().lines().last().unwrap().to_owned();
    let chain = shelf.path().join(DAY).join(CHAIN);
    let (before, name) = (fs::read_to_string(&chain).unwrap(), format!("{DAY}/SN-1/143000-functional"));
    let words: Vec<&str> = line.split(' ').take(4).collect();
    fs::write(&chain, format!("{before}{} {name}\n", words.join(" "))).unwrap();
    let said = shelf.start();
    assert!(
        said.len() == 1 && said[0].contains("was closed and is left as it is because its journal holds no event now")
    );
    assert!(emptied.exists());
    fs::write(&chain, before).unwrap();
    assert!(shelf.start().len() == 1 && !emptied.exists());
    // A station that begins holds its folder; a folder of a person has another name.
    let begins = RunFolder::create(shelf.path(), at(), "SN-2", "functional").unwrap();
    let of_person = shelf.path().join(DAY).join("SN-0/notes");
    fs::create_dir(&of_person).unwrap();
    assert_eq!(shelf.start(), Vec::<String>::new());
    assert!(begins.path().exists() && of_person.exists());
}

/// What a kill leaves within the folder of an interrupted run.
#[test]
fn parts_and_a_signature_without_digests_go() {
    let shelf = Shelf::new();
    let run = shelf.run("SN-1", 1);
    fs::create_dir(run.join("01-cpu")).unwrap();
    for left in ["01-cpu/item.json.part", "SHA256SUMS.part", "run.json.part", SIGNATURE] {
        fs::write(run.join(left), "half").unwrap();
    }
    let left = as_written::check(&run);
    assert_eq!(
        left.incomplete.as_deref(),
        Some(
            "interrupted: its station ended, or could not write, in the run; the next start of the station bench 1 seals it, with a key if it had one"
        )
    );
    assert!(left.problems.is_empty());
    let said = shelf.start();
    assert!(said.len() == 1 && said[0].contains("it is sealed as interrupted"), "{said:?}");
    assert!(!run.join(SIGNATURE).exists() && !run.join("01-cpu").exists(), "{:?}", names(&run));
    shelf.is_whole(1);
}

/// A start sealed an interrupted run and was killed between its digests and its line: the next one writes the line, and gives the
/// files the names for which they wait.
#[test]
fn a_sealed_run_without_its_line_gets_it() {
    let shelf = Shelf::new();
    shelf.close(&shelf.begun("SN-0", 2, None)).unwrap();
    let run = shelf.begun("SN-1", 1, None);
    shelf.cut(&run);
    let [chain, counter] = [shelf.path().join(DAY).join(CHAIN), shelf.path().join("COUNTER")];
    let before = [fs::read(&chain).unwrap(), fs::read(&counter).unwrap()];
    assert_eq!(shelf.start().len(), 1);
    fs::write(&chain, &before[0]).unwrap();
    fs::write(&counter, &before[1]).unwrap();
    for name in ["run.json", "report.html", "log.txt"] {
        fs::rename(run.join(name), run.join(format!("{name}.part"))).unwrap();
    }
    assert_eq!(standing(&run).unwrap(), ChainStanding::Missing);
    // The digests do not name this one.
    fs::write(run.join("passport.json.part"), "{\"outcome\":\"passed\"}").unwrap();
    let (what, said) = ("was interrupted while the station sealed it; the sealing is complete now", shelf.start());
    assert_eq!((said.len(), &said[0]), (2, &format!("{DAY}/SN-1/143000-functional {what}")));
    assert!(said[1].contains("passport.json.part") && !run.join("passport.json").exists(), "{said:?}");
    fs::remove_file(run.join("passport.json.part")).unwrap();
    assert_eq!(standing(&run).unwrap(), ChainStanding::Held);
    assert!(run.join("run.json").exists() && !run.join("run.json.part").exists());
    shelf.is_whole(2);
}

/// A start that finds more than it has time for says so, and the next one goes on.
#[test]
fn a_start_does_not_take_for_ever() {
    let shelf = Shelf::new();
    shelf.close(&shelf.run("SN-0", 2)).unwrap();
    for run in 1..=3 {
        shelf.begun(&format!("SN-{run}"), run % 2 + 1, None);
    }
    let said = shelf.start_within(Duration::ZERO);
    assert_eq!(
        said,
        [
            "3 runs more have no end or were not closed, and this start has no time for them; each next start goes on with them"
        ]
    );
    assert_eq!(shelf.start().len(), 3);
    shelf.is_whole(4);
}

fn key(seed: &str) -> (tempfile::TempDir, StationKey) {
    let folder = tempfile::tempdir().unwrap();
    StationKey::create(&folder.path().join(seed)).unwrap();
    let key = StationKey::read(&folder.path().join(seed)).unwrap();
    (folder, key)
}

const PUT_THERE: &str = "is left as it is: no line of the chain says that it began, so a person may have put it there";

/// A start never makes a run of the station of a folder that was put there, whatever is missing in it.
#[test]
fn a_run_that_no_line_began_is_left_as_it_is() {
    let (_folder, key) = key("own");
    for key in [None, Some(&key)] {
        let shelf = Shelf::new();
        shelf.begun("SN-0", 1, key);
        assert_eq!(shelf.start_by(STATION, BenchKind::Real, key).len(), 1);
        let planted = shelf.run("SN-1", 1);
        shelf.cut(&planted);
        let ended = shelf.run("SN-2", 2);
        let other = shelf.begun("SN-3", 1, key);
        let first = fs::read_to_string(other.join(JOURNAL)).unwrap().replace("SN-3", "SN-4");
        fs::write(other.join(JOURNAL), first).unwrap();
        shelf.cut(&other);
        let chain = fs::read(shelf.path().join(DAY).join(CHAIN)).unwrap();
        let mut said = shelf.start_by(STATION, BenchKind::Real, key);
        said.sort();
        let said_of = |number: u32, how: &str| format!("{DAY}/SN-{number}/143000-functional {how} {PUT_THERE}");
        assert_eq!(
            said,
            [
                said_of(1, "was interrupted and"),
                said_of(2, "ended, was not closed and"),
                said_of(3, "was interrupted and")
            ]
        );
        // With digests made by the person, too.
        let sealed = |run: &Path| {
            let record = RunRecord::from_state(&reader::fold(run).unwrap()).unwrap();
            fs::write(run.join(crate::store::LOG), "").unwrap();
            RunFolder::existing(run).put("run.json", |out| closing::pretty(out, &record)).unwrap();
            let mut sums = crate::store::digest::FileDigests::default();
            sums.add_new(run).unwrap();
            fs::write(run.join(DIGESTS), sums.text()).unwrap();
            assert_eq!(as_written::verify(run), Vec::<String>::new());
        };
        sealed(&planted);
        sealed(&ended);
        let said = shelf.start_by(STATION, BenchKind::Real, key);
        assert!(said.len() == 3 && said.iter().all(|line| line.ends_with(PUT_THERE)), "{said:?}");
        assert_eq!(fs::read(shelf.path().join(DAY).join(CHAIN)).unwrap(), chain);
    }
}

/// Only the station that carried a run out closes it, on its kind of bench, and with its key.
#[test]
fn a_run_is_left_to_its_station_its_bench_and_its_key() {
    let (_own, own) = key("own");
    let shelf = Shelf::new();
    let run = shelf.begun("SN-1", 1, Some(&own));
    shelf.cut(&run);
    let files = names(&run);
    for (station, kind, key, why) in [
        (
            "bench 2",
            BenchKind::Real,
            Some(&own),
            "was begun as station bench 1 and is not closed while this bench file names bench 2; if this bench was renamed start it once with its old id so that the run is closed; until then it counts as interrupted",
        ),
        (
            STATION,
            BenchKind::Simulated,
            None,
            "was interrupted and is left to the next start of its station with a bench that is not simulated",
        ),
        (
            STATION,
            BenchKind::Real,
            None,
            "was interrupted and is left to the station bench 1 with the key that signed the line of its beginning: start it once with that key",
        ),
    ] {
        let said = shelf.start_by(station, kind, key);
        assert_eq!(said, [format!("{DAY}/SN-1/143000-functional {why}")]);
        assert_eq!(names(&run), files);
    }
    // A line without a signature behind signed ones is not of this station.
    let forged = shelf.begun("SN-2", 1, None);
    shelf.cut(&forged);
    let said = shelf.start_by(STATION, BenchKind::Real, Some(&own));
    assert!(said.iter().any(|line| line.contains("SN-1") && line.contains("it is sealed as interrupted")), "{said:?}");
    let why = "is left as it is: the line of its beginning is not signed, and earlier ones of its station are; a start without a key closes it";
    assert!(said.contains(&format!("{DAY}/SN-2/143000-functional was interrupted and {why}")), "{said:?}");
    let is_signed = as_written::verify_signature(&run, &[own.public()]).is_none();
    assert!(is_signed && standing(&run).unwrap() == ChainStanding::Held);
}

/// The key was exchanged, or came later than that of a station beside this one: what was interrupted is closed all the same, as no
/// pass, the chain is whole by the keys of both, and a run that another key began is not resumed.
#[test]
fn an_interrupted_run_is_closed_behind_an_exchanged_or_a_later_key() {
    let ((_old, old), (_new, new)) = (key("old"), key("new"));
    let keys = [old.public(), new.public()];
    for of_old in [Some(&old), None] {
        let shelf = Shelf::new();
        let beside = shelf.run("SN-0", 1);
        shelf.cut(&beside);
        chain::begin(&beside, &Scribe { station: "bench 2", at: at(), key: Some(&old), late: None }).unwrap();
        let run = shelf.begun("SN-1", 1, of_old);
        shelf.cut(&run);
        let said = shelf.start_by(STATION, BenchKind::Real, Some(&new));
        let said: Vec<_> = said.iter().filter(|line| line.contains("SN-1")).collect();
        assert!(said.len() == 1 && said[0].contains("it is sealed as interrupted; test SN-1 again"), "{said:?}");
        assert_eq!(said[0].contains("another key signed the line of its beginning; "), of_old.is_some(), "{said:?}");
        assert_eq!((as_written::verify(&run), as_written::verify_signature(&run, &keys)), (Vec::new(), None));
        assert_eq!(standing(&run).unwrap(), ChainStanding::Held);
        let (checked, _) = chain::verify_against(shelf.path(), &chain::Against { keys: &keys, heads: &[] }).unwrap();
        assert_eq!(checked.problems, Vec::<String>::new());
        let (checked, _) = chain::verify_against(shelf.path(), &chain::Against::default()).unwrap();
        assert_eq!(checked.problems, Vec::<String>::new());
        if of_old.is_some() {
            let header = reader::fold(&run).unwrap().header().unwrap().clone();
            let like = Like::header(&header, 7, at(), shelf.path()).with_key(Some(&new));
            let why = Resumed::read(&run, like).err().map(|error| error.to_string()).unwrap_or_default();
            assert!(why.contains("the line of its beginning is not signed with the key of this station"), "{why}");
        }
    }
}

/// Captures are taken over only from a run that the chain began, and where there is a key, that the station signed.
#[test]
fn only_a_run_that_the_chain_began_is_resumed() {
    let (_own, own) = key("own");
    let shelf = Shelf::new();
    let old = shelf.run("SN-9", 1);
    shelf.cut(&old);
    let why = |run: &Path, key| {
        let header = reader::fold(run).unwrap().header().unwrap().clone();
        let like = Like::header(&header, 7, at(), shelf.path()).with_key(key);
        Resumed::read(run, like).err().map(|error| error.to_string())
    };
    assert_eq!(why(&old, Some(&own)), None, "an earlier version wrote no line of a beginning");
    let signed = shelf.begun("SN-1", 1, Some(&own));
    let unsigned = shelf.begun("SN-2", 1, None);
    let planted = shelf.run("SN-3", 1);
    [&signed, &unsigned, &planted].into_iter().for_each(|run| shelf.cut(run));
    let changed = |what: &str| Some(format!("the run to resume fails its verification: {what}"));
    let not_begun = changed("no line of the chain says that it began");
    assert_eq!([why(&signed, Some(&own)), why(&signed, None), why(&unsigned, None)], [None, None, None]);
    assert_eq!(
        why(&unsigned, Some(&own)),
        changed("the line of its beginning is not signed with the key of this station")
    );
    assert_eq!([why(&planted, None), why(&planted, Some(&own))], [not_begun.clone(), not_begun.clone()]);
    assert_eq!(shelf.start_by(STATION, BenchKind::Real, Some(&own)).len(), 4);
    assert_eq!([why(&signed, Some(&own)), why(&planted, Some(&own))], [None, not_begun]);
}

/// Sealed runs without a line cost time, too, and wait behind the interrupted ones.
#[test]
fn sealed_runs_without_a_line_are_looked_at_within_the_time() {
    let shelf = Shelf::new();
    for run in 1..=3 {
        let run = shelf.run(&format!("SN-{run}"), 1);
        fs::write(run.join(DIGESTS), "").unwrap();
    }
    assert_eq!(
        shelf.start_within(Duration::ZERO),
        [
            "3 runs more have no end or were not closed, and this start has no time for them; each next start goes on with them"
        ]
    );
}
