//! Both ends of the CAN link. Frames of the conversation go in and CAN frames come out, and the other way round.
//!
//! Signs of life and samples are raw frames. Everything else travels by ISO-TP, as header, payload and checksum, in one
//! of two channels. The urgent one carries HELLO, MAKE_SAFE, ABORT and their answers; the other one carries the rest.
//! So neither a long result nor a transfer that hangs delays the stop.

use core::time::Duration;

use heapless::{Deque, Vec};

use super::isotp::{self, Failure, Flow, FlowSettings, IsoTpReceived, IsoTpReceiver, IsoTpSender};
use super::stream::{Packer, Unpacker};
use super::{CanFrame, CanId, id};
use crate::frame::{Frame, FrameError, MAX_FRAME};
use crate::message::{Abort, Heartbeat, MakeSafe, StreamStart, event};
use crate::serial::LineCounters;
use crate::stream::{StreamFrame, StreamId, stream_header};
use crate::wire::Wire as _;
use crate::{Call as _, Flags, Header, Kind, PROTOCOL_VERSION, Payload};

/// Messages that wait for a channel: four requests that end at once, and the messages before them.
pub const QUEUE: usize = 16;
/// First byte of the raw frames under [`id::BOARD_EVENTS`].
const BEAT_WHO: u8 = 0;
const BEAT_WHEN: u8 = 1;
const WATCHDOG: u8 = 2;
/// The bytes of the nonce in the payload of the host's HELLO.
const NONCE: core::ops::Range<usize> = 6..10;

type Pdu = Vec<u8, MAX_FRAME>;

/// The two ends of the link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EndpointRole {
    /// The end that sends commands.
    Host,
    /// The end that sends answers.
    Board,
}

#[derive(Debug)]
struct Channel {
    out: u16,
    back: u16,
    sender: IsoTpSender<MAX_FRAME>,
    receiver: IsoTpReceiver<MAX_FRAME>,
    waiting: Deque<Pdu, QUEUE>,
    /// Flow control to send; it goes before everything else.
    flow: Option<Flow>,
    sequence: u16,
    expected: Option<u16>,
}

impl Channel {
    fn new(out: u16, back: u16) -> Self {
        Self {
            out,
            back,
            sender: IsoTpSender::default(),
            receiver: IsoTpReceiver::default(),
            waiting: Deque::new(),
            flow: None,
            sequence: 0,
            expected: None,
        }
    }

    /// Drops all messages that wait or are on their way out.
    fn drop_outgoing(&mut self) {
        self.waiting.clear();
        self.sender.cancel();
    }

    fn poll(&mut self, now: Duration) -> Option<CanFrame> {
        if let Some(flow) = self.flow.take() {
            return CanFrame::new(CanId::Standard(self.out), &flow.to_bytes());
        }
        if self.sender.is_idle()
            && let Some(pdu) = self.waiting.pop_front()
        {
            // The sender is idle, and the message is not empty and fits its buffer, so the sender cannot refuse.
            let _ = self.sender.start(&pdu);
        }
        let data = self.sender.poll(now)?;
        CanFrame::new(CanId::Standard(self.out), &data)
    }

    fn next_due(&self) -> Option<Duration> {
        if self.flow.is_some() || self.sender.is_idle() && !self.waiting.is_empty() {
            return Some(Duration::ZERO);
        }
        [self.sender.next_due(), self.receiver.next_due()].into_iter().flatten().min()
    }

    fn is_idle(&self) -> bool {
        self.flow.is_none() && self.waiting.is_empty() && self.sender.is_idle() && self.receiver.is_idle()
    }
}

/// Counts of messages that went wrong on their way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TransferCounters {
    /// Messages given up because flow control did not come, or because the receiver refused.
    pub not_sent: u32,
    /// Messages with a missing part, or that took too long.
    pub not_received: u32,
    /// Messages for which no room was left.
    pub crowded_out: u32,
    /// Frames under the ids of this protocol without a meaning.
    pub strange: u32,
}

