#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# OpenCV 4 moves pixels by steps of 1/32 when it warps, also in float32; OpenCV 5 moves them by what
# was asked for. The same call gives other pictures with the two, and a shift of 0.3 px is 0.3125 px.
#
# Guess before looking: float32 pictures are interpolated in float32, only uint8 ones in steps, and
# the two major versions agree.
# Seen (opencv-python-headless 4.13.0.92 and 5.0.0.93), a float32 ramp of 1 per pixel, moved to the
# right:
#   asked for   4.13        5.0
#   0.300 px    0.3125 px   0.3000 px
#   0.010 px    0.0000 px   0.0100 px
#   the same with warpAffine, warpPerspective and remap, linear
# What is measured on such pictures (optical flow, registration) is off by up to 1/64 px with 4.x, and a
# digest of pictures is that of one major version.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/warp.py" <<'PYTHON'
import sys

import cv2
import numpy as np

STEPS = {'4': lambda shift: round(shift * 32) / 32, '5': lambda shift: shift}[sys.argv[1]]
ramp = np.tile(np.arange(64, dtype=np.float32), (48, 1))
columns, rows = np.meshgrid(np.arange(64, dtype=np.float32), np.arange(48, dtype=np.float32))


def moved_px(picture):
    """Return how far a ramp has moved, away from its borders."""
    return float((ramp - picture)[8:-8, 8:-8].mean())


changed = []
for shift in (0.3, 0.01, 0.5):
    matrix = np.array([[1, 0, shift], [0, 1, 0], [0, 0, 1]])
    found = {
        'warpAffine': moved_px(cv2.warpAffine(ramp, matrix[:2], (64, 48))),
        'warpPerspective': moved_px(cv2.warpPerspective(ramp, matrix, (64, 48))),
        'remap': moved_px(cv2.remap(ramp, columns - np.float32(shift), rows, cv2.INTER_LINEAR)),
    }
    print(cv2.__version__, f'{shift} px:', {name: round(px, 4) for name, px in found.items()})
    changed += [name for name, px in found.items() if abs(px - STEPS(shift)) > 1e-4]
if changed:
    sys.exit(f'changed: {", ".join(changed)}')
PYTHON
for version in 4.13.0.92 5.0.0.93; do
    python3 -m venv "$folder/$version"
    "$folder/$version/bin/pip" install --quiet --disable-pip-version-check \
        opencv-python-headless==$version numpy==2.4.6
    "$folder/$version/bin/python" "$folder/warp.py" ${version%%.*}
done
echo 'as stated'
