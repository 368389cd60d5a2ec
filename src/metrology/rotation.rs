//! Calibration of a gyroscope triad from rotations by a known angle about each axis, in both directions.
//!
//! Data are six integrals per sensor, `I_r = sum(dT N)`, over windows that hold the whole rotation. Model of a sensor:
//! `I_r = S (theta_r e_j + earth) + b T_r`, solved by least squares. The windows of a pair are equally long, so that the
//! bias cancels in their difference (0.1 s of difference would be 10 ppm of scale).
//!
//! Departures from the print (Cheng et al., *Computer Measurement & Control* 30(7), 2022, section 4.2, equations 3 and
//! 4): its matrix has the other order of indices (its k is S transposed), the compensation needs `S^-1`, and its bias
//! `sum of four integrals / (8 pi n)` is not a rate. Here `w = Kg N - epsilon` with `Kg = S^-1` and `epsilon = Kg b`.

use nalgebra::{DMatrix, Matrix3, Matrix4, Vector3, Vector4};

use crate::{AXES, Refusal, TriadCovariance, earth, linear, position, quantisation, series, stats, triad};

/// The equations of the parameters.
pub const EQUATION: &str = "w = matrix N - epsilon, bias = matrix bias_lsb = epsilon (measured less true); w in rad/s";

/// Rest that a record must hold before and after the rotation, s.
pub const REST_S: f64 = 0.5;
/// Margin of a window beyond the rotation found, s: the first and last part of the ramps lie below the threshold.
const MARGIN_S: f64 = 0.25;
/// Length of the block means in which the rotation is searched for, s.
const BLOCK_S: f64 = 0.05;
/// A block moves when it deviates from rest by more than this part of the peak rate ...
const MOVING_FRACTION: f64 = 2e-3;
/// ... and by this many standard deviations of a block mean.
const MOVING_SIGMA: f64 = 8.0;
/// The integrals of both directions must cancel to this part of their difference, beside four standard deviations of
/// noise.
const CANCEL_LIMIT: f64 = 1e-4;

/// Number of means of the rest at either end. Their scatter shows how much scatter the noise explains.
const MEANS_OF_REST: usize = 4;

/// Direction of the axis of rotation, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RotationAxis {
    /// Unknown. The earth's rotation stays in the offset.
    Unknown,
    /// Each axis in turn parallel to the earth's axis, positive to the celestial north.
    Polar,
    /// Each axis in turn up, at this latitude. The headings are unknown, but equal at the start of both runs of an
    /// axis.
    Vertical {
        /// Geodetic latitude, degrees.
        latitude_deg: f64,
    },
}

/// How the runs were made, and the limits for them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotationOptions {
    /// Sample rate, Hz.
    pub rate_hz: f64,
    /// Turns of each run.
    pub turns: f64,
    /// Direction of the axis of rotation.
    pub axis: RotationAxis,
    /// Output at which a channel is saturated, if known.
    pub saturation: Option<f64>,
    /// Nominal response in LSB per rad/s and half width of the band around it in percent, if known. Only this can find
    /// an error of the angle that both directions share.
    pub nominal: Option<(f64, f64)>,
}

/// One run: a record with rest, a rotation and rest.
#[derive(Debug, Clone)]
pub struct RotationRun<'a> {
    /// Label `x+ x- y+ y- z+ z-`: axis and direction.
    pub label: String,
    /// Output of the triad.
    pub channels: [&'a [f64]; 3],
}

/// The place of the rotation in a run.
#[derive(Debug, Clone, PartialEq)]
pub struct RotationWindow {
    /// Label of the run.
    pub label: String,
    /// First sample of the window, from the start of the run.
    pub start: usize,
    /// One past the last sample of the window.
    pub end: usize,
    /// Peak of the run's own sensor less its rest, LSB (block mean).
    pub peak_lsb: f64,
    /// Integrals of the three sensors over the window, LSB s.
    pub integral_lsb_s: Vector3<f64>,
}

