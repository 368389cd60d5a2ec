//! The questions between the key and the run.

use std::path::PathBuf;
use std::time::Duration;

use gnc_executive::event::EventKind;
use gnc_executive::outcome::Outcome;
use gnc_records::standing::Face;

use super::scene;
use crate::files::ChangedFile;
use crate::tui::decode::Key;
use crate::tui::lang::Lang;
use crate::tui::model::{BenchView, Loaded, ProgramView, RoundsSetting};
use crate::tui::pending::{Interrupted, Prepared, Resumable};
use crate::tui::records::{Checked, Runs, Unopened};
use crate::tui::scene::{Scene, measured};
use crate::tui::setup_form::FormLook;
use crate::tui::update::{Effect, Msg, StartRequest};

const RUN: &str = "records/2026-11-21/DEMO-1/221500-calibration";

fn at() -> chrono::DateTime<chrono::FixedOffset> {
    chrono::DateTime::parse_from_rfc3339("2026-11-21T22:15:00+08:00").expect("a time")
}

pub(super) fn changed() -> Vec<ChangedFile> {
    let unreadable = Some("No such file or directory (os error 2)".to_owned());
    vec![
        ChangedFile { name: "test-plans/functional.toml".into(), unreadable: None },
        ChangedFile { name: "test-plans/limits.toml".into(), unreadable },
    ]
}

pub(super) fn broke_off() -> Option<Resumable> {
    Some(Resumable::Yes(Interrupted { folder: RUN.into(), at: at() }))
}

pub(super) fn unlike() -> Option<Resumable> {
    let why = "the run to resume had the serial number DEMO-2, this run has DEMO-1";
    Some(Resumable::No { why: why.into() })
}

/// Scans, presses F5, and answers the check of files and records with these results.
pub(super) fn start(scene: &mut Scene, changed: Vec<ChangedFile>, resume: Option<Resumable>) -> Option<Effect> {
    scene.types("DEMO-1");
    scene.key(Key::Enter);
    let asked = scene.key(Key::F(5));
    assert!(matches!(asked, Some(Effect::Prepare { .. })), "{asked:?}");
    scene.tell(Msg::Prepared(Box::new(Prepared {
        serial_number: "DEMO-1".into(),
        changed,
        standing: Some(super::never()),
        resume,
    })))
}

#[track_caller]
fn started(command: Option<Effect>) -> StartRequest {
    match command {
        Some(Effect::Start(start)) => start,
        other => panic!("{other:?}"),
    }
}

/// The module failed before, and is to be tested again.
pub(super) fn again(scene: &mut Scene) {
    scene.types("DEMO-1");
    scene.key(Key::Enter);
    scene.key(Key::F(5));
    let standing = Some(super::has_failed(at()));
    let (serial_number, changed, resume) = ("DEMO-1".into(), Vec::new(), None);
    scene.tell(Msg::Prepared(Box::new(Prepared { serial_number, changed, standing, resume })));
}

/// The records have a run of the module that broke off.
pub(super) fn told(serial_number: &str) -> Msg {
    let run = Some(Interrupted { folder: RUN.into(), at: at() });
    Msg::BrokeOff { serial_number: serial_number.into(), run }
}

/// A run of a later version is in the list, is not called damaged, and says why it is not shown.
pub(super) fn newer(scene: &mut Scene) {
    super::records(scene);
    let lines = vec![super::line("DEMO-1", 5, Face::Newer), super::line("DEMO-2", 9, Face::Unreadable)];
    scene.tell(Msg::Runs(Ok(Runs { day: "2026-11-22".into(), lines, cut: false })));
    scene.tell(Msg::Opened(Err(Unopened::Newer("event `weighed`".into()))));
    let checked = Checked { problems: Vec::new(), open: Vec::new(), newer: Some("event `weighed`".into()) };
    let path = "records/2026-11-22/DEMO-1/140500-functional".into();
    scene.tell(Msg::Verified { path, checked });
    scene.tell(Msg::Opened(Err(Unopened::Newer("event `weighed`".into()))));
}

