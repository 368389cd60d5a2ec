//! The page of an item that captures: how the module lies and turns, how far each capture is, what is still to go.

use gnc_bench::guidance::heat::HeatView;
use gnc_bench::guidance::{Guidance, Picture, Planned, Stage};
use gnc_executive::limit::Limit;
use gnc_executive::quantity::Unit;
use gnc_executive::state::RunState;
use gnc_executive::text::duration;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};

use super::panels::{bar, block, block_in};
use super::rows::first_shown;
use super::{WIDE, allan, field, live, module, style, text};
use crate::tui::lang::fill;
use crate::tui::model::{MessageWeight, ProgramView, ScreenModel};

/// Width of the guidance beside the captures.
const GUIDANCE: u16 = 40;
const GUIDANCE_WIDE: u16 = 64;
/// Rows of the drawn module, on a small screen and at most.
const MODULE: u16 = 9;
const MODULE_HIGH: u16 = 22;
/// Captures listed above a picture, the same on a high screen, and the height of a high screen.
const LIST: u16 = 4;
const LIST_HIGH: u16 = 10;
const HIGH: u16 = 40;

pub(super) fn draw(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let Some((item, guidance)) = model.guidance() else { return programs(model, frame, area) };
    let width = if area.width >= WIDE { GUIDANCE_WIDE } else { GUIDANCE };
    let [left, right] = Layout::horizontal([Constraint::Length(width), Constraint::Fill(1)]).areas(area);
    guide(model, item, guidance, frame, left);
    let Some(picture) = &guidance.picture else { return captures(model, guidance, frame, right) };
    let list = (guidance.captures.len() as u16).min(if area.height >= HIGH { LIST_HIGH } else { LIST }) + 2;
    let [list_area, picture_area] = Layout::vertical([Constraint::Length(list), Constraint::Fill(1)]).areas(right);
    captures(model, guidance, frame, list_area);
    match picture {
        Picture::Field(found) => field::draw(model, found, frame, picture_area),
        Picture::Allan(found) => {
            let span_s = guidance.captures.iter().map(|planned| planned.span_s).fold(0.0, f64::max);
            allan::draw(model, found, span_s, frame, picture_area);
        }
    }
}

/// Draws the module, how it moves, and the progress.
fn guide(model: &ScreenModel, item: &str, guidance: &Guidance, frame: &mut Frame<'_>, area: Rect) {
    let block = block_in(&text::shown(item), area).border_style(style::accent(model.look));
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let cells = usize::from(inner.width);
    let pose = pose_lines(model, guidance, cells);
    let mut progress = progress_lines(model, item, guidance, cells);
    if guidance.stage == Stage::Capturing && guidance.picture.is_none() {
        progress.extend(live::roll(model).filter(|_| model.live.newest.compensated.is_some()));
    }
    let picture =
        inner.height.saturating_sub((pose.len() + progress.len()) as u16).clamp(MODULE.min(inner.height), MODULE_HIGH);
    let [pose_area, module_area, progress_area] =
        Layout::vertical([Constraint::Length(pose.len() as u16), Constraint::Length(picture), Constraint::Fill(1)])
            .areas(inner);
    text::lines(frame, pose, pose_area);
    if let Some(orientation) = &guidance.orientation {
        module::draw(model, frame, module_area, orientation, guidance.turn());
    }
    text::lines(frame, progress, progress_area);
}

/// How the module lies, and how it moves in the present capture.
fn pose_lines(model: &ScreenModel, guidance: &Guidance, cells: usize) -> Vec<Line<'static>> {
    let strong = |line| Line::styled(line, style::strong());
    let orientation =
        guidance.orientation.as_ref().map(|orientation| model.texts.orientation(orientation)).unwrap_or_default();
    let mut lines: Vec<Line<'static>> = text::wrap(&orientation, cells).into_iter().map(strong).collect();
    // While the module warms up nothing moves, and the first capture of the program may exist already.
    let present = guidance.present().filter(|_| !guidance.waits_to_go_on());
    if let Some(motion) = present.and_then(|planned| model.texts.motion(&planned.pose)) {
        lines.extend(text::wrap(&motion, cells).into_iter().map(|line| Line::styled(line, style::accent(model.look))));
    }
    lines
}

