//! Calibration of the accelerometers from still positions.

use gnc_executive::bench::BenchSite;
use gnc_executive::catalogue::calibration::{FORCE_BIAS, FORCE_RESIDUAL, SCALE_ERROR};
use gnc_executive::catalogue::{TEMPERATURE, TEMPERATURE_DRIFT};
use gnc_executive::quantity::Unit;
use gnc_metrology::position::Position;
use gnc_metrology::{earth, six_position};
use gnc_protocol::stream::ACCEL_LSB_PER_G;
use nalgebra::Vector3;
use serde_json::json;

use super::axes::TriadFrames;
use super::budget::Budget;
use super::calibration::{AccelCalibration, CALIBRATION, ModuleCalibration};
use super::captures::{self, Triad};
use super::json::{matrix, rows, vector};
use super::mean::MeanVariance;
use super::place::{self, Gravity};
use super::still_fit::{Attitude, Design, attitudes, rare_ratio, scatter};
use super::{AnalysisInput, FigureError, Findings};
use crate::capture::Capture;
use crate::details::calibrating::{FORCE_RESIDUALS, ForceResidual};

/// The terms of the plan that the budgets need.
#[derive(Debug, Clone, Copy)]
pub(super) struct SixPositionTerms {
    pub(super) gravity: Gravity,
    pub(super) gravity_ppm: f64,
    pub(super) pose_rad: f64,
}

impl SixPositionTerms {
    pub(super) fn of(question: &AnalysisInput<'_>) -> Result<Self, FigureError> {
        Ok(Self {
            gravity: place::gravity(question.site)?,
            gravity_ppm: question.params.quantity("gravity_u", Unit::PartsPerMillion)?,
            pose_rad: question.params.quantity("pose_u", Unit::Radian)?,
        })
    }
}

/// A calibration with the data of its budgets.
#[derive(Debug)]
pub(super) struct SixPositionSolution {
    pub(super) found: six_position::SixPositionCalibration,
    design: Design,
    /// Variance of the mean of a position, square counts.
    noise: [MeanVariance; 3],
    known: SixPositionTerms,
    /// Sum of squared residuals over its expectation.
    residual_ratio: f64,
    /// Whether the residuals are larger than noise and attitudes explain. Then their own scatter is used.
    pub(super) excess: bool,
}

/// Computes the calibration from still captures; `expected` as for [`attitudes`].
pub(super) fn solve<'c>(
    captures: impl IntoIterator<Item = &'c Capture>,
    expected: Option<usize>,
    known: SixPositionTerms,
) -> Result<SixPositionSolution, FigureError> {
    let lying = attitudes(captures, expected, Triad::Accel)?;
    let positions: Vec<Position> = lying.iter().map(|attitude| position(attitude, Triad::Accel)).collect();
    let refused = || FigureError::refused("accelerometer calibration");
    let found = six_position::calibrate(&positions, known.gravity.mps2).map_err(refused())?;
    let design = Design::new(lying.iter().map(|attitude| attitude.up).collect(), known.gravity.mps2)
        .ok_or_else(|| FigureError::Missing { what: "attitudes that span space".into() })?;
    let mut solved = SixPositionSolution {
        found,
        design,
        noise: scatter(&lying, Triad::Accel),
        known,
        residual_ratio: 0.0,
        excess: false,
    };
    solved.judge_residuals();
    Ok(solved)
}

/// Returns a capture in the form that the method takes.
pub(super) fn position(attitude: &Attitude<'_>, triad: Triad) -> Position {
    Position {
        label: attitude.capture.about.label.clone(),
        up: attitude.up,
        mean: captures::mean(attitude.capture, triad),
        rows: attitude.capture.samples.len(),
        resolution_sd: Vector3::zeros(),
    }
}

impl SixPositionSolution {
    fn own(&self, i: usize) -> f64 {
        self.found.response[(i, i)]
    }

    fn judge_residuals(&mut self) {
        let c = &self.found;
        let squares: f64 = c.residuals_mps2.iter().map(Vector3::norm_squared).sum();
        let expected: f64 = (0..3)
            .map(|i| {
                let noise = self.noise[i].variance / self.own(i).powi(2);
                let pose = self.design.of_pose(i, self.known.gravity.mps2, self.known.pose_rad);
                self.design.left_over(|p| noise + pose(p))
            })
            .sum();
        self.residual_ratio = squares / expected;
        let dof = c.dof as f64;
        self.excess = self.residual_ratio > rare_ratio(dof, &self.noise);
        if self.excess {
            let variance = squares / dof;
            self.noise = [0, 1, 2].map(|i| MeanVariance { variance: variance * self.own(i).powi(2), dof });
        }
    }

    /// Returns the budget of a parameter of sensor `i` over its own response: 0 to 2 a relative response, 3 the offset
    /// in m/s^2. `factor` turns it into the unit.
    fn budget(&self, i: usize, parameter: usize, unit: Unit, factor: f64) -> Budget {
        let cofactor = self.design.cofactor[(parameter, parameter)];
        let noise = (self.noise[i].variance * cofactor).sqrt() / self.own(i) * factor;
        let pose = self.design.of_pose(i, self.known.gravity.mps2, self.known.pose_rad);
        let per_rad = if self.known.pose_rad > 0.0 && !self.excess {
            self.design.variance(parameter, pose).sqrt() / self.known.pose_rad * factor
        } else {
            // The scatter of the residuals already includes the attitudes.
            0.0
        };
        // One count is spread evenly over its step, and the noise spreads the means over many steps.
        let quantisation = 1.0 / 12.0_f64.sqrt() / self.own(i) * cofactor.sqrt() * factor / 100.0;
        Budget::new(unit)
            .a(
                if self.excess { "scatter of the residuals" } else { "noise of the positions' means" },
                noise,
                self.noise[i].dof,
            )
            .b("attitudes", self.known.pose_rad, "rad", per_rad)
            .b("quantisation", quantisation, unit.symbol(), 1.0)
    }