/// So many seconds of the hour at rest are captured.
pub(super) fn in_the_hour(lang: Lang, size: (u16, u16), captured_s: f64) -> Scene {
    let mut scene = Scene::capturing(lang, size, "bias-stability", 0).expect("a terminal in memory");
    let mut guidance = scene.guidance("bias-stability", 0, 0.0);
    guidance.captured_s = captured_s;
    scene.guided("bias-stability", guidance);
    scene
}

/// Where many runs are filed, the look at them takes seconds: before the questions, and again before the first round.
#[test]
fn a_look_at_many_earlier_runs_is_told_while_it_lasts() {
    let mut scene = scene(Lang::En);
    let told = |scene: &Scene| scene.model.message.as_ref().is_some_and(|(_, text)| text.contains("earlier runs"));
    scene.types("DEMO-1");
    scene.key(Key::Enter);
    scene.key(Key::F(5));
    assert!(told(&scene));
    let (serial_number, changed, standing) = ("DEMO-1".into(), changed(), Some(super::never()));
    scene.tell(Msg::Prepared(Box::new(Prepared { serial_number, changed, standing, resume: None })));
    assert!(!told(&scene), "the question waits, and not the records");
    started(scene.key(Key::F(6)));
    assert!(told(&scene));
    scene.tell(Msg::RoundBegins { folder: RUN.into() });
    assert!(!told(&scene));
}

/// The plan on the screen is the plan that runs, and reading the files again starts nothing.
#[test]
fn changed_files_are_asked_about() {
    let mut scene = scene(Lang::En);
    assert_eq!(start(&mut scene, changed(), None), None);
    // A second press of the key answers nothing, and there is still one question.
    assert_eq!(scene.key(Key::F(5)), None);
    let (serial_number, standing, resume) = ("DEMO-1".into(), Some(super::never()), None);
    let again = Prepared { serial_number, changed: changed(), standing, resume };
    assert_eq!(scene.tell(Msg::Prepared(Box::new(again))), None);
    assert_eq!(scene.model.over.len(), 1);
    let start_checked = started(scene.key(Key::F(6)));
    let shown = scene.model.plan.ready().map(|plan| plan.sha256.clone());
    assert_eq!(Some(start_checked.plan_sha256), shown);

    let mut scene = super::scene(Lang::En);
    start(&mut scene, changed(), None);
    let (plan, bench) = ("test-plans/functional.toml".into(), "sim:good".into());
    assert_eq!(scene.key(Key::F(2)), Some(Effect::Choose { plan, bench }));
    assert_eq!(scene.model.plan, Loaded::Loading);
    assert_eq!(scene.model.pending, None, "it is looked at before it runs");
    assert!(scene.text().contains("then press F5"), "{}", scene.text());
    let path = "test-plans/functional.toml".into();
    scene.tell(Msg::Plan { path, plan: Loaded::Refused("unknown item \"cpo\"".into()) });
    assert!(!scene.text().contains("then press F5"), "{}", scene.text());

    let mut scene = super::scene(Lang::En);
    start(&mut scene, changed(), None);
    assert_eq!((scene.key(Key::Esc), &scene.model.pending), (None, &None));
    assert!(scene.model.over.is_empty());
}

/// One question after the other, each with its own answer.
#[test]
fn a_run_that_broke_off_is_taken_up_once() {
    let mut scene = scene(Lang::En);
    scene.model.rounds = RoundsSetting::Count(5);
    assert_eq!(start(&mut scene, changed(), broke_off()), None);
    assert_eq!(scene.key(Key::F(6)), None, "the second question");
    assert_eq!(scene.key(Key::Enter), None, "a scanner sends that");
    let taken_up = started(scene.key(Key::F(2)));
    assert_eq!((taken_up.resume, taken_up.rounds), (Some(PathBuf::from(RUN)), RoundsSetting::Once));

    let mut scene = super::scene(Lang::En);
    scene.model.rounds = RoundsSetting::Count(5);
    start(&mut scene, Vec::new(), broke_off());
    let from_start = started(scene.key(Key::F(6)));
    assert_eq!((from_start.resume, from_start.rounds), (None, RoundsSetting::Count(5)));
}

