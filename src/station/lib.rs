//! The station: it talks to a slave board, runs plans and files what it found.

pub mod board;
pub mod fixture;
pub mod link;
mod nmea;
pub mod procedure;
pub mod runner;
mod statistics;
pub mod stop;
pub mod store;
