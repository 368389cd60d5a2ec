//! All that the screen knows. Only [`update`](super::update::update) changes it, and drawing only reads it.

mod files;
mod message;
mod power;
mod run;
mod scan;

use std::cell::Cell;
use std::path::PathBuf;
use std::time::Duration;

use chrono::{DateTime, FixedOffset};
use gnc_executive::numbers::{self, NumberField};
use gnc_executive::part::PartName;
use gnc_executive::standing::Standing;
use gnc_executive::state::RunState;
use gnc_records::shift::Shift;

use super::keymap::{self, Binding, KeyAction, KeyContext};
use super::lang::{Lang, Texts};
use super::numbers::{Numbers, Owner};
use super::pending::{Interrupted, PendingStart};
use super::pictures::Pictures;
pub(crate) use super::prompt::Prompt;
use super::records::Records;
use super::update::interrupt::Interrupts;
use crate::files::ChangedFile;
pub(crate) use crate::locale::Glyphs;
pub(crate) use files::{BenchView, DriftLimits, Loaded, PlanAsks, PlanView, ProgramView, UsualOperator};
pub(crate) use message::MessageWeight;
pub(crate) use power::{PowerKnown, PowerSeen};
pub(crate) use run::{ASK_FROM_S, AfterFailure, Pause, Progress, RoundsSetting, RunView, order};
pub(crate) use scan::Scan;

/// The time, passed in so that every screen can be drawn again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Now {
    /// Time of day.
    pub at: DateTime<FixedOffset>,
    /// Time since the program started, by a clock that never jumps.
    pub since_start: Duration,
}

/// What the terminal can show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Look {
    /// Whether colours are wanted.
    pub colour: bool,
    /// Which characters it has.
    pub glyphs: Glyphs,
    /// The terminal cannot show the language that was asked for.
    pub poor: bool,
}

/// A page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ScreenPage {
    Tests,
    /// Guidance through captures; only if the plan captures.
    Calibration,
    Live,
    Records,
}

/// A layer over a page.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Over {
    /// The keys of the place below.
    Help { place: KeyContext, scroll: usize },
    /// The form.
    Setup(super::setup_form::Form),
    /// One item of the run shown, by its name.
    Item { name: String, scroll: usize },
    /// The log of the run shown.
    Log { scroll: usize },
    /// All mistakes of bench or plan.
    Mistakes { scroll: usize },
    /// The plan was run on the module before; test it again?
    Again(Standing),
    /// Files are not as they were checked; run what was checked, or read them again?
    Changed(Vec<ChangedFile>),
    /// A run of the module broke off; take it up again?
    Interrupted(Interrupted),
    /// The run that was asked for cannot be taken up; run the plan from its beginning?
    NoResume { why: String },
    /// A run is on; leave?
    Leave,
    /// A stop would lose captures of this bench time; stop?
    Stop { lost_s: f64 },
    /// The end of an item would lose captures of this bench time; end it?
    GiveUp { item: String, lost_s: f64 },
}

/// All that the screen knows.
#[derive(Debug)]
pub(crate) struct ScreenModel {
    pub lang: Lang,
    pub texts: &'static Texts,
    pub look: Look,
    pub now: Now,
    pub page: ScreenPage,
    pub over: Vec<Over>,
    pub message: Option<(MessageWeight, String)>,
    /// When the message came, since the start of the program.
    pub message_since: Duration,
    /// Why the record of a run could not be written. It stays until a run is recorded again.
    pub unrecorded: Option<String>,
    pub bench: Loaded<BenchView>,
    pub bench_path: String,
    pub plan: Loaded<PlanView>,
    pub plan_path: String,
    pub operator: String,
    /// The name is that of the last run; whether the same person is here is not confirmed.
    pub operator_remembered: bool,
    /// The part that modules must be, and its revision; empty: any.
    pub part: [String; 2],
    /// Numbers of orders, sub-units and others.
    pub numbers: Numbers,
    pub rounds: RoundsSetting,
    pub after_failure: AfterFailure,
    pub scan: Scan,
    /// The picture of the question that is asked.
    pub pictures: Pictures,
    pub pending: Option<PendingStart>,
    /// The run that the command line wants to take up, until the operator has decided about it.
    pub resume: Option<PathBuf>,
    /// The serial number of that run's module.
    pub resume_of: String,
    /// Items that are to be run, in the order of the plan.
    pub ticks: Vec<bool>,
    /// Items that the command line chose.
    pub only: Option<Vec<String>>,
    /// The line under the cursor, in the order shown.
    pub cursor: usize,
    /// The operator has moved the cursor since the run began, so the list stays where it is.
    pub cursor_moved: bool,
    /// The words about the last item that was aborted in the run.
    pub aborting: Option<String>,
    /// When the question whether to end an item went, since its attempt had ended; since the start of the program.
    pub give_up_gone: Option<Duration>,
    pub run: Option<RunView>,
    pub live: super::live::History,
    /// The module that the live values are of.
    pub live_of: Option<String>,
    /// Raw values are shown without a run.
    pub watching: bool,
    pub power_seen: PowerSeen,
    /// The line to the board is lost in the run that is on.
    pub line_lost: bool,
    pub records: Records,
    /// The modules of this shift; `None` until the records were read.
    pub shift: Option<Shift>,
    /// The terminal is to ring.
    pub ring: bool,
    /// What tells the meaning of ctrl-C.
    pub interrupts: Interrupts,
    /// The program ends as soon as the run has stopped.
    pub leaving: bool,
    /// The screen must draw every cell again, since other output has overwritten the cells.
    pub redraw: bool,
    /// How far the last drawing could scroll.
    pub scroll_end: Cell<usize>,
    /// Files to choose from.
    pub choices: super::setup_form::Choices,
}

