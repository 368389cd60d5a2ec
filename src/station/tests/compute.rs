//! `gnc-station compute` as a program: keys, exit codes, messages.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test may end with a panic and says what it saw"
)]

use std::fmt::Write as _;
use std::process::{Command, Output};

use serde_json::Value;

struct Run {
    code: i32,
    out: String,
    err: String,
}

/// Runs `compute` with the arguments `words` in a folder that holds `file` as `r.csv`.
fn run(file: &str, words: &str) -> Run {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("r.csv"), file).unwrap();
    let Output { status, stdout, stderr } = Command::new(env!("CARGO_BIN_EXE_gnc-station"))
        .current_dir(folder.path())
        .arg("compute")
        .args(words.split_whitespace())
        .output()
        .unwrap();
    let plot = folder.path().join("p.svg");
    if words.contains("--plot") && status.success() {
        let svg = std::fs::read_to_string(plot).unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>") && !svg.contains("NaN"));
    }
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Run { code: status.code().unwrap(), out: text(stdout), err: text(stderr) }
}

/// Checks a good run: JSON with all of the keys, and a table and a picture of the same result.
#[track_caller]
fn good(file: &str, words: &str, keys: &[&str]) -> Value {
    let json = run(file, &format!("{words} --json --plot p.svg"));
    assert_eq!((json.code, json.err.as_str()), (0, ""), "{}", json.out);
    let value: Value = serde_json::from_str(&json.out).unwrap();
    for key in keys {
        let found = key.split('.').try_fold(&value, |v, k| if v.is_array() { v.get(0)?.get(k) } else { v.get(k) });
        assert!(found.is_some(), "{words}: no key {key} in {}", json.out);
    }
    let table = run(file, words);
    assert!(table.code == 0 && table.out.lines().count() > 3, "{}", table.out);
    value
}

#[track_caller]
fn bad(file: &str, words: &str, code: i32, message: &str) {
    let r = run(file, words);
    assert!(r.err.contains(message), "`{}` does not contain `{message}`", r.err);
    assert_eq!(r.code, code, "{}", r.err);
}

/// N = M f + b with M = diag(1000, 900, 1100) and a coupling of 9 in (x, y), b = (30, -20, 10); no noise.
fn six(gravity: f64) -> String {
    let mut text = "# made by hand\nposition,x,y,z\n".to_owned();
    for (label, u) in [
        ("x+", [1, 0, 0]),
        ("x-", [-1, 0, 0]),
        ("y+", [0, 1, 0]),
        ("y-", [0, -1, 0]),
        ("z+", [0, 0, 1]),
        ("z-", [0, 0, -1]),
    ] {
        let f = u.map(|u| f64::from(u) * gravity);
        let _ = writeln!(
            text,
            "{label},{},{},{}",
            1000.0 * f[0] + 9.0 * f[1] + 30.0,
            900.0 * f[1] - 20.0,
            1100.0 * f[2] + 10.0
        );
    }
    text
}

fn near(value: &Value, expected: f64) {
    let value = value.as_f64().unwrap();
    assert!((value - expected).abs() < 1e-9 * expected.abs().max(1e-3), "{value} {expected}");
}

