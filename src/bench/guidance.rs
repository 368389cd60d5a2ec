//! Guidance: what people see of an item that captures. It shows how the module lies and turns, which capture of how
//! many is under way, how long it still takes, and pictures that grow with the samples. It never decides a verdict, and
//! some of it may be skipped.
//!
//! Guidance is worked out as the samples pass by, in bounded time and memory, and only if a person watches.

pub mod allan;
pub mod field;
pub mod heat;

use std::sync::Arc;
use std::time::{Duration, Instant};

use gnc_analysis::capture::Pose;
use gnc_analysis::heat::Warmth;
use gnc_analysis::motion::{MotionProgram, MotionStep, Uses};
use gnc_board::BoardLease;
use gnc_protocol::stream::ImuSample;
use gnc_rig::Orientation;
use tokio::sync::watch;

use allan::{AllanSoFar, AllanView};
use field::{FieldSoFar, FieldView};
use heat::{HeatSoFar, HeatView};

/// Interval at which guidance is handed on while samples come. A screen draws 30 times a second.
const EVERY: Duration = Duration::from_millis(50);
/// Interval of the pictures. An eye follows five steps a second, and each picture needs a fit of an ellipse.
const PICTURE_EVERY: Duration = Duration::from_millis(200);
/// A still capture at least this long shows its Allan deviations; shorter ones end before a flat part is seen.
const ALLAN_FROM_S: f64 = 600.0;

/// A program of captures under way.
#[derive(Debug, Clone, PartialEq)]
pub struct Guidance {
    /// All captures of the program, in its order.
    pub captures: Arc<[Planned]>,
    /// How many of them are finished. The next one is under way or comes next.
    pub finished: usize,
    /// The captures that are taken over from an earlier run, by their names.
    pub taken: Arc<[String]>,
    /// How the module lies, once it is laid down.
    pub orientation: Option<Orientation>,
    /// What happens now.
    pub stage: Stage,
    /// Board time of the current capture so far.
    pub captured_s: f64,
    /// Bench time of the finished captures that a resumed run would make again with the current one.
    pub joined_s: f64,
    /// Which captures that are: those since the last power-on, or all.
    joined: Joined,
    /// Bench time of the captures that a resumed run would make again of the item's earlier rounds in this attempt.
    rounds_s: f64,
    /// Bench time of the finished steps.
    pub done_s: f64,
    /// Bench time of all steps.
    pub whole_s: f64,
    /// The temperatures of the sensors over the captures so far; `None` before the first mean.
    pub heat: Option<HeatView>,
    /// What the samples of the current capture show so far, if they make a picture.
    pub picture: Option<Picture>,
}

/// The captures that stay together in a resumed run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Joined {
    /// Each capture stands for itself.
    None,
    /// Those since the last power-on, until all exist.
    Series,
    /// All: the module compensates them with coefficients that may be others then.
    All,
}

/// What the samples of a capture show so far.
#[derive(Debug, Clone, PartialEq)]
pub enum Picture {
    /// The field across the axis of a spin.
    Field(Arc<FieldView>),
    /// Allan deviations of a long rest.
    Allan(Arc<AllanView>),
}

/// A capture as it was planned.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// Its name within the attempt.
    pub label: String,
    /// How the module lies or moves.
    pub pose: Pose,
    /// Board time that it takes.
    pub span_s: f64,
}

/// What happens now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stage {
    /// The module is laid down.
    Laying,
    /// The module and table rest for a time before a capture.
    Settling {
        /// Bench time.
        span_s: f64,
    },
    /// Samples are taken.
    Capturing,
    /// The table speeds up to its rate.
    SpinningUp {
        /// Right-handed about the axis along the table's.
        rate_dps: f64,
    },
    /// The table comes to rest.
    Stopping,
    /// The module is without power for a time.
    PoweredOff {
        /// Bench time.
        span_s: f64,
    },
    /// A resumed run waits until the module is as warm as it was.
    Warming(Warmth),
    /// All captures are taken, and the figures are worked out.
    WorkingOut,
}

