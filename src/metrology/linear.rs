//! Linear least squares by singular values of the column-scaled design.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, SMatrix, Vector3, Vector4};

use crate::Refusal;

/// Largest condition number of the scaled design. Above it no bench's data determine the parameters.
pub(crate) const CONDITION_LIMIT: f64 = 1e4;

/// Solution of `design * x = data` for each column of the data.
pub(crate) struct LeastSquares {
    /// Parameters, one column for each column of the data.
    pub(crate) solution: DMatrix<f64>,
    /// `data - design * solution`.
    pub(crate) residuals: DMatrix<f64>,
    /// `(design' design)^-1`: times the noise variance, the covariance of a column of the solution.
    pub(crate) cofactor: DMatrix<f64>,
    /// Largest error of each parameter where every row of the data is off by 1, with the signs that give most.
    pub(crate) reach: DVector<f64>,
    /// Condition number of the design with columns scaled to unit length.
    pub(crate) condition: f64,
}

/// # Errors
/// [`Refusal::IllConditioned`] when the columns of the design are (nearly) dependent.
pub(crate) fn least_squares(
    what: &'static str,
    design: &DMatrix<f64>,
    data: &DMatrix<f64>,
) -> Result<LeastSquares, Refusal> {
    let scale: Vec<f64> = design.column_iter().map(|c| c.norm()).collect();
    let refuse = |condition| Refusal::IllConditioned { what, condition, limit: CONDITION_LIMIT };
    if scale.iter().any(|s| !(s.is_finite() && *s > 0.0)) || design.nrows() < design.ncols() {
        return Err(refuse(f64::INFINITY));
    }
    let mut scaled = design.clone();
    for (mut column, s) in scaled.column_iter_mut().zip(&scale) {
        column /= *s;
    }
    let svd = scaled.svd(true, true);
    let (Some(u), Some(vt)) = (&svd.u, &svd.v_t) else { return Err(refuse(f64::INFINITY)) };
    let condition = svd.singular_values.max() / svd.singular_values.min();
    if condition.is_nan() || condition > CONDITION_LIMIT {
        return Err(refuse(condition));
    }
    // V diag(1/s), rows divided by the scale of their column.
    let mut half = vt.transpose();
    for (mut column, s) in half.column_iter_mut().zip(svd.singular_values.iter()) {
        column /= *s;
    }
    for (mut row, s) in half.row_iter_mut().zip(&scale) {
        row /= *s;
    }
    let solution = &half * (u.transpose() * data);
    let inverse = &half * u.transpose();
    let reach = DVector::from_iterator(inverse.nrows(), inverse.row_iter().map(|row| row.abs().sum()));
    let residuals = data - design * &solution;
    Ok(LeastSquares { solution, residuals, cofactor: &half * half.transpose(), reach, condition })
}

/// Covariance of the twelve parameters of an inverted triad: the matrix by rows, then the bias.
pub type TriadCovariance = SMatrix<f64, 12, 12>;

/// Covariance of an inverted triad (delta method). For `output = M input + b`, `K = M^-1` and a bias `v = -+K b` it is
/// `d[K v]_ij = -sum_s K_is (dM_s, db_s) k_j` up to signs, with k_j column j of K (and a 0), or `(v, 1)` for the bias. The
/// sensors s are independent of each other, with covariances C_s in `[M_s b_s]`.
pub(crate) fn inverse_covariance(
    inverse: &Matrix3<f64>,
    bias: &Vector4<f64>,
    covariance: &[Matrix4<f64>; 3],
) -> TriadCovariance {
    let column = |j: usize| if j < 3 { inverse.column(j).push(0.0) } else { *bias };
    // Parameter p is row i and column j of [K v].
    let place = |p: usize| if p < 9 { (p / 3, p % 3) } else { (p - 9, 3) };
    SMatrix::from_fn(|p, q| {
        let ((i, j), (k, l)) = (place(p), place(q));
        (0..3).map(|s| inverse[(i, s)] * inverse[(k, s)] * (column(j).transpose() * covariance[s] * column(l))[0]).sum()
    })
}

/// Standard uncertainties of the matrix and the bias.
pub(crate) fn standard_uncertainties(covariance: &TriadCovariance) -> (Matrix3<f64>, Vector3<f64>) {
    let sd = |p: usize| covariance[(p, p)].max(0.0).sqrt();
    (Matrix3::from_fn(|i, j| sd(3 * i + j)), Vector3::from_fn(|i, _| sd(9 + i)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_three_points() {
        let design = DMatrix::from_row_slice(3, 2, &[1.0, 1e6, 2.0, 1e6, 3.0, 1e6]);
        let data = DMatrix::from_row_slice(3, 1, &[2.0, 3.0, 4.0]);
        let fit = least_squares("a line", &design, &data).unwrap();
        assert!((fit.solution[0] - 1.0).abs() < 1e-12 && (fit.solution[1] - 1e-6).abs() < 1e-17);
        // Textbook: var(slope) = 1 / sum (x - mean)^2.
        assert!((fit.cofactor[(0, 0)] - 0.5).abs() < 1e-12);
        assert!(fit.residuals.norm() < 1e-12);
    }

    #[test]
    fn dependent_columns_are_refused() {
        let design = DMatrix::from_row_slice(3, 2, &[1.0, 2.0, 2.0, 4.0, 3.0, 6.0]);
        let data = DMatrix::from_element(3, 1, 1.0);
        assert!(matches!(least_squares("a line", &design, &data), Err(Refusal::IllConditioned { .. })));
    }
}
