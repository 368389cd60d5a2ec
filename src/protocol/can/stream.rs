//! Streams as raw frames. Each frame has a number, so the host sees the loss of any frame.
//!
//! An IMU sample is exactly three frames: gyroscopes, accelerometers, magnetometer, each a counter of ten bits and
//! three values of 18 bits. [`Packer`] splits the STREAM frames of a board, [`Unpacker`] makes STREAM frames from the
//! raw frames.

use crate::message::StreamStart;
use crate::stream::{Format, ImuSample, PpsCapture, SATURATION, StreamFrame, StreamHead, StreamId};
use crate::wire::{FieldReader, Wire as _};

pub use super::compensated::compensated_bits;
use super::{BIT_RATE, CanFrame, CanId, MAX_DATA, bits, compensated, id, worst_bits};

/// A mark (whole number, temperatures) and the clock go before each sample whose number is a multiple of this, and
/// before the first sample after a loss on the board. This is often enough to recover after a loss of samples, and
/// takes less than 1 % of the bus.
pub const MARK_EVERY: u32 = 64;
/// Values of the sensors travel as the upper 18 of their 24 bits.
const SHIFT: u32 = 6;
/// The lower end of the range: the negative saturation.
const LOWEST: i32 = -SATURATION - 1;
/// Largest value of 18 bits; it and its opposite stand for saturation.
const LARGEST: i32 = (1 << 17) - 1;
const COUNTER_BITS: u32 = 10;
const COUNTER_MASK: u32 = (1 << COUNTER_BITS) - 1;
/// Bytes of the receiver in a frame, after two bytes of number.
const GNSS_BYTES: usize = MAX_DATA - 2;
/// Bytes a second and bursts a second of the receiver, as on RS-422.
const GNSS_BYTES_A_SECOND: u32 = 3_500;
const GNSS_BURSTS_A_SECOND: u32 = 5;

/// Bits that an IMU stream of `rate_hz` puts on the bus in a second: without stuffing, and with the most stuff bits.
#[must_use]
pub const fn imu_bits(rate_hz: u32) -> (u32, u32) {
    let frames = 3 * rate_hz + 2 * rate_hz.div_ceil(MARK_EVERY);
    (frames * bits(false, 8), frames * worst_bits(false, 8))
}

/// As [`imu_bits`], for the receiver's bytes.
#[must_use]
pub const fn gnss_bits() -> (u32, u32) {
    let frames = GNSS_BYTES_A_SECOND.div_ceil(GNSS_BYTES as u32) + 2 * GNSS_BURSTS_A_SECOND;
    (frames * bits(false, 8), frames * worst_bits(false, 8))
}

/// As [`imu_bits`], for 1PPS.
#[must_use]
pub const fn pps_bits() -> (u32, u32) {
    (bits(false, 8), worst_bits(false, 8))
}

/// Mean share of the bus in thousandths, rounded down: the bits without stuffing and 30 % of the largest possible
/// number of stuff bits. This is about what a module at rest needs.
#[must_use]
pub const fn load_permille((plain, worst): (u32, u32)) -> u32 {
    (plain + (worst - plain) * 3 / 10) / (BIT_RATE / 1000)
}

/// Shortens 24 bits to 18, rounded down; saturation stays saturation.
fn shorten(counts: i32) -> u64 {
    let value = match counts {
        SATURATION.. => LARGEST,
        i32::MIN..=LOWEST => -LARGEST - 1,
        counts => (counts >> SHIFT).clamp(-LARGEST, LARGEST - 1),
    };
    u64::from(value.cast_unsigned()) & 0x3_ffff
}

/// Extends 18 bits to 24: the middle of the step, so that the mean does not shift.
fn lengthen(value: u64) -> i32 {
    let value = ((value as u32) << 14).cast_signed() >> 14;
    match value {
        LARGEST => SATURATION,
        value if value == -LARGEST - 1 => LOWEST,
        value => (value << SHIFT) + (1 << (SHIFT - 1)),
    }
}

fn pack(counter: u32, axes: [i32; 3]) -> [u8; MAX_DATA] {
    let [x, y, z] = axes.map(shorten);
    (u64::from(counter & COUNTER_MASK) | x << 10 | y << 28 | z << 46).to_le_bytes()
}

fn unpack(data: [u8; MAX_DATA]) -> (u32, [i32; 3]) {
    let word = u64::from_le_bytes(data);
    (word as u32 & COUNTER_MASK, [10, 28, 46].map(|shift| lengthen(word >> shift & 0x3_ffff)))
}

/// The lower 48 bits of a time and 16 bits of `more`.
fn clock(time_us: u64, more: u32) -> [u8; MAX_DATA] {
    (time_us & 0xffff_ffff_ffff | u64::from(more & 0xffff) << 48).to_le_bytes()
}