impl Guidance {
    /// The state at the start of a program.
    #[must_use]
    pub fn new(program: &MotionProgram) -> Self {
        let planned = |step: &MotionStep| {
            let about = step.about()?;
            Some(Planned { label: about.label.clone(), pose: about.pose.clone(), span_s: step.span_s() })
        };
        Self {
            captures: program.steps.iter().filter_map(planned).collect(),
            finished: 0,
            taken: Arc::new([]),
            orientation: None,
            stage: Stage::Laying,
            captured_s: 0.0,
            joined_s: 0.0,
            rounds_s: 0.0,
            joined: if program.steps.iter().any(compensates) { Joined::All } else { Joined::None },
            done_s: 0.0,
            whole_s: program.span_s(),
            heat: None,
            picture: None,
        }
    }

    /// The state at the start of the next round of an item that repeats its program. `last` is how the round before ended.
    fn round_after(program: &MotionProgram, last: Option<&Self>) -> Self {
        Self { rounds_s: last.map_or(0.0, Self::lost_s), ..Self::new(program) }
    }

    /// Begins a step.
    pub fn begin(&mut self, step: &MotionStep) {
        if matches!(step, MotionStep::PowerCycle { .. }) {
            (self.joined, self.joined_s) = (Joined::Series, 0.0);
        }
        self.stage = match step {
            MotionStep::Lay(orientation) => {
                self.orientation = Some(*orientation);
                Stage::Laying
            }
            MotionStep::Settle { span_s } => Stage::Settling { span_s: *span_s },
            MotionStep::Capture { .. } | MotionStep::Turn { .. } | MotionStep::Receiver { .. } => Stage::Capturing,
            MotionStep::Spin { rate_dps } => Stage::SpinningUp { rate_dps: *rate_dps },
            MotionStep::Stop => Stage::Stopping,
            MotionStep::PowerCycle { off_s } => Stage::PoweredOff { span_s: *off_s },
        };
    }

    /// Ends a step, or passes over a step whose capture exists already.
    pub fn end(&mut self, step: &MotionStep) {
        self.finished += usize::from(step.about().is_some());
        if step.about().is_some() && self.joined != Joined::None {
            self.joined_s += step.span_s();
        }
        if self.joined == Joined::Series && self.finished == self.captures.len() {
            self.joined_s = 0.0;
        }
        self.captured_s = 0.0;
        self.done_s += step.span_s();
    }

    /// Whether a capture of the program exists: it is finished, or taken over from an earlier run.
    #[must_use]
    pub fn exists(&self, index: usize) -> bool {
        let taken = || self.captures.get(index).is_some_and(|planned| self.taken.contains(&planned.label));
        index < self.finished || taken()
    }

    /// Number of captures that exist.
    #[must_use]
    pub fn existing(&self) -> usize {
        (0..self.captures.len()).filter(|index| self.exists(*index)).count()
    }

    /// Whether no capture is under way yet, since those of an earlier run are taken over and the module warms up first.
    #[must_use]
    pub fn waits_to_go_on(&self) -> bool {
        let not_begun = self.stage == Stage::Laying && self.finished == 0 && self.orientation.is_none();
        self.warmth().is_some() || (not_begun && !self.taken.is_empty())
    }

    /// The current capture, or the next one.
    #[must_use]
    pub fn present(&self) -> Option<&Planned> {
        self.captures.get(self.finished)
    }

    /// Board time that the current capture still needs.
    #[must_use]
    pub fn capture_left_s(&self) -> f64 {
        self.present().map_or(0.0, |planned| (planned.span_s - self.captured_s).max(0.0))
    }

    /// How a wait for the module's heat stands, if the station waits for it.
    #[must_use]
    pub fn warmth(&self) -> Option<Warmth> {
        match self.stage {
            Stage::Warming(warmth) => Some(warmth),
            _ => None,
        }
    }

