//! Carries frames from the simulated bus to the host: over an slcan adapter on a pseudo-terminal, or over a CAN
//! interface of the kernel.

use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::path::{Path, PathBuf};
use std::time::Duration;

use gnc_protocol::can::{CanFrame, CanId};
use nix::errno::Errno;
use socketcan::{CanSocket, EmbeddedFrame as _, Id, Socket as _};

use crate::bench::SimulatedBench;
use crate::can::Adapter;
use crate::port::Tty;

/// Where the host finds the bus.
#[derive(Debug)]
pub(crate) enum CanPort {
    /// The master's end of a pseudo-terminal, with the adapter behind it; `None` while the adapter is unplugged.
    Slcan { pty: Option<Tty>, adapter: Adapter },
    /// An interface of the kernel.
    Socket(Interface),
}

/// An interface of the kernel. If it goes away, the bench looks for its name until it is back.
#[derive(Debug)]
pub(crate) struct Interface {
    name: String,
    socket: Option<CanSocket>,
    /// A frame that the interface did not take yet.
    waiting: Option<CanFrame>,
}

impl Interface {
    fn open(name: &str) -> io::Result<CanSocket> {
        let socket = CanSocket::open(name)?;
        socket.set_nonblocking(true)?;
        Ok(socket)
    }

    /// The socket, opened again if it was closed.
    fn socket(&mut self) -> Option<&CanSocket> {
        if self.socket.is_none() {
            self.socket = Self::open(&self.name).ok();
        }
        self.socket.as_ref()
    }

    /// `None`: there is nothing to read now.
    fn read(&mut self) -> io::Result<Option<socketcan::CanFrame>> {
        let Some(socket) = self.socket() else { return Ok(None) };
        match socket.read_frame() {
            Ok(frame) => Ok(Some(frame)),
            Err(error) => self.understand(error).map(|()| None),
        }
    }

    /// Returns whether the interface is full.
    fn write(&mut self, bench: &mut SimulatedBench) -> io::Result<bool> {
        while let Some(frame) = self.waiting.take().or_else(|| bench.output_can()) {
            let Some(raw) = to_socket(&frame) else { continue };
            // Frames are lost while there is no interface, as on a bus without a host.
            let Some(socket) = self.socket() else { continue };
            match socket.write_frame(&raw) {
                Ok(()) => {}
                Err(error) if error.kind() == io::ErrorKind::Interrupted => self.waiting = Some(frame),
                // The transmit queue is full: the kernel reports either error.
                Err(error)
                    if error.kind() == io::ErrorKind::WouldBlock
                        || error.raw_os_error() == Some(Errno::ENOBUFS as i32) =>
                {
                    self.waiting = Some(frame);
                    return Ok(true);
                }
                Err(error) => self.understand(error)?,
            }
        }
        Ok(false)
    }

    fn understand(&mut self, error: io::Error) -> io::Result<()> {
        match error.raw_os_error().map(Errno::from_raw) {
            // The interface is switched off or unplugged. The kernel reports this only once.
            Some(Errno::ENETDOWN | Errno::ENODEV | Errno::ENXIO) => {
                self.socket = None;
                Ok(())
            }
            Some(Errno::EAGAIN | Errno::EINTR) => Ok(()),
            _ => Err(error),
        }
    }
}

impl CanPort {
    /// A new pseudo-terminal.
    pub(crate) fn slcan() -> io::Result<Self> {
        Ok(Self::Slcan { pty: Some(Tty::pseudo_terminal()?), adapter: Adapter::default() })
    }

    /// An interface by its name.
    pub(crate) fn socket(interface: &str) -> io::Result<Self> {
        let socket = Some(Interface::open(interface)?);
        Ok(Self::Socket(Interface { name: interface.to_owned(), socket, waiting: None }))
    }

