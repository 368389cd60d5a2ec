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

/// The module that a number is given for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Owner {
    /// The module on the screen, which was scanned and has not been tested since.
    Present,
    /// The module that is tested next, whichever that is: none is chosen yet, or the verdict of the last one is shown.
    Coming,
    /// The module after the one on the screen.
    Next,
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
    /// It goes to the module that is tested next, also if that is scanned later.
    coming: bool,
    /// A run has had it.
    used: bool,
}

impl Given {
    /// Whether it is a number of an order, which stays until it is changed.
    fn is_order(&self, field: &NumberField) -> bool {
        field.kind == NumberKind::Order && self.kind.is_none_or(|kind| kind == NumberKind::Order)
    }

    /// Whether it is known to be of one module, as a sub-unit is.
    fn is_of_a_module(&self) -> bool {
        self.kind.is_some_and(|kind| kind != NumberKind::Order)
    }

    /// As [`Self::is_of_a_module`], also for a number of the command line, of which only the fields tell what it belongs to.
    fn is_of_a_module_by(&self, fields: &[NumberField]) -> bool {
        let asked = || fields.iter().any(|field| field.key == self.key && field.kind != NumberKind::Order);
        self.is_of_a_module() || self.kind.is_none() && asked()
    }

    /// Whether it is what this field asks for.
    fn counts(&self, field: &NumberField) -> bool {
        self.key == field.key && (!self.earlier || self.is_order(field))
    }
}

impl Numbers {
    /// The numbers of the command line, by their keys. `coming`: it names no module, so they are of the first one that comes.
    pub(crate) fn new(given: Vec<(String, String)>, coming: bool) -> Self {
        let each =
            given.into_iter().map(|(key, value)| Given { key, value, kind: None, earlier: false, coming, used: false });
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

    /// Takes a number; an empty one goes.
    pub(crate) fn set(&mut self, field: &NumberField, value: &str, owner: Owner) {
        let (key, kind, coming) = (field.key.clone(), Some(field.kind), owner == Owner::Coming);
        let given = Given { key, value: value.to_owned(), kind, earlier: false, coming, used: false };
        if owner == Owner::Next {
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
    /// an order stays; which numbers are of orders is asked when they are used, since no plan may be at hand now. Returns what no
    /// run had and no run will have.
    pub(crate) fn module_comes(&mut self, is_another: bool, fields: &[NumberField]) -> Vec<String> {
        let mut dropped = Vec::new();
        for given in &mut self.given {
            let goes = is_another && !std::mem::take(&mut given.coming) && !given.earlier;
            given.earlier |= goes;
            if goes && !given.used && given.is_of_a_module_by(fields) {
                dropped.push(given.value.clone());
            }
        }
        for given in std::mem::take(&mut self.next) {
            self.take(given);
        }
        dropped
    }

    /// A run begins, and has what was given for its module.
    pub(crate) fn run_begins(&mut self) {
        self.given.iter_mut().for_each(|given| (given.coming, given.used) = (false, true));
    }

    /// Another module than the one that was to come next comes next: what was given for that one goes, and is returned.
    pub(crate) fn another_next(&mut self) -> Vec<String> {
        let gone = self.next.extract_if(.., |given| given.is_of_a_module());
        gone.map(|given| given.value).filter(|value| !value.is_empty()).collect()
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
