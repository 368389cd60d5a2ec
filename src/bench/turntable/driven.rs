//! A turntable that is driven.

use std::sync::Arc;
use std::time::Duration;

use gnc_rig::{DriverError, Orientation, Rig};

use super::{Turntable, TurntableMotion};
use crate::fixture::FixtureError;

/// A handle to the driver.
pub(super) struct Driven {
    rig: Arc<dyn Rig>,
}

impl Driven {
    pub(super) fn new(rig: Arc<dyn Rig>) -> Self {
        Self { rig }
    }

    /// Begins a motion and waits until it is over; the conversation with the board goes on meanwhile.
    fn moved<'a>(
        &'a self,
        what: &'static str,
        begin: impl FnOnce(&dyn Rig) -> Result<(), DriverError> + 'a,
        wait: impl FnOnce(&dyn Rig) -> Result<(), DriverError> + Send + 'static,
    ) -> TurntableMotion<'a> {
        Box::pin(async move {
            begin(self.rig.as_ref()).map_err(|source| FixtureError::Table { what, source })?;
            let rig = Arc::clone(&self.rig);
            let waited = tokio::task::spawn_blocking(move || wait(rig.as_ref())).await;
            // If a driver panics, the table has not moved.
            let waited = waited.unwrap_or_else(|broken| Err(broken.into()));
            waited.map_err(|source| FixtureError::Table { what, source })
        })
    }
}

impl Turntable for Driven {
    fn lay(&self, orientation: Orientation) -> TurntableMotion<'_> {
        Box::pin(async move {
            // A table that was stopped before comes to rest first.
            self.moved("wait for the table to stand still", |_| Ok(()), |rig| rig.wait_still()).await?;
            self.moved("lay the module down", move |rig| rig.orient(orientation), |rig| rig.wait_still()).await
        })
    }

    fn rotate(&self, angle_deg: f64, span_s: f64, _: f64) -> TurntableMotion<'_> {
        self.moved("turn the module", move |rig| rig.rotate(angle_deg, span_s), |rig| rig.wait_still())
    }

    fn spin(&self, rate_dps: f64) -> TurntableMotion<'_> {
        self.moved("spin the module", move |rig| rig.spin(rate_dps), move |rig| rig.wait_at_rate(rate_dps))
    }

    fn stop(&self) -> TurntableMotion<'_> {
        self.moved("stop the table", |rig| rig.stop(), |rig| rig.wait_still())
    }

    fn pause(&self, span: Duration) -> TurntableMotion<'_> {
        self.moved("wait", |_| Ok(()), move |rig| rig.wait(span))
    }
}