/// Which capture of how many it is, and the time that remains for the capture, for the item and for the plan.
fn progress_lines(model: &ScreenModel, item: &str, guidance: &Guidance, cells: usize) -> Vec<Line<'static>> {
    let texts = model.texts;
    let stage = text::wrap(&texts.stage(guidance), cells).into_iter();
    let mut lines: Vec<Line<'static>> = stage.map(|line| Line::styled(line, style::strong())).collect();
    let present = guidance.present().filter(|_| !guidance.waits_to_go_on());
    if !guidance.taken.is_empty() {
        let (taken, all) = (guidance.taken.len().to_string(), guidance.captures.len().to_string());
        let told = text::wrap(&fill(texts.captures_taken, &[&taken, &all]), cells).into_iter();
        lines.extend(told.map(Line::raw));
    }
    if let Some(planned) = present {
        let which =
            fill(texts.capture_of, &[&(guidance.finished + 1).to_string(), &guidance.captures.len().to_string()]);
        lines.push(Line::raw(text::cut(&format!("{which}: {}", text::shown(&texts.capture(&planned.label))), cells)));
    }
    let labels = [texts.this_capture, texts.item, texts.plan];
    let label_cells = labels.iter().map(|label| text::width(label)).max().unwrap_or(0);
    let room = cells.saturating_sub(label_cells + 1);
    let line = |label: &str, done: Option<f64>, left_s: f64| {
        let to_go = fill(texts.to_go, &[&duration(left_s)]);
        let bar_cells = room.saturating_sub(text::width(&to_go) + 1).min(24);
        let value = match done {
            Some(done) if bar_cells >= 4 => format!("{} {to_go}", bar((done * 1e3) as usize, 1000, bar_cells)),
            _ => to_go,
        };
        Line::from(vec![
            Span::styled(text::fit(label, label_cells + 1), style::faint()),
            Span::styled(text::cut(&value, room), style::accent(model.look)),
        ])
    };
    if let Some(planned) = present {
        let done = guidance.captured_s / planned.span_s.max(f64::MIN_POSITIVE);
        lines.push(line(texts.this_capture, Some(done), guidance.capture_left_s()));
    }
    let done = 1.0 - guidance.left_s() / guidance.whole_s.max(f64::MIN_POSITIVE);
    lines.push(line(texts.item, Some(done), guidance.left_s()));
    if let Some(left_s) = plan_left_s(model, item, guidance) {
        lines.push(line(texts.plan, None, left_s));
    }
    if let Some(heat) = &guidance.heat {
        lines.extend(heat_lines(model, item, heat, cells));
    }
    lines
}

/// The temperatures with how far they have drifted, and the plan's limit for that. A drift beyond the limit stands out:
/// the operator can stop a capture of an hour that cannot pass any more.
fn heat_lines(model: &ScreenModel, item: &str, heat: &HeatView, cells: usize) -> Vec<Line<'static>> {
    let texts = model.texts;
    let chosen = model.run.as_ref().and_then(|run| run.state.limits());
    let limit = model.plan.ready().and_then(|plan| plan.drift_limit(item, chosen));
    let most_k = match limit {
        Some(Limit::Range(range)) if range.unit == Unit::DegreeCelsius => range.high,
        _ => None,
    };
    let drift_k = heat.gyro.drift_k().max(heat.accel.drift_k());
    let beyond = most_k.is_some_and(|most_k| drift_k > most_k);
    let now = format!("{} {:.1}, {:.1} °C", texts.temperature, heat.gyro.now_c, heat.accel.now_c);
    let bound = limit.map(|limit| format!(" ({limit})")).unwrap_or_default();
    let drift = format!("{} {:.1}, {:.1} K{bound}", texts.drift, heat.gyro.drift_k(), heat.accel.drift_k());
    let weight = if beyond { MessageWeight::Error } else { MessageWeight::Info };
    vec![
        Line::styled(text::cut(&now, cells), style::faint()),
        Line::styled(text::cut(&drift, cells), style::weight(model.look, weight)),
    ]
}