/// The result of `calibrate`. Rows of the matrices are sensors, columns are axes.
#[derive(Debug, Clone, PartialEq)]
pub struct RotationCalibration {
    /// S of `N = S w + b`, LSB per rad/s.
    pub response: Matrix3<f64>,
    /// b of the same equation at the attitude of the rotations, LSB: the bias, measured less true, with g-sensitivity
    /// in it.
    pub bias_lsb: Vector3<f64>,
    /// Kg of `w = Kg N - epsilon`, rad/s per LSB.
    pub matrix: Matrix3<f64>,
    /// epsilon of the same equation, rad/s: the constant that the compensation subtracts, equal to the bias.
    pub epsilon_rps: Vector3<f64>,
    /// Standard uncertainty of `response`.
    pub response_sd: Matrix3<f64>,
    /// Standard uncertainty of `bias_lsb`.
    pub bias_sd_lsb: Vector3<f64>,
    /// Standard uncertainty of `matrix`.
    pub matrix_sd: Matrix3<f64>,
    /// Standard uncertainty of `epsilon_rps` and of the bias in rad/s.
    pub bias_sd_rps: Vector3<f64>,
    /// Covariance of `matrix` (by rows) and `epsilon_rps` (type A).
    pub covariance: TriadCovariance,
    /// Largest error of the bias from the earth's rotation that is not corrected, rad/s.
    pub earth_bound_rps: f64,
    /// Windows of the runs, in the order x+ x- y+ y- z+ z-.
    pub windows: Vec<RotationWindow>,
    /// `|I+ + I- - T b| / |I+ - I-|` of each axis, b from rest.
    pub mismatch: Vector3<f64>,
    /// Residuals of the integrals of the three sensors over each window, as angles, rad. All are 0 with a vertical
    /// axis, where every integral goes into a parameter.
    pub residuals_rad: Vec<Vector3<f64>>,
    /// Root mean square of the residuals, as an angle, rad.
    pub residual_rms_rad: f64,
    /// Condition number of the scaled design.
    pub condition: f64,
    /// Degrees of freedom of the uncertainties.
    pub dof: f64,
}

impl RotationCalibration {
    /// Returns the bias at the attitude of the rotations, measured less true, rad/s: `Kg b = epsilon`.
    #[must_use]
    pub fn bias_rps(&self) -> Vector3<f64> {
        self.epsilon_rps
    }

    /// Returns the factor of the 95 % intervals (Student's t).
    #[must_use]
    pub fn coverage_factor(&self) -> f64 {
        stats::coverage_factor(0.95, self.dof)
    }

    /// Returns the expanded uncertainties (95 %, type A) of response and bias. They do not include errors of angle and
    /// clock that both directions share.
    #[must_use]
    pub fn expanded(&self) -> (Matrix3<f64>, Vector3<f64>) {
        (self.response_sd * self.coverage_factor(), self.bias_sd_rps * self.coverage_factor())
    }

    /// Returns the response of sensor i to axis j relative to its own axis, `S_ij / S_ii`, relative to the fixture.
    #[must_use]
    pub fn coupling(&self) -> Matrix3<f64> {
        triad::coupling(&self.response)
    }

    /// As [`crate::six_position::SixPositionCalibration::nonorthogonality_rad`].
    #[must_use]
    pub fn nonorthogonality_rad(&self) -> Vector3<f64> {
        triad::nonorthogonality_rad(&self.response)
    }

    /// Returns the rate of an output, rad/s.
    #[must_use]
    pub fn compensate(&self, output: &Vector3<f64>) -> Vector3<f64> {
        self.matrix * output - self.epsilon_rps
    }
}

