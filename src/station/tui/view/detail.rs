//! One item: its attempts, with every value and its limit.

use gnc_executive::event::NoteLevel;
use gnc_executive::measurement::Measurement;
use gnc_executive::state::{Attempt, Row};
use gnc_executive::text::duration;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::panels::block_in;
use super::{style, text};
use crate::tui::lang::fill;
use crate::tui::model::ScreenModel;

/// The item as a page of its own.
pub(super) fn page(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, name: &str, scroll: usize) {
    let row = model.shown_state().and_then(|state| state.row(name));
    let lines = |cells| row.map(|row| lines(model, row, cells)).unwrap_or_default();
    scrolled(model, frame, area, &title(model, row), scroll, lines);
}

/// The item under the cursor, beside the list.
pub(super) fn pane(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let name = model.item_under_cursor();
    let row = model.run.as_ref().zip(name).and_then(|(run, name)| run.state.row(name));
    show(model, row, frame, area);
}

/// An item beside a list of the records.
pub(super) fn show(model: &ScreenModel, row: Option<&Row>, frame: &mut Frame<'_>, area: Rect) {
    let block = block_in(&title(model, row), area);
    let inner = block.inner(area);
    frame.render_widget(block, area);
    if let Some(row) = row {
        let mut lines = lines(model, row, usize::from(inner.width));
        lines.truncate(usize::from(inner.height));
        text::lines(frame, lines, inner);
    }
}

fn title(model: &ScreenModel, row: Option<&Row>) -> String {
    match row {
        Some(row) => format!("{}: {}", text::shown(&row.planned.name), (model.texts.item_title)(row.planned.id)),
        None => model.texts.detail.to_owned(),
    }
}

/// Draws lines in a frame, from `scroll` on, and counts the lines that cannot be seen.
pub(super) fn scrolled(
    model: &ScreenModel,
    frame: &mut Frame<'_>,
    area: Rect,
    title: &str,
    scroll: usize,
    lines: impl FnOnce(usize) -> Vec<Line<'static>>,
) {
    let mut block = block_in(title, area);
    let inner = block.inner(area);
    let lines = lines(usize::from(inner.width));
    let room = usize::from(inner.height);
    let end = lines.len().saturating_sub(room);
    model.scroll_end.set(end);
    let first = scroll.min(end);
    if end > 0 {
        let place = format!(" {}-{}/{} ", first + 1, (first + room).min(lines.len()), lines.len());
        block = block.title_bottom(Line::raw(place).right_aligned());
    }
    frame.render_widget(block, area);
    let shown: Vec<Line<'_>> = lines.into_iter().skip(first).take(room).collect();
    text::lines(frame, shown, inner);
}

fn lines(model: &ScreenModel, row: &Row, cells: usize) -> Vec<Line<'static>> {
    let texts = model.texts;
    let mut lines = Vec::new();
    if let Some(cause) = &row.cause {
        let why = format!("{}: {}", (texts.outcome_word)(row.outcome), (texts.cause)(cause));
        lines.extend(text::wrap(&text::shown(&why), cells).into_iter().map(Line::raw));
    }
    // The attempt that counts stands first.
    for (index, attempt) in row.attempts.iter().enumerate().rev() {
        if row.attempts.len() > 1 {
            lines.push(attempt_head(model, index + 1, attempt));
        }
        lines.extend(attempt_lines(model, row, attempt, cells));
    }
    lines
}

fn attempt_head(model: &ScreenModel, number: usize, attempt: &Attempt) -> Line<'static> {
    let texts = model.texts;
    let mut head = fill(texts.attempt, &[&number.to_string()]);
    if let Some(outcome) = attempt.outcome {
        head.push_str(&format!(": {}", (texts.outcome_word)(outcome)));
    }
    if let Some(ended) = attempt.ended {
        let took = ended.elapsed_us.saturating_sub(attempt.started.elapsed_us) as f64 / 1e6;
        head.push_str(&format!(", {}", duration(took)));
    }
    Line::styled(head, style::strong())
}

fn attempt_lines(model: &ScreenModel, row: &Row, attempt: &Attempt, cells: usize) -> Vec<Line<'static>> {
    let texts = model.texts;
    let mut lines = Vec::new();
    if let Some(error) = &attempt.error {
        lines.extend(sentence(
            (texts.level)(NoteLevel::Error),
            &text::shown(&model.said(&error.text)),
            style::strong(),
            cells,
        ));
        // "The item runs again" is of a run that is on.
        let past = error.again && model.shown_state().is_some_and(|state| state.verdict().is_some());
        if !error.hint.is_empty() && !past {
            lines.extend(sentence(texts.try_this, &text::shown(&model.said(&error.hint)), Style::new(), cells));
        }
    }
    for record in &attempt.error_records {
        let (what, location) = (model.said(&record.what), model.said(&record.location));
        let said = format!("{what} ({location}): {} / {}", record.expected, record.got);
        lines.extend(sentence(texts.board_says, &text::shown(&said), Style::new(), cells));
    }
    if attempt.measurements.is_empty() && attempt.outcome.is_some() {
        lines.push(Line::styled(texts.nothing_measured, style::faint()));
    }
    let name_cells = (cells * 2 / 5).clamp(12, 30);
    let value_cells = (cells.saturating_sub(name_cells + 4) / 2).max(10);
    if !attempt.measurements.is_empty() {
        let head = format!(
            "  {} {} {}",
            text::fit(texts.measurement, name_cells),
            text::fit(texts.value, value_cells),
            text::cut(texts.limits, value_cells)
        );
        lines.push(Line::styled(head, style::faint()));
    }
    for measurement in &attempt.measurements {
        lines.push(value_line(model, measurement, name_cells, value_cells));
        let bad = measurement.outcome.is_some_and(super::rows::is_bad);
        if let Some(spec) = row.planned.id.spec().measurement(&measurement.name).filter(|_| bad) {
            lines.extend(sentence(texts.look_at, (texts.look_at_sentence)(spec.look_at), Style::new(), cells));
        }
    }
    lines
}

fn value_line(model: &ScreenModel, measurement: &Measurement, name_cells: usize, value_cells: usize) -> Line<'static> {
    let mut name = text::shown(&measurement.name);
    if let Some(repeat) = measurement.repeat {
        name.push_str(&format!(" ({repeat})"));
    }
    let (mark, style) = match measurement.outcome {
        Some(outcome) => (style::mark(outcome), style::outcome(model.look, outcome)),
        None => (" ", style::faint()),
    };
    Line::from(vec![
        Span::styled(format!("{mark} "), style),
        Span::raw(text::fit(&name, name_cells)),
        Span::raw(" "),
        Span::styled(text::fit(&text::shown(&model.said(&measurement.value_text())), value_cells), style),
        Span::raw(" "),
        Span::raw(text::cut(&text::shown(&measurement.limit_text()), value_cells)),
    ])
}

fn sentence(label: &str, what: &str, style: Style, cells: usize) -> Vec<Line<'static>> {
    let label = format!("  {label}: ");
    let indent = text::width(&label);
    let lines = text::wrap(what, cells.saturating_sub(indent)).into_iter().enumerate();
    lines
        .map(|(index, line)| {
            let before = if index == 0 { label.clone() } else { " ".repeat(indent) };
            Line::from(vec![Span::styled(before, style::faint()), Span::styled(line, style)])
        })
        .collect()
}
