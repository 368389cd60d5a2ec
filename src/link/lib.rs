//! Ways to reach a slave board. A link carries frames and knows nothing of what they mean.

mod absence;
pub mod can;
pub mod memory;
pub mod serial;

use std::fmt;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

use gnc_protocol::Frame;
use gnc_protocol::can as can_protocol;
use gnc_protocol::frame::FrameError;
use gnc_protocol::serial::LineCounters;

use can::{CanLink, CanOpenError, CanTarget};
use memory::MemoryPort;
use serial::{OpenError, SerialLink};

pub use absence::RETURNS_WITHIN;

/// What comes out of a link.
pub type Received = Result<Frame, NoFrame>;

/// What a link tells instead of a frame; none of it ends the link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoFrame {
    /// A frame that was damaged on the line.
    Damaged(FrameError),
    /// The port or interface went away; it is looked for until it is back.
    Away,
    /// It is back.
    Back {
        /// How long it was away.
        lasted: Duration,
    },
}

/// Which link reaches the board, and where it is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Target {
    /// RS-422.
    Serial {
        /// The port.
        port: PathBuf,
        /// Its rate.
        rate_baud: u32,
    },
    /// CAN.
    Can(CanTarget),
    /// RS-422 by a cable in this program's memory; no bench file names one.
    Memory(MemoryPort),
}

impl Target {
    /// The port or bus, as a bench file names it.
    #[must_use]
    pub fn port(&self) -> String {
        match self {
            Self::Serial { port, .. } => port.display().to_string(),
            Self::Memory(port) => port.to_string(),
            Self::Can(bus) => bus.to_string(),
        }
    }

    /// Bits in a second of its line.
    #[must_use]
    pub fn rate_bps(&self) -> u32 {
        match self {
            Self::Serial { rate_baud, .. } => *rate_baud,
            Self::Memory(port) => port.rate_baud(),
            Self::Can(_) => can_protocol::BIT_RATE,
        }
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = if matches!(self, Self::Can(_)) { "CAN " } else { "" };
        write!(f, "{kind}{} at {} bit/s", self.port(), self.rate_bps())
    }
}

/// An open link.
#[derive(Debug)]
pub enum Link {
    /// RS-422.
    Serial(Box<SerialLink>),
    /// CAN.
    Can(Box<CanLink>),
}

/// Why a link could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The serial port.
    #[error(transparent)]
    Serial(#[from] OpenError),
    /// The CAN bus.
    #[error(transparent)]
    Can(#[from] CanOpenError),
}

impl LinkError {
    /// What the operator can try.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        match self {
            Self::Serial(error) => error.try_this(),
            Self::Can(error) => error.try_this(),
        }
    }
}

impl Link {
    /// Opens what a bench names.
    ///
    /// # Errors
    /// [`LinkError`].
    pub fn open(target: &Target) -> Result<Self, LinkError> {
        match target {
            Target::Serial { port, rate_baud } => Ok(Self::Serial(Box::new(serial::open(port, *rate_baud)?))),
            Target::Memory(port) => Ok(Self::Serial(Box::new(serial::open_memory(port)?))),
            Target::Can(target) => Ok(Self::Can(Box::new(CanLink::open(target)?))),
        }
    }

    /// Takes a frame to send. A link that takes nothing drops it: that is found by the answers that do not come, and
    /// must not cost memory.
    pub fn send(&mut self, frame: &Frame) {
        match self {
            Self::Serial(link) => link.send(frame),
            Self::Can(link) => link.send(frame),
        }
    }

    /// Moves what waits until something has come. Nothing is lost when it is dropped half way. Without `read` it only
    /// sends, and never returns but with an error.
    ///
    /// # Errors
    /// The link is gone and did not come back within [`RETURNS_WITHIN`].
    pub async fn next(&mut self, read: bool) -> io::Result<Received> {
        match self {
            Self::Serial(link) => link.next(read).await,
            Self::Can(link) => link.next(read).await,
        }
    }

    /// The port or interface, as people call it.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Serial(link) => link.name(),
            Self::Can(link) => link.name(),
        }
    }

    /// What was seen so far.
    #[must_use]
    pub fn counters(&self) -> LineCounters {
        match self {
            Self::Serial(link) => link.counters(),
            Self::Can(link) => link.counters(),
        }
    }

    /// The other end numbers its frames afresh.
    pub fn restart_sequence(&mut self) {
        match self {
            Self::Serial(link) => link.restart_sequence(),
            Self::Can(link) => link.restart_sequence(),
        }
    }

    /// Time on the wire for a request of so many bytes, one full frame before its answer, and the answer.
    #[must_use]
    pub fn exchange_time(&self, payload: usize) -> Duration {
        match self {
            Self::Serial(link) => link.exchange_time(payload),
            Self::Can(link) => link.exchange_time(payload),
        }
    }

    /// Leaves the line in order.
    pub async fn close(self) {
        if let Self::Can(link) = self {
            link.close().await;
        }
    }
}
