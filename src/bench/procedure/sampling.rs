//! The clock of a capture under way: the samples' times by the board, and the board's clock against the host's.

use gnc_analysis::capture::Timing;
use gnc_analysis::host_clock::HostWatch;
use gnc_metrology::sample_clock::{ClockFault, SampleClock};
use gnc_protocol::can::stream::MARK_EVERY;
use gnc_protocol::stream::{MAX_COMPENSATED_SAMPLES, StreamHead};
use tokio::time::Instant;

use super::ProcedureContext;

/// A rate is judged from this capture time on, and at the end. A fault is known to a ppm by then, so an hour with a
/// wrong clock is not waited for.
const JUDGED_FROM_S: f64 = 1.0;

/// Samples of a frame to ask for; 0 leaves them to the board. The frames of a short stream hold one sample each, so
/// that more than one sample tells its time.
pub(super) fn samples_per_frame(count: u32) -> u8 {
    u8::from((1..=MAX_COMPENSATED_SAMPLES as u32 + 2).contains(&count))
}

/// Checks the clock of one capture.
#[derive(Debug)]
pub(super) struct ClockWatch {
    rate_hz: u16,
    board: SampleClock,
    host: HostWatch,
    began: Instant,
    on_can: bool,
    /// Number of samples that told their time, and the last of them: on CAN the number of its mark.
    told: (u32, Option<u32>),
    samples: usize,
}

impl ClockWatch {
    pub(super) fn new(rate_hz: u16, bench: &ProcedureContext<'_>) -> Self {
        Self {
            rate_hz,
            board: SampleClock::new(rate_hz),
            host: HostWatch::new(bench.host_clock.clone()),
            began: Instant::now(),
            on_can: bench.board.tap().is_some(),
            told: (0, None),
            samples: 0,
        }
    }

    /// Takes a frame whose first `samples` samples are used.
    ///
    /// # Errors
    /// [`ClockFault`], as soon as it is certain.
    pub(super) fn frame(&mut self, head: &StreamHead, samples: usize) -> Result<(), ClockFault> {
        self.board.frame(head.first, head.board_time_us, samples);
        let place = if self.on_can { head.first / MARK_EVERY } else { head.first };
        if self.told.1 != Some(place) {
            self.told = (self.told.0.saturating_add(1), Some(place));
        }
        self.samples += samples;
        // A frame leaves the board when its last sample was taken.
        let last = u64::from(head.count.saturating_sub(1));
        let last_us = head.board_time_us.saturating_add(last * 1_000_000 / u64::from(self.rate_hz.max(1)));
        self.host.heard(self.began.elapsed(), last_us);
        match self.board.check(self.samples) {
            Err(fault @ ClockFault::Back { .. }) => Err(fault),
            Err(fault) if self.board.span_s() >= JUDGED_FROM_S => Err(fault),
            Err(_) | Ok(_) => Ok(()),
        }
    }

    /// Ends the capture.
    ///
    /// # Errors
    /// [`ClockFault`].
    pub(super) fn end(self) -> Result<Timing, ClockFault> {
        self.board.check(self.samples)?;
        if self.told.0 < 2 {
            let samples = u32::try_from(self.samples).unwrap_or(u32::MAX);
            return Err(ClockFault::Untimed { stamps: self.told.0, samples });
        }
        Ok(Timing { board: self.board, host: self.host.view() })
    }
}