#[test]
fn six_position() {
    let keys = [
        "equation",
        "matrix",
        "nabla",
        "bias_mps2",
        "bias_mg",
        "bias_lsb",
        "sensitivity",
        "coupling",
        "residual_rms",
        "residuals",
        "condition",
        "dof",
        "sd.matrix",
        "sd.bias_mps2",
        "sd.bias_lsb",
        "expanded.bias_mps2",
        "as_printed.matrix",
        "as_printed.nabla",
    ];
    let v = good(&six(9.8), "six-position r.csv --gravity 9.8", &keys);
    near(&v["matrix"][0][0], 1e-3);
    near(&v["matrix"][0][1], -9.0 / 1000.0 / 900.0);
    near(&v["bias_mps2"][1], -20.0 / 900.0);
    near(&v["bias_mg"][1], -20.0 / 900.0 / 9.80665e-3);
    near(&v["bias_lsb"][1], -20.0);
    near(&v["nabla"][1], 20.0 / 900.0);
    near(&v["coupling"][0][1], 9e-3);
    near(&v["sensitivity"][2], 1100.0);
    assert_eq!((&v["dof"], v["residuals"].as_array().unwrap().len()), (&6.into(), 6));
    // Directions instead of labels, semicolons, and gravity of the place: 34 degrees, 400 m.
    let up = six(9.795_257_95)
        .replace("position", "ux,uy,uz")
        .replace("x+", "1,0,0")
        .replace("x-", "-1,0,0")
        .replace("y+", "0,1,0")
        .replace("y-", "0,-1,0")
        .replace("z+", "0,0,1")
        .replace("z-", "0,0,-1")
        .replace(',', ";");
    let v = good(&up, "six-position r.csv --latitude 34 --height 400", &keys);
    assert!((v["matrix"][0][0].as_f64().unwrap() / 1e-3 - 1.0).abs() < 1e-6, "{}", v["gravity"]);
    bad(&six(9.8).replace("z-", "z+"), "six-position r.csv --gravity 9.8", 1, "refused: missing: z-");
    bad(
        &six(9.8).replace("z-", "up"),
        "six-position r.csv --gravity 9.8",
        2,
        "r.csv:8:1: `up` in column `position` is not one of x+ x- y+ y- z+ z-",
    );
    bad(&six(9.8).replace("30", "3o"), "six-position r.csv --gravity 9.8", 2, "r.csv:");
    bad(&six(9.8), "six-position r.csv", 2, "--latitude");
    bad(&six(9.8), "six-position r.csv --gravity 9.8 --latitude 3", 2, "cannot be used with");
    bad(&six(9.8), "six-position none.csv --gravity 9.8", 2, "none.csv: cannot be read");
    let refused = run(&six(9.8).replace("z-", "z+"), "six-position r.csv --gravity 9.8 --json");
    let value: Value = serde_json::from_str(&refused.out).unwrap();
    assert_eq!((refused.code, &value["refused"]), (1, &"missing: z-".into()));
}

#[test]
fn gyro_still() {
    let v = good(
        &six(9.8),
        "gyro-still r.csv --latitude 0 --gravity 9.8",
        &["bias_rps", "bias_dph", "g_sensitivity", "sd.bias_rps", "sd.g_sensitivity", "expanded.bias_rps"],
    );
    near(&v["bias_rps"][0], 30.0);
    assert!(v["bias_lsb"].is_null() && v["absent"]["bias_lsb"].as_str().unwrap().contains("--response"), "{v}");
    let in_lsb = good(&six(9.8), "gyro-still r.csv --latitude 0 --gravity 9.8 --response 1000", &[]);
    near(&in_lsb["bias_rps"][0], 0.03);
    near(&in_lsb["bias_lsb"][0], 30.0);
    near(&v["g_sensitivity"][1][1], 900.0);
    // At the pole the earth's rotation along up is removed from the g-sensitivity: 7.29e-5 rad/s over 9.8 m/s^2.
    let v = good(&six(9.8), "gyro-still r.csv --latitude 90 --gravity 9.8", &[]);
    near(&v["g_sensitivity"][1][1], 900.0 - 7.292_115e-5 / 9.8);
    bad(&six(9.8), "gyro-still r.csv --latitude 91", 1, "latitude (deg) is 91");
}

/// Rotation of three turns in 5 s, whole samples, S = diag(1000, 2000, 3000), b = (5, 6, 7), axes to the celestial
/// north.
fn rotations() -> String {
    let mut text = "run\tx\ty\tz\n".to_owned();
    for axis in 0..3 {
        for (sense, sign) in [(1.0, '+'), (-1.0, '-')] {
            for k in 0..900 {
                let mut w = [0.0; 3];
                w[axis] =
                    7.292_115e-5 + if (200..700).contains(&k) { sense * 6.0 * std::f64::consts::PI / 5.0 } else { 0.0 };
                let _ = writeln!(
                    text,
                    "{}{sign}\t{}\t{}\t{}",
                    ["x", "y", "z"][axis],
                    1000.0 * w[0] + 5.0,
                    2000.0 * w[1] + 6.0,
                    3000.0 * w[2] + 7.0
                );
            }
        }
    }
    text
}

