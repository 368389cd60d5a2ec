//! The traits for driving a turntable and a fixture.

use std::error::Error;
use std::fmt::Debug;
use std::time::Duration;

use crate::Orientation;

/// Why a device did not do what it was told, in the device's own words.
pub type DriverError = Box<dyn Error + Send + Sync>;

/// A driver of a turntable.
///
/// A call returns as soon as the motion has begun. The three calls named `wait...` block their thread until their wait
/// is over.
pub trait TurntableDriver: Debug + Send + Sync {
    /// Begins to lay the module down.
    ///
    /// # Errors
    /// The table moves, cannot take up this orientation, or does not answer.
    fn orient(&self, orientation: Orientation) -> Result<(), DriverError>;

    /// Begins to turn the module by an angle in a given time, ramps included. The turn is right-handed about the axis
    /// of the module that lies along the table's axis.
    ///
    /// # Errors
    /// The table moves, cannot turn so fast, or does not answer.
    fn rotate(&self, angle_deg: f64, span_s: f64) -> Result<(), DriverError>;

    /// Begins to spin without end, right-handed about the axis of the module that lies along the table's axis. If the
    /// table already spins, it changes to the new rate.
    ///
    /// # Errors
    /// The table cannot turn so fast, or does not answer.
    fn spin(&self, rate_dps: f64) -> Result<(), DriverError>;

    /// Begins to stop every motion. It is not an error if nothing moves.
    ///
    /// # Errors
    /// The table does not answer.
    fn stop(&self) -> Result<(), DriverError>;

    /// Waits until the table stands still.
    ///
    /// # Errors
    /// The table spins without end, or does not answer.
    fn wait_still(&self) -> Result<(), DriverError>;

    /// Waits until a spin that has begun reaches this rate.
    ///
    /// # Errors
    /// The table does not answer.
    fn wait_at_rate(&self, rate_dps: f64) -> Result<(), DriverError>;

    /// Waits for this long by the bench's clock.
    ///
    /// # Errors
    /// The bench has ended.
    fn wait(&self, span: Duration) -> Result<(), DriverError>;
}

/// A driver of a fixture. The fixture flips switches and turns the level module.
pub trait FixtureDriver: Debug + Send + Sync {
    /// The fixture's name in the record, as "the indexing fixture".
    fn name(&self) -> &str;

    /// Sets one DIP switch (1 to 5) on and the others off, or all off.
    ///
    /// # Errors
    /// The fixture does not answer.
    fn only_switch(&self, on: Option<u8>) -> Result<(), DriverError>;

    /// Turns the level module to a heading, degrees clockwise seen from above, from the mark on the table.
    ///
    /// # Errors
    /// The fixture does not answer.
    fn turn_to(&self, heading_deg: f64) -> Result<(), DriverError>;
}

/// A turntable with a fixture on it.
pub trait Rig: TurntableDriver + FixtureDriver {}

impl<T: TurntableDriver + FixtureDriver> Rig for T {}
