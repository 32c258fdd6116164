# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every conversion between frames, in one place: ENU/NED, FLU/FRD, image/ground."""

from __future__ import annotations

from dataclasses import replace
from math import acos, atan2, cos, radians, sin

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain.camera import NADIR, Camera, Mount, Quaternion
from peace_ros.core.domain.motion import Pose

GRAVITY_M_S2 = 9.80665

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


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the rotation that first rotates as b does, then as a does."""
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
    return _positive_w(multiply(multiply(_NED_TO_ENU, q), _FRD_TO_FLU))


def attitude_enu_flu_to_ned_frd(q: Quaternion) -> Quaternion:
    """Turn an attitude of REP-103 (FLU in ENU) into that of aviation (FRD in NED)."""
    return _positive_w(multiply(multiply(_NED_TO_ENU, q), _FRD_TO_FLU))


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


def camera_pose(mount: Mount, pose: Pose) -> Pose:
    """Return where a mounted camera is and how it is turned, for the pose of the vehicle.

    The attitude is that of a vehicle below which a nadir camera would look the same way, so that
    everything that knows nadir cameras knows this one. What is not known (NaN) stays so.
    """
    if mount == NADIR:
        return pose
    north, east, down = rotation_matrix(pose.quaternion_ned_frd) @ np.array(mount.offset_frd_m)
    return replace(
        pose,
        north_m=pose.north_m + float(north),
        east_m=pose.east_m + float(east),
        down_m=pose.down_m + float(down),
        quaternion_ned_frd=multiply(pose.quaternion_ned_frd, mount.quaternion),
        altitude_agl_m=pose.altitude_agl_m - float(down),
    )


def camera_pose_on_gimbal(mount: Mount, pose: Pose, gimbal: Quaternion, *, in_earth: bool) -> Pose:
    """Return where a camera on a gimbal is and how it is turned, as :func:`camera_pose` does.

    Args:
        mount: where the gimbal is on the vehicle, and how the camera is turned on it; by default it
            looks forward of the gimbal, with the top of its picture up.
        pose: of the vehicle.
        gimbal: attitude of the gimbal (forward, right, down), see GimbalReport.
        in_earth: it is in NED, otherwise from the heading of the vehicle.
    """
    place = camera_pose(Mount(offset_frd_m=mount.offset_frd_m), pose)
    if not in_earth:
        heading_rad = yaw_from_quaternion(pose.quaternion_ned_frd)
        gimbal = multiply(quaternion_from_euler(0.0, 0.0, heading_rad), gimbal)
    turned = multiply(multiply(gimbal, _NADIR_TO_FORWARD), mount.quaternion)
    return replace(place, quaternion_ned_frd=turned)


_NADIR_TO_FORWARD: Quaternion = (_SQRT_HALF, 0.0, _SQRT_HALF, 0.0)
"""A quarter turn up about the right axis: a camera that looked down looks forward."""


def ground_to_camera(camera: Camera, pose: Pose) -> NDArray[np.float64]:
    """Return the 3 x 3 matrix from level ground (north m, east m, 1) to the axes of the picture.

    The result is in metres to its right, down in it, and along the view: the ground point is in
    front of the camera when the last one is positive.

    Args:
        camera: its rectification counts, its lens does not.
        pose: of a nadir camera; see :func:`camera_pose` for others. The ground is the plane
            ``altitude_agl_m`` below it.
    """
    body_from_ned = rotation_matrix(pose.quaternion_ned_frd).T
    ned_from_ground = np.array(
        [[1.0, 0.0, -pose.north_m], [0.0, 1.0, -pose.east_m], [0.0, 0.0, pose.altitude_agl_m]]
    )
    rectification = np.reshape(camera.rectification, (3, 3))
    return np.asarray(rectification @ _OPTICAL_FROM_BODY @ body_from_ned @ ned_from_ground)


_OPTICAL_FROM_BODY = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Nadir: the right of the picture is the right wing, down in it is the tail, the view is down."""


def ground_to_image(camera: Camera, pose: Pose) -> NDArray[np.float64]:
    """Return the 3 x 3 homography from level ground (north m, east m, 1) to pixels (u, v, 1).

    It is that of the lens without its distortion; see :func:`ground_to_camera` otherwise.
    """
    return np.asarray(camera.matrix @ ground_to_camera(camera, pose), dtype=np.float64)


def mount_from_degrees(
    roll_pitch_yaw_deg: tuple[float, float, float], offset_frd_m: tuple[float, float, float]
) -> Mount:
    """Return the mount of a nadir camera that is turned by yaw, then pitch, then roll.

    Above 0, pitch lets it look ahead, roll to the left, and yaw turns the top of its picture to
    the right.
    """
    return Mount(quaternion_from_euler(*map(radians, roll_pitch_yaw_deg)), offset_frd_m)


def mount_from_optical(rotation_flu: Quaternion, offset_flu_m: tuple[float, float, float]) -> Mount:
    """Return the mount of a camera whose optical frame (REP-103) lies so in that of the vehicle.

    Args:
        rotation_flu: of the transform base_link (forward, left, up) to optical frame, as tf has it.
        offset_flu_m: its translation.
    """
    frd_from_optical = multiply(_FRD_TO_FLU, rotation_flu)
    x, y, z = offset_flu_m
    return Mount(_positive_w(multiply(frd_from_optical, _BODY_TO_OPTICAL)), (x, -y, -z))


def optical_from_mount(mount: Mount) -> tuple[Quaternion, tuple[float, float, float]]:
    """Return rotation and translation (m) of base_link to the optical frame of a mounted camera.

    The inverse of :func:`mount_from_optical`.
    """
    optical_from_body = (_SQRT_HALF, 0.0, 0.0, _SQRT_HALF)
    turned = multiply(_FRD_TO_FLU, multiply(mount.quaternion, optical_from_body))
    x, y, z = mount.offset_frd_m
    return _positive_w(turned), (x, -y, -z)


_BODY_TO_OPTICAL: Quaternion = (_SQRT_HALF, 0.0, 0.0, -_SQRT_HALF)
"""A quarter turn about the view: from the right of the picture to the top of it."""


def footprint_m(camera: Camera, altitude_agl_m: float) -> tuple[float, float]:
    """Return (across, along) metres of ground that a level camera sees, without distortion."""
    fx, fy = camera.focal_xy_px
    return camera.width_px / fx * altitude_agl_m, camera.height_px / fy * altitude_agl_m
