//! The report for CI servers, whatever the end of the run.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::process::Stdio;

use gnc_tests::{Place, functional_plan, repository};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::STATION;

const FILE: &str = "report.xml";

fn written(place: &Place) -> String {
    let text = fs::read_to_string(place.path().join(FILE)).expect("a report");
    assert!(!place.path().join("report.xml.part").exists(), "a part is left");
    text
}

/// `tests`, `failures`, `errors` and `skipped` of all suites.
fn counts(xml: &str) -> [usize; 4] {
    let head = xml.lines().find(|line| line.starts_with("<testsuites")).expect("a head");
    ["tests", "failures", "errors", "skipped"].map(|name| {
        let rest = head.split(&format!(" {name}=\"")).nth(1).unwrap_or_else(|| panic!("no {name}: {head}"));
        rest.split('"').next().expect("a count").parse().expect("a number")
    })
}

#[test]
fn a_run_is_a_suite_and_an_item_a_case() {
    let place = Place::new(STATION);
    let good = place.functional("--sim", &["--sim-speed", "max", "--junit", FILE]);
    assert_eq!(good.code, Some(0), "{}{}", good.stdout, good.stderr);
    let xml = written(&place);
    assert_eq!(counts(&xml), [14, 0, 0, 0]);
    assert!(xml.contains("<testcase name=\"imu\" classname=\"functional\"") && xml.contains("gyro_x_noise"), "{xml}");
    assert!(xml.contains("<property name=\"serial_number\" value=\"T-1\"/>"), "{xml}");

    let board = repository().join("hw-mocks/boards/gyro-stuck.toml");
    let bad = place.functional(&format!("--sim={}", board.display()), &["--sim-speed", "max", "--junit", FILE]);
    assert_eq!(bad.code, Some(1), "{}{}", bad.stdout, bad.stderr);
    let xml = written(&place);
    assert_eq!(counts(&xml), [14, 1, 0, 0]);
    assert!(xml.contains("<failure message=\"") && xml.contains("repeat one value"), "{xml}");

    let some = place.functional("--sim", &["--sim-speed", "max", "--only", "io", "--loops", "3", "--junit", FILE]);
    assert_eq!(some.code, Some(5), "{}{}", some.stdout, some.stderr);
    let xml = written(&place);
    // A case for the run as a whole says that it is no pass.
    assert_eq!(counts(&xml), [45, 0, 0, 42]);
    for round in 1..=3 {
        assert!(xml.contains(&format!("<testsuite name=\"functional round {round}\"")), "{xml}");
    }
}

/// No board answers: the run itself is errored.
#[test]
fn an_errored_run_is_an_error() {
    let place = Place::new(STATION);
    place.write("bench.toml", "[station]\nid = \"s\"\n[socket]\nport = \"/dev/does-not-exist\"\n");
    let plan = functional_plan();
    let run = place.run(["--auto", &plan.to_string_lossy(), "--serial-number", "A", "--only", "io", "--junit", FILE]);
    assert_eq!(run.code, Some(3), "{}{}", run.stdout, run.stderr);
    let xml = written(&place);
    assert!(counts(&xml)[2] > 0 && xml.contains("there is no port"), "{xml}");
}

