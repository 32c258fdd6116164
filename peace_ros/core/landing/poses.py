# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the vehicle was when a picture was taken.

Position is interpolated linearly, attitude along the shorter arc; nothing is extrapolated. At the
requested 30 Hz an acceleration of 3 m/s^2 bends the path between two poses by less than a
millimetre, so velocities would add nothing; across a gap they would hide a guess.
"""

from __future__ import annotations

from bisect import bisect_left
from enum import Enum
from math import hypot, radians

from peace_ros.core.domain import Pose
from peace_ros.core.domain.geometry import angle_between, interpolate

_MEMORY_NS = 10_000_000_000
_NS = 1e-9
_TURN_LIMIT_RAD = radians(20.0)
"""Between two poses; with more, the attitude in between is not known well enough."""
_JUMP_M = 2.0
_FASTEST_M_S = 30.0
_ALTITUDE_JUMP_M = 1.0
_FASTEST_VERTICAL_M_S = 15.0


class Miss(Enum):
    """Why there is no pose at a stamp."""

    NOT_YET = 'no pose after its stamp'
    TOO_OLD = 'older than every pose'
    GAP = 'poses around it are too far apart'
    TURN = 'the vehicle turned too far between the poses around it'
    JUMP = 'position or altitude jumped between the poses around it'


def jump_m(before: Pose, after: Pose) -> float:
    """Return how far the position jumped between two poses, 0 where a vehicle can fly so far."""
    moved_m = hypot(after.north_m - before.north_m, after.east_m - before.east_m)
    elapsed_s = (after.stamp_ns - before.stamp_ns) * _NS
    return moved_m if moved_m > _JUMP_M + _FASTEST_M_S * elapsed_s else 0.0


def _altitude_jumped(before: Pose, after: Pose) -> bool:
    elapsed_s = (after.stamp_ns - before.stamp_ns) * _NS
    changed_m = abs(after.altitude_agl_m - before.altitude_agl_m)
    return changed_m > _ALTITUDE_JUMP_M + _FASTEST_VERTICAL_M_S * elapsed_s


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

    @property
    def newest(self) -> Pose | None:
        """The newest pose, None when there is none."""
        return self._poses[-1] if self._poses else None

    def add(self, pose: Pose) -> bool:
        """Keep a pose; False when it cannot be or is not newer than the last."""
        if not (pose.has_position and pose.has_height and pose.has_attitude):
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
        one, other = self._poses[after - 1], self._poses[after]
        return self._miss(one, other) or interpolate(one, other, stamp_ns)

    def _miss(self, one: Pose, other: Pose) -> Miss | None:
        """Return why there is no pose between two others, None when there is."""
        if other.stamp_ns - one.stamp_ns > self._gap_limit_ns:
            return Miss.GAP
        if jump_m(one, other) > 0.0 or _altitude_jumped(one, other):
            return Miss.JUMP
        turned_rad = angle_between(one.quaternion_ned_frd, other.quaternion_ned_frd)
        return Miss.TURN if turned_rad > _TURN_LIMIT_RAD else None
