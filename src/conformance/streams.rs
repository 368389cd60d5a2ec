//! Section 10: streams of samples.

mod run;
mod sensors;

use std::time::Duration;

use gnc_protocol::Kind;
use gnc_protocol::calibration::CalibrationRead;
use gnc_protocol::message::{
    LinkCounters, MakeSafe, ModulePower, StreamStart, StreamStop, StreamStopReply, capability,
};

use crate::check::checks;
use crate::driver::{Driver, HOST_ADDS, ms};
use crate::stop::{Verdict, demand, failed, not_applicable};
use run::{Run, fits, frames_of, imu, load_permille, on_grid, on_link, stream};
pub(crate) use sensors::compensated;
use sensors::{codes, gnss, pps, repeats, together};

checks! { 10:
    "stream.layout" Powered layout "a STREAM frame carries stream, format and count, request id 0 and the stream as message id",
    "stream.result-first" Powered result_first "the RESULT of StreamStart leaves before the first frame",
    "stream.numbers" Powered numbers "samples count from 0 without a gap, dropped ones included",
    "stream.grid" Powered grid "sample k is taken at start + (k + 1) / rate, in every frame to within a microsecond",
    "stream.rate" Powered rate "samples come at the rate that was asked for, by the board's clock",
    "stream.count" Powered count "the count ends a stream: the last frame leaves at once with the last sample, short if need be",
    "stream.stop" Powered stop "at StreamStop the frame that is not full yet leaves before the RESULT, and nothing after it",
    "stream.account" Powered account "produced is what was received and what was dropped",
    "stream.stop-again" Powered stop_again "StreamStop of a stream that ended returns the figures of its last run",
    "stream.never-ran" Session never_ran "StreamStop of a stream that never ran in this session returns zeros, and needs no power",
    "stream.busy" Powered busy "a stream that runs already gets NAK 5",
    "stream.load" Powered load "load_permille is worked out as the document says, rounded down",
    "stream.no-fit" Powered no_fit "streams take at most 900 thousandths together: one beyond that gets NAK 8 with the arithmetic",
    "stream.choice" Powered choice "the board's choice of samples in a frame is rate / 20, 1 to 12",
    "stream.make-safe" Powered make_safe "at MAKE_SAFE samples are dropped and counted, and the account stays",
    "stream.power-off" Powered power_off "at ModulePower off the last frame leaves before the RESULT, and the account stays",
    "stream.new-session" Powered new_session "the account is forgotten with the session",
    "stream.codes" Powered codes "IMU samples are codes of 24 bits, sign-extended",
    "stream.repeats" Powered repeats "readings do not come twice unless capability bit 3 says so",
    "stream.gnss" Powered gnss "the GNSS stream is NMEA sentences as bytes, numbered without a gap",
    "stream.pps" Powered pps "a capture of 1PPS is board time in ns, one in a frame",
    "stream.compensated" Powered compensated "the compensated stream has samples of 46 bytes on a grid of its own, or NAK 10 without a calibration",
    "stream.answers-first" Powered answers_first "answers go before STREAM frames that wait: ACCEPT within 50 ms beside a fast stream",
    "stream.together" Powered together "all streams may run side by side",
}

/// How long a short run lasts.
const SHORT: Duration = Duration::from_millis(500);
/// How long the rate is watched.
const LONG: Duration = Duration::from_millis(2000);
/// Requests that are timed beside a stream.
const TIMED: u32 = 20;
/// How long a stream that ended is watched.
const AFTER: Duration = Duration::from_millis(250);

async fn layout(driver: &mut Driver) -> Verdict {
    let Run { reply, frames, .. } = stream(driver, &imu(200, 10), SHORT).await?;
    demand(reply.format == 1, || format!("StreamStart said format {}", reply.format))?;
    for came in &frames {
        let head = &came.frame.head;
        demand(came.request == 0, || format!("a STREAM frame with request id {}", came.request))?;
        demand((head.stream, head.format) == (1, 1), || format!("stream {}, format {}", head.stream, head.format))?;
    }
    Ok(format!("{} frames", frames.len()))
}

async fn result_first(driver: &mut Driver) -> Verdict {
    let Run { started, frames, .. } = stream(driver, &imu(50, 1), SHORT).await?;
    let Some(first) = frames.first() else { return failed("no frame came") };
    demand(started < first.place, || "a STREAM frame came before the RESULT of StreamStart".to_owned())?;
    Ok("RESULT, then frames".to_owned())
}

