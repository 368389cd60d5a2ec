//! Records of a still sensor whose noise is known, and how often the intervals of its Allan deviations hold the truth.
//!
//! Everything follows from the autocovariance of each part, which is written down independently of the code under test.

use gnc_metrology::allan::{Analysis, Coefficient, DeviationKind, Input, MissingCoefficient, Taus, analyse};
use gnc_metrology::stats::ONE_SIGMA;

use super::{Dice, chi_square};

/// A low-pass of the white noise, with its corner as a part of the rate.
#[derive(Clone, Copy)]
pub enum LowPass {
    None,
    /// Continuous, first order, sampled.
    First(f64),
    /// Continuous Butterworth of the second order, sampled.
    Second(f64),
    /// Digital (bilinear), first order.
    DigitalFirst(f64),
    /// Digital (bilinear) Butterworth of the second order.
    DigitalSecond(f64),
    /// Each sample of the sensor is read this many times.
    Held(usize),
}

/// A still sensor.
#[derive(Clone, Copy)]
pub struct Sensor {
    pub name: &'static str,
    pub rate_hz: f64,
    pub samples: usize,
    /// Coefficient N before the filter, which has a gain of 1.
    pub n: f64,
    pub low_pass: LowPass,
    pub b: f64,
    pub k: f64,
    /// A bias that wanders within bounds (Gauss-Markov): standard deviation, correlation time in s.
    pub wander: (f64, f64),
    /// Frequency in Hz and amplitude of the line.
    pub line: (f64, f64),
}

/// Lags after which the memory of a low-pass of 5 % of the rate is over.
const MEMORY: usize = 400;
const RELAXATIONS: f64 = 2.0;

impl Sensor {
    pub const WHITE: Self = Self {
        name: "white",
        rate_hz: 100.0,
        samples: 20_000,
        n: 0.1,
        low_pass: LowPass::None,
        b: 0.0,
        k: 0.0,
        wander: (0.0, 1.0),
        line: (0.0, 0.0),
    };

    /// Variance of a sample without a filter.
    fn variance(&self) -> f64 {
        self.n * self.n * self.rate_hz
    }

    /// Digital filter `(b0, b1, b2, a1, a2)`.
    fn digital(&self) -> [f64; 5] {
        match self.low_pass {
            LowPass::DigitalFirst(corner) => {
                let w = (std::f64::consts::PI * corner).tan();
                [w / (1.0 + w), w / (1.0 + w), 0.0, (w - 1.0) / (1.0 + w), 0.0]
            }
            LowPass::DigitalSecond(corner) => {
                let w = (std::f64::consts::PI * corner).tan();
                let d = 1.0 + 2.0_f64.sqrt() * w + w * w;
                let b = w * w / d;
                [b, 2.0 * b, b, 2.0 * (w * w - 1.0) / d, (1.0 - 2.0_f64.sqrt() * w + w * w) / d]
            }
            _ => [1.0, 0.0, 0.0, 0.0, 0.0],
        }
    }

    /// Autocovariance of the filtered white noise.
    fn memory(&self) -> Vec<f64> {
        let v = self.variance();
        let tau = std::f64::consts::TAU;
        let lags = (0..MEMORY).map(|k| k as f64);
        match self.low_pass {
            LowPass::First(corner) => {
                let a = (-tau * corner).exp();
                lags.map(|k| v * (1.0 - a) / (1.0 + a) * a.powf(k)).collect()
            }
            LowPass::Second(corner) => {
                let l = tau * corner / 2.0_f64.sqrt();
                lags.map(|k| v * l / 2.0 * (-l * k).exp() * ((l * k).cos() + (l * k).sin())).collect()
            }
            LowPass::Held(times) => lags.map(|k| v / times as f64 * (1.0 - k / times as f64).max(0.0)).collect(),
            _ => {
                let [b0, b1, b2, a1, a2] = self.digital();
                let mut h = Vec::with_capacity(MEMORY);
                for i in 0..MEMORY {
                    let at = |back: usize, h: &Vec<f64>| i.checked_sub(back).map_or(0.0, |j| h[j]);
                    let pulse = [b0, b1, b2].get(i).copied().unwrap_or(0.0);
                    h.push(pulse - a1 * at(1, &h) - a2 * at(2, &h));
                }
                (0..MEMORY).map(|k| v * h.iter().zip(&h[k..]).map(|(a, b)| a * b).sum::<f64>()).collect()
            }
        }
    }

