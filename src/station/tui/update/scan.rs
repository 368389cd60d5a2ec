//! From a scan, or from typed text, to the serial number.

use gnc_executive::numbers::NumberField;
use gnc_executive::part::PartName;
use gnc_executive::serial_number::SerialNumberPattern;

use super::{Effect, interrupt, numbers, words};
use crate::serial_number::{self, SerialNumberError};
use crate::tui::field::InputField;
use crate::tui::fields;
use crate::tui::framing::{self, ScanProblem};
use crate::tui::input::Scanned;
use crate::tui::keymap::KeyContext;
use crate::tui::live::History;
use crate::tui::model::{MessageWeight, Over, ScreenModel, ScreenPage};

/// Takes a scan, wherever the operator is. It is never a key and never falls into another field.
pub(super) fn scan(model: &mut ScreenModel, scanned: &Scanned) -> Option<Effect> {
    interrupt::came(model);
    if model.takes_words() {
        super::question::scan(model, scanned);
        return None;
    }
    let texts = model.texts;
    let before = take_back(model, scanned.taken_back);
    let number = match framing::number(&before, scanned) {
        // A code of several fields, one of which is what the pattern asks for.
        read if let Some(number) = own_field(model, &before, scanned, read.as_deref().ok()) => Ok(number),
        // A pattern that names other letters knows better.
        Ok(number)
            if framing::is_other_layout(&number)
                && !is_resumed(model, &number)
                && SerialNumberPattern::not_allowed(&number, patterns(model)).is_some()
                && numbers::fitting(model, &number).is_none() =>
        {
            Err(ScanProblem::Layout(number))
        }
        read => read,
    };
    let number = match number {
        Ok(number) => number,
        Err(problem) => {
            // A scan that waits for Enter still waits. What a hand typed was the beginning of this one.
            if !model.scan.waits() {
                model.scan.typed.clear();
            }
            model.say(MessageWeight::Error, words_of(model, &problem));
            return None;
        }
    };
    let Ok(filed) = file_waiting(model, &number, scanned.ended) else { return None };
    let waited = model.scan.waits();
    let typed = std::mem::take(&mut model.scan.typed);
    if scanned.ended {
        model.scan.has_ends = true;
        model.scan.unended.clear();
        return take_scanned(model, &number, &typed).or(filed);
    }
    // Text that a hand began and a slow line held back comes at once, too.
    let begun = if waited { "" } else { typed.text() };
    model.scan.typed = InputField::new(&format!("{begun}{number}"));
    model.scan.typed.text().clone_into(&mut model.scan.unended);
    let shown = gnc_text::printable(&number).into_owned();
    if model.scan.has_ends {
        let replaced = waited && typed.text() != number;
        let told = words(texts.scan_cut, &[&shown]);
        let told = if replaced { not_used(model, typed.text(), &told) } else { told };
        model.say(MessageWeight::Warning, told);
    } else if model.place() != KeyContext::Idle {
        model.say(MessageWeight::Info, words(texts.scan_waits, &[&shown]));
    }
    filed
}

/// Files the scan that waits without a line end: it is over when the next one begins. A scanner whose scans have line ends
/// has cut it off, so the next one replaces it; so does a whole serial number, with a word. `Err`: it is no number of
/// anything, so the next one, which may belong to it, is not taken either, and the operator is told.
fn file_waiting(model: &mut ScreenModel, number: &str, ended: bool) -> Result<Option<Effect>, ()> {
    let is_serial_number = other_number(model, number).is_none() && !is_part(model, number);
    if !model.scan.waits() || model.scan.has_ends || (ended && is_serial_number) {
        return Ok(None);
    }
    let filed = finish_typed(model);
    if filed.is_err() {
        tell_dropped(model, number);
    }
    filed
}

/// The serial number within a code of several fields, if bench or plan have a pattern that it fits and the whole code does not.
fn own_field(model: &ScreenModel, before: &str, scanned: &Scanned, whole: Option<&str>) -> Option<String> {
    let is_wanted = |whole: &str| is_asked_for(model, whole) || other_number(model, whole).is_some();
    if whole.is_some_and(is_wanted) || scanned.dropped > 0 {
        return None;
    }
    let code = framing::unframed(before, scanned);
    fields::serial_number(&code).filter(|number| is_asked_for(model, number)).map(str::to_owned)
}

/// Adds to the message that a scan, or what was typed, is not used.
fn tell_dropped(model: &mut ScreenModel, dropped: &str) {
    let told = model.message.take();
    let is_error = matches!(told, Some((MessageWeight::Error, _)));
    let told = not_used(model, dropped, &told.map(|(_, told)| told).unwrap_or_default());
    model.say(if is_error { MessageWeight::Error } else { MessageWeight::Warning }, told);
}

/// The words about a scan that is dropped, and what is told beside.
pub(super) fn not_used(model: &ScreenModel, dropped: &str, beside: &str) -> String {
    words(model.texts.not_used, &[&gnc_text::printable(dropped), beside])
}

