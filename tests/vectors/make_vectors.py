#!/usr/bin/env python3
"""Works out the wire vectors of protocol version 1.

Made from docs/ICD.md alone and without the Rust code: the byte stuffing, the checksum (bit by bit, from its
polynomial) and every layout are written here a second time, so that a mistake in one codec cannot hide in the
other. Python's standard library is all it needs.

The vectors are frozen. A file that exists is never overwritten: the script works every vector out anew, compares
and exits with 1 where a byte differs. A new version of the protocol gets new files (v2-...) beside these.

    python3 tests/vectors/make_vectors.py
"""

import math
import pathlib
import struct
import sys

HEAD = """\
# Wire vectors of protocol version 1: {title}.
#
# Worked out by make_vectors.py from docs/ICD.md, independently of the Rust code. FROZEN: do not change a byte.
# A test that fails on one of these says that the program no longer speaks the protocol which boards in the field
# speak. Mend the program. Where the protocol itself must change, it gets a new version number and new files.
#
# A vector begins with "vector:". "field:" lines explain the payload (offset, type, name, value). "payload",
# "frame" (header, payload, checksum) and "wire" (delimiters, stuffed frame) are bytes in hexadecimal; an empty
# payload is an empty line. Numbers of the header are hexadecimal.
"""

HELLO, REQUEST, ACCEPT, PROGRESS, RESULT, STREAM, EVENT, NAK = range(8)
KINDS = ["HELLO", "REQUEST", "ACCEPT", "PROGRESS", "RESULT", "STREAM", "EVENT", "NAK"]


def crc32c(data):
    """CRC-32C one bit at a time: reflected polynomial 82F63B78, start and final exclusive-or FFFFFFFF."""
    register = 0xFFFFFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0x82F63B78 if register & 1 else 0)
    return register ^ 0xFFFFFFFF


assert crc32c(b"123456789") == 0xE3069283


def cobs(data):
    """Each run of up to 254 bytes without 00 goes out behind a code byte, which is its length plus one. A code
    below FF stands for its run and one 00 after it; the 00 that the last code would stand for is not data."""
    out = bytearray()
    run = bytearray()
    open_run = True  # whether a code must still be written for what follows the last one
    for byte in data:
        open_run = True
        if byte == 0:
            out += bytes([len(run) + 1]) + run
            run = bytearray()
        else:
            run.append(byte)
            if len(run) == 254:
                out += b"\xff" + run
                run = bytearray()
                open_run = False
    if open_run:
        out += bytes([len(run) + 1]) + run
    return bytes(out)


def uncobs(data):
    """The other way, to check the first."""
    out = bytearray()
    at = 0
    while at < len(data):
        code = data[at]
        assert code != 0 and at + code <= len(data)
        out += data[at + 1 : at + code]
        at += code
        if code < 0xFF and at < len(data):
            out.append(0)
    return bytes(out)


PACK = {"u8": "<B", "u16": "<H", "u32": "<I", "u64": "<Q", "i16": "<h", "i32": "<i", "f64": "<d"}


def pack(kind, value):
    if kind == "text":
        raw = value.encode()
        return bytes([len(raw)]) + raw
    if kind == "block":
        return struct.pack("<H", len(value)) + bytes(value)
    if kind == "raw":
        return bytes(value)
    return struct.pack(PACK[kind], value)


def show(kind, value):
    if kind in ("block", "raw"):
        return f"{len(value)} bytes {bytes(value)[:24].hex()}{'...' if len(value) > 24 else ''}"
    if kind == "text":
        return f'"{value}"'
    if kind == "f64":
        return repr(value)
    return f"{value} (0x{value & (2 ** (8 * struct.calcsize(PACK[kind])) - 1):x})"


def many(name, kind, values):
    """A list: count, then the elements. A kind that is a list of kinds makes a list of tuples."""
    fields = [(f"count of {name}", "u16", len(values))]
    for number, value in enumerate(values):
        if isinstance(kind, str):
            fields.append((f"{name}[{number}]", kind, value))
        else:
            fields += [(f"{name}[{number}].{part}", k, v) for (part, k), v in zip(kind, value, strict=True)]
    return fields


