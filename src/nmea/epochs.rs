//! Epochs of sentences. An epoch is all that the receiver sends for one time of day.

use chrono::NaiveDate;

use super::active::{ActiveSatellites, Geometry};
use super::epoch::{Epoch, Fix};
use super::fault::SentenceFault;
use super::fields::Time;
use super::sentence::{Quality, Sentence, Solution, Source};

/// The talker of a combined solution of several systems.
const COMBINED: [u8; 2] = *b"GN";
/// The largest number of solutions in one epoch: each kind of each talker.
const MAX_SOLUTIONS: usize = 32;

/// Makes epochs.
#[derive(Debug, Default)]
pub(super) struct Epochs {
    open: Open,
    active: ActiveSatellites,
    /// The fullest kind of solution that this receiver sends.
    fullest: Option<Source>,
    /// Whether an epoch ended before: the first one may have been under way when listening began.
    begun: bool,
    last_time: Option<Time>,
    repeated: u32,
}

/// The epoch under way.
#[derive(Debug, Default)]
struct Open {
    time: Option<Time>,
    solutions: Vec<Solution>,
    speed_mps: Option<f64>,
    date: Option<NaiveDate>,
}

/// The result of the end of an epoch.
pub(super) type Ended = Option<Result<Epoch, SentenceFault>>;

impl Epochs {
    pub(super) fn repeated(&self) -> u32 {
        self.repeated
    }

    /// Notes a broken sentence of unknown kind.
    pub(super) fn broken(&mut self) {
        self.active.missed();
    }

    /// Notes a sentence with an impossible value. It is not a solution, but its kind is one that this receiver sends.
    pub(super) fn faulty(&mut self, body: &str) {
        let source = [Source::Gga, Source::Gns].into_iter().find(|source| body.get(2..5) == Some(source.name()));
        self.heard(source);
        if body.get(2..5) == Some("GSA") {
            self.active.missed();
        }
    }

    /// Takes a sentence. Returns the epoch that it ends, or why that epoch is not valid.
    pub(super) fn add(&mut self, sentence: Sentence) -> Ended {
        match sentence {
            Sentence::Solution(solution) => self.solution(solution),
            Sentence::Active(active) => {
                self.active.add(active);
                None
            }
            Sentence::Speed(speed_mps) => {
                self.open.speed_mps.get_or_insert(speed_mps);
                None
            }
            Sentence::Date(date) => {
                self.open.date.get_or_insert(date);
                None
            }
        }
    }

    fn heard(&mut self, source: Option<Source>) {
        self.fullest = self.fullest.into_iter().chain(source).min();
    }

    /// Whether this kind can make an epoch. A position of RMC or GLL alone counts if the receiver sends no fuller kind.
    fn counts(&self, source: Source) -> bool {
        source <= Source::Gns || self.fullest.is_none_or(|fullest| source <= fullest)
    }

    /// Takes a solution. Another time begins the next epoch, and so does the same sentence again. Receivers differ in
    /// the order of their sentences.
    fn solution(&mut self, solution: Solution) -> Ended {
        if !self.counts(solution.source) && solution.source == Source::Gll {
            return None;
        }
        let open = &self.open;
        let other_time = match (open.time, solution.time) {
            (Some(open), Some(new)) => !open.is(new),
            // GLL was without a time before version 2 of NMEA 0183.
            (None, None) => false,
            _ => !open.solutions.is_empty() && solution.source != Source::Gll,
        };
        let same = |other: &Solution| (other.source, other.talker) == (solution.source, solution.talker);
        let again = open.solutions.iter().any(same) && self.counts(solution.source);
        let ended = if other_time || again { self.close() } else { None };
        self.heard(Some(solution.source));
        self.open.time = self.open.time.or(solution.time);
        if self.open.solutions.len() < MAX_SOLUTIONS {
            self.open.solutions.push(solution);
        }
        ended
    }

    fn close(&mut self) -> Ended {
        let open = std::mem::take(&mut self.open);
        let first = !std::mem::replace(&mut self.begun, true);
        let chosen = choose(&open.solutions).filter(|chosen| self.counts(chosen.source))?;
        if first && chosen.source > Source::Gns {
            return None;
        }
        let geometry = self.active.close();
        // Before its first fix a receiver's clock may stand still.
        let again = chosen.quality == Quality::Satellites
            && self.last_time.zip(open.time).is_some_and(|(last, now)| last.is(now));
        self.last_time = open.time;
        if again {
            self.repeated = self.repeated.saturating_add(1);
            return None;
        }
        let void = contradicted(chosen, &open.solutions);
        Some(if void {
            Err(SentenceFault::Void { sentence: chosen.source.name() })
        } else {
            Ok(epoch(chosen, &open, geometry))
        })
    }
}

/// Chooses the fullest kind. If each system has a solution of its own, the combined one is chosen, or else the first
/// with a fix.
fn choose(solutions: &[Solution]) -> Option<&Solution> {
    let fixed = |solution: &Solution| solution.quality == Quality::Satellites && solution.place.is_some();
    let rank = |solution: &&Solution| {
        let of_rest = solution.source > Source::Gns;
        let kind = if of_rest { solution.source as u8 } else { 0 };
        (kind, solution.talker != COMBINED, !fixed(solution))
    };
    solutions.iter().min_by_key(rank)
}

/// Whether RMC of the same time declares the fix void.
fn contradicted(chosen: &Solution, solutions: &[Solution]) -> bool {
    let mut said = solutions.iter().filter(|solution| solution.source == Source::Rmc).peekable();
    chosen.source <= Source::Gns
        && chosen.quality == Quality::Satellites
        && said.peek().is_some()
        && said.all(|rmc| rmc.quality == Quality::None)
}

fn epoch(chosen: &Solution, open: &Open, geometry: Geometry) -> Epoch {
    let fix = match (chosen.quality, geometry.dimensions) {
        (Quality::Satellites, None) => Fix::DimensionsUnknown,
        (Quality::Satellites, Some(3)) => Fix::ThreeD,
        (Quality::Satellites, Some(2)) => Fix::TwoD,
        (Quality::Estimated, _) => Fix::Estimated,
        (Quality::Manual, _) => Fix::Manual,
        (Quality::Simulated, _) => Fix::Simulated,
        (Quality::None | Quality::Satellites, _) => Fix::None,
    };
    let rmc = || open.solutions.iter().filter(|solution| solution.source == Source::Rmc);
    Epoch {
        fix,
        latitude_deg: chosen.place.map(|(latitude_deg, _)| latitude_deg),
        longitude_deg: chosen.place.map(|(_, longitude_deg)| longitude_deg),
        altitude_m: chosen.altitude_m,
        height_m: chosen.altitude_m.zip(chosen.geoid_m).map(|(above_sea, geoid)| above_sea + geoid),
        ground_speed_mps: rmc().find_map(|rmc| rmc.speed_mps).or(open.speed_mps),
        // Many receivers count only up to 12 in GGA, and one GSA lists no more than 12.
        satellites_used: chosen.satellites.into_iter().chain(geometry.satellites).max(),
        hdop: chosen.hdop.or(geometry.hdop),
        vdop: geometry.vdop,
        date: rmc().find_map(|rmc| rmc.date).or(open.date),
    }
}
