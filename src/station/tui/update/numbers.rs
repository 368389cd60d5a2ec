//! From a scan, or from the form, to the numbers of orders, sub-units and others.

use gnc_executive::numbers::{self, NumberError, NumberField, NumberKind};
use gnc_text::printable;

use super::words;
use crate::tui::field::InputField;
use crate::tui::model::{MessageWeight, Over, ScreenModel};
use crate::tui::numbers::label;

/// The only number whose pattern a scan fits.
pub(super) fn fitting(model: &ScreenModel, scanned: &str) -> Option<NumberField> {
    let fits = |field: &NumberField| field.pattern.as_ref().is_some_and(|pattern| pattern.fits(scanned));
    let mut fitting = model.asked_numbers().into_iter().filter(fits);
    fitting.next().filter(|_| fitting.next().is_none())
}

/// Takes a scan as a number. While a run is on, it is of the module after it.
pub(super) fn take(model: &mut ScreenModel, field: &NumberField, scanned: &str) {
    let later = model.is_running();
    model.numbers.set(&field.key, scanned, later);
    if let Some(Over::Setup(form)) = model.over.last_mut()
        && let Some(number) = form.numbers.iter_mut().find(|number| number.key == field.key)
    {
        number.field = InputField::new(scanned);
    }
    let told = words(model.texts.number_taken, &[&name(model, field), &printable(scanned)]);
    model.say(MessageWeight::Info, told);
}

/// Takes a scan as the part that modules must be from now on. Its revision is not known then.
pub(super) fn take_part(model: &mut ScreenModel, scanned: &str) {
    model.part = [scanned.to_owned(), String::new()];
    let part = model.part.each_ref().map(|text| InputField::new(text));
    if let Some(Over::Setup(form)) = model.over.last_mut() {
        form.part = Some(part);
    }
    let told = words(model.texts.number_taken, &[model.texts.setup_part, &printable(scanned)]);
    model.say(MessageWeight::Info, told);
}

/// What is wrong with a number of the form.
pub(super) fn misfit(model: &ScreenModel, key: &str, value: &str) -> Option<String> {
    let (bench, plan) = model.numbers_of_bench_and_plan();
    let field = model.asked_numbers().into_iter().find(|field| field.key == key).filter(|_| !value.is_empty())?;
    Some(match numbers::check_form(bench, plan, &field, value).err()? {
        NumberError::Misfit { pattern, .. } => {
            words(model.texts.number_misfit, &[&name(model, &field), &printable(value), &printable(&pattern)])
        }
        _ => model.texts.scan_control.to_owned(),
    })
}

/// The first number without which no run begins: its place in the form, and what to tell.
pub(super) fn lacking(model: &ScreenModel) -> Option<(usize, String)> {
    let (bench, plan) = model.numbers_of_bench_and_plan();
    let required = |key: &str| bench.iter().chain(plan).any(|field| field.key == key && field.required);
    model.asked_numbers().iter().enumerate().find_map(|(index, field)| {
        let value = model.numbers.get(&field.key);
        let told = misfit(model, &field.key, value);
        let missing = || {
            (value.is_empty() && required(&field.key)).then(|| words(model.texts.number_needed, &[&name(model, field)]))
        };
        Some((index, told.or_else(missing)?))
    })
}

/// Whether a note of the run begins with a sub-unit that was given for it.
pub(super) fn is_about_sub_unit(model: &ScreenModel, note: &str) -> bool {
    let fields = model.asked_numbers();
    let mut units = fields.iter().filter(|field| field.kind == NumberKind::Subunit);
    units.any(|field| {
        let value = model.numbers.get(&field.key);
        !value.is_empty() && note.starts_with(&format!("{} {} ", printable(&field.label.en), printable(value)))
    })
}

fn name(model: &ScreenModel, field: &NumberField) -> String {
    printable(label(&field.label, model.lang)).into_owned()
}
