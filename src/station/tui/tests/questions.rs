//! What keys and scans do while a question is open.

use gnc_bench::fixture::{Ask, Reply};
use gnc_executive::event::EventKind;
use gnc_executive::plan::QuestionKind;

use super::scene;
use super::scenes::{Play, SCENES};
use crate::tui::decode::Key;
use crate::tui::input::Scanned;
use crate::tui::keymap::KeyContext;
use crate::tui::lang::Lang;
use crate::tui::scene::Scene;
use crate::tui::update::{Effect, Msg};

fn asked() -> Scene {
    let mut scene = scene(Lang::En);
    scene.start("DEMO-1");
    scene.event(EventKind::ItemStarted { item: "ad".into(), attempt: 1 });
    scene.tell(Msg::Asked { item: "ad".into(), ask: Ask::Switches(None) });
    scene
}

/// Letters of a hand go nowhere while any question is open, and the first Esc answers it.
#[test]
fn letters_go_nowhere_while_a_question_is_open() {
    let mut asked = Vec::new();
    for (name, play) in SCENES.iter().copied().chain(NO_WORDS) {
        let mut scene = play(Lang::En, (80, 24));
        let place = scene.model.place();
        if !asks(place) {
            continue;
        }
        let before = scene.text();
        for character in "yes, SN-1 n".chars() {
            assert_eq!(scene.key(Key::Char(character)), None, "{name}");
        }
        assert_eq!((scene.key(Key::Enter), scene.key(Key::Backspace)), (None, None), "{name}");
        assert_eq!(scene.text(), before, "{name}");
        assert!(scene.model.scan.typed.is_empty() && scene.model.scan.next.is_none(), "{name}");
        if ![KeyContext::Prompt, KeyContext::Question].contains(&place) {
            scene.key(Key::Esc);
            assert_ne!(scene.model.place(), place, "{name}: Esc answers");
        }
        asked.push(place);
    }
    assert!(asked.len() >= 16, "{} scenes ask", asked.len());
    for place in KeyContext::ALL.iter().copied() {
        assert_eq!(asks(place), asked.contains(&place), "{place:?}");
    }
}

/// Whether a question is open that takes no words. Each place has its answer here.
fn asks(place: KeyContext) -> bool {
    match place {
        KeyContext::Prompt
        | KeyContext::Question
        | KeyContext::Confirm
        | KeyContext::Changed
        | KeyContext::Interrupted
        | KeyContext::Stopping
        | KeyContext::GivingUp => true,
        KeyContext::Idle
        | KeyContext::Running
        | KeyContext::Detail
        | KeyContext::Live
        | KeyContext::LiveRunning
        | KeyContext::Watching
        | KeyContext::Calibration
        | KeyContext::Records
        | KeyContext::Record
        | KeyContext::Setup
        | KeyContext::Help => false,
    }
}

/// Questions of a plan that take no words: something is to be done, and the answers are to be looked over.
const NO_WORDS: [(&str, Play); 2] = [
    ("done", |lang, _| super::prompts::asked(lang, super::prompts::question(QuestionKind::Done, true))),
    ("look-over", |lang, _| super::prompts::asked(lang, Ask::LookOver(vec![("tp4".into(), "5.01 V".into())]))),
];

/// A number that was half typed before the question does not keep Esc from it.
#[test]
fn half_a_number_is_not_in_the_way_of_an_answer() {
    let mut scene = scene(Lang::En);
    scene.start("DEMO-1");
    scene.types("SN-");
    scene.key(Key::F(10));
    assert_eq!(scene.model.place(), KeyContext::Confirm);
    scene.key(Key::Esc);
    assert_eq!(scene.model.place(), KeyContext::Running);
    assert_eq!(scene.model.scan.typed.text(), "SN-");
}

/// The field of rounds takes digits alone: it loses those of the scan, and keeps its own.
#[test]
fn a_scan_takes_back_only_what_a_field_has_taken() {
    let mut scene = scene(Lang::En);
    scene.key(Key::F(2));
    (0..3).for_each(|_| drop(scene.key(Key::Down)));
    scene.key(Key::Right);
    scene.types("2");
    let before = scene.model.over.clone();
    scene.types("7S");
    scene.tell(Msg::Scan(Scanned { bytes: b"N-0002\r".to_vec(), ended: true, taken_back: 2, dropped: 0 }));
    assert_eq!((scene.model.scan.current.as_deref(), &scene.model.over), (Some("7SN-0002"), &before));
}

/// A scan reaches the number from a question as well, with the letters that came as keys before it was known to be one.
#[test]
fn a_scan_during_a_question_is_whole_and_answers_nothing() {
    for (typed, taken_back, rest, number) in
        [("", 0, "SN-0002\r", "SN-0002"), ("S", 1, "N-0002\r", "SN-0002"), ("noSN", 2, "-0002\r", "SN-0002")]
    {
        let mut scene = asked();
        scene.types(typed);
        let scanned = Scanned { bytes: rest.into(), ended: true, taken_back, dropped: 0 };
        assert_eq!(scene.tell(Msg::Scan(scanned)), None);
        assert_eq!(scene.model.scan.next.as_deref(), Some(number), "{typed}");
        assert_eq!(scene.model.place(), KeyContext::Prompt, "a scan is no answer");
    }
    // Without a line end Enter takes it, as everywhere.
    let mut scene = asked();
    scene.tell(Msg::Scan(Scanned { bytes: b"SN-0003".to_vec(), ended: false, taken_back: 0, dropped: 0 }));
    assert_eq!(scene.key(Key::Enter), None);
    assert_eq!(scene.model.scan.next.as_deref(), Some("SN-0003"));
    assert_eq!(scene.key(Key::F(2)), Some(Effect::Answer(Reply::Done)));
    // However much a hand types, the last letters are those of the scan.
    let mut scene = asked();
    scene.types(&"x".repeat(500));
    scene.types("S");
    scene.tell(Msg::Scan(Scanned { bytes: b"N-0004\r".to_vec(), ended: true, taken_back: 1, dropped: 0 }));
    assert_eq!(scene.model.scan.next.as_deref(), Some("SN-0004"));
}
