//! The counters of the shift and its last modules.

use gnc_executive::outcome::Outcome;
use gnc_records::shift::{ModuleOfShift, Shift};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::panels::block_in;
use super::{style, text};
use crate::tui::lang::fill;
use crate::tui::model::ScreenModel;

/// Modules that are listed.
const LISTED: usize = 10;
/// Height of the panel with all its lines and its borders.
pub(super) const HEIGHT: u16 = 14;

/// Modules that passed, that failed, and that have no verdict.
fn counts(shift: &Shift) -> [usize; 3] {
    let (passed, failed) = (shift.count(Outcome::is_good), shift.count(|outcome| outcome == Outcome::Failed));
    [passed, failed, shift.modules.len() - passed - failed]
}

/// The first-pass yield in whole percent, never rounded up to 100; `None` before the first try.
fn yield_percent(shift: &Shift) -> Option<usize> {
    let (passed, tried) = shift.first_pass();
    (100 * passed).checked_div(tried)
}

/// The counters in one short line.
pub(super) fn short(model: &ScreenModel, shift: &Shift) -> String {
    let [passed, failed, others] = counts(shift).map(|count| count.to_string());
    let counted = fill(model.texts.shift_short, &[&shift.modules.len().to_string(), &passed, &failed, &others]);
    let first = yield_percent(shift).map(|percent| fill(model.texts.first_pass_short, &[&percent.to_string()]));
    first.map_or(counted.clone(), |first| format!("{counted} · {first}"))
}

/// The counters in words, and the last modules, the newest first.
pub(super) fn panel(model: &ScreenModel, shift: &Shift, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let since = shift.since.format("%H:%M").to_string();
    let block = block_in(&fill(texts.shift_since, &[&since, &shift.modules.len().to_string()]), area);
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let cells = usize::from(inner.width);
    let [passed, failed, others] = counts(shift);
    let counted = [
        format!("{passed} {}", (texts.outcome_word)(Outcome::Passed)),
        format!("{failed} {}", (texts.outcome_word)(Outcome::Failed)),
        format!("{others} {}", texts.others),
    ];
    let (first, tried) = shift.first_pass();
    let mut counted = counted.join(" · ");
    if let Some(percent) = yield_percent(shift) {
        let words = [percent, first, tried].map(|number| number.to_string());
        counted = format!("{counted} · {}", fill(texts.first_pass, &words.each_ref().map(String::as_str)));
    }
    let mut lines = vec![
        Line::styled(text::cut(&counted, cells), style::strong()),
        Line::styled(text::cut(texts.last_modules, cells), style::faint()),
    ];
    lines.extend(shift.modules.iter().rev().take(LISTED).map(|module| module_line(model, module)));
    text::lines(frame, lines, inner);
}

fn module_line(model: &ScreenModel, module: &ModuleOfShift) -> Line<'static> {
    let outcome = module.outcome;
    let word = format!("{} {}", style::mark(outcome), (model.texts.outcome_word)(outcome));
    Line::from(vec![
        Span::styled(format!("  {} ", module.at.format("%H:%M:%S")), Style::new()),
        Span::styled(text::fit(&text::shown(&module.serial_number), 30), style::strong()),
        Span::styled(format!(" {word}"), style::outcome(model.look, outcome)),
    ])
}
