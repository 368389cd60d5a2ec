//! Checks of a slave board against `docs/ICD.md`, for those who write its firmware.
//!
//! [`run`] speaks to a board over a link of its own and looks at each frame: when it came, how often, in which order,
//! with which bytes. What `gnc-board` repeats or passes over, a check sees. Each check has a short name that stays, the
//! section of the document, what the document demands, and what was measured.

mod can;
mod check;
mod codes;
mod driver;
mod examples;
mod frames;
mod header;
mod hello;
mod life;
mod messages;
mod payloads;
mod raw;
mod requests;
mod runner;
mod stop;
mod streams;
mod table;
mod together;

pub use runner::{CheckEvent, CheckOptions, CheckedBoard, Ended, Finding, NoBoard, Outcome, TAKES, run};
pub use table::{Demand, demands, section_title, selects};
