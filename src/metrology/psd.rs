//! Power spectral density after Welch.

use nalgebra::DMatrix;

use crate::coefficient::Coefficient;
use crate::{Refusal, linear, series, stats};

/// One-sided power spectral density.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectralDensity {
    /// Frequencies from 0 to half the rate, Hz.
    pub frequency_hz: Vec<f64>,
    /// Density, unit squared per Hz; white noise of Allan coefficient N reads `2 N^2`.
    pub density: Vec<f64>,
    /// Segments that were averaged.
    pub segments: usize,
}

/// Welch's averaged periodogram (IEEE Trans. Audio Electroacoust. 15, 1967): periodic Hann window, 50 % overlap, the
/// mean of each segment removed, one-sided density. Samples after the last whole segment are not used.
///
/// # Errors
/// [`Refusal::NotFinite`], [`Refusal::Parameter`] for a segment below 8 samples, [`Refusal::TooFew`] when the record is
/// shorter than one segment, [`Refusal::Constant`].
pub fn welch(values: &[f64], rate_hz: f64, segment: usize) -> Result<SpectralDensity, Refusal> {
    series::finite("record", values)?;
    series::positive("rate (Hz)", rate_hz)?;
    if segment < 8 {
        return Err(Refusal::Parameter { name: "segment", value: segment as f64, expected: "at least 8 samples" });
    }
    if values.len() < segment {
        return Err(Refusal::TooFew { what: "one segment".to_owned(), got: values.len(), needed: segment });
    }
    if values.iter().all(|v| *v == values[0]) {
        return Err(Refusal::Constant { channel: "record".to_owned(), samples: values.len(), value: values[0] });
    }
    let window = hann(segment);
    let power: f64 = window.iter().map(|w| w * w).sum();
    let transform = gnc_fourier::forward(segment);
    let (mut input, mut output) = (transform.make_input_vec(), transform.make_output_vec());
    let mut scratch = transform.make_scratch_vec();
    let mut density = vec![0.0; output.len()];
    let hop = segment - segment / 2;
    let mut segments = 0_u32;
    for start in (0..=values.len() - segment).step_by(hop) {
        let part = &values[start..start + segment];
        let mean = stats::mean(part);
        for ((x, v), w) in input.iter_mut().zip(part).zip(&window) {
            *x = (v - mean) * w;
        }
        if transform.process_with_scratch(&mut input, &mut output, &mut scratch).is_err() {
            // The buffers come from the plan itself, so their lengths fit.
            unreachable!("buffers of the plan do not fit the plan");
        }
        for (d, c) in density.iter_mut().zip(&output) {
            *d += c.norm_sqr();
        }
        segments += 1;
    }
    let last = density.len() - 1;
    for (k, d) in density.iter_mut().enumerate() {
        // The mean and, of an even segment, half the rate have no mirror image.
        let sides = if k == 0 || (k == last && segment.is_multiple_of(2)) { 1.0 } else { 2.0 };
        *d *= sides / (rate_hz * power * f64::from(segments));
    }
    let frequency_hz = (0..=last).map(|k| k as f64 * rate_hz / segment as f64).collect();
    Ok(SpectralDensity { frequency_hz, density, segments: segments as usize })
}

/// Spectrum that single events do not raise: at each frequency the median over segments apart from each other.
#[derive(Debug, Clone, PartialEq)]
pub struct RobustSpectrum {
    /// Distance of the frequencies, Hz; the first is 0.
    pub step_hz: f64,
    /// One-sided density, unit squared per Hz.
    pub density: Vec<f64>,
    /// Relative standard deviation of one density.
    pub relative_sd: f64,
}

/// Level part of a spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plateau {
    /// Density, unit squared per Hz: `2 N^2`.
    pub density: f64,
    /// Relative standard deviation of the density.
    pub relative_sd: f64,
    /// Where the level part begins, Hz.
    pub from_hz: f64,
    /// Where the level part ends, Hz.
    pub to_hz: f64,
}

/// Most segments of a spectrum, spread over the record. More would cost more time than the deviations.
const SEGMENTS: usize = 64;
const SHORTEST: usize = 32;
const LONGEST: usize = 2048;

