//! The tests page of a screen that is too small for panels: the verdict, what runs, and what is bad.

use gnc_executive::text::duration;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

use super::rows::{decided, is_bad};
use super::{frame as edges, style, text};
use crate::tui::lang::fill;
use crate::tui::model::{Loaded, MessageWeight, PowerKnown, RunView, ScreenModel, ScreenPage, order};

pub(super) fn draw(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let cells = usize::from(area.width);
    let number = model.run.as_ref().map(|run| &run.serial_number).or(model.scan.current.as_ref());
    let number = number.map_or_else(|| format!("_  ({})", texts.scan_here), |number| text::shown(number));
    let mut lines = vec![match &model.run {
        // The module is under power, and whatever stood here is of a run before.
        _ if model.watching => {
            let word = format!("{} {number}: {}", texts.watching, texts.no_verdict);
            Line::styled(text::cut(&word, cells), style::accent(model.look).patch(style::strong()))
        }
        Some(run) => headline(model, run, &number, cells),
        None => Line::styled(text::cut(&format!("{} {number}", super::panels::ready(model)), cells), style::strong()),
    }];
    if !model.scan.typed.is_empty() {
        let typed = format!("{} {}_", texts.serial_number, text::shown(model.scan.typed.text()));
        lines.push(Line::styled(text::cut(&typed, cells), style::accent(model.look).patch(style::strong())));
    }
    if model.watching {
        lines.push(Line::styled(texts.module_on, style::strong()));
    }
    let caveats = edges::no_evidence(model);
    lines.extend(caveats.iter().map(|caveat| Line::styled(text::cut(caveat, cells), style::strong())));
    let danger = model.run.as_ref().is_some_and(|run| run.state.breaches().iter().any(|seen| seen.breach.safety));
    let unknown = model.power() != PowerKnown::Known;
    for (is, words) in [(danger, texts.danger_powered), (unknown, texts.power_unknown)] {
        if is {
            lines.push(Line::styled(text::cut(words, cells), style::weight(model.look, MessageWeight::Error)));
        }
    }
    match (&model.run, &model.bench, &model.plan) {
        _ if model.watching => {}
        (Some(run), ..) if run.over => {
            lines.extend(of_run(model, run, cells));
            lines.extend(chosen(model, cells));
        }
        (Some(run), ..) => lines.extend(of_run(model, run, cells)),
        (None, Loaded::Refused(why), _) | (None, _, Loaded::Refused(why)) => {
            lines.extend(super::panels::of_mistakes(model, why, cells));
        }
        (None, _, Loaded::Ready(plan)) => {
            let what = format!("{} {}", text::shown(&plan.name), text::shown(&plan.version));
            lines.push(Line::raw(text::cut(&what, cells)));
            lines.extend(chosen(model, cells));
        }
        _ => lines.push(Line::raw(texts.loading)),
    }
    if model.page != ScreenPage::Tests || lines.len() < usize::from(area.height) {
        let (width, height) = (super::MIN_WIDTH.to_string(), super::MIN_HEIGHT.to_string());
        let hint = fill(texts.small_screen, &[&width, &height]);
        let hint = text::wrap(&hint, cells).into_iter().map(|line| Line::styled(line, style::faint()));
        // On another page than that of the tests, nothing else explains why the page is not there.
        let at = if model.page == ScreenPage::Tests { lines.len() } else { 1 };
        lines.splice(at..at, hint);
    }
    text::lines(frame, lines, area);
}

/// What F5 and F3 would run: a selection is told before it runs, and the item under the cursor has no list here.
fn chosen(model: &ScreenModel, cells: usize) -> Vec<Line<'static>> {
    let mut lines = Vec::new();
    if model.ticks.iter().any(|tick| !tick) {
        let (ticked, all) = (model.ticks.iter().filter(|tick| **tick).count(), model.ticks.len());
        let told = format!("F5: {ticked}/{all}  {}", model.texts.selection_long);
        lines.push(Line::styled(text::cut(&told, cells), style::strong()));
    }
    if let Some(item) = model.item_under_cursor() {
        lines.push(Line::raw(text::cut(&format!("F3: {}", text::shown(item)), cells)));
    }
    lines
}

/// The verdict, or how far the run is.
fn headline(model: &ScreenModel, run: &RunView, number: &str, cells: usize) -> Line<'static> {
    let texts = model.texts;
    if let Some(verdict) = run.verdict() {
        let word = format!("{}  {number}", texts.word_of(verdict).to_uppercase());
        return Line::styled(text::fit(&word, cells), style::verdict_area(model.look, verdict));
    }
    let (over, all) = super::panels::share(run);
    let word = format!("{} {over}/{all}  {number}", texts.running);
    Line::styled(text::cut(&word, cells), style::accent(model.look).patch(style::strong()))
}

/// The items at work, then the bad ones with what decided.
fn of_run(model: &ScreenModel, run: &RunView, cells: usize) -> Vec<Line<'static>> {
    let mut lines: Vec<Line<'static>> = Vec::new();
    for progress in &run.progress {
        let share = progress.done_permille.map_or_else(String::new, |done| format!(" {} %", done / 10));
        let line = format!("> {} {}{share}", text::shown(&progress.item), duration(progress.elapsed.as_secs_f64()));
        lines.push(Line::styled(text::cut(&line, cells), style::accent(model.look)));
    }
    for position in order(&run.state) {
        let row = &run.state.rows()[position];
        if row.is_over() && is_bad(row.outcome) {
            let mark = Span::styled(format!("{} ", style::mark(row.outcome)), style::outcome(model.look, row.outcome));
            let what = format!("{} {}", text::shown(&row.planned.name), decided(model, row));
            lines.push(Line::from(vec![mark, Span::raw(text::cut(&what, cells.saturating_sub(2)))]));
        }
    }
    lines
}
