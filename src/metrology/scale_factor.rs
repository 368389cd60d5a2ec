//! Scale factor of one sensor from its output at many inputs: `x = K w + F0` by least squares.
//!
//! The input w is a rate of a gyroscope, or the specific force of an accelerometer; the output x has the record's unit.
//! Names and formulas come from IEEE Std 528 (terms) and GJB 2426A (tests of fibre-optic gyroscopes):
//!
//! - *nonlinearity over the full scale* (GJB 2426A: `max |F_j fitted - F_j| / |F_m|`; IEEE Std 528: linearity error in
//!   percent of full scale): the largest distance from the line over `|K| w_max`. The print's F_m is an output less the
//!   output at rest; here it is the output of the line, so that no single point decides.
//! - *nonlinearity over the output* (IEEE Std 528: linearity error in percent of output): the largest distance over
//!   `|K w_j|` of the same point. It does not exist at rest, below a thousandth of the largest input. At small rates it
//!   is mostly noise.
//! - *asymmetry* (GJB 2426A: `|K+ - K-|` over the mean of both; IEEE Std 528 divides by K of the whole range, which
//!   differs by the square of it): lines through the points of each direction alone.
//! - *repeatability* (GJB 2426A): sample standard deviation (n - 1) of the K of each cycle over their mean.
//!
//! All uncertainties are of type A. Errors of the table's rate that all points share go into K one to one.

mod line;
mod rows;

use statrs::distribution::{ContinuousCDF, FisherSnedecor};
use thiserror::Error;

use crate::stability::{Repeatability, repeatability};
use crate::{Refusal, series, stats};
use line::Line;

pub use rows::{RatePoint, RateRows};

/// The equation of the parameters.
pub const EQUATION: &str = "x = scale_factor rate + offset";

/// Largest distance of a point from the line, over the full scale. A point beyond it has a wrong sign or wrong rows, or
/// the sensor does not work.
pub const RESIDUAL_LIMIT: f64 = 0.05;

/// Inputs below this part of the largest input count as rest, where a distance over the output has no meaning.
const REST: f64 = 1e-3;

/// Different rates that a line with a residual needs.
const FEWEST: usize = 3;

/// The limits for the points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScaleFactorOptions {
    /// End of the input range to which the nonlinearity refers; the largest input of the record where `None`.
    pub full_scale: Option<f64>,
    /// Largest residual allowed, over the full scale.
    pub residual: f64,
}

impl Default for ScaleFactorOptions {
    fn default() -> Self {
        Self { full_scale: None, residual: RESIDUAL_LIMIT }
    }
}

/// A figure with its standard uncertainty (type A).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Value.
    pub value: f64,
    /// Standard uncertainty.
    pub sd: f64,
    /// Degrees of freedom of the uncertainty.
    pub dof: f64,
}

impl Estimate {
    /// Returns the half width of the 95 % interval (Student's t).
    #[must_use]
    pub fn expanded(&self) -> f64 {
        stats::coverage_factor(0.95, self.dof) * self.sd
    }

    /// Adds an error that the scatter does not show.
    fn beside(self, error_sd: f64) -> Self {
        Self { sd: self.sd.hypot(error_sd), ..self }
    }

    fn over(self, divisor: f64) -> Self {
        Self { value: self.value / divisor, sd: self.sd / divisor.abs(), dof: self.dof }
    }

    /// Mean of one value for each cycle. The scatter of the cycles gives its uncertainty.
    fn of_cycles(values: &[f64]) -> Self {
        let (value, sd) = stats::mean_sd(values);
        Self { value, sd: sd / (values.len() as f64).sqrt(), dof: values.len() as f64 - 1.0 }
    }
}

/// Why a figure does not exist.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MissingFigure {
    /// Fewer than two rates of one direction.
    #[error("{rates} rates of the {sense} sense{place}, a line needs 2")]
    FewOfOneSense {
        /// `positive` or `negative`.
        sense: &'static str,
        /// Different rates of that direction.
        rates: usize,
        /// Empty, or ` in cycle N`.
        place: String,
    },
    /// Two rates of a direction have no residual.
    #[error(
        "the line of one sense goes through both of its points; an interval needs 3 rates of each sense, or cycles"
    )]
    NoResidual,
    /// The record has a single cycle.
    #[error("the record holds one cycle; number several in the column cycle")]
    OneCycle,
    /// No rate was visited twice.
    #[error("no rate comes twice")]
    NoRateTwice,
    /// The cycles have different rates.
    #[error("the cycles do not have the same rates")]
    Unbalanced,
    /// Repeated points agree exactly.
    #[error("repeated points agree exactly")]
    NoScatter,
}

