//! Lines for people in the language of the locale: no English is left on standard output but names, the numbers stand in
//! every language, and what programs read is the same everywhere.

use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::Path;
use std::process::{Command, Stdio};

use gnc_records::store::as_written;
use gnc_tests::{Place, functional_plan, read_json};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::Value;

use super::STATION;

const LOCALES: [&str; 2] = ["zh_CN.UTF-8", "ru_RU.UTF-8"];

/// A plan that captures, so that there is something to export and to recompute.
const CAPTURES: &str = "name = \"short\"\nversion = \"1\"\n[[item]]\nid = \"six-position\"\n\
                        params = { dwell = \"10 s\", settle = \"0 s\" }\nlimits.residual_rms = \"<= 5 mg\"\n";

/// Latin words that are the same in each language, with the reason.
const NAMES: &[(&str, &str)] = &[
    (
        "files and folders",
        "records extra.txt bench.toml CHAIN COUNTER SHA256SUMS run.json log.txt events.jsonl report.html plan.toml cpu 01-six-position/item.json",
    ),
    ("names of plans, stations and boards of the tests", "functional short by-hand sim good functional-recomputed"),
    ("what the simulated bench is called", "simulated site max SIM-BOARD-1 gnc-station gnc-station-0.1.0 sim"),
    ("signals and keys, and what is printed on a switch", "ctrl-C Enter ON OFF"),
    ("messages and sections of the interface document", "HELLO NUL HelloReply ICD"),
    (
        "devices, formats and items of the catalogue",
        "gyro-still slcan DIP SPI IO IMU GNSS MCAP SHA-256 SDO SDI CLK CS JSON",
    ),
    ("units", "mA deg deg/s gauss mg ms us ppm bit/s min ksps Hz degC kHz"),
    ("options", "--records --bench"),
    ("a commit", "commit"),
    ("an event that this version does not know, and words of JSON", "run_ordered true false null"),
    ("memory tests, as plans name them", "solid checkerboard walking-ones address march-c"),
    ("values of measurements: what a person compares with the plan", "none"),
    ("choices of the plan, in the plan's own language", "clean worn scratched done"),
    ("the system's errors", "os error"),
];

fn latin(text: &str) -> impl Iterator<Item = &str> {
    let words = text.split(|c: char| !(c.is_ascii_alphanumeric() || "-_/.".contains(c)));
    let words = words.map(|word| word.trim_matches(['-', '_', '/', '.']));
    words.filter(|word| word.chars().filter(char::is_ascii_alphabetic).count() >= 2)
}

/// Numbers of a line, sorted, without those in words.
fn numbers(line: &str) -> Vec<String> {
    let split = line.split(|c: char| !(c.is_ascii_alphanumeric() || "._-/".contains(c)));
    let trimmed = split.map(|word| word.trim_matches(['.', '-']));
    let mut all: Vec<String> = trimmed
        .filter(|word| !word.is_empty() && word.chars().all(|c| c.is_ascii_digit() || c == '.'))
        .map(str::to_owned)
        .collect();
    all.sort();
    all
}

/// Names of a line: words with a digit, an underscore or a slash beside letters. A unit may have another name.
fn named(line: &str) -> BTreeSet<&str> {
    let names = latin(line).filter(|word| word.contains(|c: char| c.is_ascii_digit() || "_/".contains(c)));
    names.filter(|word| *word != "bit/s").collect()
}

/// All texts in a JSON value, and its keys.
fn texts(value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::String(text) => found.extend(latin(text).map(str::to_owned)),
        Value::Array(all) => all.iter().for_each(|one| texts(one, found)),
        Value::Object(all) => all.values().for_each(|one| texts(one, found)),
        _ => {}
    }
}

