//! The board's switch cycles the module's supply. Does the module start each time, in the same time, and does it draw
//! the same current?
//!
//! The time to the first identity is board time, since requests and the simulated bench do not follow wall time. It is
//! the time of the request for power, of each request for the identity up to the first answer, and of the pauses
//! between them. It does not include the transfer over the line between two requests, about a millisecond each.
//!
//! The item believes nothing unchecked. It is errored if a module answers or draws current without supply, if another
//! module answers than before, or if the meter's readings never move: such cycles are not evidence. A module that does
//! not start fails.

use std::time::Duration;

use gnc_analysis::figures::Findings;
use gnc_board::BoardError;
use gnc_executive::catalogue::power::{
    CYCLES_DONE, OFF_CURRENT, OFF_VOLTAGE, STARTS_MISSED, SUPPLY_CURRENT_MAX, SUPPLY_CURRENT_MIN, SUPPLY_VOLTAGE_MAX,
    SUPPLY_VOLTAGE_MIN, TIME_TO_IDENTITY,
};
use gnc_executive::details::Details;
use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;
use gnc_protocol::NakCode;
use gnc_protocol::message::{Identity, ModulePower, PowerReply};
use serde_json::json;

use super::start::{Start, first_identity};
use super::{ProcedureContext, ProcedureError, Recorder};
use crate::turntable::{self, Turntable};

/// A tenth of the published 5 V and 0.49 A. A module with more than that is not off.
const FED_V: f64 = 0.5;
const FED_A: f64 = 0.05;
/// Cycles that are needed to show whether the meter's readings move.
const CYCLES_OF_METER: usize = 3;

/// A reading of the supply: voltage at the socket in V, current into the module in A.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Supply {
    voltage_v: f64,
    current_a: f64,
}

impl Supply {
    fn of(reply: &PowerReply) -> Self {
        Self { voltage_v: f64::from(reply.supply_uv) * 1e-6, current_a: f64::from(reply.supply_ua) * 1e-6 }
    }
}

/// One cycle.
#[derive(Debug)]
struct Cycle {
    /// Supply at the end of the time without power.
    off: Supply,
    /// Supply as soon as the board calls it settled.
    switched_on: Supply,
    /// Supply after the settling time, with the module at work.
    settled: Supply,
    /// Time from the request for power to the first identity, s; or the error of a module that stays silent.
    start: Result<f64, BoardError>,
}

pub(super) async fn run(
    bench: &ProcedureContext<'_>,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let wanted = usize::try_from(params.integer("cycles")?).unwrap_or(1);
    let seconds = |name| params.quantity(name, Unit::Second);
    let (off_s, settling_s, timeout_s) =
        (seconds("off_time")?, seconds("settling_time")?, seconds("identity_timeout")?);
    let table = turntable::of(bench.fixture, recorder);
    bench.module.compare(&bench.board.call(&Identity {}).await?, "before the first cycle")?;
    let switch = Switch { bench, recorder, table: table.as_ref(), off_s, settling_s, timeout_s };
    let mut cycles = Vec::new();
    let mut ended = Ok(());
    while cycles.len() < wanted && ended.is_ok() {
        match switch.cycle(cycles.len() + 1).await {
            Ok(cycle) => cycles.push(cycle),
            Err(error) => ended = Err(error),
        }
        bench.board.advanced(cycles.len() as f64, wanted as f64);
    }
    // The measured cycles stand beside the reason why they are not evidence.
    let ended = ended.and_then(|()| check_meter(&cycles));
    recorder.found(Findings::from(Details::from(details(&cycles)))).await?;
    ended?;
    file(&cycles, recorder).await?;
    match cycles.into_iter().find_map(|cycle| cycle.start.err()) {
        Some(silent) => Err(silent.into()),
        None => Ok(()),
    }
}

struct Switch<'a> {
    bench: &'a ProcedureContext<'a>,
    recorder: &'a Recorder<'a>,
    table: &'a (dyn Turntable + 'a),
    off_s: f64,
    settling_s: f64,
    timeout_s: f64,
}