    /// N of the white level at low frequencies, including the part that sampling folds there.
    pub fn n_true(&self) -> f64 {
        let r = self.memory();
        ((r[0] + 2.0 * r[1..].iter().sum::<f64>()) / self.rate_hz).sqrt()
    }

    /// Relaxations: coefficient from sample to sample and variance. One is the wander, the others make the flicker.
    /// IEEE Std 952 defines B by the two-sided density `B^2 / (2 pi f)`, which is one-sided `B^2 / (pi f)`. A
    /// relaxation of variance v and corner c has the one-sided density `(2 v / pi) c / (c^2 + f^2)`. Relaxations in
    /// each octave add up to `v / (f ln 2)`, so v is `B^2 ln 2 / pi`. Their corners reach from far below one over the
    /// record to half the rate. The last relaxation counts half (faster ones would fold as white noise into N). So the
    /// flat part is right within 1 % up to T/4, and within 0.1 % up to T/64.
    fn relaxations(&self) -> Vec<(f64, f64)> {
        let (sd, correlation_s) = self.wander;
        let mut all = vec![((-1.0 / (self.rate_hz * correlation_s)).exp(), sd * sd)];
        all.retain(|(_, variance)| *variance > 0.0);
        if self.b == 0.0 {
            return all;
        }
        let variance = self.b * self.b * RELAXATIONS.ln() / std::f64::consts::PI;
        let octaves = (32.0 * self.samples as f64).log2() as i32;
        let part = |o: i32| if o == -1 { variance / 2.0 } else { variance };
        all.extend((-octaves..0).map(|o| ((-std::f64::consts::TAU * RELAXATIONS.powi(o)).exp(), part(o))));
        all
    }

    /// Variance of the sum of m samples without the line (for a walk, without a part that no difference of means
    /// shows).
    fn of_sum(&self) -> impl Fn(usize) -> f64 {
        let (r, relaxations) = (self.memory(), self.relaxations());
        let step = self.k * self.k / self.rate_hz;
        move |m: usize| {
            let mf = m as f64;
            let short: f64 =
                mf * r[0] + 2.0 * r.iter().enumerate().take(m).skip(1).map(|(k, r)| (mf - k as f64) * r).sum::<f64>();
            let slow: f64 = relaxations
                .iter()
                .map(|(a, v)| {
                    let e = 1.0 - a;
                    // The closed form cancels where the relaxation is slow. There the sum is taken term by term.
                    if e * mf > 1e-2 {
                        v * (mf * (1.0 + a) / e - 2.0 * a * (1.0 - a.powf(mf)) / (e * e))
                    } else {
                        v * (mf * mf - e * mf * (mf * mf - 1.0) / 3.0 + e * e * mf.powi(4) / 12.0)
                    }
                })
                .sum();
            short + slow - step * mf * (mf * mf - 1.0) / 6.0
        }
    }

    /// Expected square of the Allan deviation at m samples.
    pub fn square(&self, m: usize) -> f64 {
        let (of_sum, mf) = (self.of_sum(), m as f64);
        let x = std::f64::consts::PI * self.line.0 / self.rate_hz;
        let line =
            if self.line.1 == 0.0 { 0.0 } else { (self.line.1 / (mf * x.sin())).powi(2) * (x * mf).sin().powi(4) };
        (4.0 * of_sum(m) - of_sum(2 * m)) / (2.0 * mf * mf) + line
    }

    pub fn record(&self, dice: &mut Dice) -> Vec<f64> {
        let mut white = self.filtered(dice);
        let relaxations: Vec<(f64, f64)> =
            self.relaxations().iter().map(|(a, v)| (*a, (v * (1.0 - a * a)).sqrt())).collect();
        let mut states: Vec<f64> = self.relaxations().iter().map(|(_, v)| v.sqrt() * dice.normal()).collect();
        let (mut walk, phase) = (0.0, dice.normal() * 10.0);
        for (i, value) in white.iter_mut().enumerate() {
            for ((a, step), state) in relaxations.iter().zip(&mut states) {
                *state = a * *state + step * dice.normal();
                *value += *state;
            }
            if self.k > 0.0 {
                walk += self.k / self.rate_hz.sqrt() * dice.normal();
                *value += walk;
            }
            *value += self.line.1 * (std::f64::consts::TAU * self.line.0 * i as f64 / self.rate_hz + phase).sin();
        }
        white
    }

