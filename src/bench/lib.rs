//! Runs plans on a bench: turntables and fixtures, a procedure for each item, and the runner that follows a plan.
//!
//! Procedures measure and never judge. Only the runner acts, and it passes an event on only after the record has it.
//! The crate does not know the command line and the screen: they call the [`service`] and watch.

pub mod clock;
pub mod control;
pub mod fixture;
pub mod guidance;
pub mod journal;
mod procedure;
pub mod questions;
mod recorder;
pub mod runner;
pub mod service;
mod turntable;
