//! Every scene of the screen by its name. Pictures and properties run over all of them.

use std::time::Duration;

use chrono::{DateTime, FixedOffset};
use gnc_analysis::heat::{Temperatures, Warmth};
use gnc_bench::fixture::{Ask, SwitchReading, TakenOver};
use gnc_bench::guidance::Stage;
use gnc_executive::catalogue::ItemId;
use gnc_executive::event::{AttemptError, BenchKind, ErrorRecord, EventKind, NoteLevel};
use gnc_executive::outcome::{Cause, Outcome};
use gnc_executive::standing::{PastRun, Standing};
use gnc_executive::verdict::Verdict;
use gnc_records::shift::{ModuleOfShift, Shift};
use gnc_records::standing::Face;
use gnc_rig::{Along, Orientation};

use super::{captures, start};
use crate::tui::decode::Key;
use crate::tui::lang::Lang;
use crate::tui::model::Loaded;
use crate::tui::records::{Day, RunLine, Runs};
use crate::tui::scene::{ITEMS, Scene, measured};
use crate::tui::update::Msg;

/// Brings a new screen of a language and a size to a scene.
pub(super) type Play = fn(Lang, (u16, u16)) -> Scene;

/// All scenes. A new scene needs only its line here.
pub(super) const SCENES: &[(&str, Play)] = &[
    ("idle", |lang, size| played(lang, size, |_| {})),
    ("scanned", |lang, size| played(lang, size, scanned)),
    ("shift", |lang, size| {
        played(lang, size, |scene| {
            records(scene);
            shift(scene);
        })
    }),
    ("shift_idle", |lang, size| played(lang, size, shift)),
    ("running", |lang, size| Scene::at_work(lang, size.0, size.1).expect("memory")),
    ("pausing", |lang, size| {
        let mut scene = Scene::at_work(lang, size.0, size.1).expect("memory");
        scene.key(Key::F(6));
        scene
    }),
    ("paused", |lang, size| {
        played(lang, size, |scene| {
            scene.start("DEMO-1");
            scene.passes(&["identity", "cpu"]);
            scene.key(Key::F(6));
        })
    }),
    ("passed", |lang, size| {
        played(lang, size, |scene| {
            scene.start("DEMO-1");
            scene.passes(&ITEMS.map(ItemId::as_str));
            scene.run_ends(Outcome::Passed);
        })
    }),
    ("unproven", |lang, size| {
        played(lang, size, |scene| {
            scene.unproven();
            scene.start("DEMO-1");
            scene.passes(&ITEMS.map(ItemId::as_str));
            scene.run_ends(Outcome::Passed);
        })
    }),
    ("partial", |lang, size| {
        played(lang, size, |scene| {
            scene.start_selection("DEMO-1", &["cpu"]);
            scene.event(EventKind::ItemStarted { item: "cpu".into(), attempt: 1 });
            scene.ends("cpu", Outcome::Passed);
            scene.run_ends(Outcome::Passed);
        })
    }),
    ("failed", |lang, size| played(lang, size, fail)),
    ("item", |lang, size| {
        played(lang, size, |scene| {
            fail(scene);
            scene.key(Key::Enter);
        })
    }),
    ("unrecorded", |lang, size| {
        played(lang, size, |scene| {
            fail(scene);
            let store_error = "cannot write records/2026-11-22/DEMO-1: No space left on device (os error 28)";
            let verdict = Some(Verdict::Module(Outcome::Failed));
            scene.tell(Msg::RunOver { verdict, store_error: Some(store_error.into()), refusal: None });
        })
    }),
    ("errored", |lang, size| played(lang, size, error)),
    ("prompt-switch", |lang, size| asked(lang, size, &Ask::Switches(Some(3)))),
    ("prompt-switch-again", |lang, size| {
        let still = vec![
            SwitchReading { switch: 2, on: true, volt: 3.306 },
            SwitchReading { switch: 3, on: false, volt: 2.008 },
        ];
        asked(lang, size, &Ask::SwitchesAgain { on: Some(3), still })
    }),
    ("prompt-turn", |lang, size| asked(lang, size, &Ask::Heading { deg: 120.0 })),
    ("prompt-lay", |lang, size| asked(lang, size, &Ask::Lay(UPSIDE_DOWN))),
    ("prompt-resumed", |lang, size| {
        let over = TakenOver { taken: vec!["x+".into(), "x-".into()], left: vec!["y+".into(), "y-".into()] };
        asked(lang, size, &Ask::Resumed { over, next: Box::new(Ask::Lay(UPSIDE_DOWN)) })
    }),
    ("prompt-table", |lang, size| {
        let turn = Ask::Turn { orientation: Some(UPSIDE_DOWN), angle_deg: -1080.0, span_s: 5.0, ramp_s: 0.5 };
        asked(lang, size, &turn)
    }),
    ("prompt-spin", |lang, size| {
        let north = Orientation::Axis { axis: 2, positive: true, along: Along::North, heading_deg: 0.0 };
        asked(lang, size, &Ask::Spin { orientation: Some(north), rate_dps: 5400.0 })
    }),
    ("prompt-stop", |lang, size| asked(lang, size, &Ask::StopTable)),
    ("prompt-words", |lang, size| asked(lang, size, &Ask::Words("Close the lid of the shield.".into()))),
    ("live", |lang, size| {
        played(lang, size, |scene| {
            scene.start("DEMO-1");
            scene.readings(300);
            scene.key(Key::F(9));
        })
    }),
    ("live-roll", |lang, size| {
        played(lang, size, |scene| {
            scene.key(Key::F(9));
            scene.readings_of_a_calibrated_module();
        })
    }),
    ("live-empty", |lang, size| played(lang, size, |scene| drop(scene.key(Key::F(9))))),
    ("records-days", |lang, size| played(lang, size, records)),
    ("records-runs", |lang, size| played(lang, size, runs)),
    ("records-run", |lang, size| played(lang, size, record)),
    ("records-late", |lang, size| played(lang, size, late)),
    ("records-late-run", |lang, size| {
        played(lang, size, |scene| {
            late(scene);
            scene.tell(opened(scene.model.lang, Face::Late(Verdict::Module(Outcome::Failed))));
        })
    }),
    ("records-newer", |lang, size| played(lang, size, start::newer)),
    ("help", |lang, size| played(lang, size, |scene| drop(scene.key(Key::F(1))))),
    ("setup", |lang, size| played(lang, size, |scene| drop(scene.key(Key::F(2))))),
    ("setup-mistakes", |lang, size| played(lang, size, mistakes)),
    ("not-ready", |lang, size| played(lang, size, not_ready)),
    ("not-ready-all", |lang, size| {
        played(lang, size, |scene| {
            not_ready(scene);
            scene.key(Key::Enter);
        })
    }),
    ("leave", |lang, size| {
        played(lang, size, |scene| {
            scene.start("DEMO-1");
            scene.key(Key::F(10));
        })
    }),
    ("again", |lang, size| played(lang, size, start::again)),
    ("changed", |lang, size| played(lang, size, |scene| drop(start::start(scene, start::changed(), None)))),
    ("interrupted", |lang, size| played(lang, size, |scene| drop(start::start(scene, vec![], start::broke_off())))),
    ("no-resume", |lang, size| played(lang, size, |scene| drop(start::start(scene, vec![], start::unlike())))),
    ("broke-off", |lang, size| {
        played(lang, size, |scene| {
            scene.types("DEMO-1");
            scene.key(Key::Enter);
            scene.tell(start::told("DEMO-1"));
        })
    }),
    ("broke-off-scan", |lang, size| played(lang, size, |scene| drop(scene.tell(start::told("DEMO-1"))))),
    ("stop", |lang, size| {
        let mut scene = start::in_the_hour(lang, size, 3000.0);
        scene.key(Key::F(8));
        scene
    }),
    ("give-up", |lang, size| {
        let mut scene = start::in_the_hour(lang, size, 3000.0);
        start::to_bias_stability(&mut scene);
        scene.key(Key::F(7));
        scene
    }),
    ("leave-loses", |lang, size| {
        let mut scene = start::in_the_hour(lang, size, 3000.0);
        scene.key(Key::F(10));
        scene
    }),
    ("heat", |lang, size| {
        let mut scene = Scene::capturing(lang, size, "six-position", 2).expect("memory");
        let mut guidance = scene.guidance("six-position", 2, 0.0);
        let at = |c: f64| Temperatures { gyro_c: c + 0.1, accel_c: c - 0.1 };
        let warmth =
            Warmth { now: at(25.31), target: at(28.02), left_s: Some(254.0), bound_s: 1700.0, waited_s: 100.0 };
        guidance.stage = Stage::Warming(warmth);
        scene.guided("six-position", guidance);
        turned(scene)
    }),
    ("captures-none", |lang, size| turned(Scene::calibration(lang, size.0, size.1).expect("memory"))),
    ("captures-still", |lang, size| turned(captures::still(lang, size))),
    ("captures-still-tests", captures::still),
    ("captures-turn", |lang, size| turned(Scene::capturing(lang, size, "rotation", 1).expect("memory"))),
    ("captures-field", |lang, size| turned(Scene::spinning(lang, size, 20_000).expect("memory"))),
    ("captures-field-early", |lang, size| turned(Scene::spinning(lang, size, 12).expect("memory"))),
    ("captures-allan", |lang, size| turned(Scene::resting(lang, size, 60_000).expect("memory"))),
    ("captures-allan-early", |lang, size| turned(Scene::resting(lang, size, 3).expect("memory"))),
];

