//! What a module lies on, seen from both sides: the bench drives a [`TurntableDriver`] and a [`FixtureDriver`], and whatever is
//! driven implements them, the simulated bench among them.
//!
//! It knows no plan, no limit, no record and no board, so that neither side learns of the other more than stands here.

mod driver;
mod orientation;

pub use driver::{DriverError, FixtureDriver, Rig, TurntableDriver};
pub use orientation::{Along, MODULE_AXES, Orientation};
