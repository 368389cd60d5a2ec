//! `gnc.ImuSample`, `gnc.GnssBytes` and `gnc.PpsEdge`.

use gnc_protocol::stream::ImuSample;

use super::proto::{Fields, Value, next};

/// A sample of the IMU with its place in the capture.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Numbered {
    pub(super) number: u32,
    pub(super) board_time_us: u64,
    pub(super) sample: ImuSample,
}

impl Numbered {
    pub(super) fn put(&self, out: &mut Vec<u8>) {
        let ImuSample { gyro, accel, mag, gyro_temperature, accel_temperature } = self.sample;
        let mut fields = Fields(out);
        fields.unsigned(1, self.number.into()).unsigned(2, self.board_time_us);
        for (field, value) in (3..).zip(gyro.into_iter().chain(accel).chain(mag)) {
            fields.signed(field, value);
        }
        fields.signed(12, gyro_temperature.into()).signed(13, accel_temperature.into());
    }

    /// `None` if it is no such message.
    pub(super) fn get(mut rest: &[u8]) -> Option<Self> {
        let mut found = Self::default();
        while let Some((field, value)) = next(&mut rest)? {
            let sample = &mut found.sample;
            match field {
                1 => found.number = value.narrow()?,
                2 => found.board_time_us = value.unsigned()?,
                3..=5 => sample.gyro[field as usize - 3] = value.signed()?,
                6..=8 => sample.accel[field as usize - 6] = value.signed()?,
                9..=11 => sample.mag[field as usize - 9] = value.signed()?,
                12 => sample.gyro_temperature = narrow(value)?,
                13 => sample.accel_temperature = narrow(value)?,
                _ => {}
            }
        }
        Some(found)
    }
}

fn narrow(value: Value<'_>) -> Option<i16> {
    i16::try_from(value.signed()?).ok()
}

/// `gnc.GnssBytes`.
pub(super) fn put_bytes(out: &mut Vec<u8>, board_time_us: u64, bytes: &[u8]) {
    Fields(out).unsigned(1, board_time_us).bytes(2, bytes);
}

/// Board time in microseconds, and the bytes.
pub(super) fn get_bytes(mut rest: &[u8]) -> Option<(u64, &[u8])> {
    let mut found: (u64, &[u8]) = (0, &[]);
    while let Some((field, value)) = next(&mut rest)? {
        match field {
            1 => found.0 = value.unsigned()?,
            2 => found.1 = value.bytes()?,
            _ => {}
        }
    }
    Some(found)
}

/// `gnc.PpsEdge`.
pub(super) fn put_edge(out: &mut Vec<u8>, board_time_ns: u64) {
    Fields(out).unsigned(1, board_time_ns);
}

/// Board time in nanoseconds.
pub(super) fn get_edge(mut rest: &[u8]) -> Option<u64> {
    let mut board_time_ns = 0;
    while let Some((field, value)) = next(&mut rest)? {
        if field == 1 {
            board_time_ns = value.unsigned()?;
        }
    }
    Some(board_time_ns)
}
