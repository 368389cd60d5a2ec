#!/usr/bin/env python3
"""Reads the frozen conversations of protocol version 1 and holds them against the rules of docs/ICD.md.

Written from docs/ICD.md alone and without the Rust code. It takes every frame apart with a byte stuffing, a checksum and an
ISO-TP of its own, and compares it with its words. Then it follows the conversation: who may say what now, by when, and
whether anything that must be said is missing. Python's standard library is all it needs.

    python3 tests/vectors/check_conversations.py [FILE]
"""

import pathlib
import struct
import sys

FILE = pathlib.Path(__file__).with_name("v1-conversations.txt")

HELLO, REQUEST, ACCEPT, PROGRESS, RESULT, STREAM, EVENT, NAK = range(8)
KINDS = ["HELLO", "REQUEST", "ACCEPT", "PROGRESS", "RESULT", "STREAM", "EVENT", "NAK"]
RESENT, REPLAYED = 1, 2

# Section 11: id, name, whether the module must be under power, layout of the request and of the result. A trailing "*" is a
# list of what stands before it, with its count in front. "s" is a text.
MAKE_SAFE, ABORT, POWER, START, STOP = 0x0001, 0x0002, 0x0003, 0x0020, 0x0021
CALLS = {
    MAKE_SAFE: ("MakeSafe", False, "", ""),
    ABORT: ("Abort", False, "H", "B"),
    POWER: ("ModulePower", False, "B", "II"),
    0x0010: ("Identity", True, "", "ssssB"),
    0x0014: ("TimerMeasure", True, "BIH", "HI*"),
    0x0015: ("RamTest", True, "BB", "IIIII"),
    0x0017: ("FlashErase", True, "BH", "I"),
    0x001B: ("AdRead", True, "BH", "Biii*"),
    START: ("StreamStart", True, "BHIB", "BBH"),
    STOP: ("StreamStop", False, "B", "II"),
}
BEAT, KEEP_ALIVE, WATCHDOG = 1, 2, 3

# Milliseconds of sections 6, 7 and 9.
ANSWER_MS = 50
PROGRESS_EVERY_MS = 400
PROGRESS_MS = 500
WATCHDOG_MS = 1750
SAFE_MS = 2000
BEAT_MS = 1000
# A heartbeat may be this late in a window of the file. The document names no tolerance.
BEAT_LATE_MS = 50


def crc32c(data):
    register = 0xFFFFFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ 0x82F63B78 * (register & 1)
    return ~register & 0xFFFFFFFF


def unstuff(wire):
    assert wire[0] == wire[-1] == 0 and 0 not in wire[1:-1], "delimiters"
    out, rest = b"", wire[1:-1]
    while rest:
        code = rest[0]
        assert len(rest) >= code, "broken stuffing"
        out += rest[1:code]
        rest = rest[code:]
        if code < 0xFF and rest:
            out += b"\0"
    return out


class Frame:
    def __init__(self, content):
        assert 12 <= len(content) <= 524, f"{len(content)} bytes"
        assert crc32c(content[:-4]) == int.from_bytes(content[-4:], "little"), "checksum"
        first, self.flags, self.request, self.message, self.sequence = struct.unpack("<BBHHH", content[:8])
        self.version, self.kind = first >> 4, first & 15
        assert self.kind < 8 and self.version == (0 if self.kind == HELLO else 1), "kind and version"
        self.payload = content[8:-4]


def take(layout, data):
    """The fields of a payload, which must end with its last one."""
    many = layout.endswith("*")
    head, group = (layout[:1], layout[1:-1]) if many and layout[0] == "H" else ("", layout[:-1])
    fields, at = [], 0

    def one(letter):
        nonlocal at
        if letter == "s":
            value = data[at + 1 : at + 1 + data[at]].decode()
            at += 1 + data[at]
        else:
            (value,) = struct.unpack_from("<" + letter, data, at)
            at += struct.calcsize("<" + letter)
        return value

    fields += [one(letter) for letter in (head if many else layout)]
    if many:
        for _ in range(one("H")):
            fields += [one(letter) for letter in group]
    assert at == len(data), f"{len(data) - at} bytes behind the last field"
    return fields


