#!/usr/bin/env bash
# The PyPI package mcap-protobuf-support decodes a second file by the schemas of the first one.
#
# `mcap_protobuf.decoder.DecoderFactory` keeps the message class of each schema by the number that the schema has in its file.
# Such a number is valid in one file only: each writer gives its own, most from 1. If one factory serves the readers of several
# files, as in a loop over a folder, it decodes all files but the first by the first one's class of that number. It compares
# neither name nor text of the schema. No error shows it: protobuf takes fields of another type for unknown ones and gives
# their default.
#
# Seen here: a file of google.protobuf.Int32Value (5), then one of google.protobuf.DoubleValue (2.5). With one factory the
# second is read as Int32Value with the value 0; with a factory for each file as DoubleValue with 2.5.
#
# What to do instead: make a factory for each reader. A writer whose schemas change gives the new ones other numbers.
#
# This script installs mcap-protobuf-support 0.6.0, mcap 1.6.0 and protobuf 7.36.2 in a temporary folder. It exits with 0 if
# the behaviour is as described, with 1 if it changed.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet mcap-protobuf-support==0.6.0 mcap==1.6.0 protobuf==7.36.2
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import sys
from importlib.metadata import version

from google.protobuf.wrappers_pb2 import DoubleValue, Int32Value
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from mcap_protobuf.writer import Writer

for package in ("mcap-protobuf-support", "mcap", "protobuf"):
    print(package, version(package))


def write(name, message):
    path = f"{sys.argv[1]}/{name}.mcap"
    with open(path, "wb") as file, Writer(file) as writer:
        writer.write_message("/value", message, log_time=1, publish_time=1)
    return path


def read(path, factory):
    with open(path, "rb") as file:
        [(schema, _, _, decoded)] = make_reader(file, decoder_factories=[factory]).iter_decoded_messages()
    print(f"  schema {schema.id} is {schema.name}: decoded as {decoded.DESCRIPTOR.full_name}, value {decoded.value}")
    return decoded.DESCRIPTOR.full_name, decoded.value


first, second = write("first", Int32Value(value=5)), write("second", DoubleValue(value=2.5))
print("one factory for both files")
shared = DecoderFactory()
one = [read(path, shared) for path in (first, second)]
print("a factory for each file")
each = [read(path, DecoderFactory()) for path in (first, second)]
assert each == [("google.protobuf.Int32Value", 5), ("google.protobuf.DoubleValue", 2.5)], "the files are good"
if one == each:
    sys.exit("the behaviour changed: a second file is decoded by its own schema")
if one[1] != ("google.protobuf.Int32Value", 0):
    sys.exit(f"the behaviour changed: {one}")
print("as described: 2.5 was read as 0, and nothing was said")
PYTHON
