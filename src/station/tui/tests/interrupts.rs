//! Ctrl-C, and the same byte from a scanner.

use std::time::Duration;

use gnc_executive::outcome::Outcome;

use super::scene;
use crate::tui::decode::Key;
use crate::tui::lang::Lang;
use crate::tui::model::MessageWeight;
use crate::tui::scene::Scene;
use crate::tui::update::{Effect, Msg};

const ETX: Key = Key::Ctrl('c');

/// Keys, each so many milliseconds behind the one before.
fn keys(scene: &mut Scene, gap_ms: u64, keys: &[Key]) -> Vec<Effect> {
    let mut effects = Vec::new();
    for key in keys {
        scene.pass_time(Duration::from_millis(gap_ms));
        effects.extend(scene.key(*key));
    }
    effects
}

/// A code as a slow scanner types it, with this before and behind.
fn code(before: &[Key], number: &str, behind: &[Key]) -> Vec<Key> {
    before.iter().copied().chain(number.chars().map(Key::Char)).chain(behind.iter().copied()).collect()
}

fn is_stop(effect: &Effect) -> bool {
    matches!(effect, Effect::Leave | Effect::Stop | Effect::StopAndLeave | Effect::Raise)
}

/// ETX before, behind, or on both sides of a code, with and without a line end: no speed leaves the program.
#[test]
fn the_etx_of_a_slow_scanner_does_not_leave() {
    let frames: [(&[Key], &[Key]); 5] = [
        (&[], &[ETX]),
        (&[ETX], &[]),
        (&[ETX], &[ETX]),
        (&[ETX], &[Key::Enter, ETX]),
        (&[], &[Key::Enter, Key::Ctrl('j'), ETX]),
    ];
    for (before, behind) in frames {
        for gap_ms in [31, 120, 240] {
            for play in [vec![], vec![Key::F(9)], vec![Key::F(9), Key::F(9)], vec![Key::F(2)], vec![Key::F(1)]] {
                let mut scene = scene(Lang::En);
                play.iter().for_each(|key| drop(scene.key(*key)));
                for number in ["SN-7", "SN-8", "5"] {
                    let effects = keys(&mut scene, gap_ms, &code(before, number, behind));
                    assert!(!effects.iter().any(is_stop), "{before:?} {behind:?} {gap_ms} {play:?}: {effects:?}");
                }
            }
        }
    }
}

/// Text in the field is a code whose rest is late; without text two presses within the time of the line leave.
#[test]
fn to_leave_takes_two_presses_and_no_text() {
    let (mut scene, second) = (scene(Lang::En), Duration::from_secs(1));
    scene.types("SN-7");
    for _ in 0..3 {
        scene.pass_time(20 * second);
        assert_eq!(scene.key(ETX), None);
        assert!(!scene.model.is_asked_to_leave());
    }
    scene.key(Key::Esc);
    assert_eq!((scene.key(ETX), scene.model.is_asked_to_leave()), (None, true));
    scene.pass_time(5 * second);
    assert_eq!(scene.model.message, None, "the line has gone");
    assert_eq!(scene.key(ETX), None, "the line has gone");
    scene.key(Key::Down);
    assert_eq!(scene.model.message, None, "another key came between");
    assert_eq!(scene.key(ETX), None, "another key came between");
    scene.model.say(MessageWeight::Warning, "something else");
    assert_eq!(scene.key(ETX), None, "the line was not on the screen");
    scene.pass_time(4 * second);
    assert_eq!(scene.key(ETX), Some(Effect::Leave));
    let mut records = super::scene(Lang::En);
    super::records(&mut records);
    records.key(Key::Enter);
    records.types("SN");
    records.pass_time(second);
    assert_eq!([records.key(ETX), records.key(ETX)], [None, None], "text of the search");
}

/// Behind a code the first ctrl-C is the scanner's and the second one is a hand.
#[test]
fn the_etx_of_a_slow_scanner_stops_no_run() {
    for behind in [&[ETX][..], &[Key::Enter, ETX]] {
        let mut scene = scene(Lang::En);
        scene.start("DEMO-1");
        let effects = keys(&mut scene, 240, &code(&[], "SN-8", behind));
        assert!(!effects.iter().any(is_stop), "{effects:?}");
        assert_eq!(scene.key(ETX), Some(Effect::Stop), "at once behind it: a hand");
    }
    let mut scene = scene(Lang::En);
    scene.start("DEMO-1");
    scene.types("SN-8");
    scene.pass_time(Duration::from_millis(500));
    assert_eq!(scene.key(ETX), Some(Effect::Stop), "text in the field holds no stop back");
}

/// The run ends between the two presses of "twice at once", and the second one, or a third one, does nothing.
#[test]
fn the_second_press_does_not_leave_if_the_run_ended_between() {
    for lang in Lang::ALL {
        let mut scene = scene(lang);
        scene.start("DEMO-1");
        scene.pass_time(Duration::from_secs(1));
        assert_eq!(scene.key(ETX), Some(Effect::Stop));
        scene.run_ends(Outcome::Aborted);
        let mut told = false;
        for _ in 0..4 {
            scene.pass_time(Duration::from_secs(1));
            assert_eq!(scene.key(ETX), None);
            told |= scene.text().contains(scene.model.texts.interrupt_after_run);
            assert!(!scene.model.is_asked_to_leave());
        }
        assert!(told || lang != Lang::En, "{}", scene.text());
        scene.pass_time(Duration::from_secs(1));
        assert_eq!([scene.key(ETX), scene.key(ETX)], [None, Some(Effect::Leave)]);
    }
    // So with a look at raw values.
    let mut scene = scene(Lang::En);
    scene.key(Key::F(9));
    scene.key(Key::F(5));
    assert_eq!(scene.key(ETX), Some(Effect::Stop));
    scene.tell(Msg::WatchOver { why: None });
    assert_eq!([scene.key(ETX), scene.key(ETX)], [None, None]);
}
