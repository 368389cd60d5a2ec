//! Layers over a page: questions and the list of keys.

use gnc_executive::standing::Standing;
use gnc_executive::text::duration;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, BorderType, Clear};

use super::{detail, picture, style, text};
use crate::files::ChangedFile;
use crate::tui::keymap::{self, KeyAction, KeyContext};
use crate::tui::lang::fill;
use crate::tui::model::{Glyphs, Prompt, ScreenModel};
use crate::tui::pending::Interrupted;

/// Files that a question names; a plan with more is better looked at in its folder.
const MAX_FILES: usize = 6;
/// Width of a question.
const WIDTH: u16 = 66;

/// Draws the frame of a question and says where its content goes.
fn over(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, title: &str, rows: u16) -> Rect {
    let (width, height) = (WIDTH.min(area.width), (rows + 2).min(area.height));
    let place = Rect { x: area.x + (area.width - width) / 2, y: area.y + (area.height - height) / 2, width, height };
    let border = if model.look.glyphs == Glyphs::Unicode { BorderType::Double } else { BorderType::Plain };
    let block = Block::bordered()
        .border_type(border)
        .title(Span::styled(format!(" {} ", text::cut(title, usize::from(width).saturating_sub(4))), style::strong()))
        .border_style(style::accent(model.look));
    let inner = block.inner(place);
    free_left_edge(frame, place);
    frame.render_widget(Clear, place);
    frame.render_widget(block, place);
    inner.inner(ratatui::layout::Margin { horizontal: 1, vertical: 0 })
}

/// Removes wide characters whose second half lies under the left border: the terminal would show them instead of it.
fn free_left_edge(frame: &mut Frame<'_>, place: Rect) {
    let Some(x) = place.x.checked_sub(1) else { return };
    for y in place.top()..place.bottom() {
        if let Some(cell) = frame.buffer_mut().cell_mut((x, y)).filter(|cell| text::width(cell.symbol()) > 1) {
            cell.set_symbol(" ");
        }
    }
}

/// "F2 Yes   Esc No", in as many lines as they need.
fn answers(model: &ScreenModel, cells: usize) -> Vec<Line<'static>> {
    let keys = model.keys(model.place()).filter(|binding| binding.footer && binding.action != KeyAction::Stop);
    let (mut lines, mut line) = (Vec::new(), Line::default());
    for binding in keys {
        let name = Span::styled(keymap::name(binding.key), style::turned());
        let what = Span::raw(format!(" {}", super::frame::key_label(model, binding.action)));
        if line.width() > 0 && line.width() + name.width() + what.width() > cells {
            lines.push(std::mem::take(&mut line));
        }
        line.spans.extend([name, what, Span::raw("   ")]);
    }
    lines.push(line);
    lines
}

/// Draws a question. The last of its texts is what is asked, and stays whole where there is little room.
fn question(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, title: &str, words: &[String]) {
    let cells = usize::from(WIDTH.min(area.width)).saturating_sub(4);
    let Some((asked, before)) = words.split_last() else { return };
    let asked = text::wrap(asked, cells);
    let mut lines: Vec<String> = before.iter().flat_map(|words| text::wrap(words, cells)).collect();
    let answers = answers(model, cells);
    let rows = |lines: usize| (lines + asked.len() + answers.len()) as u16;
    let place = over(model, frame, area, title, rows(lines.len()) + 1);
    let room = usize::from(place.height).saturating_sub(asked.len() + answers.len());
    text::shorten(&mut lines, room, cells);
    // On a small screen the gap goes first, and the answers never.
    let [words_area, answer_area] =
        Layout::vertical([Constraint::Fill(1), Constraint::Length(answers.len() as u16)]).areas(place);
    text::lines(frame, lines.into_iter().chain(asked).map(Line::raw), words_area);
    text::lines(frame, answers, answer_area);
}

/// The plan was run on the module before.
pub(super) fn again(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, standing: &Standing) {
    let number = model.scan.current.as_deref().map(text::shown).unwrap_or_default();
    let said = format!("{number}: {}", model.said(&standing.to_string()));
    question(model, frame, area, model.texts.again_title, &[said, model.texts.again_question.to_owned()]);
}

/// Files are not as they were checked.
pub(super) fn changed(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, files: &[ChangedFile]) {
    let texts = model.texts;
    let mut lines: Vec<String> = files.iter().take(MAX_FILES).map(|file| changed_file(model, file)).collect();
    if files.len() > MAX_FILES {
        lines.push(fill(texts.more_lines, &[&(files.len() - MAX_FILES).to_string()]));
    }
    lines.push(texts.changed_question.to_owned());
    question(model, frame, area, texts.changed_title, &lines);
}

fn changed_file(model: &ScreenModel, file: &ChangedFile) -> String {
    let name = text::shown(&file.name);
    match &file.unreadable {
        None => fill(model.texts.file_changed, &[&name]),
        Some(why) => fill(model.texts.file_unreadable, &[&name, &text::shown(&model.said(why))]),
    }
}