/// The board's end: from STREAM frames to raw frames.
#[derive(Debug, Default)]
pub struct Packer {
    /// The next IMU sample, if it follows the last one.
    next: Option<u32>,
    rate_hz: u16,
    dropped: u32,
    pulses: u8,
    compensated: compensated::CompensatedPacker,
}

impl Packer {
    /// Starts a stream.
    pub fn start(&mut self, start: &StreamStart) {
        match StreamId::from_number(start.stream) {
            Some(StreamId::Imu) => {
                self.next = None;
                self.rate_hz = start.rate_hz;
            }
            Some(StreamId::Pps) => self.pulses = 0,
            Some(StreamId::Compensated) => self.compensated.start(start.rate_hz),
            Some(StreamId::Gnss) | None => {}
        }
    }

    /// Splits a STREAM frame into raw frames.
    pub fn pack(&mut self, frame: &StreamFrame, send: &mut impl FnMut(CanFrame)) {
        let head = &frame.head;
        match Format::from_number(head.format) {
            Some(Format::Imu) => {
                let mut reader = FieldReader::new(&frame.samples);
                for at in 0..u32::from(head.count) {
                    let Ok(sample) = ImuSample::get(&mut reader) else { return };
                    let time_us = head.board_time_us + after_us(at, self.rate_hz);
                    self.imu(head.first.wrapping_add(at), time_us, head.dropped, &sample, send);
                }
            }
            Some(Format::Bytes) => {
                send(CanFrame::full(id::GNSS_CLOCK, clock(head.board_time_us, head.first)));
                for (at, piece) in frame.samples.chunks(GNSS_BYTES).enumerate() {
                    let first = head.first.wrapping_add((at * GNSS_BYTES) as u32) as u16;
                    let mut data = super::Data::new();
                    // Two bytes and at most six: they fit.
                    let _ = data.extend_from_slice(&first.to_le_bytes());
                    let _ = data.extend_from_slice(piece);
                    CanFrame::new(CanId::Standard(id::GNSS_BYTES), &data).map(&mut *send);
                }
            }
            Some(Format::Pps) => {
                let mut reader = FieldReader::new(&frame.samples);
                for _ in 0..head.count {
                    let Ok(capture) = PpsCapture::get(&mut reader) else { return };
                    let word = capture.board_time_ns << 8 | u64::from(self.pulses);
                    self.pulses = self.pulses.wrapping_add(1);
                    send(CanFrame::full(id::PPS, word.to_le_bytes()));
                }
            }
            Some(Format::Compensated) => self.compensated.pack(frame, send),
            None => {}
        }
    }

    fn imu(&mut self, number: u32, time_us: u64, dropped: u32, sample: &ImuSample, send: &mut impl FnMut(CanFrame)) {
        if number.is_multiple_of(MARK_EVERY) || self.next != Some(number) || self.dropped != dropped {
            let [n0, n1, n2, n3] = number.to_le_bytes();
            let [g0, g1] = sample.gyro_temperature.to_le_bytes();
            let [a0, a1] = sample.accel_temperature.to_le_bytes();
            send(CanFrame::full(id::IMU_MARK, [n0, n1, n2, n3, g0, g1, a0, a1]));
            send(CanFrame::full(id::IMU_CLOCK, clock(time_us, dropped)));
        }
        (self.next, self.dropped) = (Some(number.wrapping_add(1)), dropped);
        send(CanFrame::full(id::IMU_GYRO, pack(number, sample.gyro)));
        send(CanFrame::full(id::IMU_ACCEL, pack(number, sample.accel)));
        send(CanFrame::full(id::IMU_MAG, pack(number, sample.mag)));
    }
}

#[derive(Debug, Clone, Copy)]
struct Mark {
    number: u32,
    temperatures: (i16, i16),
    /// Computed from the mark before until this mark's own clock comes.
    time_us: u64,
    clocked: bool,
    dropped: u32,
}

/// The host's end: from raw frames to STREAM frames of one sample, one piece of bytes or one capture each.
///
/// A sample with a missing frame is not delivered, so the gap in `first` counts it as lost. Before the first mark no
/// sample is delivered, since its number is not known.
#[derive(Debug, Default)]
pub struct Unpacker {
    rate_hz: u16,
    mark: Option<Mark>,
    gyro: Option<(u32, [i32; 3])>,
    accel: Option<(u32, [i32; 3])>,
    bytes: u32,
    bytes_time_us: u64,
    pulses: u32,
    compensated: compensated::CompensatedUnpacker,
}

impl Unpacker {
    /// Starts a stream that the host requests: its numbers begin anew.
    pub fn start(&mut self, start: &StreamStart) {
        match StreamId::from_number(start.stream) {
            Some(StreamId::Imu) => {
                (self.mark, self.gyro, self.accel) = (None, None, None);
                self.rate_hz = start.rate_hz;
            }
            Some(StreamId::Gnss) => (self.bytes, self.bytes_time_us) = (0, 0),
            Some(StreamId::Pps) => self.pulses = 0,
            Some(StreamId::Compensated) => self.compensated.start(start.rate_hz),
            None => {}
        }
    }

