//! The plans and benches that the screen offers, and the chosen ones.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use gnc_bench::service::CheckedPlan;
use gnc_executive::bench::PinnedPlans;
use gnc_executive::catalogue::processor::PART;
use gnc_executive::job::{BenchAbilities, Job};
use gnc_executive::limit::Limit;
use gnc_executive::part::PartName;
use gnc_executive::plan::Plan;
use gnc_files::Reach;
use gnc_records::shift::last_operator;

use super::{archive, told};
use crate::args::RunArgs;
use crate::files::{self, ChangedFile};
use crate::refusal::CommandRefusal;
use crate::setup::{self, BENCH_FILE, CheckedBench};
use crate::tui::model::{BenchView, DriftLimits, Loaded, PlanAsks, PlanView, ProgramView, UsualOperator};
use crate::tui::setup_form::{Choices, FormLook};

/// The plan that is used when neither the command line nor the bench file names one.
const PLAN: &str = "test-plans/functional.toml";
/// Prefix of the name of a simulated module.
pub(crate) const SIM: &str = "sim:";
/// The folder of plans.
const PLANS: &str = "test-plans";
/// Largest number of files that are offered; the operator can type other names.
const MAX_CHOICES: usize = 100;

/// Why nothing is started while bench and plan are being read.
pub(super) const NOT_HELD: &str = "plan and bench are not those on the screen";

/// What runs when the operator starts: bench and plan as they were read, checked and shown.
#[derive(Debug, Clone, Default)]
pub(super) struct Held {
    pub bench: Option<Arc<CheckedBench>>,
    pub plan: Option<Arc<HeldPlan>>,
}

/// A plan as it was checked, and its path.
#[derive(Debug)]
pub(super) struct HeldPlan {
    pub path: PathBuf,
    pub plan: CheckedPlan,
}

impl Held {
    /// The files that are not as they were checked.
    pub(super) fn changed(&self) -> Vec<ChangedFile> {
        let plan = self.plan.iter().flat_map(|held| files::changed_plan(&held.path, &held.plan));
        let bench = self.bench.iter().filter_map(|bench| bench.text.as_ref());
        plan.chain(bench.filter_map(|text| files::changed(&text.path, &text.bytes))).collect()
    }
}

/// A result of a check of bench and plan, in the order of reporting.
#[derive(Debug)]
pub(super) enum Looked {
    Bench { path: String, bench: Result<Box<(CheckedBench, BenchView)>, CommandRefusal> },
    Plan { path: String, plan: Result<Box<(HeldPlan, PlanView)>, CommandRefusal> },
    Expected(Option<f64>),
}

/// Reads and checks bench and plan, and reports what they are or all their mistakes. Without a plan, it takes that of
/// the bench file.
pub(super) fn look(args: &RunArgs, plan_path: Option<&Path>, tell: impl Fn(Looked)) {
    let bench = setup::check(args);
    let known = bench.as_ref().ok().map(|bench| (bench.abilities, bench.bench.kind, bench.records.clone()));
    let pinned = bench.as_ref().ok().map(|bench| bench.plans.clone()).unwrap_or_default();
    let usual = bench.as_ref().ok().and_then(|bench| bench.habits.plan.clone());
    let plan_path = plan_path.map(Path::to_owned).or(usual).unwrap_or_else(|| PLAN.into());
    let plan_path = plan_path.as_path();
    let path = bench_name(args);
    let bench = bench.map(|checked| {
        let view = bench_view(&path, &checked);
        Box::new((checked, view))
    });
    tell(Looked::Bench { path, bench });
    // Without a bench, check the plan alone, so that the operator can correct one after the other.
    let abilities = known.as_ref().map_or(setup::SIMULATED, |(abilities, ..)| *abilities);
    let plan = plan_view(plan_path, args.reach(), abilities, &pinned).map(Box::new);
    let sha256 = plan.as_ref().ok().map(|plan| plan.1.sha256.clone());
    tell(Looked::Plan { path: plan_path.display().to_string(), plan });
    if let (Some(sha256), Some((_, kind, records))) = (sha256, known) {
        tell(Looked::Expected(archive::last_whole_run_s(&records, &sha256, kind)));
    }
}

/// Reads and checks bench and plan for the form, which shows them; nothing holds them.
pub(super) fn look_for_form(args: &RunArgs, plan_path: String, bench_path: String) -> FormLook {
    let bench = setup::check(args);
    let abilities = bench.as_ref().map_or(setup::SIMULATED, |bench| bench.abilities);
    let pinned = bench.as_ref().ok().map(|bench| bench.plans.clone()).unwrap_or_default();
    let bench = match bench {
        Ok(checked) => Loaded::Ready(bench_view(&bench_name(args), &checked)),
        Err(refusal) => Loaded::Refused(lines(&refusal)),
    };
    let plan = match plan_view(Path::new(&plan_path), args.reach(), abilities, &pinned) {
        Ok((_, view)) => Loaded::Ready(view),
        Err(refusal) => Loaded::Refused(lines(&refusal)),
    };
    FormLook { plan_path, bench_path, bench, plan }
}

pub(super) fn lines(refusal: &CommandRefusal) -> String {
    if refusal.try_this.is_empty() { refusal.what.clone() } else { format!("{}\n{}", refusal.what, refusal.try_this) }
}