class File:
    def __init__(self, name, title):
        self.name = name
        self.text = HEAD.format(title=title)
        self.names = set()

    def add(self, name, kind, message, fields, request=0, sequence=0, flags=0, version=None, why=None):
        assert name not in self.names
        self.names.add(name)
        version = (0 if kind == HELLO else 1) if version is None else version
        payload = b""
        lines = []
        for field, layout, value in fields:
            lines.append(f"  field: {len(payload):3} {layout:5} {field} = {show(layout, value)}\n")
            payload += pack(layout, value)
        assert len(payload) <= 512
        header = struct.pack("<BBHHH", version << 4 | kind, flags, request, message, sequence)
        crc = crc32c(header + payload)
        frame = header + payload + struct.pack("<I", crc)
        stuffed = cobs(frame)
        assert 0 not in stuffed and uncobs(stuffed) == frame
        self.text += f"\nvector: {name}\n"
        if why:
            self.text += f"  why: {why}\n"
        self.text += f"  kind: {kind} {KINDS[kind]}\n  version: {version}\n  flags: {flags:02x}\n"
        self.text += f"  request: {request:04x}\n  message: {message:04x}\n  sequence: {sequence:04x}\n"
        self.text += "".join(lines)
        self.text += f"  payload: {payload.hex()}\n  crc: {crc:08x}\n  frame: {frame.hex()}\n"
        self.text += f"  wire: 00{stuffed.hex()}00\n"
        return frame

    def close(self):
        path = pathlib.Path(__file__).with_name(self.name)
        self.text = "\n".join(line.rstrip() for line in self.text.splitlines()) + "\n"
        if not path.exists():
            path.write_text(self.text)
            print(f"{self.name}: {len(self.names)} vectors written")
            return True
        if path.read_text() == self.text:
            print(f"{self.name}: {len(self.names)} vectors agree")
            return True
        print(f"{self.name}: DIFFERS from what this script works out")
        return False


# ---------------------------------------------------------------------------------------------------- session
session = File("v1-session.txt", "sessions, the stages of a request, events")

HOST_HELLO = [("magic", "raw", b"GNCT"), ("lowest", "u8", 1), ("highest", "u8", 1), ("nonce", "u32", 0x12345678)]
session.add("hello.host", HELLO, 0, HOST_HELLO, request=1)


def board_hello(chosen):
    return [
        ("magic", "raw", b"GNCT"),
        ("chosen", "u8", chosen),
        ("lowest", "u8", 1),
        ("highest", "u8", 1),
        ("nonce", "u32", 0x12345678),
        ("boot_id", "u32", 0xB007_1DEA),
        ("capabilities", "u32", 0x00000001),
        ("serial", "text", "SB-0042"),
        ("firmware", "text", "1.4.2"),
    ]


session.add("hello.board", HELLO, 0, board_hello(1), request=1, sequence=3)
session.add(
    "hello.host-newer",
    HELLO,
    0,
    [("magic", "raw", b"GNCT"), ("lowest", "u8", 2), ("highest", "u8", 3), ("nonce", "u32", 0x12345678)],
    request=1,
    why="a host that speaks versions 2 and 3 only",
)
session.add("hello.board-refuses", HELLO, 0, board_hello(0), request=1, sequence=4, why="no version in common")
session.add("accept", ACCEPT, 0x0017, [("expected_ms", "u32", 350)], request=0x0102, sequence=5)
session.add(
    "progress",
    PROGRESS,
    0x0017,
    [("done_permille", "u16", 417), ("elapsed_ms", "u32", 146)],
    request=0x0102,
    sequence=6,
)
session.add(
    "nak.busy",
    NAK,
    0x0015,
    [("code", "u16", 5), ("text", "text", "four requests are running")],
    request=0x0103,
    sequence=7,
)
session.add(
    "result.aborted",
    RESULT,
    0x0015,
    [("status", "u16", 1), ("elapsed_us", "u32", 0), ("text", "text", "")],
    request=0x0104,
    sequence=8,
)
session.add(
    "result.device-timeout",
    RESULT,
    0x0016,
    [("status", "u16", 2), ("elapsed_us", "u32", 250_000), ("text", "text", "no answer on the µSPI bus")],
    request=0x0105,
    sequence=9,
    why="a text with a character of two bytes",
)
session.add("request.resent", REQUEST, 0x0010, [], request=0x0106, sequence=0x0201, flags=0x01)
session.add(
    "result.replayed",
    RESULT,
    0x0001,
    [("status", "u16", 0), ("elapsed_us", "u32", 0)],
    request=0x0107,
    sequence=0x0A0B,
    flags=0x02,
)
session.add(
    "event.heartbeat",
    EVENT,
    0x0001,
    [("boot_id", "u32", 0xB007_1DEA), ("board_time_us", "u64", 0x0000_0001_0203_0405), ("state", "u8", 0x07)],
    sequence=0xFFFF,
)
session.add("event.keep-alive", EVENT, 0x0002, [], sequence=0x0010)
session.add("event.watchdog", EVENT, 0x0003, [], sequence=0x0011)
session.add("event.board-started", EVENT, 0x0001,
            [("boot_id", "u32", 0xB007_1DEB), ("board_time_us", "u64", 12), ("state", "u8", 0)],
            why="first frame of a board after a restart: another boot id, sequence number 0")