    fn filtered(&self, dice: &mut Dice) -> Vec<f64> {
        let sd = self.variance().sqrt();
        let tau = std::f64::consts::TAU;
        let mut values: Vec<f64> = match self.low_pass {
            LowPass::First(corner) => {
                let a = (-tau * corner).exp();
                let mut state = 0.0;
                let step = |_| {
                    state = a * state + (1.0 - a) * sd * dice.normal();
                    state
                };
                (0..self.samples + MEMORY).map(step).collect()
            }
            LowPass::Second(corner) => {
                // Position and speed of the filter, with the covariance that a step adds.
                let (w, l) = (tau * corner, tau * corner / 2.0_f64.sqrt());
                let (e, c, s) = ((-l).exp(), l.cos(), l.sin());
                let f = [[e * (c + s), e * s / l], [-e * w * w * s / l, e * (c - s)]];
                let p = [sd * sd * l / 2.0, sd * sd * l / 2.0 * w * w];
                let q = |i: usize, j: usize| {
                    (if i == j { p[i] } else { 0.0 }) - (0..2).map(|k| f[i][k] * p[k] * f[j][k]).sum::<f64>()
                };
                let (a, b) = (q(0, 0).sqrt(), q(0, 1) / q(0, 0).sqrt());
                let d = (q(1, 1) - b * b).sqrt();
                let mut x = [0.0, 0.0];
                let step = |_| {
                    let (one, two) = (dice.normal(), dice.normal());
                    x = [
                        f[0][0] * x[0] + f[0][1] * x[1] + a * one,
                        f[1][0] * x[0] + f[1][1] * x[1] + b * one + d * two,
                    ];
                    x[0]
                };
                (0..self.samples + MEMORY).map(step).collect()
            }
            LowPass::Held(times) => {
                let offset = (dice.normal().abs() * 1e6) as usize % times;
                let mut held = 0.0;
                // A held sample of the sensor's own rate has the variance of that rate.
                let step = |i: usize| {
                    if i == 0 || (i + offset).is_multiple_of(times) {
                        held = sd / (times as f64).sqrt() * dice.normal();
                    }
                    held
                };
                (0..self.samples + MEMORY).map(step).collect()
            }
            _ => {
                let [b0, b1, b2, a1, a2] = self.digital();
                let (mut s1, mut s2) = (0.0, 0.0);
                let step = |_| {
                    let x = sd * dice.normal();
                    let y = b0 * x + s1;
                    s1 = b1 * x - a1 * y + s2;
                    s2 = b2 * x - a2 * y;
                    y
                };
                (0..self.samples + MEMORY).map(step).collect()
            }
        };
        values.drain(..MEMORY);
        values
    }
}

/// How often the intervals of many records held the truth.
pub struct Coverage {
    pub sensor: Sensor,
    pub records: usize,
    pub n_given: usize,
    pub n_covered: usize,
    pub b_given: usize,
    pub b_covered: usize,
    pub above_bound: usize,
    pub holds: usize,
    pub contradicted: usize,
    /// Mean half width of the interval of N, relative.
    pub n_width: f64,
    /// Mean relative error of N.
    pub n_bias: f64,
    pub plateaus: usize,
    pub plateau_covered: usize,
    /// Averaging time in samples, and how often its interval held the truth.
    pub points: Vec<(usize, usize)>,
}

