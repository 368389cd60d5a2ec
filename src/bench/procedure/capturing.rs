//! Carries out a motion program: lays the module down, turns it, and files the samples that the sensors give meanwhile.

mod compensated;
mod losses;
mod receiver;
mod taken;

use std::time::Duration;

use gnc_analysis::capture::{Capture, CaptureHead, Pose, ReceiverCapture, Timing};
use gnc_analysis::motion::watch::{TURN_PART, TurnWatch, Watch, turned_deg};
use gnc_analysis::motion::{MotionProgram, MotionStep, REST_BEFORE_S, ResumeAction, Uses};
use gnc_board::stream::{Closed, SampleFrame, Stream};
use gnc_executive::catalogue::Trace;
use gnc_metrology::sample_clock::{ClockFault, SampleClock};
use gnc_protocol::calibration::CompensatedSample;
use gnc_protocol::message::{Identity, ModulePower, StreamStart};
use gnc_protocol::stream::{ImuSample, Losses, StreamId};
use gnc_protocol::wire::{FieldReader, Wire};
use gnc_records::raw::{Piece, pieces};
use gnc_records::store::RawFile;

use super::sampling::{ClockWatch, samples_per_frame};
use super::start::{Start, first_identity};
use super::{ProcedureContext, ProcedureError, Recorder, heat};
use crate::fixture::TakenOver;
use crate::guidance::Course;
use crate::turntable::{self, Turntable};

pub(super) use taken::is_captured;

/// A turn that takes longer than this factor times its span, plus the slack in seconds, is not the turn that was asked
/// for.
const LONGEST_TURN: f64 = 2.0;
const SLACK_S: f64 = 60.0;
/// Room that is kept ready for the samples of a turn, whose end is not known beforehand.
const TURN_ROOM: usize = 1 << 14;

/// Carries out a program and returns its captures. The samples are on disk when it returns.
///
/// # Errors
/// [`ProcedureError`]; what was captured up to then is on disk.
pub(super) async fn run(
    program: &MotionProgram,
    bench: &ProcedureContext<'_>,
    recorder: &Recorder<'_>,
) -> Result<Vec<Capture>, ProcedureError> {
    let table = turntable::of(bench.fixture, recorder);
    let table = table.as_ref();
    let taken = taken::taken(bench, recorder).await?;
    let course = Course::new(program, bench.board, bench.guide);
    let mut capture = ProgramCapture {
        bench,
        recorder,
        table,
        moving: false,
        raw: recorder.raw().await?,
        captures: Vec::new(),
        course,
    };
    let followed = capture.follow(program, taken).await;
    if followed.is_err() && capture.moving {
        // The next item lays the module down. The error that ended this item counts, not a failure to stop the table.
        let _ = table.stop().await;
    }
    followed?;
    capture.course.works_out();
    recorder.captured(capture.raw.finish().await?).await?;
    Ok(capture.captures)
}

struct ProgramCapture<'a> {
    bench: &'a ProcedureContext<'a>,
    recorder: &'a Recorder<'a>,
    table: &'a (dyn Turntable + 'a),
    /// Whether the table spins or turns.
    moving: bool,
    raw: RawFile,
    captures: Vec<Capture>,
    course: Course<'a>,
}