/// Finds the rotations and computes the calibration.
///
/// With a polar or unknown axis the four parameters of a sensor leave two residuals, and the uncertainty comes from
/// them (pooled as angles, six degrees of freedom). With a vertical axis of unknown heading the horizontal earth rate
/// is an unknown of every pair of windows across the axis, so that no residual is left: scale comes from the
/// differences, bias from the own-axis windows, and the uncertainty from the noise at rest. That noise is taken as
/// white.
///
/// # Errors
/// Missing or doubled runs, records that are not finite, cut off, saturated, restless or turned differently; sensors
/// that answer to the wrong axis, with the wrong sign or outside the stated band.
pub fn calibrate(runs: &[RotationRun], options: &RotationOptions) -> Result<RotationCalibration, Refusal> {
    let dt = 1.0 / series::positive("rate (Hz)", options.rate_hz)?;
    let angle = std::f64::consts::TAU * series::positive("turns", options.turns)?;
    let runs = in_order(runs)?;
    let slow = [0, 1, 2].map(|i| noise_at_ends(&runs, i, options.rate_hz));
    let rests = [0, 1, 2].map(|i| rests(&runs, i, options.rate_hz));
    let mut found = Vec::with_capacity(6);
    for (r, run) in runs.iter().enumerate() {
        series::channels(&AXES, &run.channels)?;
        for ((name, values), rests) in AXES.iter().zip(run.channels).zip(&rests) {
            match options.saturation {
                Some(_) => series::unsaturated(name, values, options.saturation)?,
                None => series::unclipped(&format!("{name} of run {}", run.label), values, rests)?,
            }
        }
        found.push(Found::search(run, r / 2, slow[r / 2], options.rate_hz)?);
    }
    alive(&runs, &rests)?;
    let windows = windows(&runs, &found, options.rate_hz)?;
    rest(&runs, &found, slow, options.rate_hz)?;
    let resolution = Vector3::from_fn(|i, _| resolution(&runs, &found, i));
    let mismatch = cancel(&runs, &found, &windows, slow, resolution, dt)?;

    let along = match options.axis {
        RotationAxis::Unknown => 0.0,
        RotationAxis::Polar => earth::EARTH_RATE_RPS,
        RotationAxis::Vertical { latitude_deg } => earth::vertical_rate_rps(latitude_deg)?,
    };
    let spent = matches!(options.axis, RotationAxis::Vertical { .. });
    let mut response = Matrix3::zeros();
    let mut bias_lsb = Vector3::zeros();
    let mut cofactor = [Matrix4::zeros(); 3];
    let mut of_steps = [Matrix4::zeros(); 3];
    let longest_s = windows.iter().map(|w| w.end - w.start).max().unwrap_or(0) as f64 * dt;
    let mut residuals = DMatrix::<f64>::zeros(6, 3);
    let mut condition: f64 = 0.0;
    for i in 0..3 {
        let across: Vec<usize> = (0..3).filter(|j| spent && *j != i).collect();
        let design = DMatrix::from_fn(6, 4 + across.len(), |r, c| {
            let span_s = (windows[r].end - windows[r].start) as f64 * dt;
            let sense = if r % 2 == 0 { 1.0 } else { -1.0 };
            match c {
                0..3 if c == r / 2 => sense * angle + along * span_s,
                0..3 => 0.0,
                3 => span_s,
                _ => f64::from(u8::from(across[c - 4] == r / 2)),
            }
        });
        let data = DMatrix::from_fn(6, 1, |r, _| windows[r].integral_lsb_s[i]);
        let fit = linear::least_squares("the response to rotation", &design, &data)?;
        for j in 0..3 {
            response[(i, j)] = fit.solution[j];
        }
        bias_lsb[i] = fit.solution[3];
        cofactor[i] = fit.cofactor.fixed_view::<4, 4>(0, 0).into();
        let worst: Vector4<f64> = fit.reach.fixed_rows::<4>(0) * (resolution[i] * longest_s);
        of_steps[i] = Matrix4::from_diagonal(&worst.component_mul(&worst));
        residuals.set_column(i, &fit.residuals.column(0));
        condition = condition.max(fit.condition);
    }
    check_response(&response, options.nominal)?;
    let singular = Refusal::IllConditioned { what: "the inverse response", condition: f64::INFINITY, limit: 1e4 };
    let matrix = response.try_inverse().ok_or(singular)?;
    let epsilon_rps = matrix * bias_lsb;

    let squares: f64 = (0..3).map(|i| residuals.column(i).norm_squared() / response[(i, i)].powi(2)).sum();
    let (variance, dof) = if spent {
        let noise = Noise::at_rest(&runs, &found, options.rate_hz);
        let length = windows.iter().map(|w| w.end - w.start).max().unwrap_or(0) as f64;
        (noise.sd_lsb.map(|sd| sd * sd * dt * dt * length), noise.dof)
    } else {
        (Vector3::from_fn(|i, _| squares / 6.0 * response[(i, i)].powi(2)), 6.0)
    };
    let covariance = [0, 1, 2].map(|i| cofactor[i] * variance[i] + of_steps[i]);
    let parameters = linear::inverse_covariance(&matrix, &(-epsilon_rps).push(1.0), &covariance);
    let (matrix_sd, bias_sd_rps) = linear::standard_uncertainties(&parameters);
    Ok(RotationCalibration {
        response,
        bias_lsb,
        matrix,
        epsilon_rps,
        response_sd: Matrix3::from_fn(|i, j| covariance[i][(j, j)].sqrt()),
        bias_sd_lsb: Vector3::from_fn(|i, _| covariance[i][(3, 3)].sqrt()),
        matrix_sd,
        bias_sd_rps,
        covariance: negated_constant(parameters),
        earth_bound_rps: if options.axis == RotationAxis::Unknown { earth::EARTH_RATE_RPS } else { 0.0 },
        windows,
        mismatch,
        residuals_rad: (0..6).map(|r| Vector3::from_fn(|i, _| residuals[(r, i)] / response[(i, i)])).collect(),
        residual_rms_rad: (squares / 18.0).sqrt(),
        condition,
        dof,
    })
}

