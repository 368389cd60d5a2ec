//! The clock of a record: its rate, jitter and gaps, from a stamp for each sample.
//!
//! All stamps are compared with a grid of equal steps, not each stamp with the one before:
//! - *Jitter* takes a stamp off the grid and the next ones are back on it. A *gap* moves all later stamps: the level of
//!   the residuals is higher after it than before it. A *change of rate* bends them.
//! - Samples that share a stamp (packets, stamps in whole milliseconds) count as one point: the last sample of them.
//! - The rate follows from the levels at the first and at the last stamps of a block. Its uncertainty follows from the
//!   scatter of the stamps, the resolution in which they are written included.
//!
//! Time runs on only within a block; it may jump by any amount between blocks.

use std::ops::Range;

use crate::{Refusal, stats};

/// A step may be a gap if it exceeds the grid's step by more than this part of a step: jitter of half a step is normal,
/// a lost sample is not.
const GAP_STEPS: f64 = 0.6;
/// Stamps closer than this part of a step belong to one packet.
const PACKET_STEP: f64 = 0.125;
/// Points of a level, at least.
const LEVEL: usize = 8;
/// Standard deviations of a level that a gap must exceed.
const GAP_SIGMA: f64 = 5.0;
/// Standard uncertainties by which two rates must differ to count as a change of the rate. (So many because the place
/// was searched for.)
const CHANGE_SIGMA: f64 = 6.0;
/// Standard uncertainties that are added to the tolerance of a stated rate.
const RATE_SIGMA: f64 = 3.0;
/// Change of the rate within a record up to which a record without a stated rate is not refused (relative).
const CHANGE_TOLERANCE: f64 = 1e-3;
/// Jitter, as a part of a step, from which on stamps may stand in the wrong order.
const ROUGH: f64 = 0.1;
/// Scatter of a median over that of a mean.
const MEDIAN: f64 = 1.2533;

/// A rate that was stated, and its tolerance (relative).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stated {
    /// Rate, Hz.
    pub rate_hz: f64,
    /// Tolerance, relative; three standard uncertainties of the measured rate are added to it.
    pub tolerance: f64,
}

/// The result of the check of the stamps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockRate {
    /// Rate from first to last stamp of each block, Hz.
    pub rate_hz: f64,
    /// Standard uncertainty from the scatter of the stamps, Hz.
    pub rate_u_hz: f64,
    /// Standard deviation of a stamp from the grid, s.
    pub jitter_s: f64,
    /// Samples that share a stamp, on average.
    pub samples_per_stamp: f64,
    /// Blocks that were long enough to be looked at.
    pub blocks: usize,
}

/// The rate of the stamps (s, one for each sample) over the blocks in which time runs on. `None` where no block has
/// three stamps.
///
/// # Errors
/// [`Refusal::NotFinite`], [`Refusal::NotMonotonic`], [`Refusal::Gap`], [`Refusal::Jittery`], [`Refusal::RateChanges`],
/// [`Refusal::RateMismatch`]: the first of them in the order of the record.
pub fn check(stamps_s: &[f64], blocks: &[Range<usize>], stated: Option<Stated>) -> Result<Option<ClockRate>, Refusal> {
    let change = stated.map_or(CHANGE_TOLERANCE, |s| s.tolerance);
    let mut paces: Vec<Pace> = Vec::new();
    for block in blocks {
        let Some(stamps) = stamps_s.get(block.clone()) else { continue };
        let Some(pace) = Pace::of(stamps, block.start, change)? else { continue };
        if let Some(before) = paces.last() {
            let (before_hz, after_hz) = (before.rate_hz(), pace.rate_hz());
            let u = before.relative_u().hypot(pace.relative_u());
            if (after_hz / before_hz - 1.0).abs() > change + CHANGE_SIGMA * u {
                return Err(Refusal::RateChanges { row: block.start + 1, before_hz, after_hz });
            }
        }
        paces.push(pace);
    }
    let Some(rate) = ClockRate::of(&paces) else { return Ok(None) };
    match stated {
        Some(Stated { rate_hz: stated_hz, tolerance })
            if (rate.rate_hz / stated_hz - 1.0).abs() > tolerance + RATE_SIGMA * rate.rate_u_hz / rate.rate_hz =>
        {
            Err(Refusal::RateMismatch { measured_hz: rate.rate_hz, u_hz: rate.rate_u_hz, stated_hz, tolerance })
        }
        _ => Ok(Some(rate)),
    }
}

