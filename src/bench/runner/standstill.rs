//! Whether the station itself stood still during an attempt: the computer slept, or a debugger or a signal held the program.
//! The board goes on then, and what it sent is lost with nothing to count it.

use std::cell::Cell;
use std::time::Duration;

use nix::time::{ClockId, clock_gettime};

/// How often the station looks at the clock.
const LOOK_EVERY: Duration = Duration::from_millis(250);
/// A station that was not here for so long has missed heartbeats of the board, whose watchdog ends the session after two seconds
/// without one. A busy computer is late by less.
const STOOD: Duration = Duration::from_secs(1);
/// Most of that time in which the program may have computed: then it was busy, and not still.
const BUSY_SHARE: u32 = 10;

/// The clocks at a moment: one that goes on while the computer sleeps, and the time that this process has computed.
#[derive(Debug, Clone, Copy)]
struct Moment {
    now: Duration,
    computed: Duration,
}

impl Moment {
    /// `None` if the system has no such clock.
    fn read() -> Option<Self> {
        let read = |clock| clock_gettime(clock).ok().map(Duration::from);
        Some(Self { now: read(ClockId::CLOCK_BOOTTIME)?, computed: read(ClockId::CLOCK_PROCESS_CPUTIME_ID)? })
    }

    /// How long the program stood still between this moment and a later one.
    fn stood_until(self, later: Self) -> Option<Duration> {
        let (span, computed) = (later.now.saturating_sub(self.now), later.computed.saturating_sub(self.computed));
        (span >= STOOD && computed * BUSY_SHARE < span).then_some(span)
    }
}

/// Watches the clock during an attempt.
#[derive(Debug)]
pub(super) struct Standstill {
    last: Cell<Option<Moment>>,
    longest: Cell<Option<Duration>>,
}

impl Standstill {
    pub(super) fn new() -> Self {
        Self { last: Cell::new(Moment::read()), longest: Cell::new(None) }
    }

    /// Looks at the clock again and again; never ends.
    pub(super) async fn watch(&self) -> std::convert::Infallible {
        loop {
            tokio::time::sleep(LOOK_EVERY).await;
            self.longest();
        }
    }

    /// The longest time for which the program stood still up to now.
    pub(super) fn longest(&self) -> Option<Duration> {
        let now = Moment::read();
        if let (Some(last), Some(now)) = (self.last.replace(now), now) {
            self.longest.set(self.longest.get().max(last.stood_until(now)));
        }
        self.longest.get()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_busy_program_does_not_stand_still() {
        let at = |now, computed| Moment { now: Duration::from_millis(now), computed: Duration::from_millis(computed) };
        let stood = |now: u64, computed: u64| at(1000, 500).stood_until(at(1000 + now, 500 + computed));
        assert_eq!(stood(5000, 1), Some(Duration::from_secs(5)));
        assert_eq!(stood(1000, 99), Some(Duration::from_secs(1)));
        assert_eq!(stood(999, 0), None, "late, as on a busy computer");
        assert_eq!(stood(5000, 600), None, "it computed");
    }

    #[test]
    fn the_longest_standstill_counts() {
        let still = Standstill::new();
        assert_eq!(still.longest(), None);
        let long_ago = |span_s| {
            let now = Moment::read().expect("clocks");
            Some(Moment { now: now.now - Duration::from_secs(span_s), ..now })
        };
        for (span_s, longest_s) in [(5, 5), (3, 5), (7, 7), (0, 7)] {
            still.last.set(long_ago(span_s));
            assert_eq!(still.longest().map(|span| span.as_secs()), Some(longest_s));
        }
    }
}
