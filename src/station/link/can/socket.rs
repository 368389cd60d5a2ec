//! An interface of the kernel.

use std::io;
use std::path::Path;
use std::time::Duration;

use gnc_protocol::can::{CanFrame, CanId};
use nix::errno::Errno;
use nix::sys::socket::{AddressFamily, SockFlag, SockType, setsockopt, sockopt};
use socketcan::{CanSocket, EmbeddedFrame as _, Frame as _, Id, Socket as _, SocketOptions as _};
use tokio::io::Interest;
use tokio::io::unix::AsyncFd;
use tokio::time::{Instant, sleep};

use super::bus::Turn;
use super::{BusErrors, CanOpenError};

/// A transmit queue that stays full so long belongs to a bus on which nobody acknowledges.
const FULL_FOR: Duration = Duration::from_millis(1000);
/// Between two tries: eight frames' time on the bus.
const RETRY: Duration = Duration::from_millis(2);
/// The kernel's default overruns after a few hundred frames; the kernel doubles it and caps it at `net.core.rmem_max`.
const RECEIVE_BUFFER: usize = 1 << 20;
/// ARPHRD_CAN: the kind of a network interface.
const KIND_CAN: &str = "280";
/// IFF_UP.
const UP: u32 = 1;
/// CAN_ERR_BUSOFF in the id of an error frame.
const BUS_OFF: u32 = 0x40;

/// The interface.
#[derive(Debug)]
pub(super) struct SocketBus {
    socket: AsyncFd<CanSocket>,
    errors: BusErrors,
    full_since: Option<Instant>,
}

impl SocketBus {
    pub(super) fn open(interface: &str) -> Result<Self, CanOpenError> {
        look_at(interface)?;
        let system = |source| CanOpenError::System { interface: interface.to_owned(), source };
        let socket = CanSocket::open(interface).map_err(system)?;
        socket.set_nonblocking(true).map_err(system)?;
        // Without it error frames never come.
        socket.set_error_filter_accept_all().map_err(system)?;
        // A smaller buffer is no reason not to start: losses are seen by the numbers in the frames.
        let _ = setsockopt(&socket, sockopt::RcvBuf, &RECEIVE_BUFFER);
        #[expect(deprecated, reason = "its successor is unsafe; this socket owns its descriptor and keeps it open")]
        let socket = AsyncFd::new(socket).map_err(system)?;
        Ok(Self { socket, errors: BusErrors::default(), full_since: None })
    }

    pub(super) fn errors(&self) -> BusErrors {
        self.errors
    }

    pub(super) async fn turn(&mut self, outgoing: Option<&CanFrame>, read: bool) -> io::Result<Turn> {
        loop {
            if let Some(frame) = outgoing
                && self.try_send(frame)?
            {
                return Ok(Turn::Sent);
            }
            tokio::select! {
                biased;
                frame = self.socket.async_io(Interest::READABLE, CanSocket::read_frame), if read => {
                    match frame {
                        Ok(frame) => if let Some(turn) = self.understand(&frame) {
                            return Ok(turn);
                        },
                        // Said once when the interface goes down; it may come up again, and silence is noticed.
                        Err(error) if is(&error, Errno::ENETDOWN) => {}
                        Err(error) => return Err(explain(error)),
                    }
                }
                () = sleep(RETRY), if outgoing.is_some() => {}
                else => std::future::pending().await,
            }
        }
    }

    /// Whether the frame was taken; a full queue is tried again for a while.
    fn try_send(&mut self, frame: &CanFrame) -> io::Result<bool> {
        let Some(raw) = to_socket(frame) else { return Ok(true) };
        match self.socket.get_ref().write_frame(&raw) {
            Ok(()) => {
                self.full_since = None;
                Ok(true)
            }
            Err(error) if is_full(&error) => {
                let since = *self.full_since.get_or_insert_with(Instant::now);
                if since.elapsed() < FULL_FOR {
                    return Ok(false);
                }
                let why = "the bus takes no frames: is it terminated, and does another node acknowledge?";
                Err(io::Error::new(io::ErrorKind::TimedOut, why))
            }
            Err(error) => Err(explain(error)),
        }
    }

