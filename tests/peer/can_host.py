#!/usr/bin/env python3
"""A host over CAN, written from docs/ICD.md alone on the packages python-can and can-isotp: nothing of it is ours.

Usage: can_host.py BOARD_PROGRAM slcan                the board's bus as an slcan adapter on a pseudo-terminal
       can_host.py BOARD_PROGRAM socketcan INTERFACE  an interface of the kernel

Prints a line per check. Every wait has a deadline.
"""
import math, os, queue, random, struct, subprocess, sys, time

import can, isotp

from host import (ACCEPT, EVENT, HELLO, IDENTITY, INTEGERS, MAKE_SAFE, NAK, POWER, REQUEST, RESULT, STREAM_START, STREAM_STOP,
                  check, crc32c, listing, port_of, results, stop, text)

CAN_COUNTERS = 0x22
KEEP_ALIVE_ID, BOARD_ALIVE_ID = 0x010, 0x011
URGENT, REQUESTS = (0x020, 0x021), (0x100, 0x101)
IMU, MARK, CLOCK = (0x200, 0x201, 0x202), 0x203, 0x204

class Host:
    def __init__(self, bus):
        self.bus, self.raw, self.rid, self.sequence = bus, queue.Queue(), random.randrange(1, 60000), {URGENT: 0, REQUESTS: 0}
        self.notifier = can.Notifier(bus, [self.heard], timeout=0.05)
        self.stacks = {}
        for ids in (URGENT, REQUESTS):
            address = isotp.Address(isotp.AddressingMode.Normal_11bits, txid=ids[0], rxid=ids[1])
            self.stacks[ids] = isotp.NotifierBasedCanStack(bus, self.notifier, address=address, params={'blocksize': 0, 'stmin': 0})
            self.stacks[ids].start()
        self.alive = None
        self.end = time.monotonic() + 60                # the whole run takes no longer

    def close(self):
        for stack in self.stacks.values():
            stack.stop()
        self.notifier.stop(2)

    def heard(self, message):
        isotp_ids = (*URGENT, *REQUESTS)
        if not message.is_error_frame and message.arbitration_id not in isotp_ids:
            self.raw.put((time.monotonic(), message.arbitration_id, bytes(message.data), message.is_extended_id))

    def frame(self, can_id, data=b'', extended=False):
        self.bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=extended), timeout=1)

    def keep_alive(self, on):
        if self.alive:
            self.alive.stop()
        message = can.Message(arbitration_id=KEEP_ALIVE_ID, is_extended_id=False)
        self.alive = self.bus.send_periodic(message, 0.5) if on else None

    def send(self, ids, kind, mid, payload):
        version = 0 if kind == HELLO else 1
        data = struct.pack('<BBHHH', version << 4 | kind, 0, self.rid, mid, self.sequence[ids]) + payload
        self.sequence[ids] += 1
        self.stacks[ids].send(data + struct.pack('<I', crc32c(data)))

    def answer(self, ids, kinds, seconds=3):
        until = time.monotonic() + seconds
        while time.monotonic() < min(until, self.end):
            data = self.stacks[ids].recv(block=True, timeout=0.1)
            if data is None:
                continue
            assert crc32c(data[:-4]) == struct.unpack('<I', data[-4:])[0], f'checksum of {data.hex()}'
            first, _, rid, mid, _ = struct.unpack('<BBHHH', data[:8])
            if first & 15 in kinds and rid == self.rid:
                return first & 15, mid, data[8:-4]
        raise TimeoutError(f'no answer on {ids[1]:#x}')

    def ask(self, mid, payload=b'', ids=REQUESTS):
        self.rid += 1
        self.send(ids, REQUEST, mid, payload)
        return self.answer(ids, (RESULT, NAK))

    def body(self, mid, payload=b'', ids=REQUESTS):
        kind, _, said = self.ask(mid, payload, ids)
        assert (kind, said[:2]) == (RESULT, b'\0\0'), f'message {mid:#x}: kind {kind}, {said[:2].hex()}'
        return said[6:]

    def listen(self, seconds, enough=lambda frames: False):
        """Raw frames of so long, or until there are enough."""
        frames, until = [], time.monotonic() + seconds
        while time.monotonic() < min(until, self.end) and not enough(frames):
            try:
                frames.append(self.raw.get(timeout=0.05))
            except queue.Empty:
                pass
        return frames