/// Each start checks the run of the command line, until the operator has decided about it.
#[test]
fn the_run_of_the_command_line_is_not_forgotten() {
    let mut scene = scene(Lang::En);
    scene.model.resume = Some(RUN.into());
    scene.types("DEMO-1");
    scene.key(Key::Enter);
    let asked = Effect::Prepare { serial_number: "DEMO-1".into(), selection: None, resume: Some(RUN.into()) };
    assert_eq!(scene.key(Key::F(5)), Some(asked.clone()));
    let refused = || {
        let (serial_number, resume) = ("DEMO-1".into(), unlike());
        Msg::Prepared(Box::new(Prepared { serial_number, changed: Vec::new(), standing: Some(super::never()), resume }))
    };
    assert_eq!(scene.tell(refused()), None);
    assert!(scene.text().contains("had the serial number DEMO-2"), "{}", scene.text());
    assert_eq!(scene.key(Key::Esc), None);
    assert_eq!(scene.key(Key::F(5)), Some(asked), "the operator has not decided");
    scene.tell(refused());
    assert_eq!(started(scene.key(Key::F(2))).resume, None);
    assert_eq!(scene.model.resume, None);
}

/// A scan is not an answer: it removes the question, together with the start that waits for it.
#[test]
fn a_scan_answers_no_question() {
    for (changed, resume) in [(changed(), None), (Vec::new(), broke_off()), (Vec::new(), unlike())] {
        let mut scene = scene(Lang::En);
        start(&mut scene, changed, resume);
        assert_eq!(scene.scans("DEMO-9\r"), Some(Effect::LookUp("DEMO-9".into())));
        assert_eq!((scene.model.pending.as_ref(), scene.model.over.len()), (None, 0));
    }
}

/// An answer that comes after another plan was chosen starts nothing.
#[test]
fn another_plan_ends_what_waits() {
    let mut scene = scene(Lang::En);
    scene.types("DEMO-1");
    scene.key(Key::Enter);
    scene.key(Key::F(5));
    scene.key(Key::F(2));
    scene.types("x");
    assert!(matches!(scene.key(Key::Enter), Some(Effect::Choose { .. })));
    let standing = Some(super::has_failed(at()));
    let (serial_number, changed, resume) = ("DEMO-1".into(), Vec::new(), broke_off());
    let prepared = Prepared { serial_number, changed, standing, resume };
    assert_eq!(scene.tell(Msg::Prepared(Box::new(prepared))), None);
    assert!(scene.model.over.is_empty() && scene.model.run.is_none());
}

/// After a new reading the old verdict is not shown, and F5 reads a file that was corrected.
#[test]
fn a_verdict_goes_with_its_plan() {
    let choose = || Effect::Choose { plan: "test-plans/functional.toml".into(), bench: "sim:good".into() };
    let mut scene = super::scene(Lang::En);
    scene.start("DEMO-1");
    scene.passes(&["identity"]);
    scene.run_ends(Outcome::Passed);
    assert!(scene.model.run.is_some());
    let prepared =
        Prepared { serial_number: "DEMO-1".into(), changed: changed(), standing: Some(super::never()), resume: None };
    scene.key(Key::F(5));
    scene.tell(Msg::Prepared(Box::new(prepared)));
    assert_eq!(scene.key(Key::F(2)), Some(choose()));
    assert!(scene.model.run.is_none(), "the verdict was by another plan");
    let path = "test-plans/functional.toml".into();
    scene.tell(Msg::Plan { path, plan: Loaded::Refused("unknown item \"cpo\"".into()) });
    assert!(scene.text().contains("unknown item"), "{}", scene.text());
    assert_eq!(scene.key(Key::F(5)), Some(choose()), "it may have been mended");
}

