//! Turntables: they lay the module down, turn it by an angle and spin it. A turntable is an operator with a manual
//! table, or a driven table.
//!
//! Every motion returns when it is done, and the module is still again unless it spins. Time goes by the bench's clock.

mod driven;

use std::cell::Cell;
use std::time::Duration;

use futures_util::future::LocalBoxFuture;
use gnc_rig::Orientation;

use crate::fixture::{Ask, Fixture, FixtureError, TakenOver};
use crate::recorder::Recorder;
use driven::Driven;

/// A turntable.
pub(crate) trait Turntable {
    /// Lays the module down.
    fn lay(&self, orientation: Orientation) -> TurntableMotion<'_>;
    /// Turns the module about the table's axis by an angle in a time with ramps of `ramp_s` at both ends, right-handed about
    /// the module's axis that was laid along it. A driven table has ramps of its own.
    fn rotate(&self, angle_deg: f64, span_s: f64, ramp_s: f64) -> TurntableMotion<'_>;
    /// Begins to spin about the table's axis and returns when the rate is reached.
    fn spin(&self, rate_dps: f64) -> TurntableMotion<'_>;
    /// Brings everything that moves to rest.
    fn stop(&self) -> TurntableMotion<'_>;
    /// Hears what is taken over from an earlier run. A person is told with the next request.
    fn taken_over(&self, _: TakenOver) {}
    /// Lets time pass at the bench.
    fn pause(&self, span: Duration) -> TurntableMotion<'_>;
}

/// A motion under way. Dropping it does not end the motion: that takes a stop.
pub(crate) type TurntableMotion<'a> = LocalBoxFuture<'a, Result<(), FixtureError>>;

/// The turntable of a bench. The recorder files what it does for people to see.
#[must_use]
pub(crate) fn of<'a>(fixture: &'a Fixture, recorder: &'a Recorder<'a>) -> Box<dyn Turntable + 'a> {
    match fixture {
        Fixture::Driven(rig) => Box::new(Driven::new(rig.clone())),
        _ => Box::new(ByHand { fixture, recorder, orientation: Cell::new(None), taken_over: Cell::new(None) }),
    }
}

/// Stops a driven table at once. A manual table has its own emergency stop.
pub(crate) fn stop_at_once(fixture: &Fixture) {
    if let Fixture::Driven(rig) = fixture {
        // If the table does not answer, the station has no other way to stop it.
        let _ = rig.stop();
    }
}

/// A person with a manual table.
struct ByHand<'a> {
    fixture: &'a Fixture,
    recorder: &'a Recorder<'a>,
    /// How the module was laid down last. The picture of a turn shows it.
    orientation: Cell<Option<Orientation>>,
    /// What is taken over from an earlier run, until the person was told.
    taken_over: Cell<Option<TakenOver>>,
}

impl ByHand<'_> {
    fn ask(&self, ask: Ask) -> TurntableMotion<'_> {
        let ask = match self.taken_over.take() {
            Some(over) => Ask::Resumed { over, next: Box::new(ask) },
            None => ask,
        };
        Box::pin(async move { self.fixture.request(&ask, self.recorder).await })
    }
}

impl Turntable for ByHand<'_> {
    fn taken_over(&self, over: TakenOver) {
        self.taken_over.set(Some(over));
    }

    fn lay(&self, orientation: Orientation) -> TurntableMotion<'_> {
        self.orientation.set(Some(orientation));
        self.ask(Ask::Lay(orientation))
    }

    fn rotate(&self, angle_deg: f64, span_s: f64, ramp_s: f64) -> TurntableMotion<'_> {
        self.ask(Ask::Turn { orientation: self.orientation.get(), angle_deg, span_s, ramp_s })
    }

    fn spin(&self, rate_dps: f64) -> TurntableMotion<'_> {
        self.ask(Ask::Spin { orientation: self.orientation.get(), rate_dps })
    }

    fn stop(&self) -> TurntableMotion<'_> {
        self.ask(Ask::StopTable)
    }

    fn pause(&self, span: Duration) -> TurntableMotion<'_> {
        Box::pin(async move {
            // A real bench goes by wall time.
            tokio::time::sleep(span).await;
            Ok(())
        })
    }
}
