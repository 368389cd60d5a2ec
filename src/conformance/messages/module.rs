//! Messages that the module answers.

use std::time::Duration;

use gnc_protocol::Call as _;
use gnc_protocol::calibration::{CalibrationCommit, CalibrationRead, CalibrationWrite};
use gnc_protocol::frame::checksum;
use gnc_protocol::message::{
    AdRead, CanCounters, CpuFloats, CpuIntegers, CpuWords, ErrorRecords, GnssRestart, Identity, IoTest, SciEcho,
    SpiTransfer, TimerMeasure, capability,
};
use gnc_protocol::wire::{List, Wire as _};

use crate::driver::{Driver, ms};
use crate::examples::{list, nominal_calibration};
use crate::stop::{Verdict, demand, failed, not_applicable};
use crate::streams::compensated;

/// Range of the AD converter in microvolts.
const AD_UV: std::ops::RangeInclusive<i32> = 0..=6_144_000;
/// Share by which an interval may be off: other units are a thousand times off, a crystal a ten-thousandth.
const TIMER_OFF: f64 = 0.01;
/// Bytes of an error record's kinds for lines, SPI and SCI.
const IO_MISMATCH: u16 = 5;

pub(super) async fn identity(driver: &mut Driver) -> Verdict {
    let first = driver.ask(&Identity {}).await?;
    let texts = [
        ("serial number", first.serial_number.as_str()),
        ("part number", first.part.as_str()),
        ("hardware", first.hardware.as_str()),
        ("firmware", first.firmware.as_str()),
    ];
    for (name, text) in texts {
        demand(!text.chars().any(char::is_control), || format!("the {name} holds control characters: {text:?}"))?;
    }
    let again = driver.ask(&Identity {}).await?;
    demand(again == first, || format!("serial number {}, then {}", first.serial_number, again.serial_number))?;
    Ok(format!("{}, {}, twice", first.serial_number, first.part))
}

pub(super) async fn cpu_words(driver: &mut Driver) -> Verdict {
    let words: [List<u32, 64>; 3] = [
        list([]),
        list([0, u32::MAX, 0x5555_5555, 0xAAAA_AAAA, 0x0102_0304]),
        list((0..64).map(|index| 0x9E37_79B9_u32.wrapping_mul(index + 1))),
    ];
    for core in [1, 2] {
        for target in [0, 1] {
            for words in &words {
                let came = driver.ask(&CpuWords { core, target, words: words.clone() }).await?.words;
                demand(came == *words, || {
                    let wrong = words.iter().zip(&came).filter(|(sent, came)| sent != came).count();
                    format!(
                        "core {core}, target {target}: {} of {} words came back, {wrong} of them wrong",
                        came.len(),
                        words.len()
                    )
                })?;
            }
        }
    }
    Ok("69 words four times".to_owned())
}

pub(super) async fn cpu_integers(driver: &mut Driver) -> Verdict {
    let pairs: [[i32; 2]; 10] = [
        [7, 2],
        [-7, 2],
        [7, -2],
        [-7, -2],
        [i32::MIN, -1],
        [i32::MAX, i32::MAX],
        [i32::MIN, i32::MIN],
        [0, -5],
        [123_456_789, 987_654],
        [65_536, 65_536],
    ];
    for core in [1, 2] {
        let none = driver.ask(&CpuIntegers { core, pairs: list([]) }).await?.results;
        demand(none.is_empty(), || format!("core {core}: {} results of no pair", none.len()))?;
        let results = driver.ask(&CpuIntegers { core, pairs: list(pairs) }).await?.results;
        demand(results.len() == pairs.len(), || format!("core {core}: {} results of {}", results.len(), pairs.len()))?;
        for ([a, b], came) in pairs.iter().zip(&results) {
            // In 64 bits nothing overflows; the low 32 bits of that are what the document demands.
            let (x, y) = (i64::from(*a), i64::from(*b));
            let expected = [x + y, x - y, x * y, x / y, x % y].map(|value| value as i32);
            demand(*came == expected, || format!("core {core}: {a} and {b} give {came:?} instead of {expected:?}"))?;
        }
    }
    Ok(format!("{} pairs on both cores", pairs.len()))
}

