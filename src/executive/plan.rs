//! Test plans: which items run, in which order, with which parameters, and which limits every measured value must keep.
//!
//! A plan is written in TOML. This module reads it and checks it, and reports all mistakes at once, with line and
//! column. The language, with every key:
//!
//! ```toml
//! name = "functional"                # required; small letters, digits, - _ .
//! version = "1.0"                    # required
//! description = "what it is for"
//! serial_number = "SN-[0-9]{4}"      # a regular expression that the whole number of a module matches
//! on_fail = "continue"               # or "stop": skip the rest after the first item that is not good
//! include = ["other.toml"]           # items of other plans, run before those of this one
//! requires_plan = ["incoming"]       # plans that the module must have passed before this one
//! valid_days = 30                    # days for which a pass counts, of this plan and of those that it requires
//!
//! requires_part = false              # true: only modules whose part number has a table below
//!
//! [numbers.order]                    # a number that is asked for beside the serial number, see `numbers.rs`
//! kind = "order"
//! pattern = "PO-[0-9]{4}"
//!
//! [resume]                           # of a run that takes over captures: it waits for the module's temperature
//! wait = "30 min"                    # at most so long in all
//! within = "0.5 degC"                # of what those captures had at their end
//!
//! [[item]]
//! id = "imu"                         # required; an item of the catalogue
//! name = "imu-cold"                  # unique; the id, unless an item stands twice
//! phase = "test"                     # or "setup": all tests need it; "teardown": always run at the end
//! optional = false                   # true: skipped, not refused, where the bench lacks a device
//! requires = ["identity"]            # skipped unless these items, which stand before it, are good
//! attempts = 2                       # tries of an errored item
//! retry_failed = false               # true: tries of a failed item too
//! repeats = 1                        # rounds within an attempt
//! timeout = "30 s"                   # board time for an attempt
//! decision = "simple"                # or "guard-band": the whole coverage interval of a figure must be within the limit
//! prompt = "Level the table."        # asked before the first attempt
//! params = { samples = 400, rate = "200 Hz" }
//! [item.limits]
//! gyro_x = "0 +- 2 deg/s"
//! "accel_*_noise" = "<= 5 mg"        # * stands for any letters
//! accel_norm = { limit = "1 g +- 5 %", marginal = "1 mg" }
//!
//! [part.GNC-POP-26B.limits]          # for modules that say this part number, in place of the items' own
//! imu.gyro_x = "0 +- 1 deg/s"
//! [part.GNC-POP-26B.revision.C.limits]   # for this hardware revision of it, in place of both
//! imu.gyro_x = "0 +- 1.5 deg/s"
//!
//! [[item]]
//! id = "prompt"                      # asks the operator
//! [[item.ask]]
//! name = "tp4"                       # required, unique in the plan; the measurement that the answer is
//! en = "What does the meter read?"   # required; zh and ru beside it
//! kind = "number"                    # required; or "text", "choice", "done"
//! unit = "V"                         # of a number without a unit
//! pattern = "GPS-[0-9]{5}"           # of a text
//! choices = ["clean", "scratched"]   # of a choice
//! good = ["clean"]                   # the choices that pass
//! picture = "tp4.png"                # path beside this file
//! ```
//!
//! If several limits fit one measurement, an exact name counts more than a pattern, and a later pattern more than an
//! earlier one.

mod closure;
mod item;
mod limits;
mod params;
mod part;
mod question;
mod resume;
mod schema;

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use gnc_config::{Mistake, Mistakes, SourceText};
use serde::{Deserialize, Serialize};

use crate::catalogue::{Device, ItemId};
use crate::limit::Limit;
use crate::measurement::{Measurement, Value};
use crate::numbers::NumberField;
use crate::outcome::Outcome;
use crate::part::{LimitsChosen, PartName};
use crate::quantity::Unit;
use crate::serial_number::SerialNumberPattern;
use crate::uncertainty::Decision;

pub use closure::UnreadInclude;
pub use params::{ParamError, ParamValue, Params};
pub use question::{AnswerError, DONE, Question, QuestionKind, QuestionWords, YES};
pub use resume::ResumeRules;
pub use schema::plan_schema;

/// Largest size of one plan file in bytes. The functional plan has about 5 kB, and 20,000 items have about 2 MB. A
/// larger file was given by mistake, and reading it would only take memory. Readers should stop at one byte more.
pub const MAX_PLAN_BYTES: usize = 4 << 20;

/// Largest number of files of a plan, its includes counted.
pub const MAX_PLAN_FILES: usize = 32;

/// Largest depth of includes within includes.
pub(crate) const MAX_INCLUDE_DEPTH: usize = 8;