def words(frame, from_host):
    """What a frame says, in the words of the file."""
    load, name = frame.payload, f"{frame.request:04x} {CALLS[frame.message][0]}" if frame.message in CALLS else "?"
    kind = KINDS[frame.kind]
    assert frame.flags == 0 or (kind, frame.flags) in (("REQUEST", RESENT), ("RESULT", REPLAYED)), "flags"
    if kind == "HELLO" and from_host:
        magic, lowest, highest, nonce = struct.unpack("<4sBBI", load)
        assert magic == b"GNCT"
        return f"HELLO {frame.request:04x}, versions {lowest} to {highest}, nonce {nonce:08x}"
    if kind == "HELLO":
        magic, chosen, lowest, highest, nonce, boot, bits, serial, firmware = take("IBBBIIIss", load)
        assert magic == int.from_bytes(b"GNCT", "little")
        return (
            f"HELLO {frame.request:04x}, version {chosen} of {lowest} to {highest}, nonce {nonce:08x}, boot id {boot:08x},"
            f" capabilities {bits:x}, board {serial}, firmware {firmware}"
        )
    if kind == "REQUEST":
        fields = take(CALLS[frame.message][2], load)
        return " ".join([kind, name, *map(str, fields), *(["(resent)"] if frame.flags else [])])
    if kind == "ACCEPT":
        return f"ACCEPT {name}, {take('I', load)[0]} ms expected"
    if kind == "PROGRESS":
        done, elapsed = take("HI", load)
        return f"PROGRESS {name}, {done} of 1000, {elapsed} ms"
    if kind == "RESULT":
        status, elapsed = take("HI", load[:6])
        fields = take(CALLS[frame.message][3] if status == 0 else "s", load[6:])
        said = " ".join([f"RESULT {name}, status {status}, {elapsed} us:", *map(str, fields)]).strip()
        return said + (" (replayed)" if frame.flags else "")
    if kind == "NAK":
        code, text = take("Hs", load)
        return f"NAK {name}, {code}: {text}"
    if kind == "STREAM":
        stream, form, count, first, time_us, dropped = struct.unpack("<BBHIQI", load[:20])
        assert (stream, form, len(load) - 20) == (1, 1, 40 * count) and frame.message == stream and frame.request == 0
        return f"STREAM {stream}, {count} samples from {first} at {time_us} us, {dropped} dropped"
    assert frame.request == 0 and frame.message in ((KEEP_ALIVE,) if from_host else (BEAT, WATCHDOG)), "event"
    if frame.message == BEAT:
        boot, time_us, state = struct.unpack("<IQB", load)
        return f"EVENT heartbeat, boot id {boot:08x}, {time_us} us, state {state}"
    assert not load
    return "EVENT keep-alive" if frame.message == KEEP_ALIVE else "EVENT watchdog"


class Line:
    def __init__(self, text):
        self.text = text
        fields, _, rest = text.partition("#")
        when, self.who, *self.what = fields.split()
        self.words = rest.partition("|")[0].strip()
        low, _, high = when.partition("..")
        self.low, self.high = int(low), int(high or low)
        assert self.low <= self.high and self.who in ("host", "board", "bench") and (high == "") == (self.who != "board")


def read(path):
    """Name, link and lines of each conversation."""
    found = []
    for block in path.read_text().split("\nconversation: ")[1:]:
        head, *lines = block.splitlines()
        name, link = head.split()
        assert lines[0].startswith("  why: ") and link in ("rs-422", "can"), name
        found.append((name, link, [Line(line) for line in lines[1:] if line.strip()]))
    assert len({name for name, _, _ in found}) == len(found), "a name stands there twice"
    return found


