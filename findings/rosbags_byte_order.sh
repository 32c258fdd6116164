#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# rosbags refuses a NumPy array of another type than the field's, but not one of another byte order:
# that is written as it lies in memory, and read as other numbers.
#
# Guess before looking: '>f4' is converted, or refused as float64 is.
# Seen (rosbags 0.11.9), data of a std_msgs/Float32MultiArray:
#   float32     [1.5 2.5] comes back
#   float64     ValueError
#   '>f4'       no error; [6.9e-41 1.2e-41] comes back (1.5 and 2.5 with their bytes turned)
# GeoTIFF, PGM of 16 bits and network formats give arrays of that order: convert them with
# astype(numpy.float32) before they go into a bag.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check rosbags==0.11.9 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import sys

import numpy as np
from rosbags.typesys import Stores, get_typestore

KIND = 'std_msgs/msg/Float32MultiArray'
store = get_typestore(Stores.ROS2_JAZZY)
layout = store.types['std_msgs/msg/MultiArrayLayout']([], 0)


def comes_back(kind):
    message = store.types[KIND](layout, np.array([1.5, 2.5], kind))
    try:
        return store.deserialize_cdr(store.serialize_cdr(message, KIND), KIND).data.tolist()
    except ValueError:
        return 'ValueError'


seen = {kind: comes_back(kind) for kind in ('<f4', '<f8', '>f4')}
turned = np.array([1.5, 2.5], '>f4').view('<f4').tolist()
for kind, values in seen.items():
    print(f'{kind}: {values}')
if sys.byteorder != 'little' or seen != {'<f4': [1.5, 2.5], '<f8': 'ValueError', '>f4': turned}:
    raise SystemExit('changed')
print('as stated')
PYTHON
