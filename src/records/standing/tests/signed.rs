//! A bench with a key: what its gate makes of runs that the key signed, that it did not, and that are from before it.

use std::fs;
use std::time::Instant;

use crate::store::{SIGNATURE, StationKey, digest};

use super::*;

/// A records folder of a bench with a key.
struct Bench {
    shelf: Shelf,
    key: StationKey,
    other: StationKey,
    _keys: tempfile::TempDir,
}

const NEXT: &str = "2026-11-28T16:00:00+08:00";

impl Bench {
    fn new() -> Self {
        let keys = tempfile::tempdir().expect("a folder");
        let make = |name: &str| {
            let path = keys.path().join(name);
            StationKey::create(&path).expect("a key");
            StationKey::read(&path).expect("a key")
        };
        Self { shelf: Shelf::new(), key: make("own"), other: make("other"), _keys: keys }
    }

    /// A whole run of SN-1 that passed, with its digests and both of its lines, by a key or none.
    fn run_by(&self, plan: &str, ended: &str, key: Option<&StationKey>) -> PathBuf {
        self.run_as(plan, ended, key, |_| {})
    }

    fn run_as(&self, plan: &str, ended: &str, key: Option<&StationKey>, change: impl Fn(&mut Value)) -> PathBuf {
        let run = self.shelf.open(plan, ended, change);
        fs::write(run.join(JOURNAL), format!("{plan} {ended}\n")).expect("a journal");
        let by = chain::Scribe { station: "bench 1", at: time(ended), key, late: None };
        chain::begin(&run, &by).expect("a line");
        seal(&run, key);
        chain::append_as(&run, &by).expect("a line");
        run
    }

    fn run(&self, ended: &str) -> PathBuf {
        self.run_by("functional", ended, Some(&self.key))
    }

    fn ask_with(&self, keys: &[PublicKey]) -> Standing {
        let plan = PlanAsked::Named("functional");
        let question =
            Question { serial_number: "SN-1", plan, valid_days: 30, bench: BenchKind::Real, now: time(NEXT) };
        read(self.shelf.path(), &question, keys).expect("records")
    }

    /// As a bench with the key asks, which has no other.
    fn ask(&self) -> Standing {
        self.ask_with(&[self.key.public()])
    }

    /// All lines of the chain of the day, as words.
    fn lines(&self) -> Vec<Vec<String>> {
        let text = fs::read_to_string(self.shelf.path().join("2026-11-28/CHAIN")).expect("a chain");
        text.lines().map(|line| line.split(' ').map(str::to_owned).collect()).collect()
    }

    /// Writes lines with links that fit, and the counter: what a person without the key can do.
    fn forge(&self, lines: Vec<Vec<String>>) {
        let (mut before, mut text) = ("0".repeat(64), String::new());
        let count = lines.len();
        for (at, mut words) in lines.into_iter().enumerate() {
            words[0] = (at + 1).to_string();
            words[1] = before;
            let end = words.iter().position(|word| word == "sig").unwrap_or(words.len());
            let run = self.shelf.path().join(&words[7]);
            if words[4] == "close" {
                words[2] = digest::of_file(&run.join(DIGESTS)).expect("digests");
            }
            words[3] = digest::of_bytes([&words[..3], &words[4..end]].concat().join(" ").as_bytes());
            before = words[3].clone();
            text.push_str(&format!("{}\n", words.join(" ")));
        }
        fs::write(self.shelf.path().join("2026-11-28/CHAIN"), text).expect("a chain");
        fs::write(self.shelf.path().join("COUNTER"), format!("{count} {before}\n")).expect("a counter");
    }
}

/// The digests of a run, signed if there is a key.
fn seal(run: &Path, key: Option<&StationKey>) {
    let mut sums = FileDigests::default();
    sums.add_new(run).expect("files");
    fs::write(run.join(DIGESTS), sums.text()).expect("digests");
    if let Some(key) = key {
        fs::write(run.join(SIGNATURE), key.sign(sums.text().as_bytes())).expect("a signature");
    }
}

fn failed(record: &mut Value) {
    record["outcome"] = json!("failed");
}

