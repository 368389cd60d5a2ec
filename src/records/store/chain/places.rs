//! Finds what stands in a records folder and is no part of the records: links, and days that have no date for a name.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::CHAIN;
use super::read::name_in;
use crate::store::litter::is_litter;
use crate::store::reader;

/// What is wrong, a sentence each.
pub(super) fn strays(records: &Path) -> Vec<String> {
    let mut problems = Vec::new();
    for day in entries(records, records, &mut problems) {
        let is_day = reader::is_day(&day);
        let mut below = Vec::new();
        let serials = if day.is_dir() { entries(records, &day, &mut below) } else { Vec::new() };
        let runs: Vec<PathBuf> = serials
            .iter()
            .filter(|serial| serial.is_dir())
            .flat_map(|serial| entries(records, serial, &mut below))
            .collect();
        let holds_runs = serials.iter().chain(&runs).any(|folder| reader::is_run(folder));
        let is_link = |path: &Path| path.symlink_metadata().is_ok_and(|meta| meta.is_symlink());
        let name = |path: &Path| name_in(records, path);
        match (is_day, is_link(&day)) {
            (_, true) if is_day || holds_runs => problems.push(link(&name(&day))),
            (true, _) => {
                problems.append(&mut below);
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
    problems
}

/// Whether the file of a day is one of its chain.
fn is_of_chain(file: &Path) -> bool {
    file.file_stem().is_some_and(|stem| stem == CHAIN)
}

fn link(name: &str) -> String {
    format!("{name} is a link: what it leads to is no part of these records")
}

/// What a folder holds, by its names.
fn entries(records: &Path, folder: &Path, problems: &mut Vec<String>) -> Vec<PathBuf> {
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
    found
}
