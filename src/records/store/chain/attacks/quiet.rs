//! Changes that were quiet: signatures that are taken away where no key is asked for, days that are moved alone, and chains that an
//! editor saved.

use super::*;

const FAILED: &str = "2026-11-21/B/110000-functional";

/// The file of the signature is gone or is none, and the line of the chain is signed.
#[test]
fn the_signature_of_a_run_is_removed() {
    check("sig_removed", |shelf| shelf.remove(&format!("{FAILED}/SHA256SUMS.sig")));
    check("sig_emptied", |shelf| fs::write(shelf.path().join(FAILED).join("SHA256SUMS.sig"), "").unwrap());
}

/// The signature of a line is gone, and that of the folder, or of the other line, is there.
#[test]
fn the_signature_of_a_line_is_removed() {
    check("line_unsigned", |shelf| {
        let is_close = |words: &[String]| words[CLOSE] == "close" && words[7] == FAILED;
        Forge::read(shelf).unsigned_where(is_close).write_as_they_are(shelf);
    });
    check("beginning_unsigned", |shelf| {
        let is_begin = |words: &[String]| words[CLOSE] == "begin" && words[7] == FAILED;
        Forge::read(shelf).unsigned_where(is_begin).write_as_they_are(shelf);
    });
}

/// All signatures of a run are gone. Without a key that is said and is no finding, since a station may have had no key for a while.
#[test]
fn all_signatures_of_a_run_are_removed() {
    let attack = |shelf: &Shelf| {
        shelf.remove(&format!("{FAILED}/SHA256SUMS.sig"));
        Forge::read(shelf).unsigned_where(|words| words[7] == FAILED).write_as_they_are(shelf);
    };
    check("run_unsigned", attack);
    let shelf = Shelf::new();
    attack(&shelf);
    assert_eq!(
        crate::store::chain::verify(shelf.path()).unwrap().notes,
        [
            "2 lines of the chain are not signed, and lines of the same station before and behind them are, the first is line 3 (2026-11-21/B/110000-functional): the station had no key for a while, or the signatures were taken away; with --key each of them is a finding"
        ]
    );
}

/// A key that came later, and simulated runs, contradict nothing.
#[test]
fn a_folder_with_and_without_signatures_may_be_as_it_was_written() {
    let shelf = Shelf::before_the_key();
    shelf.simulated("2026-11-22T16:00:00+08:00", "A");
    shelf.run("2026-11-22T17:00:00+08:00", "A", "passed");
    let checked = crate::store::chain::verify(shelf.path()).unwrap();
    assert_eq!((checked.problems, checked.notes, checked.signed), (Vec::new(), Vec::new(), 4));
}

/// Two stations write one folder, and the second one gets its key later: its lines from before are covered, and are told.
#[test]
fn each_station_may_get_its_key_at_another_time() {
    let shelf = Shelf::new();
    shelf.run_at("line 3", "2026-11-22T16:00:00+08:00", "C", false);
    assert!(shelf.found(true, &[]).iter().any(|found| found.contains("is not signed, and earlier ones are")));
    shelf.run_at("line 3", "2026-11-22T17:00:00+08:00", "C", true);
    assert_eq!(shelf.found(true, &[]), Vec::<String>::new());
    assert_eq!(
        shelf.notes(),
        [
            "2 lines of the station line%203 are not signed, and all of its lines behind them are: it had no key yet, or the signatures were taken away"
        ]
    );
    // Each has its own clock.
    shelf.run_at("line 4", "2026-11-22T08:00:00+08:00", "D", true);
    assert_eq!(shelf.notes().len(), 1, "{:?}", shelf.notes());
}

/// The folder of a day between others is moved away, and nothing is written anew.
#[test]
fn a_day_is_moved_away_alone() {
    check("day_moved", |shelf| {
        shelf.run("2026-11-23T09:00:00+08:00", "A", "passed");
        shelf.remove("2026-11-22");
    });
    check("newest_day_moved", |shelf| shelf.remove("2026-11-22"));
}

/// An editor of Windows saves a chain: each line ends otherwise. One finding, and nothing is said of the runs.
#[test]
fn a_chain_that_an_editor_saved_is_one_finding() {
    for mark in ["", "\u{feff}"] {
        let shelf = Shelf::new();
        let path = shelf.path().join("2026-11-22/CHAIN");
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, format!("{mark}{}", text.replace('\n', "\r\n"))).unwrap();
        assert_eq!(
            shelf.found(true, &[&shelf.counter, &shelf.paper]),
            [
                "chain: records/2026-11-22/CHAIN: 4 lines are as they were written but for their ends: an editor saved the file; restore it from a backup"
            ]
        );
    }
}

