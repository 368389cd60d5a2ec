//! How a board breaks the interface document, one rule for each key of a personality.
//!
//! The board's end of the conversation keeps the document. What stands here lies between it and the wire: a filter of
//! frames ([`conversation`]), one of bytes and CAN frames ([`wire`]), and small hooks in the board. Without a breach no
//! frame passes through the filters, so that a good board is the same to the byte. Delays are link time.

pub(crate) mod answers;
pub(crate) mod board;
pub(crate) mod conversation;
pub(crate) mod wire;

use std::time::Duration;

use gnc_protocol::error::NakCode;
use gnc_protocol::message::{Request, capability};
use gnc_protocol::slave::RequestRefusal;
use gnc_protocol::stream::StreamId;

use board::{RestartBreaches, StateBreaches, StreamBreaches, ValueBreaches};
use wire::FrameBreaches;

/// All breaches of a board.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Breaches {
    pub(crate) timing: TimingBreaches,
    pub(crate) talk: TalkBreaches,
    pub(crate) hello: HelloBreaches,
    pub(crate) restarts: RestartBreaches,
    pub(crate) state: StateBreaches,
    pub(crate) values: ValueBreaches,
    pub(crate) streams: StreamBreaches,
    pub(crate) frames: FrameBreaches,
}

impl Breaches {
    /// Whether the board keeps every rule of the conversation.
    pub(crate) fn none_of_the_conversation(&self) -> bool {
        self.timing == TimingBreaches::default()
            && self.talk == TalkBreaches::default()
            && self.hello == HelloBreaches::default()
            && self.state.bits_set | self.state.bits_cleared == 0
            && !self.streams.before_result
    }
}

/// When the board speaks. A span of zero means never.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct TimingBreaches {
    /// ACCEPT and NAK come so late.
    pub(crate) accept_after: Duration,
    /// Only one of so many is late; 0: all.
    pub(crate) accept_late_every: u32,
    /// HELLO is answered so late.
    pub(crate) hello_after: Duration,
    /// Time from one PROGRESS to the next.
    pub(crate) progress_every: Option<Duration>,
    /// Time from one heartbeat to the next.
    pub(crate) heartbeat_every: Option<Duration>,
    /// Heartbeats that do not come after a start of the board.
    pub(crate) lost_first_heartbeats: u32,
    /// Silence of the host after which the session ends.
    pub(crate) watchdog: Option<Duration>,
    /// MAKE_SAFE ends so late.
    pub(crate) make_safe_after: Duration,
}

/// An answer that belongs to no request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StrangeAnswer {
    Accept,
    Result,
}

/// What the board says about requests.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct TalkBreaches {
    pub(crate) no_accept: bool,
    /// Such an answer under an unknown id goes before each true one.
    pub(crate) answers_nobody: Option<StrangeAnswer>,
    /// Two requests that run get each other's RESULT.
    pub(crate) swaps_request_ids: bool,
    /// RESULT carries the next message id; those of the urgent messages do not.
    pub(crate) wrong_message_id: bool,
    /// Version in the headers of all frames but HELLO.
    pub(crate) header_version: Option<u8>,
    /// One of so many frames repeats the number of the one before.
    pub(crate) sequence_stands_every: u32,
    /// At one of so many frames the numbers go back.
    pub(crate) sequence_back_every: u32,
    /// Request id of STREAM frames.
    pub(crate) stream_request_id: u16,
    /// Each RESULT comes twice.
    pub(crate) double_result: bool,
    /// What elapsed_us is multiplied by.
    pub(crate) elapsed_us_times: Option<f64>,
    /// What each PROGRESS says.
    pub(crate) progress_permille: Option<u16>,
    /// A PROGRESS follows each RESULT.
    pub(crate) progress_after_result: bool,
    /// Status of RESULTs, in place of what they were.
    pub(crate) result_status: Option<u16>,
    /// Only one of so many has it; 0: all.
    pub(crate) result_status_every: u32,
    /// Code of each NAK.
    pub(crate) nak_code: Option<u16>,
    /// A request that ended and comes again runs again.
    pub(crate) replay_runs_again: bool,
    /// A repeated RESULT is not marked.
    pub(crate) replay_without_flag: bool,
}

impl TalkBreaches {
    /// Whether the numbers of frames are those of the document.
    pub(crate) fn counts_well(&self) -> bool {
        self.sequence_stands_every == 0 && self.sequence_back_every == 0
    }
}

/// What the board says when it is called, and what it claims to have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct HelloBreaches {
    pub(crate) wrong_nonce: bool,
    /// HELLO and heartbeat tell different boot ids.
    pub(crate) other_boot_id_in_hello: bool,
    /// Zeros behind the last field.
    pub(crate) hello_extra_bytes: u32,
    /// The range of versions that it tells.
    pub(crate) hello_versions: Option<(u8, u8)>,
    /// The version that it says is in force.
    pub(crate) hello_chosen: Option<u8>,
    pub(crate) deaf_to_hello: bool,
    /// Without capability bit 0: the module is always under power.
    pub(crate) no_power_switch: bool,
    /// Without capability bit 1: it neither hears nor speaks on CAN.
    pub(crate) no_can: bool,
    /// Without capability bit 2.
    pub(crate) no_calibration: bool,
}

/// Whether one of so many, counted from 1, is this one; 0: none is.
pub(crate) fn is_nth(counted: u32, every: u32) -> bool {
    every != 0 && counted.is_multiple_of(every)
}

impl HelloBreaches {
    /// The capabilities that the board tells, of those that a good one has.
    pub(crate) fn left_of(&self, capabilities: u32) -> u32 {
        let lacking = [
            (self.no_power_switch, capability::POWER),
            (self.no_can, capability::CAN),
            (self.no_calibration, capability::CALIBRATION),
        ];
        lacking.iter().filter(|(lacks, _)| *lacks).fold(capabilities, |left, (_, bit)| left & !bit)
    }

    /// Why the board cannot begin a request, for want of what it asks for.
    pub(crate) fn lacks(&self, request: &Request) -> Option<RequestRefusal> {
        let what = match request {
            Request::ModulePower(_) if self.no_power_switch => "this board does not switch the module's supply",
            Request::CanCounters(_) if self.no_can => "this board has no CAN",
            Request::CalibrationWrite(_) | Request::CalibrationCommit(_) | Request::CalibrationRead(_)
                if self.no_calibration =>
            {
                "this module keeps no calibration"
            }
            Request::StreamStart(start) if self.no_calibration && start.stream == StreamId::Compensated as u8 => {
                "this board compensates no samples"
            }
            _ => return None,
        };
        Some(RequestRefusal::new(NakCode::NoDevice, what))
    }
}
