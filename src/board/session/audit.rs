//! Holds what the board says against the interface document.

mod streams;

use std::collections::VecDeque;
use std::time::Duration;

use gnc_protocol::frame::checksum;
use gnc_protocol::message::{Abort, Call as _, Heartbeat, MakeSafe};
use gnc_protocol::serial::LineCounters;
use gnc_protocol::{Frame, Header, Kind, PROTOCOL_VERSION, timing};
use tokio::time::Instant;

use streams::StreamRun;

use crate::breach::{Breaches, Case};
use crate::rule::{self, Rule};

/// Requests whose numbers the station remembers: an answer to one of these was asked for once.
const ASKED: usize = 1024;
/// Frames whose sequence numbers are remembered. A line that doubles frames or changes their order does not move them
/// farther.
const NUMBERED: usize = 32;
/// What an USB adapter holds back, with its latency timer as it comes (section 2).
const HOST_ADDS: Duration = Duration::from_millis(16);
/// Answers that are timed before the board is called late, those of them that are late, and their least share: one of so
/// many.
const TIMED_ANSWERS: u32 = 20;
const LATE_ANSWERS: u32 = 5;
const LATE_SHARE: u32 = 4;
/// Time without a heartbeat that no busy computer explains, and on CAN, where a lost one leaves no trace.
const NO_BEAT: Duration = Duration::from_millis(2500);
const NO_BEAT_ON_CAN: Duration = Duration::from_millis(4250);
/// Time without any frame after which the line may have been interrupted.
const QUIET: Duration = Duration::from_millis(1250);
/// Heartbeats that are late until the board is.
const LATE_BEATS: u32 = 2;
/// A heartbeat may be early or late by this much: what the adapter adds, and half of a frame that is in its way.
const BEAT_OFF: Duration = Duration::from_millis(250);
/// PROGRESS may be late by this much.
const PROGRESS_OFF: Duration = Duration::from_millis(250);
/// Time after a change for which a heartbeat may still show what was before.
const SHOWN_AFTER: Duration = Duration::from_millis(1500);
/// The watchdog may be early by this much, since a request may have been on its way for some time.
const WATCHDOG_OFF: Duration = Duration::from_millis(150);
/// Bits of [`Heartbeat::state`].
pub(super) const SESSION_OPEN: u8 = 1 << 0;
const POWERED: u8 = 1 << 1;

/// What the conversation knows of the board's manners.
#[derive(Debug)]
pub(super) struct Audit {
    breaches: Breaches,
    asked: VecDeque<u16>,
    /// The sequence numbers of the last frames with the checksums of those frames. On CAN each channel counts by itself.
    numbers: [VecDeque<(u16, u32)>; 2],
    /// Whether the newest frame came a second time.
    doubled: bool,
    /// Steps back of the sequence numbers since the last heartbeat.
    steps_back: Vec<String>,
    /// The last heartbeat, or the beginning of the session.
    beat: Option<Instant>,
    /// Whether the present time without a heartbeat is kept already.
    beat_missed: bool,
    /// What the line had lost at the last heartbeat; heartbeats, and those that came late or early.
    lost_at_beat: (u32, u32, u32),
    beats: (u32, u32, u32),
    /// Answers to requests, and those that came late.
    answers: (u32, u32),
    /// The last frame of any kind.
    last_frame: Option<Instant>,
    /// When a heartbeat said that the module is without power, and it was switched on.
    unpowered: Option<Instant>,
    /// The station was not at its work until then, so times up to then say nothing of the board.
    blind_until: Option<Instant>,
    /// Whether the module is under power by what the board was told and said, and since when.
    powered: Option<(bool, Instant)>,
    /// When the session began.
    opened: Option<Instant>,
    /// The newest moment at which the station sent something that the board then answered.
    answered_at: Option<Instant>,
    /// Whether sequence numbers count all frames of the link. On CAN each id has its own, and samples have none.
    numbered: bool,
    /// The streams since the session began.
    runs: Vec<StreamRun>,
}

