//! Every method with a good record and with records that it must refuse: keys of the fixed interface, refusals,
//! pictures.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use clap::Parser;
use gnc_metrology::position::{LABELS, up_of};
use serde_json::Value;

use super::{Args, ComputeError, ComputeOutcome};
use crate::locale::Lang;
use crate::phrases::english;

#[derive(Parser)]
struct Command {
    #[command(flatten)]
    args: Args,
}

/// Rows of text under a header.
fn table(header: &str, rows: impl IntoIterator<Item = String>) -> String {
    rows.into_iter().fold(format!("{header}\n"), |mut text, row| {
        let _ = writeln!(text, "{row}");
        text
    })
}

/// Noise that repeats exactly: the differences of a Weyl sequence, rms 0.4.
fn noise(k: usize) -> f64 {
    let weyl = |k: usize| (k as f64 * 0.754_877_666_246_693).fract();
    weyl(k + 1) - weyl(7 * k + 3)
}

/// Outputs of a sensor with some coupling and this level of noise, at rest in the six positions.
fn still(rows: usize, level: f64, output: impl Fn(usize, f64) -> f64) -> Vec<String> {
    let row = |k: usize| {
        let label = LABELS[k / rows];
        let up = up_of(label).unwrap_or_default();
        let v = |i: usize| output(i, up[i] + 0.002 * up[(i + 1) % 3]) + level * noise(3 * k + i);
        format!("{label},{},{},{}", v(0), v(1), v(2))
    };
    (0..6 * rows).map(row).collect()
}

/// Runs of three turns in 5 s, 100 Hz.
fn runs(turns: f64) -> Vec<String> {
    let row = |k: usize| {
        let (run, i) = (k / 1200, k % 1200);
        let sense = if run % 2 == 0 { 1.0 } else { -1.0 };
        let rate = if (200..700).contains(&i) { sense * turns * std::f64::consts::TAU / 5.0 } else { 0.0 };
        let v = |axis: usize| if axis == run / 2 { 1000.0 * rate } else { 5.0 * rate } + 20.0 + noise(3 * k + axis);
        format!("{},{},{},{}", LABELS[run], v(0), v(1), v(2))
    };
    (0..7200).map(row).collect()
}

fn circle(points: usize, per_turn: f64) -> Vec<String> {
    let row = |k: usize| {
        let (s, c) = (k as f64 * std::f64::consts::TAU / per_turn).sin_cos();
        format!("{},{}", 3.0 + 100.0 * c + noise(2 * k), -5.0 + 80.0 * s + 10.0 * c + noise(2 * k + 1))
    };
    (0..points).map(row).collect()
}

fn sphere(points: usize, height: f64) -> Vec<String> {
    let row = |k: usize| {
        let z = height * (1.0 - (2.0 * k as f64 + 1.0) / points as f64);
        let (s, c) = (k as f64 * 2.4).sin_cos();
        let r = (1.0 - z * z).sqrt();
        format!(
            "{},{},{}",
            60.0 * r * c + noise(3 * k),
            50.0 * r * s + noise(3 * k + 1),
            9.0 + 45.0 * z + noise(3 * k + 2)
        )
    };
    (0..points).map(row).collect()
}

fn series(samples: usize) -> String {
    table("t,w", (0..samples).map(|k| format!("{},{}", k as f64 * 0.01, 7.0 + noise(k))))
}

fn compute(words: &str, record: &str) -> Result<ComputeOutcome, ComputeError> {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(&file, record).unwrap();
    let (method, options) = words.split_once(' ').unwrap_or((words, ""));
    let words = ["compute", method, file.path().to_str().unwrap()].into_iter().chain(options.split_whitespace());
    Command::try_parse_from(words).unwrap_or_else(|e| panic!("{e}")).args.outcome().1
}

/// Checks that the result has these keys, written as `a.b`. In a list the first item is checked.
#[track_caller]
fn gives(words: &str, record: &str, keys: &str) -> Value {
    let outcome = compute(words, record).unwrap_or_else(|e| panic!("{words}: {e}"));
    let json: Value = serde_json::from_str(&outcome.report.json()).unwrap();
    for key in keys.split_whitespace() {
        let mut value = &json;
        for part in key.split('.') {
            value = value.get(0).unwrap_or(value).get(part).unwrap_or_else(|| panic!("{words}: no {key} in {json:#}"));
        }
    }
    let (table, svg) = (outcome.report.table(Lang::En), gnc_plot::svg(&outcome.panels));
    assert!(table.lines().count() > 3 && !table.contains("NaN"), "{table}");
    let mut names = BTreeSet::from([words.split(' ').next().unwrap_or_default().to_owned()]);
    named(&json, &mut names);
    for lang in [Lang::Zh, Lang::Ru] {
        english::holds_none(&table, &outcome.report.table(lang), lang, &|word| {
            names.contains(word) || record.contains(word) || SYMBOLS.split(' ').any(|symbol| symbol == word)
        });
    }
    assert!(
        svg.starts_with("<svg")
            && svg.ends_with("</svg>\n")
            && ["h0", "circle", "polyline"].iter().any(|m| svg.contains(m)),
        "{svg}"
    );
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{words}");
    json
}

