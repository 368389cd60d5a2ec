//! The report of a run as one HTML page: no network, no script, printable, to be read by people.
//!
//! A pure function of the record. All text from outside (serial numbers, answers of boards, plans) goes through
//! `markup::Text`, so that it cannot become markup.

mod calibration;
mod details;
mod markup;
mod measurements;
mod plots;
#[cfg(test)]
mod tests;

use std::io;

use gnc_executive::event::{BenchKind, NoteLevel};
use gnc_executive::outcome::Outcome;
use gnc_executive::record::{ItemRecord, RunRecord};
use gnc_executive::standing::{Flaw, own_flaws};
use gnc_executive::text::{banners, common_fault, duration};
use gnc_executive::uncertainty::Decision;
use gnc_plot::svg;
use gnc_text::printable;

use crate::passport::{NoPassport, Passport};
use markup::SvgPage;

/// Word and class of the style sheet for good items of a selection, which are no pass of the module.
const PARTIAL: &str = "partial";

/// Name of the report in a run's folder.
pub const REPORT: &str = "report.html";

/// Writes the report. `passport` is that of the run, or the reason why it has none. `digests` are those of the files in
/// the record that the report describes: name and SHA-256. `late` says how the run was closed late, `chain` is the
/// number and link of the line of its beginning.
///
/// # Errors
/// The error of `out`.
pub fn html(
    out: &mut dyn io::Write,
    record: &RunRecord,
    passport: &Result<Passport, NoPassport>,
    digests: &[(String, String)],
    late: Option<&str>,
    chain: Option<&str>,
) -> io::Result<()> {
    let title = format!("{} {} {}", record.serial_number, record.plan.name, record.started.format("%F %T"));
    let mut page = SvgPage::new(out, &title);
    // Above the verdict, so that no one reads that without it.
    if let Some(late) = late {
        page.element("p", "banner", &format!("CLOSED LATE: {late}"));
    }
    verdict(&mut page, record);
    identity(&mut page, record, late);
    what_decided(&mut page, record);
    table_of_items(&mut page, record);
    calibration::show(&mut page, passport);
    for item in record.items.iter().filter(|item| !item.attempts.is_empty()) {
        whole_item(&mut page, item);
    }
    breaches(&mut page, record);
    notes(&mut page, record);
    how_to_read(&mut page, record, digests, chain);
    page.finish()
}

fn verdict(page: &mut SvgPage, record: &RunRecord) {
    let word = if record.interrupted { "interrupted" } else { record.verdict.to_show().map_or(PARTIAL, word) };
    page.open("header", record.verdict.to_show().map_or(PARTIAL, class));
    page.element("h1", "", &format!("{} {}", word.to_uppercase(), record.serial_number));
    let line = format!("{} {}, {}", record.plan.name, record.plan.version, record.started.format("%F %T %:z"));
    page.element("p", "", &line);
    page.close("header");
    for banner in banners(record) {
        page.element("p", "banner", &banner);
    }
}

fn identity(page: &mut SvgPage, record: &RunRecord, late: Option<&str>) {
    let bench = match record.bench.kind {
        BenchKind::Real => "real".to_owned(),
        BenchKind::Unproven => match &record.bench.unproven {
            Some(why) => format!("unproven ({why})"),
            None => "unproven".to_owned(),
        },
        BenchKind::Simulated => {
            let known = [
                record.bench.personality.clone(),
                record.bench.speed.as_ref().map(|speed| format!("speed {speed}")),
                record.bench.seed.map(|seed| format!("seed {seed}")),
            ];
            format!("simulated ({})", known.into_iter().flatten().collect::<Vec<_>>().join(", "))
        }
    };
    let board = record.board.as_ref();
    let rows = [
        ("Serial number", Some(record.serial_number.clone())),
        ("Plan", Some(format!("{} {} (SHA-256 {})", record.plan.name, record.plan.version, record.plan.sha256))),
        ("Part asked", record.part.as_ref().map(ToString::to_string)),
        ("Limits", record.limits.as_ref().map(ToString::to_string)),
        ("Station", Some(record.station.clone())),
        ("Operator", record.operator.clone()),
        ("Bench", Some(bench)),
        ("Site", record.bench.site.clone()),
        ("Slave board", board.map(|board| format!("{}, firmware {}", board.board_serial, board.firmware))),
        ("Link", board.map(|board| board.link.clone())),
        ("Program", Some(record.program.to_string())),
        ("Began", Some(record.started.to_rfc3339())),
        ("Ended", record.finished.map(|at| at.to_rfc3339())),
        ("Took", Some(duration(record.elapsed_s))),
        ("Re-judged", record.recomputed.as_ref().map(|earlier| format!("the samples of run {}", earlier.run))),
        ("Counts for the module", Some(worth(record, late))),
        ("Round", record.looped.map(|round| round.index.to_string())),
        ("Decision rule", decision_rule(record)),
        ("Stopped by", record.stop.as_ref().map(|stop| stop.by.clone())),
    ];
    page.open("table", "facts");
    for (name, value) in rows {
        if let Some(value) = value {
            page.fact(name, &value);
        }
    }
    for number in &record.numbers {
        page.fact(&number.label, &number.value);
    }
    page.close("table");
}

