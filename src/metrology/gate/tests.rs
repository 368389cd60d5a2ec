use std::ops::Range;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use super::*;

fn dice(seed: u64) -> impl FnMut() -> f64 {
    let mut dice = ChaCha8Rng::seed_from_u64(seed);
    move || StandardNormal.sample(&mut dice)
}

/// Normal noise in codes about a level.
fn noise(seed: u64, rows: usize, level: f64, sd: f64) -> Vec<f64> {
    let mut normal = dice(seed);
    (0..rows).map(|_| (level + sd * normal()).round()).collect()
}

fn screen(channels: &[&[f64]], blocks: &[Range<usize>], still: bool) -> Screening {
    const NAMES: [&str; 3] = ["x", "y", "z"];
    Screening::of(&NAMES[..channels.len()], channels, &RecordLayout { blocks, still, range_end: None })
}

/// Rows left out of a single stretch: failed reads, spikes, stale, clipped.
fn counts(channels: &[&[f64]], still: bool) -> [usize; 4] {
    let LeftOut { failed_reads, spikes, stale, clipped } =
        *screen(channels, &one_stretch(channels[0].len()), still).left_out();
    [failed_reads, spikes, stale, clipped]
}

/// CAN carries the upper 18 of 24 bits and the receiver restores the middle of the step: a read of 0 arrives as 32, a
/// read of -1 as -32.
#[test]
fn failed_reads_are_found_behind_a_link_that_shortens_codes() {
    let shortened = |code: f64| (code / 64.0).floor() * 64.0 + 32.0;
    for word in [0.0, -1.0] {
        let channels: Vec<Vec<f64>> = [(1, 1690.0), (2, -1000.0), (3, 1200.0)]
            .into_iter()
            .map(|(seed, level)| {
                let noise = noise(seed, 400, level, 590.0);
                let read = |(row, code): (usize, &f64)| shortened(if row % 33 == 7 { word } else { *code });
                noise.iter().enumerate().map(read).collect()
            })
            .collect();
        assert_eq!(counts(&[&channels[0], &channels[1], &channels[2]], true), [12, 0, 0, 0], "{word}");
    }
}

#[test]
fn honest_records_pass_whole() {
    let check = |what: &str, values: Vec<f64>| assert_eq!(counts(&[&values], true), [0; 4], "{what}");
    for seed in 0..20 {
        for sd in [0.05, 0.2, 0.3, 0.5, 0.8, 1.0, 1.5, 2.0, 3.0, 5.0, 30.0, 700.0] {
            for rows in [24, 100, 1000, 10_000] {
                check(&format!("noise of {sd} codes, {rows} rows, seed {seed}"), noise(seed, rows, 0.3, sd));
            }
        }
    }
    let mut normal = dice(7);
    check("a long one", (0..1_000_000).map(|_| 0.1 * normal()).collect());
    check("codes of 256", noise(8, 4000, 3.0, 1.3).iter().map(|value| 256.0 * value).collect());
    let step: Vec<f64> = (0..4000).map(|i| if i < 1777 { 0.0 } else { 50.0 } + normal()).collect();
    check("a step", step);
    let turn = |i: usize| {
        (((i as f64 - 1000.0) / 500.0).clamp(0.0, 1.0) - ((i as f64 - 3000.0) / 500.0).clamp(0.0, 1.0)) * 4e6
    };
    assert_eq!(counts(&[&(0..5000).map(|i| (turn(i) + 1600.0 * normal()).round()).collect::<Vec<_>>()], false), [0; 4]);
    assert_eq!(counts(&[&(0..5000).map(turn).collect::<Vec<_>>()], false), [0; 4], "a turn without noise");
    assert_eq!(
        counts(&[&(0..5000).map(|i| (turn(i) / 1e4 + 0.2 * normal()).round()).collect::<Vec<_>>()], false),
        [0; 4]
    );
    for per_turn in [20.0, 67.0, 400.0, 20_000.0] {
        for sd in [0.0, 0.4, 5.0] {
            let angle = |i: usize| std::f64::consts::TAU * i as f64 / per_turn;
            let x: Vec<f64> = (0..20_000).map(|i| (8000.0 * angle(i).cos() + sd * normal()).round()).collect();
            let y: Vec<f64> = (0..20_000).map(|i| (8000.0 * angle(i).sin() + sd * normal()).round()).collect();
            assert_eq!(counts(&[&x, &y], false), [0; 4], "{per_turn} rows a turn, noise of {sd} codes");
        }
    }
    // Noise behind low-passes.
    for part in [0.02, 0.1, 0.4] {
        let mut state = [0.0; 2];
        let decay = (-std::f64::consts::TAU * part).exp();
        let values: Vec<f64> = (0..200_000)
            .map(|_| {
                state[0] = decay * state[0] + (1.0 - decay) * 100.0 * normal();
                state[1] = decay * state[1] + (1.0 - decay) * state[0];
                state[1]
            })
            .collect();
        check("low-passed", values.clone());
        check("low-passed, in codes", values.iter().map(|value| value.round()).collect());
    }
}

