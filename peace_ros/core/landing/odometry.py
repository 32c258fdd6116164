# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Position while the autopilot has none: estimated by camera pictures from the last known one.

Each picture is compared with a key picture. The key stays while enough of it is in view, so that
the estimate of a hovering vehicle does not drift; each new key adds its error.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from math import hypot

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera, Frame, Pose
from peace_ros.core.domain.geometry import footprint_m
from peace_ros.core.landing.picture_height import PictureHeight
from peace_ros.core.landing.poses import Miss, PoseHistory
from peace_ros.core.mapping import Displacement, Mismatch, SafetyMap, View, register, small_grey

_PENDING_LIMIT = 8
_NEW_KEY_DISTANCE = 0.2
"""Of the footprint."""
_NEW_KEY_ALTITUDE = 1.2
_LOST_NS = 1_000_000_000
"""Without a picture that gives the position for this long the map is dropped."""
_RETURN_M = 3.0
"""A position that returns within this distance of the estimate (plus drift) confirms it."""


@dataclass(frozen=True)
class _Fix:
    view: View
    """With its position."""
    drift_m: float


class VisualOdometry:
    """Estimates the position by pictures, from a known one on; pure."""

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self._key: _Fix | None = None
        self._last: _Fix | None = None

    @property
    def is_anchored(self) -> bool:
        """Whether there is a position to start from."""
        return self._key is not None

    @property
    def drift_m(self) -> float:
        """Possible error of the newest position, grown since the anchor."""
        return 0.0 if self._last is None else self._last.drift_m

    def clear(self) -> None:
        """Forget every picture."""
        self._key = self._last = None

    def anchor(self, view: View) -> None:
        """Start from a view whose pose has the true position."""
        self._key = self._last = _Fix(view, 0.0)

    def follow(self, view: View) -> Pose | Mismatch:
        """Return the pose of a view whose position is not known, or why there is none.

        :raises ValueError: when nothing was anchored.
        """
        if self._key is None or self._last is None:
            raise ValueError('no known position to follow from: call anchor first')
        if np.array_equal(view.grey, self._last.view.grey):
            return Mismatch.SAME
        fix = self._from(self._key, view)
        if isinstance(fix, Mismatch) and self._last is not self._key:
            fix = self._from(self._last, view)
        if isinstance(fix, Mismatch):
            return fix
        self._last = fix
        if self._has_left(self._key.view.pose, fix.view.pose):
            self._key = fix
        return fix.view.pose

    def _from(self, known: _Fix, view: View) -> _Fix | Mismatch:
        moved = register(known.view, view, self._camera)
        if not isinstance(moved, Displacement):
            return moved
        at = known.view.pose
        pose = replace(
            view.pose, north_m=at.north_m + moved.north_m, east_m=at.east_m + moved.east_m
        )
        return _Fix(replace(view, pose=pose), known.drift_m + moved.error_m)

    def _has_left(self, key: Pose, pose: Pose) -> bool:
        moved_m = hypot(pose.north_m - key.north_m, pose.east_m - key.east_m)
        low, high = sorted((key.altitude_agl_m, pose.altitude_agl_m))
        width_m = min(footprint_m(self._camera, low))
        return moved_m > _NEW_KEY_DISTANCE * width_m or high > _NEW_KEY_ALTITUDE * low


