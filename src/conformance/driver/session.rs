//! Sessions, and the states in which checks begin.

use std::time::Duration;

use gnc_protocol::message::{
    BoardHello, Heartbeat, HostHello, Identity, MAGIC, MakeSafe, ModulePower, capability, event,
};
use gnc_protocol::wire::{FieldReader, Wire as _};
use gnc_protocol::{Frame, Kind, timing};
use tokio::time::Instant;

use super::{Driver, Heard, ms};
use crate::raw::RawHeader;
use crate::stop::{Stop, Verdict, failed};

/// How often a HELLO is repeated, and how often in all: for 2 s and more (section 6).
const HELLO_EVERY: Duration = Duration::from_millis(500);
const HELLOS: u32 = 5;
/// Step from one nonce to the next: 2^32 divided by the golden ratio, so that no nonce comes again for 2^32 sessions.
const NONCE_STEP: u32 = 0x9E37_79B9;
/// A module answers Identity within this time of its power-on (section 11), asked so often.
const MODULE_STARTS_WITHIN: Duration = Duration::from_secs(10);
const IDENTITY_EVERY: Duration = Duration::from_millis(20);
/// A heartbeat comes each second; a little more, so that one is never missed by a hair.
pub(crate) const HEARTBEAT_WITHIN: Duration = Duration::from_millis(1300);

/// The state in which a check begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Begins {
    /// Whatever the board is in.
    Anyhow,
    /// A new session, the module without power.
    Session,
    /// A session, the module under power and ready, no request and no stream running.
    Powered,
}

impl Driver {
    /// Brings the board into the state in which a check begins.
    pub(crate) async fn begin(&mut self, begins: Begins) -> Verdict<()> {
        self.heard.clear();
        match begins {
            Begins::Anyhow => {
                self.ready = false;
                self.begin_tape();
                return Ok(());
            }
            Begins::Session => self.open().await?,
            Begins::Powered if self.ready => {}
            Begins::Powered => {
                self.open().await?;
                self.power_on().await.map_err(|stop| match stop {
                    Stop::Failed(what) => Stop::Unpowered(what),
                    other => other,
                })?;
            }
        }
        self.heard.clear();
        self.begin_tape();
        Ok(())
    }

    /// A nonce that was not used before.
    pub(crate) fn new_nonce(&mut self) -> u32 {
        self.nonce = self.nonce.wrapping_add(NONCE_STEP);
        self.nonce
    }

    /// The nonce of the last session.
    pub(crate) fn nonce(&self) -> u32 {
        self.nonce
    }

    /// Sends a HELLO; where its answer begins.
    pub(crate) fn say_hello(&mut self, (lowest, highest): (u8, u8), nonce: u32, request: u16) -> usize {
        let hello = HostHello { magic: MAGIC, lowest, highest, nonce };
        self.say_hello_bytes(&hello.to_payload().unwrap_or_default(), request)
    }

    /// Sends a HELLO with any payload.
    pub(crate) fn say_hello_bytes(&mut self, payload: &[u8], request: u16) -> usize {
        let from = self.mark();
        self.send(RawHeader { version: 0, kind: Kind::Hello as u8, flags: 0, request, message: 0 }, payload);
        from
    }

    /// Waits for a HELLO of the board; the frame and when it came.
    pub(crate) async fn hello_after(&mut self, from: usize, within: Duration) -> Verdict<Option<(Frame, Instant)>> {
        let place = self.until(from, within, |heard| heard.of(Kind::Hello).is_some()).await?;
        let heard = place.map(|place| &self.heard[place]);
        Ok(heard.and_then(|heard| heard.frame.clone().ok().map(|frame| (frame, heard.at))))
    }

    /// Greets the board once, and reads its answer.
    pub(crate) async fn greet(&mut self, range: (u8, u8), nonce: u32, request: u16) -> Verdict<BoardHello> {
        let from = self.say_hello(range, nonce, request);
        let Some((frame, _)) = self.hello_after(from, HELLO_EVERY).await? else {
            let came = self.came(from);
            return failed(format!("no answer to HELLO within {}; {came}", ms(HELLO_EVERY)));
        };
        match hello_of(&frame) {
            Some(hello) => Ok(hello),
            None => failed(format!("the board's HELLO, {} bytes, does not read", frame.payload.len())),
        }
    }

