//! Panels of the tests page: the product, the times of the run, the verdict, mistakes of a plan.

use std::time::Duration;

use gnc_executive::catalogue::ItemId;
use gnc_executive::catalogue::processor::PART;
use gnc_executive::event::{BenchKind, BoardBreach, StopHow};
use gnc_executive::numbers::NumberField;
use gnc_executive::state::RunState;
use gnc_executive::text::duration;
use gnc_executive::verdict::Verdict;
use ratatui::Frame;
use ratatui::layout::{Alignment, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph};

use super::{big, style, text, trouble};
use crate::tui::lang::fill;
use crate::tui::model::{Loaded, MessageWeight, Pause, PowerKnown, PowerSeen, RoundsSetting, RunView, ScreenModel};
use crate::tui::numbers::label;

/// A panel with its title.
pub(super) fn block(title: &str) -> Block<'static> {
    Block::bordered().title(format!(" {title} "))
}

/// The same with a title that may be too long for its place.
pub(super) fn block_in(title: &str, area: Rect) -> Block<'static> {
    // The corners, and a space on both sides.
    block(&text::cut(title, usize::from(area.width).saturating_sub(4)))
}

/// Label and value on one line.
fn pair(label: &str, value: &str, style: Style, label_cells: usize, cells: usize) -> Line<'static> {
    let value = text::cut(value, cells.saturating_sub(label_cells + 1));
    Line::from(vec![
        Span::styled(text::fit(label, label_cells), style::faint()),
        Span::raw(" "),
        Span::styled(value, style),
    ])
}

/// The module, the operator, the station, the plan and the board.
pub(super) fn product(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let mut block = block(texts.product);
    let inner = block.inner(area);
    let cells = usize::from(inner.width);
    if let Some(shift) = model.shift.as_ref().filter(|shift| !shift.modules.is_empty()) {
        let counted = text::cut(&super::shift::short(model, shift), cells.saturating_sub(2));
        block = block.title_bottom(format!(" {counted} "));
    }
    frame.render_widget(block, area);
    let labels =
        [texts.serial_number, texts.part, texts.operator, texts.plan, texts.board, texts.next_module, texts.station];
    let label_cells = labels.iter().map(|label| text::width(label)).max().unwrap_or(0);
    let line = |label: &str, value: &str, style: Style| pair(label, value, style, label_cells, cells);

    let (number, number_style) = serial_number(model);
    let mut lines = vec![line(texts.serial_number, &number, number_style)];
    if let Some(next) = &model.scan.next {
        lines.push(line(texts.next_module, &text::shown(next), style::strong()));
    } else {
        lines.push(line(texts.part, &part(model), Style::new()));
    }
    let roomy = inner.height > 5;
    let station = model.bench.ready().map_or("", |bench| bench.station.as_str());
    let who = match model.operator.as_str() {
        "" => "-".to_owned(),
        // The mark matters more than the station beside it.
        name if model.operator_remembered => format!("{name} ({})", texts.operator_of_last_run),
        name => name.to_owned(),
    };
    let alone = roomy || model.operator_remembered;
    let who = if alone { who } else { format!("{who} · {} {station}", texts.station) };
    lines.push(line(texts.operator, &text::shown(&who), Style::new()));
    if roomy {
        lines.push(line(texts.station, &text::shown(station), Style::new()));
    }
    lines.push(line(texts.plan, &plan(model), Style::new()));
    let (board, board_style) = board(model);
    match breaches(model) {
        // Where there is no room for both, what is wrong counts more than which board it is.
        Some((breaches, style)) if !roomy => lines.push(line(texts.board, &breaches, style)),
        Some((breaches, style)) => {
            lines.push(line(texts.board, &board, board_style));
            lines.push(line("", &breaches, style));
        }
        None => lines.push(line(texts.board, &board, board_style)),
    }
    if roomy {
        let given =
            |field: &NumberField| (label(&field.label, model.lang).to_owned(), model.numbers.get(field).to_owned());
        let numbers =
            model.asked_numbers().iter().map(given).filter(|(_, value)| !value.is_empty()).collect::<Vec<_>>();
        lines.extend(numbers.iter().map(|(name, value)| line(&text::shown(name), &text::shown(value), Style::new())));
    }
    let folder = model.run.as_ref().and_then(|run| run.folder.as_ref());
    if let Some(folder) = folder.filter(|_| roomy) {
        lines.push(line(texts.record_in, &text::shown(&gnc_text::shown_path(folder)), style::faint()));
    }
    text::lines(frame, lines, inner);
}

