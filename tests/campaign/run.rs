//! One run of a campaign: carried out over one of the two ways, and what came of it.

use std::path::Path;
use std::time::Duration;

use gnc_executive::outcome::Outcome;
use gnc_executive::record::RunRecord;
use gnc_records::store::reader;
use hw_mocks::{LineTruth, Options, Personality, Speed};
use tokio::time::Instant;

use super::case::{Case, Disturbance};
use super::{memory, pty};

/// Where station and bench meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Over {
    /// In memory, on a clock that moves when both wait: a seed repeats a run exactly.
    Memory,
    /// Over pseudo-terminals, at full speed by the computer's clock: a seed repeats which faults there are and at which
    /// event somebody pulls a cable; which frames the dice hit depends on how many there are, and that on wall time.
    Pty,
}

/// A run on a clean line takes a second or two; one in which every item meets a dead line twice some forty, and over CAN,
/// where a message that breaks off takes a second more, some eighty. Twice that on a computer that is busy.
pub const LONGEST: Duration = Duration::from_secs(160);
/// The watchdog of the board switches the module off 2 s after the last word of the station; the rest is for a computer
/// with a dozen runs on it.
pub(super) const SAFE_AFTER: Duration = Duration::from_secs(5);
/// What came of a run.
#[derive(Debug, Clone, Default)]
pub struct Ran {
    /// Its record; `None` if it did not come to an end, or left none.
    pub record: Option<RunRecord>,
    /// What the station called it.
    pub outcome: Option<Outcome>,
    /// In memory no computer that stands still comes between station and bench.
    pub in_memory: bool,
    /// Its events as they stand on disk.
    pub journal: Vec<u8>,
    /// What is wrong with the record, or hindered the run.
    pub problems: Vec<String>,
    /// How long it took.
    pub took: Duration,
    /// From the disturbance to the end of the run; `None` if it ended before.
    pub since_disturbed: Option<Duration>,
    /// From the end of the run until the module was off; `None` if it never was.
    pub off_after: Option<Duration>,
    /// From the disturbance until the module was off; `None` if nobody disturbed it, or it never was.
    pub off_since_disturbed: Option<Duration>,
    /// What the line really did.
    pub line: LineTruth,
    /// Restarts of the board, its first start not counted.
    pub restarts: u32,
}

impl Ran {
    /// With the record in this folder, and what is wrong with it.
    pub(super) fn with_record(mut self, outcome: Outcome, folder: &Path) -> Self {
        self.outcome = Some(outcome);
        self.problems.extend(reader::verify(folder));
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
    /// Those about which something is wrong.
    Wrong,
    /// All.
    All,
}

/// Runs it; its record is kept in a folder if one is given and it is one of those.
#[must_use]
pub fn run(case: &Case, over: Over, keep: Option<(&Path, Kept)>) -> Ran {
    match tempfile::TempDir::new() {
        Ok(place) => {
            let ran = run_in(case, over, place.path());
            let kept = keep.filter(|(_, kept)| *kept == Kept::All || !super::violations(case, &ran).is_empty());
            if let Some((keep, _)) = kept {
                // Whether it can be kept or not, the run is told of.
                let _ = std::fs::write(place.path().join("board.toml"), case.text());
                let _ = std::fs::create_dir_all(keep);
                let _ = std::fs::rename(place.keep(), keep.join(format!("{}-{}", case.seed, case.number)));
            }
            ran
        }
        Err(error) => Ran { problems: vec![format!("no folder for the run: {error}")], ..Ran::default() },
    }
}

/// Runs it once more, in memory; the first line in which its journal differs from that of the first time.
#[must_use]
pub fn differs(case: &Case, first: &Ran) -> Option<String> {
    let again = run(case, Over::Memory, None);
    let lines = |ran: &Ran| String::from_utf8_lossy(&ran.journal).lines().map(str::to_owned).collect::<Vec<_>>();
    let (one, other) = (lines(first), lines(&again));
    let differs = one.iter().zip(&other).find(|(one, other)| one != other);
    match differs {
        Some((one, other)) => Some(format!("run again it was another run:\n  {one}\n  {other}")),
        None if (first.journal.len(), first.took, first.line) != (again.journal.len(), again.took, again.line) => {
            Some("run again it ended elsewhere".to_owned())
        }
        None => None,
    }
}

/// Runs it with all of its files in this folder.
fn run_in(case: &Case, over: Over, place: &Path) -> Ran {
    let ran = match over {
        Over::Memory => memory::run_in(case, place),
        Over::Pty => pty::run_in(case, place),
    };
    ran.unwrap_or_else(|why| Ran { problems: vec![why], ..Ran::default() })
}

/// The bench of a case.
pub(super) fn options(case: &Case, speed: Speed) -> Result<Options, String> {
    let personality = Personality::from_toml(case.board, &case.text()).map_err(|error| error.to_string())?;
    let (serial_number, seed) = (Some("T-1".to_owned()), case.bench_seed());
    Ok(Options { serial_number, seed, speed, personality, ..Options::default() })
}

/// What somebody does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Act {
    Stop,
    Unplug,
    Suspend(Duration),
    PlugIn,
}

/// What somebody does from now on, and when.
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