# ------------------------------------------------------------------------------------------------------ calls
calls = File("v1-calls.txt", "every request and its result")


def call(name, message, request_fields, reply_fields, elapsed_us=0):
    number = 0x2000 + message
    calls.add(f"{name}.request", REQUEST, message, request_fields, request=number, sequence=message)
    head = [("status", "u16", 0), ("elapsed_us", "u32", elapsed_us)]
    calls.add(f"{name}.result", RESULT, message, head + reply_fields, request=number, sequence=0x0400 + message)


call("MakeSafe", 0x0001, [], [])
call("Abort", 0x0002, [("request", "u16", 0x2015)], [("was_running", "u8", 1)])
call("ModulePower", 0x0003, [("on", "u8", 1)], [("supply_uv", "u32", 5_012_345), ("supply_ua", "u32", 491_234)], 20_000)
RECORD = [
    ("index", "u16"),
    ("request", "u16"),
    ("message", "u16"),
    ("kind", "u16"),
    ("board_time_us", "u64"),
    ("place", "u32"),
    ("expected", "u32"),
    ("got", "u32"),
]
call(
    "ErrorRecords",
    0x0004,
    [("from", "u16", 3)],
    [("total", "u16", 5)]
    + many(
        "records",
        RECORD,
        [
            (3, 0x2015, 0x0015, 1, 81_000_123, 0x00012345, 0x0000AAAA, 0x0000AAA8),
            (4, 0x201E, 0x001E, 7, 82_000_456, 17, 0x5A, 0x100),
        ],
    ),
)
call(
    "LinkCounters",
    0x0005,
    [],
    [
        ("frames", "u32", 1001),
        ("bad_checksum", "u32", 2),
        ("malformed", "u32", 3),
        ("missing", "u32", 4),
        ("sent", "u32", 70_005),
    ],
)
call(
    "Identity",
    0x0010,
    [],
    [
        ("serial_number", "text", "GNC-2026-000123"),
        ("part", "text", "GNC-POP-26"),
        ("hardware", "text", "C"),
        ("firmware", "text", "2.1.0"),
        ("protocol", "u8", 1),
    ],
    1_500,
)
WORDS = [0x00000000, 0xFFFFFFFF, 0x55555555, 0x12345678]
call(
    "CpuWords",
    0x0011,
    [("core", "u8", 2), ("target", "u8", 1)] + many("words", "u32", WORDS),
    many("words", "u32", WORDS),
    40,
)
call(
    "CpuIntegers",
    0x0012,
    [("core", "u8", 1)]
    + many("pairs", [("a", "i32"), ("b", "i32")], [(7, -2), (-7, 2), (-(2**31), -1), (2**31 - 1, 2**31 - 1)]),
    many(
        "results",
        [("sum", "i32"), ("difference", "i32"), ("product", "i32"), ("quotient", "i32"), ("remainder", "i32")],
        [
            (5, 9, -14, -3, 1),
            (-5, -9, -14, -3, -1),
            (2**31 - 1, -(2**31) + 1, -(2**31), -(2**31), 0),
            (-2, 0, 1, 1, 0),
        ],
    ),
    12,
)
call(
    "CpuFloats",
    0x0013,
    [("core", "u8", 2)] + many("pairs", [("a", "f64"), ("b", "f64")], [(1.0, 3.0), (-2.5, 0.1)]),
    many(
        "results",
        [("sum", "f64"), ("difference", "f64"), ("product", "f64"), ("quotient", "f64")],
        [(4.0, -2.0, 3.0, 1.0 / 3.0), (-2.5 + 0.1, -2.5 - 0.1, -2.5 * 0.1, -2.5 / 0.1)],
    ),
    12,
)
call(
    "TimerMeasure",
    0x0014,
    [("timer", "u8", 2), ("period_us", "u32", 500), ("count", "u16", 3)],
    [("interrupts", "u16", 3)] + many("intervals_ns", "u32", [500_010, 499_990, 500_020]),
    1_502,
)
MISMATCH = [("words", "u32"), ("mismatches", "u32"), ("first_place", "u32"), ("expected", "u32"), ("got", "u32")]


