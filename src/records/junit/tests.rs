//! The report against the form that CI servers read, by another reader than its writer.

use gnc_executive::event::{AttemptError, BenchInfo, StopHow};
use gnc_executive::record::StopRecord;
use quick_xml::Reader;
use quick_xml::events::Event;

use gnc_executive::verdict::Verdict;

use super::*;

/// An element as it was read.
#[derive(Debug, Default, Clone)]
struct Element {
    name: String,
    attributes: Vec<(String, String)>,
    children: Vec<Element>,
    text: String,
}

impl Element {
    fn get(&self, name: &str) -> &str {
        let found = self.attributes.iter().find(|(key, _)| key == name);
        found.map_or_else(|| panic!("no {name} in {self:?}"), |(_, value)| value.as_str())
    }

    fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Element> {
        self.children.iter().filter(move |child| child.name == name)
    }
}

fn read(xml: &[u8]) -> Element {
    let text = std::str::from_utf8(xml).unwrap();
    let forbidden = |mark: char| (mark < ' ' && !"\t\n\r".contains(mark)) || mark == '\u{fffe}' || mark == '\u{ffff}';
    assert!(!text.chars().any(forbidden), "{text:?}");
    let mut reader = Reader::from_str(text);
    let mut open = vec![Element::default()];
    loop {
        let event = reader.read_event().unwrap();
        let begun = |start: &quick_xml::events::BytesStart<'_>| Element {
            name: start.name().as_ref().to_owned(),
            attributes: start
                .attributes()
                .map(|attribute| {
                    let attribute = attribute.unwrap();
                    let key = attribute.key.as_ref().to_owned();
                    let value = attribute.value.to_string();
                    (key, quick_xml::escape::unescape(&value).unwrap().into_owned())
                })
                .collect(),
            ..Element::default()
        };
        match event {
            Event::Start(start) => open.push(begun(&start)),
            Event::Empty(start) => {
                let element = begun(&start);
                open.last_mut().unwrap().children.push(element);
            }
            Event::End(_) => {
                let element = open.pop().unwrap();
                open.last_mut().unwrap().children.push(element);
            }
            Event::Text(text) => {
                open.last_mut().unwrap().text.push_str(&text);
            }
            Event::GeneralRef(name) => {
                let escaped = format!("&{};", &*name);
                let text = quick_xml::escape::unescape(&escaped).unwrap().into_owned();
                open.last_mut().unwrap().text.push_str(&text);
            }
            Event::Eof => break,
            _ => {}
        }
    }
    assert_eq!(open.len(), 1);
    open.remove(0).children.remove(0)
}

/// The form that Jenkins and Ant agree on: elements, attributes that must be there, order, at most one end of a case,
/// and counts that are those of the cases.
fn check(xml: &[u8]) -> Element {
    let root = read(xml);
    assert_eq!(root.name, "testsuites");
    let count = |element: &Element, name: &str| element.get(name).parse::<usize>().unwrap();
    for name in ["tests", "failures", "errors", "skipped"] {
        let sum: usize = root.all("testsuite").map(|suite| count(suite, name)).sum();
        assert_eq!(count(&root, name), sum, "{name}");
    }
    for suite in &root.children {
        assert_eq!(suite.name, "testsuite");
        assert!(!suite.get("name").is_empty());
        suite.get("hostname");
        assert!(suite.get("time").parse::<f64>().unwrap() >= 0.0);
        chrono::NaiveDateTime::parse_from_str(suite.get("timestamp"), "%Y-%m-%dT%H:%M:%S").unwrap();
        let order: Vec<&str> = suite.children.iter().map(|child| child.name.as_str()).collect();
        let properties = usize::from(order.first() == Some(&"properties"));
        assert!(order[properties..].iter().all(|name| *name == "testcase"), "{order:?}");
        for property in suite.all("properties").flat_map(|properties| &properties.children) {
            assert_eq!(property.name, "property");
            property.get("name");
            property.get("value");
        }
        let cases: Vec<&Element> = suite.all("testcase").collect();
        let ended = |name: &str| cases.iter().filter(|case| case.all(name).count() > 0).count();
        assert_eq!(count(suite, "tests"), cases.len());
        assert_eq!(count(suite, "failures"), ended("failure"));
        assert_eq!(count(suite, "errors"), ended("error"));
        assert_eq!(count(suite, "skipped"), ended("skipped"));
        for case in &cases {
            case.get("name");
            case.get("classname");
            assert!(case.get("time").parse::<f64>().unwrap() >= 0.0 && !case.get("time").contains('e'));
            let order: Vec<&str> = case.children.iter().map(|child| child.name.as_str()).collect();
            let (ends, rest): (Vec<&str>, Vec<&str>) =
                order.iter().partition(|name| ["skipped", "error", "failure"].contains(name));
            assert!(ends.len() <= 1 && (rest.is_empty() || rest == ["system-out"]), "{order:?}");
            assert!(order.len() < 2 || order[1] == "system-out", "{order:?}");
            for end in case.children.iter().filter(|child| ["error", "failure"].contains(&child.name.as_str())) {
                end.get("message");
                end.get("type");
            }
        }
    }
    root
}

