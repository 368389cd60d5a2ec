//! Section 9: signs of life, watchdog, safe state.

use std::time::Duration;

use gnc_protocol::can::{CanFrame, CanId};
use gnc_protocol::message::{
    Heartbeat, Identity, LinkCounters, MakeSafe, ModulePower, StreamStart, StreamStop, TimerMeasure, capability, event,
};
use gnc_protocol::{Call as _, Kind, PROTOCOL_VERSION};
use tokio::time::Instant;

use crate::check::checks;
use crate::driver::{Driver, HOST_ADDS, NO_MESSAGE, ms};
use crate::examples::slow;
use crate::raw::{Ending, RawHeader, delimited, frame_bytes, stuff};
use crate::stop::{Verdict, demand, failed, not_applicable};

checks! { 9:
    "heartbeat.layout" Anyhow layout "a heartbeat is boot id, board time and state: 13 bytes",
    "heartbeat.period" Anyhow period "the board sends a heartbeat every 1000 ms of link time",
    "heartbeat.clock" Session clock "board_time_us is the time since the board's start, by a clock that is as good as a crystal",
    "heartbeat.without-session" Session without_session "the heartbeat comes without a session too, and bit 0 of its state says so",
    "heartbeat.powered" Powered powered "bit 1 of the state says that the module is powered",
    "heartbeat.requests" Powered requests "bit 2 of the state says that requests run",
    "heartbeat.streams" Powered streams "bit 3 of the state says that streams run",
    "watchdog.fires" Session fires "1750 ms after the host's last sign of life the board ends the session and sends the watchdog event",
    "watchdog.once" Session once "the watchdog event comes once",
    "watchdog.safe" Powered safe "within 2 s of the host's last sign of life the board is safe: no request, no stream, no power",
    "watchdog.fed" Session fed "keep-alive, any REQUEST and an answered HELLO are signs of life",
    "watchdog.not-fed" Session not_fed "nothing else is a sign of life: no broken frame, no other version, none of the kinds that a board sends",
    "make-safe.state" Powered make_safe_state "MAKE_SAFE stops requests and streams and switches the module off, and keeps the session",
    "heartbeat.never-back" Anyhow never_back "board time never goes back under one boot id: all heartbeats so far",
    "power.needed" Session power_needed "the module is without power until ModulePower: a request that needs it gets NAK 6",
}

/// The watchdog's time, and a tick of the board's timer by which it may come early.
const WATCHDOG: Duration = Duration::from_millis(1750);
const EARLY: Duration = Duration::from_millis(10);
/// The board is safe within this time of the last sign of life, and the event comes no later.
const SAFE_WITHIN: Duration = Duration::from_millis(2000);
/// Time between two heartbeats, and how much later or earlier one may be by the board's own work.
const HEARTBEAT_EVERY: Duration = Duration::from_millis(1000);
const HEARTBEAT_OFF: Duration = Duration::from_millis(50);
/// Heartbeats that are timed.
const BEATS: usize = 4;
/// From one sign of life to the next in a chain: each alone is early enough, two apart are too late.
const CHAIN: Duration = Duration::from_millis(1300);
/// When something that is no sign of life is sent, after the last one.
const NO_SIGN_AT: Duration = Duration::from_millis(1000);

async fn layout(driver: &mut Driver) -> Verdict {
    let (beat, _) = driver.heartbeat().await?;
    demand(beat.state & 0xF0 == 0, || format!("state 0x{:02X}: bits 4 to 7 have no meaning", beat.state))?;
    Ok(format!("board time {:.1} s, state 0x{:02X}", beat.board_time_us as f64 / 1e6, beat.state))
}

/// Heartbeats one after the other.
async fn beats(driver: &mut Driver) -> Verdict<Vec<(Heartbeat, Instant)>> {
    let mut beats = Vec::new();
    for _ in 0..BEATS {
        beats.push(driver.heartbeat().await?);
    }
    Ok(beats)
}

async fn period(driver: &mut Driver) -> Verdict {
    let beats = beats(driver).await?;
    let slack = HEARTBEAT_OFF + HOST_ADDS;
    let mut furthest = Duration::ZERO;
    for pair in beats.windows(2) {
        let gap = pair[1].1 - pair[0].1;
        let off = gap.abs_diff(HEARTBEAT_EVERY);
        demand(off <= slack, || format!("{} from one to the next", ms(gap)))?;
        furthest = furthest.max(off);
    }
    Ok(format!("1000 ms to within {} over {BEATS}", ms(furthest)))
}

