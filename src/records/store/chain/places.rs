//! Finds what stands in a records folder and is no part of the records: links, days that have no date for a name, and copies of runs in
//! folders that no station makes.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::copies::{self, Copies};
use super::read::name_in;
use super::tail::TORN;
use super::{CHAIN, COUNTER};
use crate::store::folder::PART;
use crate::store::litter::{is_litter, is_litter_folder};
use crate::store::unread::says_nothing;
use crate::store::{Unread, reader};

/// What stands there.
#[derive(Default)]
pub(super) struct Strays {
    /// What is wrong, a sentence each.
    pub(super) problems: Vec<String>,
    /// Folders in days and modules that file servers and file managers make, a sentence each.
    pub(super) litter: Vec<String>,
    /// Folders that could not be read.
    pub(super) unread: Vec<Unread>,
    /// What could not be looked at to its end, a sentence each.
    pub(super) notes: Vec<String>,
}

/// Looks through days, modules and the names of runs.
pub(super) fn strays(records: &Path) -> Strays {
    let Strays { mut problems, mut litter, mut notes, mut unread } = Strays::default();
    // Disks have their own folders at the top.
    for day in entries(records, records, &mut unread, &mut problems, &mut Vec::new()) {
        let name = |path: &Path| name_in(records, path);
        if !reader::is_day(&day) {
            problems.extend(is_beside_the_counter(&day).then(|| added(&name(&day))));
            match (copies::below(&day), is_link(&day)) {
                // A disk has other folders, too.
                (Copies::None, _) | (Copies::TooMany, true) => {}
                (_, true) => problems.push(link(&name(&day))),
                (Copies::Itself, false) => {
                    problems.push(format!("{} is the folder of a run and stands in no day", name(&day)));
                }
                (Copies::AsInADay, false) => {
                    problems.push(format!("{} holds runs, and its name is not that of a day (YYYY-MM-DD)", name(&day)));
                }
                // No reader takes them for runs of these records.
                (Copies::Deeper(run), false) => notes.push(format!(
                    "{} is no day and holds copies of runs or records of another folder of which the first is {}",
                    name(&day),
                    name(&run)
                )),
                (Copies::TooMany, false) => notes.push(format!(
                    "{} holds more than {} files and folders so that not all of them were looked at for copies of runs",
                    name(&day),
                    copies::MAX_LOOKED
                )),
            }
            continue;
        }
        if is_link(&day) {
            problems.push(link(&name(&day)));
            continue;
        }
        let serials =
            if day.is_dir() { entries(records, &day, &mut unread, &mut problems, &mut litter) } else { Vec::new() };
        let runs: Vec<PathBuf> = serials
            .iter()
            .filter(|serial| serial.is_dir())
            .flat_map(|serial| entries(records, serial, &mut unread, &mut problems, &mut litter))
            .collect();
        among_runs(records, &serials.iter().chain(&runs).collect::<Vec<_>>(), &mut problems);
    }
    Strays { problems, litter, notes, unread }
}

/// The same among the runs of one module, by the names that its folder may have.
pub(super) fn strays_of(records: &Path, folders: &[String]) -> Strays {
    let mut found = Strays::default();
    for day in reader::day_names(records).unwrap_or_default() {
        for module in folders.iter().map(|folder| records.join(&day).join(folder)) {
            let runs = if module.is_dir() && !is_link(&module) {
                entries(records, &module, &mut found.unread, &mut found.problems, &mut found.litter)
            } else {
                Vec::new()
            };
            among_runs(records, &[&module].into_iter().chain(&runs).collect::<Vec<_>>(), &mut found.problems);
        }
    }
    found
}

/// Links and files where only folders of modules and runs stand.
fn among_runs(records: &Path, paths: &[&PathBuf], problems: &mut Vec<String>) {
    let name = |path: &Path| name_in(records, path);
    problems.extend(paths.iter().filter(|path| is_link(path)).map(|path| link(&name(path))));
    let files = paths.iter().filter(|path| !is_of_chain(path) && path.is_file() && !is_link(path));
    let strange = files.filter(|path| !is_litter(Path::new(path.file_name().unwrap_or_default())));
    problems.extend(strange.map(|path| added(&name(path))));
}

fn is_link(path: &Path) -> bool {
    path.symlink_metadata().is_ok_and(|meta| meta.is_symlink())
}

/// Whether a file is the chain of its day, or what a start removed of it.
fn is_of_chain(file: &Path) -> bool {
    file.file_name().is_some_and(|name| name == CHAIN || name == TORN) && file.parent().is_some_and(reader::is_day)
}

/// Whether a file at the top has the name of a counter and is none: a copy of it belongs in another place.
fn is_beside_the_counter(file: &Path) -> bool {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let of_counter = name.strip_prefix(COUNTER).and_then(|rest| rest.strip_prefix('.'));
    of_counter.is_some_and(|rest| rest != PART) && !is_link(file) && file.is_file()
}

/// What to say of what stands where no station writes it.
pub(super) fn added(name: &str) -> String {
    format!("{name} was added: no station writes it there")
}

fn link(name: &str) -> String {
    format!("{name} is a link: what it leads to is no part of these records")
}

/// What a folder holds, by its names, without the folders of file servers, file managers and systems.
fn entries(
    records: &Path,
    folder: &Path,
    unread: &mut Vec<Unread>,
    problems: &mut Vec<String>,
    litter: &mut Vec<String>,
) -> Vec<PathBuf> {
    let read = fs::read_dir(folder).and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect());
    let mut found: Vec<PathBuf> = match read {
        Ok(found) => found,
        // It was taken away meanwhile: an empty folder of a run that could not begin.
        Err(error) if io::Error::kind(&error) == io::ErrorKind::NotFound => Vec::new(),
        Err(error) if says_nothing(&error) => {
            unread.push(Unread::new(folder, error));
            Vec::new()
        }
        Err(error) => {
            problems.push(format!("{} cannot be read: {error}", name_in(records, folder)));
            Vec::new()
        }
    };
    found.sort();
    found.retain(|path| {
        let is_litter = is_litter_folder(path);
        if is_litter {
            litter.push(format!(
                "{} is a folder that no station makes, perhaps that of a file server: remove it and verify again",
                name_in(records, path)
            ));
        }
        !is_litter
    });
    found
}
