//! The chain of closed runs. A run that is changed, removed or inserted later breaks it.
//!
//! Each day's folder has a file `CHAIN` with a line for each run that began or was closed there:
//!
//! ```text
//! NUMBER LINK-BEFORE DIGEST LINK begin|close STATION TIME DATE/SERIAL/TIME-PLAN [from RUN] [late TIME PROGRAM] [sig HEX]
//! ```
//!
//! `DIGEST` of a run that was closed is the SHA-256 of its `SHA256SUMS`, which covers all of its files; of a run that began,
//! the SHA-256 of the first line of its journal with its end. `LINK` is the SHA-256 of the line without `LINK` and
//! signature, so that a changed line changes all links behind it. The signature (Ed25519) is that of `gnc-station chain 2 LINK`:
//! it covers number, line before, run, station and time.
//!
//! The line of a beginning is on disk before anything is powered, so that a run that is taken away leaves a hole. A run whose module
//! is not the one that was scanned is moved; `from` tells where it began. A run whose
//! station ended before it was in the chain is closed late: its line goes on with ` late TIME PROGRAM`, which `LINK`
//! covers too, so that nobody can take the mark away later. Numbers go on
//! from day to day. `COUNTER` in the records folder holds the last number and link: it reveals a tail that was cut off.
//! A person who can write all of these files can forge all of them but the signatures: keep a copy of `COUNTER` in another place.
//!
//! Earlier versions wrote lines of closed runs alone: `NUMBER LINK-BEFORE DIGEST LINK RUN [late TIME PROGRAM]`.

mod apart;
mod append;
mod before;
mod begin;
mod beginning;
mod check;
mod contradictions;
mod copies;
mod empty;
mod entry;
mod links;
mod matching;
mod mend;
mod order;
mod places;
mod read;
mod signed;
mod single;
mod snapshot;
mod tail;
mod times;
mod whole;

pub(crate) use apart::{apart, last_line, last_number};
#[cfg(test)]
pub(crate) use append::append;
pub(crate) use append::append_as;
pub use append::try_out;
pub(super) use before::{Before, unknown};
pub(crate) use begin::begin;
pub use begin::place_of;
pub(crate) use begin::{digest_of_first_line, has_one_event, is_closed, is_named, was_moved};
pub(crate) use beginning::{Beginning, Beginnings, Begun, SignedBy};
pub use check::{Against, ChainBook, ChainCheck, Head, verify, verify_against};
pub(crate) use empty::remove_empty;
pub(crate) use entry::Scribe;
pub use entry::{LateClose, Place};
pub use links::{ChainStanding, LateCloses, standing};
pub(crate) use links::{DayLinks, OpenRun, RunLink, is_close_signed_by, of_day, was_closed_otherwise};
pub(in crate::store) use mend::mend;
pub(crate) use order::by_close;
pub(crate) use read::name_in;
pub use signed::NONE_IS_SIGNED;
pub(crate) use signed::Witnessed;
pub use single::is_signed_beside;
pub(crate) use whole::WholeEnd;

/// The file of the chain in a day's folder.
pub(crate) const CHAIN: &str = "CHAIN";

/// The file with the last number and link, in the records folder.
pub(crate) const COUNTER: &str = "COUNTER";

/// The link before the first run.
const NOTHING: &str = "0000000000000000000000000000000000000000000000000000000000000000";

#[cfg(test)]
mod attacks;
#[cfg(test)]
mod tests;
