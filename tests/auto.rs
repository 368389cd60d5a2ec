//! Tests `--auto` as an operator or a script meets it: exit codes, and texts that say what to do.

use std::collections::BTreeSet;

use gnc_executive::catalogue::ItemId;
use gnc_tests::{PARTIAL, Place, bad_items, functional_plan};

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");

/// Checks a refused run: exit code 2, nothing on standard output, no record, and these words.
fn check_refused(args: &[&str], files: &[(&str, &str)], words: &[&str]) {
    let place = Place::new(STATION);
    for (name, text) in files {
        place.write(name, text);
    }
    let run = place.run(args);
    assert_eq!(run.code, Some(2), "{args:?}: {}{}", run.stdout, run.stderr);
    for word in words {
        assert!(run.stderr.contains(word), "{args:?} does not say {word:?}: {}", run.stderr);
    }
    assert!(place.runs().is_empty(), "{args:?} left a record");
    assert!(!run.stderr.contains('\u{1b}'), "{args:?} moves the cursor: {:?}", run.stderr);
}

#[test]
fn mistakes_of_the_command_line_are_refused() {
    let plan = functional_plan();
    let plan = plan.to_str().expect("UTF-8");
    check_refused(&[], &[], &["needs a terminal", "--auto"]);
    check_refused(&["--auto", plan, "--sim"], &[], &["no serial number", "--serial-number"]);
    check_refused(&["--auto", plan, "--sim", "--serial-number", " "], &[], &["is empty", "scan"]);
    check_refused(&["--auto", plan, "--sim", "--serial-number", "a\u{1b}[2Jb"], &[], &["control characters"]);
    let long = "x".repeat(10_000);
    check_refused(&["--auto", plan, "--sim", "--serial-number", &long], &[], &["10000 characters", "at most 64"]);
    check_refused(&["--auto", plan, "--serial-number", "A"], &[], &["no bench", "--bench", "--sim"]);
    check_refused(&["--auto", "no.toml", "--sim", "--serial-number", "A"], &[], &["cannot read the plan no.toml"]);
    check_refused(&["--auto", ".", "--sim", "--serial-number", "A"], &[], &["cannot read the plan", "name the file"]);
    let speed = ["--auto", plan, "--sim", "--sim-speed", "fast", "--serial-number", "A"];
    check_refused(&speed, &[], &["fast", "max"]);
    let only = ["--auto", plan, "--sim", "--only", "imus", "--serial-number", "A"];
    check_refused(&only, &[], &["imus", "did you mean \"imu\"?"]);
    check_refused(&["--auto", plan, "--sim=no.toml", "--serial-number", "A"], &[], &["no.toml", "hw-mocks/boards"]);
    let board = [("b.toml", "nonsense = 1\n")];
    check_refused(&["--auto", plan, "--sim=b.toml", "--serial-number", "A"], &board, &["b.toml", "1:1", "nonsense"]);
}

#[test]
fn a_wrong_plan_is_refused_with_line_and_column() {
    let text =
        "name = \"x\"\nversion = \"1\"\n[[item]]\nid = \"imo\"\n[[item]]\nid = \"imu\"\nlimits.gyro_x = \"0 +- 2 V\"\n";
    let files = [("p.toml", text)];
    let words = ["p.toml:4:6", "did you mean", "p.toml:7:"];
    check_refused(&["--auto", "p.toml", "--sim", "--serial-number", "A"], &files, &words);
    let syntax = [("p.toml", "name = \"x\"\nversion = \n")];
    check_refused(&["--auto", "p.toml", "--sim", "--serial-number", "A"], &syntax, &["p.toml:2:"]);
}

#[test]
fn a_wrong_bench_file_is_refused() {
    let plan = functional_plan();
    let plan = plan.to_str().expect("UTF-8");
    let args = ["--auto", plan, "--serial-number", "A"];
    let files = [("bench.toml", "[station]\nid = \"s\"\n[socket]\nport = \"/dev/ttyX\"\nrate = \"9600 V\"\n")];
    check_refused(&args, &files, &["bench.toml:5:"]);
    let files = [("bench.toml", "[station]\nid = \"s\"\n")];
    check_refused(&args, &files, &["[socket]", "gnc-station ports"]);
}

/// A plan that needs an operator is refused at a bench without one, before power is switched on.
#[test]
fn a_plan_with_prompts_is_refused_without_an_operator() {
    let plan = functional_plan();
    let plan = plan.to_str().expect("UTF-8");
    let files = [("bench.toml", "[station]\nid = \"s\"\n[socket]\nport = \"/dev/null\"\n")];
    check_refused(&["--auto", plan, "--serial-number", "A"], &files, &["ad", "operator", "on a terminal"]);
}

