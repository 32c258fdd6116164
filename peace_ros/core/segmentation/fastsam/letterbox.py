# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The whole frame in the network's input, its shape kept, borders around it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.inference.manifest import InputSpec
from peace_ros.core.inference.preprocess import normalisation, refuse_too_large

BORDER_LEVEL = 114
"""Grey of the borders that the YOLO family is trained with."""


@dataclass(frozen=True)
class Placement:
    """Where the frame lies in the network's input, in pixels of that input."""

    left_px: int
    top_px: int
    width_px: int
    height_px: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns of the frame."""
        return (
            slice(self.top_px, self.top_px + self.height_px),
            slice(self.left_px, self.left_px + self.width_px),
        )


def fitted(width_px: int, height_px: int, spec: InputSpec) -> Placement:
    """Return where a picture of this size goes in an input: as large as fits, in the middle."""
    scale = min(spec.width / width_px, spec.height / height_px)
    width = max(1, min(spec.width, round(width_px * scale)))
    height = max(1, min(spec.height, round(height_px * scale)))
    return Placement((spec.width - width) // 2, (spec.height - height) // 2, width, height)


class Letterbox:
    """Scales a frame into the network's input as the YOLO family does it."""

    def __init__(self, spec: InputSpec) -> None:
        self._spec = spec
        self._tables = normalisation(spec)
        self._buffer = np.zeros((1, 3, spec.height, spec.width), np.float32)

    def __call__(self, image_rgb: NDArray[np.uint8]) -> tuple[NDArray[np.float32], Placement]:
        """Return float32 [1, 3, H, W], overwritten by the next call, and the frame's place in it.

        Args:
            image_rgb: height x width x 3 uint8, not changed.

        Raises:
            ImageError: more than MAX_PIXELS pixels.
        """
        height, width = image_rgb.shape[:2]
        refuse_too_large(image_rgb)
        place = fitted(width, height, self._spec)
        scaled = image_rgb
        if (width, height) != (place.width_px, place.height_px):
            # Bilinear whatever the scale: so the reference scales, and so its weights were trained.
            scaled = np.asarray(
                cv2.resize(
                    np.ascontiguousarray(image_rgb),
                    (place.width_px, place.height_px),
                    interpolation=cv2.INTER_LINEAR,
                ),
                np.uint8,
            )
        for channel, table in enumerate(self._tables):
            self._buffer[0, channel] = table[BORDER_LEVEL]
            self._buffer[0, channel][place.slices] = table[scaled[:, :, channel]]
        return self._buffer, place
