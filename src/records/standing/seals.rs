//! How records are kept: what the chain says of a run, what its files say, and whether a key that is trusted signed it.

use std::collections::HashMap;
use std::path::Path;

use gnc_executive::standing::{Flaw, Seal};

use crate::store::chain::{DayLinks, OpenRun, RunLink, WholeEnd, Witnessed};
use crate::store::digest::{self, FileDigests, MAX_DIGESTS_BYTES};
use crate::store::reader::{MAX_JOURNAL_BYTES, MAX_RECORD_BYTES};
use crate::store::unread::says_nothing;
use crate::store::{self, DIGESTS, JOURNAL, PublicKey, RECORD, StoreError, as_written, chain, pending, reader};

/// How records are kept, by the chains of their days. Each chain is read once.
#[derive(Debug)]
pub struct Seals<'a> {
    records: &'a Path,
    keys: &'a [PublicKey],
    days: HashMap<String, DayLinks>,
    /// The lines from before the first signed one that this one covers. Looked for once, and only for a run without signatures.
    witnessed: Option<Witnessed>,
    /// The end of the chain, as far back as a run asked for it.
    end: Option<WholeEnd>,
}

impl<'a> Seals<'a> {
    /// Nothing is read yet.
    pub fn new(records: &'a Path) -> Self {
        Self { records, keys: &[], days: HashMap::new(), witnessed: None, end: None }
    }

    /// The same with the keys of the stations whose runs count.
    pub(super) fn with_keys(self, keys: &'a [PublicKey]) -> Self {
        Self { keys, ..self }
    }

    /// How the record of a run is kept: its digests against the chain, and `run.json` against the digests.
    ///
    /// # Errors
    /// The chain of its day cannot be read.
    pub fn seal(&mut self, run: &Path) -> Result<Seal, StoreError> {
        if !reader::is_sealed(run) {
            let flaw = if store::goes_on(run) { Flaw::UnderWay } else { Flaw::NotClosed };
            return Ok(Seal::Flawed(flaw));
        }
        let (day, name) = self.named(run);
        if self.day(&day)?.find(&name).is_none() {
            // The run may have been closed since the chain was read. Look whether its station still closes it, and only
            // then read the chain again.
            let goes_on = store::goes_on(run);
            self.days.remove(&day);
            if self.day(&day)?.find(&name).is_none() {
                return Ok(Seal::Flawed(if goes_on { Flaw::UnderWay } else { Flaw::NotInChain }));
            }
        }
        let Some(link) = self.day(&day)?.find(&name) else { return Ok(Seal::Flawed(Flaw::NotInChain)) };
        if is_unreadable(run) {
            return Ok(Seal::Flawed(Flaw::Unreadable));
        }
        let sums = digest::of_file_within(&run.join(DIGESTS), MAX_DIGESTS_BYTES);
        let as_closed = link.is_sound && sums.is_ok_and(|sums| sums == link.digest) && {
            let promised = FileDigests::read(run).map(|(sums, _)| sums).unwrap_or_default();
            let is_as_promised = |(file, limit): (&str, u64)| {
                // Its station may give it its name between the two steps.
                let look = || digest::of_file_within(&pending::path(run, file), limit);
                let found = || look().or_else(|_| look()).ok();
                match promised.get(file) {
                    Some(promised) => found().as_deref() == Some(promised),
                    None => file != RECORD && run.join(file).symlink_metadata().is_err(),
                }
            };
            // A list shows what the journal says, and the standing what the record does.
            [(RECORD, MAX_RECORD_BYTES), (JOURNAL, MAX_JOURNAL_BYTES)].into_iter().all(is_as_promised)
        };
        Ok(match (as_closed, &link.late) {
            (false, _) => Seal::Flawed(Flaw::Changed),
            (true, Some(_)) => Seal::Flawed(Flaw::ClosedLate),
            (true, None) => Seal::Chained,
        })
    }

    /// What the signatures of a closed run lack: one of the keys must have signed its digests and its lines. A line from before the
    /// first signed one had no key yet; it is as good if the first signed line is by one of the keys, and no link between the two
    /// is broken. Without keys nothing is looked at. The digests themselves are compared by [`Seals::seal`].
    ///
    /// # Errors
    /// The chain cannot be read.
    pub fn unsigned(&mut self, run: &Path) -> Result<Option<Flaw>, StoreError> {
        let keys = self.keys;
        if keys.is_empty() {
            return Ok(None);
        }
        let (day, name) = self.named(run);
        let Some(link) = self.day(&day)?.find(&name) else { return Ok(None) };
        let lines: Vec<_> = link.lines().map(|line| (line.number, line.is_signed_by(keys))).collect();
        if lines.iter().any(|(_, signed)| *signed == Some(false)) {
            return Ok(Some(Flaw::Unsigned));
        }
        let is_closed_signed = lines.last().is_some_and(|(_, signed)| signed.is_some());
        if is_closed_signed && as_written::verify_signature(run, keys).is_some() {
            return Ok(Some(Flaw::Unsigned));
        }
        let unsigned: Vec<u64> =
            lines.iter().filter(|(_, signed)| signed.is_none()).map(|(number, _)| *number).collect();
        if unsigned.is_empty() {
            return Ok(None);
        }
        let witnessed = match self.witnessed {
            Some(known) => known,
            None => *self.witnessed.insert(Witnessed::read(self.records, keys)?),
        };
        Ok(match witnessed {
            Witnessed::NoneIsSigned => Some(Flaw::Unwitnessed),
            lines if unsigned.iter().all(|number| lines.covers(*number)) => None,
            _ => Some(Flaw::Unsigned),
        })
    }