/// An editor of Windows saves the counter: that is one finding, too.
#[test]
fn a_counter_that_an_editor_saved_is_one_finding() {
    let shelf = Shelf::new();
    let path = shelf.path().join("COUNTER");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replace('\n', "\r\n")).unwrap();
    assert_eq!(
        shelf.found(true, &[]),
        ["chain: COUNTER is as it was written but for its end: an editor saved the file; restore it from a backup"]
    );
}

/// A second line closes a run that stands under this name, as if another one had been moved there.
#[test]
fn a_second_close_under_the_same_name_is_found() {
    check("closed_twice_from", |shelf| {
        Forge::read(shelf)
            .closed_again_from("2026-11-21/A/100000-functional", "2026-11-21/C/100000-functional")
            .write(shelf);
    });
}

/// A run with all of its files and without any line, whose folder is held as a station holds it.
#[test]
fn a_held_folder_is_no_run_that_goes_on() {
    let shelf = Shelf::new();
    let planted = "2026-11-22/C/160000-functional";
    shelf.copy("2026-11-22/A/140000-functional", planted);
    let held = fs::File::open(shelf.path().join(planted)).unwrap();
    held.lock().unwrap();
    let found = || crate::store::chain::verify(shelf.path()).unwrap().problems;
    assert!(
        found().iter().any(|found| found.starts_with(planted) && found.ends_with("or it was slipped in")),
        "{:?}",
        found()
    );
    fs::remove_file(shelf.path().join(planted).join("SHA256SUMS")).unwrap();
    let run = shelf.path().join(planted);
    assert!(crate::store::as_written::check(&run).running && !crate::store::may_begin(&run));
    let book = || ChainBook::read(shelf.path()).unwrap();
    assert_eq!(
        book().lacks_beginning(&run).unwrap(),
        format!(
            "{planted} is held as a run that goes on, and no line of the chain says that it began: it was put there"
        )
    );
    // One that a station begins now, and one that it has begun.
    let begun = shelf.path().join(shelf.begin("2026-11-22T16:30:00+08:00", "D"));
    assert_eq!(book().lacks_beginning(&begun), None);
    assert!(crate::store::may_begin(&begun));
}

/// A folder that never began holds its plan and parts of files, and nothing else.
#[test]
fn a_stranger_in_a_folder_without_a_run_is_found() {
    let shelf = Shelf::new();
    let run = shelf.path().join("2026-11-22/C/160000-functional");
    let files = [
        ("plan/01-functional.toml", true),
        ("plan/02-more.toml", true),
        ("run.json.part", true),
        ("events.jsonl", true),
        ("plan/notes.txt", false),
        ("plan/more/01-functional.toml", false),
        ("film.part", false),
        ("notes.txt", false),
    ];
    for (file, is_own) in files {
        fs::create_dir_all(run.join(file).parent().unwrap()).unwrap();
        fs::write(run.join(file), "").unwrap();
        let checked = crate::store::as_written::check(&run);
        assert_eq!(
            (checked.never_begun, checked.problems.is_empty()),
            (is_own, is_own),
            "{file}: {:?}",
            checked.problems
        );
        if !is_own {
            let problems = crate::store::as_written::check(&run).problems;
            assert_eq!(
                problems,
                [format!("no run began here, and 1 other file is in its folder, {file}: no station writes it there")]
            );
            fs::remove_file(run.join(file)).unwrap();
        }
    }
}

/// Files of file managers in a closed run are told apart from a change, and only if nothing else is wrong.
#[test]
fn files_of_a_file_manager_are_told_apart() {
    let shelf = Shelf::new();
    let run = shelf.path().join(FAILED);
    let litter = [".DS_Store", "Thumbs.db", "desktop.ini", "plan/._01-functional.toml"];
    for file in litter {
        fs::write(run.join(file), "x").unwrap();
    }
    let checked = crate::store::as_written::check(&run);
    assert!(checked.only_litter);
    assert_eq!(
        checked.problems,
        litter.map(|file| format!(
            "{file} was added, perhaps by a file manager: all files that the station wrote are as they were; remove it and verify again"
        ))
    );
    fs::write(run.join("log.txt"), "x").unwrap();
    let checked = crate::store::as_written::check(&run);
    assert!(
        !checked.only_litter && checked.problems.contains(&".DS_Store was added".to_owned()),
        "{:?}",
        checked.problems
    );
}

