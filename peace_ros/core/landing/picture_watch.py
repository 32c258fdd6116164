# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Heatmaps that cannot be of the ground below, however fresh their stamps are."""

from __future__ import annotations

from math import acos, dist, radians

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Heatmap, Pose

STUCK = 'the picture does not change although the vehicle moves'
EVEN = 'every pixel is called surely safe'
_MOVED_M = 0.5
_TURNED_RAD = radians(3.0)
_SAFE = 0.5
"""Only what calls something safe can do harm: an unsafe heatmap is believed in any case."""


class PictureWatch:
    """Remembers the newest heatmap, and from where it was seen first."""

    def __init__(self) -> None:
        self._first: tuple[NDArray[np.float32], Pose] | None = None

    def problem(self, heatmap: Heatmap, pose: Pose) -> str:
        """Return why a heatmap cannot be believed, empty when it can.

        A driver that repeats its last picture with new stamps gives heatmaps that are equal to the
        last bit; those of a vehicle that hovers in a simulation may be so too, which does no harm.
        """
        safety = heatmap.safety
        highest = float(safety.max())
        if highest == float(safety.min()):
            # Of one value there is nothing to compare; surely safe everywhere is no place on earth.
            return EVEN if highest == 1.0 else ''
        if self._first is None or not np.array_equal(safety, self._first[0]):
            self._first = (safety, pose)
            return ''
        return STUCK if highest > _SAFE and _has_moved(self._first[1], pose) else ''


def _has_moved(before: Pose, after: Pose) -> bool:
    here, there = ((pose.north_m, pose.east_m, pose.altitude_agl_m) for pose in (after, before))
    one, other = before.quaternion_ned_frd, after.quaternion_ned_frd
    cosine = abs(sum(a * b for a, b in zip(one, other, strict=True)))
    return dist(here, there) > _MOVED_M or 2.0 * acos(min(1.0, cosine)) > _TURNED_RAD
