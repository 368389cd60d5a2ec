//! Error records: what the board itself noted about a fault.

use gnc_board::{BoardClient, BoardLease};
use gnc_executive::event::{ErrorRecord as RecordEvent, EventKind, NoteLevel};
use gnc_protocol::message::{ErrorKind, ErrorRecord, ErrorRecords};
use gnc_records::store::StoreError;
use gnc_text::with_causes;

use super::connection::OWN_CALL;
use super::{Landed, Run};

/// Error records read at the end of one attempt: as many as the board keeps.
const MAX_RECORDS: usize = 64;

impl Run<'_> {
    /// Files what the board found wrong during an attempt. A failure to read it gives a line in the log, not a verdict.
    pub(super) async fn file_error_records(&self, board: &BoardClient, landed: &Landed) -> Result<(), StoreError> {
        let Some(item) = self.job().item(landed.position) else { return Ok(()) };
        for _ in 0..MAX_RECORDS {
            let reply = match self.own_desk(board).call(&ErrorRecords { from: self.records_read.get() }).await {
                Ok(reply) => reply,
                Err(_) if self.records_refused.get() => break,
                Err(error) => {
                    // A board that cannot tell its records cannot after any item; once is enough.
                    self.records_refused.set(true);
                    let text = format!("the board's error records cannot be read: {}", with_causes(&error));
                    self.note(NoteLevel::Warning, text, Some(&item.name)).await?;
                    break;
                }
            };
            if let Some(last) = reply.records.last() {
                self.records_read.set(last.index.wrapping_add(1));
            }
            let done = reply.records.is_empty() || self.records_read.get() >= reply.total;
            self.unfiled.borrow_mut().extend(reply.records);
            if done {
                break;
            }
        }
        let mine: Vec<ErrorRecord> =
            self.unfiled.borrow_mut().extract_if(.., |record| landed.requests.contains(&record.request)).collect();
        for record in &mine {
            let (item, attempt, record) = (item.name.clone(), landed.attempt, for_people(record));
            self.journal.emit(EventKind::ErrorRecord { item, attempt, record }).await?;
        }
        Ok(())
    }
}

impl Run<'_> {
    /// Notes what the board found wrong outside of any item.
    pub(super) async fn note_error_records(
        &self,
        lease: &BoardLease<'_>,
        item: Option<&str>,
    ) -> Result<(), StoreError> {
        let question = ErrorRecords { from: self.records_read.get() };
        let reply = tokio::time::timeout(OWN_CALL, lease.call(&question)).await;
        let Ok(Ok(reply)) = reply else { return Ok(()) };
        for record in &reply.records {
            self.records_read.set(record.index.wrapping_add(1));
            let RecordEvent { what, location, expected, got, .. } = for_people(record);
            let text = format!("the board's error record: {what} ({location}): expected {expected}, got {got}");
            self.note(NoteLevel::Error, text, item).await?;
        }
        Ok(())
    }
}

fn for_people(record: &ErrorRecord) -> RecordEvent {
    let kind = ErrorKind::from_number(record.kind);
    let (what, location) = match kind {
        Some(ErrorKind::MemoryMismatch) => ("memory word differs".to_owned(), format!("word {:#08x}", record.place)),
        Some(ErrorKind::FlashNotBlank) => ("flash word not blank".to_owned(), format!("word {}", record.place)),
        Some(ErrorKind::FlashMismatch) => ("flash word differs".to_owned(), format!("word {}", record.place)),
        Some(ErrorKind::FlashSlow) => ("flash slower than its data sheet".to_owned(), "us".to_owned()),
        Some(ErrorKind::IoMismatch) => (
            "IO line does not follow".to_owned(),
            format!("line {} driven, {} read", record.place >> 4, record.place & 15),
        ),
        Some(ErrorKind::SpiMismatch) => ("SPI byte differs".to_owned(), format!("byte {}", record.place)),
        Some(ErrorKind::SciMismatch) => ("SCI byte differs".to_owned(), format!("byte {}", record.place)),
        Some(ErrorKind::TimerInterrupts) => ("timer interrupts missing".to_owned(), format!("timer {}", record.place)),
        Some(ErrorKind::Supply) => ("supply out of range".to_owned(), "microvolts at the socket".to_owned()),
        Some(ErrorKind::CalibrationDamaged) => {
            ("stored calibration does not match its checksum".to_owned(), format!("slot {}", record.place))
        }
        None => (format!("error of unknown kind {}", record.kind), format!("{}", record.place)),
    };
    let number = |value: u32| match kind {
        Some(ErrorKind::FlashSlow | ErrorKind::TimerInterrupts | ErrorKind::Supply) => value.to_string(),
        _ => format!("{value:#010x}"),
    };
    RecordEvent {
        what,
        location,
        expected: number(record.expected),
        got: number(record.got),
        board_time_us: record.board_time_us,
    }
}