const UPSIDE_DOWN: Orientation = Orientation::Axis { axis: 2, positive: false, along: Along::Up, heading_deg: 90.0 };

fn played(lang: Lang, (width, height): (u16, u16), play: impl Fn(&mut Scene)) -> Scene {
    let mut scene = Scene::new(lang, width, height).expect("memory");
    play(&mut scene);
    scene
}

/// The next page, which is that of the captures.
fn turned(mut scene: Scene) -> Scene {
    scene.key(Key::F(9));
    scene
}

/// A run that has asked twelve seconds ago.
fn asked(lang: Lang, size: (u16, u16), ask: &Ask) -> Scene {
    played(lang, size, |scene| {
        scene.start("DEMO-1");
        scene.event(EventKind::ItemStarted { item: "ad".into(), attempt: 1 });
        scene.tell(Msg::Asked { item: "ad".into(), ask: ask.clone() });
        scene.pass_time(Duration::from_secs(12));
    })
}

fn scanned(scene: &mut Scene) {
    scene.types("DEMO-1");
    scene.key(Key::Enter);
    let at = chrono::DateTime::parse_from_rfc3339("2026-11-22T09:12:00+08:00").expect("a time");
    scene.tell(Msg::Standing { serial_number: "DEMO-1".into(), standing: Ok(has_failed(at)) });
}

