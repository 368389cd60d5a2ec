//! Section 7: the life of a request.

use std::time::Duration;

use gnc_protocol::message::{
    Abort, AbortReply, ErrorRecords, Identity, LinkCounters, MakeSafe, Progress, TimerMeasure, capability,
};
use gnc_protocol::wire::Wire as _;
use gnc_protocol::{Call, Kind, MAX_PAYLOAD, PROTOCOL_VERSION};
use tokio::time::Instant;

use crate::check::checks;
use crate::driver::{Answer, Asked, Driver, End, HOST_ADDS, NO_MESSAGE, kind_name, ms, name_of};
use crate::examples::slow;
use crate::stop::{Verdict, demand, failed};

checks! { 7:
    "request.accept-time" Session accept_time "ACCEPT comes within 50 ms of a REQUEST's last byte, wire time not counted",
    "request.nak-time" Session nak_time "NAK comes within 50 ms of a REQUEST's last byte, wire time not counted",
    "request.once" Session once "a request is answered by one ACCEPT, then one RESULT",
    "request.accept" Powered accept "ACCEPT holds a u32, 0 or the time that the request takes",
    "request.elapsed" Powered elapsed "elapsed_us is the board time from ACCEPT to the end",
    "request.progress" Powered progress "PROGRESS comes every 400 ms and never more than 500 ms apart while a request runs",
    "request.progress-fields" Powered progress_fields "PROGRESS says up to 1000 thousandths, rising, and the board time spent",
    "request.nothing-after-result" Powered nothing_after_result "RESULT is the end of a request",
    "request.id-zero" Session id_zero "a board takes request id 0 like any other",
    "replay.same" Session replay_same "a request that ended is answered by its RESULT from memory, REPLAYED, with the same payload",
    "replay.eight" Session replay_eight "the board keeps the results of the last 8 requests that ended",
    "replay.ninth" Session replay_ninth "the ninth result pushes out the oldest, whose request is then a new one",
    "replay.payload" Session replay_payload "another payload under the same id and message gets the old answer",
    "replay.other-message" Session replay_other_message "an id that ended under another message is a new request, and the old result stays kept",
    "replay.nak" Powered replay_nak "a NAK is not kept",
    "request.second-copy" Powered second_copy "a second copy of a request that runs gets ACCEPT with the same expected_ms, and there is one RESULT",
    "request.other-message" Powered other_message "an id that runs under another message gets NAK 4",
    "abort.running" Powered abort_running "ABORT ends a request: its RESULT with status 1 first, then ACCEPT and RESULT with was_running 1",
    "abort.not-running" Session abort_not_running "ABORT of what does not run says was_running 0",
    "abort.kept" Powered abort_kept "results of aborted requests and of ABORT are kept and replayed",
    "make-safe.time" Powered make_safe_time "MAKE_SAFE ends within 250 ms",
    "make-safe.running" Powered make_safe_running "MAKE_SAFE ends what runs, with status 1 before its own answers",
    "make-safe.same-id" Powered make_safe_same_id "MAKE_SAFE is carried out under an id that runs under another message",
}

/// Requests that are timed.
const TIMED: u32 = 10;
/// MAKE_SAFE ends within this time (section 9).
const SAFE_WITHIN: Duration = Duration::from_millis(250);
/// First PROGRESS after ACCEPT, and from one to the next; the most between two.
const PROGRESS_EVERY: Duration = Duration::from_millis(400);
const PROGRESS_AT_MOST: Duration = Duration::from_millis(500);

/// Two seconds of work that changes nothing and sends four PROGRESS.
fn long() -> TimerMeasure {
    TimerMeasure { timer: 0, period_us: 100_000, count: 20 }
}

async fn accept_time(driver: &mut Driver) -> Verdict {
    let limit = driver.quiet_accept_limit(0, 4);
    let mut longest = Duration::ZERO;
    for _ in 0..TIMED {
        let asked = driver.post(&LinkCounters {});
        let after = driver.accepted(&asked).await? - asked.sent;
        driver.end_of(&asked).await?;
        longest = longest.max(after);
    }
    demand(longest <= limit, || format!("ACCEPT after {}, at most {} on this line", ms(longest), ms(limit)))?;
    Ok(format!("at most {} of {TIMED}, allowed {}", ms(longest), ms(limit)))
}

