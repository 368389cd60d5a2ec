//! One order of the screen: a run, or a run again and again.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use chrono::Local;
use gnc_bench::control::Control;
use gnc_bench::fixture::{Fixture, Question};
use gnc_bench::journal::Journal;
use gnc_bench::runner::{self, Live, Order, looking};
use gnc_executive::event::{Event, Loop};
use gnc_executive::job::Job;
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::OnFail;
use gnc_records::store::{RunFolder, Scribe, Watcher, seal_interrupted};
use gnc_text::with_causes;
use tokio::sync::mpsc;

use crate::args::RunArgs;
use crate::refusal::Refusal;
use crate::setup::{self, Setup};
use crate::tui::model::{AfterFailure, Rounds};
use crate::tui::update::{Msg, Start};
use crate::{auto, files};

/// How the run is reached from outside.
pub(super) struct Handles {
    pub control: Control,
    pub screen: mpsc::Sender<Msg>,
    pub live: Live,
    pub questions: mpsc::Sender<Question>,
}

/// How it went.
#[derive(Debug)]
pub(super) enum Finished {
    Run {
        /// The worst outcome of all rounds.
        outcome: Option<Outcome>,
        /// Why a record could not be written.
        store_error: Option<String>,
        /// Why a round was not begun.
        refusal: Option<String>,
    },
    /// A look at raw values, and why it came to an end by itself.
    Watch { why: Option<String> },
}

impl Finished {
    pub(super) fn outcome(&self) -> Option<Outcome> {
        match self {
            Self::Run { outcome, .. } => *outcome,
            Self::Watch { .. } => None,
        }
    }

    pub(super) fn into_msg(self) -> Msg {
        match self {
            Self::Run { store_error, refusal, .. } => Msg::RunOver { store_error, refusal },
            Self::Watch { why } => Msg::WatchOver { why },
        }
    }
}

/// Shows raw values until somebody asks for a stop.
pub(super) async fn watch(args: RunArgs, handles: Handles) -> Finished {
    let setup = match setup::from_args(&args, "", || Ok(Fixture::Absent)) {
        Ok(setup) => setup,
        Err(refusal) => return Finished::Watch { why: Some(in_words(&refusal)) },
    };
    let looked = looking::look(&setup.target, &handles.control, &handles.live.readings).await;
    Finished::Watch { why: looked.err().map(|error| format!("{}; {}", with_causes(&error), error.try_this())) }
}

fn in_words(refusal: &Refusal) -> String {
    let hint = if refusal.try_this.is_empty() { String::new() } else { format!("; {}", refusal.try_this) };
    format!("{}{hint}", refusal.what)
}

/// What is known of rounds so far.
#[derive(Debug, Default)]
struct SoFar {
    outcome: Option<Outcome>,
    store_error: Option<String>,
}

pub(super) async fn run(mut args: RunArgs, plan: PathBuf, start: Start, handles: Handles) -> Finished {
    args.operator.clone_from(&start.operator);
    args.only.clone_from(&start.selection);
    let mut so_far = SoFar::default();
    let all = all(&args, &plan, &start, &handles, &mut so_far).await;
    let refusal = all.err().map(|refusal| in_words(&refusal));
    Finished::Run { outcome: so_far.outcome, store_error: so_far.store_error, refusal }
}

async fn all(
    args: &RunArgs,
    plan: &std::path::Path,
    start: &Start,
    handles: &Handles,
    so_far: &mut SoFar,
) -> Result<(), Refusal> {
    let mut plan = files::plan(plan)?;
    match start.after_failure {
        AfterFailure::AsPlanned => {}
        AfterFailure::Stop => plan.on_fail = OnFail::Stop,
        AfterFailure::GoOn => plan.on_fail = OnFail::Continue,
    }
    let questions = handles.questions.clone();
    let setup = setup::from_args(args, &start.serial_number, || Ok(Fixture::Screen(questions)))?;
    let job =
        Job::new(plan.clone(), setup.abilities, args.only.as_deref()).map_err(|mistakes| Refusal::new(mistakes, ""))?;
    let header = auto::header(args, &plan, &setup, &start.serial_number);
    let Setup { records, key, target, can, fixture, site, simulation, .. } = setup;
    let (one_by_one, found) = (args.one_by_one, seal_interrupted(&records, key.as_ref()));
    let mut order = Order { job, header, target, can, fixture, site, resumed: None, one_by_one, nonce: None, found };
    // The simulated bench ends with this scope.
    let _simulation = simulation;
    let control = &handles.control;
    let began = Instant::now();
    for round in 1.. {
        let (looped, last) = match start.rounds {
            Rounds::Once => (None, true),
            Rounds::Count(count) => (Some(Loop { index: round, count: Some(count) }), round >= count),
            Rounds::Minutes(_) => (Some(Loop { index: round, count: None }), false),
        };
        order.header.looped = looped;
        let folder = RunFolder::create(&records, Local::now().fixed_offset(), &start.serial_number, &plan.name)
            .map_err(|error| Refusal::new(with_causes(&error), error.try_this()))?
            .signed_with(key.clone());
        // A screen that is that far behind reads the record later.
        let _ = handles.screen.try_send(Msg::RoundBegins { folder: folder.path().to_owned() });
        let screen = handles.screen.clone();
        let watcher: Watcher = Box::new(move |event: &Event| {
            let told = screen.try_send(Msg::Event(Box::new(event.clone())));
            !matches!(told, Err(mpsc::error::TrySendError::Closed(_)))
        });
        let scribe = Scribe::start(folder, &plan, vec![watcher])
            .map_err(|error| Refusal::new(with_causes(&error), error.try_this()))?;
        let ending = runner::run(&order, Journal::new(scribe), control, &handles.live).await;
        order.found.clear();
        so_far.outcome = Outcome::worst(so_far.outcome.into_iter().chain([ending.outcome]));
        if let Some(error) = &ending.store_error {
            so_far.store_error = Some(format!("{}; {}", with_causes(error), error.try_this()));
        }
        let time_over = match start.rounds {
            Rounds::Minutes(minutes) => began.elapsed() >= Duration::from_secs(60 * u64::from(minutes)),
            Rounds::Once | Rounds::Count(_) => false,
        };
        let bad = !ending.outcome.is_good() && start.after_failure == AfterFailure::Stop;
        let stopped = control.asked().times > 0;
        if last || time_over || bad || stopped || !ending.begun || ending.store_error.is_some() {
            return Ok(());
        }
    }
    Ok(())
}
