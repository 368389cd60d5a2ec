//! Ctrl-C: it stops what is on. Its byte is also ETX, by which scanners begin and end a code, so a slow scanner presses it, too.

use std::time::Duration;

use super::keys::{answer, is_asking, leave, stop_anyway, stop_or_ask};
use super::{Effect, start};
use crate::tui::decode::Key;
use crate::tui::keymap::{KeyAction, KeyContext};
use crate::tui::model::{MessageWeight, ScreenModel};

/// So soon behind a character the byte is the end of a code: slow scanners type a character every 20 to 250 ms, and some send a line end
/// between.
const END_OF_CODE: Duration = Duration::from_millis(500);
/// So soon after a run or a look at raw values the key was still meant for it: "once in order, twice at once".
const MEANT_FOR_RUN: Duration = Duration::from_secs(5);
/// Stops of a run that the session can carry out: in order, and at once.
const STOPS: u32 = 2;

/// When that happened which tells what ctrl-C means; since the start of the program.
#[derive(Debug, Default)]
pub(crate) struct Interrupts {
    /// The last character or scan came, and no byte was passed over since then.
    pub character_at: Option<Duration>,
    /// The last run, or the last look at raw values, ended.
    pub ended_at: Option<Duration>,
}

/// Takes note of a key, before it does anything.
pub(super) fn note(model: &mut ScreenModel, key: Key) {
    if matches!(key, Key::Char(_) | Key::Pasted(_) | Key::Enter | Key::Tab | Key::Control) {
        came(model);
    }
    if key != Key::Ctrl('c') {
        model.ask_no_more_to_leave();
    }
}

/// Takes note of a character or a scan.
pub(super) fn came(model: &mut ScreenModel) {
    model.ask_no_more_to_leave();
    model.interrupts.character_at = Some(model.now.since_start);
}

/// Takes note of the end of a run, or of a look at raw values.
pub(super) fn ended(model: &mut ScreenModel) {
    model.interrupts.ended_at = Some(model.now.since_start);
}

/// What is on is stopped, a question of a start is answered with no, and where nothing is on the program ends if the key is pressed
/// twice. A run that is still there after it was stopped at once waits for a disk or a lock: from then on ctrl-C is the signal that it
/// is elsewhere.
pub(super) fn interrupt(model: &mut ScreenModel, place: KeyContext) -> Option<Effect> {
    let is_on = model.is_running() || model.watching;
    let since = |at: Option<Duration>| at.map(|at| model.now.since_start.saturating_sub(at));
    if since(model.interrupts.character_at).is_some_and(|since| since < END_OF_CODE) {
        if is_on {
            // A scanner sends one; the second one is a hand that wants the stop.
            model.interrupts.character_at = None;
        }
        return None;
    }
    let was_meant_for_run = since(model.interrupts.ended_at).is_some_and(|since| since < MEANT_FOR_RUN);
    match place {
        KeyContext::Stopping => stop_anyway(model),
        _ if model.run.as_ref().is_some_and(|run| !run.over && run.stops >= STOPS) => Some(Effect::Raise),
        _ if is_on => stop_or_ask(model),
        _ if has_text(model, place) => None,
        _ if is_asking(place) => start::answer(model, KeyAction::No).unwrap_or_else(|| answer(model, false)),
        _ if was_meant_for_run => {
            model.say_aside(MessageWeight::Info, model.texts.interrupt_after_run);
            None
        }
        _ if model.is_asked_to_leave() => leave(model),
        _ => {
            model.say(MessageWeight::Info, model.texts.interrupt_again);
            None
        }
    }
}

/// Whether text waits in the field that takes what is typed: a code whose rest is late, or whose end is this byte.
fn has_text(model: &ScreenModel, place: KeyContext) -> bool {
    match place {
        KeyContext::Records => !model.records.search.is_empty(),
        _ => !model.scan.typed.is_empty(),
    }
}
