//! A plan on a bench: which items can run, which are chosen, and which comes next.

use gnc_config::{Mistake, Mistakes, did_you_mean};
use gnc_text::quoted;

use crate::catalogue::processor::{SUPPLY_CURRENT, SUPPLY_VOLTAGE};
use crate::catalogue::{Device, ItemId, Resource};
use crate::event::{PlannedItem, StopHow};
use crate::outcome::{Cause, Outcome};
use crate::plan::{OnFail, Phase, Plan, PlanItem};
use crate::state::{Attempt, Row, RunState};
use crate::verdict::Verdict;

/// The abilities of a bench.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BenchAbilities {
    /// An RS-422 link to the slave board.
    pub rs422: bool,
    /// A CAN link to the slave board.
    pub can: bool,
    /// A person or a fixture that answers prompts.
    pub operator: bool,
}

impl BenchAbilities {
    /// Whether the bench has a device. Either link reaches the slave board.
    pub(crate) fn has(self, device: Device) -> bool {
        match device {
            Device::Slave => self.rs422 || self.can,
            Device::Rs422 => self.rs422,
            Device::Can => self.can,
            Device::Operator => self.operator,
            // Its HELLO tells: see `Job::on_board`.
            Device::BoardSupply | Device::BoardCan | Device::BoardCalibration => true,
        }
    }
}

/// The abilities of a slave board, as its HELLO tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardAbilities {
    /// It switches and measures the module's supply.
    pub supply: bool,
    /// It has CAN.
    pub can: bool,
    /// The module keeps a calibration, and the board compensates samples by it.
    pub calibration: bool,
}

impl BoardAbilities {
    fn has(self, device: Device) -> bool {
        match device {
            Device::Slave | Device::Rs422 | Device::Can | Device::Operator => true,
            Device::BoardSupply => self.supply,
            Device::BoardCan => self.can,
            Device::BoardCalibration => self.calibration,
        }
    }

    /// What an item needs and the board lacks. The identity needs a board that measures the supply if the plan limits
    /// the supply.
    fn lacks(self, item: &PlanItem) -> Option<Device> {
        let supply = [SUPPLY_VOLTAGE.name, SUPPLY_CURRENT.name];
        let limits_supply = item.id == ItemId::Identity && supply.iter().any(|name| item.limit(name).is_some());
        let needed = item.devices().chain(limits_supply.then_some(Device::BoardSupply));
        needed.into_iter().find(|device| !self.has(*device))
    }
}

/// The slave board cannot do what the plan asks for.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{} cannot run: there is no {}", items.join(", "), device.as_str())]
pub struct BoardLacks {
    /// The items that need it, as the plan names them.
    pub items: Vec<String>,
    /// What the board lacks.
    pub device: Device,
}

impl BoardLacks {
    /// What people can try.
    pub fn try_this(&self) -> &'static str {
        self.device.hint()
    }
}

