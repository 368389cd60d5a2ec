//! What the lists, a second judgement and a serial number of the command line may be trusted for.

use std::fs;

use gnc_tests::{Place, Run, read_json};
use serde_json::Value;

use super::STATION;

const GOOD: &str =
    "name = \"incoming\"\nversion = \"1\"\n[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"<= 0\"\n";

fn place() -> Place {
    let place = Place::new(STATION);
    place.write("incoming.toml", GOOD);
    place.write("other.toml", &GOOD.replace("incoming", "other"));
    place
}

fn run(place: &Place, plan: &str, serial_number: &str) -> Run {
    place.run(["--auto", plan, "--sim", "--sim-speed", "max", "--serial-number", serial_number])
}

#[track_caller]
fn passed(place: &Place, plan: &str, serial_number: &str) {
    let run = run(place, plan, serial_number);
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
}

/// The serial numbers that a list has, in its order.
#[track_caller]
fn listed(place: &Place, more: &[&str]) -> Vec<String> {
    let run = place.run(["records", "list", "--json"].iter().chain(more));
    let lines: Vec<Value> = serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}: {}", run.stdout));
    lines.iter().map(|line| line["serial_number"].as_str().expect("a number").to_owned()).collect()
}

/// Passes that count, and those that are changed, not in the chain or judged again.
#[test]
fn only_passes_that_count_are_listed_as_passed() {
    let place = place();
    for serial_number in ["A", "B", "C", "D"] {
        passed(&place, "incoming.toml", serial_number);
    }
    let folder = |serial_number: &str| {
        let runs = place.runs();
        runs.into_iter().find(|run| run.parent().is_some_and(|of| of.ends_with(serial_number))).expect("a run")
    };
    let again = place.run(["recompute", &folder("A").to_string_lossy(), "--plan", "incoming.toml"]);
    assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
    let record = folder("B").join("run.json");
    fs::write(&record, fs::read_to_string(&record).expect("a record") + "\n").expect("writable");
    let chain = folder("C").ancestors().nth(2).expect("a day").join("CHAIN");
    let lines = fs::read_to_string(&chain).expect("a chain");
    let kept: String = lines.lines().filter(|line| !line.contains("/C/")).map(|line| format!("{line}\n")).collect();
    fs::write(&chain, kept).expect("writable");
    assert_eq!(listed(&place, &["--outcome", "passed"]), ["A", "D"]);
    for (word, serial_number) in [("rejudged", "A"), ("changed", "B"), ("not_in_chain", "C")] {
        assert_eq!(listed(&place, &["--outcome", word]), [serial_number], "{word}");
        let list = place.run(["records", "list", "--serial-number", serial_number]);
        assert!(list.stdout.lines().any(|line| line.split(' ').next() == Some(word)), "{}", list.stdout);
    }
    assert_eq!(listed(&place, &["--outcome", "passed,changed,rejudged"]).len(), 4);
    // Nor do programs read a pass.
    for (serial_number, outcome) in [("B", "errored"), ("C", "errored"), ("D", "passed")] {
        let list = place.run(["records", "list", "--json", "--serial-number", serial_number]);
        let lines: Vec<Value> = serde_json::from_str(&list.stdout).expect("JSON");
        assert_eq!(lines[0]["outcome"], outcome, "{}", list.stdout);
        let table = place.run(["records", "list", "--csv", "--serial-number", serial_number]).stdout;
        assert_eq!(table.lines().last().and_then(|line| line.split(',').nth(2)), Some(outcome), "{table}");
    }
    let shown = place.run(["records", "show", "C"]).stdout;
    assert!(shown.contains("NOT CLOSED: its station ended, or could not write"), "{shown}");
}

/// The clock was set back: the run that was closed last has the older folder.
#[test]
fn the_newest_run_is_the_one_that_was_closed_last() {
    let place = place();
    passed(&place, "incoming.toml", "A");
    passed(&place, "other.toml", "A");
    let show = |what: &str| {
        let run = place.run(["records", "show", "A"]);
        assert!(run.stdout.contains(what), "{what}: {}", run.stdout);
    };
    show("other");
    let plans = || -> Vec<Value> {
        let run = place.run(["records", "list", "--json"]);
        let lines: Vec<Value> = serde_json::from_str(&run.stdout).expect("JSON");
        lines.iter().map(|line| line["plan"].clone()).collect()
    };
    assert_eq!(plans(), ["incoming", "other"]);
    let chain = place.runs()[0].ancestors().nth(2).expect("a day").join("CHAIN");
    let lines = fs::read_to_string(&chain).expect("a chain");
    let swapped: String = lines
        .lines()
        .map(|line| match line.split_once(' ').expect("a number") {
            // Each run has a line when it begins and one when it is closed.
            ("2", rest) => format!("4 {rest}\n"),
            ("4", rest) => format!("2 {rest}\n"),
            (number, rest) => format!("{number} {rest}\n"),
        })
        .collect();
    fs::write(&chain, swapped).expect("writable");
    show("incoming");
    assert_eq!(plans(), ["other", "incoming"]);
}