    /// Whether lines of the chain behind the beginning of a closed run are known to be missing or damaged. What they said is not
    /// known, so it may be a failure of the same module: no pass before them counts. Once it was tested again, nothing is missing
    /// behind the new run.
    ///
    /// # Errors
    /// The records folder cannot be read.
    pub fn lacks_lines_behind(&mut self, run: &Path) -> Result<bool, StoreError> {
        let (day, name) = self.named(run);
        let Some(first) = self.day(&day)?.find(&name).map(RunLink::first_number) else { return Ok(false) };
        let known = self.end.and_then(|end| end.is_whole_from(first));
        let is_whole = match known {
            Some(known) => known,
            None => {
                let end = self.end.insert(WholeEnd::read(self.records, &day, first)?);
                end.is_whole_from(first).unwrap_or(false)
            }
        };
        Ok(!is_whole)
    }

    /// Whether the record of a run is known to be another one than was closed, or began: the chain names it, and its digests are
    /// others or gone, or its journal begins otherwise. One that cannot be compared may be another one, so it counts as such.
    pub(super) fn is_broken(&mut self, run: &Path, seal: Seal) -> Result<bool, StoreError> {
        Ok(match seal {
            Seal::Flawed(Flaw::Changed | Flaw::Unreadable) => true,
            Seal::Flawed(Flaw::NotClosed) => self.number(run)?.is_some() || self.began_otherwise(run)?,
            Seal::Flawed(_) | Seal::Chained => false,
        })
    }

    /// Whether the journal of a run is proved to be the one that was closed.
    pub(super) fn has_journal_as_closed(&mut self, run: &Path) -> bool {
        let (day, name) = self.named(run);
        let link = self.day(&day).ok().and_then(|day| day.find(&name)).filter(|link| link.is_sound);
        let sums = || digest::of_file_within(&run.join(DIGESTS), MAX_DIGESTS_BYTES);
        let has_sums = link.is_some_and(|link| sums().is_ok_and(|sums| sums == link.digest));
        let promised = FileDigests::read(run).ok().and_then(|(sums, _)| sums.get(JOURNAL).map(str::to_owned));
        has_sums && promised.is_some() && digest::of_file_within(&run.join(JOURNAL), MAX_JOURNAL_BYTES).ok() == promised
    }

    /// The place of a run in the order in which runs were closed; `None` if the chain does not name it.
    pub(super) fn number(&mut self, run: &Path) -> Result<Option<u64>, StoreError> {
        let (day, name) = self.named(run);
        Ok(self.day(&day)?.find(&name).map(|link| link.number))
    }

    /// The line of a run that began and was not closed.
    pub(super) fn open(&mut self, run: &Path) -> Result<Option<OpenRun>, StoreError> {
        let (day, name) = self.named(run);
        Ok(self.day(&day)?.find_open(&name).cloned())
    }

    /// Whether a run that is not closed has another journal than when it began.
    fn began_otherwise(&mut self, run: &Path) -> Result<bool, StoreError> {
        let open = self.open(run)?;
        Ok(open.is_some_and(|open| chain::digest_of_first_line(run).map_or(true, |digest| digest != open.digest)))
    }

    /// The day of a run, and its name in the chain.
    fn named(&self, run: &Path) -> (String, String) {
        let name = chain::name_in(self.records, run);
        (name.split('/').next().unwrap_or_default().to_owned(), name)
    }

    pub(super) fn day(&mut self, day: &str) -> Result<&DayLinks, StoreError> {
        if !self.days.contains_key(day) {
            let links = chain::of_day(self.records, day)?;
            self.days.insert(day.to_owned(), links);
        }
        Ok(self.days.entry(day.to_owned()).or_default())
    }
}

/// Whether a file that tells how a run is kept cannot be read, so that nothing is known of it.
fn is_unreadable(run: &Path) -> bool {
    let opened = |file: &str| gnc_files::own(&pending::path(run, file));
    [DIGESTS, RECORD, JOURNAL].into_iter().any(|file| opened(file).is_err_and(|error| says_nothing(&error)))
}
