# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the camera and the networks produce: Frame, Prompt, Heatmap."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain.camera import Camera
from peace_ros.core.domain.errors import ConfigurationError, ImageError


@dataclass(frozen=True)
class Frame:
    """One camera image."""

    image_rgb: NDArray[np.uint8]
    """Height x width x 3, RGB."""
    stamp_ns: int
    """When the camera took it, node clock; it survives to the set-point."""
    camera: Camera | None = None
    """What took it, of the size of the image; None where no calibration came with it."""

    def __post_init__(self) -> None:
        image = self.image_rgb
        if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or image.size == 0:
            raise ImageError(
                f'image of shape {image.shape}, {image.dtype}: give a non-empty '
                'height x width x 3 uint8 RGB array'
            )

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the image."""
        return self.image_rgb.shape[1], self.image_rgb.shape[0]


@dataclass(frozen=True)
class RankedWord:
    """A vocabulary word with its score for one frame."""

    word: str
    score: float
    """Cosine similarity of the word's and the frame's CLIP embeddings, -1 to 1."""


@dataclass(frozen=True)
class Prompt:
    """A prompt template in which only ``{term}`` is still open, with how it came about."""

    template: str
    """E.g. ``A rendered image of {term} in spring.``"""
    stamp_ns: int
    """Stamp of the frame that it was made from."""
    ranking: dict[str, tuple[RankedWord, ...]] = field(default_factory=dict)
    """Category -> its words, best first; empty for static templates."""

    def __post_init__(self) -> None:
        if '{term}' not in self.template:
            raise ConfigurationError(
                f'prompt template {self.template!r} lacks {{term}}: every term would read the same'
            )

    def text_for(self, term: str) -> str:
        """Return the full sentence for one term."""
        return self.template.replace('{term}', term)


@dataclass(frozen=True)
class Heatmap:
    """How surely each pixel is a place where landing hurts nobody: Sf of the paper."""

    safety: NDArray[np.float32]
    """Height x width at network resolution, 0 (unsafe) to 1 (surely safe); covers the frame."""
    stamp_ns: int
    """Stamp of the frame."""
    frame_size_px: tuple[int, int] | None = None
    """Width and height of the frame; None where it is not known."""
    camera: Camera | None = None
    """What took the frame, of the size of the frame; None where it is not calibrated."""

    def __post_init__(self) -> None:
        _check_map('heatmap', self.safety)


@dataclass(frozen=True)
class DepthImage:
    """How far what each pixel shows lies along the axis of the camera."""

    depth_m: NDArray[np.float32]
    """Height x width; covers the frame. 0, NaN and infinity: nothing was measured."""
    stamp_ns: int
    """When the sensor took it, node clock."""

    def __post_init__(self) -> None:
        _check_map('depth image', self.depth_m)


def _check_map(kind: str, values: NDArray[np.float32]) -> None:
    if values.ndim != 2 or values.dtype != np.float32 or values.size == 0:
        raise ImageError(
            f'{kind} of shape {values.shape}, {values.dtype}: give height x width float32'
        )
