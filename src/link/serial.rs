//! RS-422 over a serial port, an USB adapter or a pseudo-terminal.

mod listener;
mod port;

use std::io;
use std::path::{Path, PathBuf};

use gnc_protocol::serial::{FrameDecoder, LineCounters, MAX_ON_WIRE, encode, on_wire};
use gnc_protocol::{Frame, timing};
use tokio_util::bytes::Buf as _;

use super::memory::MemoryPort;
use crate::doubt::Doubt;
use crate::received::{LinkEvent, NoFrame};
use crate::tape::Tape;
pub use listener::{Heard, Listener};
pub(super) use port::{Port, PortEvent, PortLocation};
pub use port::{locked, try_open};

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
    tape: Tape,
}

impl SerialLink {
    fn on(port: Port) -> Self {
        Self { port, decoder: FrameDecoder::default(), tape: Tape::default() }
    }

    pub(super) fn send(&mut self, frame: &Frame) {
        self.send_bytes(&encode(frame));
    }

    pub(super) fn send_bytes(&mut self, bytes: &[u8]) {
        let outgoing = &mut self.port.outgoing;
        if outgoing.len() <= OUTGOING {
            outgoing.extend_from_slice(bytes);
        }
    }

    pub(super) fn begin_tape(&mut self) {
        self.tape = Tape::begun();
    }

    pub(super) fn tape(&self) -> &Tape {
        &self.tape
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

    /// The next frame in the received bytes. Bytes that are no frame are returned as damaged.
    fn decoded(&mut self) -> Option<LinkEvent> {
        let incoming = &mut self.port.incoming;
        let mut rest: &[u8] = incoming;
        let received = self.decoder.next(&mut rest);
        let consumed = incoming.len() - rest.len();
        self.tape.keep_bytes(&incoming[..consumed]);
        incoming.advance(consumed);
        received.map(|frame| frame.map_err(|error| NoFrame::Damaged { error, bytes: self.decoder.rejected().into() }))
    }

    pub(super) fn name(&self) -> String {
        self.port.name()
    }

    pub(super) fn doubt(&self) -> Option<&Doubt> {
        self.port.doubt()
    }

    pub(super) fn came(&self) -> u64 {
        self.port.came
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
    #[error("there is no port {}", gnc_text::shown_path(port))]
    Missing {
        /// The port.
        port: PathBuf,
    },
    /// Another program holds it.
    #[error("port {} is in use by {}", gnc_text::shown_path(port), holder.as_deref().unwrap_or("another program"))]
    Busy {
        /// The port.
        port: PathBuf,
        /// The holder, if the system shows it.
        holder: Option<String>,
    },
    /// The user lacks the permission to open it.
    #[error("no permission to open port {}", gnc_text::shown_path(port))]
    Denied {
        /// The port.
        port: PathBuf,
    },
    /// It is a file, but no terminal device.
    #[error("{} is not a serial port", gnc_text::shown_path(port))]
    NotAPort {
        /// The file.
        port: PathBuf,
    },
    /// The driver chose another rate than asked for.
    #[error("port {} runs at {got} baud instead of {wanted}", gnc_text::shown_path(port))]
    Rate {
        /// The port.
        port: PathBuf,
        /// The rate that was asked for.
        wanted: u32,
        /// The rate that was read back.
        got: u32,
    },
    /// Any other error of the system.
    #[error("cannot open port {}", gnc_text::shown_path(port))]
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