/// Takes a whole scan as the serial number.
fn take_scanned(model: &mut ScreenModel, number: &str, typed: &InputField) -> Option<Effect> {
    let texts = model.texts;
    let number = match serial_number::check(number) {
        Ok(number) => number,
        Err(error) => {
            model.say(MessageWeight::Error, in_words(model, &error));
            return None;
        }
    };
    let other = other_number(model, &number);
    if other.is_some() || is_part(model, &number) {
        match other {
            Some(field) => numbers::take(model, &field, &number),
            None => numbers::take_part(model, &number),
        }
        if !typed.is_empty() && typed.text() != number {
            tell_dropped(model, typed.text());
        }
        return None;
    }
    if let Some(problem) = misfit(model, &number) {
        model.say(MessageWeight::Error, problem);
        if !typed.is_empty() {
            tell_dropped(model, typed.text());
        }
        return None;
    }
    let shown = gnc_text::printable(&number).into_owned();
    let (effect, dropped) = take_module(model, number);
    if matches!(model.over.last(), Some(Over::Setup(_))) {
        tell_taken(model, words(texts.scan_beside_form, &[&shown]), &dropped);
    } else if !typed.is_empty() {
        let typed = gnc_text::printable(typed.text()).into_owned();
        tell_taken(model, words(texts.scan_instead, &[&shown, &typed]), &dropped);
        model.weigh(MessageWeight::Warning);
    } else {
        let told = taken_words(model, &shown);
        tell_taken(model, told, &dropped);
    }
    effect
}

/// Takes characters back that were given as keys before they turned out to be the beginning of a scan. The field that has
/// taken some of them loses them; a field of digits, or a question, has taken none.
fn take_back(model: &mut ScreenModel, count: usize) -> String {
    let kept = model.scan.recent.chars().count().saturating_sub(count);
    let taken: String = std::mem::take(&mut model.scan.recent).chars().skip(kept).collect();
    let searching = model.place() == KeyContext::Records;
    let asking = super::keys::is_asking(model.place());
    let field = match model.over.last_mut() {
        Some(Over::Setup(form)) => form.field_here(),
        _ if asking => None,
        _ if searching => Some(&mut model.records.search),
        _ => Some(&mut model.scan.typed),
    };
    if let Some(field) = field {
        for character in taken.chars().rev() {
            if field.text().ends_with(character) {
                field.pop();
            }
        }
    }
    taken
}

/// Takes what was typed as a serial number; `Err`: it is none, and the operator is told.
pub(super) fn finish_typed(model: &mut ScreenModel) -> Result<Option<Effect>, ()> {
    let texts = model.texts;
    let field = std::mem::take(&mut model.scan.typed);
    model.scan.unended.clear();
    let problem = match serial_number::check(field.text()) {
        _ if field.has_control() => texts.scan_control.to_owned(),
        _ if field.characters() > serial_number::MAX_CHARACTERS => too_long(model, field.characters()),
        Err(error) => in_words(model, &error),
        Ok(number) if let Some(field) = other_number(model, &number) => {
            numbers::take(model, &field, &number);
            return Ok(None);
        }
        Ok(number) if is_part(model, &number) => {
            numbers::take_part(model, &number);
            return Ok(None);
        }
        Ok(number) => match misfit(model, &number) {
            None => return Ok(take_number(model, number)),
            Some(problem) => problem,
        },
    };
    model.say(MessageWeight::Error, problem);
    Err(())
}

/// Takes a number: at once, or after the run that is on.
pub(super) fn take_number(model: &mut ScreenModel, number: String) -> Option<Effect> {
    let shown = gnc_text::printable(&number).into_owned();
    let (effect, dropped) = take_module(model, number);
    let told = taken_words(model, &shown);
    tell_taken(model, told, &dropped);
    effect
}

/// That a module comes now, and what F5 does with it, or that it comes next.
fn taken_words(model: &ScreenModel, shown: &str) -> String {
    words(if model.is_running() { model.texts.scanned_next } else { model.what_f5_does() }, &[shown])
}

/// Tells what was taken, and before it all that no run will have.
fn tell_taken(model: &mut ScreenModel, told: String, dropped: &[String]) {
    match dropped {
        [] => model.say(MessageWeight::Info, told),
        _ => {
            let told = not_used(model, &dropped.join(", "), &told);
            model.say(MessageWeight::Warning, told);
        }
    }
}

