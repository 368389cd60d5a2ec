//! The true state of the bench, for tests.

use gnc_protocol::slave::SlaveBoard as _;
use nalgebra::Matrix3;

use super::SimulatedBench;
use crate::devices::inertial::{SensorModels, TrueSensors};
use crate::fault_queue::Toll;
use crate::turntable::TableTruth;
use crate::world::{Influence, TrueSite};

/// The true state of the bench, for tests. It must not reach the station.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// Where the bench stands.
    pub site: TrueSite,
    /// Gravity at the site, m/s^2.
    pub gravity: f64,
    /// Rotation from north, west, up into the module's axes.
    pub attitude: Matrix3<f64>,
    /// What acts on the module, in its axes.
    pub influence: Influence,
    /// The sensors' models: fixed errors and noise.
    pub sensors: SensorModels,
    /// The sensors' true properties now, at this temperature and after this power-on.
    pub sensors_now: TrueSensors,
    /// Bench time in ns of the board's oscillator.
    pub bench_time_ns: u64,
    /// Board time in us since its last start.
    pub board_time_us: u64,
    /// UTC, seconds since 1970.
    pub utc_s: f64,
    /// The DIP switches 1 to 5.
    pub switches: [bool; 5],
    /// Whether the module is under power.
    pub powered: bool,
    /// Restarts of the board.
    pub restarts: u32,
    /// Whether the receiver has a fix.
    pub has_fix: bool,
    /// Erases that the SPI flash did.
    pub spi_flash_erases: u32,
    /// Erases that the internal flash did.
    pub internal_flash_erases: u32,
    /// The turntable.
    pub table: TableTruth,
    /// What faults did to frames on their way.
    pub line: LineTruth,
}

/// What faults did to frames between host and board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LineTruth {
    /// RS-422 towards the host.
    pub to_host: Toll,
    /// RS-422 towards the board.
    pub to_board: Toll,
    /// CAN towards the host.
    pub can_to_host: Toll,
    /// CAN towards the board.
    pub can_to_board: Toll,
}

impl SimulatedBench {
    /// The true state now.
    #[must_use]
    pub fn truth(&self) -> Truth {
        let board = &self.board;
        let now_s = board.true_s(board.now_ns());
        let (can_to_host, can_to_board) = self.can.tolls();
        let (to_host, to_board) = (self.wire_to_host.toll(), self.wire_to_board.toll());
        Truth {
            line: LineTruth { to_host, to_board, can_to_host, can_to_board },
            site: board.world.site,
            gravity: board.world.site.gravity(),
            attitude: board.world.attitude(now_s).into_inner(),
            influence: board.world.influence(now_s),
            sensors: *board.module.sensors.models(),
            sensors_now: board.module.sensors.truth(board.world.temperature_c(now_s)),
            bench_time_ns: board.now_ns(),
            board_time_us: board.board_time_us(),
            utc_s: board.world.utc_s(now_s),
            switches: board.module.ad.switches(),
            powered: board.is_powered(),
            restarts: board.restarts(),
            has_fix: board.is_powered() && board.module.gnss.has_fix(now_s),
            spi_flash_erases: board.module.spi_flash.erases(),
            internal_flash_erases: board.module.internal_flash.erases(),
            table: self.table.truth(&board.world, now_s),
        }
    }
}