/// Points of one rate over all visits and cycles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurvePoint {
    /// Input.
    pub rate: f64,
    /// Mean output.
    pub output: f64,
    /// Mean distance from the line of its own cycle, unit of the output.
    pub residual: f64,
    /// Visits that were averaged.
    pub visits: usize,
    /// `residual` over the full scale.
    pub of_full_scale: f64,
    /// `residual` over the output of the line at this rate; `None` at rest.
    pub of_output: Option<f64>,
}

/// The largest of a kind of residual, and its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Largest {
    /// Size of the residual, relative.
    pub value: f64,
    /// Rate at which the residual lies.
    pub rate: f64,
    /// Ends of an interval that holds the largest distance of the sensor itself with 95 % and more, relative. All
    /// residuals at once lie within the scatter of repeated points (Bonferroni). `None` without repeated points.
    pub interval: Option<(f64, f64)>,
}

impl Largest {
    /// Finds the largest of the residuals times a factor. Points without a factor are left out.
    fn of(curve: &[CurvePoint], reach: Option<&[f64]>, factor: impl Fn(&CurvePoint) -> Option<f64>) -> Self {
        let mut found = Self { value: 0.0, rate: f64::NAN, interval: reach.map(|_| (0.0, 0.0)) };
        for (i, (point, factor)) in curve.iter().enumerate().filter_map(|(i, p)| Some((i, (p, factor(p)?)))) {
            let value = point.residual.abs() * factor;
            if value > found.value || found.rate.is_nan() {
                (found.value, found.rate) = (value, point.rate);
            }
            if let (Some((low, high)), Some(reach)) = (&mut found.interval, reach) {
                *low = low.max(value - reach[i] * factor);
                *high = high.max(value + reach[i] * factor);
            }
        }
        found
    }
}

/// Whether the residuals are more than the scatter of repeated points (F test).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LackOfFit {
    /// Mean square of the curve about the line over that of repeated points about the curve.
    pub f: f64,
    /// Probability of a ratio as large as this where the sensor is linear.
    pub p: f64,
    /// Degrees of freedom of the numerator: different rates - 2.
    pub dof: f64,
    /// Degrees of freedom of the scatter of repeated points.
    pub pure_dof: f64,
    /// Standard deviation of one point, from that scatter, unit of the output.
    pub pure_sd: f64,
}

/// K of each direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Asymmetry {
    /// K of the positive inputs alone; the mean of the cycles.
    pub positive: f64,
    /// K of the negative inputs alone.
    pub negative: f64,
    /// `|K+ - K-|` over the mean of both.
    pub relative: f64,
    /// Standard uncertainty of `relative` and its degrees of freedom, where there is one.
    pub uncertainty: Option<(f64, f64)>,
}

/// One cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cycle {
    /// Number of the cycle.
    pub number: f64,
    /// Number of points in the cycle.
    pub points: usize,
    /// K of the cycle.
    pub scale_factor: f64,
    /// F0 of the cycle.
    pub offset: f64,
}

/// A point that stands out of the scatter of the other points of its cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Suspect {
    /// The point.
    pub point: RatePoint,
    /// Residual of the point over the standard deviation that the other points give it.
    pub studentised: f64,
}

/// The result of `fit`.
#[derive(Debug, Clone, PartialEq)]
pub struct ScaleFactor {
    /// K, unit of the output per unit of the input. With one cycle the uncertainty comes from the residuals; with
    /// several cycles K is their mean and the uncertainty comes from their scatter.
    pub scale_factor: Estimate,
    /// F0, unit of the output: the bias as an output, measured less true, with the earth's rotation along the axis.
    pub offset: Estimate,
    /// Input to which the nonlinearity refers.
    pub full_scale: f64,
    /// Root mean square of the residuals, unit of the output.
    pub residual_rms: f64,
    /// Points by rate, rising.
    pub curve: Vec<CurvePoint>,
    /// Largest residual over the full scale.
    pub nonlinearity_full_scale: Largest,
    /// Largest residual over the output.
    pub nonlinearity_output: Largest,
    /// Test of the line by repeated points.
    pub lack_of_fit: Result<LackOfFit, MissingFigure>,
    /// Difference of the two directions.
    pub asymmetry: Result<Asymmetry, MissingFigure>,
    /// Cycles, in the order of the record.
    pub cycles: Vec<Cycle>,
    /// Spread of K over the cycles. Divide by `scale_factor.value` for the relative spread.
    pub repeatability: Result<Repeatability, MissingFigure>,
    /// Points that stand out.
    pub suspects: Vec<Suspect>,
}

