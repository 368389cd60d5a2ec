//! What a check is.

use std::future::Future;
use std::pin::Pin;

use crate::driver::{Begins, Driver};
use crate::stop::Verdict;

/// A check that runs.
pub(crate) type Running<'a> = Pin<Box<dyn Future<Output = Verdict> + 'a>>;

/// One demand of the document, and how to see whether a board keeps it.
#[derive(Debug)]
pub(crate) struct Check {
    /// A short name that stays.
    pub(crate) id: &'static str,
    /// Section of the document.
    pub(crate) section: u8,
    /// What the document demands, in one sentence.
    pub(crate) demand: &'static str,
    /// The state in which it begins.
    pub(crate) begins: Begins,
    /// Carries it out.
    pub(crate) run: for<'a> fn(&'a mut Driver) -> Running<'a>,
}

/// The checks of a section: `id state function "what the document demands"`.
macro_rules! checks {
    ($section:literal: $($id:literal $begins:ident $run:ident $demand:literal),* $(,)?) => {
        /// The checks of this section, in its order.
        pub(crate) const CHECKS: &[$crate::check::Check] = &[$($crate::check::Check {
            id: $id,
            section: $section,
            demand: $demand,
            begins: $crate::driver::Begins::$begins,
            run: |driver| Box::pin($run(driver)),
        }),*];
    };
}
pub(crate) use checks;
