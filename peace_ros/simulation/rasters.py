# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Image and label files -> arrays; TIFF and GeoTIFF by rasterio, others by picture_files.

rasterio comes with the extra ``geo`` and is imported only for TIFF files and PNGs with a palette.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from math import atan2, degrees, hypot, isclose, isfinite, sqrt
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from peace_ros.simulation.picture_files import RasterError, bytes_of, check_size, decoded

IMAGE_SUFFIXES = ('.jpg', '.jpeg', '.png', '.tif', '.tiff', '.bmp', '.webp')
WHITE_PERCENT = 99.8
"""Images of 16 bits are scaled so that this share of their values lies below white."""

_TIFF = (b'II*\0', b'MM\0*', b'II+\0', b'MM\0+')
_PNG = b'\x89PNG\r\n\x1a\n'
_PNG_PALETTE = 3
_WITH_ALPHA = (2, 4)
"""Numbers of bands of which the last is alpha."""
_SAME = 0.01
"""Relative difference of two lengths that count as equal."""
_NORTH_DEG = 10.0
"""Angle between up and north that still counts as north: the convergence of usual projections."""
_GSD_REMEDY = 'give gsd, the ground sampling distance in metres per pixel'


class Photo(NamedTuple):
    """An image and where it shows anything."""

    rgb: NDArray[np.uint8]
    """Height x width x 3, RGB."""
    known: NDArray[np.bool_] | None
    """Height x width, false where the file has no data or is transparent; None: true everywhere."""
    orientation: int = 1
    """Of EXIF: how the stored pixels were turned to be upright, 1 is not at all."""


def read_photo(path: Path) -> Photo:
    """Read an image: upright as its EXIF orientation says, 16 bits scaled to 8.

    Raises RasterError when the file or a part of it cannot be read, when it is too large, or when
    nobody can tell which of its bands are red, green and blue.
    """
    data = bytes_of(path)
    known: NDArray[np.bool_] | None
    orientation = 1
    if data[:4] in _TIFF:
        with _opened(path) as dataset:
            values, known = _bands(dataset, path)
    else:
        picture = decoded(data, path)
        orientation, values = picture.orientation, picture.upright()
        known = values[..., -1] > 0 if values.shape[2] in _WITH_ALPHA else None
        values = values[..., :3] if values.shape[2] >= 3 else np.repeat(values[..., :1], 3, axis=2)
        if orientation != 1:
            _tell_turning()
    known = None if known is None or known.all() else known
    return Photo(np.ascontiguousarray(_eight_bit(values, known, path)), known, orientation)


def read_indices(path: Path) -> NDArray[Any]:
    """Return height x width of class indices, of PNGs with a palette too; raises RasterError."""
    data = bytes_of(path)
    if data[:4] in _TIFF or (data[:8] == _PNG and data[25] == _PNG_PALETTE):
        with _opened(path) as dataset:
            raster = np.moveaxis(_read(dataset, path, list(dataset.indexes)), 0, -1)
    else:
        raster = decoded(data, path).pixels
    colours = raster[..., :3]
    if (colours != colours[..., :1]).any():
        raise RasterError(
            f'{path}: a colour image, but class indices are needed: give one channel, or a class '
            'table with colours'
        )
    return np.ascontiguousarray(raster[..., 0])


def read_gsd_m(path: Path) -> float:
    """Return the ground sampling distance, metres per pixel, from the georeference of a GeoTIFF.

    Raises RasterError for other files, for pixels that are not square, for images whose upper edge
    is not north, and for a reference system that does not tell metres on the ground.
    """
    if bytes_of(path)[:4] not in _TIFF:
        raise RasterError(f'{path} has no ground sampling distance of its own: {_GSD_REMEDY}')
    with _opened(path) as dataset:
        return _gsd_m(dataset, path)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a file with rasterio; errors of the library become a RasterError, warnings vanish."""
    try:
        import rasterio  # noqa: PLC0415 -- optional: the extra "geo"
    except ImportError as error:
        raise RasterError(
            f'{path} needs rasterio, which is missing: run pip install rasterio'
        ) from error
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            with rasterio.open(path) as dataset:
                check_size(dataset.width, dataset.height, path)
                yield dataset
    except rasterio.errors.RasterioError as error:
        raise _damaged(path, error.__cause__ or error) from error


def _damaged(path: Path, reason: object) -> RasterError:
    return RasterError(
        f'{path} cannot be decoded, at least in parts ({reason}): copy it again, or recompress it '
        'with gdal_translate -co COMPRESS=DEFLATE'
    )


class _Warnings(logging.Handler):
    """Keeps what GDAL says of data that it decoded only in parts and called a success."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.said: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.said.append(record.getMessage())


def _read(dataset: Any, path: Path, bands: list[int]) -> NDArray[Any]:
    log, warned = logging.getLogger('rasterio._err'), _Warnings()
    log.addHandler(warned)
    try:
        values: NDArray[Any] = dataset.read(bands)
    finally:
        log.removeHandler(warned)
    if warned.said:
        raise _damaged(path, warned.said[0])
    if values.dtype not in (np.uint8, np.uint16):
        raise RasterError(
            f'{path}: values of {values.dtype}: scale them to 8 bits, '
            'gdal_translate -ot Byte -scale in.tif out.tif'
        )
    return values


