//! Turntables: what lays the module down, turns it by an angle and spins it. The operator with a table of his own, or
//! the simulated one.
//!
//! Every motion returns when it is done, and the module is still again unless it spins. Time goes by the bench's clock.

#[cfg(feature = "sim")]
mod simulated;

use std::cell::Cell;
use std::fmt;
use std::time::Duration;

use futures_util::future::LocalBoxFuture;

use crate::capture::Along;
use crate::fixture::{Ask, Fixture};
use crate::procedure::Trouble;
use crate::runner::report::Report;
#[cfg(feature = "sim")]
use simulated::Simulated;

/// Names of the module's axes.
pub const AXES: [&str; 3] = ["X", "Y", "Z"];

/// How the module is laid down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lie {
    /// One of its axes up or down.
    Axis {
        /// 0 for X, 1 for Y, 2 for Z.
        axis: u8,
        /// Whether its positive end points there, or its negative one.
        positive: bool,
        /// Where it points. The table's axis points there too.
        along: Along,
        /// Heading of the next axis (Y for X, Z for Y, X for Z), degrees clockwise from north; for an axis that does not
        /// point up, from the upper side, seen against it.
        heading_deg: f64,
    },
    /// Any attitude: this direction of the module points up.
    Up {
        /// Unit vector in module axes.
        up: [f64; 3],
        /// Heading of the axis after the one nearest to up.
        heading_deg: f64,
    },
}

/// A turntable.
pub trait Turntable {
    /// Lays the module down.
    fn lay(&self, lie: Lie) -> Motion<'_>;
    /// Turns it about the table's axis by an angle in a time, right-handed about the module's axis that was laid along it.
    fn rotate(&self, angle_deg: f64, span_s: f64) -> Motion<'_>;
    /// Begins to spin about the table's axis and returns when the rate is reached.
    fn spin(&self, rate_dps: f64) -> Motion<'_>;
    /// Brings whatever moves to rest.
    fn stop(&self) -> Motion<'_>;
    /// Lets time pass at the bench.
    fn pause(&self, span: Duration) -> Motion<'_>;
}

/// A motion under way. Dropping it does not end it: that takes a stop.
pub type Motion<'a> = LocalBoxFuture<'a, Result<(), Trouble>>;

/// The turntable of a bench; what it does for people to see is filed in the report.
#[must_use]
pub fn of<'a>(fixture: &'a Fixture, report: &'a Report<'a>) -> Box<dyn Turntable + 'a> {
    match fixture {
        #[cfg(feature = "sim")]
        Fixture::Simulated(control) => Box::new(Simulated::new(control.clone())),
        _ => Box::new(ByHand { fixture, report, lie: Cell::new(None) }),
    }
}

/// Stops the table of a bench at once, whoever used it. An operator at a table of his own has its emergency stop.
pub fn stop_at_once(fixture: &Fixture) {
    match fixture {
        #[cfg(feature = "sim")]
        Fixture::Simulated(control) => simulated::stop_at_once(control),
        _ => {}
    }
}

/// A person with a table of his own.
struct ByHand<'a> {
    fixture: &'a Fixture,
    report: &'a Report<'a>,
    /// How the module was laid down last: a picture of a turn shows it.
    lie: Cell<Option<Lie>>,
}

impl ByHand<'_> {
    fn ask(&self, ask: Ask) -> Motion<'_> {
        Box::pin(async move { self.fixture.request(&ask, self.report).await })
    }
}

impl Turntable for ByHand<'_> {
    fn lay(&self, lie: Lie) -> Motion<'_> {
        self.lie.set(Some(lie));
        self.ask(Ask::Lay(lie))
    }

    fn rotate(&self, angle_deg: f64, span_s: f64) -> Motion<'_> {
        self.ask(Ask::Turn { lie: self.lie.get(), angle_deg, span_s })
    }

    fn spin(&self, rate_dps: f64) -> Motion<'_> {
        self.ask(Ask::Spin { lie: self.lie.get(), rate_dps })
    }

    fn stop(&self) -> Motion<'_> {
        self.ask(Ask::StopTable)
    }

    fn pause(&self, span: Duration) -> Motion<'_> {
        Box::pin(async move {
            // A real bench's clock is the wall's.
            tokio::time::sleep(span).await;
            Ok(())
        })
    }
}

impl fmt::Display for Lie {
    /// What somebody is to do.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |axis: usize| AXES[axis % 3];
        match *self {
            Lie::Axis { axis, positive, along, heading_deg } => {
                let (axis, sign) = (usize::from(axis), if positive { '+' } else { '-' });
                let next = name(axis + 1);
                match along {
                    Along::Up => write!(
                        f,
                        "lay the module with {sign}{} up and +{next} to {heading_deg:.0} degrees, clockwise from north",
                        name(axis)
                    ),
                    Along::North => write!(
                        f,
                        "lay the module with {sign}{} level to the north and +{next} {heading_deg:.0} degrees from up, \
                         clockwise seen from the north",
                        name(axis)
                    ),
                    Along::Polar => write!(
                        f,
                        "lay the module with {sign}{} to the celestial north pole and +{next} {heading_deg:.0} degrees \
                         from the upper side of the meridian, clockwise seen from the pole",
                        name(axis)
                    ),
                }
            }
            Lie::Up { up: [x, y, z], heading_deg } => write!(
                f,
                "lay the module so that ({x:+.4}, {y:+.4}, {z:+.4}) of its axes X, Y, Z points up, heading {heading_deg:.0} \
                 degrees"
            ),
        }
    }
}