async fn numbers(driver: &mut Driver) -> Verdict {
    let Run { reply, frames, .. } = stream(driver, &imu(200, 10), SHORT).await?;
    let mut expected = 0;
    for came in &frames {
        let head = &came.frame.head;
        demand(head.first == expected, || format!("first is {}, expected {expected}", head.first))?;
        expected = head.first.wrapping_add(head.count.into());
    }
    // The last frame may be short.
    for came in frames.iter().rev().skip(1) {
        let count = came.frame.head.count;
        demand(count == u16::from(reply.samples_per_frame), || {
            format!("a frame of {count} samples, StreamStart said {}", reply.samples_per_frame)
        })?;
    }
    demand(expected > 0, || "no sample came".to_owned())?;
    Ok(format!("0 to {} in {} frames", expected - 1, frames.len()))
}

async fn grid(driver: &mut Driver) -> Verdict {
    let mut rates = Vec::new();
    for (rate_hz, per_frame) in [(200, 10), (300, 7), (7, 1), (999, 10)] {
        if !fits(driver, 1, rate_hz, per_frame) {
            continue;
        }
        let span = if rate_hz < 10 { LONG / 2 } else { SHORT };
        let run = stream(driver, &imu(rate_hz, per_frame), span).await?;
        on_grid(driver, &run.frames, rate_hz)?;
        rates.push(format!("{rate_hz}"));
    }
    Ok(format!("at {} Hz", rates.join(", ")))
}

async fn rate(driver: &mut Driver) -> Verdict {
    let rate_hz = 200;
    let Run { frames, .. } = stream(driver, &imu(rate_hz, 10), LONG).await?;
    // The last frame leaves when the stream is stopped, not when it is full.
    let [first, .., last, _] = frames.as_slice() else { return failed(format!("{} frames in 2 s", frames.len())) };
    let samples = last.end().wrapping_sub(first.end());
    let (board, link) = (Duration::from_secs_f64(f64::from(samples) / f64::from(rate_hz)), last.at - first.at);
    // A frame may wait for another one on the line.
    let slack = HOST_ADDS + driver.line_time(512) * 2;
    demand(board.abs_diff(link) <= slack, || {
        format!("{samples} samples of {rate_hz} Hz, {}, took {} of link time", ms(board), ms(link))
    })?;
    Ok(format!("{samples} samples in {}", ms(link)))
}

async fn count(driver: &mut Driver) -> Verdict {
    let start = StreamStart { count: 25, ..on_link(driver, &imu(200, 10)) };
    let from = driver.mark();
    let answer = driver.call(&start).await?;
    let reply = answer.reply::<StreamStart>()?;
    driver.listen(SHORT).await?;
    let frames = frames_of(driver, 1, from)?;
    let counts: Vec<u16> = frames.iter().map(|came| came.frame.head.count).collect();
    let wanted: &[u16] = if reply.samples_per_frame == 1 { &[1; 25] } else { &[10, 10, 5] };
    demand(counts == wanted, || format!("frames of {counts:?} samples for a count of 25"))?;
    let StreamStopReply { produced, dropped } = driver.ask(&StreamStop { stream: 1 }).await?;
    demand((produced, dropped) == (25, 0), || format!("then StreamStop said {produced} produced, {dropped} dropped"))?;
    Ok(format!("25 samples in {} frames, then nothing", frames.len()))
}

async fn stop(driver: &mut Driver) -> Verdict {
    let run = stream(driver, &imu(50, 10), Duration::from_millis(330)).await?;
    let from = driver.mark();
    driver.listen(AFTER).await?;
    let late = frames_of(driver, 1, from)?;
    demand(late.is_empty(), || format!("{} frames after the RESULT of StreamStop", late.len()))?;
    let Some(last) = run.frames.last() else { return failed("no frame came") };
    demand(last.place < run.stopped, || "a frame came after the RESULT of StreamStop".to_owned())?;
    demand(last.end() == run.stop.produced, || {
        format!("the last frame ends at sample {}, {} were produced", last.end(), run.stop.produced)
    })?;
    Ok(format!("the last frame has {} samples, then nothing", last.frame.head.count))
}

