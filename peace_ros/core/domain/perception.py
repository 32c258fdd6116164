# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the camera and the networks produce: Frame, Camera, Prompt, Heatmap."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi, radians, tan

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain.errors import ConfigurationError, ImageError


@dataclass(frozen=True)
class Camera:
    """Pinhole camera fixed to the vehicle, looking along body-down (nadir).

    The top of the image points to the nose of the vehicle, its right side to the right wing.
    """

    width_px: int
    height_px: int
    fov_x_rad: float
    """Full horizontal field of view, 0 < fov < pi; pixels are square."""

    def __post_init__(self) -> None:
        if self.width_px < 1 or self.height_px < 1:
            raise ConfigurationError(
                f'camera size {self.width_px} x {self.height_px} px: both must be 1 or more'
            )
        if not 0.0 < self.fov_x_rad < pi:
            raise ConfigurationError(
                f'camera field of view {self.fov_x_rad:.3f} rad must lie between 0 and pi'
            )

    @classmethod
    def from_degrees(cls, width_px: int, height_px: int, fov_x_deg: float) -> Camera:
        """Build from the full horizontal field of view in degrees (DOVESEI: 73)."""
        return cls(width_px, height_px, radians(fov_x_deg))

    @property
    def focal_px(self) -> float:
        """Focal length in pixels, the same along both axes."""
        return self.width_px / (2.0 * tan(self.fov_x_rad / 2.0))

    @property
    def centre_px(self) -> tuple[float, float]:
        """Principal point (u, v), pixel centres at whole numbers."""
        return (self.width_px - 1) / 2.0, (self.height_px - 1) / 2.0

    def resized(self, width_px: int, height_px: int) -> Camera:
        """Return the camera whose image is this one's, scaled (e.g. to a heatmap)."""
        return Camera(width_px, height_px, self.fov_x_rad)


@dataclass(frozen=True)
class Frame:
    """One camera image."""

    image_rgb: NDArray[np.uint8]
    """Height x width x 3, RGB."""
    stamp_ns: int
    """When the camera took it, node clock; it survives to the set-point."""

    def __post_init__(self) -> None:
        image = self.image_rgb
        if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or image.size == 0:
            raise ImageError(
                f'image of shape {image.shape}, {image.dtype}: give a non-empty '
                'height x width x 3 uint8 RGB array'
            )


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
