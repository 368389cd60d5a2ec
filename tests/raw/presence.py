"""Reads raw captures as generic tools do: each message becomes a dictionary, by `MessageToDict` of protobuf.

usage: presence.py EARLIER.mcap FILE.mcap...

EARLIER, a file whose fields had no presence, is read first by the same decoder, as where somebody goes through a folder.
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
# An end says how the board's clock ran against the host's, or why nobody knows.
HOST = ({"host_error_ppm", "host_u_ppm"}, {"host_nothing"})


def messages(path, decoder):
    """Channel and decoded message of each."""
    with open(path, "rb") as file:
        reader = NonSeekingReader(file, decoder_factories=[decoder])
        for _, channel, _, decoded in reader.iter_decoded_messages(log_time_order=False):
            yield channel, decoded


def main():
    earlier, *paths = sys.argv[1:]
    decoder = DecoderFactory()
    assert sum(1 for _ in messages(earlier, decoder)), f"{earlier} holds nothing"
    zeros, on_x, marks = 0, 0, 0
    for path in paths:
        samples, sums = 0, dict.fromkeys(COUNTS, 0)
        for channel, decoded in messages(path, decoder):
            fields = MessageToDict(decoded, preserving_proto_field_name=True)
            if channel.topic == "/imu":
                assert fields.keys() == IMU, f"{path}, sample {samples}: no {IMU - fields.keys()}"
                samples += 1
                for name in COUNTS:
                    sums[name] += fields[name]
                    zeros += fields[name] == 0
            elif channel.topic == "/capture" and fields.get("edge") == BEGIN:
                marks += 1
                if fields["pose"] != "still":
                    assert TURN <= fields.keys(), f"{path}: no {TURN - fields.keys()} in {fields}"
                    on_x += fields["axis"] == 0
                # What a mark is not given, a still one's turn, stays absent.
                assert ("axis" in fields) == (fields["pose"] != "still"), fields
            elif channel.topic == "/capture":
                assert any(fields.keys() == LOSSES | host for host in HOST), f"{path}: {fields}"
        means = " ".join(f"{name} {sums[name] / samples:.2f}" for name in COUNTS[:3]) if samples else ""
        print(f"{path}: {samples} samples, none without a field; means {means}")
    assert zeros and on_x and marks, f"{zeros} counts of 0, {on_x} turns about X, {marks} captures: nothing was tried"


if __name__ == "__main__":
    main()
