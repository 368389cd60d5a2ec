//! An interface of the kernel. If it goes away, unplugged or switched off, the link waits some time for its return.

use std::io;
use std::time::Duration;

use gnc_protocol::can::{CanFrame, CanId};
use nix::errno::Errno;
use nix::sys::socket::{setsockopt, sockopt};
use socketcan::id::CAN_ERR_MASK;
use socketcan::{CanSocket, EmbeddedFrame as _, Frame as _, Id, Socket as _, SocketOptions as _};
use tokio::io::Interest;
use tokio::io::unix::AsyncFd;
use tokio::time::{Instant, sleep, sleep_until};

use super::bus::BusEvent;
use super::interface::{Statistics, doubt, index, look_at};
use super::{BusErrors, CanOpenError};
use crate::absence::Absence;
use crate::doubt::Doubt;

/// How long a transmit queue may stay full. Longer means that no node on the bus acknowledges.
const FULL_FOR: Duration = Duration::from_millis(1000);
/// Time between two tries: eight frames' time on the bus.
const RETRY: Duration = Duration::from_millis(2);
/// After this time without a frame, half of the time between two heartbeats, the bus looks whether the opened interface
/// is still there. The kernel reports its loss only once, and then reads wait for ever.
const LOOK: Duration = Duration::from_millis(500);
/// Size of the receive buffer. The kernel's default overruns after a few hundred frames. The kernel doubles this value
/// and caps it at `net.core.rmem_max`, unless root asks.
const RECEIVE_BUFFER: usize = 1 << 20;
/// Bits of the id of an error frame (`linux/can/error.h`). A lost arbitration is normal on the bus, not an error.
const LOST_ARBITRATION: u32 = 0x02;
const CONTROLLER: u32 = 0x04;
const BUS_OFF: u32 = 0x40;
/// Bits of the second byte of an error frame of the controller: it lost a received frame or a frame to send.
const OVERFLOW: u8 = 0x03;

/// The interface.
#[derive(Debug)]
pub(super) struct SocketBus {
    interface: String,
    socket: Socket,
    /// Why the interface that was opened first does not prove that a bus is behind it.
    doubt: Option<Doubt>,
    statistics: Statistics,
    errors: BusErrors,
    full_since: Option<Instant>,
}

#[derive(Debug)]
enum Socket {
    Open {
        socket: AsyncFd<CanSocket>,
        /// The kernel's number of the interface. An interface that was plugged in again has another number.
        index: u32,
        look_at: Instant,
        /// The absence from which the interface returned, until something comes from it.
        mute: Option<Absence>,
    },
    Away(Absence),
}

impl SocketBus {
    pub(super) fn open(interface: &str) -> Result<Self, CanOpenError> {
        let (socket, doubt) = open(interface, None)?;
        Ok(Self {
            interface: interface.to_owned(),
            socket,
            doubt,
            statistics: Statistics::of(interface),
            errors: BusErrors::default(),
            full_since: None,
        })
    }

    pub(super) fn name(&self) -> String {
        name(&self.interface)
    }

    pub(super) fn doubt(&self) -> Option<&Doubt> {
        self.doubt.as_ref()
    }

    pub(super) fn errors(&self) -> BusErrors {
        self.errors
    }

    pub(super) fn statistics(&self) -> Statistics {
        self.statistics.clone()
    }

    pub(super) async fn turn(&mut self, outgoing: Option<&CanFrame>, read: bool) -> io::Result<BusEvent> {
        loop {
            let (socket, due) = match &self.socket {
                Socket::Away(absence) => {
                    absence.look_due().await;
                    match self.come_back()? {
                        Some(turn) => return Ok(turn),
                        None => continue,
                    }
                }
                Socket::Open { socket, look_at, .. } => (socket, *look_at),
            };
            if let Some(frame) = outgoing.and_then(to_socket) {
                let sent = socket.get_ref().write_frame(&frame);
                match self.sent(sent)? {
                    Some(turn) => return Ok(turn),
                    None if matches!(self.socket, Socket::Away(_)) => continue,
                    None => {}
                }
            }
            let Socket::Open { socket, .. } = &self.socket else { continue };
            tokio::select! {
                biased;
                frame = socket.async_io(Interest::READABLE, CanSocket::read_frame), if read => {
                    if let Some(turn) = self.received(frame)? {
                        return Ok(turn);
                    }
                }
                () = sleep(RETRY), if outgoing.is_some() => {}
                () = sleep_until(due) => {
                    if let Some(turn) = self.look() {
                        return Ok(turn);
                    }
                }
            }
        }
    }

