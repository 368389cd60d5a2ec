//! What the samples of each stream are.

use std::time::Duration;

use gnc_protocol::Kind;
use gnc_protocol::message::{StreamStart, StreamStop, capability};
use gnc_protocol::stream::ImuSample;
use gnc_protocol::wire::{FieldReader, Wire as _};

use super::run::{Sampled, fits, frames_of, imu, load_permille, on_grid, stream};
use super::{SHORT, is_calibrated};
use crate::driver::{Driver, ms};
use crate::stop::{Verdict, demand, failed, not_applicable};

/// A receiver speaks each second.
const RECEIVER: Duration = Duration::from_millis(2300);
/// Ends of 24 bits.
const CODES: std::ops::RangeInclusive<i32> = -8_388_608..=8_388_607;
/// Share of samples that may equal the one before by chance or by a sensor that stands.
const REPEATS: f64 = 0.02;
/// How long readings are compared: a board may repeat in every second.
const REPEATS_IN: Duration = Duration::from_millis(1500);
/// Two edges of 1PPS lie so far apart, by a board's crystal that is 100 ppm off.
const SECOND_NS: u64 = 1_000_000_000;
const CRYSTAL_NS: u64 = 105_000;

/// The samples of IMU frames.
fn samples(frames: &[Sampled]) -> Vec<ImuSample> {
    let mut samples = Vec::new();
    for came in frames {
        let mut reader = FieldReader::new(&came.frame.samples);
        while let Ok(sample) = ImuSample::get(&mut reader) {
            samples.push(sample);
        }
    }
    samples
}

pub(super) async fn codes(driver: &mut Driver) -> Verdict {
    let run = stream(driver, &imu(200, 10), SHORT).await?;
    let samples = samples(&run.frames);
    demand(!samples.is_empty(), || "no sample came".to_owned())?;
    for sample in &samples {
        let all = sample.gyro.iter().chain(&sample.accel).chain(&sample.mag);
        if let Some(code) = all.copied().find(|code| !CODES.contains(code)) {
            return failed(format!("code {code} needs more than 24 bits"));
        }
    }
    Ok(format!("{} samples", samples.len()))
}

pub(super) async fn repeats(driver: &mut Driver) -> Verdict {
    if driver.can_do(capability::REPEATED_READINGS) {
        return not_applicable("the board says by capability bit 3 that readings come twice");
    }
    let run = stream(driver, &imu(200, 10), REPEATS_IN).await?;
    let samples = samples(&run.frames);
    let twice = samples.windows(2).filter(|pair| pair[0] == pair[1]).count();
    demand(twice as f64 <= REPEATS * samples.len() as f64, || {
        format!("{twice} of {} samples equal the one before on all channels", samples.len())
    })?;
    Ok(format!("{twice} of {} samples equal the one before", samples.len()))
}

/// A stream of the receiver.
fn receiver(stream: u8) -> StreamStart {
    StreamStart { stream, rate_hz: 0, count: 0, samples_per_frame: 0 }
}

pub(super) async fn gnss(driver: &mut Driver) -> Verdict {
    let run = stream(driver, &receiver(2), RECEIVER).await?;
    demand((run.reply.format, run.reply.samples_per_frame) == (2, 0), || {
        format!("format {}, {} samples a frame", run.reply.format, run.reply.samples_per_frame)
    })?;
    let (mut bytes, mut expected) = (Vec::new(), 0);
    for came in &run.frames {
        let first = came.frame.head.first;
        demand(first == expected, || format!("first is {first}, expected {expected}"))?;
        bytes.extend_from_slice(&came.frame.samples);
        expected = came.end();
    }
    demand(!bytes.is_empty(), || format!("no byte within {}", ms(RECEIVER)))?;
    demand(run.stop.produced == expected + run.stop.dropped, || {
        format!("{} bytes produced, {} dropped, {expected} received", run.stop.produced, run.stop.dropped)
    })?;
    // The first and the last piece may be cut.
    let lines: Vec<&[u8]> = bytes.split(|byte| *byte == b'\n').collect();
    let whole = lines.get(1..lines.len().saturating_sub(1)).unwrap_or_default();
    let good = whole.iter().filter(|line| is_sentence(line)).count();
    demand(good > 0, || format!("{} bytes without a whole NMEA sentence", bytes.len()))?;
    demand(good == whole.len(), || format!("{} of {} lines are no NMEA sentence", whole.len() - good, whole.len()))?;
    Ok(format!("{} bytes, {good} whole sentences", bytes.len()))
}

