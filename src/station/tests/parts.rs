//! Limits by part number on the simulated bench: the module that answers decides which limits count, and what was asked for is
//! compared with what it says.

#![cfg(feature = "sim")]
#![expect(clippy::expect_used, clippy::panic, reason = "a test says what it expected")]

#[path = "played/played.rs"]
mod played;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use gnc_bench::control::RunControl;
use gnc_executive::event::EventKind;
use gnc_executive::outcome::Outcome;
use gnc_executive::part::PartName;
use gnc_executive::state::RunState;
use hw_mocks::{BenchOptions, Personality, Speed};
use played::{outcomes, request, run_plan, run_request};

/// The simulated module draws 0.49 A: too much for the plan and for revision D, not for the part.
const PLAN: &str = r#"
name = "family"
version = "1"
[[item]]
id = "identity"
[item.limits]
supply_current = "<= 0.3 A"
[part."GNC/POP-26.B".limits]
identity.supply_current = "<= 0.7 A"
[part."GNC/POP-26.B".revision.D.limits]
identity.supply_current = "<= 0.2 A"
"#;

fn options(module: &str) -> BenchOptions {
    let text = format!("description = \"part\"\n{module}");
    let personality = Personality::from_toml("part", &text).unwrap_or_else(|error| panic!("{error}"));
    BenchOptions { personality, speed: Speed::Max, ..BenchOptions::default() }
}

fn says(part: &str, hardware: &str) -> String {
    format!("[module]\npart = '{part}'\nhardware = '{hardware}'\n")
}

fn run(plan: &str, module: &str, asked: Option<PartName>) -> RunState {
    run_request(&gnc_bench::service::RunRequest { part: asked, ..request(plan) }, &options(module), |_, _| {}, |_| {})
}

fn verdict(state: &RunState) -> Outcome {
    state.verdict().expect("an end").of_items()
}

/// Checks that nothing was tested, that the run says nothing of the module, and why.
#[track_caller]
fn check_errored(state: &RunState, why: &str) {
    assert_eq!((verdict(state), outcomes(state)), (Outcome::Errored, vec![Outcome::NotRun]));
    let notes: Vec<&str> = state.notes().iter().map(|note| note.text.as_str()).collect();
    assert!(notes.iter().any(|note| note.contains(why)), "{why}: {notes:?}");
}

#[test]
fn the_module_decides_which_limits_count() {
    for (part, hardware, limits, outcome) in [
        ("GNC/POP-26.B", "C", "part GNC/POP-26.B", Outcome::Passed),
        (" gnc/pop-26.b", "", "part GNC/POP-26.B", Outcome::Passed),
        ("GNC/POP-26.B", "d", "part GNC/POP-26.B rev D", Outcome::Failed),
        ("GNC/POP-26", "C", "of the plan (it has none of its own for part GNC/POP-26 rev C)", Outcome::Failed),
    ] {
        let state = run(PLAN, &says(part, hardware), None);
        assert_eq!(verdict(&state), outcome, "{part} {hardware}");
        assert_eq!(state.limits().expect("limits").to_string(), limits);
    }
}

/// A module whose memory was never written says blanks: that is no part, and no reason for the plan's own limits.
#[test]
fn a_module_that_says_blanks_says_nothing() {
    for number in ["", "  "] {
        for hardware in ["-", "C"] {
            check_errored(&run(PLAN, &says(number, hardware), None), "the module does not say what it is");
            let asked = PartName::new("GNC/POP-26.B", Some("C"));
            let state = run(PLAN, &says(number, hardware), Some(asked));
            assert_eq!(verdict(&state), Outcome::Passed, "{number:?} {hardware}");
            assert_eq!(state.limits().expect("limits").to_string(), "part GNC/POP-26.B");
        }
        let other = Some(PartName::new("GNC/POP-26.B", Some("C")));
        check_errored(&run(PLAN, &says(number, "D"), other), "the module says that it is part without number rev D");
    }
}

#[test]
fn a_plan_without_such_limits_tells_nothing_of_them() {
    let plan = PLAN.split("[part").next().expect("a head");
    let state = run(plan, &says("GNC/POP-26.B", "C"), None);
    assert_eq!((state.limits(), verdict(&state)), (None, Outcome::Failed));
}

