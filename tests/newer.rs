//! Records of other versions of the station. Those of a later version are not called damaged and not judged; those of
//! an earlier version mean today what they are.

#![expect(clippy::expect_used, reason = "what cannot be set up fails the test that needs it")]

use std::fs;
use std::path::Path;

use gnc_records::store::{digest, reader};
use gnc_tests::{PARTIAL, Place, Run, older};

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");

const PLAN: &str = "name = \"short\"\nversion = \"1\"\n[[item]]\nid = \"six-position\"\n\
                    params = { dwell = \"10 s\", settle = \"0 s\" }\nlimits.residual_rms = \"<= 5 mg\"\n";

const ARGS: [&str; 6] = ["--auto", "p.toml", "--sim", "--sim-speed", "max", "--serial-number"];

/// A run of module N-1, which passed.
fn recorded() -> Place {
    let place = Place::new(STATION);
    place.write("p.toml", PLAN);
    let run = place.run(ARGS.into_iter().chain(["N-1"]));
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    unnamed(&place);
    place
}

/// The raw files name their run by the first line of the journal, which these tests change.
fn unnamed(place: &Place) {
    older::unname(&place.runs().remove(0));
    older::rechain(&place.path().join("records"));
}

/// Changes the journal like a later version, and updates its digest.
fn rewrite(folder: &Path, change: impl Fn(&str) -> String) {
    rewrite_file(folder, "events.jsonl", change);
}

/// Changes a file of a run, and updates its digest.
fn rewrite_file(folder: &Path, file: &str, change: impl Fn(&str) -> String) {
    let (journal, sums) = (folder.join(file), folder.join("SHA256SUMS"));
    let before = digest::of_file(&journal).expect("a digest");
    let text = fs::read_to_string(&journal).expect("a journal");
    fs::write(&journal, change(&text)).expect("writable");
    let digests = fs::read_to_string(&sums).expect("digests");
    let after = digest::of_file(&journal).expect("a digest");
    fs::write(&sums, digests.replace(&before, &after)).expect("writable");
    older::rechain(folder.ancestors().nth(3).expect("the records"));
}

#[track_caller]
fn refused(run: &Run, what: &str) {
    assert_eq!(run.code, Some(2), "{}{}", run.stdout, run.stderr);
    let told = format!("written by a newer version of the station ({what})");
    assert!(run.stderr.contains(&told), "{}", run.stderr);
    assert!(run.stderr.contains("try: read it with the version of the station that wrote it"), "{}", run.stderr);
    assert!(!run.stderr.contains("damaged"), "{}", run.stderr);
}

/// First, middle and last line, each in a separate run: all faces name what they do not know.
#[test]
fn an_unknown_event_is_of_a_newer_version() {
    for (from, to, what) in [
        ("run_started", "run_ordered", "event `run_ordered`"),
        ("measured", "weighed", "event `weighed`"),
        ("run_ended", "run_sealed", "event `run_sealed`"),
    ] {
        let place = recorded();
        let folder = place.runs().remove(0);
        rewrite(&folder, |text| text.replacen(&format!("\"kind\":\"{from}\""), &format!("\"kind\":\"{to}\""), 1));
        let run = folder.to_str().expect("UTF-8");
        let told = format!("written by a newer version of the station ({what})");
        let list = place.run(["records", "list"]);
        assert_eq!(list.code, Some(0), "{}", list.stderr);
        assert!(list.stdout.starts_with(&format!("newer       {told}")), "{}", list.stdout);
        refused(&place.run(["records", "show", run]), what);
        refused(&place.run(["records", "show", "N-1"]), what);
        refused(&place.run(["recompute", run]), what);
        refused(&place.run(ARGS.into_iter().chain(["N-1", "--resume", run])), what);
        assert_eq!(place.runs().len(), 1, "nothing was run");
        let export = place.run(["export", run, "--out", "tables"]);
        assert_eq!(export.code, Some(0), "{}", export.stderr);
        assert!(export.stderr.contains(&told), "{}", export.stderr);
    }
}

/// The newest run of a module counts even if a later version wrote it: an older pass does not take its place.
#[test]
fn an_older_pass_does_not_stand_for_a_newer_run() {
    let place = recorded();
    let second = place.run(ARGS.into_iter().chain(["N-1"]));
    assert_eq!(second.code, Some(0), "{}{}", second.stdout, second.stderr);
    let list = place.run(["records", "list"]).stdout;
    let newest = list.lines().last().and_then(|line| line.split_whitespace().last()).expect("a run").to_owned();
    let folder = place.path().join("records").join(&newest);
    rewrite(&folder, |text| text.replace("\"kind\":\"run_ended\"", "\"kind\":\"run_sealed\""));
    refused(&place.run(["records", "show", "N-1"]), "event `run_sealed`");
    let list = place.run(["records", "list"]).stdout;
    let lines: Vec<&str> = list.lines().collect();
    assert!(lines[0].starts_with("passed") && lines[1].starts_with("newer") && lines[1].ends_with(&newest), "{list}");
}

