//! The records folder. Only this crate opens files in it.
//!
//! A run has a folder `DATE/SERIAL/TIME-PLAN`. Its journal is written while events happen and synced at the end of each
//! item. So are the raw samples, one file for each attempt that captures. Everything else is made from the journal at
//! the end, and a list of digests closes the folder.

mod agree;
pub mod as_written;
mod begun;
pub(crate) mod captured;
pub mod captures;
pub mod chain;
mod closing;
mod contents;
mod cut_off;
pub mod digest;
mod folded;
pub(crate) mod folder;
pub mod head;
pub mod inside;
pub(crate) mod key;
mod late;
mod litter;
pub mod located;
mod lock;
pub(crate) mod name;
mod names;
pub(crate) mod pending;
mod promised;
mod raw;
pub mod reader;
mod record_writer;
mod recovery;
mod staying;
mod tally;
pub(crate) mod unread;

use std::io;
use std::path::{Path, PathBuf};

use gnc_executive::state::OutOfOrder;

pub(crate) use begun::MAX_FIRST_EVENT_BYTES;
pub use begun::{may_begin, was_never_begun};
pub use closing::{goes_on, pretty};
pub use folder::RunFolder;
pub use key::{KeyError, PublicKey, StationKey};
pub use name::number_of;
pub use promised::Promises;
pub use raw::{RawFile, RawPart};
pub use record_writer::{RecordWriter, Watcher};
pub use recovery::{Sealer, seal_interrupted};
pub use unread::Unread;

/// The journal of a run.
pub const JOURNAL: &str = "events.jsonl";
/// The record for programs.
pub const RECORD: &str = "run.json";
/// The record of one item, in its folder.
pub(crate) const ITEM: &str = "item.json";
/// The record for people.
pub(crate) const LOG: &str = "log.txt";
/// Digests of all other files, in the form that `sha256sum -c` reads.
pub const DIGESTS: &str = "SHA256SUMS";
/// The station's signature of the digests, if the station has a key.
pub(crate) const SIGNATURE: &str = "SHA256SUMS.sig";
/// Papers made from the record. The record digest in the passport leaves them out.
pub(crate) const PAPERS: [&str; 3] = [crate::passport::PASSPORT, crate::passport::PASSPORT_XML, crate::report::REPORT];
/// The folder of a day for runs of a module that is not the one that was scanned.
pub const UNASSIGNED: &str = "_unassigned";
/// The plan as run, and what it includes.
pub const PLAN: &str = "plan";

/// Why a record could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// Access to a file or folder failed.
    #[error("cannot {what} {}", gnc_text::shown_path(path))]
    File {
        /// The action: "write", "create".
        what: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// The line of a run in the chain could not be written, and not be taken back either.
    #[error("its line may stand in the chain")]
    MayStand(#[source] Box<StoreError>),
    /// An event could not be turned into text: a mistake in this program.
    #[error("an event cannot be written as JSON")]
    Json(#[from] serde_json::Error),
    /// The passport could not be turned into text: a mistake in this program.
    #[error("the passport cannot be written")]
    Passport(#[from] crate::passport::XmlError),
    /// The runner emitted an event that cannot follow the one before: a mistake in this program.
    #[error("the run's events are out of order")]
    OutOfOrder(#[source] OutOfOrder),
    /// The writing thread has ended.
    #[error("the record is closed: {why}")]
    Closed {
        /// The first error, or another cause.
        why: String,
    },
}

impl StoreError {
    /// What the operator can try.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        let (path, source) = match self {
            Self::File { path, source, .. } => (path, source),
            Self::MayStand(error) => return error.try_this(),
            _ => return "look at the first error of the record; if there is none, report this",
        };
        if gnc_files::is_refused(source).is_some() && path.ends_with(chain::COUNTER) {
            return "a station did not put that there: move it away; the next start makes COUNTER again from the chain";
        }
        if gnc_files::is_refused(source).is_some() {
            return "a station did not put that there: move it away, and bring the file back from a backup";
        }
        if source.raw_os_error() == Some(nix::errno::Errno::ELOOP as i32) {
            return "a link has that name; choose another folder with --records";
        }
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "make room on the disk and run again",
            io::ErrorKind::PermissionDenied => {
                "make it readable and writable for this user, or choose another folder with --records"
            }
            io::ErrorKind::ReadOnlyFilesystem => "mount the disk writable, or choose another folder with --records",
            io::ErrorKind::NotFound => "check the path, or choose another folder with --records",
            io::ErrorKind::ResourceBusy => "end the program that holds the records folder, or wait until it is done",
            io::ErrorKind::NotADirectory => "a file has that name; choose another folder with --records",
            _ => "check the disk, or choose another folder with --records",
        }
    }
}

/// The folder of an item within a run's folder, by its position in the plan from 0.
pub(crate) fn item_folder(position: usize, item: &str) -> String {
    format!("{:02}-{}", position + 1, name::of_part(item))
}

/// The raw samples of an attempt within the folder of its item; each round within it has its own file.
pub(crate) fn raw_file(attempt: u32, repeat: u32) -> String {
    match repeat {
        1 => format!("attempt-{attempt}.mcap"),
        _ => format!("attempt-{attempt}-{repeat}.mcap"),
    }
}

/// Attaches a path to an error of the system.
///
/// # Errors
/// [`StoreError::File`] if `result` is an error.
pub fn on<T>(result: io::Result<T>, what: &'static str, path: &Path) -> Result<T, StoreError> {
    result.map_err(|source| StoreError::File { what, path: path.to_owned(), source })
}
