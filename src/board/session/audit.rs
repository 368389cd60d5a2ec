//! Holds what the board says against the interface document.

use std::collections::VecDeque;
use std::time::Duration;

use gnc_protocol::message::{Heartbeat, StreamStopReply};
use gnc_protocol::serial::LineCounters;
use gnc_protocol::stream::{StreamHead, StreamId};
use gnc_protocol::{Header, Kind, PROTOCOL_VERSION, timing};
use tokio::time::Instant;

use crate::breach::{Breaches, Case, Rule, rule};

/// Requests whose numbers the station remembers: an answer to one of these was asked for once.
const ASKED: usize = 1024;
/// Steps back of a sequence number that a line which doubles frames, or hands them on in another order, may make.
const OVERTAKEN: u16 = 16;
/// Frames in a row with one sequence number after which the board does not count them.
const SAME: u32 = 3;
/// What an USB adapter and this computer may add to the time of an answer.
const HOST_ADDS: Duration = Duration::from_millis(40);
/// A heartbeat may be early or late by this much: what the adapter adds, and half of a frame that is in its way.
const BEAT_OFF: Duration = Duration::from_millis(250);
/// PROGRESS may be late by this much.
const PROGRESS_OFF: Duration = Duration::from_millis(250);
/// Time after a change for which a heartbeat may still show what was before.
const SHOWN_AFTER: Duration = Duration::from_millis(1500);
/// The watchdog may be early by this much, since a request may have been on its way for some time.
const WATCHDOG_OFF: Duration = Duration::from_millis(150);
/// Bits of [`Heartbeat::state`].
const SESSION_OPEN: u8 = 1 << 0;
const POWERED: u8 = 1 << 1;

/// What the conversation knows of the board's manners.
#[derive(Debug)]
pub(super) struct Audit {
    breaches: Breaches,
    asked: VecDeque<u16>,
    /// The sequence number that is due, and how many frames in a row had the number before it.
    sequence: Option<(u16, u32)>,
    beat: Option<Instant>,
    /// The station was not at its work until then, so times up to then say nothing of the board.
    blind_until: Option<Instant>,
    /// Whether the module is under power by what the board was told and said, and since when.
    powered: Option<(bool, Instant)>,
    /// When the session began.
    opened: Option<Instant>,
    /// The newest moment at which the station sent something that the board then answered.
    heard_us: Option<Instant>,
    /// Whether sequence numbers count all frames of the link. On CAN each id has its own, and samples have none.
    numbered: bool,
    /// The streams since the session began.
    runs: Vec<StreamRun>,
}

/// A stream that was started.
#[derive(Debug)]
struct StreamRun {
    id: StreamId,
    runs: bool,
    /// The number after the last sample that came, and what the board had dropped then.
    end: u32,
    dropped: u32,
    /// What the line had lost when the stream began.
    before: LineCounters,
}

impl Audit {
    pub(super) fn new(breaches: Breaches, numbered: bool) -> Self {
        Self {
            breaches,
            asked: VecDeque::new(),
            sequence: None,
            beat: None,
            blind_until: None,
            powered: None,
            opened: None,
            heard_us: None,
            numbered,
            runs: Vec::new(),
        }
    }

    pub(super) fn see(&self, rule: &'static Rule, case: Case) {
        self.breaches.see(rule, case);
    }

    /// The station did not read the line, or was not served by this computer, until now.
    pub(super) fn was_blind(&mut self, now: Instant) {
        self.blind_until = Some(now);
    }

    /// The time from `since` to `now`, unless the station was blind in it.
    fn span(&self, since: Instant, now: Instant) -> Option<Duration> {
        self.blind_until.is_none_or(|until| until < since).then(|| now.saturating_duration_since(since))
    }

    /// The station sends a request.
    pub(super) fn asks(&mut self, request: u16) {
        if self.asked.back() != Some(&request) {
            self.asked.push_back(request);
            if self.asked.len() > ASKED {
                self.asked.pop_front();
            }
        }
    }

    /// Looks at a frame's header. `false`: the frame is of another version and must be dropped.
    pub(super) fn header(&mut self, header: &Header) -> bool {
        if self.numbered {
            self.number(header);
        }
        let Header { version, kind, request, .. } = *header;
        match kind {
            Kind::Hello if version != 0 => self.see(&rule::HELLO_VERSION, Case::Words(format!("version {version}"))),
            Kind::Hello => {}
            _ if version != PROTOCOL_VERSION => {
                self.see(&rule::VERSION, Case::Words(format!("version {version}, in force is {PROTOCOL_VERSION}")));
                return false;
            }
            Kind::Stream | Kind::Event if request != 0 => {
                self.see(&rule::REQUEST_ID, Case::Words(format!("request {request}")));
            }
            Kind::Accept | Kind::Progress | Kind::Result | Kind::Nak if !self.asked.contains(&request) => {
                self.see(&rule::UNASKED, Case::Words(format!("request {request}")));
            }
            _ => {}
        }
        true
    }

    fn number(&mut self, header: &Header) {
        let Header { kind, sequence, .. } = *header;
        let due = self.sequence.filter(|_| kind != Kind::Hello);
        let Some((due, same)) = due else {
            self.sequence = Some((sequence.wrapping_add(1), 1));
            return;
        };
        let back = due.wrapping_sub(sequence);
        let same = if back == 1 { same + 1 } else { 1 };
        if same == SAME {
            self.see(&rule::SEQUENCE_STANDS, Case::Words(format!("{sequence} three times in a row")));
        } else if back > OVERTAKEN && back < 0x8000 {
            self.see(&rule::SEQUENCE_BACK, Case::Words(format!("from {} to {sequence}", due.wrapping_sub(1))));
        }
        self.sequence = Some((sequence.wrapping_add(1), same));
    }

