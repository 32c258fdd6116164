# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tells the autopilot how the vehicle moves, by odometry that is aligned while GNSS is good."""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from dataclasses import replace
from math import hypot
from typing import Protocol

import numpy as np

from peace_ros.core.domain import (
    NADIR,
    Camera,
    Frame,
    Heatmap,
    InertialSample,
    MotionEstimate,
    Mount,
    Pose,
    Telemetry,
    VehicleError,
)
from peace_ros.core.domain.geometry import interpolate
from peace_ros.core.odometry import Doubt, OdometryParameters, VisualInertialOdometry

_POSES = 128
_POSE_NS = 300_000_000
"""A frame whose stamp is farther from every pose has no altitude."""
_WAITING = 4
"""Frames that wait for body rates; older ones are dropped."""
_REALIGN_M = 2.0
"""A position that is off by more while GNSS is good is aligned again. There is no steady pull:
while the autopilot flies on vision, its position and attitude are ours."""
_AT_REST = np.diag([0.01, 0.01, 0.01])
"""Covariance of position (m^2) and velocity (m^2/s^2) of a vehicle that stands."""
_UNALIGNED = 'GNSS has not given a position to begin from'
_GAP = 'body rates were missing: without GNSS there is no attitude to begin from again'


class MotionLink(Protocol):
    """What is asked of the link to the autopilot."""

    @property
    def has_gnss_fix(self) -> bool:
        """A GNSS receiver has a 3D fix."""

    def telemetry(self) -> Telemetry:
        """Return what the autopilot last said."""

    def take_inertial(self) -> list[InertialSample]:
        """Return body rates and accelerations since the last call, oldest first."""

    def send_motion(self, estimate: MotionEstimate) -> None:
        """Tell the position filter how the vehicle moves; VehicleError when it cannot."""


class VisionFeed:
    """Frames, poses and body rates in, motion to the autopilot out; one thread calls it.

    On the ground it says that the vehicle stands, so that the autopilot finds external navigation
    healthy before it arms.

    Args:
        link: To the autopilot.
        camera: Of the frames that have no calibration of their own.
        mount: How the camera sits on the vehicle.
        parameters: Of the odometry.
    """

    def __init__(
        self,
        link: MotionLink,
        camera: Camera,
        mount: Mount = NADIR,
        parameters: OdometryParameters | None = None,
    ) -> None:
        self._link = link
        self._odometry = VisualInertialOdometry(camera, mount, parameters)
        self._poses: deque[Pose] = deque(maxlen=_POSES)
        self._frames: deque[Frame] = deque(maxlen=_WAITING)
        self._inertial_ns = 0
        self._aligned = False
        self._was_aligned = False
        self._stood = 0
        """How often a flight has ended: the position on the ground does not continue it."""
        self.problem = 'no picture has come'
        """Why the newest picture gave no motion, or why it was not sent; empty when it was."""
        self.sent = 0
        """Estimates that were sent."""
        self.off_m: float | None = None
        """Horizontal distance from the position of the autopilot while GNSS is good."""

    def add_pose(self, pose: Pose) -> None:
        """Keep a pose of the autopilot: only its altitude counts without GNSS."""
        if not self._poses or pose.stamp_ns > self._poses[-1].stamp_ns:
            self._poses.append(pose)

    def add_frame(self, frame: Frame) -> None:
        """Keep a frame until :meth:`step`."""
        self._frames.append(frame)

    def add_heatmap(self, heatmap: Heatmap) -> None:
        """Leave out corners that it calls clearly unsafe."""
        self._odometry.add_heatmap(heatmap)

    def step(self) -> None:
        """Work on the frames whose body rates have come."""
        for sample in self._link.take_inertial():
            if self._odometry.add_inertial(sample):
                self._inertial_ns = sample.stamp_ns
        while self._frames and self._frames[0].stamp_ns <= self._inertial_ns:
            self._look(self._frames.popleft(), self._link.telemetry())
        if len(self._frames) == _WAITING:
            self.problem = 'no body rates have come up to the stamps of the pictures'

    def _look(self, frame: Frame, told: Telemetry) -> None:
        pose = self._pose_at(frame.stamp_ns)
        if pose is None:
            self.problem = 'the autopilot gave no pose near the stamp of the picture'
            return
        good = self._link.has_gnss_fix and not told.position_problem and pose.has_position
        if told.landed:
            self._stand(pose, good=good)
            return
        if not self._aligned:
            self.problem = _GAP if self._was_aligned else _UNALIGNED
            if not good or not self._align(frame.stamp_ns, told):
                return
        found = self._odometry.add_frame(frame, pose.altitude_agl_m)
        if isinstance(found, Doubt):
            self.problem = found.value
            self._aligned = found not in {Doubt.RATES, Doubt.UNALIGNED}
            return
        self.off_m = None
        if good:
            self.off_m = hypot(found.pose.north_m - pose.north_m, found.pose.east_m - pose.east_m)
            self._aligned = self.off_m <= _REALIGN_M
        self._send(found)

    def _pose_at(self, stamp_ns: int) -> Pose | None:
        """Return the pose at a stamp; beyond the newest it is that one."""
        if not self._poses:
            return None
        after = bisect_left(self._poses, stamp_ns, key=lambda each: each.stamp_ns)
        near = [self._poses[i] for i in (after - 1, after) if 0 <= i < len(self._poses)]
        if min(abs(each.stamp_ns - stamp_ns) for each in near) > _POSE_NS:
            return None
        return interpolate(near[0], near[-1], stamp_ns) if len(near) == 2 else near[0]

    def _align(self, stamp_ns: int, told: Telemetry) -> bool:
        """Begin from the newest pose before a frame."""
        before = [each for each in self._poses if each.stamp_ns < stamp_ns]
        velocity = (told.v_north_m_s, told.v_east_m_s, told.v_down_m_s)
        if not before or not self._odometry.align(before[-1], velocity):
            return False
        self._aligned = self._was_aligned = True
        return True

    def _stand(self, pose: Pose, *, good: bool) -> None:
        """Say that the vehicle stands where GNSS says; the flight that follows begins anew."""
        if self._aligned:
            self._stood += 1
        self._aligned = False
        if not good:
            self.problem = _UNALIGNED
            return
        still, resets = np.zeros(3), self._odometry.resets
        self._send(MotionEstimate(pose, _AT_REST, still, pose.stamp_ns, _AT_REST, 1.0, resets))

    def _send(self, estimate: MotionEstimate) -> None:
        counted = replace(estimate, resets=estimate.resets + self._stood)
        try:
            self._link.send_motion(counted)
        except VehicleError as error:
            self.problem = str(error)
            return
        self.sent += 1
        self.problem = ''
