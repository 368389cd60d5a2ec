//! `gnc-station compute` on records with failed reads, spikes, stale and clipped rows. Either the figure is right and
//! says what was left out, or it is refused with the first bad row.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may end with a panic")]

use std::fmt::Write as _;
use std::process::{Command, Output};

use serde_json::Value;

/// The result of `compute` for a record, or the refusal.
fn compute(record: &str, words: &str) -> Result<Value, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("r.csv"), record).unwrap();
    let Output { status, stdout, stderr } = Command::new(env!("CARGO_BIN_EXE_gnc-station"))
        .current_dir(folder.path())
        .arg("compute")
        .args(words.split_whitespace())
        .arg("--json")
        .output()
        .unwrap();
    let value: Value = serde_json::from_slice(&stdout).unwrap_or_default();
    match status.code() {
        Some(0) => Ok(value),
        Some(1) => Err(value["refused"].as_str().unwrap().to_owned()),
        other => panic!("{other:?}: {}", String::from_utf8_lossy(&stderr)),
    }
}

#[track_caller]
fn near(value: &Value, truth: f64, within: f64) {
    let value = value.as_f64().unwrap();
    assert!((value - truth).abs() <= within, "{value} is not {truth} +- {within}");
}

/// Uniform noise of deviation 0.577, which a linear congruence repeats after 2^31 values.
fn noise(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
}

#[test]
fn failed_reads_leave_no_trace_in_the_six_positions() {
    let words = "six-position r.csv --gravity 9.80665";
    let found = compute(include_str!("data/six-position-zero-reads.csv"), words).unwrap();
    assert_eq!(found["gate"]["left_out"]["failed_reads"], 12);
    assert_eq!(found["gate"]["used"], 288);
    assert_eq!(found["gate"]["first_row"], 13);
    // 816 LSB for 1 m/s^2 at 9.7967 m/s^2: 8000 LSB for each g of the record.
    (0..3).for_each(|axis| near(&found["sensitivity"][axis], 815.1, 0.3));
}

#[test]
fn a_spike_leaves_no_trace_in_a_flip() {
    let found = compute(include_str!("data/flip-spike.csv"), "flip r.csv").unwrap();
    near(&found["offset"], 0.02, 2e-4);
    assert_eq!(found["gate"]["left_out"]["spikes"], 1);
    assert_eq!(found["gate"]["first_row"], 51);
}

/// 5000 codes for 1 deg/s at eleven rates, with every 25th read failed. Each rate is a level of its own.
#[test]
fn failed_reads_leave_no_trace_in_a_scale_factor() {
    let record = |failed: usize| {
        let (mut text, mut state, mut row) = ("rate,x\n".to_owned(), 3, 0);
        for rate in -5..=5 {
            for _ in 0..200 {
                row += 1;
                let value = (5000.0 * f64::from(rate * 20) + 40.0 + 30.0 * noise(&mut state)).round();
                let value = if failed > 0 && row % failed == 0 { 0.0 } else { value };
                let _ = writeln!(text, "{},{value}", rate * 20);
            }
        }
        text
    };
    let found = compute(&record(25), "scale-factor r.csv").unwrap();
    near(&found["scale_factor"], 5000.0, 0.05);
    near(&found["offset"], 40.0, 2.0);
    // 88 reads failed; 40 codes are 2.3 deviations of the noise, so failed reads at rest cannot be told from noise.
    assert!((72..=88).contains(&found["gate"]["left_out"]["failed_reads"].as_u64().unwrap()), "{}", found["gate"]);
    let refused = compute(&record(8), "scale-factor r.csv").unwrap_err();
    assert!(refused.contains("failed reads"), "{refused}");
    // One row a rate has no row beside it to compare with.
    let single = "rate,x\n-10,-50\n-5,-25\n0,0\n5,25.1\n10,50\n";
    assert_eq!(compute(single, "scale-factor r.csv").unwrap()["gate"]["used"], 5);
}

/// Three turns of each axis, 5000 codes for 1 rad/s, at 100 Hz.
fn runs(read: impl Fn(usize) -> usize, failed: usize, header: &str, timed: bool) -> String {
    let mut record = format!("{header}\n");
    let mut state = 7;
    let mut time = 0;
    for (run, label) in ["x+", "x-", "y+", "y-", "z+", "z-"].iter().enumerate() {
        let sense = if run % 2 == 0 { 1.0 } else { -1.0 };
        let peak = sense * 3.0 * std::f64::consts::TAU / 5.0 * 5000.0;
        for row in 0..1200 {
            let ramp = |from: f64| ((row as f64 - from) / 100.0).clamp(0.0, 1.0);
            let rate = peak * (ramp(250.0) - ramp(750.0));
            let values = [0, 1, 2]
                .map(|axis| (if axis == run / 2 { rate } else { 0.0 } + 20.0 + 30.0 * noise(&mut state)).round());
            let failed = failed > 0 && row % failed == failed - 1;
            let [x, y, z] = if failed { [0.0; 3] } else { values };
            for _ in 0..read(row) {
                let clock = if timed { format!("{:.2},", f64::from(time) / 100.0) } else { String::new() };
                let _ = writeln!(record, "{clock}{label},{x},{y},{z}");
                time += 1;
            }
        }
    }
    record
}

