//! Reads records back. The journal is authoritative; files made from it are compared with it.

use std::fs;
use std::io::{self, BufRead, BufReader, Read as _};
use std::path::{Path, PathBuf};

use chrono::NaiveDate;
use gnc_executive::event::Event;
use gnc_executive::journal::{self, FoldError, JournalError, JournalLines, Kept, Unknown};
use gnc_executive::plan::{MAX_PLAN_BYTES, MAX_PLAN_FILES};
use gnc_executive::record::RunRecord;
use gnc_executive::state::RunState;

use super::begun::was_never_begun;
use super::litter::is_litter_folder;
use super::unread::says_nothing;
use super::{DIGESTS, JOURNAL, PLAN, RECORD, StoreError, UNASSIGNED, chain, goes_on, name, on, pending};

/// Longest journal that is read: a thousand hours of a very verbose bench. A longer file is not a journal of this
/// station.
pub(crate) const MAX_JOURNAL_BYTES: u64 = 1 << 30;

/// Longest record for programs. It becomes up to eight times as long in memory, beside what its journal says; that of an acceptance
/// has 1 MB.
pub(crate) const MAX_RECORD_BYTES: u64 = 64 << 20;

/// Longest paper: a report has what the record has, and pictures.
const MAX_PAPER_BYTES: u64 = 256 << 20;

/// The name of the folder of a day.
const DAY: &str = "%Y-%m-%d";

/// Why a run cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// Access to a file or folder failed.
    #[error("cannot read {}", gnc_text::shown_path(path))]
    File {
        /// The file or folder.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// The file is longer than any journal.
    #[error("{} is longer than any journal, which has at most {} MiB", gnc_text::shown_path(path), MAX_JOURNAL_BYTES >> 20)]
    TooLong {
        /// The journal.
        path: PathBuf,
    },
    /// No version of the station writes such a journal.
    #[error("the journal is damaged")]
    Damaged(#[source] JournalError),
    /// The journal takes more memory than any run of the station.
    #[error("the journal is too large to be read")]
    TooLarge(#[source] JournalError),
    /// A later version of the station wrote the journal, and this version does not know all of it.
    #[error("written by a newer version of the station ({0})")]
    Newer(Unknown),
    /// The run was cut off at its start.
    #[error("the journal holds no whole event: the run was cut off at its start")]
    Empty,
    /// A station made the folder and ended before the first event.
    #[error("the run was cut off at its start, before its first event: nothing was tested")]
    NeverBegun,
    /// The plan folder of the run is empty.
    #[error("{PLAN}/ is empty")]
    NoPlan,
}

impl ReadError {
    /// What the user can try.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        match self {
            Self::Newer(_) => "read it with the version of the station that wrote it, or a later one",
            Self::NeverBegun => "you can remove its folder; run the plan",
            Self::TooLarge(_) => {
                "read events.jsonl with tools of your own: each line is JSON; docs/records.md has the limits"
            }
            Self::File { .. } | Self::TooLong { .. } | Self::Damaged(_) | Self::Empty | Self::NoPlan => {
                "`gnc-station records list` shows the runs that are there"
            }
        }
    }

    /// Whether a later version of the station wrote the run. Such a run is not known to be damaged.
    #[must_use]
    pub fn is_newer(&self) -> bool {
        self.unknown().is_some()
    }

    /// The part of a later version's journal that this version does not know.
    #[must_use]
    pub fn unknown(&self) -> Option<&Unknown> {
        match self {
            Self::Newer(unknown) => Some(unknown),
            _ => None,
        }
    }

    pub(super) fn of_fold(path: PathBuf, error: FoldError) -> Self {
        match error {
            FoldError::Read(source) => Self::File { path, source },
            FoldError::Journal(JournalError::Newer { unknown, .. }) => Self::Newer(unknown),
            FoldError::Journal(error @ JournalError::TooMuch { .. }) => Self::TooLarge(error),
            FoldError::Journal(error) => Self::Damaged(error),
        }
    }
}

