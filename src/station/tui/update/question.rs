//! A question of the plan: what is typed or scanned is its answer, and a function key files it.

use gnc_bench::fixture::Reply;
use gnc_executive::plan::{AnswerError, QuestionKind};

use super::{Effect, scan, words};
use crate::tui::decode::Key;
use crate::tui::field::InputField;
use crate::tui::framing::{self, ScanProblem};
use crate::tui::input::Scanned;
use crate::tui::keymap::KeyAction;
use crate::tui::model::{MessageWeight, Prompt, ScreenModel};

fn prompt(model: &mut ScreenModel) -> Option<&mut Prompt> {
    model.run.as_mut()?.prompt.as_mut()
}

/// Takes a key of a hand. A line end files nothing, since a scanner sends it too.
pub(super) fn typed(model: &mut ScreenModel, key: Key) {
    let texts = model.texts;
    let Some(prompt) = prompt(model) else { return };
    match key {
        Key::Char(character) | Key::Pasted(character) => prompt.typed.push(character),
        Key::Backspace => prompt.typed.pop(),
        Key::Control => prompt.typed.spoil(),
        Key::Up => choose(prompt, -1),
        Key::Down => choose(prompt, 1),
        _ => model.say(MessageWeight::Info, texts.answer_key),
    }
}

/// Puts the next choice into the answer.
fn choose(prompt: &mut Prompt, step: isize) {
    let Some(QuestionKind::Choice { of }) = prompt.question().map(|asked| &asked.question.kind) else { return };
    let here = of.iter().position(|choice| choice == prompt.typed.text());
    let at = match here {
        Some(here) => here.saturating_add_signed(step).min(of.len().saturating_sub(1)),
        None => 0,
    };
    prompt.typed = InputField::new(of.get(at).map_or("", String::as_str));
}

/// Takes a scan as the answer, in place of what was typed.
pub(super) fn scan(model: &mut ScreenModel, scanned: &Scanned) {
    let (texts, has_ends) = (model.texts, model.scan.has_ends);
    model.scan.has_ends |= scanned.ended;
    let Some(prompt) = prompt(model) else { return };
    let kept = prompt.typed.text().chars().count().saturating_sub(scanned.taken_back);
    let before: String = prompt.typed.text().chars().skip(kept).collect();
    let fits = |text: &str| prompt.question().is_some_and(|asked| asked.question.read(text).is_ok());
    let read = match framing::number(&before, scanned) {
        Ok(text) if framing::is_other_layout(&text) && !fits(&text) => Err(ScanProblem::Layout(text)),
        read => read,
    };
    let dropped: String = prompt.typed.text().chars().take(kept).collect();
    let (taken, told) = match read {
        Ok(text) => {
            prompt.typed = InputField::new(&text);
            // Nobody knows whether it is whole.
            let cut = has_ends && !scanned.ended;
            let told = cut.then(|| words(texts.answer_cut, &[&gnc_text::printable(&text)]));
            (Some(text), told.map(|told| (MessageWeight::Warning, told)))
        }
        Err(problem) => {
            prompt.typed = InputField::default();
            (None, Some((MessageWeight::Error, scan::words_of(model, &problem))))
        }
    };
    let is_dropped = !dropped.trim().is_empty() && taken.as_deref() != Some(dropped.trim());
    let (weight, told) = match told {
        None if !is_dropped => return,
        told => told.unwrap_or((MessageWeight::Warning, texts.answer_key.to_owned())),
    };
    let told = if is_dropped { scan::not_used(model, dropped.trim(), &told) } else { told };
    model.say(weight, told);
}

/// Files the answer, gives the question up, or goes back to the one before.
pub(super) fn answer(model: &mut ScreenModel, action: KeyAction) -> Option<Effect> {
    let texts = model.texts;
    let prompt = prompt(model)?;
    let reply = match action {
        KeyAction::Redo if prompt.ask.goes_back() => Reply::Back,
        KeyAction::Redo => {
            model.say(MessageWeight::Warning, texts.first_question);
            return None;
        }
        KeyAction::No => Reply::NotPossible,
        _ if !prompt.takes_words() => Reply::Done,
        _ => {
            let typed = prompt.typed.text().to_owned();
            let problem = match prompt.question().map(|asked| asked.question.read(&typed)) {
                _ if prompt.typed.has_control() => {
                    prompt.typed.clear();
                    Some(AnswerError::Control)
                }
                Some(Err(error)) => Some(error),
                _ => None,
            };
            if let Some(problem) = problem {
                let told = model.said(&format!("{problem}; {}", problem.try_this())).into_owned();
                model.say(MessageWeight::Error, told);
                return None;
            }
            Reply::Text(typed)
        }
    };
    model.message = None;
    model.run.as_mut()?.prompt = None;
    Some(Effect::Answer(reply))
}