/// The number that is being typed; else the number of the run on the screen; else the scanned number.
fn serial_number(model: &ScreenModel) -> (String, Style) {
    let typed = &model.scan.typed;
    if !typed.is_empty() {
        return (format!("{}_", text::shown(typed.text())), style::accent(model.look).patch(style::strong()));
    }
    let tested = model.run.as_ref().map(|run| &run.serial_number);
    match tested.or(model.scan.current.as_ref()) {
        Some(number) => (text::shown(number), style::strong()),
        None => (format!("_  ({})", model.texts.scan_here), style::accent(model.look)),
    }
}

/// The part that the module reports; before that, the part that the plan wants.
fn part(model: &ScreenModel) -> String {
    let measured = model.run.as_ref().and_then(|run| measured_part(&run.state));
    let planned = || model.plan.ready().and_then(|plan| plan.part.clone());
    measured.or_else(planned).map_or_else(|| "-".to_owned(), |part| text::shown(&part))
}

fn measured_part(state: &RunState) -> Option<String> {
    let row = state.rows().iter().find(|row| row.planned.id == ItemId::Identity)?;
    let measured = row.attempts.last()?.measurements.iter().find(|measurement| measurement.name == PART.name)?;
    Some(measured.value_text())
}

fn plan(model: &ScreenModel) -> String {
    match &model.plan {
        Loaded::Ready(plan) => format!("{} {}", text::shown(&plan.name), text::shown(&plan.version)),
        Loaded::Loading => model.texts.loading.to_owned(),
        Loaded::Refused(_) => format!("{}: {}", model.texts.mistakes, model.plan_path),
    }
}

/// The board that answered and its supply; before that, the link to it.
fn board(model: &ScreenModel) -> (String, Style) {
    let texts = model.texts;
    let run = model.run.as_ref();
    if model.watching {
        // Values are watched, and the last run knows nothing of it.
        return (texts.module_on.to_owned(), style::strong());
    }
    let board = run.and_then(|run| run.state.board());
    if board.is_none() && model.power() == PowerKnown::Known {
        match &model.bench {
            Loaded::Ready(_) => {}
            Loaded::Loading => return (texts.loading.to_owned(), style::faint()),
            Loaded::Refused(why) => {
                return (model.said(why.lines().next().unwrap_or_default()).into_owned(), style::strong());
            }
        }
    }
    let on = run.and_then(|run| run.state.power()).is_some_and(|power| power.on);
    let (power, style) = match (model.power(), model.power_seen) {
        (PowerKnown::Unknown | PowerKnown::LineLost, _) => {
            (texts.power_unknown, style::weight(model.look, MessageWeight::Warning))
        }
        (PowerKnown::Known, PowerSeen::Off) => (texts.module_off, Style::new()),
        _ if run.is_some_and(trouble::no_board) => {
            (texts.no_board_answer, style::weight(model.look, MessageWeight::Error))
        }
        _ if board.is_none() => (texts.no_board_yet, style::faint()),
        _ if on => (texts.module_on, Style::new()),
        _ => (texts.module_off, Style::new()),
    };
    let which = match board {
        Some(board) => format!("{} · {}", board.board_serial, model.said(&board.link)),
        None => model.bench.ready().map(|bench| model.said(&bench.link).into_owned()).unwrap_or_default(),
    };
    let all = if which.is_empty() { power.to_owned() } else { format!("{power} · {which}") };
    (text::shown(&all), style)
}

