//! Faults of the line between station and board: what cables, adapters and drivers do to bytes on their way.
//!
//! There is one [`FaultyWire`] for each direction. It treats bytes as a line does: a frame ends with a delimiter, and
//! its content is not interpreted. Chance comes from seeded dice. All times are link time, which is never scaled. A
//! direction without faults hands bytes on unchanged.

use std::time::Duration;

use gnc_protocol::serial::MAX_ON_WIRE;

use crate::fault_queue::{FaultQueue, QueueRates, Sent, Toll};
use crate::noise::Dice;

/// Longest garbage: longer than the longest frame, so that receivers must discard some.
const GARBAGE: f64 = 700.0;

/// Rates of the faults of a direction. Shares are per million of the thing named.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct WireRates {
    pub(crate) lost_bytes: f64,
    /// Place of the byte that is lost in every frame with at least so many bytes; 0: none. There is no chance in it: a
    /// buffer that is too short by one does this.
    pub(crate) lost_byte_at: u32,
    pub(crate) flipped_bits: f64,
    pub(crate) lost_frames: f64,
    /// Frames whose rest is lost, including the delimiter.
    pub(crate) cut_frames: f64,
    /// A stall comes in the middle of a frame.
    pub(crate) queue: QueueRates,
    /// Frames with garbage before them.
    pub(crate) babbled_frames: f64,
    /// Frames that also come back to their sender.
    pub(crate) echoed_frames: f64,
}

/// Faults of both directions.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct WireFaults {
    pub(crate) to_host: WireRates,
    pub(crate) to_board: WireRates,
    /// One of this many CAN frames towards the host is lost; 0: none.
    pub(crate) can_lose_every: u32,
}

/// A frame may stop at any place.
impl Sent for Vec<u8> {
    fn stopped(mut self, dice: &mut Dice) -> (Option<Self>, Self) {
        let rest = self.split_off(dice.below(self.len() as f64));
        (Some(self), rest)
    }
}

/// One direction of a line with faults.
#[derive(Debug)]
pub(crate) struct FaultyWire {
    rates: WireRates,
    clean: bool,
    queue: FaultQueue<Vec<u8>>,
    /// A frame whose end has not come yet.
    begun: Vec<u8>,
    echo: Vec<u8>,
    harmed: bool,
    /// Spoilt frames behind which no whole frame has come yet.
    trailing: u64,
    /// Whether the next frame restarts the numbers of its sender.
    afresh: bool,
}

impl FaultyWire {
    pub(crate) fn new(rates: WireRates, dice: Dice) -> Self {
        Self {
            rates,
            clean: rates == WireRates::default(),
            queue: FaultQueue::new(rates.queue, dice),
            begun: Vec::new(),
            echo: Vec::new(),
            harmed: false,
            trailing: 0,
            afresh: false,
        }
    }

    /// Announces that the next frame restarts the numbers of its sender.
    pub(crate) fn begin_numbers(&mut self) {
        self.afresh = true;
    }

    pub(crate) fn toll(&self) -> Toll {
        self.queue.toll
    }

    /// Whether it hands bytes on unchanged and at once, so that they need not pass through it.
    pub(crate) fn is_clean(&self) -> bool {
        self.clean && self.is_empty()
    }

    /// Takes bytes, split at any place.
    pub(crate) fn push(&mut self, bytes: &[u8], now: Duration) {
        if self.clean {
            self.queue.hand_on(bytes.to_vec(), now);
            return;
        }
        for &byte in bytes {
            let ends = byte == 0 && self.begun.iter().any(|before| *before != 0);
            self.begun.push(byte);
            if ends || self.begun.len() > MAX_ON_WIRE {
                let frame = std::mem::take(&mut self.begun);
                self.pass(frame, now);
            }
        }
    }

    /// The bytes that have passed by `now`.
    pub(crate) fn ready(&mut self, now: Duration) -> Vec<u8> {
        let mut bytes = Vec::new();
        while let Some(part) = self.queue.pop(now) {
            bytes.extend(part);
        }
        bytes
    }

    /// The time at which more bytes pass.
    pub(crate) fn next_due(&self) -> Option<Duration> {
        self.queue.next_due()
    }

    /// Bytes on their way.
    pub(crate) fn len(&self) -> usize {
        self.queue.iter().map(Vec::len).sum()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.queue.iter().next().is_none()
    }

