#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# The rows of a sensor_msgs/Image may end with padding: "step" says how many bytes a row takes, and
# drivers pad rows to a multiple of 4, 16 or 64 bytes. rosbags-image takes the rows as if they had
# none, in silence, so each row begins further to the left than the one above.
#
# Guess before looking: it reads the rows by their step, or refuses a step that is not width x 3.
# Seen (rosbags-image 0.10.4), 2 rows of 3 pixels rgb8 with a step of 12 bytes, padding 200:
#   first row   0 .. 8
#   second row  200 200 200 9 10 11 12 13 14, where 9 .. 17 was sent
# A picture of an odd width comes out sheared. Cut the padding off before the conversion.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
    rosbags==0.11.9 rosbags-image==0.10.4 opencv-python-headless==5.0.0.93
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
from rosbags.image import message_to_cvimage
from rosbags.typesys import Stores, get_typestore

types = get_typestore(Stores.ROS2_JAZZY).types
header = types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](0, 0), 'camera')
sent = np.arange(18, dtype=np.uint8).reshape(2, 9)
padded = np.hstack([sent, np.full((2, 3), 200, np.uint8)])
message = types['sensor_msgs/msg/Image'](header, 2, 3, 'rgb8', 0, 12, padded.ravel())
rows = message_to_cvimage(message).reshape(2, 9).tolist()
print('first row ', *rows[0])
print('second row', *rows[1])
if rows != [sent[0].tolist(), [200, 200, 200, 9, 10, 11, 12, 13, 14]]:
    raise SystemExit('changed')
print('as stated')
PYTHON
