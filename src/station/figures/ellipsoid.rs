//! The magnetometer over many attitudes: hard and soft iron.

use gnc_executive::bench::Site;
use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_metrology::ellipsoid;
use gnc_protocol::stream::{MAG_LSB_PER_GAUSS, SATURATION};
use serde_json::json;

use super::budget::Budget;
use super::captures::{self, AXES, Triad};
use super::json::{matrix, vector};
use super::mean;
use super::still_fit::rare_ratio;
use super::{FigureError, Findings, Question};
use crate::capture::Capture;

/// Points taken of each attitude: so many means of its samples.
const POINTS: usize = 20;

pub(super) fn analyse(question: &Question<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    for capture in question.captures {
        captures::sound([capture], &[Triad::Mag])?;
        question.long_enough(capture, "dwell")?;
    }
    let points: Vec<_> = question
        .captures
        .iter()
        .flat_map(|capture| captures::block_means(capture, Triad::Mag, capture.samples.len() / POINTS))
        .map(|mean| mean / MAG_LSB_PER_GAUSS)
        .collect();
    let [x, y, z] = [0, 1, 2].map(|axis| points.iter().map(|point| point[axis]).collect::<Vec<f64>>());
    let top = f64::from(SATURATION) / MAG_LSB_PER_GAUSS;
    let found = ellipsoid::fit(&x, &y, &z, None, Some(top)).map_err(FigureError::refused("ellipsoid"))?;
    let mut findings = Findings::new(json!({
        "equation": "corrected = matrix (raw - centre), |corrected| = field; matrix symmetric, determinant 1; gauss at nominal scale",
        "centre": vector(&found.centre), "matrix": matrix(&found.matrix), "field": found.field,
        "semi_axes": vector(&found.semi_axes), "one_sidedness": found.one_sidedness, "sigma": found.sigma,
        "used": found.used, "dof": found.dof, "condition": found.condition, "attitudes": question.captures.len(),
        "label": "the frame of the field alone: it differs from a correction that keeps an axis by a constant of roll",
    }));
    let noise = Noise::of(question.captures, &found);
    let fixture = Site::fixture(question.site);
    let quantum = 1.0 / MAG_LSB_PER_GAUSS / 12.0_f64.sqrt();
    // `fit_sd` is what the fit knows of white noise alone, `factor` turns gauss into the unit.
    let budget = |fit_sd: f64, unit: Unit, factor: f64| {
        let per_gauss = fit_sd * noise.per_gauss * factor;
        Budget::new(unit).a(noise.name, noise.of_attitude_gauss * per_gauss, noise.dof).b(
            "ambient field between attitudes",
            fixture.ambient_u_gauss,
            "gauss",
            per_gauss,
        )
    };
    for (i, axis) in AXES.iter().enumerate() {
        let budget = budget(found.centre_sd[i], Unit::Gauss, 1.0)
            .b("field of the fixture", fixture.field_u_gauss, "gauss", 1.0)
            .b("quantisation", quantum, "gauss", 1.0);
        findings.figure(format!("hard_iron_{axis}"), found.centre[i], &budget, probability);
    }
    for (i, j) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)] {
        let value = found.matrix[(i, j)] - if i == j { 1.0 } else { 0.0 };
        let budget = budget(found.matrix_sd[(i, j)], Unit::PartsPerMillion, 1e6);
        findings.figure(format!("soft_iron_{}{}", AXES[i], AXES[j]), value * 1e6, &budget, probability);
    }
    let of_field = |unit: Unit, factor: f64| {
        budget(found.field_sd, unit, factor).b("ambient field", fixture.ambient_u_gauss, "gauss", factor)
    };
    findings.figure("field", found.field, &of_field(Unit::Gauss, 1.0), probability);
    match question.site.and_then(|site| site.field_gauss).filter(|field| *field > 0.0) {
        Some(field) => {
            let budget = of_field(Unit::Percent, 100.0 / field);
            findings.figure("field_error", (found.field / field - 1.0) * 100.0, &budget, probability);
        }
        None => findings.put("field_error", Value::NotAvailable("the bench file gives no field".into())),
    }
    findings.number("residual", found.residual_relative * 100.0, Unit::Percent);
    findings.number("coverage_of_sphere", found.coverage * 100.0, Unit::Percent);
    findings.put("rejected", Value::count(found.rejected as u64));
    Ok(findings)
}

/// Parameters of an ellipsoid.
const PARAMETERS: usize = 9;

/// What the points of an attitude share: noise that is slower than a point, and what the model does not hold.
struct Noise {
    name: &'static str,
    /// Standard deviation of an attitude's mean, gauss.
    of_attitude_gauss: f64,
    dof: f64,
    /// Standard uncertainty of a parameter for one gauss of that, over the one that the fit states.
    per_gauss: f64,
}

impl Noise {
    fn of(captures: &[Capture], found: &ellipsoid::Ellipsoid) -> Self {
        let records: Vec<Vec<f64>> = captures
            .iter()
            .flat_map(|capture| {
                let blocks = captures::block_means(capture, Triad::Mag, capture.samples.len() / POINTS);
                [0, 1, 2].map(|axis| blocks.iter().map(|mean| mean[axis] / MAG_LSB_PER_GAUSS).collect())
            })
            .collect();
        let within = mean::variance(&records);
        // The fit takes every point as independent, and an attitude has so many of them.
        let per_gauss = (POINTS as f64).sqrt() / found.sigma;
        let of = |name, variance: f64, dof| Self { name, of_attitude_gauss: variance.sqrt(), dof, per_gauss };
        let distances = captures.iter().map(|capture| {
            let mean = captures::mean(capture, Triad::Mag) / MAG_LSB_PER_GAUSS;
            (found.matrix * (mean - found.centre)).norm() - found.field
        });
        let dof = captures.len().saturating_sub(PARAMETERS) as f64;
        if dof > 0.0 {
            let between = distances.map(|distance| distance * distance).sum::<f64>() / dof;
            if between / within.variance > rare_ratio(dof, &[within]) {
                return of("differences between attitudes", between, dof);
            }
        }
        of("noise, white and slow", within.variance, within.dof)
    }
}
