//! A payload that the document allows, for each message.

use gnc_protocol::Call;
use gnc_protocol::calibration::{Calibration, CalibrationCommit, CalibrationRead, CalibrationWrite};
use gnc_protocol::message::{
    Abort, AdRead, CanCounters, CpuFloats, CpuIntegers, CpuWords, ErrorRecords, FlashBlankCheck, FlashErase, FlashId,
    FlashVerify, FlashWrite, GnssRestart, Identity, IoTest, LinkCounters, MakeSafe, ModulePower, RamTest, SciEcho,
    SpiTransfer, StreamStart, StreamStop, TimerMeasure,
};
use gnc_protocol::wire::List;

/// A list with these elements, as many as fit.
pub(crate) fn list<T, const N: usize>(elements: impl IntoIterator<Item = T>) -> List<T, N> {
    elements.into_iter().take(N).collect()
}

/// Half a second of work that changes nothing and sends one PROGRESS.
pub(crate) fn slow() -> TimerMeasure {
    TimerMeasure { timer: 0, period_us: 100_000, count: 5 }
}

/// A calibration that any module takes: nominal scales, no errors. Checks write it to the board's memory at most.
pub(crate) fn nominal_calibration() -> Calibration {
    let diagonal = |value: f64| [[value, 0.0, 0.0], [0.0, value, 0.0], [0.0, 0.0, value]];
    Calibration {
        id: 1,
        accel_matrix: diagonal(9.80665 / 160_000.0),
        gyro_matrix: diagonal(1f64.to_radians() / 20_000.0),
        mag_ky: 1.0,
        ..Calibration::default()
    }
}

/// The payload of each message, by id, with values in their ranges.
pub(crate) fn examples() -> Vec<(u16, Vec<u8>)> {
    fn of<C: Call>(call: &C) -> (u16, Vec<u8>) {
        (C::ID, call.to_payload().unwrap_or_default().to_vec())
    }
    vec![
        of(&MakeSafe {}),
        of(&Abort { request: 0 }),
        of(&ModulePower { on: 1 }),
        of(&ErrorRecords { from: 0 }),
        of(&LinkCounters {}),
        of(&Identity {}),
        of(&CpuWords { core: 1, target: 0, words: list([1, 2]) }),
        of(&CpuIntegers { core: 1, pairs: list([[7, 2]]) }),
        of(&CpuFloats { core: 1, pairs: list([[7.0, 2.0]]) }),
        of(&slow()),
        of(&RamTest { ram: 0, pattern: 0 }),
        of(&FlashId { flash: 0 }),
        of(&FlashErase { flash: 0, sector: 0 }),
        of(&FlashBlankCheck { flash: 0, sector: 0 }),
        of(&FlashWrite { flash: 0, sector: 0, seed: 1 }),
        of(&FlashVerify { flash: 0, sector: 0, seed: 1 }),
        of(&AdRead { channels: 1, samples: 1 }),
        of(&IoTest { driver: 0, reader: 1, level: 1 }),
        of(&SpiTransfer { direction: 0, clock_hz: 1_000_000, data: list([1]) }),
        of(&SciEcho { rate_baud: 115_200, data: list([1]) }),
        of(&GnssRestart { start: 1 }),
        of(&StreamStart { stream: 1, rate_hz: 100, count: 0, samples_per_frame: 1 }),
        of(&StreamStop { stream: 1 }),
        of(&CanCounters {}),
        of(&CalibrationWrite { calibration: nominal_calibration() }),
        of(&CalibrationCommit { checksum: 0 }),
        of(&CalibrationRead {}),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_message_has_an_example() {
        let named: Vec<u16> = examples().iter().map(|(message, _)| *message).collect();
        let all: Vec<u16> = gnc_protocol::Request::IDS.iter().map(|(message, _)| *message).collect();
        assert_eq!(named, all);
    }
}