/// A run found in the records folder.
#[derive(Debug)]
pub struct FoundRun {
    /// Its folder.
    pub path: PathBuf,
    /// The content of the run, or why it cannot be read.
    pub run: Result<RunRecord, ReadError>,
    /// Whether the folder was closed with its digests. A run without them is not evidence, whatever it says.
    pub sealed: bool,
    /// Whether a station is writing the run now.
    pub running: bool,
}

/// In what state a run's folder was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Found {
    /// The run has an end, and its folder has its digests.
    Closed,
    /// A station is writing the run now.
    Running,
    /// The run has no end, and no station is writing it.
    Interrupted,
    /// The run has an end, and its folder has no digests.
    Unsealed,
    /// A later version of the station wrote it.
    Newer,
    /// It cannot be read.
    Unreadable,
}

impl Found {
    /// All states.
    pub const ALL: [Self; 6] =
        [Self::Closed, Self::Running, Self::Interrupted, Self::Unsealed, Self::Newer, Self::Unreadable];

    /// The name in lists.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Closed => "closed",
            Self::Running => "running",
            Self::Interrupted => "interrupted",
            Self::Unsealed => "unsealed",
            Self::Newer => "newer",
            Self::Unreadable => "unreadable",
        }
    }
}

/// Which runs are wanted. Folders of other runs are not opened.
#[derive(Debug, Clone, Copy, Default)]
pub struct Wanted<'a> {
    /// The first day.
    pub since: Option<NaiveDate>,
    /// The last day.
    pub until: Option<NaiveDate>,
    /// The module.
    pub serial_number: Option<&'a str>,
}

impl Wanted<'_> {
    fn has_day(&self, day: NaiveDate) -> bool {
        self.since.is_none_or(|since| day >= since) && self.until.is_none_or(|until| day <= until)
    }
}

impl FoundRun {
    /// In what state the folder was found.
    #[must_use]
    pub fn state(&self) -> Found {
        match &self.run {
            _ if self.running => Found::Running,
            Err(error) if error.is_newer() => Found::Newer,
            Err(_) => Found::Unreadable,
            Ok(run) if run.interrupted => Found::Interrupted,
            Ok(_) if !self.sealed => Found::Unsealed,
            Ok(_) => Found::Closed,
        }
    }

    /// Its place below a records folder: `DATE/SERIAL/TIME-PLAN`.
    #[must_use]
    pub fn place(&self, records: &Path) -> String {
        self.path.strip_prefix(records).unwrap_or(&self.path).display().to_string()
    }

    /// Whether its journal does not tell what it was: it is damaged, gone, or of a later version.
    #[must_use]
    pub fn is_unknown(&self) -> bool {
        match &self.run {
            Ok(_) => false,
            Err(ReadError::NeverBegun) => is_sealed(&self.path),
            Err(_) => true,
        }
    }

    /// Whether it is a run of this module. For a run whose journal does not tell, the folder's name decides: a run that was damaged
    /// may not hide.
    #[must_use]
    pub fn is_of(&self, serial_number: &str) -> bool {
        match &self.run {
            Ok(run) => run.serial_number == serial_number && run.other_module.is_none(),
            Err(_) => {
                self.is_unknown()
                    && self.path.parent().is_some_and(|of| folders_of(serial_number).contains(&name_of(of)))
            }
        }
    }
}

/// All runs below a records folder, in the order in which they were closed.
///
/// # Errors
/// The folder itself cannot be read.
pub fn list(records: &Path) -> Result<Vec<FoundRun>, StoreError> {
    Ok(wanted(records, Wanted::default())?.collect())
}

/// The wanted runs below a records folder, in the order in which they were closed. Each is read when it is asked for: records of calibrations are
/// long, and a thousand of them would fill the memory.
///
/// # Errors
/// The folder itself cannot be read.
pub fn wanted<'a>(records: &Path, wanted: Wanted<'a>) -> Result<impl Iterator<Item = FoundRun> + use<'a>, StoreError> {
    let runs = paths_wanted(records, wanted)?.into_iter().map(found);
    // Two serial numbers may share one folder.
    Ok(runs.filter(move |run| wanted.serial_number.is_none_or(|serial_number| run.is_of(serial_number))))
}

