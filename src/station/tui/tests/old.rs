//! What was so and is so no more: captures that an earlier run has, messages of a run that is over, times in a pause, and what
//! small screens leave out.

use std::time::Duration;

use gnc_analysis::heat::{Temperatures, Warmth};
use gnc_bench::guidance::Stage;
use gnc_executive::event::EventKind;
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::QuestionWords;

use super::{runs, scene, start};
use crate::tui::decode::Key;
use crate::tui::lang::Lang;
use crate::tui::model::{Loaded, PlanAsks};
use crate::tui::pending::Prepared;
use crate::tui::scene::{ITEMS, Scene};
use crate::tui::update::Msg;

/// A resumed run in which two of three captures exist and the module is cold still.
fn resumed(lang: Lang, warmth: Option<Warmth>) -> Scene {
    let mut scene = Scene::capturing(lang, (80, 24), "magnetometer-ellipse", 0).expect("memory");
    let mut guidance = scene.guidance("magnetometer-ellipse", 0, 0.0);
    (guidance.stage, guidance.orientation) = (warmth.map_or(Stage::Laying, Stage::Warming), None);
    let labels: Vec<String> = guidance.captures.iter().map(|planned| planned.label.clone()).collect();
    guidance.taken = labels[..labels.len() - 1].to_vec().into();
    scene.guided("magnetometer-ellipse", guidance);
    scene.key(Key::F(9));
    scene
}

/// Nothing moves while the module of a resumed run warms up, whatever the first capture of its program is.
#[test]
fn a_resumed_run_that_warms_up_does_not_spin() {
    let at = |c: f64| Temperatures { gyro_c: c, accel_c: c };
    let warmth = Warmth { now: at(25.3), target: at(28.0), left_s: Some(254.0), bound_s: 1700.0, waited_s: 100.0 };
    for lang in Lang::ALL {
        let texts = lang.texts();
        for warmth in [Some(warmth), None] {
            let mut scene = resumed(lang, warmth);
            let all = scene.guidance("magnetometer-ellipse", 0, 0.0).captures.len();
            let text = scene.text();
            let spins = texts.spins.split("{}").next().unwrap_or_default().trim();
            assert!(!spins.is_empty() && !text.contains(&format!("{spins} +5")), "{lang:?}: {text}");
            let first = texts.capture_of.replacen("{}", "1", 1).replacen("{}", &all.to_string(), 1);
            assert!(!text.contains(&first), "{lang:?}: {text}");
            assert!(text.contains(&format!("{} {}/{all}", texts.captures, all - 1)), "{lang:?}: {text}");
            assert!(text.matches(texts.taken_over).count() >= all - 1, "{lang:?}: {text}");
            match warmth {
                Some(_) => assert!(text.contains("25.3") && text.contains("28.0"), "{lang:?}: {text}"),
                None => assert!(text.contains(texts.stage_warms), "{lang:?}: {text}"),
            }
        }
    }
}

/// A message of the run does not outlive it.
#[test]
fn messages_of_a_run_end_with_it() {
    for lang in Lang::ALL {
        let texts = lang.texts();
        let mut scene = scene(lang);
        scene.start("DEMO-1");
        scene.event(EventKind::ItemStarted { item: "identity".into(), attempt: 1 });
        scene.key(Key::F(7));
        let told = texts.aborting_item.replace("{}", "identity");
        assert!(scene.text().contains(&told), "{lang:?}: {}", scene.text());
        scene.ends("identity", Outcome::Aborted);
        scene.run_ends(Outcome::Aborted);
        assert!(!scene.text().contains(&told), "{lang:?}: {}", scene.text());
        // The next module waits: F5 tests it now.
        for codes in [&["SN-0003\r"][..], &["SN-0002\r", "SN-0003\r"][..]] {
            let mut scene = self::scene(lang);
            scene.start("DEMO-1");
            codes.iter().for_each(|code| drop(scene.scans(code)));
            let next = |template: &str| template.replace("{}", "SN-0003");
            assert!(scene.text().contains(&next(texts.scanned_next)), "{lang:?}: {}", scene.text());
            scene.run_ends(Outcome::Passed);
            let text = scene.text();
            assert!(
                text.contains(&next(texts.scanned)) && !text.contains(&next(texts.scanned_next)),
                "{lang:?}: {text}"
            );
        }
    }
}