async fn account(driver: &mut Driver) -> Verdict {
    let run = stream(driver, &imu(200, 10), SHORT).await?;
    let received: u32 = run.frames.iter().map(|came| u32::from(came.frame.head.count)).sum();
    let StreamStopReply { produced, dropped } = run.stop;
    demand(produced == received + dropped, || format!("{produced} produced, {dropped} dropped, {received} received"))?;
    Ok(format!("{produced} produced, {dropped} dropped, {received} received"))
}

async fn stop_again(driver: &mut Driver) -> Verdict {
    let run = stream(driver, &imu(200, 10), SHORT).await?;
    let again = driver.ask(&StreamStop { stream: 1 }).await?;
    demand(again == run.stop, || format!("{} produced, then {}", run.stop.produced, again.produced))?;
    Ok(format!("{} produced, twice", again.produced))
}

async fn never_ran(driver: &mut Driver) -> Verdict {
    for stream in 1..=4 {
        let reply = driver.ask(&StreamStop { stream }).await?;
        demand(reply == StreamStopReply::default(), || {
            format!("stream {stream}: {} produced, {} dropped", reply.produced, reply.dropped)
        })?;
    }
    Ok("zeros of 4 streams".to_owned())
}

async fn busy(driver: &mut Driver) -> Verdict {
    driver.ask(&imu(50, 1)).await?;
    let asked = driver.post(&imu(100, 1));
    driver.refused(&asked, 5, "for a stream that runs").await?;
    driver.ask(&StreamStop { stream: 1 }).await?;
    Ok("NAK 5".to_owned())
}

async fn load(driver: &mut Driver) -> Verdict {
    let mut said = Vec::new();
    for (rate_hz, per_frame) in [(200, 1), (200, 4), (200, 10), (1000, 4), (1000, 12), (333, 7)] {
        if !fits(driver, 1, rate_hz, per_frame) {
            continue;
        }
        let Run { reply, .. } = stream(driver, &imu(rate_hz, per_frame), Duration::ZERO).await?;
        let expected = load_permille(driver, 1, rate_hz, per_frame);
        demand(u32::from(reply.load_permille) == expected, || {
            format!("{rate_hz} Hz, {per_frame} a frame: {} instead of {expected}", reply.load_permille)
        })?;
        said.push(expected.to_string());
    }
    Ok(said.join(", "))
}

async fn no_fit(driver: &mut Driver) -> Verdict {
    let (first, second) = (imu(1000, 1), StreamStart { stream: 4, ..imu(400, 1) });
    let sum = load_permille(driver, 1, 1000, 1) + load_permille(driver, 4, 400, 1);
    if sum <= 900 {
        return not_applicable(format!("both at full rate take {sum} thousandths of this line"));
    }
    if fits(driver, 1, 1000, 1) {
        driver.needs(capability::CALIBRATION)?;
        driver.ask(&first).await?;
        let asked = driver.post(&second);
        let place = driver.first_answer(&asked).await?;
        let nak = driver.heard()[place].of(Kind::Nak);
        if nak.is_some_and(|frame| frame.payload.starts_with(&[10, 0])) {
            driver.ask(&StreamStop { stream: 1 }).await?;
            return not_applicable("the module holds no calibration, which the board looks at first");
        }
        let text = driver.refused(&asked, 8, &format!("with {sum} thousandths together")).await?;
        driver.ask(&StreamStop { stream: 1 }).await?;
        has_arithmetic(&text)?;
    } else {
        let asked = driver.post(&first);
        let alone = load_permille(driver, 1, 1000, 1);
        let text = driver.refused(&asked, 8, &format!("with {alone} thousandths")).await?;
        has_arithmetic(&text)?;
    }
    Ok(format!("NAK 8 for {sum} thousandths"))
}

/// Ends the check as failed if a refusal does not say a number.
fn has_arithmetic(text: &str) -> Verdict<()> {
    demand(text.contains(|letter: char| letter.is_ascii_digit()), || format!("NAK 8 without the arithmetic: {text:?}"))
}

async fn choice(driver: &mut Driver) -> Verdict {
    let mut said = Vec::new();
    for rate_hz in [10, 100, 200, 1000] {
        let expected = if driver.is_can() { 1 } else { (rate_hz / 20).clamp(1, 12) as u8 };
        if !fits(driver, 1, rate_hz, expected) {
            continue;
        }
        let Run { reply, .. } = stream(driver, &imu(rate_hz, 0), Duration::ZERO).await?;
        demand(reply.samples_per_frame == expected, || {
            format!("{rate_hz} Hz: {} samples a frame instead of {expected}", reply.samples_per_frame)
        })?;
        said.push(format!("{expected} at {rate_hz} Hz"));
    }
    Ok(said.join(", "))
}

