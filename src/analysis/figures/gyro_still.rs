//! Bias and g-sensitivity of the gyroscopes from still positions.

use gnc_executive::catalogue::calibration::{G_SENSITIVITY, RATE_BIAS, RATE_RESIDUAL};
use gnc_executive::quantity::Unit;
use gnc_metrology::position::Position;
use gnc_metrology::{earth, gyro_still};
use gnc_protocol::stream::GYRO_LSB_PER_DPS;
use nalgebra::{Matrix3, Vector3};
use serde_json::json;

use super::budget::Budget;
use super::calibration::{CALIBRATION, GyroStillCalibration, ModuleCalibration};
use super::captures::{self, Triad};
use super::json::{matrix, of_rows, rows, vector};
use super::mean::MeanVariance;
use super::six_position::temperatures;
use super::still_fit::{Attitude, Design, attitudes, rare_ratio, scatter};
use super::{AnalysisInput, FigureError, Findings, place};
use crate::details::calibrating::{RATE_RESIDUALS, RateResidual};

/// Relative bound of the errors of scale factors and axes before a rotation.
const NOMINAL_BAND: f64 = 0.01;
pub(super) fn analyse(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let own = question.params.source("of")?.is_none();
    if own {
        for capture in question.captures {
            question.long_enough(capture, "dwell")?;
        }
    }
    let expected = if own { question.params.choice("positions")?.parse().ok() } else { None };
    let lying = attitudes(question.captures, expected, Triad::Gyro)?;
    let site = Site::of(question)?;
    let scale = ModuleCalibration::of(question.earlier)?.gyro_scale;
    let response = scale.map_or_else(nominal, |scale| of_rows(&scale.response));
    let inverse = scale.map_or_else(|| Matrix3::identity() / nominal()[(0, 0)], |scale| of_rows(&scale.matrix));
    let positions: Vec<Position> = lying
        .iter()
        .map(|attitude| Position {
            label: attitude.capture.about.label.clone(),
            up: attitude.up,
            mean: inverse * captures::mean(attitude.capture, Triad::Gyro),
            rows: attitude.capture.samples.len(),
            resolution_sd: Vector3::zeros(),
        })
        .collect();
    let (north, east): (Vec<_>, Vec<_>) =
        lying.iter().map(|attitude| place::north_east(&attitude.up, attitude.heading_deg)).unzip();
    let known = site.heading_u_rad.map(|_| north.as_slice());
    let found = gyro_still::calibrate(&positions, site.gravity_mps2, site.latitude_deg, known)
        .map_err(FigureError::refused("gyroscopes at rest"))?;
    let design = Design::new(lying.iter().map(|attitude| attitude.up).collect(), site.gravity_mps2)
        .ok_or_else(|| FigureError::Missing { what: "attitudes that span space".into() })?;
    let fit = Fit::new(&lying, &inverse, &found, design, site, east, scale.is_some());
    Ok(findings(question, &fit, &found, &response, question.probability()?))
}

/// Counts for one rad/s, the same on every axis.
fn nominal() -> Matrix3<f64> {
    Matrix3::identity() * (GYRO_LSB_PER_DPS * 1.0_f64.to_degrees())
}

/// The known figures of the place.
#[derive(Debug, Clone, Copy)]
struct Site {
    gravity_mps2: f64,
    latitude_deg: f64,
    /// Horizontal earth rate, rad/s.
    north_rps: f64,
    /// Standard uncertainty of the headings; `None` where the headings are unknown.
    heading_u_rad: Option<f64>,
}

impl Site {
    fn of(question: &AnalysisInput<'_>) -> Result<Self, FigureError> {
        let known = question.params.choice("heading")? == "known";
        Ok(Self {
            gravity_mps2: place::gravity(question.site)?.mps2,
            latitude_deg: place::latitude(question.site)?,
            north_rps: place::earth_rate(question.site)?.1,
            heading_u_rad: if known { Some(question.params.quantity("heading_u", Unit::Radian)?) } else { None },
        })
    }
}

/// The data of the budgets. Rates in rad/s.
struct Fit {
    design: Design,
    noise: [MeanVariance; 3],
    site: Site,
    east: Vec<Vector3<f64>>,
    heading_bound_rps: f64,
    per_force_bound: f64,
    scale_known: bool,
    residual_ratio: f64,
    excess: bool,
}

