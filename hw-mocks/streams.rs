//! Streams: samples taken by the board's clock and packed into frames.

use gnc_protocol::message::{StreamStart, StreamStopReply};
use gnc_protocol::serial::on_wire;
use gnc_protocol::stream::{
    Format, ImuSample, MAX_SAMPLE_BYTES, PpsCapture, STREAM_HEAD, StreamFrame, StreamHead, StreamId,
};
use gnc_protocol::wire::{FieldWriter, Wire};

use crate::devices::calibration::StoredCompensation;
use crate::devices::inertial::SensorReader;
use crate::requests::samples_per_frame;
use crate::sampling::SamplingFaults;

/// A running stream. Times are bench time in ns.
#[derive(Debug)]
pub(crate) struct RunningStream {
    pub(crate) id: StreamId,
    pub(crate) load_permille: u32,
    rate_hz: u64,
    count: u32,
    per_frame: u16,
    started_ns: u64,
    /// Number of samples (bytes) so far, including dropped ones.
    produced: u32,
    dropped: u32,
    pending: FieldWriter,
    pending_count: u16,
    first: u32,
    first_time_us: u64,
    /// Number of epochs of 0.2 s, or of UTC seconds, that are already handled.
    pub(crate) tick: u64,
    /// The compensation of raw samples, as it was at the stream's start.
    pub(crate) compensation: Option<StoredCompensation>,
    /// Faults of the samples' times.
    pub(crate) sampling: SamplingFaults,
    /// Its view of the sensors, set from its first sample on.
    pub(crate) reader: Option<SensorReader>,
    /// The last sample, for a board that repeats some.
    pub(crate) last: Option<ImuSample>,
}

impl RunningStream {
    pub(crate) fn new(start: &StreamStart, id: StreamId, load_permille: u32, started_ns: u64, tick: u64) -> Self {
        Self {
            id,
            load_permille,
            rate_hz: u64::from(start.rate_hz.max(1)),
            count: start.count,
            per_frame: u16::from(samples_per_frame(start)),
            started_ns,
            produced: 0,
            dropped: 0,
            pending: FieldWriter::default(),
            pending_count: 0,
            first: 0,
            first_time_us: 0,
            tick,
            compensation: None,
            sampling: SamplingFaults::default(),
            reader: None,
            last: None,
        }
    }

    /// Number of the next sample.
    pub(crate) fn produced(&self) -> u32 {
        self.produced
    }

    pub(crate) fn rate_hz(&self) -> u64 {
        self.rate_hz
    }

    /// Whether it has produced all requested samples.
    pub(crate) fn is_complete(&self) -> bool {
        self.count != 0 && self.produced >= self.count
    }

    pub(crate) fn stopped(&self) -> StreamStopReply {
        StreamStopReply { produced: self.produced, dropped: self.dropped }
    }

    /// The time of the IMU sample `index`: the first one comes a period after the start.
    fn imu_time_ns(&self, index: u32) -> u64 {
        self.started_ns + self.sampling.taken_ns(index, self.rate_hz)
    }

    /// The time that a frame tells for the next IMU sample.
    pub(crate) fn next_told_ns(&self) -> u64 {
        self.started_ns + self.sampling.told_ns(self.produced, self.rate_hz)
    }

    /// The time of the next IMU sample.
    pub(crate) fn next_imu_ns(&self) -> u64 {
        self.imu_time_ns(self.produced)
    }

    /// The time at which the current IMU frame is full.
    pub(crate) fn frame_full_ns(&self) -> u64 {
        let missing = u32::from(self.per_frame - self.pending_count.min(self.per_frame - 1)) - 1;
        let missing = if self.count == 0 { missing } else { missing.min(self.count.saturating_sub(self.produced + 1)) };
        self.imu_time_ns(self.produced + missing)
    }

    /// Adds a sample of the IMU, raw or compensated; returns a frame when one is full.
    pub(crate) fn add_sample(&mut self, sample: &impl Wire, time_us: u64) -> Option<StreamFrame> {
        self.add(1, time_us);
        // A frame is closed before its samples outgrow it.
        let _ = sample.put(&mut self.pending);
        (self.pending_count >= self.per_frame || self.is_complete()).then(|| self.take_frame()).flatten()
    }

    /// Adds an edge of the 1PPS, which is sent at once.
    pub(crate) fn add_pps(&mut self, capture: &PpsCapture, time_us: u64) -> Option<StreamFrame> {
        self.add(1, time_us);
        let _ = capture.put(&mut self.pending);
        self.take_frame()
    }

    /// Adds the receiver's bytes, which are sent at once in as many frames as they need.
    pub(crate) fn add_bytes(&mut self, bytes: &[u8], time_us: u64) -> Vec<StreamFrame> {
        let room = if self.count == 0 { bytes.len() } else { (self.count - self.produced.min(self.count)) as usize };
        let bytes = &bytes[..bytes.len().min(room)];
        let frame = |chunk: &[u8]| {
            self.add(chunk.len() as u16, time_us);
            let _ = self.pending.bytes(chunk);
            self.take_frame()
        };
        bytes.chunks(MAX_SAMPLE_BYTES).filter_map(frame).collect()
    }

    /// Counts what is added to the frame.
    fn add(&mut self, count: u16, time_us: u64) {
        if self.pending_count == 0 {
            (self.first, self.first_time_us) = (self.produced, time_us);
        }
        self.pending_count += count;
        self.produced = self.produced.wrapping_add(u32::from(count));
    }

    /// The waiting samples as a frame.
    pub(crate) fn take_frame(&mut self) -> Option<StreamFrame> {
        if self.pending_count == 0 {
            return None;
        }
        let head = StreamHead {
            stream: self.id as u8,
            format: format_of(self.id) as u8,
            count: std::mem::take(&mut self.pending_count),
            first: self.first,
            board_time_us: self.first_time_us,
            dropped: self.dropped,
        };
        let mut frame = StreamFrame { head, samples: Default::default() };
        let _ = frame.samples.extend_from_slice(&std::mem::take(&mut self.pending).finish());
        Some(frame)
    }

    /// Counts a frame for which the line had no room.
    pub(crate) fn drop_frame(&mut self, frame: &StreamFrame) {
        self.dropped = self.dropped.wrapping_add(u32::from(frame.head.count));
    }
}

/// Most bytes of a frame on the line.
pub(crate) fn stream_bytes(frame: &StreamFrame) -> usize {
    on_wire(STREAM_HEAD + frame.samples.len())
}

/// The layout of the samples of a stream.
pub(crate) fn format_of(id: StreamId) -> Format {
    match id {
        StreamId::Imu => Format::Imu,
        StreamId::Gnss => Format::Bytes,
        StreamId::Pps => Format::Pps,
        StreamId::Compensated => Format::Compensated,
    }
}
