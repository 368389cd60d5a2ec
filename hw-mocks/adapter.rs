//! How frames get from the simulated bus to the host: over an slcan adapter on a pseudo-terminal, or over a CAN
//! interface of the kernel.

use std::io;
use std::os::fd::{AsFd, BorrowedFd};

use gnc_protocol::can::{CanFrame, CanId};
use nix::errno::Errno;
use socketcan::{CanSocket, EmbeddedFrame as _, Id, Socket as _};

use crate::bench::Bench;
use crate::can::Adapter;
use crate::port::Tty;

/// Where the host finds the bus.
#[derive(Debug)]
pub(crate) enum CanPort {
    /// The master's end of a pseudo-terminal, with the adapter behind it.
    Slcan { pty: Tty, adapter: Adapter },
    /// An interface of the kernel, and a frame that it did not take yet.
    Socket { socket: CanSocket, waiting: Option<CanFrame> },
}

impl CanPort {
    /// A new pseudo-terminal.
    pub(crate) fn slcan() -> io::Result<Self> {
        Ok(Self::Slcan { pty: Tty::pseudo_terminal()?, adapter: Adapter::default() })
    }

    /// An interface by its name.
    pub(crate) fn socket(interface: &str) -> io::Result<Self> {
        let socket = CanSocket::open(interface)?;
        socket.set_nonblocking(true)?;
        Ok(Self::Socket { socket, waiting: None })
    }

    /// What the host opens, as its bench file names it.
    pub(crate) fn name(&self, interface: Option<&str>) -> String {
        match self {
            Self::Slcan { pty, .. } => format!("slcan:{}", pty.name.display()),
            Self::Socket { .. } => interface.unwrap_or_default().to_owned(),
        }
    }

    pub(crate) fn as_fd(&self) -> BorrowedFd<'_> {
        match self {
            Self::Slcan { pty, .. } => pty.end.as_fd(),
            Self::Socket { socket, .. } => socket.as_fd(),
        }
    }

    /// Takes what the host sent, as far as the bus has room.
    pub(crate) fn read(&mut self, bench: &mut Bench) -> io::Result<()> {
        while bench.can_room() > 0 {
            match self {
                Self::Slcan { pty, adapter } => {
                    // As many bytes as the shortest frames may need: what is more stays in the port.
                    let mut buffer = [0; 4096];
                    let room = (bench.can_room() * 5).min(buffer.len());
                    match nix::unistd::read(&pty.end, &mut buffer[..room]) {
                        Ok(0) | Err(Errno::EAGAIN) => return Ok(()),
                        Ok(count) => {
                            adapter.receive(&buffer[..count]).into_iter().for_each(|frame| bench.receive_can(frame));
                        }
                        Err(Errno::EINTR) => {}
                        Err(error) => return Err(error.into()),
                    }
                }
                Self::Socket { socket, .. } => match socket.read_frame() {
                    Ok(socketcan::CanFrame::Data(frame)) => {
                        let id = match frame.id() {
                            Id::Standard(id) => CanId::Standard(id.as_raw()),
                            Id::Extended(id) => CanId::Extended(id.as_raw()),
                        };
                        CanFrame::new(id, frame.data()).into_iter().for_each(|frame| bench.receive_can(frame));
                    }
                    Ok(_) => {}
                    Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
                    Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                    // Said once when the interface goes down; it may come back.
                    Err(error) if error.raw_os_error() == Some(Errno::ENETDOWN as i32) => return Ok(()),
                    Err(error) => return Err(error),
                },
            }
        }
        Ok(())
    }

    /// Hands on what came off the bus; tells whether the port is full.
    pub(crate) fn write(&mut self, bench: &mut Bench) -> io::Result<bool> {
        match self {
            Self::Slcan { pty, adapter } => {
                // No more lines than a write takes, so that a host which does not read holds the bus up.
                while adapter.output().len() < 4096
                    && let Some(frame) = bench.output_can()
                {
                    adapter.send(&frame);
                }
                while !adapter.output().is_empty() {
                    match nix::unistd::write(&pty.end, adapter.output()) {
                        Ok(0) | Err(Errno::EAGAIN) => return Ok(true),
                        Ok(count) => adapter.consume(count),
                        Err(Errno::EINTR) => {}
                        Err(error) => return Err(error.into()),
                    }
                }
                Ok(false)
            }
            Self::Socket { socket, waiting } => {
                while let Some(frame) = waiting.take().or_else(|| bench.output_can()) {
                    let Some(raw) = to_socket(&frame) else { continue };
                    match socket.write_frame(&raw) {
                        Ok(()) => {}
                        Err(error) if error.kind() == io::ErrorKind::Interrupted => *waiting = Some(frame),
                        // The transmit queue is full: the kernel says either.
                        Err(error)
                            if error.kind() == io::ErrorKind::WouldBlock
                                || error.raw_os_error() == Some(Errno::ENOBUFS as i32) =>
                        {
                            *waiting = Some(frame);
                            return Ok(true);
                        }
                        Err(error) if error.raw_os_error() == Some(Errno::ENETDOWN as i32) => {}
                        Err(error) => return Err(error),
                    }
                }
                Ok(false)
            }
        }
    }

    /// Whether all that came off the bus is handed on.
    pub(crate) fn is_drained(&mut self) -> bool {
        match self {
            Self::Slcan { adapter, .. } => adapter.output().is_empty(),
            Self::Socket { waiting, .. } => waiting.is_none(),
        }
    }
}

fn to_socket(frame: &CanFrame) -> Option<socketcan::CanFrame> {
    match frame.id() {
        CanId::Standard(id) => socketcan::CanFrame::new(socketcan::StandardId::new(id)?, frame.data()),
        CanId::Extended(id) => socketcan::CanFrame::new(socketcan::ExtendedId::new(id)?, frame.data()),
    }
}