    /// Opens a new session and keeps it alive.
    pub(crate) async fn open(&mut self) -> Verdict<()> {
        self.ready = false;
        self.keep_alive = None;
        let nonce = self.new_nonce();
        let from = self.mark();
        for _ in 0..HELLOS {
            self.say_hello((1, 1), nonce, 0);
            // An answer to an earlier HELLO may still be on its way. A board that brings back another nonce is taken
            // all the same: one check says so, and the others are about other things.
            let own =
                |heard: &Heard| heard.of(Kind::Hello).and_then(hello_of).is_some_and(|hello| hello.nonce == nonce);
            let place = match self.until(from, HELLO_EVERY, own).await? {
                Some(place) => Some(place),
                None => self.until(from, Duration::ZERO, |heard| heard.of(Kind::Hello).is_some()).await?,
            };
            let Some(place) = place else { continue };
            let Some(hello) = self.heard[place].of(Kind::Hello).and_then(hello_of) else {
                return Err(Stop::Closed("the board's HELLO does not read, so no session can be opened".to_owned()));
            };
            if hello.chosen != 1 {
                return Err(Stop::Closed(format!("the board chose version {} of 1 to 1", hello.chosen)));
            }
            self.hello = hello;
            self.keep_alive = Some(Instant::now() + timing::KEEP_ALIVE_EVERY);
            return Ok(());
        }
        let came = self.came(from);
        Err(Stop::Closed(format!("no answer to {HELLOS} HELLOs, so no session can be opened; {came}")))
    }

    /// Switches the module on and waits until it says who it is.
    pub(crate) async fn power_on(&mut self) -> Verdict<()> {
        if self.can_do(capability::POWER) {
            self.ask(&ModulePower { on: 1 }).await?;
        }
        let end = Instant::now() + MODULE_STARTS_WITHIN;
        loop {
            let answer = self.call(&Identity {}).await?;
            match answer.body() {
                Ok(_) => break,
                Err(error) if Instant::now() >= end => return Err(error),
                Err(_) => self.listen(IDENTITY_EVERY).await?,
            }
        }
        self.ready = true;
        Ok(())
    }

    /// The state in the next heartbeat; none if no heartbeat comes, which other checks look at.
    pub(crate) async fn state_if_told(&mut self) -> Verdict<Option<Heartbeat>> {
        match self.heartbeat().await {
            Ok((beat, _)) => Ok(Some(beat)),
            Err(Stop::Failed(_)) => Ok(None),
            Err(other) => Err(other),
        }
    }

    /// Waits for the next heartbeat.
    pub(crate) async fn heartbeat(&mut self) -> Verdict<(Heartbeat, Instant)> {
        let from = self.mark();
        let Some(place) = self.until(from, HEARTBEAT_WITHIN, |heard| heard.is(Kind::Event, event::HEARTBEAT)).await?
        else {
            return failed(format!("no heartbeat within {}", ms(HEARTBEAT_WITHIN)));
        };
        let at = self.heard[place].at;
        match self.heard[place].of(Kind::Event).map(|frame| Heartbeat::from_payload(&frame.payload)) {
            Some(Ok(beat)) => Ok((beat, at)),
            _ => failed("the heartbeat does not read"),
        }
    }

    /// Makes the board safe at the end, whatever happened. Returns whether the board said that it did.
    pub(crate) async fn make_safe(&mut self) -> bool {
        self.heed_no_stop();
        self.forgive_silence();
        self.ready = false;
        let safe = match self.call(&MakeSafe {}).await {
            // Without a session the module is without power already.
            Ok(answer) if answer.nak() == Some(1) || answer.body().is_ok() => true,
            Err(Stop::Gone(_)) => false,
            // A new session makes the board safe as well.
            Ok(_) | Err(_) => {
                self.forgive_silence();
                self.open().await.is_ok()
            }
        };
        self.keep_alive = None;
        safe
    }
}

/// The board's HELLO in a frame. Bytes behind its last field are passed over: one check says so, and the others are about
/// other things.
fn hello_of(frame: &Frame) -> Option<BoardHello> {
    BoardHello::get(&mut FieldReader::new(&frame.payload)).ok()
}
