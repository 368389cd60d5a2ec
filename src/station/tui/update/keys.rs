//! Keys: what they do where.

use super::start::{self, ask_to_start};
use super::{Command, set_language, words};
use crate::serial_number::{self, SerialNumberError};
use crate::tui::decode::Key;
use crate::tui::keymap::{self, Action, Place};
use crate::tui::live::History;
use crate::tui::model::{Loaded, Model, Over, Page, Pause, Rounds, RunView, Weight, order};
use crate::tui::pending::Pending;
use crate::tui::records::Check;
use crate::tui::setup_form::{Form, Line, MAX_ROUNDS};

/// Lines that a page key moves.
const PAGE_LINES: isize = 10;

pub(super) fn key(model: &mut Model, key: Key) -> Option<Command> {
    let place = model.place();
    if place == Place::Setup && is_text(key) {
        if let Some(Over::Setup(form)) = model.over.last_mut() {
            form.typed(key);
        }
        return None;
    }
    if let Some(command) = scanned(model, place, key) {
        return command;
    }
    match keymap::action(place, key) {
        Some(action) => act(model, place, action),
        None => None,
    }
}

fn is_text(key: Key) -> bool {
    matches!(key, Key::Char(_) | Key::Pasted(_) | Key::Backspace)
}

/// Text goes to the serial number, or to the search of the records. `Some`: the key was text, or ended it.
#[expect(clippy::option_option, reason = "whether the key was taken, and what it asks for")]
fn scanned(model: &mut Model, place: Place, key: Key) -> Option<Option<Command>> {
    let searching = matches!(place, Place::Records);
    let field = if searching { &mut model.records.search } else { &mut model.scan.typed };
    let typing = !field.is_empty();
    match key {
        // Between characters it belongs to the number; alone it ticks.
        Key::Char(' ') if !typing => return None,
        Key::Char(character) | Key::Pasted(character) => field.push(character),
        Key::Control => field.spoil(),
        Key::Backspace => field.pop(),
        Key::Esc if typing => field.clear(),
        Key::Enter | Key::Tab if typing && !searching => {
            finish_scan(model);
            return Some(look_up(model));
        }
        _ => return None,
    }
    if searching {
        model.records.run_cursor = 0;
    }
    Some(None)
}

/// Takes what was typed as a serial number.
fn finish_scan(model: &mut Model) -> bool {
    let texts = model.texts;
    let field = std::mem::take(&mut model.scan.typed);
    let too_long = |characters: usize| {
        words(texts.scan_too_long, &[&characters.to_string(), &serial_number::MAX_CHARACTERS.to_string()])
    };
    let problem = match serial_number::check(field.text()) {
        _ if field.has_control() => texts.scan_control.to_owned(),
        _ if field.characters() > serial_number::MAX_CHARACTERS => too_long(field.characters()),
        Err(SerialNumberError::Empty) => texts.scan_empty.to_owned(),
        Err(SerialNumberError::TooLong { characters }) => too_long(characters),
        Err(SerialNumberError::Control { .. }) => texts.scan_control.to_owned(),
        Ok(number) => {
            take_number(model, number);
            return true;
        }
    };
    model.say(Weight::Error, problem);
    false
}

fn take_number(model: &mut Model, number: String) {
    let texts = model.texts;
    let shown = gnc_text::printable(&number).into_owned();
    if model.is_running() {
        model.scan.next = Some(number);
        return model.say(Weight::Info, words(texts.scanned_next, &[&shown]));
    }
    model.scan.current = Some(number);
    model.scan.next = None;
    model.scan.earlier = None;
    model.pending = None;
    // The verdict on the screen was another module's.
    model.run = None;
    model.cursor = 0;
    model.page = Page::Tests;
    model.over.retain(|over| matches!(over, Over::Setup(_)));
    model.say(Weight::Info, words(texts.scanned, &[&shown]));
}

fn look_up(model: &Model) -> Option<Command> {
    let number = model.scan.current.clone().filter(|_| !model.is_running() && model.scan.earlier.is_none());
    number.map(Command::LookUp)
}