#[test]
fn failed_reads_are_found_by_where_they_stand() {
    for (what, word) in [("zeros", 0.0), ("minus ones", -1.0), ("range ends", 32_767.0), ("range ends", -8_388_608.0)] {
        for level in [8000.0, 3.0] {
            let mut channels = [noise(1, 4000, level, 30.0), noise(2, 4000, -3.0, 30.0), noise(3, 4000, 1.0, 30.0)];
            let bad: Vec<usize> = (0..4000).filter(|row| row % 50 == 24).collect();
            for channel in &mut channels {
                bad.iter().for_each(|row| channel[*row] = word);
            }
            let [x, y, z] = &channels;
            let found = screen(&[x, y, z], &one_stretch(4000), true);
            assert_eq!(found.left_out().failed_reads, 80, "{what} at {level}");
            assert_eq!(found.left_out().total(), 80, "{what} at {level}");
            assert_eq!(found.first_row(), Some(25));
            assert!(bad.iter().all(|row| !found.keeps(*row)));
            assert_eq!(found.admit(RowMeaning::Samples), Ok(()));
        }
    }
    // A single channel about zero: zeros come by chance, but a surplus of zeros does not.
    let mut values = noise(4, 20_000, 0.0, 300.0);
    assert_eq!(counts(&[&values], true), [0; 4]);
    (0..20_000).step_by(100).for_each(|row| values[row] = 0.0);
    assert!((200..240).contains(&counts(&[&values], true)[0]));
}

#[test]
fn spikes_are_found_alone_and_in_company() {
    let mut values = noise(5, 10_000, 100.0, 20.0);
    let mut dice = ChaCha8Rng::seed_from_u64(9);
    let mut bad = Vec::new();
    for (row, value) in values.iter_mut().enumerate() {
        if dice.random::<f64>() < 0.04 {
            *value += (200.0 + 4000.0 * dice.random::<f64>()).round();
            bad.push(row);
        }
    }
    let found = screen(&[&values], &one_stretch(10_000), true);
    let missed = bad.iter().filter(|row| found.keeps(**row)).count();
    assert_eq!(missed, 0, "of {}", bad.len());
    assert!(found.left_out().total() < bad.len() + bad.len() / 10, "{:?} of {}", found.left_out(), bad.len());
}

