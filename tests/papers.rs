//! The papers of a run, passport and report, against the truth of the simulated bench and against the record.

#![expect(clippy::expect_used, reason = "what cannot be set up fails the test that needs it")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use gnc_records::store::{as_written, digest};
use gnc_tests::{PARTIAL, Place, Run, bad_items, read_json};
use hw_mocks::devices::inertial::SensorModels;
use hw_mocks::devices::inertial::model::PUBLISHED;
use serde_json::Value;

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");

/// A plan with everything that a passport needs, as short as possible.
const SHORT: &str = include_str!("papers/short.toml");

/// A text that a scanner may read or an operator may type.
const HOSTILE: &str = "<script>alert(1)</script>&\"']]>";

fn run(place: &Place, plan: &str, more: &[&str]) -> Run {
    place.write("p.toml", plan);
    let fixed = ["--auto", "p.toml", "--sim", "--sim-speed", "max", "--serial-number", HOSTILE, "--operator", HOSTILE];
    place.run(fixed.into_iter().chain(more.iter().copied()))
}

fn folder(place: &Place) -> PathBuf {
    let runs = place.runs();
    assert_eq!(runs.len(), 1, "{runs:?}");
    runs[0].clone()
}

fn report(folder: &Path) -> String {
    fs::read_to_string(folder.join("report.html")).expect("a report")
}

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).expect(pointer)
}

#[test]
fn a_calibrated_module_gets_its_passport() {
    let place = Place::new(STATION);
    let head = "version = \"1 <b>&amp;'\"\n[numbers.order]\nlabel = \"Order <b>\"";
    let ended = run(&place, &SHORT.replace("version = \"1\"", head), &["--number", "order=PO-1 </value>"]);
    assert_eq!(ended.code, Some(0), "{}{}", ended.stdout, ended.stderr);
    let folder = folder(&place);
    let passport = read_json(&folder.join("passport.json"));
    let number = serde_json::json!({ "key": "order", "label": "Order <b>", "value": "PO-1 </value>" });
    assert_eq!(passport["origin"]["numbers"], serde_json::json!([number]));
    it_tells_the_truth(&passport);
    compute_says_the_same(&place, &folder, &passport);
    its_texts_stay_texts(&folder, &passport);
    another_one_is_found(&folder);
    // This one spoils the record.
    it_belongs_to_the_sealed_record(&place, &folder, &passport);
}

/// A passport with another number in one of its forms is found, although the digests cover it.
fn another_one_is_found(folder: &Path) {
    let sums = folder.join("SHA256SUMS");
    let written = fs::read_to_string(&sums).expect("digests");
    assert_eq!(as_written::verify(folder), Vec::<String>::new());
    for (name, supply, other, what) in [
        ("passport.json", "\"supply_V\": ", "\"supply_V\": 1", "passport.json does not say what events.jsonl says"),
        ("passport.xml", "<supply_V>", "<supply_V>1", "passport.xml does not say what passport.json says"),
    ] {
        let path = folder.join(name);
        let (text, was) = (fs::read_to_string(&path).expect(name), digest::of_file(&path).expect(name));
        assert!(text.contains(supply), "{text}");
        fs::write(&path, text.replacen(supply, other, 1)).expect("writable");
        fs::write(&sums, written.replace(&was, &digest::of_file(&path).expect(name))).expect("writable");
        assert_eq!(as_written::verify(folder), [what]);
        fs::write(&path, text).expect("writable");
    }
    fs::write(&sums, written).expect("writable");
}

/// The module's own truth, which the station never sees, appears under the published names.
fn it_tells_the_truth(passport: &Value) {
    assert_eq!(passport["origin"]["simulated"], true, "a simulated bench is no evidence");
    assert!((number(passport, "/conditions/supply_V") - 5.0).abs() < 0.25);
    let truth = SensorModels::published(&PUBLISHED[0]);
    let near = |pointer: String, truth: f64, within: f64| {
        let value = number(passport, &pointer);
        assert!((value - truth).abs() < within, "{pointer}: {value}, truth {truth}");
    };
    for i in 0..3 {
        // Flicker and turn-on of a good part: a tenth of a mg; for a gyroscope some 10 deg/h, and the module's heat.
        near(format!("/accel/b_a_mg/{i}"), truth.accel.bias[i] * 1e3, 1.0);
        near(format!("/gyro/b_g_dps/{i}"), truth.gyro.bias[i], 0.02);
        for j in 0..3 {
            near(format!("/accel/M_a/{i}/{j}"), truth.accel.response[(i, j)], 1e-3);
            near(format!("/gyro/M_g/{i}/{j}"), truth.gyro.response[(i, j)], 1e-3);
            near(format!("/gyro/K_g_full_dps_per_g/{i}/{j}"), truth.gyro_per_g[(i, j)], 5e-3);
        }
    }
}

