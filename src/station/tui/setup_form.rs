//! The form in which plan, bench, operator, rounds and language are chosen.

use gnc_executive::numbers::NumberField;

use super::decode::Key;
use super::field::InputField;
use super::lang::Lang;
use super::model::{AfterFailure, BenchView, Loaded, PlanView, RoundsSetting, ScreenModel};
use super::numbers::label;

/// Largest number of rounds or minutes that can be asked for: a month of minutes.
pub(crate) const MAX_ROUNDS: u32 = 43_200;

/// Files to choose from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Choices {
    pub plans: Vec<String>,
    pub benches: Vec<String>,
}

/// A line of the form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FormLine {
    Plan,
    Bench,
    Operator,
    /// The part that modules must be.
    Part,
    /// Its revision.
    Revision,
    /// One of the numbers that bench and plan ask for.
    Number(usize),
    Rounds,
    AfterFailure,
    Language,
}

/// A number that bench and plan ask for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FormNumber {
    pub asked: NumberField,
    pub label: String,
    pub field: InputField,
    /// What was there before the operator wrote.
    pub shown: String,
}

impl FormNumber {
    /// Whether the operator has written something else.
    pub(crate) fn is_changed(&self) -> bool {
        self.field.text().trim() != self.shown
    }

    /// Shows a number that was given.
    pub(crate) fn show(&mut self, value: &str) {
        self.field = InputField::new(value);
        self.field.text().trim().clone_into(&mut self.shown);
    }
}

/// What limits the rounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RoundsKind {
    Once,
    Count,
    Minutes,
}

/// What a look at the files of the form found. Nothing of it is held: F5 on the page runs what was there before.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FormLook {
    pub plan_path: String,
    pub bench_path: String,
    pub bench: Loaded<BenchView>,
    pub plan: Loaded<PlanView>,
}

impl FormLook {
    /// Whether it was at these files.
    pub(crate) fn is_at(&self, plan_path: &str, bench_path: &str) -> bool {
        self.plan_path == plan_path && self.bench_path == bench_path
    }
}

/// The form as it is being filled in.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Form {
    pub line: usize,
    pub plan: InputField,
    pub bench: InputField,
    pub operator: InputField,
    /// The part and its revision, if limits depend on them.
    pub part: Option<[InputField; 2]>,
    pub numbers: Vec<FormNumber>,
    /// The numbers are of the module after the one on the screen, if one comes.
    pub later: bool,
    pub rounds: RoundsKind,
    pub number: InputField,
    pub after_failure: AfterFailure,
    pub lang: Lang,
    /// The last look at its files.
    pub look: Option<Box<FormLook>>,
}

impl Form {
    /// The form as F2 shows it.
    pub(crate) fn new(model: &ScreenModel) -> Self {
        Self::of(model, model.numbers_are_later())
    }

    fn of(model: &ScreenModel, later: bool) -> Self {
        let (rounds, number) = match model.rounds {
            RoundsSetting::Once => (RoundsKind::Once, 10),
            RoundsSetting::Count(count) => (RoundsKind::Count, count),
            RoundsSetting::Minutes(minutes) => (RoundsKind::Minutes, minutes),
            RoundsSetting::For(time) => {
                (RoundsKind::Minutes, u32::try_from(time.as_secs().div_ceil(60)).unwrap_or(MAX_ROUNDS))
            }
        };
        Self {
            line: 0,
            plan: InputField::new(&model.plan_path),
            bench: InputField::new(&model.bench_path),
            operator: InputField::new(&model.operator),
            part: part_matters(model).then(|| model.part.each_ref().map(|text| InputField::new(text))),
            numbers: model.asked_numbers().into_iter().map(|field| of_model(model, field, later)).collect(),
            later,
            rounds,
            number: InputField::new(&number.to_string()),
            after_failure: model.after_failure,
            lang: model.lang,
            look: None,
        }
    }

    /// The form with the cursor at a line, without which the module on the screen is not tested.
    pub(crate) fn at(model: &ScreenModel, line: FormLine) -> Self {
        let form = Self::of(model, false);
        let line = form.lines().iter().position(|each| *each == line).unwrap_or(0);
        Self { line, ..form }
    }

    pub(crate) fn here(&self) -> FormLine {
        self.lines().get(self.line).copied().unwrap_or(FormLine::Language)
    }

