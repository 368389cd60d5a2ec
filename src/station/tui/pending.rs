//! A run that was asked for and has not begun: what must be known first, and what is still to be asked.

use std::collections::VecDeque;
use std::path::PathBuf;

use chrono::{DateTime, FixedOffset};

use super::model::{Earlier, Over, Rounds};
use crate::files::ChangedFile;

/// A run that broke off and can be taken up again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Interrupted {
    pub folder: PathBuf,
    /// When it began.
    pub at: DateTime<FixedOffset>,
}

/// Whether a run can be taken up again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Resumable {
    Yes(Interrupted),
    /// The command line asked for one that cannot.
    No {
        why: String,
    },
}

/// What must be known before a run begins.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Prepared {
    pub serial_number: String,
    /// Files of plan and bench that are not as they were checked.
    pub changed: Vec<ChangedFile>,
    /// The newest run of the module today.
    pub earlier: Option<Earlier>,
    pub resume: Option<Resumable>,
}

/// What was asked for and waits for answers.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pending {
    pub selection: Option<Vec<String>>,
    pub rounds: Rounds,
    /// The run that is taken up again.
    pub resume: Option<PathBuf>,
    /// What is still to be asked, the next one first.
    pub questions: VecDeque<Over>,
}

impl Pending {
    /// A run about which nothing was asked yet.
    pub(crate) fn new(selection: Option<Vec<String>>, rounds: Rounds) -> Self {
        Self { selection, rounds, resume: None, questions: VecDeque::new() }
    }
}