class Bus:
    """Puts the frames of a CAN bus together: messages, events and samples."""

    ROUTES = {"020": "host", "100": "host", "021": "board", "101": "board"}
    BACK = {"020": "021", "021": "020", "100": "101", "101": "100"}

    def __init__(self):
        self.parts = {}  # id: [line of the first frame, length, bytes, parts, whether flow control came]
        self.beat = None
        self.mark = None
        self.sample = []

    def take(self, line):
        """What the line completes, if anything: (line with the words, its kind, its value)."""
        ident, data = line.what[0], b"" if line.what[1] == "-" else bytes.fromhex(line.what[1])
        assert len(data) <= 8
        if ident in self.ROUTES:
            assert self.ROUTES[ident] == line.who, "the id is the other end's"
            return self.iso_tp(line, ident, data)
        assert line.who == ("host" if ident == "010" else "board"), "the id is the other end's"
        if ident == "010":
            assert (data, line.words) == (b"", "keep-alive")
            return line, "keep-alive", None
        if ident == "011" and data[0] == 2:
            return line, "watchdog", None
        if ident == "011" and data[0] == 0:
            assert len(data) == 8 and data[7] == 0
            self.beat = data[1], *struct.unpack("<IB", data[2:7])
            assert line.words == f"heartbeat {data[1]}, boot id {self.beat[1]:08x}, state {self.beat[2]}"
            return None
        if ident == "011":
            assert data[0] == 1 and data[1] == self.beat[0], "the two frames of a heartbeat have one number"
            time_us = int.from_bytes(data[2:], "little")
            assert line.words == f"heartbeat {data[1]}, {time_us} us"
            return line, "heartbeat", (self.beat[1], time_us, self.beat[2])
        return self.stream(line, ident, data)

    def iso_tp(self, line, ident, data):
        form = data[0] >> 4
        if form == 3:
            assert data == b"\x30\0\0" and line.words == "flow control"
            self.parts[self.BACK[ident]][4] = True
            return None
        if form == 1:
            assert ident not in self.parts, "one transfer at a time"
            self.parts[ident] = [line, (data[0] & 15) << 8 | data[1], data[2:], 0, False]
            return None
        assert form == 2 and ident in self.parts, "a frame that nobody waits for"
        first, length, so_far, parts, allowed = self.parts.pop(ident)
        parts += 1
        assert allowed and data[0] & 15 == parts % 16, "out of its turn"
        assert line.words == f"part {parts}"
        so_far += data[1:]
        assert len(so_far) == length or len(data) == 8 and len(so_far) < length
        if len(so_far) < length:
            self.parts[ident] = [first, length, so_far, parts, allowed]
            return None
        frame = Frame(so_far)
        urgent = frame.kind == HELLO or frame.message in (MAKE_SAFE, ABORT)
        assert ident in (("020", "021") if urgent else ("100", "101")), "the channel of the message"
        assert first.words == words(frame, line.who == "host"), words(frame, line.who == "host")
        first.high = line.high
        return (line if line.who == "host" else first), "frame", (ident, frame)

    def stream(self, line, ident, data):
        if ident == "203":
            self.mark = struct.unpack("<Ihh", data)[0]
            assert line.words == f"mark: sample {self.mark}"
        elif ident == "204":
            assert line.words == f"clock: {int.from_bytes(data[:6], 'little')} us, {int.from_bytes(data[6:], 'little')} dropped"
        else:
            value, place = int.from_bytes(data, "little"), int(ident, 16) - 0x200
            assert self.mark is not None and 0 <= place <= 2 and len(self.sample) == place, "out of order"
            number = self.mark + (value - self.mark) % 1024
            axes = [(value >> at & 0x3FFFF) - (0x40000 if value >> at & 0x20000 else 0) for at in (10, 28, 46)]
            assert line.words == f"sample {number}, {('gyro', 'accel', 'mag')[place]} {' '.join(map(str, axes))}"
            self.sample.append(number)
            if place == 2:
                assert len(set(self.sample)) == 1
                self.sample = []
                return line, "samples", (number, 1)
        return None


