//! A kill between the line of a run and the names of its files, and looks of others at each moment of a closing.

use std::sync::mpsc;

use gnc_executive::standing::{Flaw, Seal};

use super::*;
use crate::standing::Seals;
use crate::store::as_written;
use crate::store::chain::{CHAIN, ChainStanding, standing, verify};
use crate::store::head::RunHead;
use crate::store::reader::{self, Found};
use crate::store::recovery::tests::Shelf;
use crate::store::{DIGESTS, JOURNAL, PLAN};

/// Looks while the closing waits for the chain: far more than it takes to come there.
const LOOKS: usize = 20_000;

/// A run that is closed, and of which so many files have not got their names.
fn closed_but_for(count: usize, shelf: &Shelf) -> PathBuf {
    let run = shelf.begun("SN-1", 2, None);
    shelf.close(&run).unwrap();
    let made = TELLING.into_iter().filter(|name| run.join(name).exists());
    for name in made.collect::<Vec<_>>().into_iter().rev().take(count) {
        fs::rename(run.join(name), run.join(waiting_name(name))).unwrap();
    }
    run
}

/// The chain is held by another program: all is on disk but the line, and no file says how the run ended.
#[test]
fn nothing_says_passed_before_the_line() {
    let shelf = Shelf::new();
    let run = shelf.begun("SN-1", 2, None);
    let held = File::open(shelf.path()).unwrap();
    held.lock().unwrap();
    let (ended, end) = mpsc::channel();
    std::thread::scope(|scope| {
        let (shelf, run) = (&shelf, &run);
        scope.spawn(move || {
            // The line of the beginning is there already, and it is looked up under the lock, too.
            let by = shelf.scribe();
            let began = chain::place_of(run).unwrap();
            ended.send(crate::store::recovery::tests::close_as(run, &by, None, began.as_ref())).unwrap();
        });
        while !run.join(DIGESTS).exists() {
            assert!(end.try_recv().is_err(), "it was closed without the lock");
            std::thread::yield_now();
        }
        // Names that come too early come right behind the digests.
        for look in 0..LOOKS {
            for name in TELLING {
                assert!(!run.join(name).exists(), "{name} at look {look}");
            }
            std::thread::yield_now();
        }
        assert!(run.join("run.json.part").exists() && run.join("report.html.part").exists());
        assert_eq!(RunHead::read(run), None);
        assert!(reader::paper(run, RECORD).is_err());
        held.unlock().unwrap();
        end.recv().unwrap().unwrap();
    });
    assert!(waiting(&run).is_empty() && run.join(RECORD).exists() && RunHead::read(&run).is_some());
    shelf.is_whole(1);
}

#[test]
fn a_run_whose_files_wait_for_their_names_is_closed() {
    for count in 1..=3 {
        let shelf = Shelf::new();
        let run = closed_but_for(count, &shelf);
        assert_eq!(waiting(&run).len(), count);
        let checked = as_written::check(&run);
        assert_eq!((checked.problems, checked.incomplete, checked.running), (Vec::new(), None, false));
        assert!(checked.unnamed.unwrap().contains(" waits for its name: its station ended, or could not write"));
        assert_eq!(verify(shelf.path()).unwrap().problems, Vec::<String>::new());
        assert_eq!(reader::found(run.clone()).state(), Found::Closed);
        assert_eq!(standing(&run).unwrap(), ChainStanding::Held);
        assert_eq!(Seals::new(shelf.path()).seal(&run).unwrap(), Seal::Chained);
        assert!(RunHead::read(&run).is_some() && reader::paper(&run, REPORT).is_ok());
        assert_eq!(as_written::strangers(&run), Vec::<PathBuf>::new());
        // Its own station gives the names at this moment: a start of another one leaves it to it, and a check calls it running.
        let held = crate::store::closing::hold(File::open(run.join(JOURNAL)).unwrap(), &run).unwrap();
        assert!(as_written::check(&run).running && shelf.start().is_empty() && waiting(&run).len() == count);
        drop(held);
        let said = shelf.start();
        let what = "was closed, and its station ended, or could not write, before all of its files had their names; they have them \
                    now";
        assert_eq!(said, [format!("2026-11-28/SN-1/143000-functional {what}")]);
        assert!(waiting(&run).is_empty());
        shelf.is_whole(1);
    }
}

