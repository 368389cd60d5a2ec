//! Items that capture: raw samples are on disk in all cases, and every figure comes from them alone.

#![expect(clippy::expect_used, reason = "what cannot be set up fails the test that needs it")]

use std::fs::{self, File};
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::Stdio;

use gnc_analysis::capture::Pose;
use gnc_records::raw::{self, RawRecord};
use gnc_rig::Along;
use gnc_tests::{PARTIAL, Place, Run, bad_items, read_json, repository};
use serde_json::Value;

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");

/// A plan with positions and turns, as short as possible.
const SHORT: &str = include_str!("raw/short.toml");

fn run(place: &Place, more: &[&str]) -> Run {
    place.write("p.toml", SHORT);
    let fixed = ["--auto", "p.toml", "--sim-speed", "max", "--serial-number", "C-1"];
    let sim = if more.iter().any(|arg| arg.starts_with("--sim=")) { None } else { Some("--sim") };
    place.run(fixed.into_iter().chain(sim).chain(more.iter().copied()))
}

fn mcap(place: &Place, item: &str) -> PathBuf {
    let runs = place.runs();
    assert_eq!(runs.len(), 1, "{runs:?}");
    runs[0].join(item).join("attempt-1.mcap")
}

fn read(path: &Path) -> RawRecord {
    raw::read(File::open(path).expect("a raw file")).expect("a whole raw file")
}

#[test]
fn every_capture_is_on_disk_and_vouched_for() {
    let place = Place::new(STATION);
    run(&place, &[]);
    let still = read(&mcap(&place, "01-six-position"));
    assert!(!still.cut_off && still.unfinished.is_none());
    let labels: Vec<&str> = still.captures.iter().map(|capture| capture.about.label.as_str()).collect();
    assert_eq!(labels, ["x+", "x-", "y+", "y-", "z+", "z-"]);
    for capture in &still.captures {
        assert_eq!((capture.samples.len(), capture.losses.any()), (2000, false), "{}", capture.about.label);
        // The axis that points up measures one g: 160,000 counts at the nominal scale, which the part keeps to 5 %.
        let Pose::Still { up, .. } = capture.about.pose else { unreachable!("{:?}", capture.about) };
        let means = [0, 1, 2].map(|axis| {
            capture.samples.iter().map(|sample| f64::from(sample.accel[axis])).sum::<f64>() / 2000.0 / 160_000.0
        });
        for (mean, up) in means.iter().zip(up) {
            assert!((mean - up).abs() < 0.1, "{}: {means:?} g", capture.about.label);
        }
    }
    let turns = read(&mcap(&place, "02-rotation"));
    assert_eq!(turns.captures.len(), 6);
    for capture in &turns.captures {
        let Pose::Rotating { axis, angle_deg, along, .. } = capture.about.pose else {
            unreachable!("{:?}", capture.about)
        };
        assert_eq!(along, Along::Up);
        // 1 s of rest, 5 s of turn, 2 s of rest at 1 kHz. More samples come until the end of the turn is reported.
        assert!(capture.samples.len() >= 8000, "{}: {} samples", capture.about.label, capture.samples.len());
        let sum = capture.samples.iter().map(|sample| f64::from(sample.gyro[usize::from(axis)])).sum::<f64>();
        let turned_deg = sum / 1000.0 / 20_000.0;
        // Bias of one degree a second, scale error of 5 %.
        let most = 0.05 * 1080.0 + capture.samples.len() as f64 / 1000.0;
        assert!((turned_deg - angle_deg).abs() < most, "{}: {turned_deg} deg", capture.about.label);
    }
    let verified = place.run(["records", "verify"]);
    assert_eq!(verified.code, Some(0), "{}{}", verified.stdout, verified.stderr);
}

/// One bit of one sample is changed: both the digests and the recomputation notice it.
#[test]
fn one_changed_sample_is_noticed() {
    let place = Place::new(STATION);
    run(&place, &[]);
    let path = mcap(&place, "01-six-position");
    let mut bytes = fs::read(&path).expect("a raw file");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&path, bytes).expect("a raw file");
    let verified = place.run(["records", "verify"]);
    assert_eq!(verified.code, Some(1));
    assert!(verified.stdout.contains("01-six-position/attempt-1.mcap was changed"), "{}", verified.stdout);
    let folder = place.runs().remove(0);
    let recomputed = place.run(["recompute", folder.to_str().expect("UTF-8")]);
    assert_ne!(recomputed.code, Some(0), "{}", recomputed.stdout);
    let said = format!("{}{}", recomputed.stdout, recomputed.stderr);
    assert!(said.contains("attempt-1.mcap"), "{said}");
}