/// Which rules of the interface document the board of this run breaks: the number, and the last one in words.
fn breaches(model: &ScreenModel) -> Option<(String, Style)> {
    let seen = model.run.as_ref()?.state.breaches();
    let newest = seen.iter().rev().find(|seen| seen.breach.safety).or(seen.last())?;
    let weight = if newest.breach.safety { MessageWeight::Error } else { MessageWeight::Warning };
    if newest.breach.safety {
        return Some((model.texts.danger_powered.to_owned(), style::weight(model.look, weight)));
    }
    let BoardBreach { section, what, .. } = &newest.breach;
    let what = model.said(what);
    let told = format!("{} {}: §{section} {what}", model.texts.board_breaks, seen.len());
    Some((text::shown(&told), style::weight(model.look, weight)))
}

/// What the run is doing, as one word.
fn doing(model: &ScreenModel, run: &RunView) -> String {
    let texts = model.texts;
    match (run.state.stop(), run.pause) {
        _ if run.over => texts.run.to_owned(),
        (Some((StopHow::AtOnce, _)), _) => texts.stopping_at_once.to_owned(),
        (Some(_), _) => texts.stopping.to_owned(),
        (None, Pause::Asked) if run.state.in_flight() == 0 => texts.paused.to_owned(),
        (None, Pause::Asked) => format!("{}: {}", texts.running, texts.pausing),
        (None, Pause::No) => texts.running.to_owned(),
    }
}

/// That the run is on, or that it is being stopped, for the head of the other pages.
pub(super) fn on(model: &ScreenModel, run: &RunView) -> &'static str {
    match run.state.stop() {
        Some((StopHow::AtOnce, _)) => model.texts.stopping_at_once,
        Some(_) => model.texts.stopping,
        None if run.stops > 0 => model.texts.stopping,
        None => model.texts.running,
    }
}

/// Start, elapsed, remaining, end, round.
pub(super) fn times(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let Some(run) = &model.run else {
        let inner = block(texts.run).inner(area);
        frame.render_widget(block(texts.run), area);
        let lines = idle_lines(model, usize::from(inner.width), usize::from(inner.height));
        return text::lines(frame, lines, inner);
    };
    let block = if run.over {
        block_in(&doing(model, run), area)
    } else {
        block_in(&doing(model, run), area).border_style(style::accent(model.look))
    };
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let cells = usize::from(inner.width);
    let labels = [texts.started, texts.elapsed, texts.remaining, texts.ends_at, texts.ended_at, texts.round];
    let label_cells = labels.iter().map(|label| text::width(label)).max().unwrap_or(0);
    let line = |label: &str, value: &str| pair(label, value, Style::new(), label_cells, cells);

    let elapsed_s = elapsed_s(model, run);
    let started = run.state.started().map(|at| at.format("%H:%M:%S").to_string()).unwrap_or_default();
    let mut lines = vec![line(texts.started, &started), line(texts.elapsed, &duration(elapsed_s))];
    if run.over {
        let ended = run.state.last().map(|stamp| stamp.at.format("%H:%M:%S").to_string()).unwrap_or_default();
        lines.push(line(texts.ended_at, &ended));
    } else {
        let (remaining, ends) = expected(model, run, elapsed_s);
        lines.push(line(texts.remaining, &remaining));
        lines.push(line(texts.ends_at, &ends));
    }
    if run.rounds != RoundsSetting::Once || run.over {
        lines.push(line(texts.round, &round(model, run)));
    }
    if !run.over {
        lines.push(share_bar(model, run, cells));
        // A small screen has only five lines: the bar gives way to the round.
        if lines.len() > usize::from(inner.height) {
            lines.pop();
        }
    }
    text::lines(frame, lines, inner);
}