#[test]
fn a_rotation_bridges_failed_reads_and_refuses_time_that_did_not_pass() {
    let words = "rotation r.csv --rate 100 --turns 3";
    let found = compute(&runs(|_| 1, 0, "run,x,y,z", false), words).unwrap();
    (0..3).for_each(|axis| near(&found["response"][axis][axis], 5000.0, 1.0));
    assert_eq!(found["gate"]["left_out"]["failed_reads"], 0);
    let found = compute(&runs(|_| 1, 100, "run,x,y,z", false), words).unwrap();
    (0..3).for_each(|axis| near(&found["response"][axis][axis], 5000.0, 1.5));
    assert_eq!(found["gate"]["left_out"]["failed_reads"], 72);
    assert_eq!(found["gate"]["first_row"], 100);
    let doubled = compute(&runs(|_| 2, 0, "run,x,y,z", false), words).unwrap_err();
    assert!(doubled.contains("repeat the row before on all channels, first in row 2"), "{doubled}");
    assert!(doubled.contains("at 1/2.000 of the record's rate"), "{doubled}");
    // One row too many in each run is 1/500 of the turn.
    let one = compute(&runs(|row| 1 + usize::from(row == 500), 0, "run,x,y,z", false), words).unwrap_err();
    assert!(one.contains("first in row 502"), "{one}");
}

/// White noise about 0 in codes; `spoil` damages it.
fn series(rows: usize, mut spoil: impl FnMut(usize, f64, f64) -> f64) -> String {
    let mut state = 11;
    let mut last = 0.0;
    (0..rows).fold("w\n".to_owned(), |mut text, row| {
        last = spoil(row, (1000.0 * noise(&mut state)).round(), last);
        let _ = writeln!(text, "{last}");
        text
    })
}

#[test]
fn one_glitch_does_not_decide_over_a_series() {
    let clean = series(20_000, |_, value, _| value);
    let glitch = series(20_000, |row, value, _| if row == 4321 { 8_000_000.0 } else { value });
    for (words, key) in [
        ("stability r.csv --rate 100 --column w --block 1", "sd"),
        ("psd r.csv --rate 100 --column w", "density"),
        ("allan r.csv --rate 100 --column w", "points"),
    ] {
        let [clean, spoilt] = [&clean, &glitch].map(|record| compute(record, words).unwrap());
        let figure = |found: &Value| match key {
            "density" => found[key][100].as_f64().unwrap(),
            "points" => found[key][0]["dev"].as_f64().unwrap(),
            _ => found[key].as_f64().unwrap(),
        };
        near(&figure(&spoilt).into(), figure(&clean), 0.01 * figure(&clean));
        assert_eq!(clean["gate"]["left_out"]["spikes"], 0, "{words}");
        assert_eq!(spoilt["gate"]["left_out"]["spikes"], 1, "{words}");
        assert_eq!(spoilt["gate"]["first_row"], 4322, "{words}");
    }
    let stale = series(20_000, |row, value, last| if row % 200 < 150 { value } else { last });
    let refused = compute(&stale, "allan r.csv --rate 100 --column w").unwrap_err();
    assert!(refused.contains("first in row 151"), "{refused}");
    let clipped = series(20_000, |row, value, _| if row < 10_000 { value } else { value.min(300.0) });
    let refused = compute(&clipped, "stability r.csv --rate 100 --column w").unwrap_err();
    assert!(refused.contains("w is cut at 300"), "{refused}");
}

#[test]
fn other_columns_may_count_too() {
    let with_temperature = series(2000, |_, value, _| value).replace('\n', ",300\n").replacen("w,300", "w,status", 1);
    let failed = with_temperature
        .lines()
        .enumerate()
        .map(|(row, line)| if row == 500 { line.replace(",300", ",-999999") } else { line.to_owned() })
        .enumerate()
        .map(|(row, line)| if row % 2 == 0 { line.replace(",300", ",301") } else { line })
        .collect::<Vec<_>>()
        .join("\n");
    let words = "stability r.csv --rate 100 --column w --block 1";
    assert_eq!(compute(&failed, words).unwrap()["gate"]["first_row"], Value::Null);
    let found = compute(&failed, &format!("{words} --gate-columns status")).unwrap();
    assert_eq!(found["gate"]["first_row"], 500);
    assert_eq!(found["gate"]["left_out"]["spikes"], 1);
}

/// The name of a column may hold an escape sequence; a terminal must not obey it.
#[test]
fn a_file_cannot_send_commands_to_the_terminal() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("r.csv"), "a\u{1b}[31mred,b\n1,2\n3,4\n").unwrap();
    let Output { stderr, .. } = Command::new(env!("CARGO_BIN_EXE_gnc-station"))
        .current_dir(folder.path())
        .args(["compute", "stability", "r.csv", "--rate", "100", "--column", "w"])
        .output()
        .unwrap();
    let said = String::from_utf8(stderr).unwrap();
    assert!(said.contains("the header has a\\u{1b}[31mred, b"), "{said:?}");
    assert!(!said.contains('\u{1b}'), "{said:?}");
}
