//! The GNSS receiver: acquisition, position with its errors, sentences, 1PPS.
//!
//! Acquisition starts with the module's supply (hot: almanac, ephemeris and clock are kept by a backup cell) or
//! with a restart. Time to first fix, drawn for each start: hot 1.2 to 1.8 s, warm 18 to 24 s, cold 25 to 32 s, as
//! data sheets of small receivers state for open sky.
//!
//! Errors of a fix are Gauss-Markov: 2.2 m north and east, 3.8 m up with 60 s of correlation; 0.03 m/s north and
//! east with 1 s. That is inside the published 1-sigma limits of 10 m, 15 m and 0.1 m/s. The edges of 1PPS scatter
//! by 15 ns (1 sigma) before the slave's timer rounds them to its 10 ns.
//!
//! A receiver that plays a log sends its epochs at a steady pace after each start, and is silent after the last one.
//! Epochs without a listener are lost. Its pulses come from the start on: they belong to a clock and not to the log.

use std::sync::Arc;

use gnc_protocol::message::GnssStart;

use super::nmea::{ReceiverEpoch, ReceiverSolution};
use super::playback::Recording;
use super::sky;
use crate::noise::{Dice, GaussMarkov, RandomStream};
use crate::world::World;

/// Epochs a second.
pub(crate) const EPOCHS_HZ: f64 = 5.0;
/// Time from an epoch to the last byte of its sentences.
pub(crate) const LATENCY_S: f64 = 0.06;

/// Faults of the receiver and around it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct GnssFaults {
    /// No signal reaches the antenna.
    pub no_sky: bool,
    /// The signals come through a repeater whose antenna stands this many metres to the north and east.
    pub antenna_offset_m: (f64, f64),
    /// The antenna connection opens this many seconds after each fix.
    pub covered_after_fix_s: Option<f64>,
    /// The 1PPS line is broken.
    pub pps_open: bool,
    /// Additional scatter of the 1PPS edges, 1 sigma.
    pub pps_jitter_s: f64,
}

/// A log that is played in place of a sky.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Playback {
    /// The log.
    pub recording: Arc<Recording>,
    /// Epochs a second, at most [`EPOCHS_HZ`].
    pub epochs_hz: f64,
}

/// The receiver. Times are seconds since the bench was started.
#[derive(Debug, Clone)]
pub(crate) struct SimulatedReceiver {
    faults: GnssFaults,
    playback: Option<Playback>,
    started_at_s: f64,
    time_known_s: f64,
    fix_at_s: f64,
    noise_at_s: f64,
    north: GaussMarkov,
    east: GaussMarkov,
    up: GaussMarkov,
    velocity: [GaussMarkov; 2],
    acquisition_dice: Dice,
    dice: Dice,
    pps_dice: Dice,
}

impl SimulatedReceiver {
    /// A receiver without power, under a seed.
    #[must_use]
    pub(crate) fn new(faults: GnssFaults, playback: Option<Playback>, seed: u64) -> Self {
        let mut dice = Dice::new(seed, RandomStream::Gnss);
        let mut slow = |deviation, correlation_s| GaussMarkov::new(deviation, correlation_s, &mut dice);
        let (north, east, up) = (slow(2.2, 60.0), slow(2.2, 60.0), slow(3.8, 60.0));
        let velocity = [slow(0.03, 1.0), slow(0.03, 1.0)];
        Self {
            faults,
            playback,
            started_at_s: 0.0,
            time_known_s: 0.0,
            fix_at_s: 0.0,
            noise_at_s: 0.0,
            north,
            east,
            up,
            velocity,
            acquisition_dice: Dice::new(seed, RandomStream::Acquisition),
            dice,
            pps_dice: Dice::new(seed, RandomStream::Pps),
        }
    }

    /// Handles power-on: a hot start.
    pub(crate) fn power_on(&mut self, now_s: f64) {
        self.restart(GnssStart::Hot, now_s);
    }

    /// Restarts the receiver: it forgets what this kind of start implies, and acquires anew.
    pub(crate) fn restart(&mut self, start: GnssStart, now_s: f64) {
        let (shortest_s, longest_s, time_share) = match start {
            GnssStart::Hot => (1.2, 1.8, 0.0),
            GnssStart::Warm => (18.0, 24.0, 0.0),
            GnssStart::Cold => (25.0, 32.0, 0.4),
        };
        let span_s = self.acquisition_dice.between(shortest_s, longest_s);
        self.started_at_s = now_s;
        self.fix_at_s = now_s + span_s;
        self.time_known_s = now_s + time_share * span_s;
    }

    /// Whether it has a fix.
    #[must_use]
    pub(crate) fn has_fix(&self, now_s: f64) -> bool {
        now_s >= self.fix_at_s && self.sees_sky(now_s)
    }