/// The usual time from sample to sample, in the unit of the stamps; `None` below three stamps or where time stands
/// still.
#[must_use]
pub fn usual_step(stamps: &[f64]) -> Option<f64> {
    let steps = lagged(stamps.len(), 4096, |a, b| (stamps[b] - stamps[a]) / (b - a) as f64);
    (stamps.len() > 2 && steps > 0.0).then_some(steps)
}

/// Median of a difference quotient over an eighth of a record, at most over `longest` samples. Few gaps do not move it,
/// and jitter is divided by the length.
fn lagged(n: usize, longest: usize, quotient: impl Fn(usize, usize) -> f64) -> f64 {
    let lag = (n / 8).clamp(1, longest);
    let stride = (n.saturating_sub(lag) / 4096).max(1);
    let mut steps: Vec<f64> = (0..n.saturating_sub(lag)).step_by(stride).map(|i| quotient(i, i + lag)).collect();
    stats::median(&mut steps)
}

/// The pace of one block.
struct Pace {
    /// Samples between the first and the last level.
    samples: f64,
    /// Time between them, s.
    span_s: f64,
    /// Standard uncertainty of that time, s.
    span_u_s: f64,
    jitter_s: f64,
    /// Number of all samples and of all points.
    counts: (usize, usize),
}

impl ClockRate {
    fn of(paces: &[Pace]) -> Option<Self> {
        let sum = |term: &dyn Fn(&Pace) -> f64| paces.iter().map(term).sum::<f64>();
        let (samples, span_s) = (sum(&|p| p.samples), sum(&|p| p.span_s));
        let u = sum(&|p| p.span_u_s * p.span_u_s).sqrt() / span_s;
        let jitter = sum(&|p| p.jitter_s * p.jitter_s * p.counts.1 as f64) / sum(&|p| p.counts.1 as f64);
        (!paces.is_empty()).then(|| Self {
            rate_hz: samples / span_s,
            rate_u_hz: u * samples / span_s,
            jitter_s: jitter.sqrt(),
            samples_per_stamp: sum(&|p| p.counts.0 as f64) / sum(&|p| p.counts.1 as f64),
            blocks: paces.len(),
        })
    }
}

impl Pace {
    fn rate_hz(&self) -> f64 {
        self.samples / self.span_s
    }

    fn relative_u(&self) -> f64 {
        self.span_u_s / self.span_s
    }

    /// `first` is the row of the record at which the block begins, from 0.
    fn of(stamps: &[f64], first: usize, change: f64) -> Result<Option<Self>, Refusal> {
        if let Some(at) = stamps.iter().position(|t| !t.is_finite()) {
            return Err(Refusal::NotFinite { channel: "time".to_owned(), index: first + at, value: stamps[at] });
        }
        let backwards = |i: usize| Refusal::NotMonotonic { index: first + i, before: stamps[i - 1], after: stamps[i] };
        let rough = usual_step(stamps).unwrap_or(0.0);
        if rough <= 0.0 || stamps.len() < 3 {
            let stands = (1..stamps.len()).find(|&i| stamps[i] <= stamps[i - 1]);
            return stands.map_or(Ok(None), |i| Err(backwards(i)));
        }
        let grid = Grid::of(stamps, rough, first);
        grid.order().map_err(backwards)?;
        grid.gaps()?;
        grid.pace(change).map(Some)
    }
}

/// Points of a block against a grid of equal steps.
struct Grid<'a> {
    first: usize,
    stamps: &'a [f64],
    /// Samples before the point, within the block.
    samples: Vec<f64>,
    /// Stamp less the grid's time, s.
    residuals: Vec<f64>,
    step_s: f64,
    /// Standard deviation of a stamp from the grid, from the stamps themselves, s.
    jitter_s: f64,
    /// Step in which stamps are written, s.
    resolution_s: f64,
    /// The same step where the grid's step is not a multiple of it, so that rounding moves stamps to and fro; else 0.
    rounding_s: f64,
    /// Points of a level.
    level: usize,
}

