//! `--resume RUN`: takes up an interrupted run again and takes over its complete captures.
//!
//! Only captures are taken over: items that need only seconds run again. Everything must be unchanged: plan, chosen
//! items, serial number, bench, the board's firmware and, unless the run stored another one, the calibration that the
//! module keeps. A run that ended with a verdict on the module was not interrupted. Its captures show the module as it was
//! then, so the next run makes its own.
//!
//! An interrupted run may have taken up another one before. What it did not come to take over is taken from there.

use std::path::{Path, PathBuf};

use chrono::{DateTime, FixedOffset, TimeDelta};
use gnc_analysis::capture::Capture;
use gnc_executive::catalogue::Trace;
use gnc_executive::event::{BenchInfo, EarlierRun, Event, EventKind, OtherModule, RunHeader};
use gnc_executive::outcome::Outcome;
use gnc_executive::part::LimitsChosen;
use gnc_executive::standing::CLOCK_SLACK;
use gnc_executive::verdict::Verdict;
use sha2::{Digest as _, Sha256};

use crate::raw::RawRecord;
use crate::store::captured::CapturedFiles;
use crate::store::captures::{self, CapturesError};
use crate::store::reader::{self, ReadError};
use crate::store::{self, DIGESTS, JOURNAL, PublicKey, StationKey, digest};

mod own;

/// Longest journal of a run that is taken up again: it is in memory as a whole, beside what it says.
const MAX_JOURNAL_BYTES: u64 = 256 << 20;

/// Largest number of runs, each of which took up the one before, that are searched for captures.
const MAX_EARLIER: usize = 20;
/// Tenths of one.
const TENTHS: i64 = 10;
/// Seconds of a day.
const SECONDS_OF_DAY: i64 = 86_400;
/// The calibration of a module whose board cannot tell it.
const UNKNOWN: &str = "unknown";

/// Why a run cannot be taken up again.
#[derive(Debug, thiserror::Error)]
pub enum ResumeError {
    /// The run does not exist, or its journal is damaged.
    #[error("the run to resume cannot be read")]
    Unreadable(#[source] ReadError),
    /// A condition has changed.
    #[error("the run to resume had {what} {was}, this run has {is}")]
    Unlike {
        /// The condition.
        what: &'static str,
        /// Its value in the earlier run.
        was: String,
        /// Its value now.
        is: String,
    },
    /// The run was of another module than was scanned.
    #[error(
        "the run to resume was of another module: {} was scanned, {} was in the socket",
        gnc_text::quoted(&.0.scanned), gnc_text::quoted(&.0.found)
    )]
    OtherModule(OtherModule),
    /// The run was not interrupted.
    #[error("the run to resume was not interrupted: its outcome is {}", .0.as_str())]
    Ended(Verdict),
    /// The run ended, but without digests its files cannot be checked.
    #[error("the run to resume ended, and its {DIGESTS} is missing")]
    Unsealed,
    /// The captures are older than a pass may be.
    #[error(
        "the run to resume began {}, {} days ago, and the plan takes nothing older than {valid_days} days",
        began.format("%F %H:%M"), days(*age)
    )]
    TooOld {
        /// When it began.
        began: DateTime<FixedOffset>,
        /// How long ago that is.
        age: TimeDelta,
        /// Days for which a pass of the plan counts.
        valid_days: u32,
    },
    /// The clock was set back since then, so the age of the captures is unknown.
    #[error(
        "the run to resume began {}, later than this computer's clock ({})",
        began.format("%F %H:%M"), now.format("%F %H:%M")
    )]
    InFuture {
        /// When it began.
        began: DateTime<FixedOffset>,
        /// The time by the clock of the computer.
        now: DateTime<FixedOffset>,
    },
    /// The run was closed late, so nothing proves that its samples are those that were captured.
    #[error("the run to resume was closed late, so its captures prove nothing")]
    ClosedLate,
    /// Another station is carrying out the run now.
    #[error("the run to resume is still running")]
    GoesOn,
    /// The station has a key, and the run lies elsewhere.
    #[error("the run to resume is not in the records folder of this station, {}", gnc_text::shown_path(records))]
    Outside {
        /// The records folder of the station.
        records: PathBuf,
    },
    /// A file of a closed run was changed, or what the chain or the key says speaks against the run.
    #[error("the run to resume fails its verification: {what}")]
    Changed {
        /// The change.
        what: String,
    },
    /// The raw samples of the run cannot be read.
    #[error(transparent)]
    Captures(#[from] CapturesError),
}

