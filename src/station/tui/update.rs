//! Applies messages to the model, and returns the effects that they ask for.

pub(super) mod interrupt;
mod keys;
mod numbers;
mod question;
mod run;
mod scan;
mod start;

use std::path::PathBuf;

use gnc_bench::fixture::{Ask, Reply};
use gnc_board::Readings;
use gnc_executive::event::Event;
use gnc_executive::standing::Standing;
use gnc_executive::state::RunState;
use gnc_executive::verdict::Verdict;
use gnc_records::shift::Shift;
use gnc_records::standing::Face;

use super::decode::Key;
use super::input::{Input, Scanned};
use super::lang::{Lang, fill};
use super::live::History;
use super::model::{
    BenchView, Loaded, MessageWeight, Now, PlanView, PowerSeen, Progress, RoundsSetting, ScreenModel, ScreenPage,
};
use super::pending::{Interrupted, Prepared};
use super::pictures::{DrawnPicture, PictureTrouble, PictureWanted};
use super::records::{Check, Checked, Day, OpenRun, Runs, Unopened};
use super::setup_form::{Choices, FormLook};
use crate::phrases::in_language;

/// Something that happened.
#[derive(Debug)]
pub(crate) enum Msg {
    /// Time went on.
    Time(Now),
    /// A key.
    Key(Key),
    /// A scan.
    Scan(Scanned),
    /// The scanner at the serial port is not there.
    ScannerLost { why: String },
    /// It is there again.
    ScannerBack { port: String },
    /// An event of the run.
    Event(Box<Event>),
    /// How far the items at work are.
    Progress(Vec<Progress>),
    /// Whether the line to the board is lost in the run that is on.
    LineLost(bool),
    /// Live readings.
    Readings(Box<Readings>),
    /// The run asks for something.
    Asked { item: String, ask: Ask },
    /// The item no longer waits for an answer.
    AskedNoMore,
    /// The picture of a question is ready to be drawn, or cannot be drawn.
    Drawn { wanted: PictureWanted, made: Result<DrawnPicture, PictureTrouble> },
    /// The bench was looked at.
    Bench { path: String, bench: Loaded<BenchView> },
    /// The plan was checked.
    Plan { path: String, plan: Loaded<PlanView> },
    /// The files of the form were looked at.
    LookedAt(Box<FormLook>),
    /// Files to choose from.
    Choices(Choices),
    /// A run of a module broke off, as far as the records tell: after a scan, or at the start.
    BrokeOff { serial_number: String, run: Option<Interrupted> },
    /// What the records say of a module, or why they cannot be read.
    Standing { serial_number: String, standing: Result<Standing, String> },
    /// What must be known before the run that was asked for begins.
    Prepared(Box<Prepared>),
    /// A round begins; its record is in this folder.
    RoundBegins { folder: PathBuf },
    /// A round has ended; its record is in this folder.
    RoundEnded { folder: PathBuf },
    /// No round follows; why a record could not be written, and why a round was not begun.
    RunOver {
        /// The worst verdict of all rounds; `None` if none was begun.
        verdict: Option<Verdict>,
        store_error: Option<String>,
        refusal: Option<String>,
    },
    /// The record of a run whose events did not all come.
    Refolded { folder: PathBuf, state: Result<Box<RunState>, String> },
    /// Seconds that the last whole run of this plan took.
    Expected(Option<f64>),
    /// The modules of this shift.
    Shift(Box<Shift>),
    /// The program that is told verdicts does not do its work.
    HookTrouble(String),
    /// Files lie in the folder of a run that the station did not write.
    Strangers(String),
    /// Days with records.
    Days(Result<Vec<Day>, String>),
    /// Runs of a day.
    Runs(Result<Runs, String>),
    /// A run was opened.
    Opened(Result<Box<(PathBuf, RunState, Face)>, Unopened>),
    /// A run was compared with its digests.
    Verified { path: PathBuf, checked: Checked },
    /// A look at raw values has ended, and why.
    WatchOver { why: Option<String> },
    /// A signal asks the program to end.
    EndAsked,
}

impl From<Input> for Msg {
    fn from(input: Input) -> Self {
        match input {
            Input::Key(key) => Self::Key(key),
            Input::Scan(scanned) => Self::Scan(scanned),
        }
    }
}

/// Work to be done outside of the screen.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Effect {
    /// Look for earlier runs of a module.
    LookUp(String),
    /// Check all that must be known before a run of a module begins.
    Prepare {
        serial_number: String,
        /// Names of the chosen items; `None` for the whole plan.
        selection: Option<Vec<String>>,
        /// The run that the command line wants to take up.
        resume: Option<PathBuf>,
    },
    Start(StartRequest),
    /// Show raw values without a run.
    Watch,
    /// Stop the run: the first time in order, the second time at once.
    Stop,
    /// Stop the run in order, if no stop was asked for; the program ends with the verdict of that run when it has stopped.
    StopAndLeave,
    Pause(bool),
    AbortItem(String),
    Answer(Reply),
    /// Make the picture of a question ready to be drawn.
    Draw(PictureWanted),
    Choose {
        plan: String,
        bench: String,
    },
    /// Read a plan and a bench for the form, and hold neither.
    Look {
        plan: String,
        bench: String,
    },
    ListChoices,
    ListDays,
    ListRuns(String),
    OpenRun(PathBuf),
    Verify(PathBuf),
    /// Read the run's record, since events were missed.
    Refold(PathBuf),
    Leave,
    /// Send this process the signal of an interrupt: the run does not end by commands. The screen does it itself, since the session may
    /// hear nothing.
    Raise,
}