impl<'a> Grid<'a> {
    fn of(stamps: &'a [f64], rough_s: f64, first: usize) -> Self {
        let (samples, times) = points(stamps, rough_s);
        let step_s = if samples.len() < 3 {
            rough_s
        } else {
            lagged(samples.len(), 512, |a, b| (times[b] - times[a]) / (samples[b] - samples[a]))
        };
        let residuals: Vec<f64> =
            samples.iter().zip(&times).map(|(k, t)| (t - times[0]) - step_s * (k - samples[0])).collect();
        let resolution_s = resolution(stamps);
        let stride = (residuals.len() / 65_536).max(1);
        let mut bends: Vec<f64> =
            residuals.windows(3).step_by(stride).map(|r| (r[2] - 2.0 * r[1] + r[0]).abs()).collect();
        let jitter_s = if bends.len() < LEVEL { 0.0 } else { 1.4826 * stats::median(&mut bends) / 6.0_f64.sqrt() };
        // Rounded stamps drift off the grid and jump back in a cycle of this many samples.
        let off = (step_s / resolution_s - (step_s / resolution_s).round()).abs();
        let lag = (stamps.len() / 8).max(1) as f64;
        let cycle = (resolution_s > 0.05 * step_s && off * lag > 0.5).then(|| 1.0 / off);
        // With this many points the difference of two levels scatters by a tenth of a step.
        let wanted = (20.0 * jitter_s / step_s).powi(2).ceil().max(4.0 * cycle.unwrap_or(0.0));
        let level = (wanted.min(1e9) as usize).max(LEVEL);
        let rounding_s = cycle.map_or(0.0, |_| resolution_s);
        Self { first, stamps, samples, residuals, step_s, jitter_s, resolution_s, rounding_s, level }
    }

    /// Checks that time stands or goes back only where the jitter explains it.
    fn order(&self) -> Result<(), usize> {
        let stamps = self.stamps;
        let packets = stamps.len() >= 2 * LEVEL && stamps.len() as f64 > 1.1 * self.samples.len() as f64;
        let rough = self.jitter_s > ROUGH * self.step_s || self.rounding_s > ROUGH * self.step_s;
        let back_s = if rough { 6.0 * self.jitter_s } else { 0.0 };
        let wrong = |step_s: f64| step_s < -back_s || (step_s == 0.0 && !packets && !rough);
        let found = stamps.windows(2).position(|w| w[1] <= w[0] && wrong(w[1] - w[0]));
        found.map_or(Ok(()), |i| Err(i + 1))
    }

    /// Median of the residuals of some points and the middle of their places.
    fn at(&self, points: Range<usize>) -> Option<(f64, f64, usize)> {
        let count = points.len();
        let place = stats::mean(self.samples.get(points.clone())?);
        (count > 0).then(|| (stats::median(&mut self.residuals[points].to_vec()), place, count))
    }

    /// Step of the level between a point and the one before, and its standard deviation from the jitter.
    fn jump(&self, point: usize) -> Option<(f64, f64)> {
        let (n, w) = (self.samples.len(), self.level.min(self.samples.len()));
        let range = |from: usize, to: usize| from.min(n)..to.min(n);
        let after = self.at(range(point, point + w))?;
        let before = self.at(range(point.saturating_sub(w), point))?;
        // Where the rate changes, the levels differ by the slopes on both sides, and no sample is missing.
        let slope = |beyond: Option<(f64, f64, usize)>, level: (f64, f64, usize)| {
            let beyond = beyond.filter(|b| b.2 == w && level.2 == w)?;
            let slope = (beyond.0 - level.0) / (beyond.1 - level.1);
            Some(if slope.abs() * w as f64 > 2.0 * self.step_s { slope } else { 0.0 })
        };
        let ahead = slope(self.at(range(point.saturating_sub(2 * w), point.saturating_sub(w))), before);
        let behind = slope(self.at(range(point + w, point + 2 * w)), after);
        let steep = match (ahead, behind) {
            (Some(a), Some(b)) => f64::midpoint(a, b),
            (a, b) => a.or(b).unwrap_or(0.0),
        };
        let jump = after.0 - before.0 - steep * (after.1 - before.1);
        let sd = MEDIAN * self.jitter_s * (1.0 / after.2 as f64 + 1.0 / before.2 as f64).sqrt();
        Some((jump, sd))
    }

