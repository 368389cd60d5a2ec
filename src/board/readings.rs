//! The newest raw values of the module, for people who watch. They are never for a verdict, and some are skipped.

use std::time::Duration;

use gnc_metrology::ellipse::Correction;
use gnc_nmea::{Epoch, Sentences};
use gnc_protocol::calibration::{CalibrationRead, CalibrationReadReply, CalibrationState, CompensatedSample};
use gnc_protocol::message::{AdRead, AdReadReply, Call as _};
use gnc_protocol::stream::{COMPENSATED_SAMPLE, IMU_SAMPLE, ImuSample, PpsCapture, StreamId};
use gnc_protocol::wire::{FieldReader, Wire};
use tokio::sync::watch;
use tokio::time::Instant;

use crate::stream::SampleFrame;

/// How often readings are handed on. A screen draws 30 times a second.
const EVERY: Duration = Duration::from_millis(20);
/// The time over which a stream's rate is counted.
const RATE_OVER: Duration = Duration::from_secs(1);

/// Bytes of the receiver that may be parsed in [`GNSS_BUDGET_OVER`]: eight times what the receiver sends. A simulated
/// bench at full speed sends thousands of times as much, and parsing for the screen must not slow the conversation.
const GNSS_BUDGET: usize = 4096;
const GNSS_BUDGET_OVER: Duration = Duration::from_millis(200);

/// The newest raw values.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Readings {
    /// The newest sample of the IMU, and its board time in microseconds.
    pub imu: Option<(u64, ImuSample)>,
    /// The newest sample that the board compensated by the module's calibration, and its board time in microseconds.
    pub compensated: Option<(u64, CompensatedSample)>,
    /// The correction of the magnetometer that the module keeps, as soon as a request has read it.
    pub correction: Option<Correction>,
    /// The newest epoch of the receiver.
    pub gnss: Option<Epoch>,
    /// Edges of the 1PPS so far.
    pub pulses: u32,
    /// Channels 1 to 8 in volts, as far as requests have read them.
    pub ad_v: [Option<f64>; 8],
    /// The streams that were heard.
    pub streams: Vec<StreamReading>,
}

/// A stream, and where its samples are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StreamReading {
    /// Which.
    pub id: StreamId,
    /// Samples (bytes) a second of link time.
    pub rate_hz: f64,
    /// Samples that came since the stream's start.
    pub received: u32,
    /// Samples that the board could not send.
    pub on_board: u32,
    /// Samples that left the board and did not arrive.
    pub on_line: u32,
}

/// Collects readings from all frames that pass by.
#[derive(Debug)]
pub(super) struct Gauges {
    now: Readings,
    out: watch::Sender<Readings>,
    handed_on: Option<Instant>,
    sentences: Sentences,
    /// When the count of the receiver's bytes began, and how many bytes were parsed since.
    parsed: Option<(Instant, usize)>,
    rates: Vec<(StreamId, Instant, u32)>,
}

impl Gauges {
    pub(super) fn new(out: watch::Sender<Readings>) -> Self {
        let sentences = Sentences::default();
        Self { now: Readings::default(), out, handed_on: None, sentences, parsed: None, rates: Vec::new() }
    }

    /// A frame of a stream came.
    pub(super) fn streamed(&mut self, id: StreamId, frame: &SampleFrame) {
        if self.out.receiver_count() == 0 {
            return;
        }
        self.count(id, frame);
        match id {
            StreamId::Imu => {
                if let Some(sample) = last_of(frame, IMU_SAMPLE) {
                    self.now.imu = Some((frame.head.board_time_us, sample));
                }
            }
            StreamId::Gnss => {
                self.parse(&frame.samples);
            }
            StreamId::Pps => {
                let edges = frame.samples.len() / size_of::<PpsCapture>().max(1);
                self.now.pulses = self.now.pulses.saturating_add(u32::try_from(edges).unwrap_or(0));
            }
            StreamId::Compensated => {
                if let Some(sample) = last_of(frame, COMPENSATED_SAMPLE) {
                    self.now.compensated = Some((frame.head.board_time_us, sample));
                }
            }
        }
        self.hand_on(false);
    }

    /// A request was answered.
    pub(super) fn answered(&mut self, message: u16, body: &[u8]) {
        if self.out.receiver_count() == 0 {
            return;
        }
        match message {
            AdRead::ID => self.read_ad(body),
            CalibrationRead::ID => self.read_calibration(body),
            _ => return,
        }
        self.hand_on(true);
    }

    fn read_calibration(&mut self, body: &[u8]) {
        let Ok(reply) = CalibrationReadReply::from_payload(body) else { return };
        let valid = reply.state == CalibrationState::Valid as u8;
        self.now.correction = reply.calibration.first().filter(|_| valid).map(|calibration| Correction {
            dx: calibration.mag_dx,
            dy: calibration.mag_dy,
            ky: calibration.mag_ky,
            sin_alpha: calibration.mag_sin_alpha,
        });
    }