/// Bench time of all captures that remain in the plan.
pub(in crate::tui) fn plan_left_s(model: &ScreenModel, item: &str, guidance: &Guidance) -> Option<f64> {
    let programs = &model.plan.ready()?.programs;
    let state = &model.run.as_ref()?.state;
    let later = programs.iter().filter(|program| program.item != item && is_open(state, &program.item));
    Some(guidance.left_s() + later.map(|program| program.span_s).sum::<f64>())
}

fn is_open(state: &RunState, item: &str) -> bool {
    state.row(item).is_some_and(|row| row.planned.selected && !row.is_over())
}

/// All captures of the item, with a mark for each that is finished.
fn captures(model: &ScreenModel, guidance: &Guidance, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let title = format!("{} {}/{}", texts.captures, guidance.existing(), guidance.captures.len());
    let block = block(&title);
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let (cells, rows) = (usize::from(inner.width), usize::from(inner.height));
    let first = first_shown(guidance.finished, guidance.captures.len(), rows);
    let shown = guidance.captures.iter().enumerate().skip(first).take(rows);
    let lines: Vec<Line<'_>> = shown.map(|(index, planned)| capture(model, guidance, index, planned, cells)).collect();
    text::lines(frame, lines, inner);
}

fn capture(model: &ScreenModel, guidance: &Guidance, index: usize, planned: &Planned, cells: usize) -> Line<'static> {
    let at_work = index == guidance.finished && !guidance.waits_to_go_on();
    let (mark, style) = match index {
        _ if guidance.exists(index) => ("✓", style::outcome(model.look, gnc_executive::outcome::Outcome::Passed)),
        _ if at_work => (">", style::accent(model.look)),
        _ => (" ", style::faint()),
    };
    let time = if at_work && guidance.stage == Stage::Capturing { guidance.capture_left_s() } else { planned.span_s };
    let taken = guidance.taken.contains(&planned.label);
    let time = if taken { model.texts.taken_over.to_owned() } else { duration(time) };
    let room = cells.saturating_sub(text::width(&time) + 4);
    Line::from(vec![
        Span::styled(format!(" {mark} "), style),
        Span::styled(
            text::fit(&text::shown(&model.texts.capture(&planned.label)), room),
            if at_work { style } else { Default::default() },
        ),
        Span::styled(format!(" {time}"), style::faint()),
    ])
}

/// The items of the plan that capture, while no capture is under way.
fn programs(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let block = block(texts.calibration);
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let cells = usize::from(inner.width);
    let programs = model.plan.ready().map_or(&[][..], |plan| &plan.programs);
    let mut lines = vec![Line::styled(text::cut(texts.captures_later, cells), style::strong()), Line::raw("")];
    lines.push(Line::styled(row(texts.item, texts.captures, texts.bench_time, texts.outcome, cells), style::faint()));
    lines.extend(programs.iter().map(|program| program_line(model, program, cells)));
    let whole_s: f64 = programs.iter().map(|program| program.span_s).sum();
    let count: usize = programs.iter().map(|program| program.captures).sum();
    lines.push(Line::styled(row("", &count.to_string(), &duration(whole_s), "", cells), style::strong()));
    text::lines(frame, lines, inner);
}

fn program_line(model: &ScreenModel, program: &ProgramView, cells: usize) -> Line<'static> {
    let over = model.run.as_ref().and_then(|run| run.state.row(&program.item)).filter(|row| row.is_over());
    let outcome = over.map(|row| row.outcome);
    let word = outcome.map(|outcome| format!("{} {}", style::mark(outcome), (model.texts.outcome_word)(outcome)));
    let style = outcome.map_or_else(Default::default, |outcome| style::outcome(model.look, outcome));
    let count = program.captures.to_string();
    let line = row(&text::shown(&program.item), &count, &duration(program.span_s), &word.unwrap_or_default(), cells);
    Line::styled(line, style)
}

fn row(item: &str, captures: &str, time: &str, outcome: &str, cells: usize) -> String {
    let line = format!(" {} {} {}   {outcome}", text::fit(item, 28), text::right(captures, 10), text::right(time, 14));
    text::cut(&line, cells)
}
