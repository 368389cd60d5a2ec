//! Lists of runs for programs and spreadsheets, and runs that go on.

use std::io::{BufRead as _, BufReader};
use std::process::{Child, ChildStdout, Stdio};

use gnc_tests::{Place, functional_plan};
use serde_json::Value;

use super::STATION;

const OTHER_PLAN: &str =
    "name = \"other\"\nversion = \"1.0\"\n[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"1 .. 2\"\n";

/// Runs of two plans, three modules and three outcomes.
fn some_runs() -> Place {
    let place = Place::new(STATION);
    let other = place.write("other.toml", OTHER_PLAN);
    let functional = functional_plan();
    for (plan, serial_number, only, code) in
        [(&functional, "=cmd", "io,cpu", 5), (&functional, "0012", "cpu", 5), (&other, "T-1", "cpu", 1)]
    {
        let plan = plan.to_string_lossy();
        let ended = place.run([
            "--auto",
            &plan,
            "--sim",
            "--sim-speed",
            "max",
            "--serial-number",
            serial_number,
            "--only",
            only,
        ]);
        assert_eq!(ended.code, Some(code), "{}{}", ended.stdout, ended.stderr);
    }
    place
}

#[track_caller]
fn json(place: &Place, more: &[&str]) -> Vec<Value> {
    let run = place.run(["records", "list", "--json"].iter().chain(more));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}: {}", run.stdout))
}

#[track_caller]
fn serial_numbers(place: &Place, more: &[&str]) -> Vec<String> {
    json(place, more).iter().map(|run| run["serial_number"].as_str().expect("a text").to_owned()).collect()
}

#[test]
fn programs_read_the_list() {
    let place = some_runs();
    let all = json(&place, &[]);
    assert_eq!(all.len(), 3);
    for (line, folder) in all.iter().zip(place.runs()) {
        let record = gnc_tests::read_json(&folder.join("run.json"));
        assert_eq!(
            line["run"],
            folder.strip_prefix(place.path().join("records")).expect("below").to_string_lossy().as_ref()
        );
        for key in [
            "serial_number",
            "outcome",
            "selection_outcome",
            "started",
            "finished",
            "elapsed_s",
            "station",
            "operator",
            "selection",
        ] {
            assert_eq!(line[key], record[key], "{key}");
        }
        assert_eq!((&line["plan"], &line["plan_version"]), (&record["plan"]["name"], &record["plan"]["version"]));
        assert_eq!((&line["state"], &line["simulated"]), (&"closed".into(), &true.into()));
        assert_eq!(line["program_commit"], record["program"]["build"]["commit"]);
    }
    // The table says the same, and its texts are no formulas and no numbers.
    let table = place.run(["records", "list", "--csv"]);
    let mut table = csv::Reader::from_reader(table.stdout.as_bytes());
    let heads: Vec<String> = table.headers().expect("a head").iter().map(str::to_owned).collect();
    assert_eq!(heads.len(), all[0].as_object().expect("an object").len());
    let rows: Vec<csv::StringRecord> = table.records().map(|row| row.expect("a row")).collect();
    assert_eq!(rows.len(), all.len());
    for (row, line) in rows.iter().zip(&all) {
        for (head, cell) in heads.iter().zip(row) {
            let expected = match &line[head] {
                Value::Null => String::new(),
                Value::String(text) => text.clone(),
                Value::Array(names) => names.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(";"),
                other => other.to_string(),
            };
            assert_eq!(cell.strip_prefix('\'').unwrap_or(cell), expected, "{head}");
        }
    }
    let numbers: Vec<&str> = rows.iter().filter_map(|row| row.get(4)).collect();
    assert!(numbers.contains(&"'=cmd") && numbers.contains(&"'0012") && numbers.contains(&"T-1"), "{numbers:?}");
}