/// Begins a stream; what was received up to an end of another kind, and its account.
async fn closed(driver: &mut Driver, from: usize) -> Verdict<(u32, StreamStopReply)> {
    let frames = frames_of(driver, 1, from)?;
    let received = frames.iter().map(|came| u32::from(came.frame.head.count)).sum();
    Ok((received, driver.ask(&StreamStop { stream: 1 }).await?))
}

async fn make_safe(driver: &mut Driver) -> Verdict {
    driver.disturb();
    let from = driver.mark();
    let start = on_link(driver, &imu(200, 10));
    driver.ask(&start).await?;
    driver.listen(SHORT).await?;
    driver.ask(&MakeSafe {}).await?;
    let ended = driver.mark();
    driver.listen(AFTER).await?;
    let late = frames_of(driver, 1, ended)?;
    demand(late.is_empty(), || format!("{} frames after the RESULT of MAKE_SAFE", late.len()))?;
    let (received, StreamStopReply { produced, dropped }) = closed(driver, from).await?;
    demand(produced > 0 && produced == received + dropped, || {
        format!("{produced} produced, {dropped} dropped, {received} received")
    })?;
    Ok(format!("{produced} produced, {dropped} dropped, {received} received"))
}

async fn power_off(driver: &mut Driver) -> Verdict {
    driver.needs(capability::POWER)?;
    driver.disturb();
    let from = driver.mark();
    let start = on_link(driver, &imu(50, 10));
    driver.ask(&start).await?;
    driver.listen(SHORT).await?;
    driver.ask(&ModulePower { on: 0 }).await?;
    let ended = driver.mark();
    driver.listen(AFTER).await?;
    let late = frames_of(driver, 1, ended)?;
    demand(late.is_empty(), || format!("{} frames after the RESULT of ModulePower off", late.len()))?;
    let (received, StreamStopReply { produced, dropped }) = closed(driver, from).await?;
    demand(produced > 0 && produced == received + dropped, || {
        format!("{produced} produced, {dropped} dropped, {received} received")
    })?;
    Ok(format!("{produced} produced, {dropped} dropped, {received} received"))
}

async fn new_session(driver: &mut Driver) -> Verdict {
    stream(driver, &imu(200, 10), Duration::from_millis(200)).await?;
    driver.open().await?;
    let StreamStopReply { produced, dropped } = driver.ask(&StreamStop { stream: 1 }).await?;
    demand((produced, dropped) == (0, 0), || format!("{produced} produced, {dropped} dropped in a new session"))?;
    Ok("zeros in the next session".to_owned())
}

async fn answers_first(driver: &mut Driver) -> Verdict {
    // On CAN every sample is three frames of its own, which an adapter on a serial port hands on as text: 1000 Hz would
    // try this computer, not the board.
    let most = if driver.is_can() { 500 } else { 1000 };
    let fast = [(1000, 10), (500, 10), (200, 10)].into_iter().filter(|(rate, _)| *rate <= most);
    let (rate_hz, per_frame) = fast.into_iter().find(|(rate, n)| fits(driver, 1, *rate, *n)).unwrap_or((50, 1));
    let start = on_link(driver, &imu(rate_hz, per_frame));
    driver.ask(&start).await?;
    let limit = driver.accept_limit(0, 4);
    let mut longest = Duration::ZERO;
    for _ in 0..TIMED {
        let asked = driver.post(&LinkCounters {});
        let after = driver.accepted(&asked).await? - asked.sent;
        driver.end_of(&asked).await?.body()?;
        longest = longest.max(after);
        // The next one falls elsewhere between two frames.
        driver.listen(Duration::from_millis(7)).await?;
    }
    driver.ask(&StreamStop { stream: 1 }).await?;
    demand(longest <= limit, || {
        format!("ACCEPT after {} beside {rate_hz} Hz, at most {} on this line", ms(longest), ms(limit))
    })?;
    Ok(format!("at most {} of {TIMED} beside {rate_hz} Hz", ms(longest)))
}

/// Whether the module says that it holds a calibration in force.
async fn is_calibrated(driver: &mut Driver) -> Verdict<bool> {
    Ok(driver.ask(&CalibrationRead {}).await?.state == 1)
}
