//! Questions of a plan on the screen: typed, pasted and scanned answers, and what files them.

use std::sync::Arc;
use std::time::Duration;

use gnc_bench::fixture::{Ask, QuestionAsked, Reply};
use gnc_executive::plan::{Question, QuestionKind, QuestionWords};
use gnc_executive::quantity::Unit;
use gnc_executive::serial_number::SerialNumberPattern;

use super::super::decode::Key;
use super::super::input::Scanned;
use super::super::lang::Lang;
use super::super::scene::Scene;
use super::super::update::{Effect, Msg};
use super::{SIZES, scene};

/// A question in three languages, with a limit and a picture.
pub(super) fn question(kind: QuestionKind, back: bool) -> Ask {
    let limit = match &kind {
        QuestionKind::Number { .. } => "4.9 .. 5.1 V",
        QuestionKind::Text { .. } => "=~ GPS-[0-9]{5}",
        QuestionKind::Choice { .. } => "== clean",
        QuestionKind::Done => "== done",
    };
    let words = QuestionWords {
        en: "What does the meter at TP4 read?".into(),
        zh: Some("TP4 处电表读数是多少？".into()),
        ru: Some("Что показывает прибор на TP4?".into()),
    };
    let picture = Some("plans/tp4.png".into());
    let question = Question { name: "tp4".into(), words, kind, picture, picture_sha256: None };
    let question = Arc::new(question);
    Ask::Question(Box::new(QuestionAsked { question, limit: Some(limit.into()), back, problem: None }))
}

fn volts() -> QuestionKind {
    QuestionKind::Number { unit: Unit::Volt }
}

fn gps() -> QuestionKind {
    QuestionKind::Text { pattern: Some(SerialNumberPattern::new("GPS-[0-9]{5}").expect("a pattern")) }
}

pub(super) fn asked(lang: Lang, ask: Ask) -> Scene {
    let mut scene = scene(lang);
    scene.start("DEMO-1");
    scene.tell(Msg::Asked { item: "by-hand".into(), ask });
    scene
}

fn text(typed: &str) -> Option<Effect> {
    Some(Effect::Answer(Reply::Text(typed.into())))
}

fn pastes(scene: &mut Scene, text: &str) {
    text.chars().for_each(|character| drop(scene.key(Key::Pasted(character))));
}

/// The message on the screen.
fn message(scene: &Scene) -> String {
    scene.model.message.as_ref().map(|(_, what)| what.clone()).unwrap_or_default()
}

#[test]
fn a_typed_answer_is_filed_by_f2() {
    let mut scene = asked(Lang::En, question(volts(), false));
    scene.types("4,999");
    scene.key(Key::Backspace);
    assert!(scene.text().contains("Answer: 4,99_"), "{}", scene.text());
    // The answer is not the next serial number.
    assert!(scene.model.scan.typed.is_empty() && scene.model.scan.next.is_none());
    assert_eq!(scene.key(Key::F(2)), text("4,99"));
    assert!(scene.model.run.as_ref().is_some_and(|run| run.prompt.is_none()));
    // A second press answers nothing.
    assert_eq!(scene.key(Key::F(2)), None);
}

#[test]
fn a_pasted_answer_may_have_blanks_and_its_unit() {
    let mut scene = asked(Lang::En, question(volts(), false));
    pastes(&mut scene, "  3,3 V ");
    assert_eq!(scene.key(Key::F(2)), text("  3,3 V "));
}

/// Text is pasted with its line end, which comes as a blank: lines are not joined into another number.
#[test]
fn pasted_lines_are_no_number() {
    let mut scene = asked(Lang::En, question(volts(), false));
    pastes(&mut scene, "3,3 V  ");
    assert_eq!(scene.key(Key::F(2)), text("3,3 V  "));
    let mut scene = asked(Lang::En, question(volts(), false));
    pastes(&mut scene, "3 3");
    assert_eq!(scene.key(Key::F(2)), None);
    // What cannot be text goes, so that the operator can type anew.
    let mut scene = asked(Lang::En, question(volts(), false));
    scene.types("5");
    scene.key(Key::Control);
    assert_eq!(scene.key(Key::F(2)), None);
    assert!(message(&scene).contains("control characters"), "{}", message(&scene));
    scene.types("4.9");
    assert_eq!(scene.key(Key::F(2)), text("4.9"));
}

