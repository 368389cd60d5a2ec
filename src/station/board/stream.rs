//! Listening to a stream of the board.

use gnc_protocol::stream::{StreamFrame, StreamId};
use tokio::sync::{mpsc, watch};

use super::{BoardError, Pulse};

/// The board's clock may be this far ahead of the last sample before a stream counts as stopped: twice the time
/// between two heartbeats.
const BEHIND_US: u64 = 2_000_000;

/// Frames of one stream, in the order they came.
#[derive(Debug)]
pub struct Stream {
    id: StreamId,
    frames: mpsc::Receiver<Result<Box<StreamFrame>, BoardError>>,
    pulse: watch::Receiver<Pulse>,
    seen_us: u64,
    losses: Losses,
}

/// What is missing from a stream, by place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Losses {
    /// Samples that came.
    pub received: u32,
    /// Samples that the board could not send.
    pub on_board: u32,
    /// Samples that left the board and did not arrive.
    pub on_line: u32,
}

impl Losses {
    /// Whether any sample is missing.
    #[must_use]
    pub fn any(&self) -> bool {
        self.on_board + self.on_line > 0
    }
}

impl Stream {
    pub(super) fn new(
        id: StreamId,
        frames: mpsc::Receiver<Result<Box<StreamFrame>, BoardError>>,
        pulse: watch::Receiver<Pulse>,
    ) -> Self {
        Self { id, frames, pulse, seen_us: 0, losses: Losses::default() }
    }

    /// Which stream.
    #[must_use]
    pub fn id(&self) -> StreamId {
        self.id
    }

    /// What is missing up to the last frame.
    #[must_use]
    pub fn losses(&self) -> Losses {
        self.losses
    }

    /// The board's clock, as far as it is known.
    #[must_use]
    pub fn board_time_us(&self) -> u64 {
        self.pulse.borrow().board_time_us.max(self.seen_us)
    }

    /// The next frame. `None`: the board's clock went on for two seconds without one. Frames and heartbeats come
    /// down the same line in order, so whatever was sent before a heartbeat has come, or is lost.
    ///
    /// # Errors
    /// The reason for which the conversation ended, if it did.
    pub async fn next(&mut self) -> Result<Option<Box<StreamFrame>>, BoardError> {
        if self.seen_us == 0 {
            self.seen_us = self.pulse.borrow().board_time_us;
        }
        loop {
            tokio::select! {
                biased;
                frame = self.frames.recv() => {
                    let frame = frame.unwrap_or_else(|| Err(super::gone()))?;
                    self.account(&frame);
                    return Ok(Some(frame));
                }
                beat = self.pulse.changed() => {
                    if beat.is_err() {
                        return Err(super::gone());
                    }
                    let now_us = self.pulse.borrow_and_update().board_time_us;
                    if now_us > self.seen_us + BEHIND_US && self.frames.is_empty() {
                        self.seen_us = now_us;
                        return Ok(None);
                    }
                }
            }
        }
    }

    fn account(&mut self, frame: &StreamFrame) {
        let head = &frame.head;
        let expected = self.losses.received + self.losses.on_board + self.losses.on_line;
        let missing = head.first.saturating_sub(expected);
        let on_board = head.dropped.saturating_sub(self.losses.on_board).min(missing);
        self.losses.on_board += on_board;
        self.losses.on_line += missing - on_board;
        self.losses.received += u32::from(head.count);
        self.seen_us = head.board_time_us;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gnc_protocol::stream::StreamHead;

    fn frame(first: u32, count: u16, dropped: u32) -> StreamFrame {
        let head = StreamHead { first, count, dropped, ..StreamHead::default() };
        StreamFrame { head, samples: gnc_protocol::wire::List::new() }
    }

    /// 0-9 come, 10-14 are dropped on the board, 15-24 come, 25-34 are lost on the line, 35-44 come.
    #[test]
    fn losses_are_told_apart_by_place() {
        let (_sender, frames) = mpsc::channel(1);
        let (_beat, pulse) = watch::channel(Pulse::default());
        let mut stream = Stream::new(StreamId::Imu, frames, pulse);
        for part in [frame(0, 10, 0), frame(15, 10, 5), frame(35, 10, 5)] {
            stream.account(&part);
        }
        assert_eq!(stream.losses(), Losses { received: 30, on_board: 5, on_line: 10 });
    }
}