class PositionCarrier:
    """Pairs pictures with attitudes, estimates the position while there is none, widens the map."""

    def __init__(self, camera: Camera, gap_limit_s: float, safety_map: SafetyMap) -> None:
        self._map = safety_map
        self._odometry = VisualOdometry(camera)
        self.height = PictureHeight(camera)
        self._attitudes = PoseHistory(gap_limit_s)
        self._carried = PoseHistory(gap_limit_s)
        self._pending: deque[tuple[int, NDArray[np.uint8]]] = deque(maxlen=_PENDING_LIMIT)
        self._newest_view_ns = -1
        self._told_ns = 0
        self._widened_m = 0.0
        self.is_carrying = False
        """The present position is estimated by pictures."""

    def clear(self) -> None:
        """Forget poses and pictures."""
        self._attitudes.clear()
        self._newest_view_ns = -1
        self.height.begin()
        self.forget_way()

    def change_camera(self, camera: Camera) -> None:
        """Use another camera; the estimate begins again."""
        self._odometry = VisualOdometry(camera)
        self.height.change_camera(camera)
        self.forget_way()

    def forget_way(self) -> None:
        """Forget the estimate; it starts again from the next known position."""
        self._pending.clear()
        self._carried.clear()
        self._odometry.clear()
        self.is_carrying = False

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest estimated position, None when there is none."""
        newest = self._carried.newest
        return None if newest is None else newest.stamp_ns

    def add_pose(self, pose: Pose) -> bool:
        """Keep attitude and altitude of a pose, whose position may be unknown (NaN)."""
        return self._attitudes.add(replace(pose, north_m=0.0, east_m=0.0, down_m=0.0))

    def add_view(self, frame: Frame) -> bool:
        """Keep a picture; False when it is not newer than the last one."""
        if frame.stamp_ns <= self._newest_view_ns:
            return False
        self._newest_view_ns = frame.stamp_ns
        self._pending.append((frame.stamp_ns, small_grey(frame.image_rgb)))
        return True

    def at(self, stamp_ns: int) -> Pose | Miss:
        """Return the estimated pose at a stamp, or why there is none."""
        return self._carried.at(stamp_ns)

    def settle(self, positions: PoseHistory) -> str:
        """Use the pictures whose attitude is known by now.

        :return: why the map must be dropped, empty when it may stay.
        """
        while self._pending:
            stamp_ns, grey = self._pending[0]
            attitude = self._attitudes.at(stamp_ns)
            if attitude is Miss.NOT_YET:
                return ''
            self._pending.popleft()
            if isinstance(attitude, Miss):
                continue
            view, position = View(grey, attitude), positions.at(stamp_ns)
            self.height.take(view)
            if isinstance(position, Pose):
                lost = self._come_back(view, position)
            else:
                lost = self._carry_on(view)
            if lost:
                self.forget_way()
                return lost
        return ''

    def _carry_on(self, view: View) -> str:
        if not self._odometry.is_anchored:
            return ''
        pose = self._odometry.follow(view)
        stamp_ns = view.pose.stamp_ns
        if isinstance(pose, Mismatch):
            if stamp_ns - self._told_ns <= _LOST_NS:
                return ''
            return f'no position, and pictures do not give one: {pose.value}'
        self._told_ns = stamp_ns
        self._carried.add(pose)
        self.is_carrying = True
        self._lose_accuracy(self._odometry.drift_m)
        return ''

    def _come_back(self, view: View, position: Pose) -> str:
        """Take a known position; the map stays only when it confirms the estimate."""
        if self.is_carrying:
            carried = self._odometry.follow(view)
            if isinstance(carried, Mismatch):
                return f'position is back, and pictures do not confirm it: {carried.value}'
            off_m = hypot(carried.north_m - position.north_m, carried.east_m - position.east_m)
            if off_m > _RETURN_M + self._odometry.drift_m:
                return f'position is back, {off_m:.1f} m from the estimate by pictures'
            self._lose_accuracy(self._widened_m + off_m)
        self._odometry.anchor(View(view.grey, position))
        self._carried.clear()
        self._told_ns = position.stamp_ns
        self._widened_m = 0.0
        self.is_carrying = False
        return ''

    def _lose_accuracy(self, drift_m: float) -> None:
        """Let unsafe ground grow with the drift, in whole cells."""
        cell_m = self._map.parameters.map_cell_m
        cells = int((drift_m - self._widened_m) / cell_m)
        if cells > 0:
            self._map.widen_unsafe(cells * cell_m)
            self._widened_m += cells * cell_m
