//! What to say at the end, and what to do, where all findings are of one kind.

use gnc_records::store::chain::{ChainBook, ChainCheck, NONE_IS_SIGNED};

/// What the findings come to.
pub(super) const PROVE_NOTHING: &str = "these records are not as they were written, so they prove nothing";

/// The findings of all runs and of the chain, by their kinds.
#[derive(Debug, Default)]
pub(super) struct Findings {
    /// Those that tell no more than that a chain or the counter is not there or is none.
    of_files: usize,
    /// What to do about the first of these.
    try_this: Option<&'static str>,
    /// Those that tell no more than that nothing is signed.
    unsigned: usize,
}

impl Findings {
    /// A run with findings, of which so many are of its folder. `is_unsigned`: it has no signature, and its folder is as it was written.
    pub(super) fn add(&mut self, book: &ChainBook, of_folder: usize, problems: &[String], is_unsigned: bool) {
        if let Some(try_this) = book.try_this(problems.iter()).filter(|_| of_folder == 0) {
            self.try_this.get_or_insert(try_this);
            self.of_files += 1;
        }
        // One of them is that its signature is missing.
        let others = problems.iter().filter(|problem| *problem != NONE_IS_SIGNED).count();
        self.unsigned += usize::from(is_unsigned && others == 1 && book.signs_nothing());
    }

    /// The findings of the chain.
    pub(super) fn add_chain(&mut self, book: &ChainBook, checked: &ChainCheck) {
        for problem in &checked.problems {
            if let Some(try_this) = book.try_this(std::iter::once(problem)) {
                self.try_this.get_or_insert(try_this);
                self.of_files += 1;
            }
            self.unsigned += usize::from(problem == NONE_IS_SIGNED);
        }
    }

    /// What to say and what to do, if all of so many findings are of one kind.
    pub(super) fn closing(&self, all: usize) -> Option<(&'static str, &'static str)> {
        if all > 0 && all == self.unsigned {
            return Some((
                "these records are not signed, so the key proves nothing of them",
                "verify runs from before the key without --key; a copy of COUNTER or number and link of a paper witness them",
            ));
        }
        self.try_this.filter(|_| all == self.of_files).map(|try_this| (PROVE_NOTHING, try_this))
    }
}