fn act(model: &mut Model, place: Place, action: Action) -> Option<Command> {
    match action {
        Action::Help => model.over.push(Over::Help { place, scroll: 0 }),
        Action::Setup => {
            let form = Form::new(model);
            model.over.push(Over::Setup(form));
            return Some(Command::ListChoices);
        }
        Action::Start => return begin(model, What::Ticked),
        Action::One => return begin(model, What::One),
        Action::Repeat => return begin(model, What::Failed),
        Action::Watch => return watch(model),
        Action::Pause => return pause(model),
        Action::AbortItem => return abort_item(model),
        Action::Stop => return stop(model),
        Action::NextPage => return next_page(model),
        Action::Leave => return leave(model),
        Action::Tick => tick(model),
        Action::TickAll => {
            let all = model.ticks.iter().all(|tick| *tick);
            model.ticks.iter_mut().for_each(|tick| *tick = !all);
        }
        Action::Open => return open(model, place),
        Action::Take => return take_form(model),
        Action::Back if place == Place::Watching => return leave_watch(model),
        Action::Back => back(model, place),
        Action::Yes | Action::No | Action::LoadNew | Action::RunChecked | Action::TakeUp | Action::FromStart => {
            return start::answer(model, action).unwrap_or_else(|| answer(model, action == Action::Yes));
        }
        Action::Log => model.over.push(Over::Log { scroll: 0 }),
        Action::Verify => return verify(model),
        Action::Redraw => model.redraw = true,
        Action::Filter => model.records.turn_filter(),
        Action::Reload => return read_records(model),
        Action::Left | Action::Right => {
            let step = if action == Action::Left { -1 } else { 1 };
            let choices = model.choices.clone();
            if let Some(Over::Setup(form)) = model.over.last_mut() {
                form.turn(&choices, step);
            }
        }
        Action::Up => move_by(model, place, -1),
        Action::Down => move_by(model, place, 1),
        Action::PageUp => move_by(model, place, -PAGE_LINES),
        Action::PageDown => move_by(model, place, PAGE_LINES),
        Action::Home => move_by(model, place, isize::MIN / 2),
        Action::End => move_by(model, place, isize::MAX / 2),
    }
    None
}

/// What a run is to do.
#[derive(Clone, Copy, PartialEq, Eq)]
enum What {
    Ticked,
    One,
    Failed,
}

fn begin(model: &mut Model, what: What) -> Option<Command> {
    if model.watching {
        model.say(Weight::Warning, model.texts.not_during_run);
        return None;
    }
    // A scanner that sends no line end: the number is complete when somebody starts.
    if !model.scan.typed.is_empty() && !finish_scan(model) {
        return None;
    }
    if let Some(next) = model.scan.next.take() {
        take_number(model, next);
    }
    let lacking = match (&model.bench, &model.plan) {
        (Loaded::Loading, _) | (_, Loaded::Loading) => Some(model.texts.still_loading),
        (Loaded::Ready(_), Loaded::Ready(_)) => None,
        (Loaded::Ready(_), _) => Some(model.texts.no_plan),
        _ => Some(model.texts.no_bench),
    };
    if let Some(lacking) = lacking {
        model.say(Weight::Error, lacking);
        return None;
    }
    let selection = match what {
        What::Ticked => ticked(model),
        What::One => model.item_under_cursor().map(|item| vec![item.to_owned()]),
        What::Failed => failed(model),
    };
    let everything = what == What::Ticked && model.ticks.iter().all(|tick| *tick);
    if selection.is_none() && !everything {
        return None;
    }
    let selection = selection.filter(|_| !everything);
    // One item may be looped, to watch it; what failed is looked at once.
    let rounds = if what == What::Failed { Rounds::Once } else { model.rounds };
    ask_to_start(model, Pending::new(selection, rounds))
}

