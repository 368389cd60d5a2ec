//! The station's faces: the command line, `--auto`, the operator's screen, `doctor`, `compute` and `export`.
//!
//! Only this crate knows arguments and terminals, and only it links the simulated bench, by its feature `sim`.
//! `gnc-bench` runs tests and `gnc-records` files them; no crate is built on this one.

mod args;
mod auto;
mod board;
mod check;
pub mod cli;
mod compute;
mod doctor;
mod ending;
mod exit_code;
mod export;
mod files;
mod help_files;
mod hook;
mod locale;
mod lost;
mod outputs;
mod phrases;
mod ports;
mod progress;
mod recompute;
mod records;
mod refusal;
mod serial_number;
mod setup;
mod threads;
mod tui;
mod umask;
mod version;
mod wording;

pub use phrases::page as messages_page;
pub use tui::{Lang, Scene};

/// The reader of tables, for `fuzz/`.
#[cfg(fuzzing)]
pub use compute::fuzzing;