/// A file after a kill is readable up to the last second, by the station and by other programs.
#[test]
fn what_was_captured_survives_a_kill() {
    let place = Place::new(STATION);
    place.write("p.toml", &SHORT.replace("10 s", "1200 s").replace("settle = \"1 s\"", "settle = \"0 s\""));
    let args = ["--auto", "p.toml", "--sim", "--sim-speed", "10", "--serial-number", "C-1", "--only", "six-position"];
    let mut station = place.station(args).stdout(Stdio::piped()).spawn().expect("the station");
    let lines = BufReader::new(station.stdout.take().expect("its output")).lines();
    let samples = |record: &RawRecord| record.unfinished.as_ref().map_or(0, |unfinished| unfinished.samples);
    // The station reports its progress every two seconds; some reports later a second of samples is on disk.
    let told = lines
        .map_while(Result::ok)
        .any(|line| line.contains("running: ") && samples(&read(&mcap(&place, "01-six-position"))) > 0);
    assert!(told, "nothing was captured");
    station.kill().expect("alive");
    station.wait().expect("dead");
    let record = read(&mcap(&place, "01-six-position"));
    assert!(record.cut_off && record.captures.is_empty() && samples(&record) >= 200, "{:?}", record.unfinished);
    let verified = place.run(["records", "verify"]);
    assert_eq!(verified.code, Some(3));
    assert!(verified.stdout.contains("interrupted"), "{}", verified.stdout);
}

/// A line that loses a frame now and then gives no figure, but the place of the loss.
#[test]
fn a_gap_is_never_a_figure() {
    let place = Place::new(STATION);
    let good = fs::read_to_string(repository().join("hw-mocks/boards/good.toml")).expect("the good board");
    place.write("lossy.toml", &format!("{good}\n[wire.to_host]\nlost_frames_per_million = 5000.0\n"));
    let ended = run(&place, &["--sim=lossy.toml", "--only", "six-position"]);
    assert_eq!(ended.code, Some(3), "{}{}", ended.stdout, ended.stderr);
    let record = place.record();
    assert_eq!(bad_items(&record), ["six-position"]);
    let attempt = &record["items"][0]["attempts"][0];
    let text = attempt["error"]["text"].as_str().expect("a reason");
    assert!(text.contains("has a gap after sample") && text.contains("on the line"), "{text}");
    assert_eq!(attempt["measurements"].as_array().map(Vec::len), Some(0), "a figure came of it");
    let raw = read(&mcap(&place, "01-six-position"));
    let last = raw.captures.last().expect("the capture with the gap");
    assert!(last.losses.on_line > 0 && last.losses.on_board == 0, "{:?}", last.losses);
}

/// The same plan gives the same bits. Another plan judges the same figures by its own limits, beside the run.
#[test]
fn a_run_comes_out_again_as_it_was() {
    let place = Place::new(STATION);
    run(&place, &[]);
    let folder = place.runs().remove(0);
    let folder = folder.to_str().expect("UTF-8");
    let before = place.record();
    let again = place.run(["recompute", folder]);
    assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
    assert!(again.stdout.contains("the same, bit for bit") && again.stdout.contains("2 attempts"), "{}", again.stdout);
    assert_eq!(place.runs().len(), 1, "nothing is written");

    place.write("strict.toml", &SHORT.replace("-100 mg .. 100 mg", "-0.0001 mg .. 0.0001 mg"));
    let strict = place.run(["recompute", folder, "--plan", "strict.toml"]);
    assert_eq!(strict.code, Some(1), "{}{}", strict.stdout, strict.stderr);
    let beside = place.runs().into_iter().find(|run| run.to_string_lossy().ends_with("-recomputed")).expect("a folder");
    let judged = read_json(&beside.join("run.json"));
    assert_eq!(
        (judged["outcome"].as_str(), judged["recomputed"]["run"].as_str()),
        (Some("failed"), folder.rsplit('/').next())
    );
    assert_eq!(bad_items(&judged), ["six-position"]);
    let details = |record: &Value| record["items"][0]["attempts"][0]["details"].clone();
    assert_eq!(details(&before), details(&judged), "another plan is no other figure");
    let verified = place.run(["records", "verify"]);
    assert_eq!(verified.code, Some(0), "{}{}", verified.stdout, verified.stderr);

    let other = place.write("other.toml", &SHORT.replace("id = \"rotation\"", "id = \"rotation\"\nname = \"turns\""));
    let unfit = place.run(["recompute", folder, "--plan", other.to_str().expect("UTF-8")]);
    assert_eq!(unfit.code, Some(2));
    assert!(
        unfit
            .stderr
            .contains("the run has the items six-position, rotation; the plan has the items six-position, turns"),
        "{}",
        unfit.stderr
    );
}

