//! What follows a verdict beside the screen: the program of the bench file, and the counters of the shift.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use chrono::{Local, NaiveTime};
use gnc_executive::verdict::Verdict;
use gnc_records::shift::{self, Shift, ShiftBook, ShiftOf};
use tokio::sync::{Notify, mpsc};

use crate::hook::Hooks;
use crate::setup::CheckedBench;
use crate::tui::update::Msg;

/// Who learns of a verdict. Each copy is a handle of the same.
#[derive(Debug, Clone)]
pub(in crate::tui) struct Told {
    hooks: Arc<Mutex<Option<Hooks>>>,
    /// The shift is to be counted again.
    ended: Arc<Notify>,
    screen: mpsc::Sender<Msg>,
}

impl Told {
    pub(super) fn new(screen: mpsc::Sender<Msg>) -> Self {
        Self { hooks: Arc::default(), ended: Arc::default(), screen }
    }

    /// Takes the program of a bench. The program of the bench before is still told what it has to be told.
    pub(super) fn take(&self, bench: &CheckedBench) {
        let screen = self.screen.clone();
        // A screen that is far behind learns of the next trouble.
        let trouble = move |what| drop(screen.try_send(Msg::HookTrouble(what)));
        let hooks = match bench.habits.hook.clone().map(|program| Hooks::start(program, trouble)).transpose() {
            Ok(hooks) => hooks,
            Err(error) => {
                let _ = self.screen.try_send(Msg::HookTrouble(format!("cannot start the hook: {error}")));
                None
            }
        };
        *self.hooks.lock().unwrap_or_else(PoisonError::into_inner) = hooks;
    }

    /// Tells a verdict. Returns at once.
    pub(super) fn verdict(&self, folder: &Path, serial_number: &str, verdict: Verdict) {
        let hooks = self.hooks.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(Err(why)) = hooks.as_ref().map(|hooks| hooks.tell(folder, serial_number, verdict)) {
            let _ = self.screen.try_send(Msg::HookTrouble(why));
        }
        self.ended.notify_one();
    }

    /// Returns when a run has ended since the last call.
    pub(super) async fn next_end(&self) {
        self.ended.notified().await;
    }

    /// Waits until the last verdicts are told, but no longer than the program is given, nor after an interrupt.
    pub(in crate::tui) async fn finish(self, interrupted: impl Future<Output = ()>) {
        let hooks = self.hooks.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(hooks) = hooks {
            hooks.finish(interrupted).await;
        }
    }
}

/// The counters of the shift of a bench. Each copy is a handle of the same.
#[derive(Debug, Clone)]
pub(super) struct Counter {
    book: Arc<Mutex<ShiftBook>>,
    begins: Vec<NaiveTime>,
}

impl Counter {
    pub(super) fn of(bench: &CheckedBench) -> Self {
        Self { book: Arc::new(Mutex::new(ShiftBook::new(shift_of(bench)))), begins: bench.habits.shifts.clone() }
    }

    /// Reads the runs that are new.
    pub(super) fn count(&self) -> Shift {
        let now = Local::now().fixed_offset();
        let since = shift_began(&self.begins);
        self.book.lock().unwrap_or_else(PoisonError::into_inner).shift(since, now)
    }
}

/// Whose runs count at a bench.
pub(super) fn shift_of(bench: &CheckedBench) -> ShiftOf {
    ShiftOf { records: bench.records.clone(), station: bench.station.clone(), kind: bench.bench.kind }
}

/// When the shift of now began.
pub(super) fn shift_began(begins: &[NaiveTime]) -> chrono::DateTime<chrono::FixedOffset> {
    let to_time = |local: chrono::NaiveDateTime| local.and_local_timezone(Local).earliest().map(|at| at.fixed_offset());
    shift::begin_of(Local::now().fixed_offset(), begins, to_time)
}
