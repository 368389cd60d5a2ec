//! The standing of a module: what its records say of it, by one rule for every face.
//!
//! A verdict counts for a module if its run covered the whole plan, on a real bench, by just this plan, not longer ago than
//! the plan allows, and if its record is closed, stands in the chain and is as it was closed. A run on a simulated bench
//! counts on a simulated bench alone, and a run on an unproven bench counts nowhere. Everything else is called what it is: see [`Flaw`].
//!
//! This file is the rule and its words. It opens no file: the crate of the records finds the runs.

use std::fmt;

use chrono::{DateTime, FixedOffset, TimeDelta};
use gnc_text::printable;

use crate::event::{BenchKind, PlanInfo};
use crate::outcome::Outcome;
use crate::record::RunRecord;
use crate::verdict::Verdict;

/// How far a run may lie ahead of the clock and still count: a clock that is set right by its time service jumps back by
/// seconds to minutes.
pub const CLOCK_SLACK: TimeDelta = TimeDelta::minutes(10);

/// Most names of chosen items in a sentence; more are counted.
const NAMED_ITEMS: usize = 3;

/// Which plan a question is about.
#[derive(Clone, Copy, Debug)]
pub enum PlanAsked<'a> {
    /// The plan with this digest.
    This(&'a PlanInfo),
    /// Any version of the plan with this name: a plan names those that it requires.
    Named(&'a str),
}

impl PlanAsked<'_> {
    /// Name of the plan.
    pub fn name(&self) -> &str {
        match self {
            Self::This(plan) => &plan.name,
            Self::Named(name) => name,
        }
    }
}

/// A question about a module.
#[derive(Clone, Copy, Debug)]
pub struct Question<'a> {
    /// The module's serial number, as scanned. Another case of a letter is another module.
    pub serial_number: &'a str,
    /// The plan.
    pub plan: PlanAsked<'a>,
    /// Days for which a verdict counts.
    pub valid_days: u32,
    /// The bench that asks.
    pub bench: BenchKind,
    /// The time by the clock of the computer.
    pub now: DateTime<FixedOffset>,
}

/// Why a run does not count for the module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    /// The chain names the run, and its folder is gone.
    Missing,
    /// The record cannot be read.
    Unreadable,
    /// A station is carrying the run out now.
    UnderWay,
    /// The folder has no digests.
    NotClosed,
    /// The run has no end.
    Interrupted,
    /// The chain does not name the run.
    NotInChain,
    /// The station ended before the run was in the chain, and a later start put it there.
    ClosedLate,
    /// Lines of the chain behind the run are missing or damaged: what came after it is not known.
    LinesMissing,
    /// The record is not as it was closed, or its line in the chain was changed.
    Changed,
    /// The bench has a key, and neither this key nor another one that the bench trusts signed the run and its lines.
    Unsigned,
    /// The run is from before the first signed line of the chain, and no such line that the bench trusts covers it.
    Unwitnessed,
    /// A program played the module.
    Simulated,
    /// A program may have played the board.
    Unproven,
    /// Old samples were judged again.
    Rejudged,
    /// Another plan.
    OtherPlan,
    /// The same name, and other texts.
    OtherVersion,
    /// Chosen items alone.
    Selection,
    /// The station could not tell, or the run was stopped.
    NoVerdict,
    /// Longer ago than the plan allows.
    TooOld,
    /// Later than now by the clock of the computer.
    InFuture,
    /// The module was exchanged for another one during the run.
    Exchanged,
    /// The same, and an item had failed.
    ExchangedAfterFailure,
}

impl Flaw {
    /// The flaw in words behind what the run says of itself; `None` if that says it already.
    pub fn words(self) -> Option<&'static str> {
        Some(match self {
            Self::Missing => "record is missing",
            Self::Unreadable => "record unreadable",
            Self::UnderWay => "still running",
            Self::NotClosed => "record not closed",
            Self::Interrupted => "interrupted",
            Self::NotInChain => "not in the chain",
            Self::ClosedLate => "closed late",
            Self::LinesMissing => "later lines of the chain are missing or damaged",
            Self::Changed => "record was changed",
            Self::Unsigned => "not signed by a key that this bench trusts",
            Self::Unwitnessed => "from before the key, and no signed run came after it",
            Self::Simulated => "simulated",
            Self::Unproven => "unproven",
            Self::Rejudged => "re-judged by other limits",
            Self::OtherVersion => "by another version of the plan",
            Self::TooOld => "too long ago",
            Self::InFuture => "later than this computer's clock",
            Self::Exchanged => "ended with another module in the socket, so nothing is known of this one",
            Self::ExchangedAfterFailure => {
                "an item failed, then another module was in the socket, so nothing more is known of this one"
            }
            Self::OtherPlan | Self::Selection | Self::NoVerdict => return None,
        })
    }
}

