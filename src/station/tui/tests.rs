//! Every screen in every language at its two sizes, and what keys do. Time stands still in all of them.

mod captures;
mod questions;
#[cfg(feature = "sim")]
mod same;
mod scans;
mod standing;
mod start;
mod truth;

use std::time::Duration;

use chrono::{DateTime, FixedOffset};
use gnc_bench::fixture::{Ask, SwitchReading, TakenOver};
use gnc_executive::catalogue::ItemId;
use gnc_executive::event::{AttemptError, BoardBreach, ErrorRecord, EventKind, NoteLevel};
use gnc_executive::outcome::{Cause, Outcome};
use gnc_executive::standing::{PastRun, Standing};
use gnc_executive::verdict::Verdict;
use gnc_records::shift::{ModuleOfShift, Shift};
use gnc_rig::{Along, Orientation};

use super::decode::Key;
use super::lang::Lang;
use super::model::{Glyphs, Loaded, RoundsSetting};
use super::pending::Prepared;
use super::records::{Day, RunLine, RunMark, Runs};
use super::scene::{ITEMS, Scene, measured};
use super::update::{Effect, Msg};
use super::view::text_width;

const SIZES: [(u16, u16); 2] = [(80, 24), (160, 50)];

fn scene(lang: Lang) -> Scene {
    Scene::new(lang, 80, 24).expect("memory")
}

/// Plays a scene in all languages and sizes, and compares each screen with its reviewed picture.
fn check(name: &str, play: impl Fn(&mut Scene)) {
    for lang in Lang::ALL {
        for (width, height) in SIZES {
            let mut scene = Scene::new(lang, width, height).expect("memory");
            play(&mut scene);
            let text = scene.text();
            for line in text.lines() {
                assert!(text_width(line) <= usize::from(width), "{name} {lang:?}: {line}");
            }
            insta::assert_snapshot!(format!("{name}-{lang:?}-{width}"), text);
        }
    }
}

fn fail(scene: &mut Scene) {
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

fn error(scene: &mut Scene) {
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
        text: "no answer to SciEcho after 5 tries over 2.5 s".into(),
        hint: "is the cable plugged in at both ends?".into(),
        again: false,
    };
    let outcome = Outcome::Errored;
    scene.event(EventKind::AttemptEnded { item: item(), attempt: 1, outcome, error: Some(error) });
    scene.event(EventKind::ItemEnded { item: item(), outcome, cause: None });
    let text = "the link is lost, so the rest of the plan is not run".to_owned();
    scene.event(EventKind::Note { level: NoteLevel::Error, text, item: None });
    scene.run_ends(Outcome::Errored);
}

fn line(serial_number: &str, minute: u32, mark: RunMark) -> RunLine {
    let at = chrono::DateTime::parse_from_rfc3339(&format!("2026-11-22T14:{minute:02}:00+08:00")).expect("a time");
    RunLine {
        path: format!("records/2026-11-22/{serial_number}/14{minute:02}00-functional").into(),
        at: Some(at),
        serial_number: serial_number.into(),
        plan: "functional".into(),
        mark,
        simulated: true,
        selection: minute == 7,
        rejudged: minute == 9,
        elapsed_s: 4.86,
    }
}

/// A module that failed the functional plan on the bench of the scene, which is simulated.
fn has_failed(at: DateTime<FixedOffset>) -> Standing {
    let counts = PastRun {
        at: Some(at),
        plan: "functional".into(),
        verdict: Some(Verdict::Module(Outcome::Failed)),
        items: None,
        simulated: true,
        flaws: Vec::new(),
    };
    Standing { plan: "functional".into(), counts: Some(counts), beside: None }
}

/// A module without any run.
fn never() -> Standing {
    Standing { plan: "functional".into(), counts: None, beside: None }
}

fn records(scene: &mut Scene) {
    scene.key(Key::F(9));
    scene.key(Key::F(9));
    let days = vec![
        Day { name: "2026-11-22".into(), serial_numbers: 3 },
        Day { name: "2026-11-21".into(), serial_numbers: 41 },
    ];
    scene.tell(Msg::Days(Ok(days)));
}

