//! Still positions: rows of a record with a label or an up direction, averaged to one mean per position.

use std::ops::Range;

use nalgebra::Vector3;

use crate::{AXES, Refusal, quantisation, series, stats};

/// The six labels: the axis that points up at rest.
pub const LABELS: [&str; 6] = ["x+", "x-", "y+", "y-", "z+", "z-"];

/// A position with fewer rows than this has no block means that are worth a test for motion.
const MOTION_ROWS: usize = 64;
const MOTION_BLOCKS: usize = 8;
/// Shorter means in each of these blocks. Their scatter shows how much of the scatter of the blocks is noise: behind a
/// low-pass this is more than neighbouring rows show.
const MEANS_OF_BLOCK: usize = 4;

/// A position with fewer rows than this part of the median position is refused as too short.
const SHORT_FRACTION: f64 = 0.1;

/// One still position.
#[derive(Debug, Clone, PartialEq)]
pub struct Position {
    /// Label, or number from 1.
    pub label: String,
    /// Unit vector that points up, in the axes of the fixture.
    pub up: Vector3<f64>,
    /// Mean output of the triad.
    pub mean: Vector3<f64>,
    /// Rows that were averaged.
    pub rows: usize,
    /// Standard uncertainty of each mean from the steps of the output ([`quantisation::mean_error_sd`]).
    pub resolution_sd: Vector3<f64>,
}

impl Position {
    /// A position whose mean is already known, from its label.
    ///
    /// # Errors
    /// [`Refusal::UnknownLabel`] (row 0).
    pub fn of_mean(label: &str, mean: Vector3<f64>, rows: usize) -> Result<Self, Refusal> {
        let up = up_of(label).ok_or_else(|| Refusal::UnknownLabel { label: label.to_owned(), row: 0 })?;
        Ok(Self { label: label.to_owned(), up, mean, rows, resolution_sd: Vector3::zeros() })
    }
}

/// Limits on motion and saturation of a still position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Block means of a position may spread by this part of a channel's response (half the range of its position
    /// means). 0.002 is 2 mrad of pose for an accelerometer; 0 where the response gives no measure (gyroscopes).
    pub motion: f64,
    /// ... and by this many standard errors of the record's own noise.
    pub noise_factor: f64,
    /// Output at which a channel is saturated, if known.
    pub saturation: Option<f64>,
}

impl Limits {
    /// Limits for accelerometers: 2 mrad.
    pub const ACCELEROMETER: Self = Self { motion: 2e-3, noise_factor: 6.0, saturation: None };
    /// Limits for gyroscopes. The bias of a gyroscope wanders by more than white noise explains; a motion gives much
    /// more.
    pub const GYROSCOPE: Self = Self { motion: 0.0, noise_factor: 20.0, saturation: None };
}

/// Up direction of a label.
#[must_use]
pub fn up_of(label: &str) -> Option<Vector3<f64>> {
    let index = LABELS.iter().position(|l| *l == label)?;
    let mut up = Vector3::zeros();
    up[index / 2] = if index % 2 == 0 { 1.0 } else { -1.0 };
    Some(up)
}

/// Blocks of equal neighbours.
///
/// # Errors
/// [`Refusal::SplitLabel`] when a label comes again after a different one.
pub fn blocks<L: AsRef<str>>(labels: &[L]) -> Result<Vec<Range<usize>>, Refusal> {
    let blocks = series::stretches(labels.len(), |a, b| labels[a].as_ref() == labels[b].as_ref());
    for (i, block) in blocks.iter().enumerate() {
        let label = labels[block.start].as_ref();
        if let Some(earlier) = blocks[..i].iter().find(|b| labels[b.start].as_ref() == label) {
            let (first, again) = (earlier.start + 1, block.start + 1);
            return Err(Refusal::SplitLabel { label: label.to_owned(), first, again });
        }
    }
    Ok(blocks)
}

/// Averages rows labelled with the axis that points up. All six labels must be there, each in one block.
///
/// # Errors
/// Rows that are not finite or differ in number; unknown, split or missing labels; motion, stuck or saturated channels.
pub fn from_labels<L: AsRef<str>>(
    labels: &[L],
    channels: [&[f64]; 3],
    limits: &Limits,
) -> Result<Vec<Position>, Refusal> {
    if let Some(row) = labels.iter().position(|l| up_of(l.as_ref()).is_none()) {
        return Err(Refusal::UnknownLabel { label: labels[row].as_ref().to_owned(), row: row + 1 });
    }
    let blocks = blocks(labels)?;
    let missing: Vec<&str> =
        LABELS.into_iter().filter(|l| !blocks.iter().any(|b| labels[b.start].as_ref() == *l)).collect();
    if !missing.is_empty() {
        return Err(Refusal::Missing { labels: missing.join(" ") });
    }
    let named = blocks.into_iter().map(|b| {
        let label = labels[b.start].as_ref();
        (label.to_owned(), up_of(label).unwrap_or_default(), b)
    });
    average(&named.collect::<Vec<_>>(), labels.len(), channels, limits)
}

