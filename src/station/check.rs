//! `gnc-station plan check`: checks whether a bench can run plans.

use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use gnc_analysis::motion;
use gnc_executive::bench::PinnedPlans;
use gnc_executive::job::{BenchAbilities, Job};
use gnc_executive::limit::Limit;
use gnc_executive::part::PartName;
use gnc_executive::plan::Plan;
use gnc_files::Reach;
use gnc_text::printable;

use crate::exit_code::USAGE;
use crate::progress::Progress;
use crate::refusal::{CommandRefusal, refuse};
use crate::wording::Lines;
use crate::{files, setup};

/// `part`: the module whose limits are shown.
pub(crate) fn run(
    plans: &[PathBuf],
    (bench, sim): (Option<&Path>, bool),
    part: Option<&PartName>,
    reach: Reach,
) -> ExitCode {
    match the_bench(bench, sim) {
        Ok(bench) => check((plans, reach), bench.as_ref(), part, &mut Lines::to_stdout()),
        Err(refusal) => refuse(refusal.what, &refusal.try_this),
    }
}

/// Checks plans against a bench, if there is one, and says what it finds.
fn check(
    (plans, reach): (&[PathBuf], Reach),
    bench: Option<&CheckedAgainst>,
    part: Option<&PartName>,
    out: &mut Lines<impl Write>,
) -> ExitCode {
    let mut wrong = 0;
    for path in plans {
        let progress = Progress::begin("the plan is read and checked");
        let found = about(path, reach, bench, part);
        // No line of it comes between those of the plan.
        drop(progress);
        match found {
            Ok(said) => {
                for (name, sentence) in said {
                    match name {
                        Some(name) => out.say_sentence_of(&name, &sentence),
                        None => out.say_sentences(sentence),
                    }
                }
            }
            Err(refusal) => {
                wrong += 1;
                refused(&refusal, out);
            }
        }
    }
    if wrong > 0 { ExitCode::from(USAGE) } else { ExitCode::SUCCESS }
}

fn refused(refusal: &CommandRefusal, out: &mut Lines<impl Write>) {
    out.say_sentences(&refusal.what);
    if !refusal.try_this.is_empty() {
        out.say_sentences(format_args!("  try: {}", refusal.try_this));
    }
}

/// The bench that plans are held against.
struct CheckedAgainst {
    abilities: BenchAbilities,
    plans: PinnedPlans,
}

/// What is said, and of what: a name is no sentence, whatever it reads like.
type Said = (Option<String>, String);

/// What is to be said of a plan without mistakes that the bench runs.
fn about(
    path: &Path,
    reach: Reach,
    bench: Option<&CheckedAgainst>,
    part: Option<&PartName>,
) -> Result<Vec<Said>, CommandRefusal> {
    let plan = files::plan(path, reach)?;
    let info = plan.info();
    let plan = plan.plan();
    if let Some(bench) = bench {
        let pinned = bench.plans.check(plan, &info.sha256);
        pinned.map_err(|error| CommandRefusal::new(&error, error.try_this()))?;
    }
    let limits = part.map(|part| limits(plan, part)).transpose()?;
    let remark = match bench {
        Some(bench) => {
            Job::new(plan.clone(), bench.abilities, None).map_err(|mistakes| CommandRefusal::new(mistakes, ""))?;
            ""
        }
        None => ", not checked against a bench",
    };
    let path = printable(&gnc_text::shown_path(path)).into_owned();
    let good = match plan.items().len() {
        1 => format!("1 item, no mistake{remark}"),
        items => format!("{items} items, no mistake{remark}"),
    };
    let mut said = vec![(Some(path), good)];
    let is_pinned = bench.is_some_and(|bench| bench.plans.of(&info.name) == Some(info.sha256.as_str()));
    let line = PinnedPlans::line(&info.name, &info.sha256);
    said.push(match is_pinned {
        true => (None, format!("  pinned by the bench file: {line}")),
        false => (None, format!("  to pin it under [plans] of a bench file: {line}")),
    });
    said.extend(repeated(plan));
    said.extend(bench_time(plan));
    said.extend(limits.map(|limits| (None, limits)));
    Ok(said)
}

/// The limits by which a plan judges a module, each with the plan's own limit in its place if that is another.
fn limits(plan: &Plan, module: &PartName) -> Result<String, CommandRefusal> {
    if module.revision.is_none() && plan.has_revisions_of(module) {
        let what = format!("the limits for part {module} depend on its revision");
        return Err(CommandRefusal::new(what, "name it with --revision REV"));
    }
    let chosen = plan.choose_limits(module).map_err(|error| CommandRefusal::new(&error, error.try_this()))?;
    let judging = chosen.part.as_ref().and_then(|part| plan.with_limits_of(part));
    let mut lines = format!("  limits: {chosen}");
    for (item, own) in judging.as_ref().unwrap_or(plan).items().iter().zip(plan.items()) {
        for (name, limit) in item.limits() {
            let was = match own.limit(name) {
                Some(own) if own == limit => String::new(),
                Some(own) => format!(" (the item has {})", with_band(own)),
                None => " (the item has none)".to_owned(),
            };
            // Writing to a String cannot fail.
            let _ = write!(lines, "\n    {} {name} {}{was}", item.name, with_band(limit));
        }
    }
    Ok(lines)
}

/// A limit with its marginal band. Two limits that differ in the band alone are two limits.
fn with_band(limit: &Limit) -> String {
    match limit.band() {
        Some(band) => format!("{limit}, marginal within {band} of a bound"),
        None => limit.to_string(),
    }
}

/// How often each item that repeats measures, and the longest time that it may take: its time limit is for all repeats.
fn repeated(plan: &Plan) -> impl Iterator<Item = Said> {
    plan.items().iter().filter(|item| item.repeats > 1).map(|item| {
        let (repeats, limit) = (item.repeats, motion::DisplayDuration(item.timeout_s));
        let times = match item.params.integer("cycles") {
            Ok(cycles) => format!("{repeats} repeats of {cycles} cycles and at most {limit} for all of them"),
            Err(_) => format!("{repeats} repeats and at most {limit} for all of them"),
        };
        (Some(format!("  {}", item.name)), times)
    })
}

/// Describes the bench time of each item that captures, and the sum. Empty if no item captures.
fn bench_time(plan: &Plan) -> Vec<Said> {
    let mut said = Vec::new();
    let mut whole_s = 0.0;
    for item in plan.items() {
        if let Ok(Some(program)) = motion::program(item.id, &item.params) {
            whole_s += program.span_s() * f64::from(item.repeats);
            said.push((Some(format!("  {}", item.name)), program.to_string()));
        }
    }
    if !said.is_empty() {
        said.push((None, format!("  together {} of bench time for captures", motion::DisplayDuration(whole_s))));
    }
    said
}

/// Returns the bench. `None` if no bench is named and there is no `bench.toml`: then only the language of
/// the plan is checked.
fn the_bench(bench: Option<&Path>, sim: bool) -> Result<Option<CheckedAgainst>, CommandRefusal> {
    if sim {
        return Ok(Some(CheckedAgainst { abilities: setup::SIMULATED, plans: PinnedPlans::default() }));
    }
    let here = Path::new(setup::BENCH_FILE);
    match bench.or_else(|| files::is_there(here).then_some(here)) {
        // Assume that an operator is there when the plan is run; `--auto` without a terminal checks again.
        Some(path) => {
            let file = files::bench(path)?;
            Ok(Some(CheckedAgainst { abilities: setup::abilities(&file, true), plans: file.plans }))
        }
        None => Ok(None),
    }
}

#[cfg(test)]
mod tests;
