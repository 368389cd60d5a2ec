//! Files that are either complete or absent.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

use nix::fcntl::OFlag;

/// Name ending of a file that is not completely written.
pub const PART: &str = "part";

/// A file that is being written beside its place, under its name with `.part`. It is removed if it is dropped before it is
/// in its place.
#[derive(Debug)]
pub struct Part {
    file: File,
    part: PathBuf,
    path: PathBuf,
    is_placed: bool,
}

impl Part {
    /// Makes the file. What an earlier writer left under the part's name is removed, if it is a file or a link; the link's
    /// target stays as it is.
    ///
    /// # Errors
    /// The error of the system. A folder in the way is an error.
    pub fn create(path: &Path) -> io::Result<Self> {
        let mut part: OsString = path.as_os_str().to_owned();
        part.push(format!(".{PART}"));
        let part = PathBuf::from(part);
        let create = || {
            let mut options = OpenOptions::new();
            options.write(true).create_new(true).custom_flags(OFlag::O_NOFOLLOW.bits()).open(&part)
        };
        let file = match create() {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                fs::remove_file(&part)?;
                create()?
            }
            created => created?,
        };
        Ok(Self { file, part, path: path.to_owned(), is_placed: false })
    }

    /// The path under which the file is while it is written.
    #[must_use]
    pub fn written_to(&self) -> &Path {
        &self.part
    }

    /// Waits until the content is on disk.
    ///
    /// # Errors
    /// The error of the system.
    pub fn sync(&self) -> io::Result<()> {
        self.file.sync_all()
    }

    /// Leaves the file under the part's name: its writer gives it its name later.
    pub fn leave(mut self) {
        self.is_placed = true;
    }

    /// Gives the file its name. What has the name is replaced; a link there is replaced, too, and not followed.
    ///
    /// # Errors
    /// The error of the system.
    pub fn place(mut self) -> io::Result<()> {
        fs::rename(&self.part, &self.path)?;
        self.is_placed = true;
        Ok(())
    }
}

impl Write for Part {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        if !self.is_placed {
            // On a full disk the part would be in the way. The reported error is that of the write.
            let _ = fs::remove_file(&self.part);
        }
    }
}

/// Writes a file that a person named: complete under its name, or not there. The file of a link is replaced, not the link.
/// A pipe, a terminal or another device is written to as it is, and so is a standard stream of this program by its name in `/dev` or
/// `/proc`: behind what is in it, if it is a file.
///
/// # Errors
/// The error of the system.
pub fn put(path: &Path, bytes: &[u8]) -> io::Result<()> {
    match path.metadata() {
        Ok(meta) if meta.is_dir() => Err(crate::Refused::Folder.into()),
        Ok(meta) if is_stream(path) || !meta.is_file() => {
            let mut options = OpenOptions::new();
            let options = if meta.is_file() { options.append(true) } else { options.write(true) };
            let mut stream = options.custom_flags(OFlag::O_NOCTTY.bits()).open(path)?;
            stream.write_all(bytes)?;
            stream.flush()
        }
        _ => {
            let place = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
            let mut part = Part::create(&place)?;
            part.write_all(bytes)?;
            part.sync()?;
            part.place()
        }
    }
}

/// Whether a path names a stream that a program has open. A file elsewhere below `/dev`, as in `/dev/shm`, is a file like all others.
fn is_stream(path: &Path) -> bool {
    let Some(path) = path.to_str() else { return false };
    let is_open = |of: &str| of.split_once("/fd/").is_some_and(|(process, _)| !process.contains('/'));
    matches!(path, "/dev/stdin" | "/dev/stdout" | "/dev/stderr")
        || path.starts_with("/dev/fd/")
        || path.strip_prefix("/proc/").is_some_and(is_open)
}

/// Opens a regular file to append to, and makes it if it is not there. A link in its place is refused, and a pipe does not wait for
/// its reader.
///
/// # Errors
/// The error of the system; [`crate::Refused`] within it for what is not a regular file.
pub fn append(path: &Path) -> io::Result<File> {
    let flags = OFlag::O_NOFOLLOW | OFlag::O_NONBLOCK | OFlag::O_NOCTTY;
    let opened = OpenOptions::new().create(true).read(true).append(true).custom_flags(flags.bits()).open(path);
    if crate::open::is_lent(&opened) {
        let look = OFlag::O_PATH | OFlag::O_NOFOLLOW;
        let looked = OpenOptions::new().read(true).custom_flags(look.bits()).open(path)?;
        return crate::open::when_given_back(looked, OpenOptions::new().read(true).append(true));
    }
    crate::open::regular(opened.map_err(|error| match path.symlink_metadata() {
        Ok(meta) if meta.is_symlink() => crate::Refused::Link.into(),
        _ => error,
    })?)
}