/// Of 4.8 s expected, 1.4 s are worked. While the last items end before a pause, those that wait take none of the rest.
#[test]
fn the_remaining_time_stands_while_items_end_before_a_pause() {
    let mut scene = scene(Lang::En);
    scene.start("DEMO-1");
    scene.passes(&ITEMS.map(gnc_executive::catalogue::ItemId::as_str)[..9]);
    scene.pass_time(Duration::from_millis(140));
    scene.event(EventKind::ItemStarted { item: ITEMS[9].as_str().into(), attempt: 1 });
    scene.progress(&[(ITEMS[9].as_str(), None)]);
    scene.key(Key::F(6));
    for _ in 0..10 {
        scene.pass_time(Duration::from_secs(1));
    }
    assert!(scene.text().contains("3.40 s"), "{}", scene.text());
    scene.ends(ITEMS[9].as_str(), Outcome::Passed);
    scene.progress(&[]);
    scene.pass_time(Duration::from_secs(1));
    let text = scene.text();
    assert!(text.contains("PAUSED") && text.contains("3.40 s"), "{text}");
}

/// A capture takes its time of the rest while it ends before a pause, and the pause behind it takes none.
#[test]
fn a_capture_before_a_pause_takes_its_time() {
    let mut scene = Scene::capturing(Lang::En, (80, 24), "six-position", 2).expect("memory");
    let now = scene.model.now.since_start;
    let run = scene.model.run.as_mut().expect("a run");
    let of_record_s = run.state.last().map_or(0.0, |stamp| stamp.elapsed_us as f64 / 1e6);
    run.expected_s = Some(5000.0 + now.saturating_sub(run.began).as_secs_f64().max(of_record_s));
    let shown = |left_s: f64| format!("Remaining {}", gnc_executive::text::duration(left_s));
    assert!(scene.text().contains(&shown(5000.0)), "{}", scene.text());
    scene.key(Key::F(6));
    scene.pass_time(Duration::from_secs(600));
    assert!(scene.text().contains(&shown(4400.0)), "{}", scene.text());
    scene.ends("six-position", Outcome::Passed);
    scene.progress(&[]);
    scene.pass_time(Duration::from_secs(300));
    let text = scene.text();
    assert!(text.contains("PAUSED") && text.contains(&shown(4400.0)), "{text}");
}

/// The tests page tells the time that the captures of the plan take, as the page of the captures does.
#[test]
fn both_pages_tell_the_same_time_of_the_captures() {
    let mut scene = Scene::capturing(Lang::En, (80, 24), "six-position", 2).expect("memory");
    let (item, guidance) = scene.model.guidance().expect("a capture");
    let left_s = crate::tui::view::plan_left_s(&scene.model, item, guidance).expect("a plan");
    let left = gnc_executive::text::duration(left_s);
    assert!(scene.text().contains(&format!("Remaining {left}")), "{left}: {}", scene.text());
    scene.key(Key::F(9));
    assert!(scene.text().contains(&format!("{left} to go")), "{left}: {}", scene.text());
}

/// A run of one item that cannot be resumed asks for that item, and not for the plan.
#[test]
fn what_begins_from_its_beginning_is_named() {
    for lang in Lang::ALL {
        for key in [Key::F(3), Key::F(5)] {
            let mut scene = scene(lang);
            scene.model.resume = Some("records/2026-11-21/DEMO-1/221500-calibration".into());
            scene.scans("DEMO-1\r");
            scene.key(key);
            let (serial_number, resume) = ("DEMO-1".to_owned(), start::unlike());
            scene.tell(Msg::Prepared(Box::new(Prepared {
                serial_number,
                changed: Vec::new(),
                standing: None,
                resume,
            })));
            let (items, plan) = (lang.texts().no_resume_items, lang.texts().no_resume_question);
            let asked = if key == Key::F(3) { items } else { plan };
            assert!(scene.text().contains(asked), "{lang:?} {key:?}: {}", scene.text());
        }
    }
}

/// The item that runs is in sight until the operator moves the cursor.
#[test]
fn the_list_follows_the_item_that_runs() {
    let mut scene = Scene::new(Lang::En, 80, 16).expect("memory");
    scene.start("DEMO-1");
    let last = ITEMS[13].as_str();
    scene.event(EventKind::ItemStarted { item: last.into(), attempt: 1 });
    scene.progress(&[(last, Some(500))]);
    let row = |scene: &mut Scene, name: &str| scene.text().lines().any(|line| line.contains(&format!(" {name} ")));
    assert!(row(&mut scene, last), "{}", scene.text());
    assert_eq!(scene.model.item_under_cursor(), Some("identity"));
    scene.key(Key::Down);
    assert!(row(&mut scene, "cpu") && !row(&mut scene, last), "{}", scene.text());
}

