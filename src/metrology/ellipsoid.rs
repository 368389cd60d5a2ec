//! Ellipsoid of a three-axis magnetometer (or accelerometer) over many attitudes: hard iron and soft iron.
//!
//! `corrected = matrix (raw - centre)`, `|corrected| = field`. The field alone cannot fix the frame, so the matrix is
//! taken symmetric; it differs by a rotation from a correction that keeps an axis. Without a given field its
//! determinant is 1. The fit minimises the normal distances in the record's own unit (with the same noise in all
//! channels). A fit of magnitudes alone loses up to 10 % at strong distortion.
//!
//! The residual does not serve as an acceptance test: a wrong fit to nearly planar data can have the smaller one.
//! Coverage and condition decide.

use nalgebra::{Matrix3, SMatrix, SVector, SymmetricEigen, Vector3};

use crate::{Refusal, quadric, series};

/// The equation of the correction.
pub const EQUATION: &str = "corrected = matrix (raw - centre), |corrected| = field";

/// Least [`Ellipsoid::coverage`].
pub const COVERAGE_LIMIT: f64 = 0.1;
/// Largest standard uncertainty of the centre or a semi-axis over the smallest semi-axis.
pub const UNCERTAINTY_LIMIT: f64 = 0.05;
/// Part of the points that may be rejected as spikes.
pub const REJECT_LIMIT: f64 = 0.05;

/// A fitted ellipsoid.
#[derive(Debug, Clone, PartialEq)]
pub struct Ellipsoid {
    /// Centre (hard iron), in the unit of the record.
    pub centre: Vector3<f64>,
    /// Symmetric correction matrix (soft iron).
    pub matrix: Matrix3<f64>,
    /// Length of a corrected vector.
    pub field: f64,
    /// Semi-axes, falling, in the unit of the record.
    pub semi_axes: Vector3<f64>,
    /// Root mean square of the distances over the mean radius.
    pub residual_relative: f64,
    /// Three times the smallest eigenvalue of the mean `u u'` over the corrected directions u: 1 where they cover the
    /// sphere evenly, 0 where they lie in a plane; sin^2 of the half width for a band round the equator.
    pub coverage: f64,
    /// Length of the mean of the corrected directions: 0 where they are balanced, 1/2 for a half sphere.
    pub one_sidedness: f64,
    /// Condition number of the scaled problem.
    pub condition: f64,
    /// Standard deviation of the noise of a channel.
    pub sigma: f64,
    /// Points rejected as spikes.
    pub rejected: usize,
    /// Points used.
    pub used: usize,
    /// Standard uncertainty of the centre.
    pub centre_sd: Vector3<f64>,
    /// Standard uncertainty of the matrix.
    pub matrix_sd: Matrix3<f64>,
    /// Standard uncertainty of the field; 0 where it was given.
    pub field_sd: f64,
    /// Covariance of centre (3), upper triangle of the matrix by rows (6) and field.
    pub covariance: SMatrix<f64, 10, 10>,
    /// Degrees of freedom.
    pub dof: usize,
}

impl Ellipsoid {
    /// Returns how far a raw point lies outside: the length of its corrected vector less the field, in the unit of the
    /// field.
    #[must_use]
    pub fn distance(&self, point: &Vector3<f64>) -> f64 {
        (self.matrix * (point - self.centre)).norm() - self.field
    }

    /// Returns the change of the figures, in the order of `covariance`, for one unit of [`Self::distance`] of a point
    /// of the fit.
    ///
    /// To first order a fit of normal distances `d` changes by `(J' J)^-1 J' e` for errors `e` of the distances. With
    /// the covariance `sigma^2 F (J' J)^-1 F'` of the figures and the derivative `h = -dd/dfigures`, `J = -h F`, this
    /// becomes `covariance h / sigma^2`. The normal distance is the distance over `|matrix u|`, where u is the
    /// corrected direction.
    #[must_use]
    pub fn sensitivity(&self, point: &Vector3<f64>) -> SVector<f64, 10> {
        let raw = point - self.centre;
        let corrected = self.matrix * raw;
        let u = corrected / corrected.norm();
        let normal = self.matrix * u;
        let slope = normal.norm();
        let pair = |a: usize, b: usize| u[a] * raw[b] + u[b] * raw[a];
        let derivative = SVector::<f64, 10>::from([
            normal[0],
            normal[1],
            normal[2],
            -u[0] * raw[0],
            -pair(0, 1),
            -pair(0, 2),
            -u[1] * raw[1],
            -pair(1, 2),
            -u[2] * raw[2],
            1.0,
        ]) / slope;
        self.covariance * derivative / (self.sigma * self.sigma).max(f64::MIN_POSITIVE) / slope
    }
}

