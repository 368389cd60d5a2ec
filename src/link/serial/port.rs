//! A serial port: opened for this program alone, at the rate that was asked for. It may go away during a run; the port
//! reports its absences.
//!
//! A port that vanishes reads as "no more bytes" for ever. This means "device gone" and not "no data". The station
//! opens the port again by its name, since udev gives an adapter that was plugged in again another device behind the
//! same link.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use nix::errno::Errno;
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _, ReadHalf, WriteHalf};
use tokio_serial::{SerialPort as _, SerialPortBuilderExt as _, SerialStream};
use tokio_util::bytes::BytesMut;

use super::OpenError;
use crate::absence::Absence;
use crate::doubt::Doubt;
use crate::memory::MemoryPort;

/// Bytes read at once: several times what an adapter passes on in a frame of USB.
const READ_AT_ONCE: usize = 4096;

/// Folder of pseudo-terminals. The system gives a free number to the next program that asks, so the same name may then
/// be another program's terminal. A link to a pseudo-terminal has an owner that moves it.
const PSEUDO_TERMINALS: &str = "/dev/pts";

/// Where a port is.
#[derive(Debug)]
pub(crate) enum PortLocation {
    /// A device of this computer, and its rate.
    Device(PathBuf, u32),
    /// In this program.
    Memory(MemoryPort),
}

/// A stream of bytes in and out.
trait Stream: AsyncRead + AsyncWrite + Send + Unpin + fmt::Debug {}

impl<T: AsyncRead + AsyncWrite + Send + Unpin + fmt::Debug> Stream for T {}

/// The port, its buffers, and whether it is there.
#[derive(Debug)]
pub(crate) struct Port {
    place: PortLocation,
    state: State,
    /// Why the port that was opened first does not prove that a device is at its other end.
    doubt: Option<Doubt>,
    /// Received bytes that were not taken yet.
    pub(crate) incoming: BytesMut,
    /// Bytes to send; the code that fills the buffer bounds it.
    pub(crate) outgoing: BytesMut,
    /// Bytes that have come so far.
    pub(crate) came: u64,
}

#[derive(Debug)]
enum State {
    Open {
        reader: ReadHalf<Box<dyn Stream>>,
        writer: WriteHalf<Box<dyn Stream>>,
        /// The absence from which the port returned, until something comes from it.
        mute: Option<Absence>,
    },
    Away(Absence),
}

/// What happened at a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PortEvent {
    /// Bytes came.
    Read,
    /// Bytes went, so that there is room for more.
    Written,
    /// The port went away. Bytes to send are dropped: half of a frame may be on the line.
    Away,
    /// The port is there again, after this time.
    Back(Duration),
}

enum Moved {
    Written(io::Result<usize>),
    Read(io::Result<usize>),
}

impl Port {
    pub(crate) fn open(place: PortLocation) -> Result<Self, OpenError> {
        let (state, doubt) = place.open(None)?;
        let (incoming, outgoing) = (BytesMut::with_capacity(READ_AT_ONCE), BytesMut::new());
        Ok(Self { place, state, doubt, incoming, outgoing, came: 0 })
    }

    pub(crate) fn rate_baud(&self) -> u32 {
        match &self.place {
            PortLocation::Device(_, rate_baud) => *rate_baud,
            PortLocation::Memory(port) => port.rate_baud(),
        }
    }

    /// The name of the port for people.
    pub(crate) fn name(&self) -> String {
        format!("port {}", self.place)
    }

    pub(crate) fn doubt(&self) -> Option<&Doubt> {
        self.doubt.as_ref()
    }

    /// Whether the port is there, as far as this program knows.
    pub(crate) fn is_there(&self) -> bool {
        matches!(self.state, State::Open { .. })
    }

    /// Moves bytes until something has happened. A caller that drops this wait half way loses nothing. Without `read`
    /// it only writes.
    ///
    /// # Errors
    /// The port did not come back.
    pub(crate) async fn turn(&mut self, read: bool) -> io::Result<PortEvent> {
        loop {
            let (reader, writer) = match &mut self.state {
                State::Open { reader, writer, .. } => (reader, writer),
                State::Away(absence) => {
                    absence.look_due().await;
                    match self.look()? {
                        Some(event) => return Ok(event),
                        None => continue,
                    }
                }
            };
            self.incoming.reserve(READ_AT_ONCE);
            let moved = tokio::select! {
                biased;
                written = writer.write_buf(&mut self.outgoing), if !self.outgoing.is_empty() => Moved::Written(written),
                count = reader.read_buf(&mut self.incoming), if read => Moved::Read(count),
                else => std::future::pending().await,
            };
            match moved {
                Moved::Written(Ok(1..)) => return Ok(PortEvent::Written),
                Moved::Read(Ok(count @ 1..)) => {
                    self.came += count as u64;
                    self.heard();
                    return Ok(PortEvent::Read);
                }
                // The port is gone, whatever error the driver reports.
                Moved::Written(_) | Moved::Read(_) => {
                    if self.went_away()? {
                        return Ok(PortEvent::Away);
                    }
                }
            }
        }
    }

    fn heard(&mut self) {
        if let State::Open { mute, .. } = &mut self.state {
            *mute = None;
        }
    }

    /// Returns `true` if the absence is still unreported.
    fn went_away(&mut self) -> io::Result<bool> {
        let State::Open { mute, .. } = &mut self.state else { return Ok(false) };
        if matches!(&self.place, PortLocation::Device(path, _) if is_pseudo_terminal(path)) {
            let text = format!("{} went away, and a pseudo-terminal does not come back", self.name());
            return Err(io::Error::new(io::ErrorKind::NotConnected, text));
        }
        let absence = Absence::begin(mute.take());
        let is_new = absence.is_new();
        // This closes the descriptor. Otherwise the kernel would give the adapter another name when it is back.
        self.state = State::Away(absence);
        self.outgoing.clear();
        Ok(is_new)
    }

