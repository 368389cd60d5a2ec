//! The lines of a journal, one at a time.

use std::io::{self, BufRead};

use super::{FoldError, JournalError};

/// Longest line of a journal. The longest that the station writes is the first one, with all items of a plan: 20,000 of them
/// take 6 MB.
pub const LONGEST_LINE: usize = 32 << 20;

/// Reads a journal line by line.
#[derive(Debug)]
pub struct JournalLines<R> {
    source: R,
    line: Vec<u8>,
    number: usize,
    bytes_read: usize,
}

/// A line of a journal.
#[derive(Clone, Copy, Debug)]
pub struct JournalLine<'a> {
    /// Its number, from 1.
    pub number: usize,
    /// Its bytes with the line end. The last line may lack it; the zeros that a file system may leave behind it are not of it.
    pub bytes: &'a [u8],
}

impl<R: BufRead> JournalLines<R> {
    /// The lines of a source, from its beginning.
    pub fn new(source: R) -> Self {
        Self { source, line: Vec::new(), number: 0, bytes_read: 0 }
    }

    /// The next line; `None` behind the last one.
    ///
    /// # Errors
    /// The source cannot be read, or the line is longer than [`LONGEST_LINE`].
    pub fn next_line(&mut self) -> Result<Option<JournalLine<'_>>, FoldError> {
        self.line.clear();
        self.number += 1;
        let number = self.number;
        // Zeros are kept back until something follows them: at the end of the file there may be any number of them.
        let mut zeros = 0_usize;
        loop {
            let piece = match self.source.fill_buf() {
                Ok(piece) => piece,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(FoldError::Read(error)),
            };
            if piece.is_empty() {
                break;
            }
            let end = piece.iter().position(|byte| *byte == b'\n').map(|at| at + 1);
            let piece = &piece[..end.unwrap_or(piece.len())];
            let solid = piece.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
            if solid > 0 {
                if self.line.len().saturating_add(zeros).saturating_add(solid) > LONGEST_LINE {
                    return Err(JournalError::LineTooLong { line: number }.into());
                }
                self.line.resize(self.line.len() + zeros, 0);
                self.line.extend_from_slice(&piece[..solid]);
                zeros = 0;
            }
            zeros = zeros.saturating_add(piece.len() - solid);
            let taken = piece.len();
            self.bytes_read += taken;
            self.source.consume(taken);
            if end.is_some() {
                break;
            }
        }
        Ok((!self.line.is_empty()).then_some(JournalLine { number, bytes: &self.line }))
    }

    /// Bytes that were read so far.
    pub fn bytes_read(&self) -> usize {
        self.bytes_read
    }
}
