//! The temperatures of the sensors during the captures of an item, so that a person sees a drift before it fails the item.

use gnc_protocol::stream::ImuSample;

/// Time over which a temperature is a mean: a thermometer's noise is gone, and a module changes by less than it shows.
const MEAN_S: f64 = 5.0;
/// Counts of a degree.
const PER_DEGREE: f64 = 100.0;

/// A temperature so far, degC.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TemperatureSoFar {
    /// Now.
    pub now_c: f64,
    /// The smallest and the largest so far.
    pub range_c: (f64, f64),
}

impl TemperatureSoFar {
    /// Largest less smallest temperature so far, K: a preview of what the item measures as its drift.
    #[must_use]
    pub fn drift_k(&self) -> f64 {
        self.range_c.1 - self.range_c.0
    }

    fn with(before: Option<Self>, now_c: f64) -> Self {
        let (low, high) = before.map_or((now_c, now_c), |before| before.range_c);
        Self { now_c, range_c: (low.min(now_c), high.max(now_c)) }
    }
}

/// The temperatures of gyroscopes and accelerometers over the captures of an item.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeatView {
    /// Of the gyroscopes.
    pub gyro: TemperatureSoFar,
    /// Of the accelerometers.
    pub accel: TemperatureSoFar,
}

/// Collects the temperatures of captures.
#[derive(Debug, Default)]
pub(crate) struct HeatSoFar {
    /// Sums of both thermometers, and how many samples they are of.
    sums: (i64, i64, usize),
    /// Samples of a mean.
    wanted: usize,
    view: Option<HeatView>,
}

impl HeatSoFar {
    /// Begins a capture at this rate; a mean never goes over two captures.
    pub(crate) fn begin(&mut self, rate_hz: u16) {
        self.wanted = ((MEAN_S * f64::from(rate_hz)) as usize).max(1);
        self.sums = (0, 0, 0);
    }

    /// Takes samples of the present capture.
    pub(crate) fn take(&mut self, samples: &[ImuSample]) {
        for sample in samples {
            let (gyro, accel, count) = &mut self.sums;
            *gyro += i64::from(sample.gyro_temperature);
            *accel += i64::from(sample.accel_temperature);
            *count += 1;
            if *count == self.wanted {
                let mean = |sum: i64| sum as f64 / self.wanted as f64 / PER_DEGREE;
                let (gyro_c, accel_c) = (mean(*gyro), mean(*accel));
                self.view = Some(HeatView {
                    gyro: TemperatureSoFar::with(self.view.map(|view| view.gyro), gyro_c),
                    accel: TemperatureSoFar::with(self.view.map(|view| view.accel), accel_c),
                });
                self.sums = (0, 0, 0);
            }
        }
    }

    /// The temperatures so far; `None` before the first mean.
    pub(crate) fn view(&self) -> Option<HeatView> {
        self.view
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten seconds at 10 Hz: two means of 50 samples, by hand. A second capture that is shorter than a mean adds none.
    #[test]
    fn means_of_five_seconds_and_their_range() {
        let mut heat = HeatSoFar::default();
        heat.begin(10);
        let sample = |gyro, accel| ImuSample { gyro_temperature: gyro, accel_temperature: accel, ..Default::default() };
        heat.take(&vec![sample(3000, 2900); 49]);
        assert_eq!(heat.view(), None);
        // (49 x 30.00 + 35.00) / 50 = 30.10.
        heat.take(&[sample(3500, 2900)]);
        heat.take(&vec![sample(3130, 2890); 50]);
        heat.begin(10);
        heat.take(&vec![sample(9000, 9000); 49]);
        let view = heat.view().expect("two means");
        assert!((view.gyro.now_c - 31.3).abs() < 1e-9 && (view.gyro.drift_k() - 1.2).abs() < 1e-9, "{view:?}");
        assert!((view.accel.now_c - 28.9).abs() < 1e-9 && (view.accel.drift_k() - 0.1).abs() < 1e-9, "{view:?}");
    }
}