class Conversation:
    """Follows one conversation by the rules of sections 6 to 10."""

    def __init__(self, can):
        self.can = can
        self.host_next = {}
        self.start(0, None)
        self.nonces = set()

    def start(self, now, boot):
        self.began, self.boot, self.next = now, boot, {}
        self.beats, self.last_beat = 0, now
        self.session = None
        self.heard = now
        self.awaited = []  # what the board must answer now: (by when, who asks)
        self.forget()

    def forget(self):
        """The safe state, and nothing of a session."""
        self.running, self.kept, self.ended_by = {}, {}, []
        self.powered, self.switching = False, {}
        self.streams, self.account = {}, None

    def number(self, who, ident, frame):
        known = self.host_next if who == "host" else self.next
        expected = known.get(ident, 0 if who == "board" else frame.sequence)
        assert frame.sequence == expected, f"sequence number {frame.sequence}, not {expected}"
        known[ident] = (expected + 1) % 65536

    def silence(self, low):
        """Nothing may be late when a line begins."""
        for by, what in self.awaited:
            assert low <= by, f"{what} is not answered within {ANSWER_MS} ms"
        for key, run in self.running.items():
            assert low <= run["heard"] + PROGRESS_MS, f"{key[0]:04x} has no PROGRESS for {PROGRESS_MS} ms"
        if self.session is not None:
            assert low <= self.heard + SAFE_MS, "the watchdog does not end the session"
        assert low <= self.last_beat + BEAT_MS + BEAT_LATE_MS, "a heartbeat is missing"

    def host(self, now, frame):
        self.silence(now)
        if frame.kind == HELLO:
            _, lowest, highest, nonce = struct.unpack("<4sBBI", frame.payload)
            common = lowest <= 1 <= highest
            self.heard = now
            if not common or self.session != nonce:
                self.awaited, self.session = [], None
                self.forget()
            if common:
                self.session = nonce
            self.awaited.append((now + ANSWER_MS, ("hello", frame.request, nonce, 1 if common else 0)))
        elif frame.kind == REQUEST:
            self.heard = now
            self.awaited.append((now + ANSWER_MS, self.expected(frame)))
        else:
            assert frame.kind == EVENT, "only a board sends this"
            self.heard = now

    def expected(self, frame):
        """The first answer to a request, by section 7 and the order of section 12."""
        key = frame.request, frame.message
        if self.session is None:
            return "nak", key, 1
        if key in self.running:
            assert frame.flags == RESENT
            return "accept", key, self.running[key]["accept"]
        if any(run[0] == frame.request for run in self.running) and frame.message != MAKE_SAFE:
            return "nak", key, 4
        if key in self.kept:
            assert frame.flags == RESENT
            return "replay", key, self.kept[key]
        assert frame.message in CALLS
        if frame.message in (MAKE_SAFE, ABORT):
            if frame.message == MAKE_SAFE:
                aborted = list(self.running)
            else:
                aborted = [run for run in self.running if run[0] == struct.unpack("<H", frame.payload)[0]]
            return "urgent", key, aborted
        if len(self.running) == 4:
            return "nak", key, 5
        if CALLS[frame.message][1] and not self.powered:
            return "nak", key, 6
        return "start", key, frame.payload

    def board(self, line, frame):
        low, high, key = line.low, line.high, (frame.request, frame.message)
        if frame.kind == EVENT:
            if frame.message == BEAT:
                self.heartbeat(line, *struct.unpack("<IQB", frame.payload))
            else:
                self.watchdog(line)
            return
        self.silence(low)
        if frame.kind == HELLO:
            chosen, _, _, nonce, boot = struct.unpack("<BBBII", frame.payload[4:15])
            self.answer(line, ("hello", frame.request, nonce, chosen))
            assert boot == self.boot, "the boot id of the heartbeat"
        elif frame.kind == NAK:
            self.answer(line, ("nak", key, struct.unpack("<H", frame.payload[:2])[0]))
        elif frame.kind == ACCEPT:
            found = [a for a in self.awaited if a[1][0] in ("accept", "start", "urgent") and a[1][1] == key]
            assert found, "an ACCEPT of no request"
            self.answer(line, found[0][1])
            what, _, detail = found[0][1]
            assert what != "accept" or detail == frame.payload, "ACCEPT again, with the same expected_ms"
            if what == "urgent":
                assert self.can or not detail, "the RESULT of what is ended comes before this"
                assert struct.unpack("<I", frame.payload)[0] == 0
            if what in ("urgent", "start"):
                run = {"accept": frame.payload, "low": low, "said": low, "heard": high, "asked": detail, "what": what}
                self.running[key] = run
        elif frame.kind == PROGRESS:
            run = self.running[key]
            assert high - run["heard"] <= PROGRESS_MS, f"PROGRESS {high - run['heard']} ms after the last word"
            done, _ = struct.unpack("<HI", frame.payload)
            assert done <= 1000
            run["said"], run["heard"] = low, high
        elif frame.kind == RESULT:
            self.result(line, key, frame)
        elif frame.kind == STREAM:
            _, _, count, first, _, _ = struct.unpack("<BBHIQI", frame.payload[:20])
            self.samples(line, first, count)

    def answer(self, line, what):
        """Ticks off what the board must answer, and that its window is inside the limit."""
        found = [a for a in self.awaited if a[1] == what]
        assert found, f"{what} is not what is asked; awaited: {self.awaited}"
        assert line.high <= found[0][0] and line.low >= found[0][0] - ANSWER_MS, "the window is not within the limit"
        self.awaited.remove(found[0])

    def result(self, line, key, frame):
        if frame.flags == REPLAYED:
            self.answer(line, ("replay", key, frame.payload))
            return
        run = self.running.pop(key, None)
        assert run, "a RESULT without an ACCEPT, or a second one without the flag"
        status, elapsed_us = struct.unpack("<HI", frame.payload[:6])
        if status == 1:
            enders = [a[1] for a in self.awaited if a[1][0] == "urgent" and key in a[1][2]]
            enders += [("", "", r["asked"]) for r in self.running.values() if r["what"] == "urgent" and key in r["asked"]]
            enders += [("", "", asked) for asked in self.ended_by if key in asked]
            assert enders and elapsed_us == 0 and frame.payload[6:] == b"\0", "aborted by nothing, or with a time or text"
            enders[0][2].remove(key)
        else:
            assert line.low - run["said"] <= PROGRESS_EVERY_MS, "PROGRESS is missing"
            assert line.low <= run["low"] + elapsed_us / 1000 <= line.high, "elapsed_us and the window"
        self.kept[key] = frame.payload
        while len(self.kept) > 8:
            del self.kept[next(iter(self.kept))]
        if status == 0:
            self.carry_out(key, run["asked"], frame.payload[6:])

    def carry_out(self, key, asked, body):
        if key[1] == POWER:
            self.powered = asked == b"\x01"
        elif key[1] == MAKE_SAFE:
            self.ended_by.append(asked)
            self.powered, self.streams = False, {}
        elif key[1] == ABORT:
            self.ended_by.append(asked)
        elif key[1] == START:
            stream, rate, count, _ = struct.unpack("<BHIB", asked)
            self.streams[stream] = {"left": count, "next": 0, "rate": rate}
            self.account = [0, 0]
        elif key[1] == STOP:
            produced, dropped = struct.unpack("<II", body)
            assert (produced, dropped) == tuple(self.account), "the account of the stream"
            self.streams.pop(asked[0], None)

    def samples(self, line, first, count):
        assert 1 in self.streams, "samples before the RESULT of StreamStart, or after the end"
        stream = self.streams[1]
        assert first == stream["next"] and count <= stream["left"], "the numbers of the samples"
        stream["next"] += count
        stream["left"] -= count
        self.account[0] += count
        if stream["left"] == 0:
            del self.streams[1]

    def heartbeat(self, line, boot, time_us, state):
        since = line.low if self.beats == 0 else 0
        assert self.beats > 0 or since == self.began, "a heartbeat at the start"
        self.silence(line.low)
        self.boot = self.boot if self.boot is not None else boot
        assert boot == self.boot, "the boot id"
        nominal = self.began + BEAT_MS * self.beats
        assert line.low <= nominal <= line.high and time_us == 1000 * (nominal - self.began), "every 1000 ms"
        bits = [self.session is not None, self.powered, bool(self.running), bool(self.streams)]
        assert state == sum(bit << at for at, bit in enumerate(bits)), f"state {state}, not {bits}"
        self.beats += 1
        self.last_beat = nominal

    def watchdog(self, line):
        assert self.session is not None, "there is no session to end"
        assert line.low >= self.heard + WATCHDOG_MS and line.high <= self.heard + SAFE_MS, "1750 ms, safe within 2 s"
        self.session, self.awaited = None, []
        self.forget()

    def restart(self, now, boot):
        assert boot != self.boot, "the boot id is drawn anew"
        self.start(now, boot)

    def end(self, last):
        assert not self.awaited and not self.running, f"not answered: {self.awaited} {list(self.running)}"
        assert not any(self.ended_by), "the RESULT of what was ended is missing"
        assert last - self.last_beat < BEAT_MS + BEAT_LATE_MS, "a heartbeat is missing at the end"


