# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A camera on a gimbal: how it is turned at each pose of the vehicle."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from peace_ros.core.domain import GimbalReport, Mount, Pose
from peace_ros.core.domain.geometry import camera_pose_on_gimbal
from peace_ros.core.landing.poses import Miss, PoseHistory

_WAITING = 256
_SILENT = (
    'the autopilot does not report how the gimbal is turned (GIMBAL_DEVICE_ATTITUDE_STATUS): check '
    'the gimbal, or set vehicle.follow_gimbal to false for a fixed camera'
)


class GimbalMount:
    """Pairs poses of the vehicle with attitudes of its gimbal; both are interpolated.

    Args:
        mount: How the camera is turned on the gimbal, and where it is on the vehicle.
        gap_limit_s: Reports farther apart in time are not interpolated.
    """

    def __init__(self, mount: Mount, gap_limit_s: float) -> None:
        self._mount = mount
        self._attitudes = PoseHistory(gap_limit_s)
        self._in_earth = False
        self._waiting: deque[Pose] = deque(maxlen=_WAITING)
        self.problem = _SILENT
        """Why it is not known how the camera is turned; empty while it is."""

    def clear(self) -> None:
        """Forget poses and attitudes."""
        self._waiting.clear()
        self._attitudes.clear()

    def see(self, report: GimbalReport | None) -> None:
        """Take the newest report, also one that was taken before; None when none is fresh."""
        self.problem = _SILENT if report is None else report.problem
        if report is None or self.problem:
            return
        if report.in_earth is not self._in_earth:
            self._attitudes.clear()
            self._in_earth = report.in_earth
        self._attitudes.add(Pose(report.stamp_ns, 0.0, 0.0, 0.0, report.quaternion, 0.0))

    def add_pose(self, pose: Pose) -> None:
        """Let a pose of the vehicle wait for the attitude of the gimbal at its stamp."""
        self._waiting.append(pose)

    def take_placed(self) -> Iterator[Pose]:
        """Yield the poses of the camera (as of a nadir camera) that are known by now."""
        while self._waiting:
            turned = self._attitudes.at(self._waiting[0].stamp_ns)
            if turned is Miss.NOT_YET:
                return
            pose = self._waiting.popleft()
            if isinstance(turned, Pose):
                yield camera_pose_on_gimbal(
                    self._mount, pose, turned.quaternion_ned_frd, in_earth=self._in_earth
                )
