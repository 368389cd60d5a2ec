//! The calibration in the module and the samples compensated by it, against frames computed without this code.

use gnc_protocol::calibration::{
    Calibration, CalibrationCommit, CalibrationRead, CalibrationState, CalibrationWrite, CompensatedSample,
};
use gnc_protocol::message::{ErrorRecords, FlashErase, MakeSafe, ModulePower, StreamStart, StreamStop};
use gnc_protocol::stream::{ImuSample, StreamFrame};
use gnc_protocol::wire::Wire;
use hw_mocks::Speed;
use hw_mocks::devices::calibration::{CalibrationFaults, CalibrationMemory};

use crate::host::{Host, options};

/// The payload of a vector.
fn payload(file: &str, name: &str) -> Vec<u8> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/vectors").join(file);
    let all = std::fs::read_to_string(path).unwrap();
    let block = all.split(&format!("\nvector: {name}\n")).nth(1).unwrap();
    let digits = block.lines().find_map(|line| line.strip_prefix("  payload: ")).unwrap();
    (0..digits.len()).step_by(2).map(|at| u8::from_str_radix(&digits[at..at + 2], 16).unwrap()).collect()
}

fn calibration() -> Calibration {
    Calibration::from_payload(&payload("v1-calls-calibration.txt", "CalibrationWrite.request")).unwrap()
}

fn samples<S: Wire>(frame: &StreamFrame) -> Vec<S> {
    let size = frame.samples.len() / usize::from(frame.head.count);
    frame.samples.chunks(size).map(|bytes| S::from_payload(bytes).unwrap()).collect()
}

/// Another calibration with different numbers of the same form.
fn another() -> Calibration {
    Calibration { id: 7002, accel_offset: [1.0, 2.0, 3.0], ..calibration() }
}

fn store(host: &mut Host, calibration: &Calibration) -> u32 {
    host.ask(&CalibrationWrite { calibration: calibration.clone() });
    host.ask(&CalibrationCommit { checksum: calibration.checksum() }).counter
}

/// State, counter and coefficients as the host reads them.
fn stored(host: &mut Host) -> (u8, u32, Option<Calibration>) {
    let reply = host.ask(&CalibrationRead {});
    let first = reply.calibration.first().cloned();
    if reply.state == CalibrationState::Valid as u8 {
        assert_eq!(first.as_ref().map(Calibration::checksum), Some(reply.checksum));
    }
    (reply.state, reply.counter, first)
}

fn power_cycle(host: &mut Host) {
    host.ask(&ModulePower { on: 0 });
    host.ask(&ModulePower { on: 1 });
}

const NONE: u8 = CalibrationState::None as u8;
const VALID: u8 = CalibrationState::Valid as u8;
const DAMAGED: u8 = CalibrationState::Damaged as u8;

#[test]
fn compensation_gives_the_worked_samples() {
    let read = |name| StreamFrame::from_payload(&payload("v1-streams-compensated.txt", name)).unwrap();
    let mut memory = CalibrationMemory::new(CalibrationFaults::default());
    memory.write(calibration());
    memory.commit();
    let compensation = memory.compensation().unwrap();
    let raw: Vec<ImuSample> = samples(&read("raw"));
    let expected: Vec<CompensatedSample> = samples(&read("compensated"));
    assert_eq!(raw.iter().map(|raw| compensation.apply(raw)).collect::<Vec<_>>(), expected);
}

#[test]
fn a_calibration_is_written_committed_read_and_survives_power_cycles() {
    let mut host = Host::powered("good");
    assert_eq!(stored(&mut host), (NONE, 0, None));
    assert_eq!(host.refusal(&CalibrationCommit { checksum: 0 }).0, 4, "nothing was written");
    host.ask(&CalibrationWrite { calibration: calibration() });
    assert_eq!(stored(&mut host), (NONE, 0, None), "a write changes nothing");
    let (code, text) = host.refusal(&CalibrationCommit { checksum: 1 });
    assert_eq!((code, text.contains("00000001")), (4, true), "{text}");
    let (elapsed_us, reply) = host.timed(&CalibrationCommit { checksum: calibration().checksum() });
    assert_eq!((reply.counter, reply.duration_us), (1, elapsed_us));
    assert!((100_000..150_000).contains(&elapsed_us), "{elapsed_us}");
    assert_eq!(stored(&mut host), (VALID, 1, Some(calibration())));
    power_cycle(&mut host);
    assert_eq!(stored(&mut host), (VALID, 1, Some(calibration())));
    assert_eq!(host.refusal(&CalibrationCommit { checksum: calibration().checksum() }).0, 4, "gone with the power");
    assert_eq!(store(&mut host, &another()), 2);
    assert_eq!(stored(&mut host), (VALID, 2, Some(another())));
    let spoilt = Calibration { mag_ky: f64::NAN, ..another() };
    assert_eq!(host.refusal(&CalibrationWrite { calibration: spoilt }).1, "mag_ky is outside its range");
    host.ask(&ModulePower { on: 0 });
    assert_eq!(host.refusal(&CalibrationRead {}).0, 6);
}

