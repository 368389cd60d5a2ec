//! Faults of the line between station and board: what cables, adapters and drivers do to bytes on their way.
//!
//! One [`FaultyWire`] for each direction. It looks at bytes as a line does: a frame is what ends with a delimiter,
//! and nothing in it is understood. Chance comes from seeded dice; what takes time takes link time, which is never
//! scaled. A direction without faults hands bytes on untouched.

use std::collections::VecDeque;
use std::time::Duration;

use gnc_protocol::serial::MAX_ON_WIRE;

use crate::noise::Dice;

/// Frames that may pass one that is overtaken.
const OVERTAKEN_BY: f64 = 3.0;
/// An overtaken frame that nothing follows goes on after this long.
const OVERTAKEN_FOR: Duration = Duration::from_millis(20);
/// Longest garbage: longer than the longest frame, so that receivers must throw some away.
const GARBAGE: f64 = 700.0;

/// How often a direction does what. Shares are per million of the thing named.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct WireRates {
    pub(crate) lost_bytes: f64,
    /// Place of the byte that is lost in every frame that has so many; 0: none. No chance in it: so does a buffer that is
    /// too short by one.
    pub(crate) lost_byte_at: u32,
    pub(crate) flipped_bits: f64,
    pub(crate) lost_frames: f64,
    /// The rest of the frame is lost, its delimiter too.
    pub(crate) cut_frames: f64,
    pub(crate) doubled_frames: f64,
    /// Arrive behind up to three that were sent later.
    pub(crate) overtaken_frames: f64,
    pub(crate) delayed_frames: f64,
    pub(crate) delay_ms: f64,
    /// Frames in the middle of which the line stands still.
    pub(crate) stalled_frames: f64,
    pub(crate) stall_ms: f64,
    /// Frames before which there is garbage.
    pub(crate) babbled_frames: f64,
    /// Frames that also come back to their sender.
    pub(crate) echoed_frames: f64,
}

/// Faults of both directions.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct WireFaults {
    pub(crate) to_host: WireRates,
    pub(crate) to_board: WireRates,
    /// Every so many CAN frames towards the host one is lost; 0: none.
    pub(crate) can_lose_every: u32,
}

/// One direction of a line with faults.
#[derive(Debug)]
pub(crate) struct FaultyWire {
    rates: WireRates,
    clean: bool,
    dice: Dice,
    /// A frame of which the end has not come yet.
    begun: Vec<u8>,
    /// Bytes and when they go on, in their order.
    queue: VecDeque<(Duration, Vec<u8>)>,
    /// A frame that others overtake: how many still, and how long at most.
    overtaken: Option<(u32, Duration, Vec<u8>)>,
    echo: Vec<u8>,
    harmed: bool,
    toll: Toll,
    /// Spoilt frames behind which no whole one has come yet.
    trailing: u64,
    /// The frame that comes next begins the numbers of its sender afresh.
    afresh: bool,
}

/// What a direction did to the frames that were sent on it: the injector's own count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Toll {
    /// Frames sent.
    pub frames: u64,
    /// Of those lost, cut or altered, so that no receiver can take them for what they were.
    pub spoilt: u64,
    /// Of those the ones that a receiver can miss: a whole frame came behind them, and no new count began with it.
    pub missable: u64,
    /// Everything else that was done to frames: doubled, overtaken, delayed, stalled, babbled at, echoed.
    pub others: u64,
}

impl FaultyWire {
    pub(crate) fn new(rates: WireRates, dice: Dice) -> Self {
        let clean = rates == WireRates::default();
        let (begun, queue, echo) = (Vec::new(), VecDeque::new(), Vec::new());
        let toll = Toll::default();
        Self {
            rates,
            clean,
            dice,
            begun,
            queue,
            overtaken: None,
            echo,
            harmed: false,
            toll,
            trailing: 0,
            afresh: false,
        }
    }

    /// The frame that is pushed next begins the numbers of its sender afresh.
    pub(crate) fn begin_numbers(&mut self) {
        self.afresh = true;
    }

    pub(crate) fn toll(&self) -> Toll {
        self.toll
    }