async fn clock(driver: &mut Driver) -> Verdict {
    let beats = beats(driver).await?;
    let [(first, began), .., (last, ended)] = beats.as_slice() else { return failed("too few heartbeats") };
    let link = *ended - *began;
    let Some(board_us) = last.board_time_us.checked_sub(first.board_time_us) else {
        return failed(format!("board time went back from {} to {} us", first.board_time_us, last.board_time_us));
    };
    let board = Duration::from_micros(board_us);
    // What this computer adds is thirty times what a crystal is off in this time.
    demand(board.abs_diff(link) <= HOST_ADDS, || {
        format!("board time went on by {}, the wall clock by {}", ms(board), ms(link))
    })?;
    Ok(format!("{} of board time in {}", ms(board), ms(link)))
}

async fn never_back(driver: &mut Driver) -> Verdict {
    let (beats, back) = driver.clock_of_all();
    match back {
        Some((before_us, after_us)) => failed(format!("board time went back from {before_us} to {after_us} us")),
        None if beats < 2 => not_applicable(format!("{beats} heartbeats came")),
        None => Ok(format!("{beats} heartbeats")),
    }
}

/// Ends the check as failed unless bit `bit` of the next heartbeat's state is `set`.
async fn state(driver: &mut Driver, bit: u8, set: bool, when: &str) -> Verdict<()> {
    let (beat, _) = driver.heartbeat().await?;
    demand((beat.state & 1 << bit != 0) == set, || {
        format!("{when}, bit {bit} is {}: state 0x{:02X}", u8::from(!set), beat.state)
    })
}

async fn without_session(driver: &mut Driver) -> Verdict {
    state(driver, 0, true, "in a session").await?;
    let nonce = driver.new_nonce();
    driver.greet((200, 201), nonce, 1).await?;
    driver.fall_silent();
    for _ in 0..2 {
        state(driver, 0, false, "without a session").await?;
    }
    Ok("bit 0 is 1 with and 0 without".to_owned())
}

async fn powered(driver: &mut Driver) -> Verdict {
    driver.needs(capability::POWER)?;
    state(driver, 1, true, "with power").await?;
    driver.disturb();
    driver.ask(&ModulePower { on: 0 }).await?;
    state(driver, 1, false, "after ModulePower off").await?;
    Ok("bit 1 is 1 with and 0 without".to_owned())
}

async fn requests(driver: &mut Driver) -> Verdict {
    let asked = driver.post(&TimerMeasure { timer: 0, period_us: 100_000, count: 15 });
    driver.accepted(&asked).await?;
    state(driver, 2, true, "while TimerMeasure runs").await?;
    driver.end_of(&asked).await?;
    state(driver, 2, false, "after its RESULT").await?;
    Ok("bit 2 is 1 while TimerMeasure runs and 0 after".to_owned())
}

/// A slow stream that fits on any line.
fn slow_stream() -> StreamStart {
    StreamStart { stream: 1, rate_hz: 50, count: 0, samples_per_frame: 1 }
}

async fn streams(driver: &mut Driver) -> Verdict {
    driver.ask(&slow_stream()).await?;
    state(driver, 3, true, "while a stream runs").await?;
    driver.ask(&StreamStop { stream: 1 }).await?;
    state(driver, 3, false, "after StreamStop").await?;
    Ok("bit 3 is 1 while a stream runs and 0 after".to_owned())
}

/// Waits for the watchdog's event; when it came.
async fn event_after(driver: &mut Driver, from: usize, within: Duration) -> Verdict<Option<Instant>> {
    let place = driver.until(from, within, |heard| heard.is(Kind::Event, event::WATCHDOG)).await?;
    Ok(place.map(|place| driver.heard()[place].at))
}

/// The last sign of life of a host that then falls silent.
async fn last_sign(driver: &mut Driver) -> Verdict<Instant> {
    let answer = driver.call(&LinkCounters {}).await?;
    driver.fall_silent();
    Ok(answer.asked.sent)
}

/// The latest moment of the watchdog's event after a sign of life, as seen here.
fn latest(driver: &Driver) -> Duration {
    SAFE_WITHIN + driver.line_time(0) * 2 + HOST_ADDS
}

/// Ends the check as failed unless the watchdog's event comes when it must after `sign`.
async fn fires_after(driver: &mut Driver, sign: Instant, from: usize, what: &str) -> Verdict<Duration> {
    let latest = latest(driver);
    let Some(at) = event_after(driver, from, (sign + latest).saturating_duration_since(Instant::now())).await? else {
        return failed(format!("no watchdog event within {} of {what}", ms(latest)));
    };
    let after = at - sign;
    demand(after + EARLY >= WATCHDOG, || format!("the watchdog event came {} after {what}", ms(after)))?;
    Ok(after)
}

