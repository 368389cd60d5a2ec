//! The data gate on captures. It finds the samples that are no measurements, measures their share as a property of the
//! module and its link, and replaces them.
//!
//! A sample that is left out is replaced from its neighbours, so that the other samples keep their times. In a still
//! capture noise like that beside it replaces the sample, in a moving capture the line between the neighbours. The
//! number of such samples is measured.

use std::borrow::Cow;

use gnc_executive::catalogue::{FAILED_READS, ItemId, SPIKES, STALE_SAMPLES};
use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_metrology::Refusal;
use gnc_metrology::gate::{LeftOut, RecordLayout, RowFault, RowMeaning, Screening, one_stretch};
use gnc_protocol::calibration::CompensatedSample;
use gnc_protocol::stream::{ImuSample, SATURATION};
use serde_json::json;

use super::captures::{AXES, Triad};
use super::{AnalysisInput, FigureError, Findings};
use crate::capture::{Capture, Pose};

/// Names of the measurements, in the order of the catalogue.
pub const NAMES: [&str; 3] = [FAILED_READS.name, STALE_SAMPLES.name, SPIKES.name];
/// Key of the details.
pub const KEY: &str = "gate";

/// The result of the gate on a set of captures.
pub(super) struct Integrity<'c> {
    /// The captures as they are analysed.
    pub(super) captures: Cow<'c, [Capture]>,
    /// The refusal of the first capture that cannot be used.
    pub(super) refused: Option<FigureError>,
    left_out: LeftOut,
    samples: usize,
    /// The first capture that holds such a sample, and its number from 1.
    first: Option<(String, usize)>,
}

/// Returns the shares of bad samples in the captures of an item. They are judged also beside a refusal: a fault of the
/// module stays its fault where there is no figure.
#[must_use]
pub fn integrity(item: ItemId, question: &AnalysisInput<'_>) -> Vec<(&'static str, Value)> {
    Integrity::of(item, question).measured()
}

/// Returns the shares of bad samples, percent, in the order of [`NAMES`].
fn shares(left_out: &LeftOut, samples: usize) -> [f64; 3] {
    [left_out.failed_reads, left_out.stale, left_out.spikes].map(|count| count as f64 * 100.0 / samples.max(1) as f64)
}

impl<'c> Integrity<'c> {
    pub(super) fn of(item: ItemId, question: &AnalysisInput<'c>) -> Self {
        let mut found = Self {
            captures: Cow::Borrowed(question.captures),
            refused: None,
            left_out: LeftOut::default(),
            samples: 0,
            first: None,
        };
        for (index, capture) in question.captures.iter().enumerate() {
            let triads = used(item, question, capture);
            let still = matches!(capture.about.pose, Pose::Still { .. });
            if !triads.is_empty() && !capture.samples.is_empty() {
                let parts: Vec<(Triad, Screening)> =
                    triads.iter().map(|triad| (*triad, screen(&capture.samples, *triad, still))).collect();
                found.take(capture, parts.iter().map(|(triad, part)| (triad.name(), part)));
                for (triad, part) in parts.iter().filter(|(_, part)| part.left_out().total() > 0) {
                    let mended = mend(&mut found.captures.to_mut()[index].samples, *triad, part, still);
                    found.keep(capture, triad.name(), mended);
                }
            }
            if item == ItemId::CalibrationCheck && !capture.compensated.is_empty() {
                let parts = [Output::Rate, Output::Force].map(|of| (of, screen_compensated(&capture.compensated, of)));
                found.take(capture, parts.iter().map(|(of, part)| (of.name(), part)));
                for (of, part) in parts.iter().filter(|(_, part)| part.left_out().total() > 0) {
                    let mended = mend_compensated(&mut found.captures.to_mut()[index].compensated, *of, part, still);
                    found.keep(capture, of.name(), mended);
                }
            }
        }
        found
    }

