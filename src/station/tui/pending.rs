//! A run that was asked for and has not begun: the checks before it, and the questions that are still open.

use std::collections::VecDeque;
use std::path::PathBuf;

use chrono::{DateTime, FixedOffset};
use gnc_executive::standing::Standing;

use super::model::{Over, RoundsSetting};
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
    /// The run that the command line named cannot be taken up.
    No {
        why: String,
    },
}

/// What must be known before a run begins.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Prepared {
    pub serial_number: String,
    /// Files of plan and bench that are not as they were checked.
    pub changed: Vec<ChangedFile>,
    /// What the records say of the module by this plan; `None` if they cannot be read.
    pub standing: Option<Standing>,
    pub resume: Option<Resumable>,
}

/// A start that waits for answers.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PendingStart {
    pub selection: Option<Vec<String>>,
    pub rounds: RoundsSetting,
    /// The run that is taken up again.
    pub resume: Option<PathBuf>,
    /// The open questions, the next one first.
    pub questions: VecDeque<Over>,
}

impl PendingStart {
    /// A start without open questions.
    pub(crate) fn new(selection: Option<Vec<String>>, rounds: RoundsSetting) -> Self {
        Self { selection, rounds, resume: None, questions: VecDeque::new() }
    }
}
