//! The records page.

use gnc_executive::outcome::Outcome;
use gnc_executive::text::duration;
use gnc_executive::verdict::Verdict;
use gnc_records::standing::Face;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::panels::block_in;
use super::rows::first_shown;
use super::{WIDE, detail, frame as edges, rows, shift, style, text};
use crate::tui::lang::fill;
use crate::tui::model::{MessageWeight, ScreenModel, order};
use crate::tui::records::{Check, MAX_RUNS, OpenRun, RunLine, Runs, word};
use crate::tui::update::checked_words;

pub(super) fn draw(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    match (&model.records.open, &model.records.runs) {
        (Some(open), _) => one(model, open, frame, area),
        (None, Some(runs)) => list(model, runs, frame, area),
        (None, None) => days(model, frame, area),
    }
}

/// A line over its whole width, with a sign at the cursor, so that the cursor is seen without colours.
fn line(here: bool, spans: Vec<Span<'static>>, cells: usize) -> Line<'static> {
    let mut all = vec![Span::raw(if here { "> " } else { "  " })];
    all.extend(spans);
    let used: usize = all.iter().map(Span::width).sum();
    all.push(Span::raw(" ".repeat(cells.saturating_sub(used))));
    let line = Line::from(all);
    if here { line.patch_style(style::turned()) } else { line }
}

fn days(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let area = match model.shift.as_ref().filter(|shift| !shift.modules.is_empty()) {
        Some(shift) => {
            let height = shift::HEIGHT.min(4 + u16::try_from(shift.modules.len()).unwrap_or(u16::MAX));
            let [top, below] = Layout::vertical([Constraint::Length(height), Constraint::Fill(1)]).areas(area);
            shift::panel(model, shift, frame, top);
            below
        }
        None => area,
    };
    let records = &model.records;
    let block = block_in(&format!("{}: {}", texts.records, texts.days), area);
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let folder = model.bench.ready().map(|bench| gnc_text::shown_path(&bench.records)).unwrap_or_default();
    let say = |words: String| Line::styled(words, style::faint());
    let lines = match (&records.days, &records.error) {
        (_, Some(error)) => {
            vec![Line::styled(text::shown(&model.said(error)), style::weight(model.look, MessageWeight::Error))]
        }
        (None, None) => vec![say(texts.reading_records.to_owned())],
        (Some(days), None) if days.is_empty() => vec![say(fill(texts.no_records, &[&folder]))],
        (Some(days), None) => {
            let room = usize::from(inner.height);
            let first = first_shown(records.day_cursor, days.len(), room);
            let shown = days.iter().enumerate().skip(first).take(room);
            let each = shown.map(|(index, day)| {
                let count = fill(texts.modules, &[&day.serial_numbers.to_string()]);
                let spans =
                    vec![Span::raw(text::fit(&text::shown(&day.name), 14)), Span::styled(count, style::faint())];
                line(index == records.day_cursor, spans, usize::from(inner.width))
            });
            each.collect()
        }
    };
    text::lines(frame, lines, inner);
}

fn list(model: &ScreenModel, runs: &Runs, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let records = &model.records;
    let filter = match records.filter {
        None => texts.filter_all.to_owned(),
        Some(verdict) => texts.word_of(verdict).to_owned(),
    };
    let title = format!("{}: {} · {}: {filter}", texts.records, runs.day, texts.filter);
    let mut block = block_in(&title, area);
    if !records.search.is_empty() {
        block = block.title_bottom(format!(" {}: {}_ ", texts.search, text::shown(records.search.text())));
    }
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let shown = records.shown();
    let cells = usize::from(inner.width);
    let head = format!(
        "  {} {} {} {} {}",
        text::fit(texts.start_time, 8),
        text::fit(texts.serial_number, 18),
        text::fit(texts.outcome, OUTCOME),
        text::fit(texts.plan, 13),
        text::right(texts.time, 9)
    );
    let narrow = format!("  {} {}, {}", text::fit(texts.start_time, 8), texts.outcome, texts.serial_number);
    let head = if cells < WHOLE { narrow } else { head };
    let mut lines = vec![Line::styled(text::cut(&head, cells), style::faint())];
    if let Some(error) = &records.error {
        lines.push(Line::styled(text::shown(&model.said(error)), style::weight(model.look, MessageWeight::Error)));
    }
    if shown.is_empty() {
        lines.push(Line::styled(text::cut(texts.no_run_matches, cells), style::faint()));
    }
    if runs.cut {
        lines.push(Line::styled(fill(texts.too_many_runs, &[&MAX_RUNS.to_string()]), style::strong()));
    }
    let room = usize::from(inner.height).saturating_sub(lines.len());
    let first = first_shown(records.run_cursor, shown.len(), room);
    for (index, run) in shown.iter().enumerate().skip(first).take(room) {
        let before = index.checked_sub(1).and_then(|before| shown.get(before));
        let same = index > first && before.is_some_and(|before| before.serial_number == run.serial_number);
        lines.push(line(index == records.run_cursor, run_spans(model, run, same, cells), cells));
    }
    text::lines(frame, lines, inner);
}

/// Width of an outcome in the list.
const OUTCOME: usize = 13;
/// Cells of a line before the caveats: cursor, time, serial number, outcome, plan, time and a gap.
const BEFORE_CAVEATS: usize = 2 + 9 + 19 + (OUTCOME + 1) + 14 + 9 + 1;
/// Cells from which on a line has room for all columns and short caveats.
const WHOLE: usize = BEFORE_CAVEATS + 3 + 1 + 3;
/// Lines above the reasons why a run is no evidence, with the borders.
const HEAD_OF_RUN: u16 = 5;

fn run_spans(model: &ScreenModel, run: &RunLine, same: bool, cells: usize) -> Vec<Span<'static>> {
    let texts = model.texts;
    let (mark, word, mark_style) = mark(model, run.face);
    let time = run.at.map(|at| at.format("%H:%M:%S").to_string()).unwrap_or_default();
    let number_style = if same { style::faint() } else { style::strong() };
    let caveats = [
        (run.simulated, texts.simulated, texts.simulated_short),
        (run.unproven, texts.unproven, texts.unproven_short),
        (run.selection, texts.selection, texts.selection_short),
        (run.rejudged, texts.rejudged, texts.rejudged_short),
        (matches!(run.face, Face::Late(_)), texts.late, texts.late_short),
    ];
    let caveats = || caveats.iter().filter(|(is, ..)| *is);
    let whole = caveats().map(|(_, word, _)| *word).collect::<Vec<_>>().join(" ");
    if cells < WHOLE {
        // The caveats stand before the outcome, so that no line reads as a pass of a module that was not tested. What does not fit
        // behind it, the plan and the time that the run took, is in the run itself.
        let short = caveats().map(|(.., short)| *short).collect::<Vec<_>>().join(" ");
        let told = if short.is_empty() { short } else { format!("{short} ") };
        let outcome = format!("{mark} {word}");
        let room = cells.saturating_sub(2 + 9 + text::width(&told) + text::width(&outcome) + 1);
        return vec![
            Span::raw(text::fit(&time, 9)),
            Span::styled(told, style::badge(model.look)),
            Span::styled(format!("{outcome} "), mark_style),
            Span::styled(text::cut(&text::shown(&run.serial_number), room), number_style),
        ];
    }
    // On a narrow screen each caveat keeps its place in a few letters.
    let fits = text::width(&whole) <= cells.saturating_sub(BEFORE_CAVEATS);
    let told = if fits { whole } else { caveats().map(|(.., short)| *short).collect::<Vec<_>>().join(" ") };
    vec![
        Span::raw(text::fit(&time, 9)),
        Span::styled(text::fit(&text::shown(&run.serial_number), 19), number_style),
        Span::styled(text::fit(&format!("{mark} {word}"), OUTCOME + 1), mark_style),
        Span::raw(text::fit(&text::shown(&run.plan), 14)),
        Span::raw(text::right(&duration(run.elapsed_s), 9)),
        Span::styled(format!(" {told}"), style::faint()),
    ]
}

