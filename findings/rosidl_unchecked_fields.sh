#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# A Python message of ROS 2 Jazzy takes any value in any field, and what is not exactly float or bool
# goes onto the wire as another value, without an error: 1 metre is 5e-324 m, True of NumPy is False.
#
# Guess before looking: numbers of NumPy and integers are converted, or refused with a TypeError, as
# in the releases before.
# Seen (ros-jazzy-rclpy 7.1.6, ros-jazzy-common-interfaces 5.3.6), what the other side reads:
#   geometry_msgs/Point.x   1 -> 5e-324     -3 -> nan       numpy.float32(1.5) -> 5.3e-315
#                           1.5 -> 1.5      numpy.float64(1.5) -> 1.5 (it is a float of Python)
#   std_msgs/Bool.data      numpy.True_ -> False     1 -> False     True -> True
#   std_msgs/UInt8.data     300 -> 44
#   with ROS_PYTHON_CHECK_FIELDS=1: an AssertionError for each that goes wrong
# A speed or a height that was computed in float32 arrives as zero. Set that variable in tests.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check ros-jazzy-rclpy==7.1.6 \
    ros-jazzy-common-interfaces==5.3.6 ros-jazzy-rmw-fastrtps-cpp numpy==2.4.6
export AMENT_PREFIX_PATH=$folder/venv ROS_LOG_DIR=$folder/log
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH PYTHONPATH ROS_PYTHON_CHECK_FIELDS
cat > "$folder/fields.py" <<'PYTHON'
import math
import os
import sys

import numpy as np
from geometry_msgs.msg import Point
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Bool, UInt8

STATED = [  # type, field, what is set, what the other side reads
    (Point, 'x', 1, 5e-324),
    (Point, 'x', -3, math.nan),
    (Point, 'x', np.float32(1.5), 5.28426686e-315),
    (Bool, 'data', np.True_, False),
    (Bool, 'data', 1, False),
    (UInt8, 'data', 300, 44),
]
RIGHT = [(Point, 'x', 1.5), (Point, 'x', np.float64(1.5)), (Bool, 'data', True), (UInt8, 'data', 44)]
checked = os.environ.get('ROS_PYTHON_CHECK_FIELDS') == '1'
changed = []


def arrives(kind, field, value):
    message = kind()
    setattr(message, field, value)
    return getattr(deserialize_message(serialize_message(message), kind), field)


for kind, field, value in RIGHT:
    if arrives(kind, field, value) != value:
        changed.append(repr(value))
for kind, field, value, stated in STATED:
    try:
        seen = arrives(kind, field, value)
    except AssertionError:
        seen = 'refused'
    print(f'{kind.__name__}.{field} = {value!r}: {seen}')
    if checked:
        same = seen == 'refused'
    else:
        same = seen == stated or (seen != seen and stated != stated)
    if not same:
        changed.append(repr(value))
if changed:
    sys.exit(f'changed: {", ".join(changed)}')
PYTHON
"$folder/venv/bin/python" "$folder/fields.py"
echo 'with ROS_PYTHON_CHECK_FIELDS=1'
ROS_PYTHON_CHECK_FIELDS=1 "$folder/venv/bin/python" "$folder/fields.py"
echo 'as stated'
