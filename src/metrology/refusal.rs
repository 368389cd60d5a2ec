//! Why a computation was refused.

use thiserror::Error;

/// An input that gives no trustworthy figure. Each variant carries the numbers that decided. The text says what failed;
/// [`Refusal::hint`] says what one can try.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Refusal {
    /// A sample is NaN or infinite.
    #[error("{channel}: sample {index} is {value}")]
    NotFinite {
        /// Channel that holds it.
        channel: String,
        /// Index of the sample, from 0.
        index: usize,
        /// NaN or an infinity.
        value: f64,
    },
    /// A parameter of the computation makes no sense.
    #[error("{name} is {value}, expected {expected}")]
    Parameter {
        /// Name of the parameter, with its unit.
        name: &'static str,
        /// The value that was given.
        value: f64,
        /// The values that are accepted.
        expected: &'static str,
    },
    /// Channels of one record differ in length.
    #[error("channels differ in length: {left} and {right} samples")]
    Lengths {
        /// Length of the first channel.
        left: usize,
        /// Length of the other one.
        right: usize,
    },
    /// Too few samples for the computation.
    #[error("{what}: {got} samples, needs at least {needed}")]
    TooFew {
        /// What the samples are for.
        what: String,
        /// Samples in the record.
        got: usize,
        /// Samples needed.
        needed: usize,
    },
    /// All samples are alike, so that they show no noise.
    #[error("{channel}: all {samples} samples are {value}")]
    Constant {
        /// Channel.
        channel: String,
        /// Number of samples.
        samples: usize,
        /// The value of all samples.
        value: f64,
    },
    /// Repeated figures are all alike, so that their spread is below their last digit.
    #[error("all {count} {what} are {value}")]
    Alike {
        /// What the figures are, in the plural.
        what: &'static str,
        /// How many figures there are.
        count: usize,
        /// The value of all figures.
        value: f64,
    },
    /// A scale factor needs more different inputs.
    #[error("{got} different rates{place}, needs at least {needed}")]
    FewRates {
        /// Empty, or ` in cycle N`.
        place: String,
        /// Different rates in the record.
        got: usize,
        /// Different rates that are needed.
        needed: usize,
    },
    /// A point lies far off the line through all points.
    #[error("rate {rate} (row {row}) misses the line by {percent:.2} % of the full scale, limit {limit_percent} %")]
    OffLine {
        /// Rate of the point.
        rate: f64,
        /// First of its rows, from 1.
        row: usize,
        /// Distance from the line over the full scale, percent.
        percent: f64,
        /// Limit, percent.
        limit_percent: f64,
    },
    /// Labels that the method needs do not occur.
    #[error("missing: {labels}")]
    Missing {
        /// The labels, separated by blanks.
        labels: String,
    },
    /// A label that the method does not know.
    #[error("unknown label `{label}` in row {row}")]
    UnknownLabel {
        /// The label.
        label: String,
        /// Row of the record, from 1.
        row: usize,
    },
    /// One label stands in two separated blocks of rows.
    #[error("label `{label}` stands in two separated blocks, from row {first} and again from row {again}")]
    SplitLabel {
        /// The label.
        label: String,
        /// First row of the first block, from 1.
        first: usize,
        /// First row of the second block, from 1.
        again: usize,
    },
    /// An up direction is not a unit vector.
    #[error("up direction in row {row} has length {length:.6}, expected 1")]
    NotUnit {
        /// Row of the record, from 1.
        row: usize,
        /// Length of the direction.
        length: f64,
    },
    /// The mean of a still position wanders more than its noise allows.
    #[error(
        "position {position} moved: block means of {channel} spread by {spread:.6e}, noise explains {noise:.1e}, limit {limit:.6e}"
    )]
    Moved {
        /// Label or number of the position.
        position: String,
        /// Channel.
        channel: &'static str,
        /// Largest minus smallest block mean, in units of the record.
        spread: f64,
        /// Spread that white noise of this record gives at most.
        noise: f64,
        /// Limit that was exceeded.
        limit: f64,
    },
    /// A position is much shorter than the others.
    #[error("position {position} has {rows} rows, the median position {median}")]
    Short {
        /// Label or number of the position.
        position: String,
        /// Rows of the position.
        rows: usize,
        /// Rows of the median position.
        median: usize,
    },
    /// A channel shows one value where it is noisy elsewhere.
    #[error("{channel} stands still at {value} for {samples} samples of {place} while it is noisy elsewhere")]
    Stuck {
        /// Channel.
        channel: String,
        /// Place in the record.
        place: String,
        /// The value.
        value: f64,
        /// How many samples show it.
        samples: usize,
    },
    /// A channel reached the end of its range.
    #[error("{channel} is saturated: {samples} samples at {value}")]
    Saturated {
        /// Channel.
        channel: String,
        /// The value at which it is cut off.
        value: f64,
        /// How many samples show it.
        samples: usize,
    },
    /// A channel is cut off at one value while it is noisy.
    #[error(
        "{channel} is cut at {value}: {samples} of {total} rows ({:.2} %) show it, first in row {first_row}",
        share(*samples, *total)
    )]
    Clipped {
        /// Channel, and where in the record.
        channel: String,
        /// The value at which it is cut off.
        value: f64,
        /// How many rows show it.
        samples: usize,
        /// Rows of the record.
        total: usize,
        /// First row that shows it, from 1.
        first_row: usize,
    },
    /// More rows are bad than the method can leave out.
    #[error(
        "{what}: {samples} of {total} rows ({:.2} %), first in row {first_row}; at most {limit_percent} % can be left out",
        share(*samples, *total)
    )]
    BadRows {
        /// `failed reads` or `spikes`.
        what: &'static str,
        /// How many rows are bad.
        samples: usize,
        /// Rows of the record.
        total: usize,
        /// First of these rows, from 1.
        first_row: usize,
        /// Limit, percent.
        limit_percent: f64,
    },
    /// A row that is left out lies where the motion bends.
    #[error(
        "{channel}: row {row} is left out where the motion bends: its neighbours leave {open:.3e} open, the integral's noise is {noise:.1e}"
    )]
    Unbridged {
        /// Channel.
        channel: String,
        /// First row of the hole, from 1.
        row: usize,
        /// Gap that the lines through both sides leave open, sum of the outputs.
        open: f64,
        /// Noise of the sum over the run.
        noise: f64,
    },
    /// Rows repeat the row before, so that the record holds fewer measurements than rows.
    #[error(
        "{samples} of {total} rows ({:.2} %) repeat the row before on all channels, first in row {first_row}; {}",
        share(*samples, *total), updates(*rows_per_update)
    )]
    Stale {
        /// How many rows repeat the row before.
        samples: usize,
        /// Rows of the record.
        total: usize,
        /// First of these rows, from 1.
        first_row: usize,
        /// Rows for each new row, where nearly all updates come at one pace.
        rows_per_update: Option<f64>,
    },
    /// Counts of a signed sensor were written without their sign.
    #[error(
        "{channel} lies at both ends of 0 to {} and never between, in {samples} rows at the upper end, first in row {row}, \
         as signed counts of {bits} bits without their sign do",
        f64::from(*bits).exp2() - 1.0
    )]
    Unsigned {
        /// Channel.
        channel: String,
        /// Bits of a count.
        bits: u32,
        /// Rows at the upper end.
        samples: usize,
        /// First of them, from 1.
        row: usize,
    },
    /// A sensor answers with the wrong sign to its own axis.
    #[error("sensor {axis} answers {response:.6e} to its own axis, expected a positive response")]
    WrongSign {
        /// Axis.
        axis: &'static str,
        /// Diagonal element of the response.
        response: f64,
    },
    /// A sensor answers to another axis more than to its own.
    #[error("sensor {axis} answers {cross:.6e} to axis {other} but {own:.6e} to its own")]
    WrongAxis {
        /// Axis of the sensor.
        axis: &'static str,
        /// Response to its own axis.
        own: f64,
        /// The other axis.
        other: &'static str,
        /// Response to the other axis.
        cross: f64,
    },
    /// A position does not fit the common model.
    #[error("position {position} misses the fit by {residual:.4} m/s^2, limit {limit:.4}")]
    PoseResidual {
        /// Label or number of the position.
        position: String,
        /// Length of the position's residual, m/s^2.
        residual: f64,
        /// Limit, m/s^2.
        limit: f64,
    },
    /// The data do not determine the parameters.
    #[error("{what} is not determined by the data: condition number {condition:.3e}, limit {limit:.0e}")]
    IllConditioned {
        /// The parameters to be determined.
        what: &'static str,
        /// Condition number of the scaled problem.
        condition: f64,
        /// Limit.
        limit: f64,
    },
    /// Time does not increase.
    #[error("time does not increase at sample {index}: {before} s, then {after} s")]
    NotMonotonic {
        /// Index of the later sample, from 0.
        index: usize,
        /// Time before, s.
        before: f64,
        /// Time after, s.
        after: f64,
    },
    /// Samples are missing.
    #[error("gap at sample {index}: step of {step_s:.6} s, expected {expected_s:.6} s")]
    Gap {
        /// Index of the sample after the gap, from 0.
        index: usize,
        /// The step, s.
        step_s: f64,
        /// The usual step, s.
        expected_s: f64,
    },
    /// The time column contradicts the stated rate.
    #[error(
        "time column says {measured_hz:.6} Hz, stated are {stated_hz:.6} Hz: {:.4} % apart, allowed are {:.4} %",
        100.0 * (measured_hz / stated_hz - 1.0),
        100.0 * (tolerance + 3.0 * u_hz / measured_hz)
    )]
    RateMismatch {
        /// Rate of the time column, Hz.
        measured_hz: f64,
        /// Standard uncertainty of that rate, Hz; three of them are allowed beside the tolerance.
        u_hz: f64,
        /// Rate that was stated, Hz.
        stated_hz: f64,
        /// Tolerance, relative.
        tolerance: f64,
    },
    /// The rate of the stamps changes at some row.
    #[error("the rate changes at row {row}: {before_hz:.6} Hz before it, {after_hz:.6} Hz after it")]
    RateChanges {
        /// Row of the record at which it changes, from 1.
        row: usize,
        /// Rate before, Hz.
        before_hz: f64,
        /// Rate after, Hz.
        after_hz: f64,
    },
    /// Stamps without a named unit do not fit the stated rate in any unit.
    #[error("steps of {step} in column `{column}` fit {stated_hz} Hz in none of s, ms, us and ns")]
    UnknownTimeUnit {
        /// Name of the column.
        column: String,
        /// The usual step, in the unit of the column.
        step: f64,
        /// Rate that was stated, Hz.
        stated_hz: f64,
    },
    /// Cells of a column hold no value.
    #[error("column `{column}`: {cells} of {rows} cells are empty or say so, the first in line {line}")]
    EmptyCells {
        /// Name of the column.
        column: String,
        /// Cells without a value.
        cells: usize,
        /// Rows of the record.
        rows: usize,
        /// Line of the first one, from 1.
        line: usize,
    },
    /// Stamps scatter so much that a lost sample would not show.
    #[error(
        "stamps scatter by {jitter_s:.6} s about steps of {step_s:.6} s: among {samples} of them a lost sample would not show"
    )]
    Jittery {
        /// Standard deviation of a stamp, s.
        jitter_s: f64,
        /// The usual step, s.
        step_s: f64,
        /// Stamps.
        samples: usize,
    },
    /// No rotation stands out of the noise.
    #[error("run {run}: no rotation found, peak {peak:.4e} against noise {noise:.1e}")]
    NoRotation {
        /// Run.
        run: String,
        /// Largest block mean relative to rest.
        peak: f64,
        /// Standard deviation of a block mean at rest.
        noise: f64,
    },
    /// The record does not hold the whole rotation with rest on both sides.
    #[error("run {run} is cut off: {rest_s:.3} s of rest {side} the rotation, needs {needed_s:.3} s")]
    CutOff {
        /// Run.
        run: String,
        /// `before` or `after`.
        side: &'static str,
        /// Time at rest found there, s.
        rest_s: f64,
        /// Time at rest needed, s.
        needed_s: f64,
    },
    /// Something moved outside the rotation.
    #[error(
        "run {run} moves outside its rotation: {channel} deviates by {deviation:.4e} at {at_s:.2} s, limit {limit:.4e}"
    )]
    Restless {
        /// Run.
        run: String,
        /// Channel.
        channel: &'static str,
        /// Time of the motion, from the start of the run, s.
        at_s: f64,
        /// Deviation of a block mean from rest.
        deviation: f64,
        /// Limit.
        limit: f64,
    },
    /// The runs of one axis do not cancel: the angles or directions differ.
    #[error("axis {axis}: rotations forth and back differ by {mismatch:.3e} of their difference, limit {limit:.3e}")]
    Mismatch {
        /// Axis.
        axis: &'static str,
        /// Relative mismatch.
        mismatch: f64,
        /// Limit.
        limit: f64,
    },
    /// Both runs of an axis turn the same way.
    #[error("axis {axis}: both runs turn the same way (integrals {forth:.4e} and {back:.4e})")]
    SameSense {
        /// Axis.
        axis: &'static str,
        /// Integral of the `+` run less its bias.
        forth: f64,
        /// Integral of the `-` run less its bias.
        back: f64,
    },
    /// A response lies outside the band around the nominal one: wrong angle, wrong range or a bad sensor.
    #[error("sensor {axis}: response {response:.6e} is outside {nominal:.6e} +- {percent} %")]
    OutOfBand {
        /// Axis.
        axis: &'static str,
        /// Response found.
        response: f64,
        /// Nominal response.
        nominal: f64,
        /// Half width of the band, percent.
        percent: f64,
    },
    /// The points do not lie on an ellipse or ellipsoid.
    #[error("the points lie on a {shape}, not on an {expected}: {detail}")]
    NotClosed {
        /// `hyperbola`, `hyperboloid` or `parabola`.
        shape: &'static str,
        /// `ellipse` or `ellipsoid`.
        expected: &'static str,
        /// The numbers that decided.
        detail: String,
    },
    /// Fewer turns than the method needs.
    #[error("{turns:.2} turns, needs at least {needed}")]
    FewTurns {
        /// Turns found.
        turns: f64,
        /// Turns needed.
        needed: f64,
    },
    /// The points leave too much of the curve or surface uncovered.
    #[error("poor coverage: {what} is {value:.3}, needs {needed}")]
    Coverage {
        /// The measure.
        what: &'static str,
        /// Value of the measure.
        value: f64,
        /// Value that is needed.
        needed: String,
    },
    /// Noise or distortion is too large for the radius.
    #[error("residual is {ratio:.3} of the radius, limit {limit}")]
    Noisy {
        /// Residual over radius.
        ratio: f64,
        /// Limit.
        limit: f64,
    },
    /// The points are farther from the fitted curve or surface than those of a good record.
    #[error("the points lie {percent:.1} % of the radius off the {shape} (rms), limit {limit_percent} %")]
    Residual {
        /// `ellipse` or `ellipsoid`.
        shape: &'static str,
        /// Root mean square distance over the radius, percent.
        percent: f64,
        /// Limit, percent.
        limit_percent: f64,
    },
    /// The centre lies elsewhere in the first and in the second part of a record.
    #[error("the centre of the {shape} moves by {percent:.1} % of the radius about row {row}, limit {limit_percent} %")]
    CentreMoves {
        /// `ellipse` or `ellipsoid`.
        shape: &'static str,
        /// First row of the second part, from 1.
        row: usize,
        /// Distance of the two centres over the radius, percent.
        percent: f64,
        /// Limit, percent.
        limit_percent: f64,
    },
    /// More points were rejected than spikes can explain.
    #[error("{rejected} of {total} points do not fit, limit {limit_percent} %")]
    TooManyRejected {
        /// Points rejected.
        rejected: usize,
        /// All points.
        total: usize,
        /// Limit, percent.
        limit_percent: f64,
    },
    /// An iteration did not settle.
    #[error("{what} did not settle: last step {step:.2e} of the standard deviation after {iterations} iterations")]
    Diverged {
        /// What was fitted.
        what: &'static str,
        /// Largest last step in standard deviations.
        step: f64,
        /// Iterations made.
        iterations: usize,
    },
}

