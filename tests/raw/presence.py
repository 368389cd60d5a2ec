"""Reads raw captures as generic tools do: each message becomes a dictionary, by `MessageToDict` of protobuf.

usage: presence.py FILE.mcap...

A field that is not there is NaN in a data frame and no part of a mean. So each dictionary must have what the message was
given: counts of exactly 0, the axis X of a turn (0), both counters of losses (0).
"""

import sys

from google.protobuf.json_format import MessageToDict
from mcap.reader import NonSeekingReader
from mcap_protobuf.decoder import DecoderFactory

BEGIN, END = 1, 2
COUNTS = [f"{sensor}_{axis}" for sensor in ("gyro", "accel", "mag") for axis in "xyz"]
IMU = {*COUNTS, "gyro_temperature", "accel_temperature"}
TURN = {"edge", "label", "series", "rate_hz", "pose", "axis", "along"}
LOSSES = {"edge", "received", "lost_on_board", "lost_on_line"}


def main():
    zeros, on_x, marks = 0, 0, 0
    for path in sys.argv[1:]:
        sums, of_keys, samples = dict.fromkeys(COUNTS, 0), dict.fromkeys(COUNTS, 0), 0
        with open(path, "rb") as file:
            reader = NonSeekingReader(file, decoder_factories=[DecoderFactory()])
            for _, channel, _, decoded in reader.iter_decoded_messages(log_time_order=False):
                fields = MessageToDict(decoded, preserving_proto_field_name=True)
                if channel.topic == "/imu":
                    assert fields.keys() == IMU, f"{path}, sample {samples}: no {IMU - fields.keys()}"
                    samples += 1
                    for name in COUNTS:
                        sums[name] += getattr(decoded, name)
                        of_keys[name] += 1
                        zeros += fields[name] == 0
                elif channel.topic == "/capture" and fields.get("edge") == BEGIN:
                    marks += 1
                    if fields["pose"] != "still":
                        assert TURN <= fields.keys(), f"{path}: no {TURN - fields.keys()} in {fields}"
                        on_x += fields["axis"] == 0
                    # What a mark is not given, a still one's turn, stays absent.
                    assert ("axis" in fields) == (fields["pose"] != "still"), fields
                elif channel.topic == "/capture":
                    assert fields.keys() == LOSSES, f"{path}: {fields}"
        for name in COUNTS:
            assert of_keys[name] == samples
        means = " ".join(f"{name} {sums[name] / samples:.2f}" for name in COUNTS[:3]) if samples else ""
        print(f"{path}: {samples} samples, none without a field; means {means}")
    assert zeros and on_x and marks, f"{zeros} counts of 0, {on_x} turns about X, {marks} captures: nothing was tried"


if __name__ == "__main__":
    main()
