//! Scans reach the serial number from everywhere, and nothing else.

use gnc_bench::fixture::Ask;
use gnc_executive::event::{EventKind, OtherModule};
use gnc_executive::outcome::Outcome;
use gnc_executive::serial_number::SerialNumberPattern;

use gnc_bench::fixture::Reply;

use super::{fail, record, records, runs, scene};
use crate::tui::decode::Key;
use crate::tui::input::Scanned;
use crate::tui::lang::Lang;
use crate::tui::model::{Loaded, Over, ScreenPage};
use crate::tui::pending::{Prepared, Resumable};
use crate::tui::scene::Scene;
use crate::tui::update::{Effect, Msg};

fn unended(code: &[u8], taken_back: usize) -> Msg {
    Msg::Scan(Scanned { bytes: code.to_vec(), taken_back, ..Scanned::default() })
}

fn look_up(number: &str) -> Option<Effect> {
    Some(Effect::LookUp(number.to_owned()))
}

/// What brings the screen to a place.
type Play = fn(&mut Scene);

/// Every page, every layer, every question that is open while nothing runs.
#[test]
fn a_scan_reaches_the_number_from_everywhere() {
    let plays: [(&str, Play); 10] = [
        ("the items", |_| {}),
        ("a verdict", fail),
        ("live", |scene| drop(scene.key(Key::F(9)))),
        ("days", records),
        ("runs", runs),
        ("a run", record),
        ("an item of a run", |scene| {
            record(scene);
            scene.key(Key::Enter);
        }),
        ("the log", |scene| {
            fail(scene);
            scene.key(Key::Ctrl('l'));
        }),
        ("help", |scene| drop(scene.key(Key::F(1)))),
        ("help of a run", |scene| {
            record(scene);
            scene.key(Key::F(1));
        }),
    ];
    for (place, play) in plays {
        let mut scene = scene(Lang::En);
        play(&mut scene);
        assert_eq!(scene.scans("]C1SN-0001\r\n"), look_up("SN-0001"), "{place}");
        assert_eq!(scene.model.scan.current.as_deref(), Some("SN-0001"), "{place}");
        assert_eq!((scene.model.page, scene.model.over.len()), (ScreenPage::Tests, 0), "{place}");
        assert!(scene.model.records.search.is_empty() && scene.model.scan.typed.is_empty(), "{place}");
        assert!(scene.text().contains("SN-0001: F5 starts the test."), "{place}: {}", scene.text());
    }
}

/// In the form it neither falls into a field nor takes or leaves the form.
#[test]
fn a_scan_does_not_fall_into_the_form() {
    for downs in 0..6 {
        let mut scene = scene(Lang::En);
        scene.key(Key::F(2));
        (0..downs).for_each(|_| drop(scene.key(Key::Down)));
        scene.types("1");
        let before = scene.model.over.clone();
        assert_eq!(scene.scans("SN-0001\r"), look_up("SN-0001"), "line {downs}");
        assert_eq!(scene.model.over, before, "line {downs}");
        assert_eq!(scene.model.scan.current.as_deref(), Some("SN-0001"));
        assert!(scene.text().contains("This form stays as it is"), "{}", scene.text());
        // The beginning of a scan that was given as keys goes back out of the field.
        scene.types("S");
        scene.tell(Msg::Scan(Scanned { bytes: b"N-0002\r".to_vec(), ended: true, taken_back: 1, dropped: 0 }));
        assert_eq!(
            (scene.model.scan.current.as_deref(), &scene.model.over),
            (Some("SN-0002"), &before),
            "line {downs}"
        );
    }
}

