//! A request from its first transmission to its end, and what is remembered of it.

use gnc_protocol::Payload;
use gnc_protocol::message::{Abort, Call as _, MakeSafe};
use gnc_protocol::serial::LineCounters;
use gnc_protocol::slave::{KEPT_RESULTS, MAX_RUNNING};
use tokio::sync::{oneshot, watch};
use tokio::time::Instant;

use super::Answer;
use crate::error::BoardError;
use crate::status::Advance;

/// Requests that may end while another one is unresolved. After so many the station asks the board about the unresolved
/// one, and begins nothing new until the board has answered. Requests that are in flight then may still end. The
/// board's memory must hold the results of all of them; otherwise a request whose result was lost would run a second
/// time.
pub(super) const ENDED_SINCE: u32 = (KEPT_RESULTS - MAX_RUNNING) as u32;

pub(super) type AnswerSender = oneshot::Sender<Result<Answer, BoardError>>;

/// A request that waits for its result.
#[derive(Debug)]
pub(super) struct Pending {
    pub(super) request: u16,
    pub(super) message: u16,
    pub(super) what: &'static str,
    pub(super) payload: Box<Payload>,
    pub(super) answer: AnswerSender,
    pub(super) advance: watch::Sender<Advance>,
    pub(super) asked: u32,
    pub(super) since: Instant,
    pub(super) due: Instant,
    /// All times it was sent, which `asked` forgets when the board shows that the request runs.
    pub(super) sendings: Sendings,
    /// When the board showed last that the request runs: by ACCEPT or PROGRESS.
    pub(super) runs: Option<Instant>,
    /// What the line had lost when it was first sent, and when the board last showed that it runs.
    pub(super) lost_before: LineCounters,
    pub(super) lost_at_run: LineCounters,
    pub(super) expected_ms: u32,
    /// Requests that ended since this one was last known to run.
    pub(super) ended_since: u32,
    /// Whether the board is asked about this request only because of `ended_since`.
    pub(super) inquiry: bool,
}

impl Pending {
    /// Whether the request may have ended so long ago that the board soon forgets its result.
    pub(super) fn is_in_doubt(&self) -> bool {
        self.asked > 0 && self.ended_since >= ENDED_SINCE && !self.answer.is_closed()
    }

    /// Whether the request is not begun and may wait until nothing is in doubt. Requests that make the module safe
    /// never wait.
    pub(super) fn can_be_held_back(&self) -> bool {
        self.asked == 0 && self.message != MakeSafe::ID && self.message != Abort::ID
    }
}

/// How often a request was sent and answered.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sendings {
    pub(super) sent: u32,
    pub(super) first: Instant,
    pub(super) last: Instant,
    /// ACCEPTs, NAKs, and RESULTs that came without ACCEPT.
    pub(super) answers: u32,
    pub(super) first_answer: Option<Instant>,
}

/// A request that has ended: answers to it may still come.
#[derive(Debug)]
pub(super) struct Ended {
    pub(super) id: (u16, u16),
    pub(super) sendings: Sendings,
}
