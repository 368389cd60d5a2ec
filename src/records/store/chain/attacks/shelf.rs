//! A folder of records that the real writer wrote.

use std::fs;
use std::path::{Path, PathBuf};

use gnc_executive::event::Event;
use gnc_executive::plan::Plan;
use serde_json::json;

use crate::store::chain::{Against, ChainBook, Head, Place, place_of, verify_against};
use crate::store::{
    DIGESTS, JOURNAL, PublicKey, RecordWriter, RunFolder, SIGNATURE, StationKey, StoreError, as_written, digest, reader,
};

pub(super) struct Shelf {
    folder: tempfile::TempDir,
    key: StationKey,
    public: PublicKey,
    /// A copy of the counter behind the last run.
    pub(super) counter: Head,
    /// What the papers of the last run say.
    pub(super) paper: Head,
}

impl Shelf {
    /// Two modules on two days, each signed.
    pub(super) fn new() -> Self {
        let mut shelf = Self::empty();
        shelf.run("2026-11-21T10:00:00+08:00", "A", "passed");
        shelf.run("2026-11-21T11:00:00+08:00", "B", "failed");
        shelf.run("2026-11-22T14:00:00+08:00", "A", "passed");
        let last = shelf.run("2026-11-22T15:00:00+08:00", "B", "passed");
        let counter = fs::read_to_string(shelf.path().join("COUNTER")).unwrap();
        shelf.counter.place = Place::parse(&counter).unwrap();
        shelf.paper.place = place_of(&shelf.path().join(last)).unwrap().unwrap();
        shelf
    }

    /// Two runs without a key, then one with it.
    pub(super) fn before_the_key() -> Self {
        let shelf = Self::empty();
        shelf.run_without_key("2026-11-21T10:00:00+08:00", "A", "passed");
        shelf.run_without_key("2026-11-21T11:00:00+08:00", "B", "failed");
        shelf.run("2026-11-22T14:00:00+08:00", "A", "passed");
        shelf
    }

