//! The chain of closed runs. A run that is changed, removed or inserted later breaks it.
//!
//! Each day's folder has a file `CHAIN` with a line for each run closed there:
//!
//! ```text
//! NUMBER  LINK-BEFORE  DIGEST  LINK  DATE/SERIAL/TIME-PLAN
//! ```
//!
//! `DIGEST` is the SHA-256 of the run's `SHA256SUMS`, which covers all of its files. `LINK` is the SHA-256 of
//! `NUMBER LINK-BEFORE DIGEST DATE/SERIAL/TIME-PLAN`, so that a changed line changes all links behind it. A run whose
//! station ended before it was in the chain is closed late: its line goes on with ` late TIME PROGRAM`, which `LINK`
//! covers too, so that nobody can take the mark away later. Numbers go on
//! from day to day. `COUNTER` in the records folder holds the last number and link: it reveals a tail that was cut off.
//! A person who can write all of these files can forge all of them: keep a copy of `COUNTER` in another place.

mod apart;
mod entry;
mod order;

use std::collections::{HashMap, HashSet};
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use nix::errno::Errno;
use nix::fcntl::{Flock, FlockArg};

use super::folder::sync_dir;
use super::{DIGESTS, StoreError, digest, goes_on, on, reader};
pub(crate) use apart::{apart, last_number};
use entry::ChainEntry;
pub use entry::LateClose;
pub(crate) use order::by_close;

/// The file of the chain in a day's folder.
pub(crate) const CHAIN: &str = "CHAIN";
/// The file with the last number and link, in the records folder.
pub(crate) const COUNTER: &str = "COUNTER";
/// The link before the first run.
const NOTHING: &str = "0000000000000000000000000000000000000000000000000000000000000000";
/// Longest wait for another station that closes a run: that station writes two short files and waits for the disk.
const LOCKED_FOR: Duration = Duration::from_secs(10);
/// Number of newest days that are searched for the last line: a run that went on past midnight is closed in the day
/// before.
const NEWEST_DAYS: usize = 3;
/// Time between two looks at the lock.
const LOOK_EVERY: Duration = Duration::from_millis(5);

/// Appends a closed run to the chain. Its `SHA256SUMS` must be on disk.
///
/// # Errors
/// [`StoreError`]: the disk failed, or another station does not release the lock.
pub(crate) fn append(run: &Path) -> Result<(), StoreError> {
    append_as(run, None)
}

/// As [`append`], with the mark of a run that is closed late.
pub(crate) fn append_as(run: &Path, late: Option<&LateClose>) -> Result<(), StoreError> {
    let mut above = run.ancestors().skip(2);
    let (Some(day), Some(records)) = (above.next(), above.next()) else {
        return on(Err(io::ErrorKind::NotFound.into()), "find the records folder of", run);
    };
    let _lock = lock(records)?;
    let (number, before) = last(records)?;
    let digest = digest::of_file(&run.join(DIGESTS))?;
    let name = name_in(records, run);
    let link = ChainEntry::new(number + 1, &before, &digest, &name, late.cloned());
    let path = day.join(CHAIN);
    let mut file = on(OpenOptions::new().create(true).append(true).open(&path), "write", &path)?;
    let whole = on(whole_lines(&path), "read", &path)?;
    on(file.set_len(whole), "write", &path)?;
    let written = file.write_all(link.line().as_bytes()).and_then(|()| file.sync_all());
    if written.is_err() {
        // Ignore the error: half a line is taken away before the next one.
        let _ = file.set_len(whole);
    }
    on(written, "write", &path)?;
    sync_dir(day)?;
    count(records, link.number, &link.link)
}

/// Bytes of a chain up to the end of its last whole line. A power cut or a full disk may leave half a line, which would
/// swallow the next one.
fn whole_lines(path: &Path) -> io::Result<u64> {
    let text = fs::read(path)?;
    Ok(text.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last as u64 + 1))
}

