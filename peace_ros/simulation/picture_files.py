# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bytes of JPEG, PNG, BMP and WebP files -> arrays, within limits and whole or not at all."""

from __future__ import annotations

import stat
import struct
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import simplejpeg
from numpy.typing import NDArray
from PIL import Image

from peace_ros.core.domain import WorldError

MAX_PIXELS = 400_000_000
MAX_SIDE_PX = 32_766
"""OpenCV's warps address pixels with 16 bits."""
MAX_BYTES = 4 << 30
_PIXELS_PER_BYTE = 8256
"""Most that deflate packs into a byte, at one bit per pixel: a header may claim anything."""
_PNG, _JPEG = b'\x89PNG\r\n\x1a\n', b'\xff\xd8'
_UPRIGHT = 1
_ORIENTATION = 0x0112
_FORMATS = ('JPEG', 'PNG', 'BMP', 'WEBP')

_TURNS: dict[int, Callable[[NDArray[Any]], NDArray[Any]]] = {
    2: lambda pixels: pixels[:, ::-1],
    3: lambda pixels: pixels[::-1, ::-1],
    4: lambda pixels: pixels[::-1],
    5: lambda pixels: pixels.swapaxes(0, 1),
    6: lambda pixels: np.rot90(pixels, -1),
    7: lambda pixels: pixels[::-1, ::-1].swapaxes(0, 1),
    8: np.rot90,
}
"""EXIF orientation -> what puts the stored pixels upright."""


class RasterError(WorldError):
    """An image or label file that cannot be read as it should be."""


class DecodedPicture(NamedTuple):
    """The pixels of a file as they are stored."""

    pixels: NDArray[Any]
    """Height x width x bands: RGB, or grey, the last of two or four bands is alpha."""
    orientation: int
    """Of EXIF, 1 to 8; 1 is upright."""

    def upright(self) -> NDArray[Any]:
        """Return the pixels turned as the file says."""
        turn = _TURNS.get(self.orientation)
        return self.pixels if turn is None else np.ascontiguousarray(turn(self.pixels))


def check_size(width_px: int, height_px: int, name: str | Path) -> None:
    """Raise RasterError when an image is too large."""
    if width_px * height_px > MAX_PIXELS or max(width_px, height_px) > MAX_SIDE_PX:
        raise RasterError(
            f'{name} of {width_px} x {height_px} px is over the limit of '
            f'{MAX_PIXELS // 1_000_000} Mpx and {MAX_SIDE_PX} px a side: '
            'cut it or use a larger ground sampling distance'
        )


def bytes_of(path: Path) -> bytes:
    """Return the content of a regular file of a size that an image may have.

    Raises:
        RasterError: there is none, it is a device or a pipe, or it is too small or too large.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode) or status.st_size > MAX_BYTES:
            raise RasterError(
                f'{path} is not a regular file of up to {MAX_BYTES >> 30} GiB: give an image file'
            )
        data = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a name with a NUL
        reason = error.strerror if isinstance(error, OSError) else error
        raise RasterError(
            f'{path!s} cannot be read ({reason}): give an existing image file'
        ) from error
    if len(data) < 26:
        raise RasterError(f'{path} holds {len(data)} bytes: give a JPEG, PNG or TIFF image')
    if data[:2] == _JPEG and b'\xff\xd9' not in data[-65536:]:
        raise RasterError(
            f'{path} ends after {len(data)} bytes without the end mark of a JPEG: it is cut short, '
            'copy it again'
        )
    return data


def decoded(data: bytes, path: Path) -> DecodedPicture:
    """Decode a JPEG, PNG, BMP or WebP of 8 or 16 bits.

    Raises:
        RasterError: it is none of them, is damaged anywhere, or is too large.
    """
    orientation = _examined(data, path)
    try:
        if data[:2] == _JPEG:
            # Other decoders shift what follows a gap, and say no more than a warning.
            return DecodedPicture(simplejpeg.decode_jpeg(data, 'RGB', strict=True), orientation)
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except (cv2.error, ValueError) as error:
        reason = error.err if isinstance(error, cv2.error) else error
        raise RasterError(f'{path} cannot be decoded ({reason}): copy it again') from error
    if image is None:
        raise RasterError(f'{path} is damaged: copy it again, or save it as PNG')
    pixels = np.atleast_3d(np.asarray(image))
    colours = [2, 1, 0, 3][: pixels.shape[2]] if pixels.shape[2] >= 3 else [0, 1][: pixels.shape[2]]
    return DecodedPicture(pixels[..., colours], orientation)


def _examined(data: bytes, path: Path) -> int:
    """Check size and checksums before memory is taken for the pixels; return the orientation."""
    width, height = _declared_size(data)
    check_size(width, height, path)
    if width * height > _PIXELS_PER_BYTE * len(data):
        raise RasterError(
            f'{path}: {len(data)} bytes cannot hold {width} x {height} px: copy it again'
        )
    try:
        with Image.open(BytesIO(data), formats=_FORMATS) as image:
            if data[:8] == _PNG:
                image.verify()
                return _UPRIGHT  # cameras write no PNG
            orientation = int(image.getexif().get(_ORIENTATION, _UPRIGHT))
    except Image.DecompressionBombError:  # its limit is lower than ours
        return _UPRIGHT
    except (OSError, SyntaxError, ValueError, TypeError, OverflowError, struct.error) as error:
        raise RasterError(
            f'{path} of {len(data)} bytes is not a readable image ({error}): give a JPEG, PNG or '
            'TIFF image'
        ) from error
    return orientation if orientation in _TURNS else _UPRIGHT


def _declared_size(data: bytes) -> tuple[int, int]:
    """Return (width, height) as the header says, 1 x 1 for what is small by its format."""
    if data[:8] == _PNG:
        return int.from_bytes(data[16:20], 'big'), int.from_bytes(data[20:24], 'big')
    if data[:2] == b'BM':
        width, height = struct.unpack_from('<ii', data, 18)
        return abs(width), abs(height)
    at = 2 if data[:2] == _JPEG else len(data)
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        # Start-of-frame markers carry the size; C4, C8 and CC are tables.
        if 0xC0 <= marker <= 0xCF and marker not in {0xC4, 0xC8, 0xCC}:
            height = int.from_bytes(data[at + 5 : at + 7], 'big')
            return int.from_bytes(data[at + 7 : at + 9], 'big'), height
        at += 2 + int.from_bytes(data[at + 2 : at + 4], 'big')
    return 1, 1  # WebP has at most 16,383 pixels a side
