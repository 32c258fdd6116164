# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A motion estimate -> what tells the position filter of an autopilot how the vehicle moves.

Stamps are of the node clock. PX4 maps them to its own by TIMESYNC; ArduPilot uses only their
differences, and a delay that is set (VISO_DELAY_MS).
"""

from __future__ import annotations

from math import atan2, hypot, nan, radians
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.errors import VehicleError
from peace_ros.core.domain.geometry import rotation_matrix
from peace_ros.core.domain.odometry import MotionEstimate

ANGLE_VARIANCE_RAD2 = radians(3.0) ** 2
"""Of roll, pitch and yaw in VISION_POSITION_ESTIMATE, where a filter may read them."""
VERTICAL_VARIANCE_M2_S2 = 100.0
"""Of the vertical velocity: barometer and accelerometers of the autopilot know it better."""


def check_motion(estimate: MotionEstimate) -> None:
    """Refuse an estimate of which a part is not finite.

    Raises:
        VehicleError: With the part.
    """
    pose = estimate.pose
    parts: dict[str, list[float] | NDArray[np.float64]] = {
        'position (m)': [pose.north_m, pose.east_m, pose.down_m],
        'attitude': list(pose.quaternion_ned_frd),
        'position covariance (m^2)': estimate.position_covariance_m2,
        'velocity (m/s)': estimate.velocity_m_s,
        'velocity covariance (m^2/s^2)': estimate.velocity_covariance_m2_s2,
    }
    for name, values in parts.items():
        if not np.isfinite(values).all():
            told = ' '.join(np.array2string(np.asarray(values)).split())
            raise VehicleError(
                f'{name} {told} of a motion estimate: all numbers must be finite; nothing was sent'
            )


def vision_messages(estimate: MotionEstimate) -> list[Any]:
    """Return VISION_POSITION_ESTIMATE and VISION_SPEED_ESTIMATE, local NED."""
    pose, resets = estimate.pose, estimate.resets % 256
    r = rotation_matrix(pose.quaternion_ned_frd)
    roll, pitch = atan2(r[2, 1], r[2, 2]), atan2(-r[2, 0], hypot(r[2, 1], r[2, 2]))
    return [
        mavlink.MAVLink_vision_position_estimate_message(
            pose.stamp_ns // 1000,
            *(pose.north_m, pose.east_m, pose.down_m),
            *(roll, pitch, atan2(r[1, 0], r[0, 0])),
            _upper_triangle(estimate.position_covariance_m2, ANGLE_VARIANCE_RAD2),
            resets,
        ),
        mavlink.MAVLink_vision_speed_estimate_message(
            estimate.velocity_stamp_ns // 1000,
            *(float(each) for each in estimate.velocity_m_s),
            [float(each) for each in _with_vague_vertical(estimate).ravel()],
            resets,
        ),
    ]


def odometry_message(estimate: MotionEstimate) -> Any:
    """Return ODOMETRY with position and velocity in local NED.

    It has one stamp. The velocity is that of an earlier moment than the frame, and velocity
    counts most, so the position is brought back to that moment. The attitude is not known there
    and stays away (NaN), so that no heading is taken from it.
    """
    pose = estimate.pose
    back_s = (pose.stamp_ns - estimate.velocity_stamp_ns) * 1e-9
    velocity = [float(each) for each in estimate.velocity_m_s]
    position = [
        place - back_s * speed
        for place, speed in zip((pose.north_m, pose.east_m, pose.down_m), velocity, strict=True)
    ]
    return mavlink.MAVLink_odometry_message(
        estimate.velocity_stamp_ns // 1000,
        *(mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_NED),
        *position,
        [nan] * 4,
        *velocity,
        *(nan, nan, nan),
        _upper_triangle(estimate.position_covariance_m2),
        _upper_triangle(_with_vague_vertical(estimate)),
        estimate.resets % 256,
        mavlink.MAV_ESTIMATOR_TYPE_VIO,
        max(1, round(100.0 * estimate.quality)),
    )


def _with_vague_vertical(estimate: MotionEstimate) -> NDArray[np.float64]:
    covariance: NDArray[np.float64] = estimate.velocity_covariance_m2_s2.copy()
    covariance[2, :] = covariance[:, 2] = 0.0
    covariance[2, 2] = VERTICAL_VARIANCE_M2_S2
    return covariance


def _upper_triangle(covariance: NDArray[np.float64], others: float = nan) -> list[float]:
    """Return 21 numbers, row by row, of a 6 x 6 whose second half has variances ``others``."""
    whole = np.zeros((6, 6))
    whole[:3, :3] = covariance
    whole[3:, 3:] = np.diag([others] * 3)
    return [float(each) for each in whole[np.triu_indices(6)]]
