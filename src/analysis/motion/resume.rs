//! The rest of a program whose first captures were made before.

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

impl MotionProgram {
    /// Returns the actions that are left where `has` knows of captures. The captures are taken up to the first missing
    /// one. From there on the module is laid down again. Where the program switches the module off between series, the
    /// interrupted series begins anew, since its captures must belong to one power-on.
    pub fn after(&self, has: impl Fn(&CaptureHead) -> bool) -> Vec<ResumeAction<'_>> {
        let missing = self.steps.iter().position(|step| step.about().is_some_and(|about| !has(about)));
        let Some(missing) = missing else {
            return self.steps.iter().filter(|step| step.about().is_some()).map(ResumeAction::Take).collect();
        };
        let before = &self.steps[..missing];
        let last = |wanted: fn(&MotionStep) -> bool| before.iter().rposition(wanted);
        let is_lay = |step: &MotionStep| matches!(step, MotionStep::Lay(_));
        let cycle = last(|step| matches!(step, MotionStep::PowerCycle { .. }));
        let start = cycle.or(last(is_lay)).unwrap_or(0);
        let (done, left) = self.steps.split_at(start);
        let taken = done.iter().filter(|step| step.about().is_some()).map(ResumeAction::Take);
        // The present orientation of the module is unknown.
        let lay = done.iter().rfind(|step| is_lay(step)).filter(|_| start > 0 && !left.first().is_some_and(is_lay));
        let left = left.iter().map(|step| match step.about() {
            Some(about) if cycle.is_none() && has(about) => ResumeAction::Take(step),
            _ => ResumeAction::Do(step),
        });
        taken.chain(lay.map(ResumeAction::Do)).chain(left).collect()
    }
}