fn item(name: &str, outcome: Outcome) -> ItemRecord {
    let at = chrono::DateTime::parse_from_rfc3339("2026-11-28T12:00:00+08:00").unwrap();
    let ran = !matches!(outcome, Outcome::Skipped | Outcome::NotRun);
    let attempt = AttemptRecord {
        outcome,
        started: at,
        elapsed_s: Some(1.5),
        measurements: Vec::new(),
        details: Vec::new(),
        error: (outcome == Outcome::Errored).then(|| AttemptError {
            text: "no answer <in> 2 s & more \u{1b}[2J\u{0}\u{ffff}".to_owned(),
            hint: "check the cable".to_owned(),
            again: false,
        }),
        error_records: Vec::new(),
    };
    ItemRecord {
        name: name.to_owned(),
        id: gnc_executive::catalogue::ItemId::Cpu,
        title: "CPU".to_owned(),
        phase: gnc_executive::plan::Phase::Test,
        optional: false,
        selected: true,
        outcome,
        cause: (!ran).then_some(gnc_executive::outcome::Cause::NotSelected),
        started: ran.then_some(at),
        started_s: ran.then_some(0.0),
        elapsed_s: ran.then_some(1.5),
        attempts: if ran { vec![attempt] } else { Vec::new() },
    }
}

fn record(outcome: Outcome, items: Vec<ItemRecord>) -> RunRecord {
    let at = chrono::DateTime::parse_from_rfc3339("2026-11-28T12:00:00+08:00").unwrap();
    RunRecord {
        schema: gnc_executive::record::RUN_SCHEMA.to_owned(),
        verdict: Verdict::Module(outcome),
        interrupted: false,
        serial_number: "SN-\u{7}\"<1>".to_owned(),
        part: None,
        numbers: Vec::new(),
        limits: None,
        plan: gnc_executive::event::PlanInfo {
            name: "functional".to_owned(),
            version: "1.0".to_owned(),
            sha256: "0".repeat(64),
        },
        site: None,
        recomputed: None,
        other_module: None,
        closed_late: None,
        resumed: None,
        station: "line-7".to_owned(),
        operator: Some("Zhang\nWei".to_owned()),
        program: gnc_executive::event::ProgramVersion {
            name: "gnc-station".to_owned(),
            version: "0".to_owned(),
            build: None,
        },
        bench: BenchInfo::simulated("good", "max", 1),
        board: None,
        board_breaches: Vec::new(),
        selection: None,
        looped: None,
        started: at,
        finished: Some(at),
        elapsed_s: 1e-7,
        stop: None,
        items,
        notes: Vec::new(),
    }
}

fn report(record: &RunRecord, unrecorded: Option<&str>) -> Element {
    let mut report = JunitReport::default();
    report.add_run(record, "records/2026-11-28/X/120000-functional", unrecorded).unwrap();
    check(&report.xml().unwrap())
}

#[test]
fn each_outcome_has_its_element() {
    let items = Outcome::ALL.map(|outcome| item(outcome.as_str(), outcome)).to_vec();
    let root = report(&record(Outcome::Aborted, items), None);
    let suite = &root.children[0];
    let end = |name: &str| {
        let case = suite.all("testcase").find(|case| case.get("name") == name).unwrap();
        case.children.iter().map(|child| child.name.clone()).find(|name| name != "system-out")
    };
    for (name, expected) in [
        ("passed", None),
        ("marginal", None),
        ("failed", Some("failure")),
        ("errored", Some("error")),
        ("aborted", Some("error")),
        ("skipped", Some("skipped")),
        ("not_run", Some("skipped")),
    ] {
        assert_eq!(end(name).as_deref(), expected, "{name}");
    }
    let counts = ["tests", "failures", "errors", "skipped"].map(|name| suite.get(name).to_owned());
    assert_eq!(counts, ["7", "1", "2", "2"]);
    assert_eq!((suite.get("name"), suite.get("hostname")), ("functional", "line-7"));
    assert_eq!((suite.get("timestamp"), suite.get("time")), ("2026-11-28T12:00:00", "0.000000"));
}