fn runs(scene: &mut Scene) {
    records(scene);
    let lines = vec![
        line("DEMO-1", 5, RunMark::Ended(Verdict::Module(Outcome::Failed))),
        line("DEMO-1", 7, RunMark::Ended(Verdict::Selection(Outcome::Passed))),
        line("DEMO-2", 9, RunMark::Ended(Verdict::Module(Outcome::Errored))),
        line("模块-3", 11, RunMark::Interrupted),
    ];
    scene.tell(Msg::Runs(Ok(Runs { day: "2026-11-22".into(), lines, cut: false })));
}

fn record(scene: &mut Scene) {
    runs(scene);
    let mut played = Scene::new(scene.model.lang, 80, 24).expect("memory");
    fail(&mut played);
    let state = played.model.run.take().expect("a run").state;
    let path = "records/2026-11-22/DEMO-1/140500-functional".into();
    scene.tell(Msg::Opened(Ok(Box::new((path, state, RunMark::Ended(Verdict::Module(Outcome::Failed)))))));
}

/// Three modules of a shift: passed at once, passed at the second try, errored.
fn shift(scene: &mut Scene) {
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

#[test]
fn the_shift_is_counted() {
    check("shift", |scene| {
        records(scene);
        shift(scene);
    });
    check("shift_idle", shift);
}

#[test]
fn idle() {
    check("idle", |_| {});
    check("scanned", |scene| {
        scene.types("DEMO-1");
        scene.key(Key::Enter);
        let at = chrono::DateTime::parse_from_rfc3339("2026-11-22T09:12:00+08:00").expect("a time");
        scene.tell(Msg::Standing { serial_number: "DEMO-1".into(), standing: Ok(has_failed(at)) });
    });
}

#[test]
fn running() {
    for lang in Lang::ALL {
        for (width, height) in SIZES {
            let mut scene = Scene::at_work(lang, width, height).expect("memory");
            insta::assert_snapshot!(format!("running-{lang:?}-{width}"), scene.text());
            scene.key(Key::F(6));
            insta::assert_snapshot!(format!("pausing-{lang:?}-{width}"), scene.text());
        }
    }
    check("paused", |scene| {
        scene.start("DEMO-1");
        scene.passes(&["identity", "cpu"]);
        scene.key(Key::F(6));
    });
}

#[test]
fn passed() {
    check("passed", |scene| {
        scene.start("DEMO-1");
        scene.passes(&ITEMS.map(ItemId::as_str));
        scene.run_ends(Outcome::Passed);
    });
}

#[test]
fn failed() {
    check("failed", fail);
    check("item", |scene| {
        fail(scene);
        scene.key(Key::Enter);
    });
}

#[test]
fn errored() {
    check("errored", error);
}

#[test]
fn prompt() {
    let ask = |scene: &mut Scene, ask: Ask| {
        scene.start("DEMO-1");
        scene.event(EventKind::ItemStarted { item: "ad".into(), attempt: 1 });
        scene.tell(Msg::Asked { item: "ad".into(), ask });
        scene.pass_time(Duration::from_secs(12));
    };
    check("prompt-switch", |scene| ask(scene, Ask::Switches(Some(3))));
    let still =
        vec![SwitchReading { switch: 2, on: true, volt: 3.306 }, SwitchReading { switch: 3, on: false, volt: 2.008 }];
    check("prompt-switch-again", |scene| ask(scene, Ask::SwitchesAgain { on: Some(3), still: still.clone() }));
    check("prompt-turn", |scene| ask(scene, Ask::Heading { deg: 120.0 }));
    let orientation = Orientation::Axis { axis: 2, positive: false, along: Along::Up, heading_deg: 90.0 };
    check("prompt-lay", |scene| ask(scene, Ask::Lay(orientation)));
    let over = TakenOver { taken: vec!["x+".into(), "x-".into()], left: vec!["y+".into(), "y-".into()] };
    let resumed = Ask::Resumed { over, next: Box::new(Ask::Lay(orientation)) };
    check("prompt-resumed", |scene| ask(scene, resumed.clone()));
    let turned = Ask::Turn { orientation: Some(orientation), angle_deg: -1080.0, span_s: 5.0, ramp_s: 0.5 };
    check("prompt-table", |scene| ask(scene, turned.clone()));
    let north = Orientation::Axis { axis: 2, positive: true, along: Along::North, heading_deg: 0.0 };
    check("prompt-spin", |scene| ask(scene, Ask::Spin { orientation: Some(north), rate_dps: 5400.0 }));
    check("prompt-stop", |scene| ask(scene, Ask::StopTable));
    check("prompt-words", |scene| ask(scene, Ask::Words("Close the lid of the shield.".into())));
}

#[test]
fn live() {
    check("live", |scene| {
        scene.start("DEMO-1");
        scene.readings(300);
        scene.key(Key::F(9));
    });
    check("live-roll", |scene| {
        scene.key(Key::F(9));
        scene.readings_of_a_calibrated_module();
    });
    check("live-empty", |scene| drop(scene.key(Key::F(9))));
}

#[test]
fn records_page() {
    check("records-days", records);
    check("records-runs", runs);
    check("records-run", record);
}

#[test]
fn help_and_setup() {
    check("help", |scene| drop(scene.key(Key::F(1))));
    check("setup", |scene| drop(scene.key(Key::F(2))));
    check("setup-mistakes", |scene| {
        let why = "test-plans/mine.toml:4:6: no item has the id \"imo\"\n    id = \"imo\"\n         ^^^^^\ndid you mean \"io\"?";
        let plan = Loaded::Refused(why.into());
        scene.tell(Msg::Plan { path: "test-plans/mine.toml".into(), plan });
        scene.key(Key::F(2));
    });
    check("leave", |scene| {
        scene.start("DEMO-1");
        scene.key(Key::F(10));
    });
}

#[test]
fn too_small() {
    for lang in Lang::ALL {
        for (width, height) in [(79, 24), (80, 23), (20, 6)] {
            let mut scene = scene(lang);
            fail(&mut scene);
            scene.resize(width, height);
            insta::assert_snapshot!(format!("too-small-{lang:?}-{width}x{height}"), scene.text());
        }
    }
}

/// At every size the drawing fits, and nothing panics.
#[test]
fn any_size_can_be_drawn() {
    let mut scenes: Vec<Scene> = Vec::new();
    for play in [fail, error, record, |scene: &mut Scene| scene.readings(20)] {
        let mut scene = scene(Lang::Zh);
        play(&mut scene);
        scenes.push(scene);
    }
    let captures = [
        Scene::capturing(Lang::Zh, (80, 24), "rotation", 2),
        Scene::spinning(Lang::Zh, (80, 24), 500),
        Scene::resting(Lang::Zh, (80, 24), 500),
    ];
    for scene in captures {
        let mut scene = scene.expect("memory");
        scene.key(Key::F(9));
        scenes.push(scene);
    }
    for mut scene in scenes {
        for (width, height) in
            (0..220).step_by(13).flat_map(|width| (0..70).step_by(7).map(move |height| (width, height)))
        {
            scene.resize(width, height);
            scene.draw().expect("memory");
        }
    }
}

/// A terminal without the glyphs shows only ASCII, or only Latin letters, lines and blocks, whatever the texts are.
#[test]
fn poor_terminals_get_what_they_can_show() {
    let played = |play: fn(&mut Scene)| {
        let mut scene = Scene::new(Lang::En, 160, 50).expect("memory");
        play(&mut scene);
        scene
    };
    let size = (160, 50);
    let plays: [&dyn Fn() -> Scene; 6] = [
        &|| played(fail),
        &|| played(record),
        &|| played(|scene| scene.readings(20)),
        &|| Scene::capturing(Lang::En, size, "rotation", 2).expect("memory"),
        &|| Scene::spinning(Lang::En, size, 500).expect("memory"),
        &|| Scene::resting(Lang::En, size, 500).expect("memory"),
    ];
    for play in plays {
        for glyphs in [Glyphs::Ascii, Glyphs::Console] {
            let mut scene = play();
            scene.model.look.glyphs = glyphs;
            if scene.model.captures() {
                scene.key(Key::F(9));
            }
            let text = scene.text();
            let odd: String = text.chars().filter(|c| !c.is_ascii() && !"─│┌┐└┘├┤┬┴┼█▀▄░▒▓°".contains(*c)).collect();
            assert_eq!(odd, "", "{glyphs:?}: {text}");
            assert!(glyphs == Glyphs::Console || text.is_ascii(), "{text}");
        }
    }
}

/// Without colours no cell has a colour.
#[test]
fn no_colour_means_none() {
    let mut scene = scene(Lang::En);
    scene.model.look.colour = false;
    fail(&mut scene);
    let colours = scene.colours();
    assert_eq!(colours, 0);
    for play in [Scene::spinning, Scene::resting] {
        let mut scene = play(Lang::En, (80, 24), 500).expect("memory");
        scene.key(Key::F(9));
        assert!(scene.colours() > 100, "the screen has colours otherwise");
        scene.model.look.colour = false;
        assert_eq!(scene.colours(), 0);
    }
    scene.model.look.colour = true;
    assert!(scene.colours() > 100, "the screen has colours otherwise");
}

/// A scan of letters, digits and spaces is never a command in any place, and is not lost.
#[test]
fn a_scanner_types_and_nothing_happens() {
    let plays: [fn(&mut Scene); 4] = [
        |_| {},
        fail,
        |scene| drop(scene.key(Key::F(9))),
        |scene| {
            scene.start("DEMO-1");
            scene.tell(Msg::Asked { item: "ad".into(), ask: Ask::Switches(None) });
        },
    ];
    for play in plays {
        let mut scene = scene(Lang::En);
        play(&mut scene);
        for character in "SN 12qynYN/é模".chars() {
            let key = if character == ' ' { Key::Pasted(' ') } else { Key::Char(character) };
            assert_eq!(scene.key(key), None);
        }
        let running = scene.model.is_running();
        let command = scene.key(Key::Enter);
        let scanned = if running { &scene.model.scan.next } else { &scene.model.scan.current };
        assert_eq!(scanned.as_deref(), Some("SN 12qynYN/é模"));
        let prompt = scene.model.run.as_ref().is_some_and(|run| run.prompt.is_some());
        assert_eq!(prompt, running, "the line end of a scanner answered a question");
        assert_eq!(command.is_none(), running, "{command:?}");
    }
}

#[test]
fn hostile_scans_are_refused_in_words() {
    let check = |keys: &[Key], word: &str| {
        let mut scene = scene(Lang::En);
        keys.iter().for_each(|key| drop(scene.key(*key)));
        assert_eq!(scene.key(Key::Enter), None);
        assert_eq!(scene.model.scan.current, None);
        assert!(scene.text().contains(word), "{}", scene.text());
    };
    check(&vec![Key::Char('x'); 10_000], "10000 characters");
    check(&[Key::Char('a'), Key::Control, Key::Char('b')], "control characters");
    check(&[Key::Pasted(' '), Key::Pasted(' ')], "empty");
}

/// The request to check files and records before a run of DEMO-1.
fn look() -> Effect {
    Effect::Prepare { serial_number: "DEMO-1".into(), selection: None, resume: None }
}

/// The result of this check if no file was changed and no run broke off.
fn found(standing: Option<Standing>) -> Msg {
    let (changed, resume) = (Vec::new(), None);
    let standing = standing.or_else(|| Some(never()));
    Msg::Prepared(Box::new(Prepared { serial_number: "DEMO-1".into(), changed, standing, resume }))
}

#[test]
fn what_failed_is_repeated() {
    let mut scene = scene(Lang::En);
    fail(&mut scene);
    assert!(matches!(scene.key(Key::F(4)), Some(Effect::Prepare { selection: Some(_), .. })));
    let command = scene.tell(found(None));
    let Some(Effect::Start(start)) = command else { panic!("{command:?}") };
    let selection = start.selection.expect("a selection");
    // The failed item, the item that was skipped because of it, and the items that were never reached.
    assert!(selection.contains(&"imu".into()) && selection.contains(&"ad".into()), "{selection:?}");
    assert!(!selection.contains(&"cpu".into()), "{selection:?}");
}

#[test]
fn stop_pause_abort_and_leave() {
    let mut scene = Scene::at_work(Lang::En, 80, 24).expect("memory");
    assert_eq!(scene.key(Key::F(6)), Some(Effect::Pause(true)));
    assert_eq!(scene.key(Key::F(6)), Some(Effect::Pause(false)));
    assert_eq!(scene.key(Key::F(7)), None, "identity does not run");
    let at = scene.model.order().iter().position(|position| *position == 7).expect("imu");
    (0..at).for_each(|_| drop(scene.key(Key::Down)));
    assert_eq!(scene.key(Key::F(7)), Some(Effect::AbortItem("imu".into())));
    assert_eq!(scene.key(Key::F(8)), Some(Effect::Stop));
    assert!(scene.text().contains("Stop now"), "{}", scene.text());
    assert_eq!(scene.key(Key::F(10)), None, "a run is on");
    assert_eq!(scene.key(Key::Enter), None, "a scanner sends that");
    assert_eq!(scene.key(Key::F(2)), Some(Effect::Stop));
    scene.event(EventKind::RunEnded(Verdict::Module(Outcome::Aborted)));
    assert_eq!(scene.tell(Msg::RunOver { verdict: None, store_error: None, refusal: None }), Some(Effect::Leave));
}

#[test]
fn ticks_make_a_selection() {
    let mut scene = scene(Lang::En);
    scene.key(Key::Ctrl('a'));
    scene.types("DEMO-1");
    assert_eq!(scene.key(Key::F(5)), None);
    assert!(scene.text().contains("No item is ticked"), "{}", scene.text());
    scene.key(Key::Down);
    scene.key(Key::Char(' '));
    assert!(matches!(scene.key(Key::F(5)), Some(Effect::Prepare { selection: Some(_), .. })));
    let command = scene.tell(found(None));
    assert!(matches!(command, Some(Effect::Start(start)) if start.selection == Some(vec!["cpu".into()])));
}

#[test]
fn the_form_sets_rounds_and_language() {
    let mut scene = scene(Lang::En);
    assert_eq!(scene.key(Key::F(2)), Some(Effect::ListChoices));
    (0..3).for_each(|_| drop(scene.key(Key::Down)));
    scene.key(Key::Right);
    scene.key(Key::Backspace);
    scene.types("x2");
    scene.key(Key::Down);
    scene.key(Key::Down);
    scene.key(Key::Right);
    assert_eq!(scene.key(Key::Enter), None, "neither plan nor bench changed");
    assert_eq!(scene.model.rounds, RoundsSetting::Count(12));
    assert_eq!(scene.model.lang, Lang::Zh);
}

/// The form reports an impossible number at once and does not take it.
#[test]
fn the_form_refuses_no_rounds() {
    let mut scene = scene(Lang::En);
    scene.key(Key::F(2));
    (0..3).for_each(|_| drop(scene.key(Key::Down)));
    scene.key(Key::Right);
    (0..9).for_each(|_| drop(scene.key(Key::Backspace)));
    assert!(scene.text().contains("a number from 1"), "{}", scene.text());
    scene.key(Key::Enter);
    assert_eq!(scene.model.rounds, RoundsSetting::Once);
}

/// A screen that missed events asks for the record, and shows the state of the record.
#[test]
fn missed_events_are_read_from_the_record() {
    let mut scene = scene(Lang::En);
    scene.start("DEMO-1");
    scene.miss_an_event();
    scene.passes(&["identity"]);
    let command = scene.tell(Msg::RunOver { verdict: None, store_error: None, refusal: None });
    let Some(Effect::Refold(folder)) = command else { panic!("{command:?}") };
    let mut played = Scene::new(Lang::En, 80, 24).expect("memory");
    fail(&mut played);
    let state = played.model.run.take().expect("a run").state;
    let of_another = Msg::Refolded { folder: "records/another".into(), state: Ok(Box::new(state.clone())) };
    scene.tell(of_another);
    assert_ne!(
        scene.model.run.as_ref().and_then(super::model::RunView::verdict),
        Some(Verdict::Module(Outcome::Failed))
    );
    scene.tell(Msg::Refolded { folder, state: Ok(Box::new(state)) });
    assert_eq!(
        scene.model.run.as_ref().and_then(super::model::RunView::verdict),
        Some(Verdict::Module(Outcome::Failed))
    );
}

/// Good items of a selection show their own word at every size and in every language, and no pass anywhere.
#[test]
fn a_selection_is_no_pass_at_any_size() {
    for lang in Lang::ALL {
        let (passed, partial) = ((lang.texts().outcome_word)(Outcome::Passed), lang.texts().partial);
        for (width, height) in [(160, 50), (80, 24), (80, 23), (20, 6)] {
            let mut scene = Scene::new(lang, width, height).expect("memory");
            scene.start_selection("DEMO-1", &["cpu"]);
            scene.event(EventKind::ItemStarted { item: "cpu".into(), attempt: 1 });
            scene.ends("cpu", Outcome::Passed);
            scene.run_ends(Outcome::Passed);
            let text = scene.text();
            let told = text.to_lowercase();
            assert!(told.contains(&partial.to_lowercase()), "{lang:?} {width}: {text}");
            // The item itself passed, and its row says so; the verdict does not.
            let verdict = told.lines().filter(|line| !line.contains("cpu"));
            let verdict: String = verdict.map(|line| format!("{line}\n")).collect();
            assert!(!verdict.contains(passed), "{lang:?} {width}: {verdict}");
            assert_eq!(
                scene.model.run.as_ref().and_then(super::model::RunView::verdict).map(Verdict::passes_module),
                Some(false)
            );
            if lang == Lang::En && height > 23 {
                insta::assert_snapshot!(format!("partial-{lang:?}-{width}"), text);
            }
        }
    }
}

/// A run that was judged again says so in the list and on its page.
#[test]
fn a_second_judgement_is_marked() {
    for lang in Lang::ALL {
        let texts = lang.texts();
        let mut scene = Scene::new(lang, 160, 50).expect("memory");
        runs(&mut scene);
        let row = |scene: &mut Scene| {
            let text = scene.text();
            text.lines().find(|line| line.contains("DEMO-2")).map(str::to_owned).expect("a row")
        };
        assert!(row(&mut scene).contains(texts.rejudged), "{lang:?}");
        scene.resize(80, 24);
        assert!(row(&mut scene).contains(&format!("{} {}", texts.simulated_short, texts.rejudged_short)), "{lang:?}");
        let mut played = Scene::new(lang, 80, 24).expect("memory");
        played.rejudged = true;
        fail(&mut played);
        let state = played.model.run.take().expect("a run").state;
        let path = "records/2026-11-22/DEMO-2/140900-functional-recomputed".into();
        scene.tell(Msg::Opened(Ok(Box::new((path, state, RunMark::Ended(Verdict::Module(Outcome::Failed)))))));
        let long = texts.rejudged_long.replace("{}", "140500-functional");
        for (width, height) in SIZES {
            scene.resize(width, height);
            assert!(scene.text().contains(&long), "{}", scene.text());
        }
    }
}

/// A run whose record could not be written does not pass, whatever its items say.
#[test]
fn a_lost_record_is_no_pass() {
    let mut scene = scene(Lang::En);
    scene.start("DEMO-1");
    scene.passes(&["identity"]);
    scene.event(EventKind::RunEnded(Verdict::Module(Outcome::Passed)));
    scene.tell(Msg::RunOver { verdict: None, store_error: Some("no space left on device".into()), refusal: None });
    assert_eq!(
        scene.model.run.as_ref().and_then(super::model::RunView::verdict),
        Some(Verdict::Module(Outcome::Errored))
    );
    assert!(scene.text().contains("no space left"), "{}", scene.text());
}

/// Outcome and serial number filter the runs of a day.
#[test]
fn runs_are_found() {
    let mut scene = scene(Lang::En);
    runs(&mut scene);
    scene.key(Key::F(4));
    assert_eq!(scene.model.records.shown().len(), 1, "the failed one");
    (0..5).for_each(|_| drop(scene.key(Key::F(4))));
    let partial: Vec<_> = scene.model.records.shown().iter().map(|run| run.mark).collect();
    assert_eq!(partial, [RunMark::Ended(Verdict::Selection(Outcome::Passed))], "the selection is not among the passed");
    scene.key(Key::F(4));
    scene.types("demo-2");
    let shown = scene.model.records.shown();
    assert_eq!(shown.iter().map(|run| run.serial_number.as_str()).collect::<Vec<_>>(), ["DEMO-2"]);
}

/// What the board does against the interface document stands where the board does, also on the smallest screen. A danger is
/// told in words that fit there.
#[test]
fn a_breach_stands_below_the_board() {
    for lang in Lang::ALL {
        let mut scene = scene(lang);
        scene.start("DEMO-1");
        let mut breach = |section, what: &str, safety| {
            let breach = BoardBreach { section, what: what.to_owned(), count: 2, worst: Some("4.9 V".into()), safety };
            scene.event(EventKind::BoardBreach(breach));
            scene.text()
        };
        let text = breach(7, "the board sends RESULT without ACCEPT", false);
        assert!(text.contains(&format!("{} 1: §7", lang.texts().board_breaks)), "{lang:?}: {text}");
        let text = breach(9, "the module is still under power after MAKE_SAFE", true);
        assert!(text.contains(lang.texts().danger_powered), "{lang:?}: {text}");
    }
}
