//! Why a procedure did not finish.

use gnc_analysis::figures::FigureError;
use gnc_analysis::motion::watch::Spoilt;
use gnc_board::BoardError;
use gnc_executive::catalogue::ItemId;
use gnc_executive::event::OtherModule;
use gnc_executive::part::PartName;
use gnc_executive::plan::ParamError;
use gnc_link::can::CanOpenError;
use gnc_metrology::sample_clock::ClockFault;
use gnc_protocol::stream::Losses;
use gnc_records::resume::ResumeError;
use gnc_records::store::StoreError;

use crate::fixture::{FixtureError, SwitchReading};
use crate::recorder::ReadBackError;

/// Why a procedure did not finish.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ProcedureError {
    /// The board or the line to it has a fault.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// The fixture has a fault.
    #[error(transparent)]
    Fixture(FixtureError),
    /// A measurement could not be filed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The plan was not checked against the catalogue: a mistake in this program.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// Samples are missing, so the station cannot judge the module.
    #[error(
        "samples are missing: {} of {wanted} received, {}",
        losses.received, Lost(losses)
    )]
    SamplesLost {
        /// Samples asked for.
        wanted: u32,
        /// Counts of received and lost samples.
        losses: Losses,
    },
    /// A capture has a gap, so that no figure may come from it.
    #[error(
        "capture `{label}` has a gap after sample {after} ({at_s:.3} s): {} received, {}",
        losses.received, Lost(losses)
    )]
    CaptureLost {
        /// The capture.
        label: String,
        /// Samples before the gap.
        after: u32,
        /// Time in the capture.
        at_s: f64,
        /// Counts of received and lost samples.
        losses: Losses,
    },
    /// The samples are not on the grid of the board's own clock, so their rate is unknown.
    #[error("{what}: {fault}")]
    Clock {
        /// What was captured.
        what: String,
        /// What is wrong with its times.
        fault: ClockFault,
    },
    /// A capture is spoilt.
    #[error("capture `{label}` is spoilt at {at_s:.2} s")]
    Spoilt {
        /// The capture.
        label: String,
        /// Time in the capture.
        at_s: f64,
        /// What is wrong.
        #[source]
        spoilt: Spoilt,
    },
    /// The operator did not move the DIP switches, although the station asked several times.
    #[error("the switches were not moved: asked {asked} times. {}", sentences(still))]
    SwitchesNotMoved {
        /// Times that the same was asked for.
        asked: u32,
        /// The switches that do not read as they were asked for.
        still: Vec<SwitchReading>,
    },
    /// The turn was not the one that was asked for.
    #[error("capture `{label}`: the module turned by {seen_deg:.0} deg instead of {wanted_deg:.0} deg")]
    NotTurned {
        /// The capture.
        label: String,
        /// What was asked for.
        wanted_deg: f64,
        /// What the gyroscope of the axis saw, at nominal scale.
        seen_deg: f64,
    },
    /// The captures give no figure.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// The captures of an earlier run cannot be taken over.
    #[error(transparent)]
    Resume(#[from] ResumeError),
    /// The module is not as warm as it was when an earlier run captured it.
    #[error(
        "the module has {now_c:.2} degC after {waited_s:.0} s of waiting, and at the end of the captures that are taken over it had \
         {target_c:.2} degC: they are not within {within_k} degC"
    )]
    NotWarm {
        /// Temperature of the module.
        now_c: f64,
        /// Its temperature at the end of those captures.
        target_c: f64,
        /// The difference that the plan accepts.
        within_k: f64,
        /// Board time of all waits of the run.
        waited_s: f64,
    },
    /// Captures that are taken over and new ones are of different temperatures.
    #[error(
        "{what}, and a part of the captures is taken over from an earlier run, when the module had another temperature"
    )]
    OtherTemperature {
        /// The temperatures that are outside their limits.
        what: String,
    },
    /// The analysis of the captures broke down: a mistake in this program.
    #[error("the station could not work out any figure: {why}")]
    Analysis {
        /// What happened.
        why: String,
    },
    /// The captures of another item cannot be read back.
    #[error(transparent)]
    Captures(#[from] ReadBackError),
    /// The CAN bus could not be joined.
    #[error(transparent)]
    CanOpen(#[from] CanOpenError),
    /// The CAN bus went away.
    #[error("the connection to the CAN bus was lost")]
    CanGone(#[from] std::io::Error),
    /// Test frames did not come back as they were sent, but the module's controller counts no error.
    #[error(
        "of {sent} CAN frames {lost} did not come back and {astray} came twice or out of order; the module received {received} \
         and counts no error{}{}{}{}", lost_here(*by_host), beside(*others, *busy_percent, *span_s), of_before(*stale),
         given_up(*unsent)
    )]
    FramesLost {
        /// Test frames sent.
        sent: u64,
        /// Test frames that were not sent, since no more echoes came.
        unsent: u64,
        /// Sent frames that are not back.
        lost: u64,
        /// Frames that came back twice, or before a frame that was sent earlier.
        astray: u64,
        /// Frames that the module received, by its own count.
        received: u32,
        /// Frames that this computer lost meanwhile, as far as it knows.
        by_host: u64,
        /// Other frames on the bus meanwhile, from any sender.
        others: u64,
        /// Their share of the bus.
        busy_percent: f64,
        /// How long the station tried.
        span_s: f64,
        /// Frames of an earlier exchange, or of another node, that came under test ids before any could be sent.
        stale: u64,
    },
    /// Another node uses the ids of the test frames, so the station cannot tell which frames are missing or too many.
    #[error(
        "another node uses the ids of CAN test frames: beside the {sent} frames of this station, of which {lost} did not come \
         back unaltered, there were {foreign} frames of another sender and {strange} frames that answer none of this station's"
    )]
    TestIdsShared {
        /// Test frames sent.
        sent: u64,
        /// Sent frames that are not back unaltered.
        lost: u64,
        /// Frames under the module's ids that are not echoes of these frames.
        strange: u64,
        /// Test frames that this station did not send.
        foreign: u64,
    },
    /// An answer with a good checksum that does not fit the question.
    #[error("the board's answer to {what} does not fit the question: {why}")]
    Nonsense {
        /// The request.
        what: &'static str,
        /// In which way.
        why: String,
    },
    /// The board's switch is off, but the module still has supply.
    #[error(
        "cycle {cycle}: the supply is switched off, and the module still has {voltage_v:.3} V and {current_a:.3} A"
    )]
    StillFed {
        /// Number of the power cycle, from 1.
        cycle: usize,
        /// Voltage at the socket.
        voltage_v: f64,
        /// Current into the module.
        current_a: f64,
    },
    /// Another module answers than before in this run.
    #[error("{when}: the module says that it is {is}; before, it was {was}")]
    ModuleChanged {
        /// When the module said so.
        when: String,
        /// The module before.
        was: String,
        /// The module now.
        is: String,
        /// The scanned number and that of the module now, if they differ.
        other: Option<OtherModule>,
    },
    /// The module in the socket has another serial number than was scanned.
    #[error(
        "this is not the module that was scanned: {} was scanned, and the module in the socket says that it is {}",
        gnc_text::quoted(&.0.scanned), gnc_text::quoted(&.0.found)
    )]
    OtherModule(OtherModule),
    /// The module is not the part that was asked for.
    #[error(
        "this is not the part that was asked for: part {asked} was asked for, and the module says that it is part {found}"
    )]
    OtherPart {
        /// What was asked for.
        asked: PartName,
        /// What the module says.
        found: PartName,
    },
    /// This station has no procedure for the item.
    #[error("this station cannot run {item}: {why}")]
    CannotRun {
        /// The item.
        item: ItemId,
        /// Why.
        why: &'static str,
    },
    /// The item took longer in board time than the plan allows.
    #[error("not done after {limit_s} s of board time, the plan's `timeout` of the item")]
    TookTooLong {
        /// The plan's limit.
        limit_s: f64,
    },
}