    fn read_ad(&mut self, body: &[u8]) {
        let Ok(reply) = AdReadReply::from_payload(body) else { return };
        for channel in &reply.channels {
            let index = usize::from(channel.channel).wrapping_sub(1);
            if let Some(volts) = self.now.ad_v.get_mut(index) {
                *volts = Some(f64::from(channel.mean_uv) * 1e-6);
            }
        }
    }

    /// Parses what the receiver sent, up to the budget. Beyond the budget, the sentence under way is dropped.
    fn parse(&mut self, bytes: &[u8]) {
        let now = Instant::now();
        let (since, parsed) = self.parsed.filter(|(since, _)| now - *since < GNSS_BUDGET_OVER).unwrap_or((now, 0));
        self.parsed = Some((since, parsed.saturating_add(bytes.len())));
        if parsed >= GNSS_BUDGET {
            self.sentences = Sentences::default();
        } else if let Some(epoch) = self.sentences.push(bytes).pop() {
            self.now.gnss = Some(epoch);
        }
    }

    fn count(&mut self, id: StreamId, frame: &SampleFrame) {
        let head = &frame.head;
        let now = Instant::now();
        let index = match self.now.streams.iter().position(|stream| stream.id == id) {
            Some(index) if head.first > 0 => index,
            found => {
                // The first frame of a stream starts new counts.
                let fresh = StreamReading { id, rate_hz: 0.0, received: 0, on_board: 0, on_line: 0 };
                self.rates.retain(|(other, ..)| *other != id);
                self.rates.push((id, now, 0));
                match found {
                    Some(index) => self.now.streams[index] = fresh,
                    None => self.now.streams.push(fresh),
                }
                found.unwrap_or(self.now.streams.len() - 1)
            }
        };
        let stream = &mut self.now.streams[index];
        stream.received = stream.received.saturating_add(head.count.into());
        stream.on_board = head.dropped;
        stream.on_line =
            head.first.saturating_add(head.count.into()).saturating_sub(stream.received.saturating_add(head.dropped));
        if let Some((_, since, before)) = self.rates.iter_mut().find(|(other, ..)| *other == id) {
            let span = now - *since;
            if span >= RATE_OVER {
                stream.rate_hz = f64::from(stream.received.saturating_sub(*before)) / span.as_secs_f64();
                (*since, *before) = (now, stream.received);
            }
        }
    }

    fn hand_on(&mut self, at_once: bool) {
        let now = Instant::now();
        if at_once || self.handed_on.is_none_or(|before| now - before >= EVERY) {
            self.handed_on = Some(now);
            self.out.send_replace(self.now.clone());
        }
    }
}

/// The last sample of a frame.
fn last_of<S: Wire>(frame: &SampleFrame, sample_bytes: usize) -> Option<S> {
    let last = frame.samples.len().checked_sub(sample_bytes).and_then(|at| frame.samples.get(at..))?;
    S::get(&mut FieldReader::new(last)).ok()
}

#[cfg(test)]
mod tests {
    use gnc_protocol::message::AdChannel;
    use gnc_protocol::stream::StreamHead;

    use super::*;

    fn frame(first: u32, samples: &[ImuSample], dropped: u32) -> SampleFrame {
        let bytes = samples.iter().flat_map(|sample| sample.to_payload().unwrap_or_default()).collect();
        let head =
            StreamHead { first, count: samples.len() as u16, dropped, board_time_us: 7, ..StreamHead::default() };
        SampleFrame { head, samples: bytes }
    }

    #[test]
    fn the_last_sample_of_a_frame_is_shown_and_losses_stay_apart() {
        let (out, shown) = watch::channel(Readings::default());
        let mut gauges = Gauges::new(out);
        let sample = |z| ImuSample { accel: [0, 0, z], ..ImuSample::default() };
        gauges.streamed(StreamId::Imu, &frame(0, &[sample(1), sample(2)], 0));
        assert_eq!(shown.borrow().imu.as_ref().map(|(time, sample)| (*time, sample.accel[2])), Some((7, 2)));
        // Of 10 samples 2 came and 3 were dropped on the board. After this frame 4 more are missing on the line.
        gauges.streamed(StreamId::Imu, &frame(9, &[sample(3)], 3));
        gauges.hand_on(true);
        let streams = shown.borrow().streams.clone();
        let found = streams.first().map(|stream| (stream.received, stream.on_board, stream.on_line));
        assert_eq!(found, Some((3, 3, 4)));
    }

    #[test]
    fn ad_channels_are_kept_until_they_are_read_again() {
        let (out, shown) = watch::channel(Readings::default());
        let mut gauges = Gauges::new(out);
        let mut channels = gnc_protocol::wire::List::new();
        let _ = channels.push(AdChannel { channel: 4, mean_uv: 5_000_000, min_uv: 0, max_uv: 0 });
        let body = AdReadReply { channels }.to_payload().unwrap_or_default();
        gauges.answered(AdRead::ID, &body);
        gauges.answered(AdRead::ID, &AdReadReply::default().to_payload().unwrap_or_default());
        assert_eq!(shown.borrow().ad_v[3], Some(5.0));
        assert_eq!(shown.borrow().ad_v[0], None);
    }
}
