# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A nadir camera over a drawn town whose ground is drawn when it first comes into view.

A flight sees a small part of its world, most of it from high up. Each part is drawn at the
resolution that the view needs. What a part looks like depends on the seed and on its place only,
so that all flights over one town see the same ground, in any order.
"""

from __future__ import annotations

from itertools import product
from math import log2

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera, WorldError
from peace_ros.simulation.camera import LabelSquare, NadirCamera, SeenWorld, label_square, mirrored
from peace_ros.simulation.drawing.town import MIXED, Town, tiles_of
from peace_ros.simulation.world import World, check_drawn

_LEVELS = 3
_TILE_PX = 250
_FINEST_WITHIN_M = 15.0
"""Ground truth of a circle up to this radius comes from the finest level."""


class TownCamera(NadirCamera):
    """Looks at a drawn town.

    Args:
        seed: of the town, 0 or more.
        camera: what takes the pictures.
        size_m: side of the town in metres, 60 to 2000; four pixels must fit into it evenly.
        gsd_m: finest ground sampling distance in metres per pixel, 0.05 to 2.
        centre_m: north and east of the middle of the town in the local frame.
        district: what it is made of, one of DISTRICTS.
        season: spring, summer, autumn or winter; empty lets the seed choose.

    Raises:
        WorldError: an argument is out of its range, or the image would be too large.
    """

    def __init__(
        self,
        seed: int,
        camera: Camera,
        size_m: float,
        gsd_m: float,
        centre_m: tuple[float, float] = (0.0, 0.0),
        district: str = MIXED,
        season: str = '',
    ) -> None:
        name, size_px = check_drawn(seed, size_m, gsd_m)
        if size_px % 2 ** (_LEVELS - 1):
            raise WorldError(
                f'town of {size_px} px: give a size that is a multiple of {2 ** (_LEVELS - 1)} px'
            )
        self._town = Town(seed, size_px * gsd_m, district, season)
        # The pages of an array of zeros take no memory before they are written to.
        image = np.zeros((size_px, size_px, 3), np.uint8)
        labels = np.zeros((size_px, size_px), np.uint8)
        self._drawn: set[tuple[int, int, int]] = set()
        self._labels = [labels, *(labels[:: 2**k, :: 2**k].copy() for k in range(1, _LEVELS))]
        super().__init__(World(image, labels, gsd_m, name, *centre_m), camera)

    def _reduced(self) -> list[NDArray[np.uint8]]:
        """Return the levels, nothing drawn yet."""
        return [
            self.world.image_rgb,
            *(np.zeros((*labels.shape, 3), np.uint8) for labels in self._labels[1:]),
        ]

    def labels_around(self, north_m: float, east_m: float, radius_m: float) -> LabelSquare | None:
        """See :class:`NadirCamera`; large circles come from a coarser drawing."""
        level = self._clipped(round(log2(max(radius_m / _FINEST_WITHIN_M, 1.0))))
        place = np.array(self.world.pixel(north_m, east_m))
        reach = np.full(2, radius_m / self.world.gsd_m)
        square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        self._ground(level, place + square * reach)
        column, row = ((place + 0.5) / 2**level - 0.5).tolist()
        gsd_m = self.world.gsd_m * 2**level
        return label_square(self._labels[level], (column, row), radius_m, gsd_m)

    def _ground(self, level: int, corners_px: NDArray[np.float64]) -> SeenWorld:
        level = self._clipped(level)
        labels, image = self._labels[level], self._levels[level]
        tiles = tiles_of(labels.shape[0], _TILE_PX)
        for row, column in tiles_in_view(corners_px / 2**level, labels.shape[0]):
            if (level, row, column) not in self._drawn:
                where = (tiles[row], tiles[column])
                image[where], labels[where] = self._town.draw(*where, self.world.gsd_m * 2**level)
                self._drawn.add((level, row, column))
        return SeenWorld(image, labels)

    def _clipped(self, level: int) -> int:
        return min(max(level, 0), _LEVELS - 1)


def tiles_in_view(seen_px: NDArray[np.float64], size_px: int) -> list[tuple[int, int]]:
    """Return row and column of each tile that a view touches.

    Args:
        seen_px: points in view (N, 2: column, row); what lies between them is in view too.
        size_px: side of the world.
    """
    low, high = np.floor(seen_px.min(axis=0)) - 1, np.ceil(seen_px.max(axis=0)) + 1
    # Beyond its edge the world is continued by mirroring: the tiles there are inner ones.
    columns, rows = (
        np.unique(mirrored(np.arange(first, last + 1), size_px) // _TILE_PX).tolist()
        for first, last in zip(low, high, strict=True)
    )
    found = list(product(rows, columns))
    if low.min() < 0.0 or high.max() >= size_px:
        return found
    hull = cv2.convexHull(seen_px.astype(np.float32))
    box = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32) * (0.5 * _TILE_PX + 1.0)

    def is_seen(row: int, column: int) -> bool:
        middle = (np.array([column, row], np.float32) + 0.5) * _TILE_PX
        return cv2.intersectConvexConvex(hull, box + middle)[0] > 0.0

    return [each for each in found if is_seen(*each)]