async fn fires(driver: &mut Driver) -> Verdict {
    let from = driver.mark();
    let sign = last_sign(driver).await?;
    let after = fires_after(driver, sign, from, "the last REQUEST").await?;
    let asked = driver.post(&LinkCounters {});
    driver.refused(&asked, 1, "after the watchdog event").await?;
    Ok(format!("after {}, then NAK 1", ms(after)))
}

async fn once(driver: &mut Driver) -> Verdict {
    let from = driver.mark();
    let sign = last_sign(driver).await?;
    let latest = latest(driver);
    if event_after(driver, from, (sign + latest).saturating_duration_since(Instant::now())).await?.is_none() {
        return failed(format!("none within {} of the last sign of life", ms(latest)));
    }
    driver.listen(SAFE_WITHIN).await?;
    let events = driver.heard()[from..].iter().filter(|heard| heard.is(Kind::Event, event::WATCHDOG)).count();
    demand(events == 1, || format!("{events} events in 2 s"))?;
    Ok("one in 2 s more of silence".to_owned())
}

async fn safe(driver: &mut Driver) -> Verdict {
    driver.ask(&slow_stream()).await?;
    let asked = driver.post(&TimerMeasure { timer: 0, period_us: 100_000, count: 50 });
    driver.accepted(&asked).await?;
    driver.fall_silent();
    let latest = latest(driver);
    driver.listen((asked.sent + latest).saturating_duration_since(Instant::now())).await?;
    let from = driver.mark();
    let (beat, _) = driver.heartbeat().await?;
    demand(beat.state & 0x0F == 0, || format!("state 0x{:02X} in the heartbeat after {}", beat.state, ms(latest)))?;
    let late = driver.heard()[from..].iter().find(|heard| heard.of(Kind::Event).is_none());
    demand(late.is_none(), || format!("after 2 s of silence {}", driver.came(from)))?;
    let ended = driver.heard()[asked.from..].iter().any(|heard| heard.is(Kind::Result, TimerMeasure::ID));
    demand(!ended, || "the request that the watchdog ended got a RESULT".to_owned())?;
    Ok("state 0 after a request and a stream, no RESULT, no sample".to_owned())
}