async fn nak_time(driver: &mut Driver) -> Verdict {
    let mut longest = Duration::ZERO;
    for bytes in [0, MAX_PAYLOAD] {
        let limit = driver.quiet_accept_limit(bytes, MAX_PAYLOAD / 3);
        for _ in 0..TIMED / 2 {
            let asked = driver.post_raw(NO_MESSAGE, &vec![0x5A; bytes]);
            let place = driver.first_answer(&asked).await?;
            let after = driver.heard()[place].at - asked.sent;
            demand(after <= limit, || format!("NAK after {}, at most {} on this line", ms(after), ms(limit)))?;
            longest = longest.max(after);
        }
    }
    Ok(format!("at most {} of {TIMED}", ms(longest)))
}

/// The kinds of all frames that answered a request, in their order.
fn kinds(driver: &Driver, asked: &Asked) -> Vec<Kind> {
    let frames = driver.heard()[asked.from..].iter().filter_map(|heard| heard.frame.as_ref().ok());
    let of_it = frames.filter(|frame| {
        let header = frame.header;
        !matches!(header.kind, Kind::Event | Kind::Stream | Kind::Hello)
            && (header.request, header.message) == (asked.request, asked.message)
    });
    of_it.map(|frame| frame.header.kind).collect()
}

/// Kinds in their order, in words.
fn words(kinds: &[Kind]) -> String {
    let names: Vec<&str> = kinds.iter().map(|kind| kind_name(*kind)).collect();
    format!("in this order: {}", names.join(", "))
}

async fn once(driver: &mut Driver) -> Verdict {
    let asked = driver.post(&LinkCounters {});
    driver.end_of(&asked).await?;
    driver.listen(Duration::from_millis(200)).await?;
    let came = kinds(driver, &asked);
    demand(came == [Kind::Accept, Kind::Result], || words(&came))?;
    Ok("ACCEPT, RESULT".to_owned())
}

/// expected_ms of an ACCEPT.
fn expected_ms(driver: &Driver, place: usize) -> Verdict<u32> {
    let Some(frame) = driver.heard()[place].of(Kind::Accept) else { return failed(driver.came(place)) };
    u32::from_payload(&frame.payload)
        .or_else(|_| failed(format!("the payload of ACCEPT has {} bytes, not 4", frame.payload.len())))
}

async fn accept(driver: &mut Driver) -> Verdict {
    let asked = driver.post(&slow());
    let place = driver.first_answer(&asked).await?;
    let expected = expected_ms(driver, place)?;
    driver.end_of(&asked).await?.body()?;
    demand(expected <= 5000, || format!("expected_ms {expected} for a request that takes 500 ms"))?;
    Ok(format!("expected_ms {expected} for 500 ms"))
}

async fn elapsed(driver: &mut Driver) -> Verdict {
    let answer = driver.call(&slow()).await?;
    answer.body()?;
    let Some(accepted) = answer.accepted else { return failed("RESULT came without ACCEPT") };
    let link = answer.ended - accepted;
    let board = Duration::from_micros(answer.elapsed_us().into());
    let slack = HOST_ADDS + driver.line_time(MAX_PAYLOAD) * 2;
    demand(board <= link + slack && board + slack >= link, || {
        format!("elapsed_us says {}, from ACCEPT to RESULT passed {}", ms(board), ms(link))
    })?;
    Ok(format!("{} of board time, {} on the link", ms(board), ms(link)))
}

/// A PROGRESS, and when it came.
struct Came {
    at: Instant,
    said: Progress,
}

/// Runs a long request; what was said meanwhile.
async fn watched(driver: &mut Driver) -> Verdict<(Answer, Instant, Vec<Came>)> {
    let answer = driver.call(&long()).await?;
    answer.body()?;
    let Some(accepted) = answer.accepted else { return failed("RESULT came without ACCEPT") };
    let mut said = Vec::new();
    for heard in &driver.heard()[answer.asked.from..] {
        let Some(frame) = heard.of(Kind::Progress).filter(|frame| frame.header.request == answer.asked.request) else {
            continue;
        };
        match Progress::from_payload(&frame.payload) {
            Ok(progress) => said.push(Came { at: heard.at, said: progress }),
            Err(error) => return failed(format!("a PROGRESS of {} bytes does not read: {error}", frame.payload.len())),
        }
    }
    Ok((answer, accepted, said))
}

