//! Repeats the events of a run. Captured samples stay; figures and verdicts are worked out anew.

use std::collections::BTreeMap;

use gnc_analysis::capture::Capture;
use gnc_analysis::figures::{self, AnalysisInput, FigureError, Findings};
use gnc_analysis::motion::{self, MotionStep};
use gnc_executive::details::Details;
use gnc_executive::event::{AttemptError, EarlierRun, Event, EventKind, events_form};
use gnc_executive::measurement::{Measurement, Value};
use gnc_executive::outcome::Outcome;
use gnc_executive::part::LimitsChosen;
use gnc_executive::plan::{Plan, PlanItem};
use gnc_executive::verdict::Verdict;
use gnc_records::store::captures;
use gnc_text::with_causes;

use super::differences::{of_details, of_measurements};
use super::limits::{self, Judging};
use super::source::{RecordedRun, RunError};
use super::{fold, info};
use crate::version;

/// A run, judged again.
pub(super) struct Again {
    pub(super) events: Vec<Event>,
    pub(super) verdict: Verdict,
    /// What differs from the record.
    pub(super) differences: Vec<String>,
    measurements: usize,
    /// Attempts whose figures were worked out from raw samples.
    captured: usize,
    /// Attempts with incomplete raw samples, whose figures stay as they were.
    incomplete: usize,
}

impl Again {
    /// The summary in a line, with what is said of the passport; `same` says whether nothing at all differs.
    pub(super) fn summary(&self, same: bool, record: Record, passport: &str) -> String {
        let Self { measurements, captured, incomplete, .. } = self;
        let compared = match (same, record) {
            (true, Record::AsWritten) => "the same, bit for bit",
            // Of what was measured that says nothing.
            (true, Record::Changed | Record::Open) => "worked out from the record as it is now",
            (false, _) => "not the same",
        };
        let last = match record {
            Record::AsWritten => "",
            Record::Changed => "the record was changed and these are the figures of the changed record",
            Record::Open => "the record is not closed and nothing shows whether it was changed",
        };
        let last = if last.is_empty() { String::new() } else { format!("; {last}") };
        let left = match incomplete {
            0 => String::new(),
            count => format!("; {count} attempts have no complete raw record and keep their recorded figures"),
        };
        format!("{compared}: {measurements} measurements, {captured} attempts from raw samples{left}{passport}{last}")
    }
}

/// What a record is good for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Record {
    /// It is as it was written.
    AsWritten,
    /// It is not.
    Changed,
    /// It is not closed, so that nothing shows whether it was changed.
    Open,
}

/// Judges all events of a run by a plan. `of` names the run if the plan is another one.
pub(super) fn judge(run: &RecordedRun, plan: &Plan, of: Option<EarlierRun>) -> Result<Again, RunError> {
    check_items(run, plan)?;
    let Judging { plan: judging, chosen } = limits::choose(run, plan, of.is_some())?;
    let again = Again {
        events: Vec::with_capacity(run.events.len()),
        verdict: Verdict::new(Outcome::Errored, run.header.selection.is_some()),
        differences: Vec::new(),
        measurements: 0,
        captured: 0,
        incomplete: 0,
    };
    let screened = of.is_some() || run.events.iter().any(measures_integrity);
    let mut judge = Judge {
        run,
        plan: &judging,
        chosen,
        of,
        again,
        details: BTreeMap::new(),
        attempts: BTreeMap::new(),
        over: Vec::new(),
        screened,
    };
    for event in &run.events {
        judge.take(event)?;
    }
    let state = fold(&judge.again.events)?;
    judge.again.verdict = state.verdict().unwrap_or_else(|| state.verdict_so_far());
    Ok(judge.again)
}

/// Checks that the plan has the items of the run, in their order.
fn check_items(run: &RecordedRun, plan: &Plan) -> Result<(), RunError> {
    let Some(EventKind::RunStarted { items, .. }) = run.events.first().map(|event| &event.kind) else { return Ok(()) };
    let same = items.len() == plan.items().len()
        && items.iter().zip(plan.items()).all(|(was, is)| was.name == is.name && was.id == is.id);
    if same {
        return Ok(());
    }
    let names = |mut names: Vec<&str>| {
        names.truncate(20);
        names.join(", ")
    };
    let was = names(items.iter().map(|item| item.name.as_str()).collect());
    let is = names(plan.items().iter().map(|item| item.name.as_str()).collect());
    Err(RunError::Unfit { what: format!("the run has the items {was}; the plan has the items {is}") })
}

