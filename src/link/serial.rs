//! RS-422 over a serial port, an USB adapter or a pseudo-terminal.

mod port;

use std::io;
use std::path::{Path, PathBuf};

use gnc_protocol::serial::{FrameDecoder, LineCounters, MAX_ON_WIRE, encode, on_wire};
use gnc_protocol::{Frame, timing};
use nix::errno::Errno;
use tokio_serial::{SerialPort as _, SerialPortBuilderExt as _, SerialStream};
use tokio_util::bytes::Buf as _;

use super::memory::MemoryPort;
use crate::received::{LinkEvent, NoFrame};
pub(super) use port::{Port, PortEvent, PortLocation};

/// Bytes that may wait while the line does not take them: sixteen frames, more than can be in flight.
const OUTGOING: usize = 16 * MAX_ON_WIRE;

/// An open port that carries frames.
///
/// The link writes to the port directly and never flushes it. Flushing waits in the kernel until the last bit is out,
/// and blocks the whole station meanwhile.
#[derive(Debug)]
pub struct SerialLink {
    port: Port,
    decoder: FrameDecoder,
}

impl SerialLink {
    fn on(port: Port) -> Self {
        Self { port, decoder: FrameDecoder::default() }
    }

    pub(super) fn send(&mut self, frame: &Frame) {
        let outgoing = &mut self.port.outgoing;
        if outgoing.len() <= OUTGOING {
            outgoing.extend_from_slice(&encode(frame));
        }
    }

    pub(super) async fn next(&mut self, read: bool) -> io::Result<LinkEvent> {
        loop {
            if read && let Some(received) = self.decoded() {
                return Ok(received);
            }
            match self.port.turn(read).await? {
                PortEvent::Read | PortEvent::Written => {}
                PortEvent::Away => return Ok(Err(NoFrame::Away)),
                PortEvent::Back(lasted) => return Ok(Err(NoFrame::Back { lasted })),
            }
        }
    }

    /// The next frame in the received bytes. Damaged frames are returned as damaged.
    fn decoded(&mut self) -> Option<LinkEvent> {
        let incoming = &mut self.port.incoming;
        let mut rest: &[u8] = incoming;
        let received = self.decoder.next(&mut rest);
        let consumed = incoming.len() - rest.len();
        incoming.advance(consumed);
        received.map(|frame| frame.map_err(NoFrame::Damaged))
    }

    pub(super) fn name(&self) -> String {
        self.port.name()
    }

    pub(super) fn counters(&self) -> LineCounters {
        self.decoder.counters()
    }

    pub(super) fn restart_sequence(&mut self) {
        self.decoder.restart_sequence();
    }

    pub(super) fn exchange_time(&self, payload: usize) -> std::time::Duration {
        timing::wire_time(on_wire(payload) + 2 * MAX_ON_WIRE, self.port.rate_baud())
    }
}

/// Why a port could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// There is no such file.
    #[error("there is no port {}", port.display())]
    Missing {
        /// The port.
        port: PathBuf,
    },
    /// Another program holds it.
    #[error("port {} is in use by {}", port.display(), holder.as_deref().unwrap_or("another program"))]
    Busy {
        /// The port.
        port: PathBuf,
        /// The holder, if the system shows it.
        holder: Option<String>,
    },
    /// The user lacks the permission to open it.
    #[error("no permission to open port {}", port.display())]
    Denied {
        /// The port.
        port: PathBuf,
    },
    /// It is a file, but no terminal device.
    #[error("{} is not a serial port", port.display())]
    NotAPort {
        /// The file.
        port: PathBuf,
    },
    /// The driver chose another rate than asked for.
    #[error("port {} runs at {got} baud instead of {wanted}", port.display())]
    Rate {
        /// The port.
        port: PathBuf,
        /// The rate that was asked for.
        wanted: u32,
        /// The rate that was read back.
        got: u32,
    },
    /// Any other error of the system.
    #[error("cannot open port {}", port.display())]
    System {
        /// The port.
        port: PathBuf,
        /// What the system said.
        source: tokio_serial::Error,
    },
}

impl OpenError {
    /// What the operator can try.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        match self {
            Self::Missing { .. } => "is the adapter plugged in? `gnc-station ports` lists what is there",
            Self::Busy { .. } => "wait until that program ends, or end it; then start again",
            Self::Denied { .. } => "add the user to the group of the port (often `dialout`) and log in again",
            Self::NotAPort { .. } => "check [socket] port in the bench file; `gnc-station ports` lists what is there",
            Self::Rate { .. } => "choose a rate in the bench file that the adapter can produce",
            Self::System { .. } => "check the cable and the adapter; `gnc-station ports` lists what is there",
        }
    }
}

/// Opens a port: 8 data bits, no parity, 1 stop bit, no flow control, for this program alone.
///
/// # Errors
/// [`OpenError`].
pub(crate) fn open(port: &Path, rate_baud: u32) -> Result<SerialLink, OpenError> {
    Ok(SerialLink::on(Port::open(PortLocation::Device(port.to_owned(), rate_baud))?))
}

/// Opens the end of a cable in this program's memory.
///
/// # Errors
/// [`OpenError::Missing`]: no cable is plugged in, or it was opened already.
pub(crate) fn open_memory(port: &MemoryPort) -> Result<SerialLink, OpenError> {
    Ok(SerialLink::on(Port::open(PortLocation::Memory(port.clone()))?))
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

/// Opens the port alone, for any protocol.
fn open_stream(port: &Path, rate_baud: u32) -> Result<SerialStream, OpenError> {
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
