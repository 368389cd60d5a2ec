//! What the chain says of single runs.

use std::collections::HashMap;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use super::entry::{ChainEntry, LateClose, is_signed_by};
use super::read::{chain_of, chains, counter, name_in};
use super::{CHAIN, COUNTER};
use crate::store::located::located;
use crate::store::{DIGESTS, PublicKey, StoreError, digest, goes_on, on, reader};

/// Bytes at the beginning of the next day's chain that are read: runs that go on past midnight have their lines in both days, some dozens
/// of lines.
const HEAD_BYTES: u64 = 64 << 10;

/// The signature of a line, to be checked when it is asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct LineSignature {
    /// Number of the line.
    pub(crate) number: u64,
    is_true: bool,
    link: String,
    signature: Option<String>,
}

impl LineSignature {
    fn of(line: &ChainEntry) -> Self {
        let ChainEntry { number, link, signature, .. } = line;
        Self { number: *number, is_true: line.is_true(), link: link.clone(), signature: signature.clone() }
    }

    /// Whether one of the keys signed the line, and its link is that of the line. `None`: it has no signature.
    pub(crate) fn is_signed_by(&self, keys: &[PublicKey]) -> Option<bool> {
        is_signed_by(&self.link, self.signature.as_ref()?, keys).then_some(self.is_true).or(Some(false))
    }
}

/// The runs of a day, to look them up.
#[derive(Debug, Default)]
pub(crate) struct DayLinks {
    closed: HashMap<String, RunLink>,
    /// Those that began and were not closed.
    open: HashMap<String, OpenRun>,
}

/// What the chain says of a run that began and was not closed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct OpenRun {
    /// Number of the line.
    pub(crate) number: u64,
    /// Digest of the first line of its journal.
    pub(crate) digest: String,
}

/// What the chain says of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RunLink {
    /// Its place in the order in which runs were closed.
    pub(crate) number: u64,
    /// Digest of its list of digests.
    pub(crate) digest: String,
    /// Whether it has one line that is as it was written, the next line of the day follows from it, and the counter, if it stands there,
    /// remembers it.
    pub(crate) is_sound: bool,
    /// When and by what the run was closed late, if it was.
    pub(crate) late: Option<LateClose>,
    /// The signature of its line.
    close: LineSignature,
    /// That of the line of its beginning, if it has one.
    begin: Option<LineSignature>,
}

impl RunLink {
    /// Number of its first line: that of its beginning, if it has one.
    pub(crate) fn first_number(&self) -> u64 {
        self.begin.as_ref().map_or(self.number, |begin| begin.number.min(self.number))
    }

    /// The signatures of its lines, that of its close last.
    pub(crate) fn lines(&self) -> impl Iterator<Item = &LineSignature> {
        self.begin.iter().chain([&self.close])
    }
}

impl DayLinks {
    /// A run by its name in the chain.
    pub(crate) fn find(&self, run: &str) -> Option<&RunLink> {
        self.closed.get(run)
    }

    /// A run that began and was not closed, by the name under which it began.
    pub(crate) fn find_open(&self, run: &str) -> Option<&OpenRun> {
        self.open.get(run)
    }

    /// Number and name of the closed runs in the folder of a module.
    pub(crate) fn of_module<'a>(&'a self, folder: &'a str) -> impl Iterator<Item = (u64, &'a str)> {
        let runs = self.closed.iter().filter(move |(run, _)| run.split('/').nth(1) == Some(folder));
        runs.map(|(run, link)| (link.number, run.as_str()))
    }

    /// The runs of a module that began and were not closed.
    pub(crate) fn open_of_module<'a>(&'a self, folder: &'a str) -> impl Iterator<Item = (&'a str, &'a OpenRun)> {
        let runs = self.open.iter().filter(move |(run, _)| run.split('/').nth(1) == Some(folder));
        runs.map(|(run, open)| (run.as_str(), open))
    }
}

/// The first lines of the day behind this one, each with the link that it names before it: a line that was written anew at the end of
/// a day does not fit them. What cannot be read says nothing; `verify` names it.
fn heads_behind(records: &Path, day: &str) -> HashMap<u64, String> {
    let days = reader::day_names(records).unwrap_or_default();
    let Some(next) = days.iter().find(|next| next.as_str() > day) else { return HashMap::new() };
    let mut head = Vec::new();
    let read = gnc_files::below(records, &Path::new(next).join(CHAIN));
    if read.is_ok_and(|chain| chain.take(HEAD_BYTES).read_to_end(&mut head).is_err()) {
        return HashMap::new();
    }
    let lines = head.split(|byte| *byte == b'\n').filter_map(|line| std::str::from_utf8(line).ok());
    lines.filter_map(ChainEntry::parse).map(|line| (line.number, line.before)).collect()
}

