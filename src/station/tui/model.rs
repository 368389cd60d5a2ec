//! All that the screen knows. Only [`update`](super::update::update) changes it, and drawing only reads it.

use std::borrow::Cow;
use std::cell::Cell;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use chrono::{DateTime, FixedOffset};
use gnc_analysis::motion::{self, MotionProgram, MotionStep};
use gnc_bench::guidance::Guidance;
use gnc_executive::bench::DrawPictures;
use gnc_executive::catalogue::TEMPERATURE_DRIFT;
use gnc_executive::event::{BenchKind, PlannedItem};
use gnc_executive::limit::Limit;
use gnc_executive::numbers::{self, NumberField};
use gnc_executive::outcome::Outcome;
use gnc_executive::part::{LimitsChosen, PartName};
use gnc_executive::plan::{Phase, PlanItem, QuestionWords};
use gnc_executive::serial_number::SerialNumberPattern;
use gnc_executive::standing::Standing;
use gnc_executive::state::RunState;
use gnc_executive::verdict::Verdict;
use gnc_records::shift::Shift;

use super::field::{InputField, MAX_CHARACTERS};
use super::keymap::{self, Binding, KeyAction, KeyContext};
use super::lang::{Lang, Texts};
use super::numbers::{Numbers, Owner};
use super::pending::{Interrupted, PendingStart};
use super::pictures::Pictures;
pub(crate) use super::prompt::Prompt;
use super::records::Records;
use crate::files::ChangedFile;
pub(crate) use crate::locale::Glyphs;
use crate::phrases::in_language;

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

/// The bench as far as the screen shows it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BenchView {
    /// Which station.
    pub station: String,
    /// Real or simulated.
    pub kind: BenchKind,
    /// The simulated module, or the bench's file.
    pub name: String,
    /// The way to the board.
    pub link: String,
    /// Where records go.
    pub records: PathBuf,
    /// Who tests, by the bench file or by the last run of this shift.
    pub operator: Option<UsualOperator>,
    /// No run begins without an operator's name.
    pub operator_required: bool,
    /// The terminal rings at each verdict and each question.
    pub bell: bool,
    /// How pictures of questions are drawn.
    pub pictures: DrawPictures,
    /// What serial numbers must match on this bench.
    pub serial_number: Option<SerialNumberPattern>,
    /// Numbers beside it that each run on this bench is asked for.
    pub numbers: Arc<[NumberField]>,
}

/// The operator, if the command line names none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct UsualOperator {
    pub name: String,
    /// The name is that of the last run, and the bench file names nobody.
    pub remembered: bool,
}

/// The content of a file that may be refused.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Loaded<T> {
    /// Being read.
    Loading,
    /// The content as it was read.
    Ready(T),
    /// Why it is refused, mistakes and hints included; lines for people.
    Refused(String),
}

impl<T> Loaded<T> {
    pub(crate) fn ready(&self) -> Option<&T> {
        match self {
            Self::Ready(value) => Some(value),
            Self::Loading | Self::Refused(_) => None,
        }
    }
}

/// The plan as far as the screen shows it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PlanView {
    pub name: String,
    pub version: String,
    /// Digest of the plan that was checked. A start runs exactly this plan.
    pub sha256: String,
    pub items: Vec<PlannedItem>,
    /// The programs of the items that capture.
    pub programs: Vec<ProgramView>,
    /// The part that the plan is for, if the plan names one.
    pub part: Option<String>,
    /// What serial numbers must match for this plan.
    pub serial_number: Option<SerialNumberPattern>,
    /// What depends on the module or is asked of the operator; shared, since the view travels in messages.
    pub asks: Arc<PlanAsks>,
    /// Seconds that the last whole run took.
    pub expected_s: Option<f64>,
}

/// What a plan asks for beside the serial number, and what it limits by the part number.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PlanAsks {
    /// Numbers that each run of this plan is asked for.
    pub numbers: Vec<NumberField>,
    /// The parts that have limits of their own, and their revisions.
    pub parts: Vec<PartName>,
    /// The limits of temperature drifts for each of them.
    pub drift_limits: Vec<DriftLimits>,
    /// The words of the questions of the plan: errors and the log have them in English.
    pub words: Vec<QuestionWords>,
}

