//! The output of a link.

use std::time::Duration;

use gnc_protocol::Frame;
use gnc_protocol::frame::FrameError;

/// The output of a link: a frame, or an event without a frame.
pub type LinkEvent = Result<Frame, NoFrame>;

/// What a link reports instead of a frame. The link goes on after each of these events.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoFrame {
    /// A frame that was damaged on the line.
    Damaged(FrameError),
    /// The port or interface went away; the link looks for it until it is back.
    Away,
    /// The port or interface is back.
    Back {
        /// How long it was away.
        lasted: Duration,
    },
}