/// An edited record is judged by no plan: the new judgement would be closed as if the samples were the module's.
#[test]
fn a_changed_record_is_judged_by_no_other_plan() {
    let place = place();
    passed(&place, "incoming.toml", "A");
    let folder = place.runs().remove(0);
    let record = folder.join("run.json");
    let text = fs::read_to_string(&record).expect("a record");
    fs::write(&record, text.replace("\"passed\"", "\"marginal\"")).expect("writable");
    let again = place.run(["recompute", &folder.to_string_lossy(), "--plan", "incoming.toml"]);
    assert_eq!(again.code, Some(2), "{}{}", again.stdout, again.stderr);
    assert!(again.stdout.contains("record: run.json was changed"), "{}", again.stdout);
    assert!(again.stderr.contains("the record is not as it was written"), "{}", again.stderr);
    assert_eq!(place.runs().len(), 1, "a judgement was filed");
    let alone = place.run(["recompute".as_ref(), folder.as_os_str()]);
    assert_eq!(alone.code, Some(1), "{}{}", alone.stdout, alone.stderr);
    // Nothing differs, and that says nothing of what was measured.
    assert!(!alone.stdout.contains("the same"), "{}", alone.stdout);
    let last = "; the record was changed and these are the figures of the changed record\n";
    assert!(alone.stdout.ends_with(last), "{}", alone.stdout);
    let said = "the record was changed and nothing shows what was measured";
    assert!(alone.stderr.contains(said), "{}", alone.stderr);
    // One without digests is not called changed: perhaps its station was killed.
    fs::write(&record, text).expect("writable");
    fs::remove_file(folder.join("SHA256SUMS")).expect("digests");
    let open = place.run(["recompute".as_ref(), folder.as_os_str()]);
    assert_eq!(open.code, Some(1), "{}{}", open.stdout, open.stderr);
    assert!(!open.stdout.contains("the same"), "{}", open.stdout);
    let last = "; the record is not closed and nothing shows whether it was changed\n";
    assert!(open.stdout.ends_with(last), "{}", open.stdout);
}

/// The work on a large journal takes much memory, and that is said before it begins.
#[test]
fn a_large_journal_is_told_before_the_work_on_it() {
    let place = place();
    passed(&place, "incoming.toml", "A");
    let folder = place.runs().remove(0);
    let again = || place.run(["recompute".as_ref(), folder.as_os_str()]);
    let word = "the journal of this run has 100 MB and the work on it may take more than 1 GB of memory";
    assert!(!again().stderr.contains(word));
    // Without blocks on the disk: it is the size that counts.
    let journal = fs::OpenOptions::new().append(true).open(folder.join("events.jsonl")).expect("a journal");
    journal.set_len(100_000_001).expect("a sparse file");
    let large = again();
    assert!(large.stderr.starts_with(&format!("gnc-station: {word}")), "{}", large.stderr);
    assert_ne!(large.code, Some(0), "zeros are no journal");
}

/// A script passes on what its scanner sends: the command line takes off and refuses what the screen does.
#[test]
fn a_scan_of_the_command_line_is_one_of_the_screen() {
    let place = place();
    for scan in ["]C1A-1", "A-1\r\n", "\tA-1\t", "\u{feff}A-1", "\u{2}A-1\u{3}", "]d2\u{1d}A-1"] {
        passed(&place, "incoming.toml", scan);
    }
    let runs = place.runs();
    assert_eq!(runs.len(), 6);
    for run in &runs {
        assert_eq!(read_json(&run.join("run.json"))["serial_number"], "A-1");
    }
    for (scan, said) in [
        ("\u{410}1", "the scanner types in another layout\n  try: switch to English, and scan again"),
        ("\u{ff21}\u{ff11}", "the scanner types in another layout"),
        ("A\u{200b}1", "a character that nobody sees (U+200B)"),
        ("\u{200b}A1", "a character that nobody sees (U+200B)"),
        ("01\u{1d}21", "the scan holds several fields: \"01 | 21\""),
        ("A\t1", "control characters"),
        ("\r\n", "the serial number is empty"),
    ] {
        let refused = run(&place, "incoming.toml", scan);
        assert_eq!(refused.code, Some(2), "{scan:?}: {}{}", refused.stdout, refused.stderr);
        assert!(refused.stderr.contains(said), "{scan:?}: {}", refused.stderr);
    }
    assert_eq!(place.runs().len(), 6);
    // A pattern that asks for other letters knows better.
    place.write("incoming.toml", &GOOD.replacen("version", "serial_number = \"\u{410}[0-9]\"\nversion", 1));
    passed(&place, "incoming.toml", "\u{410}1");
}

