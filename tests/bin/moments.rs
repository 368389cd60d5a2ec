//! Stops the station or pulls out cables at random moments of runs of a good module on a clean line. It measures how
//! long it takes until the run has ended and the module is off, and prints the figures with their bounds. Only one run
//! at a time, since the figures are times.

use std::io::Write as _;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use gnc_tests::campaign::{Case, Disturbance, Link, Over, Ran, run, violations};

/// Bound for a live link: time from a stop until the module is off.
const SAFE_LIVE_MS: f64 = 300.0;
/// Bound for a dead link: time until the station has ended.
const ENDED_DEAD_MS: f64 = 300.0;
/// Bound for a dead link: time until the board's own watchdog has switched the module off.
const SAFE_DEAD_MS: f64 = 2000.0;

/// Disturbs this many runs of each kind.
#[derive(Debug, Parser)]
struct Args {
    /// Number of runs with a stop, and of runs with a cable pulled out.
    #[arg(long, default_value_t = 100)]
    count: u64,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

fn main() -> ExitCode {
    let args = Args::parse();
    let mut out = std::io::stdout();
    // A closed terminal needs no figures.
    let _ = writeln!(out, "seed {}", args.seed);
    let mut bad = 0;
    for (disturbance, name) in
        [(Disturbance::Stop { again: None }, "stop"), (Disturbance::Unplug { back: None }, "cable pulled out")]
    {
        let mut times: [Vec<f64>; 2] = Default::default();
        for number in 0..args.count {
            let case = calm(args.seed, number, disturbance);
            let ran = run(&case, Over::Pty, None);
            for violation in violations(&case, &ran) {
                bad += 1;
                let _ = writeln!(out, "VIOLATION {name} {number}: {violation}");
            }
            let Ran { since_disturbed, off_since_disturbed, .. } = ran;
            // A run that ended before the disturbance does not count.
            if let Some((ended, off)) = since_disturbed.zip(off_since_disturbed) {
                times[0].push(ms(ended));
                times[1].push(ms(off));
            }
        }
        let live = matches!(disturbance, Disturbance::Stop { .. });
        let bounds = if live { [f64::NAN, SAFE_LIVE_MS] } else { [ENDED_DEAD_MS, SAFE_DEAD_MS] };
        for ((times, bound), what) in times.iter_mut().zip(bounds).zip(["end of the run", "module off"]) {
            let _ = writeln!(out, "{}", row(&format!("{name} to {what}"), times, bound));
        }
    }
    if bad == 0 { ExitCode::SUCCESS } else { ExitCode::from(1) }
}

fn calm(seed: u64, number: u64, disturbance: Disturbance) -> Case {
    let drawn = Case::drawn(seed, number);
    let link = if number % 4 == 3 { Link::Can } else { Link::Rs422 };
    Case { board: "good", link, faults: String::new(), kinds: Vec::new(), breach: "", disturbance, ..drawn }
}

fn ms(span: Duration) -> f64 {
    span.as_secs_f64() * 1e3
}

fn row(what: &str, times: &mut [f64], bound_ms: f64) -> String {
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times.get(((times.len() as f64 - 1.0) * share).round().max(0.0) as usize).copied();
    let [median, most, longest] = [0.5, 0.95, 1.0].map(|share| at(share).unwrap_or(f64::NAN));
    let beyond = times.iter().filter(|time| **time > bound_ms).count();
    let bound = if bound_ms.is_nan() { String::new() } else { format!(", {beyond} beyond the bound of {bound_ms} ms") };
    format!(
        "{what:34} {:4} times: median {median:6.1} ms, 95 % {most:6.1} ms, longest {longest:6.1} ms{bound}",
        times.len()
    )
}