/// The covariance of epsilon from that of `-epsilon`.
fn negated_constant(covariance: TriadCovariance) -> TriadCovariance {
    TriadCovariance::from_fn(|p, q| if (p < 9) == (q < 9) { covariance[(p, q)] } else { -covariance[(p, q)] })
}

/// The runs in the order of the labels, each once.
fn in_order<'a, 'b>(runs: &'b [RotationRun<'a>]) -> Result<Vec<&'b RotationRun<'a>>, Refusal> {
    for (i, run) in runs.iter().enumerate() {
        if position::up_of(&run.label).is_none() {
            return Err(Refusal::UnknownLabel { label: run.label.clone(), row: i + 1 });
        }
        if let Some(first) = runs[..i].iter().position(|r| r.label == run.label) {
            return Err(Refusal::SplitLabel { label: run.label.clone(), first: first + 1, again: i + 1 });
        }
    }
    let missing: Vec<&str> = position::LABELS.into_iter().filter(|l| !runs.iter().any(|r| r.label == *l)).collect();
    if !missing.is_empty() {
        return Err(Refusal::Missing { labels: missing.join(" ") });
    }
    Ok(position::LABELS.iter().filter_map(|l| runs.iter().find(|r| r.label == *l)).collect())
}

/// Noise of a channel at rest from its means, which behind a low-pass scatter by more than neighbouring rows show. It
/// comes from the beginnings of all runs or from their ends; the longer rests count.
fn noise_at_ends(runs: &[&RotationRun], channel: usize, rate_hz: f64) -> f64 {
    let edge = (REST_S * rate_hz).ceil() as usize;
    let rows = (edge / MEANS_OF_REST).max(1);
    let of = |end: &dyn Fn(&[f64]) -> std::ops::Range<usize>| {
        let rests = runs.iter().map(|run| (&run.channels[channel][end(run.channels[channel])], rows));
        stats::sd_of_means(&rests.collect::<Vec<_>>())
    };
    let heads = of(&|values| 0..edge.min(values.len()));
    heads.min(of(&|values| values.len() - edge.min(values.len())..values.len()))
}

/// Rests of one channel: the beginnings and ends of all runs.
fn rests<'a>(runs: &[&RotationRun<'a>], channel: usize, rate_hz: f64) -> Vec<&'a [f64]> {
    let edge = (REST_S * rate_hz).ceil() as usize;
    let of_run = |values: &'a [f64]| {
        let edge = edge.min(values.len());
        [&values[..edge], &values[values.len() - edge..]]
    };
    runs.iter().flat_map(|run| of_run(run.channels[channel])).collect()
}

/// Checks that no channel stands still through a run while it is noisy at rest in another run. Its cross-coupling in
/// that run would read 0.
fn alive(runs: &[&RotationRun], rests: &[Vec<&[f64]>; 3]) -> Result<(), Refusal> {
    for (i, name) in AXES.into_iter().enumerate() {
        let still = |run: &&&RotationRun| run.channels[i].iter().all(|v| *v == run.channels[i][0]);
        let Some(run) = runs.iter().find(still) else { continue };
        if quantisation::is_stuck(&rests[i], run.channels[i].len()) {
            let (channel, place) = (name.to_owned(), format!("run {}", run.label));
            let (value, samples) = (run.channels[i][0], run.channels[i].len());
            return Err(Refusal::Stuck { channel, place, value, samples });
        }
    }
    Ok(())
}