impl Switch<'_> {
    /// Switches off and on again. After an error the runner restores the supply.
    async fn cycle(&self, number: usize) -> Result<Cycle, ProcedureError> {
        let board = self.bench.board;
        board.call(&ModulePower { on: 0 }).await?;
        self.recorder.powered(false, None).await?;
        self.table.pause(Duration::from_secs_f64(self.off_s)).await?;
        // Switching off a module that is off measures the supply again.
        let off = Supply::of(&board.call(&ModulePower { on: 0 }).await?);
        if off.voltage_v > FED_V || off.current_a > FED_A {
            let Supply { voltage_v, current_a } = off;
            return Err(ProcedureError::StillFed { cycle: number, voltage_v, current_a });
        }
        self.must_not_answer(number).await?;

        let (reply, answer) = board.ask(&ModulePower { on: 1 }).await?;
        self.recorder.powered(true, Some((reply.supply_uv, reply.supply_ua))).await?;
        let start = self.start(number, answer.elapsed).await?;
        self.table.pause(Duration::from_secs_f64(self.settling_s)).await?;
        let settled = Supply::of(&board.call(&ModulePower { on: 1 }).await?);
        Ok(Cycle { off, switched_on: Supply::of(&reply), settled, start })
    }

    /// A board that answers for a module without supply would hide a module that does not start.
    async fn must_not_answer(&self, number: usize) -> Result<(), ProcedureError> {
        match self.bench.board.call(&Identity {}).await {
            Err(BoardError::Refused { code: NakCode::NotPowered, .. }) => Ok(()),
            Err(error) => Err(error.into()),
            Ok(_) => Err(ProcedureError::Nonsense {
                what: "Identity",
                why: format!("cycle {number}: the board gives an identity, but the module has no supply"),
            }),
        }
    }

    /// Asks for the identity until the module answers, and returns the time of the answer; the inner error if it comes
    /// too late.
    async fn start(&self, number: usize, switching: Duration) -> Result<Result<f64, BoardError>, ProcedureError> {
        match first_identity(self.bench, self.table, switching, self.timeout_s).await? {
            Start::Answered { identity, after_s } => {
                self.bench.module.compare(&identity, format!("cycle {number}"))?;
                Ok(Ok(after_s))
            }
            Start::Silent { silence, asked_s } => {
                let text = format!("cycle {number}: no identity {asked_s:.2} s after power-on");
                self.recorder.note(&text).await?;
                Ok(Err(silence))
            }
        }
    }
}

/// Readings of a real meter scatter. Only a stuck meter gives the same value to the last bit in each cycle.
fn check_meter(cycles: &[Cycle]) -> Result<(), ProcedureError> {
    let Some(first) = cycles.first().map(|cycle| cycle.settled) else { return Ok(()) };
    let stands = cycles.iter().all(|cycle| cycle.switched_on == first && cycle.settled == first);
    if cycles.len() < CYCLES_OF_METER || !stands {
        return Ok(());
    }
    let (count, Supply { voltage_v, current_a }) = (2 * cycles.len(), first);
    let why = format!("{count} readings of the supply are {voltage_v:.6} V and {current_a:.6} A to the last bit");
    Err(ProcedureError::Nonsense { what: "ModulePower", why })
}

/// A row for each cycle.
fn details(cycles: &[Cycle]) -> serde_json::Value {
    let row = |(index, cycle): (usize, &Cycle)| {
        json!({
            "cycle": index + 1,
            "off_voltage_v": cycle.off.voltage_v,
            "off_current_a": cycle.off.current_a,
            "time_to_identity_s": cycle.start.as_ref().ok(),
            "supply_voltage_v": cycle.settled.voltage_v,
            "supply_current_a": cycle.settled.current_a,
        })
    };
    json!({ "cycles": cycles.iter().enumerate().map(row).collect::<Vec<_>>() })
}

/// Files the worst values of all cycles.
async fn file(cycles: &[Cycle], recorder: &Recorder<'_>) -> Result<(), ProcedureError> {
    let highest = |of: &dyn Fn(&Cycle) -> f64| cycles.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
    let lowest = |of: &dyn Fn(&Cycle) -> f64| cycles.iter().map(of).fold(f64::INFINITY, f64::min);
    recorder.count(&CYCLES_DONE, cycles.len() as u64).await?;
    recorder.count(&STARTS_MISSED, cycles.iter().filter(|cycle| cycle.start.is_err()).count() as u64).await?;
    match cycles.iter().filter_map(|cycle| cycle.start.as_ref().ok().copied()).reduce(f64::max) {
        Some(slowest_s) => recorder.number(&TIME_TO_IDENTITY, slowest_s, Unit::Second).await?,
        None => recorder.not_available(&TIME_TO_IDENTITY, "the module did not start in any cycle").await?,
    }
    recorder.number(&SUPPLY_VOLTAGE_MIN, lowest(&|cycle| cycle.settled.voltage_v), Unit::Volt).await?;
    recorder.number(&SUPPLY_VOLTAGE_MAX, highest(&|cycle| cycle.settled.voltage_v), Unit::Volt).await?;
    recorder.number(&SUPPLY_CURRENT_MIN, lowest(&|cycle| cycle.settled.current_a), Unit::Ampere).await?;
    recorder.number(&SUPPLY_CURRENT_MAX, highest(&|cycle| cycle.settled.current_a), Unit::Ampere).await?;
    recorder.number(&OFF_VOLTAGE, highest(&|cycle| cycle.off.voltage_v) * 1e3, Unit::Millivolt).await?;
    Ok(recorder.number(&OFF_CURRENT, highest(&|cycle| cycle.off.current_a), Unit::Ampere).await?)
}
