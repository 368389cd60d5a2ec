//! Satellite receiver: sentences made by hand.

use super::world::{Dice, capture};
use super::*;
use crate::board::stream::Losses;
use crate::capture::{Pose, Said};

fn sentence(body: &str) -> String {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n")
}

fn degrees(value: f64, digits: usize) -> String {
    let whole = value.floor();
    format!("{:0digits$}{:010.7}", whole as u32, (value - whole) * 60.0)
}

/// Epochs with errors of position (m) and speed (m/s) whose neighbours share `memory` of them.
fn listened(n: usize, deviation: [f64; 3], memory: f64, seed: u64) -> Capture {
    let mut dice = Dice::new(seed);
    let place = site().place.unwrap();
    let mut error = deviation.map(|deviation| deviation * dice.normal());
    let mut said = Vec::new();
    let mut pulses_ns = Vec::new();
    for k in 0..n {
        for (error, deviation) in error.iter_mut().zip(deviation) {
            *error = memory * *error + (1.0 - memory * memory).sqrt() * deviation * dice.normal();
        }
        // Metres per degree at 34.2 deg and 412 m, from a table of the ellipsoid: 110,930 and 92,190.
        let latitude = degrees(place.latitude_deg + error[0] / 110_930.0, 2);
        let longitude = degrees(place.longitude_deg + error[1] / 92_190.0, 3);
        let time = format!("{:02}{:02}{:02}.00", k / 3600, k / 60 % 60, k % 60);
        let height = place.height_m + error[2] + 30.0;
        let knots = (0.05 * dice.normal()).hypot(0.05 * dice.normal()) * 3600.0 / 1852.0;
        let text = sentence(&format!("GPGGA,{time},{latitude},N,{longitude},E,1,09,0.9,{height:.3},M,-30.0,M,,"))
            + &sentence("GPGSA,A,3,01,02,03,04,05,06,07,08,09,,,,1.8,0.9,1.5")
            + &sentence(&format!("GPRMC,{time},A,{latitude},N,{longitude},E,{knots:.5},0.0,221126,,"));
        said.push(Said { board_time_us: k as u64 * 1_000_000, bytes: text.into_bytes() });
        // The board's clock is 8 ppm fast, the edges scatter by 20 ns and are seen in steps of 10 ns.
        let edge = k as f64 * 1_000_008_000.0 + 20.0 * dice.normal() + 1e6;
        pulses_ns.push((edge / 10.0).round() as u64 * 10);
    }
    let mut capture = capture("sky", 1, Pose::Still { up: [0.0, 0.0, 1.0], heading_deg: 0.0 }, 0, Vec::new());
    (capture.receiver.said, capture.receiver.pulses_ns) = (said, pulses_ns);
    capture
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
    assert!(matches!(found.value("pps_accuracy"), Some(Value::NotAvailable(why)) if why.contains("not measured")));
    assert!(matches!(found.value("velocity_height"), Some(Value::NotAvailable(_))));
    assert!(matches!(found.value("effective_epochs"), Some(Value::Number(count)) if count.number > 900.0));
}

/// With nine tenths of each error from the epoch before, an epoch is worth about a tenth in a deviation.
#[test]
fn correlated_epochs_count_as_what_they_are_worth() {
    let sky = [listened(1200, [2.0, 3.0, 5.0], 0.9, 42)];
    let found = ask(ItemId::GnssAccuracy, "", &sky, &[]).unwrap();
    let Some(Value::Number(worth)) = found.value("effective_epochs") else { panic!("no count") };
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

/// A height above the ellipsoid needs the geoid's; of one above the sea alone there is no figure but a reason.
#[test]
fn without_geoid_separation_there_is_no_height() {
    let mut sky = listened(60, [1.0; 3], 0.0, 45);
    for said in &mut sky.receiver.said {
        let text = String::from_utf8(said.bytes.clone()).unwrap();
        let bodies = text.lines().map(|line| line[1..line.len() - 3].replace("M,-30.0,M", "M,,M"));
        said.bytes = bodies.map(|body| sentence(&body)).collect::<String>().into_bytes();
    }
    let found = ask(ItemId::GnssAccuracy, "", &[sky], &[]).unwrap();
    let why = match found.value("position_height") {
        Some(Value::NotAvailable(why)) => why.clone(),
        other => panic!("{other:?}"),
    };
    assert!(why.contains("no geoid separation"), "{why}");
    assert!(matches!(found.value("position_horizontal"), Some(Value::Estimate(..))));
}
