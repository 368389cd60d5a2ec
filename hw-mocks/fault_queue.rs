//! Units (frames or bytes) under way on a line with faults: delayed, stopped, doubled or overtaken.
//!
//! There is one [`FaultQueue`] for each direction of a line. Its units are frames as bytes or CAN frames. It keeps
//! their order except for overtaken ones. Chance comes from seeded dice, and without a rate no dice are thrown: a seed
//! repeats a run as long as each fault throws its dice at the same place. All times are link time, which is never
//! scaled.

use std::collections::VecDeque;
use std::time::Duration;

use crate::noise::Dice;

/// Number of frames that may pass an overtaken one.
const OVERTAKEN_BY: f64 = 3.0;
/// Longest time that an overtaken frame waits if no frame follows.
const OVERTAKEN_FOR: Duration = Duration::from_millis(20);

/// How often frames are late, out of order or there twice. Shares are per million frames.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct QueueRates {
    pub(crate) doubled_frames: f64,
    /// Frames that arrive behind up to three that were sent later.
    pub(crate) overtaken_frames: f64,
    pub(crate) delayed_frames: f64,
    pub(crate) delay_ms: f64,
    /// Frames in the middle of which, or before which, the line stalls.
    pub(crate) stalled_frames: f64,
    pub(crate) stall_ms: f64,
}

/// The fault injector's own count of what it did to the frames of a direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Toll {
    /// Frames sent.
    pub frames: u64,
    /// Frames among them that were lost, cut or altered, so that a receiver cannot take them as they were.
    pub spoilt: u64,
    /// Spoilt frames that a receiver can notice: a whole frame came behind them, and its numbers did not start anew.
    pub missable: u64,
    /// Number of all other faults: doubled, overtaken, delayed, stalled, babbled at, echoed.
    pub others: u64,
}

/// A unit on a line.
pub(crate) trait Sent: Clone {
    /// Splits the unit at a stall: the part before it, if the unit can stop in the middle, and the rest.
    fn stopped(self, dice: &mut Dice) -> (Option<Self>, Self);
}

/// One direction: the units under way, in their order.
#[derive(Debug)]
pub(crate) struct FaultQueue<T> {
    rates: QueueRates,
    pub(crate) dice: Dice,
    pub(crate) toll: Toll,
    /// Units and the times at which they arrive.
    units: VecDeque<(Duration, T)>,
    /// The unit that others overtake: how many more may pass it, and until when.
    overtaken: Option<(u32, Duration, T)>,
}

impl<T: Sent> FaultQueue<T> {
    pub(crate) fn new(rates: QueueRates, dice: Dice) -> Self {
        Self { rates, dice, toll: Toll::default(), units: VecDeque::new(), overtaken: None }
    }

    /// Counts a unit that passes the overtaken one; returns whether the overtaken one goes on behind it.
    pub(crate) fn passes(&mut self) -> bool {
        self.overtaken.as_mut().is_some_and(|(left, _, _)| {
            *left -= 1;
            *left == 0
        })
    }

    /// Lets the overtaken unit go on now.
    pub(crate) fn release(&mut self, now: Duration) {
        if let Some((_, _, unit)) = self.overtaken.take() {
            self.enqueue(unit, now);
        }
    }

    /// Sends a unit: perhaps twice, perhaps to be overtaken.
    pub(crate) fn send(&mut self, unit: T, now: Duration) {
        if self.dice.happens(self.rates.doubled_frames) {
            self.toll.others += 1;
            self.enqueue(unit.clone(), now);
        }
        if self.overtaken.is_none() && self.dice.happens(self.rates.overtaken_frames) {
            self.toll.others += 1;
            let by = 1 + self.dice.below(OVERTAKEN_BY) as u32;
            self.overtaken = Some((by, now + OVERTAKEN_FOR, unit));
        } else {
            self.enqueue(unit, now);
        }
    }

    /// Puts a unit behind all others under way, even late ones: on a line no byte passes another.
    pub(crate) fn enqueue(&mut self, unit: T, now: Duration) {
        let ms = |ms: f64| Duration::from_secs_f64(ms * 1e-3);
        let delayed = self.dice.happens(self.rates.delayed_frames);
        let delay = if delayed { ms(self.rates.delay_ms) } else { Duration::ZERO };
        let last = self.units.back().map_or(Duration::ZERO, |(due, _)| *due);
        let mut due = last.max(now + delay);
        let stalled = self.dice.happens(self.rates.stalled_frames);
        self.toll.others += u64::from(delayed) + u64::from(stalled);
        let unit = if stalled {
            let (through, rest) = unit.stopped(&mut self.dice);
            self.units.extend(through.map(|through| (due, through)));
            due += ms(self.rates.stall_ms);
            rest
        } else {
            unit
        };
        self.units.push_back((due, unit));
    }

    /// Puts a unit behind the others without throwing dice.
    pub(crate) fn hand_on(&mut self, unit: T, now: Duration) {
        self.units.push_back((now, unit));
    }

    /// The next unit that has arrived by `now`.
    pub(crate) fn pop(&mut self, now: Duration) -> Option<T> {
        if self.overtaken.as_ref().is_some_and(|(_, until, _)| *until <= now) {
            self.release(now);
        }
        self.units.front().filter(|(due, _)| *due <= now)?;
        self.units.pop_front().map(|(_, unit)| unit)
    }

    /// The time at which the next unit arrives.
    pub(crate) fn next_due(&self) -> Option<Duration> {
        let front = self.units.front().map(|(due, _)| *due);
        let overtaken = self.overtaken.as_ref().map(|(_, until, _)| *until);
        [front, overtaken].into_iter().flatten().min()
    }

    /// All units under way.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &T> {
        let overtaken = self.overtaken.iter().map(|(_, _, unit)| unit);
        self.units.iter().map(|(_, unit)| unit).chain(overtaken)
    }
}
