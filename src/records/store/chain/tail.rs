//! The end of a chain whose last line lacks its end. A sudden end leaves half a line, which would swallow the next one. A whole line
//! that lost its end alone is no half line, and is not taken for one: a person can take the end away, and the station must not
//! remove a run's line for that.

use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::Path;

use super::append::{Counted, counted};
use super::entry::ChainEntry;
use super::read::{MAX_CHAIN_BYTES, chains};
use super::{CHAIN, NOTHING};
use crate::store::folder::sync_dir;
use crate::store::{StoreError, on};

/// Where the bytes of half lines are kept, beside the chain: they may be what is left of a line that a person broke.
pub(super) const TORN: &str = "CHAIN.torn";

/// Hexadecimal digits of a signature.
const SIGNATURE_DIGITS: usize = 128;

/// What was done with the end of a chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Tail {
    /// Nothing: it ends with a line.
    Whole,
    /// The last line has its end again.
    Completed,
    /// Half a line, which is kept beside the chain.
    Kept,
    /// Bytes that say nothing.
    Removed,
}

/// Whether a chain ends with a whole line; `None` if there is none, or an empty one.
pub(super) fn ends_in_a_line(chain: &Path) -> io::Result<Option<bool>> {
    let mut file = match gnc_files::own(chain) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        opened => opened?,
    };
    if file.metadata()?.len() == 0 {
        return Ok(None);
    }
    let mut last = [0];
    file.seek(SeekFrom::End(-1))?;
    file.read_exact(&mut last)?;
    Ok(Some(last == *b"\n"))
}

/// Gives the chain of a day a whole line at its end. The caller holds the lock.
pub(super) fn mend(records: &Path, day: &str) -> Result<Tail, StoreError> {
    let chain = records.join(day).join(CHAIN);
    if on(ends_in_a_line(&chain), "read", &chain)? != Some(false) {
        return Ok(Tail::Whole);
    }
    let bytes = gnc_files::read_below(records, &Path::new(day).join(CHAIN), MAX_CHAIN_BYTES);
    let bytes = on(bytes, "read", &chain)?;
    let whole = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last + 1);
    let tail = &bytes[whole..];
    let mut file = on(gnc_files::append(&chain), "write", &chain)?;
    if is_a_line_of(records, day, tail)? {
        on(file.write_all(b"\n").and_then(|()| file.sync_all()), "write", &chain)?;
        return Ok(Tail::Completed);
    }
    let is_kept = tail.iter().any(|byte| *byte != 0);
    if is_kept {
        let torn = records.join(day).join(TORN);
        let mut kept = on(gnc_files::append(&torn), "write", &torn)?;
        on(kept.write_all(&[tail, b"\n"].concat()).and_then(|()| kept.sync_all()), "write", &torn)?;
        sync_dir(&records.join(day))?;
    }
    on(file.set_len(whole as u64).and_then(|()| file.sync_all()), "write", &chain)?;
    Ok(if is_kept { Tail::Kept } else { Tail::Removed })
}

/// Whether the bytes are a line of this chain as it was written, in its place: behind the line before it, and before the next one.
fn is_a_line_of(records: &Path, day: &str, tail: &[u8]) -> Result<bool, StoreError> {
    let line = std::str::from_utf8(tail).ok().and_then(ChainEntry::parse);
    let Some(line) = line.filter(|line| line.is_true() && line.day() == day) else { return Ok(false) };
    let lines: Vec<ChainEntry> = chains(records, usize::MAX)?.into_iter().flat_map(|day| day.lines).collect();
    let counted = match counted(records)? {
        Counted::As(place) => Some(place),
        Counted::Never | Counted::Unreadable => None,
    };
    let numbered = |number: Option<u64>| lines.iter().find(|other| Some(other.number) == number);
    let before = line.number.checked_sub(1);
    let follows = line.number == 1 && line.before == NOTHING
        || numbered(before).is_some_and(|earlier| earlier.link == line.before)
        || counted.as_ref().is_some_and(|place| Some(place.number) == before && place.link == line.before);
    let next = numbered(line.number.checked_add(1));
    let is_counted = counted.is_some_and(|place| place == line.place());
    // The link does not cover the signature: a line that was cut within it or before it is half a line.
    let is_whole = match &line.signature {
        Some(signature) => signature.len() == SIGNATURE_DIGITS,
        None => is_counted || next.is_some() || lines.iter().all(|other| other.signature.is_none()),
    };
    let fits = next.is_none_or(|next| next.before == line.link) && numbered(Some(line.number)).is_none();
    // What is counted or has a next line stood in its place, even if the line before it is not here any more.
    Ok(is_whole && fits && (follows || is_counted || next.is_some()))
}