/// Lines below this bin of a spectrum look like a wandering bias.
const LOWEST_LINE: usize = 8;
/// A line stands out this many times over its neighbours ...
const STANDS_OUT: f64 = 3.0;
/// ... and by this many standard deviations.
const OVER_SCATTER: f64 = 8.0;

impl RobustSpectrum {
    /// The spectrum of a record; `None` below 16 segments of 32 samples.
    #[must_use]
    pub fn of(values: &[f64], rate_hz: f64) -> Option<Self> {
        let segment = (values.len() / 16).checked_ilog2().map(|bits| 1_usize << bits)?.min(LONGEST);
        if segment < SHORTEST {
            return None;
        }
        let window = hann(segment);
        let power: f64 = window.iter().map(|w| w * w).sum();
        let transform = gnc_fourier::forward(segment);
        let (mut input, mut output) = (transform.make_input_vec(), transform.make_output_vec());
        let mut scratch = transform.make_scratch_vec();
        let count = (values.len() / segment).min(SEGMENTS);
        let mut ordinates = vec![Vec::with_capacity(count); output.len()];
        for index in 0..count {
            let start = index * (values.len() / count);
            let part = values.get(start..start + segment)?;
            let mean = stats::mean(part);
            input.iter_mut().zip(part).zip(&window).for_each(|((x, v), w)| *x = (v - mean) * w);
            transform.process_with_scratch(&mut input, &mut output, &mut scratch).ok()?;
            ordinates.iter_mut().zip(&output).for_each(|(o, c)| o.push(c.norm_sqr()));
        }
        // An ordinate is exponentially distributed; this is the mean of its median over `count` segments.
        let order = |r: usize| (count - r + 1..=count).map(|j| 1.0 / j as f64).sum::<f64>();
        let median = f64::midpoint(order(count / 2 + count % 2), order(count / 2 + 1));
        let scale = 2.0 / (rate_hz * power * median);
        let density = ordinates.iter_mut().map(|o| stats::median(o) * scale).collect();
        let relative_sd = 1.0 / (std::f64::consts::LN_2 * (count as f64).sqrt());
        Some(Self { step_hz: rate_hz / segment as f64, density, relative_sd })
    }

    /// The same form of a Welch spectrum, where nine of ten segments count (overlap of 50 % under a Hann window).
    #[must_use]
    pub fn of_welch(psd: &SpectralDensity) -> Self {
        let step_hz = psd.frequency_hz.get(1).copied().unwrap_or(f64::NAN);
        Self { step_hz, density: psd.density.clone(), relative_sd: (0.9 * psd.segments as f64).powf(-0.5) }
    }

    /// Bin of the strongest line. A line stands out over the median of its neighbours.
    pub(crate) fn line(&self) -> Option<usize> {
        let lines = (0..self.density.len()).filter(|k| self.beside(*k).is_some());
        lines.max_by(|a, b| self.density[*a].total_cmp(&self.density[*b]))
    }

    /// The same spectrum with the median of the neighbours in place of each line.
    #[must_use]
    pub fn without_lines(&self) -> Self {
        let mut density = self.density.clone();
        for (k, level) in (0..density.len()).filter_map(|k| Some((k, self.beside(k)?))) {
            // A Hann window spreads a line over two bins on each side.
            let to = (k + 2).min(density.len() - 1);
            density[k - 2..=to].fill(level);
        }
        Self { density, ..self.clone() }
    }

    /// Median of the neighbours of a bin that stands out.
    fn beside(&self, k: usize) -> Option<f64> {
        let end = self.density.len().checked_sub(1)?;
        if k < LOWEST_LINE || k >= end {
            return None;
        }
        let reach = (k / 4).min(16);
        let level = stats::median(&mut self.density[k - reach..(k + reach + 1).min(end)].to_vec());
        (self.density[k] > level * STANDS_OUT.max(1.0 + OVER_SCATTER * self.relative_sd)).then_some(level)
    }

    /// Level of the level part: the widest part, by the ratio of its ends, that follows `level + bend f^2` within its
    /// scatter (chi-square with p >= 0.2), without its upper octave. A low-pass of any order begins with `f^2`. Its
    /// next term is sixteen times smaller an octave below, where the scatter just hides it. `None` where no part spans
    /// two octaves.
    #[must_use]
    pub fn plateau(&self) -> Option<Plateau> {
        let part = self.level_part()?;
        self.plateau_of(&part, self.level(&part)?)
    }