/// Fits the line and computes the figures that the standards derive from it.
///
/// # Errors
/// [`Refusal::NotFinite`], [`Refusal::Parameter`]; [`Refusal::FewRates`] below three different inputs in a cycle;
/// [`Refusal::Constant`] for a dead output, [`Refusal::Alike`] for copied cycles, which agree to the last digit;
/// [`Refusal::OffLine`] for a point that misses the line by more than the limit, relative to the largest input.
pub fn fit(points: &[RatePoint], options: &ScaleFactorOptions) -> Result<ScaleFactor, Refusal> {
    for (name, of) in
        [("rate", (|p| p.rate) as fn(&RatePoint) -> f64), ("output", |p| p.output), ("cycle", |p| p.cycle)]
    {
        series::finite(name, &points.iter().map(of).collect::<Vec<_>>())?;
    }
    series::positive("residual limit", options.residual)?;
    enough("", points)?;
    if points.iter().all(|p| p.output == points[0].output) {
        let samples = points.iter().map(|p| p.rows).sum();
        return Err(Refusal::Constant { channel: "output".to_owned(), samples, value: points[0].output });
    }
    let cycles = by_cycle(points);
    for of_cycle in cycles.iter().filter(|_| cycles.len() > 1) {
        enough(&place(of_cycle, &cycles), of_cycle)?;
    }
    let lines: Vec<Line> = cycles.iter().map(|of_cycle| Line::through(of_cycle)).collect();
    let resolution_sd = points.iter().map(|p| p.resolution_sd).fold(0.0, f64::max);
    let of_steps = |k: usize| lines.iter().map(|line| line.reach[k]).fold(0.0, f64::max) * resolution_sd;
    let (scale_factor, offset) = match &lines[..] {
        [line] => (line.slope_estimate(), line.offset_estimate()),
        _ => {
            let each = |of: fn(&Line) -> f64| Estimate::of_cycles(&lines.iter().map(of).collect::<Vec<_>>());
            (each(|line| line.slope), each(|line| line.offset))
        }
    };
    let (scale_factor, offset) = (scale_factor.beside(of_steps(0)), offset.beside(of_steps(1)));
    let repeatability = match &lines[..] {
        [_] => Err(MissingFigure::OneCycle),
        [first, ..] if lines.iter().all(|line| line.slope == first.slope) => {
            let what = "scale factors of the cycles";
            return Err(Refusal::Alike { what, count: lines.len(), value: first.slope });
        }
        _ => Ok(repeatability(&lines.iter().map(|line| line.slope).collect::<Vec<_>>(), of_steps(0))?),
    };
    let k = scale_factor.value;
    let largest_rate = points.iter().map(|p| p.rate.abs()).fold(0.0, f64::max);
    let full_scale = match options.full_scale {
        Some(full_scale) => series::positive("full scale", full_scale)?,
        None => largest_rate,
    };
    let residuals: Vec<(RatePoint, f64)> = cycles
        .iter()
        .zip(&lines)
        .flat_map(|(of_cycle, line)| of_cycle.iter().map(|p| (*p, line.residual(p))))
        .collect();
    on_line(&residuals, (k * largest_rate).abs(), options.residual)?;

    let curve = curve(&residuals, k, full_scale, largest_rate);
    let lack_of_fit = lack_of_fit(&residuals, &curve, &cycles);
    let reach = lack_of_fit.as_ref().ok().map(|test| reach(&curve, test, resolution_sd));
    let of_full_scale = |_: &CurvePoint| Some(1.0 / (k * full_scale).abs());
    let of_output = |p: &CurvePoint| p.of_output.map(|_| 1.0 / (k * p.rate).abs());
    let squares: f64 = residuals.iter().map(|(_, r)| r * r).sum();
    Ok(ScaleFactor {
        scale_factor,
        offset,
        full_scale,
        residual_rms: (squares / residuals.len() as f64).sqrt(),
        nonlinearity_full_scale: Largest::of(&curve, reach.as_deref(), of_full_scale),
        nonlinearity_output: Largest::of(&curve, reach.as_deref(), of_output),
        lack_of_fit,
        asymmetry: asymmetry(&cycles, resolution_sd),
        repeatability,
        suspects: cycles.iter().zip(&lines).flat_map(|(of_cycle, line)| suspects(of_cycle, line)).collect(),
        cycles: cycles
            .iter()
            .zip(&lines)
            .map(|(of_cycle, line)| Cycle {
                number: of_cycle[0].cycle,
                points: of_cycle.len(),
                scale_factor: line.slope,
                offset: line.offset,
            })
            .collect(),
        curve,
    })
}