/// The limits of temperature drifts for a part.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DriftLimits {
    pub part: PartName,
    /// By the names of items.
    pub limits: Vec<(String, Option<Limit>)>,
}

impl PlanView {
    /// The limit of the temperature's drift in an item by the limits that were chosen for the module.
    pub(crate) fn drift_limit(&self, item: &str, chosen: Option<&LimitsChosen>) -> Option<&Limit> {
        let part = chosen.and_then(|chosen| chosen.part.as_ref());
        let limits = part.and_then(|part| self.asks.drift_limits.iter().find(|limits| limits.part == *part));
        match limits {
            Some(of_part) => of_part.limits.iter().find(|(name, _)| name == item)?.1.as_ref(),
            None => self.programs.iter().find(|program| program.item == item)?.drift_limit.as_ref(),
        }
    }
}

/// The program of an item that captures, as far as it is known beforehand.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ProgramView {
    /// Name of the item.
    pub item: String,
    /// Captures that it makes.
    pub captures: usize,
    /// Times that the module is laid down.
    pub lays: usize,
    /// Bench time of all captures and pauses.
    pub span_s: f64,
    /// Bench time of the captures that a resumed run makes anew although they are finished, in all rounds of the item.
    pub anew_s: f64,
    /// The limit of the temperature's drift, as the plan has it.
    pub drift_limit: Option<Limit>,
}

impl ProgramView {
    /// The program of an item; `None` if it captures nothing by itself.
    pub(crate) fn of(item: &PlanItem) -> Option<Self> {
        let program = motion::program(item.id, &item.params).ok()??;
        let drift_limit = item.limit(TEMPERATURE_DRIFT.name).cloned();
        let captures = program.steps.iter().filter_map(MotionStep::about).count();
        let anew_s = anew_s(&program) * f64::from(item.repeats);
        let (item, lays, span_s) = (item.name.clone(), program.lays(), program.span_s());
        Some(Self { item, captures, lays, span_s, anew_s, drift_limit })
    }
}

/// What a stop would lose of a program whose steps are all over.
fn anew_s(program: &MotionProgram) -> f64 {
    let mut guidance = Guidance::new(program);
    for step in &program.steps {
        guidance.begin(step);
        guidance.end(step);
    }
    guidance.lost_s()
}

/// How often a plan is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RoundsSetting {
    Once,
    /// So many times.
    Count(u32),
    /// For so many minutes; a round under way is finished.
    Minutes(u32),
    /// For a time of the command line that is no whole number of minutes.
    For(Duration),
}

/// Whether a bad item ends the run and its rounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AfterFailure {
    AsPlanned,
    Stop,
    GoOn,
}

/// An item at work.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Progress {
    pub item: String,
    /// Share of the present step, 0 to 1000; `None` where its length is not known.
    pub done_permille: Option<u16>,
    pub elapsed: Duration,
    /// The way through its captures, if it captures.
    pub guidance: Option<Arc<Guidance>>,
}

/// How far a pause is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pause {
    No,
    /// The pause begins when the items at work have finished.
    Asked,
}

/// The run that is on, or the last one.
#[derive(Debug)]
pub(crate) struct RunView {
    /// The fold of its events.
    pub state: RunState,
    /// The module, as scanned.
    pub serial_number: String,
    /// The folder of its record.
    pub folder: Option<PathBuf>,
    /// No event and no round follows.
    pub over: bool,
    /// An event is missing; the record has it.
    pub events_lost: bool,
    pub progress: Vec<Progress>,
    pub prompt: Option<Prompt>,
    pub pause: Pause,
    /// How often a stop was asked for on the screen.
    pub stops: u32,
    /// When the round began, since the start of the program.
    pub began: Duration,
    /// How long the round was paused so far.
    pub paused: Duration,
    /// Seconds that the round is expected to take.
    pub expected_s: Option<f64>,
    /// Verdicts of the rounds so far.
    pub ends: Vec<Verdict>,
    /// The worst verdict, as the run service tells it at the end.
    pub told: Option<Verdict>,
    pub rounds: RoundsSetting,
    /// Why the record could not be written.
    pub store_error: Option<String>,
}

