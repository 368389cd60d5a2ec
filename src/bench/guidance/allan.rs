//! Allan deviations that grow with the samples. They use all samples and keep a few numbers for each octave of the
//! averaging time.
//!
//! Disjoint deviation (Riley, *Handbook of Frequency Stability Analysis*, NIST SP 1065, equation 7), which needs no
//! record: for each averaging time it keeps only the newest mean and the sum so far. The analysis later takes the
//! overlapping deviation over the whole record, which is smoother at long times.

use gnc_protocol::stream::{ACCEL_LSB_PER_G, GYRO_LSB_PER_DPS, ImuSample};

/// Octaves of the averaging time: 2^32 samples are longer than any capture.
const OCTAVES: usize = 32;
/// Fewest differences for a deviation to be shown. With fewer, it may be wrong by half.
const FEWEST: u64 = 4;

/// Deviations of the three gyroscopes and the three accelerometers so far, at nominal scale.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AllanView {
    /// Averaging time in seconds and deviation in deg/h, for each axis.
    pub gyro_dph: [Vec<(f64, f64)>; 3],
    /// The same in mg.
    pub accel_mg: [Vec<(f64, f64)>; 3],
}

/// The means of one averaging time.
#[derive(Debug, Clone, Copy, Default)]
struct Octave {
    /// The first of two means that together give a mean of twice the time.
    half: Option<f64>,
    /// The previous mean.
    before: Option<f64>,
    squares: f64,
    differences: u64,
}

/// The deviations of one channel.
#[derive(Debug, Clone, Default)]
struct Channel {
    octaves: Vec<Octave>,
    /// The first value. It is subtracted from every value, so that an offset costs no digits.
    first: Option<f64>,
}

impl Channel {
    fn take(&mut self, value: f64) {
        let mut mean = value - *self.first.get_or_insert(value);
        for level in 0..OCTAVES {
            if self.octaves.len() == level {
                self.octaves.push(Octave::default());
            }
            let octave = &mut self.octaves[level];
            if let Some(before) = octave.before.replace(mean) {
                octave.squares += (mean - before) * (mean - before);
                octave.differences += 1;
            }
            match octave.half.take() {
                Some(half) => mean = f64::midpoint(half, mean),
                None => {
                    octave.half = Some(mean);
                    return;
                }
            }
        }
    }

    /// Averaging times in samples, and deviations.
    fn deviations(&self) -> impl Iterator<Item = (f64, f64)> {
        let each = self.octaves.iter().enumerate().filter(|(_, octave)| octave.differences >= FEWEST);
        each.map(|(level, octave)| {
            let samples = (1_u64 << level) as f64;
            (samples, (octave.squares / (2.0 * octave.differences as f64)).sqrt())
        })
    }
}

/// Collects the deviations of a still capture.
#[derive(Debug)]
pub struct AllanSoFar {
    rate_hz: f64,
    gyro: [Channel; 3],
    accel: [Channel; 3],
}

impl AllanSoFar {
    /// A collector without samples at this rate.
    #[must_use]
    pub fn new(rate_hz: u16) -> Self {
        Self { rate_hz: f64::from(rate_hz.max(1)), gyro: Default::default(), accel: Default::default() }
    }

    /// Takes the next samples.
    pub fn take(&mut self, samples: &[ImuSample]) {
        for sample in samples {
            for axis in 0..3 {
                self.gyro[axis].take(f64::from(sample.gyro[axis]));
                self.accel[axis].take(f64::from(sample.accel[axis]));
            }
        }
    }

    /// The curve so far.
    #[must_use]
    pub fn look(&self) -> AllanView {
        let curves = |channels: &[Channel; 3], scale: f64| {
            channels.each_ref().map(|channel| {
                channel.deviations().map(|(samples, dev)| (samples / self.rate_hz, dev * scale)).collect()
            })
        };
        AllanView {
            gyro_dph: curves(&self.gyro, 3600.0 / GYRO_LSB_PER_DPS),
            accel_mg: curves(&self.accel, 1e3 / ACCEL_LSB_PER_G),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gnc_metrology::allan::{DeviationKind, Input, Taus, analyse};

    /// The deviations that grow sample by sample equal those of the whole record. The metrology's own tests check the
    /// latter against an outside program.
    #[test]
    fn the_same_as_of_the_whole_record() {
        // Noise and a walk from a linear congruence (Knuth, MMIX). Their kind does not matter; both ways must only
        // agree.
        let mut state = 20_u64;
        let mut dice = |width: f64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5) * width
        };
        let mut walk = 0.0;
        let samples: Vec<ImuSample> = (0..5000)
            .map(|_| {
                walk += dice(60.0);
                let mut noisy = || (60_000.0 + walk + dice(1600.0)) as i32;
                ImuSample { gyro: [noisy(), noisy(), 0], accel: [0, 0, noisy()], ..ImuSample::default() }
            })
            .collect();
        let mut so_far = AllanSoFar::new(200);
        samples.chunks(17).for_each(|frame| so_far.take(frame));
        let found = so_far.look();
        let record = |pick: &dyn Fn(&ImuSample) -> i32, scale: f64| {
            let values: Vec<f64> = samples.iter().map(|sample| f64::from(pick(sample)) * scale).collect();
            analyse(&values, Input::Rate, 200.0, DeviationKind::Adev, &Taus::Octave, 1).expect("deviations").points
        };
        let check = |curve: &[(f64, f64)], points: &[gnc_metrology::allan::DeviationPoint]| {
            // At 512 samples 9 means have 8 differences, at 1024 samples 4 means have 3: too few.
            assert_eq!(curve.len(), 10, "{curve:?}");
            for ((tau_s, dev), point) in curve.iter().zip(points) {
                assert!((tau_s - point.tau_s).abs() < 1e-12, "{tau_s} {point:?}");
                assert!((dev / point.dev - 1.0).abs() < 1e-9, "{dev} {point:?}");
            }
        };
        check(&found.gyro_dph[1], &record(&|sample| sample.gyro[1], 3600.0 / 20_000.0));
        check(&found.accel_mg[2], &record(&|sample| sample.accel[2], 1e3 / 160_000.0));
    }

    #[test]
    fn too_little_is_not_shown() {
        let mut so_far = AllanSoFar::new(200);
        so_far.take(&vec![ImuSample::default(); 4]);
        assert!(so_far.look().gyro_dph.iter().all(Vec::is_empty));
        so_far.take(&[ImuSample::default()]);
        assert_eq!(so_far.look().gyro_dph[0], [(0.005, 0.0)]);
    }
}
