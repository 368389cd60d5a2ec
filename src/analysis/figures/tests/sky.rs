//! The output of a receiver, made by hand, with known errors.

use gnc_executive::bench::SitePlace;

use super::world::{Dice, capture};
use crate::capture::{Capture, Pose, Said};

/// A receiver above an antenna, and the board's clock that times its pulses.
pub(super) struct Sky {
    pub(super) antenna: SitePlace,
    /// One a second.
    pub(super) epochs: usize,
    /// Deviations of north, east and up.
    pub(super) deviation_m: [f64; 3],
    /// Part of an error that stays to the next epoch.
    pub(super) memory: f64,
    /// Deviation of each of two components of the velocity.
    pub(super) speed_mps: f64,
    /// Scatter of the pulses, which the timer records in steps of 10 ns.
    pub(super) edge_ns: f64,
    /// Error of the board's clock; positive where it runs fast.
    pub(super) clock_ppm: f64,
}

pub(super) fn sentence(body: &str) -> String {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n")
}

fn degrees(value: f64, digits: usize) -> String {
    let whole = value.floor();
    format!("{:0digits$}{:010.7}", whole as u32, (value - whole) * 60.0)
}

impl Sky {
    pub(super) fn listened(&self, seed: u64) -> Capture {
        let mut dice = Dice::new(seed);
        let mut error = self.deviation_m.map(|deviation| deviation * dice.normal());
        let mut said = Vec::new();
        let mut pulses_ns = Vec::new();
        for k in 0..self.epochs {
            for (error, deviation) in error.iter_mut().zip(self.deviation_m) {
                *error = self.memory * *error + (1.0 - self.memory.powi(2)).sqrt() * deviation * dice.normal();
            }
            // Metres per degree at 34.2 deg and 412 m, from a table of the ellipsoid: 110,930 and 92,190.
            let latitude = degrees(self.antenna.latitude_deg + error[0] / 110_930.0, 2);
            let longitude = degrees(self.antenna.longitude_deg + error[1] / 92_190.0, 3);
            let time = format!("{:02}{:02}{:02}.00", k / 3600, k / 60 % 60, k % 60);
            let height = self.antenna.height_m + error[2] + 30.0;
            let [north, east] = [0; 2].map(|_| self.speed_mps * dice.normal());
            let knots = north.hypot(east) * 3600.0 / 1852.0;
            let text = sentence(&format!("GPGGA,{time},{latitude},N,{longitude},E,1,09,0.9,{height:.3},M,-30.0,M,,"))
                + &sentence("GPGSA,A,3,01,02,03,04,05,06,07,08,09,,,,1.8,0.9,1.5")
                + &sentence(&format!("GPRMC,{time},A,{latitude},N,{longitude},E,{knots:.5},0.0,221126,,"));
            said.push(Said { board_time_us: k as u64 * 1_000_000, bytes: text.into_bytes() });
            let edge_ns = k as f64 * (1e9 + 1e3 * self.clock_ppm) + self.edge_ns * dice.normal() + 1e6;
            pulses_ns.push((edge_ns / 10.0).round() as u64 * 10);
        }
        let mut capture = capture("sky", 1, Pose::Still { up: [0.0, 0.0, 1.0], heading_deg: 0.0 }, 0, Vec::new());
        (capture.receiver.said, capture.receiver.pulses_ns) = (said, pulses_ns);
        capture
    }
}
