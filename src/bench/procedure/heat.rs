//! The module's heat in a resumed run. The captures that are taken over are of a warm module; before anything new is captured
//! the station waits until the module is as warm again.

use std::cell::Cell;

use gnc_analysis::capture::Capture;
use gnc_analysis::heat::{HeatLeft, HeatWait, Waiting, Warmth};
use gnc_analysis::motion::DisplayDuration;
use gnc_board::stream::Stream;
use gnc_executive::plan::ResumeRules;
use gnc_protocol::message::StreamStart;
use gnc_protocol::stream::{ImuSample, StreamId};
use gnc_protocol::wire::{FieldReader, Wire as _};

use super::{ProcedureContext, ProcedureError, Recorder};
use crate::guidance::Course;

/// Samples a second while the station waits: enough for a median, and no load for any line.
const RATE_HZ: u16 = 10;

/// What a resumed run owes the module.
#[derive(Debug)]
pub(crate) struct Heat {
    rules: ResumeRules,
    /// The module at the end of the last capture that is taken over, until it is as warm again.
    owed: Cell<Option<HeatLeft>>,
    /// Board time of all waits of the run.
    waited_s: Cell<f64>,
}

impl Heat {
    /// Nothing is owed at the start of a run.
    pub(crate) fn new(rules: ResumeRules) -> Self {
        Self { rules, owed: Cell::new(None), waited_s: Cell::new(0.0) }
    }

    /// These captures are taken over, in the order of their program.
    pub(super) fn owe(&self, taken: &[&Capture]) {
        self.owed.set(HeatLeft::by(taken).or(self.owed.get()));
    }
}

/// The clock of an attempt: it stands while the station waits for the module.
#[derive(Debug, Default)]
pub(crate) struct AttemptClock {
    stands: Cell<bool>,
    waited_us: Cell<u64>,
}

impl AttemptClock {
    /// Stops the clock for the rest of the attempt.
    pub(super) fn stand(&self) {
        self.stands.set(true);
    }

    /// Whether the clock stands.
    pub(crate) fn stands(&self) -> bool {
        self.stands.get()
    }

    /// Board time in which the clock stood.
    pub(crate) fn waited_us(&self) -> u64 {
        self.waited_us.get()
    }
}

/// Waits until the module is as warm as at the end of the captures that are taken over, or as it would have become in the `left_s` that
/// the item still needs. It returns at once if nothing is taken over.
///
/// # Errors
/// [`ProcedureError::NotWarm`]; the module stays owed to the next item.
pub(super) async fn restore(
    bench: &ProcedureContext<'_>,
    recorder: &Recorder<'_>,
    (left_s, course): (f64, Option<&mut Course<'_>>),
) -> Result<(), ProcedureError> {
    let (heat, clock, board) = (bench.heat, bench.clock, bench.board);
    let Some(owed) = heat.owed.get() else { return Ok(()) };
    clock.stands.set(true);
    let mut stream = board.listen(StreamId::Imu).await?;
    let began_us = stream.board_time_us();
    board.call(&StreamStart { stream: StreamId::Imu as u8, rate_hz: RATE_HZ, count: 0, samples_per_frame: 1 }).await?;
    let bound_s = (heat.rules.wait_s - heat.waited_s.get()).max(0.0);
    let mut wait = HeatWait::new(&owed, left_s, heat.rules.within_k, bound_s, RATE_HZ);
    let waited = follow(&mut wait, &mut stream, bench, recorder, course).await;
    heat.waited_s.set(heat.waited_s.get() + wait.waited_s());
    clock.waited_us.set(clock.waited_us() + stream.board_time_us().saturating_sub(began_us));
    if !matches!(waited, Err(ProcedureError::Board(_))) {
        board.stop_stream(stream).await?;
    }
    clock.stands.set(false);
    let warmth = match waited? {
        Ok(warmth) => warmth,
        Err(warmth) => return Err(not_warm(heat, &warmth)),
    };
    heat.owed.set(None);
    let (now_c, target_c) = (warmth.now.mean_c(), warmth.target.mean_c());
    let text = format!(
        "The module is as warm as at the end of the captures that are taken over, after {} of waiting: {now_c:.2} degC, and it had \
         {target_c:.2} degC.",
        DisplayDuration(warmth.waited_s)
    );
    Ok(recorder.note(&text).await?)
}

/// Follows the samples to the end of the wait. The inner error is a wait that was in vain.
async fn follow(
    wait: &mut HeatWait,
    stream: &mut Stream,
    bench: &ProcedureContext<'_>,
    recorder: &Recorder<'_>,
    mut course: Option<&mut Course<'_>>,
) -> Result<Result<Warmth, Warmth>, ProcedureError> {
    let mut told = false;
    loop {
        let Some(frame) = stream.next().await? else {
            let losses = stream.losses();
            return Err(ProcedureError::SamplesLost { wanted: losses.received.saturating_add(1), losses });
        };
        let mut reader = FieldReader::new(&frame.samples);
        let mut samples = Vec::with_capacity(usize::from(frame.head.count));
        for _ in 0..frame.head.count {
            let sample = ImuSample::get(&mut reader);
            samples.push(
                sample.map_err(|error| ProcedureError::Nonsense { what: "the IMU stream", why: error.to_string() })?,
            );
        }
        let warmth = match wait.take(&samples) {
            None => continue,
            Some(Waiting::Done(warmth)) => return Ok(Ok(warmth)),
            Some(Waiting::GivenUp(warmth)) => return Ok(Err(warmth)),
            Some(Waiting::On(warmth)) => warmth,
        };
        match course.as_deref_mut() {
            Some(course) => course.warms(warmth),
            None => bench.board.advanced(warmth.waited_s, warmth.waited_s + warmth.left_s.unwrap_or(warmth.bound_s)),
        }
        if !told && !wait.is_there() {
            told = true;
            recorder.note(&announced(bench.heat, &warmth)).await?;
        }
    }
}

fn announced(heat: &Heat, warmth: &Warmth) -> String {
    format!(
        "The module has {:.2} degC. At the end of the captures that are taken over it had {:.2} degC. The station waits until both are \
         within {} degC, at most {}.",
        warmth.now.mean_c(),
        warmth.target.mean_c(),
        heat.rules.within_k,
        DisplayDuration(warmth.bound_s + warmth.waited_s),
    )
}

fn not_warm(heat: &Heat, warmth: &Warmth) -> ProcedureError {
    ProcedureError::NotWarm {
        now_c: warmth.now.mean_c(),
        target_c: warmth.target.mean_c(),
        within_k: heat.rules.within_k,
        waited_s: heat.waited_s.get(),
    }
}