/// Attempts of one item that other items may spoil. After so many the item ends as it stands: a board that restarts
/// more often is faulty.
const MAX_SPOILT: usize = 3;

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
    /// The last attempt of the item is over: the item ends with this outcome.
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
    /// No attempt can begin before a running one has ended.
    Wait,
    /// All items are over: the run ends with this outcome.
    Done {
        /// How the run ends.
        verdict: Verdict,
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
        let selected: Vec<bool> = plan.items().iter().map(|item| item.is_chosen(only)).collect();
        let mut missing = Vec::with_capacity(plan.items().len());
        for (item, selected) in plan.items().iter().zip(&selected) {
            let device = item.devices().find(|device| *selected && !bench.has(*device));
            if let Some(device) = device
                && !item.optional
            {
                let what = format!("{} cannot run: this bench has no {}", quoted(&item.name), device.as_str());
                mistakes.add(|| plan.mistake_at(item, what, device.hint()));
            }
            missing.push(device);
        }
        mistakes.or(Job { selection: only.map(<[String]>::to_vec), plan, selected, missing })
    }

    /// The job on the slave board that answered. Items that the board cannot do are skipped if the plan calls them optional.
    ///
    /// # Errors
    /// The first thing that the board lacks, and all items that need it and are not optional.
    pub fn on_board(&self, board: BoardAbilities) -> Result<Job, BoardLacks> {
        let mut job = self.clone();
        let mut refused: Option<BoardLacks> = None;
        let items = self.plan.items().iter().zip(&self.selected).zip(&mut job.missing);
        for ((item, selected), missing) in items {
            let Some(device) = board.lacks(item).filter(|_| *selected && missing.is_none()) else { continue };
            if item.optional {
                *missing = Some(device);
                continue;
            }
            let lacks = refused.get_or_insert(BoardLacks { items: Vec::new(), device });
            if lacks.device == device {
                lacks.items.push(quoted(&item.name).to_string());
            }
        }
        refused.map_or(Ok(job), Err)
    }

    /// The same job by other limits: the plan has the same items.
    #[must_use]
    pub fn judged_by(&self, plan: Plan) -> Job {
        Job { plan, ..self.clone() }
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

    /// Returns the next step if items run one after the other.
    ///
    /// Setup first, then tests, then teardown, each in the order of the plan. The runner turns the answer into events
    /// (`Run` into an attempt, `End` and `Skip` into `item_ended`, `Done` into `run_ended`), applies them, and asks
    /// again.
    pub fn next(&self, state: &RunState) -> Next {
        if state.in_flight() > 0 { Next::Wait } else { self.decide(state) }
    }

    /// Returns the next step if independent items may run at once: such an item shares no resource with a running one.
    pub fn next_overlapping(&self, state: &RunState) -> Next {
        self.decide(state)
    }

    /// The least time that this job can take in any order. It is the longest chain of items that wait for one another,
    /// or the time of items that exclude one another. `busy_s` is the time that the item at a position needs; items
    /// without a time do not count. `None` if all items are without a time.
    pub fn critical_path(&self, busy_s: &dyn Fn(usize) -> Option<f64>) -> Option<CriticalPath> {
        let items = self.plan.items();
        let needs_s = |position: usize| busy_s(position).unwrap_or(0.0);
        // An item's requirements stand before it, so one pass in order finds the longest chain up to each item.
        let mut chains: Vec<Chain> = Vec::with_capacity(items.len());
        for (position, item) in items.iter().enumerate() {
            let span_s = |required: &usize| chains.get(*required).map_or(0.0, |chain| chain.span_s);
            let after = item.requires.iter().copied().max_by(|a, b| span_s(a).total_cmp(&span_s(b)));
            let span_s = after.as_ref().map_or(0.0, span_s) + needs_s(position);
            chains.push(Chain { span_s, after });
        }
        // The items of a chain that need time, in their order.
        let chain = |last: usize| {
            let back = std::iter::successors(Some(last), |at| chains.get(*at)?.after);
            let mut items: Vec<usize> = back.filter(|at| busy_s(*at).is_some()).collect();
            items.reverse();
            items
        };
        let exclusive =
            Resource::ALL.into_iter().filter(|resource| resource.excludes(*resource)).filter_map(|resource| {
                let has = |position: &usize, resource| items[*position].id.spec().resources.contains(&resource);
                let mut together: Vec<usize> =
                    (0..items.len()).filter(|at| busy_s(*at).is_some() && has(at, resource)).collect();
                if resource == Resource::Attitude && !together.is_empty() {
                    // Items that need stillness may overlap each other, but not these items: the longest one counts.
                    let still = (0..items.len()).filter(|at| has(at, Resource::Still));
                    together.extend(still.max_by(|a, b| needs_s(*a).total_cmp(&needs_s(*b))));
                }
                // At least the shortest of the chains to these items runs before the first of them.
                let begin = together.iter().map(|at| (chains[*at].span_s - needs_s(*at), *at));
                let (begin_s, first) = begin.min_by(|a, b| a.0.total_cmp(&b.0))?;
                let way = chain(first).into_iter().filter(|at| *at != first);
                let span_s = begin_s + together.iter().map(|at| needs_s(*at)).sum::<f64>();
                Some(CriticalPath { span_s, items: way.chain(together.iter().copied()).collect() })
            });
        let last = (0..chains.len()).max_by(|a, b| chains[*a].span_s.total_cmp(&chains[*b].span_s))?;
        let longest = CriticalPath { span_s: chains[last].span_s, items: chain(last) };
        let longest = std::iter::once(longest).chain(exclusive).max_by(|a, b| a.span_s.total_cmp(&b.span_s))?;
        (!longest.items.is_empty()).then_some(longest)
    }

    fn decide(&self, state: &RunState) -> Next {
        // Ends come first: the end of an attempt may allow others to begin.
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
        Next::Done { verdict: state.verdict_so_far() }
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
        let spoilt = |attempt: &&Attempt| attempt.error.as_ref().is_some_and(|error| error.again);
        let not_counted = row.attempts.iter().filter(spoilt).count();
        let tried = u32::try_from(row.attempts.len() - not_counted).unwrap_or(u32::MAX);
        let again = match outcome {
            _ if row.attempts.last().as_ref().is_some_and(spoilt) => not_counted <= MAX_SPOILT,
            Outcome::Errored => tried < item.attempts,
            Outcome::Failed => item.retry_failed && tried < item.attempts,
            _ => false,
        };
        let may_go_on = state.stop().is_none() || item.phase == Phase::Teardown;
        (!(again && may_go_on)).then_some(Next::End { item: position, outcome })
    }

    /// The next attempt of an item, or why the item is skipped; `None` while it must wait for others.
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
            // An item does not wait for items that were not chosen: a selection is never a module's pass anyway.
            if !row.planned.selected || row.is_over() && row.outcome.is_good() {
                continue;
            }
            if row.is_over() {
                let (item, outcome) = (row.planned.name.clone(), row.outcome);
                return Condition::Skip(Cause::Precondition { item, outcome });
            }
            // After a stop only teardown begins, so an item would wait for ever for another one.
            if state.stop().is_some() && row.planned.phase != Phase::Teardown && row.running().is_none() {
                let (item, outcome) = (row.planned.name.clone(), Outcome::NotRun);
                return Condition::Skip(Cause::Precondition { item, outcome });
            }
            condition = Condition::Open;
        }
        condition
    }
}

/// The items that decide how long a job takes at least.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CriticalPath {
    /// Their time together.
    pub span_s: f64,
    /// Their positions in [`Plan::items`].
    pub items: Vec<usize>,
}

/// The longest chain of items that wait for one another, up to a certain item.
struct Chain {
    span_s: f64,
    /// The item before the last one.
    after: Option<usize>,
}

enum Condition {
    Good,
    Open,
    Skip(Cause),
}

fn unknown_selection(plan: &Plan, name: &str) -> Mistake {
    let names: Vec<&str> = plan.items().iter().map(|item| item.name.as_str()).collect();
    let hint = did_you_mean(name, names.iter().copied(), || {
        format!("its items are {}", names.iter().take(40).copied().collect::<Vec<_>>().join(", "))
    });
    Mistake::nowhere(format!("the plan has no item {}", quoted(name)), hint)
}

#[cfg(test)]
mod tests;
