# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which heatmaps reach the map, and with which pose."""

from __future__ import annotations

from collections import Counter, deque

import numpy as np

from peace_ros.domain import Camera, Heatmap, ImageError, Pose, VehicleError
from peace_ros.landing.parameters import LandingParameters
from peace_ros.landing.poses import Miss, PoseHistory
from peace_ros.mapping import SafetyMap

_PENDING_LIMIT = 4


class HeatmapIntake:
    """Pairs heatmaps with poses by stamp; what cannot be used is counted with its reason."""

    def __init__(
        self, parameters: LandingParameters, camera: Camera, safety_map: SafetyMap
    ) -> None:
        self._p = parameters
        self._camera = camera
        self._map = safety_map
        self._poses = PoseHistory(parameters.pose_gap_limit_s)
        self._pending: deque[Heatmap] = deque()
        self._waiting_since_ns: dict[int, int] = {}
        self._clock_ns: int | None = None
        self.counts: Counter[str] = Counter()
        """Heatmaps by fate: `used`, or the reason of a rejection."""
        self.last_rejection = ''

    def clear(self) -> None:
        """Forget poses and waiting heatmaps; counts stay."""
        self._poses.clear()
        self._pending.clear()
        self._waiting_since_ns.clear()
        self._clock_ns = None

    def add_pose(self, pose: Pose) -> None:
        """Keep a pose and use the heatmaps that waited for it."""
        if not self._poses.add(pose):
            self.counts['pose rejected'] += 1
            return
        self._settle()

    def add_heatmap(self, heatmap: Heatmap) -> None:
        """Use a heatmap, let it wait for its pose, or reject it."""
        newest_ns = self._pending[-1].stamp_ns if self._pending else self._map.stamp_ns
        if not np.isfinite(heatmap.safety).all():
            self._reject('not finite')
        elif newest_ns is not None and heatmap.stamp_ns <= newest_ns:
            self._reject('not newer than the last')
        elif self._clock_ns is not None and self._is_future(heatmap, self._clock_ns):
            self._reject('stamp in the future')
        else:
            self._pending.append(heatmap)
            if len(self._pending) > _PENDING_LIMIT:
                self._drop('overtaken while it waited for a pose')
            self._settle()

    def tick(self, now_ns: int) -> None:
        """Tell the time: heatmaps that have waited too long, or that lie ahead, are rejected."""
        self._clock_ns = now_ns
        limit_ns = round(self._p.pose_wait_limit_s * 1e9)
        while self._pending and self._is_future(self._pending[-1], now_ns):
            self._forget_wait(self._pending.pop())
            self._reject('stamp in the future')
        while self._pending:
            since_ns = self._waiting_since_ns.setdefault(self._pending[0].stamp_ns, now_ns)
            if now_ns - since_ns <= limit_ns:
                break
            self._drop(Miss.NOT_YET.value)

    def _is_future(self, heatmap: Heatmap, now_ns: int) -> bool:
        return heatmap.stamp_ns > now_ns + round(self._p.future_tolerance_s * 1e9)

    def _settle(self) -> None:
        while self._pending:
            pose = self._poses.at(self._pending[0].stamp_ns)
            if pose is Miss.NOT_YET:
                return
            if isinstance(pose, Miss):
                self._drop(pose.value)
                continue
            heatmap = self._pending.popleft()
            self._forget_wait(heatmap)
            try:
                self._map.add(heatmap, self._camera, pose)
            except ImageError:
                self._reject('values outside of 0 to 1')
            except VehicleError:
                self._reject('taken too low above ground')
            else:
                self.counts['used'] += 1

    def _drop(self, reason: str) -> None:
        self._forget_wait(self._pending.popleft())
        self._reject(reason)

    def _forget_wait(self, heatmap: Heatmap) -> None:
        self._waiting_since_ns.pop(heatmap.stamp_ns, None)

    def _reject(self, reason: str) -> None:
        self.counts[reason] += 1
        self.last_rejection = reason
