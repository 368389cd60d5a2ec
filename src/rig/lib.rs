//! What a module lies on, seen from both sides. The bench drives a [`TurntableDriver`] and a [`FixtureDriver`]. The
//! driven devices implement them; the simulated bench is one of these.
//!
//! The crate knows no plan, no limit, no record and no board. So each side learns only what stands here of the other
//! side.

mod driver;
mod orientation;

pub use driver::{DriverError, FixtureDriver, Rig, TurntableDriver};
pub use orientation::{Along, MODULE_AXES, Orientation};
