//! What changes slowly within a spin of the magnetometer: its figures block by block.
//!
//! A fit to the whole spin knows white noise alone. Here each block of a spin gives the centre and, from the first
//! harmonic of the turn, the amplitudes of both axes and the angle between them: `x = cx + ax cos t + bx sin t`, y alike.
//! Then `radius = |(ax, bx)|`, `ky = |(ax, bx)| / |(ay, by)|`, and `sin(alpha)` is the cosine between the two, as `Q` of the
//! ellipse is half their Gram matrix. The scatter of the blocks, with the correlation of neighbours, is the type A
//! uncertainty of the spin's figures ([`mean::variance`]).

use nalgebra::{Matrix3, Vector3};

use super::mean::{self, BLOCKS, MeanVariance};

/// Figures of a block or their variances, in this order: centre of x and y, ky, sine of alpha, radius.
pub(super) const FIGURES: usize = 5;

/// Figures of the blocks of a spin that turns steadily at `step_rad` a sample; the tail is dropped. A block is a turn at
/// least: in less the harmonic and the centre look alike.
pub(super) fn of_spin(x: &[f64], y: &[f64], step_rad: f64) -> Vec<[f64; FIGURES]> {
    let turn = (std::f64::consts::TAU / step_rad.abs()).ceil() as usize;
    let samples = (x.len() / BLOCKS).max(turn).max(1);
    let block = |(index, (x, y)): (usize, (&[f64], &[f64]))| {
        // The angle goes on from block to block, so that neighbours are alike in everything but noise.
        of_block(x, y, step_rad, (index * samples) as f64)
    };
    x.chunks_exact(samples).zip(y.chunks_exact(samples)).enumerate().filter_map(block).collect()
}

fn of_block(x: &[f64], y: &[f64], step_rad: f64, first: f64) -> Option<[f64; FIGURES]> {
    let (mut normal, mut right) = (Matrix3::zeros(), [Vector3::zeros(); 2]);
    for (k, (x, y)) in x.iter().zip(y).enumerate() {
        let (sin, cos) = ((first + k as f64) * step_rad).sin_cos();
        let row = Vector3::new(1.0, cos, sin);
        normal += row * row.transpose();
        right[0] += row * *x;
        right[1] += row * *y;
    }
    let inverse = normal.try_inverse()?;
    let [x, y] = right.map(|right| inverse * right);
    let [wave_x, wave_y] = [x, y].map(|fit| fit.fixed_rows::<2>(1).into_owned());
    let (radius, other) = (wave_x.norm(), wave_y.norm());
    Some([x[0], y[0], radius / other, wave_x.dot(&wave_y) / (radius * other), radius])
}

/// Fewest blocks of a spin that say how its figures scatter.
const FEWEST: usize = 8;

/// Variance of each figure of one spin, from the blocks of all spins that have enough of them; `None` where none has.
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

    /// An ellipse written down by hand: its figures are those of its definition, whatever the phase of a block.
    #[test]
    fn blocks_of_an_ellipse_have_its_figures() {
        let (alpha, ky, radius): (f64, f64, f64) = (1.5_f64.to_radians(), 1.03, 0.42);
        let step_rad = 0.0942;
        let points = |k: usize| {
            let (sin, cos) = (0.7 - step_rad * k as f64).sin_cos();
            (0.02 + radius * (cos * alpha.cos() + sin * alpha.sin()), -0.014 + radius * sin / ky)
        };
        let (x, y): (Vec<f64>, Vec<f64>) = (0..BLOCKS * 500).map(points).unzip();
        let blocks = of_spin(&x, &y, step_rad);
        assert_eq!(blocks.len(), BLOCKS);
        for block in blocks {
            let expected = [0.02, -0.014, ky, alpha.sin(), radius];
            assert!(block.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-9), "{block:?}");
        }
    }
}