/// Correction of a surface: the matrix and the field.
fn correction(surface: &quadric::Surface<3>, field: Option<f64>) -> (Matrix3<f64>, f64) {
    let eigen = SymmetricEigen::new(surface.form);
    let root =
        eigen.eigenvectors * Matrix3::from_diagonal(&eigen.eigenvalues.map(f64::sqrt)) * eigen.eigenvectors.transpose();
    // det(matrix) = field^3 det(root).
    let field = field.unwrap_or_else(|| eigen.eigenvalues.product().powf(-1.0 / 6.0));
    (root * field, field)
}

/// Fits an ellipsoid. `field` is the strength of the field in the unit wanted for corrected vectors, if known;
/// `saturation` the output at which a channel is cut, if known.
///
/// # Errors
/// Values that are not finite or are cut off; a hyperboloid; poor coverage, too much noise, too many outliers; points that
/// lie more than 5 % of the radius off the ellipsoid, or a centre that moves by as much.
pub fn fit(x: &[f64], y: &[f64], z: &[f64], field: Option<f64>, saturation: Option<f64>) -> Result<Ellipsoid, Refusal> {
    fit_within([x, y, z], field, saturation, quadric::RESIDUAL_LIMIT)
}

/// Like [`fit`], with another limit on the residual and on the movement of the centre, over the radius.
///
/// # Errors
/// As [`fit`].
pub fn fit_within(
    points: [&[f64]; 3],
    field: Option<f64>,
    saturation: Option<f64>,
    limit: f64,
) -> Result<Ellipsoid, Refusal> {
    fit_points(points, field, saturation, limit, quadric::Far::Rejected)
}

/// The plain least-squares fit, which uses every point and takes none for a spike. It is for points that share errors
/// in groups, as the points of one attitude share the error of the ambient field. `covariance` is that of independent
/// errors; [`Ellipsoid::sensitivity`] gives the effect of shared errors.
///
/// # Errors
/// As [`fit`], except for outliers.
pub fn fit_every(x: &[f64], y: &[f64], z: &[f64], saturation: Option<f64>) -> Result<Ellipsoid, Refusal> {
    fit_points([x, y, z], None, saturation, quadric::RESIDUAL_LIMIT, quadric::Far::Kept)
}

fn fit_points(
    [x, y, z]: [&[f64]; 3],
    field: Option<f64>,
    saturation: Option<f64>,
    limit: f64,
    far: quadric::Far,
) -> Result<Ellipsoid, Refusal> {
    series::positive("residual limit (of the radius)", limit)?;
    if let Some(field) = field {
        series::positive("field", field)?;
    }
    let n = series::channels(&crate::AXES, &[x, y, z])?;
    for (name, values) in crate::AXES.into_iter().zip([x, y, z]) {
        series::unsaturated(name, values, saturation)?;
    }
    let fit = quadric::fit::<3, 9>(&[x, y, z], ("ellipsoid", "hyperboloid"), far).map_err(|refusal| match refusal {
        // The failure of a fit to a nearly planar record is chance. The record lacks the third dimension.
        Refusal::Diverged { .. } | Refusal::NotClosed { .. } | Refusal::Noisy { .. } => {
            flat([x, y, z]).unwrap_or(refusal)
        }
        other => other,
    })?;
    let given = field;
    let (matrix, field) = correction(&fit.surface, given);
    let semi_axes: Vector3<f64> = fit.surface.principal().0.map(|v: f64| v.powf(-0.5));
    let smallest = semi_axes.min();
    let (coverage, one_sidedness) = coverage([x, y, z], &fit.surface.centre, &(matrix / field));
    let poor = |what, value, needed: String| Err(Refusal::Coverage { what, value, needed });
    if coverage.is_nan() || coverage < COVERAGE_LIMIT {
        return poor("evenness of the directions", coverage, format!("at least {COVERAGE_LIMIT}"));
    }
    if fit.rejected as f64 > REJECT_LIMIT * n as f64 {
        return Err(Refusal::TooManyRejected { rejected: fit.rejected, total: n, limit_percent: 100.0 * REJECT_LIMIT });
    }
    let covariance = fit.spread(|surface| {
        let (m, f) = correction(surface, given);
        let axes = surface.principal().0.map(|v: f64| v.powf(-0.5));
        let c = surface.centre;
        [
            c[0],
            c[1],
            c[2],
            m[(0, 0)],
            m[(0, 1)],
            m[(0, 2)],
            m[(1, 1)],
            m[(1, 2)],
            m[(2, 2)],
            f,
            axes[0],
            axes[1],
            axes[2],
        ]
    });
    let sd: [f64; 13] = std::array::from_fn(|k| covariance[(k, k)].max(0.0).sqrt());
    let worst = [0, 1, 2, 10, 11, 12].iter().map(|&k| sd[k]).fold(0.0, f64::max) / smallest;
    if worst.is_nan() || worst > UNCERTAINTY_LIMIT {
        return poor("uncertainty of centre or axes over the radius", worst, format!("at most {UNCERTAINTY_LIMIT}"));
    }
    quadric::step::check(n, "ellipsoid", limit, |i| {
        matrix * (Vector3::new(x[i], y[i], z[i]) - fit.surface.centre) / field
    })?;
    quadric::step::near("ellipsoid", fit.residual_rms / semi_axes.product().cbrt(), limit)?;
    Ok(Ellipsoid {
        centre: fit.surface.centre,
        matrix,
        field,
        residual_relative: fit.residual_rms / semi_axes.product().cbrt(),
        semi_axes,
        coverage,
        one_sidedness,
        condition: fit.condition,
        sigma: fit.sigma,
        rejected: fit.rejected,
        used: fit.used,
        centre_sd: Vector3::new(sd[0], sd[1], sd[2]),
        matrix_sd: Matrix3::new(sd[3], sd[4], sd[5], sd[4], sd[6], sd[7], sd[5], sd[7], sd[8]),
        field_sd: sd[9],
        covariance: covariance.fixed_view::<10, 10>(0, 0).into_owned(),
        dof: fit.used - 9,
    })
}

