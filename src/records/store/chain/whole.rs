//! From which line on the chain is whole. What a missing line said is not known: it may be the failure of a module that passed before.

use std::path::Path;

use super::apart::last_line;
use super::entry::ChainEntry;
use super::snapshot::Snapshot;
use crate::store::StoreError;

/// What a line tells of the lines beside it: there may be hundreds of thousands.
struct Line {
    number: u64,
    before: String,
    link: String,
    is_true: bool,
}

impl From<ChainEntry> for Line {
    fn from(line: ChainEntry) -> Self {
        let is_true = line.is_true();
        let ChainEntry { number, before, link, .. } = line;
        Self { number, before, link, is_true }
    }
}

/// The end of the chain, as far back as it was looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct WholeEnd {
    /// Lines before this one were not looked at.
    looked_from: u64,
    /// From this line on each one is there, follows from the one before and is as it was written, up to the last one, and that is
    /// the one that `COUNTER` remembers.
    whole_from: u64,
}

impl WholeEnd {
    /// Looks at the lines from one number on, which stands in the chain of a day. The days from that one on hold them all, unless a clock
    /// was set back: the others are opened only if lines seem to be missing.
    ///
    /// # Errors
    /// The records folder cannot be read.
    pub(crate) fn read(records: &Path, day: &str, number: u64) -> Result<Self, StoreError> {
        let snapshot = Snapshot::take(records)?;
        let near = Self::look(&snapshot, number, |other| other >= day);
        if near.is_whole_from(number) == Some(true) {
            return Ok(near);
        }
        Ok(Self::look(&snapshot, number, |other| last_line(records, other).is_some_and(|last| last >= number)))
    }

    fn look(snapshot: &Snapshot<'_>, number: u64, is_wanted: impl Fn(&str) -> bool) -> Self {
        let mut lines = Vec::new();
        for day in snapshot.days().filter(|day| is_wanted(day)) {
            // What cannot be read is missing.
            let of_day = snapshot.chain_of(day).ok().flatten().map(|chain| chain.lines).into_iter().flatten();
            lines.extend(of_day.filter(|line| line.number >= number).map(Line::from));
        }
        lines.sort_by_key(|line| line.number);
        // A counter that is gone or cannot be read is made again from the chain by the next start.
        let counted = snapshot.counted.as_ref().ok().and_then(Option::as_ref);
        let ends = lines.last().map_or(0, |line| line.number);
        if let Some(counted) = counted.filter(|counted| counted.number > ends) {
            let whole_from = counted.number.saturating_add(1);
            return Self { looked_from: number, whole_from };
        }
        let mut whole_from = ends.saturating_add(1);
        let is_counted =
            |line: &Line| counted.is_none_or(|counted| counted.number != line.number || counted.link == line.link);
        let mut next: Option<&Line> = None;
        for line in lines.iter().rev() {
            let is_followed =
                next.is_none_or(|next| next.number.checked_sub(1) == Some(line.number) && next.before == line.link);
            if !is_followed || !line.is_true || !is_counted(line) {
                break;
            }
            whole_from = line.number;
            next = Some(line);
        }
        Self { looked_from: number, whole_from }
    }

    /// Whether the chain is whole from a line on; `None`: it was not looked at so far back.
    pub(crate) fn is_whole_from(self, number: u64) -> Option<bool> {
        (self.looked_from <= number).then_some(self.whole_from <= number)
    }
}