/// The folders of all runs below a records folder, in the order in which they were closed.
///
/// # Errors
/// The folder itself cannot be read.
pub fn paths(records: &Path) -> Result<Vec<PathBuf>, StoreError> {
    paths_wanted(records, Wanted::default())
}

fn paths_wanted(records: &Path, wanted: Wanted<'_>) -> Result<Vec<PathBuf>, StoreError> {
    let mut runs = Vec::new();
    for day in folders(records)?.into_iter().filter(|path| day_of(path).is_some_and(|day| wanted.has_day(day))) {
        // A folder that cannot be read does not hide the others.
        let serials = match wanted.serial_number {
            Some(serial_number) => folders_of(serial_number).into_iter().map(|name| day.join(name)).collect(),
            None => folders(&day).unwrap_or_default(),
        };
        for serial in serials {
            runs.extend(folders(&serial).unwrap_or_default());
        }
    }
    Ok(chain::by_close(records, runs))
}

/// Runs that stand among those of a module and whose journals name another one: they were moved there. Two serial numbers may share one
/// folder, and such runs are none of these.
#[must_use]
pub fn moved_among(records: &Path, serial_number: &str) -> Vec<PathBuf> {
    let wanted = Wanted { serial_number: Some(serial_number), ..Wanted::default() };
    let is_elsewhere = |path: &PathBuf| {
        let folder = path.parent().map(name_of).unwrap_or_default();
        read(path).is_ok_and(|run| !folders_of(&run.serial_number).contains(&folder))
    };
    paths_wanted(records, wanted).unwrap_or_default().into_iter().filter(is_elsewhere).collect()
}

/// The days that have records, oldest first, each with its number of serial numbers.
///
/// # Errors
/// The folder itself cannot be read.
pub fn days(records: &Path) -> Result<Vec<(String, usize)>, StoreError> {
    let days = folders(records)?.into_iter().filter(|day| is_day(day));
    let modules = |day: &Path| {
        let folders = folders(day).unwrap_or_default();
        folders.iter().filter(|folder| name_of(folder) != UNASSIGNED).count()
    };
    Ok(days.map(|day| (name_of(&day), modules(&day))).collect())
}

/// The folders of the runs of a day, in no order.
///
/// # Errors
/// The day's folder cannot be read.
pub(crate) fn paths_of_day(records: &Path, day: &str) -> Result<Vec<PathBuf>, StoreError> {
    let serials = folders(&records.join(day))?;
    Ok(serials.iter().flat_map(|serial| folders(serial).unwrap_or_default()).collect())
}

/// The days that have records, oldest first.
pub(crate) fn day_names(records: &Path) -> Result<Vec<String>, StoreError> {
    Ok(folders(records)?.into_iter().filter(|day| is_day(day)).map(|day| name_of(&day)).collect())
}

/// The newest day that has records; `None` without any, and if the folder cannot be read.
#[must_use]
pub fn newest_day(records: &Path) -> Option<NaiveDate> {
    folders(records).ok()?.iter().filter_map(|folder| day_of(folder)).max()
}

/// At most `limit` runs of a day, newest first, and whether there are more. Each is read when it is asked for: thousands of
/// long records would fill the memory.
///
/// # Errors
/// The day's folder cannot be read.
pub fn of_day(
    records: &Path,
    day: &str,
    limit: usize,
) -> Result<(impl DoubleEndedIterator<Item = FoundRun> + use<>, bool), StoreError> {
    let mut paths = chain::by_close(records, paths_of_day(records, day)?);
    let cut = paths.len() > limit;
    paths.reverse();
    paths.truncate(limit);
    Ok((paths.into_iter().map(found), cut))
}

/// The runs of one module on a day, oldest first, also those of a newer version; empty if the folder cannot be read.
#[must_use]
pub fn of_module(records: &Path, day: &str, serial_number: &str) -> Vec<FoundRun> {
    let runs = runs_of_module(&records.join(day), serial_number).into_iter().map(found);
    runs.filter(|found| found.is_of(serial_number)).collect()
}

