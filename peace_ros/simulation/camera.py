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

from peace_ros.core.domain import NADIR, Camera, Label, Mount, Pose, WorldError, is_safe
from peace_ros.core.domain.camera import EQUIDISTANT
from peace_ros.core.domain.geometry import camera_pose, ground_to_camera, ground_to_image
from peace_ros.simulation.world import World

_LOWEST_M = 0.2
"""The lens of a vehicle that stands on the ground is about this high."""
_SKY_RGB = (168, 176, 184)
_HORIZON = 1e-9
_COARSEST = 16
_CHECKED = 16
"""One of so many rows is projected back, to see that the distortion could be inverted."""
_INVERSION_PX = 0.01
_PRECISE = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-10)
_UNDISTORT = getattr(cv2, 'undistortPointsIter', cv2.undistortPoints)
"""OpenCV 4.6 takes a precision only in the former."""


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
    """A camera over a world, with true attitude: nadir by default, or mounted otherwise.

    Its lens may have distortion. The directions of its pixels are found by inverting the model,
    while the companion only ever applies it: an error in one of them shows.

    The world is prepared once at several resolutions (each half of the one before, by averaging
    areas), so that a view from high up does not alias.
    """

    def __init__(self, world: World, camera: Camera, mount: Mount = NADIR) -> None:
        self.world = world
        self.camera = camera
        self.mount = mount
        self._directions = None if camera.distortion is None else _directions(camera)
        self._levels = self._reduced()
        self._clearance_px: NDArray[np.float32] | None = None

    def view(self, pose: Pose) -> CameraView:
        """Return what the camera sees; the ground is level, ``altitude_agl_m`` below the vehicle.

        Altitudes under 0.2 m are seen from 0.2 m.
        """
        pose = camera_pose(self.mount, pose)
        if pose.altitude_agl_m < _LOWEST_M:
            pose = replace(pose, altitude_agl_m=_LOWEST_M)
        if self._directions is not None:
            return self._bent_view(self._directions, pose)
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

    def _bent_view(self, directions: NDArray[np.float64], pose: Pose) -> CameraView:
        """Return the view through a lens with distortion, ray by ray."""
        world_from_camera = self._world_from_ground() @ np.linalg.inv(
            ground_to_camera(self.camera, pose)
        )
        shape = self.camera.height_px, self.camera.width_px
        mapped = (world_from_camera @ directions.reshape(3, -1)).reshape(3, *shape)
        sky = ~(mapped[2] > _HORIZON)  # also true where the lens shows no direction
        u, v = (
            np.where(sky, -1.0, each / np.where(sky, 1.0, mapped[2])).astype(np.float32)
            for each in mapped[:2]
        )
        height, width = self.world.image_rgb.shape[:2]
        beyond = (u < -0.5) | (v < -0.5) | (u > width - 0.5) | (v > height - 0.5)
        level = self._level(world_from_camera @ np.linalg.inv(self.camera.matrix))
        seen_px = np.stack([u[~sky], v[~sky]], axis=1) if not sky.all() else np.zeros((1, 2))
        ground = self._ground(level, seen_px.astype(np.float64))

        def sampled(raster: NDArray[np.uint8], method: int) -> NDArray[np.uint8]:
            (sx, _, tx), (_, sy, ty), _ = self._scaled(raster)
            at = (u * np.float32(sx) + np.float32(tx), v * np.float32(sy) + np.float32(ty))
            found = cv2.remap(raster, *at, method, borderMode=cv2.BORDER_REFLECT)
            return np.asarray(found, np.uint8)

        image = sampled(ground.image, cv2.INTER_LINEAR)
        image[sky] = _SKY_RGB
        labels = None
        if ground.labels is not None:
            labels = sampled(ground.labels, cv2.INTER_NEAREST)
            labels[sky] = Label.UNLABELED
        return CameraView(image, labels, bool((sky | beyond).any()))

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
            _corners_px: of the view, in pixels of the world (N, 2: column, row).
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


def _directions(camera: Camera) -> NDArray[np.float64]:
    """Return 3 x height x width: right, down and 1 along the view, of each pixel of a bent lens.

    Raises:
        WorldError: the distortion is not one-to-one over the whole picture.
    """
    found = np.ones((3, camera.height_px, camera.width_px))
    for row in range(camera.height_px):
        pixels = np.full((camera.width_px, 1, 2), float(row))
        pixels[:, 0, 0] = np.arange(camera.width_px)
        found[:2, row] = _undistorted(camera, pixels).T
        if row % _CHECKED == 0 and not np.allclose(
            _distorted(camera, found[:, row]), pixels[:, 0], atol=_INVERSION_PX
        ):
            raise WorldError(
                f'{camera.distortion} cannot be inverted over {camera.width_px} x '
                f'{camera.height_px} px: give a weaker distortion or a narrower field of view'
            )
    return found


def _undistorted(camera: Camera, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return N x 2 tangents of pixels (N, 1, 2)."""
    coefficients = np.array(camera.distortion.coefficients if camera.distortion else ())
    if camera.distortion is not None and camera.distortion.model == EQUIDISTANT:
        plane = cv2.fisheye.undistortPoints(pixels, camera.matrix, coefficients)
    else:
        plane = _UNDISTORT(
            pixels, camera.matrix, coefficients, R=np.eye(3), P=np.eye(3), criteria=_PRECISE
        )
    return np.asarray(plane, np.float64).reshape(-1, 2)


def _distorted(camera: Camera, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return N x 2 pixels of directions (3, N)."""
    fisheye = camera.distortion is not None and camera.distortion.model == EQUIDISTANT
    model = cv2.fisheye if fisheye else cv2
    coefficients = np.array(camera.distortion.coefficients if camera.distortion else ())
    zero, points = np.zeros((3, 1)), directions.T.reshape(-1, 1, 3)
    seen, _ = model.projectPoints(points, zero, zero, camera.matrix, coefficients)
    return np.asarray(seen, np.float64).reshape(-1, 2)


def mirrored(index: NDArray[np.float64], size: int) -> NDArray[np.intp]:
    """Fold pixel numbers into 0 .. size - 1 as BORDER_REFLECT does (edge pixel repeated)."""
    folded = np.mod(index.astype(np.int64), 2 * size)
    return np.asarray(np.where(folded < size, folded, 2 * size - 1 - folded), np.intp)