#[test]
fn what_is_asked_for_is_compared_with_what_the_module_says() {
    let module = says("GNC/POP-26.B", "C");
    for (number, revision) in [("GNC/POP-26.B", None), ("gnc/pop-26.b", Some("c"))] {
        assert_eq!(verdict(&run(PLAN, &module, Some(PartName::new(number, revision)))), Outcome::Passed, "{number}");
    }
    let plain = PLAN.split("[part").next().expect("a head");
    for (number, revision) in [("GNC/POP-26", None), ("GNC/POP-26.B", Some("D")), ("GNC/POP-26.B", Some("-"))] {
        for plan in [PLAN, plain] {
            let state = run(plan, &module, Some(PartName::new(number, revision)));
            check_errored(&state, "the module says that it is part GNC/POP-26.B rev C");
        }
    }
}

#[test]
fn a_part_without_a_table_is_refused_where_the_plan_requires_one() {
    let plan = PLAN.replace("version = \"1\"", "version = \"1\"\nrequires_part = true");
    check_errored(&run(&plan, &says("GNC/POP-26", "C"), None), "the plan has no limits for part GNC/POP-26 rev C");
    assert_eq!(verdict(&run(&plan, &says("GNC/POP-26.B", "C"), None)), Outcome::Passed);
}

#[test]
fn a_module_that_starts_slowly_is_waited_for() {
    let module = format!("{}[start]\nlate_every = 1\nlate_ms = 3000.0\n", says("GNC/POP-26.B", "C"));
    assert_eq!(verdict(&run(PLAN, &module, None)), Outcome::Passed);
}

#[test]
fn a_silent_module_has_the_limits_of_the_part_that_was_asked_for() {
    let module = format!("{}[start]\nhangs_every = 1\n", says("GNC/POP-26.B", "C"));
    check_errored(&run(PLAN, &module, None), "the module does not say what it is");
    check_errored(&run(PLAN, &module, Some(PartName::new("GNC/POP-26.B", None))), "depend on its revision");
    // A dead module fails, as by a plan without parts.
    let state = run(PLAN, &module, Some(PartName::new("GNC/POP-26.B", Some("C"))));
    assert_eq!(verdict(&state), Outcome::Failed);
    assert_eq!(state.limits().expect("limits").to_string(), "part GNC/POP-26.B");
}

#[test]
fn the_choice_comes_once_and_before_all_items() {
    let state = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
    let kinds = state.clone();
    let watch = move |event: &gnc_executive::event::Event, _: &RunControl| {
        let kind = match &event.kind {
            EventKind::LimitsChosen(_) => "limits",
            EventKind::ItemStarted { .. } => "item",
            _ => return,
        };
        kinds.lock().expect("a list").push(kind);
    };
    let plan = PLAN.replace("id = \"identity\"", "id = \"identity\"\nattempts = 2\nretry_failed = true");
    run_plan(&plan, &options(&says("GNC/POP-26", "C")), watch);
    assert_eq!(*state.lock().expect("a list"), ["limits", "item", "item"]);
}

/// A folder with the plan and a simulated module.
struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    fn new(part: &str, hardware: &str) -> Self {
        let place = Self { folder: tempfile::tempdir().expect("a folder") };
        place.write("plan.toml", PLAN);
        place.write("module.toml", &format!("description = \"part\"\n{}", says(part, hardware)));
        place
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.folder.path().join(name), text).expect("a file");
    }

    fn station(&self, words: &str) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gnc-station"));
        command.current_dir(self.folder.path()).args(words.split(' ')).output().expect("a program")
    }

    fn auto(&self, more: &str) -> Output {
        self.station(format!("--auto plan.toml --sim=module.toml --sim-speed max --serial-number SN {more}").trim_end())
    }

    /// The folder of the newest run.
    fn run(&self) -> PathBuf {
        let inner = |folder: &Path| {
            let mut all: Vec<PathBuf> = std::fs::read_dir(folder)
                .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
                .filter_map(|entry| Some(entry.ok()?.path()).filter(|path| path.is_dir()))
                .collect();
            all.sort();
            all.pop().expect("a folder")
        };
        inner(&inner(&inner(&self.folder.path().join("records"))))
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.run().join(name)).expect("a file")
    }
}

fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

