//! The only service that carries out runs. `--auto`, the screen, the campaign and tests use it; nothing else begins a
//! run.
//!
//! A face opens the bench and gives a checked plan. The service judges whether they fit, opens the records, takes up an
//! earlier run, runs the rounds and ends them. It reads no plan file and no bench file: each round runs exactly the
//! plan that was checked.

mod plan;

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use chrono::{DateTime, FixedOffset, Local};
use gnc_config::Mistakes;
use gnc_executive::bench::BenchSite;
use gnc_executive::event::{BenchInfo, EVENTS_SCHEMA, Loop, ProgramVersion, RunHeader};
use gnc_executive::job::{BenchAbilities, Job};
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::OnFail;
use gnc_link::Target;
use gnc_link::can::CanTarget;
use gnc_records::resume::{Like, ResumeError, Resumed};
use gnc_records::store::{RecordWriter, RunFolder, StationKey, StoreError, Watcher, seal_interrupted};
use tokio::time::Instant;

use crate::control::RunControl;
use crate::fixture::Fixture;
use crate::journal::RunJournal;
use crate::runner::{self, Ending, Live, RunOrder};

pub use plan::CheckedPlan;

/// The bench that carries out runs, ready to use.
#[derive(Debug)]
pub struct Equipment {
    /// The name of this station.
    pub station: String,
    /// The folder of all records.
    pub records: PathBuf,
    /// Signs the runs that are closed.
    pub key: Option<StationKey>,
    /// The bench as records name it.
    pub bench: BenchInfo,
    /// The way to the slave board.
    pub target: Target,
    /// The bench's CAN bus, if it has one.
    pub can: Option<CanTarget>,
    /// What the bench can do.
    pub abilities: BenchAbilities,
    /// Turns the module and flips its switches.
    pub fixture: Fixture,
    /// Where the bench stands.
    pub site: Option<BenchSite>,
}

/// A request for a run or for several rounds of it.
#[derive(Debug, Clone)]
pub struct RunRequest {
    /// The plan, as it was checked.
    pub plan: CheckedPlan,
    /// The module's serial number.
    pub serial_number: String,
    /// The person who tests.
    pub operator: Option<String>,
    /// Names of the chosen items; `None` for the whole plan.
    pub selection: Option<Vec<String>>,
    /// The program that makes the request.
    pub program: ProgramVersion,
    /// What the run does after a bad item, in place of the plan's own setting. [`OnFail::Stop`] also ends the rounds.
    pub on_fail: Option<OnFail>,
    /// How often the plan is run.
    pub rounds: Rounds,
    /// Folder of the earlier run that is taken up again. Such a run is one round.
    pub resume: Option<PathBuf>,
    /// Runs one item after the other, even if they could run at once.
    pub one_by_one: bool,
    /// Number of the first session with the board, from which the next ones count on; random if not given.
    pub nonce: Option<u32>,
    /// The date at which a repeatable run begins. Dates then follow the run's own clock, and its record is written
    /// without a thread, so that this clock never waits for the disk.
    pub began: Option<DateTime<FixedOffset>>,
}

/// How often a plan is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rounds {
    /// One run without a loop.
    Once,
    /// So many rounds of a loop.
    Count(u32),
    /// Rounds of a loop until this time is over. The current round is finished.
    For(Duration),
}

impl Rounds {
    /// The loop entry that a run files for its round.
    fn looped(self, index: u32) -> Option<Loop> {
        match self {
            Self::Once => None,
            Self::Count(count) => Some(Loop { index, count: Some(count) }),
            Self::For(_) => Some(Loop { index, count: None }),
        }
    }

    fn are_over(self, round: u32, took: Duration) -> bool {
        match self {
            Self::Once => true,
            Self::Count(count) => round >= count,
            Self::For(time) => took >= time,
        }
    }
}

/// A face: it shows rounds and never sees an event before the record has it.
pub trait Observer {
    /// A round begins and its record lies in this folder. The watcher hears its events.
    ///
    /// # Errors
    /// The face cannot show the round, which is then not begun.
    fn begin(&mut self, folder: &Path) -> io::Result<Watcher>;

    /// A round has ended. The next one waits until the face has shown this one.
    fn end(&mut self, folder: &Path, ending: &Ending) -> impl Future<Output = ()>;
}

