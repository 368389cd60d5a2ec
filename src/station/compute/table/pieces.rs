//! Cuts a file into pieces of whole lines.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::{LONGEST_LINE, TableError};

/// Bytes of a piece: enough work for a thread, and some pieces fit into a processor's cache.
pub(super) const PIECE: usize = 1 << 20;

/// Reads a source and cuts it after line ends.
pub(super) struct Pieces {
    path: PathBuf,
    source: Box<dyn Read>,
    /// Bytes of a piece.
    size: usize,
    /// Beginning of a line whose end is not read yet.
    carry: Vec<u8>,
    ended: bool,
}

impl Pieces {
    pub(super) fn new(path: &Path, source: Box<dyn Read>, size: usize) -> Self {
        Self { path: path.to_owned(), source, size, carry: Vec::new(), ended: false }
    }

    /// Whether the last piece was returned.
    pub(super) fn ended(&self) -> bool {
        self.ended && self.carry.is_empty()
    }

    /// The next piece, in the given buffer; `None` after the last one.
    pub(super) fn next(&mut self, mut buffer: Vec<u8>) -> Result<Option<Vec<u8>>, TableError> {
        buffer.clear();
        buffer.append(&mut self.carry);
        loop {
            let before = buffer.len();
            if !self.ended {
                self.fill(&mut buffer)?;
            }
            if let Some(end) = memchr::memrchr(b'\n', &buffer[before..]) {
                self.carry.extend_from_slice(&buffer[before + end + 1..]);
                buffer.truncate(before + end + 1);
                return Ok(Some(buffer));
            }
            if self.ended {
                return Ok((!buffer.is_empty()).then_some(buffer));
            }
            // The row number of such a line is unknown: the file may not be text at all.
            if buffer.len() > LONGEST_LINE {
                return Err(TableError::Endless { path: self.path.clone() });
            }
        }
    }

    /// Appends at most one piece.
    fn fill(&mut self, buffer: &mut Vec<u8>) -> Result<(), TableError> {
        // Reserve first, so that the buffer grows by no more; the room need not be cleared before the read.
        buffer.reserve(self.size);
        let mut piece = self.source.by_ref().take(self.size as u64);
        let got = piece.read_to_end(buffer).map_err(|source| TableError::Io { path: self.path.clone(), source })?;
        self.ended = got < self.size;
        Ok(())
    }
}
