//! Locks of folders and journals: how long a station waits for one, and who holds it instead. The kernel releases a lock when its
//! program ends.

use std::fs::{File, TryLockError};
use std::io;
use std::path::Path;
use std::time::{Duration, Instant};

use super::{StoreError, on};

/// Longest wait for another station that closes a run or takes an empty folder away: that station writes two short files and waits for
/// the disk.
pub(super) const LOCKED_FOR: Duration = Duration::from_secs(10);

/// Time between two looks at a lock.
const LOOK_EVERY: Duration = Duration::from_millis(5);

/// Takes the lock of a file or a folder, alone or with other readers. `false`: another program held it for all of this time.
#[expect(clippy::disallowed_methods, reason = "flock has no wait with a deadline; this thread writes records alone")]
pub(super) fn within(file: &File, wait: Duration, try_lock: fn(&File) -> Result<(), TryLockError>) -> io::Result<bool> {
    let began = Instant::now();
    loop {
        match try_lock(file) {
            Ok(()) => return Ok(true),
            Err(TryLockError::WouldBlock) if began.elapsed() < wait => {}
            Err(TryLockError::WouldBlock) => return Ok(false),
            Err(TryLockError::Error(error)) => return Err(error),
        }
        std::thread::sleep(LOOK_EVERY);
    }
}

/// The error of a lock that another program did not release.
pub(super) fn busy<T>(why: String, path: &Path) -> Result<T, StoreError> {
    on(Err(io::Error::new(io::ErrorKind::ResourceBusy, why)), "lock", path)
}

/// Who holds a file or a folder.
#[derive(Debug)]
pub(super) enum Holder {
    /// This program, from now on.
    Own(File),
    /// A station that writes there.
    Station,
    /// Programs that look whether a run goes on.
    Readers,
}

/// Takes the lock of a file or a folder without a wait, or tells who has it. A station locks alone, and readers together.
pub(super) fn holder(file: File) -> io::Result<Holder> {
    match file.try_lock() {
        Ok(()) => return Ok(Holder::Own(file)),
        Err(TryLockError::Error(error)) => return Err(error),
        Err(TryLockError::WouldBlock) => {}
    }
    Ok(if file.try_lock_shared().is_ok() { Holder::Readers } else { Holder::Station })
}
