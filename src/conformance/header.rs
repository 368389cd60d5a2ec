//! Section 4: the header.

use std::time::Duration;

use gnc_protocol::message::{ErrorRecords, HostHello, LinkCounters, MAGIC, event};
use gnc_protocol::wire::Wire as _;
use gnc_protocol::{Call as _, Kind, PROTOCOL_VERSION};

use crate::check::checks;
use crate::driver::{Driver, HEARTBEAT_WITHIN, NO_MESSAGE, kind_name};
use crate::raw::RawHeader;
use crate::stop::{Verdict, demand, failed, not_applicable};

checks! { 4:
    "header.hello" Session hello "HELLO carries version 0, message id 0 and no flags",
    "header.version" Session version "all frames but HELLO carry version 1",
    "header.ids" Session ids "ACCEPT, RESULT and NAK carry request id and message id of the request",
    "header.event" Session events "an EVENT carries request id 0",
    "header.flags" Session flags "unknown flags are sent as 0, and REPLAYED only when a RESULT is repeated",
    "header.ignored-flags" Session ignored_flags "unknown flags are ignored",
    "header.sequence" Session sequence "sequence numbers count the frames of one direction, +1 each",
    "header.host-sequence" Session host_sequence "a host starts with any number, and a jump changes nothing",
    "header.other-version" Session other_version "a REQUEST of another version gets NAK 2",
    "header.any-hello" Session any_hello "the board looks at neither version nor message id of a HELLO",
    "header.echoes" Session echoes "the board drops kinds that only a board sends",
    "header.unknown-event" Session unknown_event "a receiver passes over an EVENT with an unknown message id",
}

/// How long a frame without an answer is watched.
const NO_ANSWER_WITHIN: Duration = Duration::from_millis(150);
/// Flags with a meaning.
const KNOWN_FLAGS: u8 = 0x03;

/// Some frames of each kind that a board sends without power.
/// Requests over which sequence numbers are followed.
const NUMBERED: usize = 40;

async fn some_traffic(driver: &mut Driver) -> Verdict<()> {
    for _ in 0..3 {
        driver.ask(&LinkCounters {}).await?;
        let asked = driver.post_raw(NO_MESSAGE, &[]);
        driver.first_answer(&asked).await?;
    }
    driver.until(0, HEARTBEAT_WITHIN, |heard| heard.is(Kind::Event, event::HEARTBEAT)).await?;
    Ok(())
}

async fn hello(driver: &mut Driver) -> Verdict {
    let nonce = driver.nonce();
    let from = driver.say_hello((1, 1), nonce, 9);
    let Some((frame, _)) = driver.hello_after(from, Duration::from_millis(500)).await? else {
        return failed(format!("no answer to HELLO; {}", driver.came(from)));
    };
    let header = frame.header;
    demand(header.version == 0, || format!("version {}", header.version))?;
    demand(header.message == 0, || format!("message id 0x{:04X}", header.message))?;
    demand(header.flags.0 == 0, || format!("flags 0x{:02X}", header.flags.0))?;
    Ok("version 0, message id 0, flags 0".to_owned())
}

async fn version(driver: &mut Driver) -> Verdict {
    some_traffic(driver).await?;
    let frames = driver.heard().iter().filter_map(|heard| heard.frame.as_ref().ok());
    let frames: Vec<_> = frames.filter(|frame| frame.header.kind != Kind::Hello).collect();
    for frame in &frames {
        let (version, kind) = (frame.header.version, kind_name(frame.header.kind));
        demand(version == PROTOCOL_VERSION, || format!("{kind} with version {version}"))?;
    }
    Ok(format!("{} frames of version 1", frames.len()))
}

async fn ids(driver: &mut Driver) -> Verdict {
    let mut asked = Vec::new();
    for (request, message) in [(0x0102, LinkCounters::ID), (0xFFFF, ErrorRecords::ID), (0x8001, NO_MESSAGE)] {
        let payload: &[u8] = if message == ErrorRecords::ID { &[0, 0] } else { &[] };
        let sent = driver.post_as(PROTOCOL_VERSION, 0, request, message, payload);
        driver.end_of(&sent).await?;
        asked.push((request, message));
    }
    for heard in driver.heard() {
        let Ok(frame) = &heard.frame else { continue };
        let (kind, ids) = (frame.header.kind, (frame.header.request, frame.header.message));
        if matches!(kind, Kind::Accept | Kind::Progress | Kind::Result | Kind::Nak) && !asked.contains(&ids) {
            return failed(format!(
                "{} of request {}, message 0x{:04X}, that nobody asked",
                kind_name(kind),
                ids.0,
                ids.1
            ));
        }
    }
    Ok("3 requests".to_owned())
}

async fn events(driver: &mut Driver) -> Verdict {
    some_traffic(driver).await?;
    let events: Vec<_> = driver.heard().iter().filter_map(|heard| heard.of(Kind::Event)).collect();
    for event in &events {
        demand(event.header.request == 0, || format!("an EVENT with request id {}", event.header.request))?;
    }
    if events.is_empty() {
        return not_applicable("no EVENT came");
    }
    Ok(format!("{} of {}", events.len(), events.len()))
}

async fn flags(driver: &mut Driver) -> Verdict {
    some_traffic(driver).await?;
    for heard in driver.heard() {
        let Ok(frame) = &heard.frame else { continue };
        let (kind, flags) = (kind_name(frame.header.kind), frame.header.flags.0);
        demand(flags & !KNOWN_FLAGS == 0, || format!("{kind} with unknown flags: 0x{flags:02X}"))?;
        demand(flags == 0, || format!("{kind} with flags 0x{flags:02X} where nothing was asked twice"))?;
    }
    Ok(format!("{} frames without flags", driver.heard().len()))
}

