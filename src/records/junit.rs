//! Runs as JUnit XML, the report of tests that CI servers read.
//!
//! A run is a suite, an item a case. The form is the one that Jenkins and Ant agree on: a case has at most one of
//! `skipped`, `error` and `failure`, and its measurements as text. The names of suites and cases come from plans alone, so
//! that a server recognises an item from run to run; number and place of the run are properties.

use std::io;

use gnc_executive::event::BenchKind;
use gnc_executive::outcome::Outcome;
use gnc_executive::record::{AttemptRecord, ItemRecord, RunRecord};
use gnc_executive::text;
use gnc_text::{printable, printable_lines};
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};

use crate::passport::XmlError;

const ROOT: &str = "testsuites";
/// The name of all suites together.
const ALL: &str = "gnc-station";
/// The case that stands for a run as a whole, beside its items. No item of a plan can have this name.
const WHOLE_RUN: &str = "(run)";
/// Text that stands in the place of a character that XML cannot hold.
const UNWRITABLE: char = '\u{fffd}';

/// Suites that grow run by run.
#[derive(Debug, Default)]
pub struct JunitReport {
    suites: Vec<u8>,
    counts: Counts,
    time_s: f64,
}

/// Cases by how they ended.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Counts {
    tests: usize,
    failures: usize,
    errors: usize,
    skipped: usize,
}

/// How a case ended, for the server.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum CaseEnd {
    Passed,
    Failed,
    Errored,
    Skipped,
}

impl From<Outcome> for CaseEnd {
    fn from(outcome: Outcome) -> Self {
        match outcome {
            Outcome::Passed | Outcome::Marginal => Self::Passed,
            Outcome::Failed => Self::Failed,
            Outcome::Errored | Outcome::Aborted => Self::Errored,
            Outcome::Skipped | Outcome::NotRun => Self::Skipped,
        }
    }
}

/// A case before it is written.
struct Case {
    name: String,
    time_s: f64,
    end: CaseEnd,
    /// The outcome in a word of the station.
    word: &'static str,
    /// One line.
    message: String,
    /// What stands in the element of the end.
    why: String,
    /// Measurements of the last attempt, a line each.
    out: String,
}

impl JunitReport {
    /// Adds a run. `place` is its folder, `unrecorded` says why its record could not be written.
    ///
    /// # Errors
    /// [`XmlError`], a mistake in this program.
    pub fn add_run(&mut self, record: &RunRecord, place: &str, unrecorded: Option<&str>) -> Result<(), XmlError> {
        let mut cases: Vec<Case> = record.items.iter().map(case_of).collect();
        cases.extend(whole_run(record, unrecorded));
        let round = record.looped.map(|looped| format!(" round {}", looped.index)).unwrap_or_default();
        let name = format!("{}{round}", record.plan.name);
        let properties = properties(record, place);
        let at = record.started.format("%Y-%m-%dT%H:%M:%S").to_string();
        let suite =
            Suite { name: &name, class: &record.plan.name, at: &at, host: &record.station, time_s: record.elapsed_s };
        self.add(&suite, &properties, &cases)
    }

    /// Adds a run of which there is no record: it was refused, or has no end yet. `at` is its time without offset.
    ///
    /// # Errors
    /// [`XmlError`], a mistake in this program.
    pub fn add_error(&mut self, at: &str, message: &str, hint: &str) -> Result<(), XmlError> {
        let case = Case {
            name: WHOLE_RUN.to_owned(),
            time_s: 0.0,
            end: CaseEnd::Errored,
            word: Outcome::Errored.as_str(),
            message: one_line(message),
            why: if hint.is_empty() { String::new() } else { format!("try: {hint}") },
            out: String::new(),
        };
        let suite = Suite { name: WHOLE_RUN, class: ALL, at, host: "", time_s: 0.0 };
        self.add(&suite, &[], &[case])
    }

    fn add(&mut self, suite: &Suite<'_>, properties: &[(&str, String)], cases: &[Case]) -> Result<(), XmlError> {
        let counts = Counts::of(cases);
        self.suites.extend(suite.xml(counts, properties, cases)?);
        let Counts { tests, failures, errors, skipped } = &mut self.counts;
        *tests += counts.tests;
        *failures += counts.failures;
        *errors += counts.errors;
        *skipped += counts.skipped;
        self.time_s += suite.time_s;
        Ok(())
    }