fn ticked(model: &mut Model) -> Option<Vec<String>> {
    let items = &model.plan.ready()?.items;
    let names = items.iter().zip(&model.ticks).filter(|(_, tick)| **tick).map(|(item, _)| item.name.clone());
    let names: Vec<String> = names.collect();
    if names.is_empty() {
        model.say(Weight::Warning, model.texts.nothing_ticked);
        return None;
    }
    Some(names)
}

fn failed(model: &mut Model) -> Option<Vec<String>> {
    let last = model.run.as_ref().filter(|run| model.scan.current.as_deref() == Some(run.serial_number.as_str()));
    let names = last.map(RunView::to_repeat).unwrap_or_default();
    if names.is_empty() {
        model.say(Weight::Info, model.texts.nothing_failed);
        return None;
    }
    Some(names)
}

fn watch(model: &mut Model) -> Option<Command> {
    if !matches!(model.bench, Loaded::Ready(_)) {
        model.say(Weight::Error, model.texts.no_bench);
        return None;
    }
    model.watching = true;
    model.live = History::default();
    model.message = None;
    Some(Command::Watch)
}

fn pause(model: &mut Model) -> Option<Command> {
    let run = model.run.as_mut().filter(|run| !run.over)?;
    run.pause = if run.pause == Pause::No { Pause::Asked } else { Pause::No };
    Some(Command::Pause(run.pause == Pause::Asked))
}

fn abort_item(model: &mut Model) -> Option<Command> {
    let item = model.item_under_cursor()?.to_owned();
    let runs = model.run.as_ref()?.state.row(&item).is_some_and(|row| row.running().is_some());
    if !runs {
        model.say(Weight::Warning, model.texts.not_running_item);
        return None;
    }
    model.say(Weight::Info, words(model.texts.aborting_item, &[&item]));
    Some(Command::AbortItem(item))
}

fn stop(model: &mut Model) -> Option<Command> {
    if model.watching {
        return Some(Command::Stop);
    }
    let run = model.run.as_mut().filter(|run| !run.over)?;
    run.stops += 1;
    Some(Command::Stop)
}

fn next_page(model: &mut Model) -> Option<Command> {
    model.over.clear();
    // Nobody watches any more: the module need not stay on.
    let unwatched = (model.watching && model.page == Page::Live).then_some(Command::Stop);
    model.page = match model.page {
        Page::Tests if model.captures() => Page::Calibration,
        Page::Tests | Page::Calibration => Page::Live,
        Page::Live => Page::Records,
        Page::Records => Page::Tests,
    };
    model.records.reading = model.page == Page::Records;
    unwatched.or_else(|| read_if_due(model))
}

fn leave_watch(model: &mut Model) -> Option<Command> {
    model.page = Page::Tests;
    Some(Command::Stop)
}

/// Reads what the records page waits for.
pub(super) fn read_if_due(model: &mut Model) -> Option<Command> {
    if model.page == Page::Records && model.records.reading { read_records(model) } else { None }
}

fn read_records(model: &mut Model) -> Option<Command> {
    model.records.reading = true;
    match &model.records.runs {
        Some(runs) => Some(Command::ListRuns(runs.day.clone())),
        None => Some(Command::ListDays),
    }
}

fn leave(model: &mut Model) -> Option<Command> {
    if model.watching {
        model.leaving = true;
        return Some(Command::Stop);
    }
    if !model.is_running() {
        return Some(Command::Leave);
    }
    if !model.leaving {
        model.over.push(Over::Leave);
    }
    None
}

fn tick(model: &mut Model) {
    let Some(position) = model.order().get(model.cursor).copied() else { return };
    if let Some(tick) = model.ticks.get_mut(position) {
        *tick = !*tick;
    }
}