    /// What the host opens, in the form of a bench file.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Slcan { pty, .. } => {
                format!("slcan:{}", pty.as_ref().map_or(Path::new(""), |pty| pty.name.as_path()).display())
            }
            Self::Socket(interface) => interface.name.clone(),
        }
    }

    /// Pulls the adapter out, with the frames that it holds. An interface of the kernel stays as it is.
    pub(crate) fn unplug(&mut self) {
        if let Self::Slcan { pty, adapter } = self {
            (*pty, *adapter) = (None, Adapter::default());
        }
    }

    /// Plugs the adapter in; returns its new port.
    pub(crate) fn plug_in(&mut self) -> io::Result<PathBuf> {
        let Self::Slcan { pty, adapter } = self else {
            return Err(io::Error::new(io::ErrorKind::Unsupported, "an interface has no cable to plug in"));
        };
        *adapter = Adapter::default();
        Ok(pty.insert(Tty::pseudo_terminal()?).name.clone())
    }

    /// The descriptor to wait for; `None` while the interface is away.
    pub(crate) fn as_fd(&self) -> Option<BorrowedFd<'_>> {
        match self {
            Self::Slcan { pty, .. } => pty.as_ref().map(|pty| pty.end.as_fd()),
            Self::Socket(interface) => interface.socket.as_ref().map(AsFd::as_fd),
        }
    }

    /// Takes frames and lines of the host, as far as the bus has room.
    pub(crate) fn read(&mut self, bench: &mut SimulatedBench, now: Duration) -> io::Result<()> {
        while bench.can_room() > 0 {
            match self {
                Self::Slcan { pty: None, .. } => return Ok(()),
                Self::Slcan { pty: Some(pty), adapter } => {
                    // Read no more bytes than the shortest frames need; other bytes stay in the port.
                    let mut buffer = [0; 4096];
                    let room = (bench.can_room() * 5).min(buffer.len());
                    match nix::unistd::read(&pty.end, &mut buffer[..room]) {
                        Ok(0) | Err(Errno::EAGAIN) => return Ok(()),
                        Ok(count) => {
                            adapter
                                .receive(&buffer[..count])
                                .into_iter()
                                .for_each(|frame| bench.receive_can(frame, now));
                        }
                        Err(Errno::EINTR) => {}
                        Err(error) => return Err(error.into()),
                    }
                }
                Self::Socket(interface) => match interface.read()? {
                    Some(socketcan::CanFrame::Data(frame)) => {
                        let id = match frame.id() {
                            Id::Standard(id) => CanId::Standard(id.as_raw()),
                            Id::Extended(id) => CanId::Extended(id.as_raw()),
                        };
                        CanFrame::new(id, frame.data()).into_iter().for_each(|frame| bench.receive_can(frame, now));
                    }
                    Some(_) => {}
                    None => return Ok(()),
                },
            }
        }
        Ok(())
    }

    /// Hands on frames from the bus; returns whether the port is full.
    pub(crate) fn write(&mut self, bench: &mut SimulatedBench) -> io::Result<bool> {
        match self {
            Self::Slcan { pty, adapter } => {
                // Keep no more lines than a write takes, so that a host which does not read blocks the bus.
                while adapter.output().len() < 4096
                    && let Some(frame) = bench.output_can()
                {
                    adapter.send(&frame);
                }
                // A closed adapter has nothing to hand on.
                let Some(pty) = pty else { return Ok(false) };
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
            Self::Socket(interface) => interface.write(bench),
        }
    }

    /// Whether all frames from the bus are handed on.
    pub(crate) fn is_drained(&mut self) -> bool {
        match self {
            Self::Slcan { adapter, .. } => adapter.output().is_empty(),
            Self::Socket(interface) => interface.waiting.is_none(),
        }
    }
}

fn to_socket(frame: &CanFrame) -> Option<socketcan::CanFrame> {
    match frame.id() {
        CanId::Standard(id) => socketcan::CanFrame::new(socketcan::StandardId::new(id)?, frame.data()),
        CanId::Extended(id) => socketcan::CanFrame::new(socketcan::ExtendedId::new(id)?, frame.data()),
    }
}
