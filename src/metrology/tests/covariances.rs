//! The covariances that the methods report equal those of their estimates over many simulated calibrations.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test may end with a panic and says what it saw"
)]

#[path = "truth/truth.rs"]
mod truth;

use gnc_metrology::position::{LABELS, Position, up_of};
use gnc_metrology::rotation::{self, RotationAxis};
use gnc_metrology::{ellipse, ellipsoid, six_position};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use truth::{Dice, Session, borrowed};

const SEED: u64 = 41;

/// Compares correlations of estimates with those of the mean reported covariance. A correlation over n trials scatters
/// by `1 / sqrt(n)`. The limit is five times that, since there are many pairs.
fn compare(trials: usize, mut trial: impl FnMut(&mut Dice) -> (Vec<f64>, DMatrix<f64>)) {
    println!("seed {SEED}, {trials} trials");
    let mut dice = Dice::new(SEED);
    let runs: Vec<(Vec<f64>, DMatrix<f64>)> = (0..trials).map(|_| trial(&mut dice)).collect();
    let (n, size) = (trials as f64, runs[0].0.len());
    let mean = runs.iter().fold(DVector::zeros(size), |m, r| m + DVector::from_vec(r.0.clone()) / n);
    let (mut found, mut reported) = (DMatrix::zeros(size, size), DMatrix::zeros(size, size));
    for (estimates, covariance) in &runs {
        let error = DVector::from_vec(estimates.clone()) - &mean;
        found += &error * error.transpose() / (n - 1.0);
        reported += covariance / n;
    }
    let mut worst: f64 = 0.0;
    for a in 0..size {
        // The mean of the reported variances equals the variance of the estimates, which scatters by sqrt(2 / n). The
        // limit is 5.7 times that.
        let ratio: f64 = found[(a, a)] / reported[(a, a)];
        assert!((ratio - 1.0).abs() < 8.0 / n.sqrt(), "parameter {a}: variance over reported {ratio}");
        for b in 0..a {
            let correlation = |m: &DMatrix<f64>| m[(a, b)] / f64::sqrt(m[(a, a)] * m[(b, b)]);
            let error = (correlation(&found) - correlation(&reported)).abs();
            worst = worst.max(error);
            assert!(error < 5.0 / n.sqrt(), "{a} {b}: {} {}", correlation(&found), correlation(&reported));
        }
    }
    println!("worst error of a correlation {worst:.4}, limit {:.4}", 5.0 / n.sqrt());
}

fn of_triad(matrix: &Matrix3<f64>, bias: &Vector3<f64>) -> Vec<f64> {
    matrix.transpose().iter().chain(bias.iter()).copied().collect()
}

fn dynamic<const N: usize>(m: &nalgebra::SMatrix<f64, N, N>) -> DMatrix<f64> {
    DMatrix::from_fn(N, N, |r, c| m[(r, c)])
}

#[test]
fn six_positions() {
    // Strong coupling, so that the parameters depend on each other.
    let response = Matrix3::new(200.0, 60.0, -40.0, -50.0, 300.0, 30.0, 20.0, -70.0, 250.0);
    let noise = response.diagonal() * 0.02;
    compare(4000, |dice| {
        let positions: Vec<Position> = LABELS
            .iter()
            .map(|l| {
                let clean = response * up_of(l).unwrap() * 9.8 + Vector3::new(900.0, -500.0, 300.0);
                Position::of_mean(l, Vector3::from_fn(|i, _| clean[i] + noise[i] * dice.normal()), 1).unwrap()
            })
            .collect();
        let c = six_position::calibrate(&positions, 9.8).unwrap();
        (of_triad(&c.matrix, &c.nabla_mps2), dynamic(&c.covariance))
    });
}

#[test]
fn rotations() {
    let session = Session::example();
    compare(600, |dice| {
        let runs = session.runs(dice);
        let c = rotation::calibrate(&borrowed(&runs), &session.options(RotationAxis::Polar)).unwrap();
        (of_triad(&c.matrix, &c.epsilon_rps), dynamic(&c.covariance))
    });
}