/// While a run is on, the number comes next. Neither the question of the run nor that of the station is answered.
#[test]
fn a_scan_answers_nothing_while_a_run_is_on() {
    let mut scene = scene(Lang::En);
    scene.start("DEMO-1");
    scene.tell(Msg::Asked { item: "ad".into(), ask: Ask::Switches(None) });
    for code in ["SN-0002\r", "SN\x1b[15~\r", "\r", "y\r"] {
        assert_eq!(scene.scans(code), None);
        assert!(scene.model.run.as_ref().is_some_and(|run| run.prompt.is_some()), "{code:?} answered");
    }
    for key in [Key::Enter, Key::Esc, Key::Tab, Key::Char('y'), Key::Ctrl('j')] {
        assert_eq!(scene.key(key), None, "{key:?}");
    }
    scene.key(Key::Esc);
    assert_eq!(scene.key(Key::F(7)), Some(Effect::Answer(Reply::NotPossible)));
    scene.tell(Msg::Asked { item: "ad".into(), ask: Ask::Switches(None) });
    assert_eq!(scene.key(Key::F(2)), Some(Effect::Answer(Reply::Done)));
    scene.scans("SN-0002\r");
    scene.key(Key::F(10));
    assert_eq!(scene.scans("SN-0003\r"), None);
    assert!(matches!(scene.model.over.last(), Some(Over::Leave)) && !scene.model.leaving);
    assert_eq!(scene.model.scan.next.as_deref(), Some("SN-0003"));
}

/// F3 and F4 stay with the module on the screen. F5 goes on to the next one.
#[test]
fn only_f5_takes_the_next_number() {
    for key in [Key::F(3), Key::F(4)] {
        let mut scene = scene(Lang::En);
        scene.start("DEMO-1");
        scene.scans("SN-0002\r");
        scene.run_ends(Outcome::Failed);
        let asked = scene.key(key);
        assert!(
            matches!(&asked, Some(Effect::Prepare { serial_number, .. }) if serial_number == "DEMO-1"),
            "{asked:?}"
        );
        assert_eq!(scene.model.scan.next.as_deref(), Some("SN-0002"));
        scene.tell(unended(b"SN-0003", 0));
        let asked = scene.key(key);
        assert!(
            matches!(&asked, Some(Effect::Prepare { serial_number, .. }) if serial_number == "DEMO-1"),
            "{asked:?}"
        );
    }
    let mut scene = scene(Lang::En);
    scene.start("DEMO-1");
    scene.scans("SN-0002\r");
    scene.run_ends(Outcome::Failed);
    let asked = scene.key(Key::F(5));
    assert!(matches!(&asked, Some(Effect::Prepare { serial_number, .. }) if serial_number == "SN-0002"), "{asked:?}");
}

/// What is no number is told in words, takes nothing, and leaves the module on the screen.
#[test]
fn bad_scans_are_told() {
    for (code, told) in [
        ("ЫТ-0001\r", "ЫТ-0001: the scanner types in another layout"),
        ("ＳＮ－０００１\r", "the scanner types in another layout"),
        ("SN\u{200b}-0001\r", "nobody sees (U+200B)"),
        ("]d221SN-0001\u{1d}10LOT5\r", "several fields: 21SN-0001 | 10LOT5"),
        ("SN\x1b[15~01\r", "control characters"),
        ("\x02 \x03", "The scan was empty"),
    ] {
        let mut scene = scene(Lang::En);
        scene.scans("DEMO-1\r");
        assert_eq!(scene.scans(code), None, "{code:?}");
        assert!(scene.text().contains(told), "{code:?}: {}", scene.text());
        assert_eq!(scene.model.scan.current.as_deref(), Some("DEMO-1"));
    }
}

/// Scanners without a line end leave the number to Enter or F5. One that has line ends was cut off.
#[test]
fn a_scan_without_an_end_waits() {
    let mut scene = scene(Lang::En);
    scene.tell(unended(b"SN-00", 0));
    assert_eq!(scene.model.scan.current, None);
    scene.tell(unended(b"SN-0001", 0));
    assert_eq!(scene.model.scan.typed.text(), "SN-0001", "the next scan is not added to the one before");
    assert_eq!(scene.key(Key::Enter), look_up("SN-0001"));
    // Typed text that a slow line holds back comes at once, too.
    scene.types("SN-");
    scene.tell(unended(b"0002", 0));
    assert_eq!(scene.model.scan.typed.text(), "SN-0002");
    scene.scans("SN-0003\r");
    assert_eq!(scene.model.scan.current.as_deref(), Some("SN-0003"));
    assert!(scene.text().contains("what was typed before: SN-0002"), "{}", scene.text());
    scene.tell(unended(b"SN-00", 0));
    assert!(scene.text().contains("compare SN-00, then press Enter"), "{}", scene.text());
}