fn without_signatures(lines: Vec<Vec<String>>) -> Vec<Vec<String>> {
    let cut = |mut words: Vec<String>| {
        let end = words.iter().position(|word| word == "sig").unwrap_or(words.len());
        words.truncate(end);
        words
    };
    lines.into_iter().map(cut).collect()
}

#[test]
fn a_run_that_the_key_signed_counts() {
    let bench = Bench::new();
    bench.run(ENDED);
    assert!(bench.ask().passes_beyond_doubt());
    assert!(bench.ask_with(&[bench.other.public(), bench.key.public()]).passes_beyond_doubt(), "one of several keys");
    assert!(bench.ask_with(&[]).passes_beyond_doubt(), "a bench without a key looks at no signature");
}

/// A failed run is made a passed one, and everything but the signatures is made anew.
#[test]
fn a_verdict_that_was_forged_does_not_count() {
    for strip in [false, true] {
        let bench = Bench::new();
        bench.run_by("other", "2026-11-28T14:00:05+08:00", Some(&bench.key));
        let run = bench.run_as("functional", ENDED, Some(&bench.key), failed);
        assert!(!bench.ask().passes());
        let record = fs::read_to_string(run.join(RECORD)).expect("a record").replace("failed", "passed");
        fs::write(run.join(RECORD), record).expect("a record");
        seal(&run, None);
        let mut lines = bench.lines();
        if strip {
            fs::remove_file(run.join(SIGNATURE)).expect("a signature");
            let stripped = without_signatures(lines.split_off(2));
            lines.extend(stripped);
        }
        bench.forge(lines);
        assert!(bench.ask_with(&[]).passes_beyond_doubt(), "all but the signatures is as written");
        let standing = bench.ask();
        assert!(!standing.passes());
        assert_eq!(
            standing.to_string(),
            "functional passed 2026-11-28 14:30: not signed by a key that this bench trusts",
            "stripped: {strip}"
        );
        assert!(standing.try_this().contains("trusted_keys"), "{}", standing.try_this());
    }
}

/// A later run that failed is made a passed one: the pass before it is in doubt.
#[test]
fn a_forged_run_after_a_pass_closes_the_gate() {
    let bench = Bench::new();
    bench.run(ENDED);
    let run = bench.run_as("functional", "2026-11-28T14:40:05+08:00", Some(&bench.key), failed);
    assert!(!bench.ask().passes_beyond_doubt());
    let record = fs::read_to_string(run.join(RECORD)).expect("a record").replace("failed", "passed");
    fs::write(run.join(RECORD), record).expect("a record");
    seal(&run, None);
    bench.forge(bench.lines());
    let standing = bench.ask();
    assert!(!standing.passes_beyond_doubt(), "{standing}");
    assert_eq!(
        standing.to_string(),
        "functional passed 2026-11-28 14:30; then functional passed 2026-11-28 14:40: not signed by a key that this bench trusts"
    );
}

/// The lines are signed, and the digests of the folder, or the line of the beginning, are by another key or by none.
#[test]
fn each_signature_counts() {
    let spoil: [fn(&Bench, &Path); 3] = [
        |_, run| fs::remove_file(run.join(SIGNATURE)).expect("a signature"),
        |bench, run| fs::write(run.join(SIGNATURE), bench.other.sign(b"text")).expect("a signature"),
        |bench, _| {
            let mut lines = bench.lines();
            let first = lines[2].last_mut().expect("a signature");
            *first = "0".repeat(first.len());
            bench.forge(lines);
        },
    ];
    for (at, spoil) in spoil.into_iter().enumerate() {
        let bench = Bench::new();
        bench.run_by("other", "2026-11-28T14:00:05+08:00", Some(&bench.key));
        let run = bench.run(ENDED);
        spoil(&bench, &run);
        let standing = bench.ask();
        assert!(!standing.passes(), "{at}");
        assert!(standing.to_string().ends_with(": not signed by a key that this bench trusts"), "{at}: {standing}");
    }
}

