//! A record of each method, its figures and their truth.

use std::ops::Range;

use gnc_metrology::allan::{DeviationKind as Deviation, Input, Taus};
use gnc_metrology::gate::{RecordLayout, RowMeaning, Screening, one_stretch};
use gnc_metrology::position::{LABELS, Limits, from_labels, up_of};
use gnc_metrology::{AXES, allan, earth, ellipse, ellipsoid, gyro_still, psd, rotation, six_position, stability, tilt};
use nalgebra::{Matrix3, Vector3};

use super::{Dice, Method, Spoil};

pub const METHODS: [Method; 9] = [
    Method { name: "six-position", probability: 0.95, trial: six_positions },
    Method { name: "gyro-still", probability: 0.95, trial: still_gyroscopes },
    Method { name: "rotation", probability: 0.95, trial: rotations },
    Method { name: "flip", probability: 0.95, trial: flip },
    Method { name: "ellipse", probability: 0.95, trial: ellipses },
    Method { name: "ellipsoid", probability: 0.95, trial: ellipsoids },
    Method { name: "allan", probability: 0.683, trial: deviations },
    Method { name: "psd", probability: 0.95, trial: densities },
    Method { name: "stability", probability: 0.95, trial: block_means },
];

fn slices(channels: &[Vec<f64>]) -> Vec<&[f64]> {
    channels.iter().map(Vec::as_slice).collect()
}

/// The rows of a record that are left for a mean or a fit to points.
fn kept(channels: &mut [Vec<f64>], blocks: &[Range<usize>], still: bool) -> Option<Screening> {
    let layout = RecordLayout { blocks, still, range_end: None };
    let found = Screening::of(&AXES[..channels.len()], &slices(channels), &layout);
    found.admit(RowMeaning::Samples).ok()?;
    for values in channels {
        *values = found.kept(values);
    }
    Some(found)
}

const ROWS: usize = 400;

fn positions() -> Vec<Range<usize>> {
    (0..6).map(|position| position * ROWS..(position + 1) * ROWS).collect()
}

/// Rows of six positions from their means, in codes.
fn labelled(means: &[Vector3<f64>], noise: f64, dice: &mut Dice) -> [Vec<f64>; 3] {
    [0, 1, 2].map(|axis| {
        means
            .iter()
            .flat_map(|mean| vec![mean[axis]; ROWS])
            .map(|mean| (mean + noise * dice.normal()).round())
            .collect()
    })
}

fn labels(found: &Screening) -> Vec<&'static str> {
    found.kept(&(0..6 * ROWS).map(|row| LABELS[row / ROWS]).collect::<Vec<_>>())
}

fn within<'a>(
    found: impl IntoIterator<Item = &'a f64>,
    truth: impl IntoIterator<Item = &'a f64>,
    expanded: impl IntoIterator<Item = &'a f64>,
) -> Vec<bool> {
    found.into_iter().zip(truth).zip(expanded).map(|((found, truth), u)| (found - truth).abs() <= *u).collect()
}

fn six_positions(spoil: Spoil, dice: &mut Dice) -> Option<Vec<bool>> {
    let gravity = 9.7967;
    let response = Matrix3::new(816.0, 1.2, -0.7, -2.0, 820.0, 1.5, 0.9, -0.5, 809.0);
    let offset = Vector3::new(15.0, -9.0, 4.0);
    let means: Vec<Vector3<f64>> =
        LABELS.iter().filter_map(|label| up_of(label)).map(|up| response * (gravity * up) + offset).collect();
    let mut channels = labelled(&means, 3.0, dice);
    spoil.apply(&mut channels, 3.0, dice);
    let found = kept(&mut channels, &positions(), true)?;
    let [x, y, z] = &channels;
    let averaged = from_labels(&labels(&found), [x, y, z], &Limits::ACCELEROMETER).ok()?;
    let c = six_position::calibrate(&averaged, gravity).ok()?;
    let matrix = response.try_inverse()?;
    let bias = matrix * offset;
    let (matrix_u, bias_u) = c.expanded();
    let mut covers = within(c.matrix.iter(), matrix.iter(), matrix_u.iter());
    covers.extend(within(c.bias_mps2().iter(), bias.iter(), bias_u.iter()));
    Some(covers)
}

