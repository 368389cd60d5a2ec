"""Compares the two forms of an export: every CSV file of one folder with the Parquet file of the same name in the other.

usage: same_tables.py CSV_FOLDER PARQUET_FOLDER

CSV is read by Python's own reader, Parquet by the package `pyarrow`.
"""

import csv
import sys
from pathlib import Path

import pyarrow.parquet


def main():
    texts, columns = Path(sys.argv[1]), Path(sys.argv[2])
    names = sorted(path.stem for path in texts.glob("*.csv"))
    assert names and names == sorted(path.stem for path in columns.glob("*.parquet")), names
    for name in names:
        with open(texts / f"{name}.csv", newline="") as file:
            header, *rows = csv.reader(file)
        table = pyarrow.parquet.read_table(columns / f"{name}.parquet")
        assert table.column_names == header, f"{name}: {table.column_names} and {header}"
        assert table.num_rows == len(rows), f"{name}: {table.num_rows} and {len(rows)} rows"
        for index, column in enumerate(header):
            values = table.column(column).to_pylist()
            kind = type(values[0]) if values else str
            for number, (value, row) in enumerate(zip(values, rows)):
                assert value == kind(row[index]), f"{name}, row {number}, {column}: {value!r} and {row[index]}"
        print(f"{name}: {len(rows)} rows of {len(header)} columns alike")


main()