/// The algebraic fit alone: centre and symmetric matrix of determinant 1. Noise biases it and spikes distort it. It is
/// the start of [`fit`] and the reference for the speed of [`fit`].
///
/// # Errors
/// As [`fit`] for values that are not finite and open surfaces.
pub fn fit_algebraic(x: &[f64], y: &[f64], z: &[f64]) -> Result<(Vector3<f64>, Matrix3<f64>), Refusal> {
    let n = series::channels(&crate::AXES, &[x, y, z])?;
    if n < 36 {
        return Err(Refusal::TooFew { what: "an ellipsoid".to_owned(), got: n, needed: 36 });
    }
    let surface = quadric::algebraic(&[x, y, z]).map_err(|e| Refusal::NotClosed {
        shape: "hyperboloid",
        expected: "ellipsoid",
        detail: format!("eigenvalues of its form {:?}", e.eigenvalues),
    })?;
    Ok((surface.centre, correction(&surface, None).0))
}

/// Least thickness of the cloud of points over its width (roots of the extreme eigenvalues of its covariance). Where a
/// fit fails below this, it lacks coverage.
const FLAT_LIMIT: f64 = 0.3;

fn flat(points: [&[f64]; 3]) -> Option<Refusal> {
    // Outliers stretch a cloud, and more directions would not help against them.
    let middle = points.map(|column| crate::stats::median(&mut column.to_vec()));
    let distance = |i: usize| Vector3::from_fn(|k, _| points[k][i] - middle[k]).norm();
    let usual = crate::stats::median(&mut (0..points[0].len()).map(distance).collect::<Vec<_>>());
    let kept: Vec<usize> = (0..points[0].len()).filter(|&i| distance(i) <= 3.0 * usual).collect();
    let near = points.map(|column| kept.iter().map(|&i| column[i]).collect::<Vec<f64>>());
    let points: [&[f64]; 3] = [&near[0], &near[1], &near[2]];
    let mean = points.map(crate::stats::mean);
    let covariance = Matrix3::from_fn(|a, b| {
        let products = points[a].iter().zip(points[b]).map(|(u, v)| (u - mean[a]) * (v - mean[b]));
        products.sum::<f64>()
    });
    let values = SymmetricEigen::new(covariance).eigenvalues;
    let value = (values.min().max(0.0) / values.max()).sqrt();
    (value < FLAT_LIMIT).then(|| Refusal::Coverage {
        what: "thickness of the cloud of points over its width",
        value,
        needed: format!("at least {FLAT_LIMIT}, unless an ellipsoid fits"),
    })
}

/// Evenness and one-sidedness of the corrected directions.
fn coverage(points: [&[f64]; 3], centre: &Vector3<f64>, matrix: &Matrix3<f64>) -> (f64, f64) {
    let stride = (points[0].len() / 20_000).max(1);
    let mut tensor = Matrix3::zeros();
    let mut mean = Vector3::zeros();
    let mut count = 0.0;
    for k in 0..points[0].len() / stride {
        // The jitter keeps the subset from running in step with the turns.
        let i = k * stride + k % stride;
        let u = matrix * (Vector3::new(points[0][i], points[1][i], points[2][i]) - centre);
        let length = u.norm();
        // The direction of a spike does not count.
        if (0.5..2.0).contains(&length) {
            let u = u / length;
            tensor += u * u.transpose();
            mean += u;
            count += 1.0;
        }
    }
    (3.0 * SymmetricEigen::new(tensor / count).eigenvalues.min(), (mean / count).norm())
}