/// Where plan or bench say what a serial number looks like, the command line takes it out of a code with several fields.
#[test]
fn a_code_with_fields_gives_its_serial_number_on_the_command_line() {
    let place = place();
    let with = |pattern: &str| GOOD.replacen("version", &format!("serial_number = \"{pattern}\"\nversion"), 1);
    let two = "]C1010345312000001121SN-0001\u{1d}10LOT-1";
    let refused = run(&place, "incoming.toml", two);
    assert!(refused.stderr.contains("the scan holds several fields"), "without a pattern: {}", refused.stderr);
    place.write("incoming.toml", &with("SN-[0-9]{4}"));
    let codes = [
        two,
        "]C1010345312000001121SN-0001",
        "010345312000001121SN-0001\u{1d}10LOT-1\r\n",
        "[)>\u{1e}06\u{1d}SSN-0001\u{1e}\u{4}",
    ];
    for scan in codes {
        passed(&place, "incoming.toml", scan);
    }
    for run in place.runs() {
        assert_eq!(read_json(&run.join("run.json"))["serial_number"], "SN-0001");
    }
    // Two serial numbers, of which one fits, and one that does not fit.
    for scan in ["]C121SN-0001\u{1d}21X-1", "]C121X-1\u{1d}10LOT-1"] {
        let refused = run(&place, "incoming.toml", scan);
        assert_eq!(refused.code, Some(2), "{scan:?}: {}{}", refused.stdout, refused.stderr);
        assert!(refused.stderr.contains("the scan holds several fields"), "{scan:?}: {}", refused.stderr);
    }
    assert_eq!(place.runs().len(), codes.len());
    // A pattern that asks for the whole code has it.
    place.write("incoming.toml", &with("[0-9]{18}SN-[0-9]{4}"));
    passed(&place, "incoming.toml", "]C1010345312000001121SN-0001");
    let last = place.runs().into_iter().map(|run| read_json(&run.join("run.json"))["serial_number"].clone());
    assert_eq!(last.filter(|number| number == "010345312000001121SN-0001").count(), 1);
}

/// One name and one version, two texts: the list shows which is which, and says it at its end.
#[test]
fn a_loosened_plan_is_told_apart_in_the_list() {
    let place = place();
    passed(&place, "incoming.toml", "A");
    assert!(!place.run(["records", "list"]).stdout.contains("is not one text"));
    place.write("incoming.toml", &GOOD.replace("<= 0", "<= 9"));
    passed(&place, "incoming.toml", "B");
    let digests: Vec<String> = place
        .runs()
        .iter()
        .map(|run| read_json(&run.join("run.json"))["plan"]["sha256"].as_str().expect("a digest")[..12].to_owned())
        .collect();
    let list = place.run(["records", "list"]);
    let of_b = list.stdout.lines().find(|line| line.contains(" B ")).expect("the run");
    assert!(digests.iter().any(|digest| of_b.contains(&format!("  {digest}  "))), "{}", list.stdout);
    for digest in digests {
        let told = format!("plan incoming 1 is not one text in this list: {digest} in 1 runs");
        assert!(list.stdout.contains(&told), "{}", list.stdout);
    }
}

/// The bench of a board on a pseudo-terminal, with a key, and its plans pinned if these lines say so.
fn bench(place: &Place, board: &gnc_tests::Board, plans: &str) {
    let text = board.bench_file("line-2").replace("[socket]", "key = \"station.key\"\n[socket]");
    place.write("bench.toml", &format!("{text}{plans}"));
}

const ON_BOARD: [&str; 3] = ["incoming.toml", "--serial-number", "SIM-0001"];