    fn understand(&mut self, frame: &socketcan::CanFrame) -> Option<Turn> {
        match frame {
            socketcan::CanFrame::Data(frame) => {
                let id = match frame.id() {
                    Id::Standard(id) => CanId::Standard(id.as_raw()),
                    Id::Extended(id) => CanId::Extended(id.as_raw()),
                };
                CanFrame::new(id, frame.data()).map(Turn::Received)
            }
            socketcan::CanFrame::Remote(_) => None,
            socketcan::CanFrame::Error(frame) => {
                self.errors.frames = self.errors.frames.saturating_add(1);
                self.errors.bus_off += u32::from(frame.raw_id() & BUS_OFF != 0);
                Some(Turn::Errors)
            }
        }
    }
}

/// Tells apart what `open` calls "no such device" all alike.
fn look_at(interface: &str) -> Result<(), CanOpenError> {
    let interface = interface.to_owned();
    let probe = nix::sys::socket::socket(AddressFamily::Can, SockType::Raw, SockFlag::empty(), None);
    if matches!(probe, Err(Errno::EAFNOSUPPORT)) {
        return Err(CanOpenError::NoKernel { interface });
    }
    // A name with a slash is none, and must not lead out of the folder.
    let folder = Path::new("/sys/class/net").join(interface.replace('/', "_"));
    let read = |what: &str| std::fs::read_to_string(folder.join(what)).map(|text| text.trim().to_owned());
    let (Ok(kind), Ok(flags)) = (read("type"), read("flags")) else { return Err(CanOpenError::Missing { interface }) };
    if kind != KIND_CAN {
        return Err(CanOpenError::NotCan { interface });
    }
    let flags = u32::from_str_radix(flags.trim_start_matches("0x"), 16).unwrap_or(UP);
    if flags & UP == 0 { Err(CanOpenError::Down { interface }) } else { Ok(()) }
}

fn to_socket(frame: &CanFrame) -> Option<socketcan::CanFrame> {
    match frame.id() {
        CanId::Standard(id) => socketcan::CanFrame::new(socketcan::StandardId::new(id)?, frame.data()),
        CanId::Extended(id) => socketcan::CanFrame::new(socketcan::ExtendedId::new(id)?, frame.data()),
    }
}

fn is(error: &io::Error, errno: Errno) -> bool {
    error.raw_os_error() == Some(errno as i32)
}

fn is_full(error: &io::Error) -> bool {
    is(error, Errno::ENOBUFS) || error.kind() == io::ErrorKind::WouldBlock
}

/// ENODEV comes once and reads block for ever after it, so it ends the link.
fn explain(error: io::Error) -> io::Error {
    if is(&error, Errno::ENODEV) {
        return io::Error::new(io::ErrorKind::NotConnected, "the CAN interface is gone: was the adapter unplugged?");
    }
    if is(&error, Errno::ENETDOWN) {
        return io::Error::new(io::ErrorKind::NetworkDown, "the CAN interface was switched off");
    }
    error
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_told_apart() {
        // The loopback is everywhere and no CAN; where the kernel has no CAN, that is said first.
        let no_kernel = matches!(look_at("lo"), Err(CanOpenError::NoKernel { .. }));
        assert!(no_kernel || matches!(look_at("lo"), Err(CanOpenError::NotCan { .. })), "{:?}", look_at("lo"));
        let missing = look_at("../../etc");
        assert!(no_kernel || matches!(missing, Err(CanOpenError::Missing { .. })), "{missing:?}");
    }

    #[test]
    fn frames_keep_their_ids_and_data() {
        for (id, data) in [
            (CanId::Standard(0), &[][..]),
            (CanId::Standard(0x7ff), &[1, 2, 3, 4, 5, 6, 7, 8]),
            (CanId::Extended(0x7ff), &[0]),
            (CanId::Extended(0x1fff_ffff), &[0xff; 8]),
        ] {
            let frame = CanFrame::new(id, data).unwrap();
            let raw = to_socket(&frame).unwrap();
            assert_eq!(raw.is_extended(), matches!(id, CanId::Extended(_)));
            assert_eq!(raw.data(), data);
        }
    }
}
