//! The screen tells what is so: the power of the module, the verdict on every page, times, old messages, small screens.

use std::time::Duration;

use gnc_bench::fixture::Ask;
use gnc_bench::guidance::heat::{HeatView, TemperatureSoFar};
use gnc_executive::event::{EventKind, OtherModule, StopHow};
use gnc_executive::outcome::Outcome;
use gnc_executive::verdict::Verdict;

use ratatui::style::Color;

use super::{fail, scene};
use crate::tui::decode::Key;
use crate::tui::lang::Lang;
use crate::tui::model::RunView;
use crate::tui::pending::Prepared;
use crate::tui::scene::Scene;
use crate::tui::update::{Effect, Msg};

fn shows(scene: &mut Scene, words: &str) -> bool {
    scene.text().contains(words)
}

/// Stopped at once, the station has not seen the module go off. The screen says so, and who acts.
#[test]
fn after_a_stop_at_once_the_power_is_unknown() {
    let mut scene = scene(Lang::En);
    scene.start("DEMO-1");
    assert!(shows(&mut scene, "module on"));
    scene.key(Key::F(8));
    scene.key(Key::F(8));
    scene.event(EventKind::StopRequested { how: StopHow::AtOnce, by: "the operator".into() });
    scene.run_ends_at_once(Outcome::Aborted);
    let text = scene.text();
    assert!(text.contains("power unknown") && !text.contains("module on"), "{text}");
    assert!(text.contains("switches the module off by itself within 2 s"), "{text}");
    // The next run knows it again.
    scene.start("DEMO-1");
    scene.run_ends(Outcome::Passed);
    assert!(shows(&mut scene, "module off"));
}

/// Values are watched with the module under power. The panel of the last run must not say that it is off.
#[test]
fn a_watched_module_is_on() {
    let mut scene = scene(Lang::En);
    fail(&mut scene);
    assert!(shows(&mut scene, "module off"));
    scene.key(Key::F(9));
    assert_eq!(scene.key(Key::F(5)), Some(Effect::Watch));
    assert_eq!(scene.key(Key::Esc), Some(Effect::Stop));
    let text = scene.text();
    assert!(text.contains("module on") && !text.contains("module off"), "{text}");
    scene.tell(Msg::WatchOver { why: None });
    assert!(shows(&mut scene, "module off"));
}

/// Wherever the operator is, the head names the module and its verdict.
#[test]
fn the_verdict_is_on_every_page() {
    for lang in Lang::ALL {
        let mut scene = scene(lang);
        fail(&mut scene);
        let word = (lang.texts().verdict)(Verdict::Module(Outcome::Failed));
        let head = |scene: &mut Scene| scene.text().lines().next().unwrap_or_default().to_owned();
        let wanted = format!("{word} DEMO-1");
        assert!(!head(&mut scene).contains(&wanted), "the page shows it large");
        for key in [Key::F(1), Key::Esc, Key::Ctrl('l'), Key::Esc, Key::F(2), Key::Esc, Key::F(9), Key::F(9)] {
            scene.key(key);
            let is_tests_page = key == Key::Esc;
            assert_eq!(head(&mut scene).contains(&wanted), !is_tests_page, "{key:?}: {}", head(&mut scene));
        }
    }
}

#[test]
fn the_chosen_item_is_under_the_cursor_while_it_runs() {
    let mut scene = scene(Lang::En);
    scene.start_selection("DEMO-1", &["spi", "sci"]);
    scene.passes(&["spi"]);
    scene.event(EventKind::ItemStarted { item: "sci".into(), attempt: 1 });
    assert_eq!(scene.model.item_under_cursor(), Some("sci"));
    // A run of the whole plan leaves the cursor to the operator.
    let mut scene = self::scene(Lang::En);
    scene.start("DEMO-1");
    scene.event(EventKind::ItemStarted { item: "cpu".into(), attempt: 1 });
    assert_eq!(scene.model.item_under_cursor(), Some("identity"));
}

/// Of 4.8 s expected, 1.4 s are worked and a minute is paused: 3.4 s remain.
#[test]
fn the_remaining_time_stands_in_a_pause() {
    let mut scene = scene(Lang::En);
    scene.start("DEMO-1");
    scene.passes(&[
        "identity",
        "cpu",
        "timers",
        "internal-ram",
        "sdram",
        "spi-flash",
        "internal-flash",
        "gnss",
        "ad",
        "io",
    ]);
    scene.key(Key::F(6));
    for _ in 0..60 {
        scene.pass_time(Duration::from_secs(1));
    }
    assert!(shows(&mut scene, "3.40 s"), "{}", scene.text());
    scene.key(Key::F(6));
    scene.pass_time(Duration::from_secs(1));
    assert!(shows(&mut scene, "2.40 s"), "{}", scene.text());
}