/// A scan ends the look at raw values of the module before, and the records are searched then.
#[test]
fn a_scan_ends_watching() {
    let mut scene = scene(Lang::En);
    scene.key(Key::F(9));
    assert_eq!(scene.key(Key::F(5)), Some(Effect::Watch));
    assert_eq!(scene.scans("SN-0001\r"), Some(Effect::Stop));
    assert_eq!(scene.tell(Msg::WatchOver { why: None }), look_up("SN-0001"));
}

/// A screen whose bench and plan have these patterns.
fn with_patterns(bench: Option<&str>, plan: Option<&str>) -> Scene {
    let pattern = |text: &str| SerialNumberPattern::new(text).expect("a pattern");
    let mut scene = scene(Lang::En);
    let (Loaded::Ready(of_bench), Loaded::Ready(of_plan)) = (&mut scene.model.bench, &mut scene.model.plan) else {
        panic!("they are read");
    };
    (of_bench.serial_number, of_plan.serial_number) = (bench.map(pattern), plan.map(pattern));
    scene
}

/// The patterns of bench and plan hold for scans, typed numbers and the number of the command line.
#[test]
fn numbers_that_do_not_fit_are_told() {
    for (bench, plan) in [(Some("SN-[0-9]{4}"), None), (None, Some("SN-[0-9]{4}")), (Some("S.*"), Some("SN-[0-9]{4}"))]
    {
        let mut scene = with_patterns(bench, plan);
        assert_eq!(scene.scans("SN-00011\r"), None);
        assert!(
            scene.text().contains("SN-00011 is no serial number here, it must fit SN-[0-9]{4}"),
            "{}",
            scene.text()
        );
        scene.types("SN-1");
        assert_eq!(scene.key(Key::Enter), None);
        assert_eq!(scene.model.scan.current, None);
        assert_eq!(scene.scans("SN-0001\r"), look_up("SN-0001"));
        scene.model.scan.current = Some("of the command line".into());
        assert_eq!(scene.key(Key::F(5)), None);
        assert!(scene.text().contains("it must fit"), "{}", scene.text());
    }
    // A code of several fields holds the number that fits: GS1 and ISO/IEC 15434. Without a pattern the number is unknown.
    let gs1 = "]C1010345312000001121SN-0001\u{1d}10ABCD1234\r";
    for (scan, taken) in [
        (gs1, true),
        ("]C1010345312000001121SN-0001\r", true),
        ("[)>\u{1e}06\u{1d}1PGNC-POP-26B\u{1d}SSN-0001\u{1e}\u{4}\r", true),
        ("]C1010345312000001121SN-00011\u{1d}10ABCD1234\r", false),
        ("]C121SN-0001\u{1d}21SN-0002\r", false),
    ] {
        let mut scene = with_patterns(None, Some("SN-[0-9]{4}"));
        let expected = if taken { look_up("SN-0001") } else { None };
        assert_eq!(scene.scans(scan), expected, "{}", scan.escape_debug());
        assert_eq!(scene.text().contains("several fields"), !taken, "{}", scene.text());
    }
    let mut scene = with_patterns(None, None);
    assert_eq!(scene.scans(gs1), None);
    assert!(scene.text().contains("several fields"), "{}", scene.text());
    // A pattern that asks for Cyrillic letters knows better than the rule for layouts.
    let mut scene = with_patterns(Some("БИНС-[0-9]+"), None);
    assert_eq!(scene.scans("БИНС-12\r"), look_up("БИНС-12"));
    assert_eq!(scene.scans("ЫТ-12\r"), None);
    assert!(scene.text().contains("another layout"), "{}", scene.text());
    // A code that is only too short is no matter of the keyboard.
    let mut scene = with_patterns(Some("БИНС-[0-9]{4}"), None);
    assert_eq!(scene.scans("БИНС-123\r"), None);
    assert!(scene.text().contains("it must fit БИНС-[0-9]{4}"), "{}", scene.text());
}