def mismatch(*values):
    return [(name, kind, value) for (name, kind), value in zip(MISMATCH, values, strict=True)]


call(
    "RamTest",
    0x0015,
    [("ram", "u8", 1), ("pattern", "u8", 4)],
    mismatch(1_048_576, 3, 0x00054321, 0xFFFFFFFF, 0xFFFFFFEF),
    1_800_000,
)
call(
    "FlashId",
    0x0016,
    [("flash", "u8", 0)],
    [("jedec", "raw", b"\xef\x40\x18"), ("sector_bytes", "u32", 4096), ("scratch_sectors", "u16", 4)],
    90,
)
call("FlashErase", 0x0017, [("flash", "u8", 0), ("sector", "u16", 3)], [("duration_us", "u32", 45_200)], 45_230)
call("FlashBlankCheck", 0x0018, [("flash", "u8", 1), ("sector", "u16", 2)], mismatch(4096, 0, 0, 0, 0), 5_000)
call(
    "FlashWrite",
    0x0019,
    [("flash", "u8", 0), ("sector", "u16", 3), ("seed", "u32", 2463534242)],
    [("duration_us", "u32", 11_300)],
    11_340,
)
call(
    "FlashVerify",
    0x001A,
    [("flash", "u8", 0), ("sector", "u16", 3), ("seed", "u32", 2463534242)],
    mismatch(1024, 1, 2, 2064144800, 2064144801),
    5_000,
)
call(
    "AdRead",
    0x001B,
    [("channels", "u8", 0b1000_0001), ("samples", "u16", 100)],
    many(
        "channels",
        [("channel", "u8"), ("mean_uv", "i32"), ("min_uv", "i32"), ("max_uv", "i32")],
        [(1, 2_612_000, 2_611_000, 2_613_100), (8, -150, -900, 600)],
    ),
    10_000,
)
call("IoTest", 0x001C, [("driver", "u8", 0), ("reader", "u8", 3), ("level", "u8", 1)], [("levels", "u8", 0b1001)], 60)
call(
    "SpiTransfer",
    0x001D,
    [("direction", "u8", 1), ("clock_hz", "u32", 1_000_000), ("data", "block", b"\x00\x01\xfe\xff")],
    [("data", "block", b"\x00\x01\xfe\xff")],
    33,
)
call(
    "SciEcho",
    0x001E,
    [("rate_baud", "u32", 115_200), ("data", "block", bytes(range(256)))],
    [
        ("framing_errors", "u16", 1),
        ("parity_errors", "u16", 2),
        ("overruns", "u16", 3),
        ("data", "block", bytes(range(256))),
    ],
    22_300,
)
call("GnssRestart", 0x001F, [("start", "u8", 3)], [], 800)
call(
    "StreamStart",
    0x0020,
    [("stream", "u8", 1), ("rate_hz", "u16", 1000), ("count", "u32", 100_000), ("samples_per_frame", "u8", 10)],
    [("format", "u8", 1), ("samples_per_frame", "u8", 10), ("load_permille", "u16", 473)],
)
call("StreamStop", 0x0021, [("stream", "u8", 1)], [("produced", "u32", 100_000), ("dropped", "u32", 24)])

# ---------------------------------------------------------------------------------------------------- streams
streams = File("v1-streams.txt", "stream frames")


def head(stream, layout, count, first, board_time_us, dropped):
    return [
        ("stream", "u8", stream),
        ("format", "u8", layout),
        ("count", "u16", count),
        ("first", "u32", first),
        ("board_time_us", "u64", board_time_us),
        ("dropped", "u32", dropped),
    ]


def sample(number, gyro, accel, mag, temperatures):
    fields = []
    for what, values in (("gyro", gyro), ("accel", accel), ("mag", mag)):
        fields += [(f"[{number}].{what}.{axis}", "i32", value) for axis, value in zip("xyz", values, strict=True)]
    fields.append((f"[{number}].gyro_temperature", "i16", temperatures[0]))
    fields.append((f"[{number}].accel_temperature", "i16", temperatures[1]))
    return fields


