# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a camera fixed to the belly of a vehicle sees over a flat world."""

from __future__ import annotations

from dataclasses import replace
from math import inf, log2
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera, Label, Pose, is_safe
from peace_ros.core.domain.geometry import ground_to_image
from peace_ros.simulation.world import World

_LOWEST_M = 0.2
"""The lens of a vehicle that stands on the ground is about this high."""
_SKY_RGB = (168, 176, 184)
_HORIZON = 1e-9
_COARSEST = 16


class CameraView(NamedTuple):
    """One picture of the world."""

    image_rgb: NDArray[np.uint8]
    """Height x width x 3 of the camera; sky is grey."""
    labels: NDArray[np.uint8] | None
    """Height x width, UNLABELED where there is sky; None where the world has no labels."""
    mirrored: bool
    """Some of the ground in view lies beyond the world, which is continued by mirroring."""


class LabelSquare(NamedTuple):
    """Ground truth around a place."""

    labels: NDArray[np.uint8]
    """Rows (to the south) x columns (to the east)."""
    away_m: NDArray[np.float64]
    """Distance of each pixel from the place, same shape."""


class SeenWorld(NamedTuple):
    """The whole world at one resolution, which may differ between image and labels."""

    image: NDArray[np.uint8]
    """Height x width x 3."""
    labels: NDArray[np.uint8] | None
    """Height x width."""


