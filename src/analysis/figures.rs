//! Figures from captures: pure functions, the same on the bench and years later.
//!
//! A procedure captures. Only this module computes figures from the samples, so that `recompute` cannot differ from the
//! run. Formulas, budgets and refusals: `docs/figures.md`.

mod accel_bias;
mod allan;
mod attitude_field;
mod axes;
mod budget;
pub mod calibration;
mod captures;
mod check;
pub mod clock;
mod coupling;
mod download;
mod ellipse;
mod ellipsoid;
mod error;
mod gnss;
mod gyro_bias;
mod gyro_still;
mod integrity;
mod json;
mod mean;
mod place;
mod psd;
mod repeated;
mod resolution;
mod rest_noise;
mod roll;
mod rotation;
mod six_position;
mod spin_blocks;
mod stability;
mod still_fit;
mod thin;

use gnc_executive::bench::BenchSite;
use gnc_executive::catalogue::{ItemId, MeasurementSpec, SAMPLE_RATE};
use gnc_executive::details::Details;
use gnc_executive::measurement::Value;
use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;

use crate::capture::Capture;
use crate::details::{BUDGET, DetailsPart};
pub use allan::fit_json;
use budget::Budget;
pub use calibration::ModuleCalibration;
pub use error::FigureError;
pub use integrity::{KEY as GATE, NAMES as INTEGRITY, integrity, sound_at_rest};

/// The input of an analysis.
#[derive(Debug)]
pub struct AnalysisInput<'a> {
    /// The item's parameters.
    pub params: &'a Params,
    /// Place of the bench.
    pub site: Option<&'a BenchSite>,
    /// The captures of this attempt, or of the item that its parameters name.
    pub captures: &'a [Capture],
    /// The findings of the items before, oldest first, each with its name in the plan. Only their details count.
    pub earlier: &'a [(String, Findings)],
}

/// The findings of an analysis.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Findings {
    /// Measurements in the order of the catalogue: name, value.
    pub measured: Vec<(&'static str, Value)>,
    /// Everything else for records, reports and later items: equation, parameters, covariance, residuals, budget.
    pub details: Details,
}

/// Computes the figures of an item.
///
/// # Errors
/// [`FigureError`]: samples are missing or spoilt, a calibration or the place of the bench is missing, or the method
/// refuses the record.
pub fn analyse(item: ItemId, question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    clock::check(question.captures)?;
    // Losses come first, since missing samples cannot be screened.
    let integrity = integrity::Integrity::of(item, question);
    if let Some(refused) = integrity.refused.clone().filter(|_| !lossy(question.captures)) {
        return Err(refused);
    }
    let question = AnalysisInput { captures: &integrity.captures, ..*question };
    let mut findings = of_sound_samples(item, &question)?;
    if item.spec().measurement(SAMPLE_RATE.name).is_some() {
        // Items without their own probability state a standard one.
        let probability = question.probability().unwrap_or(0.95);
        let views = question.captures.iter().map(|capture| &capture.timing.host);
        findings.put(&SAMPLE_RATE, clock::sample_rate_error(question.earlier, views, probability));
    }
    integrity.file(&mut findings);
    Ok(findings)
}

fn lossy(captures: &[Capture]) -> bool {
    captures.iter().any(|capture| capture.losses.any())
}

fn of_sound_samples(item: ItemId, question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    match item {
        ItemId::SixPosition => six_position::analyse(question),
        ItemId::GyroStill => gyro_still::analyse(question),
        ItemId::Rotation => rotation::analyse(question),
        ItemId::GyroBias => gyro_bias::analyse(question),
        ItemId::AccelBias => accel_bias::analyse(question),
        ItemId::BiasStability => stability::stability(question),
        ItemId::BiasRepeatability => stability::repeatability(question),
        ItemId::ScaleFactorRepeatability => repeated::analyse(question),
        ItemId::CrossCoupling => coupling::analyse(question),
        ItemId::Resolution => resolution::analyse(question),
        ItemId::Allan => allan::analyse(question),
        ItemId::Psd => psd::analyse(question),
        ItemId::MagnetometerEllipse => ellipse::analyse(question),
        ItemId::MagnetometerEllipsoid => ellipsoid::analyse(question),
        ItemId::GnssAccuracy => gnss::analyse(question),
        ItemId::CalibrationDownload => download::analyse(question),
        ItemId::CalibrationCheck => check::analyse(question),
        other => Err(FigureError::NoAnalysis { item: other }),
    }
}

impl AnalysisInput<'_> {
    /// Returns the probability of the expanded uncertainties.
    fn probability(&self) -> Result<f64, FigureError> {
        Ok(self.params.quantity("coverage", Unit::Percent)? / 100.0)
    }
}

impl From<Details> for Findings {
    /// Details without measurements, as later items use them.
    fn from(details: Details) -> Self {
        Self { measured: Vec::new(), details }
    }
}

impl Findings {
    fn new(details: serde_json::Value) -> Self {
        Details::from(details).into()
    }

    fn put(&mut self, measurement: &MeasurementSpec, value: Value) {
        self.measured.push((measurement.name, value));
    }

    fn number(&mut self, measurement: &MeasurementSpec, number: f64, unit: Unit) {
        self.put(measurement, Value::number(number, unit));
    }

    /// Adds a figure with the uncertainty of its budget. The details keep the budget.
    fn figure(&mut self, measurement: &MeasurementSpec, number: f64, budget: &Budget, probability: f64) {
        if let Some(details) = self.details.to_mut().as_object_mut() {
            let budgets = details.entry(BUDGET.key()).or_insert_with(|| serde_json::json!({}));
            if let Some(budgets) = budgets.as_object_mut() {
                budgets.insert(measurement.name.to_owned(), serde_json::json!(budget.written(probability)));
            }
        }
        self.put(measurement, Value::estimate(number, budget.unit(), budget.uncertainty(number, probability)));
    }

    /// Adds a part of the details that other code reads.
    fn part<T: serde::Serialize>(&mut self, part: &DetailsPart<T>, value: T) {
        self.detail(part.key(), serde_json::json!(value));
    }

    /// Adds a detail that only people read.
    fn detail(&mut self, key: &str, value: impl Into<serde_json::Value>) {
        if let Some(details) = self.details.to_mut().as_object_mut() {
            details.insert(key.to_owned(), value.into());
        }
    }

    /// Returns the value of a measurement.
    #[must_use]
    pub fn value(&self, measurement: &MeasurementSpec) -> Option<&Value> {
        self.measured.iter().find(|(name, _)| *name == measurement.name).map(|(_, value)| value)
    }
}

#[cfg(test)]
mod tests;