struct Judge<'a> {
    run: &'a RecordedRun,
    plan: &'a Plan,
    /// The limits of the plan that judge the module.
    chosen: Option<LimitsChosen>,
    of: Option<EarlierRun>,
    again: Again,
    /// The newest details of each item. Later items may use them.
    details: BTreeMap<usize, Details>,
    /// For each item the attempt that runs or ran last: its number, and what was recorded of it.
    attempts: BTreeMap<usize, Recorded>,
    /// Positions of the items that have ended.
    over: Vec<usize>,
    /// Whether bad samples are measured. An older record has no such measurement, and is compared without it.
    screened: bool,
}

/// What was recorded of an attempt, and the new results in its place.
#[derive(Default)]
struct Recorded {
    attempt: u32,
    /// Number of items that had ended when the attempt began: it could use their findings.
    over: usize,
    measured: Vec<Measurement>,
    details: Vec<Details>,
    now: Vec<Measurement>,
    outcome: Option<Outcome>,
}

impl Judge<'_> {
    fn take(&mut self, event: &Event) -> Result<(), RunError> {
        match &event.kind {
            EventKind::RunStarted { header, items } => {
                let mut header = header.clone();
                if self.of.is_some() {
                    header.plan = info(self.plan);
                    header.recomputed.clone_from(&self.of);
                    events_form(header.selection.as_deref()).clone_into(&mut header.schema);
                    header.program = version::program();
                }
                self.emit(event, EventKind::RunStarted { header, items: items.clone() });
                if let Some(chosen) = self.chosen.clone().filter(|_| limits::chosen(self.run).is_none()) {
                    self.emit(event, EventKind::LimitsChosen(chosen));
                }
            }
            EventKind::LimitsChosen(_) => {
                if let Some(chosen) = self.chosen.clone() {
                    self.emit(event, EventKind::LimitsChosen(chosen));
                }
            }
            EventKind::ItemStarted { item, attempt } => {
                let recorded = Recorded { attempt: *attempt, over: self.over.len(), ..Recorded::default() };
                self.attempts.insert(self.position(item)?, recorded);
                self.emit(event, event.kind.clone());
            }
            EventKind::Measured { item, measurement, .. } => {
                let position = self.position(item)?;
                self.recorded(position).measured.push(measurement.clone());
            }
            EventKind::Found { item, details, .. } => {
                let position = self.position(item)?;
                self.recorded(position).details.push(details.clone());
            }
            EventKind::AttemptEnded { item, attempt, outcome, error } => {
                let position = self.position(item)?;
                self.attempt_ended(event, position, *attempt, *outcome, error.as_ref())?;
            }
            EventKind::ItemEnded { item, outcome, cause } => {
                let position = self.position(item)?;
                self.over.push(position);
                let outcome = self.attempts.get(&position).and_then(|recorded| recorded.outcome).unwrap_or(*outcome);
                let (item, cause) = (item.clone(), cause.clone());
                self.emit(event, EventKind::ItemEnded { item, outcome, cause });
            }
            EventKind::RunEnded(verdict) => {
                let was = verdict.of_selection_if(self.run.header.selection.is_some());
                // A verdict on the run that does not come from its items stays.
                let before = fold(&self.run.events)?.verdict_so_far();
                let now = fold(&self.again.events)?.verdict_so_far();
                let now = if was == before { now } else { now.at_least(was.of_items()) };
                self.differs(now != was, || format!("the run was {was}, is {now}"));
                self.emit(event, EventKind::RunEnded(now));
            }
            // The raw files stay where they are.
            EventKind::Captured(_) => {}
            other => self.emit(event, other.clone()),
        }
        Ok(())
    }

    fn attempt_ended(
        &mut self,
        event: &Event,
        position: usize,
        attempt: u32,
        outcome: Outcome,
        error: Option<&AttemptError>,
    ) -> Result<(), RunError> {
        let item = &self.plan.items()[position];
        let mut error = error.cloned();
        match self.work_out(item, position, attempt)? {
            Figures::Recorded => {
                let measured = std::mem::take(&mut self.recorded(position).measured);
                for was in &measured {
                    self.measured(event, item, position, attempt, &was.name, &was.measured(), was.repeat.unwrap_or(1));
                }
                self.recorded(position).measured = measured;
                for details in self.recorded(position).details.clone() {
                    self.details.insert(position, details.clone());
                    self.emit(event, EventKind::Found { item: item.name.clone(), attempt, details });
                }
            }
            Figures::WorkedOut(rounds) => {
                self.again.captured += 1;
                let mut details = Vec::new();
                for (repeat, round) in (1..).zip(rounds) {
                    match round {
                        Ok(findings) => {
                            for (name, value) in &findings.measured {
                                self.measured(event, item, position, attempt, name, value, repeat);
                            }
                            let found = findings.details;
                            self.details.insert(position, found.clone());
                            details.push(found.clone());
                            self.emit(event, EventKind::Found { item: item.name.clone(), attempt, details: found });
                        }
                        Err((integrity, refused)) => {
                            let told = if self.screened { integrity } else { Vec::new() };
                            for (name, value) in &told {
                                self.measured(event, item, position, attempt, name, value, repeat);
                            }
                            error = Some(self.refused(item, attempt, error.as_ref(), &refused));
                        }
                    }
                }
                let before = std::mem::take(&mut self.recorded(position).details);
                let found = of_details(&before, &details);
                self.differ(item, attempt, found);
            }
        }
        let recorded = self.recorded(position);
        let (before, now) = (std::mem::take(&mut recorded.measured), recorded.now.clone());
        let found = of_measurements(&before, &now);
        self.differ(item, attempt, found);
        self.again.measurements += now.len();
        let judged = outcome_of(item, (&before, &now), outcome, error.as_ref());
        self.recorded(position).outcome = Some(judged);
        let name = item.name.clone();
        self.differs(judged != outcome, || format!("{name}, attempt {attempt} was {outcome}, is {judged}"));
        self.emit(event, EventKind::AttemptEnded { item: name, attempt, outcome: judged, error });
        Ok(())
    }

    /// Reports an analysis that refuses the captures, and compares with the recorded error.
    fn refused(
        &mut self,
        item: &PlanItem,
        attempt: u32,
        was: Option<&AttemptError>,
        refused: &FigureError,
    ) -> AttemptError {
        let text = with_causes(refused);
        let as_before = was.is_some_and(|was| was.text == text);
        self.differs(!as_before, || format!("{}, attempt {attempt}: {text}", item.name));
        AttemptError { text, hint: refused.try_this().to_owned(), again: false }
    }

    #[expect(clippy::too_many_arguments, reason = "where the value belongs takes that many words")]
    fn measured(
        &mut self,
        event: &Event,
        item: &PlanItem,
        position: usize,
        attempt: u32,
        name: &str,
        value: &Value,
        repeat: u32,
    ) {
        let measurement = item.judge(name, value, repeat, &self.run.header.serial_number);
        self.recorded(position).now.push(measurement.clone());
        self.emit(event, EventKind::Measured { item: item.name.clone(), attempt, measurement });
    }

    /// Works out figures from the raw samples of an attempt, one set for each round.
    fn work_out(&mut self, item: &PlanItem, position: usize, attempt: u32) -> Result<Figures, RunError> {
        let program = motion::program(item.id, &item.params)?;
        let source = item.params.source("of").ok().flatten();
        let mut rounds = Vec::new();
        for repeat in 1..=item.repeats {
            let captures = match (&program, source) {
                (Some(program), _) => self.captures(position, attempt, repeat, Some(program))?,
                (None, Some(other)) => {
                    let other = self.position(other)?;
                    let attempt = self.attempts.get(&other).map_or(1, |recorded| recorded.attempt);
                    self.captures(other, attempt, 1, None)?
                }
                (None, None) => return Ok(Figures::Recorded),
            };
            let Some(captures) = captures else {
                self.again.incomplete += 1;
                return Ok(Figures::Recorded);
            };
            let earlier = self.earlier(position);
            let question = AnalysisInput {
                params: &item.params,
                site: self.run.header.site.as_ref(),
                captures: &captures,
                earlier: &earlier,
            };
            let found = figures::analyse(item.id, &question).map(|found| self.as_recorded(found));
            rounds.push(found.map_err(|refused| (figures::integrity(item.id, &question), refused)));
        }
        Ok(Figures::WorkedOut(rounds))
    }

    /// Leaves out findings that the record could not have.
    fn as_recorded(&self, mut findings: Findings) -> Findings {
        if !self.screened {
            findings.measured.retain(|(name, _)| !figures::INTEGRITY.contains(name));
            if let Some(details) = findings.details.to_mut().as_object_mut() {
                details.remove(figures::GATE);
            }
        }
        findings
    }

    /// The captures of a round; `None` if some are missing because the attempt did not reach its end.
    fn captures(
        &self,
        position: usize,
        attempt: u32,
        repeat: u32,
        program: Option<&motion::MotionProgram>,
    ) -> Result<Option<Vec<Capture>>, RunError> {
        let name = &self.plan.items()[position].name;
        let path = captures::path(&self.run.folder, position, name, attempt, repeat);
        if !path.exists() {
            return Ok(None);
        }
        let record = captures::read(&path)?;
        let is_capture = |step: &&MotionStep| {
            matches!(step, MotionStep::Capture { .. } | MotionStep::Turn { .. } | MotionStep::Receiver { .. })
        };
        let planned = program.map(|program| program.steps.iter().filter(is_capture).count());
        let lost = record.captures.iter().any(|capture| capture.losses.any());
        let whole = !record.cut_off && record.unfinished.is_none() && !lost;
        let complete = whole && planned.is_none_or(|planned| planned == record.captures.len());
        Ok(complete.then_some(record.captures))
    }

    fn earlier(&self, of: usize) -> Vec<(String, Findings)> {
        let over = self.attempts.get(&of).map_or(0, |recorded| recorded.over);
        let over = self.over.get(..over).unwrap_or_default();
        let ended = self.details.iter().filter(|(position, _)| over.contains(position));
        ended.map(|(position, found)| (self.plan.items()[*position].name.clone(), found.clone().into())).collect()
    }

    fn position(&self, item: &str) -> Result<usize, RunError> {
        let position = self.plan.items().iter().position(|planned| planned.name == item);
        position.ok_or_else(|| RunError::Unfit { what: format!("the plan has no item {item}") })
    }

    fn recorded(&mut self, position: usize) -> &mut Recorded {
        self.attempts.entry(position).or_default()
    }

    fn differs(&mut self, differs: bool, text: impl FnOnce() -> String) {
        if differs {
            self.again.differences.push(text());
        }
    }

    fn differ(&mut self, item: &PlanItem, attempt: u32, found: Vec<String>) {
        let lines = found.into_iter().map(|text| format!("{}, attempt {attempt}: {text}", item.name));
        self.again.differences.extend(lines);
    }

    fn emit(&mut self, event: &Event, kind: EventKind) {
        let seq = self.again.events.len() as u64;
        self.again.events.push(Event { seq, at: event.at, elapsed_us: event.elapsed_us, kind });
    }
}