fn bench_view(path: &str, checked: &CheckedBench) -> BenchView {
    BenchView {
        station: checked.station.clone(),
        kind: checked.bench.kind,
        unproven: checked.bench.unproven.clone(),
        name: checked.bench.personality.clone().unwrap_or_else(|| path.to_owned()),
        // A simulated bench has another link for each module.
        link: checked.link().map(ToString::to_string).unwrap_or_default(),
        records: checked.records.clone(),
        operator: usual_operator(checked),
        operator_required: checked.habits.operator.required,
        bell: checked.habits.bell,
        pictures: checked.habits.pictures,
        serial_number: checked.serial_number.clone(),
        numbers: checked.numbers.clone().into(),
    }
}

/// The operator of the bench file; else that of the last run of this shift.
fn usual_operator(checked: &CheckedBench) -> Option<UsualOperator> {
    if let Some(name) = checked.habits.operator.name.clone() {
        return Some(UsualOperator { name, remembered: false });
    }
    let last = last_operator(&told::shift_of(checked), told::shift_began(&checked.habits.shifts));
    last.map(|name| UsualOperator { name, remembered: true })
}

fn plan_view(
    path: &Path,
    reach: Reach,
    abilities: BenchAbilities,
    pinned: &PinnedPlans,
) -> Result<(HeldPlan, PlanView), CommandRefusal> {
    let checked = files::plan(path, reach)?;
    let refused = pinned.check(checked.plan(), checked.sha256());
    refused.map_err(|error| CommandRefusal::new(&error, error.try_this()))?;
    let is_pinned = !pinned.is_empty();
    let plan = checked.plan();
    let part = plan.items().iter().find_map(|item| match item.limit(PART.name) {
        Some(Limit::Text(text)) => Some(text.resolve("").to_owned()),
        _ => None,
    });
    let (name, version) = (plan.name.clone(), plan.version.clone());
    let programs = plan.items().iter().filter_map(ProgramView::of).collect();
    let job = Job::new(plan.clone(), abilities, None).map_err(|mistakes| CommandRefusal::new(mistakes, ""))?;
    let sha256 = checked.sha256().to_owned();
    let (items, serial_number) = (job.planned(), plan.serial_number.clone());
    let drift_limits = plan.parts().filter_map(|part| drift_limits_of(plan, part)).collect();
    let words = plan.items().iter().flat_map(|item| &item.questions).map(|question| question.words.clone()).collect();
    let (numbers, parts) = (plan.numbers.clone(), plan.parts().cloned().collect());
    let asks = Arc::new(PlanAsks { numbers, parts, drift_limits, words });
    let view =
        PlanView { name, version, sha256, is_pinned, items, programs, part, serial_number, asks, expected_s: None };
    Ok((HeldPlan { path: path.to_owned(), plan: checked }, view))
}

fn drift_limits_of(plan: &Plan, part: &PartName) -> Option<DriftLimits> {
    let plan = plan.with_limits_of(part)?;
    let programs = plan.items().iter().filter_map(ProgramView::of);
    let limits = programs.map(|program| (program.item, program.drift_limit)).collect();
    Some(DriftLimits { part: part.clone(), limits })
}

/// The name of the bench in the form.
fn bench_name(args: &RunArgs) -> String {
    match (&args.sim, &args.bench) {
        (Some(sim), _) => format!("{SIM}{}", sim.display()),
        (None, Some(path)) => path.display().to_string(),
        (None, None) => BENCH_FILE.to_owned(),
    }
}

/// Sets the bench by its name in the form.
pub(super) fn set_bench(args: &mut RunArgs, name: &str) {
    match name.strip_prefix(SIM) {
        Some(personality) => {
            args.sim = Some(personality.into());
            args.bench = None;
        }
        None => {
            args.sim = None;
            args.bench = Some(name.into());
        }
    }
}

/// The records folder, as far as the command line and the bench file name it.
pub(super) fn records(args: &RunArgs) -> PathBuf {
    setup::records_folder(args)
}

/// Plans and benches in the usual folders.
pub(super) fn choices(plan: &Path) -> Choices {
    let mut plans = Vec::new();
    for folder in [plan.parent().unwrap_or_else(|| Path::new("")), Path::new(PLANS)] {
        plans.extend(toml_files(folder, |_| true));
    }
    plans.sort();
    plans.dedup();
    let mut benches = toml_files(Path::new(""), |name| name.starts_with("bench"));
    benches.extend(simulated());
    plans.truncate(MAX_CHOICES);
    benches.truncate(MAX_CHOICES);
    Choices { plans, benches }
}

#[cfg(feature = "sim")]
fn simulated() -> impl Iterator<Item = String> {
    hw_mocks::boards().iter().map(|(name, _)| format!("{SIM}{name}"))
}

#[cfg(not(feature = "sim"))]
fn simulated() -> impl Iterator<Item = String> {
    std::iter::empty()
}

fn toml_files(folder: &Path, wanted: impl Fn(&str) -> bool) -> Vec<String> {
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let Ok(entries) = std::fs::read_dir(here) else { return Vec::new() };
    let names = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let names = names.filter(|name| name.ends_with(".toml") && wanted(name));
    names.map(|name| folder.join(name).display().to_string()).collect()
}
