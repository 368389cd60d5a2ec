//! Who the module is, and what it draws from its supply.

use gnc_executive::quantity::Unit;
use gnc_protocol::message::{Identity, ModulePower};

use super::{Bench, Report, Trouble};

pub(super) async fn run(bench: &Bench<'_>, report: &Report<'_>) -> Result<(), Trouble> {
    let identity = bench.board.call(&Identity {}).await?;
    report.text("serial_number", &identity.serial_number).await?;
    report.text("part", &identity.part).await?;
    report.text("hardware", &identity.hardware).await?;
    report.text("firmware", &identity.firmware).await?;
    report.count("protocol", identity.protocol.into()).await?;
    // Switching on what is on measures the supply again, now with the module at work.
    let supply = bench.board.call(&ModulePower { on: 1 }).await?;
    report.number("supply_voltage", f64::from(supply.supply_uv) * 1e-6, Unit::Volt).await?;
    report.number("supply_current", f64::from(supply.supply_ua) * 1e-6, Unit::Ampere).await
}
