#!/usr/bin/env python3
"""Processor time of `compute` in one program over that in another, on long records: medians of pairs run in turn.

    git worktree add ../before COMMIT
    cargo build --release -p gnc-station && (cd ../before && cargo build --release -p gnc-station)
    pip install numpy pandas
    python3 src/station/benches/pairs.py ../before/target/release/gnc-station target/release/gnc-station

A second of processor time is not the same on a machine that has other work, so that the programs of a pair run one right
after the other, each first in every second pair. Ends with 1 where a ratio is above its bound.
A program from before the data gate does not look for bad rows: its ratios on spoilt records tell nothing.
"""
import argparse, os, resource, statistics, subprocess, sys, tempfile
import numpy as np, pandas as pd

BOUND = 1.05
METHODS = ("stability", "allan", "psd")

words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
words.add_argument("old")
words.add_argument("new")
words.add_argument("--rows", type=int, default=3_600_000)
words.add_argument("--pairs", type=int, default=7)
words.add_argument("--seed", type=int, default=1)
args = words.parse_args()


def records(folder):
    """Eight channels of white noise with a random walk: in counts, in physical units with six decimals, and in counts of which
    one row in sixty holds failed reads (zeros) or spikes."""
    rng = np.random.default_rng(args.seed)
    channels = {}
    for k, name in enumerate("abcdefgh"):
        walk = np.cumsum(rng.normal(size=args.rows))
        channels[name] = 100 * (k - 3) + (20 + 5 * k) * rng.normal(size=args.rows) + 0.02 * walk
    physical = pd.DataFrame(channels)
    counts = physical.round().astype(int)
    # One in fifty is the most that these methods leave out. Every second row of these is zero, the others are spikes.
    rows = rng.choice(args.rows, args.rows // 60, replace=False)
    # Far from 0, so that a zero is no code of the noise.
    spoilt = counts + 1000
    spoilt.iloc[rows[::2]] = 0
    spoilt.iloc[rows[1::2]] += 20_000 * rng.choice([-1, 1], size=(len(rows[1::2]), 1))
    for name, table in (("counts", counts), ("units", physical * 0.01), ("spoilt", spoilt)):
        path = os.path.join(folder, f"{name}.csv")
        table.to_csv(path, index=False, float_format="%.6f")
        yield name, path


class Refused(Exception):
    """A program does not give a result."""


def processor_s(program, method, path):
    """User and system time of a run."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [program, "compute", method, path, "--rate", "1000", "--column", "c", "--json"]
    out = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if out.returncode:
        raise Refused(f"{' '.join(command)}: {out.stderr.strip()}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


above = False
with tempfile.TemporaryDirectory() as folder:
    print(f"{args.rows} rows of 8 columns, seed {args.seed}, medians of {args.pairs} pairs")
    for name, path in records(folder):
        for method in METHODS:
            try:
                # Only of spoilt records, and only the old program, may refuse.
                processor_s(args.old, method, path)
            except Refused as why:
                if name != "spoilt":
                    sys.exit(str(why))
                print(f"{name:<7} {method:<10} the old program refuses it: {why}", flush=True)
                continue
            old, new = [], []
            for pair in range(args.pairs):
                turns = [(args.old, old), (args.new, new)]
                for program, times in turns[:: -1 if pair % 2 else 1]:
                    try:
                        times.append(processor_s(program, method, path))
                    except Refused as why:
                        sys.exit(str(why))
            ratio = statistics.median(n / o for n, o in zip(new, old))
            seconds = f"old {statistics.median(old):.3f} s, new {statistics.median(new):.3f} s"
            verdict = "ok" if ratio <= BOUND else "ABOVE"
            print(f"{name:<7} {method:<10} {ratio:6.3f}  bound {BOUND}  {verdict:<6} {seconds}", flush=True)
            above |= ratio > BOUND
sys.exit(int(above))
