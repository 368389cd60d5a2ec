//! Section 6: sessions.

use std::time::Duration;

use gnc_protocol::message::{BoardHello, ErrorRecords, Heartbeat, HostHello, LinkCounters, MAGIC, TimerMeasure};
use gnc_protocol::wire::Wire as _;
use gnc_protocol::{Call as _, Kind, PROTOCOL_VERSION};

use crate::check::checks;
use crate::driver::{Driver, ms};
use crate::examples::slow;
use crate::stop::{Verdict, demand, failed, not_applicable};

checks! { 6:
    "hello.layout" Anyhow layout "the board's HELLO has its layout, magic, versions and texts",
    "hello.capabilities" Session capabilities "bits of the capabilities beyond 0 to 3 are 0",
    "hello.time" Session time "a board that runs answers HELLO within 50 ms, wire time not counted",
    "hello.nonce" Session nonce "HELLO brings back the host's nonce",
    "hello.request-id" Session request_id "HELLO brings back the request id, also 0",
    "hello.boot-id" Session boot_id "HELLO and heartbeat carry the same boot id, the same in every session",
    "hello.same-nonce" Session same_nonce "a HELLO with the same nonce is answered and changes nothing",
    "hello.new-nonce" Session new_nonce "a new nonce forgets kept results",
    "hello.new-nonce-running" Powered new_nonce_running "a new nonce forgets running requests without a RESULT",
    "hello.new-nonce-safe" Powered new_nonce_safe "the module is without power at the start of every session",
    "hello.no-common-version" Session no_common_version "without a common version, chosen is 0 and the session ends, whatever the nonce",
    "hello.empty-range" Session empty_range "a range with lowest above highest is empty, and lowest 0 is a number like any other",
    "hello.malformed" Session malformed "a HELLO that is too short, too long or without the magic is dropped in silence and changes nothing",
    "session.none" Session none "a REQUEST without a session gets NAK 1, whatever it asks for",
}

/// A wait after which a HELLO is taken for unanswered: ten times what the document allows.
const NOTHING_WITHIN: Duration = Duration::from_millis(500);
/// Greetings that are timed.
const GREETINGS: u16 = 5;
/// Bits of the capabilities that have a meaning.
const KNOWN_CAPABILITIES: u32 = 0b1111;

async fn layout(driver: &mut Driver) -> Verdict {
    let nonce = driver.nonce();
    let from = driver.say_hello((1, 1), nonce, 7);
    let Some((frame, _)) = driver.hello_after(from, NOTHING_WITHIN).await? else {
        return failed(format!("no answer to HELLO; {}", driver.came(from)));
    };
    let hello = match BoardHello::from_payload(&frame.payload) {
        Ok(hello) => hello,
        Err(error) => return failed(format!("{} bytes do not read as HELLO: {error}", frame.payload.len())),
    };
    demand(hello.magic == MAGIC, || format!("the magic is {:02X?}", hello.magic))?;
    demand(hello.chosen == 1, || format!("version {} was chosen of 1 to 1", hello.chosen))?;
    let range = hello.lowest..=hello.highest;
    demand(range.contains(&1), || format!("versions {} to {} do not hold the chosen 1", hello.lowest, hello.highest))?;
    let texts = [("serial", &hello.serial), ("firmware", &hello.firmware)];
    for (name, text) in texts {
        demand(!text.chars().any(char::is_control), || format!("the {name} holds control characters: {text:?}"))?;
    }
    Ok(format!("{} bytes, versions {} to {}", frame.payload.len(), hello.lowest, hello.highest))
}

async fn capabilities(driver: &mut Driver) -> Verdict {
    let bits = driver.board().capabilities;
    demand(bits & !KNOWN_CAPABILITIES == 0, || format!("capabilities 0x{bits:08X}"))?;
    Ok(format!("0x{bits:08X}"))
}

async fn time(driver: &mut Driver) -> Verdict {
    let nonce = driver.nonce();
    let mut longest = Duration::ZERO;
    for request in 1..=GREETINGS {
        let sent = tokio::time::Instant::now();
        let from = driver.say_hello((1, 1), nonce, request);
        let Some((frame, at)) = driver.hello_after(from, NOTHING_WITHIN).await? else {
            return failed(format!("HELLO {request} of {GREETINGS} was not answered; {}", driver.came(from)));
        };
        let limit = driver.quiet_accept_limit(10, frame.payload.len());
        demand(at - sent <= limit, || format!("the answer came after {}, at most {} here", ms(at - sent), ms(limit)))?;
        longest = longest.max(at - sent);
    }
    Ok(format!("at most {} of {GREETINGS}", ms(longest)))
}

