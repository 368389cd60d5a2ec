//! What comes out of a link.

use std::time::Duration;

use gnc_protocol::Frame;
use gnc_protocol::frame::FrameError;

/// What comes out of a link.
pub type LinkEvent = Result<Frame, NoFrame>;

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
