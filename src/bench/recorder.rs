//! Files what a procedure measures: the plan judges each value, and the journal takes it at once.

use std::cell::RefCell;
use std::sync::Arc;

use gnc_analysis::capture::Capture;
use gnc_analysis::figures::Findings;
use gnc_executive::catalogue::{ItemId, MeasurementSpec};
use gnc_executive::event::{CapturedSamples, EventKind, NoteLevel, Power};
use gnc_executive::limit::{Expected, Limit};
use gnc_executive::measurement::Value;
use gnc_executive::plan::{PlanItem, Question};
use gnc_executive::quantity::Unit;
use gnc_records::store::captures::CapturesError;
use gnc_records::store::{RawFile, RawPart, StoreError, captures};

use crate::journal::RunJournal;

/// Why the captures of another item cannot be read back.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ReadBackError {
    /// The file is damaged or gone.
    #[error(transparent)]
    Captures(#[from] CapturesError),
    /// The task that reads broke down: a mistake in this program.
    #[error("the station could not read the captures back")]
    Broken(#[source] tokio::task::JoinError),
}

impl ReadBackError {
    /// What the operator can try.
    #[must_use]
    pub(crate) fn try_this(&self) -> &'static str {
        match self {
            Self::Captures(error) => error.source.try_this(),
            Self::Broken(_) => "keep the raw samples and report this",
        }
    }
}

/// The recorder of one attempt.
#[derive(Debug)]
pub(crate) struct Recorder<'a> {
    journal: &'a RunJournal,
    item: &'a PlanItem,
    attempt: u32,
    repeat: RefCell<u32>,
    serial_number: &'a str,
}

impl<'a> Recorder<'a> {
    pub(crate) fn new(journal: &'a RunJournal, item: &'a PlanItem, attempt: u32, serial_number: &'a str) -> Self {
        Self { journal, item, attempt, repeat: RefCell::new(1), serial_number }
    }

    /// Name of the item.
    #[must_use]
    pub(crate) fn item(&self) -> &str {
        &self.item.name
    }

    /// Its kind.
    #[must_use]
    pub(crate) fn id(&self) -> ItemId {
        self.item.id
    }

    /// The round within the attempt, from 1.
    #[must_use]
    pub(crate) fn repeat(&self) -> u32 {
        *self.repeat.borrow()
    }

    pub(crate) fn begin_repeat(&self, repeat: u32) {
        *self.repeat.borrow_mut() = repeat;
    }