#[test]
fn ellipses() {
    compare(1500, |dice| {
        let (x, y) = truth::ellipse_points(300, [3.0, -5.0, 100.0, 60.0, 25.0], 1.0, dice);
        let e = ellipse::fit(&x, &y, None).unwrap();
        let c = &e.correction;
        let figures = [e.centre[0], e.centre[1], e.semi_axes[0], e.semi_axes[1], e.rotation_deg, c.dx, c.dy, c.ky];
        (figures.into_iter().chain([c.sin_alpha]).collect(), dynamic(&e.covariance))
    });
}

#[test]
fn ellipsoids() {
    let directions = truth::directions(300);
    let shape = Matrix3::new(60.0, 5.0, 2.5, 5.0, 45.0, -5.0, 2.5, -5.0, 50.0);
    compare(1500, |dice| {
        let points: Vec<Vector3<f64>> = directions.iter().map(|u| (shape * u).map(|v| v + dice.normal())).collect();
        let [x, y, z] = [0, 1, 2].map(|i| points.iter().map(|p| p[i]).collect::<Vec<f64>>());
        let e = ellipsoid::fit(&x, &y, &z, None, None).unwrap();
        let m = &e.matrix;
        let upper = [m[(0, 0)], m[(0, 1)], m[(0, 2)], m[(1, 1)], m[(1, 2)], m[(2, 2)]];
        (e.centre.iter().copied().chain(upper).chain([e.field]).collect(), dynamic(&e.covariance))
    });
}

/// A point that moves along its normal changes the figures of the next fit as its sensitivity predicts.
#[test]
fn sensitivities_are_those_of_a_second_fit() {
    let mut dice = Dice::new(SEED);
    let shape = Matrix3::new(0.62, 0.05, 0.03, 0.05, 0.45, -0.05, 0.03, -0.05, 0.50);
    let mut points: Vec<Vector3<f64>> =
        truth::directions(60).iter().map(|u| (shape * u).map(|v| v + 1e-3 * dice.normal())).collect();
    let fit = |points: &[Vector3<f64>]| {
        let [x, y, z] = [0, 1, 2].map(|i| points.iter().map(|p| p[i]).collect::<Vec<f64>>());
        ellipsoid::fit_every(&x, &y, &z, None).unwrap()
    };
    let figures = |e: &ellipsoid::Ellipsoid| {
        let (c, m) = (&e.centre, &e.matrix);
        let upper = [m[(0, 0)], m[(0, 1)], m[(0, 2)], m[(1, 1)], m[(1, 2)], m[(2, 2)]];
        [c[0], c[1], c[2], upper[0], upper[1], upper[2], upper[3], upper[4], upper[5], e.field]
    };
    let before = fit(&points);
    for place in [0, 17, 42] {
        let told = before.sensitivity(&points[place]);
        let corrected = before.matrix * (points[place] - before.centre);
        let normal = before.matrix * corrected;
        let (kept, distance) = (points[place], before.distance(&points[place]));
        points[place] += normal / normal.norm() * 1e-3;
        let moved = before.distance(&points[place]) - distance;
        let after = fit(&points);
        let largest = told.amax();
        for (k, (after, before)) in figures(&after).into_iter().zip(figures(&before)).enumerate() {
            let seen = (after - before) / moved;
            assert!((seen - told[k]).abs() < 0.05 * largest, "point {place}, figure {k}: {seen}, told {}", told[k]);
        }
        points[place] = kept;
    }
}

/// A plain fit keeps a point that a robust one rejects.
#[test]
fn every_point_counts() {
    let mut dice = Dice::new(SEED);
    let mut points: Vec<Vector3<f64>> =
        truth::directions(100).iter().map(|u| (u * 50.0).map(|v| v + 0.01 * dice.normal())).collect();
    points[3] *= 1.02;
    let [x, y, z] = [0, 1, 2].map(|i| points.iter().map(|p| p[i]).collect::<Vec<f64>>());
    let (robust, plain) = (ellipsoid::fit(&x, &y, &z, None, None), ellipsoid::fit_every(&x, &y, &z, None));
    assert_eq!((robust.unwrap().rejected, plain.unwrap().rejected), (1, 0));
}
