//! Sums over all overlapping differences of the phase: most of the work of a long record.
//!
//! Averaging factors that double are worked on together, since the middle of one difference is the end of another: four
//! factors together need six phases, and twelve one by one. Short factors walk along the record in tiles that stay in
//! the cache. Long factors walk across the record: they take all start points that are a multiple of the shortest
//! factor apart one after the other, so that the few stretches of the record that these share stay in the cache too.

use wide::f64x4;

use super::parallel::on_threads;

/// Start points of a tile. A tile and the phases of the short factors behind it fit a core's nearest cache.
const TILE: usize = 2048;
/// From this averaging factor on the code walks across the record: the shifted phases no longer lie in a core's cache.
const LONG: usize = 1 << 14;
/// Phases of all stretches that are in use at a time when walking across: half a megabyte.
const ACROSS: usize = 1 << 16;
/// Factors worked on together.
const CHAIN: usize = 4;
const LANES: usize = 4;

/// Averaging factors `m, 2 m, 4 m, ...` and their places among the factors asked for.
struct Chain {
    first: usize,
    m: usize,
    length: usize,
}

/// Part of the work of a thread: start points of a tile, or residues of the shortest factor.
type Part = std::ops::Range<usize>;

/// Sum of the squared differences of order 2 or 3 at each factor (rising).
pub(super) fn sums<const ORDER: usize>(phase: &[f64], factors: &[usize], threads: usize) -> Vec<f64> {
    let chains = chains::<ORDER>(factors);
    let (long, short): (Vec<&Chain>, Vec<&Chain>) = chains.iter().partition(|c| c.m >= LONG);
    let parts = on_threads(0..threads.max(1), |thread| {
        let mut sums = vec![0.0; factors.len()];
        for start in part(phase.len(), thread, threads, TILE).step_by(TILE) {
            for chain in &short {
                chain.add::<ORDER>(phase, start..(start + TILE).min(phase.len()), &mut sums);
            }
        }
        for chain in &long {
            let stretches = phase.len().div_ceil(chain.m);
            let width = (ACROSS / stretches).max(LANES);
            let residues = part(chain.m, thread, threads, width);
            for from in residues.clone().step_by(width) {
                let to = (from + width).min(residues.end);
                for start in (0..phase.len()).step_by(chain.m) {
                    chain.add::<ORDER>(phase, start + from..start + to, &mut sums);
                }
            }
        }
        sums
    });
    (0..factors.len()).map(|k| parts.iter().map(|part| part[k]).sum()).collect()
}

/// A thread's share of `0..total`, in whole tiles.
fn part(total: usize, thread: usize, threads: usize, tile: usize) -> Part {
    let share = total.div_ceil(threads.max(1)).next_multiple_of(tile);
    (thread * share).min(total)..((thread + 1) * share).min(total)
}

fn chains<const ORDER: usize>(factors: &[usize]) -> Vec<Chain> {
    let mut chains: Vec<Chain> = Vec::new();
    for (k, &m) in factors.iter().enumerate() {
        match chains.last_mut() {
            // A third difference has fewer phases in common with the difference at twice its factor.
            Some(chain) if ORDER == 2 && chain.length < CHAIN && m == chain.m << chain.length => chain.length += 1,
            _ => chains.push(Chain { first: k, m, length: 1 }),
        }
    }
    chains
}

impl Chain {
    /// Adds the differences that start in `starts` to the sums of the factors.
    fn add<const ORDER: usize>(&self, phase: &[f64], starts: Part, sums: &mut [f64]) {
        let sums = &mut sums[self.first..self.first + self.length];
        if ORDER == 3 {
            sums[0] += third(phase, clipped(phase, &starts, 3 * self.m), self.m);
            return;
        }
        // First the starts that all factors have in common, then those that only the shorter factors reach.
        let common = clipped(phase, &starts, 2 * (self.m << (self.length - 1)));
        match self.length {
            1 => second::<1>(phase, &common, self.m, sums),
            2 => second::<2>(phase, &common, self.m, sums),
            3 => second::<3>(phase, &common, self.m, sums),
            _ => second::<CHAIN>(phase, &common, self.m, sums),
        }
        for (k, sum) in sums.iter_mut().enumerate() {
            let m = self.m << k;
            second::<1>(phase, &(common.end..clipped(phase, &starts, 2 * m).end), m, std::slice::from_mut(sum));
        }
    }
}

/// Start points whose difference of this span still lies in the record.
fn clipped(phase: &[f64], starts: &Part, span: usize) -> Part {
    starts.start..starts.end.min(phase.len().saturating_sub(span)).max(starts.start)
}

/// Second differences at `m, 2 m, 4 m, ...`, K factors. The sums are written out, since only then they stay in
/// registers.
fn second<const K: usize>(x: &[f64], starts: &Part, m: usize, sums: &mut [f64]) {
    let n = starts.len();
    if n == 0 {
        return;
    }
    let at = |shift: usize| x[starts.start + shift..starts.end + shift].as_chunks::<LANES>().0;
    // A shorter chain leaves the last phases unused. They are read at shift 0.
    let [a, b, c, d, e, f]: [&[[f64; LANES]]; CHAIN + 2] =
        std::array::from_fn(|k| if k <= K + 1 { at(if k == 0 { 0 } else { m << (k - 1) }) } else { at(0) });
    let [mut one, mut two, mut three, mut four] = [f64x4::ZERO; CHAIN];
    for (((((a, b), c), d), e), f) in a.iter().zip(b).zip(c).zip(d).zip(e).zip(f) {
        let (a, b, c) = (f64x4::new(*a), f64x4::new(*b), f64x4::new(*c));
        one += square(a, b, c);
        if K > 1 {
            let d = f64x4::new(*d);
            two += square(a, c, d);
            if K > 2 {
                let e = f64x4::new(*e);
                three += square(a, d, e);
                if K > 3 {
                    four += square(a, e, f64x4::new(*f));
                }
            }
        }
    }
    for (k, (sum, lanes)) in sums.iter_mut().zip([one, two, three, four]).enumerate() {
        let rest = starts.end - n % LANES..starts.end;
        *sum += lanes.reduce_add() + rest.map(|i| difference::<2>(x, i, m << k).powi(2)).sum::<f64>();
    }
}

#[inline(always)]
fn square(a: f64x4, b: f64x4, c: f64x4) -> f64x4 {
    let v = (c - b) - (b - a);
    v * v
}

/// Third differences.
fn third(x: &[f64], starts: Part, m: usize) -> f64 {
    let n = starts.len();
    let [a, b, c, d]: [&[[f64; LANES]]; 4] =
        std::array::from_fn(
            |k| if n == 0 { &[][..] } else { x[starts.start + k * m..starts.end + k * m].as_chunks().0 },
        );
    let mut lanes = [0.0; LANES];
    for (((a, b), c), d) in a.iter().zip(b).zip(c).zip(d) {
        for l in 0..LANES {
            let v = (d[l] - a[l]) - 3.0 * (c[l] - b[l]);
            lanes[l] += v * v;
        }
    }
    let rest = starts.end - n % LANES..starts.end;
    lanes.iter().sum::<f64>() + rest.map(|i| difference::<3>(x, i, m).powi(2)).sum::<f64>()
}

/// Difference of order 2 or 3 with stride m.
pub(super) fn difference<const ORDER: usize>(x: &[f64], i: usize, m: usize) -> f64 {
    if ORDER == 2 {
        (x[i + 2 * m] - x[i + m]) - (x[i + m] - x[i])
    } else {
        (x[i + 3 * m] - x[i]) - 3.0 * (x[i + 2 * m] - x[i + m])
    }
}
