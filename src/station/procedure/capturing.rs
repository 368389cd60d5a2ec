//! Carries out a motion program: lays the module down, turns it, and files what the sensors say meanwhile.

mod losses;
mod receiver;

use std::time::Duration;

use gnc_protocol::message::{ModulePower, StreamStart};
use gnc_protocol::stream::{ImuSample, StreamFrame, StreamId};
use gnc_protocol::wire::{Reader, Wire as _};

use super::{Bench, Report, Trouble};
use crate::board::stream::{Closed, Losses, Stream};
use crate::capture::{About, Capture, Pose, Receiver};
use crate::guidance::Course;
use crate::motion::watch::{TURN_PART, TurnWatch, Watch, turned_deg};
use crate::motion::{Action, Count, Program, REST_BEFORE_S, Step, Uses};
use crate::raw::{Piece, pieces};
use crate::store::RawFile;
use crate::turntable::{self, Turntable};

/// A turn that takes longer than so many times its span, and so many seconds, is not the one that was asked for.
const LONGEST_TURN: f64 = 2.0;
const SLACK_S: f64 = 60.0;
/// Room that is kept ready for the samples of a turn, whose end nobody knows beforehand.
const TURN_ROOM: usize = 1 << 14;

/// Carries out a program and gives what was captured. The samples are on disk when it comes back.
///
/// # Errors
/// [`Trouble`]; what was captured up to then is on disk.
pub(super) async fn run(program: &Program, bench: &Bench<'_>, report: &Report<'_>) -> Result<Vec<Capture>, Trouble> {
    let table = turntable::of(bench.fixture, report);
    let table = table.as_ref();
    let taken = taken(bench, report).await?;
    let course = Course::new(program, bench.board, bench.guide);
    let mut captor = Captor { bench, report, table, raw: report.raw()?, captures: Vec::new(), course };
    let mut over = 0;
    for action in program.after(|about| taken.iter().any(|capture| capture.about == *about)) {
        match action {
            Action::Do(step) => captor.carry_out(step).await?,
            Action::Take(step) => {
                let found = taken.iter().find(|capture| step.about() == Some(&capture.about));
                captor.take_over(found).await?;
                over += 1;
            }
        }
        captor.course.ended(action.step());
    }
    if over > 0 {
        report.note(&format!("taken over from the run that broke off: {}", Count(over, "capture"))).await?;
    }
    captor.course.works_out();
    captor.raw.finish().await?;
    Ok(captor.captures)
}

/// What an earlier run captured of this item, read beside the conversation with the board.
async fn taken(bench: &Bench<'_>, report: &Report<'_>) -> Result<Vec<Capture>, Trouble> {
    let Some(resumed) = bench.resumed else { return Ok(Vec::new()) };
    let (resumed, item) = (resumed.clone(), report.item().to_owned());
    match tokio::task::spawn_blocking(move || resumed.captures(&item)).await {
        Ok(captures) => Ok(captures?),
        Err(_) => Err(Trouble::Analysis { why: "reading the earlier captures came to grief".into() }),
    }
}

struct Captor<'a> {
    bench: &'a Bench<'a>,
    report: &'a Report<'a>,
    table: &'a (dyn Turntable + 'a),
    raw: RawFile,
    captures: Vec<Capture>,
    course: Course<'a>,
}