impl Fit {
    fn new(
        lying: &[Attitude<'_>],
        inverse: &Matrix3<f64>,
        found: &gyro_still::StillGyro,
        design: Design,
        site: Site,
        east: Vec<Vector3<f64>>,
        scale_known: bool,
    ) -> Self {
        let mut noise = scatter(lying, Triad::Gyro);
        for (i, noise) in noise.iter_mut().enumerate() {
            noise.variance *= inverse[(i, i)].powi(2);
        }
        let squares: f64 = found.residuals_rps.iter().map(Vector3::norm_squared).sum();
        // Unknown headings leave the horizontal earth rate in the residuals: half of its square on a level axis.
        let unknown = if site.heading_u_rad.is_none() { site.north_rps.powi(2) / 2.0 } else { 0.0 };
        let expected: f64 =
            (0..3).map(|i| design.left_over(|p| noise[i].variance + unknown * (1.0 - design.ups[p][i].powi(2)))).sum();
        let dof = found.dof as f64;
        let residual_ratio = squares / expected;
        let excess = residual_ratio > rare_ratio(dof, &noise);
        if excess {
            noise = [MeanVariance { variance: squares / dof, dof }; 3];
        }
        Self {
            design,
            noise,
            site,
            east,
            heading_bound_rps: found.bias_heading_bound_rps,
            per_force_bound: found.g_sensitivity_heading_bound,
            scale_known,
            residual_ratio,
            excess,
        }
    }

    /// Budget of parameter 0 to 2 (g-sensitivity to an axis) or 3 (bias) of sensor `i`; `factor` turns SI into the unit.
    fn budget(&self, i: usize, parameter: usize, unit: Unit, factor: f64) -> Budget {
        let noise = (self.noise[i].variance * self.design.cofactor[(parameter, parameter)]).sqrt() * factor;
        let budget = Budget::new(unit).a("noise of the positions' means", noise, self.noise[i].dof);
        let budget = match self.site.heading_u_rad {
            // All headings share one zero.
            Some(heading_u) => {
                let shift = self.design.shift(parameter, |p| self.site.north_rps * self.east[p][i]);
                budget.b("zero of the headings", heading_u, "rad", shift * factor)
            }
            None => {
                let bound = if parameter == 3 { self.heading_bound_rps } else { self.per_force_bound };
                budget.bound("headings unknown: horizontal earth rate", bound * factor, unit.symbol(), 1.0)
            }
        };
        if self.scale_known {
            return budget;
        }
        let earth = self
            .design
            .shift(parameter, |_| earth::EARTH_RATE_RPS)
            .abs()
            .max(earth::EARTH_RATE_RPS / 2.0 * self.design.cofactor[(parameter, parameter)].sqrt());
        budget.bound("scale factors not yet known, on the earth rate", NOMINAL_BAND, "", earth * factor)
    }
}

fn findings(
    question: &AnalysisInput<'_>,
    fit: &Fit,
    found: &gyro_still::StillGyro,
    response: &Matrix3<f64>,
    probability: f64,
) -> Findings {
    let mut findings = Findings::new(details(fit, found));
    let residuals = question.captures.iter().zip(&found.residuals_rps).map(|(capture, residual)| RateResidual {
        position: capture.about.label.clone(),
        residual_rps: (*residual).into(),
    });
    findings.part(&RATE_RESIDUALS, residuals.collect());
    for (i, measurement) in RATE_BIAS.iter().enumerate() {
        let budget = fit.budget(i, 3, Unit::DegreePerSecond, 1.0_f64.to_degrees());
        findings.figure(measurement, found.bias_rps[i].to_degrees(), &budget, probability);
    }
    // Factor from (rad/s) per (m/s^2) to deg/h per g.
    let dph_per_g = 3600.0 * 1.0_f64.to_degrees() * earth::STANDARD_GRAVITY_MPS2;
    for (i, of_sensor) in G_SENSITIVITY.iter().enumerate() {
        for (j, measurement) in of_sensor.iter().enumerate() {
            let budget = fit.budget(i, j, Unit::DegreePerHourPerGravity, dph_per_g);
            let value = found.g_sensitivity[(i, j)] * dph_per_g;
            findings.figure(measurement, value, &budget, probability);
        }
    }
    findings.number(&RATE_RESIDUAL, found.residual_rms_rps.to_degrees() * 3600.0, Unit::DegreePerHour);
    temperatures(&mut findings, question.captures, Triad::Gyro);
    let bias = response * found.bias_rps;
    let still = GyroStillCalibration { bias: bias.into(), per_force: rows(&(response * found.g_sensitivity)) };
    findings.part(&CALIBRATION, ModuleCalibration { gyro_still: Some(still), ..ModuleCalibration::default() });
    findings
}

fn details(fit: &Fit, found: &gyro_still::StillGyro) -> serde_json::Value {
    let mut labels = vec!["with the rotation of the earth removed"];
    if fit.site.heading_u_rad.is_none() {
        labels.push("headings unknown: only its vertical part, the horizontal one is in the uncertainty");
    }
    if !fit.scale_known {
        labels.push("at nominal scale factors, since no rotation stands before it");
    }
    if fit.excess {
        labels.push("residuals larger than the noise explains: their own scatter is taken for the uncertainty");
    }
    json!({
        "equation": "S^-1 N = w_earth + b + G f, by least squares over still positions; rates in rad/s, f in m/s^2",
        "bias_rps": vector(&found.bias_rps), "G": matrix(&found.g_sensitivity),
        "bias_sd_rps": vector(&found.bias_sd_rps), "G_sd": matrix(&found.g_sensitivity_sd),
        "latitude_deg": fit.site.latitude_deg, "gravity_mps2": fit.site.gravity_mps2,
        "residual_rms_rps": found.residual_rms_rps, "residual_ratio": fit.residual_ratio,
        "dof": found.dof, "condition": found.condition,
        "noise_of_means": fit.noise.map(|noise| json!({ "sd_rps": noise.sd(), "dof": noise.dof })),
        "label": labels.join("; "),
    })
}
