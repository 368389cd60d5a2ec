//! What stands in a records folder and no station put there: copies of whole runs, files beside the runs of one module, runs of another
//! module.

use std::fs;

use super::shelf::Shelf;
use crate::store::chain::{ChainBook, verify};
use crate::store::{as_written, reader};

const RUN: &str = "2026-11-21/A/100000-functional";

/// A copy of a run outside of all days is one finding, or one note if it stands deeper than runs do.
#[test]
fn copies_of_runs_are_found_wherever_they_stand() {
    let found = |shelf: &Shelf| verify(shelf.path()).unwrap().problems;
    for (to, told) in [
        ("backup", "backup is the folder of a run and stands in no day"),
        ("backup/100000-functional", "backup holds runs, and its name is not that of a day (YYYY-MM-DD)"),
        ("backup/A/100000-functional", "backup holds runs, and its name is not that of a day (YYYY-MM-DD)"),
    ] {
        let shelf = Shelf::new();
        shelf.copy(RUN, to);
        assert_eq!(found(&shelf), [told]);
        // One finding for each such folder, whatever it holds besides.
        shelf.copy("2026-11-21", &format!("{}/more/2026-11-21", to.split('/').next().unwrap()));
        assert_eq!(found(&shelf).len(), 1, "{to}");
    }
    // No reader takes what stands deeper for runs of these records: a backup or the records of another station.
    for to in ["backup/2026-11-21/A/100000-functional", "a/b/c/d/2026-11-21/A/100000-functional"] {
        let shelf = Shelf::new();
        shelf.copy(RUN, to);
        let checked = verify(shelf.path()).unwrap();
        let top = to.split('/').next().unwrap();
        let told =
            format!("{top} is no day and holds copies of runs or records of another folder of which the first is {to}");
        assert_eq!((checked.problems, checked.notes), (Vec::new(), vec![told]));
    }
    // Beside the runs of a day a copy is a run that the chain does not name, or no run at all.
    for to in ["2026-11-21/A/old", "2026-11-21/A/old/100000-functional", "2026-11-21/old/A/100000-functional"] {
        let shelf = Shelf::new();
        shelf.copy(RUN, to);
        assert!(!shelf.found(false, &[]).is_empty(), "{to}");
    }
}

/// Other folders of a disk are none of the records. One that is huge is not walked without end, and that is said.
#[test]
fn other_folders_are_left_alone() {
    let shelf = Shelf::new();
    let other = shelf.path().join("software/release/1.0/linux");
    fs::create_dir_all(&other).unwrap();
    for file in ["SHA256SUMS", "readme.txt"] {
        fs::write(other.join(file), "x").unwrap();
    }
    std::os::unix::fs::symlink(shelf.path(), other.join("records")).unwrap();
    let checked = verify(shelf.path()).unwrap();
    assert_eq!((checked.problems, checked.notes), (Vec::new(), Vec::new()));
    for number in 0..=super::super::copies::MAX_LOOKED {
        fs::hard_link(other.join("readme.txt"), other.join(number.to_string())).unwrap();
    }
    shelf.copy(RUN, "software/release/1.0/linux/more/2026-11-21/A/100000-functional");
    let checked = verify(shelf.path()).unwrap();
    let said =
        "software holds more than 20000 files and folders so that not all of them were looked at for copies of runs";
    assert_eq!((checked.problems, checked.notes), (Vec::new(), vec![said.to_owned()]));
}

/// One module is asked for: files, links and folders of file servers among its runs are named, and those of others are not.
#[test]
fn strangers_among_the_runs_of_a_module_are_found() {
    let shelf = Shelf::new();
    let of = |named: &str| ChainBook::read(shelf.path()).unwrap().of_named(named);
    fs::write(shelf.path().join("2026-11-22/A/CHAIN"), "x").unwrap();
    fs::write(shelf.path().join("2026-11-21/A/notes.txt"), "x").unwrap();
    shelf.link("2026-11-21/B/110000-functional", "2026-11-22/A/110000-functional");
    fs::create_dir(shelf.path().join("2026-11-22/A/@eaDir")).unwrap();
    let checked = of("A").unwrap();
    assert_eq!(
        checked.problems,
        [
            "2026-11-21/A/notes.txt was added: no station writes it there",
            "2026-11-22/A/110000-functional is a link: what it leads to is no part of these records",
            "2026-11-22/A/CHAIN was added: no station writes it there",
        ]
    );
    assert_eq!(checked.litter.len(), 1, "{:?}", checked.litter);
    assert_eq!(of("B").unwrap().problems, Vec::<String>::new());
    // A number of which no line tells.
    assert_eq!(of("C"), None);
    fs::write(shelf.path().join("2026-11-22/C"), "x").unwrap();
    assert_eq!(of("C").unwrap().problems, ["2026-11-22/C was added: no station writes it there"]);
}