async fn progress(driver: &mut Driver) -> Verdict {
    let (answer, accepted, said) = watched(driver).await?;
    demand(!said.is_empty(), || format!("no PROGRESS in {}", ms(answer.ended - accepted)))?;
    let slack = HOST_ADDS + driver.line_time(MAX_PAYLOAD);
    let mut last = accepted;
    for (index, came) in said.iter().enumerate() {
        let gap = came.at - last;
        let what = if index == 0 { "the first PROGRESS after ACCEPT" } else { "the next PROGRESS" };
        demand(gap <= PROGRESS_AT_MOST + slack, || format!("{what} came after {}", ms(gap)))?;
        demand(gap + slack >= PROGRESS_EVERY, || format!("{what} came after {} already", ms(gap)))?;
        last = came.at;
    }
    let gap = answer.ended - last;
    demand(gap <= PROGRESS_AT_MOST + slack, || format!("{} from the last PROGRESS to RESULT", ms(gap)))?;
    Ok(format!("{} in {}", said.len(), ms(answer.ended - accepted)))
}

async fn progress_fields(driver: &mut Driver) -> Verdict {
    let (_, accepted, said) = watched(driver).await?;
    demand(!said.is_empty(), || "no PROGRESS came".to_owned())?;
    let slack = HOST_ADDS + driver.line_time(MAX_PAYLOAD) * 2;
    let mut before = Progress::default();
    for Came { at, said } in &said {
        let Progress { done_permille, elapsed_ms } = *said;
        demand(done_permille <= 1000, || format!("done_permille {done_permille}"))?;
        demand(done_permille >= before.done_permille, || {
            format!("done_permille fell from {} to {done_permille}", before.done_permille)
        })?;
        let (board, link) = (Duration::from_millis(elapsed_ms.into()), *at - accepted);
        demand(board <= link + slack && board + slack >= link, || {
            format!("elapsed_ms {elapsed_ms}, {} after ACCEPT", ms(link))
        })?;
        before = said.clone();
    }
    Ok(format!("up to {} thousandths, {} ms", before.done_permille, before.elapsed_ms))
}

async fn nothing_after_result(driver: &mut Driver) -> Verdict {
    let asked = driver.post(&slow());
    driver.end_of(&asked).await?;
    driver.listen(PROGRESS_AT_MOST + HOST_ADDS).await?;
    let came = kinds(driver, &asked);
    demand(came.last() == Some(&Kind::Result), || words(&came))?;
    demand(came.iter().filter(|kind| **kind == Kind::Result).count() == 1, || words(&came))?;
    Ok("nothing in 520 ms after RESULT".to_owned())
}

async fn id_zero(driver: &mut Driver) -> Verdict {
    let asked = driver.post_as(PROTOCOL_VERSION, 0, 0, LinkCounters::ID, &[]);
    driver.end_of(&asked).await?.body()?;
    Ok("done".to_owned())
}

/// Ends the check as failed unless a request is answered from memory as before.
async fn replays<C: Call>(driver: &mut Driver, before: &Answer, call: &C, what: &str) -> Verdict<()> {
    let asked = driver.post_again(&before.asked, call);
    let after = driver.end_of(&asked).await?;
    demand(after.accepted.is_none(), || format!("{what} got ACCEPT once more"))?;
    demand(after.is_replayed(), || format!("{what} was answered by {}, not REPLAYED", after.words()))?;
    let payload = |answer: &Answer| match &answer.end {
        End::Result { status, elapsed_us, body, .. } => Some((*status, *elapsed_us, body.clone())),
        End::Nak { .. } => None,
    };
    demand(payload(&after) == payload(before), || format!("{what} was answered by another payload than before"))
}

async fn replay_same(driver: &mut Driver) -> Verdict {
    let before = driver.call(&LinkCounters {}).await?;
    before.body()?;
    for _ in 0..2 {
        replays(driver, &before, &LinkCounters {}, "a request that ended").await?;
    }
    Ok("twice, REPLAYED, the same bytes".to_owned())
}

/// Requests that ended, oldest first.
async fn ended(driver: &mut Driver, count: usize) -> Verdict<Vec<Answer>> {
    let mut ended = Vec::new();
    for _ in 0..count {
        let answer = driver.call(&LinkCounters {}).await?;
        answer.body()?;
        ended.push(answer);
    }
    Ok(ended)
}

async fn replay_eight(driver: &mut Driver) -> Verdict {
    let ended = ended(driver, 8).await?;
    for (index, before) in ended.iter().enumerate() {
        replays(driver, before, &LinkCounters {}, &format!("request {} of the last 8", index + 1)).await?;
    }
    Ok("8 of 8 were replayed".to_owned())
}