#[test]
fn rotation() {
    let keys = [
        "equation",
        "response",
        "matrix",
        "epsilon",
        "bias_rps",
        "bias_lsb",
        "windows.run",
        "sd.matrix",
        "sd.bias_rps",
    ];
    let v = good(&rotations(), "rotation r.csv --rate 100 --turns 3 --axis polar", &keys);
    near(&v["response"][1][1], 2000.0);
    near(&v["matrix"][2][2], 1.0 / 3000.0);
    near(&v["bias_rps"][0], 0.005);
    near(&v["epsilon"][0], 0.005);
    near(&v["bias_lsb"][2], 7.0);
    good(&rotations(), "rotation r.csv --rate 100 --turns 3", &keys);
    good(&rotations(), "rotation r.csv --rate 100 --turns 3 --axis vertical --latitude -34", &keys);
    bad(&rotations(), "rotation r.csv --rate 100 --turns 3 --axis vertical", 2, "--latitude");
    bad(&rotations(), "rotation r.csv --rate 100 --turns 3 --nominal 1000", 1, "sensor y: response 2.0");
    bad(&rotations(), "rotation r.csv --turns 3", 2, "--rate");
}

/// A sensor that reads too high has a positive bias in every method: measured minus true.
#[test]
fn bias_has_one_sign() {
    // b = (30, -20, 10) LSB at 1000, 900, 1100 LSB per m/s^2.
    let v = good(&six(9.8), "six-position r.csv --gravity 9.8", &[]);
    for (i, truth) in
        [30.0 / 1000.0 + 9.0 * 20.0 / 900.0 / 1000.0, -20.0 / 900.0, 10.0 / 1100.0].into_iter().enumerate()
    {
        near(&v["bias_mps2"][i], truth);
        near(&v["bias_lsb"][i], [30.0, -20.0, 10.0][i]);
        // Measured minus true, by the equation that is printed: f = matrix N + nabla.
        near(&v["nabla"][i], -truth);
    }
    let v = good(&six(9.8), "gyro-still r.csv --latitude 0 --gravity 9.8", &[]);
    assert!((0..3).all(|i| v["bias_rps"][i].as_f64().unwrap() * [30.0, -20.0, 10.0][i] > 0.0), "{v}");
    let v = good(&rotations(), "rotation r.csv --rate 100 --turns 3 --axis polar", &[]);
    near(&v["bias_rps"][2], 7.0 / 3000.0);
    let v = good("position,a\n+,1.035\n+,1.035\n-,-0.985\n-,-0.985\n", "flip r.csv", &[]);
    near(&v["offset"], 0.025);
    near(&v["bias"], 0.025 / 1.01);
}

/// Keys of the version before keep their values, and describe themselves.
#[test]
fn old_keys_of_the_bias() {
    let v = good(&six(9.8), "six-position r.csv --gravity 9.8", &["sd.bias", "expanded.bias"]);
    assert_eq!((&v["bias"], &v["offset_lsb"]), (&v["nabla"], &v["bias_lsb"]));
    assert_eq!(v["as_printed"]["bias"], v["as_printed"]["nabla"]);
    assert_eq!(v["deprecated"]["bias"], "nabla of f = matrix N + nabla: minus bias_mps2; read those");
    let v = good(&rotations(), "rotation r.csv --rate 100 --turns 3 --axis polar", &["sd.bias", "sd.offset_lsb"]);
    assert_eq!((&v["bias"], &v["offset_lsb"]), (&v["epsilon"], &v["bias_lsb"]));
    let v = good(&six(9.8), "gyro-still r.csv --latitude 0 --gravity 9.8", &["sd.bias", "heading_bound.bias"]);
    assert_eq!(v["bias"], v["bias_rps"]);
    let table = run(&six(9.8), "six-position r.csv --gravity 9.8").out;
    assert!(!table.contains("  bias  ") && !table.contains("offset_lsb"), "{table}");
}

