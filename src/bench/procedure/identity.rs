//! Who the module is, and what it draws from its supply.

use gnc_executive::quantity::Unit;
use gnc_protocol::message::{Identity, ModulePower};

use super::{Bench, ProcedureError, Recorder};

pub(super) async fn run(bench: &Bench<'_>, recorder: &Recorder<'_>) -> Result<(), ProcedureError> {
    let identity = bench.board.call(&Identity {}).await?;
    recorder.text("serial_number", &identity.serial_number).await?;
    recorder.text("part", &identity.part).await?;
    recorder.text("hardware", &identity.hardware).await?;
    recorder.text("firmware", &identity.firmware).await?;
    recorder.count("protocol", identity.protocol.into()).await?;
    // Switching on what is on measures the supply again, now with the module at work.
    let supply = bench.board.call(&ModulePower { on: 1 }).await?;
    recorder.number("supply_voltage", f64::from(supply.supply_uv) * 1e-6, Unit::Volt).await?;
    Ok(recorder.number("supply_current", f64::from(supply.supply_ua) * 1e-6, Unit::Ampere).await?)
}
