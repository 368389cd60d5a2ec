//! Time and memory of the dear methods, with their bounds: `cargo bench -p gnc-metrology --bench speed`; ends with 1
//! when a bound is broken. Each figure is the best of five, since other programs share the machine.

#![allow(clippy::print_stdout, clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

#[path = "../tests/truth/mod.rs"]
mod truth;

use std::hint::black_box;
use std::time::Instant;

use gnc_metrology::allan::{Input, Kind, Taus, analyse};
use gnc_metrology::{ellipse, ellipsoid};
use truth::Dice;

fn main() {
    let mut broken = 0;
    let mut judge = |what: &str, value: f64, bound: f64, unit: &str| {
        let word = if value <= bound { "ok" } else { "BROKEN" };
        broken += usize::from(value > bound);
        println!("{what:<60} {value:>9.4} {unit:<3} bound {bound} {unit}  {word}");
    };

    let mut dice = Dice::new(7);
    let n = 3_600_000;
    let axes: Vec<Vec<f64>> = (0..6).map(|_| (0..n).map(|_| dice.normal()).collect()).collect();
    let before = status_mb("VmRSS:");
    let seconds = best(7, || {
        for axis in &axes {
            black_box(analyse(axis, Input::Rate, 1000.0, Kind::Oadev, &Taus::Octave, 2).unwrap());
        }
    });
    judge("oadev, octave, 6 axes x 3.6 million, two threads", seconds, 0.25, "s");
    judge("  memory beyond the input", status_mb("VmHWM:") - before, 40.0, "MB");
    drop(axes);

    let (x, y) = truth::ellipse_points(180_000, [3.0, -5.0, 100.0, 80.0, 25.0], 0.5, &mut dice);
    let mut spiked = x.clone();
    spiked.iter_mut().step_by(1000).for_each(|v| *v = 1e4 * dice.normal());
    judge(
        "ellipse, 180,000 points: algebraic",
        1e3 * best(5, || _ = black_box(ellipse::fit_algebraic(&x, &y))),
        5.0,
        "ms",
    );
    judge(
        "ellipse: whole robust fit, 0.1 % spikes",
        1e3 * best(5, || _ = black_box(ellipse::fit(&spiked, &y, None).unwrap())),
        25.0,
        "ms",
    );

    let points: Vec<[f64; 3]> = truth::directions(180_000)
        .iter()
        .map(|u| [60.0 * u[0], 45.0 * u[1] + 5.0 * u[0], 50.0 * u[2]].map(|v| v + 0.5 * dice.normal()))
        .collect();
    let [mut x, y, z] = [0, 1, 2].map(|i| points.iter().map(|p| p[i]).collect::<Vec<f64>>());
    judge(
        "ellipsoid, 180,000 points: algebraic",
        1e3 * best(5, || _ = black_box(ellipsoid::fit_algebraic(&x, &y, &z))),
        5.0,
        "ms",
    );
    x.iter_mut().step_by(1000).for_each(|v| *v = 1e4 * dice.normal());
    judge(
        "ellipsoid: whole robust fit, 0.1 % spikes",
        1e3 * best(5, || _ = black_box(ellipsoid::fit(&x, &y, &z, None, None).unwrap())),
        25.0,
        "ms",
    );
    if broken > 0 {
        std::process::exit(1);
    }
}

fn best(times: usize, mut work: impl FnMut()) -> f64 {
    (0..times)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

/// A line of this process's memory status, MB (Linux).
fn status_mb(name: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|l| l.starts_with(name)).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap() / 1024.0
}
