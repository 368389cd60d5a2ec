//! Captures as the figures use them: sound channels, exact means, temperatures.

use gnc_executive::catalogue::{MeasurementSpec, PerTriad};
use gnc_executive::quantity::Unit;
pub(super) use gnc_metrology::AXES;
use gnc_protocol::stream::{ACCEL_LSB_PER_G, GYRO_LSB_PER_DPS, ImuSample, MAG_LSB_PER_GAUSS, SATURATION};
use nalgebra::Vector3;

use super::{AnalysisInput, FigureError};
use crate::capture::{Capture, Pose};

/// Parts of a still capture. Their means are compared to detect motion.
const MOTION_BLOCKS: usize = 8;
/// Limit of the spread of block means of an accelerometer at rest: 2 mrad of pose.
const MOTION_G: f64 = 2e-3;
/// Limit of the spread of block means of a gyroscope at rest. A hand on the table gives far more, the bias of the part
/// less.
const MOTION_DPS: f64 = 0.05;

/// Three sensors of one kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Triad {
    Gyro,
    Accel,
    Mag,
}

impl Triad {
    pub(super) fn name(self) -> &'static str {
        match self {
            Triad::Gyro => "gyro",
            Triad::Accel => "accel",
            Triad::Mag => "mag",
        }
    }

    /// Returns the measurements of this triad. No kind has one for the magnetometer, which counts as accelerometers here.
    pub(super) fn of<const N: usize>(self, measurements: &PerTriad<N>) -> &[MeasurementSpec; N] {
        match self {
            Triad::Gyro => &measurements.gyro,
            Triad::Accel | Triad::Mag => &measurements.accel,
        }
    }

    /// Nominal counts per deg/s, g, gauss.
    pub(super) fn lsb(self) -> f64 {
        match self {
            Triad::Gyro => GYRO_LSB_PER_DPS,
            Triad::Accel => ACCEL_LSB_PER_G,
            Triad::Mag => MAG_LSB_PER_GAUSS,
        }
    }

    pub(super) fn codes_mut(self, sample: &mut ImuSample) -> &mut [i32; 3] {
        match self {
            Triad::Gyro => &mut sample.gyro,
            Triad::Accel => &mut sample.accel,
            Triad::Mag => &mut sample.mag,
        }
    }

    pub(super) fn codes(self, sample: &ImuSample) -> &[i32; 3] {
        match self {
            Triad::Gyro => &sample.gyro,
            Triad::Accel => &sample.accel,
            Triad::Mag => &sample.mag,
        }
    }
}

/// Checks that nothing is missing from the captures, and that the triads that are used neither saturate nor stand
/// still.
pub(super) fn sound<'c>(captures: impl IntoIterator<Item = &'c Capture>, triads: &[Triad]) -> Result<(), FigureError> {
    for capture in captures {
        let label = || capture.about.label.clone();
        if capture.losses.any() {
            return Err(FigureError::Lost { label: label(), losses: capture.losses });
        }
        if capture.samples.len() < MOTION_BLOCKS {
            return Err(FigureError::Short { label: label(), samples: capture.samples.len(), needed: MOTION_BLOCKS });
        }
        for triad in triads {
            for (axis, name) in AXES.iter().enumerate() {
                let codes = || capture.samples.iter().map(|sample| triad.codes(sample)[axis]);
                let samples = codes().filter(|code| code.unsigned_abs() >= SATURATION.unsigned_abs()).count();
                let channel = format!("{} {name}", triad.name());
                if samples > 0 {
                    return Err(FigureError::Saturated { label: label(), channel, samples });
                }
                let first = triad.codes(&capture.samples[0])[axis];
                if codes().all(|code| code == first) {
                    return Err(FigureError::Stuck { label: label(), channel, code: first });
                }
            }
        }
    }
    Ok(())
}