async fn replay_ninth(driver: &mut Driver) -> Verdict {
    let ended = ended(driver, 9).await?;
    let asked = driver.post_again(&ended[0].asked, &LinkCounters {});
    let again = driver.end_of(&asked).await?;
    demand(!again.is_replayed(), || "the oldest of 9 was replayed".to_owned())?;
    again.body()?;
    Ok("the oldest of 9 was a new request".to_owned())
}

async fn replay_payload(driver: &mut Driver) -> Verdict {
    let before = driver.call(&ErrorRecords { from: 0 }).await?;
    before.body()?;
    for payload in [&[9, 0][..], &[1, 2, 3, 4, 5]] {
        let asked = driver.post_as(PROTOCOL_VERSION, 1, before.asked.request, ErrorRecords::ID, payload);
        let after = driver.end_of(&asked).await?;
        demand(after.is_replayed(), || format!("with {} other bytes it came as {}", payload.len(), after.words()))?;
        demand(after.body()? == before.body()?, || "the payload changed".to_owned())?;
    }
    Ok("2 other payloads got the old answer".to_owned())
}

async fn replay_other_message(driver: &mut Driver) -> Verdict {
    let before = driver.call(&LinkCounters {}).await?;
    let request = before.asked.request;
    let asked = driver.post_as(PROTOCOL_VERSION, 0, request, ErrorRecords::ID, &[0, 0]);
    let other = driver.end_of(&asked).await?;
    demand(other.accepted.is_some() && !other.is_replayed(), || format!("the other message got {}", other.words()))?;
    other.body()?;
    replays(driver, &before, &LinkCounters {}, "the first message under that id").await?;
    Ok("both results are kept".to_owned())
}

async fn replay_nak(driver: &mut Driver) -> Verdict {
    driver.needs(capability::POWER)?;
    driver.open().await?;
    let asked = driver.post(&Identity {});
    driver.refused(&asked, 6, "without power").await?;
    driver.power_on().await?;
    let again = driver.post_again(&asked, &Identity {});
    let after = driver.end_of(&again).await?;
    after.body()?;
    demand(!after.is_replayed(), || "a request that got NAK was replayed".to_owned())?;
    Ok("NAK 6, and with power the same request was done".to_owned())
}

async fn second_copy(driver: &mut Driver) -> Verdict {
    let asked = driver.post(&slow());
    let first = driver.first_answer(&asked).await?;
    let expected = expected_ms(driver, first)?;
    let again = driver.post_again(&asked, &slow());
    let second = driver.first_answer(&again).await?;
    let once_more = expected_ms(driver, second)?;
    demand(once_more == expected, || format!("expected_ms {expected}, then {once_more}"))?;
    driver.end_of(&again).await?.body()?;
    driver.listen(Duration::from_millis(700)).await?;
    let came = kinds(driver, &asked);
    let results = came.iter().filter(|kind| **kind == Kind::Result).count();
    demand(results == 1, || format!("{results} RESULTs: {}", words(&came)))?;
    Ok("2 ACCEPTs, 1 RESULT".to_owned())
}

async fn other_message(driver: &mut Driver) -> Verdict {
    let asked = driver.post(&slow());
    driver.accepted(&asked).await?;
    for message in [LinkCounters::ID, Abort::ID] {
        let payload: &[u8] = if message == Abort::ID { &[0, 0] } else { &[] };
        let other = driver.post_as(PROTOCOL_VERSION, 0, asked.request, message, payload);
        driver.refused(&other, 4, "under an id that runs under TimerMeasure").await?;
    }
    driver.end_of(&asked).await?.body()?;
    Ok("NAK 4, and the request that ran was done".to_owned())
}

/// Ends the check as failed unless a request ended as aborted ones do.
fn is_aborted(answer: &Answer) -> Verdict<()> {
    match &answer.end {
        End::Result { status: 1, elapsed_us: 0, body, .. } if body.as_slice() == [0] => Ok(()),
        End::Result { status: 1, elapsed_us, body, .. } => failed(format!(
            "status 1 with elapsed_us {elapsed_us} and {} bytes behind it, not 0 and an empty text",
            body.len()
        )),
        _ => failed(format!("the request that was ended was answered by {}", answer.words())),
    }
}