impl ProgramCapture<'_> {
    /// Carries out the steps that the interrupted run has not. Says first what is taken over, and then asks for motions.
    async fn follow(&mut self, program: &MotionProgram, mut taken: Vec<Capture>) -> Result<(), ProcedureError> {
        let actions = program.after(|about| taken.iter().any(|capture| capture.about == *about));
        let left_s: f64 = actions.iter().map(|action| action.step().span_s()).sum();
        let over = TakenOver::of(&actions);
        self.course.passes_over(program.span_s() - left_s, &over.taken);
        if !over.taken.is_empty() {
            self.recorder.note(&over.to_string()).await?;
            self.bench.heat.owe(&in_order(&actions, &taken));
            self.bench.mixed.set(self.bench.mixed.get() || !over.left.is_empty());
            self.table.taken_over(over);
        }
        if actions.iter().any(|action| matches!(action, ResumeAction::Do(_))) && self.recorder.id().feels(Trace::Heat) {
            heat::restore(self.bench, self.recorder, (left_s, Some(&mut self.course))).await?;
        }
        for action in actions {
            match action {
                ResumeAction::Do(step) => self.carry_out(step).await?,
                ResumeAction::Take(step) => {
                    let place = taken.iter().position(|capture| step.about() == Some(&capture.about));
                    match place {
                        Some(place) => self.take_over(taken.swap_remove(place)).await?,
                        None => self.carry_out(step).await?,
                    }
                }
            }
            self.course.ended(action.step());
        }
        Ok(())
    }

    async fn carry_out(&mut self, step: &MotionStep) -> Result<(), ProcedureError> {
        self.course.begins(step);
        match step {
            MotionStep::Lay(orientation) => Ok(self.table.lay(*orientation).await?),
            MotionStep::Settle { span_s } => Ok(self.table.pause(Duration::from_secs_f64(*span_s)).await?),
            MotionStep::Spin { rate_dps } => {
                self.moving = true;
                Ok(self.table.spin(*rate_dps).await?)
            }
            MotionStep::Stop => {
                self.table.stop().await?;
                self.moving = false;
                Ok(())
            }
            MotionStep::Capture { about, span_s, uses } => {
                let wanted = (span_s * f64::from(about.rate_hz)).round().max(1.0) as u32;
                self.capture(about, *uses, Until::Count(wanted)).await
            }
            MotionStep::Turn { about, ramp_s, rest_s, uses } => {
                let rest = |span_s: f64| (span_s * f64::from(about.rate_hz)).ceil() as usize;
                let (before, after) = (rest(REST_BEFORE_S), rest(*rest_s));
                self.capture(about, *uses, Until::Turned { ramp_s: *ramp_s, before, after }).await
            }
            MotionStep::PowerCycle { off_s } => power_cycle(self.bench, self.recorder, self.table, *off_s).await,
            MotionStep::Receiver { about, timeout_s, span_s } => {
                receiver::capture(self, about, *timeout_s, *span_s).await
            }
        }
    }

    /// Files a capture of the earlier run.
    async fn take_over(&mut self, mut capture: Capture) -> Result<(), ProcedureError> {
        for piece in pieces(&capture) {
            self.raw.write(piece).await?;
        }
        // The new file has the samples on their grid; the old file had them to within a microsecond.
        let samples = capture.samples.len().max(capture.compensated.len());
        capture.timing.board = SampleClock::even(capture.about.rate_hz, capture.first_us, samples);
        self.captures.push(capture);
        Ok(())
    }

    /// Files that the captures so far are complete and on disk: a run that goes on from here takes them over.
    async fn is_complete(&mut self) -> Result<(), ProcedureError> {
        let part = self.raw.settled().await?;
        Ok(self.recorder.captured(part).await?)
    }

    async fn capture(&mut self, about: &CaptureHead, uses: Uses, until: Until) -> Result<(), ProcedureError> {
        let board = self.bench.board;
        let id = if uses == Uses::Compensated { StreamId::Compensated } else { StreamId::Imu };
        let mut stream = board.listen(id).await?;
        let count = if let Until::Count(count) = until { count } else { 0 };
        let samples_per_frame = samples_per_frame(count);
        let start = StreamStart { stream: id as u8, rate_hz: about.rate_hz, count, samples_per_frame };
        board.call(&start).await?;
        let still = matches!(about.pose, Pose::Still { .. });
        let room = if count > 0 { count as usize } else { TURN_ROOM };
        let mut buffer = CaptureBuffer {
            about,
            watch: Watch::new(uses, still, about.rate_hz),
            samples: Vec::with_capacity(room),
            compensated: (id == StreamId::Compensated).then(|| Vec::with_capacity(room)),
            first_us: None,
            clock: ClockWatch::new(about.rate_hz, self.bench),
        };
        let taken = self.take(&mut buffer, &mut stream, until).await;
        let end_us = stream.board_time_us();
        let losses = stream.losses();
        let closed = match &taken {
            // The session may be gone; then the board cannot be asked.
            Err(ProcedureError::Board(_)) => Ok(Closed { produced: 0, losses }),
            _ => board.stop_stream(stream).await,
        };
        let span_s = buffer.samples.len() as f64 / f64::from(about.rate_hz.max(1));
        board.spent(Duration::from_secs_f64(span_s));
        let CaptureBuffer { samples, compensated, first_us, clock, .. } = buffer;
        let (taken, timing) = match (taken, clock.end()) {
            (Ok(()), Ok(timing)) => (Ok(()), timing),
            // A capture with an unknown rate is not evidence; the clock fault is its error.
            (Ok(()), Err(fault)) => (Err(clock_fault(about, fault)), Timing::new(about.rate_hz)),
            (Err(trouble), _) => (Err(trouble), Timing::new(about.rate_hz)),
        };
        // Samples after the last one that was wanted do not belong to the capture.
        let losses = if losses.any() { losses } else { Losses { received: samples.len() as u32, ..losses } };
        if first_us.is_none() {
            self.raw.write(Piece::Begin { about: about.clone(), board_time_us: end_us }).await?;
        }
        if taken.is_ok() || losses.any() {
            let host = timing.host.clone();
            self.raw.write(Piece::End { losses, host, board_time_us: end_us }).await?;
        }
        taken?;
        closed?;
        self.is_complete().await?;
        let (about, first_us) = (about.clone(), first_us.unwrap_or(end_us));
        let (samples, compensated) = match compensated {
            Some(compensated) => (Vec::new(), compensated),
            None => (samples, Vec::new()),
        };
        let receiver = ReceiverCapture::default();
        self.captures.push(Capture { about, first_us, samples, compensated, losses, receiver, timing });
        Ok(())
    }

    /// Takes samples until there are enough or until they show a fault.
    async fn take(
        &mut self,
        buffer: &mut CaptureBuffer<'_>,
        stream: &mut Stream,
        until: Until,
    ) -> Result<(), ProcedureError> {
        let rate_hz = buffer.about.rate_hz;
        let table = self.table;
        let (ramp_s, before, after) = match until {
            Until::Count(count) => {
                while buffer.samples.len() < count as usize {
                    self.frame(buffer, stream, count).await?;
                }
                return Ok(());
            }
            Until::Turned { ramp_s, before, after } => (ramp_s, before, after),
        };
        let Pose::Rotating { axis, angle_deg, span_s, .. } = buffer.about.pose else { return Ok(()) };
        while buffer.samples.len() < before {
            self.frame(buffer, stream, 0).await?;
        }
        let mut rest = TurnWatch::new(axis, rate_hz, &buffer.samples);
        // The samples come later than the motion, so they show when it is over; but they do not show it before the
        // table does.
        let longest = ((span_s * LONGEST_TURN + SLACK_S) * f64::from(rate_hz)) as usize;
        let turn = table.rotate(angle_deg, span_s, ramp_s);
        tokio::pin!(turn);
        self.moving = true;
        let mut done_at = None;
        while !(done_at.is_some()
            && rest.look(&buffer.samples).is_some_and(|still| buffer.samples.len() >= still + after))
        {
            {
                // A frame that is being filed is finished even if the turn is over meanwhile. The table is polled
                // first, so that waiting frames never delay its answer.
                let had = buffer.samples.len();
                let frame = self.frame(buffer, stream, 0);
                tokio::pin!(frame);
                tokio::select! {
                    biased;
                    turned = &mut turn, if done_at.is_none() => {
                        turned?;
                        done_at = Some(had);
                        frame.await?;
                    }
                    taken = &mut frame => taken?,
                }
            }
            if done_at.is_some_and(|had| buffer.samples.len() > had + longest + after) {
                // The error of the turn tells the angle that was seen instead.
                break;
            }
        }
        self.moving = false;
        turned(buffer.about, &buffer.samples, before)
    }

    /// Takes the next frame: files it and checks it.
    async fn frame(
        &mut self,
        buffer: &mut CaptureBuffer<'_>,
        stream: &mut Stream,
        wanted: u32,
    ) -> Result<(), ProcedureError> {
        let about = buffer.about;
        let Some(frame) = stream.next().await? else {
            return Err(losses::silent(about, buffer.samples.len(), wanted, stream.losses()));
        };
        let board_time_us = frame.head.board_time_us;
        if buffer.first_us.is_none() {
            buffer.first_us = Some(board_time_us);
            self.raw.write(Piece::Begin { about: about.clone(), board_time_us }).await?;
        }
        let had = buffer.samples.len();
        let room = if wanted > 0 { (wanted as usize).saturating_sub(had) } else { usize::MAX };
        // Samples behind a gap are evidence of the gap.
        let piece = buffer.decode(&frame, room)?;
        self.raw.write(piece).await?;
        if stream.losses().any() {
            return Err(losses::gap(about, had, stream.losses()));
        }
        let (samples, rate_hz) = (&buffer.samples[had..], about.rate_hz);
        buffer.clock.frame(&frame.head, samples.len()).map_err(|fault| clock_fault(about, fault))?;
        let looked = buffer.watch.look(samples);
        self.course.took(samples);
        self.course.captured(buffer.samples.len() as f64 / f64::from(rate_hz.max(1)));
        looked.map_err(|(index, spoilt)| {
            let at_s = (had + index) as f64 / f64::from(rate_hz.max(1));
            ProcedureError::Spoilt { label: about.label.clone(), at_s, spoilt }
        })
    }
}

