//! Applies messages to the model, and returns the effects that they ask for.

mod keys;
mod run;
mod start;

use std::path::PathBuf;

use gnc_bench::fixture::Ask;
use gnc_board::Readings;
use gnc_executive::event::Event;
use gnc_executive::state::RunState;

use super::decode::Key;
use super::lang::{Lang, Texts, fill};
use super::model::{
    BenchView, Earlier, Loaded, MessageWeight, Now, PlanView, Progress, RoundsSetting, ScreenModel, ScreenPage,
};
use super::pending::{Interrupted, Prepared};
use super::records::{Check, Checked, Day, OpenRun, RunMark, Runs, Unopened};
use super::setup_form::Choices;

/// Something that happened.
#[derive(Debug)]
pub(crate) enum Msg {
    /// Time went on.
    Time(Now),
    /// A key.
    Key(Key),
    /// An event of the run.
    Event(Box<Event>),
    /// How far the items at work are.
    Progress(Vec<Progress>),
    /// Live readings.
    Readings(Box<Readings>),
    /// The run asks for something.
    Asked { item: String, ask: Ask },
    /// The item no longer waits for an answer.
    AskedNoMore,
    /// The bench was looked at.
    Bench { path: String, bench: Loaded<BenchView> },
    /// The plan was checked.
    Plan { path: String, plan: Loaded<PlanView> },
    /// Files to choose from.
    Choices(Choices),
    /// A run of a module broke off, as far as the records tell: after a scan, or at the start.
    BrokeOff { serial_number: String, run: Option<Interrupted> },
    /// The newest run of a module today.
    Earlier { serial_number: String, run: Option<Earlier> },
    /// What must be known before the run that was asked for begins.
    Prepared(Box<Prepared>),
    /// A round begins; its record is in this folder.
    RoundBegins { folder: PathBuf },
    /// No round follows; why a record could not be written, and why a round was not begun.
    RunOver { store_error: Option<String>, refusal: Option<String> },
    /// The record of a run whose events did not all come.
    Refolded { folder: PathBuf, state: Result<Box<RunState>, String> },
    /// Seconds that the last whole run of this plan took.
    Expected(Option<f64>),
    /// Days with records.
    Days(Result<Vec<Day>, String>),
    /// Runs of a day.
    Runs(Result<Runs, String>),
    /// A run was opened.
    Opened(Result<Box<(PathBuf, RunState, RunMark)>, Unopened>),
    /// A run was compared with its digests.
    Verified { path: PathBuf, checked: Checked },
    /// A look at raw values has ended, and why.
    WatchOver { why: Option<String> },
    /// A signal asks the program to end.
    EndAsked,
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
    Pause(bool),
    AbortItem(String),
    Answer(bool),
    Choose {
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
}

/// A run that is asked for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct StartRequest {
    pub serial_number: String,
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
        Msg::Time(now) => model.now = now,
        Msg::Key(key) => return keys::key(model, key),
        Msg::Event(event) => return run::event(model, &event),
        Msg::Progress(progress) => {
            if let Some(run) = &mut model.run {
                run.progress = progress;
            }
        }
        Msg::Readings(readings) => model.live.take(*readings, model.now.since_start),
        Msg::Asked { item, ask } => run::asked(model, item, ask),
        Msg::AskedNoMore => {
            if let Some(run) = &mut model.run {
                run.prompt = None;
            }
        }
        Msg::Bench { path, bench } => {
            if matches!(bench, Loaded::Refused(_)) {
                // The old message may say that F5 starts a run.
                model.message = None;
            }
            model.bench_path = path;
            model.bench = bench;
        }
        Msg::Plan { path, plan } => take_plan(model, path, plan),
        Msg::Choices(choices) => model.choices = choices,
        Msg::BrokeOff { serial_number, run } => run::broke_off(model, &serial_number, run.as_ref()),
        Msg::Earlier { serial_number, run } => run::earlier(model, &serial_number, run),
        Msg::Prepared(prepared) => return start::prepared(model, *prepared),
        Msg::RoundBegins { folder } => {
            if let Some(run) = &mut model.run {
                run.folder = Some(folder);
            }
        }
        Msg::RunOver { store_error, refusal } => return run::over(model, store_error, refusal),
        Msg::Refolded { folder, state: Ok(state) } => run::refolded(model, &folder, *state),
        Msg::Refolded { state: Err(why), .. } => model.say(MessageWeight::Error, why),
        Msg::Expected(expected_s) => {
            if let Loaded::Ready(plan) = &mut model.plan {
                plan.expected_s = expected_s;
            }
        }
        Msg::WatchOver { why } => {
            model.watching = false;
            if let Some(why) = why {
                model.say(MessageWeight::Error, why);
            }
            return match model.leaving {
                true => Some(Effect::Leave),
                // The operator turned to the records page while the module was being switched off.
                false => keys::read_if_due(model),
            };
        }
        Msg::EndAsked => model.leaving = true,
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

fn take_plan(model: &mut ScreenModel, path: String, plan: Loaded<PlanView>) {
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
            let (path, state, mark) = *opened;
            records.open = Some(OpenRun { path, state, mark, cursor: 0, check: Check::NotAsked });
        }
        Msg::Verified { path, checked } => {
            if let Some(open) = records.open.as_mut().filter(|open| open.path == path) {
                open.check = Check::Done(checked);
            } else {
                let (weight, what) = checked_words(model.texts, &checked);
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
pub(crate) fn checked_words(texts: &Texts, checked: &Checked) -> (MessageWeight, String) {
    match (checked.problems.as_slice(), &checked.newer) {
        ([], None) => (MessageWeight::Info, texts.as_written.to_owned()),
        ([], Some(unknown)) => (MessageWeight::Warning, words(texts.digests_agree, &[unknown])),
        (problems, _) => (MessageWeight::Error, format!("{}: {}", texts.not_as_written, problems.join("; "))),
    }
}

/// "14:30, passed" for the sentence on an earlier run.
pub(crate) fn earlier_words(model: &ScreenModel, earlier: &Earlier) -> [String; 2] {
    [earlier.at.format("%H:%M").to_string(), earlier.mark.word(model.texts).to_owned()]
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
