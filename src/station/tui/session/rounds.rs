//! One order of the screen: a run, or a run again and again.

use std::io;
use std::path::Path;
use std::time::Duration;

use gnc_bench::control::Control;
use gnc_bench::fixture::{Fixture, Question};
use gnc_bench::runner::{Ending, Live, looking};
use gnc_bench::service::{self, Observer, Request};
use gnc_executive::event::Event;
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::OnFail;
use gnc_records::store::Watcher;
use gnc_text::with_causes;
use tokio::sync::mpsc;

use super::files::{Held, NOT_HELD};
use crate::auto;
use crate::refusal::Refusal;
use crate::setup::Setup;
use crate::tui::model::{AfterFailure, Rounds};
use crate::tui::update::{Msg, Start};

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
pub(super) async fn watch(held: Held, handles: Handles) -> Finished {
    let opened = held.bench.ok_or_else(nothing_held).and_then(|bench| bench.open("", || Ok(Fixture::Absent)));
    let setup = match opened {
        Ok(setup) => setup,
        Err(refusal) => return Finished::Watch { why: Some(in_words(&refusal)) },
    };
    let looked = looking::look(&setup.equipment.target, &handles.control, &handles.live.readings).await;
    Finished::Watch { why: looked.err().map(|error| format!("{}; {}", with_causes(&error), error.try_this())) }
}

fn in_words(refusal: &Refusal) -> String {
    let hint = if refusal.try_this.is_empty() { String::new() } else { format!("; {}", refusal.try_this) };
    format!("{}{hint}", refusal.what)
}

/// The screen and what runs are out of step: nothing is started that is not shown.
fn nothing_held() -> Refusal {
    Refusal::new(NOT_HELD, "choose them again with F2")
}

/// Carries out an order of the screen.
pub(super) async fn run(held: Held, start: Start, one_by_one: bool, handles: Handles) -> Finished {
    match prepare(held, start, one_by_one, &handles) {
        Ok((request, setup)) => serve(&request, setup, handles).await,
        Err(refusal) => Finished::Run { outcome: None, store_error: None, refusal: Some(in_words(&refusal)) },
    }
}

fn prepare(held: Held, start: Start, one_by_one: bool, handles: &Handles) -> Result<(Request, Setup), Refusal> {
    let (Some(bench), Some(plan)) = (held.bench, held.plan) else { return Err(nothing_held()) };
    if plan.plan.sha256() != start.plan_sha256 {
        return Err(nothing_held());
    }
    let questions = handles.questions.clone();
    let setup = bench.open(&start.serial_number, || Ok(Fixture::Screen(questions)))?;
    let request = Request {
        plan: plan.plan.clone(),
        serial_number: start.serial_number,
        operator: start.operator,
        selection: start.selection,
        program: auto::program(),
        on_fail: match start.after_failure {
            AfterFailure::AsPlanned => None,
            AfterFailure::Stop => Some(OnFail::Stop),
            AfterFailure::GoOn => Some(OnFail::Continue),
        },
        rounds: match start.rounds {
            Rounds::Once => service::Rounds::Once,
            Rounds::Count(count) => service::Rounds::Count(count),
            Rounds::Minutes(minutes) => service::Rounds::For(Duration::from_secs(60 * u64::from(minutes))),
        },
        resume: start.resume,
        one_by_one,
        nonce: None,
        began: None,
    };
    Ok((request, setup))
}

async fn serve(request: &Request, setup: Setup, handles: Handles) -> Finished {
    // The simulated bench ends with this scope.
    let Setup { equipment, simulation: _simulation } = setup;
    let mut shown = Shown { screen: handles.screen, store_error: None };
    let done = service::run(request, equipment, &handles.control, &handles.live, &mut shown).await;
    let (outcome, refused) = match done {
        Ok(done) => (Some(done.outcome()), done.refused),
        Err(refused) => (None, Some(refused)),
    };
    let refusal = refused.map(|error| in_words(&Refusal::new(with_causes(&error), error.try_this())));
    Finished::Run { outcome, store_error: shown.store_error, refusal }
}

/// Tells the screen of each round. A screen that is far behind reads the record later.
struct Shown {
    screen: mpsc::Sender<Msg>,
    store_error: Option<String>,
}

impl Observer for Shown {
    fn begin(&mut self, folder: &Path) -> io::Result<Watcher> {
        let _ = self.screen.try_send(Msg::RoundBegins { folder: folder.to_owned() });
        let screen = self.screen.clone();
        Ok(Box::new(move |event: &Event| {
            let told = screen.try_send(Msg::Event(Box::new(event.clone())));
            !matches!(told, Err(mpsc::error::TrySendError::Closed(_)))
        }))
    }

    async fn end(&mut self, _: &Path, ending: &Ending) {
        if let Some(error) = &ending.store_error {
            self.store_error = Some(format!("{}; {}", with_causes(error), error.try_this()));
        }
    }
}
