#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# pymavlink's rotation matrix calls a camera that looks straight down one that is turned by 180 degrees.
#
# Guess before looking: at a pitch of -90 degrees roll and yaw cannot be told apart, so to_euler
# gives -90 degrees and some roll and yaw.
# Seen (pymavlink 2.4.50): Matrix3.from_euler(roll, pitch, yaw) and then to_euler() give
#   pitch -89.99   -89.99
#   pitch -90      +180        not -90, and with the other sign
#   pitch +90      -180
# from -89.9999999 degrees on, which is where the sine rounds to one. QuaternionBase gives -90.
# A gimbal's nadir is that pitch. Do not go through Euler angles for a camera that looks down, or
# take asin of the matrix.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pymavlink==2.4.50 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
from math import degrees, radians

from pymavlink.quaternion import QuaternionBase
from pymavlink.rotmat import Matrix3

STATED = {-89.99: -89.99, -90.0: 180.0, 90.0: -180.0}
for pitch, stated in STATED.items():
    turned = Matrix3()
    turned.from_euler(0.1, radians(pitch), 0.2)
    by_matrix = degrees(turned.to_euler()[1])
    turn = QuaternionBase([0.1, radians(pitch), 0.2])
    by_quaternion = degrees(QuaternionBase(turn.q).euler[1])
    print(f'pitch {pitch:7.2f}: Matrix3 {by_matrix:8.2f}, QuaternionBase {by_quaternion:7.2f}')
    if abs(by_matrix - stated) > 0.001 or abs(by_quaternion - pitch) > 0.01:
        raise SystemExit('changed')
print('as stated')
PYTHON
