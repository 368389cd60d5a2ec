//! The run that is on, or the last one, and what its end would lose.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use gnc_bench::guidance::Guidance;
use gnc_executive::outcome::Outcome;
use gnc_executive::plan::Phase;
use gnc_executive::state::RunState;
use gnc_executive::verdict::Verdict;

use super::{Now, ProgramView, Prompt, ScreenModel};

/// Bench time of lost captures from which a stop is asked about: less is made again while the operator fetches a coffee.
pub(crate) const ASK_FROM_S: f64 = 600.0;

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

    /// Whether the run ended while the module was under power: its board switches it off by itself, and has
    /// not confirmed it.
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

impl ScreenModel {
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
}
