# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pixels of image messages <-> RGB arrays; whatever cannot be trusted is an ImageError.

Nodes and recordings read by the same rules; nothing here imports ROS or a type store.
"""

from __future__ import annotations

import struct
from io import BytesIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from peace_ros.core.domain import ImageError

MAX_PIXELS = 50_000_000
"""Larger images are refused before they are decoded: a damaged header may claim anything."""

_CHANNELS = {'rgb8': 3, 'bgr8': 3, 'rgba8': 4, 'bgra8': 4, 'mono8': 1, '8UC3': 3, '8UC1': 1}
_TO_RGB = {
    'bgr8': cv2.COLOR_BGR2RGB,
    'rgba8': cv2.COLOR_RGBA2RGB,
    'bgra8': cv2.COLOR_BGRA2RGB,
    'mono8': cv2.COLOR_GRAY2RGB,
    '8UC3': cv2.COLOR_BGR2RGB,  # as OpenCV keeps colours, and cv_bridge with it
    '8UC1': cv2.COLOR_GRAY2RGB,
}
_MODES = frozenset({'1', 'L', 'LA', 'P', 'RGB', 'RGBA', 'CMYK', 'YCbCr'})
"""Of Pillow, with 8 bits per colour."""


def rgb_from_message(message: Any) -> NDArray[np.uint8]:
    """Return the height x width x 3 RGB array of any object with the fields of an image message.

    Raises:
        ImageError: see :func:`rgb_from_raw` and :func:`rgb_from_compressed`.

    """
    if hasattr(message, 'format'):
        return rgb_from_compressed(message.format, message.data)
    return rgb_from_raw(message.encoding, message.width, message.height, message.step, message.data)


def pixels_from_raw(
    encoding: str, width: int, height: int, step: int, data: Any
) -> NDArray[np.uint8]:
    """Return the height x width x channels array of a raw image, without a copy where possible.

    Args:
        encoding: One of rgb8, bgr8, rgba8, bgra8, mono8, 8UC3 (BGR), 8UC1.
        width: Pixels of a row.
        height: Rows.
        step: Bytes from one row to the next; what exceeds the pixels is padding.
        data: Anything with the buffer protocol.

    Raises:
        ImageError: unknown encoding, impossible size, or not height x step bytes.

    """
    channels = _CHANNELS.get(encoding)
    if channels is None:
        raise ImageError(f'image encoding {encoding!r}: publish one of {", ".join(_CHANNELS)}')
    _check_size(width, height)
    row_bytes = width * channels
    if step < row_bytes:
        raise ImageError(
            f'image step {step} bytes: a row of {width} px {encoding} takes at least {row_bytes}; '
            'set step to the bytes of a row'
        )
    flat = np.frombuffer(data, np.uint8)
    if flat.size != step * height:
        raise ImageError(
            f'image data of {flat.size} bytes: {height} rows of {step} bytes make {step * height}; '
            'publish whole images'
        )
    return flat.reshape(height, step)[:, :row_bytes].reshape(height, width, channels)


def rgb_from_raw(encoding: str, width: int, height: int, step: int, data: Any) -> NDArray[np.uint8]:
    """Return the height x width x 3 RGB array of a raw image; see :func:`pixels_from_raw`."""
    pixels = pixels_from_raw(encoding, width, height, step, data)
    if encoding not in _TO_RGB:
        return pixels
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), _TO_RGB[encoding]), dtype=np.uint8)


def rgb_from_compressed(kind: str, data: Any) -> NDArray[np.uint8]:
    """Return the height x width x 3 RGB array of a JPEG or PNG.

    The size is looked at before memory is taken for it. OpenCV would fill what a truncated JPEG
    lacks with grey and call it a success; Pillow refuses it.

    Args:
        kind: The format field of the message, only quoted; the bytes themselves are examined.
        data: Anything with the buffer protocol.

    Raises:
        ImageError: neither JPEG nor PNG, truncated, damaged, or of impossible size.

    """
    encoded = bytes(memoryview(data))
    told = f'compressed image of {len(encoded)} bytes with format {kind!r}'
    try:
        with Image.open(BytesIO(encoded), formats=('JPEG', 'PNG')) as image:
            _check_size(*image.size)
            if image.mode not in _MODES:
                raise ImageError(
                    f'{told} has pixels of kind {image.mode}: publish 8 bits per colour'
                )
            return np.asarray(image.convert('RGB'))
    except UnidentifiedImageError as error:
        raise ImageError(
            f'{told} is neither JPEG nor PNG, or damaged at its start: publish one of them'
        ) from error
    except Image.DecompressionBombError as error:
        raise ImageError(f'{told}: {error}: publish a smaller one') from error
    except (OSError, SyntaxError, ValueError, struct.error) as error:
        raise ImageError(
            f'{told} is damaged or truncated ({error}): check the link that carries it'
        ) from error


def read_image(path: Path | str) -> NDArray[np.uint8]:
    """Return the height x width x 3 RGB array of a JPEG or PNG file.

    Raises:
        ImageError: it cannot be read; see :func:`rgb_from_compressed`.

    """
    file = Path(path).expanduser()
    try:
        return rgb_from_compressed(file.suffix.lstrip('.'), file.read_bytes())
    except OSError as error:
        raise ImageError(f'{file}: {error.strerror}: give a JPEG or PNG file') from error
    except ImageError as error:
        raise ImageError(f'{file}: {error}') from error


def jpeg_from_rgb(image_rgb: NDArray[np.uint8], quality: int) -> bytes:
    """Return the JPEG of a height x width x 3 RGB array; quality 1 to 100."""
    done, encoded = cv2.imencode(
        '.jpg', cv2.cvtColor(image_rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality]
    )
    if not done:
        raise ImageError(f'image of shape {image_rgb.shape} cannot be written as JPEG')
    return bytes(encoded.tobytes())


def _check_size(width: int, height: int) -> None:
    """Raise ImageError unless the image has 1 to MAX_PIXELS pixels."""
    if width < 1 or height < 1:
        raise ImageError(f'image of {width} x {height} px is empty: both must be 1 or more')
    if width * height > MAX_PIXELS:
        raise ImageError(
            f'image of {width} x {height} px: at most {MAX_PIXELS} pixels are taken; '
            'publish a smaller one'
        )
