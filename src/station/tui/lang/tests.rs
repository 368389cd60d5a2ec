use std::collections::BTreeSet;

use gnc_bench::fixture::{Ask, SwitchReading, TakenOver};
use gnc_rig::{Along, Orientation};

use super::*;
use crate::phrases::in_language;
use crate::tui::keymap::{BINDINGS, KeyContext, bindings, name};
use crate::tui::view::text_width;

/// All texts of a language: fields, keys, then outcomes, in the same order for each language.
fn all(lang: Lang) -> Vec<String> {
    let texts = lang.texts();
    // The texts that are fields, as `Debug` prints them: names of fields with their values.
    let printed = format!("{texts:#?}");
    let fields = printed.lines().filter_map(|line| line.trim().split_once(": \""));
    let fields = fields.map(|(_, value)| value.trim_end_matches(',').trim_end_matches('"').to_owned());
    let actions = BINDINGS.iter().map(|binding| (texts.key)(binding.action));
    let keys = actions.flat_map(|key| [key.short.to_owned(), key.long.to_owned()]);
    let outcomes = Outcome::ALL.into_iter().map(|outcome| (texts.outcome_word)(outcome).to_owned());
    fields.chain(keys).chain(outcomes).collect()
}

#[test]
fn no_text_is_missing() {
    for lang in Lang::ALL {
        let texts = all(lang);
        assert!(texts.len() > 150, "{lang:?} has {} texts", texts.len());
        assert!(texts.iter().all(|text| !text.trim().is_empty()), "{lang:?} has an empty text");
    }
}

/// Each text has the same places to fill in in every language.
#[test]
fn places_to_fill_in_agree() {
    let holes = |lang| all(lang).iter().map(|text| text.matches("{}").count()).collect::<Vec<_>>();
    let english = all(Lang::En);
    for lang in [Lang::Zh, Lang::Ru] {
        for ((text, wanted), found) in english.iter().zip(holes(Lang::En)).zip(holes(lang)) {
            assert_eq!(found, wanted, "{lang:?}: {text}");
        }
    }
}

/// A text that was left in English has no letter of the language.
#[test]
fn nothing_is_left_in_english() {
    let own = |lang: Lang, text: &str| match lang {
        Lang::En => true,
        Lang::Zh => text.chars().any(|c| ('\u{4e00}'..='\u{9fff}').contains(&c)),
        Lang::Ru => text.chars().any(|c| ('\u{400}'..='\u{4ff}').contains(&c)),
    };
    // Names of keys and orders of numbers.
    let same = ["PgUp", "PgDn", "{} из {}"];
    for lang in [Lang::Zh, Lang::Ru] {
        for text in all(lang) {
            assert!(own(lang, &text) || same.contains(&text.as_str()), "{lang:?}: {text}");
        }
        for item in ItemId::ALL {
            for measurement in item.spec().measurements {
                let sentence = (lang.texts().look_at_sentence)(measurement.look_at);
                assert!(own(lang, sentence), "{lang:?} of {item}: {sentence}");
            }
        }
    }
}

/// Every request says the same in every language: all its numbers, and the key. In English it is the text of the
/// log but for the key.
#[test]
fn requests_say_the_same_in_every_language() {
    let up = Orientation::Axis { axis: 0, positive: false, along: Along::Up, heading_deg: 90.0 };
    let still =
        vec![SwitchReading { switch: 2, on: true, volt: 3.306 }, SwitchReading { switch: 4, on: false, volt: 1.998 }];
    let over = TakenOver { taken: vec!["x+".into(), "x-".into()], left: vec!["y+".into()] };
    let asks: [(Ask, &[&str]); 10] = [
        (Ask::Switches(None), &["OFF"]),
        (Ask::Switches(Some(3)), &["3", "ON", "OFF"]),
        (Ask::SwitchesAgain { on: Some(4), still }, &["2", "3.306", "4", "1.998", "ON", "OFF"]),
        (Ask::Heading { deg: 120.0 }, &["120"]),
        (Ask::Lay(up), &["-X", "+Y", "90"]),
        (
            Ask::Turn { orientation: Some(up), angle_deg: -1080.0, span_s: 5.0, ramp_s: 0.5 },
            &["-1080", "+X", "0.5 s", "240 deg/s", "480 deg/s^2", "5 s", "400 deg/s"],
        ),
        (Ask::Spin { orientation: Some(up), rate_dps: 5400.0 }, &["+5400 deg/s", "+X"]),
        (Ask::StopTable, &[]),
        (Ask::Words("Close the lid.".into()), &["Close the lid."]),
        (Ask::Resumed { over, next: Box::new(Ask::Lay(up)) }, &["x+, x-", "y+", "-X", "90"]),
    ];
    for lang in Lang::ALL {
        for (ask, parts) in &asks {
            let said = (lang.texts().ask)(ask);
            for part in parts.iter().chain(&["F2"]) {
                assert!(said.contains(part), "{lang:?}: no {part} in {said}");
            }
            assert!(!said.contains("{}"), "{lang:?}: {said}");
            let words = matches!(ask, Ask::Words(_));
            assert!(lang == Lang::En || words || !said.contains(" the "), "{lang:?}: {said}");
        }
    }
    for (ask, _) in &asks {
        assert_eq!((Lang::En.texts().ask)(ask), ask.with_key("F2"));
    }
}

