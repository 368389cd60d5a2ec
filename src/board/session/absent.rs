//! The port or interface is away: no wait runs out meanwhile, and the station keeps the board's session for as long as
//! the board's watchdog may have kept it.

use std::time::Duration;

use tokio::time::Instant;

use super::Session;
use crate::error::BoardError;
use crate::status::LinkAbsence;

/// The longest absence that the session may survive. The board's watchdog ends the session 1.75 s after the last
/// keep-alive, which may be half a second old when the port goes away. Requests made meanwhile wait.
const SESSION_KEPT: Duration = Duration::from_millis(1500);
/// Time after the return in which the board shows what became of it: by its next heartbeat or its first refusal.
const SHOWN_WITHIN: Duration = Duration::from_millis(2500);
/// The wait while nothing at all is due.
const NOTHING_DUE: Duration = Duration::from_secs(3600);

impl Session {
    pub(super) fn went_away(&mut self) {
        self.away_since = Some(Instant::now());
    }

    /// The last messages may be lost, so the station sends all of them again, with as many tries as at first.
    pub(super) fn came_back(&mut self, lasted: Duration) {
        let now = Instant::now();
        self.away_since = None;
        self.audit.was_blind(now);
        self.interrupted = self.session.map(|_| (lasted, now));
        for pending in &mut self.pending {
            (pending.due, pending.since) = (now, (pending.since + lasted).min(now));
            pending.asked = pending.asked.min(1);
        }
        if let Some(greeting) = &mut self.greeting {
            (greeting.due, greeting.since) = (now, (greeting.since + lasted).min(now));
        }
        (self.heard, self.beat, self.keep_alive_due) = (now, now, now);
        // If the queue is full, the reader has not read the earlier absences, and one more tells nothing new.
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

    /// Why no request can be made.
    pub(super) fn no_session(&self) -> BoardError {
        match self.away_since {
            Some(_) => BoardError::Away { name: self.link.name() },
            None => BoardError::SessionEnded { early: None },
        }
    }

    /// The error when the board's watchdog ended the session. After an absence this is expected.
    pub(super) fn watchdog_ended(&self, early: Option<Duration>) -> BoardError {
        self.interrupted_by("its watchdog ended the session").unwrap_or(BoardError::SessionEnded { early })
    }

    /// A board that restarts while the port is away may have lost its power with the plug. That says nothing of the
    /// item that made the last request.
    pub(super) fn restarted_while_away(&self) -> Option<BoardError> {
        self.interrupted_by("the board restarted")
    }

    fn interrupted_by(&self, meanwhile: &'static str) -> Option<BoardError> {
        let (lasted, _) = self.interrupted.filter(|(_, back)| back.elapsed() < SHOWN_WITHIN)?;
        Some(BoardError::Interrupted { name: self.link.name(), lasted, meanwhile })
    }
}