impl ResumeError {
    /// What the operator can try.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        match self {
            Self::Unreadable(error) => error.try_this(),
            Self::OtherModule(_)
            | Self::Unlike { .. }
            | Self::Ended(_)
            | Self::Unsealed
            | Self::ClosedLate
            | Self::TooOld { .. } => "run the plan from its beginning, without --resume",
            Self::InFuture { .. } => "set the clock of this computer right, or run without --resume",
            Self::GoesOn => "wait until that run ends, or stop it where it runs",
            Self::Outside { .. } => {
                "name a run in that folder, or run with --records and the folder that holds the run"
            }
            Self::Changed { .. } => "restore the run's folder from a backup, or run without --resume",
            Self::Captures(error) => error.source.try_this(),
        }
    }
}

/// The properties that the new run must share with the earlier one, as far as they are known without a board.
#[derive(Debug, Clone, Copy)]
pub struct Like<'a> {
    /// SHA-256 of the plan with all that it includes.
    pub plan_sha256: &'a str,
    /// The module's serial number.
    pub serial_number: &'a str,
    /// The bench.
    pub bench: &'a BenchInfo,
    /// Names of the chosen items; `None` for the whole plan.
    pub selection: Option<&'a [String]>,
    /// Days for which a pass of the plan counts: captures that are older are not taken over.
    pub valid_days: u32,
    /// The time by the clock of the computer.
    pub now: DateTime<FixedOffset>,
    /// The folder of all records of the station.
    pub records: &'a Path,
    /// The key of the station, which signed all that the earlier run says. Without it, no signature is checked.
    pub key: Option<&'a StationKey>,
}

impl<'a> Like<'a> {
    /// The properties of a run with this header that begins now in this records folder, by a plan whose passes count for so many days.
    #[must_use]
    pub fn header(header: &'a RunHeader, valid_days: u32, now: DateTime<FixedOffset>, records: &'a Path) -> Self {
        Self {
            plan_sha256: &header.plan.sha256,
            serial_number: &header.serial_number,
            bench: &header.bench,
            selection: header.selection.as_deref(),
            valid_days,
            now,
            records,
            key: None,
        }
    }

    /// The same for a station with this key.
    #[must_use]
    pub fn with_key(self, key: Option<&'a StationKey>) -> Self {
        Self { key, ..self }
    }

    /// Checks that a run which began then is as young as a pass must be: what it captured counts as if it were of now.
    fn is_young(&self, began: DateTime<FixedOffset>) -> Result<(), ResumeError> {
        let (now, age) = (self.now, self.now - began);
        if age < -CLOCK_SLACK {
            return Err(ResumeError::InFuture { began, now });
        }
        if age > TimeDelta::days(i64::from(self.valid_days)) {
            return Err(ResumeError::TooOld { began, age, valid_days: self.valid_days });
        }
        Ok(())
    }
}

/// An age in days, rounded up to a tenth: it is never shown as the limit that it exceeds.
fn days(age: TimeDelta) -> String {
    let tenths = age.num_seconds().saturating_mul(TENTHS).div_euclid(SECONDS_OF_DAY) + 1;
    format!("{}.{}", tenths / TENTHS, tenths % TENTHS)
}

