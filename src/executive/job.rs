//! A plan on a bench: what can be run, what is chosen, and what comes next.

use crate::catalogue::Device;
use crate::event::{PlannedItem, StopHow};
use crate::mistake::{Mistake, Mistakes};
use crate::outcome::{Cause, Outcome};
use crate::plan::{OnFail, Phase, Plan, PlanItem};
use crate::printable::quoted;
use crate::state::{Row, RunState};
use crate::suggest::nearest;

/// What a bench can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BenchAbilities {
    /// An RS-422 link to the slave board.
    pub rs422: bool,
    /// A CAN link to the slave board.
    pub can: bool,
    /// Somebody, or a fixture, who answers prompts.
    pub operator: bool,
}

impl BenchAbilities {
    /// Whether the bench has a device. Either link reaches the slave board.
    pub fn has(self, device: Device) -> bool {
        match device {
            Device::Slave => self.rs422 || self.can,
            Device::Rs422 => self.rs422,
            Device::Can => self.can,
            Device::Operator => self.operator,
        }
    }
}

/// A plan that a bench can run, with the items that were chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    plan: Plan,
    selection: Option<Vec<String>>,
    selected: Vec<bool>,
    missing: Vec<Option<Device>>,
}

/// What the runner does next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Next {
    /// Run this attempt of the item at this position of the plan.
    Run {
        /// Position in [`Plan::items`].
        item: usize,
        /// Attempt, from 1.
        attempt: u32,
    },
    /// Its last attempt is over: the item ends with this outcome.
    End {
        /// Position in [`Plan::items`].
        item: usize,
        /// Outcome of its last attempt.
        outcome: Outcome,
    },
    /// The item ends as skipped.
    Skip {
        /// Position in [`Plan::items`].
        item: usize,
        /// Why.
        cause: Cause,
    },
    /// Nothing can begin before an attempt that runs has ended.
    Wait,
    /// Nothing is left: the run ends with this outcome.
    Done {
        /// Outcome of the run.
        outcome: Outcome,
    },
}

impl Job {
    /// Checks a plan against a bench and a selection of item names.
    ///
    /// Setup and teardown belong to every selection. Items that are not selected need no device.
    ///
    /// # Errors
    /// Every item that the bench cannot run and the plan does not call optional, and every selected name that the plan
    /// does not have.
    pub fn new(plan: Plan, bench: BenchAbilities, only: Option<&[String]>) -> Result<Job, Mistakes> {
        let mut mistakes = Mistakes::default();
        for name in only.unwrap_or_default() {
            if !plan.items().iter().any(|item| item.name == *name) {
                mistakes.add(|| unknown_selection(&plan, name));
            }
        }
        if only.is_some_and(<[String]>::is_empty) {
            mistakes
                .add(|| Mistake::nowhere("no item is selected", "name at least one item, or leave the selection out"));
        }
        let selected: Vec<bool> = plan
            .items()
            .iter()
            .map(|item| item.phase != Phase::Test || only.is_none_or(|only| only.contains(&item.name)))
            .collect();
        let mut missing = Vec::with_capacity(plan.items().len());
        for (item, selected) in plan.items().iter().zip(&selected) {
            let device = item.devices().find(|device| *selected && !bench.has(*device));
            if let Some(device) = device
                && !item.optional
            {
                let what = format!("{} needs what this bench has not: {}", quoted(&item.name), device.as_str());
                mistakes.add(|| plan.mistake_at(item, what, device.hint()));
            }
            missing.push(device);
        }
        mistakes.or(Job { selection: only.map(<[String]>::to_vec), plan, selected, missing })
    }

    /// The plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The item at a position.
    pub fn item(&self, position: usize) -> Option<&PlanItem> {
        self.plan.items().get(position)
    }

    /// The chosen names, for the header of the run; `None` for the whole plan.
    pub fn selection(&self) -> Option<&[String]> {
        self.selection.as_deref()
    }

    /// The rows for `run_started`.
    pub fn planned(&self) -> Vec<PlannedItem> {
        let items = self.plan.items().iter().zip(&self.selected);
        items
            .map(|(item, selected)| PlannedItem {
                name: item.name.clone(),
                id: item.id,
                title: item.title().to_owned(),
                phase: item.phase,
                optional: item.optional,
                selected: *selected,
            })
            .collect()
    }

    /// What comes next if items run one after the other.
    ///
    /// Setup first, then tests, then teardown, each in the order of the plan. The runner turns the answer into events
    /// (`Run` into an attempt, `End` and `Skip` into `item_ended`, `Done` into `run_ended`), applies them, and asks
    /// again.
    pub fn next(&self, state: &RunState) -> Next {
        if state.in_flight() > 0 { Next::Wait } else { self.decide(state) }
    }

    /// What comes next if independent items may run at once: an item that shares no resource with one that runs.
    pub fn next_overlapping(&self, state: &RunState) -> Next {
        self.decide(state)
    }

