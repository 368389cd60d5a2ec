//! Messages of a run to the screen.

use std::path::Path;

use gnc_bench::fixture::Ask;
use gnc_executive::event::{Event, EventKind, NoteLevel, OtherModule};
use gnc_executive::part::{LimitsChosen, PartName};
use gnc_executive::standing::Standing;
use gnc_executive::state::RunState;
use gnc_executive::verdict::Verdict;

use super::{Effect, interrupt, numbers, words};
use crate::phrases::in_language;
use crate::tui::field::InputField;
use crate::tui::model::{Loaded, MessageWeight, Over, Pause, PowerSeen, Prompt, ScreenModel};
use crate::tui::pending::Interrupted;

/// Folds an event as every other observer does.
pub(super) fn event(model: &mut ScreenModel, event: &Event) -> Option<Effect> {
    let now = model.now;
    let expected_s = model.plan.ready().and_then(|plan| plan.expected_s);
    let of_sub_unit = match &event.kind {
        EventKind::Note { text, .. } => numbers::is_about_sub_unit(model, text),
        _ => false,
    };
    let run = model.run.as_mut()?;
    if matches!(event.kind, EventKind::RunStarted { .. }) {
        run.state = RunState::new();
        run.began = now.since_start;
        run.paused = std::time::Duration::ZERO;
        run.events_lost = false;
        run.expected_s = expected_s;
        model.cursor = 0;
    }
    if run.events_lost {
        return None;
    }
    if run.state.apply(event).is_err() {
        // The terminal was so far behind that events were lost. The record has them all.
        run.events_lost = true;
        // Nobody knows which attempt runs.
        model.over.retain(|over| !matches!(over, Over::GiveUp { .. }));
        model.mention(model.texts.events_lost);
        return None;
    }
    // The question is about one attempt: the next one has lost other captures, or none.
    let ended = |over: &mut Over| matches!(over, Over::GiveUp { item, .. } if run.state.row(item).is_none_or(|row| row.running().is_none()));
    if model.over.extract_if(.., ended).count() > 0 {
        model.give_up_gone = Some(now.since_start);
    }
    if matches!(event.kind, EventKind::Power(_)) {
        model.power_seen = PowerSeen::ByRun;
    }
    if let EventKind::OtherModule(OtherModule { scanned, found, .. }) = &event.kind {
        let [scanned, found] = [scanned, found].map(|text| gnc_text::printable(text).into_owned());
        let told = words(model.texts.other_module, &[&found, &scanned]);
        model.say(MessageWeight::Error, told);
        return None;
    }
    if let EventKind::Note { level: NoteLevel::Warning, text, item: None } = &event.kind
        && of_sub_unit
    {
        // Another module has a sub-unit of this run.
        let told = gnc_text::printable(&model.said(text)).into_owned();
        model.mention(told);
        return None;
    }
    if let EventKind::LimitsChosen(LimitsChosen { part, module }) = &event.kind {
        let told = match part {
            Some(part) => words(model.texts.limits_of_part, &[&part_shown(part)]),
            None => words(model.texts.limits_of_plan, &[&part_shown(module)]),
        };
        // A warning that came before matters more.
        if !matches!(model.message, Some((MessageWeight::Warning | MessageWeight::Error, _))) {
            model.say(MessageWeight::Info, told);
        }
        return None;
    }
    if let EventKind::ItemStarted { item, .. } = &event.kind
        && run.state.is_selection()
        && let Some(at) = run.state.rows().iter().position(|row| row.planned.name == *item)
    {
        // The operator chose this item among many, and wants to see it run.
        model.cursor = at;
    }
    if let Some(verdict) = run.state.verdict() {
        run.ends.push(verdict);
        run.prompt = None;
        model.cursor = 0;
        if let Loaded::Ready(plan) = &mut model.plan
            && verdict.passes_module()
        {
            plan.expected_s = Some(event.elapsed_us as f64 / 1e6);
        }
        model.call();
    }
    None
}

pub(super) fn asked(model: &mut ScreenModel, item: String, ask: Ask) {
    let since = model.now.since_start;
    let told = words(model.texts.question_waits, &[&gnc_text::printable(&item)]);
    if let Some(run) = &mut model.run {
        run.prompt = Some(Prompt { item, ask, since, typed: InputField::default() });
        model.call();
        // The run waits for the answer, so nothing to read stands before the question. Another question does, and says so.
        model.over.retain(|over| !matches!(over, Over::Help { .. }));
        if model.over.iter().any(|over| matches!(over, Over::Leave | Over::Stop { .. })) {
            model.mention(told);
        }
    }
}