/// A run that was killed is moved to the folder of another module: it is no run of that one that the next start mends.
#[test]
fn a_killed_run_in_the_folder_of_another_module_is_found() {
    let shelf = Shelf::new();
    let killed = shelf.begin("2026-11-22T16:00:00+08:00", "C");
    let told = |run: &str| {
        let checked = as_written::check(&shelf.path().join(run));
        (checked.incomplete.is_some(), checked.problems)
    };
    assert_eq!(told(&killed), (true, Vec::new()));
    assert_eq!(reader::moved_among(shelf.path(), "C"), Vec::<std::path::PathBuf>::new());
    for (to, problem) in [
        (
            "2026-11-22/A/160000-functional",
            "the journal names the serial number \"C\", and the folder is not that of its module",
        ),
        ("2026-11-22/C/160000-other", "the journal names the plan \"functional\", and the folder another one"),
        (
            "2026-11-21/C/160000-functional",
            "the journal begins at 2026-11-22 16:00:00, and the folder names another day or time",
        ),
    ] {
        shelf.rename(&killed, to);
        assert_eq!(told(to), (true, vec![problem.to_owned()]));
        let moved = reader::moved_among(shelf.path(), "A");
        assert_eq!(moved.len(), usize::from(to.contains("/A/")), "{moved:?}");
        shelf.rename(to, &killed);
    }
}

/// Folders that hold nothing are added: in a closed run, as a module, as a run and as a day. One that a sudden end may have left is told as
/// such, until each station began a run later.
#[test]
fn folders_that_hold_nothing_are_found() {
    let shelf = Shelf::new();
    let make = |folder: &str| fs::create_dir_all(shelf.path().join(folder)).unwrap();
    let left = |name: &str| {
        format!(
            "{name} holds no run, and each station began one later, whose start removes such folders: it was added, or could not be removed"
        )
    };
    let whole = shelf.path().join(RUN);
    make(&format!("{RUN}/empty/deeper"));
    assert_eq!(as_written::check(&whole).problems, ["empty/deeper was added"]);
    assert_eq!(as_written::changes(&whole), Vec::<String>::new());
    fs::remove_dir_all(whole.join("empty")).unwrap();
    make(&format!("{RUN}/.Trash-1000"));
    assert!(as_written::check(&whole).only_litter);
    fs::remove_dir(whole.join(".Trash-1000")).unwrap();

    for old in ["2026-11-21/x", "2026-11-20"] {
        make(old);
        let checked = verify(shelf.path()).unwrap();
        assert_eq!((checked.problems, checked.incomplete), (vec![left(old)], Vec::new()));
        fs::remove_dir(shelf.path().join(old)).unwrap();
    }
    make("2026-11-22/x");
    let checked = verify(shelf.path()).unwrap();
    let told = "2026-11-22/x holds no run: its station ended, or could not write, before a run began there; the next start removes it";
    assert_eq!((checked.problems, checked.incomplete), (Vec::new(), vec![told.to_owned()]));

    let of = |run: &str| ChainBook::read(shelf.path()).unwrap().unlike_a_cut_off_run(&shelf.path().join(run));
    assert_eq!(of("2026-11-21/S-9/101010-first"), Some(left("2026-11-21/S-9/101010-first")));
    assert_eq!(of("2026-11-22/A/plan").unwrap(), "2026-11-22/A/plan was added: no station writes it there");
    assert_eq!(of("2026-11-22/S-9/235959-first"), None);
    // A start takes away what it may.
    super::super::remove_empty(shelf.path());
    assert!(!shelf.path().join("2026-11-22/x").exists() && whole.exists());
    assert_eq!(verify(shelf.path()).unwrap().incomplete, Vec::<String>::new());
}

/// Beside the chain of a day stands what a start removed of it, and beside the counter its part. Other names are those of strangers.
#[test]
fn only_files_of_the_chain_itself_have_its_name() {
    let shelf = Shelf::new();
    for file in ["2026-11-21/CHAIN.torn", "COUNTER.part"] {
        fs::write(shelf.path().join(file), "x").unwrap();
    }
    assert_eq!(verify(shelf.path()).unwrap().problems, Vec::<String>::new());
    for file in ["2026-11-21/CHAIN.old", "COUNTER.kept"] {
        fs::write(shelf.path().join(file), "x").unwrap();
        let told = format!("{file} was added: no station writes it there");
        assert_eq!(verify(shelf.path()).unwrap().problems, [told]);
        fs::remove_file(shelf.path().join(file)).unwrap();
    }
}
