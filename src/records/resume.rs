//! `--resume RUN`: takes up an interrupted run again and takes over its complete captures.
//!
//! Only captures are taken over: items that need only seconds run again. Everything must be unchanged: plan, chosen
//! items, serial number, bench, the board's firmware and the calibration that the module stores. A run that ended with
//! a verdict on the module was not interrupted. Its captures show the module as it was then, so the next run makes its
//! own.

use std::fs;
use std::path::{Path, PathBuf};

use gnc_analysis::capture::Capture;
use gnc_executive::event::{BenchInfo, EarlierRun, Event, EventKind, OtherModule, RunHeader};
use gnc_executive::outcome::Outcome;
use sha2::{Digest as _, Sha256};

use crate::store::captures::{self, CapturesError};
use crate::store::reader::{self, ReadError};
use crate::store::{self, DIGESTS, JOURNAL, digest};

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
    Ended(Outcome),
    /// The run ended, but without digests its files cannot be checked.
    #[error("the run to resume ended, and its {DIGESTS} is missing")]
    Unsealed,
    /// Another station is carrying out the run now.
    #[error("the run to resume is still running")]
    GoesOn,
    /// A file of a closed run was changed.
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
            Self::OtherModule(_) | Self::Unlike { .. } | Self::Ended(_) | Self::Unsealed => {
                "run the plan from its beginning, without --resume"
            }
            Self::GoesOn => "wait until that run ends, or stop it where it runs",
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
}

impl<'a> Like<'a> {
    /// The properties of a run with this header.
    #[must_use]
    pub fn header(header: &'a RunHeader) -> Self {
        Self {
            plan_sha256: &header.plan.sha256,
            serial_number: &header.serial_number,
            bench: &header.bench,
            selection: header.selection.as_deref(),
        }
    }
}

/// An interrupted run.
#[derive(Debug, Clone)]
pub struct Resumed {
    folder: PathBuf,
    journal_sha256: String,
    firmware: Option<String>,
    calibration: Option<String>,
    /// Items that had begun: position in the plan, name, last attempt.
    begun: Vec<(usize, String, u32)>,
}

impl Resumed {
    /// Reads a run and compares it with the new one.
    ///
    /// # Errors
    /// [`ResumeError`].
    pub fn read(folder: &Path, like: Like<'_>) -> Result<Self, ResumeError> {
        let state = reader::fold(folder).map_err(ResumeError::Unreadable)?;
        let path = folder.join(JOURNAL);
        let unreadable = |source| ResumeError::Unreadable(ReadError::File { path: path.clone(), source });
        let journal = fs::read(&path).map_err(unreadable)?;
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
        match state.outcome().filter(|_| !state.is_interrupted()) {
            Some(outcome @ (Outcome::Passed | Outcome::Marginal | Outcome::Failed)) => {
                return Err(ResumeError::Ended(outcome));
            }
            Some(_) if !reader::is_sealed(folder) => return Err(ResumeError::Unsealed),
            _ => {}
        }
        // A run that was stopped in order is closed, so its digests are checked.
        if folder.join(DIGESTS).exists()
            && let Some(what) = reader::verify(folder).into_iter().next()
        {
            return Err(ResumeError::Changed { what });
        }
        let lines = journal.split_inclusive(|byte| *byte == b'\n');
        let events = lines.map_while(|line| serde_json::from_slice::<Event>(line).ok());
        let calibration = events.into_iter().find_map(|event| match event.kind {
            EventKind::Power(power) if power.on => Some(power.calibration),
            _ => None,
        });
        let begun = state.rows().iter().enumerate().filter(|(_, row)| !row.attempts.is_empty());
        let begun = begun.map(|(position, row)| {
            (position, row.planned.name.clone(), u32::try_from(row.attempts.len()).unwrap_or(1))
        });
        Ok(Self {
            folder: folder.to_owned(),
            journal_sha256: digest::hexadecimal(&Sha256::digest(&journal)),
            firmware: state.board().map(|board| board.firmware.clone()),
            calibration: calibration.flatten(),
            begun: begun.collect(),
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
            let was = self.calibration.as_deref().unwrap_or("unknown");
            same("a module with the calibration", was, calibration.unwrap_or("unknown"))?;
        }
        Ok(())
    }

    /// The complete captures of an item, in order; empty if the item had not begun.
    ///
    /// # Errors
    /// The raw samples of the item are damaged.
    pub fn captures(&self, item: &str) -> Result<Vec<Capture>, ResumeError> {
        let Some((position, name, attempt)) = self.begun.iter().find(|(_, name, _)| name == item) else {
            return Ok(Vec::new());
        };
        let path = captures::path(&self.folder, *position, name, *attempt, 1);
        if !path.exists() {
            return Ok(Vec::new());
        }
        let mut captures = captures::read(&path)?.captures;
        captures.retain(|capture| !capture.losses.any() && capture.check_clock().is_ok());
        Ok(captures)
    }
}

fn same(what: &'static str, was: &str, is: &str) -> Result<(), ResumeError> {
    if was == is {
        return Ok(());
    }
    Err(ResumeError::Unlike { what, was: was.to_owned(), is: is.to_owned() })
}

fn items(selection: Option<&[String]>) -> String {
    selection.map_or_else(|| "none (the whole plan)".to_owned(), |names| names.join(", "))
}

/// Names the simulated module and its world; the speed of its time does not matter.
fn bench(bench: &BenchInfo) -> String {
    format!("{:?} {}", bench.kind, bench.personality.as_deref().unwrap_or_default()).trim().to_lowercase()
}
