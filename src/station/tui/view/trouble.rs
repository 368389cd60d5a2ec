//! What is wrong and stays so, above the message: a record that cannot be written, a module whose power is unknown, and why
//! the run has no verdict of its module. A message goes when the next one comes; these lines stay as long as it is so.

use gnc_executive::event::NoteLevel;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::Line;

use super::{style, text};
use crate::tui::model::{MessageWeight, PowerKnown, RunView, ScreenModel, ScreenPage};

/// Most lines of the words about a record that cannot be written, and of those about the error of a run, on a screen with
/// panels: they hold the path of a file or the name of a port, the reason and what to do.
const LINES: usize = 3;
/// Most lines of the same on a screen without panels.
const LINES_SMALL: usize = 2;

/// All lines, the gravest first.
pub(super) fn lines(model: &ScreenModel, area: Rect) -> Vec<Line<'static>> {
    let cells = usize::from(area.width).saturating_sub(2);
    let small = area.width < super::MIN_WIDTH || area.height < super::MIN_HEIGHT;
    let rows = if small { LINES_SMALL } else { LINES };
    let mut all = Vec::new();
    let mut take = |words: &str, rows: usize, style: Style| {
        let mut lines = text::wrap(&text::shown(words), cells);
        text::shorten(&mut lines, rows, cells);
        all.extend(lines.into_iter().map(|line| Line::styled(format!(" {line}"), style)));
    };
    let weight = |weight| style::weight(model.look, weight);
    if let Some(why) = &model.unrecorded {
        take(why, if small { 1 } else { LINES }, weight(MessageWeight::Error));
    }
    // Words of safety are never cut.
    match model.power() {
        PowerKnown::LineLost => take(model.texts.line_lost, usize::MAX, weight(MessageWeight::Error)),
        PowerKnown::Unknown => take(model.texts.watchdog_acts, usize::MAX, weight(MessageWeight::Warning)),
        PowerKnown::Known => {}
    }
    if let Some(why) = error_of_run(model) {
        take(&why, rows, weight(MessageWeight::Error));
    }
    all
}

/// Why the run on the screen has no verdict of its module: what went wrong beside the items, each with what to try.
fn error_of_run(model: &ScreenModel) -> Option<String> {
    let shown = model.page != ScreenPage::Records && model.over.is_empty();
    let run =
        model.run.as_ref().filter(|run| shown && !run.verdict().is_some_and(|verdict| verdict.of_items().is_good()))?;
    let notes = run.state.notes().iter().filter(|note| note.level == NoteLevel::Error && note.item.is_none());
    let told: Vec<_> = notes.map(|note| model.said(&note.text)).collect();
    (!told.is_empty()).then(|| told.join(" · "))
}

/// Whether the run ended without an answer of any board.
pub(super) fn no_board(run: &RunView) -> bool {
    let errors = run.state.notes().iter().any(|note| note.level == NoteLevel::Error);
    run.over && run.state.board().is_none() && errors
}
