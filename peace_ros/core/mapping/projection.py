# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A heatmap laid onto level ground."""

from __future__ import annotations

from math import acos, ceil, floor, radians, tan
from typing import NamedTuple, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera, Pose
from peace_ros.core.domain.geometry import ground_to_image


class GroundGrid(NamedTuple):
    """Cells on the ground; rows grow to the north, columns to the east."""

    south_m: float
    """North coordinate of the southern edge."""
    west_m: float
    """East coordinate of the western edge."""
    cell_m: float
    rows: int
    columns: int

    def part(self, window: Window) -> GroundGrid:
        """Return the cells of a window as a grid of their own."""
        south = self.south_m + window.row * self.cell_m
        west = self.west_m + window.column * self.cell_m
        return GroundGrid(south, west, self.cell_m, window.rows, window.columns)


class Window(NamedTuple):
    """A rectangle of cells of a grid: its first cell and its size."""

    row: int
    column: int
    rows: int
    columns: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns, to index a layer of the grid."""
        return (
            slice(self.row, self.row + self.rows),
            slice(self.column, self.column + self.columns),
        )


def heatmap_from_ground(
    camera: Camera, pose: Pose, width_px: int, height_px: int
) -> NDArray[np.float64]:
    """Return the homography from ground (north m, east m, 1) to heatmap pixels (u, v, 1).

    The heatmap covers the whole frame, stretched to width x height; pixel centres are whole
    numbers in both images.
    """
    sx, sy = width_px / camera.width_px, height_px / camera.height_px
    stretch = np.array([[sx, 0.0, 0.5 * (sx - 1.0)], [0.0, sy, 0.5 * (sy - 1.0)], [0.0, 0.0, 1.0]])
    return stretch @ ground_to_image(camera, pose)


def tilt_rad(pose: Pose) -> float:
    """Return the angle between the camera's axis (body-down) and the vertical, 0 to pi."""
    _, x, y, _ = pose.quaternion_ned_frd
    return acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))


def worst_part(safety: NDArray[np.uint8], pixels_per_cell: float) -> NDArray[np.uint8]:
    """Return each pixel's worst part of a cell around it, so that point sampling misses nothing.

    A person fills a quarter of a cell at times: the mean of a cell would hide them, its minimum
    would be ruled by the noise of single pixels. So half cells are averaged and the worst counts.
    """
    if pixels_per_cell < 1.5:
        return safety
    half = max(2, round(pixels_per_cell / 2.0))
    averaged = cv2.blur(safety, (half, half), borderType=cv2.BORDER_REPLICATE)
    window = np.ones((half + 1, half + 1), np.uint8)
    return cast('NDArray[np.uint8]', cv2.erode(averaged, window))


def visible_window(
    image_from_ground: NDArray[np.float64],
    pose: Pose,
    image_wh: tuple[int, int],
    grid: GroundGrid,
    off_nadir_limit_deg: float,
) -> Window | None:
    """Return the part of a grid that can be in view, None when none is."""
    reach = pose.altitude_agl_m * tan(radians(off_nadir_limit_deg))
    low = np.array([pose.north_m - reach, pose.east_m - reach])
    high = np.array([pose.north_m + reach, pose.east_m + reach])
    width, height = image_wh
    right, bottom = width - 0.5, height - 0.5
    corners = np.array(
        [[-0.5, right, right, -0.5], [-0.5, -0.5, bottom, bottom], [1.0, 1.0, 1.0, 1.0]]
    )
    ground = np.linalg.inv(image_from_ground) @ corners
    if np.all(ground[2] > 0.0):  # all four corners look below the horizon
        points = ground[:2] / ground[2]
        low, high = np.maximum(low, points.min(axis=1)), np.minimum(high, points.max(axis=1))
    row = max(0, floor((low[0] - grid.south_m) / grid.cell_m))
    column = max(0, floor((low[1] - grid.west_m) / grid.cell_m))
    rows = min(grid.rows, ceil((high[0] - grid.south_m) / grid.cell_m)) - row
    columns = min(grid.columns, ceil((high[1] - grid.west_m) / grid.cell_m)) - column
    return Window(row, column, rows, columns) if rows > 0 and columns > 0 else None


def project(
    safety: NDArray[np.uint8],
    kinds: NDArray[np.uint8],
    image_from_ground: NDArray[np.float64],
    grid: GroundGrid,
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Sample a heatmap at the centres of ground cells.

    :param safety: height x width, 0 to 255.
    :param kinds: same shape, the kind of each pixel, 0 where it does not count.
    :return: safety per cell and kind per cell; kind 0 also where a cell is not in view in front
        of the camera.
    """
    # Destination pixel (x = column, y = row) to ground (north, east, 1).
    south, west = grid.south_m + 0.5 * grid.cell_m, grid.west_m + 0.5 * grid.cell_m
    ground_from_cell = np.array(
        [[0.0, grid.cell_m, south], [grid.cell_m, 0.0, west], [0.0, 0.0, 1.0]]
    )
    matrix = image_from_ground @ ground_from_cell
    rows, columns = grid.rows, grid.columns
    sampled = cv2.warpPerspective(
        safety, matrix, (columns, rows), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    )
    kind = cv2.warpPerspective(
        kinds, matrix, (columns, rows), flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    )
    depth = (
        matrix[2, 0] * np.arange(columns)[None, :]
        + matrix[2, 1] * np.arange(rows)[:, None]
        + matrix[2, 2]
    )
    kind[depth <= 0.0] = 0
    return cast('NDArray[np.uint8]', sampled), cast('NDArray[np.uint8]', kind)
