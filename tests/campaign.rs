//! A campaign: many runs of the functional plan. Each has a module, a line and disturbances drawn from one seed, and is
//! checked against the expectation in the module's file.
//!
//! Station and simulated bench run in this program; [`Over`] says where they meet.

mod breach;
mod case;
mod judge;
mod memory;
mod order;
mod pty;
mod run;
mod table;

use std::path::PathBuf;
use std::sync::Mutex;

pub use breach::{BREACHES, Breach, Verdict, looks_like_a_bad_sensor};
pub use case::{Case, Disturbance, Link};
pub use judge::violations;
pub use run::{Kept, LONGEST, Over, Ran, differs, run};
pub use table::table;

/// Default number of concurrent runs: runs on a bad line wait more than they work.
pub const AT_ONCE: usize = 12;

/// The settings of a campaign.
#[derive(Debug, Clone)]
pub struct Campaign {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Numbers of the runs.
    pub runs: std::ops::Range<u64>,
    /// Where station and bench meet.
    pub over: Over,
    /// Whether each run is made twice and must be the same run. In memory it is.
    pub twice: bool,
    /// Number of concurrent runs.
    pub at_once: usize,
    /// The folder in which records are kept, and which records; `None` keeps no records.
    pub keep: Option<(PathBuf, Kept)>,
}

/// A run with its violations.
#[derive(Debug)]
pub struct Judged {
    /// The case that was run.
    pub case: Case,
    /// The result of the run.
    pub ran: Ran,
    /// The violations, a sentence each; empty if there are none.
    pub violations: Vec<String>,
}

/// Carries out all runs; `told` receives each run as it ends, with the number of ended runs.
///
/// # Panics
/// A thread of this program panicked.
pub fn carry_out(campaign: &Campaign, told: &(dyn Fn(usize, &Judged) + Sync)) -> Vec<Judged> {
    let (left, all) = (Mutex::new(campaign.runs.clone()), Mutex::new(Vec::new()));
    let lock = |error: std::sync::PoisonError<_>| error.into_inner();
    std::thread::scope(|scope| {
        for _ in 0..campaign.at_once {
            scope.spawn(|| {
                loop {
                    let Some(number) = left.lock().unwrap_or_else(std::sync::PoisonError::into_inner).next() else {
                        return;
                    };
                    let case = Case::drawn(campaign.seed, number);
                    let ran =
                        run(&case, campaign.over, campaign.keep.as_ref().map(|(keep, kept)| (keep.as_path(), *kept)));
                    let mut found = violations(&case, &ran);
                    found.extend(campaign.twice.then(|| differs(&case, &ran)).flatten());
                    let judged = Judged { violations: found, case, ran: Ran { journal: Vec::new(), ..ran } };
                    let mut all = all.lock().unwrap_or_else(lock);
                    told(all.len() + 1, &judged);
                    all.push(judged);
                }
            });
        }
    });
    let mut all = all.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    all.sort_by_key(|judged| judged.case.number);
    all
}
