//! Still attitudes, and the effect of errors of positions on the parameters fitted to them.

use gnc_metrology::stats;
use nalgebra::{DMatrix, Matrix4, Vector3};

use super::FigureError;
use super::captures::{self, AXES, Triad};
use super::mean::{self, BLOCKS, MeanVariance};
use crate::capture::Capture;

/// A capture of a module that lies still.
#[derive(Debug)]
pub(super) struct Attitude<'c> {
    pub(super) capture: &'c Capture,
    /// Unit vector that points up, in module axes.
    pub(super) up: Vector3<f64>,
    /// Heading of the reference axis.
    pub(super) heading_deg: f64,
}

/// Returns the still attitudes among the captures, and checks that they are sound and still. `expected` is 6, 12 or 24,
/// with each axis up and down equally often and each attitude once; `None` for any.
pub(super) fn attitudes<'c>(
    captures: impl IntoIterator<Item = &'c Capture>,
    expected: Option<usize>,
    triad: Triad,
) -> Result<Vec<Attitude<'c>>, FigureError> {
    let mut found: Vec<Attitude<'c>> = Vec::new();
    for capture in captures {
        let crate::capture::Pose::Still { up, heading_deg } = capture.about.pose else { continue };
        let (up, label) = (Vector3::from(up), || capture.about.label.clone());
        if !((up.norm() - 1.0).abs() < 1e-3 && heading_deg.is_finite()) {
            return Err(FigureError::Unfit { label: label(), why: "its up direction is no unit vector".into() });
        }
        let up = up.normalize();
        let same = |other: &&Attitude<'_>| {
            let turned = (other.heading_deg - heading_deg + 180.0).rem_euclid(360.0) - 180.0;
            (other.up - up).norm() < 1e-3 && turned.abs() < 1.0
        };
        if let Some(other) = found.iter().find(same) {
            let why = format!("it is the same attitude as {}", other.capture.about.label);
            return Err(FigureError::Unfit { label: label(), why });
        }
        captures::sound([capture], &[triad])?;
        captures::still(capture, triad)?;
        found.push(Attitude { capture, up, heading_deg });
    }
    if let Some(expected) = expected {
        complete(&found, expected)?;
    }
    Ok(found)
}

