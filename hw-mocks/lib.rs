//! The simulated bench: a world with a truth, and in it a slave board and a GNC module.
//!
//! [`RunningBench`] serves a [`SimulatedBench`] on a pseudo-terminal or a serial port. [`BenchControl`] does what an
//! operator or a fixture does at it. A [`Personality`] says what is in the socket and what is wrong with it. Faults
//! change the world, a device or the wire, never an answer: the bench knows no plans, no limits and no verdicts, and
//! must not know the right answer.

/// The bench file of the simulated bench, with the content that a surveyor and the builder of the bench would give it.
pub const BENCH_FILE: &str = include_str!("bench.toml");

mod adapter;
mod bench;
mod board;
mod boards;
mod breaches;
mod can;
mod can_faults;
pub mod devices;
mod driver;
mod fault_queue;
mod line;
mod link_clock;
mod module;
mod motion;
pub mod noise;
mod operator;
mod oscillator;
mod personality;
mod port;
pub mod program;
mod records;
mod requests;
mod rig;
mod sampling;
mod streams;
mod turntable;
mod wire_faults;
pub mod world;

pub use bench::{BenchOptions, LineTruth, SimulatedBench, Speed, Truth};
pub use can::Adapter;
pub use driver::{BenchControl, BenchGone, Cable, RunningBench, TurntableError};
pub use fault_queue::Toll;
pub use gnc_files::Reach;
pub use personality::{Expectation, LARGEST_FILE, Load, Personality, beside, boards};
pub use turntable::{TableModel, TableRefusal, TableTruth};
pub use world::{ModuleAxis, Sign};
