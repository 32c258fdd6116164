# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rejects heatmaps that cannot show the ground below, however fresh their stamps are."""

from __future__ import annotations

from math import dist, radians

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Heatmap, Pose
from peace_ros.core.domain.geometry import angle_between

STUCK = 'the picture does not change although the vehicle moves'
EVEN = 'every pixel has the highest safety score'
_MOVED_M = 0.5
_TURNED_RAD = radians(3.0)
_SAFE = 0.5
"""A heatmap without a value above this calls nothing safe, and is accepted in any case."""


class PictureWatch:
    """Remembers the newest heatmap, and from where it was seen first."""

    def __init__(self) -> None:
        self._first: tuple[NDArray[np.float32], Pose] | None = None

    def problem(self, heatmap: Heatmap, pose: Pose) -> str:
        """Return why a heatmap is rejected, empty when it is accepted.

        A driver that repeats its last picture with new stamps gives heatmaps that are equal to the
        last bit. So may a vehicle that hovers in a simulation: equal heatmaps are rejected only
        when the vehicle has moved.
        """
        safety = heatmap.safety
        highest = float(safety.max())
        if highest == float(safety.min()):
            # A frozen camera cannot be told from one value; no real scene is safe everywhere.
            return EVEN if highest == 1.0 else ''
        if self._first is None or not np.array_equal(safety, self._first[0]):
            self._first = (safety, pose)
            return ''
        return STUCK if highest > _SAFE and _has_moved(self._first[1], pose) else ''


def _has_moved(before: Pose, after: Pose) -> bool:
    here, there = ((pose.north_m, pose.east_m, pose.altitude_agl_m) for pose in (after, before))
    turned_rad = angle_between(before.quaternion_ned_frd, after.quaternion_ned_frd)
    return dist(here, there) > _MOVED_M or turned_rad > _TURNED_RAD
