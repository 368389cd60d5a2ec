#!/usr/bin/env python3
"""Makes the receivers' logs beside it: what a receiver at the simulated bench's antenna could say on a bad day.

Python, so that the sentences come from other hands than those that the simulated receiver and the station have. The
position is that of hw-mocks/bench.toml. Run it after a change and commit what it writes; a test compares the two.
"""
import math
import pathlib
import random
import struct
import sys
from datetime import datetime, timedelta

LATITUDE_DEG, LONGITUDE_DEG, HEIGHT_M = 34.2321, 108.9154, 412.0
GEOID_M = -30.0
START = datetime(2026, 11, 22, 6, 30, 15)
METRES_PER_DEG = 111_000.0


def sentence(body):
    checksum = 0
    for byte in body.encode():
        checksum ^= byte
    return f"${body}*{checksum:02X}\r\n"


def angle(deg, digits, hemispheres):
    whole, minutes = divmod(abs(deg) * 60.0, 60.0)
    return f"{int(whole):0{digits}d}{minutes:08.5f},{hemispheres[deg < 0]}"


def epoch(at, fix=True, clock=True, north_m=0.0, east_m=0.0, up_m=0.0, hdop=0.9):
    """RMC, GGA and GSA of a moment."""
    time = at.strftime("%H%M%S.00") if clock else ""
    date = at.strftime("%d%m%y") if clock else ""
    if not fix:
        return (sentence(f"GPRMC,{time},V,,,,,,,{date},,,N")
                + sentence(f"GPGGA,{time},,,,,0,00,99.99,,M,,M,,")
                + sentence("GPGSA,A,1,,,,,,,,,,,,,99.99,99.99,99.99"))
    latitude_deg = LATITUDE_DEG + north_m / METRES_PER_DEG
    longitude_deg = LONGITUDE_DEG + east_m / METRES_PER_DEG / math.cos(math.radians(LATITUDE_DEG))
    place = angle(latitude_deg, 2, "NS") + "," + angle(longitude_deg, 3, "EW")
    above_sea_m = HEIGHT_M + up_m - GEOID_M
    return (sentence(f"GPRMC,{time},A,{place},0.02,,{date},,,A")
            + sentence(f"GPGGA,{time},{place},1,10,{hdop:.2f},{above_sea_m:.1f},M,{GEOID_M:.1f},M,,")
            + sentence(f"GPGSA,A,3,02,05,07,11,13,15,18,20,26,29,,,1.80,{hdop:.2f},1.50"))


def seconds(count, begin=0):
    return [START + timedelta(seconds=second) for second in range(begin, begin + count)]


def checksum_noise():
    """Of every third epoch one digit of RMC is another one."""
    dice = random.Random(7)
    said = []
    for index, at in enumerate(seconds(12)):
        text = list(epoch(at))
        if index % 3 == 2:
            digits = [place for place, character in enumerate(text[:60]) if character.isdigit()]
            place = dice.choice(digits)
            text[place] = str((int(text[place]) + 1) % 10)
        said.append("".join(text))
    return "".join(said)


def accuracy_15_m():
    """Fifteen metres from the antenna in all directions, one after the other; the receiver calls it a 3D fix."""
    said = []
    for index, at in enumerate(seconds(80)):
        bearing = math.radians(index * 137.5)
        said.append(epoch(at, north_m=15.0 * math.cos(bearing), east_m=15.0 * math.sin(bearing)))
    return "".join(said)


def ubx(kind, payload):
    body = struct.pack("<BBH", *kind, len(payload)) + payload
    a = b = 0
    for byte in body:
        a = (a + byte) & 0xFF
        b = (b + a) & 0xFF
    return b"\xb5\x62" + body + bytes((a, b))


def nav_pvt(at):
    """UBX-NAV-PVT of a 3D fix (u-blox M8 receiver description, 32.17.15)."""
    head = struct.pack("<IHBBBBBBIi", 0, at.year, at.month, at.day, at.hour, at.minute, at.second, 0x37, 25, 0)
    fix = struct.pack("<BBBB", 3, 1, 0, 10)
    place = struct.pack("<iiiiII", round(LONGITUDE_DEG * 1e7), round(LATITUDE_DEG * 1e7), round(HEIGHT_M * 1e3),
                        round((HEIGHT_M - GEOID_M) * 1e3), 1500, 2500)
    rest = struct.pack("<iiiiiIIH6sihH", 0, 0, 0, 0, 0, 50, 100_000, 180, bytes(6), 0, 0, 0)
    payload = head + fix + place + rest
    assert len(payload) == 92
    return ubx((1, 7), payload)


def garbage():
    """Bytes of any kind, with line ends among them, as a receiver at another rate seems to say."""
    dice = random.Random(11)
    return bytes(dice.randrange(256) for _ in range(6000))


def logs():
    early = timedelta(days=1024 * 7)
    yield "clean.nmea", "".join(epoch(at) for at in seconds(12))
    yield "no-fix.nmea", "".join(epoch(at, fix=False) for at in seconds(45))
    yield "lost-fix.nmea", "".join(epoch(at, fix=index in (1, 2)) for index, at in enumerate(seconds(12)))
    yield "cold-boot.nmea", ("".join(epoch(at, fix=False, clock=index > 12) for index, at in enumerate(seconds(28)))
                             + "".join(epoch(at) for at in seconds(8, 28)))
    yield "week-rollover.nmea", "".join(epoch(at - early) for at in seconds(12))
    yield "checksum-noise.nmea", checksum_noise()
    yield "wrong-hemisphere.nmea", "".join(epoch(at).replace(",N,", ",S,") for at in seconds(12))
    yield "repeated-epoch.nmea", epoch(START) * 12
    yield "fix-of-15-m.nmea", accuracy_15_m()
    yield "binary-garbage.bin", garbage()
    yield "only-ubx.ubx", b"".join(nav_pvt(at) for at in seconds(12))


def resealed(text):
    """The hemisphere was changed under the checksum: a receiver that means it has a good one."""
    return "".join(sentence(line[1:].split("*")[0]) for line in text.splitlines())


def main():
    folder = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).parent
    for name, log in logs():
        if name == "wrong-hemisphere.nmea":
            log = resealed(log)
        (folder / name).write_bytes(log if isinstance(log, bytes) else log.encode())


main()