    fn take<'s>(&mut self, capture: &Capture, parts: impl Iterator<Item = (&'static str, &'s Screening)>) {
        let mut whole: Option<Screening> = None;
        for (name, part) in parts {
            self.keep(capture, name, part.admit(RowMeaning::ClockedSteps));
            whole = Some(match whole {
                Some(whole) => whole.and(part.clone()),
                None => part.clone(),
            });
        }
        let Some(whole) = whole else { return };
        let LeftOut { failed_reads, spikes, stale, clipped } = whole.left_out();
        self.left_out.failed_reads += failed_reads;
        self.left_out.spikes += spikes;
        self.left_out.stale += stale;
        self.left_out.clipped += clipped;
        self.samples += whole.rows();
        if let Some(row) = whole.first_row() {
            self.first.get_or_insert((capture.about.label.clone(), row));
        }
    }

    /// Keeps the first refusal.
    fn keep(&mut self, capture: &Capture, name: &str, done: Result<(), Refusal>) {
        if let Err(refusal) = done {
            let place = format!("{}, {name}", capture.about.label);
            self.refused.get_or_insert(FigureError::Refused { place, refusal });
        }
    }

    /// Returns the three shares; nothing where nothing was captured.
    pub(super) fn measured(&self) -> Vec<(&'static str, Value)> {
        if self.samples == 0 {
            return Vec::new();
        }
        let shares = shares(&self.left_out, self.samples);
        NAMES.into_iter().zip(shares).map(|(name, share)| (name, Value::number(share, Unit::Percent))).collect()
    }

    /// Adds shares and counts to the findings of an analysis.
    pub(super) fn file(&self, findings: &mut Findings) {
        findings.measured.extend(self.measured());
        if self.samples == 0 {
            return;
        }
        let LeftOut { failed_reads, spikes, stale, clipped } = self.left_out;
        findings.detail(
            KEY,
            json!({
                "used": self.samples - self.left_out.total(),
                "left_out": { "failed_reads": failed_reads, "spikes": spikes, "stale": stale, "clipped": clipped },
                "first": self.first.as_ref().map(|(label, row)| json!({ "capture": label, "sample": row })),
            }),
        );
    }
}

/// Returns the triads of a capture that an item works with.
fn used(item: ItemId, question: &AnalysisInput<'_>, capture: &Capture) -> Vec<Triad> {
    let wanted = |sensor: &str| question.params.choices("sensors").is_ok_and(|list| list.contains(&sensor));
    let still = matches!(capture.about.pose, Pose::Still { .. });
    match item {
        ItemId::SixPosition | ItemId::AccelBias => vec![Triad::Accel],
        ItemId::GyroStill | ItemId::Rotation => vec![Triad::Gyro],
        ItemId::GyroBias => vec![Triad::Gyro, Triad::Accel],
        // The gyroscopes' g-sensitivity is subtracted with the force that the accelerometers measure.
        ItemId::BiasStability | ItemId::BiasRepeatability | ItemId::Resolution | ItemId::Allan | ItemId::Psd => {
            if wanted("gyro") {
                vec![Triad::Gyro, Triad::Accel]
            } else {
                vec![Triad::Accel]
            }
        }
        ItemId::ScaleFactorRepeatability | ItemId::CrossCoupling => match still {
            true if wanted("accel") => vec![Triad::Accel],
            false if wanted("gyro") => vec![Triad::Gyro],
            _ => Vec::new(),
        },
        ItemId::MagnetometerEllipse | ItemId::MagnetometerEllipsoid => vec![Triad::Mag],
        _ => Vec::new(),
    }
}

