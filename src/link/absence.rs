//! A port or interface that went away, unplugged or switched off, and is looked for until it is back.

use std::error::Error;
use std::io;
use std::time::Duration;

use tokio::time::{Instant, sleep_until};

/// Longest wait for its return: whoever pulled the wrong plug has put it back by then. The run stands still meanwhile,
/// and the board's watchdog has long made the module safe.
pub const RETURNS_WITHIN: Duration = Duration::from_secs(10);
/// Between two looks for it: what is back is in use within one.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// How long something has been away.
#[derive(Debug, Clone, Copy)]
pub(super) struct Absence {
    since: Instant,
    next_look: Instant,
    /// Its return was told; it has said nothing since.
    told: bool,
}

impl Absence {
    /// It went away. What had come back from an absence and never said a word is still in that one: an adapter that
    /// opens and is gone again at once must not be waited for without end.
    pub(super) fn begin(mute: Option<Self>) -> Self {
        let now = Instant::now();
        let (since, told) = mute.map_or((now, false), |before| (before.since, before.told));
        Self { since, next_look: now + LOOK_EVERY, told }
    }

    /// Whether this is news.
    pub(super) fn is_new(&self) -> bool {
        !self.told
    }

    /// Waits until it is looked for again. May be dropped half way.
    pub(super) async fn look_due(&self) {
        sleep_until(self.next_look).await;
    }

    /// It opened. How long it was away, if nobody was told yet.
    pub(super) fn returned(&mut self) -> Option<Duration> {
        (!std::mem::replace(&mut self.told, true)).then(|| self.since.elapsed())
    }

    /// It did not open.
    ///
    /// # Errors
    /// It was away for too long.
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