/// The lines before a run: what is ready, and what is known of earlier runs.
///
/// What the records say of the module matters most: where there is little room, the hint and the usual number of rounds give
/// way to it.
fn idle_lines(model: &ScreenModel, cells: usize, room: usize) -> Vec<Line<'static>> {
    let texts = model.texts;
    let mut lines = vec![Line::styled(ready(model), style::strong())];
    match &model.scan.standing {
        Some(standing) => {
            let weight = if standing.is_tested() { MessageWeight::Warning } else { MessageWeight::Info };
            let said = text::wrap(&model.said(&standing.to_string()), cells).into_iter();
            lines.extend(said.map(|line| Line::styled(line, style::weight(model.look, weight))));
        }
        None => lines.push(Line::raw("")),
    }
    let selection = model.ticks.iter().any(|tick| !tick);
    let spare = room.saturating_sub(lines.len() + usize::from(selection));
    let rounds = Line::raw(text::cut(&rounds_words(model, model.rounds), cells));
    if spare > 0 || model.rounds != RoundsSetting::Once {
        lines.push(rounds);
    }
    if selection {
        lines.push(Line::styled(text::cut(texts.selection_long, cells), style::badge(model.look)));
    }
    if spare > 1 {
        lines.insert(1, Line::raw(what_next(model, cells)));
    }
    lines
}

/// "scan, then F5"; after a scan which module F5 tests.
fn what_next(model: &ScreenModel, cells: usize) -> String {
    let texts = model.texts;
    let Some(number) = &model.scan.current else {
        let next = if model.is_refused() { texts.refused_next } else { texts.no_verdict_yet };
        return text::cut(next, cells);
    };
    // A long number is cut, and what to do stays.
    let told = model.what_f5_does();
    let room = cells.saturating_sub(text::width(&fill(told, &[""])));
    // The panel of the module has the number, and what to do with the file stands in full.
    if model.is_refused() && text::width(&text::shown(number)) > room {
        return text::cut(texts.refused_next, cells);
    }
    text::cut(&fill(told, &[&text::cut(&text::shown(number), room)]), cells)
}

/// That all is ready for a run, or that a file with mistakes stands in its way.
pub(super) fn ready(model: &ScreenModel) -> &'static str {
    if model.is_refused() { model.texts.not_ready } else { model.texts.ready }
}

pub(super) fn rounds_words(model: &ScreenModel, rounds: RoundsSetting) -> String {
    let texts = model.texts;
    match rounds {
        RoundsSetting::Once => texts.rounds_once.to_owned(),
        RoundsSetting::Count(count) => fill(texts.rounds_count, &[&count.to_string()]),
        RoundsSetting::Minutes(minutes) => fill(texts.rounds_time, &[&minutes.to_string()]),
        RoundsSetting::For(time) => fill(texts.rounds_time, &[&minutes(time)]),
    }
}

/// A time as minutes with a decimal.
fn minutes(time: Duration) -> String {
    format!("{:.1}", time.as_secs_f64() / 60.0)
}

fn elapsed_s(model: &ScreenModel, run: &RunView) -> f64 {
    let of_record = run.state.last().map_or(0.0, |stamp| stamp.elapsed_us as f64 / 1e6);
    if run.over || run.state.verdict().is_some() {
        of_record
    } else {
        model.now.since_start.saturating_sub(run.began).as_secs_f64().max(of_record)
    }
}

/// What remains and when it ends, by the last whole run of the plan.
fn expected(model: &ScreenModel, run: &RunView, elapsed_s: f64) -> (String, String) {
    let texts = model.texts;
    // The time of a part of the plan is unknown.
    let whole = run.state.header().is_some_and(|header| header.selection.is_none());
    let Some(expected_s) = run.expected_s.filter(|_| whole) else {
        // The captures of a plan take known times, and most of the whole.
        let left_s =
            model.guidance().and_then(|(item, guidance)| super::calibration::plan_left_s(model, item, guidance));
        if let Some(left_s) = left_s.filter(|_| run.pause == Pause::No) {
            let ends = model.now.at + chrono::TimeDelta::milliseconds((left_s * 1e3) as i64);
            return (duration(left_s), ends.format("%H:%M:%S").to_string());
        }
        return (texts.unknown_yet.to_owned(), texts.unknown_yet.to_owned());
    };
    let remaining_s = expected_s - elapsed_s + run.paused.as_secs_f64();
    if remaining_s < 0.0 && run.pause == Pause::Asked {
        return (texts.unknown_yet.to_owned(), texts.unknown_yet.to_owned());
    }
    if remaining_s < 0.0 {
        return (texts.longer_than_last.to_owned(), "-".to_owned());
    }
    let ends = model.now.at + chrono::TimeDelta::milliseconds((remaining_s * 1e3) as i64);
    (duration(remaining_s), ends.format("%H:%M:%S").to_string())
}