/// Returns the points of each cycle, in the order in which the cycles begin.
fn by_cycle(points: &[RatePoint]) -> Vec<Vec<RatePoint>> {
    let mut cycles: Vec<Vec<RatePoint>> = Vec::new();
    for point in points {
        match cycles.iter_mut().find(|cycle| cycle[0].cycle == point.cycle) {
            Some(cycle) => cycle.push(*point),
            None => cycles.push(vec![*point]),
        }
    }
    cycles
}

fn place(of_cycle: &[RatePoint], cycles: &[Vec<RatePoint>]) -> String {
    if cycles.len() > 1 { format!(" in cycle {}", of_cycle[0].cycle) } else { String::new() }
}

fn enough(place: &str, points: &[RatePoint]) -> Result<(), Refusal> {
    let got = different(points.iter().map(|p| p.rate));
    if got < FEWEST {
        return Err(Refusal::FewRates { place: place.to_owned(), got, needed: FEWEST });
    }
    Ok(())
}

/// Returns the number of different values.
fn different(values: impl Iterator<Item = f64>) -> usize {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    // +0 and -0 are one rate.
    values.dedup_by(|a, b| a == b);
    values.len()
}

/// Checks that no point misses the line by more than the limit.
fn on_line(residuals: &[(RatePoint, f64)], full_scale: f64, limit: f64) -> Result<(), Refusal> {
    let worst = residuals.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    match worst {
        Some((point, residual)) if residual.is_nan() || residual.abs() > limit * full_scale => Err(Refusal::OffLine {
            rate: point.rate,
            row: point.row,
            percent: residual.abs() / full_scale * 100.0,
            limit_percent: limit * 100.0,
        }),
        _ => Ok(()),
    }
}

fn curve(residuals: &[(RatePoint, f64)], k: f64, full_scale: f64, largest_rate: f64) -> Vec<CurvePoint> {
    let mut sorted = residuals.to_vec();
    sorted.sort_by(|a, b| a.0.rate.total_cmp(&b.0.rate));
    sorted
        .chunk_by(|a, b| a.0.rate == b.0.rate)
        .map(|visits| {
            let rate = visits[0].0.rate;
            let residual = visits.iter().map(|(_, r)| r).sum::<f64>() / visits.len() as f64;
            CurvePoint {
                rate,
                output: visits.iter().map(|(p, _)| p.output).sum::<f64>() / visits.len() as f64,
                residual,
                visits: visits.len(),
                of_full_scale: residual / (k * full_scale).abs(),
                of_output: (rate.abs() > REST * largest_rate).then(|| residual / (k * rate).abs()),
            }
        })
        .collect()
}

/// The F test of the line. With a line for each of Q cycles, n points at m rates leave `n - m - 2 (Q - 1)` degrees of
/// freedom to their scatter, and `m - 2` to the curve, where all cycles have the same rates.
fn lack_of_fit(
    residuals: &[(RatePoint, f64)],
    curve: &[CurvePoint],
    cycles: &[Vec<RatePoint>],
) -> Result<LackOfFit, MissingFigure> {
    let rates = |cycle: &[RatePoint]| {
        let mut rates: Vec<f64> = cycle.iter().map(|p| p.rate + 0.0).collect();
        rates.sort_by(f64::total_cmp);
        rates
    };
    if cycles.iter().any(|cycle| rates(cycle) != rates(&cycles[0])) {
        return Err(MissingFigure::Unbalanced);
    }
    let pure_dof = residuals.len() as f64 - curve.len() as f64 - 2.0 * (cycles.len() as f64 - 1.0);
    if pure_dof < 1.0 {
        return Err(MissingFigure::NoRateTwice);
    }
    let of_curve: f64 = curve.iter().map(|p| p.visits as f64 * p.residual * p.residual).sum();
    let all: f64 = residuals.iter().map(|(_, r)| r * r).sum();
    let mean_of = |rate: f64| curve.iter().find(|p| p.rate == rate).map_or(0.0, |p| p.residual);
    let pure: f64 = residuals.iter().map(|(p, r)| (r - mean_of(p.rate)).powi(2)).sum();
    if pure <= 1e-20 * all || pure == 0.0 {
        return Err(MissingFigure::NoScatter);
    }
    let dof = curve.len() as f64 - 2.0;
    let f = (of_curve / dof) / (pure / pure_dof);
    let p = FisherSnedecor::new(dof, pure_dof).map_or(f64::NAN, |distribution| distribution.sf(f));
    Ok(LackOfFit { f, p, dof, pure_dof, pure_sd: (pure / pure_dof).sqrt() })
}

