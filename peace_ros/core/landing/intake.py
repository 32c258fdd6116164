# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which heatmaps reach the map, with which pose, and when the map is dropped.

The map is built from positions of the vehicle. When the position jumps, or is unknown for a while,
the map no longer fits the ground and is dropped.
"""

from __future__ import annotations

from collections import Counter, deque

import numpy as np

from peace_ros.core.domain import (
    NADIR,
    Camera,
    DepthImage,
    Frame,
    GimbalReport,
    Heatmap,
    ImageError,
    Mount,
    Pose,
)
from peace_ros.core.domain.geometry import camera_pose
from peace_ros.core.landing.calibration import Calibration, has_shape
from peace_ros.core.landing.gimbal import GimbalMount
from peace_ros.core.landing.odometry import PositionCarrier
from peace_ros.core.landing.parameters import LandingParameters
from peace_ros.core.landing.picture_height import PictureHeight
from peace_ros.core.landing.picture_watch import PictureWatch
from peace_ros.core.landing.poses import Miss, PoseHistory, jump_m
from peace_ros.core.mapping import RefusedLookError, SafetyMap

_PENDING_LIMIT = 4
_REASONS = 64
"""So many are counted apart."""


class HeatmapIntake:
    """Pairs heatmaps with poses by stamp; what cannot be used is counted with its reason.

    Inside, all poses are those of the camera: how it is mounted is applied where they come in.
    """

    def __init__(
        self,
        parameters: LandingParameters,
        camera: Camera,
        safety_map: SafetyMap,
        mount: Mount = NADIR,
        *,
        on_gimbal: bool = False,
    ) -> None:
        self._p = parameters
        self._calibration = Calibration(camera)
        self._camera = camera
        self._mount = mount
        self._gimbal = GimbalMount(mount, parameters.pose_gap_limit_s) if on_gimbal else None
        self._map = safety_map
        self._poses = PoseHistory(parameters.pose_gap_limit_s)
        self._carrier = PositionCarrier(camera, parameters.pose_gap_limit_s, safety_map)
        self._pictures = PictureWatch()
        self._pending: deque[Heatmap] = deque()
        self._depths: deque[DepthImage] = deque(maxlen=_PENDING_LIMIT)
        self._newest_depth_ns = -1
        self._waiting = (-1, 0)
        """Stamp of the heatmap that waits for a pose, and since when (ns)."""
        self._clock_ns: int | None = None
        self.counts: Counter[str] = Counter()
        """Heatmaps by result: `used`, or the reason of a rejection."""
        self._last_rejection = self._drop_reason = ''
        self._distrusted = ''
        self.drops = 0
        """How often the map was dropped; a site chosen from it is no longer valid then."""

    @property
    def distrusted(self) -> str:
        """Why nothing that comes is used now, empty when it is."""
        return self._distrusted or ('' if self._gimbal is None else self._gimbal.problem)

    @property
    def picture_height(self) -> PictureHeight:
        """The height by the scale of the pictures."""
        return self._carrier.height

    @property
    def last_rejection(self) -> str:
        """Why the map is not newer: why it was dropped, or why the last heatmap was rejected."""
        return self._drop_reason or self._last_rejection

    def clear(self) -> None:
        """Forget poses and waiting heatmaps; counts stay."""
        self._poses.clear()
        self._carrier.clear()
        self._pending.clear()
        self._depths.clear()
        self._newest_depth_ns = -1
        self._clock_ns = None
        if self._gimbal is not None:
            self._gimbal.clear()

    def distrust(self, reason: str) -> None:
        """Drop the map and use nothing that comes while there is a reason; empty: use it again."""
        self._distrusted = reason
        if reason:
            self.clear()
            self._drop_map(reason)

    def add_pose(self, pose: Pose, mount: Mount | None = None) -> None:
        """Keep a pose, north and east NaN where unknown, and use the heatmaps that wait for it."""
        if self.distrusted:
            return
        if self._gimbal is None:
            self._add_camera_pose(camera_pose(mount or self._mount, pose))
        else:
            self._gimbal.add_pose(pose)

    def follow_gimbal(self, report: GimbalReport | None) -> None:
        """Turn a camera on a gimbal as its newest report says; None when none is fresh."""
        if self._gimbal is not None:
            self._gimbal.see(report)
            for pose in self._gimbal.take_placed():
                self._add_camera_pose(pose)

    def _add_camera_pose(self, pose: Pose) -> None:
        if not pose.has_position:
            kept = self._carrier.add_pose(pose)
        else:
            before = self._poses.newest
            kept = self._poses.add(pose)
            if kept and before is not None:
                self._watch_jump(before, pose)
            kept = kept and self._carrier.add_pose(pose)
        if not kept:
            self.counts['pose rejected'] += 1
            return
        self._settle()

    def add_view(self, frame: Frame) -> None:
        """Keep the picture of a frame, from which the position is estimated when it is unknown."""
        if not has_shape(self._camera, *frame.size_px):
            self.counts['picture of another shape than the frames'] += 1
        elif self._carrier.add_view(frame):
            self._settle()

    def _watch_jump(self, before: Pose, pose: Pose) -> None:
        jumped_m = jump_m(before, pose)
        if jumped_m == 0.0:
            return
        self._drop_map(f'the position jumped by {jumped_m:.1f} m')
        # The poses of before the jump are in another frame.
        self._poses.clear()
        self._poses.add(pose)

    def _drop_map(self, reason: str) -> None:
        self._carrier.forget_way()
        if self._map.stamp_ns is None:
            return
        self._map.clear()
        self.drops += 1
        self.counts['map dropped'] += 1
        self._drop_reason = f'{reason}, so the map was dropped'

    def add_heatmap(self, heatmap: Heatmap) -> None:
        """Use a heatmap, let it wait for its pose, or reject it."""
        newest_ns = self._pending[-1].stamp_ns if self._pending else self._map.stamp_ns
        if self.distrusted:
            self.reject(self.distrusted)
        elif not np.isfinite(heatmap.safety).all():
            self.reject('not finite')
        elif newest_ns is not None and heatmap.stamp_ns <= newest_ns:
            self.reject('not newer than the last')
        elif self._clock_ns is not None and self._is_future(heatmap, self._clock_ns):
            self.reject('stamp in the future')
        else:
            self._pending.append(heatmap)
            if len(self._pending) > _PENDING_LIMIT:
                self._pending.popleft()
                self.reject('overtaken while it waited for a pose')
            self._settle()

    def add_depth(self, depth: DepthImage) -> None:
        """Use a depth image, or let it wait for its pose; when too many wait the oldest is lost."""
        if depth.stamp_ns <= self._newest_depth_ns:
            self.counts['depth not newer than the last'] += 1
            return
        self._newest_depth_ns = depth.stamp_ns
        self._depths.append(depth)
        self._settle()

    def tick(self, now_ns: int) -> None:
        """Set the time: heatmaps that waited too long or have a future stamp are rejected."""
        self._clock_ns = now_ns
        limit_ns = round(self._p.pose_wait_limit_s * 1e9)
        while self._pending and self._is_future(self._pending[-1], now_ns):
            self._pending.pop()
            self.reject('stamp in the future')
        while self._pending:
            stamp_ns = self._pending[0].stamp_ns
            if self._waiting[0] != stamp_ns:
                self._waiting = (stamp_ns, now_ns)
            if now_ns - self._waiting[1] <= limit_ns:
                break
            self._pending.popleft()
            self.reject(Miss.NOT_YET.value)
        self._watch_position(now_ns)

    def _watch_position(self, now_ns: int) -> None:
        newest = self._poses.newest
        told_ns = max(0 if newest is None else newest.stamp_ns, self._carrier.newest_ns or 0)
        gap_s = (now_ns - told_ns) * 1e-9
        if gap_s > self._map.parameters.position_gap_limit_s:
            self._drop_map(f'no position for {gap_s:.1f} s')

    def _is_future(self, heatmap: Heatmap, now_ns: int) -> bool:
        return heatmap.stamp_ns > now_ns + round(self._p.future_tolerance_s * 1e9)

    def _pose_at(self, stamp_ns: int) -> Pose | Miss:
        pose = self._poses.at(stamp_ns)
        if not self._carrier.is_carrying:
            return pose
        # A position that has come back is used only after pictures have confirmed it.
        before_gap = isinstance(pose, Pose) and stamp_ns < (self._carrier.newest_ns or 0)
        return pose if before_gap else self._carrier.at(stamp_ns)

    def _settle(self) -> None:
        lost = self._carrier.settle(self._poses)
        if lost:
            self._drop_map(lost)
            self._poses.clear()
        self._settle_depths()
        while self._pending:
            pose = self._pose_at(self._pending[0].stamp_ns)
            if pose is Miss.NOT_YET:
                return
            problem = self._use(self._pending.popleft(), pose)
            if problem:
                self.reject(problem)
            else:
                self.counts['used'] += 1
                self._drop_reason = ''

    def _use(self, heatmap: Heatmap, pose: Pose | Miss) -> str:
        """Put a heatmap into the map; return why it is rejected, empty when it is used."""
        if isinstance(pose, Miss):
            return pose.value
        camera = self._calibration.camera_of(heatmap)
        if isinstance(camera, str):
            return camera
        if camera != self._camera:
            self._camera = camera
            self._carrier.change_camera(camera)
            self._drop_map('the camera has another calibration')
        problem = self._pictures.problem(heatmap, pose)
        if problem:
            return problem
        try:
            self._map.add(heatmap, self._camera, pose)
        except ImageError:
            return 'values outside of 0 to 1'
        except RefusedLookError as refusal:
            return refusal.fate
        return ''

    def _settle_depths(self) -> None:
        while self._depths:
            pose = self._pose_at(self._depths[0].stamp_ns)
            if pose is Miss.NOT_YET:
                return
            depth = self._depths.popleft()
            fate = 'depth used'
            if isinstance(pose, Miss):
                fate = f'depth: {pose.value}'
            elif not has_shape(self._camera, depth.depth_m.shape[1], depth.depth_m.shape[0]):
                fate = 'depth of another shape than the frames'
            else:
                try:
                    self._map.add_depth(depth, self._camera, pose)
                except RefusedLookError as refusal:
                    fate = f'depth {refusal.fate}'
            self.counts[fate] += 1

    def reject(self, reason: str) -> None:
        """Count a heatmap that is not used, and remember why."""
        # Reasons may hold sizes and names of frames, of which there is no end.
        is_known = reason in self.counts or len(self.counts) < _REASONS
        self.counts[reason if is_known else 'other reasons'] += 1
        self._last_rejection = reason
