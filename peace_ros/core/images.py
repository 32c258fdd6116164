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
import simplejpeg
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from peace_ros.core.domain import ImageError

MAX_PIXELS = 50_000_000
"""Larger images are refused before they are decoded: a damaged header may claim anything."""

_FORMATS: dict[str, tuple[int, int | None]] = {
    'rgb8': (3, None),
    'bgr8': (3, cv2.COLOR_BGR2RGB),
    'rgba8': (4, cv2.COLOR_RGBA2RGB),
    'bgra8': (4, cv2.COLOR_BGRA2RGB),
    'mono8': (1, cv2.COLOR_GRAY2RGB),
    '8UC3': (3, cv2.COLOR_BGR2RGB),  # as OpenCV keeps colours, and cv_bridge with it
    '8UC1': (1, cv2.COLOR_GRAY2RGB),
    'rgb16': (3, None),
    'bgr16': (3, cv2.COLOR_BGR2RGB),
    'rgba16': (4, cv2.COLOR_RGBA2RGB),
    'bgra16': (4, cv2.COLOR_BGRA2RGB),
    'mono16': (1, cv2.COLOR_GRAY2RGB),
    'yuyv': (2, cv2.COLOR_YUV2RGB_YUY2),
    'yuv422_yuy2': (2, cv2.COLOR_YUV2RGB_YUY2),
    'uyvy': (2, cv2.COLOR_YUV2RGB_UYVY),
    'yuv422': (2, cv2.COLOR_YUV2RGB_UYVY),
    'nv12': (1, cv2.COLOR_YUV2RGB_NV12),
    'nv21': (1, cv2.COLOR_YUV2RGB_NV21),
    # OpenCV names a Bayer pattern by its second row and column, ROS by its first.
    **{
        f'bayer_{pattern}{bits}': (1, code)
        for bits in (8, 16)
        for pattern, code in (
            ('rggb', cv2.COLOR_BayerBG2RGB),
            ('bggr', cv2.COLOR_BayerRG2RGB),
            ('gbrg', cv2.COLOR_BayerGR2RGB),
            ('grbg', cv2.COLOR_BayerGB2RGB),
        )
    },
}
"""Encoding of sensor_msgs -> samples per pixel, and the conversion of OpenCV."""
_HALVED = ('yuyv', 'yuv422_yuy2', 'uyvy', 'yuv422', 'nv12', 'nv21')
"""Colours are shared by pixels that are neighbours in a row."""
_PLANAR = ('nv12', 'nv21')
"""Below the rows of brightness there are half as many of colours."""
_PNG, _PNG_DEPTH = b'\x89PNG', 24
"""How a PNG begins, and where it says how many bits its samples have."""
_WHITE_PERCENT = 99.8
_FEWEST_BITS = 10
"""Of a sensor with 16 bits per sample: a dark picture stays dark."""
_MODES = frozenset({'1', 'L', 'LA', 'P', 'RGB', 'RGBA', 'CMYK', 'YCbCr'})
"""Of Pillow, with 8 bits per colour."""


def rgb_from_message(message: Any) -> NDArray[np.uint8]:
    """Return the height x width x 3 RGB array of any object with the fields of an image message.

    Raises:
        ImageError: see :func:`rgb_from_raw` and :func:`rgb_from_compressed`.

    """
    if hasattr(message, 'format'):
        return rgb_from_compressed(message.format, message.data)
    return rgb_from_raw(
        message.encoding,
        message.width,
        message.height,
        message.step,
        message.data,
        is_bigendian=bool(message.is_bigendian),
    )


