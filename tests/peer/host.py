#!/usr/bin/env python3
"""A host written from docs/ICD.md alone, sharing no code with the programs of this repository.

Usage: python3 host.py PATH_TO_BOARD_PROGRAM

Starts the board program, talks to it over its pseudo-terminal, prints a line per check. Every wait has a deadline.
"""
import math, os, random, select, struct, subprocess, sys, termios, time, tty
from collections import namedtuple

HELLO, REQUEST, ACCEPT, PROGRESS, RESULT, STREAM, EVENT, NAK = range(8)                         # kinds
MAKE_SAFE, POWER, COUNTERS, IDENTITY, WORDS, INTEGERS, FLOATS, TIMER = 1, 3, 5, 0x10, 0x11, 0x12, 0x13, 0x14
STREAM_START, STREAM_STOP, HEARTBEAT, KEEP_ALIVE, WATCHDOG = 0x20, 0x21, 1, 2, 3                # messages, events
RESENT, REPLAYED = 1, 2                                                                         # flags
Frame = namedtuple('Frame', 'at version kind flags rid mid seq payload')
Hello = namedtuple('Hello', 'magic chosen lowest highest nonce boot capabilities serial firmware')

def crc32c(data):
    r = 0xFFFFFFFF
    for byte in data:
        r ^= byte
        for _ in range(8):
            r = r >> 1 ^ (0x82F63B78 if r & 1 else 0)
    return r ^ 0xFFFFFFFF

def stuff(data):
    out, rest = bytearray(), data + b'\0'               # "as if one more 00 stood behind its end"
    while rest:
        run = rest[:rest.index(0)][:254]
        out += bytes([len(run) + 1]) + run
        rest = rest[len(run) + (len(run) < 254):]       # a 00 is skipped, but none stands behind a full run
    return bytes(out)

def unstuff(data):
    out, at = bytearray(), 0
    while at < len(data):
        code = data[at]
        if at + code > len(data):
            raise ValueError('a run is cut short')
        out += data[at + 1:at + code]
        at += code
        if code < 0xFF and at < len(data):
            out.append(0)
    return bytes(out)

def wire(kind, rid, mid, seq, payload=b'', flags=0, version=1, spoil=0):
    data = struct.pack('<BBHHH', (version if kind else 0) << 4 | kind, flags, rid, mid, seq) + payload
    return b'\0' + stuff(data + struct.pack('<I', crc32c(data) ^ spoil)) + b'\0'

def text(data):
    return data[1:1 + data[0]].decode(), data[1 + data[0]:]

def listing(form, items):
    return struct.pack('<H', len(items)) + b''.join(struct.pack('<' + form, *i) for i in items)