async fn ignored_flags(driver: &mut Driver) -> Verdict {
    let request = driver.next_request();
    let asked = driver.post_as(PROTOCOL_VERSION, 0xFC, request, LinkCounters::ID, &[]);
    let answer = driver.end_of(&asked).await?;
    answer.body()?;
    let request = driver.next_request();
    let asked = driver.post_as(PROTOCOL_VERSION, 0x01, request, LinkCounters::ID, &[]);
    let answer = driver.end_of(&asked).await?;
    demand(!answer.is_replayed(), || "a first REQUEST with the flag RESENT got a REPLAYED RESULT".to_owned())?;
    answer.body()?;
    Ok("flags 0xFC, and RESENT on a first REQUEST, changed nothing".to_owned())
}

async fn sequence(driver: &mut Driver) -> Verdict {
    some_traffic(driver).await?;
    for _ in 0..NUMBERED {
        driver.ask(&LinkCounters {}).await?;
    }
    // On CAN each id counts its own messages; all of this traffic goes under one, and raw frames have no numbers.
    let frames = driver.heard().iter().filter_map(|heard| heard.frame.as_ref().ok());
    let numbers: Vec<u16> = frames
        .filter(|frame| !driver.is_can() || frame.header.kind != Kind::Event)
        .map(|frame| frame.header.sequence)
        .collect();
    for pair in numbers.windows(2) {
        demand(pair[1] == pair[0].wrapping_add(1), || format!("{} was followed by {}", pair[0], pair[1]))?;
    }
    let (first, last) = (numbers.first().copied().unwrap_or(0), numbers.last().copied().unwrap_or(0));
    Ok(format!("{} frames, {first} to {last}", numbers.len()))
}

async fn host_sequence(driver: &mut Driver) -> Verdict {
    driver.on_rs422()?;
    for start in [0xFFFE_u16, 5, 0x8000] {
        driver.set_sequence(start);
        for _ in 0..3 {
            driver.ask(&LinkCounters {}).await?;
        }
    }
    Ok("9 requests over 3 jumps and a wrap were done".to_owned())
}

async fn other_version(driver: &mut Driver) -> Verdict {
    for version in [2, 0, 15] {
        let request = driver.next_request();
        let asked = driver.post_as(version, 0, request, LinkCounters::ID, &[]);
        driver.refused(&asked, 2, &format!("of version {version}")).await?;
    }
    driver.ask(&LinkCounters {}).await?;
    Ok("versions 0, 2 and 15 got NAK 2".to_owned())
}

async fn any_hello(driver: &mut Driver) -> Verdict {
    let nonce = driver.nonce();
    let payload = HostHello { magic: MAGIC, lowest: 1, highest: 1, nonce }.to_payload().unwrap_or_default();
    for (version, message) in [(1, 0), (7, 0), (0, 0x0055)] {
        // Such a HELLO goes under the other id of the bus, where none is expected.
        let from = driver.mark();
        driver.send(RawHeader { version, kind: Kind::Hello as u8, flags: 0, request: 3, message }, &payload);
        let answer = driver.hello_after(from, Duration::from_millis(500)).await?;
        demand(answer.is_some(), || {
            format!("a HELLO with version {version} and message id 0x{message:04X} got no answer")
        })?;
    }
    Ok("3 of them were answered".to_owned())
}

async fn echoes(driver: &mut Driver) -> Verdict {
    driver.on_rs422()?;
    let from = driver.mark();
    let kinds = [Kind::Accept, Kind::Progress, Kind::Result, Kind::Stream, Kind::Nak];
    let first = driver.next_request();
    for kind in kinds {
        let header = RawHeader {
            version: PROTOCOL_VERSION,
            kind: kind as u8,
            flags: 0,
            request: first,
            message: LinkCounters::ID,
        };
        driver.send(header, &[0; 26]);
    }
    driver.send_event(PROTOCOL_VERSION, event::HEARTBEAT, &[0; 13]);
    driver.send_event(PROTOCOL_VERSION, event::WATCHDOG, &[]);
    driver.listen(NO_ANSWER_WITHIN).await?;
    let answer = driver.heard()[from..].iter().find(|heard| !heard.is(Kind::Event, event::HEARTBEAT));
    demand(answer.is_none(), || format!("they were answered; {}", driver.came(from)))?;
    let asked = driver.post_as(PROTOCOL_VERSION, 0, first, LinkCounters::ID, &[]);
    driver.end_of(&asked).await?.body()?;
    Ok("7 of them got no answer and changed nothing".to_owned())
}

async fn unknown_event(driver: &mut Driver) -> Verdict {
    driver.on_rs422()?;
    let from = driver.mark();
    for message in [0, 0x0004, NO_MESSAGE] {
        driver.send_event(PROTOCOL_VERSION, message, &[1, 2, 3]);
    }
    driver.listen(NO_ANSWER_WITHIN).await?;
    let answer = driver.heard()[from..].iter().find(|heard| !heard.is(Kind::Event, event::HEARTBEAT));
    demand(answer.is_none(), || format!("they were answered; {}", driver.came(from)))?;
    driver.ask(&LinkCounters {}).await?;
    Ok("3 of them got no answer, and the session went on".to_owned())
}