/// The moving part of a run, in samples.
struct Found {
    start: usize,
    end: usize,
    peak: f64,
}

impl Found {
    /// Finds the rotation. `slow` is the noise of the channel from its means.
    fn search(run: &RotationRun, axis: usize, slow: f64, rate_hz: f64) -> Result<Self, Refusal> {
        let values = run.channels[axis];
        let block = (BLOCK_S * rate_hz).ceil().max(1.0) as usize;
        let needed = ((4.0 * REST_S) * rate_hz).ceil() as usize + 8 * block;
        if values.len() < needed {
            return Err(Refusal::TooFew { what: format!("run {}", run.label), got: values.len(), needed });
        }
        let edge = (REST_S * rate_hz).ceil() as usize;
        let (head, tail) = (&values[..edge], &values[values.len() - edge..]);
        let noise = stats::white_sd(head).min(stats::white_sd(tail)).max(slow) / (block as f64).sqrt();
        let (before, after) = (stats::mean(head), stats::mean(tail));
        let level = f64::midpoint(before, after);
        // A rest of a single block is noisier than the limit assumes.
        let means: Vec<f64> = values.chunks_exact(block).map(stats::mean).collect();
        let peak = means.iter().map(|m| m - level).fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
        let limit = (MOVING_FRACTION * peak.abs()).max(MOVING_SIGMA * noise);
        if peak.abs() < 10.0 * MOVING_SIGMA * noise || peak == 0.0 {
            return Err(Refusal::NoRotation { run: run.label.clone(), peak, noise });
        }
        let cut = |side, rest_s| Refusal::CutOff { run: run.label.clone(), side, rest_s, needed_s: REST_S };
        if (before - after).abs() > limit {
            // Where one side moves, that side is the one cut off. Of two steady sides it is the one farther from zero.
            let spread = |part: &[f64]| {
                let (first, last) = part.split_at(part.len() / 2);
                (stats::mean(first) - stats::mean(last)).abs()
            };
            let head_moves = if spread(head).max(spread(tail)) > limit {
                spread(head) > spread(tail)
            } else {
                before.abs() > after.abs()
            };
            return Err(cut(if head_moves { "before" } else { "after" }, 0.0));
        }
        let moving: Vec<usize> = (0..means.len()).filter(|&k| (means[k] - level).abs() > limit).collect();
        let (first, last) = largest_segment(&moving, &means, level);
        let (start, end) = (first * block, ((last + 1) * block).min(values.len()));
        let stray = moving.iter().find(|k| **k < first || **k > last);
        if let Some(&k) = stray {
            return Err(Refusal::Restless {
                run: run.label.clone(),
                channel: AXES[axis],
                at_s: (k * block) as f64 / rate_hz,
                deviation: means[k] - level,
                limit,
            });
        }
        for (side, rest) in [("before", start), ("after", values.len() - end)] {
            if (rest as f64) < REST_S * rate_hz {
                return Err(cut(side, rest as f64 / rate_hz));
            }
        }
        Ok(Self { start, end, peak })
    }
}

/// The run of neighbouring moving blocks (short pauses allowed) with the largest integral.
fn largest_segment(moving: &[usize], means: &[f64], level: f64) -> (usize, usize) {
    // 0.25 s: a ramp that dips under the threshold does not end a rotation.
    const PAUSE_BLOCKS: usize = 5;
    let mut best = (0, 0);
    let mut best_area = -1.0;
    let mut i = 0;
    while i < moving.len() {
        let mut j = i;
        while j + 1 < moving.len() && moving[j + 1] - moving[j] <= PAUSE_BLOCKS {
            j += 1;
        }
        let area = moving[i..=j].iter().map(|&k| means[k] - level).sum::<f64>().abs();
        if area > best_area {
            (best, best_area) = ((moving[i], moving[j]), area);
        }
        i = j + 1;
    }
    best
}

