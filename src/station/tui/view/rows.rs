//! The items as a list: ticks, marks, outcomes, times and reasons; under a bad item what to look at.

use gnc_bench::guidance::{Guidance, Stage};
use gnc_executive::event::NoteLevel;
use gnc_executive::measurement::Measurement;
use gnc_executive::outcome::Outcome;
use gnc_executive::record::ItemRecord;
use gnc_executive::state::{Row, RunState};
use gnc_executive::text as words;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::panels::bar;
use super::{style, text};
use crate::tui::lang::{Texts, fill};
use crate::tui::model::{PlanView, Progress, ScreenModel, order};

/// Largest number of bad items whose values are listed under them. For the others the cursor shows the details.
const EXPLAINED: usize = 20;
/// Values listed under a bad item.
const VALUES: usize = 3;

/// Widths of the columns.
struct Columns {
    name: usize,
    outcome: usize,
    time: usize,
    reason: usize,
}

impl Columns {
    fn new(model: &ScreenModel, cells: usize) -> Self {
        let widest = Outcome::ALL.iter().map(|outcome| text::width((model.texts.outcome_word)(*outcome))).max();
        let outcome = widest.unwrap_or(8);
        // "59 min 59 s" is the longest time.
        let (name, time) = (if cells < 100 { 15 } else { 20 }, 11);
        // Cursor, tick, mark and the gaps between.
        let fixed = 1 + 3 + 1 + 2 + name + 1 + outcome + 1 + time + 2;
        Self { name, outcome, time, reason: cells.saturating_sub(fixed) }
    }
}

/// The items of a plan that was not run yet.
pub(super) fn of_plan(model: &ScreenModel, plan: &PlanView, frame: &mut Frame<'_>, area: Rect) {
    let columns = Columns::new(model, usize::from(area.width));
    let (mut lines, room) = head(model, &columns, plan.items.len(), area);
    let first = first_shown(model.cursor, plan.items.len(), room);
    for (position, item) in plan.items.iter().enumerate().skip(first).take(room) {
        let ticked = model.ticks.get(position).copied().unwrap_or(true);
        let title = (model.texts.item_title)(item.id);
        let title = if item.optional { format!("{title} ({})", model.texts.optional) } else { title.to_owned() };
        let spans = vec![
            Span::raw(if ticked { "[x] " } else { "[ ] " }),
            Span::raw("  "),
            Span::raw(text::fit(&text::shown(&item.name), columns.name + 1)),
            Span::styled(text::cut(&title, columns.outcome + columns.time + 3 + columns.reason), style::faint()),
        ];
        lines.push(marked(model, position == model.cursor, spans, usize::from(area.width)));
    }
    text::lines(frame, lines, area);
}

/// The items of the run on the tests page.
pub(super) fn of_run(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let Some(run) = &model.run else { return };
    let ticks = (!model.is_running()).then_some(model.ticks.as_slice());
    // A record that could not be written has no verdict, and its run is over all the same.
    let over = run.over || run.state.verdict().is_some();
    let list = List { model, state: &run.state, progress: &run.progress, ticks, cursor: model.cursor, over };
    list.draw(frame, area, focus(model));
}

/// The items of a run of the records.
pub(super) fn of_record(model: &ScreenModel, state: &RunState, cursor: usize, frame: &mut Frame<'_>, area: Rect) {
    let over = state.verdict().is_some();
    List { model, state, progress: &[], ticks: None, cursor, over }.draw(frame, area, cursor);
}

/// The line that stays in sight: the item that has begun last, until the operator moves the cursor.
fn focus(model: &ScreenModel) -> usize {
    let Some(run) = model.run.as_ref().filter(|run| !run.over && !model.cursor_moved) else { return model.cursor };
    run.progress.last().and_then(|progress| run.state.position(&progress.item)).unwrap_or(model.cursor)
}

struct List<'a> {
    model: &'a ScreenModel,
    state: &'a RunState,
    progress: &'a [Progress],
    /// The items of the next run; `None` if nothing can be ticked.
    ticks: Option<&'a [bool]>,
    cursor: usize,
    /// Whether nothing of the run can come any more.
    over: bool,
}

