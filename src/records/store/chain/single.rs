//! What the chain says of one run or of one module.

use std::collections::{HashMap, HashSet};
use std::io;
use std::path::Path;

use super::before::day_and_time;
use super::check::{Against, ChainBook, ChainCheck, Head};
use super::entry::ChainEntry;
use super::read::name_in;
use super::{NOTHING, contradictions, matching, places, signed};
use crate::store::located::located;
use crate::store::{StoreError, on, reader};

impl ChainBook {
    /// What is wrong with the lines of one closed run: their links, their neighbours, their signatures, and what they say of the
    /// folder; and whether the chain leads from its lines to what was kept elsewhere. Of a folder without a chain nothing is said.
    #[must_use]
    pub fn of_run(&self, run: &Path, against: &Against<'_>) -> ChainCheck {
        let mut checked = ChainCheck::default();
        if self.is_empty() {
            return checked;
        }
        checked.unread.extend(self.unreadable.iter().cloned());
        let problems = &mut checked.problems;
        problems.extend(self.broken.iter().cloned());
        let name = name_in(&self.records, run);
        let Some(close) = self.close_of(&name) else {
            // Its line may stand in a chain that cannot be read, which is said.
            if self.unread.contains(day_and_time(&name).0) {
                return checked;
            }
            problems.push(format!(
                "{name} is not in the chain: its station ended, or could not write, before that and closes it late at its next start, or it was slipped in"
            ));
            return checked;
        };
        let began = close.began_as().to_owned();
        let own: Vec<&ChainEntry> =
            self.lines.iter().filter(|line| line.run == name || !line.is_close() && line.run == began).collect();
        matching::check_lines(self, &own, &mut checked);
        let problems = &mut checked.problems;
        let by_number: HashMap<u64, &ChainEntry> = self.lines.iter().map(|line| (line.number, line)).collect();
        let first = self.lines.first().map_or(0, |line| line.number);
        for line in &own {
            let before = line.number.checked_sub(1).and_then(|number| by_number.get(&number));
            let is_linked = match before {
                Some(before) => before.link == line.before,
                None => line.number == first && (line.number > 1 || line.before == NOTHING),
            };
            let after = line.number.checked_add(1).and_then(|number| by_number.get(&number));
            let follows = match (after, &self.counted) {
                (Some(after), _) => after.before == line.link,
                (None, Some(counted)) if counted.number == line.number => counted.link == line.link,
                (None, counted) => counted.as_ref().is_none_or(|counted| counted.number < line.number),
            };
            if !is_linked || !follows {
                problems
                    .push(format!("line {} of the chain ({}): the chain is broken beside it", line.number, line.run));
            }
        }
        if let Some(line) = own.first() {
            problems.extend(against.heads.iter().filter_map(|head| self.gap(line, head, &by_number)));
        }
        contradictions::check(self, &own, problems);
        if !against.keys.is_empty() {
            signed::check_lines(self, &own, against.keys, problems);
        }
        checked
    }

    /// What the chain says of one module, or of one run by its name, beside the folders that are there: runs that it names and whose folders
    /// are gone, and lines that are missing, which may be those of any module. `None`: nothing names it.
    #[must_use]
    pub fn of_named(&self, named: &str) -> Option<ChainCheck> {
        let folders = reader::folders_of(named);
        let is_of_module =
            |run: &str| run.split('/').nth(1).is_some_and(|folder| folders.iter().any(|of| of == folder));
        let is_named = |run: &str| run == named || is_of_module(run);
        let is_gone = |run: &str| {
            let found = self.records.join(run).symlink_metadata();
            found.is_err_and(|error| error.kind() == io::ErrorKind::NotFound)
        };
        let named: Vec<&ChainEntry> =
            self.lines.iter().filter(|line| is_named(&line.run) || is_named(line.began_as())).collect();
        let places::Strays { problems: strays, litter, notes, mut unread } = places::strays_of(&self.records, &folders);
        if named.is_empty() && strays.is_empty() && litter.is_empty() && unread.is_empty() {
            return None;
        }
        let problems = [strays, self.broken.clone()].concat();
        unread.extend(self.unreadable.iter().cloned());
        let mut checked = ChainCheck { problems, unread, litter, notes, ..ChainCheck::default() };
        let gone: HashSet<&str> = named.iter().map(|line| line.run.as_str()).filter(|run| is_gone(run)).collect();
        let of_gone = |line: &ChainEntry| gone.contains(line.run.as_str()) || gone.contains(line.began_as());
        let lines: Vec<&ChainEntry> = self.lines.iter().filter(|line| of_gone(line)).collect();
        matching::check_lines(self, &lines, &mut checked);
        self.order(&mut checked.problems);
        self.counter(&mut checked);
        Some(checked)
    }

    /// Where the lines from one to what was kept elsewhere do not follow from one another, so that it witnesses nothing of that one.
    /// A line that is missing, or another than was kept, is said by [`Self::unlike`].
    fn gap(&self, from: &ChainEntry, head: &Head, by_number: &HashMap<u64, &ChainEntry>) -> Option<String> {
        let Head { kept, place } = head;
        by_number.get(&place.number)?;
        let between = self.lines.iter().filter(|line| (from.number..=place.number).contains(&line.number));
        let mut before: Option<&ChainEntry> = None;
        for line in between {
            let follows = before
                .is_none_or(|before| Some(line.number) == before.number.checked_add(1) && line.before == before.link);
            if !line.is_true() || !follows {
                return Some(format!(
                    "{kept} does not witness line {} of the chain ({}): the chain is broken at line {} between the two",
                    from.number, from.run, line.number
                ));
            }
            before = Some(line);
        }
        None
    }

    /// Why a closed run has no signature, if that is no change.
    #[must_use]
    pub fn why_unsigned(&self, run: &Path) -> Option<&'static str> {
        signed::why_unsigned(self, &name_in(&self.records, run))
    }
}

/// Whether a line of the chain in which a run stands is signed.
///
/// # Errors
/// The records folder cannot be read.
pub fn is_signed_beside(run: &Path) -> Result<bool, StoreError> {
    let run = on(located(run), "find", run)?;
    let Some(records) = run.ancestors().nth(3) else { return Ok(false) };
    Ok(ChainBook::read(records)?.lines.iter().any(|line| line.signature.is_some()))
}
