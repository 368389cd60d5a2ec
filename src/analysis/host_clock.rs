//! The board's clock compared with the host's: how much faster one runs, as far as the latency of the link shows it.
//!
//! A frame comes some time after its last sample, never before it. So the least delays of the first and of the last
//! third of a capture are compared. Their difference is that of the clocks, except for the latency that both still
//! contain.

use std::time::Duration;

use crate::capture::HostView;

/// Length of the pieces for which a least delay is kept, in seconds of the board's clock.
const PIECE_S: f64 = 0.25;
/// Fewest pieces. A capture of less than two seconds gives no result.
const FEWEST: usize = 6;
/// Latency that no least delay shows: a USB adapter asks for bytes once in a millisecond.
const LATENCY_S: f64 = 1e-3;
/// Rounds of the search for the least delays: the second is right, the third makes sure.
const ROUNDS: usize = 3;
/// Bound of the error of a host's clock without discipline, parts per million.
const HOST_PPM: f64 = 50.0;
/// An expanded uncertainty (k = 2) beyond this gives no useful result.
const LARGEST_PPM: f64 = 10_000.0;

/// Whether the host's clock runs like the board's world; if not, the reason.
pub type HostClock = Result<(), String>;

/// Compares both clocks over one capture.
#[derive(Debug, Clone)]
pub struct HostWatch {
    clock: HostClock,
    first: Option<(f64, u64)>,
    /// The least delay of each piece: board time since the first sample, and delay beyond that of the first frame,
    /// seconds.
    least: Vec<(f64, f64)>,
}

impl HostWatch {
    /// A watch before the first frame.
    #[must_use]
    pub fn new(clock: HostClock) -> Self {
        Self { clock, first: None, least: Vec::new() }
    }

    /// Takes a frame that came after this host time. Its last sample was taken at this board time.
    pub fn heard(&mut self, host: Duration, board_time_us: u64) {
        let (host_s, first_us) = *self.first.get_or_insert((host.as_secs_f64(), board_time_us));
        let board_s = board_time_us.saturating_sub(first_us) as f64 * 1e-6;
        let delay_s = host.as_secs_f64() - host_s - board_s;
        match self.least.last_mut() {
            Some((at_s, least)) if (*at_s / PIECE_S).floor() >= (board_s / PIECE_S).floor() => {
                if delay_s < *least {
                    (*at_s, *least) = (board_s, delay_s);
                }
            }
            _ => self.least.push((board_s, delay_s)),
        }
    }

    /// Returns the result of the comparison.
    #[must_use]
    pub fn view(&self) -> HostView {
        if let Err(why) = &self.clock {
            return HostView::Nothing(why.clone());
        }
        let span_s = self.least.last().map_or(0.0, |(at_s, _)| *at_s);
        let short = || {
            let why = format!("a capture of {span_s:.1} s is too short to compare the board's clock with the host's");
            HostView::Nothing(why)
        };
        if self.least.len() < FEWEST {
            return short();
        }
        let third = self.least.len() / 3;
        let ends = [&self.least[..third], &self.least[self.least.len() - third..]];
        // Within a third the delays of a clock that is far off grow by more than the latency. So the known part of its
        // error is subtracted before the next search for the least delay.
        let (mut slope, mut latency) = (0.0, f64::NAN);
        for _ in 0..ROUNDS {
            let [(from_s, early_s, one_s), (to_s, late_s, other_s)] = ends.map(|pieces| least(pieces, slope));
            let between_s = to_s - from_s;
            slope += (late_s - early_s) / between_s;
            latency = one_s.hypot(other_s) / 3.0_f64.sqrt() / between_s;
        }
        // The faster the board's clock is, the less its frames lag behind the host's.
        let (error_ppm, latency_ppm) = (-slope / (1.0 + slope) * 1e6, latency * 1e6);
        let u_ppm = latency_ppm.hypot(HOST_PPM / 3.0_f64.sqrt());
        if 2.0 * u_ppm <= LARGEST_PPM { HostView::Compared { error_ppm, u_ppm } } else { short() }
    }
}

/// The least delay of some pieces beyond a slope, its board time, and how far it may lie above the shortest possible
/// delay: as far as the middle delay lies above it.
fn least(pieces: &[(f64, f64)], slope: f64) -> (f64, f64, f64) {
    let mut sorted: Vec<(f64, f64)> = pieces.iter().map(|(at_s, delay_s)| (*at_s, delay_s - slope * at_s)).collect();
    sorted.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (at_s, delay_s) = sorted.first().copied().unwrap_or((f64::NAN, f64::NAN));
    let middle_s = sorted.get(sorted.len() / 2).map_or(f64::NAN, |(_, delay_s)| *delay_s);
    (at_s, delay_s, (middle_s - delay_s).max(LATENCY_S))
}

#[cfg(test)]
#[allow(clippy::panic, reason = "a test may end with a panic")]
mod tests {
    use super::*;

    /// Frames of 50 ms from a board that is `error_ppm` fast, with the latency of each.
    fn watched(error_ppm: f64, frames: u64, latency_s: impl Fn(u64) -> f64) -> HostView {
        let mut watch = HostWatch::new(Ok(()));
        for frame in 0..frames {
            let board_us = 7_000_000 + frame * 50_000;
            let true_s = frame as f64 * 0.05 / (1.0 + error_ppm * 1e-6);
            watch.heard(Duration::from_secs_f64(true_s + latency_s(frame)), board_us);
        }
        watch.view()
    }

    #[test]
    fn the_error_lies_within_its_uncertainty_whatever_the_latency() {
        // Latency of 2 to 9 ms in turn, with an occasional stall of 300 ms.
        let latency_s = |frame: u64| 0.002 + (frame * 7 % 8) as f64 * 1e-3 + if frame % 97 == 3 { 0.3 } else { 0.0 };
        for error_ppm in [0.0, 30.0, -5000.0, 50_000.0] {
            for (seconds, most_ppm) in [(4, 3000.0), (300, 40.0), (3600, 30.0)] {
                let HostView::Compared { error_ppm: seen_ppm, u_ppm } = watched(error_ppm, seconds * 20, latency_s)
                else {
                    panic!("{seconds} s are long enough")
                };
                assert!((seen_ppm - error_ppm).abs() < 2.0 * u_ppm, "{seen_ppm} +- {u_ppm}");
                assert!(u_ppm < most_ppm, "{seconds} s: {u_ppm}");
            }
        }
    }

    #[test]
    fn what_is_too_short_or_no_real_time_says_nothing_and_why() {
        let short = watched(0.0, 20, |_| 0.002);
        assert!(matches!(&short, HostView::Nothing(why) if why.contains("too short")), "{short:?}");
        let mut watch = HostWatch::new(Err("simulated".into()));
        watch.heard(Duration::ZERO, 0);
        assert_eq!(watch.view(), HostView::Nothing("simulated".into()));
    }
}
