# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Directions <-> pixels of a lens with distortion, by OpenCV.

The models are those of sensor_msgs/CameraInfo: plumb_bob and rational_polynomial are OpenCV's
default model, equidistant is its fisheye model. Directions are vectors in the axes of the picture:
right, down, along the view.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import radians, tan
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera, ImageError
from peace_ros.core.domain.camera import EQUIDISTANT

Picture = NDArray[np.uint8]

_WIDEST = tan(radians(80.0))
"""No ray that is farther off the axis is projected onto the ground."""
_NARROWEST = 0.01
"""In focal lengths: no picture is narrower than half a degree."""
_NO_ROTATION = 0.01
"""Rows of a rotation have length 1 and right angles, up to rounding."""
_STEPS, _DIRECTIONS = 400, 16
_ZERO, _NO_TURN = np.zeros((3, 1)), np.eye(3)
_PRECISE = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 50, 1e-9)
_UNDISTORT = getattr(cv2, 'undistortPointsIter', cv2.undistortPoints)
"""OpenCV 4.6 takes a precision only in the former."""


def pixels(camera: Camera, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where directions in front of a camera are in its picture.

    Args:
        camera: with its distortion.
        directions: 3 x N, the third positive.

    Returns:
        2 x N: u, v, maybe beyond the picture; NaN where the distortion is not one-to-one.
    """
    plane = directions[:2] / directions[2]
    seen = _distorted(camera, plane)
    if camera.distortion is not None:
        seen[:, np.hypot(*plane) > widest_ray(camera)] = np.nan
    focal, centre = (np.reshape(each, (2, 1)) for each in (camera.focal_xy_px, camera.centre_px))
    return np.asarray(focal * seen + centre)


def rays(camera: Camera, columns: NDArray[Any], rows: NDArray[Any]) -> NDArray[np.float64]:
    """Return the directions of pixels, 3 x N with 1 along the view.

    They are NaN where the distortion is not one-to-one.

    Args:
        camera: with its distortion.
        columns: N, u of the pixels.
        rows: N, v of the pixels.
    """
    at = np.stack((columns, rows), axis=-1).astype(np.float64).reshape(-1, 1, 2)
    if camera.distortion is None:
        plane = (at - camera.centre_px) / camera.focal_xy_px
    elif camera.distortion.model == EQUIDISTANT:
        plane = cv2.fisheye.undistortPoints(at, camera.matrix, _coefficients(camera))
    else:
        plane = _UNDISTORT(
            at, camera.matrix, _coefficients(camera), R=_NO_TURN, P=_NO_TURN, criteria=_PRECISE
        )
    found = np.vstack((np.reshape(plane, (-1, 2)).T, np.ones(len(at))))
    if camera.distortion is not None:
        found[:, np.hypot(*found[:2]) > widest_ray(camera)] = np.nan
    return found


def sample(
    pictures: Sequence[tuple[Picture, int]],
    camera: Camera,
    directions: NDArray[np.float64],
    size_wh: tuple[int, int],
) -> tuple[list[Picture], NDArray[np.bool_]]:
    """Read pictures of one size at the points of a grid.

    Args:
        pictures: each with how OpenCV shall interpolate.
        camera: that of pictures of this size, with its distortion.
        directions: 3 x 3, invertible: (column, row, 1) of the grid to the direction in which the
            point is seen, as :func:`ground_to_camera` has it.
        size_wh: columns and rows of the grid.

    Returns:
        Each picture at the points, 0 beyond its edges; and false where a point cannot be seen
        because it is behind the camera or where the distortion is not one-to-one.
    """
    columns, rows = np.arange(size_wh[0])[None, :], np.arange(size_wh[1])[:, None]
    x, y, z = (a * columns + b * rows + c for a, b, c in directions)
    seen = z > 0.0
    if camera.distortion is None:
        pixels_from_grid = camera.matrix @ directions
        return [
            cv2.warpPerspective(each, pixels_from_grid, size_wh, flags=how | cv2.WARP_INVERSE_MAP)
            for each, how in pictures
        ], seen
    seen &= x * x + y * y <= (widest_ray(camera) * z) ** 2
    model = cv2.fisheye if camera.distortion.model == EQUIDISTANT else cv2
    # It maps the pixels of an undistorted picture. Its K may be any homography, so also the one
    # from directions to the grid.
    u, v = model.initUndistortRectifyMap(
        camera.matrix,
        _coefficients(camera),
        _NO_TURN,
        np.linalg.inv(directions),
        size_wh,
        cv2.CV_32FC1,
    )
    return [cv2.remap(each, u, v, how) for each, how in pictures], seen


@lru_cache(maxsize=16)
def widest_ray(camera: Camera) -> float:
    """Return the tangent of the angle off the axis up to which the distortion is one-to-one.

    A polynomial that was fitted to the picture may turn back beyond it: directions far outside
    would come to lie in the picture again.
    """
    radii = np.linspace(0.0, _WIDEST, _STEPS)
    angles = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)
    plane = np.stack((np.outer(np.cos(angles), radii), np.outer(np.sin(angles), radii)))
    lengths = np.hypot(*_distorted(camera, plane.reshape(2, -1))).reshape(_DIRECTIONS, _STEPS)
    grows = np.all(np.diff(lengths, axis=1) > 0.0, axis=0)
    return float(radii[-1] if grows.all() else radii[int(np.argmin(grows))])


def check_lens(camera: Camera) -> None:
    """Refuse a calibration that cannot be that of the picture.

    Raises:
        ImageError: the principal point is not in it, the distortion is not one-to-one up to its
            nearest edge, it sees next to nothing, or its rectification is no rotation.
    """
    turn = np.reshape(camera.rectification, (3, 3))
    if not np.allclose(turn @ turn.T, np.eye(3), atol=_NO_ROTATION):
        raise ImageError(
            f'calibration with rectification {camera.rectification}: it must be a rotation: '
            'calibrate the camera again'
        )
    (cu, cv), (fx, fy) = camera.centre_px, camera.focal_xy_px
    edge = min(cu / fx, (camera.width_px - 1 - cu) / fx, cv / fy, (camera.height_px - 1 - cv) / fy)
    limit = np.array([[0.999 * widest_ray(camera)], [0.0]])
    reach = float(np.hypot(*_distorted(camera, limit))[0])
    narrow = min(camera.width_px / fx, camera.height_px / fy)
    if not (0.0 < edge <= reach and narrow >= _NARROWEST):
        raise ImageError(
            f'calibration with centre {camera.centre_px} px in {camera.width_px} x '
            f'{camera.height_px} px and {camera.distortion or "no distortion"}: the nearest edge '
            f'is {edge:.2f} focal lengths from the centre, directions are unique from 0 to '
            f'{reach:.2f}, and the shorter side is {narrow:.2g} focal lengths (at least '
            f'{_NARROWEST}): calibrate the camera again'
        )


def _distorted(camera: Camera, plane: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return 2 x N tangents of directions as the lens shows them, in focal lengths."""
    if camera.distortion is None:
        return plane
    points = np.vstack((plane, np.ones(plane.shape[1]))).T.reshape(-1, 1, 3)
    model = cv2.fisheye if camera.distortion.model == EQUIDISTANT else cv2
    seen, _ = model.projectPoints(points, _ZERO, _ZERO, _NO_TURN, _coefficients(camera))
    return np.array(np.reshape(seen, (-1, 2)).T, np.float64)


def _coefficients(camera: Camera) -> NDArray[np.float64]:
    return np.array([] if camera.distortion is None else camera.distortion.coefficients)