/// Tells of a run that can be resumed.
pub(super) fn broke_off(model: &mut ScreenModel, serial_number: &str, run: Option<&Interrupted>) {
    let Some(run) = run.filter(|_| !model.is_running() && model.resume.is_none()) else { return };
    let template = match &model.scan.current {
        Some(current) if current == serial_number => model.texts.broke_off,
        None if model.scan.typed.is_empty() => model.texts.broke_off_scan,
        _ => return,
    };
    let at = run.at.format("%F %H:%M").to_string();
    let said = words(template, &[&gnc_text::printable(serial_number), &at]);
    model.mention(said);
}

/// Takes what the records say of the module.
pub(super) fn standing(model: &mut ScreenModel, serial_number: &str, standing: Result<Standing, String>) {
    if model.scan.current.as_deref() != Some(serial_number) {
        return;
    }
    match standing {
        Ok(standing) => model.scan.standing = Some(standing),
        Err(why) => model.say(MessageWeight::Error, model.said(&why).into_owned()),
    }
}

/// Ends the run on the screen: nothing follows.
pub(super) fn over(
    model: &mut ScreenModel,
    verdict: Option<Verdict>,
    store_error: Option<String>,
    refusal: Option<&str>,
) -> Option<Effect> {
    let (leaving, texts, lang) = (model.leaving, model.texts, model.lang);
    interrupt::ended(model);
    let run = model.run.as_mut()?;
    run.over = true;
    // The service has seen all rounds, also one that was not begun and one whose events did not come.
    run.told = verdict;
    run.prompt = None;
    run.progress.clear();
    run.pause = Pause::No;
    let said = match (&store_error, refusal) {
        (_, Some(why)) => {
            let first = why.lines().next().unwrap_or_default();
            Some(words(texts.run_refused, &[&in_language(first, lang)]))
        }
        // That the record could not be written has a place of its own, where it stays; so has an unknown power.
        (_, None) => None,
    };
    let recorded = verdict.is_some() || !run.ends.is_empty();
    run.store_error.clone_from(&store_error);
    let missed = run.folder.clone().filter(|_| run.events_lost);
    let nothing_done = run.ends.is_empty() && run.state.header().is_none() && !run.events_lost;
    model.line_lost = false;
    if let Some(next) = model.scan.next.clone() {
        // "It comes next, after this run": the run is over.
        let shown = gnc_text::printable(&next).into_owned();
        let (during, now) = (words(texts.scanned_next, &[&shown]), words(model.what_f5_does(), &[&shown]));
        if let Some((_, message)) = &mut model.message {
            *message = message.replace(&during, &now);
        }
    }
    // "The run goes on" is of the run that was on.
    let aborting = model.aborting.take();
    model.message.take_if(|(_, message)| aborting.as_ref() == Some(message));
    if nothing_done && refusal.is_some() {
        model.run = None;
    }
    if let Some(error) = store_error {
        model.unrecorded = Some(match error.split_once('\n') {
            // A run that was not begun, or whose folder is gone, has a sentence of its own, and its hint behind it.
            Some((whole, hint)) => [whole, hint].map(|text| in_language(text, lang)).join("; "),
            None => words(texts.store_error, &[&in_language(&error, lang)]),
        });
    } else if recorded {
        model.unrecorded = None;
    }
    if let Some(what) = said {
        model.say(MessageWeight::Error, what);
    }
    // The question whether to stop the run needs no answer any more.
    model.over.retain(|over| !matches!(over, Over::Leave | Over::Stop { .. } | Over::GiveUp { .. }));
    if leaving { Some(Effect::Leave) } else { missed.map(Effect::Refold) }
}

/// Takes the record of a run whose events did not all come. The next module may be on the screen by then.
pub(super) fn refolded(model: &mut ScreenModel, folder: &Path, state: RunState) {
    if let Some(run) = model.run.as_mut().filter(|run| run.folder.as_deref() == Some(folder)) {
        if let Some(verdict) = state.verdict() {
            run.ends.push(verdict);
        }
        run.state = state;
        run.events_lost = false;
    }
}

/// A part with its revision, in no language.
fn part_shown(part: &PartName) -> String {
    let known = |text: &str| match text.trim() {
        "" => "-".to_owned(),
        text => gnc_text::printable(text).into_owned(),
    };
    match &part.revision {
        Some(revision) => format!("{} / {}", known(&part.number), known(revision)),
        None => known(&part.number),
    }
}
