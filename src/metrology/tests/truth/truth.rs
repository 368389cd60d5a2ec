//! Simulated calibrations compared with their truth and the Cramer-Rao bound.
//!
//! Everything here is written down from the measurement models, independently of the code under test: the bounds come
//! from numerical derivatives of the models, not from the covariances that the methods report.

#![allow(unreachable_pub, dead_code, reason = "shared by a test and a benchmark")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::needless_range_loop,
    reason = "a simulation may end with a panic"
)]

pub mod chi_square;
mod magnetometer;
pub mod noise;

#[allow(unused_imports, reason = "each test needs some of them")]
pub use magnetometer::{directions, ellipse, ellipse_points, ellipsoid};

use gnc_metrology::position::{LABELS, Limits, from_directions, from_labels, up_of};
use gnc_metrology::{earth, gyro_still, rotation, six_position};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Seeded normal noise.
pub struct Dice(ChaCha8Rng);

impl Dice {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
}

/// Estimate with its standard uncertainty and the factor of its 95 % interval.
#[derive(Clone, Copy)]
pub struct Estimate {
    pub value: f64,
    pub sd: f64,
    pub factor: f64,
}

/// The results of many simulated calibrations.
pub struct Tally {
    pub method: &'static str,
    names: Vec<String>,
    truth: Vec<f64>,
    bound: Vec<f64>,
    sum: Vec<f64>,
    squares: Vec<f64>,
    covered: Vec<usize>,
    trials: usize,
}

impl Tally {
    fn run(
        method: &'static str,
        trials: usize,
        seed: u64,
        names: Vec<String>,
        truth: Vec<f64>,
        bound: Vec<f64>,
        mut trial: impl FnMut(&mut Dice) -> Vec<Estimate>,
    ) -> Self {
        let n = names.len();
        assert_eq!((truth.len(), bound.len()), (n, n), "{method}");
        let mut tally =
            Self { method, names, truth, bound, sum: vec![0.0; n], squares: vec![0.0; n], covered: vec![0; n], trials };
        let mut dice = Dice::new(seed);
        for _ in 0..trials {
            let estimates = trial(&mut dice);
            assert_eq!(estimates.len(), n, "{method}");
            for (p, e) in estimates.iter().enumerate() {
                let error = e.value - tally.truth[p];
                tally.sum[p] += error;
                tally.squares[p] += error * error;
                tally.covered[p] += usize::from(error.abs() <= e.factor * e.sd);
            }
        }
        tally
    }

    /// Worst figures: bias in standard errors, smallest and largest rms error over the bound, smallest and largest
    /// coverage, pooled coverage; and the lines of a table.
    pub fn verdict(&self) -> Verdict {
        let n = self.trials as f64;
        let mut verdict =
            Verdict { bias: 0.0, rms: (f64::MAX, 0.0), coverage: (f64::MAX, 0.0), pooled: 0.0, lines: String::new() };
        for p in 0..self.names.len() {
            let rms = (self.squares[p] / n).sqrt();
            let bias = self.sum[p] / n / (rms / n.sqrt());
            let ratio = rms / self.bound[p];
            let coverage = 100.0 * self.covered[p] as f64 / n;
            verdict.bias = if bias.abs() > verdict.bias || bias.is_nan() { bias.abs() } else { verdict.bias };
            verdict.rms = (verdict.rms.0.min(ratio), verdict.rms.1.max(ratio));
            verdict.coverage = (verdict.coverage.0.min(coverage), verdict.coverage.1.max(coverage));
            verdict.pooled += coverage / self.names.len() as f64;
            verdict.lines += &format!(
                "  {:<14} truth {:>13.6e}  bias {:>6.2} se  rms/bound {:.4}  coverage {:.2} %\n",
                self.names[p], self.truth[p], bias, ratio, coverage
            );
        }
        verdict
    }

