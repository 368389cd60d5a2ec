//! Plans and benches that the screen can choose.

use std::path::{Path, PathBuf};

use gnc_bench::fixture::Fixture;
use gnc_executive::event::BenchKind;
use gnc_executive::job::Job;
use gnc_executive::limit::Limit;
use gnc_records::store::digest;
use tokio::sync::mpsc;

use super::archive;
use crate::args::RunArgs;
use crate::files;
use crate::refusal::Refusal;
use crate::setup::{self, BENCH_FILE, Setup};
use crate::tui::model::{BenchView, Loaded, PlanView, ProgramView};
use crate::tui::setup_form::Choices;
use crate::tui::update::Msg;

/// What stands before the name of a simulated module.
pub(crate) const SIM: &str = "sim:";
/// Where plans lie.
const PLANS: &str = "test-plans";
/// Files that are offered; more are typed.
const MAX_CHOICES: usize = 100;

/// Looks at bench and plan and tells the screen what they are, or all that is wrong with them.
pub(super) fn look(args: &RunArgs, plan_path: &Path, screen: &mpsc::Sender<Msg>) {
    let nobody = || Ok(Fixture::Screen(mpsc::channel(1).0));
    let setup = setup::from_args(args, "", nobody);
    let path = bench_name(args);
    let bench = match &setup {
        Ok(setup) => Loaded::Ready(bench_view(args, setup)),
        Err(refusal) => Loaded::Refused(lines(refusal)),
    };
    let _ = screen.blocking_send(Msg::Bench { path, bench });
    let path = plan_path.display().to_string();
    let plan = match plan_view(plan_path, setup.as_ref().ok()) {
        Ok(view) => Loaded::Ready(view),
        Err(refusal) => Loaded::Refused(lines(&refusal)),
    };
    let good = matches!(plan, Loaded::Ready(_));
    let _ = screen.blocking_send(Msg::Plan { path, plan });
    if let (true, Ok(setup), Ok(plan)) = (good, setup, files::plan(plan_path)) {
        let expected = archive::last_whole_run_s(&setup.records, &digest::of_plan(plan.files()), setup.bench.kind);
        let _ = screen.blocking_send(Msg::Expected(expected));
    }
}

fn lines(refusal: &Refusal) -> String {
    if refusal.try_this.is_empty() { refusal.what.clone() } else { format!("{}\n{}", refusal.what, refusal.try_this) }
}

fn bench_view(args: &RunArgs, setup: &Setup) -> BenchView {
    BenchView {
        station: setup.station.clone(),
        kind: setup.bench.kind,
        name: setup.bench.personality.clone().unwrap_or_else(|| bench_name(args)),
        link: match setup.bench.kind {
            // Another one for each module.
            BenchKind::Simulated => String::new(),
            BenchKind::Real => setup.target.to_string(),
        },
        records: setup.records.clone(),
    }
}

fn plan_view(path: &Path, setup: Option<&Setup>) -> Result<PlanView, Refusal> {
    let plan = files::plan(path)?;
    // Without a bench the plan alone is checked, as somebody may mend one after the other.
    let abilities = setup.map_or(setup::SIMULATED, |setup| setup.abilities);
    let part = plan.items().iter().find_map(|item| match item.limit("part") {
        Some(Limit::Text(text)) => Some(text.resolve("").to_owned()),
        _ => None,
    });
    let (name, version) = (plan.name.clone(), plan.version.clone());
    let programs = plan.items().iter().filter_map(ProgramView::of).collect();
    let job = Job::new(plan, abilities, None).map_err(|mistakes| Refusal::new(mistakes, ""))?;
    Ok(PlanView { name, version, items: job.planned(), programs, part, expected_s: None })
}

/// The bench as the form names it.
fn bench_name(args: &RunArgs) -> String {
    match (&args.sim, &args.bench) {
        (Some(sim), _) => format!("{SIM}{}", sim.display()),
        (None, Some(path)) => path.display().to_string(),
        (None, None) => BENCH_FILE.to_owned(),
    }
}

/// Takes a bench as the form names it.
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

/// Where records go, as far as the command line and the bench file say.
pub(super) fn records(args: &RunArgs) -> PathBuf {
    setup::records_folder(args)
}

/// Plans and benches that lie where they usually do.
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
