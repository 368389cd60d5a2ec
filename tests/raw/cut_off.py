"""Raw captures that a kill left without an end, before and after their runs were sealed.

usage: cut_off.py cut RUN FOLDER PLACES    copies an interrupted run, each copy with its capture cut off somewhere else,
                                           and keeps the captures as they were in FOLDER
       cut_off.py check RUN FOLDER         compares the copies, once they were sealed, with what was kept

The readers are those of the package `mcap`. `make_reader` goes by the summary at the end of a file; without one it refuses
the file. `check` prints a line for each copy, as `indexed.mjs` does: messages by topic.
"""

import hashlib
import json
import shutil
import struct
import sys
from collections import Counter
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, make_reader


def capture_of(run):
    [path] = run.glob("*/attempt-1.mcap")
    return path


def copies(run):
    """Named as runs of one second are."""
    return sorted(run.parent.glob(f"{run.name}-[0-9]*"))


def cut(run, kept, places):
    whole = capture_of(run).read_bytes()
    kept.mkdir()
    for number in range(places):
        copy = run.parent / f"{run.name}-{number + 2}"
        shutil.copytree(run, copy)
        before = whole[:len(whole) * number // (places - 1)]
        capture_of(copy).write_bytes(before)
        (kept / f"{copy.name}.mcap").write_bytes(before)
    begin(run, copies(run))
    print(f"{places} copies, cut off between byte 0 and byte {len(whole)}")


def begin(run, runs):
    """Lines that these runs began, behind those of the chain: a start closes no run that the chain did not begin."""
    records = run.parents[2]
    chain = run.parents[1] / "CHAIN"
    words = [line.split(" ") for line in chain.read_text().splitlines()]
    [(station, time)] = [line[5:7] for line in words if line[4] == "begin" and line[7].endswith(run.name)]
    number, link = int(words[-1][0]), words[-1][3]
    with chain.open("a") as lines:
        for one in runs:
            first = (one / "events.jsonl").read_bytes().splitlines(keepends=True)[0]
            digest = hashlib.sha256(first).hexdigest()
            tail = f"begin {station} {time} {one.relative_to(records)}"
            before, number = link, number + 1
            link = hashlib.sha256(f"{number} {before} {digest} {tail}".encode()).hexdigest()
            lines.write(f"{number} {before} {digest} {link} {tail}\n")
    (records / "COUNTER").write_text(f"{number} {link}\n")


def messages(reader):
    """Everything of each message; as many as can be read."""
    found = []
    try:
        for _, channel, message in reader.iter_messages(log_time_order=False):
            found.append((channel.topic, message.log_time, message.sequence, message.data))
    except (McapError, struct.error):
        # The second is what it says of half a number.
        pass
    return found


def check(run, kept):
    refused = 0
    for copy in copies(run):
        before = (kept / f"{copy.name}.mcap").read_bytes()
        path = capture_of(copy)
        [told] = json.loads((copy / "cut-off.json").read_text())["files"]
        assert told["original_bytes"] == len(before), told
        assert told["original_sha256"] == hashlib.sha256(before).hexdigest(), told
        stays = path.read_bytes()[:told["kept_bytes"]]
        torn = (copy / told["torn"]).read_bytes() if told["torn"] else b""
        assert stays + torn == before, f"{copy}: bytes were lost"
        with open(kept / f"{copy.name}.mcap", "rb") as file:
            in_a_row = messages(NonSeekingReader(file)) if len(before) >= 8 else []
            try:
                make_reader(file).get_summary()
            except McapError:
                refused += 1
        with open(path, "rb") as file:
            reader = make_reader(file, validate_crcs=True)
            summary = reader.get_summary()
            indexed = messages(reader)
        assert indexed == in_a_row, f"{copy}: {len(indexed)} messages by the summary, {len(in_a_row)} in a row"
        assert summary.statistics.message_count == len(indexed)
        topics = Counter(topic for topic, *_ in indexed)
        print(json.dumps({"file": str(path), **dict(sorted(topics.items()))}, separators=(",", ":")))
    # Otherwise nothing was tried.
    assert refused > 0, "every file had an end before"


match sys.argv[1:]:
    case ["cut", run, kept, places]:
        cut(Path(run), Path(kept), int(places))
    case ["check", run, kept]:
        check(Path(run), Path(kept))
    case _:
        sys.exit(__doc__)
