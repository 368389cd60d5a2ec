//! Names that files get when their run is closed. Record, log and papers say how a run ended, so until its line is in the chain they
//! have the names of files that are not complete: `run.json.part`. The digests have their own names already. Behind the line each file
//! gets its name. If a kill comes between the line and the names, the run is closed, and the next start names them.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use super::digest::FileDigests;
use super::folder::{PART, sync_dir};
use super::{LOG, RECORD, StoreError, chain, digest, on};
use crate::passport::{PASSPORT, PASSPORT_XML};
use crate::report::REPORT;

/// Files that say how a run ended. Papers come first, so that no paper is missing beside a record that has its name.
pub(super) const TELLING: [&str; 5] = [PASSPORT, PASSPORT_XML, REPORT, LOG, RECORD];

/// The name of such a file until its run is closed.
pub(super) fn waiting_name(name: &str) -> String {
    format!("{name}.{PART}")
}

/// Those files of a run that wait for their names.
pub(super) fn waiting(run: &Path) -> Vec<&'static str> {
    let is_there = |path: PathBuf| path.symlink_metadata().is_ok();
    let waits = |name: &&str| !is_there(run.join(name)) && is_there(run.join(waiting_name(name)));
    TELLING.into_iter().filter(waits).collect()
}

/// The file of this name, under the name that it has now. Only for a run that is closed is a waiting one more than a draft.
pub(crate) fn path(run: &Path, name: &str) -> PathBuf {
    if waiting(run).contains(&name) { run.join(waiting_name(name)) } else { run.join(name) }
}

/// Opens such a file of a run: by its name, or, if the run is closed, by the one with which it waits.
pub(crate) fn open(run: &Path, name: &str) -> io::Result<File> {
    let own = || gnc_files::own(&run.join(name));
    match own() {
        Err(error) if error.kind() == io::ErrorKind::NotFound && waiting(run).contains(&name) => {
            let is_promised = FileDigests::read(run).is_ok_and(|(sums, _)| sums.get(name).is_some());
            if !is_promised || !chain::is_closed(run).unwrap_or(false) {
                return Err(error);
            }
            // Its station may give it its name at this moment.
            gnc_files::own(&run.join(waiting_name(name))).or_else(|_| own())
        }
        opened => opened,
    }
}

/// Gives the files of a run their names as soon as its line is in the chain. No error of this makes the closed run another one: what
/// keeps its waiting name gets its own at the next start.
pub(super) fn name_all(run: &Path) {
    for name in waiting(run) {
        let _ = fs::rename(run.join(waiting_name(name)), run.join(name));
    }
    let _ = sync_dir(run);
}

/// Gives the files of a closed run their names, after a look whether they are those that it was closed with. Returns those that are
/// not, under the names that they keep.
pub(super) fn name_left(run: &Path) -> Result<Vec<String>, StoreError> {
    let (promised, _) = FileDigests::read(run)?;
    let mut others = Vec::new();
    for name in waiting(run) {
        let (from, to) = (run.join(waiting_name(name)), run.join(name));
        if promised.get(name).is_some_and(|promised| digest::of_file(&from).is_ok_and(|found| found == promised)) {
            on(fs::rename(&from, &to), "move", &from)?;
        } else {
            others.push(waiting_name(name));
        }
    }
    sync_dir(run)?;
    Ok(others)
}

#[cfg(test)]
mod tests;
