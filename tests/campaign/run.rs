//! One run of a campaign, carried out over one of the two ways, and its result.

use std::path::Path;
use std::time::Duration;

use gnc_executive::outcome::Outcome;
use gnc_executive::record::RunRecord;
use gnc_executive::verdict::Verdict;
use gnc_records::store::as_written;
use gnc_records::store::reader;
use hw_mocks::{BenchOptions, LineTruth, Personality, Speed};
use tokio::time::Instant;

use super::case::{Case, Disturbance};
use super::{memory, pty};

/// Where station and bench meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Over {
    /// In memory, on a clock that moves when both wait: a seed repeats a run exactly.
    Memory,
    /// Over pseudo-terminals, at full speed by the computer's clock. A seed repeats the kinds of faults and the event
    /// at which a cable is pulled. It does not repeat which frames are hit: that depends on the number of frames, and
    /// so on wall time.
    Pty,
}

/// Longest time of a run. A run on a clean line takes a second or two. If every item meets a dead line twice, it takes
/// some forty. Over CAN it takes some eighty, since each broken-off message takes a second more. A busy computer
/// doubles this.
pub const LONGEST: Duration = Duration::from_secs(160);
/// Longest wait until the module is off. The board's watchdog switches the module off 2 s after the last frame of the
/// station; the rest is for a computer with a dozen runs.
pub(super) const SAFE_AFTER: Duration = Duration::from_secs(5);
/// The result of a run.
#[derive(Debug, Clone, Default)]
pub struct Ran {
    /// Its record; `None` if it did not come to an end, or left no record.
    pub record: Option<RunRecord>,
    /// The verdict by the station.
    pub verdict: Option<Verdict>,
    /// Whether the run was in memory, where a computer that stands still cannot separate station and bench.
    pub in_memory: bool,
    /// Its events as they are on disk.
    pub journal: Vec<u8>,
    /// Errors of the record, or of the run itself.
    pub problems: Vec<String>,
    /// Duration of the run.
    pub took: Duration,
    /// Time from the disturbance to the end of the run; `None` if the run ended before.
    pub since_disturbed: Option<Duration>,
    /// Time from the end of the run until the module was off; `None` if it never was.
    pub off_after: Option<Duration>,
    /// Time from the disturbance until the module was off; `None` if the run was not disturbed, or the module never was
    /// off.
    pub off_since_disturbed: Option<Duration>,
    /// What the line really did.
    pub line: LineTruth,
    /// Restarts of the board after its first start.
    pub restarts: u32,
}

impl Ran {
    /// The outcome for the module, by the station.
    #[must_use]
    pub fn outcome(&self) -> Option<Outcome> {
        self.verdict.and_then(Verdict::of_module)
    }

    /// Adds the record in this folder, and its errors.
    pub(super) fn with_record(mut self, verdict: Verdict, folder: &Path) -> Self {
        self.verdict = Some(verdict);
        self.problems.extend(as_written::verify(folder));
        match std::fs::read(folder.join("events.jsonl")) {
            Ok(journal) => self.journal = journal,
            Err(error) => self.problems.push(format!("its journal: {error}")),
        }
        match reader::read(folder) {
            Ok(record) => self.record = Some(record),
            Err(error) => self.problems.push(error.to_string()),
        }
        self
    }
}

/// Which records are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kept {
    /// Records of runs with errors.
    Wrong,
    /// All records.
    All,
}

/// Runs the case. The record is kept in the folder if one is given and the record is of the kind to keep.
#[must_use]
pub fn run(case: &Case, over: Over, keep: Option<(&Path, Kept)>) -> Ran {
    match tempfile::TempDir::new() {
        Ok(place) => {
            let ran = run_in(case, over, place.path());
            let kept = keep.filter(|(_, kept)| *kept == Kept::All || !super::violations(case, &ran).is_empty());
            if let Some((keep, _)) = kept {
                // The run is reported even if its record cannot be kept.
                let _ = std::fs::write(place.path().join("board.toml"), case.text());
                let _ = std::fs::create_dir_all(keep);
                let _ = std::fs::rename(place.keep(), keep.join(format!("{}-{}", case.seed, case.number)));
            }
            ran
        }
        Err(error) => Ran { problems: vec![format!("no folder for the run: {error}")], ..Ran::default() },
    }
}

/// Runs the case again, in memory; returns the first line in which its journal differs from the first one.
#[must_use]
pub fn differs(case: &Case, first: &Ran) -> Option<String> {
    let again = run(case, Over::Memory, None);
    let lines = |ran: &Ran| String::from_utf8_lossy(&ran.journal).lines().map(str::to_owned).collect::<Vec<_>>();
    let (one, other) = (lines(first), lines(&again));
    let differs = one.iter().zip(&other).find(|(one, other)| one != other);
    match differs {
        Some((one, other)) => Some(format!("the second run with this seed differs:\n  {one}\n  {other}")),
        None if (first.journal.len(), first.took, first.line) != (again.journal.len(), again.took, again.line) => {
            Some("the second run with this seed ended at another point".to_owned())
        }
        None => None,
    }
}

/// Runs the case with all of its files in this folder.
fn run_in(case: &Case, over: Over, place: &Path) -> Ran {
    let ran = match over {
        Over::Memory => memory::run_in(case, place),
        Over::Pty => pty::run_in(case, place),
    };
    ran.unwrap_or_else(|why| Ran { problems: vec![why], ..Ran::default() })
}

/// The bench of a case.
pub(super) fn options(case: &Case, speed: Speed) -> Result<BenchOptions, String> {
    let personality = Personality::from_toml(case.board, &case.text()).map_err(|error| error.to_string())?;
    let (serial_number, seed) = (Some("T-1".to_owned()), case.bench_seed());
    Ok(BenchOptions { serial_number, seed, speed, personality, ..BenchOptions::default() })
}

/// An action of a disturbance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Act {
    Stop,
    Unplug,
    Suspend(Duration),
    PlugIn,
}

/// The actions of the case from now on, with their times.
pub(super) fn acts(case: &Case) -> Vec<(Instant, Act)> {
    let at = Instant::now() + case.moment.1;
    match case.disturbance {
        Disturbance::None => Vec::new(),
        Disturbance::Suspend(span) => vec![(at, Act::Suspend(span))],
        Disturbance::Stop { again } => {
            [Some(at), again.map(|after| at + after)].into_iter().flatten().map(|at| (at, Act::Stop)).collect()
        }
        Disturbance::Unplug { back } => {
            let back = back.map(|after| (at + after, Act::PlugIn));
            [Some((at, Act::Unplug)), back].into_iter().flatten().collect()
        }
    }
}