/// Why a round was not begun.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// The bench cannot run the plan.
    #[error(transparent)]
    Unfit(#[from] Mistakes),
    /// The earlier run cannot be taken up.
    #[error(transparent)]
    Resume(#[from] ResumeError),
    /// There is no place for the record.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The face cannot show the round.
    #[error("cannot start")]
    Observer(#[source] io::Error),
}

impl ServiceError {
    /// What the operator can try; may be empty.
    #[must_use]
    pub fn try_this(&self) -> &'static str {
        match self {
            Self::Resume(error) => error.try_this(),
            Self::Store(error) => error.try_this(),
            // Each mistake in these errors has its own hint.
            Self::Unfit(_) | Self::Observer(_) => "",
        }
    }
}

/// How the rounds ended.
#[derive(Debug)]
pub struct RunsDone {
    /// The outcome of each round; there is at least one. A round that could not be begun is errored.
    pub outcomes: Vec<Outcome>,
    /// Why the last round was not begun.
    pub refused: Option<ServiceError>,
}

impl RunsDone {
    /// The worst outcome.
    #[must_use]
    pub fn outcome(&self) -> Outcome {
        Outcome::worst(self.outcomes.iter().copied()).unwrap_or(Outcome::Errored)
    }
}

/// Carries out a request: one run, or rounds until one of them ends the loop.
///
/// The rounds end early after a stop, after a run that began no item, after a record that could not be written, and
/// after a bad round if the request says so.
///
/// # Errors
/// [`ServiceError`]: nothing was run, and the module had no power.
pub async fn run(
    request: &RunRequest,
    equipment: Equipment,
    control: &RunControl,
    live: &Live,
    observer: &mut impl Observer,
) -> Result<RunsDone, ServiceError> {
    let rounds = if request.resume.is_some() { Rounds::Once } else { request.rounds };
    let mut ready = Ready::open(request, equipment)?;
    let began = Instant::now();
    let mut outcomes = Vec::new();
    for round in 1.. {
        ready.order.header.looped = rounds.looped(round);
        let ending = match ready.round(request.began, control, live, observer).await {
            Ok(ending) => ending,
            Err(refused) if outcomes.is_empty() => return Err(refused),
            Err(refused) => {
                outcomes.push(Outcome::Errored);
                return Ok(RunsDone { outcomes, refused: Some(refused) });
            }
        };
        outcomes.push(ending.outcome);
        let bad = !ending.outcome.is_good() && request.on_fail == Some(OnFail::Stop);
        let stopped = control.asked().times > 0;
        let unrecorded = ending.store_error.is_some();
        if rounds.are_over(round, began.elapsed()) || bad || stopped || unrecorded || !ending.begun {
            break;
        }
    }
    Ok(RunsDone { outcomes, refused: None })
}

/// The parts that stay the same from round to round.
struct Ready {
    order: RunOrder,
    records: PathBuf,
    key: Option<StationKey>,
}

impl Ready {
    fn open(request: &RunRequest, equipment: Equipment) -> Result<Self, ServiceError> {
        let Equipment { station, records, key, bench, target, can, abilities, fixture, site } = equipment;
        let mut plan = request.plan.plan().clone();
        if let Some(on_fail) = request.on_fail {
            plan.on_fail = on_fail;
        }
        let job = Job::new(plan, abilities, request.selection.as_deref())?;
        // In the order of the plan, in whichever order somebody named the items.
        let selection = request.selection.as_ref().map(|names| {
            let items = job.plan().items().iter().map(|item| &item.name);
            items.filter(|name| names.contains(name)).cloned().collect::<Vec<_>>()
        });
        let mut header = RunHeader {
            schema: EVENTS_SCHEMA.to_owned(),
            serial_number: request.serial_number.clone(),
            operator: request.operator.clone(),
            station,
            program: request.program.clone(),
            bench,
            plan: request.plan.info(),
            site: site.clone(),
            recomputed: None,
            resumed: None,
            selection,
            looped: None,
        };
        let resumed = request.resume.as_deref().map(|run| Resumed::read(run, Like::header(&header))).transpose()?;
        header.resumed = resumed.as_ref().map(Resumed::earlier);
        let (one_by_one, nonce) = (request.one_by_one, request.nonce);
        let found = seal_interrupted(&records, key.as_ref());
        let order = RunOrder { job, header, target, can, fixture, site, resumed, one_by_one, nonce, found };
        Ok(Self { order, records, key })
    }

    async fn round(
        &mut self,
        dated: Option<DateTime<FixedOffset>>,
        control: &RunControl,
        live: &Live,
        observer: &mut impl Observer,
    ) -> Result<Ending, ServiceError> {
        let Self { order, records, key } = self;
        let plan = order.job.plan();
        let at = dated.unwrap_or_else(|| Local::now().fixed_offset());
        // Create the folder before power-on, so that a module is not tested without a place for its record.
        let folder = RunFolder::create(records, at, &order.header.serial_number, &plan.name)?.signed_with(key.clone());
        let path = folder.path().to_owned();
        let watchers = vec![observer.begin(&path).map_err(ServiceError::Observer)?];
        let journal = match dated {
            Some(began) => RunJournal::dated(RecordWriter::without_thread(folder, plan, watchers)?, began),
            None => RunJournal::new(RecordWriter::start(folder, plan, watchers)?),
        };
        let ending = runner::run(order, journal, control, live).await;
        // Only the log of the first round mentions what was found before it.
        order.found.clear();
        observer.end(&path, &ending).await;
        Ok(ending)
    }
}
