//! The form for plan, bench, operator, rounds and language.

use gnc_executive::bench::ShortDigest;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::panels::{block, mistakes};
use super::{style, text};
use crate::tui::lang::fill;
use crate::tui::model::{AfterFailure, BenchView, Loaded, MessageWeight, ScreenModel};
use crate::tui::setup_form::{Form, FormLine, MAX_ROUNDS, RoundsKind};

pub(super) fn draw(model: &ScreenModel, form: &Form, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let form_lines = form.lines();
    let lines_height = form_lines.len() as u16 + 5;
    let [form_area, below] = Layout::vertical([Constraint::Length(lines_height), Constraint::Fill(1)]).areas(area);
    let block_ = block(texts.setup);
    let inner = block_.inner(form_area);
    frame.render_widget(block_, form_area);
    let cells = usize::from(inner.width);
    let label_cells = form_lines.iter().map(|line| text::width(&label(model, form, *line))).max().unwrap_or(0);
    let mut lines: Vec<Line<'_>> = form_lines
        .iter()
        .enumerate()
        .map(|(index, line)| {
            let here = index == form.line;
            let value = value(model, form, *line, here);
            let arrows = if here
                && !matches!(line, FormLine::Operator | FormLine::Part | FormLine::Revision | FormLine::Number(_))
            {
                ("< ", " >")
            } else {
                ("  ", "  ")
            };
            let value = text::cut(&value, cells.saturating_sub(label_cells + 7));
            Line::from(vec![
                Span::raw(if here { "> " } else { "  " }),
                Span::styled(
                    text::fit(&label(model, form, *line), label_cells),
                    if here { style::strong() } else { style::faint() },
                ),
                Span::raw(" "),
                Span::styled(arrows.0, style::accent(model.look)),
                Span::styled(value, if here { style::turned() } else { Style::new() }),
                Span::styled(arrows.1, style::accent(model.look)),
            ])
        })
        .collect();
    lines.push(Line::raw(""));
    lines.extend(text::wrap(texts.setup_hint, cells).into_iter().map(|line| Line::styled(line, style::faint())));
    text::lines(frame, lines, inner);
    let held = (&model.bench, &model.plan);
    let found = form.look.as_ref().map_or(held, |look| (&look.bench, &look.plan));
    match found {
        (Loaded::Refused(why), _) | (_, Loaded::Refused(why)) => mistakes(model, frame, below, why),
        (bench, Loaded::Ready(plan)) => {
            let good = fill(texts.plan_good, &[&plan.items.len().to_string()]);
            let line = format!(" {} {}: {good}", text::shown(&plan.name), text::shown(&plan.version));
            let pinned = if plan.is_pinned { texts.plan_pinned } else { texts.plan_not_pinned };
            let pinned = format!(" SHA-256 {}: {pinned}", ShortDigest::of(&plan.sha256));
            let mut lines = vec![Line::raw(line), Line::styled(pinned, style::faint())];
            lines.extend(unproven(model, bench, usize::from(below.width)));
            text::lines(frame, lines, below);
        }
        _ => text::lines(frame, [Line::raw(format!(" {}", texts.loading))], below),
    }
}

/// Why no run on this bench will count for a module, before one is begun.
fn unproven(model: &ScreenModel, bench: &Loaded<BenchView>, cells: usize) -> Vec<Line<'static>> {
    let Loaded::Ready(bench) = bench else { return Vec::new() };
    let Some(why) = &bench.unproven else { return Vec::new() };
    let why = fill(model.texts.unproven_long, &[&text::shown(&model.said(why))]);
    let lines = text::wrap(&why, cells.saturating_sub(1)).into_iter();
    lines.map(|line| Line::styled(format!(" {line}"), style::weight(model.look, MessageWeight::Warning))).collect()
}

fn label(model: &ScreenModel, form: &Form, line: FormLine) -> String {
    let texts = model.texts;
    let text = match line {
        FormLine::Number(index) => {
            return form.numbers.get(index).map(|number| text::shown(&number.label)).unwrap_or_default();
        }
        FormLine::Plan => texts.setup_plan,
        FormLine::Bench => texts.setup_bench,
        FormLine::Operator => texts.setup_operator,
        FormLine::Part => texts.setup_part,
        FormLine::Revision => texts.setup_revision,
        FormLine::Rounds => texts.setup_rounds,
        FormLine::AfterFailure => texts.setup_on_fail,
        FormLine::Language => texts.setup_language,
    };
    text.to_owned()
}

fn value(model: &ScreenModel, form: &Form, line: FormLine, here: bool) -> String {
    let texts = model.texts;
    let typed = |text: &str| format!("{}{}", text::shown(text), if here { "_" } else { "" });
    match line {
        FormLine::Plan => typed(form.plan.text()),
        FormLine::Bench => typed(form.bench.text()),
        FormLine::Operator => typed(form.operator.text()),
        FormLine::Part => form.part.as_ref().map(|[part, _]| typed(part.text())).unwrap_or_default(),
        FormLine::Revision => form.part.as_ref().map(|[_, revision]| typed(revision.text())).unwrap_or_default(),
        FormLine::Number(index) => form.numbers.get(index).map(|number| typed(number.field.text())).unwrap_or_default(),
        FormLine::Rounds => {
            let number = typed(form.number.text());
            let words = match form.rounds {
                RoundsKind::Once => texts.rounds_once.to_owned(),
                RoundsKind::Count => fill(texts.rounds_count, &[&number]),
                RoundsKind::Minutes => fill(texts.rounds_time, &[&number]),
            };
            match form.asked_rounds() {
                Some(_) => words,
                None => format!("{words} ({})", fill(texts.not_a_number, &[&MAX_ROUNDS.to_string()])),
            }
        }
        FormLine::AfterFailure => match form.after_failure {
            AfterFailure::AsPlanned => texts.on_fail_plan.to_owned(),
            AfterFailure::Stop => texts.on_fail_stop.to_owned(),
            AfterFailure::GoOn => texts.on_fail_continue.to_owned(),
        },
        FormLine::Language => form.lang.texts().language.to_owned(),
    }
}
