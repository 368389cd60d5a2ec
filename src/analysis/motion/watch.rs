//! Watches samples as they come, so that a spoilt capture ends at once with a reason: no figure may come from it.
//!
//! Nominal scale is enough here, since the watch looks for a hand on the table, not for a bias.

use std::collections::VecDeque;

use gnc_protocol::stream::{ACCEL_LSB_PER_G, GYRO_LSB_PER_DPS, ImuSample, SATURATION};

use super::{GYRO_RANGE_DPS, Uses};

/// Time of each mean that is compared with the first one.
const BLOCK_S: f64 = 1.0;
/// Fewest samples of a mean, so that noise does not count as motion at low rates either.
const BLOCK_SAMPLES: f64 = 50.0;
/// A mean rate that departs by more than this is motion. A bias wanders by thousandths of it in an hour; a socket that
/// is touched turns faster.
const RATE_DPS: f64 = 0.3;
/// Number of consecutive samples, far from the level or at the end of the range, that count as motion or saturation.
/// Fewer are failed reads or spikes, which the data gate counts: one read in ten may fail before six in a row do so by
/// chance.
const LASTING: usize = 6;
/// A sample is far from the level if it departs by more than this many times the limit of a mean. Nearer samples may
/// stay in the mean: one in ten of them does not move it beyond its limit.
const FAR: f64 = 10.0;
/// Readings before a saturation that show how the rate rose to it. At 200 Hz this is 50 ms, in which the acceleration of a
/// table hardly changes.
const ON_THE_WAY: usize = 10;
/// Fewest of them that show a rise.
const RISE: usize = 3;
/// A mean force that departs by more than this is motion: 10 mg are a tilt of 0.6 degrees.
const FORCE_G: f64 = 0.01;

/// What is wrong with a capture.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Spoilt {
    /// The module moved.
    #[error("the module moved: {channel} departs by {by} from its first second")]
    Moved {
        /// The channel that shows the motion.
        channel: String,
        /// Size of the departure, with its unit.
        by: String,
    },
    /// The table went beyond the range of the gyroscopes, and took them out of their range.
    #[error(
        "the table turned faster than {GYRO_RANGE_DPS:.0} deg/s: {channel} rose to {last_dps:.1} deg/s, by {rise_dps:.2} deg/s from \
         sample to sample, and then saturated"
    )]
    TooFast {
        /// The channel.
        channel: String,
        /// Its last reading before it saturated.
        last_dps: f64,
        /// Its change from sample to sample on the way there.
        rise_dps: f64,
    },
    /// A channel that counts is out of its range.
    #[error("{channel} is saturated")]
    Saturated {
        /// The channel.
        channel: String,
    },
}

/// A watch over the samples of one capture.
#[derive(Debug)]
pub struct Watch {
    uses: Uses,
    /// Samples of a block; `None` where the module may move.
    block: Option<u32>,
    first: Option<[f64; 6]>,
    /// Samples of the block so far, by channel.
    values: [Vec<i32>; 6],
    /// Consecutive samples at the end of the range, by channel of the triads that count.
    at_end: [usize; 6],
    /// The newest readings of the gyroscopes within the range.
    on_the_way: [VecDeque<i32>; 3],
}

impl Watch {
    /// Creates a watch over a capture; `still` if nothing may move.
    #[must_use]
    pub fn new(uses: Uses, still: bool, rate_hz: u16) -> Self {
        let samples = (BLOCK_S * f64::from(rate_hz)).round().max(BLOCK_SAMPLES) as u32;
        Self {
            uses,
            block: still.then_some(samples),
            first: None,
            values: Default::default(),
            at_end: [0; 6],
            on_the_way: Default::default(),
        }
    }

    /// Looks at the next samples.
    ///
    /// # Errors
    /// The index of the sample at which the fault is noticed, and the fault.
    pub fn look(&mut self, samples: &[ImuSample]) -> Result<(), (usize, Spoilt)> {
        for (index, sample) in samples.iter().enumerate() {
            self.saturated(sample).map_err(|spoilt| (index, spoilt))?;
            self.moved(sample).map_err(|spoilt| (index, spoilt))?;
        }
        Ok(())
    }