    /// The whole report.
    ///
    /// # Errors
    /// [`XmlError`], a mistake in this program.
    pub fn xml(&self) -> Result<Vec<u8>, XmlError> {
        let mut out = Writer::new(Vec::new());
        out.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
        out.get_mut().push(b'\n');
        let mut root = BytesStart::new(ROOT);
        root.push_attribute(("name", ALL));
        self.counts.attributes(&mut root);
        root.push_attribute(("time", seconds(self.time_s).as_str()));
        out.write_event(Event::Start(root))?;
        out.get_mut().push(b'\n');
        out.get_mut().extend(&self.suites);
        out.write_event(Event::End(BytesEnd::new(ROOT)))?;
        let mut text = out.into_inner();
        text.push(b'\n');
        Ok(text)
    }
}

impl Counts {
    fn of(cases: &[Case]) -> Self {
        let count = |end: CaseEnd| cases.iter().filter(|case| case.end == end).count();
        Self {
            tests: cases.len(),
            failures: count(CaseEnd::Failed),
            errors: count(CaseEnd::Errored),
            skipped: count(CaseEnd::Skipped),
        }
    }

    fn attributes(self, element: &mut BytesStart<'_>) {
        let Self { tests, failures, errors, skipped } = self;
        for (name, count) in [("tests", tests), ("failures", failures), ("errors", errors), ("skipped", skipped)] {
            element.push_attribute((name, count.to_string().as_str()));
        }
    }
}

/// The head of a suite.
struct Suite<'a> {
    name: &'a str,
    class: &'a str,
    at: &'a str,
    host: &'a str,
    time_s: f64,
}

impl Suite<'_> {
    fn xml(&self, counts: Counts, properties: &[(&str, String)], cases: &[Case]) -> io::Result<Vec<u8>> {
        let mut out = Writer::new_with_indent(Vec::new(), b' ', 2);
        let mut head = BytesStart::new("testsuite");
        head.push_attribute(("name", one_line(self.name).as_str()));
        counts.attributes(&mut head);
        head.push_attribute(("time", seconds(self.time_s).as_str()));
        head.push_attribute(("timestamp", self.at));
        head.push_attribute(("hostname", one_line(self.host).as_str()));
        out.write_event(Event::Start(head))?;
        if !properties.is_empty() {
            out.write_event(Event::Start(BytesStart::new("properties")))?;
            for (name, value) in properties {
                let mut property = BytesStart::new("property");
                property.push_attribute(("name", *name));
                property.push_attribute(("value", one_line(value).as_str()));
                out.write_event(Event::Empty(property))?;
            }
            out.write_event(Event::End(BytesEnd::new("properties")))?;
        }
        for case in cases {
            case.xml(&mut out, self.class)?;
        }
        out.write_event(Event::End(BytesEnd::new("testsuite")))?;
        let mut text = out.into_inner();
        text.push(b'\n');
        Ok(text)
    }
}

impl Case {
    fn xml(&self, out: &mut Writer<Vec<u8>>, class: &str) -> io::Result<()> {
        let mut head = BytesStart::new("testcase");
        head.push_attribute(("name", one_line(&self.name).as_str()));
        head.push_attribute(("classname", one_line(class).as_str()));
        head.push_attribute(("time", seconds(self.time_s).as_str()));
        out.write_event(Event::Start(head))?;
        let (name, has_type) = match self.end {
            CaseEnd::Passed => ("", false),
            CaseEnd::Failed => ("failure", true),
            CaseEnd::Errored => ("error", true),
            CaseEnd::Skipped => ("skipped", false),
        };
        if !name.is_empty() {
            let mut end = BytesStart::new(name);
            end.push_attribute(("message", self.message.as_str()));
            if has_type {
                end.push_attribute(("type", self.word));
            }
            element(out, end, &self.why)?;
        }
        if !self.out.is_empty() {
            element(out, BytesStart::new("system-out"), &self.out)?;
        }
        out.write_event(Event::End(BytesEnd::new("testcase")))
    }
}

fn element(out: &mut Writer<Vec<u8>>, start: BytesStart<'_>, content: &str) -> io::Result<()> {
    if content.is_empty() {
        return out.write_event(Event::Empty(start));
    }
    let end = start.to_end().into_owned();
    out.write_event(Event::Start(start.borrow()))?;
    out.write_event(Event::Text(BytesText::new(&writable(content))))?;
    out.write_event(Event::End(end))
}

