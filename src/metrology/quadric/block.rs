//! Points of a record in blocks that fit registers and the nearest cache, centred and scaled.

use nalgebra::SVector;
use wide::f64x4;

use super::Columns;

/// Points in a vector.
const LANES: usize = 4;
/// Vectors in a block. Sums over a block are loaded and stored once.
pub(super) const GROUPS: usize = 4;
const POINTS: usize = LANES * GROUPS;

/// One number for each point of a block.
pub(super) type Block = [f64x4; GROUPS];

/// Scale of a record: its middle and half width, from percentiles of a sample, so that spikes do not affect it.
pub(super) struct Frame<const D: usize> {
    pub(super) middle: SVector<f64, D>,
    pub(super) half: SVector<f64, D>,
    pub(super) scale: f64,
}

impl<const D: usize> Frame<D> {
    pub(super) fn of(points: &Columns<D>, sample: &[usize]) -> Self {
        let mut middle = SVector::zeros();
        let mut half = SVector::zeros();
        for d in 0..D {
            let mut values: Vec<f64> = sample.iter().map(|&i| points[d][i]).collect();
            let cut = values.len() / 100;
            let last = values.len() - 1;
            let low = *values.select_nth_unstable_by(cut, f64::total_cmp).1;
            let high = *values.select_nth_unstable_by(last - cut, f64::total_cmp).1;
            middle[d] = f64::midpoint(low, high);
            half[d] = (high - low) / 2.0;
        }
        Self { middle, half, scale: half.max() }
    }
}

/// Walks over the points; the second argument is 1 for a point, 0 for padding.
pub(super) fn walk<const D: usize>(points: &Columns<D>, frame: &Frame<D>, mut visit: impl FnMut(&[Block; D], &Block)) {
    let n = points[0].len();
    let inverse = f64x4::splat(1.0 / frame.scale);
    let mut u = [[f64x4::ZERO; GROUPS]; D];
    let whole = n - n % POINTS;
    for start in (0..whole).step_by(POINTS) {
        for d in 0..D {
            let (vectors, _) = points[d][start..start + POINTS].as_chunks::<LANES>();
            for (u, v) in u[d].iter_mut().zip(vectors) {
                *u = (f64x4::new(*v) - frame.middle[d]) * inverse;
            }
        }
        visit(&u, &[f64x4::ONE; GROUPS]);
    }
    if whole < n {
        // The padding repeats the last point, so that it is an ordinary number.
        let vector =
            |g: usize, value: &dyn Fn(usize) -> f64| f64x4::new(std::array::from_fn(|l| value(whole + g * LANES + l)));
        for d in 0..D {
            u[d] = std::array::from_fn(|g| (vector(g, &|i| points[d][i.min(n - 1)]) - frame.middle[d]) * inverse);
        }
        visit(&u, &std::array::from_fn(|g| vector(g, &|i| if i < n { 1.0 } else { 0.0 })));
    }
}

/// Adds the products of two rows over a block to a sum.
#[inline(always)]
pub(super) fn add_product(sum: f64x4, a: &Block, b: &Block) -> f64x4 {
    let mut sum = sum;
    for g in 0..GROUPS {
        sum += a[g] * b[g];
    }
    sum
}
