//! Why the board did not do what it was asked.

use std::time::Duration;

use gnc_protocol::stream::StreamId;
use gnc_protocol::wire::WireError;
use gnc_protocol::{FaultCode, NakCode};

use crate::rule::{Breach, Rule};

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
    /// The port or interface was away for a moment, and the session ended because of that.
    #[error("{name} was away for {:.1} s, and meanwhile {meanwhile}", lasted.as_secs_f64())]
    Interrupted {
        /// The port or interface.
        name: String,
        /// How long it was away.
        lasted: Duration,
        /// What became of the session.
        meanwhile: &'static str,
    },
    /// The board did not answer, although the station asked several times.
    #[error("no answer from the board to {what}: asked {asked} times in {} ms{heard}", waited.as_millis())]
    NoAnswer {
        /// The request.
        what: &'static str,
        /// Times sent.
        asked: u32,
        /// Time since it was first sent.
        waited: Duration,
        /// What came instead.
        heard: Heard,
    },
    /// The board breaks a rule of the interface document, so that a value cannot be trusted.
    #[error("{}: {of}: {why} (interface document, section {})", rule.what, rule.section)]
    Breach {
        /// The rule.
        rule: &'static Rule,
        /// The request or stream.
        of: &'static str,
        /// What came.
        why: String,
    },
    /// Bytes came, but no whole frame.
    #[error("the line carries bytes but no whole frame: {damaged} damaged frames, and no answer to {asked} HELLO")]
    Garbled {
        /// Frames that were damaged.
        damaged: u32,
        /// Times that HELLO was sent.
        asked: u32,
        /// Whether the link is a CAN bus.
        on_can: bool,
    },
    /// No frame came for too long, not even a heartbeat.
    #[error("the board fell silent: nothing heard for {} ms", silent.as_millis())]
    Silent {
        /// Time since the last frame.
        silent: Duration,
        /// Whether the link is a CAN bus.
        on_can: bool,
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
    /// The board restarted and has another boot id now.
    #[error("the board restarted during {during} ({})", boot_ids(*before, *after))]
    Restarted {
        /// Whether the receiver of this error had a request in flight, and not only a stream.
        asked: bool,
        /// The requests in flight.
        during: String,
        /// Boot id before.
        before: u32,
        /// Boot id after.
        after: u32,
    },
    /// The board closed the session; its watchdog did not hear the station.
    #[error("the board ended the session: its watchdog {}", acted(*early))]
    SessionEnded {
        /// Time from what the board last heard of the station, if it is shorter than the document allows.
        early: Option<Duration>,
    },
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
    /// The module lost its power while it was measured.
    #[error("the module lost its power: it was switched on, and the board says now that it is without power")]
    PowerLost,
    /// The board started and could not finish.
    #[error("{what} failed on the board: {}{}", code.meaning(), colon(text))]
    Fault {
        /// The request.
        what: &'static str,
        /// Why.
        code: FaultCode,
        /// For people.
        text: String,
        /// Board time for which it tried.
        elapsed: Duration,
    },
    /// The checksum is right, but the content breaks the rules of the message.
    #[error("the board's answer to {what} cannot be read")]
    BadAnswer {
        /// The request.
        what: &'static str,
        /// What is wrong with it.
        source: WireError,
    },
    /// A stream stopped while the board's clock went on.
    #[error("{} stopped after sample {last} of {wanted} while the board's clock went on", stream.name())]
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

/// What came from the board instead of an answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Heard {
    /// Nothing at all.
    Nothing {
        /// Whether the link is a CAN bus.
        on_can: bool,
    },
    /// Frames that are no answer: heartbeats, samples, answers to other requests.
    OtherFrames,
    /// The board accepted the request and then said no more of it.
    Accepted {
        /// Time since its last sign of the request.
        silent: Duration,
    },
    /// Something that the interface document does not allow.
    Breach(Breach),
}

impl std::fmt::Display for Heard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Nothing { .. } => f.write_str("; nothing else was heard from it"),
            Self::OtherFrames => f.write_str("; other frames come from it"),
            Self::Accepted { silent } => {
                write!(f, "; the board accepted it, and sent neither PROGRESS nor RESULT for {} ms", silent.as_millis())
            }
            Self::Breach(Breach { rule, worst, .. }) => {
                write!(f, "; instead, {}", rule.what)?;
                match worst {
                    Some(worst) => write!(f, ": {worst} (interface document, section {})", rule.section),
                    None => write!(f, " (interface document, section {})", rule.section),
                }
            }
        }
    }
}

