//! The simulated turntable.

use std::time::Duration;

use hw_mocks::turntable::ACCELERATION_DPS2;
use hw_mocks::{Axis, Control, Direction, Sign, TableError};

use super::{Lie, Motion, Turntable};
use crate::capture::Along;
use crate::fixture::FixtureError;
use crate::procedure::Trouble;

/// The simulated table reaches its rate by its own ramp; so much longer it takes from one spin over to the opposite.
const BOTH_SENSES: f64 = 2.0;

/// A handle on the simulated bench.
pub(super) struct Simulated {
    control: Control,
}

impl Simulated {
    pub(super) fn new(control: Control) -> Self {
        Self { control }
    }

    /// Begins a motion, and waits beside the conversation with the board until it is over.
    fn moved<'a>(
        &'a self,
        what: &'static str,
        begin: impl FnOnce(&Control) -> Result<(), TableError> + 'a,
        wait: impl FnOnce(&Control) -> Result<(), TableError> + Send + 'static,
    ) -> Motion<'a> {
        Box::pin(async move {
            begin(&self.control).map_err(|source| refused(what, source))?;
            let control = self.control.clone();
            match tokio::task::spawn_blocking(move || wait(&control)).await {
                Ok(waited) => waited.map_err(|source| refused(what, source)),
                Err(_) => Err(refused(what, TableError::Gone(hw_mocks::BenchGone))),
            }
        })
    }
}

fn refused(what: &'static str, source: TableError) -> Trouble {
    FixtureError::Table { what, source }.into()
}

pub(super) fn stop_at_once(control: &Control) {
    // A bench that has ended moves nothing.
    let _ = control.stop();
}

impl Turntable for Simulated {
    fn lay(&self, lie: Lie) -> Motion<'_> {
        let begin = move |control: &Control| match lie {
            Lie::Axis { axis, positive, along, heading_deg } => {
                let sign = if positive { Sign::Plus } else { Sign::Minus };
                control.orient(direction(along), Axis::ALL[usize::from(axis) % 3], sign, heading_deg)
            }
            Lie::Up { up, heading_deg } => control.orient_up(up, heading_deg),
        };
        Box::pin(async move {
            // What was stopped before, by whomever, comes to rest first.
            self.moved("wait for the table to stand still", |_| Ok(()), Control::wait_still).await?;
            self.moved("lay the module down", begin, Control::wait_still).await
        })
    }

    fn rotate(&self, angle_deg: f64, span_s: f64) -> Motion<'_> {
        self.moved("turn the module", move |control| control.rotate(angle_deg, span_s), Control::wait_still)
    }

    fn spin(&self, rate_dps: f64) -> Motion<'_> {
        let ramp = Duration::from_secs_f64(rate_dps.abs() * BOTH_SENSES / ACCELERATION_DPS2);
        let reach = move |control: &Control| Ok(control.sleep(ramp)?);
        self.moved("spin the module", move |control| control.spin(rate_dps), reach)
    }

    fn stop(&self) -> Motion<'_> {
        self.moved("stop the table", Control::stop, Control::wait_still)
    }

    fn pause(&self, span: Duration) -> Motion<'_> {
        self.moved("wait", |_| Ok(()), move |control| Ok(control.sleep(span)?))
    }
}

fn direction(along: Along) -> Direction {
    match along {
        Along::Up => Direction::Up,
        Along::North => Direction::North,
        Along::Polar => Direction::Polar,
    }
}