/// Folders of the newest runs, newest first: the days by their dates, the runs of a day as they were closed.
pub fn newest(records: &Path, limit: usize) -> impl Iterator<Item = PathBuf> {
    let days = folders(records).unwrap_or_default().into_iter().filter(|day| is_day(day)).rev();
    let records = records.to_owned();
    let of_day = move |day: PathBuf| {
        let serials = folders(&day).unwrap_or_default();
        let runs: Vec<PathBuf> = serials.iter().flat_map(|serial| folders(serial).unwrap_or_default()).collect();
        chain::by_close(&records, runs).into_iter().rev()
    };
    days.flat_map(of_day).take(limit)
}

/// Folders of the runs of one module, those that were closed last first. They may include folders of another module, as those
/// of [`newest_of_module`].
#[must_use]
pub fn closed_last_of_module(records: &Path, serial_number: &str) -> Vec<PathBuf> {
    let mut runs = chain::by_close(records, newest_of_module(records, serial_number).collect());
    runs.reverse();
    runs
}

/// Folders of the runs of one module, newest first by their names. They may include folders of another module, since two serial
/// numbers may share one folder.
pub fn newest_of_module(records: &Path, serial_number: &str) -> impl Iterator<Item = PathBuf> {
    let days = folders(records).unwrap_or_default().into_iter().filter(|day| is_day(day)).rev();
    let serial_number = serial_number.to_owned();
    days.flat_map(move |day| runs_of_module(&day, &serial_number).into_iter().rev())
}

/// The day in whose folder a run stands.
pub(crate) fn day_of_run(run: &Path) -> Option<NaiveDate> {
    run.ancestors().nth(2).and_then(day_of)
}

/// Whether a run stands in the folder of a day, as in a records folder.
#[must_use]
pub fn stands_in_a_day(run: &Path) -> bool {
    super::located::located(run).is_ok_and(|run| day_of_run(&run).is_some())
}

/// The runs of a day whose module was not the scanned one, in no order. What of them concerns the scanned one, their records
/// tell.
pub(crate) fn unassigned(records: &Path, day: &str) -> Vec<PathBuf> {
    folders(&records.join(day).join(UNASSIGNED)).unwrap_or_default()
}

/// Whether the folder of a run stands among those.
pub(crate) fn is_unassigned(run: &Path) -> bool {
    run.parent().and_then(Path::file_name) == Some(UNASSIGNED.as_ref())
}

/// The folders of a module within a day: as it is named now, and as earlier versions named it, if that differs.
pub(crate) fn folders_of(serial_number: &str) -> Vec<String> {
    let mut names = vec![name::of_module(serial_number), name::of_module_before(serial_number)];
    names.dedup();
    names
}

/// The days and the folders of modules in which wanted runs may lie and that cannot be read, each with its error. One that is not
/// there, or is no folder, has no runs. Of a module also the runs that stand apart are looked at.
///
/// # Errors
/// The folder itself cannot be read.
pub fn unread(records: &Path, wanted: Wanted<'_>) -> Result<Vec<StoreError>, StoreError> {
    let of = |folder: &Path| match folders(folder) {
        Err(StoreError::File { source, .. }) if !says_nothing(&source) => Ok(Vec::new()),
        read => read,
    };
    let mut unread = Vec::new();
    let days = folders(records)?;
    for day in days.iter().filter(|path| day_of(path).is_some_and(|day| wanted.has_day(day))) {
        let modules = match (of(day), wanted.serial_number) {
            (Err(error), _) => {
                unread.push(error);
                continue;
            }
            (Ok(all), None) => all,
            (Ok(_), Some(serial_number)) => {
                let names = folders_of(serial_number).into_iter().chain([UNASSIGNED.to_owned()]);
                names.map(|name| day.join(name)).collect()
            }
        };
        unread.extend(modules.iter().filter_map(|module| of(module).err()));
    }
    Ok(unread)
}