/// A person exchanges a file that waits, or puts one in the place for which it waits.
#[test]
fn only_what_the_run_was_closed_with_gets_a_name() {
    let shelf = Shelf::new();
    let run = closed_but_for(3, &shelf);
    fs::write(run.join("run.json.part"), "{\"outcome\":\"passed\"}").unwrap();
    let found = as_written::check(&run).problems;
    assert!(found.contains(&"run.json.part was changed".to_owned()), "{found:?}");
    assert_eq!(Seals::new(shelf.path()).seal(&run).unwrap(), Seal::Flawed(Flaw::Changed));
    let said = shelf.start();
    let left = "run.json.part is left as it is, since it is not what the run was closed with";
    assert!(said.len() == 1 && said[0].ends_with(left), "{said:?}");
    assert!(!run.join(RECORD).exists() && run.join(REPORT).exists());

    let shelf = Shelf::new();
    let run = closed_but_for(3, &shelf);
    fs::write(run.join(RECORD), "{\"outcome\":\"passed\"}").unwrap();
    let found = as_written::check(&run).problems;
    for expected in ["run.json was changed", "run.json.part was added"] {
        assert!(found.contains(&expected.to_owned()), "{found:?}");
    }
    shelf.start();
    assert_eq!(fs::read_to_string(run.join(RECORD)).unwrap(), "{\"outcome\":\"passed\"}");
}

/// Without a line the files that wait are drafts: a kill came between digests and line.
#[test]
fn files_of_a_run_without_a_line_get_no_names() {
    let shelf = Shelf::new();
    shelf.close(&shelf.begun("SN-0", 2, None)).unwrap();
    let chain = shelf.path().join("2026-11-28").join(CHAIN);
    let run = shelf.begun("SN-1", 2, None);
    let (text, counter) = (fs::read(&chain).unwrap(), fs::read(shelf.path().join("COUNTER")).unwrap());
    shelf.close(&run).unwrap();
    fs::write(&chain, text).unwrap();
    fs::write(shelf.path().join("COUNTER"), counter).unwrap();
    for name in TELLING.into_iter().filter(|name| run.join(name).exists()) {
        fs::rename(run.join(name), run.join(waiting_name(name))).unwrap();
    }
    assert!(run.join(PLAN).exists() && RunHead::read(&run).is_none() && reader::paper(&run, REPORT).is_err());
    // A stranger in the folder keeps no start from closing it.
    fs::write(run.join("note.txt"), "planted").unwrap();
    let said = shelf.start();
    assert!(said.len() == 2 && said[0].contains("it is closed late now and never counts as a pass"), "{said:?}");
    assert_eq!((standing(&run).unwrap(), waiting(&run)), (ChainStanding::Late, Vec::new()));
    assert_eq!(as_written::verify(&run), ["note.txt was added"]);
}

/// A lock does not hide what was changed in a run whose line is in the chain, whatever waits there for a name.
#[test]
fn a_lock_hides_no_change() {
    for waiting in ["run.json", "passport.json"] {
        let shelf = Shelf::new();
        let run = closed_but_for(0, &shelf);
        if run.join(waiting).exists() {
            fs::rename(run.join(waiting), run.join(waiting_name(waiting))).unwrap();
        } else {
            fs::write(run.join(waiting_name(waiting)), "planted").unwrap();
            assert!(reader::paper(&run, waiting).is_err(), "the run was closed without it");
            assert_eq!(as_written::strangers(&run), [PathBuf::from(waiting_name(waiting))]);
        }
        fs::write(run.join("log.txt"), "changed").unwrap();
        let held = File::open(&run).unwrap();
        held.lock().unwrap();
        let checked = as_written::check(&run);
        assert!(!checked.running && checked.problems.contains(&"log.txt was changed".to_owned()), "{checked:?}");
    }
}

/// A closed run whose journal is emptied was changed: it is not one that never began.
#[test]
fn an_emptied_journal_of_a_closed_run_is_a_change() {
    let shelf = Shelf::new();
    let run = closed_but_for(0, &shelf);
    for left in ["", "{"] {
        fs::write(run.join(JOURNAL), left).unwrap();
        let checked = as_written::check(&run);
        assert!(!checked.never_begun && checked.incomplete.is_none(), "{checked:?}");
        assert!(checked.problems.contains(&"events.jsonl was changed".to_owned()), "{checked:?}");
        let found = reader::found(run.clone());
        assert!(found.is_of("SN-1") && !found.is_of("SN-2"), "the folder says whose it is");
    }
}
