//! Checks of a record before anything is computed from it.

use std::ops::Range;

use crate::{Refusal, quantisation, stats};

/// Checks that all values are finite.
///
/// # Errors
/// [`Refusal::NotFinite`] with the first such value.
pub fn finite(channel: &str, values: &[f64]) -> Result<(), Refusal> {
    // A block has no early end, so that the compiler can use vectors.
    if values.chunks(1024).all(|block| block.iter().fold(true, |all, v| all & v.is_finite())) {
        return Ok(());
    }
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(Refusal::NotFinite { channel: channel.to_owned(), index, value: values[index] }),
        None => Ok(()),
    }
}

/// Checks that all channels have one length and finite values. Returns the length.
///
/// # Errors
/// [`Refusal::Lengths`], [`Refusal::NotFinite`].
pub fn channels(names: &[&str], channels: &[&[f64]]) -> Result<usize, Refusal> {
    let left = channels.first().map_or(0, |c| c.len());
    for (name, values) in names.iter().zip(channels) {
        if values.len() != left {
            return Err(Refusal::Lengths { left, right: values.len() });
        }
        finite(name, values)?;
    }
    Ok(left)
}

/// Divides rows into stretches, in order. Within a stretch each row is the same as the row before it.
pub fn stretches(rows: usize, same: impl Fn(usize, usize) -> bool) -> Vec<Range<usize>> {
    let mut stretches = Vec::new();
    let mut start = 0;
    for row in 1..=rows {
        if row == rows || !same(row - 1, row) {
            stretches.push(start..row);
            start = row;
        }
    }
    stretches
}

/// Checks that a parameter is finite and above zero. Returns it.
///
/// # Errors
/// [`Refusal::Parameter`].
pub fn positive(name: &'static str, value: f64) -> Result<f64, Refusal> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(Refusal::Parameter { name, value, expected: "a finite number above 0" })
}

/// Checks that no value reaches a stated limit, and that the record does not look cut off. A curve that is cut off
/// shows its extreme far more often than the value next to it; a curve that turns there does not (2.4 times, for a fine
/// sine in whole codes).
///
/// # Errors
/// [`Refusal::Saturated`].
pub fn unsaturated(channel: &str, values: &[f64], limit: Option<f64>) -> Result<(), Refusal> {
    const REPEATS: usize = 20;
    const RATIO: usize = 6;
    const FINE: f64 = 0.2;
    let refuse = |value, samples| Err(Refusal::Saturated { channel: channel.to_owned(), value, samples });
    if let Some(limit) = limit {
        let samples = values.iter().filter(|v| v.abs() >= limit).count();
        return if samples > 0 { refuse(limit, samples) } else { Ok(()) };
    }
    let (low, high) = stats::range(values);
    for (extreme, inside) in [(high, 1.0), (low, -1.0)] {
        let at_extreme = values.iter().map(|v| usize::from(*v == extreme)).sum::<usize>();
        if at_extreme < REPEATS || at_extreme == values.len() {
            continue;
        }
        let next =
            values.iter().map(|v| inside * v).filter(|v| *v < inside * extreme).fold(f64::NEG_INFINITY, f64::max);
        let at_next = values.iter().filter(|v| inside * **v == next).count();
        // Where the noise is about a code, the extreme may be the usual value. A record that is cut off has many codes
        // below it.
        if at_extreme > RATIO * at_next && (inside * extreme - next) < FINE * stats::mean_sd(values).1 {
            return refuse(extreme, at_extreme);
        }
    }
    Ok(())
}

