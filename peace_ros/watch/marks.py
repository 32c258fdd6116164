# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where places on the ground are seen in a picture."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from math import cos, pi, sin
from typing import Any

import numpy as np

from peace_ros.core.domain import Camera, Mount, Pose
from peace_ros.core.domain.geometry import (
    camera_pose,
    ground_to_camera,
    interpolate,
    mount_from_degrees,
)
from peace_ros.core.optics import pixels

_CORNERS = 24
"""Of the polygon that a circle on the ground becomes."""
_FAR_NS = 500_000_000
"""Poses farther from a picture than this do not belong to it."""
_ANGLES = ('mount_roll', 'mount_pitch', 'mount_yaw')
_OFFSETS = ('mount_x', 'mount_y', 'mount_z')


def mount_of(parameters: Mapping[str, Any]) -> Mount | None:
    """Return how the camera is mounted by the parameters of the landing node.

    None where they are not known, or where tf or a gimbal says it.
    """
    if parameters.get('mount_source') != 'parameters' or parameters.get('vehicle.follow_gimbal'):
        return None
    try:
        roll, pitch, yaw = (float(parameters[name]) for name in _ANGLES)
        x, y, z = (float(parameters[name]) for name in _OFFSETS)
    except KeyError:
        return None
    return mount_from_degrees((roll, pitch, yaw), (x, y, z))


def camera_of(parameters: Mapping[str, Any]) -> Camera | None:
    """Return the camera of frames without a calibration, None while it is not known."""
    try:
        size = int(parameters['camera_width']), int(parameters['camera_height'])
        return Camera.from_degrees(*size, float(parameters['camera_fov']))
    except KeyError:
        return None


def pose_at(poses: Sequence[Pose], stamp_ns: int) -> Pose | None:
    """Return the pose at a stamp: between two poses, or that of a pose less than 0.5 s away."""
    after = bisect_left(poses, stamp_ns, key=lambda pose: pose.stamp_ns)
    if 0 < after < len(poses):
        return interpolate(poses[after - 1], poses[after], stamp_ns)
    if not poses:
        return None
    nearest = poses[min(after, len(poses) - 1)]
    return nearest if abs(nearest.stamp_ns - stamp_ns) <= _FAR_NS else None


def marks(
    circles: Iterable[Mapping[str, Any]], camera: Camera, mount: Mount, pose: Pose
) -> list[dict[str, Any]]:
    """Return circles on the ground as polygons in the picture.

    Args:
        circles: Each with kind, north_m, east_m and radius_m.
        camera: That of the full frame, with its lens.
        mount: How it sits on the vehicle.
        pose: Of the vehicle when the picture was taken.

    Returns:
        Per circle its kind, the middle and the corners, as fractions of width and height from the
        upper left corner. Circles that are not wholly in front of the camera are left out.
    """
    to_camera = ground_to_camera(camera, camera_pose(mount, pose))
    size = np.array([[camera.width_px], [camera.height_px]], float)
    turns = [2.0 * pi * corner / _CORNERS for corner in range(_CORNERS)]
    found = []
    for each in circles:
        north_m, east_m, radius_m = each['north_m'], each['east_m'], each['radius_m']
        ring = [(north_m + radius_m * cos(t), east_m + radius_m * sin(t), 1.0) for t in turns]
        points = np.array([(north_m, east_m, 1.0), *ring]).T
        directions = to_camera @ points
        if not (directions[2] > 0.0).all():
            continue
        seen = pixels(camera, directions) / size
        if np.isfinite(seen).all():
            middle, *corners = np.round(seen.T, 4).tolist()
            found.append({'kind': each['kind'], 'middle': middle, 'corners': corners})
    return found