#[test]
fn items_have_titles_of_their_own() {
    for lang in Lang::ALL {
        let titles: BTreeSet<&str> = ItemId::ALL.into_iter().map(lang.texts().item_title).collect();
        assert_eq!(titles.len(), ItemId::ALL.len(), "{lang:?}");
    }
}

/// The last line of the screen has room for the keys of every place.
#[test]
fn keys_fit_into_the_last_line() {
    for lang in Lang::ALL {
        for place in KeyContext::ALL.iter().copied() {
            let shown = bindings(place).filter(|binding| binding.footer);
            let width: usize = shown
                .map(|binding| {
                    text_width(&name(binding.key)) + text_width((lang.texts().key)(binding.action).short) + 1
                })
                .sum();
            assert!(width <= 80, "{lang:?} {place:?}: {width} cells");
        }
    }
}

/// A verdict is one word of at most six letters. Each letter can be drawn, and all verdicts look different.
#[test]
fn verdicts_can_be_drawn() {
    for lang in Lang::ALL {
        let judged = [Outcome::Passed, Outcome::Marginal, Outcome::Failed, Outcome::Errored, Outcome::Aborted];
        let partial = Verdict::Selection(Outcome::Passed);
        let all = judged.into_iter().map(Verdict::Module).chain([partial]);
        let words: BTreeSet<&str> = all.map(lang.texts().verdict).collect();
        assert_eq!(words.len(), judged.len() + 1, "{lang:?}");
        for word in words {
            assert!(word.chars().count() <= 6 && crate::tui::view::can_draw(word), "{lang:?}: {word}");
        }
    }
}

#[test]
fn locales_choose_languages() {
    for (locale, lang) in
        [("zh_CN.UTF-8", Lang::Zh), ("ru", Lang::Ru), ("de_DE", Lang::En), ("", Lang::En), ("C", Lang::En)]
    {
        assert_eq!(Lang::of_locale(locale), lang, "{locale}");
    }
}

#[test]
fn parts_are_filled_in_in_order() {
    assert_eq!(fill("{} of {}", &["1", "2"]), "1 of 2");
    assert_eq!(fill("{} and {}", &["1"]), "1 and ");
    assert_eq!(fill("nothing", &["1"]), "nothing");
}

/// The screen says of a module what `--auto` and the lists say, with no English left.
#[test]
fn the_standing_is_the_same_on_every_face() {
    use gnc_executive::event::BenchKind;
    use gnc_executive::standing::{Flaw, PastRun, Standing};
    let run = |plan: &str, items: Option<usize>, flaws: Vec<Flaw>| PastRun {
        at: Some(chrono::DateTime::UNIX_EPOCH.fixed_offset()),
        plan: plan.into(),
        verdict: Some(Verdict::new(Outcome::Passed, items.is_some())),
        items: items.map(|items| (0..items).map(|item| format!("item-{item}")).collect()),
        bench: match (flaws.contains(&Flaw::Simulated), flaws.contains(&Flaw::Unproven)) {
            (true, _) => BenchKind::Simulated,
            (_, true) => BenchKind::Unproven,
            _ => BenchKind::Real,
        },
        is_broken: false,
        flaws,
    };
    let standing = |counts: Option<PastRun>, beside: Option<PastRun>| Standing { plan: "f".into(), counts, beside };
    let flaws = [
        Flaw::Missing,
        Flaw::Unreadable,
        Flaw::UnderWay,
        Flaw::NotClosed,
        Flaw::Interrupted,
        Flaw::NotInChain,
        Flaw::ClosedLate,
        Flaw::LinesMissing,
        Flaw::Changed,
        Flaw::Unsigned,
        Flaw::Unwitnessed,
        Flaw::Simulated,
        Flaw::Unproven,
        Flaw::Rejudged,
        Flaw::OtherPlan,
        Flaw::OtherVersion,
        Flaw::Selection,
        Flaw::NoVerdict,
        Flaw::TooOld,
        Flaw::InFuture,
        Flaw::Exchanged,
        Flaw::ExchangedAfterFailure,
    ];
    let mut all = vec![
        standing(None, None),
        standing(Some(run("f", None, Vec::new())), None),
        standing(
            Some(PastRun { bench: BenchKind::Simulated, ..run("f", None, Vec::new()) }),
            Some(run("f", Some(3), vec![])),
        ),
        standing(None, Some(run("g", Some(4), vec![Flaw::OtherPlan, Flaw::Simulated]))),
        standing(None, Some(PastRun { at: None, verdict: None, ..run("f\u{1b}", None, vec![Flaw::Unreadable]) })),
    ];
    all.extend(flaws.map(|flaw| standing(None, Some(run("f", None, vec![flaw])))));
    all.push(standing(None, Some(run("f", None, vec![Flaw::NotInChain, Flaw::Simulated, Flaw::Rejudged]))));
    for lang in [Lang::Zh, Lang::Ru] {
        let told: Vec<String> =
            all.iter().map(|standing| in_language(&standing.to_string(), lang).into_owned()).collect();
        for (told, english) in told.iter().zip(&all) {
            let words = told.split(|c: char| !c.is_ascii_alphabetic());
            let left: Vec<&str> = words.filter(|word| word.len() > 1 && !matches!(*word, "item")).collect();
            assert!(left.is_empty(), "{lang:?}: {told} for {english}");
        }
        // Every language tells them apart.
        let told: BTreeSet<String> = told.into_iter().collect();
        let english: BTreeSet<String> = all.iter().map(ToString::to_string).collect();
        assert_eq!(told.len(), english.len(), "{lang:?}");
    }
}
