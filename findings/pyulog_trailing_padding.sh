#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# A ULog writer may leave out the padding at the end of a message, or write it. pyulog reads the
# first kind only: a topic whose padding was written is not in the result at all.
#
# Guess before looking: both give the same five messages; the reader has code that strips padding.
# Seen (pyulog 1.3.0), five messages of "uint64_t timestamp; float z; uint8_t ok; uint8_t[3] _padding0":
#   13 bytes each, padding left out   5 messages, file_corruption False
#   16 bytes each, padding written    no such topic, file_corruption True, no exception
#   14 bytes each (part of it)        the same
# A flight log without altitudes may have altitudes: look at file_corruption before believing it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pyulog==1.3.0 numpy==2.4.6
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import struct
import sys
from pathlib import Path

from pyulog import ULog

MAGIC = b'ULog\x01\x12\x35\x01'


def record(kind, content):
    return struct.pack('<HB', len(content), ord(kind)) + content


def write(path, padding):
    """Write a log of five messages with so many bytes of padding."""
    layout = b'height:uint64_t timestamp;float z;uint8_t ok;uint8_t[3] _padding0;'
    parts = [
        MAGIC + struct.pack('<Q', 1000),
        record('B', bytes(40)),
        record('F', layout),
        record('A', struct.pack('<BH', 0, 1) + b'height'),
    ]
    for index in range(5):
        values = struct.pack('<QfB', 1000 + 100 * index, -20.0 - index, 1)
        parts.append(record('D', struct.pack('<H', 1) + values + bytes(padding)))
    path.write_bytes(b''.join(parts))


seen = {}
for padding in (0, 3, 1):
    path = Path(sys.argv[1], f'padding{padding}.ulg')
    write(path, padding)
    log = ULog(str(path))
    seen[padding] = (
        {each.name: len(each.data['timestamp']) for each in log.data_list},
        log.file_corruption,
    )
    print(f'{padding} bytes of padding: topics {seen[padding][0]}, file_corruption {seen[padding][1]}')
if seen != {0: ({'height': 5}, False), 3: ({}, True), 1: ({}, True)}:
    raise SystemExit('changed')
print('as stated')
PYTHON
