//! CAN: commands by ISO-TP, streams as raw frames, and test frames beside them for items that test the bus itself.

mod bus;
mod interface;
mod kind;
mod memory;
pub mod slcan;
mod socket;

use std::collections::VecDeque;
use std::fmt;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

use gnc_protocol::Frame;
use gnc_protocol::can::endpoint::{Endpoint, EndpointRole};
use gnc_protocol::can::id::{echo_of, is_echo};
use gnc_protocol::can::isotp::FlowSettings;
use gnc_protocol::can::{CanFrame, bus_time, worst_bits};
use gnc_protocol::frame::{CRC, HEADER, MAX_FRAME};
use gnc_protocol::serial::LineCounters;
use tokio::sync::{mpsc, watch};
use tokio::time::{Instant, sleep_until};

use super::memory::MemoryPort;
use super::serial::{OpenError, PortLocation};
use crate::doubt::Doubt;
use crate::received::{LinkEvent, NoFrame};
use crate::tape::Tape;
use bus::{Bus, BusEvent};
pub use memory::MemoryEnd;

/// Raw frames that may wait while the bus does not take them.
const OUTGOING: usize = 256;
/// Test frames under way in either direction; an item that tests the bus keeps fewer in flight.
pub(crate) const TEST_FRAMES: usize = 64;

/// A bus as a bench file names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CanTarget {
    /// An adapter that speaks slcan, on a serial port: `slcan:/dev/ttyACM0`.
    Slcan(PathBuf),
    /// An interface of the kernel: `can0`.
    Interface(String),
    /// An adapter that speaks slcan, in this program; a bench file cannot name it.
    Memory(MemoryPort),
}

impl CanTarget {
    /// Reads the name in a bench file.
    #[must_use]
    pub fn parse(name: &str) -> Self {
        match name.strip_prefix("slcan:") {
            Some(port) => Self::Slcan(port.into()),
            None => Self::Interface(name.to_owned()),
        }
    }
}

impl CanTarget {
    /// Why the bus does not prove that hardware is at its other end, by its name and before it is opened. One that is not
    /// there has no doubt: opening it says what is wrong.
    #[must_use]
    pub fn doubt(&self) -> Option<Doubt> {
        match self {
            Self::Slcan(port) => Doubt::of_port(port),
            Self::Interface(name) => interface::index(name).and_then(|index| interface::doubt(name, index)),
            Self::Memory(_) => None,
        }
    }
}

impl fmt::Display for CanTarget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Slcan(port) => write!(f, "slcan:{}", port.display()),
            Self::Interface(name) => f.write_str(name),
            Self::Memory(port) => write!(f, "slcan:{port}"),
        }
    }
}

/// Why a bus could not be joined.
#[derive(Debug, thiserror::Error)]
pub enum CanOpenError {
    /// The port of an slcan adapter.
    #[error(transparent)]
    Port(#[from] OpenError),
    /// The kernel was built without CAN.
    #[error("this computer's kernel does not support CAN, so there is no interface {interface}")]
    NoKernel {
        /// The interface that was asked for.
        interface: String,
    },
    /// There is no such interface.
    #[error("there is no network interface {interface}")]
    Missing {
        /// The interface that was asked for.
        interface: String,
    },
    /// An interface of another kind.
    #[error("the network interface {interface} is not a CAN interface")]
    NotCan {
        /// The interface that was asked for.
        interface: String,
    },
    /// The interface is switched off.
    #[error("the CAN interface {interface} is down")]
    Down {
        /// The interface that was asked for.
        interface: String,
    },
    /// Any other error of the system.
    #[error("cannot open the CAN interface {interface}")]
    System {
        /// The interface that was asked for.
        interface: String,
        /// What the system said.
        source: io::Error,
    },
}

impl CanOpenError {
    /// What the operator can try.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        match self {
            Self::Port(error) => error.try_this(),
            Self::NoKernel { .. } => {
                "use an slcan adapter (port = \"slcan:/dev/ttyACM0\"), or a kernel with CONFIG_CAN"
            }
            Self::Missing { .. } => "is the adapter plugged in? `ip -br link` lists what is there",
            Self::NotCan { .. } => {
                "check [can] port in the bench file; `ip -br link show type can` lists what is there"
            }
            Self::Down { .. } => {
                "switch it on: `sudo ip link set NAME up type can bitrate 500000` (vcan: without type)"
            }
            Self::System { .. } => "check the adapter, and that this user may use it",
        }
    }
}

/// Whether there is a CAN interface of this name that is switched on.
///
/// # Errors
/// [`CanOpenError`] says what the name stands for instead.
pub fn check_interface(interface: &str) -> Result<(), CanOpenError> {
    interface::look_at(interface)
}

