#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# A string of ROS 2 that holds a zero character is cut there on its way out of Python, without an
# error. The format on the wire (CDR) has the length in front and could carry it.
#
# Guess before looking: it arrives whole, or setting it raises ValueError, as Python itself says
# "embedded null character".
# Seen (ros-jazzy-rclpy 7.1.6, ros-jazzy-common-interfaces 5.3.6):
#   'safe\0 and unsafe'    arrives as 'safe'
#   the same in string[]   'safe' and the next element whole
#   serialised by hand with the zero inside: read as 'safe' too
# Text that came from a file, a serial line or a bag may say less than what was checked.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check ros-jazzy-rclpy==7.1.6 \
    ros-jazzy-common-interfaces==5.3.6 ros-jazzy-rmw-fastrtps-cpp numpy==2.4.6
export AMENT_PREFIX_PATH=$folder/venv ROS_LOG_DIR=$folder/log
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH PYTHONPATH
"$folder/venv/bin/python" - <<'PYTHON'
import struct

from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import String

text = 'safe\0 and unsafe'
one = deserialize_message(serialize_message(String(data=text)), String).data
many = deserialize_message(serialize_message(JointState(name=[text, 'b'])), JointState).name
raw = text.encode() + b'\0'
by_hand = b'\0\1\0\0' + struct.pack('<I', len(raw)) + raw
read = deserialize_message(by_hand, String).data
print(f'string {one!r}, string[] {many!r}, serialised by hand {read!r}')
if (one, many, read) != ('safe', ['safe', 'b'], 'safe'):
    raise SystemExit('changed')
print('as stated')
PYTHON