/// One end of the link.
#[derive(Debug)]
pub struct Endpoint {
    role: EndpointRole,
    urgent: Channel,
    work: Channel,
    nonce: Option<[u8; 4]>,
    packer: Packer,
    unpacker: Unpacker,
    /// Beat number, boot id and state, until the frame with the time has come too.
    beat: Option<(u8, u32, u8)>,
    beats: u8,
    counters: LineCounters,
    transfers: TransferCounters,
}

impl Endpoint {
    /// Makes the end of the host or of the board.
    #[must_use]
    pub fn new(role: EndpointRole) -> Self {
        let (urgent, work) = match role {
            EndpointRole::Host => (
                Channel::new(id::URGENT_TO_BOARD, id::URGENT_TO_HOST),
                Channel::new(id::WORK_TO_BOARD, id::WORK_TO_HOST),
            ),
            EndpointRole::Board => (
                Channel::new(id::URGENT_TO_HOST, id::URGENT_TO_BOARD),
                Channel::new(id::WORK_TO_HOST, id::WORK_TO_BOARD),
            ),
        };
        Self {
            role,
            urgent,
            work,
            nonce: None,
            packer: Packer::default(),
            unpacker: Unpacker::default(),
            beat: None,
            beats: 0,
            counters: LineCounters::default(),
            transfers: TransferCounters::default(),
        }
    }

    /// Messages received, as on a serial line: broken transfers count as malformed.
    #[must_use]
    pub fn counters(&self) -> LineCounters {
        let TransferCounters { not_received, strange, .. } = self.transfers;
        let malformed = self.counters.malformed.wrapping_add(not_received).wrapping_add(strange);
        LineCounters { malformed, ..self.counters }
    }

    /// What went wrong below the messages.
    #[must_use]
    pub fn transfers(&self) -> TransferCounters {
        self.transfers
    }

    /// Forgets the sequence numbers of the other end.
    pub fn restart_sequence(&mut self) {
        (self.urgent.expected, self.work.expected) = (None, None);
    }

    /// Asks the other end for blocks and pauses, as an end with less room would. Messages that are on their way in are
    /// forgotten.
    pub fn ask_for(&mut self, settings: FlowSettings) {
        for channel in [&mut self.urgent, &mut self.work] {
            channel.receiver = IsoTpReceiver::new(settings);
        }
    }

