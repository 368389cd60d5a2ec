//! Handles a lost session: finds the cause, decides what runs again, and begins a new session.

use futures_util::future::FutureExt as _;
use futures_util::stream::StreamExt as _;
use gnc_board::{BoardClient, BoardError, LinkAbsence};
use gnc_executive::event::{AttemptError, EventKind, NoteLevel};
use gnc_executive::outcome::Outcome;
use gnc_link::RETURNS_WITHIN;
use gnc_records::store::StoreError;
use gnc_text::with_causes;

use super::{End, Flight, Landed, Run};
use crate::procedure::ProcedureError;

impl Run<'_> {
    /// The session is gone, and with it the work of all items in flight. The culprit is the item whose request was in
    /// flight when the board restarted; the others run again. If there is not exactly one such item, all run again, one
    /// by one, so that the culprit shows.
    pub(super) async fn lost_session<'b>(
        &'b self,
        board: &'b BoardClient,
        first: Landed,
        flight: &mut Flight<'b>,
    ) -> Result<(), StoreError> {
        let mut ended = vec![first];
        while let Some(Some(landed)) = flight.next().now_or_never() {
            ended.push(landed);
        }
        flight.clear();
        self.live.doing.send_replace(Vec::new());
        self.live.line_lost.send_replace(true);
        let restarted = |landed: &Landed, only_asked: bool| matches!(&landed.end, End::Done(Err(ProcedureError::Board(BoardError::Restarted { asked, .. }))) if *asked || !only_asked);
        let any_restart = ended.iter().any(|landed| restarted(landed, false));
        let suspects: Vec<usize> = match ended.iter().filter(|landed| restarted(landed, true)).count() {
            0 => ended.iter().filter(|landed| restarted(landed, false)).map(|landed| landed.position).collect(),
            _ => ended.iter().filter(|landed| restarted(landed, true)).map(|landed| landed.position).collect(),
        };
        let culprit = match (any_restart, suspects.as_slice()) {
            (true, [one]) => Some(*one),
            (true, _) => None,
            // Without a restart, the first item that noticed the loss reports the fault of the line.
            (false, _) => ended.first().map(|landed| landed.position),
        };
        let absence = ended.iter().find_map(absence);
        if any_restart {
            self.unexplained_restart.set(culprit.is_none());
            self.one_by_one.set(self.one_by_one.get() || culprit.is_none());
        }
        let text = ended.first().map(|landed| match &landed.end {
            End::Done(Err(trouble)) => with_causes(trouble),
            _ => String::new(),
        });
        for landed in &ended {
            let Some(item) = self.job().item(landed.position) else { continue };
            let trouble = match &landed.end {
                End::Done(done) => done.as_ref().err(),
                End::Stopped(asked) => {
                    self.stop_in_order(*asked).await?;
                    self.end_attempt(landed, Outcome::Aborted, None).await?;
                    continue;
                }
                End::GivenUp => {
                    self.end_attempt(landed, Outcome::Aborted, None).await?;
                    continue;
                }
            };
            // An attempt that ended by itself in the same moment has its own verdict.
            let own = trouble.is_none_or(session_lives) || Some(landed.position) == culprit;
            if own {
                let (outcome, error) = self.judged(landed, item, trouble);
                self.end_attempt(landed, outcome, error).await?;
            } else {
                self.end_attempt(landed, Outcome::Errored, Some(spoilt(text.as_deref()))).await?;
            }
        }
        self.end_spoilt_items(text.as_deref()).await?;
        let name = culprit.and_then(|position| self.job().item(position)).map(|item| item.name.clone());
        if let Some(error @ BoardError::Away { .. }) = absence {
            let wait_s = RETURNS_WITHIN.as_secs();
            let text = format!("{error}; {}: the run waits at most {wait_s} s for it", error.try_this());
            self.note(NoteLevel::Warning, text, None).await?;
        }
        self.recover(board, name.filter(|_| any_restart), absence.is_some(), any_restart).await
    }

    /// Files that the port or interface was away.
    pub(super) async fn was_away(&self, absent: &LinkAbsence) -> Result<(), StoreError> {
        let text = format!("{} went away; back after {:.1} s", absent.name, absent.lasted.as_secs_f64());
        self.note(NoteLevel::Warning, text, None).await
    }

    /// Files all absences that were not filed yet.
    pub(super) async fn tell_absences(&self, board: &BoardClient) -> Result<(), StoreError> {
        while let Some(Some(absent)) = board.absence().now_or_never() {
            self.was_away(&absent).await?;
        }
        Ok(())
    }

    /// Ends attempts that were in flight and did not notice the loss yet.
    async fn end_spoilt_items(&self, text: Option<&str>) -> Result<(), StoreError> {
        let running: Vec<(String, u32)> = self.journal.look(|state| {
            let rows = state.rows().iter().filter(|row| row.running().is_some());
            rows.map(|row| (row.planned.name.clone(), row.attempts.len() as u32)).collect()
        });
        for (item, attempt) in running {
            let error = Some(spoilt(text));
            self.journal.emit(EventKind::AttemptEnded { item, attempt, outcome: Outcome::Errored, error }).await?;
        }
        Ok(())
    }

    /// Begins a new session. After a lost session the state of the board is unknown: a new session makes it safe and
    /// starts clean. A board that restarted while its port was away restarted with it, so there is no other culprit.
    async fn recover(
        &self,
        board: &BoardClient,
        culprit: Option<String>,
        absence: bool,
        restarted: bool,
    ) -> Result<(), StoreError> {
        let before = board.hello().boot_id;
        let reopened = tokio::select! {
            biased;
            asked = self.control.asked_times(1), if self.control.asked().times == 0 => Err(asked),
            reopened = board.reopen(self.nonce()) => Ok(reopened),
        };
        self.tell_absences(board).await?;
        self.records_read.set(0);
        self.unfiled.borrow_mut().clear();
        match reopened {
            Err(asked) => self.stop_in_order(asked).await,
            Ok(Err(error)) => {
                self.link_lost.set(true);
                self.note(NoteLevel::Error, format!("{}; {}", with_causes(&error), error.try_this()), None).await
            }
            Ok(Ok(boot_id)) => {
                self.live.line_lost.send_replace(false);
                if boot_id != before || restarted {
                    if culprit.is_none() && !absence {
                        // Also if the line hid the restart: the request that caused it stays unknown, unless it happens
                        // again.
                        self.unexplained_restart.set(true);
                        self.one_by_one.set(true);
                    }
                    let (item, boot_id) = (culprit.clone(), format!("{boot_id:08x}"));
                    self.journal.emit(EventKind::BoardRebooted { item, boot_id }).await?;
                }
                if self.control.asked().times > 0 {
                    // After a stop the module must not be switched on again.
                    return Ok(());
                }
                let on = self.power_on(board, culprit.as_deref()).await?;
                self.link_lost.set(!on && self.control.asked().times == 0);
                Ok(())
            }
        }
    }
}

/// The absence of the port or interface that ended an attempt.
fn absence(landed: &Landed) -> Option<&BoardError> {
    match &landed.end {
        End::Done(Err(ProcedureError::Board(error))) if error.is_absence() => Some(error),
        _ => None,
    }
}

pub(super) fn session_lives(trouble: &ProcedureError) -> bool {
    !matches!(
        trouble,
        ProcedureError::Board(
            BoardError::Gone { .. }
                | BoardError::Away { .. }
                | BoardError::Interrupted { .. }
                | BoardError::NoAnswer { .. }
                | BoardError::Garbled { .. }
                | BoardError::Silent { .. }
                | BoardError::NoHeartbeat { .. }
                | BoardError::Restarted { .. }
                | BoardError::SessionEnded { .. }
        )
    )
}

/// The error of an attempt that the trouble of another one ended.
pub(super) fn spoilt(text: Option<&str>) -> AttemptError {
    let text = format!("another item's error ended this attempt: {}", text.unwrap_or_default());
    AttemptError { text, hint: "the station runs the item again as soon as the board answers".into(), again: true }
}
