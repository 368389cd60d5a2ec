//! SHA-256 of files and plans.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

use super::{DIGESTS, PAPERS, SIGNATURE, StoreError, Unread, on};

/// Longest list of digests: 20,000 items of a plan with some files each, and two hundred bytes for each.
pub(crate) const MAX_DIGESTS_BYTES: u64 = 64 << 20;

/// A SHA-256 as hexadecimal digits.
#[must_use]
pub(crate) fn hexadecimal(digest: &[u8]) -> String {
    use std::fmt::Write as _;
    digest.iter().fold(String::with_capacity(64), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// The bytes of hexadecimal digits; `None` if they are none.
#[must_use]
pub(crate) fn bytes_of(digits: &str) -> Option<Vec<u8>> {
    let digit = |byte: u8| char::from(byte).to_digit(16).and_then(|digit| u8::try_from(digit).ok());
    digits.as_bytes().chunks(2).map(|pair| Some(digit(*pair.first()?)? << 4 | digit(*pair.get(1)?)?)).collect()
}

/// Digest of a plan with all that it includes. It covers the length of the name, name, length of the text and text of
/// each file, so that bytes cannot move from one to the other.
pub fn of_plan<'a>(files: impl Iterator<Item = (&'a str, &'a [u8])>) -> String {
    let mut hasher = Sha256::new();
    for (name, text) in files {
        // The folder of the plan does not count.
        let name = Path::new(name).file_name().map_or(name.as_bytes(), |name| name.as_encoded_bytes());
        for part in [name, text] {
            hasher.update((part.len() as u64).to_le_bytes());
            hasher.update(part);
        }
    }
    hexadecimal(&hasher.finalize())
}

/// Digest of bytes.
#[must_use]
pub fn of_bytes(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

/// Digest of a file.
///
/// # Errors
/// [`StoreError::File`].
pub fn of_file(path: &Path) -> Result<String, StoreError> {
    of_reader(on(gnc_files::own(path), "read", path)?, path)
}

/// Digest of a file that holds at most so many bytes. Of a longer one nothing is read.
///
/// # Errors
/// [`StoreError::File`].
pub(crate) fn of_file_within(path: &Path, limit: u64) -> Result<String, StoreError> {
    let file = on(gnc_files::own(path), "read", path)?;
    if on(file.metadata(), "read", path)?.len() > limit {
        return on(Err(gnc_files::Refused::TooLong { limit }.into()), "read", path);
    }
    of_reader(file, path)
}

/// Digest of an open file, which errors call by its path.
pub(crate) fn of_reader(mut file: File, path: &Path) -> Result<String, StoreError> {
    let mut hasher = Sha256::new();
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

/// All files below a run's folder except the list of digests and its signature, as sorted relative paths.
///
/// # Errors
/// [`StoreError::File`].
pub(crate) fn files_below(folder: &Path) -> Result<Vec<PathBuf>, StoreError> {
    Ok(below(folder, Err)?.0)
}

/// What stands below a run's folder.
pub(super) struct Below {
    /// As those of [`files_below`].
    pub(super) files: Vec<PathBuf>,
    /// Folders that hold nothing, as sorted relative paths.
    pub(super) empty: Vec<PathBuf>,
    /// What could not be read: it hides nothing of the rest.
    pub(super) unread: Vec<Unread>,
}

/// All that stands below a run's folder, as far as it can be read.
///
/// # Errors
/// As [`files_below`].
pub(super) fn readable_below(folder: &Path) -> Result<Below, StoreError> {
    let mut unread = Vec::new();
    let (files, empty) = below(folder, |error| Unread::of(error).map(|one| unread.push(one)))?;
    Ok(Below { files, empty, unread })
}

/// Takes away the folders below a run's folder that hold nothing: a sudden end came before the first file of an item.
///
/// # Errors
/// [`StoreError::File`].
pub(super) fn remove_empty(folder: &Path) -> Result<(), StoreError> {
    for empty in below(folder, Err)?.1.into_iter().map(|empty| folder.join(empty)) {
        on(fs::remove_dir(&empty), "remove", &empty)?;
    }
    Ok(())
}

/// Files, and folders that hold nothing.
fn below(
    folder: &Path,
    mut leave_out: impl FnMut(StoreError) -> Result<(), StoreError>,
) -> Result<(Vec<PathBuf>, Vec<PathBuf>), StoreError> {
    let (mut files, mut empty) = (Vec::new(), Vec::new());
    let mut folders = vec![folder.to_owned()];
    while let Some(dir) = folders.pop() {
        let read = fs::read_dir(&dir).and_then(Iterator::collect::<io::Result<Vec<_>>>);
        let entries = match on(read, "read", &dir) {
            Ok(entries) => entries,
            Err(error) => {
                leave_out(error)?;
                continue;
            }
        };
        if entries.is_empty() && dir != folder {
            empty.extend(dir.strip_prefix(folder).map(Path::to_owned));
        }
        for path in entries.into_iter().map(|entry| entry.path()) {
            // Links are not followed: a record holds its own files.
            let meta = match on(path.symlink_metadata(), "read", &path) {
                Ok(meta) => meta,
                Err(error) => {
                    leave_out(error)?;
                    continue;
                }
            };
            if meta.is_dir() {
                folders.push(path);
            } else if let Ok(relative) = path.strip_prefix(folder)
                && ![Path::new(DIGESTS), Path::new(SIGNATURE)].contains(&relative)
            {
                files.push(relative.to_owned());
            }
        }
    }
    files.sort();
    empty.sort();
    Ok((files, empty))
}

/// Digests of the files of a run's folder, by their relative paths: the content of `SHA256SUMS`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct FileDigests(BTreeMap<PathBuf, String>);

impl FileDigests {
    /// Adds all files of a folder that are not yet included.
    ///
    /// # Errors
    /// [`StoreError::File`].
    #[cfg(test)]
    pub(crate) fn add_new(&mut self, folder: &Path) -> Result<(), StoreError> {
        self.add_those(folder, |_| true)
    }

    /// Adds the digest of a file.
    pub(super) fn insert(&mut self, file: &str, digest: String) {
        self.0.insert(PathBuf::from(file), digest);
    }

    /// Adds those files of a folder that belong to it and are not yet included. Raw samples are large, so they are read once.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub(super) fn add_those(&mut self, folder: &Path, belongs: impl Fn(&Path) -> bool) -> Result<(), StoreError> {
        for file in files_below(folder)?.into_iter().filter(|file| belongs(file)) {
            if let Entry::Vacant(vacant) = self.0.entry(file) {
                let digest = of_file(&folder.join(vacant.key()))?;
                vacant.insert(digest);
            }
        }
        Ok(())
    }

    /// Reads the digests of a closed folder. Invalid lines are left out and counted.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn read(folder: &Path) -> Result<(Self, usize), StoreError> {
        let path = folder.join(DIGESTS);
        let text = on(gnc_files::read_below(folder, Path::new(DIGESTS), MAX_DIGESTS_BYTES), "read", &path)?;
        let (mut sums, mut bad) = (BTreeMap::new(), 0);
        for line in String::from_utf8_lossy(&text).lines() {
            match line.split_once("  ") {
                Some((digest, file)) if digest.len() == 64 => {
                    sums.insert(PathBuf::from(file), digest.to_owned());
                }
                _ => bad += 1,
            }
        }
        Ok((Self(sums), bad))
    }

    /// The text in the form of `sha256sum`, sorted by path.
    #[must_use]
    pub(crate) fn text(&self) -> String {
        Self::lines(self.0.iter())
    }

    /// The record digest in a passport: the digest of the lines of all files except the papers that name it, so that it
    /// covers journal, plan and raw samples.
    /// `grep -vE '  (passport.json|passport.xml|report.html)$' SHA256SUMS | sha256sum` gives the same digest.
    #[must_use]
    pub fn of_record(&self) -> String {
        let is_paper = |file: &Path| PAPERS.iter().any(|paper| file == Path::new(paper));
        let mut hasher = Sha256::new();
        let files = self.0.iter().filter(|(file, _)| !is_paper(file));
        files.for_each(|(file, digest)| hasher.update(Self::line(file, digest)));
        hexadecimal(&hasher.finalize())
    }

    /// The digest of one file.
    #[must_use]
    pub fn get(&self, file: &str) -> Option<&str> {
        self.0.get(Path::new(file)).map(String::as_str)
    }

    /// The map of files and their digests.
    #[must_use]
    pub(crate) fn into_map(self) -> BTreeMap<PathBuf, String> {
        self.0
    }

    fn lines<'s>(sums: impl Iterator<Item = (&'s PathBuf, &'s String)>) -> String {
        sums.map(|(file, digest)| Self::line(file, digest)).collect()
    }

    fn line(file: &Path, digest: &str) -> String {
        format!("{digest}  {}\n", file.display())
    }
}

/// Digests what is written on its way to a file: what stands there later may have been exchanged.
pub(crate) struct Digesting<'a> {
    out: &'a mut dyn Write,
    hasher: Sha256,
}

impl<'a> Digesting<'a> {
    pub(crate) fn new(out: &'a mut dyn Write) -> Self {
        Self { out, hasher: Sha256::new() }
    }

    /// The digest of what was written.
    pub(crate) fn digest(self) -> String {
        hexadecimal(&self.hasher.finalize())
    }
}

impl Write for Digesting<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.hasher.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hole of 2 GB in the place of a short file costs nothing, and the bound itself is within it.
    #[test]
    fn a_file_beyond_its_bound_is_refused_by_its_size() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.json");
        fs::write(&path, "abc").unwrap();
        assert_eq!(of_file_within(&path, 3).unwrap(), of_bytes(b"abc"));
        let refused = |limit: u64| {
            let error = of_file_within(&path, limit).unwrap_err();
            assert!(gnc_text::with_causes(&error).contains(&format!("it has more than {limit} bytes")), "{error}");
        };
        refused(2);
        File::options().write(true).open(&path).unwrap().set_len(2 << 30).unwrap();
        refused(3);
    }
}
