//! Fields outside their ranges.

use gnc_protocol::Call;
use gnc_protocol::calibration::{Calibration, CalibrationWrite};
use gnc_protocol::message::{
    AdRead, CpuFloats, CpuIntegers, CpuWords, FlashBlankCheck, FlashErase, FlashId, FlashVerify, FlashWrite,
    GnssRestart, IoTest, ModulePower, RamTest, SciEcho, SpiTransfer, StreamStart, StreamStop, TimerMeasure, capability,
};

use crate::driver::{Driver, name_of};
use crate::examples::{list, nominal_calibration};
use crate::stop::{Stop, Verdict, failed};

/// A request with one field outside its range: message, payload, and the field in words.
type Bad = (u16, Vec<u8>, String);

fn bad<C: Call>(call: &C, field: impl Into<String>) -> Bad {
    (C::ID, call.to_payload().unwrap_or_default().to_vec(), field.into())
}

/// Ends the check as failed unless all are refused by NAK 4; all that are not are named at once.
async fn all_refused(driver: &mut Driver, all: Vec<Bad>) -> Verdict {
    let (count, mut wrong) = (all.len(), Vec::new());
    for (message, payload, field) in all {
        let asked = driver.post_raw(message, &payload);
        let answer = driver.end_of(&asked).await?;
        if !matches!(answer.nak(), Some(4 | 9)) {
            wrong.push(format!("{} with {field}: {}", name_of(message), answer.words()));
        }
    }
    if wrong.is_empty() { Ok(format!("{count} fields got NAK 4")) } else { failed(wrong.join("; ")) }
}

pub(super) async fn ranges(driver: &mut Driver) -> Verdict {
    let mut all = Vec::new();
    if driver.can_do(capability::POWER) {
        all.push(bad(&ModulePower { on: 2 }, "on 2"));
    }
    for core in [0, 3] {
        let field = format!("core {core}");
        all.push(bad(&CpuWords { core, target: 0, words: list([1]) }, field.as_str()));
        all.push(bad(&CpuIntegers { core, pairs: list([[1, 1]]) }, field.as_str()));
        all.push(bad(&CpuFloats { core, pairs: list([[1.0, 1.0]]) }, field));
    }
    all.push(bad(&CpuWords { core: 1, target: 2, words: list([1]) }, "target 2"));
    all.push(bad(&CpuIntegers { core: 1, pairs: list([[1, 1], [1, 0]]) }, "b 0"));
    for (a, b, field) in [
        (1.0, 0.0, "b 0"),
        (1.0, -0.0, "b -0"),
        (f64::INFINITY, 1.0, "a infinite"),
        (1.0, f64::NEG_INFINITY, "b infinite"),
        (f64::NAN, 1.0, "a no number"),
        (1.0, f64::NAN, "b no number"),
    ] {
        all.push(bad(&CpuFloats { core: 1, pairs: list([[a, b]]) }, field));
    }
    for (timer, period_us, count, field) in [
        (3, 1000, 1, "timer 3"),
        (0, 99, 1, "period_us 99"),
        (0, 100_001, 1, "period_us 100001"),
        (0, 1000, 0, "count 0"),
        (0, 1000, 101, "count 101"),
    ] {
        all.push(bad(&TimerMeasure { timer, period_us, count }, field));
    }
    all.push(bad(&RamTest { ram: 2, pattern: 0 }, "ram 2"));
    all.push(bad(&RamTest { ram: 0, pattern: 5 }, "pattern 5"));
    flash(&mut all);
    all.push(bad(&AdRead { channels: 0, samples: 1 }, "channels 0"));
    all.push(bad(&AdRead { channels: 1, samples: 0 }, "samples 0"));
    all.push(bad(&AdRead { channels: 1, samples: 1001 }, "samples 1001"));
    for (driver, reader, level, field) in
        [(4, 0, 1, "driver 4"), (0, 4, 1, "reader 4"), (2, 2, 1, "reader and driver 2"), (0, 1, 2, "level 2")]
    {
        all.push(bad(&IoTest { driver, reader, level }, field));
    }
    for (direction, clock_hz, field) in
        [(2, 1_000_000, "direction 2"), (0, 9_999, "clock_hz 9999"), (1, 10_000_001, "clock_hz 10000001")]
    {
        all.push(bad(&SpiTransfer { direction, clock_hz, data: list([1]) }, field));
    }
    for rate_baud in [9_599, 2_000_001] {
        all.push(bad(&SciEcho { rate_baud, data: list([1]) }, format!("rate_baud {rate_baud}")));
    }
    for start in [0, 4] {
        all.push(bad(&GnssRestart { start }, format!("start {start}")));
    }
    all_refused(driver, all).await
}