/// The keys of an object, which its table shows in every language, and the texts of lists, which are names from the file.
fn named(value: &Value, names: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => object.iter().for_each(|(key, value)| {
            names.insert(key.clone());
            named(value, names);
        }),
        Value::Array(list) => list.iter().for_each(|value| {
            names.extend(value.as_str().map(str::to_owned));
            named(value, names);
        }),
        _ => {}
    }
}

/// Symbols, units, options and standards in the table, which no language changes.
const SYMBOLS: &str = "Hz ppm m/s rad rad/s deg/h degC mg LSB sqrt Ka Kg M_ij M_ii S_ij S_ii xy xz yz w_out GJB IEEE Hann adev mdev hdev ohdev oadev totdev corrected raw json actual out value low high Gauss-Markov \
                       response rate repeatability instability UTF-16 numpy";

#[track_caller]
fn refuses(words: &str, record: &str, expected: &str) {
    match compute(words, record) {
        Ok(outcome) => panic!("{words} gave {}", outcome.report.table(Lang::En)),
        Err(e @ ComputeError::Refused(_)) => assert!(e.to_string().contains(expected), "{words}: {e}"),
        Err(e) => panic!("{words}: not a refusal: {e}"),
    }
}

#[track_caller]
fn cannot_read(words: &str, record: &str, expected: &str) {
    match compute(words, record).map(|_| ()) {
        Err(ComputeError::Refused(e)) => panic!("{words}: refused: {e}"),
        Err(e) => assert!(e.to_string().ends_with(expected), "{words}: {e}"),
        Ok(()) => panic!("{words} gave a result"),
    }
}

/// All mistakes that are reported in a file: line, column, what is wrong, and what the user can try.
#[track_caller]
fn mistakes(words: &str, file: &str) -> Vec<String> {
    let Err(ComputeError::File(mistakes)) = compute(words, file) else { panic!("{words}: no mistakes") };
    let line = |mistake: &gnc_config::Mistake| {
        let place = mistake.place.as_ref().map_or((0, 0), |place| (place.line, place.column));
        format!("{}:{}: {}; try: {}", place.0, place.1, mistake.what, mistake.hint)
    };
    mistakes.iter().map(line).collect()
}

#[test]
fn six_positions() {
    let (words, head) = ("six-position --gravity 9.8", "position,x,y,z");
    let rows = still(100, 0.1, |i, f| 9800.0 * f + 50.0 * i as f64);
    let json = gives(
        words,
        &table(head, rows.clone()),
        "equation matrix nabla bias_mps2 bias_mg bias_lsb sensitivity coupling residual_rms residuals condition dof \
         sd.matrix sd.bias_mps2 sd.bias_lsb as_printed.matrix as_printed.nabla expanded.matrix covariance \
         bias sd.bias as_printed.bias deprecated.bias",
    );
    assert!((json["matrix"][1][1].as_f64().unwrap() - 1e-3).abs() < 1e-6, "{json:#}");
    let printed = json["as_printed"]["matrix"][1][1].as_f64().unwrap();
    assert!((printed - 1e-3).abs() < 1e-6 && json["dof"] == 6);
    let up = "ux,uy,uz,x,y,z";
    let attitudes =
        LABELS.map(|l| up_of(l).unwrap()).map(|u| format!("{},{},{},{},{},{}", u.x, u.y, u.z, u.x, u.y, u.z));
    gives("six-position --latitude 34 --height 400", &table(up, attitudes), "matrix bias_mps2 gravity");
    refuses(words, &table(head, rows[..500].to_vec()), "missing: z-");
    refuses(words, &table(head, [rows.clone(), rows[..9].to_vec()].concat()), "`x+` stands in two separated blocks");
    refuses(words, &table(head, [vec!["x+,nan,0,0".to_owned()], rows.clone()].concat()), "x: sample 0 is NaN");
    refuses(&format!("{words} --saturation 9000"), &table(head, rows.clone()), "x is saturated");
    cannot_read(words, &table(head, ["x+,1,2".to_owned()]), ":2:7: row has 3 fields, the header has 4");
    cannot_read(
        words,
        &table(head, ["up,1,2,3".to_owned()]),
        ":2:1: `up` in column `position` is not one of x+ x- y+ y- z+ z-",
    );
}

