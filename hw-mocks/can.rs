//! The CAN bus of the simulated bench: the host's adapter, the slave board and the module on one pair of wires.
//!
//! Frames go one at a time, the lowest id first among those that wait, at the pace of the bit rate. What the host sends
//! reaches board and module; what those send reaches the host.

use std::collections::VecDeque;
use std::time::Duration;

use gnc_protocol::can::endpoint::{Endpoint, EndpointRole};
use gnc_protocol::can::{BIT_RATE, CanFrame, CanId, slcan};
use gnc_protocol::frame::{Frame, FrameError};
use gnc_protocol::serial::LineCounters;

use crate::can_faults::{CanWireFaults, FaultyBus};
use crate::fault_queue::Toll;
use crate::noise::{Dice, RandomStream};

/// Frames of streams that wait beyond which the board drops samples: 0.3 s of the bus.
const SAMPLES_WAIT: usize = 1024;
/// Frames that wait for the host beyond which they are lost, as in an adapter that nobody reads.
const HOST_WAITS: usize = 8192;
/// Frames taken from the host ahead of the bus.
const INPUT_WAIT: usize = 64;

/// The bus with the board's controller on it.
#[derive(Debug)]
pub(crate) struct CanBus {
    endpoint: Endpoint,
    /// What happens to frames between the host and the bus, either way.
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
    /// Nothing waited at the last look: the bus has been free since.
    idle: bool,
    /// Every so many frames towards the host one is lost; 0: none.
    lose_every: u32,
    sent: u32,
    lost: u32,
}

/// Who sends.
#[derive(Debug, Clone, Copy)]
enum Sender {
    Host,
    Board,
    Samples,
    Module,
}

impl CanBus {
    /// A bus that runs so many times as fast as a real one; `None`: without pace.
    pub(crate) fn new(times: Option<f64>, lose_every: u32, faults: CanWireFaults, seed: u64) -> Self {
        Self {
            endpoint: Endpoint::new(EndpointRole::Board),
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
            lose_every,
            sent: 0,
            lost: 0,
        }
    }

    /// Gives a bus without pace that of a real one: a kernel holds nobody up who sends faster than others read, and frames
    /// would be lost.
    pub(crate) fn pace(&mut self) {
        self.bit_ns = if self.bit_ns > 0.0 { self.bit_ns } else { 1e9 / f64::from(BIT_RATE) };
    }

    /// The board restarted: what it had to say is gone.
    pub(crate) fn restart(&mut self) {
        self.endpoint = Endpoint::new(EndpointRole::Board);
        self.events.clear();
        self.samples.clear();
    }

    /// The session ended: its samples are nobody's.
    pub(crate) fn drop_samples(&mut self) {
        self.samples.clear();
    }

    pub(crate) fn counters(&self) -> LineCounters {
        self.endpoint.counters()
    }

    /// Whether there is no room for samples.
    pub(crate) fn is_full(&self) -> bool {
        self.samples.len() > SAMPLES_WAIT
    }

    /// Whether everything that was said has left, and nobody is in the middle of a message: between the frames of a
    /// request no time shall pass on a bench at full speed.
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

    /// A frame from the host's adapter.
    pub(crate) fn push(&mut self, frame: CanFrame, now: Duration) {
        self.wire_to_board.push(frame, now);
    }

    /// What the faults between host and bus let through goes on.
    pub(crate) fn carry(&mut self, now: Duration) {
        self.from_host.extend(std::iter::from_fn(|| self.wire_to_board.pop(now)));
        self.to_host.extend(std::iter::from_fn(|| self.wire_to_host.pop(now)));
    }

    /// What the faults did: towards the host, among it what the bus itself lost, and towards the board. Nobody numbers
    /// raw frames, so that nothing is said of what a receiver can miss.
    pub(crate) fn tolls(&self) -> (Toll, Toll) {
        let to_host = self.wire_to_host.toll();
        (Toll { spoilt: to_host.spoilt + u64::from(self.lost), ..to_host }, self.wire_to_board.toll())
    }

    /// Whether a frame was lost or damaged between host and bus since this was asked last.
    pub(crate) fn take_harmed(&mut self) -> bool {
        self.wire_to_board.take_harmed() | self.wire_to_host.take_harmed()
    }

    /// A frame of the conversation for the host.
    pub(crate) fn send(&mut self, frame: &Frame) {
        let queue = if frame.header.kind == gnc_protocol::Kind::Stream { &mut self.samples } else { &mut self.events };
        self.endpoint.send(frame, &mut |raw| queue.push_back(raw));
    }

    /// A test frame that the module sends back.
    pub(crate) fn echo(&mut self, frame: CanFrame) {
        self.echoes.push_back(frame);
    }

    /// The next frame for the host.
    pub(crate) fn pop(&mut self) -> Option<CanFrame> {
        self.to_host.pop_front()
    }

    /// Lets the next frame pass, if the bus is free: gives what board and module hear of it. `None`: nothing can pass
    /// now.
    pub(crate) fn step(&mut self, now: Duration) -> Option<HeardFrame> {
        self.carry(now);
        if self.free_at > now {
            return None;
        }
        // A message's next frame is put in the row before anybody knows whether it wins.
        while let Some(frame) = self.endpoint.poll(now) {
            self.events.push_back(frame);
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

    /// What a frame from the host means to the board.
    pub(crate) fn understand(&mut self, frame: &CanFrame, now: Duration) -> Option<Result<Frame, FrameError>> {
        self.endpoint.receive(frame, now)
    }

    /// When the bus has something to do.
    pub(crate) fn next_due(&self) -> Option<Duration> {
        let queues = [&self.from_host, &self.events, &self.samples, &self.echoes];
        let waits = queues.iter().any(|queue| !queue.is_empty()).then_some(self.free_at);
        let message = self.endpoint.next_due().map(|due| due.max(self.free_at));
        [waits, message, self.wire_to_board.next_due(), self.wire_to_host.next_due()].into_iter().flatten().min()
    }
}

/// What board and module hear of a frame that passed.
#[derive(Debug)]
pub(crate) enum HeardFrame {
    /// Their own.
    Nothing,
    /// The host's.
    FromHost(CanFrame),
}

/// What decides on the bus: the 11 bits of either kind first, a standard frame before an extended one.
fn priority(id: CanId) -> (u32, bool, u32) {
    match id {
        CanId::Standard(id) => (u32::from(id), false, 0),
        CanId::Extended(id) => (id >> 18, true, id & 0x3_ffff),
    }
}

/// The host's slcan adapter: lines on a serial port, frames on the bus once it was opened.
#[derive(Debug, Default)]
pub struct Adapter {
    decoder: slcan::SlcanDecoder,
    open: bool,
    lines: VecDeque<u8>,
}

impl Adapter {
    /// Takes lines from the host; gives the frames for the bus.
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

    /// A frame off the bus for the host.
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

    /// The port took so many bytes of them.
    pub fn consume(&mut self, count: usize) {
        self.lines.drain(..count.min(self.lines.len()));
    }
}
