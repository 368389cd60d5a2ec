//! What receivers say on bad days, each judged rightly and by its reason: logs made by `hw-mocks/receivers/make.py`, played
//! by the simulated receiver. The files beside the logs say how the functional plan should end and which measurements
//! decide it.

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

/// Names of the measurements of an item that failed, in the order of their names.
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

fn check(receiver: &Path) {
    let name = receiver.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let text = std::fs::read_to_string(receiver).expect("a receiver");
    let personality = Personality::with_files(&name, &text, &mut beside(receiver)).expect("a personality");
    let expected = personality.expect.get("functional").expect("what it expects of the plan");
    let place = Place::new(STATION);
    let sim = format!("--sim={}", receiver.display());
    let run = place.functional(&sim, &["--sim-speed", "max", "--only", "identity,gnss"]);
    let record = place.record();
    let context = format!("{name}\n{}{}", run.stdout, run.stderr);
    assert_eq!(record["outcome"], expected.outcome.as_str(), "{context}");
    let mut figures = expected.figures.clone();
    figures.sort();
    assert_eq!(failed(&record, "gnss"), figures, "{context}");
}

#[test]
fn every_receiver_is_judged_by_its_reason() {
    let receivers = receivers();
    assert!(receivers.len() > 10, "{receivers:?}");
    receivers.iter().for_each(|receiver| check(receiver));
}

/// A receiver that calls it a 3D fix is believed so far: the functional test allows 30 m. Its accuracy is measured.
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

/// The logs are those that the script makes.
#[test]
fn the_logs_are_made_by_their_script() {
    let place = Place::new(STATION);
    let folder = repository().join("hw-mocks/receivers");
    let made = Command::new("python3").arg(folder.join("make.py")).arg(place.path()).status();
    // Where there is no Python the logs are what they are.
    let Ok(made) = made else { return };
    assert!(made.success());
    for entry in std::fs::read_dir(place.path()).expect("the logs") {
        let path = entry.expect("a log").path();
        let name = path.file_name().expect("a name");
        assert_eq!(std::fs::read(&path).ok(), std::fs::read(folder.join(name)).ok(), "{}: run make.py", path.display());
    }
}
