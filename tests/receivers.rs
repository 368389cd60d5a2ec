//! Logs of receivers in bad conditions, each judged right and for the right reason. `hw-mocks/receivers/make.py` makes
//! the logs, and the simulated receiver plays them. The files beside the logs say how the functional plan should end
//! and which measurements decide it.

#![expect(clippy::expect_used, reason = "what cannot be set up fails the test that needs it")]

use std::path::{Path, PathBuf};
use std::process::Command;

use gnc_tests::{Place, repository};
use hw_mocks::{Personality, beside};
use serde_json::Value;

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");

fn receivers() -> Vec<PathBuf> {
    let folder = repository().join("hw-mocks/receivers");
    let files = std::fs::read_dir(folder).expect("hw-mocks/receivers").map(|entry| entry.expect("a file").path());
    let mut receivers: Vec<PathBuf> = files.filter(|path| path.extension().is_some_and(|end| end == "toml")).collect();
    receivers.sort();
    receivers
}

/// Names of the failed measurements of an item, sorted.
fn failed(record: &Value, item: &str) -> Vec<String> {
    let items = record["items"].as_array().into_iter().flatten();
    let attempts =
        items.filter(|row| row["name"] == item).flat_map(|row| row["attempts"].as_array().into_iter().flatten());
    let measured = attempts.flat_map(|attempt| attempt["measurements"].as_array().into_iter().flatten());
    let bad = measured.filter(|measurement| measurement["outcome"] == "failed");
    let mut names: Vec<String> = bad.filter_map(|bad| bad["name"].as_str().map(str::to_owned)).collect();
    names.sort();
    names.dedup();
    names
}

/// The mistake in the judgement of a receiver, if there is one.
fn check(receiver: &Path) -> Option<String> {
    let name = receiver.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let text = std::fs::read_to_string(receiver).expect("a receiver");
    let personality =
        Personality::with_files(&name, &text, &mut beside(receiver, hw_mocks::Reach::Folder)).expect("a personality");
    let expected = personality.expect.get("functional").expect("what it expects of the plan");
    let place = Place::new(STATION);
    let sim = format!("--sim={}", receiver.display());
    let run = place.functional(&sim, &["--sim-speed", "max", "--only", "identity,gnss"]);
    let record = place.record();
    let context = format!("{name}\n{}{}", run.stdout, run.stderr);
    let mut figures = expected.figures.clone();
    figures.sort();
    let (outcome, found) = (&record["selection_outcome"], failed(&record, "gnss"));
    let right = *outcome == expected.outcome.as_str() && found == figures;
    (!right).then(|| format!("{context}\n{outcome} {found:?} should be {} {figures:?}\n", expected.outcome.as_str()))
}

#[test]
fn every_receiver_is_judged_by_its_reason() {
    let receivers = receivers();
    assert!(receivers.len() > 30, "{receivers:?}");
    let wrong: Vec<String> = receivers.iter().filter_map(|receiver| check(receiver)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The measurements of the item `gnss` for a receiver under named limits, and the exit code of the run.
fn measured(receiver: &str, limits: &str) -> (Option<i32>, Vec<Value>) {
    let place = Place::new(STATION);
    let plan = format!(
        "name = \"receiver\"\nversion = \"1\"\n\n[[item]]\nid = \"gnss\"\n\
         params = {{ start = \"hot\", window = \"2 s\", timeout = \"60 s\" }}\n[item.limits]\n{limits}\n"
    );
    let plan = place.write("receiver.toml", &plan).display().to_string();
    let receiver = repository().join("hw-mocks/receivers").join(receiver);
    let sim = format!("--sim={}", receiver.display());
    let run = place.run(["--auto", &plan, &sim, "--sim-speed", "max", "--serial-number", "T-1"]);
    let measurements = place.record()["items"][0]["attempts"][0]["measurements"].clone();
    (run.code, measurements.as_array().cloned().unwrap_or_default())
}

fn named<'a>(measurements: &'a [Value], name: &str) -> &'a Value {
    measurements.iter().find(|measurement| measurement["name"] == name).expect(name)
}

/// RTK boxes send no GSA: the plan decides whether a fix of unknown dimensions is enough.
#[test]
fn the_plan_says_whether_unknown_dimensions_suffice() {
    let (code, _) = measured("no-gsa.toml", "fix_type = \"== dimensions unknown\"");
    assert_eq!(code, Some(0));
    let (code, measurements) = measured("no-gsa.toml", "fix_type = \"== 3D\"");
    assert_eq!((code, named(&measurements, "fix_type")["value"].as_str()), (Some(1), Some("dimensions unknown")));
    assert_eq!(named(&measurements, "vdop")["raw"], "GSA does not give it");
}

