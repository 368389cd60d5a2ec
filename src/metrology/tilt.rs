//! Tilt from an accelerometer, and its accuracy.
//!
//! After A. Fan, *How to Improve the Accuracy of Inclination Measurement Using an Accelerometer* (Analog Dialogue 52-02,
//! 2018). `theta = asin(A / g)`. Accelerations are in g unless a name says otherwise.
//!
//! Departures from the print: its gain of the 1 g flip is halved once too often (a perfect sensor would have 0.5). Its
//! "97 %" within six sigma is Chebyshev's bound; normal noise is outside with a probability of 2e-9.

use statrs::function::erf::erfc;

use crate::{
    Refusal, correlated,
    position::{self, Limits},
    quantisation, series, stats,
};

/// Offset and gain of a sensor: `out = offset + gain * actual`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlipCalibration {
    /// Offset, in the unit of the record: the bias as an output, measured less true.
    pub offset: f64,
    /// Gain, unit of the record per unit of gravity; ideally 1.
    pub gain: f64,
    /// Standard uncertainty of the offset.
    pub offset_sd: f64,
    /// Standard uncertainty of the gain.
    pub gain_sd: f64,
}

impl FlipCalibration {
    /// Returns the bias, measured less true, in the unit of gravity: `offset / gain`.
    #[must_use]
    pub fn bias(&self) -> f64 {
        self.offset / self.gain
    }

    /// Returns the actual value, `(out - offset) / gain`.
    #[must_use]
    pub fn actual(&self, out: f64) -> f64 {
        (out - self.offset) / self.gain
    }
}

/// Two-point calibration by a flip between +1 g and -1 g: `offset = (A+ + A-) / 2`, `gain = (A+ - A-) / (2 g)`. `plus`
/// and `minus` are a mean and its standard uncertainty each; `gravity` is in the unit of the actual values.
///
/// # Errors
/// [`Refusal::NotFinite`]; [`Refusal::Parameter`]; [`Refusal::WrongSign`] when the flip is upside down.
pub fn flip(plus: (f64, f64), minus: (f64, f64), gravity: f64) -> Result<FlipCalibration, Refusal> {
    series::positive("gravity", gravity)?;
    series::finite("flip", &[plus.0, minus.0])?;
    let gain = (plus.0 - minus.0) / (2.0 * gravity);
    if gain <= 0.0 {
        return Err(Refusal::WrongSign { axis: "of the flip", response: gain });
    }
    let spread = plus.1.hypot(minus.1) / 2.0;
    Ok(FlipCalibration { offset: f64::midpoint(plus.0, minus.0), gain, offset_sd: spread, gain_sd: spread / gravity })
}

