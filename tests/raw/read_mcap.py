"""Reads raw captures as anybody can: with the packages `mcap` and `mcap-protobuf-support`, and nothing of this project.

usage: read_mcap.py FILE.mcap...

Prints one line for each capture: label, samples, mean of the gyroscopes in deg/s at the nominal scale, losses. A file that
was flushed and never finished is read as far as it goes.
"""

import sys

from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader
from mcap_protobuf.decoder import DecoderFactory

LSB_PER_DPS = 20_000
BEGIN, END = 1, 2


def captures(path):
    """Label, samples and end mark (None if it has none) of each capture."""
    label, samples, number = None, [], 0
    with open(path, "rb") as file:
        reader = NonSeekingReader(file, decoder_factories=[DecoderFactory()])
        try:
            for _, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
                if channel.topic == "/capture" and decoded.edge == BEGIN:
                    label, samples = decoded.label, []
                elif channel.topic == "/capture":
                    yield label, samples, decoded
                    label = None
                elif channel.topic == "/imu":
                    assert message.sequence == len(samples), f"{label}: sample {message.sequence} after {len(samples)}"
                    samples.append((decoded.gyro_x, decoded.gyro_y, decoded.gyro_z))
        except EndOfFile:
            print(f"{path}: has no end")
    if label is not None:
        yield label, samples, None


def main():
    for path in sys.argv[1:]:
        found = 0
        for label, samples, end in captures(path):
            found += 1
            means = [sum(axis) / len(samples) / LSB_PER_DPS for axis in zip(*samples)] if samples else []
            gyro = " ".join(f"{mean:+.4f}" for mean in means)
            if end is None:
                print(f"{path}: {label}: {len(samples)} samples, gyro {gyro} deg/s, no end")
                continue
            print(f"{path}: {label}: {len(samples)} samples, gyro {gyro} deg/s, "
                  f"lost {end.lost_on_board} on the board and {end.lost_on_line} on the line")
            assert end.lost_on_board + end.lost_on_line > 0 or end.received == len(samples) or not samples
        assert found, f"{path} holds no capture"


if __name__ == "__main__":
    main()