#[test]
fn stale_rows_are_told_from_chance() {
    for sd in [3.0, 30.0, 700.0] {
        let fresh = noise(6, 5000, 10.0, sd);
        let doubled: Vec<f64> = fresh.iter().flat_map(|value| [*value; 2]).collect();
        let found = screen(&[&doubled], &one_stretch(10_000), true);
        // Neighbours that are equal by chance lie in one run with their copies.
        assert!((5000..5500).contains(&found.left_out().stale), "{sd}: {:?}", found.left_out());
        assert_eq!(found.rows_per_update().is_some(), sd > 5.0, "{sd}: {:?}", found.polled);
        assert_eq!(found.admit(RowMeaning::Samples).is_ok(), sd > 5.0, "{sd}");
        assert!(matches!(found.admit(RowMeaning::Steps), Err(Refusal::Stale { first_row: 2, .. })));
    }
    // Each value is held for 50 of 200 rows.
    let held: Vec<f64> = noise(7, 10_000, 10.0, 30.0)
        .iter()
        .scan((0, 0.0), |(row, last), value| {
            *last = if *row % 200 < 150 { *value } else { *last };
            *row += 1;
            Some(*last)
        })
        .collect();
    let found = screen(&[&held], &one_stretch(10_000), true);
    assert!((2500..2600).contains(&found.left_out().stale), "{:?}", found.left_out());
    assert!(found.admit(RowMeaning::Samples).is_err());
}

#[test]
fn a_tail_cut_at_one_side_is_found() {
    for cut in [-0.5, 0.5, 1.5, 2.0] {
        for half in [false, true] {
            let mut values = noise(8, 4000, 8000.0, 40.0);
            let from = if half { 2000 } else { 0 };
            values[from..].iter_mut().for_each(|value| *value = value.min(8000.0 + (cut * 40.0_f64).round()));
            let found = screen(&[&values], &one_stretch(4000), true);
            assert!(matches!(found.admit(RowMeaning::Samples), Err(Refusal::Clipped { .. })), "{cut} {half}");
            values.iter_mut().for_each(|value| *value = -*value);
            assert!(
                screen(&[&values], &one_stretch(4000), true).admit(RowMeaning::Samples).is_err(),
                "{cut} {half}, below"
            );
        }
    }
}

/// Medians of neighbours do not show a word that is held, since its rows are neighbours of each other.
#[test]
fn a_word_that_is_held_is_a_failed_read_on_any_channel() {
    for word in [0.0, -999.0, 65_535.0, -32_000.0] {
        for length in [2, 5, 10, 40] {
            let mut x = noise(1, 4000, 8000.0, 30.0);
            let y = noise(2, 4000, -3000.0, 30.0);
            // The second held word begins two rows behind the first.
            let held = [500..500 + length, 502 + length..502 + 2 * length, 4000 - length..4000];
            held.iter().for_each(|rows| x[rows.clone()].fill(word));
            let found = screen(&[&x, &y], &one_stretch(4000), true);
            let bad = |row: usize| held.iter().any(|rows| rows.contains(&row));
            assert_eq!(found.left_out().total(), 3 * length, "{word} for {length} rows");
            assert!((0..4000).all(|row| found.keeps(row) != bad(row)), "{word} for {length} rows");
        }
    }
    // The end of a range is not the word of a link that hung: the methods say that the sensor is at its end.
    let (mut x, y) = (noise(1, 4000, 8000.0, 30.0), noise(2, 4000, -3000.0, 30.0));
    x[500..520].fill(32_767.0);
    assert_eq!(screen(&[&x, &y], &one_stretch(4000), false).left_out().total(), 0);
}

/// Zeros among noise about zero: single zeros are chance. Five consecutive zeros are not, and all five are marked.
#[test]
fn zeros_on_end_go_together() {
    for (every, bursts) in [(1000, 20), (800, 25), (500, 40)] {
        let mut values = noise(4, 20_000, 3.0, 30.0);
        let natural = counts(&[&values], true)[0];
        (100..20_000).step_by(every).for_each(|row| values[row..row + 8].fill(0.0));
        let found = screen(&[&values], &one_stretch(20_000), true);
        assert!((100..20_000).step_by(every).all(|row| (row..row + 8).all(|row| !found.keeps(row))), "{bursts}");
        assert!(found.left_out().total() < natural + bursts * 8 + 20, "{bursts}: {:?}", found.left_out());
    }
}

