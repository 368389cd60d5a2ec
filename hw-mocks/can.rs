//! The CAN bus of the simulated bench: the host's adapter, the slave board and the module on one pair of wires.
//!
//! Frames go one at a time, at the pace of the bit rate. The waiting frame with the lowest id goes first. Frames of the
//! host reach board and module; frames of board and module reach the host.

use std::collections::VecDeque;
use std::time::Duration;

use gnc_protocol::can::endpoint::{Endpoint, EndpointRole};
use gnc_protocol::can::{BIT_RATE, CanFrame, CanId, slcan};
use gnc_protocol::frame::{Frame, FrameError};
use gnc_protocol::serial::LineCounters;

use crate::breaches::Breaches;
use crate::breaches::wire::CanFilter;
use crate::can_faults::FaultyBus;
use crate::fault_queue::Toll;
use crate::noise::{Dice, RandomStream};
use crate::personality::PersonalityModel;

/// Number of waiting stream frames beyond which the board drops samples: 0.3 s of the bus.
const SAMPLES_WAIT: usize = 1024;
/// Number of frames waiting for the host beyond which frames are lost, as in an adapter that is not read.
const HOST_WAITS: usize = 8192;
/// Frames that are taken from the host ahead of the bus.
const INPUT_WAIT: usize = 64;

/// The bus with the board's controller on it.
#[derive(Debug)]
pub(crate) struct CanBus {
    endpoint: Endpoint,
    breaches: Breaches,
    /// Between the board and the bus.
    filter: CanFilter,
    /// Faults of frames between the host and the bus, both ways.
    wire_to_board: FaultyBus,
    wire_to_host: FaultyBus,
    from_host: VecDeque<CanFrame>,
    events: VecDeque<CanFrame>,
    samples: VecDeque<CanFrame>,
    echoes: VecDeque<CanFrame>,
    to_host: VecDeque<CanFrame>,
    /// Time of a bit; zero for a bus without pace.
    bit_ns: f64,
    free_at: Duration,
    /// Whether the bus was idle at the last look: it has been free since.
    idle: bool,
    /// One frame is lost of this many towards the host; 0: none.
    lose_every: u32,
    sent: u32,
    lost: u32,
    /// Messages of the board since its start. Raw frames, signs of life and samples, are no messages.
    messages: u32,
}

/// The sender of a frame.
#[derive(Debug, Clone, Copy)]
enum Sender {
    Host,
    Board,
    Samples,
    Module,
}

impl CanBus {
    /// A bus that runs this many times as fast as a real one; `None`: without pace.
    pub(crate) fn new(times: Option<f64>, model: &PersonalityModel, seed: u64) -> Self {
        let faults = &model.can_wire;
        Self {
            endpoint: Endpoint::new(EndpointRole::Board),
            filter: CanFilter::new(&model.breaches),
            breaches: model.breaches.clone(),
            wire_to_board: FaultyBus::new(faults.to_board, Dice::new(seed, RandomStream::CanToBoard)),
            wire_to_host: FaultyBus::new(faults.to_host, Dice::new(seed, RandomStream::CanToHost)),
            from_host: VecDeque::new(),
            events: VecDeque::new(),
            samples: VecDeque::new(),
            echoes: VecDeque::new(),
            to_host: VecDeque::new(),
            bit_ns: times.map_or(0.0, |times| 1e9 / f64::from(BIT_RATE) / times.max(1.0)),
            free_at: Duration::ZERO,
            idle: true,
            lose_every: model.wire.can_lose_every,
            sent: 0,
            lost: 0,
            messages: 0,
        }
    }

    /// Gives a bus without pace the pace of a real one. A kernel does not block a sender that sends faster than others
    /// read, so frames would be lost.
    pub(crate) fn pace(&mut self) {
        self.bit_ns = if self.bit_ns > 0.0 { self.bit_ns } else { 1e9 / f64::from(BIT_RATE) };
    }

    /// Drops the board's output after a restart.
    pub(crate) fn restart(&mut self) {
        self.endpoint = Endpoint::new(EndpointRole::Board);
        self.filter = CanFilter::new(&self.breaches);
        self.messages = 0;
        self.events.clear();
        self.samples.clear();
    }