pub(super) async fn cpu_floats(driver: &mut Driver) -> Verdict {
    let tiny = f64::from_bits(1);
    let pairs: [[f64; 2]; 10] = [
        [1.0, 3.0],
        [0.1, 0.2],
        [f64::MAX, f64::MAX],
        [f64::MIN, f64::MAX],
        [f64::MIN_POSITIVE, 2.0],
        [tiny, 1.0],
        [1.0, tiny],
        [-0.0, 1.0],
        [1e308, -1e-308],
        [1.0 + f64::EPSILON, 1.0 - f64::EPSILON],
    ];
    for core in [1, 2] {
        let results = driver.ask(&CpuFloats { core, pairs: list(pairs) }).await?.results;
        demand(results.len() == pairs.len(), || format!("core {core}: {} results of {}", results.len(), pairs.len()))?;
        for ([a, b], came) in pairs.iter().zip(&results) {
            let expected = [a + b, a - b, a * b, a / b];
            demand(came.map(f64::to_bits) == expected.map(f64::to_bits), || {
                format!("core {core}: {a:e} and {b:e} give {came:?} instead of {expected:?}")
            })?;
        }
    }
    Ok(format!("{} pairs on both cores, bit by bit", pairs.len()))
}

pub(super) async fn timer(driver: &mut Driver) -> Verdict {
    let mut furthest: f64 = 0.0;
    for timer in 0..3 {
        for (period_us, count) in [(1000, 100), (100, 1), (100_000, 2)] {
            let answer = driver.call(&TimerMeasure { timer, period_us, count }).await?;
            let reply = answer.reply::<TimerMeasure>()?;
            demand(usize::from(reply.interrupts) == reply.intervals_ns.len(), || {
                format!("timer {timer}: {} interrupts, {} intervals", reply.interrupts, reply.intervals_ns.len())
            })?;
            demand(reply.interrupts == count, || format!("timer {timer}: {} interrupts of {count}", reply.interrupts))?;
            for interval_ns in &reply.intervals_ns {
                let off = f64::from(*interval_ns) / (f64::from(period_us) * 1e3) - 1.0;
                demand(off.abs() <= TIMER_OFF, || {
                    format!("timer {timer}: an interval of {interval_ns} ns for {period_us} us")
                })?;
                furthest = furthest.max(off.abs());
            }
            let sum = Duration::from_nanos(reply.intervals_ns.iter().map(|interval| u64::from(*interval)).sum());
            let elapsed = Duration::from_micros(answer.elapsed_us().into());
            demand(sum.mul_f64(1.0 - TIMER_OFF) <= elapsed, || {
                format!("timer {timer}: intervals of {} in an elapsed_us of {}", ms(sum), ms(elapsed))
            })?;
        }
    }
    Ok(format!("3 timers, at most {:.1} ppm off", furthest * 1e6))
}

pub(super) async fn ad_channels(driver: &mut Driver) -> Verdict {
    for (channels, expected) in [(0x84, &[3, 8][..]), (0x01, &[1]), (0xFF, &[1, 2, 3, 4, 5, 6, 7, 8])] {
        let reply = driver.ask(&AdRead { channels, samples: 10 }).await?;
        let came: Vec<u8> = reply.channels.iter().map(|channel| channel.channel).collect();
        demand(came == expected, || format!("channels 0x{channels:02X} give {came:?} instead of {expected:?}"))?;
    }
    Ok("0x84, 0x01 and 0xFF".to_owned())
}