/// Shares of bad samples, and the reason why there are no figures.
type Refused = (Vec<(&'static str, Value)>, FigureError);

enum Figures {
    /// Nothing can be worked out: the recorded measurements are judged.
    Recorded,
    /// Figures from raw samples.
    WorkedOut(Vec<Result<Findings, Refused>>),
}

fn measures_integrity(event: &Event) -> bool {
    matches!(&event.kind, EventKind::Measured { measurement, .. } if figures::INTEGRITY.contains(&measurement.name.as_str()))
}

/// The outcome of an attempt: by its measurements, unless an error ended it.
fn outcome_of(
    item: &PlanItem,
    (before, measured): (&[Measurement], &[Measurement]),
    was: Outcome,
    error: Option<&AttemptError>,
) -> Outcome {
    let violates = |measured: &[Measurement]| measured.iter().any(|one| one.outcome == Some(Outcome::Failed));
    match was {
        Outcome::Aborted => Outcome::Aborted,
        _ if error.is_none() => item.attempt_outcome(measured),
        // The run has called the attempt errored though a limit was violated: its error says that the value is not the module's.
        Outcome::Errored if violates(before) => Outcome::Errored,
        _ if violates(measured) => Outcome::Failed,
        // A good attempt that cannot be worked out any more is not known to be good.
        was if was.is_good() => Outcome::Errored,
        other => other,
    }
}
