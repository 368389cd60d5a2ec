//! Attacks on a small folder of records that the real writer wrote with a key, and what is found of each: with nothing, with a
//! copy of `COUNTER`, with the number on the last paper, and with the public key. The attacker may write everything but the key.

mod forge;
mod quiet;
mod shelf;
mod strangers;

use std::fs;

use super::{Against, ChainBook, Head};
use forge::{CLOSE, Forge};
use shelf::Shelf;

/// What is found of an attack, as a reader sees it.
fn told(shelf: &Shelf) -> String {
    let modes: [(&str, bool, &[&Head]); 4] = [
        ("nothing", false, &[]),
        ("copy of COUNTER", false, &[&shelf.counter]),
        ("last paper", false, &[&shelf.paper]),
        ("key", true, &[]),
    ];
    let without = shelf.found(modes[0].1, modes[0].2);
    let mut text = String::new();
    for (mode, with_key, heads) in modes {
        let found = shelf.found(with_key, heads);
        // What is found with nothing is found in any case.
        let more: Vec<_> = found.iter().filter(|found| mode == "nothing" || !without.contains(found)).collect();
        assert!(without.iter().all(|problem| found.contains(problem)), "{mode}: {found:?}");
        text.push_str(&format!("{mode}: {}\n", if more.is_empty() { "no more" } else { "" }).replace(": \n", ":\n"));
        text.extend(more.iter().map(|problem| format!("    {problem}\n")));
    }
    text
}

#[track_caller]
fn check(name: &str, attack: impl FnOnce(&Shelf)) {
    let shelf = Shelf::new();
    assert_eq!(shelf.found(true, &[&shelf.counter, &shelf.paper]), Vec::<String>::new(), "before the attack");
    attack(&shelf);
    insta::assert_snapshot!(name, told(&shelf));
}

#[test]
fn a_sample_is_changed() {
    check("changed", |shelf| shelf.change_journal("2026-11-21/B/110000-functional"));
}

#[test]
fn a_failed_run_is_made_a_passed_one_with_its_digests() {
    check("changed_digests", |shelf| {
        shelf.change_journal("2026-11-21/B/110000-functional");
        shelf.make_digests("2026-11-21/B/110000-functional");
    });
}

#[test]
fn a_failed_run_is_made_a_passed_one_with_digests_and_chain() {
    check("changed_chain", |shelf| {
        shelf.change_journal("2026-11-21/B/110000-functional");
        shelf.make_digests("2026-11-21/B/110000-functional");
        Forge::read(shelf).redigest(shelf).write(shelf);
    });
}

#[test]
fn a_failed_run_is_removed() {
    check("removed", |shelf| shelf.remove("2026-11-21/B/110000-functional"));
}

#[test]
fn a_failed_run_is_removed_with_its_lines() {
    check("removed_lines", |shelf| {
        shelf.remove("2026-11-21/B/110000-functional");
        Forge::read(shelf).without("2026-11-21/B/").write_as_they_are(shelf);
    });
}

#[test]
fn a_failed_run_is_removed_and_the_chain_made_anew() {
    check("removed_chain", |shelf| {
        shelf.remove("2026-11-21/B/110000-functional");
        Forge::read(shelf).without("2026-11-21/B/").write(shelf);
    });
}

#[test]
fn the_same_without_any_signature() {
    check("removed_unsigned", |shelf| {
        shelf.remove("2026-11-21/B/110000-functional");
        Forge::read(shelf).without("2026-11-21/B/").unsigned().write(shelf);
    });
}

#[test]
fn two_modules_are_swapped() {
    check("swapped", |shelf| shelf.swap("2026-11-22/A", "2026-11-22/B"));
}

#[test]
fn two_modules_are_swapped_and_the_chain_made_anew() {
    check("swapped_chain", |shelf| {
        shelf.swap("2026-11-22/A", "2026-11-22/B");
        let forge = Forge::read(shelf);
        forge
            .renamed("2026-11-22/A/", "2026-11-22/X/")
            .renamed("2026-11-22/B/", "2026-11-22/A/")
            .renamed("2026-11-22/X/", "2026-11-22/B/")
            .write(shelf);
    });
}