/// Checks that no plateau of a record that begins at rest stands still at the extreme while the record is noisy
/// elsewhere. A rotation that is cut off at the end of the range shows the same value sample after sample. A rotation
/// inside the range shows the noise of the rests, which the caller gives. Noise below the steps of the output may also
/// show one value on a plateau.
///
/// # Errors
/// [`Refusal::Saturated`].
pub fn unclipped(channel: &str, values: &[f64], rests: &[&[f64]]) -> Result<(), Refusal> {
    const PLATEAU: usize = 20;
    const RATIO: usize = 4;
    let (low, high) = stats::range(values);
    for extreme in [high, low].into_iter().filter(|e| (e - values[0]).abs() > 0.5 * (high - low)) {
        let (mut at_extreme, mut elsewhere) = (0, 0);
        for stretch in values.chunk_by(|a, b| a == b) {
            let longest = if stretch[0] == extreme { &mut at_extreme } else { &mut elsewhere };
            *longest = stretch.len().max(*longest);
        }
        let is_plateau = at_extreme >= PLATEAU && at_extreme > RATIO * elsewhere && at_extreme < values.len();
        if is_plateau && quantisation::is_stuck(rests, at_extreme) {
            let samples = values.iter().filter(|v| **v == extreme).count();
            return Err(Refusal::Saturated { channel: channel.to_owned(), value: extreme, samples });
        }
    }
    Ok(())
}

