//! The module's CAN controller: test frames go back under another id.

use gnc_protocol::can::id::echo_of;
use gnc_protocol::can::{CanFrame, CanId};
use gnc_protocol::message::{CanCountersReply, CanState};

/// Faults of the controller.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct CanFaults {
    /// One of this many test frames with data goes back with the lowest bit of its first byte inverted; 0: none.
    pub flip_every: u32,
    /// One of this many test frames waits until after the next; 0: none.
    pub swap_every: u32,
    /// Sending fails at first for one of this many test frames, and the controller counts it; 0: none.
    pub tx_error_every: u32,
    /// Number of test frames after which the controller leaves the bus; 0: never.
    pub bus_off_after: u32,
}

/// The controller. Its counters follow ISO 11898-1: a failed transmission adds 8, a good one subtracts 1.
#[derive(Debug, Clone, Default)]
pub(crate) struct CanController {
    faults: CanFaults,
    received: u32,
    with_data: u32,
    echoed: u32,
    tx_errors: u16,
    bus_off: bool,
    held: Option<CanFrame>,
}

impl CanController {
    /// A controller with its faults.
    #[must_use]
    pub(crate) fn new(faults: CanFaults) -> Self {
        Self { faults, ..Self::default() }
    }

    /// Handles power-on: the controller starts anew.
    pub(crate) fn power_on(&mut self) {
        *self = Self::new(self.faults);
    }

    /// Takes a frame from the bus; returns the frames that it sends back.
    pub(crate) fn echo(&mut self, frame: &CanFrame) -> impl Iterator<Item = CanFrame> + use<> {
        let back = echo_of(frame.id()).filter(|_| !self.bus_off).and_then(|id| self.answer(id, frame.data()));
        let held = back.and_then(|_| self.held.take());
        let swap = back.is_some() && held.is_none() && every(self.received, self.faults.swap_every);
        if swap {
            self.held = back;
        }
        back.filter(|_| !swap).into_iter().chain(held)
    }

    fn answer(&mut self, id: CanId, data: &[u8]) -> Option<CanFrame> {
        self.received = self.received.wrapping_add(1);
        if self.faults.bus_off_after != 0 && self.received > self.faults.bus_off_after {
            // Thirty-two failed transmissions in a row.
            (self.bus_off, self.tx_errors) = (true, 256);
            return None;
        }
        let failed = every(self.received, self.faults.tx_error_every);
        self.tx_errors = if failed { self.tx_errors + 8 } else { self.tx_errors }.saturating_sub(1);
        let mut frame = CanFrame::new(id, data);
        if let Some((first, rest)) = data.split_first() {
            self.with_data = self.with_data.wrapping_add(1);
            if every(self.with_data, self.faults.flip_every) {
                let mut altered = [0; 8];
                altered[0] = first ^ 1;
                altered[1..data.len()].copy_from_slice(rest);
                frame = CanFrame::new(id, &altered[..data.len()]);
            }
        }
        self.echoed = self.echoed.wrapping_add(1);
        frame
    }

    /// Its counters.
    #[must_use]
    pub(crate) fn counters(&self) -> CanCountersReply {
        let state = match self.tx_errors {
            _ if self.bus_off => CanState::BusOff,
            128.. => CanState::ErrorPassive,
            _ => CanState::ErrorActive,
        };
        CanCountersReply {
            state: state as u8,
            tx_errors: self.tx_errors,
            rx_errors: 0,
            received: self.received,
            echoed: self.echoed,
        }
    }
}

fn every(count: u32, period: u32) -> bool {
    period != 0 && count.is_multiple_of(period)
}
