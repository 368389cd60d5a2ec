//! One attempt of an item, from its first request to its end.

use std::cell::Cell;

use gnc_analysis::figures::Findings;
use gnc_analysis::host_clock::HostClock;
use gnc_board::latest::Follower;
use gnc_board::{Advance, BoardClient, BoardLease, BoardTime};
use gnc_executive::catalogue::Resource;
use gnc_executive::plan::{Phase, PlanItem};
use gnc_executive::state::Row;
use gnc_protocol::message::ModulePower;
use tokio::sync::watch;
use tokio::time::Instant;

use super::recovery::session_lives;
use super::standstill::Standstill;
use super::{Doing, End, Landed, Run};
use crate::guidance::Guide;
use crate::procedure::{self, AttemptClock, ProcedureContext, ProcedureError};
use crate::recorder::Recorder;
use crate::turntable;

impl Run<'_> {
    pub(super) async fn attempt(
        &self,
        board: &BoardClient,
        position: usize,
        item: &PlanItem,
        attempt: u32,
        earlier: Vec<(String, Findings)>,
    ) -> Landed {
        let (sender, advance) = watch::channel(Advance::default());
        let (guide, guidance) = Guide::new(self.live.readings.receiver_count() > 0);
        let doing = Doing { item: item.name.clone(), attempt, began: Instant::now(), advance, guidance };
        self.live.doing.send_modify(|live| live.push(doing));
        let lease = BoardLease::new(board, sender);
        let recorder = Recorder::new(self.journal, item, attempt, &self.order.header.serial_number);
        // After a stop only teardown items run, and only a second stop ends those.
        let mixed = Cell::new(false);
        let may_stop = item.phase != Phase::Teardown;
        let still = Standstill::new();
        let end = tokio::select! {
            biased;
            asked = self.control.asked_times(1), if may_stop => End::Stopped(asked),
            () = self.control.given_up(&item.name) => End::GivenUp,
            done = self.procedure((&lease, &guide, &mixed), board, item, attempt, &recorder, earlier) => End::Done(done),
            never = still.watch() => match never {},
        };
        // A simulated bench at another speed stands still when the station does.
        let stood = still.longest().filter(|_| host_clock(&self.order.header.bench).is_ok());
        let end = match (end, lease.broken_stream()) {
            (End::Done(Ok(())), Some(broken)) => End::Done(Err(broken.into())),
            (end, _) => end,
        };
        let uses = |resource| item.id.spec().resources.contains(&resource);
        if uses(Resource::Attitude) && !matches!(end, End::Done(Ok(()))) {
            // Stop the table before anything else: a person may have hands on it.
            turntable::stop_at_once(&self.order.fixture);
        }
        let left_behind = match &end {
            End::Done(Err(trouble)) => session_lives(trouble),
            End::GivenUp => true,
            End::Done(Ok(())) | End::Stopped(_) => false,
        };
        if left_behind {
            tokio::select! {
                biased;
                _ = self.control.asked_times(1) => {}
                () = lease.clear() => {}
            }
            if uses(Resource::Power) && lease.switches_supply() {
                // The item may have left the module without power. If it stays off, the next item finds out.
                let _ = lease.call(&ModulePower { on: 1 }).await;
            }
        }
        self.live.doing.send_modify(|live| live.retain(|doing| doing.item != item.name));
        let (requests, busy) = (lease.requests(), lease.busy());
        let (streams, refusals) = lease.listened();
        Landed { position, attempt, end, requests, streams, refusals, busy, mixed: mixed.get(), stood }
    }

    async fn procedure(
        &self,
        (lease, guide, mixed): (&BoardLease<'_>, &Guide, &Cell<bool>),
        board: &BoardClient,
        item: &PlanItem,
        attempt: u32,
        recorder: &Recorder<'_>,
        earlier: Vec<(String, Findings)>,
    ) -> Result<(), ProcedureError> {
        let clock = AttemptClock::default();
        let bench = ProcedureContext {
            board: lease,
            fixture: &self.order.fixture,
            answers: &self.order.answers,
            site: self.order.site.as_ref(),
            can: self.order.can.as_ref(),
            is_real: self.is_real(),
            module: &self.module,
            earlier,
            resumed: self.order.resumed.as_ref().filter(|_| attempt == 1),
            heat: &self.heat,
            clock: &clock,
            mixed,
            guide,
            host_clock: host_clock(&self.order.header.bench),
        };
        if let (Some(prompt), 1) = (&item.prompt, attempt) {
            let is_captured = match bench.resumed {
                Some(resumed) => procedure::is_captured(item, resumed).await,
                None => false,
            };
            if !is_captured {
                bench.fixture.prompt(prompt, recorder).await?;
            }
        }
        let all_repeats = async {
            for repeat in 1..=item.repeats {
                recorder.begin_repeat(repeat);
                procedure::run(item.id, &bench, &item.params, recorder).await?;
            }
            Ok(())
        };
        tokio::select! {
            biased;
            done = all_repeats => done,
            () = board_time_up(board.board_time(), item.timeout_s, &clock) => Err(ProcedureError::TookTooLong { limit_s: item.timeout_s }),
        }
    }

    /// Findings of the items that have ended, in the order of the plan.
    pub(super) fn earlier(&self) -> Vec<(String, Findings)> {
        self.journal.look(|state| newest(state.found()))
    }
}

