//! How the session handles what the board says.

use gnc_protocol::frame::FrameError;
use gnc_protocol::message::{Call as _, Heartbeat, StreamStart, event};
use gnc_protocol::stream::{IMU_SAMPLE, StreamId};
use gnc_protocol::wire::Wire as _;
use gnc_protocol::{Frame, Header, Kind};
use tokio::sync::mpsc;
use tokio::time::Instant;

use super::audit::{Audit, SESSION_OPEN};
use super::possible::{self, Impossible};
use super::{Pending, Session};
use crate::breach::Case;
use crate::error::BoardError;
use crate::rule;
use crate::stream::{Newest, SampleFrame};

/// Times in a row that the same bytes come between frames until they are no damage.
const SAME_RUBBISH: u32 = 5;
/// Shortest text between frames, in bytes. Damaged frames are hardly ever text.
const SHORTEST_TEXT: usize = 6;

/// The bytes as text that a program prints, if they are. Pieces of the sentences of a receiver, which consist of numbers
/// and commas, are parts of frames.
fn text(bytes: &[u8]) -> Option<String> {
    let is_text = |byte: &u8| matches!(byte, b' '..=b'~' | b'\t' | b'\r' | b'\n' | 0x1b);
    let text = str::from_utf8(bytes).ok().filter(|_| bytes.iter().all(is_text))?.trim();
    let figures = text.bytes().filter(|byte| matches!(byte, b'0'..=b'9' | b',' | b'.' | b'$' | b'*')).count();
    (text.len() >= SHORTEST_TEXT && 2 * figures < text.len()).then(|| text.to_owned())
}

impl Session {
    pub(super) fn receive(&mut self, frame: &Frame) {
        let now = Instant::now();
        let Header { kind, request, message, .. } = frame.header;
        // The station's own frames come back: an echo on the line. They do not show that the board is alive.
        if kind == Kind::Request || kind == Kind::Event && message == event::KEEP_ALIVE {
            self.report.echoed = self.report.echoed.saturating_add(1);
            return;
        }
        self.heard = now;
        if !self.audit.header(frame) {
            return;
        }
        self.audit.heard(self.link.counters(), now);
        match kind {
            Kind::Hello => self.hello(&frame.payload),
            Kind::Accept => self.accepted((request, message), &frame.payload, now),
            Kind::Progress => self.progressed((request, message), &frame.payload, now),
            Kind::Result => self.finished((request, message), frame.header.flags, &frame.payload, now),
            Kind::Nak => self.refused(request, message, &frame.payload, now),
            Kind::Stream => self.streamed(message, &frame.payload, now),
            Kind::Event => self.event(message, &frame.payload),
            Kind::Request => {}
        }
    }

    /// Bytes came that are no frame.
    pub(super) fn damaged(&mut self, error: FrameError, bytes: Box<[u8]>) {
        if let FrameError::Checksum { mistake: Some(mistake), .. } = error {
            self.explained.bad_checksum += 1;
            return self.audit.see(&rule::CHECKSUM, Case::Words(mistake.meaning().to_owned()));
        }
        if let Some(text) = text(&bytes) {
            self.explained.malformed += 1;
            return self.audit.see(&rule::TEXT, Case::Words(format!("\"{text}\"")));
        }
        let (last, times) = &mut self.rubbish;
        if bytes.is_empty() || bytes != *last {
            self.rubbish = (bytes, 1);
            return;
        }
        *times += 1;
        // Damage is not the same again and again.
        if *times < SAME_RUBBISH {
            return;
        }
        let new = if *times == SAME_RUBBISH { SAME_RUBBISH } else { 1 };
        let counted = if matches!(error, FrameError::Checksum { .. }) {
            &mut self.explained.bad_checksum
        } else {
            &mut self.explained.malformed
        };
        *counted += new;
        let hex = bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ");
        self.audit.see(&rule::BYTES_BETWEEN, Case::Words(hex));
    }

    fn event(&mut self, message: u16, payload: &[u8]) {
        match message {
            event::HEARTBEAT => match Heartbeat::from_payload(payload) {
                Ok(beat) => self.heartbeat(&beat),
                Err(error) => self.audit.see(&rule::HEARTBEAT_LAYOUT, Case::Words(error.to_string())),
            },
            event::WATCHDOG if self.session.is_some() => {
                self.session = None;
                let early = self.audit.watchdog(Instant::now());
                self.fail_all(&self.watchdog_ended(early));
            }
            _ => {}
        }
    }

