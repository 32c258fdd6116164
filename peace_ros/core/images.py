# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pixels of image messages <-> RGB arrays; whatever cannot be trusted is an ImageError.

Nodes and recordings read by the same rules; nothing here imports ROS or a type store.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

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
_JPEG_START = b'\xff\xd8'
_JPEG_END = b'\xff\xd9'
_PNG_START = b'\x89PNG\r\n\x1a\n'
_PNG_HEADER_BYTES = 24
_START_OF_FRAME = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_START_OF_SCAN = 0xDA
_WITHOUT_LENGTH = frozenset(range(0xD0, 0xD8)) | {0x01}


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

    OpenCV fills what a truncated JPEG lacks with grey and calls it a success, so its end is
    looked for here, and its size before memory is taken for it.

    Args:
        kind: The format field of the message, only quoted; the bytes tell what they are.
        data: Anything with the buffer protocol.

    Raises:
        ImageError: neither JPEG nor PNG, truncated, damaged, or of impossible size.

    """
    encoded = bytes(memoryview(data))
    if encoded.startswith(_JPEG_START):
        width, height = _jpeg_size(encoded)
    elif encoded.startswith(_PNG_START):
        width, height = _png_size(encoded)
    else:
        raise ImageError(
            f'compressed image of {len(encoded)} bytes with format {kind!r} is neither JPEG nor '
            'PNG: publish one of them'
        )
    _check_size(width, height)
    try:
        bgr = cv2.imdecode(
            np.frombuffer(encoded, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
        )
    except cv2.error as error:
        raise _damaged(kind, encoded) from error
    if bgr is None:
        raise _damaged(kind, encoded)
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8)


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


def _damaged(kind: str, encoded: bytes) -> ImageError:
    return ImageError(
        f'compressed image of {len(encoded)} bytes with format {kind!r} is damaged: '
        'check the link that carries it'
    )


def _truncated(name: str, encoded: bytes) -> ImageError:
    return ImageError(
        f'{name} of {len(encoded)} bytes lacks its end: it was truncated on its way; '
        'publish whole images'
    )


def _jpeg_size(encoded: bytes) -> tuple[int, int]:
    """Walk the segments of a JPEG (ITU T.81 annex B) to its scan; return (width, height)."""
    size: tuple[int, int] | None = None
    at = len(_JPEG_START)
    while at + 4 <= len(encoded):
        if encoded[at] != 0xFF:
            raise _damaged('jpeg', encoded)
        marker = encoded[at + 1]
        if marker == 0xFF or marker in _WITHOUT_LENGTH:
            at += 1 if marker == 0xFF else 2
            continue
        if marker in _START_OF_FRAME and at + 9 <= len(encoded):
            height, width = struct.unpack_from('>HH', encoded, at + 5)
            size = (width, height)
        if marker == _START_OF_SCAN:
            # In the entropy-coded data 0xFF is always stuffed, so this is the true end.
            if size is None or encoded.find(_JPEG_END, at) < 0:
                break
            return size
        at += 2 + int(struct.unpack_from('>H', encoded, at + 2)[0])
    raise _truncated('JPEG', encoded)


def _png_size(encoded: bytes) -> tuple[int, int]:
    """Return (width, height) of a PNG's header when its end is there too."""
    if len(encoded) < _PNG_HEADER_BYTES or b'IEND' not in encoded[-64:]:
        raise _truncated('PNG', encoded)
    width, height = struct.unpack_from('>II', encoded, 16)
    return width, height
