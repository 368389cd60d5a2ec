//! Listening to a stream of the board.

use std::time::Duration;

use gnc_protocol::message::StreamStopReply;
use gnc_protocol::stream::{Losses, StreamHead, StreamId};
use gnc_protocol::wire::{FieldReader, Wire as _, WireError};
use tokio::sync::mpsc;
use tokio::time::{Instant, timeout_at};

use crate::error::{BoardError, gone};
use crate::latest::Follower;
use crate::status::BoardTime;

/// The board's clock may be this far ahead of the last sample before a stream counts as stopped: twice the time
/// between two heartbeats.
const BEHIND_US: u64 = 2_000_000;
/// Link time with heartbeats while the board's clock stands still, after which the stream counts as ended. So ends a
/// stream on a simulated bench at full speed when its last frame was lost.
const STANDS_FOR: Duration = Duration::from_millis(1500);

/// Longest time without a frame in which samples that the board has sent may still be on their way when its answer is
/// there. On CAN an answer overtakes samples that wait for the bus, and test frames of another program may hold them back.
const OVERTAKEN_FOR: Duration = Duration::from_millis(300);
/// Longest wait for all of them. A board keeps less than a second of samples for the bus.
const OVERTAKEN_WITHIN: Duration = Duration::from_secs(2);

/// Frames that may wait for the reader of a stream before the line is held up for it: a second of 1 kHz in single
/// samples.
pub(super) const WAITING: usize = 1024;
/// More frames that may come before an awaited answer. This is what a board says between a request and its RESULT, a
/// few times over: over CAN in pieces of six bytes, with a round trip for each message.
pub(super) const AHEAD: usize = 16_384;

/// A frame of a stream. The session copies the samples once out of the frame and leaves their decoding to the reader of
/// the stream.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleFrame {
    /// The head.
    pub head: StreamHead,
    /// The samples as bytes.
    pub samples: Box<[u8]>,
}

impl SampleFrame {
    /// Reads the payload of a STREAM frame.
    ///
    /// # Errors
    /// The payload is shorter than a head.
    pub(super) fn of(payload: &[u8]) -> Result<Self, WireError> {
        let mut reader = FieldReader::new(payload);
        Ok(Self { head: StreamHead::get(&mut reader)?, samples: reader.take_rest().into() })
    }
}

/// The frames of one stream, in the order in which they came.
#[derive(Debug)]
pub struct Stream {
    id: StreamId,
    frames: mpsc::Receiver<Result<SampleFrame, BoardError>>,
    board_time: Follower<BoardTime>,
    /// Board time up to which the reader knows the stream: of its newest frame, of the heartbeat at which it was told
    /// that there is none, or of the first heartbeat since it listens.
    seen_us: Option<u64>,
    /// Board time of the first heartbeat or frame since it listens.
    began_us: Option<u64>,
    /// Board time of the last heartbeat, and when that value came first.
    beat_us: Option<(u64, Instant)>,
    losses: Losses,
}

/// The counts of a stream that was stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Closed {
    /// Samples (bytes) that the board produced.
    pub produced: u32,
    /// Where the samples are.
    pub losses: Losses,
}

/// The newest frame of each stream since the board's last start: its board time, its first sample and the number after
/// its last sample.
#[derive(Debug, Default)]
pub(super) struct Newest(Vec<(StreamId, (u64, u32), u32)>);

impl Newest {
    /// Whether a frame is newer than all before it. A frame that came already, or that later ones overtook, is not new
    /// data: its samples are counted already, as received or as lost. Board time increases from one run of a stream to
    /// the next, and `first` increases within a run. A frame whose numbers continue those of the newest is data
    /// whatever its time: the board's clock went back, and the reader of the stream must see that.
    pub(super) fn admit(&mut self, stream: StreamId, head: &StreamHead) -> bool {
        let key = (head.board_time_us, head.first);
        let next = head.first.wrapping_add(head.count.into());
        match self.0.iter_mut().find(|(other, ..)| *other == stream) {
            Some((_, newest, end)) if key <= *newest && (head.first != *end || head.first == 0) => false,
            Some((_, newest, end)) => {
                (*newest, *end) = (key, next);
                true
            }
            None => {
                self.0.push((stream, key, next));
                true
            }
        }
    }
}

impl Stream {
    pub(super) fn new(
        id: StreamId,
        frames: mpsc::Receiver<Result<SampleFrame, BoardError>>,
        board_time: Follower<BoardTime>,
    ) -> Self {
        Self { id, frames, board_time, seen_us: None, began_us: None, beat_us: None, losses: Losses::default() }
    }

    /// Which stream.
    #[must_use]
    pub(crate) fn id(&self) -> StreamId {
        self.id
    }

    /// Samples that are missing up to the last frame.
    #[must_use]
    pub fn losses(&self) -> Losses {
        self.losses
    }

    /// The board's clock, as far as it is known.
    #[must_use]
    pub fn board_time_us(&self) -> u64 {
        self.board_time.now().board_time_us.max(self.seen_us.unwrap_or(0))
    }

