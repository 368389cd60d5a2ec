//! What the records say of a module, as its operator and scripts meet it on real and simulated benches.

use std::fs;

use gnc_tests::{Board, PARTIAL, Place, Run, read_json};

const STATION: &str = env!("CARGO_BIN_EXE_station-under-test");
const MOCK: &str = env!("CARGO_BIN_EXE_mock-under-test");

const CPU: &str = "[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"<= 0\"\n\
                   [[item]]\nid = \"timers\"\nlimits.timer0_1ms_worst = \"<= 50 %\"\n";
/// No module keeps this limit.
const NEVER: &str = "[[item]]\nid = \"cpu\"\nlimits.core1_register_errors = \"1 .. 2\"\n";

/// A folder with the plan `incoming`, and the plan `functional` that requires it.
fn place(incoming: &str) -> Place {
    let place = Place::new(STATION);
    place.write("incoming.toml", &format!("name = \"incoming\"\nversion = \"1\"\n{incoming}"));
    let requires = "name = \"functional\"\nversion = \"1\"\nrequires_plan = [\"incoming\"]\n";
    place.write("functional.toml", &format!("{requires}{CPU}"));
    place
}

fn run(place: &Place, plan: &str, more: &[&str]) -> Run {
    let plan = format!("{plan}.toml");
    let args = ["--auto", &plan, "--serial-number", "SIM-0001"];
    place.run(args.iter().chain(more))
}

const SIM: [&str; 3] = ["--sim", "--sim-speed", "max"];

#[track_caller]
fn refused(run: &Run, runs: (&Place, usize), standing: &str) {
    assert_eq!(run.code, Some(3), "{}{}", run.stdout, run.stderr);
    let told = format!("functional requires a pass of incoming, and SIM-0001 has none that counts: {standing}");
    assert!(run.stderr.contains(&told), "{}", run.stderr);
    assert!(run.stderr.contains("try: run that plan on this module first"), "{}", run.stderr);
    let (place, count) = runs;
    assert_eq!(place.runs().len(), count, "a run was begun: {}", run.stdout);
}

/// A plan that requires another does not begin before that one passed as a whole.
#[test]
fn a_plan_waits_for_the_plan_that_it_requires() {
    let place = place(CPU);
    refused(&run(&place, "functional", &SIM), (&place, 0), "never tested");
    let chosen = run(&place, "incoming", &[&SIM[..], &["--only", "cpu"]].concat());
    assert_eq!(chosen.code, PARTIAL, "{}{}", chosen.stdout, chosen.stderr);
    assert!(chosen.stdout.lines().last().is_some_and(|line| line.starts_with("SIM-0001: only cpu passed ")));
    refused(&run(&place, "functional", &SIM), (&place, 1), "only cpu passed ");
    let passed = run(&place, "incoming", &SIM);
    assert_eq!(passed.code, Some(0), "{}{}", passed.stdout, passed.stderr);
    let last = passed.stdout.lines().last().unwrap_or_default();
    assert!(last.starts_with("SIM-0001: incoming passed ") && last.ends_with(", simulated"), "{last}");
    let then = run(&place, "functional", &SIM);
    assert_eq!(then.code, Some(0), "{}{}", then.stdout, then.stderr);
    // Chosen items of such a plan wait as well: the module may not be fit for the bench.
    let other = ["--auto", "functional.toml", "--serial-number", "OTHER", "--sim", "--only", "cpu"];
    let other = place.run(other);
    assert_eq!(other.code, Some(3), "{}{}", other.stdout, other.stderr);
    assert!(other.stderr.contains("OTHER has none that counts: never tested"), "{}", other.stderr);
}

#[test]
fn a_failed_plan_is_no_pass_for_the_next() {
    let place = place(NEVER);
    assert_eq!(run(&place, "incoming", &SIM).code, Some(1));
    refused(&run(&place, "functional", &SIM), (&place, 1), "incoming failed ");
}

/// A module passed and then failed. The failed run is removed with its lines, and `COUNTER` remembers them: the gate says so,
/// and one more pass of the module counts again.
#[test]
fn lines_that_are_missing_behind_a_pass_close_the_gate_until_the_next_one() {
    let place = place(CPU);
    assert_eq!(run(&place, "incoming", &SIM).code, Some(0));
    let day = place.runs()[0].ancestors().nth(2).expect("a day").to_owned();
    let before = fs::read(day.join("CHAIN")).expect("a chain");
    place.write("incoming.toml", &format!("name = \"incoming\"\nversion = \"1\"\n{NEVER}"));
    assert_eq!(run(&place, "incoming", &SIM).code, Some(1));
    let failed = place.runs().into_iter().find(|run| read_json(&run.join("run.json"))["outcome"] == "failed");
    fs::remove_dir_all(failed.expect("the failed run")).expect("a folder");
    fs::write(day.join("CHAIN"), before).expect("a chain");
    let told = run(&place, "functional", &SIM);
    assert_eq!(told.code, Some(3), "{}{}", told.stdout, told.stderr);
    for said in [
        "SIM-0001 has none that counts: incoming passed ",
        ", simulated: later lines of the chain are missing or damaged",
        "try: run that plan on this module again: a pass behind the missing lines counts",
    ] {
        assert!(told.stderr.contains(said), "{said}: {}", told.stderr);
    }
    // A list says how a run ended: this one did pass.
    let listed = place.run(["records", "list", "--json", "--outcome", "passed"]).stdout;
    assert!(listed.contains("\"seal\":\"held\""), "{listed}");
    // Of its own accord nothing closes the hole, and `verify` names it for ever.
    place.write("incoming.toml", &format!("name = \"incoming\"\nversion = \"1\"\n{CPU}"));
    assert_eq!(run(&place, "incoming", &SIM).code, Some(0));
    assert_eq!(run(&place, "functional", &SIM).code, Some(0));
    let verified = place.run(["records", "verify"]);
    assert!(verified.code == Some(1) && verified.stdout.contains("are missing, between line 2"), "{}", verified.stdout);
}