    /// Takes a raw frame of a stream; returns a STREAM frame when one is whole.
    pub fn receive(&mut self, can: u16, data: &[u8]) -> Option<StreamFrame> {
        match can {
            id::GNSS_BYTES => return self.bytes(data),
            id::COMPENSATED..=id::COMPENSATED_CLOCK => return self.compensated.receive(can, data),
            _ => {}
        }
        let data: [u8; MAX_DATA] = data.try_into().ok()?;
        match can {
            id::IMU_MARK => {
                let [n0, n1, n2, n3, g0, g1, a0, a1] = data;
                let number = u32::from_le_bytes([n0, n1, n2, n3]);
                let dropped = self.mark.map_or(0, |mark| mark.dropped);
                let time_us =
                    self.mark.map_or(0, |mark| mark.time_us + after_us(number.wrapping_sub(mark.number), self.rate_hz));
                let temperatures = (i16::from_le_bytes([g0, g1]), i16::from_le_bytes([a0, a1]));
                self.mark = Some(Mark { number, temperatures, time_us, clocked: false, dropped });
                None
            }
            id::IMU_CLOCK => {
                let word = u64::from_le_bytes(data);
                // A clock is the time of the marked sample only if it follows that mark directly.
                if let Some(mark) = self.mark.as_mut().filter(|mark| !mark.clocked) {
                    mark.time_us = word & 0xffff_ffff_ffff;
                    mark.clocked = true;
                    mark.dropped = extend(mark.dropped, word >> 48);
                }
                None
            }
            id::IMU_GYRO => {
                self.gyro = Some(unpack(data));
                None
            }
            id::IMU_ACCEL => {
                self.accel = Some(unpack(data));
                None
            }
            id::IMU_MAG => self.sample(data),
            id::GNSS_CLOCK => {
                self.bytes_time_us = u64::from_le_bytes(data) & 0xffff_ffff_ffff;
                None
            }
            id::PPS => self.pulse(u64::from_le_bytes(data)),
            _ => None,
        }
    }

    fn sample(&mut self, data: [u8; MAX_DATA]) -> Option<StreamFrame> {
        let (counter, mag) = unpack(data);
        let (gyro, accel) = (self.gyro.take()?, self.accel.take()?);
        let mark = self.mark?;
        if gyro.0 != counter || accel.0 != counter {
            return None;
        }
        let since = counter.wrapping_sub(mark.number) & COUNTER_MASK;
        let sample = ImuSample {
            gyro: gyro.1,
            accel: accel.1,
            mag,
            gyro_temperature: mark.temperatures.0,
            accel_temperature: mark.temperatures.1,
        };
        let head = StreamHead {
            stream: StreamId::Imu as u8,
            format: Format::Imu as u8,
            count: 1,
            first: mark.number.wrapping_add(since),
            board_time_us: mark.time_us + after_us(since, self.rate_hz),
            dropped: mark.dropped,
        };
        frame_of(head, &sample.to_payload().ok()?)
    }

    fn bytes(&mut self, data: &[u8]) -> Option<StreamFrame> {
        let (number, bytes) = data.split_first_chunk::<2>()?;
        let first = extend(self.bytes, u16::from_le_bytes(*number).into());
        let count = bytes.len() as u16;
        self.bytes = first.wrapping_add(count.into());
        let head = StreamHead {
            stream: StreamId::Gnss as u8,
            format: Format::Bytes as u8,
            count,
            first,
            board_time_us: self.bytes_time_us,
            dropped: 0,
        };
        frame_of(head, bytes)
    }

    fn pulse(&mut self, word: u64) -> Option<StreamFrame> {
        let missing = (word as u8).wrapping_sub(self.pulses as u8);
        let first = self.pulses.wrapping_add(missing.into());
        self.pulses = first.wrapping_add(1);
        let capture = PpsCapture { board_time_ns: word >> 8 };
        let head = StreamHead {
            stream: StreamId::Pps as u8,
            format: Format::Pps as u8,
            count: 1,
            first,
            board_time_us: capture.board_time_ns / 1000,
            dropped: 0,
        };
        frame_of(head, &capture.to_payload().ok()?)
    }
}

/// Microseconds from one sample to the one `samples` later, rounded down once: the errors of periods do not add up.
pub(super) fn after_us(samples: u32, rate_hz: u16) -> u64 {
    u64::from(samples) * 1_000_000 / u64::from(rate_hz.max(1))
}

/// The number with these lower 16 bits, at or after `from`.
fn extend(from: u32, low: u64) -> u32 {
    from.wrapping_add(u32::from((low as u16).wrapping_sub(from as u16)))
}

pub(super) fn frame_of(head: StreamHead, samples: &[u8]) -> Option<StreamFrame> {
    Some(StreamFrame { head, samples: heapless::Vec::from_slice(samples).ok()? })
}