/// A good run of another day is put where the last one stood.
#[test]
fn an_old_run_gets_a_new_number() {
    check("replayed", |shelf| {
        shelf.copy("2026-11-21/A/100000-functional", "2026-11-22/A/160000-functional");
        Forge::read(shelf).again("2026-11-21/A/100000-functional", "2026-11-22/A/160000-functional").write(shelf);
    });
}

#[test]
fn a_day_is_renamed() {
    check("day_renamed", |shelf| shelf.rename("2026-11-22", "2026-11-23"));
}

#[test]
fn a_day_is_renamed_and_the_chain_made_anew() {
    check("day_renamed_chain", |shelf| {
        shelf.rename("2026-11-22", "2026-11-23");
        Forge::read(shelf).renamed("2026-11-22/", "2026-11-23/").write(shelf);
    });
}

#[test]
fn a_run_is_put_on_a_day_before_the_first() {
    check("before_the_first", |shelf| {
        shelf.copy("2026-11-21/A/100000-functional", "2026-11-20/A/100000-functional");
    });
}

#[test]
fn a_folder_is_replaced_by_a_link() {
    check("link", |shelf| {
        shelf.rename("2026-11-21/A/100000-functional", "elsewhere");
        shelf.link("elsewhere", "2026-11-21/A/100000-functional");
    });
}

#[test]
fn the_newest_run_is_cut_off() {
    check("cut", |shelf| {
        shelf.remove("2026-11-22/B/150000-functional");
        Forge::read(shelf).without("2026-11-22/B/").write(shelf);
    });
}

#[test]
fn the_oldest_day_is_removed() {
    check("oldest_day", |shelf| shelf.remove("2026-11-21"));
}

/// The oldest run of a day goes with its lines, and the rest of the day stays.
#[test]
fn the_oldest_lines_are_removed() {
    check("oldest_lines", |shelf| {
        shelf.remove("2026-11-21/A");
        Forge::read(shelf).without("2026-11-21/A/").write_as_they_are(shelf);
    });
}

/// Old days are moved elsewhere, and number and link of their last line are kept.
#[test]
fn days_that_were_moved_have_a_witness() {
    let shelf = Shelf::new();
    let last = Forge::read(&shelf).keeping(|words| words[7].starts_with("2026-11-21/")).last();
    let head = |text: &str| Head { kept: "--head".to_owned(), place: super::Place::parse(text).unwrap() };
    shelf.remove("2026-11-21");
    assert_eq!(shelf.found(true, &[&head(&last), &shelf.counter]), Vec::<String>::new());
    let other = format!("4 {}", "0".repeat(64));
    let found = shelf.found(true, &[&head(&other)]);
    assert!(found.iter().any(|found| found.contains("nothing witnesses line 4 before it")), "{found:?}");
}

/// A station is killed at the first failure, and its run goes.
#[test]
fn a_run_that_began_is_removed() {
    check("began", |shelf| {
        let begun = shelf.begin("2026-11-22T16:00:00+08:00", "A");
        shelf.remove(&begun);
    });
}

#[test]
fn a_failed_run_is_called_one_of_another_module() {
    check("unassigned", |shelf| {
        shelf.rename("2026-11-21/B/110000-functional", "2026-11-21/_unassigned/110000-functional");
        let from = "2026-11-21/B/110000-functional";
        Forge::read(shelf).moved(from, "2026-11-21/_unassigned/110000-functional").write(shelf);
    });
}

#[test]
fn the_chain_is_removed() {
    check("no_chain", |shelf| {
        for file in ["2026-11-21/CHAIN", "2026-11-22/CHAIN", "COUNTER"] {
            shelf.remove(file);
        }
    });
}

#[test]
fn the_chain_of_a_day_is_removed() {
    check("no_chain_of_day", |shelf| shelf.remove("2026-11-22/CHAIN"));
}

