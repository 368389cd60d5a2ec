//! Slow changes within a spin of the magnetometer: its figures block by block.
//!
//! A fit to the whole spin contains only white noise. Here each block of the corrected points shows how much its own
//! figures depart from those of the spin. The distances from the circle of radius R are
//! `r - R = p + cx cos t + cy sin t + c cos 2t + s sin 2t` with t the direction of the point. (The fit does not use the
//! angle of the table, so that noise along the circle does not count.) p and (cx, cy) are errors of radius and centre,
//! `2 c / R` is that of ky, `2 s / R` that of alpha. The scatter of the blocks, with the correlation of neighbours, is
//! the type A uncertainty of the spin's figures ([`mean::variance`]).

use nalgebra::{SMatrix, SVector};

use super::mean::{self, BLOCKS, MeanVariance};

/// Departures of a block, in this order: centre of x and y, ky, sine of alpha, radius.
pub(super) const FIGURES: usize = 5;

/// Departures of the blocks of a spin whose points were corrected to a circle about 0. The spin turns steadily at
/// `step_rad` a sample. A block is at least a turn, since in less than a turn the harmonics look alike. The tail is
/// dropped.
pub(super) fn of_spin(corrected: &[(f64, f64)], radius: f64, step_rad: f64) -> Vec<[f64; FIGURES]> {
    let turn = (std::f64::consts::TAU / step_rad.abs()).ceil() as usize;
    let samples = (corrected.len() / BLOCKS).max(turn).max(1);
    corrected.chunks_exact(samples).filter_map(|block| of_block(block, radius)).collect()
}

fn of_block(block: &[(f64, f64)], radius: f64) -> Option<[f64; FIGURES]> {
    let (mut normal, mut right) = (SMatrix::<f64, 5, 5>::zeros(), SVector::<f64, 5>::zeros());
    for (x, y) in block {
        let distance = x.hypot(*y);
        let (cos, sin) = (x / distance, y / distance);
        let row = SVector::<f64, 5>::from([1.0, cos, sin, cos * cos - sin * sin, 2.0 * sin * cos]);
        normal += row * row.transpose();
        right += row * (distance - radius);
    }
    let found = normal.try_inverse()? * right;
    let [p, cx, cy, c, s] = found.into();
    // `sqrt(Qxx)`, the radius that is reported, is the amplitude of x.
    Some([cx, cy, 2.0 * c / radius, 2.0 * s / radius, p + c])
}

/// Fewest blocks of a spin that show the scatter of its figures.
const FEWEST: usize = 8;

/// Variance of each figure of one spin, from the blocks of all spins with enough blocks; `None` where no spin has
/// enough.
pub(super) fn variances(spins: &[&[[f64; FIGURES]]]) -> Option<[MeanVariance; FIGURES]> {
    if spins.iter().all(|blocks| blocks.len() < FEWEST) {
        return None;
    }
    Some(std::array::from_fn(|figure| {
        let records: Vec<Vec<f64>> =
            spins.iter().map(|blocks| blocks.iter().map(|block| block[figure]).collect()).collect();
        mean::variance(&records)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Small errors of a circle are written down by hand. Its blocks show them, to the square of their size.
    #[test]
    fn blocks_show_the_errors_of_a_circle() {
        let (radius, centre, ky, alpha) = (0.42_f64, [1e-5, -2e-5], 1e-4, 3e-4);
        let step_rad = 0.0942;
        let points: Vec<(f64, f64)> = (0..BLOCKS * 500)
            .map(|k| {
                let (sin, cos) = (0.7 - step_rad * k as f64).sin_cos();
                (centre[0] + radius * (cos + alpha * sin), centre[1] + radius * sin / (1.0 + ky))
            })
            .collect();
        let blocks = of_spin(&points, radius, step_rad);
        assert_eq!(blocks.len(), BLOCKS);
        for block in blocks {
            let expected = [centre[0], centre[1], ky, alpha, 0.0];
            assert!(block.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 3e-7), "{block:?}");
        }
    }
}
