//! Intervals of the module's timers against the slave's reference clock.

use gnc_executive::plan::Params;
use gnc_executive::quantity::Unit;
use gnc_metrology::stats::mean_sd;
use gnc_protocol::message::TimerMeasure;

use super::{Bench, ProcedureError, Recorder};

const PERIODS: [(u32, &str); 4] = [(500, "500us"), (1000, "1ms"), (2000, "2ms"), (5000, "5ms")];

pub(super) async fn run(bench: &Bench<'_>, params: &Params, recorder: &Recorder<'_>) -> Result<(), ProcedureError> {
    let count = u16::try_from(params.integer("repeats")?).unwrap_or(u16::MAX);
    for &timer in params.integers("timers")? {
        let timer = u8::try_from(timer).unwrap_or(u8::MAX);
        let mut missing = 0.0;
        for (period_us, name) in PERIODS {
            let reply = bench.board.call(&TimerMeasure { timer, period_us, count }).await?;
            // Too many in one interval do not make up for too few in another.
            missing += (f64::from(count) - f64::from(reply.interrupts)).abs();
            let intervals_us: Vec<f64> = reply.intervals_ns.iter().map(|ns| f64::from(*ns) * 1e-3).collect();
            if intervals_us.is_empty() {
                // No interrupt, no interval: the count of the missing ones says what there is to say.
                continue;
            }
            let nominal = f64::from(period_us);
            let worst = intervals_us.iter().map(|us| (us / nominal - 1.0).abs()).fold(0.0, f64::max);
            let prefix = format!("timer{timer}_{name}");
            let (mean, sd) = mean_sd(&intervals_us);
            recorder.number(&format!("{prefix}_mean"), mean, Unit::Microsecond).await?;
            recorder.number(&format!("{prefix}_worst"), worst * 100.0, Unit::Percent).await?;
            recorder.number(&format!("{prefix}_jitter"), sd, Unit::Microsecond).await?;
        }
        recorder.number(&format!("timer{timer}_interrupts_missing"), missing, Unit::Count).await?;
    }
    Ok(())
}
