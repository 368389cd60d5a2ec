//! What the journal says of the raw files of a run. While a run has no end, nothing else covers them: a file that is exchanged
//! before the next start has other bytes than those that the journal names.
//!
//! Each line about a file also has the digest of all lines before it, and where the station has a key, its signature. So with
//! the key, what was measured before a capture cannot be edited either.

use std::collections::{BTreeMap, HashMap};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use gnc_executive::event::{CapturedSamples, Event, EventKind};
use gnc_executive::journal::JournalLines;
use sha2::{Digest as _, Sha256};

use super::reader::{ReadError, open_journal};
use super::unread::says_nothing;
use super::{JOURNAL, PublicKey, StoreError, digest};

/// What each line about a raw file has near its beginning. The journal is long, and most of it need not be taken apart.
const MARK: &[u8] = b"\"kind\":\"captured\"";
/// Bytes of a line in which its kind stands: number and times come before it.
const HEAD: usize = 256;

/// The raw files of a run, as its journal names them.
#[derive(Debug, Clone, Default)]
pub(crate) struct CapturedFiles(BTreeMap<String, CapturedFile>);

/// The last line about a raw file.
#[derive(Debug, Clone)]
pub(crate) struct CapturedFile {
    said: CapturedSamples,
    /// Whether the lines before it are those that the line names.
    is_tied: bool,
}

/// What is not as the journal of a run says it, a sentence each; nothing if the journal cannot be read.
///
/// # Errors
/// A file could not be read just then: nothing is known of it, and a later look finds more.
pub(super) fn unlike(run: &Path) -> Result<Vec<String>, StoreError> {
    let Ok(captured) = CapturedFiles::read(run) else { return Ok(Vec::new()) };
    let (problems, unread) = captured.unlike(run, &HashMap::new());
    unread.into_iter().next().map_or(Ok(problems), Err)
}

impl CapturedFiles {
    /// Reads the journal of a run as far as it goes; a fold must have found it good.
    ///
    /// # Errors
    /// The journal cannot be read.
    pub(crate) fn read(run: &Path) -> Result<Self, ReadError> {
        let path = run.join(JOURNAL);
        let mut lines = JournalLines::new(open_journal(&path)?);
        let (mut before, mut files) = (Sha256::new(), BTreeMap::new());
        while let Some(line) = lines.next_line().map_err(|error| ReadError::of_fold(path.clone(), error))? {
            let head = &line.bytes[..line.bytes.len().min(HEAD)];
            if head.windows(MARK.len()).any(|part| part == MARK)
                && let Ok(Event { kind: EventKind::Captured(said), .. }) = serde_json::from_slice(line.bytes)
            {
                let is_tied = said.journal_sha256 == digest::hexadecimal(&before.clone().finalize());
                files.insert(said.file.clone(), CapturedFile { said, is_tied });
            }
            before.update(line.bytes);
        }
        Ok(Self(files))
    }

    /// Whether the journal names no raw file: it captured nothing, or an earlier version wrote it.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// What is said of a file, by its path relative to the folder of the run.
    pub(crate) fn of(&self, file: &str) -> Option<&CapturedFile> {
        self.0.get(file)
    }

    /// The files that are named, by their paths relative to the folder of the run.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// Whether lines before one of these lines were changed after it was written.
    pub(super) fn has_edited_lines(&self) -> bool {
        self.0.values().any(|captured| !captured.is_tied)
    }

    /// What is not as the journal says it, a sentence each, and what could not be read. `known` are digests of whole files that were
    /// read before.
    pub(super) fn unlike(&self, run: &Path, known: &HashMap<PathBuf, String>) -> (Vec<String>, Vec<StoreError>) {
        let (mut problems, mut unread) = (Vec::new(), Vec::new());
        for (file, captured) in &self.0 {
            let name = Path::new(file);
            let CapturedSamples { bytes, sha256, .. } = &captured.said;
            let length = run.join(name).symlink_metadata().map_or(0, |meta| meta.len());
            let is_known = known.get(name).is_some_and(|known| length == *bytes && known == sha256);
            if is_known {
                continue;
            }
            let held = gnc_files::below(run, name).and_then(|found| digest_of(&mut found.take(*bytes)));
            let unlike = match held {
                Ok(held) => captured.unlike(&held),
                Err(source) if says_nothing(&source) => {
                    unread.push(StoreError::File { what: "read", path: run.join(name), source });
                    None
                }
                Err(error) if error.kind() == io::ErrorKind::NotFound => Some(captured.missing()),
                Err(error) => Some(format!("{} cannot be read: {error}", captured.shown())),
            };
            problems.extend(unlike);
        }
        // An edited line is behind all that follow.
        problems.extend(self.0.values().find(|captured| !captured.is_tied).map(CapturedFile::untied));
        (problems, unread)
    }