/// "3 of 10: 2 passed, 1 failed".
fn round(model: &ScreenModel, run: &RunView) -> String {
    let texts = model.texts;
    let number = run.state.header().and_then(|header| header.looped).map_or(1, |looped| looped.index);
    let which = match run.rounds {
        RoundsSetting::Count(count) => fill(texts.round_of, &[&number.to_string(), &count.to_string()]),
        RoundsSetting::Once => "1".to_owned(),
        RoundsSetting::Minutes(minutes) => {
            format!("{number} ({})", fill(texts.rounds_time, &[&minutes.to_string()]))
        }
        RoundsSetting::For(time) => format!("{number} ({})", fill(texts.rounds_time, &[&minutes(time)])),
    };
    let counts = Verdict::counts(&run.ends).into_iter();
    let counts: Vec<String> = counts.map(|(verdict, count)| format!("{count} {}", texts.word_of(verdict))).collect();
    if counts.is_empty() { which } else { format!("{which}: {}", counts.join(", ")) }
}

/// Items that are over, of those that are to be run.
pub(super) fn share(run: &RunView) -> (usize, usize) {
    let selected = || run.state.rows().iter().filter(|row| row.planned.selected);
    (selected().filter(|row| row.is_over()).count(), selected().count())
}

/// The share of items that are over, as a bar.
fn share_bar(model: &ScreenModel, run: &RunView, cells: usize) -> Line<'static> {
    let (over, all) = share(run);
    let label = format!(" {over}/{all}");
    let room = cells.saturating_sub(text::width(&label));
    Line::styled(format!("{}{label}", bar(over, all, room)), style::accent(model.look))
}

/// A bar of `cells` cells.
pub(super) fn bar(part: usize, whole: usize, cells: usize) -> String {
    let filled = (part * cells).checked_div(whole).unwrap_or(0).min(cells);
    format!("{}{}", "█".repeat(filled), "░".repeat(cells - filled))
}

/// The verdict, to be read from two metres.
pub(super) fn verdict(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    let verdict = model.run.as_ref().and_then(RunView::verdict);
    let Some(verdict) = verdict else { return no_verdict(model, frame, area) };
    let style = style::verdict_area(model.look, verdict);
    let times = model.run.as_ref().map(|run| times_line(model, run)).unwrap_or_default();
    let caveat = match short_caveat(model) {
        caveat if caveat.is_empty() => caveat,
        caveat => format!(" {caveat} "),
    };
    // The verdict names its module: the panel beside may show the number that is typed for the next one.
    let word = texts.word_of(verdict);
    let number = model.run.as_ref().map(|run| text::shown(&run.serial_number)).unwrap_or_default();
    // The corners, the spaces around both titles, and the dot between.
    let room = usize::from(area.width).saturating_sub(text::width(word) + text::width(&caveat) + 8);
    let (above, below) = if text::width(&number) <= room {
        (format!(" · {number}"), String::new())
    } else {
        // Where a caveat takes the room, the number stands at the other border.
        let room = usize::from(area.width).saturating_sub(text::width(&times) + 7);
        let cut = if room > 1 { format!(" {} ", text::cut(&number, room)) } else { String::new() };
        (String::new(), cut)
    };
    let block = Block::bordered()
        .title(format!(" {word}{above} "))
        .title_bottom(Line::raw(below))
        .title(Line::raw(caveat).alignment(Alignment::Right))
        .title_bottom(Line::raw(format!(" {times} ")).alignment(Alignment::Right))
        .style(style);
    let inner = block.inner(area);
    frame.render_widget(block, area);
    big::draw(frame, inner, (texts.verdict)(verdict), style);
}

