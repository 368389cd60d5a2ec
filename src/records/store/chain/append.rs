//! Appends runs to the chain, under the lock of the whole folder.
//!
//! The line closes a run: as soon as it is on disk the run is closed, and before that it is not. If the line cannot be
//! written, it is taken back, and the caller takes the seal of the run back. `COUNTER` follows the chain and decides nothing: if
//! it cannot be written, the run is closed all the same, `records verify` names the difference, and the next run or the next
//! start mends it. So no error can leave a run that one face calls closed and another one not.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::Path;
use std::time::{Duration, Instant};

use gnc_files::Part;
use nix::errno::Errno;
use nix::fcntl::{Flock, FlockArg};

use super::entry::{ChainEntry, LateClose};
use super::read::{chains, counter, name_in};
use super::{CHAIN, COUNTER, NOTHING};
use crate::store::folder::sync_dir;
use crate::store::{DIGESTS, StoreError, digest, on};

/// Longest wait for another station that closes a run: that station writes two short files and waits for the disk.
const LOCKED_FOR: Duration = Duration::from_secs(10);

/// Number of newest days that are searched for the last line: a run that went on past midnight is closed in the day
/// before.
pub(super) const NEWEST_DAYS: usize = 3;

/// Time between two looks at the lock.
const LOOK_EVERY: Duration = Duration::from_millis(5);

/// Appends a closed run to the chain. Its `SHA256SUMS` must be on disk.
///
/// # Errors
/// [`StoreError`]: the disk failed, or another station does not release the lock.
pub(crate) fn append(run: &Path) -> Result<(), StoreError> {
    append_as(run, None)
}

/// As [`append`], with the mark of a run that is closed late.
pub(crate) fn append_as(run: &Path, late: Option<&LateClose>) -> Result<(), StoreError> {
    let mut above = run.ancestors().skip(2);
    let (Some(day), Some(records)) = (above.next(), above.next()) else {
        return on(Err(io::ErrorKind::NotFound.into()), "find the records folder of", run);
    };
    let _lock = lock(records)?;
    let (number, before) = last(records)?;
    let number = on(next(number), "write", &day.join(CHAIN))?;
    let digest = digest::of_file(&run.join(DIGESTS))?;
    let name = name_in(records, run);
    let link = ChainEntry::new(number, &before, &digest, &name, late.cloned());
    write_line(day, &link.line())?;
    // The line has closed the run. A counter that is behind is named by each check and mended by the next start.
    let _ = count(records, link.number, &link.link);
    Ok(())
}

/// The number behind the last one.
fn next(number: u64) -> io::Result<u64> {
    number.checked_add(1).ok_or_else(|| {
        let why = "the last run has the highest number that there is: the chain or COUNTER was changed";
        io::Error::new(io::ErrorKind::InvalidData, why)
    })
}

/// Writes a line to the chain of a day. After an error the chain is as it was before.
fn write_line(day: &Path, line: &str) -> Result<(), StoreError> {
    let path = day.join(CHAIN);
    let mut file = on(OpenOptions::new().create(true).append(true).open(&path), "write", &path)?;
    let whole = on(whole_lines(&path), "read", &path)?;
    on(file.set_len(whole), "write", &path)?;
    let written = on(file.write_all(line.as_bytes()).and_then(|()| file.sync_all()), "write", &path);
    let written = written.and_then(|()| sync_dir(day));
    if written.is_err() {
        // The reported error is that of the line. If this fails too, the run has no seal, and so it is not closed.
        let _ = file.set_len(whole).and_then(|()| file.sync_all());
    }
    written
}

/// Bytes of a chain up to the end of its last whole line. A power cut or a full disk may leave half a line, which would
/// swallow the next one.
pub(super) fn whole_lines(path: &Path) -> io::Result<u64> {
    let text = fs::read(path)?;
    Ok(text.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last as u64 + 1))
}

/// Takes the lock of the whole folder: only one station at a time.
#[expect(clippy::disallowed_methods, reason = "flock has no wait with a deadline; this thread writes records alone")]
pub(super) fn lock(records: &Path) -> Result<Flock<File>, StoreError> {
    let began = Instant::now();
    let mut folder = on(File::open(records), "read", records)?;
    loop {
        match Flock::lock(folder, FlockArg::LockExclusiveNonblock) {
            Ok(lock) => return Ok(lock),
            Err((back, Errno::EAGAIN)) if began.elapsed() < LOCKED_FOR => folder = back,
            Err((_, Errno::EAGAIN)) => {
                let why = format!("another program holds it for more than {} s", LOCKED_FOR.as_secs());
                return on(Err(io::Error::new(io::ErrorKind::ResourceBusy, why)), "lock", records);
            }
            Err((_, error)) => return on(Err(error.into()), "lock", records),
        }
        std::thread::sleep(LOOK_EVERY);
    }
}

/// Writes number and link of the last run, in one step.
pub(super) fn count(records: &Path, number: u64, link: &str) -> Result<(), StoreError> {
    let path = records.join(COUNTER);
    let mut part = on(Part::create(&path), "write", &path)?;
    on(writeln!(part, "{number} {link}").and_then(|()| part.sync()), "write", &path)?;
    on(part.place(), "write", &path)?;
    sync_dir(records)
}

/// Number and link of the last run. A line that is not counted yet counts, and the chain alone counts if the counter cannot be
/// read.
fn last(records: &Path) -> Result<(u64, String), StoreError> {
    let counted = match counted(records)? {
        Counted::As(number, link) => (number, link),
        Counted::Never | Counted::Unreadable => (0, NOTHING.to_owned()),
    };
    let newest = chains(records, NEWEST_DAYS)?.into_iter().flat_map(|day| day.links).max_by_key(|link| link.number);
    Ok(match newest {
        Some(link) if link.number > counted.0 => (link.number, link.link),
        _ => counted,
    })
}

/// What `COUNTER` says.
pub(super) enum Counted {
    /// There is none.
    Never,
    /// Number and link.
    As(u64, String),
    /// It is empty, or holds something else.
    Unreadable,
}

/// Reads the counter as far as it can be read.
pub(super) fn counted(records: &Path) -> Result<Counted, StoreError> {
    Ok(match counter(records) {
        Ok(None) => Counted::Never,
        Ok(Some((number, link))) => Counted::As(number, link),
        Err(StoreError::File { source, .. }) if source.kind() == io::ErrorKind::InvalidData => Counted::Unreadable,
        Err(error) => return Err(error),
    })
}
