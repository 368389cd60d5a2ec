//! CAN: commands by ISO-TP, streams as raw frames, and test frames beside them for whoever tests the bus itself.

mod bus;
mod memory;
mod slcan;
mod socket;

use std::collections::VecDeque;
use std::fmt;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

use gnc_protocol::Frame;
use gnc_protocol::can::endpoint::{Endpoint, Role};
use gnc_protocol::can::id::is_echo;
use gnc_protocol::can::{CanFrame, bus_time, worst_bits};
use gnc_protocol::frame::{CRC, HEADER, MAX_FRAME};
use gnc_protocol::serial::LineCounters;
use tokio::sync::{mpsc, watch};
use tokio::time::{Instant, sleep_until};

use super::Received;
use super::serial::OpenError;
use bus::{Bus, Turn};
pub use memory::MemoryEnd;

/// Raw frames that may wait for a bus that does not take them.
const OUTGOING: usize = 256;
/// Test frames under way in either direction; whoever tests the bus keeps fewer in flight.
pub const TEST_FRAMES: usize = 64;

/// A bus as a bench file names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CanTarget {
    /// An adapter that speaks slcan, on a serial port: `slcan:/dev/ttyACM0`.
    Slcan(PathBuf),
    /// An interface of the kernel: `can0`.
    Interface(String),
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

impl fmt::Display for CanTarget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Slcan(port) => write!(f, "slcan:{}", port.display()),
            Self::Interface(name) => f.write_str(name),
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
    #[error("this computer's kernel has no CAN, so there is no interface {interface}")]
    NoKernel {
        /// What was asked for.
        interface: String,
    },
    /// There is no such interface.
    #[error("there is no network interface {interface}")]
    Missing {
        /// What was asked for.
        interface: String,
    },
    /// An interface of another kind.
    #[error("the network interface {interface} is no CAN interface")]
    NotCan {
        /// What was asked for.
        interface: String,
    },
    /// It is switched off.
    #[error("the CAN interface {interface} is down")]
    Down {
        /// What was asked for.
        interface: String,
    },
    /// Anything else that the system said.
    #[error("cannot open the CAN interface {interface}")]
    System {
        /// What was asked for.
        interface: String,
        /// What it said.
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
            Self::System { .. } => "check the adapter and who may use it",
        }
    }
}

/// What the host's own controller saw of the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BusErrors {
    /// Error frames.
    pub frames: u32,
    /// Times it left the bus.
    pub bus_off: u32,
}

/// Test frames of the bus, beside the conversation that goes over it.
#[derive(Debug)]
pub struct Tap {
    outgoing: mpsc::Sender<CanFrame>,
    incoming: tokio::sync::Mutex<mpsc::Receiver<CanFrame>>,
    errors: watch::Receiver<Option<BusErrors>>,
}

impl Tap {
    /// Sends a test frame; waits while too many wait.
    ///
    /// # Errors
    /// The bus is gone.
    pub async fn send(&self, frame: CanFrame) -> io::Result<()> {
        self.outgoing.send(frame).await.map_err(|_| gone())
    }

    /// The next frame that came back.
    ///
    /// # Errors
    /// The bus is gone.
    pub async fn receive(&self) -> io::Result<CanFrame> {
        self.incoming.lock().await.recv().await.ok_or_else(gone)
    }

    /// Forgets what has come back and nobody waited for.
    pub async fn drain(&self) {
        let mut incoming = self.incoming.lock().await;
        while incoming.try_recv().is_ok() {}
    }

    /// What the host's own controller saw; `None` where the adapter cannot tell.
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
}

/// An open bus with the host's end of the conversation.
#[derive(Debug)]
pub struct CanLink {
    bus: Bus,
    endpoint: Endpoint,
    outgoing: VecDeque<CanFrame>,
    tap: TapEnd,
    handed_out: Option<Tap>,
    started: Instant,
}

impl CanLink {
    /// Joins a bus.
    ///
    /// # Errors
    /// [`CanOpenError`].
    pub fn open(target: &CanTarget) -> Result<Self, CanOpenError> {
        Ok(Self::on(match target {
            CanTarget::Slcan(port) => Bus::Slcan(slcan::SlcanBus::open(port)?),
            CanTarget::Interface(name) => Bus::Socket(socket::SocketBus::open(name)?),
        }))
    }

    /// A bus in memory, and its other end.
    #[must_use]
    pub fn in_memory() -> (Self, MemoryEnd) {
        let (bus, end) = memory::pair();
        (Self::on(Bus::Memory(bus)), end)
    }

    fn on(bus: Bus) -> Self {
        let (to_bus, outgoing) = mpsc::channel(TEST_FRAMES);
        let (incoming, from_bus) = mpsc::channel(TEST_FRAMES);
        let (errors, seen) = watch::channel(bus.errors());
        Self {
            bus,
            endpoint: Endpoint::new(Role::Host),
            outgoing: VecDeque::new(),
            tap: TapEnd { outgoing, incoming, errors },
            handed_out: Some(Tap { outgoing: to_bus, incoming: tokio::sync::Mutex::new(from_bus), errors: seen }),
            started: Instant::now(),
        }
    }

    /// The test frames of this bus; the first who asks gets them.
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

    /// Moves frames until one of the conversation is whole. Nothing is lost when it is dropped half way.
    ///
    /// # Errors
    /// The bus is gone.
    pub async fn next(&mut self, read: bool) -> io::Result<Received> {
        loop {
            while let Some(frame) = self.endpoint.poll(self.started.elapsed()) {
                self.outgoing.push_back(frame);
            }
            let due = self.endpoint.next_due().map(|due| self.started + due);
            let front = self.outgoing.front().copied();
            tokio::select! {
                biased;
                turn = self.bus.turn(front.as_ref(), read) => match turn? {
                    Turn::Sent => {
                        self.outgoing.pop_front();
                    }
                    Turn::Errors => {
                        self.tap.errors.send_replace(self.bus.errors());
                    }
                    Turn::Received(frame) if is_echo(frame.id()) => {
                        // Without a listener, or with one that keeps too many in flight, it is lost like any other.
                        let _ = self.tap.incoming.try_send(frame);
                    }
                    Turn::Received(frame) => {
                        if let Some(received) = self.endpoint.receive(&frame, self.started.elapsed()) {
                            return Ok(received);
                        }
                    }
                },
                Some(frame) = self.tap.outgoing.recv(), if front.is_none() => self.outgoing.push_back(frame),
                () = sleep_until(due.unwrap_or(self.started)), if due.is_some() => {}
            }
        }
    }

    pub(super) fn counters(&self) -> LineCounters {
        self.endpoint.counters()
    }

    pub(super) fn restart_sequence(&mut self) {
        self.endpoint.restart_sequence();
    }

    pub(super) fn exchange_time(&self, payload: usize) -> Duration {
        // A frame of flow control and a consecutive frame for each seven bytes; twice, since both ends' answers to
        // one another take their time too.
        let bits = |bytes: usize| (bytes.div_ceil(7) as u64 + 2) * u64::from(worst_bits(false, 8));
        bus_time(2 * (bits(HEADER + payload + CRC) + 2 * bits(MAX_FRAME)))
    }

    /// Leaves the bus.
    pub async fn close(self) {
        self.bus.close().await;
    }
}