/// How a record is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seal {
    /// Closed, in the chain, and as it was closed. Raw samples are not compared.
    Chained,
    /// It has this flaw.
    Flawed(Flaw),
}

/// What a record says of a run, as far as the standing needs it.
#[derive(Clone, Debug, PartialEq)]
pub struct RunFacts {
    /// The scanned serial number.
    pub serial_number: String,
    /// The plan.
    pub plan: PlanInfo,
    /// Whether the bench is real.
    pub bench: BenchKind,
    /// The chosen items; `None` for the whole plan.
    pub selection: Option<Vec<String>>,
    /// Whether old samples were judged again.
    pub rejudged: bool,
    /// Whether the run has no end.
    pub interrupted: bool,
    /// `None` if the record has no verdict.
    pub verdict: Option<Verdict>,
    /// When the run began.
    pub started: DateTime<FixedOffset>,
    /// When it ended, if it has an end.
    pub ended: Option<DateTime<FixedOffset>>,
    /// Whether the module was exchanged for another one during the run. What was measured is of neither then.
    pub exchanged: bool,
    /// Whether an item failed.
    pub has_failed_item: bool,
}

impl From<&RunRecord> for RunFacts {
    fn from(record: &RunRecord) -> Self {
        Self {
            serial_number: record.serial_number.clone(),
            plan: record.plan.clone(),
            bench: record.bench.kind,
            selection: record.selection.clone(),
            rejudged: record.recomputed.is_some(),
            interrupted: record.interrupted,
            verdict: Some(record.verdict),
            started: record.started,
            ended: record.finished,
            exchanged: record.other_module.as_ref().is_some_and(|other| other.exchanged),
            has_failed_item: record.items.iter().any(|item| item.outcome == Outcome::Failed),
        }
    }
}

impl RunFacts {
    /// Why the run can never count for its module, as far as its own record tells.
    fn own_flaws(&self) -> Vec<Flaw> {
        let judged = self
            .verdict
            .is_some_and(|verdict| matches!(verdict.of_items(), Outcome::Passed | Outcome::Marginal | Outcome::Failed));
        let flaws = [
            (self.interrupted, Flaw::Interrupted),
            (self.bench == BenchKind::Simulated, Flaw::Simulated),
            (self.bench == BenchKind::Unproven, Flaw::Unproven),
            (self.rejudged, Flaw::Rejudged),
            (self.selection.is_some(), Flaw::Selection),
            (!judged, Flaw::NoVerdict),
            (self.exchanged && !self.has_failed_item, Flaw::Exchanged),
            (self.exchanged && self.has_failed_item, Flaw::ExchangedAfterFailure),
        ];
        flaws.into_iter().filter(|(is, _)| *is).map(|(_, flaw)| flaw).collect()
    }

    /// Why the run does not answer a question, apart from how its record is kept. Empty if it does.
    pub fn flaws(&self, question: &Question<'_>) -> Vec<Flaw> {
        let mut flaws = self.own_flaws();
        if question.bench == BenchKind::Simulated {
            flaws.retain(|flaw| *flaw != Flaw::Simulated);
        }
        match question.plan {
            PlanAsked::This(plan) if plan.name == self.plan.name && plan.sha256 != self.plan.sha256 => {
                flaws.push(Flaw::OtherVersion);
            }
            plan if plan.name() != self.plan.name => flaws.push(Flaw::OtherPlan),
            PlanAsked::This(_) | PlanAsked::Named(_) => {}
        }
        if self.started > question.now + CLOCK_SLACK {
            flaws.push(Flaw::InFuture);
        }
        let at = self.ended.unwrap_or(self.started);
        if question.now - at > TimeDelta::days(i64::from(question.valid_days)) {
            flaws.push(Flaw::TooOld);
        }
        flaws
    }
}

