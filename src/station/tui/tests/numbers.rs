//! Numbers of orders and sub-units on the screen: scanned and typed, kept and asked for.

use std::sync::Arc;

use gnc_executive::event::NoteLevel;
use gnc_executive::numbers::{NumberField, NumberKind, NumberLabel};
use gnc_executive::serial_number::SerialNumberPattern;

use super::*;
use crate::tui::input::Scanned;
use crate::tui::model::{Loaded, PlanAsks, PlanView};

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

/// An order stays for the shift, also if modules are scanned while no plan is at hand, or one that does not ask for it.
#[test]
fn an_order_stays_whatever_plan_is_shown() {
    let other = || {
        let mut other = Scene::new(Lang::En, 80, 24).expect("a scene");
        std::mem::replace(&mut other.model.plan, Loaded::Loading)
    };
    let between: [fn() -> Loaded<PlanView>; 3] =
        [|| Loaded::Loading, || Loaded::Refused("it has a mistake".into()), other];
    for (index, between) in between.into_iter().enumerate() {
        let mut scene = scene(Lang::En);
        for code in ["SN-1", "PO-1234", "GB-7"] {
            scan(&mut scene, code);
        }
        let plan = std::mem::replace(&mut scene.model.plan, between());
        scan(&mut scene, "SN-2");
        assert_eq!(given(&scene), [], "{index}: nobody asks for it");
        scene.model.plan = plan;
        assert_eq!(given(&scene), pairs(&[("order", "PO-1234")]), "{index}");
        scan(&mut scene, "SN-3");
        assert_eq!(given(&scene), pairs(&[("order", "PO-1234")]), "{index}");
        assert!(matches!(scene.key(Key::F(5)), Some(Effect::Prepare { .. })), "{index}: the order is there");
    }
    // The same holds of an order of the command line, which came before any plan.
    let mut scene = scene(Lang::En);
    scene.model.numbers = crate::tui::numbers::Numbers::new(pairs(&[("order", "PO-1234"), ("gps", "GB-7")]), false);
    let plan = std::mem::replace(&mut scene.model.plan, Loaded::Loading);
    scan(&mut scene, "SN-2");
    scene.model.plan = plan;
    assert_eq!(given(&scene), pairs(&[("order", "PO-1234")]));
}

/// Writes the order into the form of F2, in place of what is there.
fn write_order(scene: &mut Scene, order: &str) {
    use crate::tui::model::Over;
    use crate::tui::setup_form::{Form, FormLine};
    scene.model.over.push(Over::Setup(Form::new(&scene.model)));
    let Some(Over::Setup(form)) = scene.model.over.last_mut() else { panic!("the form") };
    // The note of the bench stands before it.
    form.line = form.lines().iter().position(|line| *line == FormLine::Number(1)).expect("a line");
    (0..9).for_each(|_| drop(scene.key(Key::Backspace)));
    scene.types(order);
    scene.key(Key::Enter);
    assert!(scene.model.over.is_empty(), "{}", scene.text());
}

/// What the form says of the order during a run, or while the next module waits, holds for the next module.
#[test]
fn an_order_of_the_form_counts_for_the_next_module() {
    for during in [true, false] {
        for (scanned, written) in [("", ""), ("", "PO-0003"), ("PO-0002", ""), ("PO-0002", "PO-0003")] {
            let mut scene = scene(Lang::En);
            scan(&mut scene, "PO-0001");
            scene.start("SN-1");
            scan(&mut scene, "SN-2");
            if !scanned.is_empty() {
                scan(&mut scene, scanned);
            }
            if !during {
                scene.run_ends(Outcome::Passed);
            }
            write_order(&mut scene, written);
            assert_eq!(given(&scene), pairs(&[("order", "PO-0001")]), "the module on the screen keeps its own");
            if during {
                scene.run_ends(Outcome::Passed);
            }
            scene.key(Key::F(5));
            assert_eq!(scene.model.scan.current.as_deref(), Some("SN-2"));
            let expected = if written.is_empty() { Vec::new() } else { pairs(&[("order", written)]) };
            assert_eq!(given(&scene), expected, "{during} {scanned:?} {written:?}");
        }
    }
    // The form shows what it would change, and an order that is corrected between two modules is the last word.
    let mut scene = scene(Lang::En);
    scan(&mut scene, "PO-0001");
    scene.start("SN-1");
    scan(&mut scene, "PO-0002");
    scene.run_ends(Outcome::Passed);
    write_order(&mut scene, "PO-0003");
    scan(&mut scene, "SN-2");
    assert_eq!(given(&scene), pairs(&[("order", "PO-0003")]));
}

