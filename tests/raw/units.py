"""An export against the raw files themselves: counts, values in units, temperatures and times, by the packages of others.

usage: units.py RUN CSV_FOLDER PARQUET_FOLDER

Raw samples are read with `mcap`, tables with Python's own reader, and what Parquet says of its columns with `pyarrow`. A
value in a unit is the number nearest to the fraction of its count and the nominal scale of the interface document.
"""

import csv
import json
import sys
from fractions import Fraction
from pathlib import Path

import pyarrow.parquet
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

# Nominal counts of a unit, from docs/ICD.md.
SENSORS = {"gyro": ("dps", "deg/s", 20_000), "accel": ("g", "g", 160_000), "mag": ("gauss", "gauss", 1_250_000)}
# Of a compensated sample: column, unit in words, parts of the unit.
COMPENSATED = {"rate": ("rps", "rad/s", 10**8), "force": ("mps2", "m/s^2", 10**6), "field": ("gauss", "gauss", 10**7)}
TEMPERATURES = ("gyro_temperature", "accel_temperature")


def samples(path, topic):
    """Samples of a raw file in their order, each with its number in its capture."""
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, sample in reader.iter_decoded_messages(topics=[topic], log_time_order=False):
            yield message.sequence, sample


def nearest(count, scale):
    return float(Fraction(count, scale))


def check(path, topic, table, sensors, with_counts):
    rows = 0
    with open(table, newline="") as file:
        for row, (number, sample) in zip(csv.DictReader(file), samples(path, topic), strict=True):
            place = f"{table}, row {rows}"
            assert int(row["number"]) == number, place
            for sensor, (column, _, scale) in sensors.items():
                for axis in "xyz":
                    count = getattr(sample, f"{sensor}_{axis}")
                    if with_counts:
                        assert int(row[f"{sensor}_{axis}"]) == count, place
                    value = float(row[f"{sensor}_{axis}_{column}"])
                    assert value == nearest(count, scale), f"{place}: {sensor}_{axis}: {value} for {count}"
            for name in TEMPERATURES:
                assert float(row[f"{name}_degc"]) == nearest(getattr(sample, name), 100), f"{place}: {name}"
            if not with_counts:
                assert float(row["roll_rad"]) == nearest(sample.roll, 10**8), place
            rows += 1
    assert rows, f"{table} is empty"
    return rows


def check_metadata(path, sensors, with_counts):
    told = {key.decode(): value.decode() for key, value in pyarrow.parquet.read_schema(path).metadata.items()}
    units, scales = json.loads(told["units"]), json.loads(told["counts_per_unit"])
    names = set(pyarrow.parquet.read_schema(path).names)
    assert set(units) <= names and set(scales) <= names, f"{path}: {set(units) - names}"
    for sensor, (column, unit, scale) in sensors.items():
        for axis in "xyz":
            name = f"{sensor}_{axis}_{column}"
            assert (units[name], scales[name]) == (unit, scale), f"{path}: {name}"
            assert not with_counts or units[f"{sensor}_{axis}"] == "count", path
    for name in TEMPERATURES:
        assert (units[f"{name}_degc"], scales[f"{name}_degc"]) == ("degC", 100), path
    assert units["t_s"] == "s" and told["scale"], path


def main():
    run, texts, columns = (Path(word) for word in sys.argv[1:])
    checked = 0
    for path in sorted(run.glob("*/*.mcap")):
        name = f"{path.parent.name}-{path.stem}"
        for suffix, topic, sensors in (("", "/imu", SENSORS), ("-compensated", "/compensated", COMPENSATED)):
            table = texts / f"{name}{suffix}.csv"
            if not table.exists() or not any(samples(path, topic)):
                continue
            rows = check(path, topic, table, sensors, not suffix)
            check_metadata(columns / f"{name}{suffix}.parquet", sensors, not suffix)
            print(f"{table.name}: {rows} rows are those of {path.name}")
            checked += 1
    assert checked, f"{run} has no raw file that was exported"


main()
