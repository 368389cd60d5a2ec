//! Numbers of orders and sub-units on the screen: scanned and typed, kept and asked for.

use std::sync::Arc;

use gnc_executive::event::NoteLevel;
use gnc_executive::numbers::{NumberField, NumberKind, NumberLabel};
use gnc_executive::serial_number::SerialNumberPattern;

use super::*;
use crate::tui::input::Scanned;
use crate::tui::model::{Loaded, PlanAsks};

fn field(key: &str, kind: NumberKind, pattern: Option<&str>, required: bool) -> NumberField {
    let label = NumberLabel { en: format!("The {key}"), zh: format!("中{key}"), ru: format!("Ж{key}") };
    let pattern = pattern.map(|text| SerialNumberPattern::new(text).expect("a pattern"));
    NumberField { key: key.into(), kind, label, pattern, required }
}

/// A screen whose plan asks for an order and a sub-unit, and whose bench for a note.
fn scene(lang: Lang) -> Scene {
    let mut scene = Scene::new(lang, 80, 24).expect("a scene");
    let Loaded::Ready(plan) = &mut scene.model.plan else { panic!("a plan") };
    let numbers = vec![
        field("order", NumberKind::Order, Some("PO-[0-9]{4}"), true),
        field("gps", NumberKind::Subunit, Some("GB-[0-9]+"), false),
    ];
    plan.asks = Arc::new(PlanAsks { numbers, ..PlanAsks::default() });
    let Loaded::Ready(bench) = &mut scene.model.bench else { panic!("a bench") };
    bench.numbers = [field("tray", NumberKind::Free, None, false)].into();
    scene
}

fn scan(scene: &mut Scene, code: &str) {
    scene.tell(Msg::Scan(Scanned { bytes: code.as_bytes().to_vec(), ended: true, ..Scanned::default() }));
}

/// What a run would be given.
fn given(scene: &Scene) -> Vec<(String, String)> {
    scene.model.numbers.of(&scene.model.asked_numbers())
}

fn pairs(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
    pairs.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect()
}

#[test]
fn a_scan_that_fits_one_pattern_goes_to_that_number() {
    for lang in Lang::ALL {
        let mut scene = scene(lang);
        scan(&mut scene, "SN-1");
        // The name of the symbology and white space around a code are no part of it.
        scan(&mut scene, "]C1PO-1234 ");
        assert!(scene.text().contains("PO-1234"), "{lang:?}: {}", scene.text());
        scan(&mut scene, "GB-7");
        assert_eq!(scene.model.scan.current.as_deref(), Some("SN-1"));
        assert_eq!(given(&scene), pairs(&[("order", "PO-1234"), ("gps", "GB-7")]));
    }
}

#[test]
fn a_scan_that_fits_two_patterns_is_the_serial_number() {
    let mut scene = scene(Lang::En);
    let Loaded::Ready(plan) = &mut scene.model.plan else { panic!("a plan") };
    plan.serial_number = Some(SerialNumberPattern::new("[A-Z]+-[0-9]+").expect("a pattern"));
    scan(&mut scene, "GB-7");
    assert_eq!((scene.model.scan.current.as_deref(), given(&scene)), (Some("GB-7"), Vec::new()));
}

#[test]
fn an_order_stays_and_a_sub_unit_is_of_one_module() {
    let mut scene = scene(Lang::En);
    for code in ["SN-1", "PO-1234", "GB-7"] {
        scan(&mut scene, code);
    }
    // The same module again keeps its sub-unit, another one has none.
    scan(&mut scene, "SN-1");
    assert_eq!(given(&scene).len(), 2);
    scan(&mut scene, "SN-2");
    assert_eq!(given(&scene), pairs(&[("order", "PO-1234")]));
    scan(&mut scene, "PO-0001");
    assert_eq!(given(&scene), pairs(&[("order", "PO-0001")]));
}

#[test]
fn what_is_scanned_during_a_run_is_of_the_next_module() {
    let mut scene = scene(Lang::En);
    scan(&mut scene, "PO-1234");
    scene.start("SN-1");
    scan(&mut scene, "SN-2");
    scan(&mut scene, "GB-8");
    assert_eq!(given(&scene), pairs(&[("order", "PO-1234")]));
    scene.run_ends(Outcome::Passed);
    scene.key(Key::F(5));
    assert_eq!(scene.model.scan.current.as_deref(), Some("SN-2"));
    assert_eq!(given(&scene), pairs(&[("order", "PO-1234"), ("gps", "GB-8")]));
}

#[test]
fn a_required_number_is_asked_for_before_a_run() {
    for lang in Lang::ALL {
        let mut scene = scene(lang);
        scan(&mut scene, "SN-1");
        let effect = scene.key(Key::F(5));
        assert!(!matches!(effect, Some(Effect::Prepare { .. })), "{lang:?}: {effect:?}");
        let label = match lang {
            Lang::En => "The order",
            Lang::Zh => "中order",
            Lang::Ru => "Жorder",
        };
        let text = scene.text();
        assert_eq!(text.matches(label).count(), 2, "the line of the form and the message, {lang:?}: {text}");
        // A scan goes to its number while the form is open, and the form shows it.
        scan(&mut scene, "PO-1234");
        assert!(scene.text().matches("PO-1234").count() >= 2, "{}", scene.text());
        scene.key(Key::Enter);
        assert_eq!(given(&scene), pairs(&[("order", "PO-1234")]));
        assert!(matches!(scene.key(Key::F(5)), Some(Effect::Prepare { .. })), "{lang:?}");
    }
}

#[test]
fn a_typed_number_that_does_not_fit_is_refused_with_the_pattern() {
    let mut scene = scene(Lang::En);
    scan(&mut scene, "SN-1");
    scene.key(Key::F(5));
    for character in "PO-1".chars() {
        scene.key(Key::Char(character));
    }
    scene.key(Key::Enter);
    let text = scene.text();
    assert!(text.contains("PO-1 does not fit PO-[0-9]{4}"), "{text}");
    for character in "234".chars() {
        scene.key(Key::Char(character));
    }
    scene.key(Key::Enter);
    assert_eq!(given(&scene), pairs(&[("order", "PO-1234")]));
}

#[test]
fn a_number_that_the_plan_does_not_ask_for_is_not_given() {
    let mut scene = scene(Lang::En);
    scan(&mut scene, "PO-1234");
    let Loaded::Ready(plan) = &mut scene.model.plan else { panic!("a plan") };
    plan.asks = Arc::default();
    assert_eq!(given(&scene), []);
}

#[test]
fn a_sub_unit_of_another_module_is_told_on_the_screen() {
    let mut scene = scene(Lang::En);
    scan(&mut scene, "SN-2");
    scan(&mut scene, "PO-1234");
    scan(&mut scene, "GB-7");
    scene.start("SN-2");
    let text = "The gps GB-7 is in module SN-1 too, which passed with it".to_owned();
    scene.event(EventKind::Note { level: NoteLevel::Warning, text, item: None });
    assert!(scene.text().contains("GB-7 is in module SN-1 too"), "{}", scene.text());
}