impl List<'_> {
    /// `focus` is the line that stays in sight.
    fn draw(&self, frame: &mut Frame<'_>, area: Rect, focus: usize) {
        let cells = usize::from(area.width);
        let columns = Columns::new(self.model, cells);
        let order = order(self.state);
        let (mut shown, room) = head(self.model, &columns, order.len(), area);
        // Lines above that line, with those under bad items.
        let mut lines = Vec::new();
        let mut focus_line = 0;
        // Without explanations each line is an item, and only the lines in sight are made.
        let start = if self.over { 0 } else { first_shown(focus, order.len(), room) };
        for (at, position) in order.iter().enumerate().skip(start) {
            if lines.len() > room && at > focus {
                break;
            }
            let row = &self.state.rows()[*position];
            if at == focus {
                focus_line = lines.len();
            }
            lines.push(self.line(&columns, at == self.cursor, *position, row, cells));
            if self.over && at < EXPLAINED && is_bad(row.outcome) {
                lines.extend(explained(self.model, row, cells));
            }
        }
        let first = first_shown(focus_line, lines.len(), room);
        shown.extend(lines.into_iter().skip(first).take(room));
        text::lines(frame, shown, area);
    }

    fn line(&self, columns: &Columns, here: bool, position: usize, row: &Row, cells: usize) -> Line<'static> {
        let texts = self.model.texts;
        let look = self.model.look;
        let tick = match self.ticks.map(|ticks| ticks.get(position).copied().unwrap_or(true)) {
            Some(true) => "[x] ",
            Some(false) => "[ ] ",
            None => "    ",
        };
        let at_work = self.progress.iter().find(|progress| progress.item == row.planned.name);
        let (mark, outcome, time) = match at_work {
            Some(progress) => (
                Span::styled("> ", style::accent(look)),
                Span::styled(work(progress, columns.outcome), style::accent(look)),
                words::duration(progress.elapsed.as_secs_f64()),
            ),
            None if row.is_over() => (
                Span::styled(format!("{} ", style::mark(row.outcome)), style::outcome(look, row.outcome)),
                Span::styled((texts.outcome_word)(row.outcome), style::outcome(look, row.outcome)),
                row.elapsed_us().map(|us| words::duration(us as f64 / 1e6)).unwrap_or_default(),
            ),
            None if !row.planned.selected => (Span::raw("  "), Span::raw(""), String::new()),
            None => {
                let word = if self.over { (texts.outcome_word)(Outcome::NotRun) } else { texts.waiting };
                (Span::raw("  "), Span::styled(word, style::faint()), String::new())
            }
        };
        let outcome = Span::styled(text::fit(&outcome.content, columns.outcome), outcome.style);
        let reason = match at_work {
            Some(progress) => match &progress.guidance {
                Some(guidance) => guided(texts, guidance),
                None => (texts.item_title)(row.planned.id).to_owned(),
            },
            None => decided(self.model, row),
        };
        let spans = vec![
            Span::raw(tick),
            mark,
            Span::raw(text::fit(&text::shown(&row.planned.name), columns.name)),
            Span::raw(" "),
            outcome,
            Span::raw(text::right(&time, columns.time + 1)),
            Span::raw("  "),
            Span::raw(text::cut(&reason, columns.reason)),
        ];
        marked(self.model, here, spans, cells)
    }
}

/// The titles of the columns, and the number of rows below them. The titles are left out if the items fill the area
/// exactly.
fn head(model: &ScreenModel, columns: &Columns, items: usize, area: Rect) -> (Vec<Line<'static>>, usize) {
    let texts = model.texts;
    let height = usize::from(area.height);
    if items == height {
        return (Vec::new(), height);
    }
    let line = format!(
        "       {} {} {}  {}",
        text::fit(texts.item, columns.name),
        text::fit(texts.outcome, columns.outcome),
        text::right(texts.time, columns.time),
        text::cut(texts.decided_by, columns.reason)
    );
    (vec![Line::styled(line, style::faint())], height.saturating_sub(1))
}

