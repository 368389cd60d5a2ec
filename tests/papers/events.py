"""The lines of --events and the file of --junit against what others read: PyPI jsonschema and junitparser.

    events.py STATION DOCS     STATION: the program; DOCS: the folder with the schemas

Runs end in every way: passed, failed, errored, with a board that restarts or breaks a rule, an acceptance, a stop in
order and at once, a loop, a run that is taken up again. Every line is valid, every kind of event is seen, and a line with a
field less, a field more or another kind is refused. The report for CI servers counts what the records say.
"""

import copy
import json
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import jsonschema
import junitparser

ROOT = Path(__file__).resolve().parents[2]
PLANS = ROOT / "test-plans"
BREACH = "[board]\nhello_after_ms = 3000.0\n"
# Other limits for the part that the simulated module says.
PARTS = "\n[part.GNC-POP-26.limits]\nidentity.supply_current = \"0.49 A +- 6 %\"\n"
# No run here takes so long even on a busy machine.
LONGEST_S = 600


class Station:
    def __init__(self, station, place):
        self.station, self.place = station, place
        self.kinds, self.lines = set(), 0

    def words(self, plan, sim, *more):
        return [self.station, "--auto", plan, f"--sim={sim}", "--serial-number", "T-1", "--events", "--junit", "report.xml",
                *more]

    def run(self, code, plan, sim, *more):
        """The events of a run at full speed."""
        words = self.words(plan, sim, "--sim-speed", "max", *more)
        done = subprocess.run(words, capture_output=True, text=True, cwd=self.place, timeout=LONGEST_S)
        assert done.returncode == code, f"{more}: {done.returncode}\n{done.stderr}"
        return done.stdout.splitlines()

    def stopped(self, signals):
        """The events of a run at true speed that is stopped in its memory test."""
        words = self.words(PLANS / "functional.toml", "good")
        child = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=self.place)
        lines = []
        for line in child.stdout:
            lines.append(line)
            if '"kind":"item_started","item":"sdram"' in line:
                for number in signals:
                    child.send_signal(number)
        assert child.wait(LONGEST_S) == 4
        return lines

    def record(self):
        """The record of the newest run."""
        newest = max((self.place / "records").glob("*/*/*/events.jsonl"), key=lambda path: path.stat().st_mtime_ns)
        return json.loads((newest.parent / "run.json").read_text())


def word(record):
    """The word for a run: good items of a selection have their own."""
    of_selection = record.get("selection_outcome")
    return "partial" if of_selection in ("passed", "marginal") else of_selection or record["outcome"]


def check_report(path, records):
    """The report says of each item what its record says."""
    xml = junitparser.JUnitXml.fromfile(str(path))
    suites = list(xml)
    assert len(suites) == len(records), (len(suites), len(records))
    ends = {"passed": (), "marginal": (), "failed": (junitparser.Failure,), "errored": (junitparser.Error,),
            "aborted": (junitparser.Error,), "skipped": (junitparser.Skipped,), "not_run": (junitparser.Skipped,)}
    cases = 0
    for suite, record in zip(suites, records):
        properties = {one.name: one.value for one in suite.properties()}
        assert properties["serial_number"] == record["serial_number"] and properties["outcome"] == word(record)
        by_name = {case.name: case for case in suite}
        for item in record["items"]:
            case = by_name.pop(item["name"])
            assert tuple(type(one) for one in case.result) == ends[item["outcome"]], (item["name"], case.result)
            assert case.classname == record["plan"]["name"]
            assert abs(case.time - (item["elapsed_s"] or 0)) < 1e-6
            for measured in item["attempts"][-1]["measurements"] if item["attempts"] else []:
                assert measured["name"] in (case.system_out or ""), measured["name"]
            cases += 1
        assert set(by_name) <= {"(run)"}, by_name
        # What a reader counts is what the head says.
        said = (suite.tests, suite.failures, suite.errors, suite.skipped)
        suite.update_statistics()
        assert said == (suite.tests, suite.failures, suite.errors, suite.skipped), said
    return cases


def main():
    station, docs = Path(sys.argv[1]).resolve(), Path(sys.argv[2])
    schema = json.loads((docs / "events.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema, format_checker=jsonschema.FormatChecker())
    seen, count, cases = {}, 0, 0
    with tempfile.TemporaryDirectory() as place:
        place = Path(place)
        at = Station(station, place)
        (place / "breach.toml").write_text(BREACH)
        functional = PLANS / "functional.toml"

        def take(lines, records=True):
            nonlocal count, cases
            for line in lines:
                event = json.loads(line)
                errors = [error.message for error in validator.iter_errors(event)]
                assert not errors, f"{line}\n{errors}"
                seen.setdefault(event["kind"], event)
                count += 1
            if records:
                cases += check_report(place / "report.xml", [at.record()])

        take(at.run(0, functional, "good"))
        take(at.run(1, functional, "gyro-stuck"))
        take(at.run(1, functional, "sdram-data-line-stuck"))
        take(at.run(1, functional, "reboots-in-sdram"))
        take(at.run(3, functional, "silent-board", "--only", "identity"))
        take(at.run(0, functional, "breach.toml"))
        take(at.run(0, PLANS / "acceptance.toml", "good"))
        take(at.run(5, functional, "good", "--sim-link", "can", "--only", "sci,io"))
        take(at.run(3, functional, "wrong-serial-number"))
        parts = place / "parts.toml"
        parts.write_text((PLANS / "functional.toml").read_text() + PARTS)
        take(at.run(5, parts, "good", "--only", "identity"))
        take(at.run(5, functional, "good", "--only", "io", "--loops", "2"), records=False)
        assert len(list(junitparser.JUnitXml.fromfile(str(place / "report.xml")))) == 2
        take(at.stopped([signal.SIGINT]))
        take(at.stopped([signal.SIGINT, signal.SIGINT]))
    kinds = {name.removeprefix("event_") for name in schema["$defs"] if name.startswith("event_")}
    assert set(seen) == kinds, f"never seen: {sorted(kinds - set(seen))}"
    refused = 0
    for kind, event in seen.items():
        required = schema["$defs"][f"event_{kind}"]["required"]
        for name in event:
            spoilt = copy.deepcopy(event)
            del spoilt[name]
            assert validator.is_valid(spoilt) != (name in required), (kind, name)
            refused += name in required
        for name, value in (("more", 1), ("kind", "other"), ("seq", -1), ("at", 7)):
            assert not validator.is_valid({**event, name: value}), (kind, name)
            refused += 1
    print(f"--events: {count} lines of {len(seen)} kinds are valid; {refused} spoilt ones refused")
    print(f"--junit: {cases} items are read by junitparser as the records have them")


main()
