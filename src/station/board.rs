//! The slave board as the station sees it: typed calls, streams, and a plain word when it restarts or falls silent.
//!
//! [`Board`] is a handle; the conversation itself (`conversation.rs`) is a task that owns the link, repeats what was
//! lost and keeps the board's watchdog quiet.

mod conversation;
mod desk;
mod readings;
pub mod stream;
#[cfg(test)]
mod tests;

use std::cell::{Cell, RefCell};
use std::time::Duration;

use gnc_protocol::message::BoardHello;
use gnc_protocol::stream::StreamId;
use gnc_protocol::wire::WireError;
use gnc_protocol::{FaultCode, NakCode};
use tokio::sync::{mpsc, oneshot, watch};
use tokio::task::JoinHandle;

use crate::latest::{Follower, Latest};
use crate::link::Link;
use crate::link::can::Tap;
pub use conversation::{Answer, LinkReport};
use conversation::{Command, Conversation};
pub use desk::Desk;
pub use readings::{Readings, StreamReading};

/// Commands waiting for the conversation: every item awaits its answer, so more than a few mean a fault.
const COMMANDS: usize = 16;
/// Absences of the port that nobody has read of yet: a port that goes more often between two looks has a loose plug, and
/// sixteen lines say so.
const ABSENCES: usize = 16;

/// Why the board did not do what it was asked.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BoardError {
    /// The port is gone: adapter unplugged, or the simulated bench ended.
    #[error("the port is gone: {reason}")]
    Gone {
        /// What the system said.
        reason: String,
    },
    /// The port or interface went away; it may still come back.
    #[error("{name} went away")]
    Away {
        /// The port or interface.
        name: String,
    },
    /// The port or interface was away for a moment, and the session did not outlive that.
    #[error("{name} was away for {:.1} s, and meanwhile {meanwhile}", lasted.as_secs_f64())]
    Interrupted {
        /// The port or interface.
        name: String,
        /// How long it was away.
        lasted: Duration,
        /// What became of the session.
        meanwhile: &'static str,
    },
    /// Nobody answered, however often it was asked.
    #[error("no answer from the board to {what}: asked {asked} times in {} ms", waited.as_millis())]
    NoAnswer {
        /// The request.
        what: &'static str,
        /// Times sent.
        asked: u32,
        /// Time since it was first sent.
        waited: Duration,
    },
    /// Bytes came and not one whole frame.
    #[error("the line carries bytes and not one whole frame: {damaged} damaged ones and no answer to {asked} HELLO")]
    Garbled {
        /// Frames that were damaged.
        damaged: u32,
        /// Times that HELLO was sent.
        asked: u32,
    },
    /// Not even a heartbeat.
    #[error("the board fell silent: nothing heard for {} ms", silent.as_millis())]
    Silent {
        /// Time since the last frame.
        silent: Duration,
    },
    /// Frames come, but no heartbeat.
    #[error("the board sends frames but no heartbeat for {} ms", silent.as_millis())]
    NoHeartbeat {
        /// Time since the last heartbeat.
        silent: Duration,
    },
    /// The other end speaks another version of the protocol.
    #[error(
        "the board speaks protocol versions {lowest} to {highest}, this station speaks {}",
        gnc_protocol::PROTOCOL_VERSION
    )]
    Version {
        /// The board's lowest.
        lowest: u8,
        /// The board's highest.
        highest: u8,
    },
    /// The board restarted; it was another boot id before.
    #[error("the board restarted during {during} (boot id {before:08x} became {after:08x})")]
    Restarted {
        /// Whether a request of whoever hears this was in flight, and not only a stream.
        asked: bool,
        /// The requests in flight.
        during: String,
        /// Boot id before.
        before: u32,
        /// Boot id after.
        after: u32,
    },
    /// The board closed the session; its watchdog did not hear the station.
    #[error("the board ended the session: its watchdog heard nothing from the station")]
    SessionEnded,
    /// The board refused.
    #[error("the board refused {what}: {}{}", code.meaning(), colon(text))]
    Refused {
        /// The request.
        what: &'static str,
        /// Why.
        code: NakCode,
        /// For people.
        text: String,
    },
    /// The board refused with a number that this station does not know.
    #[error("the board refused {what} with unknown code {code}{}", colon(text))]
    RefusedUnknown {
        /// The request.
        what: &'static str,
        /// The number.
        code: u16,
        /// For people.
        text: String,
    },
    /// The board started and could not finish.
    #[error("{what} failed on the board: {}{}", code.meaning(), colon(text))]
    Fault {
        /// The request.
        what: &'static str,
        /// Why.
        code: FaultCode,
        /// For people.
        text: String,
    },
    /// The checksum was good, the content not what the message demands.
    #[error("the board's answer to {what} cannot be read")]
    BadAnswer {
        /// The request.
        what: &'static str,
        /// What is wrong with it.
        source: WireError,
    },
    /// A stream did not go on although the board's clock did.
    #[error("stream {stream:?} stopped after sample {last} of {wanted} while the board's clock went on")]
    StreamStopped {
        /// Which.
        stream: StreamId,
        /// Samples seen.
        last: u32,
        /// Samples wanted.
        wanted: u32,
    },
    /// The request's parameters do not fit into a frame: a mistake in this program or an absurd plan.
    #[error("{what} does not fit into one frame")]
    TooLong {
        /// The request.
        what: &'static str,
    },
}

