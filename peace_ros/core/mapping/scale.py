# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the height changed between two pictures of the ground, measured in the pictures alone.

Corners are followed from one picture to the other (Lucas and Kanade, 1981) and projected onto level
ground one metre below the camera, each with its own attitude. What remains is a shift and a scale,
and the scale is the ratio of the heights. No altitude enters, so that no barometer does.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, hypot, radians
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera, Pose
from peace_ros.core.domain.geometry import ground_to_camera
from peace_ros.core.mapping.registration import Mismatch, View
from peace_ros.core.optics import pixels, rays

_CORNERS = 120
_CORNER_QUALITY = 0.01
_CORNER_DISTANCE_PX = 7
_FEWEST = 15
_LEAST_AGREEING = 0.5
"""Part of the corners that must move like one plane."""
_WINDOW = (21, 21)
_LEVELS = 3
_OFF_PX = 1.0
"""A corner agrees with the plane within this distance."""
_RETURN_PX = 0.5
"""A corner that is followed there and back must come back to where it was."""
_LARGEST_TURN_RAD = radians(3.0)
"""Attitudes leave no turn between the pictures: more shows that one of them is wrong."""
_FARTHEST = 2.0
"""Corners farther away over ground, in heights, say little of the height: they are left out."""
_LEAST_SPREAD = 0.08
"""Standard deviation of the corners, in heights: a narrow cluster gives no scale."""

Points = NDArray[np.float32]
"""N x 2, or N x 1 x 2 as OpenCV has them."""


@dataclass(frozen=True)
class HeightChange:
    """What two pictures say about the motion of the camera."""

    ratio: float
    """Height above ground at the second picture over that at the first."""
    moved: float
    """Way over ground in heights of the first picture."""


def height_change(before: View, after: View, camera: Camera) -> HeightChange | Mismatch:
    """Return the ratio of the heights of two views over level ground, or why it is unknown.

    Args:
        before: Grey picture with its attitude; altitude and position do not count.
        after: The same, of a later moment.
        camera: That of the full frames.
    """
    if before.grey.shape != after.grey.shape:
        return Mismatch.DIFFERENT
    if np.array_equal(before.grey, after.grey):
        return Mismatch.SAME
    corners = cv2.goodFeaturesToTrack(before.grey, _CORNERS, _CORNER_QUALITY, _CORNER_DISTANCE_PX)
    if corners is None or len(corners) < _FEWEST:
        return Mismatch.TEXTURE
    seen_from = [_one_above(view, camera) for view in (before, after)]
    guess = _in_picture(_on_ground(corners, *seen_from[0]), *seen_from[1])
    known = np.isfinite(guess).all(axis=1)
    if known.sum() < _FEWEST:
        return Mismatch.HORIZON
    seen = _followed(before.grey, after.grey, corners[known], guess[known].reshape(-1, 1, 2))
    if len(seen[0]) < _FEWEST:
        return Mismatch.DIFFERENT
    there, here = (_on_ground(points, *by) for points, by in zip(seen, seen_from, strict=True))
    return _fitted(there, here, _OFF_PX / seen_from[0][0].focal_px)


def _one_above(view: View, camera: Camera) -> tuple[Camera, Pose]:
    """Return the camera of the small picture, and its attitude one metre above the origin."""
    height, width = view.grey.shape
    pose = Pose(0, 0.0, 0.0, 0.0, view.pose.quaternion_ned_frd, 1.0)
    return camera.resized(width, height), pose


def _on_ground(points: Points, camera: Camera, pose: Pose) -> Points:
    """Return pixels (u, v) as ground (north, east); NaN above the horizon or too far away."""
    directions = rays(camera, *points.reshape(-1, 2).T)
    north, east, height = np.linalg.inv(ground_to_camera(camera, pose)) @ directions
    # A comparison with NaN is false, so pixels without a direction are left out too.
    near = np.hypot(north, east) <= _FARTHEST * height
    height[~near] = np.nan
    return np.ascontiguousarray(np.stack((north / height, east / height), axis=1), np.float32)


def _in_picture(ground: Points, camera: Camera, pose: Pose) -> Points:
    """Return ground (north, east) as pixels (u, v); NaN what is not in front of the camera."""
    directions = ground_to_camera(camera, pose) @ np.vstack((ground.T, np.ones(len(ground))))
    directions[:, ~(directions[2] > 0.0)] = np.nan
    return np.ascontiguousarray(pixels(camera, directions).T, np.float32)


def _followed(
    before: NDArray[np.uint8], after: NDArray[np.uint8], corners: Points, guess: Points
) -> tuple[Points, Points]:
    """Return where corners lie in both pictures (u, v); those that do not lead back are left.

    The search begins at the guess: where they are when only the attitude has changed.
    """
    how: dict[str, Any] = {
        'winSize': _WINDOW,
        'maxLevel': _LEVELS,
        'flags': cv2.OPTFLOW_USE_INITIAL_FLOW,
    }
    found, there, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, guess, **how)
    back, again, _ = cv2.calcOpticalFlowPyrLK(after, before, found, corners.copy(), **how)
    off_px = np.linalg.norm((back - corners).reshape(-1, 2), axis=1)
    kept = (there.ravel() > 0) & (again.ravel() > 0) & (off_px <= _RETURN_PX)
    return corners.reshape(-1, 2)[kept], found.reshape(-1, 2)[kept]


def _fitted(there: Points, here: Points, off: float) -> HeightChange | Mismatch:
    """Return the change that most points agree with, within a distance in heights."""
    known = np.isfinite(there).all(axis=1) & np.isfinite(here).all(axis=1)
    if known.sum() < _FEWEST:
        return Mismatch.HORIZON
    there, here = there[known], here[known]
    fit, agrees = cv2.estimateAffinePartial2D(
        there, here, method=cv2.RANSAC, ransacReprojThreshold=off
    )
    kept = np.zeros(len(there), np.bool_) if fit is None else agrees.ravel() > 0
    if kept.sum() < max(_FEWEST, _LEAST_AGREEING * len(there)):
        return Mismatch.DIFFERENT
    if there[kept].std(axis=0).min() < _LEAST_SPREAD:
        return Mismatch.TEXTURE
    scale = hypot(fit[0, 0], fit[1, 0])
    if abs(atan2(fit[1, 0], fit[0, 0])) > _LARGEST_TURN_RAD:
        return Mismatch.DIFFERENT
    return HeightChange(1.0 / scale, hypot(fit[0, 2], fit[1, 2]) / scale)
