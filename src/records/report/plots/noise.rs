//! Allan deviations with their intervals and slopes; power spectra with their lines.

use std::collections::BTreeMap;

use gnc_analysis::details::performance::{AllanCurve, CURVES, CoefficientDetails, SPECTRA};
use gnc_plot::{Mark, Panel, Series};
use serde_json::Value;

use super::{AXES, thinned};

/// Flat part of a deviation over the bias instability: sqrt(2 ln 2 / pi).
const FLAT: f64 = 0.664;

pub(super) fn deviations(details: &Value) -> Option<Vec<Panel>> {
    let curves = CURVES.of(details)?;
    Some(of_triads(&curves, |curves| {
        let series = curves.iter().flat_map(|(hue, axis, curve)| {
            let points = curve.points.iter().map(|point| (point.tau_s, point.dev));
            let bars = curve.points.iter().map(|point| (point.low, point.high)).collect();
            [Series::new(*axis, Mark::Bars(bars), points).hue(*hue)].into_iter().chain(slopes(curve, *hue))
        });
        let unit = curves.first().map(|(_, _, curve)| curve.unit.clone()).unwrap_or_default();
        ("Allan deviation, 68.3 %; dashed: N, B, K", "averaging time, s", unit, series.collect())
    }))
}

/// The slopes of the Allan curve: `N/sqrt(tau)`, `0.664 B`, `K sqrt(tau/3)`, as far as the curve reaches.
fn slopes(curve: &AllanCurve, hue: usize) -> Vec<Series> {
    let (low, high) = curve.points.iter().fold((f64::MAX, 0.0_f64), |(l, h), p| (l.min(p.dev), h.max(p.dev)));
    let line = |coefficient: &Option<CoefficientDetails>, at: fn(f64, f64) -> f64| {
        let value = coefficient.as_ref()?.value;
        let points = curve.points.iter().map(|point| (point.tau_s, at(value, point.tau_s)));
        let near: Vec<(f64, f64)> = points.filter(|(_, dev)| (0.5 * low..=2.0 * high).contains(dev)).collect();
        Some(Series::dashed("", near).hue(hue))
    };
    let lines = [
        line(&curve.n, |n, tau_s| n / tau_s.sqrt()),
        line(&curve.b, |b, _| FLAT * b),
        line(&curve.k, |k, tau_s| k * (tau_s / 3.0).sqrt()),
    ];
    lines.into_iter().flatten().collect()
}

pub(super) fn spectra(details: &Value) -> Option<Vec<Panel>> {
    let spectra = SPECTRA.of(details)?;
    Some(of_triads(&spectra, |spectra| {
        let series = spectra.iter().flat_map(|(hue, axis, spectrum)| {
            let step_hz = spectrum.frequency_step_hz.unwrap_or(f64::NAN);
            let points: Vec<(f64, f64)> = spectrum
                .density
                .iter()
                .enumerate()
                // Leave out the first value, the rest of the mean, and the last value, which has no mirror image.
                .take(spectrum.density.len().saturating_sub(1))
                .skip(1)
                .map(|(k, density)| (k as f64 * step_hz, *density))
                .collect();
            let ends =
                points.first().into_iter().chain(points.last()).filter_map(|(hz, _)| Some((*hz, spectrum.white?)));
            let near = |point: &&(f64, f64)| (point.0 - spectrum.strongest_line.frequency_hz).abs();
            let line = points.iter().min_by(|a, b| near(a).total_cmp(&near(b))).copied();
            [
                Series::line(*axis, thinned(&points, f64::log10)).hue(*hue),
                Series::dashed("", ends.collect::<Vec<_>>()).hue(*hue),
                Series::dots("", line).hue(*hue),
            ]
        });
        let unit = spectra.first().map(|(_, _, spectrum)| spectrum.unit.clone()).unwrap_or_default();
        ("Spectrum; dashed: white level, dot: strongest line", "Hz", unit, series.collect())
    }))
}

/// The parts of a panel: title, axis, unit, curves.
type Parts = (&'static str, &'static str, String, Vec<Series>);

/// One panel for the gyroscopes and one for the accelerometers, from channels named `gyro_x` and so on.
fn of_triads<T>(channels: &BTreeMap<String, T>, draw: impl Fn(&[(usize, &'static str, &T)]) -> Parts) -> Vec<Panel> {
    let triad = |(key, name): (&str, &str)| {
        let found: Vec<(usize, &'static str, &T)> = AXES
            .iter()
            .enumerate()
            .filter_map(|(hue, axis)| Some((hue, *axis, channels.get(&format!("{key}_{axis}"))?)))
            .collect();
        if found.is_empty() {
            return None;
        }
        let (title, x, unit, series) = draw(&found);
        Some(Panel::new(format!("{name}: {title}"), x, unit, series).log())
    };
    [("gyro", "Gyroscopes"), ("accel", "Accelerometers")].into_iter().filter_map(triad).collect()
}