#[test]
fn ellipse_and_ellipsoid() {
    let mut text = "x y\n".to_owned();
    for k in 0..400 {
        let (s, c) = (f64::from(k) * 0.1).sin_cos();
        let _ = writeln!(text, "{} {}", 1.0 + 10.0 * c, -2.0 + 5.0 * s);
    }
    let keys = [
        "centre",
        "semi_axes",
        "rotation_deg",
        "correction.dx",
        "correction.dy",
        "correction.ky",
        "correction.sin_alpha",
        "residual_rms",
        "extremes.dx",
        "extremes.dy",
        "extremes.ky",
        "rejected",
        "sd",
    ];
    let v = good(&text, "ellipse r.csv", &keys);
    assert!(
        (v["semi_axes"][0].as_f64().unwrap() - 10.0).abs() < 1e-9 && v["rotation_deg"].as_f64().unwrap().abs() < 1e-6
    );
    assert!((v["correction"]["ky"].as_f64().unwrap() - 2.0).abs() < 1e-9);
    bad(&text.lines().take(150).collect::<Vec<_>>().join("\n"), "ellipse r.csv", 1, "turns, needs at least 3");
    bad(&text.replacen("11 -2", "nan -2", 1), "ellipse r.csv", 1, "x: sample 0 is NaN");

    let mut text = "x;y;z\n".to_owned();
    for k in 0..500 {
        let z = 1.0 - (2.0 * f64::from(k) + 1.0) / 500.0;
        let (s, c) = (f64::from(k) * 2.399_963).sin_cos();
        let r = (1.0 - z * z).sqrt();
        let _ = writeln!(text, "{};{};{}", 5.0 + 20.0 * r * c, 40.0 * r * s, 10.0 * z - 3.0);
    }
    let keys = ["centre", "matrix", "field", "residual_relative", "coverage", "condition", "rejected", "sd"];
    let v = good(&text, "ellipsoid r.csv", &keys);
    assert!(
        (v["field"].as_f64().unwrap() - 20.0).abs() < 1e-6 && (v["centre"][0].as_f64().unwrap() - 5.0).abs() < 1e-6
    );
    let v = good(&text, "ellipsoid r.csv --field 50", &keys);
    assert!((v["matrix"][1][1].as_f64().unwrap() - 1.25).abs() < 1e-6 && v["field"] == 50.0);
}

#[test]
fn series() {
    let mut n: u64 = 1_234_567_890;
    let mut text = "t,y\n".to_owned();
    for k in 0..1000 {
        let _ = writeln!(text, "{},{}", f64::from(k) * 0.5, n as f64 / 2_147_483_647.0);
        n = n * 16_807 % 2_147_483_647;
    }
    let keys = [
        "points.tau_s",
        "points.dev",
        "points.n",
        "points.edf",
        "points.noise",
        "points.low",
        "points.high",
        "coefficients.Q",
        "coefficients.N.value",
        "coefficients.N.low",
        "coefficients.N.high",
        "coefficients.B",
        "coefficients.K",
        "coefficients.R",
        "reasons.B",
        "fit.chi_square",
        "fit.dof",
        "fit.p",
        "fit.terms",
        "fit.used_from_s",
        "N_psd.value",
        "N_psd.low",
        "N_psd.high",
    ];
    let v = good(&text, "allan r.csv --rate 2 --column y", &keys);
    assert_eq!(v["coefficients"]["B"], Value::Null);
    assert_eq!((&v["fit"]["holds"], v["N_and_N_psd"].as_str()), (&Value::Bool(true), Some("agree")));
    for dev in ["adev", "oadev", "mdev", "hdev", "ohdev", "totdev"] {
        good(&text, &format!("allan r.csv --rate 2 --column y --dev {dev} --taus decade"), &keys[..7]);
    }
    let v = good(&text, "allan r.csv --rate 2 --column y --dev mdev --taus 0.5,5,50 --phase", &[]);
    assert_eq!((v["points"].as_array().unwrap().len(), &v["coefficients"]["N"]), (3, &Value::Null));
    let v = good(&text, "psd r.csv --rate 2 --column y --segment 128", &["frequency_hz", "density"]);
    assert_eq!((v["frequency_hz"][64].as_f64(), v["density"].as_array().unwrap().len()), (Some(1.0), 65));
    let v = good(&text, "stability r.csv --rate 2 --column y --block 10", &["blocks", "mean", "sd"]);
    assert_eq!(v["blocks"], 50);
    bad(&text, "allan r.csv --rate 1 --column y", 1, "time column says 2.000000 Hz, stated are 1.000000 Hz");
    bad(&text.replacen("\n250,", "\n# lost 250,", 1), "allan r.csv --rate 2 --column y", 1, "gap at sample 500");
    bad(&text, "allan r.csv --rate 2 --column q", 2, "r.csv:1:1: no column `q`; the header has t, y");
    bad(&text, "allan r.csv --rate 2 --column y --taus often", 2, "is not octave, decade, all or a time");
    bad(&text, "allan r.csv --rate 2 --column y --taus 1000", 1, "averaging time (s) is 1000");
    bad(&text, "stability r.csv --rate 2 --column y --block 0.3", 1, "whole number of samples");
}

