//! What keys do, and what the screen shows then. Time stands still in all tests.

mod captures;
mod interrupts;
mod numbers;
mod old;
mod parts;
mod photographs;
mod pictures;
mod prompts;
mod properties;
mod questions;
#[cfg(feature = "sim")]
mod same;
mod scans;
mod scenes;
mod standing;
mod start;
mod truth;

use std::collections::BTreeSet;
use std::path::Path;

use gnc_executive::event::{BoardBreach, EventKind};
use gnc_executive::outcome::Outcome;
use gnc_executive::serial_number::SerialNumberPattern;
use gnc_executive::standing::Standing;
use gnc_executive::verdict::Verdict;
use gnc_records::standing::Face;

use super::decode::Key;
use super::lang::Lang;
use super::model::{Glyphs, Loaded, RoundsSetting};
use super::pending::Prepared;
use super::scene::Scene;
use super::update::{Effect, Msg};
use scenes::{SCENES, error, fail, has_failed, line, never, record, records, runs};

/// A narrow and a wide screen.
const SIZES: [(u16, u16); 2] = [(80, 24), (160, 50)];

/// Scenes that are pictured in Chinese and Russian, too, on the narrow screen: their layout depends on the length of
/// texts. All others have one layout in all languages, and [`properties`] sees whether a text fits.
const PICTURED_IN_ALL: [&str; 8] = [
    // The column of outcomes is as wide as its longest word, and sentences are broken under a bad item.
    "failed",
    // What the records say is broken in a panel of six lines, and other lines give way to it.
    "scanned",
    // The longest question, with a picture and two more texts below it.
    "prompt-table",
    // A question of several sentences with names of files in them.
    "changed",
    // A column of keys beside sentences that are broken.
    "help",
    // Labels and values of the form stand in columns.
    "setup",
    // Most columns, and most keys in the last line.
    "records-runs",
    // Directions are broken beside a drawing, and bars take what labels leave.
    "captures-turn",
];

/// Screens without room for the page.
const TOO_SMALL: [(u16, u16); 3] = [(79, 24), (80, 23), (20, 6)];

/// The folder of the pictures of this module, and how their names begin.
const PICTURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tui/snapshots");
const PICTURE: &str = "gnc_station__tui__tests__";

/// Each picture that is kept is that of a scene and a size, and no old one stays.
#[test]
fn every_scene_is_as_it_was_reviewed() {
    let mut names = BTreeSet::new();
    let mut picture = |name: String, scene: &mut Scene| {
        insta::assert_snapshot!(name.clone(), scene.text());
        names.insert(format!("{PICTURE}{name}.snap"));
    };
    for (name, play) in SCENES.iter().copied() {
        for size in SIZES {
            picture(format!("{name}-En-{}", size.0), &mut play(Lang::En, size));
        }
        for lang in [Lang::Zh, Lang::Ru] {
            if PICTURED_IN_ALL.contains(&name) {
                picture(format!("{name}-{lang:?}-{}", SIZES[0].0), &mut play(lang, SIZES[0]));
            }
        }
    }
    for (width, height) in TOO_SMALL {
        let mut scene = Scene::new(Lang::En, width, height).expect("memory");
        fail(&mut scene);
        picture(format!("too-small-En-{width}x{height}"), &mut scene);
    }
    let kept = std::fs::read_dir(Path::new(PICTURES)).expect("the folder of pictures");
    let kept = kept.map(|file| file.expect("a file").file_name().to_string_lossy().into_owned());
    let kept: BTreeSet<String> = kept.filter(|name| name.ends_with(".snap")).collect();
    assert_eq!(kept.difference(&names).collect::<Vec<_>>(), Vec::<&String>::new(), "pictures of no scene");
}

fn scene(lang: Lang) -> Scene {
    Scene::new(lang, 80, 24).expect("memory")
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
            scene.event(EventKind::ItemStarted { item: "ad".into(), attempt: 1 });
        },
    ];
    for play in plays {
        let mut scene = scene(Lang::En);
        if let Loaded::Ready(bench) = &mut scene.model.bench {
            bench.serial_number = SerialNumberPattern::new(".*é模").ok();
        }
        play(&mut scene);
        for character in "SN 12qynYN/é模".chars() {
            let key = if character == ' ' { Key::Pasted(' ') } else { Key::Char(character) };
            assert_eq!(scene.key(key), None);
        }
        let running = scene.model.is_running();
        let command = scene.key(Key::Enter);
        let scanned = if running { &scene.model.scan.next } else { &scene.model.scan.current };
        assert_eq!(scanned.as_deref(), Some("SN 12qynYN/é模"));
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
    assert_eq!(scene.key(Key::F(2)), Some(Effect::StopAndLeave));
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
        scene.tell(Msg::Opened(Ok(Box::new((path, state, Face::Ended(Verdict::Module(Outcome::Failed)))))));
        let long = texts.rejudged_long.replace("{}", "140500-functional");
        for (width, height) in SIZES {
            scene.resize(width, height);
            assert!(scene.text().contains(&long), "{}", scene.text());
        }
    }
}