    /// Whether no message waits or is on its way, out or in.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.urgent.is_idle() && self.work.is_idle()
    }

    /// Takes a frame of the conversation. Raw frames go to `raw` at once, messages wait for [`Endpoint::poll`].
    ///
    /// The sequence number is replaced: on CAN each channel counts its own messages.
    pub fn send(&mut self, frame: &Frame, raw: &mut impl FnMut(CanFrame)) {
        match frame.header.kind {
            Kind::Event => self.send_event(frame, raw),
            Kind::Stream => {
                if let Ok(samples) = StreamFrame::from_payload(&frame.payload) {
                    self.packer.pack(&samples, raw);
                }
            }
            kind => {
                if kind == Kind::Hello {
                    self.greeted(&frame.payload);
                }
                if kind == Kind::Request && !frame.header.flags.has(Flags::RESENT) {
                    self.note_stream(frame);
                }
                let channel = if is_urgent(&frame.header) { &mut self.urgent } else { &mut self.work };
                let mut frame = frame.clone();
                frame.header.sequence = channel.sequence;
                channel.sequence = channel.sequence.wrapping_add(1);
                if channel.waiting.push_back(frame.to_bytes()).is_err() {
                    self.transfers.crowded_out = self.transfers.crowded_out.wrapping_add(1);
                }
            }
        }
    }

    /// The next frame of a message that may go now.
    pub fn poll(&mut self, now: Duration) -> Option<CanFrame> {
        self.expire(now);
        self.urgent.poll(now).or_else(|| self.work.poll(now))
    }

    /// When [`Endpoint::poll`] has something to do, if no frame arrives before; it may lie in the past.
    #[must_use]
    pub fn next_due(&self) -> Option<Duration> {
        [self.urgent.next_due(), self.work.next_due()].into_iter().flatten().min()
    }

    /// Takes a frame from the bus; `None` if it completes nothing or does not belong to this protocol.
    pub fn receive(&mut self, can: &CanFrame, now: Duration) -> Option<Result<Frame, FrameError>> {
        let CanId::Standard(number) = can.id() else { return None };
        match number {
            _ if number == self.urgent.back => self.take(true, can.data(), now),
            _ if number == self.work.back => self.take(false, can.data(), now),
            id::KEEP_ALIVE if self.role == EndpointRole::Board => {
                Some(Ok(event_frame(event::KEEP_ALIVE, Payload::new())))
            }
            id::BOARD_EVENTS if self.role == EndpointRole::Host => self.board_event(can.data()).map(Ok),
            id::IMU_GYRO..=id::COMPENSATED_CLOCK if self.role == EndpointRole::Host => {
                let samples = self.unpacker.receive(number, can.data())?;
                let stream = StreamId::from_number(samples.head.stream)?;
                Some(Ok(Frame { header: stream_header(stream), payload: samples.to_payload().ok()? }))
            }
            _ => None,
        }
    }

    fn take(&mut self, urgent: bool, data: &[u8], now: Duration) -> Option<Result<Frame, FrameError>> {
        self.expire(now);
        let channel = if urgent { &mut self.urgent } else { &mut self.work };
        if isotp::is_flow_control(data) {
            let gone = u32::from(channel.sender.flow(data, now).is_err());
            self.transfers.not_sent = self.transfers.not_sent.wrapping_add(gone);
            return None;
        }
        match channel.receiver.receive(data, now) {
            IsoTpReceived::Nothing => None,
            IsoTpReceived::Flow(flow) => {
                channel.flow = Some(flow);
                None
            }
            IsoTpReceived::Failed(failure) => {
                match failure {
                    Failure::Malformed => self.transfers.strange = self.transfers.strange.wrapping_add(1),
                    Failure::TooLong { .. } => channel.flow = Some(Flow::Overflow),
                    Failure::Sequence { .. } | Failure::Timeout => {}
                }
                let lost = u32::from(failure != Failure::Malformed);
                self.transfers.not_received = self.transfers.not_received.wrapping_add(lost);
                None
            }
            IsoTpReceived::Complete => {
                let outcome = Frame::from_bytes(channel.receiver.pdu());
                match &outcome {
                    Ok(frame) => self.count(urgent, frame),
                    Err(FrameError::Checksum { .. }) => {
                        self.counters.bad_checksum = self.counters.bad_checksum.wrapping_add(1);
                    }
                    Err(_) => self.counters.malformed = self.counters.malformed.wrapping_add(1),
                }
                Some(outcome)
            }
        }
    }

    fn count(&mut self, urgent: bool, frame: &Frame) {
        if frame.header.kind == Kind::Hello && self.role == EndpointRole::Board {
            self.greeted(&frame.payload);
            self.restart_sequence();
        }
        if frame.header.kind == Kind::Request
            && self.role == EndpointRole::Board
            && !frame.header.flags.has(Flags::RESENT)
        {
            self.note_stream(frame);
        }
        let channel = if urgent { &mut self.urgent } else { &mut self.work };
        let sequence = frame.header.sequence;
        if let Some(expected) = channel.expected.filter(|_| frame.header.kind != Kind::Hello) {
            let missing = sequence.wrapping_sub(expected);
            // A step back is a restart, not 65,000 losses.
            if missing < 0x8000 {
                self.counters.missing = self.counters.missing.wrapping_add(u32::from(missing));
            }
        }
        channel.expected = Some(sequence.wrapping_add(1));
        self.counters.frames = self.counters.frames.wrapping_add(1);
    }

    /// Handles a HELLO: drops answers that block the channel because they were not fetched, and answers of another
    /// session.
    fn greeted(&mut self, payload: &[u8]) {
        let nonce = payload.get(NONCE).and_then(|bytes| bytes.try_into().ok());
        if self.role == EndpointRole::Board || self.nonce != nonce {
            self.urgent.drop_outgoing();
        }
        if self.nonce != nonce {
            self.work.drop_outgoing();
            self.work.receiver.cancel();
            self.nonce = nonce;
        }
    }

    /// Restarts the numbers of a stream's samples at both ends when the host requests the stream.
    fn note_stream(&mut self, frame: &Frame) {
        if frame.header.message == StreamStart::ID
            && let Ok(start) = StreamStart::from_payload(&frame.payload)
        {
            match self.role {
                EndpointRole::Host => self.unpacker.start(&start),
                EndpointRole::Board => self.packer.start(&start),
            }
        }
    }

    fn expire(&mut self, now: Duration) {
        for channel in [&mut self.urgent, &mut self.work] {
            let (sent, received) = (channel.sender.expire(now), channel.receiver.expire(now));
            self.transfers.not_sent = self.transfers.not_sent.wrapping_add(u32::from(sent.is_err()));
            self.transfers.not_received = self.transfers.not_received.wrapping_add(u32::from(received.is_err()));
        }
    }

    fn send_event(&mut self, frame: &Frame, raw: &mut impl FnMut(CanFrame)) {
        let number = if self.role == EndpointRole::Host { id::KEEP_ALIVE } else { id::BOARD_EVENTS };
        let mut send = |bytes: &[u8]| {
            CanFrame::new(CanId::Standard(number), bytes).map(&mut *raw);
        };
        match frame.header.message {
            event::KEEP_ALIVE => send(&[]),
            event::WATCHDOG => send(&[WATCHDOG]),
            event::HEARTBEAT => {
                let Ok(beat) = Heartbeat::from_payload(&frame.payload) else { return };
                self.beats = self.beats.wrapping_add(1);
                let [b0, b1, b2, b3] = beat.boot_id.to_le_bytes();
                let [t0, t1, t2, t3, t4, t5, ..] = beat.board_time_us.to_le_bytes();
                send(&[BEAT_WHO, self.beats, b0, b1, b2, b3, beat.state, 0]);
                send(&[BEAT_WHEN, self.beats, t0, t1, t2, t3, t4, t5]);
            }
            _ => {}
        }
    }

    fn board_event(&mut self, data: &[u8]) -> Option<Frame> {
        match *data {
            [BEAT_WHO, number, b0, b1, b2, b3, state, ..] => {
                self.beat = Some((number, u32::from_le_bytes([b0, b1, b2, b3]), state));
                None
            }
            [BEAT_WHEN, number, t0, t1, t2, t3, t4, t5] => {
                let (_, boot_id, state) = self.beat.take_if(|(first, _, _)| *first == number)?;
                let board_time_us = u64::from_le_bytes([t0, t1, t2, t3, t4, t5, 0, 0]);
                let payload = Heartbeat { boot_id, board_time_us, state }.to_payload().ok()?;
                Some(event_frame(event::HEARTBEAT, payload))
            }
            [WATCHDOG, ..] => Some(event_frame(event::WATCHDOG, Payload::new())),
            _ => None,
        }
    }
}

/// Whether the message is HELLO, MAKE_SAFE, ABORT or an answer to them. An answer carries the same message id.
fn is_urgent(header: &Header) -> bool {
    header.kind == Kind::Hello || header.message == MakeSafe::ID || header.message == Abort::ID
}

fn event_frame(message: u16, payload: Payload) -> Frame {
    let (kind, flags) = (Kind::Event, Flags::default());
    Frame { header: Header { version: PROTOCOL_VERSION, kind, flags, request: 0, message, sequence: 0 }, payload }
}