/// An interrupted run.
#[derive(Debug, Clone)]
pub struct Resumed {
    folder: PathBuf,
    journal_sha256: String,
    firmware: Option<String>,
    /// The calibration that the module kept at the first power-on; `None` if the run may have stored another one.
    calibration: Option<String>,
    /// The limits that were chosen by the module's part number.
    limits: Option<LimitsChosen>,
    /// Items that had begun: position in the plan, name, last attempt.
    begun: Vec<(usize, String, u32)>,
    /// What the journal says of the raw files.
    captured: CapturedFiles,
    /// The key of the station that takes the run up: it must have signed what the journal says.
    key: Option<PublicKey>,
    /// Whether the run has no end: until its station started again, nothing but the journal covered its raw files.
    was_open: bool,
    /// Why nothing shows whose the run is, if that is so.
    unproven: Option<&'static str>,
    /// The run that this one had taken up.
    before: Option<Box<Resumed>>,
}

impl Resumed {
    /// Reads a run and compares it with the new one.
    ///
    /// # Errors
    /// [`ResumeError`].
    pub fn read(folder: &Path, like: Like<'_>) -> Result<Self, ResumeError> {
        Self::read_with_earlier(folder, like, MAX_EARLIER)
    }

    fn read_with_earlier(folder: &Path, like: Like<'_>, earlier: usize) -> Result<Self, ResumeError> {
        let path = folder.join(JOURNAL);
        let unreadable = |source| ResumeError::Unreadable(ReadError::File { path: path.clone(), source });
        // Links and `..` would show the chain of other records.
        let folder = &folder.canonicalize().map_err(unreadable)?;
        let state = reader::fold(folder).map_err(ResumeError::Unreadable)?;
        let journal = gnc_files::read_below(folder, Path::new(JOURNAL), MAX_JOURNAL_BYTES).map_err(unreadable)?;
        let was = state.header().ok_or(ResumeError::Unreadable(ReadError::Empty))?;
        same("the plan with the digest", &was.plan.sha256, like.plan_sha256)?;
        same("the serial number", &was.serial_number, like.serial_number)?;
        same("the bench", &bench(&was.bench), &bench(like.bench))?;
        if let Some(other) = state.other_module() {
            return Err(ResumeError::OtherModule(other.clone()));
        }
        if store::goes_on(folder) {
            return Err(ResumeError::GoesOn);
        }
        same("the selection", &items(was.selection.as_deref()), &items(like.selection))?;
        match state.verdict().filter(|_| !state.is_interrupted()) {
            Some(verdict) if matches!(verdict.of_items(), Outcome::Passed | Outcome::Marginal | Outcome::Failed) => {
                return Err(ResumeError::Ended(verdict));
            }
            Some(_) if !reader::is_sealed(folder) => return Err(ResumeError::Unsealed),
            _ => {}
        }
        like.is_young(began(&journal).ok_or(ResumeError::Unreadable(ReadError::Empty))?)?;
        let captured = CapturedFiles::read(folder).map_err(ResumeError::Unreadable)?;
        let unproven = own::check(folder, &state, &captured, &like)?;
        let begun: Vec<(usize, String, u32)> = (state.rows().iter().enumerate())
            .filter(|(_, row)| !row.attempts.is_empty())
            .map(|(position, row)| (position, row.planned.name.clone(), u32::try_from(row.attempts.len()).unwrap_or(1)))
            .collect();
        let stores = begun.iter().any(|(position, ..)| state.rows()[*position].planned.id.leaves(Trace::Coefficients));
        let lines = journal.split_inclusive(|byte| *byte == b'\n');
        let mut events = lines.map_while(|line| serde_json::from_slice::<Event>(line).ok());
        let kept = events.find_map(|event| match event.kind {
            EventKind::Power(power) if power.on => Some(power.calibration.unwrap_or_else(|| UNKNOWN.to_owned())),
            _ => None,
        });
        let before = match (earlier, was.resumed.as_ref().and_then(|before| folder_of(folder, before))) {
            (1.., Some(before)) => Some(Box::new(Self::read_with_earlier(&before, like, earlier - 1)?)),
            _ => None,
        };
        // A run that ended before the module had power knows no more than the one before it.
        let knows = before.as_deref().filter(|_| kept.is_none());
        Ok(Self {
            folder: folder.to_owned(),
            journal_sha256: digest::hexadecimal(&Sha256::digest(&journal)),
            firmware: state
                .board()
                .map(|board| board.firmware.clone())
                .or_else(|| before.as_ref().and_then(|before| before.firmware.clone())),
            calibration: kept.or_else(|| knows.and_then(|before| before.calibration.clone())).filter(|_| !stores),
            limits: state.limits().cloned().or_else(|| before.as_ref().and_then(|before| before.limits.clone())),
            begun,
            captured,
            key: like.key.map(StationKey::public),
            was_open: state.is_interrupted(),
            unproven,
            before,
        })
    }

