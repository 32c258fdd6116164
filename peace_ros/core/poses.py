# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Poses of ROS messages -> poses of the domain; whatever cannot be believed is a VehicleError.

Nodes and recordings read by the same rules; nothing here imports ROS or a type store.
"""

from __future__ import annotations

from math import isfinite, sqrt
from typing import Any

from peace_ros.core.domain import Pose, VehicleError
from peace_ros.core.domain.geometry import attitude_enu_flu_to_ned_frd, enu_to_ned

_LENGTHS = (0.9, 1.1)
"""Between which a quaternion's length counts as rounding; beyond, it is no rotation."""


def pose_from_enu_flu(stamp_ns: int, position: Any, orientation: Any) -> Pose:
    """Return the pose (NED, FRD) of a position in ENU and an attitude FLU in ENU (REP-103).

    The ground is taken to be at z = 0.

    Args:
        stamp_ns: of the message.
        position: has x, y and z in metres: Point or Vector3.
        orientation: has w, x, y and z: Quaternion.

    Raises:
        VehicleError: a value is not finite or the quaternion is not of unit length.
    """
    enu = float(position.x), float(position.y), float(position.z)
    turn = tuple(float(getattr(orientation, each)) for each in 'wxyz')
    length = sqrt(sum(each * each for each in turn))
    if not all(map(isfinite, (*enu, *turn))) or not _LENGTHS[0] < length < _LENGTHS[1]:
        raise VehicleError(
            f'pose {enu} with quaternion {turn} (length {length:.2f}) at {stamp_ns} ns: it must '
            'be in finite metres with a quaternion of length 1'
        )
    w, x, y, z = (each / length for each in turn)
    north, east, down = enu_to_ned(*enu)
    return Pose(stamp_ns, north, east, down, attitude_enu_flu_to_ned_frd((w, x, y, z)), -down)
