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


def sirf(payload):
    """A frame of SiRF binary."""
    total = sum(payload) & 0x7FFF
    return b"\xa0\xa2" + struct.pack(">H", len(payload)) + payload + struct.pack(">H", total) + b"\xb0\xb3"


def rtcm(payload):
    """A frame of RTCM 3."""
    frame = b"\xd3" + struct.pack(">H", len(payload)) + payload
    crc = 0
    for byte in frame:
        crc ^= byte << 16
        for _ in range(8):
            crc = (crc << 1) ^ (0x1864CFB if crc & 0x800000 else 0)
    return frame + crc.to_bytes(3, "big")


PLACE = angle(LATITUDE_DEG, 2, "NS") + "," + angle(LONGITUDE_DEG, 3, "EW")
ABOVE_SEA_M = HEIGHT_M - GEOID_M
GPS = "GPGSA,A,3,02,05,07,11,13,15,18,20,26,29,,,1.80,0.90,1.50"


def rmc(at, talker="GP", status="A", mode="A", place=PLACE):
    return sentence(f"{talker}RMC,{at:%H%M%S}.00,{status},{place},0.02,,{at:%d%m%y},,,{mode}")


def gga(at, talker="GP", quality=1, used="10", place=PLACE, geoid=f"{GEOID_M:.1f}", end="", time=None):
    time = time or f"{at:%H%M%S}.00"
    return sentence(f"{talker}GGA,{time},{place},{quality},{used},0.90,{ABOVE_SEA_M:.1f},M,{geoid},M,,{end}")


def plain(at):
    return rmc(at) + gga(at) + sentence(GPS)


def every_fifth():
    return "".join(rmc(at) + gga(at) + (sentence(GPS) if index % 5 == 2 else "") for index, at in enumerate(seconds(16)))


def several_systems():
    """Satellites of four systems, one of which has no fix of its own; GGA counts to 12 only, and GSA to 16."""
    active = (sentence("GNGSA,A,3,02,05,07,11,13,15,18,20,26,29,,,1.80,0.90,1.50,1")
              + sentence("GNGSA,A,3,68,69,83,84,,,,,,,,,1.80,0.90,1.50,2")
              + sentence("GNGSA,A,1,,,,,,,,,,,,,99.99,99.99,99.99,3")
              + sentence("GNGSA,A,3,12,34,,,,,,,,,,,1.80,0.90,1.50,4"))
    return "".join(rmc(at, "GN") + gga(at, "GN", used="12") + active for at in seconds(12))


def each_system():
    """A solution of each system and the combined one, all of one time."""
    return "".join(gga(at, "GP", used="07") + gga(at, "GL", used="05") + gga(at, "GN", used="12") + sentence(GPS)
                   + rmc(at, "GN") for at in seconds(12))


def mixed_protocols():
    """Frames of three other protocols between the sentences; in the payload of one stands a sentence's beginning."""
    frame = bytes((37 * index + 5) % 256 for index in range(60)) + b"$GPGGA,06"
    return b"".join(nav_pvt(at) + rmc(at).encode() + sirf(frame) + gga(at).encode() + rtcm(frame)
                    + sentence(GPS).encode() for at in seconds(12))


def gns(at):
    body = f"GNGNS,{at:%H%M%S}.00,{PLACE},AAN,10,0.90,{ABOVE_SEA_M:.1f},{GEOID_M:.1f},,,V"
    return rmc(at, "GN") + sentence(body) + sentence(GPS)


def long_sentences():
    """GGA with a name of the reference station of 200 characters."""
    return "".join(rmc(at) + gga(at, quality=2, end="0" * 200) + sentence(GPS) for at in seconds(12))


def leap_second():
    """Into 2027 with a leap second."""
    said = []
    for time, day in [("235956", "311226"), ("235957", "311226"), ("235958", "311226"), ("235959", "311226"),
                      ("235960", "311226"), ("000000", "010127"), ("000001", "010127"), ("000002", "010127")]:
        said.append(sentence(f"GPRMC,{time},A,{PLACE},0.02,,{day},,,A") + gga(START, time=time) + sentence(GPS))
    return "".join(said)


