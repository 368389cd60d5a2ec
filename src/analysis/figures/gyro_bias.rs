//! The bias that calibration leaves in the gyroscopes.

use gnc_executive::catalogue::TEMPERATURE;
use gnc_executive::catalogue::performance::{EARTH_LABEL, RATE_BIAS_LEFT};
use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_metrology::earth;
use nalgebra::Vector3;
use serde_json::json;

use super::budget::Budget;
use super::calibration::ModuleCalibration;
use super::captures::{self, Triad};
use super::json::vector;
use super::mean::{self, BLOCKS};
use super::{AnalysisInput, FigureError, Findings, place};
use crate::capture::Pose;

/// The part of the earth's rotation that is subtracted, and the part that is left.
struct Earth {
    removed_rps: Vector3<f64>,
    label: &'static str,
    /// Bound of the part that is left, each axis, rad/s.
    left_rps: f64,
    /// Change for a turn of the heading, rad/s per rad.
    per_heading: Vector3<f64>,
    /// Standard uncertainty of the heading, rad.
    heading_u_rad: f64,
}

impl Earth {
    fn of(question: &AnalysisInput<'_>, up: &Vector3<f64>, heading_deg: f64) -> Result<Self, FigureError> {
        let nothing = Vector3::zeros();
        let heading_u_rad = question.params.quantity("heading_u", Unit::Radian)?;
        let Ok((vertical, level)) = place::earth_rate(question.site) else {
            let (label, left_rps) = ("with the rotation of the earth, at most 15.04 deg/h", earth::EARTH_RATE_RPS);
            return Ok(Self { removed_rps: nothing, label, left_rps, per_heading: nothing, heading_u_rad: 0.0 });
        };
        if question.params.choice("heading")? != "known" {
            let label = "heading unknown: with the horizontal rotation of the earth";
            let removed_rps = up * vertical;
            return Ok(Self { removed_rps, label, left_rps: level, per_heading: nothing, heading_u_rad: 0.0 });
        }
        let (north, east) = place::north_east(up, heading_deg);
        let label = "rotation of the earth removed by attitude and heading";
        Ok(Self {
            removed_rps: up * vertical + north * level,
            label,
            left_rps: 0.0,
            per_heading: east * level,
            heading_u_rad,
        })
    }
}

pub(super) fn analyse(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    let rate = ModuleCalibration::of(question.earlier)?.rate()?;
    let capture = question.one("dwell")?;
    captures::sound([capture], &[Triad::Gyro, Triad::Accel])?;
    captures::still(capture, Triad::Gyro)?;
    captures::still(capture, Triad::Accel)?;
    let Pose::Still { up, heading_deg } = capture.about.pose else {
        return Err(FigureError::Missing { what: "the module at rest".into() });
    };
    let up = Vector3::from(up);
    let earth = Earth::of(question, &up, heading_deg)?;
    let pose_rad = question.params.quantity("pose_u", Unit::Radian)?;
    let means = (captures::mean(capture, Triad::Gyro), captures::mean(capture, Triad::Accel));
    let bias_rps = rate.of(&means.0, &means.1) - earth.removed_rps;
    let samples = capture.samples.len() / BLOCKS;
    let blocks: Vec<Vector3<f64>> = captures::block_means(capture, Triad::Gyro, samples)
        .iter()
        .zip(captures::block_means(capture, Triad::Accel, samples))
        .map(|(gyro, accel)| rate.of(gyro, &accel))
        .collect();
    let dph = 3600.0 * 1.0_f64.to_degrees();
    let mut findings = Findings::new(json!({
        "equation": "mean of w = Kg N - epsilon - Gamma f, less the rotation of the earth",
        "bias_rps": vector(&bias_rps), "earth_removed_rps": vector(&earth.removed_rps),
        "up": vector(&up), "heading_deg": heading_deg, "samples": capture.samples.len(), "label": earth.label,
    }));
    for (i, measurement) in RATE_BIAS_LEFT.iter().enumerate() {
        let noise = mean::variance(&[blocks.iter().map(|block| block[i] * dph).collect()]);
        let budget = Budget::new(Unit::DegreePerHour)
            .a("noise of the mean", noise.sd(), noise.dof)
            .b("heading", earth.heading_u_rad, "rad", earth.per_heading[i] * dph)
            .b("attitude, on the rotation of the earth", pose_rad, "rad", earth::EARTH_RATE_RPS * dph)
            .bound("rotation of the earth left", earth.left_rps * dph, "deg/h", 1.0);
        findings.figure(measurement, bias_rps[i] * dph, &budget, probability);
    }
    findings.put(&EARTH_LABEL, Value::text(earth.label));
    findings.number(&TEMPERATURE, captures::temperature([capture], Triad::Gyro).0, Unit::DegreeCelsius);
    Ok(findings)
}