    /// Drops the samples of a session that ended.
    pub(crate) fn drop_samples(&mut self) {
        self.samples.clear();
    }

    pub(crate) fn counters(&self) -> LineCounters {
        self.endpoint.counters()
    }

    /// Messages that the board has sent since its start.
    pub(crate) fn messages(&self) -> u32 {
        self.messages
    }

    /// Whether there is no room for samples.
    pub(crate) fn is_full(&self) -> bool {
        self.samples.len() > SAMPLES_WAIT
    }

    /// Whether all output has left and no sender is in the middle of a message. On a bench at full speed no time may
    /// pass between the frames of a request.
    pub(crate) fn is_quiet(&self) -> bool {
        self.endpoint.is_idle()
            && self.to_host.is_empty()
            && self.wire_to_board.len() + self.wire_to_host.len() == 0
            && [&self.from_host, &self.events, &self.samples, &self.echoes].iter().all(|queue| queue.is_empty())
    }

    /// How many frames [`CanBus::push`] takes now.
    pub(crate) fn room(&self) -> usize {
        INPUT_WAIT.saturating_sub(self.from_host.len() + self.wire_to_board.len())
    }

    /// Takes a frame from the host's adapter.
    pub(crate) fn push(&mut self, frame: CanFrame, now: Duration) {
        self.wire_to_board.push(frame, now);
    }

    /// Passes on frames that the faults between host and bus let through.
    pub(crate) fn carry(&mut self, now: Duration) {
        self.from_host.extend(std::iter::from_fn(|| self.wire_to_board.pop(now)));
        self.to_host.extend(std::iter::from_fn(|| self.wire_to_host.pop(now)));
    }

    /// Counts of the faults: towards the host, including losses on the bus itself, and towards the board. Raw frames
    /// have no numbers, so there is no count of losses that a receiver can notice.
    pub(crate) fn tolls(&self) -> (Toll, Toll) {
        let to_host = self.wire_to_host.toll();
        (Toll { spoilt: to_host.spoilt + u64::from(self.lost), ..to_host }, self.wire_to_board.toll())
    }

    /// Whether a frame was lost or damaged between host and bus since the last call.
    pub(crate) fn take_harmed(&mut self) -> bool {
        self.wire_to_board.take_harmed() | self.wire_to_host.take_harmed()
    }

    /// Queues a frame of the conversation for the host.
    pub(crate) fn send(&mut self, frame: &Frame) {
        let kind = frame.header.kind;
        let is_message = !matches!(kind, gnc_protocol::Kind::Stream | gnc_protocol::Kind::Event);
        self.messages = self.messages.wrapping_add(is_message.into());
        let queue = if kind == gnc_protocol::Kind::Stream { &mut self.samples } else { &mut self.events };
        let filter = &mut self.filter;
        self.endpoint.send(frame, &mut |raw| filter.pass(raw, |raw| queue.push_back(raw)));
    }

    /// Queues a test frame that the module sends back.
    pub(crate) fn echo(&mut self, frame: CanFrame) {
        self.echoes.push_back(frame);
    }

    /// The next frame for the host.
    pub(crate) fn pop(&mut self) -> Option<CanFrame> {
        self.to_host.pop_front()
    }

