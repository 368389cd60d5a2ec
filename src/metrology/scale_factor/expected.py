#!/usr/bin/env python3
"""The figures of tests.rs by numpy and scipy: lines by polyfit, the test of the line by comparing two whole models."""
import numpy as np
from scipy import stats

RATES = np.array([-300.0, -150.0, -50.0, -10.0, 0.0, 10.0, 50.0, 150.0, 300.0])
OUTPUTS = np.array([
    [-59876.1, -29914.7, -9951.2, -1967.0, 29.5, 2026.9, 10012.0, 29981.2, 59938.4],
    [-59868.6, -29909.0, -9947.8, -1962.4, 33.9, 2031.0, 10015.2, 29981.5, 59935.4],
    [-59886.2, -29921.2, -9955.8, -1970.9, 26.3, 2022.8, 10008.4, 29979.6, 59940.6],
])


def line(rates, outputs):
    """Slope, offset, their standard uncertainties, residuals."""
    (slope, offset), covariance = np.polyfit(rates, outputs, 1, cov=True) if len(rates) > 2 else (
        np.polyfit(rates, outputs, 1), np.full((2, 2), np.nan))
    return slope, offset, *np.sqrt(np.diag(covariance)), outputs - slope * rates - offset


def main():
    """Prints what tests.rs expects."""
    n = len(RATES)
    slope, offset, slope_sd, offset_sd, residuals = line(RATES, OUTPUTS[0])
    print("one cycle:", *(f"{v!r}" for v in map(float, (slope, offset, slope_sd, offset_sd))))
    print("  full scale", float(np.max(np.abs(residuals)) / abs(slope * 300)), RATES[np.argmax(np.abs(residuals))])
    of_output = [abs(r / (slope * w)) if w else 0 for r, w in zip(residuals, RATES)]
    print("  output", float(max(of_output)), RATES[np.argmax(of_output)])
    plus, minus = (line(RATES[RATES * s > 0], OUTPUTS[0][RATES * s > 0]) for s in (1, -1))
    mean = (plus[0] + minus[0]) / 2
    u = np.hypot(plus[2], minus[2])
    dof = u**4 / (plus[2]**4 / 2 + minus[2]**4 / 2)
    print("  asymmetry", float(abs(plus[0] - minus[0]) / mean), float(u / mean), float(dof))

    lines = [line(RATES, x) for x in OUTPUTS]
    slopes = np.array([l[0] for l in lines])
    print("cycles:", float(slopes.mean()), float(slopes.std(ddof=1) / np.sqrt(3)), "offset",
          float(np.mean([l[1] for l in lines])))
    print("  expanded", float(stats.t.ppf(0.975, 2) * slopes.std(ddof=1) / np.sqrt(3)))
    print("  repeatability", float(slopes.std(ddof=1)), float(slopes.std(ddof=1) / slopes.mean()))
    # A line for each cycle, against that and a free value for each rate, by whole least squares.
    rows = [(c, j) for c in range(3) for j in range(n)]
    x = np.array([OUTPUTS[c, j] for c, j in rows])
    lines_only = np.array([[float(c == k) * v for k in range(3) for v in (1.0, RATES[j] / 300)] for c, j in rows])
    free = np.hstack([lines_only, np.array([[float(j == k) for k in range(n)] for _, j in rows])])

    def left(design):
        solution, _, rank, _ = np.linalg.lstsq(design, x, rcond=1e-10)
        return np.sum((x - design @ solution)**2), rank
    (with_lines, rank_lines), (with_free, rank_free) = left(lines_only), left(free)
    dof, pure_dof = int(rank_free - rank_lines), len(x) - int(rank_free)
    f = (with_lines - with_free) / dof / (with_free / pure_dof)
    print("  lack of fit", dof, pure_dof, float(f), float(stats.f.sf(f, dof, pure_dof)), float(np.sqrt(with_free / pure_dof)))


main()