/// The closed runs among `runs` that are missing in the chains of their days.
///
/// # Errors
/// [`StoreError`]: a chain cannot be read.
pub(super) fn unknown(records: &Path, runs: Vec<PathBuf>) -> Result<Vec<PathBuf>, StoreError> {
    let mut days: HashMap<String, HashSet<String>> = HashMap::new();
    let mut missing = Vec::new();
    for run in runs {
        let name = name_in(records, &run);
        let day = name.split('/').next().unwrap_or_default();
        if !days.contains_key(day) {
            let links = chain_of(records, day)?.map(|chain| chain.links).unwrap_or_default();
            days.insert(day.to_owned(), links.into_iter().map(|link| link.run).collect());
        }
        if !days.get(day).is_some_and(|known| known.contains(&name)) {
            missing.push(run);
        }
    }
    Ok(missing)
}

/// `DATE/SERIAL/TIME-PLAN` of a run.
fn name_in(records: &Path, run: &Path) -> String {
    run.strip_prefix(records).unwrap_or(run).to_string_lossy().into_owned()
}

/// The chain, as far as it tells whether a run may be closed late.
pub(super) struct Before {
    known: HashSet<String>,
    /// Day and time of the first line; `None` if there is no line.
    first: Option<(String, String)>,
    /// Whether the last line is at least the one that the counter remembers. If it is not, lines were lost, and each of
    /// them may be that of a run which looks as if it had none.
    is_whole: bool,
    /// Whether nothing was ever counted in this folder.
    is_new: bool,
}

impl Before {
    /// # Errors
    /// [`StoreError`]: a chain or the counter cannot be read.
    pub(super) fn read(records: &Path) -> Result<Self, StoreError> {
        let links: Vec<ChainEntry> = chains(records, usize::MAX)?.into_iter().flat_map(|day| day.links).collect();
        let counted = counter(records)?;
        let last = links.iter().map(|link| link.number).max().unwrap_or(0);
        let first = links.iter().min_by_key(|link| link.number).map(|link| day_and_time(&link.run));
        let first = first.map(|(day, time)| (day.to_owned(), time.to_owned()));
        let is_whole = counted.as_ref().is_none_or(|(number, _)| last >= *number);
        let is_new = counted.is_none() && links.is_empty();
        Ok(Self { known: links.into_iter().map(|link| link.run).collect(), first, is_whole, is_new })
    }

    /// Whether nothing was ever counted in this folder: the run that ended is its first one, or the whole chain was lost.
    pub(super) fn is_new(&self) -> bool {
        self.is_new
    }

    /// Whether a run that ended may have missed its line by a sudden end of its station. A run from before the first line
    /// may have lost its line with others, or is from before there was a chain.
    pub(super) fn may_lack(&self, records: &Path, run: &Path) -> bool {
        let name = name_in(records, run);
        let is_later =
            self.first.as_ref().is_none_or(|(day, time)| day_and_time(&name) >= (day.as_str(), time.as_str()));
        self.is_whole && is_later && !self.known.contains(&name)
    }
}

/// Day and time of a run by its name.
fn day_and_time(run: &str) -> (&str, &str) {
    let folder = run.rsplit('/').next().unwrap_or_default();
    (run.split('/').next().unwrap_or_default(), folder.split('-').next().unwrap_or_default())
}

/// Takes the lock of the whole folder: only one station at a time.
#[expect(clippy::disallowed_methods, reason = "flock has no wait with a deadline; this thread writes records alone")]
fn lock(records: &Path) -> Result<Flock<File>, StoreError> {
    let began = Instant::now();
    let mut folder = on(File::open(records), "read", records)?;
    loop {
        match Flock::lock(folder, FlockArg::LockExclusiveNonblock) {
            Ok(lock) => return Ok(lock),
            Err((back, Errno::EAGAIN)) if began.elapsed() < LOCKED_FOR => folder = back,
            Err((_, error)) => return on(Err(error.into()), "lock", records),
        }
        std::thread::sleep(LOOK_EVERY);
    }
}

