//! The wander of biases: within an hour, and from power-on to power-on. On compensated data.

use std::collections::BTreeMap;

use gnc_executive::catalogue::performance::{BIAS_REPEATABILITY_SD, BIAS_STABILITY_SD};
use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_executive::uncertainty::Uncertainty;
use gnc_metrology::{earth, stability, stats};
use nalgebra::Vector3;
use serde_json::json;

use super::calibration::{Force, ModuleCalibration, RateModel};
use super::captures::{self, AXES, Triad};
use super::six_position::temperatures;
use super::{AnalysisInput, FigureError, Findings, mean};
use crate::capture::Capture;
use crate::details::performance::{BLOCK_S, BlockMeans, SERIES};

/// Compensation of the triads that the plan wants.
pub(super) struct Compensation {
    force: Force,
    rate: Option<RateModel>,
    pub(super) triads: Vec<Triad>,
}

impl Compensation {
    pub(super) fn of(question: &AnalysisInput<'_>) -> Result<Self, FigureError> {
        let sensors = question.params.choices("sensors")?;
        let calibration = ModuleCalibration::of(question.earlier)?;
        let gyro = sensors.contains(&"gyro");
        let mut triads = Vec::new();
        triads.extend(gyro.then_some(Triad::Gyro));
        triads.extend(sensors.contains(&"accel").then_some(Triad::Accel));
        let rate = if gyro { Some(calibration.rate()?) } else { None };
        Ok(Self { force: calibration.force()?, rate, triads })
    }

    /// Returns the triads whose samples count. The accelerometers count for the gyroscopes' g-sensitivity.
    pub(super) fn used(&self) -> &[Triad] {
        if self.rate.is_some() { &[Triad::Gyro, Triad::Accel] } else { &[Triad::Accel] }
    }

    /// Returns the single capture of an item at rest. Nothing may be missing from it, and the triads that are used must
    /// work and lie still.
    pub(super) fn at_rest<'q>(&self, question: &'q AnalysisInput<'_>) -> Result<&'q Capture, FigureError> {
        let capture = question.one("duration")?;
        captures::sound([capture], self.used())?;
        self.used().iter().try_for_each(|triad| captures::still(capture, *triad))?;
        Ok(capture)
    }

    /// Returns the compensated output in the unit of [`unit`], from raw outputs or from their means.
    pub(super) fn apply(&self, triad: Triad, gyro: &Vector3<f64>, accel: &Vector3<f64>) -> Vector3<f64> {
        match (triad, &self.rate) {
            (Triad::Gyro, Some(rate)) => rate.of(gyro, accel) * (3600.0 * 1.0_f64.to_degrees()),
            _ => self.force.of(accel) * (1e3 / earth::STANDARD_GRAVITY_MPS2),
        }
    }

    /// Returns compensated means of parts of `samples` samples. The tail is dropped.
    pub(super) fn blocks(&self, capture: &Capture, triad: Triad, samples: usize) -> Vec<Vector3<f64>> {
        captures::block_means(capture, Triad::Gyro, samples)
            .iter()
            .zip(captures::block_means(capture, Triad::Accel, samples))
            .map(|(gyro, accel)| self.apply(triad, gyro, &accel))
            .collect()
    }
}

/// Unit of compensated figures.
pub(super) fn unit(triad: Triad) -> Unit {
    if triad == Triad::Gyro { Unit::DegreePerHour } else { Unit::Milligravity }
}