const ASKING: &str = "name = \"by-hand\"\nversion = \"1\"\n[[item]]\nid = \"prompt\"\n[[item.ask]]\nname = \"tp4\"\n\
                      en = \"What does the meter read?\"\nkind = \"number\"\nunit = \"V\"\n\
                      [item.limits]\ntp4 = \"4.9 V .. 5.1 V\"\n";

/// Nothing answers in place of a person. With `--answer` the item is judged.
#[test]
fn answers_of_the_command_line_are_judged() {
    for (answer, code, word) in
        [("tp4=5,01 V", 0, "tp4 5.01 V (4.9 .. 5.1 V)"), ("tp4=3300 mV", 1, "tp4 3.3 V (4.9 .. 5.1 V)")]
    {
        let place = Place::new(STATION);
        place.write("p.toml", ASKING);
        let args = ["--auto", "p.toml", "--sim", "--sim-speed", "max", "--serial-number", "A"];
        let run = place.run(args.into_iter().chain(["--answer", answer]));
        assert_eq!(run.code, Some(code), "{answer:?}: {}{}", run.stdout, run.stderr);
        assert!(run.stdout.contains(word), "{answer:?}: {}", run.stdout);
        let report = std::fs::read_to_string(place.runs()[0].join("report.html")).expect("a report");
        let asked = ["What does the meter read?", "the command line"].iter().all(|words| report.contains(words));
        assert!(asked, "{answer:?}: the report has question and answer");
    }
}

/// A question that nobody can answer is known before anything is switched on. One of an item that is not chosen does not
/// count.
#[test]
fn questions_that_nobody_answers_are_refused_before_the_run() {
    let more = "[[item.ask]]\nname = \"lid\"\nen = \"Close the lid.\"\nkind = \"done\"\n[item.limits]";
    let identity = "[[item]]\nid = \"identity\"\n[item.limits]\nprotocol = \"== 1\"\n";
    let plan = format!("{}{identity}", ASKING.replace("[item.limits]", more));
    let files = [("p.toml", plan.as_str())];
    let args = ["--auto", "p.toml", "--sim", "--sim-speed", "max", "--serial-number", "A"];
    check_refused(
        &args,
        &files,
        &["the plan asks questions, and no person is there to answer them: tp4, lid\n", "--answer NAME=VALUE"],
    );
    check_refused(&[&args[..], &["--answer", "tp4=5"]].concat(), &files, &["no person is there to answer them: lid\n"]);
    check_refused(
        &[&args[..], &["--only", "prompt"]].concat(),
        &files,
        &["no person is there to answer them: tp4, lid\n"],
    );
    let place = Place::new(STATION);
    place.write("p.toml", &plan);
    let chosen = place.run([&args[..], &["--only", "identity"]].concat());
    assert_eq!(chosen.code, Some(5), "{}{}", chosen.stdout, chosen.stderr);
    let answered = place.run([&args[..], &["--answer", "tp4=5", "--answer", "lid=done"]].concat());
    assert_eq!(answered.code, Some(0), "{}{}", answered.stdout, answered.stderr);
}

/// Before anything is switched on: an answer without a question, one that is none, a picture that is not there.
#[test]
fn answers_and_pictures_are_checked_before_the_run() {
    let files = [("p.toml", ASKING)];
    let args = ["--auto", "p.toml", "--sim", "--serial-number", "A", "--answer"];
    for (answer, words) in [
        ("tp5=1", ["no question \"tp5\"", "did you mean \"tp4\"?"]),
        ("tp4=five", ["the answer to tp4: \"five\" is not a number", "3.3"]),
        ("tp4=1e999", ["too large", "read the number again"]),
        ("tp4", ["--answer", "tp4=3.3"]),
    ] {
        check_refused(&[&args[..], &[answer]].concat(), &files, &words);
    }
    let pictured = ASKING.replace("unit = \"V\"\n", "unit = \"V\"\npicture = \"tp4.png\"\n");
    let files = [("p.toml", pictured.as_str())];
    check_refused(&args[..5], &files, &["p.toml:4:6", "the question tp4 shows \"tp4.png\"", "no such file"]);
    // Checked alone, and found beside the plan, wherever the program is started.
    let place = Place::new(STATION);
    std::fs::create_dir(place.path().join("plans")).expect("a folder");
    place.write("plans/p.toml", &pictured);
    assert_eq!(place.run(["plan", "check", "plans/p.toml"]).code, Some(2));
    place.write("plans/tp4.png", "a picture");
    assert_eq!(place.run(["plan", "check", "plans/p.toml"]).code, Some(0));
    // Who judges again asks nobody, and needs no picture.
    let args =
        ["--auto", "plans/p.toml", "--sim", "--sim-speed", "max", "--serial-number", "A", "--answer", "tp4=5.05"];
    assert_eq!(place.run(args).code, Some(0));
    std::fs::remove_file(place.path().join("plans/tp4.png")).expect("the picture");
    place.write("plans/p.toml", &pictured.replace("5.1 V", "5.0 V"));
    let run = place.runs()[0].display().to_string();
    let again = place.run(["recompute", &run, "--plan", "plans/p.toml"]);
    assert!(again.stdout.contains("was passed, is failed"), "{}{}", again.stdout, again.stderr);
}

