//! Compensated samples as raw frames. A sample of 46 bytes goes in eight frames. Each frame has the sample's number and
//! the frame's place in the sample. A mark and a clock go ahead, as with the IMU's samples.

use super::stream::{MARK_EVERY, after_us, frame_of};
use super::{CanFrame, CanId, MAX_DATA, bits, id, worst_bits};
use crate::stream::{COMPENSATED_SAMPLE, Format, StreamFrame, StreamHead, StreamId};

/// Bytes of a sample in a frame, after two bytes of number and place.
const PIECE: usize = MAX_DATA - 2;
/// Frames of a sample.
const PIECES: usize = COMPENSATED_SAMPLE.div_ceil(PIECE);
/// The place takes the lower three bits of the two bytes, the number the rest.
const PLACE_BITS: u32 = 3;
const NUMBER_MASK: u32 = (1 << (16 - PLACE_BITS)) - 1;
const _: () = assert!(PIECES == 1 << PLACE_BITS);

/// Bits that a stream of `rate_hz` puts on the bus in a second: without stuffing, and with the most stuff bits.
#[must_use]
pub const fn compensated_bits(rate_hz: u32) -> (u32, u32) {
    let last = (2 + COMPENSATED_SAMPLE - PIECE * (PIECES - 1)) as u32;
    let full = (PIECES as u32 - 1) * rate_hz + 2 * rate_hz.div_ceil(MARK_EVERY);
    (
        full * bits(false, 8) + rate_hz * bits(false, last),
        full * worst_bits(false, 8) + rate_hz * worst_bits(false, last),
    )
}

/// The board's end.
#[derive(Debug, Default)]
pub(super) struct CompensatedPacker {
    next: Option<u32>,
    rate_hz: u16,
    dropped: u32,
}

impl CompensatedPacker {
    pub(super) fn start(&mut self, rate_hz: u16) {
        (self.next, self.rate_hz) = (None, rate_hz);
    }

    pub(super) fn pack(&mut self, frame: &StreamFrame, send: &mut impl FnMut(CanFrame)) {
        let head = &frame.head;
        for (at, sample) in (0..u32::from(head.count)).zip(frame.samples.chunks_exact(COMPENSATED_SAMPLE)) {
            let number = head.first.wrapping_add(at);
            if number.is_multiple_of(MARK_EVERY) || self.next != Some(number) || self.dropped != head.dropped {
                let time_us = head.board_time_us + after_us(at, self.rate_hz);
                let mark = u64::from(number) | u64::from(head.dropped) << 32;
                send(CanFrame::full(id::COMPENSATED_MARK, mark.to_le_bytes()));
                send(CanFrame::full(id::COMPENSATED_CLOCK, time_us.to_le_bytes()));
            }
            (self.next, self.dropped) = (Some(number.wrapping_add(1)), head.dropped);
            for (place, piece) in (0..).zip(sample.chunks(PIECE)) {
                let mut data = super::Data::new();
                let head = ((number & NUMBER_MASK) << PLACE_BITS | place) as u16;
                // Two bytes and at most six: they fit.
                let _ = data.extend_from_slice(&head.to_le_bytes());
                let _ = data.extend_from_slice(piece);
                CanFrame::new(CanId::Standard(id::COMPENSATED), &data).map(&mut *send);
            }
        }
    }
}

/// The host's end. A sample with a missing frame is not delivered. Before the first clock no sample is delivered, since
/// its time is not known.
#[derive(Debug, Default)]
pub(super) struct CompensatedUnpacker {
    rate_hz: u16,
    /// Number of the sample, samples dropped.
    mark: Option<(u32, u32)>,
    /// Number of the sample, samples dropped, board time.
    clock: Option<(u32, u32, u64)>,
    number: u32,
    bytes: heapless::Vec<u8, COMPENSATED_SAMPLE>,
}

impl CompensatedUnpacker {
    pub(super) fn start(&mut self, rate_hz: u16) {
        *self = Self { rate_hz, ..Self::default() };
    }

    pub(super) fn receive(&mut self, can: u16, data: &[u8]) -> Option<StreamFrame> {
        match can {
            id::COMPENSATED_MARK => {
                let word = u64::from_le_bytes(data.try_into().ok()?);
                self.mark = Some((word as u32, (word >> 32) as u32));
                None
            }
            id::COMPENSATED_CLOCK => {
                let time_us = u64::from_le_bytes(data.try_into().ok()?);
                // A clock is the time of the marked sample only if it follows that mark directly.
                if let Some((number, dropped)) = self.mark.take() {
                    self.clock = Some((number, dropped, time_us));
                }
                None
            }
            _ => self.piece(data),
        }
    }

    fn piece(&mut self, data: &[u8]) -> Option<StreamFrame> {
        // This mark has no clock. Samples after it would get the time of another one.
        self.mark = None;
        let (head, piece) = data.split_first_chunk::<2>()?;
        let head = u32::from(u16::from_le_bytes(*head));
        let (number, place) = (head >> PLACE_BITS, (head & ((1 << PLACE_BITS) - 1)) as usize);
        if place == 0 {
            self.number = number;
            self.bytes.clear();
        }
        let follows = number == self.number && self.bytes.len() == place * PIECE;
        if !follows || self.bytes.extend_from_slice(piece).is_err() {
            self.bytes.clear();
            // No sample has this number, so the rest of this sample is skipped.
            self.number = u32::MAX;
            return None;
        }
        if self.bytes.len() < COMPENSATED_SAMPLE {
            return None;
        }
        let (first, dropped, time_us) = self.clock?;
        let since = number.wrapping_sub(first) & NUMBER_MASK;
        let head = StreamHead {
            stream: StreamId::Compensated as u8,
            format: Format::Compensated as u8,
            count: 1,
            first: first.wrapping_add(since),
            board_time_us: time_us.wrapping_add(after_us(since, self.rate_hz)),
            dropped,
        };
        frame_of(head, &self.bytes)
    }
}
