# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The attitude of a gimbal out of GIMBAL_DEVICE_ATTITUDE_STATUS; pure."""

from __future__ import annotations

from math import hypot
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.motion import GimbalReport

MESSAGE = 'GIMBAL_DEVICE_ATTITUDE_STATUS'
_FAILURES = (
    mavlink.GIMBAL_DEVICE_ERROR_FLAGS_ENCODER_ERROR
    | mavlink.GIMBAL_DEVICE_ERROR_FLAGS_POWER_ERROR
    | mavlink.GIMBAL_DEVICE_ERROR_FLAGS_MOTOR_ERROR
    | mavlink.GIMBAL_DEVICE_ERROR_FLAGS_SOFTWARE_ERROR
    | mavlink.GIMBAL_DEVICE_ERROR_FLAGS_COMMS_ERROR
    | mavlink.GIMBAL_DEVICE_ERROR_FLAGS_CALIBRATION_RUNNING
)
"""With one of these the attitude may be another; at a limit of its range it is right."""


class GimbalWatch:
    """Keeps the newest attitude of one gimbal.

    Args:
        device_id: its ``gimbal_device_id``; 0: the only one that reports.
        limit_s: age at which a report is stale.
    """

    def __init__(self, device_id: int, limit_s: float) -> None:
        self._wanted, self._limit_ns = device_id, limit_s * 1e9
        self._arrived_ns: dict[int, int] = {}
        self._newest: GimbalReport | None = None

    def take(self, m: Any, stamp_ns: int, steady_ns: int) -> None:
        """Take a message whose quaternion is known to be a rotation.

        Args:
            m: GIMBAL_DEVICE_ATTITUDE_STATUS.
            stamp_ns: its moment by the node clock.
            steady_ns: steady clock at receipt.
        """
        if self._wanted in {0, m.gimbal_device_id}:
            self._arrived_ns[m.gimbal_device_id] = steady_ns
            size = hypot(*m.q)
            w, x, y, z = (each / size for each in m.q)
            problem = self._problem(m, steady_ns)
            self._newest = GimbalReport(stamp_ns, (w, x, y, z), _is_in_earth(m.flags), problem)

    def fresh(self, steady_ns: int) -> GimbalReport | None:
        """Return the newest report, None when it is stale or there was none."""
        return self._newest if self._ids(steady_ns) else None

    def _ids(self, steady_ns: int) -> list[int]:
        return sorted(i for i, at in self._arrived_ns.items() if steady_ns - at <= self._limit_ns)

    def _problem(self, m: Any, steady_ns: int) -> str:
        if len(ids := self._ids(steady_ns)) > 1:
            names = ' and '.join(map(str, ids))
            return f'gimbals {names} report their attitude: set vehicle.gimbal_id to that of ours'
        if failure := m.failure_flags & _FAILURES:
            return f'the gimbal reports a failure (flags 0x{failure:X}): its attitude is not known'
        return ''


def _is_in_earth(flags: int) -> bool:
    """Return whether yaw counts from north; without a flag for it, as MAVLink had it before."""
    if flags & mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME:
        return False
    either = mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME | mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK
    return bool(flags & either)
