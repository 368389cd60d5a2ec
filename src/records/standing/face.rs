//! What a run is called: one rule for lists, the screen, the shift and what is shown of a single run.

use gnc_executive::standing::{Flaw, Seal};
use gnc_executive::verdict::Verdict;

use super::Seals;
use crate::store::StoreError;
use crate::store::reader::{Found, FoundRun};

/// What a run is, as every list calls it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Face {
    /// It ended so, it is closed, and the chain has it as it was closed.
    Ended(Verdict),
    /// It ended so, and a later start closed it: it never counts as a pass.
    Late(Verdict),
    /// It ended so and has its digests, and the chain does not name it.
    NotInChain(Verdict),
    /// It is not as it was closed, or as it began, whatever it says now.
    Changed,
    /// A station carries it out, or closes it, now.
    Running,
    /// It has no end.
    Interrupted,
    /// It ended and was not closed.
    Unsealed,
    /// A later version of the station wrote it.
    Newer,
    /// It cannot be read.
    Unreadable,
}

impl Face {
    /// What a run is called by what was found of it, and how its record is kept.
    fn of(found: &FoundRun, seal: Seal, is_broken: bool) -> Self {
        let Ok(run) = &found.run else { return Self::of_state(found.state()) };
        match (found.state(), seal) {
            (Found::Running, _) => Self::Running,
            (_, Seal::Flawed(Flaw::Unreadable)) => Self::Unreadable,
            _ if is_broken => Self::Changed,
            (Found::Closed, Seal::Flawed(Flaw::ClosedLate)) => Self::Late(run.verdict),
            (Found::Closed, Seal::Flawed(Flaw::NotInChain)) => Self::NotInChain(run.verdict),
            (Found::Closed, Seal::Flawed(Flaw::UnderWay)) => Self::Running,
            (Found::Closed, _) => Self::Ended(run.verdict),
            (state, _) => Self::of_state(state),
        }
    }

    fn of_state(state: Found) -> Self {
        match state {
            Found::Running => Self::Running,
            Found::Interrupted => Self::Interrupted,
            Found::Newer => Self::Newer,
            Found::Closed | Found::Unsealed => Self::Unsealed,
            Found::Unreadable => Self::Unreadable,
        }
    }
}

impl Seals<'_> {
    /// What a run is called.
    ///
    /// # Errors
    /// The chain of its day cannot be read.
    pub fn face(&mut self, found: &FoundRun) -> Result<Face, StoreError> {
        if found.running || found.run.is_err() {
            return Ok(Face::of_state(found.state()));
        }
        let seal = self.seal(&found.path)?;
        let is_broken = self.is_broken(&found.path, seal)?;
        Ok(Face::of(found, seal, is_broken))
    }

    /// How the record of a run is kept, as far as a list says it; `None` for a run that is not closed.
    ///
    /// # Errors
    /// The chain of its day cannot be read.
    pub fn kept(&mut self, found: &FoundRun) -> Result<Option<Seal>, StoreError> {
        Ok(match self.face(found)? {
            Face::Ended(_) => Some(Seal::Chained),
            Face::Late(_) => Some(Seal::Flawed(Flaw::ClosedLate)),
            Face::NotInChain(_) => Some(Seal::Flawed(Flaw::NotInChain)),
            Face::Changed => Some(Seal::Flawed(Flaw::Changed)),
            Face::Running if found.state() == Found::Closed => Some(Seal::Flawed(Flaw::UnderWay)),
            Face::Unreadable if found.run.is_ok() => Some(Seal::Flawed(Flaw::Unreadable)),
            Face::Running | Face::Interrupted | Face::Unsealed | Face::Newer | Face::Unreadable => None,
        })
    }
}
