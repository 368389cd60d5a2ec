//! The kinds of bus behind one face.

use std::io;
use std::time::Duration;

use gnc_protocol::can::CanFrame;

use super::BusErrors;
use super::interface::Statistics;
use super::memory::MemoryBus;
use super::slcan::SlcanBus;
use super::socket::SocketBus;

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
    /// The frame that was to go is on its way.
    Sent,
    /// A frame came.
    Received(CanFrame),
    /// The controller saw an error; its counters moved.
    Errors,
    /// The port or interface went away; it is looked for.
    Away,
    /// It is back, after so long.
    Back(Duration),
}

impl Bus {
    /// Sends the frame, or waits for one to come, whichever can be done first. Nothing is lost when it is dropped half
    /// way: a frame is either sent and said to be, or not sent.
    pub(super) async fn turn(&mut self, outgoing: Option<&CanFrame>, read: bool) -> io::Result<BusEvent> {
        match self {
            Self::Slcan(bus) => bus.turn(outgoing, read).await,
            Self::Socket(bus) => bus.turn(outgoing, read).await,
            Self::Memory(bus) => bus.turn(outgoing, read).await,
        }
    }

    /// The port or interface, as people call it.
    pub(super) fn name(&self) -> String {
        match self {
            Self::Slcan(bus) => bus.name(),
            Self::Socket(bus) => bus.name(),
            Self::Memory(_) => "bus in memory".to_owned(),
        }
    }

    /// What the controller saw; `None` if the adapter cannot tell.
    pub(super) fn errors(&self) -> Option<BusErrors> {
        match self {
            Self::Slcan(_) => None,
            Self::Socket(bus) => Some(bus.errors()),
            // Memory has no errors to see.
            Self::Memory(_) => Some(BusErrors::default()),
        }
    }

    /// Where the kernel counts losses; `None` for what is none of its interfaces.
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
