//! Reads with guards.

use std::fs::{File, OpenOptions};
use std::io::{self, Read as _};
use std::os::fd::AsRawFd as _;
use std::os::unix::fs::{FileTypeExt as _, OpenOptionsExt as _};
use std::path::{Component, Path};

use nix::fcntl::{OFlag, openat};
use nix::sys::stat::Mode;

/// Why a file is refused before its content counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// A pipe would wait for its writer.
    #[error("it is a pipe, not a file")]
    Pipe,
    /// A device has no end.
    #[error("it is a device, not a file")]
    Device,
    /// A socket of another program.
    #[error("it is a socket, not a file")]
    Socket,
    /// A folder.
    #[error("it is a folder, not a file")]
    Folder,
    /// The file, or a folder on the way to it, is a link, which may lead anywhere.
    #[error("it is a link, or lies behind one")]
    Link,
    /// The file, or a folder on the way to it, is a link that leads back to itself.
    #[error("it is a link that leads in a circle")]
    Circle,
    /// The path leaves the folder below which it must stay.
    #[error("its path leads out of its folder")]
    Outside,
    /// There are more bytes than such a file can have.
    #[error("it has more than {limit} bytes")]
    TooLong {
        /// The bound.
        limit: u64,
    },
}

impl Refused {
    fn kind(self) -> io::ErrorKind {
        match self {
            Self::Folder => io::ErrorKind::IsADirectory,
            Self::TooLong { .. } => io::ErrorKind::FileTooLarge,
            Self::Pipe | Self::Device | Self::Socket | Self::Link | Self::Circle | Self::Outside => {
                io::ErrorKind::InvalidInput
            }
        }
    }
}

impl From<Refused> for io::Error {
    fn from(refused: Refused) -> Self {
        Self::new(refused.kind(), refused)
    }
}

/// The guard that refused a file, if an error is of one.
#[must_use]
pub fn is_refused(error: &io::Error) -> Option<Refused> {
    error.get_ref()?.downcast_ref::<Refused>().copied()
}

/// Opens a regular file for reading. Links are followed: the path is that of a person who chose it. It never waits for the
/// other end of a pipe.
///
/// # Errors
/// The error of the system; [`Refused`] within it for what is not a regular file.
pub fn open(path: &Path) -> io::Result<File> {
    let opened = OpenOptions::new().read(true).custom_flags((OFlag::O_NONBLOCK | OFlag::O_NOCTTY).bits()).open(path);
    if is_lent(&opened) {
        let looked = OpenOptions::new().read(true).custom_flags(OFlag::O_PATH.bits()).open(path)?;
        return when_given_back(looked, OpenOptions::new().read(true));
    }
    // A socket cannot be opened at all.
    regular(opened.map_err(|error| match path.metadata() {
        Ok(meta) if meta.file_type().is_socket() => Refused::Socket.into(),
        _ => in_circle(error),
    })?)
}

/// The error of the system, or that a link leads in a circle: the system counts the links and gives up.
fn in_circle(error: io::Error) -> io::Error {
    if error.raw_os_error() == Some(nix::errno::Errno::ELOOP as i32) { Refused::Circle.into() } else { error }
}

/// Whether a file could not be opened because another computer or program has it on loan (a lease): a file server asks for it back
/// first, and that would be a wait.
pub(crate) fn is_lent(opened: &io::Result<File>) -> bool {
    opened.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::WouldBlock)
}

/// Opens a file that is on loan, as soon as it is given back; the kernel takes it back after `lease-break-time`, 45 s. `looked` is the
/// file itself, opened to be looked at (`O_PATH`), so that nothing that waits for ever can take its place.
pub(crate) fn when_given_back(looked: File, options: &mut OpenOptions) -> io::Result<File> {
    let looked = regular(looked)?;
    let itself = format!("/proc/self/fd/{}", looked.as_raw_fd());
    regular(options.custom_flags(OFlag::O_NOCTTY.bits()).open(itself)?)
}

