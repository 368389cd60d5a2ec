//! How an item and a run end, and which of several outcomes counts.

use std::fmt;

use serde::{Deserialize, Serialize};

/// How an attempt, an item or a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Every limit is kept.
    Passed,
    /// Every limit is kept, but at least one value is closer to its limit than the plan likes.
    Marginal,
    /// At least one limit is violated: the module is bad.
    Failed,
    /// The station could not tell: a lost link, a value that is not a number, a measurement that never came.
    Errored,
    /// Stopped by a person or a signal.
    Aborted,
    /// Deliberately not run, for the reason in its [`Cause`].
    Skipped,
    /// Planned but not reached.
    NotRun,
}

impl Outcome {
    /// All outcomes, best first.
    pub const ALL: [Outcome; 7] = [
        Outcome::Passed,
        Outcome::Marginal,
        Outcome::Failed,
        Outcome::Errored,
        Outcome::Aborted,
        Outcome::Skipped,
        Outcome::NotRun,
    ];

    /// The name in records: lower case, words joined by an underscore.
    pub fn as_str(self) -> &'static str {
        match self {
            Outcome::Passed => "passed",
            Outcome::Marginal => "marginal",
            Outcome::Failed => "failed",
            Outcome::Errored => "errored",
            Outcome::Aborted => "aborted",
            Outcome::Skipped => "skipped",
            Outcome::NotRun => "not_run",
        }
    }

    /// Passed or marginal: every limit is kept.
    pub fn is_good(self) -> bool {
        matches!(self, Outcome::Passed | Outcome::Marginal)
    }

    /// Returns the worst of outcomes that say something about the module, aborted > errored > failed > marginal >
    /// passed.
    ///
    /// Skipped and not run say nothing about the module, so they do not count; `None` if there are only such outcomes.
    pub fn worst(outcomes: impl IntoIterator<Item = Outcome>) -> Option<Outcome> {
        outcomes.into_iter().filter(|outcome| outcome.severity() > 0).max_by_key(|outcome| outcome.severity())
    }

    fn severity(self) -> u8 {
        match self {
            Outcome::Skipped | Outcome::NotRun => 0,
            Outcome::Passed => 1,
            Outcome::Marginal => 2,
            Outcome::Failed => 3,
            Outcome::Errored => 4,
            Outcome::Aborted => 5,
        }
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

/// Why an item was skipped or not run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Cause {
    /// The bench lacks a device, and the plan calls the item optional.
    DeviceMissing {
        /// What the bench lacks, for people: "CAN link".
        device: String,
    },
    /// An item that this one requires did not pass.
    Precondition {
        /// Name of the required item.
        item: String,
        /// How that item ended.
        outcome: Outcome,
    },
    /// A setup item did not pass, so the items that need it did not run.
    Setup {
        /// Name of the setup item.
        item: String,
        /// How that item ended.
        outcome: Outcome,
    },
    /// The plan stops at the first item that is not good.
    StoppedAfter {
        /// Name of that item.
        item: String,
        /// How it ended.
        outcome: Outcome,
    },
    /// The operator chose other items.
    NotSelected,
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Cause::DeviceMissing { device } => write!(f, "the bench has no {device}"),
            Cause::Precondition { item, outcome } => write!(f, "requires {item}, which {}", verb(*outcome)),
            Cause::Setup { item, outcome } => write!(f, "the setup item {item} {}", verb(*outcome)),
            Cause::StoppedAfter { item, outcome } => {
                write!(f, "the plan stops at the first bad item, and {item} {}", verb(*outcome))
            }
            Cause::NotSelected => f.write_str("not selected"),
        }
    }
}

/// The outcome as words in a sentence: "not run" instead of "not_run".
pub(crate) fn words(outcome: Outcome) -> &'static str {
    if outcome == Outcome::NotRun { "not run" } else { outcome.as_str() }
}

/// The outcome as the verb of a sentence: "failed", "was skipped".
fn verb(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Passed => "passed",
        Outcome::Marginal => "was marginal",
        Outcome::Failed => "failed",
        Outcome::Errored => "errored",
        Outcome::Aborted => "was aborted",
        Outcome::Skipped => "was skipped",
        Outcome::NotRun => "was not run",
    }
}

/// What the end of one item means for its run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ItemEnd {
    /// How the item ended.
    pub outcome: Outcome,
    /// Whether the run is complete without it: the plan calls it optional, or it is not selected.
    pub dispensable: bool,
}

/// Returns the outcome of a run.
///
/// - The worst judged item counts: aborted > errored > failed > marginal > passed.
/// - `stopped` (a stop was requested) gives aborted, whatever the items say.
/// - If every judged item is good, but an item that the plan requires was skipped or not run, the run is errored: the
///   station cannot tell whether the module is good. With a failed item the run stays failed, so that items skipped
///   *because* of a failed one do not turn a failed module into an errored bench.
/// - A run without any judged item is errored, never passed, even if every item is optional.
pub(crate) fn run_outcome(items: impl IntoIterator<Item = ItemEnd>, stopped: bool) -> Outcome {
    if stopped {
        return Outcome::Aborted;
    }
    let mut worst = None;
    let mut missing = false;
    for item in items {
        worst = Outcome::worst(worst.into_iter().chain([item.outcome]));
        missing |= matches!(item.outcome, Outcome::Skipped | Outcome::NotRun) && !item.dispensable;
    }
    match worst {
        None => Outcome::Errored,
        Some(outcome) if outcome.is_good() && missing => Outcome::Errored,
        Some(outcome) => outcome,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(items: &[(Outcome, bool)]) -> Outcome {
        run_outcome(items.iter().map(|&(outcome, dispensable)| ItemEnd { outcome, dispensable }), false)
    }

    #[test]
    fn the_worst_item_counts() {
        use Outcome::{Aborted, Errored, Failed, Marginal, NotRun, Passed, Skipped};
        let ladder = [Passed, Marginal, Failed, Errored, Aborted];
        for (i, &a) in ladder.iter().enumerate() {
            for (j, &b) in ladder.iter().enumerate() {
                assert_eq!(run(&[(a, false), (b, false)]), ladder[i.max(j)]);
            }
        }
        // An optional item that was skipped does not change a pass; a missing required item prevents it.
        assert_eq!(run(&[(Passed, false), (Skipped, true)]), Passed);
        assert_eq!(run(&[(Passed, false), (Skipped, false)]), Errored);
        assert_eq!(run(&[(Passed, false), (NotRun, false)]), Errored);
        // Items skipped after a failed one leave the run failed.
        assert_eq!(run(&[(Failed, false), (Skipped, false)]), Failed);
        // A run without a judgement is never a pass.
        assert_eq!(run(&[]), Errored);
        assert_eq!(run(&[(Skipped, true), (NotRun, true)]), Errored);
        assert_eq!(run_outcome([ItemEnd { outcome: Passed, dispensable: false }], true), Aborted);
    }

    #[test]
    fn names_in_records_are_lower_case() {
        for outcome in Outcome::ALL {
            assert_eq!(serde_json::to_string(&outcome).unwrap(), format!("\"{}\"", outcome.as_str()));
        }
    }

    #[test]
    fn causes_read_as_sentences() {
        let cause = Cause::Precondition { item: "identity".into(), outcome: Outcome::NotRun };
        assert_eq!(cause.to_string(), "requires identity, which was not run");
        assert_eq!(
            serde_json::to_string(&cause).unwrap(),
            r#"{"kind":"precondition","item":"identity","outcome":"not_run"}"#
        );
    }
}