/// A module passed and then failed. Whoever removes the folder of the failed run does not open the gate: the chain names it.
/// The report for CI servers tells of the refusal.
#[test]
fn a_removed_failure_does_not_open_the_gate() {
    let place = place(CPU);
    assert_eq!(run(&place, "incoming", &SIM).code, Some(0));
    place.write("incoming.toml", &format!("name = \"incoming\"\nversion = \"1\"\n{NEVER}"));
    assert_eq!(run(&place, "incoming", &SIM).code, Some(1));
    refused(&run(&place, "functional", &SIM), (&place, 2), "incoming failed ");
    let failed = place.runs().into_iter().find(|run| read_json(&run.join("run.json"))["outcome"] == "failed");
    std::fs::remove_dir_all(failed.expect("the failed run")).expect("removable");
    let again = run(&place, "functional", &[&SIM[..], &["--junit", "ci.xml"]].concat());
    refused(&again, (&place, 1), "incoming passed ");
    assert!(again.stderr.contains("record is missing"), "{}", again.stderr);
    let report = std::fs::read_to_string(place.path().join("ci.xml")).expect("a report");
    assert!(report.contains("requires a pass of incoming") && !report.contains("has not ended"), "{report}");
}

/// Neither a simulated pass of the same number nor one on a bench that does not prove its board lets a run begin there, and the
/// unproven one lets none begin on a simulated bench either. `.ci/run can guest` begins one on serial ports.
#[test]
fn a_bench_asks_for_a_real_pass() {
    let board = Board::start(MOCK, &["--speed", "max", "--serial-number", "SIM-0001"]);
    let place = place(CPU);
    let own_name = place.path().join("board");
    std::os::unix::fs::symlink(&board.port, &own_name).expect("a link");
    for bench in
        [board.bench_file("line-2"), board.bench_file("line-2").replace(&board.port, &own_name.to_string_lossy())]
    {
        place.write("bench.toml", &bench);
        let before = place.runs().len();
        let unproven = run(&place, "incoming", &[]);
        assert_eq!(unproven.code, Some(0), "{}{}", unproven.stdout, unproven.stderr);
        assert!(unproven.stdout.contains("PASSED (unproven)  SIM-0001"), "{}", unproven.stdout);
        let banner =
            format!("UNPROVEN BENCH (port {} is a pseudo-terminal)", bench.split('"').nth(3).unwrap_or_default());
        assert!(unproven.stdout.contains(&banner), "{}", unproven.stdout);
        let last = unproven.stdout.lines().last().unwrap_or_default();
        assert!(last.starts_with("SIM-0001: incoming passed ") && last.ends_with(": unproven"), "{last}");
        for more in [&[][..], &SIM] {
            let then = run(&place, "functional", more);
            refused(&then, (&place, before + 1), "incoming passed ");
            assert!(then.stderr.contains(": unproven"), "{}", then.stderr);
        }
    }
    assert_eq!(run(&place, "incoming", &[&SIM[..], &["--records", "records"]].concat()).code, Some(0));
    refused(&run(&place, "functional", &[]), (&place, 3), "incoming passed ");
    assert_eq!(run(&place, "functional", &SIM).code, Some(0), "a simulated run takes a simulated pass");
}

#[test]
fn a_pass_whose_record_was_changed_or_that_left_the_chain_is_none() {
    let place = place(CPU);
    assert_eq!(run(&place, "incoming", &SIM).code, Some(0));
    // Somebody corrects a record, or loses the chain.
    let incoming = place.runs().into_iter().find(|run| {
        let record = fs::read_to_string(run.join("run.json")).expect("a record");
        record.contains("\"name\": \"incoming\"")
    });
    let incoming = incoming.expect("the pass");
    let path = incoming.join("run.json");
    let record = fs::read_to_string(&path).expect("a record");
    fs::write(&path, record.replace("\"station\": \"sim\"", "\"station\": \"line-3\"")).expect("writable");
    let changed = run(&place, "functional", &SIM);
    assert_eq!(changed.code, Some(3), "{}{}", changed.stdout, changed.stderr);
    assert!(changed.stderr.contains(": record was changed"), "{}", changed.stderr);
    let list = place.run(["records", "list"]);
    assert_eq!(list.stdout.matches(" record was changed").count(), 1, "{}", list.stdout);
    fs::write(&path, record).expect("writable");
    assert_eq!(run(&place, "functional", &SIM).code, Some(0));
    let chain = incoming.ancestors().nth(2).expect("a day").join("CHAIN");
    fs::remove_file(chain).expect("a chain");
    let unchained = run(&place, "functional", &SIM);
    assert_eq!(unchained.code, Some(3), "{}{}", unchained.stdout, unchained.stderr);
    assert!(unchained.stderr.contains(": not in the chain"), "{}", unchained.stderr);
}