impl Coverage {
    pub fn run(sensor: &Sensor, records: usize, seed: u64) -> Self {
        let mut dice = Dice::new(seed);
        let holds = |c: &Coefficient, truth: f64| (c.low..=c.high).contains(&truth);
        let (n, b) = (sensor.n_true(), sensor.b);
        let factors: Vec<usize> = (0..24).map(|k| 1 << k).take_while(|m| m * 4 <= sensor.samples).collect();
        let truths: Vec<f64> = factors.iter().map(|m| sensor.square(*m).sqrt()).collect();
        let mut c = Self {
            sensor: *sensor,
            records,
            n_given: 0,
            n_covered: 0,
            b_given: 0,
            b_covered: 0,
            above_bound: 0,
            holds: 0,
            contradicted: 0,
            n_width: 0.0,
            n_bias: 0.0,
            plateaus: 0,
            plateau_covered: 0,
            points: factors.iter().map(|m| (*m, 0)).collect(),
        };
        for _ in 0..records {
            let values = sensor.record(&mut dice);
            let a: Analysis =
                analyse(&values, Input::Rate, sensor.rate_hz, DeviationKind::Oadev, &Taus::Octave, 1).unwrap();
            if let Ok(found) = &a.coefficients.n {
                c.n_given += 1;
                c.n_covered += usize::from(holds(found, n));
                c.n_width += (found.high - found.low) / 2.0 / n;
                c.n_bias += found.value / n - 1.0;
            }
            if let Ok(found) = &a.coefficients.b {
                c.b_given += 1;
                c.b_covered += usize::from(holds(found, b));
                c.above_bound += usize::from(a.coefficients.b_upper_bound.is_none_or(|bound| found.value > bound));
            }
            c.holds += usize::from(a.fit.as_ref().is_some_and(|f| f.holds));
            c.contradicted += usize::from(matches!(a.coefficients.n, Err(MissingCoefficient::Contradicted { .. })));
            if let Some(plateau) = a.plateau {
                c.plateaus += 1;
                c.plateau_covered += usize::from(holds(&plateau.n(), n));
            }
            for ((p, truth), (_, covered)) in a.points.iter().zip(&truths).zip(&mut c.points) {
                *covered += usize::from((p.low..=p.high).contains(truth));
            }
        }
        c.n_width /= c.n_given.max(1) as f64;
        c.n_bias /= c.n_given.max(1) as f64;
        c
    }

    pub fn line(&self) -> String {
        let share = |n: usize, of: usize| 100.0 * n as f64 / of.max(1) as f64;
        let points: Vec<String> =
            self.points.iter().map(|(_, covered)| format!("{:.0}", share(*covered, self.records))).collect();
        format!(
            "{:<34} holds {:>5.1} % | N given {:>5.1} %, covered {:>5.1} %, +-{:.2} %, bias {:+.2} % | B given {:>5.1} %, covered \
             {:>5.1} %, above bound {} | plateau {:>5.1} %, covered {:>5.1} %, contradicts {} | points {}",
            self.sensor.name,
            share(self.holds, self.records),
            share(self.n_given, self.records),
            share(self.n_covered, self.n_given),
            100.0 * self.n_width,
            100.0 * self.n_bias,
            share(self.b_given, self.records),
            share(self.b_covered, self.b_given),
            self.above_bound,
            share(self.plateaus, self.records),
            share(self.plateau_covered, self.plateaus),
            self.contradicted,
            points.join(" ")
        )
    }

    /// Returns the bounds that are broken: each share within 3.9 standard errors of 68.3 % (for a deviation, of the
    /// coverage of a chi-square of the exact degrees of freedom), N in every record, B never above its bound.
    pub fn failures(&self) -> Vec<String> {
        let mut failures = Vec::new();
        let mut check = |what: String, covered: usize, of: usize, expected: f64| {
            let bound = 3.9 * (expected * (1.0 - expected) / of as f64).sqrt();
            let share = covered as f64 / of as f64;
            if of >= 100 && (share - expected).abs() > bound {
                failures.push(format!(
                    "{} {what}: {:.1} % of {of}, bound {:.1} +-{:.1} %",
                    self.sensor.name,
                    100.0 * share,
                    100.0 * expected,
                    100.0 * bound
                ));
            }
        };
        check("N".into(), self.n_covered, self.n_given, ONE_SIGMA);
        check("B".into(), self.b_covered, self.b_given, ONE_SIGMA);
        // Held samples are not stationary, so that no spectrum shows their scatter within the hold.
        let shortest = if let LowPass::Held(times) = self.sensor.low_pass { 2 * times } else { 1 };
        let of_sum = self.sensor.of_sum();
        for (m, covered) in self.points.iter().filter(|(m, _)| *m >= shortest) {
            let expected = chi_square::coverage(&of_sum, self.sensor.samples, *m);
            check(format!("deviation at {m} samples"), *covered, self.records, expected);
        }
        if self.n_given * 100 < self.records * 97 {
            failures.push(format!("{}: N given in {} of {} records", self.sensor.name, self.n_given, self.records));
        }
        if self.above_bound > 0 {
            failures.push(format!("{}: B above its bound in {} records", self.sensor.name, self.above_bound));
        }
        failures
    }
}

