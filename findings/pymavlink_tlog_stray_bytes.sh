#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# A telemetry log (.tlog) is a row of pairs: time of receipt (8 bytes), message. pymavlink's reader
# takes the 8 bytes after damage for a time, wherever they stand. A few bytes too many in the file
# cost more messages than they touch, and the BAD_DATA in their place have times of another age.
#
# Guess before looking: the message beside the bytes is lost, the next is read; BAD_DATA has the time
# of its neighbours.
# Seen (pymavlink 2.4.50), 200 heartbeats ten times per second, bytes of 0x55 after the eleventh:
#   0 bytes   200 messages
#   1 byte    198 messages, BAD_DATA at 6.1e12 s (the year 196000) and at the right time
#   4 bytes   190 messages, BAD_DATA at 6.1e12 s, at 5.7e8 s (1987), and at the right time
#   8 bytes   191 messages, BAD_DATA at 6.1e12 s and at the right time
# Times of messages are right. Who takes first and last time of a log must leave out BAD_DATA.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pymavlink==2.4.50
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import struct
import sys
from pathlib import Path

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

BEGAN_S = 1_790_000_000
MESSAGES = 200


def write(path, stray):
    """Write a log with so many bytes between two of its pairs."""
    sender = mavlink.MAVLink(None, 1, 1)
    parts = []
    for index in range(MESSAGES):
        parts.append(struct.pack('>Q', BEGAN_S * 1_000_000 + index * 100_000))
        parts.append(sender.heartbeat_encode(2, 3, 0, index, 4).pack(sender))
        if index == 10:
            parts.append(b'\x55' * stray)
    path.write_bytes(b''.join(parts))


def read(path):
    """Return the number of messages, whether their times are right, and the times of BAD_DATA."""
    log = mavutil.mavlink_connection(str(path))
    times, bad = [], []
    while (message := log.recv_match()) is not None:
        (bad if message.get_type() == 'BAD_DATA' else times).append(message._timestamp)
    right = all(BEGAN_S <= each <= BEGAN_S + 20 for each in times)
    return len(times), right, [float(f'{each:.1e}') for each in bad]


seen = {}
for stray in (0, 1, 4, 8):
    path = Path(sys.argv[1], f'stray{stray}.tlog')
    write(path, stray)
    seen[stray] = read(path)
    print(f'{stray} bytes: {seen[stray][0]} messages, BAD_DATA at {seen[stray][2]} s')
if seen != {
    0: (200, True, []),
    1: (198, True, [6.1e12, 1.8e9]),
    4: (190, True, [6.1e12, 5.7e8, 1.8e9]),
    8: (191, True, [6.1e12, 1.8e9]),
}:
    raise SystemExit('changed')
print('as stated')
PYTHON