/// Makes a file for writing that is not there yet; a link of its name is in the way, too.
///
/// # Errors
/// The error of the system.
pub fn create_new(path: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).create_new(true).open(path)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn a_file_is_complete_or_absent() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let mut part = Part::create(&path).unwrap();
        part.write_all(b"half").unwrap();
        assert!(!path.exists() && part.written_to().exists());
        drop(part);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        fs::write(folder.path().join("file.part"), "of one that was killed").unwrap();
        let mut part = Part::create(&path).unwrap();
        part.write_all(b"whole").unwrap();
        part.sync().unwrap();
        part.place().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"whole");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    /// `--plot /dev/stdout` and a pipe to another program are of use; a link to the file of yesterday stays a link.
    #[test]
    fn what_a_person_named_is_written() {
        use std::io::Read as _;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("real"), "old and longer").unwrap();
        symlink("real", at("link")).unwrap();
        put(&at("link"), b"new").unwrap();
        assert_eq!(fs::read(at("real")).unwrap(), b"new");
        assert!(at("link").is_symlink());
        put(&at("fresh"), b"new").unwrap();
        put(Path::new("/dev/null"), b"gone").unwrap();
        nix::unistd::mkfifo(&at("pipe"), nix::sys::stat::Mode::S_IRWXU).unwrap();
        let mut reader = OpenOptions::new().read(true).custom_flags(OFlag::O_NONBLOCK.bits()).open(at("pipe")).unwrap();
        put(&at("pipe"), b"through").unwrap();
        let mut read = Vec::new();
        reader.read_to_end(&mut read).unwrap();
        assert_eq!(read, b"through");
        assert!(put(folder.path(), b"").is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 4, "no part is left");
        symlink("nowhere", at("dangling")).unwrap();
        assert!(create_new(&at("dangling")).is_err());
    }

    /// A file in `/dev/shm` is a file; a stream that is a file gets what is written behind what it has.
    #[test]
    fn a_file_in_memory_keeps_nothing_of_the_file_before() {
        let folder = tempfile::tempdir_in("/dev/shm").unwrap();
        let path = folder.path().join("plot.svg");
        fs::write(&path, "old and longer").unwrap();
        put(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        let stream = OpenOptions::new().write(true).open(&path).unwrap();
        use std::os::fd::AsRawFd as _;
        put(Path::new(&format!("/proc/self/fd/{}", stream.as_raw_fd())), b" and more").unwrap();
        put(Path::new(&format!("/dev/fd/{}", stream.as_raw_fd())), b" at last").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new and more at last");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn only_a_regular_file_is_appended_to() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for text in ["one ", "two"] {
            append(&at("file")).unwrap().write_all(text.as_bytes()).unwrap();
        }
        assert_eq!(fs::read(at("file")).unwrap(), b"one two");
        symlink("file", at("link")).unwrap();
        symlink("none", at("dangling")).unwrap();
        nix::unistd::mkfifo(&at("pipe"), nix::sys::stat::Mode::S_IRWXU).unwrap();
        let why = |name: &str| append(&at(name)).err().as_ref().and_then(crate::is_refused);
        assert_eq!(why("link"), Some(crate::Refused::Link));
        assert_eq!(why("dangling"), Some(crate::Refused::Link));
        assert_eq!(why("pipe"), Some(crate::Refused::Pipe));
        assert!(append(folder.path()).is_err() && !at("none").exists());
    }

    #[test]
    fn nothing_is_written_behind_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let (path, victim) = (folder.path().join("file"), folder.path().join("victim"));
        fs::write(&victim, "untouched").unwrap();
        symlink("victim", folder.path().join("file.part")).unwrap();
        symlink("victim", &path).unwrap();
        let mut part = Part::create(&path).unwrap();
        part.write_all(b"new").unwrap();
        part.place().unwrap();
        assert_eq!(fs::read(&victim).unwrap(), b"untouched");
        assert!(!path.symlink_metadata().unwrap().is_symlink());
        fs::create_dir(folder.path().join("file.part")).unwrap();
        assert!(Part::create(&path).is_err(), "a folder in the way is the error of its place");
    }
}
