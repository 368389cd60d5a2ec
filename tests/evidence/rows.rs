//! The rows of the table in docs/evidence.md: what an attacker does who has everything but what the column names.

use std::fs;
use std::path::{Path, PathBuf};

use gnc_records::raw::{self, RawWriter, pieces};
use gnc_records::store::StationKey;

use crate::attack::{Entry, chain_anew, plant, sha256, sums_anew, tree};
use crate::{day, killed};

/// One kind of attack.
pub(crate) struct Row {
    /// What is done, in the words of the page.
    pub(crate) what: &'static str,
    /// Does it to a folder of closed runs.
    pub(crate) attack: fn(&Path),
    /// Whether it is found with nothing, with an older copy of `COUNTER`, with the public key, with the newest paper.
    pub(crate) found: [bool; 4],
}

pub(crate) const ROWS: [Row; 23] = [
    Row { what: "A byte of a file of a run is changed", attack: byte, found: [true; 4] },
    Row { what: "A file is removed from a run, or added to it", attack: removed_file, found: [true; 4] },
    Row {
        what: "A verdict is changed in all files of its run, and its digests are made anew",
        attack: |records| verdict(records, false),
        found: [true; 4],
    },
    Row {
        what: "The same, and the chain and `COUNTER` are made anew",
        attack: |records| verdict(records, true),
        found: [false, true, true, true],
    },
    Row {
        what: "A passport, a plan or the file of an item is exchanged, and all else is made anew",
        attack: planted,
        found: [true; 4],
    },
    Row {
        what: "The verdict in the log and the report of a failed run is exchanged, and all else is made anew",
        attack: papers,
        found: [true; 4],
    },
    Row { what: "A failed run is removed", attack: |records| failed_away(records, false), found: [true; 4] },
    Row {
        what: "The same, and the chain and `COUNTER` are made anew",
        attack: |records| failed_away(records, true),
        found: [false, true, true, true],
    },
    Row {
        what: "The newest run is removed with its lines, and `COUNTER` is set back; or the folder is an older copy of itself",
        attack: newest_away,
        found: [false, true, false, true],
    },
    Row {
        what: "The oldest days are removed, or the oldest runs with their lines",
        attack: oldest_away,
        found: [false, true, true, true],
    },
    Row { what: "The folders of two modules are swapped", attack: folders_swapped, found: [true; 4] },
    Row {
        what: "Two modules are swapped in all files, and all else is made anew",
        attack: modules_swapped,
        found: [false, true, true, true],
    },
    Row {
        what: "An old run stands once more, under another name",
        attack: |records| again(records, false),
        found: [true; 4],
    },
    Row {
        what: "The same in all of its files, with digests and lines at the end of the chain made by hand",
        attack: |records| again(records, true),
        found: [false, false, true, false],
    },
    Row { what: "A day is renamed", attack: |records| renamed_day(records, false), found: [true; 4] },
    Row {
        what: "The same in all files, and all else is made anew",
        attack: |records| renamed_day(records, true),
        found: [false, true, true, true],
    },
    Row {
        what: "A run is inserted on a day before the first one",
        attack: |records| drop(early(records)),
        found: [true; 4],
    },
    Row {
        what: "The same with its date in all of its files and its digests made anew, and the chain is left alone",
        attack: early_dated,
        found: [false, false, true, false],
    },
    Row {
        what: "The same, and the chain and `COUNTER` are made anew",
        attack: early_chained,
        found: [false, true, true, true],
    },
    Row { what: "A file or a folder is replaced by a link to the same content", attack: link, found: [true; 4] },
    Row {
        what: "The signature of a run, or that of one of its lines, is taken away",
        attack: |records| fs::remove_file(records.join(PASSED).join("SHA256SUMS.sig")).expect("a signature"),
        found: [true; 4],
    },
    Row {
        what: "The signatures of a run and of both of its lines are taken away (a warning names the lines)",
        attack: all_signatures,
        found: [false, false, true, false],
    },
    Row { what: "All is made anew and signed with another key", attack: another_key, found: [false, true, true, true] },
];