/// Largest number of items of a plan. Time and memory are measured with this number, and real plans have far fewer.
pub(crate) const MAX_ITEMS: usize = 20_000;

/// Most results that a plan may ask for, repeats counted: a journal holds 1 GiB, and the line of a result takes some 250 bytes.
pub(crate) const MAX_RESULTS: usize = 4_000_000;

/// Days for which a pass counts if the plan does not say: a module stays on the shelf of a line for weeks, not months.
pub const DEFAULT_VALID_DAYS: u32 = 30;

/// Most days for which a pass may count: ten years, longer than any product waits.
pub(crate) const MAX_VALID_DAYS: i64 = 3653;

/// Most plans that a plan may require. Each is looked up in the records before a run.
pub(crate) const MAX_REQUIRED_PLANS: usize = 16;

/// A checked plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Name, fit for a folder.
    pub name: String,
    /// Version.
    pub version: String,
    /// What it is for; may be empty.
    pub description: String,
    /// What happens after an item that is not good.
    pub on_fail: OnFail,
    /// Names of the plans that the module must have passed before.
    pub requires_plan: Vec<String>,
    /// Days for which a pass counts.
    pub valid_days: u32,
    /// How a resumed run waits for the module's temperature.
    pub resume: ResumeRules,
    /// What the serial number of a module must match.
    pub serial_number: Option<SerialNumberPattern>,
    /// Whether only modules are tested whose part number has a table.
    pub requires_part: bool,
    /// Numbers beside the serial number that every run is asked for.
    pub numbers: Vec<NumberField>,
    items: Vec<PlanItem>,
    parts: Vec<part::PartLimits>,
    sources: Vec<SourceText>,
}

/// A plan requires a part that it names, and the module is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct PartNotNamed {
    /// The module.
    pub module: PartName,
}

impl fmt::Display for PartNotNamed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.module.is_blank() {
            return f.write_str("the limits of the plan depend on the part number, and the module says none");
        }
        write!(f, "the plan has no limits for part {}, and requires such", self.module)
    }
}

impl PartNotNamed {
    /// What people can try.
    pub fn try_this(&self) -> &'static str {
        if self.module.is_blank() {
            return "test the module with --part, or use a plan without tables [part.NAME]";
        }
        "use the plan for this part, or write a table [part.NAME] for it into this plan"
    }
}

/// What happens after an item that is not good.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnFail {
    /// The next item is run.
    #[default]
    Continue,
    /// The remaining items are skipped.
    Stop,
}

/// When an item is run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Before all tests; they are skipped unless it is good.
    Setup,
    /// The test itself.
    #[default]
    Test,
    /// After all tests, also after a stop in order.
    Teardown,
}

/// One item of a checked plan.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanItem {
    /// The unique name; fit for a folder.
    pub name: String,
    /// Which item of the catalogue.
    pub id: ItemId,
    /// When it is run.
    pub phase: Phase,
    /// Whether the item is skipped instead of refused if the bench lacks a device.
    pub optional: bool,
    /// Positions of the items that must be good, all before this one.
    pub requires: Vec<usize>,
    /// Tries, at least 1.
    pub attempts: u32,
    /// Whether a failed attempt is tried again like an errored one.
    pub retry_failed: bool,
    /// Rounds within an attempt, at least 1.
    pub repeats: u32,
    /// Board time for an attempt.
    pub timeout_s: f64,
    /// How the uncertainty of a figure counts near its limit.
    pub decision: Decision,
    /// What the operator must do before the first attempt.
    pub prompt: Option<String>,
    /// Every parameter of the catalogue, with its default if the plan gives no value.
    pub params: Params,
    /// What a person is asked, in this order; only an item `prompt` has questions.
    pub questions: Vec<Arc<Question>>,
    limits: Vec<ItemLimit>,
    place: ItemPlace,
}

/// The limit of one measurement.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ItemLimit {
    /// Name of the measurement: in the catalogue, or of a question.
    pub measurement: Cow<'static, str>,
    /// Its limit.
    pub limit: Limit,
}

/// The place of an item: file and bytes of its id.
#[derive(Clone, Debug, PartialEq, Eq)]
struct ItemPlace {
    source: usize,
    start: usize,
    end: usize,
}

impl Plan {
    /// Reads a plan and all that it includes.
    ///
    /// `name` is the user's name for the file. `load` takes the name of an include, joined to the folder of the file
    /// that includes it, and returns its bytes or says why it cannot. It should read no more than [`MAX_PLAN_BYTES`]
    /// and one byte.
    ///
    /// # Errors
    /// All mistakes of meaning in all files; or the first syntax error alone.
    pub fn read(
        name: &str,
        bytes: Vec<u8>,
        load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
    ) -> Result<Plan, Mistakes> {
        closure::read(name, bytes, &mut |include| load(include).map_err(Into::into))
    }

