//! Intervals of the module's timers against the slave's reference clock.

use gnc_executive::catalogue::processor::TIMER;
use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;
use gnc_metrology::stats::mean_sd;
use gnc_protocol::message::TimerMeasure;

use super::{ProcedureContext, ProcedureError, Recorder};

/// In the order of the catalogue.
const PERIODS_US: [u32; 4] = [500, 1000, 2000, 5000];

pub(super) async fn run(
    bench: &ProcedureContext<'_>,
    params: &Params,
    recorder: &Recorder<'_>,
) -> Result<(), ProcedureError> {
    let count = u16::try_from(params.integer("repeats")?).unwrap_or(u16::MAX);
    for &timer in params.integers("timers")? {
        let timer = u8::try_from(timer).unwrap_or(u8::MAX);
        let Some(of_timer) = TIMER.get(usize::from(timer)) else { continue };
        let mut missing = 0.0;
        for (period_us, of_interval) in PERIODS_US.into_iter().zip(&of_timer.intervals) {
            let reply = bench.board.call(&TimerMeasure { timer, period_us, count }).await?;
            // Too many interrupts in one interval do not make up for too few in another.
            missing += (f64::from(count) - f64::from(reply.interrupts)).abs();
            let intervals_us: Vec<f64> = reply.intervals_ns.iter().map(|ns| f64::from(*ns) * 1e-3).collect();
            if intervals_us.is_empty() {
                // Without interrupts there are no intervals: the count of missing interrupts says it all.
                continue;
            }
            let nominal = f64::from(period_us);
            let worst = intervals_us.iter().map(|us| (us / nominal - 1.0).abs()).fold(0.0, f64::max);
            let (mean, sd) = mean_sd(&intervals_us);
            recorder.number(&of_interval.mean, mean, Unit::Microsecond).await?;
            recorder.number(&of_interval.worst, worst * 100.0, Unit::Percent).await?;
            recorder.number(&of_interval.jitter, sd, Unit::Microsecond).await?;
        }
        recorder.number(&of_timer.interrupts_missing, missing, Unit::Count).await?;
    }
    Ok(())
}