    fn saturated(&mut self, sample: &ImuSample) -> Result<(), Spoilt> {
        let used: &[(&str, &[i32; 3])] = match self.uses {
            Uses::Inertial | Uses::Compensated => &[("gyro", &sample.gyro), ("accel", &sample.accel)],
            Uses::Gyro => &[("gyro", &sample.gyro)],
            Uses::Magnetometer => &[("mag", &sample.mag)],
        };
        for (sensor, counts) in used {
            let first = if *sensor == "accel" { 3 } else { 0 };
            for (axis, count) in counts.iter().enumerate() {
                let is_at_end = *count >= SATURATION || *count < -SATURATION;
                let row = &mut self.at_end[first + axis];
                *row = if is_at_end { *row + 1 } else { 0 };
                let is_gyro = *sensor == "gyro";
                if is_gyro && !is_at_end {
                    let readings = &mut self.on_the_way[axis];
                    readings.truncate(ON_THE_WAY - 1);
                    readings.push_front(*count);
                }
                if self.at_end[first + axis] >= LASTING {
                    let channel = channel(sensor, axis);
                    let too_fast = is_gyro.then(|| too_fast(&self.on_the_way[axis])).flatten();
                    return Err(match too_fast {
                        Some((last_dps, rise_dps)) => Spoilt::TooFast { channel, last_dps, rise_dps },
                        None => Spoilt::Saturated { channel },
                    });
                }
            }
        }
        Ok(())
    }

    fn moved(&mut self, sample: &ImuSample) -> Result<(), Spoilt> {
        let Some(block) = self.block else { return Ok(()) };
        for (values, count) in self.values.iter_mut().zip(sample.gyro.iter().chain(&sample.accel)) {
            values.push(*count);
        }
        if self.values[0].len() < block as usize {
            return Ok(());
        }
        let mut means = [0.0; 6];
        for (index, (mean, values)) in means.iter_mut().zip(&mut self.values).enumerate() {
            let Kind { scale, limit, .. } = Kind::of(index);
            *mean = lasting_mean(values, FAR * limit * scale);
            values.clear();
        }
        let first = *self.first.get_or_insert(means);
        for (index, (mean, first)) in means.iter().zip(first).enumerate() {
            let Kind { sensor, scale, limit, unit } = Kind::of(index);
            let by = (mean - first) / scale;
            if by.abs() > limit {
                return Err(Spoilt::Moved { channel: channel(sensor, index % 3), by: format!("{by:+.3} {unit}") });
            }
        }
        Ok(())
    }
}

/// Whether the readings before a saturation, newest first, show that the rate went beyond the published range: a line
/// through them reaches it no later than at the first saturated sample. Returns the last reading and the rise from
/// sample to sample. A sensor that ends below its range jumps to the end from a lower rate.
fn too_fast(readings: &VecDeque<i32>) -> Option<(f64, f64)> {
    if readings.len() < RISE {
        return None;
    }
    let rates: Vec<f64> = readings.iter().map(|count| f64::from(*count) / GYRO_LSB_PER_DPS).collect();
    // Medians (Theil and Sen), so that a failed read among the readings changes nothing.
    let pairs = rates.iter().enumerate().flat_map(|(age, rate)| {
        rates[age + 1..].iter().enumerate().map(move |(more, older)| (rate - older) / (more + 1) as f64)
    });
    let rise_dps = median(pairs.collect());
    let next_dps = median(rates.iter().enumerate().map(|(age, rate)| rate + rise_dps * (age + 1) as f64).collect());
    (next_dps.abs() >= GYRO_RANGE_DPS).then_some((rates[0], rise_dps))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}

/// What a channel measures.
struct Kind {
    sensor: &'static str,
    /// Counts per unit.
    scale: f64,
    /// A mean that departs by more than this is motion.
    limit: f64,
    unit: &'static str,
}

