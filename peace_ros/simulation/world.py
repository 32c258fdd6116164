# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ground that a simulated camera flies over: an orthophoto file or a drawn place."""

from __future__ import annotations

from dataclasses import dataclass
from math import isclose, isfinite
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label, WorldError
from peace_ros.simulation.drawing.town import draw_town

MAX_PIXELS = 400_000_000
MAX_SIDE_PX = 32_766
"""OpenCV's warps address pixels with 16 bits."""

_TIFF_SUFFIXES = ('.tif', '.tiff')
_LINEAR_UNITS_M = {9001: 1.0, 9002: 0.3048, 9003: 1200.0 / 3937.0}


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
        _check_size(image.shape[1], image.shape[0], self.name)
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


def draw_world(seed: int, size_m: float = 400.0, gsd_m: float = 0.1) -> World:
    """Draw a town with fields, parks, a river and everything between, with exact labels.

    Args:
        seed: 0 or more; the same seed gives the same world.
        size_m: side of the square in metres, 60 to 2000.
        gsd_m: ground sampling distance in metres per pixel, 0.05 to 2.

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
    _check_size(size_px, size_px, name)
    image, labels = draw_town(seed, size_px, gsd_m)
    return World(image, labels, gsd_m, name)


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
    data = _read(file)
    if gsd_m is None:
        gsd_m = _georeferenced_gsd_m(file)
    if (size := _declared_size(data)) is not None:
        _check_size(*size, file.name)
    bgr = _decode(data, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION, file)
    image = np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)
    raster = None
    if labels is not None:
        raster_file = Path(labels)
        raster = _decode(_read(raster_file), cv2.IMREAD_UNCHANGED, raster_file)
    return World(image, raster, float(gsd_m), file.stem)


def _read(file: Path) -> bytes:
    try:
        data = file.read_bytes()
    except OSError as error:
        raise WorldError(
            f'world file {file} cannot be read ({error.strerror}): give an existing image file'
        ) from error
    if not data:
        raise WorldError(f'world file {file} holds 0 bytes: give a JPEG, PNG or GeoTIFF image')
    if data[:2] == b'\xff\xd8' and b'\xff\xd9' not in data[-65536:]:
        raise WorldError(
            f'world file {file} ends after {len(data)} bytes without the end mark of a JPEG: '
            'it is cut short, copy it again'
        )
    return data


def _decode(data: bytes, flags: int, file: Path) -> NDArray[Any]:
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise WorldError(
            f'world file {file} of {len(data)} bytes cannot be decoded ({error.err}): '
            'give a JPEG, PNG or TIFF image'
        ) from error
    if image is None:
        raise WorldError(
            f'world file {file} of {len(data)} bytes is not a readable image: '
            'give a JPEG, PNG or TIFF image'
        )
    return np.asarray(image)


def _check_size(width_px: int, height_px: int, name: str) -> None:
    if width_px * height_px > MAX_PIXELS or max(width_px, height_px) > MAX_SIDE_PX:
        raise WorldError(
            f'world {name!r} of {width_px} x {height_px} px is over the limit of '
            f'{MAX_PIXELS // 1_000_000} Mpx and {MAX_SIDE_PX} px a side: '
            'cut it or use a larger ground sampling distance'
        )


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


def _declared_size(data: bytes) -> tuple[int, int] | None:
    """Return (width, height) from the header of a PNG or JPEG, before the pixels are decoded."""
    if data[:8] == b'\x89PNG\r\n\x1a\n' and len(data) >= 24:
        return int.from_bytes(data[16:20], 'big'), int.from_bytes(data[20:24], 'big')
    if data[:2] != b'\xff\xd8':
        return None
    at = 2
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        # Start-of-frame markers carry the size; C4, C8 and CC are tables.
        if 0xC0 <= marker <= 0xCF and marker not in {0xC4, 0xC8, 0xCC}:
            height = int.from_bytes(data[at + 5 : at + 7], 'big')
            return int.from_bytes(data[at + 7 : at + 9], 'big'), height
        at += 2 + int.from_bytes(data[at + 2 : at + 4], 'big')
    return None


def _georeferenced_gsd_m(file: Path) -> float:
    if file.suffix.lower() not in _TIFF_SUFFIXES:
        raise WorldError(
            f'world file {file} has no ground sampling distance of its own: '
            'give it in metres per pixel'
        )
    try:
        import tifffile  # noqa: PLC0415 -- optional, only to read the georeference
    except ImportError as error:
        raise WorldError(
            f'the georeference of {file} needs the package tifffile, which is missing: install '
            'the extra "geo" or give the ground sampling distance in metres per pixel'
        ) from error
    try:
        with tifffile.TiffFile(file) as tiff:
            page = tiff.pages[0]
            tags = dict(page.geotiff_tags)
            _check_size(int(page.imagewidth), int(page.imagelength), file.name)
    except (tifffile.TiffFileError, ValueError, KeyError, IndexError) as error:
        raise WorldError(f'{file} is not a readable GeoTIFF ({error}): export it again') from error
    return _gsd_of_tags(tags, file)


def _gsd_of_tags(tags: dict[str, Any], file: Path) -> float:
    """Return metres per pixel from GeoTIFF keys (OGC 19-008r4)."""
    if int(tags.get('GTModelTypeGeoKey', 1)) == 2:
        raise WorldError(
            f'{file} is georeferenced in degrees: project it to metres (for instance UTM) or give '
            'the ground sampling distance in metres per pixel'
        )
    if 'ModelPixelScale' in tags:
        across, along = (float(v) for v in tags['ModelPixelScale'][:2])
    elif 'ModelTransformation' in tags:
        matrix = np.asarray(tags['ModelTransformation'], float).reshape(4, 4)
        across, along = (float(np.hypot(*matrix[:2, k])) for k in (0, 1))
    else:
        raise WorldError(
            f'{file} has neither ModelPixelScale nor ModelTransformation: '
            'give the ground sampling distance in metres per pixel'
        )
    if not isclose(across, along, rel_tol=0.01):
        raise WorldError(f'{file} has pixels of {across} x {along}: resample it to square pixels')
    unit = int(tags.get('ProjLinearUnitsGeoKey', 9001))
    if unit not in _LINEAR_UNITS_M:
        raise WorldError(
            f'{file} is in the linear unit {unit}, known are {sorted(_LINEAR_UNITS_M)}: '
            'give the ground sampling distance in metres per pixel'
        )
    return across * _LINEAR_UNITS_M[unit]