#[test]
fn a_run_is_closed_twice() {
    check("closed_twice", |shelf| {
        Forge::read(shelf).again("2026-11-21/A/100000-functional", "2026-11-21/A/100000-functional").write(shelf);
    });
}

#[test]
fn the_line_of_a_beginning_is_removed() {
    check("no_beginning", |shelf| {
        Forge::read(shelf).keeping(|words| words[CLOSE] == "close" || !words[7].contains("11-22/A")).write(shelf);
    });
}

#[test]
fn a_day_is_copied_under_another_name() {
    check("copied_day", |shelf| {
        shelf.copy("2026-11-21/A/100000-functional", "2026-11-21 copy/A/100000-functional");
        shelf.copy("2026-11-21/A/100000-functional", "2026-1-5/A/100000-functional");
    });
}

/// No attack: a memory stick has no capital letters, and another system no colon and no tilde.
#[test]
fn names_are_folded_by_a_copy() {
    check("folded", |shelf| {
        shelf.rename("2026-11-22/B", "2026-11-22/b");
        shelf.rename("2026-11-21/B/110000-functional/plan", "2026-11-21/B/110000-functional/PLAN");
    });
}

/// A wrong clock is no attack. It is said, and nothing fails.
#[test]
fn a_clock_that_is_set_back_is_a_note() {
    let shelf = Shelf::new();
    shelf.run("2026-11-22T09:00:00+08:00", "C", "passed");
    assert_eq!(shelf.found(true, &[&shelf.counter, &shelf.paper]), Vec::<String>::new());
    assert_eq!(
        shelf.notes(),
        [
            "the clock was set back: line 9 of the chain (2026-11-22/C/090000-functional) is of 2026-11-22 09:00:00, and line 8 before it of 2026-11-22 15:00:09"
        ]
    );
}

/// Runs that began and were closed while there was no key are told, and a chain is no worse for them.
#[test]
fn a_key_that_came_later_is_a_note() {
    let shelf = Shelf::before_the_key();
    assert_eq!(shelf.found(true, &[]), Vec::<String>::new());
    assert_eq!(
        shelf.notes(),
        ["lines 1 to 4 of the chain are not signed: there was no key yet, or the signatures were taken away"]
    );
    // A later one without a signature is found.
    shelf.run_without_key("2026-11-22T16:00:00+08:00", "A", "passed");
    insta::assert_snapshot!("key_lost", shelf.found(true, &[]).join("\n"));
}

/// A run that goes on, and one whose station ended, are no holes.
#[test]
fn a_run_that_goes_on_is_no_hole() {
    let shelf = Shelf::new();
    let begun = shelf.begin("2026-11-22T16:00:00+08:00", "A");
    let checked = super::verify(shelf.path()).unwrap();
    assert_eq!((checked.runs, checked.problems), (4, Vec::new()));
    let place = super::place_of(&shelf.path().join(&begun)).unwrap().unwrap();
    assert_eq!(fs::read_to_string(shelf.path().join("COUNTER")).unwrap(), format!("{place}\n"));
}

/// The line of the beginning is on disk before the first event is said to be written. Where it cannot be written the run does not
/// begin, and its folder goes.
#[test]
fn a_run_whose_beginning_cannot_be_written_does_not_begin() {
    let shelf = Shelf::new();
    shelf.remove("2026-11-22/CHAIN");
    fs::create_dir(shelf.path().join("2026-11-22/CHAIN")).unwrap();
    let error = shelf.try_to_begin("2026-11-22T16:00:00+08:00", "C").unwrap_err();
    assert!(gnc_text::with_causes(&error).contains("CHAIN"), "{error}");
    assert!(!shelf.path().join("2026-11-22/C").exists(), "no half run is left");
}

