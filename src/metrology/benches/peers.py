#!/usr/bin/env python3
"""Compares the station's computations with other people's programs, and their times side by side.

    cargo build --release -p gnc-station
    pip install allantools==2024.6 numpy scipy pandas
    python3 src/metrology/benches/peers.py target/release/gnc-station

Ends with 1 when a bound is broken. The Allan family is compared with allantools (1e-8 relative) and with the definition
in extended precision (1e-10); the spectrum with scipy.signal.welch; reading a table with pandas.
"""
import json, os, subprocess, sys, tempfile, time
import allantools, numpy as np, pandas as pd, scipy.signal

station = sys.argv[1]
series = int(sys.argv[2]) if len(sys.argv) > 2 else 100
broken = []
folder = tempfile.mkdtemp()
path = os.path.join(folder, "r.csv")
peers = {d: getattr(allantools, d) for d in ("adev", "oadev", "mdev", "hdev", "ohdev", "totdev")}


def compute(*words):
    out = subprocess.run([station, "compute", *words, "--json"], capture_output=True, text=True)
    if out.returncode:
        sys.exit(f"{words}: {out.stderr}")
    return json.loads(out.stdout)


def judge(what, value, bound):
    print(f"{what:<64} {value:9.3g}  bound {bound:g}  {'ok' if value <= bound else 'BROKEN'}")
    if not value <= bound:
        broken.append(what)


def extended(y, m, dev):
    """oadev and ohdev by definition in 80-bit arithmetic."""
    y = y.astype(np.longdouble)
    x = np.concatenate([[np.longdouble(0)], np.cumsum(y - y.mean())])
    if dev == "oadev":
        v, norm = x[2 * m:] - 2 * x[m:-m] + x[:-2 * m], 2
    else:
        v, norm = x[3 * m:] - 3 * x[2 * m:-m] + 3 * x[m:-2 * m] - x[:-3 * m], 6
    return float(np.sqrt(np.sum(v * v) / (norm * len(v))) / m)


rng = np.random.default_rng(1)
worst, worst_offset, worst_extended = 0.0, 0.0, 0.0
for k in range(series):
    n = int(rng.integers(200, 3000))
    white = rng.normal(size=n)
    y = [white, np.cumsum(white), white + 1e6][k % 3]
    pd.DataFrame({"y": y}).to_csv(path, index=False, float_format="%.17g")
    for dev, peer in peers.items():
        ours = compute("allan", path, "--rate", "1", "--column", "y", "--dev", dev)["points"]
        taus = [p["tau_s"] for p in ours]
        # The peer takes the mean off in plain sums; an offset is taken off for it, as its manual asks.
        t, d, _, ns = peer(y - y.mean(), rate=1.0, data_type="freq", taus=taus)
        theirs = dict(zip(t, zip(d, ns)))
        for p in ours:
            if p["tau_s"] not in theirs:
                continue
            d, ns = theirs[p["tau_s"]]
            error = abs(p["dev"] / d - 1)
            if k % 3 == 2:
                worst_offset = max(worst_offset, error)
            else:
                worst = max(worst, error)
            if p["n"] != ns and dev != "totdev":
                broken.append(f"{dev} n at {p['tau_s']}: {p['n']} {ns}")
            if dev in ("oadev", "ohdev"):
                worst_extended = max(worst_extended, abs(p["dev"] / extended(y, int(p["tau_s"]), dev) - 1))
judge(f"allantools {allantools.__version__}, {series} series, six deviations, relative", worst, 1e-8)
judge("  with offsets of 1e6", worst_offset, 1e-8)
judge("  oadev and ohdev against 80-bit arithmetic", worst_extended, 1e-10)

y = rng.normal(size=50_000) + 1e6
pd.DataFrame({"y": y}).to_csv(path, index=False, float_format="%.17g")
ours = compute("psd", path, "--rate", "200", "--column", "y", "--segment", "1024")
_, p = scipy.signal.welch(y, 200, "hann", 1024, detrend="constant", scaling="density")
judge("scipy.signal.welch, offset 1e6, relative to the mean density", np.max(np.abs(np.array(ours["density"]) - p)) / p.mean(), 1e-9)

n = 3_600_000
y = rng.normal(size=n)
start = time.perf_counter()
allantools.oadev(y, rate=1000.0, data_type="freq", taus="octave")
print(f"allantools oadev, octave, one axis of 3.6 million: {time.perf_counter() - start:.3f} s in process")

table = rng.integers(-32768, 32767, size=(n, 8))
np.savetxt(path, table, fmt="%d", delimiter=",", header="a,b,c,d,e,f,g,h", comments="")
del table
print(f"table of 3.6 million x 8: {os.path.getsize(path) / 1e6:.0f} MB")
times, peer = [], []
for _ in range(5):
    start = time.perf_counter()
    compute("stability", path, "--rate", "1000", "--column", "e", "--block", "10")
    times.append(time.perf_counter() - start)
    start = time.perf_counter()
    pd.read_csv(path, usecols=["e"])
    peer.append(time.perf_counter() - start)
judge("one column of it, whole process with block means, s", min(times), 0.5)
print(f"  pandas read_csv of one column: {min(peer):.3f} s in process")
# A child counts its parent's memory until it starts the program, so the program is asked itself.
child = subprocess.Popen([station, "compute", "stability", path, "--rate", "1000", "--column", "e"], stdout=subprocess.DEVNULL)
peak = 0.0
while child.poll() is None:
    try:
        with open(f"/proc/{child.pid}/status") as status:
            peak = max([peak] + [int(line.split()[1]) / 1024 for line in status if line.startswith("VmHWM")])
    except OSError:
        pass
judge("  its memory, MB (the column itself: 29)", peak, 80)
print("BROKEN: " + "; ".join(broken) if broken else "all within bounds")
sys.exit(bool(broken))