    /// The bounds of the specification, widened for fewer trials by the effect of chance. The rms of n trials scatters
    /// by 1 / sqrt(2 n), a coverage by sqrt(0.95 * 0.05 / n); 4.2 and 4.6 times these are the bounds at 10,000.
    pub fn failures(&self) -> Vec<String> {
        let v = self.verdict();
        let widen = (10_000.0 / self.trials as f64).sqrt().max(1.0);
        let mut failures = Vec::new();
        let mut check = |what: &str, low: f64, high: f64, bound: (f64, f64)| {
            if low.is_nan() || high.is_nan() || low < bound.0 || high > bound.1 {
                failures.push(format!(
                    "{}: {what} {low:.4} .. {high:.4}, bound {:.4} .. {:.4}",
                    self.method, bound.0, bound.1
                ));
            }
        };
        check("bias in standard errors", 0.0, v.bias, (0.0, 3.9));
        check("rms over bound", v.rms.0, v.rms.1, (1.0 - 0.03 * widen, 1.0 + 0.03 * widen));
        check("coverage %", v.coverage.0, v.coverage.1, (95.0 - widen, 95.0 + widen));
        check("pooled coverage %", v.pooled, v.pooled, (95.0 - 0.5 * widen, 95.0 + 0.5 * widen));
        failures
    }
}

pub struct Verdict {
    pub bias: f64,
    pub rms: (f64, f64),
    pub coverage: (f64, f64),
    pub pooled: f64,
    pub lines: String,
}

/// Standard deviations of the Cramer-Rao bound: data `model(parameters)` with independent noise of deviations `sigma`.
fn bound(parameters: &[f64], sigma: &[f64], model: impl Fn(&[f64]) -> Vec<f64>) -> Vec<f64> {
    let jacobian = derivatives(parameters, &model);
    let weighted = DMatrix::from_fn(sigma.len(), parameters.len(), |r, c| jacobian[(r, c)] / sigma[r]);
    information_to_sd(&weighted)
}

fn information_to_sd(weighted: &DMatrix<f64>) -> Vec<f64> {
    covariance(weighted).diagonal().iter().map(|v| v.sqrt()).collect()
}

/// Inverse information of a weighted Jacobian, its columns scaled first.
fn covariance(weighted: &DMatrix<f64>) -> DMatrix<f64> {
    let scale: Vec<f64> = weighted.column_iter().map(|c| c.norm()).collect();
    let scaled = DMatrix::from_fn(weighted.nrows(), weighted.ncols(), |r, c| weighted[(r, c)] / scale[c]);
    let r = scaled.qr().r();
    let inverse = r.try_inverse().expect("the simulated design determines its parameters");
    let inverse = DMatrix::from_fn(scale.len(), scale.len(), |a, b| inverse[(a, b)] / scale[a]);
    &inverse * inverse.transpose()
}

fn derivatives(parameters: &[f64], model: &impl Fn(&[f64]) -> Vec<f64>) -> DMatrix<f64> {
    let columns: Vec<DVector<f64>> = (0..parameters.len())
        .map(|p| {
            let h = 1e-5 * parameters[p].abs().max(1e-4);
            let mut shifted = parameters.to_vec();
            shifted[p] += h;
            let above = model(&shifted);
            shifted[p] -= 2.0 * h;
            let below = model(&shifted);
            DVector::from_iterator(above.len(), above.iter().zip(below).map(|(a, b)| (a - b) / (2.0 * h)))
        })
        .collect();
    DMatrix::from_columns(&columns)
}

fn matrix_of(p: &[f64]) -> Matrix3<f64> {
    Matrix3::new(p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8])
}

fn names(matrix: &str, vector: &str) -> Vec<String> {
    let m = (0..9).map(|k| format!("{matrix}[{},{}]", k / 3, k % 3));
    m.chain((0..3).map(|k| format!("{vector}[{k}]"))).collect()
}

fn estimates(
    matrix: &Matrix3<f64>,
    matrix_sd: &Matrix3<f64>,
    vector: &Vector3<f64>,
    vector_sd: &Vector3<f64>,
    factor: f64,
) -> Vec<Estimate> {
    let m = (0..9).map(|k| Estimate { value: matrix[(k / 3, k % 3)], sd: matrix_sd[(k / 3, k % 3)], factor });
    m.chain((0..3).map(|k| Estimate { value: vector[k], sd: vector_sd[k], factor })).collect()
}

/// Scale factors differ by a half between the axes, as in real triads of different ranges.
const RESPONSE: [f64; 9] = [2000.0, 12.0, -7.0, -20.0, 3000.0, 15.0, 9.0, -5.0, 2500.0];

/// Accelerometer: compensation matrix and bias from labelled positions.
pub fn six_position(trials: usize, seed: u64) -> Tally {
    let up: Vec<Vector3<f64>> = LABELS.iter().filter_map(|l| up_of(l)).collect();
    accelerometer("six-position", &up, trials, seed, |outputs| {
        let channels = [0, 1, 2].map(|i| outputs.iter().map(|o| o[i]).collect::<Vec<f64>>());
        from_labels(&LABELS, [&channels[0], &channels[1], &channels[2]], &Limits::ACCELEROMETER).unwrap()
    })
}