fn still_gyroscopes(spoil: Spoil, dice: &mut Dice) -> Option<Vec<bool>> {
    let (gravity, latitude): (f64, f64) = (9.7967, 34.0);
    // Codes for one rad/s, and a level of some codes, so that zeros lie within the noise.
    let lsb = 1.145_915_6e6;
    let bias = Vector3::new(1e-3, -2e-3, 5e-6);
    let sensitivity = Matrix3::new(4.0, 1.0, -2.0, 0.5, -3.0, 1.5, 1.0, 2.0, 5.0) * 1e-6;
    let ups: Vec<Vector3<f64>> = LABELS.iter().filter_map(|label| up_of(label)).collect();
    let norths: Vec<Vector3<f64>> = ups.iter().map(|up| Vector3::new(up[1], up[2], up[0])).collect();
    let vertical = earth::EARTH_RATE_RPS * latitude.to_radians().sin();
    let horizontal = earth::EARTH_RATE_RPS * latitude.to_radians().cos();
    let means: Vec<Vector3<f64>> = ups
        .iter()
        .zip(&norths)
        .map(|(up, north)| (sensitivity * (gravity * up) + bias + vertical * up + horizontal * north) * lsb)
        .collect();
    let mut channels = labelled(&means, 700.0, dice);
    spoil.apply(&mut channels, 700.0, dice);
    let found = kept(&mut channels, &positions(), true)?;
    let [x, y, z] = channels.map(|values| values.iter().map(|code| code / lsb).collect::<Vec<f64>>());
    let averaged = from_labels(&labels(&found), [&x, &y, &z], &Limits::GYROSCOPE).ok()?;
    let c = gyro_still::calibrate(&averaged, gravity, latitude, Some(&norths)).ok()?;
    let (bias_u, sensitivity_u) = c.expanded();
    let mut covers = within(c.g_sensitivity.iter(), sensitivity.iter(), sensitivity_u.iter());
    covers.extend(within(c.bias_rps.iter(), bias.iter(), bias_u.iter()));
    Some(covers)
}

/// Three turns at 100 Hz, polar axis; a sample is the mean rate of its interval.
fn rotations(spoil: Spoil, dice: &mut Dice) -> Option<Vec<bool>> {
    const RATE_HZ: f64 = 100.0;
    const TURNS: f64 = 3.0;
    let [before, ramp, plateau, after] = [1.5, 0.5, 4.5, 3.0];
    let response = Matrix3::new(2000.0, 12.0, -7.0, -20.0, 3000.0, 15.0, 9.0, -5.0, 2500.0);
    let (offset, noise) = (Vector3::new(12.0, -8.0, 5.0), response.diagonal() * 1e-3);
    let peak = std::f64::consts::TAU * TURNS / (ramp + plateau);
    let turned = |t: f64| {
        let t = (t - before).clamp(0.0, 2.0 * ramp + plateau);
        let (up, down) = (t.min(ramp), (t - ramp - plateau).max(0.0));
        peak * (up * up / (2.0 * ramp) + (t - up - down).max(0.0) + down - down * down / (2.0 * ramp))
    };
    let rows = ((before + 2.0 * ramp + plateau + after) * RATE_HZ).round() as usize;
    let mut data: Vec<[Vec<f64>; 3]> = Vec::new();
    for run in 0..6 {
        let mut channels = [Vec::new(), Vec::new(), Vec::new()];
        for k in 0..rows {
            let (t0, t1) = (k as f64 / RATE_HZ, (k + 1) as f64 / RATE_HZ);
            let mut rate = Vector3::zeros();
            rate[run / 2] =
                if run % 2 == 0 { 1.0 } else { -1.0 } * (turned(t1) - turned(t0)) * RATE_HZ + earth::EARTH_RATE_RPS;
            let output = response * rate + offset;
            for (axis, values) in channels.iter_mut().enumerate() {
                values.push((output[axis] + noise[axis] * dice.normal()).round());
            }
        }
        spoil.apply(&mut channels, noise[1], dice);
        let blocks = one_stretch(rows);
        let layout = RecordLayout { blocks: &blocks, still: false, range_end: None };
        let found = Screening::of(&AXES, &slices(&channels), &layout);
        found.admit(RowMeaning::ClockedSteps).ok()?;
        let [x, y, z] = channels.map(|values| found.bridged("", &values, &blocks).ok());
        data.push([x?, y?, z?]);
    }
    let runs: Vec<rotation::RotationRun<'_>> = LABELS
        .iter()
        .zip(&data)
        .map(|(label, [x, y, z])| rotation::RotationRun { label: (*label).to_owned(), channels: [x, y, z] })
        .collect();
    let options = rotation::RotationOptions {
        rate_hz: RATE_HZ,
        turns: TURNS,
        axis: rotation::RotationAxis::Polar,
        saturation: None,
        nominal: None,
    };
    let c = rotation::calibrate(&runs, &options).ok()?;
    let (response_u, bias_u) = c.expanded();
    let bias = response.try_inverse()? * offset;
    let mut covers = within(c.response.iter(), response.iter(), response_u.iter());
    covers.extend(within(c.bias_rps().iter(), bias.iter(), bias_u.iter()));
    Some(covers)
}

