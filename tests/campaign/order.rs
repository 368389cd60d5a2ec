//! The request to the station in every run of a campaign.

use std::path::{Path, PathBuf};

use chrono::{DateTime, FixedOffset};
use gnc_bench::fixture::Fixture;
use gnc_bench::runner::Ending;
use gnc_bench::service::{CheckedPlan, Equipment, Observer, Rounds, RunRequest, RunsDone, ServiceError};
use gnc_executive::bench::BenchFile;
use gnc_executive::event::{BenchInfo, Event, ProgramVersion};
use gnc_executive::job::BenchAbilities;
use gnc_executive::plan::Plan;
use gnc_executive::verdict::Verdict;
use gnc_link::Target;
use gnc_link::can::CanTarget;
use gnc_records::store::{RunFolder, Watcher};

use super::case::{Case, Link};

/// A request and the bench for it.
pub(super) struct Ordered {
    pub(super) request: RunRequest,
    pub(super) equipment: Equipment,
}

/// The functional plan on the bench of a case; its records go below `place`.
pub(super) fn order(
    case: &Case,
    speed: &str,
    (target, can): (Target, CanTarget),
    fixture: Fixture,
    place: &Path,
    began: Option<DateTime<FixedOffset>>,
) -> Result<Ordered, String> {
    let said = |error: &dyn std::fmt::Display| error.to_string();
    let bytes = std::fs::read(crate::functional_plan()).map_err(|error| said(&error))?;
    let mut no_includes = |name: &str| Err(format!("{name}: the functional plan includes nothing"));
    let plan = Plan::read("functional.toml", bytes, &mut no_includes).and_then(CheckedPlan::new);
    let file = BenchFile::read("the simulated bench's file", hw_mocks::BENCH_FILE.as_bytes().to_vec())
        .map_err(|mistakes| said(&mistakes))?;
    let request = RunRequest {
        plan: plan.map_err(|mistakes| said(&mistakes))?,
        serial_number: "T-1".to_owned(),
        part: None,
        numbers: Vec::new(),
        operator: None,
        selection: None,
        answers: gnc_bench::questions::Answers::default(),
        program: ProgramVersion {
            name: env!("CARGO_PKG_NAME").to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            build: None,
        },
        on_fail: None,
        rounds: Rounds::Once,
        resume: None,
        one_by_one: false,
        nonce: Some(case.bench_seed() as u32),
        began,
    };
    let equipment = Equipment {
        station: "campaign".to_owned(),
        records: place.join("records"),
        key: None,
        trusted_keys: Vec::new(),
        bench: BenchInfo::simulated(case.board.to_owned(), speed, case.bench_seed()),
        target,
        can: Some(can),
        abilities: BenchAbilities { rs422: case.link == Link::Rs422, can: true, operator: true },
        fixture,
        site: file.site,
        serial_number: None,
        numbers: Vec::new(),
        plans: Default::default(),
        clock_is_right: false,
    };
    Ok(Ordered { request, equipment })
}

/// Receives each event, and stores where the record is and why it could not be written.
pub(super) struct Heard<F> {
    event: F,
    folder: Option<PathBuf>,
    store_error: Option<String>,
}

impl<F: Fn() -> bool + Clone + Send + 'static> Heard<F> {
    /// `event` is called for each event; it returns `false` if the listener has gone.
    pub(super) fn new(event: F) -> Self {
        Self { event, folder: None, store_error: None }
    }

    /// The verdict and the folder of the only round, or the error that prevented it.
    pub(super) fn ended(self, done: Result<RunsDone, ServiceError>) -> Result<(Verdict, PathBuf), String> {
        let done = done.map_err(|error| error.to_string())?;
        match (self.store_error, self.folder) {
            (Some(error), _) => Err(format!("the record could not be written: {error}")),
            (None, Some(folder)) => Ok((done.verdict(), folder)),
            (None, None) => Err("no round was begun".to_owned()),
        }
    }
}

impl<F: Fn() -> bool + Clone + Send + 'static> Observer for Heard<F> {
    fn begin(&mut self, folder: &RunFolder) -> std::io::Result<Watcher> {
        self.folder = Some(folder.path().to_owned());
        let event = self.event.clone();
        Ok(Box::new(move |_: &Event| event()))
    }

    async fn end(&mut self, _: &Path, ending: &Ending) {
        self.store_error = ending.store_error.as_ref().map(ToString::to_string);
    }
}