/// A run that was closed by a later start is marked in the list at each width, and its pass looks like none.
#[test]
fn a_late_close_is_marked() {
    for lang in Lang::ALL {
        let texts = lang.texts();
        let mut scene = Scene::new(lang, 160, 50).expect("memory");
        scenes::late(&mut scene);
        for (width, word) in [(160, texts.late), (80, texts.late_short)] {
            scene.resize(width, 24);
            let text = scene.text();
            let row = |number: &str| text.lines().find(|line| line.contains(number)).unwrap_or_default();
            let (late, in_time) = (row("DEMO-1"), row("DEMO-2"));
            assert!(late.contains(word) && late.contains('?') && !late.contains('✓'), "{lang:?}: {late}");
            assert!(!in_time.contains(word) && in_time.contains('✓'), "{lang:?}: {in_time}");
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

/// The screen says the same as the lines without it when a run was not begun.
#[test]
fn a_run_that_was_not_begun_is_not_called_a_lost_record() {
    let why = "ERRORED: this run is not a pass, because its record could not be begun: x; nothing was tested";
    for lang in Lang::ALL {
        let mut scene = scene(lang);
        scene.start("DEMO-1");
        scene.tell(Msg::RunOver { verdict: None, store_error: Some(format!("{why}\ny")), refusal: None });
        let told = scene.model.unrecorded.clone().unwrap_or_default();
        let expected = format!("{}; y", crate::phrases::in_language(why, lang));
        assert_eq!(told, expected, "{lang:?}");
        assert_eq!(told.contains("nothing was tested"), lang == Lang::En, "{told}");
    }
}

/// That records cannot be written stays in sight until one is written, whatever else is told, scanned or tested.
#[test]
fn a_lost_record_is_told_until_one_is_written() {
    let over = |error: Option<&str>| Msg::RunOver {
        verdict: Some(Verdict::Module(Outcome::Passed)),
        store_error: error.map(str::to_owned),
        refusal: None,
    };
    let mut scene = scene(Lang::En);
    scene.start("DEMO-1");
    scene.tell(over(Some("no space left on device")));
    scene.tell(Msg::HookTrouble("no paper".into()));
    scene.scans("DEMO-2\r");
    scene.pass_time(std::time::Duration::from_secs(3600));
    for key in [Key::F(9), Key::F(9), Key::F(1), Key::Esc, Key::F(9)] {
        scene.key(key);
        for (width, height) in [(80, 24), (160, 50), (40, 12)] {
            scene.resize(width, height);
            let text: String = scene.text().split_whitespace().collect::<Vec<_>>().join(" ");
            let told = if width < 80 { "ERRORED: the record" } else { "could not be written: no space left on device" };
            assert!(text.contains(told), "{key:?} {width}: {text}");
        }
    }
    // The whole sentence has room, with what to do at its end.
    let file = "/home/operator/records/2026-11-22/DEMO-1/143000-functional/events.jsonl";
    let why =
        format!("cannot write {file}: No space left on device (os error 28); make room on the disk and run again");
    scene.start("DEMO-2");
    scene.tell(over(Some(&why)));
    scene.resize(80, 24);
    let text: String = scene.text().split_whitespace().collect();
    assert!(text.contains("makeroomonthediskandrunagain") && text.contains(file), "{text}");
    // A run that is refused has written nothing.
    scene.start("DEMO-2");
    scene.tell(Msg::RunOver { verdict: None, store_error: None, refusal: Some("the board is gone".into()) });
    assert!(scene.model.unrecorded.is_some());
    scene.start("DEMO-2");
    scene.tell(over(None));
    assert!(!scene.text().contains("no space left"), "{}", scene.text());
}

/// Outcome and serial number filter the runs of a day.
#[test]
fn runs_are_found() {
    let mut scene = scene(Lang::En);
    runs(&mut scene);
    scene.key(Key::F(4));
    assert_eq!(scene.model.records.shown().len(), 1, "the failed one");
    (0..5).for_each(|_| drop(scene.key(Key::F(4))));
    let partial: Vec<_> = scene.model.records.shown().iter().map(|run| run.face).collect();
    assert_eq!(partial, [Face::Ended(Verdict::Selection(Outcome::Passed))], "the selection is not among the passed");
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
