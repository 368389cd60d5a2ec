//! Ellipse and ellipsoid by one method: an algebraic start, then the maximum-likelihood fit of the points' normal
//! distances, with outliers rejected.
//!
//! - Start: least squares of the quadric whose form has unit Frobenius norm (Bookstein 1979). This norm does not depend
//!   on the axes and is never zero, and it forces no shape on the data: a hyperbola shows itself as a form that is not
//!   positive, where a fit that can only give ellipses would make one of anything.
//! - Fit: Gauss-Newton on the signed distances to the surface (noise alike in all channels). A noisy point lies on
//!   average `sigma^2 * (sum of curvatures) / 2` outside; this is taken off, so that radii are not biased.
//! - Outliers: Tukey's weights on a sample of the points until the scale has settled, then all points within
//!   [`REJECT_SIGMA`], alike: nothing of the efficiency is lost.
//!
//! All in coordinates centred and scaled by the record itself.

#![allow(
    clippy::needless_range_loop,
    reason = "lanes of several arrays are walked together, so that they become vectors"
)]

use nalgebra::{Cholesky, DMatrix, DVector, SMatrix, SVector, SymmetricEigen};

use crate::{Refusal, stats};

/// Points farther than this many standard deviations from the surface are rejected (6 in 10 million of normal noise).
pub(crate) const REJECT_SIGMA: f64 = 5.0;
/// Points that settle the scale and the first iterations.
const SAMPLE: usize = 16_384;
const ITERATIONS: usize = 50;
/// Standard deviation of the noise over the smallest semi-axis: beyond it distances from a surface mean nothing.
pub(crate) const NOISE_LIMIT: f64 = 0.25;
/// Points that are worked on together: enough for the compiler to use vectors and to keep sums in registers.
const LANES: usize = 64;

/// Columns of a record, one for each dimension.
pub(crate) type Columns<'a, const D: usize> = [&'a [f64]; D];

/// `(p - centre)' form (p - centre) = 1`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Surface<const D: usize> {
    pub(crate) centre: SVector<f64, D>,
    pub(crate) form: SMatrix<f64, D, D>,
}

/// A fitted surface. `P = D + D (D + 1) / 2` parameters: the centre, then the form by rows of its upper triangle.
#[derive(Debug, Clone)]
pub(crate) struct Fit<const D: usize, const P: usize> {
    pub(crate) surface: Surface<D>,
    /// Rotation from the principal frame, in which the covariance is given, to the frame of the record.
    pub(crate) frame: SMatrix<f64, D, D>,
    /// Parameters in the principal frame.
    pub(crate) parameters: SVector<f64, P>,
    pub(crate) covariance: SMatrix<f64, P, P>,
    /// Standard deviation of the noise of a channel.
    pub(crate) sigma: f64,
    /// Root mean square of the distances of the points that were kept.
    pub(crate) residual_rms: f64,
    pub(crate) condition: f64,
    pub(crate) rejected: usize,
    pub(crate) used: usize,
}

/// Parameters of the surface whose form is not that of an ellipse or ellipsoid.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct NotPositive {
    /// Eigenvalues of the form, sorted.
    pub(crate) eigenvalues: Vec<f64>,
}

/// Scale of a record: its middle and half width, from percentiles of a sample, so that spikes do not enter.
struct Frame<const D: usize> {
    middle: SVector<f64, D>,
    half: SVector<f64, D>,
    scale: f64,
}

