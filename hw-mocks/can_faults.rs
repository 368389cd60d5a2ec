//! Faults between the station and the CAN bus: what adapters, drivers and a bad cable do to frames on their way.
//!
//! There is one [`FaultyBus`] for each direction. A controller discards frames with a bad CRC, so damage on the wire
//! shows as loss. A single frame is never cut, but a burst cuts a message of several frames. Damage that no controller
//! sees (in an adapter's memory, on the serial line of an slcan adapter) hits only messages here. Raw frames carry no
//! checksum of this protocol, so the source of an alteration could not be found. For the same reason garbage never
//! comes under ids of raw frames. Chance comes from seeded dice; time is link time.

use std::time::Duration;

use gnc_protocol::can::id::{
    BOARD_EVENTS, IMU_GYRO, PPS, URGENT_TO_BOARD, URGENT_TO_HOST, WORK_TO_BOARD, WORK_TO_HOST, echo_of, is_echo,
};
use gnc_protocol::can::{CanFrame, CanId};

use crate::fault_queue::{FaultQueue, QueueRates, Sent, Toll};
use crate::noise::Dice;

/// Longest burst of lost frames: the capacity of an adapter.
const BURST: f64 = 32.0;
/// Ids of messages.
const MESSAGES: [u16; 4] = [URGENT_TO_BOARD, URGENT_TO_HOST, WORK_TO_BOARD, WORK_TO_HOST];

/// Rates of the faults of a direction, per million frames.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct CanRates {
    pub(crate) lost_frames: f64,
    /// A burst: this frame and up to 31 behind it.
    pub(crate) lost_bursts: f64,
    /// One bit is inverted; only in frames of messages.
    pub(crate) flipped_frames: f64,
    /// Frames with a garbage frame before them.
    pub(crate) babbled_frames: f64,
    /// A stall comes before a frame: no frame is cut.
    pub(crate) queue: QueueRates,
}

/// Faults of both directions.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct CanWireFaults {
    pub(crate) to_host: CanRates,
    pub(crate) to_board: CanRates,
}

/// A CAN frame never stops in the middle.
impl Sent for CanFrame {
    fn stopped(self, _: &mut Dice) -> (Option<Self>, Self) {
        (None, self)
    }
}

/// One direction with faults.
#[derive(Debug)]
pub(crate) struct FaultyBus {
    rates: CanRates,
    queue: FaultQueue<CanFrame>,
    burst: usize,
    harmed: bool,
}

impl FaultyBus {
    pub(crate) fn new(rates: CanRates, dice: Dice) -> Self {
        Self { rates, queue: FaultQueue::new(rates.queue, dice), burst: 0, harmed: false }
    }

    pub(crate) fn toll(&self) -> Toll {
        self.queue.toll
    }

    /// Takes a frame and applies the faults to it.
    pub(crate) fn push(&mut self, frame: CanFrame, now: Duration) {
        let rates = self.rates;
        self.queue.toll.frames += 1;
        let passed = self.queue.passes();
        if self.queue.dice.happens(rates.babbled_frames)
            && let Some(garbage) = garbage(&mut self.queue.dice)
        {
            self.queue.toll.others += 1;
            self.queue.enqueue(garbage, now);
        }
        if self.burst == 0 && self.queue.dice.happens(rates.lost_bursts) {
            self.burst = 1 + self.queue.dice.below(BURST);
        }
        let in_burst = self.burst > 0;
        self.burst = self.burst.saturating_sub(1);
        if in_burst || self.queue.dice.happens(rates.lost_frames) {
            self.harmed = true;
            self.queue.toll.spoilt += 1;
        } else {
            let frame = if self.queue.dice.happens(rates.flipped_frames) { self.flip(frame) } else { frame };
            self.queue.send(frame, now);
        }
        if passed {
            self.queue.release(now);
        }
    }

    /// The next frame that has passed by `now`.
    pub(crate) fn pop(&mut self, now: Duration) -> Option<CanFrame> {
        self.queue.pop(now)
    }

    /// The time at which the next frame passes.
    pub(crate) fn next_due(&self) -> Option<Duration> {
        self.queue.next_due()
    }

    /// Frames on their way.
    pub(crate) fn len(&self) -> usize {
        self.queue.iter().count()
    }

    /// Whether a frame was lost or damaged since the last call.
    pub(crate) fn take_harmed(&mut self) -> bool {
        std::mem::take(&mut self.harmed)
    }

    fn flip(&mut self, frame: CanFrame) -> CanFrame {
        let is_message = matches!(frame.id(), CanId::Standard(id) if MESSAGES.contains(&id));
        if !is_message || frame.data().is_empty() {
            return frame;
        }
        self.harmed = true;
        self.queue.toll.spoilt += 1;
        let mut data = frame.data().to_vec();
        let bit = self.queue.dice.below(data.len() as f64 * 8.0);
        data[bit / 8] ^= 1 << (bit % 8);
        CanFrame::new(frame.id(), &data).unwrap_or(frame)
    }
}