/// What is done in the folder of a run that was killed, before the next start closes it.
pub(crate) const KILLED_ROWS: [Row; 4] = [
    Row {
        what: "Captures of a killed run are exchanged before the next start",
        attack: |records| exchanged(records),
        found: [true; 4],
    },
    Row {
        what: "The same, and its journal is made to fit",
        attack: |records| {
            exchanged(records);
            fits(records);
        },
        found: [false, false, true, false],
    },
    Row {
        what: "A result before a capture is edited in the journal of a killed run, before the next start",
        attack: |records| edited(records),
        found: [true; 4],
    },
    Row {
        what: "The same, and its journal is made to fit",
        attack: |records| {
            edited(records);
            fits(records);
        },
        found: [false, false, true, false],
    },
];

/// What is done to closed runs before the next start, which has the key.
pub(crate) const REOPENED_ROWS: [Row; 1] = [Row {
    what: "The newest closed run is opened again: its last line is removed, `COUNTER` is set back, its journal is edited, and the next start closes it late, with its key",
    attack: reopened,
    found: [false, true, false, false],
}];

/// The run that was killed.
const KILLED: &str = "2026-11-29/T-4/090000-small";
const RAW: &str = "01-cpu/attempt-1.mcap";

/// The capture of another module in a file that says that it is of this run.
fn exchanged(records: &Path) {
    let file = records.join(KILLED).join(RAW);
    let own = raw::read(fs::File::open(&file).expect("a file")).expect("captures");
    let mut out = RawWriter::new(fs::File::create(&file).expect("room"), own.origin.as_ref()).expect("a head");
    for piece in pieces(&killed::capture("of another module")) {
        out.write(piece).expect("room");
    }
    out.finish().expect("room");
}

fn edited(records: &Path) {
    replace(&records.join(KILLED), &[("\"value\":0.0,", "\"value\":-0.0,")]);
}

/// Makes the line about the raw file fit to the file and to the lines before it. Only the signature needs a key.
fn fits(records: &Path) {
    let journal = records.join(KILLED).join("events.jsonl");
    let file = fs::read(records.join(KILLED).join(RAW)).expect("a file");
    let mut text = String::new();
    for line in fs::read_to_string(&journal).expect("a journal").lines() {
        let mut line = line.to_owned();
        let event: serde_json::Value = serde_json::from_str(&line).expect("an event");
        if event["kind"] == "captured" {
            for (name, now) in [("sha256", sha256(&file)), ("journal_sha256", sha256(text.as_bytes()))] {
                line = line.replace(event[name].as_str().expect("a digest"), &now);
            }
            line = line.replace(&format!("\"bytes\":{}", event["bytes"]), &format!("\"bytes\":{}", file.len()));
        }
        text.push_str(&line);
        text.push('\n');
    }
    fs::write(journal, text).expect("a journal");
}

const FAILED: &str = "2026-11-28/T-2/091000-small";
const PASSED: &str = "2026-11-28/T-1/090000-small";
const NEWEST: &str = "2026-11-29/T-3/080000-small";

fn byte(records: &Path) {
    let path = records.join(PASSED).join("log.txt");
    let mut log = fs::read(&path).expect("a log");
    log[10] ^= 1;
    fs::write(path, log).expect("a log");
}

fn removed_file(records: &Path) {
    fs::remove_file(records.join(PASSED).join("report.html")).expect("a report");
    fs::write(records.join(PASSED).join("added.txt"), "added").expect("a file");
}

/// Replaces a text in all files below a folder.
fn replace(folder: &Path, pairs: &[(&str, &str)]) {
    for (path, entry) in tree(folder).expect("a tree") {
        let Entry::File(bytes) = entry else { continue };
        let Ok(mut text) = String::from_utf8(bytes) else { continue };
        for (from, to) in pairs {
            text = text.replace(from, to);
        }
        fs::write(folder.join(path), text).expect("a file");
    }
}