#[test]
fn still_gyroscope() {
    let record = table("position,x,y,z", still(100, 1e-6, |i, f| 0.01 * i as f64 + 1e-4 * f + 1e-3));
    gives(
        "gyro-still --latitude 34",
        &record,
        "bias_rps bias_dph absent.bias_lsb g_sensitivity sd.bias_rps sd.g_sensitivity expanded.bias_rps \
         heading_bound.bias_rps bias",
    );
    refuses("gyro-still --latitude 91", &record, "latitude (deg) is 91");
    let dead = table("position,x,y,z", still(100, 0.0, |i, f| if i == 1 { 0.0 } else { 1e-4 * f + 1e-3 }));
    refuses("gyro-still --latitude 34", &dead, "y: all 600 samples are 0");
}

#[test]
fn rotations() {
    let (words, head) = ("rotation --rate 100 --turns 3", "run,x,y,z");
    let rows = runs(3.0);
    let json = gives(
        words,
        &table(head, rows.clone()),
        "equation response matrix epsilon bias_rps bias_lsb windows.run sd.response sd.matrix residuals covariance",
    );
    assert!((json["response"][0][0].as_f64().unwrap() - 1000.0).abs() < 1.0);
    refuses(words, &table(head, rows[..6000].to_vec()), "missing: z-");
    refuses(words, &table(head, [rows[..500].to_vec(), rows[1200..].to_vec()].concat()), "run x+ is cut off");
    refuses(
        words,
        &table(head, [rows[..3600].to_vec(), runs(2.9)[3600..4800].to_vec(), rows[4800..].to_vec()].concat()),
        "forth and back differ",
    );
    let timed = |gap: usize| {
        table(
            "t,run,x,y,z",
            rows.iter()
                .enumerate()
                .map(move |(k, r)| format!("{},{r}", (k + if k < 300 { 0 } else { gap }) as f64 * 0.01)),
        )
    };
    gives(words, &timed(0), "matrix");
    refuses(words, &timed(3), "gap at sample 300");
}

#[test]
fn ellipse_and_ellipsoid() {
    let json = gives(
        "ellipse",
        &table("x,y", circle(2000, 67.3)),
        "centre semi_axes rotation_deg correction.dx correction.dy correction.ky correction.sin_alpha residual_rms \
         extremes.dx extremes.dy extremes.ky rejected sd.centre sd.correction covariance",
    );
    assert!((json["centre"][0].as_f64().unwrap() - 3.0).abs() < 0.1);
    refuses("ellipse", &table("x,y", circle(150, 67.3)), "turns, needs at least 3");
    refuses(
        "ellipse",
        &table("x,y", (0..200).map(|k| f64::from(k - 100) / 50.0).map(|t| format!("{},{}", t.cosh(), t.sinh()))),
        "hyperbola",
    );
    let json = gives(
        "ellipsoid --field 0.5",
        &table("x,y,z", sphere(2000, 1.0)),
        "centre matrix field residual_relative coverage condition rejected sd.matrix covariance",
    );
    assert_eq!(json["field"], 0.5);
    refuses("ellipsoid", &table("x,y,z", sphere(2000, 0.05)), "poor coverage");
    refuses("ellipsoid", &table("x,y,z", sphere(20, 1.0)), "20 samples, needs at least 36");
}

#[test]
fn series_of_one_column() {
    let record = series(3000);
    let words = "allan --rate 100 --column w";
    let keys = "points.tau_s points.dev points.n points.edf points.noise points.low points.high coefficients.Q coefficients.N \
                coefficients.B coefficients.K coefficients.R";
    gives(words, &record, keys);
    for dev in ["adev", "oadev", "mdev", "hdev", "ohdev", "totdev"] {
        gives(&format!("{words} --dev {dev} --taus decade"), &record, keys);
    }
    gives(&format!("{words} --phase --taus 0.01,0.5"), &record, keys);
    gives("psd --rate 100 --column w --segment 256", &record, "frequency_hz density");
    let json = gives("stability --rate 100 --column w --block 1", &record, "blocks mean sd");
    assert_eq!(json["blocks"], 30);
    refuses(words, &series(5), "5 samples, needs at least 8");
    refuses("allan --rate 50 --column w", &record, "time column says 100.000000 Hz, stated are 50.000000 Hz");
    refuses("psd --rate 100 --column w", &series(100), "one segment: 100 samples");
    refuses("stability --rate 100 --column w --block 16", &record, "two blocks: 3000 samples, needs at least 3200");
    cannot_read("allan --rate 100 --column z", &record, ":1:1: no column `z`; the header has t, w");
}