/// Another station carried it out with its own key: its public half is named, or its pass does not count.
#[test]
fn a_pass_of_another_station_needs_its_key() {
    let bench = Bench::new();
    bench.run_by("functional", ENDED, Some(&bench.other));
    assert!(!bench.ask().passes());
    assert!(bench.ask_with(&[bench.key.public(), bench.other.public()]).passes_beyond_doubt());
}

/// A shop introduces a key: what it tested before counts as soon as one run was signed, whose line covers the lines before it.
#[test]
fn runs_from_before_the_key_count_behind_the_first_signed_one() {
    let bench = Bench::new();
    let old = bench.run_by("functional", ENDED, None);
    let standing = bench.ask();
    assert!(!standing.passes());
    assert_eq!(
        standing.to_string(),
        "functional passed 2026-11-28 14:30: from before the key, and no signed run came after it"
    );
    assert!(standing.try_this().starts_with("carry out any run with the key of this bench"));
    bench.run_by("other", "2026-11-28T14:50:05+08:00", Some(&bench.key));
    assert!(bench.ask().passes_beyond_doubt());
    // It is forged after that.
    let record = fs::read_to_string(old.join(RECORD)).expect("a record").replace("cpu", "gpu");
    fs::write(old.join(RECORD), record).expect("a record");
    seal(&old, None);
    bench.forge(bench.lines());
    assert!(bench.ask_with(&[]).passes() && !bench.ask().passes(), "{}", bench.ask());
}

/// One that is put behind the first signed line without a signature is no run from before the key.
#[test]
fn a_run_without_a_signature_behind_signed_ones_does_not_count() {
    let bench = Bench::new();
    bench.run_by("other", "2026-11-28T14:00:05+08:00", Some(&bench.key));
    bench.run_by("functional", ENDED, None);
    bench.run_by("other", "2026-11-28T14:50:05+08:00", Some(&bench.key));
    assert!(bench.ask_with(&[]).passes() && !bench.ask().passes(), "{}", bench.ask());
}

/// The last line of a day is written anew, and the first one of the next day stays.
#[test]
fn the_last_line_of_a_day_fits_the_next_day() {
    let bench = Bench::new();
    let run = bench.run_as("functional", ENDED, None, failed);
    bench.run_by("other", "2026-11-29T14:50:05+08:00", None);
    let record = fs::read_to_string(run.join(RECORD)).expect("a record").replace("failed", "passed");
    fs::write(run.join(RECORD), record).expect("a record");
    seal(&run, None);
    let counter = fs::read(bench.shelf.path().join("COUNTER")).expect("a counter");
    bench.forge(bench.lines());
    fs::write(bench.shelf.path().join("COUNTER"), counter).expect("a counter");
    assert_eq!(
        bench.ask_with(&[]).to_string(),
        "functional passed 2026-11-28 14:30: record was changed",
        "no key is needed for that"
    );
}

/// Behind 10,000 other runs the gate looks at the signatures of one run alone: they are none, and no folder of theirs is there. The times
/// are printed, with and without a key.
#[test]
fn the_gate_looks_at_the_signatures_of_one_run() {
    let bench = Bench::new();
    let (mut before, mut lines) = ("0".repeat(64), String::new());
    for number in 1..=10_000 {
        let tail = format!("close bench 2026-11-27T12:00:00+08:00 2026-11-27/SN-9/{number:06}-functional");
        let covered = format!("{number} {before} {before} {tail}");
        let link = digest::of_bytes(covered.as_bytes());
        lines.push_str(&format!("{number} {before} {before} {link} {tail} sig {link}{link}\n"));
        before = link;
    }
    fs::create_dir_all(bench.shelf.path().join("2026-11-27/SN-1")).expect("a folder");
    fs::write(bench.shelf.path().join("2026-11-27/CHAIN"), lines).expect("a chain");
    fs::write(bench.shelf.path().join("COUNTER"), format!("10000 {before}\n")).expect("a counter");
    bench.run(ENDED);
    for keys in [vec![], vec![bench.key.public()]] {
        let began = Instant::now();
        assert!(bench.ask_with(&keys).passes_beyond_doubt());
        println!("{} keys: {:?}", keys.len(), began.elapsed());
    }
}
