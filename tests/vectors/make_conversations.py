#!/usr/bin/env python3
"""Works out the conversations of protocol version 1.

Made from docs/ICD.md and without the Rust code: make_vectors.py lays the bytes out, the order and the times are written down
here. The file is frozen as the vectors are: one that exists is never overwritten, and the script exits with 1 where a byte
differs.

    python3 tests/vectors/make_conversations.py
"""

import struct
import sys

import check_conversations as rules
import make_vectors as wire
from check_conversations import ABORT, ACCEPT, EVENT, HELLO, MAKE_SAFE, NAK, POWER, PROGRESS, REPLAYED, REQUEST, RESENT, RESULT
from check_conversations import START, STOP, STREAM

HEAD = """\
# Conversations of protocol version 1: what comes after what, and when.
#
# Worked out by make_conversations.py from docs/ICD.md, independently of the Rust code. FROZEN: do not change a byte.
# A test that fails on one of these says that the program no longer speaks the protocol which boards in the field
# speak. Mend the program. Where the protocol itself must change, it gets a new version number and new files.
#
# A conversation begins with "conversation:", its name and its link (rs-422 or can). "why" says what it shows. The board starts
# at 0 ms, safe. Then the lines, in their order:
#
#   time  who  bytes  # words | remark
#
# host    the last byte of this frame reaches the board at this time, in milliseconds
# board   the board's frame begins to leave within this window, wire time not counted
# bench   what happens to the board; restart: it starts anew, with this boot id
#
# Bytes are hexadecimal, as they are on the wire. On CAN they are the id and the data, "-" for no data; the words of a message
# stand at its first frame. The host's flow control follows the frame that asks for it, whenever that comes. Frames of one
# id keep their order, frames of two ids may change places. Nothing else may come from the board.
#
# Your board may have another boot id, serial, firmware, board time, expected_ms, elapsed time, measured value and text of
# a NAK. A request may take it longer or shorter, with PROGRESS as section 7 asks. Its heartbeats may stand elsewhere between
# the lines, as long as they are 1000 ms apart. Then the sequence numbers and checksums differ too. Everything else must be
# as it is here.
"""

NONCE = 0x12345678
BOOT = 0xB0071DEA
TIMERS = (0, 100_000, 5)
INTERVALS = (100_000_010, 99_999_990, 100_000_000, 100_000_000, 100_000_010)
IDENTITY = ("GNC-2026-000123", "GNC-POP-26", "C", "2.1.0", 1)
# A board may answer 50 ms after a request; then what follows comes so much later too.
LATE = 50


def text(value):
    return wire.pack("text", value)


