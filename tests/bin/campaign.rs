//! A campaign of seeded runs: modules x faults of the line x stops x cables pulled out.
//!
//! Exit code 0: no violations; 1: violations, each with the command that repeats it; 2: usage.

use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::error::ErrorKind;
use clap::{CommandFactory as _, Parser};
use gnc_tests::campaign::{AT_ONCE, Campaign, Judged, Kept, Over, carry_out, table};

/// Runs the functional plan on simulated benches, each drawn from the seed. A good module never fails, a bad one never
/// passes, no run exceeds its time, and every loss is counted where it happened.
#[derive(Debug, Parser)]
#[command(name = "campaign")]
struct Args {
    /// Number of runs.
    #[arg(long, default_value_t = 2000)]
    runs: u64,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Makes only the run of this number.
    #[arg(long, value_name = "NUMBER", conflicts_with = "runs")]
    only: Option<u64>,
    /// The way between station and bench.
    #[arg(long, value_enum, default_value_t = Over::Memory)]
    over: Over,
    /// In memory: makes each run twice and checks that both are the same.
    #[arg(long)]
    twice: bool,
    /// Number of concurrent runs.
    #[arg(long, default_value_t = AT_ONCE)]
    at_once: usize,
    /// Folder for the records of runs with violations, and for the record of --only in any case.
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
}

fn main() -> ExitCode {
    let args = Args::parse();
    if args.twice && args.over == Over::Pty {
        let why = "over pseudo-terminals no run is the same twice: leave out --twice or --over pty";
        Args::command().error(ErrorKind::ArgumentConflict, why).exit();
    }
    let runs = args.only.map_or(0..args.runs, |only| only..only + 1);
    let campaign = Campaign {
        seed: args.seed,
        runs,
        over: args.over,
        twice: args.twice,
        at_once: args.at_once.max(1),
        keep: args.keep.map(|keep| (keep, if args.only.is_some() { Kept::All } else { Kept::Wrong })),
    };
    let total = campaign.runs.end - campaign.runs.start;
    let began = Instant::now();
    // A closed terminal needs no table.
    let mut out = std::io::stdout();
    let _ = writeln!(out, "seed {}, {total} runs", campaign.seed);
    let told = |count: usize, judged: &Judged| {
        let mut out = std::io::stdout().lock();
        for violation in &judged.violations {
            let _ = writeln!(
                out,
                "VIOLATION {}: {violation}\n  {:?}\n  {}",
                judged.case.board,
                judged.case,
                judged.case.command(args.over)
            );
        }
        if count.is_multiple_of(50) {
            let _ = writeln!(out, "{count} of {total} after {:.0} s", began.elapsed().as_secs_f64());
        }
    };
    let all = carry_out(&campaign, &told);
    let bad = all.iter().filter(|judged| !judged.violations.is_empty()).count();
    let _ = writeln!(out, "\n{}", table(&all));
    let _ = writeln!(
        out,
        "seed {}: {bad} of {total} runs with violations, in {:.0} s",
        campaign.seed,
        began.elapsed().as_secs_f64()
    );
    if bad == 0 { ExitCode::SUCCESS } else { ExitCode::from(1) }
}
