//! Messages of a run to the screen.

use std::path::Path;

use gnc_bench::fixture::Ask;
use gnc_executive::event::{Event, EventKind, OtherModule};
use gnc_executive::state::RunState;

use super::{Effect, words};
use crate::tui::model::{Earlier, Loaded, MessageWeight, Over, Pause, Prompt, ScreenModel};

/// Folds an event as every other observer does.
pub(super) fn event(model: &mut ScreenModel, event: &Event) -> Option<Effect> {
    let now = model.now;
    let expected_s = model.plan.ready().and_then(|plan| plan.expected_s);
    let run = model.run.as_mut()?;
    if matches!(event.kind, EventKind::RunStarted { .. }) {
        run.state = RunState::new();
        run.began = now.since_start;
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
        model.message = Some((MessageWeight::Warning, model.texts.events_lost.to_owned()));
        return None;
    }
    if let EventKind::OtherModule(OtherModule { scanned, found }) = &event.kind {
        let [scanned, found] = [scanned, found].map(|text| gnc_text::printable(text).into_owned());
        let text = words(model.texts.other_module, &[&found, &scanned]);
        model.message = Some((MessageWeight::Error, text));
    }
    if let EventKind::RunEnded { outcome } = event.kind {
        run.ends.push(outcome);
        run.prompt = None;
        model.cursor = 0;
        if let (Loaded::Ready(plan), true) =
            (&mut model.plan, run.state.header().is_some_and(|h| h.selection.is_none()))
            && outcome.is_good()
        {
            plan.expected_s = Some(event.elapsed_us as f64 / 1e6);
        }
    }
    None
}

pub(super) fn asked(model: &mut ScreenModel, item: String, ask: Ask) {
    let since = model.now.since_start;
    if let Some(run) = &mut model.run {
        run.prompt = Some(Prompt { item, ask, since });
    }
}

/// Takes what is known of earlier runs of the module.
pub(super) fn earlier(model: &mut ScreenModel, serial_number: &str, run: Option<Earlier>) {
    if model.scan.current.as_deref() == Some(serial_number) {
        model.scan.earlier = Some(run);
    }
}

/// Ends the run on the screen: nothing follows.
pub(super) fn over(model: &mut ScreenModel, store_error: Option<String>, refusal: Option<String>) -> Option<Effect> {
    let leaving = model.leaving;
    let run = model.run.as_mut()?;
    run.over = true;
    run.prompt = None;
    run.progress.clear();
    run.pause = Pause::No;
    if let Some(error) = &store_error {
        model.message = Some((MessageWeight::Error, words(model.texts.store_error, &[error])));
    }
    run.store_error = store_error;
    let missed = run.folder.clone().filter(|_| run.events_lost);
    let nothing_done = run.ends.is_empty() && run.state.header().is_none() && !run.events_lost;
    if let Some(why) = refusal {
        let first = why.lines().next().unwrap_or_default();
        model.message = Some((MessageWeight::Error, words(model.texts.run_refused, &[first])));
        if nothing_done {
            model.run = None;
        }
    }
    // The question whether to stop the run needs no answer any more.
    model.over.retain(|over| *over != Over::Leave);
    if leaving { Some(Effect::Leave) } else { missed.map(Effect::Refold) }
}

/// Takes the record of a run whose events did not all come. The next module may be on the screen by then.
pub(super) fn refolded(model: &mut ScreenModel, folder: &Path, state: RunState) {
    if let Some(run) = model.run.as_mut().filter(|run| run.folder.as_deref() == Some(folder)) {
        if let Some(outcome) = state.outcome() {
            run.ends.push(outcome);
        }
        run.state = state;
        run.events_lost = false;
    }
}
