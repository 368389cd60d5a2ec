//! Sums of squared differences of the phase.

use std::thread;

use super::Kind;

/// Phases that fit a core's cache beside their shifted copies: averaging factors up to a quarter of it share one walk.
const TILE: usize = 1 << 15;
const BLOCK: usize = 1024;

/// Integral of the rates less their mean: one value more than rates, the first 0.
///
/// Rounding: within a block of 1024 the sum runs from 0, the blocks' offsets are summed with compensation; so each phase
/// is good to its own rounding instead of to that of all before it.
pub(super) fn integrate(rates: &[f64], dt_s: f64, threads: usize) -> Vec<f64> {
    let mean = crate::stats::mean(rates);
    let mut phase = vec![0.0; rates.len() + 1];
    let local = |rates: &[f64], phase: &mut [f64]| {
        for (rates, phase) in rates.chunks(BLOCK).zip(phase.chunks_mut(BLOCK)) {
            let mut sum = 0.0;
            for (r, p) in rates.iter().zip(phase) {
                sum += (r - mean) * dt_s;
                *p = sum;
            }
        }
    };
    let share = rates.len().div_ceil(threads.max(1)).next_multiple_of(BLOCK);
    thread::scope(|scope| {
        for (rates, phase) in rates.chunks(share).zip(phase[1..].chunks_mut(share)) {
            scope.spawn(move || local(rates, phase));
        }
    });
    // Offsets of the blocks, compensated (Neumaier).
    let (mut sum, mut lost) = (0.0_f64, 0.0_f64);
    let offsets: Vec<f64> = phase[1..]
        .chunks(BLOCK)
        .map(|block| {
            let offset = sum + lost;
            let last = block[block.len() - 1];
            let next = sum + last;
            lost += if sum.abs() >= last.abs() { (sum - next) + last } else { (last - next) + sum };
            sum = next;
            offset
        })
        .collect();
    let shift = |phase: &mut [f64], offsets: &[f64]| {
        for (block, offset) in phase.chunks_mut(BLOCK).zip(offsets) {
            block.iter_mut().for_each(|p| *p += offset);
        }
    };
    thread::scope(|scope| {
        for (phase, offsets) in phase[1..].chunks_mut(share).zip(offsets.chunks(share / BLOCK)) {
            scope.spawn(move || shift(phase, offsets));
        }
    });
    phase
}

/// Number of differences at an averaging factor.
pub(super) fn count(phases: usize, m: usize, kind: Kind) -> usize {
    let span = |order: usize| order.checked_mul(m).map_or(0, |s| phases.saturating_sub(s));
    match kind {
        Kind::Adev => span(2).div_ceil(m),
        Kind::Oadev => span(2),
        Kind::Hdev => span(3).div_ceil(m),
        Kind::Ohdev => span(3),
        Kind::Mdev => (phases + 1).saturating_sub(3 * m),
        // Reflected data reach twice the record; beyond half of it nothing new is seen.
        Kind::Totdev => {
            if m < phases / 2 {
                phases - 2
            } else {
                0
            }
        }
    }
}

