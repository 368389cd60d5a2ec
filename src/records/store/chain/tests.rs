//! Tests all kinds of changes to a folder of closed runs, and the messages about them.

use std::fs;
use std::path::{Path, PathBuf};

use super::entry::{ChainEntry, Kind};
use super::*;
use crate::store::{DIGESTS, digest};

/// A folder of records with so many closed runs, alternately on two days.
fn records(runs: usize) -> (tempfile::TempDir, Vec<PathBuf>) {
    let folder = tempfile::tempdir().expect("a folder");
    let runs = (0..runs).map(|run| close(folder.path(), run)).collect();
    (folder, runs)
}

fn close(records: &Path, run: usize) -> PathBuf {
    let day = if run.is_multiple_of(2) { "2026-11-21" } else { "2026-11-22" };
    let path = records.join(format!("{day}/SN-{run}/120000-functional"));
    fs::create_dir_all(&path).expect("a folder");
    fs::write(path.join(DIGESTS), format!("{run}  run.json\n")).expect("digests");
    append(&path).expect("a link");
    path
}

fn problems(records: &Path) -> Vec<String> {
    verify(records).expect("a folder").problems
}

fn check(problems: &[String], expected: &[&str]) {
    assert_eq!(problems.len(), expected.len(), "{problems:?}");
    for (problem, expected) in problems.iter().zip(expected) {
        assert!(problem.contains(expected), "{problem}");
    }
}

#[test]
fn runs_of_two_days_are_one_chain() {
    let (folder, _) = records(6);
    assert_eq!(verify(folder.path()).expect("a folder"), ChainCheck { runs: 6, first: 1, ..ChainCheck::default() });
}

/// The links, computed by another program: `printf '1 000.. DIGEST close STATION TIME RUN' | sha256sum`; a line of an earlier
/// version says neither station nor time.
#[test]
fn a_link_is_what_the_document_says() {
    let digest = "b5bb9d8014a0f9b1d61e21e796d78dccdf1352f23cd32812f4850b878ae4944c";
    let run = "2026-11-22/SN-1/120000-functional";
    let nothing = Place { number: 0, link: NOTHING.to_owned() };
    let at = "2026-11-22T12:00:07+08:00".parse().expect("a time");
    let late = LateClose { at: "2026-11-23T08:00:00+08:00".to_owned(), by: "gnc-station-1.2".to_owned() };
    let by = Scribe { station: "line 2%", at, key: None, late: None };
    let line = ChainEntry::new(&nothing, Kind::Close, digest, run, None, &by);
    assert_eq!(
        line.line(),
        format!(
            "1 {NOTHING} {digest} c14641e04828ce59e7c5e91fca88e5d17538e0a600499cbde84b34ed838aee35 close line%202%25 2026-11-22T12:00:07+08:00 {run}\n"
        )
    );
    let by = Scribe { late: Some(&late), ..by };
    let line = ChainEntry::new(&nothing, Kind::Close, digest, run, Some("2026-11-22/A/120000-functional"), &by);
    assert_eq!(line.link, "4ca248c51a20a71f071c301ee146926b16ba612204ced64508d9bb3ea81657db");
    let old = format!("1 {NOTHING} {digest} 98fc0d13d35717ee33a1c597a2a2541a3645d1baeda8e6c44bb46d846abedf50 {run}");
    assert!(ChainEntry::parse(&old).is_some_and(|line| line.is_true() && line.is_close() && line.stamp.is_none()));
    for other in
        [format!(" {old}"), format!("{old} "), old.replacen('1', "01", 1), format!("{old} from"), format!("{old} x")]
    {
        assert_eq!(ChainEntry::parse(&other), None, "{other}");
    }
    // The signature is no part of the link, so its form has to be held apart.
    let signed = |signature: &str| ChainEntry::parse(&format!("{old} sig {signature}"));
    assert!(signed("00af").is_some());
    assert!(["00AF", "00aF", "0xaf", "00ag"].iter().all(|other| signed(other).is_none()));
}

#[test]
fn a_run_that_was_changed_is_found() {
    let (folder, runs) = records(4);
    fs::write(runs[2].join(DIGESTS), "forged").expect("digests");
    check(&problems(folder.path()), &["SHA256SUMS was changed after the run was closed"]);
}

#[test]
fn a_run_that_was_removed_is_found() {
    let (folder, runs) = records(4);
    fs::remove_dir_all(&runs[1]).expect("a run");
    check(
        &problems(folder.path()),
        &["line 2 of the chain (2026-11-22/SN-1/120000-functional): the run was closed, and its folder is missing"],
    );
}