    /// The board restarted, or a new session begins: numbers and times begin anew.
    pub(super) fn begins_anew(&mut self) {
        (self.sequence, self.beat, self.powered, self.opened, self.heard_us) = (None, None, None, None, None);
        self.runs.clear();
    }

    /// The board answered HELLO: the session is open, and its module is without power.
    pub(super) fn session_opened(&mut self, now: Instant, switches: bool) {
        self.begins_anew();
        self.opened = Some(now);
        self.powered = switches.then_some((false, now));
    }

    /// The board answered something that the station sent at `asked`, for the first time at `since`.
    pub(super) fn answered(&mut self, asked: Instant) {
        self.heard_us = self.heard_us.max(Some(asked));
    }

    /// Compares the time of the first answer to something that was sent once with what the document allows: 50 ms, and
    /// the time on the wire.
    pub(super) fn took(&self, rule: &'static Rule, asked: Instant, wire: Duration, now: Instant) {
        let Some(took) = self.span(asked, now) else { return };
        if took > timing::ACCEPT_WITHIN + wire + HOST_ADDS {
            self.see(rule, Case::Took(took));
        }
    }

    /// An accepted request shows that it runs, by PROGRESS or by its result.
    pub(super) fn progressed(&self, before: Instant, now: Instant) {
        let Some(gap) = self.span(before, now) else { return };
        if gap > timing::PROGRESS_EVERY + PROGRESS_OFF {
            self.see(&rule::PROGRESS_LATE, Case::Took(gap));
        }
    }

    /// The module's supply was switched, by the board's own answer.
    pub(super) fn switched(&mut self, on: bool, now: Instant) {
        if self.powered.is_some_and(|(before, _)| before != on) {
            self.powered = Some((on, now));
        }
    }

    /// The board has started a stream.
    pub(super) fn started(&mut self, id: StreamId, counters: LineCounters) {
        self.runs.retain(|run| run.id != id);
        self.runs.push(StreamRun { id, runs: true, end: 0, dropped: 0, before: counters });
    }

    /// All streams have ended: the module is without power.
    pub(super) fn streams_ended(&mut self) {
        self.runs.iter_mut().for_each(|run| run.runs = false);
    }

    /// A frame of a stream came. `starting`: the RESULT of its StreamStart has not come.
    pub(super) fn frame(&mut self, id: StreamId, head: &StreamHead, starting: bool) {
        match self.runs.iter_mut().find(|run| run.id == id && run.runs) {
            Some(run) => {
                run.end = run.end.max(head.first.saturating_add(head.count.into()));
                run.dropped = run.dropped.max(head.dropped);
            }
            None if starting => self.see(&rule::STREAM_EARLY, Case::Words(id.name().to_owned())),
            None => self.see(&rule::STREAM_UNASKED, Case::Words(id.name().to_owned())),
        }
    }

    /// The board has stopped a stream. Returns why its account cannot be, if it cannot.
    pub(super) fn stopped(&mut self, id: StreamId, reply: &StreamStopReply, counters: LineCounters) -> Option<String> {
        let StreamStopReply { produced, dropped } = *reply;
        let run = self.runs.iter_mut().find(|run| run.id == id)?;
        run.runs = false;
        let (end, dropped_before) = (run.end, run.dropped);
        if produced < end {
            return Some(format!("{} came up to sample {end}, of {produced} produced", id.name()));
        }
        if dropped < dropped_before {
            return Some(format!("{dropped} samples of {} dropped, after {dropped_before} before", id.name()));
        }
        // On CAN the line can lose samples without a trace in the counters.
        let lost = |counters: LineCounters| (counters.missing, counters.bad_checksum, counters.malformed);
        let most = end.saturating_add(dropped - dropped_before);
        if self.numbered && lost(counters) == lost(run.before) && produced > most {
            let not_sent = produced - most;
            return Some(format!(
                "{not_sent} of {produced} samples of {} never came, and no frame is missing",
                id.name()
            ));
        }
        None
    }

    /// A heartbeat of the session.
    pub(super) fn beat(&mut self, beat: &Heartbeat, now: Instant) {
        if let Some(gap) = self.beat.and_then(|before| self.span(before, now)) {
            if gap > timing::HEARTBEAT_EVERY + BEAT_OFF {
                self.see(&rule::HEARTBEAT_LATE, Case::Took(gap));
            } else if gap + BEAT_OFF < timing::HEARTBEAT_EVERY {
                self.see(&rule::HEARTBEAT_EARLY, Case::OnlyTook(gap));
            }
        }
        self.beat = Some(now);
        let shown = |since: Instant| self.span(since, now).is_some_and(|span| span > SHOWN_AFTER);
        if self.opened.is_some_and(shown)
            && beat.state & SESSION_OPEN == 0
            && self.heard_us.is_some_and(|heard| now.saturating_duration_since(heard) < SHOWN_AFTER)
        {
            self.see(&rule::STATE_SESSION, Case::Plain);
        }
        match self.powered.filter(|(_, since)| shown(*since)) {
            Some((false, _)) if beat.state & POWERED != 0 => self.see(&rule::STATE_POWERED, Case::Plain),
            Some((true, _)) if beat.state & POWERED == 0 => self.see(&rule::STATE_UNPOWERED, Case::Plain),
            _ => {}
        }
    }

    /// The board's watchdog ended the session. It may do so only if it heard nothing for its time; an answer shows what
    /// it heard.
    pub(super) fn watchdog(&self, now: Instant) {
        let Some(quiet) = self.heard_us.and_then(|heard| self.span(heard, now)) else { return };
        if quiet + WATCHDOG_OFF < timing::WATCHDOG {
            self.see(&rule::WATCHDOG_EARLY, Case::OnlyTook(quiet));
        }
    }
}