/// What people and the plan named in the runs of a place: items, measurements, their values and limits.
fn names_of(place: &Place) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for run in place.runs() {
        found.extend(latin(&run.display().to_string()).map(str::to_owned));
        let Ok(text) = fs::read_to_string(run.join("run.json")) else { continue };
        let Ok(record) = serde_json::from_str::<Value>(&text) else { continue };
        for key in ["serial_number", "station", "bench", "board", "plan", "operator"] {
            texts(&record[key], &mut found);
        }
        for item in record["items"].as_array().into_iter().flatten() {
            texts(&item["name"], &mut found);
            for attempt in item["attempts"].as_array().into_iter().flatten() {
                for measured in attempt["measurements"].as_array().into_iter().flatten() {
                    for key in ["name", "expected", "unit"] {
                        texts(&measured[key], &mut found);
                    }
                    // What a fault looks like is a sentence of the station.
                    if measured["name"] != "fault" {
                        texts(&measured["value"], &mut found);
                    }
                }
            }
        }
    }
    found
}

/// The English words that are left.
fn english<'a>(told: &'a str, place: &Place) -> BTreeSet<&'a str> {
    let names = names_of(place);
    let always: BTreeSet<&str> = NAMES.iter().flat_map(|(_, words)| words.split(' ').chain(latin(words))).collect();
    let is_hex = |word: &str| {
        word.chars().all(|c| c.is_ascii_hexdigit() || c == 'x') && word.contains(|c: char| c.is_ascii_digit())
    };
    // Messages, as the interface document names them: which ones are under way in a restart is chance.
    let is_message = |word: &str| {
        let capitals = word.chars().filter(char::is_ascii_uppercase).count();
        word.starts_with(|c: char| c.is_ascii_uppercase()) && (2..word.len() - 1).contains(&capitals)
    };
    let above = place.path().display().to_string();
    latin(told)
        .filter(|word| !always.contains(word) && !names.contains(*word) && !is_hex(word) && !is_message(word))
        .filter(|word| !above.contains(word) && !word.starts_with("records/") && !word.starts_with("dev/"))
        .filter(|word| !names.iter().any(|name| name.ends_with(&format!("/{word}"))))
        .collect()
}

/// No English is left. A failure names the words, with their lines.
#[track_caller]
fn no_english(told: &str, place: &Place, about: &str) {
    let left = english(told, place);
    let here: Vec<&str> = told.lines().filter(|line| latin(line).any(|word| left.contains(word))).collect();
    assert!(left.is_empty(), "{about}: English is left: {left:?}\n{}", here.join("\n"));
}

fn said(place: &Place, locale: &str, args: &[&str]) -> (Option<i32>, String) {
    let mut command = place.station(args);
    let out = command.env("LC_ALL", locale).env("TERM", "xterm").output().expect("the station");
    (out.status.code(), String::from_utf8(out.stdout).expect("UTF-8"))
}

/// A command says the same in each language, line by line, and no English is left.
#[track_caller]
fn same_in_each_language(place: &Place, args: &[&str]) -> String {
    let (code, english_text) = said(place, "C.UTF-8", args);
    assert!(!english_text.is_empty(), "{args:?} says nothing");
    for locale in LOCALES {
        let (its_code, told) = said(place, locale, args);
        assert_eq!(code, its_code, "{args:?} {locale}");
        no_english(&told, place, &format!("{args:?} {locale}"));
        assert_eq!(told.lines().count(), english_text.lines().count(), "{args:?} {locale}\n{told}");
        let pairs = english_text.lines().zip(told.lines());
        let differ = pairs.filter(|(line, other)| numbers(line) != numbers(other) || named(line) != named(other));
        let differ: Vec<String> = differ.map(|(line, other)| format!("{line}\n{other}\n")).collect();
        assert!(differ.is_empty(), "{args:?} {locale}: other numbers or names\n{}", differ.join("\n"));
    }
    english_text
}

fn auto<'a>(plan: &'a str, sim: &'a str, serial_number: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let first = ["--auto", plan, sim, "--sim-speed", "max", "--serial-number", serial_number];
    first.into_iter().chain(more.iter().copied()).collect()
}