    /// Tries to open the port again.
    fn look(&mut self) -> io::Result<Option<PortEvent>> {
        let State::Away(absence) = &mut self.state else { return Ok(None) };
        match self.place.open(Some(*absence)) {
            Ok((_, Some(doubt))) if self.doubt.is_none() => Err(doubt.on_return()),
            Ok((open, _)) => {
                self.state = open;
                let State::Open { mute: Some(absence), .. } = &mut self.state else { return Ok(None) };
                Ok(absence.returned().map(PortEvent::Back))
            }
            Err(error) => {
                let name = format!("port {}", self.place);
                absence.goes_on(&name, &error).map(|()| None)
            }
        }
    }
}

impl PortLocation {
    /// Opens the port, and looks at what was opened.
    fn open(&self, mute: Option<Absence>) -> Result<(State, Option<Doubt>), OpenError> {
        let (stream, doubt): (Box<dyn Stream>, _) = match self {
            Self::Device(path, rate_baud) => {
                let stream = open_stream(path, *rate_baud)?;
                let doubt = Doubt::of_open_port(path, &stream);
                (Box::new(stream), doubt)
            }
            Self::Memory(port) => {
                (Box::new(port.open().ok_or_else(|| OpenError::Missing { port: port.to_string().into() })?), None)
            }
        };
        let (reader, writer) = tokio::io::split(stream);
        Ok((State::Open { reader, writer, mute }, doubt))
    }
}

impl fmt::Display for PortLocation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Device(path, _) => f.write_str(&gnc_text::shown_path(path)),
            Self::Memory(port) => port.fmt(f),
        }
    }
}

/// Whether this is a pseudo-terminal by its own name, which another program may get.
pub(super) fn is_pseudo_terminal(port: &Path) -> bool {
    port.starts_with(PSEUDO_TERMINALS)
}

/// Opens a port as a link does, and closes it again.
///
/// # Errors
/// [`OpenError`].
pub fn try_open(port: &Path, rate_baud: u32) -> Result<(), OpenError> {
    let port_path = port.to_string_lossy();
    let stream =
        serialport::TTYPort::open(&tokio_serial::new(port_path, rate_baud)).map_err(|source| explain(port, source))?;
    match serialport::SerialPort::baud_rate(&stream).map_err(|source| explain(port, source))? {
        got if got == rate_baud => Ok(()),
        got => Err(OpenError::Rate { port: port.to_owned(), wanted: rate_baud, got }),
    }
}

/// Opens the port for this program alone, and checks the rate that the driver chose.
pub(super) fn open_stream(port: &Path, rate_baud: u32) -> Result<SerialStream, OpenError> {
    let stream = tokio_serial::new(port.to_string_lossy(), rate_baud)
        .open_native_async()
        .map_err(|source| explain(port, source))?;
    let got = stream.baud_rate().map_err(|source| explain(port, source))?;
    if got != rate_baud {
        return Err(OpenError::Rate { port: port.to_owned(), wanted: rate_baud, got });
    }
    Ok(stream)
}

fn explain(port: &Path, source: tokio_serial::Error) -> OpenError {
    use tokio_serial::ErrorKind;
    let port = port.to_owned();
    match source.kind() {
        ErrorKind::Io(io::ErrorKind::NotFound) => OpenError::Missing { port },
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => OpenError::Denied { port },
        ErrorKind::Io(io::ErrorKind::ResourceBusy | io::ErrorKind::WouldBlock) => busy(port),
        ErrorKind::NoDevice => match std::fs::metadata(&port) {
            Err(_) => OpenError::Missing { port },
            Ok(_) => busy(port),
        },
        // The crate keeps no error number, only the text of the error.
        _ if source.description == Errno::ENOTTY.desc()
            || std::fs::metadata(&port).is_ok_and(|meta| !is_device(&meta)) =>
        {
            OpenError::NotAPort { port }
        }
        _ => OpenError::System { port, source },
    }
}

/// Whether another program has locked the port, as the kernel's list of locks tells: without opening the port, which would set its
/// lines and may reset what is at its other end.
#[must_use]
pub fn locked(port: &Path) -> Option<OpenError> {
    holder(port).map(|holder| OpenError::Busy { port: port.to_owned(), holder: Some(holder) })
}

fn busy(port: PathBuf) -> OpenError {
    let holder = holder(&port);
    OpenError::Busy { port, holder }
}

/// Name and number of the process that has locked the port, from the kernel's list of locks.
fn holder(port: &Path) -> Option<String> {
    use std::os::unix::fs::MetadataExt as _;
    let file = std::fs::metadata(port).ok()?;
    let (major, minor) = (nix::sys::stat::major(file.dev()), nix::sys::stat::minor(file.dev()));
    let wanted = format!("{major:02x}:{minor:02x}:{}", file.ino());
    let locks = std::fs::read_to_string("/proc/locks").ok()?;
    // A line looks like this: 1: FLOCK  ADVISORY  WRITE 1234 00:16:3 0 EOF
    let holds = |line: &&str| line.contains(" FLOCK ") && line.split_whitespace().any(|word| word == wanted);
    let number = locks.lines().find(holds)?.split_whitespace().nth(4)?;
    let name = std::fs::read_to_string(format!("/proc/{number}/comm")).unwrap_or_default();
    Some(format!("{} (process {number})", gnc_text::printable(name.trim())))
}

fn is_device(meta: &std::fs::Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt as _;
    meta.file_type().is_char_device()
}