/// A run is removed with its line as well: the neighbours no longer fit.
#[test]
fn a_run_that_was_removed_with_its_line_is_found() {
    let (folder, runs) = records(4);
    fs::remove_dir_all(&runs[1]).expect("a run");
    let chain = folder.path().join("2026-11-22").join(CHAIN);
    let lines = fs::read_to_string(&chain).expect("a chain");
    let rest: String = lines.lines().skip(1).map(|line| format!("{line}\n")).collect();
    fs::write(&chain, rest).expect("a chain");
    check(&problems(folder.path()), &["line 2 of the chain is missing, between line 1"]);
}

#[test]
fn a_run_that_was_slipped_in_is_found() {
    let (folder, runs) = records(2);
    let forged = folder.path().join("2026-11-22/SN-9/130000-functional");
    fs::create_dir_all(&forged).expect("a folder");
    fs::copy(runs[1].join(DIGESTS), forged.join(DIGESTS)).expect("digests");
    check(&problems(folder.path()), &["SN-9/130000-functional is not in the chain"]);
}

#[test]
fn a_tail_that_was_cut_off_is_found() {
    let (folder, runs) = records(4);
    for run in &runs[2..] {
        fs::remove_dir_all(run).expect("a run");
    }
    for day in ["2026-11-21", "2026-11-22"] {
        let chain = folder.path().join(day).join(CHAIN);
        let first = fs::read_to_string(&chain).expect("a chain").lines().next().map(|line| format!("{line}\n"));
        fs::write(&chain, first.expect("a line")).expect("a chain");
    }
    check(
        &problems(folder.path()),
        &["COUNTER counts 4 lines, but the chain ends at line 2: the newest runs are missing"],
    );
    // The next run does not repair it.
    close(folder.path(), 6);
    assert!(!problems(folder.path()).is_empty());
}

#[test]
fn a_line_that_was_changed_is_found() {
    let (folder, _) = records(3);
    let chain = folder.path().join("2026-11-22").join(CHAIN);
    let forged = fs::read_to_string(&chain).expect("a chain").replace("SN-1", "SN-7");
    fs::write(&chain, forged).expect("a chain");
    let found = problems(folder.path());
    assert!(found.iter().any(|problem| problem.contains("): it was changed")), "{found:?}");
}

/// The power fails after the line and before the counter: the next run follows the line.
#[test]
fn a_power_cut_between_line_and_counter_is_no_forgery() {
    let (folder, _) = records(2);
    let counter = fs::read(folder.path().join(COUNTER)).expect("a counter");
    close(folder.path(), 2);
    fs::write(folder.path().join(COUNTER), counter).expect("a counter");
    let checked = verify(folder.path()).expect("a folder");
    check(&checked.problems, &[]);
    check(&checked.incomplete, &["COUNTER counts 2 lines, but the chain has 3"]);
    close(folder.path(), 3);
    assert_eq!(verify(folder.path()).expect("a folder"), ChainCheck { runs: 4, first: 1, ..ChainCheck::default() });
}

/// Old days are moved elsewhere: the rest is still consistent.
#[test]
fn a_chain_may_begin_later() {
    let folder = tempfile::tempdir().expect("a folder");
    for run in [0, 2, 1, 3] {
        close(folder.path(), run);
    }
    fs::remove_dir_all(folder.path().join("2026-11-21")).expect("a day");
    assert_eq!(verify(folder.path()).expect("a folder"), ChainCheck { runs: 2, first: 3, ..ChainCheck::default() });
}

#[test]
fn stations_that_close_at_once_take_turns() {
    let folder = tempfile::tempdir().expect("a folder");
    std::thread::scope(|scope| {
        for station in 0..4 {
            let records = folder.path();
            scope.spawn(move || (0..8).for_each(|run| drop(close(records, station * 100 + run))));
        }
    });
    assert_eq!(verify(folder.path()).expect("a folder"), ChainCheck { runs: 32, first: 1, ..ChainCheck::default() });
}