/// The same calibration from twelve attitudes between the axes.
pub fn twelve_attitudes(trials: usize, seed: u64) -> Tally {
    let h = 0.5_f64.sqrt();
    let edges = [(0, 1), (0, 2), (1, 2)];
    let up: Vec<Vector3<f64>> = edges
        .into_iter()
        .flat_map(|(a, b)| {
            [(h, h), (h, -h), (-h, h), (-h, -h)].map(|(p, q)| {
                let mut u = Vector3::zeros();
                (u[a], u[b]) = (p, q);
                u
            })
        })
        .collect();
    let columns = [0, 1, 2].map(|i| up.iter().map(|u| u[i]).collect::<Vec<f64>>());
    accelerometer("twelve attitudes", &up, trials, seed, move |outputs| {
        let channels = [0, 1, 2].map(|i| outputs.iter().map(|o| o[i]).collect::<Vec<f64>>());
        let up = [columns[0].as_slice(), &columns[1], &columns[2]];
        from_directions(up, [&channels[0], &channels[1], &channels[2]], &Limits::ACCELEROMETER).unwrap()
    })
}

fn accelerometer(
    method: &'static str,
    up: &[Vector3<f64>],
    trials: usize,
    seed: u64,
    average: impl Fn(&[Vector3<f64>]) -> Vec<gnc_metrology::position::Position>,
) -> Tally {
    let gravity = 9.7967;
    // Noise of a position's mean, m/s^2.
    let noise = 2e-3;
    let response = matrix_of(&RESPONSE);
    let offset = Vector3::new(150.0, -90.0, 40.0);
    let matrix = response.try_inverse().unwrap();
    let bias = -matrix * offset;
    let truth: Vec<f64> = (0..9).map(|k| matrix[(k / 3, k % 3)]).chain(bias.iter().copied()).collect();
    let sigma = response.diagonal() * noise;
    let model = |p: &[f64]| -> Vec<f64> {
        let inverse = matrix_of(p).try_inverse().unwrap();
        up.iter()
            .flat_map(|u| {
                (inverse * (gravity * u - Vector3::new(p[9], p[10], p[11]))).iter().copied().collect::<Vec<_>>()
            })
            .collect()
    };
    let sigmas: Vec<f64> = (0..3 * up.len()).map(|r| sigma[r % 3]).collect();
    let bound = bound(&truth, &sigmas, model);
    Tally::run(method, trials, seed, names("matrix", "bias"), truth, bound, |dice| {
        let outputs: Vec<Vector3<f64>> =
            up.iter().map(|u| response * (gravity * u) + offset + sigma.map(|s| s * dice.normal())).collect();
        let c = six_position::calibrate(&average(&outputs), gravity).unwrap();
        estimates(&c.matrix, &c.matrix_sd, &c.nabla_mps2, &c.bias_sd_mps2, c.coverage_factor())
    })
}

/// Gyroscope at rest: bias and g-sensitivity, headings known.
pub fn gyro_still(trials: usize, seed: u64) -> Tally {
    let (gravity, latitude) = (9.7967, 34.0);
    let noise = 2e-6;
    let bias = Vector3::new(1e-3, -2e-3, 5e-4);
    let sensitivity = Matrix3::new(4.0, 1.0, -2.0, 0.5, -3.0, 1.5, 1.0, 2.0, 5.0) * 1e-6;
    let up: Vec<Vector3<f64>> = LABELS.iter().filter_map(|l| up_of(l)).collect();
    // North is any direction across up, with a different heading in each position.
    let north: Vec<Vector3<f64>> = up
        .iter()
        .enumerate()
        .map(|(i, u)| {
            let across = Vector3::new(u[1], u[2], u[0]);
            let other = u.cross(&across);
            let heading = i as f64;
            across * heading.cos() + other * heading.sin()
        })
        .collect();
    let vertical = earth::EARTH_RATE_RPS * f64::to_radians(latitude).sin();
    let horizontal = earth::EARTH_RATE_RPS * f64::to_radians(latitude).cos();
    let truth: Vec<f64> = (0..9).map(|k| sensitivity[(k / 3, k % 3)]).chain(bias.iter().copied()).collect();
    let model = |p: &[f64]| -> Vec<f64> {
        let b = Vector3::new(p[9], p[10], p[11]);
        up.iter()
            .zip(&north)
            .flat_map(|(u, n)| {
                (matrix_of(p) * (gravity * u) + b + vertical * u + horizontal * n).iter().copied().collect::<Vec<_>>()
            })
            .collect()
    };
    let bound = bound(&truth, &[noise; 18], model);
    let clean = model(&truth);
    Tally::run("gyro-still", trials, seed, names("g_sens", "bias"), truth, bound, |dice| {
        let noisy: Vec<f64> = clean.iter().map(|v| v + noise * dice.normal()).collect();
        let channels = [0, 1, 2].map(|i| (0..6).map(|r| noisy[3 * r + i]).collect::<Vec<f64>>());
        let positions = from_labels(&LABELS, [&channels[0], &channels[1], &channels[2]], &Limits::GYROSCOPE).unwrap();
        let c = gyro_still::calibrate(&positions, gravity, latitude, Some(&north)).unwrap();
        estimates(&c.g_sensitivity, &c.g_sensitivity_sd, &c.bias_rps, &c.bias_sd_rps, c.coverage_factor())
    })
}