/// `compute` on the raw file itself and on its export gives the same calibration.
#[test]
fn raw_captures_can_be_computed_with() {
    let place = Place::new(STATION);
    run(&place, &[]);
    let raw = mcap(&place, "01-six-position");
    let raw = raw.to_str().expect("UTF-8");
    let computed = place.run(["compute", "six-position", raw, "--gravity", "9.80151", "--json"]);
    assert_eq!(computed.code, Some(0), "{}{}", computed.stdout, computed.stderr);
    let found: Value = serde_json::from_str(&computed.stdout).expect("JSON");
    for axis in 0..3 {
        // 160,000 counts for one g, to 5 %.
        let sensitivity = found["sensitivity"][axis].as_f64().expect("a number");
        assert!((sensitivity * 9.80665 / 160_000.0 - 1.0).abs() < 0.05, "{sensitivity}");
    }
    let folder = place.runs().remove(0);
    let exported = place.run(["export", folder.to_str().expect("UTF-8"), "--out", "out"]);
    assert_eq!(exported.code, Some(0), "{}{}", exported.stdout, exported.stderr);
    let text = fs::read_to_string(place.path().join("out/01-six-position-attempt-1.csv")).expect("a table");
    let columns = text.replacen("accel_x,accel_y,accel_z", "x,y,z", 1);
    place.write("p.csv", &columns);
    let from_text = place.run(["compute", "six-position", "p.csv", "--gravity", "9.80151", "--json"]);
    // The texts about the clock differ: a file of rows has a column of times, a raw file has the board's time of each
    // frame.
    let without_clock = |text: &str| {
        let mut found: Value = serde_json::from_str(text).expect("JSON");
        found.as_object_mut().map(|found| found.remove("clock").expect("a clock"));
        found
    };
    assert_eq!(without_clock(&from_text.stdout), without_clock(&computed.stdout), "{}", from_text.stderr);
    let allan = place.run(["compute", "allan", &format!("{raw}#z+"), "--column", "gyro_z", "--rate", "200"]);
    assert_eq!(allan.code, Some(0), "{}{}", allan.stdout, allan.stderr);
    let unclear = place.run(["compute", "allan", raw, "--column", "gyro_z", "--rate", "200"]);
    assert_eq!(unclear.code, Some(2));
    assert!(
        unclear.stderr.contains("it holds 6 captures; add the name of one to the path: #x+ #x-"),
        "{}",
        unclear.stderr
    );
}

/// Equal except for the last digits of the numbers.
#[track_caller]
fn same(found: &Value, expected: &Value, at: &str) {
    match (found, expected) {
        (Value::Object(a), Value::Object(b)) => {
            let keys = |of: &serde_json::Map<String, Value>| of.keys().cloned().collect::<Vec<_>>();
            assert_eq!(keys(a), keys(b), "{at}");
            a.iter().for_each(|(key, value)| same(value, &b[key], &format!("{at}.{key}")));
        }
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len(), "{at}");
            a.iter().zip(b).enumerate().for_each(|(i, (a, b))| same(a, b, &format!("{at}.{i}")));
        }
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64().expect("a number"), b.as_f64().expect("a number"));
            assert!((a - b).abs() <= 1e-12 * a.abs().max(b.abs()), "{at}: {a} and {b}");
        }
        _ => assert_eq!(found, expected, "{at}"),
    }
}

