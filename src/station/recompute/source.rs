//! The run as it was recorded: its events and its plan.

use std::path::{Path, PathBuf};

use gnc_executive::event::{Event, EventKind, RunHeader};
use gnc_executive::plan::{ParamError, PartNotNamed, Plan};
use gnc_executive::state::OutOfOrder;
use gnc_records::store::StoreError;
use gnc_records::store::captures::CapturesError;
use gnc_records::store::reader::{self, ReadError};

use super::info;

/// Why a run cannot be recomputed.
#[derive(Debug, thiserror::Error)]
pub(super) enum RunError {
    #[error("the run cannot be read")]
    Unreadable(#[from] ReadError),
    #[error("the events of the run are out of order")]
    OutOfOrder { source: OutOfOrder },
    #[error("this run is itself a recomputation of {run}, so it has no raw record")]
    NoRawRecord { run: String },
    #[error("the recorded plan is not the one that was run: its digest differs")]
    OtherPlan,
    #[error("{what}")]
    Plan { what: String },
    #[error("the plan does not fit the run: {what}")]
    Unfit { what: String },
    #[error("the record is not as it was written")]
    NotAsWritten,
    #[error(
        "the runs beside it are signed, and there is no key: a judgement without a signature would be a finding of `records verify --key` for ever"
    )]
    NoKey,
    #[error(
        "this key did not sign the run, and runs beside it are signed: a judgement without a signature would be a finding of `records verify --key` for ever"
    )]
    ForeignKey,
    #[error(
        "the run is not signed, and runs beside it are: a judgement without a signature would be a finding of `records verify --key` for ever"
    )]
    Unsigned,
    #[error(transparent)]
    Part(#[from] PartNotNamed),
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
            Self::Unreadable(error) => error.try_this(),
            Self::OutOfOrder { .. } => "restore the run's folder from a backup; if that does not help, report this",
            Self::NoRawRecord { .. } => "recompute the original run",
            Self::OtherPlan => "restore the run's folder from a backup",
            Self::Plan { .. } => "",
            Self::NotAsWritten => "restore the changed files from a backup",
            Self::NoKey => "give the bench file with --bench FILE, or the station's private key with --key FILE",
            Self::ForeignKey => {
                "give the private key of the station that carried it out with --key FILE; or copy the run into a records folder of its own, DIR/DATE/NUMBER/RUN, and judge it there"
            }
            Self::Unsigned => "copy the run into a records folder of its own, DIR/DATE/NUMBER/RUN, and judge it there",
            Self::Unfit { .. } => "give a plan with the same items under the same names; limits may differ",
            Self::Part(error) => error.try_this(),
            Self::Captures(error) => error.source.try_this(),
            Self::Param(_) => "report this: the station should not have accepted the plan",
            Self::Store(error) => error.try_this(),
        }
    }
}

/// A recorded run.
pub(super) struct RecordedRun {
    pub(super) folder: PathBuf,
    pub(super) header: RunHeader,
    pub(super) events: Vec<Event>,
}

impl RecordedRun {
    pub(super) fn read(folder: &Path) -> Result<Self, RunError> {
        // The fold finds damage, and events of a later version of the station.
        reader::fold(folder)?;
        let events = reader::events(folder)?;
        let Some(EventKind::RunStarted { header, .. }) = events.first().map(|event| &event.kind) else {
            return Err(ReadError::Empty.into());
        };
        if let Some(of) = &header.recomputed {
            return Err(RunError::NoRawRecord { run: of.run.clone() });
        }
        let header = (**header).clone();
        Ok(Self { folder: folder.to_owned(), header, events })
    }

    /// Reads the plan that was run, from the record alone.
    pub(super) fn recorded_plan(&self) -> Result<Plan, RunError> {
        let files = reader::plan(&self.folder)?;
        // The record lists the files in the order of reading. The plan asks for them in the same order.
        let mut files = files.into_iter();
        let (name, bytes) = files.next().unwrap_or_default();
        let mut load = |_: &str| match files.next() {
            Some((_, bytes)) => Ok(bytes),
            None => Err("the record does not hold this file".to_owned()),
        };
        let plan =
            Plan::read(&name, bytes, &mut load).map_err(|mistakes| RunError::Plan { what: mistakes.to_string() })?;
        if info(&plan).sha256 == self.header.plan.sha256 { Ok(plan) } else { Err(RunError::OtherPlan) }
    }
}
