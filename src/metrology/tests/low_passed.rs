//! Clean records behind a low-pass are accepted: means of such noise scatter by more than neighbouring rows show.
//! Records with motion are refused.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may end with a panic and says what it saw")]

#[path = "truth/truth.rs"]
mod truth;

use gnc_metrology::earth::EARTH_RATE_RPS;
use gnc_metrology::position::{LABELS, Limits, from_labels, up_of};
use gnc_metrology::rotation::{self, RotationAxis};
use gnc_metrology::{Refusal, tilt};
use truth::{Dice, Session, borrowed};

/// Noise of this standard deviation behind poles at a part of the rate.
fn noise(rows: usize, part: f64, poles: usize, sd: f64, dice: &mut Dice) -> Vec<f64> {
    const BEFORE: usize = 200;
    let decay = (-std::f64::consts::TAU * part).exp();
    let mut values: Vec<f64> = (0..rows + BEFORE).map(|_| dice.normal()).collect();
    for _ in 0..poles {
        low_pass(&mut values, decay);
    }
    let values = &values[BEFORE..];
    let root_mean_square = (values.iter().map(|v| v * v).sum::<f64>() / rows as f64).sqrt();
    values.iter().map(|v| v * sd / root_mean_square).collect()
}

fn low_pass(values: &mut [f64], decay: f64) {
    let mut state = values[0];
    for value in values {
        state = decay * state + (1.0 - decay) * *value;
        *value = state;
    }
}

/// Part of the rate at which the poles lie, poles, rows of a position, noise in mg.
const SENSORS: [(f64, usize, usize, f64); 5] =
    [(0.25, 2, 500, 3.7), (0.25, 2, 1000, 6.0), (0.1, 1, 500, 4.0), (0.1, 2, 2000, 10.0), (0.25, 1, 2000, 10.0)];

/// Six positions of 16384 LSB per g. `moves` is added to channel x of the first position.
fn six(
    (part, poles, rows, mg): (f64, usize, usize, f64),
    moves: &dyn Fn(f64) -> f64,
    seed: u64,
) -> Result<(), Refusal> {
    let mut dice = Dice::new(seed);
    let labels: Vec<&str> = LABELS.into_iter().flat_map(|label| vec![label; rows]).collect();
    let mut channels: [Vec<f64>; 3] = Default::default();
    for label in LABELS {
        for (i, channel) in channels.iter_mut().enumerate() {
            let noise = noise(rows, part, poles, mg * 16.384, &mut dice);
            channel.extend(noise.iter().map(|v| (16384.0 * up_of(label).unwrap()[i] + v).round()));
        }
    }
    for (row, value) in channels[0].iter_mut().take(rows).enumerate() {
        *value += moves(row as f64 / rows as f64).round();
    }
    let [x, y, z] = &channels;
    from_labels(&labels, [x, y, z], &Limits::ACCELEROMETER).map(drop)
}

/// Of a thousand clean positions behind a low-pass no position moves. Of white noise 6 in 10 000 are beyond six
/// standard errors.
#[test]
fn positions_behind_a_low_pass_are_still() {
    for sensor in SENSORS {
        let refused: Vec<Refusal> = (0..25).filter_map(|seed| six(sensor, &|_| 0.0, seed).err()).collect();
        assert!(refused.len() <= 1, "{sensor:?}: {} of 25, {:?}", refused.len(), refused.first());
        let (part, poles, rows, mg) = sensor;
        let flips = (0..25).filter(|seed| {
            let mut dice = Dice::new(100 + seed);
            let side = |level: f64, dice: &mut Dice| -> Vec<f64> {
                noise(rows, part, poles, mg * 16.384, dice).iter().map(|v| (level + v).round()).collect()
            };
            let values = [side(16384.0, &mut dice), side(-16384.0, &mut dice)].concat();
            let labels: Vec<&str> = (0..2 * rows).map(|row| if row < rows { "+" } else { "-" }).collect();
            tilt::flip_rows(&labels, &values, 1.0).is_err()
        });
        assert!(flips.count() <= 1, "{sensor:?}: flips");
    }
}

/// Offset and gain of a flip whose rows are correlated.
#[test]
fn intervals_of_flips_hold_behind_a_low_pass() {
    const RECORDS: u64 = 400;
    const LEVEL: f64 = 16384.0;
    for (part, poles, rows) in [(0.05, 1, 1000), (0.1, 1, 500), (0.1, 2, 1000), (0.25, 2, 500), (10.0, 1, 500)] {
        let (mut held, mut given) = ([0; 2], 0);
        for seed in 0..RECORDS {
            // The deviation of the noise is that of all records, not of this one. A record scaled to its own deviation
            // has no deviation left to vary.
            let mut dice = Dice::new(seed);
            let all = noise(4 * rows, part, poles, 60.0, &mut dice);
            let of_side = |side: f64, from: usize| all[from..from + rows].iter().map(move |v| side * LEVEL + v);
            let values: Vec<f64> = of_side(1.0, 0).chain(of_side(-1.0, 3 * rows)).collect();
            let labels: Vec<&str> = (0..2 * rows).map(|row| if row < rows { "+" } else { "-" }).collect();
            let Ok(found) = tilt::flip_rows(&labels, &values, 1.0) else { continue };
            given += 1;
            held[0] += u64::from(found.offset.abs() <= 1.96 * found.offset_sd);
            held[1] += u64::from((found.gain - LEVEL).abs() <= 1.96 * found.gain_sd);
        }
        println!("{part} of the rate, {poles} poles, {rows} rows: {held:?} of {given}");
        assert!(given * 100 >= 98 * RECORDS, "{part} of the rate, {poles} poles: {given} of {RECORDS} are not refused");
        // 3.9 standard errors below 95 %.
        assert!(
            held.iter().all(|held| *held * 1000 >= 907 * given),
            "{part} of the rate, {poles} poles: {held:?} of {given}"
        );
    }
}

