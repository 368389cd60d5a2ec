//! Numbers of orders, sub-units and others on the screen: what was given, and which module it is of.

use gnc_executive::numbers::{NumberField, NumberKind, NumberLabel};

use super::lang::Lang;

/// The numbers that the operator has given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Numbers {
    /// For the module on the screen.
    given: Vec<Given>,
    /// For the module after it. An empty one takes the number away.
    next: Vec<Given>,
}

/// A number as it was given.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Given {
    key: String,
    value: String,
    /// What it belongs to; `None`: the command line gave it, before plan and bench were read.
    kind: Option<NumberKind>,
    /// It was given for a module before: only an order still counts.
    earlier: bool,
}

impl Given {
    /// Whether it is a number of an order, which stays until it is changed.
    fn is_order(&self, field: &NumberField) -> bool {
        field.kind == NumberKind::Order && self.kind.is_none_or(|kind| kind == NumberKind::Order)
    }

    /// Whether it is what this field asks for.
    fn counts(&self, field: &NumberField) -> bool {
        self.key == field.key && (!self.earlier || self.is_order(field))
    }
}

impl Numbers {
    /// The numbers of the command line, by their keys.
    pub(crate) fn new(given: Vec<(String, String)>) -> Self {
        let each = given.into_iter().map(|(key, value)| Given { key, value, kind: None, earlier: false });
        Self { given: each.collect(), next: Vec::new() }
    }

    /// The number of the module on the screen, or (`later`) of the one after it.
    pub(crate) fn of_field(&self, field: &NumberField, later: bool) -> &str {
        if later { self.get_next(field) } else { self.get(field) }
    }

    /// The number of the module on the screen.
    pub(crate) fn get(&self, field: &NumberField) -> &str {
        self.given.iter().find(|given| given.counts(field)).map_or("", |given| &given.value)
    }

    /// The number that the module after it has so far.
    fn get_next(&self, field: &NumberField) -> &str {
        let stays = || self.given.iter().find(|given| given.key == field.key && given.is_order(field));
        let next = self.next.iter().find(|given| given.key == field.key);
        next.or_else(stays).map_or("", |given| &given.value)
    }

    /// Takes a number; an empty one goes. `later`: it is of the module after the one on the screen.
    pub(crate) fn set(&mut self, field: &NumberField, value: &str, later: bool) {
        let (key, kind) = (field.key.clone(), Some(field.kind));
        let given = Given { key, value: value.to_owned(), kind, earlier: false };
        if later {
            self.next.retain(|other| other.key != field.key);
            self.next.push(given);
            return;
        }
        if field.kind == NumberKind::Order {
            // The order is another one from now on, whatever was scanned before.
            self.next.retain(|other| other.key != field.key);
        }
        self.take(given);
    }

    fn take(&mut self, given: Given) {
        self.given.retain(|other| other.key != given.key);
        if !given.value.is_empty() {
            self.given.push(given);
        }
    }

    /// The next module comes, which may be the same one again. What was given for it is its own now. Of another module only
    /// an order stays; which numbers are of orders is asked when they are used, since no plan may be at hand now.
    pub(crate) fn module_comes(&mut self, is_another: bool) {
        self.given.iter_mut().for_each(|given| given.earlier |= is_another);
        for given in std::mem::take(&mut self.next) {
            self.take(given);
        }
    }

    /// Another module than the one that was to come next comes next: what was given for that one goes.
    pub(crate) fn another_next(&mut self) {
        self.next.retain(|given| given.kind == Some(NumberKind::Order));
    }

    /// What a run is given, of all that is asked for.
    pub(crate) fn of(&self, fields: &[NumberField]) -> Vec<(String, String)> {
        let asked = |given: &&Given| fields.iter().any(|field| given.counts(field));
        self.given.iter().filter(asked).map(|given| (given.key.clone(), given.value.clone())).collect()
    }
}

/// The name of a number in a language.
pub(crate) fn label(label: &NumberLabel, lang: Lang) -> &str {
    match lang {
        Lang::En => &label.en,
        Lang::Zh => &label.zh,
        Lang::Ru => &label.ru,
    }
}