/// What a second judgement writes is signed by the key that signed the run, and by no other.
#[test]
fn a_second_judgement_of_a_signed_run_is_signed() {
    let board = gnc_tests::Board::start(super::MOCK, &["--speed", "max", "--serial-number", "SIM-0001"]);
    let place = place();
    bench(&place, &board, "");
    assert_eq!(place.run(["records", "key", "station.key"]).code, Some(0));
    let run = place.run(["--auto"].iter().chain(&ON_BOARD));
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let original = place.runs()[0].clone();
    let folder = original.to_string_lossy().into_owned();
    let same = place.run(["recompute", &folder]);
    assert!(same.code == Some(0) && same.stdout.contains("the same, bit for bit"), "{}{}", same.stdout, same.stderr);
    place.write("looser.toml", &GOOD.replace("<= 0", "<= 9"));
    let again = place.run(["recompute", &folder, "--plan", "looser.toml"]);
    assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
    let verify = || place.run(["records", "verify", "--key", "station.key.pub"]);
    assert_eq!(verify().code, Some(0), "{}{}", verify().stdout, verify().stderr);
    let list = place.run(["records", "list", "--json"]);
    let lines: Vec<Value> = serde_json::from_str(&list.stdout).expect("JSON");
    let outcomes: Vec<_> =
        lines.iter().map(|line| [&line["unproven_outcome"], &line["rejudged_outcome"], &line["bench"]]).collect();
    let (passed, none, unproven) = (Value::from("passed"), Value::Null, Value::from("unproven"));
    assert_eq!(outcomes, [[&passed, &none, &unproven], [&none, &passed, &unproven]], "{}", list.stdout);
    // A program that asks for `outcome` alone, as before, counts no pass of a bench that a program may play.
    for line in &lines {
        assert!(line["outcome"].is_null() && line["selection_outcome"].is_null(), "{}", list.stdout);
    }
    let table = place.run(["records", "list", "--csv"]).stdout;
    let rejudged = table.lines().find(|line| line.contains("-recomputed,")).expect("the judgement");
    let tested = table.lines().find(|line| line.ends_with(",unproven,,passed")).expect("the run");
    assert!(tested.contains(",closed,,,"), "{table}");
    assert!(rejudged.contains("-recomputed,closed,,,") && rejudged.ends_with(",unproven,passed,"), "{table}");
    // Without its key, or with another one, nothing is filed that would be a finding for ever.
    let runs = place.runs().len();
    place.write("elsewhere.toml", "[station]\nid = \"line-3\"\n");
    let without = place.run(["recompute", &folder, "--plan", "looser.toml", "--bench", "elsewhere.toml"]);
    assert_eq!(without.code, Some(2), "{}{}", without.stdout, without.stderr);
    assert!(without.stderr.contains("the runs beside it are signed, and there is no key"), "{}", without.stderr);
    assert_eq!(place.run(["records", "key", "other.key"]).code, Some(0));
    let other = place.run(["recompute", &folder, "--plan", "looser.toml", "--key", "other.key"]);
    assert_eq!(other.code, Some(2), "{}{}", other.stdout, other.stderr);
    assert!(other.stderr.contains("this key did not sign the run"), "{}", other.stderr);
    assert_eq!(place.runs().len(), runs);
    assert_eq!(verify().code, Some(0), "{}", verify().stdout);
    // The run alone is as it was written, and nothing proves when and where it was closed. It was signed, so it had a chain.
    let records = place.path().join("records");
    for day in fs::read_dir(&records).expect("the records") {
        let _ = fs::remove_file(day.expect("a day").path().join("CHAIN"));
    }
    fs::remove_file(records.join("COUNTER")).expect("the counter");
    let told = "no chain stands beside it: its number, time and place are not proved";
    let alone = place.run(["records", "verify", &folder]);
    assert!(alone.code == Some(2) && alone.stdout.contains("as written"), "{}{}", alone.stdout, alone.stderr);
    assert!(alone.stderr.contains("nothing shows that a station wrote them"), "{}", alone.stderr);
    assert!(alone.stdout.contains(told), "{}", alone.stdout);
    let signed = place.run(["records", "verify", &folder, "--key", "station.key.pub"]);
    assert!(signed.code == Some(1) && signed.stdout.contains(told), "{}{}", signed.stdout, signed.stderr);
}