    /// Files a number in a unit.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn number(&self, measurement: &MeasurementSpec, value: f64, unit: Unit) -> Result<(), StoreError> {
        self.file(measurement.name, &Value::number(value, unit)).await
    }

    /// Files a count.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn count(&self, measurement: &MeasurementSpec, count: u64) -> Result<(), StoreError> {
        self.file(measurement.name, &Value::count(count)).await
    }

    /// Files a text.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn text(&self, measurement: &MeasurementSpec, text: &str) -> Result<(), StoreError> {
        self.file(measurement.name, &Value::text(text)).await
    }

    /// Files that this bench cannot measure a value, and why.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn not_available(&self, measurement: &MeasurementSpec, why: &str) -> Result<(), StoreError> {
        self.file(measurement.name, &Value::NotAvailable(why.to_owned())).await
    }

    /// Files a value without conversion.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn value(&self, measurement: &MeasurementSpec, value: &Value) -> Result<(), StoreError> {
        self.file(measurement.name, value).await
    }

    /// Writes a sentence to the log.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn note(&self, text: &str) -> Result<(), StoreError> {
        let item = Some(self.item.name.clone());
        self.journal.emit(EventKind::Note { level: NoteLevel::Info, text: text.to_owned(), item }).await
    }

    /// Writes a sentence that needs attention to the log.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn warning(&self, text: String) -> Result<(), StoreError> {
        let item = Some(self.item.name.clone());
        self.journal.emit(EventKind::Note { level: NoteLevel::Warning, text, item }).await
    }

    /// Files what a raw file of this attempt holds: its captures so far are complete.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn captured(&self, part: RawPart) -> Result<(), StoreError> {
        let RawPart { file, bytes, sha256 } = part;
        let (item, attempt) = (self.item.name.clone(), self.attempt);
        // The journal knows what stands before the line, and has the key.
        let (journal_sha256, signature) = (String::new(), None);
        let captured = CapturedSamples { item, attempt, file, bytes, sha256, journal_sha256, signature };
        self.journal.emit(EventKind::Captured(captured)).await
    }

    /// Opens the file for the raw samples of this round.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn raw(&self) -> Result<RawFile, StoreError> {
        let repeat = *self.repeat.borrow();
        self.journal.raw(&self.item.name, self.attempt, repeat).await
    }

    /// The captures of another item of this run, from its last attempt.
    ///
    /// # Errors
    /// Its raw samples cannot be read.
    pub(crate) async fn captures_of(&self, item: &str) -> Result<Vec<Capture>, ReadBackError> {
        let (position, attempt) = self.journal.look(|state| {
            let position = state.position(item).unwrap_or_default();
            (position, state.rows().get(position).map_or(1, |row| row.attempts.len()))
        });
        let path = captures::path(self.journal.folder(), position, item, u32::try_from(attempt).unwrap_or(1), 1);
        // Read on another thread: the conversation with the board must not wait for a disk.
        let read = tokio::task::spawn_blocking(move || captures::read(&path)).await;
        let record = read.map_err(ReadBackError::Broken)??;
        Ok(record.captures)
    }

    /// Files that the module's supply was switched; microvolts and microamperes as the board measures them.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn powered(&self, on: bool, measured: Option<(u32, u32)>) -> Result<(), StoreError> {
        let power = Power {
            on,
            supply: "slave board".into(),
            voltage_v: measured.map(|(uv, _)| f64::from(uv) * 1e-6),
            current_a: measured.map(|(_, ua)| f64::from(ua) * 1e-6),
            calibration: None,
        };
        self.journal.emit(EventKind::Power(power)).await
    }

    /// Files values of several measurements.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn values(&self, values: &[(&'static str, Value)]) -> Result<(), StoreError> {
        for (name, value) in values {
            self.file(name, value).await?;
        }
        Ok(())
    }

    /// Files what an analysis found: its measurements, then everything else.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn found(&self, findings: Findings) -> Result<(), StoreError> {
        self.values(&findings.measured).await?;
        let (item, attempt, details) = (self.item.name.clone(), self.attempt, findings.details);
        self.journal.emit(EventKind::Found { item, attempt, details }).await
    }

    /// Files that a person is asked to do something.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn prompted(&self, what: &str) -> Result<(), StoreError> {
        let item = Some(self.item.name.clone());
        let text = what.to_owned();
        self.journal.emit(EventKind::Prompted { item, text, question: None, picture_sha256: None }).await
    }

    /// Files the answer.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn answered(&self, answer: &str) -> Result<(), StoreError> {
        let item = Some(self.item.name.clone());
        self.journal.emit(EventKind::Answered { item, answer: answer.to_owned(), question: None }).await
    }

    /// The questions of the item.
    pub(crate) fn questions(&self) -> &'a [Arc<Question>] {
        &self.item.questions
    }

    /// The limit of a measurement, for people: with the number of this run's module where the plan has its placeholder.
    pub(crate) fn limit(&self, measurement: &str) -> Option<String> {
        Some(match self.item.limit(measurement)? {
            Limit::Text(Expected::SerialNumber) => format!("== {}", self.serial_number),
            limit => limit.to_string(),
        })
    }

    /// The person who tests.
    pub(crate) fn operator(&self) -> Option<String> {
        self.journal.look(|state| state.header().and_then(|header| header.operator.clone()))
    }

    /// Files that a question of the plan is asked, and which picture it shows.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn asked(&self, question: &Question, text: &str) -> Result<(), StoreError> {
        let picture_sha256 = question.picture_sha256.clone();
        let (item, question) = (Some(self.item.name.clone()), Some(question.name.clone()));
        self.journal.emit(EventKind::Prompted { item, text: text.to_owned(), question, picture_sha256 }).await
    }

    /// Files that the answers to questions of the plan are looked over; `last` is the last question.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn looked_over(&self, last: &Question, text: &str) -> Result<(), StoreError> {
        let (item, question) = (Some(self.item.name.clone()), Some(last.name.clone()));
        self.journal.emit(EventKind::Prompted { item, text: text.to_owned(), question, picture_sha256: None }).await
    }

    /// Files what was answered to a question of the plan.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn told(&self, question: &Question, answer: &str) -> Result<(), StoreError> {
        let (item, question) = (Some(self.item.name.clone()), Some(question.name.clone()));
        self.journal.emit(EventKind::Answered { item, answer: answer.to_owned(), question }).await
    }

    /// Files the answer that counts.
    ///
    /// # Errors
    /// The record could not be written.
    pub(crate) async fn answer(&self, question: &str, value: &Value) -> Result<(), StoreError> {
        self.file(question, value).await
    }

    async fn file(&self, name: &str, value: &Value) -> Result<(), StoreError> {
        let repeat = *self.repeat.borrow();
        let measurement = self.item.judge(name, value, repeat, self.serial_number);
        let (item, attempt) = (self.item.name.clone(), self.attempt);
        self.journal.emit(EventKind::Measured { item, attempt, measurement }).await
    }
}