class NadirCamera:
    """A pinhole camera that looks along body-down over a world, with true attitude.

    The world is prepared once at several resolutions (each half of the one before, by averaging
    areas), so that a view from high up does not alias.
    """

    def __init__(self, world: World, camera: Camera) -> None:
        self.world = world
        self.camera = camera
        self._levels = self._reduced()
        self._clearance_px: NDArray[np.float32] | None = None

    def view(self, pose: Pose) -> CameraView:
        """Return what the camera sees; the ground is level, ``altitude_agl_m`` below the vehicle.

        Altitudes under 0.2 m are seen from 0.2 m.
        """
        if pose.altitude_agl_m < _LOWEST_M:
            pose = replace(pose, altitude_agl_m=_LOWEST_M)
        world_from_image = self._world_from_ground() @ np.linalg.inv(
            ground_to_image(self.camera, pose)
        )
        corners, depth_sign = self._corners(world_from_image)
        sees_sky = bool((depth_sign <= _HORIZON).any())
        mirrored = sees_sky or not self._inside(corners)
        ground = self._ground(self._level(world_from_image), corners)
        image_from_view = self._scaled(ground.image) @ world_from_image
        image = self._warp(ground.image, image_from_view, cv2.INTER_LINEAR)
        labels = None
        if ground.labels is not None:
            labels_from_view = self._scaled(ground.labels) @ world_from_image
            labels = self._warp(ground.labels, labels_from_view, cv2.INTER_NEAREST)
        if sees_sky:
            sky = self._sky(world_from_image)
            image[sky] = _SKY_RGB
            if labels is not None:
                labels[sky] = Label.UNLABELED
        return CameraView(image, labels, mirrored)

    def labels_at(self, north_m: float, east_m: float, radius_m: float) -> NDArray[np.uint8] | None:
        """Return the labels (N,) of the pixels whose centres lie within a radius of a place.

        At least the nearest pixel is returned; None where the world has no labels. Beyond the
        world its mirror image counts.
        """
        square = self.labels_around(north_m, east_m, radius_m)
        return None if square is None else square.labels[square.away_m <= radius_m]

    def labels_around(self, north_m: float, east_m: float, radius_m: float) -> LabelSquare | None:
        """Return the labels of the square that holds a circle, at least of the nearest pixel.

        None where the world has no labels. Beyond the world its mirror image counts.
        """
        labels = self.world.labels
        if labels is None:
            return None
        return label_square(labels, self.world.pixel(north_m, east_m), radius_m, self.world.gsd_m)

    def clearance_m(self, north_m: float, east_m: float) -> float | None:
        """Return the distance to the nearest pixel that is not safe (UNLABELED is not).

        0 on such a pixel, infinite in a world that is safe everywhere, None without labels.
        """
        labels = self.world.labels
        if labels is None:
            return None
        if self._clearance_px is None:
            safe = is_safe(labels)
            if safe.all():
                self._clearance_px = np.full(labels.shape, inf, np.float32)
            else:
                self._clearance_px = np.asarray(
                    cv2.distanceTransform(
                        safe.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
                    ),
                    np.float32,
                )
        column, row = self.world.pixel(north_m, east_m)
        height, width = labels.shape
        at_row = int(mirrored(np.array([round(row)]), height)[0])
        at_column = int(mirrored(np.array([round(column)]), width)[0])
        return float(self._clearance_px[at_row, at_column]) * self.world.gsd_m

    def _ground(self, level: int, _corners_px: NDArray[np.float64]) -> SeenWorld:
        """Return what a view shows.

        Args:
            level: the world is seen at this many halvings of its resolution.
            _corners_px: of the view, in pixels of the world (4, 2: column, row).
        """
        return SeenWorld(self._levels[min(level, len(self._levels) - 1)], self.world.labels)

    def _reduced(self) -> list[NDArray[np.uint8]]:
        """Return the world at several resolutions, the finest first."""
        levels = [np.ascontiguousarray(self.world.image_rgb)]
        while min(levels[-1].shape[:2]) >= 4:
            height, width = levels[-1].shape[:2]
            size = ((width + 1) // 2, (height + 1) // 2)
            levels.append(np.asarray(cv2.resize(levels[-1], size, interpolation=cv2.INTER_AREA)))
        return levels

    def _world_from_ground(self) -> NDArray[np.float64]:
        """Return the matrix from (north, east, 1) to (column, row, 1) of the world."""
        scale = 1.0 / self.world.gsd_m
        column, row = self.world.pixel(0.0, 0.0)
        return np.array([[0.0, scale, column], [-scale, 0.0, row], [0.0, 0.0, 1.0]])

    def _corners(
        self, world_from_image: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the corner pixels in the world (4, 2), and the sign of their depth (4,)."""
        right, bottom = self.camera.width_px - 1.0, self.camera.height_px - 1.0
        ends = np.array([[0, 0, 1], [right, 0, 1], [right, bottom, 1], [0, bottom, 1]], float)
        mapped = ends @ world_from_image.T
        depth = mapped[:, 2]
        safe_depth = np.where(np.abs(depth) > _HORIZON, depth, _HORIZON)
        return mapped[:, :2] / safe_depth[:, None], depth

    def _inside(self, corners: NDArray[np.float64]) -> bool:
        # The ground in view is the convex hull of its corners while no sky is seen.
        height, width = self.world.image_rgb.shape[:2]
        low, high = corners.min(0), corners.max(0)
        return bool(
            low[0] >= -0.5 and low[1] >= -0.5 and high[0] <= width - 0.5 and high[1] <= height - 0.5
        )

    def _level(self, world_from_image: NDArray[np.float64]) -> int:
        """Return the level whose pixels are nearest in size to those of the view's middle."""
        cu, cv = self.camera.centre_px
        centre = world_from_image @ (cu, cv, 1.0)
        if centre[2] <= _HORIZON:
            return _COARSEST
        # Determinant of the derivative of a homography: world pixels per view pixel, squared.
        area = abs(float(np.linalg.det(world_from_image))) / float(centre[2]) ** 3
        return int(np.clip(round(0.5 * log2(max(area, 1e-12))), 0, _COARSEST))

    def _scaled(self, raster: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Return the matrix from pixels of the world to those of a raster of the same ground."""
        full, small = self.world.image_rgb.shape, raster.shape
        sx, sy = small[1] / full[1], small[0] / full[0]
        return np.array([[sx, 0, 0.5 * sx - 0.5], [0, sy, 0.5 * sy - 0.5], [0, 0, 1]])

    def _warp(
        self, source: NDArray[np.uint8], source_from_image: NDArray[np.float64], method: int
    ) -> NDArray[np.uint8]:
        size = (self.camera.width_px, self.camera.height_px)
        warped = cv2.warpPerspective(
            source,
            source_from_image,
            size,
            flags=method | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REFLECT,
        )
        return np.asarray(warped, np.uint8)

    def _sky(self, world_from_image: NDArray[np.float64]) -> NDArray[np.bool_]:
        u = np.arange(self.camera.width_px)[None, :]
        v = np.arange(self.camera.height_px)[:, None]
        a, b, c = world_from_image[2]
        return np.asarray(a * u + b * v + c <= _HORIZON, np.bool_)


def label_square(
    labels: NDArray[np.uint8], place_px: tuple[float, float], radius_m: float, gsd_m: float
) -> LabelSquare:
    """Cut the square that holds a circle out of a label raster, at least the nearest pixel.

    Args:
        labels: height x width; beyond it its mirror image counts.
        place_px: column and row of the place.
        radius_m: of the circle.
        gsd_m: metres per pixel.
    """
    (column, row), reach = place_px, radius_m / gsd_m
    columns = np.arange(np.ceil(column - reach), np.floor(column + reach) + 1.0)
    rows = np.arange(np.ceil(row - reach), np.floor(row + reach) + 1.0)
    away = np.hypot(columns[None, :] - column, rows[:, None] - row)
    if not (away <= reach).any():
        columns, rows, away = np.array([round(column)]), np.array([round(row)]), np.zeros((1, 1))
    height, width = labels.shape
    found = labels[np.ix_(mirrored(rows, height), mirrored(columns, width))]
    return LabelSquare(found, away * gsd_m)


def mirrored(index: NDArray[np.float64], size: int) -> NDArray[np.intp]:
    """Fold pixel numbers into 0 .. size - 1 as BORDER_REFLECT does (edge pixel repeated)."""
    folded = np.mod(index.astype(np.int64), 2 * size)
    return np.asarray(np.where(folded < size, folded, 2 * size - 1 - folded), np.intp)