/// A run that was forged with its digests, its line forged with it, a line that was taken out, and records without a chain.
#[test]
fn one_run_is_looked_up() {
    let (folder, runs) = records(6);
    let standings = || runs.iter().map(|run| standing(run).expect("readable")).collect::<Vec<_>>();
    assert_eq!(standings(), [ChainStanding::Held; 6]);
    fs::write(runs[0].join(DIGESTS), "forged").expect("digests");
    assert_eq!((standings()[0], standings()[2]), (ChainStanding::Other, ChainStanding::Held));
    // The forger writes the line anew, with a link of its own.
    let rewrite = |run: &Path, day: &str, drop: bool| {
        let path = folder.path().join(day).join(CHAIN);
        let text = fs::read_to_string(&path).expect("a chain");
        let name = run.strip_prefix(folder.path()).expect("below").to_string_lossy().into_owned();
        let lines = text.lines().filter_map(ChainEntry::parse).filter(|link| !drop || link.run != name);
        let lines = lines.map(|link| match link.run == name {
            true => {
                let before = Place { number: link.number - 1, link: link.before };
                let digest = digest::of_file(&run.join(DIGESTS)).expect("digests");
                let at = "2026-11-22T12:00:07+08:00".parse().expect("a time");
                let by = Scribe { station: "test", at, key: None, late: None };
                ChainEntry::new(&before, Kind::Close, &digest, &name, None, &by)
            }
            false => link,
        });
        let text: String = lines.map(|link| link.line()).collect();
        fs::write(&path, text).expect("a chain");
    };
    rewrite(&runs[0], "2026-11-21", false);
    assert_eq!((standings()[0], standings()[1]), (ChainStanding::Other, ChainStanding::Held));
    // The counter remembers the last one.
    fs::write(runs[5].join(DIGESTS), "forged").expect("digests");
    rewrite(&runs[5], "2026-11-22", false);
    assert_eq!(standings()[5], ChainStanding::Other);
    rewrite(&runs[2], "2026-11-21", true);
    assert_eq!(standings()[2], ChainStanding::Missing);
    fs::remove_file(folder.path().join("2026-11-21").join(CHAIN)).expect("a chain");
    assert_eq!(standings()[4], ChainStanding::Missing);
    fs::remove_file(folder.path().join(COUNTER)).expect("a counter");
    assert_eq!(standings()[4], ChainStanding::NoChain);
}

/// A power cut leaves half a line. The next run stands on a line of its own, and the chain is whole again.
#[test]
fn half_a_line_does_not_swallow_the_next_run() {
    let (folder, runs) = records(2);
    let chain = runs[0].ancestors().nth(2).expect("a day").join(CHAIN);
    let mut text = fs::read_to_string(&chain).expect("a chain");
    text.push_str("3 abc");
    fs::write(&chain, text).expect("writable");
    assert_eq!(verify(folder.path()).expect("a folder").incomplete.len(), 1, "half a line is told");
    close(folder.path(), 2);
    assert_eq!(verify(folder.path()).expect("a folder"), ChainCheck { runs: 3, first: 1, ..ChainCheck::default() });
}

/// A station writes while others read: no reader sees half of what it writes, and none of them calls a line missing.
#[test]
fn a_reader_beside_a_writing_station_finds_nothing() {
    let (folder, _) = records(2);
    std::thread::scope(|scope| {
        let writer = scope.spawn(|| {
            for run in 2..200 {
                close(folder.path(), run);
            }
        });
        let mut looks = 0;
        while !writer.is_finished() || looks < 2 {
            let book = ChainBook::read(folder.path()).expect("a chain");
            let mut checked = ChainCheck::default();
            book.order(&mut checked.problems);
            book.counter(&mut checked);
            assert_eq!(checked, ChainCheck::default(), "look {looks}");
            assert!(book.broken.is_empty() && book.lines.len() >= 2, "look {looks}: {:?}", book.broken);
            looks += 1;
        }
        writer.join().expect("a station");
        assert_eq!(verify(folder.path()).expect("a chain").runs, 200);
    });
}

/// What a reader takes is of one moment, and a station that goes on meanwhile does not wait for the reader.
#[test]
fn a_snapshot_stays_as_it_was() {
    let (folder, _) = records(3);
    let snapshot = snapshot::Snapshot::take(folder.path()).expect("a folder");
    let other = snapshot::Snapshot::take(folder.path()).expect("another reader");
    close(folder.path(), 3);
    close(folder.path(), 4);
    for (snapshot, lines) in [(snapshot, [2, 1]), (other, [2, 1])] {
        let counts = snapshot.days().map(|day| snapshot.chain_of(day).expect("a chain").expect("lines").lines.len());
        assert_eq!(counts.collect::<Vec<_>>(), lines);
        assert_eq!(snapshot.counted.expect("a counter").expect("a number").number, 3);
    }
    let now = snapshot::Snapshot::take(folder.path()).expect("a folder");
    assert_eq!(now.counted.expect("a counter").expect("a number").number, 5);
}