/// A scanner in another layout types other letters: that is told, and not only that the text does not fit.
#[test]
fn a_scan_in_another_layout_is_told() {
    let mut scene = asked(Lang::En, question(gps(), false));
    scene.scans("ПЗЫ-00042\r");
    assert!(message(&scene).contains("another layout"), "{}", message(&scene));
    assert!(scene.text().contains("Answer: _"), "{}", scene.text());
}

/// A scan fills the answer and files nothing, whatever the scanner sends behind the code.
#[test]
fn a_scan_is_the_answer_and_files_nothing() {
    for end in ["\r\n", "\r", "\t", "\u{3}"] {
        let mut scene = asked(Lang::En, question(gps(), false));
        scene.types("x");
        assert_eq!(scene.scans(&format!("GPS-00042{end}")), None);
        assert!(scene.text().contains("Answer: GPS-00042_"), "{end:?}: {}", scene.text());
        assert_eq!(scene.model.scan.next, None, "{end:?}: the scan is no serial number");
        assert_eq!(scene.key(Key::F(2)), text("GPS-00042"));
    }
    // Its beginning may have come as keys.
    let mut scene = asked(Lang::En, question(gps(), false));
    scene.types("G");
    scene.tell(Msg::Scan(Scanned { bytes: b"PS-00042\r".to_vec(), ended: true, taken_back: 1, dropped: 0 }));
    assert_eq!(scene.key(Key::F(2)), text("GPS-00042"));
    // What is no text takes nothing over.
    let mut scene = asked(Lang::En, question(gps(), false));
    scene.scans("GPS\u{1d}00042\r");
    assert!(scene.text().contains("Answer: _"), "{}", scene.text());
}

/// "Done" takes no words: a scan then is the next module, as with every request.
#[test]
fn a_scan_while_something_is_to_be_done_is_the_next_module() {
    let mut scene = asked(Lang::En, question(QuestionKind::Done, false));
    scene.scans("DEMO-2\r");
    assert_eq!(scene.model.scan.next.as_deref(), Some("DEMO-2"));
    assert!(!scene.text().contains("Answer:"));
    assert_eq!(scene.key(Key::F(2)), Some(Effect::Answer(Reply::Done)));
}

/// Line ends, Tab, Esc and letters answer nothing; Enter tells what does.
#[test]
fn no_key_of_a_scanner_files_an_answer() {
    let mut scene = asked(Lang::En, question(volts(), true));
    scene.types("5");
    for key in [Key::Enter, Key::Tab, Key::Esc, Key::Char('n'), Key::Ctrl('j'), Key::F(5)] {
        assert_eq!(scene.key(key), None, "{key:?}");
        assert!(scene.model.run.as_ref().is_some_and(|run| run.prompt.is_some()), "{key:?}");
    }
    let mut scene = asked(Lang::En, question(volts(), true));
    scene.key(Key::Enter);
    assert_eq!(message(&scene), "F2 takes the answer.");
}

/// What is no answer stays, with the reason in the language of the screen.
#[test]
fn what_is_no_answer_is_told_at_once() {
    let choices = QuestionKind::Choice { of: vec!["clean".into(), "worn".into()] };
    for (kind, typed, part) in [
        (volts(), "", ""),
        (volts(), "abc", "abc"),
        (volts(), "nan", "nan"),
        (volts(), "inf", "inf"),
        (volts(), "1e999", "1e999"),
        (volts(), "9007199254740993", "9007199254740993"),
        (volts(), "1,234", "1234"),
        (volts(), "3.3 A", "V"),
        (gps(), "GPS-1", "GPS-[0-9]{5}"),
        (choices, "dirty", "clean, worn"),
    ] {
        let mut told = Vec::new();
        for lang in Lang::ALL {
            let mut scene = asked(lang, question(kind.clone(), false));
            pastes(&mut scene, typed);
            assert_eq!(scene.key(Key::F(2)), None, "{lang:?} {typed:?}");
            let said = message(&scene);
            assert!(!said.is_empty() && said.contains(part) && !said.contains("{}"), "{lang:?} {typed:?}: {said}");
            assert!(scene.model.run.as_ref().is_some_and(|run| run.prompt.is_some()), "{lang:?} {typed:?}");
            told.push(said);
        }
        assert!(told[0] != told[1] && told[1] != told[2], "{told:?}");
        assert!(!told[1].contains(" is ") && !told[2].contains(" is "), "{told:?}");
    }
}