    /// Lets the next frame pass if the bus is free, and returns what board and module receive. `None`: no frame can
    /// pass now.
    pub(crate) fn step(&mut self, now: Duration) -> Option<HeardFrame> {
        self.carry(now);
        if self.free_at > now {
            return None;
        }
        // The next frame of a message is queued before the arbitration is decided.
        while let Some(frame) = self.endpoint.poll(now) {
            let events = &mut self.events;
            self.filter.pass(frame, |raw| events.push_back(raw));
        }
        let heads = [
            (Sender::Host, self.from_host.front()),
            (Sender::Board, self.events.front()),
            (Sender::Samples, self.samples.front()),
            (Sender::Module, self.echoes.front()),
        ];
        let waiting = heads.into_iter().filter_map(|(sender, head)| Some((priority(head?.id()), sender)));
        let Some((_, sender)) = waiting.min_by_key(|(priority, _)| *priority) else {
            self.idle = true;
            return None;
        };
        if std::mem::take(&mut self.idle) {
            self.free_at = self.free_at.max(now);
        }
        let queue = match sender {
            Sender::Host => &mut self.from_host,
            Sender::Board => &mut self.events,
            Sender::Samples => &mut self.samples,
            Sender::Module => &mut self.echoes,
        };
        let frame = queue.pop_front()?;
        self.free_at += Duration::from_nanos((f64::from(frame.worst_bits()) * self.bit_ns) as u64);
        if matches!(sender, Sender::Host) {
            return Some(HeardFrame::FromHost(frame));
        }
        self.sent = self.sent.wrapping_add(1);
        let lost = self.lose_every != 0 && self.sent.is_multiple_of(self.lose_every);
        self.lost += u32::from(lost);
        if !lost && self.to_host.len() + self.wire_to_host.len() < HOST_WAITS {
            self.wire_to_host.push(frame, now);
        }
        self.carry(now);
        Some(HeardFrame::Nothing)
    }

    /// Decodes a frame from the host for the board.
    pub(crate) fn understand(&mut self, frame: &CanFrame, now: Duration) -> Option<Result<Frame, FrameError>> {
        self.endpoint.receive(frame, now)
    }

    /// The time at which the bus has work to do.
    pub(crate) fn next_due(&self) -> Option<Duration> {
        let queues = [&self.from_host, &self.events, &self.samples, &self.echoes];
        let waits = queues.iter().any(|queue| !queue.is_empty()).then_some(self.free_at);
        let message = self.endpoint.next_due().map(|due| due.max(self.free_at));
        [waits, message, self.wire_to_board.next_due(), self.wire_to_host.next_due()].into_iter().flatten().min()
    }
}

/// A frame that passed, as board and module receive it.
#[derive(Debug)]
pub(crate) enum HeardFrame {
    /// Their own frame.
    Nothing,
    /// A frame of the host.
    FromHost(CanFrame),
}

/// The key of the arbitration: the 11 bits of both kinds first, then a standard frame before an extended one.
fn priority(id: CanId) -> (u32, bool, u32) {
    match id {
        CanId::Standard(id) => (u32::from(id), false, 0),
        CanId::Extended(id) => (id >> 18, true, id & 0x3_ffff),
    }
}

/// The host's slcan adapter: lines on a serial port, frames on the bus after it was opened.
#[derive(Debug, Default)]
pub struct Adapter {
    decoder: slcan::SlcanDecoder,
    open: bool,
    lines: VecDeque<u8>,
}

impl Adapter {
    /// Takes lines from the host; returns the frames for the bus.
    #[must_use]
    pub fn receive(&mut self, mut bytes: &[u8]) -> Vec<CanFrame> {
        let mut frames = Vec::new();
        while let Some(item) = self.decoder.next(&mut bytes) {
            match item {
                slcan::SlcanEvent::Frame(frame) if self.open => frames.push(frame),
                slcan::SlcanEvent::Open | slcan::SlcanEvent::Listen => self.answer(b'\r', true),
                slcan::SlcanEvent::Close => {
                    self.lines.clear();
                    self.answer(b'\r', false);
                }
                slcan::SlcanEvent::Rate(6) if !self.open => self.answer(b'\r', false),
                slcan::SlcanEvent::Frame(_)
                | slcan::SlcanEvent::Remote(_)
                | slcan::SlcanEvent::Rate(_)
                | slcan::SlcanEvent::Other(_) => {
                    self.answer(7, self.open);
                }
                slcan::SlcanEvent::Refused => {}
            }
        }
        frames
    }

    fn answer(&mut self, byte: u8, open: bool) {
        self.open = open;
        self.lines.push_back(byte);
    }

    /// Takes a frame from the bus for the host.
    pub fn send(&mut self, frame: &CanFrame) {
        if self.open {
            self.lines.extend(slcan::encode(frame));
        }
    }

    /// Lines for the host.
    #[must_use]
    pub fn output(&mut self) -> &[u8] {
        self.lines.make_contiguous()
    }

    /// Removes bytes that the port took.
    pub fn consume(&mut self, count: usize) {
        self.lines.drain(..count.min(self.lines.len()));
    }
}
