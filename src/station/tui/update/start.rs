//! From a key to a run: the checks and the questions before the run begins.

use super::{Effect, StartRequest, numbers, scan, unknown_item};
use crate::tui::keymap::KeyAction;
use crate::tui::live::History;
use crate::tui::model::{Loaded, MessageWeight, Over, RoundsSetting, RunView, ScreenModel};
use crate::tui::pending::{Interrupted, PendingStart, Prepared, Resumable};
use crate::tui::setup_form::{Form, FormLine};

/// What a run is to do.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum What {
    Ticked,
    One,
    Failed,
}

/// Asks for a run, if all that it needs is given.
pub(super) fn begin(model: &mut ScreenModel, what: What) -> Option<Effect> {
    if model.watching {
        model.say(MessageWeight::Warning, model.texts.not_during_run);
        return None;
    }
    // F3 and F4 stay with the module on the screen. Only F5 goes on to the next one.
    let goes_on = what == What::Ticked || model.scan.current.is_none();
    // Some scanners send no line end. Then the number is complete when the operator starts.
    if goes_on && !model.scan.typed.is_empty() && scan::finish_typed(model).is_err() {
        return None;
    }
    if let Some(next) = model.scan.next.take_if(|_| goes_on) {
        scan::take_number(model, next);
    }
    let lacking = match (&model.bench, &model.plan) {
        (Loaded::Loading, _) | (_, Loaded::Loading) => Some(model.texts.still_loading),
        (Loaded::Ready(_), Loaded::Ready(_)) => None,
        (Loaded::Ready(_), _) if model.plan_path.is_empty() => Some(model.texts.no_plan),
        // The operator may have corrected the file that was refused.
        _ => return load_new(model),
    };
    if let Some(lacking) = lacking {
        model.say(MessageWeight::Error, lacking);
        return None;
    }
    if model.operator.trim().is_empty() && model.bench.ready().is_some_and(|bench| bench.operator_required) {
        model.say(MessageWeight::Warning, model.texts.operator_needed);
        model.over.push(Over::Setup(Form::at(model, FormLine::Operator)));
        return Some(Effect::ListChoices);
    }
    if let Some((line, told)) = numbers::lacking(model) {
        model.say(MessageWeight::Warning, told);
        model.over.push(Over::Setup(Form::at(model, FormLine::Number(line))));
        return Some(Effect::ListChoices);
    }
    let selection = match what {
        What::Ticked => ticked(model),
        What::One => model.item_under_cursor().map(|item| vec![item.to_owned()]),
        What::Failed => failed(model),
    };
    // Items that the command line names are a selection, even if they are all.
    let everything = what == What::Ticked && model.only.is_none() && model.ticks.iter().all(|tick| *tick);
    if selection.is_none() && !everything {
        return None;
    }
    let selection = selection.filter(|_| !everything);
    // One item may run in a loop, to watch it; failed items run only once more.
    let rounds = if what == What::Failed { RoundsSetting::Once } else { model.rounds };
    ask_to_start(model, PendingStart::new(selection, rounds))
}

fn ticked(model: &mut ScreenModel) -> Option<Vec<String>> {
    let items = &model.plan.ready()?.items;
    let names = items.iter().zip(&model.ticks).filter(|(_, tick)| **tick).map(|(item, _)| item.name.clone());
    let names: Vec<String> = names.collect();
    if names.is_empty() {
        let unknown = unknown_item(model).unwrap_or_else(|| model.texts.nothing_ticked.to_owned());
        model.say(MessageWeight::Warning, unknown);
        return None;
    }
    Some(names)
}

fn failed(model: &mut ScreenModel) -> Option<Vec<String>> {
    let last = model.run.as_ref().filter(|run| model.scan.current.as_deref() == Some(run.serial_number.as_str()));
    let names = last.map(RunView::to_repeat).unwrap_or_default();
    if names.is_empty() {
        model.say(MessageWeight::Info, model.texts.nothing_failed);
        return None;
    }
    Some(names)
}

/// The session checks files and records first.
fn ask_to_start(model: &mut ScreenModel, pending: PendingStart) -> Option<Effect> {
    let Some(serial_number) = model.scan.current.clone() else {
        model.say(MessageWeight::Warning, model.texts.scan_first);
        return None;
    };
    // The number of the command line, or one that was scanned before another plan was chosen.
    if let Some(problem) = scan::misfit(model, &serial_number) {
        model.say(MessageWeight::Error, problem);
        return None;
    }
    let (selection, resume) = (pending.selection.clone(), model.resume.clone());
    model.pending = Some(pending);
    model.say(MessageWeight::Info, model.texts.looking_back);
    Some(Effect::Prepare { serial_number, selection, resume })
}

