//! What could not be read, so that nothing is known of it: no change was found there, and none can be excluded.

use std::io;
use std::path::{Path, PathBuf};

use nix::errno::Errno;

use super::StoreError;
use super::reader::ReadError;

/// A file or folder of the records that could not be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unread {
    /// Its whole path.
    pub path: PathBuf,
    /// That it could not be read and why, a sentence.
    pub why: String,
    /// Whether the user has no right to read it.
    pub lacks_rights: bool,
}

impl Unread {
    pub(crate) fn new(path: &Path, source: io::Error) -> Self {
        let lacks_rights = source.kind() == io::ErrorKind::PermissionDenied;
        let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let error = StoreError::File { what: "read", path: path.to_owned(), source };
        Self { path: whole, why: gnc_text::with_causes(&error), lacks_rights }
    }

    /// The file that an error is about, if the error says nothing of what it holds. Else the error.
    pub(crate) fn of(error: StoreError) -> Result<Self, StoreError> {
        match error {
            StoreError::File { path, source, .. } if says_nothing(&source) => Ok(Self::new(&path, source)),
            error => Err(error),
        }
    }

    /// The same of a journal.
    pub(crate) fn of_read(error: ReadError) -> Result<Self, ReadError> {
        match error {
            ReadError::File { path, source } if says_nothing(&source) => Ok(Self::new(&path, source)),
            error => Err(error),
        }
    }
}

/// Whether an error of the system says nothing of what a file holds: another user, a later time or another computer reads it. Each
/// other error is one of the file, as a person may have left it.
pub(crate) fn says_nothing(error: &io::Error) -> bool {
    let passing = [
        Errno::EACCES,
        Errno::EPERM,
        Errno::EMFILE,
        Errno::ENFILE,
        Errno::ENOMEM,
        Errno::EIO,
        Errno::ESTALE,
        Errno::ETIMEDOUT,
        Errno::ENOTCONN,
        Errno::EHOSTDOWN,
        Errno::EHOSTUNREACH,
    ];
    error.raw_os_error().is_some_and(|code| passing.contains(&Errno::from_raw(code)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What an attacker can make of a file is no reason to call it unread, but for its rights.
    #[test]
    fn only_errors_that_pass_say_nothing() {
        let of = |errno: Errno| says_nothing(&io::Error::from_raw_os_error(errno as i32));
        assert!([Errno::EACCES, Errno::EMFILE, Errno::EIO, Errno::ESTALE].into_iter().all(of));
        assert!(![Errno::ENOENT, Errno::ENOTDIR, Errno::EISDIR, Errno::ELOOP, Errno::ENXIO].into_iter().any(of));
        assert!(!says_nothing(&gnc_files::Refused::Pipe.into()));
    }
}