    /// The entry by which the new run names the earlier one.
    #[must_use]
    pub fn earlier(&self) -> EarlierRun {
        let run = self.folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        EarlierRun { run, journal_sha256: self.journal_sha256.clone() }
    }

    /// Checks that the board's firmware and the module's calibration are unchanged.
    ///
    /// # Errors
    /// [`ResumeError::Unlike`].
    pub fn fits(&self, firmware: Option<&str>, calibration: Option<&str>) -> Result<(), ResumeError> {
        // A run that was interrupted before it found a board has no captures either.
        if let Some(was) = &self.firmware {
            same("the firmware", was, firmware.unwrap_or("none"))?;
        }
        if let Some(was) = &self.calibration {
            same("a module with the calibration", was, calibration.unwrap_or(UNKNOWN))?;
        }
        Ok(())
    }

    /// Checks that the module is judged by the limits of the earlier run.
    ///
    /// # Errors
    /// [`ResumeError::Unlike`].
    pub fn fits_limits(&self, chosen: &LimitsChosen) -> Result<(), ResumeError> {
        match &self.limits {
            Some(was) if was.part != chosen.part => same("the limits", &was.to_string(), &chosen.to_string()),
            _ => Ok(()),
        }
    }

    /// The complete captures of a round of an item, from 1; none if the round had not begun.
    ///
    /// # Errors
    /// The raw samples of the item are damaged.
    pub fn captures(&self, item: &str, repeat: u32) -> Result<Taken, ResumeError> {
        let begun = self.begun.iter().find(|(_, name, _)| name == item);
        let mut taken = match begun {
            Some((position, name, attempt)) => {
                self.complete(&captures::path(&self.folder, *position, name, *attempt, repeat))?
            }
            None => Taken::default(),
        };
        if let Some(why) = self.unproven.filter(|_| !taken.captures.is_empty() && taken.doubts.is_empty()) {
            let doubt =
                format!("captures of the run to resume are taken over, and nothing shows whose they are: {why}");
            taken.doubts.push(doubt);
        }
        // A second attempt is made because the captures of the first are no good.
        let first = begun.is_none_or(|(_, _, attempt)| *attempt == 1);
        if let Some(before) = self.before.as_ref().filter(|_| first) {
            let older = before.captures(item, repeat)?;
            for older in older.captures {
                if !taken.captures.iter().any(|capture| capture.about == older.about) {
                    taken.captures.push(older);
                }
            }
            taken.doubts.extend(older.doubts);
        }
        Ok(taken)
    }

    /// The captures of a file that no figure need refuse and that are those that were captured; none if there is no file.
    fn complete(&self, path: &Path) -> Result<Taken, ResumeError> {
        let file = path.strip_prefix(&self.folder).unwrap_or(path);
        let name = file.to_string_lossy();
        let Some(said) = self.captured.of(&name) else { return self.unnamed(path, file) };
        if !path.exists() {
            return Ok(Taken::refused(&said.missing()));
        }
        let damaged = |source: std::io::Error| CapturesError { path: path.to_owned(), source: source.into() };
        let (record, held) = captures::read_first(path, said.bytes()).map_err(damaged)?;
        // In another file than the one that was captured there may be anything.
        match said.doubt(&held, self.key.as_ref()) {
            Some(doubt) => Ok(Taken::refused(&doubt)),
            None => Ok(Taken { captures: good(record?), doubts: Vec::new() }),
        }
    }

