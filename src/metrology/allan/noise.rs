//! Which noise dominates at an averaging time.

use std::fmt;

/// Power-law noise of the rate: spectral density proportional to the frequency to the power of [`PowerLawNoise::alpha`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PowerLawNoise {
    /// White phase: quantisation (alpha 2).
    WhitePhase,
    /// Flicker phase (alpha 1).
    FlickerPhase,
    /// White rate: angle random walk (alpha 0).
    WhiteRate,
    /// Flicker rate: bias instability (alpha -1).
    FlickerRate,
    /// Random walk of the rate (alpha -2).
    RateRandomWalk,
    /// Flicker walk of the rate (alpha -3).
    FlickerWalk,
    /// Random run of the rate (alpha -4).
    RandomRun,
}

impl PowerLawNoise {
    const ALL: [Self; 7] = [
        Self::WhitePhase,
        Self::FlickerPhase,
        Self::WhiteRate,
        Self::FlickerRate,
        Self::RateRandomWalk,
        Self::FlickerWalk,
        Self::RandomRun,
    ];

    /// Exponent of the spectral density of the rate, 2 to -4.
    #[must_use]
    pub fn alpha(self) -> i32 {
        2 - self as i32
    }

    fn of_alpha(alpha: f64, order: usize) -> Self {
        // The variance of a difference of this order converges down to alpha = -2 (Allan) or -4 (Hadamard).
        let lowest = if order == 3 { 6.0 } else { 4.0 };
        Self::ALL[(2.0 - alpha).round().clamp(0.0, lowest) as usize]
    }
}

impl fmt::Display for PowerLawNoise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::WhitePhase => "white phase",
            Self::FlickerPhase => "flicker phase",
            Self::WhiteRate => "white rate",
            Self::FlickerRate => "flicker rate",
            Self::RateRandomWalk => "rate random walk",
            Self::FlickerWalk => "flicker walk",
            Self::RandomRun => "random run",
        })
    }
}

/// Fewer decimated phases than this do not show the noise.
const LEAST: usize = 32;
/// More decimated phases than this do not improve a whole-numbered answer.
const MOST: usize = 1 << 14;
/// Standard deviations of a lag-1 correlation within which it does not contradict a name.
const DOUBT: f64 = 3.0;

/// The noises that the lag-1 correlation allows at an averaging time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Evidence {
    likely: PowerLawNoise,
    /// Bluest name that three standard deviations of the correlation do not exclude.
    bluest: PowerLawNoise,
    reddest: PowerLawNoise,
}

/// Lag-1 autocorrelation method (Riley and Greenhall, *Power law noise identification using the lag 1 autocorrelation*,
/// 2004): the phase, decimated by m, is differenced until it is nearly stationary; the exponent follows from the number
/// of differences and from the correlation that is left. Each difference has its mean removed, which takes out offset
/// and drift.
pub(super) fn identify(phase: &[f64], m: usize, order: usize) -> Option<Evidence> {
    let length = phase.len().div_ceil(m).min(MOST);
    if length < LEAST {
        return None;
    }
    let mut z: Vec<f64> = phase.iter().step_by(m).take(length).copied().collect();
    let mut correlations = [0.0; 3];
    for correlation in correlations.iter_mut().take(order) {
        for i in 0..z.len() - 1 {
            z[i] = z[i + 1] - z[i];
        }
        z.pop();
        let mean = crate::stats::mean(&z);
        let variance: f64 = z.iter().map(|v| (v - mean).powi(2)).sum();
        if variance == 0.0 {
            return None;
        }
        *correlation = z.windows(2).map(|w| (w[0] - mean) * (w[1] - mean)).sum::<f64>() / variance;
    }
    let doubt = DOUBT / (length as f64).sqrt();
    let name = |shift: f64| named(&correlations[..order], shift);
    Some(Evidence { likely: name(0.0), bluest: name(-doubt), reddest: name(doubt) })
}

/// The noise that the correlations of the first, second ... differences name, all of them shifted by `shift`.
fn named(correlations: &[f64], shift: f64) -> PowerLawNoise {
    let order = correlations.len();
    for (before, r1) in correlations.iter().enumerate() {
        let differences = before + 1;
        let r1 = (r1 + shift).clamp(-0.99, 0.99);
        let delta = r1 / (1.0 + r1);
        if differences == 2 && (order == 2 || delta < 0.25) {
            return of_second_differences(r1);
        }
        if delta < 0.25 || differences == order {
            return PowerLawNoise::of_alpha(2.0 - 2.0 * (delta + differences as f64), order);
        }
    }
    PowerLawNoise::WhiteRate
}

/// Names of the noise along rising averaging times. Between 32 and 200 decimated phases a correlation scatters by more
/// than a name is wide, so a name goes on until the record excludes it, and the colour turns no bluer than white unless
/// the shortest averaging times show noise of the phase.
pub(super) fn names(evidence: &[Option<Evidence>]) -> Vec<Option<PowerLawNoise>> {
    let first = evidence.iter().flatten().next().map(|e| e.likely);
    let bluest = first.filter(|f| f.alpha() > 0).unwrap_or(PowerLawNoise::WhiteRate);
    let mut name: Option<PowerLawNoise> = None;
    evidence
        .iter()
        .map(|evidence| {
            if let Some(e) = evidence {
                let excluded = |n: PowerLawNoise| n.alpha() > e.bluest.alpha() || n.alpha() < e.reddest.alpha();
                if name.is_none_or(excluded) {
                    name = Some(if e.likely.alpha() > bluest.alpha() { bluest } else { e.likely });
                }
            }
            name
        })
        .collect()
}

/// The rate noise that the correlation of second differences of a decimated phase names. The method's
/// `alpha = 2 - 2 (delta + 2)` holds for samples. Here the values are means over the averaging time, whose correlation
/// is -0.50 for white, -0.22 for flicker and +0.25 for random walk of the rate (-0.50, -0.33 and 0 for samples). The
/// borders lie between both sets: the method's own, -0.43 and -0.20, would call most flicker a random walk.
fn of_second_differences(r1: f64) -> PowerLawNoise {
    match r1 {
        _ if r1 < -0.4 => PowerLawNoise::WhiteRate,
        _ if r1 < -0.1 => PowerLawNoise::FlickerRate,
        _ => PowerLawNoise::RateRandomWalk,
    }
}
