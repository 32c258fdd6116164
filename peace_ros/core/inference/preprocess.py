# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Camera image -> network input, in one pass into one buffer."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from peace_ros.core.domain import ImageError
from peace_ros.core.inference.manifest import InputSpec

MAX_PIXELS = 64_000_000
"""Larger images are refused: cameras do not take them, and they would stall everything else."""
_FILTERS = {
    'bilinear': Image.Resampling.BILINEAR,
    'bicubic': Image.Resampling.BICUBIC,
}


def normalisation(spec: InputSpec) -> tuple[NDArray[np.float32], ...]:
    """Return per channel (RGB) what each of the 256 levels becomes: (level / 255 - mean) / std.

    A table makes all three steps a single exact look-up.
    """
    levels = np.arange(256, dtype=np.float32) / np.float32(255.0)
    return tuple(
        ((levels - np.float32(mean)) / np.float32(std)).astype(np.float32)
        for mean, std in zip(spec.mean, spec.std, strict=True)
    )


def refuse_too_large(image_rgb: NDArray[np.uint8]) -> None:
    """Raise ImageError for a height x width x 3 image of more than MAX_PIXELS pixels."""
    height, width = image_rgb.shape[:2]
    if height * width > MAX_PIXELS:
        raise ImageError(
            f'image of {width} x {height} px: at most {MAX_PIXELS} px are taken; '
            'let the camera driver scale it down'
        )


class Preprocessor:
    """Resizes an RGB image and normalises it as the bundle's manifest says."""

    def __init__(self, spec: InputSpec) -> None:
        self._spec = spec
        self._buffer = np.zeros((1, 3, spec.height, spec.width), np.float32)
        self._tables = normalisation(spec)

    def __call__(self, image_rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Return float32 [1, 3, H, W]; the array is overwritten by the next call.

        Args:
            image_rgb: height x width x 3 uint8, not changed.

        Raises:
            ImageError: more than MAX_PIXELS pixels.
        """
        refuse_too_large(image_rgb)
        resized = self._resize(image_rgb)
        planes = cv2.split(np.ascontiguousarray(resized))
        for plane, table, target in zip(planes, self._tables, self._buffer[0], strict=True):
            cv2.LUT(plane, table, dst=target)
        return self._buffer

    def _resize(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        spec = self._spec
        if spec.interpolation != 'area':
            return self._resize_as_pillow(image)
        if spec.resize == 'crop':
            image = _centre(image, spec.width, spec.height)
        height, width = image.shape[:2]
        if (width, height) == (spec.width, spec.height):
            return image
        # Averaging keeps a shrunk image free of aliases; it cannot enlarge.
        shrinks = width >= spec.width and height >= spec.height
        method = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
        resized: NDArray[np.uint8] = cv2.resize(
            np.ascontiguousarray(image), (spec.width, spec.height), interpolation=method
        )
        return resized

    def _resize_as_pillow(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        spec = self._spec
        width, height = spec.width, spec.height
        if spec.resize == 'crop':
            # The reference scales the shorter side, drops the fraction of the longer, then crops.
            short, long = sorted(image.shape[:2])
            longer = max(int(width * long / short), width)
            height, width = (height, longer) if image.shape[0] <= image.shape[1] else (
                longer, width
            )  # fmt: skip
        scaled = Image.fromarray(image).resize((width, height), _FILTERS[spec.interpolation])
        resized = np.asarray(scaled)
        top, left = (height - spec.height) // 2, (width - spec.width) // 2
        return resized[top : top + spec.height, left : left + spec.width]


def _centre(image: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """Return the largest central part of the target's shape.

    Cropping before scaling gives the same view as scaling the shorter side first, for less work.
    """
    have_height, have_width = image.shape[:2]
    scale = min(have_width / width, have_height / height)
    part_width = max(1, min(have_width, round(width * scale)))
    part_height = max(1, min(have_height, round(height * scale)))
    left = (have_width - part_width) // 2
    top = (have_height - part_height) // 2
    return image[top : top + part_height, left : left + part_width]
