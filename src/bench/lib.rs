//! The bench: whoever or whatever turns the module, the procedures that measure, and the runner that follows a plan.

pub mod control;
pub mod fixture;
pub mod guidance;
pub mod journal;
mod procedure;
mod recorder;
pub mod runner;
mod turntable;