fn chain_of_all_anew(records: &Path) {
    sums_anew(records).expect("digests");
    chain_anew(records, false).expect("a chain");
}

fn verdict(records: &Path, anew: bool) {
    replace(
        &records.join(FAILED),
        &[
            ("failed", "passed"),
            ("FAILED", "PASSED"),
            ("\"value\":1.0", "\"value\":0.0"),
            ("\"value\": 1.0", "\"value\": 0.0"),
        ],
    );
    sums_anew(records).expect("digests");
    if anew {
        chain_anew(records, false).expect("a chain");
    }
}

fn planted(records: &Path) {
    let failed = records.join(FAILED);
    fs::write(failed.join("passport.json"), "{ \"origin\": { \"outcome\": \"passed\" } }").expect("a passport");
    replace(&failed.join("01-cpu"), &[("failed", "passed")]);
    replace(&failed.join("plan"), &[("== 0", ">= 0")]);
    chain_of_all_anew(records);
}

fn papers(records: &Path) {
    for file in ["log.txt", "report.html"] {
        let path = records.join(FAILED).join(file);
        let text = fs::read_to_string(&path).expect("a paper");
        assert!(text.contains("FAILED"), "{text}");
        fs::write(path, text.replace("FAILED", "PASSED")).expect("a paper");
    }
    chain_of_all_anew(records);
}

fn failed_away(records: &Path, anew: bool) {
    fs::remove_dir_all(records.join(FAILED)).expect("a run");
    if anew {
        chain_anew(records, false).expect("a chain");
    }
}

/// As the folder was before its newest run: the lines that stay are as they were.
fn newest_away(records: &Path) {
    fs::remove_dir_all(records.join("2026-11-29")).expect("a day");
    let chain = fs::read_to_string(records.join("2026-11-28/CHAIN")).expect("a chain");
    let last: Vec<&str> = chain.lines().last().expect("a line").split(' ').collect();
    fs::write(records.join("COUNTER"), format!("{} {}\n", last[0], last[3])).expect("a counter");
}

/// As a power cut before the last line would have left the newest run, with another journal. Only a later start can sign it.
fn reopened(records: &Path) {
    let path = records.join("2026-11-29/CHAIN");
    let chain = fs::read_to_string(&path).expect("a chain");
    let began = chain.lines().next().expect("a line");
    fs::write(&path, format!("{began}\n")).expect("a chain");
    let words: Vec<&str> = began.split(' ').collect();
    fs::write(records.join("COUNTER"), format!("{} {}\n", words[0], words[3])).expect("a counter");
    let run = records.join(NEWEST);
    for file in ["SHA256SUMS", "SHA256SUMS.sig", "run.json", "report.html", "log.txt", "01-cpu/item.json"] {
        fs::remove_file(run.join(file)).expect("a file of the end");
    }
    for passport in ["passport.json", "passport.xml"] {
        let _ = fs::remove_file(run.join(passport));
    }
    // A verdict in the other direction is edited in the same way.
    replace(&run, &[("passed", "failed"), ("\"value\":0.0", "\"value\":1.0")]);
}

/// All lines that stay are as they were.
fn oldest_away(records: &Path) {
    fs::remove_dir_all(records.join("2026-11-28")).expect("a day");
}

fn folders_swapped(records: &Path) {
    let day = records.join("2026-11-28");
    for (from, to) in [("T-1", "aside"), ("T-2", "T-1"), ("aside", "T-2")] {
        fs::rename(day.join(from), day.join(to)).expect("a folder");
    }
}

fn modules_swapped(records: &Path) {
    folders_swapped(records);
    replace(&records.join("2026-11-28"), &[("T-1", "T-aside"), ("T-2", "T-1"), ("T-aside", "T-2")]);
    chain_of_all_anew(records);
}

fn copy(records: &Path, from: &str, to: &str) -> PathBuf {
    let whole = tree(&records.join(from)).expect("a run");
    plant(&whole, &records.join(to)).expect("a copy");
    records.join(to)
}