def session(host):
    host.rid += 1
    host.send(REQUESTS, REQUEST, IDENTITY, b'')
    kind, _, said = host.answer(REQUESTS, (RESULT, NAK))
    check('REQUEST without a session: NAK 1', (kind, said[:2]) == (NAK, b'\1\0'))
    host.rid, nonce = host.rid + 1, random.getrandbits(32)
    host.send(URGENT, HELLO, 0, b'GNCT' + struct.pack('<BBI', 1, 1, nonce))
    kind, _, said = host.answer(URGENT, (HELLO,))
    magic, chosen, lowest, highest, echoed, boot, capabilities = struct.unpack('<4sBBBIII', said[:19])
    host.boot = boot
    check('HELLO on the urgent channel', (magic, chosen, echoed) == (b'GNCT', 1, nonce) and capabilities & 2,
          f'{text(said[19:])[0]}, boot id {boot:#010x}')
    host.keep_alive(True)

def requests(host):
    volts, amperes = struct.unpack('<II', host.body(POWER, b'\1'))
    check('power on', 4_500_000 <= volts <= 5_500_000, f'{volts / 1e6:.3f} V, {amperes / 1e6:.3f} A')
    strings, rest = [], host.body(IDENTITY)
    for _ in range(4):
        string, rest = text(rest)
        strings.append(string)
    check('Identity', len(rest) == 1 and all(strings), ', '.join(strings))
    draw = random.Random(2)
    pairs = [(draw.randrange(-10**6, 10**6), draw.randrange(1, 10**4)) for _ in range(16)]
    cut = lambda a, b: abs(a) // b * (1 if a >= 0 else -1)
    low = lambda n: (n + 2**31) % 2**32 - 2**31
    sums = [(a + b, a - b, low(a * b), cut(a, b), a - b * cut(a, b)) for a, b in pairs]
    got = host.body(INTEGERS, b'\1' + listing('ii', pairs))
    check('a long message there and a longer one back: 16 pairs of integers', got == listing('5i', sums), f'{len(got)} bytes')

def alive(host):
    host.listen(0)
    frames = host.listen(6, lambda frames: sum(f[1] == BOARD_ALIVE_ID for f in frames) >= 6)
    beats = [f[2] for f in frames if f[1] == BOARD_ALIVE_ID]
    while beats and beats[0][0] != 0:
        beats.pop(0)
    pairs = list(zip(beats[::2], beats[1::2]))
    good = all(a[0] == 0 and b[0] == 1 and a[1] == b[1] and len(a) == len(b) == 8 and
               int.from_bytes(a[2:6], 'little') == host.boot and a[6] & 3 == 3 for a, b in pairs)
    times = [int.from_bytes(b[2:8], 'little') for _, b in pairs]
    check('heartbeat: two frames of one beat, boot id, session and power, a second apart', len(pairs) >= 2 and good and
          all(0.9e6 < y - x < 1.1e6 for x, y in zip(times, times[1:])), f'{len(pairs)} of them')

def stream(host):
    rate, total = 200, 130
    form, per_frame, load = struct.unpack('<BBH', host.body(STREAM_START, struct.pack('<BHIB', 1, rate, total, 1)))
    frames = host.listen(5, lambda frames: sum(f[1] == IMU[2] for f in frames) >= total)
    frames += host.listen(0.1)
    imu = [(f[1], int.from_bytes(f[2], 'little')) for f in frames if f[1] in IMU]
    check(f'{total} samples of three frames each', [i for i, _ in imu] == list(IMU) * total and per_frame == 1,
          f'{load} thousandths of the bus')
    check('a number in each frame, none missing', [n & 1023 for _, n in imu] == [s % 1024 for s in range(total) for _ in IMU])
    signed = lambda n: (n + 2**17) % 2**18 - 2**17
    force = [[(64 * signed(n >> at & 0x3FFFF) + 32) / 160_000 for at in (10, 28, 46)] for i, n in imu if i == IMU[1]]
    norms = [math.hypot(*f) for f in force]
    check('specific force of about 1 g', norms and all(0.9 < g < 1.1 for g in norms), f'{min(norms):.4f}..{max(norms):.4f} g')
    order = [f[1] for f in frames if f[1] in (*IMU, MARK, CLOCK)]
    marks = [int.from_bytes(f[2][:4], 'little') for f in frames if f[1] == MARK]
    clocks = [int.from_bytes(f[2][:6], 'little') for f in frames if f[1] == CLOCK]
    steps = [(b - a) / (n - m) for a, b, m, n in zip(clocks, clocks[1:], marks, marks[1:])]
    check('mark and clock before samples 0, 64 and 128; 5 ms a sample', marks == [0, 64, 128] and order[:3] == [MARK, CLOCK, IMU[0]]
          and all(abs(step - 5000) < 1 for step in steps), steps)
    closed = struct.unpack('<II', host.body(STREAM_STOP, b'\1'))
    check('account closed', closed == (total, 0), closed)