/// A drift beyond the plan's limit is seen while the captures go on, and stands out.
#[test]
fn a_drift_is_seen_with_its_limit() {
    for lang in Lang::ALL {
        for (width, height) in [(80, 24), (160, 50)] {
            let mut scene = Scene::capturing(lang, (width, height), "six-position", 2).expect("memory");
            scene.key(Key::F(9));
            let drift = lang.texts().drift;
            assert!(!scene.text().contains(drift), "no temperature was measured yet");
            let so_far = |low: f64, high: f64| TemperatureSoFar { now_c: high, range_c: (low, high) };
            scene.warm("six-position", HeatView { gyro: so_far(31.0, 31.4), accel: so_far(30.0, 32.1) });
            let text = scene.text();
            assert!(text.contains("31.4, 32.1 °C"), "{text}");
            assert!(text.contains(&format!("{drift} 0.4, 2.1 K (<= 2 degC)")), "{text}");
            assert!(scene.colour_of(drift).is_some_and(|colour| colour == Color::Red), "{text}");
            scene.warm("six-position", HeatView { gyro: so_far(31.0, 31.4), accel: so_far(30.0, 31.9) });
            scene.draw().expect("memory");
            assert!(scene.colour_of(drift).is_none_or(|colour| colour != Color::Red));
        }
    }
}

#[test]
fn old_news_goes_and_an_error_stays() {
    let mut scene = scene(Lang::En);
    scene.types("DEMO-1");
    scene.key(Key::Enter);
    assert!(shows(&mut scene, "DEMO-1: F5 starts the test."));
    // The panel of the run says it, too, as long as it is so.
    let last = |scene: &mut Scene| scene.text().lines().rev().nth(1).is_some_and(|line| line.contains("F5 starts"));
    scene.pass_time(Duration::from_secs(29));
    assert!(last(&mut scene), "{}", scene.text());
    scene.pass_time(Duration::from_secs(1));
    assert!(!last(&mut scene), "{}", scene.text());
    // The screen wakes for it, not only at the next minute.
    scene.tell(Msg::HookTrouble("no paper".into()));
    assert_eq!(scene.model.message_left(), Some(Duration::from_secs(120)));
    scene.tell(Msg::WatchOver { why: Some("the cable is out".into()) });
    scene.pass_time(Duration::from_secs(3600));
    assert!(shows(&mut scene, "the cable is out"));
}

/// A terminal of 80x24 with a status line has 23 rows, a split one half of that. What matters is there at every size:
/// the verdict, a question with all its words, and its answers.
#[test]
fn a_small_screen_shows_what_matters() {
    for lang in Lang::ALL {
        let texts = lang.texts();
        let mut failed = scene(lang);
        fail(&mut failed);
        let mut asked = scene(lang);
        asked.start("DEMO-1");
        asked.tell(Msg::Asked { item: "ad".into(), ask: Ask::Switches(None) });
        let question = (texts.ask)(&Ask::Switches(None));
        for (width, height) in [(80, 23), (80, 16), (79, 24), (60, 16), (40, 12), (30, 10)] {
            failed.resize(width, height);
            let text = failed.text();
            // Large letters say it on a large screen, and the border of the panel in words.
            let word = (texts.outcome_word)(Outcome::Failed);
            assert!(text.to_lowercase().contains(word), "{lang:?} {width}x{height}: {text}");
            assert!(text.contains("imu"), "{lang:?} {width}x{height}: {text}");
            asked.resize(width, height);
            let text = asked.text();
            let letters = |text: &str| text.chars().filter(|c| c.is_alphanumeric()).collect::<String>();
            // The words of the question stand between double lines.
            let words = text.lines().filter_map(|line| line.split_once('║')?.1.rsplit_once('║'));
            let shown: String = words.map(|(words, _)| letters(words)).collect();
            assert!(shown.contains(&letters(&question)), "{lang:?} {width}x{height}: {text}");
            assert!(text.contains(texts.done), "{lang:?} {width}x{height}: {text}");
        }
        failed.resize(20, 4);
        let text = failed.text();
        assert!(text.to_lowercase().contains((texts.outcome_word)(Outcome::Failed)), "{lang:?}: {text}");
    }
}

/// Two rounds: the first passed, and the second was not begun. The service calls that errored, and so does the screen.
#[test]
fn a_round_that_was_not_begun_is_no_pass() {
    let mut scene = scene(Lang::En);
    scene.start("DEMO-1");
    scene.event(EventKind::RunEnded(Verdict::Module(Outcome::Passed)));
    let (verdict, refusal) = (Some(Verdict::Module(Outcome::Errored)), Some("the disk is full".to_owned()));
    scene.tell(Msg::RunOver { verdict, store_error: None, refusal });
    assert_eq!(scene.model.run.as_ref().and_then(RunView::verdict), verdict);
    assert!(shows(&mut scene, "errored"), "{}", scene.text());
}

