//! The magnetometer in its plane of rotation: ellipse, correction to a circle, roll angle.

use gnc_executive::bench::{BenchImperfections, BenchSite};
use gnc_executive::catalogue::magnetometer;
use gnc_executive::measurement::Value;
use gnc_executive::quantity::Unit;
use gnc_metrology::ellipse::{self, Correction, Ellipse};
use gnc_metrology::stats;
use gnc_protocol::stream::{MAG_LSB_PER_GAUSS, SATURATION};
use serde_json::json;

use super::budget::Budget;
use super::calibration::{CALIBRATION, Mag, ModuleCalibration};
use super::captures::{self, Triad};
use super::mean::MeanVariance;
use super::roll::{self, Roll};
use super::spin_blocks::{self, FIGURES};
use super::still_fit::rare_ratio;
use super::{AnalysisInput, FigureError, Findings, thin};
use crate::capture::{Capture, Pose};
use crate::details::calibrating::{self as details, FIELD, SPINS};

/// Largest relative departure of the table's rate. Beyond it the table did not do what was commanded.
const RATE_TOLERANCE: f64 = 0.02;
/// Least number of turns.
const TURNS: f64 = 3.0;

/// One spin.
struct Spin<'c> {
    capture: &'c Capture,
    /// Rate commanded to the table, rad/s, right-handed.
    told_rps: f64,
    found: Ellipse,
    roll: Roll,
    /// Figures of the spin, block by block.
    blocks: Vec<[f64; FIGURES]>,
    /// Roll with the print's correction from extremes.
    as_printed: Roll,
    /// Some raw points of the spin for a picture, gauss.
    shown: Vec<(f64, f64)>,
}

pub(super) fn analyse(question: &AnalysisInput<'_>) -> Result<Findings, FigureError> {
    let probability = question.probability()?;
    let spins: Vec<Spin<'_>> = question.captures.iter().map(Spin::of).collect::<Result<_, _>>()?;
    if spins.is_empty() {
        return Err(FigureError::Missing { what: "a spin about Z".into() });
    }
    let known = Known::of(&spins, question);
    let skew = Skew::of(&spins, &known);
    let mut findings = Findings::new(details(&skew));
    findings.part(&SPINS, spins.iter().map(Spin::detail).collect());
    findings.part(&FIELD, spins.iter().map(Spin::field).collect());
    let dx = known.put(&mut findings, Figure::ZeroX, &spins, |e| e.correction.dx, probability);
    let dy = known.put(&mut findings, Figure::ZeroY, &spins, |e| e.correction.dy, probability);
    let ky = known.put(&mut findings, Figure::Ky, &spins, |e| e.correction.ky, probability);
    let alpha =
        known.disturbed(Figure::SinAlpha, Budget::new(Unit::Degree).a(NOISE, skew.alpha_sd.to_degrees(), skew.dof));
    findings.figure(&magnetometer::ALPHA, skew.alpha.to_degrees(), &alpha, probability);
    known.put(&mut findings, Figure::Radius, &spins, |e| e.radius, probability);
    let worst = |pick: &dyn Fn(&Spin<'_>) -> f64| spins.iter().map(pick).fold(0.0, f64::max);
    findings.number(
        &magnetometer::RESIDUAL_RMS,
        worst(&|spin| spin.found.residual_rms / spin.found.radius * 100.0),
        Unit::Percent,
    );
    findings.number(&magnetometer::RESIDUAL_PEAK, worst(&|spin| spin.found.residual_peak * 100.0), Unit::Percent);
    for harmonic in [0, 1] {
        let largest =
            spins.iter().max_by(|a, b| a.roll.harmonics_rad[harmonic].total_cmp(&b.roll.harmonics_rad[harmonic]));
        if let Some(Spin { roll, .. }) = largest {
            let noise = roll.noise[harmonic];
            let budget = Budget::new(Unit::Degree).of_length().a(NOISE, noise.sd().to_degrees(), noise.dof);
            let budget = if harmonic == 0 { known.of_roll_once(budget) } else { known.of_roll_twice(budget) };
            findings.figure(
                &magnetometer::ROLL_ERROR[harmonic],
                roll.harmonics_rad[harmonic].to_degrees(),
                &budget,
                probability,
            );
        }
    }
    match skew.skew_s {
        Some((skew_s, sd_s)) => {
            let budget = Budget::new(Unit::Microsecond).a("fit", sd_s * 1e6, skew.dof);
            findings.figure(&magnetometer::SKEW, skew_s * 1e6, &budget, probability);
        }
        None => findings
            .put(&magnetometer::SKEW, Value::NotAvailable("all spins have one rate: alpha and skew look alike".into())),
    }
    findings.put(&magnetometer::LAG, Value::NotAvailable("the record holds no angle of the table".into()));
    let rejected: usize = spins.iter().map(|spin| spin.found.rejected).sum();
    let used: usize = spins.iter().map(|spin| spin.found.used).sum();
    findings.number(&magnetometer::REJECTED_SHARE, 100.0 * rejected as f64 / (rejected + used) as f64, Unit::Percent);
    findings.number(
        &magnetometer::TURNS,
        spins.iter().map(|spin| spin.roll.turns.abs()).fold(f64::INFINITY, f64::min),
        Unit::Count,
    );
    let mag = Mag { dx, dy, ky, sin_alpha: skew.alpha.sin() };
    findings.part(&CALIBRATION, ModuleCalibration { mag: Some(mag), ..ModuleCalibration::default() });
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
        // X and Y are used. The gyroscopes are out of their range here, and Z does not count.
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
        let blocks = spin_blocks::of_spin(&corrected, found.radius, roll.rate_rps / rate_hz);
        Ok(Self { capture, told_rps, found, roll, blocks, as_printed, shown })
    }

    /// The apparent alpha, rad.
    fn alpha(&self) -> f64 {
        self.found.correction.sin_alpha.asin()
    }
}