/// How far each point of the curve may lie from the sensor's true output, for all points at once:
/// `t s sqrt((1 - h) / visits)` with t for 95 % shared by the points, h the leverage. The steps of the output may move
/// point and line each by half a step at most.
fn reach(curve: &[CurvePoint], test: &LackOfFit, resolution_sd: f64) -> Vec<f64> {
    let design = Line::through_rates(curve);
    let t = stats::coverage_factor(1.0 - 0.05 / curve.len() as f64, test.pure_dof);
    let own = |p: &CurvePoint| (1.0 - design.leverage(p.rate)).max(0.0) / p.visits as f64;
    let of_steps = 2.0 * 3.0_f64.sqrt() * resolution_sd;
    curve.iter().map(|p| t * test.pure_sd * own(p).sqrt() + of_steps).collect()
}

fn asymmetry(cycles: &[Vec<RatePoint>], resolution_sd: f64) -> Result<Asymmetry, MissingFigure> {
    let mut senses: [Vec<Line>; 2] = [Vec::new(), Vec::new()];
    for cycle in cycles {
        for (lines, (sense, sign)) in senses.iter_mut().zip([("positive", 1.0), ("negative", -1.0)]) {
            let of_sense: Vec<RatePoint> = cycle.iter().copied().filter(|p| p.rate * sign > 0.0).collect();
            let rates = different(of_sense.iter().map(|p| p.rate));
            if rates < 2 {
                return Err(MissingFigure::FewOfOneSense { sense, rates, place: place(cycle, cycles) });
            }
            lines.push(Line::through(&of_sense));
        }
    }
    let [positive, negative] = [&senses[0], &senses[1]].map(|l| l.iter().map(|l| l.slope).collect::<Vec<_>>());
    let (plus, minus) = (stats::mean(&positive), stats::mean(&negative));
    let mean = f64::midpoint(plus, minus).abs();
    let of_steps = senses.iter().flatten().map(|line| line.reach[0]).fold(0.0, f64::max) * 2.0 * resolution_sd;
    let difference = match (&senses[0][..], &senses[1][..]) {
        ([plus], [minus]) => {
            let [a, b] = [plus.slope_estimate(), minus.slope_estimate()];
            let dof = stats::welch_satterthwaite(&[(a.sd, a.dof), (b.sd, b.dof)]);
            (a.dof > 0.0 && b.dof > 0.0).then_some(Estimate { value: a.value - b.value, sd: a.sd.hypot(b.sd), dof })
        }
        _ => Some(Estimate::of_cycles(&positive.iter().zip(&negative).map(|(a, b)| a - b).collect::<Vec<_>>())),
    };
    Ok(Asymmetry {
        positive: plus,
        negative: minus,
        relative: (plus - minus).abs() / mean,
        uncertainty: difference.map(|d| d.beside(of_steps).over(mean)).map(|d| (d.sd, d.dof)),
    })
}

/// Points whose externally studentised residual is beyond Student's t at `SUSPECT_PROBABILITY`, shared by all points
/// (Bonferroni).
fn suspects(of_cycle: &[RatePoint], line: &Line) -> Vec<Suspect> {
    let dof = line.dof() - 1.0;
    if dof < 1.0 {
        return Vec::new();
    }
    let limit = stats::coverage_factor(1.0 - stats::SUSPECT_PROBABILITY / of_cycle.len() as f64, dof);
    let of = |point: &RatePoint| {
        let own = 1.0 - line.leverage(point.rate);
        let residual = line.residual(point);
        // Where the other points lie on a line to the last digits, there is no scatter to compare with.
        let exact = (1e-12 * point.output.abs().max(line.offset.abs())).powi(2);
        let studentised = stats::studentised(residual, line.squares(), own, dof, exact);
        (own > 1e-9 && studentised.abs() > limit).then_some(Suspect { point: *point, studentised })
    };
    of_cycle.iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests;