impl RunView {
    pub(crate) fn new(serial_number: String, rounds: RoundsSetting, expected_s: Option<f64>, now: &Now) -> Self {
        Self {
            state: RunState::new(),
            serial_number,
            folder: None,
            over: false,
            events_lost: false,
            progress: Vec::new(),
            prompt: None,
            pause: Pause::No,
            stops: 0,
            began: now.since_start,
            paused: Duration::ZERO,
            expected_s,
            ends: Vec::new(),
            told: None,
            rounds,
            store_error: None,
        }
    }

    /// Whether the run ended while the module was under power: its board switches it off by itself, and nobody has
    /// seen it.
    pub(crate) fn power_unknown(&self) -> bool {
        self.over && self.state.power().is_some_and(|power| power.on)
    }

    /// The verdict, once the run is over. A run that could not be recorded does not pass.
    pub(crate) fn verdict(&self) -> Option<Verdict> {
        if !self.over {
            return None;
        }
        let errored = Verdict::new(Outcome::Errored, self.state.is_selection());
        let worst = Verdict::worst(self.ends.iter().copied().chain(self.told)).unwrap_or(errored);
        Some(if self.store_error.is_some() { errored } else { worst })
    }

    /// Items whose work is worth repeating, and those that were skipped because of them.
    pub(crate) fn to_repeat(&self) -> Vec<String> {
        use gnc_executive::outcome::Cause;
        let rows = self.state.rows().iter().filter(|row| row.planned.phase == Phase::Test && row.planned.selected);
        rows.filter(|row| match row.outcome {
            Outcome::Failed | Outcome::Errored | Outcome::Aborted | Outcome::Marginal | Outcome::NotRun => true,
            Outcome::Skipped => !matches!(row.cause, Some(Cause::DeviceMissing { .. })),
            Outcome::Passed => false,
        })
        .map(|row| row.planned.name.clone())
        .collect()
    }
}

/// Serial numbers: the one being typed, the current one, and the next one.
#[derive(Debug, Default)]
pub(crate) struct Scan {
    pub typed: InputField,
    /// The last characters that came as keys, whether a field took them or not; the beginning of a scan may be among them.
    pub recent: String,
    /// The last scan without a line end.
    pub unended: String,
    /// The scans of this scanner have a line end, so one without was cut off.
    pub has_ends: bool,
    pub current: Option<String>,
    /// Scanned while a run was on.
    pub next: Option<String>,
    /// What the records say of `current` by the plan on the screen; `None` until they were searched.
    pub standing: Option<Standing>,
}

/// Bench time of lost captures from which a stop is asked about: less is made again while the operator fetches a coffee.
pub(crate) const ASK_FROM_S: f64 = 600.0;
/// How long news stays on the screen: long enough to be read twice.
const INFO_STAYS: Duration = Duration::from_secs(30);
/// How long a warning stays: an operator may be at the socket.
const WARNING_STAYS: Duration = Duration::from_secs(120);

/// What is known of the module's power, beside what the run on the screen says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PowerSeen {
    /// Nothing was on since the run on the screen.
    ByRun,
    /// The board has confirmed, after values were watched, that the module is off.
    Off,
    /// The module was under power when the station last heard of it, and no board has confirmed since that it is off.
    Unknown,
}

/// Whether the station knows if the module is under power.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PowerKnown {
    Known,
    /// Nothing is on, and nobody has seen the module go off.
    Unknown,
    /// The line was lost in the run that is on, and the station asks for the board again.
    LineLost,
}