/// A run that is asked for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct StartRequest {
    pub serial_number: String,
    /// The part that the module must be, and its revision; empty: any.
    pub part: [String; 2],
    /// Numbers of orders, sub-units and others, by their keys.
    pub numbers: Vec<(String, String)>,
    /// Digest of the plan that is shown.
    pub plan_sha256: String,
    /// The run that is taken up again.
    pub resume: Option<PathBuf>,
    pub operator: Option<String>,
    pub selection: Option<Vec<String>>,
    pub rounds: RoundsSetting,
    pub after_failure: super::model::AfterFailure,
}

/// Applies a message.
pub(crate) fn update(model: &mut ScreenModel, msg: Msg) -> Option<Effect> {
    match msg {
        Msg::Time(now) => model.goes_on(now),
        Msg::Key(key) => return keys::key(model, key),
        Msg::Scan(scanned) => return scan::scan(model, &scanned),
        Msg::ScannerLost { why } => {
            model.mention(words(model.texts.scanner_lost, &[&model.said(&why)]));
        }
        Msg::ScannerBack { port } => {
            model.say_aside(MessageWeight::Info, words(model.texts.scanner_back, &[&port]));
        }
        Msg::Event(event) => return run::event(model, &event),
        Msg::Progress(progress) => {
            if let Some(run) = &mut model.run {
                run.progress = progress;
            }
        }
        Msg::LineLost(lost) => model.line_lost = lost,
        Msg::Readings(readings) => model.live.take(*readings, model.now.since_start),
        Msg::Asked { item, ask } => run::asked(model, item, ask),
        Msg::AskedNoMore => {
            if let Some(run) = &mut model.run {
                run.prompt = None;
            }
        }
        Msg::Drawn { wanted, made } => model.pictures.take(wanted, made),
        Msg::Bench { path, bench } => {
            if matches!(bench, Loaded::Refused(_)) {
                // The old message may say that F5 starts a run.
                model.message = None;
            }
            model.bench_path = path;
            model.bench = bench;
            take_operator(model);
        }
        Msg::Plan { path, plan } => return take_plan(model, path, plan),
        Msg::LookedAt(look) => keys::looked_at(model, &look),
        Msg::Choices(choices) => model.choices = choices,
        Msg::BrokeOff { serial_number, run } => run::broke_off(model, &serial_number, run.as_ref()),
        Msg::Standing { serial_number, standing } => run::standing(model, &serial_number, standing),
        Msg::Prepared(prepared) => return start::prepared(model, *prepared),
        Msg::RoundBegins { folder } | Msg::RoundEnded { folder } => {
            model.has_looked_back();
            if let Some(run) = &mut model.run {
                run.folder = Some(folder);
            }
        }
        Msg::RunOver { verdict, store_error, refusal } => {
            return run::over(model, verdict, store_error, refusal.as_deref());
        }
        Msg::Refolded { folder, state: Ok(state) } => run::refolded(model, &folder, *state),
        Msg::Refolded { state: Err(why), .. } => model.say(MessageWeight::Error, model.said(&why).into_owned()),
        Msg::Expected(expected_s) => {
            if let Loaded::Ready(plan) = &mut model.plan {
                plan.expected_s = expected_s;
            }
        }
        Msg::WatchOver { why } => {
            model.watching = false;
            interrupt::ended(model);
            // Where no value came, the station has switched nothing on.
            let seen = if why.is_none() { Some(PowerSeen::Off) } else { None };
            let unknown = || (!model.live.is_empty()).then_some(PowerSeen::Unknown);
            model.power_seen = seen.or_else(unknown).unwrap_or(model.power_seen);
            if let Some(why) = why {
                model.say(MessageWeight::Error, model.said(&why).into_owned());
            }
            if model.live_of != model.scan.current {
                // The values are of the module before.
                model.live = History::default();
            }
            return match model.leaving {
                true => Some(Effect::Leave),
                // The operator turned to the records page, or scanned a number, while the module was being switched off.
                false => keys::read_if_due(model).or_else(|| scan::look_up(model)),
            };
        }
        Msg::EndAsked => model.leaving = true,
        Msg::Shift(shift) => model.shift = Some(*shift),
        Msg::HookTrouble(what) | Msg::Strangers(what) => model.mention(model.said(&what).into_owned()),
        Msg::Days(_) | Msg::Runs(_) | Msg::Opened(_) | Msg::Verified { .. } => take_records(model, msg),
    }
    None
}