/// No port, no board, or another device behind the port: the run is errored, not failed, and says what to look at.
#[test]
fn a_bench_without_a_board_is_errored() {
    for (port, words) in [
        ("/dev/does-not-exist", ["there is no port", "plugged in"]),
        ("/dev/null", ["not a serial port", "gnc-station ports"]),
        (".", ["not a serial port", "gnc-station ports"]),
    ] {
        let place = Place::new(STATION);
        place.write("bench.toml", &format!("[station]\nid = \"s\"\n[socket]\nport = \"{port}\"\n"));
        let plan = functional_plan();
        let plan = plan.to_str().expect("UTF-8");
        let run = place.run(["--auto", plan, "--serial-number", "A", "--only", "io"]);
        assert_eq!(run.code, Some(3), "{port}: {}{}", run.stdout, run.stderr);
        for word in words {
            assert!(run.stdout.contains(word), "{port} does not say {word:?}: {}", run.stdout);
        }
        assert_eq!(place.record()["selection_outcome"], "errored", "{port}");
    }
}

/// An optional item that the bench cannot run is skipped with its cause; a selection is not a pass of the module.
#[test]
fn optional_items_and_selections() {
    let place = Place::new(STATION);
    let run = place.functional("--sim", &["--sim-speed", "max", "--sim-link", "can", "--only", "sci,io"]);
    assert_eq!(run.code, PARTIAL, "{}{}", run.stdout, run.stderr);
    let record = place.record();
    assert!(bad_items(&record).iter().all(|item| item != "io"), "{record}");
    let sci = record["items"].as_array().into_iter().flatten().find(|item| item["id"] == "sci").expect("sci");
    assert_eq!(sci["outcome"], "skipped");
    assert_eq!(sci["cause"]["kind"], "device_missing");
    assert!(run.stdout.contains("SELECTION"), "{}", run.stdout);
    assert!(run.stdout.contains("SIMULATED BENCH"), "{}", run.stdout);
}

/// Good chosen items end with a code of their own, bad ones as bad. A marginal module has a code of its own on request.
#[test]
fn exit_codes_of_selections_and_marginal_modules() {
    let plan = "name = \"codes\"\nversion = \"1\"\n[[item]]\nid = \"identity\"\nlimits.supply_current = \"0.49 A +- 5 %\"\n\
                [[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"1 .. 2\"\n";
    let marginal = "name = \"codes\"\nversion = \"1\"\n[[item]]\nid = \"identity\"\n\
                    limits.supply_current = { limit = \"0.49 A +- 5 %\", marginal = \"24 mA\" }\n";
    let check = |plan: &str, more: &[&str], code: i32, words: &str| {
        let place = Place::new(STATION);
        place.write("p.toml", plan);
        let args = ["--auto", "p.toml", "--sim", "--sim-speed", "max", "--serial-number", "T-1"];
        let run = place.run(args.iter().chain(more));
        assert_eq!(run.code, Some(code), "{more:?}: {}{}", run.stdout, run.stderr);
        assert!(run.stdout.contains(words), "{more:?}: {}", run.stdout);
        assert!(!run.stdout.contains("PASSED"), "{more:?}: {}", run.stdout);
        place
    };
    let place = check(plan, &["--only", "identity"], 5, "PARTIAL (simulated, selection)  T-1");
    let list = place.run(["records", "list"]);
    assert!(list.stdout.starts_with("partial  ") && list.stdout.contains(" simulated selection"), "{}", list.stdout);
    let events = std::fs::read_to_string(place.runs()[0].join("events.jsonl")).expect("a journal");
    let end = "\"kind\":\"run_ended\",\"outcome\":null,\"selection_outcome\":\"passed\"}";
    assert!(events.trim_end().ends_with(end), "{events}");
    check(plan, &["--only", "cpu"], 1, "FAILED (simulated, selection)  T-1");
    check(plan, &["--only", "identity", "--loops", "3"], 5, "3 rounds: 3 partial");
    check(marginal, &[], 0, "MARGINAL (simulated)  T-1");
    check(marginal, &["--strict"], 6, "MARGINAL (simulated)  T-1");
    check(marginal, &["--strict", "--only", "identity"], 5, "PARTIAL (simulated, selection)  T-1");
    check(marginal, &["--strict", "--loops", "2"], 6, "2 rounds: 2 marginal");
}