/// The form is open when the records were read: nothing begins under it, where F8 would not stop it.
#[test]
fn no_run_begins_under_the_form() {
    let mut scene = scene(Lang::En);
    scene.types("DEMO-1");
    scene.key(Key::Enter);
    assert!(matches!(scene.key(Key::F(5)), Some(Effect::Prepare { .. })));
    scene.key(Key::F(2));
    let serial_number = "DEMO-1".to_owned();
    let prepared = Prepared { serial_number, changed: Vec::new(), standing: None, resume: None };
    assert_eq!(scene.tell(Msg::Prepared(Box::new(prepared))), None);
    assert!(scene.model.run.is_none() && scene.model.pending.is_none());
}

/// Trouble with a label printer does not wipe out what is worse, and a small screen tells of a module under power.
#[test]
fn what_is_worse_stays_in_sight() {
    let mut scene = scene(Lang::En);
    scene.start("DEMO-1");
    scene.event(EventKind::StopRequested { how: StopHow::AtOnce, by: "the operator".into() });
    scene.run_ends_at_once(Outcome::Aborted);
    scene.tell(Msg::WatchOver { why: Some("the cable is out".into()) });
    scene.tell(Msg::HookTrouble("no paper".into()));
    assert!(shows(&mut scene, "the cable is out"), "{}", scene.text());
    scene.resize(40, 12);
    assert!(shows(&mut scene, "power unknown"), "{}", scene.text());
}

/// Nothing that comes by itself wipes out an error. What is only news goes for it.
#[test]
fn what_comes_by_itself_wipes_out_no_error() {
    let broke_off = || super::start::told("DEMO-1");
    let comes: [fn(&mut Scene); 4] = [
        |scene| drop(scene.tell(Msg::ScannerLost { why: "it is unplugged".into() })),
        |scene| drop(scene.tell(Msg::ScannerBack { port: "/dev/ttyACM0".into() })),
        |scene| {
            scene.start("DEMO-1");
            scene.tell(Msg::WatchOver { why: Some("the cable is out".into()) });
            scene.miss_an_event();
            scene.passes(&["identity"]);
        },
        |scene| {
            scene.start("DEMO-1");
            let found = "DEMO-2, and the cable is out".into();
            let other = OtherModule { scanned: "DEMO-1".into(), found, exchanged: false };
            scene.event(EventKind::OtherModule(other));
            scene.run_ends_at_once(Outcome::Errored);
        },
    ];
    for (index, come) in comes.into_iter().enumerate() {
        let mut scene = scene(Lang::En);
        scene.tell(Msg::WatchOver { why: Some("the cable is out".into()) });
        come(&mut scene);
        let message = scene.model.message.as_ref().map(|(_, message)| message.as_str()).unwrap_or_default();
        assert!(message.contains("the cable is out"), "{index}: {message}");
    }
    let mut scene = scene(Lang::En);
    scene.tell(Msg::WatchOver { why: Some("the cable is out".into()) });
    scene.tell(broke_off());
    assert!(shows(&mut scene, "the cable is out"));
    // News follows a warning: the scanner that was lost is there again.
    let mut scene = self::scene(Lang::En);
    scene.tell(Msg::ScannerLost { why: "it is unplugged".into() });
    assert!(shows(&mut scene, "it is unplugged"));
    scene.tell(Msg::ScannerBack { port: "/dev/ttyACM0".into() });
    assert!(shows(&mut scene, "is there again"));
}

/// After a scan the panel says which module F5 tests, also when the message is gone, and at the end of a long number.
#[test]
fn after_a_scan_the_panel_says_what_f5_does() {
    for lang in Lang::ALL {
        let texts = lang.texts();
        let mut scene = scene(lang);
        assert!(shows(&mut scene, texts.no_verdict_yet), "{}", scene.text());
        scene.scans("DEMO-7\r");
        scene.pass_time(Duration::from_secs(60));
        let told = texts.scanned.replace("{}", "DEMO-7");
        assert!(shows(&mut scene, &told) && !shows(&mut scene, texts.no_verdict_yet), "{}", scene.text());
        scene.scans(&format!("{}\r", "X".repeat(40)));
        scene.pass_time(Duration::from_secs(60));
        let told = texts.scanned.replace("{}", "");
        assert!(shows(&mut scene, &format!("…{told}")), "{}", scene.text());
    }
}