/// A run of a module, and what it is worth.
#[derive(Clone, Debug, PartialEq)]
pub struct PastRun {
    /// When it ended, or began if it has no end; `None` if nothing tells.
    pub at: Option<DateTime<FixedOffset>>,
    /// Name of its plan; that of its folder if the record cannot be read.
    pub plan: String,
    /// How it ended, if the record says it.
    pub verdict: Option<Verdict>,
    /// Its chosen items, if it was a selection.
    pub items: Option<Vec<String>>,
    /// Whether the bench was real; taken as real if nothing tells.
    pub bench: BenchKind,
    /// Whether its record is known to be another one than was closed, so that nothing in it can be believed.
    pub is_broken: bool,
    /// Why it does not count; empty if it does.
    pub flaws: Vec<Flaw>,
}

impl PastRun {
    /// A run of which only the name of its folder is known.
    pub fn nameless(plan: String, at: Option<DateTime<FixedOffset>>, flaw: Flaw) -> Self {
        Self { at, plan, verdict: None, items: None, bench: BenchKind::Real, is_broken: false, flaws: vec![flaw] }
    }

    /// A run with what is known of it, and why it does not count.
    pub fn new(facts: &RunFacts, flaws: Vec<Flaw>) -> Self {
        Self {
            at: Some(facts.ended.unwrap_or(facts.started)),
            plan: facts.plan.name.clone(),
            verdict: facts.verdict,
            items: facts.selection.clone(),
            bench: facts.bench,
            is_broken: false,
            flaws,
        }
    }

    /// Whether a pass of a plan before this run is refuted by it: the run is of the same plan and failed, ended with another
    /// module in the socket, or is kept in a way that hides what it says.
    pub fn speaks_against(&self, plan: &str) -> bool {
        let hides = |flaw: &Flaw| {
            let unproved = matches!(flaw, Flaw::NotClosed | Flaw::NotInChain | Flaw::ClosedLate);
            let exchanged = matches!(flaw, Flaw::Exchanged | Flaw::ExchangedAfterFailure);
            let altered = matches!(flaw, Flaw::Missing | Flaw::Changed | Flaw::Unreadable | Flaw::Unsigned);
            unproved || exchanged || altered
        };
        // Of a run that is gone only the folder's name is known: the second one of a plan in a second ends with a number.
        let rest = self.plan.strip_prefix(plan);
        let number = rest.and_then(|rest| rest.strip_prefix('-'));
        let may_be_of_it =
            rest == Some("") || self.verdict.is_none() && number.is_some_and(|text| text.parse::<u32>().is_ok());
        let failed = self.verdict.is_some_and(|verdict| verdict.of_items() == Outcome::Failed);
        may_be_of_it && (failed || self.flaws.iter().any(hides))
    }

    /// Whether the run can say anything on such a bench: one that did not prove its board says nothing on a bench that is no
    /// simulation.
    pub fn is_of_world(&self, of: BenchKind) -> bool {
        of == BenchKind::Simulated || self.bench == BenchKind::Real
    }

    /// Whether a pass before this run is in doubt because of it. A run whose record was altered is a doubt whatever it says.
    pub fn is_doubt(&self, of: BenchKind) -> bool {
        if self.is_broken {
            return true;
        }
        let of_this_world = self.is_of_world(of);
        let good = self.verdict.is_some_and(|verdict| verdict.of_items().is_good());
        of_this_world && !self.flaws.contains(&Flaw::Rejudged) && !good
    }
}

/// The standing of a module by one plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Standing {
    /// Name of the plan.
    pub plan: String,
    /// The newest run that counts.
    pub counts: Option<PastRun>,
    /// A later run that puts it in doubt, one that [speaks against](PastRun::speaks_against) it before others; or, if no run
    /// counts, the newest run, of this plan before others.
    pub beside: Option<PastRun>,
}

impl Standing {
    /// Whether a run counts and passed the module.
    pub fn passes(&self) -> bool {
        self.counts.as_ref().and_then(|run| run.verdict).is_some_and(Verdict::passes_module)
    }

    /// Whether a run counts and passed, and no later run of this plan speaks against it or is kept in a way that hides what
    /// it says: another plan may build on the pass.
    pub fn passes_beyond_doubt(&self) -> bool {
        self.passes() && !self.beside.as_ref().is_some_and(|run| run.speaks_against(&self.plan))
    }

    /// Whether this plan was run as a whole on the module, whatever that is worth: a person may not want it twice.
    pub fn was_run(&self) -> bool {
        let this_whole = |run: &PastRun| run.plan == self.plan && run.items.is_none();
        self.counts.is_some() || self.beside.as_ref().is_some_and(this_whole)
    }

