//! A campaign: many runs of the functional plan, each with a module, a line and disturbances drawn from one seed, and
//! each held to what the module's file expects.
//!
//! Station and simulated bench run in this program; [`Over`] says where they meet.

mod case;
mod judge;
mod memory;
mod order;
mod pty;
mod run;
mod table;

use std::path::PathBuf;
use std::sync::Mutex;

pub use case::{Case, Disturbance, Link};
pub use judge::violations;
pub use run::{Kept, LONGEST, Over, Ran, differs, run};
pub use table::table;

/// Runs at once where nobody says otherwise: those on a bad line wait more than they work.
pub const AT_ONCE: usize = 12;

/// What a campaign is made of.
#[derive(Debug, Clone)]
pub struct Campaign {
    /// Of all chance.
    pub seed: u64,
    /// Numbers of the runs.
    pub runs: std::ops::Range<u64>,
    /// Where station and bench meet.
    pub over: Over,
    /// Each is made twice and must be the same run, as it is in memory.
    pub twice: bool,
    /// Runs at once.
    pub at_once: usize,
    /// Where records are kept, and which; none if not given.
    pub keep: Option<(PathBuf, Kept)>,
}

/// One run with what is wrong about it.
#[derive(Debug)]
pub struct Judged {
    /// What was to be run.
    pub case: Case,
    /// What came of it.
    pub ran: Ran,
    /// Each in a sentence; empty if all is as it should be.
    pub violations: Vec<String>,
}

/// Runs all of them; `told` hears of each as it ends, with the number of those that ended.
///
/// # Panics
/// A thread of this program came to grief.
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