#[test]
fn tilt_and_zero_bias() {
    let v =
        good("position,a\n+,1.035\n+,1.035\n-,-0.985\n-,-0.985\n", "flip r.csv", &["equation", "offset", "gain", "sd"]);
    near(&v["gain"], 1.01);
    bad("position,a\n+,1\n+,1\n", "flip r.csv", 1, "missing: -");
    good("temperature,offset\n-40,5\n25,1\n85,3\n", "tilt-temperature r.csv", &["a", "b", "c"]);
    bad("temperature,offset\n-40,5\n25,1\n", "tilt-temperature r.csv", 1, "number of points is 2, expected 3");
    let example = include_str!("../../../docs/tilt-budget.toml");
    let v = good(example, "tilt-budget r.csv", &["before.sum_mg", "after.tilt_at_range_deg"]);
    near(&v["before"]["sum_mg"], 129.0);
    assert!((v["after"]["tilt_at_zero_deg"].as_f64().unwrap() - 1.28).abs() < 0.005);
    bad("range_deg = 30\ncontribution = 3\n", "tilt-budget r.csv", 2, "r.csv:2:16:");
    let mut text = "cycle,w\n".to_owned();
    for cycle in 0..3 {
        for k in 0..6000 {
            // Noise of a known kind, and a bias of 100.
            let _ = writeln!(text, "{cycle},{}", 100.0 + f64::from((k * 7919) % 101 - 50) * 0.1);
        }
    }
    let v = good(
        &text,
        "zero-bias r.csv --rate 100 --repeatability 1 --instability 0.1",
        &["cycles.before", "cycles.after", "rms_before", "rms_after"],
    );
    assert!((v["rms_before"].as_f64().unwrap() - 100.0).abs() < 0.1 && v["rms_after"].as_f64().unwrap() < 0.2, "{v}");
    assert_eq!(v["cycles"].as_array().unwrap().len(), 3);
}

#[test]
fn usage() {
    bad("", "allan", 2, "required arguments");
    bad("", "sixpos r.csv", 2, "unrecognized subcommand");
    bad("", "psd r.csv --rate 1 --column x", 2, "no header row");
}

/// A sensor with a second-order low-pass at a fifth of the rate, white noise of N = 3 behind it, and no flat part.
#[test]
fn a_band_limit_bends_neither_n_nor_makes_b() {
    let text = include_str!("data/allan-band-limited.csv");
    let v = good(text, "allan r.csv --rate 100 --column w", &["reasons.B"]);
    let n = &v["coefficients"]["N"];
    let [low, high] = ["low", "high"].map(|end| n[end].as_f64().unwrap());
    assert!(low < 3.0 && 3.0 < high && high - low < 2.0, "{n}");
    assert_eq!(v["coefficients"]["B"], Value::Null);
    assert!(v["fit"]["terms"].as_array().unwrap().contains(&"band limit".into()), "{}", v["fit"]);
}