/// Zeros within six deviations of the level of a coarse sensor: 600 in 60,000 rows, where its noise gives fewer
/// than 30. Noise alone, and noise that a range cuts off at 0, lose no row.
#[test]
fn zeros_in_the_tail_of_coarse_noise_are_found() {
    for (sd, level) in
        [(1.0, 5.0), (1.0, 4.5), (2.0, 10.0), (2.0, 12.0), (3.0, 15.0), (3.0, 18.0), (5.0, 28.5), (8.0, 40.0)]
    {
        let mut values = noise(15, 60_000, level, sd);
        assert_eq!(counts(&[&values], true), [0; 4], "{sd} codes at {level}");
        let bad: Vec<usize> = (0..600).map(|at| 50 + at * 99 + at * at % 41).collect();
        bad.iter().for_each(|row| values[*row] = 0.0);
        let found = screen(&[&values], &one_stretch(60_000), true);
        let missed = bad.iter().filter(|row| found.keeps(**row)).count();
        assert!(missed <= 30, "{sd} codes at {level}: {missed}");
        assert!(found.left_out().failed_reads >= 570 && found.left_out().total() <= 630, "{:?}", found.left_out());
    }
    for (sd, level) in [(1.0, 2.0), (3.0, 9.0), (8.0, 16.0)] {
        for seed in 0..5 {
            let values: Vec<f64> = noise(seed, 20_000, level, sd).iter().map(|value| value.max(0.0)).collect();
            assert_eq!(counts(&[&values], true)[0], 0, "{sd} codes at {level}, cut at 0");
        }
    }
    // Levels that drift, step and walk past the words.
    for seed in 0..5 {
        for sd in [0.4, 0.8, 1.0, 2.0] {
            let mut normal = dice(seed);
            let mut walk = 0.0;
            let mut rows = |level: &mut dyn FnMut(usize, f64) -> f64| -> Vec<f64> {
                (0..20_000).map(|row| (level(row, normal()) + sd * normal()).round()).collect()
            };
            let drift = rows(&mut |row, _| row as f64 / 2000.0);
            let steps = rows(&mut |row, _| [0.0, 3.0, 7.0, -2.5][row / 500 % 4]);
            let walks = rows(&mut |_, step| {
                walk += 0.05 * step;
                walk
            });
            let slow = rows(&mut |row, _| 3.0 + 3.0 * (row as f64 / 300.0).sin());
            for (what, values) in [("drift", drift), ("steps", steps), ("walk", walks), ("slow", slow)] {
                assert_eq!(counts(&[&values], true)[0], 0, "{what}, {sd} codes, seed {seed}");
            }
        }
    }
}

/// A sensor that is read eight times for each update shows a 0 of its noise eight times in a row.
#[test]
fn zeros_of_a_polled_sensor_are_no_failed_reads() {
    let updates = noise(14, 2500, 0.0, 30.0);
    assert!(updates.iter().filter(|update| **update == 0.0).count() > 20);
    let polled: Vec<f64> = updates.iter().flat_map(|update| [*update; 8]).collect();
    let found = screen(&[&polled], &one_stretch(20_000), true);
    assert_eq!(found.left_out().failed_reads, 0, "{:?}", found.left_out());
    assert_eq!(found.admit(RowMeaning::Samples), Ok(()));
}

#[test]
fn several_spikes_on_end_leave_a_level() {
    for length in [2, 3, 5, 8] {
        let mut values = noise(9, 20_000, 3.0, 30.0);
        // The second burst of a pair comes four rows behind the first.
        let bumps = (100..19_900).step_by(500).flat_map(|row| [row, row + length + 4]);
        let bad: Vec<usize> = bumps.flat_map(|row| row..row + length).collect();
        bad.iter().for_each(|row| values[*row] += 600.0);
        let found = screen(&[&values], &one_stretch(20_000), true);
        assert!(bad.iter().all(|row| !found.keeps(*row)), "{length} rows: {:?}", found.left_out());
        // A tenth of the rows left out may be honest tails.
        assert!(found.left_out().total() * 10 <= bad.len() * 11, "{length} rows: {:?}", found.left_out());
    }
    // A longer burst is a level of its own: the module or its field moved.
    for length in [9, 20] {
        let mut values = noise(9, 4000, 3.0, 30.0);
        values[1000..1000 + length].iter_mut().for_each(|value| *value += 600.0);
        let found = screen(&[&values], &one_stretch(4000), true);
        assert_eq!(found.left_out().total(), 0, "{length} rows");
    }
}