fn flip(spoil: Spoil, dice: &mut Dice) -> Option<Vec<bool>> {
    let (offset, gain, noise) = (0.02, 1.003, 0.001);
    // Values in ten-thousandths, as a logger prints them.
    let mut rows =
        |level: f64| -> Vec<f64> { (0..ROWS).map(|_| ((level + noise * dice.normal()) * 1e4).round() / 1e4).collect() };
    let mut channels = [[rows(offset + gain), rows(offset - gain)].concat()];
    // Spikes are whole codes.
    channels[0].iter_mut().for_each(|value| *value *= 1e4);
    spoil.apply(&mut channels, noise * 1e4, dice);
    channels[0].iter_mut().for_each(|value| *value /= 1e4);
    let blocks = [0..ROWS, ROWS..2 * ROWS];
    let found = kept(&mut channels, &blocks, true)?;
    let labels = found.kept(&(0..2 * ROWS).map(|row| if row < ROWS { "+" } else { "-" }).collect::<Vec<_>>());
    let f = tilt::flip_rows(&labels, &channels[0], 1.0).ok()?;
    Some(within([&f.offset, &f.gain], [&offset, &gain], [&(1.96 * f.offset_sd), &(1.96 * f.gain_sd)]))
}

fn ellipses(spoil: Spoil, dice: &mut Dice) -> Option<Vec<bool>> {
    let (centre, radius, ratio, noise) = ([30.0, -50.0], 1000.0, 0.8, 10.0);
    let mut channels = [Vec::new(), Vec::new()];
    for k in 0..2000 {
        let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 67.3).sin_cos();
        channels[0].push((centre[0] + radius * cos + noise * dice.normal()).round());
        channels[1].push((centre[1] + ratio * radius * sin + noise * dice.normal()).round());
    }
    spoil.apply(&mut channels, noise, dice);
    let blocks = one_stretch(channels[0].len());
    kept(&mut channels, &blocks, false)?;
    let e = ellipse::fit(&channels[0], &channels[1], None).ok()?;
    let k = 1.96;
    let found = [e.centre[0], e.centre[1], e.semi_axes[0], e.semi_axes[1]];
    let expanded = [e.sd.centre[0], e.sd.centre[1], e.sd.semi_axes[0], e.sd.semi_axes[1]].map(|sd| k * sd);
    Some(within(&found, &[centre[0], centre[1], radius, ratio * radius], &expanded))
}