pub(super) async fn ad(driver: &mut Driver) -> Verdict {
    for samples in [1, 1000] {
        let reply = driver.ask(&AdRead { channels: 0xFF, samples }).await?;
        for channel in &reply.channels {
            let (min, mean, max) = (channel.min_uv, channel.mean_uv, channel.max_uv);
            demand(min <= mean && mean <= max, || {
                format!("channel {}: mean {mean} uV, min {min} uV, max {max} uV", channel.channel)
            })?;
            demand(AD_UV.contains(&min) && AD_UV.contains(&max), || {
                format!("channel {}: {min} to {max} uV", channel.channel)
            })?;
            demand(samples > 1 || min == max, || {
                format!("channel {}: one sample is {min} to {max} uV", channel.channel)
            })?;
        }
    }
    Ok("8 channels".to_owned())
}

pub(super) async fn io(driver: &mut Driver) -> Verdict {
    let (mut right, mut wrong) = (0, 0);
    for driven in 0..4 {
        for reader in (0..4).filter(|reader| *reader != driven) {
            for level in [0, 1] {
                let levels = driver.ask(&IoTest { driver: driven, reader, level }).await?.levels;
                demand(levels <= 0x0F, || format!("levels 0x{levels:02X}: there are four lines"))?;
                let pair = 1 << driven | 1 << reader;
                let expected = if level == 1 { pair } else { 0x0F & !pair };
                if levels == expected { right += 1 } else { wrong += 1 }
            }
        }
    }
    // A line that does not follow is the module's or the board's fault; the document demands a record of it.
    if wrong > 0 {
        let total = driver.ask(&ErrorRecords { from: 0 }).await?;
        let noted = total.records.iter().any(|record| record.kind == IO_MISMATCH);
        demand(noted, || format!("{wrong} levels of {} are not right, and no error record of kind 5", right + wrong))?;
    }
    Ok(format!("{right} of {} levels are right", right + wrong))
}

pub(super) async fn spi(driver: &mut Driver) -> Verdict {
    for direction in [0, 1] {
        for (clock_hz, count) in [(10_000, 2), (1_000_000, 256), (10_000_000, 0)] {
            let data: List<u8, 256> = list((0..count).map(|index| (index * 7 + 1) as u8));
            let came = driver.ask(&SpiTransfer { direction, clock_hz, data: data.clone() }).await?.data;
            demand(came == data, || {
                let wrong = data.iter().zip(&came).filter(|(sent, came)| sent != came).count();
                format!(
                    "direction {direction} at {clock_hz} Hz: {} of {count} bytes, {wrong} of them wrong",
                    came.len()
                )
            })?;
        }
    }
    Ok("2, 256 and no bytes in both directions".to_owned())
}

pub(super) async fn sci(driver: &mut Driver) -> Verdict {
    for (rate_baud, count) in [(9600, 2), (115_200, 256), (921_600, 0)] {
        let data: List<u8, 256> = list((0..count).map(|index| (index * 5 + 3) as u8));
        let came = driver.ask(&SciEcho { rate_baud, data: data.clone() }).await?;
        let errors = (came.framing_errors, came.parity_errors, came.overruns);
        demand(errors == (0, 0, 0), || format!("{rate_baud} baud: errors {errors:?}"))?;
        demand(came.data == data, || {
            format!("{rate_baud} baud: {} of {count} bytes came back, or others", came.data.len())
        })?;
    }
    Ok("2, 256 and no bytes".to_owned())
}

pub(super) async fn gnss_restart(driver: &mut Driver) -> Verdict {
    let answer = driver.call(&GnssRestart { start: 1 }).await?;
    if answer.nak() == Some(9) {
        return not_applicable("NAK 9: the socket has no receiver");
    }
    let bytes = answer.body()?.len();
    demand(bytes == 0, || format!("a body of {bytes} bytes"))?;
    Ok("hot, done".to_owned())
}