class Talk:
    def __init__(self, name, link, why):
        self.lines = [f"\nconversation: {name} {link}\n  why: {why}"]
        self.link, self.boot, self.began = link, BOOT, 0
        self.numbers = {}
        self.beats = 0

    def line(self, when, who, what, words, remark):
        remark = f" | {remark}" if remark else ""
        self.lines.append(f"{when:>10}  {who:5}  {what}  # {words}{remark}")

    def frame(self, ident, kind, message, payload, request, flags):
        number = self.numbers.get(ident, 0)
        self.numbers[ident] = number + 1
        head = struct.pack("<BBHHH", kind if kind == HELLO else 16 | kind, flags, request, message, number)
        return head + payload + struct.pack("<I", wire.crc32c(head + payload))

    def say(self, who, low, high, kind, message, payload=b"", request=0, flags=0, remark=""):
        """One message; on CAN all frames of its transfer, with the other end's flow control."""
        if self.link == "can":
            parts = self.parts(who, kind, message, payload, request, flags)
            self.part(low, high, who, parts, remark)
            self.flow(low, high, who, parts)
            while parts["left"]:
                self.part(low, high, who, parts)
            return
        content = self.frame(who, kind, message, payload, request, flags)
        when = f"{low}" if who == "host" else f"{low}..{high}"
        words = rules.words(rules.Frame(content), who == "host")
        self.line(when, who, f"00{wire.cobs(content).hex()}00", words, remark)

    # -------------------------------------------------------------------------------------------------- CAN
    def parts(self, who, kind, message, payload, request, flags=0):
        urgent = kind == HELLO or message in (MAKE_SAFE, ABORT)
        ident = {("host", True): "020", ("host", False): "100", ("board", True): "021", ("board", False): "101"}[who, urgent]
        content = self.frame(ident, kind, message, payload, request, flags)
        words = rules.words(rules.Frame(content), who == "host")
        frames = [struct.pack(">H", 0x1000 | len(content)) + content[:6]]
        for number, at in enumerate(range(6, len(content), 7), 1):
            frames.append(bytes([0x20 | number % 16]) + content[at : at + 7])
        return {"id": ident, "left": frames, "words": words, "sent": 0}

    def part(self, low, high, who, parts, remark=""):
        words = parts["words"] if parts["sent"] == 0 else f"part {parts['sent']}"
        parts["sent"] += 1
        self.raw(low, high, who, parts["id"], parts["left"].pop(0), words, remark)

    def flow(self, low, high, who, parts):
        back = rules.Bus.BACK[parts["id"]]
        high, other = (low + LATE, "board") if who == "host" else (high, "host")
        self.raw(low, high, other, back, b"\x30\0\0", "flow control")

    def raw(self, low, high, who, ident, data, words, remark=""):
        when = f"{low}" if who == "host" else f"{low}..{high}"
        self.line(when, who, f"{ident} {data.hex() or '-'}", words, remark)

    # ------------------------------------------------------------------------------------------- the messages
    def beat(self, state, remark=""):
        nominal = self.began + 1000 * self.beats
        low, high = (nominal if self.beats == 0 else nominal - LATE), nominal + LATE
        time_us = 1000 * (nominal - self.began)
        self.beats += 1
        if self.link == "can":
            who = struct.pack("<BBIBB", 0, self.beats, self.boot, state, 0)
            self.raw(low, high, "board", "011", who, f"heartbeat {self.beats}, boot id {self.boot:08x}, state {state}", remark)
            when = struct.pack("<BB", 1, self.beats) + time_us.to_bytes(6, "little")
            self.raw(low, high, "board", "011", when, f"heartbeat {self.beats}, {time_us} us")
        else:
            self.say("board", low, high, EVENT, 1, struct.pack("<IQB", self.boot, time_us, state), remark=remark)

    def keep_alive(self, at):
        if self.link == "can":
            self.raw(at, at, "host", "010", b"", "keep-alive")
        else:
            self.say("host", at, at, EVENT, 2)

    def watchdog(self, heard, remark):
        if self.link == "can":
            self.raw(heard + 1750, heard + 2000, "board", "011", b"\x02", "watchdog", remark)
        else:
            self.say("board", heard + 1750, heard + 2000, EVENT, 3, remark=remark)

    def restart(self, at, boot):
        self.line(at, "bench", f"restart {boot:08x}", "the board restarts", "")
        self.boot, self.began, self.beats = boot, at, 0
        self.numbers = {ident: number for ident, number in self.numbers.items() if ident == "host"}

    def hello(self, at, request, nonce=NONCE, versions=(1, 1), chosen=1, remark="", answer=""):
        self.say("host", at, at, HELLO, 0, b"GNCT" + struct.pack("<BBI", *versions, nonce), request, remark=remark)
        bits = 3 if self.link == "can" else 1
        payload = b"GNCT" + struct.pack("<BBBIII", chosen, 1, 1, nonce, self.boot, bits) + text("SB-0042") + text("1.4.2")
        self.say("board", at, at + LATE, HELLO, 0, payload, request, remark=answer)

    def ask(self, at, request, message, payload=b"", again=False, remark=""):
        self.say("host", at, at, REQUEST, message, payload, request, RESENT if again else 0, remark)

    def accept(self, at, request, message, expected_ms, remark=""):
        self.say("board", at, at + LATE, ACCEPT, message, struct.pack("<I", expected_ms), request, remark=remark)

    def progress(self, asked, after, request, message, permille, remark=""):
        load = struct.pack("<HI", permille, after)
        self.say("board", asked + after - LATE, asked + after + LATE, PROGRESS, message, load, request, remark=remark)

    def result(self, asked, took_ms, request, message, body=b"", status=0, flags=0, wait=LATE, remark="", at=None):
        load = struct.pack("<HI", status, 1000 * took_ms) + body
        at = asked + took_ms if at is None else at
        self.say("board", at, at + wait, RESULT, message, load, request, flags, remark)

    def nak(self, at, request, message, code, why, remark=""):
        self.say("board", at, at + LATE, NAK, message, struct.pack("<H", code) + text(why), request, remark=remark)

    # ------------------------------------------------------------------------------------- what often comes
    def power(self, at, request=0x2003):
        self.ask(at, request, POWER, b"\x01")
        self.accept(at, request, POWER, 150)
        self.result(at, 150, request, POWER, struct.pack("<II", 5_012_345, 491_234))

    def opened(self):
        """A session with the module under power, at 350 ms."""
        self.beat(0, "the board starts")
        self.hello(100, 1)
        self.power(200)

    def identity(self, at, request=0x2010, remark=""):
        self.ask(at, request, 0x0010)
        self.accept(at, request, 0x0010, 20)
        self.result(at, 20, request, 0x0010, WHO, remark=remark)

    def timers(self, at, request=0x2014):
        self.ask(at, request, 0x0014, struct.pack("<BIH", *TIMERS))
        self.accept(at, request, 0x0014, 500)

    def aborted(self, at, request=0x2014, message=0x0014):
        self.result(at, 0, request, message, text(""), status=1, remark="it is aborted")


