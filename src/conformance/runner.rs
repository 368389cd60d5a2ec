//! Runs the checks one after the other, and leaves the board in its safe state.

use std::fmt;
use std::time::Duration;

use gnc_link::Link;
use gnc_protocol::Kind;
use gnc_protocol::message::event;
use tokio::sync::watch;

use crate::check::Check;
use crate::driver::{Begins, Driver, ms};
use crate::stop::{Stop, Verdict};
use crate::table::{Demand, checks, selects};

/// How long a board may be silent at the start: one that starts listens after 2 s, and sends a heartbeat each second.
const BOARD_WITHIN: Duration = Duration::from_millis(3000);
/// What all checks take together with a board that does what the document demands.
pub const TAKES: Duration = Duration::from_secs(95);
/// How often it is greeted meanwhile.
const GREETED_EVERY: Duration = Duration::from_millis(500);
/// Checks in a row that end in silence. After them the board is taken for gone, and the rest is not tried.
const SILENT_CHECKS: u32 = 2;
/// Checks in a row for which no session could be opened. After them only those are tried that need none.
const CLOSED_CHECKS: u32 = 3;
/// Checks in a row for which the module could not be switched on. It may draw too much: it is not switched on for ever.
const UNPOWERED_CHECKS: u32 = 2;

/// What the checks need to know.
#[derive(Debug, Clone)]
pub struct CheckOptions {
    /// Rate of the line, bit/s.
    pub rate_bps: u32,
    /// Any number, another one each time: the nonces of the sessions begin there.
    pub nonce: u32,
    /// Whether the module is simulated: only then a check commits a calibration to it.
    pub simulated: bool,
    /// Only this section's checks (its number), or those whose names begin so.
    pub only: Option<String>,
}

/// How a check ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The board does what the document demands.
    Passed,
    /// It does not.
    Failed,
    /// The demand does not bind this board on this link.
    NotApplicable,
}

impl Outcome {
    /// The word for people and programs.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Passed => "pass",
            Self::Failed => "fail",
            Self::NotApplicable => "n/a",
        }
    }
}

/// What a check found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// What the document demands.
    pub demand: Demand,
    /// What was measured, what came instead, or why the demand does not bind. It may hold text of the board.
    pub measured: String,
    /// How it ended.
    pub outcome: Outcome,
}

/// What is known of the board when the checks begin.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CheckedBoard {
    /// Serial number of the slave board.
    pub serial: String,
    /// Its firmware.
    pub firmware: String,
    /// Bits of its capabilities.
    pub capabilities: u32,
}

/// What happens while the checks run.
#[derive(Debug)]
pub enum CheckEvent<'a> {
    /// A session was opened for the first time.
    Board(CheckedBoard),
    /// The next check switches the module on; it is told once.
    Powers,
    /// A check ended.
    Found(&'a Finding),
}

/// How the checks ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ended {
    /// What was found, in the order of the document.
    pub findings: Vec<Finding>,
    /// Whether a person stopped the checks before the last one.
    pub stopped: bool,
    /// Whether the board said at the end that it is in its safe state.
    pub safe: bool,
}

/// Nothing came from a board.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NoBoard {
    /// How long the station listened and greeted.
    pub waited: Duration,
    /// What the system said, if the port went away.
    pub gone: Option<String>,
}

impl fmt::Display for NoBoard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.gone {
            Some(gone) => f.write_str(gone),
            None => {
                let waited_s = self.waited.as_secs_f64();
                write!(f, "nothing came from a board within {waited_s:.1} s: no heartbeat, no answer to HELLO")
            }
        }
    }
}

impl std::error::Error for NoBoard {}