/// What the host's own controller saw of the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BusErrors {
    /// Error frames.
    pub frames: u32,
    /// Times the controller left the bus.
    pub bus_off: u32,
    /// Times the controller's buffer was full and a frame was lost. This is the host's fault, not the bus's.
    pub overruns: u32,
}

/// Frames that came over the bus, from any sender.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Traffic {
    /// Frames.
    pub frames: u64,
    /// Bits of these frames with the largest possible number of stuff bits.
    pub bits: u64,
}

impl Traffic {
    fn add(&mut self, frame: &CanFrame) {
        self.frames += 1;
        self.bits += u64::from(frame.worst_bits());
    }

    /// The traffic since an earlier look.
    #[must_use]
    pub fn since(self, earlier: Self) -> Self {
        Self { frames: self.frames - earlier.frames, bits: self.bits - earlier.bits }
    }
}

/// The access to test frames on the bus, beside the conversation on the same bus.
#[derive(Debug)]
pub struct Tap {
    outgoing: mpsc::Sender<CanFrame>,
    incoming: tokio::sync::Mutex<mpsc::Receiver<CanFrame>>,
    errors: watch::Receiver<Option<BusErrors>>,
    /// Times that the port or interface went away.
    absences: watch::Receiver<u32>,
    traffic: watch::Receiver<Traffic>,
    /// The counters of the kernel for frames that it or the controller lost.
    statistics: Option<interface::Statistics>,
}

impl Tap {
    /// Sends a test frame; waits while too many frames wait.
    ///
    /// # Errors
    /// The bus is gone.
    pub async fn send(&self, frame: CanFrame) -> io::Result<()> {
        self.outgoing.send(frame).await.map_err(|_| gone())
    }

    /// The next frame under a test id: an echo, or a frame of another station.
    ///
    /// # Errors
    /// The bus is gone.
    pub async fn receive(&self) -> io::Result<CanFrame> {
        self.incoming.lock().await.recv().await.ok_or_else(gone)
    }

    /// Drops test frames that have come back and were not read.
    pub async fn drain(&self) {
        let mut incoming = self.incoming.lock().await;
        while incoming.try_recv().is_ok() {}
    }

    /// Frames that this computer's own controller or driver has lost so far; `None` if nothing counts them.
    #[must_use]
    pub fn lost_by_host(&self) -> Option<u64> {
        let overruns = self.errors().map(|errors| u64::from(errors.overruns));
        // Some drivers count losses, some send error frames, some do both.
        self.statistics.as_ref().map(interface::Statistics::lost).max(overruns)
    }

    /// Times that the port or interface has gone away so far.
    #[must_use]
    pub fn absences(&self) -> u32 {
        *self.absences.borrow()
    }

    /// The traffic on the bus so far, without test frames.
    #[must_use]
    pub fn traffic(&self) -> Traffic {
        *self.traffic.borrow()
    }

    /// What the host's own controller saw; `None` if the adapter cannot tell.
    #[must_use]
    pub fn errors(&self) -> Option<BusErrors> {
        *self.errors.borrow()
    }
}

fn gone() -> io::Error {
    io::Error::new(io::ErrorKind::BrokenPipe, "the CAN bus was closed")
}

#[derive(Debug)]
struct TapEnd {
    outgoing: mpsc::Receiver<CanFrame>,
    incoming: mpsc::Sender<CanFrame>,
    errors: watch::Sender<Option<BusErrors>>,
    absences: watch::Sender<u32>,
    traffic: watch::Sender<Traffic>,
}

/// An open bus with the host's end of the conversation.
#[derive(Debug)]
pub struct CanLink {
    bus: Bus,
    endpoint: Endpoint,
    outgoing: VecDeque<CanFrame>,
    tap: TapEnd,
    handed_out: Option<Tap>,
    tape: Tape,
    started: Instant,
    /// Frames that have come so far, under any id.
    came: u64,
}

impl CanLink {
    /// Joins a bus.
    ///
    /// # Errors
    /// [`CanOpenError`].
    pub fn open(target: &CanTarget) -> Result<Self, CanOpenError> {
        Ok(Self::on(match target {
            CanTarget::Slcan(port) => {
                Bus::Slcan(slcan::SlcanBus::open(PortLocation::Device(port.clone(), slcan::RATE_BAUD))?)
            }
            CanTarget::Memory(port) => Bus::Slcan(slcan::SlcanBus::open(PortLocation::Memory(port.clone()))?),
            CanTarget::Interface(name) => Bus::Socket(socket::SocketBus::open(name)?),
        }))
    }

