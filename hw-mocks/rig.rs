//! The simulated turntable and fixture, as the station drives them.

use std::time::Duration;

use gnc_rig::{DriverError, FixtureDriver, Orientation, TurntableDriver};

use crate::turntable::ACCELERATION_DPS2;
use crate::{BenchControl, ModuleAxis, Sign};

/// The change from one spin to the opposite one of the same rate takes this many ramps.
const BOTH_SENSES: f64 = 2.0;

impl TurntableDriver for BenchControl {
    fn orient(&self, orientation: Orientation) -> Result<(), DriverError> {
        match orientation {
            Orientation::Axis { axis, positive, along, heading_deg } => {
                let sign = if positive { Sign::Plus } else { Sign::Minus };
                Ok(BenchControl::orient(self, along, ModuleAxis::ALL[usize::from(axis) % 3], sign, heading_deg)?)
            }
            Orientation::Up { up, heading_deg } => Ok(self.orient_up(up, heading_deg)?),
        }
    }

    fn rotate(&self, angle_deg: f64, span_s: f64) -> Result<(), DriverError> {
        Ok(BenchControl::rotate(self, angle_deg, span_s)?)
    }

    fn spin(&self, rate_dps: f64) -> Result<(), DriverError> {
        Ok(BenchControl::spin(self, rate_dps)?)
    }

    fn stop(&self) -> Result<(), DriverError> {
        Ok(BenchControl::stop(self)?)
    }

    fn wait_still(&self) -> Result<(), DriverError> {
        Ok(BenchControl::wait_still(self)?)
    }

    fn wait_at_rate(&self, rate_dps: f64) -> Result<(), DriverError> {
        // The table needs a ramp to reach its rate.
        Ok(self.sleep(Duration::from_secs_f64(rate_dps.abs() * BOTH_SENSES / ACCELERATION_DPS2))?)
    }

    fn wait(&self, span: Duration) -> Result<(), DriverError> {
        Ok(self.sleep(span)?)
    }
}

impl FixtureDriver for BenchControl {
    fn name(&self) -> &str {
        "the simulated bench"
    }

    fn only_switch(&self, on: Option<u8>) -> Result<(), DriverError> {
        Ok(BenchControl::only_switch(self, on)?)
    }

    fn turn_to(&self, heading_deg: f64) -> Result<(), DriverError> {
        Ok(self.set_heading_deg(heading_deg)?)
    }
}
