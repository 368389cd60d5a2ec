//! The pure test executive: quantities, limits, plans, run events and state, records as text.
//!
//! It does no I/O: it knows no clock, no file system, no task and no terminal. The caller passes times in and reads and
//! writes files. So every rule of a run is tested without a bench, and the same code folds a live run and a journal
//! that is read years later.
//!
//! In the order of a run: [`plan::Plan::read`] checks the text of a plan, [`job::Job::new`] holds it against the bench
//! and a selection, [`job::Job::next`] gives the next step, procedures measure [`measurement::Value`]s,
//! [`plan::PlanItem::judge`] makes [`measurement::Measurement`]s of them, the runner emits [`event::Event`]s, and
//! [`state::RunState::apply`] folds them.

pub mod bench;
pub mod catalogue;
pub mod details;
pub mod event;
pub mod job;
pub mod journal;
pub mod limit;
pub mod measurement;
mod number;
pub mod numbers;
pub mod outcome;
pub mod part;
pub mod plan;
pub mod quantity;
pub mod record;
pub mod serial_number;
pub mod standing;
pub mod state;
pub mod text;
pub mod uncertainty;
pub mod verdict;

#[cfg(test)]
mod test_run;