    /// All lines from top to bottom.
    pub(crate) fn lines(&self) -> Vec<FormLine> {
        let before = [FormLine::Plan, FormLine::Bench, FormLine::Operator];
        let part = self.part.iter().flat_map(|_| [FormLine::Part, FormLine::Revision]);
        let numbers = (0..self.numbers.len()).map(FormLine::Number);
        let after = [FormLine::Rounds, FormLine::AfterFailure, FormLine::Language];
        before.into_iter().chain(part).chain(numbers).chain(after).collect()
    }

    /// The rounds that were asked for; `None` if the number is not valid.
    pub(crate) fn asked_rounds(&self) -> Option<RoundsSetting> {
        let number = || self.number.text().parse().ok().filter(|number| (1..=MAX_ROUNDS).contains(number));
        match self.rounds {
            RoundsKind::Once => Some(RoundsSetting::Once),
            RoundsKind::Count => number().map(RoundsSetting::Count),
            RoundsKind::Minutes => number().map(RoundsSetting::Minutes),
        }
    }

    /// The text of the line under the cursor, if it has one.
    pub(crate) fn field_here(&mut self) -> Option<&mut InputField> {
        match self.here() {
            FormLine::Plan => Some(&mut self.plan),
            FormLine::Bench => Some(&mut self.bench),
            FormLine::Operator => Some(&mut self.operator),
            FormLine::Part => self.part.as_mut().map(|[part, _]| part),
            FormLine::Revision => self.part.as_mut().map(|[_, revision]| revision),
            FormLine::Number(index) => self.numbers.get_mut(index).map(|number| &mut number.field),
            FormLine::Rounds if self.rounds != RoundsKind::Once => Some(&mut self.number),
            FormLine::Rounds | FormLine::AfterFailure | FormLine::Language => None,
        }
    }

    /// Adds typed text to the line under the cursor.
    pub(crate) fn typed(&mut self, key: Key) {
        let number = self.here() == FormLine::Rounds;
        let Some(field) = self.field_here() else { return };
        // A number has only digits and stays short.
        let fits =
            |character: char, field: &InputField| !number || (character.is_ascii_digit() && field.characters() < 5);
        match key {
            Key::Char(character) | Key::Pasted(character) if fits(character, field) => field.push(character),
            Key::Backspace => field.pop(),
            _ => {}
        }
    }

    /// Chooses the value before (-1) or after (+1).
    pub(crate) fn turn(&mut self, choices: &Choices, step: isize) {
        match self.here() {
            FormLine::Plan => next_text(&mut self.plan, &choices.plans, step),
            FormLine::Bench => next_text(&mut self.bench, &choices.benches, step),
            FormLine::Operator | FormLine::Part | FormLine::Revision | FormLine::Number(_) => {}
            FormLine::Rounds => {
                const ALL: [RoundsKind; 3] = [RoundsKind::Once, RoundsKind::Count, RoundsKind::Minutes];
                self.rounds = next(&ALL, self.rounds, step);
            }
            FormLine::AfterFailure => {
                const ALL: [AfterFailure; 3] = [AfterFailure::AsPlanned, AfterFailure::Stop, AfterFailure::GoOn];
                self.after_failure = next(&ALL, self.after_failure, step);
            }
            FormLine::Language => self.lang = next(&Lang::ALL, self.lang, step),
        }
    }
}

/// Whether the form asks for the part: limits depend on it, or one was named.
fn part_matters(model: &ScreenModel) -> bool {
    !model.parts().is_empty() || !model.part[0].is_empty()
}

fn of_model(model: &ScreenModel, asked: NumberField, later: bool) -> FormNumber {
    let label = label(&asked.label, model.lang).to_owned();
    let mut number = FormNumber { label, field: InputField::default(), shown: String::new(), asked };
    number.show(model.numbers.of_field(&number.asked, later));
    number
}

fn next<T: Copy + PartialEq>(all: &[T], now: T, step: isize) -> T {
    let at = all.iter().position(|one| *one == now).unwrap_or(0);
    all[(at as isize + step).rem_euclid(all.len() as isize) as usize]
}

fn next_text(field: &mut InputField, all: &[String], step: isize) {
    if all.is_empty() {
        return;
    }
    let at = all.iter().position(|one| one == field.text());
    let to = at.map_or(0, |at| (at as isize + step).rem_euclid(all.len() as isize) as usize);
    *field = InputField::new(&all[to]);
}
