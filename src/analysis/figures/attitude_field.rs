//! An ellipsoid over still attitudes, and the search for attitudes that do not belong to it.
//!
//! The parts of an attitude share one error, that of the ambient field while the module lies there. So a part is
//! compared with its own attitude, and an attitude with the fit to the others: data snooping (Baarda 1968), for several
//! at once as the generalized extreme deviate of Rosner (1983). The scale is at least that of the noise of an attitude
//! and of the ambient field of the bench file. Where the other attitudes scatter by more, their scatter is the scale.

use gnc_metrology::{Refusal, ellipsoid, ellipsoid::Ellipsoid, stats};
use nalgebra::{SVector, Vector3};

use super::FigureError;
use super::mean::{self, MeanVariance};

/// Parameters of an ellipsoid.
pub(super) const PARAMETERS: usize = 9;
/// Fewest attitudes: three more than parameters, so that the fit can identify one wrong attitude.
const FEWEST: usize = 12;
/// Standard deviations beyond which a part or an attitude does not belong: 6 in 10 million of normal errors.
const LIMIT_SIGMA: f64 = 5.0;
/// One part in this many of the attitudes can be identified as wrong.
const MOST: usize = 6;
/// Largest part of an attitude that may be left out.
const LEFT_OUT: f64 = 0.25;

/// A still attitude.
pub(super) struct Attitude {
    pub(super) label: String,
    /// Means of its equal parts, gauss.
    pub(super) parts: Vec<Vector3<f64>>,
}

/// An ellipsoid and its attitudes.
pub(super) struct Field {
    pub(super) found: Ellipsoid,
    /// Parts that were left out.
    pub(super) left_out: usize,
    /// Variance of the mean distance of an attitude, from the scatter of its parts: noise, white and slow.
    pub(super) noise: MeanVariance,
    /// Variance of the same mean distance, from the distances of the attitudes, with their degrees of freedom.
    pub(super) between: MeanVariance,
    /// Change of the figures for one gauss of each attitude's distance, in the order of the fit's covariance.
    sensitivities: Vec<SVector<f64, 10>>,
}

impl Field {
    /// Fits the attitudes. `ambient_u_gauss` is the standard uncertainty of the ambient field from one attitude to the
    /// next.
    pub(super) fn of(mut attitudes: Vec<Attitude>, ambient_u_gauss: f64, top_gauss: f64) -> Result<Self, FigureError> {
        if attitudes.len() < FEWEST {
            let what = "an ellipsoid over attitudes".to_owned();
            let refusal = Refusal::TooFew { what, got: attitudes.len(), needed: FEWEST };
            return Err(FigureError::refused("ellipsoid")(refusal));
        }
        let lengths = lengths(&attitudes);
        let left_out = leave_out(&mut attitudes, &lengths, ambient_u_gauss)?;
        let expected = mean::variance(&self::lengths(&attitudes)).variance + ambient_u_gauss * ambient_u_gauss;
        let places: Vec<usize> = (0..attitudes.len()).collect();
        let whole = fit(&attitudes, &places, top_gauss);
        let odd = odd_ones(&attitudes, &whole, expected, top_gauss);
        if !odd.is_empty() {
            return Err(named(&attitudes, &odd, expected.sqrt(), top_gauss));
        }
        let found = whole.map_err(FigureError::refused("ellipsoid"))?;
        let distances: Vec<Vec<f64>> =
            attitudes.iter().map(|attitude| attitude.parts.iter().map(|part| found.distance(part)).collect()).collect();
        let dof = (attitudes.len() - PARAMETERS) as f64;
        let squares: f64 = distances.iter().map(|parts| stats::mean(parts).powi(2)).sum();
        let sensitivities =
            attitudes.iter().map(|attitude| attitude.parts.iter().map(|part| found.sensitivity(part)).sum()).collect();
        Ok(Self {
            left_out,
            noise: mean::variance(&distances),
            between: MeanVariance { variance: squares / dof, dof },
            sensitivities,
            found,
        })
    }

    /// Returns the effect of independent errors of the attitudes' distances, of one gauss each, on the figure at a
    /// place of the fit's covariance.
    pub(super) fn per_gauss(&self, figure: usize) -> f64 {
        self.sensitivities.iter().map(|of| of[figure] * of[figure]).sum::<f64>().sqrt()
    }
}

/// Lengths of the parts about the centre of the attitudes' means. They are near enough to the distances to show
/// scatter, and exist also where no ellipsoid fits. The lengths scatter little where a module turns a little while it
/// lies there.
fn lengths(attitudes: &[Attitude]) -> Vec<Vec<f64>> {
    let middle = |parts: &[Vector3<f64>]| parts.iter().sum::<Vector3<f64>>() / parts.len() as f64;
    let centre =
        attitudes.iter().map(|attitude| middle(&attitude.parts)).sum::<Vector3<f64>>() / attitudes.len() as f64;
    attitudes.iter().map(|attitude| attitude.parts.iter().map(|part| (part - centre).norm()).collect()).collect()
}