impl<const D: usize> Frame<D> {
    fn of(points: &Columns<D>, sample: &[usize]) -> Self {
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

/// Fits a closed surface to the points.
pub(crate) fn fit<const D: usize, const P: usize>(
    points: &Columns<D>,
    shapes: (&'static str, &'static str),
) -> Result<Fit<D, P>, Refusal> {
    let n = points[0].len();
    if n < 4 * P {
        return Err(Refusal::TooFew { what: format!("an {}", shapes.0), got: n, needed: 4 * P });
    }
    let sample = sample(n);
    let frame = Frame::of(points, &sample);
    if frame.half.min() <= 0.0 {
        let flat = frame.half.imin();
        return Err(Refusal::Constant { channel: crate::AXES[flat].to_owned(), samples: n, value: frame.middle[flat] });
    }
    let gathered: [Vec<f64>; D] = std::array::from_fn(|d| sample.iter().map(|&i| points[d][i]).collect());
    let few: Columns<D> = std::array::from_fn(|d| gathered[d].as_slice());
    let open = |e: &NotPositive| Refusal::NotClosed {
        shape: shapes.1,
        expected: shapes.0,
        detail: format!(
            "eigenvalues of its form {}",
            e.eigenvalues.iter().map(|v| format!("{v:.3e}")).collect::<Vec<_>>().join(" ")
        ),
    };
    let start = algebraic_in(&few, &frame).map_err(|e| open(&e))?;
    let mut state = Iteration::<D, P>::new(start);
    let noise = |state: &Iteration<D, P>, sigma: f64| {
        let ratio = sigma * state.values.max().sqrt();
        if ratio > NOISE_LIMIT { Err(Refusal::Noisy { ratio, limit: NOISE_LIMIT }) } else { Ok(()) }
    };
    noise(&state, state.scale(&few, &frame))?;

    // On the sample, robustly, until the step is small against its own uncertainty.
    let mut step = f64::INFINITY;
    for _ in 0..ITERATIONS {
        let scale = state.scale(&few, &frame);
        let sums = state.pass(&few, &frame, Weight::Tukey(REJECT_SIGMA * scale.max(1e-12)), scale);
        step = state.update(&sums, scale).map_err(|()| Refusal::Diverged {
            what: shapes.0,
            step,
            iterations: ITERATIONS,
        })?;
        if step < 0.01 {
            break;
        }
    }
    let diverged = |step| Refusal::Diverged { what: shapes.0, step, iterations: ITERATIONS };
    if step.is_nan() || step > 0.5 {
        return Err(diverged(step));
    }

    // On all points.
    let sigma = state.scale(&few, &frame).max(1e-12);
    noise(&state, sigma)?;
    let mut sums;
    let mut iterations = 0;
    loop {
        sums = state.pass(points, &frame, Weight::Within(REJECT_SIGMA * sigma), sigma);
        let used = sums.weight;
        if used < (2 * P) as f64 {
            return Err(Refusal::TooManyRejected { rejected: n - used as usize, total: n, limit_percent: 50.0 });
        }
        let now = (sums.squares / (used - P as f64)).sqrt().max(1e-15);
        step = state.update(&sums, now).map_err(|()| Refusal::Diverged {
            what: shapes.0,
            step,
            iterations: ITERATIONS,
        })?;
        iterations += 1;
        // What Gauss-Newton leaves is the square of the step, times the curvature over one standard deviation.
        let left = step * step * now / used.sqrt();
        if left < 0.01 && step < 20.0 {
            break;
        }
        if iterations == 10 {
            return Err(diverged(step));
        }
    }
    Ok(state.finish(&sums, &frame, n))
}

/// The algebraic fit alone, over all points, in the coordinates of the record.
pub(crate) fn algebraic<const D: usize>(points: &Columns<D>) -> Result<Surface<D>, NotPositive> {
    let frame = Frame::of(points, &sample(points[0].len()));
    let surface = algebraic_in(points, &frame)?;
    Ok(surface.unscaled(&frame))
}

/// Indices spread over the record with a jitter, so that they do not keep step with its turns.
fn sample(n: usize) -> Vec<usize> {
    if n <= SAMPLE {
        return (0..n).collect();
    }
    // Weyl sequence of the golden ratio.
    let stride = n as f64 / SAMPLE as f64;
    (0..SAMPLE)
        .map(|k| ((k as f64 + (k as f64 * 0.618_033_988_749_895).fract()) * stride) as usize)
        .map(|i| i.min(n - 1))
        .collect()
}

/// Least squares of the quadric with unit norm of its form, over the points inside twice the box of the record.
fn algebraic_in<const D: usize>(points: &Columns<D>, frame: &Frame<D>) -> Result<Surface<D>, NotPositive> {
    // Columns: the form by rows of its upper triangle (products times sqrt 2, so that the norm is that of the columns),
    // coordinates, 1.
    const MOST: usize = 10;
    let squares = D * (D + 1) / 2;
    let unknowns = squares + D + 1;
    let mut sums = [[0.0; MOST]; MOST];
    let bound: SVector<f64, D> = frame.half * (2.0 / frame.scale);
    lanes(points, frame, |u, mut keep| {
        for d in 0..D {
            for l in 0..LANES {
                keep[l] = if u[d][l].abs() <= bound[d] { keep[l] } else { 0.0 };
            }
        }
        let mut row = [[0.0; LANES]; MOST];
        let mut c = 0;
        for a in 0..D {
            for b in a..D {
                let factor = if a == b { 1.0 } else { std::f64::consts::SQRT_2 };
                for l in 0..LANES {
                    row[c][l] = factor * u[a][l] * u[b][l] * keep[l];
                }
                c += 1;
            }
        }
        for d in 0..D {
            for l in 0..LANES {
                row[squares + d][l] = u[d][l] * keep[l];
            }
        }
        row[unknowns - 1] = keep;
        for a in 0..unknowns {
            for b in a..unknowns {
                sums[a][b] += dot(&row[a], &row[b]);
            }
        }
    });
    let part = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
        DMatrix::from_fn(rows.len(), columns.len(), |r, c| {
            let (a, b) = (rows.start + r, columns.start + c);
            sums[a.min(b)][a.max(b)]
        })
    };
    let failed = || NotPositive { eigenvalues: vec![0.0; D] };
    // The best coordinates and constant for a form follow from it linearly; what is left is an eigenvalue problem.
    let cross = part(squares..unknowns, 0..squares);
    let follow = part(squares..unknowns, squares..unknowns).cholesky().ok_or_else(failed)?.solve(&cross);
    let left = part(0..squares, 0..squares) - cross.transpose() * &follow;
    let eigen = SymmetricEigen::new((&left + left.transpose()) * 0.5);
    let vector: DVector<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let rest = -(follow * &vector);

    let mut form = SMatrix::<f64, D, D>::zeros();
    let mut c = 0;
    for a in 0..D {
        for b in a..D {
            form[(a, b)] = if a == b { vector[c] } else { vector[c] / std::f64::consts::SQRT_2 };
            form[(b, a)] = form[(a, b)];
            c += 1;
        }
    }
    let linear = SVector::<f64, D>::from_fn(|d, _| rest[d]);
    let constant = rest[D];
    // u' F u + l' u + k = 0  ->  (u - c)' F (u - c) = c' F c - k, c = -F^-1 l / 2.
    let inverse = form.try_inverse().ok_or_else(failed)?;
    let centre = inverse * linear * -0.5;
    let level = (centre.transpose() * form * centre)[0] - constant;
    let surface = Surface { centre, form: form / level };
    if surface.is_positive() { Ok(surface) } else { Err(surface.not_positive()) }
}

/// Scalar product of two lanes.
fn dot(a: &[f64; LANES], b: &[f64; LANES]) -> f64 {
    const WIDTH: usize = 8;
    let mut sums = [0.0; WIDTH];
    for (a, b) in a.as_chunks::<WIDTH>().0.iter().zip(b.as_chunks::<WIDTH>().0) {
        for l in 0..WIDTH {
            sums[l] += a[l] * b[l];
        }
    }
    sums.iter().sum()
}

/// Walks over the points in lanes, centred and scaled; the second argument is 1 for a point, 0 for padding.
fn lanes<const D: usize>(
    points: &Columns<D>,
    frame: &Frame<D>,
    mut visit: impl FnMut(&[[f64; LANES]; D], [f64; LANES]),
) {
    let n = points[0].len();
    let inverse = 1.0 / frame.scale;
    let mut u = [[0.0; LANES]; D];
    let whole = n - n % LANES;
    for start in (0..whole).step_by(LANES) {
        for d in 0..D {
            let chunk = &points[d][start..start + LANES];
            for l in 0..LANES {
                u[d][l] = (chunk[l] - frame.middle[d]) * inverse;
            }
        }
        visit(&u, [1.0; LANES]);
    }
    if whole < n {
        let mut keep = [0.0; LANES];
        for d in 0..D {
            for l in 0..LANES {
                // Padding repeats the last point, so that it is an ordinary number.
                u[d][l] = (points[d][(whole + l).min(n - 1)] - frame.middle[d]) * inverse;
            }
        }
        keep[..n - whole].fill(1.0);
        visit(&u, keep);
    }
}

impl<const D: usize> Surface<D> {
    pub(crate) fn is_positive(&self) -> bool {
        self.form.iter().all(|v| v.is_finite())
            && Cholesky::new(DMatrix::from_fn(D, D, |r, c| self.form[(r, c)])).is_some()
    }

