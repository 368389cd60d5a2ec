//! Power spectral densities of all axes, on compensated data.

use std::collections::BTreeMap;

use gnc_executive::catalogue::noise::{DENSITY, STRONGEST_LINE};
use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_executive::uncertainty::Uncertainty;
use gnc_metrology::{psd, stats};
use serde_json::json;

use super::captures::{AXES, Triad};
use super::stability::{self, Compensation};
use super::{AnalysisInput, FigureError, Findings};
use crate::details::performance::{self as details, SPECTRA};

/// Number of neighbouring frequencies with which a line is compared.
const NEIGHBOURS: usize = 32;

pub(super) fn analyse(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    let compensation = Compensation::of(question)?;
    let capture = compensation.at_rest(question)?;
    let rate_hz = f64::from(capture.about.rate_hz);
    let segment = usize::try_from(question.params.integer("segment")?).unwrap_or(usize::MAX);
    let mut findings = Findings::new(json!({
        "equation": "Welch: periodic Hann window, 50 % overlap, mean of each segment removed, one-sided; white noise reads 2 N^2",
        "rate_hz": rate_hz, "segment": segment,
    }));
    let mut spectra = BTreeMap::new();
    let mut lines = Vec::new();
    for triad in &compensation.triads {
        let series = compensation.blocks(capture, *triad, 1);
        for (i, axis) in AXES.iter().enumerate() {
            let values: Vec<f64> = series.iter().map(|value| value[i]).collect();
            let channel = format!("{}_{axis}", triad.name());
            let found = psd::welch(&values, rate_hz, segment).map_err(FigureError::refused(channel.clone()))?;
            // The level part below the sensor's low-pass and above the wander of the bias.
            let level = psd::RobustSpectrum::of_welch(&found).without_lines().plateau_above_flicker();
            let (line_hz, line) = strongest_line(&found);
            findings.put(&triad.of(&DENSITY)[i], density(level, *triad, probability));
            lines.push((triad.of(&STRONGEST_LINE)[i], line));
            spectra.insert(channel, spectrum(&found, stability::unit(*triad), level, (line_hz, line)));
        }
    }
    for (measurement, line) in lines {
        findings.number(&measurement, line, Unit::Count);
    }
    findings.part(&SPECTRA, spectra);
    Ok(findings)
}

/// Unit of a density, and the factor from deg/h (mg) per root hertz.
fn density_unit(triad: Triad) -> (Unit, f64) {
    match triad {
        Triad::Gyro => (Unit::DegreePerSecondPerRootHertz, 1.0 / 3600.0),
        _ => (Unit::MicrogravityPerRootHertz, 1e3),
    }
}

fn density(level: Option<psd::Plateau>, triad: Triad, probability: f64) -> Value {
    let Some(level) = level else {
        return Value::NotAvailable(
            "the spectrum has no level part of two octaves: longer segments reach lower".into(),
        );
    };
    let (unit, factor) = density_unit(triad);
    let value = level.density.sqrt();
    let (low, high) = stats::sd_interval(value, 2.0 / level.relative_sd.powi(2), probability);
    Value::estimate(value * factor, unit, Uncertainty::interval(low * factor, high * factor, probability))
}

/// Largest density over the median of its neighbours, and its frequency.
fn strongest_line(found: &psd::SpectralDensity) -> (f64, f64) {
    let n = found.density.len();
    let mut best = (0.0, 0.0);
    // The lowest bins hold the wander of the bias and the rest of the mean.
    for k in 4..n.saturating_sub(1) {
        let from = k.saturating_sub(NEIGHBOURS / 2).max(2);
        let mut near = found.density[from..(from + NEIGHBOURS).min(n - 1)].to_vec();
        let ratio = found.density[k] / stats::median(&mut near);
        if ratio > best.1 {
            best = (found.frequency_hz[k], ratio);
        }
    }
    best
}

/// Returns the details of a spectrum. Its densities are those of 0, 1, 2 ... times the step.
fn spectrum(
    found: &psd::SpectralDensity,
    unit: Unit,
    white: Option<psd::Plateau>,
    (line_hz, line): (f64, f64),
) -> details::SpectrumDetails {
    details::SpectrumDetails {
        unit: format!("({})^2/Hz", unit.symbol()),
        segments: found.segments,
        frequency_step_hz: found.frequency_hz.get(1).copied(),
        density: found.density.clone(),
        white: white.map(|white| white.density),
        white_from_hz: white.map(|white| white.from_hz),
        white_to_hz: white.map(|white| white.to_hz),
        strongest_line: details::SpectralLine { frequency_hz: line_hz, over_neighbours: Some(line) },
    }
}
