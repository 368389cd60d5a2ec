//! The run as it was recorded: events, plan.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use gnc_executive::event::{Event, EventKind, RunHeader};
use gnc_executive::plan::{MAX_PLAN_FILES, ParamError, Plan};
use gnc_executive::state::OutOfOrder;
use gnc_records::store::captures::CapturesError;
use gnc_records::store::{JOURNAL, PLAN, StoreError, reader};

use super::info;

/// Why a run cannot be recomputed.
#[derive(Debug, thiserror::Error)]
pub(super) enum RunError {
    #[error("the run cannot be read: {what}")]
    Unreadable { what: String },
    #[error("its events do not follow from each other")]
    OutOfOrder { source: OutOfOrder },
    #[error("it was recomputed itself, from {run}, and holds no raw record")]
    NoRawRecord { run: String },
    #[error("the recorded plan is not the one that was run: its digest differs")]
    OtherPlan,
    #[error("{what}")]
    Plan { what: String },
    #[error("the plan does not fit the run: {what}")]
    Unfit { what: String },
    #[error(transparent)]
    Captures(#[from] CapturesError),
    #[error(transparent)]
    Param(#[from] ParamError),
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl RunError {
    pub(super) fn try_this(&self) -> &'static str {
        match self {
            Self::Unreadable { .. } | Self::OutOfOrder { .. } => {
                "`gnc-station records list` shows the runs that are there"
            }
            Self::NoRawRecord { .. } => "recompute the run that it came from",
            Self::OtherPlan => "restore the run's folder from a backup",
            Self::Plan { .. } => "",
            Self::Unfit { .. } => "give a plan with the same items under the same names; limits may differ",
            Self::Captures(error) => error.source.try_this(),
            Self::Param(_) => "report this: the plan was accepted and should not have been",
            Self::Store(error) => error.try_this(),
        }
    }
}

/// A recorded run.
pub(super) struct Run {
    pub(super) folder: PathBuf,
    pub(super) header: RunHeader,
    pub(super) events: Vec<Event>,
}

impl Run {
    pub(super) fn read(folder: &Path) -> Result<Self, RunError> {
        // Folding it finds what is damaged.
        reader::fold(folder).map_err(|what| RunError::Unreadable { what })?;
        let unreadable = |error: io::Error| RunError::Unreadable { what: error.to_string() };
        let bytes = fs::read(folder.join(JOURNAL)).map_err(unreadable)?;
        // Of an interrupted run the last line may be cut off; the fold found all others good.
        let lines = bytes.split_inclusive(|byte| *byte == b'\n');
        let events: Vec<Event> = lines.map_while(|line| serde_json::from_slice(line).ok()).collect();
        let Some(EventKind::RunStarted { header, .. }) = events.first().map(|event| &event.kind) else {
            return Err(RunError::Unreadable { what: "the journal holds no whole event".into() });
        };
        if let Some(of) = &header.recomputed {
            return Err(RunError::NoRawRecord { run: of.run.clone() });
        }
        let header = (**header).clone();
        Ok(Self { folder: folder.to_owned(), header, events })
    }

    /// The plan as it was run, and nothing else.
    pub(super) fn recorded_plan(&self) -> Result<Plan, RunError> {
        let unreadable = |error: io::Error| RunError::Unreadable { what: format!("{PLAN}/: {error}") };
        let mut files = Vec::new();
        for entry in fs::read_dir(self.folder.join(PLAN)).map_err(unreadable)?.take(MAX_PLAN_FILES + 1) {
            files.push(entry.map_err(unreadable)?.path());
        }
        files.sort();
        // They are numbered in the order of reading, which is that in which they are asked for.
        let mut files = files.into_iter();
        let first = files.next().ok_or_else(|| RunError::Unreadable { what: format!("{PLAN}/ is empty") })?;
        let bytes = fs::read(&first).map_err(unreadable)?;
        let mut load = |_: &str| match files.next() {
            Some(path) => fs::read(path).map_err(|error| error.to_string()),
            None => Err("it is not in the record".to_owned()),
        };
        let name = first.file_name().unwrap_or_default().to_string_lossy();
        let plan = Plan::read(name.get(3..).unwrap_or_default(), bytes, &mut load)
            .map_err(|mistakes| RunError::Plan { what: mistakes.to_string() })?;
        if info(&plan).sha256 == self.header.plan.sha256 { Ok(plan) } else { Err(RunError::OtherPlan) }
    }
}