#[test]
fn tilt() {
    let sides = |k: usize| if k < 200 { ("+", 1.035) } else { ("-", -0.985) };
    let flip = |shift: f64| {
        table(
            "position,a",
            (0..400).map(move |k| format!("{},{}", sides(k).0, sides(k).1 + 1e-3 * noise(k) + shift * k as f64)),
        )
    };
    let json = gives("flip", &flip(0.0), "equation offset gain sd.offset sd.gain");
    assert!((json["gain"].as_f64().unwrap() - 1.01).abs() < 1e-3);
    refuses("flip", &flip(1e-4), "position + moved");
    let points = |points: &[&str]| table("temperature,offset", points.iter().map(|p| (*p).to_owned()));
    gives("tilt-temperature", &points(&["-40,15", "25,7", "85,5"]), "a b c ambient_offset slope cold_remainder");
    refuses("tilt-temperature", &points(&["-40,15", "25,7"]), "number of points is 2");
    let budget =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/tilt-budget.toml")).unwrap();
    let json = gives("tilt-budget", &budget, "contributions before.sum_mg after.sum_mg before.tilt_at_zero_deg");
    let rounded = |v: &Value, digits: i32| (v.as_f64().unwrap() * 10_f64.powi(digits)).round();
    assert_eq!((rounded(&json["before"]["sum_mg"], 1), rounded(&json["after"]["sum_mg"], 1)), (1290.0, 224.0));
    assert_eq!(
        (rounded(&json["before"]["tilt_at_zero_deg"], 1), rounded(&json["after"]["tilt_at_zero_deg"], 2)),
        (74.0, 128.0)
    );
    // All mistakes at once.
    let mistaken = "range_deg = 90\n[[contribution]]\nname = 3\nbefore_mg = 1\nafter_g = 2\n";
    assert_eq!(
        mistakes("tilt-budget", mistaken),
        [
            "1:13: range_deg is 90, and must be 0 to 89; try: ",
            "2:1: \"after_mg\" is missing; try: it may be 0 to 1000000",
            "3:8: \"name\" is a whole number, and must be a text in quotes; try: ",
            "5:1: unknown key \"after_g\"; try: did you mean \"after_mg\"?",
        ]
    );
    assert_eq!(
        mistakes("tilt-budget", "range_deg = 30\n"),
        ["1:1: the budget has no contributions; try: begin each with a line [[contribution]]"]
    );
}

#[test]
fn zero_bias() {
    let row = |k: usize| format!("{},{},{}", k / 6000, u8::from(k % 6000 > 5900), 120.0 + (k / 6000) as f64 + noise(k));
    let record = table("cycle,still,w", (0..18_000).map(row));
    let json = gives(
        "zero-bias --rate 100 --repeatability 1 --instability 0.1",
        &record,
        "cycles.before cycles.after rms_before rms_after stored",
    );
    let figure = |key: &str| json[key].as_f64().unwrap();
    assert!(figure("rms_after") < 0.01 * figure("rms_before"), "{json:#}");
    refuses("zero-bias --rate 0", &record, "rate (Hz) is 0");
    refuses("zero-bias --rate 100 --ring 1", &record, "ring (blocks) is 1");
}

fn said(words: &str, record: &str, key: &str) -> String {
    gives(words, record, key)[key]["said"].as_str().unwrap_or_default().to_owned()
}