    /// The same plateau with a term `rise / f` in the fit, `rise >= 0`. A flicker too weak to show in the level part
    /// still raises its level by more than its scatter. This fit has a larger standard deviation: a third larger in a
    /// level part of 128 bins, and twice as large in one of 32 bins. A spike moves its level more.
    #[must_use]
    pub fn plateau_above_flicker(&self) -> Option<Plateau> {
        let part = self.level_part()?;
        self.plateau_of(&part, self.level_above_flicker(&part)?)
    }

    fn level_part(&self) -> Option<Vec<Group>> {
        let groups = self.groups();
        let mut best: Option<(f64, usize, usize)> = None;
        for from in 0..groups.len() {
            for to in from + FEWEST_GROUPS - 1..groups.len() {
                let ratio = groups[to].end() as f64 / groups[from].first as f64;
                if ratio < NARROWEST || best.is_some_and(|(widest, ..)| ratio <= widest) {
                    continue;
                }
                if let Some(level) = self.level(&groups[from..=to])
                    && stats::chi_square_probability(level.chi_square, (to - from - 1) as f64) <= 1.0 - LEVEL
                {
                    best = Some((ratio, from, to));
                }
            }
        }
        let (_, from, to) = best?;
        let part = &groups[from..=to];
        let below = part.partition_point(|g| g.end() <= groups[to].end() / 2);
        Some(if below < FEWEST_GROUPS { part } else { &part[..below] }.to_vec())
    }

    fn plateau_of(&self, part: &[Group], level: Level) -> Option<Plateau> {
        let (first, last) = (part.first()?, part.last()?);
        Some(Plateau {
            density: level.density,
            relative_sd: level.sd / level.density,
            from_hz: first.first as f64 * self.step_hz,
            to_hz: (last.end() - 1) as f64 * self.step_hz,
        })
    }

