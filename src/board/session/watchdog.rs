//! Keeps the board's watchdog quiet: a KEEP_ALIVE every half second, whatever else the session does. The
//! watchdog ends the session and switches the module off when it hears nothing.

use std::future::{Future as _, poll_fn};
use std::pin::pin;
use std::task::Poll;

use gnc_protocol::message::event;
use gnc_protocol::{Flags, Kind, Payload, timing};
use tokio::time::{Instant, sleep_until};

use super::Session;

/// Waits until a moment, and looks at the clock itself at every poll. A runtime that is busy with samples looks at its
/// timers only once in hundreds of polls. On a busy computer that takes longer than the board's watchdog waits.
pub(super) async fn until(due: Instant) {
    let mut timer = pin!(sleep_until(due));
    poll_fn(|context| if Instant::now() >= due { Poll::Ready(()) } else { timer.as_mut().poll(context) }).await;
}

impl Session {
    /// Sends a KEEP_ALIVE if it is due.
    pub(super) fn keep_alive(&mut self, now: Instant) {
        if now < self.keep_alive_due {
            return;
        }
        self.keep_alive_due = now + timing::KEEP_ALIVE_EVERY;
        if self.session.is_some() {
            self.send(Kind::Event, Flags::default(), 0, event::KEEP_ALIVE, &Payload::new());
        }
    }
}