/// Name of the type A contribution.
const NOISE: &str = "noise, white and slow";

/// A figure of a spin, in the order of the figures of the blocks.
#[derive(Clone, Copy)]
enum Figure {
    ZeroX,
    ZeroY,
    Ky,
    SinAlpha,
    Radius,
}

/// The data of the budgets.
struct Known {
    /// Variances of the figures of one spin.
    noise: [MeanVariance; FIGURES],
    fixture: BenchImperfections,
    /// Change of the sensor's temperature over all spins, K.
    drift_k: f64,
    /// The field along the axis of the turn, and the field across it, gauss.
    axial_gauss: f64,
    across_gauss: f64,
}

/// The strongest field of the earth, used where the bench file gives no field.
const STRONGEST_GAUSS: f64 = 0.67;

/// Change of the zero of a magnetoresistive sensor per kelvin, from data sheets of parts with set and reset.
const ZERO_PER_K_GAUSS: f64 = 20e-6;

/// Standard uncertainty of rounding to one count.
const QUANTUM_GAUSS: f64 = 0.288_675_134_594_812_9 / MAG_LSB_PER_GAUSS;

impl Known {
    fn of(spins: &[Spin<'_>], question: &AnalysisInput<'_>) -> Self {
        let blocks: Vec<&[[f64; FIGURES]]> = spins.iter().map(|spin| spin.blocks.as_slice()).collect();
        let across_gauss = stats::mean(&spins.iter().map(|spin| spin.found.radius).collect::<Vec<_>>());
        let total = question.site.and_then(|site| site.field_gauss).unwrap_or(STRONGEST_GAUSS);
        Self {
            noise: spin_blocks::variances(&blocks).unwrap_or_else(|| of_fits(spins)),
            fixture: BenchSite::fixture(question.site),
            drift_k: captures::temperature(question.captures, Triad::Mag).1,
            axial_gauss: (total * total - across_gauss * across_gauss).max(0.0).sqrt(),
            across_gauss,
        }
    }

    /// Adds the mean over the spins with its budget, and returns the mean.
    fn put(
        &self,
        findings: &mut Findings,
        figure: Figure,
        spins: &[Spin<'_>],
        pick: impl Fn(&Ellipse) -> f64,
        probability: f64,
    ) -> f64 {
        let (measurement, unit, factor) = match figure {
            Figure::ZeroX => (magnetometer::ZERO_OF_AXIS[0], Unit::Gauss, 1.0),
            Figure::ZeroY => (magnetometer::ZERO_OF_AXIS[1], Unit::Gauss, 1.0),
            Figure::Ky => (magnetometer::SENSITIVITY_RATIO, Unit::Percent, 100.0),
            Figure::SinAlpha => (magnetometer::ALPHA, Unit::Degree, 1.0_f64.to_degrees()),
            Figure::Radius => (magnetometer::RADIUS, Unit::Gauss, 1.0),
        };
        let values: Vec<f64> = spins.iter().map(|spin| pick(&spin.found)).collect();
        let (mean, contribution, u, dof) = average(&values, &self.noise[figure as usize]);
        let budget = self.disturbed(figure, Budget::new(unit).a(contribution, u * factor, dof));
        findings.figure(&measurement, mean * factor, &budget, probability);
        mean
    }

    /// Adds the effects of the bench on a figure that the record cannot show.
    fn disturbed(&self, figure: Figure, budget: Budget) -> Budget {
        let fixture = &self.fixture;
        let [about_x, about_y, _] = fixture.mounting_rad.unwrap_or_default();
        // A tilt in step with the turn makes a circle an ellipse. One component of the tilt lengthens x and shortens y,
        // the other one does so along the diagonals.
        let runout = 2.0 * self.axial_gauss / self.across_gauss;
        match figure {
            Figure::ZeroX => self.of_zero(budget, about_y, 1.0),
            Figure::ZeroY => self.of_zero(budget, about_x, 1.0),
            Figure::Ky => budget.b("runout of the axis", fixture.runout_u_rad, "rad", 100.0 * runout),
            Figure::SinAlpha => budget.b("runout of the axis", fixture.runout_u_rad, "rad", runout.to_degrees()),
            Figure::Radius => budget
                .b("alignment of the axis", fixture.axis_u_rad, "rad", self.axial_gauss)
                .b("ambient field", fixture.ambient_u_gauss, "gauss", 1.0)
                .b("quantisation", QUANTUM_GAUSS, "gauss", 1.0),
        }
    }

    /// Adds the effects on a figure that a zero changes by `per_gauss`. The axis of the turn is not exactly that of the
    /// module, so a part of the field along it stays on x and y.
    fn of_zero(&self, budget: Budget, known_rad: f64, per_gauss: f64) -> Budget {
        let axial = self.axial_gauss * per_gauss;
        budget
            .b("mounting of the seat", self.fixture.mounting_u_rad, "rad", axial)
            .bound("known mounting, not corrected", known_rad.abs(), "rad", axial)
            .b("field of the fixture", self.fixture.field_u_gauss, "gauss", per_gauss)
            .bound("temperature within the item", self.drift_k / 2.0, "degC", ZERO_PER_K_GAUSS * per_gauss)
            .b("quantisation", QUANTUM_GAUSS, "gauss", per_gauss)
    }

    /// Adds the effects on the roll error once a turn, deg. An error of either zero turns the angle by its part of the
    /// radius.
    fn of_roll_once(&self, budget: Budget) -> Budget {
        let [about_x, about_y, _] = self.fixture.mounting_rad.unwrap_or_default();
        let known_rad = about_x.hypot(about_y) / 2.0_f64.sqrt();
        self.of_zero(budget, known_rad, self.across_gauss.recip().to_degrees())
    }

    /// Adds the effects on the roll error twice a turn, deg: half the errors of ky and alpha. The fit takes the runout
    /// for the sensor's own error, so that the angle of the record does not show it.
    fn of_roll_twice(&self, budget: Budget) -> Budget {
        let tilt = self.axial_gauss / self.across_gauss;
        budget.b("runout of the axis", self.fixture.runout_u_rad, "rad", tilt.to_degrees())
    }
}

/// Variances of one spin from the fits, which contain only white noise. A spin of a few turns shows no more.
fn of_fits(spins: &[Spin<'_>]) -> [MeanVariance; FIGURES] {
    let dof = spins.iter().map(|spin| spin.found.dof as f64).sum();
    let pick = [
        |e: &Ellipse| e.sd.correction.dx,
        |e: &Ellipse| e.sd.correction.dy,
        |e: &Ellipse| e.sd.correction.ky,
        |e: &Ellipse| e.sd.correction.sin_alpha,
        |e: &Ellipse| e.sd.semi_axes[0],
    ];
    pick.map(|sd| {
        let squares: f64 = spins.iter().map(|spin| sd(&spin.found).powi(2)).sum();
        MeanVariance { variance: squares / spins.len().max(1) as f64, dof }
    })
}

/// Mean over the spins, the name of its type A contribution, its standard uncertainty and degrees of freedom. The
/// uncertainty comes from the noise within the spins, or from the scatter between them where chance gives such a
/// scatter once in a thousand times.
fn average(values: &[f64], noise: &MeanVariance) -> (f64, &'static str, f64, f64) {
    let n = values.len() as f64;
    let (mean, sd) = if values.len() > 1 { stats::mean_sd(values) } else { (values[0], 0.0) };
    let ratio = sd * sd / noise.variance;
    if values.len() > 1 && ratio > rare_ratio(n - 1.0, std::slice::from_ref(noise)) {
        return (mean, "differences between spins", sd / n.sqrt(), n - 1.0);
    }
    (mean, NOISE, noise.sd() / n.sqrt(), noise.dof)
}

/// Alpha and a sampling skew between X and Y. The rates separate them: a Y that is sampled `skew` later looks like
/// `alpha - rate * skew`.
struct Skew {
    alpha: f64,
    alpha_sd: f64,
    /// Value and standard uncertainty, s; `None` where all rates are equal.
    skew_s: Option<(f64, f64)>,
    dof: f64,
}

impl Skew {
    fn of(spins: &[Spin<'_>], known: &Known) -> Self {
        let noise = &known.noise[Figure::SinAlpha as usize];
        let weight = |sine: f64| (1.0 - sine * sine) / noise.variance;
        let points: Vec<(f64, f64, f64)> =
            spins.iter().map(|spin| (spin.told_rps, spin.alpha(), weight(spin.found.correction.sin_alpha))).collect();
        let sum =
            |term: &dyn Fn(f64, f64) -> f64| points.iter().map(|(rate, alpha, w)| w * term(*rate, *alpha)).sum::<f64>();
        let (w, wr, wrr) = (sum(&|_, _| 1.0), sum(&|r, _| r), sum(&|r, _| r * r));
        let (wa, wra) = (sum(&|_, a| a), sum(&|r, a| r * a));
        let determinant = w * wrr - wr * wr;
        let dof = noise.dof;
        if determinant <= 1e-9 * w * wrr {
            return Self { alpha: wa / w, alpha_sd: w.sqrt().recip(), skew_s: None, dof };
        }
        let alpha = (wrr * wa - wr * wra) / determinant;
        let slope = (w * wra - wr * wa) / determinant;
        let (alpha_sd, slope_sd) = ((wrr / determinant).sqrt(), (w / determinant).sqrt());
        Self { alpha, alpha_sd, skew_s: Some((-slope, slope_sd)), dof }
    }
}

impl Spin<'_> {
    fn detail(&self) -> details::FieldSpin {
        let (e, c, sd) = (&self.found, &self.found.correction, &self.found.sd.correction);
        let degrees = |rad: [f64; 2]| rad.map(|rad| Some(rad.to_degrees()));
        details::FieldSpin {
            capture: self.capture.about.label.clone(),
            told_dps: self.told_rps.to_degrees(),
            rate_dps: self.roll.rate_rps.to_degrees(),
            turns: Some(self.roll.turns),
            centre: e.centre,
            semi_axes: e.semi_axes,
            rotation_deg: e.rotation_deg,
            radius: e.radius,
            dx: c.dx,
            dy: c.dy,
            ky: c.ky,
            sin_alpha: c.sin_alpha,
            alpha_deg: self.alpha().to_degrees(),
            sd: details::SpinSd { dx: Some(sd.dx), dy: Some(sd.dy), ky: Some(sd.ky), sin_alpha: Some(sd.sin_alpha) },
            residual_rms: Some(e.residual_rms),
            residual_peak_relative: Some(e.residual_peak),
            rejected: e.rejected,
            used: e.used,
            dof: e.dof,
            condition: Some(e.condition),
            gap_deg: Some(e.gap_deg),
            roll_harmonics_deg: degrees(self.roll.harmonics_rad),
            as_printed: details::SpinAsPrinted {
                dx: Some(e.extremes.dx),
                dy: Some(e.extremes.dy),
                ky: Some(e.extremes.ky),
                residual_rms: Some(e.residual_rms_as_printed),
                roll_harmonics_deg: degrees(self.as_printed.harmonics_rad),
            },
        }
    }

    /// The field to which the ellipse was fitted, thinned.
    fn field(&self) -> details::FieldPoints {
        details::FieldPoints {
            capture: self.capture.about.label.clone(),
            x_gauss: thin::rounded(self.shown.iter().map(|(x, _)| *x), 6),
            y_gauss: thin::rounded(self.shown.iter().map(|(_, y)| *y), 6),
        }
    }
}

fn details(skew: &Skew) -> serde_json::Value {
    json!({
        "equation": "y' = ky (y - dy), x' = ((x - dx) - y' sin(alpha)) / cos(alpha), roll = atan2(-y', x') plus a constant; gauss at nominal scale",
        "alpha_deg": skew.alpha.to_degrees(),
        "skew_us": skew.skew_s.map(|(skew_s, _)| skew_s * 1e6),
        "label": if skew.skew_s.is_some() {
            "alpha at rest, freed of the sampling skew; the roll errors are those of each spin with its own correction"
        } else {
            "alpha with a sampling skew in it: spin in both senses to tell them apart"
        },
    })
}
