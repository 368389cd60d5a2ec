//! One round of the fit of normal distances.

#![allow(clippy::needless_range_loop, reason = "vectors of several arrays are walked together by one index")]

use nalgebra::{DMatrix, SMatrix, SVector, SymmetricEigen};
use wide::f64x4;

use super::block::{self, Frame, GROUPS};
use super::{Columns, QuadricFit, Surface, unpack};
use crate::stats;

#[derive(Clone, Copy)]
pub(super) enum Weight {
    /// Tukey's biweight with this limit.
    Tukey(f64),
    /// Equal weights for all points within this limit.
    Within(f64),
}

impl Weight {
    /// Which points count at these distances (a mask), and the roots of their weights.
    #[inline(always)]
    fn root(self, distance: f64x4) -> (f64x4, f64x4) {
        match self {
            Self::Within(limit) => (distance.abs().simd_lt(f64x4::splat(limit)), f64x4::ONE),
            Self::Tukey(limit) => {
                let q = distance / limit;
                let root = f64x4::ONE - q * q;
                (root.simd_gt(f64x4::ZERO), root)
            }
        }
    }
}

/// Sums of one pass, in the principal frame.
pub(super) struct Sums<const P: usize> {
    normal: SMatrix<f64, P, P>,
    gradient: SVector<f64, P>,
    pub(super) weight: f64,
    pub(super) squares: f64,
}

/// The present surface and its principal frame.
pub(super) struct Iteration<const D: usize, const P: usize> {
    surface: Surface<D>,
    pub(super) values: SVector<f64, D>,
    frame: SMatrix<f64, D, D>,
}

/// Normal distance, unit normal and foot point of some points, in the principal frame.
struct Feet<const D: usize> {
    distance: f64x4,
    normal: [f64x4; D],
    foot: [f64x4; D],
    /// One over the length of half the gradient at the foot.
    inverse: f64x4,
}

impl<const D: usize, const P: usize> Iteration<D, P> {
    pub(super) fn new(surface: Surface<D>) -> Self {
        let (values, frame) = surface.principal();
        Self { surface, values, frame }
    }

    /// The foot of point v satisfies `foot_k = v_k / (1 + t lambda_k)`, `sum lambda_k foot_k^2 = 1`: three Newton steps
    /// from t = 0 settle it to rounding for points within a tenth of the radius; other points are outliers anyway. All
    /// terms have the common denominator, since divisions cost most of the time.
    #[inline(always)]
    fn feet(&self, u: [f64x4; D]) -> Feet<D> {
        let mut v = [f64x4::ZERO; D];
        for k in 0..D {
            for d in 0..D {
                v[k] += (u[d] - self.surface.centre[d]) * self.frame[(d, k)];
            }
        }
        let floor = f64x4::splat(-0.9 / self.values[D - 1]);
        let mut t = f64x4::ZERO;
        for _ in 0..3 {
            let (others, product) = self.denominators(t);
            let (mut level, mut slope) = (f64x4::ZERO, f64x4::ZERO);
            for k in 0..D {
                let f = v[k] * others[k];
                let q = f * f * self.values[k];
                level += q;
                slope += q * others[k] * self.values[k];
            }
            let next = t + (level - product * product) * product / (slope + slope);
            // This comparison is false for NaN too.
            t = next.simd_gt(floor).select(next, floor);
        }
        let (others, product) = self.denominators(t);
        let scale = f64x4::ONE / product;
        let (mut foot, mut normal) = ([f64x4::ZERO; D], [f64x4::ZERO; D]);
        let mut squares = f64x4::splat(1e-300);
        for k in 0..D {
            foot[k] = v[k] * others[k] * scale;
            normal[k] = foot[k] * self.values[k];
            squares += normal[k] * normal[k];
        }
        let slope = squares.sqrt();
        let inverse = f64x4::ONE / slope;
        for n in &mut normal {
            *n *= inverse;
        }
        Feet { distance: t * slope, normal, foot, inverse }
    }