/// Computes windows of equal length within each pair, centred on the rotations and inside the records.
fn windows(runs: &[&RotationRun], found: &[Found], rate_hz: f64) -> Result<Vec<RotationWindow>, Refusal> {
    let margin = (MARGIN_S * rate_hz).ceil() as usize;
    let mut windows = Vec::with_capacity(6);
    for (r, (run, f)) in runs.iter().zip(found).enumerate() {
        let partner = &found[r ^ 1];
        let length = (f.end - f.start).max(partner.end - partner.start) + 2 * margin;
        let samples = run.channels[0].len();
        if length > samples {
            let rest_s = (samples - (f.end - f.start)) as f64 / rate_hz;
            let needed_s = (length - (f.end - f.start)) as f64 / rate_hz;
            return Err(Refusal::CutOff { run: run.label.clone(), side: "around", rest_s, needed_s });
        }
        let centred = usize::midpoint(f.start, f.end).saturating_sub(length / 2);
        let start = centred.min(samples - length);
        let range = start..start + length;
        let integral_lsb_s =
            Vector3::from_fn(|i, _| stats::mean(&run.channels[i][range.clone()]) * length as f64 / rate_hz);
        windows.push(RotationWindow {
            label: run.label.clone(),
            start,
            end: range.end,
            peak_lsb: f.peak,
            integral_lsb_s,
        });
    }
    Ok(windows)
}

/// Checks that all three sensors rest outside the rotation.
fn rest(runs: &[&RotationRun], found: &[Found], slow: [f64; 3], rate_hz: f64) -> Result<(), Refusal> {
    let block = (BLOCK_S * rate_hz).ceil().max(1.0) as usize;
    let margin = (MARGIN_S * rate_hz).ceil() as usize;
    for (run, f) in runs.iter().zip(found) {
        for i in 0..3 {
            let values = run.channels[i];
            let own_peak = found[2 * i].peak.abs().min(found[2 * i + 1].peak.abs());
            let (before, after) =
                (&values[..f.start.saturating_sub(margin)], &values[(f.end + margin).min(values.len())..]);
            let noise = stats::white_sd(before).max(stats::white_sd(after)).max(slow[i]) / (block as f64).sqrt();
            let limit = (MOVING_FRACTION * own_peak).max(MOVING_SIGMA * noise);
            let (sum, count) = [before, after].iter().fold((0.0, 0), |(s, n), part| {
                if part.is_empty() { (s, n) } else { (s + stats::mean(part) * part.len() as f64, n + part.len()) }
            });
            let level = sum / count as f64;
            for (part, offset) in [(before, 0), (after, f.end + margin)] {
                for (k, chunk) in part.chunks_exact(block).enumerate() {
                    let deviation = stats::mean(chunk) - level;
                    if deviation.abs() > limit {
                        let at_s = (offset + k * block) as f64 / rate_hz;
                        return Err(Refusal::Restless {
                            run: run.label.clone(),
                            channel: AXES[i],
                            at_s,
                            deviation,
                            limit,
                        });
                    }
                }
            }
        }
    }
    Ok(())
}

/// Noise of the outputs at rest as it adds up in an integral, and its degrees of freedom.
struct Noise {
    sd_lsb: Vector3<f64>,
    dof: f64,
}

impl Noise {
    /// The noise of neighbouring rows. Behind a low-pass the next rows repeat it, so that means of rows scatter by more
    /// than it explains. Then the noise comes from means twice as long, which keep less of the memory.
    fn at_rest(runs: &[&RotationRun], found: &[Found], rate_hz: f64) -> Self {
        let edge = (REST_S * rate_hz).ceil() as usize;
        let (short, long) = ((edge / MEANS_OF_REST).max(1), (2 * edge / MEANS_OF_REST).max(1));
        let mut squares = Vector3::zeros();
        let mut dof = 0.0;
        let mut rests: [Vec<&[f64]>; 3] = Default::default();
        for (run, f) in runs.iter().zip(found) {
            let n = run.channels[0].len();
            for part in [0..f.start, f.end..n] {
                dof += part.len() as f64 - 1.0;
                squares += Vector3::from_fn(|i, _| {
                    stats::white_sd(&run.channels[i][part.clone()]).powi(2) * (part.len() as f64 - 1.0)
                });
                rests.iter_mut().zip(run.channels).for_each(|(rests, values)| rests.push(&values[part.clone()]));
            }
        }
        let mut sd_lsb = squares.map(|s: f64| (s / dof).sqrt());
        // Successive differences have two thirds of the degrees of freedom of a sample variance (von Neumann).
        let mut known = dof * 2.0 / 3.0;
        for (sd, rests) in sd_lsb.iter_mut().zip(rests) {
            let of_means = |rows| stats::sd_of_means(&rests.iter().map(|rest| (*rest, rows)).collect::<Vec<_>>());
            if of_means(short) > *sd {
                *sd = of_means(long);
                // The median of the differences has 37 in a hundred of these (the efficiency of the median deviation).
                known = dof / long as f64 * 0.37;
            }
        }
        Self { sd_lsb, dof: known }
    }
}