/// `records verify RUN` looks at the lines of that run and at their neighbours.
#[test]
fn one_run_is_verified_with_its_lines() {
    let of = |shelf: &Shelf, run: &str| shelf.found_of(run);
    let runs = ["2026-11-21/A/100000-functional", "2026-11-22/A/140000-functional", "2026-11-22/B/150000-functional"];
    let shelf = Shelf::new();
    for run in runs {
        assert_eq!(of(&shelf, run), Vec::<String>::new());
    }
    shelf.remove("2026-11-21/B/110000-functional");
    Forge::read(&shelf).without("2026-11-21/B/").write_as_they_are(&shelf);
    let told = runs.map(|run| format!("{run}\n    {}\n", of(&shelf, run).join("\n    ")));
    insta::assert_snapshot!("one_run_beside_a_hole", told.concat());

    let shelf = Shelf::new();
    shelf.remove("2026-11-21/B/110000-functional");
    Forge::read(&shelf).without("2026-11-21/B/").write(&shelf);
    let told = runs.map(|run| format!("{run}\n    {}\n", of(&shelf, run).join("\n    ")));
    insta::assert_snapshot!("one_run_of_a_chain_made_anew", told.concat());
}

/// A run is changed with its lines and their neighbours, and the chain is broken further on: a line that was kept elsewhere does
/// not witness the run, though the line itself is as it was.
#[test]
fn a_witness_of_one_run_is_tied_to_it() {
    let run = "2026-11-21/B/110000-functional";
    let found = |shelf: &Shelf, head: &Head| {
        let run = shelf.path().join(run);
        let against = Against { keys: &[], heads: std::slice::from_ref(head) };
        ChainBook::read(shelf.path()).unwrap().of_run(&run, &against)
    };
    let shelf = Shelf::new();
    let early = Forge::read(&shelf).keeping(|words| words[0] == "2").last();
    let early = Head { kept: "early".to_owned(), place: super::Place::parse(&early).unwrap() };
    assert_eq!(found(&shelf, &shelf.counter), Vec::<String>::new());
    shelf.change_journal(run);
    shelf.make_digests(run);
    Forge::read(&shelf).redigest(&shelf).write_first(&shelf, 5);
    assert_eq!(
        found(&shelf, &shelf.counter),
        [format!(
            "counter.txt does not witness line 3 of the chain ({run}): the chain is broken at line 6 between the two"
        )]
    );
    // What was kept before the run says nothing of it.
    assert_eq!(found(&shelf, &early), Vec::<String>::new());
}

/// A run that was closed, or began, and whose folder is emptied did not "never begin".
#[test]
fn an_emptied_run_is_not_one_that_never_began() {
    let shelf = Shelf::new();
    let closed = "2026-11-21/B/110000-functional";
    let open = shelf.begin("2026-11-22T16:00:00+08:00", "A");
    let of = |name: &str| ChainBook::read(shelf.path()).unwrap().unlike_an_open_run(&shelf.path().join(name));
    assert_eq!(of(&open), None, "a run that goes on");
    for name in [closed, &open] {
        let run = shelf.path().join(name);
        for entry in fs::read_dir(&run).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_file()) {
            fs::remove_file(entry).unwrap();
        }
        fs::write(run.join("events.jsonl"), "").unwrap();
        assert!(crate::store::as_written::check(&run).never_begun);
    }
    assert_eq!(
        of(closed).unwrap(),
        format!("line 4 of the chain ({closed}): the run was closed, and its SHA256SUMS is missing")
    );
    assert_eq!(
        of(&open).unwrap(),
        format!("line 9 of the chain ({open}): the journal does not begin as it did when the run began")
    );
    assert_eq!(of("2026-11-22/A/170000-functional"), None);
}

/// A station is updated at noon: the runs of that morning have no lines, and are no finding of an update. With a key they are, since
/// nothing but a line tells when a run was made.
#[test]
fn runs_from_before_the_chain_are_a_note() {
    let shelf = Shelf::new();
    shelf.remove("2026-11-21/CHAIN");
    shelf.remove("2026-11-21/A");
    for file in ["2026-11-22/CHAIN", "COUNTER"] {
        shelf.remove(file);
    }
    shelf.run("2026-11-22T16:00:00+08:00", "C", "passed");
    let checked = super::verify(shelf.path()).unwrap();
    assert_eq!(checked.problems, Vec::<String>::new());
    assert_eq!(
        checked.notes,
        [
            "3 closed runs are older than the first line of the chain, so nothing shows when they were added; the first is 2026-11-21/B/110000-functional"
        ]
    );
    let found = shelf.found(true, &[]);
    assert!(found.len() == 3 && found.iter().all(|found| found.contains("is older than its first line")), "{found:?}");
    // One that is later than the first line was slipped in.
    shelf.rename("2026-11-22/A/140000-functional", "2026-11-22/A/170000-functional");
    let problems = super::verify(shelf.path()).unwrap().problems;
    assert!(problems.len() == 1 && problems[0].contains("or it was slipped in"), "{problems:?}");
}