/// The newest findings of each item that has ended. Later items use their details.
fn newest<'a>(ended: impl Iterator<Item = &'a Row>) -> Vec<(String, Findings)> {
    let of = |row: &Row| {
        let details = row.attempts.iter().rev().find_map(|attempt| attempt.details.last())?.clone();
        Some((row.planned.name.clone(), details.into()))
    };
    ended.filter_map(of).collect()
}

/// A simulated bench runs at the pace of the host's clock only at true speed.
fn host_clock(bench: &gnc_executive::event::BenchInfo) -> HostClock {
    match bench.speed.as_deref() {
        None => Ok(()),
        Some(speed) if speed.parse() == Ok(1.0) => Ok(()),
        Some(speed) => Err(format!("simulated at speed {speed}: the host's clock cannot check the board's clock")),
    }
}

/// Ends when the board's clock has gone on by this time since its next heartbeat. The last heartbeat does not tell the
/// present board time: at full speed the simulated board has gone on by many minutes since. A wait for the module's heat is no time
/// of the item.
async fn board_time_up(mut board_time: Follower<BoardTime>, limit_s: f64, clock: &AttemptClock) {
    let mut began_us = None;
    loop {
        let Some(now) = board_time.changed().await else {
            // The conversation has ended; the procedure notices it by itself.
            return std::future::pending().await;
        };
        if now.beats == 0 {
            continue;
        }
        let began_us = *began_us.get_or_insert(now.board_time_us);
        let took_us = now.board_time_us.saturating_sub(began_us).saturating_sub(clock.waited_us());
        if !clock.stands() && took_us as f64 * 1e-6 > limit_s {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use gnc_executive::catalogue::ItemId;
    use gnc_executive::event::PlannedItem;
    use gnc_executive::outcome::Outcome;
    use gnc_executive::state::{Attempt, Stamp};
    use serde_json::json;

    use super::*;

    /// An item whose attempts found these numbers, round by round.
    fn row(name: &str, found: &[&[u32]]) -> Row {
        let now = Stamp { at: chrono::DateTime::UNIX_EPOCH.fixed_offset(), elapsed_us: 0 };
        let attempt = |rounds: &&[u32]| Attempt {
            started: now,
            ended: Some(now),
            outcome: Some(Outcome::Errored),
            measurements: Vec::new(),
            details: rounds.iter().map(|round| json!({ "found": round }).into()).collect(),
            error_records: Vec::new(),
            error: None,
        };
        Row {
            planned: PlannedItem {
                name: name.to_owned(),
                id: ItemId::SixPosition,
                title: name.to_owned(),
                phase: Phase::Test,
                optional: false,
                selected: true,
            },
            outcome: Outcome::Passed,
            cause: None,
            attempts: found.iter().map(attempt).collect(),
            started: Some(now),
            ended: Some(now),
        }
    }

    #[test]
    fn later_items_use_what_an_item_found_last() {
        let rows = [
            row("twice", &[&[1, 2], &[3, 4]]),
            row("refused at last", &[&[5, 6], &[]]),
            row("found nothing", &[&[], &[]]),
        ];
        let found = newest(rows.iter());
        let told: Vec<_> = found.iter().map(|(name, findings)| (name.as_str(), &findings.details["found"])).collect();
        assert_eq!(told, [("twice", &json!(4)), ("refused at last", &json!(6))]);
    }
}