    /// The bytes that come back to the sender.
    pub(crate) fn take_echo(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.echo)
    }

    /// Whether bytes were lost or damaged since the last call.
    pub(crate) fn take_harmed(&mut self) -> bool {
        std::mem::take(&mut self.harmed)
    }

    /// Applies the faults to a whole frame.
    fn pass(&mut self, mut frame: Vec<u8>, now: Duration) {
        let rates = self.rates;
        let passed = self.queue.passes();
        if self.queue.dice.happens(rates.echoed_frames) {
            self.echo.extend_from_slice(&frame);
            self.queue.toll.others += 1;
        }
        let (whole, sent) = (frame.len(), frame.clone());
        if self.queue.dice.happens(rates.lost_frames) {
            frame.clear();
        }
        if self.queue.dice.happens(rates.cut_frames) {
            let kept = self.queue.dice.below(frame.len() as f64);
            frame.truncate(kept);
        }
        if rates.lost_byte_at > 0 && frame.len() >= rates.lost_byte_at as usize {
            frame.remove(rates.lost_byte_at as usize - 1);
        }
        frame.retain(|_| !self.queue.dice.happens(rates.lost_bytes));
        self.harmed |= frame.len() < whole;
        if rates.flipped_bits > 0.0 {
            for index in 0..frame.len() * 8 {
                if self.queue.dice.happens(rates.flipped_bits) {
                    frame[index / 8] ^= 1 << (index % 8);
                    self.harmed = true;
                }
            }
        }
        self.count(&sent, &frame);
        if self.queue.dice.happens(rates.babbled_frames) {
            let garbage = garbage(&mut self.queue.dice);
            self.queue.enqueue(garbage, now);
            self.queue.toll.others += 1;
        }
        self.queue.send(frame, now);
        if passed {
            self.queue.release(now);
        }
    }

    /// Counts a frame. If only a delimiter is lost the frame is whole: the next one brings another delimiter.
    fn count(&mut self, sent: &[u8], left: &[u8]) {
        let afresh = std::mem::take(&mut self.afresh);
        self.queue.toll.frames += 1;
        if content(sent) != content(left) {
            self.queue.toll.spoilt += 1;
            self.trailing += 1;
            return;
        }
        let before = std::mem::take(&mut self.trailing);
        self.queue.toll.missable += if afresh { 0 } else { before };
    }
}

/// Garbage: noise with or without zeros, or bytes that look like a frame.
fn garbage(dice: &mut Dice) -> Vec<u8> {
    let length = 1 + dice.below(GARBAGE);
    let lowest = dice.below(2.0) as f64;
    let mut garbage: Vec<u8> = (0..length).map(|_| dice.between(lowest, 256.0) as u8).collect();
    if dice.between(0.0, 1.0) < 0.5 {
        garbage.push(0);
    }
    garbage
}

