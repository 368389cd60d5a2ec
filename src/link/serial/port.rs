//! A serial port that may go away in mid-run: its bytes in and out, and word of its absences.
//!
//! A port that vanishes reads as "no more bytes" for ever, which is "device gone" and not "no data". It is opened again
//! by its name, since udev gives an adapter that was plugged in again another device behind the same link.

use std::fmt;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _, ReadHalf, WriteHalf};
use tokio_util::bytes::BytesMut;

use super::{OpenError, open_stream};
use crate::absence::Absence;
use crate::memory::MemoryPort;

/// Bytes read at once: what an adapter passes on in a frame of USB, several times over.
const READ_AT_ONCE: usize = 4096;

/// Numbers of pseudo-terminals. One that is free again is given to the next program that asks, so that the same name
/// would be somebody else's terminal. A link to one has an owner who moves it.
const PSEUDO_TERMINALS: &str = "/dev/pts";

/// Where a port is.
#[derive(Debug)]
pub(crate) enum PortLocation {
    /// A device of this computer, and the rate that it is set to.
    Device(PathBuf, u32),
    /// In this program.
    Memory(MemoryPort),
}

/// Bytes in and out.
trait Stream: AsyncRead + AsyncWrite + Send + Unpin + fmt::Debug {}

impl<T: AsyncRead + AsyncWrite + Send + Unpin + fmt::Debug> Stream for T {}

/// The port, its buffers, and whether it is there.
#[derive(Debug)]
pub(crate) struct Port {
    place: PortLocation,
    state: State,
    /// What has come and nobody took yet.
    pub(crate) incoming: BytesMut,
    /// What is to go; whoever fills it bounds it.
    pub(crate) outgoing: BytesMut,
}

#[derive(Debug)]
enum State {
    Open {
        reader: ReadHalf<Box<dyn Stream>>,
        writer: WriteHalf<Box<dyn Stream>>,
        /// The absence from which it returned, until something comes from it.
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
    /// It went away. What was to go is forgotten: half of a frame may be on the line.
    Away,
    /// It is there again, after so long.
    Back(Duration),
}

enum Moved {
    Written(io::Result<usize>),
    Read(io::Result<usize>),
}

impl Port {
    pub(crate) fn open(place: PortLocation) -> Result<Self, OpenError> {
        let state = place.open(None)?;
        let (incoming, outgoing) = (BytesMut::with_capacity(READ_AT_ONCE), BytesMut::new());
        Ok(Self { place, state, incoming, outgoing })
    }

    pub(crate) fn rate_baud(&self) -> u32 {
        match &self.place {
            PortLocation::Device(_, rate_baud) => *rate_baud,
            PortLocation::Memory(port) => port.rate_baud(),
        }
    }

    /// What people call it.
    pub(crate) fn name(&self) -> String {
        format!("port {}", self.place)
    }

    /// Whether it is there, as far as anybody knows.
    pub(crate) fn is_there(&self) -> bool {
        matches!(self.state, State::Open { .. })
    }

    /// Moves bytes until something has happened. Nothing is lost when it is dropped half way. Without `read` it only
    /// writes.
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
                Moved::Read(Ok(1..)) => {
                    self.heard();
                    return Ok(PortEvent::Read);
                }
                // Whatever the driver says of a port that is gone, it is gone.
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

    /// `true`: this is news.
    fn went_away(&mut self) -> io::Result<bool> {
        let State::Open { mute, .. } = &mut self.state else { return Ok(false) };
        if matches!(&self.place, PortLocation::Device(path, _) if path.starts_with(PSEUDO_TERMINALS)) {
            let text = format!("{} went away, and a pseudo-terminal does not come back", self.name());
            return Err(io::Error::new(io::ErrorKind::NotConnected, text));
        }
        let absence = Absence::begin(mute.take());
        let is_new = absence.is_new();
        // The descriptor is closed with this, or the kernel would give the adapter another name when it is back.
        self.state = State::Away(absence);
        self.outgoing.clear();
        Ok(is_new)
    }

    /// Opens the port once more.
    fn look(&mut self) -> io::Result<Option<PortEvent>> {
        let State::Away(absence) = &mut self.state else { return Ok(None) };
        match self.place.open(Some(*absence)) {
            Ok(open) => {
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
    fn open(&self, mute: Option<Absence>) -> Result<State, OpenError> {
        let stream: Box<dyn Stream> = match self {
            Self::Device(path, rate_baud) => Box::new(open_stream(path, *rate_baud)?),
            Self::Memory(port) => {
                Box::new(port.open().ok_or_else(|| OpenError::Missing { port: port.to_string().into() })?)
            }
        };
        let (reader, writer) = tokio::io::split(stream);
        Ok(State::Open { reader, writer, mute })
    }
}

impl fmt::Display for PortLocation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Device(path, _) => path.display().fmt(f),
            Self::Memory(port) => port.fmt(f),
        }
    }
}