/// Records of the kinds that made other readers give wrong numbers.
#[test]
fn records_with_troubles() {
    let words = "allan --rate 100 --column w";
    refuses(words, include_str!("trouble/gap-of-5-s-timestamp.csv"), "gap at sample");
    let jittered = include_str!("trouble/host-stamps-jitter.csv");
    let clock = &gives(words, jittered, "clock.rate_hz")["clock"];
    let (rate, jitter) = (clock["rate_hz"].as_f64().unwrap(), clock["jitter_s"].as_f64().unwrap());
    assert!((rate - 100.0).abs() < 4.0 * clock["rate_u_hz"].as_f64().unwrap(), "{clock}");
    assert!((0.0015..0.003).contains(&jitter), "{clock}");
    let german = include_str!("trouble/german-excel.csv");
    let json = gives("stability --rate 100 --column w --block 0.1", german, "understood clock.said");
    assert_eq!(json["understood"], serde_json::json!(["decimal comma"]));
    // 100 Hz for a second, then 1000 Hz.
    let changes = table(
        "t,w",
        (0..6000).map(|i| {
            let at = if i < 100 { i as f64 / 100.0 } else { 1.0 + (i - 100) as f64 / 1000.0 };
            format!("{at:.6},{}", noise(i))
        }),
    );
    refuses(words, &changes, "the rate changes at row 101: 100.000000 Hz before it, 1000.000000 Hz after it");
    assert_eq!(
        said(words, &table("w", (0..3000).map(|k| noise(k).to_string())), "clock"),
        "not checked: no time column"
    );
}

/// Each method that uses a rate refuses stamps of 203.9 Hz if the stated rate is 200 Hz. If the rate is right, the
/// result reports the clock.
#[test]
fn the_clock_is_compared_with_the_rate() {
    let stamped = table("t,w", (0..5000).map(|k| format!("{:.6},{}", k as f64 / 203.9, 7.0 + noise(k))));
    for method in ["allan", "psd", "stability --block 10", "zero-bias"] {
        let (method, options) = method.split_once(' ').unwrap_or((method, ""));
        let words = |rate: f64| format!("{method} --rate {rate} --column w {options}");
        refuses(&words(200.0), &stamped, "1.9500 % apart, allowed are 0.1");
        let clock = said(&words(203.9), &stamped, "clock");
        assert!(clock.starts_with("checked, 203.9") || clock.starts_with("checked, 203.8999"), "{clock}");
        gives(&format!("{} --rate-tolerance 30000", words(200.0)), &stamped, "clock.checked");
    }
    let rows = runs(3.0);
    let at =
        |rate: f64| table("t,run,x,y,z", rows.iter().enumerate().map(|(k, r)| format!("{:.6},{r}", k as f64 / rate)));
    refuses("rotation --rate 100 --turns 3", &at(101.95), "1.9500 % apart, allowed are 0.001");
    refuses("rotation --rate 100 --turns 3", &at(100.02), "0.0200 % apart, allowed are 0.001");
    gives("rotation --rate 100 --turns 3", &at(100.0001), "clock.rate_hz");
}

/// Units of a header are used: the same record in deg/s and in rad/s gives the same bias. Contradictions are refused.
#[test]
fn units_of_a_header_are_used() {
    let rows = |factor: f64| still(100, 1e-6 * factor, |i, f| factor * (0.01 * i as f64 + 1e-4 * f + 1e-3));
    let deg = 1.0_f64.to_degrees();
    let words = "gyro-still --latitude 34";
    let plain = gives(words, &table("position,x,y,z", rows(1.0)), "bias_rps");
    let bias = |json: &Value| json["bias_rps"][1].as_f64().unwrap();
    for (head, factor) in [
        ("position,x [deg/s],y [deg/s],z [deg/s]", deg),
        ("POSITION,X (dps),Y (dps),Z (dps)", deg),
        ("position,x_dps,y_dps,z_dps", deg),
        ("position,x [°/s],y [°/s],z [°/s]", deg),
        ("position,x,y,z\n,deg/h,deg/h,deg/h", deg * 3600.0),
        ("position,x [rad/s],y [rad/s],z [rad/s]", 1.0),
    ] {
        let json = gives(words, &table(head, rows(factor)), "units.x");
        assert!((bias(&json) / bias(&plain) - 1.0).abs() < 1e-9, "{head}: {json:#}");
    }
    let rad = table("position,x [rad/s],y [rad/s],z [rad/s]", rows(1.0));
    cannot_read(&format!("{words} --deg"), &rad, "are in rad/s, but --deg says deg/s");
    cannot_read(&format!("{words} --response 1000"), &rad, "are in rad/s, but --response says that they are counts");
    let wrong = table("position,x [mg],y [mg],z [mg]", rows(1.0));
    cannot_read(words, &wrong, "column `x` is in mg, but the method works with angular rate");
    let some = table("position,x [rad/s],y,z", rows(1.0));
    cannot_read(words, &some, "column `x` has rad/s, column `y` has no unit");
}