WHO = b"".join(text(value) for value in IDENTITY[:4]) + bytes([IDENTITY[4]])
MEASURED = struct.pack("<HH5I", 5, 5, *INTERVALS)
NO_SESSION = "send HELLO first"
NO_POWER = "the module has no power"


def conversations():
    talk = Talk("session.same-nonce", "rs-422", "the host opens a session and asks again under the same nonce: nothing changes")
    talk.opened()
    talk.hello(450, 2, remark="the same nonce", answer="the same answer")
    talk.keep_alive(900)
    talk.beat(3, "the session lives and the module is still under power")
    yield talk

    talk = Talk("request.result", "rs-422", "a request from ACCEPT to RESULT")
    talk.opened()
    talk.identity(400)
    yield talk

    talk = Talk("request.progress", "rs-422", "a slow request: PROGRESS 400 ms after ACCEPT, never more than 500 ms apart")
    talk.opened()
    talk.timers(400)
    talk.progress(400, 400, 0x2014, 0x0014, 800)
    talk.keep_alive(860)
    talk.result(400, 500, 0x2014, 0x0014, MEASURED)
    yield talk

    talk = Talk("request.lost-answer", "rs-422", "the line loses ACCEPT and RESULT; the host asks again and gets the kept RESULT")
    talk.opened()
    talk.identity(400, remark="the host hears neither of the two")
    talk.ask(480, 0x2010, 0x0010, again=True)
    talk.result(480, 20, 0x2010, 0x0010, WHO, flags=REPLAYED, at=480, remark="from memory, and no ACCEPT")
    talk.ask(560, 0x2010, 0x0010, again=True, remark="that is lost too")
    talk.result(560, 20, 0x2010, 0x0010, WHO, flags=REPLAYED, at=560)
    yield talk

    talk = Talk("request.second-copy", "rs-422", "the line loses ACCEPT; the second copy comes while the first runs and starts nothing")
    talk.opened()
    talk.timers(400)
    talk.ask(480, 0x2014, 0x0014, struct.pack("<BIH", *TIMERS), again=True)
    talk.accept(480, 0x2014, 0x0014, 500, "the same expected_ms")
    talk.progress(400, 400, 0x2014, 0x0014, 800)
    talk.result(400, 500, 0x2014, 0x0014, MEASURED, remark="one RESULT")
    yield talk

    talk = Talk("session.none", "rs-422", "without a session every request is refused, MAKE_SAFE too")
    talk.beat(0)
    talk.ask(100, 0x2010, 0x0010)
    talk.nak(100, 0x2010, 0x0010, 1, NO_SESSION)
    talk.ask(200, 0x2001, MAKE_SAFE)
    talk.nak(200, 0x2001, MAKE_SAFE, 1, NO_SESSION)
    talk.hello(300, 1)
    yield talk

    talk = Talk("power.first", "rs-422", "a request that needs power is refused before ModulePower and done after it")
    talk.beat(0)
    talk.hello(100, 1)
    talk.ask(200, 0x2010, 0x0010)
    talk.nak(200, 0x2010, 0x0010, 6, NO_POWER)
    talk.power(300)
    talk.identity(500, 0x2011)
    yield talk

    talk = Talk("abort.running", "rs-422", "ABORT: first the aborted RESULT, then ABORT's ACCEPT and RESULT; a second ABORT ends nothing")
    talk.opened()
    talk.timers(400)
    talk.ask(500, 0x2002, ABORT, struct.pack("<H", 0x2014))
    talk.aborted(500)
    talk.accept(500, 0x2002, ABORT, 0)
    talk.result(500, 0, 0x2002, ABORT, b"\x01", remark="it was running")
    talk.ask(600, 0x2004, ABORT, struct.pack("<H", 0x2014))
    talk.accept(600, 0x2004, ABORT, 0)
    talk.result(600, 0, 0x2004, ABORT, b"\x00", remark="it was not")
    talk.beat(3)
    yield talk

    talk = Talk("make-safe.running", "rs-422", "MAKE_SAFE: first the aborted RESULT; the session stays and the supply is off")
    talk.opened()
    talk.timers(400)
    talk.ask(500, 0x2001, MAKE_SAFE)
    talk.aborted(500)
    talk.accept(500, 0x2001, MAKE_SAFE, 0)
    talk.result(500, 0, 0x2001, MAKE_SAFE, wait=250)
    talk.ask(800, 0x2010, 0x0010)
    talk.nak(800, 0x2010, 0x0010, 6, NO_POWER)
    talk.beat(1)
    yield talk

    talk = Talk("request.fifth", "rs-422", "four requests run and a fifth is refused; when one has ended there is room again")
    talk.opened()
    talk.timers(400)
    talk.ask(410, 0x2015, 0x0015, bytes([1, 0]))
    talk.accept(410, 0x2015, 0x0015, 300)
    talk.ask(420, 0x2017, 0x0017, struct.pack("<BH", 0, 3))
    talk.accept(420, 0x2017, 0x0017, 60)
    talk.ask(430, 0x201B, 0x001B, struct.pack("<BH", 2, 1000))
    talk.accept(430, 0x201B, 0x001B, 101)
    talk.ask(440, 0x2018, 0x0017, struct.pack("<BH", 1, 3))
    talk.nak(440, 0x2018, 0x0017, 5, "four requests are running")
    talk.result(420, 60, 0x2017, 0x0017, struct.pack("<I", 58_000))
    talk.result(430, 101, 0x201B, 0x001B, struct.pack("<HBiii", 1, 2, 2_500_000, 2_499_000, 2_501_000))
    talk.ask(600, 0x2019, 0x0017, struct.pack("<BH", 1, 3))
    talk.accept(600, 0x2019, 0x0017, 120)
    talk.result(410, 300, 0x2015, 0x0015, struct.pack("<5I", 1_048_576, 0, 0, 0, 0))
    talk.result(600, 120, 0x2019, 0x0017, struct.pack("<I", 118_000))
    talk.progress(400, 400, 0x2014, 0x0014, 800)
    talk.result(400, 500, 0x2014, 0x0014, MEASURED)
    yield talk

    talk = Talk("stream.count", "rs-422", "30 IMU samples, 10 a frame, to the end of the count; StreamStop closes the account")
    talk.opened()
    talk.ask(400, 0x2020, START, struct.pack("<BHIB", 1, 1000, 30, 10))
    talk.accept(400, 0x2020, START, 1)
    talk.result(400, 1, 0x2020, START, struct.pack("<BBH", 1, 10, 473), remark="the stream's grid begins here, at 401000 us")
    for first in (0, 10, 20):
        head = struct.pack("<BBHIQI", 1, 1, 10, first, 401_000 + 1000 * (first + 1), 0)
        samples = b"".join(sample(number) for number in range(first, first + 10))
        at = 401 + first + 10
        talk.say("board", at, at + LATE, STREAM, 1, head + samples, remark="the last one" if first == 20 else "")
    talk.ask(500, 0x2021, STOP, b"\x01")
    talk.accept(500, 0x2021, STOP, 1)
    talk.result(500, 1, 0x2021, STOP, struct.pack("<II", 30, 0), remark="produced, dropped")
    yield talk

    talk = Talk("watchdog", "rs-422", "the host falls silent: the board ends the session and is safe; the same nonce opens a new one")
    watchdog(talk)
    yield talk

    talk = Talk("session.new-nonce", "rs-422", "a new nonce ends the session: no RESULT of what runs, nothing kept, no power")
    talk.opened()
    talk.timers(400)
    talk.hello(600, 2, nonce=0x12345679, remark="another nonce")
    talk.beat(1, "0x2014 gets no answer any more")
    talk.keep_alive(1100)
    talk.power(1200)
    yield talk

    talk = Talk("version.none", "rs-422", "no version in common: chosen is 0 and the session ends, under its own nonce too")
    talk.opened()
    talk.hello(450, 2, versions=(2, 3), chosen=0, remark="a host of other versions")
    talk.ask(550, 0x2010, 0x0010)
    talk.nak(550, 0x2010, 0x0010, 1, NO_SESSION)
    talk.beat(0, "safe")
    yield talk

    talk = Talk("restart.running", "rs-422", "the board restarts in a request: another boot id, NAK 1, and HELLO under the same nonce")
    talk.opened()
    talk.timers(400)
    talk.restart(650, 0x5EED0002)
    talk.beat(0, "another boot id, time and sequence numbers from 0")
    talk.ask(750, 0x2014, 0x0014, struct.pack("<BIH", *TIMERS), again=True)
    talk.nak(750, 0x2014, 0x0014, 1, NO_SESSION, "the request is lost")
    talk.hello(850, 2, answer="a new session")
    talk.keep_alive(1350)
    talk.beat(1, "without power")
    yield talk

    talk = Talk("can.request", "can", "HELLO, power and Identity over ISO-TP, in two channels with sequence numbers of their own")
    talk.opened()
    talk.identity(400)
    talk.keep_alive(900)
    talk.beat(3)
    yield talk

    talk = Talk("can.make-safe", "can", "MAKE_SAFE in the urgent channel: its answers may overtake the aborted RESULT of the other one")
    talk.opened()
    talk.timers(400)
    talk.ask(500, 0x2001, MAKE_SAFE)
    ended = talk.parts("board", RESULT, 0x0014, struct.pack("<HI", 1, 0) + text(""), 0x2014)
    taken = talk.parts("board", ACCEPT, MAKE_SAFE, struct.pack("<I", 0), 0x2001)
    talk.part(500, 550, "board", taken)
    talk.part(500, 550, "board", ended, "it is aborted; both wait for their flow control")
    talk.flow(500, 550, "board", taken)
    for _ in range(2):
        talk.part(500, 550, "board", taken)
    done = talk.parts("board", RESULT, MAKE_SAFE, struct.pack("<HI", 0, 0), 0x2001)
    talk.part(500, 750, "board", done)
    talk.flow(500, 550, "board", ended)
    while ended["left"]:
        talk.part(500, 550, "board", ended)
    talk.flow(500, 750, "board", done)
    while done["left"]:
        talk.part(500, 750, "board", done)
    talk.beat(1)
    yield talk

    talk = Talk("can.stream", "can", "three IMU samples as raw frames, a mark and a clock before the first")
    talk.opened()
    talk.ask(400, 0x2020, START, struct.pack("<BHIB", 1, 200, 3, 1))
    talk.accept(400, 0x2020, START, 1)
    talk.result(400, 1, 0x2020, START, struct.pack("<BBH", 1, 1, 143))
    for number in range(3):
        at = 401 + 5 * (number + 1)
        if number == 0:
            talk.raw(at, at + LATE, "board", "203", struct.pack("<Ihh", 0, 2345, 2301), "mark: sample 0")
            clock = (1000 * at).to_bytes(6, "little") + b"\0\0"
            talk.raw(at, at + LATE, "board", "204", clock, f"clock: {1000 * at} us, 0 dropped")
        for place, name in enumerate(("gyro", "accel", "mag")):
            axes = [value // 64 for value in values(number)[3 * place : 3 * place + 3]]
            said = f"sample {number}, {name} {' '.join(map(str, axes))}"
            talk.raw(at, at + LATE, "board", f"20{place}", wire.sensor(number, values(number)[3 * place : 3 * place + 3]), said)
    talk.ask(500, 0x2021, STOP, b"\x01")
    talk.accept(500, 0x2021, STOP, 1)
    talk.result(500, 1, 0x2021, STOP, struct.pack("<II", 3, 0))
    yield talk

    talk = Talk("can.watchdog", "can", "the host falls silent on the bus: the raw watchdog frame, NAK 1, HELLO again")
    watchdog(talk)
    yield talk


def watchdog(talk):
    talk.beat(0)
    talk.hello(100, 1)
    talk.power(300)
    talk.beat(3)
    talk.beat(3)
    talk.watchdog(300, "1750 ms after the REQUEST, the host's last sign of life")
    talk.ask(2400, 0x2010, 0x0010)
    talk.nak(2400, 0x2010, 0x0010, 1, NO_SESSION)
    talk.hello(2500, 2)
    talk.beat(1, "a new session, without power")


def values(number):
    return [100 + number, -200, 300, -1600, 800, 160_000, 250_000, -125_000, 500_000]


def sample(number):
    return struct.pack("<9ihh", *values(number), 2345, 2301)


def main():
    text_of_file = HEAD + "".join("\n".join(talk.lines) + "\n" for talk in conversations())
    text_of_file = "\n".join(line.rstrip() for line in text_of_file.splitlines()) + "\n"
    if not rules.FILE.exists():
        rules.FILE.write_text(text_of_file)
        print(f"{rules.FILE.name}: written")
        return 0
    if rules.FILE.read_text() == text_of_file:
        print(f"{rules.FILE.name}: agrees")
        return 0
    print(f"{rules.FILE.name}: DIFFERS from what this script works out")
    return 1


if __name__ == "__main__":
    sys.exit(main())
