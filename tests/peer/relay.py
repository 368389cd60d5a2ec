#!/usr/bin/env python3
"""The functional plan with socat between station and board.

Usage: relay.py STATION_PROGRAM BOARD_PROGRAM

Two pseudo-terminals that socat joins, opened by both ends as serial ports: nobody on the line is ours. Prints a line per
check. Every wait has a deadline.
"""
import os, json, pathlib, re, subprocess, sys, tempfile, time

from host import check, results, stop

# The station's lines are in the language of the locale, and this reads them in English.
os.environ["LC_ALL"] = "C.UTF-8"

PLAN = pathlib.Path(__file__).resolve().parent.parent.parent / 'test-plans' / 'functional.toml'
# A person has to turn the module for the one, and the board has no bus for the other.
WITHOUT = {'ad', 'can'}
PLAN_S = 90
# Exit code of good items of a selection.
PARTIAL = 5
BENCH = '''[station]
id = "relay"
[socket]
port = "{port}"
rate = "921600 bit/s"
[site]
latitude = "34.2321 deg"
longitude = "108.9154 deg"
height = "412 m"
gravity = "9.795416 m/s^2"
'''

def wait_for(path, process):
    until = time.monotonic() + 30
    while not path.exists():
        assert process.poll() is None and time.monotonic() < until, f'there is no {path.name}'
        time.sleep(0.02)

def run(station, board_program, folder):
    ends = [folder / 'host', folder / 'board']
    relay = subprocess.Popen(['socat', *(f'pty,raw,echo=0,link={end}' for end in ends)])
    board = None
    try:
        for end in ends:
            wait_for(end, relay)
        command = [board_program, '--port', ends[1], '--serial-number', 'RELAY-1', '--speed', 'max']
        board = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        (folder / 'bench.toml').write_text(BENCH.format(port=ends[0]))
        items = [item for item in re.findall(r'^id = "(.*)"', PLAN.read_text(), re.MULTILINE) if item not in WITHOUT]
        command = [station, '--auto', PLAN, '--serial-number', 'RELAY-1', '--only', ','.join(items)]
        done = subprocess.run(command, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=PLAN_S)
        check(f'{len(items)} items of the functional plan over socat', done.returncode == PARTIAL,
              done.stdout.strip().splitlines()[-4] if done.returncode == PARTIAL else done.stdout + done.stderr)
        record = json.loads(next(folder.glob('records/*/*/*/run.json')).read_text())
        notes = [note['text'] for note in record['notes'] if 'not clean' in note['text']]
        # The line was in the middle of a heartbeat when the station opened it, at most.
        check('... over a clean line', all(re.search(r' 0 missing, 0 late', note) for note in notes), '; '.join(notes))
    finally:
        for process in filter(None, (board, relay)):
            stop(process)

def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    programs = [pathlib.Path(program).resolve() for program in sys.argv[1:]]
    try:
        with tempfile.TemporaryDirectory() as folder:
            run(*programs, pathlib.Path(folder))
    except Exception as e:                              # what cannot go on ends the run, as one failed check
        check('the relay', False, f'{type(e).__name__}: {e}')
    print(f'{results.count(True)} passed, {results.count(False)} failed')
    return not all(results)

if __name__ == '__main__':
    sys.exit(main())