/// The reason is read in full: where the panel has no room, Enter opens a page that scrolls. F5 reads the files again, from the form
/// too, and Enter in the form does as well.
#[test]
fn a_refused_bench_says_all_and_is_looked_at_again() {
    let why = "other users may use the key /srv/stations/line-2/secrets/station.key (mode 640)\n\
               run `chmod 600` on the key; if other users may have read it, make a new key";
    for lang in Lang::ALL {
        for size in [(80, 24), (80, 16), (40, 10)] {
            let mut scene = super::super::scene::Scene::new(lang, size.0, size.1).expect("memory");
            scene.tell(Msg::Bench { path: "bench.toml".into(), bench: Loaded::Refused(why.into()) });
            scene.key(Key::Enter);
            let mut seen = String::new();
            for _ in 0..8 {
                seen.push_str(&scene.text());
                scene.key(Key::Down);
            }
            let joined = |text: &str| text.chars().filter(|c| !c.is_whitespace() && *c != '│').collect::<String>();
            let seen = joined(&seen);
            for line in why.lines() {
                let told = joined(&scene.model.said(line));
                // A page that scrolls shows each line of the sentence, and they follow each other.
                let ends: String = told.chars().rev().take(12).collect::<Vec<_>>().into_iter().rev().collect();
                assert!(seen.contains(&ends), "{lang:?} {size:?}: {told} in {seen}");
            }
            assert_eq!(scene.key(Key::Esc), None);
            assert!(matches!(scene.key(Key::F(5)), Some(Effect::Choose { .. })), "{lang:?}");
        }
    }
    let mut scene = super::scene(Lang::En);
    scene.tell(Msg::Bench { path: "bench.toml".into(), bench: Loaded::Refused(why.into()) });
    scene.key(Key::F(2));
    let again = scene.key(Key::F(5));
    assert!(matches!(&again, Some(Effect::Look { bench, .. }) if bench == "bench.toml"), "{again:?}");
    assert_eq!(scene.key(Key::F(5)), None, "it is being read");
    let (plan_path, bench_path) = ("test-plans/functional.toml".to_owned(), "bench.toml".to_owned());
    let (bench, plan) = (Loaded::Refused(why.into()), Loaded::Refused("unknown item \"cpo\"".into()));
    scene.tell(Msg::LookedAt(Box::new(FormLook { plan_path, bench_path, bench, plan })));
    assert!(scene.text().contains("station.key"), "the form shows what was found: {}", scene.text());
    assert!(matches!(scene.key(Key::Enter), Some(Effect::Choose { .. })), "and the form is taken");
    // The bench alone was refused: the plan is as it was.
    let mut scene = super::scene(Lang::En);
    scene.tell(Msg::Bench { path: "bench.toml".into(), bench: Loaded::Refused(why.into()) });
    scene.key(Key::F(2));
    assert!(matches!(scene.key(Key::Enter), Some(Effect::Choose { .. })));
    // A verdict on the screen stays if the form names no other files.
    let mut scene = super::scene(Lang::En);
    scene.start("DEMO-1");
    scene.run_ends(Outcome::Passed);
    scene.key(Key::F(2));
    assert_eq!(scene.key(Key::F(5)), None);
    assert!(scene.model.run.is_some());
}