    pub(crate) fn not_positive(&self) -> NotPositive {
        NotPositive { eigenvalues: self.principal().0.iter().copied().collect() }
    }

    /// Eigenvalues of the form, rising, and the frame of their vectors.
    pub(crate) fn principal(&self) -> (SVector<f64, D>, SMatrix<f64, D, D>) {
        let eigen = SymmetricEigen::new(DMatrix::from_fn(D, D, |r, c| self.form[(r, c)]));
        let mut order: Vec<usize> = (0..D).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let values = SVector::from_fn(|i, _| eigen.eigenvalues[order[i]]);
        let frame = SMatrix::from_fn(|r, c| eigen.eigenvectors[(r, order[c])]);
        (values, frame)
    }

    fn unscaled(&self, frame: &Frame<D>) -> Self {
        Self { centre: self.centre * frame.scale + frame.middle, form: self.form / (frame.scale * frame.scale) }
    }
}

#[derive(Clone, Copy)]
enum Weight {
    /// Tukey's biweight with this limit.
    Tukey(f64),
    /// All points within this limit alike.
    Within(f64),
}

/// Sums of one pass, in the principal frame.
struct Sums<const P: usize> {
    normal: SMatrix<f64, P, P>,
    gradient: SVector<f64, P>,
    weight: f64,
    squares: f64,
}

/// The present surface and its principal frame.
struct Iteration<const D: usize, const P: usize> {
    surface: Surface<D>,
    values: SVector<f64, D>,
    frame: SMatrix<f64, D, D>,
}

/// Normal distance, unit normal and foot point of a lane of points, in the principal frame.
struct Feet<const D: usize> {
    distance: [f64; LANES],
    normal: [[f64; LANES]; D],
    foot: [[f64; LANES]; D],
    /// Length of half the gradient at the foot.
    slope: [f64; LANES],
}

impl<const D: usize, const P: usize> Iteration<D, P> {
    fn new(surface: Surface<D>) -> Self {
        let (values, frame) = surface.principal();
        Self { surface, values, frame }
    }