def other_date_before():
    """Another date, and no fix, for two seconds."""
    other = datetime(2006, 12, 16)
    return "".join(epoch(other, fix=False) for _ in range(2)) + "".join(plain(at) for at in seconds(12))


def dead_reckoning():
    return "".join(rmc(at, mode="E") + gga(at, quality=6, used="00") + sentence("GPGSA,A,1,,,,,,,,,,,,,,,")
                   for at in seconds(45))


def mixed_talkers():
    """What marine receivers, transponders and makers say beside."""
    others = ("\\s:GP0001*5F\\" + sentence("HEHDT,123.4,T") + sentence("IIVHW,,T,,M,05.1,N,,K")
              + "!AIVDM,1,1,,A,15M67FC000G?ufbE`FepT@3n00Sa,0*5F\r\n" + sentence("PGRME,15.0,M,22.5,M,15.0,M")
              + sentence("PMTK001,604,3") + sentence("GNTXT,01,01,02,ANTSTATUS=OK") + sentence("GPGSV,1,1,00"))
    return "".join(plain(at) + others for at in seconds(12))


def without_checksums(text):
    return "".join(line.split("*")[0] + "\r\n" for line in text.splitlines())


def lower_checksums(text):
    """Checksums in small letters, lines that end by LF alone."""
    return "".join(line[:-2] + line[-2:].lower() + "\n" for line in text.splitlines())


def gll_alone():
    return "".join(sentence(f"GPGLL,{PLACE},{at:%H%M%S}.00,A,A") for at in seconds(24))


def five_hz():
    """Five epochs a second, two decimals in one sentence and three in the other, GSA with each fifth."""
    said = []
    for index in range(60):
        at = START + timedelta(seconds=index / 5)
        part = at.microsecond // 1000
        said.append(sentence(f"GPRMC,{at:%H%M%S}.{part:03d},A,{PLACE},0.02,,{at:%d%m%y},,,A")
                    + gga(at, time=f"{at:%H%M%S}.{part // 10:02d}") + (sentence(GPS) if index % 5 == 0 else ""))
    return "".join(said)


def each(said):
    return "".join(said(at) for at in seconds(12))


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
    north, east = PLACE.split(",N,")
    yield "no-gsa.nmea", each(lambda at: rmc(at) + gga(at, quality=4))
    yield "gsa-every-5th-epoch.nmea", every_fifth()
    yield "gsa-of-each-system.nmea", several_systems()
    yield "gga-of-each-system.nmea", each_system()
    yield "gsa-2d.nmea", each(lambda at: rmc(at) + gga(at) + sentence("GPGSA,A,2,02,05,07,11,13,15,,,,,,,,0.90,"))
    yield "mixed-protocols.bin", mixed_protocols()
    yield "gns.nmea", each(gns)
    yield "long-sentences.nmea", long_sentences()
    yield "minutes-of-73.nmea", each(lambda at: rmc(at) + gga(at, place=f"3473.92600,N,{east}") + sentence(GPS))
    yield "longitude-of-4-digits.nmea", each(lambda at: rmc(at) + gga(at, place=f"{north},N,{east[1:]}") + sentence(GPS))
    yield "rmc-void.nmea", "".join(rmc(at, status="V", mode="N") + gga(at) + sentence(GPS) for at in seconds(45))
    yield "leap-second.nmea", leap_second()
    yield "date-before-fix.nmea", other_date_before()
    yield "dead-reckoning.nmea", dead_reckoning()
    yield "mixed-talkers.nmea", mixed_talkers()
    yield "ends-by-cr.nmea", each(plain).replace("\r\n", "\r")
    yield "ends-by-lf.nmea", lower_checksums(each(plain))
    yield "without-checksums.nmea", without_checksums(each(plain))
    yield "no-geoid.nmea", each(lambda at: rmc(at) + gga(at, geoid="") + sentence(GPS))
    yield "gll-alone.nmea", gll_alone()
    yield "five-hz.nmea", five_hz()


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