/// Takes the result of the check. The screen then asks one question after the other.
pub(super) fn prepared(model: &mut ScreenModel, prepared: Prepared) -> Option<Effect> {
    let Prepared { serial_number, changed, standing, resume } = prepared;
    model.has_looked_back();
    // A second press of the key must not ask again.
    if model.scan.current.as_ref() != Some(&serial_number) || model.over.iter().any(is_question) {
        return None;
    }
    if model.over.iter().any(|over| matches!(over, Over::Setup(_))) {
        // The operator has turned to the form meanwhile: no run begins under it.
        model.pending = None;
        return None;
    }
    model.scan.standing.clone_from(&standing);
    let pending = model.pending.as_mut()?;
    pending.questions.clear();
    if !changed.is_empty() {
        pending.questions.push_back(Over::Changed(changed));
    }
    match (resume, standing) {
        (Some(Resumable::Yes(run)), _) => pending.questions.push_back(Over::Interrupted(run)),
        (Some(Resumable::No { why }), _) => pending.questions.push_back(Over::NoResume { why }),
        // A repeat of failed items, or a run of one item, is not a second test of the module.
        (None, Some(standing)) if pending.selection.is_none() && standing.was_run() => {
            let said = standing.to_string();
            pending.questions.push_back(Over::Again(standing));
            let said = model.said(&said).into_owned();
            model.say(MessageWeight::Warning, said);
        }
        (None, _) => {}
    }
    ask_next(model)
}

/// Asks the next question; after the last one the run begins.
fn ask_next(model: &mut ScreenModel) -> Option<Effect> {
    match model.pending.as_mut()?.questions.pop_front() {
        Some(question) => {
            model.over.push(question);
            None
        }
        None => start(model),
    }
}

/// Whether a layer asks something about a start.
fn is_question(over: &Over) -> bool {
    matches!(over, Over::Again(_) | Over::Changed(_) | Over::Interrupted(_) | Over::NoResume { .. })
}

/// The answer to a question about a start; `None` if the question on top is another one.
pub(super) fn answer(model: &mut ScreenModel, action: KeyAction) -> Option<Option<Effect>> {
    let question = model.over.pop_if(|over| is_question(over))?;
    Some(match (question, action) {
        (_, KeyAction::No) => {
            model.pending = None;
            None
        }
        (Over::Changed(_), KeyAction::LoadNew) => load_new(model),
        (Over::Interrupted(run), KeyAction::TakeUp) => take_up(model, run),
        (Over::Interrupted(_) | Over::NoResume { .. }, _) => {
            // The operator has decided about the run of the command line.
            model.resume = None;
            // A new run of the module takes only the signs of today.
            let number = model.scan.current.clone().unwrap_or_default();
            if let Some(problem) = scan::misfit(model, &number) {
                model.pending = None;
                model.say(MessageWeight::Error, problem);
                return Some(None);
            }
            ask_next(model)
        }
        _ => ask_next(model),
    })
}

/// Has plan and bench read and checked again. The operator looks at them before they run.
pub(super) fn load_new(model: &mut ScreenModel) -> Option<Effect> {
    model.say(MessageWeight::Info, model.texts.reading_new);
    let (plan, bench) = (model.plan_path.clone(), model.bench_path.clone());
    Some(choose(model, plan, bench))
}

/// Has a plan and a bench read. The verdict on the screen goes, since it belongs to the plan that was read before.
pub(super) fn choose(model: &mut ScreenModel, plan: String, bench: String) -> Effect {
    model.pending = None;
    model.plan = Loaded::Loading;
    if !model.is_running() {
        model.keep_power();
        model.run = None;
    }
    Effect::Choose { plan, bench }
}

fn take_up(model: &mut ScreenModel, run: Interrupted) -> Option<Effect> {
    model.resume = None;
    let pending = model.pending.as_mut()?;
    // Captures are taken over only once, so there is one round.
    (pending.resume, pending.rounds) = (Some(run.folder), RoundsSetting::Once);
    ask_next(model)
}

/// Starts the run that waits.
fn start(model: &mut ScreenModel) -> Option<Effect> {
    if model.watching {
        return None;
    }
    let PendingStart { selection, rounds, resume, .. } = model.pending.take()?;
    let serial_number = model.scan.current.clone()?;
    let plan = model.plan.ready()?;
    let (plan_sha256, expected_s) = (plan.sha256.clone(), plan.expected_s);
    // Readings of another module are not shown beside this module.
    model.live = History::default();
    model.live_of = Some(serial_number.clone());
    model.keep_power();
    model.line_lost = false;
    model.run = Some(RunView::new(serial_number.clone(), rounds, expected_s, &model.now));
    // A start mends what earlier ones left, before its first round.
    model.say(MessageWeight::Info, model.texts.looking_back);
    (model.cursor, model.cursor_moved) = (0, false);
    let fields = model.asked_numbers();
    model.operator_remembered = false;
    model.numbers.run_begins();
    Some(Effect::Start(StartRequest {
        serial_number,
        part: model.part.clone(),
        numbers: model.numbers.of(&fields),
        plan_sha256,
        resume,
        operator: Some(model.operator.trim().to_owned()).filter(|name| !name.is_empty()),
        selection,
        rounds,
        after_failure: model.after_failure,
    }))
}
