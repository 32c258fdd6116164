# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A vehicle that flies exactly as it is told: velocities along the image axes are integrated."""

from __future__ import annotations

from math import cos, isfinite, sin

from peace_ros.core.domain import Pose, VehicleError
from peace_ros.core.domain.geometry import quaternion_from_euler


class TwistVehicle:
    """Level attitude, heading turned by yaw rate only; it stops when no command comes."""

    def __init__(self, altitude_m: float, timeout_s: float) -> None:
        self._north_m = self._east_m = 0.0
        self._altitude_m = altitude_m
        self._yaw_ned_rad = 0.0
        self._timeout_s = timeout_s
        self._velocity = (0.0, 0.0, 0.0, 0.0)
        self._told_s: float | None = None
        self._last_ns: int | None = None

    def command(
        self,
        forward_m_s: float,
        left_m_s: float,
        up_m_s: float,
        yaw_left_rad_s: float,
        now_s: float,
    ) -> None:
        """Take a velocity (REP-103 body axes) at a moment of the steady clock.

        Raises:
            VehicleError: a component is not finite; the velocity before it stays.
        """
        velocity = (forward_m_s, left_m_s, up_m_s, yaw_left_rad_s)
        if not all(map(isfinite, velocity)):
            raise VehicleError(f'velocity {velocity}: all components must be finite')
        self._velocity, self._told_s = velocity, now_s

    def advance(self, stamp_ns: int, now_s: float) -> Pose:
        """Fly to a moment of the node clock and return the pose there."""
        dt_s = 0.0 if self._last_ns is None else max(0.0, (stamp_ns - self._last_ns) / 1e9)
        self._last_ns = stamp_ns
        if self._told_s is None or now_s - self._told_s > self._timeout_s:
            self._velocity = (0.0, 0.0, 0.0, 0.0)
        forward, left, up, yaw_left = self._velocity
        c, s = cos(self._yaw_ned_rad), sin(self._yaw_ned_rad)
        self._north_m += dt_s * (c * forward + s * left)
        self._east_m += dt_s * (s * forward - c * left)
        self._altitude_m = max(0.0, self._altitude_m + dt_s * up)
        self._yaw_ned_rad -= dt_s * yaw_left
        return Pose(
            stamp_ns,
            self._north_m,
            self._east_m,
            -self._altitude_m,
            quaternion_from_euler(0.0, 0.0, self._yaw_ned_rad),
            self._altitude_m,
        )