/// Folders that file servers and systems make beside the runs are neither modules nor runs, and no change of the records. What has such a
/// name and is none, and what has another name, is told as before.
#[test]
fn folders_of_a_file_server_are_told_apart() {
    let shelf = Shelf::new();
    let runs = crate::store::reader::paths(shelf.path()).unwrap();
    let made = ["2026-11-21/@eaDir", "2026-11-21/B/@eaDir", "2026-11-21/B/.Trash-1000"];
    let tops = [".Trash-1000/files", "$RECYCLE.BIN/S-1", "System Volume Information", ".Spotlight-V100", ".fseventsd"];
    for folder in made.iter().chain(&tops) {
        fs::create_dir_all(shelf.path().join(folder).join("110000-functional@SynoEAStream")).unwrap();
    }
    // A run that a person threw away and that the chain does not name.
    fs::write(shelf.path().join(".Trash-1000/files/110000-functional@SynoEAStream/events.jsonl"), "{}\n").unwrap();
    assert_eq!(crate::store::reader::paths(shelf.path()).unwrap(), runs);
    let checked = crate::store::chain::verify(shelf.path()).unwrap();
    assert_eq!(checked.problems, Vec::<String>::new());
    let mut litter: Vec<String> =
        checked.litter.iter().map(|told| told.split(" is ").next().unwrap().to_owned()).collect();
    litter.sort();
    let mut expected = made.to_vec();
    expected.sort_unstable();
    assert!(litter.iter().zip(&expected).all(|(told, folder)| told.ends_with(folder)), "{litter:?}");
    assert_eq!(litter.len(), expected.len());
    std::os::unix::fs::symlink("A", shelf.path().join("2026-11-21/.elsewhere")).unwrap();
    fs::write(shelf.path().join("2026-11-21/B/log.txt"), "x").unwrap();
    assert_eq!(crate::store::chain::verify(shelf.path()).unwrap().problems.len(), 2);
}

/// What is there and cannot be read is not called missing.
#[test]
fn a_signature_that_cannot_be_read_is_not_missing() {
    let shelf = Shelf::new();
    let signature = shelf.path().join(FAILED).join("SHA256SUMS.sig");
    fs::remove_file(&signature).unwrap();
    fs::create_dir(&signature).unwrap();
    let found = shelf.found(true, &[]);
    assert!(
        found.iter().any(|found| found.contains("cannot read records/2026-11-21/B/110000-functional/SHA256SUMS.sig")),
        "{found:?}"
    );
    assert!(!found.iter().any(|found| found.contains("missing")), "{found:?}");
}

/// One module is asked for: what the chain names of it, and is gone or has another name, is found, and what is missing of any module.
#[test]
fn a_module_is_verified_with_its_lines() {
    let of = |shelf: &Shelf, named: &str| {
        ChainBook::read(shelf.path()).unwrap().of_named(named).map(|checked| checked.problems)
    };
    let shelf = Shelf::new();
    assert_eq!((of(&shelf, "A"), of(&shelf, "B"), of(&shelf, "C")), (Some(Vec::new()), Some(Vec::new()), None));
    shelf.rename(FAILED, "2026-11-21/X/110000-functional");
    let gone = vec![format!("line 4 of the chain ({FAILED}): the run was closed, and its folder is missing")];
    assert_eq!((of(&shelf, "B"), of(&shelf, FAILED)), (Some(gone.clone()), Some(gone)));
    assert_eq!(of(&shelf, "A"), Some(Vec::new()));
    let begun = shelf.begin("2026-11-22T16:00:00+08:00", "C");
    shelf.remove(&begun);
    assert_eq!(
        of(&shelf, "C"),
        Some(vec![format!("line 9 of the chain ({begun}): the run began, and its folder is gone")])
    );
    // Its lines go as well.
    Forge::read(&shelf).without("2026-11-21/B/").write_as_they_are(&shelf);
    let missing = "lines 3 to 4 of the chain are missing";
    assert!(of(&shelf, "A").is_some_and(|found| found.iter().any(|found| found.starts_with(missing))));
}
