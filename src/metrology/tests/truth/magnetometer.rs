//! Ellipse and ellipsoid compared with their truth.

use gnc_metrology::{ellipse, ellipsoid, stats};
use nalgebra::{DMatrix, Matrix3, Vector3};

use super::{Dice, Estimate, Tally, covariance, derivatives};

/// Points of an ellipse at even angles, with noise.
pub fn ellipse_points(
    n: usize,
    [cx, cy, a, b, rotation_deg]: [f64; 5],
    noise: f64,
    dice: &mut Dice,
) -> (Vec<f64>, Vec<f64>) {
    let (sin, cos) = rotation_deg.to_radians().sin_cos();
    (0..n)
        .map(|k| {
            // 0.618 of a turn between samples would hide the order, so there are 23.7 samples per turn, as from a
            // table.
            let (s, c) = (k as f64 * std::f64::consts::TAU / 23.7).sin_cos();
            let (u, v) = (a * c, b * s);
            (cx + u * cos - v * sin + noise * dice.normal(), cy + u * sin + v * cos + noise * dice.normal())
        })
        .unzip()
}

/// Ellipse with unknown angles: its parameters and the correction.
pub fn ellipse(trials: usize, seed: u64) -> Tally {
    let n = 1000;
    let shape: [f64; 5] = [3.0, -5.0, 100.0, 80.0, 25.0];
    // The noise is large enough for an uncorrected bias of the radius (noise^2 / 2 R) to stand out of the short run
    // too.
    let noise = 2.0;
    let figures = |p: &[f64]| -> Vec<f64> {
        let (sin, cos) = p[4].to_radians().sin_cos();
        let (xx, yy) = ((p[2] * cos).powi(2) + (p[3] * sin).powi(2), (p[2] * sin).powi(2) + (p[3] * cos).powi(2));
        let xy = (p[2] * p[2] - p[3] * p[3]) * sin * cos;
        vec![p[0], p[1], p[2], p[3], p[4], (xx / yy).sqrt(), xy / (xx * yy).sqrt()]
    };
    // With unknown angles only the normal component of a point gives information about the curve.
    let mut rows = Vec::new();
    for k in 0..n {
        let (s, c) = (k as f64 * std::f64::consts::TAU / 23.7).sin_cos();
        let point = |p: &[f64]| {
            let (sin, cos) = p[4].to_radians().sin_cos();
            let (u, v) = (p[2] * c, p[3] * s);
            vec![p[0] + u * cos - v * sin, p[1] + u * sin + v * cos]
        };
        let (sin, cos) = shape[4].to_radians().sin_cos();
        let (u, v) = (shape[3] * c, shape[2] * s);
        let normal = [u * cos - v * sin, u * sin + v * cos];
        let length = normal[0].hypot(normal[1]);
        let d = derivatives(&shape, &point);
        rows.push(
            (0..5).map(|p| (normal[0] * d[(0, p)] + normal[1] * d[(1, p)]) / length / noise).collect::<Vec<f64>>(),
        );
    }
    let weighted = DMatrix::from_fn(n, 5, |r, c| rows[r][c]);
    let jacobian = derivatives(&shape, &figures);
    let bound =
        (&jacobian * covariance(&weighted) * jacobian.transpose()).diagonal().iter().map(|v| v.sqrt()).collect();
    let names = ["cx", "cy", "major", "minor", "rotation", "ky", "sin_alpha"].map(str::to_owned).to_vec();
    Tally::run("ellipse", trials, seed, names, figures(&shape), bound, |dice| {
        let (x, y) = ellipse_points(n, shape, noise, dice);
        let e = ellipse::fit(&x, &y, None).unwrap();
        let factor = stats::coverage_factor(0.95, e.dof as f64);
        [
            (e.centre[0], e.sd.centre[0]),
            (e.centre[1], e.sd.centre[1]),
            (e.semi_axes[0], e.sd.semi_axes[0]),
            (e.semi_axes[1], e.sd.semi_axes[1]),
            (e.rotation_deg, e.sd.rotation_deg),
            (e.correction.ky, e.sd.correction.ky),
            (e.correction.sin_alpha, e.sd.correction.sin_alpha),
        ]
        .map(|(value, sd)| Estimate { value, sd, factor })
        .to_vec()
    })
}