    /// The event after an attempt to send a frame. `None` if the frame must be sent again: the bus tries a full queue
    /// again for some time.
    fn sent(&mut self, sent: io::Result<()>) -> io::Result<Option<BusEvent>> {
        match sent {
            Ok(()) => {
                self.full_since = None;
                Ok(Some(BusEvent::Sent))
            }
            Err(error) if is_full(&error) => {
                let since = *self.full_since.get_or_insert_with(Instant::now);
                if since.elapsed() < FULL_FOR {
                    return Ok(None);
                }
                let interface = &self.interface;
                let why = if self.errors.bus_off > 0 {
                    format!(
                        "the controller of {interface} left the bus after too many errors (bus-off); \
                         `sudo ip link set {interface} type can restart` brings it back"
                    )
                } else {
                    format!("{interface} takes no frames: does another node on the bus acknowledge, at 500 kbit/s?")
                };
                Err(io::Error::new(io::ErrorKind::TimedOut, why))
            }
            Err(error) => self.failed(error),
        }
    }

    fn received(&mut self, frame: io::Result<socketcan::CanFrame>) -> io::Result<Option<BusEvent>> {
        if let Socket::Open { look_at, mute, .. } = &mut self.socket {
            *look_at = Instant::now() + LOOK;
            *mute = mute.filter(|_| frame.is_err());
        }
        match frame {
            Ok(frame) => Ok(self.understand(&frame)),
            Err(error) => self.failed(error),
        }
    }

    fn understand(&mut self, frame: &socketcan::CanFrame) -> Option<BusEvent> {
        match frame {
            socketcan::CanFrame::Data(frame) => {
                let id = match frame.id() {
                    Id::Standard(id) => CanId::Standard(id.as_raw()),
                    Id::Extended(id) => CanId::Extended(id.as_raw()),
                };
                CanFrame::new(id, frame.data()).map(BusEvent::Received)
            }
            socketcan::CanFrame::Remote(_) => None,
            socketcan::CanFrame::Error(frame) => {
                note(&mut self.errors, frame.raw_id(), frame.data());
                Some(BusEvent::Errors)
            }
        }
    }

    /// Whether the interface that was opened is still there and on.
    fn look(&mut self) -> Option<BusEvent> {
        let Socket::Open { index: opened, look_at, .. } = &mut self.socket else { return None };
        *look_at = Instant::now() + LOOK;
        let gone = self::look_at(&self.interface).is_err() || index(&self.interface) != Some(*opened);
        if gone { self.went_away() } else { None }
    }

    /// Handles an error of the socket. The interface was switched off or unplugged; any other error ends the link.
    fn failed(&mut self, error: io::Error) -> io::Result<Option<BusEvent>> {
        let errno = error.raw_os_error().map(Errno::from_raw);
        match errno {
            Some(Errno::ENODEV | Errno::ENXIO | Errno::ENETDOWN) => Ok(self.went_away()),
            _ => Err(error),
        }
    }

    /// The event when the interface went away. `None` if nothing came from it since its last return: that absence goes
    /// on.
    fn went_away(&mut self) -> Option<BusEvent> {
        let Socket::Open { mute, .. } = &mut self.socket else { return None };
        let absence = Absence::begin(mute.take());
        self.socket = Socket::Away(absence);
        absence.is_new().then_some(BusEvent::Away)
    }