    /// Makes a bus in memory, and its other end.
    #[must_use]
    pub fn in_memory() -> (Self, MemoryEnd) {
        let (bus, end) = memory::pair();
        (Self::on(Bus::Memory(bus)), end)
    }

    fn on(bus: Bus) -> Self {
        let (to_bus, outgoing) = mpsc::channel(TEST_FRAMES);
        let (incoming, from_bus) = mpsc::channel(TEST_FRAMES);
        let (errors, seen) = watch::channel(bus.errors());
        let (absences, seen_away) = watch::channel(0);
        let (traffic, seen_traffic) = watch::channel(Traffic::default());
        let tap = Tap {
            outgoing: to_bus,
            incoming: tokio::sync::Mutex::new(from_bus),
            errors: seen,
            absences: seen_away,
            traffic: seen_traffic,
            statistics: bus.statistics(),
        };
        Self {
            bus,
            endpoint: Endpoint::new(EndpointRole::Host),
            outgoing: VecDeque::new(),
            tap: TapEnd { outgoing, incoming, errors, absences, traffic },
            handed_out: Some(tap),
            tape: Tape::default(),
            started: Instant::now(),
            came: 0,
        }
    }

    /// The access to the test frames of this bus; only the first caller gets it.
    pub fn tap(&mut self) -> Option<Tap> {
        self.handed_out.take()
    }

    pub(super) fn send(&mut self, frame: &Frame) {
        let outgoing = &mut self.outgoing;
        self.endpoint.send(frame, &mut |raw| {
            if outgoing.len() < OUTGOING {
                outgoing.push_back(raw);
            }
        });
    }

    pub(super) fn send_raw(&mut self, frame: CanFrame) {
        if self.outgoing.len() < OUTGOING {
            self.outgoing.push_back(frame);
        }
    }

    /// Asks the board for blocks and pauses, for a test of its sender. Messages that are on their way in are forgotten.
    pub fn ask_for(&mut self, settings: FlowSettings) {
        self.endpoint.ask_for(settings);
    }

    pub(super) fn begin_tape(&mut self) {
        self.tape = Tape::begun();
    }

    pub(super) fn tape(&self) -> &Tape {
        &self.tape
    }

    /// Moves frames until a frame of the conversation is whole. A caller that drops this wait half way loses nothing.
    ///
    /// # Errors
    /// The bus is gone.
    pub async fn next(&mut self, read: bool) -> io::Result<LinkEvent> {
        loop {
            while let Some(frame) = self.endpoint.poll(self.started.elapsed()) {
                self.outgoing.push_back(frame);
            }
            let due = self.endpoint.next_due().map(|due| self.started + due);
            let front = self.outgoing.front().copied();
            tokio::select! {
                biased;
                turn = self.bus.turn(front.as_ref(), read) => match turn? {
                    BusEvent::Sent => {
                        self.outgoing.pop_front();
                    }
                    BusEvent::Errors => {
                        self.tap.errors.send_replace(self.bus.errors());
                    }
                    // Test frames of another station have the same ids as those of this station.
                    BusEvent::Received(frame) if is_echo(frame.id()) || echo_of(frame.id()).is_some() => {
                        self.came += 1;
                        // Without a listener the frame is lost. The same happens with a listener that has too many in
                        // flight.
                        let _ = self.tap.incoming.try_send(frame);
                    }
                    BusEvent::Received(frame) => {
                        self.came += 1;
                        self.tap.traffic.send_modify(|traffic| traffic.add(&frame));
                        self.tape.keep_frame(frame);
                        if let Some(received) = self.endpoint.receive(&frame, self.started.elapsed()) {
                            return Ok(received.map_err(|error| NoFrame::Damaged { error, bytes: Box::default() }));
                        }
                    }
                    BusEvent::Away => {
                        self.tap.absences.send_modify(|absences| *absences += 1);
                        return Ok(Err(NoFrame::Away));
                    }
                    BusEvent::Back(lasted) => return Ok(Err(NoFrame::Back { lasted })),
                },
                Some(frame) = self.tap.outgoing.recv(), if front.is_none() => self.outgoing.push_back(frame),
                () = sleep_until(due.unwrap_or(self.started)), if due.is_some() => {}
            }
        }
    }

    /// The name of the port or interface for people.
    #[must_use]
    pub fn name(&self) -> String {
        self.bus.name()
    }

    /// Why the open bus does not prove that hardware is at its other end.
    #[must_use]
    pub fn doubt(&self) -> Option<&Doubt> {
        self.bus.doubt()
    }

    pub(super) fn came(&self) -> u64 {
        self.came
    }

    pub(super) fn counters(&self) -> LineCounters {
        self.endpoint.counters()
    }

    pub(super) fn restart_sequence(&mut self) {
        self.endpoint.restart_sequence();
    }

