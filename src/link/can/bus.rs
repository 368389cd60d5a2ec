//! The kinds of bus with one interface.

use std::io;
use std::time::Duration;

use gnc_protocol::can::CanFrame;

use super::BusErrors;
use super::interface::Statistics;
use super::memory::MemoryBus;
use super::slcan::SlcanBus;
use super::socket::SocketBus;
use crate::doubt::Doubt;

/// A CAN bus that was joined.
#[derive(Debug)]
pub(super) enum Bus {
    Slcan(SlcanBus),
    Socket(SocketBus),
    Memory(MemoryBus),
}

/// What happened on a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BusEvent {
    /// The outgoing frame is on its way.
    Sent,
    /// A frame came.
    Received(CanFrame),
    /// The controller saw an error; its counters moved.
    Errors,
    /// The port or interface went away; the bus looks for it.
    Away,
    /// The port or interface is back, after this time.
    Back(Duration),
}

impl Bus {
    /// Sends the frame or receives one, whichever is possible first. A caller that drops this wait half way loses
    /// nothing: a frame is either sent and reported as sent, or not sent.
    pub(super) async fn turn(&mut self, outgoing: Option<&CanFrame>, read: bool) -> io::Result<BusEvent> {
        match self {
            Self::Slcan(bus) => bus.turn(outgoing, read).await,
            Self::Socket(bus) => bus.turn(outgoing, read).await,
            Self::Memory(bus) => bus.turn(outgoing, read).await,
        }
    }

    /// The name of the port or interface for people.
    pub(super) fn name(&self) -> String {
        match self {
            Self::Slcan(bus) => bus.name(),
            Self::Socket(bus) => bus.name(),
            Self::Memory(_) => "bus in memory".to_owned(),
        }
    }

    /// Why the bus does not prove that hardware is at its other end.
    pub(super) fn doubt(&self) -> Option<&Doubt> {
        match self {
            Self::Slcan(bus) => bus.doubt(),
            Self::Socket(bus) => bus.doubt(),
            Self::Memory(_) => None,
        }
    }

    /// What the controller saw; `None` if the adapter cannot tell.
    pub(super) fn errors(&self) -> Option<BusErrors> {
        match self {
            Self::Slcan(_) => None,
            Self::Socket(bus) => Some(bus.errors()),
            // A bus in memory has no errors.
            Self::Memory(_) => Some(BusErrors::default()),
        }
    }

    /// The counters of the kernel for losses; `None` for a bus that is not an interface of the kernel.
    pub(super) fn statistics(&self) -> Option<Statistics> {
        match self {
            Self::Socket(bus) => Some(bus.statistics()),
            Self::Slcan(_) | Self::Memory(_) => None,
        }
    }

    pub(super) async fn close(self) {
        if let Self::Slcan(bus) = self {
            bus.close().await;
        }
    }
}