    /// What an operator can do so that a run of this plan counts.
    pub fn try_this(&self) -> &'static str {
        let has = |flaw| self.beside.iter().any(|run| run.flaws.contains(&flaw));
        if has(Flaw::LinesMissing) {
            return "run that plan on this module again: a pass behind the missing lines counts; `gnc-station records verify` names them";
        }
        if has(Flaw::Unwitnessed) {
            "carry out any run with the key of this bench: its signed line covers the runs before it; then try again"
        } else if has(Flaw::Unsigned) {
            "run that plan on this module again; if another station of yours carried it out, name its public key in trusted_keys under [station] of the bench file"
        } else {
            "run that plan on this module first; the whole plan must pass, on a bench like this one"
        }
    }

    /// Whether there is any run of the module.
    pub fn is_tested(&self) -> bool {
        self.counts.is_some() || self.beside.is_some()
    }
}

/// Why a run does not count for its module, as far as its own record can tell; empty if it may count. Whether the record
/// is closed and in the chain is known only later.
pub fn own_flaws(record: &RunRecord) -> Vec<Flaw> {
    RunFacts::from(record).own_flaws()
}

/// "only identity passed 2026-11-28 14:30: simulated".
impl fmt::Display for PastRun {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.items {
            None => write!(f, "{}", printable(&self.plan))?,
            Some(items) if items.len() <= NAMED_ITEMS => write!(f, "only {}", printable(&items.join(", ")))?,
            Some(items) => write!(f, "only {} items", items.len())?,
        }
        if let Some(verdict) = self.verdict.filter(|_| !self.flaws.contains(&Flaw::Interrupted)) {
            let outcome = verdict.of_items();
            write!(f, " {}", if outcome == Outcome::NotRun { "not run" } else { outcome.as_str() })?;
        }
        if let Some(at) = self.at {
            write!(f, " {}", at.format("%F %H:%M"))?;
        }
        // On a simulated bench that is no flaw, and still no evidence.
        if self.bench == BenchKind::Simulated && !self.flaws.contains(&Flaw::Simulated) {
            f.write_str(", simulated")?;
        }
        let flaws: Vec<&str> = self.flaws.iter().filter_map(|flaw| flaw.words()).collect();
        if flaws.is_empty() { Ok(()) } else { write!(f, ": {}", flaws.join(", ")) }
    }
}

/// "functional passed 2026-11-28 14:30", "incoming passed 2026-11-28 14:30; functional never".
impl fmt::Display for Standing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.counts, &self.beside) {
            (Some(counts), beside) => {
                write!(f, "{counts}")?;
                beside.as_ref().map_or(Ok(()), |beside| write!(f, "; then {beside}"))
            }
            (None, Some(beside)) if beside.plan == self.plan => write!(f, "{beside}"),
            (None, Some(beside)) => write!(f, "{beside}; {} never", printable(&self.plan)),
            (None, None) => f.write_str("never tested"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pass, and beside it another run: which of them lets the next plan begin.
    #[test]
    fn what_closes_the_gate() {
        let passed = PastRun { verdict: Some(Verdict::Module(Outcome::Passed)), ..nameless("incoming", None) };
        let gate = |beside: Option<PastRun>| {
            Standing { plan: "incoming".into(), counts: Some(passed.clone()), beside }.passes_beyond_doubt()
        };
        assert!(gate(None));
        let hidden = [
            Flaw::Missing,
            Flaw::Changed,
            Flaw::NotClosed,
            Flaw::NotInChain,
            Flaw::ClosedLate,
            Flaw::Unreadable,
            Flaw::Unsigned,
        ];
        for flaw in hidden {
            assert!(!gate(Some(nameless("incoming", Some(flaw)))), "{flaw:?}");
            assert!(!gate(Some(nameless("incoming-2", Some(flaw)))), "the second run in a second: {flaw:?}");
            assert!(gate(Some(nameless("incoming-cold", Some(flaw)))), "another plan: {flaw:?}");
        }
        let failed = |plan| PastRun { verdict: Some(Verdict::Selection(Outcome::Failed)), ..nameless(plan, None) };
        assert!(!gate(Some(failed("incoming"))) && gate(Some(failed("functional"))));
        let none = Standing { plan: "incoming".into(), counts: None, beside: Some(passed.clone()) };
        assert!(!none.passes_beyond_doubt());
    }

    fn nameless(plan: &str, flaw: Option<Flaw>) -> PastRun {
        let flaws = flaw.into_iter().collect();
        let bench = BenchKind::Real;
        PastRun { at: None, plan: plan.into(), verdict: None, items: None, bench, is_broken: false, flaws }
    }
}
