//! The clock of the samples. If the samples leave the grid of the board's own time, the board gives no calibration,
//! over any link. A board whose clock differs from true time can calibrate, and the record gives the difference.

#![expect(clippy::expect_used, reason = "what cannot be set up fails the test that needs it")]

use std::fs::{self, File};
use std::path::Path;

use gnc_analysis::capture::{Capture, HostView};
use gnc_records::raw::{self, Piece, RawWriter};
use gnc_tests::{Place, Run, older, read_json};
use serde_json::Value;

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");

/// A plan with turns only.
const TURNS: &str = r#"
name = "turns"
version = "1"
[[item]]
id = "rotation"
params = { settle = "1 s", rest = "2 s" }
[item.limits]
"scale_error_*" = "-5 % .. 5 %"
"#;
/// A plan that first runs the receiver, whose pulses show the board's clock.
const WITH_PULSES: &str = r#"
name = "turns"
version = "1"
[[item]]
id = "gnss"
params = { window = "4.5 s" }
[item.limits]
fix_type = "== 3D"
board_clock_error = "-200 ppm .. 200 ppm"
[[item]]
id = "rotation"
requires = ["gnss"]
params = { settle = "1 s", rest = "2 s" }
[item.limits]
"scale_error_*" = "-5 % .. 5 %"
"#;

fn run(place: &Place, plan: &str, board: &str, more: &[&str]) -> Run {
    place.write("plan.toml", plan);
    let board = place.write("board.toml", &format!("description = \"a test's\"\n{board}"));
    let sim = format!("--sim={}", board.display());
    let fixed = ["--auto", "plan.toml", &sim, "--serial-number", "K-1"];
    let speed: &[&str] = if more.contains(&"--sim-speed") { &[] } else { &["--sim-speed", "max"] };
    place.run(fixed.into_iter().chain(speed.iter().copied()).chain(more.iter().copied()))
}

fn item(record: &Value, id: &str) -> Value {
    record["items"].as_array().into_iter().flatten().find(|item| item["id"] == id).cloned().expect("an item")
}

fn measured(record: &Value, id: &str, name: &str) -> Value {
    let attempt = item(record, id)["attempts"].as_array().and_then(|all| all.last().cloned()).expect("an attempt");
    let found = attempt["measurements"].as_array().into_iter().flatten().find(|value| value["name"] == name).cloned();
    found.expect("a measurement")
}

/// From 30 ppm to 5 %, in both directions, over both links: the run is errored and tells both rates, there is nothing
/// to compute with, and a later judgement of the run gives the same.
#[test]
fn samples_off_the_boards_own_time_calibrate_nothing() {
    for (error_ppm, link) in [(30.0, "rs422"), (-5000.0, "rs422"), (50_000.0, "can"), (-30.0, "can")] {
        let place = Place::new(STATION);
        let ended =
            run(&place, TURNS, &format!("[sampling]\nrate_error_ppm = {error_ppm:.1}\n"), &["--sim-link", link]);
        let context = format!("{error_ppm} ppm over {link}\n{}{}", ended.stdout, ended.stderr);
        assert_eq!(ended.code, Some(3), "{context}");
        let record = place.record();
        let rotation = item(&record, "rotation");
        assert_eq!(rotation["outcome"], "errored", "{context}");
        let error = &rotation["attempts"][0]["error"];
        let text = error["text"].as_str().expect("a reason");
        assert!(text.contains("capture `x+") && text.contains("Hz where 1000 Hz were asked for"), "{context}");
        let seen_ppm = text.split("asked for: ").nth(1).and_then(|rest| rest.split(" ppm").next());
        let seen_ppm: f64 = seen_ppm.and_then(|number| number.parse().ok()).expect("a number");
        // A second shows a ppm; on CAN there is a sixteenth of a second between two times.
        assert!((seen_ppm - error_ppm).abs() < 1.5, "{context}");
        assert!(error["hint"].as_str().is_some_and(|hint| hint.contains("section 10")), "{context}");
        let folder = place.runs().remove(0);
        let again = place.run(["recompute", folder.to_str().expect("UTF-8")]);
        assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
    }
}

/// Two boards differ by 60 ppm. Without a reference the difference is in their scale errors and within their interval;
/// with the pulses of the receiver it is gone.
#[test]
fn a_clock_off_true_time_is_in_the_budget_or_taken_out() {
    let scale = |plan: &str, clock_ppm: f64| {
        let place = Place::new(STATION);
        let ended = run(&place, plan, &format!("[board]\nclock_error_ppm = {clock_ppm:.1}\n"), &[]);
        assert_eq!(ended.code, Some(0), "{clock_ppm}: {}{}", ended.stdout, ended.stderr);
        let folder = place.runs().remove(0);
        let again = place.run(["recompute", folder.to_str().expect("UTF-8")]);
        assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
        let record = read_json(&folder.join("run.json"));
        let value = measured(&record, "rotation", "scale_error_z");
        let half = (value["uncertainty"]["high"].as_f64().expect("high")
            - value["uncertainty"]["low"].as_f64().expect("low"))
            / 2.0;
        // The limit is in percent, like the figure.
        (value["value"].as_f64().expect("a number") * 1e4, half * 1e4, record)
    };
    // What the clock adds to the budget of the figure, ppm: the rest of the interval is noise, and another one each time.
    let of_clock = |record: &Value| {
        let attempt = item(record, "rotation")["attempts"].as_array().and_then(|all| all.last().cloned());
        let budget = attempt.expect("an attempt")["details"][0]["budget"]["scale_error_z"].clone();
        let parts = budget["contributions"].as_array().cloned().expect("contributions");
        let clock = parts.into_iter().find(|part| part["name"].as_str().is_some_and(|name| name.contains("clock")));
        clock.and_then(|part| part["u"].as_f64()).expect("a part of the clock")
    };
    let (slow, half, record) = scale(TURNS, -30.0);
    let (fast, _, _) = scale(TURNS, 30.0);
    let unknown_ppm = of_clock(&record);
    // The noise of a turn at rest is 4 ppm, and two of them differ by six.
    assert!((fast - slow - 60.0).abs() < 25.0, "{slow} {fast}");
    assert!(half > 50.0, "{half}");
    let unknown = measured(&record, "rotation", "sample_rate_error");
    assert!(
        unknown["value"].is_null() && unknown["raw"].as_str().is_some_and(|why| why.contains("simulated at speed"))
    );

    let (slow, half, record) = scale(WITH_PULSES, -30.0);
    let (fast, _, _) = scale(WITH_PULSES, 30.0);
    assert!((fast - slow).abs() < 25.0, "{slow} {fast}");
    let known_ppm = of_clock(&record);
    assert!(known_ppm < 3.0 && known_ppm < unknown_ppm / 5.0, "{known_ppm} {unknown_ppm}");
    assert!(half < 50.0, "{half}");
    for (id, name) in [("gnss", "board_clock_error"), ("rotation", "sample_rate_error")] {
        let clock = measured(&record, id, name)["value"].as_f64().expect("a number");
        assert!((clock + 30.0).abs() < 0.2, "{id}: {clock}");
    }
}

