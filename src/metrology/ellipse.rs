//! Ellipse of a two-axis magnetometer turned about its third axis, and its correction to a circle.
//!
//! With `(p - c)' Q^-1 (p - c) = 1`: `dx, dy = c`, `ky = sqrt(Qxx / Qyy)`, `sin(alpha) = Qxy / sqrt(Qxx Qyy)`.
//! Correction: `y' = ky (y - dy)`, `x' = [(x - dx) - y' sin(alpha)] / cos(alpha)`.
//!
//! Departures from the print (Cheng et al., *Computer Measurement & Control* 30(7), 2022, equations 5 to 9): it takes
//! centre and sensitivity from the extremes, the noisiest points of a record; it leaves out the division by
//! `cos(alpha)`, which keeps a second harmonic of alpha^2 / 4 in the roll angle; it multiplies `sin(alpha)` with the y
//! that is not yet scaled. The fit gives the print's figures beside its own.

use nalgebra::SMatrix;

use crate::{Refusal, quadric, series, stats};

/// The equation of the correction.
pub const EQUATION: &str = "y' = ky (y - dy), x' = [(x - dx) - y' sin_alpha] / sqrt(1 - sin_alpha^2)";
/// Whole turns that a record must hold.
pub const TURNS: f64 = 3.0;
/// Largest sector without a point, degrees.
pub const GAP_LIMIT_DEG: f64 = 60.0;
/// Largest part of the points in one sector of 10 degrees. More points there mean that the table stood still.
pub const CROWD_LIMIT: f64 = 0.5;
/// Part of the points that may be rejected as spikes.
pub const REJECT_LIMIT: f64 = 0.05;

/// Correction of a point to the circle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correction {
    /// Zero of x, in the unit of the record.
    pub dx: f64,
    /// Zero of y, in the unit of the record.
    pub dy: f64,
    /// Factor on y that makes its sensitivity that of x.
    pub ky: f64,
    /// Sine of the departure of the axes from a right angle; positive where x is positive at the maximum of y.
    pub sin_alpha: f64,
}

impl Correction {
    /// Applies the complete correction: points of the ellipse come to lie on a circle of radius `sqrt(Qxx)` about 0.
    #[must_use]
    pub fn apply(&self, x: f64, y: f64) -> (f64, f64) {
        let y = self.ky * (y - self.dy);
        (((x - self.dx) - y * self.sin_alpha) / (1.0 - self.sin_alpha * self.sin_alpha).sqrt(), y)
    }

    /// Applies the correction as printed: without the division, and with y before its scaling.
    #[must_use]
    pub fn apply_as_printed(&self, x: f64, y: f64) -> (f64, f64) {
        let (x, y) = (x - self.dx, y - self.dy);
        (x - y * self.sin_alpha, self.ky * y)
    }

    /// Returns the correction of an ellipse and the radius of the corrected circle. The ellipse is given by its centre,
    /// its semi-axes (major, minor) and the direction of the major axis from x towards y in degrees:
    /// `Q = R diag(a^2, b^2) R'`.
    #[must_use]
    pub fn of_axes(centre: [f64; 2], [major, minor]: [f64; 2], rotation_deg: f64) -> (Self, f64) {
        let (sin, cos) = rotation_deg.to_radians().sin_cos();
        let (a, b) = (major * major, minor * minor);
        let xy = (a - b) * sin * cos;
        let q = nalgebra::Matrix2::new(a * cos * cos + b * sin * sin, xy, xy, a * sin * sin + b * cos * cos);
        (Self::of(&q, &nalgebra::Vector2::from(centre)), q[(0, 0)].sqrt())
    }

    fn of<const D: usize>(q: &nalgebra::Matrix2<f64>, centre: &nalgebra::SVector<f64, D>) -> Self {
        Self {
            dx: centre[0],
            dy: centre[1],
            ky: (q[(0, 0)] / q[(1, 1)]).sqrt(),
            sin_alpha: q[(0, 1)] / (q[(0, 0)] * q[(1, 1)]).sqrt(),
        }
    }
}

/// What the print computes from the extremes of the record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrintExtremes {
    /// `(Xmax + Xmin) / 2`.
    pub dx: f64,
    /// `(Ymax + Ymin) / 2`.
    pub dy: f64,
    /// `(Xmax - Xmin) / (Ymax - Ymin)`.
    pub ky: f64,
}

