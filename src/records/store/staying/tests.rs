//! What a start says of runs that it leaves as they are, and of what it takes away.

use std::fs::{self, File};
use std::path::Path;

use gnc_executive::event::BenchKind;

use crate::store::chain::{ChainStanding, standing};
use crate::store::recovery::tests::{DAY, STATION, Shelf};
use crate::store::{JOURNAL, reader};

fn run_of(number: u32) -> String {
    format!("{DAY}/SN-{number}/143000-functional")
}

/// A run of one event more than its first, which a kill cut off.
fn killed(shelf: &Shelf, number: u32) -> std::path::PathBuf {
    let run = shelf.begun(&format!("SN-{number}"), 1, None);
    shelf.cut(&run);
    run
}

/// A person or a disk error emptied the journal of a killed run, or took it away. The chain says that it began.
#[test]
fn a_killed_run_that_lost_its_journal_is_named() {
    let empty = |run: &Path| fs::write(run.join(JOURNAL), "").unwrap();
    let half = |run: &Path| fs::write(run.join(JOURNAL), "{\"seq\":0,\"at\"").unwrap();
    let gone = |run: &Path| fs::remove_file(run.join(JOURNAL)).unwrap();
    let breaks: [&dyn Fn(&Path); 3] = [&empty, &half, &gone];
    for break_it in breaks {
        for has_item in [false, true] {
            let shelf = Shelf::new();
            let run = killed(&shelf, 1);
            if has_item {
                fs::create_dir(run.join("01-cpu")).unwrap();
                fs::write(run.join("01-cpu/item.json"), "{}").unwrap();
            }
            break_it(&run);
            let expected = "is not closed and is left as it is because its journal holds no event now while the chain says that it \
                            began; restore it from a backup and start again; without one test its module again";
            assert_eq!(shelf.start(), [format!("{} {expected}", run_of(1))], "{has_item}");
            assert!(run.exists());
        }
    }
}

/// A list looks at the journal just when a start wants to seal the run. One that its station writes is left without a word.
#[test]
fn a_run_that_another_program_reads_is_named_and_sealed_later() {
    let shelf = Shelf::new();
    let run = killed(&shelf, 1);
    let journal = File::open(run.join(JOURNAL)).unwrap();
    journal.lock_shared().unwrap();
    let is_read = "is left to the next start because another program reads it at this moment";
    assert_eq!(shelf.start(), [format!("{} is not closed and {is_read}", run_of(1))]);
    journal.unlock().unwrap();
    journal.lock().unwrap();
    assert_eq!(shelf.start(), Vec::<String>::new());
    journal.unlock().unwrap();
    assert!(shelf.start()[0].contains("it is sealed as interrupted"));
    let ended = shelf.begun("SN-2", 2, None);
    let journal = File::open(ended.join(JOURNAL)).unwrap();
    journal.lock_shared().unwrap();
    assert_eq!(shelf.start(), [format!("{} is not closed and {is_read}", run_of(2))]);
    drop(journal);
    drop(shelf.start());
    // The folder of a run that never began.
    let folder = shelf.path().join(run_of(3));
    fs::create_dir_all(&folder).unwrap();
    let reads = File::open(&folder).unwrap();
    reads.lock_shared().unwrap();
    assert_eq!(shelf.start(), [format!("{} was cut off at its start and {is_read}", run_of(3))]);
    drop(reads);
    assert!(shelf.start().len() == 1 && !folder.exists());
}

