//! Stamps with a known truth: the grid, its rate, and the samples that were taken out.

use super::*;

fn one(stamps: &[f64], stated: Option<Stated>) -> Result<Option<ClockRate>, Refusal> {
    check(stamps, std::slice::from_ref(&(0..stamps.len())), stated)
}

fn at(rate_hz: f64, tolerance: f64) -> Option<Stated> {
    Some(Stated { rate_hz, tolerance })
}

/// Normal noise, sum of twelve uniform numbers of a linear congruential generator.
struct Dice(u64);

impl Dice {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

fn rounded(t: f64, digits: i32) -> f64 {
    (t * 10.0_f64.powi(digits)).round() / 10.0_f64.powi(digits)
}

#[track_caller]
fn reads(stamps: &[f64], stated: Option<Stated>, rate_hz: f64) -> ClockRate {
    let rate = one(stamps, stated).unwrap_or_else(|e| panic!("{e}")).expect("a rate");
    assert!((rate.rate_hz - rate_hz).abs() <= 4.0 * rate.rate_u_hz + 1e-12 * rate_hz, "{rate:?}, true {rate_hz}");
    rate
}

#[test]
fn short_records_and_plain_mistakes() {
    let check = |t: &[f64], expected: &str| {
        let said = one(t, at(10.0, 1e-3)).unwrap_err().to_string();
        assert!(said.starts_with(expected), "{said}");
    };
    check(&[0.0, 0.1, 0.2, 0.4, 0.5], "gap at sample 3: step of 0.200000 s, expected 0.100000 s");
    check(&[0.0, 0.1, 0.1], "time does not increase at sample 2: 0.1 s, then 0.1 s");
    check(&[0.0, 0.2, 0.4], "time column says 5.000000 Hz, stated are 10.000000 Hz");
    check(&[0.0, 0.1, f64::NAN], "time: sample 2 is NaN");
    check(&[0.3, 0.2], "time does not increase at sample 1");
    assert_eq!(one(&[0.0, 0.1], None), Ok(None));
    reads(&[0.0, 0.1, 0.21, 0.3], None, 10.0);
}

/// The rate is that of first and last stamp, and its uncertainty covers the truth: rates with jitter and rounding.
#[test]
fn the_rate_is_right_within_its_uncertainty() {
    let mut dice = Dice(7);
    for (rate_hz, n, jitter, digits) in [
        (203.9, 2000, 0.0, 4),
        (100.0, 200, 0.0022, 5),
        (100.0, 12_000, 0.0022, 5),
        (102.4, 6000, 0.001, 3),
        (1000.0, 20_000, 0.0, 3),
        (1600.0, 20_000, 0.0, 3),
        (2000.0, 20_000, 0.0, 3),
        (700.0, 20_000, 0.0, 3),
        (100.003, 60_000, 0.0, 6),
        (100.0, 30_000, 0.0, 0),
    ] {
        let stamps: Vec<f64> =
            (0..n).map(|k| rounded(f64::from(k) / rate_hz + jitter * dice.normal(), digits)).collect();
        let rate = reads(&stamps, at(rate_hz, 10e-6), rate_hz);
        if jitter > 0.0 {
            assert!((rate.jitter_s / jitter - 1.0).abs() < 0.3, "{rate:?}");
        }
    }
}

/// 68.3 % of the intervals hold the truth: 200 records of jittered stamps.
#[test]
fn the_uncertainty_of_the_rate_covers() {
    let mut dice = Dice(11);
    let hits = (0..400)
        .filter(|_| {
            let stamps: Vec<f64> = (0..600).map(|k| f64::from(k) * 0.01 + 0.002 * dice.normal()).collect();
            let rate = one(&stamps, None).unwrap().unwrap();
            (rate.rate_hz - 100.0).abs() < rate.rate_u_hz
        })
        .count();
    assert!((236..=310).contains(&hits), "{hits} of 400");
}

#[test]
fn another_rate_than_stated_is_refused_beyond_the_tolerance() {
    let stamps: Vec<f64> = (0..2000).map(|k| f64::from(k) / 203.9).collect();
    for tolerance in [10e-6, 1e-3, 5e-3] {
        let refusal = one(&stamps, at(200.0, tolerance)).unwrap_err();
        assert!(matches!(refusal, Refusal::RateMismatch { .. }), "{refusal}");
    }
    reads(&stamps, at(200.0, 0.02), 203.9);
    let slow: Vec<f64> = (0..60_000).map(|k| rounded(f64::from(k) / 100.0 * (1.0 + 30e-6), 6)).collect();
    assert!(one(&slow, at(100.0, 10e-6)).is_err());
    reads(&slow, at(100.0, 50e-6), 100.0 / (1.0 + 30e-6));
}

/// Samples are taken out at every place, from clean and jittered stamps and from packets. The check finds the gap at
/// its place.
#[test]
fn lost_samples_are_found_and_late_stamps_are_none() {
    let mut dice = Dice(3);
    for jitter in [0.0, 0.0005, 0.0022] {
        for at in [1, 2, 30, 301, 570, 597] {
            let loses = 3;
            let stamps: Vec<f64> = (0..600)
                .map(|k| f64::from(if k >= at { k + loses } else { k }) * 0.01 + jitter * dice.normal())
                .collect();
            // At the very end of a jittered record a lost sample looks like a late stamp.
            if jitter > 0.001 && !(10..590).contains(&at) {
                continue;
            }
            match one(&stamps, None) {
                Err(Refusal::Gap { index, .. }) => {
                    assert!(index.abs_diff(at as usize) <= usize::from(jitter > 0.0) * 3, "{at}: {index}");
                }
                other => panic!("jitter {jitter}, at {at}: {other:?}"),
            }
        }
    }
    // Single samples are lost from stamps with a fifth of a step of jitter.
    for at in [50, 200, 333, 500] {
        let stamps: Vec<f64> =
            (0..600).map(|k| f64::from(if k >= at { k + 1 } else { k }) * 0.01 + 0.002 * dice.normal()).collect();
        assert!(matches!(one(&stamps, None), Err(Refusal::Gap { .. })), "{at}");
    }
    // A busy host: stamps are late by up to five steps, and the next ones are in time.
    let mut late: Vec<f64> = (0..600).map(|k| f64::from(k) * 0.01).collect();
    for at in [100, 250, 400] {
        late[at] += 0.0151;
        late[at + 1] += 0.006;
    }
    reads(&late, at_any(100.0), 100.0);
    // Every tenth sample is missing.
    let sparse: Vec<f64> = (0..1000).filter(|k| k % 10 != 9).map(|k| 0.000_13 + f64::from(k) * 0.01).collect();
    assert!(matches!(one(&sparse, None), Err(Refusal::Gap { index: 9, .. })), "{:?}", one(&sparse, None));
}

fn at_any(rate_hz: f64) -> Option<Stated> {
    at(rate_hz, 1e-3)
}

/// Eight samples with one stamp, or with stamps some microseconds apart; a packet that is lost leaves a gap.
#[test]
fn packets_are_read_and_a_lost_packet_is_a_gap() {
    let packets = |lost: usize, apart_s: f64| -> Vec<f64> {
        (0..300_usize)
            .filter(|p| *p != lost)
            .flat_map(|p| (0..8).map(move |k| 0.008 * (p + 1) as f64 + apart_s * f64::from(k)))
            .collect()
    };
    for apart_s in [0.0, 10e-6] {
        let rate = reads(&packets(999, apart_s), at(1000.0, 1e-3), 1000.0);
        assert!((rate.samples_per_stamp - 8.0).abs() < 0.01, "{rate:?}");
        match one(&packets(100, apart_s), None) {
            Err(Refusal::Gap { index: 800, .. }) => {}
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn a_change_of_rate_is_found_with_its_row_and_both_rates() {
    let two = |n: usize, at: usize, first: f64, second: f64| -> Vec<f64> {
        (0..n).map(|k| k.min(at) as f64 / first + k.saturating_sub(at) as f64 / second).collect()
    };
    for (n, at, first, second) in [
        (6000, 100, 100.0, 1000.0),
        (6000, 5900, 100.0, 1000.0),
        (6000, 3000, 100.0, 101.0),
        (6000, 1000, 200.0, 100.0),
        (60_000, 30_000, 100.0, 100.5),
    ] {
        match one(&two(n, at, first, second), None) {
            Err(Refusal::RateChanges { row, before_hz, after_hz }) => {
                assert!(row.abs_diff(at + 1) <= 8, "{row} for {at}");
                assert!((before_hz / first - 1.0).abs() < 2e-3 && (after_hz / second - 1.0).abs() < 2e-3);
            }
            other => panic!("{first} to {second} at {at}: {other:?}"),
        }
    }
    // Blocks with different rates.
    let stamps: Vec<f64> =
        (0..200).map(|k| f64::from(k) * 0.01).chain((0..200).map(|k| f64::from(k) * 0.011)).collect();
    let refusal = check(&stamps, &[0..200, 200..400], None).unwrap_err();
    assert!(matches!(refusal, Refusal::RateChanges { row: 201, .. }), "{refusal}");
    assert!(check(&stamps[..200], &[0..100, 100..200], None).unwrap().is_some());
}

#[test]
fn a_counter_that_starts_again_is_named() {
    let stamps: Vec<f64> = (0..9000).map(|k| f64::from((k * 10) % 65_536) * 1e-3).collect();
    let refusal = one(&stamps, None).unwrap_err();
    assert!(matches!(refusal, Refusal::NotMonotonic { index: 6554, .. }), "{refusal}");
    assert!(refusal.hint().contains("counter"), "{}", refusal.hint());
}

#[test]
fn stamps_that_prove_nothing_are_refused() {
    let mut dice = Dice(5);
    let stamps: Vec<f64> = (0..100).map(|k| f64::from(k) * 0.01 + 0.02 * dice.normal()).collect();
    assert!(one(&stamps, None).is_err());
}
