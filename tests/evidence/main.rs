//! What the records prove, tried as one who can write everything but the station's key.
//!
//! The table of docs/evidence.md is what these attacks show. Beside it, dice make other attacks: for every file of closed
//! days, any change, removal, rename, swap or insertion is found with the public key and the newest head of the chain.

#![expect(clippy::expect_used, clippy::indexing_slicing, reason = "what cannot be set up fails the test that needs it")]

mod attack;
mod day;
mod killed;
mod quiet;
mod rows;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use attack::{attack, plant, tree};
use gnc_records::store::StationKey;
use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rows::{KILLED_ROWS, REOPENED_ROWS, ROWS};

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
/// Another seed makes other attacks.
const SEED: u64 = 20_261_130;
/// Attacks in a run of the tests; `EVIDENCE_ATTACKS` asks for more.
const ATTACKS: usize = 120;
/// Longest script: all choices of its steps.
const SCRIPT_BYTES: usize = 48;

/// A folder with closed runs, and what an auditor keeps elsewhere.
struct Kept {
    place: tempfile::TempDir,
    public_key: PathBuf,
    /// Number and link on the newest paper.
    head: String,
    /// A copy of `COUNTER` from the end of the last run.
    counter: PathBuf,
}

impl Kept {
    fn new() -> Self {
        let place = tempfile::tempdir().expect("a folder");
        let public_key = day::write(place.path());
        let records = place.path().join("records");
        let counter = place.path().join("COUNTER.kept");
        std::fs::copy(records.join("COUNTER"), &counter).expect("a counter");
        let head = std::fs::read_to_string(&counter).expect("a counter").trim_end().to_owned();
        Self { place, public_key, head, counter }
    }

    /// The same, and a run that was killed and that no start has closed. What is kept elsewhere is of after the kill.
    fn with_a_killed_run() -> Self {
        let kept = Self::new();
        killed::killed(&kept.records(), &kept.key());
        std::fs::copy(kept.records().join("COUNTER"), &kept.counter).expect("a counter");
        let head = std::fs::read_to_string(&kept.counter).expect("a counter").trim_end().to_owned();
        Self { head, ..kept }
    }

    fn key(&self) -> StationKey {
        StationKey::read(&self.place.path().join("station.key")).expect("a key")
    }

    fn records(&self) -> PathBuf {
        self.place.path().join("records")
    }

    /// What an auditor holds against the folder, by the columns of the page.
    fn witnesses(&self) -> [Vec<String>; 4] {
        let path = |path: &Path| path.to_string_lossy().into_owned();
        let newest = std::fs::read_to_string(self.records().join("2026-11-29/CHAIN")).expect("a chain");
        let begun: Vec<&str> = newest.lines().next().expect("the line of the newest run's begin").split(' ').collect();
        [
            Vec::new(),
            vec!["--counter".into(), path(&self.counter)],
            vec!["--key".into(), path(&self.public_key)],
            vec!["--head".into(), format!("{} {}", begun[0], begun[3])],
        ]
    }
}

/// What `records verify` says: whether all is as written, and its lines. What is not is named by a finding, or by what a sudden
/// end left; each has its exit code.
#[track_caller]
fn verify(records: &Path, witness: &[String]) -> (bool, String) {
    let (code, text) = asked(records, witness);
    (is_as_written(code, &text), text)
}

/// Whether all is as written, by exit code and lines.
#[track_caller]
fn is_as_written(code: i32, text: &str) -> bool {
    if code == 0 {
        return true;
    }
    let closing = match code {
        1 => "these records are not as they were written, so they prove nothing",
        3 => "these records are incomplete: a station ended, or could not write, before they were closed",
        _ => unreachable!("exit code {code}: {text}"),
    };
    let has_finding = text.lines().any(|line| {
        let is_said = line.starts_with("chain: ") || line.starts_with("records/") || line.starts_with('/');
        is_said && !line.contains(": as written")
    });
    assert!(has_finding && text.contains(closing), "exit code {code} without a finding: {text}");
    false
}

