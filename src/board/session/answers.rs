//! How the session takes the answers to its requests: ACCEPT, PROGRESS, RESULT and NAK.

use std::time::Duration;

use gnc_protocol::calibration::CalibrationRead;
use gnc_protocol::message::{
    Accept, Call as _, Identity, MakeSafe, ModulePower, Nak, Progress, ResultHead, StreamStart, StreamStartReply,
    StreamStop, StreamStopReply,
};
use gnc_protocol::slave::KEPT_RESULTS;
use gnc_protocol::stream::StreamId;
use gnc_protocol::wire::{FieldReader, Text, Wire as _, WireError};
use gnc_protocol::{FaultCode, Flags, NakCode, Payload, timing};
use tokio::time::Instant;

use super::possible::{self, Impossible};
use super::{Answer, Ended, Pending, Sendings, Session};
use crate::breach::Case;
use crate::error::BoardError;
use crate::rule;
use crate::status::Advance;

/// Messages to the module, which needs power for them; StreamStop lies among them and needs none.
const NEEDS_POWER: std::ops::RangeInclusive<u16> = Identity::ID..=CalibrationRead::ID;

impl Session {
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

    pub(super) fn accepted(&mut self, id: (u16, u16), payload: &[u8], now: Instant) {
        self.count_answer(id, now);
        let wire = self.link.exchange_time(0);
        let counters = self.link.counters();
        let Some(pending) = self.named(id) else { return };
        pending.lost_at_run = counters;
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
                self.audit.took(sent_at, wire, now);
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
            self.audit.took(first, wire, first_answer);
        }
    }

    pub(super) fn progressed(&mut self, id: (u16, u16), payload: &[u8], now: Instant) {
        let counters = self.link.counters();
        let Some(pending) = self.named(id) else { return };
        let clean = std::mem::replace(&mut pending.lost_at_run, counters).lost() == counters.lost();
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
            self.audit.progressed(before, clean, now);
        }
    }

    pub(super) fn finished(&mut self, id: (u16, u16), flags: Flags, payload: &[u8], now: Instant) {
        let accepted =
            self.pending.iter().any(|pending| (pending.request, pending.message) == id && pending.runs.is_some());
        if !accepted {
            self.count_answer(id, now);
        }
        if self.named(id).is_none() {
            // A result for which no request waits: a replay that was asked for once too often.
            // Of a request that was sent again the first result may come behind the replay.
            if self.ended.iter().any(|ended| ended.id == id && ended.sendings.sent == 1)
                && !flags.has(Flags::REPLAYED)
                && !self.audit.was_doubled()
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
            if NEEDS_POWER.contains(&id.1) && id.1 != StreamStop::ID {
                self.audit.has_power(pending.sendings.last);
            }
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
                (StreamStart::ID, _) => self.started(&pending, &answer.body),
                _ => {}
            }
        }
        let answer = answer.and_then(|answer| self.closed(&pending, answer, now));
        let _ = pending.answer.send(answer);
    }

    fn started(&mut self, pending: &Pending, body: &[u8]) {
        let (Ok(asked), Ok(reply)) =
            (StreamStart::from_payload(&pending.payload), StreamStartReply::from_payload(body))
        else {
            return;
        };
        if let Some(id) = StreamId::from_number(asked.stream) {
            self.audit.started(id, &asked, &reply, pending.lost_before);
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
            Some(before) => {
                let clean = pending.lost_at_run.lost() == self.link.counters().lost();
                self.audit.progressed(before, clean, now);
            }
            // A lost ACCEPT shows as a missing frame. A replay comes without ACCEPT.
            None if pending.sendings.sent == 1
                && !flags.has(Flags::REPLAYED)
                && self.link.counters().lost() == pending.lost_before.lost() =>
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

    pub(super) fn refused(&mut self, request: u16, message: u16, payload: &[u8], now: Instant) {
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
            if !std::mem::replace(&mut self.in_doubt, true) {
                self.say_hello(nonce);
            }
            return;
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
                self.audit.took(pending.sendings.last, wire, now);
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
}