#[test]
fn gravity_in_other_units_is_refused() {
    let record = table("position,x,y,z", still(100, 0.1, |i, f| 9800.0 * f + 50.0 * i as f64));
    for gravity in ["979", "1", "9.6"] {
        refuses(&format!("six-position --gravity {gravity}"), &record, "expected 9.7 to 9.9: 979 is in Gal and 1 in g");
        gives(&format!("six-position --gravity {gravity} --any-gravity"), &record, "matrix");
    }
}

/// An export of this station with rotations among the positions, and captures chosen by name.
#[test]
fn exports_are_read() {
    let head = "capture,series,position,run,number,t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,mag_x,mag_y,mag_z";
    let capture = |name: &str, position: &str, run: &str, rows: &[String]| -> Vec<String> {
        let row = |(k, r): (usize, &String)| {
            let values = r.split_once(',').map_or("", |(_, v)| v);
            format!("\"{name}\",1,{position},{run},{k},{:.6},{values},{values},{values}", k as f64 / 100.0)
        };
        rows.iter().enumerate().map(row).collect()
    };
    let positions = still(100, 0.1, |i, f| 9800.0 * f + 50.0 * i as f64);
    let turns = runs(3.0);
    let mut rows = Vec::new();
    for (i, label) in LABELS.iter().enumerate() {
        rows.extend(capture(&format!("still, {label}"), label, "", &positions[i * 100..(i + 1) * 100]));
        rows.extend(capture(&format!("turn {label}"), "", label, &turns[i * 1200..(i + 1) * 1200]));
    }
    let export = table(head, rows);
    let same = |words: &str, plain: String, key: &str| {
        let (a, b) = (gives(words, &export, key), gives(words, &plain, key));
        assert_eq!(a[key], b[key], "{words}");
    };
    same("six-position --gravity 9.8", table("position,x,y,z", positions), "matrix");
    same("rotation --rate 100 --turns 3", table("run,x,y,z", turns.clone()), "matrix");
    cannot_read("allan --rate 100 --column gyro_x", &export, "#turn z+ #still, z- #turn z-");
}

/// Without `--rate` the rate is that of the time column, if the column gives it well enough.
#[test]
fn the_record_tells_its_rate() {
    let stamped = |head: &str, step: f64, jitter: f64, count: usize| {
        let row = |k: usize| format!("{:.6},{}", (k as f64 + jitter * noise(3 * k)) * step, 7.0 + noise(k));
        table(head, (0..count).map(row))
    };
    let check = |head: &str, step: f64, rate_hz: f64| {
        let record = stamped(head, step, 0.0, 4000);
        for words in ["allan", "psd", "stability --block 1", "zero-bias"] {
            let keys = if words == "psd" { "density" } else { "clock" };
            let mut told = gives(&format!("{words} --column w"), &record, keys);
            let understood = told["understood"].take();
            assert!(understood.to_string().contains(&format!("{rate_hz} Hz of column")), "{words} {understood}");
            let mut stated = gives(&format!("{words} --column w --rate {rate_hz}"), &record, keys);
            for json in [&mut told, &mut stated] {
                json.as_object_mut().unwrap().retain(|key, _| key != "understood" && key != "clock");
            }
            assert_eq!(told, stated, "{words}");
        }
    };
    check("t_s,w", 0.005, 200.0);
    check("t,w", 0.01, 100.0);
    check("time_ms,w", 2.5, 400.0);
    let unknown = |head: &str, step: f64, why: &str| {
        cannot_read("allan --column w", &stamped(head, step, 0.0, 400), why);
    };
    unknown("n,w", 1.0, "the sample rate is not known: no time column");
    unknown(
        "timestamp,w",
        7.0,
        "the sample rate is not known: the header names no unit of `timestamp`; its times have no gap",
    );
    unknown(
        "t,w",
        5.0,
        "the sample rate is not known: column `t` names no unit, and steps of 5 may be s, ms or numbers of samples",
    );
    // Jitter hides the rate of a short record: the rate is good enough for a density, but not for a scale factor.
    let jittery: Vec<String> = runs(3.0)
        .iter()
        .enumerate()
        .map(|(k, row)| format!("{:.6},{row}", (k as f64 + 0.05 * noise(5 * k)) * 0.01))
        .collect();
    let record = table("t_s,run,x,y,z", jittery);
    match compute("rotation --turns 3", &record) {
        Err(e @ ComputeError::Unreadable(_)) => {
            assert!(e.to_string().contains("ppm, but the method needs +- 10 ppm"), "{e}");
            assert_eq!(e.try_this(), Some("give the rate with --rate HZ"));
        }
        other => panic!("{:?}", other.map(|outcome| outcome.report.table(Lang::En))),
    }
    gives("rotation --turns 3 --rate 100", &record, "matrix");
}