def pixels_from_raw(
    encoding: str, width: int, height: int, step: int, data: Any, *, is_bigendian: bool = False
) -> NDArray[Any]:
    """Return the samples of a raw image as rows x width x samples, without a copy where possible.

    They are uint8 or uint16. There are ``height`` rows, and half as many more for nv12 and nv21.

    Args:
        encoding: Of sensor_msgs: 8 and 16 bit RGB, BGR, RGBA, BGRA, mono and Bayer, 8UC3 (BGR),
            8UC1, YUV 4:2:2 (yuyv, uyvy and their older names), nv12, nv21.
        width: Pixels of a row.
        height: Rows.
        step: Bytes from one row to the next; what exceeds the pixels is padding.
        data: Anything with the buffer protocol.
        is_bigendian: Order of the bytes of 16-bit samples.

    Raises:
        ImageError: unknown encoding, impossible size, or not all rows of step bytes.

    """
    samples, _ = _FORMATS.get(encoding, (0, None))
    if not samples:
        raise ImageError(f'image encoding {encoding!r}: publish one of {", ".join(_FORMATS)}')
    _check_size(width, height)
    if encoding in _HALVED and (width % 2 or (encoding in _PLANAR and height % 2)):
        raise ImageError(
            f'image of {width} x {height} px {encoding}: its pixels share colours in pairs; '
            'publish an even size'
        )
    kind = np.dtype(('>u2' if is_bigendian else '<u2') if encoding.endswith('16') else np.uint8)
    row_bytes, rows = width * samples * kind.itemsize, height
    if encoding in _PLANAR:
        rows += height // 2
    if step < row_bytes:
        raise ImageError(
            f'image step {step} bytes: a row of {width} px {encoding} takes at least {row_bytes}; '
            'set step to the bytes of a row'
        )
    flat = np.frombuffer(data, np.uint8)
    if flat.size != step * rows:
        raise ImageError(
            f'image data of {flat.size} bytes: {rows} rows of {step} bytes make {step * rows}; '
            'publish whole images'
        )
    lines = flat.reshape(rows, step)[:, :row_bytes]
    if kind.itemsize > 1:
        lines = np.ascontiguousarray(lines).view(kind)
    return lines.reshape(rows, width, samples)


def rgb_from_raw(
    encoding: str, width: int, height: int, step: int, data: Any, *, is_bigendian: bool = False
) -> NDArray[np.uint8]:
    """Return the height x width x 3 RGB array of a raw image; see :func:`pixels_from_raw`.

    16 bits become 8 by the number of bits that the values use, see :func:`eight_bits`.
    """
    pixels = pixels_from_raw(encoding, width, height, step, data, is_bigendian=is_bigendian)
    _, conversion = _FORMATS[encoding]
    pixels = eight_bits(pixels)
    if conversion is None:
        return pixels
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), conversion), dtype=np.uint8)


def eight_bits(values: NDArray[Any]) -> NDArray[np.uint8]:
    """Return 8 bits of samples of 8 or 16.

    Sensors fill 10, 12, 14 or 16 of 16 bits, and no message says how many. It is the number that
    the values need, the brightest 0.2 % aside, at least 10: the scale stays from frame to frame.
    """
    if values.dtype == np.uint8:
        return np.asarray(values, np.uint8)
    step = max(1, values.shape[0] // 256)
    white = int(np.percentile(values[::step], _WHITE_PERCENT))
    bits = max(_FEWEST_BITS, white.bit_length())
    return np.asarray(np.minimum(values >> (bits - 8), 255), np.uint8)


def rgb_from_compressed(kind: str, data: Any) -> NDArray[np.uint8]:
    """Return the height x width x 3 RGB array of a JPEG or PNG.

    The size is looked at before memory is taken for it. A JPEG that lost a part of its middle is
    a warning to most decoders, which shift the rest of the picture; to simplejpeg it is an error.
    OpenCV would fill what a truncated JPEG
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
            if encoded.startswith(_PNG) and encoded[_PNG_DEPTH] == 16:
                image.verify()  # Pillow would drop the lower 8 bits, OpenCV a damaged part
                return _deep_png(encoded, told)
            if image.mode not in _MODES:
                raise ImageError(
                    f'{told} has pixels of kind {image.mode}: publish 8 bits per colour'
                )
            if image.format == 'JPEG':
                return np.asarray(simplejpeg.decode_jpeg(encoded, 'RGB', strict=True))
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


def _deep_png(encoded: bytes, told: str) -> NDArray[np.uint8]:
    """Return the RGB array of a PNG with 16 bits per sample."""
    values = cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_UNCHANGED)
    if values is None or values.dtype != np.uint16:
        raise ImageError(f'{told} is damaged or truncated: check the link that carries it')
    values = eight_bits(np.atleast_3d(values))
    to_rgb = {1: cv2.COLOR_GRAY2RGB, 3: cv2.COLOR_BGR2RGB, 4: cv2.COLOR_BGRA2RGB}
    return np.asarray(cv2.cvtColor(values, to_rgb[values.shape[2]]), np.uint8)


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