/// Ctrl-C stops what is on, as F8 does; says no to a question of a start; and, pressed twice, ends the program where nothing is on.
#[test]
fn ctrl_c_means_what_an_interrupt_means() {
    let c = Key::Ctrl('c');
    for before in [vec![], vec![Key::F(1)], vec![Key::F(2)], vec![Key::F(9)]] {
        let mut scene = super::scene(Lang::En);
        for key in &before {
            scene.key(*key);
        }
        assert_eq!(scene.key(c), None, "{before:?}");
        assert!(scene.text().contains(scene.model.texts.interrupt_again), "{}", scene.text());
        assert_eq!(scene.key(c), Some(Effect::Leave), "{before:?}");
    }
    let mut scene = super::scene(Lang::En);
    start(&mut scene, changed(), None);
    scene.pass_time(Duration::from_secs(1));
    assert_eq!((scene.key(c), &scene.model.pending), (None, &None), "no run of changed files");
    assert_eq!([scene.key(c), scene.key(c)], [None, Some(Effect::Leave)]);
    // A run: in order, then at once, also over the question whether to leave.
    let mut scene = super::scene(Lang::En);
    scene.start("DEMO-1");
    scene.pass_time(Duration::from_secs(1));
    scene.key(Key::F(10));
    for stops in [1, 2] {
        assert_eq!(scene.key(c), Some(Effect::Stop));
        assert_eq!(scene.model.run.as_ref().map(|run| run.stops), Some(stops));
    }
    // The run waits for a disk or a lock: a third and a fourth one are signals, of which the second ends the program in any state.
    assert_eq!([scene.key(c), scene.key(c)], [Some(Effect::Raise), Some(Effect::Raise)]);
    scene.run_ends(Outcome::Aborted);
    scene.pass_time(Duration::from_secs(5));
    assert_eq!([scene.key(c), scene.key(c)], [None, Some(Effect::Leave)]);
}

/// A scan, or the start of the program, tells of a run that can be resumed. A later scan of another module does not.
#[test]
fn a_run_that_broke_off_is_told() {
    let mut scene = scene(Lang::En);
    scene.types("DEMO-2");
    scene.key(Key::Enter);
    scene.tell(told("DEMO-1"));
    assert!(!scene.text().contains("broke off"), "{}", scene.text());
}

/// F8 asks if it would lose more than ten minutes of captures. A scanner's Enter does not answer; F8 and F8 again stop.
#[test]
fn a_stop_that_loses_captures_is_asked_about() {
    let in_the_hour = |captured_s: f64| self::in_the_hour(Lang::En, (80, 24), captured_s);
    let mut scene = in_the_hour(601.0);
    assert_eq!(scene.key(Key::F(8)), None);
    for key in [Key::Enter, Key::F(5), Key::F(6)] {
        assert_eq!((scene.key(key), scene.model.over.len()), (None, 1), "{key:?}");
    }
    assert_eq!((scene.key(Key::Esc), scene.model.over.len()), (None, 0), "it goes on");
    scene.key(Key::F(8));
    assert_eq!((scene.key(Key::F(8)), scene.model.over.len()), (Some(Effect::Stop), 0));
    assert_eq!(scene.key(Key::F(8)), Some(Effect::Stop), "at once, without a question");
    let mut scene = in_the_hour(600.0);
    assert_eq!(scene.key(Key::F(8)), Some(Effect::Stop), "ten minutes are not asked about");
    // A finished capture that the module compensated is made anew by a resumed run, so it counts, too.
    let mut scene = in_the_hour(100.0);
    assert!(scene.model.lost_s() < 101.0);
    let anew: Vec<_> =
        scene.model.plan.ready().expect("a plan").programs.iter().map(|program| program.anew_s).collect();
    let check = scene.model.plan.ready().and_then(|plan| plan.programs.iter().find(|program| program.anew_s > 0.0));
    let check = check.unwrap_or_else(|| panic!("no program is made anew: {anew:?}")).clone();
    scene.passes(&[&check.item]);
    assert_eq!(scene.model.lost_s(), 100.0 + check.anew_s, "{anew:?}");
    // Each of its rounds.
    let plan = crate::tui::scene::captures::plan().expect("a plan");
    let item = plan.items().iter().find(|item| item.name == check.item).expect("the item");
    let mut repeating = item.clone();
    repeating.repeats = 3;
    let rounds = ProgramView::of(&repeating).expect("a program");
    assert_eq!((item.repeats, rounds.anew_s), (1, 3.0 * check.anew_s));
    // The question before leaving tells of the loss.
    let mut scene = in_the_hour(3000.0);
    scene.key(Key::F(10));
    assert!(scene.text().contains("Captures of 50 min"), "{}", scene.text());
    assert_eq!(scene.key(Key::F(2)), Some(Effect::StopAndLeave));
}