/// The folder of a passed run, once more for another module.
fn again(records: &Path, anew: bool) {
    let copied = copy(records, PASSED, "2026-11-29/T-9/090000-small");
    if !anew {
        return;
    }
    replace(&copied, &[("T-1", "T-9"), ("2026-11-28", "2026-11-29")]);
    // A signature beside a line that has none would tell of it.
    fs::remove_file(copied.join("SHA256SUMS.sig")).expect("a signature");
    sums_anew(records).expect("digests");
    let day = fs::read_to_string(records.join("2026-11-28/CHAIN")).expect("a chain");
    let chain = records.join("2026-11-29/CHAIN");
    let mut lines = fs::read_to_string(&chain).expect("a chain");
    for (number, line) in (1000..).zip(day.lines().filter(|line| line.contains(PASSED))) {
        let words: Vec<&str> = line.split(' ').collect();
        let tail =
            words[4..].join(" ").replace(PASSED, "2026-11-29/T-9/090000-small").replace("2026-11-28", "2026-11-29");
        let unsigned = tail.split(" sig ").next().unwrap_or_default();
        lines.push_str(&format!("{number} {} {} {} {unsigned}\n", words[1], words[2], words[3]));
    }
    fs::write(chain, lines).expect("a chain");
    chain_anew(records, false).expect("a chain");
}

fn renamed_day(records: &Path, anew: bool) {
    fs::rename(records.join("2026-11-28"), records.join("2026-11-27")).expect("a day");
    if anew {
        replace(records, &[("2026-11-28", "2026-11-27")]);
        chain_of_all_anew(records);
    }
}

fn early(records: &Path) -> PathBuf {
    copy(records, "2026-11-28/T-2/092000-small", "2026-11-20/T-2/092000-small")
}

/// As a version of the station that knew no chain would have left it.
fn early_dated(records: &Path) {
    replace(&early(records), &[("2026-11-28", "2026-11-20")]);
    sums_anew(records).expect("digests");
}

fn early_chained(records: &Path) {
    early_dated(records);
    let chain = fs::read_to_string(records.join("2026-11-28/CHAIN")).expect("a chain");
    let lines: String = (chain.lines().filter(|line| line.contains("T-2/092000-small")))
        // The beginning stays before the end.
        .enumerate()
        .map(|(at, line)| format!("0{at}{}\n", &line.replace("2026-11-28", "2026-11-20")[1..]))
        .collect();
    fs::write(records.join("2026-11-20/CHAIN"), lines).expect("a chain");
    chain_of_all_anew(records);
}

fn link(records: &Path) {
    let aside = records.with_extension("aside");
    fs::create_dir_all(&aside).expect("a folder");
    fs::rename(records.join(PASSED), aside.join("run")).expect("a run");
    std::os::unix::fs::symlink(aside.join("run"), records.join(PASSED)).expect("a link");
}

fn all_signatures(records: &Path) {
    fs::remove_file(records.join(FAILED).join("SHA256SUMS.sig")).expect("a signature");
    let path = records.join("2026-11-28/CHAIN");
    let chain = fs::read_to_string(&path).expect("a chain");
    let cut = |line: &str| {
        if line.contains(FAILED) { line.split(" sig ").next().unwrap_or_default().to_owned() } else { line.to_owned() }
    };
    fs::write(path, chain.lines().map(|line| format!("{}\n", cut(line))).collect::<String>()).expect("a chain");
}

/// Writes the same days again, without the failed run, with another key.
fn another_key(records: &Path) {
    fs::remove_dir_all(records).expect("records");
    fs::create_dir(records).expect("records");
    let path = records.with_extension("key");
    StationKey::create(&path).expect("a key");
    let key = StationKey::read(&path).expect("a key");
    for (started, serial_number) in [
        ("2026-11-28T09:00:00+08:00", "T-1"),
        ("2026-11-28T09:20:00+08:00", "T-2"),
        ("2026-11-29T08:00:00+08:00", "T-3"),
    ] {
        day::run(records, &key, started, serial_number, 0.0);
    }
}
