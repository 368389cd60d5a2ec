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
mod append;
mod before;
mod check;
mod entry;
mod links;
mod mend;
mod order;
mod read;

pub(crate) use apart::{apart, last_number};
pub(crate) use append::{append, append_as};
pub(super) use before::{Before, unknown};
pub use check::{ChainCheck, verify};
pub use entry::LateClose;
pub use links::{ChainStanding, LateCloses, standing};
pub(crate) use links::{DayLinks, of_day};
pub(in crate::store) use mend::mend;
pub(crate) use order::by_close;

/// The file of the chain in a day's folder.
pub(crate) const CHAIN: &str = "CHAIN";

/// The file with the last number and link, in the records folder.
pub(crate) const COUNTER: &str = "COUNTER";

/// The link before the first run.
const NOTHING: &str = "0000000000000000000000000000000000000000000000000000000000000000";

#[cfg(test)]
mod tests;