/// A step in the middle, a settling table and a swing of one period, by 10 mrad: five times the limit of 2 mrad and beyond six
/// standard errors of a block mean behind the low-pass.
#[test]
fn positions_that_move_behind_a_low_pass_are_refused() {
    let moves: [&dyn Fn(f64) -> f64; 3] =
        [&|part| if part < 0.5 { 0.0 } else { 164.0 }, &|part| 164.0 * part, &|part| {
            82.0 * (std::f64::consts::TAU * part).sin()
        }];
    for sensor in [(0.25, 2, 500, 3.7), (0.1, 1, 2000, 4.0)] {
        for (how, moves) in moves.into_iter().enumerate() {
            for seed in 0..10 {
                let refusal = six(sensor, moves, seed).unwrap_err();
                assert!(matches!(refusal, Refusal::Moved { channel: "x", .. }), "{sensor:?} {how}: {refusal}");
            }
        }
    }
}

/// Rotations of sensors behind a low-pass, with noise at rest of 5 mrad/s.
fn rotation_runs(part: f64, seed: u64) -> Vec<(String, [Vec<f64>; 3])> {
    runs_of(Session::example(), part, seed)
}

fn runs_of(mut session: Session, part: f64, seed: u64) -> Vec<(String, [Vec<f64>; 3])> {
    let sd = session.noise * 5.0;
    session.noise *= 0.0;
    let mut dice = Dice::new(seed);
    let mut runs = session.runs(&mut dice);
    for (_, channels) in &mut runs {
        for (i, channel) in channels.iter_mut().enumerate() {
            low_pass(channel, (-std::f64::consts::TAU * part).exp());
            let noise = noise(channel.len(), part, 1, sd[i], &mut dice);
            channel.iter_mut().zip(noise).for_each(|(value, noise)| *value += noise);
        }
    }
    runs
}

#[test]
fn rotations_behind_a_low_pass_rest() {
    let options = Session::example().options(RotationAxis::Polar);
    for part in [0.1, 0.2, 0.4] {
        for seed in 0..20 {
            let runs = rotation_runs(part, seed);
            let found = rotation::calibrate(&borrowed(&runs), &options);
            assert!(found.is_ok(), "{part} of the rate, seed {seed}: {}", found.unwrap_err());
        }
        let mut runs = rotation_runs(part, 1);
        runs[0].1[2][850..880].iter_mut().for_each(|v| *v += 300.0);
        let refusal = rotation::calibrate(&borrowed(&runs), &options).unwrap_err().to_string();
        assert!(refusal.contains("run x+ moves outside its rotation: z deviates"), "{refusal}");
    }
}

/// With a vertical axis no residual is left that shows the noise of the integrals. The noise comes from the rest.
#[test]
fn intervals_of_vertical_rotations_hold_behind_a_low_pass() {
    const SESSIONS: usize = 300;
    let latitude_deg: f64 = 34.0;
    let (sin, cos) = latitude_deg.to_radians().sin_cos();
    let session = || Session { earth_rps: (EARTH_RATE_RPS * sin, EARTH_RATE_RPS * cos), ..Session::example() };
    let matrix = session().response.try_inverse().unwrap();
    let options = session().options(RotationAxis::Vertical { latitude_deg });
    for part in [0.05, 0.1, 0.2, 0.4, 10.0] {
        let (mut held, mut given) = ([0; 9], 0);
        for seed in 0..SESSIONS {
            let runs = runs_of(session(), part, seed as u64);
            let Ok(found) = rotation::calibrate(&borrowed(&runs), &options) else { continue };
            given += 1;
            for (held, k) in held.iter_mut().zip(0..) {
                let expanded = found.coverage_factor() * found.matrix_sd[(k / 3, k % 3)];
                *held += usize::from((found.matrix[(k / 3, k % 3)] - matrix[(k / 3, k % 3)]).abs() <= expanded);
            }
        }
        println!("{part} of the rate: {held:?} of {given}");
        assert!(given * 100 >= SESSIONS * 98, "{part} of the rate: {given} of {SESSIONS} are not refused");
        // 3.9 standard errors below 95 %.
        let given = given as f64;
        let least = (0.95 - 3.9 * (0.0475 / given).sqrt()) * given;
        assert!(held.iter().all(|held| *held as f64 >= least), "{part} of the rate: {held:?} of {given}");
    }
}