fn mistakes(scene: &mut Scene) {
    let why = "test-plans/mine.toml:4:6: unknown item \"imo\"\n 4 | id = \"imo\"\n   |      ^^^^^\n   = try: did you mean \"imu\"?";
    scene.tell(Msg::Plan { path: "test-plans/mine.toml".into(), plan: Loaded::Refused(why.into()) });
    scene.key(Key::F(2));
}

/// A plan that the bench does not run: the reason is longer than a line.
fn not_ready(scene: &mut Scene) {
    let why = "the bench file pins plan functional to 3f9a0c1d2b4e, and this one has 8e5d7c6b1a20: its text or that of a file that it \
               includes was changed\nbring back the plan as it was released; if the new text is released, `gnc-station plan check --sim` \
               prints the line for [plans]";
    scene.tell(Msg::Plan { path: "test-plans/functional.toml".into(), plan: Loaded::Refused(why.into()) });
}

pub(super) fn fail(scene: &mut Scene) {
    scene.start("DEMO-1");
    scene.passes(&["identity", "cpu", "timers"]);
    let item = || "imu".to_owned();
    scene.event(EventKind::ItemStarted { item: item(), attempt: 1 });
    scene.pass_time(Duration::from_millis(2020));
    let good = measured("gyro_y", 0.04, Outcome::Passed);
    scene.event(EventKind::Measured { item: item(), attempt: 1, measurement: good });
    let bad = measured("gyro_x", 1.52, Outcome::Failed);
    scene.event(EventKind::Measured { item: item(), attempt: 1, measurement: bad });
    scene.ends("imu", Outcome::Failed);
    let cause = Cause::StoppedAfter { item: item(), outcome: Outcome::Failed };
    scene.event(EventKind::ItemEnded { item: "ad".into(), outcome: Outcome::Skipped, cause: Some(cause) });
    scene.run_ends(Outcome::Failed);
}

pub(super) fn error(scene: &mut Scene) {
    scene.start("DEMO-1");
    scene.passes(&["identity"]);
    let item = || "sci".to_owned();
    scene.event(EventKind::ItemStarted { item: item(), attempt: 1 });
    let record = ErrorRecord {
        what: "SCI byte differs".into(),
        location: "byte 17".into(),
        expected: "0x0000005a".into(),
        got: "0x0000004a".into(),
        board_time_us: 1_250_000,
    };
    scene.event(EventKind::ErrorRecord { item: item(), attempt: 1, record });
    let error = AttemptError {
        text: "no answer from the board to SciEcho: asked 5 times in 2500 ms; nothing else was heard from it".into(),
        hint: "check the board's power, the two pairs (A and B swapped?) and the rate".into(),
        again: false,
    };
    let outcome = Outcome::Errored;
    scene.event(EventKind::AttemptEnded { item: item(), attempt: 1, outcome, error: Some(error) });
    scene.event(EventKind::ItemEnded { item: item(), outcome, cause: None });
    let text = "the link is lost, so the rest of the plan is not run".to_owned();
    scene.event(EventKind::Note { level: NoteLevel::Error, text, item: None });
    scene.run_ends(Outcome::Errored);
}

