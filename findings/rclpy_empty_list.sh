#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# An empty list in a parameter file has no type in ROS 2. To rclpy it is a value that was never given,
# and a node that declares what it finds in its files ends with an exception that names no parameter.
#
# Guess before looking: the parameter is an empty list of the type of its default.
# Seen (ros-jazzy-rclpy 7.1.6), a file with "names: []":
#   declare_parameter('names', ['a'])   the value is None, not [] and not ['a']
#   declare_parameter('names', [])      in code: the type is BYTE_ARRAY, and ['b'] is then refused
#   automatically_declare_parameters_from_overrides=True
#       ValueError: Cannot declare a statically typed parameter with default value of type
#       PARAMETER_NOT_SET
# Whoever turns a list off by emptying it gets None or a traceback. Take None for an empty list.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
    ros-jazzy-rclpy==7.1.6 ros-jazzy-rmw-fastrtps-cpp
export AMENT_PREFIX_PATH=$folder/venv ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_LOG_DIR=$folder/log
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH PYTHONPATH
printf '/**:\n  ros__parameters:\n    names: []\n' > "$folder/a.yaml"
"$folder/venv/bin/python" - "$folder/a.yaml" <<'PYTHON'
import sys

import rclpy
from rclpy.parameter import Parameter

rclpy.init(args=['--ros-args', '--params-file', sys.argv[1]])
node = rclpy.create_node('plain')
given = node.declare_parameter('names', ['a']).value
print('declared with a default:', given)
kind = node.declare_parameter('in_code', []).type_.name
taken = node.set_parameters([Parameter('in_code', value=['b'])])[0].successful
print('declared empty in code:', kind, '- takes a text:', taken)
try:
    rclpy.create_node('automatic', automatically_declare_parameters_from_overrides=True)
    automatic = 'created'
except ValueError as error:
    automatic = str(error)
print('declared automatically:', automatic)
rclpy.shutdown()
expected = 'Cannot declare a statically typed parameter with default value of type PARAMETER_NOT_SET'
if (given, kind, taken, automatic) != (None, 'BYTE_ARRAY', False, expected):
    raise SystemExit('changed')
print('as stated')
PYTHON