/// Ends a run by a signal as soon as an item has ended. Returns what it said.
fn stopped(place: &Place, locale: &str, serial_number: &str, signal: Signal) -> String {
    let plan = functional_plan();
    let plan = plan.to_str().expect("UTF-8");
    let mut command = place.station(["--auto", plan, "--sim", "--serial-number", serial_number]);
    command.env("LC_ALL", locale).env("TERM", "xterm").stdout(Stdio::piped());
    let mut child = command.spawn().expect("the station");
    let mut out = BufReader::new(child.stdout.take().expect("its output"));
    let mut text = String::new();
    // The line of an item has its time.
    while !text.lines().any(|line| line.contains(" identity ") || line.contains(" cpu ")) {
        assert!(out.read_line(&mut text).expect("UTF-8") > 0, "{text}");
    }
    kill(Pid::from_raw(i32::try_from(child.id()).expect("a number")), signal).expect("a signal");
    out.read_to_string(&mut text).expect("UTF-8");
    child.wait().expect("its end");
    text
}

/// The power fails between the end of the newest run and its line in the chain, and the next start finds it.
fn close_late(place: &Place, start: impl Fn()) {
    let run = place.runs().pop().expect("a run");
    let records = place.path().join("records");
    let chain = run.ancestors().nth(2).expect("a day").join("CHAIN");
    let text = fs::read_to_string(&chain).expect("a chain");
    let lines: Vec<&str> = text.lines().collect();
    let words: Vec<&str> = lines[lines.len() - 2].split(' ').collect();
    fs::write(records.join("COUNTER"), format!("{} {}\n", words[0], words[3])).expect("a counter");
    fs::write(&chain, &text[..text.len() - 9]).expect("a chain");
    for file in ["SHA256SUMS", "run.json", "report.html"] {
        fs::remove_file(run.join(file)).expect("a file of the end");
    }
    start();
}

fn edit(file: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(file).expect("a text");
    assert!(text.contains(from), "{from} in {}", file.display());
    fs::write(file, text.replace(from, to)).expect("writable");
}

/// Runs that ended in all ways.
fn many_runs() -> Place {
    let place = Place::new(STATION);
    let plan = functional_plan();
    let plan = plan.to_str().expect("UTF-8");
    place.write("breach.toml", "description = \"late\"\n[board]\nserial = \"B\\u0000\"\n");
    let run = |args: &[&str]| {
        let run = place.run(args);
        assert!(run.code.is_some_and(|code| code != 2), "{args:?}: {}{}", run.stdout, run.stderr);
    };
    run(&auto(plan, "--sim", "T-1", &["--operator", "passed"]));
    run(&auto(plan, "--sim", "T-1", &["--only", "identity,cpu"]));
    run(&auto(plan, "--sim=sdram-address-open", "failed", &[]));
    run(&auto(plan, "--sim=reboots-in-sdram", "T-3", &[]));
    run(&auto(plan, "--sim=wrong-firmware", "T-4", &["--only", "identity,cpu"]));
    run(&auto(plan, "--sim=silent-board", "T-5", &[]));
    run(&auto(plan, "--sim=breach.toml", "T-6", &["--only", "cpu"]));
    stopped(&place, "C.UTF-8", "T-7", Signal::SIGINT);
    let of_t1 = place.runs()[0].clone();
    run(&["recompute", of_t1.to_str().expect("UTF-8"), "--plan", plan]);
    run(&auto(plan, "--sim", "T-8", &["--only", "cpu"]));
    close_late(&place, || run(&auto(plan, "--sim", "T-9", &["--only", "cpu"])));
    stopped(&place, "C.UTF-8", "T-10", Signal::SIGKILL);
    place
}