/// Before the verdict: how many items are over, or that all is ready.
fn no_verdict(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect) {
    let texts = model.texts;
    if let Some(run) = &model.run {
        let (over, all) = share(run);
        let block = block(texts.running);
        let inner = block.inner(area);
        frame.render_widget(block.border_style(style::accent(model.look)), area);
        return big::draw(frame, inner, &format!("{over}/{all}"), style::accent(model.look));
    }
    let block = Block::bordered();
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let middle = Rect { y: inner.y + inner.height / 2, height: 1.min(inner.height), ..inner };
    frame.render_widget(Paragraph::new(ready(model)).centered().style(style::faint()), middle);
}

/// A caveat beside the verdict itself, since a person may see nothing else.
fn short_caveat(model: &ScreenModel) -> String {
    let header = model.run.as_ref().and_then(|run| run.state.header());
    let is_kind = |kind| header.is_some_and(|header| header.bench.kind == kind);
    let (simulated, unproven) = (is_kind(BenchKind::Simulated), is_kind(BenchKind::Unproven));
    let selection = header.is_some_and(|header| header.selection.is_some());
    let texts = model.texts;
    let words = [(simulated, texts.simulated), (unproven, texts.unproven), (selection, model.texts.selection)];
    words.iter().filter(|(is, _)| *is).map(|(_, word)| *word).collect::<Vec<_>>().join(" ")
}

fn times_line(model: &ScreenModel, run: &RunView) -> String {
    let ended = run.state.last().map(|stamp| stamp.at.format("%H:%M:%S").to_string()).unwrap_or_default();
    let took = duration(elapsed_s(model, run));
    if run.ends.len() > 1 { round(model, run) } else { format!("{ended} · {took}") }
}

/// All that is wrong with a plan or a bench.
pub(super) fn mistakes(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, why: &str) {
    let block = block(model.texts.mistakes);
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let mut lines = headed_mistakes(model, why, usize::from(inner.width));
    let room = usize::from(inner.height);
    if lines.len() > room && room > 0 {
        let more = lines.len() - room + 1;
        lines.truncate(room - 1);
        // In the form Enter takes the form first.
        lines.push(Line::styled(fill(model.texts.all_lines, &[&more.to_string()]), style::faint()));
    }
    text::lines(frame, lines, inner);
}

/// All mistakes on a page of their own, which scrolls.
pub(super) fn all_mistakes(model: &ScreenModel, frame: &mut Frame<'_>, area: Rect, scroll: usize) {
    let why = model.refused_why().unwrap_or_default();
    super::detail::scrolled(model, frame, area, model.texts.mistakes, scroll, |cells| {
        headed_mistakes(model, why, cells)
    });
}

/// What the mistakes are of, and each line of them.
fn headed_mistakes(model: &ScreenModel, why: &str, cells: usize) -> Vec<Line<'static>> {
    let of_bench = matches!(model.bench, Loaded::Refused(_));
    let found = if of_bench { model.texts.mistakes_of_bench } else { model.texts.mistakes_found };
    let head = text::wrap(found, cells).into_iter().map(|line| Line::styled(line, style::strong()));
    head.chain(of_mistakes(model, why, cells)).collect()
}

/// Each line of the mistakes. A sentence goes on in the next line; a line of the file is cut, since the mark below it names a column.
pub(super) fn of_mistakes(model: &ScreenModel, why: &str, cells: usize) -> Vec<Line<'static>> {
    let mut lines = Vec::new();
    for line in why.lines() {
        let shown = text::shown(&model.said(line));
        let is_of_file = line.trim_start_matches(|c: char| c == ' ' || c.is_ascii_digit()).starts_with('|');
        let told = if is_of_file { vec![text::cut(&shown, cells)] } else { text::wrap(&shown, cells) };
        lines.extend(told.into_iter().map(Line::raw));
    }
    lines
}
