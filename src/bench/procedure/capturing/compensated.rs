//! Compensated samples as a perfect sensor would have given them raw. The checks of motion and range know only raw
//! samples.

use gnc_protocol::calibration::{CompensatedSample, FIELD_PER_GAUSS, FORCE_PER_MPS2, RATE_PER_RPS};
use gnc_protocol::stream::{ACCEL_LSB_PER_G, GYRO_LSB_PER_DPS, ImuSample, MAG_LSB_PER_GAUSS, SATURATION};

/// Metres per second squared of a g.
const G_MPS2: f64 = 9.806_65;

/// Raw counts at nominal scale; a saturated channel stays saturated.
pub(super) fn nominal(sample: &CompensatedSample) -> ImuSample {
    let counts = |values: &[i32; 3], scale: f64, bit: usize| {
        std::array::from_fn(|axis| {
            if sample.saturated & (1 << (bit + axis)) == 0 {
                // Rounded towards the ends of the range, never beyond what the type holds.
                (f64::from(values[axis]) * scale).round() as i32
            } else {
                SATURATION
            }
        })
    };
    ImuSample {
        gyro: counts(&sample.rate, GYRO_LSB_PER_DPS.to_degrees() / RATE_PER_RPS, 0),
        accel: counts(&sample.force, ACCEL_LSB_PER_G / G_MPS2 / FORCE_PER_MPS2, 3),
        mag: counts(&sample.field, MAG_LSB_PER_GAUSS / FIELD_PER_GAUSS, 6),
        gyro_temperature: sample.gyro_temperature,
        accel_temperature: sample.accel_temperature,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_and_gravity_are_told_in_nominal_counts() {
        let sample = CompensatedSample {
            // A quarter of a turn a second; 1 g down along Z; half a gauss.
            rate: [157_079_633, 0, 0],
            force: [0, 0, -9_806_650],
            field: [5_000_000, 0, 0],
            saturated: 0b10,
            ..CompensatedSample::default()
        };
        let told = nominal(&sample);
        assert_eq!((told.gyro, told.accel, told.mag), ([1_800_000, SATURATION, 0], [0, 0, -160_000], [625_000, 0, 0]));
    }
}