/// Runs in the folders of a module on a day, oldest first.
fn runs_of_module(day: &Path, serial_number: &str) -> Vec<PathBuf> {
    let of_both = folders_of(serial_number).into_iter().map(|name| folders(&day.join(name)).unwrap_or_default());
    let mut runs: Vec<PathBuf> = of_both.flatten().collect();
    // Names of runs begin with their time of day.
    runs.sort_by(|a, b| a.file_name().cmp(&b.file_name()));
    runs
}

/// Reads a run, and the state of its folder.
pub(crate) fn found(path: PathBuf) -> FoundRun {
    // In this order: a run that ends meanwhile is shown as running or closed, and never as interrupted.
    let running = !is_sealed(&path) && goes_on(&path);
    let run = read(&path);
    FoundRun { run, running, sealed: is_sealed(&path), path }
}

/// Whether a folder holds a run or part of one: a run whose journal was removed must be found.
#[must_use]
pub fn is_run(folder: &Path) -> bool {
    [JOURNAL, RECORD, DIGESTS].iter().any(|file| folder.join(file).exists())
}

/// Whether a folder is certainly that of a run. Other programs too write a file with one of these names: a list of digests stands beside
/// many a release.
pub(crate) fn is_certainly_run(folder: &Path) -> bool {
    let has = |file: &str| folder.join(file).is_file();
    let stands_in_a_day = || folder.ancestors().nth(2).is_some_and(is_day);
    [JOURNAL, RECORD, DIGESTS].iter().filter(|file| has(file)).count() > 1 || is_run(folder) && stands_in_a_day()
}

/// Whether a run's folder was closed with its digests.
#[must_use]
pub fn is_sealed(folder: &Path) -> bool {
    folder.join(DIGESTS).is_file()
}

/// Day and name of a run's folder, as the order of runs.
pub(crate) fn when(run: &Path) -> (String, String) {
    let day = run.ancestors().nth(2).map(name_of).unwrap_or_default();
    (day, name_of(run))
}

