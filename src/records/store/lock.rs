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
    holder_after(file, || ())
}

/// As [`holder`], with what others do after the first look.
fn holder_after(file: File, meanwhile: impl FnOnce()) -> io::Result<Holder> {
    if is_taken(file.try_lock())? {
        return Ok(Holder::Own(file));
    }
    meanwhile();
    if !is_taken(file.try_lock_shared())? {
        return Ok(Holder::Station);
    }
    // A station that released it since the first look leaves it to this program. Readers do not.
    Ok(if is_taken(file.try_lock())? { Holder::Own(file) } else { Holder::Readers })
}

fn is_taken(tried: Result<(), TryLockError>) -> io::Result<bool> {
    match tried {
        Ok(()) => Ok(true),
        Err(TryLockError::WouldBlock) => Ok(false),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_that_a_station_releases_meanwhile_is_no_readers_lock() {
        let folder = tempfile::tempdir().unwrap();
        let open = || File::open(folder.path()).unwrap();
        let station = open();
        station.try_lock().unwrap();
        assert!(matches!(holder(open()).unwrap(), Holder::Station));
        let own = holder_after(open(), || drop(station)).unwrap();
        assert!(matches!(own, Holder::Own(_)), "{own:?}");
        assert!(matches!(holder(open()).unwrap(), Holder::Station), "it is held from now on");
        drop(own);
        let reader = open();
        reader.try_lock_shared().unwrap();
        assert!(matches!(holder(open()).unwrap(), Holder::Readers));
        drop(reader);
        assert!(matches!(holder(open()).unwrap(), Holder::Own(_)), "the look at it left no lock");
    }
}