impl Refusal {
    /// What the operator can try. The error text says what went wrong.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match self {
            Self::NotFinite { .. } => {
                "find out why the recorder wrote this value; cut the record there, or record again"
            }
            Self::Parameter { .. } => "correct the parameter",
            Self::EmptyCells { .. } => {
                "find out why nothing was recorded there; remove these rows only if the order of rows does not matter"
            }
            Self::UnknownTimeUnit { .. } => "name the unit in the header, as `timestamp [ms]`, or correct --rate",
            Self::Lengths { .. } => "export all channels from the same record",
            Self::TooFew { .. } => "record longer",
            Self::Constant { .. } | Self::Stuck { .. } => "check that the sensor is alive and inside its range",
            Self::Alike { .. } => "give the figures with more digits, or check that the sensor is alive",
            Self::FewRates { .. } => "turn at more rates, in both senses",
            Self::OffLine { .. } => {
                "check the sign of this rate, its rows, and that the sensor answers at all; --residual moves the limit"
            }
            Self::Missing { .. } => "record what is missing, or correct the labels",
            Self::UnknownLabel { .. } => "use the labels x+ x- y+ y- z+ z-",
            Self::SplitLabel { .. } => "remove one of the blocks, or correct its label",
            Self::NotUnit { .. } => "give the direction that points up, in the axes of the module, with length 1",
            Self::Moved { .. } => "wait until the table stands still and repeat the position",
            Self::Short { .. } => "stay equally long in every position",
            Self::Saturated { .. } => "use a wider range, or turn more slowly",
            Self::Clipped { .. } => "use a wider range, or correct the offset, and record again",
            Self::BadRows { .. } | Self::Unbridged { .. } => {
                "look at the first row named: check the line to the sensor, and record again"
            }
            Self::Stale { rows_per_update: None, .. } => {
                "look at the first row named: the sensor or its line stood still there, or its output lay at one end; record again"
            }
            Self::Stale { .. } => {
                "keep each new row once and state the rate at which the sensor updates, or read it only when it has new data"
            }
            Self::Unsigned { .. } => {
                "write the counts as signed numbers: subtract the whole range from the counts in its upper half"
            }
            Self::WrongSign { .. } | Self::WrongAxis { .. } => "check the labels and how the module sits in the socket",
            Self::PoseResidual { .. } => "check its label and how the module sat in the socket",
            Self::Residual { .. } => {
                "look for two fields in one record (another place, a current switched) and for vibration; \
                 --residual allows more"
            }
            Self::CentreMoves { .. } => {
                "look for iron that was moved or magnetised during the record; cut it there; --residual allows more"
            }
            Self::IllConditioned { what, .. } if what.contains("temperature") => {
                "take the three temperatures farther from each other"
            }
            Self::IllConditioned { .. } => "add attitudes that differ more from each other",
            Self::NotMonotonic { before, after, .. } if starts_again(*before, *after) => {
                "the stamps look like a counter of 16 or 32 bits that starts again: export them unwrapped"
            }
            Self::NotMonotonic { .. } | Self::Gap { .. } => "record again, or cut the record there",
            Self::RateMismatch { .. } => {
                "state the rate that the time column shows, or find out which of the two clocks is wrong; \
                 --rate-tolerance allows more"
            }
            Self::RateChanges { .. } => "cut the record at this row, or find out what changed the rate there",
            Self::Jittery { .. } => {
                "record the time stamps of the sensor instead of those of the host, or record longer"
            }
            Self::NoRotation { .. } => "check the label of the run and that the table turned",
            Self::CutOff { .. } => "start the record before the table turns, and stop it after the table stops",
            Self::Restless { .. } => "let the table rest before and after the rotation",
            Self::Mismatch { .. } | Self::SameSense { .. } => {
                "check that both runs turned by the same angle, once forward and once back"
            }
            Self::OutOfBand { .. } => "check the number of turns and the range of the sensor",
            Self::NotClosed { expected: "ellipsoid", .. } => {
                "record more attitudes, in all directions, while only the field or only gravity acts"
            }
            Self::NotClosed { .. } => "record whole turns in a steady field",
            Self::FewTurns { .. } => "record more turns",
            Self::Coverage { .. } => "turn the module through more directions",
            Self::Noisy { .. } => "check the field and the plane of rotation: the field in that plane must be large",
            Self::TooManyRejected { .. } => {
                "find what disturbs the record (the plot shows where): outliers on one side pull the fit, more turns do not help"
            }
            Self::Diverged { .. } => "look at the plot: the points do not fit the model",
        }
    }
}

/// A part of a total, in percent.
fn share(samples: usize, total: usize) -> f64 {
    samples as f64 * 100.0 / total.max(1) as f64
}

/// The clause of the text about rows that repeat the row before.
fn updates(rows_per_update: Option<f64>) -> String {
    match rows_per_update {
        Some(rows) => format!("new rows come at 1/{rows:.3} of the record's rate"),
        None => "noise does not give so many".to_owned(),
    }
}

/// Whether a time before a step back is the end of a counter of 16, 31 or 32 bits in s, ms, us or ns.
fn starts_again(before: f64, after: f64) -> bool {
    let near = |end: f64, unit: f64| (before / (end * unit) - 1.0).abs() < 0.01;
    let ends = [16, 31, 32].map(|bits| 2.0_f64.powi(bits));
    after.abs() < 0.02 * before && ends.iter().any(|end| [1.0, 1e-3, 1e-6, 1e-9].iter().any(|unit| near(*end, *unit)))
}
