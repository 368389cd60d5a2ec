//! The output of a link.

use std::time::Duration;

use gnc_protocol::Frame;
use gnc_protocol::frame::FrameError;

/// The output of a link: a frame, or an event without a frame.
pub type LinkEvent = Result<Frame, NoFrame>;

/// What a link reports instead of a frame. The link goes on after each of these events.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NoFrame {
    /// Bytes that are no frame: damaged on the line, or sent so.
    Damaged {
        /// What is wrong with them.
        error: FrameError,
        /// Their beginning as it came; empty on CAN.
        bytes: Box<[u8]>,
    },
    /// The port or interface went away; the link looks for it until it is back.
    Away,
    /// The port or interface is back.
    Back {
        /// How long it was away.
        lasted: Duration,
    },
}