fn count(records: &Path, number: u64, link: &str) -> Result<(), StoreError> {
    let (path, part) = (records.join(COUNTER), records.join(format!("{COUNTER}.part")));
    let mut file = on(File::create(&part), "write", &part)?;
    on(writeln!(file, "{number} {link}").and_then(|()| file.sync_all()), "write", &part)?;
    on(fs::rename(&part, &path), "write", &path)?;
    sync_dir(records)
}

/// Number and link of the last run. If the power failed between a line and the counter, the line counts.
fn last(records: &Path) -> Result<(u64, String), StoreError> {
    let counted = counter(records)?.unwrap_or_else(|| (0, NOTHING.to_owned()));
    let newest = chains(records, NEWEST_DAYS)?.into_iter().flat_map(|day| day.links).max_by_key(|link| link.number);
    Ok(match newest {
        Some(link) if link.number > counted.0 => (link.number, link.link),
        _ => counted,
    })
}

fn counter(records: &Path) -> Result<Option<(u64, String)>, StoreError> {
    let path = records.join(COUNTER);
    let text = match fs::read_to_string(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        read => on(read, "read", &path)?,
    };
    let read = text.trim_end().split_once(' ').and_then(|(number, link)| Some((number.parse().ok()?, link.to_owned())));
    match read {
        Some(counted) => Ok(Some(counted)),
        None => on(Err(io::Error::new(io::ErrorKind::InvalidData, "it holds no number and link")), "read", &path),
    }
}

/// The chain of a day.
struct DayChain {
    path: PathBuf,
    links: Vec<ChainEntry>,
    /// Number of broken lines; the last one may be half a line after a power cut.
    broken: usize,
}

/// The chains of so many days, newest day first.
fn chains(records: &Path, days: usize) -> Result<Vec<DayChain>, StoreError> {
    let mut chains = Vec::new();
    for (day, _) in reader::days(records)?.into_iter().rev().take(days) {
        chains.extend(chain_of(records, &day)?);
    }
    Ok(chains)
}

/// The chain of a day, if it has one.
fn chain_of(records: &Path, day: &str) -> Result<Option<DayChain>, StoreError> {
    let path = records.join(day).join(CHAIN);
    // After a power cut anything may stand behind the last whole line.
    let text = match fs::read(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        read => String::from_utf8_lossy(&on(read, "read", &path)?).into_owned(),
    };
    // Half a line may look like a whole one with a shorter name, so a line counts with its end only.
    let lines = || text.split_inclusive('\n');
    let whole = lines().filter_map(|line| line.strip_suffix('\n'));
    let links: Vec<ChainEntry> = whole.filter_map(ChainEntry::parse).collect();
    let broken = lines().count() - links.len();
    Ok(Some(DayChain { path, links, broken }))
}

/// The closed runs of a day, to look them up.
#[derive(Debug, Default)]
pub(crate) struct DayLinks(HashMap<String, RunLink>);

/// What the chain says of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RunLink {
    /// Its place in the order in which runs were closed.
    pub(crate) number: u64,
    /// Digest of its list of digests.
    pub(crate) digest: String,
    /// Whether its line is as it was written, and the next line of the day follows from it.
    pub(crate) is_sound: bool,
    /// When and by what the run was closed late, if it was.
    pub(crate) late: Option<LateClose>,
}

impl DayLinks {
    /// A run by its name in the chain.
    pub(crate) fn find(&self, run: &str) -> Option<&RunLink> {
        self.0.get(run)
    }

    /// Number and name of the closed runs in the folder of a module.
    pub(crate) fn of_module<'a>(&'a self, folder: &'a str) -> impl Iterator<Item = (u64, &'a str)> {
        let runs = self.0.iter().filter(move |(run, _)| run.split('/').nth(1) == Some(folder));
        runs.map(|(run, link)| (link.number, run.as_str()))
    }
}

