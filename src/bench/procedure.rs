//! One procedure for each item of the table. A procedure asks the board, measures and reports. It never judges.

mod ad;
mod calibration;
mod can;
mod capturing;
mod cpu;
mod download;
mod error;
mod flash;
mod gnss;
mod heat;
mod identity;
mod imu;
mod io;
mod memory;
mod power_cycle;
mod prompt;
mod sampling;
mod sci;
mod spi;
mod start;
mod timers;

use std::cell::Cell;

use gnc_analysis::figures::Findings;
use gnc_analysis::host_clock::HostClock;
use gnc_board::BoardLease;
use gnc_executive::bench::BenchSite;
use gnc_executive::catalogue::ItemId;
use gnc_executive::plan::{Params, PlanItem};
use gnc_link::can::CanTarget;
use gnc_records::resume::Resumed;

use crate::fixture::Fixture;
use crate::guidance::Guide;
use crate::questions::Answers;
use crate::recorder::Recorder;

pub(crate) use error::ProcedureError;
pub(crate) use heat::{AttemptClock, Heat};
pub(crate) use start::ModuleSeen;

/// What a procedure works with.
#[derive(Debug)]
pub(crate) struct ProcedureContext<'a> {
    /// The slave board.
    pub board: &'a BoardLease<'a>,
    /// Turns the module and flips switches.
    pub fixture: &'a Fixture,
    /// Who answers the questions of the plan.
    pub answers: &'a Answers,
    /// Where the bench stands, if its file says so.
    pub site: Option<&'a BenchSite>,
    /// The bench's CAN bus, unless the conversation with the board uses it.
    pub can: Option<&'a CanTarget>,
    /// Whether the record says that the bench is real.
    pub is_real: bool,
    /// The module of the run.
    pub module: &'a ModuleSeen,
    /// Findings of the items that ended before this attempt, in the order of the plan, each with its name.
    pub earlier: Vec<(String, Findings)>,
    /// The earlier run whose captures are taken over; a second attempt captures anew.
    pub resumed: Option<&'a Resumed>,
    /// What a resumed run owes the module.
    pub heat: &'a Heat,
    /// The clock of the attempt.
    pub clock: &'a AttemptClock,
    /// Set if some captures of the attempt are taken over and others are new.
    pub mixed: &'a Cell<bool>,
    /// Tells people how far captures are.
    pub guide: &'a Guide,
    /// Whether the host's clock runs at the pace of the board's world.
    pub host_clock: HostClock,
}

/// Whether an earlier run has all captures of an item.
pub(crate) async fn is_captured(item: &PlanItem, resumed: &Resumed) -> bool {
    capturing::is_captured(item, resumed).await
}

/// Runs the procedure of an item.
///
/// # Errors
/// [`ProcedureError`] if the procedure did not finish; what was measured up to then is filed.
pub(crate) async fn run(
    item: ItemId,
    bench: &ProcedureContext<'_>,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    match item {
        ItemId::Identity => identity::run(bench, recorder).await,
        ItemId::Cpu => cpu::run(bench, params, recorder).await,
        ItemId::Timers => timers::run(bench, params, recorder).await,
        ItemId::InternalRam => memory::run(bench, gnc_protocol::message::Ram::Internal, params, recorder).await,
        ItemId::Sdram => memory::run(bench, gnc_protocol::message::Ram::Sdram, params, recorder).await,
        ItemId::SpiFlash => flash::run(bench, gnc_protocol::message::Flash::Spi, params, recorder).await,
        ItemId::InternalFlash => flash::run(bench, gnc_protocol::message::Flash::Internal, params, recorder).await,
        ItemId::Imu => {
            heat::restore(bench, recorder, (0.0, None)).await?;
            imu::run(bench, params, recorder).await
        }
        ItemId::Gnss => gnss::run(bench, params, recorder).await,
        ItemId::Ad => ad::run(bench, params, recorder).await,
        ItemId::Io => io::run(bench, recorder).await,
        ItemId::Spi => spi::run(bench, params, recorder).await,
        ItemId::Sci => sci::run(bench, params, recorder).await,
        ItemId::Can => can::run(bench, recorder).await,
        ItemId::PowerCycle => power_cycle::run(bench, params, recorder).await,
        ItemId::Prompt => prompt::run(bench, recorder).await,
        ItemId::CalibrationDownload => download::run(bench, params, recorder).await,
        ItemId::SixPosition
        | ItemId::GyroStill
        | ItemId::Rotation
        | ItemId::GyroBias
        | ItemId::AccelBias
        | ItemId::BiasStability
        | ItemId::BiasRepeatability
        | ItemId::ScaleFactorRepeatability
        | ItemId::CrossCoupling
        | ItemId::Resolution
        | ItemId::Allan
        | ItemId::Psd
        | ItemId::MagnetometerEllipse
        | ItemId::MagnetometerEllipsoid
        | ItemId::GnssAccuracy
        | ItemId::CalibrationCheck => calibration::run(item, bench, params, recorder).await,
    }
}