/// A run of the module broke off.
pub(super) fn interrupted(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, run: &Interrupted) {
    let texts = model.texts;
    let number = model.scan.current.as_deref().map(text::shown).unwrap_or_default();
    let at = run.at.format("%F %H:%M").to_string();
    let words = fill(texts.interrupted_question, &[&number, &at]);
    question(model, frame, area, texts.interrupted_title, &[words]);
}

/// The run that was asked for cannot be taken up.
pub(super) fn no_resume(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, why: &str) {
    let texts = model.texts;
    let of_items = model.pending.as_ref().is_some_and(|pending| pending.selection.is_some());
    let asked = if of_items { texts.no_resume_items } else { texts.no_resume_question };
    let lines = [text::shown(&model.said(why)), asked.to_owned()];
    question(model, frame, area, texts.interrupted_title, &lines);
}

/// A run is on.
pub(super) fn leave(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    question(model, frame, area, model.texts.leave_title, &[model.texts.leave_question.to_owned()]);
}

/// A stop would lose captures.
pub(super) fn stop(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, lost_s: f64) {
    let words = fill(model.texts.stop_question, &[&duration(lost_s)]);
    question(model, frame, area, model.texts.stop_title, &[words]);
}

/// The run asks for something.
pub(super) fn prompt(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let Some(prompt) = model.run.as_ref().and_then(|run| run.prompt.as_ref()) else { return };
    let cells = usize::from(WIDTH.min(area.width)).saturating_sub(4);
    let mut what = text::wrap(&(texts.ask)(&prompt.ask), cells);
    let on_no = text::wrap(&fill(texts.on_no, &[&text::shown(&prompt.item)]), cells);
    let answers = answers(model, cells);
    let answer_rows = answers.len() as u16;
    let answer = if prompt.takes_words() { text::wrap(&typed(model, prompt), cells) } else { Vec::new() };
    let typed_rows = answer.len() as u16;
    text::shorten(&mut what, usize::from(area.height.saturating_sub(answer_rows + typed_rows + 2)), cells);
    let (what_rows, mut on_no_rows) = (what.len() as u16, on_no.len() as u16);
    // What must be done and the answers stay on the smallest screen; the picture goes first, then the rest.
    let room = area.height.saturating_sub(what_rows + typed_rows + answer_rows + 3);
    let picture_rows = picture::rows(&prompt.ask);
    let picture_rows = if picture_rows + on_no_rows <= room { picture_rows } else { 0 };
    if on_no_rows + 1 > room {
        on_no_rows = 0;
    }
    let title = format!("{}: {}", texts.prompt_title, text::shown(&prompt.item));
    let place = over(model, frame, area, &title, what_rows + typed_rows + picture_rows + on_no_rows + answer_rows + 3);
    let [what_area, typed_area, picture_area, since_area, no_area, _, answer_area] = Layout::vertical([
        Constraint::Length(what_rows + u16::from(room > 0)),
        Constraint::Length(typed_rows),
        Constraint::Length(picture_rows),
        Constraint::Length(u16::from(room > 0)),
        Constraint::Length(on_no_rows),
        Constraint::Fill(1),
        Constraint::Length(answer_rows),
    ])
    .areas(place);
    let strong = |line| Line::styled(line, style::strong());
    text::lines(frame, what.into_iter().map(strong), what_area);
    let turned = |line| Line::styled(line, style::accent(model.look));
    text::lines(frame, answer.into_iter().map(turned), typed_area);
    picture::draw(model, frame, picture_area, &prompt.ask);
    let since = duration(model.now.since_start.saturating_sub(prompt.since).as_secs() as f64);
    text::lines(frame, [Line::styled(fill(texts.asked_since, &[&since]), style::faint())], since_area);
    let faint = |line| Line::styled(line, style::faint());
    text::lines(frame, on_no.into_iter().map(faint), no_area);
    text::lines(frame, answers, answer_area);
}

/// The answer as far as it is typed.
fn typed(model: &ScreenModel, prompt: &Prompt) -> String {
    fill(model.texts.answer_typed, &[&format!("{}_", text::shown(prompt.typed.text()))])
}

/// What the keys do in a place, from the table of keys.
pub(super) fn help(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, place: KeyContext, scroll: usize) {
    let keys: Vec<_> = model.keys(place).collect();
    let name_cells = keys.iter().map(|binding| keymap::name(binding.key).len()).max().unwrap_or(0);
    let lines = |cells: usize| {
        let each = keys.iter().flat_map(|binding| {
            let what = (model.texts.key)(binding.action).long;
            let lines = text::wrap(what, cells.saturating_sub(name_cells + 3)).into_iter().enumerate();
            let name = keymap::name(binding.key);
            lines.map(move |(index, line)| {
                let name = if index == 0 { name.clone() } else { String::new() };
                Line::from(vec![
                    Span::raw(" "),
                    Span::styled(text::fit(&name, name_cells), style::strong()),
                    Span::styled(format!("  {line}"), Style::new()),
                ])
            })
        });
        each.collect()
    };
    detail::scrolled(model, frame, area, model.texts.help, scroll, lines);
}
