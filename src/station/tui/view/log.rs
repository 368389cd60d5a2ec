//! The log of a run: its events in the order in which they happened.

use gnc_bench::fixture::Ask;
use gnc_executive::event::{BoardBreach, NoteLevel};
use gnc_executive::state::RunState;
use gnc_executive::text::duration;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::panels::block;
use super::{detail, style, text};
use crate::tui::model::{MessageWeight, ScreenModel};

/// Lines of a log that are kept for the screen; the record has them all.
const MAX_LINES: usize = 2000;

struct Entry {
    elapsed_us: u64,
    style: Style,
    text: String,
}

/// The whole log.
pub(super) fn page(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, scroll: usize) {
    let lines = |cells| lines(model, model.shown_state(), cells);
    detail::scrolled(model, frame, area, model.texts.log, scroll, lines);
}

/// The newest lines of the run on the tests page.
pub(super) fn pane(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let block = block(model.texts.log);
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let lines = lines(model, model.run.as_ref().map(|run| &run.state), usize::from(inner.width));
    let first = lines.len().saturating_sub(usize::from(inner.height));
    text::lines(frame, lines.into_iter().skip(first), inner);
}

fn lines(model: &ScreenModel, state: Option<&RunState>, cells: usize) -> Vec<Line<'static>> {
    let Some(state) = state else { return Vec::new() };
    let mut entries = entries(model, state);
    // Stable, so that events of one moment keep their order.
    entries.sort_by_key(|entry| entry.elapsed_us);
    let first = entries.len().saturating_sub(MAX_LINES);
    let started = state.started();
    let shown = entries.into_iter().skip(first).flat_map(|entry| {
        let at = started.map(|at| at + chrono::TimeDelta::microseconds(entry.elapsed_us as i64));
        let time = at.map(|at| at.format("%H:%M:%S ").to_string()).unwrap_or_default();
        let indent = time.len();
        let lines = text::wrap(&entry.text, cells.saturating_sub(indent)).into_iter().enumerate();
        let style = entry.style;
        lines
            .map(move |(index, line)| {
                let before = if index == 0 { time.clone() } else { " ".repeat(indent) };
                Line::from(vec![Span::styled(before, style::faint()), Span::styled(line, style)])
            })
            .collect::<Vec<_>>()
    });
    shown.collect()
}

/// How notes of questions and answers begin in the state of a run.
const ASKED: &str = "asked: ";
const ANSWERED: &str = "answered: ";

fn entries(model: &ScreenModel, state: &RunState) -> Vec<Entry> {
    let texts = model.texts;
    let plain = |elapsed_us, text: String| Entry { elapsed_us, style: Style::new(), text: text::shown(&text) };
    let mut entries = Vec::new();
    if let Some(header) = state.header() {
        let plan = format!("{} {}", header.plan.name, header.plan.version);
        entries.push(plain(0, format!("{}: {}, {plan}", texts.started, header.serial_number)));
    }
    if let Some(board) = state.board() {
        entries.push(plain(
            0,
            format!("{} {} ({}) {}", texts.board, board.board_serial, board.firmware, model.said(&board.link)),
        ));
    }
    let first = state.rows().len().saturating_sub(MAX_LINES);
    for row in &state.rows()[first..] {
        if let Some(ended) = row.ended {
            let took = row.elapsed_us().map(|us| duration(us as f64 / 1e6)).unwrap_or_default();
            let outcome = (texts.outcome_word)(row.outcome);
            let line = text::shown(&format!("{}: {outcome} {took}", row.planned.name));
            entries.push(Entry {
                elapsed_us: ended.elapsed_us,
                style: style::outcome(model.look, row.outcome),
                text: format!("{} {}", style::mark(row.outcome), line.trim()),
            });
        }
    }
    for note in state.notes() {
        let style = match note.level {
            NoteLevel::Info => Style::new(),
            NoteLevel::Warning => style::weight(model.look, MessageWeight::Warning),
            NoteLevel::Error => style::weight(model.look, MessageWeight::Error),
        };
        let item = note.item.as_ref().map(|item| format!("{item}: ")).unwrap_or_default();
        let level = match note.level {
            NoteLevel::Info => String::new(),
            level => format!("{}: ", (texts.level)(level)),
        };
        let text = match (note.text.strip_prefix(ASKED), note.text.strip_prefix(ANSWERED)) {
            (Some(asked), _) => format!("{}: {}", texts.asked_log, model.said(Ask::without_key(asked))),
            (None, Some(answer)) => format!("{}: {answer}", texts.answered_log),
            (None, None) => model.said(&note.text).into_owned(),
        };
        entries.push(Entry { style, ..plain(note.stamp.elapsed_us, format!("{level}{item}{text}")) });
    }
    for seen in state.breaches() {
        let weight = if seen.breach.safety { MessageWeight::Error } else { MessageWeight::Warning };
        let BoardBreach { section, what, count, worst, .. } = &seen.breach;
        let worst = worst.as_ref().map(|worst| format!(", {}", model.said(worst))).unwrap_or_default();
        let what = model.said(what);
        let line = format!("{}: §{section}: {what} ({count}×{worst})", texts.board_breaks);
        entries.push(Entry { style: style::weight(model.look, weight), ..plain(seen.first.elapsed_us, line) });
    }
    if let (Some(verdict), Some(last)) = (state.verdict(), state.last()) {
        let line = format!("{}: {}", texts.ended_at, texts.word_of(verdict));
        let style = style::verdict(model.look, verdict);
        entries.push(Entry { style, ..plain(last.elapsed_us, line) });
    }
    entries
}