/// Takes a number, and returns all that was taken before and no run will have.
fn take_module(model: &mut ScreenModel, number: String) -> (Option<Effect>, Vec<String>) {
    let mut dropped: Vec<String> = model.scan.next.take_if(|next| *next != number).into_iter().collect();
    if !dropped.is_empty() {
        dropped.extend(model.numbers.another_next());
    }
    model.message = None;
    if model.is_running() {
        model.scan.next = Some(number);
        return (None, dropped);
    }
    let (is_another, fields) = (model.scan.current.as_ref() != Some(&number), model.asked_numbers());
    dropped.extend(model.numbers.module_comes(is_another, &fields));
    model.scan.current = Some(number);
    model.scan.next = None;
    numbers::show(model);
    model.scan.standing = None;
    model.pending = None;
    // The verdict on the screen belongs to another module. Whether the module before is off is still worth knowing.
    model.keep_power();
    model.run = None;
    model.cursor = 0;
    model.page = ScreenPage::Tests;
    model.over.retain(|over| matches!(over, Over::Setup(_)));
    // Raw values are those of the module before. When it is switched off, the records are searched.
    if model.watching {
        return (Some(Effect::Stop), dropped);
    }
    model.live = History::default();
    (look_up(model), dropped)
}

/// The patterns of bench and plan, as far as they are known.
fn patterns(model: &ScreenModel) -> impl Iterator<Item = &SerialNumberPattern> {
    let bench = model.bench.ready().and_then(|bench| bench.serial_number.as_ref());
    bench.into_iter().chain(model.plan.ready().and_then(|plan| plan.serial_number.as_ref()))
}

fn is_asked_for(model: &ScreenModel, number: &str) -> bool {
    patterns(model).next().is_some() && patterns(model).all(|pattern| pattern.fits(number))
}

/// Whether a scan is the number of a part that has limits of its own, and no serial number.
fn is_part(model: &ScreenModel, number: &str) -> bool {
    let scanned = PartName::new(number, None);
    let asked = |part: &PartName| scanned.is_asked_for_by(&PartName::new(&part.number, None));
    model.parts().iter().any(asked) && !is_asked_for(model, number)
}

/// The number of an order, a sub-unit or another one that a scan is, and no serial number.
fn other_number(model: &ScreenModel, number: &str) -> Option<NumberField> {
    numbers::fitting(model, number).filter(|_| !is_asked_for(model, number))
}

/// Why a number is none of this bench or this plan.
pub(super) fn misfit(model: &ScreenModel, number: &str) -> Option<String> {
    if let Err(error) = serial_number::check_signs(number, patterns(model))
        && !is_resumed(model, number)
    {
        return Some(in_words(model, &error));
    }
    let pattern = patterns(model).find(|pattern| !pattern.fits(number))?.to_string();
    let [number, pattern] = [number, &pattern].map(|text| gnc_text::printable(text).into_owned());
    Some(words(model.texts.scan_misfit, &[&number, &pattern]))
}

/// Whether the command line takes up a run of this module. An earlier version may have taken signs that are refused today.
fn is_resumed(model: &ScreenModel, number: &str) -> bool {
    model.resume.is_some() && model.resume_of == number
}

/// Has the records searched for earlier runs of the module, once.
pub(super) fn look_up(model: &ScreenModel) -> Option<Effect> {
    let number = model.scan.current.clone().filter(|_| !model.is_running() && model.scan.standing.is_none());
    number.map(Effect::LookUp)
}

fn too_long(model: &ScreenModel, characters: usize) -> String {
    words(model.texts.scan_too_long, &[&characters.to_string(), &serial_number::MAX_CHARACTERS.to_string()])
}

fn invisible(model: &ScreenModel, character: char) -> String {
    words(model.texts.scan_invisible, &[&format!("U+{:04X}", character as u32)])
}

fn in_words(model: &ScreenModel, error: &SerialNumberError) -> String {
    match error {
        SerialNumberError::Empty => model.texts.scan_empty.to_owned(),
        SerialNumberError::TooLong { characters } => too_long(model, *characters),
        SerialNumberError::Control { .. } => model.texts.scan_control.to_owned(),
        SerialNumberError::Invisible { character, .. } => invisible(model, *character),
        SerialNumberError::Fields { fields } => words_of(model, &ScanProblem::Fields(fields.clone())),
        SerialNumberError::Layout { text } => words_of(model, &ScanProblem::Layout(text.clone())),
        SerialNumberError::Sign { text, sign } => {
            let shown = [text.clone(), sign.to_string()].map(|text| gnc_text::printable(&text).into_owned());
            words(model.texts.scan_sign, &[&shown[0], &shown[1], &format!("U+{:04X}", *sign as u32)])
        }
    }
}

pub(super) fn words_of(model: &ScreenModel, problem: &ScanProblem) -> String {
    let texts = model.texts;
    let shown = |text: &str| gnc_text::printable(text).into_owned();
    match problem {
        ScanProblem::Empty => texts.scan_empty.to_owned(),
        ScanProblem::TooLong { characters } => too_long(model, *characters),
        ScanProblem::Control => texts.scan_control.to_owned(),
        ScanProblem::Fields(fields) => words(texts.scan_fields, &[&shown(fields)]),
        ScanProblem::Layout(number) => words(texts.scan_layout, &[&shown(number)]),
        ScanProblem::Invisible(character) => invisible(model, *character),
    }
}