def echoes(host):
    draw = random.Random(3)
    sent = [(0x700 + n % 16, draw.randbytes(n % 9), False) for n in range(40)]
    sent += [(0x1ABC0000 + draw.randrange(0x10000), draw.randbytes(n % 9), True) for n in range(40)]
    before, got = host.body(CAN_COUNTERS), []
    host.listen(0.05)
    back = lambda frame: frame[1] >> 4 == 0x71 or frame[1] >> 16 == 0x1ABD
    for can_id, data, extended in sent:
        host.frame(can_id, data, extended)
        got += host.listen(3, lambda frames: any(map(back, frames)))
    got = [frame[1:] for frame in got if back(frame)]
    expected = [(i + (0x10000 if extended else 0x10), data, extended) for i, data, extended in sent]
    odd = next((f'; {g} instead of {e}' for g, e in zip(got, expected) if g != e), '')
    check('test frames of 0 to 8 bytes, standard and extended, come back', got == expected, f'{len(got)} of {len(sent)}{odd}')
    check('... and the module counted them', host.body(CAN_COUNTERS) != before)

def safe(host):
    check('MAKE_SAFE on the urgent channel', host.body(MAKE_SAFE, ids=URGENT) == b'')
    kind, _, said = host.ask(IDENTITY)
    check('... and the module is off, the session open', (kind, said[:2]) == (NAK, b'\6\0'))
    host.listen(0)
    host.keep_alive(False)
    began = time.monotonic()
    ended = lambda frames: any((f[1], f[2][:1]) == (BOARD_ALIVE_ID, b'\2') for f in frames)
    frames = host.listen(5, ended)
    check('silence: the watchdog ends the session', ended(frames), f'{time.monotonic() - began:.2f} s after the last keep-alive or less')
    kind, _, said = host.ask(IDENTITY)
    check('... and REQUEST: NAK 1', (kind, said[:2]) == (NAK, b'\1\0'))

def join(arguments):
    """The board's program and the bus to it."""
    match arguments:
        case [program, 'slcan']:
            board = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
            port_of(board)
            board.stdin.write(b'can\n')
            board.stdin.flush()
            named = board.stdout.readline().decode().split()
            assert named[0] == 'ok', named
            return board, dict(interface='slcan', channel=named[1].removeprefix('slcan:'), bitrate=500_000, sleep_after_open=0)
        case [program, 'socketcan', interface]:
            # On one processor: frames of a sender that moves to another may overtake one another in the kernel's queues.
            stay = lambda: os.sched_setaffinity(0, {0})  # noqa: E731
            board = subprocess.Popen([program, '--can', interface], stdin=subprocess.PIPE, stdout=subprocess.PIPE, preexec_fn=stay)
            port_of(board)
            return board, dict(interface='socketcan', channel=interface)
    sys.exit(__doc__)

def main():
    (board, settings), step = join(sys.argv[1:]), session
    try:
        with can.Bus(**settings) as bus:
            host = Host(bus)
            try:
                for step in (session, requests, alive, stream, echoes, safe):
                    step(host)
            finally:
                host.keep_alive(False)
                host.close()
    except Exception as e:                              # what cannot go on ends the run, as one failed check
        check(step.__name__, False, f'{type(e).__name__}: {e}')
    finally:
        stop(board)
    print(f'{results.count(True)} passed, {results.count(False)} failed')
    return not all(results)

if __name__ == '__main__':
    sys.exit(main())