streams.add(
    "imu.two-samples",
    STREAM,
    1,
    head(1, 1, 2, 70_000, 123_456_789, 24)
    + sample(0, (100, -200, 300), (-1600, 800, 160_000), (250_000, -125_000, 500_000), (2345, 2301))
    + sample(1, (101, -201, 299), (-1599, 801, 159_998), (250_010, -125_020, 500_030), (2345, -4000)),
    sequence=0x0100,
)
streams.add(
    "imu.saturated",
    STREAM,
    1,
    head(1, 1, 1, 0, 5_000_000, 0)
    + sample(0, (8_388_607, -8_388_608, 0), (8_388_607, -8_388_608, 0), (0, 0, 0), (32767, -32768)),
    sequence=0x0101,
)
NMEA = b"$GNGGA,063000.00,3957.0000,N,11619.0000,E,1,12,0.8,50.0,M,-9.0,M,,*7D\r\n"
streams.add("gnss.bytes", STREAM, 2, head(2, 2, len(NMEA), 4096, 6_000_000, 0) + [("bytes", "raw", NMEA)], sequence=0x0102)
streams.add(
    "pps.one-capture",
    STREAM,
    3,
    head(3, 3, 1, 7, 7_000_001, 0) + [("[0].board_time_ns", "u64", 7_000_001_230)],
    sequence=0x0103,
)

# --------------------------------------------------------------------------------------------------- stuffing
stuffing = File("v1-stuffing.txt", "payload sizes and byte stuffing")
UNUSED = 0x7F01  # an event id without a meaning: a frame that every receiver must read and pass over


def sized(name, payload, why=None, clean=False):
    """A frame whose header has no zero byte; `clean`: nor has its checksum, found by trying sequence numbers."""
    for sequence in range(0x0101, 0xFFFF):
        low, high = sequence & 0xFF, sequence >> 8
        header = struct.pack("<BBHHH", 0x16, 0x80, 0x0101, UNUSED, sequence)
        if low and high and (not clean or 0 not in struct.pack("<I", crc32c(header + payload))):
            break
    fields = [("bytes", "raw", payload)] if payload else []
    frame = stuffing.add(name, EVENT, UNUSED, fields, request=0x0101, sequence=sequence, flags=0x80, why=why)
    assert not clean or 0 not in frame


def counting(length):
    return bytes(1 + i % 255 for i in range(length))


for length in (0, 1, 2, 252, 253, 254, 255, 256, 508, 509, 510, 511, 512):
    sized(f"counting-{length}", counting(length))
for length in (240, 241, 242, 243, 244):
    sized(f"no-zero-{length}", counting(length), f"{length + 12} bytes without a 00: around one full run", clean=True)
for length in (495, 496, 497):
    sized(f"no-zero-{length}", counting(length), f"{length + 12} bytes without a 00: around two full runs", clean=True)
sized("zero-1", bytes(1))
sized("zeros-512", bytes(512), "as short as stuffing can be: every byte a code")
sized("zero-ends", counting(100) + b"\x00", "a 00 right before the checksum")
sized("zero-after-full-run", counting(246) + b"\x00" + counting(20), "254 bytes, then a 00: FF run, then code 01")
sized("zero-before-full-run", counting(245) + b"\x00" + counting(20), "253 bytes, then a 00: code FE")
sized("mixed-512", bytes((i * i) % 256 for i in range(512)), "many zeros among other bytes")
sized("ff-512", b"\xff" * 512, "data that looks like codes")

# ------------------------------------------------------------------------------------------------ calibration
# Rows are outputs, columns inputs; all of it in the order of the interface document.
KA = [[6.12e-05, -5e-08, 3e-08], [7e-08, 6.15e-05, -2e-08], [-4e-08, 6e-08, 6.14e-05]]
NABLA = [-0.049, 0.078, -0.059]
KG = [[8.71e-07, 1e-09, -2e-09], [-1.5e-09, 8.74e-07, 5e-10], [1e-09, 2e-09, 8.72e-07]]
EPSILON = [0.0014, -0.00087, 0.00105]
GAMMA = [[2.1e-05, -7e-06, 5e-06], [3e-06, -1.6e-05, 9e-06], [-5e-06, 7e-06, 1.8e-05]]
DX, DY, KY, SIN_ALPHA = 0.02, -0.014, 1.021, 0.0125


def flat(name, rows):
    return [(f"{name}[{r}][{c}]", "f64", value) for r, row in enumerate(rows) for c, value in enumerate(row)]


def three(name, values):
    return [(f"{name}[{i}]", "f64", value) for i, value in enumerate(values)]


