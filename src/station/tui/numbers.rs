//! Numbers of orders, sub-units and others on the screen: what was given, and which module it is of.

use gnc_executive::numbers::{NumberField, NumberKind, NumberLabel};

use super::lang::Lang;

/// The numbers that the operator has given, by their keys.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Numbers {
    /// For the module on the screen.
    given: Vec<(String, String)>,
    /// For the module after the run that is on.
    next: Vec<(String, String)>,
}

impl Numbers {
    pub(crate) fn new(given: Vec<(String, String)>) -> Self {
        Self { given, next: Vec::new() }
    }

    pub(crate) fn get(&self, key: &str) -> &str {
        self.given.iter().find(|(other, _)| other == key).map_or("", |(_, value)| value)
    }

    /// Takes a number; an empty one goes. `later`: the module on the screen has begun without it.
    pub(crate) fn set(&mut self, key: &str, value: &str, later: bool) {
        let numbers = if later { &mut self.next } else { &mut self.given };
        numbers.retain(|(other, _)| other != key);
        if !value.is_empty() {
            numbers.push((key.to_owned(), value.to_owned()));
        }
    }

    /// Another module comes: an order stays, and what was given for the next module is its own now.
    pub(crate) fn new_module(&mut self, fields: &[NumberField]) {
        let stays = |key: &str| fields.iter().any(|field| field.key == key && field.kind == NumberKind::Order);
        self.given.retain(|(key, _)| stays(key));
        for (key, value) in std::mem::take(&mut self.next) {
            self.set(&key, &value, false);
        }
    }

    /// What a run is given, of all that is asked for.
    pub(crate) fn of(&self, fields: &[NumberField]) -> Vec<(String, String)> {
        let asked = |key: &str| fields.iter().any(|field| field.key == key);
        self.given.iter().filter(|(key, _)| asked(key)).cloned().collect()
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