/// 100 bursts of five rows at random, some of which touch: ten consecutive rows are then two bursts.
#[test]
fn bursts_that_touch_are_spikes() {
    let mut values = noise(9, 60_000, 5000.0, 100.0);
    let mut dice = ChaCha8Rng::seed_from_u64(21);
    let mut bursts: Vec<usize> = (0..98).map(|_| 5 * dice.random_range(100..11_900)).collect();
    bursts.extend([30_000, 30_005]);
    bursts.sort_unstable();
    bursts.dedup();
    let bad: Vec<usize> = bursts.iter().flat_map(|row| *row..row + 5).collect();
    bad.iter().for_each(|row| values[*row] += 1000.0);
    let found = screen(&[&values], &one_stretch(60_000), true);
    let missed = bad.iter().filter(|row| found.keeps(**row)).count();
    assert_eq!((missed, bad.len()), (0, found.left_out().spikes));
}

/// A single column at the end of its range for long counts as clipped, not stale. The end may be that of a word or a
/// stated one. A polled sensor whose noise passes 127, the end of eight bits, is neither clipped nor stale.
#[test]
fn a_column_that_stays_at_the_end_of_its_range_is_cut() {
    for (end, range_end) in [(32_767.0, None), (-8_388_608.0, None), (9000.0, Some(9000.0)), (-9000.0, Some(9000.0))] {
        for still in [true, false] {
            let mut values = noise(1, 20_000, 8000.0, 30.0);
            values[500..700].fill(end);
            let layout = RecordLayout { blocks: &one_stretch(20_000), still, range_end };
            let refused = Screening::of(&["w"], &[&values], &layout).admit(RowMeaning::Steps).unwrap_err();
            let Refusal::Clipped { channel, value, samples, first_row, .. } = refused else { panic!("{refused}") };
            assert_eq!((channel.as_str(), value, samples, first_row), ("w", end, 200, 501), "still: {still}");
        }
    }
    let updates = noise(14, 2500, 120.0, 30.0);
    let polled: Vec<f64> = updates.iter().flat_map(|update| [*update; 8]).collect();
    assert_eq!(counts(&[&polled], true)[3], 0);
}

/// A sensor that stands still once is not reported as one that updates seldom.
#[test]
fn what_stands_still_once_has_no_rate_of_its_own() {
    let mut values = noise(1, 20_000, 8000.0, 30.0);
    let held = values[499];
    values[500..800].fill(held);
    let refused = screen(&[&values], &one_stretch(20_000), true).admit(RowMeaning::Steps).unwrap_err();
    assert!(matches!(refused, Refusal::Stale { first_row: 501, rows_per_update: None, .. }), "{refused}");
    assert!(!refused.to_string().contains("rate"), "{refused}");
    let doubled: Vec<f64> = noise(2, 10_000, 8000.0, 30.0).iter().flat_map(|value| [*value; 2]).collect();
    let refused = screen(&[&doubled], &one_stretch(20_000), true).admit(RowMeaning::Steps).unwrap_err();
    assert!(refused.to_string().contains("new rows come at 1/2.0"), "{refused}");
}

/// Two channels of three stand still for 40 rows while the third goes on.
#[test]
fn a_channel_that_freezes_alone_is_stale() {
    let mut channels = [noise(1, 4000, 8000.0, 30.0), noise(2, 4000, -3.0, 30.0), noise(3, 4000, 1.0, 30.0)];
    for values in &mut channels[..2] {
        let held = values[999];
        values[1000..1040].fill(held);
    }
    let [x, y, z] = &channels;
    assert_eq!(counts(&[x, y, z], true), [0, 0, 40, 0]);
}

