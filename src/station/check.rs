//! `gnc-station plan check`: would this bench run these plans?

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use gnc_executive::job::{BenchAbilities, Job};

use crate::auto::Refusal;
use crate::cli::{USAGE, refuse};
use crate::{files, setup};

pub(crate) fn run(plans: &[PathBuf], bench: Option<&Path>, sim: bool) -> ExitCode {
    let abilities = match abilities(bench, sim) {
        Ok(abilities) => abilities,
        Err(refusal) => return refuse(refusal.what, &refusal.try_this),
    };
    let mut out = std::io::stdout().lock();
    let mut wrong = 0;
    for path in plans {
        let checked = files::plan(path).and_then(|plan| {
            let items = plan.items().len();
            match abilities {
                Some(abilities) => Job::new(plan, abilities, None).map_err(|mistakes| Refusal::new(mistakes, ""))?,
                None => return Ok((items, ", not held against any bench")),
            };
            Ok((items, ""))
        });
        let _ = match checked {
            Ok((items, remark)) => writeln!(out, "{}: {items} items, no mistake{remark}", path.display()),
            Err(refusal) => {
                wrong += 1;
                writeln!(out, "{}", refusal.what)
            }
        };
    }
    if wrong > 0 { ExitCode::from(USAGE) } else { ExitCode::SUCCESS }
}

/// `None` if no bench is named and none is here: the language alone is checked then.
fn abilities(bench: Option<&Path>, sim: bool) -> Result<Option<BenchAbilities>, Refusal> {
    if sim {
        return Ok(Some(setup::SIMULATED));
    }
    let here = Path::new(setup::BENCH_FILE);
    match bench.or_else(|| here.exists().then_some(here)) {
        // Somebody will be there when it is run; `--auto` without a terminal looks again.
        Some(path) => Ok(Some(setup::abilities(&files::bench(path)?, true))),
        None => Ok(None),
    }
}