fn case_of(item: &ItemRecord) -> Case {
    let reason = text::reason(item);
    let end = CaseEnd::from(item.outcome);
    let message = if reason.is_empty() { item.outcome.as_str().to_owned() } else { reason };
    let attempt = item.last_attempt();
    Case {
        name: item.name.clone(),
        time_s: item.elapsed_s.unwrap_or_default(),
        end,
        word: item.outcome.as_str(),
        message: one_line(&message),
        why: if end == CaseEnd::Skipped { String::new() } else { text::failing_item(item) },
        out: attempt.map(|attempt| measurements(item, attempt)).unwrap_or_default(),
    }
}

/// The measurements of an attempt, each with its judgement.
fn measurements(item: &ItemRecord, attempt: &AttemptRecord) -> String {
    let attempts = match item.attempts.len() {
        1 => String::new(),
        several => format!(" in attempt {several}"),
    };
    let mut lines = vec![format!("{}{attempts}", item.outcome.as_str())];
    lines.extend(attempt.measurements.iter().map(|measurement| {
        let judged = measurement.outcome.map_or("information", Outcome::as_str);
        format!("{judged:<11}  {}", text::measurement_line(measurement))
    }));
    lines.join("\n") + "\n"
}

/// What no item says: the run has no end, its record is not there, or it ended worse than its items.
fn whole_run(record: &RunRecord, unrecorded: Option<&str>) -> Option<Case> {
    let worst = Outcome::worst(record.items.iter().map(|item| item.outcome));
    let verdict = record.verdict;
    let good_selection = verdict.of_selection().is_some_and(Outcome::is_good);
    let good_unproven = record.bench.kind == BenchKind::Unproven && verdict.of_items().is_good();
    let message = match unrecorded {
        Some(why) => format!("the record could not be written: {why}"),
        None if record.interrupted => "the run has no end".to_owned(),
        None if record.other_module.is_some() => text::banners(record).join("; "),
        None if good_selection => "only chosen items ran: this is not a pass of the module".to_owned(),
        None if good_unproven => text::banners(record).join("; "),
        None if worst == Some(verdict.of_items()) => return None,
        None => match &record.stop {
            Some(stop) => format!("the run was stopped by {}", stop.by),
            None => format!("the run is {verdict}"),
        },
    };
    // A server that counts what passed must not count a module whose plan did not run, nor one that a program may have played.
    let outcome = match unrecorded {
        Some(_) => Outcome::Errored,
        None if good_selection || good_unproven => Outcome::Skipped,
        None => verdict.of_items(),
    };
    let notes = record.notes.iter().map(|note| printable(&note.text).into_owned() + "\n");
    Some(Case {
        name: WHOLE_RUN.to_owned(),
        time_s: record.elapsed_s,
        end: CaseEnd::from(outcome),
        word: outcome.as_str(),
        message: one_line(&message),
        why: notes.collect(),
        out: String::new(),
    })
}

fn properties(record: &RunRecord, place: &str) -> Vec<(&'static str, String)> {
    let RunRecord { serial_number, plan, station, operator, program, bench, selection, .. } = record;
    let mut properties = vec![
        ("serial_number", serial_number.clone()),
        ("outcome", record.verdict.as_str().to_owned()),
        ("record", place.to_owned()),
        ("plan", plan.name.clone()),
        ("plan_version", plan.version.clone()),
        ("plan_sha256", plan.sha256.clone()),
        ("started", record.started.to_rfc3339()),
        ("station", station.clone()),
        ("program", program.to_string()),
        ("simulated", (bench.kind == BenchKind::Simulated).to_string()),
        ("bench", bench.kind.as_str().to_owned()),
    ];
    properties.extend(operator.clone().map(|operator| ("operator", operator)));
    properties.extend(record.limits.as_ref().map(|limits| ("limits", limits.to_string())));
    properties.extend(record.numbers.iter().map(|number| ("number", format!("{}={}", number.key, number.value))));
    properties.extend(selection.as_ref().map(|names| ("selection", names.join(","))));
    properties
}

/// A text as one line for an attribute.
fn one_line(text: &str) -> String {
    writable(&printable(text))
}

/// A text with only characters that XML can hold (XML 1.0, production 2).
fn writable(text: &str) -> String {
    let text = &*printable_lines(text);
    let can = |mark: char| matches!(mark, '\t' | '\n' | '\r' | '\u{20}'..='\u{d7ff}' | '\u{e000}'..='\u{fffd}' | '\u{10000}'..);
    text.chars().map(|mark| if can(mark) { mark } else { UNWRITABLE }).collect()
}

/// Seconds as the form has them: decimal, without exponent.
fn seconds(time_s: f64) -> String {
    format!("{time_s:.6}")
}

#[cfg(test)]
mod tests;