/// A file of a sealed run that missed its line was changed: it does not get the line, and the start says why.
#[test]
fn a_run_that_was_changed_behind_its_digests_is_named() {
    let shelf = Shelf::new();
    shelf.close(&shelf.begun("SN-0", 2, None)).unwrap();
    let [chain, counter] = [shelf.path().join(DAY).join("CHAIN"), shelf.path().join("COUNTER")];
    for (number, events) in [(1, 1), (2, 2)] {
        let run = shelf.begun(&format!("SN-{number}"), events, None);
        if events == 1 {
            shelf.cut(&run);
        }
        let before = [fs::read(&chain).unwrap(), fs::read(&counter).unwrap()];
        assert_eq!(shelf.start().len(), 1);
        fs::write(&chain, &before[0]).unwrap();
        fs::write(&counter, &before[1]).unwrap();
        let log = fs::read(run.join("log.txt")).unwrap();
        fs::write(run.join("log.txt"), "passed").unwrap();
        let said = shelf.start();
        let how =
            if events == 1 { "was interrupted while the station sealed it and" } else { "ended, was not closed and" };
        let begin = format!("{} {how} is left as it is because it is not as it was sealed: log.txt ", run_of(number));
        let end = "; restore it from a backup; until then it is no pass";
        assert!(said.len() == 1 && said[0].starts_with(&begin) && said[0].ends_with(end), "{said:?}");
        assert_eq!(standing(&run).unwrap(), ChainStanding::Missing);
        fs::write(run.join("log.txt"), log).unwrap();
        assert_eq!(shelf.start().len(), 1);
    }
}

/// The `id` of the bench was changed: one line says how many runs wait for the old one, and the old one closes them.
#[test]
fn runs_of_a_renamed_station_are_counted() {
    let shelf = Shelf::new();
    killed(&shelf, 1);
    let start = || shelf.start_by("bench 2", BenchKind::Real, None);
    let of_one = "was begun as station bench 1 and is not closed while this bench file names bench 2; if this bench was renamed start it \
                  once with its old id so that the run is closed; until then it counts as interrupted";
    assert_eq!(start(), [format!("{} {of_one}", run_of(1))]);
    killed(&shelf, 2);
    shelf.begun("SN-3", 2, None);
    let of_all = "3 runs were begun as station bench 1 and are not closed while this bench file names bench 2 (the first is \
                  2026-11-28/SN-1/143000-functional); if this bench was renamed start it once with its old id so that they are \
                  closed; until then they count as interrupted";
    assert_eq!(start(), [of_all]);
    assert_eq!(reader::paths(shelf.path()).unwrap().iter().filter(|run| reader::is_sealed(run)).count(), 0);
    assert_eq!(shelf.start_by(STATION, BenchKind::Real, None).len(), 3);
    shelf.is_whole(3);
}

/// A thousand runs that stay do not fill the screen.
#[test]
fn the_lines_about_runs_that_stay_are_bounded() {
    let shelf = Shelf::new();
    for number in 1..=8 {
        let run = killed(&shelf, number);
        fs::write(run.join(JOURNAL), "").unwrap();
    }
    let said = shelf.start();
    assert_eq!(
        (said.len(), said[5].as_str()),
        (6, "3 runs more are left as they are; `gnc-station records verify` names each of them")
    );
    assert!(said[..5].iter().all(|line| line.contains("its journal holds no event now")), "{said:?}");
}

/// A passport was put into the folder of a killed run: it is removed before the run is sealed, and the start says so.
#[test]
fn papers_that_a_start_removes_are_named() {
    for events in [1, 2] {
        let shelf = Shelf::new();
        let run = shelf.begun("SN-1", events, None);
        if events == 1 {
            shelf.cut(&run);
        }
        for name in ["passport.json", "log.txt"] {
            fs::write(run.join(name), "PASSED").unwrap();
        }
        let said = shelf.start();
        let expected = "held files that a station makes only when it closes a run (passport.json log.txt) and they are removed; unless an \
                        earlier version of the station left them find out who put them there";
        assert_eq!((said.len(), &said[1]), (2, &format!("{} {expected}", run_of(1))), "{said:?}");
        assert!(!run.join("passport.json").exists() && fs::read_to_string(run.join("log.txt")).unwrap() != "PASSED");
        shelf.is_whole(1);
    }
}