CALIBRATION = (
    [("id", "u32", 7001)]
    + flat("accel_matrix", KA)
    + three("accel_offset", NABLA)
    + flat("gyro_matrix", KG)
    + three("gyro_offset", EPSILON)
    + flat("gyro_per_force", GAMMA)
    + [("mag_dx", "f64", DX), ("mag_dy", "f64", DY), ("mag_ky", "f64", KY), ("mag_sin_alpha", "f64", SIN_ALPHA)]
)
CALIBRATION_CRC = crc32c(b"".join(pack(kind, value) for _, kind, value in CALIBRATION))
calibrations = File("v1-calls-calibration.txt", "the requests about the module's calibration")


def calibration_call(name, message, request_fields, reply_fields, elapsed_us):
    number = 0x2000 + message
    calibrations.add(f"{name}.request", REQUEST, message, request_fields, request=number, sequence=0x0200 + message)
    head = [("status", "u16", 0), ("elapsed_us", "u32", elapsed_us)]
    calibrations.add(f"{name}.result", RESULT, message, head + reply_fields, request=number, sequence=0x0300 + message)


calibration_call("CalibrationWrite", 0x0023, CALIBRATION, [], 1_000)
calibration_call(
    "CalibrationCommit",
    0x0024,
    [("checksum", "u32", CALIBRATION_CRC)],
    [("counter", "u32", 3), ("duration_us", "u32", 121_345)],
    121_345,
)
calibration_call(
    "CalibrationRead",
    0x0025,
    [],
    [("state", "u8", 1), ("counter", "u32", 3), ("checksum", "u32", CALIBRATION_CRC), ("count of calibration", "u16", 1)]
    + CALIBRATION,
    1_000,
)
calibrations.add(
    "CalibrationRead.uncalibrated",
    RESULT,
    0x0025,
    [("status", "u16", 0), ("elapsed_us", "u32", 1_000), ("state", "u8", 0), ("counter", "u32", 0)]
    + [("checksum", "u32", 0), ("count of calibration", "u16", 0)],
    request=0x2026,
    sequence=0x0326,
)
calibrations.add(
    "nak.not-calibrated",
    NAK,
    0x0020,
    [("code", "u16", 10), ("text", "text", "write and commit a calibration first")],
    request=0x2027,
    sequence=0x0327,
)

# ------------------------------------------------------------------------------------------------ compensated
RAW = [(1_200_345, -15_678, 234), (1_234, -5_678, 160_321), (312_500, -187_500, 515_000), (2364, 2301)]


def product(matrix, vector):
    return [sum(k * v for k, v in zip(row, vector, strict=True)) for row in matrix]


def compensate(gyro, accel, mag):
    """The formulas of the interface document, section 10."""
    force = [a + b for a, b in zip(product(KA, accel), NABLA, strict=True)]
    swing = product(GAMMA, force)
    rate = [a - b - c for a, b, c in zip(product(KG, gyro), EPSILON, swing, strict=True)]
    x, y, z = (count / 1_250_000 for count in mag)
    y = KY * (y - DY)
    x = (x - DX - y * SIN_ALPHA) / math.sqrt(1 - SIN_ALPHA**2)
    return rate, force, [x, y, z], math.atan2(-y, x)


def compensated(number, gyro, accel, mag, temperatures):
    rate, force, field, roll = compensate(gyro, accel, mag)
    fields = []
    for what, values, scale in (("rate", rate, 1e8), ("force", force, 1e6), ("field", field, 1e7)):
        counts = [round(value * scale) for value in values]
        fields += [(f"[{number}].{what}.{axis}", "i32", count) for axis, count in zip("xyz", counts, strict=True)]
    saturated = sum(1 << i for i, c in enumerate((*gyro, *accel, *mag)) if c >= 8_388_607 or c <= -8_388_608)
    return fields + [
        (f"[{number}].roll", "i32", round(roll * 1e8)),
        (f"[{number}].saturated", "u16", saturated),
        (f"[{number}].gyro_temperature", "i16", temperatures[0]),
        (f"[{number}].accel_temperature", "i16", temperatures[1]),
    ]