/// An earlier version took the number of a run that broke off. Its module can be scanned again for that run, and for no new one.
#[test]
fn the_number_of_the_run_that_is_taken_up_holds() {
    for number in ["模块-1", "Ж-1", "SN-é"] {
        let mut scene = with_patterns(None, None);
        scene.model.resume = Some("records/2026-11-28/x/143015-p".into());
        number.clone_into(&mut scene.model.resume_of);
        assert_eq!(scene.scans("SN-µ\r"), None);
        assert_eq!(scene.scans(&format!("{number}\r")), look_up(number));
        assert!(matches!(scene.key(Key::F(5)), Some(Effect::Prepare { .. })), "{}", scene.text());
        let why = "gone".to_owned();
        let resume = Some(Resumable::No { why });
        let serial_number = number.to_owned();
        scene.tell(Msg::Prepared(Box::new(Prepared { serial_number, changed: Vec::new(), standing: None, resume })));
        assert_eq!(scene.key(Key::F(2)), None);
        assert!(scene.model.pending.is_none() && scene.model.run.is_none(), "{}", scene.text());
        assert_eq!(scene.scans(&format!("{number}\r")), None);
    }
}

/// A number is printable ASCII. What else was scanned or typed is named, unless a pattern names it. A pattern that takes anything
/// names nothing.
#[test]
fn a_sign_beyond_ascii_is_named() {
    for (pattern, number, code) in
        [(None, "SN-é1", "U+00E9"), (Some(".+"), "SN-µ1", "U+00B5"), (Some("SN-[0-9]"), "SN-\u{301}1", "U+0301")]
    {
        let mut scene = with_patterns(pattern, None);
        assert_eq!(scene.scans(&format!("{number}\r")), None);
        assert!(scene.text().contains(code) && scene.text().contains("not allowed"), "{}", scene.text());
        scene.types(number);
        assert_eq!(scene.key(Key::Enter), None, "{number}");
        assert_eq!(scene.model.scan.current, None);
    }
    let mut scene = with_patterns(Some("[A-Z]+№[0-9]+"), None);
    assert_eq!(scene.scans("SN№1\r"), look_up("SN№1"));
}

/// The scanner at the serial port is told once when it goes and once when it is back.
#[test]
fn a_scanner_that_goes_is_told() {
    let mut scene = scene(Lang::En);
    scene.tell(Msg::ScannerLost { why: "there is no port /dev/ttyACM0".into() });
    assert!(scene.text().contains("type the number: there is no port /dev/ttyACM0"), "{}", scene.text());
    scene.tell(Msg::ScannerBack { port: "/dev/ttyACM0".into() });
    assert!(scene.text().contains("The scanner at /dev/ttyACM0 is there again."), "{}", scene.text());
}

/// A module that was not scanned is told with both numbers, also on the smallest screen.
#[test]
fn another_module_is_told_with_both_numbers() {
    for lang in Lang::ALL {
        let mut scene = scene(lang);
        scene.start("DEMO-1");
        let (scanned, found) = ("DEMO-1".into(), "GNC-0666".into());
        scene.event(EventKind::OtherModule(OtherModule { scanned, found, exchanged: false }));
        scene.run_ends(Outcome::Errored);
        let text = scene.text();
        let line = text.lines().find(|line| line.contains("GNC-0666")).expect("a line");
        assert!(line.contains("DEMO-1"), "{lang:?}: {line}");
    }
}
