#!/usr/bin/env python3
"""What a trivial item costs in OpenHTF 1.6.3, the same that `own_cost` measures of this station, in one run beside it.

    pip install openhtf==1.6.3
    python3 src/station/benches/openhtf_peer.py

A phase with one measurement and one limit, so many of them in one test, the record written as JSON into memory. A process
for each count, since memory is a high-water mark.
"""
import io, re, resource, subprocess, sys, time

FEW, MANY = 200, 2000


def run(count):
    import openhtf as htf
    from openhtf.output.callbacks import json_factory

    def phase_of(number):
        @htf.PhaseOptions(name=f"io-{number}")
        @htf.measures(htf.Measurement("wrong_reads").in_range(maximum=0))
        def phase(test):
            test.measurements.wrong_reads = 0
        return phase

    test = htf.Test(*[phase_of(number) for number in range(count)])
    written = []
    test.add_output_callbacks(lambda record: written.append(timed(json_factory.OutputToJSON(io.BytesIO()), record)))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began = time.perf_counter()
    passed = test.execute(test_start=lambda: "BENCH")
    took = time.perf_counter() - began
    memory = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024
    print(took - written[0], written[0], memory, int(passed))


def timed(output, record):
    began = time.perf_counter()
    output(record)
    return time.perf_counter() - began


def child(count):
    out = subprocess.run([sys.executable, __file__, str(count)], capture_output=True, text=True)
    if out.returncode:
        sys.exit(out.stderr)
    took, output, memory, passed = map(float, out.stdout.split()[-4:])
    assert passed, "a trivial test passes"
    return took, output, memory


def station():
    """The figures that own_cost prints: milliseconds and bytes of an item."""
    words = ["cargo", "bench", "-q", "-p", "gnc-station", "--bench", "own_cost", "--", "cost"]
    out = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True)
    return [float(re.search(r"\d+\.\d+", line)[0]) for line in out.stdout.splitlines()[:2]]


if __name__ == "__main__":
    if len(sys.argv) > 1:
        run(int(sys.argv[1]))
    else:
        few, many = child(FEW), child(MANY)
        item, output, memory = ((b - a) / (MANY - FEW) for a, b in zip(few, many))
        ours_ms, ours_bytes = station()
        print(f"OpenHTF       {item * 1e3:8.3f} ms an item and {output * 1e3:.3f} ms output, {memory:6.0f} bytes")
        print(f"this station  {ours_ms:8.3f} ms an item, journal and record included, {ours_bytes:6.0f} bytes")
        print(f"ratio         {(item * 1e3) / ours_ms:8.1f} in time, {memory / ours_bytes:.1f} in memory")
