//! The algebraic fit: the start of the geometric one.

#![allow(clippy::needless_range_loop, reason = "vectors of several arrays are walked together by one index")]

use nalgebra::{DMatrix, DVector, SMatrix, SVector, SymmetricEigen};
use wide::f64x4;

use super::block::{self, Frame, GROUPS};
use super::{Columns, NotPositive, Surface};

/// Columns of the design: the form by rows of its upper triangle, coordinates, 1. In space there are ten.
const MOST: usize = 10;
/// Different products of two columns: 35 in space, monomials up to the fourth degree.
const MOMENTS: usize = 35;

/// The moment of the product of each pair of columns, and a pair of columns for each moment.
struct Products {
    index: [[usize; MOST]; MOST],
    pairs: Vec<(usize, usize)>,
}

impl Products {
    fn of<const D: usize>() -> Self {
        // Exponents of each column.
        let mut columns: Vec<[u8; 3]> = Vec::new();
        let unit = |d: usize| std::array::from_fn::<u8, 3, _>(|k| u8::from(k == d));
        let sum = |a: [u8; 3], b: [u8; 3]| std::array::from_fn::<u8, 3, _>(|k| a[k] + b[k]);
        (0..D).for_each(|a| (a..D).for_each(|b| columns.push(sum(unit(a), unit(b)))));
        columns.extend((0..D).map(unit));
        columns.push([0; 3]);
        let (mut index, mut pairs, mut seen) = ([[0; MOST]; MOST], Vec::new(), Vec::new());
        for a in 0..columns.len() {
            for b in a..columns.len() {
                let monomial = sum(columns[a], columns[b]);
                let k = seen.iter().position(|s| *s == monomial).unwrap_or_else(|| {
                    seen.push(monomial);
                    pairs.push((a, b));
                    pairs.len() - 1
                });
                (index[a][b], index[b][a]) = (k, k);
            }
        }
        Self { index, pairs }
    }
}

/// Least squares of the quadric with unit norm of its form, over the points inside twice the box of the record.
///
/// The columns' products are summed (many of them are the same monomial) and the problem is solved from these sums. In
/// the frame of the record all columns are of the order of 1 and, on a closed surface that is covered, independent:
/// their condition number is some tens, squared in the sums, so some 12 digits are left. A test compares this with
/// singular values of the whole design.
pub(super) fn surface<const D: usize>(points: &Columns<D>, frame: &Frame<D>) -> Result<Surface<D>, NotPositive> {
    let squares = D * (D + 1) / 2;
    let unknowns = squares + D + 1;
    let Products { index, pairs } = Products::of::<D>();
    let mut sums = [f64x4::ZERO; MOMENTS];
    let bound: SVector<f64, D> = frame.half * (2.0 / frame.scale);
    block::walk(points, frame, |u, keep| {
        let mut row = [[f64x4::ZERO; GROUPS]; MOST];
        for g in 0..GROUPS {
            let mut keep = keep[g];
            for d in 0..D {
                keep &= u[d][g].abs().simd_le(f64x4::splat(bound[d]));
            }
            let mut c = 0;
            for a in 0..D {
                let kept = u[a][g] * keep;
                row[squares + a][g] = kept;
                for b in a..D {
                    row[c][g] = kept * u[b][g];
                    c += 1;
                }
            }
            row[unknowns - 1][g] = keep;
        }
        for (sum, &(a, b)) in sums.iter_mut().zip(&pairs) {
            *sum = block::add_product(*sum, &row[a], &row[b]);
        }
    });
    let moments = sums.map(f64x4::reduce_add);
    // The factor sqrt 2 on products of different coordinates makes the norm of the form that of the columns.
    let mut factors = [1.0; MOST];
    let mut c = 0;
    for a in 0..D {
        for b in a..D {
            factors[c] = if a == b { 1.0 } else { std::f64::consts::SQRT_2 };
            c += 1;
        }
    }
    let part = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
        DMatrix::from_fn(rows.len(), columns.len(), |r, c| {
            let (a, b) = (rows.start + r, columns.start + c);
            moments[index[a][b]] * factors[a] * factors[b]
        })
    };
    let failed = || NotPositive { eigenvalues: vec![0.0; D] };
    // For a given form the best coordinates and constant follow linearly; the rest is an eigenvalue problem.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The same problem, solved by singular values of the whole design, which lose no accuracy in sums.
    fn by_singular_values(points: &[[f64; 3]], frame: &Frame<3>) -> Surface<3> {
        let root = std::f64::consts::SQRT_2;
        let design = DMatrix::from_fn(points.len(), 10, |r, c| {
            let u: [f64; 3] = std::array::from_fn(|d| (points[r][d] - frame.middle[d]) / frame.scale);
            match c {
                0 => 1.0,
                1..4 => u[c - 1],
                4..7 => u[c - 4] * u[c - 4],
                _ => root * u[(c - 7) / 2] * u[(c - 6).min(2)],
            }
        });
        // Orthogonal elimination of the coordinates and the constant, then the least singular vector of the rest.
        let r = design.qr().r();
        let svd = r.view((4, 4), (6, 6)).into_owned().svd(false, true);
        let v = svd.v_t.unwrap().row(svd.singular_values.imin()).transpose();
        let rest = -r.view((0, 0), (4, 4)).into_owned().solve_upper_triangular(&(r.view((0, 4), (4, 6)) * &v)).unwrap();
        let form = SMatrix::<f64, 3, 3>::new(
            v[0],
            v[3] / root,
            v[4] / root,
            v[3] / root,
            v[1],
            v[5] / root,
            v[4] / root,
            v[5] / root,
            v[2],
        );
        let centre = form.try_inverse().unwrap() * SVector::<f64, 3>::new(rest[1], rest[2], rest[3]) * -0.5;
        let level = (centre.transpose() * form * centre)[0] - rest[0];
        Surface { centre, form: form / level }
    }

    #[test]
    fn sums_of_products_are_as_good_as_singular_values() {
        // From points all around to a band a third as high as wide, far from the origin, each with its own noise.
        for (height, noise) in [(1.0, 0.0), (1.0, 1.0), (0.3, 0.1)] {
            let points: Vec<[f64; 3]> = (0..1003)
                .map(|k| {
                    let k = f64::from(k);
                    let z = height * (2.0 * (k * 0.618_034).fract() - 1.0);
                    let (s, c) = (k * 2.4).sin_cos();
                    let r = (1.0 - z * z).sqrt() * (1.0 + 0.01 * noise * (k * 12.9898).sin());
                    [4e4 + 60.0 * r * c, -3e4 + 45.0 * r * s + 5.0 * r * c, 50.0 * z - 2e4]
                })
                .collect();
            let columns: [Vec<f64>; 3] = std::array::from_fn(|d| points.iter().map(|p| p[d]).collect());
            let columns: Columns<3> = std::array::from_fn(|d| columns[d].as_slice());
            let frame = Frame::of(&columns, &(0..points.len()).collect::<Vec<_>>());
            let (found, expected) = (surface(&columns, &frame).unwrap(), by_singular_values(&points, &frame));
            let error =
                (found.form - expected.form).norm() / expected.form.norm() + (found.centre - expected.centre).norm();
            assert!(error < 1e-10, "height {height}, noise {noise}: {error:e}");
        }
    }
}