    /// The same; `load` also says what can be tried with an include that cannot be read.
    ///
    /// # Errors
    /// As [`Plan::read`].
    pub fn read_from(
        name: &str,
        bytes: Vec<u8>,
        load: &mut dyn FnMut(&str) -> Result<Vec<u8>, UnreadInclude>,
    ) -> Result<Plan, Mistakes> {
        closure::read(name, bytes, load)
    }

    /// The items in the order of running: setup, tests, teardown. Within each phase the items of includes come first.
    pub fn items(&self) -> &[PlanItem] {
        &self.items
    }

    /// Name and text of every file: the plan itself first, then its includes in the order of reading. A digest of the
    /// plan must cover all of them.
    pub fn files(&self) -> impl Iterator<Item = (&str, &[u8])> {
        self.sources.iter().map(|source| (source.name.as_str(), source.text.as_bytes()))
    }

    /// Whether limits depend on the part number of the module.
    pub fn has_parts(&self) -> bool {
        !self.parts.is_empty()
    }

    /// Whether limits depend on the revision of this part too.
    pub fn has_revisions_of(&self, part: &PartName) -> bool {
        let number = part.key().number;
        self.parts.iter().any(|table| table.name.revision.is_some() && table.name.key().number == number)
    }

    /// The parts and revisions that have limits of their own, as the plan writes them.
    pub fn parts(&self) -> impl Iterator<Item = &PartName> {
        self.parts.iter().map(|table| &table.name)
    }

    /// Chooses the limits for a module: those of its revision, else of its part, else the plan's own. A module without a part
    /// number has none, where they depend on it.
    ///
    /// # Errors
    /// [`PartNotNamed`].
    pub fn choose_limits(&self, module: &PartName) -> Result<LimitsChosen, PartNotNamed> {
        if module.is_blank() && self.has_parts() {
            return Err(PartNotNamed { module: module.clone() });
        }
        let own = module.revision.as_ref().and_then(|_| self.table(module));
        let table = own.or_else(|| self.table(&PartName { revision: None, ..module.clone() }));
        // A part of which only other revisions have limits is named too, but not this revision of it.
        let table = table.filter(|table| !self.is_only_a_head(table));
        if table.is_none() && self.requires_part {
            return Err(PartNotNamed { module: module.clone() });
        }
        Ok(LimitsChosen { part: table.map(|table| table.name.clone()), module: module.clone() })
    }

    /// The plan with the limits of a part and its revision in place of its own; `None` if it has no such table.
    pub fn with_limits_of(&self, part: &PartName) -> Option<Plan> {
        let own = self.table(part)?;
        let of_part = part.revision.as_ref().and_then(|_| self.table(&PartName { revision: None, ..part.clone() }));
        let mut plan = self.clone();
        for (position, limits) in of_part.into_iter().chain([own]).flat_map(|table| &table.items) {
            let Some(item) = plan.items.get_mut(*position) else { continue };
            limits.iter().for_each(|limit| part::put(&mut item.limits, limit.clone()));
            // In the order of the catalogue or of the questions, as items have them.
            let (spec, questions) = (item.id.spec(), &item.questions);
            let place = |limit: &ItemLimit| {
                let in_catalogue = spec.measurements.iter().position(|one| one.name == limit.measurement);
                in_catalogue.or_else(|| questions.iter().position(|one| one.name == limit.measurement))
            };
            item.limits.sort_by_key(place);
        }
        Some(plan)
    }

    fn table(&self, part: &PartName) -> Option<&part::PartLimits> {
        let key = part.key();
        self.parts.iter().find(|table| table.name.key() == key)
    }

    /// Whether a part has no limits and is written for its revisions only.
    fn is_only_a_head(&self, table: &part::PartLimits) -> bool {
        table.name.revision.is_none() && table.items.is_empty() && self.has_revisions_of(&table.name)
    }

