//! How the session handles what the board says.

use gnc_protocol::message::{Accept, BoardHello, Heartbeat, MAGIC, Nak, Progress, ResultHead, event};
use gnc_protocol::stream::StreamId;
use gnc_protocol::wire::{FieldReader, Text, Wire as _};
use gnc_protocol::{FaultCode, Frame, Header, Kind, NakCode, PROTOCOL_VERSION, Payload, timing};
use tokio::sync::mpsc;
use tokio::time::{Duration, Instant};

use super::{Answer, Session};
use crate::error::BoardError;
use crate::status::{Advance, BoardTime};
use crate::stream::{Newest, SampleFrame};

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
        match kind {
            Kind::Hello => self.hello(&frame.payload),
            Kind::Accept => self.accepted(request, &frame.payload, now),
            Kind::Progress => self.progressed(request, &frame.payload, now),
            Kind::Result => self.finished(request, message, &frame.payload),
            Kind::Nak => self.refused(request, message, &frame.payload),
            Kind::Stream => self.streamed(&frame.payload),
            Kind::Event => self.event(message, &frame.payload),
            Kind::Request => {}
        }
    }

    fn hello(&mut self, payload: &[u8]) {
        let Ok(hello) = BoardHello::from_payload(payload) else { return };
        if hello.magic != MAGIC {
            return;
        }
        if let Some((nonce, before)) = self.session {
            if hello.nonce != nonce {
                return;
            }
            if hello.boot_id != before {
                self.restarted(before, hello.boot_id);
            } else if self.in_doubt {
                // The board is the same and has not restarted, yet it knows no session: its watchdog ended it.
                self.session = None;
                self.fail_all(&self.watchdog_ended());
            }
            return;
        }
        let Some(greeting) = self.greeting.take_if(|greeting| greeting.nonce == hello.nonce) else { return };
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
        self.beat = Instant::now();
        self.before.get_or_insert_with(|| self.link.counters());
        self.link.restart_sequence();
        self.board_time.change(|board_time| *board_time = BoardTime::default());
        let _ = greeting.answer.send(Ok(hello));
    }

    fn accepted(&mut self, request: u16, payload: &[u8], now: Instant) {
        let Some(pending) = self.pending.iter_mut().find(|pending| pending.request == request) else { return };
        pending.due = now + timing::PROGRESS_LOST_AFTER;
        // The request runs, so earlier losses no longer count.
        pending.asked = 1;
        pending.ended_since = 0;
        if let Ok(accept) = Accept::from_payload(payload) {
            pending.expected_ms = accept.expected_ms;
            pending.advance.send_replace(Advance { expected_ms: accept.expected_ms, ..Advance::default() });
        }
    }

    fn progressed(&mut self, request: u16, payload: &[u8], now: Instant) {
        let Some(pending) = self.pending.iter_mut().find(|pending| pending.request == request) else { return };
        pending.due = now + timing::PROGRESS_LOST_AFTER;
        // The board is alive, so earlier losses no longer count.
        pending.asked = 1;
        pending.ended_since = 0;
        if let Ok(Progress { done_permille, elapsed_ms }) = Progress::from_payload(payload) {
            let expected_ms = pending.expected_ms;
            pending.advance.send_replace(Advance { done_permille, elapsed_ms, expected_ms });
        }
    }

    fn finished(&mut self, request: u16, message: u16, payload: &[u8]) {
        // A result for which no request waits was repeated once too often. This is not an error.
        let Some(pending) = self.take(request, message) else { return };
        pending.advance.send_replace(Advance::default());
        let what = pending.what;
        let mut reader = FieldReader::new(payload);
        let answer = match ResultHead::get(&mut reader) {
            Err(source) => Err(BoardError::BadAnswer { what, source }),
            Ok(ResultHead { status: FaultCode::None, elapsed_us }) => Ok(Answer {
                request,
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
        if let Ok(answer) = &answer {
            self.gauges.answered(message, &answer.body);
        }
        let _ = pending.answer.send(answer);
    }

    fn refused(&mut self, request: u16, message: u16, payload: &[u8]) {
        let Ok(nak) = Nak::from_payload(payload) else { return };
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
        let Some(pending) = self.take(request, message) else { return };
        let (what, text) = (pending.what, nak.text.as_str().to_owned());
        let error = match code {
            Some(code) => BoardError::Refused { what, code, text },
            None => BoardError::RefusedUnknown { what, code: nak.code, text },
        };
        let _ = pending.answer.send(Err(error));
    }

    fn event(&mut self, message: u16, payload: &[u8]) {
        match message {
            event::HEARTBEAT => {
                let Ok(beat) = Heartbeat::from_payload(payload) else { return };
                let Some((_, before)) = self.session else { return };
                if beat.boot_id != before {
                    return self.restarted(before, beat.boot_id);
                }
                self.beat = Instant::now();
                self.board_time.change(|board_time| {
                    board_time.board_time_us = beat.board_time_us;
                    board_time.beats += 1;
                });
            }
            event::WATCHDOG if self.session.is_some() => {
                self.session = None;
                self.fail_all(&self.watchdog_ended());
            }
            _ => {}
        }
    }

    fn restarted(&mut self, before: u32, after: u32) {
        self.session = None;
        self.newest = Newest::default();
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

    fn streamed(&mut self, payload: &[u8]) {
        let Ok(frame) = SampleFrame::of(payload) else { return };
        let Some(id) = StreamId::from_number(frame.head.stream) else { return };
        if !self.newest.admit(id, &frame.head) {
            self.report.stale += 1;
            return;
        }
        self.gauges.streamed(id, &frame);
        let Some(sender) = self.sender_of(id) else { return };
        match sender.try_send(Ok(frame)) {
            Ok(()) => {}
            Err(mpsc::error::TrySendError::Full(Ok(frame))) => self.held.push_back((id, frame)),
            Err(_) => self.forget(id),
        }
    }
}
