//! The station's faces: the command line, `--auto`, the operator's screen, and what they run.

mod args;
mod auto;
mod check;
pub mod cli;
pub mod compute;
mod doctor;
mod export;
mod files;
mod ports;
mod recompute;
mod records;
mod refusal;
mod serial_number;
mod setup;
pub mod tui;