/// A sensor that is read 4 to 10 times for each update repeats itself on all channels together, and no channel counts
/// as frozen. A channel that freezes beside the others for 30 % of the updates does.
#[test]
fn channels_that_are_polled_together_are_taken() {
    for polled in [4, 8, 10] {
        let fresh = [1, 2, 3].map(|seed| noise(seed, 350, 10.0, 30.0));
        let read = |updates: &[f64]| -> Vec<f64> { updates.iter().flat_map(|value| vec![*value; polled]).collect() };
        let [x, y, z] = fresh.each_ref().map(|updates| read(updates));
        let found = screen(&[&x, &y, &z], &one_stretch(350 * polled), true);
        assert_eq!(found.left_out().stale, 350 * (polled - 1), "{polled} rows");
        assert_eq!(found.left_out().total(), 350 * (polled - 1), "{polled} rows");
        assert_eq!(found.rows_per_update(), Some(polled as f64));
        assert_eq!(found.admit(RowMeaning::Samples), Ok(()));

        let mut updates = fresh[0].clone();
        let held = updates[99];
        updates[100..205].fill(held);
        let found = screen(&[&read(&updates), &y, &z], &one_stretch(350 * polled), true);
        assert_eq!(found.left_out().stale, 350 * (polled - 1) + 105, "{polled} rows");
        assert!(matches!(found.admit(RowMeaning::Samples), Err(Refusal::Stale { .. })), "{polled} rows");
    }
}

/// A temperature that updates every 10th row, beside a status that changes in each row.
#[test]
fn a_slow_channel_beside_a_moving_one_is_not_frozen() {
    for (polled, sd) in [(2, 30.0), (10, 30.0), (10, 3.0)] {
        let updates = noise(1, 4000 / polled, 2500.0, sd);
        let slow: Vec<f64> = updates.iter().flat_map(|value| vec![*value; polled]).collect();
        let status: Vec<f64> = (0..4000).map(|row| f64::from(row % 16)).collect();
        assert_eq!(counts(&[&slow, &status], false), [0; 4], "every {polled} rows, {sd} codes");
        assert_eq!(counts(&[&slow, &noise(2, 4000, 10.0, 30.0)], false), [0; 4], "every {polled} rows, {sd} codes");
    }
}

/// One channel of three stands still for 3 % and for 30 % of the record.
#[test]
fn a_channel_that_freezes_for_long_is_stale() {
    for length in [120, 1200] {
        let mut x = noise(1, 4000, 8000.0, 30.0);
        let held = x[999];
        x[1000..1000 + length].fill(held);
        let found = screen(&[&x, &noise(2, 4000, -3.0, 30.0), &noise(3, 4000, 1.0, 30.0)], &one_stretch(4000), true);
        assert_eq!(found.left_out().stale, length);
        assert_eq!(found.left_out().total(), length);
        assert_eq!(found.admit(RowMeaning::Samples).is_ok(), length == 120);
    }
}

/// In blocks of 200 rows the sensor updates 5 to 40 times. All blocks together show its noise.
#[test]
fn few_updates_in_each_block_are_told_by_all_blocks() {
    for polled in [5, 8, 20, 40] {
        let blocks: Vec<Range<usize>> = (0..14).map(|block| block * 200..(block + 1) * 200).collect();
        let updates = noise(11, 14 * 200 / polled, 0.0, 30.0);
        let values: Vec<f64> = (0..14 * 200).map(|row| updates[row / polled] + 1000.0 * (row / 200) as f64).collect();
        let found = screen(&[&values], &blocks, true);
        let LeftOut { stale, .. } = *found.left_out();
        // An update may repeat the update before by chance.
        let repeats = 14 * 200 - updates.len();
        assert!((repeats..=repeats + 5 * polled).contains(&stale), "every {polled} rows: {stale} for {repeats}");
        assert_eq!(found.left_out().total(), stale, "every {polled} rows");
        assert_eq!(found.admit(RowMeaning::Samples).is_ok(), polled <= 10, "every {polled} rows");
    }
}