    /// Checks that no level rises by most of a step.
    fn gaps(&self) -> Result<(), Refusal> {
        let n = self.samples.len();
        // Rounding may move a level by half its step, and levels shorter than its cycle by a whole step.
        let moved_s = if self.level > n / 4 { self.rounding_s } else { 0.5 * self.rounding_s };
        let least_s = GAP_STEPS * self.step_s + moved_s;
        let fine = self.jitter_s < 0.05 * self.step_s && self.rounding_s < 0.05 * self.step_s;
        let seen_s = least_s + 4.0 * self.jitter_s + self.rounding_s;
        if !fine && self.level > n / 4 && GAP_SIGMA * MEDIAN * self.jitter_s * (8.0 / n as f64).sqrt() > self.step_s {
            return Err(Refusal::Jittery { jitter_s: self.jitter_s, step_s: self.step_s, samples: n });
        }
        let step = |j: usize| self.residuals[j] - self.residuals[j - 1];
        let regular = self.regular_loss();
        // Long steps all around a place mean another rate, not a gap.
        let stands_out = |j: usize, near: Range<usize>| {
            let mut about: Vec<f64> = near.map(step).collect();
            step(j) - stats::median(&mut about) > 0.5 * least_s
        };
        for j in 1..n {
            let visible = step(j) > seen_s;
            // Jitter may hide a lost sample in two steps that are both not long. So a record with jitter is searched at
            // all places.
            if !(visible || (!fine && j % (self.level / 2) == 0)) {
                continue;
            }
            let Some((jump, sd)) = self.jump(j) else { continue };
            if jump > least_s.max(GAP_SIGMA * sd) || (visible && regular) {
                let near = j.saturating_sub(self.level).max(1)..(j + self.level).min(n);
                let worst =
                    if visible { j } else { near.clone().max_by(|a, b| step(*a).total_cmp(&step(*b))).unwrap_or(j) };
                if !stands_out(worst, near) {
                    continue;
                }
                let samples = self.samples[worst] - self.samples[worst - 1];
                return Err(Refusal::Gap {
                    index: self.first + self.samples[worst - 1] as usize + 1,
                    step_s: step(worst) + samples * self.step_s,
                    expected_s: samples * self.step_s,
                });
            }
        }
        Ok(())
    }

    /// Whether fine stamps, one for each sample, mostly have a step other than the mean one: samples are missing all
    /// along.
    fn regular_loss(&self) -> bool {
        let n = self.samples.len();
        let each = n > 2 && self.samples[n - 1] - self.samples[0] == (n - 1) as f64;
        let mut steps: Vec<f64> = self.residuals.windows(2).map(|r| r[1] - r[0] + self.step_s).collect();
        if !each || self.resolution_s > 0.2 * self.step_s || steps.len() < 2 * LEVEL {
            return false;
        }
        let usual = stats::median(&mut steps);
        let mut apart: Vec<f64> = steps.iter().map(|s| (s - usual).abs()).collect();
        stats::median(&mut apart) < 0.05 * self.step_s && (usual / self.step_s - 1.0).abs() > 0.03
    }

