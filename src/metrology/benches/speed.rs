//! Time and memory of the expensive methods, with their bounds: `cargo bench -p gnc-metrology --bench speed`; exits
//! with 1 when a bound is broken. Each figure is the best of several, since other programs share the machine. The least
//! processor time (of all threads) stands beside it. `-- allan`, `-- gate` or `-- ellip` runs a part.

#![allow(clippy::print_stdout, clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

#[path = "../tests/truth/truth.rs"]
mod truth;

use std::hint::black_box;
use std::time::Instant;

use gnc_metrology::allan::{DeviationKind, Input, Taus, analyse};
use gnc_metrology::gate::{RecordLayout, Screening, one_stretch};
use gnc_metrology::{ellipse, ellipsoid};
use nix::time::{ClockId, clock_gettime};
use truth::Dice;

fn main() {
    let mut broken = 0;
    let mut judge = |what: &str, value: f64, bound: f64, unit: &str, note: &str| {
        let word = if value <= bound { "ok" } else { "BROKEN" };
        broken += usize::from(value > bound);
        println!(
            "{what:<52} {value:>9.4} {unit:<2} bound {bound} {unit} ({:.0} %) {word}{note}",
            100.0 * value / bound
        );
    };
    let only: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let wanted = |part: &str| only.is_empty() || only.iter().any(|o| part.contains(o.as_str()));
    println!("load {}", std::fs::read_to_string("/proc/loadavg").unwrap().trim());
    if wanted("allan") {
        allan(&mut judge);
    }
    if wanted("gate") {
        gate(&mut judge);
    }
    if wanted("ellipse ellipsoid") {
        surfaces(&mut judge);
    }
    println!("load {}", std::fs::read_to_string("/proc/loadavg").unwrap().trim());
    if broken > 0 {
        std::process::exit(1);
    }
}

fn allan(judge: &mut impl FnMut(&str, f64, f64, &str, &str)) {
    let mut dice = Dice::new(7);
    let n = 3_600_000;
    let axes: Vec<Vec<f64>> = (0..6).map(|_| (0..n).map(|_| dice.normal()).collect()).collect();
    let before = status_mb("VmRSS:");
    let (wall, cpu) = best(15, || {
        for axis in &axes {
            black_box(analyse(axis, Input::Rate, 1000.0, DeviationKind::Oadev, &Taus::Octave, 2).unwrap());
        }
    });
    judge("oadev, octave, 6 axes x 3.6 million, two threads", wall, 0.25, "s", &format!(", processor time {cpu:.3} s"));
    judge("  memory beyond the input", status_mb("VmHWM:") - before, 40.0, "MB", "");
}

/// One channel of an hour at 1 kHz: white noise about 0 with a slow walk, in codes and in its own unit.
fn gate(judge: &mut impl FnMut(&str, f64, f64, &str, &str)) {
    let mut dice = Dice::new(9);
    let mut walk = 0.0;
    let counts: Vec<f64> = (0..3_600_000)
        .map(|_| {
            walk += 0.02 * dice.normal();
            (30.0 * dice.normal() + walk).round()
        })
        .collect();
    let units: Vec<f64> = counts.iter().map(|v| ((v + dice.normal()) * 1e4).round() / 1e6).collect();
    let blocks = one_stretch(counts.len());
    let layout = RecordLayout { blocks: &blocks, still: true, range_end: None };
    for (what, values) in [("codes", &counts), ("units", &units)] {
        let (wall, cpu) = best(15, || {
            assert_eq!(black_box(Screening::of(&["x"], &[values], &layout)).left_out().total(), 0);
        });
        let note = format!(", processor time {:.1} ms", 1e3 * cpu);
        judge(&format!("gate, a still channel of 3.6 million {what}"), 1e3 * wall, 40.0, "ms", &note);
    }
}

fn surfaces(judge: &mut impl FnMut(&str, f64, f64, &str, &str)) {
    let mut dice = Dice::new(8);
    let mut time = |what: &str, bound: f64, work: &mut dyn FnMut()| {
        let (wall, cpu) = best(15, work);
        judge(what, 1e3 * wall, bound, "ms", &format!(", processor time {:.1} ms", 1e3 * cpu));
    };
    let (x, y) = truth::ellipse_points(180_000, [3.0, -5.0, 100.0, 80.0, 25.0], 0.5, &mut dice);
    let mut spiked = x.clone();
    spiked.iter_mut().step_by(1000).for_each(|v| *v = 1e4 * dice.normal());
    time("ellipse, 180,000 points: algebraic", 5.0, &mut || _ = black_box(ellipse::fit_algebraic(&x, &y)));
    time("ellipse: whole robust fit, 0.1 % spikes", 25.0, &mut || {
        _ = black_box(ellipse::fit(&spiked, &y, None).unwrap());
    });
    let points: Vec<[f64; 3]> = truth::directions(180_000)
        .iter()
        .map(|u| [60.0 * u[0], 45.0 * u[1] + 5.0 * u[0], 50.0 * u[2]].map(|v| v + 0.5 * dice.normal()))
        .collect();
    let [mut x, y, z] = [0, 1, 2].map(|i| points.iter().map(|p| p[i]).collect::<Vec<f64>>());
    time("ellipsoid, 180,000 points: algebraic", 5.0, &mut || _ = black_box(ellipsoid::fit_algebraic(&x, &y, &z)));
    x.iter_mut().step_by(1000).for_each(|v| *v = 1e4 * dice.normal());
    time("ellipsoid: whole robust fit, 0.1 % spikes", 25.0, &mut || {
        _ = black_box(ellipsoid::fit(&x, &y, &z, None, None).unwrap());
    });
}

/// Least wall time of several runs, and least processor time, s.
fn best(times: usize, mut work: impl FnMut()) -> (f64, f64) {
    let processor = || {
        let t = clock_gettime(ClockId::CLOCK_PROCESS_CPUTIME_ID).unwrap();
        t.tv_sec() as f64 + 1e-9 * t.tv_nsec() as f64
    };
    let (mut wall, mut cpu) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..times {
        let (start, used) = (Instant::now(), processor());
        work();
        wall = wall.min(start.elapsed().as_secs_f64());
        cpu = cpu.min(processor() - used);
    }
    (wall, cpu)
}

/// A line of this process's memory status, MB (Linux).
fn status_mb(name: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|l| l.starts_with(name)).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap() / 1024.0
}