/// Whether a line, without its last LF, is an NMEA sentence with a good checksum and a CR.
fn is_sentence(line: &[u8]) -> bool {
    let Some(body) = line.strip_suffix(b"\r").and_then(|line| line.strip_prefix(b"$")) else { return false };
    let Some((body, &[b'*', high, low])) = body.split_last_chunk::<3>() else { return false };
    let sum = body.iter().fold(0, |sum, byte| sum ^ byte);
    format!("{sum:02X}").into_bytes() == [high.to_ascii_uppercase(), low.to_ascii_uppercase()]
}

pub(super) async fn pps(driver: &mut Driver) -> Verdict {
    let run = stream(driver, &receiver(3), RECEIVER).await?;
    demand((run.reply.format, run.reply.samples_per_frame) == (3, 1), || {
        format!("format {}, {} samples a frame", run.reply.format, run.reply.samples_per_frame)
    })?;
    let mut captures = Vec::new();
    for came in &run.frames {
        let Ok(edge_ns) = u64::from_payload(&came.frame.samples) else {
            return failed(format!("a frame of {} captures", came.frame.head.count));
        };
        let board_us = came.frame.head.board_time_us;
        demand(board_us.abs_diff(edge_ns / 1000) <= 1, || {
            format!("a capture at {edge_ns} ns in a frame of board time {board_us} us")
        })?;
        captures.push(edge_ns);
    }
    if captures.is_empty() {
        return not_applicable(format!("no edge within {}: the receiver has no fix", ms(RECEIVER)));
    }
    for pair in captures.windows(2) {
        let apart = pair[1].saturating_sub(pair[0]);
        demand(apart.abs_diff(SECOND_NS) <= CRYSTAL_NS, || format!("{apart} ns from one edge to the next"))?;
    }
    Ok(format!("{} edges", captures.len()))
}

/// The compensated stream, or its refusal.
pub(crate) async fn compensated(driver: &mut Driver) -> Verdict {
    driver.needs(capability::CALIBRATION)?;
    let rate_hz = 200;
    let per_frame = if driver.is_can() { 1 } else { 10 };
    let start = StreamStart { stream: 4, ..imu(rate_hz, per_frame) };
    if !is_calibrated(driver).await? {
        let asked = driver.post(&start);
        driver.refused(&asked, 10, "without a valid calibration").await?;
        return Ok("NAK 10, since the module holds no calibration in force".to_owned());
    }
    let run = stream(driver, &start, SHORT).await?;
    demand(run.reply.format == 4, || format!("format {}", run.reply.format))?;
    on_grid(driver, &run.frames, rate_hz)?;
    let expected = load_permille(driver, 4, rate_hz, per_frame);
    demand(u32::from(run.reply.load_permille) == expected, || {
        format!("load_permille {} instead of {expected}", run.reply.load_permille)
    })?;
    Ok(format!("{} samples", run.stop.produced))
}

pub(super) async fn together(driver: &mut Driver) -> Verdict {
    let per_frame = if driver.is_can() { 1 } else { 10 };
    if !fits(driver, 1, 100, per_frame) {
        return not_applicable("an IMU stream of 100 Hz does not fit on this line beside others");
    }
    let from = driver.mark();
    driver.ask(&imu(100, per_frame)).await?;
    for stream in [2, 3] {
        driver.ask(&receiver(stream)).await?;
    }
    driver.listen(RECEIVER).await?;
    let counts = [frames_of(driver, 1, from)?.len(), frames_of(driver, 2, from)?.len()];
    for stream in 1..=3 {
        driver.ask(&StreamStop { stream }).await?;
    }
    demand(counts.iter().all(|count| *count > 0), || format!("{} IMU and {} GNSS frames came", counts[0], counts[1]))?;
    let naks = driver.heard().iter().filter(|heard| heard.of(Kind::Nak).is_some()).count();
    demand(naks == 0, || format!("{naks} NAKs"))?;
    Ok(format!("{} IMU and {} GNSS frames side by side", counts[0], counts[1]))
}