#[test]
fn a_list_has_the_runs_that_are_asked_for() {
    let place = some_runs();
    let day = place.runs()[0]
        .ancestors()
        .nth(2)
        .and_then(|day| day.file_name())
        .expect("a day")
        .to_string_lossy()
        .into_owned();
    assert_eq!(serial_numbers(&place, &["--serial-number", "0012"]), ["0012"]);
    assert_eq!(serial_numbers(&place, &["--plan", "other"]), ["T-1"]);
    assert_eq!(serial_numbers(&place, &["--outcome", "failed,errored"]), ["T-1"]);
    let mut partial = serial_numbers(&place, &["--outcome", "partial"]);
    // Runs of the same second stand in the order of their folders.
    partial.sort();
    assert_eq!(partial, ["0012", "=cmd"]);
    assert_eq!(serial_numbers(&place, &["--outcome", "passed"]), [""; 0]);
    assert_eq!(serial_numbers(&place, &["--since", &day]).len(), 3);
    assert_eq!(serial_numbers(&place, &["--until", "2026-11-20"]), [""; 0]);
    assert_eq!(serial_numbers(&place, &["--day", "2026-11-20"]), [""; 0]);
    assert_eq!(serial_numbers(&place, &["--outcome", "failed", "--serial-number", "0012"]), [""; 0]);
    let none = place.run(["records", "list", "--plan", "functiona"]);
    assert!(none.stdout.starts_with("no such run is recorded in records"), "{}", none.stdout);
    let wrong = place.run(["records", "list", "--day", "28.11.2026"]);
    assert!(wrong.code == Some(2) && wrong.stderr.contains("write 2026-11-28"), "{}", wrong.stderr);
    let wrong = place.run(["records", "list", "--outcome", "bad"]);
    assert!(wrong.code == Some(2) && wrong.stderr.contains("errored"), "{}", wrong.stderr);
}

/// A run at true speed that has begun its longest item.
fn begun(place: &Place) -> (Child, BufReader<ChildStdout>) {
    let plan = functional_plan();
    let args = ["--auto", &plan.to_string_lossy(), "--sim", "--serial-number", "T-9", "--events"].map(str::to_owned);
    let mut child = place.station(args).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("the station");
    let mut events = BufReader::new(child.stdout.take().expect("its output"));
    let mut line = String::new();
    while !line.contains(r#""kind":"item_started","item":"sdram""#) {
        line.clear();
        assert_ne!(events.read_line(&mut line).expect("a line"), 0, "the run ended");
    }
    (child, events)
}

/// A run that goes on is neither interrupted nor changed; one that was killed is.
#[test]
fn a_run_that_goes_on_is_called_running() {
    let place = Place::new(STATION);
    let done = place.functional("--sim", &["--sim-speed", "max", "--only", "cpu"]);
    assert_eq!(done.code, Some(5), "{}", done.stderr);
    let (mut child, events) = begun(&place);
    let running = json(&place, &["--serial-number", "T-9"]);
    assert_eq!(
        (&running[0]["state"], &running[0]["outcome"], &running[0]["finished"]),
        (&"running".into(), &Value::Null, &Value::Null)
    );
    assert_eq!(serial_numbers(&place, &["--outcome", "running"]), ["T-9"]);
    assert_eq!(serial_numbers(&place, &["--outcome", "interrupted"]), [""; 0]);
    let list = place.run(["records", "list"]);
    assert!(list.stdout.lines().any(|line| line.starts_with("running ") && line.contains("T-9")), "{}", list.stdout);
    let all = place.run(["records", "verify"]);
    assert_eq!(all.code, Some(0), "{}{}", all.stdout, all.stderr);
    assert!(all.stdout.contains("1 of 1 runs are as written") && all.stdout.contains("running: "), "{}", all.stdout);
    let one = place.run(["records", "verify", "T-9"]);
    assert_eq!(one.code, Some(2), "{}{}", one.stdout, one.stderr);
    assert!(one.stderr.contains("1 of these runs goes on"), "{}", one.stderr);
    let doctor = place.run(["doctor"]);
    assert!(!doctor.stdout.contains("have no end"), "{}", doctor.stdout);

    child.kill().expect("alive");
    child.wait().expect("its end");
    drop(events);
    assert_eq!(serial_numbers(&place, &["--outcome", "interrupted"]), ["T-9"]);
    let left = place.run(["records", "verify"]);
    assert_eq!(left.code, Some(3), "{}{}", left.stdout, left.stderr);
    assert!(
        left.stdout
            .contains("interrupted: its station ended, or could not write, in the run; the next start of the station "),
        "{}",
        left.stdout
    );
    let doctor = place.run(["doctor"]);
    assert!(doctor.stdout.contains("1 of 2 runs in records have no end"), "{}", doctor.stdout);
}