    fn empty() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let keys = tempfile::tempdir().unwrap();
        let path = keys.path().join("key");
        let public = PublicKey::read(&StationKey::create(&path).unwrap()).unwrap();
        let head = |kept: &str| Head { kept: kept.to_owned(), place: Place { number: 0, link: String::new() } };
        let (counter, paper) = (head("counter.txt"), head("--head"));
        Self { folder, key: StationKey::read(&path).unwrap(), public, counter, paper }
    }

    pub(super) fn path(&self) -> &Path {
        self.folder.path()
    }

    /// A whole run of nine seconds; returns its name.
    pub(super) fn run(&self, at: &str, serial_number: &str, outcome: &str) -> String {
        self.write(at, serial_number, Some(outcome), Some(&self.key), ("real", "line 2")).unwrap()
    }

    /// A run of another station.
    pub(super) fn run_at(&self, station: &str, at: &str, serial_number: &str, with_key: bool) {
        let key = Some(&self.key).filter(|_| with_key);
        self.write(at, serial_number, Some("passed"), key, ("real", station)).unwrap();
    }

    pub(super) fn run_without_key(&self, at: &str, serial_number: &str, outcome: &str) -> String {
        self.write(at, serial_number, Some(outcome), None, ("real", "line 2")).unwrap()
    }

    /// A run whose station ends before its end.
    pub(super) fn begin(&self, at: &str, serial_number: &str) -> String {
        self.try_to_begin(at, serial_number).unwrap()
    }

    pub(super) fn try_to_begin(&self, at: &str, serial_number: &str) -> Result<String, StoreError> {
        self.write(at, serial_number, None, Some(&self.key), ("real", "line 2"))
    }

    /// A run on a simulated bench, which has no key.
    pub(super) fn simulated(&self, at: &str, serial_number: &str) {
        self.write(at, serial_number, Some("passed"), None, ("simulated", "line 2")).unwrap();
    }

    fn write(
        &self,
        at: &str,
        serial_number: &str,
        outcome: Option<&str>,
        key: Option<&StationKey>,
        (bench, station): (&str, &str),
    ) -> Result<String, StoreError> {
        let text = "name = \"functional\"\nversion = \"1\"\n[[item]]\nid = \"io\"\nlimits.wrong_reads = \"<= 0\"\n";
        let plan = Plan::read("functional.toml", text.into(), &mut |_| Err(String::new())).unwrap();
        let time: chrono::DateTime<chrono::FixedOffset> = at.parse().unwrap();
        let sha256 = crate::store::digest::of_plan(plan.files());
        let header = json!({
            "schema": "gnc-events/1", "serial_number": serial_number, "operator": null, "station": station,
            "program": { "name": "gnc-station", "version": "1.2" }, "bench": { "kind": bench }, "selection": null,
            "loop": null, "plan": { "name": "functional", "version": "1", "sha256": sha256 },
        });
        let end = (time + chrono::TimeDelta::seconds(9)).to_rfc3339();
        let mut events =
            vec![json!({ "seq": 0, "at": at, "elapsed_us": 0, "kind": "run_started", "header": header, "items": [] })];
        events.extend(outcome.map(
            |outcome| json!({ "seq": 1, "at": end, "elapsed_us": 9_000_000, "kind": "run_ended", "outcome": outcome }),
        ));
        let folder = RunFolder::create(self.path(), time, serial_number, "functional").unwrap();
        let name = folder.path().strip_prefix(self.path()).unwrap().to_str().unwrap().to_owned();
        let writer = RecordWriter::without_thread(folder.signed_with(key.cloned()), &plan, Vec::new()).unwrap();
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        runtime.block_on(async {
            for event in events {
                let event: Event = serde_json::from_value(event).unwrap();
                writer.state().lock().unwrap().apply(&event).unwrap();
                writer.place().await.unwrap().write(event, true).synced().await?;
            }
            writer.close().await
        })?;
        Ok(name)
    }

    /// All that is found, in any order of runs: of each run, and of the chain.
    pub(super) fn found(&self, with_key: bool, heads: &[&Head]) -> Vec<String> {
        let keys = if with_key { vec![self.public.clone()] } else { Vec::new() };
        let heads: Vec<Head> = heads.iter().map(|head| (*head).clone()).collect();
        let (checked, book) = verify_against(self.path(), &Against { keys: &keys, heads: &heads }).unwrap();
        let mut found = Vec::new();
        for run in reader::paths(self.path()).unwrap() {
            let name = run.strip_prefix(self.path()).unwrap().display().to_string();
            let mut problems = as_written::check(&run).problems;
            if book.why_unsigned(&run).is_none() || as_written::is_signed(&run) {
                problems.extend(as_written::verify_signature(&run, &keys));
            }
            found.extend(problems.iter().map(|problem| format!("{name}: {problem}")));
        }
        found.extend(checked.problems.iter().map(|problem| format!("chain: {problem}")));
        let folder = self.path().display().to_string();
        found.iter().map(|problem| problem.replace(&folder, "records")).collect()
    }

    /// What is found of the chain alone, with the key and the copy of the counter.
    pub(super) fn chain_found(&self) -> Vec<String> {
        let (keys, heads) = ([self.public.clone()], [self.counter.clone()]);
        verify_against(self.path(), &Against { keys: &keys, heads: &heads }).unwrap().0.problems
    }

    /// What is found of one run and its lines, with the key.
    pub(super) fn found_of(&self, run: &str) -> Vec<String> {
        let run = self.path().join(run);
        let mut found = as_written::check(&run).problems;
        found.extend(self.of_lines(&run, &[]));
        found
    }

    /// What is found of the lines of one run, with the key and what was kept elsewhere.
    pub(super) fn of_lines(&self, run: &Path, heads: &[Head]) -> Vec<String> {
        let against = Against { keys: std::slice::from_ref(&self.public), heads };
        ChainBook::read(self.path()).unwrap().of_run(run, &against).problems
    }

    pub(super) fn notes(&self) -> Vec<String> {
        let keys = [self.public.clone()];
        verify_against(self.path(), &Against { keys: &keys, heads: &[] }).unwrap().0.notes
    }

    /// A failed run becomes a passed one, in journal and record.
    pub(super) fn change_journal(&self, run: &str) {
        for file in [JOURNAL, "run.json"] {
            let path = self.path().join(run).join(file);
            let text = fs::read_to_string(&path).unwrap();
            assert!(text.contains("failed"));
            fs::write(path, text.replace("failed", "passed")).unwrap();
        }
    }

    /// As `sha256sum` makes them.
    pub(super) fn make_digests(&self, run: &str) {
        let run = self.path().join(run);
        let files = digest::files_below(&run).unwrap().into_iter();
        let lines = files
            .filter(|file| file != Path::new(SIGNATURE))
            .map(|file| format!("{}  {}\n", super::forge::sha256(&fs::read(run.join(&file)).unwrap()), file.display()));
        fs::write(run.join(DIGESTS), lines.collect::<String>()).unwrap();
    }

    pub(super) fn remove(&self, name: &str) {
        let path = self.path().join(name);
        if path.is_dir() {
            fs::remove_dir_all(path).unwrap();
        } else {
            fs::remove_file(path).unwrap();
        }
        self.leave_no_empty_folder(name);
    }

    /// Who takes away what stood in a folder takes the folder away as well.
    fn leave_no_empty_folder(&self, name: &str) {
        let parents = std::path::Path::new(name).ancestors().skip(1).filter(|parent| parent.components().count() > 0);
        let _ = parents.map(|parent| fs::remove_dir(self.path().join(parent))).take_while(Result::is_ok).count();
    }

    pub(super) fn rename(&self, from: &str, to: &str) {
        let to = self.path().join(to);
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::rename(self.path().join(from), to).unwrap();
        self.leave_no_empty_folder(from);
    }

    pub(super) fn swap(&self, one: &str, other: &str) {
        self.rename(one, "between");
        self.rename(other, one);
        self.rename("between", other);
    }

    pub(super) fn link(&self, to: &str, name: &str) {
        let name = self.path().join(name);
        fs::create_dir_all(name.parent().unwrap()).unwrap();
        std::os::unix::fs::symlink(self.path().join(to), name).unwrap();
    }

    pub(super) fn copy(&self, from: &str, to: &str) {
        let mut folders: Vec<(PathBuf, PathBuf)> = vec![(self.path().join(from), self.path().join(to))];
        while let Some((from, to)) = folders.pop() {
            fs::create_dir_all(&to).unwrap();
            for entry in fs::read_dir(&from).unwrap() {
                let path = entry.unwrap().path();
                let to = to.join(path.file_name().unwrap());
                if path.is_dir() {
                    folders.push((path, to));
                } else {
                    fs::copy(path, to).unwrap();
                }
            }
        }
    }
}
