//! The form in which plan, bench, operator, rounds and language are chosen.

use super::decode::Key;
use super::field::Field;
use super::lang::Lang;
use super::model::{AfterFailure, Model, Rounds};

/// Most rounds or minutes that can be asked for: a month of minutes.
pub(crate) const MAX_ROUNDS: u32 = 43_200;

/// Files to choose from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Choices {
    pub plans: Vec<String>,
    pub benches: Vec<String>,
}

/// A line of the form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Line {
    Plan,
    Bench,
    Operator,
    Rounds,
    AfterFailure,
    Language,
}

impl Line {
    pub(crate) const ALL: [Line; 6] =
        [Line::Plan, Line::Bench, Line::Operator, Line::Rounds, Line::AfterFailure, Line::Language];
}

/// What counts rounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RoundsKind {
    Once,
    Count,
    Minutes,
}

/// The form as it is being filled in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Form {
    pub line: usize,
    pub plan: Field,
    pub bench: Field,
    pub operator: Field,
    pub rounds: RoundsKind,
    pub number: Field,
    pub after_failure: AfterFailure,
    pub lang: Lang,
}

impl Form {
    pub(crate) fn new(model: &Model) -> Self {
        let (rounds, number) = match model.rounds {
            Rounds::Once => (RoundsKind::Once, 10),
            Rounds::Count(count) => (RoundsKind::Count, count),
            Rounds::Minutes(minutes) => (RoundsKind::Minutes, minutes),
        };
        Self {
            line: 0,
            plan: Field::new(&model.plan_path),
            bench: Field::new(&model.bench_path),
            operator: Field::new(&model.operator),
            rounds,
            number: Field::new(&number.to_string()),
            after_failure: model.after_failure,
            lang: model.lang,
        }
    }

    pub(crate) fn here(&self) -> Line {
        Line::ALL[self.line.min(Line::ALL.len() - 1)]
    }

    /// The rounds asked for; `None` if the number is none.
    pub(crate) fn asked_rounds(&self) -> Option<Rounds> {
        let number = || self.number.text().parse().ok().filter(|number| (1..=MAX_ROUNDS).contains(number));
        match self.rounds {
            RoundsKind::Once => Some(Rounds::Once),
            RoundsKind::Count => number().map(Rounds::Count),
            RoundsKind::Minutes => number().map(Rounds::Minutes),
        }
    }

    /// What is typed goes to the line under the cursor.
    pub(crate) fn typed(&mut self, key: Key) {
        let number = self.here() == Line::Rounds;
        let field = match self.here() {
            Line::Plan => &mut self.plan,
            Line::Bench => &mut self.bench,
            Line::Operator => &mut self.operator,
            Line::Rounds if self.rounds != RoundsKind::Once => &mut self.number,
            Line::Rounds | Line::AfterFailure | Line::Language => return,
        };
        // A number has no letters and stays short.
        let fits = |character: char, field: &Field| !number || (character.is_ascii_digit() && field.characters() < 5);
        match key {
            Key::Char(character) | Key::Pasted(character) if fits(character, field) => field.push(character),
            Key::Backspace => field.pop(),
            _ => {}
        }
    }

    /// The value before (-1) or after (+1).
    pub(crate) fn turn(&mut self, choices: &Choices, step: isize) {
        match self.here() {
            Line::Plan => next_text(&mut self.plan, &choices.plans, step),
            Line::Bench => next_text(&mut self.bench, &choices.benches, step),
            Line::Operator => {}
            Line::Rounds => {
                const ALL: [RoundsKind; 3] = [RoundsKind::Once, RoundsKind::Count, RoundsKind::Minutes];
                self.rounds = next(&ALL, self.rounds, step);
            }
            Line::AfterFailure => {
                const ALL: [AfterFailure; 3] = [AfterFailure::AsPlanned, AfterFailure::Stop, AfterFailure::GoOn];
                self.after_failure = next(&ALL, self.after_failure, step);
            }
            Line::Language => self.lang = next(&Lang::ALL, self.lang, step),
        }
    }
}

fn next<T: Copy + PartialEq>(all: &[T], now: T, step: isize) -> T {
    let at = all.iter().position(|one| *one == now).unwrap_or(0);
    all[(at as isize + step).rem_euclid(all.len() as isize) as usize]
}

fn next_text(field: &mut Field, all: &[String], step: isize) {
    if all.is_empty() {
        return;
    }
    let at = all.iter().position(|one| one == field.text());
    let to = at.map_or(0, |at| (at as isize + step).rem_euclid(all.len() as isize) as usize);
    *field = Field::new(&all[to]);
}