/// The captures that a program takes over, in its order.
fn in_order<'c>(actions: &[ResumeAction<'_>], taken: &'c [Capture]) -> Vec<&'c Capture> {
    let taken_over = actions.iter().filter(|action| matches!(action, ResumeAction::Take(_)));
    let heads = taken_over.filter_map(|action| action.step().about());
    heads.filter_map(|about| taken.iter().find(|capture| capture.about == *about)).collect()
}

/// Checks by the gyroscope of the axis that the module turned as it should.
fn turned(about: &CaptureHead, samples: &[ImuSample], before: usize) -> Result<(), ProcedureError> {
    let Pose::Rotating { axis, angle_deg, .. } = about.pose else { return Ok(()) };
    let seen_deg = turned_deg(samples, axis, about.rate_hz, before);
    if (seen_deg - angle_deg).abs() <= TURN_PART * angle_deg.abs() {
        return Ok(());
    }
    Err(ProcedureError::NotTurned { label: about.label.clone(), wanted_deg: angle_deg, seen_deg })
}

/// The error for a board clock that spoils a capture.
fn clock_fault(about: &CaptureHead, fault: ClockFault) -> ProcedureError {
    ProcedureError::Clock { what: format!("capture `{}`", about.label), fault }
}

/// How long a module may take to say who it is after a power-on, s.
const STARTS_WITHIN_S: f64 = 10.0;

