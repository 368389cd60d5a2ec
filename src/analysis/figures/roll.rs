//! Roll angle from a corrected field, compared with a table that turns steadily.
//!
//! The effect of the sensor's noise, white and slow, on the harmonics of the angle shows in their scatter from block to
//! block ([`mean::variance`]). The effect of an error of the correction is in the harmonics themselves.

use nalgebra::{SMatrix, SVector};

use super::mean::{self, BLOCKS, MeanVariance};

/// Roll of a spin: the errors beside a steady turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Roll {
    /// Rate of the steady turn, rad/s, right-handed.
    pub(super) rate_rps: f64,
    /// Turns in the record, with their sign.
    pub(super) turns: f64,
    /// Amplitude of the error once and twice a turn, rad.
    pub(super) harmonics_rad: [f64; 2],
    /// Variance of each of the two components of a harmonic, rad^2.
    pub(super) noise: [MeanVariance; 2],
}

/// Fewest blocks that show the scatter of the harmonics.
const FEWEST: usize = 8;

/// Computes the roll, `roll = atan2(-y', x')`: the field turns against the module. `points` are corrected, `step_rad`
/// is the turn expected from sample to sample.
pub(super) fn analyse(points: impl Iterator<Item = (f64, f64)>, step_rad: f64, rate_hz: f64) -> Roll {
    let mut before: Option<f64> = None;
    let unwrapped: Vec<f64> = points
        .map(|(x, y)| {
            let angle = (-y).atan2(x);
            let turned = match before {
                None => angle,
                Some(last) => {
                    let expected = last + step_rad;
                    angle + ((expected - angle) / std::f64::consts::TAU).round() * std::f64::consts::TAU
                }
            };
            before = Some(turned);
            turned
        })
        .collect();
    let n = unwrapped.len() as f64;
    let first = unwrapped.first().copied().unwrap_or(0.0);
    // Time runs from -1 to 1 and the mean rate is removed, so that the normal equations are well scaled.
    let slope = (unwrapped.last().copied().unwrap_or(0.0) - first) / (n - 1.0);
    let row = |k: usize, angle: f64| {
        let (sin, cos) = angle.sin_cos();
        let t = 2.0 * k as f64 / (n - 1.0) - 1.0;
        SVector::<f64, 6>::from([1.0, t, cos, sin, cos * cos - sin * sin, 2.0 * sin * cos])
    };
    let left = |k: usize, angle: f64| angle - first - slope * k as f64;
    let (mut normal, mut right) = (SMatrix::<f64, 6, 6>::zeros(), SVector::<f64, 6>::zeros());
    for (k, &angle) in unwrapped.iter().enumerate() {
        let row = row(k, angle);
        normal += row * row.transpose();
        right += row * left(k, angle);
    }
    let solution = normal.lu().solve(&right).unwrap_or_else(|| SVector::repeat(f64::NAN));
    let residuals: Vec<(f64, f64)> = unwrapped
        .iter()
        .enumerate()
        .map(|(k, &angle)| (angle, left(k, angle) - row(k, angle).dot(&solution)))
        .collect();
    let rate_rps = (slope + 2.0 * solution[1] / (n - 1.0)) * rate_hz;
    Roll {
        rate_rps,
        turns: rate_rps * n / rate_hz / std::f64::consts::TAU,
        harmonics_rad: [solution[2].hypot(solution[3]), solution[4].hypot(solution[5])],
        noise: noise(&residuals, step_rad),
    }
}

/// Variances of the harmonics' components from the angles and their residuals. With too few blocks only white noise is
/// known.
fn noise(residuals: &[(f64, f64)], step_rad: f64) -> [MeanVariance; 2] {
    // In less than a turn the harmonics look alike.
    let turn = (std::f64::consts::TAU / step_rad.abs()).ceil() as usize;
    let samples = (residuals.len() / BLOCKS).max(turn).max(1);
    let blocks: Vec<[f64; 4]> = residuals.chunks_exact(samples).filter_map(of_block).collect();
    if blocks.len() < FEWEST {
        let n = residuals.len() as f64;
        let square = residuals.iter().map(|(_, left)| left * left).sum::<f64>() / n;
        return [MeanVariance { variance: 2.0 * square / n, dof: n }; 2];
    }
    [0, 1].map(|harmonic| {
        let component = |k: usize| blocks.iter().map(|block| block[2 * harmonic + k]).collect::<Vec<f64>>();
        mean::variance(&[component(0), component(1)])
    })
}

/// Returns cosine and sine of the first harmonic, then of the second.
fn of_block(residuals: &[(f64, f64)]) -> Option<[f64; 4]> {
    let (mut normal, mut right) = (SMatrix::<f64, 5, 5>::zeros(), SVector::<f64, 5>::zeros());
    for (angle, left) in residuals {
        let (sin, cos) = angle.sin_cos();
        let row = SVector::<f64, 5>::from([1.0, cos, sin, cos * cos - sin * sin, 2.0 * sin * cos]);
        normal += row * row.transpose();
        right += row * *left;
    }
    let [_, first_cos, first_sin, second_cos, second_sin] = (normal.try_inverse()? * right).into();
    Some([first_cos, first_sin, second_cos, second_sin])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The document's numbers: without the division by cos(alpha) a second harmonic of alpha^2 / 4 stays, 0.023 deg at
    /// 2.3 deg and 0.109 deg at 5 deg; the wrong sign of alpha gives 2.3 deg.
    #[test]
    fn what_a_bad_correction_leaves() {
        let second = |alpha_deg: f64, correct: &dyn Fn(f64, f64, f64) -> (f64, f64)| {
            let alpha = alpha_deg.to_radians();
            let points = (0..5000).map(|k| {
                let (sin, cos) = (f64::from(k) * 0.1).sin_cos();
                // A field that turns backwards; x holds sin(alpha) of y.
                let (x, y) = (cos * alpha.cos() - sin * alpha.sin(), -sin);
                correct(x, y, alpha.sin())
            });
            analyse(points, 0.1, 1000.0)
        };
        let complete = |x: f64, y: f64, s: f64| ((x - y * s) / (1.0 - s * s).sqrt(), y);
        let printed = |x: f64, y: f64, s: f64| (x - y * s, y);
        let wrong = |x: f64, y: f64, s: f64| ((x + y * s) / (1.0 - s * s).sqrt(), y);
        let good = second(5.0, &complete);
        assert!(good.harmonics_rad[1] < 1e-9 && (good.rate_rps - 100.0).abs() < 1e-6, "{good:?}");
        for (alpha_deg, left_deg) in [(2.3, 0.023), (5.0, 0.109)] {
            let found = second(alpha_deg, &printed).harmonics_rad[1].to_degrees();
            assert!((found - left_deg).abs() < 0.001, "{alpha_deg}: {found}");
        }
        let found = second(2.3, &wrong).harmonics_rad[1].to_degrees();
        assert!((found - 2.3).abs() < 0.05, "{found}");
    }
}