impl BoardError {
    /// Whether the board has no room for it now and may have later: a stream beside others.
    #[must_use]
    pub fn is_crowded(&self) -> bool {
        matches!(self, Self::Refused { code: NakCode::DoesNotFit, .. })
    }

    /// Whether the port or interface was away: whatever the board did meanwhile is the bench's.
    #[must_use]
    pub fn is_absence(&self) -> bool {
        matches!(self, Self::Away { .. } | Self::Interrupted { .. })
    }

    /// What the operator can try.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        match self {
            Self::Gone { .. } => {
                "plug the adapter in and start again: `gnc-station ports` lists serial ports; `sudo ip link set NAME up type \
                 can bitrate 500000` switches a CAN interface on"
            }
            Self::Garbled { .. } => "are both ends set to the same rate? RS-422: are A and B of a pair swapped?",
            Self::Away { .. } | Self::Interrupted { .. } => {
                "see to the adapter's plug and cable, and to the board's supply"
            }
            Self::NoAnswer { .. } | Self::Silent { .. } => {
                "check the board's power; RS-422: pairs (A/B swapped?) and rate; CAN: termination, and that the bus is up"
            }
            Self::Version { .. } => "update the board's firmware or the station so that they share a version",
            Self::Restarted { .. } => "look at the module's current and the board's supply; run the item alone",
            Self::NoHeartbeat { .. } => {
                "compare the board's firmware with the interface document: a heartbeat each second; if the board is \
                 simulated, this computer was too busy: close other programs and start again"
            }
            Self::SessionEnded => {
                "another program may have used the port, or this computer was too busy to run the station: close other \
                 programs and start again"
            }
            Self::Refused { code: NakCode::DoesNotFit, .. } => "lower the rate in the plan or raise the port's rate",
            Self::Refused { code: NakCode::NotPowered, .. } => {
                "check the supply and that the module sits in the socket"
            }
            Self::Refused { .. } | Self::RefusedUnknown { .. } => {
                "compare the board's firmware with the interface document"
            }
            Self::Fault { .. } => "the module's device did not work; see the error record",
            Self::BadAnswer { .. } => "compare the board's firmware with the interface document",
            Self::StreamStopped { .. } => "check the line; a slower stream or a higher rate may help",
            Self::TooLong { .. } => "shorten the parameters in the plan",
        }
    }
}

