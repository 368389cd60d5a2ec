//! Requests and their answers.

use std::time::Duration;

use gnc_protocol::message::{Nak, Request};
use gnc_protocol::wire::{Text, Wire as _};
use gnc_protocol::{Call, Kind, PROTOCOL_VERSION};
use tokio::time::Instant;

use super::{Driver, Heard, ms};
use crate::raw::RawHeader;
use crate::stop::{Verdict, failed};

/// Without an answer for so long, none comes: twenty times what section 7 allows.
const ANSWER_WITHIN: Duration = Duration::from_millis(1000);
/// An accepted request that says nothing for so long is lost (section 7).
const LOST_AFTER: Duration = Duration::from_millis(1500);
/// Longest request of any check: an SDRAM pattern on a slow module.
const ENDS_WITHIN: Duration = Duration::from_secs(30);
/// Bytes of a RESULT before its body.
const RESULT_HEAD: usize = 6;

/// A request that was sent.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Asked {
    pub(crate) request: u16,
    pub(crate) message: u16,
    /// Where its answers begin among what was heard.
    pub(crate) from: usize,
    pub(crate) sent: Instant,
}

/// How a request ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum End {
    /// Refused.
    Nak { code: u16, text: String },
    /// A RESULT.
    Result { status: u16, elapsed_us: u32, body: Vec<u8>, flags: u8 },
}

/// All that answered a request.
#[derive(Debug, Clone)]
pub(crate) struct Answer {
    pub(crate) asked: Asked,
    /// When ACCEPT came, if one came.
    pub(crate) accepted: Option<Instant>,
    pub(crate) ended: Instant,
    pub(crate) end: End,
}

impl Answer {
    /// The NAK code.
    pub(crate) fn nak(&self) -> Option<u16> {
        match self.end {
            End::Nak { code, .. } => Some(code),
            End::Result { .. } => None,
        }
    }

    /// The answer in words.
    pub(crate) fn words(&self) -> String {
        match &self.end {
            End::Nak { code, text } if text.is_empty() => format!("NAK {code}"),
            End::Nak { code, text } => format!("NAK {code} ({text})"),
            End::Result { status: 0, flags, .. } if flags & 2 != 0 => "RESULT with status 0, REPLAYED".to_owned(),
            End::Result { status: 0, .. } => "RESULT with status 0".to_owned(),
            End::Result { status, body, .. } => match Text::<160>::from_payload(body) {
                Ok(text) if text.is_empty() => format!("RESULT with status {status}"),
                Ok(text) => format!("RESULT with status {status} ({text})"),
                Err(_) => format!("RESULT with status {status} and {} bytes that are no text", body.len()),
            },
        }
    }

    /// The body of a RESULT with status 0, as it came.
    pub(crate) fn body(&self) -> Verdict<&[u8]> {
        match &self.end {
            End::Result { status: 0, body, .. } => Ok(body),
            _ => {
                failed(format!("{} was answered by {} instead of status 0", name_of(self.asked.message), self.words()))
            }
        }
    }

    /// The body of a RESULT with status 0.
    pub(crate) fn reply<C: Call>(&self) -> Verdict<C::Reply> {
        let body = self.body()?;
        C::Reply::from_payload(body)
            .or_else(|error| failed(format!("the body of {}, {} bytes, does not read: {error}", C::NAME, body.len())))
    }

    /// Board time from ACCEPT to the end, in microseconds; 0 for a NAK.
    pub(crate) fn elapsed_us(&self) -> u32 {
        match self.end {
            End::Nak { .. } => 0,
            End::Result { elapsed_us, .. } => elapsed_us,
        }
    }

    /// Whether it was repeated from memory.
    pub(crate) fn is_replayed(&self) -> bool {
        matches!(self.end, End::Result { flags, .. } if flags & 2 != 0)
    }
}

/// The name of a message, or its number.
pub(crate) fn name_of(message: u16) -> String {
    let found = Request::IDS.iter().find(|(id, _)| *id == message);
    found.map_or_else(|| format!("message 0x{message:04X}"), |(_, name)| (*name).to_owned())
}

impl Driver {
    /// The next request id.
    pub(crate) fn next_request(&mut self) -> u16 {
        self.request = self.request.checked_add(1).unwrap_or(1);
        self.request
    }

    /// Sends a request with this payload under this id, flags and version.
    pub(crate) fn post_as(&mut self, version: u8, flags: u8, request: u16, message: u16, payload: &[u8]) -> Asked {
        let asked = Asked { request, message, from: self.mark(), sent: Instant::now() };
        self.send(RawHeader { version, kind: Kind::Request as u8, flags, request, message }, payload);
        asked
    }

    /// Sends a request with any payload.
    pub(crate) fn post_raw(&mut self, message: u16, payload: &[u8]) -> Asked {
        let request = self.next_request();
        self.post_as(PROTOCOL_VERSION, 0, request, message, payload)
    }

    /// Sends a request.
    pub(crate) fn post<C: Call>(&mut self, call: &C) -> Asked {
        // Every request of the document fits into a payload.
        let payload = call.to_payload().unwrap_or_default();
        self.post_raw(C::ID, &payload)
    }

