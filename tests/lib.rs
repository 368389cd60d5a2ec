//! Runs the station as its users do and reads the files that it leaves.

#![expect(clippy::expect_used, clippy::panic, reason = "what cannot be set up fails the test that needs it")]

mod board;
pub mod campaign;
pub mod older;

use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

pub use board::Board;

/// Exit code of a run of chosen items that are good: no pass of the module.
pub const PARTIAL: Option<i32> = Some(5);

/// Number of a user and a group without rights, as whom a program runs where the tests are root's.
pub const UNPRIVILEGED: u32 = 65_534;

/// The functional plan of the repository.
#[must_use]
pub fn functional_plan() -> PathBuf {
    repository().join("test-plans/functional.toml")
}

/// The root of the repository.
#[must_use]
pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// All boards that come with the simulated bench, by file.
///
/// # Panics
/// The folder cannot be read.
#[must_use]
pub fn boards() -> Vec<PathBuf> {
    let folder = repository().join("hw-mocks/boards");
    let mut boards: Vec<PathBuf> = std::fs::read_dir(folder)
        .expect("hw-mocks/boards")
        .map(|entry| entry.expect("hw-mocks/boards").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .collect();
    boards.sort();
    boards
}

/// The station as a user without rights if the test is root's. That user may not come to the program where it was built, so the
/// folder gets a copy. Another program makes it: a child of another test may inherit a descriptor of this process that writes, and the
/// system starts no program that is open for writing.
///
/// # Panics
/// The copy cannot be made.
#[must_use]
pub fn without_rights(station: &str, folder: &Path) -> Command {
    if !nix::unistd::geteuid().is_root() {
        return Command::new(station);
    }
    let copy = folder.join("station");
    if !copy.exists() {
        assert!(Command::new("cp").args([Path::new(station), &copy]).status().expect("cp").success());
    }
    let mut command = Command::new(copy);
    command.uid(UNPRIVILEGED).gid(UNPRIVILEGED);
    command
}

/// A new folder in which the station works.
#[derive(Debug)]
pub struct Place {
    folder: TempDir,
    station: PathBuf,
}

impl Place {
    /// An empty folder; `station` is the program under test.
    ///
    /// # Panics
    /// The folder cannot be created.
    #[must_use]
    pub fn new(station: &str) -> Self {
        Self { folder: TempDir::new().expect("a temporary folder"), station: station.into() }
    }

    /// The path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Writes a file into the folder.
    ///
    /// # Panics
    /// The file cannot be written.
    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path().join(name);
        std::fs::write(&path, text).expect(name);
        path
    }

    /// The station's command with these arguments, in this folder.
    #[must_use]
    pub fn station<S: AsRef<std::ffi::OsStr>>(&self, args: impl IntoIterator<Item = S>) -> Command {
        let mut command = Command::new(&self.station);
        command.args(args).current_dir(self.path()).stdin(Stdio::null()).env("NO_COLOR", "1");
        // Lines for people are in the language of the locale.
        command.env("LC_ALL", "C.UTF-8");
        command
    }

    /// Runs the functional plan on a simulated board.
    ///
    /// # Panics
    /// The program cannot be started.
    #[must_use]
    pub fn functional(&self, sim: &str, more: &[&str]) -> Run {
        let plan = functional_plan();
        let fixed = ["--auto", &plan.to_string_lossy(), sim, "--serial-number", "T-1"].map(str::to_owned);
        self.run(fixed.into_iter().chain(more.iter().map(|arg| (*arg).to_owned())))
    }

    /// Runs the station to its end.
    ///
    /// # Panics
    /// The program cannot be started.
    #[must_use]
    pub fn run<S: AsRef<std::ffi::OsStr>>(&self, args: impl IntoIterator<Item = S>) -> Run {
        let Output { status, stdout, stderr } = self.station(args).output().expect("the station");
        Run {
            code: status.code(),
            stdout: String::from_utf8_lossy(&stdout).into_owned(),
            stderr: String::from_utf8_lossy(&stderr).into_owned(),
        }
    }

    /// The folders of all runs, oldest first.
    ///
    /// # Panics
    /// The records cannot be read.
    #[must_use]
    pub fn runs(&self) -> Vec<PathBuf> {
        let records = self.path().join("records");
        if !records.exists() {
            return Vec::new();
        }
        let found = gnc_records::store::reader::list(&records).expect("records");
        found.into_iter().map(|run| run.path).collect()
    }

    /// The record of the only run.
    ///
    /// # Panics
    /// There is not exactly one run, or the record is not JSON.
    #[must_use]
    pub fn record(&self) -> Value {
        let runs = self.runs();
        assert_eq!(runs.len(), 1, "{runs:?}");
        read_json(&runs[0].join("run.json"))
    }
}

/// The result of a run of the station.
#[derive(Debug)]
pub struct Run {
    /// Its exit code; `None` if it was killed.
    pub code: Option<i32>,
    /// Standard output: text for people, or events.
    pub stdout: String,
    /// Standard error: messages about errors.
    pub stderr: String,
}

/// Reads a JSON file.
///
/// # Panics
/// The file is missing or is not JSON.
#[must_use]
pub fn read_json(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Names of the items that failed or errored. Items that were skipped because of them are not at fault.
#[must_use]
pub fn bad_items(record: &Value) -> Vec<String> {
    let items = record["items"].as_array().into_iter().flatten();
    items
        .filter(|item| matches!(item["outcome"].as_str(), Some("failed" | "errored" | "aborted")))
        .filter_map(|item| item["name"].as_str().map(str::to_owned))
        .collect()
}
