"""Opens an export in both forms with pandas, polars and duckdb, and does what people do: sums, sums of squares, norms.

usage: data_frames.py CSV_FOLDER PARQUET_FOLDER

Each is compared with the same in whole numbers of any size and fractions, from the text by Python's own reader. The still
positions of `six-position` stand in gravity, so that their mean norm is 1 g within the module's own errors.
"""

import csv
import math
import sys
from fractions import Fraction
from pathlib import Path

import duckdb
import pandas
import polars

# Nominal counts of each unit, from the interface document.
SCALES = {"gyro_{}": ("gyro_{}_dps", 20_000), "accel_{}": ("accel_{}_g", 160_000), "mag_{}": ("mag_{}_gauss", 1_250_000)}
COLUMNS = [(count.format(axis), value.format(axis), scale)
           for count, (value, scale) in SCALES.items() for axis in "xyz"]
# Counts and values of three axes, of which people take the norm.
TRIADS = [("gyro_{}", "gyro_{}_dps"), ("accel_{}", "accel_{}_g"), ("mag_{}", "mag_{}_gauss")]


def exact(path):
    """Columns of whole numbers and of values, by name."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    counts = {count: [int(row[count]) for row in rows] for count, _, _ in COLUMNS}
    values = {value: [float(row[value]) for row in rows] for _, value, _ in COLUMNS}
    return counts, values


def by_pandas(path):
    frame = pandas.read_csv(path) if path.suffix == ".csv" else pandas.read_parquet(path)
    norm = lambda of: float(((frame[of.format("x")] ** 2 + frame[of.format("y")] ** 2
                              + frame[of.format("z")] ** 2) ** 0.5).mean())
    return (lambda of: int(frame[of].sum()), lambda of: int((frame[of] ** 2).sum()), norm, lambda of: frame[of].tolist())


def by_polars(path):
    frame = polars.read_csv(path) if path.suffix == ".csv" else polars.read_parquet(path)
    column = polars.col
    one = lambda expression: frame.select(expression).item()
    norm = lambda of: one((column(of.format("x")) ** 2 + column(of.format("y")) ** 2
                           + column(of.format("z")) ** 2).sqrt().mean())
    return (lambda of: one(column(of).sum()), lambda of: one((column(of) ** 2).sum()), norm,
            lambda of: frame[of].to_list())


def by_duckdb(path):
    one = lambda text: duckdb.sql(f"select {text} from '{path}'").fetchall()[0][0]
    norm = lambda of: one("avg(sqrt({0}*{0} + {1}*{1} + {2}*{2}))".format(*(of.format(axis) for axis in "xyz")))
    return (lambda of: one(f"sum({of})"), lambda of: one(f"sum({of} * {of})"), norm,
            lambda of: [row[0] for row in duckdb.sql(f"select {of} from '{path}'").fetchall()])


def check(path, counts, values, program, sum_of, squares_of, norm_of, values_of):
    place = f"{path} by {program}"
    for count, value, _ in COLUMNS:
        assert sum_of(count) == sum(counts[count]), f"{place}: sum of {count}: {sum_of(count)}"
        squares = sum(one * one for one in counts[count])
        assert squares_of(count) == squares, f"{place}: squares of {count}: {squares_of(count)} for {squares}"
        assert values_of(value) == values[value], f"{place}: {value}"
    for count, value in TRIADS:
        for columns, of in ((counts, count), (values, value)):
            triads = zip(*(columns[of.format(axis)] for axis in "xyz"))
            expected = math.fsum(math.hypot(*triad) for triad in triads) / len(columns[of.format("x")])
            found = norm_of(of)
            assert math.isclose(found, expected, rel_tol=1e-9), f"{place}: norm of {of}: {found} for {expected}"
    return norm_of("accel_{}_g")


def main():
    texts, columns = Path(sys.argv[1]), Path(sys.argv[2])
    names = sorted(path.stem for path in texts.glob("*.csv"))
    assert names, f"{texts} holds no table"
    for name in names:
        counts, values = exact(texts / f"{name}.csv")
        for count, value, scale in COLUMNS:
            for whole, real in zip(counts[count], values[value]):
                assert real == float(Fraction(whole, scale)), f"{name}: {value} {real} beside {count} {whole}"
        for path in (texts / f"{name}.csv", columns / f"{name}.parquet"):
            for program, opened in (("pandas", by_pandas), ("polars", by_polars), ("duckdb", by_duckdb)):
                norm = check(path, counts, values, program, *opened(path))
                assert "six-position" not in name or abs(norm - 1) < 0.01, f"{path} by {program}: {norm} g at rest"
                print(f"{path.name} by {program}: mean norm of the accelerometers {norm:.6f} g")


main()
