#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# rcl and PyYAML read the same parameter file differently, in both directions and without a word.
#
# Guess before looking: they differ in 1e5 (a text to PyYAML, as YAML 1.1 wants it) and nowhere else.
# Seen (ros-jazzy-rclpy 7.1.6, PyYAML 6.0.3):
#   in the file     rcl                   PyYAML
#   08              8.0 (a double)        '08'         while both read 010 as 8 and 007 as 7
#   y, N            true, false           'y', 'N'
#   infinity, NAN   inf, nan              texts
#   0x1p3           8.0                   '0x1p3'
#   2^63            9.223372036854776e+18 the integer
#   1_000, 0b11     texts                 1000, 3
#   1:30            '1:30'                90           (base 60)
#   2026-11-30      a text                a date
#   ~, null         '~', 'null'           None
#   !!float 5       5 (an integer)        5.0          rcl ignores the tag
# A tool that checks or replays a configuration with PyYAML accepts files that the node refuses, and
# the other way round; a list of words with a y in it becomes truths.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
    ros-jazzy-rclpy==7.1.6 ros-jazzy-rmw-fastrtps-cpp PyYAML==6.0.3
export AMENT_PREFIX_PATH=$folder/venv ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_LOG_DIR=$folder/log
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH PYTHONPATH
"$folder/venv/bin/python" - "$folder/a.yaml" <<'PYTHON'
import datetime
import sys
from math import inf, nan

import rclpy
import yaml
from rclpy.node import Node

STATED = {  # in the file -> what rcl takes it for, what PyYAML takes it for
    '08': (8.0, '08'),
    '010': (8, 8),
    '007': (7, 7),
    'y': (True, 'y'),
    'N': (False, 'N'),
    'infinity': (inf, 'infinity'),
    'NAN': (nan, 'NAN'),
    '0x1p3': (8.0, '0x1p3'),
    str(2**63): (9.223372036854776e18, 2**63),
    '1e5': (100000.0, '1e5'),
    '1_000': ('1_000', 1000),
    '0b11': ('0b11', 3),
    '1:30': ('1:30', 90),
    '2026-11-30': ('2026-11-30', datetime.date(2026, 11, 30)),
    '~': ('~', None),
    'null': ('null', None),
    '!!float 5': (5, 5.0),
}
path = sys.argv[1]
with open(path, 'w') as file:
    file.write('/**:\n  ros__parameters:\n')
    file.writelines(f'    a{index}: {text}\n' for index, text in enumerate(STATED))
with open(path) as file:
    by_pyyaml = list(yaml.safe_load(file)['/**']['ros__parameters'].values())
rclpy.init(args=['--ros-args', '--params-file', path])
node = Node('reader', automatically_declare_parameters_from_overrides=True)
by_rcl = [node.get_parameter(f'a{index}').value for index in range(len(STATED))]
node.destroy_node()
rclpy.shutdown()

changed = []
for (text, stated), *seen in zip(STATED.items(), by_rcl, by_pyyaml):
    print(f'{text:20} rcl {seen[0]!r:24} PyYAML {seen[1]!r}')
    if [repr(each) for each in seen] != [repr(each) for each in stated]:
        changed.append(text)
if changed:
    raise SystemExit(f'changed: {", ".join(changed)}')
print('as stated')
PYTHON