fn complete(found: &[Attitude<'_>], expected: usize) -> Result<(), FigureError> {
    for (axis, name) in AXES.iter().enumerate() {
        for (sign, factor) in [("+", 1.0), ("-", -1.0)] {
            let there = found.iter().filter(|attitude| attitude.up[axis] * factor > 0.99).count();
            let needed = expected / 6;
            if there < needed {
                let what = format!("position {name}{sign}: {there} of {needed}");
                return Err(FigureError::Missing { what });
            }
        }
    }
    Ok(())
}

/// The design of `output = response * (gravity * up) + offset`. Parameters 0 to 2 are a row of the response, 3 is the
/// offset.
#[derive(Debug)]
pub(super) struct Design {
    /// Parameters per output: (X'X)^-1 X'.
    hat: DMatrix<f64>,
    rows: DMatrix<f64>,
    pub(super) cofactor: Matrix4<f64>,
    pub(super) ups: Vec<Vector3<f64>>,
}

impl Design {
    /// Creates the design; `None` where the attitudes do not determine the parameters.
    pub(super) fn new(ups: Vec<Vector3<f64>>, gravity_mps2: f64) -> Option<Self> {
        let rows = DMatrix::from_fn(ups.len(), 4, |p, k| if k < 3 { gravity_mps2 * ups[p][k] } else { 1.0 });
        let normal: Matrix4<f64> = (rows.transpose() * &rows).fixed_view::<4, 4>(0, 0).into();
        let cofactor = normal.try_inverse()?;
        let hat = DMatrix::from_fn(4, ups.len(), |k, p| (0..4).map(|c| cofactor[(k, c)] * rows[(p, c)]).sum());
        Some(Self { hat, rows, cofactor, ups })
    }

    /// Returns the variance of a parameter from independent errors of the positions.
    pub(super) fn variance(&self, parameter: usize, of_position: impl Fn(usize) -> f64) -> f64 {
        (0..self.ups.len()).map(|p| self.hat[(parameter, p)].powi(2) * of_position(p)).sum()
    }

    /// Returns the change of a parameter from known errors of the positions.
    pub(super) fn shift(&self, parameter: usize, of_position: impl Fn(usize) -> f64) -> f64 {
        (0..self.ups.len()).map(|p| self.hat[(parameter, p)] * of_position(p)).sum()
    }

    /// Returns the expected sum of squared residuals of one sensor, for independent variances of the positions.
    pub(super) fn left_over(&self, of_position: impl Fn(usize) -> f64) -> f64 {
        // Residuals are (1 - X hat) errors.
        let n = self.ups.len();
        let project = |a: usize, b: usize| (0..4).map(|k| self.rows[(a, k)] * self.hat[(k, b)]).sum::<f64>();
        (0..n)
            .map(|p| {
                (0..n).map(|a| (f64::from(u8::from(a == p)) - project(a, p)).powi(2)).sum::<f64>() * of_position(p)
            })
            .sum()
    }

    /// Returns the variance of axis `i` in a position, in (m/s^2)^2, from errors of attitude of `pose_rad` about each
    /// axis. It is 0 (to first order) on the axis that is vertical.
    pub(super) fn of_pose(&self, i: usize, gravity_mps2: f64, pose_rad: f64) -> impl Fn(usize) -> f64 + '_ {
        move |p| (gravity_mps2 * pose_rad).powi(2) * (1.0 - self.ups[p][i].powi(2)).max(0.0)
    }
}

/// Variance of the mean of a position, pooled over the positions; square counts.
pub(super) fn scatter(attitudes: &[Attitude<'_>], triad: Triad) -> [MeanVariance; 3] {
    let blocks: Vec<Vec<Vector3<f64>>> = attitudes
        .iter()
        .map(|attitude| captures::block_means(attitude.capture, triad, attitude.capture.samples.len() / BLOCKS))
        .collect();
    [0, 1, 2].map(|axis| {
        let records: Vec<Vec<f64>> =
            blocks.iter().map(|record| record.iter().map(|mean| mean[axis]).collect()).collect();
        mean::variance(&records)
    })
}

/// Ratio of residuals to their expectation that chance gives once in a thousand good calibrations: the quantile of F
/// for the degrees of freedom of the residuals and of the noise that they are compared with (Wilson and Hilferty).
pub(super) fn rare_ratio(dof: f64, noise: &[MeanVariance]) -> f64 {
    const RARE: f64 = 0.999;
    let z = stats::normal_quantile(RARE);
    let a = 2.0 / (9.0 * dof);
    let b = 2.0 / (9.0 * noise.iter().map(|noise| noise.dof).sum::<f64>());
    let root = ((1.0 - a).powi(2) * b + (1.0 - b).powi(2) * a - a * b * z * z).sqrt();
    (((1.0 - a) * (1.0 - b) + z * root) / ((1.0 - b).powi(2) - b * z * z)).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// F tables: the 99.9 % point for 6 and 45 degrees of freedom is 4.61, for 6 and 30 it is 5.12.
    #[test]
    fn quantiles_of_f() {
        let noise = |dof: f64| [MeanVariance { variance: 1.0, dof: dof / 3.0 }; 3];
        assert!((rare_ratio(6.0, &noise(45.0)) - 4.61).abs() < 0.05, "{}", rare_ratio(6.0, &noise(45.0)));
        assert!((rare_ratio(6.0, &noise(30.0)) - 5.12).abs() < 0.06, "{}", rare_ratio(6.0, &noise(30.0)));
    }
}
