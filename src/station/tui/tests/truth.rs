//! The screen tells what is so: the power of the module, the verdict on every page, times, old messages, small screens.

use std::time::Duration;

use gnc_bench::fixture::{Ask, Reply};
use gnc_bench::guidance::heat::{HeatView, TemperatureSoFar};
use gnc_executive::event::{AttemptError, EventKind, NoteLevel, OtherModule, StopHow};
use gnc_executive::outcome::Outcome;
use gnc_executive::verdict::Verdict;

use ratatui::style::Color;

use super::{fail, scene};
use crate::tui::decode::Key;
use crate::tui::lang::Lang;
use crate::tui::model::{Loaded, MessageWeight, RunView, UsualOperator};
use crate::tui::pending::Prepared;
use crate::tui::scene::Scene;
use crate::tui::update::{Effect, Msg};

/// The words of a screen without its line breaks.
fn whole(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

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
    assert!(whole(&text).contains("does so by itself within 2 s: wait before you take the module out."), "{text}");
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
        let word = lang.texts().word_of(Verdict::Module(Outcome::Failed)).to_uppercase();
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

/// What brings the screen to a place.
type Play = fn(&mut Scene);

/// Wherever the operator is while a run goes on, F8 and Ctrl-C stop it, the last line says so, and the second press is at once.
#[test]
fn a_stop_works_from_everywhere() {
    let shift_page = |scene: &mut Scene| drop(scene.key(Key::F(9)));
    let plays: [(&str, Play); 9] = [
        ("the items", |_| {}),
        ("live", |scene| drop(scene.key(Key::F(9)))),
        ("days", super::records),
        ("runs", super::runs),
        ("a run of the records", super::record),
        ("an item of it", |scene| {
            super::record(scene);
            scene.key(Key::Enter);
        }),
        ("the log", |scene| drop(scene.key(Key::Ctrl('l')))),
        ("help", |scene| drop(scene.key(Key::F(1)))),
        ("the question whether to leave", |scene| drop(scene.key(Key::F(10)))),
    ];
    for (place, play) in plays {
        for key in [Key::F(8), Key::Ctrl('c')] {
            let mut scene = scene(Lang::En);
            play(&mut scene);
            // Behind Enter it may be the scanner's, too.
            scene.pass_time(Duration::from_secs(1));
            assert_eq!(scene.key(key), None, "{place}: nothing is on");
            let without_a_run = if key == Key::F(8) { None } else { Some(Effect::Leave) };
            assert_eq!(scene.key(key), without_a_run, "{place}: nothing is on, again");
            assert!(!scene.text().contains("F8"), "{place}: {}", scene.text());
            let mut scene = self::scene(Lang::En);
            scene.start("DEMO-1");
            play(&mut scene);
            // Behind a scan the first ctrl-C may be the scanner's.
            scene.pass_time(Duration::from_secs(1));
            let foot = scene.text().lines().last().unwrap_or_default().to_owned();
            let full = ["days", "runs"].contains(&place);
            assert!(full || foot.contains("F8"), "{place}: {foot}");
            assert_eq!(scene.key(key), Some(Effect::Stop), "{place} {key:?}");
            assert_eq!(scene.key(key), Some(Effect::Stop), "{place} {key:?} again");
            if place == "days" {
                assert!(scene.text().lines().next().is_some_and(|head| head.contains("STOPPING")), "{}", scene.text());
            }
        }
    }
    // A stop that would lose captures is asked about in the same places, and the same key answers.
    let mut scene = super::start::in_the_hour(Lang::En, (80, 24), 3000.0);
    shift_page(&mut scene);
    scene.key(Key::F(1));
    assert_eq!(scene.key(Key::F(8)), None);
    assert_eq!(scene.key(Key::F(8)), Some(Effect::Stop));
}

/// A scene whose module is under power when the run is stopped at once.
fn stopped_at_once(lang: Lang) -> Scene {
    let mut scene = scene(lang);
    scene.start("DEMO-1");
    scene.key(Key::F(8));
    scene.key(Key::F(8));
    scene.event(EventKind::StopRequested { how: StopHow::AtOnce, by: "the operator".into() });
    scene.run_ends_at_once(Outcome::Aborted);
    scene
}

/// Words of safety are whole at every size, in every language, and stay until the power is known: a scan of the next label, or
/// a plan that is read again, changes nothing of it. Nobody but the operator has stopped anything.
#[test]
fn an_unknown_power_stays_in_sight_until_it_is_known() {
    for lang in Lang::ALL {
        let texts = lang.texts();
        let letters = |text: &str| text.chars().filter(|c| c.is_alphanumeric()).collect::<String>();
        let told = |scene: &mut Scene| letters(&scene.text()).contains(&letters(texts.watchdog_acts));
        let mut scene = stopped_at_once(lang);
        for size in [(80, 24), (80, 16), (160, 50), (60, 20), (40, 12)] {
            scene.resize(size.0, size.1);
            assert!(told(&mut scene), "{lang:?} {size:?}: {}", scene.text());
        }
        scene.resize(80, 24);
        scene.scans("DEMO-2\r");
        assert!(told(&mut scene) && shows(&mut scene, texts.power_unknown), "{lang:?}: {}", scene.text());
        scene.key(Key::F(9));
        assert!(told(&mut scene), "{lang:?}: {}", scene.text());
        scene.key(Key::F(9));
        scene.key(Key::F(9));
        // A run that never reaches the board knows no more.
        scene.start("DEMO-2");
        assert!(!told(&mut scene), "the board has switched the module on again: {}", scene.text());
        // Watched, and switched off in order: the board has said so.
        let mut scene = stopped_at_once(lang);
        scene.key(Key::F(9));
        assert_eq!(scene.key(Key::F(5)), Some(Effect::Watch));
        assert!(!told(&mut scene), "{}", scene.text());
        scene.key(Key::Esc);
        scene.tell(Msg::WatchOver { why: None });
        assert!(!told(&mut scene) && shows(&mut scene, texts.module_off), "{lang:?}: {}", scene.text());
    }
}

/// The line breaks while the module is watched: the last run knows nothing of it. Where no board was found, nothing was
/// switched on.
#[test]
fn a_watched_module_whose_line_breaks_is_not_off() {
    let broken = "no answer from the board to AdRead: asked 5 times in 2500 ms; nothing else was heard from it";
    for (values, is_known) in [(5, false), (0, true)] {
        let mut scene = scene(Lang::En);
        fail(&mut scene);
        scene.key(Key::F(9));
        scene.key(Key::F(5));
        scene.readings(values);
        scene.tell(Msg::WatchOver { why: Some(broken.into()) });
        scene.key(Key::Esc);
        assert_eq!(shows(&mut scene, "module off ·"), is_known, "{values}: {}", scene.text());
        assert_eq!(shows(&mut scene, "power unknown"), !is_known, "{values}: {}", scene.text());
    }
}

/// The line is lost in a run. Nobody knows whether the module has power until the board answers again.
#[test]
fn a_lost_line_is_told_while_the_run_waits_for_it() {
    for lang in Lang::ALL {
        let texts = lang.texts();
        let letters = |text: &str| text.chars().filter(|c| c.is_alphanumeric()).collect::<String>();
        let told = |scene: &mut Scene| letters(&scene.text()).contains(&letters(texts.line_lost));
        let mut scene = scene(lang);
        scene.start("DEMO-1");
        scene.passes(&["identity"]);
        for size in [(80, 24), (80, 16), (60, 20)] {
            scene.resize(size.0, size.1);
            scene.tell(Msg::LineLost(true));
            let text = scene.text();
            assert!(told(&mut scene) && text.contains(texts.power_unknown), "{lang:?} {size:?}: {text}");
            assert!(!text.contains(texts.module_on), "{lang:?} {size:?}: {text}");
            scene.tell(Msg::LineLost(false));
            assert!(!told(&mut scene), "{lang:?} {size:?}: {}", scene.text());
        }
        assert!({
            scene.resize(80, 24);
            shows(&mut scene, texts.module_on)
        });
        scene.tell(Msg::LineLost(true));
        scene.run_ends_at_once(Outcome::Errored);
        let text = scene.text();
        assert!(letters(&text).contains(&letters(texts.watchdog_acts)) && !told(&mut scene), "{lang:?}: {text}");
    }
}

/// A small screen says that a module is under power, and that what is watched has no verdict.
#[test]
fn a_small_screen_knows_of_watching_and_of_what_is_typed() {
    let mut scene = scene(Lang::En);
    fail(&mut scene);
    scene.key(Key::F(9));
    scene.key(Key::F(5));
    scene.resize(60, 20);
    let text = scene.text();
    assert!(text.contains("WATCHING DEMO-1: no verdict") && text.contains("module on"), "{text}");
    assert!(!text.contains("FAILED"), "{text}");
    scene.key(Key::Esc);
    scene.tell(Msg::WatchOver { why: None });
    scene.types("SN-0077");
    let text = scene.text();
    assert!(text.contains("FAILED  DEMO-1") && text.contains("Serial number SN-0077_"), "{text}");
}

/// A board that does not answer: the page says what is wrong and what to try, and that the board was asked.
#[test]
fn an_error_has_its_reason_on_the_page() {
    let why = "no answer from the board to HELLO: asked 10 times in 2500 ms; nothing else was heard from it; check the board's \
               power, the two pairs (A and B swapped?) and the rate";
    for lang in Lang::ALL {
        let mut scene = scene(lang);
        scene.start_without_board("DEMO-1");
        scene.event(EventKind::Note { level: NoteLevel::Error, text: why.into(), item: None });
        scene.run_ends_at_once(Outcome::Errored);
        let letters = |text: &str| text.chars().filter(|c| c.is_alphanumeric()).collect::<String>();
        let said = scene.model.said(why).into_owned();
        for size in [(80, 24), (160, 50)] {
            scene.resize(size.0, size.1);
            let text = scene.text();
            assert!(letters(&text).contains(&letters(&said)), "{lang:?} {size:?}: {said}: {text}");
            assert!(text.contains(lang.texts().no_board_answer) && !text.contains(lang.texts().no_board_yet), "{text}");
        }
        for size in [(60, 20), (40, 12)] {
            scene.resize(size.0, size.1);
            assert!(scene.text().contains("HELLO"), "{lang:?} {size:?}: {}", scene.text());
        }
        // Scanning the next module leaves the error behind.
        scene.scans("DEMO-2\r");
        assert!(!scene.text().contains("HELLO"), "{}", scene.text());
    }
}

/// A number that is typed for the next module stands beside the verdict of this one, which names its module.
#[test]
fn a_verdict_names_its_module() {
    for size in [(80, 24), (160, 50)] {
        let mut scene = scene(Lang::En);
        scene.resize(size.0, size.1);
        scene.start("SN-0010");
        scene.run_ends(Outcome::Passed);
        scene.types("SN-0077");
        let text = scene.text();
        let border = text.lines().find(|line| line.contains("┌ passed")).unwrap_or_default();
        assert!(border.is_empty() || border.contains("passed · SN-0010"), "{text}");
        assert!(text.contains("passed · SN-0010") && text.contains("SN-0077_"), "{text}");
        let mut long = self::scene(Lang::En);
        long.start_selection(&"X".repeat(40), &["cpu"]);
        long.run_ends(Outcome::Passed);
        assert!(shows(&mut long, "SELECTION ┐") && shows(&mut long, "└ XXXX"), "{}", long.text());
    }
}

/// The name of the last run's operator is marked in the panel, whatever message stands in the one line for messages.
#[test]
fn an_operator_who_was_only_remembered_is_marked() {
    for lang in Lang::ALL {
        let texts = lang.texts();
        let mut scene = scene(lang);
        let Loaded::Ready(bench) = &scene.model.bench else { panic!("a bench") };
        let mut bench = bench.clone();
        let nobody = format!("- · {} line-2", texts.station);
        assert!(shows(&mut scene, &nobody), "{lang:?}: {}", scene.text());
        bench.operator = Some(UsualOperator { name: "Li".into(), remembered: true });
        scene.tell(Msg::Bench { path: "sim:good".into(), bench: Loaded::Ready(bench.clone()) });
        assert!(shows(&mut scene, &texts.operator_remembered.replace("{}", "Li")), "{}", scene.text());
        scene.tell(super::start::told("SN-0003"));
        let marked = format!("Li ({})", texts.operator_of_last_run);
        let text = scene.text();
        assert!(text.contains(&marked) && text.contains("SN-0003"), "{lang:?}: {text}");
        // The other way round: the message of the run to resume came first, and stays.
        let mut scene = self::scene(lang);
        scene.model.say(MessageWeight::Info, "F5 resumes 101010-functional");
        scene.tell(Msg::Bench { path: "sim:good".into(), bench: Loaded::Ready(bench) });
        assert!(shows(&mut scene, "F5 resumes") && shows(&mut scene, &marked), "{lang:?}: {}", scene.text());
        // The operator has seen it on the form.
        scene.key(Key::F(2));
        scene.key(Key::Enter);
        assert!(!shows(&mut scene, &marked), "{lang:?}: {}", scene.text());
    }
}

/// Nothing is ready while the plan or the bench file has mistakes, and the heading says in which of them they are.
#[test]
fn a_refused_file_is_not_ready() {
    for lang in Lang::ALL {
        let texts = lang.texts();
        for of_bench in [false, true] {
            let mut scene = scene(lang);
            scene.scans("SN-0060\r");
            match of_bench {
                true => drop(scene.tell(Msg::Bench { path: "bench.toml".into(), bench: Loaded::Refused("no".into()) })),
                false => drop(scene.tell(Msg::Plan { path: "a.toml".into(), plan: Loaded::Refused("no".into()) })),
            }
            let heading = if of_bench { texts.mistakes_of_bench } else { texts.mistakes_found };
            let f5 = texts.scanned.replace("{}", "SN-0060");
            for size in [(80, 24), (160, 50), (60, 20)] {
                scene.resize(size.0, size.1);
                let text = scene.text();
                assert!(text.contains(texts.not_ready) && !text.contains(&f5), "{lang:?} {size:?}: {text}");
                assert!(size.0 < 80 || text.contains(heading), "{lang:?} {size:?}: {text}");
            }
            scene.resize(80, 24);
            scene.scans("SN-0061\r");
            let text = scene.text();
            assert!(text.contains(&texts.scanned_refused.replace("{}", "SN-0061")), "{lang:?}: {text}");
        }
    }
}

/// A question of the run that comes while something else is open comes in front of it, or a sign stands.
#[test]
fn a_question_is_never_hidden() {
    for lang in Lang::ALL {
        let mut scene = scene(lang);
        scene.start("DEMO-1");
        scene.key(Key::F(1));
        let ask = || Msg::Asked { item: "ad".into(), ask: Ask::Switches(None) };
        scene.tell(ask());
        assert!(shows(&mut scene, lang.texts().prompt_title), "{lang:?}: {}", scene.text());
        assert_eq!(scene.key(Key::F(2)), Some(Effect::Answer(Reply::Done)));
        scene.key(Key::F(10));
        scene.tell(ask());
        let waits = lang.texts().question_waits.replace("{}", "ad");
        assert!(shows(&mut scene, &waits), "{lang:?}: {}", scene.text());
        scene.key(Key::Esc);
        assert!(shows(&mut scene, lang.texts().prompt_title), "{lang:?}: {}", scene.text());
    }
}

/// Values that are not of now say so, and whose they are; they go with the next module.
#[test]
fn old_values_are_no_live_ones() {
    for lang in Lang::ALL {
        let texts = lang.texts();
        let mut scene = scene(lang);
        scene.scans("SN-0010\r");
        scene.key(Key::F(9));
        scene.key(Key::F(5));
        scene.readings(20);
        assert!(shows(&mut scene, ".0/s"), "{}", scene.text());
        scene.tell(Msg::WatchOver { why: None });
        scene.pass_time(Duration::from_secs(26));
        let text = scene.text();
        let age = texts.seconds_ago.replace("{}", "26");
        assert!(text.contains(&format!("{} SN-0010 · {age}", texts.last_values)), "{lang:?}: {text}");
        assert!(!text.contains(".0/s"), "{lang:?}: {text}");
        assert!(scene.model.moves(), "the age is drawn each second");
        scene.scans("SN-0011\r");
        scene.key(Key::F(9));
        assert!(
            shows(&mut scene, &texts.no_live_yet.chars().take(12).collect::<String>()),
            "{lang:?}: {}",
            scene.text()
        );
        // Scanned while the module before is watched: its last values come until it is off.
        let mut scene = self::scene(lang);
        scene.scans("SN-0010\r");
        scene.key(Key::F(9));
        scene.key(Key::F(5));
        scene.readings(20);
        scene.scans("SN-0011\r");
        scene.readings(1);
        scene.tell(Msg::WatchOver { why: None });
        scene.key(Key::F(9));
        assert!(
            shows(&mut scene, &texts.no_live_yet.chars().take(12).collect::<String>()),
            "{lang:?}: {}",
            scene.text()
        );
    }
}

/// An attempt that another item's error ended says "the item runs again" only while the run is on.
#[test]
fn nothing_runs_again_when_the_run_is_over() {
    let mut scene = scene(Lang::En);
    scene.start("DEMO-1");
    let item = || "imu".to_owned();
    scene.event(EventKind::ItemStarted { item: item(), attempt: 1 });
    let hint = "the station runs the item again as soon as the board answers".to_owned();
    let text = "another item's error ended this attempt: the cable is out".to_owned();
    let error = Some(AttemptError { text, hint, again: true });
    let outcome = Outcome::Errored;
    scene.event(EventKind::AttemptEnded { item: item(), attempt: 1, outcome, error });
    scene.event(EventKind::ItemEnded { item: item(), outcome, cause: None });
    scene.run_ends(outcome);
    assert!(shows(&mut scene, "the cable is out"), "{}", scene.text());
    for key in [Key::Esc, Key::Enter] {
        scene.key(key);
        assert!(!shows(&mut scene, "runs the item again"), "{}", scene.text());
    }
}

/// What to do with a refused file stands in full beside a scanned number, which the panel of the module shows.
#[test]
fn what_to_do_with_a_refused_file_is_whole_after_a_scan() {
    for lang in Lang::ALL {
        let mut scene = scene(lang);
        let (path, why) = ("test-plans/mine.toml".to_owned(), "the plan has no items".to_owned());
        scene.tell(Msg::Plan { path, plan: crate::tui::model::Loaded::Refused(why) });
        scene.types("SN-2026-0001-AB");
        scene.key(Key::Enter);
        let text = scene.text();
        let of_panel: String = text.lines().take(7).collect();
        assert!(of_panel.contains(lang.texts().refused_next), "{lang:?}: {text}");
    }
}