/// A board may count its times from the requested rate. Its own time then hides the error, but the host's clock does
/// not: at true speed a plan can limit it.
#[test]
fn counted_times_do_not_hide_from_the_hosts_clock() {
    let plan = r#"
name = "rate"
version = "1"
[[item]]
id = "imu"
params = { samples = 1000, rate = "200 Hz" }
[item.limits]
sample_rate_error = "-1 % .. 1 %"
"#;
    let place = Place::new(STATION);
    let lying =
        run(&place, plan, "[sampling]\nrate_error_ppm = 50000.0\ncounted_times = true\n", &["--sim-speed", "1"]);
    assert_eq!(lying.code, Some(1), "{}{}", lying.stdout, lying.stderr);
    let seen = measured(&place.record(), "imu", "sample_rate_error");
    let within = |bound: &str| seen["uncertainty"][bound].as_f64().expect("a bound");
    assert!(within("low") > -1e9 && within("low") < within("high"), "{seen}");
    // At full speed there is no clock to compare with, and a limit without a value is errored.
    let place = Place::new(STATION);
    let at_max = run(&place, plan, "", &[]);
    assert_eq!(at_max.code, Some(3), "{}{}", at_max.stdout, at_max.stderr);
    assert!(
        at_max.stdout.contains("simulated at speed max")
            || place.record().to_string().contains("simulated at speed max")
    );
}

/// Copies the raw file of a good run with other frame times: those of a board whose samples come too fast by this many
/// ppm. An older station filed such times without a check.
fn with_other_times(from: &Path, to: &Path, error_ppm: f64) {
    let record = raw::read(File::open(from).expect("a raw file")).expect("a whole raw file");
    let mut out = RawWriter::new(File::create(to).expect("room"), None).expect("a head");
    for Capture { about, first_us, samples, losses, .. } in record.captures {
        let rate_hz = about.rate_hz;
        out.write(Piece::Begin { about, board_time_us: first_us }).expect("room");
        for (index, samples) in samples.chunks(10).enumerate() {
            let first = u32::try_from(index * 10).expect("a short record");
            let after_us = f64::from(first) * 1e6 / f64::from(rate_hz) / (1.0 + error_ppm * 1e-6);
            let board_time_us = first_us + after_us as u64;
            out.write(Piece::Imu { first, board_time_us, rate_hz, samples: samples.to_vec() }).expect("room");
        }
        out.write(Piece::End { losses, host: HostView::default(), board_time_us: first_us }).expect("room");
    }
    out.finish().expect("room");
}

/// Files of runs from before the times were checked: no figures are computed from them, and `recompute` says that the
/// old figures do not hold.
#[test]
fn older_records_are_looked_at_too() {
    let place = Place::new(STATION);
    let ended = run(&place, TURNS, "", &[]);
    assert_eq!(ended.code, Some(0), "{}{}", ended.stdout, ended.stderr);
    let folder = place.runs().remove(0);
    let (file, other) = (folder.join("01-rotation/attempt-1.mcap"), place.path().join("other.mcap"));
    let compute = |path: &Path| {
        let path = path.to_str().expect("UTF-8");
        place.run([
            "compute",
            "rotation",
            path,
            "--rate",
            "1000",
            "--turns",
            "3",
            "--axis",
            "vertical",
            "--latitude",
            "39.9",
        ])
    };
    let good = compute(&file);
    assert_eq!(good.code, Some(0), "{}{}", good.stdout, good.stderr);
    for (error_ppm, seen) in [(30.0, "1000.03"), (-5000.0, "995.0")] {
        with_other_times(&file, &other, error_ppm);
        let refused = compute(&other);
        assert_eq!(refused.code, Some(2), "{}{}", refused.stdout, refused.stderr);
        assert!(
            refused.stderr.contains(seen) && refused.stderr.contains("1000 Hz were asked for"),
            "{}",
            refused.stderr
        );
    }
    fs::copy(&other, &file).expect("room");
    older::rechain(&place.path().join("records"));
    let again = place.run(["recompute", folder.to_str().expect("UTF-8")]);
    assert_eq!(again.code, Some(1), "{}{}", again.stdout, again.stderr);
    assert!(again.stdout.contains("was passed, is errored") && again.stdout.contains("995.0"), "{}", again.stdout);
}
