#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# MAVLink 1 has no extension fields: a message of it ends with the last field of the original
# definition. pymavlink has an argument, force_mavlink1, for talking to a MAVLink 1 device from a
# MAVLink 2 dialect. It changes the header and leaves the extension fields in the payload.
#
# Guess before looking: GPS_RAW_INT becomes 30 bytes of payload, as MAVLink 1 defines it.
# Seen (pymavlink 2.4.50):
#   v20 dialect, force_mavlink1=True   header fe, payload 52 bytes
#   v10 dialect                        header fe, payload 30 bytes
# A parser that compares the length with the definition drops such a message. To talk to a
# MAVLink 1 device, use the v10 dialect.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pymavlink==2.4.50
"$folder/venv/bin/python" - <<'PYTHON'
from pymavlink.dialects.v10 import common as v10
from pymavlink.dialects.v20 import common as v20

values = (0, 3, 481_000_000, 110_000_000, 500_000, 80, 80, 120, 9000, 12)
seen = {}
for name, dialect, arguments in (('v20 forced', v20, {'force_mavlink1': True}), ('v10', v10, {})):
    message = dialect.MAVLink_gps_raw_int_message(*values)
    packet = message.pack(dialect.MAVLink(None, 1, 1), **arguments)
    seen[name] = (packet[0], packet[1])
    print(f'{name}: header {packet[0]:02x}, payload {packet[1]} bytes')
if seen != {'v20 forced': (0xFE, 52), 'v10': (0xFE, 30)}:
    raise SystemExit('changed')
print('as stated')
PYTHON