/// The failed rows stand at the end again, with what to look at, and the place of the record.
#[test]
fn failing_rows_are_repeated_with_what_to_look_at() {
    let place = Place::new(STATION);
    let board = gnc_tests::repository().join("hw-mocks/boards/gyro-stuck.toml");
    let run = place.functional(&format!("--sim={}", board.display()), &["--sim-speed", "max"]);
    assert_eq!(run.code, Some(1), "{}{}", run.stdout, run.stderr);
    let (_, end) = run.stdout.split_once("imu failed").expect("the failing rows");
    for word in ["stuck_channels", "== none", "repeat one value", "FAILED", "record: records/"] {
        assert!(end.contains(word), "{word:?} is missing: {end}");
    }
}

/// The same seed gives the same measurements, independent of the wall clock.
#[test]
fn a_seed_repeats_a_run() {
    let values = |seed: &str| {
        let place = Place::new(STATION);
        let run = place.functional("--sim", &["--sim-speed", "max", "--only", "imu", "--seed", seed]);
        assert_eq!(run.code, PARTIAL, "{}{}", run.stdout, run.stderr);
        let record = place.record();
        let imu = record["items"].as_array().into_iter().flatten().find(|item| item["id"] == "imu").expect("imu");
        imu["attempts"][0]["measurements"].to_string()
    };
    assert_eq!(values("7"), values("7"));
    assert_ne!(values("7"), values("8"));
}

/// Every item of the functional plan measures exactly the measurements of the catalogue. A measurement constant of
/// another item would have no limit and pass.
#[test]
fn items_measure_what_the_catalogue_says() {
    let place = Place::new(STATION);
    let run = place.functional("--sim", &["--sim-speed", "max"]);
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let record = place.record();
    let items = record["items"].as_array().expect("items");
    assert!(items.len() >= 14, "{record}");
    for item in items {
        let id: ItemId = serde_json::from_value(item["id"].clone()).expect("an item of the catalogue");
        let measured = item["attempts"][0]["measurements"].as_array().expect("measurements");
        let measured: BTreeSet<&str> = measured.iter().filter_map(|measurement| measurement["name"].as_str()).collect();
        let promised: BTreeSet<&str> = id.spec().measurements.iter().map(|measurement| measurement.name).collect();
        assert_eq!(measured, promised, "{id}");
    }
}

/// A plan is edited, and later removed, between two rounds: all rounds run the plan that was checked.
#[test]
fn all_rounds_run_the_same_plan() {
    use std::io::{BufRead as _, BufReader};
    let place = Place::new(STATION);
    let plan = "name = \"short\"\nversion = \"1\"\n[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"<= 0\"\n";
    let path = place.write("p.toml", plan);
    let args =
        ["--auto", "p.toml", "--sim", "--sim-speed", "max", "--serial-number", "T-1", "--loops", "20", "--events"];
    let mut station = place.station(args).stdout(std::process::Stdio::piped()).spawn().expect("the station");
    let lines = BufReader::new(station.stdout.take().expect("its output")).lines().map_while(Result::ok);
    // The station may be some rounds ahead of this reader, but not all twenty.
    for (round, _) in lines.filter(|line| line.contains("\"kind\":\"run_started\"")).enumerate() {
        match round {
            0 => std::fs::write(&path, plan.replace("<= 0", "<= 1000000")).expect("a plan"),
            4 => std::fs::remove_file(&path).expect("a plan"),
            _ => {}
        }
    }
    assert!(station.wait().expect("its end").success());
    let filed = |run: &std::path::PathBuf| std::fs::read_to_string(run.join("plan/01-p.toml")).ok();
    let plans: Vec<_> = place.runs().iter().map(filed).collect();
    assert_eq!(plans, vec![Some(plan.to_owned()); 20]);
}
