//! The bias that calibration leaves in the accelerometers: `(Y1 + Y2) / 2` with the module turned upside down about the
//! third axis.
//!
//! That turn brings the axis to the opposite level direction. So an error of level counts once with each sign, and
//! gravity through the coupling does so too. A turn about the axis itself would keep its direction, and 1 mg for each
//! mrad of level would stay.

use gnc_executive::catalogue::TEMPERATURE;
use gnc_executive::catalogue::performance::FORCE_BIAS_LEFT;
use gnc_executive::quantity::Unit;
use gnc_metrology::earth;
use nalgebra::Vector3;
use serde_json::json;

use super::budget::Budget;
use super::calibration::{Force, ModuleCalibration};
use super::captures::{self, AXES, Triad};
use super::mean::{self, BLOCKS};
use super::{AnalysisInput, FigureError, Findings, place};
use crate::capture::Capture;

const MG: f64 = 1e3 / earth::STANDARD_GRAVITY_MPS2;

type Lying<'c> = (&'c Capture, Vector3<f64>, f64);

pub(super) fn analyse(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    let force = ModuleCalibration::of(question.earlier)?.force()?;
    let gravity = place::gravity(question.site)?;
    let pose_rad = question.params.quantity("pose_u", Unit::Radian)?;
    let lying: Vec<Lying<'_>> = captures::lying(question.captures).collect();
    for (capture, ..) in &lying {
        captures::sound([*capture], &[Triad::Accel])?;
        captures::still(capture, Triad::Accel)?;
        question.long_enough(capture, "dwell")?;
    }
    let mut findings = Findings::new(json!({
        "equation": "(Y1 + Y2) / 2 of f = Ka N + nabla, the module turned upside down about the third axis",
        "gravity_mps2": gravity.mps2, "gravity_from": gravity.from,
    }));
    let mut pairs = serde_json::Map::new();
    for name in question.params.choices("axes")? {
        let axis = AXES.iter().position(|axis| axis == name).unwrap_or(0);
        let (one, other) = pair(&lying, axis).ok_or_else(|| {
            let what = format!("axis {name} level, and again with the module turned upside down about the third axis");
            FigureError::Missing { what }
        })?;
        let means = [one, other].map(|(capture, ..)| force.of(&captures::mean(capture, Triad::Accel))[axis]);
        let noise = [one, other].map(|(capture, ..)| noise(capture, &force, axis));
        // Two records, each with its own noise. The attitude of each record counts by half.
        let budget = Budget::new(Unit::Milligravity)
            .a("noise of the first mean", noise[0].0 * MG / 2.0, noise[0].1)
            .a("noise of the second mean", noise[1].0 * MG / 2.0, noise[1].1)
            .b("attitudes, as far as they differ", pose_rad, "rad", gravity.mps2 * MG / 2.0_f64.sqrt());
        let labels = [one.0, other.0].map(|capture| capture.about.label.clone());
        pairs.insert((*name).into(), json!({ "captures": labels, "means_mps2": means }));
        findings.figure(&FORCE_BIAS_LEFT[axis], f64::midpoint(means[0], means[1]) * MG, &budget, probability);
    }
    findings.detail("pairs", pairs);
    let captures = lying.iter().map(|(capture, ..)| *capture);
    findings.number(&TEMPERATURE, captures::temperature(captures, Triad::Accel).0, Unit::DegreeCelsius);
    Ok(findings)
}

/// Returns two captures in which the axis is level and points in opposite directions, upside down to each other.
fn pair<'a, 'c>(lying: &'a [Lying<'c>], axis: usize) -> Option<(&'a Lying<'c>, &'a Lying<'c>)> {
    let direction = |(_, up, heading_deg): &Lying<'_>| {
        let (north, east) = place::north_east(up, *heading_deg);
        (north[axis], east[axis])
    };
    let level = |entry: &&Lying<'_>| entry.1[axis].abs() < 0.01;
    lying.iter().filter(level).find_map(|one| {
        let there = direction(one);
        let opposite = |other: &&Lying<'_>| {
            let here = direction(other);
            (one.1 + other.1).norm() < 0.01 && (there.0 + here.0).hypot(there.1 + here.1) < 0.02
        };
        lying.iter().filter(level).find(opposite).map(|other| (one, other))
    })
}

/// Standard uncertainty of the mean of a compensated axis, m/s^2, and its degrees of freedom.
fn noise(capture: &Capture, force: &Force, axis: usize) -> (f64, f64) {
    let blocks = captures::block_means(capture, Triad::Accel, capture.samples.len() / BLOCKS);
    let noise = mean::variance(&[blocks.iter().map(|block| force.of(block)[axis]).collect()]);
    (noise.sd(), noise.dof)
}