    /// Bench time of captures that would be lost if the run were stopped now: a resumed run cannot take them over.
    #[must_use]
    pub fn lost_s(&self) -> f64 {
        self.rounds_s + self.joined_s + self.captured_s
    }

    /// Bench time that the program still needs.
    #[must_use]
    pub fn left_s(&self) -> f64 {
        (self.whole_s - self.done_s - self.captured_s).max(0.0)
    }

    /// Sense of the current turn about the table's axis: positive is right-handed about the module's axis there.
    #[must_use]
    pub fn turn(&self) -> Option<f64> {
        let sense = match (self.stage, self.present().map(|planned| &planned.pose)) {
            (Stage::SpinningUp { rate_dps }, _) => rate_dps,
            (Stage::WorkingOut | Stage::Laying | Stage::PoweredOff { .. } | Stage::Stopping | Stage::Warming(_), _) => {
                return None;
            }
            (_, Some(Pose::Spinning { rate_dps, .. })) => *rate_dps,
            (Stage::Capturing, Some(Pose::Rotating { angle_deg, .. })) => *angle_deg,
            _ => return None,
        };
        Some(sense.signum())
    }
}

/// Collects what the samples of a capture show.
#[derive(Debug)]
enum Collected {
    Field(FieldSoFar),
    Allan(AllanSoFar),
}

impl Collected {
    /// The collector for the samples of a step; `None` if they make no growing picture.
    fn of(step: &MotionStep) -> Option<Self> {
        match step {
            MotionStep::Capture { about, span_s, uses } => match (&about.pose, uses) {
                (Pose::Spinning { axis, .. }, Uses::Magnetometer) => Some(Self::Field(FieldSoFar::new(*axis))),
                (Pose::Still { .. }, Uses::Inertial) if *span_s >= ALLAN_FROM_S => {
                    Some(Self::Allan(AllanSoFar::new(about.rate_hz)))
                }
                _ => None,
            },
            _ => None,
        }
    }

    fn take(&mut self, samples: &[ImuSample]) {
        match self {
            Self::Field(field) => field.take(samples),
            Self::Allan(allan) => allan.take(samples),
        }
    }

    fn look(&self) -> Picture {
        match self {
            Self::Field(field) => Picture::Field(Arc::new(field.look())),
            Self::Allan(allan) => Picture::Allan(Arc::new(allan.look())),
        }
    }
}

/// Hands guidance on to those who watch an item.
#[derive(Debug)]
pub(crate) struct Guide {
    out: watch::Sender<Option<Arc<Guidance>>>,
    watched: bool,
}

impl Guide {
    /// Returns the guide of an attempt and the receiver to watch it. Pictures are made only if they are watched.
    #[must_use]
    pub(crate) fn new(watched: bool) -> (Self, watch::Receiver<Option<Arc<Guidance>>>) {
        let (out, seen) = watch::channel(None);
        (Self { out, watched }, seen)
    }
}

/// The way through a program. The code that carries the program out reports each step.
#[derive(Debug)]
pub(crate) struct Course<'a> {
    lease: &'a BoardLease<'a>,
    guide: &'a Guide,
    now: Guidance,
    collected: Option<Collected>,
    heat: HeatSoFar,
    handed_on: Option<Instant>,
    drawn: Option<Instant>,
}

impl<'a> Course<'a> {
    /// The state at the start of a program, which may be that of a later round of the attempt.
    pub(crate) fn new(program: &MotionProgram, lease: &'a BoardLease<'a>, guide: &'a Guide) -> Self {
        let now = Guidance::round_after(program, guide.out.borrow().as_deref());
        Self { lease, guide, now, collected: None, heat: HeatSoFar::default(), handed_on: None, drawn: None }
    }

