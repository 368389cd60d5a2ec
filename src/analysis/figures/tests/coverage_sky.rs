//! Checks that the intervals of the receiver's figures, and of the clock that its pulses measure, hold the truth as
//! often as they say.

use gnc_executive::bench::{BenchSite, SitePlace};
use gnc_executive::catalogue::ItemId;

use super::coverage::{Found, Tally, params, seed_of, tally};
use super::sky::Sky;
use super::world::{Dice, LATITUDE_DEG};
use crate::capture::HostView;
use crate::figures::{AnalysisInput, Findings, analyse, clock};

const PLAN: &str = r#"
name = "coverage"
version = "1"
[[item]]
id = "gnss-accuracy"
phase = "setup"
params = { duration = "300 s", survey_u = "0.05 m" }
"#;
const EPOCHS: usize = 300;
const DEVIATION_M: [f64; 3] = [2.0, 3.0, 5.0];
const SPEED_MPS: f64 = 0.05;
/// More than the 100 ns of the least assumed scatter.
const EDGE_NS: f64 = 150.0;

/// Listens to `trials` receivers.
pub(super) fn run(trials: usize, seed: u64) -> Vec<Tally> {
    let params = params(PLAN);
    tally(trials, |trial| {
        let seed = seed_of(trial, seed);
        let mut errors = Dice::new(seed ^ 0x5EED);
        let clock_ppm = 29.0 * errors.normal();
        let antenna = SitePlace { latitude_deg: LATITUDE_DEG, longitude_deg: 108.9, height_m: 412.0 };
        let (deviation_m, speed_mps, edge_ns) = (DEVIATION_M, SPEED_MPS, EDGE_NS);
        let sky = Sky { antenna, epochs: EPOCHS, deviation_m, memory: 0.5, speed_mps, edge_ns, clock_ppm };
        let captures = [sky.listened(seed)];
        // The survey has an error of 0.05 m along each axis: 110,930 and 92,190 m for a degree.
        let surveyed = SitePlace {
            latitude_deg: antenna.latitude_deg + 0.05 * errors.normal() / 110_930.0,
            longitude_deg: antenna.longitude_deg + 0.05 * errors.normal() / 92_190.0,
            height_m: antenna.height_m + 0.05 * errors.normal(),
        };
        let site = BenchSite { place: Some(surveyed), ..BenchSite::default() };
        let question = AnalysisInput { params: &params[0], site: Some(&site), captures: &captures, earlier: &[] };
        let id = ItemId::GnssAccuracy;
        let findings = analyse(id, &question).unwrap_or_else(|error| panic!("{id}: {error}"));
        let put = |name: &str, truth: f64| Found::new(id.as_str(), &findings, name, truth);
        let mut found = vec![
            put("position_horizontal", DEVIATION_M[0].hypot(DEVIATION_M[1])),
            put("position_height", DEVIATION_M[2]),
            put("velocity_horizontal", SPEED_MPS * 2.0_f64.sqrt()),
            put("pps_jitter", EDGE_NS * 2.0_f64.sqrt()),
            put("board_clock_error", clock_ppm),
        ];
        // In a later item the crystal has drifted by up to 5 ppm.
        let drifted_ppm = clock_ppm + 5.0 * (2.0 * errors.even() - 1.0);
        let earlier = [("gnss-accuracy".to_owned(), findings.clone())];
        let value = clock::sample_rate_error(&earlier, std::iter::empty::<&HostView>(), 0.95);
        let behind = Findings { measured: vec![("sample_rate_error", value)], ..Findings::default() };
        let behind = Found::new("each item behind it", &behind, "sample_rate_error", drifted_ppm);
        found.push(behind.with_share("what the crystal drifts since", 1.0));
        found
    })
}

#[cfg(test)]
#[test]
fn intervals_of_the_receiver_hold_the_truth_as_often_as_they_say() {
    const SEED: u64 = 82;
    super::coverage::check(&run(10, SEED), SEED);
}
