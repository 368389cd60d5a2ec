//! Counts and digests the bytes of a file while they are written, so that nothing is read again for it.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::sync::{Arc, Mutex, PoisonError};

use sha2::{Digest as _, Sha256};

use super::digest;

/// What a file holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Held {
    /// Number of its bytes.
    pub(super) bytes: u64,
    /// Their SHA-256, as hexadecimal digits.
    pub(super) sha256: String,
}

#[derive(Debug, Default)]
struct Sum {
    bytes: u64,
    hasher: Sha256,
}

/// A new file that is only written to its end.
#[derive(Debug, Clone)]
pub(super) struct Tallied {
    file: Arc<File>,
    sum: Arc<Mutex<Sum>>,
}

impl Tallied {
    /// The file must be empty.
    pub(super) fn new(file: File) -> Self {
        Self { file: Arc::new(file), sum: Arc::default() }
    }

    /// Waits until all that was written is on disk, and says what that is.
    pub(super) fn held(&self) -> io::Result<Held> {
        self.file.sync_all()?;
        let sum = self.sum.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(Held { bytes: sum.bytes, sha256: digest::hexadecimal(&sum.hasher.clone().finalize()) })
    }
}

impl Write for Tallied {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = (&*self.file).write(bytes)?;
        let mut sum = self.sum.lock().unwrap_or_else(PoisonError::into_inner);
        sum.hasher.update(&bytes[..written]);
        sum.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        (&*self.file).flush()
    }
}

/// It tells where it is, and goes nowhere else: what was digested stays as it is.
impl Seek for Tallied {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.sum.lock().unwrap_or_else(PoisonError::into_inner).bytes),
            _ => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}
