//! One order of the screen: one run, or repeated runs.

use std::io;
use std::path::Path;
use std::time::Duration;

use gnc_bench::control::RunControl;
use gnc_bench::fixture::{Fixture, OperatorQuestion};
use gnc_bench::questions::{Answers, Person};
use gnc_bench::runner::{Ending, Live, looking};
use gnc_bench::service::{self, Observer, RunRequest};
use gnc_executive::event::Event;
use gnc_executive::plan::OnFail;
use gnc_executive::verdict::Verdict;
use gnc_records::store::{RunFolder, Watcher, as_written};
use gnc_text::with_causes;
use tokio::sync::mpsc;

use super::files::{Held, NOT_HELD};
use super::told::Told;
use crate::lost::not_kept;
use crate::refusal::CommandRefusal;
use crate::setup::Setup;
use crate::tui::model::{AfterFailure, RoundsSetting};
use crate::tui::update::{Msg, StartRequest};
use crate::{args, version};

/// Handles by which the session and the screen reach the run.
pub(super) struct Handles {
    pub control: RunControl,
    pub screen: mpsc::Sender<Msg>,
    pub live: Live,
    pub questions: mpsc::Sender<OperatorQuestion>,
    /// Who else learns of verdicts.
    pub told: Told,
}

/// How an order ended.
#[derive(Debug)]
pub(super) enum Finished {
    Run {
        /// The worst verdict of all rounds.
        verdict: Option<Verdict>,
        /// Why a record could not be written.
        store_error: Option<String>,
        /// Why a round was not begun.
        refusal: Option<String>,
    },
    /// A look at raw values; `why` says why it ended by itself.
    Watch { why: Option<String> },
}

impl Finished {
    pub(super) fn verdict(&self) -> Option<Verdict> {
        match self {
            Self::Run { verdict, .. } => *verdict,
            Self::Watch { .. } => None,
        }
    }

    pub(super) fn into_msg(self) -> Msg {
        match self {
            Self::Run { verdict, store_error, refusal } => Msg::RunOver { verdict, store_error, refusal },
            Self::Watch { why } => Msg::WatchOver { why },
        }
    }
}

/// Shows raw values until the operator stops this.
pub(super) async fn watch(held: Held, handles: Handles) -> Finished {
    let opened = held.bench.ok_or_else(nothing_held).and_then(|bench| bench.open("", || Ok(Fixture::Absent)));
    let setup = match opened {
        Ok(setup) => setup,
        Err(refusal) => return Finished::Watch { why: Some(in_words(&refusal)) },
    };
    let looked = looking::look(&setup.equipment.target, &handles.control, &handles.live.readings).await;
    Finished::Watch { why: looked.err().map(|error| format!("{}; {}", with_causes(&error), error.try_this())) }
}

fn in_words(refusal: &CommandRefusal) -> String {
    let hint = if refusal.try_this.is_empty() { String::new() } else { format!("; {}", refusal.try_this) };
    format!("{}{hint}", refusal.what)
}

/// Refuses to start what is not on the screen: the screen and the session are out of step.
fn nothing_held() -> CommandRefusal {
    CommandRefusal::new(NOT_HELD, "choose them again with F2")
}

/// Carries out an order of the screen.
pub(super) async fn run(held: Held, start: StartRequest, one_by_one: bool, handles: Handles) -> Finished {
    match prepare(held, start, one_by_one, &handles) {
        Ok((request, setup)) => serve(&request, setup, handles).await,
        Err(refusal) => Finished::Run { verdict: None, store_error: None, refusal: Some(in_words(&refusal)) },
    }
}

fn prepare(
    held: Held,
    start: StartRequest,
    one_by_one: bool,
    handles: &Handles,
) -> Result<(RunRequest, Setup), CommandRefusal> {
    let (Some(bench), Some(plan)) = (held.bench, held.plan) else { return Err(nothing_held()) };
    if plan.plan.sha256() != start.plan_sha256 {
        return Err(nothing_held());
    }
    let questions = handles.questions.clone();
    let setup = bench.open(&start.serial_number, || Ok(Fixture::Screen(questions)))?;
    // Also a bench that turns its module by itself has the person at the screen.
    let answers = Answers::default().with(Person::Screen(handles.questions.clone()));
    let [part, revision] = start.part.each_ref().map(|text| Some(text.trim()).filter(|text| !text.is_empty()));
    let request = RunRequest {
        plan: plan.plan.clone(),
        serial_number: start.serial_number,
        part: args::asked_part(part, revision)?,
        numbers: start.numbers,
        operator: start.operator,
        selection: start.selection,
        answers,
        program: version::program(),
        on_fail: match start.after_failure {
            AfterFailure::AsPlanned => None,
            AfterFailure::Stop => Some(OnFail::Stop),
            AfterFailure::GoOn => Some(OnFail::Continue),
        },
        rounds: match start.rounds {
            RoundsSetting::Once => service::Rounds::Once,
            RoundsSetting::Count(count) => service::Rounds::Count(count),
            RoundsSetting::For(time) => service::Rounds::For(time),
            RoundsSetting::Minutes(minutes) => service::Rounds::For(Duration::from_secs(60 * u64::from(minutes))),
        },
        resume: start.resume,
        one_by_one,
        nonce: None,
        began: None,
    };
    Ok((request, setup))
}

async fn serve(request: &RunRequest, setup: Setup, handles: Handles) -> Finished {
    // The simulated bench ends with this scope.
    let Setup { equipment, simulation: _simulation } = setup;
    let serial_number = request.serial_number.clone();
    let mut shown = Shown { screen: handles.screen, told: handles.told, serial_number, store_error: None };
    let done = service::run(request, equipment, &handles.control, &handles.live, &mut shown).await;
    let (verdict, refused) = match done {
        Ok(done) => (Some(done.verdict()), done.refused),
        Err(refused) => (None, Some(refused)),
    };
    let refusal = refused.map(|error| in_words(&CommandRefusal::new(with_causes(&error), &error.try_this())));
    Finished::Run { verdict, store_error: shown.store_error, refusal }
}

/// Tells the screen of each round. A screen that is far behind reads the record later.
struct Shown {
    screen: mpsc::Sender<Msg>,
    told: Told,
    serial_number: String,
    store_error: Option<String>,
}

impl Observer for Shown {
    fn begin(&mut self, folder: &RunFolder) -> io::Result<Watcher> {
        let _ = self.screen.try_send(Msg::RoundBegins { folder: folder.path().to_owned() });
        let screen = self.screen.clone();
        Ok(Box::new(move |event: &Event| {
            let told = screen.try_send(Msg::Event(Box::new(event.clone())));
            !matches!(told, Err(mpsc::error::TrySendError::Closed(_)))
        }))
    }

    async fn end(&mut self, folder: &Path, ending: &Ending) {
        self.told.verdict(folder, &self.serial_number, ending.verdict);
        // The record of another module than was scanned was moved.
        let _ = self.screen.try_send(Msg::RoundEnded { folder: folder.to_owned() });
        if let Some((what, hint)) = as_written::of_strangers(folder) {
            let _ = self.screen.try_send(Msg::Strangers(format!("{what}; {hint}")));
        }
        if let Some(error) = &ending.store_error {
            let hint = error.try_this();
            self.store_error = Some(match not_kept(folder, ending.begun, error) {
                // The hint stands on a line of its own.
                Some(whole) => format!("{whole}\n{hint}"),
                None => format!("{}; {hint}", with_causes(error)),
            });
        }
    }
}