/// Runs of a simulated bench have no key. They are told, and hide nothing: what was signed behind them keeps them in their place.
#[test]
fn simulated_runs_among_signed_ones_are_a_note() {
    let shelf = Shelf::new();
    shelf.simulated("2026-11-22T16:00:00+08:00", "A");
    shelf.run("2026-11-22T17:00:00+08:00", "A", "passed");
    assert_eq!(shelf.found(true, &[]), Vec::<String>::new());
    assert_eq!(
        shelf.notes(),
        ["2 lines of the chain are of simulated runs and not signed: a simulated bench has no key"]
    );
    shelf.remove("2026-11-22/A/160000-functional");
    Forge::read(&shelf).without("2026-11-22/A/16").write(&shelf);
    let found = shelf.found(true, &[]);
    assert!(found.iter().all(|found| found.contains("is not by this key")) && found.len() == 2, "{found:?}");
}

/// Each word and each byte of the lines counts: a byte changed in chains or counter is found, at each 61st place.
#[test]
fn each_byte_of_the_chain_counts() {
    let shelf = Shelf::new();
    for file in ["2026-11-21/CHAIN", "2026-11-22/CHAIN", "COUNTER"] {
        let path = shelf.path().join(file);
        let before = fs::read(&path).unwrap();
        for at in (0..before.len()).step_by(61) {
            let mut bytes = before.clone();
            bytes[at] = if bytes[at] == b'0' { b'1' } else { b'0' };
            fs::write(&path, &bytes).unwrap();
            assert!(!shelf.chain_found().is_empty(), "byte {at} of {file}");
        }
        fs::write(&path, &before).unwrap();
    }
    assert_eq!(shelf.chain_found(), Vec::<String>::new());
}

/// Lines say their numbers themselves, so what they say is the same in another order: it is a change all the same.
#[test]
fn the_order_of_the_lines_counts() {
    let shelf = Shelf::new();
    for day in ["2026-11-21", "2026-11-22"] {
        let path = shelf.path().join(day).join("CHAIN");
        let before = fs::read_to_string(&path).unwrap();
        let lines: Vec<&str> = before.split_inclusive('\n').collect();
        assert!(lines.len() > 1, "{day}");
        for at in 1..lines.len() {
            let mut swapped = lines.clone();
            swapped.swap(at - 1, at);
            fs::write(&path, swapped.concat()).unwrap();
            assert!(!shelf.chain_found().is_empty(), "line {at} of {day}");
        }
        fs::write(&path, &before).unwrap();
    }
}

/// A sentence about a line is shown to people, so no sign of a forged line may move their cursor.
#[test]
fn a_control_character_makes_a_line_one_of_no_chain() {
    let shelf = Shelf::new();
    let path = shelf.path().join("2026-11-21/CHAIN");
    let before = fs::read_to_string(&path).unwrap();
    for (name, forged) in
        [("2026-11-21/", "20\u{2}6-11-21/"), ("/A/", "/\u{1b}/"), ("-functional", "-functional\u{85}")]
    {
        assert!(before.contains(name), "{name}");
        fs::write(&path, before.replacen(name, forged, 1)).unwrap();
        let found = shelf.found(true, &[]);
        assert!(found.iter().any(|found| found.contains("1 line does not belong to a chain")), "{found:?}");
        assert!(!found.iter().any(|found| found.contains(char::is_control)), "{found:?}");
    }
}