/// Checks a board. `stopped` becomes true when a person wants no further check.
///
/// # Errors
/// [`NoBoard`]: nothing came at all.
pub async fn run(
    link: Link,
    options: &CheckOptions,
    stopped: watch::Receiver<bool>,
    tell: &mut dyn FnMut(CheckEvent<'_>),
) -> Result<Ended, NoBoard> {
    let mut driver = Driver::new(link, options.rate_bps, options.nonce, stopped);
    if options.simulated {
        driver.let_change_module();
    }
    if let Err(no_board) = find(&mut driver).await {
        driver.close().await;
        return Err(no_board);
    }
    let mut ended = Ended { findings: Vec::new(), stopped: false, safe: false };
    let mut told = Told::default();
    let (mut silent, mut closed, mut unpowered) = (0, 0, 0);
    // A board with which no session can be opened is told so by the check of its HELLO, and not by each of the others.
    if chosen(options).any(|check| check.id == HELLO_CHECK)
        && matches!(driver.begin(Begins::Session).await, Err(Stop::Closed(_)))
    {
        closed = CLOSED_CHECKS;
        driver.disturb();
    }
    driver.forgive_silence();
    for check in chosen(options) {
        let demand = demand_of(check);
        let verdict = if let Some(why) = other_link(&driver, check) {
            Err(Stop::NotApplicable(why.to_owned()))
        } else if silent >= SILENT_CHECKS {
            Err(Stop::NotApplicable("not tried: the board has fallen silent".to_owned()))
        } else if closed >= CLOSED_CHECKS && check.begins != Begins::Anyhow {
            Err(Stop::NotApplicable("not tried: no session can be opened, see section 6".to_owned()))
        } else if unpowered >= UNPOWERED_CHECKS && check.begins == Begins::Powered {
            Err(Stop::NotApplicable("not tried: the module cannot be switched on".to_owned()))
        } else {
            told.before(check, tell);
            carry_out(&mut driver, check).await
        };
        if verdict == Err(Stop::Cancelled) {
            ended.stopped = true;
            break;
        }
        told.board(&driver, tell);
        match &verdict {
            Err(Stop::Silent(_) | Stop::Gone(_)) => {
                silent += 1;
                // A board that restarts is there again after two seconds.
                driver.forgive_silence();
            }
            Err(Stop::Closed(_)) => closed += 1,
            Err(Stop::Unpowered(_)) => unpowered += 1,
            _ if check.begins == Begins::Anyhow || silent >= SILENT_CHECKS || closed >= CLOSED_CHECKS => {}
            _ if check.begins == Begins::Powered && unpowered < UNPOWERED_CHECKS => {
                (silent, closed, unpowered) = (0, 0, 0);
            }
            _ => (silent, closed) = (0, 0),
        }
        let finding = finding(demand, verdict);
        tell(CheckEvent::Found(&finding));
        ended.findings.push(finding);
    }
    ended.safe = driver.make_safe().await;
    driver.close().await;
    Ok(ended)
}

fn demand_of(check: &Check) -> Demand {
    Demand { id: check.id, section: check.section, demand: check.demand }
}

/// The checks that are asked for.
fn chosen(options: &CheckOptions) -> impl Iterator<Item = &'static Check> + '_ {
    let only = options.only.as_deref();
    checks().filter(move |check| only.is_none_or(|only| selects(only, &demand_of(check))))
}

/// What was told already.
#[derive(Debug, Default)]
struct Told {
    board: bool,
    powers: bool,
}

impl Told {
    fn before(&mut self, check: &Check, tell: &mut dyn FnMut(CheckEvent<'_>)) {
        if check.begins == Begins::Powered && !std::mem::replace(&mut self.powers, true) {
            tell(CheckEvent::Powers);
        }
    }

    fn board(&mut self, driver: &Driver, tell: &mut dyn FnMut(CheckEvent<'_>)) {
        let board = driver.board();
        if board.chosen != 0 && !std::mem::replace(&mut self.board, true) {
            tell(CheckEvent::Board(CheckedBoard {
                serial: board.serial.to_string(),
                firmware: board.firmware.to_string(),
                capabilities: board.capabilities,
            }));
        }
    }
}

/// Waits until anything comes from a board: a heartbeat, an answer to HELLO, or bytes that are no frame.
async fn find(driver: &mut Driver) -> Result<(), NoBoard> {
    let nonce = driver.new_nonce();
    let mut waited = Duration::ZERO;
    while waited < BOARD_WITHIN {
        driver.say_hello((1, 1), nonce, 0);
        match driver.until(0, GREETED_EVERY, |_| true).await {
            Ok(Some(_)) | Err(Stop::Cancelled) => return Ok(()),
            Err(Stop::Gone(gone)) => return Err(NoBoard { waited, gone: Some(gone) }),
            Ok(None) | Err(_) => waited += GREETED_EVERY,
        }
    }
    Err(NoBoard { waited, gone: None })
}

/// Carries out a check from the state in which it begins.
async fn carry_out(driver: &mut Driver, check: &Check) -> Verdict {
    let verdict = match driver.begin(check.begins).await {
        Ok(()) => (check.run)(driver).await,
        Err(stop) => Err(stop),
    };
    if !matches!(verdict, Ok(_) | Err(Stop::NotApplicable(_))) {
        driver.disturb();
    }
    match verdict {
        Err(Stop::Failed(what)) => Err(Stop::Failed(match explained(driver, check) {
            Some(why) => format!("{what}; {why}"),
            None => what,
        })),
        other => other,
    }
}

/// Why a check is not for this link: section 17 replaces section 3 on CAN.
fn other_link(driver: &Driver, check: &Check) -> Option<&'static str> {
    match (check.section, driver.is_can()) {
        (FRAMES_SECTION, true) => Some("the board is reached by CAN, where section 17 replaces this one"),
        (CAN_SECTION, false) => Some("the board is reached by RS-422"),
        _ => None,
    }
}

/// What explains more than what was missed: the board restarted in the middle, or its watchdog fired.
fn explained(driver: &Driver, check: &Check) -> Option<&'static str> {
    let heard = driver.heard();
    let boot_id = driver.board().boot_id.to_le_bytes();
    let restarted = heard.iter().any(|heard| {
        let beat = heard.of(Kind::Event).filter(|frame| frame.header.message == event::HEARTBEAT);
        beat.is_some_and(|frame| !frame.payload.starts_with(&boot_id))
    });
    if restarted {
        return Some("a heartbeat with another boot id came: did the board restart?");
    }
    let fired = heard.iter().any(|heard| heard.is(Kind::Event, event::WATCHDOG));
    (fired && check.section != LIFE_SECTION).then_some("its watchdog ended the session meanwhile")
}

/// The check that tells why no session can be opened.
const HELLO_CHECK: &str = "hello.layout";
/// The sections of RS-422 alone, of CAN alone, and with the checks that let the watchdog end the session.
const FRAMES_SECTION: u8 = 3;
const CAN_SECTION: u8 = 17;
const LIFE_SECTION: u8 = 9;

fn finding(demand: Demand, verdict: Verdict) -> Finding {
    let (measured, outcome) = match verdict {
        Ok(measured) => (measured, Outcome::Passed),
        Err(Stop::Failed(what) | Stop::Closed(what) | Stop::Unpowered(what)) => (what, Outcome::Failed),
        Err(Stop::NotApplicable(why)) => (why, Outcome::NotApplicable),
        Err(Stop::Silent(span)) => (format!("the board fell silent: nothing came for {}", ms(span)), Outcome::Failed),
        Err(Stop::Gone(what)) => (what, Outcome::Failed),
        Err(Stop::Cancelled) => ("stopped".to_owned(), Outcome::NotApplicable),
    };
    Finding { demand, measured, outcome }
}