    fn decide(&self, state: &RunState) -> Next {
        // Ends first: an attempt that is over may set others free.
        let over = |(position, row)| self.ended(state, position, self.item(position)?, row);
        if let Some(end) = state.begun().find_map(over) {
            return end;
        }
        let stop = state.stop().map(|(how, _)| how);
        let wanted = |phase: Phase| match stop {
            None => true,
            Some(StopHow::InOrder) => phase == Phase::Teardown,
            Some(StopHow::AtOnce) => false,
        };
        let mut current = None;
        for (position, item, row) in self.open(state).filter(|(_, item, _)| wanted(item.phase)) {
            // A phase begins when the one before it is over; the plan holds its items in the order of the phases.
            if *current.get_or_insert(item.phase) != item.phase {
                break;
            }
            if row.running().is_none()
                && let Some(next) = self.begin(state, position, item, row)
            {
                return next;
            }
        }
        if current.is_some() || state.in_flight() > 0 {
            return Next::Wait;
        }
        Next::Done { outcome: state.outcome_so_far() }
    }

    /// Items that are selected and have not ended.
    fn open<'a>(&'a self, state: &'a RunState) -> impl Iterator<Item = (usize, &'a PlanItem, &'a Row)> {
        let first = state.first_open();
        let rows = state.rows().get(first..).unwrap_or_default();
        let items = self.plan.items().get(first..).unwrap_or_default();
        (first..)
            .zip(items.iter().zip(rows))
            .map(|(position, (item, row))| (position, item, row))
            .filter(|(_, _, row)| row.planned.selected && !row.is_over())
    }

    /// The end of an item whose last attempt is over and is not tried again.
    fn ended(&self, state: &RunState, position: usize, item: &PlanItem, row: &Row) -> Option<Next> {
        let outcome = row.attempts.last()?.outcome?;
        let tried = u32::try_from(row.attempts.len()).unwrap_or(u32::MAX);
        let again = match outcome {
            Outcome::Errored => true,
            Outcome::Failed => item.retry_failed,
            _ => false,
        };
        let may_go_on = state.stop().is_none() || item.phase == Phase::Teardown;
        (!(again && tried < item.attempts && may_go_on)).then_some(Next::End { item: position, outcome })
    }

    /// The next attempt of an item, or why it is skipped; `None` while it must wait for others.
    fn begin(&self, state: &RunState, position: usize, item: &PlanItem, row: &Row) -> Option<Next> {
        if row.attempts.is_empty() {
            match self.precondition(state, position, item) {
                Condition::Good => {}
                Condition::Open => return None,
                Condition::Skip(cause) => return Some(Next::Skip { item: position, cause }),
            }
        }
        if state.begun().any(|(_, other)| other.running().is_some() && other.planned.id.excludes(item.id)) {
            return None;
        }
        let attempt = u32::try_from(row.attempts.len() + 1).unwrap_or(u32::MAX);
        Some(Next::Run { item: position, attempt })
    }

    fn precondition(&self, state: &RunState, position: usize, item: &PlanItem) -> Condition {
        if let Some(device) = self.missing.get(position).copied().flatten() {
            return Condition::Skip(Cause::DeviceMissing { device: device.as_str().to_owned() });
        }
        let rows = state.rows();
        if item.phase == Phase::Test
            && let Some(row) = state.stopper(self.plan.on_fail == OnFail::Stop)
        {
            let (item, outcome) = (row.planned.name.clone(), row.outcome);
            return Condition::Skip(match row.planned.phase {
                Phase::Setup => Cause::Setup { item, outcome },
                _ => Cause::StoppedAfter { item, outcome },
            });
        }
        let mut condition = Condition::Good;
        for row in item.requires.iter().filter_map(|required| rows.get(*required)) {
            // What was not chosen is not waited for: a selection is never a module's pass anyway.
            if !row.planned.selected || row.is_over() && row.outcome.is_good() {
                continue;
            }
            if row.is_over() {
                let (item, outcome) = (row.planned.name.clone(), row.outcome);
                return Condition::Skip(Cause::Precondition { item, outcome });
            }
            // After a stop nothing but teardown begins, so that waiting for another item would never end.
            if state.stop().is_some() && row.planned.phase != Phase::Teardown && row.running().is_none() {
                let (item, outcome) = (row.planned.name.clone(), Outcome::NotRun);
                return Condition::Skip(Cause::Precondition { item, outcome });
            }
            condition = Condition::Open;
        }
        condition
    }
}

enum Condition {
    Good,
    Open,
    Skip(Cause),
}

fn unknown_selection(plan: &Plan, name: &str) -> Mistake {
    let names: Vec<&str> = plan.items().iter().map(|item| item.name.as_str()).collect();
    let hint = match nearest(name, names.iter().copied()) {
        Some(name) => format!("did you mean \"{name}\"?"),
        None => format!("its items are {}", names.iter().take(40).copied().collect::<Vec<_>>().join(", ")),
    };
    Mistake::nowhere(format!("the plan has no item {}", quoted(name)), hint)
}

#[cfg(test)]
mod tests;