    /// Weighted fit of `level + bend f^2`.
    fn level(&self, groups: &[Group]) -> Option<Level> {
        let mut bent = (stats::mean(&groups.iter().map(|g| g.density).collect::<Vec<_>>()), 0.0);
        let mut level = None;
        // The scatter is that of the fitted curve.
        for _ in 0..4 {
            let (mut s, mut sx, mut sxx, mut sy, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
            let sd = |g: &Group| self.sd_of(g.bins) * (bent.0 + bent.1 * g.square);
            for g in groups {
                let w = sd(g).powi(-2);
                s += w;
                sx += w * g.square;
                sxx += w * g.square * g.square;
                sy += w * g.density;
                sxy += w * g.square * g.density;
            }
            let determinant = s * sxx - sx * sx;
            let fit = ((sxx * sy - sx * sxy) / determinant, (s * sxy - sx * sy) / determinant);
            let chi_square =
                groups.iter().map(|g| ((g.density - fit.0 - fit.1 * g.square) / sd(g)).powi(2)).sum::<f64>();
            if !chi_square.is_finite() || groups.iter().any(|g| fit.0 + fit.1 * g.square <= 0.0) || fit.0 <= 0.0 {
                return None;
            }
            level = Some(Level { density: fit.0, sd: (sxx / determinant).sqrt(), chi_square });
            bent = fit;
        }
        level
    }

    /// Weighted fit of `level + bend f^2 + rise / f`; without the rise where it is negative.
    fn level_above_flicker(&self, groups: &[Group]) -> Option<Level> {
        let level = self.level(groups)?;
        let mut curve = vec![level.density; groups.len()];
        let mut clear = level;
        // The scatter is that of the fitted curve.
        for _ in 0..4 {
            let sd: Vec<f64> = groups.iter().zip(&curve).map(|(g, density)| self.sd_of(g.bins) * density).collect();
            let design =
                DMatrix::from_fn(groups.len(), 3, |r, c| [1.0, groups[r].square, groups[r].inverse][c] / sd[r]);
            let data = DMatrix::from_fn(groups.len(), 1, |r, _| groups[r].density / sd[r]);
            let Ok(fit) = linear::least_squares("level of a spectrum", &design, &data) else { return Some(level) };
            let [density, bend, rise] = [0, 1, 2].map(|term| fit.solution[term]);
            curve = groups.iter().map(|g| density + bend * g.square + rise * g.inverse).collect();
            if rise <= 0.0 || density <= 0.0 || curve.iter().any(|density| *density <= 0.0) {
                return Some(level);
            }
            clear = Level { density, sd: fit.cofactor[(0, 0)].sqrt(), chi_square: fit.residuals.norm_squared() };
        }
        Some(clear)
    }

    /// Groups of bins, a quarter of an octave each. The two lowest bins hold the rest of the mean, and the last bin has
    /// no mirror image.
    fn groups(&self) -> Vec<Group> {
        let last = self.density.len() - 1;
        let mut groups = Vec::new();
        let mut first = 2;
        while first < last {
            let bins = ((first as f64 * (2.0_f64.powf(0.25) - 1.0)).round() as usize).clamp(1, last - first);
            let square = (first..first + bins).map(|k| (k as f64).powi(2)).sum::<f64>() / bins as f64;
            let inverse = (first..first + bins).map(|k| (k as f64).recip()).sum::<f64>() / bins as f64;
            groups.push(Group {
                first,
                bins,
                square,
                inverse,
                density: stats::mean(&self.density[first..first + bins]),
            });
            first += bins;
        }
        groups
    }

    /// Relative standard deviation of the mean of neighbouring bins. A Hann window correlates them (4/9 with the next
    /// one, 1/36 with the one after).
    fn sd_of(&self, bins: usize) -> f64 {
        let n = bins as f64;
        let common = 1.0 + 2.0 * ((n - 1.0) * 4.0 / 9.0 + (n - 2.0).max(0.0) / 36.0) / n;
        self.relative_sd * (common / n).sqrt()
    }
}

/// A part is level from this probability of chi-square on. It is larger than usual, since the beginning of a slope
/// bends the level before a test can prove it.
const LEVEL: f64 = 0.2;
/// Ratio of the ends of the narrowest part that counts as level.
const NARROWEST: f64 = 4.0;
/// Least number of groups of a level part: one more than the terms of the widest fit, so that no fit passes through all
/// of them. Where the part without its upper octave has fewer, the whole part counts.
const FEWEST_GROUPS: usize = 4;

/// A group of neighbouring bins.
#[derive(Debug, Clone, Copy)]
struct Group {
    first: usize,
    bins: usize,
    /// Mean square of the bins' numbers.
    square: f64,
    /// Mean inverse of the bins' numbers.
    inverse: f64,
    /// Mean density.
    density: f64,
}

impl Group {
    fn end(&self) -> usize {
        self.first + self.bins
    }
}

/// The level that a fit gives at low frequencies.
#[derive(Clone, Copy)]
struct Level {
    density: f64,
    sd: f64,
    chi_square: f64,
}

impl Plateau {
    /// Coefficient N of white noise of this density, with its 68.3 % interval.
    #[must_use]
    pub fn n(&self) -> Coefficient {
        let value = (self.density / 2.0).sqrt();
        let (low, high) = stats::sd_interval(value, 2.0 / self.relative_sd.powi(2), stats::ONE_SIGMA);
        Coefficient { value, low, high }
    }
}

/// Periodic Hann window.
fn hann(segment: usize) -> Vec<f64> {
    (0..segment).map(|i| 0.5 - 0.5 * (std::f64::consts::TAU * i as f64 / segment as f64).cos()).collect()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    fn white(n: usize, seed: u64) -> Vec<f64> {
        let mut dice = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        (0..n).map(|_| StandardNormal.sample(&mut dice)).collect()
    }

    /// A sine of amplitude A on a frequency of the transform reads `A^2 / 2` over the equivalent noise bandwidth of the
    /// window (1.5 bins) at that frequency, a quarter of it on both sides and nothing elsewhere; its power is
    /// `A^2 / 2`.
    #[test]
    fn a_sine_on_a_bin() {
        let (amplitude, rate_hz, segment, bin) = (3.0, 200.0, 256, 19);
        let values: Vec<f64> = (0..segment * 8)
            .map(|i| 1e6 + amplitude * (std::f64::consts::TAU * (bin * i) as f64 / segment as f64 + 0.4).sin())
            .collect();
        let psd = welch(&values, rate_hz, segment).unwrap();
        let step_hz = rate_hz / segment as f64;
        assert_eq!((psd.segments, psd.frequency_hz.len()), (15, segment / 2 + 1));
        assert_eq!((psd.frequency_hz[bin], psd.frequency_hz[segment / 2]), (bin as f64 * step_hz, rate_hz / 2.0));
        let peak = amplitude * amplitude / 2.0 / (1.5 * step_hz);
        for (k, density) in psd.density.iter().enumerate() {
            let expected = [peak, peak / 4.0].get(k.abs_diff(bin)).copied().unwrap_or(0.0);
            assert!((density - expected).abs() < 1e-7 * peak, "bin {k}: {density} {expected}");
        }
        let power = psd.density.iter().sum::<f64>() * step_hz;
        assert!((power / (amplitude * amplitude / 2.0) - 1.0).abs() < 1e-7, "{power}");
    }

    /// White noise of Allan coefficient N has the density 2 N^2: samples of deviation s at a rate have
    /// `N = s / sqrt(rate)`.
    #[test]
    fn white_noise() {
        let (rate_hz, sd) = (100.0, 0.7);
        let values: Vec<f64> = white(400_000, 5).iter().map(|v| sd * v - 40.0).collect();
        let psd = welch(&values, rate_hz, 512).unwrap();
        let level = 2.0 * sd * sd / rate_hz;
        // Without the first bins, which the removed mean bends, and the last, which has no mirror image. Each bin is a
        // mean over 1561 segments that overlap: it scatters by 2.7 %, and the mean of all bins by 0.22 % (as the
        // variance of the samples).
        let inner = &psd.density[2..256];
        let mean = stats::mean(inner);
        assert!((mean / level - 1.0).abs() < 4.0 * 0.0022, "{mean} {level}");
        assert!(inner.iter().all(|d| (d / level - 1.0).abs() < 5.0 * 0.027));
        assert!((psd.density[256] / level - 0.5).abs() < 0.1, "half the rate has one side");
    }

    /// Parseval for one segment: the integral of the density is the power of the windowed samples over the power of the
    /// window.
    #[test]
    fn power_is_kept() {
        for segment in [8, 9, 500, 1021] {
            let values = white(segment, 9);
            let psd = welch(&values, 50.0, segment).unwrap();
            let integral = psd.density.iter().sum::<f64>() * 50.0 / segment as f64;
            let mean = values.iter().sum::<f64>() / segment as f64;
            let (mut power, mut window_power) = (0.0, 0.0);
            for (i, v) in values.iter().enumerate() {
                let w = (std::f64::consts::PI * i as f64 / segment as f64).sin().powi(2);
                power += (w * (v - mean)).powi(2);
                window_power += w * w;
            }
            assert!((integral / (power / window_power) - 1.0).abs() < 1e-12, "{segment}: {integral}");
        }
    }

    /// White noise behind a first-order low-pass at a tenth of the rate, with a line. The plateau gives the level at
    /// low frequencies, with an interval that holds it. A spike of 3000 standard deviations, which makes N 20 times as
    /// large in any mean, raises the median only a little.
    #[test]
    fn the_plateau_lies_below_the_low_pass() {
        let (rate_hz, a) = (100.0, (-std::f64::consts::TAU * 0.1_f64).exp());
        let (mut covered, records) = (0, 200);
        for seed in 0..records {
            let mut state = 0.0;
            let mut values: Vec<f64> = white(20_000, 1000 + seed)
                .iter()
                .enumerate()
                .map(|(i, v)| {
                    state = a * state + (1.0 - a) * v;
                    state + 0.2 * (std::f64::consts::TAU * 0.31 * i as f64).sin()
                })
                .collect();
            let of = |values: &[f64]| RobustSpectrum::of(values, rate_hz).unwrap().without_lines().plateau().unwrap();
            let (plateau, n) = (of(&values), of(&values).n());
            values[7000] += 3000.0;
            assert!((of(&values).n().value / n.value - 1.0).abs() < 0.15, "{seed}");
            // Samples of unit deviation, and a low-pass that has a gain of 1 at low frequencies.
            covered += usize::from((n.low..=n.high).contains(&0.1));
            assert!((n.value / 0.1 - 1.0).abs() < 0.2 && plateau.to_hz < 10.0, "{seed}: {plateau:?}");
        }
        println!("covered {covered} of {records}");
        // 68.3 % of 200 are 137, 3.9 standard errors 25.7.
        assert!((111..=162).contains(&covered), "{covered}");
    }

    /// Without its upper octave a level part from bin 2 to 8 or 10 has two or three groups. A line with a bend goes
    /// through these, however they scatter, so the whole part counts. From bin 12 on the octave is left out.
    #[test]
    fn a_plateau_has_more_groups_than_terms() {
        for (end, to_hz) in [(8, 7.0), (10, 9.0), (12, 5.0)] {
            // The bins behind it are not level anywhere.
            let density = (0..33).map(|k| if k < end { 3.0 } else { [100.0, 3000.0][k / 2 % 2] }).collect();
            let spectrum = RobustSpectrum { step_hz: 1.0, density, relative_sd: 0.1 };
            let plateau = spectrum.plateau().unwrap();
            assert_eq!((plateau.from_hz, plateau.to_hz), (2.0, to_hz), "{end}");
            assert!((plateau.density / 3.0 - 1.0).abs() < 1e-12, "{end}");
            if end == 8 {
                // Six bins at squares of 4, 9, 16, 25, 36 and 49: least squares of a line give its beginning with a
                // variance of 4675 / (6 * 4675 - 139^2). Bins 2 and 3 alone would give it with 97 / 25.
                assert!((plateau.relative_sd - 0.1 * (4675.0_f64 / 8729.0).sqrt()).abs() < 1e-12);
            }
        }
    }

    /// White noise of a level of 3 beside flicker: this fit gives the true level. The fit without a rise takes the mean
    /// of the flicker for white noise. Where the density falls towards low frequencies there is no rise.
    #[test]
    fn the_plateau_above_a_flicker_is_the_white_level() {
        let with = |rise: f64, len: usize| {
            let density = (0..len).map(|k| 3.0 * (1.0 + rise / (k as f64).max(1.0))).collect();
            RobustSpectrum { step_hz: 0.5, density, relative_sd: 0.1 }
        };
        for rise in [0.05, 0.2, 0.4] {
            // The ratio of both fits' standard deviations without flicker, from their matrices in numpy.
            for (len, wider) in [(17, 4.06), (65, 1.90), (257, 1.31)] {
                let spectrum = with(rise, len);
                let (level, clear) = (spectrum.plateau().unwrap(), spectrum.plateau_above_flicker().unwrap());
                assert_eq!((clear.from_hz, clear.to_hz), (level.from_hz, level.to_hz));
                assert!((clear.density / 3.0 - 1.0).abs() < 1e-9, "{rise} {len}: {clear:?}");
                // Every bin of the part holds more flicker than the last bin.
                let last = 1.0 + rise * spectrum.step_hz / level.to_hz;
                assert!(level.density > 3.0 * last, "{rise} {len}: {level:?}");
                let ratio = clear.relative_sd / level.relative_sd;
                assert!(rise > 0.05 || (ratio / wider - 1.0).abs() < 0.03, "{len}: {ratio} {wider}");
            }
        }
        let falling = with(-0.1, 257);
        assert_eq!(falling.plateau_above_flicker().unwrap(), falling.plateau().unwrap());
        assert_eq!(with(1000.0, 257).plateau_above_flicker(), None);
    }

    #[test]
    fn a_slope_has_no_plateau() {
        let walk: Vec<f64> = white(20_000, 3)
            .iter()
            .scan(0.0, |sum, v| {
                *sum += v;
                Some(*sum)
            })
            .collect();
        assert_eq!(RobustSpectrum::of(&walk, 100.0).unwrap().plateau(), None);
        assert_eq!(RobustSpectrum::of(&walk[..500], 100.0), None);
    }

    #[test]
    fn refusals() {
        let check = |values: &[f64], rate_hz, segment, expected: &str| {
            assert_eq!(welch(values, rate_hz, segment).unwrap_err().to_string(), expected);
        };
        check(&[1.0, f64::NAN, 2.0], 1.0, 8, "record: sample 1 is NaN");
        check(&white(7, 1), 1.0, 8, "one segment: 7 samples, needs at least 8");
        check(&white(9, 1), 1.0, 7, "segment is 7, expected at least 8 samples");
        check(&white(9, 1), 0.0, 8, "rate (Hz) is 0, expected a finite number above 0");
        check(&[2.0; 9], 1.0, 8, "record: all 9 samples are 2");
    }
}