/// `compute` on the raw samples of the run finds the same biases as items and passport, with their sign.
fn compute_says_the_same(place: &Place, folder: &Path, passport: &Value) {
    let compute = |item: &str, words: &[&str]| -> Value {
        let file = folder.join(item).join("attempt-1.mcap");
        let words = ["compute", words[0], file.to_str().expect("UTF-8"), "--json"]
            .into_iter()
            .chain(words[1..].iter().copied());
        let ended = place.run(words);
        assert_eq!(ended.code, Some(0), "{}{}", ended.stdout, ended.stderr);
        serde_json::from_str(&ended.stdout).expect("JSON")
    };
    let near = |name: &str, value: f64, expected: f64, within: f64| {
        assert!((value - expected).abs() < within, "{name}: {value}, passport {expected}");
    };
    let six = compute("03-six-position", &["six-position", "--gravity", "9.80665"]);
    // Counts for one rad/s of the nominal gyroscope.
    let response = (20_000.0 * 1.0_f64.to_degrees()).to_string();
    let still = compute("03-six-position", &["gyro-still", "--latitude", "34.2", "--response", &response]);
    let turned = compute("05-rotation", &["rotation", "--rate", "1000", "--turns", "3"]);
    for i in 0..3 {
        // The item knows the gravity of the place, 0.1 % off, and the headings: a horizontal earth rate of 0.0035
        // deg/s.
        let (accel_mg, gyro_dps) =
            (number(passport, &format!("/accel/b_a_mg/{i}")), number(passport, &format!("/gyro/b_g_dps/{i}")));
        near("accelerometer", number(&six, &format!("/bias_mg/{i}")), accel_mg, 0.02);
        near("still gyroscope", number(&still, &format!("/bias_rps/{i}")).to_degrees(), gyro_dps, 0.0035);
        // In the position of the turns g-sensitivity adds some 0.01 deg/s to 0.05 and more.
        near("turned gyroscope", number(&turned, &format!("/bias_rps/{i}")).to_degrees(), gyro_dps, 0.03);
    }
}

/// Texts from a scanner, an operator or a plan stay texts in all papers.
fn its_texts_stay_texts(folder: &Path, passport: &Value) {
    let report = report(folder);
    assert!(report.contains("Sensor passport") && report.contains("SIMULATED BENCH"));
    assert!(!report.contains("<script") && !report.contains("<b>"), "markup got through");
    assert!(report.contains("&lt;script&gt;alert(1)&lt;/script&gt;"));
    assert_eq!(passport["device_id"], HOSTILE);
    assert_eq!(passport["origin"]["plan"], "papers 1 <b>&amp;'");
    let xml = fs::read_to_string(folder.join("passport.xml")).expect("a passport");
    assert!(!xml.contains("<script") && !xml.contains("<b>") && xml.contains("&lt;script&gt;alert(1)"), "{xml}");
}