impl Heard {
    fn try_this(&self) -> &'static str {
        match self {
            Self::Nothing { on_can } => nothing_heard(*on_can),
            Self::OtherFrames => {
                "the way from the board to the station is good: check the way to the board, then how the board reads frames \
                 (interface document, sections 3 and 6)"
            }
            Self::Accepted { .. } => {
                "look where the board's firmware loses the request: it must send PROGRESS each 400 ms and a RESULT \
                 (interface document, section 7)"
            }
            Self::Breach(_) => COMPARE,
        }
    }
}

fn acted(early: Option<Duration>) -> String {
    match early {
        None => "heard nothing from the station".to_owned(),
        Some(early) => format!(
            "acted {} ms after it had heard the station, and 1750 ms are due (interface document, section 9)",
            early.as_millis()
        ),
    }
}

const COMPARE: &str = "compare the board's firmware with the interface document";

fn nothing_heard(on_can: bool) -> &'static str {
    if on_can {
        "check the board's power, the bus's termination (60 ohm between the lines), and that the interface is up at 500 kbit/s"
    } else {
        "check the board's power, the two pairs (A and B swapped?) and the rate"
    }
}

fn boot_ids(before: u32, after: u32) -> String {
    if before == after {
        format!("its clock began anew, and its boot id stayed {before:08x}")
    } else {
        format!("boot id {before:08x} became {after:08x}")
    }
}

impl BoardError {
    /// Whether the board has no room for this now but may have later: a stream beside others.
    #[must_use]
    pub fn is_crowded(&self) -> bool {
        matches!(self, Self::Refused { code: NakCode::DoesNotFit, .. })
    }

    /// The rule that the board broke, if that is the error.
    #[must_use]
    pub fn breach(&self) -> Option<Breach> {
        match self {
            Self::NoAnswer { heard: Heard::Breach(breach), .. } => Some(breach.clone()),
            Self::Breach { rule, of, why } => Some(Breach { rule, count: 1, worst: Some(format!("{of}: {why}")) }),
            _ => None,
        }
    }

    /// Whether the board answered, so that it can be asked the next thing.
    pub(crate) fn is_answered(&self) -> bool {
        matches!(
            self,
            Self::Refused { .. }
                | Self::RefusedUnknown { .. }
                | Self::Fault { .. }
                | Self::BadAnswer { .. }
                | Self::Breach { .. }
        )
    }

    /// Whether the port or interface was away. The bench is at fault for all that the board did meanwhile.
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
            Self::Garbled { on_can: true, .. } => {
                "are all nodes set to 500 kbit/s? If so, compare the order and the checksum of the board's frames with the \
                 interface document, section 17"
            }
            Self::Garbled { .. } => "are both ends set to the same rate? RS-422: are A and B of a pair swapped?",
            Self::Away { .. } | Self::Interrupted { .. } => {
                "check the adapter's plug and cable, and the board's supply"
            }
            Self::NoAnswer { heard, .. } => heard.try_this(),
            Self::Silent { on_can, .. } => nothing_heard(*on_can),
            Self::Breach { .. } => COMPARE,
            Self::Version { .. } => "update the board's firmware or the station so that they share a version",
            Self::Restarted { .. } => "look at the module's current and the board's supply; run the item alone",
            Self::NoHeartbeat { .. } => {
                "compare the board's firmware with the interface document: a heartbeat each second; if the board is \
                 simulated, this computer was too busy: close other programs and start again"
            }
            Self::SessionEnded { early: Some(_) } => COMPARE,
            Self::SessionEnded { early: None } => {
                "another program may have used the port, or this computer was too busy to run the station: close other \
                 programs and start again"
            }
            Self::Refused { code: NakCode::DoesNotFit, .. } => "lower the rate in the plan or raise the port's rate",
            Self::Refused { code: NakCode::NotPowered, .. } => {
                "check the supply and that the module sits in the socket"
            }
            Self::Refused { .. } | Self::RefusedUnknown { .. } => COMPARE,
            Self::Fault { .. } => {
                "a device of the module did not work: look at the error record, then suspect that device"
            }
            Self::BadAnswer { .. } => COMPARE,
            Self::StreamStopped { .. } => "check the line; a slower stream or a higher rate may help",
            Self::PowerLost => {
                "look for what switched it off: the board's protection (a short in the module), its supply, or its firmware"
            }
            Self::TooLong { .. } => "shorten the parameters in the plan",
        }
    }
}

fn colon(text: &str) -> String {
    if text.is_empty() { String::new() } else { format!(": {text}") }
}

/// The error after the end of the conversation.
pub(crate) fn gone() -> BoardError {
    BoardError::Gone { reason: "the session with the board has ended".into() }
}
