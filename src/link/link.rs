//! One type for links of both kinds.

use std::io;
use std::time::Duration;

use gnc_protocol::Frame;
use gnc_protocol::can::CanFrame;
use gnc_protocol::serial::LineCounters;

use crate::can::{CanLink, CanOpenError};
use crate::doubt::Doubt;
use crate::received::LinkEvent;
use crate::serial::{self, OpenError, SerialLink};
use crate::tape::Tape;
use crate::target::Target;

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
    /// Opens the target that a bench names.
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

    /// Takes a frame to send. A link that cannot send drops the frame: the missing answer shows this, and waiting
    /// frames must not use up memory.
    pub fn send(&mut self, frame: &Frame) {
        match self {
            Self::Serial(link) => link.send(frame),
            Self::Can(link) => link.send(frame),
        }
    }

    /// Takes bytes to send as they stand, for a test of the other end's receiver. Returns `false` on CAN, which carries no
    /// bytes.
    pub fn send_bytes(&mut self, bytes: &[u8]) -> bool {
        match self {
            Self::Serial(link) => link.send_bytes(bytes),
            Self::Can(_) => return false,
        }
        true
    }

    /// Takes a frame of the bus to send as it stands. Returns `false` on RS-422.
    pub fn send_can(&mut self, frame: CanFrame) -> bool {
        match self {
            Self::Serial(_) => return false,
            Self::Can(link) => link.send_raw(frame),
        }
        true
    }

    /// Begins to keep what comes as it comes, beside the frames that are made of it. What was kept before is forgotten.
    pub fn begin_tape(&mut self) {
        match self {
            Self::Serial(link) => link.begin_tape(),
            Self::Can(link) => link.begin_tape(),
        }
    }

    /// What came since [`Link::begin_tape`].
    #[must_use]
    pub fn tape(&self) -> &Tape {
        match self {
            Self::Serial(link) => link.tape(),
            Self::Can(link) => link.tape(),
        }
    }

    /// Sends waiting frames until something has come. A caller that drops this wait half way loses nothing. Without
    /// `read` it only sends, and returns only with an error.
    ///
    /// # Errors
    /// The link is gone and did not come back within [`crate::RETURNS_WITHIN`].
    pub async fn next(&mut self, read: bool) -> io::Result<LinkEvent> {
        match self {
            Self::Serial(link) => link.next(read).await,
            Self::Can(link) => link.next(read).await,
        }
    }

    /// The name of the port or interface for people.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Serial(link) => link.name(),
            Self::Can(link) => link.name(),
        }
    }

    /// Why the open link does not prove that hardware is at its other end; `None` if it does, and for a link in memory.
    #[must_use]
    pub fn doubt(&self) -> Option<&Doubt> {
        match self {
            Self::Serial(link) => link.doubt(),
            Self::Can(link) => link.doubt(),
        }
    }

    /// Bytes that came so far (CAN: frames under any id), whatever they are.
    #[must_use]
    pub fn came(&self) -> u64 {
        match self {
            Self::Serial(link) => link.came(),
            Self::Can(link) => link.came(),
        }
    }

    /// The counts of the line so far.
    #[must_use]
    pub fn counters(&self) -> LineCounters {
        match self {
            Self::Serial(link) => link.counters(),
            Self::Can(link) => link.counters(),
        }
    }

    /// Tells the link that the other end numbers its frames afresh.
    pub fn restart_sequence(&mut self) {
        match self {
            Self::Serial(link) => link.restart_sequence(),
            Self::Can(link) => link.restart_sequence(),
        }
    }

    /// Time on the wire for a request of this many bytes, one full frame before its answer, and the answer.
    #[must_use]
    pub fn exchange_time(&self, payload: usize) -> Duration {
        match self {
            Self::Serial(link) => link.exchange_time(payload),
            Self::Can(link) => link.exchange_time(payload),
        }
    }

    /// Leaves the line in a clean state.
    pub async fn close(self) {
        if let Self::Can(link) = self {
            link.close().await;
        }
    }
}