impl Captor<'_> {
    async fn carry_out(&mut self, step: &Step) -> Result<(), Trouble> {
        self.course.begins(step);
        match step {
            Step::Lay(lie) => self.table.lay(*lie).await,
            Step::Settle { span_s } => self.table.pause(Duration::from_secs_f64(*span_s)).await,
            Step::Spin { rate_dps } => self.table.spin(*rate_dps).await,
            Step::Stop => self.table.stop().await,
            Step::Capture { about, span_s, uses } => {
                let wanted = (span_s * f64::from(about.rate_hz)).round().max(1.0) as u32;
                self.capture(about, *uses, Until::Count(wanted)).await
            }
            Step::Turn { about, rest_s } => {
                let rest = |span_s: f64| (span_s * f64::from(about.rate_hz)).ceil() as usize;
                let (before, after) = (rest(REST_BEFORE_S), rest(*rest_s));
                self.capture(about, Uses::Gyro, Until::Turned { before, after }).await?;
                self.turned(before)
            }
            Step::PowerCycle { off_s } => self.power_cycle(*off_s).await,
            Step::Receiver { about, timeout_s, span_s } => {
                receiver::capture(self, about, *timeout_s, *span_s).await
            }
        }
    }

    /// Files what was captured before.
    async fn take_over(&mut self, capture: Option<&Capture>) -> Result<(), Trouble> {
        let Some(capture) = capture else { return Ok(()) };
        for piece in pieces(capture) {
            self.raw.write(piece).await?;
        }
        self.captures.push(capture.clone());
        Ok(())
    }

    async fn capture(&mut self, about: &About, uses: Uses, until: Until) -> Result<(), Trouble> {
        let board = self.bench.board;
        let mut stream = board.listen(StreamId::Imu).await?;
        let count = if let Until::Count(count) = until { count } else { 0 };
        let start = StreamStart { stream: StreamId::Imu as u8, rate_hz: about.rate_hz, count, samples_per_frame: 0 };
        board.call(&start).await?;
        let still = matches!(about.pose, Pose::Still { .. });
        let room = if count > 0 { count as usize } else { TURN_ROOM };
        let mut taker = Taker {
            about,
            watch: Watch::new(uses, still, about.rate_hz),
            samples: Vec::with_capacity(room),
            first_us: None,
        };
        let taken = self.take(&mut taker, &mut stream, until).await;
        let end_us = stream.board_time_us();
        let losses = stream.losses();
        let closed = match &taken {
            // The session may be gone; then there is nobody to ask.
            Err(Trouble::Board(_)) => Ok(Closed { produced: 0, losses }),
            _ => board.stop_stream(stream).await,
        };
        let span_s = taker.samples.len() as f64 / f64::from(about.rate_hz.max(1));
        board.spent(Duration::from_secs_f64(span_s));
        let Taker { samples, first_us, .. } = taker;
        // What came after the last sample is no part of the capture.
        let losses = if losses.any() { losses } else { Losses { received: samples.len() as u32, ..losses } };
        if first_us.is_none() {
            self.raw.write(Piece::Begin { about: about.clone(), board_time_us: end_us }).await?;
        }
        if taken.is_ok() || losses.any() {
            self.raw.write(Piece::End { losses, board_time_us: end_us }).await?;
        }
        taken?;
        closed?;
        let (about, first_us) = (about.clone(), first_us.unwrap_or(end_us));
        self.captures.push(Capture { about, first_us, samples, losses, receiver: Receiver::default() });
        Ok(())
    }

    /// Takes samples until there are enough, or something is wrong with them.
    async fn take(&mut self, taker: &mut Taker<'_>, stream: &mut Stream, until: Until) -> Result<(), Trouble> {
        let rate_hz = taker.about.rate_hz;
        let table = self.table;
        let (before, after) = match until {
            Until::Count(count) => {
                while taker.samples.len() < count as usize {
                    self.frame(taker, stream, count).await?;
                }
                return Ok(());
            }
            Until::Turned { before, after } => (before, after),
        };
        let Pose::Rotating { axis, angle_deg, span_s, .. } = taker.about.pose else { return Ok(()) };
        while taker.samples.len() < before {
            self.frame(taker, stream, 0).await?;
        }
        let mut rest = TurnWatch::new(axis, rate_hz, &taker.samples);
        // The samples come later than the motion, so that they say when it is over; but not before the table does.
        let longest = before + ((span_s * LONGEST_TURN + SLACK_S) * f64::from(rate_hz)) as usize;
        let turn = table.rotate(angle_deg, span_s);
        tokio::pin!(turn);
        let mut done = false;
        while !(done && rest.look(&taker.samples).is_some_and(|still| taker.samples.len() >= still + after)) {
            {
                // A frame that is being filed is never given up for the word that the turn is over.
                let frame = self.frame(taker, stream, 0);
                tokio::pin!(frame);
                tokio::select! {
                    biased;
                    taken = &mut frame => taken?,
                    turned = &mut turn, if !done => {
                        turned?;
                        done = true;
                        frame.await?;
                    }
                }
            }
            if done && taker.samples.len() > longest + after {
                // What was seen instead is told by its angle.
                return Ok(());
            }
        }
        Ok(())
    }

    /// Takes the next frame: files it, looks at it.
    async fn frame(&mut self, taker: &mut Taker<'_>, stream: &mut Stream, wanted: u32) -> Result<(), Trouble> {
        let about = taker.about;
        let Some(frame) = stream.next().await? else {
            return Err(losses::silent(about, taker.samples.len(), wanted, stream.losses()));
        };
        let mut samples = samples_of(&frame)?;
        let board_time_us = frame.head.board_time_us;
        if taker.first_us.is_none() {
            taker.first_us = Some(board_time_us);
            self.raw.write(Piece::Begin { about: about.clone(), board_time_us }).await?;
        }
        if wanted > 0 {
            samples.truncate((wanted as usize).saturating_sub(taker.samples.len()));
        }
        // What comes behind a gap is evidence of it.
        let (first, rate_hz) = (frame.head.first, about.rate_hz);
        self.raw.write(Piece::Imu { first, board_time_us, rate_hz, samples: samples.clone() }).await?;
        if stream.losses().any() {
            return Err(losses::gap(about, taker.samples.len(), stream.losses()));
        }
        let looked = taker.watch.look(&samples);
        let had = taker.samples.len();
        self.course.took(&samples);
        taker.samples.extend(samples);
        self.course.captured(taker.samples.len() as f64 / f64::from(rate_hz.max(1)));
        looked.map_err(|(index, spoilt)| {
            let at_s = (had + index) as f64 / f64::from(rate_hz.max(1));
            Trouble::Spoilt { label: about.label.clone(), at_s, spoilt }
        })
    }

    /// Whether the module turned as it should, by the gyroscope of the axis.
    fn turned(&self, before: usize) -> Result<(), Trouble> {
        let Some(capture) = self.captures.last() else { return Ok(()) };
        let Pose::Rotating { axis, angle_deg, .. } = capture.about.pose else { return Ok(()) };
        let seen_deg = turned_deg(&capture.samples, axis, capture.about.rate_hz, before);
        if (seen_deg - angle_deg).abs() <= TURN_PART * angle_deg.abs() {
            return Ok(());
        }
        Err(Trouble::NotTurned { label: capture.about.label.clone(), wanted_deg: angle_deg, seen_deg })
    }

    async fn power_cycle(&mut self, off_s: f64) -> Result<(), Trouble> {
        let board = self.bench.board;
        board.call(&ModulePower { on: 0 }).await?;
        self.report.powered(false, None).await?;
        let waited = self.table.pause(Duration::from_secs_f64(off_s)).await;
        // On again whatever comes: other items expect it.
        let supply = board.call(&ModulePower { on: 1 }).await?;
        self.report.powered(true, Some((supply.supply_uv, supply.supply_ua))).await?;
        waited
    }
}

/// When a capture has enough.
#[derive(Debug, Clone, Copy)]
enum Until {
    /// So many samples.
    Count(u32),
    /// So many samples of stillness, a turn, and so many again.
    Turned { before: usize, after: usize },
}

/// What was taken of the capture that goes on.
struct Taker<'a> {
    about: &'a About,
    watch: Watch,
    samples: Vec<ImuSample>,
    first_us: Option<u64>,
}

fn samples_of(frame: &StreamFrame) -> Result<Vec<ImuSample>, Trouble> {
    let mut reader = Reader::new(&frame.samples);
    (0..frame.head.count)
        .map(|_| ImuSample::get(&mut reader))
        .collect::<Result<Vec<_>, _>>()
        .map_err(|error| Trouble::Nonsense { what: "the IMU stream", why: error.to_string() })
}
