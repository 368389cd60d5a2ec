//! What keys do in each place.

use std::time::Duration;

use gnc_bench::fixture::Reply;

use super::interrupt::{self, interrupt};
use super::start::{self, What};
use super::{Effect, numbers, question, scan, set_language, words};
use crate::tui::decode::Key;
use crate::tui::keymap::{self, KeyAction, KeyContext};
use crate::tui::live::History;
use crate::tui::model::{ASK_FROM_S, Loaded, MessageWeight, Over, Pause, ScreenModel, ScreenPage, order};
use crate::tui::numbers::Owner;
use crate::tui::records::Check;
use crate::tui::setup_form::{Form, FormLook, FormNumber, MAX_ROUNDS};

/// Lines that a page key moves.
const PAGE_LINES: isize = 10;
/// A key this soon after its question has gone is still the answer to it: a person does not read so fast what comes instead.
const FINGER_FALLS: Duration = Duration::from_millis(1500);

pub(super) fn key(model: &mut ScreenModel, key: Key) -> Option<Effect> {
    interrupt::note(model, key);
    let place = model.place();
    if let Key::Char(character) | Key::Pasted(character) = key {
        model.scan.keep(character);
    }
    if place == KeyContext::Setup && is_text(key) {
        if let Some(Over::Setup(form)) = model.over.last_mut() {
            form.typed(key);
        }
        return None;
    }
    if model.takes_words()
        && (is_text(key) || matches!(key, Key::Enter | Key::Tab | Key::Control | Key::Up | Key::Down))
    {
        question::typed(model, key);
        return None;
    }
    if let Some(command) = typed(model, place, key) {
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

/// Whether a question waits for its keys.
pub(super) fn is_asking(place: KeyContext) -> bool {
    use KeyContext::{
        Calibration, Changed, Confirm, Detail, GivingUp, Help, Idle, Interrupted, Live, LiveRunning, Prompt, Question,
        Record, Records, Running, Setup, Stopping, Watching,
    };
    match place {
        Prompt | Question | Confirm | Changed | Interrupted | Stopping | GivingUp => true,
        Idle | Running | Detail | Live | LiveRunning | Watching | Calibration | Records | Record | Setup | Help => {
            false
        }
    }
}

/// Text that a hand types while a question waits is for nobody. `Some`: the key was text, or ended a scan.
#[expect(clippy::option_option, reason = "whether the key was taken, and what it asks for")]
fn in_question(model: &mut ScreenModel, key: Key) -> Option<Option<Effect>> {
    match key {
        Key::Enter | Key::Tab if model.scan.waits() => Some(scan::finish_typed(model).unwrap_or(None)),
        Key::Char(_) | Key::Pasted(_) | Key::Backspace | Key::Control => Some(None),
        _ => None,
    }
}

/// Adds text to the serial number, or to the search of the records. `Some`: the key was text, or ended it.
#[expect(clippy::option_option, reason = "whether the key was taken, and what it asks for")]
fn typed(model: &mut ScreenModel, place: KeyContext, key: Key) -> Option<Option<Effect>> {
    if is_asking(place) {
        return in_question(model, key);
    }
    let searching = matches!(place, KeyContext::Records);
    let typing = if searching { !model.records.search.is_empty() } else { !model.scan.typed.is_empty() };
    if matches!(key, Key::Enter | Key::Tab) && typing && !searching {
        return Some(scan::finish_typed(model).unwrap_or(None));
    }
    let field = if searching { &mut model.records.search } else { &mut model.scan.typed };
    match key {
        // A space between characters belongs to the number; a space alone ticks an item.
        Key::Char(' ') if !typing => return None,
        Key::Char(character) | Key::Pasted(character) => field.push(character),
        Key::Control => field.spoil(),
        Key::Backspace => field.pop(),
        Key::Esc if typing => field.clear(),
        _ => return None,
    }
    if searching {
        model.records.run_cursor = 0;
    }
    Some(None)
}

fn act(model: &mut ScreenModel, place: KeyContext, action: KeyAction) -> Option<Effect> {
    match action {
        KeyAction::Help => model.over.push(Over::Help { place, scroll: 0 }),
        KeyAction::Setup => {
            let form = Form::new(model);
            model.over.push(Over::Setup(form));
            return Some(Effect::ListChoices);
        }
        KeyAction::Start => return start::begin(model, What::Ticked),
        KeyAction::One => return start::begin(model, What::One),
        KeyAction::Repeat => return start::begin(model, What::Failed),
        KeyAction::Watch => return watch(model),
        KeyAction::Pause => return pause(model),
        KeyAction::AbortItem => return abort_item(model),
        KeyAction::Stop => return stop_or_ask(model),
        KeyAction::Interrupt => return interrupt(model, place),
        KeyAction::StopAnyway => return stop_anyway(model),
        KeyAction::GiveUpAnyway => {
            let asked = model.over.pop_if(|over| matches!(over, Over::GiveUp { .. }));
            if let Some(Over::GiveUp { item, .. }) = asked {
                return give_up(model, &item);
            }
        }
        KeyAction::NextPage => return next_page(model),
        KeyAction::Leave => return leave(model),
        KeyAction::Tick => tick(model),
        KeyAction::TickAll => {
            model.only = None;
            let all = model.ticks.iter().all(|tick| *tick);
            model.ticks.iter_mut().for_each(|tick| *tick = !all);
        }
        KeyAction::Open => return open(model, place),
        KeyAction::Take => return take_form(model),
        KeyAction::LookAgain => return look_again(model),
        KeyAction::Back if place == KeyContext::Watching => return leave_watch(model),
        KeyAction::Back => back(model, place),
        KeyAction::Yes | KeyAction::No | KeyAction::Redo if place == KeyContext::Question => {
            return question::answer(model, action);
        }
        KeyAction::Yes
        | KeyAction::No
        | KeyAction::Redo
        | KeyAction::LoadNew
        | KeyAction::RunChecked
        | KeyAction::TakeUp
        | KeyAction::FromStart => {
            return start::answer(model, action).unwrap_or_else(|| answer(model, action == KeyAction::Yes));
        }
        KeyAction::Log => model.over.push(Over::Log { scroll: 0 }),
        KeyAction::Verify => return verify(model),
        KeyAction::Redraw => model.redraw = true,
        KeyAction::Filter => model.records.turn_filter(),
        KeyAction::Reload => return read_records(model),
        KeyAction::Left | KeyAction::Right => {
            let step = if action == KeyAction::Left { -1 } else { 1 };
            let choices = model.choices.clone();
            if let Some(Over::Setup(form)) = model.over.last_mut() {
                form.turn(&choices, step);
            }
        }
        KeyAction::Up => move_by(model, place, -1),
        KeyAction::Down => move_by(model, place, 1),
        KeyAction::PageUp => move_by(model, place, -PAGE_LINES),
        KeyAction::PageDown => move_by(model, place, PAGE_LINES),
        KeyAction::Home => move_by(model, place, isize::MIN / 2),
        KeyAction::End => move_by(model, place, isize::MAX / 2),
    }
    None
}

fn watch(model: &mut ScreenModel) -> Option<Effect> {
    if !matches!(model.bench, Loaded::Ready(_)) {
        model.say(MessageWeight::Error, model.texts.no_bench);
        return None;
    }
    // Not both: a start that is still being checked gives way.
    model.pending = None;
    model.watching = true;
    model.live = History::default();
    model.live_of.clone_from(&model.scan.current);
    model.message = None;
    Some(Effect::Watch)
}

fn pause(model: &mut ScreenModel) -> Option<Effect> {
    let run = model.run.as_mut().filter(|run| !run.over)?;
    run.pause = if run.pause == Pause::No { Pause::Asked } else { Pause::No };
    Some(Effect::Pause(run.pause == Pause::Asked))
}

fn abort_item(model: &mut ScreenModel) -> Option<Effect> {
    let gone = model.give_up_gone.take();
    if gone.is_some_and(|gone| model.now.since_start.saturating_sub(gone) < FINGER_FALLS) {
        model.say(MessageWeight::Warning, model.texts.not_running_item);
        return None;
    }
    let item = model.item_under_cursor()?.to_owned();
    let lost_s = model.lost_with_s(&item);
    if lost_s > ASK_FROM_S && is_running(model, &item) {
        model.over.push(Over::GiveUp { item, lost_s });
        return None;
    }
    give_up(model, &item)
}

fn is_running(model: &ScreenModel, item: &str) -> bool {
    let row = model.run.as_ref().and_then(|run| run.state.row(item));
    row.is_some_and(|row| row.running().is_some())
}

/// Ends an item, if it has not ended meanwhile.
fn give_up(model: &mut ScreenModel, item: &str) -> Option<Effect> {
    if !is_running(model, item) {
        model.say(MessageWeight::Warning, model.texts.not_running_item);
        return None;
    }
    let told = words(model.texts.aborting_item, &[item]);
    model.aborting = Some(told.clone());
    model.say(MessageWeight::Info, told);
    Some(Effect::AbortItem(item.to_owned()))
}

/// Stops the run, or asks first if the stop would lose much. Only the first stop asks.
pub(super) fn stop_or_ask(model: &mut ScreenModel) -> Option<Effect> {
    let lost_s = model.lost_s();
    if lost_s > ASK_FROM_S && model.run.as_ref().is_some_and(|run| !run.over && run.stops == 0) {
        model.over.push(Over::Stop { lost_s });
        return None;
    }
    stop(model)
}

pub(super) fn stop_anyway(model: &mut ScreenModel) -> Option<Effect> {
    model.over.retain(|over| !matches!(over, Over::Stop { .. }));
    stop(model)
}

fn stop(model: &mut ScreenModel) -> Option<Effect> {
    if model.watching {
        return Some(Effect::Stop);
    }
    let run = model.run.as_mut().filter(|run| !run.over)?;
    run.stops += 1;
    Some(Effect::Stop)
}

fn next_page(model: &mut ScreenModel) -> Option<Effect> {
    model.over.clear();
    // The live page is no longer shown, so the module need not stay on.
    let unwatched = (model.watching && model.page == ScreenPage::Live).then_some(Effect::Stop);
    model.page = match model.page {
        ScreenPage::Tests if model.captures() => ScreenPage::Calibration,
        ScreenPage::Tests | ScreenPage::Calibration => ScreenPage::Live,
        ScreenPage::Live => ScreenPage::Records,
        ScreenPage::Records => ScreenPage::Tests,
    };
    model.records.reading = model.page == ScreenPage::Records;
    unwatched.or_else(|| read_if_due(model))
}

fn leave_watch(model: &mut ScreenModel) -> Option<Effect> {
    model.page = ScreenPage::Tests;
    Some(Effect::Stop)
}

/// Reads the records if the records page waits for them.
pub(super) fn read_if_due(model: &mut ScreenModel) -> Option<Effect> {
    if model.page == ScreenPage::Records && model.records.reading { read_records(model) } else { None }
}

fn read_records(model: &mut ScreenModel) -> Option<Effect> {
    model.records.reading = true;
    match &model.records.runs {
        Some(runs) => Some(Effect::ListRuns(runs.day.clone())),
        None => Some(Effect::ListDays),
    }
}

pub(super) fn leave(model: &mut ScreenModel) -> Option<Effect> {
    if model.watching {
        model.leaving = true;
        return Some(Effect::Stop);
    }
    if !model.is_running() {
        return Some(Effect::Leave);
    }
    if !model.leaving {
        model.over.push(Over::Leave);
    }
    None
}

fn tick(model: &mut ScreenModel) {
    let Some(position) = model.order().get(model.cursor).copied() else { return };
    model.only = None;
    if let Some(tick) = model.ticks.get_mut(position) {
        *tick = !*tick;
    }
}

fn open(model: &mut ScreenModel, place: KeyContext) -> Option<Effect> {
    match place {
        KeyContext::Records => {
            let records = &mut model.records;
            if records.runs.is_none() {
                let day = records.days.as_ref()?.get(records.day_cursor)?.name.clone();
                records.reading = true;
                return Some(Effect::ListRuns(day));
            }
            let path = records.shown().get(records.run_cursor)?.path.clone();
            records.reading = true;
            return Some(Effect::OpenRun(path));
        }
        KeyContext::Record => {
            let open = model.records.open.as_ref()?;
            let position = *order(&open.state).get(open.cursor)?;
            let name = open.state.rows()[position].planned.name.clone();
            model.over.push(Over::Item { name, scroll: 0 });
        }
        KeyContext::Idle if model.run.is_none() && model.is_refused() => model.over.push(Over::Mistakes { scroll: 0 }),
        _ => {
            let name = model.item_under_cursor()?.to_owned();
            if model.run.is_some() {
                model.over.push(Over::Item { name, scroll: 0 });
            }
        }
    }
    None
}

fn take_form(model: &mut ScreenModel) -> Option<Effect> {
    let Some(Over::Setup(form)) = model.over.last() else { return None };
    let form = form.clone();
    let Some(rounds) = form.asked_rounds() else {
        let most = MAX_ROUNDS.to_string();
        model.say(MessageWeight::Error, words(model.texts.not_a_number, &[&most]));
        return None;
    };
    for FormNumber { asked, field, .. } in &form.numbers {
        if let Some(told) = numbers::misfit(model, &asked.key, field.text().trim()) {
            model.say(MessageWeight::Error, told);
            return None;
        }
    }
    if let Some(told) = numbers::revision_alone(model, &form) {
        model.say(MessageWeight::Error, told);
        return None;
    }
    if let Some(part) = &form.part {
        model.part = part.each_ref().map(|field| field.text().trim().to_owned());
    }
    let owner = match model.owner_of_numbers() {
        Owner::Next if !form.later => Owner::Present,
        owner => owner,
    };
    for number in form.numbers.iter().filter(|number| number.is_changed()) {
        model.numbers.set(&number.asked, number.field.text().trim(), owner);
    }
    model.over.pop();
    model.message = None;
    model.rounds = rounds;
    model.after_failure = form.after_failure;
    form.operator.text().trim().clone_into(&mut model.operator);
    // The operator has seen the name on the form.
    model.operator_remembered = false;
    set_language(model, form.lang);
    let (plan, bench) = (form.plan.text().trim().to_owned(), form.bench.text().trim().to_owned());
    let are_ready = matches!((&model.plan, &model.bench), (Loaded::Ready(_), Loaded::Ready(_)));
    // The operator has seen what the files are now.
    let are_looked_at = form.look.is_some_and(|look| look.is_at(&plan, &bench));
    if plan != model.plan_path || bench != model.bench_path || !are_ready || are_looked_at {
        return Some(start::choose(model, plan, bench));
    }
    None
}

/// Has the plan and the bench of the form looked at: its panel shows what was found. What is held stays, with the verdict on the screen,
/// until Enter takes the form.
fn look_again(model: &mut ScreenModel) -> Option<Effect> {
    let is_refused = model.is_refused();
    let Some(Over::Setup(form)) = model.over.last_mut() else { return None };
    let (plan, bench) = (form.plan.text().trim().to_owned(), form.bench.text().trim().to_owned());
    let is_read = matches!(model.plan, Loaded::Loading) || matches!(model.bench, Loaded::Loading);
    let is_looked_at = form.look.as_ref().is_some_and(|look| matches!(look.plan, Loaded::Loading));
    let are_others = plan != model.plan_path || bench != model.bench_path;
    if is_read || is_looked_at || !(are_others || is_refused || model.run.is_none()) {
        return None;
    }
    let (plan_path, bench_path) = (plan.clone(), bench.clone());
    let look = FormLook { plan_path, bench_path, bench: Loaded::Loading, plan: Loaded::Loading };
    form.look = Some(Box::new(look));
    Some(Effect::Look { plan, bench })
}

/// Shows what a look found, if the form waits for it.
pub(super) fn looked_at(model: &mut ScreenModel, found: &FormLook) {
    let forms = model.over.iter_mut().filter_map(|over| if let Over::Setup(form) = over { Some(form) } else { None });
    for form in forms {
        if let Some(look) = form.look.as_mut().filter(|look| look.is_at(&found.plan_path, &found.bench_path)) {
            (**look).clone_from(found);
        }
    }
}

fn back(model: &mut ScreenModel, place: KeyContext) {
    if model.over.pop().is_some() {
        return;
    }
    match place {
        KeyContext::Record => model.records.open = None,
        KeyContext::Records => {
            if model.records.runs.take().is_none() {
                model.page = ScreenPage::Tests;
            }
            model.records.error = None;
        }
        KeyContext::Live | KeyContext::LiveRunning | KeyContext::Calibration => model.page = ScreenPage::Tests,
        _ => {}
    }
}

pub(super) fn answer(model: &mut ScreenModel, yes: bool) -> Option<Effect> {
    if model.over.pop_if(|over| matches!(over, Over::Stop { .. } | Over::GiveUp { .. })).is_some() {
        return None;
    }
    if model.over.pop_if(|over| *over == Over::Leave).is_some() {
        if yes {
            model.leaving = true;
            model.say(MessageWeight::Warning, model.texts.leave_stop_first);
            let run = model.run.as_mut().filter(|run| !run.over)?;
            // A second stop would be at once.
            run.stops = run.stops.max(1);
            return Some(Effect::StopAndLeave);
        }
        return None;
    }
    let run = model.run.as_mut()?;
    run.prompt.take().map(|_| Effect::Answer(if yes { Reply::Done } else { Reply::NotPossible }))
}

fn verify(model: &mut ScreenModel) -> Option<Effect> {
    let records = &mut model.records;
    if let Some(open) = &mut records.open {
        open.check = Check::Running;
        return Some(Effect::Verify(open.path.clone()));
    }
    let path = records.shown().get(records.run_cursor)?.path.clone();
    let texts = model.texts;
    model.say(MessageWeight::Info, texts.verifying);
    Some(Effect::Verify(path))
}

/// Moves the cursor, or scrolls if there is no cursor.
fn move_by(model: &mut ScreenModel, place: KeyContext, step: isize) {
    let end = model.scroll_end.get();
    match model.over.last_mut() {
        Some(Over::Setup(form)) => {
            return form.line = moved(form.line, step.signum(), form.lines().len() - 1);
        }
        Some(
            Over::Help { scroll, .. } | Over::Item { scroll, .. } | Over::Log { scroll } | Over::Mistakes { scroll },
        ) => {
            return *scroll = moved(*scroll, step, end);
        }
        _ => {}
    }
    match place {
        KeyContext::Records => {
            let records = &mut model.records;
            if records.runs.is_some() {
                let last = records.shown().len().saturating_sub(1);
                records.run_cursor = moved(records.run_cursor, step, last);
            } else {
                let last = records.days.as_ref().map_or(0, Vec::len).saturating_sub(1);
                records.day_cursor = moved(records.day_cursor, step, last);
            }
        }
        KeyContext::Record => {
            if let Some(open) = &mut model.records.open {
                open.cursor = moved(open.cursor, step, open.state.rows().len().saturating_sub(1));
            }
        }
        _ => {
            model.cursor = moved(model.cursor, step, model.order().len().saturating_sub(1));
            model.cursor_moved = true;
        }
    }
}

fn moved(at: usize, step: isize, last: usize) -> usize {
    at.min(last).saturating_add_signed(step).min(last)
}
