//! Drawing. It only reads the model, and every screen can be drawn again from it.

mod allan;
mod attitude;
mod big;
mod board;
mod calibration;
mod compact;
mod detail;
mod dialog;
mod field;
mod frame;
mod glyphs;
mod live;
mod log;
mod module;
mod panels;
mod picture;
mod records;
mod rows;
mod setup;
mod shift;
mod style;
mod text;
mod trouble;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::Line;
use ratatui::widgets::{Paragraph, Wrap};

use super::lang::fill;
use super::model::{Over, ScreenModel, ScreenPage};
use super::pictures::PictureWanted;

/// The smallest screen with panels. A list scrolls where it has not enough rows.
pub(crate) const MIN_WIDTH: u16 = 80;
/// The smallest screen with panels: seven rows of panels and a few of the list.
pub(crate) const MIN_HEIGHT: u16 = 16;
/// The smallest screen that shows more than the verdict.
const LEAST: (u16, u16) = (24, 6);
/// From this width on lists and details stand side by side.
pub(crate) const WIDE: u16 = 120;

/// Draws the screen.
pub(crate) fn draw(model: &ScreenModel, frame: &mut Frame<'_>) {
    let area = frame.area();
    if area.width < LEAST.0 || area.height < LEAST.1 {
        too_small(model, frame, area);
    } else {
        whole(model, frame, area);
    }
    glyphs::translate(frame.buffer_mut(), model.look.glyphs);
}

fn too_small(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let (width, height) = (area.width.to_string(), area.height.to_string());
    let mut lines = vec![Line::from(fill(model.texts.too_small, &[&width, &height]))];
    // The outcome matters most, and it fits anywhere.
    if let Some(run) = &model.run {
        let word = match run.verdict() {
            Some(verdict) => model.texts.word_of(verdict),
            None => model.texts.running,
        };
        lines.insert(0, Line::styled(word.to_uppercase(), style::strong()));
    }
    frame.render_widget(Paragraph::new(lines).wrap(Wrap { trim: true }), area);
}

/// Head, body, troubles, message, foot.
fn rows(area: Rect, troubles: usize, messages: usize) -> [Rect; 5] {
    Layout::vertical([
        Constraint::Length(1),
        Constraint::Fill(1),
        Constraint::Length(troubles as u16),
        Constraint::Length(messages as u16),
        Constraint::Length(1),
    ])
    .areas(area)
}

/// Whether a layer stands before the question of the run.
fn hides_prompt(over: Option<&Over>) -> bool {
    !matches!(over, None | Some(Over::Item { .. } | Over::Log { .. } | Over::Mistakes { .. }))
}

/// The picture of the question on the screen, if the terminal can draw it and there is room.
pub(crate) fn picture_wanted(model: &ScreenModel, area: Rect) -> Option<PictureWanted> {
    if area.width < LEAST.0 || area.height < LEAST.1 || hides_prompt(model.over.last()) {
        return None;
    }
    let [_, body, ..] = rows(area, trouble::lines(model, area).len(), frame::message(model, area).len());
    dialog::picture_wanted(model, body)
}

fn whole(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let troubles = trouble::lines(model, area);
    let messages = frame::message(model, area);
    let [head, body, trouble, message, foot] = rows(area, troubles.len(), messages.len());
    frame::head(model, frame, head);
    let small = frame.area().width < MIN_WIDTH || frame.area().height < MIN_HEIGHT;
    match (model.over.last(), model.page) {
        (Some(Over::Help { place, scroll }), _) => dialog::help(model, frame, body, *place, *scroll),
        (Some(Over::Setup(form)), _) => setup::draw(model, form, frame, body),
        (Some(Over::Item { name, scroll }), _) => detail::page(model, frame, body, name, *scroll),
        (Some(Over::Log { scroll }), _) => log::page(model, frame, body, *scroll),
        (Some(Over::Mistakes { scroll }), _) => panels::all_mistakes(model, frame, body, *scroll),
        (_, ScreenPage::Tests | ScreenPage::Calibration | ScreenPage::Live) if small => {
            compact::draw(model, frame, body);
        }
        (_, ScreenPage::Tests) => board::draw(model, frame, body),
        (_, ScreenPage::Calibration) => calibration::draw(model, frame, body),
        (_, ScreenPage::Live) => live::draw(model, frame, body),
        (_, ScreenPage::Records) => records::draw(model, frame, body),
    }
    match model.over.last() {
        Some(Over::Again(run)) => dialog::again(model, frame, body, run),
        Some(Over::Changed(files)) => dialog::changed(model, frame, body, files),
        Some(Over::Interrupted(run)) => dialog::interrupted(model, frame, body, run),
        Some(Over::NoResume { why }) => dialog::no_resume(model, frame, body, why),
        Some(Over::Leave) => dialog::leave(model, frame, body),
        Some(Over::Stop { lost_s }) => dialog::stop(model, frame, body, *lost_s),
        Some(Over::GiveUp { item, lost_s }) => dialog::give_up(model, frame, body, item, *lost_s),
        over if hides_prompt(over) => {}
        _ => dialog::prompt(model, frame, body),
    }
    text::lines(frame, troubles, trouble);
    text::lines(frame, messages, message);
    frame::foot(model, frame, foot);
}

#[cfg(test)]
pub(in crate::tui) use big::has as can_draw;
#[cfg(test)]
pub(in crate::tui) use calibration::plan_left_s;
#[cfg(test)]
pub(in crate::tui) use frame::key_label;
#[cfg(test)]
pub(in crate::tui) use text::width as text_width;
