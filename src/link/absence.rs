//! A port or interface that went away, unplugged or switched off. The link looks for it until it is back.

use std::error::Error;
use std::io;
use std::time::Duration;

use tokio::time::{Instant, sleep_until};

/// Longest wait for the return of a port or interface. A person who pulled the wrong plug has put it back by then. The
/// run stands still meanwhile, and the board's watchdog has long made the module safe.
pub const RETURNS_WITHIN: Duration = Duration::from_secs(10);
/// Time between two looks for the port. A port that is back is in use within this time.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// The time for which a port or interface has been away.
#[derive(Debug, Clone, Copy)]
pub(super) struct Absence {
    since: Instant,
    next_look: Instant,
    /// Its return was reported, and nothing has come from it since.
    told: bool,
}

impl Absence {
    /// Begins an absence. If the port came back from an earlier absence and nothing came from it since, that absence
    /// goes on: the link must not wait without end for an adapter that opens and is gone again at once.
    pub(super) fn begin(mute: Option<Self>) -> Self {
        let now = Instant::now();
        let (since, told) = mute.map_or((now, false), |before| (before.since, before.told));
        Self { since, next_look: now + LOOK_EVERY, told }
    }

    /// Whether the absence is still unreported.
    pub(super) fn is_new(&self) -> bool {
        !self.told
    }

    /// Waits until the next look is due. The wait may be dropped half way.
    pub(super) async fn look_due(&self) {
        sleep_until(self.next_look).await;
    }

    /// The port opened. Returns how long it was away, or `None` if this was reported already.
    pub(super) fn returned(&mut self) -> Option<Duration> {
        (!std::mem::replace(&mut self.told, true)).then(|| self.since.elapsed())
    }

    /// The port did not open.
    ///
    /// # Errors
    /// The port was away for too long.
    pub(super) fn goes_on(&mut self, name: &str, why: &(dyn Error + 'static)) -> io::Result<()> {
        if self.since.elapsed() < RETURNS_WITHIN {
            self.next_look = Instant::now() + LOOK_EVERY;
            return Ok(());
        }
        let why = gnc_text::with_causes(why);
        let text = format!("{name} went away and did not come back in {} s: {why}", RETURNS_WITHIN.as_secs());
        Err(io::Error::new(io::ErrorKind::NotConnected, text))
    }
}