fn name_of(folder: &Path) -> String {
    folder.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Whether a folder is named by a date; a separate disk has other folders too.
pub(crate) fn is_day(folder: &Path) -> bool {
    day_of(folder).is_some()
}

fn day_of(folder: &Path) -> Option<NaiveDate> {
    let name = name_of(folder);
    // `2026-1-5` is read as a date as well, and stands in the wrong place of a list.
    NaiveDate::parse_from_str(&name, DAY).ok().filter(|day| day.format(DAY).to_string() == name)
}

/// Reads a run from its journal.
///
/// # Errors
/// [`ReadError`].
pub fn read(folder: &Path) -> Result<RunRecord, ReadError> {
    RunRecord::of_folded(fold(folder)?).ok_or(ReadError::Empty)
}

/// Folds a run's journal.
///
/// # Errors
/// [`ReadError`].
pub fn fold(folder: &Path) -> Result<RunState, ReadError> {
    if was_never_begun(folder) {
        return Err(ReadError::NeverBegun);
    }
    let path = folder.join(JOURNAL);
    journal::fold_from(open_journal(&path)?)
        .map(|journal| journal.state)
        .map_err(|error| ReadError::of_fold(path, error))
}

/// The events of a run in their order; [`fold`] must have found its journal good.
///
/// # Errors
/// [`ReadError`].
pub fn events(folder: &Path) -> Result<Vec<Event>, ReadError> {
    let path = folder.join(JOURNAL);
    let mut lines = JournalLines::new(open_journal(&path)?);
    let mut events: Vec<Event> = Vec::new();
    let mut kept = Kept::default();
    while let Some(line) = lines.next_line().map_err(|error| ReadError::of_fold(path.clone(), error))? {
        Kept::check_line(line.number, line.bytes).map_err(|error| ReadError::of_fold(path.clone(), error.into()))?;
        // In an interrupted run the last line may be cut off; the fold found all others good.
        let Ok(event) = serde_json::from_slice::<Event>(line.bytes) else { break };
        let counted = kept.add(line.number, line.bytes, &event.kind);
        counted.map_err(|error| ReadError::of_fold(path.clone(), error.into()))?;
        events.push(event);
    }
    Ok(events)
}

/// The files of a run's plan, each with its name and content, in the order in which the plan included them.
///
/// # Errors
/// [`ReadError`].
pub fn plan(folder: &Path) -> Result<Vec<(String, Vec<u8>)>, ReadError> {
    let dir = folder.join(PLAN);
    let cannot = |source: io::Error| ReadError::File { path: dir.clone(), source };
    let mut files = Vec::new();
    for entry in fs::read_dir(&dir).map_err(cannot)?.take(MAX_PLAN_FILES + 1) {
        files.push(entry.map_err(cannot)?.path());
    }
    // The file names begin with a number of two digits and a mark.
    files.sort();
    if files.is_empty() {
        return Err(ReadError::NoPlan);
    }
    let named = |path: &PathBuf| name_of(path).get(3..).unwrap_or_default().to_owned();
    let read =
        |path: &PathBuf| gnc_files::read_below(folder, &Path::new(PLAN).join(name_of(path)), MAX_PLAN_BYTES as u64);
    files.iter().map(|path| Ok((named(path), read(path).map_err(cannot)?))).collect()
}

/// A paper as it was filed: passport or report.
///
/// # Errors
/// The error of the system.
pub fn paper(folder: &Path, name: &str) -> std::io::Result<Vec<u8>> {
    gnc_files::whole(pending::open(folder, name)?, MAX_PAPER_BYTES)
}

/// A journal that is read line by line: a long one would take as much memory as its file.
pub(super) fn open_journal(path: &Path) -> Result<impl BufRead + use<>, ReadError> {
    let cannot = |source: io::Error| ReadError::File { path: path.to_owned(), source };
    let file = gnc_files::own(path).map_err(cannot)?;
    if file.metadata().map_err(cannot)?.len() > MAX_JOURNAL_BYTES {
        return Err(ReadError::TooLong { path: path.to_owned() });
    }
    Ok(BufReader::new(file.take(MAX_JOURNAL_BYTES)))
}

fn folders(dir: &Path) -> Result<Vec<PathBuf>, StoreError> {
    let mut found = Vec::new();
    for entry in on(fs::read_dir(dir), "read", dir)? {
        let path = on(entry, "read", dir)?.path();
        // A link to a folder is none of the records, wherever it leads; `verify` names it.
        match path.symlink_metadata() {
            Ok(meta) if meta.is_dir() && !is_litter_folder(&path) => found.push(path),
            Err(error) if says_nothing(&error) => return on(Err(error), "read", &path),
            _ => {}
        }
    }
    found.sort();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;
    use crate::store::SIGNATURE;
    use crate::store::as_written::check;

    /// A pipe, an endless device or a link in the place of each file of a run: each look ends, and none follows.
    #[test]
    fn what_is_no_file_ends_each_look() {
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("2026-11-28/SN/120000-functional");
        for name in [JOURNAL, RECORD, DIGESTS, SIGNATURE, "plan/01-plan.toml", crate::report::REPORT] {
            for kind in ["pipe", "zeros", "link"] {
                fs::create_dir_all(run.join(PLAN)).unwrap();
                fs::write(run.join(JOURNAL), "{}\n").unwrap();
                fs::write(run.join(DIGESTS), "").unwrap();
                let path = run.join(name);
                let _ = fs::remove_file(&path);
                match kind {
                    "pipe" => nix::unistd::mkfifo(&path, nix::sys::stat::Mode::S_IRWXU).unwrap(),
                    "zeros" => symlink("/dev/zero", &path).unwrap(),
                    _ => symlink("../../../elsewhere", &path).unwrap(),
                }
                let looks = (goes_on(&run), found(run.clone()).state(), fold(&run).is_err(), check(&run).problems);
                assert!(!looks.3.is_empty() && looks.2, "{name} is a {kind}: {looks:?}");
                assert!(plan(&run).is_err() && paper(&run, crate::report::REPORT).is_err(), "{name} is a {kind}");
                fs::remove_dir_all(&run).unwrap();
            }
        }
    }
}