/// Even directions on the sphere (Fibonacci lattice).
pub fn directions(n: usize) -> Vec<Vector3<f64>> {
    (0..n)
        .map(|k| {
            let z = 1.0 - (2.0 * k as f64 + 1.0) / n as f64;
            let r = (1.0 - z * z).sqrt();
            let (s, c) = (k as f64 * 2.399_963_229_728_653).sin_cos();
            Vector3::new(r * c, r * s, z)
        })
        .collect()
}

/// Ellipsoid: centre, symmetric matrix of determinant 1 and field.
pub fn ellipsoid(trials: usize, seed: u64) -> Tally {
    let n = 1000;
    let noise = 1.0;
    let symmetric = |p: &[f64]| Matrix3::new(p[0], p[1], p[2], p[1], p[3], p[4], p[2], p[4], p[5]);
    // Points are c + W u, so the matrix is W^-1 det(W)^(1/3) and the field det(W)^(1/3).
    let shape: [f64; 9] = [60.0, 5.0, 2.5, 45.0, -5.0, 50.0, 10.0, 20.0, -30.0];
    let figures = |p: &[f64]| -> Vec<f64> {
        let w = symmetric(p);
        let field = w.determinant().cbrt();
        let m = w.try_inverse().unwrap() * field;
        vec![p[6], p[7], p[8], m[(0, 0)], m[(0, 1)], m[(0, 2)], m[(1, 1)], m[(1, 2)], m[(2, 2)], field]
    };
    let u = directions(n);
    let w = symmetric(&shape);
    let inverse = w.try_inverse().unwrap();
    let rows: Vec<Vec<f64>> = u
        .iter()
        .map(|u| {
            let normal = (inverse * u).normalize();
            let point = |p: &[f64]| (symmetric(p) * u + Vector3::new(p[6], p[7], p[8])).iter().copied().collect();
            let d = derivatives(&shape, &point);
            (0..9).map(|p| (0..3).map(|i| normal[i] * d[(i, p)]).sum::<f64>() / noise).collect()
        })
        .collect();
    let weighted = DMatrix::from_fn(n, 9, |r, c| rows[r][c]);
    let jacobian = derivatives(&shape, &figures);
    let bound =
        (&jacobian * covariance(&weighted) * jacobian.transpose()).diagonal().iter().map(|v| v.sqrt()).collect();
    let names = ["cx", "cy", "cz", "m00", "m01", "m02", "m11", "m12", "m22", "field"].map(str::to_owned).to_vec();
    let clean: Vec<Vector3<f64>> = u.iter().map(|u| w * u + Vector3::new(shape[6], shape[7], shape[8])).collect();
    Tally::run("ellipsoid", trials, seed, names, figures(&shape), bound, |dice| {
        let p: Vec<Vector3<f64>> = clean.iter().map(|p| p.map(|v| v + noise * dice.normal())).collect();
        let [x, y, z] = [0, 1, 2].map(|i| p.iter().map(|p| p[i]).collect::<Vec<f64>>());
        let e = ellipsoid::fit(&x, &y, &z, None, None).unwrap();
        let factor = stats::coverage_factor(0.95, e.dof as f64);
        let (m, s) = (&e.matrix, &e.matrix_sd);
        let upper = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        let centre = (0..3).map(|i| (e.centre[i], e.centre_sd[i]));
        centre
            .chain(upper.into_iter().map(|ij| (m[ij], s[ij])))
            .chain([(e.field, e.field_sd)])
            .map(|(value, sd)| Estimate { value, sd, factor })
            .collect()
    })
}