pub(super) fn line(serial_number: &str, minute: u32, face: Face) -> RunLine {
    let at = chrono::DateTime::parse_from_rfc3339(&format!("2026-11-22T14:{minute:02}:00+08:00")).expect("a time");
    RunLine {
        path: format!("records/2026-11-22/{serial_number}/14{minute:02}00-functional").into(),
        at: Some(at),
        serial_number: serial_number.into(),
        plan: "functional".into(),
        face,
        simulated: true,
        unproven: false,
        selection: minute == 7,
        rejudged: minute == 9,
        elapsed_s: 4.86,
    }
}

/// A module that failed the functional plan on the bench of the scene, which is simulated.
pub(super) fn has_failed(at: DateTime<FixedOffset>) -> Standing {
    let counts = PastRun {
        at: Some(at),
        plan: "functional".into(),
        verdict: Some(Verdict::Module(Outcome::Failed)),
        items: None,
        bench: BenchKind::Simulated,
        is_broken: false,
        flaws: Vec::new(),
    };
    Standing { plan: "functional".into(), counts: Some(counts), beside: None }
}

/// A module without any run.
pub(super) fn never() -> Standing {
    Standing { plan: "functional".into(), counts: None, beside: None }
}

pub(super) fn records(scene: &mut Scene) {
    scene.key(Key::F(9));
    scene.key(Key::F(9));
    let days = vec![
        Day { name: "2026-11-22".into(), serial_numbers: 3 },
        Day { name: "2026-11-21".into(), serial_numbers: 41 },
    ];
    scene.tell(Msg::Days(Ok(days)));
}

pub(super) fn runs(scene: &mut Scene) {
    records(scene);
    let lines = vec![
        line("DEMO-1", 5, Face::Ended(Verdict::Module(Outcome::Failed))),
        line("DEMO-1", 7, Face::Ended(Verdict::Selection(Outcome::Passed))),
        line("DEMO-2", 9, Face::Ended(Verdict::Module(Outcome::Errored))),
        line("模块-3", 11, Face::Interrupted),
    ];
    scene.tell(Msg::Runs(Ok(Runs { day: "2026-11-22".into(), lines, cut: false })));
}

pub(super) fn record(scene: &mut Scene) {
    runs(scene);
    scene.tell(opened(scene.model.lang, Face::Ended(Verdict::Module(Outcome::Failed))));
}

fn opened(lang: Lang, face: Face) -> Msg {
    let mut played = Scene::new(lang, 80, 24).expect("memory");
    fail(&mut played);
    let state = played.model.run.take().expect("a run").state;
    let path = "records/2026-11-22/DEMO-1/140500-functional".into();
    Msg::Opened(Ok(Box::new((path, state, face))))
}

/// A run that passed and was closed by a later start, beside one that was closed in time.
pub(super) fn late(scene: &mut Scene) {
    records(scene);
    let passed = Verdict::Module(Outcome::Passed);
    let lines = vec![line("DEMO-1", 5, Face::Late(passed)), line("DEMO-2", 6, Face::Ended(passed))];
    scene.tell(Msg::Runs(Ok(Runs { day: "2026-11-22".into(), lines, cut: false })));
}

/// Three modules of a shift: passed at once, passed at the second try, errored.
pub(super) fn shift(scene: &mut Scene) {
    let module = |serial_number: &str, minute: u32, outcome, first_pass| ModuleOfShift {
        serial_number: serial_number.into(),
        at: chrono::DateTime::parse_from_rfc3339(&format!("2026-11-22T14:{minute:02}:00+08:00")).expect("a time"),
        outcome,
        first_pass,
    };
    let since = chrono::DateTime::parse_from_rfc3339("2026-11-22T14:00:00+08:00").expect("a time");
    let modules = vec![
        module("DEMO-1", 5, Outcome::Passed, Some(true)),
        module("DEMO-2", 9, Outcome::Passed, Some(false)),
        module("模块-3", 11, Outcome::Errored, None),
    ];
    scene.tell(Msg::Shift(Box::new(Shift { since, modules })));
}
