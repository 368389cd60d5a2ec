//! Finds what stands in a records folder and is no part of the records: links, and days that have no date for a name.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::CHAIN;
use super::read::name_in;
use crate::store::litter::{is_litter, is_litter_folder};
use crate::store::reader;

/// What stands there.
#[derive(Default)]
pub(super) struct Strays {
    /// What is wrong, a sentence each.
    pub(super) problems: Vec<String>,
    /// Folders in days and modules that file servers and file managers make, a sentence each.
    pub(super) litter: Vec<String>,
}

/// Looks through days, modules and the names of runs.
pub(super) fn strays(records: &Path) -> Strays {
    let Strays { mut problems, mut litter } = Strays::default();
    // Disks have their own folders at the top.
    for day in entries(records, records, &mut problems, &mut Vec::new()) {
        let is_day = reader::is_day(&day);
        let (mut below, mut litter_below) = (Vec::new(), Vec::new());
        let serials = if day.is_dir() { entries(records, &day, &mut below, &mut litter_below) } else { Vec::new() };
        let runs: Vec<PathBuf> = serials
            .iter()
            .filter(|serial| serial.is_dir())
            .flat_map(|serial| entries(records, serial, &mut below, &mut litter_below))
            .collect();
        let holds_runs = serials.iter().chain(&runs).any(|folder| reader::is_run(folder));
        let is_link = |path: &Path| path.symlink_metadata().is_ok_and(|meta| meta.is_symlink());
        let name = |path: &Path| name_in(records, path);
        match (is_day, is_link(&day)) {
            (_, true) if is_day || holds_runs => problems.push(link(&name(&day))),
            (true, _) => {
                problems.append(&mut below);
                litter.append(&mut litter_below);
                problems.extend(serials.iter().chain(&runs).filter(|path| is_link(path)).map(|path| link(&name(path))));
                let files = serials.iter().filter(|path| !is_of_chain(path)).chain(&runs).filter(|path| path.is_file());
                let added =
                    files.filter(|path| !is_link(path) && !is_litter(Path::new(path.file_name().unwrap_or_default())));
                problems.extend(added.map(|path| format!("{} was added: no station writes it there", name(path))));
            }
            (false, _) if holds_runs => {
                problems.push(format!("{} holds runs, and its name is not that of a day (YYYY-MM-DD)", name(&day)));
            }
            // A disk has other folders, too.
            (false, _) => {}
        }
    }
    Strays { problems, litter }
}

/// Whether the file of a day is one of its chain.
fn is_of_chain(file: &Path) -> bool {
    file.file_stem().is_some_and(|stem| stem == CHAIN)
}

fn link(name: &str) -> String {
    format!("{name} is a link: what it leads to is no part of these records")
}

/// What a folder holds, by its names, without the folders of file servers, file managers and systems.
fn entries(records: &Path, folder: &Path, problems: &mut Vec<String>, litter: &mut Vec<String>) -> Vec<PathBuf> {
    let read = fs::read_dir(folder).and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect());
    let mut found: Vec<PathBuf> = match read {
        Ok(found) => found,
        // It was taken away meanwhile: an empty folder of a run that could not begin.
        Err(error) if io::Error::kind(&error) == io::ErrorKind::NotFound => Vec::new(),
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