/// Kinds and messages of all answers behind `from`, but for PROGRESS.
fn order(driver: &Driver, from: usize) -> Vec<(Kind, u16)> {
    let frames = driver.heard()[from..].iter().filter_map(|heard| heard.frame.as_ref().ok());
    let answers = frames.filter(|frame| matches!(frame.header.kind, Kind::Accept | Kind::Result | Kind::Nak));
    answers.map(|frame| (frame.header.kind, frame.header.message)).collect()
}

/// Ends the check as failed unless these answers came in this order. On CAN the first goes under another id than the two
/// behind it, and only within one id the order is kept.
fn in_order(driver: &Driver, from: usize, message: u16) -> Verdict<()> {
    let wanted = [(Kind::Result, TimerMeasure::ID), (Kind::Accept, message), (Kind::Result, message)];
    let mut came = order(driver, from);
    if driver.is_can() {
        came.sort_by_key(|(_, message)| *message != TimerMeasure::ID);
    }
    demand(came == wanted, || {
        let words: Vec<String> =
            came.iter().map(|(kind, message)| format!("{} of {}", kind_name(*kind), name_of(*message))).collect();
        format!("the order was: {}", words.join(", "))
    })
}

async fn abort_running(driver: &mut Driver) -> Verdict {
    let asked = driver.post(&slow());
    driver.accepted(&asked).await?;
    let from = driver.mark();
    let abort = driver.post(&Abort { request: asked.request });
    let AbortReply { was_running } = driver.end_of(&abort).await?.reply::<Abort>()?;
    demand(was_running == 1, || format!("was_running {was_running}"))?;
    is_aborted(&driver.end_of(&asked).await?)?;
    in_order(driver, from, Abort::ID)?;
    driver.listen(Duration::from_millis(700)).await?;
    let late = order(driver, from).len();
    demand(late == 3, || format!("{} answers after the end", late - 3))?;
    Ok("RESULT with status 1, ACCEPT, RESULT with was_running 1".to_owned())
}

async fn abort_not_running(driver: &mut Driver) -> Verdict {
    let done = driver.call(&LinkCounters {}).await?;
    for request in [done.asked.request, 0x7ABC] {
        let AbortReply { was_running } = driver.ask(&Abort { request }).await?;
        demand(was_running == 0, || format!("was_running {was_running}"))?;
    }
    Ok("0 for one that ended and one that never was".to_owned())
}

async fn abort_kept(driver: &mut Driver) -> Verdict {
    let asked = driver.post(&slow());
    driver.accepted(&asked).await?;
    let abort = Abort { request: asked.request };
    let ended = driver.call(&abort).await?;
    ended.body()?;
    let aborted = driver.end_of(&asked).await?;
    replays(driver, &aborted, &slow(), "the aborted request").await?;
    replays(driver, &ended, &abort, "ABORT").await?;
    Ok("both were replayed".to_owned())
}

async fn make_safe_time(driver: &mut Driver) -> Verdict {
    driver.disturb();
    let answer = driver.call(&MakeSafe {}).await?;
    answer.body()?;
    let took = answer.ended - answer.asked.sent;
    let limit = SAFE_WITHIN + driver.accept_limit(0, 4);
    demand(took <= limit, || format!("RESULT after {}, at most {} on this line", ms(took), ms(limit)))?;
    Ok(format!("{}, with the module under power before", ms(took)))
}

async fn make_safe_running(driver: &mut Driver) -> Verdict {
    driver.disturb();
    let asked = driver.post(&slow());
    driver.accepted(&asked).await?;
    let from = driver.mark();
    driver.ask(&MakeSafe {}).await?;
    is_aborted(&driver.end_of(&asked).await?)?;
    in_order(driver, from, MakeSafe::ID)?;
    driver.ask(&LinkCounters {}).await?;
    if driver.can_do(capability::POWER) {
        let identity = driver.post(&Identity {});
        driver.refused(&identity, 6, "after MAKE_SAFE").await?;
    }
    Ok("RESULT with status 1, ACCEPT, RESULT; the session stays, the module is off".to_owned())
}

async fn make_safe_same_id(driver: &mut Driver) -> Verdict {
    driver.disturb();
    let asked = driver.post(&slow());
    driver.accepted(&asked).await?;
    let safe = driver.post_as(PROTOCOL_VERSION, 0, asked.request, MakeSafe::ID, &[]);
    driver.end_of(&safe).await?.body()?;
    is_aborted(&driver.end_of(&asked).await?)?;
    Ok("it was carried out".to_owned())
}