/// The error that the steps of a sensor's output leave in a mean, from the rests and the channels that do not turn.
fn resolution(runs: &[&RotationRun], found: &[Found], channel: usize) -> f64 {
    let rests = runs.iter().zip(found).flat_map(|(run, f)| {
        let values = run.channels[channel];
        [&values[..f.start], &values[f.end..]]
    });
    quantisation::mean_error_sd(&rests.collect::<Vec<_>>())
}

/// Checks that both directions cancel except for the bias at rest, which contains the own-axis earth rate.
fn cancel(
    runs: &[&RotationRun],
    found: &[Found],
    windows: &[RotationWindow],
    slow: [f64; 3],
    resolution: Vector3<f64>,
    dt: f64,
) -> Result<Vector3<f64>, Refusal> {
    let mut mismatches = Vector3::zeros();
    for (axis, name) in AXES.into_iter().enumerate() {
        let pair = [2 * axis, 2 * axis + 1];
        let (mut sum, mut count, mut squares) = (0.0, 0.0, 0.0);
        for r in pair {
            let values = runs[r].channels[axis];
            for part in [&values[..found[r].start], &values[found[r].end..]] {
                sum += stats::mean(part) * part.len() as f64;
                squares += stats::white_sd(part).powi(2) * part.len() as f64;
                count += part.len() as f64;
            }
        }
        let rest = sum / count;
        let [forth, back] =
            pair.map(|r| windows[r].integral_lsb_s[axis] - rest * dt * (windows[r].end - windows[r].start) as f64);
        if forth * back > 0.0 {
            return Err(Refusal::SameSense { axis: name, forth, back });
        }
        let samples: f64 = pair.iter().map(|&r| (windows[r].end - windows[r].start) as f64).sum();
        let variance = (squares / count).max(slow[axis] * slow[axis]);
        let noise = (variance * (samples + samples * samples / count)).sqrt() * dt;
        // The steps may give the same error in both runs, and the opposite error in the rest.
        let sigma = noise.hypot(2.0 * resolution[axis] * samples * dt);
        let mismatch = (forth + back).abs() / (forth - back).abs();
        let limit = CANCEL_LIMIT + 4.0 * sigma / (forth - back).abs();
        if mismatch > limit {
            return Err(Refusal::Mismatch { axis: name, mismatch, limit });
        }
        mismatches[axis] = mismatch;
    }
    Ok(mismatches)
}

/// Checks that every sensor answers positively, to its own axis most, and inside the band.
fn check_response(response: &Matrix3<f64>, nominal: Option<(f64, f64)>) -> Result<(), Refusal> {
    for (i, axis) in AXES.into_iter().enumerate() {
        let own = response[(i, i)];
        for (j, other) in AXES.into_iter().enumerate() {
            if j != i && response[(i, j)].abs() > own.abs() {
                return Err(Refusal::WrongAxis { axis, own, other, cross: response[(i, j)] });
            }
        }
        if own <= 0.0 {
            return Err(Refusal::WrongSign { axis, response: own });
        }
        if let Some((nominal, percent)) = nominal.filter(|(n, p)| (own / n - 1.0).abs() * 100.0 > *p) {
            return Err(Refusal::OutOfBand { axis, response: own, nominal, percent });
        }
    }
    Ok(())
}