/// For each averaging factor the variance times tau^2, and the number of differences in it.
pub(super) fn mean_squares(phase: &[f64], factors: &[usize], kind: Kind, threads: usize) -> Vec<(f64, usize)> {
    let sums = match kind {
        Kind::Oadev => overlapping::<2>(phase, factors, threads),
        Kind::Ohdev => overlapping::<3>(phase, factors, threads),
        _ => spread(factors, threads, |m| match kind {
            Kind::Adev => (0..count(phase.len(), m, kind)).map(|i| difference::<2>(phase, i * m, m).powi(2)).sum(),
            Kind::Hdev => (0..count(phase.len(), m, kind)).map(|i| difference::<3>(phase, i * m, m).powi(2)).sum(),
            Kind::Mdev => modified(phase, m),
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

/// Difference of order 2 or 3 with stride m.
fn difference<const ORDER: usize>(x: &[f64], i: usize, m: usize) -> f64 {
    if ORDER == 2 {
        (x[i + 2 * m] - x[i + m]) - (x[i + m] - x[i])
    } else {
        (x[i + 3 * m] - x[i]) - 3.0 * (x[i + 2 * m] - x[i + m])
    }
}

/// Runs `work` for each factor, the factors dealt to the threads in turn.
fn spread(factors: &[usize], threads: usize, work: impl Fn(usize) -> f64 + Sync) -> Vec<f64> {
    let threads = threads.clamp(1, factors.len().max(1));
    let mut sums = vec![0.0; factors.len()];
    let work = &work;
    thread::scope(|scope| {
        let mut lanes: Vec<Vec<(usize, &mut f64)>> = (0..threads).map(|_| Vec::new()).collect();
        for (k, (m, sum)) in factors.iter().zip(&mut sums).enumerate() {
            lanes[k % threads].push((*m, sum));
        }
        for lane in lanes {
            scope.spawn(move || lane.into_iter().for_each(|(m, sum)| *sum = work(m)));
        }
    });
    sums
}

/// All overlapping differences. The start points are cut into tiles that stay in the cache while every factor walks over
/// them; each thread takes a stretch of tiles.
fn overlapping<const ORDER: usize>(phase: &[f64], factors: &[usize], threads: usize) -> Vec<f64> {
    let share = phase.len().div_ceil(threads.max(1)).next_multiple_of(TILE);
    let stretches: Vec<(usize, usize)> =
        (0..phase.len()).step_by(share).map(|s| (s, (s + share).min(phase.len()))).collect();
    let sums = |(from, to): (usize, usize)| {
        let mut sums = vec![0.0; factors.len()];
        for start in (from..to).step_by(TILE) {
            for (sum, &m) in sums.iter_mut().zip(factors) {
                let end = (start + TILE).min(to).min(phase.len().saturating_sub(ORDER * m));
                if start < end {
                    *sum += tile::<ORDER>(&phase[start..], end - start, m);
                }
            }
        }
        sums
    };
    let mut total = vec![0.0; factors.len()];
    thread::scope(|scope| {
        let handles: Vec<_> = stretches.into_iter().map(|stretch| scope.spawn(move || sums(stretch))).collect();
        for handle in handles {
            match handle.join() {
                Ok(part) => total.iter_mut().zip(part).for_each(|(t, p)| *t += p),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
    });
    total
}

/// Sum of squared differences that start at the first `n` phases, in eight lanes so that the compiler can use vectors.
fn tile<const ORDER: usize>(x: &[f64], n: usize, m: usize) -> f64 {
    const LANES: usize = 8;
    let (a, b, c) = (&x[..n], &x[m..m + n], &x[2 * m..2 * m + n]);
    let d = if ORDER == 3 { &x[3 * m..3 * m + n] } else { a };
    let mut sums = [0.0; LANES];
    let whole = n - n % LANES;
    let (a, b) = (a.as_chunks::<LANES>().0, b.as_chunks::<LANES>().0);
    let (c, d) = (c.as_chunks::<LANES>().0, d.as_chunks::<LANES>().0);
    for (((a, b), c), d) in a.iter().zip(b).zip(c).zip(d) {
        for k in 0..LANES {
            let v = if ORDER == 2 { (c[k] - b[k]) - (b[k] - a[k]) } else { (d[k] - a[k]) - 3.0 * (c[k] - b[k]) };
            sums[k] += v * v;
        }
    }
    let rest: f64 = (whole..n).map(|i| difference::<ORDER>(x, i, m).powi(2)).sum();
    sums.iter().sum::<f64>() + rest
}

/// Modified: squares of the mean of m neighbouring differences. The moving sum starts afresh now and then, so that its
/// rounding does not grow with the record.
fn modified(x: &[f64], m: usize) -> f64 {
    let n = count(x.len(), m, Kind::Mdev);
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