/// Computes the standard deviation (n - 1) of disjoint means, tail dropped, no detrending.
pub(super) fn stability(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    let compensation = Compensation::of(question)?;
    let capture = compensation.at_rest(question)?;
    let block_s = question.params.quantity("block", Unit::Second)?;
    let block = block_s * f64::from(capture.about.rate_hz);
    let samples = block.round() as usize;
    if samples == 0 || (block - samples as f64).abs() > 1e-6 * block {
        let why = format!("{block_s} s are no whole number of samples");
        return Err(FigureError::Unfit { label: capture.about.label.clone(), why });
    }
    let mut findings = Findings::new(json!({
        "equation": "standard deviation (n - 1) of disjoint means of compensated output; tail dropped, no detrending",
        "blocks": capture.samples.len() / samples, "tail_samples": capture.samples.len() % samples,
        "label": "compensated; with whatever constant the earth's rotation and level add, which the deviation does not see",
    }));
    let mut series = BTreeMap::new();
    for triad in &compensation.triads {
        let blocks = compensation.blocks(capture, *triad, samples);
        for (i, axis) in AXES.iter().enumerate() {
            let means: Vec<f64> = blocks.iter().map(|block| block[i]).collect();
            let measurement = &triad.of(&BIAS_STABILITY_SD)[i];
            let found = stability::stability(&means, 1.0, 1.0).map_err(FigureError::refused(measurement.name))?;
            // Neighbouring means of a wandering bias are not independent.
            let dof = mean::dof_of_sd(&means);
            let (low, high) = stats::sd_interval(found.sd, dof, probability);
            series.insert(
                format!("{}_{axis}", triad.name()),
                BlockMeans {
                    unit: unit(*triad).symbol().to_owned(),
                    mean: found.mean,
                    sd: Some(found.sd),
                    dof: Some(dof),
                    means,
                },
            );
            findings.put(
                measurement,
                Value::estimate(found.sd, unit(*triad), Uncertainty::interval(low, high, probability)),
            );
        }
    }
    findings.part(&BLOCK_S, block_s);
    findings.part(&SERIES, series);
    temperatures(&mut findings, question.captures, *compensation.used().first().unwrap_or(&Triad::Accel));
    Ok(findings)
}

/// Computes the standard deviation (n - 1) of the means of runs, each after its own power-on.
pub(super) fn repeatability(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    let compensation = Compensation::of(question)?;
    let runs = usize::try_from(question.params.integer("runs")?).unwrap_or(usize::MAX);
    let mut series: Vec<u32> = question.captures.iter().map(|capture| capture.about.series).collect();
    series.sort_unstable();
    series.dedup();
    if series.len() != question.captures.len() || series.len() < runs {
        let what = format!("{runs} runs, each after its own power-on: {} there", series.len());
        return Err(FigureError::Missing { what });
    }
    for capture in question.captures {
        captures::sound([capture], compensation.used())?;
        for triad in compensation.used() {
            captures::still(capture, *triad)?;
        }
        question.long_enough(capture, "dwell")?;
    }
    let mut findings = Findings::new(json!({
        "equation": "standard deviation (n - 1) of the means of runs, power cycled between them",
        "runs": runs, "dof": runs - 1,
        "label": "the interval is that of a standard deviation of so few runs (chi-square)",
    }));
    let mut each = BTreeMap::new();
    for triad in &compensation.triads {
        let means: Vec<Vector3<f64>> = question
            .captures
            .iter()
            .map(|capture| {
                let [gyro, accel] = [Triad::Gyro, Triad::Accel].map(|triad| captures::mean(capture, triad));
                compensation.apply(*triad, &gyro, &accel)
            })
            .collect();
        for (i, axis) in AXES.iter().enumerate() {
            let figures: Vec<f64> = means.iter().map(|mean| mean[i]).collect();
            let measurement = &triad.of(&BIAS_REPEATABILITY_SD)[i];
            let found = stability::repeatability(&figures, 0.0).map_err(FigureError::refused(measurement.name))?;
            let (low, high) = stats::sd_interval(found.sd, (figures.len() - 1) as f64, probability);
            each.insert(
                format!("{}_{axis}", triad.name()),
                BlockMeans {
                    unit: unit(*triad).symbol().to_owned(),
                    mean: found.mean,
                    sd: Some(found.sd),
                    dof: None,
                    means: figures,
                },
            );
            findings.put(
                measurement,
                Value::estimate(found.sd, unit(*triad), Uncertainty::interval(low, high, probability)),
            );
        }
    }
    findings.part(&SERIES, each);
    temperatures(&mut findings, question.captures, *compensation.used().first().unwrap_or(&Triad::Accel));
    Ok(findings)
}
