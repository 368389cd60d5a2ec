#!/usr/bin/env python3
"""PDUs of 1 to 4095 bytes between this repository's ISO-TP and one that others wrote.

Usage: can_isotp.py ISOTP_PROGRAM slcan             the package can-isotp on python-can, over slcan on a pseudo-terminal
       can_isotp.py ISOTP_PROGRAM kernel INTERFACE  the kernel's ISO-TP, by sockets and by isotpsend and isotprecv

The program sends back under another id what comes under one: every PDU goes both ways, once through each end's sender
and once through each end's receiver. Prints a line per check. Every wait has a deadline.
"""
import os, random, select, socket, subprocess, sys, time

RECEIVES, SENDS = 0x641, 0x649                          # the program's
# Every length of the first frames, both sides of each edge, and the longest.
LENGTHS = [*range(1, 30), 61, 62, 63, 64, 110, 111, 112, 118, 119, 120, 254, 255, 256, 511, 512, 524, 1023, 1024, 2048, 4000,
           4094, 4095]
SETTINGS = [(0, 0), (1, 0), (8, 0), (3, 1)]              # block size and STmin that the program asks for
LATE_MS = 15_000
results = []

def check(what, good, shown=''):
    results.append(bool(good))
    print(f'{"ok  " if good else "FAIL"} {what}{": " if str(shown) else ""}{shown}', flush=True)

class Program:
    """The program, until the end of the block."""
    def __init__(self, path, block, st_min, *interface):
        command = [path, f'{RECEIVES:x}:{SENDS:x}', str(block), str(st_min), *interface]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert select.select([self.process.stdout], [], [], 30)[0], 'the program does not begin'
        self.named = self.process.stdout.readline().decode().split()[1]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        try:
            self.process.wait(5)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

def pdu(length):
    return random.Random(length).randbytes(length)

def round_trips(lengths, send, receive):
    """What came back otherwise than it went."""
    wrong = []
    for length in lengths:
        send(pdu(length))
        if receive() != pdu(length):
            wrong.append(length)
    return wrong

def by_packages(path):
    import can, isotp
    for block, st_min in SETTINGS:
        lengths = LENGTHS if st_min == 0 else [n for n in LENGTHS if n <= 1024]
        with Program(path, block, st_min) as program, \
             can.Bus(interface='slcan', channel=program.named, bitrate=500_000, sleep_after_open=0) as bus:
            address = isotp.Address(isotp.AddressingMode.Normal_11bits, rxid=SENDS, txid=RECEIVES)
            # Its own receiver asks for the same as ours. A busy machine may be late by more than the standard's second.
            stack = isotp.CanStack(bus, address=address, params={
                'blocksize': block, 'stmin': st_min, 'max_frame_size': 4095, 'rx_flowcontrol_timeout': LATE_MS,
                'rx_consecutive_frame_timeout': LATE_MS})
            stack.start()
            began = time.monotonic()
            try:
                wrong = round_trips(lengths, stack.send, lambda: stack.recv(block=True, timeout=20))
            finally:
                stack.stop()
            check(f'can-isotp over slcan, block size {block}, STmin {st_min}: {len(lengths)} PDUs of {lengths[0]} to '
                  f'{lengths[-1]} bytes, there and back', not wrong, wrong or f'{time.monotonic() - began:.1f} s')

def by_kernel(path, interface):
    for block, st_min in SETTINGS[:2]:
        with Program(path, block, st_min, interface), socket.socket(socket.AF_CAN, socket.SOCK_DGRAM, socket.CAN_ISOTP) as peer:
            peer.settimeout(20)
            peer.bind((interface, SENDS, RECEIVES))
            began = time.monotonic()
            wrong = round_trips(LENGTHS, peer.send, lambda: peer.recv(4096))
            check(f"the kernel's ISO-TP, block size {block}, STmin {st_min}: {len(LENGTHS)} PDUs of {LENGTHS[0]} to {LENGTHS[-1]} "
                  'bytes, there and back', not wrong, wrong or f'{time.monotonic() - began:.1f} s')
    with Program(path, 0, 0, interface):
        wrong = [length for length in (1, 7, 8, 4095) if by_tools(interface, length) != pdu(length)]
        check('isotpsend and isotprecv: PDUs of 1, 7, 8 and 4095 bytes, there and back', not wrong, wrong)

def by_tools(interface, length):
    """What isotprecv prints of the answer to what isotpsend sends; it alone sends the flow control of that answer."""
    ids = ['-s', f'{RECEIVES:x}', '-d', f'{SENDS:x}', interface]
    receiver = subprocess.Popen(['isotprecv', *ids], stdout=subprocess.PIPE, text=True)
    try:
        wait_for(lambda: listeners(interface, SENDS) > 0)
        subprocess.run(['isotpsend', *ids], input=pdu(length).hex(' '), text=True, check=True, timeout=30)
        return bytes.fromhex(receiver.communicate(timeout=30)[0])
    finally:
        receiver.kill()
        receiver.wait()

def listeners(interface, can_id):
    """Sockets that wait for one id, as the kernel lists them."""
    with open('/proc/net/can/rcvlist_sff') as listed:
        return sum(line.split()[:2] == [interface, f'{can_id:x}'] for line in listed)

def wait_for(holds):
    until = time.monotonic() + 30
    while not holds():
        assert time.monotonic() < until, 'isotprecv does not listen'
        time.sleep(0.02)

def main():
    match sys.argv[1:]:
        case [path, 'slcan']:
            by_packages(path)
        case [path, 'kernel', interface]:
            by_kernel(path, interface)
        case _:
            sys.exit(__doc__)
    print(f'{results.count(True)} passed, {results.count(False)} failed')
    return not all(results)

if __name__ == '__main__':
    sys.exit(main())
