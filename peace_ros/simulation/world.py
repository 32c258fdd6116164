# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ground that a simulated camera flies over: an orthophoto file or a drawn place."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label, WorldError
from peace_ros.simulation.drawing.town import MIXED, draw_town
from peace_ros.simulation.picture_files import check_size
from peace_ros.simulation.rasters import read_gsd_m, read_indices, read_photo


@dataclass(frozen=True)
class World:
    """Level ground seen from above; up in the image is north."""

    image_rgb: NDArray[np.uint8]
    """Height x width x 3, RGB."""
    labels: NDArray[np.uint8] | None
    """Height x width of :class:`peace_ros.core.domain.Label`, or None where they are not known."""
    gsd_m: float
    """Ground sampling distance: metres per pixel, both ways."""
    name: str
    centre_north_m: float = 0.0
    """Where the middle of the image lies in the local NED frame."""
    centre_east_m: float = 0.0

    def __post_init__(self) -> None:
        image = self.image_rgb
        if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or image.size == 0:
            raise WorldError(
                f'world {self.name!r} of shape {image.shape}, {image.dtype}: give a non-empty '
                'height x width x 3 uint8 RGB image'
            )
        check_size(image.shape[1], image.shape[0], f'world {self.name!r}')
        if not (isfinite(self.gsd_m) and 1e-3 <= self.gsd_m <= 100.0):
            raise WorldError(
                f'ground sampling distance {self.gsd_m} m of world {self.name!r}: '
                'give 0.001 to 100 metres per pixel'
            )
        if self.labels is not None:
            _check_labels(self.labels, image, self.name)

    @property
    def size_m(self) -> tuple[float, float]:
        """(east-west, north-south) extent in metres."""
        height, width = self.image_rgb.shape[:2]
        return width * self.gsd_m, height * self.gsd_m

    def pixel(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Return (column, row) of a place; pixel centres are whole numbers, outside is allowed."""
        height, width = self.image_rgb.shape[:2]
        column = (east_m - self.centre_east_m) / self.gsd_m + (width - 1) / 2.0
        row = (self.centre_north_m - north_m) / self.gsd_m + (height - 1) / 2.0
        return column, row

    def place(self, column: float, row: float) -> tuple[float, float]:
        """Return (north, east) in metres of a pixel; the inverse of :meth:`pixel`."""
        height, width = self.image_rgb.shape[:2]
        north = self.centre_north_m - (row - (height - 1) / 2.0) * self.gsd_m
        east = self.centre_east_m + (column - (width - 1) / 2.0) * self.gsd_m
        return north, east


def draw_world(
    seed: int,
    size_m: float = 400.0,
    gsd_m: float = 0.1,
    district: str = MIXED,
    season: str = '',
) -> World:
    """Draw a town with fields, parks, a river and everything between, with exact labels.

    Args:
        seed: 0 or more; the same seed gives the same world.
        size_m: side of the square in metres, 60 to 2000.
        gsd_m: ground sampling distance in metres per pixel, 0.05 to 2.
        district: what it is made of, one of DISTRICTS.
        season: spring, summer, autumn or winter; empty lets the seed choose.

    Raises:
        WorldError: an argument is out of its range, or the image would be too large.
    """
    name, size_px = check_drawn(seed, size_m, gsd_m)
    image, labels = draw_town(seed, size_px, gsd_m, district, season)
    return World(image, labels, gsd_m, name)


def check_drawn(seed: int, size_m: float, gsd_m: float) -> tuple[str, int]:
    """Return the name and the size in pixels of a drawn world; see :func:`draw_world`.

    Raises:
        WorldError: an argument is out of its range, or the image would be too large.
    """
    if seed < 0:
        raise WorldError(f'seed {seed} of a drawn world: give a whole number of 0 or more')
    if not 60.0 <= size_m <= 2000.0:
        raise WorldError(f'size {size_m} m of a drawn world: give 60 to 2000 m')
    if not 0.05 <= gsd_m <= 2.0:
        raise WorldError(f'ground sampling distance {gsd_m} m of a drawn world: give 0.05 to 2 m')
    size_px = round(size_m / gsd_m)
    name = f'drawn-{seed}'
    check_size(size_px, size_px, f'world {name!r}')
    return name, size_px


def load_world(
    path: str | Path, gsd_m: float | None = None, labels: str | Path | None = None
) -> World:
    """Load an orthophoto (JPEG, PNG, TIFF, GeoTIFF) and optionally its label raster.

    Args:
        path: the image; up is north.
        gsd_m: metres per pixel; None reads it from the georeference of a GeoTIFF.
        labels: single-channel PNG of the same size with values of
            :class:`peace_ros.core.domain.Label`.

    Raises:
        WorldError: a file is missing, empty, damaged, too large or of another size than its
            labels; or the ground sampling distance is neither given nor in the file.
    """
    file = Path(path)
    photo = read_photo(file)
    gsd_m = read_gsd_m(file) if gsd_m is None else gsd_m
    raster = None if labels is None else read_indices(Path(labels))
    if raster is not None and photo.known is not None and raster.shape == photo.known.shape:
        raster = np.where(photo.known, raster, np.uint8(Label.UNLABELED))
    return World(photo.rgb, raster, float(gsd_m), file.stem)


def _check_labels(labels: NDArray[np.uint8], image: NDArray[np.uint8], name: str) -> None:
    if labels.ndim != 2 or labels.dtype != np.uint8:
        raise WorldError(
            f'label raster of world {name!r} has shape {labels.shape}, {labels.dtype}: '
            'give a single channel of uint8'
        )
    if labels.shape != image.shape[:2]:
        raise WorldError(
            f'label raster of world {name!r} is {labels.shape[1]} x {labels.shape[0]} px, its '
            f'image {image.shape[1]} x {image.shape[0]} px: both must be of one size'
        )
    if (highest := int(labels.max())) > max(Label):
        raise WorldError(
            f'label raster of world {name!r} holds the value {highest}: '
            f'labels are 0 to {int(max(Label))}'
        )