    /// The rate between the outermost levels, if it is the same all along.
    fn pace(&self, change: f64) -> Result<Pace, Refusal> {
        let n = self.samples.len();
        let w = if n >= 4 * self.level { self.level } else { (n / 4).max(1) };
        let levels: Vec<(f64, f64)> =
            (0..n / w).filter_map(|b| self.at(b * w..(b + 1) * w)).map(|(level, place, _)| (place, level)).collect();
        // The tail has its own level, since short records would lose their end otherwise.
        let last = self.at(n - w..n).map(|(level, place, _)| (place, level));
        let (Some(&start), Some(end)) = (levels.first(), last) else {
            return Err(Refusal::TooFew { what: "clock".to_owned(), got: n, needed: 2 });
        };
        // Levels average the scatter, but not the error that rounding to a multiple of the step hides.
        let scatter = if w < 3 { 1.0 } else { MEDIAN / (w as f64).sqrt() } * self.jitter_s;
        let u = scatter.hypot(self.resolution_s / 12.0_f64.sqrt()) * std::f64::consts::SQRT_2;
        let slope = |a: (f64, f64), b: (f64, f64)| (b.1 - a.1) / (b.0 - a.0);
        let off = |p: &(f64, f64)| (p.1 - start.1 - slope(start, end) * (p.0 - start.0)).abs();
        if let Some(bend) = levels.iter().skip(1).filter(|p| p.0 < end.0).max_by(|a, b| off(a).total_cmp(&off(b))) {
            let (before_s, after_s) = (self.step_s + slope(start, *bend), self.step_s + slope(*bend, end));
            let u_relative = (u / (bend.0 - start.0)).hypot(u / (end.0 - bend.0)) / self.step_s;
            if (before_s / after_s - 1.0).abs() > change + CHANGE_SIGMA * u_relative {
                let (row, [before_hz, after_hz]) = self.bend(bend.0, 2 * w);
                return Err(Refusal::RateChanges { row: self.first + row + 1, before_hz, after_hz });
            }
        }
        let samples = end.0 - start.0;
        Ok(Pace {
            samples,
            span_s: samples * self.step_s + (end.1 - start.1),
            span_u_s: u,
            jitter_s: self.jitter_s,
            counts: (self.stamps.len(), n),
        })
    }

    /// The sample near a place at which the stamps are farthest off the line from first to last, and the rates before and
    /// after it.
    fn bend(&self, place: f64, reach: usize) -> (usize, [f64; 2]) {
        let last = self.stamps.len() - 1;
        let span = |a: usize, b: usize| self.stamps[b] - self.stamps[a];
        let off = |i: usize| (span(0, i) - span(0, last) * i as f64 / last as f64).abs();
        let packet = last.div_ceil(self.samples.len());
        let reach = reach * packet + packet;
        let near = (place as usize).saturating_sub(reach).max(1)..(place as usize + reach).min(last);
        let row = near.max_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or(1);
        (row, [row as f64 / span(0, row), (last - row) as f64 / span(row, last)])
    }
}

/// The last sample of each stamp, and the stamp.
fn points(stamps: &[f64], step_s: f64) -> (Vec<f64>, Vec<f64>) {
    let (mut samples, mut times) = (Vec::with_capacity(stamps.len()), Vec::with_capacity(stamps.len()));
    let mut start = f64::NEG_INFINITY;
    for (i, t) in stamps.iter().enumerate() {
        let joins = i > 0 && t - stamps[i - 1] < PACKET_STEP * step_s && t - start < 0.5 * step_s;
        if joins {
            samples.pop();
            times.pop();
        } else {
            start = *t;
        }
        samples.push(i as f64);
        times.push(*t);
    }
    (samples, times)
}

/// The step in which stamps are written: the largest power of ten down to 1 ns such that all stamps are multiples of
/// it, else the step of the numbers themselves.
fn resolution(stamps: &[f64]) -> f64 {
    let largest = stamps.first().zip(stamps.last()).map_or(0.0, |(a, b)| a.abs().max(b.abs()));
    let float = largest * f64::EPSILON;
    let ends = || stamps.iter().take(500).chain(stamps.iter().rev().take(500));
    let coarse = (0..=9).map(|d| 10.0_f64.powi(d)).find(|scale| {
        let slack = 1e-4 + float * scale;
        slack < 0.1 && ends().all(|t| (t * scale - (t * scale).round()).abs() < slack)
    });
    coarse.map_or(float, |scale| 1.0 / scale)
}

#[cfg(test)]
mod tests;