SECOND = [(8_388_607, -15_700, 200), (1_240, -8_388_608, 160_300), (-312_500, 187_500, 515_000), (2364, -4000)]
more_streams = File("v1-streams-compensated.txt", "compensated samples, with the raw ones that they come from")
more_streams.add(
    "raw", STREAM, 1, head(1, 1, 2, 40, 123_456_789, 0) + sample(0, *RAW) + sample(1, *SECOND), sequence=0x0200
)
more_streams.add(
    "compensated",
    STREAM,
    4,
    head(4, 4, 2, 40, 123_456_789, 0) + compensated(0, *RAW) + compensated(1, *SECOND),
    sequence=0x0201,
    why="by the calibration of v1-calls-calibration.txt; of the second sample gyro x and accel y saturate",
)

# -------------------------------------------------------------------------------------------------------- CAN
more_calls = File("v1-calls-can.txt", "the request about the module's CAN controller")
more_calls.add("CanCounters.request", REQUEST, 0x0022, [], request=0x2022, sequence=0x0222)
more_calls.add(
    "CanCounters.result",
    RESULT,
    0x0022,
    [
        ("status", "u16", 0),
        ("elapsed_us", "u32", 1_000),
        ("state", "u8", 1),
        ("tx_errors", "u16", 136),
        ("rx_errors", "u16", 7),
        ("received", "u32", 216),
        ("echoed", "u32", 215),
    ],
    request=0x2022,
    sequence=0x0322,
)

CAN_HEAD = """\
# Wire vectors of protocol version 1 on CAN.
#
# Worked out by make_vectors.py from docs/ICD.md, independently of the Rust code. FROZEN: do not change a byte.
# A test that fails on one of these says that the program no longer speaks the protocol which boards in the field
# speak. Mend the program. Where the protocol itself must change, it gets a new version number and new files.
#
# A vector begins with "vector:". "message" is header, payload and checksum of what an ISO-TP transfer carries. "can"
# lines are frames in the order of the bus: > from the host, < from the board or module; id (3 digits standard, 8
# extended), data, both hexadecimal; "-" is no data. "slcan" lines are frames with their lines (the CR left out).
"""


class CanFile:
    def __init__(self, name):
        self.name = name
        self.text = CAN_HEAD
        self.names = set()

    def begin(self, name, why):
        assert name not in self.names
        self.names.add(name)
        self.text += f"\nvector: {name}\n  why: {why}\n"

    def can(self, way, ident, data):
        assert len(data) <= 8
        self.text += f"  can: {way} {ident} {data.hex() or '-'}\n"

    def slcan(self, ident, data):
        letter = "t" if len(ident) == 3 else "T"
        line = letter + ident.upper() + str(len(data)) + data.hex().upper()
        self.text += f"  slcan: {ident} {data.hex() or '-'} {line}\n"

    def message(self, name, why, way, out, back, frame):
        """A transfer to a receiver that asks for everything at once (block size 0, STmin 0)."""
        self.begin(name, why)
        self.text += f"  message: {frame.hex()}\n"
        other = "<" if way == ">" else ">"
        assert 8 <= len(frame) <= 4095  # no message of this protocol fits into a single frame
        self.can(way, out, bytes([0x10 | len(frame) >> 8, len(frame) & 0xFF]) + frame[:6])
        self.can(other, back, b"\x30\x00\x00")
        for number, at in enumerate(range(6, len(frame), 7), start=1):
            self.can(way, out, bytes([0x20 | number % 16]) + frame[at : at + 7])

    close = File.close


def frame_of(kind, message, payload, request=0, sequence=0, flags=0):
    header = struct.pack("<BBHHH", (0 if kind == HELLO else 1) << 4 | kind, flags, request, message, sequence)
    return header + payload + struct.pack("<I", crc32c(header + payload))


def payload_of(fields):
    return b"".join(pack(kind, value) for _, kind, value in fields)


bus = CanFile("v1-can.txt")
bus.message("hello.host", "urgent", ">", "020", "021", frame_of(HELLO, 0, payload_of(HOST_HELLO), request=1))
bus.message("hello.board", "urgent", "<", "021", "020", frame_of(HELLO, 0, payload_of(board_hello(1)), request=1))
bus.message("make-safe.request", "urgent", ">", "020", "021", frame_of(REQUEST, 0x0001, b"", request=0x0201))
bus.message("identity.request", "all other requests", ">", "100", "101", frame_of(REQUEST, 0x0010, b"", request=0x0202))
bus.message(
    "sci-echo.result",
    "256 bytes: the numbers of the consecutive frames pass F and go on with 0",
    "<",
    "101",
    "100",
    frame_of(
        RESULT,
        0x001E,
        struct.pack("<HIHHHH", 0, 2_800, 0, 0, 0, 256) + bytes(range(256)),
        request=0x0203,
    ),
)
bus.begin("keep-alive", "raw, without data")
bus.can(">", "010", b"")
bus.begin("heartbeat", "boot id B0071DEA, 0x010203040506 us, state 7; the first one since the board's start")
bus.can("<", "011", struct.pack("<BBIBB", 0, 1, 0xB007_1DEA, 7, 0))
bus.can("<", "011", struct.pack("<BB", 1, 1) + (0x0102_0304_0506).to_bytes(6, "little"))
bus.begin("watchdog", "raw")
bus.can("<", "011", b"\x02")


