//! Layers over a page: questions and the list of keys.

use gnc_executive::standing::Standing;
use gnc_executive::text::duration;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect, Size};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, BorderType, Clear};
use ratatui_image::Image;

use super::{detail, picture, style, text};
use crate::files::ChangedFile;
use crate::tui::keymap::{self, KeyAction, KeyContext};
use crate::tui::lang::fill;
use crate::tui::model::{ASK_FROM_S, Glyphs, Prompt, ScreenModel};
use crate::tui::pending::Interrupted;
use crate::tui::pictures::{self, DrawnPicture, PictureTrouble, PictureWanted};
use crate::tui::session::pictures::MAX_MEGAPIXELS;

/// Files that a question names; a plan with more is better looked at in its folder.
const MAX_FILES: usize = 6;
/// Width of a question.
const WIDTH: u16 = 66;
/// Least rows of a picture: in fewer a test point cannot be found.
const MIN_PICTURE_ROWS: u16 = 6;
/// Most rows of a picture: at the width of a question a photograph is no higher.
const MAX_PICTURE_ROWS: u16 = 24;

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
    let mut lines = vec![model.texts.leave_question.to_owned()];
    let lost_s = model.lost_s();
    if lost_s > ASK_FROM_S {
        lines.insert(0, fill(model.texts.leave_loses, &[&duration(lost_s)]));
    }
    question(model, frame, area, model.texts.leave_title, &lines);
}

/// A stop would lose captures.
pub(super) fn stop(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, lost_s: f64) {
    let words = fill(model.texts.stop_question, &[&duration(lost_s)]);
    question(model, frame, area, model.texts.stop_title, &[words]);
}

/// The end of an item would lose captures.
pub(super) fn give_up(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, item: &str, lost_s: f64) {
    let words = fill(model.texts.give_up_question, &[&duration(lost_s), &text::shown(item)]);
    question(model, frame, area, model.texts.stop_title, &[words]);
}

/// What stands in the question of a run, from top to bottom. On the smallest screen what must be done, the answer and its
/// keys stay; the picture goes first, then the rest.
struct PromptParts {
    what: Vec<String>,
    answer: Vec<String>,
    /// Rows of the drawing of a request.
    drawing_rows: u16,
    /// Most cells of a question's own picture; `None` if it has none or there is no room.
    picture: Option<Size>,
    on_no: Vec<String>,
    answers: Vec<Line<'static>>,
    /// One row if there is room for more than what must stay.
    gap: u16,
}

impl PromptParts {
    fn of(model: &ScreenModel, area: Rect, prompt: &Prompt) -> Self {
        let texts = model.texts;
        let cells = usize::from(WIDTH.min(area.width)).saturating_sub(4);
        let mut what = text::wrap(&(texts.ask)(&prompt.ask), cells);
        let mut on_no = text::wrap(&fill(texts.on_no, &[&text::shown(&prompt.item)]), cells);
        let answers = answers(model, cells);
        let answer = if prompt.takes_words() { text::wrap(&typed(model, prompt), cells) } else { Vec::new() };
        let must_rows = (answers.len() + answer.len()) as u16;
        text::shorten(&mut what, usize::from(area.height.saturating_sub(must_rows + 2)), cells);
        let room = area.height.saturating_sub(what.len() as u16 + must_rows + 3);
        let drawing_rows = picture::rows(&prompt.ask);
        let drawing_rows = if drawing_rows + on_no.len() as u16 <= room { drawing_rows } else { 0 };
        if on_no.len() as u16 + 1 > room {
            on_no.clear();
        }
        let rows = room.saturating_sub(1 + on_no.len() as u16).min(MAX_PICTURE_ROWS);
        let picture = (rows >= MIN_PICTURE_ROWS && cells > 1).then(|| Size::new(cells as u16, rows));
        let picture = picture.filter(|_| prompt.question().is_some_and(|asked| asked.question.picture.is_some()));
        Self { what, answer, drawing_rows, picture, on_no, answers, gap: u16::from(room > 0) }
    }
}

