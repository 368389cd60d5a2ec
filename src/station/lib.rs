//! The station: it talks to a slave board, runs plans and files what it found.

mod auto;
pub mod board;
pub mod capture;
mod check;
pub mod cli;
pub mod compute;
pub mod control;
mod doctor;
mod export;
pub mod figures;
mod files;
pub mod fixture;
pub mod guidance;
pub mod host_clock;
mod latest;
pub mod link;
pub mod motion;
pub mod nmea;
pub mod passport;
mod ports;
pub mod procedure;
pub mod raw;
mod recompute;
mod records;
pub mod report;
pub mod resume;
pub mod runner;
mod serial_number;
mod setup;
mod statistics;

pub mod store;
pub mod tui;
pub mod turntable;