/// Checks that the module lay still: the means of parts of the capture agree.
pub(super) fn still(capture: &Capture, triad: Triad) -> Result<(), FigureError> {
    let limit = match triad {
        Triad::Gyro => MOTION_DPS,
        Triad::Accel => MOTION_G,
        Triad::Mag => return Ok(()),
    };
    let blocks = block_means(capture, triad, capture.samples.len() / MOTION_BLOCKS);
    for (axis, name) in AXES.iter().enumerate() {
        let values: Vec<f64> = blocks.iter().map(|mean| mean[axis] / triad.lsb()).collect();
        let spread = values.iter().copied().fold(f64::MIN, f64::max) - values.iter().copied().fold(f64::MAX, f64::min);
        let raw: Vec<f64> = capture.samples.iter().map(|sample| f64::from(triad.codes(sample)[axis])).collect();
        // Short parts of a noisy sensor spread without motion.
        let noise = gnc_metrology::stats::white_sd(&raw) / triad.lsb();
        let limit = limit.max(6.0 * noise * (MOTION_BLOCKS as f64 / raw.len() as f64).sqrt());
        if spread > limit {
            let (label, channel) = (capture.about.label.clone(), format!("{} {name}", triad.name()));
            return Err(FigureError::Moved { label, channel, spread, limit });
        }
    }
    Ok(())
}

/// Means of disjoint parts of `samples` samples, in counts. The tail is dropped. Sums are whole numbers, so exact.
pub(super) fn block_means(capture: &Capture, triad: Triad, samples: usize) -> Vec<Vector3<f64>> {
    capture.samples.chunks_exact(samples.max(1)).map(|part| mean_of(part, triad)).collect()
}

/// Mean of the whole capture, in counts.
pub(super) fn mean(capture: &Capture, triad: Triad) -> Vector3<f64> {
    mean_of(&capture.samples, triad)
}

fn mean_of(samples: &[ImuSample], triad: Triad) -> Vector3<f64> {
    let mut sums = [0_i64; 3];
    for sample in samples {
        for (sum, code) in sums.iter_mut().zip(triad.codes(sample)) {
            *sum += i64::from(*code);
        }
    }
    Vector3::from_fn(|axis, _| sums[axis] as f64 / samples.len() as f64)
}

/// One channel in counts.
pub(super) fn channel(capture: &Capture, triad: Triad, axis: usize) -> Vec<f64> {
    capture.samples.iter().map(|sample| f64::from(triad.codes(sample)[axis])).collect()
}

/// Mean temperature, and the largest less the smallest mean of a part of a capture (an eighth), degC.
pub(super) fn temperature<'c>(captures: impl IntoIterator<Item = &'c Capture>, triad: Triad) -> (f64, f64) {
    let (mut low, mut high, mut sum, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0_i64, 0_usize);
    for capture in captures {
        for part in capture.samples.chunks_exact((capture.samples.len() / MOTION_BLOCKS).max(1)) {
            let total: i64 = part
                .iter()
                .map(|sample| match triad {
                    Triad::Gyro => i64::from(sample.gyro_temperature),
                    Triad::Accel | Triad::Mag => i64::from(sample.accel_temperature),
                })
                .sum();
            let mean = total as f64 / part.len() as f64 / 100.0;
            (low, high) = (low.min(mean), high.max(mean));
            (sum, count) = (sum + total, count + part.len());
        }
    }
    (sum as f64 / count as f64 / 100.0, high - low)
}

/// Still captures with their up direction and heading.
pub(super) fn lying(captures: &[Capture]) -> impl Iterator<Item = (&Capture, Vector3<f64>, f64)> {
    captures.iter().filter_map(|capture| match capture.about.pose {
        Pose::Still { up, heading_deg } => Some((capture, Vector3::from(up), heading_deg)),
        _ => None,
    })
}

impl AnalysisInput<'_> {
    /// Returns the only capture. Where the item captures by itself, it must be as long as the parameter `span` says.
    pub(super) fn one(&self, span: &str) -> Result<&Capture, FigureError> {
        let capture =
            self.captures.first().ok_or_else(|| FigureError::Missing { what: "the module at rest".into() })?;
        if !matches!(self.params.source("of"), Ok(Some(_))) {
            self.long_enough(capture, span)?;
        }
        Ok(capture)
    }

    /// Checks that a capture is as long as the plan says.
    pub(super) fn long_enough(&self, capture: &Capture, span: &str) -> Result<(), FigureError> {
        let needed = (self.params.quantity(span, Unit::Second)? * f64::from(capture.about.rate_hz)).floor() as usize;
        let samples = capture.samples.len();
        if samples < needed {
            return Err(FigureError::Short { label: capture.about.label.clone(), samples, needed });
        }
        Ok(())
    }
}
