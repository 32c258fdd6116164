#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# OpenCV's undistortPoints stops after five iterations, many pixels from the answer, without saying
# so; its fisheye sister answers with -1000000 where a point has no direction.
#
# Guess before looking: undistortPoints is exact to a hundredth of a pixel inside the picture for
# calibrations as drone cameras have them, and a point outside of a fisheye's field is NaN or an error.
# Seen (opencv-python-headless 4.13.0.92), a camera of 1280 x 720 px with f = 600 px, the corners of
# a 9 x 7 grid over the picture, distorted again by projectPoints:
#   plumb_bob k1 -0.10, k2 0.02 (mild)              off by at most 0.003 px
#   plumb_bob k1 -0.28, k2 0.07 (action camera)     4.0 px
#   rational_polynomial (eight coefficients)        26.5 px
#   the same three with undistortPointsIter, 100 iterations   0.000 px
#   fisheye, f = 300 px: corners                    (-1000000, -1000000), which is no direction, but a number
# A pixel at the edge of a picture taken 100 m above the ground is 0.17 m: 26 px are 4 m.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
    opencv-python-headless==4.13.0.92 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import cv2
import numpy as np

CAMERA = np.array([[600.0, 0, 640], [0, 600, 360], [0, 0, 1]])
FISHEYE = np.array([[300.0, 0, 640], [0, 300, 360], [0, 0, 1]])
MODELS = {  # coefficients, the largest error in pixels with the default, and its tolerance
    'mild': ([-0.1, 0.02, 0, 0, 0], 0.003, 0.002),
    'action camera': ([-0.28, 0.07, 0, 0, 0], 4.0, 0.1),
    'rational': ([2.5, 1.2, 0, 0, 0.1, 2.8, 1.9, 0.4], 26.5, 0.5),
}
across, down = np.meshgrid(np.linspace(0, 1279, 9), np.linspace(0, 719, 7))
points = np.stack([across, down], axis=-1).reshape(-1, 1, 2)


def error_px(directions, model):
    rays = np.c_[directions.reshape(-1, 2), np.ones(len(directions))]
    again, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), CAMERA, model)
    return float(np.linalg.norm(again.reshape(-1, 2) - points.reshape(-1, 2), axis=1).max())


many = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
changed = []
for name, (coefficients, stated, tolerance) in MODELS.items():
    model = np.array(coefficients)
    default = error_px(cv2.undistortPoints(points, CAMERA, model), model)
    exact = error_px(cv2.undistortPointsIter(points, CAMERA, model, None, None, many), model)
    print(f'{name}: {default:.3f} px off, after 100 iterations {exact:.3f} px')
    if abs(default - stated) > tolerance or exact > 0.001:
        changed.append(name)
corner = cv2.fisheye.undistortPoints(points, FISHEYE, np.array([0.1, -0.05, 0.02, -0.01]))[0, 0]
print(f'fisheye: a corner has the direction {corner}')
if corner.tolist() != [-1000000.0, -1000000.0]:
    changed.append('fisheye')
if changed:
    raise SystemExit(f'changed: {", ".join(changed)}')
print('as stated')
PYTHON