def _bands(dataset: Any, path: Path) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return height x width x 3 RGB, and where it is known."""
    meanings = [each.name for each in dataset.colorinterp]
    known = dataset.dataset_mask() > 0
    if 'alpha' in meanings:
        known &= dataset.read(meanings.index('alpha') + 1) > 0
    if meanings[0] == 'palette':
        table = np.zeros((256, 3), np.uint8)
        for index, colour in dataset.colormap(1).items():
            table[index] = colour[:3]
        return table[_read(dataset, path, [1])[0]], known
    if {'red', 'green', 'blue'} <= set(meanings):
        chosen = [meanings.index(name) + 1 for name in ('red', 'green', 'blue')]
    elif len(set(meanings) - {'alpha'}) == 1 and meanings[0] == 'gray' and len(meanings) < 3:
        chosen = [1, 1, 1]
    elif len(meanings) == 3:
        chosen = [1, 2, 3]
    else:
        raise RasterError(
            f'{path}: {len(meanings)} bands ({", ".join(meanings)}), none of which is said to be '
            'red, green or blue: gdal_translate -b 1 -b 2 -b 3 in.tif out.tif'
        )
    return np.moveaxis(_read(dataset, path, chosen), 0, -1), known


def _eight_bit(
    values: NDArray[Any], known: NDArray[np.bool_] | None, path: Path
) -> NDArray[np.uint8]:
    if values.dtype == np.uint8:
        return np.asarray(values, np.uint8)
    if values.dtype != np.uint16:
        raise RasterError(f'{path}: values of {values.dtype}: scale them to 8 bits')
    _tell_scaling()
    step = max(1, int(sqrt(values.size / 3_000_000)))
    sampled = values[::step, ::step]
    sampled = sampled if known is None else sampled[known[::step, ::step]]
    white = max(1.0, float(np.percentile(sampled, WHITE_PERCENT))) if sampled.size else 1.0
    return np.asarray(np.clip(values * np.float32(255.0 / white), 0.0, 255.0), np.uint8)


@cache
def _tell_turning() -> None:
    logging.getLogger(__name__).warning(
        'photos with an EXIF orientation are turned upright, labels are taken to be so already'
    )


@cache
def _tell_scaling() -> None:
    logging.getLogger(__name__).warning(
        'images of 16 bits: the brightest %.1f %% of the values of each become white',
        100.0 - WHITE_PERCENT,
    )


def _gsd_m(dataset: Any, path: Path) -> float:
    matrix, crs = dataset.transform, dataset.crs
    if matrix.is_identity or crs is None:
        raise RasterError(f'{path} has no scale in a known reference system: {_GSD_REMEDY}')
    if crs.is_geographic:
        raise RasterError(
            f'{path} is georeferenced in degrees: project it to metres (for instance UTM), or '
            f'{_GSD_REMEDY}'
        )
    if not crs.is_projected:
        raise RasterError(
            f'{path} is in a local reference system whose unit is not certain: {_GSD_REMEDY}'
        )
    remedy = f'gdalwarp it to square pixels with north up, or {_GSD_REMEDY} if up is north'
    right, up = _ground_vectors_m(dataset, path)
    if abs(degrees(atan2(*up))) > _NORTH_DEG or right[0] < 0.0:
        raise RasterError(f'{path}: its upper edge is not north: {remedy}')
    across_m, along_m = hypot(*right), hypot(*up)
    if not isclose(across_m, along_m, rel_tol=_SAME):
        raise RasterError(f'{path}: pixels of {across_m:.3g} x {along_m:.3g} m: {remedy}')
    # UTM and its like are metres on the ground, near enough; Mercator is not.
    grid_m = float(matrix.a) * float(crs.linear_units_factor[1])
    return grid_m if isclose(grid_m, across_m, rel_tol=_SAME) else across_m


def _ground_vectors_m(dataset: Any, path: Path) -> list[NDArray[np.float64]]:
    """Return (east, north) of one pixel to the right and one up, in the middle of the image.

    On a plane that touches the ellipsoid there, so that any projection and unit will do.
    """
    from rasterio.warp import transform  # noqa: PLC0415 -- optional

    column, row, step = dataset.width / 2, dataset.height / 2, 100.0
    places = dataset.xy([row, row, row - step], [column, column + step, column])
    longitude, latitude = (each[0] for each in transform(dataset.crs, 'EPSG:4326', *places))
    if not isfinite(longitude + latitude):
        raise RasterError(f'{path} lies outside of its reference system: {_GSD_REMEDY}')
    plane = f'+proj=aeqd +datum=WGS84 +lat_0={latitude} +lon_0={longitude}'
    on_ground = np.array(transform(dataset.crs, plane, *places)).T
    return [(end - on_ground[0]) / step for end in on_ground[1:]]