#[test]
fn records_speak_the_language_of_the_locale() {
    let place = many_runs();
    let list = same_in_each_language(&place, &["records", "list"]);
    for word in ["passed ", "partial", "failed", "errored", "aborted", "interrupted", "re-judged", "closed late"] {
        assert!(list.contains(word), "{word}: {list}");
    }
    for run in place.runs() {
        same_in_each_language(&place, &["records", "show", run.to_str().expect("UTF-8")]);
    }
    same_in_each_language(&place, &["records", "verify"]);
    same_in_each_language(&place, &["records", "list", "--serial-number", "nobody"]);
    // What programs read has no language.
    for form in ["--json", "--csv"] {
        let (_, english) = said(&place, "C.UTF-8", &["records", "list", form]);
        for locale in LOCALES {
            assert_eq!(said(&place, locale, &["records", "list", form]).1, english, "{form} {locale}");
        }
    }
    // Columns begin where they begin in English, as a terminal counts them.
    let dates = |text: &str| -> BTreeSet<usize> {
        let cells = |text: &str| text.chars().map(|c| if c >= '\u{2e80}' { 2 } else { 1 }).sum::<usize>();
        text.lines().filter_map(|line| Some(cells(&line[..line.find(" 20")?]))).collect()
    };
    for locale in LOCALES {
        let told = said(&place, locale, &["records", "list"]).1;
        assert_eq!(dates(&told), dates(&list), "{locale}\n{told}");
    }

    // Each way in which a record can be changed.
    let runs = place.runs();
    fs::write(runs[0].join("log.txt"), "all is well").expect("a log");
    fs::remove_file(runs[1].join("run.json")).expect("a record");
    fs::remove_file(runs[2].join("SHA256SUMS")).expect("digests");
    fs::write(runs[3].join("extra.txt"), "x").expect("a file");
    fs::write(runs[4].join("events.jsonl"), "no journal\n").expect("a journal");
    edit(&runs[5].join("events.jsonl"), "run_started", "run_ordered");
    let chain = runs[0].ancestors().nth(2).expect("a day").join("CHAIN");
    let text = fs::read_to_string(&chain).expect("a chain");
    let without: String =
        text.lines().enumerate().filter(|(n, _)| *n != 3).map(|(_, line)| format!("{line}\n")).collect();
    fs::write(&chain, without).expect("a chain");
    // The chain says of none of them that it was closed: its digests are not gone, they were never there.
    let unsealed = runs[6].with_file_name("235959-functional");
    assert!(Command::new("cp").arg("-r").args([&runs[6], &unsealed]).status().expect("cp").success());
    fs::remove_file(unsealed.join("SHA256SUMS")).expect("digests");
    let verified = same_in_each_language(&place, &["records", "verify"]);
    assert!(verified.contains("chain: "), "{verified}");
    let list = same_in_each_language(&place, &["records", "list"]);
    for word in ["unreadable", "unsealed", "newer", "changed"] {
        assert!(list.contains(word), "{word}: {list}");
    }
}

#[test]
fn export_and_recompute_speak_the_language_of_the_locale() {
    let place = Place::new(STATION);
    place.write("p.toml", CAPTURES);
    place.write("narrow.toml", &CAPTURES.replace("<= 5 mg", "<= 0.0001 mg"));
    let run = place.run(auto("p.toml", "--sim", "T-1", &[]));
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let folder = place.runs()[0].clone();
    let name = folder.to_str().expect("UTF-8");
    for locale in LOCALES {
        let (code, told) = said(&place, locale, &["export", name, "--out", locale]);
        assert_eq!(code, Some(0));
        let left: BTreeSet<_> =
            english(&told, &place).into_iter().filter(|word| !word.starts_with(&locale[..2])).collect();
        assert!(!told.is_empty() && left.is_empty(), "{left:?}\n{told}");
        assert!(numbers(&told).contains(&"6".to_owned()), "{told}");
        // The new run has another folder each time.
        let (code, told) = said(&place, locale, &["recompute", name, "--plan", "narrow.toml"]);
        assert_eq!(code, Some(1));
        no_english(&told, &place, locale);
    }
    same_in_each_language(&place, &["recompute", name]);
    edit(&folder.join("events.jsonl"), "\"residual_rms\",\"value\":", "\"residual_rms\",\"value\":1");
    let told = same_in_each_language(&place, &["recompute", name]);
    assert!(told.contains("not the same"), "{told}");
}

