# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pillow's resize, to the bit: the models learned from images that it had scaled.

Pillow weighs each output pixel over all input pixels beneath it, first along rows, then along
columns, with weights of 22 binary digits, and rounds to 8 bits after each pass. The same whole
numbers are summed here tap by tap: a matrix product would do too, but wakes threads that fight
with those of the networks.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

_DIGITS = 22
_HALF = 1 << (_DIGITS - 1)
"""Added before the shift: halves are rounded up."""
_BLOCK = 256
"""Numbers of a row that are summed at once: what they need of a frame stays in the cache."""


def _triangle(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.maximum(0.0, 1.0 - np.abs(x))


def _cubic(x: NDArray[np.float64]) -> NDArray[np.float64]:
    a = -0.5
    x = np.abs(x)
    near = ((a + 2.0) * x - (a + 3.0)) * x * x + 1.0
    far = (((x - 5.0) * x + 8.0) * x - 4.0) * a
    return np.where(x < 1.0, near, np.where(x < 2.0, far, 0.0))


_FILTERS: dict[str, tuple[Callable[[NDArray[np.float64]], NDArray[np.float64]], float]] = {
    'bilinear': (_triangle, 1.0),
    'bicubic': (_cubic, 2.0),
}


@dataclass(frozen=True)
class _Taps:
    """What each output pixel takes from the input, tap by tap."""

    positions: NDArray[np.intp]
    """[taps, outputs], index of an input pixel."""
    weights: NDArray[np.int32]
    """[taps, outputs, 1], in units of 2**-22; together 1 for each output, but for rounding."""


def resize(
    image: NDArray[np.uint8], width: int, height: int, interpolation: str
) -> NDArray[np.uint8]:
    """Return an image H x W x 3 scaled to height x width x 3, as Pillow's ``Image.resize`` does.

    Args:
        image: uint8.
        width: of the result, pixels.
        height: of the result, pixels.
        interpolation: ``bilinear`` or ``bicubic``, both antialiased.
    """
    turned = image
    if image.shape[1] != width:
        columns = cv2.transpose(np.ascontiguousarray(image))
        turned = cv2.transpose(_along(columns, width, interpolation))
    return _along(turned, height, interpolation)


def _along(image: NDArray[np.uint8], rows: int, interpolation: str) -> NDArray[np.uint8]:
    """Return an image of so many rows."""
    if image.shape[0] == rows:
        return image
    taps = _taps(image.shape[0], rows, interpolation)
    flat = image.reshape(image.shape[0], -1)
    result = np.empty((rows, flat.shape[1]), np.uint8)
    for start in range(0, flat.shape[1], _BLOCK):
        part = flat[:, start : start + _BLOCK].astype(np.int32)
        sums = np.full((rows, part.shape[1]), _HALF, np.int32)
        product = np.empty_like(sums)
        for positions, weights in zip(taps.positions, taps.weights, strict=True):
            np.take(part, positions, axis=0, out=product, mode='clip')
            product *= weights
            sums += product
        sums >>= _DIGITS
        result[:, start : start + _BLOCK] = np.clip(sums, 0, 255, out=sums)
    return result.reshape(rows, *image.shape[1:])


@lru_cache(maxsize=32)
def _taps(size: int, target: int, interpolation: str) -> _Taps:
    kernel, radius = _FILTERS[interpolation]
    scale = size / target
    stretch = max(scale, 1.0)
    support = radius * stretch
    centres = (np.arange(target) + 0.5) * scale
    first = np.maximum((centres - support + 0.5).astype(np.int64), 0)
    last = np.minimum((centres + support + 0.5).astype(np.int64), size)
    positions = first[:, None] + np.arange(int((last - first).max()))
    weights = kernel((positions - centres[:, None] + 0.5) * (1.0 / stretch))
    weights = np.where(positions < last[:, None], weights, 0.0)
    weights /= _sum_in_order(weights)
    scaled = weights * (1 << _DIGITS)
    whole = np.trunc(scaled + np.where(scaled < 0.0, -0.5, 0.5)).astype(np.int32)
    return _Taps(
        np.ascontiguousarray(np.minimum(positions, size - 1).T.astype(np.intp)),
        np.ascontiguousarray(whole.T[:, :, None]),
    )


def _sum_in_order(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rows' sums, added from left to right as Pillow adds them."""
    total: NDArray[np.float64] = np.cumsum(weights, axis=1)[:, -1:]
    return total
