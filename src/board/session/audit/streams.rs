//! Holds the samples of streams against the interface document: their numbers, times and accounts.

use std::time::Duration;

use gnc_protocol::message::{StreamStart, StreamStartReply, StreamStopReply};
use gnc_protocol::serial::LineCounters;
use gnc_protocol::stream::{StreamHead, StreamId};
use tokio::time::Instant;

use super::Audit;
use crate::breach::Case;
use crate::rule;

/// Share of samples that may equal the one before by chance, on CAN with its larger steps; share from which on a sensor is
/// dead; and samples after which the shares mean something.
const REPEATED_PERCENT: u64 = 5;
const REPEATED_ON_CAN_PERCENT: u64 = 20;
const DEAD_PERCENT: u64 = 90;
const REPEATS_FROM: u64 = 200;
/// Samples wait for less than a second, so most of a board's time since its start lies before them once it runs for this
/// long.
const BEHIND_FROM_US: u64 = 2_000_000;
const BEHIND_TIMES: u64 = 10;
/// Board time of samples may be ahead of a heartbeat by this much.
const AHEAD_US: u64 = 1_000_000;
/// The numbers of captures on CAN begin anew after so many, those of bytes later.
const TURN: u32 = 1 << 8;
/// Samples may come for this long after the RESULT of StreamStop: on CAN they have the lowest priority.
const BEHIND_STOP: Duration = Duration::from_millis(500);

/// A stream that was started.
#[derive(Debug)]
pub(super) struct StreamRun {
    id: StreamId,
    runs: bool,
    /// Whether the RESULT of its StreamStart has not come.
    is_early: bool,
    /// The number after the last sample that came, and what the board had dropped then.
    end: u32,
    dropped: u32,
    /// What the line had lost when the last frame came.
    before: LineCounters,
    /// Samples that were asked for, 0 for any number.
    count: u32,
    /// Samples in each frame but the last one, 0 for any number, and those of the last frame.
    a_frame: u16,
    last_frame: Option<u16>,
    /// When the board had stopped it.
    stopped: Option<Instant>,
    /// The newest board time of its samples.
    newest_us: u64,
    /// The last sample, the number of samples, the present row of samples that repeat it, and all of such rows that ended.
    last_sample: Box<[u8]>,
    samples: u64,
    row: u64,
    repeated: u64,
}

impl StreamRun {
    fn new(id: StreamId, before: LineCounters) -> Self {
        Self {
            id,
            runs: false,
            is_early: false,
            end: 0,
            dropped: 0,
            before,
            count: 0,
            a_frame: 0,
            last_frame: None,
            stopped: None,
            newest_us: 0,
            last_sample: Box::default(),
            samples: 0,
            row: 0,
            repeated: 0,
        }
    }
}

impl Audit {
    /// The board has started a stream; `before` is what the line had lost when it was asked to.
    pub(in crate::session) fn started(
        &mut self,
        id: StreamId,
        asked: &StreamStart,
        reply: &StreamStartReply,
        before: LineCounters,
    ) {
        let early = self.runs.iter().position(|run| run.id == id).map(|index| self.runs.swap_remove(index));
        let early = early.filter(|run| run.is_early);
        // On CAN the link puts the frames together.
        let a_frame = if self.numbered { reply.samples_per_frame.into() } else { 0 };
        let run = early.unwrap_or_else(|| StreamRun::new(id, before));
        self.runs.push(StreamRun { runs: true, is_early: false, count: asked.count, a_frame, ..run });
    }

    /// All streams have ended: the module is without power.
    pub(in crate::session) fn streams_ended(&mut self, now: Instant) {
        for run in self.runs.iter_mut().filter(|run| run.runs) {
            (run.runs, run.stopped) = (false, Some(now));
        }
    }

    /// A frame of a stream came. `starting`: the RESULT of its StreamStart has not come, and whether the line lost nothing since
    /// it was asked for. Returns why the frame cannot be.
    pub(in crate::session) fn frame(
        &mut self,
        id: StreamId,
        head: &StreamHead,
        starting: Option<bool>,
        counters: LineCounters,
        now: Instant,
    ) -> Option<String> {
        // Before the session, samples of an earlier program may still be on their way.
        self.opened?;
        let numbered = self.numbered;
        let name = || Case::Words(id.name().to_owned());
        if let Some(clean) = starting {
            if numbered && clean {
                self.see(&rule::STREAM_EARLY, name());
            }
            self.keep_early(id, head, counters);
            return None;
        }
        if !self.runs.iter().any(|run| run.id == id) {
            if numbered {
                self.see(&rule::STREAM_UNASKED, name());
            }
            return None;
        }
        let blind_until = self.blind_until;
        let run = self.runs.iter_mut().find(|run| run.id == id)?;
        let (before, end) = (run.end, head.first.saturating_add(head.count.into()));
        let on_board = head.dropped.saturating_sub(run.dropped);
        let gap = head.first.saturating_sub(before).saturating_sub(on_board);
        let lost = counters.lost() != run.before.lost();
        let a_frame = run.a_frame;
        let other_count = run.last_frame.filter(|last| a_frame > 0 && *last != a_frame);
        let beyond = run.count > 0 && end > run.count && before <= run.count;
        let late = run.stopped.is_some_and(|stopped| {
            now > stopped + BEHIND_STOP
                && blind_until.is_none_or(|until| until < stopped)
                && head.board_time_us > run.newest_us
        });
        (run.end, run.dropped) = (before.max(end), run.dropped.max(head.dropped));
        (run.before, run.last_frame) = (counters, Some(head.count));
        run.newest_us = run.newest_us.max(head.board_time_us);
        if let Some(last) = other_count {
            let words = format!("{}: {last} instead of {a_frame}", id.name());
            self.see(&rule::STREAM_COUNT, Case::Words(words));
        }
        // On CAN a frame that comes twice, or out of order, may be taken for a later one.
        if beyond && numbered {
            self.see(&rule::STREAM_LONG, name());
        }
        if late && numbered {
            self.see(&rule::STREAM_UNASKED, name());
        }
        (numbered && gap > 0 && !lost).then(|| {
            format!(
                "{gap} samples are missing before number {}, dropped does not count them, and no frame is missing",
                head.first
            )
        })
    }

