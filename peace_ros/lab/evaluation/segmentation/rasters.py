# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Image and label files -> arrays; whatever cannot be read is named."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.lab.evaluation.segmentation.errors import SampleError

IMAGE_SUFFIXES = ('.jpg', '.jpeg', '.png', '.tif', '.tiff', '.bmp', '.webp')
_PNG = b'\x89PNG\r\n\x1a\n'
_PALETTE = 3


def read_image(path: Path) -> NDArray[np.uint8]:
    """Return height x width x 3 RGB, as it lies in the file (no turning by EXIF).

    Raises SampleError.
    """
    bgr = _decode(path, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)


def read_indices(path: Path) -> NDArray[Any]:
    """Return height x width of class indices, also of PNGs with a palette; raises SampleError."""
    data = _read(path)
    raster = _decode(path, cv2.IMREAD_UNCHANGED, data)
    if raster.ndim == 2:
        return raster
    bgr = raster[..., :3]
    palette = _palette(data)
    if palette is not None:
        return _indices_of(bgr, palette, path)
    if (bgr[..., 0] == bgr[..., 1]).all() and (bgr[..., 0] == bgr[..., 2]).all():
        return np.ascontiguousarray(bgr[..., 0])
    raise SampleError(
        f'{path}: a colour image where class indices are due: give one channel, or a class table '
        'with colours'
    )


def read_colours(path: Path) -> NDArray[np.uint8]:
    """Return height x width x 3 RGB of a coloured label image; raises SampleError."""
    raster = _decode(path, cv2.IMREAD_UNCHANGED)
    if raster.ndim != 3 or raster.dtype != np.uint8:
        raise SampleError(
            f'{path}: {raster.ndim} axes of {raster.dtype} where a colour image is due: give RGB, '
            'or a class table with indices'
        )
    return np.ascontiguousarray(raster[..., 2::-1], np.uint8)


def _read(path: Path) -> bytes:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SampleError(f'{path}: {error.strerror}') from error
    if not data:
        raise SampleError(f'{path}: holds 0 bytes')
    if data[:2] == b'\xff\xd8' and b'\xff\xd9' not in data[-65536:]:
        raise SampleError(f'{path}: a JPEG without its end, {len(data)} bytes: copy it again')
    return data


def _decode(path: Path, flags: int, data: bytes | None = None) -> NDArray[Any]:
    data = _read(path) if data is None else data
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise SampleError(f'{path}: cannot be decoded ({error.err})') from error
    if image is None:
        raise SampleError(f'{path}: {len(data)} bytes that are no readable image')
    return np.asarray(image)


def _palette(data: bytes) -> NDArray[np.uint8] | None:
    """Return the [N, 3] RGB palette of a PNG, None when it has none (PNG specification, 11.2)."""
    if data[:8] != _PNG or len(data) < 26 or data[25] != _PALETTE:
        return None
    at = 8
    while at + 8 <= len(data):
        length, kind = struct.unpack('>I4s', data[at : at + 8])
        if kind == b'PLTE':
            table = np.frombuffer(data[at + 8 : at + 8 + length], np.uint8)
            return table[: length - length % 3].reshape(-1, 3)
        at += 12 + length
    return None


def _indices_of(
    bgr: NDArray[np.uint8], palette: NDArray[np.uint8], path: Path
) -> NDArray[np.uint8]:
    def packed(colours: NDArray[np.uint8], order: tuple[int, int, int]) -> NDArray[np.uint32]:
        wide = colours.astype(np.uint32)
        red, green, blue = (wide[..., axis] for axis in order)
        return np.asarray((red << 16) | (green << 8) | blue, np.uint32)

    keys = _without_padding(packed(palette, (0, 1, 2)))
    known, first = np.unique(keys, return_index=True)
    used, inverse = np.unique(packed(bgr, (2, 1, 0)), return_inverse=True)
    places = np.searchsorted(known, used)
    repeated = [int(key) for key in used if (keys == key).sum() > 1]
    if repeated or not np.isin(used, known).all():
        raise SampleError(
            f'{path}: its palette has the same colour twice: save the indices as grey values'
        )
    return np.asarray(first[places][inverse].reshape(bgr.shape[:2]), np.uint8)


def _without_padding(keys: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return the colours without the last one's repeats: writers fill palettes up with black."""
    last = len(keys)
    while last > 1 and keys[last - 1] == keys[last - 2]:
        last -= 1
    filled = last < len(keys) and keys[last - 1] in keys[: last - 1]
    return keys[: last - 1] if filled else keys[:last]
