//! Sums of squared differences of the phase.

use super::DeviationKind;
use super::overlapping::{self, difference};
use super::parallel::{on_threads, spread};
use crate::stats;

const BLOCK: usize = 1024;

/// Mean of the values, on several threads. The first value is removed before the sum. Not finite where a value is not.
pub(super) fn mean(values: &[f64], threads: usize) -> f64 {
    let Some(&first) = values.first() else { return f64::NAN };
    let parts = on_threads(values.chunks(share(values.len(), threads)), |part| stats::sum(part, |v| v - first));
    first + parts.into_iter().sum::<f64>() / values.len() as f64
}

/// Integral of the rates less their mean: one value more than rates, the first 0.
///
/// Rounding: within a block of 1024 the sum runs from 0, and the offsets of the blocks are summed with compensation. So
/// each phase carries only its own rounding, not that of all phases before it.
pub(super) fn integrate(rates: &[f64], mean: f64, dt_s: f64, threads: usize) -> Vec<f64> {
    let mut phase = vec![0.0; rates.len() + 1];
    let share = share(rates.len(), threads);
    // The start of each thread's stretch is known before the stretch is summed, so that every phase is written once.
    let ends = on_threads(rates.chunks(share), |part| {
        let mut end = Compensated::default();
        part.chunks(BLOCK).for_each(|block| end.add(stats::sum(block, |r| (r - mean) * dt_s)));
        end
    });
    let mut start = Compensated::default();
    let stretches = rates.chunks(share).zip(phase[1..].chunks_mut(share)).zip(ends).map(|(stretch, end)| {
        let at = start;
        start.add(end.sum);
        start.add(end.lost);
        (stretch, at)
    });
    on_threads(stretches, |((rates, phase), mut offset)| {
        for (rates, phase) in rates.chunks(BLOCK).zip(phase.chunks_mut(BLOCK)) {
            let (mut sum, from) = (0.0, offset.value());
            for (r, p) in rates.iter().zip(phase) {
                sum += (r - mean) * dt_s;
                *p = from + sum;
            }
            offset.add(sum);
        }
    });
    phase
}

/// Samples of a thread's stretch: whole blocks.
fn share(samples: usize, threads: usize) -> usize {
    samples.div_ceil(threads.max(1)).next_multiple_of(BLOCK)
}

/// Neumaier's compensated sum.
#[derive(Debug, Clone, Copy, Default)]
struct Compensated {
    sum: f64,
    lost: f64,
}

impl Compensated {
    fn add(&mut self, value: f64) {
        let next = self.sum + value;
        self.lost += if self.sum.abs() >= value.abs() { (self.sum - next) + value } else { (value - next) + self.sum };
        self.sum = next;
    }

    fn value(self) -> f64 {
        self.sum + self.lost
    }
}

/// Number of differences at an averaging factor.
pub(super) fn count(phases: usize, m: usize, kind: DeviationKind) -> usize {
    let span = |order: usize| order.checked_mul(m).map_or(0, |s| phases.saturating_sub(s));
    match kind {
        DeviationKind::Adev => span(2).div_ceil(m),
        DeviationKind::Oadev => span(2),
        DeviationKind::Hdev => span(3).div_ceil(m),
        DeviationKind::Ohdev => span(3),
        DeviationKind::Mdev => (phases + 1).saturating_sub(3 * m),
        // Reflected data reach twice the record; beyond half of it nothing new is seen.
        DeviationKind::Totdev => {
            if m < phases / 2 {
                phases - 2
            } else {
                0
            }
        }
    }
}

/// The variance times tau^2 for each averaging factor, and the number of differences in it.
pub(super) fn mean_squares(phase: &[f64], factors: &[usize], kind: DeviationKind, threads: usize) -> Vec<(f64, usize)> {
    let sums = match kind {
        DeviationKind::Oadev => overlapping::sums::<2>(phase, factors, threads),
        DeviationKind::Ohdev => overlapping::sums::<3>(phase, factors, threads),
        _ => spread(factors, threads, |m| match kind {
            DeviationKind::Adev => {
                (0..count(phase.len(), m, kind)).map(|i| difference::<2>(phase, i * m, m).powi(2)).sum()
            }
            DeviationKind::Hdev => {
                (0..count(phase.len(), m, kind)).map(|i| difference::<3>(phase, i * m, m).powi(2)).sum()
            }
            DeviationKind::Mdev => modified(phase, m),
            _ => total(phase, m),
        }),
    };
    let norm = if kind.order() == 3 { 6.0 } else { 2.0 };
    let scaled = |(&m, sum): (&usize, f64)| {
        let n = count(phase.len(), m, kind);
        (sum / (norm * n as f64), n)
    };
    factors.iter().zip(sums).map(scaled).collect()
}

/// Modified: squares of the mean of m neighbouring differences. The moving sum starts afresh now and then, so that its
/// rounding does not grow with the record.
fn modified(x: &[f64], m: usize) -> f64 {
    let n = count(x.len(), m, DeviationKind::Mdev);
    let fresh = m.max(4096);
    let mut squares = 0.0;
    let mut j = 0;
    while j < n {
        let mut sum: f64 = (j..j + m).map(|i| difference::<2>(x, i, m)).sum();
        let stop = (j + fresh).min(n);
        squares += sum * sum;
        for k in j + 1..stop {
            sum += difference::<2>(x, k + m - 1, m) - difference::<2>(x, k - 1, m);
            squares += sum * sum;
        }
        j = stop;
    }
    squares / (m as f64 * m as f64)
}

/// Total: the record continued at both ends by its own image, reversed and reflected (SP 1065, equation 25).
fn total(x: &[f64], m: usize) -> f64 {
    let last = x.len() - 1;
    let before = |i: usize| if m <= i { x[i - m] } else { 2.0 * x[0] - x[m - i] };
    let after = |i: usize| if i + m <= last { x[i + m] } else { 2.0 * x[last] - x[2 * last - i - m] };
    (1..last).map(|i| (after(i) - x[i]) - (x[i] - before(i))).map(|v| v * v).sum()
}