/// Runs [`flip`] on the rows of a record, labelled `+` (the axis up) and `-`, each in one block.
///
/// # Errors
/// [`Refusal::Lengths`], [`Refusal::NotFinite`], [`Refusal::TooFew`] below two rows of a position;
/// [`Refusal::UnknownLabel`], [`Refusal::Missing`], [`Refusal::SplitLabel`]; [`Refusal::Moved`] for a position that moves
/// by more than 2 mrad and its noise; otherwise as [`flip`].
pub fn flip_rows<L: AsRef<str>>(labels: &[L], values: &[f64], gravity: f64) -> Result<FlipCalibration, Refusal> {
    const LABELS: [&str; 2] = ["+", "-"];
    if labels.len() != values.len() {
        return Err(Refusal::Lengths { left: labels.len(), right: values.len() });
    }
    series::finite("a", values)?;
    if let Some(row) = labels.iter().position(|l| !LABELS.contains(&l.as_ref())) {
        return Err(Refusal::UnknownLabel { label: labels[row].as_ref().to_owned(), row: row + 1 });
    }
    let blocks = position::blocks(labels)?;
    let stretches: Vec<&[f64]> = blocks.iter().map(|block| &values[block.clone()]).collect();
    let resolution_sd = quantisation::mean_error_sd(&stretches);
    let slow = position::noise_of_means(stretches.iter().copied());
    let mut sides = [(0.0, 0.0); 2];
    for (side, label) in sides.iter_mut().zip(LABELS) {
        let Some(block) = blocks.iter().find(|b| labels[b.start].as_ref() == label) else {
            return Err(Refusal::Missing { labels: label.to_owned() });
        };
        let rows = &values[block.clone()];
        if rows.len() < 2 {
            return Err(Refusal::TooFew { what: format!("position {label}"), got: rows.len(), needed: 2 });
        }
        let (mean, sd) = stats::mean_sd(rows);
        // Behind a low-pass neighbouring rows have nearly the same error. With too few rows for a correlation, the rows
        // count as white.
        let white = sd / (rows.len() as f64).sqrt();
        *side = (mean, correlated::mean(rows, None).map_or(white, |mean| mean.mean_sd.max(white)));
    }
    let mut found = flip(sides[0], sides[1], gravity)?;
    // The steps give one error for each side. Where both sides have the same error, it is an error of the offset.
    found.offset_sd = found.offset_sd.hypot(resolution_sd);
    found.gain_sd = found.gain_sd.hypot(resolution_sd / gravity);
    for block in &blocks {
        let rows = &values[block.clone()];
        let wander = position::wander(rows, found.gain * gravity, slow, &Limits::ACCELEROMETER);
        if let Some((spread, noise, limit)) = wander {
            let position = labels[block.start].as_ref().to_owned();
            return Err(Refusal::Moved { position, channel: "a", spread, noise, limit });
        }
    }
    Ok(found)
}

/// Offset over temperature, `a t^2 + b t + c`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TemperatureCurve {
    /// Unit of the offset per K^2.
    pub a: f64,
    /// Unit of the offset per K.
    pub b: f64,
    /// Offset at 0 degC.
    pub c: f64,
    /// First step of the print: the offset at ambient temperature.
    pub ambient_offset: f64,
    /// Second step: slope of the line through ambient and hot.
    pub slope: f64,
    /// Third step: the offset that then remains at cold.
    pub cold_remainder: f64,
    /// Temperatures of the three points, rising, degC.
    pub temperatures_c: [f64; 3],
}

/// Runs [`temperature_curve`] on a table.
///
/// # Errors
/// As [`temperature_curve`]; [`Refusal::Lengths`]; [`Refusal::Parameter`] when the number of points is not three.
pub fn temperature_rows(temperatures_c: &[f64], offsets: &[f64]) -> Result<TemperatureCurve, Refusal> {
    series::channels(&["temperature", "offset"], &[temperatures_c, offsets])?;
    let ([cold, ambient, hot], [a, b, c]) = (temperatures_c, offsets) else {
        let value = temperatures_c.len() as f64;
        return Err(Refusal::Parameter { name: "number of points", value, expected: "3: cold, ambient and hot" });
    };
    temperature_curve([(*cold, *a), (*ambient, *b), (*hot, *c)])
}

/// Three-point calibration of the offset over temperature: cold, ambient (25 +- 5 degC) and hot. The print's three steps
/// (offset at ambient, line to hot, parabola through the rest at cold) amount to interpolating the points.
///
/// # Errors
/// [`Refusal::NotFinite`]; [`Refusal::Parameter`] when the ambient point is not within 25 +- 5 degC;
/// [`Refusal::IllConditioned`] when temperatures are closer than 5 K.
pub fn temperature_curve(points: [(f64, f64); 3]) -> Result<TemperatureCurve, Refusal> {
    for (t, offset) in points {
        series::finite("temperature and offset", &[t, offset])?;
    }
    let mut points = points;
    points.sort_by(|p, q| p.0.total_cmp(&q.0));
    let [(cold, at_cold), (ambient, at_ambient), (hot, at_hot)] = points;
    let closest = (ambient - cold).min(hot - ambient);
    if closest < 5.0 {
        let condition = (hot - cold) / closest;
        return Err(Refusal::IllConditioned {
            what: "the curve over temperature",
            condition,
            limit: (hot - cold) / 5.0,
        });
    }
    if !(20.0..=30.0).contains(&ambient) {
        return Err(Refusal::Parameter { name: "ambient temperature (degC)", value: ambient, expected: "25 +- 5" });
    }
    let slope = (at_hot - at_ambient) / (hot - ambient);
    let cold_remainder = at_cold - at_ambient - slope * (cold - ambient);
    let a = cold_remainder / ((cold - ambient) * (cold - hot));
    let b = slope - a * (ambient + hot);
    let c = at_ambient - slope * ambient + a * ambient * hot;
    Ok(TemperatureCurve {
        a,
        b,
        c,
        ambient_offset: at_ambient,
        slope,
        cold_remainder,
        temperatures_c: [cold, ambient, hot],
    })
}