/// Digests are compared even if the journal is not understood, and changes are reported.
#[test]
fn digests_vouch_for_a_newer_run() {
    let place = recorded();
    let folder = place.runs().remove(0);
    rewrite(&folder, |text| text.replace("gnc-events/1", "gnc-events/3"));
    let run = folder.to_str().expect("UTF-8");
    let told = "written by a newer version of the station (schema `gnc-events/3`)";
    let verified = place.run(["records", "verify", run]);
    assert_eq!(verified.code, Some(2), "{}{}", verified.stdout, verified.stderr);
    assert!(verified.stdout.contains(&format!("{told}: its digests agree")), "{}", verified.stdout);
    assert!(verified.stdout.contains("0 of 1 runs are as written"), "{}", verified.stdout);
    assert!(verified.stderr.contains("found nothing wrong"), "{}", verified.stderr);
    let chain = place.run(["records", "verify"]);
    assert_eq!(chain.code, Some(2), "{}{}", chain.stdout, chain.stderr);
    fs::write(folder.join("log.txt"), "PASSED").expect("writable");
    let changed = place.run(["records", "verify", run]);
    assert_eq!(changed.code, Some(1), "{}{}", changed.stdout, changed.stderr);
    assert!(changed.stdout.contains(told) && changed.stdout.contains("log.txt was changed"), "{}", changed.stdout);
}

/// A run of a later version without an end is left to that version, which can seal it.
#[test]
fn an_open_run_of_a_newer_version_is_not_sealed() {
    let place = recorded();
    let folder = place.runs().remove(0);
    fs::remove_file(folder.join("SHA256SUMS")).expect("digests");
    let journal = folder.join("events.jsonl");
    let text = fs::read_to_string(&journal).expect("a journal").replace("run_ended", "run_paused");
    fs::write(&journal, &text).expect("writable");
    let next = place.run(ARGS.into_iter().chain(["N-2"]));
    assert_eq!(next.code, Some(0), "{}{}", next.stdout, next.stderr);
    assert!(!reader::is_sealed(&folder), "{}", next.stdout);
    assert_eq!(fs::read_to_string(&journal).ok(), Some(text));
}

/// A line that no version would write is damage, and the station says so.
#[test]
fn damage_stays_damage() {
    let place = recorded();
    let folder = place.runs().remove(0);
    let run = folder.to_str().expect("UTF-8").to_owned();
    rewrite(&folder, |text| text.replacen("\"kind\":\"measured\"", "\"kind\":measured", 1));
    let shown = place.run(["records", "show", &run]);
    assert_eq!(shown.code, Some(2), "{}", shown.stdout);
    assert!(shown.stderr.contains("the journal is damaged: line "), "{}", shown.stderr);
    let verified = place.run(["records", "verify", &run]);
    assert_eq!(verified.code, Some(1), "{}{}", verified.stdout, verified.stderr);
    let list = place.run(["records", "list"]);
    assert!(list.stdout.starts_with("unreadable  the journal is damaged: line "), "{}", list.stdout);
}

/// An earlier version filed the outcome of chosen items as that of the module. Such a record is as it was written, and no
/// face calls it a pass.
#[test]
fn a_selection_of_an_earlier_version_is_no_pass() {
    let place = Place::new(STATION);
    place.write("p.toml", PLAN);
    let run = place.run(ARGS.into_iter().chain(["N-1", "--only", "six-position"]));
    assert_eq!(run.code, PARTIAL, "{}{}", run.stdout, run.stderr);
    unnamed(&place);
    let folder = place.runs().remove(0);
    let (before, after) = ("\"outcome\":null,\"selection_outcome\":\"passed\"", "\"outcome\":\"passed\"");
    rewrite(&folder, |text| text.replacen(before, after, 1).replacen("gnc-events/2", "gnc-events/1", 1));
    let (before, after) = ("\"outcome\": null,\n  \"selection_outcome\": \"passed\"", "\"outcome\": \"passed\"");
    rewrite_file(&folder, "run.json", |text| text.replacen(before, after, 1));
    for file in ["events.jsonl", "run.json"] {
        let text = fs::read_to_string(folder.join(file)).expect("a file");
        assert!(!text.contains("selection_outcome") && text.contains("six-position"), "{file}");
    }
    let run = folder.to_str().expect("UTF-8");
    let verified = place.run(["records", "verify", run]);
    assert_eq!(verified.code, Some(0), "{}{}", verified.stdout, verified.stderr);
    let list = place.run(["records", "list"]);
    assert!(list.stdout.starts_with("partial  ") && list.stdout.contains("selection"), "{}", list.stdout);
    let shown = place.run(["records", "show", run]);
    assert!(shown.stdout.contains("PARTIAL (simulated, selection)"), "{}", shown.stdout);
    let again = place.run(["recompute", run]);
    assert!(
        again.code == Some(0) && again.stdout.contains("the same, bit for bit"),
        "{}{}",
        again.stdout,
        again.stderr
    );
}