    /// Whether it hands bytes on untouched and at once, so that they need not pass through it.
    pub(crate) fn is_clean(&self) -> bool {
        self.clean && self.queue.is_empty()
    }

    /// Bytes go in, cut anywhere.
    pub(crate) fn push(&mut self, bytes: &[u8], now: Duration) {
        if self.clean {
            self.queue.push_back((now, bytes.to_vec()));
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

    /// What has gone on by `now`.
    pub(crate) fn ready(&mut self, now: Duration) -> Vec<u8> {
        if let Some((_, _, frame)) = self.overtaken.take_if(|(_, until, _)| *until <= now) {
            self.enqueue(frame, now);
        }
        let mut bytes = Vec::new();
        while self.queue.front().is_some_and(|(due, _)| *due <= now) {
            bytes.extend(self.queue.pop_front().map(|(_, part)| part).unwrap_or_default());
        }
        bytes
    }

    /// When more goes on.
    pub(crate) fn next_due(&self) -> Option<Duration> {
        let front = self.queue.front().map(|(due, _)| *due);
        let overtaken = self.overtaken.as_ref().map(|(_, until, _)| *until);
        [front, overtaken].into_iter().flatten().min()
    }

    /// Bytes on their way.
    pub(crate) fn len(&self) -> usize {
        let overtaken = self.overtaken.as_ref().map_or(0, |(_, _, frame)| frame.len());
        self.queue.iter().map(|(_, bytes)| bytes.len()).sum::<usize>() + overtaken
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.queue.is_empty() && self.overtaken.is_none()
    }

    /// What comes back to the sender.
    pub(crate) fn take_echo(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.echo)
    }

    /// Whether something was lost or damaged since this was asked last.
    pub(crate) fn take_harmed(&mut self) -> bool {
        std::mem::take(&mut self.harmed)
    }

    /// A whole frame meets its fate.
    fn pass(&mut self, mut frame: Vec<u8>, now: Duration) {
        let rates = self.rates;
        let passed = self.overtaken.as_mut().is_some_and(|(left, _, _)| {
            *left -= 1;
            *left == 0
        });
        if self.happens(rates.echoed_frames) {
            self.echo.extend_from_slice(&frame);
            self.toll.others += 1;
        }
        let (whole, sent) = (frame.len(), frame.clone());
        if self.happens(rates.lost_frames) {
            frame.clear();
        }
        if self.happens(rates.cut_frames) {
            let kept = self.below(frame.len() as f64);
            frame.truncate(kept);
        }
        if rates.lost_byte_at > 0 && frame.len() >= rates.lost_byte_at as usize {
            frame.remove(rates.lost_byte_at as usize - 1);
        }
        if rates.lost_bytes > 0.0 {
            frame.retain(|_| self.dice.between(0.0, 1e6) >= rates.lost_bytes);
        }
        self.harmed |= frame.len() < whole;
        if rates.flipped_bits > 0.0 {
            for index in 0..frame.len() * 8 {
                if self.dice_happen(rates.flipped_bits) {
                    frame[index / 8] ^= 1 << (index % 8);
                    self.harmed = true;
                }
            }
        }
        self.count(&sent, &frame);
        if self.happens(rates.babbled_frames) {
            let garbage = self.garbage();
            self.enqueue(garbage, now);
            self.toll.others += 1;
        }
        if self.happens(rates.doubled_frames) {
            self.enqueue(frame.clone(), now);
            self.toll.others += 1;
        }
        if self.overtaken.is_none() && self.happens(rates.overtaken_frames) {
            self.toll.others += 1;
            let by = 1 + self.below(OVERTAKEN_BY) as u32;
            self.overtaken = Some((by, now + OVERTAKEN_FOR, frame));
        } else {
            self.enqueue(frame, now);
        }
        if passed && let Some((_, _, frame)) = self.overtaken.take() {
            self.enqueue(frame, now);
        }
    }

    /// A frame that lost nothing but a delimiter is whole: the next one brings another.
    fn count(&mut self, sent: &[u8], left: &[u8]) {
        let afresh = std::mem::take(&mut self.afresh);
        self.toll.frames += 1;
        if content(sent) != content(left) {
            self.toll.spoilt += 1;
            self.trailing += 1;
            return;
        }
        let before = std::mem::take(&mut self.trailing);
        self.toll.missable += if afresh { 0 } else { before };
    }

    /// Behind all that is on its way: a line does not let one byte pass another.
    fn enqueue(&mut self, mut bytes: Vec<u8>, now: Duration) {
        let ms = |ms: f64| Duration::from_secs_f64(ms * 1e-3);
        let delayed = self.happens(self.rates.delayed_frames);
        let delay = if delayed { ms(self.rates.delay_ms) } else { Duration::ZERO };
        let last = self.queue.back().map_or(Duration::ZERO, |(due, _)| *due);
        let mut due = last.max(now + delay);
        let stalled = self.happens(self.rates.stalled_frames);
        self.toll.others += u64::from(delayed) + u64::from(stalled);
        if stalled {
            let rest = bytes.split_off(self.below(bytes.len() as f64));
            self.queue.push_back((due, bytes));
            due += ms(self.rates.stall_ms);
            bytes = rest;
        }
        self.queue.push_back((due, bytes));
    }

    /// Nothing but noise, zeros in it or not, or what has the looks of a frame.
    fn garbage(&mut self) -> Vec<u8> {
        let length = 1 + self.below(GARBAGE);
        let lowest = self.below(2.0) as f64;
        let mut garbage: Vec<u8> = (0..length).map(|_| self.dice.between(lowest, 256.0) as u8).collect();
        if self.dice.between(0.0, 1.0) < 0.5 {
            garbage.push(0);
        }
        garbage
    }

    /// Without a rate no dice are thrown.
    fn happens(&mut self, per_million: f64) -> bool {
        per_million > 0.0 && self.dice_happen(per_million)
    }

    fn dice_happen(&mut self, per_million: f64) -> bool {
        self.dice.between(0.0, 1e6) < per_million
    }

    fn below(&mut self, bound: f64) -> usize {
        self.dice.between(0.0, bound.max(1.0)) as usize
    }
}

/// What stands between a frame's delimiters.
fn content(frame: &[u8]) -> &[u8] {
    let begin = frame.iter().position(|byte| *byte != 0).unwrap_or(frame.len());
    let end = frame.iter().rposition(|byte| *byte != 0).map_or(begin, |last| last + 1);
    &frame[begin..end]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Source;

    const SECOND: Duration = Duration::from_secs(1);

    /// What a hundred frames of three bytes become, all sent at once, and when the last has gone on.
    fn through(rates: WireRates) -> (Vec<u8>, Duration) {
        let mut wire = FaultyWire::new(rates, Dice::new(7, Source::Line));
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
        let rates = WireRates { lost_bytes: 1e5, flipped_bits: 1e4, overtaken_frames: 1e5, ..WireRates::default() };
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

        let (bytes, _) = through(WireRates { doubled_frames: share, ..WireRates::default() });
        let left = frames(&bytes);
        assert!((110..150).contains(&left.len()) && left.is_sorted(), "{}", left.len());

        let (bytes, _) = through(WireRates { overtaken_frames: share, ..WireRates::default() });
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

        let (bytes, end) = through(WireRates { delayed_frames: share, delay_ms: 80.0, ..WireRates::default() });
        assert!(frames(&bytes).is_sorted() && end == SECOND + Duration::from_millis(80));

        let (bytes, end) = through(WireRates { stalled_frames: 1e6, stall_ms: 10.0, ..WireRates::default() });
        assert!(frames(&bytes).is_sorted() && end == SECOND * 2, "a hundred stalls, one after the other: {end:?}");
    }

    /// Every frame counts once, and what a receiver can miss is what whole frames stand behind.
    #[test]
    fn the_toll_is_what_was_done() {
        const AFRESH: u8 = 53;
        let rates = WireRates { lost_frames: 3e5, ..WireRates::default() };
        let mut wire = FaultyWire::new(rates, Dice::new(11, Source::Line));
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
            let mut wire = FaultyWire::new(rates, Dice::new(7, Source::Line));
            wire.push(&[0, 1, 2, 3, 0], SECOND);
            wire.toll().spoilt
        };
        assert_eq!([1, 2, 4, 5].map(toll), [0, 1, 1, 0]);
    }
}