/// The chain of a day. It is empty if the day has none. Links from day to day are left to [`verify`].
pub(crate) fn of_day(records: &Path, day: &str) -> Result<DayLinks, StoreError> {
    let Some(mut chain) = chain_of(records, day)? else { return Ok(DayLinks::default()) };
    chain.links.sort_by_key(|link| link.number);
    let follows = |at: usize| match (chain.links.get(at), chain.links.get(at + 1)) {
        (Some(link), Some(next)) if next.number == link.number + 1 => next.before == link.link,
        // A run that went on past midnight is closed in the day before, so numbers of a day may have gaps.
        (Some(link), Some(next)) => next.number > link.number,
        _ => true,
    };
    let sound: Vec<bool> = (0..chain.links.len()).map(|at| chain.links[at].is_true() && follows(at)).collect();
    let links = chain.links.into_iter().zip(sound);
    let links = links.map(|(link, is_sound)| {
        let ChainEntry { number, digest, run, late, .. } = link;
        (run, RunLink { number, digest, is_sound, late })
    });
    Ok(DayLinks(links.collect()))
}

/// The result of a check of the chain.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct ChainCheck {
    /// Runs in the chain.
    pub runs: usize,
    /// Number of the first run in the chain. If it is not 1, earlier days were moved elsewhere.
    pub first: u64,
    /// What was changed, a sentence each.
    pub problems: Vec<String>,
    /// Runs in the chain that were closed late.
    pub late: usize,
}

/// Checks the chain from the first run to the last.
///
/// # Errors
/// The folder cannot be read.
pub fn verify(records: &Path) -> Result<ChainCheck, StoreError> {
    let mut checked = ChainCheck::default();
    // Before the chain is read: a run that is closed meanwhile stands in the chain and not here.
    let closed = closed(records)?;
    let chains = chains(records, usize::MAX)?;
    for day in chains.iter().filter(|day| day.broken > 0) {
        checked.problems.push(format!("{}: {} lines do not belong to a chain", day.path.display(), day.broken));
    }
    let mut links: Vec<ChainEntry> = chains.into_iter().flat_map(|day| day.links).collect();
    links.sort_by_key(|link| link.number);
    checked.runs = links.len();
    checked.late = links.iter().filter(|link| link.late.is_some()).count();
    checked.first = links.first().map_or(0, |link| link.number);
    for pair in links.windows(2) {
        if pair[1].number != pair[0].number + 1 || pair[1].before != pair[0].link {
            let (before, after) = (&pair[0], &pair[1]);
            checked.problems.push(format!(
                "the chain is broken between run {} ({}) and run {} ({})",
                before.number, before.run, after.number, after.run
            ));
        }
    }
    for link in &links {
        look_at(records, link, &mut checked.problems);
    }
    slipped_in(&closed, &links, &mut checked.problems);
    match (counter(records)?, links.last()) {
        (None, Some(_)) => {
            checked.problems.push(format!("{COUNTER} is missing, so the number of runs is not known"));
        }
        (Some((number, _)), last) if last.map_or(0, |last| last.number) < number => {
            let last = last.map_or(0, |last| last.number);
            checked.problems.push(format!(
                "{number} runs were closed, but the chain ends at run {last}: the newest runs are missing"
            ));
        }
        (Some((number, link)), _) if links.iter().any(|one| one.number == number && one.link != link) => {
            checked.problems.push(format!("run {number} is not the run that {COUNTER} remembers"));
        }
        _ => {}
    }
    Ok(checked)
}

fn look_at(records: &Path, link: &ChainEntry, problems: &mut Vec<String>) {
    if !link.is_true() {
        problems.push(format!("run {} ({}): its line in the chain was changed", link.number, link.run));
    }
    let sums = records.join(&link.run).join(DIGESTS);
    match digest::of_file(&sums) {
        Ok(digest) if digest == link.digest => {}
        Ok(_) => {
            problems
                .push(format!("run {} ({}): {DIGESTS} was changed after the run was closed", link.number, link.run));
        }
        Err(_) => problems.push(format!("run {} ({}) was closed, and its folder is missing", link.number, link.run)),
    }
}