/// A simulated rotation session.
pub struct Session {
    pub rate_hz: f64,
    pub turns: f64,
    pub response: Matrix3<f64>,
    pub offset: Vector3<f64>,
    /// Noise of a sample, LSB.
    pub noise: Vector3<f64>,
    /// Rest before, ramp, plateau and rest after, s.
    pub times_s: [f64; 4],
    /// Earth's rotation: along the axis, and across it before the module turns.
    pub earth_rps: (f64, f64),
}

impl Session {
    pub fn example() -> Self {
        let response = matrix_of(&RESPONSE);
        Self {
            rate_hz: 100.0,
            turns: 3.0,
            response,
            offset: Vector3::new(12.0, -8.0, 5.0),
            noise: response.diagonal() * 1e-3,
            times_s: [1.5, 0.5, 4.5, 3.0],
            earth_rps: (earth::EARTH_RATE_RPS, 0.0),
        }
    }

    /// Outputs of the run about `axis`, with `sense` +-1.
    pub fn run(&self, axis: usize, sense: f64, dice: &mut Dice) -> [Vec<f64>; 3] {
        let [before, ramp, plateau, after] = self.times_s;
        let angle = std::f64::consts::TAU * self.turns;
        let peak = angle / (ramp + plateau);
        let samples = ((before + 2.0 * ramp + plateau + after) * self.rate_hz).round() as usize;
        let turned = |t: f64| {
            let t = (t - before).clamp(0.0, 2.0 * ramp + plateau);
            let up = t.min(ramp);
            let down = (t - ramp - plateau).max(0.0);
            peak * (up * up / (2.0 * ramp) + (t - up - down).max(0.0) + down - down * down / (2.0 * ramp))
        };
        let mut channels = [Vec::new(), Vec::new(), Vec::new()];
        for k in 0..samples {
            // A sample is the mean rate of its interval, as from an integrating gyroscope.
            let (t0, t1) = (k as f64 / self.rate_hz, (k + 1) as f64 / self.rate_hz);
            let rate = sense * (turned(t1) - turned(t0)) * self.rate_hz;
            let heading = sense * turned(f64::midpoint(t0, t1));
            let mut w = Vector3::zeros();
            w[axis] = rate + self.earth_rps.0;
            // The module turns by +heading: a fixed vector turns by -heading in its axes.
            w[(axis + 1) % 3] += self.earth_rps.1 * heading.cos();
            w[(axis + 2) % 3] -= self.earth_rps.1 * heading.sin();
            let n = self.response * w + self.offset;
            for i in 0..3 {
                channels[i].push(n[i] + self.noise[i] * dice.normal());
            }
        }
        channels
    }

    pub fn runs(&self, dice: &mut Dice) -> Vec<(String, [Vec<f64>; 3])> {
        LABELS
            .iter()
            .enumerate()
            .map(|(r, label)| ((*label).to_owned(), self.run(r / 2, if r % 2 == 0 { 1.0 } else { -1.0 }, dice)))
            .collect()
    }

    pub fn options(&self, axis: rotation::RotationAxis) -> rotation::RotationOptions {
        rotation::RotationOptions { rate_hz: self.rate_hz, turns: self.turns, axis, saturation: None, nominal: None }
    }
}