/// Averages rows that each have an up direction; rows with the same direction that follow each other are one position.
/// An attitude that comes again later is a position of its own.
///
/// # Errors
/// As [`from_labels`]; [`Refusal::NotUnit`] for a direction whose length is not 1 within 0.001.
pub fn from_directions(up: [&[f64]; 3], channels: [&[f64]; 3], limits: &Limits) -> Result<Vec<Position>, Refusal> {
    series::channels(&["ux", "uy", "uz"], &up)?;
    let rows = up[0].len();
    let direction = |i: usize| Vector3::new(up[0][i], up[1][i], up[2][i]);
    for i in 0..rows {
        let length = direction(i).norm();
        if (length - 1.0).abs() > 1e-3 {
            return Err(Refusal::NotUnit { row: i + 1, length });
        }
    }
    let named: Vec<_> = series::stretches(rows, |a, b| direction(a) == direction(b))
        .into_iter()
        .enumerate()
        .map(|(n, b)| ((n + 1).to_string(), direction(b.start).normalize(), b))
        .collect();
    average(&named, rows, channels, limits)
}

fn average(
    named: &[(String, Vector3<f64>, Range<usize>)],
    rows: usize,
    channels: [&[f64]; 3],
    limits: &Limits,
) -> Result<Vec<Position>, Refusal> {
    let length = series::channels(&AXES, &channels)?;
    if length != rows {
        return Err(Refusal::Lengths { left: rows, right: length });
    }
    if rows == 0 {
        return Err(Refusal::TooFew { what: "still positions".to_owned(), got: 0, needed: 1 });
    }
    if let Some(limit) = limits.saturation {
        for (name, values) in AXES.iter().zip(channels) {
            series::unsaturated(name, values, Some(limit))?;
        }
    }
    let stretches = |i: usize| named.iter().map(|(_, _, block)| &channels[i][block.clone()]).collect::<Vec<_>>();
    let resolution_sd = Vector3::from_fn(|i, _| quantisation::mean_error_sd(&stretches(i)));
    let positions: Vec<Position> = named
        .iter()
        .map(|(label, up, block)| Position {
            label: label.clone(),
            up: *up,
            mean: Vector3::from_fn(|i, _| stats::mean(&channels[i][block.clone()])),
            rows: block.len(),
            resolution_sd,
        })
        .collect();
    let mut lengths: Vec<f64> = positions.iter().map(|p| p.rows as f64).collect();
    let median = stats::median(&mut lengths);
    if let Some(short) = positions.iter().find(|p| (p.rows as f64) < SHORT_FRACTION * median) {
        let (position, rows, median) = (short.label.clone(), short.rows, median as usize);
        return Err(Refusal::Short { position, rows, median });
    }
    for (axis, values) in channels.iter().enumerate() {
        stillness(axis, values, named, &positions, limits)?;
    }
    Ok(positions)
}

/// Checks one channel: it is alive in every position, and its block means do not wander.
fn stillness(
    axis: usize,
    values: &[f64],
    named: &[(String, Vector3<f64>, Range<usize>)],
    positions: &[Position],
    limits: &Limits,
) -> Result<(), Refusal> {
    let noise: Vec<f64> = named.iter().map(|(_, _, b)| stats::white_sd(&values[b.clone()])).collect();
    let stretches: Vec<&[f64]> = named.iter().map(|(_, _, block)| &values[block.clone()]).collect();
    let means = || positions.iter().map(|p| p.mean[axis]);
    let response = (means().fold(f64::MIN, f64::max) - means().fold(f64::MAX, f64::min)) / 2.0;
    let slow = noise_of_means(named.iter().map(|(_, _, b)| &values[b.clone()]));
    for ((label, _, block), noise) in named.iter().zip(noise) {
        let values = &values[block.clone()];
        if noise == 0.0 && quantisation::is_stuck(&stretches, values.len()) {
            let (channel, place) = (AXES[axis].to_owned(), format!("position {label}"));
            return Err(Refusal::Stuck { channel, place, value: values[0], samples: values.len() });
        }
        if values.len() < MOTION_ROWS {
            continue;
        }
        series::unsaturated(&format!("{} of position {label}", AXES[axis]), values, None)?;
        if let Some((spread, noise, limit)) = wander(values, response, slow, limits) {
            return Err(Refusal::Moved { position: label.clone(), channel: AXES[axis], spread, noise, limit });
        }
    }
    Ok(())
}

/// The noise of a channel from its means, over all positions. A position that moves does not affect it.
pub(crate) fn noise_of_means<'a>(positions: impl Iterator<Item = &'a [f64]>) -> f64 {
    let long = positions.filter(|values| values.len() >= MOTION_ROWS);
    stats::sd_of_means(&long.map(|values| (values, values.len() / MOTION_BLOCKS / MEANS_OF_BLOCK)).collect::<Vec<_>>())
}

/// Spread of the block means of one position, the noise's part of it, and the limit; only where the spread exceeds the
/// limit. The noise is that of the rows or, where that is larger, that of the means of the channel.
pub(crate) fn wander(values: &[f64], response: f64, noise_of_means: f64, limits: &Limits) -> Option<(f64, f64, f64)> {
    if values.len() < MOTION_ROWS {
        return None;
    }
    let means: Vec<f64> = values.chunks_exact(values.len() / MOTION_BLOCKS).map(stats::mean).collect();
    let spread = means.iter().copied().fold(f64::MIN, f64::max) - means.iter().copied().fold(f64::MAX, f64::min);
    let sd = stats::white_sd(values).max(noise_of_means);
    let noise = limits.noise_factor * sd * (MOTION_BLOCKS as f64 / values.len() as f64).sqrt();
    let limit = noise.max(limits.motion * response);
    // The second limit is the rounding error of the record's size: a noiseless record is still.
    (spread > limit.max(1e-12 * means[0].abs())).then_some((spread, noise, limit))
}