async fn nonce(driver: &mut Driver) -> Verdict {
    for _ in 0..3 {
        let nonce = driver.new_nonce();
        let hello = driver.greet((1, 1), nonce, 1).await?;
        demand(hello.nonce == nonce, || format!("nonce 0x{nonce:08X} came back as 0x{:08X}", hello.nonce))?;
    }
    Ok("3 nonces came back".to_owned())
}

async fn request_id(driver: &mut Driver) -> Verdict {
    let nonce = driver.nonce();
    for request in [0, 1, 0xFFFF] {
        let from = driver.say_hello((1, 1), nonce, request);
        let Some((frame, _)) = driver.hello_after(from, NOTHING_WITHIN).await? else {
            return failed(format!("HELLO with request id {request} was not answered; {}", driver.came(from)));
        };
        let came = frame.header.request;
        demand(came == request, || format!("request id {request} came back as {came}"))?;
    }
    Ok("0, 1 and 65535 came back".to_owned())
}

async fn boot_id(driver: &mut Driver) -> Verdict {
    let boot_id = driver.board().boot_id;
    let nonce = driver.new_nonce();
    let again = driver.greet((1, 1), nonce, 1).await?.boot_id;
    demand(again == boot_id, || format!("boot id 0x{boot_id:08X}, in the next session 0x{again:08X}"))?;
    let Some(Heartbeat { boot_id: beats, .. }) = driver.state_if_told().await? else {
        return not_applicable("no heartbeat came");
    };
    demand(beats == boot_id, || format!("HELLO says 0x{boot_id:08X}, the heartbeat 0x{beats:08X}"))?;
    Ok(format!("0x{boot_id:08X}"))
}

/// A request whose second run would give another result: the counters of the link move with every frame.
async fn done_once(driver: &mut Driver) -> Verdict<crate::driver::Answer> {
    let answer = driver.call(&LinkCounters {}).await?;
    answer.body()?;
    Ok(answer)
}

async fn same_nonce(driver: &mut Driver) -> Verdict {
    let before = done_once(driver).await?;
    let nonce = driver.nonce();
    driver.greet((1, 1), nonce, 1).await?;
    let asked = driver.post_again(&before.asked, &LinkCounters {});
    let after = driver.end_of(&asked).await?;
    demand(after.is_replayed(), || {
        format!("a result from before the second HELLO was asked for again and came as {}", after.words())
    })?;
    Ok("a result from before it was still kept".to_owned())
}

async fn new_nonce(driver: &mut Driver) -> Verdict {
    let before = done_once(driver).await?;
    driver.open().await?;
    let asked = driver.post_again(&before.asked, &LinkCounters {});
    let after = driver.end_of(&asked).await?;
    demand(!after.is_replayed(), || "a result of the session before was repeated".to_owned())?;
    after.body()?;
    Ok("the request of the session before was a new one".to_owned())
}

async fn new_nonce_running(driver: &mut Driver) -> Verdict {
    let asked = driver.post(&slow());
    driver.accepted(&asked).await?;
    driver.open().await?;
    let from = driver.mark();
    driver.listen(Duration::from_millis(700)).await?;
    let late = driver.heard()[from..].iter().find(|heard| {
        let answer = heard.of(Kind::Result).or_else(|| heard.of(Kind::Progress));
        answer.is_some_and(|frame| frame.header.request == asked.request)
    });
    demand(late.is_none(), || {
        format!("a request of the session before was answered after HELLO; {}", driver.came(from))
    })?;
    let state = driver.state_if_told().await?.map_or(0, |beat| beat.state);
    demand(state & 4 == 0, || format!("the heartbeat says that requests run: state 0x{state:02X}"))?;
    Ok("no frame of it came in 700 ms".to_owned())
}