pub(super) async fn can_counters(driver: &mut Driver) -> Verdict {
    let answer = driver.call(&CanCounters {}).await?;
    if answer.nak() == Some(9) {
        demand(!driver.can_do(capability::CAN), || "NAK 9 on a board with capability bit 1".to_owned())?;
        return not_applicable("NAK 9: no CAN");
    }
    let reply = answer.reply::<CanCounters>()?;
    demand(reply.state <= 2, || format!("state {}", reply.state))?;
    demand(reply.echoed <= reply.received, || format!("{} received, {} sent back", reply.received, reply.echoed))?;
    Ok(format!("state {}, {} received, {} sent back", reply.state, reply.received, reply.echoed))
}

pub(super) async fn calibration_read(driver: &mut Driver) -> Verdict {
    driver.needs(capability::CALIBRATION)?;
    let reply = driver.ask(&CalibrationRead {}).await?;
    let (state, count) = (reply.state, reply.calibration.len());
    demand(state <= 2, || format!("state {state}"))?;
    demand((state == 0) == (count == 0), || format!("state {state} with {count} calibrations"))?;
    if state == 0 {
        let zeros = (reply.counter, reply.checksum);
        demand(zeros == (0, 0), || format!("state 0 with counter {} and checksum 0x{:08X}", zeros.0, zeros.1))?;
        return Ok("state 0: none was ever stored".to_owned());
    }
    let Some(bytes) = reply.calibration.first().and_then(|calibration| calibration.to_payload().ok()) else {
        return failed("the calibration does not read");
    };
    let good = checksum(&bytes) == reply.checksum;
    demand(good == (state == 1), || format!("state {state}, and the checksum of the 300 bytes is good: {good}"))?;
    Ok(format!("state {state}, counter {}", reply.counter))
}

pub(super) async fn calibration_unwritten(driver: &mut Driver) -> Verdict {
    driver.needs(capability::CALIBRATION)?;
    // Power-on forgets what was written; checks before this one had their writes refused.
    driver.open().await?;
    driver.power_on().await?;
    let asked = driver.post(&CalibrationCommit { checksum: 0x1234_5678 });
    driver.refused(&asked, 4, "without a write since power-on").await?;
    Ok(format!("NAK 4 to {}", CalibrationCommit::NAME))
}

pub(super) async fn calibration_commit(driver: &mut Driver) -> Verdict {
    driver.needs(capability::CALIBRATION)?;
    if !driver.may_change_module() {
        return not_applicable("not tried: it changes the module");
    }
    let calibration = nominal_calibration();
    let bytes = calibration.to_payload().unwrap_or_default();
    let sum = checksum(&bytes);
    let before = driver.ask(&CalibrationRead {}).await?;
    driver.ask(&CalibrationWrite { calibration: calibration.clone() }).await?;
    let other = driver.post(&CalibrationCommit { checksum: sum ^ 1 });
    driver.refused(&other, 4, "with another checksum").await?;
    let unchanged = driver.ask(&CalibrationRead {}).await?;
    demand(unchanged == before, || "a write without a commit changed what is in force".to_owned())?;
    let counter = driver.ask(&CalibrationCommit { checksum: sum }).await?.counter;
    demand(counter == before.counter + 1, || format!("counter {counter} after {}", before.counter))?;
    for when in ["after the commit", "after a power cycle"] {
        let read = driver.ask(&CalibrationRead {}).await?;
        let same = read.calibration.first().and_then(|read| read.to_payload().ok()) == Some(bytes.clone());
        demand((read.state, read.counter, read.checksum) == (1, counter, sum) && same, || {
            format!(
                "{when}: state {}, counter {}, checksum 0x{:08X}, the 300 bytes are the same: {same}",
                read.state, read.counter, read.checksum
            )
        })?;
        driver.open().await?;
        driver.power_on().await?;
    }
    Ok(format!("counter {counter}, the same 300 bytes after a power cycle"))
}

pub(super) async fn calibration_stream(driver: &mut Driver) -> Verdict {
    driver.needs(capability::CALIBRATION)?;
    if !driver.may_change_module() {
        return not_applicable("not tried: nothing was committed to this module");
    }
    compensated(driver).await
}
