//! SHA-256 of files and plans.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

use super::{DIGESTS, SIGNATURE, StoreError, on};

/// Hexadecimal digits of a SHA-256.
#[must_use]
pub fn hexadecimal(digest: &[u8]) -> String {
    use std::fmt::Write as _;
    digest.iter().fold(String::with_capacity(64), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// Digest of a plan with all that it includes: of each file its name's length, name, text's length and text, so that
/// nothing can move from one to the other.
pub fn of_plan<'a>(files: impl Iterator<Item = (&'a str, &'a [u8])>) -> String {
    let mut hasher = Sha256::new();
    for (name, text) in files {
        // The folder in which a plan lies is no part of it.
        let name = Path::new(name).file_name().map_or(name.as_bytes(), |name| name.as_encoded_bytes());
        for part in [name, text] {
            hasher.update((part.len() as u64).to_le_bytes());
            hasher.update(part);
        }
    }
    hexadecimal(&hasher.finalize())
}

/// Digest of a file.
///
/// # Errors
/// [`StoreError::File`].
pub fn of_file(path: &Path) -> Result<String, StoreError> {
    let mut hasher = Sha256::new();
    let mut file = on(File::open(path), "read", path)?;
    on(io::copy(&mut file, &mut HashWriter(&mut hasher)), "read", path)?;
    Ok(hexadecimal(&hasher.finalize()))
}

struct HashWriter<'a>(&'a mut Sha256);

impl io::Write for HashWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// All files below a run's folder but the list of digests itself and its signature, as sorted relative paths.
///
/// # Errors
/// [`StoreError::File`].
pub fn files_below(folder: &Path) -> Result<Vec<PathBuf>, StoreError> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(dir) = folders.pop() {
        for entry in on(fs::read_dir(&dir), "read", &dir)? {
            let path = on(entry, "read", &dir)?.path();
            // Links are not followed: a record holds its own files.
            if on(path.symlink_metadata(), "read", &path)?.is_dir() {
                folders.push(path);
            } else if let Ok(relative) = path.strip_prefix(folder)
                && ![Path::new(DIGESTS), Path::new(SIGNATURE)].contains(&relative)
            {
                files.push(relative.to_owned());
            }
        }
    }
    files.sort();
    Ok(files)
}

/// The list of digests of a folder, in the form of `sha256sum`.
///
/// # Errors
/// [`StoreError::File`].
pub fn list(folder: &Path) -> Result<String, StoreError> {
    let mut text = String::new();
    for file in files_below(folder)? {
        text.push_str(&of_file(&folder.join(&file))?);
        text.push_str("  ");
        text.push_str(&file.to_string_lossy());
        text.push('\n');
    }
    Ok(text)
}