/// Every method that takes captures: from the raw file, and from its export as text and as Parquet. The user need not
/// give the rate.
#[test]
fn an_export_computes_as_its_raw_file() {
    let place = Place::new(STATION);
    let magnetometer = "[[item]]\nid = \"magnetometer-ellipse\"\nparams = { duration = \"5 s\", settle = \"1 s\" }\n\
         [item.limits]\nradius = \"0.1 gauss .. 0.7 gauss\"\n";
    place.write("p.toml", &format!("{SHORT}{magnetometer}"));
    let ended = place.run(["--auto", "p.toml", "--sim", "--sim-speed", "max", "--serial-number", "C-1"]);
    assert_eq!(ended.code, Some(0), "{}{}", ended.stdout, ended.stderr);
    let folder = place.runs().remove(0);
    for format in ["csv", "parquet"] {
        let words = ["export", folder.to_str().expect("UTF-8"), "--format", format, "--out", format];
        let exported = place.run(words);
        assert_eq!(exported.code, Some(0), "{}{}", exported.stdout, exported.stderr);
    }
    let json = |words: &[&str], file: &str| {
        let (method, options) = words.split_first().expect("a method");
        let computed = place.run(["compute", method, file, "--json"].into_iter().chain(options.iter().copied()));
        assert_eq!(computed.code, Some(0), "{words:?} {file}: {}{}", computed.stdout, computed.stderr);
        let mut found: Value = serde_json::from_str(&computed.stdout).expect("JSON");
        // A raw file has the board's time of each frame. A table has a column of times, which the ellipse does not use,
        // and its columns have longer names.
        let clock = found.as_object_mut().and_then(|found| {
            found.remove("understood");
            found.remove("clock")
        });
        let checked = clock.and_then(|clock| clock["checked"].as_bool());
        assert!(checked == Some(true) || *method == "ellipse", "{words:?} {file}");
        found
    };
    let spin = format!("#{}", read(&mcap(&place, "03-magnetometer-ellipse")).captures[0].about.label);
    for (item, label, words) in [
        ("01-six-position", "", &["six-position", "--gravity", "9.80151"][..]),
        ("01-six-position", "#z+", &["allan", "--column", "gyro_z"]),
        ("01-six-position", "#z+", &["psd", "--column", "accel_x"]),
        ("01-six-position", "#x-", &["stability", "--column", "gyro_y", "--block", "1"]),
        ("02-rotation", "", &["rotation", "--turns", "3"]),
        ("03-magnetometer-ellipse", &spin, &["ellipse"]),
    ] {
        let raw = format!("{}{label}", mcap(&place, item).display());
        let expected = json(words, &raw);
        for format in ["csv", "parquet"] {
            let file = format!("{format}/{item}-attempt-1.{format}{label}");
            same(&json(words, &file), &expected, &format!("{words:?} {file}"));
        }
    }
}

/// A killed run is taken up again: complete captures are taken over bit for bit, the rest is captured.
#[test]
fn a_run_that_broke_off_goes_on() {
    let place = Place::new(STATION);
    let plan = SHORT.replace("10 s", "60 s").replace("settle = \"1 s\"", "settle = \"0 s\"");
    place.write("p.toml", &plan);
    let args = ["--auto", "p.toml", "--sim", "--serial-number", "C-1", "--only", "six-position"];
    let slow = args.into_iter().chain(["--sim-speed", "40"]);
    let mut station = place.station(slow).stdout(Stdio::piped()).spawn().expect("the station");
    let lines = BufReader::new(station.stdout.take().expect("its output")).lines();
    // The station reports its progress every two seconds: three positions of 60 s take a little longer at 40 times the
    // speed.
    let whole = || read(&mcap(&place, "01-six-position")).captures.len();
    assert!(lines.map_while(Result::ok).any(|line| line.contains("running: ") && whole() >= 2), "nothing was captured");
    station.kill().expect("alive");
    station.wait().expect("dead");
    let broken = place.runs().remove(0);
    let before = read(&mcap(&place, "01-six-position")).captures;
    assert!((2..6).contains(&before.len()), "{} captures", before.len());

    let refused = |plan: &str, serial_number: &str| {
        // The file keeps its name, since the name belongs to the digest.
        place.write("p.toml", plan);
        let resume = broken.to_str().expect("UTF-8");
        place.run(["--auto", "p.toml", "--sim", "--serial-number", serial_number, "--resume", resume])
    };
    let other = refused(&plan.replace("-100 mg", "-99 mg"), "C-1");
    assert!(other.code == Some(2) && other.stderr.contains("had the plan with the digest"), "{}", other.stderr);
    let other = refused(&plan, "C-2");
    assert!(
        other.code == Some(2) && other.stderr.contains("had the serial number C-1, this run has C-2"),
        "{}",
        other.stderr
    );

    let resume = ["--sim-speed", "max", "--resume", broken.to_str().expect("UTF-8")];
    let ended = place.run(args.into_iter().chain(resume));
    assert_eq!(ended.code, PARTIAL, "{}{}", ended.stdout, ended.stderr);
    // What is taken over is said before the item ends, with what is left.
    let name = broken.file_name().expect("a name").to_str().expect("UTF-8");
    assert!(
        ended.stdout.contains(&format!("takes up the run {name}: its complete captures are taken over")),
        "{}",
        ended.stdout
    );
    let names = ["x+", "x-", "y+", "y-", "z+", "z-"];
    let (taken, left) = (names[..before.len()].join(", "), names[before.len()..].join(", "));
    let over = format!("six-position: Taken over from the interrupted run: {taken}. Still to capture: {left}.\n");
    let place_of = |text: &str| ended.stdout.find(text).expect(text);
    assert!(place_of(&over) < place_of("passed    six-position"), "{}", ended.stdout);
    let new = place.runs().into_iter().find(|run| *run != broken).expect("a run of its own");
    let after = read(&new.join("01-six-position/attempt-1.mcap")).captures;
    let labels: Vec<&str> = after.iter().map(|capture| capture.about.label.as_str()).collect();
    assert_eq!(labels, ["x+", "x-", "y+", "y-", "z+", "z-"]);
    assert!(after[..before.len()] == before, "what was taken over is not what was captured");
    let record = read_json(&new.join("run.json"));
    assert_eq!(record["resumed"]["run"].as_str(), Some(name));
    let again = place.run(["recompute", new.to_str().expect("UTF-8")]);
    assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
}

