//! What must be known before a run begins: whether the files are as they were checked, whether the plan was run
//! on the module before, and whether one of its runs broke off and can be taken up again.

use std::path::{Path, PathBuf};

use gnc_analysis::motion::{self, MotionStep};
use gnc_bench::clock;
use gnc_executive::outcome::Outcome;
use gnc_executive::record::RunRecord;
use gnc_records::resume::{Like, ResumeError, Resumed};
use gnc_records::store::{captures, reader};
use gnc_text::with_causes;

use super::archive;
use super::files::{Held, NOT_HELD};
use crate::tui::pending::{Interrupted, Prepared, Resumable};
use crate::tui::update::Msg;

/// Largest number of newest runs of a module that are read to find one that broke off.
const MAX_LOOKED_AT: usize = 20;

/// A run that is to begin.
pub(super) struct Look {
    pub held: Held,
    /// The folder of all records.
    pub records: PathBuf,
    pub serial_number: String,
    /// Names of the chosen items; `None` for the whole plan.
    pub selection: Option<Vec<String>>,
}

impl Look {
    /// Looks at files and records. `resume` is the run that the command line wants to take up.
    pub(super) fn prepare(self, resume: Option<PathBuf>) -> Prepared {
        let changed = self.held.changed();
        let standing = archive::standing(&self.held, &self.records, &self.serial_number).and_then(Result::ok);
        let resume = match resume {
            Some(folder) => Some(self.asked_for(folder)),
            None => self.offered().map(Resumable::Yes),
        };
        Prepared { serial_number: self.serial_number, changed, standing, resume }
    }

    /// Tells the screen of a run of this module that broke off.
    pub(super) fn broke_off(self) -> Msg {
        let run = self.offered();
        Msg::BrokeOff { serial_number: self.serial_number, run }
    }

    /// The run that the command line named, or why it cannot be taken up.
    fn asked_for(&self, folder: PathBuf) -> Resumable {
        let Some(like) = self.like() else { return Resumable::No { why: NOT_HELD.to_owned() } };
        let fits = Resumed::read(&folder, like);
        let started = fits.and_then(|_| reader::read(&folder).map(|run| run.started).map_err(ResumeError::Unreadable));
        match started {
            Ok(at) => Resumable::Yes(Interrupted { folder, at }),
            Err(error) => Resumable::No { why: with_causes(&error) },
        }
    }

    /// The newest run of this module with these items of this plan, if it broke off and left captures that can be taken
    /// over.
    fn offered(&self) -> Option<Interrupted> {
        let like = self.like()?;
        let newest = reader::closed_last_of_module(&self.records, &self.serial_number).into_iter().take(MAX_LOOKED_AT);
        let mut runs = newest.filter_map(|folder| reader::read(&folder).ok().map(|run| (folder, run)));
        let (folder, run) = runs.find(|(_, run)| {
            run.serial_number == self.serial_number
                && run.plan.sha256 == like.plan_sha256
                && run.selection == self.selection
                && run.recomputed.is_none()
        })?;
        let stopped = run.interrupted || run.verdict.of_items() == Outcome::Aborted;
        let captured = || captures::files(&folder).is_ok_and(|files| !files.is_empty());
        if !(stopped || run.verdict.of_items() == Outcome::Errored) || !captured() {
            return None;
        }
        let resumed = Resumed::read(&folder, like).ok()?;
        // A run without its line ends as errored. One whose captures all exist would only come to the same error again.
        let fits = stopped || self.lacks_captures(&run, &resumed);
        fits.then_some(Interrupted { folder, at: run.started })
    }

    /// Whether an item of a run has not made all captures of its program.
    fn lacks_captures(&self, run: &RunRecord, resumed: &Resumed) -> bool {
        let Some(held) = &self.held.plan else { return false };
        let chosen = held.plan.plan().items().iter().zip(&run.items).filter(|(_, row)| row.selected);
        chosen.into_iter().any(|(item, _)| {
            let Ok(Some(program)) = motion::program(item.id, &item.params) else { return false };
            let captures = resumed.captures(&item.name, 1).unwrap_or_default().captures;
            let mut heads = program.steps.iter().filter_map(MotionStep::about);
            heads.any(|about| !captures.iter().any(|capture| capture.about == *about))
        })
    }

    fn like(&self) -> Option<Like<'_>> {
        let (plan, bench) = (self.held.plan.as_ref()?, self.held.bench.as_ref()?);
        let (plan_sha256, serial_number) = (plan.plan.sha256(), self.serial_number.as_str());
        let (valid_days, now) = (plan.plan.plan().valid_days, clock::now());
        Some(Like {
            plan_sha256,
            serial_number,
            bench: &bench.bench,
            selection: self.selection.as_deref(),
            valid_days,
            now,
            records: &self.records,
            // The start checks it.
            key: None,
        })
    }
}

/// Tells the screen, when it has read a plan, of the newest run that broke off.
pub(super) fn newest_that_broke_off(held: &Held, records: &Path) -> Msg {
    let newest = reader::newest(records, MAX_LOOKED_AT).filter_map(|folder| reader::read(&folder).ok());
    // Only the newest run of the station: an older one was left behind.
    let found = newest.take(1).find_map(|run| {
        let serial_number = run.serial_number;
        let look = Look {
            held: held.clone(),
            records: records.to_owned(),
            serial_number: serial_number.clone(),
            selection: None,
        };
        look.offered().map(|run| (serial_number, run))
    });
    let (serial_number, run) = found.map_or((String::new(), None), |(number, run)| (number, Some(run)));
    Msg::BrokeOff { serial_number, run }
}