/// Stamps with jitter give 100 Hz to some parts in a million, and yet blocks have whole samples.
#[test]
fn blocks_of_a_rate_that_stamps_tell() {
    let row = |k: usize| format!("{:.6},{}", (k as f64 + 0.05 * noise(3 * k)) * 0.01, 7.0 + noise(k));
    let record = table("t,w", (0..2000).map(row));
    let mut told = gives("stability --column w --block 1", &record, "understood block_samples");
    assert_eq!((told["block_samples"].as_f64(), told["blocks"].as_f64()), (Some(100.0), Some(20.0)));
    let understood = told["understood"].take().to_string();
    assert!(understood.contains("blocks of 100 samples, 1.0000"), "{understood}");
    // Over 20 s the jitter of 0.4 ms leaves about 1e-5 Hz open: no digits beyond.
    let rate = understood.split(" Hz of column").next().unwrap().rsplit('"').next().unwrap();
    assert!((rate.parse::<f64>().unwrap() - 100.0).abs() < 0.01 && rate.len() <= 9, "{understood}");
    let stated = gives("stability --column w --block 1 --rate 100", &record, "understood");
    assert_eq!(told["block_means"], stated["block_means"]);
    let plain = table("w", (0..2000).map(|k| noise(k).to_string()));
    refuses(
        "stability --column w --block 1 --rate 99.98",
        &plain,
        "block (s) is 1, expected a whole number of samples",
    );
}

/// The command line itself checks what people type.
#[test]
fn usage() {
    for words in [
        "compute",
        "compute six-position f",
        "compute rotation f --rate 1 --turns 1 --axis vertical",
        "compute allan f --rate 1",
    ] {
        assert!(Command::try_parse_from(words.split(' ')).is_err(), "{words}");
    }
}

/// Output of a sensor of 200 LSB per deg/s at eleven rates in each of these cycles, with `rows` rows at each rate.
fn rated(cycles: usize, rows: usize, cubic: f64) -> Vec<String> {
    let row = |k: usize| {
        let (cycle, rate) = (k / (11 * rows), (k / rows % 11) as f64 * 60.0 - 300.0);
        let gain = 200.0 * (1.0 + 2e-5 * [0.0, 1.0, -0.5][cycle % 3]);
        format!("{rate},{},{}", gain * rate + 31.0 + cubic * rate.powi(3) + noise(7 * k), cycle + 1)
    };
    (0..11 * rows * cycles).map(row).collect()
}

#[test]
fn scale_factors() {
    let head = "rate,x,cycle";
    let json = gives(
        "scale-factor",
        &table(head, rated(3, 20, 0.0)),
        "equation scale_factor offset bias sd.scale_factor expanded.scale_factor expanded_ppm dof residual_rms full_scale \
         nonlinearity_full_scale.ppm nonlinearity_full_scale.low_ppm nonlinearity_output.at_rate asymmetry.ppm \
         asymmetry.expanded_ppm repeatability.relative_ppm repeatability.sd_high lack_of_fit.p points.residual \
         points.of_output_ppm cycles.scale_factor label",
    );
    let number = |key: &str| json.pointer(key).and_then(Value::as_f64).unwrap();
    assert!((number("/scale_factor") - 200.0).abs() < number("/expanded/scale_factor") && number("/dof") == 2.0);
    assert!((number("/bias") - 31.0 / 200.0).abs() < 1e-3, "measured less true, by the output at rest");
    // Gains of 0, 20 and -10 ppm: with n - 1 the deviation is 15.3.
    assert!((number("/repeatability/relative_ppm") - 15.275).abs() < 1.0);
    assert_eq!((json["points"].as_array().unwrap().len(), json["suspects"].as_array().unwrap().len()), (11, 0));
    // A cubic term of 27 LSB at the full scale of 60,000.
    let bent = gives("scale-factor", &table(head, rated(3, 20, 1e-6)), "lack_of_fit.p");
    assert!(bent["lack_of_fit"]["p"].as_f64().unwrap() < 1e-6, "{bent:#}");
    assert!(bent["nonlinearity_full_scale"]["ppm"].as_f64().unwrap() > 50.0);
}