/// A sub-unit goes to the module that was scanned before it, whatever waits and whatever the form shows.
#[test]
fn a_sub_unit_is_of_the_module_that_was_scanned_before_it() {
    // The next module was scanned during the run, its sub-unit after it.
    let mut waiting = scene(Lang::En);
    scan(&mut waiting, "PO-1234");
    waiting.start("SN-1");
    scan(&mut waiting, "SN-2");
    waiting.run_ends(Outcome::Passed);
    scan(&mut waiting, "GB-8");
    waiting.key(Key::F(5));
    assert_eq!(given(&waiting), pairs(&[("order", "PO-1234"), ("gps", "GB-8")]));
    // Another module comes in place of the next one.
    let mut instead = scene(Lang::En);
    scan(&mut instead, "PO-1234");
    instead.start("SN-1");
    assert!(instead.model.is_running());
    for code in ["SN-2", "GB-8", "SN-3"] {
        scan(&mut instead, code);
    }
    instead.run_ends(Outcome::Passed);
    instead.key(Key::F(5));
    assert_eq!(instead.model.scan.current.as_deref(), Some("SN-3"));
    assert_eq!(given(&instead), pairs(&[("order", "PO-1234")]));
    // The form is open while another module is scanned.
    let mut form = scene(Lang::En);
    for code in ["SN-1", "GB-7", "PO-1234"] {
        scan(&mut form, code);
    }
    form.key(Key::F(2));
    scan(&mut form, "SN-2");
    // The message says that it is not used, and the form has it no more.
    assert!(!form.text().replacen("GB-7 is not used.", "", 1).contains("GB-7"), "{}", form.text());
    form.key(Key::Enter);
    assert_eq!(given(&form), pairs(&[("order", "PO-1234")]));
}

fn unended(scene: &mut Scene, code: &str) -> Option<Effect> {
    scene.tell(Msg::Scan(Scanned { bytes: code.as_bytes().to_vec(), ..Scanned::default() }))
}

/// A scanner without line ends: a scan is over when the next one begins.
#[test]
fn two_scans_without_line_ends_are_both_taken() {
    let mut idle = scene(Lang::En);
    scan(&mut idle, "PO-1234");
    idle.model.scan.has_ends = false;
    idle.start("SN-1");
    idle.run_ends(Outcome::Passed);
    unended(&mut idle, "SN-2");
    assert_eq!(unended(&mut idle, "GB-8"), Some(Effect::LookUp("SN-2".into())));
    assert!(matches!(idle.key(Key::F(5)), Some(Effect::Prepare { serial_number, .. }) if serial_number == "SN-2"));
    assert_eq!(given(&idle), pairs(&[("order", "PO-1234"), ("gps", "GB-8")]));
    // The same during a run, and if the second one began as keys.
    let mut running = scene(Lang::En);
    scan(&mut running, "PO-1234");
    running.model.scan.has_ends = false;
    running.start("SN-1");
    assert!(running.model.is_running());
    unended(&mut running, "SN-2");
    running.key(Key::Char('G'));
    running.tell(Msg::Scan(Scanned { bytes: b"B-8".to_vec(), taken_back: 1, ..Scanned::default() }));
    assert_eq!(running.model.scan.next.as_deref(), Some("SN-2"));
    running.run_ends(Outcome::Passed);
    running.key(Key::F(5));
    assert_eq!(running.model.scan.current.as_deref(), Some("SN-2"));
    assert_eq!(given(&running), pairs(&[("order", "PO-1234"), ("gps", "GB-8")]));
    // A second scanner, at the serial port, has line ends.
    let mut mixed = scene(Lang::En);
    scan(&mut mixed, "SN-1");
    mixed.model.scan.has_ends = false;
    unended(&mut mixed, "SN-2");
    scan(&mut mixed, "GB-8");
    assert_eq!((mixed.model.scan.current.as_deref(), given(&mixed)), (Some("SN-2"), pairs(&[("gps", "GB-8")])));
}

/// What was scanned and is not taken is told: after a number that does not fit, after one that was cut off, and beside a scan
/// that cannot be read.
#[test]
fn no_scan_goes_without_a_word() {
    for lang in Lang::ALL {
        let told = |code: &str| lang.texts().not_used.replacen("{}", code, 1).replace("{}", "");
        let mut misfit = scene(lang);
        let Loaded::Ready(plan) = &mut misfit.model.plan else { panic!("a plan") };
        plan.serial_number = Some(SerialNumberPattern::new("SN-[0-9]").expect("a pattern"));
        scan(&mut misfit, "SN-1");
        misfit.model.scan.has_ends = false;
        unended(&mut misfit, "SN-22");
        assert_eq!(unended(&mut misfit, "GB-8"), None);
        let text = misfit.text();
        assert!(text.contains(told("GB-8").trim()) && text.contains("SN-22"), "{lang:?}: {text}");
        assert_eq!((given(&misfit), misfit.model.scan.typed.is_empty()), (Vec::new(), true), "{lang:?}");
        for ended in [false, true] {
            let mut cut = scene(lang);
            scan(&mut cut, "SN-1");
            unended(&mut cut, "SN-2");
            cut.tell(Msg::Scan(Scanned { bytes: b"GB-8".to_vec(), ended, ..Scanned::default() }));
            let text = cut.text();
            assert!(text.contains(told("SN-2").trim()) && text.contains("GB-8"), "{lang:?} {ended}: {text}");
        }
        let mut unread = scene(lang);
        unended(&mut unread, "SN-2");
        scan(&mut unread, "GB\u{1d}8");
        assert_eq!(unread.key(Key::Enter), Some(Effect::LookUp("SN-2".into())), "{lang:?}: it waits still");
    }
}

