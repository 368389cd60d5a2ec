//! Records that earlier programs really wrote, read by this one: `tests/data/older` says which programs, and how.

#![expect(clippy::unwrap_used, reason = "what cannot be set up fails the test that needs it")]

use std::fs;
use std::path::{Path, PathBuf};

use gnc_tests::{Place, Run, read_json, repository};

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");

/// A copy of the records of an earlier program, in a place of its own: reading must not need the files of the repository.
fn copied(place: &Place, program: &str) -> PathBuf {
    let to = place.path().join("records");
    copy(&repository().join("tests/data/older").join(program).join("records"), &to);
    let [run] = place.runs().try_into().unwrap();
    run
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let to = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy(&entry.path(), &to);
        } else {
            fs::copy(entry.path(), to).unwrap();
        }
    }
}

#[track_caller]
fn said(run: &Run, code: i32, words: &[&str]) {
    let all = format!("{}{}", run.stdout, run.stderr);
    assert_eq!(run.code, Some(code), "{all}");
    words.iter().for_each(|words| assert!(all.contains(words), "{words}: {all}"));
}

/// The last program whose chain had no lines of beginnings and no signatures.
#[test]
fn a_run_in_a_chain_of_version_1_is_read() {
    let place = Place::new(STATION);
    let run = copied(&place, "chain-1");
    let name = "2026-11-30/OLDER-1/224550-older";
    assert!(run.ends_with(name));
    let list = place.run(["records", "list"]);
    said(&list, 0, &["passed", "OLDER-1", "simulated", name]);
    assert!(!list.stdout.contains("chain"), "its line holds it: {}", list.stdout);
    said(
        &place.run(["records", "show", "OLDER-1"]),
        0,
        &["radius 0.429569 gauss", "commit 79ff3a6286b1 of 2026-11-30"],
    );
    let whole = ["as written", "1 of 1 runs are as written", "the chain of 1 closed run is whole"];
    said(&place.run(["records", "verify"]), 0, &whole);
    said(
        &place.run(["recompute", "OLDER-1"]),
        0,
        &["the same, bit for bit: 24 measurements, 1 attempts from raw samples"],
    );
    said(&place.run(["export", "OLDER-1", "--format", "csv", "--out", "out"]), 0, &["4 captures, 400 samples"]);
    // Nothing shows by a key when it was put there.
    said(&place.run(["records", "key", "k"]), 0, &[]);
    let with_key = place.run(["records", "verify", "--key", "k.pub"]);
    said(&with_key, 1, &["SHA256SUMS.sig is missing: the run is not signed", "no line of the chain is signed"]);
    // The next run goes on behind its line.
    let next = place.functional("--sim", &["--sim-speed", "max", "--only", "identity"]);
    assert_eq!(next.code, gnc_tests::PARTIAL, "{}{}", next.stdout, next.stderr);
    said(&place.run(["records", "verify"]), 0, &["2 of 2 runs are as written", "the chain of 2 closed runs is whole"]);
    assert_eq!(read_json(&run.join("run.json"))["outcome"], "passed");
    // What was changed since is found.
    let log = run.join("log.txt");
    fs::write(&log, fs::read_to_string(&log).unwrap() + "\n").unwrap();
    said(&place.run(["records", "verify"]), 1, &["log.txt was changed"]);
}

/// The last program without a chain. Alone such a run is a finding: a chain that was taken away looks the same.
#[test]
fn a_run_from_before_the_chain_is_read() {
    let place = Place::new(STATION);
    let run = copied(&place, "before-chain");
    let name = "2026-11-30/OLDER-1/225236-older";
    assert!(run.ends_with(name));
    said(&place.run(["records", "list"]), 0, &["not_in_chain", "OLDER-1", "not in the chain", name]);
    said(&place.run(["records", "show", "OLDER-1"]), 0, &["Program       gnc-station 0.1.0\n", "identity"]);
    let lost = "1 run is closed, and there is no chain: COUNTER and all chains are missing, or a version before the chain wrote this run";
    said(&place.run(["records", "verify"]), 1, &["1 of 1 runs are as written", lost]);
    said(
        &place.run(["recompute", "OLDER-1"]),
        0,
        &["the same, bit for bit: 7 measurements, 0 attempts from raw samples"],
    );
    said(&place.run(["export", "OLDER-1", "--format", "csv", "--out", "out"]), 2, &["holds no raw samples"]);
    said(&place.run(["records", "key", "k"]), 0, &[]);
    let with_key = place.run(["records", "verify", "--key", "k.pub"]);
    said(&with_key, 1, &["SHA256SUMS.sig is missing: the run is not signed", lost]);
    // The first start says that it leaves the run, and changes nothing of it.
    let before = fs::read(run.join("SHA256SUMS")).unwrap();
    let next = place.functional("--sim", &["--sim-speed", "max", "--only", "identity"]);
    let all = format!("{}{}", next.stdout, next.stderr);
    assert_eq!(next.code, gnc_tests::PARTIAL, "{all}");
    assert!(all.contains("is closed and its folder of records has no chain; it is left as it is"), "{all}");
    assert_eq!(fs::read(run.join("SHA256SUMS")).unwrap(), before);
    said(&place.run(["records", "list"]), 0, &["not_in_chain", "OLDER-1"]);
    let left = ["1 closed run is older than the first line of the chain", "2 of 2 runs are as written"];
    said(&place.run(["records", "verify"]), 0, &left);
}