impl TemperatureCurve {
    /// Offset at a temperature, degC.
    #[must_use]
    pub fn offset(&self, t: f64) -> f64 {
        // The polynomial is taken about the ambient point, so that it keeps its digits.
        let [_, ambient, hot] = self.temperatures_c;
        self.ambient_offset + self.slope * (t - ambient) + self.a * (t - ambient) * (t - hot)
    }

    /// Returns the uncertainty of the curve at a temperature over that of a point, when the three points are equally
    /// uncertain. It grows fast outside the points.
    #[must_use]
    pub fn uncertainty_factor(&self, t: f64) -> f64 {
        let p = self.temperatures_c;
        (0..3)
            .map(|i| (0..3).filter(|j| *j != i).map(|j| (t - p[j]) / (p[i] - p[j])).product::<f64>().powi(2))
            .sum::<f64>()
            .sqrt()
    }
}

/// Largest departure of a measured acceleration from the straight line through the data (least squares), over the
/// range in use (for +-30 degrees: +-0.5 g).
///
/// # Errors
/// [`Refusal::Lengths`], [`Refusal::NotFinite`]; [`Refusal::TooFew`] below three points in the range.
pub fn nonlinearity(actual: &[f64], measured: &[f64], range: f64) -> Result<f64, Refusal> {
    series::channels(&["actual", "measured"], &[actual, measured])?;
    let used: Vec<(f64, f64)> =
        actual.iter().copied().zip(measured.iter().copied()).filter(|(a, _)| a.abs() <= range).collect();
    if used.len() < 3 {
        return Err(Refusal::TooFew { what: "nonlinearity".to_owned(), got: used.len(), needed: 3 });
    }
    let n = used.len() as f64;
    let (mx, my) = used.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let (xx, xy) = used.iter().fold((0.0, 0.0), |(xx, xy), p| (xx + (p.0 - mx).powi(2), xy + (p.0 - mx) * (p.1 - my)));
    Ok(used.iter().map(|p| (p.1 - my - xy / xx * (p.0 - mx)).abs()).fold(0.0, f64::max))
}

/// Peak of averaged white noise: `factor * rms / sqrt(samples)`.
#[must_use]
pub fn averaged_peak(rms: f64, samples: f64, factor: f64) -> f64 {
    factor * rms / samples.sqrt()
}

/// Expected number of values outside `factor` standard deviations of normal noise in a life of `runs` values.
#[must_use]
pub fn exceedances(runs: f64, factor: f64) -> f64 {
    runs * erfc(factor / std::f64::consts::SQRT_2)
}

/// One line of a budget, mg.
#[derive(Debug, Clone, PartialEq)]
pub struct TiltContribution {
    /// Name of the contribution.
    pub name: String,
    /// Before calibration, mg.
    pub before_mg: f64,
    /// After calibration, mg.
    pub after_mg: f64,
}