class Host:
    def __init__(self, port):
        self.fd = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.fd, termios.TCSANOW)              # what has come already is not thrown away
        self.seq, self.rid, self.sent = random.randrange(65536), random.randrange(1, 60000), 0
        self.raw, self.log, self.rubbish = bytearray(), [], 0
        self.next_alive = math.inf                      # when the next keep-alive is due; never: silence
        self.end = time.monotonic() + 60                # the whole run takes no longer

    def send(self, kind, rid=0, mid=0, payload=b'', **more):
        os.write(self.fd, wire(kind, rid, mid, self.seq, payload, **more))
        self.seq, self.sent = (self.seq + 1) & 0xFFFF, self.sent + 1

    def pump(self, until):
        """Reads once, waiting until `until` at the latest; keeps the session alive."""
        now = time.monotonic()
        assert now < self.end, 'the whole run takes too long'
        if now >= self.next_alive:
            self.next_alive = now + 0.5
            self.send(EVENT, 0, KEEP_ALIVE)
        if select.select([self.fd], [], [], max(0, min(until, self.next_alive) - now))[0]:
            *whole, rest = (bytes(self.raw) + os.read(self.fd, 4096)).split(b'\0')
            self.raw = rest
            for stuffed in filter(None, whole):
                self.take(stuffed)

    def take(self, stuffed):
        try:
            data = unstuff(stuffed)
            if not 12 <= len(data) <= 524 or crc32c(data[:-4]) != struct.unpack('<I', data[-4:])[0]:
                raise ValueError('no frame')
        except ValueError:
            self.rubbish += 1
            return
        first, *header = struct.unpack('<BBHHH', data[:8])
        self.log.append(Frame(time.monotonic(), first >> 4, first & 15, *header, data[8:-4]))

    def wait(self, wanted, seconds, since):
        """The first frame from place `since` of the log on that is wanted; None when the time is over."""
        limit, over = time.monotonic() + seconds, False
        while True:
            for since in range(since, len(self.log)):
                if wanted(self.log[since]):
                    return self.log[since]
            since = len(self.log)
            if over:
                return None
            over = time.monotonic() >= limit            # then one last look at what has come
            self.pump(limit)

    def listen(self, seconds, since):
        """Everything but events from place `since` on, having listened on for so long."""
        self.wait(lambda f: False, seconds, len(self.log))
        return [f for f in self.log[since:] if f.kind != EVENT]

    def event(self, mid, seconds):
        return self.wait(lambda f: (f.kind, f.mid) == (EVENT, mid), seconds, len(self.log))

    def beats(self):
        return [(f.at, *struct.unpack('<IQB', f.payload)) for f in self.log if (f.kind, f.mid) == (EVENT, HEARTBEAT)]

    def hello(self, nonce, low=1, high=1):
        self.rid, since = self.rid + 1, len(self.log)
        for _ in range(9):                              # every 250 ms for 2 s or more
            self.send(HELLO, self.rid, 0, b'GNCT' + struct.pack('<BBI', low, high, nonce))
            answer = self.wait(lambda f: (f.kind, f.rid, f.mid, f.version) == (HELLO, self.rid, 0, 0), 0.25, since)
            if answer:
                serial, rest = text(answer.payload[19:])
                said = Hello(*struct.unpack('<4sBBBIII', answer.payload[:19]), serial, text(rest)[0])
                assert (said.magic, said.nonce, text(rest)[1]) == (b'GNCT', nonce, b''), said
                return said
        raise TimeoutError('no answer to HELLO')

    def ask(self, mid, payload=b'', rid=None, **more):
        """A request through its life: its last frame, RESULT or NAK."""
        if rid is None:
            rid = self.rid = self.rid + 1
        since, mine = len(self.log), lambda f: ACCEPT <= f.kind != STREAM and (f.rid, f.mid) == (rid, mid)
        for attempt in range(4):                        # once, and sent again three times
            self.send(REQUEST, rid, mid, payload, **{'flags': RESENT if attempt else 0, **more})
            seen = self.wait(mine, 0.5, since)
            while seen:
                if seen.kind in (RESULT, NAK):
                    return seen
                since = self.log.index(seen, since) + 1
                seen = self.wait(mine, 1.5, since)
        raise TimeoutError(f'message {mid:#x}: no answer')

    def body(self, mid, payload=b''):
        last = self.ask(mid, payload)
        code = int.from_bytes(last.payload[:2], 'little')
        assert (last.kind, code) == (RESULT, 0), f'message {mid:#x}: kind {last.kind}, NAK code or status {code}'
        return last.payload[6:]

    def nak(self, mid, payload=b'', **more):
        last = self.ask(mid, payload, **more)
        return int.from_bytes(last.payload[:2], 'little') if last.kind == NAK else None

    def twice(self, mid, payload, between=lambda: None):
        """The same request twice in one breath: what came of it."""
        self.rid, since = self.rid + 1, len(self.log)
        for flags in (0, RESENT):
            self.send(REQUEST, self.rid, mid, payload, flags=flags)
        between()
        self.wait(lambda f: f.kind == RESULT and f.rid == self.rid, 3, since)
        return self.listen(0.15, since)

results = []

def check(what, good, shown=''):
    results.append(bool(good))
    print(f'{"ok  " if good else "FAIL"} {what}{": " if str(shown) else ""}{shown}', flush=True)

def sessions(host):
    hand = bytes.fromhex('00010102010101010 10F474E4354010178563412 4E0FAF8800'.replace(' ', ''))
    check('CRC, COBS and HELLO as worked by hand', crc32c(b'123456789') == 0xE3069283 and
          wire(HELLO, 1, 0, 0, b'GNCT\1\1\x78\x56\x34\x12') == hand and stuff(unstuff(hand[1:-1])) == hand[1:-1])
    check('REQUEST without a session: NAK 1', host.nak(IDENTITY) == 1)
    none = host.hello(0x0BADF00D, 2, 9)
    check('HELLO for versions 2..9 only: chosen 0', none.chosen == 0, f'board speaks {none.lowest}..{none.highest}')
    check('... and opens no session', host.nak(IDENTITY) == 1)
    host.nonce = random.getrandbits(32)
    host.hello(host.nonce)
    check('... and ends an open one, also under its nonce', host.nak(IDENTITY) == 6 and
          host.hello(host.nonce, 2, 9).chosen == 0 and host.nak(IDENTITY) == 1)
    check('HELLO for versions 2..1: an empty range, chosen 0', host.hello(host.nonce, 2, 1).chosen == 0)
    host.board = host.hello(host.nonce)
    host.next_alive = 0
    check('HELLO', host.board.chosen == 1, '{7}, firmware {8}, boot id {5:#010x}'.format(*host.board))

