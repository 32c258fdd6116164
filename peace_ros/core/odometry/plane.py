# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How a camera moved over level ground, from where it sees points of that ground.

Rotation, shift and height are solved together. An attitude that is given, and an altitude that is
given, are starting points with an error; they are not taken for true. A wrong attitude that is
taken for true gives a wrong shift, and an autopilot that uses the shift then makes its attitude
worse.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain.camera import Quaternion
from peace_ros.core.domain.geometry import (
    multiply,
    quaternion_from_rotation_vector,
    rotation_matrix,
)

Array = NDArray[np.float64]

_STEPS = 4
_ROBUST = 2.0
"""Residuals beyond so many standard deviations count less (Huber, 1964)."""
LEAST_ERROR_PX = 0.1
"""A corner is not found more precisely."""
_MEDIAN = 1.1774
"""Of the length of two normal errors, in standard deviations (Rayleigh distribution)."""


@dataclass(frozen=True)
class RelativePose:
    """Where a vehicle's camera is and how the vehicle is turned, against a key frame.

    Lengths are in heights of the key frame above the ground.
    """

    quaternion_ned_frd: Quaternion
    shift: Array
    """(2,) North and east of the camera of the key frame."""
    ratio: float
    """Height above the ground."""

    @property
    def position(self) -> Array:
        """(3,) North, east and down of the camera of the key frame."""
        return np.array([*self.shift, 1.0 - self.ratio])


@dataclass(frozen=True)
class PriorErrors:
    """How far a place that was predicted may be off, one standard deviation."""

    turn_rad: float
    """About each axis of the vehicle."""
    log_ratio: float
    """Of the height, as a part of it."""


@dataclass(frozen=True)
class Solution:
    """The place at which the camera sees the points as it did."""

    place: RelativePose
    turned_rad: Array
    """(3,) Rotation from the predicted attitude, about the axes of the vehicle."""
    covariance: Array
    """6 x 6: turn (rad), north, east (heights), logarithm of the height ratio."""
    error_px: float
    """Robust standard deviation of the points."""


def view_of(place: RelativePose, optical_from_body: Array) -> Array:
    """Return the 3 x 3 matrix from (north, east, 1) to the axes of the camera.

    The ground is one height of the key frame below the camera of the key frame; north and east
    are metres over that height.

    Args:
        place: Of the camera.
        optical_from_body: 3 x 3, how it is mounted.
    """
    camera_from_ned = optical_from_body @ rotation_matrix(place.quaternion_ned_frd).T
    moved = np.eye(3)
    moved[:, 2] -= place.position
    return np.asarray(camera_from_ned @ moved)


def solve(
    ground: Array,
    seen: Array,
    predicted: RelativePose,
    errors: PriorErrors,
    optical_from_body: Array,
    focal_px: float,
    expected_ratio: float,
) -> Solution:
    """Return where the camera is, by iterated least squares with weights (Gauss-Newton).

    Args:
        ground: N x 3, points in heights of the key frame from its camera: north, east, down.
        seen: N x 2, tangents of the directions in which they are seen: right, down.
        predicted: RelativePose to begin from; its attitude is the mean of the prior.
        errors: Standard deviations of the priors.
        optical_from_body: 3 x 3, how the camera is mounted.
        focal_px: Pixels per tangent, so that errors are in pixels.
        expected_ratio: Mean of the prior of the height ratio.
    """
    place, turned = predicted, np.zeros(3)
    prior = np.diag([errors.turn_rad**-2] * 3 + [0.0, 0.0, errors.log_ratio**-2])
    information, error_px = prior, 0.0
    for _ in range(_STEPS):
        off, slopes = _residuals(ground, seen, place, optical_from_body, focal_px)
        lengths = np.linalg.norm(off, axis=1)
        error_px = max(LEAST_ERROR_PX, _median(lengths) / _MEDIAN)
        weights = np.minimum(1.0, _ROBUST * error_px / np.maximum(lengths, 1e-9)) / error_px**2
        weighted = slopes * weights[:, None, None]
        information = prior + np.einsum('nij,nik->jk', weighted, slopes)
        pull = np.array([*turned, 0.0, 0.0, log(place.ratio / expected_ratio)])
        step = np.linalg.solve(information, np.einsum('nij,ni->j', weighted, off) - prior @ pull)
        turned = turned + step[:3]
        place = RelativePose(
            multiply(predicted.quaternion_ned_frd, quaternion_from_rotation_vector(turned)),
            place.shift + step[3:5],
            place.ratio * exp(min(0.5, max(-0.5, step[5]))),
        )
    return Solution(place, turned, np.linalg.inv(information), error_px)


def _median(values: Array) -> float:
    middle = len(values) // 2
    return float(np.partition(values, middle)[middle])


def _residuals(
    ground: Array, seen: Array, place: RelativePose, optical_from_body: Array, focal_px: float
) -> tuple[Array, Array]:
    """Return by how many pixels (N x 2) points are off, and how they move with the place.

    :return: and N x 2 x 6: per turn, north, east, and logarithm of the ratio.
    """
    body_from_ned = rotation_matrix(place.quaternion_ned_frd).T
    in_body = (ground - place.position) @ body_from_ned.T
    x, y, z = optical_from_body @ in_body.T
    u, v = x / z, y / z
    off = focal_px * (seen - np.stack((u, v), axis=1))
    # How the point moves in the axes of the camera: with a turn (cross product), with the shift.
    crossed = np.zeros((len(ground), 3, 3))
    bx, by, bz = in_body.T
    crossed[:, 0, 1], crossed[:, 0, 2] = -bz, by
    crossed[:, 1, 0], crossed[:, 1, 2] = bz, -bx
    crossed[:, 2, 0], crossed[:, 2, 1] = -by, bx
    by_place = np.empty((len(ground), 3, 6))
    by_place[:, :, :3] = optical_from_body @ crossed
    by_place[:, :, 3:] = -(optical_from_body @ body_from_ned) @ np.diag([1.0, 1.0, -place.ratio])
    by_direction = np.zeros((len(ground), 2, 3))
    by_direction[:, 0, 0] = by_direction[:, 1, 1] = focal_px / z
    by_direction[:, 0, 2], by_direction[:, 1, 2] = -focal_px * u / z, -focal_px * v / z
    return off, by_direction @ by_place
