//! The rest of a program whose first captures were made before.

use std::ptr;

use super::{MotionProgram, MotionStep};
use crate::capture::CaptureHead;

/// What happens to a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ResumeAction<'a> {
    /// The station carries it out.
    Do(&'a MotionStep),
    /// Its capture exists already.
    Take(&'a MotionStep),
}

impl<'a> ResumeAction<'a> {
    /// Returns the step.
    #[must_use]
    pub fn step(self) -> &'a MotionStep {
        let (Self::Do(step) | Self::Take(step)) = self;
        step
    }
}

/// A table comes to rest, where the program does not say so at that place.
const STOP: &MotionStep = &MotionStep::Stop;

impl MotionProgram {
    /// Returns the actions that are left where `has` knows of captures. A motion whose captures all exist is left out. For
    /// the first missing capture the module is laid down again, since its present orientation is unknown. Where the
    /// program switches the module off between series, the interrupted series begins anew, since its captures must belong
    /// to one power-on.
    pub fn after(&self, has: impl Fn(&CaptureHead) -> bool) -> Vec<ResumeAction<'_>> {
        let missing = self.steps.iter().position(|step| step.about().is_some_and(|about| !has(about)));
        let Some(missing) = missing else {
            return self.steps.iter().filter(|step| step.about().is_some()).map(ResumeAction::Take).collect();
        };
        if !self.steps.iter().any(|step| step.about().is_some_and(&has)) {
            return self.steps.iter().map(ResumeAction::Do).collect();
        }
        let cycle = self.steps[..missing].iter().rposition(|step| matches!(step, MotionStep::PowerCycle { .. }));
        let mut rest = Rest::default();
        for (place, step) in self.steps.iter().enumerate() {
            let again = cycle.is_some_and(|cycle| place >= cycle);
            match step {
                MotionStep::Lay(_) => rest.wanted = Stand { lay: Some(step), ..Stand::default() },
                MotionStep::Spin { .. } => rest.wanted = Stand { spin: Some(step), settle: None, ..rest.wanted },
                MotionStep::Stop => rest.wanted = Stand { spin: None, settle: None, ..rest.wanted },
                MotionStep::Settle { .. } => rest.wanted.settle = Some(step),
                // The power cycles of series that exist are over.
                MotionStep::PowerCycle { .. } if cycle.is_some() && !again => {}
                MotionStep::PowerCycle { .. } => {
                    if !lies_elsewhere_next(&self.steps[place..]) {
                        rest.take_up();
                    }
                    rest.actions.push(ResumeAction::Do(step));
                }
                MotionStep::Capture { about, .. }
                | MotionStep::Turn { about, .. }
                | MotionStep::Receiver { about, .. } => {
                    if has(about) && !again {
                        rest.actions.push(ResumeAction::Take(step));
                    } else {
                        rest.take_up();
                        rest.actions.push(ResumeAction::Do(step));
                    }
                }
            }
        }
        if rest.now.spin.is_some() && rest.wanted.spin.is_none() {
            rest.actions.push(ResumeAction::Do(STOP));
        }
        rest.actions
    }
}

/// Whether the module is laid down before the next capture of these steps.
fn lies_elsewhere_next(steps: &[MotionStep]) -> bool {
    let next = steps.iter().find(|step| step.about().is_some() || matches!(step, MotionStep::Lay(_)));
    matches!(next, Some(MotionStep::Lay(_)))
}

/// How module and table stand: the steps that brought them there.
#[derive(Debug, Clone, Copy, Default)]
struct Stand<'a> {
    lay: Option<&'a MotionStep>,
    spin: Option<&'a MotionStep>,
    /// The pause after the last motion.
    settle: Option<&'a MotionStep>,
}

/// The actions so far.
#[derive(Debug, Default)]
struct Rest<'a> {
    actions: Vec<ResumeAction<'a>>,
    /// How module and table stand after these actions.
    now: Stand<'a>,
    /// How the program wants them to stand.
    wanted: Stand<'a>,
}

impl Rest<'_> {
    /// Brings module and table to where the program wants them.
    fn take_up(&mut self) {
        let moved = !same(self.now.lay, self.wanted.lay);
        if self.now.spin.is_some() && (moved || !same(self.now.spin, self.wanted.spin)) {
            self.actions.push(ResumeAction::Do(STOP));
            self.now.spin = None;
        }
        let lay = self.wanted.lay.filter(|_| moved);
        let spin = self.wanted.spin.filter(|_| self.now.spin.is_none());
        let settle = self.wanted.settle.take();
        self.actions.extend([lay, spin, settle].into_iter().flatten().map(ResumeAction::Do));
        (self.now.lay, self.now.spin) = (self.wanted.lay, self.wanted.spin);
    }
}

/// Whether both are the same step of the program.
fn same(one: Option<&MotionStep>, other: Option<&MotionStep>) -> bool {
    match (one, other) {
        (Some(one), Some(other)) => ptr::eq(one, other),
        (one, other) => one.is_none() && other.is_none(),
    }
}