impl From<FixtureError> for ProcedureError {
    /// A record that cannot be written is not a fault of the fixture, and ends the run.
    fn from(error: FixtureError) -> Self {
        match error {
            FixtureError::Store(error) => Self::Store(error),
            error => Self::Fixture(error),
        }
    }
}

/// Where samples were lost, as far as a counter tells.
struct Lost<'a>(&'a Losses);

impl std::fmt::Display for Lost<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            Losses { on_board: 0, on_line: 0, .. } => f.write_str("and no counter knows of a loss"),
            Losses { on_board, on_line, .. } => write!(f, "{on_board} lost on the board, {on_line} on the line"),
        }
    }
}

impl ProcedureError {
    /// What the operator can try.
    #[must_use]
    pub(crate) fn try_this(&self) -> &'static str {
        match self {
            Self::Board(error) => error.try_this(),
            Self::Fixture(error) => error.try_this(),
            Self::Store(error) => error.try_this(),
            Self::Param(_) => "report this: the station should not have accepted the plan",
            Self::SamplesLost { losses, .. } | Self::CaptureLost { losses, .. } if !losses.any() => {
                "look whether the board restarted or the computer was busy; then test again"
            }
            Self::SamplesLost { .. } => "check the cable to the board and its termination; a slower stream may help",
            Self::CaptureLost { .. } => "check the cable to the board and its termination; a slower stream may help",
            Self::Clock { fault, .. } => fault.hint(),
            Self::Spoilt { spoilt: Spoilt::Moved { .. }, .. } => {
                "keep hands and draughts off the table; run the item again"
            }
            Self::Spoilt { spoilt: Spoilt::Saturated { .. }, .. } => {
                "keep magnets away; if there is no magnet, the sensor does not reach its published range"
            }
            Self::Spoilt { spoilt: Spoilt::TooFast { .. }, .. } => {
                "turn the table with the ramps that were asked for, at no time faster than 400 deg/s; run the item again"
            }
            Self::SwitchesNotMoved { .. } => {
                "set the switches as the station asks, and confirm it after that; run the item again"
            }
            Self::NotTurned { .. } => "check angle and sense of the table, and which axis lies along it",
            Self::Figure(error) => error.try_this(),
            Self::Resume(error) => error.try_this(),
            Self::NotWarm { .. } => {
                "bring the room to the temperature of the earlier run and resume again; or raise `within` or `wait` under [resume] in the \
                 plan; or run the plan from its beginning"
            }
            Self::OtherTemperature { .. } => "run the plan from its beginning, without --resume",
            Self::Analysis { .. } => "keep the raw samples and report this",
            Self::Captures(error) => error.try_this(),
            Self::CanOpen(error) => error.try_this(),
            Self::CanGone(_) => {
                "check the CAN adapter, its cable and that its interface is up (`ip -details link show NAME`), then start again"
            }
            Self::FramesLost { by_host: 1.., .. } => {
                "this computer is too slow for its CAN controller: end other programs; `ip -statistics link` counts what it lost"
            }
            Self::FramesLost { busy_percent: BUSY_PERCENT.., .. } => {
                "the bus is full of other frames, which all have priority over test frames: take the other nodes off the bus or stop them, then run the item again"
            }
            Self::FramesLost { stale: 1.., .. } => {
                "earlier frames are still on their way: wait until the bus is quiet, then run the item again"
            }
            Self::TestIdsShared { .. } => {
                "take other stations and modules off this CAN bus, or wait until they are done; then run the item again"
            }
            Self::FramesLost { .. } => {
                "check the CAN cable, its termination (60 ohm between the lines) and the adapter"
            }
            Self::Nonsense { .. } => "compare the board's firmware with the interface document",
            Self::StillFed { .. } => {
                "check the board's switch, and that no other supply or line feeds the module; if its capacitors discharge slowly, raise `off_time` in the plan"
            }
            Self::ModuleChanged { .. } => {
                "leave the module in its socket during the run; if it stayed there, suspect the memory of its identity"
            }
            Self::OtherModule(_) => {
                "put the scanned module into the socket, or scan the label of this one; nothing is said of either"
            }
            Self::OtherPart { .. } => {
                "compare the label of the module with the part number that was given; nothing is said of the module"
            }
            Self::CannotRun { .. } => "take the item out of the plan or mark it optional",
            Self::TookTooLong { .. } => {
                "see in the log how far the item came; if it was still working, raise `timeout` in the plan"
            }
        }
    }
}

/// Share of the bus above which other frames are the first thing to look at.
const BUSY_PERCENT: f64 = 30.0;

fn sentences(still: &[SwitchReading]) -> String {
    let sentences: Vec<String> = still.iter().map(ToString::to_string).collect();
    sentences.join(" ").trim_end_matches('.').to_owned()
}

fn beside(others: u64, busy_percent: f64, span_s: f64) -> String {
    if others == 0 {
        return String::new();
    }
    format!("; {others} other frames passed in {span_s:.1} s, {busy_percent:.0} % of what the bus carries")
}

fn given_up(unsent: u64) -> String {
    if unsent == 0 {
        String::new()
    } else {
        format!("; {unsent} more were not sent, because no frame came back any longer")
    }
}

fn of_before(stale: u64) -> String {
    if stale == 0 { String::new() } else { format!("; {stale} of the received frames are older, or of other senders") }
}

fn lost_here(by_host: u64) -> String {
    if by_host == 0 { String::new() } else { format!("; this computer's controller or driver lost {by_host} frames") }
}
