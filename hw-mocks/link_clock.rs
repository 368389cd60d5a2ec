//! Link time of a bench that is served on ports: wall time, which the host's signs of life and the board's watchdog go by.
//!
//! At full speed it goes on only while the thread that serves the bench runs, or waits no longer than it wants to. There
//! board time goes by what is asked and not by the wall, so that a computer that stands still, host and bench
//! together, is no host that fell silent.

use std::time::{Duration, Instant};

use crate::bench::Speed;

/// Longest wait, so that a computer that stands still is noticed.
pub(crate) const LOOK_EVERY: Duration = Duration::from_millis(250);
/// The longest time between two looks at the clock, beside a wait, that is taken for work. With a wait and the time
/// between two signs of life it is less than the watchdog's.
const WORK: Duration = Duration::from_millis(500);

/// The clock.
#[derive(Debug)]
pub(crate) struct LinkClock {
    looked: Instant,
    link: Duration,
    at_full_speed: bool,
}

impl LinkClock {
    pub(crate) fn start(now: Instant, speed: Speed) -> Self {
        Self { looked: now, link: Duration::ZERO, at_full_speed: speed == Speed::Max }
    }

    /// Link time now.
    pub(crate) fn now(&mut self) -> Duration {
        self.look(Instant::now(), Duration::ZERO)
    }

    /// A wait is over that was to last so long at most.
    pub(crate) fn waited(&mut self, at_most: Duration) {
        self.look(Instant::now(), at_most);
    }

    fn look(&mut self, now: Instant, waited: Duration) -> Duration {
        let passed = now.saturating_duration_since(self.looked);
        self.looked = self.looked.max(now);
        self.link += if self.at_full_speed { passed.min(waited + WORK) } else { passed };
        self.link
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gnc_protocol::timing::{KEEP_ALIVE_EVERY, WATCHDOG};

    const MINUTE: Duration = Duration::from_secs(60);

    /// Looks at these times, and a wait of `LOOK_EVERY` before the last one.
    fn link(speed: Speed, looks: [Duration; 2], waited_until: Duration) -> Duration {
        let start = Instant::now();
        let mut clock = LinkClock::start(start, speed);
        for look in looks {
            clock.look(start + look, Duration::ZERO);
        }
        clock.look(start + waited_until, LOOK_EVERY)
    }

    #[test]
    fn at_full_speed_a_computer_that_stands_still_is_no_silent_host() {
        let ms = Duration::from_millis;
        // Ordinary turns are wall time at any speed.
        for speed in [Speed::Max, Speed::Times(1.0), Speed::Times(20.0)] {
            assert_eq!(link(speed, [ms(3), ms(40)], ms(280)), ms(280));
        }
        // It stands still amid its work, and in a wait.
        assert_eq!(link(Speed::Max, [ms(3), MINUTE], MINUTE + ms(7)), ms(3) + WORK + ms(7));
        assert_eq!(link(Speed::Max, [ms(3), ms(5)], MINUTE), ms(5) + WORK + LOOK_EVERY);
        assert!(WORK + LOOK_EVERY + KEEP_ALIVE_EVERY < WATCHDOG);
        // A bench at true speed goes by the wall: its board does not stand still with the host.
        assert_eq!(link(Speed::Times(1.0), [ms(3), MINUTE], MINUTE + ms(7)), MINUTE + ms(7));
    }
}
