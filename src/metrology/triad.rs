//! Properties of three axes from a response matrix: coupling, angles between the axes, and how they sit in the fixture.
//!
//! Rows of a response are sensors, columns are axes of the fixture, as in the whole crate.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use crate::Refusal;

/// Response of sensor i to axis j relative to its own axis, `M_ij / M_ii`. (Not `K_ij / K_ii` of the compensation,
/// which is wrong by the ratio of the gains.) The coupling also contains a turn of the module in the fixture.
#[must_use]
pub fn coupling(response: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| response[(i, j)] / response[(i, i)])
}

/// Departures of the angles between the sensing axes xy, xz, yz from 90 degrees, rad (positive: less than 90). A turned
/// fixture does not change them.
#[must_use]
pub fn nonorthogonality_rad(response: &Matrix3<f64>) -> Vector3<f64> {
    let row = |i: usize| response.row(i).normalize();
    Vector3::new(row(0).dot(&row(1)).asin(), row(0).dot(&row(2)).asin(), row(1).dot(&row(2)).asin())
}

/// The factors of a response: `response = diag(scale) * stretch * rotation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decomposition {
    /// Length of each row: the scale factor of each sensor along its own sensing axis.
    pub scale: Vector3<f64>,
    /// Symmetric and positive: the non-orthogonality, shared evenly by the axes.
    pub stretch: Matrix3<f64>,
    /// Right-handed rotation from the axes of the fixture to the nearest right-angled axes of the sensors.
    pub rotation: Matrix3<f64>,
    /// The same rotation as a rotation vector (axis times angle), rad: how the module sits in the fixture.
    pub rotation_rad: Vector3<f64>,
}

/// Polar decomposition of a response with its rows at unit length.
///
/// # Errors
/// [`Refusal::IllConditioned`] for a response whose rows do not span space, are not finite or left-handed.
pub fn decompose(response: &Matrix3<f64>) -> Result<Decomposition, Refusal> {
    const LIMIT: f64 = 1e4;
    let refuse = |condition| Refusal::IllConditioned { what: "the polar decomposition", condition, limit: LIMIT };
    let scale = Vector3::from_fn(|i, _| response.row(i).norm());
    if !scale.iter().all(|s| s.is_finite() && *s > 0.0) {
        return Err(refuse(f64::INFINITY));
    }
    let unit = Matrix3::from_fn(|i, j| response[(i, j)] / scale[i]);
    let eigen = SymmetricEigen::new(unit * unit.transpose());
    let roots = eigen.eigenvalues.map(|v: f64| v.max(0.0).sqrt());
    let condition = roots.max() / roots.min();
    if condition.is_nan() || condition > LIMIT || unit.determinant() <= 0.0 {
        return Err(refuse(condition));
    }
    let of =
        |values: Vector3<f64>| eigen.eigenvectors * Matrix3::from_diagonal(&values) * eigen.eigenvectors.transpose();
    let rotation = of(roots.map(|v| 1.0 / v)) * unit;
    Ok(Decomposition { scale, stretch: of(roots), rotation, rotation_rad: rotation_vector(&rotation) })
}

/// Axis times angle of a rotation matrix whose transpose turns the axes, rad.
fn rotation_vector(rotation: &Matrix3<f64>) -> Vector3<f64> {
    // The matrix takes coordinates from the fixture to the sensors, so it turns vectors backwards.
    nalgebra::Rotation3::from_matrix_unchecked(rotation.transpose()).scaled_axis()
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;

    /// The decomposition returns the known scale, angles and seat of a triad, and the seat alone changes no angle
    /// between the axes.
    #[test]
    fn a_triad_taken_apart() {
        let (scale, angle) = (Vector3::new(2000.0, 3000.0, 2500.0), 2e-3_f64);
        // y leans towards x by the angle.
        let axes = Matrix3::new(1.0, 0.0, 0.0, angle.sin(), angle.cos(), 0.0, 0.0, 0.0, 1.0);
        let seat = Vector3::new(0.3, -0.2, 0.5);
        let seated = axes * Rotation3::new(seat).matrix().transpose();
        let response = Matrix3::from_diagonal(&scale) * seated;
        let expected = Vector3::new(angle, 0.0, 0.0);
        assert!((nonorthogonality_rad(&(Matrix3::from_diagonal(&scale) * axes)) - expected).norm() < 1e-12);
        assert!((nonorthogonality_rad(&response) - expected).norm() < 1e-12);
        let d = decompose(&response).unwrap();
        assert!((d.scale - scale).norm() < 1e-9);
        assert!((Matrix3::from_diagonal(&d.scale) * d.stretch * d.rotation - response).norm() < 1e-9);
        assert!((d.rotation * d.rotation.transpose() - Matrix3::identity()).norm() < 1e-12);
        assert!((d.stretch - d.stretch.transpose()).norm() < 1e-12 && (d.stretch[(0, 1)] - angle / 2.0).abs() < 1e-8);
        // Each of the two axes takes half of the lean, so the triad as a whole is turned by half of it.
        let apart = Rotation3::new(d.rotation_rad) * Rotation3::new(seat).inverse();
        assert!((apart.angle() - angle / 2.0).abs() < 1e-6, "{apart}");
        assert_eq!(coupling(&response)[(1, 0)], response[(1, 0)] / response[(1, 1)]);
    }

    /// A socket turned by 0.1 deg alone couples by 1.75e-3 and leaves the angles alone.
    #[test]
    fn a_turned_socket() {
        let seated = Rotation3::new(Vector3::new(0.0, 0.0, 0.1_f64.to_radians())).matrix().transpose();
        assert!((coupling(&seated)[(0, 1)].abs() - 1.745e-3).abs() < 1e-6);
        assert!(nonorthogonality_rad(&seated).norm() < 1e-15);
        assert!((decompose(&seated).unwrap().rotation_rad[2] - 0.1_f64.to_radians()).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_triad_is_refused() {
        for bad in [
            Matrix3::zeros(),
            Matrix3::new(1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            -Matrix3::identity(),
            Matrix3::repeat(f64::NAN),
        ] {
            assert!(matches!(decompose(&bad), Err(Refusal::IllConditioned { .. })), "{bad}");
        }
    }
}