/// At every moment of a cut-off commit the earlier calibration stays in force, and the next commit succeeds.
#[test]
fn a_commit_that_is_cut_off_leaves_the_old_one() {
    for (first, expected) in [(None, DAMAGED), (Some(calibration()), VALID)] {
        let mut host = Host::with(&options("good", Speed::Times(1.0)));
        host.ask(&ModulePower { on: 1 });
        let commits = first.as_ref().map_or(0, |first| store(&mut host, first));
        host.ask(&CalibrationWrite { calibration: another() });
        let request = host.post(&CalibrationCommit { checksum: another().checksum() });
        host.run_until(|frame| frame.header.request == request && frame.header.kind == gnc_protocol::Kind::Accept);
        host.ask(&MakeSafe {});
        host.ask(&ModulePower { on: 1 });
        let (state, counter, read) = stored(&mut host);
        assert_eq!(state, expected);
        if first.is_some() {
            assert_eq!((counter, read), (commits, first));
        }
        let records = host.ask(&ErrorRecords { from: 0 }).records;
        assert!(records.iter().any(|record| record.kind == 10), "{records:?}");
        assert_eq!(store(&mut host, &another()), commits + 2);
        assert_eq!(stored(&mut host).2, Some(another()));
    }
}

/// Flash and calibration share the part: an erase in a scratch sector delays the calibration and does not change it.
#[test]
fn it_shares_the_internal_flash() {
    let mut host = Host::powered("good");
    store(&mut host, &calibration());
    let erase = host.post(&FlashErase { flash: 1, sector: 0 });
    let read = host.post(&CalibrationRead {});
    assert_eq!(host.wait(read).unwrap_err().code, 5);
    host.wait(erase).unwrap();
    assert_eq!(stored(&mut host), (VALID, 1, Some(calibration())));
}

fn compensated(host: &mut Host, rate_hz: u16, count: u32) -> Vec<CompensatedSample> {
    host.frames.clear();
    let start = host.ask(&StreamStart { stream: 4, rate_hz, count, samples_per_frame: 0 });
    assert_eq!((start.format, start.samples_per_frame), (4, (rate_hz / 20).clamp(1, 10) as u8));
    let all = loop {
        // Some samples may have come with the answer.
        let all: Vec<CompensatedSample> = host.streamed(4).iter().flat_map(samples).collect();
        if all.len() >= count as usize {
            break all;
        }
        host.run_until(|frame| frame.header.kind == gnc_protocol::Kind::Stream);
    };
    assert_eq!(host.ask(&StreamStop { stream: 4 }).produced, count);
    all
}

fn mean(samples: &[CompensatedSample], pick: impl Fn(&CompensatedSample) -> i32) -> f64 {
    samples.iter().map(|sample| f64::from(pick(sample))).sum::<f64>() / samples.len() as f64
}

/// With the true coefficients of the module the stream reads the true rate, force and field.
#[test]
fn a_module_with_the_true_calibration_reads_the_truth() {
    let mut host = Host::powered("good");
    assert_eq!(host.refusal(&StreamStart { stream: 4, rate_hz: 200, ..StreamStart::default() }).0, 10);
    let models = host.bench.truth().sensors;
    // deg/s and g in SI units, worked out by hand; inverse of the response.
    let rate = std::f64::consts::PI / 180.0 / 20_000.0;
    let force = 9.80665 / 160_000.0;
    let inverse = |matrix: nalgebra::Matrix3<f64>| matrix.try_inverse().unwrap();
    let (ka, kg) = (inverse(models.accel.response), inverse(models.gyro.response));
    let rows = |matrix: nalgebra::Matrix3<f64>| [0, 1, 2].map(|row| [0, 1, 2].map(|column| matrix[(row, column)]));
    let truth = Calibration {
        id: 1,
        accel_matrix: rows(ka * force),
        accel_offset: (-(ka * models.accel.bias) * 9.80665).into(),
        gyro_matrix: rows(kg * rate),
        gyro_offset: (kg * models.gyro.bias * rate * 20_000.0).into(),
        gyro_per_force: rows(kg * models.gyro_per_g * (rate * 20_000.0 / 9.80665)),
        mag_ky: 1.0,
        ..Calibration::default()
    };
    store(&mut host, &truth);
    host.bench.set_heading_deg(40.0);
    let samples = compensated(&mut host, 200, 4000);
    let influence = host.bench.truth().influence;
    for axis in 0..3 {
        let rate_dph = mean(&samples, |s| s.rate[axis]) * 1e-8 * 180.0 / std::f64::consts::PI * 3600.0;
        let expected_dph = influence.rate_rps[axis].to_degrees() * 3600.0;
        // Warm-up from 25 deg down to room temperature, 0.0008 deg/s/K, and the slow bias.
        assert!((rate_dph - expected_dph).abs() < 35.0, "{axis}: {rate_dph} {expected_dph}");
        let force = mean(&samples, |s| s.force[axis]) * 1e-6;
        assert!((force - influence.force[axis]).abs() < 0.02, "{axis}: {force}");
    }
    let roll = mean(&samples, |s| s.roll) * 1e-8;
    let field = [0, 1].map(|axis| mean(&samples, |s| s.field[axis]) * 1e-7);
    assert!((roll - (-field[1]).atan2(field[0])).abs() < 1e-4);
    assert!(samples.iter().all(|sample| sample.saturated == 0));
}

