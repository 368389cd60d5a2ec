//! The parts of a campaign's run, drawn from the campaign's seed and the run's number.

use std::fmt::Write as _;
use std::time::Duration;

use hw_mocks::boards;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::breach::{BREACHES, looks_like_a_bad_sensor};
use super::run::Over;

/// Approximate number of events in a run of the functional plan. A disturbance comes at one of them.
const EVENTS: u32 = 160;
/// Longest delay of a disturbance after its event: several items are in flight, and each waits for an answer.
const LATER_US: u32 = 4000;
/// Longest time between two actions.
const BETWEEN_MS: u32 = 600;
/// Factor on that time for the suspension of a computer: the board's watchdog waits for less than two seconds.
const SUSPENDED: u32 = 10;

/// A fault of the line: its key in a board's file, its rates from mild to harsh, and the duration of faults that take
/// time.
struct Fault {
    key: &'static str,
    rates: (f64, f64),
    time: Option<(&'static str, f64, f64)>,
}

const fn fault(key: &'static str, mild: f64, harsh: f64) -> Fault {
    Fault { key, rates: (mild, harsh), time: None }
}

const WIRE: [Fault; 10] = [
    fault("lost_bytes_per_million", 3.0, 300.0),
    fault("lost_frames_per_million", 300.0, 3e4),
    fault("flipped_bits_per_million", 0.3, 30.0),
    fault("cut_frames_per_million", 300.0, 3e4),
    fault("doubled_frames_per_million", 1e3, 5e5),
    fault("overtaken_frames_per_million", 1e3, 3e5),
    Fault { time: Some(("delay_ms", 20.0, 300.0)), ..fault("delayed_frames_per_million", 300.0, 3e4) },
    Fault { time: Some(("stall_ms", 50.0, 2500.0)), ..fault("stalled_frames_per_million", 100.0, 5e3) },
    fault("babbled_frames_per_million", 1e3, 3e5),
    fault("echoed_frames_per_million", 1e3, 1e6),
];

const CAN_WIRE: [Fault; 8] = [
    fault("lost_frames_per_million", 30.0, 5e3),
    fault("lost_bursts_per_million", 10.0, 1e3),
    fault("flipped_frames_per_million", 30.0, 5e3),
    fault("doubled_frames_per_million", 30.0, 5e4),
    fault("overtaken_frames_per_million", 30.0, 2e4),
    Fault { time: Some(("delay_ms", 20.0, 300.0)), ..fault("delayed_frames_per_million", 100.0, 3e3) },
    Fault { time: Some(("stall_ms", 50.0, 2500.0)), ..fault("stalled_frames_per_million", 30.0, 500.0) },
    fault("babbled_frames_per_million", 30.0, 5e4),
];

/// The link over which the station speaks with the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Link {
    /// RS-422, with a CAN bus beside it for the item that tests it.
    Rs422,
    /// CAN alone.
    Can,
}

/// A disturbance during the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Disturbance {
    /// Nothing.
    None,
    /// Asks for a stop in order. After the time `again` it asks for a stop at once.
    Stop {
        /// Time until the second request.
        again: Option<Duration>,
    },
    /// Suspends the computer for this time: its clock stands still and the board's goes on. Messages of the board are
    /// lost meanwhile. Only in memory, since half of a program cannot be suspended.
    Suspend(Duration),
    /// Pulls out the cable of the conversation; after the time `back` it is plugged in again.
    Unplug {
        /// Time until it is plugged in again.
        back: Option<Duration>,
    },
}

/// One run of a campaign.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Case {
    /// Seed of the campaign.
    pub seed: u64,
    /// Number of the run.
    pub number: u64,
    /// The module's file.
    pub board: &'static str,
    /// The link of the conversation.
    pub link: Link,
    /// The line's faults as tables of a board's file; empty if the line is clean.
    pub faults: String,
    /// Names of those faults.
    pub kinds: Vec<&'static str>,
    /// The rule of the interface document that the board breaks, as keys of `[board]`; empty if it breaks none.
    pub breach: &'static str,
    /// The disturbance during the run.
    pub disturbance: Disturbance,
    /// The number of events before it, and its delay after the last of them.
    pub moment: (u64, Duration),
}