def check(link, lines):
    can = link == "can"
    rules, bus = Conversation(can), Bus()
    before = 0
    for line in lines:
        try:
            assert line.low >= before or line.who == "board", "times go back"
            before = max(before, line.low) if line.who != "board" else before
            if line.who == "bench":
                assert line.what[0] == "restart" and not line.what[2:]
                rules.restart(line.low, int(line.what[1], 16))
                bus = Bus()
                continue
            if not can:
                frame = Frame(unstuff(bytes.fromhex(line.what[0])))
                said = words(frame, line.who == "host")
                assert line.words == said, f"it says: {said}"
                rules.number(line.who, "line", frame)
                rules.host(line.low, frame) if line.who == "host" else rules.board(line, frame)
                continue
            done = bus.take(line)
            if done is None:
                continue
            first, what, value = done
            if what == "frame":
                ident, frame = value
                rules.number(line.who, ident, frame)
                rules.host(line.low, frame) if line.who == "host" else rules.board(first, frame)
            elif what == "keep-alive":
                rules.silence(line.low)
                rules.heard = line.low
            elif what == "heartbeat":
                rules.heartbeat(line, *value)
            elif what == "watchdog":
                rules.watchdog(line)
            else:
                rules.samples(line, *value)
        except (AssertionError, KeyError, IndexError, ValueError, struct.error) as error:
            raise SystemExit(f"{line.text[:160]}\n  {type(error).__name__} {error}") from error
    assert not bus.parts and not bus.sample, "half a message at the end"
    rules.end(max(line.low for line in lines))


def main():
    path = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else FILE
    conversations = read(path)
    assert len(conversations) >= 12
    for name, link, lines in conversations:
        try:
            check(link, lines)
        except (AssertionError, SystemExit) as error:
            print(f"{path.name}: {name}: {error}")
            return 1
    lines = sum(len(lines) for _, _, lines in conversations)
    print(f"{path.name}: {len(conversations)} conversations, {lines} lines keep the rules")
    return 0


if __name__ == "__main__":
    sys.exit(main())