/// The end of an item asks as a stop does. The answer is the same key, and never that of another question.
#[test]
fn the_end_of_an_item_that_loses_captures_is_asked_about() {
    let ask = |captured_s: f64| {
        let mut scene = in_the_hour(Lang::En, (80, 24), captured_s);
        to_bias_stability(&mut scene);
        let effect = scene.key(Key::F(7));
        (scene, effect)
    };
    let give_up = Some(Effect::AbortItem("bias-stability".into()));
    assert_eq!(ask(600.0).1, give_up);
    let (mut scene, effect) = ask(601.0);
    assert_eq!(effect, None);
    for key in [Key::Enter, Key::F(2), Key::F(5), Key::F(6)] {
        assert_eq!((scene.key(key), scene.model.over.len()), (None, 1), "{key:?}");
    }
    assert_eq!((scene.key(Key::Esc), scene.model.over.len()), (None, 0), "it goes on");
    scene.key(Key::F(7));
    assert_eq!((scene.key(Key::F(7)), scene.model.over.len()), (give_up, 0));
    // The attempt ended by itself meanwhile, and the question with it. A key that was on its way is for no other attempt.
    let item = || "bias-stability".to_owned();
    let (mut scene, _) = ask(601.0);
    let ended = |attempt| EventKind::AttemptEnded { item: item(), attempt, outcome: Outcome::Failed, error: None };
    scene.event(EventKind::Measured { item: item(), attempt: 1, measurement: measured("other", 1.0, Outcome::Passed) });
    assert_eq!(scene.model.over.len(), 1, "it runs");
    scene.event(ended(1));
    assert_eq!(scene.model.over.len(), 0);
    scene.event(EventKind::ItemStarted { item: item(), attempt: 2 });
    assert_eq!((scene.key(Key::F(7)), scene.model.over.len()), (None, 0), "the key of the question that has gone");
    assert_eq!((scene.key(Key::F(7)), scene.model.over.len()), (None, 1), "that of this attempt");
    scene.event(ended(2));
    scene.event(EventKind::ItemStarted { item: item(), attempt: 3 });
    scene.pass_time(Duration::from_secs(2));
    assert_eq!((scene.key(Key::F(7)), scene.model.over.len()), (None, 1), "the question is read again");
    // So did the item, and its round.
    scene.event(ended(3));
    scene.event(EventKind::ItemEnded { item: item(), outcome: Outcome::Failed, cause: None });
    assert_eq!((scene.key(Key::F(7)), scene.model.over.len()), (None, 0));
    assert_eq!((scene.key(Key::F(7)), scene.model.over.len()), (None, 0), "it does not run");
    // Events were lost, so the attempt that runs is unknown.
    let (mut scene, _) = ask(601.0);
    scene.event(ended(7));
    assert_eq!(scene.model.over.len(), 0, "{}", scene.text());
    // A stop is a stop in this question, too.
    let (mut scene, _) = ask(601.0);
    scene.key(Key::F(8));
    assert_eq!(scene.key(Key::F(8)), Some(Effect::Stop));
}

/// Moves the cursor to the item that captures.
pub(super) fn to_bias_stability(scene: &mut Scene) {
    while scene.model.item_under_cursor() != Some("bias-stability") {
        scene.key(Key::Down);
    }
}

/// The second stop is at once and leaves the module on until the board switches it off. To leave is no second stop.
#[test]
fn to_leave_after_a_stop_is_no_second_stop() {
    let mut scene = in_the_hour(Lang::En, (80, 24), 10.0);
    assert_eq!(scene.key(Key::F(8)), Some(Effect::Stop));
    assert_eq!(scene.key(Key::F(10)), None);
    assert_eq!(scene.key(Key::F(2)), Some(Effect::StopAndLeave), "in order");
    assert_eq!(scene.model.run.as_ref().map(|run| run.stops), Some(1));
    assert!(scene.model.leaving);
    scene.run_ends(Outcome::Aborted);
    assert_eq!(scene.tell(Msg::RunOver { verdict: None, store_error: None, refusal: None }), Some(Effect::Leave));
}