/// Returns the samples at rest without those in which gyroscopes or accelerometers are bad, and the shares of bad
/// samples, percent, in the order of [`NAMES`]. The magnetometer's bad samples count too. A magnetometer that never
/// changes is missing or dead, and has no share; the items that turn it report it.
#[must_use]
pub fn sound_at_rest(samples: &[ImuSample]) -> (Vec<ImuSample>, [f64; 3]) {
    let [gyro, accel] = [Triad::Gyro, Triad::Accel].map(|triad| screen(samples, triad, true));
    let inertial = gyro.and(accel);
    let sound = samples.iter().enumerate().filter(|(row, _)| !left_out(inertial.fault(*row)));
    let sound = sound.map(|(_, sample)| sample.clone()).collect();
    let measures_field = samples.windows(2).any(|pair| pair[0].mag != pair[1].mag);
    let whole = if measures_field { inertial.and(screen(samples, Triad::Mag, true)) } else { inertial };
    (sound, shares(whole.left_out(), samples.len()))
}

/// Whether a sample is left out. A clipped sample stays, since saturation and noise of the channel report it.
fn left_out(fault: Option<RowFault>) -> bool {
    !matches!(fault, None | Some(RowFault::Clipped))
}

/// Screens one triad, which is one chip.
fn screen(samples: &[ImuSample], triad: Triad, still: bool) -> Screening {
    let channels =
        [0, 1, 2].map(|axis| samples.iter().map(|sample| f64::from(triad.codes(sample)[axis])).collect::<Vec<f64>>());
    screen_channels(&channels, still, Some(f64::from(SATURATION)))
}

fn screen_channels(channels: &[Vec<f64>; 3], still: bool, range_end: Option<f64>) -> Screening {
    let layout = RecordLayout { blocks: &one_stretch(channels[0].len()), still, range_end };
    Screening::of(&AXES, &[&channels[0], &channels[1], &channels[2]], &layout)
}

/// Returns the values of one channel, with replacements for samples that are left out.
fn mended(axis: usize, values: &[f64], part: &Screening, still: bool) -> Result<Vec<f64>, Refusal> {
    let blocks = one_stretch(values.len());
    if still { Ok(part.refilled(values, &blocks)) } else { part.bridged(AXES[axis], values, &blocks) }
}

fn mend(samples: &mut [ImuSample], triad: Triad, part: &Screening, still: bool) -> Result<(), Refusal> {
    for axis in 0..3 {
        let values: Vec<f64> = samples.iter().map(|sample| f64::from(triad.codes(sample)[axis])).collect();
        for (row, value) in
            mended(axis, &values, part, still)?.into_iter().enumerate().filter(|(row, _)| !part.keeps(*row))
        {
            triad.codes_mut(&mut samples[row])[axis] = value.round() as i32;
        }
    }
    Ok(())
}

/// A compensated output of the board.
#[derive(Debug, Clone, Copy)]
enum Output {
    Rate,
    Force,
}

impl Output {
    fn name(self) -> &'static str {
        match self {
            Self::Rate => "rate",
            Self::Force => "force",
        }
    }

    fn of(self, sample: &CompensatedSample) -> &[i32; 3] {
        match self {
            Self::Rate => &sample.rate,
            Self::Force => &sample.force,
        }
    }
}

fn screen_compensated(samples: &[CompensatedSample], of: Output) -> Screening {
    let channels =
        [0, 1, 2].map(|axis| samples.iter().map(|sample| f64::from(of.of(sample)[axis])).collect::<Vec<f64>>());
    screen_channels(&channels, false, None)
}

fn mend_compensated(
    samples: &mut [CompensatedSample],
    of: Output,
    part: &Screening,
    still: bool,
) -> Result<(), Refusal> {
    for axis in 0..3 {
        let values: Vec<f64> = samples.iter().map(|sample| f64::from(of.of(sample)[axis])).collect();
        for (row, value) in
            mended(axis, &values, part, still)?.into_iter().enumerate().filter(|(row, _)| !part.keeps(*row))
        {
            let value = value.round() as i32;
            match of {
                Output::Rate => samples[row].rate[axis] = value,
                Output::Force => samples[row].force[axis] = value,
            }
        }
    }
    Ok(())
}