    /// For each axis the product of `1 + t lambda` over the other axes, and the product over all axes.
    #[inline(always)]
    fn denominators(&self, t: f64x4) -> ([f64x4; D], f64x4) {
        let (mut others, mut product) = ([f64x4::ONE; D], f64x4::ONE);
        for k in 0..D {
            let one = t * self.values[k] + 1.0;
            product *= one;
            for j in 0..D {
                if j != k {
                    others[j] *= one;
                }
            }
        }
        (others, product)
    }

    /// Robust standard deviation of the distances: 1.4826 times their median magnitude, corrected for the number of
    /// parameters.
    pub(super) fn scale(&self, points: &Columns<D>, frame: &Frame<D>) -> f64 {
        let n = points[0].len();
        let mut distances = Vec::with_capacity(n + 16);
        block::walk(points, frame, |u, _| {
            for g in 0..GROUPS {
                distances.extend(self.feet(std::array::from_fn(|d| u[d][g])).distance.to_array());
            }
        });
        distances.truncate(n);
        // A point at the very centre has no foot. It counts as infinitely far, like an outlier.
        distances.iter_mut().for_each(|d: &mut f64| *d = if d.is_nan() { f64::INFINITY } else { d.abs() });
        1.4826 * stats::median(&mut distances) * (n as f64 / (n - P) as f64).sqrt()
    }

    pub(super) fn pass(&self, points: &Columns<D>, frame: &Frame<D>, weight: Weight, sigma: f64) -> Sums<P> {
        let mut normal = [[f64x4::ZERO; P]; P];
        let (mut gradient, mut squares, mut weights) = ([f64x4::ZERO; P], f64x4::ZERO, f64x4::ZERO);
        block::walk(points, frame, |u, keep| {
            let mut jacobian = [[f64x4::ZERO; GROUPS]; P];
            let mut residual = [f64x4::ZERO; GROUPS];
            for g in 0..GROUPS {
                let feet = self.feet(std::array::from_fn(|d| u[d][g]));
                // These are the roots of the weights, so that each factor of a product carries its own.
                let (used, w) = weight.root(feet.distance);
                let w = w * keep[g];
                let (row, rest) = self.row(&feet, sigma);
                // An outlier's numbers may be infinite, and 0 times infinity is NaN. So they are masked, not only
                // weighted.
                for p in 0..P {
                    jacobian[p][g] = (row[p] * w) & used;
                }
                residual[g] = (rest * w) & used;
                weights += (w * w) & used;
            }
            squares = block::add_product(squares, &residual, &residual);
            for a in 0..P {
                gradient[a] = block::add_product(gradient[a], &jacobian[a], &residual);
                for b in a..P {
                    normal[a][b] = block::add_product(normal[a][b], &jacobian[a], &jacobian[b]);
                }
            }
        });
        Sums {
            normal: SMatrix::from_fn(|a, b| normal[a.min(b)][a.max(b)].reduce_add()),
            gradient: SVector::from_fn(|a, _| gradient[a].reduce_add()),
            weight: weights.reduce_add(),
            squares: squares.reduce_add(),
        }
    }

    /// Derivatives of the distance by the parameters, and the distance less the mean offset that noise adds to it.
    #[inline(always)]
    fn row(&self, feet: &Feet<D>, sigma: f64) -> ([f64x4; P], f64x4) {
        let mut row = [f64x4::ZERO; P];
        let mut curvature = f64x4::splat(self.values.sum());
        let mut p = D;
        for a in 0..D {
            row[a] = -feet.normal[a];
            curvature -= feet.normal[a] * feet.normal[a] * self.values[a];
            let scaled = feet.foot[a] * feet.inverse;
            for b in a..D {
                let product = scaled * feet.foot[b];
                row[p] = if a == b { product * 0.5 } else { product };
                p += 1;
            }
        }
        (row, feet.distance - curvature * feet.inverse * (0.5 * sigma * sigma))
    }