/// Standard uncertainties, in the order of the figures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EllipseUncertainty {
    /// Standard uncertainty of the centre.
    pub centre: [f64; 2],
    /// Standard uncertainty of the semi-axes.
    pub semi_axes: [f64; 2],
    /// Standard uncertainty of the rotation, degrees. It is large where the ellipse is nearly a circle.
    pub rotation_deg: f64,
    /// Standard uncertainty of the correction.
    pub correction: Correction,
}

/// A fitted ellipse. Lengths are in the unit of the record.
#[derive(Debug, Clone, PartialEq)]
pub struct Ellipse {
    /// Centre.
    pub centre: [f64; 2],
    /// Major and minor semi-axis.
    pub semi_axes: [f64; 2],
    /// Direction of the major axis from x towards y, degrees in (-90, 90].
    pub rotation_deg: f64,
    /// Correction to a circle.
    pub correction: Correction,
    /// Radius of the corrected circle.
    pub radius: f64,
    /// Root mean square of the normal distances of the points kept.
    pub residual_rms: f64,
    /// Largest radius error after the complete correction, over the radius, among the points that the limit of
    /// rejection keeps.
    pub residual_peak: f64,
    /// Root mean square radius error after the correction as printed with the extremes, in the unit of the record.
    pub residual_rms_as_printed: f64,
    /// Standard deviation of the noise of a channel.
    pub sigma: f64,
    /// The print's figures from the extremes.
    pub extremes: PrintExtremes,
    /// Points rejected as spikes.
    pub rejected: usize,
    /// Points used.
    pub used: usize,
    /// Turns; `None` where the points do not follow each other round the ellipse (then the fit does not use their
    /// order).
    pub turns: Option<f64>,
    /// Largest sector without a point, degrees.
    pub gap_deg: f64,
    /// Condition number of the scaled problem.
    pub condition: f64,
    /// Standard uncertainties (delta method).
    pub sd: EllipseUncertainty,
    /// Covariance of centre (2), semi-axes (2), rotation (degrees), `dx, dy` (the centre again), `ky`, `sin_alpha`.
    pub covariance: SMatrix<f64, 9, 9>,
    /// Degrees of freedom.
    pub dof: usize,
}

/// Figures of an ellipse: centre, semi-axes, rotation, correction.
fn figures(surface: &quadric::Surface<2>) -> [f64; 9] {
    let (values, frame) = surface.principal();
    let q = surface.form.try_inverse().unwrap_or_else(|| nalgebra::Matrix2::repeat(f64::NAN));
    // The smallest eigenvalue belongs to the major axis.
    let major = frame.column(0);
    let mut rotation = major[1].atan2(major[0]).to_degrees();
    if rotation <= -90.0 {
        rotation += 180.0;
    } else if rotation > 90.0 {
        rotation -= 180.0;
    }
    let c = Correction::of(&q, &surface.centre);
    let (major, minor) = (values[0].powf(-0.5), values[1].powf(-0.5));
    [surface.centre[0], surface.centre[1], major, minor, rotation, c.dx, c.dy, c.ky, c.sin_alpha]
}

/// Fits an ellipse to the points and derives the correction. The points must be in the order of the record, which must
/// hold at least three turns. `saturation` is the output at which a channel is cut, if known.
///
/// # Errors
/// Values that are not finite or are cut off; a hyperbola or parabola; fewer than three turns, poor coverage, a table
/// that stood still, too much noise, too many outliers; points that lie more than 5 % of the radius off the ellipse, or
/// a centre that moves by as much.
pub fn fit(x: &[f64], y: &[f64], saturation: Option<f64>) -> Result<Ellipse, Refusal> {
    fit_within(x, y, saturation, quadric::RESIDUAL_LIMIT)
}