impl ScreenModel {
    pub(crate) fn new(lang: Lang, look: Look, now: Now) -> Self {
        Self {
            lang,
            texts: lang.texts(),
            look,
            now,
            page: ScreenPage::Tests,
            over: Vec::new(),
            message: look.poor.then(|| (MessageWeight::Warning, lang.texts().no_glyphs.to_owned())),
            message_since: now.since_start,
            unrecorded: None,
            bench: Loaded::Loading,
            bench_path: String::new(),
            plan: Loaded::Loading,
            plan_path: String::new(),
            operator: String::new(),
            operator_remembered: false,
            part: Default::default(),
            numbers: Numbers::default(),
            rounds: RoundsSetting::Once,
            after_failure: AfterFailure::AsPlanned,
            scan: Scan::default(),
            pictures: Pictures::default(),
            pending: None,
            resume: None,
            resume_of: String::new(),
            ticks: Vec::new(),
            only: None,
            cursor: 0,
            cursor_moved: false,
            aborting: None,
            give_up_gone: None,
            run: None,
            live: super::live::History::default(),
            live_of: None,
            watching: false,
            power_seen: PowerSeen::ByRun,
            line_lost: false,
            records: Records::default(),
            shift: None,
            ring: false,
            interrupts: Interrupts::default(),
            leaving: false,
            redraw: false,
            scroll_end: Cell::new(0),
            choices: super::setup_form::Choices::default(),
        }
    }

    /// The parts that have limits of their own, and their revisions.
    pub(crate) fn parts(&self) -> &[PartName] {
        self.plan.ready().map_or(&[], |plan| &plan.asks.parts)
    }

    /// The numbers that the bench asks for and those that the plan does, as far as these are known.
    pub(crate) fn numbers_of_bench_and_plan(&self) -> (&[NumberField], &[NumberField]) {
        let bench = self.bench.ready().map_or(&[][..], |bench| &bench.numbers);
        (bench, self.plan.ready().map_or(&[][..], |plan| &plan.asks.numbers))
    }

    /// All of them, each once.
    pub(crate) fn asked_numbers(&self) -> Vec<NumberField> {
        let (bench, plan) = self.numbers_of_bench_and_plan();
        numbers::asked(bench, plan).into_iter().cloned().collect()
    }

    /// Whether a number that is given now is of the module after the one on the screen.
    pub(crate) fn numbers_are_later(&self) -> bool {
        self.is_running() || self.scan.next.is_some()
    }

    /// The module that a number is given for now.
    pub(crate) fn owner_of_numbers(&self) -> Owner {
        match &self.run {
            _ if self.numbers_are_later() => Owner::Next,
            Some(_) => Owner::Coming,
            None if self.scan.current.is_none() => Owner::Coming,
            None => Owner::Present,
        }
    }

    /// Whether a run is on.
    pub(crate) fn is_running(&self) -> bool {
        self.run.as_ref().is_some_and(|run| !run.over)
    }

    /// Whether bench and plan are read and have no mistakes, or are being read.
    pub(crate) fn is_refused(&self) -> bool {
        matches!(self.bench, Loaded::Refused(_)) || matches!(self.plan, Loaded::Refused(_))
    }

    /// Why bench or plan is refused; the bench first.
    pub(crate) fn refused_why(&self) -> Option<&str> {
        match (&self.bench, &self.plan) {
            (Loaded::Refused(why), _) | (_, Loaded::Refused(why)) => Some(why),
            _ => None,
        }
    }

