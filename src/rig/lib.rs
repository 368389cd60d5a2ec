//! What a module lies on, seen from both sides: the bench drives a [`Turntable`] and a [`Fixture`], and whatever is
//! driven implements them, the simulated bench among them.
//!
//! It knows no plan, no limit, no record and no board, so that neither side learns of the other more than stands here.

mod driver;
mod orientation;

pub use driver::{DriverError, Fixture, Rig, Turntable};
pub use orientation::{Along, MODULE_AXES, Orientation};