#[test]
fn foreign_texts_stay_texts() {
    let root = report(&record(Outcome::Errored, vec![item("cpu", Outcome::Errored)]), None);
    let suite = &root.children[0];
    let property = |name: &str| {
        let all = &suite.children[0].children;
        all.iter().find(|property| property.get("name") == name).unwrap().get("value").to_owned()
    };
    assert_eq!(property("serial_number"), "SN-\\u{7}\"<1>");
    assert_eq!(property("operator"), "Zhang\\nWei");
    let case = suite.all("testcase").next().unwrap();
    let error = case.all("error").next().unwrap();
    assert!(error.get("message").starts_with("no answer <in> 2 s & more \\u{1b}[2J\\u{0}"), "{error:?}");
    assert!(error.text.contains("try: check the cable"), "{error:?}");
}

#[test]
fn what_no_item_says_is_a_case_of_its_own() {
    let whole = |record: &RunRecord, unrecorded: Option<&str>| {
        let root = report(record, unrecorded);
        let mut cases = root.children[0].all("testcase").filter(|case| case.get("name") == WHOLE_RUN);
        cases.next().map(|case| case.children[0].get("message").to_owned())
    };
    let good = record(Outcome::Passed, vec![item("cpu", Outcome::Passed)]);
    assert_eq!(whole(&good, None), None);
    let unrecorded = whole(&good, Some("no space left on device"));
    assert_eq!(unrecorded.as_deref(), Some("the record could not be written: no space left on device"));
    let interrupted = RunRecord { interrupted: true, verdict: Verdict::Module(Outcome::Aborted), ..good.clone() };
    assert_eq!(whole(&interrupted, None).as_deref(), Some("the run has no end"));
    let stop = Some(StopRecord { how: StopHow::InOrder, by: "ctrl-C".to_owned() });
    let stopped = RunRecord { stop, verdict: Verdict::Module(Outcome::Aborted), ..good.clone() };
    assert_eq!(whole(&stopped, None).as_deref(), Some("the run was stopped by ctrl-C"));
    let errored = RunRecord { verdict: Verdict::Module(Outcome::Errored), items: Vec::new(), ..good.clone() };
    assert_eq!(whole(&errored, None).as_deref(), Some("the run is errored"));
    // Good items of a selection are no pass that a server may count.
    let chosen = Some(vec!["cpu".to_owned()]);
    let selection = RunRecord { verdict: Verdict::Selection(Outcome::Passed), selection: chosen, ..good.clone() };
    let told = whole(&selection, None);
    assert_eq!(told.as_deref(), Some("only chosen items ran: this is not a pass of the module"));
    assert_eq!(report(&selection, None).get("skipped"), "1");
    // Nor is a pass of a board that a program may play.
    let bench = BenchInfo::real().in_doubt(Some("port /dev/pts/3 is a pseudo-terminal".to_owned()));
    let unproven = RunRecord { bench, ..good };
    let told = whole(&unproven, None);
    assert_eq!(
        told.as_deref(),
        Some("UNPROVEN BENCH (port /dev/pts/3 is a pseudo-terminal): no evidence about any module")
    );
    assert_eq!(report(&unproven, None).get("skipped"), "1");
    let failed = RunRecord { verdict: Verdict::Module(Outcome::Failed), ..unproven };
    let failed = RunRecord { items: vec![item("cpu", Outcome::Failed)], ..failed };
    assert_eq!((whole(&failed, None), report(&failed, None).get("failures")), (None, "1"));
}

#[test]
fn rounds_are_suites_of_their_own() {
    let mut report = JunitReport::default();
    for index in 1..=3 {
        let looped = Some(gnc_executive::event::Loop { index, count: Some(3) });
        let record = RunRecord { looped, ..record(Outcome::Passed, vec![item("cpu", Outcome::Passed)]) };
        report.add_run(&record, "x", None).unwrap();
    }
    report.add_error("2026-11-28T12:00:00", "there is no place for the record", "").unwrap();
    let root = check(&report.xml().unwrap());
    let names: Vec<&str> = root.children.iter().map(|suite| suite.get("name")).collect();
    assert_eq!(names, ["functional round 1", "functional round 2", "functional round 3", WHOLE_RUN]);
    assert_eq!((root.get("tests"), root.get("errors")), ("4", "1"));
}
