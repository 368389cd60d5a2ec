//! Sample streams. Their frames are unacknowledged and numbered, so that losses on the board, on the line and in the
//! host stay apart.

use crate::frame::{Header, MAX_PAYLOAD};
use crate::serial::on_wire;
use crate::timing::BITS_PER_BYTE;
use crate::wire::{FieldReader, FieldWriter, Overflow, Wire, WireError, wire_enum, wire_struct};

wire_enum! {
    /// The streams of a board.
    StreamId: u8 {
        /// Gyroscopes, accelerometers, magnetometer and temperatures.
        Imu = 1,
        /// Bytes of the GNSS receiver as they come.
        Gnss = 2,
        /// Captures of the receiver's 1PPS edge.
        Pps = 3,
        /// The samples of the IMU, compensated on the board.
        Compensated = 4,
    }
}

impl StreamId {
    /// Its name in texts.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Imu => "the IMU stream",
            Self::Gnss => "the GNSS stream",
            Self::Pps => "the 1PPS stream",
            Self::Compensated => "the compensated stream",
        }
    }
}

wire_enum! {
    /// Layouts of the samples.
    Format: u8 {
        /// [`ImuSample`].
        Imu = 1,
        /// Bytes.
        Bytes = 2,
        /// [`PpsCapture`].
        Pps = 3,
        /// [`crate::calibration::CompensatedSample`].
        Compensated = 4,
    }
}

/// Bytes before the samples.
pub const STREAM_HEAD: usize = 20;
/// Bytes for samples in one frame.
pub const MAX_SAMPLE_BYTES: usize = MAX_PAYLOAD - STREAM_HEAD;
/// Bytes of an IMU sample.
pub const IMU_SAMPLE: usize = 40;
/// IMU samples in a full frame.
pub const MAX_IMU_SAMPLES: usize = MAX_SAMPLE_BYTES / IMU_SAMPLE;
/// Bytes of a compensated sample.
pub const COMPENSATED_SAMPLE: usize = 46;
/// Compensated samples in a full frame.
pub const MAX_COMPENSATED_SAMPLES: usize = MAX_SAMPLE_BYTES / COMPENSATED_SAMPLE;
/// Largest share of the link that a stream may take; the rest is for requests, heartbeats and repeats.
pub const MAX_LOAD_PERMILLE: u32 = 900;

wire_struct! {
    /// The head before the samples in the payload of a STREAM frame.
    StreamHead {
        /// A number of [`StreamId`].
        stream: u8,
        /// A number of [`Format`].
        format: u8,
        /// Samples (bytes) in this frame.
        count: u16,
        /// Number of the first sample since the stream's start; dropped samples count.
        first: u32,
        /// Board time of the first sample, in microseconds.
        board_time_us: u64,
        /// Samples dropped on the board since the stream's start.
        dropped: u32,
    }
}

/// Nominal scale: counts for one deg/s. 8,000,000 counts are the published range of 400 deg/s; values saturate at
/// +-[`SATURATION`].
pub const GYRO_LSB_PER_DPS: f64 = 20_000.0;
/// Nominal scale: counts for one g (9.80665 m/s^2).
pub const ACCEL_LSB_PER_G: f64 = 160_000.0;
/// Nominal scale: counts for one gauss.
pub const MAG_LSB_PER_GAUSS: f64 = 1_250_000.0;
/// Largest value of a sensor: 24 bits, two's complement. The smallest value is one below its negative.
pub const SATURATION: i32 = 8_388_607;

wire_struct! {
    /// One sample of the IMU, raw: the sensors' output before any calibration.
    ImuSample {
        /// Angular rate about X, Y, Z, in counts of 1/20,000 deg/s nominal.
        gyro: [i32; 3],
        /// Specific force along X, Y, Z, in counts of 1/160,000 g nominal; +1 g on the axis that points up at rest.
        accel: [i32; 3],
        /// Magnetic field along X, Y, Z, in counts of 1/1,250,000 gauss nominal.
        mag: [i32; 3],
        /// Temperature of the gyroscopes, 0.01 degC.
        gyro_temperature: i16,
        /// Temperature of the accelerometers, 0.01 degC.
        accel_temperature: i16,
    }
}

wire_struct! {
    /// One edge of the 1PPS.
    PpsCapture {
        /// Board time of the edge, in nanoseconds, by a timer of 10 ns resolution.
        board_time_ns: u64,
    }
}

/// A STREAM frame: head and raw samples.
#[derive(Debug, Clone, PartialEq)]
pub struct StreamFrame {
    /// The head.
    pub head: StreamHead,
    /// The samples as bytes.
    pub samples: heapless::Vec<u8, MAX_SAMPLE_BYTES>,
}

/// Counts of a stream's samples by place of loss.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Losses {
    /// Samples that came.
    pub received: u32,
    /// Samples that the board could not send.
    pub on_board: u32,
    /// Samples that left the board and did not arrive.
    pub on_line: u32,
}

impl Losses {
    /// Whether any sample is missing.
    #[must_use]
    pub fn any(&self) -> bool {
        self.on_board > 0 || self.on_line > 0
    }
}

impl Wire for StreamFrame {
    fn put(&self, writer: &mut FieldWriter) -> Result<(), Overflow> {
        self.head.put(writer)?;
        writer.bytes(&self.samples)
    }
    fn get(reader: &mut FieldReader<'_>) -> Result<Self, WireError> {
        let head = StreamHead::get(reader)?;
        let bytes = reader.take_rest();
        let samples = heapless::Vec::from_slice(bytes)
            .map_err(|_| WireError::TooMany { length: bytes.len(), most: MAX_SAMPLE_BYTES })?;
        Ok(Self { head, samples })
    }
}

/// Share of an RS-422 link, in thousandths, that an IMU stream takes.
#[must_use]
pub fn imu_load_permille(rate_hz: u32, samples_per_frame: u32, rate_baud: u32) -> u32 {
    load_permille(IMU_SAMPLE, rate_hz, samples_per_frame, rate_baud)
}

/// Share of an RS-422 link, in thousandths, that a stream of samples of this size takes.
#[must_use]
pub fn load_permille(sample_bytes: usize, rate_hz: u32, samples_per_frame: u32, rate_baud: u32) -> u32 {
    let samples_per_frame = samples_per_frame.max(1);
    let frame_bytes = on_wire(STREAM_HEAD + sample_bytes * samples_per_frame as usize) as u64;
    let bits_per_second = frame_bytes * u64::from(BITS_PER_BYTE) * u64::from(rate_hz) / u64::from(samples_per_frame);
    u32::try_from(bits_per_second * 1000 / u64::from(rate_baud.max(1))).unwrap_or(u32::MAX)
}

/// The header of a stream's frames: no request, the stream id as message id.
#[must_use]
pub fn stream_header(stream: StreamId) -> Header {
    Header {
        version: crate::PROTOCOL_VERSION,
        kind: crate::Kind::Stream,
        flags: crate::Flags::default(),
        request: 0,
        message: stream as u16,
        sequence: 0,
    }
}
