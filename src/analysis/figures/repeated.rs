//! Whole calibrations after power cycles: repeatability of the scale factors.

use gnc_executive::catalogue::repeated::SCALE_FACTOR_SD;
use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_executive::uncertainty::Uncertainty;
use gnc_metrology::{stability, stats};
use nalgebra::Matrix3;
use serde_json::json;

use super::captures::Triad;
use super::json::rows;
use super::six_position::temperatures;
use super::{AnalysisInput, FigureError, Findings, clock, rotation, six_position};
use crate::capture::{Capture, Pose};
use crate::details::performance::{ACCEL_RESPONSES, GYRO_RESPONSES};

/// The calibrations of one triad, oldest first.
#[derive(Debug)]
pub(super) enum CalibrationSeries {
    Accel(Vec<six_position::SixPositionSolution>),
    Gyro(Vec<rotation::RotationSolution>),
}

impl CalibrationSeries {
    pub(super) fn triad(&self) -> Triad {
        match self {
            CalibrationSeries::Accel(_) => Triad::Accel,
            CalibrationSeries::Gyro(_) => Triad::Gyro,
        }
    }

    /// M or S of each calibration.
    pub(super) fn responses(&self) -> Vec<Matrix3<f64>> {
        match self {
            CalibrationSeries::Accel(solved) => solved.iter().map(|solved| solved.found.response).collect(),
            CalibrationSeries::Gyro(solved) => solved.iter().map(|solved| solved.found.response).collect(),
        }
    }
}

/// Calibrates each series of the captures, for the triads that the plan wants.
pub(super) fn calibrations(question: &AnalysisInput<'_>) -> Result<Vec<CalibrationSeries>, FigureError> {
    let own = !matches!(question.params.source("of"), Ok(Some(_)));
    let needed = usize::try_from(question.params.integer("calibrations")?).unwrap_or(usize::MAX);
    let mut numbers: Vec<u32> = question.captures.iter().map(|capture| capture.about.series).collect();
    numbers.sort_unstable();
    numbers.dedup();
    if numbers.len() < 2 || (own && numbers.len() < needed) {
        let what = format!("{needed} calibrations, each after its own power-on: {} there", numbers.len());
        return Err(FigureError::Missing { what });
    }
    let expected = if own { question.params.choice("positions")?.parse().ok() } else { None };
    let sensors = question.params.choices("sensors")?;
    let mut all = Vec::new();
    if sensors.contains(&"gyro") {
        let known = rotation::RotationTerms::of(question)?;
        let solved = numbers.iter().map(|number| rotation::solve(of_series(question.captures, *number), known));
        all.push(CalibrationSeries::Gyro(solved.collect::<Result<_, _>>()?));
    }
    if sensors.contains(&"accel") {
        let known = six_position::SixPositionTerms::of(question)?;
        let still = |capture: &&Capture| matches!(capture.about.pose, Pose::Still { .. });
        if own {
            for capture in question.captures.iter().filter(still) {
                question.long_enough(capture, "dwell")?;
            }
        }
        let solved = numbers
            .iter()
            .map(|number| six_position::solve(of_series(question.captures, *number).filter(still), expected, known));
        all.push(CalibrationSeries::Accel(solved.collect::<Result<_, _>>()?));
    }
    Ok(all)
}

fn of_series(captures: &[Capture], number: u32) -> impl Iterator<Item = &Capture> {
    captures.iter().filter(move |capture| capture.about.series == number)
}

pub(super) fn analyse(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    let all = calibrations(question)?;
    let mut findings = Findings::new(json!({
        "equation": "standard deviation (n - 1) of M_ii (S_ii) over calibrations, power cycled between them, over their mean",
        "label": "the interval is that of a standard deviation of so few calibrations (chi-square)",
    }));
    let clock_ppm = clock::drift_ppm();
    findings.detail(
        "sample_clock",
        json!({
            "drift_u_ppm": clock_ppm,
            "label": "an error that all calibrations share cancels; what drifts between them is in the lower end of the gyroscopes' interval",
        }),
    );
    for series in &all {
        let responses = series.responses();
        let part = match series.triad() {
            Triad::Gyro => &GYRO_RESPONSES,
            Triad::Accel | Triad::Mag => &ACCEL_RESPONSES,
        };
        findings.part(part, responses.iter().map(rows).collect());
        for (i, measurement) in series.triad().of(&SCALE_FACTOR_SD).iter().enumerate() {
            let first = responses[0][(i, i)];
            let figures: Vec<f64> = responses.iter().map(|response| response[(i, i)] / first).collect();
            let found = stability::repeatability(&figures, 0.0).map_err(FigureError::refused(measurement.name))?;
            let (low, high) = stats::sd_interval(found.sd, (figures.len() - 1) as f64, probability);
            let ppm = 1e6 / found.mean;
            let low_ppm = match series.triad() {
                // The drift of the clock between the calibrations scatters with the scale factors.
                Triad::Gyro => ((low * ppm).powi(2) - clock_ppm * clock_ppm).max(0.0).sqrt(),
                Triad::Accel | Triad::Mag => low * ppm,
            };
            let interval = Uncertainty::interval(low_ppm, high * ppm, probability);
            findings.put(measurement, Value::estimate(found.sd * ppm, Unit::PartsPerMillion, interval));
        }
    }
    temperatures(&mut findings, question.captures, all.first().map_or(Triad::Accel, CalibrationSeries::triad));
    Ok(findings)
}
