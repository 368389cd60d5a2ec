//! While the port or interface is away: nobody's patience runs, and the board's session is kept for as long as its
//! watchdog may have kept it too.

use std::time::Duration;

use tokio::time::Instant;

use super::Session;
use crate::error::BoardError;
use crate::status::LinkAbsence;

/// An absence that the session may outlive: the board's watchdog ends it 1.75 s after the last keep-alive, which may be
/// half a second old when the port goes. What is asked meanwhile waits.
const SESSION_KEPT: Duration = Duration::from_millis(1500);
/// What became of the board meanwhile shows so soon after the return: its next heartbeat or its first refusal tells.
const SHOWN_WITHIN: Duration = Duration::from_millis(2500);
/// While nothing at all is due.
const NOTHING_DUE: Duration = Duration::from_secs(3600);

impl Session {
    pub(super) fn went_away(&mut self) {
        self.away_since = Some(Instant::now());
    }

    /// What was said last may not have reached anybody: all of it is said again, with as much patience as at first.
    pub(super) fn came_back(&mut self, lasted: Duration) {
        let now = Instant::now();
        self.away_since = None;
        self.interrupted = self.session.map(|_| (lasted, now));
        for pending in &mut self.pending {
            (pending.due, pending.since) = (now, (pending.since + lasted).min(now));
            pending.asked = pending.asked.min(1);
        }
        if let Some(greeting) = &mut self.greeting {
            (greeting.due, greeting.since) = (now, (greeting.since + lasted).min(now));
        }
        (self.heard, self.beat, self.keep_alive_due) = (now, now, now);
        // Nobody has read of the ones before: one more tells him nothing new.
        let _ = self.absences.try_send(LinkAbsence { name: self.link.name(), lasted });
    }

    pub(super) fn away_due(&self, since: Instant) -> Instant {
        let wait = if self.session.is_some() { SESSION_KEPT } else { NOTHING_DUE };
        since + wait
    }

    pub(super) fn still_away(&mut self, since: Instant, now: Instant) {
        if self.session.is_some() && now >= since + SESSION_KEPT {
            self.session = None;
            self.fail_all(&BoardError::Away { name: self.link.name() });
        }
    }

    /// Why nothing can be asked.
    pub(super) fn no_session(&self) -> BoardError {
        match self.away_since {
            Some(_) => BoardError::Away { name: self.link.name() },
            None => BoardError::SessionEnded,
        }
    }

    /// The board's watchdog ended the session; after an absence it had to.
    pub(super) fn watchdog_ended(&self) -> BoardError {
        self.interrupted_by("its watchdog ended the session").unwrap_or(BoardError::SessionEnded)
    }

    /// A board that restarts while nobody hears it may have lost its power with the plug: that says nothing of the
    /// item that was asked for last.
    pub(super) fn restarted_while_away(&self) -> Option<BoardError> {
        self.interrupted_by("the board restarted")
    }

    fn interrupted_by(&self, meanwhile: &'static str) -> Option<BoardError> {
        let (lasted, _) = self.interrupted.filter(|(_, back)| back.elapsed() < SHOWN_WITHIN)?;
        Some(BoardError::Interrupted { name: self.link.name(), lasted, meanwhile })
    }
}