    /// Board time of the first sign of the board since the reader listens.
    #[must_use]
    pub fn began_us(&self) -> Option<u64> {
        self.began_us
    }

    /// The next frame. `None` if the board's clock went on for two seconds without a frame, or stands still. Frames and
    /// heartbeats come over the same line in order, so a frame sent before a heartbeat has come or is lost.
    ///
    /// Before the first frame the two seconds begin at a heartbeat. The heartbeat before the stream does not tell when it
    /// began: a simulated board at ten times the speed has gone on by up to ten seconds since.
    ///
    /// # Errors
    /// The reason for which the conversation ended, if it did.
    pub async fn next(&mut self) -> Result<Option<SampleFrame>, BoardError> {
        loop {
            tokio::select! {
                biased;
                frame = self.frames.recv() => {
                    let frame = frame.unwrap_or_else(|| Err(gone()))?;
                    self.account(&frame.head);
                    return Ok(Some(frame));
                }
                beat = self.board_time.changed() => {
                    let now_us = beat.ok_or_else(gone)?.board_time_us;
                    let stands = self.stands(now_us);
                    self.began_us.get_or_insert(now_us);
                    let seen_us = *self.seen_us.get_or_insert(now_us);
                    if (stands || now_us > seen_us.saturating_add(BEHIND_US)) && self.frames.is_empty() {
                        self.seen_us = Some(now_us);
                        return Ok(None);
                    }
                }
            }
        }
    }

    /// Whether heartbeats have shown the same board time for too long.
    fn stands(&mut self, now_us: u64) -> bool {
        match self.beat_us {
            Some((before_us, since)) if before_us == now_us => since.elapsed() >= STANDS_FOR,
            _ => {
                self.beat_us = Some((now_us, Instant::now()));
                false
            }
        }
    }

    /// Waits for the board's counts of the stream, counts the frames that still come meanwhile, and closes the account.
    /// Samples that the board produced and neither dropped nor delivered were lost on the line.
    ///
    /// On RS-422 all samples leave before the answer. On CAN the lower id wins the bus, so an answer overtakes samples that
    /// wait for it. While samples are missing, they may still come.
    pub(super) async fn close(
        mut self,
        stopped: impl Future<Output = Result<StreamStopReply, BoardError>>,
    ) -> Result<Closed, BoardError> {
        tokio::pin!(stopped);
        let board = loop {
            tokio::select! {
                biased;
                frame = self.frames.recv() => match frame {
                    Some(frame) => self.account(&frame?.head),
                    None => break stopped.await?,
                },
                board = &mut stopped => break board?,
            }
        };
        while let Ok(frame) = self.frames.try_recv() {
            self.account(&frame?.head);
        }
        self.overtaken(&board).await?;
        self.losses.on_board = board.dropped;
        let Losses { received, on_board, .. } = self.losses;
        self.losses.on_line = board.produced.saturating_sub(received.saturating_add(on_board));
        Ok(Closed { produced: board.produced, losses: self.losses })
    }

    /// Waits for frames that the answer overtook, until none is missing or none comes any longer.
    async fn overtaken(&mut self, board: &StreamStopReply) -> Result<(), BoardError> {
        let until = Instant::now() + OVERTAKEN_WITHIN;
        while self.numbered() < board.produced {
            let next = until.min(Instant::now() + OVERTAKEN_FOR);
            match timeout_at(next, self.frames.recv()).await {
                Ok(Some(frame)) => self.account(&frame?.head),
                Ok(None) | Err(_) => break,
            }
        }
        Ok(())
    }

    /// The number after the last sample of the newest frame, from the start of the stream.
    fn numbered(&self) -> u32 {
        let Losses { received, on_board, on_line } = self.losses;
        received.saturating_add(on_board).saturating_add(on_line)
    }

    fn account(&mut self, head: &StreamHead) {
        let expected = self.numbered();
        let missing = head.first.saturating_sub(expected);
        let on_board = head.dropped.saturating_sub(self.losses.on_board).min(missing);
        self.losses.on_board = self.losses.on_board.saturating_add(on_board);
        self.losses.on_line = self.losses.on_line.saturating_add(missing - on_board);
        self.losses.received = self.losses.received.saturating_add(head.count.into());
        self.seen_us = Some(head.board_time_us);
        self.began_us.get_or_insert(head.board_time_us);
    }
}

#[cfg(test)]
mod tests {
    use futures_util::FutureExt as _;

    use super::*;
    use crate::latest::Latest;

    fn head(first: u32, count: u16, dropped: u32) -> StreamHead {
        StreamHead { first, count, dropped, ..StreamHead::default() }
    }