#[test]
fn the_record_tells_which_limits_were_used_and_recompute_uses_them() {
    let place = Place::new("GNC/POP-26.B", "C");
    let done = place.auto("--part gnc/pop-26.b --revision C --junit j.xml");
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    assert!(said(&done).contains("limits: part GNC/POP-26.B"), "{}", said(&done));
    let record = place.read("run.json");
    let limits = "\"limits\":{\"part\":{\"number\":\"GNC/POP-26.B\"},\"module\":{\"number\":\"GNC/POP-26.B\",\"revision\":\"C\"}}";
    let narrow: String = record.split_whitespace().collect();
    assert!(narrow.contains(limits), "{record}");
    assert!(narrow.contains("\"part\":{\"number\":\"gnc/pop-26.b\",\"revision\":\"C\"}"), "{record}");
    assert!(place.read("report.html").contains("part GNC/POP-26.B"));
    assert!(place.read("log.txt").contains("part GNC/POP-26.B"));
    let junit = std::fs::read_to_string(place.folder.path().join("j.xml")).expect("a file");
    assert!(junit.contains("value=\"part GNC/POP-26.B\""), "{junit}");
    let run = place.run().display().to_string();
    let same = place.station(&format!("recompute {run}"));
    assert_eq!(same.status.code(), Some(0), "{}", said(&same));
    // Another plan has other limits for the same module: those count then, and the new record names them.
    place.write("plan.toml", &PLAN.replace("\"<= 0.7 A\"", "\"<= 0.1 A\""));
    let other = place.station(&format!("recompute {run} --plan plan.toml"));
    assert_eq!(other.status.code(), Some(1), "{}", said(&other));
    place.write(
        "plan.toml",
        &PLAN.replace("GNC/POP-26.B", "X").replace("version = \"1\"", "version = \"2\"\nrequires_part = true"),
    );
    let other = place.station(&format!("recompute {run} --plan plan.toml"));
    assert!(said(&other).contains("the plan has no limits for part GNC/POP-26.B rev C"), "{}", said(&other));
}

#[test]
fn a_run_without_such_limits_is_judged_again_by_what_its_module_said() {
    let place = Place::new("GNC/POP-26.B", "C");
    place.write("plan.toml", PLAN.split("[part").next().expect("a head"));
    assert_eq!(place.auto("").status.code(), Some(1));
    let run = place.run().display().to_string();
    place.write("plan.toml", PLAN);
    let again = place.station(&format!("recompute {run} --plan plan.toml"));
    assert_eq!(again.status.code(), Some(0), "{}", said(&again));
    assert!(place.read("log.txt").contains("part GNC/POP-26.B"), "{}", place.read("log.txt"));
}

#[test]
fn plan_check_shows_the_limits_for_a_part() {
    let place = Place::new("GNC/POP-26.B", "C");
    let shown = |words: &str| {
        let output = place.station(&format!("plan check plan.toml --sim {words}"));
        (output.status.code(), said(&output))
    };
    let (code, text) = shown("--part gnc/pop-26.b --revision D");
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("limits: part GNC/POP-26.B rev D"), "{text}");
    assert!(
        text.contains("identity supply_current <= 0.2 A (the item has 0.3 A)")
            || text.contains("(the item has <= 0.3 A)"),
        "{text}"
    );
    let (code, text) = shown("--part X");
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("limits: of the plan") && text.contains("identity supply_current <= 0.3 A\n"), "{text}");
    let (code, text) = shown("--part GNC/POP-26.B");
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("depend on its revision") && text.contains("--revision REV"), "{text}");
    for part in ["GNC-*", "ＧＮＣ", "\u{200b}GNC"] {
        let (code, text) = shown(&format!("--part {part}"));
        assert_eq!(code, Some(2), "{part}: {text}");
    }
}

#[test]
fn a_board_that_cannot_measure_what_a_part_needs_is_told_and_a_resume_needs_the_same_limits() {
    let place = Place::new("GNC/POP-26.B", "C");
    place.write("plan.toml", &PLAN.replace("supply_current = \"<= 0.3 A\"", "protocol = \"== 1\""));
    let module = |hardware: &str| {
        let text =
            format!("description = \"part\"\n{}[board]\nno_power_switch = true\n", says("GNC/POP-26.B", hardware));
        place.write("module.toml", &text);
    };
    module("C");
    let done = place.auto("");
    assert_eq!(done.status.code(), Some(3), "{}", said(&done));
    assert!(place.read("log.txt").contains("the limits part GNC/POP-26.B cannot be kept"), "{}", place.read("log.txt"));
    let run = place.run().display().to_string();
    // The module was reworked meanwhile.
    module("D");
    let done = place.auto(&format!("--resume {run}"));
    assert_eq!(done.status.code(), Some(3), "{}", said(&done));
    let log = place.read("log.txt");
    let told = "the run to resume had the limits part GNC/POP-26.B, this run has part GNC/POP-26.B rev D";
    assert!(log.contains(told), "{log}");
}
