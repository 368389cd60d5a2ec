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
/// Part of that time by which the thread was busy, and not still, if it computed for more. Behind a stop it reads first what the board
/// sent meanwhile, and that is no small part of the time on a slow computer.
const BUSY_SHARE: u32 = 2;

/// The clocks at a moment: one that goes on while the computer sleeps, and the time that this thread has computed. The other
/// threads do not count: what they computed just before a stop would hide it.
#[derive(Debug, Clone, Copy)]
struct Moment {
    now: Duration,
    computed: Duration,
}

impl Moment {
    /// `None` if the system has no such clock.
    fn read() -> Option<Self> {
        let read = |clock| clock_gettime(clock).ok().map(Duration::from);
        Some(Self { now: read(ClockId::CLOCK_BOOTTIME)?, computed: read(ClockId::CLOCK_THREAD_CPUTIME_ID)? })
    }

    /// How long the program stood still between this moment and a later one.
    fn stood_until(self, later: Self) -> Option<Duration> {
        let (span, computed) = (later.now.saturating_sub(self.now), later.computed.saturating_sub(self.computed));
        (span >= STOOD && computed < span / BUSY_SHARE).then_some(span)
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
        assert_eq!(stood(1250, 250), Some(Duration::from_millis(1250)), "it computed until it was stopped for 1 s");
        assert_eq!(stood(1000, 1000), None, "it computed all the time");
        assert_eq!(stood(999, 0), None, "late, as on a busy computer");
        assert_eq!(stood(1740, 430), Some(Duration::from_millis(1740)), "it read what the board had sent meanwhile");
        assert_eq!(stood(5000, 2500), None, "it computed");
    }

    /// What other threads compute just before a stop does not hide it: they are not looked at.
    #[test]
    fn other_threads_do_not_count() {
        let (before, mut sum) = (Moment::read().expect("clocks"), 0_u64);
        let busy = std::thread::spawn(move || {
            let until =
                clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID).map(Duration::from).expect("a clock") + LOOK_EVERY;
            while clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID).map(Duration::from).expect("a clock") < until {
                sum = sum.wrapping_add(1);
            }
        });
        busy.join().expect("its end");
        let after = Moment::read().expect("clocks");
        assert!(after.computed - before.computed < LOOK_EVERY, "{before:?} {after:?}");
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
