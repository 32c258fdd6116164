# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ground that is not level, as a camera without distortion sees it."""

from __future__ import annotations

from math import log2

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera, Pose
from peace_ros.core.domain.geometry import ground_to_image
from peace_ros.simulation import World

_CELL_M = 2.0
_WAVES = 24
_LONGEST_M, _SHORTEST_M = 120.0, 20.0
_STEPS = 5
"""A ray is followed to the ground in so many steps; hills are gentle."""


def draw_hills(size_m: float, amplitude_m: float, seed: int) -> NDArray[np.float32]:
    """Return heights above the mean ground, cells of 2 m, row 0 in the north.

    Args:
        size_m: Side of the square.
        amplitude_m: No height is larger.
        seed: Same seed, same hills.
    """
    random = np.random.default_rng(seed)
    along = np.arange(0.0, size_m, _CELL_M)
    heights = np.zeros((len(along), len(along)))
    for _ in range(_WAVES):
        length_m = _SHORTEST_M * (_LONGEST_M / _SHORTEST_M) ** random.random()
        angle, phase = random.uniform(0.0, 2.0 * np.pi, 2)
        way = np.add.outer(np.sin(angle) * along, np.cos(angle) * along)
        heights += length_m * np.cos(2.0 * np.pi * way / length_m + phase)
    return np.asarray(heights * amplitude_m / np.abs(heights).max(), np.float32)


class HillCamera:
    """A camera over a world with hills.

    Args:
        world: Its image lies on the hills as seen from straight above.
        camera: Without distortion.
        heights_m: As :func:`draw_hills` gives them, over the whole world.
    """

    def __init__(self, world: World, camera: Camera, heights_m: NDArray[np.float32]) -> None:
        self._world = world
        self._camera = camera
        self._heights_m = heights_m
        u, v = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
        self._pixels = np.stack((u.ravel(), v.ravel(), np.ones(u.size)))
        self._levels = [world.image_rgb]
        while min(self._levels[-1].shape[:2]) > camera.width_px:
            height, width = self._levels[-1].shape[:2]
            size = width // 2, height // 2
            self._levels.append(cv2.resize(self._levels[-1], size, interpolation=cv2.INTER_AREA))

    def view(self, pose: Pose) -> NDArray[np.uint8]:
        """Return height x width x 3; the altitude of the pose is above the mean ground."""
        shape = self._camera.height_px, self._camera.width_px
        # Where rays meet the mean ground; on their way to a hill they are nearer to the camera.
        ground = np.linalg.inv(ground_to_image(self._camera, pose)) @ self._pixels
        north, east = (ground[:2] / ground[2]).reshape(2, *shape)
        north, east = north - pose.north_m, east - pose.east_m
        part: NDArray[np.float64] = np.ones(shape)
        for _ in range(_STEPS):
            at = pose.north_m + part * north, pose.east_m + part * east
            part = 1.0 - self._height_at(*at).astype(np.float64) / pose.altitude_agl_m
        level = round(log2(max(1.0, pose.altitude_agl_m / self._camera.focal_px / self._gsd_m)))
        image = self._levels[min(level, len(self._levels) - 1)]
        seen = self._sampled(image, pose.north_m + part * north, pose.east_m + part * east)
        return np.asarray(seen, np.uint8)

    @property
    def _gsd_m(self) -> float:
        return self._world.gsd_m

    def _height_at(
        self, north_m: NDArray[np.float64], east_m: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        return np.asarray(self._sampled(self._heights_m, north_m, east_m), np.float32)

    def _sampled(
        self,
        raster: NDArray[np.float32] | NDArray[np.uint8],
        north_m: NDArray[np.float64],
        east_m: NDArray[np.float64],
    ) -> NDArray[np.float32] | NDArray[np.uint8]:
        """Return a raster that covers the world, at places on it."""
        width_m, height_m = self._world.size_m
        rows, columns = raster.shape[:2]
        u = ((east_m - self._world.centre_east_m) / width_m + 0.5) * columns - 0.5
        v = (0.5 - (north_m - self._world.centre_north_m) / height_m) * rows - 0.5
        return np.asarray(
            cv2.remap(
                raster,
                u.astype(np.float32),
                v.astype(np.float32),
                cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_REFLECT,
            )
        )
