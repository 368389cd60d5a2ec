//! Link time of a bench on ports. It is wall time: host and board time their signs of life by the wall.
//!
//! At any speed but the true one, host and bench share a computer, and board time is not held against the host's clock.
//! Two kinds of time are excused there:
//! - Time in which the bench's thread got no processor. A busy computer does not mean that the host fell silent, so the
//!   board's watchdog does not count it. Nor does board time pass in it: at ten times the speed a third of a second
//!   would make three seconds of samples at once, and a heartbeat ahead of them.
//! - Time in which the port of the session is full. Board time does not pass in it, so that a host that waits for its processor or its
//!   disk loses no samples.
//!
//! The board's own signs of life go by the wall all the same, since the host counts them by the wall.

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
    at_true_speed: bool,
    stood_still: Duration,
    port_full: Duration,
}

/// What a wait of the bench's thread was for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wait {
    /// For the next event or the next byte.
    Due,
    /// For room in a port.
    Room,
}

impl LinkClock {
    pub(crate) fn start(now: Instant, speed: Speed) -> Self {
        let at_true_speed = speed == Speed::Times(1.0);
        Self { started: now, looked: now, at_true_speed, stood_still: Duration::ZERO, port_full: Duration::ZERO }
    }

    /// Link time now.
    pub(crate) fn now(&mut self) -> Duration {
        self.look(Instant::now(), Duration::ZERO, Wait::Due)
    }

    /// Ends a wait that was to last at most this long.
    pub(crate) fn waited(&mut self, at_most: Duration, wait: Wait) {
        self.look(Instant::now(), at_most, wait);
    }

    /// Time in which the computer stood still since the last call; none at true speed.
    pub(crate) fn take_stood_still(&mut self) -> Duration {
        std::mem::take(&mut self.stood_still)
    }

    /// Other time in which a port was full since the last call; none at true speed.
    pub(crate) fn take_port_full(&mut self) -> Duration {
        std::mem::take(&mut self.port_full)
    }

    fn look(&mut self, now: Instant, at_most: Duration, wait: Wait) -> Duration {
        let passed = now.saturating_duration_since(self.looked);
        self.looked = self.looked.max(now);
        if !self.at_true_speed {
            let stood_still = passed.saturating_sub(at_most + WORK);
            self.stood_still += stood_still;
            if wait == Wait::Room {
                self.port_full += passed - stood_still;
            }
        }
        self.looked.saturating_duration_since(self.started)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MINUTE: Duration = Duration::from_secs(60);

    /// Link time, and its excused parts: stood still, and port full. The looks are at these times, with a wait of
    /// `LOOK_EVERY` before the last one.
    fn link(speed: Speed, looks: [Duration; 2], waited_until: Duration, wait: Wait) -> [Duration; 3] {
        let start = Instant::now();
        let mut clock = LinkClock::start(start, speed);
        for look in looks {
            clock.look(start + look, Duration::ZERO, Wait::Due);
        }
        [clock.look(start + waited_until, LOOK_EVERY, wait), clock.take_stood_still(), clock.take_port_full()]
    }

    #[test]
    fn a_computer_that_stands_still_is_no_silent_host_but_at_true_speed() {
        let ms = Duration::from_millis;
        // Normal turns excuse nothing at any speed.
        for speed in [Speed::Max, Speed::Times(1.0), Speed::Times(20.0)] {
            assert_eq!(link(speed, [ms(3), ms(20)], ms(270), Wait::Due), [ms(270), ms(0), ms(0)]);
        }
        // The computer stands still during work, and during a wait.
        for speed in [Speed::Max, Speed::Times(20.0), Speed::Times(0.5)] {
            let during_work = link(speed, [ms(3), MINUTE], MINUTE + ms(7), Wait::Due);
            assert_eq!(during_work, [MINUTE + ms(7), MINUTE - ms(3) - WORK, ms(0)]);
            let during_a_wait = link(speed, [ms(3), ms(5)], MINUTE, Wait::Due);
            assert_eq!(during_a_wait, [MINUTE, MINUTE - ms(5) - WORK - LOOK_EVERY, ms(0)]);
        }
        // A bench at true speed goes by wall time: its board does not stand still with the host.
        assert_eq!(
            link(Speed::Times(1.0), [ms(3), MINUTE], MINUTE + ms(7), Wait::Room),
            [MINUTE + ms(7), ms(0), ms(0)]
        );
    }

    #[test]
    fn a_full_port_and_a_computer_that_stands_still_are_not_counted_twice() {
        let ms = Duration::from_millis;
        assert_eq!(link(Speed::Times(10.0), [ms(3), ms(5)], ms(205), Wait::Room), [ms(205), ms(0), ms(200)]);
        let [_, stood_still, port_full] = link(Speed::Times(10.0), [ms(3), ms(5)], MINUTE, Wait::Room);
        assert_eq!(stood_still + port_full, MINUTE - ms(5));
        assert_eq!(port_full, WORK + LOOK_EVERY);
    }

    #[test]
    fn what_was_excused_is_excused_once() {
        let start = Instant::now();
        let mut clock = LinkClock::start(start, Speed::Max);
        clock.look(start + MINUTE, Duration::ZERO, Wait::Due);
        assert_eq!(clock.take_stood_still(), MINUTE - WORK);
        assert_eq!(clock.take_stood_still(), Duration::ZERO);
    }
}