def sensor(number, values):
    """Ten bits of the sample's number, then three values of 18 bits, lowest bit first, as one number of 64 bits."""
    bits = f"{number % 1024:010b}"
    for counts in values:
        if counts >= 8_388_607:
            value = 131_071
        elif counts <= -8_388_608:
            value = -131_072
        else:
            value = min(max(counts // 64, -131_071), 131_070)
        bits = f"{value % 2**18:018b}" + bits
    assert len(bits) == 64
    return int(bits, 2).to_bytes(8, "little")


def imu(number, sample):
    for ident, values in zip(("200", "201", "202"), (sample[0:3], sample[3:6], sample[6:9]), strict=True):
        bus.can("<", ident, sensor(number, values))


bus.begin(
    "imu",
    "samples 1088 and 1089 at 1000 Hz, the first after a mark; gyro 1, -1, 0 deg/s, accel 0, -64, 160000 counts, mag at"
    " both ends and at -1; then gyro x, y 63, 64; temperatures 23.64 and -5.00 degC; 1,088,000 us, 3 dropped",
)
bus.can("<", "203", struct.pack("<Ihh", 1088, 2364, -500))
bus.can("<", "204", (1_088_000).to_bytes(6, "little") + struct.pack("<H", 3))
imu(1088, [20_000, -20_000, 0, 0, -64, 160_000, 8_388_607, -8_388_608, -1])
imu(1089, [63, 64, 0, 8_388_606, -8_388_607, 160_063, 1, 2, 3])
bus.begin("gnss", "bytes 65530 to 65538 of the stream, at 0x0000000F4240 us")
bus.can("<", "211", (1_000_000).to_bytes(6, "little") + struct.pack("<H", 65_530))
bus.can("<", "210", struct.pack("<H", 65_530) + b"$GPGGA")
bus.can("<", "210", struct.pack("<H", 0) + b",1\r")
bus.begin("pps", "the first two captures of a stream: 1.23456789 s and 2.23456788 s of board time")
bus.can("<", "212", (1_234_567_890 << 8 | 0).to_bytes(8, "little"))
bus.can("<", "212", (2_234_567_880 << 8 | 1).to_bytes(8, "little"))
bus.begin("echo", "test frames and what the module sends back")
for ident, back, data in (
    ("700", "710", b""),
    ("70f", "71f", b"\x55\xaa\x55"),
    ("1abc0000", "1abd0000", b"\x00"),
    ("1abcffff", "1abdffff", bytes(range(1, 9))),
):
    bus.can(">", ident, data)
    bus.can("<", back, data)
bus.begin("slcan", "the same frames as lines")
for ident, data in (
    ("000", b""),
    ("7ff", b"\x00\xff"),
    ("101", b"\x30\x00\x00"),
    ("00000000", b"\x5a"),
    ("1fffffff", bytes.fromhex("0123456789abcdef")),
):
    bus.slcan(ident, data)

more_bus = CanFile("v1-can-compensated.txt")
more_bus.begin(
    "compensated",
    "samples 8256 (64 mod 8192) and 8257 at 200 Hz of board time 41,285,000 us, 2 dropped before: those of"
    " v1-streams-compensated.txt",
)
more_bus.can("<", "221", struct.pack("<II", 8256, 2))
more_bus.can("<", "222", struct.pack("<Q", 41_285_000))
for number, raw in ((8256, RAW), (8257, SECOND)):
    sample_bytes = payload_of(compensated(0, *raw))
    assert len(sample_bytes) == 46
    for place in range(8):
        ahead = struct.pack("<H", number % 8192 * 8 + place)
        more_bus.can("<", "220", ahead + sample_bytes[6 * place : 6 * place + 6])

FILES = (session, calls, streams, stuffing, more_calls, bus, calibrations, more_streams, more_bus)

if __name__ == "__main__":
    sys.exit(0 if all([f.close() for f in FILES]) else 1)
