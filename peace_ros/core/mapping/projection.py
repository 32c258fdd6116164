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
from peace_ros.core.domain.geometry import ground_to_camera
from peace_ros.core.optics import rays, sample


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


def tilt_rad(pose: Pose) -> float:
    """Return the angle between the camera's axis (body-down) and the vertical, 0 to pi."""
    _, x, y, _ = pose.quaternion_ned_frd
    return acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))


def worst_part(
    safety: NDArray[np.uint8], pixels_per_cell: tuple[float, float]
) -> NDArray[np.uint8]:
    """Return each pixel's worst part of a cell around it, so that point sampling misses nothing.

    A person fills a quarter of a cell at times: the mean of a cell would hide them, its minimum
    would be ruled by the noise of single pixels. So half cells are averaged and the worst counts.

    :param pixels_per_cell: across and down; they differ where the frame was stretched.
    """
    if max(pixels_per_cell) < 1.5:
        return safety
    across, down = (1 if each < 1.5 else max(2, round(each / 2.0)) for each in pixels_per_cell)
    averaged = cv2.blur(safety, (across, down), borderType=cv2.BORDER_REPLICATE)
    window = np.ones((down + (down > 1), across + (across > 1)), np.uint8)
    return cast('NDArray[np.uint8]', cv2.erode(averaged, window))


def visible_window(
    camera: Camera, pose: Pose, grid: GroundGrid, off_nadir_limit_deg: float
) -> Window | None:
    """Return the part of a grid that can be in view, None when none is."""
    reach = pose.altitude_agl_m * tan(radians(off_nadir_limit_deg))
    low = np.array([pose.north_m - reach, pose.east_m - reach])
    high = np.array([pose.north_m + reach, pose.east_m + reach])
    ground = np.linalg.inv(ground_to_camera(camera, pose)) @ rays(camera, *_border(camera))
    if np.all(ground[2] > 0.0):  # all of the border looks below the horizon, and is known
        points = ground[:2] / ground[2]
        low, high = np.maximum(low, points.min(axis=1)), np.minimum(high, points.max(axis=1))
    row = max(0, floor((low[0] - grid.south_m) / grid.cell_m))
    column = max(0, floor((low[1] - grid.west_m) / grid.cell_m))
    rows = min(grid.rows, ceil((high[0] - grid.south_m) / grid.cell_m)) - row
    columns = min(grid.columns, ceil((high[1] - grid.west_m) / grid.cell_m)) - column
    return Window(row, column, rows, columns) if rows > 0 and columns > 0 else None


def _border(camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return u and v of the border of a picture: its corners, and with distortion more of it."""
    parts = 1 if camera.distortion is None else _BORDER_PARTS
    share, none = np.linspace(0.0, 1.0, parts + 1), np.zeros(parts + 1)
    u = np.concatenate((share, share, none, none + 1.0)) * camera.width_px - 0.5
    v = np.concatenate((none, none + 1.0, share, share)) * camera.height_px - 0.5
    return u, v


_BORDER_PARTS = 16


def project(
    safety: NDArray[np.uint8],
    kinds: NDArray[np.uint8],
    camera: Camera,
    pose: Pose,
    grid: GroundGrid,
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Sample a heatmap at the centres of ground cells.

    :param safety: height x width, 0 to 255.
    :param kinds: same shape, the kind of each pixel, 0 where it does not count.
    :param camera: that of a picture of this size, with its distortion.
    :return: safety per cell and kind per cell; kind 0 also where a cell is not in view in front
        of the camera.
    """
    # (column, row, 1) of the grid to ground (north, east, 1).
    south, west = grid.south_m + 0.5 * grid.cell_m, grid.west_m + 0.5 * grid.cell_m
    ground_from_cell = np.array(
        [[0.0, grid.cell_m, south], [grid.cell_m, 0.0, west], [0.0, 0.0, 1.0]]
    )
    (sampled, kind), seen = sample(
        [(safety, cv2.INTER_LINEAR), (kinds, cv2.INTER_NEAREST)],
        camera,
        ground_to_camera(camera, pose) @ ground_from_cell,
        (grid.columns, grid.rows),
    )
    kind[~seen] = 0
    return sampled, kind
