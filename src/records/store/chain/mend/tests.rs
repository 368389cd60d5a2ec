//! What a sudden end or a disk error leaves of chain and counter, and what must stay as it is.

use std::path::PathBuf;
use std::time::Duration;

use super::*;
use crate::store::chain::append::lock_within;
use crate::store::chain::{append, verify};
use crate::store::{DIGESTS, chain};

const DAY: &str = "2026-11-28";

struct Shelf(tempfile::TempDir);

impl Shelf {
    /// Records of so many closed runs.
    fn of(runs: u64) -> Self {
        let shelf = Self(tempfile::tempdir().unwrap());
        (1..=runs).for_each(|run| shelf.close(DAY, run).unwrap());
        shelf
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn close(&self, day: &str, run: u64) -> Result<(), StoreError> {
        let path = self.path().join(day).join(format!("SN-{run}/120000-x"));
        fs::create_dir_all(&path).unwrap();
        fs::write(path.join(DIGESTS), format!("{run}")).unwrap();
        append(&path)
    }

    fn counter(&self) -> PathBuf {
        self.path().join(COUNTER)
    }

    fn counted(&self) -> Option<String> {
        fs::read_to_string(self.counter()).ok()
    }

    fn chain(&self) -> PathBuf {
        self.path().join(DAY).join(CHAIN)
    }

    /// Mends the chain, and all of it is whole then; a second start has nothing to say.
    #[track_caller]
    fn mended(&self, said: &[&str]) {
        assert_eq!(mend(self.path()).unwrap(), said);
        assert_eq!(mend(self.path()).unwrap(), Vec::<String>::new());
        assert_eq!(verify(self.path()).unwrap().problems, Vec::<String>::new());
    }
}

#[test]
fn half_a_line_is_removed_in_each_day() {
    let shelf = Shelf::of(2);
    let whole = fs::read(shelf.chain()).unwrap();
    shelf.close("2026-11-30", 3).unwrap();
    for half in [&b"3 ab"[..], &[0; 300], b"3 \xff\xfe"] {
        fs::write(shelf.chain(), [&whole, half].concat()).unwrap();
        let checked = verify(shelf.path()).unwrap();
        assert_eq!((checked.problems, checked.incomplete.len()), (Vec::new(), 1));
        let is_blank = half.iter().all(|byte| *byte == 0);
        let done = if is_blank { "removed" } else { "moved to CHAIN.torn beside it" };
        shelf.mended(&[&format!(
            "the chain of 2026-11-28 ended with half a line, as a sudden end leaves it; it is {done}"
        )]);
        assert_eq!(fs::read(shelf.chain()).unwrap(), whole);
    }
    // All of them are kept.
    let kept = fs::read(shelf.chain().with_extension("torn")).unwrap();
    assert_eq!(kept, b"3 ab\n3 \xff\xfe\n");
}

/// A person takes the end of a line away, and the line stays: of the first, a middle and the last day, when a run begins and at a
/// start.
#[test]
fn a_whole_line_without_its_end_stays() {
    let said = |day: &str| {
        format!("the last line of the chain of {day} lacked its end, and fits all others; it has its end again")
    };
    for at in 0..3 {
        let shelf = Shelf::of(0);
        let days = ["2026-11-26", "2026-11-27", DAY];
        for (run, day) in days.iter().enumerate() {
            shelf.close(day, run as u64).unwrap();
        }
        let chain = shelf.path().join(days[at]).join(CHAIN);
        let whole = fs::read(&chain).unwrap();
        fs::write(&chain, &whole[..whole.len() - 1]).unwrap();
        shelf.mended(&[&said(days[at])]);
        assert_eq!(fs::read(&chain).unwrap(), whole);
        // The next line begins behind it.
        fs::write(&chain, &whole[..whole.len() - 1]).unwrap();
        shelf.close(days[at], 9).unwrap();
        assert!(fs::read(&chain).unwrap().starts_with(&whole));
        shelf.mended(&[]);
    }
    // A line that does not fit is half a line, whatever it says.
    let shelf = Shelf::of(2);
    let whole = fs::read_to_string(shelf.chain()).unwrap();
    let first = whole.lines().next().unwrap();
    fs::write(shelf.chain(), format!("{whole}{first}")).unwrap();
    shelf.mended(&[
        "the chain of 2026-11-28 ended with half a line, as a sudden end leaves it; it is moved to CHAIN.torn beside it",
    ]);
}

/// The link covers no signature, so that half of one does not show in it.
#[test]
fn a_line_that_was_cut_in_its_signature_is_half_a_line() {
    let folder = tempfile::tempdir().unwrap();
    crate::store::StationKey::create(&folder.path().join("key")).unwrap();
    let key = crate::store::StationKey::read(&folder.path().join("key")).unwrap();
    let at = chrono::DateTime::UNIX_EPOCH.fixed_offset();
    let shelf = Shelf::of(0);
    let close = |run: u64, key| {
        let path = shelf.path().join(DAY).join(format!("SN-{run}/120000-x"));
        fs::create_dir_all(&path).unwrap();
        fs::write(path.join(DIGESTS), format!("{run}")).unwrap();
        chain::append_as(&path, &chain::Scribe { station: "test", at, key, late: None }).unwrap();
    };
    close(1, Some(&key));
    let (counter, first) = (shelf.counted().unwrap(), fs::read_to_string(shelf.chain()).unwrap());
    close(2, Some(&key));
    let whole = fs::read_to_string(shelf.chain()).unwrap();
    let behind_name = whole.rfind(" sig ").unwrap();
    for length in [behind_name, behind_name + 30, whole.len() - 2] {
        fs::write(shelf.counter(), &counter).unwrap();
        fs::write(shelf.chain(), &whole[..length]).unwrap();
        assert_eq!(mend(shelf.path()).unwrap().len(), 1);
        assert_eq!(fs::read_to_string(shelf.chain()).unwrap(), first, "{length}");
    }
    fs::write(shelf.chain(), &whole[..whole.len() - 1]).unwrap();
    assert!(mend(shelf.path()).unwrap().iter().any(|said| said.contains("it has its end again")));
    assert_eq!(fs::read_to_string(shelf.chain()).unwrap(), whole);
}

/// An error that could not be undone says so.
#[test]
fn a_line_that_cannot_be_taken_back_is_named() {
    let error = || on::<()>(Err(std::io::ErrorKind::StorageFull.into()), "write", Path::new("CHAIN")).unwrap_err();
    let stands = crate::store::chain::append::taken_back(error(), &Err(std::io::ErrorKind::Other.into()));
    assert!(gnc_text::with_causes(&stands).starts_with("its line may stand in the chain: cannot write CHAIN"));
    assert_eq!(stands.try_this(), error().try_this());
    let back = crate::store::chain::append::taken_back(error(), &Ok(()));
    assert!(matches!(back, StoreError::File { .. }));
}

/// The clock was set back, and a kill came before the counter: the number of that line is not given a second time.
#[test]
fn a_line_in_an_old_day_that_was_not_counted_keeps_its_number() {
    let shelf = Shelf::of(0);
    for day in 1..=5 {
        shelf.close(&format!("2026-12-0{day}"), day).unwrap();
    }
    let counter = shelf.counted().unwrap();
    shelf.close("2026-11-01", 6).unwrap();
    fs::write(shelf.counter(), counter).unwrap();
    shelf.mended(&["COUNTER stood at line 5 and the chain ends at line 6, as a sudden end leaves it; it is mended"]);
    shelf.close("2026-12-05", 7).unwrap();
    shelf.mended(&[]);
}

#[test]
fn a_counter_behind_the_chain_is_mended() {
    let shelf = Shelf::of(3);
    let newest = shelf.counted();
    let older = Shelf::of(1).counted().unwrap();
    fs::write(shelf.counter(), older).unwrap();
    shelf.mended(&["COUNTER stood at line 1 and the chain ends at line 3, as a sudden end leaves it; it is mended"]);
    assert_eq!(shelf.counted(), newest);
    for garbage in ["", "3", "\0\0\0\0", "3 abc", "-1 00", "99999999999999999999 0"] {
        fs::write(shelf.counter(), garbage).unwrap();
        // A power cut leaves nothing or zeros; anything else was written by a person.
        let checked = verify(shelf.path()).unwrap();
        let is_blank = garbage.trim_matches('\0').is_empty();
        assert_eq!((checked.problems.is_empty(), checked.incomplete.len()), (is_blank, usize::from(is_blank)));
        shelf.mended(&["COUNTER held no number and link; it is made again from the chain, which ends at line 3"]);
        assert_eq!(shelf.counted(), newest, "{garbage:?}");
    }
    fs::remove_file(shelf.counter()).unwrap();
    shelf.mended(&["COUNTER was missing; it is made again from the chain, which ends at line 3"]);
    assert_eq!(shelf.counted(), newest);
}

#[test]
fn a_counter_that_nobody_can_read_does_not_stop_a_run() {
    let shelf = Shelf::of(2);
    fs::write(shelf.counter(), "").unwrap();
    shelf.close(DAY, 3).unwrap();
    assert_eq!(verify(shelf.path()).unwrap().runs, 3);
    shelf.mended(&[]);
}

#[test]
fn a_counter_without_any_chain_is_removed_if_it_says_nothing() {
    let shelf = Shelf::of(0);
    fs::write(shelf.counter(), "").unwrap();
    shelf.mended(&["COUNTER held no number and link, and there is no chain; it is removed"]);
    assert_eq!(shelf.counted(), None);
}

/// The clock was set back: the last line stands in an older day than many others.
#[test]
fn the_last_line_may_stand_in_an_old_day() {
    let shelf = Shelf::of(0);
    for day in 1..=5 {
        shelf.close(&format!("2026-12-0{day}"), day).unwrap();
    }
    shelf.close("2026-11-01", 6).unwrap();
    shelf.mended(&[]);
}

#[test]
fn a_tail_that_was_cut_off_stays_cut_off() {
    let shelf = Shelf::of(3);
    let counter = shelf.counted();
    let chain = fs::read_to_string(shelf.chain()).unwrap();
    let first = chain.split_inclusive('\n').next().unwrap();
    fs::write(shelf.chain(), first).unwrap();
    let said = mend(shelf.path()).unwrap();
    assert_eq!(
        said,
        ["COUNTER stands at line 3, but the chain ends at line 1: the newest lines are missing; \
          `gnc-station records verify` tells more"]
    );
    assert_eq!((shelf.counted(), fs::read_to_string(shelf.chain()).unwrap()), (counter, first.to_owned()));
    assert!(!verify(shelf.path()).unwrap().problems.is_empty());
}

#[test]
fn a_number_never_wraps() {
    let shelf = Shelf::of(1);
    fs::write(shelf.counter(), format!("{} {}\n", u64::MAX, "0".repeat(64))).unwrap();
    let chain = fs::read(shelf.chain()).unwrap();
    let error = gnc_text::with_causes(&shelf.close(DAY, 2).unwrap_err());
    assert!(error.contains("says the highest number that there is, so it was changed"), "{error}");
    assert_eq!(fs::read(shelf.chain()).unwrap(), chain);
    assert!(verify(shelf.path()).is_ok() && mend(shelf.path()).unwrap().len() == 1);
}

#[test]
fn what_a_write_of_the_counter_left_goes() {
    let shelf = Shelf::of(1);
    let part = shelf.path().join("COUNTER.part");
    fs::write(&part, "2 0").unwrap();
    shelf.mended(&[]);
    assert!(!part.exists());
    fs::create_dir(&part).unwrap();
    shelf.mended(&["an empty folder COUNTER.part was in the way; it is removed"]);
    // A folder with something in it is of a person.
    fs::create_dir_all(part.join("x")).unwrap();
    assert!(mend(shelf.path()).is_err() && part.join("x").exists());
}

/// A folder in the way of the counter is seen when a run begins, and changes nothing of one that is closed.
#[test]
fn the_line_closes_a_run_and_the_counter_follows() {
    let shelf = Shelf::of(1);
    let part = shelf.path().join("COUNTER.part");
    fs::create_dir(&part).unwrap();
    shelf.close(DAY, 2).unwrap();
    assert_eq!(verify(shelf.path()).unwrap().runs, 2);
    let run = shelf.path().join(DAY).join("SN-3/120000-x");
    fs::create_dir_all(&run).unwrap();
    fs::write(run.join(crate::store::JOURNAL), "{}\n").unwrap();
    let at = chrono::DateTime::UNIX_EPOCH.fixed_offset();
    let by = chain::Scribe { station: "test", at, key: None, late: None };
    let text = fs::read(shelf.chain()).unwrap();
    assert!(chain::begin(&run, &by).is_err());
    assert_eq!(fs::read(shelf.chain()).unwrap(), text, "its line is taken back");
    shelf.mended(&[
        "an empty folder COUNTER.part was in the way; it is removed",
        "COUNTER stood at line 1 and the chain ends at line 2, as a sudden end leaves it; it is mended",
    ]);
}

#[test]
fn whether_a_run_can_be_closed_is_tried_without_a_trace() {
    let shelf = Shelf::of(1);
    let names = || {
        let mut names: Vec<_> = fs::read_dir(shelf.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        (names, shelf.counted(), fs::read(shelf.chain()).unwrap())
    };
    let before = names();
    chain::try_out(shelf.path()).unwrap();
    assert_eq!(names(), before);
    fs::create_dir(shelf.path().join("COUNTER.part")).unwrap();
    assert!(chain::try_out(shelf.path()).is_err());
    fs::remove_dir(shelf.path().join("COUNTER.part")).unwrap();
    fs::remove_file(shelf.chain()).unwrap();
    fs::create_dir(shelf.chain()).unwrap();
    assert!(chain::try_out(shelf.path()).is_err());
}

/// Another program holds the lock of the folder for a long time.
#[test]
fn a_lock_that_is_held_is_named() {
    let shelf = Shelf::of(1);
    let held = lock(shelf.path()).unwrap();
    let error = lock_within(shelf.path(), Duration::ZERO).unwrap_err();
    assert!(gnc_text::with_causes(&error).contains("another program holds it for more than 0 s"), "{error}");
    assert!(error.try_this().contains("end the program that holds the records folder"));
    drop(held);
    shelf.close(DAY, 2).unwrap();
}