    /// Keeps what came before the RESULT of StreamStart, which the line may have lost: its account goes on from there.
    fn keep_early(&mut self, id: StreamId, head: &StreamHead, counters: LineCounters) {
        if !self.runs.iter().any(|run| run.id == id && run.is_early) {
            self.runs.retain(|run| run.id != id);
            self.runs.push(StreamRun { is_early: true, ..StreamRun::new(id, counters) });
        }
        let Some(run) = self.runs.iter_mut().find(|run| run.id == id) else { return };
        run.end = run.end.max(head.first.saturating_add(head.count.into()));
        run.dropped = run.dropped.max(head.dropped);
        run.before = counters;
        run.newest_us = run.newest_us.max(head.board_time_us);
    }

    /// Counts the samples that repeat the one before on all channels. A sensor that has died repeats its last reading for
    /// ever; a board that hands readings on twice goes on with a new one, and says so by its capability. Returns what it
    /// does, if it does not say so.
    pub(in crate::session) fn repeats(&mut self, id: StreamId, sample_bytes: usize, samples: &[u8]) -> Option<String> {
        let least_percent = if self.numbered { REPEATED_PERCENT } else { REPEATED_ON_CAN_PERCENT };
        let run = self.runs.iter_mut().find(|run| run.id == id)?;
        for sample in samples.chunks_exact(sample_bytes) {
            run.samples += 1;
            if *sample == *run.last_sample {
                run.row += 1;
            } else {
                run.last_sample = sample.into();
                run.repeated += std::mem::take(&mut run.row);
            }
        }
        let StreamRun { samples, repeated, .. } = *run;
        let some = least_percent * samples < 100 * repeated && 100 * repeated < DEAD_PERCENT * samples;
        (samples >= REPEATS_FROM && some).then(|| format!("{repeated} of {samples} samples repeat the one before"))
    }

    /// The board has stopped a stream. Returns why its account cannot be, if it cannot.
    pub(in crate::session) fn stopped(
        &mut self,
        id: StreamId,
        reply: &StreamStopReply,
        counters: LineCounters,
        now: Instant,
    ) -> Option<String> {
        let StreamStopReply { produced, dropped } = *reply;
        let run = self.runs.iter_mut().find(|run| run.id == id)?;
        if std::mem::take(&mut run.runs) {
            run.stopped = Some(now);
        }
        let (end, dropped_before) = (run.end, run.dropped);
        let (count, long) = (run.count, run.count > 0 && produced > run.count && end <= run.count);
        if long {
            self.see(&rule::STREAM_LONG, Case::Words(format!("{}: {produced} of {count}", id.name())));
        }
        let run = self.runs.iter_mut().find(|run| run.id == id)?;
        // On CAN a doubled or overtaken frame may be taken for one of the next turn of the numbers.
        let is_turn = !self.numbered && (id == StreamId::Pps || end.saturating_sub(produced) >= TURN / 2);
        if produced < end && !is_turn {
            return Some(format!("{} came up to sample {end}, of {produced} produced", id.name()));
        }
        if dropped < dropped_before {
            return Some(format!("{dropped} samples of {} dropped, after {dropped_before} before", id.name()));
        }
        // On CAN the line can lose samples without a trace in the counters.
        let most = end.saturating_add(dropped - dropped_before);
        if self.numbered && counters.lost() == run.before.lost() && produced > most {
            let not_sent = produced - most;
            return Some(format!(
                "{not_sent} of {produced} samples of {} never came, and no frame is missing",
                id.name()
            ));
        }
        None
    }

    /// Whether samples are far behind the board's clock, whatever they waited for: their times are in another unit.
    pub(in crate::session) fn is_far_behind(sample_us: u64, beat_us: u64) -> bool {
        beat_us >= BEHIND_FROM_US && sample_us.saturating_mul(BEHIND_TIMES) < beat_us
    }

    /// Streams whose samples are of a time that the board's clock has not reached, and that time in microseconds.
    pub(in crate::session) fn ahead_of(&mut self, now_us: u64) -> Vec<(StreamId, u64)> {
        let ahead = |run: &&mut StreamRun| run.newest_us > now_us.saturating_add(AHEAD_US);
        let ahead = self.runs.iter_mut().filter(ahead);
        ahead.map(|run| (run.id, std::mem::take(&mut run.newest_us))).collect()
    }
}
