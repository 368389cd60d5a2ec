//! A run of a stream, and what the document says of its frames.

use std::time::Duration;

use gnc_protocol::Kind;
use gnc_protocol::message::{StreamStart, StreamStartReply, StreamStop, StreamStopReply};
use gnc_protocol::stream::{StreamFrame, StreamHead};
use gnc_protocol::wire::Wire as _;
use tokio::time::Instant;

use crate::driver::Driver;
use crate::stop::{Verdict, demand, failed};

/// Most thousandths of the line that all streams take together.
const MOST_PERMILLE: u32 = 900;
/// Bytes of a STREAM frame's head, and of the samples of streams 1 to 4.
const HEAD: usize = 20;
const SAMPLE: [usize; 4] = [40, 1, 8, 46];
/// Samples from one clock to the next, on CAN.
const CLOCK_EVERY: u32 = 64;
/// What is counted of the stuff bits of the bus: 30 % of the most.
const STUFF_SHARE: f64 = 0.3;
/// What comes so long after StreamStop still belongs to this run, and must not be taken for the next one's.
const SETTLES: Duration = Duration::from_millis(30);
/// A frame's board time is rounded down to a microsecond.
const ROUNDING_US: f64 = 1.0;

/// A STREAM frame that came.
#[derive(Debug, Clone)]
pub(super) struct Sampled {
    pub(super) at: Instant,
    pub(super) place: usize,
    pub(super) request: u16,
    pub(super) frame: StreamFrame,
}

impl Sampled {
    /// The number behind its last sample.
    pub(super) fn end(&self) -> u32 {
        self.frame.head.first.wrapping_add(self.frame.head.count.into())
    }
}

/// A stream that was started and stopped.
#[derive(Debug)]
pub(super) struct Run {
    pub(super) reply: StreamStartReply,
    /// Place of the RESULT of StreamStart.
    pub(super) started: usize,
    /// Place of the RESULT of StreamStop.
    pub(super) stopped: usize,
    pub(super) frames: Vec<Sampled>,
    pub(super) stop: StreamStopReply,
}

/// An IMU stream without an end.
pub(super) fn imu(rate_hz: u16, samples_per_frame: u8) -> StreamStart {
    StreamStart { stream: 1, rate_hz, count: 0, samples_per_frame }
}

/// The same stream as it is asked for on CAN, where there is one sample in a frame.
pub(super) fn on_link(driver: &Driver, start: &StreamStart) -> StreamStart {
    let most = if driver.is_can() { 1 } else { u8::MAX };
    StreamStart { samples_per_frame: start.samples_per_frame.min(most), ..start.clone() }
}

/// The frames of a stream that came behind `from`.
pub(super) fn frames_of(driver: &Driver, stream: u8, from: usize) -> Verdict<Vec<Sampled>> {
    let mut frames = Vec::new();
    for (place, heard) in driver.heard().iter().enumerate().skip(from) {
        let Some(frame) = heard.of(Kind::Stream).filter(|frame| frame.header.message == stream.into()) else {
            continue;
        };
        let Ok(read) = StreamFrame::from_payload(&frame.payload) else {
            return failed(format!("a STREAM frame has {} bytes, too few for its head", frame.payload.len()));
        };
        let size = SAMPLE.get(usize::from(stream).wrapping_sub(1)).copied().unwrap_or(1);
        demand(read.samples.len() == size * usize::from(read.head.count), || {
            format!("{} bytes behind the head of a frame of {} samples", read.samples.len(), read.head.count)
        })?;
        frames.push(Sampled { at: heard.at, place, request: frame.header.request, frame: read });
    }
    Ok(frames)
}

/// Place of the RESULT of a request.
fn result_of(driver: &Driver, request: u16, from: usize) -> usize {
    let found = driver
        .heard()
        .iter()
        .skip(from)
        .position(|heard| heard.of(Kind::Result).is_some_and(|frame| frame.header.request == request));
    from + found.unwrap_or_default()
}