fn mark(model: &ScreenModel, face: Face) -> (&'static str, &'static str, Style) {
    let (sign, verdict) = match face {
        Face::Ended(verdict) => (style::verdict_mark(verdict), verdict),
        _ => ("?", Verdict::Module(Outcome::Aborted)),
    };
    (sign, word(face, model.texts), style::verdict(model.look, verdict))
}

fn one(model: &ScreenModel, open: &OpenRun, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let mut reasons = edges::no_evidence(model);
    if matches!(open.face, Face::Late(_)) {
        reasons.push(texts.late_long.to_owned());
    }
    // A record without reasons keeps its empty line.
    let height = HEAD_OF_RUN + u16::try_from(reasons.len()).unwrap_or(1).max(1);
    let [top, body] = Layout::vertical([Constraint::Length(height), Constraint::Fill(1)]).areas(area);
    let name = text::shown(&open.path.file_name().unwrap_or_default().to_string_lossy());
    let block = block_in(&name, top);
    let inner = block.inner(top);
    frame.render_widget(block, top);
    let (sign, word, sign_style) = mark(model, open.face);
    let cells = usize::from(inner.width);
    let mut lines = Vec::new();
    if let Some(header) = open.state.header() {
        let started = open.state.started().map(|at| at.format("%F %T").to_string()).unwrap_or_default();
        lines.push(Line::from(vec![
            Span::styled(format!("{sign} {} ", word.to_uppercase()), sign_style.patch(style::strong())),
            Span::styled(format!("{}  ", text::shown(&header.serial_number)), style::strong()),
            Span::raw(format!("{} {}  {started}", text::shown(&header.plan.name), text::shown(&header.plan.version))),
        ]));
        let operator = header.operator.as_deref().unwrap_or("-");
        let who = format!("{} {operator}  {} {}", texts.operator, texts.station, header.station);
        lines.push(Line::raw(text::cut(&text::shown(&who), cells)));
    }
    lines.push(check(model, &open.check, cells));
    lines.extend(reasons.iter().map(|reason| Line::styled(text::cut(reason, cells), style::strong())));
    text::lines(frame, lines, inner);
    if area.width >= WIDE {
        let [left, right] = Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1)]).areas(body);
        rows::of_record(model, &open.state, open.cursor, frame, left);
        let position = order(&open.state).get(open.cursor).copied();
        detail::show(model, position.map(|position| &open.state.rows()[position]), frame, right);
    } else {
        rows::of_record(model, &open.state, open.cursor, frame, body);
    }
}

fn check(model: &ScreenModel, check: &Check, cells: usize) -> Line<'static> {
    let texts = model.texts;
    match check {
        Check::NotAsked => Line::styled((texts.key)(crate::tui::keymap::KeyAction::Verify).long, style::faint()),
        Check::Running => Line::styled(texts.verifying, style::faint()),
        Check::Done(checked) => {
            let (weight, words) = checked_words(model.lang, checked);
            let (sign, outcome) = match weight {
                MessageWeight::Info => ("✓", Outcome::Passed),
                MessageWeight::Warning => ("?", Outcome::Aborted),
                MessageWeight::Error => ("✗", Outcome::Failed),
            };
            let line = text::cut(&format!("{sign} {}", text::shown(&words)), cells);
            Line::styled(line, style::outcome(model.look, outcome))
        }
    }
}