/// A run from before the key has no key that could sign a judgement of it, whichever is given, and the hint asks for none.
#[test]
fn a_run_from_before_the_key_is_judged_in_a_folder_of_its_own() {
    let board = gnc_tests::Board::start(super::MOCK, &["--speed", "max", "--serial-number", "SIM-0001"]);
    let place = place();
    assert_eq!(place.run(["records", "key", "station.key"]).code, Some(0));
    place.write("bench.toml", &board.bench_file("line-2"));
    assert_eq!(place.run(["--auto"].iter().chain(&ON_BOARD)).code, Some(0));
    let run = place.runs()[0].clone();
    bench(&place, &board, "");
    assert_eq!(place.run(["--auto"].iter().chain(&ON_BOARD)).code, Some(0));
    place.write("looser.toml", &GOOD.replace("<= 0", "<= 9"));
    place.write("elsewhere.toml", "[station]\nid = \"line-3\"\n");
    let judge = |folder: &std::path::Path, more: &[&str]| {
        let folder = folder.to_string_lossy().into_owned();
        place.run([&["recompute", &folder, "--plan", "looser.toml"][..], more].concat())
    };
    for more in [["--key", "station.key"], ["--bench", "elsewhere.toml"]] {
        let judged = judge(&run, &more);
        let told = format!("{}{}", judged.stdout, judged.stderr);
        assert!(judged.code == Some(2) && told.contains("the run is not signed, and runs beside it are"), "{told}");
        assert!(
            told.contains("copy the run into a records folder of its own") && !told.contains("private key"),
            "{told}"
        );
    }
}

/// A loosened plan and an added one are refused before any run, by `--auto` and by `plan check`.
#[test]
fn a_bench_runs_the_plans_that_it_pins() {
    let board = gnc_tests::Board::start(super::MOCK, &["--speed", "max", "--serial-number", "SIM-0001"]);
    let place = place();
    assert_eq!(place.run(["records", "key", "station.key"]).code, Some(0));
    bench(&place, &board, "");
    let check = |plan: &str| place.run(["plan", "check", plan]);
    let told = check("incoming.toml").stdout;
    let line =
        told.lines().find_map(|line| line.split_once("[plans] of a bench file: ")).expect("the line").1.to_owned();
    assert!(line.starts_with("incoming = \"sha256:"), "{told}");
    bench(&place, &board, &format!("[plans]\n{line}\n"));
    assert!(check("incoming.toml").stdout.contains(&format!("pinned by the bench file: {line}")));
    let auto = |plan: &str| place.run(["--auto", plan, "--serial-number", "SIM-0001"]);
    assert_eq!(auto("incoming.toml").code, Some(0));
    let refused = |plan: &str, why: &str| {
        let runs = place.runs().len();
        let run = auto(plan);
        assert!(run.code == Some(2) && run.stderr.contains(why), "{:?} {}{}", run.code, run.stdout, run.stderr);
        assert_eq!(place.runs().len(), runs, "a run was begun: {}", run.stdout);
        let checked = check(plan);
        assert!(checked.code == Some(2) && checked.stdout.contains(why), "{}{}", checked.stdout, checked.stderr);
        // A line to paste would undo the refusal; who releases the text asks without the bench file.
        assert!(!checked.stdout.contains("sha256:"), "{}", checked.stdout);
        let released = place.run(["plan", "check", "--sim", plan]).stdout;
        assert!(released.contains("to pin it under [plans] of a bench file"), "{released}");
    };
    refused("other.toml", "plan other is none of them");
    // A pass of a plan that is not pinned may come from any text.
    place.write(
        "second.toml",
        &GOOD.replacen("incoming", "second", 1).replacen("version", "requires_plan = [\"other\"]\nversion", 1),
    );
    bench(&place, &board, "");
    let told = check("second.toml").stdout;
    let second = told.lines().find_map(|line| line.split_once("[plans] of a bench file: ")).expect("the line").1;
    bench(&place, &board, &format!("[plans]\n{line}\n{second}\n"));
    let runs = place.runs().len();
    for run in [auto("second.toml"), check("second.toml")] {
        let said = format!("{}{}", run.stdout, run.stderr);
        assert!(
            run.code == Some(2)
                && said.contains("requires a pass of other, and the bench file pins plans but not that one"),
            "{said}"
        );
    }
    assert_eq!(place.runs().len(), runs);
    place.write("incoming.toml", &GOOD.replace("<= 0", "<= 9"));
    refused("incoming.toml", &format!("pins plan incoming to {}, and this one has ", &line[19..31]));
}