/// The calibration is read when the stream starts. Two streams side by side have their own times and losses.
#[test]
fn a_running_stream_keeps_its_calibration() {
    let mut host = Host::powered("good");
    store(&mut host, &calibration());
    host.ask(&StreamStart { stream: 4, rate_hz: 100, count: 0, samples_per_frame: 5 });
    host.ask(&StreamStart { stream: 1, rate_hz: 100, count: 0, samples_per_frame: 5 });
    store(&mut host, &another());
    host.frames.clear();
    for _ in 0..10 {
        host.run_until(|frame| frame.header.kind == gnc_protocol::Kind::Stream && frame.header.message == 4);
    }
    let all: Vec<CompensatedSample> = host.streamed(4).iter().flat_map(samples).collect();
    assert!(mean(&all, |s| s.force[0]).abs() < 0.1e6, "the old one has no offset");
    assert!(host.streamed(1).len() >= 9);
    host.ask(&StreamStop { stream: 4 });
    let after = compensated(&mut host, 100, 100);
    assert!((mean(&after, |s| s.force[0]) - 1e6).abs() < 0.1e6);
}

#[test]
fn what_does_not_fit_is_refused_with_the_arithmetic() {
    let mut host = Host::powered("good");
    store(&mut host, &calibration());
    host.ask(&StreamStart { stream: 1, rate_hz: 1000, count: 0, samples_per_frame: 12 });
    let (code, text) = host.refusal(&StreamStart { stream: 4, rate_hz: 1000, count: 0, samples_per_frame: 10 });
    assert_eq!(code, 8);
    assert_eq!(text, "1000 Hz / 10 per frame * 496 B * 10 bit / 921600 baud = 538 permille, others 467; at most 900");
    assert_eq!(host.refusal(&StreamStart { stream: 4, rate_hz: 200, count: 0, samples_per_frame: 11 }).0, 4);
}

#[test]
fn a_lost_bit_is_found_at_once_or_after_a_power_cycle() {
    let at_once = "[calibration]\nlost_bit = { byte = 100, bit = 3 }\n";
    let later = "[calibration]\nlost_bit = { byte = 100, bit = 3, after_power_cycle = true }\n";
    for (text, before) in [(at_once, DAMAGED), (later, VALID)] {
        let mut host = Host::powered(text);
        store(&mut host, &calibration());
        assert_eq!(stored(&mut host).0, before);
        power_cycle(&mut host);
        let (state, counter, read) = stored(&mut host);
        assert_eq!((state, counter), (DAMAGED, 1));
        // Byte 100 is the first of Kg.
        assert_ne!(read.unwrap().gyro_matrix[0][0].to_bits(), calibration().gyro_matrix[0][0].to_bits());
        assert_eq!(host.refusal(&StreamStart { stream: 4, rate_hz: 200, ..StreamStart::default() }).0, 10);
    }
}

/// The firmware's mistake does not change the stored calibration, and shows only in the off-diagonal elements.
#[test]
fn a_transposing_firmware_stores_well_and_computes_badly() {
    let mut skewed = calibration();
    skewed.accel_matrix[0][2] = 1e-5;
    let force_x = |text: &str| {
        let mut host = Host::powered(text);
        store(&mut host, &skewed);
        assert_eq!(stored(&mut host).2, Some(skewed.clone()));
        mean(&compensated(&mut host, 200, 200), |s| s.force[0]) * 1e-6
    };
    let (good, bad) = (force_x(""), force_x("[calibration]\ntransposed = true\n"));
    // One g on Z is 160,000 counts: 1.6 m/s^2 on X; the transposed matrix gives nearly zero there.
    assert!((good - 1.6).abs() < 0.1 && bad.abs() < 0.1, "{good} {bad}");
}