    /// Makes one Gauss-Newton step, shortened until the form stays positive; returns its size in standard deviations.
    pub(super) fn update(&mut self, sums: &Sums<P>, sigma: f64) -> Result<f64, ()> {
        let cofactor = invert(&sums.normal).ok_or(())?.0;
        let full = -(cofactor * sums.gradient);
        let size = (0..P)
            .map(|p| full[p].abs() / (sigma.max(1e-12) * cofactor[(p, p)].sqrt()))
            .fold(0.0, |a: f64, b| if b.is_nan() { f64::NAN } else { a.max(b) });
        if !size.is_finite() {
            return Err(());
        }
        let mut part = 1.0;
        for _ in 0..20 {
            let next = self.moved(&(full * part));
            if next.is_positive() {
                *self = Self::new(next);
                return Ok(size);
            }
            part *= 0.5;
        }
        Err(())
    }

    /// The surface after a step in the principal frame.
    fn moved(&self, step: &SVector<f64, P>) -> Surface<D> {
        let mut parameters = step.clone_owned();
        let mut p = D;
        for a in 0..D {
            for b in a..D {
                if a == b {
                    parameters[p] += self.values[a];
                }
                p += 1;
            }
        }
        let local = unpack::<D, P>(&parameters);
        Surface {
            centre: self.surface.centre + self.frame * local.centre,
            form: self.frame * local.form * self.frame.transpose(),
        }
    }

    pub(super) fn finish(&self, sums: &Sums<P>, frame: &Frame<D>, n: usize) -> QuadricFit<D, P> {
        let used = sums.weight;
        let variance = sums.squares / (used - P as f64);
        let (cofactor, condition) = invert(&sums.normal).unwrap_or((SMatrix::repeat(f64::NAN), f64::INFINITY));
        // Back to the unit of the record: lengths times s, the form over s^2.
        let s = frame.scale;
        let units = SVector::<f64, P>::from_fn(|p, _| if p < D { s } else { 1.0 / (s * s) });
        let covariance = SMatrix::from_fn(|a, b| cofactor[(a, b)] * variance * units[a] * units[b]);
        let surface = self.surface.unscaled(frame);
        let local_centre = self.frame.transpose() * surface.centre;
        let mut parameters = SVector::<f64, P>::from_fn(|p, _| if p < D { local_centre[p] } else { 0.0 });
        let mut p = D;
        for a in 0..D {
            for b in a..D {
                parameters[p] = if a == b { self.values[a] / (s * s) } else { 0.0 };
                p += 1;
            }
        }
        QuadricFit {
            surface,
            frame: self.frame,
            parameters,
            covariance,
            sigma: variance.sqrt() * s,
            residual_rms: (sums.squares / used).sqrt() * s,
            condition,
            rejected: n - used as usize,
            used: used as usize,
        }
    }
}

/// Inverse of a normal matrix after its diagonal is scaled to 1, and the condition number of the problem behind the
/// matrix.
fn invert<const P: usize>(normal: &SMatrix<f64, P, P>) -> Option<(SMatrix<f64, P, P>, f64)> {
    let scale = SVector::<f64, P>::from_fn(|p, _| normal[(p, p)].sqrt());
    if scale.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
        return None;
    }
    let scaled = DMatrix::from_fn(P, P, |a, b| normal[(a, b)] / (scale[a] * scale[b]));
    let eigen = SymmetricEigen::new(scaled);
    let (low, high) = (eigen.eigenvalues.min(), eigen.eigenvalues.max());
    if low.is_nan() || low <= 1e-15 * high {
        return None;
    }
    let inverse = &eigen.eigenvectors
        * DMatrix::from_diagonal(&eigen.eigenvalues.map(|v| 1.0 / v))
        * eigen.eigenvectors.transpose();
    Some((SMatrix::from_fn(|a, b| inverse[(a, b)] / (scale[a] * scale[b])), (high / low).sqrt()))
}
