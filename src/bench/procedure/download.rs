//! Writes the coefficients to the module, stores them there, and reads them back after a time without power.

use chrono::Utc;
use gnc_analysis::figures::calibration::{COEFFICIENTS, ModuleCoefficients};
use gnc_analysis::motion::OFF_S;
use gnc_executive::catalogue::ItemId;
use gnc_executive::catalogue::calibration::{CHECKSUM, COEFFICIENTS_ALTERED, STORE_TIME};
use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;
use gnc_protocol::calibration::{
    Calibration, CalibrationCommit, CalibrationRead, CalibrationReadReply, CalibrationState, CalibrationWrite,
};
use gnc_protocol::wire::Wire as _;

use super::{ProcedureContext, ProcedureError, Recorder, calibration, capturing};
use crate::turntable;

/// Bytes of a coefficient on the wire.
const COEFFICIENT: usize = size_of::<f64>();
/// Bytes of the calibration's number, which stands before them.
const NUMBER: usize = size_of::<u32>();

pub(super) async fn run(
    bench: &ProcedureContext<'_>,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let findings = calibration::analyse(ItemId::CalibrationDownload, bench, params, Vec::new(), recorder).await?;
    let coefficients = COEFFICIENTS
        .of(&findings.details)
        .ok_or_else(|| ProcedureError::Analysis { why: "the analysis gave no coefficients".to_owned() })?;
    recorder.found(findings).await?;
    let written = message(&coefficients);
    let board = bench.board;
    board.call(&CalibrationWrite { calibration: written.clone() }).await?;
    let stored = board.call(&CalibrationCommit { checksum: written.checksum() }).await?;
    capturing::power_cycle(bench, recorder, turntable::of(bench.fixture, recorder).as_ref(), OFF_S).await?;
    let read = board.call(&CalibrationRead {}).await?;
    recorder.count(&COEFFICIENTS_ALTERED, altered(&written, &read)).await?;
    recorder.text(&CHECKSUM, checksum(&written, &read)).await?;
    Ok(recorder.number(&STORE_TIME, f64::from(stored.duration_us) * 1e-3, Unit::Millisecond).await?)
}

fn message(coefficients: &ModuleCoefficients) -> Calibration {
    let ModuleCoefficients { accel_matrix, accel_offset, gyro_matrix, gyro_offset, gyro_per_force, mag } =
        *coefficients;
    Calibration {
        // The number is never 0, and each calibration of a module has another one.
        id: u32::try_from(Utc::now().timestamp()).unwrap_or(u32::MAX).max(1),
        accel_matrix,
        accel_offset,
        gyro_matrix,
        gyro_offset,
        gyro_per_force,
        mag_dx: mag.dx,
        mag_dy: mag.dy,
        mag_ky: mag.ky,
        mag_sin_alpha: mag.sin_alpha,
    }
}

/// Counts the coefficients that differ in any bit from those that were written; all of them if nothing is stored.
fn altered(written: &Calibration, read: &CalibrationReadReply) -> u64 {
    let bytes = |calibration: &Calibration| calibration.to_payload().map(|bytes| bytes.to_vec()).unwrap_or_default();
    let (written, read) = (bytes(written), read.calibration.first().map(bytes).unwrap_or_default());
    let pairs = written.get(NUMBER..).unwrap_or_default().chunks(COEFFICIENT).enumerate();
    let differs = |(index, was): (usize, &[u8])| {
        let at = NUMBER + index * COEFFICIENT;
        read.get(at..at + COEFFICIENT) != Some(was)
    };
    pairs.filter(|pair| differs(*pair)).count() as u64
}

fn checksum(written: &Calibration, read: &CalibrationReadReply) -> &'static str {
    match CalibrationState::from_number(read.state) {
        Some(CalibrationState::Valid) if read.checksum == written.checksum() => "good",
        Some(CalibrationState::Valid) => "of another calibration",
        Some(CalibrationState::None) => "none stored",
        Some(CalibrationState::Damaged) | None => "wrong",
    }
}
