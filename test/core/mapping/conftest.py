# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Heatmaps with a spot, and poses, for the tests of the map."""

from math import radians

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import Camera, Heatmap, Pose
from peace_ros.core.domain.geometry import quaternion_from_euler

cv2.setNumThreads(1)  # one of two cores; the pictures are small

CAMERA = Camera.from_degrees(352, 352, 73.0)


@pytest.fixture
def camera():
    return CAMERA


@pytest.fixture
def pose_at():
    def build(altitude_m=30.0, north_m=0.0, east_m=0.0, *, roll=0.0, pitch=0.0, yaw=0.0) -> Pose:
        attitude = quaternion_from_euler(radians(roll), radians(pitch), radians(yaw))
        return Pose(0, north_m, east_m, -altitude_m, attitude, altitude_m)

    return build


@pytest.fixture
def look():
    """Build a heatmap of one value with a spot of another in its middle."""

    def build(time_s, value=0.9, *, spot=None, spot_px=0, aside_px=0) -> Heatmap:
        safety = np.full((352, 352), value, np.float32)
        if spot is not None:
            low = 176 - spot_px // 2
            safety[low : low + spot_px, low + aside_px : low + aside_px + spot_px] = spot
        return Heatmap(safety, round(time_s * 1e9))

    return build
