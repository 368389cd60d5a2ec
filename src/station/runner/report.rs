//! What a procedure reports: each value is judged by the plan and filed at once.

use std::cell::RefCell;

use gnc_executive::event::{EventKind, Level};
use gnc_executive::measurement::{Measurement, Value};
use gnc_executive::plan::PlanItem;
use gnc_executive::quantity::Unit;

use super::journal::Journal;
use crate::procedure::Trouble;

/// The report of one attempt.
#[derive(Debug)]
pub struct Report<'a> {
    journal: &'a Journal,
    item: &'a PlanItem,
    attempt: u32,
    repeat: RefCell<u32>,
    serial_number: &'a str,
    measured: RefCell<Vec<Measurement>>,
}

impl<'a> Report<'a> {
    pub(super) fn new(journal: &'a Journal, item: &'a PlanItem, attempt: u32, serial_number: &'a str) -> Self {
        Self { journal, item, attempt, repeat: RefCell::new(1), serial_number, measured: RefCell::new(Vec::new()) }
    }

    /// Name of the item.
    #[must_use]
    pub fn item(&self) -> &str {
        &self.item.name
    }

    pub(super) fn begin_repeat(&self, repeat: u32) {
        *self.repeat.borrow_mut() = repeat;
    }

    pub(super) fn into_measured(self) -> Vec<Measurement> {
        self.measured.into_inner()
    }

    /// A number in a unit.
    ///
    /// # Errors
    /// The record could not be written.
    pub async fn number(&self, name: &str, value: f64, unit: Unit) -> Result<(), Trouble> {
        self.file(name, &Value::number(value, unit)).await
    }

    /// A count.
    ///
    /// # Errors
    /// The record could not be written.
    pub async fn count(&self, name: &str, count: u64) -> Result<(), Trouble> {
        self.file(name, &Value::count(count)).await
    }

    /// A text.
    ///
    /// # Errors
    /// The record could not be written.
    pub async fn text(&self, name: &str, text: &str) -> Result<(), Trouble> {
        self.file(name, &Value::text(text)).await
    }

    /// What this bench cannot tell, and why.
    ///
    /// # Errors
    /// The record could not be written.
    pub async fn not_available(&self, name: &str, why: &str) -> Result<(), Trouble> {
        self.file(name, &Value::NotAvailable(why.to_owned())).await
    }

    /// A sentence for the log.
    ///
    /// # Errors
    /// The record could not be written.
    pub async fn note(&self, text: &str) -> Result<(), Trouble> {
        let item = Some(self.item.name.clone());
        Ok(self.journal.emit(EventKind::Note { level: Level::Info, text: text.to_owned(), item }).await?)
    }

    /// Somebody is asked to do something.
    ///
    /// # Errors
    /// The record could not be written.
    pub async fn prompted(&self, what: &str) -> Result<(), Trouble> {
        let item = Some(self.item.name.clone());
        Ok(self.journal.emit(EventKind::Prompted { item, text: what.to_owned() }).await?)
    }

    /// Somebody did it.
    ///
    /// # Errors
    /// The record could not be written.
    pub async fn answered(&self, answer: &str) -> Result<(), Trouble> {
        let item = Some(self.item.name.clone());
        Ok(self.journal.emit(EventKind::Answered { item, answer: answer.to_owned() }).await?)
    }

    async fn file(&self, name: &str, value: &Value) -> Result<(), Trouble> {
        let repeat = *self.repeat.borrow();
        let measurement = self.item.judge(name, value, repeat, self.serial_number);
        self.measured.borrow_mut().push(measurement.clone());
        let (item, attempt) = (self.item.name.clone(), self.attempt);
        Ok(self.journal.emit(EventKind::Measured { item, attempt, measurement }).await?)
    }
}