/// Switches the module's power off for a time, and makes sure that the same module comes back.
pub(super) async fn power_cycle(
    bench: &ProcedureContext<'_>,
    recorder: &Recorder<'_>,
    table: &dyn Turntable,
    off_s: f64,
) -> Result<(), ProcedureError> {
    if !bench.module.is_known() {
        bench.module.compare(&bench.board.call(&Identity {}).await?, "before the power cycle")?;
    }
    bench.board.call(&ModulePower { on: 0 }).await?;
    recorder.powered(false, None).await?;
    let waited = table.pause(Duration::from_secs_f64(off_s)).await;
    // Switch the power on again in all cases: other items expect it.
    let (supply, answer) = bench.board.ask(&ModulePower { on: 1 }).await?;
    recorder.powered(true, Some((supply.supply_uv, supply.supply_ua))).await?;
    waited?;
    match first_identity(bench, table, answer.elapsed, STARTS_WITHIN_S).await? {
        Start::Answered { identity, .. } => bench.module.compare(&identity, "after the power cycle"),
        Start::Silent { silence, .. } => Err(silence.into()),
    }
}

/// When a capture has enough.
#[derive(Debug, Clone, Copy)]
enum Until {
    /// So many samples.
    Count(u32),
    /// So many samples of stillness, a turn with ramps of this time, and so many samples again.
    Turned { ramp_s: f64, before: usize, after: usize },
}

/// The samples of the current capture so far.
struct CaptureBuffer<'a> {
    about: &'a CaptureHead,
    watch: Watch,
    /// Raw samples; or the compensated ones as a perfect sensor would give them, for guidance and checks.
    samples: Vec<ImuSample>,
    /// The compensated samples, if they are captured.
    compensated: Option<Vec<CompensatedSample>>,
    first_us: Option<u64>,
    clock: ClockWatch,
}

impl CaptureBuffer<'_> {
    /// Decodes the samples of a frame, as many as there is room for, to the end of the capture. Returns them as a piece
    /// of the file. The thread that writes the file needs its own copy, since the capture goes on growing.
    fn decode(&mut self, frame: &SampleFrame, room: usize) -> Result<Piece, ProcedureError> {
        let (first, board_time_us, rate_hz) = (frame.head.first, frame.head.board_time_us, self.about.rate_hz);
        let Some(compensated) = &mut self.compensated else {
            let samples = append(&mut self.samples, frame, room)?.to_vec();
            return Ok(Piece::Imu { first, board_time_us, rate_hz, samples });
        };
        let samples = append(compensated, frame, room)?.to_vec();
        self.samples.extend(samples.iter().map(compensated::nominal));
        Ok(Piece::Compensated { first, board_time_us, rate_hz, samples })
    }
}

/// Decodes the samples of a frame, as many as there is room for, to the end of a list. Returns the new ones.
fn append<'s, S: Wire>(all: &'s mut Vec<S>, frame: &SampleFrame, room: usize) -> Result<&'s [S], ProcedureError> {
    let had = all.len();
    let mut reader = FieldReader::new(&frame.samples);
    for _ in 0..usize::from(frame.head.count).min(room) {
        let sample = S::get(&mut reader);
        all.push(sample.map_err(|error| ProcedureError::Nonsense { what: "the IMU stream", why: error.to_string() })?);
    }
    Ok(&all[had..])
}