/// How much a message matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MessageWeight {
    Info,
    Warning,
    Error,
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
    /// The name is that of the last run, and nobody has said that the same person is here.
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
    /// The program ends as soon as the run has stopped.
    pub leaving: bool,
    /// The screen must draw every cell again, since other output has overwritten the cells.
    pub redraw: bool,
    /// How far the last drawing could scroll.
    pub scroll_end: Cell<usize>,
    /// Files to choose from.
    pub choices: super::setup_form::Choices,
}

impl Scan {
    /// Whether what is typed is a scan without a line end, and no hand has changed it.
    pub(crate) fn waits(&self) -> bool {
        !self.unended.is_empty() && self.typed.text() == self.unended
    }

    /// Keeps a character that came as a key, and forgets what no scan can reach back to.
    pub(crate) fn keep(&mut self, character: char) {
        self.recent.push(character);
        if self.recent.chars().count() > MAX_CHARACTERS {
            self.recent.remove(0);
        }
    }
}

/// How the limit of a question begins in errors and in the log.
const LIMIT_OF_QUESTION: &str = "Limit: ";

impl ScreenModel {
    /// What another part of the station says, in the language of the screen; also the plan's own words, as far as the plan has
    /// them in that language.
    pub(crate) fn said<'a>(&self, text: &'a str) -> Cow<'a, str> {
        let mut said = in_language(text, self.lang);
        let words = self.plan.ready().map_or(&[][..], |plan| &plan.asks.words);
        for question in words {
            let own = match self.lang {
                Lang::En => None,
                Lang::Zh => Some(question.zh.as_ref().unwrap_or(&question.en)),
                Lang::Ru => Some(question.ru.as_ref().unwrap_or(&question.en)),
            };
            if let Some(own) = own.filter(|_| !question.en.is_empty() && said.contains(&question.en)) {
                // The table knows no sentences behind words that it does not know, so these are looked up by themselves.
                let (before, after) = said.split_once(&question.en).unwrap_or_default();
                // "A number in V. Limit: 4.9 V": the unit would take in the limit.
                let after = after.trim_start();
                let limit = after.find(LIMIT_OF_QUESTION).unwrap_or(0);
                let pieces = [&after[..limit], &after[limit..]].map(|piece| in_language(piece.trim(), self.lang));
                let after = pieces.join(" ").trim().to_owned();
                let between = if after.is_empty() { "" } else { " " };
                said = format!("{before}{own}{between}{after}").into();
            }
        }
        said
    }

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

    /// Whether it is known if the module is under power.
    pub(crate) fn power(&self) -> PowerKnown {
        let of_run = self.run.as_ref().is_some_and(RunView::power_unknown);
        match self.power_seen {
            _ if self.watching => PowerKnown::Known,
            _ if self.is_running() && self.line_lost => PowerKnown::LineLost,
            PowerSeen::Unknown => PowerKnown::Unknown,
            PowerSeen::ByRun if of_run => PowerKnown::Unknown,
            PowerSeen::ByRun | PowerSeen::Off => PowerKnown::Known,
        }
    }

    /// Whether bench and plan are read and have no mistakes, or are being read.
    pub(crate) fn is_refused(&self) -> bool {
        matches!(self.bench, Loaded::Refused(_)) || matches!(self.plan, Loaded::Refused(_))
    }

    /// What F5 does with the module that was scanned.
    pub(crate) fn what_f5_does(&self) -> &'static str {
        if self.is_refused() { self.texts.scanned_refused } else { self.texts.scanned }
    }

    /// Keeps what is known of the power when the run on the screen goes.
    pub(crate) fn keep_power(&mut self) {
        if self.power() == PowerKnown::Unknown {
            self.power_seen = PowerSeen::Unknown;
        }
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

    /// The keys that do something now: nothing can be stopped while nothing is on.
    pub(crate) fn keys(&self, place: KeyContext) -> impl Iterator<Item = &'static Binding> {
        let on = self.is_running() || self.watching;
        keymap::bindings(place).filter(move |binding| on || binding.action != KeyAction::Stop)
    }

    /// Whether there is a page for captures.
    pub(crate) fn captures(&self) -> bool {
        self.page == ScreenPage::Calibration || self.plan.ready().is_some_and(|plan| !plan.programs.is_empty())
    }

    /// The item that captures now, with its name.
    pub(crate) fn guidance(&self) -> Option<(&str, &Guidance)> {
        let progress = &self.run.as_ref().filter(|run| !run.over)?.progress;
        progress.iter().find_map(|each| Some((each.item.as_str(), each.guidance.as_deref()?)))
    }

    /// Bench time of the captures that a stop would lose: those under way, and those of finished items that a resumed run
    /// makes anew.
    pub(crate) fn lost_s(&self) -> f64 {
        let Some(run) = self.run.as_ref().filter(|run| !run.over) else { return 0.0 };
        let guided = run.progress.iter().filter_map(|each| each.guidance.as_deref());
        let finished = |program: &&ProgramView| {
            let row = run.state.row(&program.item);
            row.is_some_and(|row| row.planned.selected && row.is_over() && !row.attempts.is_empty())
        };
        let programs = self.plan.ready().map_or(&[][..], |plan| &plan.programs);
        let anew = programs.iter().filter(finished).map(|program| program.anew_s);
        guided.map(Guidance::lost_s).chain(anew).sum()
    }

    /// Bench time of the captures that the end of an item would lose.
    pub(crate) fn lost_with_s(&self, item: &str) -> f64 {
        let progress = self.run.iter().flat_map(|run| &run.progress).find(|each| each.item == item);
        progress.and_then(|each| each.guidance.as_deref()).map_or(0.0, Guidance::lost_s)
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

    pub(crate) fn say(&mut self, weight: MessageWeight, text: impl Into<String>) {
        self.message = Some((weight, text.into()));
        self.message_since = self.now.since_start;
    }

    /// Gives the message on the screen another weight.
    pub(crate) fn weigh(&mut self, weight: MessageWeight) {
        if let Some(message) = &mut self.message {
            message.0 = weight;
        }
    }

    /// Warns of something that no key caused. It does not replace an error, which matters more.
    pub(crate) fn mention(&mut self, text: impl Into<String>) {
        self.say_aside(MessageWeight::Warning, text);
    }

    /// Tells something that no key caused, unless an error is on the screen.
    pub(crate) fn say_aside(&mut self, weight: MessageWeight, text: impl Into<String>) {
        if !matches!(self.message, Some((MessageWeight::Error, _))) {
            self.say(weight, text);
        }
    }

    /// How long the message stays; `None` if there is none, or if it is an error, which stays until something follows.
    pub(crate) fn message_left(&self) -> Option<Duration> {
        let stays = match self.message.as_ref()?.0 {
            MessageWeight::Info => INFO_STAYS,
            MessageWeight::Warning => WARNING_STAYS,
            MessageWeight::Error => return None,
        };
        Some((self.message_since + stays).saturating_sub(self.now.since_start))
    }

    /// Moves the clock on: old messages go, and the time of a pause is counted.
    pub(crate) fn goes_on(&mut self, now: Now) {
        let step = now.since_start.saturating_sub(self.now.since_start);
        self.now = now;
        if self.message_left() == Some(Duration::ZERO) {
            self.message = None;
        }
        // Also while the items at work end: those that wait are not begun, and need their time afterwards.
        if let Some(run) = self.run.as_mut().filter(|run| run.pause == Pause::Asked && !run.over) {
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

/// Rows of a run in the order in which they are shown: as planned while it runs, the bad ones first when it has ended.
pub(crate) fn order(state: &RunState) -> Vec<usize> {
    let mut order: Vec<usize> = (0..state.rows().len()).collect();
    if state.verdict().is_some() {
        order.sort_by_key(|position| rank(state.rows()[*position].outcome));
    }
    order
}

fn rank(outcome: Outcome) -> u8 {
    match outcome {
        Outcome::Failed => 0,
        Outcome::Errored => 1,
        Outcome::Aborted => 2,
        Outcome::Marginal => 3,
        Outcome::Skipped => 4,
        Outcome::Passed => 5,
        Outcome::NotRun => 6,
    }
}