/// The runs in the form that the method takes.
pub fn borrowed(runs: &[(String, [Vec<f64>; 3])]) -> Vec<rotation::RotationRun<'_>> {
    runs.iter()
        .map(|(label, c)| rotation::RotationRun { label: label.clone(), channels: [&c[0], &c[1], &c[2]] })
        .collect()
}

/// Rotations about polar axes: compensation matrix and bias; the six integrals of a sensor are the data of the bound.
pub fn rotation(trials: usize, seed: u64) -> Tally {
    let session = Session::example();
    rotations("rotation", &session, rotation::RotationAxis::Polar, trials, seed)
}

/// Rotations about vertical axes of unknown heading. Each pair across an axis then holds an unknown, so the bound uses
/// differences and the own-axis windows; the unknown sums are additional parameters.
pub fn rotation_vertical(trials: usize, seed: u64) -> Tally {
    let latitude_deg: f64 = 34.0;
    let (sin, cos) = latitude_deg.to_radians().sin_cos();
    let session =
        Session { earth_rps: (earth::EARTH_RATE_RPS * sin, earth::EARTH_RATE_RPS * cos), ..Session::example() };
    rotations("rotation, vertical", &session, rotation::RotationAxis::Vertical { latitude_deg }, trials, seed)
}

fn rotations(method: &'static str, session: &Session, axis: rotation::RotationAxis, trials: usize, seed: u64) -> Tally {
    let matrix = session.response.try_inverse().unwrap();
    let bias = matrix * session.offset;
    let truth: Vec<f64> = (0..9).map(|k| matrix[(k / 3, k % 3)]).chain(bias.iter().copied()).collect();
    let angle = std::f64::consts::TAU * session.turns;
    // Windows as the method finds them, without noise.
    let quiet = Session { noise: Vector3::zeros(), ..Session { ..*session } };
    let clean = quiet.runs(&mut Dice::new(0));
    let windows = rotation::calibrate(&borrowed(&clean), &session.options(axis)).unwrap().windows;
    let spans: Vec<f64> = windows.iter().map(|w| (w.end - w.start) as f64 / session.rate_hz).collect();
    let spent = matches!(axis, rotation::RotationAxis::Vertical { .. });
    let model = |p: &[f64]| -> Vec<f64> {
        let response = matrix_of(p).try_inverse().unwrap();
        let offset = response * Vector3::new(p[9], p[10], p[11]);
        (0..6)
            .flat_map(|r| {
                let sense = if r % 2 == 0 { 1.0 } else { -1.0 };
                let mut turned = Vector3::zeros();
                turned[r / 2] = sense * angle + session.earth_rps.0 * spans[r];
                let mut integral = response * turned + offset * spans[r];
                if spent {
                    // Unknowns of sensor i and the pair about axis j are the parameters 12 + 3 i + j. Those with i = j
                    // are unused.
                    for i in 0..3 {
                        if i != r / 2 {
                            integral[i] += p[12 + 3 * i + r / 2] * session.response[(i, i)];
                        }
                    }
                }
                integral.iter().copied().collect::<Vec<_>>()
            })
            .collect()
    };
    let sigmas: Vec<f64> = (0..18).map(|k| session.noise[k % 3] * (spans[k / 3] / session.rate_hz).sqrt()).collect();
    let bound = if spent {
        let parameters: Vec<f64> = truth.iter().copied().chain([0.0; 9]).collect();
        let jacobian = derivatives(&parameters, &model);
        let used: Vec<usize> = (0..21).filter(|c| *c < 12 || (*c - 12) / 3 != (*c - 12) % 3).collect();
        let weighted = DMatrix::from_fn(18, used.len(), |r, c| jacobian[(r, used[c])] / sigmas[r]);
        information_to_sd(&weighted)[..12].to_vec()
    } else {
        self::bound(&truth, &sigmas, model)
    };
    Tally::run(method, trials, seed, names("matrix", "bias"), truth, bound, |dice| {
        let runs = session.runs(dice);
        let c = rotation::calibrate(&borrowed(&runs), &session.options(axis)).unwrap();
        estimates(&c.matrix, &c.matrix_sd, &c.bias_rps(), &c.bias_sd_rps, c.coverage_factor())
    })
}

/// Every method, in order: name, simulation.
pub const METHODS: [fn(usize, u64) -> Tally; 7] =
    [six_position, twelve_attitudes, gyro_still, rotation, rotation_vertical, ellipse, ellipsoid];
