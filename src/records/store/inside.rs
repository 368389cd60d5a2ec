//! Whether a place that a person names for a file of his own is one where only a station writes. A file among the runs would be a
//! finding of each verification for ever, and one in the folder of a run would make its record worthless.

use std::fs;
use std::path::{Component, Path, PathBuf};

use super::chain::COUNTER;
use super::{located, reader};

/// Where among records a place lies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Inside {
    /// In the folder of this run.
    Run(PathBuf),
    /// Among the runs of this day.
    Day(PathBuf),
    /// It is the counter of a chain.
    Counter,
}

/// Where among records a path leads, links and `..` resolved; `None` if it leads elsewhere. It need not be there yet.
#[must_use]
pub fn inside_records(path: &Path) -> Option<Inside> {
    let place = resolved(path)?;
    let above = || place.ancestors().skip(1);
    if let Some(run) = above().find(|folder| reader::is_certainly_run(folder)) {
        return Some(Inside::Run(run.to_owned()));
    }
    let is_day = |folder: &&Path| {
        let records = folder.parent();
        reader::is_day(folder) && (located::has_chain(folder) || records.is_some_and(hold_runs))
    };
    // A folder of its own that has the name of a day would be taken for one.
    if let Some(day) = place.ancestors().find(is_day) {
        return Some(Inside::Day(day.to_owned()));
    }
    let name = place.file_name()?.to_str()?;
    let is_counter = name.strip_prefix(COUNTER).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
    (is_counter && place.parent().is_some_and(hold_runs)).then_some(Inside::Counter)
}

/// Whether runs were filed below a folder, with a chain or before there was one.
fn hold_runs(folder: &Path) -> bool {
    let below = |folder: &Path| -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).collect()
    };
    let holds_runs = |day: &Path| below(day).iter().flat_map(|module| below(module)).any(|run| reader::is_run(&run));
    located::are_records(folder) || below(folder).iter().any(|day| reader::is_day(day) && holds_runs(day))
}

/// The path without links and `..`. Of what is not there yet its names count.
fn resolved(path: &Path) -> Option<PathBuf> {
    let whole = std::path::absolute(path).ok()?;
    let there = whole.ancestors().find_map(|above| Some((above, above.canonicalize().ok()?)));
    let (above, mut place) = there?;
    for part in whole.strip_prefix(above).ok()?.components() {
        match part {
            Component::ParentDir => drop(place.pop()),
            part => place.push(part),
        }
    }
    Some(place)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;
    use crate::store::chain::CHAIN;

    #[test]
    fn a_place_among_runs_is_found_however_it_is_named() {
        let top = tempfile::tempdir().unwrap();
        let top = top.path().canonicalize().unwrap();
        let records = top.join("records");
        let day = records.join("2026-11-28");
        let run = day.join("A/120000-x");
        fs::create_dir_all(run.join("01-imu")).unwrap();
        for (file, text) in [("events.jsonl", "{}"), ("01-imu/item.json", "{}")] {
            fs::write(run.join(file), text).unwrap();
        }
        symlink(&run, top.join("link")).unwrap();
        // Other programs have files of these names.
        for file in ["events.jsonl", "run.json", "SHA256SUMS"] {
            let project = top.join("project").join(file);
            fs::create_dir_all(&project).unwrap();
            fs::write(project.join(file), "x").unwrap();
        }
        // A run that was sent alone.
        let alone = top.join("alone");
        fs::create_dir(&alone).unwrap();
        for file in ["events.jsonl", "run.json", "SHA256SUMS"] {
            fs::write(alone.join(file), "x").unwrap();
        }
        let inside = |path: &str| inside_records(&top.join(path));
        for path in ["records/2026-11-28/A/120000-x/new", "records/2026-11-28/A/120000-x/01-imu/a/b", "link/x.xml"] {
            assert_eq!(inside(path), Some(Inside::Run(run.clone())), "{path}");
        }
        for path in ["link/../new/x", "other/../records/2026-11-28/x", "records/2026-11-28/A/x", "records/2026-11-28"] {
            assert_eq!(inside(path), Some(Inside::Day(day.clone())), "{path}");
        }
        // A day that was not there yet would be a day without runs.
        assert_eq!(inside("records/2026-12-01/x"), Some(Inside::Day(records.join("2026-12-01"))));
        assert_eq!(inside("records/COUNTER"), Some(Inside::Counter), "it may be gone for a while");
        assert_eq!(inside("alone/x"), Some(Inside::Run(alone)));
        for path in ["project/events.jsonl/x", "project/run.json/records", "project/SHA256SUMS/records/2026-11-28/x"] {
            assert_eq!(inside(path), None, "{path}");
        }
        for path in ["records/x", "records/exports/2026/x", "2026-11-28/x", "x", "other/x"] {
            assert_eq!(inside(path), None, "{path}");
        }
        fs::write(records.join(COUNTER), "").unwrap();
        fs::write(day.join(CHAIN), "").unwrap();
        assert_eq!(inside("records/COUNTER"), Some(Inside::Counter));
        assert_eq!(inside("records/COUNTER.kept"), Some(Inside::Counter));
        assert_eq!(inside("records/my-COUNTER"), None);
        // A whole day that was copied alone.
        fs::rename(&day, top.join("2026-11-28")).unwrap();
        assert_eq!(inside("2026-11-28/x"), Some(Inside::Day(top.join("2026-11-28"))));
    }
}
