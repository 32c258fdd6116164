# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the vehicle was when a picture was taken."""

from __future__ import annotations

from bisect import bisect_left
from enum import Enum
from math import isfinite

from peace_ros.domain import Pose
from peace_ros.domain.geometry import interpolate

_MEMORY_NS = 10_000_000_000


class Miss(Enum):
    """Why there is no pose at a stamp."""

    NOT_YET = 'no pose after its stamp'
    TOO_OLD = 'older than every pose'
    GAP = 'poses around it are too far apart'


class PoseHistory:
    """The poses of the last ten seconds, by stamp."""

    def __init__(self, gap_limit_s: float) -> None:
        self._gap_limit_ns = round(gap_limit_s * 1e9)
        self._poses: list[Pose] = []
        self._stamps: list[int] = []

    def clear(self) -> None:
        """Forget every pose."""
        self._poses.clear()
        self._stamps.clear()

    def add(self, pose: Pose) -> bool:
        """Keep a pose; False when it is not finite or not newer than the last."""
        numbers = (
            pose.north_m,
            pose.east_m,
            pose.down_m,
            pose.altitude_agl_m,
            *pose.quaternion_ned_frd,
        )
        length_sq = sum(part * part for part in pose.quaternion_ned_frd)
        if not all(isfinite(number) for number in numbers) or not 0.98 < length_sq < 1.02:
            return False
        if self._stamps and pose.stamp_ns <= self._stamps[-1]:
            return False
        self._poses.append(pose)
        self._stamps.append(pose.stamp_ns)
        outdated = bisect_left(self._stamps, pose.stamp_ns - _MEMORY_NS)
        del self._poses[:outdated], self._stamps[:outdated]
        return True

    def at(self, stamp_ns: int) -> Pose | Miss:
        """Return the pose at a stamp, interpolated, or why there is none."""
        after = bisect_left(self._stamps, stamp_ns)
        if after == len(self._stamps):
            return Miss.NOT_YET
        if self._stamps[after] == stamp_ns:
            return self._poses[after]
        if after == 0:
            return Miss.TOO_OLD
        if self._stamps[after] - self._stamps[after - 1] > self._gap_limit_ns:
            return Miss.GAP
        return interpolate(self._poses[after - 1], self._poses[after], stamp_ns)