fn flash(all: &mut Vec<Bad>) {
    let (flash, sector) = (2, 0);
    all.push(bad(&FlashId { flash }, "flash 2"));
    all.push(bad(&FlashErase { flash, sector }, "flash 2"));
    all.push(bad(&FlashBlankCheck { flash, sector }, "flash 2"));
    all.push(bad(&FlashWrite { flash, sector, seed: 1 }, "flash 2"));
    all.push(bad(&FlashVerify { flash, sector, seed: 1 }, "flash 2"));
    all.push(bad(&FlashWrite { flash: 0, sector, seed: 0 }, "seed 0"));
    all.push(bad(&FlashVerify { flash: 0, sector, seed: 0 }, "seed 0"));
}

pub(super) async fn ranges_stream(driver: &mut Driver) -> Verdict {
    let mut all = Vec::new();
    let most = if driver.is_can() { 2 } else { 13 };
    for (stream, rate_hz, samples_per_frame, field) in [
        (0, 100, 1, "stream 0"),
        (5, 100, 1, "stream 5"),
        (1, 0, 1, "rate_hz 0"),
        (1, 1001, 1, "rate_hz 1001"),
        (1, 10, most, "too many samples_per_frame"),
        (2, 1, 0, "rate_hz 1 of the GNSS stream"),
        (2, 0, 1, "samples_per_frame 1 of the GNSS stream"),
        (3, 1, 0, "rate_hz 1 of the 1PPS stream"),
        (3, 0, 1, "samples_per_frame 1 of the 1PPS stream"),
    ] {
        all.push(bad(&StreamStart { stream, rate_hz, count: 0, samples_per_frame }, field));
    }
    for stream in [0, 5] {
        all.push(bad(&StreamStop { stream }, format!("stream {stream}")));
    }
    all_refused(driver, all).await
}

pub(super) async fn ranges_calibration(driver: &mut Driver) -> Verdict {
    driver.needs(capability::CALIBRATION)?;
    // What is written here is gone with the power, and nothing is committed.
    let good = nominal_calibration();
    let with = |change: &dyn Fn(&mut Calibration)| {
        let mut calibration = good.clone();
        change(&mut calibration);
        CalibrationWrite { calibration }
    };
    let all = vec![
        bad(&with(&|c| c.id = 0), "id 0"),
        bad(&with(&|c| c.accel_matrix[2][1] = f64::NAN), "no number in Ka"),
        bad(&with(&|c| c.accel_offset[0] = f64::INFINITY), "an infinite nabla"),
        bad(&with(&|c| c.gyro_matrix[0][2] = f64::NAN), "no number in Kg"),
        bad(&with(&|c| c.gyro_offset[1] = f64::NAN), "no number in epsilon"),
        bad(&with(&|c| c.gyro_per_force[2][2] = f64::NEG_INFINITY), "an infinite Gamma"),
        bad(&with(&|c| c.mag_dx = f64::NAN), "no number in dX"),
        bad(&with(&|c| c.mag_dy = f64::NAN), "no number in dY"),
        bad(&with(&|c| c.mag_ky = 0.0), "Ky 0"),
        bad(&with(&|c| c.mag_ky = -1.0), "Ky -1"),
        bad(&with(&|c| c.mag_sin_alpha = 1.0), "sin(alpha) 1"),
        bad(&with(&|c| c.mag_sin_alpha = -1.0), "sin(alpha) -1"),
    ];
    match all_refused(driver, all).await {
        // The calibration before it stays in force: nothing was committed.
        Err(Stop::Failed(what)) => failed(what),
        other => other,
    }
}