/// The picture of the question, if the terminal can draw it and there is room.
pub(super) fn picture_wanted(model: &ScreenModel, area: Rect) -> Option<PictureWanted> {
    let prompt = model.run.as_ref()?.prompt.as_ref()?;
    let question = &prompt.question()?.question;
    let (path, graphics) = (question.picture.clone()?, pictures::graphics(model)?);
    let room = PromptParts::of(model, area, prompt).picture?;
    let (sha256, cell) = (question.picture_sha256.clone(), model.pictures.cell());
    Some(PictureWanted { path, sha256, room, cell, graphics })
}

/// What of the question's picture is shown: itself, or words about it.
enum PictureShown<'a> {
    Drawn(&'a DrawnPicture),
    Words(Vec<String>),
}

impl PictureShown<'_> {
    fn rows(&self) -> u16 {
        match self {
            Self::Drawn(picture) => picture.size().height,
            Self::Words(lines) => lines.len() as u16,
        }
    }
}

fn picture_shown<'a>(model: &'a ScreenModel, wanted: &PictureWanted) -> PictureShown<'a> {
    let texts = model.texts;
    let trouble = match model.pictures.made(wanted) {
        Some(Ok(picture)) => return PictureShown::Drawn(picture),
        None => texts.picture_loading.to_owned(),
        Some(Err(PictureTrouble::Gone)) => texts.picture_gone.to_owned(),
        Some(Err(PictureTrouble::Unreadable(why))) => fill(texts.picture_unreadable, &[&text::shown(&model.said(why))]),
        Some(Err(PictureTrouble::Changed)) => texts.picture_changed.to_owned(),
        Some(Err(PictureTrouble::OtherFormat)) => texts.picture_other_format.to_owned(),
        Some(Err(PictureTrouble::Broken)) => texts.picture_broken.to_owned(),
        Some(Err(PictureTrouble::TooLarge)) => fill(texts.picture_large, &[&MAX_MEGAPIXELS.to_string()]),
    };
    let cells = usize::from(wanted.room.width);
    let mut lines = text::wrap(&trouble, cells);
    text::shorten(&mut lines, usize::from(wanted.room.height), cells);
    PictureShown::Words(lines)
}

/// The run asks for something.
pub(super) fn prompt(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let Some(prompt) = model.run.as_ref().and_then(|run| run.prompt.as_ref()) else { return };
    let PromptParts { what, answer, drawing_rows, on_no, answers, gap, .. } = PromptParts::of(model, area, prompt);
    let shown = picture_wanted(model, area).map(|wanted| picture_shown(model, &wanted));
    let picture_rows = drawing_rows + shown.as_ref().map_or(0, PictureShown::rows);
    let title = format!("{}: {}", texts.prompt_title, text::shown(&prompt.item));
    let rows = (what.len() + answer.len() + on_no.len() + answers.len()) as u16 + picture_rows;
    let place = over(model, frame, area, &title, rows + 3);
    let [what_area, typed_area, picture_area, since_area, no_area, _, answer_area] = Layout::vertical([
        Constraint::Length(what.len() as u16 + gap),
        Constraint::Length(answer.len() as u16),
        Constraint::Length(picture_rows),
        Constraint::Length(gap),
        Constraint::Length(on_no.len() as u16),
        Constraint::Fill(1),
        Constraint::Length(answers.len() as u16),
    ])
    .areas(place);
    let strong = |line| Line::styled(line, style::strong());
    text::lines(frame, what.into_iter().map(strong), what_area);
    let turned = |line| Line::styled(line, style::accent(model.look));
    text::lines(frame, answer.into_iter().map(turned), typed_area);
    picture::draw(model, frame, picture_area, &prompt.ask);
    let faint = |line| Line::styled(line, style::faint());
    match shown {
        Some(PictureShown::Drawn(picture)) => frame.render_widget(Image::new(&picture.0), picture_area),
        Some(PictureShown::Words(lines)) => text::lines(frame, lines.into_iter().map(faint), picture_area),
        None => {}
    }
    let since = duration(model.now.since_start.saturating_sub(prompt.since).as_secs() as f64);
    text::lines(frame, [Line::styled(fill(texts.asked_since, &[&since]), style::faint())], since_area);
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