fn open(model: &mut Model, place: Place) -> Option<Command> {
    match place {
        Place::Records => {
            let records = &mut model.records;
            if records.runs.is_none() {
                let day = records.days.as_ref()?.get(records.day_cursor)?.name.clone();
                records.reading = true;
                return Some(Command::ListRuns(day));
            }
            let path = records.shown().get(records.run_cursor)?.path.clone();
            records.reading = true;
            return Some(Command::OpenRun(path));
        }
        Place::Record => {
            let open = model.records.open.as_ref()?;
            let position = *order(&open.state).get(open.cursor)?;
            let name = open.state.rows()[position].planned.name.clone();
            model.over.push(Over::Item { name, scroll: 0 });
        }
        _ => {
            let name = model.item_under_cursor()?.to_owned();
            if model.run.is_some() {
                model.over.push(Over::Item { name, scroll: 0 });
            }
        }
    }
    None
}

fn take_form(model: &mut Model) -> Option<Command> {
    let Some(Over::Setup(form)) = model.over.last() else { return None };
    let form = form.clone();
    let Some(rounds) = form.asked_rounds() else {
        let most = MAX_ROUNDS.to_string();
        model.say(Weight::Error, words(model.texts.not_a_number, &[&most]));
        return None;
    };
    model.over.pop();
    model.message = None;
    model.rounds = rounds;
    model.after_failure = form.after_failure;
    form.operator.text().trim().clone_into(&mut model.operator);
    set_language(model, form.lang);
    let (plan, bench) = (form.plan.text().trim().to_owned(), form.bench.text().trim().to_owned());
    if plan != model.plan_path || bench != model.bench_path || !matches!(model.plan, Loaded::Ready(_)) {
        model.plan = Loaded::Loading;
        model.pending = None;
        return Some(Command::Choose { plan, bench });
    }
    None
}

fn back(model: &mut Model, place: Place) {
    if model.over.pop().is_some() {
        return;
    }
    match place {
        Place::Record => model.records.open = None,
        Place::Records => {
            if model.records.runs.take().is_none() {
                model.page = Page::Tests;
            }
            model.records.error = None;
        }
        Place::Live | Place::LiveRunning | Place::Calibration => model.page = Page::Tests,
        _ => {}
    }
}

fn answer(model: &mut Model, yes: bool) -> Option<Command> {
    if model.over.pop_if(|over| *over == Over::Leave).is_some() {
        if yes {
            model.leaving = true;
            model.say(Weight::Warning, model.texts.leave_stop_first);
            return stop(model);
        }
        return None;
    }
    let run = model.run.as_mut()?;
    run.prompt.take().map(|_| Command::Answer(yes))
}

fn verify(model: &mut Model) -> Option<Command> {
    let records = &mut model.records;
    if let Some(open) = &mut records.open {
        open.check = Check::Running;
        return Some(Command::Verify(open.path.clone()));
    }
    let path = records.shown().get(records.run_cursor)?.path.clone();
    let texts = model.texts;
    model.say(Weight::Info, texts.verifying);
    Some(Command::Verify(path))
}

/// Moves the cursor, or scrolls where there is none.
fn move_by(model: &mut Model, place: Place, step: isize) {
    let end = model.scroll_end.get();
    match model.over.last_mut() {
        Some(Over::Setup(form)) => {
            return form.line = moved(form.line, step.signum(), Line::ALL.len() - 1);
        }
        Some(Over::Help { scroll, .. } | Over::Item { scroll, .. } | Over::Log { scroll }) => {
            return *scroll = moved(*scroll, step, end);
        }
        _ => {}
    }
    match place {
        Place::Records => {
            let records = &mut model.records;
            if records.runs.is_some() {
                let last = records.shown().len().saturating_sub(1);
                records.run_cursor = moved(records.run_cursor, step, last);
            } else {
                let last = records.days.as_ref().map_or(0, Vec::len).saturating_sub(1);
                records.day_cursor = moved(records.day_cursor, step, last);
            }
        }
        Place::Record => {
            if let Some(open) = &mut model.records.open {
                open.cursor = moved(open.cursor, step, open.state.rows().len().saturating_sub(1));
            }
        }
        _ => model.cursor = moved(model.cursor, step, model.order().len().saturating_sub(1)),
    }
}

fn moved(at: usize, step: isize, last: usize) -> usize {
    at.min(last).saturating_add_signed(step).min(last)
}