/// Whether the verdict counts for the module, as far as the record can tell while it is closed.
fn worth(record: &RunRecord, late: Option<&str>) -> String {
    let mut flaws = own_flaws(record);
    if late.is_some() {
        // A pass that is closed late has no other reason to be errored.
        flaws.retain(|flaw| *flaw != Flaw::NoVerdict);
        flaws.push(Flaw::ClosedLate);
    }
    let words = flaws.iter().map(|flaw| match flaw {
        Flaw::Selection => "only chosen items were run",
        Flaw::NoVerdict => "the station could not tell",
        flaw => flaw.words().unwrap_or("it cannot be read"),
    });
    match flaws.is_empty() {
        true => "yes, as long as its plan says, while the record is as it was closed and in the chain".to_owned(),
        false => format!("no: {}", words.collect::<Vec<_>>().join(", ")),
    }
}

/// The rules by which this run used coverage intervals; `None` if no value had an interval.
fn decision_rule(record: &RunRecord) -> Option<String> {
    let attempts = record.items.iter().flat_map(|item| &item.attempts);
    let used: Vec<Decision> =
        attempts.flat_map(|attempt| &attempt.measurements).filter_map(|measurement| measurement.decision).collect();
    let rules = [
        (
            Decision::Simple,
            "simple acceptance: the value decides; a value inside its limit is marginal if its coverage interval \
             crosses the limit",
        ),
        (Decision::GuardBand, "guard band by the uncertainty: the whole coverage interval must be within the limit"),
    ];
    let words: Vec<&str> = rules.iter().filter(|(rule, _)| used.contains(rule)).map(|(_, words)| *words).collect();
    let both = if words.len() > 1 { ", as the plan says for each item" } else { "" };
    (!words.is_empty()).then(|| format!("{}{both}", words.join("; or ")))
}

/// Lists everything that is not good first, so that a reader finds it at once.
fn what_decided(page: &mut SvgPage, record: &RunRecord) {
    let bad: Vec<&ItemRecord> = record.items.iter().filter(|item| is_bad(item.outcome)).collect();
    if bad.is_empty() {
        return;
    }
    page.element("h2", "", "What decided");
    for item in bad {
        page.open("section", class(item.outcome));
        page.element("h3", "", &format!("{} {}", item.name, word(item.outcome)));
        if let Some(attempt) = item.last_attempt() {
            if let Some(error) = &attempt.error {
                page.element("p", "", &error.text);
                if !error.hint.is_empty() {
                    page.element("p", "hint", &format!("What to try: {}", error.hint));
                }
            }
            let mut hints = Vec::new();
            for measurement in attempt.measurements.iter().filter(|one| one.outcome.is_some_and(is_bad)) {
                let line = gnc_executive::text::measurement_line(measurement);
                page.element("p", "", &line);
                if let Some(spec) = item.id.spec().measurement(&measurement.name)
                    && !hints.contains(&spec.look_at)
                {
                    hints.push(spec.look_at);
                }
            }
            if let Some(common) = common_fault(attempt) {
                page.element("p", "hint", &format!("Look at {common}."));
                hints.clear();
            }
            for hint in hints {
                page.element("p", "hint", hint);
            }
        }
        page.close("section");
    }
}

fn table_of_items(page: &mut SvgPage, record: &RunRecord) {
    page.element("h2", "", "Items");
    page.open("table", "");
    page.row("th", &["Item", "", "Outcome", "Time", "Attempts"]);
    for item in record.items.iter().filter(|item| item.selected) {
        page.open("tr", class(item.outcome));
        page.link(&item.name, &anchor(&item.name));
        page.element("td", "", &item.title);
        let cause = item.cause.as_ref().map(|cause| format!(": {cause}")).unwrap_or_default();
        page.element("td", "outcome", &format!("{}{cause}", word(item.outcome)));
        page.element("td", "number", &item.elapsed_s.map(duration).unwrap_or_default());
        page.element("td", "number", &item.attempts.len().to_string());
        page.close("tr");
    }
    page.close("table");
}

