//! SPI flash and internal flash: erase, blank check, write, read back, in a scratch sector.

use gnc_executive::catalogue::memory::{BLANK_ERRORS, ERASE_TIME, JEDEC_ID, VERIFY_ERRORS, WRITE_TIME};
use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;
use gnc_protocol::message::{Flash, FlashBlankCheck, FlashErase, FlashId, FlashVerify, FlashWrite, MismatchReply};

use super::{ProcedureContext, ProcedureError, Recorder};

/// Fixed, so that a sector can be compared by hand. A new pattern for each test would only reveal a sector that was
/// never erased, and the blank check finds that already.
const PATTERN_SEED: u32 = 0x2545_f491;

pub(super) async fn run(
    bench: &ProcedureContext<'_>,
    flash: Flash,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let sector = u16::try_from(params.integer("sector")?).unwrap_or(u16::MAX);
    let device = flash as u8;
    if flash == Flash::Spi {
        let [manufacturer, kind, capacity] = bench.board.call(&FlashId { flash: device }).await?.jedec;
        recorder.text(&JEDEC_ID, &format!("{manufacturer:02x} {kind:02x} {capacity:02x}")).await?;
    }
    let erased = bench.board.call(&FlashErase { flash: device, sector }).await?;
    recorder.number(&ERASE_TIME, f64::from(erased.duration_us) * 1e-3, Unit::Millisecond).await?;
    let blank = bench.board.call(&FlashBlankCheck { flash: device, sector }).await?;
    recorder.count(&BLANK_ERRORS, blank.mismatches.into()).await?;
    note_first(recorder, "not blank", &blank).await?;
    let written = bench.board.call(&FlashWrite { flash: device, sector, seed: PATTERN_SEED }).await?;
    recorder.number(&WRITE_TIME, f64::from(written.duration_us) * 1e-3, Unit::Millisecond).await?;
    let verified = bench.board.call(&FlashVerify { flash: device, sector, seed: PATTERN_SEED }).await?;
    recorder.count(&VERIFY_ERRORS, verified.mismatches.into()).await?;
    note_first(recorder, "read back wrong", &verified).await
}

async fn note_first(recorder: &Recorder<'_>, what: &str, found: &MismatchReply) -> Result<(), ProcedureError> {
    if found.mismatches == 0 {
        return Ok(());
    }
    let (place, expected, got) = (found.first_place, found.expected, found.got);
    Ok(recorder.note(&format!("{what}: first at word {place}, expected {expected:#010x}, read {got:#010x}")).await?)
}
