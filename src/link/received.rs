//! The output of a link.

use std::time::Duration;

use gnc_protocol::Frame;
use gnc_protocol::frame::FrameError;

/// The output of a link: a frame, or an event without a frame.
pub type LinkEvent = Result<Frame, NoFrame>;

/// What a link reports instead of a frame. The link goes on after each of these events.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NoFrame {
    /// A frame that was damaged on the line.
    Damaged(FrameError),
    /// A line of text instead of a frame: the other end prints on the line. The link counts it as malformed.
    Text(String),
    /// The port or interface went away; the link looks for it until it is back.
    Away,
    /// The port or interface is back.
    Back {
        /// How long it was away.
        lasted: Duration,
    },
}

/// The text that bytes which are no frame may be: at least this many printable characters and nothing else but the ends of
/// lines. Damaged frames are hardly ever so.
const SHORTEST_TEXT: usize = 4;

/// The bytes as text, if they are text.
pub(crate) fn text(bytes: &[u8]) -> Option<String> {
    let is_text = |byte: &u8| matches!(byte, b' '..=b'~' | b'\t' | b'\r' | b'\n' | 0x1b);
    let text = str::from_utf8(bytes).ok().filter(|_| bytes.iter().all(is_text))?.trim();
    (text.len() >= SHORTEST_TEXT).then(|| text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::text;

    #[test]
    fn what_a_board_prints_is_text_and_damage_is_not() {
        assert_eq!(text(b"boot ok, rev C\r\n").as_deref(), Some("boot ok, rev C"));
        for damage in [&b"\x02\x16\x01\x01\x02"[..], b"ok\r\n", b"", b"boot \xff", "Grün 12".as_bytes()] {
            assert_eq!(text(damage), None, "{damage:x?}");
        }
    }
}
