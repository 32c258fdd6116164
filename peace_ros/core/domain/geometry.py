# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every conversion between frames, in one place: ENU/NED, FLU/FRD, image/ground."""

from __future__ import annotations

from math import acos, atan2, cos, sin

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain.motion import Pose
from peace_ros.core.domain.perception import Camera

GRAVITY_M_S2 = 9.80665
Quaternion = tuple[float, float, float, float]

_SQRT_HALF = 0.5**0.5
_NED_TO_ENU: Quaternion = (0.0, _SQRT_HALF, _SQRT_HALF, 0.0)
"""Half a turn about the north-east diagonal; its own inverse."""
_FRD_TO_FLU: Quaternion = (0.0, 1.0, 0.0, 0.0)
"""Half a turn about forward; its own inverse up to sign."""


def ned_to_enu(north: float, east: float, down: float) -> tuple[float, float, float]:
    """Return (east, north, up)."""
    return east, north, -down


def enu_to_ned(east: float, north: float, up: float) -> tuple[float, float, float]:
    """Return (north, east, down)."""
    return north, east, -up


def _multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def _positive_w(q: Quaternion) -> Quaternion:
    return q if q[0] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])


def attitude_ned_frd_to_enu_flu(q: Quaternion) -> Quaternion:
    """Turn an attitude of aviation (FRD in NED) into that of REP-103 (FLU in ENU)."""
    return _positive_w(_multiply(_multiply(_NED_TO_ENU, q), _FRD_TO_FLU))


def attitude_enu_flu_to_ned_frd(q: Quaternion) -> Quaternion:
    """Turn an attitude of REP-103 (FLU in ENU) into that of aviation (FRD in NED)."""
    return _positive_w(_multiply(_multiply(_NED_TO_ENU, q), _FRD_TO_FLU))


def quaternion_from_euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """Return the quaternion of intrinsic yaw, pitch, roll (z-y-x), as MAVLink ATTITUDE means it."""
    cr, sr = cos(roll_rad / 2), sin(roll_rad / 2)
    cp, sp = cos(pitch_rad / 2), sin(pitch_rad / 2)
    cy, sy = cos(yaw_rad / 2), sin(yaw_rad / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def yaw_from_quaternion(q: Quaternion) -> float:
    """Return the heading in radians, in the frame of the quaternion (NED: clockwise from north)."""
    w, x, y, z = q
    return atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def rotation_matrix(q: Quaternion) -> NDArray[np.float64]:
    """Return the 3 x 3 matrix that rotates as the unit quaternion does."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def lean_acceleration(q: Quaternion) -> tuple[float, float]:
    """Return the horizontal acceleration (north, east, m/s^2) that the lean of a multicopter gives.

    Its thrust carries its weight; a lean of more than 84 degrees counts as that.
    """
    w, x, y, z = q
    upright = max(0.1, 1.0 - 2.0 * (x * x + y * y))
    scale = -2.0 * GRAVITY_M_S2 / upright
    return scale * (x * z + w * y), scale * (y * z - w * x)


def angle_between(a: Quaternion, b: Quaternion) -> float:
    """Return the angle in radians, 0 to pi, of the rotation from one attitude to the other."""
    return 2.0 * acos(min(1.0, abs(sum(one * other for one, other in zip(a, b, strict=True)))))


def slerp(a: Quaternion, b: Quaternion, fraction: float) -> Quaternion:
    """Interpolate two near attitudes along the shorter arc; fraction 0 gives a, 1 gives b."""
    va, vb = np.asarray(a), np.asarray(b)
    dot = float(va @ vb)
    if dot < 0.0:
        vb, dot = -vb, -dot
    if dot > 0.9995:
        mixed = va + fraction * (vb - va)
    else:
        angle = np.arccos(dot)
        mixed = (np.sin((1 - fraction) * angle) * va + np.sin(fraction * angle) * vb) / np.sin(
            angle
        )
    mixed = mixed / np.linalg.norm(mixed)
    return (float(mixed[0]), float(mixed[1]), float(mixed[2]), float(mixed[3]))


def interpolate(before: Pose, after: Pose, stamp_ns: int) -> Pose:
    """Return the pose at a stamp between two poses (linear in position, slerp in attitude)."""
    span = after.stamp_ns - before.stamp_ns
    fraction = 0.0 if span == 0 else (stamp_ns - before.stamp_ns) / span

    def mix(a: float, b: float) -> float:
        return a + fraction * (b - a)

    return Pose(
        stamp_ns=stamp_ns,
        north_m=mix(before.north_m, after.north_m),
        east_m=mix(before.east_m, after.east_m),
        down_m=mix(before.down_m, after.down_m),
        quaternion_ned_frd=slerp(before.quaternion_ned_frd, after.quaternion_ned_frd, fraction),
        altitude_agl_m=mix(before.altitude_agl_m, after.altitude_agl_m),
    )


def ground_to_image(camera: Camera, pose: Pose) -> NDArray[np.float64]:
    """Return the 3 x 3 homography from level ground (north m, east m, 1) to pixels (u, v, 1).

    The ground is the plane ``altitude_agl_m`` below the vehicle. A ground point is in front of
    the camera when the third homogeneous coordinate is positive.
    """
    body_from_ned = rotation_matrix(pose.quaternion_ned_frd).T
    # Ground point relative to the camera in NED: (n - north, e - east, altitude).
    ned_from_ground = np.array(
        [[1.0, 0.0, -pose.north_m], [0.0, 1.0, -pose.east_m], [0.0, 0.0, pose.altitude_agl_m]]
    )
    f = camera.focal_px
    cu, cv = camera.centre_px
    # u grows to the right wing, v grows to the tail, depth along body-down.
    pixel_from_body = np.array([[0.0, f, cu], [-f, 0.0, cv], [0.0, 0.0, 1.0]])
    return np.asarray(pixel_from_body @ body_from_ned @ ned_from_ground, dtype=np.float64)


def image_to_ground(camera: Camera, pose: Pose) -> NDArray[np.float64]:
    """Return the inverse of :func:`ground_to_image`; meaningless above the horizon."""
    return np.asarray(np.linalg.inv(ground_to_image(camera, pose)), dtype=np.float64)


def footprint_m(camera: Camera, altitude_agl_m: float) -> tuple[float, float]:
    """Return (across, along) metres of ground that a level camera sees."""
    across = camera.width_px / camera.focal_px * altitude_agl_m
    return across, across * camera.height_px / camera.width_px