/// Opens a regular file below a root for reading. Neither the file nor a folder between is a link; the root may be one.
///
/// # Errors
/// As [`open`].
pub fn below(root: &Path, path: &Path) -> io::Result<File> {
    let mut names = Vec::new();
    for part in path.components() {
        match part {
            Component::Normal(name) => names.push(name),
            Component::CurDir => {}
            Component::ParentDir | Component::RootDir | Component::Prefix(_) => return Err(Refused::Outside.into()),
        }
    }
    let Some((file, folders)) = names.split_last() else { return Err(Refused::Folder.into()) };
    let enter = OFlag::O_PATH | OFlag::O_DIRECTORY | OFlag::O_NOFOLLOW | OFlag::O_CLOEXEC;
    let mut at: File =
        OpenOptions::new().read(true).custom_flags((OFlag::O_PATH | OFlag::O_DIRECTORY).bits()).open(root)?;
    for folder in folders {
        let entered = openat(&at, *folder, enter, Mode::empty());
        at = entered.map_err(|error| at_link(&at, folder, error.into()))?.into();
    }
    let flags = OFlag::O_RDONLY | OFlag::O_NOFOLLOW | OFlag::O_NONBLOCK | OFlag::O_NOCTTY | OFlag::O_CLOEXEC;
    let opened = openat(&at, *file, flags, Mode::empty());
    let opened = opened.map_err(|error| at_link(&at, file, error.into())).map(File::from);
    if is_lent(&opened) {
        let look = OFlag::O_PATH | OFlag::O_NOFOLLOW | OFlag::O_CLOEXEC;
        let looked = openat(&at, *file, look, Mode::empty()).map_err(io::Error::from)?;
        return when_given_back(looked.into(), OpenOptions::new().read(true));
    }
    regular(opened?)
}

/// How far the files may lie that another file names.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Reach {
    /// In the folder of that file, or below.
    #[default]
    Folder,
    /// Wherever a person has allowed it.
    Anywhere,
}

/// Opens a regular file that another file names for reading. It lies in `folder` or below. A link is followed as long as it
/// ends there.
///
/// # Errors
/// As [`open`]; [`Refused::Outside`].
pub fn named(folder: &Path, path: &Path, reach: Reach) -> io::Result<File> {
    if reach == Reach::Anywhere {
        return open(path);
    }
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let (root, real) = (here.canonicalize().map_err(in_circle)?, path.canonicalize().map_err(in_circle)?);
    match real.strip_prefix(&root) {
        // A folder on the way may have become a link since; it is not followed.
        Ok(inside) => below(&root, inside),
        Err(_) => Err(Refused::Outside.into()),
    }
}

/// Reads at most the first `limit` bytes of a file as [`named`] opens it.
///
/// # Errors
/// As [`named`].
pub fn named_beginning(folder: &Path, path: &Path, reach: Reach, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    named(folder, path, reach)?.take(limit).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Opens a regular file that is no link itself. The folders on the way are those of the caller.
///
/// # Errors
/// As [`below`].
pub fn own(path: &Path) -> io::Result<File> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
    below(folder, Path::new(path.file_name().unwrap_or_default()))
}

/// The error of an entry that could not be opened: a link in its place, or what the system said.
fn at_link(folder: &File, name: &std::ffi::OsStr, error: io::Error) -> io::Error {
    use nix::sys::stat::{SFlag, fstatat};
    let meta = fstatat(folder, name, nix::fcntl::AtFlags::AT_SYMLINK_NOFOLLOW);
    match meta.map(|meta| SFlag::from_bits_truncate(meta.st_mode) & SFlag::S_IFMT) {
        Ok(SFlag::S_IFLNK) => Refused::Link.into(),
        Ok(SFlag::S_IFSOCK) => Refused::Socket.into(),
        _ => error,
    }
}

/// The file, if it is a regular one.
pub(crate) fn regular(file: File) -> io::Result<File> {
    let kind = file.metadata()?.file_type();
    Err(io::Error::from(if kind.is_file() {
        return Ok(file);
    } else if kind.is_dir() {
        Refused::Folder
    } else if kind.is_symlink() {
        Refused::Link
    } else if kind.is_fifo() {
        Refused::Pipe
    } else if kind.is_socket() {
        Refused::Socket
    } else {
        Refused::Device
    }))
}

/// Reads a regular file of at most `limit` bytes.
///
/// # Errors
/// As [`open`]; [`Refused::TooLong`].
pub fn read(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    whole(open(path)?, limit)
}

/// Reads a regular file of at most `limit` bytes below a root, as [`below`] opens it.
///
/// # Errors
/// As [`below`]; [`Refused::TooLong`].
pub fn read_below(root: &Path, path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    whole(below(root, path)?, limit)
}

/// Reads at most the first `limit` bytes of a regular file.
///
/// # Errors
/// As [`open`].
pub fn read_beginning(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.take(limit).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads a regular file of at most `limit` bytes as text.
///
/// # Errors
/// As [`read`]; the text is not UTF-8.
pub fn text(path: &Path, limit: u64) -> io::Result<String> {
    let bytes = read(path, limit)?;
    String::from_utf8(bytes).map_err(|error| {
        let byte = error.as_bytes().get(error.utf8_error().valid_up_to()).copied().unwrap_or_default();
        io::Error::new(io::ErrorKind::InvalidData, format!("byte 0x{byte:02x} is not UTF-8"))
    })
}

/// Reads the rest of an open file, at most `limit` bytes.
///
/// # Errors
/// The error of the system; [`Refused::TooLong`].
pub fn whole(file: File, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit { Err(Refused::TooLong { limit }.into()) } else { Ok(bytes) }
}

#[cfg(test)]
mod tests;