/// The digest in the passport follows from the list of digests, which also covers the passport.
fn it_belongs_to_the_sealed_record(place: &Place, folder: &Path, passport: &Value) {
    let command = r"grep -vE '  (passport.json|passport.xml|report.html)$' SHA256SUMS | sha256sum";
    let output = Command::new("sh").args(["-c", command]).current_dir(folder).output().expect("a shell");
    let digest = String::from_utf8_lossy(&output.stdout);
    assert_eq!(digest.split_whitespace().next(), passport["origin"]["record_sha256"].as_str());
    let shown = place.run(["records", "show", folder.to_str().expect("UTF-8")]);
    let line = shown.stdout.lines().find_map(|line| line.strip_prefix("Record: SHA-256 "));
    assert_eq!(line, passport["origin"]["record_sha256"].as_str(), "an audit compares the two: {}", shown.stdout);
    let sums = fs::read_to_string(folder.join("SHA256SUMS")).expect("digests");
    assert!(sums.contains("  passport.json\n") && sums.contains("  passport.xml\n"), "{sums}");
    assert_eq!(place.run(["records", "verify"]).code, Some(0));

    let again = place.run(["recompute", folder.to_str().expect("UTF-8")]);
    assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
    assert!(
        again.stdout.contains("the same, bit for bit") && again.stdout.contains("the passport too"),
        "{}",
        again.stdout
    );

    // A forged, better bias.
    let path = folder.join("passport.json");
    let text = fs::read_to_string(&path).expect("a passport");
    let bias = number(passport, "/accel/b_a_mg/0").to_string();
    assert!(text.contains(&bias), "{bias} is not in the passport");
    fs::write(&path, text.replacen(&bias, "0.5", 1)).expect("a passport");
    let again = place.run(["recompute", folder.to_str().expect("UTF-8")]);
    assert_eq!(again.code, Some(1), "{}{}", again.stdout, again.stderr);
    let expected = format!("passport.json /accel/b_a_mg/0 was 0.5, is {bias}");
    assert!(again.stdout.contains(&expected), "{}", again.stdout);
    assert!(
        again.stdout.contains("passport.json was changed") && again.stdout.contains("not the same"),
        "{}",
        again.stdout
    );
    fs::remove_file(folder.join("passport.xml")).expect("a passport");
    let again = place.run(["recompute", folder.to_str().expect("UTF-8")]);
    assert!(again.stdout.contains("passport.xml cannot be read"), "{}", again.stdout);
}

/// A failed module has no passport, even with a good calibration. Judged by other limits it may get one, beside the
/// run.
#[test]
fn a_failed_run_has_no_passport() {
    let place = Place::new(STATION);
    let ended = run(&place, &SHORT.replace("-5 % .. 5 %", "-0.0001 % .. 0.0001 %"), &[]);
    assert_eq!(ended.code, Some(1), "{}{}", ended.stdout, ended.stderr);
    let failed = folder(&place);
    assert!(!failed.join("passport.json").exists() && !failed.join("passport.xml").exists());
    assert!(report(&failed).contains("None: the run failed"), "the report does not say why");
    let again = place.run(["recompute", failed.to_str().expect("UTF-8")]);
    assert!(again.code == Some(0) && again.stdout.contains("no passport: the run failed"), "{}", again.stdout);
    // A passport that was inserted later is noticed.
    fs::write(failed.join("passport.json"), "{}").expect("a file");
    let again = place.run(["recompute", failed.to_str().expect("UTF-8")]);
    assert!(again.code == Some(1) && again.stdout.contains("earns none: the run failed"), "{}", again.stdout);
    fs::remove_file(failed.join("passport.json")).expect("a file");

    place.write("other.toml", SHORT);
    let other = place.run(["recompute", failed.to_str().expect("UTF-8"), "--plan", "other.toml"]);
    assert_eq!(other.code, Some(0), "{}{}", other.stdout, other.stderr);
    let beside = place.runs().into_iter().find(|run| run.to_string_lossy().ends_with("-recomputed")).expect("a folder");
    assert_eq!(bad_items(&read_json(&beside.join("run.json"))), [""; 0]);
    let passport = read_json(&beside.join("passport.json"));
    let name = failed.file_name().and_then(|name| name.to_str());
    assert_eq!(passport["origin"]["recomputed_from"].as_str(), name);
    assert_eq!(place.run(["records", "verify"]).code, Some(0));
}

/// A run of chosen items gives no passport.
#[test]
fn chosen_items_give_no_passport() {
    let place = Place::new(STATION);
    let ended = run(&place, SHORT, &["--only", "identity,six-position,gyro-still,rotation"]);
    assert_eq!(ended.code, PARTIAL, "{}{}", ended.stdout, ended.stderr);
    let folder = folder(&place);
    assert!(!folder.join("passport.json").exists());
    assert!(report(&folder).contains("None: only chosen items of the plan were run"));
}