fn whole_item(page: &mut SvgPage, item: &ItemRecord) {
    page.heading(&format!("{}: {}", item.name, item.title), &anchor(&item.name));
    for (index, attempt) in item.attempts.iter().enumerate() {
        if item.attempts.len() > 1 {
            page.element("h3", class(attempt.outcome), &format!("Attempt {} {}", index + 1, word(attempt.outcome)));
        }
        if let Some(error) = &attempt.error {
            page.element("p", "", &error.text);
        }
        measurements::table(page, &attempt.measurements);
        for details in &attempt.details {
            let pictures = plots::of(item.id, details)
                .into_iter()
                .map(|panel| svg(&[panel.with_texts(|text| printable(text).into_owned())]));
            page.pictures(&pictures.collect::<Vec<_>>());
            details::show(page, details);
        }
        if !attempt.error_records.is_empty() {
            page.element("h4", "", "Error records of the slave board");
            page.open("table", "");
            page.row("th", &["What", "Where", "Expected", "Got", "Board time"]);
            for record in &attempt.error_records {
                let time = format!("{:.6} s", record.board_time_us as f64 * 1e-6);
                page.row("td", &[&record.what, &record.location, &record.expected, &record.got, &time]);
            }
            page.close("table");
        }
    }
}

/// What the board does against the interface document: for those who build it, not for the verdict on the module.
fn breaches(page: &mut SvgPage, record: &RunRecord) {
    if record.board_breaches.is_empty() {
        return;
    }
    page.element("h2", "", "The board and the interface document");
    page.open("table", "");
    page.row("th", &["Section", "What the board does", "Times", "Worst or first case", "First at"]);
    for breach in &record.board_breaches {
        let (section, count) = (breach.section.to_string(), breach.count.to_string());
        let worst = breach.worst.as_deref().unwrap_or_default();
        page.row("td", &[&section, &breach.what, &count, worst, &breach.first_at.format("%F %T%.3f %:z").to_string()]);
    }
    page.close("table");
}

fn notes(page: &mut SvgPage, record: &RunRecord) {
    if record.notes.is_empty() {
        return;
    }
    page.element("h2", "", "Log");
    page.open("table", "");
    page.row("th", &["Time", "", "Item", "Note"]);
    for note in &record.notes {
        let level = match note.level {
            NoteLevel::Info => "",
            NoteLevel::Warning => "warning",
            NoteLevel::Error => "error",
        };
        let item = note.item.as_deref().unwrap_or_default();
        page.row("td", &[&format!("{:.3} s", note.elapsed_s), level, item, &note.text]);
    }
    page.close("table");
}

fn how_to_read(page: &mut SvgPage, record: &RunRecord, digests: &[(String, String)], chain: Option<&str>) {
    page.element("h2", "", "How to read this");
    page.element(
        "p",
        "",
        "A value is passed if it lies within its limits, bounds included. It is marginal if it is good but inside the \
         band that the plan sets beside a limit. Errored means that the station could not tell; it says nothing about \
         the module. A value without a limit is information. The worst item counts.",
    );
    page.element(
        "p",
        "",
        "Uncertainties are expanded: U = k u, with the coverage factor k of the effective degrees of freedom \
         (Welch-Satterthwaite) for the probability stated, or chi-square intervals of standard deviations. Each item \
         shows its budgets. Plots show at most 400 points of a curve, the smallest and largest of each part.",
    );
    page.element(
        "p",
        "",
        "This page was made from run.json in the same folder. SHA256SUMS holds the digests of all files of the folder, \
         this page included.",
    );
    page.open("table", "facts");
    page.row("th", &["File", "SHA-256"]);
    page.row("td", &["plan with all included files", &record.plan.sha256]);
    for (name, digest) in digests {
        page.row("td", &[name, digest]);
    }
    page.close("table");
    if let Some(chain) = chain {
        page.element(
            "p",
            "",
            "When the run began, the chain of the records folder had got this line, its number and its link. It witnesses all runs \
             before it: `gnc-station records verify --head` with both, in quotation marks, finds whether they are still as they were.",
        );
        page.element("pre", "", chain);
    }
}

fn anchor(name: &str) -> String {
    let harmless = |character: char| if character.is_ascii_alphanumeric() { character } else { '-' };
    format!("item-{}", name.chars().map(harmless).collect::<String>())
}

fn is_bad(outcome: Outcome) -> bool {
    matches!(outcome, Outcome::Marginal | Outcome::Failed | Outcome::Errored | Outcome::Aborted)
}

fn word(outcome: Outcome) -> &'static str {
    if outcome == Outcome::NotRun { "not run" } else { outcome.as_str() }
}

/// The class by which the style sheet colours an outcome; the word always stands beside it.
fn class(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Passed => "passed",
        Outcome::Marginal => "marginal",
        Outcome::Failed => "failed",
        Outcome::Errored => "errored",
        Outcome::Aborted => "aborted",
        Outcome::Skipped | Outcome::NotRun => "skipped",
    }
}

/// A number for people: six significant digits without trailing zeros.
fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return value.to_string();
    }
    let magnitude = value.abs().log10().floor();
    if !(-5.0..9.0).contains(&magnitude) {
        return format!("{value:.5e}");
    }
    let digits = (5.0 - magnitude).clamp(0.0, 12.0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}
