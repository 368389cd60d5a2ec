//! `gnc.ImuSample`, `gnc.CompensatedSample`, `gnc.GnssBytes` and `gnc.PpsEdge`.

use gnc_protocol::calibration::CompensatedSample;
use gnc_protocol::stream::ImuSample;

use super::proto::{Fields, Value, next};

/// `gnc.ImuSample`. Its number and board time stand in the message header and are not repeated.
pub(super) fn put_sample(out: &mut Vec<u8>, sample: &ImuSample) {
    let mut fields = Fields(out);
    for (field, value) in (1..).zip(sample.gyro.iter().chain(&sample.accel).chain(&sample.mag)) {
        // Noise would fill two or three bytes of a varint; a fixed number of four bytes compresses better.
        fields.fixed(field, *value);
    }
    fields.signed(10, sample.gyro_temperature.into()).signed(11, sample.accel_temperature.into());
}

/// `None` if the bytes are not such a message.
pub(super) fn get_sample(mut rest: &[u8]) -> Option<ImuSample> {
    let mut sample = ImuSample::default();
    while let Some((field, value)) = next(&mut rest)? {
        match field {
            1..=3 => sample.gyro[field as usize - 1] = value.fixed()?,
            4..=6 => sample.accel[field as usize - 4] = value.fixed()?,
            7..=9 => sample.mag[field as usize - 7] = value.fixed()?,
            10 => sample.gyro_temperature = narrow(value)?,
            11 => sample.accel_temperature = narrow(value)?,
            _ => {}
        }
    }
    Some(sample)
}

/// `gnc.CompensatedSample`. Number and board time stand in the message header here too.
pub(super) fn put_compensated(out: &mut Vec<u8>, sample: &CompensatedSample) {
    let mut fields = Fields(out);
    for (field, value) in (1..).zip(sample.rate.iter().chain(&sample.force).chain(&sample.field)) {
        fields.fixed(field, *value);
    }
    fields.signed(10, sample.gyro_temperature.into()).signed(11, sample.accel_temperature.into());
    fields.fixed(12, sample.roll).unsigned(13, sample.saturated.into());
}

/// `None` if the bytes are not such a message.
pub(super) fn get_compensated(mut rest: &[u8]) -> Option<CompensatedSample> {
    let mut sample = CompensatedSample::default();
    while let Some((field, value)) = next(&mut rest)? {
        match field {
            1..=3 => sample.rate[field as usize - 1] = value.fixed()?,
            4..=6 => sample.force[field as usize - 4] = value.fixed()?,
            7..=9 => sample.field[field as usize - 7] = value.fixed()?,
            10 => sample.gyro_temperature = narrow(value)?,
            11 => sample.accel_temperature = narrow(value)?,
            12 => sample.roll = value.fixed()?,
            13 => sample.saturated = value.narrow()?,
            _ => {}
        }
    }
    Some(sample)
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