/// An item whose captures all exist asks for nothing; the item that broke off asks again.
#[test]
fn what_was_captured_is_not_prepared_again() {
    let place = Place::new(STATION);
    let item = |name: &str, words: &str, dwell: &str| {
        format!(
            "[[item]]\nid = \"six-position\"\nname = \"{name}\"\nprompt = \"{words}\"\n\
             params = {{ dwell = \"{dwell}\", settle = \"0 s\" }}\nlimits.residual_rms = \"<= 5 mg\"\n"
        )
    };
    let items = item("short", "Close the lid.", "10 s") + &item("long", "Open the lid.", "300 s");
    place.write("p.toml", &format!("name = \"lids\"\nversion = \"1\"\n{items}"));
    let args = ["--auto", "p.toml", "--sim", "--serial-number", "C-1"];
    let slow = args.into_iter().chain(["--sim-speed", "40"]);
    let mut station = place.station(slow).stdout(Stdio::piped()).spawn().expect("the station");
    let lines = BufReader::new(station.stdout.take().expect("its output")).lines();
    assert!(lines.map_while(Result::ok).any(|line| line.starts_with("passed    short")), "nothing was captured");
    station.kill().expect("alive");
    station.wait().expect("dead");
    let broken = place.runs().remove(0);
    let asked = |run: &Path, words: &str| {
        let journal = fs::read_to_string(run.join("events.jsonl")).expect("a journal");
        journal.lines().any(|line| line.contains("\"prompted\"") && line.contains(words))
    };
    assert!(asked(&broken, "Close the lid."));
    let resume = ["--sim-speed", "max", "--resume", broken.to_str().expect("UTF-8")];
    let ended = place.run(args.into_iter().chain(resume));
    assert_eq!(ended.code, Some(0), "{}{}", ended.stdout, ended.stderr);
    let new = place.runs().into_iter().find(|run| *run != broken).expect("a run of its own");
    assert_eq!((asked(&new, "Close the lid."), asked(&new, "Open the lid.")), (false, true));
}

/// A run that ended with a verdict on the module was not interrupted: its samples give no new verdict. The samples of a
/// run of some items give no verdict of the whole plan. Without digests an ended run cannot be checked.
#[test]
fn only_a_run_that_broke_off_is_taken_up() {
    let place = Place::new(STATION);
    place.write("p.toml", SHORT);
    let sim = ["--auto", "p.toml", "--sim", "--sim-speed", "max", "--serial-number", "C-1"];
    let chosen = || sim.into_iter().chain(["--only", "six-position"]);
    let ended = place.run(chosen());
    assert_eq!(ended.code, PARTIAL, "{}{}", ended.stdout, ended.stderr);
    let run = place.runs().remove(0);
    let resume = ["--resume", run.to_str().expect("UTF-8")];
    let refused = |told: Run, why: &str| {
        assert!(told.code == Some(2) && told.stderr.contains(why), "{:?}{}", told.code, told.stderr);
        assert_eq!(place.runs().len(), 1, "nothing is run");
    };
    refused(place.run(chosen().chain(resume)), "the run to resume was not interrupted: its outcome is partial");
    let whole = "had the selection six-position, this run has none (the whole plan)";
    refused(place.run(sim.into_iter().chain(resume)), whole);

    // The same as if the run had been stopped, and then without the digests.
    let journal = run.join("events.jsonl");
    let text = fs::read_to_string(&journal).expect("a journal");
    let last = text.lines().last().expect("an end");
    fs::write(&journal, text.replace(last, &last.replace("passed", "aborted"))).expect("writable");
    refused(place.run(chosen().chain(resume)), "events.jsonl was changed");
    fs::remove_file(run.join("SHA256SUMS")).expect("digests");
    refused(place.run(chosen().chain(resume)), "ended, and its SHA256SUMS is missing");
}