/// What `records verify` says, with its exit code.
#[track_caller]
fn asked(records: &Path, witness: &[String]) -> (i32, String) {
    let mut command = Command::new(STATION);
    command.args(["records", "verify", "--records"]).arg(records).args(witness);
    command.stdin(Stdio::null()).env("NO_COLOR", "1").env("LC_ALL", "C.UTF-8");
    command.current_dir(records.parent().expect("a place"));
    let output = command.output().expect("the station");
    let text = [output.stdout, output.stderr].concat();
    let text = String::from_utf8_lossy(&text).into_owned();
    (output.status.code().expect("an exit code"), text)
}

/// The attacked folder: a copy, since what is written is attacked many times.
fn copied(kept: &Kept) -> (tempfile::TempDir, PathBuf) {
    let place = tempfile::tempdir().expect("a folder");
    let records = place.path().join("records");
    plant(&tree(&kept.records()).expect("a tree"), &records).expect("a copy");
    (place, records)
}

/// The table of the page, as the attacks show it, and what is said of each.
#[test]
fn the_page_says_what_is_found() {
    let kept = Kept::new();
    let witnesses = kept.witnesses();
    for witness in &witnesses {
        assert!(verify(&kept.records(), witness).0, "as written, {witness:?}");
    }
    let (mut said, mut wrong) = (String::new(), Vec::new());
    let mut table = String::new();
    // A run that was killed is closed by the next start, after the attack.
    let open = Kept::with_a_killed_run();
    let open_witnesses = open.witnesses();
    {
        let (_place, records) = copied(&open);
        assert_eq!(killed::start(&records, &open.key()).len(), 1);
        for witness in &open_witnesses {
            assert!(verify(&records, witness).0, "as written, {witness:?}");
        }
    }
    let closed = ROWS.iter().map(|row| (row, &kept, &witnesses, false));
    let killed = KILLED_ROWS.iter().map(|row| (row, &open, &open_witnesses, true));
    let reopened = REOPENED_ROWS.iter().map(|row| (row, &kept, &witnesses, true));
    for (row, kept, witnesses, is_open) in closed.chain(killed).chain(reopened) {
        let (place, records) = copied(kept);
        (row.attack)(&records);
        if is_open {
            killed::start(&records, &kept.key());
        }
        let mut cells = Vec::new();
        said.push_str(&format!("## {}\n", row.what));
        for (witness, expected) in witnesses.iter().zip(row.found) {
            let (is_as_written, text) = verify(&records, witness);
            if is_as_written == expected {
                wrong.push(format!("{}, with {witness:?}:\n{text}", row.what));
            }
            cells.push(if is_as_written { "no" } else { "**yes**" });
            let option = witness.first().map_or("nothing", String::as_str);
            let lines = text.replace(&place.path().display().to_string(), "PLACE");
            let lines = lines.replace(&kept.place.path().display().to_string(), "KEPT");
            // What is as it was written needs no reader.
            let findings: String = lines
                .lines()
                .filter(|line| !line.ends_with(": as written"))
                .map(|line| format!("{}\n", without_lengths(line)))
                .collect();
            said.push_str(&format!("-- {option}\n{}", without_links(&findings)));
        }
        table.push_str(&format!("| {} | {} |\n", row.what, cells.join(" | ")));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    insta::assert_snapshot!("what_is_said", said);
    let page = std::fs::read_to_string(gnc_tests::repository().join("docs/evidence.md")).expect("the page");
    assert!(page.contains(&table), "docs/evidence.md does not hold what the attacks show:\n{table}");
}

/// How many bytes a raw file has depends on when they were written to disk.
fn without_lengths(line: &str) -> String {
    const OTHER: &str = " is not the one that was captured: ";
    line.split_once(OTHER).map_or_else(|| line.to_owned(), |(file, _)| format!("{file}{OTHER}..."))
}

/// Links and digests depend on keys, which are new in each run.
fn without_links(text: &str) -> String {
    let mut out = String::new();
    let mut digits = String::new();
    for c in text.chars().chain(['\n']) {
        if c.is_ascii_hexdigit() {
            digits.push(c);
            continue;
        }
        out.push_str(if digits.len() >= 8 && digits.len().is_multiple_of(4) { "DIGITS" } else { &digits });
        digits.clear();
        out.push(c);
    }
    out.pop();
    out
}

#[test]
fn every_attack_without_the_key_is_found() {
    let kept = Kept::new();
    let written = tree(&kept.records()).expect("a tree");
    let with_all: Vec<String> =
        vec!["--key".into(), kept.public_key.to_string_lossy().into_owned(), "--head".into(), kept.head.clone()];
    assert!(verify(&kept.records(), &with_all).0, "as written");

    let attacks = std::env::var("EVIDENCE_ATTACKS").ok().and_then(|many| many.parse().ok()).unwrap_or(ATTACKS);
    println!("seed {SEED}, {attacks} attacks");
    let mut dice = ChaCha8Rng::seed_from_u64(SEED);
    let mut missed = Vec::new();
    for number in 0..attacks {
        let mut script = [0; SCRIPT_BYTES];
        dice.fill_bytes(&mut script);
        let (_place, records) = copied(&kept);
        // A step that the system refuses ends an attack; what was done until then counts.
        let done = attack(&records, &script);
        if tree(&records).expect("a tree") != written && verify(&records, &with_all).0 {
            missed.push(format!("attack {number}: {done:?}"));
        }
    }
    assert!(missed.is_empty(), "{} attacks were not found:\n{}", missed.len(), missed.join("\n"));
}

/// The calibration of a good module, with the name of a bad one in all of its files: today's records, not those of a
/// version that did not name the run in its raw files.
#[test]
fn captures_of_a_good_module_are_not_those_of_a_bad_one() {
    let place = gnc_tests::Place::new(STATION);
    let item = "id = \"gyro-still\"\nparams = { dwell = \"10 s\" }\n[item.limits]\nfailed_reads = \"<= 50 %\"\n";
    let plan = format!("name = \"small\"\nversion = \"1\"\n[[item]]\n{item}");
    let plan = place.write("small.toml", &plan);
    let run = place.run(["--auto", &plan.to_string_lossy(), "--sim", "--sim-speed", "max", "--serial-number", "GOOD"]);
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let good = place.runs().remove(0);
    let again = |run: &Path| place.run([std::ffi::OsStr::new("recompute"), run.as_os_str()]);
    let before = again(&good);
    assert_eq!(before.code, Some(0), "{}{}", before.stdout, before.stderr);

    let records = place.path().join("records");
    let day = good.ancestors().nth(2).expect("a day").to_owned();
    let bad = day.join("EVIL").join(good.file_name().expect("a name"));
    std::fs::create_dir(day.join("EVIL")).expect("a folder");
    std::fs::rename(&good, &bad).expect("a run");
    // In the raw samples as well: the name has as many letters.
    for (path, entry) in tree(&records).expect("a tree") {
        let attack::Entry::File(mut bytes) = entry else { continue };
        for at in 0..bytes.len().saturating_sub(3) {
            if bytes[at..].starts_with(b"GOOD") {
                bytes[at..at + 4].copy_from_slice(b"EVIL");
            }
        }
        std::fs::write(records.join(path), bytes).expect("a file");
    }
    attack::sums_anew(&records).expect("digests");
    attack::chain_anew(&records, false).expect("a chain");
    let after = again(&bad);
    assert_eq!(after.code, Some(2), "{}{}", after.stdout, after.stderr);
    assert!(after.stderr.contains("it is of another run: small of EVIL"), "{}", after.stderr);
    let (is_as_written, said) = verify(&records, &[]);
    assert!(!is_as_written && said.contains("attempt-1.mcap: it is of another run"), "{said}");
}

/// What is no copy of the counter, and no number and link, is refused with its form: nothing is called as written by it.
#[test]
fn a_witness_that_cannot_be_read_is_no_witness() {
    let kept = Kept::new();
    let link = kept.head.split(' ').nth(1).expect("a link").to_owned();
    let heads = ["", "8", "8 ", "x", "0 0", &format!("-1 {link}"), &format!("8 {}", &link[1..]), &format!("8 {link}0")];
    let mut witnesses: Vec<Vec<String>> = heads.map(|head| vec![format!("--head={head}")]).to_vec();
    let garbage = kept.place.path().join("garbage");
    std::fs::write(&garbage, "8 twelve\n").expect("a file");
    nix::unistd::mkfifo(&kept.place.path().join("pipe"), nix::sys::stat::Mode::S_IRWXU).expect("a pipe");
    for name in ["garbage", "none", "pipe", "records"] {
        let path = kept.place.path().join(name).to_string_lossy().into_owned();
        witnesses.push(vec!["--counter".to_owned(), path.clone()]);
        witnesses.push(vec!["--key".to_owned(), path]);
    }
    for witness in witnesses {
        let (code, said) = asked(&kept.records(), &witness);
        assert!(code == 2 && said.contains("\n  try: ") && !said.contains("as written"), "{witness:?}: {said}");
    }
    // Two that can be read count both.
    let both =
        |head: &str| verify(&kept.records(), &["--head".into(), kept.head.clone(), "--head".into(), head.into()]).0;
    assert!(both(&kept.head));
    assert!(!both(&format!("3 {link}")), "another line has this link");
}

/// A file that is refused since it is no file of its own is a finding, as one that was changed is, and never a mistake of the one who asks.
#[test]
fn what_is_refused_is_a_finding() {
    let kept = Kept::new();
    let run = "2026-11-28/T-1/090000-small";
    let files = ["COUNTER", "2026-11-28/CHAIN", "2026-11-29/CHAIN"].map(str::to_owned).into_iter();
    let of_run = ["SHA256SUMS", "SHA256SUMS.sig", "events.jsonl", "run.json"].map(|file| format!("{run}/{file}"));
    for file in files.chain(of_run) {
        let spoil: [fn(&Path); 4] = [
            |path| std::fs::create_dir(path).expect("a folder"),
            |path| nix::unistd::mkfifo(path, nix::sys::stat::Mode::S_IRWXU).expect("a pipe"),
            |path| std::os::unix::fs::symlink("../aside", path).expect("a link"),
            |path| std::fs::write(path, [0xff, 0, b'\n', 0xfe]).expect("garbage"),
        ];
        for (at, spoil) in spoil.into_iter().enumerate() {
            let (_place, records) = copied(&kept);
            std::fs::rename(records.join(&file), records.with_file_name("aside")).expect("a file");
            spoil(&records.join(&file));
            let key = ["--key".to_owned(), kept.public_key.to_string_lossy().into_owned()];
            let (code, said) = asked(&records, &key);
            assert_eq!((code, is_as_written(code, &said)), (1, false), "{file}, {at}: {said}");
        }
    }
}

/// A run that was emptied is none that never began, also if it alone is asked for.
#[test]
fn an_emptied_run_is_a_finding() {
    let kept = Kept::new();
    let run = "2026-11-28/T-2/091000-small";
    let (_place, records) = copied(&kept);
    for entry in std::fs::read_dir(records.join(run)).expect("a run") {
        let path = entry.expect("an entry").path();
        if path.is_file() {
            std::fs::remove_file(path).expect("a file");
        }
    }
    std::fs::write(records.join(run).join("events.jsonl"), "").expect("a journal");
    for witness in [vec![run.to_owned()], Vec::new()] {
        let (code, said) = asked(&records, &witness);
        assert_eq!(code, 1, "{said}");
        assert!(
            said.contains(&format!(
                "{run}: line 4 of the chain ({run}): the run was closed, and its SHA256SUMS is missing"
            )),
            "{said}"
        );
    }
}