#[test]
fn f6_goes_back_and_f7_gives_up() {
    let mut first = asked(Lang::En, question(volts(), false));
    assert_eq!(first.key(Key::F(6)), None);
    assert!(message(&first).contains("no question before"), "{}", message(&first));
    assert_eq!(first.key(Key::F(7)), Some(Effect::Answer(Reply::NotPossible)));
    let mut second = asked(Lang::En, question(volts(), true));
    second.types("4.9");
    assert_eq!(second.key(Key::F(6)), Some(Effect::Answer(Reply::Back)));
    let mut over = asked(Lang::En, Ask::LookOver(vec![("tp4".into(), "5.01 V".into())]));
    assert!(over.text().contains("tp4: 5.01 V"), "{}", over.text());
    assert_eq!(over.key(Key::F(6)), Some(Effect::Answer(Reply::Back)));
    let mut right = asked(Lang::En, Ask::LookOver(vec![("tp4".into(), "5.01 V".into())]));
    assert_eq!(right.key(Key::F(2)), Some(Effect::Answer(Reply::Done)));
}

#[test]
fn arrows_choose() {
    let choices = || QuestionKind::Choice { of: vec!["clean".into(), "worn".into(), "scratched".into()] };
    for (keys, expected) in [
        (vec![Key::Down], "clean"),
        (vec![Key::Down, Key::Down], "worn"),
        (vec![Key::Down, Key::Down, Key::Down, Key::Down, Key::Up], "worn"),
        (vec![Key::Up], "clean"),
    ] {
        let mut scene = asked(Lang::En, question(choices(), false));
        keys.iter().for_each(|key| drop(scene.key(*key)));
        assert_eq!(scene.key(Key::F(2)), text(expected), "{keys:?}");
    }
}

/// A person may go away for an hour: the screen waits, and says how long.
#[test]
fn a_question_waits() {
    let mut scene = asked(Lang::En, question(volts(), false));
    scene.types("4.9");
    scene.pass_time(Duration::from_secs(3600));
    let text_of_screen = scene.text();
    assert!(text_of_screen.contains("asked 60 min ago") || text_of_screen.contains("asked 1 h"), "{text_of_screen}");
    assert_eq!(scene.key(Key::F(2)), text("4.9"));
}

/// The screen asks in its own language, with unit, limit and the path of the picture, and nothing of it is cut off.
#[test]
fn a_question_is_asked_in_the_language_of_the_screen() {
    let letters = |text: &str| text.chars().filter(|c| c.is_alphanumeric()).collect::<String>();
    let choices = || QuestionKind::Choice { of: vec!["clean".into(), "worn".into()] };
    for lang in Lang::ALL {
        for (width, height) in SIZES.into_iter().chain([(80, 23), (80, 16), (60, 16)]) {
            for (kind, parts) in [
                (volts(), vec!["V", "4.9 .. 5.1 V", "plans/tp4.png"]),
                (gps(), vec!["=~ GPS-[0-9]{5}", "plans/tp4.png"]),
                (choices(), vec!["1 clean, 2 worn", "== clean"]),
                (QuestionKind::Done, vec!["plans/tp4.png"]),
            ] {
                let ask = question(kind, true);
                let mut scene = asked(lang, ask.clone());
                scene.resize(width, height);
                pastes(&mut scene, "47");
                let text = scene.text();
                let words = text.lines().filter_map(|line| line.split_once('║')?.1.rsplit_once('║'));
                let shown: String = words.map(|(words, _)| letters(words)).collect();
                let said = (lang.texts().ask)(&ask);
                assert!(shown.contains(&letters(&said)), "{lang:?} {width}x{height}: {text}");
                for part in parts.iter().chain(&["F2", "TP4"]) {
                    assert!(said.contains(part), "{lang:?}: no {part} in {said}");
                }
                if matches!(&ask, Ask::Question(asked) if asked.question.kind != QuestionKind::Done) {
                    assert!(text.contains("47_"), "{lang:?} {width}x{height}: {text}");
                }
                let english =
                    [" the ", "Press", "Picture", "Limit", "number"].iter().find(|word| said.contains(**word));
                assert!(lang == Lang::En || english.is_none(), "{lang:?}: {said}");
            }
        }
    }
}