    /// The lines about files that none of these keys signed, a sentence each.
    pub(crate) fn unsigned(&self, keys: &[PublicKey]) -> Vec<String> {
        let unsigned = self.0.values().filter(|captured| !captured.is_signed_by(keys));
        unsigned
            .map(|captured| {
                format!("the line of the journal that says what {} holds is not signed with this key", captured.shown())
            })
            .collect()
    }
}

impl CapturedFile {
    /// Number of bytes of the file that are named.
    pub(crate) fn bytes(&self) -> u64 {
        self.said.bytes
    }

    /// Whether one of these keys signed the line.
    pub(crate) fn is_signed_by(&self, keys: &[PublicKey]) -> bool {
        let signature = self.said.signature.as_deref().and_then(digest::bytes_of);
        let text = self.said.signed_text();
        signature.is_some_and(|signature| keys.iter().any(|key| key.signed(text.as_bytes(), &signature)))
    }

    /// Why nothing of the file may be used, if what it holds is this, and the line must be signed with this key.
    pub(crate) fn doubt(&self, held: &HeldBytes, key: Option<&PublicKey>) -> Option<String> {
        let is_signed = key.is_none_or(|key| self.is_signed_by(std::slice::from_ref(key)));
        match self.unlike(held) {
            Some(unlike) => Some(unlike),
            None if !self.is_tied => Some(self.untied()),
            None if !is_signed => Some(format!(
                "the line of the journal that says what {} holds is not signed with the key of this station",
                self.shown()
            )),
            None => None,
        }
    }

    /// Whether the bytes are not those that the line names.
    pub(super) fn differs_from(&self, held: &HeldBytes) -> bool {
        held.bytes != self.said.bytes || held.sha256 != self.said.sha256
    }

    /// The sentence about a file that is gone.
    pub(crate) fn missing(&self) -> String {
        format!("{} is missing, and the journal says that it was captured", self.shown())
    }

    fn unlike(&self, held: &HeldBytes) -> Option<String> {
        let CapturedSamples { bytes, sha256, .. } = &self.said;
        if held.bytes < *bytes {
            let has = held.bytes;
            return Some(format!(
                "{} is not the one that was captured: it has {has} bytes, and the journal says what its first {bytes} are",
                self.shown()
            ));
        }
        (held.sha256 != *sha256).then(|| {
            format!(
                "{} is not the one that was captured: its first {bytes} bytes have another SHA-256 than the journal says",
                self.shown()
            )
        })
    }

    fn untied(&self) -> String {
        format!("the journal was changed before its line that says what {} holds", self.shown())
    }

    fn shown(&self) -> String {
        gnc_text::shown_path(Path::new(&self.said.file))
    }
}

/// Bytes that were read, and their SHA-256 as hexadecimal digits.
#[derive(Debug)]
pub(crate) struct HeldBytes {
    pub(crate) bytes: u64,
    pub(crate) sha256: String,
}

fn digest_of(source: &mut impl Read) -> io::Result<HeldBytes> {
    let mut reader = Digested::new(source);
    io::copy(&mut reader, &mut io::sink())?;
    Ok(reader.held())
}

/// Digests what is read.
pub(crate) struct Digested<R> {
    source: R,
    bytes: u64,
    hasher: Sha256,
    /// How many bytes have a digest of their own, and what they are once they were read.
    first: Option<(u64, Option<HeldBytes>)>,
}

impl<R: Read> Digested<R> {
    pub(crate) fn new(source: R) -> Self {
        Self { source, bytes: 0, hasher: Sha256::new(), first: None }
    }

    /// The same, and the digest of the first bytes besides.
    pub(super) fn with_first(source: R, bytes: Option<u64>) -> Self {
        Self { first: bytes.map(|bytes| (bytes, None)), ..Self::new(source) }
    }

    /// What was read.
    pub(crate) fn held(self) -> HeldBytes {
        self.both().0
    }

    /// What was read, and its first bytes if there were as many.
    pub(super) fn both(self) -> (HeldBytes, Option<HeldBytes>) {
        let whole = HeldBytes { bytes: self.bytes, sha256: digest::hexadecimal(&self.hasher.finalize()) };
        (whole, self.first.and_then(|(_, held)| held))
    }

    fn take_in(&mut self, read: &[u8]) {
        self.hasher.update(read);
        self.bytes += read.len() as u64;
    }
}

impl<R: Read> Read for Digested<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.source.read(buffer)?;
        let mut rest = &buffer[..read];
        if let Some((bytes, None)) = self.first
            && let Ok(until) = usize::try_from(bytes - self.bytes)
            && let Some((first, behind)) = rest.split_at_checked(until)
        {
            self.take_in(first);
            let sha256 = digest::hexadecimal(&self.hasher.clone().finalize());
            self.first = Some((bytes, Some(HeldBytes { bytes, sha256 })));
            rest = behind;
        }
        self.take_in(rest);
        Ok(read)
    }
}

#[cfg(test)]
mod tests;
