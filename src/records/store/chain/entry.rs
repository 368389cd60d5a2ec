//! A line of the chain.

use std::fmt;

use chrono::{DateTime, FixedOffset, SecondsFormat};
use sha2::{Digest as _, Sha256};

use crate::store::digest;

/// The mark of a line whose run was closed late.
const LATE: &str = "late";

/// When and by what a run was put into the chain whose station had ended before it did so.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LateClose {
    /// The time, as RFC 3339 writes it.
    pub at: String,
    /// The program with its version.
    pub by: String,
}

impl LateClose {
    /// A mark of now by a program. A line of the chain has spaces between its words, so these have none.
    pub(crate) fn new(at: DateTime<FixedOffset>, program: &str) -> Self {
        let is_word = |mark: char| !mark.is_whitespace() && !mark.is_control();
        let by = program.chars().map(|mark| if is_word(mark) { mark } else { '_' }).collect();
        Self { at: at.to_rfc3339_opts(SecondsFormat::Secs, false), by }
    }

    /// What happened, for people.
    #[must_use]
    pub fn in_words(&self) -> String {
        format!("{self}, after its station had ended before the run was in the chain; it never counts as a pass")
    }
}

impl fmt::Display for LateClose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = DateTime::parse_from_rfc3339(&self.at);
        let at = at.map_or_else(|_| self.at.clone(), |at| at.format("%F %T").to_string());
        write!(f, "closed late at {at} by {}", self.by)
    }
}

/// A closed run in the chain.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ChainEntry {
    pub(super) number: u64,
    pub(super) before: String,
    pub(super) digest: String,
    pub(super) link: String,
    /// `DATE/SERIAL/TIME-PLAN`.
    pub(super) run: String,
    pub(super) late: Option<LateClose>,
}

impl ChainEntry {
    pub(super) fn new(number: u64, before: &str, digest: &str, run: &str, late: Option<LateClose>) -> Self {
        let mut entry = Self {
            number,
            before: before.to_owned(),
            digest: digest.to_owned(),
            link: String::new(),
            run: run.to_owned(),
            late,
        };
        entry.link = entry.true_link();
        entry
    }

    /// The end of the line, from the name of the run on.
    fn tail(&self) -> String {
        match &self.late {
            None => self.run.clone(),
            Some(LateClose { at, by }) => format!("{} {LATE} {at} {by}", self.run),
        }
    }

    fn true_link(&self) -> String {
        let Self { number, before, digest, .. } = self;
        digest::hexadecimal(&Sha256::digest(format!("{number} {before} {digest} {}", self.tail())))
    }

    pub(super) fn line(&self) -> String {
        format!("{} {} {} {} {}\n", self.number, self.before, self.digest, self.link, self.tail())
    }

    /// `None` if the text is not a line of a chain.
    pub(super) fn parse(line: &str) -> Option<Self> {
        let mut words = line.split(' ');
        let mut word = || words.next().map(str::to_owned);
        let (number, before, digest, link, run) = (word()?, word()?, word()?, word()?, word()?);
        let late = match (word(), word(), word(), word()) {
            (None, ..) => None,
            (Some(late), Some(at), Some(by), None) if late == LATE => Some(LateClose { at, by }),
            _ => return None,
        };
        Some(Self { number: number.parse().ok()?, before, digest, link, run, late })
    }

    pub(super) fn is_true(&self) -> bool {
        self.true_link() == self.link
    }
}