def identity(host):
    check('Identity without power: NAK 6', host.nak(IDENTITY) == 6)
    volts, amperes = struct.unpack('<II', host.body(POWER, b'\1'))
    check('power on', 4_500_000 <= volts <= 5_500_000 and amperes, f'{volts / 1e6:.3f} V, {amperes / 1e6:.3f} A')
    check('HELLO with the same nonce changes nothing', host.hello(host.nonce) == host.board)
    strings, rest = [], host.body(IDENTITY)
    for _ in range(4):
        string, rest = text(rest)
        strings.append(string)
    check('Identity, still powered', len(rest) == 1 and all(strings), f'{", ".join(strings)}; protocol {rest[0]}')

def cpu(host):
    draw = random.Random(1)
    words = [(0,), (0xFFFFFFFF,), (0x55555555,)] + [(draw.getrandbits(32),) for _ in range(61)]
    solid = [(word | 0x01010101,) for word, in words]   # no zero byte: a full run of 254 on the line
    whole = [(-2**31, -1), (2**31 - 1, 2**31 - 1), (-7, 2), (7, -2), (-7, -2), (0, 5)]
    whole += [(draw.randrange(-2**31, 2**31), draw.randrange(1, 2**31) >> draw.randrange(31) or -1) for _ in range(10)]
    real = [(1.0, 3.0), (0.1, 0.2), (-0.0, 1.0), (1e308, 1e308), (5e-324, 2.0), (2.0**53, 1.0), (1e308, 1e-308)]
    real += [(draw.gauss(0, 1) * 10.0**draw.randrange(-99, 99), draw.gauss(0, 1)) for _ in range(8)]
    low = lambda n: (n + 2**31) % 2**32 - 2**31
    cut = lambda a, b: abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)
    sums = [(low(a + b), low(a - b), low(a * b), low(cut(a, b)), a - b * cut(a, b)) for a, b in whole]
    for core in (1, 2):
        for target, name, sent in ((0, 'registers', words), (1, 'memory', words), (1, 'memory, no zero byte', solid)):
            got = host.body(WORDS, bytes([core, target]) + listing('I', sent))
            check(f'core {core}: {len(sent)} words in {name}', got == listing('I', sent))
        got = host.body(INTEGERS, bytes([core]) + listing('ii', whole))
        check(f'core {core}: {len(whole)} pairs of integers', got == listing('5i', sums))
        got = host.body(FLOATS, bytes([core]) + listing('dd', real))
        check(f'core {core}: {len(real)} pairs of floats, bit by bit',
              got == listing('4d', [(a + b, a - b, a * b, a / b) for a, b in real]))
    check('division by -0.0: NAK 4', host.nak(FLOATS, b'\1' + listing('dd', [(1.0, -0.0)])) == 4)
    check('no pairs, no results', host.body(INTEGERS, b'\1\0\0') == host.body(FLOATS, b'\1\0\0') == b'\0\0')

def again(host):
    pair, since = b'\1' + listing('ii', [(41, 1)]), len(host.log)
    fresh = host.ask(INTEGERS, pair)
    replay = host.ask(INTEGERS, pair, rid=fresh.rid, flags=RESENT)
    came = [f.kind for f in host.listen(0.15, since)]
    check('same id after the RESULT: replayed, same payload, no ACCEPT', came == [ACCEPT, RESULT, RESULT] and
          (fresh.flags, replay.flags) == (0, REPLAYED) and replay.payload == fresh.payload)
    other = host.ask(INTEGERS, b'another payload', rid=fresh.rid)
    check('... whatever payload it comes with', (other.flags, other.payload) == (REPLAYED, fresh.payload))
    came = [(f.kind, f.flags) for f in host.twice(INTEGERS, pair)]
    check('same id twice in one breath, CpuIntegers: carried out once',     # the first may have ended already, or not
          came in ([(ACCEPT, 0), (RESULT, 0), (RESULT, REPLAYED)], [(ACCEPT, 0), (ACCEPT, 0), (RESULT, 0)]), came)
    came = host.twice(TIMER, struct.pack('<BIH', 1, 100_000, 5), lambda: host.send(REQUEST, host.rid, IDENTITY))
    other, came = [f for f in came if f.mid == IDENTITY], [f for f in came if f.mid == TIMER]
    check('same id twice, TimerMeasure of 0.5 s: two equal ACCEPTs, PROGRESS, one RESULT',
          [f.kind for f in came] == [ACCEPT, ACCEPT, PROGRESS, RESULT] and came[0].payload == came[1].payload)
    check('... and its id under another message: NAK 4', [(f.kind, f.payload[:2]) for f in other] == [(NAK, b'\4\0')])