    /// The foot of point u satisfies `foot_k = u_k / (1 + t lambda_k)`, `sum lambda_k foot_k^2 = 1`: three Newton steps
    /// from t = 0 settle it to rounding for points within a tenth of the radius; others are outliers anyway.
    fn feet(&self, u: &[[f64; LANES]; D]) -> Feet<D> {
        let mut v = [[0.0; LANES]; D];
        for k in 0..D {
            for d in 0..D {
                let r = self.frame[(d, k)];
                let c = self.surface.centre[d];
                for l in 0..LANES {
                    v[k][l] += r * (u[d][l] - c);
                }
            }
        }
        let mut t = [0.0; LANES];
        let floor = -0.9 / self.values[D - 1];
        for _ in 0..3 {
            let mut g = [-1.0; LANES];
            let mut slope = [0.0; LANES];
            for k in 0..D {
                let lambda = self.values[k];
                for l in 0..LANES {
                    let r = 1.0 / (1.0 + t[l] * lambda);
                    let f = v[k][l] * r;
                    let q = lambda * f * f;
                    g[l] += q;
                    slope[l] += q * lambda * r;
                }
            }
            for l in 0..LANES {
                let next = t[l] + 0.5 * g[l] / slope[l];
                t[l] = if next > floor { next } else { floor };
            }
        }
        let mut feet =
            Feet { distance: [0.0; LANES], normal: [[0.0; LANES]; D], foot: [[0.0; LANES]; D], slope: [1e-300; LANES] };
        for k in 0..D {
            let lambda = self.values[k];
            for l in 0..LANES {
                feet.foot[k][l] = v[k][l] / (1.0 + t[l] * lambda);
                feet.normal[k][l] = lambda * feet.foot[k][l];
                feet.slope[l] += feet.normal[k][l] * feet.normal[k][l];
            }
        }
        for l in 0..LANES {
            feet.slope[l] = feet.slope[l].sqrt();
            feet.distance[l] = t[l] * feet.slope[l];
        }
        for k in 0..D {
            for l in 0..LANES {
                feet.normal[k][l] /= feet.slope[l];
            }
        }
        feet
    }

    /// Robust standard deviation of the distances: 1.4826 times their median magnitude, with the parameters' share.
    fn scale(&self, points: &Columns<D>, frame: &Frame<D>) -> f64 {
        let mut distances = Vec::with_capacity(points[0].len());
        lanes(points, frame, |u, keep| {
            let feet = self.feet(u);
            for l in 0..LANES {
                if keep[l] > 0.0 {
                    // A point at the very centre has no foot: infinitely far, as an outlier should be.
                    distances.push(if feet.distance[l].is_nan() { f64::INFINITY } else { feet.distance[l].abs() });
                }
            }
        });
        let n = distances.len() as f64;
        1.4826 * stats::median(&mut distances) * (n / (n - P as f64)).sqrt()
    }

