//! What must be known before a run begins: whether the files are as they were checked, whether the module was tested today,
//! and whether a run of it broke off that can be taken up again.

use std::path::{Path, PathBuf};

use gnc_executive::outcome::Outcome;
use gnc_records::resume::{Like, ResumeError, Resumed};
use gnc_records::store::{captures, reader};
use gnc_text::with_causes;

use super::archive;
use super::files::{Held, NOT_HELD};
use crate::tui::model::{Interrupted, Prepared, Resumable};

/// Newest runs of a module that are read to find one that broke off.
const MAX_LOOKED_AT: usize = 20;

/// Looks at files and records. `resume` is the run that the command line wants to take up.
pub(super) fn prepare(held: &Held, records: &Path, serial_number: String, resume: Option<PathBuf>) -> Prepared {
    let changed = held.changed();
    let earlier = archive::earlier(records, &serial_number);
    let resume = match resume {
        Some(folder) => Some(asked_for(held, &serial_number, folder)),
        None => offered(held, records, &serial_number).map(Resumable::Yes),
    };
    Prepared { serial_number, changed, earlier, resume }
}

/// The run that the command line asked for, or why it cannot be taken up.
fn asked_for(held: &Held, serial_number: &str, folder: PathBuf) -> Resumable {
    let Some(like) = like(held, serial_number) else { return Resumable::No { why: NOT_HELD.to_owned() } };
    let fits = Resumed::read(&folder, like);
    let started = fits.and_then(|_| reader::read(&folder).map(|run| run.started).map_err(ResumeError::Unreadable));
    match started {
        Ok(at) => Resumable::Yes(Interrupted { folder, at }),
        Err(error) => Resumable::No { why: with_causes(&error) },
    }
}

/// The newest run of this module and this plan, if it broke off and left captures that can be taken over.
fn offered(held: &Held, records: &Path, serial_number: &str) -> Option<Interrupted> {
    let like = like(held, serial_number)?;
    let newest = reader::newest_of_module(records, serial_number).take(MAX_LOOKED_AT);
    let mut runs = newest.filter_map(|folder| reader::read(&folder).ok().map(|run| (folder, run)));
    let (folder, run) =
        runs.find(|(_, run)| run.serial_number == serial_number && run.plan.sha256 == like.plan_sha256)?;
    let broke_off = run.interrupted || run.outcome == Outcome::Aborted;
    let captured = || captures::files(&folder).is_ok_and(|files| !files.is_empty());
    let fits = broke_off && captured() && Resumed::read(&folder, like).is_ok();
    fits.then_some(Interrupted { folder, at: run.started })
}

fn like<'a>(held: &'a Held, serial_number: &'a str) -> Option<Like<'a>> {
    let (plan, bench) = (held.plan.as_ref()?, held.bench.as_ref()?);
    Some(Like { plan_sha256: plan.plan.sha256(), serial_number, bench: &bench.bench })
}