/// The words about an item of the command line that the plan does not have.
fn unknown_item(model: &ScreenModel) -> Option<String> {
    let plan = model.plan.ready()?;
    let known = |name: &String| plan.items.iter().any(|item| item.name == *name);
    let name = model.only.iter().flatten().find(|name| !known(name))?;
    Some(words(model.texts.only_unknown, &[&gnc_text::printable(name)]))
}

/// Takes the operator of the bench, if nobody is named yet. A name that was only remembered is told, since another
/// person may be at the bench now.
fn take_operator(model: &mut ScreenModel) {
    let usual = model.bench.ready().and_then(|bench| bench.operator.clone());
    let Some(usual) = usual.filter(|_| model.operator.is_empty()) else { return };
    // The panel marks the name. There is one line for messages, and another one, as that of a run to resume, says more.
    model.operator_remembered = usual.remembered;
    if usual.remembered && model.message.is_none() {
        model.say(MessageWeight::Info, words(model.texts.operator_remembered, &[&usual.name]));
    }
    model.operator = usual.name;
}

fn take_plan(model: &mut ScreenModel, path: String, plan: Loaded<PlanView>) -> Option<Effect> {
    let chosen = |name: &String| model.only.as_ref().is_none_or(|only| only.contains(name));
    let items = plan.ready().map_or(&[][..], |plan| &plan.items);
    model.ticks = items.iter().map(|item| chosen(&item.name)).collect();
    if matches!(plan, Loaded::Refused(_)) {
        // The old message may say that F5 starts a run.
        model.message = None;
    }
    model.plan_path = path;
    model.plan = plan;
    model.cursor = 0;
    if let Some(unknown) = unknown_item(model) {
        // Nothing runs before the operator has chosen.
        model.ticks.fill(false);
        model.say(MessageWeight::Error, unknown);
    }
    if model.page == ScreenPage::Calibration && !model.is_running() {
        // Another plan may capture nothing.
        model.page = ScreenPage::Tests;
    }
    // What the records say of the module depends on the plan.
    model.scan.standing = None;
    model.plan.ready().and(scan::look_up(model))
}

fn take_records(model: &mut ScreenModel, msg: Msg) {
    let records = &mut model.records;
    records.reading = false;
    records.error = None;
    match msg {
        Msg::Days(Ok(days)) => {
            records.day_cursor = records.day_cursor.min(days.len().saturating_sub(1));
            records.days = Some(days);
        }
        Msg::Runs(Ok(runs)) => {
            let same = records.runs.as_ref().is_some_and(|old| old.day == runs.day);
            records.runs = Some(runs);
            let last = records.shown().len().saturating_sub(1);
            records.run_cursor = if same { records.run_cursor.min(last) } else { 0 };
        }
        Msg::Opened(Ok(opened)) => {
            let (path, state, face) = *opened;
            records.open = Some(OpenRun { path, state, face, cursor: 0, check: Check::NotAsked });
        }
        Msg::Verified { path, checked } => {
            if let Some(open) = records.open.as_mut().filter(|open| open.path == path) {
                open.check = Check::Done(checked);
            } else {
                let (weight, what) = checked_words(model.lang, &checked);
                let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                model.say(weight, format!("{name}: {what}"));
            }
        }
        Msg::Opened(Err(Unopened::Newer(unknown))) => {
            records.error = Some(words(model.texts.written_by_newer, &[&unknown]));
        }
        Msg::Days(Err(why)) | Msg::Runs(Err(why)) | Msg::Opened(Err(Unopened::Unreadable(why))) => {
            records.error = Some(why);
        }
        _ => {}
    }
}

/// The result of a verification in words, and how much it matters.
pub(crate) fn checked_words(lang: Lang, checked: &Checked) -> (MessageWeight, String) {
    let texts = lang.texts();
    let said = |said: &[String]| {
        let said: Vec<_> = said.iter().map(|what| in_language(what, lang)).collect();
        said.join("; ")
    };
    match (checked.problems.as_slice(), &checked.newer) {
        ([], _) if !checked.open.is_empty() => (MessageWeight::Warning, said(&checked.open)),
        ([], None) => (MessageWeight::Info, texts.as_written.to_owned()),
        ([], Some(unknown)) => (MessageWeight::Warning, words(texts.digests_agree, &[unknown])),
        (problems, _) => {
            let all = [problems, &checked.open].concat();
            (MessageWeight::Error, format!("{}: {}", texts.not_as_written, said(&all)))
        }
    }
}

/// Changes the language at once.
fn set_language(model: &mut ScreenModel, lang: Lang) {
    if model.look.glyphs == super::model::Glyphs::Unicode {
        model.lang = lang;
        model.texts = lang.texts();
    } else if lang != Lang::En {
        model.say(MessageWeight::Warning, model.texts.no_glyphs);
    }
}

use fill as words;
