//! From a scan, or from the form, to the numbers of orders, sub-units and others.

use gnc_executive::numbers::{self, NumberError, NumberField, NumberKind};
use gnc_executive::part::PartName;
use gnc_text::printable;

use super::words;
use crate::tui::field::InputField;
use crate::tui::model::{MessageWeight, Over, ScreenModel};
use crate::tui::numbers::{Owner, label};
use crate::tui::setup_form::Form;

/// The only number whose pattern a scan fits.
pub(super) fn fitting(model: &ScreenModel, scanned: &str) -> Option<NumberField> {
    let fits = |field: &NumberField| field.pattern.as_ref().is_some_and(|pattern| pattern.fits(scanned));
    let mut fitting = model.asked_numbers().into_iter().filter(fits);
    fitting.next().filter(|_| fitting.next().is_none())
}

/// Takes a scan as a number. While a run is on, or another module waits, it is of that next module.
pub(super) fn take(model: &mut ScreenModel, field: &NumberField, scanned: &str) {
    let mut owner = model.owner_of_numbers();
    if let Some(Over::Setup(form)) = model.over.last_mut() {
        if owner == Owner::Next && !form.later {
            owner = Owner::Present;
        }
        if let Some(number) = form.numbers.iter_mut().find(|number| number.asked.key == field.key) {
            number.show(scanned);
        }
    }
    model.numbers.set(field, scanned, owner);
    let told = words(model.texts.number_taken, &[&name(model, field), &printable(scanned)]);
    model.say(MessageWeight::Info, told);
}

/// Shows the numbers of the module that has come, where the operator has written nothing else into the form.
pub(super) fn show(model: &mut ScreenModel) {
    let later = model.numbers_are_later();
    let Some(Over::Setup(form)) = model.over.last_mut() else { return };
    for number in form.numbers.iter_mut().filter(|number| !number.is_changed()) {
        number.show(model.numbers.of_field(&number.asked, later && form.later));
    }
}

/// Takes a scan as the part that modules must be from now on. The label says nothing of the revision: the one that was
/// asked for stays with its part, and goes with another one.
pub(super) fn take_part(model: &mut ScreenModel, scanned: &str) {
    let [before, revision] = std::mem::take(&mut model.part);
    let stays = is_same_part(&before, scanned);
    let mut gone = (!stays && !revision.is_empty()).then(|| revision.clone());
    model.part = [scanned.to_owned(), if stays { revision } else { String::new() }];
    if let Some(Over::Setup(form)) = model.over.last_mut() {
        let [number, typed] = form.part.take().unwrap_or_default();
        // A revision that was typed first waits for its part.
        let first = number.text().trim().is_empty() && before.trim().is_empty();
        let stays = first || is_same_part(number.text(), scanned);
        if !stays && !typed.text().trim().is_empty() {
            gone = Some(typed.text().trim().to_owned());
        }
        form.part = Some([InputField::new(scanned), if stays { typed } else { InputField::default() }]);
    }
    let part = printable(scanned);
    match gone {
        Some(revision) => {
            let told = words(model.texts.revision_gone, &[&part, &printable(&revision)]);
            model.say(MessageWeight::Warning, told);
        }
        None => {
            let told = words(model.texts.number_taken, &[model.texts.setup_part, &part]);
            model.say(MessageWeight::Info, told);
        }
    }
}

/// Whether two labels name the same part, however they write it.
fn is_same_part(one: &str, other: &str) -> bool {
    PartName::new(one, None).is_asked_for_by(&PartName::new(other, None))
}

/// What to tell of a form with a revision of no part: a run would not look at it.
pub(super) fn revision_alone(model: &ScreenModel, form: &Form) -> Option<String> {
    let [part, revision] = form.part.as_ref()?.each_ref().map(|field| field.text().trim());
    let alone = part.is_empty() && !revision.is_empty();
    alone.then(|| words(model.texts.revision_alone, &[&printable(revision)]))
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
        let value = model.numbers.get(field);
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
        let value = model.numbers.get(field);
        !value.is_empty() && note.starts_with(&format!("{} {} ", printable(&field.label.en), printable(value)))
    })
}

fn name(model: &ScreenModel, field: &NumberField) -> String {
    printable(label(&field.label, model.lang)).into_owned()
}