    /// Opens the interface by its name again; gives up if it was away for too long.
    fn come_back(&mut self) -> io::Result<Option<BusEvent>> {
        let Socket::Away(absence) = &mut self.socket else { return Ok(None) };
        match open(&self.interface, Some(*absence)) {
            Ok((_, Some(doubt))) if self.doubt.is_none() => Err(doubt.on_return()),
            Ok((socket, _)) => {
                (self.socket, self.full_since) = (socket, None);
                let Socket::Open { mute: Some(absence), .. } = &mut self.socket else { return Ok(None) };
                Ok(absence.returned().map(BusEvent::Back))
            }
            Err(error) => absence.goes_on(&name(&self.interface), &error).map(|()| None),
        }
    }
}

fn name(interface: &str) -> String {
    format!("CAN interface {interface}")
}

fn open(interface: &str, mute: Option<Absence>) -> Result<(Socket, Option<Doubt>), CanOpenError> {
    look_at(interface)?;
    let system = |source| CanOpenError::System { interface: interface.to_owned(), source };
    let index = index(interface).ok_or_else(|| CanOpenError::Missing { interface: interface.to_owned() })?;
    let socket = CanSocket::open(interface).map_err(system)?;
    // The interface of this name is still the one that was looked at.
    let doubt = match self::index(interface) {
        Some(now) if now == index => doubt(interface, index),
        _ => return Err(CanOpenError::Missing { interface: interface.to_owned() }),
    };
    socket.set_nonblocking(true).map_err(system)?;
    // Without this filter no error frames come.
    socket.set_error_filter(CAN_ERR_MASK & !LOST_ARBITRATION).map_err(system)?;
    // A smaller buffer does not prevent the start: the numbers in the frames show losses.
    let _ = setsockopt(&socket, sockopt::RcvBufForce, &RECEIVE_BUFFER)
        .or_else(|_| setsockopt(&socket, sockopt::RcvBuf, &RECEIVE_BUFFER));
    #[expect(deprecated, reason = "its successor is unsafe; this socket owns its descriptor and keeps it open")]
    let socket = AsyncFd::new(socket).map_err(system)?;
    Ok((Socket::Open { socket, index, look_at: Instant::now() + LOOK, mute }, doubt))
}

/// Counts what an error frame says. A frame that the controller lost is not an error of the bus.
fn note(errors: &mut BusErrors, id: u32, data: &[u8]) {
    let overflowed = id & CONTROLLER != 0 && data.get(1).is_some_and(|state| state & OVERFLOW != 0);
    if overflowed {
        errors.overruns = errors.overruns.saturating_add(1);
    }
    if !overflowed || id & CAN_ERR_MASK != CONTROLLER {
        errors.frames = errors.frames.saturating_add(1);
    }
    errors.bus_off = errors.bus_off.saturating_add(u32::from(id & BUS_OFF != 0));
}

fn to_socket(frame: &CanFrame) -> Option<socketcan::CanFrame> {
    match frame.id() {
        CanId::Standard(id) => socketcan::CanFrame::new(socketcan::StandardId::new(id)?, frame.data()),
        CanId::Extended(id) => socketcan::CanFrame::new(socketcan::ExtendedId::new(id)?, frame.data()),
    }
}

fn is_full(error: &io::Error) -> bool {
    error.raw_os_error() == Some(Errno::ENOBUFS as i32) || error.kind() == io::ErrorKind::WouldBlock
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_frames_are_told_apart() {
        let mut errors = BusErrors::default();
        let mut check = |id, state, frames, bus_off, overruns| {
            note(&mut errors, 0x2000_0000 | id, &[0, state, 0, 0, 0, 0, 0, 0]);
            assert_eq!(errors, BusErrors { frames, bus_off, overruns }, "{id:#x} {state}");
        };
        // The controller's buffer ran over; it became error-passive; a form error; bus-off.
        check(CONTROLLER, 0x01, 0, 0, 1);
        check(CONTROLLER, 0x10, 1, 0, 1);
        check(0x88, 0x02, 2, 0, 1);
        check(BUS_OFF, 0x00, 3, 1, 1);
        // Several classes in one frame.
        check(CONTROLLER | 0x80, 0x02, 4, 1, 2);
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
