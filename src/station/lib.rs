//! The station: it talks to a slave board, runs plans and files what it found.

pub mod board;
pub mod link;