    /// Begins a step.
    pub(crate) fn begins(&mut self, step: &MotionStep) {
        self.now.begin(step);
        if let Some(about) = step.about() {
            self.heat.begin(about.rate_hz);
        }
        self.collected = Collected::of(step).filter(|_| self.guide.watched);
        if self.collected.is_some() {
            // The picture of the previous capture stays in sight until a new picture begins.
            self.now.picture = None;
        }
        self.hand_on(true);
    }

    /// Takes samples of the current capture.
    pub(crate) fn took(&mut self, samples: &[ImuSample]) {
        if self.guide.watched {
            self.heat.take(samples);
            self.now.heat = self.heat.view();
        }
        let Some(collected) = &mut self.collected else { return };
        collected.take(samples);
        let now = Instant::now();
        if self.drawn.is_none_or(|before| now - before >= PICTURE_EVERY) {
            self.drawn = Some(now);
            self.now.picture = Some(collected.look());
        }
    }

    /// The current capture has so much board time.
    pub(crate) fn captured(&mut self, span_s: f64) {
        self.now.captured_s = span_s;
        self.hand_on(false);
    }

    /// Ends a step, or passes over a step whose capture exists already.
    pub(crate) fn ended(&mut self, step: &MotionStep) {
        if let Some(collected) = self.collected.take() {
            self.now.picture = Some(collected.look());
        }
        self.now.end(step);
        self.hand_on(false);
    }

    /// Passes over steps that take so long, since their captures, of these names, exist already.
    pub(crate) fn passes_over(&mut self, span_s: f64, taken: &[String]) {
        self.now.done_s += span_s;
        if !taken.is_empty() {
            self.now.taken = taken.into();
            self.hand_on(true);
        }
    }

    /// The station waits until the module is as warm as it was.
    pub(crate) fn warms(&mut self, warmth: Warmth) {
        self.now.stage = Stage::Warming(warmth);
        self.hand_on(true);
    }

    /// All steps are over.
    pub(crate) fn works_out(&mut self) {
        self.now.stage = Stage::WorkingOut;
        self.hand_on(true);
    }

    fn hand_on(&mut self, at_once: bool) {
        let Guidance { done_s, captured_s, whole_s, .. } = self.now;
        self.lease.advanced(done_s + captured_s, whole_s);
        let now = Instant::now();
        if at_once || self.handed_on.is_none_or(|before| now - before >= EVERY) {
            self.handed_on = Some(now);
            self.guide.out.send_replace(Some(Arc::new(self.now.clone())));
        }
    }
}

