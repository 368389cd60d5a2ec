//! The pure test executive: quantities, limits, plans, run events and state, records as text.
//!
//! It never does any I/O: it knows no clock, no file system, no task and no terminal. Times are passed in, files are
//! read and written by the caller. So every rule of a run is tested without a bench, and a journal that is read years
//! later is folded by the same code as the live run.
//!
//! In the order of a run: [`plan::Plan::read`] checks the text of a plan, [`job::Job::new`] holds it against the bench
//! and a selection, [`job::Job::next`] says what comes next, procedures measure [`measurement::Value`]s,
//! [`plan::PlanItem::judge`] makes [`measurement::Measurement`]s of them, the runner emits
//! [`event::Event`]s, and [`state::RunState::apply`] folds them.

pub mod bench;
pub mod catalogue;
pub mod event;
pub mod job;
pub mod journal;
pub mod limit;
pub mod measurement;
mod number;
pub mod outcome;
pub mod plan;
pub mod quantity;
pub mod record;
pub mod state;
pub mod text;
pub mod uncertainty;

#[cfg(test)]
mod test_run;