impl Kind {
    /// Returns the kind of one of six channels: gyroscopes, then accelerometers.
    fn of(index: usize) -> Self {
        match index {
            0..3 => Self { sensor: "gyro", scale: GYRO_LSB_PER_DPS, limit: RATE_DPS, unit: "deg/s" },
            _ => Self { sensor: "accel", scale: ACCEL_LSB_PER_G, limit: FORCE_G, unit: "g" },
        }
    }
}

/// Mean without the samples that are farther from the median than `far` and have too few such neighbours to be motion.
fn lasting_mean(values: &[i32], far: f64) -> f64 {
    let mut sorted = values.to_vec();
    let middle = sorted.len() / 2;
    let level = if sorted.is_empty() { 0.0 } else { f64::from(*sorted.select_nth_unstable(middle).1) };
    let is_far = |value: &i32| (f64::from(*value) - level).abs() > far;
    let (mut sum, mut count) = (0.0, 0_usize);
    for row in values.chunk_by(|a, b| is_far(a) == is_far(b)) {
        if row.len() >= LASTING || !is_far(&row[0]) {
            sum += row.iter().map(|value| f64::from(*value)).sum::<f64>();
            count += row.len();
        }
    }
    sum / count.max(1) as f64
}

fn channel(sensor: &str, axis: usize) -> String {
    format!("{sensor}_{}", gnc_metrology::AXES[axis % 3])
}

/// Time of each mean rate that shows whether a turn goes on.
const TURN_BLOCK_S: f64 = 0.1;
/// A mean rate above this is a turn. It is far above noise and far below any turn.
const TURNING_DPS: f64 = 2.0;

/// Finds the end of a turn in the samples.
#[derive(Debug)]
pub struct TurnWatch {
    axis: usize,
    bias: f64,
    block: usize,
    next: usize,
    turned: bool,
    still: Option<usize>,
}

impl TurnWatch {
    /// Creates a watch over the turn about an axis; `before` are the samples at rest before the turn.
    #[must_use]
    pub fn new(axis: u8, rate_hz: u16, before: &[ImuSample]) -> Self {
        let axis = usize::from(axis) % 3;
        let bias = mean(before, axis);
        let block = (TURN_BLOCK_S * f64::from(rate_hz)).round().max(1.0) as usize;
        Self { axis, bias, block, next: before.len(), turned: false, still: None }
    }

    /// Returns the index of the first sample at rest after the turn, among all samples so far; `None` if the turn is
    /// not over.
    pub fn look(&mut self, samples: &[ImuSample]) -> Option<usize> {
        while self.still.is_none()
            && let Some(block) = samples.get(self.next..self.next + self.block)
        {
            let turns = (mean(block, self.axis) - self.bias).abs() / GYRO_LSB_PER_DPS > TURNING_DPS;
            if self.turned && !turns {
                self.still = Some(self.next);
            }
            self.turned |= turns;
            self.next += self.block;
        }
        self.still
    }
}

fn mean(samples: &[ImuSample], axis: usize) -> f64 {
    samples.iter().map(|sample| f64::from(sample.gyro[axis])).sum::<f64>() / samples.len().max(1) as f64
}

/// Largest part of a turn's angle by which a gyroscope at its nominal scale may differ. Sensors keep a few percent.
pub const TURN_PART: f64 = 0.1;

/// Returns the angle about an axis from its gyroscope, degrees, at nominal scale. The rate before the turn counts as
/// the bias.
#[must_use]
pub fn turned_deg(samples: &[ImuSample], axis: u8, rate_hz: u16, before: usize) -> f64 {
    let counts = || samples.iter().map(|sample| f64::from(sample.gyro[usize::from(axis) % 3]));
    let before = before.clamp(1, samples.len().max(1));
    let bias = counts().take(before).sum::<f64>() / before as f64;
    counts().map(|count| count - bias).sum::<f64>() / f64::from(rate_hz.max(1)) / GYRO_LSB_PER_DPS
}