/// Checks that counts of a signed sensor were written with their sign. Without the sign a level near 0 lies at both
/// ends of the range and never between, and both parts join where the range ends: 65535 is next to 0.
///
/// # Errors
/// [`Refusal::Unsigned`].
pub fn signed(channel: &str, values: &[f64]) -> Result<(), Refusal> {
    const BITS: [u32; 5] = [8, 12, 16, 24, 32];
    /// Part of the range above which a count lies at its upper end.
    const WRAPPED: f64 = 0.75;
    /// Least number of different words on either side, or the least part of the rows. Failed reads are one word, and
    /// never so many.
    const WORDS: usize = 3;
    const MANY: f64 = 0.1;
    /// Codes by which the parts may lie apart, and the same as a part of their width.
    const APART: f64 = 3.0;
    const JOINED: f64 = 0.01;
    // Most records with a sign show it at once.
    if values.iter().take(64).any(|v| *v < 0.0) {
        return Ok(());
    }
    let (low, high) = stats::range(values);
    if low < 0.0 {
        return Ok(());
    }
    let Some(bits) = BITS.into_iter().find(|bits| high < f64::from(*bits).exp2()) else { return Ok(()) };
    let end = f64::from(bits).exp2();
    if high < WRAPPED * end || values.iter().any(|v| v.fract() != 0.0) {
        return Ok(());
    }
    let (mut below, mut wrapped) = (Vec::new(), Vec::new());
    for value in values {
        match value / end {
            part if part < 1.0 - WRAPPED => below.push(*value),
            part if part >= WRAPPED => wrapped.push(end - value),
            _ => return Ok(()),
        }
    }
    let samples = wrapped.len();
    let least = below.len().min(samples) as f64;
    for side in [&mut below, &mut wrapped] {
        side.sort_by(f64::total_cmp);
        side.dedup();
    }
    let ([nearest, .., deepest] | [nearest @ deepest], [smallest, .., largest] | [smallest @ largest]) =
        (&wrapped[..], &below[..])
    else {
        return Ok(());
    };
    let is_joined = nearest + smallest <= APART + JOINED * (deepest + largest);
    let is_noise = below.len().min(wrapped.len()) >= WORDS || least > MANY * values.len() as f64;
    match values.iter().position(|value| *value >= WRAPPED * end) {
        Some(row) if is_joined && is_noise => {
            Err(Refusal::Unsigned { channel: channel.to_owned(), bits, samples, row: row + 1 })
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_bad_sample_is_named() {
        let refusal = finite("gx", &[0.0, f64::INFINITY, f64::NAN]).unwrap_err();
        assert_eq!(refusal.to_string(), "gx: sample 1 is inf");
    }

    /// Levels near 0 with fine and coarse noise, without a sign, are refused. Failed reads, levels far from 0, a range
    /// in use throughout, spikes, the sides of a flip and a square wave near both ends of an unsigned converter are
    /// accepted.
    #[test]
    fn counts_without_their_sign_are_named() {
        let noise = |i: i32| f64::from(i * 7919 % 101) - 50.0;
        let level = |at: f64| (0..1000).map(|i| at + noise(i)).collect::<Vec<_>>();
        let wrap = |values: Vec<f64>, end: f64| values.into_iter().map(|v| v.rem_euclid(end)).collect::<Vec<_>>();
        for (bits, end) in [(16, 65_536.0), (24, 16_777_216.0), (12, 4096.0)] {
            let refusal = signed("x", &wrap(level(30.0), end)).unwrap_err();
            assert!(matches!(refusal, Refusal::Unsigned { samples: 150..300, bits: b, .. } if b == bits), "{refusal}");
        }
        let toggling: Vec<f64> = (0..1000).map(|i| if noise(i) > 20.0 { 0.0 } else { -1.0 }).collect();
        assert!(signed("x", &wrap(toggling, 65_536.0)).is_err());
        let with = |base: Vec<f64>, words: &[f64]| [base, words.to_vec()].concat();
        let near_end = |at: f64| (0..1000).map(|i| at + (noise(i) / 25.0).round()).collect::<Vec<_>>();
        for good in [
            level(60.0),
            wrap(level(-900.0), 65_536.0),
            with(level(60.0), &[65_535.0; 9]),
            with(level(60.0), &[51_000.0, 60_000.0, 65_000.0]),
            with(level(60.0), &[20_000.0, 65_535.0, 65_534.0, 65_533.0]),
            with(near_end(245.0), &[0.0]),
            with(near_end(4085.0), &[0.0; 40]),
            with(near_end(3800.0), &near_end(300.0)),
            with(vec![100.0; 400], &[4000.0; 400]),
            [-100.0, -90.0, -80.0, 80.0, 90.0, 100.0].map(|rate| 2048.0 + 20.0 * rate).to_vec(),
        ] {
            assert!(signed("x", &good).is_ok(), "{:?}", &good[good.len() - 6..]);
        }
    }

    #[test]
    fn a_plateau_at_the_end_of_the_range_is_found_and_one_inside_is_not() {
        let noise = |i: usize| ((i * 7919 % 101) as f64 - 50.0) * 0.1;
        let turn = |i: usize| if (200..400).contains(&i) { 3000.0 } else { 0.0 };
        let record = |limit: f64| -> Vec<f64> { (0..600).map(|i| (turn(i) + noise(i)).min(limit)).collect() };
        let unclipped = |values: &[f64]| unclipped("x", values, &[&values[..values.len().min(200)]]);
        assert!(unclipped(&record(9999.0)).is_ok());
        let refusal = unclipped(&record(2990.0)).unwrap_err().to_string();
        assert_eq!(refusal, "x is saturated: 200 samples at 2990");
        // With noise below the resolution, rest and plateau both stand still.
        let coarse: Vec<f64> = record(9999.0).iter().map(|v| (v / 100.0).round()).collect();
        assert!(unclipped(&coarse).is_ok());
        assert!(unclipped(&[1.0; 50]).is_ok());
    }

    #[test]
    fn a_cut_sine_is_found_and_a_whole_one_in_codes_is_not() {
        let sine = |top: f64, codes: f64| -> Vec<f64> {
            (0..6000).map(|i| (f64::from(i) * 0.0137).sin() * codes).map(|v| v.min(top * codes).round()).collect()
        };
        assert!(unsaturated("x", &sine(2.0, 1000.0), None).is_ok());
        assert!(unsaturated("x", &sine(2.0, 20.0), None).is_ok());
        let refusal = unsaturated("x", &sine(0.95, 1000.0), None).unwrap_err();
        assert!(matches!(refusal, Refusal::Saturated { value: 950.0, samples: 500..700, .. }), "{refusal}");
        assert!(unsaturated("x", &sine(2.0, 1000.0), Some(999.0)).is_err());
        // A still sensor whose noise is below a code shows nearly always one value.
        let still: Vec<f64> = (0..1000).map(|i| if i % 12 == 0 { 4.0 } else { 5.0 }).collect();
        assert!(unsaturated("x", &still, None).is_ok());
    }
}
