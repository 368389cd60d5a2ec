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
use crate::tui::model::{Loaded, MessageWeight, Pause, ScreenModel, ScreenPage};

/// Cells of a serial number beside a verdict.
const STANDING_NUMBER: usize = 16;

/// What the head leaves out where there is little room, one step after the other. The verdict stays.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Room {
    All,
    NoStation,
    OnePage,
    NoPage,
    NoTime,
}

/// The station, the pages, and a badge if the bench is simulated.
pub(super) fn head(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let width = usize::from(area.width);
    let badges = badges(model);
    // That the bench is simulated stays in sight: the shortest badge must have room.
    let least = badges.last().map_or(0, |badge| text::width(badge));
    let cells = |(spans, time): &(Vec<Span<'static>>, String)| {
        spans.iter().map(Span::width).sum::<usize>() + text::width(time) + 1
    };
    let rooms = [Room::All, Room::NoStation, Room::OnePage, Room::NoPage];
    let fits = rooms.into_iter().map(|room| head_words(model, room)).find(|words| cells(words) + least <= width);
    let words = fits.unwrap_or_else(|| head_words(model, Room::NoTime));
    let room = width.saturating_sub(cells(&words));
    let (mut spans, time) = words;
    let badge = badges.into_iter().find(|badge| text::width(badge) <= room).unwrap_or_default();
    spans.push(Span::raw(" ".repeat(room + 1 - text::width(&badge))));
    if !badge.is_empty() {
        spans.push(Span::styled(badge, style::badge(model.look)));
    }
    spans.push(Span::raw(time));
    text::lines(frame, [Line::from(spans)], area);
}

/// All of the head but the badge, and the time.
fn head_words(model: &ScreenModel, room: Room) -> (Vec<Span<'static>>, String) {
    let texts = model.texts;
    let mut spans = Vec::new();
    if room < Room::NoStation {
        spans.push(Span::styled(format!(" {} ", texts.station_title), style::strong()));
    }
    let pages = [
        (ScreenPage::Tests, texts.tests),
        (ScreenPage::Calibration, texts.calibration),
        (ScreenPage::Live, texts.live),
        (ScreenPage::Records, texts.records),
    ];
    for (page, title) in pages.into_iter().filter(|(page, _)| *page != ScreenPage::Calibration || model.captures()) {
        let here = page == model.page;
        let label = if here { format!("[{title}]") } else { format!(" {title} ") };
        if room < Room::OnePage || (here && room < Room::NoPage) {
            spans.push(Span::styled(label, if here { style::turned() } else { Style::new() }));
        }
    }
    if let Some((word, style)) = standing(model) {
        spans.push(Span::raw(" "));
        spans.push(Span::styled(word, style));
    }
    let time = if room < Room::NoTime { model.now.at.format(" %H:%M ").to_string() } else { String::new() };
    (spans, time)
}

/// The verdict of the run, or that it is on, wherever the tests page does not show it.
fn standing(model: &ScreenModel) -> Option<(String, Style)> {
    let run = model.run.as_ref()?;
    if model.page == ScreenPage::Tests && model.over.is_empty() {
        return None;
    }
    if model.watching {
        // The module is under power, and the verdict is of a run before.
        return Some((format!(" {} ", model.texts.watching), style::accent(model.look)));
    }
    let number = text::cut(&text::shown(&run.serial_number), STANDING_NUMBER);
    Some(match run.verdict() {
        Some(verdict) => {
            // The word of the list: the letters of the large word are Latin where the language has others.
            let word = format!(" {} {number} ", model.texts.word_of(verdict).to_uppercase());
            (word, style::verdict_area(model.look, verdict))
        }
        None => (format!(" {} {number} ", super::panels::on(model, run)), style::accent(model.look)),
    })
}

/// What marks a simulated or an unproven bench, from the longest to the shortest words; none on a real bench.
fn badges(model: &ScreenModel) -> Vec<String> {
    let texts = model.texts;
    match &model.bench {
        Loaded::Ready(bench) if bench.kind == BenchKind::Simulated => {
            let name = text::shown(&bench.name);
            vec![
                format!(" {}: {name} ", texts.simulated),
                format!(" {} ", texts.simulated),
                format!(" {} ", texts.simulated_short),
            ]
        }
        Loaded::Ready(bench) if bench.kind == BenchKind::Unproven => {
            vec![format!(" {} ", texts.unproven), format!(" {} ", texts.unproven_short)]
        }
        _ => Vec::new(),
    }
}

/// Most lines of a message on a screen with panels: what is wrong, and what to do.
const MESSAGE_LINES: usize = 2;

/// The latest message; what warns is not cut as long as there is room.
pub(super) fn message(model: &ScreenModel, area: Rect) -> Vec<Line<'static>> {
    let Some((weight, message)) = &model.message else { return vec![Line::raw("")] };
    let cells = usize::from(area.width).saturating_sub(2);
    let small = area.width < super::MIN_WIDTH || area.height < super::MIN_HEIGHT;
    let shown = text::shown(message);
    let mut lines = match weight {
        MessageWeight::Warning | MessageWeight::Error if !small => text::wrap(&shown, cells),
        _ => vec![text::cut(&shown, cells)],
    };
    text::shorten(&mut lines, MESSAGE_LINES, cells);
    let style = style::weight(model.look, *weight);
    lines.into_iter().map(|line| Line::styled(format!(" {line}"), style)).collect()
}

/// The keys of the place, from the table of keys; closer together if there is little room. Where there is still less, the
/// last keys go, and a mark says so; help has them all. What stops or begins something stays to the last.
pub(super) fn foot(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let width = usize::from(area.width);
    let mut keys: Vec<_> = model.keys(model.place()).filter(|binding| binding.footer).collect();
    let line = |keys: &[&keymap::Binding], gap: &str| {
        let spans = keys.iter().flat_map(|binding| {
            let what = key_label(model, binding.action);
            [Span::styled(keymap::name(binding.key), style::turned()), Span::raw(format!("{gap}{what}{gap} "))]
        });
        Line::from(spans.collect::<Vec<_>>())
    };
    let roomy = line(&keys, " ");
    if roomy.width() <= width {
        return frame.render_widget(roomy, area);
    }
    let mut shown = line(&keys, "");
    // The space behind the last key is not needed.
    if shown.width() > width + 1 {
        while line(&keys, "").width() + 1 > width && keys.len() > 1 {
            let at = keys.iter().rposition(|binding| !matters(binding.action)).unwrap_or(keys.len() - 1);
            keys.remove(at);
        }
        shown = line(&keys, "");
        shown.push_span(Span::raw("…"));
    }
    frame.render_widget(shown, area);
}

/// Whether a key begins, ends or answers something.
fn matters(action: KeyAction) -> bool {
    !matches!(
        action,
        KeyAction::Help
            | KeyAction::Setup
            | KeyAction::NextPage
            | KeyAction::Leave
            | KeyAction::Log
            | KeyAction::Redraw
    )
}

/// What a key does now: a second stop stops at once, and an answer to a request is "done" and not "yes".
pub(in crate::tui) fn key_label(model: &ScreenModel, action: KeyAction) -> &'static str {
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
    if header.bench.kind == BenchKind::Unproven {
        let why = model.said(header.bench.unproven.as_deref().unwrap_or_default());
        reasons.push(fill(model.texts.unproven_long, &[&text::shown(&why)]));
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