/// GSA comes with every fifth second, so a window of 2 s may have none: the station waits for it.
#[test]
fn dimensions_are_waited_for() {
    let (code, measurements) = measured("gsa-every-5th-epoch.toml", "fix_type = \"== 3D\"");
    assert_eq!(code, Some(0), "{measurements:?}");
}

#[test]
fn a_figure_that_does_not_exist_has_its_reason() {
    let (_, measurements) = measured("no-geoid.toml", "height_error = \"<= 45 m\"");
    for name in ["height", "height_error"] {
        let figure = named(&measurements, name);
        let why = figure["raw"].as_str().unwrap_or_default();
        assert!(figure["value"].is_null() && why.contains("no geoid separation"), "{figure}");
    }
    let (_, measurements) = measured("gll-alone.toml", "fix_type = \"== dimensions unknown\"");
    for name in ["height", "height_error", "ground_speed", "satellites_used", "hdop", "vdop"] {
        let figure = named(&measurements, name);
        assert!(figure["value"].is_null() && figure["raw"].as_str().is_some_and(|why| why.len() > 10), "{figure}");
    }
}

/// Errors of the receiver stand in the record by name, and messages of other protocols by number.
#[test]
fn faults_and_frames_are_named() {
    let fault = |receiver| {
        let (code, measurements) = measured(receiver, "receiver_faults = \"<= 0\"");
        assert_eq!(code, Some(1), "{measurements:?}");
        named(&measurements, "receiver_fault")["value"].as_str().unwrap_or_default().to_owned()
    };
    assert_eq!(fault("minutes-of-73.toml"), "GGA: latitude `3473.92600` has minutes of 60 or more");
    assert_eq!(
        fault("longitude-of-4-digits.toml"),
        "GGA: longitude `0854.92400` has 4 digits before the point, and should have 5"
    );
    assert_eq!(fault("rmc-void.toml"), "RMC is void where GGA of the same time says a fix");
    let (code, measurements) =
        measured("mixed-protocols.toml", "sentence_errors = \"<= 0\"\nforeign_frames = \">= 6\"");
    assert_eq!(code, Some(0), "{measurements:?}");
    let (_, measurements) = measured("only-ubx.toml", "fix_type = \"== 3D\"");
    let fix = named(&measurements, "fix_type")["value"].as_str().unwrap_or_default();
    assert!(fix.starts_with("none (no sentence heard, but frames: ") && fix.ends_with(" UBX)"), "{fix}");
}

/// The functional test accepts a receiver's claim of a 3D fix up to its limit of 30 m. The accuracy is measured.
#[test]
fn a_3d_fix_of_15_m_is_no_accuracy_of_10_m() {
    let place = Place::new(STATION);
    let plan = place.write(
        "accuracy.toml",
        "name = \"accuracy\"\nversion = \"1\"\n\n[[item]]\nid = \"gnss-accuracy\"\nparams = { duration = \"60 s\" }\n\
         [item.limits]\nposition_horizontal = \"<= 10 m\"\nposition_height = \"<= 15 m\"\n",
    );
    let receiver = repository().join("hw-mocks/receivers/fix-of-15-m.toml");
    let (plan, sim) = (plan.display().to_string(), format!("--sim={}", receiver.display()));
    let run = place.run(["--auto", &plan, &sim, "--sim-speed", "max", "--serial-number", "T-1"]);
    assert_eq!(run.code, Some(1), "{}{}", run.stdout, run.stderr);
    assert_eq!(failed(&place.record(), "gnss-accuracy"), ["position_horizontal"], "{}", run.stdout);
}

/// The logs are equal to those that the script makes.
#[test]
fn the_logs_are_made_by_their_script() {
    let place = Place::new(STATION);
    let folder = repository().join("hw-mocks/receivers");
    let made = Command::new("python3").arg(folder.join("make.py")).arg(place.path()).status();
    // Without Python the logs cannot be compared.
    let Ok(made) = made else { return };
    assert!(made.success());
    for entry in std::fs::read_dir(place.path()).expect("the logs") {
        let path = entry.expect("a log").path();
        let name = path.file_name().expect("a name");
        assert_eq!(std::fs::read(&path).ok(), std::fs::read(folder.join(name)).ok(), "{}: run make.py", path.display());
    }
}
