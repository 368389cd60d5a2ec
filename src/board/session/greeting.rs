//! Opens a session: HELLO, as often as it takes, and the board's answer to it.

use std::time::Duration;

use gnc_protocol::message::{BoardHello, HostHello, MAGIC, capability};
use gnc_protocol::serial::LineCounters;
use gnc_protocol::wire::Wire as _;
use gnc_protocol::{Flags, Kind, PROTOCOL_VERSION};
use tokio::sync::oneshot;
use tokio::time::Instant;

use super::Session;
use crate::breach::Case;
use crate::error::BoardError;
use crate::rule;
use crate::status::BoardTime;
use crate::stream::Newest;

/// Payload of the longer HELLO, which is the board's, at most.
const HELLO_BYTES: usize = 128;
/// Time between two HELLOs; longer on a slow line.
const HELLO_EVERY: Duration = Duration::from_millis(250);
/// Time for which HELLO is repeated. A board that hears HELLO answers at once. A board that is starting listens after
/// two seconds, and one more HELLO must reach it then.
const HELLO_FOR: Duration = Duration::from_millis(2500);
/// Time after the last HELLO for which the station still listens, if the board sends anything: a board that answers late
/// is told apart from one that does not hear.
const LATE_HELLO: Duration = Duration::from_millis(1500);
/// HELLOs that are answered late until the board is late and not this computer.
const HELLOS: u32 = 3;

/// A HELLO that waits for its answer.
#[derive(Debug)]
pub(super) struct Greeting {
    nonce: u32,
    pub(super) answer: oneshot::Sender<Result<BoardHello, BoardError>>,
    asked: u32,
    pub(super) since: Instant,
    pub(super) due: Instant,
    /// When HELLO was sent last.
    sent_at: Instant,
}

impl Greeting {
    /// A HELLO that is due now.
    pub(super) fn new(nonce: u32, answer: oneshot::Sender<Result<BoardHello, BoardError>>, now: Instant) -> Self {
        Self { nonce, answer, asked: 0, since: now, due: now, sent_at: now }
    }
}

impl Session {
    pub(super) fn greet_again(&mut self, now: Instant) {
        let Some(greeting) = self.greeting.as_mut().filter(|greeting| now >= greeting.due) else { return };
        if now - greeting.since > HELLO_FOR {
            let (asked, since, waited) = (greeting.asked, greeting.since, now - greeting.since);
            if self.heartbeats > 0 && waited < HELLO_FOR + LATE_HELLO {
                greeting.due = greeting.since + HELLO_FOR + LATE_HELLO;
                return;
            }
            let LineCounters { frames, bad_checksum, malformed, .. } = self.link.counters();
            let damaged = bad_checksum + malformed;
            // Noise may hold text, but no checksum that a mistake explains.
            let breach = self.breaches.instead_of_an_answer(since);
            let by_mistake = breach.is_some_and(|breach| breach.rule == &rule::CHECKSUM);
            let error = match frames {
                // One damaged frame may be the rest of a frame: the port may have opened in the middle of it.
                0 if damaged > 1 && !by_mistake => BoardError::Garbled { damaged, asked, on_can: self.on_can() },
                _ => BoardError::NoAnswer { what: "HELLO", asked, waited, heard: self.heard_instead(since, None, now) },
            };
            if let Some(greeting) = self.greeting.take() {
                let _ = greeting.answer.send(Err(error));
            }
            return;
        }
        greeting.asked += 1;
        greeting.sent_at = now;
        // At 115,200 baud and below, five exchanges take half a second or more.
        greeting.due = now + HELLO_EVERY.max(self.link.exchange_time(HELLO_BYTES) * 5);
        let nonce = greeting.nonce;
        self.say_hello(nonce);
    }

    pub(super) fn say_hello(&mut self, nonce: u32) {
        let hello = HostHello { magic: MAGIC, lowest: PROTOCOL_VERSION, highest: PROTOCOL_VERSION, nonce };
        if let Ok(payload) = hello.to_payload() {
            self.send(Kind::Hello, Flags::default(), 0, 0, &payload);
        }
    }

    pub(super) fn hello(&mut self, payload: &[u8]) {
        let now = Instant::now();
        let hello = match BoardHello::from_payload(payload) {
            Ok(hello) if hello.magic == MAGIC => hello,
            Ok(_) => return self.audit.see(&rule::HELLO_LAYOUT, Case::Words("the magic is another one".into())),
            // The station's own HELLO comes back: an echo on the line.
            Err(_) if HostHello::from_payload(payload).is_ok_and(|hello| hello.magic == MAGIC) => {
                self.report.echoed = self.report.echoed.saturating_add(1);
                return;
            }
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
                let early = self.audit.watchdog(now);
                self.fail_all(&self.watchdog_ended(early));
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
        if [&hello.serial, &hello.firmware].into_iter().any(|text| text.contains('\0')) {
            let texts =
                format!("serial \"{}\", firmware \"{}\"", hello.serial.escape_debug(), hello.firmware.escape_debug());
            self.audit.see(&rule::NUL, Case::Words(texts));
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
        self.audit.see(&rule::HELLO_LATE, Case::Took(now - asked));
        self.hello_late += 1;
        if let Some((nonce, _)) = self.session
            && self.hello_late < HELLOS
        {
            self.hello_asked = Some(now);
            self.say_hello(nonce);
        }
    }
}