/// A start is being checked when the operator turns to the raw values: either is on, and not both.
#[test]
fn no_run_begins_while_values_are_watched() {
    let mut scene = scene(Lang::En);
    scene.types("DEMO-1");
    assert!(matches!(scene.key(Key::F(5)), Some(Effect::Prepare { .. })));
    scene.key(Key::F(9));
    assert_eq!(scene.key(Key::F(5)), Some(Effect::Watch));
    let (serial_number, standing) = ("DEMO-1".into(), Some(super::never()));
    let prepared = Prepared { serial_number, changed: changed(), standing, resume: None };
    assert_eq!(scene.tell(Msg::Prepared(Box::new(prepared))), None);
    assert!(scene.model.over.is_empty() && scene.model.run.is_none(), "{}", scene.text());
    assert_eq!(scene.key(Key::F(8)), Some(Effect::Stop), "of the watch");
    assert_eq!(scene.tell(Msg::WatchOver { why: None }), None);
    assert!(!scene.model.is_running());
}

/// F5 in the form shows what other files are. Esc leaves plan, bench, ticks and verdict as they were; only Enter takes the new files.
#[test]
fn a_look_from_the_form_keeps_what_is_held() {
    let looked = || {
        let mut scene = super::scene(Lang::En);
        scene.start("DEMO-1");
        scene.run_ends(Outcome::Passed);
        scene.key(Key::F(2));
        scene.types("x");
        let (plan, bench) = ("test-plans/functional.tomlx".to_owned(), "sim:good".to_owned());
        assert_eq!(scene.key(Key::F(5)), Some(Effect::Look { plan: plan.clone(), bench: bench.clone() }));
        assert_eq!(scene.key(Key::F(5)), None, "it is being read");
        assert!(scene.text().contains(scene.model.texts.loading), "{}", scene.text());
        let found = |plan_path: &str, why: &str| {
            let (plan_path, bench_path) = (plan_path.to_owned(), bench.clone());
            let (bench, plan) = (scene_bench(), Loaded::Refused(why.to_owned()));
            Msg::LookedAt(Box::new(FormLook { plan_path, bench_path, bench, plan }))
        };
        assert_eq!(scene.tell(found("other.toml", "a look before")), None);
        assert_eq!(scene.tell(found(&plan, "unknown item cpo")), None);
        assert!(scene.text().contains("unknown item cpo"), "{}", scene.text());
        (scene, found(&plan, "too late"))
    };
    let (mut scene, late) = looked();
    assert_eq!(scene.key(Key::Esc), None);
    for _ in 0..2 {
        assert_eq!((scene.model.plan_path.as_str(), scene.model.is_refused()), ("test-plans/functional.toml", false));
        assert!(scene.model.run.as_ref().is_some_and(|run| run.over), "the verdict stays");
        assert!(scene.model.plan.ready().is_some_and(|plan| plan.name == "functional"));
        scene.key(Key::F(2));
        assert!(!scene.text().contains("unknown item"), "{}", scene.text());
        scene.key(Key::Esc);
    }
    scene.tell(late);
    assert!(matches!(scene.key(Key::F(5)), Some(Effect::Prepare { .. })), "the held plan runs");
    let (mut scene, _) = looked();
    let taken = scene.key(Key::Enter);
    assert!(matches!(&taken, Some(Effect::Choose { plan, .. }) if plan == "test-plans/functional.tomlx"), "{taken:?}");
    // The same files, which may be others now: the form is taken with them.
    let mut scene = super::scene(Lang::En);
    scene.key(Key::F(2));
    assert!(matches!(scene.key(Key::F(5)), Some(Effect::Look { .. })));
    assert!(matches!(scene.key(Key::Enter), Some(Effect::Choose { .. })));
}

/// The bench of the scenes.
fn scene_bench() -> Loaded<BenchView> {
    super::scene(Lang::En).model.bench.clone()
}