/// A run in its longest item, with its report; `more` is done then.
fn in_mid_run(place: &Place, more: impl FnOnce(Pid)) -> (Option<i32>, String) {
    let plan = functional_plan();
    let args =
        ["--auto", &plan.to_string_lossy(), "--sim", "--serial-number", "T-1", "--events", "--junit", "ci/report.xml"];
    let mut child = place.station(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the station");
    let mut events = BufReader::new(child.stdout.take().expect("its output"));
    let mut line = String::new();
    while !line.contains(r#""kind":"item_started","item":"sdram""#) {
        line.clear();
        assert_ne!(events.read_line(&mut line).expect("a line"), 0, "the run ended");
    }
    more(Pid::from_raw(i32::try_from(child.id()).expect("a process id")));
    while events.read_line(&mut line).expect("a line") > 0 {}
    let output = child.wait_with_output().expect("its end");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// The report of an earlier run that passed does not outlive any other end.
#[test]
fn every_end_leaves_a_report_of_its_own() {
    let place = Place::new(STATION);
    let report = place.path().join("ci/report.xml");
    fs::create_dir(place.path().join("ci")).expect("a folder");
    let read = || fs::read_to_string(&report).expect("a report");
    let old = "<testsuites name=\"old\" tests=\"1\" failures=\"0\" errors=\"0\" skipped=\"0\"/>";

    fs::write(&report, old).expect("a report");
    let (code, said) = in_mid_run(&place, |pid| kill(pid, Signal::SIGINT).expect("alive"));
    assert_eq!(code, Some(4), "{said}");
    assert!(counts(&read())[2] > 0 && read().contains("<error message="), "{}", read());

    fs::write(&report, old).expect("a report");
    let (code, _) = in_mid_run(&place, |pid| kill(pid, Signal::SIGKILL).expect("alive"));
    assert_eq!(code, None);
    assert_eq!(counts(&read()), [1, 0, 1, 0]);
    assert!(read().contains("the run has not ended"), "{}", read());

    // Whatever the command line is refused for.
    let line = ["--auto", "p.toml", "--sim", "--serial-number", "A"];
    for (more, said) in [
        (&["--loops", "x", "--junit", "ci/report.xml"][..], "invalid value"),
        (&["--junit=ci/report.xml", "--answer", "tp4"], "--answer"),
        (&["--revision", "C", "--junit", "ci/report.xml"], ""),
        (&["--junit", "ci/report.xml", "--resume", "r", "--loops", "2"], "cannot be used with"),
        (&["--junit", "ci/report.xml", "--no-such-option"], "--no-such-option"),
    ] {
        fs::write(&report, old).expect("a report");
        let refused = place.run(line.iter().chain(more));
        assert_eq!(refused.code, Some(2), "{}", refused.stderr);
        assert!(counts(&read()) == [1, 0, 1, 0] && read().contains(said), "{more:?}: {}", read());
    }
    // No run was asked for.
    fs::write(&report, old).expect("a report");
    assert_eq!(place.run(["--help", "--junit", "ci/report.xml"]).code, Some(0));
    assert_eq!(place.run(["ports", "--junit", "ci/report.xml"]).code, Some(2));
    assert_eq!(read(), old);

    fs::write(&report, old).expect("a report");
    let refused = place.run(["--auto", "gone.toml", "--sim", "--serial-number", "A", "--junit", "ci/report.xml"]);
    assert_eq!(refused.code, Some(2), "{}", refused.stderr);
    assert_eq!(counts(&read()), [1, 0, 1, 0]);
    assert!(read().contains("cannot read the plan gone.toml"), "{}", read());

    // A folder that goes away in mid-run: the run is errored, and its own record is whole.
    let folder = place.path().join("ci");
    let (code, said) = in_mid_run(&place, |_| fs::remove_dir_all(&folder).expect("a folder"));
    assert_eq!(code, Some(3), "{said}");
    assert!(said.contains("ERRORED: the JUnit XML cannot be written to") && said.contains("make the folder"), "{said}");
    let last = place.runs().pop().expect("a run");
    assert_eq!(gnc_tests::read_json(&last.join("run.json"))["outcome"], "passed");
}

/// A place that takes no report is told before the module gets power.
#[test]
fn a_report_that_cannot_be_written_is_told_before_the_run() {
    let place = Place::new(STATION);
    fs::create_dir(place.path().join("folder")).expect("a folder");
    for (file, words) in
        [("gone/report.xml", "make the folder"), ("folder", "is not a file"), ("/dev/null", "is not a file")]
    {
        let run = place.functional("--sim", &["--sim-speed", "max", "--junit", file]);
        assert_eq!(run.code, Some(2), "{file}: {}{}", run.stdout, run.stderr);
        assert!(run.stderr.contains(words), "{file}: {}", run.stderr);
    }
    assert!(place.runs().is_empty());
}