/// Starts a stream, lets it run, and stops it.
pub(super) async fn stream(driver: &mut Driver, start: &StreamStart, span: Duration) -> Verdict<Run> {
    let start = on_link(driver, start);
    let from = driver.mark();
    let began = driver.call(&start).await?;
    let reply = began.reply::<StreamStart>()?;
    driver.listen(span).await?;
    let ended = driver.call(&StreamStop { stream: start.stream }).await?;
    let stop = ended.reply::<StreamStop>()?;
    driver.listen(SETTLES).await?;
    Ok(Run {
        reply,
        started: result_of(driver, began.asked.request, from),
        stopped: result_of(driver, ended.asked.request, from),
        frames: frames_of(driver, start.stream, from)?,
        stop,
    })
}

/// Ends the check as failed unless every frame lies on the grid of the first one. On CAN only every 64th sample comes
/// with its time; this computer works the others out.
pub(super) fn on_grid(driver: &Driver, frames: &[Sampled], rate_hz: u16) -> Verdict<()> {
    let clocked = |came: &&Sampled| !driver.is_can() || came.frame.head.first.is_multiple_of(CLOCK_EVERY);
    let heads: Vec<&StreamHead> = frames.iter().filter(clocked).map(|came| &came.frame.head).collect();
    let [began, rest @ ..] = heads.as_slice() else { return failed(format!("{rate_hz} Hz: no frame")) };
    demand(!rest.is_empty() || driver.is_can(), || format!("{rate_hz} Hz: one frame only"))?;
    for head in rest {
        let samples = f64::from(head.first.wrapping_sub(began.first).cast_signed());
        let due_us = samples * 1e6 / f64::from(rate_hz);
        let is_us = head.board_time_us.wrapping_sub(began.board_time_us).cast_signed() as f64;
        demand((is_us - due_us).abs() <= ROUNDING_US + 1e-6, || {
            let (number, off_us) = (head.first, is_us - due_us);
            format!("{rate_hz} Hz: sample {number} lies {off_us:.2} us off the grid of sample {}", began.first)
        })?;
    }
    Ok(())
}

/// Thousandths of the line that an IMU (1) or compensated (4) stream takes, by section 10 or 17.
pub(super) fn load_permille(driver: &Driver, stream: u8, rate_hz: u16, per_frame: u8) -> u32 {
    let rate = u64::from(rate_hz);
    if driver.is_can() {
        // Three frames a sample (compensated: eight), and two before each sample whose number is a multiple of 64; all
        // of them carry 8 bytes but the last of a compensated sample, which carries 6.
        let (whole, short) = if stream == 1 { (3.0, 0.0) } else { (7.0, 1.0) };
        let marks = 2.0 * (f64::from(rate_hz) / 64.0).ceil();
        let bits = |bytes: f64| {
            let plain = 47.0 + 8.0 * bytes;
            plain + STUFF_SHARE * ((34.0 + 8.0 * bytes - 1.0) / 4.0).floor()
        };
        let a_second = (whole * f64::from(rate_hz) + marks) * bits(8.0) + short * f64::from(rate_hz) * bits(6.0);
        return (a_second * 1000.0 / f64::from(driver.rate_bps())).floor() as u32;
    }
    let per_frame = u64::from(per_frame.max(1));
    let frame = 12 + HEAD as u64 + per_frame * if stream == 1 { 40 } else { 46 };
    let bytes = frame + frame.div_ceil(254) + 2;
    // A rounding before the last one would be another number.
    u32::try_from(bytes * 10 * rate * 1000 / (per_frame * u64::from(driver.rate_bps()))).unwrap_or(u32::MAX)
}

/// Whether a stream alone fits on the line.
pub(super) fn fits(driver: &Driver, stream: u8, rate_hz: u16, per_frame: u8) -> bool {
    load_permille(driver, stream, rate_hz, per_frame) <= MOST_PERMILLE
}
