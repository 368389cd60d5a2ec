//! The three timers of the processor, measured against the slave's reference clock.

use gnc_protocol::message::{TimerMeasure, TimerMeasureReply};

use crate::noise::{Dice, RandomStream};

/// Resolution of the slave's reference clock, ns.
pub(crate) const REFERENCE_NS: f64 = 10.0;

/// Properties of the timers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TimerModel {
    /// Error of an interval against the slave's reference, positive if it is too long.
    pub rate_error_ppm: f64,
    /// Standard deviation of the interrupt's latency.
    pub jitter_ns: f64,
    /// One of this many interrupts does not come; 0: none is missed.
    pub miss_every: u32,
}

impl Default for TimerModel {
    /// A crystal error of 12 ppm and a latency that varies by 60 ns: a few processor cycles.
    fn default() -> Self {
        Self { rate_error_ppm: 12.0, jitter_ns: 60.0, miss_every: 0 }
    }
}

/// The timers.
#[derive(Debug, Clone)]
pub(crate) struct Timers {
    model: TimerModel,
    dice: Dice,
    fired: [u32; 3],
}

impl Timers {
    /// Timers under a seed.
    #[must_use]
    pub(crate) fn new(model: TimerModel, seed: u64) -> Self {
        Self { model, dice: Dice::new(seed, RandomStream::Timers), fired: [0; 3] }
    }

    /// Runs a timer for `count` intervals. Each interrupt marks the end of one interval and the start of the next. If
    /// one is missed, the interval to the next interrupt is twice as long. It also returns the whole time, in ns.
    pub(crate) fn measure(&mut self, request: &TimerMeasure) -> (TimerMeasureReply, u64) {
        let period_ns = f64::from(request.period_us) * 1000.0 * (1.0 + self.model.rate_error_ppm * 1e-6);
        let mut reply = TimerMeasureReply::default();
        let mut last_ns = self.latency_ns();
        for index in 1..=request.count {
            if self.misses(request.timer) {
                continue;
            }
            let edge_ns = f64::from(index) * period_ns + self.latency_ns();
            let interval = ((edge_ns / REFERENCE_NS).floor() - (last_ns / REFERENCE_NS).floor()) * REFERENCE_NS;
            last_ns = edge_ns;
            reply.interrupts += 1;
            // At most 100 intervals are requested, and the list holds 100.
            let _ = reply.intervals_ns.push(interval.max(0.0) as u32);
        }
        (reply, (period_ns * f64::from(request.count)) as u64)
    }

    fn latency_ns(&mut self) -> f64 {
        // Latency is never negative: 1 us of entry code and a variable part.
        (1000.0 + self.model.jitter_ns * self.dice.normal()).max(0.0)
    }

    fn misses(&mut self, timer: u8) -> bool {
        let Some(fired) = self.fired.get_mut(usize::from(timer)) else { return false };
        *fired = fired.wrapping_add(1);
        self.model.miss_every != 0 && fired.is_multiple_of(self.model.miss_every)
    }
}