    /// Returns the budget of the bias of axis `i`, in mg.
    pub(super) fn bias_budget(&self, i: usize) -> Budget {
        self.budget(i, 3, Unit::Milligravity, 1e3 / earth::STANDARD_GRAVITY_MPS2)
    }

    /// Returns the budget of the response of sensor `i` to axis `j` over its own, ppm. With `i == j`: of the scale
    /// factor.
    pub(super) fn response_budget(&self, i: usize, j: usize) -> Budget {
        let budget = self.budget(i, j, Unit::PartsPerMillion, 1e6);
        if i == j { budget.b("gravity", self.known.gravity_ppm, "ppm", 1.0) } else { budget }
    }

    /// Returns the scale factor over the nominal one, less 1.
    pub(super) fn scale_error(&self, i: usize) -> f64 {
        self.own(i) / (ACCEL_LSB_PER_G / earth::STANDARD_GRAVITY_MPS2) - 1.0
    }
}

pub(super) fn analyse(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    let known = SixPositionTerms::of(question)?;
    for capture in question.captures {
        question.long_enough(capture, "dwell")?;
    }
    let expected = question.params.choice("positions")?.parse().ok();
    let solved = solve(question.captures, expected, known)?;
    let c = &solved.found;
    let accel = AccelCalibration { matrix: rows(&c.matrix), offset: c.nabla_mps2.into() };
    let mut findings = Findings::new(details(&solved));
    let residuals = question.captures.iter().zip(&c.residuals_mps2).map(|(capture, residual)| ForceResidual {
        position: capture.about.label.clone(),
        residual_mps2: (*residual).into(),
    });
    findings.part(&FORCE_RESIDUALS, residuals.collect());
    for (i, measurement) in FORCE_BIAS.iter().enumerate() {
        let bias_mg = c.bias_mps2()[i] / earth::STANDARD_GRAVITY_MPS2 * 1e3;
        findings.figure(measurement, bias_mg, &solved.bias_budget(i), probability);
    }
    for (i, measurement) in SCALE_ERROR.iter().enumerate() {
        let error_ppm = solved.scale_error(i) * 1e6;
        findings.figure(measurement, error_ppm, &solved.response_budget(i, i), probability);
    }
    let frames = TriadFrames { response: &c.response, fixture: BenchSite::fixture(question.site) };
    frames.report(&mut findings, |i, j| solved.response_budget(i, j), probability);
    let rms_mg = c.residual_rms_mps2 / earth::STANDARD_GRAVITY_MPS2 * 1e3;
    findings.number(&FORCE_RESIDUAL, rms_mg, Unit::Milligravity);
    temperatures(&mut findings, question.captures, Triad::Accel);
    findings.part(&CALIBRATION, ModuleCalibration { accel: Some(accel), ..ModuleCalibration::default() });
    Ok(findings)
}

/// Adds the mean temperature and its drift.
pub(super) fn temperatures(findings: &mut Findings, captures: &[Capture], triad: Triad) {
    let (mean_c, drift_k) = captures::temperature(captures, triad);
    findings.number(&TEMPERATURE, mean_c, Unit::DegreeCelsius);
    findings.number(&TEMPERATURE_DRIFT, drift_k, Unit::DegreeCelsius);
}

fn details(solved: &SixPositionSolution) -> serde_json::Value {
    let c = &solved.found;
    json!({
        "equation": "f = Ka N + nabla, from N = M f + b by least squares; f in m/s^2, +g on the axis that points up; N in counts",
        "Ka": matrix(&c.matrix), "nabla": vector(&c.nabla_mps2),
        "M": matrix(&c.response), "b": vector(&c.bias_lsb),
        "Ka_sd": matrix(&c.matrix_sd), "nabla_sd": vector(&c.bias_sd_mps2),
        "as_printed": { "Ka": matrix(&c.matrix_as_printed), "nabla": vector(&c.nabla_as_printed_mps2) },
        "coupling": matrix(&c.coupling()), "nonorthogonality_rad": vector(&c.nonorthogonality_rad()),
        "gravity_mps2": c.gravity_mps2, "gravity_from": solved.known.gravity.from,
        "residual_rms_mps2": c.residual_rms_mps2,
        "residual_ratio": solved.residual_ratio, "dof": c.dof, "condition": c.condition,
        "cofactor": (0..4).map(|r| (0..4).map(|k| solved.design.cofactor[(r, k)]).collect::<Vec<_>>()).collect::<Vec<_>>(),
        "noise_of_means": solved.noise.map(|noise| json!({ "sd_counts": noise.sd(), "dof": noise.dof })),
        "label": if solved.excess {
            "residuals larger than noise and attitudes explain: their own scatter is taken for the uncertainty"
        } else {
            "coefficients relative to the table; couplings relative to the seat (frames)"
        },
    })
}