/// The chain of a day. It is empty if the day has none. Of the links to other days only those to the next one are compared; the rest is
/// left to [`verify`].
pub(crate) fn of_day(records: &Path, day: &str) -> Result<DayLinks, StoreError> {
    let Some(mut chain) = chain_of(records, day)? else { return Ok(DayLinks::default()) };
    chain.lines.sort_by_key(|line| line.number);
    let follows = |at: usize| match (chain.lines.get(at), chain.lines.get(at + 1)) {
        (Some(line), Some(next)) if Some(next.number) == line.number.checked_add(1) => next.before == line.link,
        // A run that went on past midnight is closed in the day before, so numbers of a day may have gaps.
        (Some(line), Some(next)) => next.number > line.number,
        _ => true,
    };
    // A counter that cannot be read says nothing; `verify` names it.
    let counted = counter(records).ok().flatten();
    let is_counted = |line: &ChainEntry| {
        counted.as_ref().is_none_or(|counted| counted.number != line.number || counted.link == line.link)
    };
    let next_day = heads_behind(records, day);
    let is_followed = |line: &ChainEntry| {
        let next = line.number.checked_add(1).and_then(|number| next_day.get(&number));
        next.is_none_or(|before| *before == line.link)
    };
    let is_sound =
        |at: usize, line: &ChainEntry| line.is_true() && follows(at) && is_followed(line) && is_counted(line);
    let sound: Vec<bool> = chain.lines.iter().enumerate().map(|(at, line)| is_sound(at, line)).collect();
    let (closes, begins): (Vec<_>, Vec<_>) = chain.lines.into_iter().zip(sound).partition(|(line, _)| line.is_close());
    let mut links = DayLinks::default();
    let mut signatures: HashMap<String, LineSignature> =
        begins.iter().map(|(line, _)| (line.run.clone(), LineSignature::of(line))).collect();
    let open = begins.into_iter().map(|(line, _)| (line.run, OpenRun { number: line.number, digest: line.digest }));
    links.open = open.collect();
    for (line, is_sound) in closes {
        links.open.remove(line.began_as());
        let (close, begin) = (LineSignature::of(&line), signatures.remove(line.began_as()));
        let ChainEntry { number, digest, run, late, .. } = line;
        let link = RunLink { number, digest, is_sound, late, close, begin };
        if let Some(earlier) = links.closed.insert(run.clone(), link)
            && let Some(link) = links.closed.get_mut(&run)
        {
            // Each run is closed once, so one of the two was written by hand.
            link.is_sound = false;
            link.late = link.late.take().or(earlier.late);
        }
    }
    Ok(links)
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
    let run = &on(located(run), "find", run)?;
    let mut above = run.ancestors().skip(2);
    let (Some(day), Some(records)) = (above.next(), above.next()) else { return Ok(ChainStanding::NoChain) };
    if !day.join(CHAIN).exists() {
        let counted = records.join(COUNTER).exists();
        return Ok(if counted { ChainStanding::Missing } else { ChainStanding::NoChain });
    }
    let name = name_in(records, run);
    let links: Vec<ChainEntry> = chains(records, usize::MAX)?.into_iter().flat_map(|day| day.lines).collect();
    let mut closes = links.iter().filter(|link| link.is_close() && link.run == name);
    let Some(link) = closes.next() else {
        return Ok(ChainStanding::Missing);
    };
    // Each run is closed once, so one of two lines was written by hand.
    let is_alone = closes.next().is_none();
    // A line that was written anew with all that it says does not fit the next line, or the counter.
    let follows = match links.iter().find(|next| Some(next.number) == link.number.checked_add(1)) {
        Some(next) => next.before == link.link,
        None => counter(records)?.is_none_or(|last| last.number != link.number || last.link == link.link),
    };
    let is_same = digest::of_file(&run.join(DIGESTS))? == link.digest;
    let is_held = is_same && is_alone && link.is_true() && follows;
    Ok(match (is_held, &link.late) {
        (true, Some(_)) => ChainStanding::Late,
        (true, None) => ChainStanding::Held,
        (false, _) => ChainStanding::Other,
    })
}

/// Whether one of the keys signed the line by which a run was closed.
///
/// # Errors
/// The chain of its day cannot be read.
pub(crate) fn is_close_signed_by(run: &Path, keys: &[PublicKey]) -> Result<bool, StoreError> {
    let mut days = LateCloses::default();
    Ok(days.link(run)?.is_some_and(|link| link.close.is_signed_by(keys) == Some(true)))
}

/// Whether the chain says that a run was closed with other digests than those that it has; they may be gone.
///
/// # Errors
/// The chain of its day cannot be read, or the digests cannot.
pub(crate) fn was_closed_otherwise(run: &Path) -> Result<bool, StoreError> {
    let mut days = LateCloses::default();
    let Some(link) = days.link(run)? else { return Ok(false) };
    match digest::of_file(&run.join(DIGESTS)) {
        Ok(digest) => Ok(digest != link.digest),
        Err(StoreError::File { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => Ok(true),
        Err(error) => Err(error),
    }
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
        Ok(self.link(run)?.and_then(|link| link.late.clone()))
    }

    /// Whether the chain of a closed run's day lacks it, and no station closes it now. A day without a chain is from before there
    /// was one.
    ///
    /// # Errors
    /// The chain of its day cannot be read.
    pub fn lacks(&mut self, run: &Path) -> Result<bool, StoreError> {
        let is_known = self.link(run)?.is_some();
        let has_chain = self.day.as_ref().is_some_and(|(_, links)| !links.closed.is_empty());
        Ok(!is_known && has_chain && !goes_on(run))
    }

    fn link(&mut self, run: &Path) -> Result<Option<&RunLink>, StoreError> {
        let run = &on(located(run), "find", run)?;
        let mut above = run.ancestors().skip(2);
        let (Some(day), Some(records)) = (above.next(), above.next()) else { return Ok(None) };
        let links = match self.day.take().filter(|(known, _)| known == day) {
            Some((_, links)) => links,
            None => of_day(records, &day.strip_prefix(records).unwrap_or(day).to_string_lossy())?,
        };
        let name = name_in(records, run);
        let (_, links) = self.day.insert((day.to_owned(), links));
        Ok(links.find(&name))
    }
}