    /// What F5 does with the module that was scanned.
    pub(crate) fn what_f5_does(&self) -> &'static str {
        if self.is_refused() { self.texts.scanned_refused } else { self.texts.scanned }
    }

    /// Whether what is typed or scanned is the answer to a question of the plan.
    pub(crate) fn takes_words(&self) -> bool {
        let prompt = self.run.as_ref().and_then(|run| run.prompt.as_ref());
        self.place() == KeyContext::Question && prompt.is_some_and(Prompt::takes_words)
    }

    /// The context in which the next key is pressed.
    pub(crate) fn place(&self) -> KeyContext {
        match self.over.last() {
            Some(Over::Again(_) | Over::NoResume { .. } | Over::Leave) => return KeyContext::Confirm,
            Some(Over::Changed(_)) => return KeyContext::Changed,
            Some(Over::Interrupted(_)) => return KeyContext::Interrupted,
            Some(Over::Stop { .. }) => return KeyContext::Stopping,
            Some(Over::GiveUp { .. }) => return KeyContext::GivingUp,
            Some(Over::Help { .. }) => return KeyContext::Help,
            Some(Over::Setup(_)) => return KeyContext::Setup,
            _ => {}
        }
        if self.run.as_ref().is_some_and(|run| run.prompt.is_some()) {
            let question = self.run.as_ref().and_then(|run| run.prompt.as_ref()).is_some_and(Prompt::has_answer);
            return if question { KeyContext::Question } else { KeyContext::Prompt };
        }
        match (self.over.last(), self.page) {
            (Some(_), _) => KeyContext::Detail,
            (None, ScreenPage::Live | ScreenPage::Calibration) if self.is_running() => KeyContext::LiveRunning,
            (None, ScreenPage::Live) if self.watching => KeyContext::Watching,
            (None, ScreenPage::Live) => KeyContext::Live,
            (None, ScreenPage::Calibration) => KeyContext::Calibration,
            (None, ScreenPage::Records) if self.records.open.is_some() => KeyContext::Record,
            (None, ScreenPage::Records) => KeyContext::Records,
            (None, ScreenPage::Tests) if self.is_running() => KeyContext::Running,
            (None, ScreenPage::Tests) => KeyContext::Idle,
        }
    }

    /// The keys that do something now: nothing can be stopped while nothing is on, and a day is not compared with its digests.
    pub(crate) fn keys(&self, place: KeyContext) -> impl Iterator<Item = &'static Binding> {
        let on = self.is_running() || self.watching;
        let days = place == KeyContext::Records && self.records.runs.is_none();
        keymap::bindings(place).filter(move |binding| match binding.action {
            KeyAction::Stop => on,
            KeyAction::Verify => !days,
            _ => true,
        })
    }

    /// Whether there is a page for captures.
    pub(crate) fn captures(&self) -> bool {
        self.page == ScreenPage::Calibration || self.plan.ready().is_some_and(|plan| !plan.programs.is_empty())
    }

    /// The run that the page shows, if it shows one.
    pub(crate) fn shown_state(&self) -> Option<&RunState> {
        match self.page {
            ScreenPage::Records => self.records.open.as_ref().map(|open| &open.state),
            ScreenPage::Tests | ScreenPage::Calibration | ScreenPage::Live => self.run.as_ref().map(|run| &run.state),
        }
    }

    /// Positions of the items of the tests page in the order in which they are shown.
    pub(crate) fn order(&self) -> Vec<usize> {
        match &self.run {
            Some(run) if !run.state.rows().is_empty() => order(&run.state),
            _ => (0..self.plan.ready().map_or(0, |plan| plan.items.len())).collect(),
        }
    }

    /// Name of the item under the cursor of the tests page.
    pub(crate) fn item_under_cursor(&self) -> Option<&str> {
        let position = *self.order().get(self.cursor)?;
        match &self.run {
            Some(run) if !run.state.rows().is_empty() => Some(&run.state.rows()[position].planned.name),
            _ => Some(&self.plan.ready()?.items.get(position)?.name),
        }
    }

    /// Moves the clock on: old messages go, and the time of a pause is counted.
    pub(crate) fn goes_on(&mut self, now: Now) {
        let step = now.since_start.saturating_sub(self.now.since_start);
        self.now = now;
        if self.message_left() == Some(Duration::ZERO) {
            self.message = None;
        }
        // Also while the items at work end: those that wait are not begun, and need their time afterwards. A capture that ends
        // meanwhile is no pause: its time is a share of the whole.
        let captures =
            |run: &RunView| run.state.in_flight() > 0 && run.progress.iter().any(|each| each.guidance.is_some());
        if let Some(run) = self.run.as_mut().filter(|run| run.pause == Pause::Asked && !run.over && !captures(run)) {
            run.paused += step;
        }
    }

    /// Has the terminal ring, if the bench file wants it.
    pub(crate) fn call(&mut self) {
        self.ring |= self.bench.ready().is_some_and(|bench| bench.bell);
    }

    /// Whether the picture changes by time alone within a second.
    pub(crate) fn moves(&self) -> bool {
        // Old values have an age in seconds.
        let ages = self.page == ScreenPage::Live && !self.live.is_empty();
        self.is_running() || self.watching || ages
    }
}