fn ellipsoids(spoil: Spoil, dice: &mut Dice) -> Option<Vec<bool>> {
    let (centre, radius, noise) = (Vector3::new(120.0, -80.0, 45.0), 1000.0, 8.0);
    let mut channels = [Vec::new(), Vec::new(), Vec::new()];
    // A path that winds over the sphere, as from a module turned by hand.
    for k in 0..3000 {
        let (height, angle) = (1.0 - 2.0 * (f64::from(k) + 0.5) / 3000.0, f64::from(k) * 0.11);
        let across = (1.0 - height * height).sqrt();
        let direction = Vector3::new(across * angle.cos(), across * angle.sin(), height);
        for (axis, values) in channels.iter_mut().enumerate() {
            values.push((centre[axis] + radius * direction[axis] + noise * dice.normal()).round());
        }
    }
    spoil.apply(&mut channels, noise, dice);
    let blocks = one_stretch(channels[0].len());
    kept(&mut channels, &blocks, false)?;
    let e = ellipsoid::fit(&channels[0], &channels[1], &channels[2], None, None).ok()?;
    let expanded = e.centre_sd * 1.96;
    Some(within(e.centre.iter(), centre.iter(), expanded.iter()))
}

const SERIES: usize = 20_000;
const SIGMA: f64 = 30.0;

/// White noise about 3 codes, mended.
fn series(spoil: Spoil, dice: &mut Dice) -> Option<Vec<f64>> {
    let mut channels = [(0..SERIES).map(|_| (3.0 + SIGMA * dice.normal()).round()).collect::<Vec<f64>>()];
    spoil.apply(&mut channels, SIGMA, dice);
    let blocks = one_stretch(SERIES);
    let layout = RecordLayout { blocks: &blocks, still: true, range_end: None };
    let found = Screening::of(&["w"], &slices(&channels), &layout);
    found.admit(RowMeaning::ClockedSteps).ok()?;
    Some(found.refilled(&channels[0], &blocks))
}

/// Variance of a rounded normal value.
fn variance() -> f64 {
    SIGMA * SIGMA + 1.0 / 12.0
}

fn deviations(spoil: Spoil, dice: &mut Dice) -> Option<Vec<bool>> {
    let values = series(spoil, dice)?;
    let analysis = allan::analyse(&values, Input::Rate, 1.0, Deviation::Oadev, &Taus::Octave, 1).ok()?;
    let truth = |tau_s: f64| (variance() / tau_s).sqrt();
    Some(analysis.points.iter().take(6).map(|p| (p.low..=p.high).contains(&truth(p.tau_s))).collect())
}

fn densities(spoil: Spoil, dice: &mut Dice) -> Option<Vec<bool>> {
    let values = series(spoil, dice)?;
    let psd = psd::welch(&values, 1.0, 256).ok()?;
    // The ends are left out, since they hold the mean and half a width.
    let inner = &psd.density[3..psd.density.len() - 3];
    // Halves of the band. Low-passed replacements would show in the upper half.
    let (low, high) = inner.split_at(inner.len() / 2);
    let covers = |band: &[f64]| {
        let mean = band.iter().sum::<f64>() / band.len() as f64;
        // Hann and half overlap leave 36/19 of the 2 / n of the segments' periodograms (Welch 1967), and neighbouring
        // frequencies share 1 + 2 (4/9) + 2 (1/36) of their variance.
        let averages = psd.segments as f64 * 19.0 / 36.0 * 2.0 / 2.0;
        let frequencies = band.len() as f64 / (1.0 + 8.0 / 9.0 + 1.0 / 18.0);
        let sd = mean * (1.0 / (averages * frequencies) * (1.0 + 1.0 / 18.0)).sqrt();
        (mean - 2.0 * variance()).abs() <= 1.96 * sd
    };
    Some(vec![covers(low), covers(high)])
}

fn block_means(spoil: Spoil, dice: &mut Dice) -> Option<Vec<bool>> {
    let values = series(spoil, dice)?;
    let s = stability::stability(&values, 1.0, 100.0).ok()?;
    let truth = (variance() / 100.0).sqrt();
    Some(vec![(s.sd_low..=s.sd_high).contains(&truth)])
}
