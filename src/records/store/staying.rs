//! What a start says of the runs that it leaves as they are: a line about each of the first ones, one about all of another station,
//! and how many more there are.

use std::collections::BTreeMap;
use std::path::Path;

use super::reader::ReadError;
use super::{StoreError, chain};

/// Most lines about runs that stay: a person reads them with a module in the socket.
const MOST_LINES: usize = 5;

/// What to say of a run that another program looks at.
pub(super) const IS_READ: &str = "is left to the next start because another program reads it at this moment";

/// Why a run stays as it is.
#[derive(Debug)]
pub(super) enum Stays {
    /// A station of this name carried it out.
    OfStation(String),
    /// What to say of it. Whether it ended is known.
    Because(String),
    /// What to say of one of which it is not known whether it ended.
    Unread(String),
}

impl Stays {
    /// Another program looks at it.
    pub(super) fn is_read() -> Self {
        Self::Unread(IS_READ.to_owned())
    }

    /// Its files and its digests differ.
    pub(super) fn is_changed(changes: &[String]) -> Option<Self> {
        let first = changes.first()?;
        Some(Self::Because(format!(
            "is left as it is because it is not as it was sealed: {first}; restore it from a backup; until then it is no pass"
        )))
    }

    /// Its journal cannot be read.
    pub(super) fn is_unreadable(run: &Path, error: &ReadError) -> Self {
        let began = chain::is_named(run).unwrap_or(false);
        Self::Unread(match error {
            ReadError::Empty | ReadError::NeverBegun if began => lost_its_journal().to_owned(),
            _ => format!(
                "is left as it is because its journal cannot be read: {}; {}",
                gnc_text::with_causes(error),
                error.try_this()
            ),
        })
    }
}

/// What to say of a run that began by the chain and has no event.
pub(super) fn lost_its_journal() -> &'static str {
    "is left as it is because its journal holds no event now while the chain says that it began; restore it from a backup and start again; without one test its module again"
}

/// The runs that a start leaves.
#[derive(Debug, Default)]
pub(super) struct StayingRuns {
    lines: Vec<String>,
    /// Names of runs, by their station.
    of_others: BTreeMap<String, Vec<String>>,
}

impl StayingRuns {
    /// One more. `line` makes a line of why it stays.
    pub(super) fn add(&mut self, run: String, stays: Stays, line: impl FnOnce(&str, &str) -> String) {
        match stays {
            Stays::OfStation(station) => self.of_others.entry(station).or_default().push(run),
            Stays::Because(why) => self.lines.push(line(&run, &why)),
            Stays::Unread(why) => self.lines.push(not_closed(&run, &why)),
        }
    }

    /// One more, with its line.
    pub(super) fn add_line(&mut self, line: String) {
        self.lines.push(line);
    }

    /// What to say at a start of the station `own`.
    pub(super) fn into_lines(self, own: &str) -> Vec<String> {
        let own = gnc_text::printable(own);
        let of_others = self.of_others.iter().map(|(station, runs)| {
            let (station, first) = (gnc_text::printable(station), runs.first().map_or("", String::as_str));
            let line = match runs.len() {
                1 => format!(
                    "{first} was begun as station {station} and is not closed while this bench file names {own}; if this bench was renamed start it once with its old id so that the run is closed; until then it counts as interrupted"
                ),
                count => format!(
                    "{count} runs were begun as station {station} and are not closed while this bench file names {own} (the first is {first}); if this bench was renamed start it once with its old id so that they are closed; until then they count as interrupted"
                ),
            };
            (line, runs.len())
        });
        let all: Vec<(String, usize)> = of_others.chain(self.lines.into_iter().map(|line| (line, 1))).collect();
        let more: usize = all.iter().skip(MOST_LINES).map(|(_, runs)| runs).sum();
        let mut lines: Vec<String> = all.into_iter().take(MOST_LINES).map(|(line, _)| line).collect();
        if more > 0 {
            lines.push(format!(
                "{more} runs more are left as they are; `gnc-station records verify` names each of them"
            ));
        }
        lines
    }
}

/// A line about a run that is not closed.
pub(super) fn not_closed(run: &str, what: &str) -> String {
    format!("{run} is not closed and {what}")
}

/// What to say of a run that cannot be sealed or closed.
pub(super) fn cannot(error: &StoreError) -> String {
    format!("cannot be sealed: {}; {}", gnc_text::with_causes(error), error.try_this())
}

#[cfg(test)]
mod tests;