async fn new_nonce_safe(driver: &mut Driver) -> Verdict {
    driver.needs(gnc_protocol::message::capability::POWER)?;
    driver.open().await?;
    let asked = driver.post(&gnc_protocol::message::Identity {});
    driver.refused(&asked, 6, "in a new session").await?;
    let state = driver.state_if_told().await?.map_or(0, |beat| beat.state);
    demand(state & 2 == 0, || format!("the heartbeat says that the module is powered: state 0x{state:02X}"))?;
    Ok("Identity got NAK 6, and no heartbeat says power".to_owned())
}

/// Ends the check as failed unless the session is gone.
async fn no_session(driver: &mut Driver, after: &str) -> Verdict<()> {
    let asked = driver.post(&ErrorRecords { from: 0 });
    driver.refused(&asked, 1, after).await.map(|_| ())
}

async fn no_common_version(driver: &mut Driver) -> Verdict {
    for same in [false, true] {
        driver.open().await?;
        let nonce = if same { driver.nonce() } else { driver.new_nonce() };
        let words = if same { "under the nonce of the session" } else { "under a new nonce" };
        let hello = driver.greet((200, 201), nonce, 1).await?;
        driver.fall_silent();
        demand(hello.chosen == 0, || format!("versions 200 to 201 {words}: version {} was chosen", hello.chosen))?;
        no_session(driver, &format!("after a HELLO without a common version {words}")).await?;
    }
    Ok("chosen 0, then NAK 1, under both nonces".to_owned())
}

async fn empty_range(driver: &mut Driver) -> Verdict {
    let nonce = driver.new_nonce();
    let hello = driver.greet((2, 1), nonce, 1).await?;
    demand(hello.chosen == 0, || format!("of versions 2 to 1, version {} was chosen", hello.chosen))?;
    let nonce = driver.new_nonce();
    let hello = driver.greet((0, 1), nonce, 1).await?;
    demand(hello.chosen == 1, || format!("of versions 0 to 1, version {} was chosen", hello.chosen))?;
    let nonce = driver.new_nonce();
    let hello = driver.greet((1, 255), nonce, 1).await?;
    demand((1..=hello.highest).contains(&hello.chosen) && hello.chosen == hello.highest, || {
        format!("of versions 1 to 255, version {} was chosen, the board speaks up to {}", hello.chosen, hello.highest)
    })?;
    Ok("2 to 1 gives 0, 0 to 1 gives 1".to_owned())
}

async fn malformed(driver: &mut Driver) -> Verdict {
    let before = done_once(driver).await?;
    let nonce = driver.new_nonce();
    let good = HostHello { magic: MAGIC, lowest: 1, highest: 1, nonce }.to_payload().unwrap_or_default();
    let mut long = good.to_vec();
    long.push(0);
    let mut strange = good.to_vec();
    strange[0] ^= 0x20;
    for (what, payload) in
        [("too short", &good[..9]), ("too long", &long), ("without the magic", &strange), ("empty", &[])]
    {
        let from = driver.say_hello_bytes(payload, 1);
        let answer = driver.hello_after(from, Duration::from_millis(150)).await?;
        demand(answer.is_none(), || format!("a HELLO that is {what} was answered"))?;
    }
    let asked = driver.post_again(&before.asked, &LinkCounters {});
    let after = driver.end_of(&asked).await?;
    demand(after.is_replayed(), || format!("after them, a result of the session came as {}", after.words()))?;
    Ok("4 of them got no answer, and the session went on".to_owned())
}

async fn none(driver: &mut Driver) -> Verdict {
    let nonce = driver.new_nonce();
    driver.greet((200, 201), nonce, 1).await?;
    driver.fall_silent();
    let long = [0; 100];
    let requests: [(u16, &[u8]); 5] = [
        (ErrorRecords::ID, &[0, 0]),
        (gnc_protocol::message::MakeSafe::ID, &[]),
        (gnc_protocol::message::Identity::ID, &[]),
        (0x7FFF, &[]),
        (TimerMeasure::ID, &long),
    ];
    for (message, payload) in requests {
        let asked = driver.post_raw(message, payload);
        driver.refused(&asked, 1, "without a session").await?;
    }
    let request = driver.next_request();
    let asked = driver.post_as(PROTOCOL_VERSION + 1, 0, request, ErrorRecords::ID, &[0, 0]);
    driver.refused(&asked, 1, "of version 2 without a session").await?;
    Ok(format!("{} requests got NAK 1", requests.len() + 1))
}