impl Case {
    /// The run of this number in the campaign of this seed.
    #[must_use]
    pub fn drawn(seed: u64, number: u64) -> Self {
        let mut dice = ChaCha8Rng::seed_from_u64(seed);
        dice.set_stream(number);
        // Half of the modules are good; otherwise most runs would test the same few failures.
        let good = dice.random_bool(0.5);
        let pool: Vec<&(&str, &str)> = boards().iter().filter(|(_, text)| is_good(text) == good).collect();
        let (board, text) = *pool[dice.random_range(0..pool.len())];
        let link = if has_line_of_its_own(text) || dice.random_bool(0.6) { Link::Rs422 } else { Link::Can };
        let (faults, kinds) =
            if has_line_of_its_own(text) { Default::default() } else { drawn_faults(link, &mut dice) };
        let disturbance = drawn_disturbance(&mut dice);
        let later_us = u64::from(dice.random_range(0..LATER_US));
        let moment = (u64::from(dice.random_range(1..EVENTS)), Duration::from_micros(later_us));
        // Drawn last, so that a seed draws all else as it did before there were breaches.
        let breach = if text.contains("[board]") { "" } else { drawn_breach(link, &mut dice) };
        Self { seed, number, board, link, faults, kinds, breach, disturbance, moment }
    }

    /// Whether nothing but the module itself decides the verdict.
    pub(super) fn is_calm(&self) -> bool {
        self.kinds.is_empty() && self.breach.is_empty() && self.disturbance == Disturbance::None
    }

    /// The seed of bench and line.
    #[must_use]
    pub fn bench_seed(&self) -> u64 {
        // The run's number alone would make all campaigns alike.
        self.seed.rotate_left(32) ^ self.number
    }

    /// The module's file with the line's faults.
    #[must_use]
    pub fn text(&self) -> String {
        let text = boards().iter().find(|(name, _)| *name == self.board).map_or("", |(_, text)| text);
        let breach = if self.breach.is_empty() { String::new() } else { format!("[board]\n{}\n", self.breach) };
        format!("{text}\n{}{breach}", self.faults)
    }

    /// The command that repeats the run.
    #[must_use]
    pub fn command(&self, over: Over) -> String {
        let Self { seed, number, .. } = self;
        let over = if over == Over::Pty { " --over pty" } else { "" };
        format!("cargo run --release -p gnc-tests --bin campaign -- --seed {seed} --only {number}{over}")
    }
}

fn is_good(text: &str) -> bool {
    text.lines().skip_while(|line| *line != "[expect.functional]").nth(1) == Some("outcome = \"passed\"")
}

/// Whether the file has faults of the line already, which its expectation includes.
fn has_line_of_its_own(text: &str) -> bool {
    text.lines().any(|line| line.starts_with("[wire") || line.starts_with("[can_wire"))
}

fn drawn_faults(link: Link, dice: &mut ChaCha8Rng) -> (String, Vec<&'static str>) {
    let count = [0, 1, 1, 1, 2, 3][dice.random_range(0..6)];
    // On RS-422 the CAN bus that the item tests may be the faulty line.
    let on_can = link == Link::Can || dice.random_bool(0.2);
    let (table, all): (_, &[Fault]) = if on_can { ("can_wire", &CAN_WIRE) } else { ("wire", &WIRE) };
    let way = ["both", "to_host", "to_board"][dice.random_range(0..3)];
    let mut kinds = Vec::new();
    let mut text = format!("[{table}.{way}]\n");
    for _ in 0..count {
        let Fault { key, rates, time } = &all[dice.random_range(0..all.len())];
        if kinds.contains(key) {
            continue;
        }
        kinds.push(*key);
        // Uniform in the logarithm; several faults together are milder each.
        let harshness = dice.random::<f64>() / f64::from(count).sqrt();
        let _ = writeln!(text, "{key} = {:.3}", rates.0 * (rates.1 / rates.0).powf(harshness));
        if let Some((key, shortest, longest)) = time {
            let _ = writeln!(text, "{key} = {:.0}.0", dice.random_range(*shortest..*longest));
        }
    }
    if kinds.is_empty() { Default::default() } else { (text, kinds) }
}

/// A rule that the board breaks, in one of five runs.
fn drawn_breach(link: Link, dice: &mut ChaCha8Rng) -> &'static str {
    if !dice.random_bool(0.2) {
        return "";
    }
    let (keys, ..) = BREACHES[dice.random_range(0..BREACHES.len())];
    if looks_like_a_bad_sensor(keys, link) { "" } else { keys }
}

fn drawn_disturbance(dice: &mut ChaCha8Rng) -> Disturbance {
    let pause = |dice: &mut ChaCha8Rng| Duration::from_millis(u64::from(dice.random_range(0..BETWEEN_MS)));
    match dice.random_range(0..9) {
        0 => Disturbance::Stop { again: None },
        1 => Disturbance::Stop { again: Some(pause(dice)) },
        2 => Disturbance::Unplug { back: None },
        3 => Disturbance::Unplug { back: Some(pause(dice)) },
        4 => Disturbance::Suspend(pause(dice) * dice.random_range(1..SUSPENDED)),
        _ => Disturbance::None,
    }
}