    /// 0-9 come, 10-14 are dropped on the board, 15-24 come, 25-34 are lost on the line, 35-44 come.
    #[test]
    fn losses_are_told_apart_by_place() {
        let (_sender, frames) = mpsc::channel(1);
        let beat = Latest::new(BoardTime::default());
        let mut stream = Stream::new(StreamId::Imu, frames, beat.follower());
        for part in [head(0, 10, 0), head(15, 10, 5), head(35, 10, 5)] {
            stream.account(&part);
        }
        assert_eq!(stream.losses(), Losses { received: 30, on_board: 5, on_line: 10 });
    }

    /// Heartbeats of a board at ten times the speed are ten seconds of its clock apart. One that comes before the first
    /// frame is no end of the stream; two without a frame are.
    #[tokio::test]
    async fn a_heartbeat_before_the_first_frame_ends_no_stream() {
        let beat = |seconds: u64| move |time: &mut BoardTime| time.board_time_us = seconds * 1_000_000;
        let clock = Latest::new(BoardTime::default());
        clock.change(beat(100));
        let (sender, frames) = mpsc::channel(1);
        let mut stream = Stream::new(StreamId::Imu, frames, clock.follower());
        assert!(stream.next().now_or_never().is_none(), "no frame yet");
        clock.change(beat(110));
        assert!(stream.next().now_or_never().is_none(), "the stream may have begun a moment ago");
        sender.try_send(Ok(SampleFrame { head: head(0, 10, 0), samples: Box::default() })).unwrap();
        assert!(stream.next().await.unwrap().is_some());

        let (_sender, frames) = mpsc::channel(1);
        let mut silent = Stream::new(StreamId::Imu, frames, clock.follower());
        clock.change(beat(120));
        assert!(silent.next().now_or_never().is_none());
        clock.change(beat(130));
        assert!(silent.next().await.unwrap().is_none());
        assert_eq!((silent.began_us(), silent.board_time_us()), (Some(120_000_000), 130_000_000));
    }

    /// Doubled and overtaken frames are not new data; frames of a stream's next run are.
    #[test]
    fn only_what_is_new_is_admitted() {
        let mut newest = Newest::default();
        let mut admit = |stream, board_time_us, first| {
            newest.admit(stream, &StreamHead { board_time_us, first, ..StreamHead::default() })
        };
        assert!(admit(StreamId::Gnss, 100, 0));
        assert!(!admit(StreamId::Gnss, 100, 0), "twice");
        assert!(admit(StreamId::Gnss, 100, 492), "one epoch in two frames");
        assert!(admit(StreamId::Pps, 50, 0), "another stream");
        assert!(admit(StreamId::Gnss, 300, 1400));
        assert!(!admit(StreamId::Gnss, 200, 900), "overtaken");
        assert!(admit(StreamId::Gnss, 900, 0), "the next run");
    }

    /// Numbers that go on while the time goes back mean a clock that went back, not an overtaken frame.
    #[test]
    fn a_clock_that_goes_back_is_shown() {
        let mut newest = Newest::default();
        let mut admit = |board_time_us, first| {
            newest.admit(StreamId::Imu, &StreamHead { board_time_us, first, count: 10, ..StreamHead::default() })
        };
        assert!(admit(7_000_000, 0) && admit(7_050_000, 10));
        assert!(!admit(7_000_000, 0), "twice");
        assert!(admit(100_000, 20), "the clock went back");
        assert!(!admit(100_000, 20), "twice");
        assert!(admit(150_000, 30));
    }

    /// Frames 0-9 come before the answer that ends the stream and 10-29 behind it: they were overtaken and are not lost.
    #[tokio::test(start_paused = true)]
    async fn what_the_answer_overtook_is_not_lost() {
        let (sender, frames) = mpsc::channel(1);
        let beat = Latest::new(BoardTime::default());
        let stream = Stream::new(StreamId::Gnss, frames, beat.follower());
        let board = async {
            for first in [0, 10, 20] {
                sender.send(Ok(SampleFrame { head: head(first, 10, 0), samples: Box::default() })).await.ok();
                tokio::time::sleep(OVERTAKEN_FOR / 2).await;
            }
        };
        let stopped = async { Ok(StreamStopReply { produced: 30, dropped: 0 }) };
        let (closed, ()) = tokio::join!(stream.close(stopped), board);
        let losses = Losses { received: 30, on_board: 0, on_line: 0 };
        assert_eq!(closed, Ok(Closed { produced: 30, losses }));
    }

    /// Frames 0-9 come, 10-19 are lost while the stream is being ended: only the board's figures tell.
    #[tokio::test(start_paused = true)]
    async fn the_last_frame_is_missed_too() {
        let (sender, frames) = mpsc::channel(1);
        let beat = Latest::new(BoardTime::default());
        let stream = Stream::new(StreamId::Imu, frames, beat.follower());
        sender.try_send(Ok(SampleFrame { head: head(0, 10, 0), samples: Box::default() })).ok();
        let closed = stream.close(async { Ok(StreamStopReply { produced: 20, dropped: 0 }) }).await;
        let losses = Losses { received: 10, on_board: 0, on_line: 10 };
        assert_eq!(closed, Ok(Closed { produced: 20, losses }));
    }
}
