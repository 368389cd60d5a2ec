//! Power spectral densities of all axes, on compensated data.

use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_executive::uncertainty::Uncertainty;
use gnc_metrology::{psd, stats};
use serde_json::json;

use super::captures::{self, AXES, Triad};
use super::stability::{self, Compensation};
use super::{FigureError, Findings, Question};

/// The white level is that of the upper three quarters of the band, above the wander of the bias.
const WHITE_FROM: f64 = 0.25;
/// Neighbouring frequencies that a line is compared with.
const NEIGHBOURS: usize = 32;
/// Windows of neighbouring segments overlap by half: with a Hann window nine of ten count (Welch 1967).
const WORTH_OF_SEGMENT: f64 = 0.9;

pub(super) fn analyse(question: &Question<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    let compensation = Compensation::of(question)?;
    let capture = question.one("duration")?;
    captures::sound([capture], compensation.used())?;
    for triad in compensation.used() {
        captures::still(capture, *triad)?;
    }
    let rate_hz = f64::from(capture.about.rate_hz);
    let segment = usize::try_from(question.params.integer("segment")?).unwrap_or(usize::MAX);
    let mut findings = Findings::new(json!({
        "equation": "Welch: periodic Hann window, 50 % overlap, mean of each segment removed, one-sided; white noise reads 2 N^2",
        "rate_hz": rate_hz, "segment": segment,
    }));
    let mut spectra = serde_json::Map::new();
    let mut lines = Vec::new();
    for triad in &compensation.triads {
        let series = compensation.blocks(capture, *triad, 1);
        for (i, axis) in AXES.iter().enumerate() {
            let values: Vec<f64> = series.iter().map(|value| value[i]).collect();
            let channel = format!("{}_{axis}", triad.name());
            let found = psd::welch(&values, rate_hz, segment).map_err(FigureError::refused(channel.clone()))?;
            let (level, bins) = white_level(&found);
            let (line_hz, line) = strongest_line(&found);
            // Densities scatter like chi-square; averaging over bins and segments makes them nearly normal.
            let dof = 2.0 * WORTH_OF_SEGMENT * found.segments as f64 * bins as f64 / 1.5;
            let (low, high) = stats::sd_interval(level.sqrt(), dof, probability);
            let (unit, factor) = density_unit(*triad);
            let interval = Uncertainty::interval(low * factor, high * factor, probability);
            findings.put(format!("density_{channel}"), Value::estimate(level.sqrt() * factor, unit, interval));
            lines.push((format!("line_{channel}"), line));
            spectra.insert(channel, spectrum(&found, stability::unit(*triad), level, (line_hz, line)));
        }
    }
    for (name, line) in lines {
        findings.number(name, line, Unit::Count);
    }
    findings.detail("spectra", spectra);
    Ok(findings)
}

/// From deg/h (mg) per root hertz.
fn density_unit(triad: Triad) -> (Unit, f64) {
    match triad {
        Triad::Gyro => (Unit::DegreePerSecondPerRootHertz, 1.0 / 3600.0),
        _ => (Unit::MicrogravityPerRootHertz, 1e3),
    }
}

/// Mean density of the upper band without its lines, and the bins that count: the median frees it from lines, and the
/// mean of what is near the median has its scatter.
fn white_level(found: &psd::Psd) -> (f64, usize) {
    let n = found.density.len();
    // The last bin has no mirror image and is left out.
    let upper = &found.density[(n as f64 * WHITE_FROM) as usize..n - 1];
    let median = stats::median(&mut upper.to_vec());
    let kept: Vec<f64> = upper.iter().copied().filter(|density| *density < 4.0 * median).collect();
    (stats::mean(&kept), kept.len())
}

/// Largest density over the median of its neighbours, and its frequency.
fn strongest_line(found: &psd::Psd) -> (f64, f64) {
    let n = found.density.len();
    let mut best = (0.0, 0.0);
    // The lowest bins hold the wander of the bias and what is left of the mean.
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

/// Its densities are those of 0, 1, 2 ... times the step.
fn spectrum(found: &psd::Psd, unit: Unit, white: f64, (line_hz, line): (f64, f64)) -> serde_json::Value {
    json!({
        "unit": format!("({})^2/Hz", unit.symbol()), "segments": found.segments,
        "frequency_step_hz": found.frequency_hz.get(1), "density": found.density, "white": white,
        "strongest_line": { "frequency_hz": line_hz, "over_neighbours": line },
    })
}
