//! The magnetometer in its plane of rotation: ellipse, correction to a circle, roll angle.

use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_metrology::ellipse::{self, Correction, Ellipse};
use gnc_metrology::stats;
use gnc_protocol::stream::{MAG_LSB_PER_GAUSS, SATURATION};
use serde_json::json;

use super::budget::Budget;
use super::calibration::{self, Calibration, Mag};
use super::captures::{self, Triad};
use super::roll::{self, Roll};
use super::thin;
use super::{FigureError, Findings, Question};
use crate::capture::{Capture, Pose};

/// A table that turns more slowly or faster than this (relative) did not do what it was told.
const RATE_TOLERANCE: f64 = 0.02;
/// Least number of turns.
const TURNS: f64 = 3.0;

/// One spin.
struct Spin<'c> {
    capture: &'c Capture,
    /// Rate that the table was told, rad/s, right-handed.
    told_rps: f64,
    found: Ellipse,
    roll: Roll,
    /// With the print's correction from extremes.
    as_printed: Roll,
    /// Some of its points for a picture, gauss: raw.
    shown: Vec<(f64, f64)>,
}

pub(super) fn analyse(question: &Question<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    let spins: Vec<Spin<'_>> = question.captures.iter().map(Spin::of).collect::<Result<_, _>>()?;
    if spins.is_empty() {
        return Err(FigureError::Missing { what: "a spin about Z".into() });
    }
    let skew = Skew::of(&spins);
    let mut findings = Findings::new(details(&spins, &skew));
    let mean = |pick: &dyn Fn(&Ellipse) -> (f64, f64)| average(&spins, pick);
    let put = |findings: &mut Findings, name: &str, (value, u, dof): (f64, f64, f64), unit: Unit| {
        findings.figure(name, value, &Budget::new(unit).a("fit, or differences between spins", u, dof), probability);
        value
    };
    let dx = put(&mut findings, "zero_x", mean(&|e| (e.correction.dx, e.sd.correction.dx)), Unit::Gauss);
    let dy = put(&mut findings, "zero_y", mean(&|e| (e.correction.dy, e.sd.correction.dy)), Unit::Gauss);
    let ky = put(
        &mut findings,
        "sensitivity_ratio",
        mean(&|e| (e.correction.ky * 100.0, e.sd.correction.ky * 100.0)),
        Unit::Percent,
    ) / 100.0;
    let alpha = Budget::new(Unit::Degree).a("fit", skew.alpha_sd.to_degrees(), skew.dof);
    findings.figure("alpha", skew.alpha.to_degrees(), &alpha, probability);
    put(&mut findings, "radius", mean(&|e| (e.radius, e.sd.semi_axes[0])), Unit::Gauss);
    let worst = |pick: &dyn Fn(&Spin<'_>) -> f64| spins.iter().map(pick).fold(0.0, f64::max);
    findings.number("residual_rms", worst(&|spin| spin.found.residual_rms / spin.found.radius * 100.0), Unit::Percent);
    findings.number("residual_peak", worst(&|spin| spin.found.residual_peak * 100.0), Unit::Percent);
    for harmonic in [0, 1] {
        let largest =
            spins.iter().max_by(|a, b| a.roll.harmonics_rad[harmonic].total_cmp(&b.roll.harmonics_rad[harmonic]));
        if let Some(Spin { roll, capture, .. }) = largest {
            let noise = roll.noise_rad * (2.0 / capture.samples.len() as f64).sqrt();
            let budget =
                Budget::new(Unit::Degree).a("noise of the angle", noise.to_degrees(), capture.samples.len() as f64);
            let name = format!("roll_error_{}", harmonic + 1);
            findings.figure(name, roll.harmonics_rad[harmonic].to_degrees(), &budget, probability);
        }
    }
    match skew.skew_s {
        Some((skew_s, sd_s)) => {
            let budget = Budget::new(Unit::Microsecond).a("fit", sd_s * 1e6, skew.dof);
            findings.figure("skew", skew_s * 1e6, &budget, probability);
        }
        None => findings.put("skew", Value::NotAvailable("all spins have one rate: alpha and skew look alike".into())),
    }
    findings.put("lag", Value::NotAvailable("the record holds no angle of the table".into()));
    let rejected: usize = spins.iter().map(|spin| spin.found.rejected).sum();
    let used: usize = spins.iter().map(|spin| spin.found.used).sum();
    findings.number("rejected", 100.0 * rejected as f64 / (rejected + used) as f64, Unit::Percent);
    findings.number("turns", spins.iter().map(|spin| spin.roll.turns.abs()).fold(f64::INFINITY, f64::min), Unit::Count);
    let mag = Mag { dx, dy, ky, sin_alpha: skew.alpha.sin() };
    findings.detail(calibration::KEY, json!(Calibration { mag: Some(mag), ..Calibration::default() }));
    Ok(findings)
}

impl<'c> Spin<'c> {
    fn of(capture: &'c Capture) -> Result<Self, FigureError> {
        let label = || capture.about.label.clone();
        let Pose::Spinning { axis: 2, rate_dps, .. } = capture.about.pose else {
            return Err(FigureError::Unfit { label: label(), why: "it is no spin about Z".into() });
        };
        if capture.losses.any() {
            return Err(FigureError::Lost { label: label(), losses: capture.losses });
        }
        // X and Y are used; the gyroscopes are out of their range here, and Z does not count.
        let [x, y] = [0, 1].map(|axis| -> Vec<f64> {
            captures::channel(capture, Triad::Mag, axis).iter().map(|code| code / MAG_LSB_PER_GAUSS).collect()
        });
        let top = f64::from(SATURATION) / MAG_LSB_PER_GAUSS;
        let found = ellipse::fit(&x, &y, Some(top)).map_err(FigureError::refused(label()))?;
        let rate_hz = f64::from(capture.about.rate_hz);
        let told_rps = rate_dps.to_radians();
        let roll_of = |correct: &dyn Fn(f64, f64) -> (f64, f64)| {
            roll::analyse(x.iter().zip(&y).map(|(x, y)| correct(*x, *y)), told_rps / rate_hz, rate_hz)
        };
        let roll = roll_of(&|x, y| found.correction.apply(x, y));
        if (roll.rate_rps / told_rps - 1.0).abs() > RATE_TOLERANCE {
            let why =
                format!("the field turns at {:.2} deg/s, the table was told {rate_dps:.2}", roll.rate_rps.to_degrees());
            return Err(FigureError::Unfit { label: label(), why });
        }
        if roll.turns.abs() < TURNS {
            let refusal = gnc_metrology::Refusal::FewTurns { turns: roll.turns.abs(), needed: TURNS };
            return Err(FigureError::Refused { place: label(), refusal });
        }
        let extremes = found.extremes;
        let printed = Correction { dx: extremes.dx, dy: extremes.dy, ky: extremes.ky, ..found.correction };
        let as_printed = roll_of(&|x, y| printed.apply_as_printed(x, y));
        let corrected: Vec<(f64, f64)> = x.iter().zip(&y).map(|(x, y)| found.correction.apply(*x, *y)).collect();
        let shown = thin::rim(&corrected).into_iter().map(|place| (x[place], y[place])).collect();
        Ok(Self { capture, told_rps, found, roll, as_printed, shown })
    }

    /// The apparent alpha and its standard uncertainty, rad.
    fn alpha(&self) -> (f64, f64) {
        let sine = self.found.correction.sin_alpha;
        (sine.asin(), self.found.sd.correction.sin_alpha / (1.0 - sine * sine).sqrt())
    }
}

/// Mean over the spins with its standard uncertainty: that of the fits, or of the scatter between the spins where it is
/// larger.
fn average(spins: &[Spin<'_>], pick: &dyn Fn(&Ellipse) -> (f64, f64)) -> (f64, f64, f64) {
    let figures: Vec<(f64, f64)> = spins.iter().map(|spin| pick(&spin.found)).collect();
    let n = figures.len() as f64;
    let values: Vec<f64> = figures.iter().map(|(value, _)| *value).collect();
    let (mean, sd) = stats::mean_sd(&values);
    let of_fits = figures.iter().map(|(_, u)| u * u).sum::<f64>().sqrt() / n;
    let between = sd / n.sqrt();
    if between > of_fits {
        (mean, between, n - 1.0)
    } else {
        (mean, of_fits, spins.iter().map(|s| s.found.dof as f64).sum())
    }
}

/// Alpha and a sampling skew between X and Y, told apart by the rates: a Y that is sampled `skew` later looks like
/// `alpha - rate * skew`.
struct Skew {
    alpha: f64,
    alpha_sd: f64,
    /// Value and standard uncertainty, s; `None` where all rates are alike.
    skew_s: Option<(f64, f64)>,
    dof: f64,
}

impl Skew {
    fn of(spins: &[Spin<'_>]) -> Self {
        let points: Vec<(f64, f64, f64)> = spins
            .iter()
            .map(|spin| {
                let (alpha, sd) = spin.alpha();
                (spin.told_rps, alpha, 1.0 / (sd * sd))
            })
            .collect();
        let sum =
            |term: &dyn Fn(f64, f64) -> f64| points.iter().map(|(rate, alpha, w)| w * term(*rate, *alpha)).sum::<f64>();
        let (w, wr, wrr) = (sum(&|_, _| 1.0), sum(&|r, _| r), sum(&|r, _| r * r));
        let (wa, wra) = (sum(&|_, a| a), sum(&|r, a| r * a));
        let determinant = w * wrr - wr * wr;
        let dof = spins.iter().map(|spin| spin.found.dof as f64).sum();
        if determinant <= 1e-9 * w * wrr {
            return Self { alpha: wa / w, alpha_sd: w.sqrt().recip(), skew_s: None, dof };
        }
        let alpha = (wrr * wa - wr * wra) / determinant;
        let slope = (w * wra - wr * wa) / determinant;
        let (alpha_sd, slope_sd) = ((wrr / determinant).sqrt(), (w / determinant).sqrt());
        Self { alpha, alpha_sd, skew_s: Some((-slope, slope_sd)), dof }
    }
}

fn details(spins: &[Spin<'_>], skew: &Skew) -> serde_json::Value {
    let rows: Vec<_> = spins
        .iter()
        .map(|spin| {
            let (e, c) = (&spin.found, &spin.found.correction);
            json!({
                "capture": spin.capture.about.label, "told_dps": spin.told_rps.to_degrees(),
                "rate_dps": spin.roll.rate_rps.to_degrees(), "turns": spin.roll.turns,
                "centre": e.centre, "semi_axes": e.semi_axes, "rotation_deg": e.rotation_deg, "radius": e.radius,
                "dx": c.dx, "dy": c.dy, "ky": c.ky, "sin_alpha": c.sin_alpha, "alpha_deg": spin.alpha().0.to_degrees(),
                "sd": { "dx": e.sd.correction.dx, "dy": e.sd.correction.dy, "ky": e.sd.correction.ky, "sin_alpha": e.sd.correction.sin_alpha },
                "residual_rms": e.residual_rms, "residual_peak_relative": e.residual_peak,
                "rejected": e.rejected, "used": e.used, "dof": e.dof, "condition": e.condition, "gap_deg": e.gap_deg,
                "roll_harmonics_deg": spin.roll.harmonics_rad.map(f64::to_degrees),
                "as_printed": {
                    "dx": e.extremes.dx, "dy": e.extremes.dy, "ky": e.extremes.ky, "residual_rms": e.residual_rms_as_printed,
                    "roll_harmonics_deg": spin.as_printed.harmonics_rad.map(f64::to_degrees),
                },
            })
        })
        .collect();
    let field: Vec<_> = spins
        .iter()
        .map(|spin| {
            json!({
                "capture": spin.capture.about.label,
                "x_gauss": thin::rounded(spin.shown.iter().map(|(x, _)| *x), 6),
                "y_gauss": thin::rounded(spin.shown.iter().map(|(_, y)| *y), 6),
            })
        })
        .collect();
    json!({
        "field": field,
        "equation": "y' = ky (y - dy), x' = ((x - dx) - y' sin(alpha)) / cos(alpha), roll = atan2(-y', x') plus a constant; gauss at nominal scale",
        "spins": rows, "alpha_deg": skew.alpha.to_degrees(),
        "skew_us": skew.skew_s.map(|(skew_s, _)| skew_s * 1e6),
        "label": if skew.skew_s.is_some() {
            "alpha at rest, freed of the sampling skew; the roll errors are those of each spin with its own correction"
        } else {
            "alpha with a sampling skew in it: spin in both senses to tell them apart"
        },
    })
}