/// A line with its cursor. The whole line has reversed colours, so that the cursor is seen on a terminal without
/// colours.
fn marked(_: &ScreenModel, here: bool, spans: Vec<Span<'static>>, cells: usize) -> Line<'static> {
    let mut all = vec![Span::raw(if here { ">" } else { " " })];
    all.extend(spans);
    let used: usize = all.iter().map(Span::width).sum();
    all.push(Span::raw(" ".repeat(cells.saturating_sub(used))));
    let line = Line::from(all);
    if here { line.patch_style(style::turned()) } else { line }
}

/// How far an item is: a bar if that is known.
fn work(progress: &Progress, cells: usize) -> String {
    match progress.done_permille {
        Some(done) => bar(usize::from(done), 1000, cells),
        None => "…".to_owned(),
    }
}

/// Which capture of how many an item is at, and the time that remains for it.
fn guided(texts: &Texts, guidance: &Guidance) -> String {
    let present = guidance.present().filter(|_| !guidance.waits_to_go_on());
    let Some(planned) = present else { return texts.stage(guidance) };
    let which = format!(
        "{}/{} {}",
        guidance.finished + 1,
        guidance.captures.len(),
        text::shown(&texts.capture(&planned.label))
    );
    match guidance.stage {
        Stage::Capturing => format!("{which}: {}", fill(texts.to_go, &[&words::duration(guidance.left_s())])),
        _ => format!("{which}: {}", texts.stage(guidance)),
    }
}

/// What decided the outcome of an item.
pub(super) fn decided(model: &ScreenModel, row: &Row) -> String {
    match &row.cause {
        Some(cause) => text::shown(&(model.texts.cause)(cause)),
        None if row.is_over() => text::shown(&model.said(&words::reason(&ItemRecord::from(row)))),
        None => String::new(),
    }
}

pub(super) fn is_bad(outcome: Outcome) -> bool {
    matches!(outcome, Outcome::Failed | Outcome::Errored | Outcome::Aborted | Outcome::Marginal)
}

/// Under a bad item: its bad values with their limits, each with a sentence on what to look at.
fn explained(model: &ScreenModel, row: &Row, cells: usize) -> Vec<Line<'static>> {
    let texts = model.texts;
    let Some(attempt) = row.attempts.last() else { return Vec::new() };
    let bad: Vec<&Measurement> =
        attempt.measurements.iter().filter(|measurement| measurement.outcome.is_some_and(is_bad)).collect();
    let mut lines = Vec::new();
    for measurement in bad.iter().take(VALUES) {
        let outcome = measurement.outcome.unwrap_or(Outcome::Errored);
        let value = format!("       {} {}", style::mark(outcome), text::shown(&words::measurement_line(measurement)));
        lines.push(Line::styled(text::cut(&value, cells), style::outcome(model.look, outcome)));
        if let Some(spec) = row.planned.id.spec().measurement(&measurement.name) {
            let sentence = (texts.look_at_sentence)(spec.look_at);
            lines.extend(labelled(texts.look_at, sentence, cells));
        }
    }
    if bad.len() > VALUES {
        let more = fill(texts.more_lines, &[&(bad.len() - VALUES).to_string()]);
        lines.push(Line::styled(format!("         {more}, {}", texts.enter_opens), style::faint()));
    }
    if let Some(error) = &attempt.error {
        lines.extend(labelled((texts.level)(NoteLevel::Error), &text::shown(&model.said(&error.text)), cells));
        // "The item runs again" is of the run that was on.
        if !error.hint.is_empty() && !error.again {
            lines.extend(labelled(texts.try_this, &text::shown(&model.said(&error.hint)), cells));
        }
    }
    lines
}

/// A sentence with its label, indented.
fn labelled(label: &str, sentence: &str, cells: usize) -> Vec<Line<'static>> {
    let label = format!("         {label}: ");
    let indent = text::width(&label);
    let lines = text::wrap(sentence, cells.saturating_sub(indent + 1));
    let each = lines.into_iter().enumerate().map(|(index, line)| {
        let before = if index == 0 { label.clone() } else { " ".repeat(indent) };
        Line::from(vec![Span::styled(before, style::faint()), Span::styled(line, Style::new())])
    });
    each.collect()
}

/// The first line in sight, with the cursor near the middle.
pub(super) fn first_shown(cursor: usize, count: usize, room: usize) -> usize {
    cursor.saturating_sub(room / 2).min(count.saturating_sub(room))
}
