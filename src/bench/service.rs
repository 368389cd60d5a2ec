//! The only service that carries out runs. `--auto`, the screen, the campaign and tests use it; nothing else begins a
//! run.
//!
//! A face opens the bench and gives a checked plan. The service judges whether they fit, opens the records, takes up an
//! earlier run, runs the rounds and ends them. It reads no plan file and no bench file: each round runs exactly the
//! plan that was checked.

mod plan;

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use chrono::{DateTime, FixedOffset};
use gnc_config::Mistakes;
use gnc_executive::bench::{BenchSite, PinError, PinnedPlans};
use gnc_executive::event::{BenchInfo, BenchKind, Loop, PlanInfo, ProgramVersion, RunHeader, events_form};
use gnc_executive::job::{BenchAbilities, Job};
use gnc_executive::numbers::{self, NumberError, NumberField};
use gnc_executive::outcome::Outcome;
use gnc_executive::part::PartName;
use gnc_executive::plan::{OnFail, Plan};
use gnc_executive::serial_number::SerialNumberPattern;
use gnc_executive::standing::{PlanAsked, Question, Standing};
use gnc_executive::verdict::Verdict;
use gnc_link::Target;
use gnc_link::can::CanTarget;
use gnc_records::resume::{Like, ResumeError, Resumed};
use gnc_records::reuse::{self, Reused};
use gnc_records::standing;
use gnc_records::store::reader;
use gnc_records::store::{
    PublicKey, RecordWriter, RunFolder, Sealer, StationKey, StoreError, Watcher, seal_interrupted,
};
use tokio::time::Instant;

use crate::clock::{self, ClockError};
use crate::control::RunControl;
use crate::fixture::Fixture;
use crate::journal::RunJournal;
use crate::questions::Answers;
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
    /// The keys whose signatures count where a plan requires another one: its own and those of other stations. Empty: signatures
    /// are not looked at.
    pub trusted_keys: Vec<PublicKey>,
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
    /// What the serial number of each module must match on this bench.
    pub serial_number: Option<SerialNumberPattern>,
    /// Numbers beside it that each run on this bench is asked for.
    pub numbers: Vec<NumberField>,
    /// The plans that the bench runs, if it does not run any.
    pub plans: PinnedPlans,
    /// Whether a person says that the clock is right, whatever speaks against it.
    pub clock_is_right: bool,
}

/// A request for a run or for several rounds of it.
#[derive(Debug, Clone)]
pub struct RunRequest {
    /// The plan, as it was checked.
    pub plan: CheckedPlan,
    /// The module's serial number.
    pub serial_number: String,
    /// The part that the module must be; it is compared with what the module says.
    pub part: Option<PartName>,
    /// Numbers of orders, sub-units and others: their keys in plan or bench file, and the numbers.
    pub numbers: Vec<(String, String)>,
    /// The person who tests.
    pub operator: Option<String>,
    /// Names of the chosen items; `None` for the whole plan.
    pub selection: Option<Vec<String>>,
    /// The program that makes the request.
    pub program: ProgramVersion,
    /// Who answers the questions of the plan.
    pub answers: Answers,
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

