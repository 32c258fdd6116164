# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Flatness of the ground by a depth camera: closes ground that is rough, and never opens any.

Roughness is the standard deviation of the heights within the width of a vehicle: the smoothness of
DOVESEI, but of heights instead of depths, so that a tilted camera finds level ground flat too.
"""

from __future__ import annotations

from math import ceil

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera, DepthImage, Pose
from peace_ros.core.domain.geometry import rotation_matrix
from peace_ros.core.mapping.parameters import MapParameters
from peace_ros.core.mapping.projection import GroundGrid
from peace_ros.core.optics import rays

_LARGEST_PX = 160
"""Larger pictures are read at every second, third, ... pixel."""
_FEWEST_PX = 3
_BODY_FROM_OPTICAL = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Of a nadir camera: down in the picture is aft, its right is right, its view is down."""
_LEAST_KNOWN = 0.5
"""Part of the pixels of a window that must have been measured."""


def rough_and_flat(
    depth: DepthImage, camera: Camera, pose: Pose, grid: GroundGrid, parameters: MapParameters
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which cells of a grid are rough, and which are flat; the others were not measured.

    :param camera: that of the full frame; the depth image covers it.
    :param pose: where the camera was at the stamp of the depth image.
    """
    offsets, known = _points(depth, camera, pose, parameters.depth_range_m)
    rough = np.zeros((grid.rows, grid.columns), np.bool_)
    flat = rough.copy()
    if not known.any():
        return rough, flat
    width = _window_px(offsets, known, parameters.flat_width_m)
    spread, enough = _spread_m(offsets[2], known, width)
    row = np.floor((pose.north_m + offsets[0] - grid.south_m) / grid.cell_m)
    column = np.floor((pose.east_m + offsets[1] - grid.west_m) / grid.cell_m)
    inside = (row >= 0) & (row < grid.rows) & (column >= 0) & (column < grid.columns)
    told = known & enough & inside
    for cells, chosen in (
        (rough, told & (spread > parameters.depth_smoothness_m)),
        (flat, told & (spread <= parameters.depth_smoothness_m)),
    ):
        cells[row[chosen].astype(np.intp), column[chosen].astype(np.intp)] = True
    # Points may lie farther apart than cells.
    grown = cv2.dilate(rough.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return grown, flat & ~grown


def _points(
    depth: DepthImage, camera: Camera, pose: Pose, range_m: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return north, east and down of the camera (3 x H x W) of each point, and which are known."""
    height, width = depth.depth_m.shape
    step = max(1, ceil(max(height, width) / _LARGEST_PX))
    rows, columns = np.arange(step // 2, height, step), np.arange(step // 2, width, step)
    along = depth.depth_m[np.ix_(rows, columns)].astype(np.float64)
    # A sensor that sees nothing, or no farther, says zero, infinity, or its range.
    known = np.isfinite(along) & (along > 0.0) & (along < range_m)
    u, v = np.meshgrid(columns, rows)
    directions = rays(camera.resized(width, height), u.ravel(), v.ravel())
    turn = _BODY_FROM_OPTICAL @ np.reshape(camera.rectification, (3, 3)).T
    body = (turn @ directions).reshape(3, *u.shape)
    known &= np.isfinite(body[2])
    body = np.where(known, body * along, 0.0)
    return np.tensordot(rotation_matrix(pose.quaternion_ned_frd), body, axes=1), known


def _window_px(
    offsets: NDArray[np.float64], known: NDArray[np.bool_], width_m: float
) -> tuple[int, int]:
    """Return how many points (across, along) lie within a width on the ground."""
    sizes = []
    for axis in (1, 0):
        both = known & np.roll(known, -1, axis)
        apart = np.linalg.norm(np.roll(offsets, -1, axis + 1)[:2] - offsets[:2], axis=0)
        step_m = float(np.median(apart[both])) if both.any() else width_m
        sizes.append(max(_FEWEST_PX, round(width_m / max(step_m, 1e-3))))
    return sizes[0], sizes[1]


def _spread_m(
    down_m: NDArray[np.float64], known: NDArray[np.bool_], window_px: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the standard deviation of the heights around each point, and where enough is known."""
    # Around their middle, or the squares of the heights would lose what they differ by.
    height = np.where(known, down_m - np.median(down_m[known]), 0.0)

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(cv2.blur(values, window_px, borderType=cv2.BORDER_CONSTANT))

    share = mean(known.astype(np.float64))
    enough = share >= _LEAST_KNOWN * mean(np.ones_like(height))
    safe_share = np.maximum(share, 1e-9)
    average = mean(height) / safe_share
    variance = mean(height * height) / safe_share - average * average
    return np.sqrt(np.maximum(variance, 0.0)), enough
