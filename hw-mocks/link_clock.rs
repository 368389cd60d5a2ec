//! Link time of a bench on ports. It is wall time: host and board time their signs of life by the wall.
//!
//! At full speed the board's watchdog does not count the time in which the bench's thread got no processor. At that
//! speed requests move board time, and host and bench share a computer. A busy computer does not mean that the host
//! fell silent. The board's own signs of life go by the wall all the same, since the host counts them by the wall.

use std::time::{Duration, Instant};

use crate::bench::Speed;

/// Longest wait. It bounds the time until a computer that stands still is noticed.
pub(crate) const LOOK_EVERY: Duration = Duration::from_millis(250);
/// The longest time between two looks at the clock, apart from a wait, that counts as work. A look makes some kilobytes
/// of samples or a piece of a memory test, each a few milliseconds of a processor. A busy computer takes a processor
/// away after some milliseconds, so a thread that needs longer has waited for a processor.
const WORK: Duration = Duration::from_millis(20);

/// The clock.
#[derive(Debug)]
pub(crate) struct LinkClock {
    started: Instant,
    looked: Instant,
    at_full_speed: bool,
    stood_still: Duration,
}

impl LinkClock {
    pub(crate) fn start(now: Instant, speed: Speed) -> Self {
        Self { started: now, looked: now, at_full_speed: speed == Speed::Max, stood_still: Duration::ZERO }
    }

    /// Link time now.
    pub(crate) fn now(&mut self) -> Duration {
        self.look(Instant::now(), Duration::ZERO)
    }

    /// Ends a wait that was to last at most this long.
    pub(crate) fn waited(&mut self, at_most: Duration) {
        self.look(Instant::now(), at_most);
    }

    /// Time in which the computer stood still at full speed since the last call.
    pub(crate) fn take_stood_still(&mut self) -> Duration {
        std::mem::take(&mut self.stood_still)
    }

    fn look(&mut self, now: Instant, waited: Duration) -> Duration {
        let passed = now.saturating_duration_since(self.looked);
        self.looked = self.looked.max(now);
        if self.at_full_speed {
            self.stood_still += passed.saturating_sub(waited + WORK);
        }
        self.looked.saturating_duration_since(self.started)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MINUTE: Duration = Duration::from_secs(60);

    /// Link time and the excused part of it, after looks at these times and a wait of `LOOK_EVERY` before the last one.
    fn link(speed: Speed, looks: [Duration; 2], waited_until: Duration) -> (Duration, Duration) {
        let start = Instant::now();
        let mut clock = LinkClock::start(start, speed);
        for look in looks {
            clock.look(start + look, Duration::ZERO);
        }
        (clock.look(start + waited_until, LOOK_EVERY), clock.take_stood_still())
    }

    #[test]
    fn at_full_speed_a_computer_that_stands_still_is_no_silent_host() {
        let ms = Duration::from_millis;
        // Normal turns excuse nothing at any speed.
        for speed in [Speed::Max, Speed::Times(1.0), Speed::Times(20.0)] {
            assert_eq!(link(speed, [ms(3), ms(20)], ms(270)), (ms(270), Duration::ZERO));
        }
        // The computer stands still during work, and during a wait.
        assert_eq!(link(Speed::Max, [ms(3), MINUTE], MINUTE + ms(7)), (MINUTE + ms(7), MINUTE - ms(3) - WORK));
        assert_eq!(link(Speed::Max, [ms(3), ms(5)], MINUTE), (MINUTE, MINUTE - ms(5) - WORK - LOOK_EVERY));
        // A bench at true speed goes by wall time: its board does not stand still with the host.
        assert_eq!(link(Speed::Times(1.0), [ms(3), MINUTE], MINUTE + ms(7)), (MINUTE + ms(7), Duration::ZERO));
    }

    #[test]
    fn what_was_excused_is_excused_once() {
        let start = Instant::now();
        let mut clock = LinkClock::start(start, Speed::Max);
        clock.look(start + MINUTE, Duration::ZERO);
        assert_eq!(clock.take_stood_still(), MINUTE - WORK);
        assert_eq!(clock.take_stood_still(), Duration::ZERO);
    }
}
