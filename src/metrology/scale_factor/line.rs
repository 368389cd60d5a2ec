//! A straight line by least squares, and its statistics of the points.

use super::{CurvePoint, Estimate, RatePoint};

/// The line `output = slope rate + offset`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    pub(super) slope: f64,
    pub(super) offset: f64,
    /// Mean rate, about which the sums are taken.
    centre: f64,
    /// Sum of the squares of the rates about the mean rate.
    sum_of_squares: f64,
    /// Sum of the squares of the residuals.
    squares: f64,
    points: usize,
    /// Largest errors of slope and offset where every output is off by 1, with the worst signs.
    pub(super) reach: [f64; 2],
}

impl Line {
    /// Fits a line through points of at least two different rates.
    pub(super) fn through(points: &[RatePoint]) -> Self {
        Self::of(points.iter().map(|p| (p.rate, p.output)))
    }

    /// Fits a line through the rates of a curve, each once, for the leverages.
    pub(super) fn through_rates(curve: &[CurvePoint]) -> Self {
        Self::of(curve.iter().map(|p| (p.rate, p.output)))
    }

    fn of(points: impl Iterator<Item = (f64, f64)> + Clone) -> Self {
        let count = points.clone().count();
        let n = count as f64;
        // The sums are taken about the first output and the means, so that a large offset costs no digits.
        let level = points.clone().next().map_or(0.0, |(_, output)| output);
        let centre = points.clone().map(|(rate, _)| rate).sum::<f64>() / n;
        let mean = points.clone().map(|(_, output)| output - level).sum::<f64>() / n;
        let (mut xx, mut xy) = (0.0, 0.0);
        for (rate, output) in points.clone() {
            xx += (rate - centre).powi(2);
            xy += (rate - centre) * (output - level - mean);
        }
        let slope = xy / xx;
        let squares =
            points.clone().map(|(rate, output)| (output - level - mean - slope * (rate - centre)).powi(2)).sum::<f64>();
        let reach = points.fold([0.0; 2], |[of_slope, of_offset], (rate, _)| {
            let weight = (rate - centre) / xx;
            [of_slope + weight.abs(), of_offset + (1.0 / n - centre * weight).abs()]
        });
        let offset = level + mean - slope * centre;
        Self { slope, offset, centre, sum_of_squares: xx, squares, points: count, reach }
    }

    pub(super) fn residual(&self, point: &RatePoint) -> f64 {
        point.output - self.offset - self.slope * point.rate
    }

    /// Degrees of freedom of the residuals.
    pub(super) fn dof(&self) -> f64 {
        self.points as f64 - 2.0
    }

    /// Sum of the squares of the residuals.
    pub(super) fn squares(&self) -> f64 {
        self.squares
    }

    /// Returns how far a point at this rate draws the line to itself: `1/n + (w - mean)^2 / sum`.
    pub(super) fn leverage(&self, rate: f64) -> f64 {
        1.0 / self.points as f64 + (rate - self.centre).powi(2) / self.sum_of_squares
    }

    pub(super) fn slope_estimate(&self) -> Estimate {
        let variance = self.squares / self.dof();
        Estimate { value: self.slope, sd: (variance / self.sum_of_squares).sqrt(), dof: self.dof() }
    }

    pub(super) fn offset_estimate(&self) -> Estimate {
        let variance = self.squares / self.dof();
        let sd = (variance * (1.0 / self.points as f64 + self.centre.powi(2) / self.sum_of_squares)).sqrt();
        Estimate { value: self.offset, sd, dof: self.dof() }
    }
}
