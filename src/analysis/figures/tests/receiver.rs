//! Satellite receiver: sentences made by hand.

use gnc_protocol::stream::Losses;

use super::sky::{Sky, sentence};
use super::*;

/// `epochs` epochs over the site's antenna. The board's clock is 8 ppm fast.
fn listened(epochs: usize, deviation_m: [f64; 3], memory: f64, seed: u64) -> Capture {
    let antenna = site().place.unwrap();
    Sky { antenna, epochs, deviation_m, memory, speed_mps: 0.05, edge_ns: 20.0, clock_ppm: 8.0 }.listened(seed)
}

#[test]
fn position_velocity_and_pulses() {
    let sky = [listened(1200, [2.0, 3.0, 5.0], 0.0, 41)];
    let found = ask(ItemId::GnssAccuracy, "", &sky, &[]).unwrap();
    complete(ItemId::GnssAccuracy, &params(ItemId::GnssAccuracy, ""), &found);
    let near = |name: &str, truth: f64, part: f64| {
        let (value, unit, known) = figure(&found, name);
        assert!(
            (value / truth - 1.0).abs() < part && known.low < value && known.high > value,
            "{name} {value} {unit} {known:?}"
        );
    };
    near("position_horizontal", 13.0_f64.sqrt(), 0.1);
    near("position_height", 5.0, 0.1);
    near("velocity_horizontal", 0.05 * 2.0_f64.sqrt(), 0.1);
    // Two edges of 20 ns, and two steps of 10 ns: sqrt(2 (400 + 8.3)).
    near("pps_jitter", 28.6, 0.1);
    assert!(matches!(value_of(&found, "pps_accuracy"), Some(Value::NotAvailable(why)) if why.contains("not measured")));
    assert!(matches!(value_of(&found, "velocity_height"), Some(Value::NotAvailable(_))));
    assert!(matches!(value_of(&found, "effective_epochs"), Some(Value::Number(count)) if count.number > 900.0));
}

/// Nine tenths of each error come from the epoch before, so an epoch counts as about a tenth in a deviation.
#[test]
fn correlated_epochs_count_as_what_they_are_worth() {
    let sky = [listened(1200, [2.0, 3.0, 5.0], 0.9, 42)];
    let found = ask(ItemId::GnssAccuracy, "", &sky, &[]).unwrap();
    let Some(Value::Number(worth)) = value_of(&found, "effective_epochs") else { panic!("no count") };
    // n (1 - rho^2) / (1 + rho^2) = 126.
    assert!((60.0..260.0).contains(&worth.number), "{worth}");
    let (value, _, known) = figure(&found, "position_horizontal");
    assert!(known.low < 13.0_f64.sqrt() && 13.0_f64.sqrt() < known.high, "{value} {known:?}");
    assert!((known.high - known.low) / value > 0.12, "{known:?}");
}

#[test]
fn losses_and_silence_are_refused() {
    let mut lost = listened(60, [1.0; 3], 0.0, 43);
    lost.losses = Losses { received: 60, on_board: 0, on_line: 3 };
    assert!(matches!(ask(ItemId::GnssAccuracy, "", &[lost], &[]), Err(FigureError::Lost { .. })));
    let few = listened(5, [1.0; 3], 0.0, 44);
    assert!(matches!(ask(ItemId::GnssAccuracy, "", &[few], &[]), Err(FigureError::FewEpochs { .. })));
}

/// A height above the ellipsoid needs the height of the geoid. For a height above the sea alone there is a reason in
/// place of a figure.
#[test]
fn without_geoid_separation_there_is_no_height() {
    let mut sky = listened(60, [1.0; 3], 0.0, 45);
    for said in &mut sky.receiver.said {
        let text = String::from_utf8(said.bytes.clone()).unwrap();
        let bodies = text.lines().map(|line| line[1..line.len() - 3].replace("M,-30.0,M", "M,,M"));
        said.bytes = bodies.map(|body| sentence(&body)).collect::<String>().into_bytes();
    }
    let found = ask(ItemId::GnssAccuracy, "", &[sky], &[]).unwrap();
    let why = match value_of(&found, "position_height") {
        Some(Value::NotAvailable(why)) => why.clone(),
        other => panic!("{other:?}"),
    };
    assert!(why.contains("no geoid separation"), "{why}");
    assert!(matches!(value_of(&found, "position_horizontal"), Some(Value::Estimate(..))));
}
