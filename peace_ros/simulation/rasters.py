# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Image and label files -> arrays: JPEG, PNG and the like by OpenCV, TIFF and GeoTIFF by rasterio.

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

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import WorldError

IMAGE_SUFFIXES = ('.jpg', '.jpeg', '.png', '.tif', '.tiff', '.bmp', '.webp')
MAX_PIXELS = 400_000_000
MAX_SIDE_PX = 32_766
"""OpenCV's warps address pixels with 16 bits."""
WHITE_PERCENT = 99.8
"""Images of 16 bits are scaled so that this share of their values lies below white."""

_TIFF = (b'II*\0', b'MM\0*', b'II+\0', b'MM\0+')
_PNG, _JPEG = b'\x89PNG\r\n\x1a\n', b'\xff\xd8'
_PNG_PALETTE = 3
_SAME = 0.01
"""Relative difference of two lengths that count as equal."""
_NORTH_DEG = 10.0
"""Angle between up and north that still counts as north: the convergence of usual projections."""
_GSD_REMEDY = 'give gsd, the ground sampling distance in metres per pixel'


class RasterError(WorldError):
    """An image or label file that cannot be read as it should be."""


class Photo(NamedTuple):
    """An image and where it shows anything."""

    rgb: NDArray[np.uint8]
    """Height x width x 3, RGB."""
    known: NDArray[np.bool_] | None
    """Height x width, false where the file has no data or is transparent; None: true everywhere."""


def read_photo(path: Path) -> Photo:
    """Read an image: upright as its EXIF orientation says, 16 bits scaled to 8.

    Raises RasterError when the file or a part of it cannot be read, when it is too large, or when
    nobody can tell which of its bands are red, green and blue.
    """
    data = _bytes_of(path)
    known: NDArray[np.bool_] | None
    if data[:4] in _TIFF:
        with _opened(path) as dataset:
            values, known = _bands(dataset, path)
    else:
        values, known = _decoded_colour(data, path)
    known = None if known is None or known.all() else known
    return Photo(np.ascontiguousarray(_eight_bit(values, known, path)), known)


def read_indices(path: Path) -> NDArray[Any]:
    """Return height x width of class indices, of PNGs with a palette too; raises RasterError."""
    data = _bytes_of(path)
    if data[:4] in _TIFF or (data[:8] == _PNG and data[25] == _PNG_PALETTE):
        with _opened(path) as dataset:
            raster = np.moveaxis(_read(dataset, path, list(dataset.indexes)), 0, -1)
    else:
        raster = np.atleast_3d(_decoded(data, cv2.IMREAD_UNCHANGED, path))
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
    if _bytes_of(path)[:4] not in _TIFF:
        raise RasterError(f'{path} has no ground sampling distance of its own: {_GSD_REMEDY}')
    with _opened(path) as dataset:
        return _gsd_m(dataset, path)


def check_size(width_px: int, height_px: int, name: str | Path) -> None:
    """Raise RasterError when an image is too large."""
    if width_px * height_px > MAX_PIXELS or max(width_px, height_px) > MAX_SIDE_PX:
        raise RasterError(
            f'{name} of {width_px} x {height_px} px is over the limit of '
            f'{MAX_PIXELS // 1_000_000} Mpx and {MAX_SIDE_PX} px a side: '
            'cut it or use a larger ground sampling distance'
        )


def _bytes_of(path: Path) -> bytes:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RasterError(
            f'{path} cannot be read ({error.strerror}): give an existing image file'
        ) from error
    if len(data) < 26:
        raise RasterError(f'{path} holds {len(data)} bytes: give a JPEG, PNG or TIFF image')
    if data[:2] == _JPEG and b'\xff\xd9' not in data[-65536:]:
        raise RasterError(
            f'{path} ends after {len(data)} bytes without the end mark of a JPEG: it is cut short, '
            'copy it again'
        )
    return data


def _decoded(data: bytes, flags: int, path: Path) -> NDArray[Any]:
    if (size := _declared_size(data)) is not None:
        check_size(*size, path)
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise RasterError(f'{path} cannot be decoded ({error.err}): recompress it') from error
    if image is None:
        raise RasterError(
            f'{path} of {len(data)} bytes is not a readable image: give a JPEG, PNG or TIFF image'
        )
    return np.asarray(image)


def _decoded_colour(data: bytes, path: Path) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    # Only this flag turns by EXIF, and only the other one keeps the transparency.
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH
    image = _decoded(data, flags if data[:2] == _JPEG else cv2.IMREAD_UNCHANGED, path)
    image = np.repeat(np.atleast_3d(image), 3, axis=2) if image.ndim == 2 else image
    known = image[..., 3] > 0 if image.shape[2] == 4 else None
    return image[..., 2::-1], known


def _declared_size(data: bytes) -> tuple[int, int] | None:
    """Return (width, height) from the header of a PNG or JPEG, before the pixels are decoded."""
    if data[:8] == _PNG:
        return int.from_bytes(data[16:20], 'big'), int.from_bytes(data[20:24], 'big')
    at = 2 if data[:2] == _JPEG else len(data)
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        # Start-of-frame markers carry the size; C4, C8 and CC are tables.
        if 0xC0 <= marker <= 0xCF and marker not in {0xC4, 0xC8, 0xCC}:
            height = int.from_bytes(data[at + 5 : at + 7], 'big')
            return int.from_bytes(data[at + 7 : at + 9], 'big'), height
        at += 2 + int.from_bytes(data[at + 2 : at + 4], 'big')
    return None


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