    fn sees_sky(&self, now_s: f64) -> bool {
        let covered = self.faults.covered_after_fix_s.is_some_and(|after_s| now_s >= self.fix_at_s + after_s);
        !self.faults.no_sky && !covered
    }

    /// The bytes that it sends at `now_s`, once for each of its epochs.
    pub(crate) fn say(&mut self, world: &World, now_s: f64) -> Vec<u8> {
        match &self.playback {
            Some(playback) => playback.said(now_s - self.started_at_s).to_vec(),
            None => self.epoch(world, now_s).into_bytes(),
        }
    }

    /// The sentences of the epoch at `now_s`.
    fn epoch(&mut self, world: &World, now_s: f64) -> String {
        self.move_errors(now_s);
        let mut view = if self.sees_sky(now_s) { sky::satellites(now_s) } else { Vec::new() };
        for satellite in &mut view {
            satellite.cn0_dbhz += self.dice.normal().clamp(-2.0, 2.0);
        }
        // The signals are found one after the other; the last one gives the fix.
        let acquired = (now_s - self.started_at_s) / (self.fix_at_s - self.started_at_s).max(1e-3);
        let tracked = ((view.len() as f64 * acquired.min(1.0)) as usize).min(view.len());
        let used = if self.has_fix(now_s) { sky::usable(&view) } else { Vec::new() };
        let solution = sky::dilution(&used).map(|dilution| self.solution(world, dilution));
        let time_known = now_s >= self.time_known_s && (!view.is_empty() || self.time_known_s <= self.started_at_s);
        ReceiverEpoch {
            utc_s: time_known.then(|| world.utc_s(now_s)),
            solution,
            used: solution.map_or_else(Vec::new, |_| used.iter().map(|satellite| satellite.prn).collect()),
            view: view.into_iter().enumerate().map(|(index, satellite)| (satellite, index < tracked)).collect(),
        }
        .sentences()
    }

    /// Scatter of the 1PPS edge of a whole second; `None` if there is no edge on the line.
    pub(crate) fn pps_scatter_s(&mut self, now_s: f64) -> Option<f64> {
        let scatter_s = 15e-9_f64.hypot(self.faults.pps_jitter_s) * self.pps_dice.normal();
        let runs = self.has_fix(now_s) || self.playback.is_some();
        (runs && !self.faults.pps_open).then_some(scatter_s)
    }

    fn solution(&self, world: &World, dilution: sky::Dilution) -> ReceiverSolution {
        let site = &world.site;
        let (offset_north_m, offset_east_m) = self.faults.antenna_offset_m;
        let (meridian_m, parallel_m) = radii_m(site.latitude_deg, site.height_m);
        let north_m = self.north.value() + offset_north_m;
        let east_m = self.east.value() + offset_east_m;
        ReceiverSolution {
            latitude_deg: site.latitude_deg + (north_m / meridian_m).to_degrees(),
            longitude_deg: site.longitude_deg + (east_m / parallel_m).to_degrees(),
            altitude_m: site.height_m - site.geoid_m + self.up.value(),
            geoid_m: site.geoid_m,
            north_mps: self.velocity[0].value(),
            east_mps: self.velocity[1].value(),
            dilution,
        }
    }

    fn move_errors(&mut self, now_s: f64) {
        let span_s = (now_s - self.noise_at_s).max(0.0);
        self.noise_at_s = now_s;
        for error in [&mut self.north, &mut self.east, &mut self.up].into_iter().chain(&mut self.velocity) {
            error.step(span_s, &mut self.dice);
        }
    }
}

impl Playback {
    /// The bytes of the epoch that became due since the receiver's own last epoch, if there is one.
    fn said(&self, since_start_s: f64) -> &[u8] {
        let due = |at_s: f64| (at_s * self.epochs_hz).floor();
        let (before, now) = (due(since_start_s - 1.0 / EPOCHS_HZ), due(since_start_s));
        if now < 0.0 || before == now { &[] } else { self.recording.epoch(now as usize) }
    }
}

/// Metres per radian of latitude and of longitude on WGS-84 at a height.
fn radii_m(latitude_deg: f64, height_m: f64) -> (f64, f64) {
    const A_M: f64 = 6_378_137.0;
    const E2: f64 = 6.694_379_990_14e-3;
    let (sin, cos) = latitude_deg.to_radians().sin_cos();
    let w2 = 1.0 - E2 * sin * sin;
    let meridian_m = A_M * (1.0 - E2) / w2.powf(1.5);
    let normal_m = A_M / w2.sqrt();
    (meridian_m + height_m, (normal_m + height_m) * cos)
}