    fn count(self) -> Option<u32> {
        match self {
            Self::Once => Some(1),
            Self::Count(count) => Some(count),
            Self::For(_) => None,
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
    /// A round begins and its record lies in this folder, which moves at its end if the module is not the one that was
    /// scanned. The watcher hears its events.
    ///
    /// # Errors
    /// The face cannot show the round, which is then not begun.
    fn begin(&mut self, folder: &RunFolder) -> io::Result<Watcher>;

    /// A round has ended. The next one waits until the face has shown this one.
    fn end(&mut self, folder: &Path, ending: &Ending) -> impl Future<Output = ()>;
}

/// Why a round was not begun.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// The bench cannot run the plan.
    #[error(transparent)]
    Unfit(#[from] Mistakes),
    /// The bench file pins other plans.
    #[error(transparent)]
    Pinned(#[from] PinError),
    /// The serial number is none of this bench or this plan.
    #[error("{} does not fit the pattern {pattern} of the {of}", gnc_text::quoted(serial_number))]
    SerialNumber {
        /// The serial number.
        serial_number: String,
        /// What it must match.
        pattern: String,
        /// "plan" or "bench".
        of: &'static str,
    },
    /// A number of an order, a sub-unit or another one is none of this bench or this plan.
    #[error(transparent)]
    Number(#[from] NumberError),
    /// The earlier run cannot be taken up.
    #[error(transparent)]
    Resume(#[from] ResumeError),
    /// The module has no valid pass of a plan that must come before.
    #[error("{plan} requires a pass of {}, and {serial_number} has none that counts: {standing}", standing.plan)]
    Requires {
        /// Name of the plan that was to run.
        plan: String,
        /// The module.
        serial_number: String,
        /// What the records say of the module by the plan that is required.
        standing: Box<Standing>,
    },
    /// The clock is wrong, so the record would have a wrong date.
    #[error(transparent)]
    Clock(#[from] ClockError),
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
    pub fn try_this(&self) -> String {
        if let Self::Number(error) = self {
            return error.try_this();
        }
        self.usual_hint().to_owned()
    }

    fn usual_hint(&self) -> &'static str {
        match self {
            Self::Resume(error) => error.try_this(),
            Self::Clock(error) => error.try_this(),
            Self::Pinned(error) => error.try_this(),
            Self::Store(error) => error.try_this(),
            Self::Requires { standing, .. } => standing.try_this(),
            // Each mistake in these errors has its own hint.
            Self::SerialNumber { .. } => {
                "scan the module's label again; if it is right, correct serial_number of the plan or bench"
            }
            Self::Unfit(_) | Self::Observer(_) | Self::Number(_) => "",
        }
    }
}

/// How the rounds ended.
#[derive(Debug)]
pub struct RunsDone {
    /// The verdict of each round; there is at least one. A round that could not be begun is errored.
    pub verdicts: Vec<Verdict>,
    /// Why the last round was not begun.
    pub refused: Option<ServiceError>,
    /// The stop that left rounds undone, if one did.
    pub stopped: Option<StoppedRounds>,
}

/// A person or a signal ended the rounds before all of them were begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StoppedRounds {
    /// Who asked for the stop: "ctrl-C", "SIGTERM", "SIGHUP" or "the operator".
    pub by: &'static str,
    /// Rounds that were begun.
    pub begun: u32,
    /// Rounds that were asked for; `None` if they were to go on for a time.
    pub of: Option<u32>,
}

impl fmt::Display for StoppedRounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { by, begun, of } = self;
        match of {
            Some(of) => write!(f, "stopped by {by}: {} of {of} rounds were not begun", of.saturating_sub(*begun)),
            None => write!(f, "stopped by {by} after round {begun}, before the time for rounds was over"),
        }
    }
}

impl RunsDone {
    /// The worst verdict. Rounds that a stop left undone make it aborted: what was asked for was not done.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        let worst = Verdict::worst(self.verdicts.iter().copied()).unwrap_or(Verdict::Module(Outcome::Errored));
        if self.stopped.is_some() { worst.at_least(Outcome::Aborted) } else { worst }
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
    let (mut verdicts, mut stopped) = (Vec::new(), None);
    for round in 1.. {
        ready.order.header.looped = rounds.looped(round);
        let ending = match ready.round(request.began, control, live, observer).await {
            Ok(ending) => ending,
            Err(refused) if verdicts.is_empty() => return Err(refused),
            Err(refused) => {
                verdicts.push(Verdict::new(Outcome::Errored, request.selection.is_some()));
                return Ok(RunsDone { verdicts, refused: Some(refused), stopped: None });
            }
        };
        verdicts.push(ending.verdict);
        let bad = !ending.verdict.of_items().is_good() && request.on_fail == Some(OnFail::Stop);
        let over = rounds.are_over(round, began.elapsed());
        let asked = control.asked();
        if asked.times > 0 && !over {
            stopped = Some(StoppedRounds { by: asked.by, begun: round, of: rounds.count() });
        }
        let unrecorded = ending.store_error.is_some();
        if over || bad || stopped.is_some() || unrecorded || !ending.begun {
            break;
        }
    }
    Ok(RunsDone { verdicts, refused: None, stopped })
}

/// What the log says of a sub-unit that is built into another module.
fn in_words(reused: &Reused) -> String {
    let Reused { number, serial_number, run } = reused;
    let serial_number = gnc_text::printable(serial_number);
    format!("{number} is in module {serial_number} too, which passed with it ({run}): compare the labels")
}

/// The parts that stay the same from round to round.
struct Ready {
    order: RunOrder,
    records: PathBuf,
    key: Option<StationKey>,
    clock_is_right: bool,
}

impl Ready {
    fn open(request: &RunRequest, equipment: Equipment) -> Result<Self, ServiceError> {
        let Equipment {
            station,
            records,
            key,
            trusted_keys,
            bench,
            target,
            can,
            abilities,
            fixture,
            site,
            serial_number,
            numbers: asked,
            plans,
            clock_is_right,
        } = equipment;
        plans.check(request.plan.plan(), request.plan.sha256())?;
        for (of, pattern) in [("bench", &serial_number), ("plan", &request.plan.plan().serial_number)] {
            if let Some(pattern) = pattern.as_ref().filter(|pattern| !pattern.fits(&request.serial_number)) {
                let (serial_number, pattern) = (request.serial_number.clone(), pattern.to_string());
                return Err(ServiceError::SerialNumber { serial_number, pattern, of });
            }
        }
        let numbers = numbers::check(&asked, &request.plan.plan().numbers, &request.numbers)?;
        let mut plan = request.plan.plan().clone();
        if let Some(on_fail) = request.on_fail {
            plan.on_fail = on_fail;
        }
        let job = Job::new(plan, abilities, request.selection.as_deref())?;
        // In the order of the plan. The order of the names on the command line does not matter.
        let selection = request.selection.as_ref().map(|names| {
            let items = job.plan().items().iter().map(|item| &item.name);
            items.filter(|name| names.contains(name)).cloned().collect::<Vec<_>>()
        });
        // The way to the board decides, and each instrument beside it. What is opened later must be what was seen here.
        let doubt = target.doubt().or_else(|| can.as_ref().and_then(CanTarget::doubt));
        let bench = bench.in_doubt(doubt.map(|doubt| doubt.to_string()));
        let mut header = RunHeader {
            schema: events_form(request.selection.as_deref()).to_owned(),
            serial_number: request.serial_number.clone(),
            part: request.part.clone(),
            numbers,
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
        if !clock_is_right {
            // A wrong clock would make all records of the module those of another time.
            let at = request.began.unwrap_or_else(clock::now);
            clock::check(at, header.program.build.as_ref(), reader::newest_day(&records))?;
        }
        Self::check_required(request, &records, &plans, header.bench.kind, &trusted_keys)?;
        let now = request.began.unwrap_or_else(clock::now);
        let like = Like::header(&header, request.plan.plan().valid_days, now, &records).with_key(key.as_ref());
        let resumed = request.resume.as_deref().map(|run| Resumed::read(run, like)).transpose()?;
        header.resumed = resumed.as_ref().map(Resumed::earlier);
        let (one_by_one, nonce) = (request.one_by_one, request.nonce);
        let at = request.began.unwrap_or_else(clock::now);
        let (station, kind) = (header.station.as_str(), header.bench.kind);
        let sealer = Sealer { station, kind, program: &header.program, at, key: key.as_ref() };
        let mut found = seal_interrupted(&records, &sealer);
        found.extend(reuse::of(&records, &header).iter().map(in_words));
        let answers = request.answers.clone();
        let order = RunOrder { job, header, target, can, fixture, answers, site, resumed, one_by_one, nonce, found };
        Ok(Self { order, records, key, clock_is_right })
    }

    /// Looks for a valid pass of each plan that must come before.
    /// If the bench pins that plan, only a pass by the pinned text counts; if it has keys, only a pass that one of them signed.
    fn check_required(
        request: &RunRequest,
        records: &Path,
        plans: &PinnedPlans,
        bench: BenchKind,
        trusted_keys: &[PublicKey],
    ) -> Result<(), ServiceError> {
        let (plan, serial_number) = (request.plan.plan(), request.serial_number.as_str());
        let (valid_days, now) = (plan.valid_days, request.began.unwrap_or_else(clock::now));
        for required in &plan.requires_plan {
            let pinned = plans.of(required).map(|sha256| PlanInfo {
                name: required.clone(),
                version: String::new(),
                sha256: sha256.to_owned(),
            });
            let asked = pinned.as_ref().map_or(PlanAsked::Named(required), PlanAsked::This);
            let question = Question { serial_number, plan: asked, valid_days, bench, now };
            let standing = standing::read(records, &question, trusted_keys)?;
            if !standing.passes_beyond_doubt() {
                let (plan, serial_number) = (plan.name.clone(), gnc_text::printable(serial_number).into_owned());
                return Err(ServiceError::Requires { plan, serial_number, standing: Box::new(standing) });
            }
        }
        Ok(())
    }

    async fn round(
        &mut self,
        dated: Option<DateTime<FixedOffset>>,
        control: &RunControl,
        live: &Live,
        observer: &mut impl Observer,
    ) -> Result<Ending, ServiceError> {
        let Self { order, records, key, clock_is_right } = self;
        let plan = order.job.plan();
        let at = dated.unwrap_or_else(clock::now);
        if !*clock_is_right {
            clock::check(at, order.header.program.build.as_ref(), reader::newest_day(records))?;
        }
        // Create the folder before power-on, so that a module is not tested without a place for its record.
        let folder = RunFolder::create(records, at, &order.header.serial_number, &plan.name)?.signed_with(key.clone());
        let record = folder.clone();
        let begun = begin(folder, plan, dated, observer);
        if begun.is_err() {
            record.withdraw();
        }
        let journal = begun?;
        let ending = runner::run(order, journal, control, live).await;
        // Only the log of the first round mentions what was found before it.
        order.found.clear();
        observer.end(record.path(), &ending).await;
        Ok(ending)
    }
}

/// Opens the record of a round, which the face then hears.
fn begin(
    folder: RunFolder,
    plan: &Plan,
    dated: Option<DateTime<FixedOffset>>,
    observer: &mut impl Observer,
) -> Result<RunJournal, ServiceError> {
    let watchers = vec![observer.begin(&folder).map_err(ServiceError::Observer)?];
    Ok(match dated {
        Some(began) => RunJournal::dated(RecordWriter::without_thread(folder, plan, watchers)?, began),
        None => RunJournal::new(RecordWriter::start(folder, plan, watchers)?),
    })
}