/// A plan that has no words of the language asks in English.
#[test]
fn a_question_without_a_translation_is_asked_in_english() {
    let Ask::Question(asked) = question(volts(), false) else { return };
    let words = QuestionWords { zh: None, ru: None, ..asked.question.words.clone() };
    let question = Arc::new(Question { words, ..(*asked.question).clone() });
    let ask = Ask::Question(Box::new(QuestionAsked { question, ..*asked }));
    for lang in Lang::ALL {
        assert!((lang.texts().ask)(&ask).starts_with("What does the meter at TP4 read?"), "{lang:?}");
    }
}

/// A scan that was cut off is told beside the answer, and no scan goes without a word.
#[test]
fn a_scan_that_was_cut_off_is_told_beside_the_answer() {
    let unended = |scene: &mut Scene, code: &str| {
        scene.tell(Msg::Scan(Scanned { bytes: code.into(), ..Scanned::default() }));
    };
    for lang in Lang::ALL {
        let texts = lang.texts();
        let cut = |code: &str| texts.answer_cut.replace("{}", code);
        let dropped = |code: &str| texts.not_used.replacen("{}", code, 1).replace("{}", "");
        // A scanner without line ends is no reason for a warning.
        let mut without = asked(lang, question(gps(), false));
        unended(&mut without, "GPS-00042");
        assert!(!message(&without).contains(&cut("GPS-00042")), "{lang:?}: {}", message(&without));
        assert_eq!(without.key(Key::F(2)), text("GPS-00042"));
        // The scanner sends line ends otherwise: it has scanned a module, or an answer.
        for before in [false, true] {
            let mut scene = scene(lang);
            if before {
                scene.scans("DEMO-9\r");
            }
            scene.start("DEMO-1");
            scene.tell(Msg::Asked { item: "by-hand".into(), ask: question(gps(), false) });
            if !before {
                scene.scans("GPS-00042\r");
            }
            let earlier =
                scene.model.run.as_ref().and_then(|run| run.prompt.as_ref()).map(|each| each.typed.text().to_owned());
            unended(&mut scene, "GPS-");
            let told = message(&scene);
            assert!(told.contains(&cut("GPS-")), "{lang:?} {before}: {told}");
            let earlier = earlier.filter(|earlier| !earlier.is_empty());
            assert_eq!(told.contains(dropped("GPS-00042").trim()), earlier.is_some(), "{lang:?} {before}: {told}");
            // The rest of it comes by itself.
            unended(&mut scene, "00042");
            let told = message(&scene);
            assert!(told.contains(dropped("GPS-").trim()) && told.contains(&cut("00042")), "{lang:?} {before}: {told}");
            // A whole scan of the label is right, and says what went for it.
            scene.scans("GPS-00042\r");
            let told = message(&scene);
            assert!(told.contains(dropped("00042").trim()) && !told.contains(&cut("")), "{lang:?} {before}: {told}");
            assert_eq!(scene.key(Key::F(2)), text("GPS-00042"));
        }
        // Without line ends, too, a second piece does not replace the first silently; the same code again is nothing new.
        let mut pieces = asked(lang, question(gps(), false));
        for code in ["GPS-", "00042"] {
            unended(&mut pieces, code);
        }
        assert!(message(&pieces).contains(dropped("GPS-").trim()), "{lang:?}: {}", message(&pieces));
        let mut again = asked(lang, question(gps(), false));
        let before = message(&again);
        for _ in 0..2 {
            unended(&mut again, "GPS-00042");
        }
        assert_eq!(message(&again), before, "{lang:?}");
    }
}