    /// The captures of a file that the journal does not name. In a run that ended its digests cover them, and with a key that is
    /// not enough. Otherwise the station was killed before the first capture was complete, or an earlier version wrote the journal.
    fn unnamed(&self, path: &Path, file: &Path) -> Result<Taken, ResumeError> {
        if !path.exists() {
            return Ok(Taken::default());
        }
        let what = format!("no line of the journal says what {} holds", gnc_text::shown_path(file));
        let must_be_named = self.key.is_some() || self.was_open && !self.captured.is_empty();
        let captures = match captures::read(path) {
            Ok(record) => good(record),
            // In place of the file of this run there may be anything.
            Err(_) if must_be_named => return Ok(Taken::refused(&what)),
            Err(error) => return Err(error.into()),
        };
        if must_be_named && !captures.is_empty() {
            return Ok(Taken::refused(&what));
        }
        if !self.was_open || captures.is_empty() {
            return Ok(Taken { captures, doubts: Vec::new() });
        }
        let doubts = vec![format!(
            "captures of the run to resume are taken over, and nothing shows that they are its own: {what}"
        )];
        Ok(Taken { captures, doubts })
    }
}

/// The captures that a run takes over from an earlier one.
#[derive(Debug, Clone, Default)]
pub struct Taken {
    /// The captures.
    pub captures: Vec<Capture>,
    /// What is to be said of them, or of those that are not taken over, a sentence each.
    pub doubts: Vec<String>,
}

impl Taken {
    fn refused(why: &str) -> Self {
        let doubt = format!("captures of the run to resume are not taken over and are made again: {why}");
        Self { captures: Vec::new(), doubts: vec![doubt] }
    }
}

/// The captures that no figure need refuse.
fn good(record: RawRecord) -> Vec<Capture> {
    let mut captures = record.captures;
    captures.retain(|capture| !capture.losses.any() && capture.check_clock().is_ok());
    captures
}

/// When a run began, by the first event of its journal.
fn began(journal: &[u8]) -> Option<DateTime<FixedOffset>> {
    let line = journal.split(|byte| *byte == b'\n').next()?;
    serde_json::from_slice::<Event>(line).ok().map(|event| event.at)
}

/// The folder of a run that another run of the same module had taken up.
fn folder_of(run: &Path, earlier: &EarlierRun) -> Option<PathBuf> {
    let run = crate::store::located::located(run).ok()?;
    let records = run.ancestors().nth(3)?;
    // Earlier versions named the folder of a module otherwise.
    let mut modules = vec![run.parent()?.file_name()?.to_owned()];
    let serial_number = reader::read(&run).map(|run| run.serial_number).unwrap_or_default();
    modules.extend(reader::folders_of(&serial_number).into_iter().map(Into::into));
    let days = reader::days(records).ok()?;
    let of_day = |(day, _): (String, usize)| {
        let day = records.join(day);
        modules.iter().map(|module| day.join(module).join(&earlier.run)).collect::<Vec<_>>()
    };
    days.into_iter().rev().flat_map(of_day).find(|folder| {
        gnc_files::read_below(folder, Path::new(JOURNAL), MAX_JOURNAL_BYTES)
            .is_ok_and(|journal| digest::hexadecimal(&Sha256::digest(&journal)) == earlier.journal_sha256)
    })
}

fn same(what: &'static str, was: &str, is: &str) -> Result<(), ResumeError> {
    if was == is {
        return Ok(());
    }
    Err(ResumeError::Unlike { what, was: was.to_owned(), is: is.to_owned() })
}

fn items(selection: Option<&[String]>) -> String {
    // An earlier version filed the names in the order in which they were given.
    let sorted = |names: &[String]| {
        let mut names = names.to_vec();
        names.sort();
        names.dedup();
        names.join(", ")
    };
    selection.map_or_else(|| "none (the whole plan)".to_owned(), sorted)
}

/// Names the simulated module and its world; the speed of its time does not matter.
fn bench(bench: &BenchInfo) -> String {
    format!("{:?} {}", bench.kind, bench.personality.as_deref().unwrap_or_default()).trim().to_lowercase()
}