/// Like [`fit`], with another limit on the residual and on the movement of the centre, over the radius.
///
/// # Errors
/// As [`fit`].
pub fn fit_within(x: &[f64], y: &[f64], saturation: Option<f64>, limit: f64) -> Result<Ellipse, Refusal> {
    series::positive("residual limit (of the radius)", limit)?;
    let n = series::channels(&["x", "y"], &[x, y])?;
    for (name, values) in [("x", x), ("y", y)] {
        series::unsaturated(name, values, saturation)?;
    }
    let fit = quadric::fit::<2, 5>(&[x, y], ("ellipse", "hyperbola"), quadric::Far::Rejected)?;
    let [cx, cy, major, minor, rotation_deg, dx, dy, ky, sin_alpha] = figures(&fit.surface);
    if fit.rejected as f64 > REJECT_LIMIT * n as f64 {
        return Err(Refusal::TooManyRejected { rejected: fit.rejected, total: n, limit_percent: 100.0 * REJECT_LIMIT });
    }
    let correction = Correction { dx, dy, ky, sin_alpha };
    let coverage = Coverage::of(x, y, &correction);
    coverage.check()?;
    let covariance = fit.spread(|surface| {
        let mut f = figures(surface);
        // Near the ends of the range the angle may jump by 180 degrees between neighbours.
        f[4] = rotation_deg + (f[4] - rotation_deg + 90.0).rem_euclid(180.0) - 90.0;
        f
    });
    let sd: [f64; 9] = std::array::from_fn(|k| covariance[(k, k)].max(0.0).sqrt());
    let q = fit.surface.form.try_inverse().unwrap_or_else(|| nalgebra::Matrix2::repeat(f64::NAN));
    let radius = q[(0, 0)].sqrt();
    quadric::step::check(n, "ellipse", limit, |row| {
        let (u, v) = correction.apply(x[row], y[row]);
        nalgebra::Vector2::new(u, v) / radius
    })?;
    quadric::step::near("ellipse", fit.residual_rms / (major * minor).sqrt(), limit)?;
    let extremes = extremes(x, y);
    let printed = Correction { dx: extremes.dx, dy: extremes.dy, ky: extremes.ky, sin_alpha };
    let (residual_peak, residual_rms_as_printed) =
        residuals(x, y, &correction, &printed, radius, quadric::REJECT_SIGMA * fit.sigma / minor);
    Ok(Ellipse {
        centre: [cx, cy],
        semi_axes: [major, minor],
        rotation_deg,
        correction,
        radius,
        residual_rms: fit.residual_rms,
        residual_peak,
        residual_rms_as_printed,
        sigma: fit.sigma,
        extremes,
        rejected: fit.rejected,
        used: fit.used,
        turns: coverage.turns,
        gap_deg: coverage.gap_deg,
        condition: fit.condition,
        sd: EllipseUncertainty {
            centre: [sd[0], sd[1]],
            semi_axes: [sd[2], sd[3]],
            rotation_deg: sd[4],
            correction: Correction { dx: sd[5], dy: sd[6], ky: sd[7], sin_alpha: sd[8] },
        },
        covariance,
        dof: fit.used - 5,
    })
}

/// The algebraic fit alone: centre, semi-axes and rotation (degrees). Noise biases it and spikes distort it. It is the
/// start of [`fit`] and the reference for the speed of [`fit`].
///
/// # Errors
/// As [`fit`] for values that are not finite and open curves.
pub fn fit_algebraic(x: &[f64], y: &[f64]) -> Result<[f64; 5], Refusal> {
    let n = series::channels(&["x", "y"], &[x, y])?;
    if n < 20 {
        return Err(Refusal::TooFew { what: "an ellipse".to_owned(), got: n, needed: 20 });
    }
    let surface = quadric::algebraic(&[x, y]).map_err(|e| Refusal::NotClosed {
        shape: "hyperbola",
        expected: "ellipse",
        detail: format!("eigenvalues of its form {:.3e} {:.3e}", e.eigenvalues[0], e.eigenvalues[1]),
    })?;
    let f = figures(&surface);
    Ok([f[0], f[1], f[2], f[3], f[4]])
}

fn extremes(x: &[f64], y: &[f64]) -> PrintExtremes {
    let ((x0, x1), (y0, y1)) = (stats::range(x), stats::range(y));
    PrintExtremes { dx: f64::midpoint(x0, x1), dy: f64::midpoint(y0, y1), ky: (x1 - x0) / (y1 - y0) }
}