impl Audit {
    pub(super) fn new(breaches: Breaches, numbered: bool) -> Self {
        Self {
            breaches,
            asked: VecDeque::new(),
            numbers: [VecDeque::new(), VecDeque::new()],
            doubled: false,
            steps_back: Vec::new(),
            beat: None,
            beat_missed: false,
            lost_at_beat: (0, 0, 0),
            beats: (0, 0, 0),
            answers: (0, 0),
            last_frame: None,
            unpowered: None,
            blind_until: None,
            powered: None,
            opened: None,
            answered_at: None,
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
    pub(super) fn header(&mut self, frame: &Frame) -> bool {
        let header = &frame.header;
        self.number(frame);
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
            Kind::Accept | Kind::Progress | Kind::Result | Kind::Nak
                // Before the session, answers to an earlier program may still be on their way.
                if self.opened.is_some() && !self.asked.contains(&request) =>
            {
                self.see(&rule::UNASKED, Case::Words(format!("request {request}")));
            }
            _ => {}
        }
        true
    }

    /// A number that comes again with the same frame was doubled on the line. With another frame, the board does not count.
    fn number(&mut self, frame: &Frame) {
        let Header { kind, request, message, sequence, .. } = frame.header;
        self.doubled = false;
        if !self.numbered && matches!(kind, Kind::Event | Kind::Stream) {
            return;
        }
        let urgent = kind == Kind::Hello || message == MakeSafe::ID || message == Abort::ID;
        let numbers = &mut self.numbers[usize::from(!self.numbered && urgent)];
        let of_header = u32::from(request) << 16 | u32::from(message);
        let sum = checksum(&frame.payload) ^ of_header.rotate_left(kind as u32);
        if kind == Kind::Hello {
            numbers.clear();
        }
        let again = numbers.iter().find(|(number, _)| *number == sequence).map(|(_, before)| *before != sum);
        let far = numbers.back().is_some_and(|(last, _)| {
            let back = last.wrapping_sub(sequence);
            usize::from(back) >= NUMBERED && back < 0x8000
        });
        self.doubled = again == Some(false);
        if self.doubled {
            return;
        }
        if numbers.len() == NUMBERED {
            numbers.pop_front();
        }
        numbers.push_back((sequence, sum));
        let words = match again {
            Some(_) => format!("{sequence} comes again with another frame"),
            None if far => format!("it goes back to {sequence}"),
            None => return,
        };
        // A board that restarts begins anew; its next heartbeat tells.
        if self.steps_back.len() < NUMBERED {
            self.steps_back.push(words);
        }
    }

    /// Whether the newest frame is one that the line doubled.
    pub(super) fn was_doubled(&self) -> bool {
        self.doubled
    }

    /// The board restarted, or a new session begins: numbers and times begin anew.
    pub(super) fn begins_anew(&mut self) {
        (self.beat, self.powered, self.opened, self.answered_at) = (None, None, None, None);
        (self.unpowered, self.beats) = (None, (0, 0, 0));
        self.numbers.iter_mut().for_each(VecDeque::clear);
        self.steps_back.clear();
        self.beat_missed = false;
        self.runs.clear();
    }

    /// The board answered HELLO: the session is open, and its module is without power.
    pub(super) fn session_opened(&mut self, now: Instant, switches: bool) {
        self.begins_anew();
        (self.opened, self.beat) = (Some(now), Some(now));
        self.powered = switches.then_some((false, now));
    }

    /// The board answered something that the station sent at `asked`, for the first time at `since`.
    pub(super) fn answered(&mut self, asked: Instant) {
        self.answered_at = self.answered_at.max(Some(asked));
    }

    /// Compares the time of the first answer to a request with what the document allows: 50 ms, and the time on the wire. A
    /// line that stands still now and then makes some answers late; a board that is late is so again and again.
    pub(super) fn took(&mut self, asked: Instant, wire: Duration, now: Instant) {
        let Some(took) = self.span(asked, now) else { return };
        let (all, late) = &mut self.answers;
        *all += 1;
        if took > timing::ACCEPT_WITHIN + wire + HOST_ADDS {
            *late += 1;
            if *all >= TIMED_ANSWERS && *late >= LATE_ANSWERS && *late * LATE_SHARE >= *all {
                self.breaches.see_gross(&rule::ANSWER_LATE, Case::Took(took));
            }
        }
    }

    /// Whether an answer that came now to something that was sent at `asked` is late.
    pub(super) fn is_late(&self, asked: Instant, wire: Duration, now: Instant) -> bool {
        self.span(asked, now).is_some_and(|took| took > timing::ACCEPT_WITHIN + wire + HOST_ADDS)
    }

    /// An accepted request shows that it runs, by PROGRESS or by its result.
    pub(super) fn progressed(&self, before: Instant, clean: bool, now: Instant) {
        if !clean {
            // The line may have lost one.
            return;
        }
        let Some(gap) = self.span(before, now) else { return };
        if gap > timing::PROGRESS_EVERY + PROGRESS_OFF {
            self.see(&rule::PROGRESS_LATE, Case::Took(gap));
        }
    }

    /// The module's supply is being switched: its state is unknown until the answer.
    pub(super) fn switches(&mut self) {
        self.powered = None;
    }

    /// The module's supply was switched, by the board's own answer.
    pub(super) fn switched(&mut self, on: bool, now: Instant) {
        self.powered = Some((on, now));
    }

    /// Something came from the board: heartbeats must too. After a time in which nothing came, the line may be to blame.
    pub(super) fn heard(&mut self, counters: LineCounters, now: Instant) {
        if self.last_frame.replace(now).is_some_and(|last| now.saturating_duration_since(last) > QUIET) {
            self.was_blind(now);
        }
        if counters.lost() != self.lost_at_beat {
            return;
        }
        let no_beat = if self.numbered { NO_BEAT } else { NO_BEAT_ON_CAN };
        let Some(gap) = self.beat.and_then(|before| self.span(before, now)).filter(|gap| *gap > no_beat) else {
            return;
        };
        if !std::mem::replace(&mut self.beat_missed, true) {
            self.breaches.see_gross(&rule::HEARTBEAT_LATE, Case::Took(gap));
        }
    }

    /// A heartbeat of the session.
    pub(super) fn beat(&mut self, beat: &Heartbeat, counters: LineCounters, now: Instant) {
        for words in std::mem::take(&mut self.steps_back) {
            self.see(&rule::SEQUENCE, Case::Words(words));
        }
        self.time_beat(counters, now);
        let shown = |since: Instant| self.span(since, now).is_some_and(|span| span > SHOWN_AFTER);
        if self.opened.is_some_and(shown)
            && beat.state & SESSION_OPEN == 0
            && self.answered_at.is_some_and(|heard| now.saturating_duration_since(heard) < SHOWN_AFTER)
        {
            self.see(&rule::STATE_SESSION, Case::Plain);
        }
        match self.powered.filter(|(_, since)| shown(*since)) {
            Some((false, _)) if beat.state & POWERED != 0 => self.see(&rule::STATE_POWERED, Case::Plain),
            // The board's protection may have switched it off; the next answer of the module tells.
            Some((true, _)) if beat.state & POWERED == 0 => self.unpowered = Some(now),
            _ => self.unpowered = None,
        }
    }

    /// Times a heartbeat. A line that loses or doubles one makes another late or early, and so does a station that was not
    /// at its work, so most of them must be.
    fn time_beat(&mut self, counters: LineCounters, now: Instant) {
        let clean = std::mem::replace(&mut self.lost_at_beat, counters.lost()) == counters.lost();
        let before = self.beat.replace(now).filter(|before| Some(*before) != self.opened);
        let missed = std::mem::take(&mut self.beat_missed);
        let Some((before, gap)) = before.and_then(|before| Some((before, self.span(before, now)?))) else { return };
        let awake = self.blind_until.is_none_or(|until| until + timing::HEARTBEAT_EVERY < before);
        let least = if self.numbered { LATE_BEATS } else { LATE_BEATS + 1 };
        let (all, late, early) = &mut self.beats;
        *all += 1;
        if gap > timing::HEARTBEAT_EVERY + BEAT_OFF && clean && !missed {
            *late += 1;
            if *late >= least && *late * 2 >= *all {
                self.breaches.see_gross(&rule::HEARTBEAT_LATE, Case::Took(gap));
            }
        } else if gap + BEAT_OFF < timing::HEARTBEAT_EVERY && awake {
            *early += 1;
            if *early > LATE_BEATS && *early * 2 >= *all {
                self.breaches.see_gross(&rule::HEARTBEAT_EARLY, Case::OnlyTook(gap));
            }
        }
    }

    /// The module answered something that was asked at `asked`, so it has power.
    pub(super) fn has_power(&mut self, asked: Instant) {
        if self.unpowered.take_if(|unpowered| asked > *unpowered).is_some() {
            self.see(&rule::STATE_UNPOWERED, Case::Plain);
        }
    }

    /// The board's watchdog ended the session. It may do so only if it heard nothing for its time; an answer shows what
    /// it heard. Returns the time after which it acted, if that is too early.
    pub(super) fn watchdog(&self, now: Instant) -> Option<Duration> {
        let quiet = self.answered_at.and_then(|heard| self.span(heard, now))?;
        let early = (quiet + WATCHDOG_OFF < timing::WATCHDOG).then_some(quiet)?;
        // A computer that was suspended takes a long time for a short one; not twice in a run.
        self.see(&rule::WATCHDOG_EARLY, Case::OnlyTook(early));
        self.breaches.all().iter().any(|breach| breach.rule == &rule::WATCHDOG_EARLY).then_some(early)
    }
}
