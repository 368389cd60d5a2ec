//! Bad samples in captures: the items measure them, replace them below a named share, and refuse them above it with the
//! shares.

use gnc_protocol::stream::{ImuSample, SATURATION};

use super::calibrating::SIX;
use super::world::World;
use super::*;

/// Spoils one sample in `every` of each capture.
fn spoil(captures: &[Capture], every: usize, with: impl Fn(&mut ImuSample)) -> Vec<Capture> {
    let mut captures = captures.to_vec();
    for capture in &mut captures {
        capture.samples.iter_mut().skip(every / 2).step_by(every).for_each(&with);
    }
    captures
}

fn share(measured: &[(&'static str, Value)], name: &str) -> f64 {
    match measured.iter().find(|(measured, _)| *measured == name) {
        Some((_, Value::Number(quantity))) => quantity.number,
        other => panic!("{name} is {other:?}"),
    }
}

#[test]
fn a_failed_read_shifts_no_figure_and_is_measured() {
    let good = World::new(31).six("", 1, 60.0, 20);
    let clean = ask(ItemId::SixPosition, SIX, &good, &[]).unwrap();
    assert!(INTEGRITY.iter().all(|name| share(&clean.measured, name) == 0.0));
    type Read = fn(&mut ImuSample);
    let reads: [(&str, Read); 4] = [
        ("failed_reads", |sample| sample.accel = [0; 3]),
        ("failed_reads", |sample| sample.accel = [-1; 3]),
        ("failed_reads", |sample| sample.accel = [8_388_607; 3]),
        ("spikes", |sample| sample.accel[1] += 300_000),
    ];
    for (name, read) in reads {
        let spoilt = ask(ItemId::SixPosition, SIX, &spoil(&good, 200, read), &[]).unwrap();
        assert!((share(&spoilt.measured, name) - 0.5).abs() < 1e-9, "{name}");
        assert_eq!(spoilt.details["gate"]["first"]["sample"], 101, "{name}");
        for axis in ["x", "y", "z"] {
            let [(clean, ..), (spoilt, ..)] = [&clean, &spoilt].map(|found| figure(found, &format!("bias_{axis}")));
            assert!((clean - spoilt).abs() < 0.002, "{name}: bias_{axis} {clean} mg, {spoilt} mg");
        }
        // With every tenth sample bad there is no figure, and the share is there to be judged.
        let many = spoil(&good, 10, read);
        let question = params(ItemId::SixPosition, SIX);
        let site = site();
        let question = AnalysisInput { params: &question, site: Some(&site), captures: &many, earlier: &[] };
        let refused = analyse(ItemId::SixPosition, &question).unwrap_err();
        assert!(refused.to_string().starts_with("x+, accel: "), "{refused}");
        assert!(refused.to_string().contains("(10.00 %), first in row 6"), "{refused}");
        assert!((share(&integrity(ItemId::SixPosition, &question), name) - 10.0).abs() < 1e-9, "{name}");
    }
}

#[test]
fn samples_that_repeat_are_stale_and_those_of_an_unused_chip_are_not_looked_at() {
    let mut captures = World::new(32).six("", 1, 60.0, 20);
    for capture in &mut captures {
        for row in (1..capture.samples.len()).step_by(2) {
            capture.samples[row].accel = capture.samples[row - 1].accel;
        }
    }
    let question = params(ItemId::SixPosition, SIX);
    let question = AnalysisInput { params: &question, site: None, captures: &captures, earlier: &[] };
    let measured = integrity(ItemId::SixPosition, &question);
    assert!((share(&measured, "stale_samples") - 50.0).abs() < 1e-9);
    assert!(analyse(ItemId::SixPosition, &question).unwrap_err().to_string().contains("repeat the row before"));
    assert_eq!(share(&integrity(ItemId::GyroStill, &question), "stale_samples"), 0.0);
}

/// Samples at rest, as the item imu has them.
#[test]
fn samples_at_rest_are_taken_without_the_bad_ones() {
    let good = World::new(33).six("", 1, 60.0, 20).remove(4).samples;
    assert_eq!(sound_at_rest(&good), (good.clone(), [0.0; 3]));
    let mut spoilt = good.clone();
    spoilt.iter_mut().step_by(100).for_each(|sample| sample.gyro = [0; 3]);
    let (sound, [failed, stale, spikes]) = sound_at_rest(&spoilt);
    assert_eq!((sound.len(), failed, stale, spikes), (1188, 1.0, 0.0, 0.0));
}

/// The magnetometer's bad samples count, and take nothing from the other sensors. Without a magnetometer, nothing
/// counts.
#[test]
fn samples_at_rest_tell_of_the_magnetometer_too() {
    let mut samples = World::new(33).six("", 1, 60.0, 20).remove(4).samples;
    samples.iter_mut().for_each(|sample| sample.mag = [0; 3]);
    assert_eq!(sound_at_rest(&samples), (samples.clone(), [0.0; 3]), "no magnetometer");
    // A field of half a gauss in noise of a milligauss, from the residues of a Lehmer generator.
    let mut state = 33_u64;
    let mut drawn = || {
        state = state * 48_271 % 2_147_483_647;
        (0..12).map(|k| (state >> k) % 1000).sum::<u64>() as i32 - 6000
    };
    samples.iter_mut().for_each(|sample| sample.mag = [400_000 + drawn(), -300_000 + drawn(), 370_000 + drawn()]);
    assert_eq!(sound_at_rest(&samples), (samples.clone(), [0.0; 3]));
    samples.iter_mut().skip(7).step_by(50).for_each(|sample| sample.mag = [SATURATION; 3]);
    samples.iter_mut().skip(19).step_by(100).for_each(|sample| sample.mag[1] += 200_000);
    assert_eq!(sound_at_rest(&samples), (samples.clone(), [2.0, 0.0, 1.0]));
}
