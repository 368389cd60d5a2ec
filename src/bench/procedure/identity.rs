//! The module's identity and the current that it draws.

use gnc_executive::catalogue::processor::{
    FIRMWARE, HARDWARE, PART, PROTOCOL, SERIAL_NUMBER, SUPPLY_CURRENT, SUPPLY_VOLTAGE,
};
use gnc_executive::quantity::Unit;
use gnc_protocol::message::{Identity, ModulePower, PowerReply};

use super::{ProcedureContext, ProcedureError, Recorder};

/// No module answers on less than this: a board that says so measures or scales in another way (microvolts and
/// microamperes).
const LEAST_UV: u32 = 500_000;
const LEAST_UA: u32 = 5_000;

pub(super) async fn run(bench: &ProcedureContext<'_>, recorder: &Recorder<'_>) -> Result<(), ProcedureError> {
    let identity = bench.board.call(&Identity {}).await?;
    bench.module.compare(&identity, "at the item")?;
    recorder.text(&SERIAL_NUMBER, &identity.serial_number).await?;
    recorder.text(&PART, &identity.part).await?;
    recorder.text(&HARDWARE, &identity.hardware).await?;
    recorder.text(&FIRMWARE, &identity.firmware).await?;
    recorder.count(&PROTOCOL, identity.protocol.into()).await?;
    if !bench.board.switches_supply() {
        let why = "the board does not measure the supply";
        recorder.not_available(&SUPPLY_VOLTAGE, why).await?;
        return Ok(recorder.not_available(&SUPPLY_CURRENT, why).await?);
    }
    // Switching on a module that is on measures the supply again, now with the module at work.
    let supply = bench.board.call(&ModulePower { on: 1 }).await?;
    let PowerReply { supply_uv, supply_ua } = supply;
    if supply_uv < LEAST_UV || supply_ua < LEAST_UA {
        let (volts, amperes) = (f64::from(supply_uv) * 1e-6, f64::from(supply_ua) * 1e-6);
        let why = format!("{volts:.6} V and {amperes:.6} A at the socket, and the module answers");
        return Err(bench.board.impossible("ModulePower", why).into());
    }
    recorder.number(&SUPPLY_VOLTAGE, f64::from(supply.supply_uv) * 1e-6, Unit::Volt).await?;
    Ok(recorder.number(&SUPPLY_CURRENT, f64::from(supply.supply_ua) * 1e-6, Unit::Ampere).await?)
}
