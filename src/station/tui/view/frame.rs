//! The first line, the message and the keys.

use gnc_executive::event::BenchKind;
use gnc_executive::state::RunState;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::{style, text};
use crate::tui::keymap::{self, KeyAction, KeyContext};
use crate::tui::lang::fill;
use crate::tui::model::{Loaded, Pause, ScreenModel, ScreenPage};

/// Cells of a serial number beside a verdict.
const STANDING_NUMBER: usize = 16;

/// The station, the pages, and a badge if the bench is simulated.
pub(super) fn head(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let mut spans = vec![Span::styled(format!(" {} ", texts.station_title), style::strong())];
    let pages = [
        (ScreenPage::Tests, texts.tests),
        (ScreenPage::Calibration, texts.calibration),
        (ScreenPage::Live, texts.live),
        (ScreenPage::Records, texts.records),
    ];
    for (page, title) in pages.into_iter().filter(|(page, _)| *page != ScreenPage::Calibration || model.captures()) {
        let here = page == model.page;
        let label = if here { format!("[{title}]") } else { format!(" {title} ") };
        spans.push(Span::styled(label, if here { style::turned() } else { Style::new() }));
    }
    if let Some((word, style)) = standing(model) {
        spans.push(Span::raw(" "));
        spans.push(Span::styled(word, style));
    }
    let time = model.now.at.format(" %H:%M ").to_string();
    let used: usize = spans.iter().map(Span::width).sum();
    let room = usize::from(area.width).saturating_sub(used + text::width(&time) + 1);
    let badge = text::cut(&badge(model), room);
    spans.push(Span::raw(" ".repeat(room + 1 - text::width(&badge))));
    if !badge.is_empty() {
        spans.push(Span::styled(badge, style::badge(model.look)));
    }
    spans.push(Span::raw(time));
    frame.render_widget(Line::from(spans), area);
}

/// The verdict of the run, or that it is on, wherever the tests page does not show it.
fn standing(model: &ScreenModel) -> Option<(String, Style)> {
    let run = model.run.as_ref()?;
    if model.page == ScreenPage::Tests && model.over.is_empty() {
        return None;
    }
    let number = text::cut(&text::shown(&run.serial_number), STANDING_NUMBER);
    Some(match run.verdict() {
        Some(verdict) => {
            let word = format!(" {} {number} ", (model.texts.verdict)(verdict));
            (word, style::verdict_area(model.look, verdict))
        }
        None => (format!(" {} {number} ", model.texts.running), style::accent(model.look)),
    })
}

fn badge(model: &ScreenModel) -> String {
    match &model.bench {
        Loaded::Ready(bench) if bench.kind == BenchKind::Simulated => {
            format!(" {}: {} ", model.texts.simulated, text::shown(&bench.name))
        }
        _ => String::new(),
    }
}

/// The latest message.
pub(super) fn message(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let Some((weight, message)) = &model.message else { return };
    let cells = usize::from(area.width).saturating_sub(2);
    let line =
        Line::styled(format!(" {}", text::cut(&text::shown(message), cells)), style::weight(model.look, *weight));
    frame.render_widget(line, area);
}

/// The keys of the place, from the table of keys; closer together if there is little room.
pub(super) fn foot(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let keys = || keymap::bindings(model.place()).filter(|binding| binding.footer);
    let line = |gap: &str| {
        let spans = keys().flat_map(|binding| {
            let what = key_label(model, binding.action);
            [Span::styled(keymap::name(binding.key), style::turned()), Span::raw(format!("{gap}{what}{gap} "))]
        });
        Line::from(spans.collect::<Vec<_>>())
    };
    let roomy = line(" ");
    let shown = if roomy.width() <= usize::from(area.width) { roomy } else { line("") };
    frame.render_widget(shown, area);
}

/// What a key does now: a second stop stops at once, and an answer to a request is "done" and not "yes".
pub(super) fn key_label(model: &ScreenModel, action: KeyAction) -> &'static str {
    let texts = model.texts;
    let run = model.run.as_ref().filter(|run| !run.over);
    match action {
        KeyAction::Stop if run.is_some_and(|run| run.stops > 0) => texts.stop_now,
        KeyAction::Pause if run.is_some_and(|run| run.pause == Pause::Asked) => texts.go_on,
        KeyAction::Yes if model.takes_words() => texts.answer_takes,
        KeyAction::Yes if [KeyContext::Prompt, KeyContext::Question].contains(&model.place()) => texts.done,
        KeyAction::No if [KeyContext::Prompt, KeyContext::Question].contains(&model.place()) => texts.not_possible,
        _ => (texts.key)(action).short,
    }
}

/// Why the run on the screen is not evidence about a module; empty if it is.
pub(super) fn no_evidence(model: &ScreenModel) -> Vec<String> {
    let mut reasons = Vec::new();
    let Some(header) = model.shown_state().and_then(RunState::header) else { return reasons };
    if header.bench.kind == BenchKind::Simulated {
        let name = header.bench.personality.as_deref().unwrap_or_default();
        reasons.push(fill(model.texts.simulated_long, &[&text::shown(name)]));
    }
    if let Some(other) = model.shown_state().and_then(RunState::other_module) {
        let [found, scanned] = [&other.found, &other.scanned].map(|number| text::shown(number));
        reasons.push(fill(model.texts.other_module, &[&found, &scanned]));
    }
    if header.selection.is_some() {
        reasons.push(model.texts.selection_long.to_owned());
    }
    if let Some(earlier) = &header.recomputed {
        reasons.push(fill(model.texts.rejudged_long, &[&text::shown(&earlier.run)]));
    }
    reasons
}