    fn heartbeat(&mut self, beat: &Heartbeat) {
        if self.audit.was_doubled() {
            return;
        }
        self.heartbeats = self.heartbeats.saturating_add(1);
        let Some((nonce, before)) = self.session else { return };
        let now = Instant::now();
        let (before_us, now_us) = (self.last_beat_us.replace(beat.board_time_us), beat.board_time_us);
        if let Some(before_us) = before_us.filter(|before_us| now_us < *before_us) {
            let known = beat.boot_id == before || Some(beat.boot_id) == self.beats_as;
            if known && beat.state & SESSION_OPEN != 0 {
                // After a restart there is no session.
                let why = format!("from {before_us} us to {now_us} us");
                let error = self.breaches.refuse(&rule::CLOCK_BACK, "heartbeat", why);
                self.fail_all(&error);
            } else {
                // A clock that goes back is a restart, whatever the boot id says.
                if known {
                    let case = format!("board time went from {before_us} us to {now_us} us under boot id {before:08x}");
                    self.audit.see(&rule::BOOT_ID_KEPT, Case::Words(case));
                }
                return self.restarted(before, beat.boot_id);
            }
        }
        if beat.boot_id != before && Some(beat.boot_id) != self.beats_as {
            // After a restart the clock begins anew and there is no session. Otherwise the board's HELLO tells.
            if before_us.is_none() && beat.state & SESSION_OPEN != 0 {
                self.other_boot_id = Some(beat.boot_id);
                self.say_hello(nonce);
            } else {
                return self.restarted(before, beat.boot_id);
            }
        }
        for (id, ahead_us) in self.audit.ahead_of(now_us) {
            let why = format!("{ahead_us} us, and the heartbeat behind it says {now_us} us");
            let error = self.breaches.refuse(&rule::STREAM_TIME, id.name(), why);
            self.end_stream(id, error);
        }
        self.audit.beat(beat, self.link.counters(), now);
        self.beat = now;
        self.board_time.change(|board_time| {
            board_time.board_time_us = beat.board_time_us;
            board_time.beats += 1;
        });
    }

    pub(super) fn restarted(&mut self, before: u32, after: u32) {
        self.session = None;
        self.newest = Newest::default();
        self.audit.begins_anew();
        if let Some(error) = self.restarted_while_away() {
            return self.fail_all(&error);
        }
        let during = self.pending.iter().map(|pending| pending.what).collect::<Vec<_>>().join(", ");
        let during = if during.is_empty() { "no request".to_owned() } else { during };
        for pending in self.pending.drain(..) {
            let during = during.clone();
            let _ = pending.answer.send(Err(BoardError::Restarted { asked: true, during, before, after }));
        }
        self.fail_all(&BoardError::Restarted { asked: false, during, before, after });
    }

    fn streamed(&mut self, message: u16, payload: &[u8], now: Instant) {
        let frame = match SampleFrame::of(payload) {
            Ok(frame) => frame,
            Err(error) => return self.unreadable(StreamId::from_number(message as u8), error.to_string()),
        };
        let Some(id) = StreamId::from_number(frame.head.stream).filter(|id| *id as u16 == message) else {
            let why = format!("stream {} under message id {message}", frame.head.stream);
            return self.unreadable(StreamId::from_number(frame.head.stream), why);
        };
        if let Some(beat_us) =
            self.last_beat_us.filter(|beat_us| Audit::is_far_behind(frame.head.board_time_us, *beat_us))
        {
            let why = format!("{} us, and the heartbeat before it says {beat_us} us", frame.head.board_time_us);
            let error = self.breaches.refuse(&rule::STREAM_TIME, id.name(), why);
            return self.end_stream(id, error);
        }
        if !self.newest.admit(id, &frame.head) {
            self.report.stale += 1;
            return;
        }
        let starts = |pending: &Pending| {
            pending.message == StreamStart::ID
                && pending.payload.first() == Some(&(id as u8))
                && pending.sendings.sent > 0
        };
        let lost = self.link.counters().lost();
        let starting = self.pending.iter().find(|pending| starts(pending));
        let starting = starting.map(|pending| pending.sendings.sent == 1 && pending.lost_before.lost() == lost);
        if let Some(why) = self.audit.frame(id, &frame.head, starting, self.link.counters(), now) {
            let error = self.breaches.refuse(&rule::ACCOUNT, id.name(), why);
            return self.end_stream(id, error);
        }
        if self.one_reading_each
            && id == StreamId::Imu
            && let Some(why) = self.audit.repeats(id, IMU_SAMPLE, &frame.samples)
        {
            let error = self.breaches.refuse(&rule::REPEATS, id.name(), why);
            return self.end_stream(id, error);
        }
        if let Err(Impossible { rule, why }) = possible::frame(id, &frame) {
            let error = self.breaches.refuse(rule, id.name(), why);
            return self.end_stream(id, error);
        }
        self.gauges.streamed(id, &frame);
        let Some(sender) = self.sender_of(id) else { return };
        match sender.try_send(Ok(frame)) {
            Ok(()) => {}
            Err(mpsc::error::TrySendError::Full(Ok(frame))) => self.held.push_back((id, frame)),
            Err(_) => self.forget(id),
        }
    }

    /// A frame of a stream that cannot be read: no sample of the stream is used any more.
    fn unreadable(&mut self, id: Option<StreamId>, why: String) {
        let error = self.breaches.refuse(&rule::STREAM_LAYOUT, id.map_or("a stream", StreamId::name), why);
        if let Some(id) = id {
            self.end_stream(id, error);
        }
    }

    fn end_stream(&mut self, id: StreamId, error: BoardError) {
        if let Some(sender) = self.sender_of(id) {
            // A listener that is behind gets no error here: it misses the frame, and its account does not close.
            let _ = sender.try_send(Err(error));
        }
    }
}