    /// Sends a request again, as it was.
    pub(crate) fn post_again<C: Call>(&mut self, asked: &Asked, call: &C) -> Asked {
        let payload = call.to_payload().unwrap_or_default();
        self.post_as(PROTOCOL_VERSION, 1, asked.request, C::ID, &payload)
    }

    /// Waits for the first frame that answers a request: ACCEPT, NAK, PROGRESS or RESULT; its place.
    pub(crate) async fn first_answer(&mut self, asked: &Asked) -> Verdict<usize> {
        let asked = *asked;
        let found = self.until(asked.from, ANSWER_WITHIN, |heard| answers(heard, &asked)).await?;
        match found {
            Some(place) => Ok(place),
            None => {
                let came = self.came(asked.from);
                failed(format!("no answer to {} within {}; {came}", name_of(asked.message), ms(ANSWER_WITHIN)))
            }
        }
    }

    /// Waits until a request is accepted; when that was.
    pub(crate) async fn accepted(&mut self, asked: &Asked) -> Verdict<Instant> {
        let place = self.first_answer(asked).await?;
        let heard = &self.heard[place];
        if heard.is(Kind::Accept, asked.message) {
            return Ok(heard.at);
        }
        let came = self.came(place);
        failed(format!("{} was not answered by ACCEPT first; {came}", name_of(asked.message)))
    }

    /// Waits for the end of a request.
    pub(crate) async fn end_of(&mut self, asked: &Asked) -> Verdict<Answer> {
        let asked = *asked;
        let mut place = self.first_answer(&asked).await?;
        let mut accepted = None;
        let until = Instant::now() + ENDS_WITHIN;
        loop {
            let Heard { at, frame: Ok(frame) } = &self.heard[place] else { return failed("a frame was lost") };
            let at = *at;
            match frame.header.kind {
                Kind::Nak => {
                    let Ok(Nak { code, text }) = Nak::from_payload(&frame.payload) else {
                        return failed(format!("the NAK of {} does not read", name_of(asked.message)));
                    };
                    let end = End::Nak { code, text: text.to_string() };
                    return Ok(Answer { asked, accepted, ended: at, end });
                }
                Kind::Result => {
                    let Some((&[s0, s1, e0, e1, e2, e3], body)) = frame.payload.split_first_chunk::<RESULT_HEAD>()
                    else {
                        let name = name_of(asked.message);
                        return failed(format!("the RESULT of {name} has {} bytes", frame.payload.len()));
                    };
                    let end = End::Result {
                        status: u16::from_le_bytes([s0, s1]),
                        elapsed_us: u32::from_le_bytes([e0, e1, e2, e3]),
                        body: body.to_vec(),
                        flags: frame.header.flags.0,
                    };
                    return Ok(Answer { asked, accepted, ended: at, end });
                }
                Kind::Accept => accepted = accepted.or(Some(at)),
                _ => {}
            }
            if Instant::now() >= until {
                return failed(format!("{} did not end within {}", name_of(asked.message), ms(ENDS_WITHIN)));
            }
            place = match self.until(place + 1, LOST_AFTER, |heard| answers(heard, &asked)).await? {
                Some(place) => place,
                None => {
                    let came = self.came(place + 1);
                    let name = name_of(asked.message);
                    return failed(format!("{name} was accepted, then nothing of it for {}; {came}", ms(LOST_AFTER)));
                }
            };
        }
    }

    /// Sends a request and waits for its end.
    pub(crate) async fn call<C: Call>(&mut self, call: &C) -> Verdict<Answer> {
        let asked = self.post(call);
        self.end_of(&asked).await
    }

    /// The body of a request that must be done.
    pub(crate) async fn ask<C: Call>(&mut self, call: &C) -> Verdict<C::Reply> {
        self.call(call).await?.reply::<C>()
    }

    /// Ends a check as failed unless a request is refused with this code; the text of the refusal.
    pub(crate) async fn refused(&mut self, asked: &Asked, code: u16, why: &str) -> Verdict {
        let place = self.first_answer(asked).await?;
        if self.heard[place].of(Kind::Nak).is_some() {
            let answer = self.end_of(asked).await?;
            return match answer.end {
                End::Nak { code: came, text } if came == code => Ok(text),
                _ => failed(format!("{} {why}: {} instead of NAK {code}", name_of(asked.message), answer.words())),
            };
        }
        let came = self.came(place);
        failed(format!("{} {why}: no NAK {code}; {came}", name_of(asked.message)))
    }

    /// Ends a check as failed if anything answers a request within this time.
    pub(crate) async fn unanswered(&mut self, asked: &Asked, within: Duration, why: &str) -> Verdict<()> {
        let asked = *asked;
        match self.until(asked.from, within, |heard| answers(heard, &asked)).await? {
            None => Ok(()),
            Some(place) => {
                let came = self.came(place);
                failed(format!("{why} was answered; {came}"))
            }
        }
    }
}

/// Whether a frame answers a request.
fn answers(heard: &Heard, asked: &Asked) -> bool {
    heard.frame.as_ref().is_ok_and(|frame| {
        let kind = matches!(frame.header.kind, Kind::Accept | Kind::Nak | Kind::Progress | Kind::Result);
        kind && frame.header.request == asked.request && frame.header.message == asked.message
    })
}