/// Sensors of every kind.
pub const SENSORS: &[Sensor] = &[
    Sensor::WHITE,
    Sensor { name: "white, 600 samples at 1 Hz", samples: 600, rate_hz: 1.0, ..Sensor::WHITE },
    Sensor { name: "first order, 10 %", low_pass: LowPass::First(0.10), ..Sensor::WHITE },
    Sensor { name: "first order, 25 %", low_pass: LowPass::First(0.25), ..Sensor::WHITE },
    Sensor { name: "first order, 40 %", low_pass: LowPass::First(0.40), ..Sensor::WHITE },
    Sensor { name: "second order, 10 %", low_pass: LowPass::Second(0.10), ..Sensor::WHITE },
    Sensor { name: "second order, 15 %", low_pass: LowPass::Second(0.15), ..Sensor::WHITE },
    Sensor { name: "second order, 20 %", low_pass: LowPass::Second(0.20), ..Sensor::WHITE },
    Sensor { name: "second order, 25 %", low_pass: LowPass::Second(0.25), ..Sensor::WHITE },
    Sensor { name: "second order, 40 %", low_pass: LowPass::Second(0.40), ..Sensor::WHITE },
    Sensor { name: "digital first order, 10 %", low_pass: LowPass::DigitalFirst(0.10), ..Sensor::WHITE },
    Sensor { name: "digital first order, 40 %", low_pass: LowPass::DigitalFirst(0.40), ..Sensor::WHITE },
    Sensor { name: "digital second order, 10 %", low_pass: LowPass::DigitalSecond(0.10), ..Sensor::WHITE },
    Sensor { name: "digital second order, 15 %", low_pass: LowPass::DigitalSecond(0.15), ..Sensor::WHITE },
    Sensor { name: "digital second order, 40 %", low_pass: LowPass::DigitalSecond(0.40), ..Sensor::WHITE },
    Sensor { name: "each sample read twice", low_pass: LowPass::Held(2), ..Sensor::WHITE },
    Sensor { name: "white and flicker", b: 0.05, ..Sensor::WHITE },
    Sensor { name: "white and weak flicker", b: 0.012, ..Sensor::WHITE },
    Sensor { name: "white and walk", k: 0.01, ..Sensor::WHITE },
    Sensor { name: "white and wander", wander: (0.2, 2.0), ..Sensor::WHITE },
    Sensor { name: "second order, wander", low_pass: LowPass::Second(0.20), wander: (0.1, 1.0), ..Sensor::WHITE },
    Sensor { name: "white and line", line: (23.0, 0.3), ..Sensor::WHITE },
    Sensor { name: "white and strong line", line: (7.3, 100.0), ..Sensor::WHITE },
    Sensor { name: "first order, flicker", low_pass: LowPass::First(0.25), b: 0.05, ..Sensor::WHITE },
    Sensor { name: "second order, walk", low_pass: LowPass::Second(0.20), k: 0.01, ..Sensor::WHITE },
    Sensor {
        name: "second order, flicker, walk, line",
        low_pass: LowPass::DigitalSecond(0.20),
        b: 0.03,
        k: 0.003,
        line: (12.5, 0.2),
        ..Sensor::WHITE
    },
    Sensor { name: "second order 20 %, 600 samples", samples: 600, low_pass: LowPass::Second(0.20), ..Sensor::WHITE },
    Sensor { name: "white, one hour", samples: 360_000, ..Sensor::WHITE },
    Sensor { name: "first order 25 %, one hour", samples: 360_000, low_pass: LowPass::First(0.25), ..Sensor::WHITE },
    Sensor { name: "first order 25 %, 3000 samples", samples: 3000, low_pass: LowPass::First(0.25), ..Sensor::WHITE },
];
