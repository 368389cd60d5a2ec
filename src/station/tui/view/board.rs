//! The tests page: the module, the progress or the verdict, and the items.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};

use super::{WIDE, big, detail, log, panels, rows};
use crate::tui::model::{Loaded, ScreenModel};

/// Height of the panels with letters at their smallest and their borders.
const LOW: u16 = big::HEIGHT + 2;
/// Height with letters twice as large.
const HIGH: u16 = 2 * big::HEIGHT + 2;
/// Width of the verdict beside the product on a narrow screen.
const VERDICT: u16 = 38;
/// Width of a word of six letters at twice the size, with borders.
const VERDICT_WIDE: u16 = 74;
/// Rows of the log on a high screen.
const LOG: u16 = 10;

pub(super) fn draw(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    if area.width >= WIDE { wide(model, frame, area) } else { narrow(model, frame, area) }
}

fn narrow(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let [top, items] = Layout::vertical([Constraint::Length(LOW), Constraint::Fill(1)]).areas(area);
    let [product, verdict] = Layout::horizontal([Constraint::Fill(1), Constraint::Length(VERDICT)]).areas(top);
    panels::product(model, frame, product);
    if model.run.as_ref().is_some_and(|run| run.over) {
        panels::verdict(model, frame, verdict);
    } else {
        panels::times(model, frame, verdict);
    }
    items_or_mistakes(model, frame, items);
}

fn wide(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let high = if area.height >= HIGH + 3 * LOG { HIGH } else { LOW };
    let [top, body] = Layout::vertical([Constraint::Length(high), Constraint::Fill(1)]).areas(area);
    let verdict_width = if high == HIGH { VERDICT_WIDE.min(area.width / 2) } else { VERDICT };
    let [product, times, verdict] =
        Layout::horizontal([Constraint::Fill(3), Constraint::Fill(2), Constraint::Length(verdict_width)]).areas(top);
    panels::product(model, frame, product);
    panels::times(model, frame, times);
    panels::verdict(model, frame, verdict);
    let [left, right] = Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1)]).areas(body);
    items_or_mistakes(model, frame, left);
    let below = if body.height >= 3 * LOG { LOG } else { body.height / 3 };
    let [item, log] = Layout::vertical([Constraint::Fill(1), Constraint::Length(below)]).areas(right);
    detail::pane(model, frame, item);
    log::pane(model, frame, log);
}

fn items_or_mistakes(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let shown = model.run.as_ref().is_some_and(|run| !run.state.rows().is_empty());
    match (&model.bench, &model.plan) {
        _ if shown => rows::of_run(model, frame, area),
        (Loaded::Refused(why), _) | (_, Loaded::Refused(why)) => panels::mistakes(model, frame, area, why),
        (_, Loaded::Ready(plan)) => rows::of_plan(model, plan, frame, area),
        (_, Loaded::Loading) => {}
    }
}