/// Something that a host can send.
type Sign = (&'static str, fn(&mut Driver));

/// What feeds the watchdog.
const SIGNS: [Sign; 6] = [
    ("a keep-alive", |driver| driver.send_keep_alive()),
    ("a REQUEST", |driver| {
        driver.post(&LinkCounters {});
    }),
    ("a keep-alive with a payload", |driver| {
        let keep_alive = CanFrame::new(CanId::Standard(gnc_protocol::can::id::KEEP_ALIVE), &[1, 2, 3]);
        match keep_alive.filter(|_| driver.is_can()) {
            Some(frame) => driver.send_can(frame),
            None => driver.send_event(PROTOCOL_VERSION, event::KEEP_ALIVE, &[1, 2, 3]),
        }
    }),
    ("a REQUEST that is refused", |driver| {
        driver.post_raw(NO_MESSAGE, &[]);
    }),
    ("a REQUEST that was sent before", |driver| {
        driver.post_as(PROTOCOL_VERSION, 0, 0x7AAA, LinkCounters::ID, &[]);
        driver.post_as(PROTOCOL_VERSION, 1, 0x7AAA, LinkCounters::ID, &[]);
    }),
    ("a HELLO with the same nonce", |driver| {
        let nonce = driver.nonce();
        driver.say_hello((1, 1), nonce, 1);
    }),
];

async fn fed(driver: &mut Driver) -> Verdict {
    let from = driver.mark();
    let mut sign = last_sign(driver).await?;
    for (what, send) in SIGNS {
        let due = (sign + CHAIN).saturating_duration_since(Instant::now());
        if event_after(driver, from, due).await?.is_some() {
            return failed("the watchdog event came too early after a sign of life");
        }
        let before = sign;
        sign = Instant::now();
        send(driver);
        // If this is no sign of life, the event belongs to the one before it.
        let until = (before + latest(driver)).saturating_duration_since(Instant::now());
        demand(event_after(driver, from, until).await?.is_none(), || format!("{what} did not feed the watchdog"))?;
    }
    fires_after(driver, sign, from, "the last of them").await?;
    Ok(format!("{} kinds", SIGNS.len()))
}

/// Sends a frame that is made by hand.
fn by_hand(driver: &mut Driver, version: u8, kind: u8, message: u16, spoil: u8) {
    let header = RawHeader { version, kind, flags: 0, request: 0, message };
    let mut bytes = frame_bytes(header, driver.take_sequence(), &[]);
    if let Some(last) = bytes.last_mut() {
        *last ^= spoil;
    }
    driver.send_bytes(&delimited(&stuff(&bytes, Ending::Bare)));
}

const EVENT: u8 = Kind::Event as u8;

/// What does not feed the watchdog on RS-422.
const NO_SIGNS: [Sign; 7] = [
    ("a keep-alive with a wrong checksum", |driver| by_hand(driver, PROTOCOL_VERSION, EVENT, event::KEEP_ALIVE, 1)),
    ("a keep-alive of version 2", |driver| by_hand(driver, 2, EVENT, event::KEEP_ALIVE, 0)),
    ("the echo of a heartbeat", |driver| driver.send_event(PROTOCOL_VERSION, event::HEARTBEAT, &[0; 13])),
    ("an EVENT with an unknown message id", |driver| driver.send_event(PROTOCOL_VERSION, NO_MESSAGE, &[])),
    ("the echo of an ACCEPT", |driver| by_hand(driver, PROTOCOL_VERSION, Kind::Accept as u8, LinkCounters::ID, 0)),
    ("a frame of kind 9", |driver| by_hand(driver, PROTOCOL_VERSION, 9, event::KEEP_ALIVE, 0)),
    ("bytes that are no frame", |driver| driver.send_bytes(&[0, 0x55, 0x55, 0, 1, 0])),
];

/// What does not feed it on any link.
const NO_SIGNS_ANYWHERE: [Sign; 2] = [
    ("a REQUEST of version 2", |driver| {
        let request = driver.next_request();
        driver.post_as(2, 0, request, LinkCounters::ID, &[]);
    }),
    ("a HELLO without the magic", |driver| {
        driver.say_hello_bytes(&[0; 10], 1);
    }),
];

/// Whether the watchdog fires in its time although these are sent after the last sign of life.
async fn fires_despite(driver: &mut Driver, sent: &[Sign]) -> Verdict<bool> {
    let from = driver.mark();
    let sign = last_sign(driver).await?;
    driver.listen((sign + NO_SIGN_AT).saturating_duration_since(Instant::now())).await?;
    for (_, send) in sent {
        send(driver);
    }
    let until = (sign + latest(driver)).saturating_duration_since(Instant::now());
    Ok(event_after(driver, from, until).await?.is_some())
}

async fn not_fed(driver: &mut Driver) -> Verdict {
    let mut sent = NO_SIGNS_ANYWHERE.to_vec();
    if !driver.is_can() {
        sent.extend(NO_SIGNS);
    }
    if fires_despite(driver, &sent).await? {
        return Ok(format!("{} of them changed nothing", sent.len()));
    }
    driver.open().await?;
    if !fires_despite(driver, &[]).await? {
        return failed("the watchdog does not fire, whatever is sent");
    }
    let mut feeds = Vec::new();
    for one in &sent {
        driver.open().await?;
        if !fires_despite(driver, &[*one]).await? {
            feeds.push(one.0);
        }
    }
    failed(format!("these feed the watchdog: {}", feeds.join(", ")))
}

async fn make_safe_state(driver: &mut Driver) -> Verdict {
    driver.disturb();
    driver.ask(&slow_stream()).await?;
    let asked = driver.post(&slow());
    driver.accepted(&asked).await?;
    let safe = driver.call(&MakeSafe {}).await?;
    safe.body()?;
    let from = driver.mark();
    let (beat, _) = driver.heartbeat().await?;
    let powered = if driver.can_do(capability::POWER) { 0x02 } else { 0 };
    demand(beat.state & (0x0C | powered) == 0, || format!("state 0x{:02X} after it", beat.state))?;
    demand(beat.state & 1 == 1, || format!("state 0x{:02X}: no session after it", beat.state))?;
    let sample = driver.heard()[from..].iter().find(|heard| heard.of(Kind::Stream).is_some());
    demand(sample.is_none(), || "a STREAM frame followed its RESULT".to_owned())?;
    Ok(format!("state 0x{:02X}", beat.state))
}

async fn power_needed(driver: &mut Driver) -> Verdict {
    driver.needs(capability::POWER)?;
    let mut tried = 0;
    for (message, payload) in crate::examples::examples() {
        let calibration = (0x0023..=0x0025).contains(&message);
        // Without power and without a calibration that was written, a commit has two reasons, in any order.
        let either = message == 0x0024;
        if message < Identity::ID
            || message == StreamStop::ID
            || either
            || calibration && !driver.can_do(capability::CALIBRATION)
        {
            continue;
        }
        let asked = driver.post_raw(message, &payload);
        let place = driver.first_answer(&asked).await?;
        let nak = driver.heard()[place].of(Kind::Nak);
        let code = nak.and_then(|frame| frame.payload.first_chunk().map(|code| u16::from_le_bytes(*code)));
        if code != Some(9) {
            driver.refused(&asked, 6, "without power").await?;
        }
        tried += 1;
    }
    Ok(format!("{tried} messages got NAK 6"))
}
