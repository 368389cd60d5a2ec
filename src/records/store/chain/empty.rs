//! What the chain says of a folder in a day that holds no run: a sudden end may leave it, and the next start takes it away.

use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use super::CHAIN;
use super::before::day_and_time;
use super::check::{ChainBook, ChainCheck};
use super::places;
use super::read::name_in;
use crate::store::litter::is_litter_folder;
use crate::store::reader;

/// Newest days in which a start looks for folders that hold nothing. A run that began before midnight leaves them on the day before.
const LOOKED_AT_DAYS: usize = 3;

/// Behind all times of a day.
const END_OF_DAY: &str = "~";

impl ChainBook {
    /// What is wrong with the folder of a run that holds no run: no station makes a folder of this name, or each station of the chain began a
    /// run later, and its start would have taken the folder away. `None`: the next start does that.
    #[must_use]
    pub fn unlike_a_cut_off_run(&self, run: &Path) -> Option<String> {
        let name = name_in(&self.records, run);
        let (day, time) = day_and_time(&name);
        if time.len() != 6 || !time.bytes().all(|byte| byte.is_ascii_digit()) {
            return Some(places::added(&name));
        }
        self.is_left_behind(day, time).then(|| left_behind(&name))
    }

    /// Whether each station of the chain began a run later.
    fn is_left_behind(&self, day: &str, time: &str) -> bool {
        let mut newest: HashMap<&str, (&str, &str)> = HashMap::new();
        for line in self.lines.iter().filter(|line| !line.is_close()) {
            let Some(station) = line.station() else { continue };
            let at = day_and_time(&line.run);
            newest.entry(station).and_modify(|newest| *newest = at.max(*newest)).or_insert(at);
        }
        !newest.is_empty() && newest.values().all(|newest| *newest > (day, time))
    }

    /// Tells the folders of days and modules that hold nothing. Without a line of a chain there is no start to compare them with.
    pub(super) fn empty_folders(&self, found: &[PathBuf], checked: &mut ChainCheck) {
        // A station may be making its run in one of them.
        for folder in found.iter().filter(|folder| !self.lines.is_empty() && holds_nothing(folder)) {
            let name = name_in(&self.records, folder);
            if self.is_left_behind(name.split('/').next().unwrap_or_default(), END_OF_DAY) {
                checked.problems.push(left_behind(&name));
            } else {
                checked.incomplete.push(format!(
                    "{name} holds no run: its station ended, or could not write, before a run began there; the next start removes it"
                ));
            }
        }
    }
}

fn left_behind(name: &str) -> String {
    format!(
        "{name} holds no run, and each station began one later, whose start removes such folders: it was added, or could not be removed"
    )
}

fn holds_nothing(folder: &Path) -> bool {
    // What stands in the place of a chain was told with the chain.
    let is_chain = folder.file_name().is_some_and(|name| name == CHAIN);
    let is_folder = folder.symlink_metadata().is_ok_and(|meta| meta.is_dir()) && !is_litter_folder(folder) && !is_chain;
    is_folder && fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none())
}

/// The folders of days and modules that hold nothing, in so many newest days.
fn empty_of(records: &Path, days: usize) -> Vec<PathBuf> {
    let mut found = HashSet::new();
    for day in reader::day_names(records).unwrap_or_default().into_iter().rev().take(days) {
        let day = records.join(day);
        let modules = fs::read_dir(&day).into_iter().flatten().flatten().map(|entry| entry.path());
        found.extend(modules.chain([day.clone()]).filter(|folder| holds_nothing(folder)));
    }
    let mut found: Vec<PathBuf> = found.into_iter().collect();
    found.sort();
    found
}

/// The folders of days and modules that hold nothing.
pub(super) fn empty(records: &Path) -> Vec<PathBuf> {
    empty_of(records, usize::MAX)
}

/// Takes away the folders of the newest days and their modules that hold nothing, as a sudden end leaves them between two steps.
pub(crate) fn remove_empty(records: &Path) {
    let modules_first = empty_of(records, LOOKED_AT_DAYS).into_iter().rev();
    // These fail where a station makes a run at this moment, and then there is nothing to take away.
    let _ = modules_first.map(fs::remove_dir).filter(Result::is_ok).count();
}