/// Peak of the relative radius error after the complete correction (without spikes), and rms of the radius error after
/// the print's correction.
fn residuals(x: &[f64], y: &[f64], complete: &Correction, printed: &Correction, radius: f64, limit: f64) -> (f64, f64) {
    // Whole pieces without a branch, so that the compiler can use vectors.
    const PIECE: usize = 64;
    let cos = (1.0 - complete.sin_alpha * complete.sin_alpha).sqrt();
    let (mut peak, mut squares, mut count) = (0.0_f64, 0.0, 0_usize);
    for (x, y) in x.chunks(PIECE).zip(y.chunks(PIECE)) {
        let (mut errors, mut printed_errors) = ([0.0; PIECE], [0.0; PIECE]);
        for (k, (x, y)) in x.iter().zip(y).enumerate() {
            let v = complete.ky * (y - complete.dy);
            let u = ((x - complete.dx) - v * complete.sin_alpha) / cos;
            errors[k] = ((u * u + v * v).sqrt() - radius).abs() / radius;
            let (u, v) = printed.apply_as_printed(*x, *y);
            printed_errors[k] = (u * u + v * v).sqrt() - radius;
        }
        for (error, printed) in errors.iter().zip(printed_errors).take(x.len()) {
            if *error < limit {
                peak = peak.max(*error);
                squares += printed * printed;
                count += 1;
            }
        }
    }
    (peak, (squares / count.max(1) as f64).sqrt())
}

/// How the points cover the turn.
struct Coverage {
    turns: Option<f64>,
    gap_deg: f64,
    crowd: f64,
}

impl Coverage {
    fn of(x: &[f64], y: &[f64], correction: &Correction) -> Self {
        const SECTORS: usize = 36;
        // Turns are counted by quadrants: noise at a border steps forth and back and cancels; a step of two quadrants
        // has no direction.
        let (mut quarter, mut lowest, mut highest, mut lost) = (0_i64, 0_i64, 0_i64, 0_usize);
        let mut before = None;
        let mut sectors = [0_usize; SECTORS];
        // Sectors need the angle, which is expensive: a subset of the samples is enough to find gaps of 10 degrees. The
        // jitter keeps the subset from running in step with the turns.
        let stride = (x.len() / 20_000).max(1);
        for (k, (x, y)) in x.chunks(stride).zip(y.chunks(stride)).enumerate() {
            let sampled = k % stride;
            for (j, (x, y)) in x.iter().zip(y).enumerate() {
                let (u, v) = correction.apply(*x, *y);
                let (left, below) = (u < 0.0, v < 0.0);
                // Quadrants 0 to 3, counter-clockwise.
                let quadrant = 2 * usize::from(below) + usize::from(left != below);
                let step = (quadrant + 4 - before.unwrap_or(quadrant)) % 4;
                before = Some(quadrant);
                quarter += [0, 1, 0, -1][step];
                lost += usize::from(step == 2);
                lowest = lowest.min(quarter);
                highest = highest.max(quarter);
                if j == sampled {
                    let sector = ((v.atan2(u) / std::f64::consts::TAU + 0.5) * SECTORS as f64) as usize;
                    sectors[sector.min(SECTORS - 1)] += 1;
                }
            }
        }
        let total: usize = sectors.iter().sum();
        let least = (total / SECTORS / 100).max(1);
        let mut longest = 0;
        let mut run = 0;
        for k in 0..2 * SECTORS {
            run = if sectors[k % SECTORS] < least { run + 1 } else { 0 };
            longest = longest.max(run.min(SECTORS));
        }
        let ordered = lost * 20 < x.len();
        Self {
            turns: ordered.then(|| (highest - lowest) as f64 / 4.0),
            gap_deg: longest as f64 * 360.0 / SECTORS as f64,
            crowd: sectors.iter().copied().max().unwrap_or(0) as f64 / total.max(1) as f64,
        }
    }

    fn check(&self) -> Result<(), Refusal> {
        let coverage = |what, value, needed: String| Err(Refusal::Coverage { what, value, needed });
        if self.gap_deg > GAP_LIMIT_DEG {
            return coverage("largest sector without a point (deg)", self.gap_deg, format!("at most {GAP_LIMIT_DEG}"));
        }
        if let Some(turns) = self.turns.filter(|t| *t < TURNS - 0.26) {
            return Err(Refusal::FewTurns { turns, needed: TURNS });
        }
        if self.crowd > CROWD_LIMIT {
            return coverage(
                "part of the points in one sector of 10 deg",
                self.crowd,
                format!("at most {CROWD_LIMIT}"),
            );
        }
        Ok(())
    }
}
