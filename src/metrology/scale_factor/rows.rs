//! Averages the rows of a record to the points of a line.

use crate::{Refusal, quantisation, series, stats};

/// Mean output at one input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RatePoint {
    /// Input, in the record's unit.
    pub rate: f64,
    /// Mean output.
    pub output: f64,
    /// Number of the cycle of the point.
    pub cycle: f64,
    /// First row of the point, from 1.
    pub row: usize,
    /// Rows that were averaged.
    pub rows: usize,
    /// Standard uncertainty of `output` from its steps ([`quantisation::mean_error_sd`]).
    pub resolution_sd: f64,
}

/// Rows of a record. All columns have the same length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateRows<'a> {
    /// Input of each row.
    pub rates: &'a [f64],
    /// Output of each row.
    pub outputs: &'a [f64],
    /// Number of the power cycle, where there are several.
    pub cycles: Option<&'a [f64]>,
    /// Number of the point, where the inputs are measured and differ from row to row.
    pub points: Option<&'a [f64]>,
}

impl RateRows<'_> {
    /// Returns the means of neighbouring rows of one point. Rows of one point have the same cycle and the same number
    /// where points are numbered, else the same rate. A rate that comes again later is a point of its own.
    ///
    /// # Errors
    /// [`Refusal::Lengths`], [`Refusal::NotFinite`].
    pub fn means(&self) -> Result<Vec<RatePoint>, Refusal> {
        let same_point = self.points.unwrap_or(self.rates);
        series::channels(
            &["rate", "output", "cycle", "point"],
            &[self.rates, self.outputs, self.cycles.unwrap_or(self.rates), same_point],
        )?;
        let cycle = |row: usize| self.cycles.map_or(1.0, |cycles| cycles[row]);
        let mut points = Vec::new();
        let mut first = 0;
        for row in 1..=self.rates.len() {
            if row == self.rates.len() || same_point[row] != same_point[first] || cycle(row) != cycle(first) {
                points.push(RatePoint {
                    rate: stats::mean(&self.rates[first..row]),
                    output: stats::mean(&self.outputs[first..row]),
                    cycle: cycle(first),
                    row: first + 1,
                    rows: row - first,
                    resolution_sd: 0.0,
                });
                first = row;
            }
        }
        let stretches: Vec<&[f64]> = points.iter().map(|p| &self.outputs[p.row - 1..p.row - 1 + p.rows]).collect();
        let resolution_sd = quantisation::mean_error_sd(&stretches);
        points.iter_mut().for_each(|point| point.resolution_sd = resolution_sd);
        Ok(points)
    }
}