/// The bytes between a frame's delimiters.
fn content(frame: &[u8]) -> &[u8] {
    let begin = frame.iter().position(|byte| *byte != 0).unwrap_or(frame.len());
    let end = frame.iter().rposition(|byte| *byte != 0).map_or(begin, |last| last + 1);
    &frame[begin..end]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::RandomStream;

    const SECOND: Duration = Duration::from_secs(1);

    /// The result of a hundred frames of three bytes that are sent at once, and the time at which the last one has
    /// passed.
    fn through(rates: WireRates) -> (Vec<u8>, Duration) {
        let mut wire = FaultyWire::new(rates, Dice::new(7, RandomStream::Line));
        for number in 1..=100 {
            // In two pieces, as a port may hand them over.
            wire.push(&[0, number], SECOND);
            wire.push(&[number, number, 0], SECOND);
        }
        let (mut bytes, mut now) = (wire.ready(SECOND), SECOND);
        while let Some(due) = wire.next_due() {
            now = now.max(due);
            bytes.extend(wire.ready(now));
        }
        assert!(wire.is_empty());
        (bytes, now)
    }

    fn queued(queue: QueueRates) -> (Vec<u8>, Duration) {
        through(WireRates { queue, ..WireRates::default() })
    }

    fn frames(bytes: &[u8]) -> Vec<&[u8]> {
        bytes.split(|byte| *byte == 0).filter(|frame| !frame.is_empty()).collect()
    }

    fn whole(frame: &[u8]) -> bool {
        frame.len() == 3 && frame.iter().all(|byte| *byte == frame[0])
    }

    #[test]
    fn a_clean_wire_changes_nothing() {
        let (bytes, end) = through(WireRates::default());
        assert_eq!((bytes.len(), end), (500, SECOND));
        assert!(frames(&bytes).iter().zip(1..).all(|(frame, number)| *frame == [number; 3]));
    }

    #[test]
    fn the_same_seed_does_the_same() {
        let queue = QueueRates { overtaken_frames: 1e5, ..QueueRates::default() };
        let rates = WireRates { lost_bytes: 1e5, flipped_bits: 1e4, queue, ..WireRates::default() };
        assert_eq!(through(rates), through(rates));
    }

    #[test]
    fn each_fault_does_what_its_name_says() {
        let share = 3e5;
        let (bytes, _) = through(WireRates { lost_frames: share, ..WireRates::default() });
        let left = frames(&bytes);
        assert!((50..90).contains(&left.len()) && left.iter().all(|frame| whole(frame)), "{}", left.len());

        let (bytes, _) = through(WireRates { cut_frames: share, ..WireRates::default() });
        let wholes = frames(&bytes).iter().filter(|frame| whole(frame)).count();
        assert!((50..95).contains(&wholes), "a cut frame spoils no other: {wholes}");

        let (bytes, _) = queued(QueueRates { doubled_frames: share, ..QueueRates::default() });
        let left = frames(&bytes);
        assert!((110..150).contains(&left.len()) && left.is_sorted(), "{}", left.len());

        let (bytes, _) = queued(QueueRates { overtaken_frames: share, ..QueueRates::default() });
        let mut left = frames(&bytes);
        assert!(left.len() == 100 && !left.is_sorted());
        left.sort_unstable();
        assert!(left.iter().zip(1..).all(|(frame, number)| *frame == [number; 3]));

        let (bytes, _) = through(WireRates { lost_bytes: 1e4, ..WireRates::default() });
        assert!((480..500).contains(&bytes.len()), "{}", bytes.len());

        let (bytes, _) = through(WireRates { lost_byte_at: 4, ..WireRates::default() });
        assert!(bytes.len() == 400 && frames(&bytes).iter().all(|frame| frame.len() == 2), "{}", bytes.len());
        assert_eq!(through(WireRates { lost_byte_at: 6, ..WireRates::default() }).0.len(), 500, "no frame is so long");

        let (bytes, _) = through(WireRates { flipped_bits: 1e4, ..WireRates::default() });
        assert!(bytes.len() == 500 && frames(&bytes).iter().any(|frame| !whole(frame)));

        let (bytes, _) = through(WireRates { babbled_frames: share, ..WireRates::default() });
        assert!(bytes.len() > 1000 && frames(&bytes).iter().filter(|frame| whole(frame)).count() >= 100);

        let (bytes, end) = queued(QueueRates { delayed_frames: share, delay_ms: 80.0, ..QueueRates::default() });
        assert!(frames(&bytes).is_sorted() && end == SECOND + Duration::from_millis(80));

        let (bytes, end) = queued(QueueRates { stalled_frames: 1e6, stall_ms: 10.0, ..QueueRates::default() });
        assert!(frames(&bytes).is_sorted() && end == SECOND * 2, "a hundred stalls, one after the other: {end:?}");
    }

    /// Every frame counts once, and a spoilt frame is missable only if a whole frame follows it.
    #[test]
    fn the_toll_is_what_was_done() {
        const AFRESH: u8 = 53;
        let rates = WireRates { lost_frames: 3e5, ..WireRates::default() };
        let mut wire = FaultyWire::new(rates, Dice::new(11, RandomStream::Line));
        let mut arrived = Vec::new();
        for number in 1..=100 {
            if number == AFRESH {
                wire.begin_numbers();
            }
            wire.push(&[0, number, number, number, 0], SECOND);
            arrived.extend(frames(&wire.ready(SECOND)).iter().map(|frame| frame[0]));
        }
        let gaps = |numbers: &[u8]| numbers.windows(2).map(|pair| u64::from(pair[1] - pair[0]) - 1).sum::<u64>();
        let toll = wire.toll();
        assert_eq!((toll.frames, toll.spoilt, toll.others), (100, 100 - arrived.len() as u64, 0));
        assert!(arrived.contains(&AFRESH), "the seed lets the frame through that begins afresh: {arrived:?}");
        let (before, after): (Vec<u8>, Vec<u8>) = arrived.iter().partition(|number| **number < AFRESH);
        let first = u64::from(before[0]) - 1;
        assert_eq!(toll.missable, first + gaps(&before) + gaps(&after));
    }

    #[test]
    fn a_lost_delimiter_spoils_nothing() {
        let toll = |byte| {
            let rates = WireRates { lost_byte_at: byte, ..WireRates::default() };
            let mut wire = FaultyWire::new(rates, Dice::new(7, RandomStream::Line));
            wire.push(&[0, 1, 2, 3, 0], SECOND);
            wire.toll().spoilt
        };
        assert_eq!([1, 2, 4, 5].map(toll), [0, 1, 1, 0]);
    }
}