#[test]
fn scale_factors_of_one_cycle_and_refusals() {
    let rows: Vec<String> = rated(1, 1, 0.0).iter().map(|row| row.rsplit_once(',').unwrap().0.to_owned()).collect();
    let json = gives(
        "scale-factor",
        &table("rate,x", rows.clone()),
        "absent.repeatability absent.lack_of_fit nonlinearity_full_scale.interval_absent asymmetry.expanded_ppm",
    );
    assert!(json["repeatability"].is_null() && json["dof"] == 9.0);
    let one_sense = gives("scale-factor", &table("rate,x", rows[5..].to_vec()), "absent.asymmetry");
    assert_eq!(one_sense["absent"]["asymmetry"], "0 rates of the negative sense, a line needs 2");
    // Other names, and times with gaps, which have no meaning here.
    let timed = rows.iter().enumerate().map(|(k, row)| format!("{},{row}", k * k));
    gives("scale-factor --input table --column wx", &table("t,table,wx", timed), "scale_factor");
    // Rates as an encoder measures them, with the points numbered and without.
    let measured = |k: usize| (60.0 * (k / 50) as f64 - 300.0) + 0.01 * noise(k);
    let sample = |k: usize| format!("{},{},{}", k / 50, measured(k), 200.0 * measured(k) + noise(9 * k));
    let numbered = gives("scale-factor", &table("point,rate,x", (0..550).map(sample)), "scale_factor");
    assert!(numbered["points"].as_array().unwrap().len() == 11 && numbered.get("note").is_none());
    let unnumbered = (0..550).map(|k| sample(k).split_once(',').unwrap().1.to_owned());
    gives("scale-factor", &table("rate,x", unnumbered), "note");
    refuses("scale-factor", &table("rate,x", rows[..2].to_vec()), "2 different rates, needs at least 3");
    refuses("scale-factor", &table("rate,x", ["1,5", "2,5", "3,5"].map(str::to_owned)), "output: all 3 samples are 5");
    let wrong = rows.iter().map(|row| row.strip_prefix("-300,").map_or(row.clone(), |x| format!("300,{x}")));
    refuses("scale-factor", &table("rate,x", wrong), "(row 1) misses the line by");
    refuses("scale-factor --full-scale 0", &table("rate,x", rows.clone()), "full scale is 0");
    cannot_read("scale-factor", &table("rate,y", rows), ":1:1: no column `x`; the header has rate, y");
}

#[test]
fn repeatabilities() {
    // Worked out by hand: 1 to 6 have a standard deviation of sqrt(3.5), t of 5 is 2.5706.
    let figures = (1..=6).map(|k| k.to_string());
    let json =
        gives("repeatability", &table("x", figures), "runs mean sd sd_low sd_high mean_expanded means.deviation");
    let number = |key: &str| json[key].as_f64().unwrap();
    assert!((number("sd") - 3.5_f64.sqrt()).abs() < 1e-12 && number("mean") == 3.5);
    assert!((number("mean_expanded") - 2.570_582 * (3.5_f64 / 6.0).sqrt()).abs() < 1e-5);
    assert!(json["noise_of_a_mean"].is_null() && json["absent"]["noise_of_a_mean"].is_string());
    let rows = |run: usize| (0..100).map(move |k| format!("{run},{}", run as f64 + 0.1 * noise(100 * run + k)));
    let many = gives("repeatability", &table("run,x", (1..=6).flat_map(rows)), "noise_of_a_mean means.rows");
    assert!((many["sd"].as_f64().unwrap() - 3.5_f64.sqrt()).abs() < 0.02 && many["means"][5]["rows"] == 100);
    let white = many["noise_of_a_mean"].as_f64().unwrap();
    assert!((0.002..0.006).contains(&white), "0.1 x 0.4 / sqrt(100): {white}");
    refuses("repeatability", &table("x", ["3".to_owned()]), "runs: 1 samples");
    refuses("repeatability", &table("x", ["3", "3", "3"].map(str::to_owned)), "all 3 figures of the runs are 3");
    let dead = (0..100).map(|_| "7,5".to_owned());
    refuses(
        "repeatability",
        &table("run,x", (1..=6).flat_map(rows).chain(dead)),
        "x stands still at 5 for 100 samples of run 7",
    );
}

#[test]
fn a_dead_sensor_is_not_stable() {
    let dead = table("w", (0..1000).map(|_| "7".to_owned()));
    for method in ["stability --rate 100 --block 1", "psd --rate 100 --segment 64", "allan --rate 100"] {
        refuses(&format!("{method} --column w"), &dead, "record: all 1000 samples are 7");
    }
}