fn colon(text: &str) -> String {
    if text.is_empty() { String::new() } else { format!(": {text}") }
}

/// An absence of the port or interface that is over.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Absent {
    /// The port or interface.
    pub name: String,
    /// How long it was away.
    pub lasted: Duration,
}

/// What the board said last of its own time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Pulse {
    /// Board time in microseconds.
    pub board_time_us: u64,
    /// Heartbeats since the session's start.
    pub beats: u32,
}

/// How far the request that runs is, for people; some of these may be skipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Advance {
    /// Share done, 0 to 1000.
    pub done_permille: u16,
    /// Board time spent.
    pub elapsed_ms: u32,
    /// Board time expected in all.
    pub expected_ms: u32,
}

/// A handle on the board. Dropping it ends the conversation.
#[derive(Debug)]
pub struct Board {
    commands: mpsc::Sender<Command>,
    pulse: Follower<Pulse>,
    hello: RefCell<BoardHello>,
    next_request: Cell<u16>,
    task: JoinHandle<LinkReport>,
    tap: Option<Tap>,
    absences: tokio::sync::Mutex<mpsc::Receiver<Absent>>,
}

impl Board {
    /// Says HELLO over a link and keeps the conversation going. What comes by is shown in `readings`.
    ///
    /// # Errors
    /// [`BoardError::NoAnswer`] or [`BoardError::Version`].
    pub async fn connect(mut link: Link, nonce: u32, readings: watch::Sender<Readings>) -> Result<Self, BoardError> {
        let (commands, receiver) = mpsc::channel(COMMANDS);
        let beat = Latest::new(Pulse::default());
        let pulse = beat.follower();
        let tap = match &mut link {
            Link::Serial(_) => None,
            Link::Can(link) => link.tap(),
        };
        let (absent, absences) = mpsc::channel(ABSENCES);
        let conversation = Conversation::new(link, receiver, beat, readings, absent);
        let task = tokio::spawn(conversation.run());
        let hello = RefCell::new(BoardHello::default());
        let absences = tokio::sync::Mutex::new(absences);
        let board = Self { commands, pulse, hello, next_request: Cell::new(1), task, tap, absences };
        board.reopen(nonce).await?;
        Ok(board)
    }

    /// Opens a new session on the same link, after a restart of the board. Returns the board's boot id.
    ///
    /// # Errors
    /// As [`Board::connect`].
    pub async fn reopen(&self, nonce: u32) -> Result<u32, BoardError> {
        let (answer, answered) = oneshot::channel();
        self.send(Command::Hello { nonce, answer }).await?;
        let hello = answered.await.map_err(|_| gone())??;
        let boot_id = hello.boot_id;
        self.hello.replace(hello);
        Ok(boot_id)
    }

    /// What the board said of itself.
    #[must_use]
    pub fn hello(&self) -> BoardHello {
        self.hello.borrow().clone()
    }

    /// The board's clock, from the next heartbeat on.
    #[must_use]
    pub fn pulse(&self) -> Follower<Pulse> {
        self.pulse.another()
    }

    /// The next absence of the port or interface, once it is over; `None` after the end of the conversation.
    pub async fn absence(&self) -> Option<Absent> {
        self.absences.lock().await.recv().await
    }

    /// Ends the conversation and says what the line was like.
    pub async fn close(self) -> LinkReport {
        let Self { commands, task, .. } = self;
        drop(commands);
        task.await.unwrap_or_default()
    }

    /// A number for the next request; 0 belongs to frames without one.
    fn number(&self) -> u16 {
        let number = self.next_request.get();
        self.next_request.set(number.checked_add(1).unwrap_or(1));
        number
    }

    async fn send(&self, command: Command) -> Result<(), BoardError> {
        self.commands.send(command).await.map_err(|_| gone())
    }
}

fn gone() -> BoardError {
    BoardError::Gone { reason: "the conversation with the board has ended".into() }
}