/// A screen without panels tells a selection before it runs, and which item F3 runs.
#[test]
fn a_small_screen_tells_what_would_run() {
    for lang in Lang::ALL {
        let mut scene = scene(lang);
        scene.resize(60, 20);
        let selection = lang.texts().selection_long;
        assert!(scene.text().contains("F3: identity") && !scene.text().contains(selection), "{}", scene.text());
        scene.key(Key::Down);
        scene.key(Key::Char(' '));
        let text = scene.text();
        assert!(text.contains("F3: cpu") && text.contains("F5: 13/14") && text.contains(selection), "{lang:?}: {text}");
    }
}

/// A line of the records that is no evidence says so at every width.
#[test]
fn a_narrow_list_of_records_keeps_its_caveats() {
    for lang in Lang::ALL {
        let texts = lang.texts();
        for width in [60, 79, 80, 160] {
            let mut scene = Scene::new(lang, width, 20).expect("memory");
            runs(&mut scene);
            let text = scene.text();
            let lines: Vec<&str> = text.lines().filter(|line| line.contains("DEMO-1")).collect();
            assert_eq!(lines.len(), 2, "{lang:?} {width}: {text}");
            for line in &lines {
                assert!(
                    line.contains(texts.simulated) || line.contains(texts.simulated_short),
                    "{lang:?} {width}: {text}"
                );
            }
            let selection = [texts.selection, texts.selection_short].iter().any(|word| lines[1].contains(word));
            assert!(selection, "{lang:?} {width}: {text}");
        }
    }
}

/// An error with the words of a question has them in the language of the screen, if the plan has them in it.
#[test]
fn the_words_of_a_question_are_in_the_language_of_the_screen() {
    for (lang, wanted) in [
        (Lang::En, "the operator could not do this: How does the housing look?"),
        (Lang::Zh, "操作员做不到：外壳看起来怎样？"),
        (Lang::Ru, "How does the housing look?"),
    ] {
        let mut scene = scene(lang);
        let en = "How does the housing look?".to_owned();
        let words = vec![QuestionWords { en, zh: Some("外壳看起来怎样？".into()), ru: None }];
        let Loaded::Ready(plan) = &mut scene.model.plan else { panic!("a plan") };
        plan.asks = std::sync::Arc::new(PlanAsks { words, ..PlanAsks::default() });
        let said = scene.model.said("the operator could not do this: How does the housing look?").into_owned();
        assert!(said.ends_with(wanted), "{lang:?}: {said}");
        // The log has the question as it is asked at a terminal. Neither Enter nor n answers it on the screen.
        scene.start("DEMO-1");
        let text = "How does the housing look? A number in V. Limit: 4.9 .. 5.1 V. Press Enter when it is typed. (n: not possible)";
        let (item, question) = (Some("by-hand".to_owned()), Some("look".to_owned()));
        scene.event(EventKind::Prompted { item, text: text.into(), question, picture_sha256: None });
        scene.key(Key::Ctrl('l'));
        let log = scene.text();
        let line = log.lines().find(|line| line.contains("by-hand: ")).unwrap_or_default();
        let (asked, question) = (lang.texts().asked_log, wanted.rsplit(['：', ':']).next().unwrap_or_default().trim());
        assert!(line.contains(&format!("by-hand: {asked}: {question}")), "{lang:?}: {log}");
        assert!(!log.contains("Enter") && !log.contains("not possible"), "{lang:?}: {log}");
        assert_eq!(log.contains("Limit:"), lang == Lang::En, "{lang:?}: {log}");
    }
}

/// The disk fills up in a run, so the record has no end. No item waits any more, and the page does not say so.
#[test]
fn no_item_waits_after_a_run_without_a_record() {
    let mut scene = Scene::at_work(Lang::En, 80, 24).expect("memory");
    assert!(scene.text().contains("waiting"), "{}", scene.text());
    scene.tell(Msg::RunOver { verdict: None, store_error: Some("the disk is full".into()), refusal: None });
    let text = scene.text();
    assert!(!text.contains("waiting") && text.contains("not run"), "{text}");
}
