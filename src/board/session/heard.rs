//! How the session handles what the board says.

use gnc_protocol::frame::FrameError;
use gnc_protocol::message::{
    Accept, BoardHello, Call as _, Heartbeat, MAGIC, MakeSafe, ModulePower, Nak, Progress, ResultHead, StreamStart,
    StreamStartReply, StreamStop, StreamStopReply, capability, event,
};
use gnc_protocol::slave::KEPT_RESULTS;
use gnc_protocol::stream::{IMU_SAMPLE, StreamId};
use gnc_protocol::wire::{FieldReader, Text, Wire as _, WireError};
use gnc_protocol::{FaultCode, Flags, Frame, Header, Kind, NakCode, PROTOCOL_VERSION, Payload, timing};
use tokio::sync::mpsc;
use tokio::time::{Duration, Instant};

use super::audit::{Audit, SESSION_OPEN};
use super::possible::{self, Impossible};
use super::{Answer, Ended, HELLO_BYTES, HELLO_FOR, Pending, Sendings, Session};
use crate::breach::{Case, rule};
use crate::error::BoardError;
use crate::status::{Advance, BoardTime};
use crate::stream::{Newest, SampleFrame};

/// HELLOs that are answered late until the board is late and not this computer.
const HELLOS: u32 = 3;
/// Times in a row that the same bytes come between frames until they are no damage.
const SAME_RUBBISH: u32 = 5;
/// Shortest text between frames, in bytes. Damaged frames are hardly ever text.
const SHORTEST_TEXT: usize = 4;

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
        self.audit.heard(now);
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
        let new = match *times {
            SAME_RUBBISH => SAME_RUBBISH,
            SAME_RUBBISH.. => 1,
            _ => return,
        };
        let counted = if matches!(error, FrameError::Checksum { .. }) {
            &mut self.explained.bad_checksum
        } else {
            &mut self.explained.malformed
        };
        *counted += new;
        let hex = bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ");
        self.audit.see(&rule::BYTES_BETWEEN, Case::Words(hex));
    }

    fn hello(&mut self, payload: &[u8]) {
        let now = Instant::now();
        let hello = match BoardHello::from_payload(payload) {
            Ok(hello) if hello.magic == MAGIC => hello,
            Ok(_) => return self.audit.see(&rule::HELLO_LAYOUT, Case::Words("the magic is another one".into())),
            Err(error) => return self.audit.see(&rule::HELLO_LAYOUT, Case::Words(error.to_string())),
        };
        if let Some((nonce, before)) = self.session {
            if hello.nonce != nonce {
                return;
            }
            if let Some(asked) = self.hello_asked.take() {
                self.hello_took(asked, now);
            }
            if hello.boot_id != before {
                self.restarted(before, hello.boot_id);
            } else if self.in_doubt {
                // The board is the same and has not restarted, yet it knows no session: its watchdog ended it.
                self.session = None;
                self.audit.watchdog(now);
                self.fail_all(&self.watchdog_ended());
            } else if let Some(other) = self.other_boot_id.take() {
                // The session lives, so the board did not restart.
                let case = format!("HELLO {before:08x}, heartbeat {other:08x}");
                self.audit.see(&rule::TWO_BOOT_IDS, Case::Words(case));
                self.beats_as = Some(other);
            }
            return;
        }
        let Some(greeting) = self.greeting.take_if(|greeting| greeting.nonce == hello.nonce) else {
            if let Some(greeting) = &self.greeting {
                let case = format!("{:08x} instead of {:08x}", hello.nonce, greeting.nonce);
                self.audit.see(&rule::NONCE, Case::Words(case));
            }
            return;
        };
        if !matches!(hello.chosen, 0 | PROTOCOL_VERSION) {
            let why = format!("version {} of {PROTOCOL_VERSION} to {PROTOCOL_VERSION}", hello.chosen);
            let error = self.breaches.refuse(&rule::VERSION_RANGE, "HELLO", why);
            let _ = greeting.answer.send(Err(error));
            return;
        }
        if hello.chosen != PROTOCOL_VERSION {
            let error = BoardError::Version { lowest: hello.lowest, highest: hello.highest };
            let _ = greeting.answer.send(Err(error));
            return;
        }
        if self.last_boot_id.replace(hello.boot_id) != Some(hello.boot_id) {
            // The board's clock started again.
            self.newest = Newest::default();
        }
        self.session = Some((hello.nonce, hello.boot_id));
        self.in_doubt = false;
        self.interrupted = None;
        (self.other_boot_id, self.beats_as) = (None, None);
        if [&hello.serial, &hello.firmware].into_iter().any(|text| text.chars().any(char::is_control)) {
            let texts =
                format!("serial \"{}\", firmware \"{}\"", hello.serial.escape_debug(), hello.firmware.escape_debug());
            self.audit.see(&rule::CONTROL_CHARACTER, Case::Words(texts));
        }
        if !(hello.lowest..=hello.highest).contains(&hello.chosen) {
            let case = format!("version {} of {} to {}", hello.chosen, hello.lowest, hello.highest);
            self.audit.see(&rule::VERSION_RANGE, Case::Words(case));
        }
        self.one_reading_each = hello.capabilities & capability::REPEATED_READINGS == 0;
        self.audit.session_opened(now, hello.capabilities & capability::POWER != 0);
        self.last_beat_us = None;
        self.beat = Instant::now();
        self.before.get_or_insert_with(|| self.link.counters());
        self.link.restart_sequence();
        self.board_time.change(|board_time| *board_time = BoardTime::default());
        (self.hello_asked, self.hello_late) = (None, 0);
        if greeting.asked == 1 {
            self.hello_took(greeting.sent_at, now);
        } else if now > greeting.since + HELLO_FOR {
            // It did not answer for as long as HELLO was repeated, so this computer is not to blame.
            self.audit.see(&rule::HELLO_VERY_LATE, Case::Took(now - greeting.since));
        }
        let _ = greeting.answer.send(Ok(hello));
    }

    /// The board took until now to answer a HELLO. A late answer may be this computer's delay, so the station asks again: the
    /// same HELLO changes nothing. The board is late if it is so each time.
    fn hello_took(&mut self, asked: Instant, now: Instant) {
        let wire = self.link.exchange_time(HELLO_BYTES);
        if !self.audit.is_late(asked, wire, now) {
            return;
        }
        self.audit.took(&rule::HELLO_LATE, asked, wire, now);
        self.hello_late += 1;
        if let Some((nonce, _)) = self.session
            && self.hello_late < HELLOS
        {
            self.hello_asked = Some(now);
            self.say_hello(nonce);
        }
    }

    /// The request that an answer names, if it is one that waits.
    fn named(&mut self, (request, message): (u16, u16)) -> Option<&mut Pending> {
        let pending = self.pending.iter_mut().find(|pending| pending.request == request)?;
        if pending.message == message {
            return Some(pending);
        }
        let case = format!("message 0x{message:04x} to {}, which is 0x{:04x}", pending.what, pending.message);
        self.audit.see(&rule::OTHER_MESSAGE, Case::Words(case));
        None
    }

    fn accepted(&mut self, id: (u16, u16), payload: &[u8], now: Instant) {
        self.count_answer(id, now);
        let wire = self.link.exchange_time(0);
        let Some(pending) = self.named(id) else { return };
        pending.due = now + timing::PROGRESS_LOST_AFTER;
        let (first, once, sent_at) = (pending.runs.is_none(), pending.sendings.sent == 1, pending.sendings.last);
        // The request runs, so earlier losses no longer count.
        pending.asked = 1;
        pending.ended_since = 0;
        pending.runs = Some(now);
        match Accept::from_payload(payload) {
            Ok(accept) => {
                pending.expected_ms = accept.expected_ms;
                pending.advance.send_replace(Advance { expected_ms: accept.expected_ms, ..Advance::default() });
            }
            Err(error) => self.audit.see(&rule::ANSWER_LAYOUT, Case::Words(format!("ACCEPT: {error}"))),
        }
        if once {
            self.audit.answered(sent_at);
            if first {
                self.audit.took(&rule::ANSWER_LATE, sent_at, wire, now);
            }
        }
    }

    /// Counts the answers to what was sent several times. As many answers as transmissions show that none was lost, so the
    /// first answer was late and answered the first transmission.
    fn count_answer(&mut self, id: (u16, u16), now: Instant) {
        let pending = self.pending.iter_mut().find(|pending| (pending.request, pending.message) == id);
        let ended = self.ended.iter_mut().find(|ended| ended.id == id);
        let Some(sendings) = pending.map(|pending| &mut pending.sendings).or(ended.map(|ended| &mut ended.sendings))
        else {
            return;
        };
        if self.audit.was_doubled() {
            return;
        }
        sendings.answers += 1;
        let first_answer = *sendings.first_answer.get_or_insert(now);
        if sendings.answers == sendings.sent && sendings.sent > 1 {
            let (first, wire) = (sendings.first, self.link.exchange_time(0));
            self.audit.took(&rule::ANSWER_LATE, first, wire, first_answer);
        }
    }

    fn progressed(&mut self, id: (u16, u16), payload: &[u8], now: Instant) {
        let Some(pending) = self.named(id) else { return };
        pending.due = now + timing::PROGRESS_LOST_AFTER;
        // The board is alive, so earlier losses no longer count.
        pending.asked = 1;
        pending.ended_since = 0;
        let before = pending.runs.replace(now);
        match Progress::from_payload(payload) {
            Ok(Progress { done_permille, elapsed_ms }) => {
                let expected_ms = pending.expected_ms;
                pending.advance.send_replace(Advance {
                    done_permille: done_permille.min(1000),
                    elapsed_ms,
                    expected_ms,
                });
                if done_permille > 1000 {
                    self.audit.see(&rule::PROGRESS, Case::Words(format!("{done_permille} of 1000 done")));
                }
            }
            Err(error) => self.audit.see(&rule::ANSWER_LAYOUT, Case::Words(format!("PROGRESS: {error}"))),
        }
        if let Some(before) = before {
            self.audit.progressed(before, now);
        }
    }

    fn finished(&mut self, id: (u16, u16), flags: Flags, payload: &[u8], now: Instant) {
        let accepted =
            self.pending.iter().any(|pending| (pending.request, pending.message) == id && pending.runs.is_some());
        if !accepted {
            self.count_answer(id, now);
        }
        if self.named(id).is_none() {
            // A result for which no request waits: a replay that was asked for once too often.
            if self.ended.iter().any(|ended| ended.id == id) && !flags.has(Flags::REPLAYED) && !self.audit.was_doubled()
            {
                self.audit.see(&rule::REPLAY_FLAG, Case::Words(format!("request {}", id.0)));
            }
            return;
        }
        let Some(pending) = self.take(id.0, id.1) else { return };
        self.remember(id, pending.sendings);
        pending.advance.send_replace(Advance::default());
        self.audit_result(&pending, flags, now);
        let what = pending.what;
        let mut reader = FieldReader::new(payload);
        let answer = match ResultHead::get(&mut reader) {
            Err(source) => {
                if let WireError::Unknown { value, .. } = source {
                    self.audit.see(&rule::CODE_UNKNOWN, Case::Words(format!("RESULT with status {value}")));
                }
                Err(BoardError::BadAnswer { what, source })
            }
            Ok(ResultHead { status: FaultCode::None, elapsed_us }) => Ok(Answer {
                request: id.0,
                elapsed: Duration::from_micros(elapsed_us.into()),
                asked: pending.asked,
                body: Payload::from_slice(reader.take_rest()).unwrap_or_default(),
            }),
            Ok(ResultHead { status: code, elapsed_us }) => {
                let text = Text::<160>::get(&mut reader).map(|text| text.as_str().to_owned()).unwrap_or_default();
                let elapsed = Duration::from_micros(elapsed_us.into());
                Err(BoardError::Fault { what, code, text, elapsed })
            }
        };
        let answer = answer.and_then(|answer| {
            match possible::check(pending.message, &pending.payload, &answer.body, answer.elapsed) {
                Ok(()) => Ok(answer),
                Err(Impossible { rule, why }) => Err(self.breaches.refuse(rule, what, why)),
            }
        });
        if let Ok(answer) = &answer {
            self.gauges.answered(id.1, &answer.body);
            match (id.1, pending.payload.first()) {
                (ModulePower::ID, Some(on)) => {
                    self.audit.switched(*on == 1, now);
                    if *on != 1 {
                        self.audit.streams_ended(now);
                    }
                }
                (MakeSafe::ID, _) => {
                    self.audit.switched(false, now);
                    self.audit.streams_ended(now);
                }
                (StreamStart::ID, _) => self.started(&pending.payload, &answer.body),
                _ => {}
            }
        }
        let answer = answer.and_then(|answer| self.closed(&pending, answer, now));
        let _ = pending.answer.send(answer);
    }

    fn started(&mut self, asked: &[u8], body: &[u8]) {
        let (Ok(asked), Ok(reply)) = (StreamStart::from_payload(asked), StreamStartReply::from_payload(body)) else {
            return;
        };
        if let Some(id) = StreamId::from_number(asked.stream) {
            self.audit.started(id, &asked, &reply, self.link.counters());
        }
    }

    /// Closes the account of a stream that the board has stopped.
    fn closed(&mut self, pending: &Pending, answer: Answer, now: Instant) -> Result<Answer, BoardError> {
        let (StreamStop::ID, Some(stream)) = (pending.message, pending.payload.first()) else { return Ok(answer) };
        let (Some(id), Ok(reply)) = (StreamId::from_number(*stream), StreamStopReply::from_payload(&answer.body))
        else {
            return Ok(answer);
        };
        match self.audit.stopped(id, &reply, self.link.counters(), now) {
            None => Ok(answer),
            Some(why) => Err(self.breaches.refuse(&rule::ACCOUNT, pending.what, why)),
        }
    }

    /// Holds the way in which a result came against section 7.
    fn audit_result(&mut self, pending: &Pending, flags: Flags, now: Instant) {
        if pending.sendings.sent == 1 {
            self.audit.answered(pending.sendings.last);
        }
        match pending.runs {
            Some(before) => self.audit.progressed(before, now),
            // A lost ACCEPT shows as a missing frame. A replay comes without ACCEPT.
            None if pending.sendings.sent == 1
                && !flags.has(Flags::REPLAYED)
                && self.link.counters().missing == pending.lost_before =>
            {
                self.audit.see(&rule::NO_ACCEPT, Case::Words(pending.what.to_owned()));
            }
            None => {}
        }
    }

    /// Remembers a request that has ended: its result may come again.
    fn remember(&mut self, id: (u16, u16), sendings: Sendings) {
        self.ended.push_back(Ended { id, sendings });
        if self.ended.len() > KEPT_RESULTS {
            self.ended.pop_front();
        }
    }

    fn refused(&mut self, request: u16, message: u16, payload: &[u8], now: Instant) {
        let nak = match Nak::from_payload(payload) {
            Ok(nak) => nak,
            Err(error) => return self.audit.see(&rule::ANSWER_LAYOUT, Case::Words(format!("NAK: {error}"))),
        };
        let code = NakCode::from_number(nak.code);
        if let (Some(NakCode::NoSession), Some((nonce, _))) = (code, self.session) {
            // A refusal of a request of an earlier session says nothing of this session.
            if !self.pending.iter().any(|pending| pending.request == request) {
                return;
            }
            // The board's HELLO tells whether it restarted.
            self.in_doubt = true;
            return self.say_hello(nonce);
        }
        self.count_answer((request, message), now);
        let wire = self.link.exchange_time(0);
        if self.named((request, message)).is_none() {
            return;
        }
        let Some(pending) = self.take(request, message) else { return };
        if pending.sendings.sent == 1 {
            self.audit.answered(pending.sendings.last);
            if pending.runs.is_none() {
                self.audit.took(&rule::ANSWER_LATE, pending.sendings.last, wire, now);
            }
        }
        let (what, text) = (pending.what, nak.text.as_str().to_owned());
        let error = match code {
            Some(code) => BoardError::Refused { what, code, text },
            None => {
                self.audit.see(&rule::CODE_UNKNOWN, Case::Words(format!("NAK {}", nak.code)));
                BoardError::RefusedUnknown { what, code: nak.code, text }
            }
        };
        let _ = pending.answer.send(Err(error));
    }

    fn event(&mut self, message: u16, payload: &[u8]) {
        match message {
            event::HEARTBEAT => match Heartbeat::from_payload(payload) {
                Ok(beat) => self.heartbeat(&beat),
                Err(error) => self.audit.see(&rule::HEARTBEAT_LAYOUT, Case::Words(error.to_string())),
            },
            event::WATCHDOG if self.session.is_some() => {
                self.session = None;
                self.audit.watchdog(Instant::now());
                self.fail_all(&self.watchdog_ended());
            }
            _ => {}
        }
    }

    fn heartbeat(&mut self, beat: &Heartbeat) {
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
        for (id, ahead_us) in self.audit.ahead_of(now_us) {
            let why = format!("{ahead_us} us, and the heartbeat behind it says {now_us} us");
            let error = self.breaches.refuse(&rule::STREAM_TIME, id.name(), why);
            self.end_stream(id, error);
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
        self.audit.beat(beat, now);
        self.beat = now;
        self.board_time.change(|board_time| {
            board_time.board_time_us = beat.board_time_us;
            board_time.beats += 1;
        });
    }

    fn restarted(&mut self, before: u32, after: u32) {
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
        let starting = self.pending.iter().any(starts);
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
