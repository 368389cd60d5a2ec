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
    return sorted(run.parent.glob(f"{run.name}-cut-*"))


def cut(run, kept, places):
    whole = capture_of(run).read_bytes()
    kept.mkdir()
    for number in range(places):
        copy = run.parent / f"{run.name}-cut-{number:03}"
        shutil.copytree(run, copy)
        before = whole[:len(whole) * number // (places - 1)]
        capture_of(copy).write_bytes(before)
        (kept / f"{copy.name}.mcap").write_bytes(before)
    print(f"{places} copies, cut off between byte 0 and byte {len(whole)}")


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
