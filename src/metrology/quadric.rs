//! Ellipse and ellipsoid by one method: an algebraic start, then the maximum-likelihood fit of the points' normal
//! distances, with outliers rejected.
//!
//! - Start: least squares of the quadric whose form has unit Frobenius norm (Bookstein 1979). This norm does not depend
//!   on the axes and is never zero, and it does not force a shape on the data: a hyperbola gives a form that is not
//!   positive. A fit that can only give ellipses would turn any data into an ellipse.
//! - Fit: Gauss-Newton on the signed distances to the surface (the same noise in all channels). A noisy point lies on
//!   average `sigma^2 * (sum of curvatures) / 2` outside; the fit subtracts this, so that radii are not biased.
//! - Outliers: Tukey's weights on a sample of the points until the scale has settled, then all points within
//!   [`REJECT_SIGMA`] with equal weights, so that the fit keeps its full efficiency.
//!
//! All computations use coordinates that are centred and scaled by the record itself.

mod algebraic;
mod block;
mod distance;
pub(crate) mod step;

use nalgebra::{Cholesky, DMatrix, SMatrix, SVector, SymmetricEigen};

use crate::Refusal;
use block::Frame;
use distance::{Iteration, Weight};

/// Points farther than this many standard deviations from the surface are rejected (6 in 10 million of normal noise).
pub(crate) const REJECT_SIGMA: f64 = 5.0;
/// Points that settle the scale (to 2 %) and the first iterations.
const SAMPLE: usize = 4096;
const ITERATIONS: usize = 50;
/// Largest standard deviation of the noise over the smallest semi-axis. Beyond it distances from a surface mean
/// nothing.
pub(crate) const NOISE_LIMIT: f64 = 0.25;

/// Root mean square distance from the surface over its radius, and movement of the centre over the radius, up to which
/// they count as noise unless the caller says otherwise. A good magnetometer shows a part of a percent.
pub(crate) const RESIDUAL_LIMIT: f64 = 0.05;

/// Columns of a record, one for each dimension.
pub(crate) type Columns<'a, const D: usize> = [&'a [f64]; D];

/// The surface `(p - centre)' form (p - centre) = 1`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Surface<const D: usize> {
    pub(crate) centre: SVector<f64, D>,
    pub(crate) form: SMatrix<f64, D, D>,
}

/// A fitted surface. `P = D + D (D + 1) / 2` parameters: the centre, then the form by rows of its upper triangle.
#[derive(Debug, Clone)]
pub(crate) struct QuadricFit<const D: usize, const P: usize> {
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

/// Treatment of points that lie far from the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Far {
    /// They are rejected, since each point has an error of its own.
    Rejected,
    /// They count like all others, in a plain least-squares fit: the caller knows which points share an error.
    Kept,
}

/// Parameters of the surface whose form is not that of an ellipse or ellipsoid.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct NotPositive {
    /// Eigenvalues of the form, sorted.
    pub(crate) eigenvalues: Vec<f64>,
}

/// Fits a closed surface to the points.
pub(crate) fn fit<const D: usize, const P: usize>(
    points: &Columns<D>,
    shapes: (&'static str, &'static str),
    far: Far,
) -> Result<QuadricFit<D, P>, Refusal> {
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
    let start = algebraic::surface(&few, &frame).map_err(|e| open(&e))?;
    let mut state = Iteration::<D, P>::new(start);
    let noise = |state: &Iteration<D, P>, sigma: f64| {
        let ratio = sigma * state.values.max().sqrt();
        if ratio > NOISE_LIMIT { Err(Refusal::Noisy { ratio, limit: NOISE_LIMIT }) } else { Ok(()) }
    };
    noise(&state, state.scale(&few, &frame))?;
    let diverged = |step| Refusal::Diverged { what: shapes.0, step, iterations: ITERATIONS };

    // First the fit runs on the sample, robustly, until the step is small against its own uncertainty.
    let mut step = f64::INFINITY;
    if far == Far::Rejected {
        for _ in 0..ITERATIONS {
            let scale = state.scale(&few, &frame);
            let sums = state.pass(&few, &frame, Weight::Tukey(REJECT_SIGMA * scale.max(1e-12)), scale);
            step = state.update(&sums, scale).map_err(|()| diverged(step))?;
            if step < 0.01 {
                break;
            }
        }
        if step.is_nan() || step > 0.5 {
            return Err(diverged(step));
        }
    }

    // Then it runs on all points.
    let sigma = state.scale(&few, &frame).max(1e-12);
    noise(&state, sigma)?;
    let weight = match far {
        Far::Rejected => Weight::Within(REJECT_SIGMA * sigma),
        Far::Kept => Weight::Within(f64::INFINITY),
    };
    let mut sums;
    let mut iterations = 0;
    loop {
        sums = state.pass(points, &frame, weight, sigma);
        let used = sums.weight;
        if used < (2 * P) as f64 {
            return Err(Refusal::TooManyRejected { rejected: n - used as usize, total: n, limit_percent: 50.0 });
        }
        let now = (sums.squares / (used - P as f64)).sqrt().max(1e-15);
        step = state.update(&sums, now).map_err(|()| diverged(step))?;
        iterations += 1;
        // Gauss-Newton leaves an error of the square of the step, times the curvature over one standard deviation.
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
    let surface = algebraic::surface(points, &frame)?;
    Ok(surface.unscaled(&frame))
}

/// Indices spread over the record with a jitter, so that they do not run in step with its turns.
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

impl<const D: usize, const P: usize> QuadricFit<D, P> {
    /// Covariance of figures computed from the surface (delta method, central differences of a hundredth of a standard
    /// deviation).
    pub(crate) fn spread<const N: usize>(&self, figures: impl Fn(&Surface<D>) -> [f64; N]) -> SMatrix<f64, N, N> {
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
        jacobian * self.covariance * jacobian.transpose()
    }
}