fn compensates(step: &MotionStep) -> bool {
    matches!(
        step,
        MotionStep::Capture { uses: Uses::Compensated, .. } | MotionStep::Turn { uses: Uses::Compensated, .. }
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use gnc_analysis::capture::CaptureHead;
    use gnc_analysis::motion::Uses;
    use gnc_rig::Along;

    fn about(label: &str, pose: Pose) -> CaptureHead {
        CaptureHead { label: label.into(), series: 1, pose, rate_hz: 100 }
    }

    fn program() -> MotionProgram {
        let up = [0.0, 0.0, 1.0];
        let orientation = Orientation::Axis { axis: 2, positive: true, along: Along::Up, heading_deg: 0.0 };
        let still = about("z+", Pose::Still { up, heading_deg: 0.0 });
        let turn = Pose::Rotating { axis: 2, angle_deg: -90.0, span_s: 3.0, along: Along::Up };
        MotionProgram {
            steps: vec![
                MotionStep::Lay(orientation),
                MotionStep::Settle { span_s: 10.0 },
                MotionStep::Capture { about: still, span_s: 60.0, uses: Uses::Inertial },
                MotionStep::Turn { about: about("z-", turn), ramp_s: 0.5, rest_s: 1.0, uses: Uses::Gyro },
            ],
        }
    }

    /// Worked out by hand: 10 s of settling, 60 s of capture, a turn of 3 s with 1 s of stillness before and after.
    #[test]
    fn what_is_done_and_what_is_still_to_go() {
        let program = program();
        let mut now = Guidance::new(&program);
        assert_eq!((now.finished, now.left_s(), now.captures.len()), (0, 75.0, 2));
        for step in &program.steps[..2] {
            now.begin(step);
            now.end(step);
        }
        now.begin(&program.steps[2]);
        now.captured_s = 20.0;
        assert_eq!((now.stage, now.capture_left_s(), now.left_s()), (Stage::Capturing, 40.0, 45.0));
        assert_eq!(now.turn(), None, "it lies still");
        now.end(&program.steps[2]);
        now.begin(&program.steps[3]);
        assert_eq!((now.finished, now.left_s(), now.turn()), (1, 5.0, Some(-1.0)));
        // After a turn that takes too long the remaining time is 0 and not negative.
        now.captured_s = 9.0;
        assert_eq!((now.capture_left_s(), now.left_s()), (0.0, 0.0));
        now.end(&program.steps[3]);
        assert_eq!((now.finished, now.present(), now.turn()), (2, None, None));
    }

    /// Worked out by hand: a capture of 60 s that is under way, series of two captures, and captures that the module compensates.
    #[test]
    fn what_a_stop_would_lose() {
        let capture = |label: &str, uses| {
            let up = [0.0, 0.0, 1.0];
            MotionStep::Capture { about: about(label, Pose::Still { up, heading_deg: 0.0 }), span_s: 60.0, uses }
        };
        let lost = |steps: &[MotionStep]| {
            let program = MotionProgram { steps: steps.to_vec() };
            let mut now = Guidance::new(&program);
            let mut lost = Vec::new();
            for step in &program.steps {
                now.begin(step);
                if step.about().is_some() {
                    now.captured_s = 20.0;
                    lost.push(now.lost_s());
                }
                now.end(step);
            }
            lost.push(now.lost_s());
            lost
        };
        let alone = ["a", "b"].map(|label| capture(label, Uses::Inertial));
        assert_eq!(lost(&alone), [20.0, 20.0, 0.0]);
        let cycle = MotionStep::PowerCycle { off_s: 600.0 };
        let [a, b, c, d] = ["a", "b", "c", "d"].map(|label| capture(label, Uses::Inertial));
        assert_eq!(lost(&[cycle.clone(), a, b, cycle, c, d]), [20.0, 80.0, 20.0, 80.0, 0.0]);
        let compensated = ["a", "b"].map(|label| capture(label, Uses::Compensated));
        assert_eq!(lost(&compensated), [20.0, 80.0, 120.0]);
    }

    /// Worked out by hand: rounds of two captures of 60 s. A resumed run takes those over that stand for themselves, and makes
    /// those anew that the module compensates.
    #[test]
    fn a_stop_loses_the_rounds_that_are_done() {
        let capture = |label: &str, uses| {
            let up = [0.0, 0.0, 1.0];
            MotionStep::Capture { about: about(label, Pose::Still { up, heading_deg: 0.0 }), span_s: 60.0, uses }
        };
        for (uses, expected) in [(Uses::Inertial, [0.0, 0.0, 20.0]), (Uses::Compensated, [120.0, 240.0, 260.0])] {
            let program = MotionProgram { steps: ["a", "b"].map(|label| capture(label, uses)).to_vec() };
            let (guide, _seen) = Guide::new(false);
            let mut lost = Vec::new();
            for _ in 0..2 {
                let mut now = Guidance::round_after(&program, guide.out.borrow().as_deref());
                for step in &program.steps {
                    now.begin(step);
                    now.end(step);
                }
                lost.push(now.lost_s());
                guide.out.send_replace(Some(Arc::new(now)));
            }
            let mut third = Guidance::round_after(&program, guide.out.borrow().as_deref());
            third.begin(&program.steps[0]);
            third.captured_s = 20.0;
            lost.push(third.lost_s());
            assert_eq!(lost, expected, "{uses:?}");
        }
    }
}
