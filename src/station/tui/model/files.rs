//! Bench and plan as far as the screen shows them.

use std::path::PathBuf;
use std::sync::Arc;

use gnc_analysis::motion::{self, MotionProgram, MotionStep};
use gnc_bench::guidance::Guidance;
use gnc_executive::bench::DrawPictures;
use gnc_executive::catalogue::TEMPERATURE_DRIFT;
use gnc_executive::event::{BenchKind, PlannedItem};
use gnc_executive::limit::Limit;
use gnc_executive::numbers::NumberField;
use gnc_executive::part::{LimitsChosen, PartName};
use gnc_executive::plan::{PlanItem, QuestionWords};
use gnc_executive::serial_number::SerialNumberPattern;

/// The bench as far as the screen shows it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BenchView {
    /// Which station.
    pub station: String,
    /// Real, unproven or simulated.
    pub kind: BenchKind,
    /// Why the bench is unproven, if it is.
    pub unproven: Option<String>,
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
    /// The name is that of the last run; the bench file names no operator.
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
    /// Whether the bench file pins this digest.
    pub is_pinned: bool,
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