/// A garbage frame. Half of them have ids of messages; `None` if the id belongs to raw frames.
fn garbage(dice: &mut Dice) -> Option<CanFrame> {
    let id = match dice.below(4.0) {
        0 => CanId::Extended(dice.below(f64::from(CanId::MAX_EXTENDED)) as u32),
        1 => CanId::Standard(dice.below(f64::from(CanId::MAX_STANDARD)) as u16),
        _ => CanId::Standard(MESSAGES[dice.below(MESSAGES.len() as f64)]),
    };
    let is_raw = matches!(id, CanId::Standard(BOARD_EVENTS | IMU_GYRO..=PPS)) || is_echo(id) || echo_of(id).is_some();
    let length = dice.below(9.0);
    let data: Vec<u8> = (0..length).map(|_| dice.between(0.0, 256.0) as u8).collect();
    CanFrame::new(id, &data).filter(|_| !is_raw)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::RandomStream;

    const SECOND: Duration = Duration::from_secs(1);

    /// The result of two hundred numbered message frames that are sent at once, and the time at which the last one has
    /// passed.
    fn through(rates: CanRates) -> (Vec<CanFrame>, Duration) {
        let mut bus = FaultyBus::new(rates, Dice::new(7, RandomStream::CanToHost));
        (0..200).for_each(|number| bus.push(numbered(number), SECOND));
        let (mut frames, mut now) = (Vec::new(), SECOND);
        while let Some(due) = bus.next_due() {
            now = now.max(due);
            frames.extend(std::iter::from_fn(|| bus.pop(now)));
        }
        assert_eq!(bus.len(), 0);
        (frames, now)
    }

    fn queued(queue: QueueRates) -> (Vec<CanFrame>, Duration) {
        through(CanRates { queue, ..CanRates::default() })
    }

    fn numbered(number: u8) -> CanFrame {
        CanFrame::new(CanId::Standard(WORK_TO_HOST), &[number, 1, 2, 3]).unwrap()
    }

    fn numbers(frames: &[CanFrame]) -> Vec<u8> {
        frames.iter().map(|frame| frame.data()[0]).collect()
    }

    #[test]
    fn a_clean_bus_changes_nothing() {
        let (frames, end) = through(CanRates::default());
        assert_eq!((frames, end), ((0..200).map(numbered).collect(), SECOND));
    }

    #[test]
    fn the_same_seed_does_the_same() {
        let rates = CanRates { lost_bursts: 1e4, flipped_frames: 1e5, babbled_frames: 1e5, ..CanRates::default() };
        assert_eq!(through(rates), through(rates));
    }

    #[test]
    fn each_fault_does_what_its_name_says() {
        let share = 3e5;
        let (frames, _) = through(CanRates { lost_frames: share, ..CanRates::default() });
        assert!((110..170).contains(&frames.len()) && numbers(&frames).is_sorted(), "{}", frames.len());

        let (frames, _) = through(CanRates { lost_bursts: 2e4, ..CanRates::default() });
        let longest = numbers(&frames).windows(2).map(|pair| pair[1] - pair[0]).max();
        assert!(frames.len() < 200 && longest > Some(3), "{} {longest:?}", frames.len());

        let (frames, _) = through(CanRates { flipped_frames: share, ..CanRates::default() });
        let altered = frames.iter().zip(0..).filter(|(frame, number)| **frame != numbered(*number)).count();
        assert!(frames.len() == 200 && (30..90).contains(&altered), "{altered}");

        let (frames, _) = queued(QueueRates { doubled_frames: share, ..QueueRates::default() });
        assert!((230..290).contains(&frames.len()) && numbers(&frames).is_sorted(), "{}", frames.len());

        let (frames, _) = queued(QueueRates { overtaken_frames: share, ..QueueRates::default() });
        let mut left = numbers(&frames);
        assert!(left.len() == 200 && !left.is_sorted());
        left.sort_unstable();
        assert_eq!(left, (0..200).collect::<Vec<u8>>());

        let (frames, end) = queued(QueueRates { delayed_frames: share, delay_ms: 80.0, ..QueueRates::default() });
        assert!(numbers(&frames).is_sorted() && end == SECOND + Duration::from_millis(80), "{end:?}");

        let (frames, end) = queued(QueueRates { stalled_frames: 1e6, stall_ms: 5.0, ..QueueRates::default() });
        assert!(numbers(&frames).is_sorted() && end == SECOND * 2, "two hundred stalls, one after the other: {end:?}");

        let (frames, _) = through(CanRates { babbled_frames: share, ..CanRates::default() });
        let own = frames.iter().filter(|frame| frame.data().get(1..) == Some(&[1, 2, 3])).count();
        assert!(own == 200 && frames.len() > 230, "{own} {}", frames.len());
        assert!(frames.iter().all(|frame| !is_echo(frame.id()) && echo_of(frame.id()).is_none()));
    }

    /// Raw frames carry no checksum: only messages are altered.
    #[test]
    fn raw_frames_are_never_altered() {
        let rates = CanRates { flipped_frames: 1e6, ..CanRates::default() };
        let mut bus = FaultyBus::new(rates, Dice::new(7, RandomStream::CanToHost));
        for id in [CanId::Standard(IMU_GYRO), CanId::Standard(0x715), CanId::Extended(0x1abd_0000)] {
            let frame = CanFrame::new(id, &[1, 2, 3]).unwrap();
            bus.push(frame, SECOND);
            assert_eq!(bus.pop(SECOND), Some(frame));
        }
    }
}