    fn pass(&self, points: &Columns<D>, frame: &Frame<D>, weight: Weight, sigma: f64) -> Sums<P> {
        let mut sums = Sums::<P> { normal: SMatrix::zeros(), gradient: SVector::zeros(), weight: 0.0, squares: 0.0 };
        let trace: f64 = self.values.sum();
        let half_variance = 0.5 * sigma * sigma;
        lanes(points, frame, |u, keep| {
            let feet = self.feet(u);
            // Roots of the weights, so that each factor of a product carries its own.
            let mut w = [0.0; LANES];
            for l in 0..LANES {
                let d = feet.distance[l];
                let value = match weight {
                    Weight::Within(limit) => {
                        if d.abs() < limit {
                            1.0
                        } else {
                            0.0
                        }
                    }
                    Weight::Tukey(limit) => {
                        let q = (d / limit) * (d / limit);
                        if q < 1.0 { 1.0 - q } else { 0.0 }
                    }
                };
                w[l] = value * keep[l];
            }
            let mut jacobian = [[0.0; LANES]; P];
            let mut curvature = [trace; LANES];
            for k in 0..D {
                for l in 0..LANES {
                    jacobian[k][l] = -feet.normal[k][l];
                    curvature[l] -= self.values[k] * feet.normal[k][l] * feet.normal[k][l];
                }
            }
            let mut p = D;
            for a in 0..D {
                for b in a..D {
                    let factor = if a == b { 0.5 } else { 1.0 };
                    for l in 0..LANES {
                        jacobian[p][l] = factor * feet.foot[a][l] * feet.foot[b][l] / feet.slope[l];
                    }
                    p += 1;
                }
            }
            // An outlier's numbers may be infinite, and 0 times that is no number.
            for row in &mut jacobian {
                for l in 0..LANES {
                    row[l] = if w[l] > 0.0 { w[l] * row[l] } else { 0.0 };
                }
            }
            let mut residual = [0.0; LANES];
            for l in 0..LANES {
                let r = feet.distance[l] - half_variance * curvature[l] / feet.slope[l];
                residual[l] = if w[l] > 0.0 { w[l] * r } else { 0.0 };
            }
            sums.weight += dot(&w, &w);
            sums.squares += dot(&residual, &residual);
            for a in 0..P {
                sums.gradient[a] += dot(&jacobian[a], &residual);
                for b in a..P {
                    sums.normal[(a, b)] += dot(&jacobian[a], &jacobian[b]);
                }
            }
        });
        let upper = sums.normal;
        sums.normal = SMatrix::from_fn(|a, b| upper[(a.min(b), a.max(b))]);
        sums
    }

    /// One Gauss-Newton step, shortened until the form stays positive; returns its size in standard deviations.
    fn update(&mut self, sums: &Sums<P>, sigma: f64) -> Result<f64, ()> {
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

    fn finish(&self, sums: &Sums<P>, frame: &Frame<D>, n: usize) -> Fit<D, P> {
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
        Fit {
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

/// Inverse of a normal matrix after scaling its diagonal to 1, and the condition number of the problem behind it.
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

/// Surface of a parameter vector.
pub(crate) fn unpack<const D: usize, const P: usize>(parameters: &SVector<f64, P>) -> Surface<D> {
    let mut form = SMatrix::zeros();
    let mut p = D;
    for a in 0..D {
        for b in a..D {
            form[(a, b)] = parameters[p];
            form[(b, a)] = parameters[p];
            p += 1;
        }
    }
    Surface { centre: SVector::from_fn(|d, _| parameters[d]), form }
}

impl<const D: usize, const P: usize> Fit<D, P> {
    /// Standard deviations of figures computed from the surface (delta method, central differences of a hundredth of a
    /// standard deviation).
    pub(crate) fn spread<const N: usize>(&self, figures: impl Fn(&Surface<D>) -> [f64; N]) -> [f64; N] {
        let at = |parameters: &SVector<f64, P>| {
            let local = unpack::<D, P>(parameters);
            figures(&Surface {
                centre: self.frame * local.centre,
                form: self.frame * local.form * self.frame.transpose(),
            })
        };
        let mut jacobian = SMatrix::<f64, N, P>::zeros();
        for p in 0..P {
            let h = 0.01 * self.covariance[(p, p)].sqrt();
            if h.is_nan() || h <= 0.0 {
                continue;
            }
            let mut shifted = self.parameters;
            shifted[p] += h;
            let above = at(&shifted);
            shifted[p] -= 2.0 * h;
            let below = at(&shifted);
            for k in 0..N {
                jacobian[(k, p)] = (above[k] - below[k]) / (2.0 * h);
            }
        }
        let covariance = jacobian * self.covariance * jacobian.transpose();
        std::array::from_fn(|k| covariance[(k, k)].max(0.0).sqrt())
    }
}