/// `DATE/SERIAL/TIME-PLAN` of all closed runs; of those that a station is closing now, none.
fn closed(records: &Path) -> Result<Vec<String>, StoreError> {
    let closed = reader::paths(records)?.into_iter().filter(|run| reader::is_sealed(run) && !goes_on(run));
    Ok(closed.map(|run| name_in(records, &run)).collect())
}

/// Reports closed runs that the chain of their day does not contain. Days from before the chain existed have no chain.
fn slipped_in(closed: &[String], links: &[ChainEntry], problems: &mut Vec<String>) {
    let known: HashSet<&str> = links.iter().map(|link| link.run.as_str()).collect();
    let Some(first_day) = links.iter().filter_map(|link| link.run.split('/').next()).min() else { return };
    for name in closed.iter().filter(|name| name.as_str() > first_day && !known.contains(name.as_str())) {
        problems.push(format!(
            "{name} is not in the chain: its station ended before that and closes it late at its next start, or it was slipped in"
        ));
    }
}

/// What the chain says of one closed run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChainStanding {
    /// It has the run as it is now.
    Held,
    /// It has the run with other digests, or its own line was changed.
    Other,
    /// It has the run as it is now, and the run was closed late.
    Late,
    /// It does not have the run.
    Missing,
    /// These records have no chain: a version before it made them.
    NoChain,
}

/// Looks a closed run up in the chain.
///
/// # Errors
/// A file cannot be read.
pub fn standing(run: &Path) -> Result<ChainStanding, StoreError> {
    let run = &on(std::path::absolute(run), "find", run)?;
    let mut above = run.ancestors().skip(2);
    let (Some(day), Some(records)) = (above.next(), above.next()) else { return Ok(ChainStanding::NoChain) };
    if !day.join(CHAIN).exists() {
        let counted = records.join(COUNTER).exists();
        return Ok(if counted { ChainStanding::Missing } else { ChainStanding::NoChain });
    }
    let name = name_in(records, run);
    let links: Vec<ChainEntry> = chains(records, usize::MAX)?.into_iter().flat_map(|day| day.links).collect();
    let Some(link) = links.iter().find(|link| link.run == name) else { return Ok(ChainStanding::Missing) };
    // A line that was written anew with all that it says does not fit the next line, or the counter.
    let follows = match links.iter().find(|next| next.number == link.number + 1) {
        Some(next) => next.before == link.link,
        None => counter(records)?.is_none_or(|(number, last)| number != link.number || last == link.link),
    };
    let is_same = digest::of_file(&run.join(DIGESTS))? == link.digest;
    let is_held = is_same && link.is_true() && follows;
    Ok(match (is_held, &link.late) {
        (true, Some(_)) => ChainStanding::Late,
        (true, None) => ChainStanding::Held,
        (false, _) => ChainStanding::Other,
    })
}

/// Tells which runs were closed late. It remembers the day of the run that was asked for last: ask in the order of days.
#[derive(Debug, Default)]
pub struct LateCloses {
    day: Option<(PathBuf, DayLinks)>,
}

impl LateCloses {
    /// When and by what a run was closed late; `None` if it was not.
    ///
    /// # Errors
    /// The chain of its day cannot be read.
    pub fn of(&mut self, run: &Path) -> Result<Option<LateClose>, StoreError> {
        let run = &on(std::path::absolute(run), "find", run)?;
        let mut above = run.ancestors().skip(2);
        let (Some(day), Some(records)) = (above.next(), above.next()) else { return Ok(None) };
        let links = match self.day.take().filter(|(known, _)| known == day) {
            Some((_, links)) => links,
            None => of_day(records, &day.strip_prefix(records).unwrap_or(day).to_string_lossy())?,
        };
        let late = links.find(&name_in(records, run)).and_then(|link| link.late.clone());
        self.day = Some((day.to_owned(), links));
        Ok(late)
    }
}

#[cfg(test)]
mod tests;