    pub(super) fn exchange_time(&self, payload: usize) -> Duration {
        // A frame of flow control, and a consecutive frame for each seven bytes. Twice that, since each end also needs
        // time to answer the other.
        let bits = |bytes: usize| (bytes.div_ceil(7) as u64 + 2) * u64::from(worst_bits(false, 8));
        bus_time(2 * (bits(HEADER + payload + CRC) + 2 * bits(MAX_FRAME)))
    }

    /// Leaves the bus.
    pub async fn close(self) {
        self.bus.close().await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gnc_protocol::message::{Identity, SciEcho};
    use gnc_protocol::wire::Wire as _;
    use gnc_protocol::{Call as _, Flags, Header, Kind, PROTOCOL_VERSION};

    fn request(message: u16) -> Frame {
        let data = (0..=255).collect();
        let payload = if message == SciEcho::ID {
            SciEcho { rate_baud: 115_200, data }.to_payload().expect("it fits")
        } else {
            gnc_protocol::Payload::new()
        };
        let (kind, flags) = (Kind::Request, Flags::default());
        Frame { header: Header { version: PROTOCOL_VERSION, kind, flags, request: 1, message, sequence: 0 }, payload }
    }

    /// A board that sends every request back as if it were its own.
    async fn mirror(mut end: MemoryEnd, echo: bool) {
        let mut board = Endpoint::new(EndpointRole::Board);
        while let Some(frame) = end.from_host.recv().await {
            if let Some(back) = gnc_protocol::can::id::echo_of(frame.id()).filter(|_| echo) {
                let back = CanFrame::new(back, frame.data()).expect("a frame");
                let _ = end.to_host.send(back).await;
            }
            if let Some(Ok(heard)) = board.receive(&frame, Duration::ZERO) {
                board.send(&heard, &mut |_| {});
            }
            while let Some(frame) = board.poll(Duration::ZERO) {
                let _ = end.to_host.send(frame).await;
            }
        }
    }

    #[tokio::test(start_paused = true)]
    async fn messages_and_test_frames_share_the_bus() {
        let (mut link, end) = CanLink::in_memory();
        let tap = link.tap().expect("the first tap");
        assert!(link.tap().is_none(), "there is one tap");
        let board = tokio::spawn(mirror(end, true));
        link.send(&request(SciEcho::ID));
        link.send(&request(Identity::ID));
        let test = CanFrame::new(gnc_protocol::can::CanId::Standard(0x705), &[1, 2]).expect("a frame");
        let talk = async {
            tap.send(test).await.expect("the bus");
            tap.receive().await.expect("the bus")
        };
        let messages = async {
            let mut heard = Vec::new();
            while heard.len() < 2 {
                heard.push(link.next(true).await.expect("the bus").expect("a good frame"));
            }
            // The test frame may still be on its way.
            let _ = tokio::time::timeout(Duration::from_millis(100), link.next(true)).await;
            heard
        };
        let (back, heard) = tokio::join!(talk, messages);
        assert_eq!(back.id(), gnc_protocol::can::CanId::Standard(0x715));
        assert_eq!(heard[0].payload, request(SciEcho::ID).payload);
        assert_eq!(heard[1].header.message, Identity::ID);
        assert_eq!(tap.errors(), Some(BusErrors::default()));
        board.abort();
    }

    /// A task that waits for several things drops this wait half way again and again; nothing is lost.
    #[tokio::test(start_paused = true)]
    async fn nothing_is_lost_when_a_wait_is_dropped() {
        let (mut link, end) = CanLink::in_memory();
        let board = tokio::spawn(mirror(end, false));
        link.send(&request(SciEcho::ID));
        for _ in 0..10_000 {
            tokio::select! {
                biased;
                heard = link.next(true) => {
                    assert_eq!(heard.expect("the bus").expect("a good frame").payload, request(SciEcho::ID).payload);
                    board.abort();
                    return;
                }
                () = tokio::task::yield_now() => {}
            }
        }
        panic!("the answer did not come");
    }

    #[tokio::test(start_paused = true)]
    async fn a_bus_that_is_gone_is_an_error() {
        let (mut link, end) = CanLink::in_memory();
        drop(end);
        assert!(link.next(true).await.is_err());
    }

    #[test]
    fn names_of_buses() {
        assert_eq!(CanTarget::parse("can0"), CanTarget::Interface("can0".to_owned()));
        assert_eq!(CanTarget::parse("slcan:/dev/ttyACM0"), CanTarget::Slcan("/dev/ttyACM0".into()));
        assert_eq!(CanTarget::parse("slcan:/dev/ttyACM0").to_string(), "slcan:/dev/ttyACM0");
    }
}