/// Sum of a budget, and the tilt error that follows from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Total {
    /// Linear sum of the magnitudes (worst case), mg.
    pub sum_mg: f64,
    /// Root of the sum of squares, mg: the sum of independent contributions.
    pub rss_mg: f64,
    /// Tilt error of the linear sum at 0 deg.
    pub tilt_at_zero_deg: f64,
    /// Largest tilt error of the linear sum over the range, which lies at the ends of the range.
    pub tilt_at_range_deg: f64,
}

/// Largest error of `asin(A / g)` at a tilt, for an error of the acceleration in mg, of either sign. Tilt ends at 90
/// degrees, so the error is counted up to there.
#[must_use]
pub fn tilt_error_deg(tilt_deg: f64, error_mg: f64) -> f64 {
    let sine = tilt_deg.to_radians().sin();
    let at = |error: f64| ((sine + error / 1000.0).clamp(-1.0, 1.0).asin().to_degrees() - tilt_deg).abs();
    at(error_mg).max(at(-error_mg))
}

/// Adds up a budget before and after calibration, over +-`range_deg` of tilt.
///
/// # Errors
/// [`Refusal::TooFew`] without a contribution, [`Refusal::Parameter`] for a range outside 0 to 89 deg or a contribution
/// that is negative or NaN.
pub fn budget(contributions: &[TiltContribution], range_deg: f64) -> Result<(Total, Total), Refusal> {
    if contributions.is_empty() {
        return Err(Refusal::TooFew { what: "a budget".to_owned(), got: 0, needed: 1 });
    }
    if !(0.0..=89.0).contains(&range_deg) {
        return Err(Refusal::Parameter { name: "range (deg)", value: range_deg, expected: "0 to 89" });
    }
    let total = |mg: &dyn Fn(&TiltContribution) -> f64| -> Result<Total, Refusal> {
        let values: Vec<f64> = contributions.iter().map(mg).collect();
        if let Some(value) = values.iter().copied().find(|v| !(v.is_finite() && *v >= 0.0)) {
            return Err(Refusal::Parameter { name: "contribution (mg)", value, expected: "a magnitude, 0 or more" });
        }
        let sum_mg = values.iter().sum();
        Ok(Total {
            sum_mg,
            rss_mg: values.iter().map(|v| v * v).sum::<f64>().sqrt(),
            tilt_at_zero_deg: tilt_error_deg(0.0, sum_mg),
            tilt_at_range_deg: tilt_error_deg(range_deg, sum_mg),
        })
    };
    Ok((total(&|c| c.before_mg)?, total(&|c| c.after_mg)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Table 1 of the article; over +-30 degrees it is worse than the article says.
    #[test]
    fn the_published_budget() {
        let lines = [
            ("sensitivity", 30.0, 0.0),
            ("offset", 15.0, 0.0),
            ("nonlinearity", 10.0, 10.0),
            ("drift", 50.0, 10.0),
            ("noise", 24.0, 2.4),
        ];
        let lines =
            lines.map(|(name, before_mg, after_mg)| TiltContribution { name: name.to_owned(), before_mg, after_mg });
        let (before, after) = budget(&lines, 30.0).unwrap();
        let rounded = |v: f64, unit: f64| (v / unit).round() * unit;
        assert_eq!((before.sum_mg, rounded(after.sum_mg, 0.1)), (129.0, rounded(22.4, 0.1)));
        assert!((before.tilt_at_zero_deg - 7.4).abs() < 0.05 && (after.tilt_at_zero_deg - 1.28).abs() < 0.005);
        assert!((before.tilt_at_range_deg - 8.98).abs() < 0.005 && (after.tilt_at_range_deg - 1.49).abs() < 0.005);
        assert!((averaged_peak(4.0, 100.0, 6.0) - 2.4).abs() < 1e-12);
        assert!((exceedances(1e9, 6.0) - 1.973).abs() < 0.001, "{}", exceedances(1e9, 6.0));
    }

    #[test]
    fn a_flip_finds_offset_and_gain() {
        let f = flip((1.035, 1e-3), (-0.985, 1e-3), 1.0).unwrap();
        assert!((f.offset - 0.025).abs() < 1e-12 && (f.gain - 1.01).abs() < 1e-12);
        assert!((f.actual(0.025 + 1.01 * 0.5) - 0.5).abs() < 1e-12);
        assert!((f.gain_sd - 1e-3 / 2.0_f64.sqrt()).abs() < 1e-12);
        assert!(flip((-1.0, 0.0), (1.0, 0.0), 1.0).is_err() && flip((f64::NAN, 0.0), (1.0, 0.0), 1.0).is_err());
    }

    #[test]
    fn a_flip_from_rows() {
        let rows = |moving: f64| -> Vec<f64> {
            (0..400)
                .map(|i| {
                    let noise = f64::from(i * 7919 % 101 - 50) * 1e-4;
                    if i < 200 { 1.035 + noise + moving * f64::from(i) } else { -0.985 + noise }
                })
                .collect()
        };
        let labels: Vec<&str> = (0..400).map(|i| if i < 200 { "+" } else { "-" }).collect();
        let f = flip_rows(&labels, &rows(0.0), 1.0).unwrap();
        assert!((f.offset - 0.025).abs() < 1e-3 && (f.gain - 1.01).abs() < 1e-3 && f.gain_sd < 3e-4, "{f:?}");
        let check = |labels: &[&str], values: &[f64], expected: &str| {
            let refusal = flip_rows(labels, values, 1.0).unwrap_err().to_string();
            assert!(refusal.contains(expected), "{refusal}");
        };
        check(&labels, &rows(1e-4), "position + moved");
        check(&labels[..200], &rows(0.0)[..200], "missing: -");
        check(&labels[..201], &rows(0.0)[..201], "position -: 1 samples, needs at least 2");
        check(&["+", "-", "+"], &[1.0, -1.0, 1.0], "`+` stands in two separated blocks");
        check(&["+", "up"], &[1.0, -1.0], "unknown label `up` in row 2");
        check(&["+", "-"], &[1.0, f64::NAN], "a: sample 1 is NaN");
    }

    #[test]
    fn a_parabola_through_three_temperatures() {
        let truth = |t: f64| 2e-3 * t * t - 0.3 * t + 7.0;
        let c = temperature_curve([(85.0, truth(85.0)), (-40.0, truth(-40.0)), (25.0, truth(25.0))]).unwrap();
        for t in [-40.0, 0.0, 25.0, 60.0, 85.0, 120.0] {
            assert!((c.offset(t) - truth(t)).abs() < 1e-10 && (c.a * t * t + c.b * t + c.c - truth(t)).abs() < 1e-10);
        }
        assert!((c.uncertainty_factor(25.0) - 1.0).abs() < 1e-12 && c.uncertainty_factor(120.0) > 2.0);
        let text = |r: Result<_, Refusal>| r.map(|_: TemperatureCurve| ()).unwrap_err().to_string();
        assert_eq!(
            text(temperature_rows(&[1.0; 4], &[1.0; 4])),
            "number of points is 4, expected 3: cold, ambient and hot"
        );
        assert!(temperature_curve([(85.0, 1.0), (-40.0, 1.0), (10.0, 1.0)]).is_err());
        assert!(temperature_curve([(25.0, 1.0), (-40.0, 1.0), (25.0, 1.0)]).is_err());
    }

    #[test]
    fn departure_from_a_line() {
        let actual = [-1.0, -0.5, 0.0, 0.5, 1.0];
        let measured = actual.map(|a: f64| 0.1 + 1.02 * a + 0.04 * a * a);
        // On 0.04 a^2 at -0.5, 0, 0.5 the line keeps the mean 2/3 * 0.01, so 0.0067 remains in the middle.
        assert!((nonlinearity(&actual, &measured, 0.5).unwrap() - 0.02 / 3.0).abs() < 1e-12);
        assert!(nonlinearity(&actual, &measured, 0.1).is_err());
    }
}