#[test]
fn the_larger_number_is_the_cause() {
    let mut values = noise(12, 2400, 8000.0, 3.0);
    (0..2400).step_by(4).for_each(|row| values[row] = 32_767.0);
    let refused = screen(&[&values], &one_stretch(2400), true).admit(RowMeaning::Samples);
    assert!(matches!(refused, Err(Refusal::BadRows { what: "failed reads", .. })), "{refused:?}");
}

/// The mean of 32 white values has a 32nd of their variance, whether or not 1 value in 50 was replaced: 40 records give
/// that variance to 0.9 %. Steps of a walk also keep their variance.
#[test]
fn values_in_place_of_others_vary_as_those() {
    let (mut white, mut clean, mut steps) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 0..40 {
        let bad: Vec<usize> = (50..19_950).step_by(50).map(|row| row + (row * 7 + seed as usize * 13) % 40).collect();
        let mut values = noise(100 + seed, 20_000, 3.0, 30.0);
        clean.extend(values.chunks(32).take(625).map(|part| part.iter().sum::<f64>() / 32.0 - 3.0));
        bad.iter().for_each(|row| values[*row] = 65_535.0);
        let found = screen(&[&values], &one_stretch(20_000), true);
        assert!(found.left_out().total() <= bad.len() + 3, "{:?}", found.left_out());
        let mended = found.refilled(&values, &one_stretch(20_000));
        white.extend(mended.chunks(32).take(625).map(|part| part.iter().sum::<f64>() / 32.0 - 3.0));

        let mut level = 0.0;
        let mut walk: Vec<f64> = noise(200 + seed, 20_000, 0.0, 300.0)
            .iter()
            .map(|step| {
                level += step;
                level
            })
            .collect();
        bad.iter().for_each(|row| walk[*row] += 1e6);
        let mended = screen(&[&walk], &one_stretch(20_000), true).refilled(&walk, &one_stretch(20_000));
        steps.extend(bad.iter().map(|row| mended[*row] - mended[row - 1]));
    }
    let variance = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64;
    let ratio = variance(&white) / (30.0_f64.powi(2) / 32.0);
    assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
    // Compared with the same records before the damage, little is left to chance.
    let ratio = variance(&white) / variance(&clean);
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    let ratio = variance(&steps) / 300.0_f64.powi(2);
    assert!((ratio - 1.0).abs() < 0.06, "{ratio}");
}

/// A low-pass rounds the beginning and the end of a ramp. There, a spike also lies between its neighbours, but off the
/// line between them.
#[test]
fn a_low_pass_makes_no_spikes_of_the_ends_of_a_ramp() {
    const ROWS: usize = 1540;
    let profile = |row: usize, ramp: f64| {
        let row = row as f64;
        11_260.0 * (((row - 300.0) / ramp).clamp(0.0, 1.0) - ((row - 1150.0) / ramp).clamp(0.0, 1.0))
    };
    for part in [0.05, 0.1, 0.2, 0.4] {
        for poles in [1, 2] {
            let decay = (-std::f64::consts::TAU * part).exp();
            let low_pass = |values: &mut [f64]| {
                for _ in 0..poles {
                    values.iter_mut().fold(0.0, |state, value| {
                        *value = decay * state + (1.0 - decay) * *value;
                        *value
                    });
                }
            };
            for seed in 0..20 {
                for ramp in [25.0, 50.0, 100.0] {
                    let mut normal = dice(seed);
                    let mut values: Vec<f64> = (0..ROWS).map(|row| profile(row, ramp) + 4.0 * normal()).collect();
                    low_pass(&mut values);
                    values.iter_mut().for_each(|value| *value = value.round());
                    assert_eq!(counts(&[&values], false), [0; 4], "{part} of the rate, {poles} poles, ramp of {ramp}");
                    if ramp != 50.0 {
                        continue;
                    }
                    // The spike is smaller than the rise of the ramp from row to row.
                    values[325] += 200.0;
                    let found = screen(&[&values], &one_stretch(ROWS), false);
                    assert!(!found.keeps(325), "{part} of the rate, {poles} poles: a spike");
                }
            }
        }
    }
}