    /// Checks what only the code that carries an item out knows: `look` returns what is wrong with the item, and what
    /// to try.
    ///
    /// # Errors
    /// All mistakes, each at the id of its item.
    pub fn check(self, look: impl Fn(&PlanItem) -> Vec<(String, &'static str)>) -> Result<Plan, Mistakes> {
        let mut mistakes = Mistakes::default();
        for item in &self.items {
            for (what, hint) in look(item) {
                mistakes.add(|| self.mistake_at(item, what, hint));
            }
        }
        mistakes.or(self)
    }

    /// Notes the digests of the pictures that questions show. `digest` reads a picture by its path, and returns none for one
    /// that cannot be read.
    #[must_use]
    pub fn with_pictures(mut self, digest: impl Fn(&str) -> Option<String>) -> Plan {
        for question in self.items.iter_mut().flat_map(|item| &mut item.questions) {
            if let Some(path) = &question.picture {
                let picture_sha256 = digest(path);
                *question = Arc::new(Question { picture_sha256, ..(**question).clone() });
            }
        }
        self
    }

    /// A mistake at the id of an item.
    pub(crate) fn mistake_at(&self, item: &PlanItem, what: String, hint: &str) -> Mistake {
        match self.sources.get(item.place.source) {
            Some(source) => source.mistake(item.place.start..item.place.end, what, hint),
            None => Mistake::nowhere(what, hint),
        }
    }
}

impl PlanItem {
    /// The title for people.
    pub(crate) fn title(&self) -> &'static str {
        self.id.spec().title
    }

    /// The devices that the bench must have to run it.
    pub(crate) fn devices(&self) -> impl Iterator<Item = Device> {
        let asks = self.prompt.is_some() && !self.id.spec().devices.contains(&Device::Operator);
        self.id.spec().devices.iter().copied().chain(asks.then_some(Device::Operator))
    }

    /// Whether it belongs to a selection of names. Setup and teardown belong to each, and all items if there is none.
    pub fn is_chosen(&self, selection: Option<&[String]>) -> bool {
        self.phase != Phase::Test || selection.is_none_or(|names| names.contains(&self.name))
    }

    /// All limits, in the order of the catalogue.
    pub fn limits(&self) -> impl Iterator<Item = (&str, &Limit)> {
        self.limits.iter().map(|limit| (&*limit.measurement, &limit.limit))
    }

    /// The limit of a measurement.
    pub fn limit(&self, measurement: &str) -> Option<&Limit> {
        self.limits.iter().find(|limit| limit.measurement == measurement).map(|limit| &limit.limit)
    }

    /// The unit in which a measurement is shown if no limit chooses one.
    fn unit_of(&self, measurement: &str) -> Unit {
        let asked = self.questions.iter().find(|question| question.name == measurement);
        match asked.map(|question| &question.kind) {
            Some(QuestionKind::Number { unit }) => *unit,
            _ => self.id.spec().measurement(measurement).map_or(Unit::Count, |spec| spec.unit),
        }
    }

    /// Judges a measured value. A measurement that is not in the catalogue has no limit and is information.
    ///
    /// `repeat` counts the rounds within an attempt from 1; it is recorded only if the plan repeats.
    pub fn judge(&self, name: &str, value: &Value, repeat: u32, serial_number: &str) -> Measurement {
        let shown = self.unit_of(name);
        let mut measurement = Measurement::judge(name, value, shown, self.limit(name), self.decision, serial_number);
        measurement.repeat = (self.repeats > 1).then_some(repeat);
        measurement
    }

    /// Returns the outcome of an attempt that ended by itself.
    ///
    /// - The worst measurement counts.
    /// - A limited measurement is errored if it never came, came in too few rounds, or was not available. But if
    ///   another one violates its limit, the attempt is failed: a procedure without a fix has no position either.
    /// - An attempt without a judgement is errored. Only setup and teardown may be without limits.
    pub fn attempt_outcome(&self, measurements: &[Measurement]) -> Outcome {
        let judged = |available: bool| {
            let these = measurements.iter().filter(move |measurement| measurement.is_available() == available);
            Outcome::worst(these.filter_map(|measurement| measurement.outcome))
        };
        let told = judged(true);
        if told.is_some_and(|outcome| !outcome.is_good()) {
            return told.unwrap_or(Outcome::Errored);
        }
        let complete = self.limits.iter().all(|limit| {
            let rounds = measurements.iter().filter(|measurement| measurement.name == limit.measurement);
            rounds.count() >= self.repeats as usize
        });
        if !complete || judged(false).is_some() {
            return Outcome::Errored;
        }
        let unlimited = self.limits.is_empty() && self.phase != Phase::Test;
        told.unwrap_or(if unlimited { Outcome::Passed } else { Outcome::Errored })
    }

    /// Names of limited measurements that never came, for the message of an errored attempt.
    pub fn missing<'a>(&'a self, measurements: &'a [Measurement]) -> impl Iterator<Item = &'a str> + 'a {
        self.limits
            .iter()
            .map(|limit| &*limit.measurement)
            .filter(|name| !measurements.iter().any(|measurement| measurement.name == **name))
    }
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Phase::Setup => "setup",
            Phase::Test => "test",
            Phase::Teardown => "teardown",
        })
    }
}

#[cfg(test)]
mod tests;