/// Leaves out the parts that do not belong to their attitude, and returns their number.
fn leave_out(attitudes: &mut [Attitude], lengths: &[Vec<f64>], ambient_u_gauss: f64) -> Result<usize, FigureError> {
    let off: Vec<Vec<f64>> = lengths
        .iter()
        .map(|lengths| {
            let median = stats::median(&mut lengths.clone());
            lengths.iter().map(|length| (length - median).abs()).collect()
        })
        .collect();
    // The factor 1.4826 leads from the median deviation to the standard deviation of normal noise.
    let sd = 1.4826 * stats::median(&mut off.concat());
    let limit = LIMIT_SIGMA * sd.hypot(ambient_u_gauss);
    let mut count = 0;
    for (attitude, off) in attitudes.iter_mut().zip(&off) {
        let before = attitude.parts.len();
        let kept = attitude.parts.iter().zip(off).filter(|(_, off)| **off <= limit).map(|(part, _)| *part).collect();
        attitude.parts = kept;
        let left_out = before - attitude.parts.len();
        if left_out as f64 > LEFT_OUT * before as f64 {
            let why = format!(
                "{left_out} of its {before} parts differ from the others by more than {:.3} mgauss: the field changed \
                 while the module lay there",
                limit * 1e3
            );
            return Err(FigureError::Unfit { label: attitude.label.clone(), why });
        }
        count += left_out;
    }
    Ok(count)
}

/// Fits some of the attitudes.
fn fit(attitudes: &[Attitude], places: &[usize], top_gauss: f64) -> Result<Ellipsoid, Refusal> {
    let channel = |axis: usize| -> Vec<f64> {
        places.iter().flat_map(|&place| &attitudes[place].parts).map(|part| part[axis]).collect()
    };
    ellipsoid::fit_every(&channel(0), &channel(1), &channel(2), Some(top_gauss))
}

/// Mean distance of an attitude from an ellipsoid, gauss.
fn distance(found: &Ellipsoid, attitude: &Attitude) -> f64 {
    attitude.parts.iter().map(|part| found.distance(part)).sum::<f64>() / attitude.parts.len() as f64
}

/// Returns the attitudes that do not belong to the ellipsoid of the others. `expected` is the variance of the mean
/// distance of an attitude that belongs to it.
fn odd_ones(attitudes: &[Attitude], whole: &Result<Ellipsoid, Refusal>, expected: f64, top_gauss: f64) -> Vec<usize> {
    let squares = |found: &Ellipsoid, places: &[usize]| -> f64 {
        places.iter().map(|&place| distance(found, &attitudes[place]).powi(2)).sum()
    };
    let mut rest: Vec<usize> = (0..attitudes.len()).collect();
    // Attitudes that no ellipsoid fits are infinitely far from it.
    let mut left = whole.as_ref().map_or(f64::INFINITY, |found| squares(found, &rest));
    let limit = LIMIT_SIGMA * LIMIT_SIGMA;
    if left <= limit * expected {
        return Vec::new();
    }
    let (mut removed, mut odd) = (Vec::new(), 0);
    for _ in 0..attitudes.len() / MOST {
        if rest.len() < PARAMETERS + 3 {
            break;
        }
        let without = |place: usize| rest.iter().copied().filter(|&other| other != place).collect::<Vec<_>>();
        let best = rest
            .iter()
            .map(|&place| {
                let others = without(place);
                let left = fit(attitudes, &others, top_gauss).map_or(f64::INFINITY, |found| squares(&found, &others));
                (place, left)
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((place, now)) = best else { break };
        rest = without(place);
        removed.push(place);
        // The removal of a point lowers the sum of squares by the square of its distance in standard deviations.
        let variance = expected.max(now / (rest.len() - PARAMETERS) as f64);
        if left - now > limit * variance {
            odd = removed.len();
        }
        left = now;
    }
    removed.truncate(odd);
    removed
}

/// The refusal that names the odd attitudes, with their distances from the ellipsoid of the others.
fn named(attitudes: &[Attitude], odd: &[usize], expected_gauss: f64, top_gauss: f64) -> FigureError {
    let rest: Vec<usize> = (0..attitudes.len()).filter(|place| !odd.contains(place)).collect();
    let found = fit(attitudes, &rest, top_gauss);
    let off = odd
        .iter()
        .map(|&place| {
            let off = found.as_ref().map_or(f64::NAN, |found| distance(found, &attitudes[place]));
            (attitudes[place].label.clone(), off * 1e3)
        })
        .collect();
    FigureError::Disturbed { attitudes: off, limit_mgauss: LIMIT_SIGMA * expected_gauss * 1e3 }
}