/// `--auto` of a good module and of bad ones, of chosen items, of a run that is stopped, and of one that asks.
#[test]
fn auto_speaks_the_language_of_the_locale() {
    let plan = functional_plan();
    let plan = plan.to_str().expect("UTF-8");
    let by_hand = gnc_tests::repository().join("test-plans/by-hand.toml");
    let by_hand = by_hand.to_str().expect("UTF-8");
    let answers =
        ["supply_at_meter=5.0", "box_label=T-1", "housing=scratched", "lid=done"].map(|answer| ["--answer", answer]);
    let answers = answers.as_flattened();
    for locale in LOCALES {
        let place = Place::new(STATION);
        place.write("breach.toml", "description = \"late\"\n[board]\nserial = \"B\\u0000\"\n");
        let cases: [(Vec<&str>, i32); 9] = [
            (auto(plan, "--sim", "T-1", &[]), 0),
            (auto(plan, "--sim", "failed", &["--loops", "2", "--only", "cpu"]), 5),
            (auto(plan, "--sim=sdram-address-open", "T-1", &["--one-by-one"]), 1),
            (auto(plan, "--sim=reboots-in-sdram", "T-1", &[]), 1),
            (auto(plan, "--sim=wrong-firmware", "T-1", &["--only", "identity,cpu"]), 1),
            (auto(plan, "--sim=silent-board", "T-1", &[]), 3),
            (auto(plan, "--sim=io-open", "T-1", &["--only", "io,spi"]), 1),
            (auto(plan, "--sim=breach.toml", "T-1", &["--only", "cpu"]), 5),
            (auto(by_hand, "--sim", "T-1", answers), 1),
        ];
        for (args, code) in cases {
            let (ended, told) = said(&place, locale, &args);
            assert_eq!(ended, Some(code), "{args:?} {locale}\n{told}");
            no_english(&told, &place, &format!("{args:?} {locale}"));
        }
        let told = stopped(&place, locale, "T-2", Signal::SIGINT);
        no_english(&told, &place, locale);
        // Evidence has one language, whatever the operator speaks.
        for run in place.runs() {
            let log = fs::read_to_string(run.join("log.txt")).expect("a log");
            assert!(log.is_ascii() && log.contains("Serial number "), "{log}");
            assert_eq!(as_written::verify(&run), [""; 0]);
            assert!(read_json(&run.join("run.json"))["items"].is_array());
        }
    }
}

/// Programs read the events, and people read beside them.
#[test]
fn events_have_no_language() {
    let place = Place::new(STATION);
    place.write("breach.toml", "description = \"late\"\n[board]\nserial = \"B\\u0000\"\n");
    let plan = functional_plan();
    let plan = plan.to_str().expect("UTF-8");
    for args in [
        auto(plan, "--sim", "T-1", &["--only", "cpu", "--events"]),
        // Errors with their hints, and notes.
        auto(plan, "--sim=wrong-firmware", "T-1", &["--only", "identity,cpu", "--events"]),
        auto(plan, "--sim=breach.toml", "T-1", &["--only", "cpu", "--events"]),
    ] {
        // A busy computer may have a note more: the line was late, or a request was repeated.
        let kinds = |told: &str| -> Vec<Value> {
            let events = told.lines().map(|line| serde_json::from_str::<Value>(line).expect("an event"));
            events.map(|event| event["kind"].clone()).filter(|kind| kind != "note").collect()
        };
        let english = said(&place, "C", &args).1;
        assert!(kinds(&english).len() > 3 && english.contains("\"kind\":\"note\""), "{english}");
        for locale in LOCALES {
            let told = said(&place, locale, &args).1;
            let foreign: String = told.chars().filter(|c| c.is_alphabetic() && !c.is_ascii()).collect();
            assert_eq!(foreign, "", "{locale} {args:?}\n{told}");
            assert_eq!(kinds(&told), kinds(&english), "{locale} {args:?}");
        }
    }
}