/// A sub-unit that was scanned before its module, or while the verdict of the module before is shown, goes to the module that is
/// tested next.
#[test]
fn a_sub_unit_that_comes_first_is_of_the_module_that_comes() {
    let mut first = scene(Lang::En);
    scan(&mut first, "GB-77");
    scan(&mut first, "PO-1234");
    scan(&mut first, "SN-0050");
    assert_eq!(given(&first), pairs(&[("gps", "GB-77"), ("order", "PO-1234")]));
    // It is of that module then, and of no other one.
    first.key(Key::F(5));
    scan(&mut first, "SN-0051");
    assert_eq!(given(&first), pairs(&[("order", "PO-1234")]));
    let mut second = scene(Lang::En);
    scan(&mut second, "PO-1234");
    second.start("SN-0049");
    second.run_ends(Outcome::Passed);
    scan(&mut second, "GB-77");
    scan(&mut second, "SN-0050");
    assert_eq!(given(&second), pairs(&[("order", "PO-1234"), ("gps", "GB-77")]));
    assert!(second.text().contains("SN-0050: F5 starts the test."), "{}", second.text());
    second.start("SN-0050");
    second.run_ends(Outcome::Passed);
    scan(&mut second, "SN-0051");
    assert_eq!(given(&second), pairs(&[("order", "PO-1234")]), "the run has had it");
    assert!(!second.text().contains("not used"), "{}", second.text());
}

/// Whatever was taken and no run will have is told: a number of a module that gives way to another one, and that module.
#[test]
fn nothing_that_was_taken_goes_without_a_word() {
    for lang in Lang::ALL {
        let told = |code: &str| lang.texts().not_used.replacen("{}", code, 1).replace("{}", "").trim().to_owned();
        let mut idle = scene(lang);
        for code in ["SN-1", "GB-7", "SN-2"] {
            scan(&mut idle, code);
        }
        assert!(idle.text().contains(&told("GB-7")), "{lang:?}: {}", idle.text());
        let mut during = scene(lang);
        scan(&mut during, "PO-1234");
        during.start("SN-1");
        for code in ["SN-0131", "GB-7", "SN-0132"] {
            scan(&mut during, code);
        }
        assert_eq!(during.model.scan.next.as_deref(), Some("SN-0132"));
        assert!(during.text().contains(&told("SN-0131, GB-7")), "{lang:?}: {}", during.text());
        during.run_ends(Outcome::Passed);
        scan(&mut during, "SN-0078");
        assert!(during.text().contains(&told("SN-0132")), "{lang:?}: {}", during.text());
        assert_eq!(during.model.scan.current.as_deref(), Some("SN-0078"));
        // The same number twice is one number.
        scan(&mut during, "SN-0078");
        assert!(!during.text().contains(&told("SN-0078")), "{lang:?}: {}", during.text());
    }
}

/// What a run is given stands in the panel of the module, where there is room.
#[test]
fn the_numbers_of_a_module_are_in_its_panel() {
    let mut scene = scene(Lang::En);
    scene.resize(160, 50);
    for code in ["PO-1234", "SN-1", "GB-7"] {
        scan(&mut scene, code);
    }
    scene.pass_time(std::time::Duration::from_secs(60));
    let text = scene.text();
    assert!(text.contains("The order") && text.contains("PO-1234"), "{text}");
    assert!(text.contains("The gps") && text.contains("GB-7"), "{text}");
}

/// A number of the command line is of the module that the command line names; if it names none, of the first one that comes.
#[test]
fn a_number_of_the_command_line_is_not_lost_without_a_word() {
    for lang in Lang::ALL {
        let whole = pairs(&[("order", "PO-1234"), ("gps", "GB-7")]);
        let mut scene = scene(lang);
        scene.model.numbers = crate::tui::numbers::Numbers::new(whole.clone(), true);
        scan(&mut scene, "SN-1");
        assert_eq!(given(&scene), whole, "{lang:?}");
        let mut scene = self::scene(lang);
        scene.model.scan.current = Some("SN-1".into());
        scene.model.numbers = crate::tui::numbers::Numbers::new(whole, false);
        scan(&mut scene, "SN-2");
        assert_eq!(given(&scene), pairs(&[("order", "PO-1234")]), "{lang:?}");
        let told = lang.texts().not_used.split("{}").next().unwrap_or_default().to_owned();
        let text = scene.text();
        assert!(text.contains("GB-7") && text.contains(told.trim()), "{lang:?}: {text}");
    }
}