def stream(host):
    since, rate, total = len(host.log), 200, 100
    form, per_frame, load = struct.unpack('<BBH', host.body(STREAM_START, struct.pack('<BHIB', 1, rate, total, 7)))
    check('IMU stream starts', (form, per_frame) == (1, 7), f'{load} thousandths of the line')
    parts = lambda f: struct.unpack('<BBHIQI', f.payload[:20])
    host.wait(lambda f: f.kind == STREAM and sum(parts(f)[2:4]) >= total, 3, since)
    frames = [f for f in host.listen(0.1, since) if f.kind == STREAM]       # nothing may come behind the last one
    samples, starts, lags, good, clock = [], [], [], True, min(at - board / 1e6 for at, _, board, _ in host.beats())
    for f in frames:
        number, form, count, first, board, dropped = parts(f)
        good &= (number, form, first, dropped, f.rid, f.mid) == (1, 1, len(samples), 0, 0, 1)
        samples += struct.iter_unpack('<9i2h', f.payload[20:])
        starts.append(board - first * 1_000_000 // rate)
        lags.append(f.at - clock - board / 1e6 - (count - 1) / rate)
    closed = struct.unpack('<II', host.body(STREAM_STOP, b'\1'))
    check(f'{total} samples at {rate} Hz, account closed', len(samples) == total and closed == (total, 0), closed)
    check('numbers without gaps, 7 a frame', good and [parts(f)[2] for f in frames] == [7] * 14 + [2])
    check('board times: 5 ms a sample, in step with the heartbeat', max(starts) - min(starts) <= 1 and
          all(-0.05 < lag < 0.5 for lag in lags), f'frames came up to {max(lags) * 1e3:.0f} ms late')
    norms = [math.hypot(*s[3:6]) / 160_000 for s in samples]
    check('specific force of about 1 g', all(0.9 < g < 1.1 for g in norms), f'{min(norms):.4f}..{max(norms):.4f} g')

def account(host):
    for mid, payload, name in ((POWER, b'\0', 'power off'), (MAKE_SAFE, b'', 'MAKE_SAFE')):
        host.body(POWER, b'\1')
        since = len(host.log)
        host.body(STREAM_START, struct.pack('<BHIB', 1, 1000, 0, 12))
        host.listen(0.3, since)
        last = host.ask(mid, payload)
        end = len(host.log)
        produced, dropped = struct.unpack('<II', host.body(STREAM_STOP, b'\1'))
        host.listen(0.1, since)
        streamed = [n for n, f in enumerate(host.log) if n >= since and f.kind == STREAM]
        received = sum(struct.unpack('<H', host.log[n].payload[2:4])[0] for n in streamed)
        check(f'stream ended by {name}: produced = received + dropped, nothing comes behind the RESULT',
              (last.kind, last.payload[:2]) == (RESULT, b'\0\0') and received >= 100 and produced == received + dropped
              and streamed[-1] < host.log.index(last) < end, f'{produced} = {received} + {dropped}')
        # With the unfinished frame go those that wait for the line: three of them, where this computer was held up.
        check('... and the samples of the unfinished frame ' + ('left before it' if mid == POWER else 'are dropped'),
              dropped == 0 if mid == POWER else received % 12 == 0 and dropped < 4 * 12, f'{received} + {dropped}')
    host.body(POWER, b'\1')

def rubbish(host):
    sent, since = host.sent, len(host.log)
    before = struct.unpack('<5I', host.body(COUNTERS))
    accept = next(f for f in host.log[since:] if f.kind == ACCEPT)
    check('LinkCounters counts its own REQUEST and ACCEPT, not its RESULT',
          before[0] == sent + 1 and before[4] - accept.seq in (1, 2), f'{before[0]} and {before[4]}')   # 2: a heartbeat
    since = len(host.log)
    host.send(REQUEST, host.rid + 1, IDENTITY, spoil=0x00010000)
    check('a frame with a broken CRC is ignored', host.listen(0.2, since) == [])
    check('... and the next good one answered', host.body(IDENTITY))
    os.write(host.fd, b'\x09\x12\x34\0')                # a run that is cut short
    more = [b - a for a, b in zip(before, struct.unpack('<5I', host.body(COUNTERS)))]
    check('the board counts 1 wrong checksum, 1 malformed, 1 missing', more[1:4] == [1, 1, 1])
    host.send(9)                                        # no such kind; all else is good
    more = [b - a for a, b in zip(before, struct.unpack('<5I', host.body(COUNTERS)))]
    check('a frame of unknown kind is 1 malformed more and not missing', more[1:4] == [1, 2, 1])
    check('unknown message: NAK 2', host.nak(0x7777) == 2)
    check('REQUEST of version 2: NAK 2', host.nak(IDENTITY, version=2) == 2)
    check('payload too long: NAK 3', host.nak(IDENTITY, b'\0') == 3)
    check('core 3: NAK 4', host.nak(WORDS, b'\3\0\0\0') == 4)

def safe(host):
    check('keep-alives alone hold the session for 2.2 s', host.event(WATCHDOG, 2.2) is None)
    beats = host.beats()
    steps = [(y[0] - x[0], (y[2] - x[2]) / 1e6) for x, y in zip(beats[1:], beats[2:])]      # link time, board time
    check('heartbeat each second, one boot id', {b[1] for b in beats} == {host.board.boot} and steps and
          all(0.8 < link < 1.2 and 0.9 < board < 1.1 for link, board in steps), f'{len(beats)} of them')
    check('... whose state is now: session, power', beats[-1][3] & 7 == 3)
    check('MAKE_SAFE', host.body(MAKE_SAFE) == b'')
    check('... and the module is off, the session open', host.nak(IDENTITY) == 6)
    host.next_alive = math.inf                          # silence, but for what follows
    host.send(EVENT, 0, KEEP_ALIVE)
    host.listen(0.6, len(host.log))
    host.send(EVENT, 0, KEEP_ALIVE, b'what a later firmware may put here')
    last = time.monotonic()
    host.listen(0.6, len(host.log))
    host.send(EVENT, 0, KEEP_ALIVE, version=2)          # feeds nothing; neither do these
    host.send(REQUEST, host.rid + 1, IDENTITY, version=2)
    host.send(EVENT, 0, HEARTBEAT, bytes(13))
    event = host.event(WATCHDOG, 4)
    after = event.at - last if event else math.inf
    check('watchdog 1750 ms after the last keep-alive of version 1, with a payload or without',
          1.7 < after < 2.25 and not event.payload, f'{after:.3f} s')
    check('... then heartbeat with state 0', host.event(HEARTBEAT, 1.5) and host.beats()[-1][3] == 0)
    check('... and REQUEST: NAK 1', host.nak(IDENTITY) == 1)
    gaps = sum((b.seq - a.seq) % 65536 != 1 for a, b in zip(host.log, host.log[1:]))
    check('all frames good, sequence numbers without a gap', not gaps and not host.rubbish, f'{len(host.log)} frames')

def port_of(board):
    line, limit = b'', time.monotonic() + 10
    while b'\n' not in line:
        assert select.select([board.stdout], [], [], max(0, limit - time.monotonic()))[0], 'the program names no port'
        more = os.read(board.stdout.fileno(), 4096)
        assert more, 'the program ended'
        line += more
    return line.split(b'\n')[0].decode().removeprefix('port ')

def stop(board):
    board.terminate()
    try:
        board.wait(5)
    except subprocess.TimeoutExpired:
        board.kill()
        board.wait()

def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    board, step = None, port_of
    try:
        board = subprocess.Popen([sys.argv[1], '--until-eof'], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        host = Host(port_of(board))
        for step in (sessions, identity, cpu, again, stream, account, rubbish, safe):
            step(host)
    except Exception as e:                              # what cannot go on ends the run, as one failed check
        check(step.__name__, False, f'{type(e).__name__}: {e}')
    finally:
        if board:
            stop(board)
    print(f'{results.count(True)} passed, {results.count(False)} failed')
    return not all(results)

if __name__ == '__main__':
    sys.exit(main())
