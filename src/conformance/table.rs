//! All checks, in the order of the document.

use crate::check::Check;
use crate::{can, codes, frames, header, hello, life, messages, payloads, requests, streams, together};

/// What the document demands, without a board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Demand {
    /// A short name that stays.
    pub id: &'static str,
    /// Section of the document.
    pub section: u8,
    /// The demand in one sentence.
    pub demand: &'static str,
}

/// The checks of all sections.
const SECTIONS: &[&[Check]] = &[
    frames::CHECKS,
    header::CHECKS,
    payloads::CHECKS,
    hello::CHECKS,
    requests::CHECKS,
    together::CHECKS,
    life::CHECKS,
    streams::CHECKS,
    messages::CHECKS,
    codes::CHECKS,
    messages::patterns::CHECKS,
    can::CHECKS,
];

/// All checks, in the order of the document.
pub(crate) fn checks() -> impl Iterator<Item = &'static Check> {
    SECTIONS.iter().flat_map(|section| section.iter())
}

/// All demands that are checked, in the order of the document.
pub fn demands() -> impl Iterator<Item = Demand> {
    checks().map(|check| Demand { id: check.id, section: check.section, demand: check.demand })
}

/// Whether a selection names this check: a section's number, or the beginning of its name.
#[must_use]
pub fn selects(only: &str, demand: &Demand) -> bool {
    match only.parse::<u8>() {
        Ok(section) => demand.section == section,
        Err(_) => demand.id.starts_with(only),
    }
}

/// The title of a section, as the document writes it.
#[must_use]
pub fn section_title(section: u8) -> &'static str {
    match section {
        3 => "Frames",
        4 => "The header",
        5 => "How payloads are laid out",
        6 => "Sessions",
        7 => "The life of a request",
        8 => "What may run together",
        9 => "Signs of life, watchdog, safe state",
        10 => "Streams",
        11 => "Messages",
        12 => "Codes",
        13 => "Memory patterns",
        17 => "CAN",
        _ => "",
    }
}