/// A line, several lines, a wandering line, a low-pass and both: with 1 in 100 rows replaced, alone or eight in a row,
/// each part of the spectrum stays that of the record before the damage.
#[test]
fn values_in_place_of_others_follow_lines_and_low_passes() {
    const ROWS: usize = 60_000;
    const SEGMENT: usize = 512;
    for (seed, what) in (300..).zip(["line", "lines", "wandering line", "low-pass", "low-pass and line"]) {
        let mut normal = dice(seed);
        let (mut phase, mut poles) = (0.0, [0.0; 2]);
        let clean: Vec<f64> = (0..ROWS)
            .map(|row| {
                let turn = |frequency: f64| (std::f64::consts::TAU * (frequency * row as f64).fract() + phase).sin();
                let mut value = 30.0 * normal();
                if what.contains("low-pass") {
                    poles[0] += 0.5 * (value - poles[0]);
                    poles[1] += 0.5 * (poles[0] - poles[1]);
                    value = 3.0 * poles[1];
                }
                value += match what {
                    "low-pass" => 0.0,
                    "lines" => 300.0 * turn(0.2495) + 150.0 * turn(0.11) + 90.0 * turn(0.37),
                    _ => 300.0 * turn(0.2495),
                };
                if what == "wandering line" {
                    phase += 0.01 * normal();
                }
                (8000.0 + value).round()
            })
            .collect();
        for length in [1, 8] {
            let every = 100 * length;
            let mut values = clean.clone();
            for row in (50..ROWS - every).step_by(every).map(|row| row + (row * 7 / every) % (every - 20)) {
                values[row..row + length].fill(0.0);
            }
            let found = screen(&[&values], &one_stretch(ROWS), true);
            let bad = found.left_out().failed_reads;
            assert!((580..=600).contains(&bad) && found.left_out().total() == bad, "{what}: {:?}", found.left_out());
            let density = |values: &[f64]| crate::psd::welch(values, 1.0, SEGMENT).unwrap().density;
            let (before, after) = (density(&clean), density(&found.refilled(&values, &one_stretch(ROWS))));
            for band in [0.02..0.1, 0.15..0.2, 0.3..0.35, 0.4..0.48] {
                let bins = (band.start * SEGMENT as f64) as usize..(band.end * SEGMENT as f64) as usize;
                let mean = |density: &[f64]| density[bins.clone()].iter().sum::<f64>();
                let ratio = mean(&after) / mean(&before);
                assert!((ratio - 1.0).abs() < 0.03, "{what}, {length} rows, {band:?}: {ratio}");
            }
        }
    }
}

/// The word in a row that is left out does not count: the values in its place are the same for any word.
#[test]
fn a_word_that_is_left_out_takes_no_digits() {
    let mended = |word: f64| {
        let mut values = noise(13, 4000, 8000.0, 30.0);
        (10..4000).step_by(100).for_each(|row| values[row] = word);
        let found = screen(&[&values], &one_stretch(4000), false);
        assert_eq!(found.left_out().total(), 40, "{word}");
        found.refilled(&values, &one_stretch(4000))
    };
    let usual = mended(65_535.0);
    assert!(mended(1e14) == usual, "1e14");
    assert!(mended(3e38) == usual, "3e38");
}

/// An honest repeat between two spikes, which occurs once in some ten thousand rows, is not a pause of a motion.
#[test]
fn a_repeat_between_spikes_is_not_stale() {
    let mut values = noise(17, 4000, 8000.0, 30.0);
    for row in (100..4000).step_by(500) {
        values[row + 1] = values[row];
        (values[row - 1], values[row + 2]) = (-12_000.0, 28_000.0);
    }
    let [failed_reads, spikes, others @ ..] = counts(&[&values], true);
    assert_eq!((failed_reads + spikes, others), (16, [0, 0]));
}
