# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One sun per scene: the light on slopes and crowns, and the shadows that heights cast."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin, tan
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.simulation.drawing.noise import FloatImage


@dataclass(frozen=True)
class Sun:
    """Direction to the sun in the plane of the image, elevation, and how clear the sky is."""

    azimuth_rad: float
    """Of the direction towards the sun, from image right to image down."""
    elevation_rad: float
    clearness: float
    """1: hard shadows; 0: overcast, none."""

    @classmethod
    def draw(cls, rng: np.random.Generator, season: str) -> Sun:
        """Return a sun for a season."""
        low, high = {'winter': (16.0, 34.0), 'summer': (38.0, 66.0)}.get(season, (26.0, 52.0))
        overcast = rng.random() < 0.18
        clearness = rng.uniform(0.0, 0.25) if overcast else rng.uniform(0.75, 1.0)
        return cls(
            float(rng.uniform(0.0, 2.0 * np.pi)), radians(rng.uniform(low, high)), float(clearness)
        )

    def facing(self, nx: NDArray[np.floating[Any]], ny: NDArray[np.floating[Any]]) -> FloatImage:
        """Return the light on faces with normals (nx, ny, 1), level ground being 1."""
        direct = cos(self.elevation_rad) * (
            nx * cos(self.azimuth_rad) + ny * sin(self.azimuth_rad)
        ) + sin(self.elevation_rad)
        direct = np.clip(direct / np.sqrt(nx * nx + ny * ny + 1.0), 0.0, None)
        share = 0.62 * self.clearness
        lit = np.minimum(direct / sin(self.elevation_rad), 2.0)
        return np.asarray((1.0 - share) + share * lit, np.float32)

    def shadow(self, height_m: FloatImage, gsd_m: float) -> FloatImage:
        """Return how much of the sun other things hide from each pixel, 0 to 1.

        The running maximum of heights along the ray to the sun is found by doubling: after step k
        it covers ``2**k`` pixels of ray, lowered by the slope of the ray.
        """
        fall = tan(self.elevation_rad) * gsd_m
        tallest = float(height_m.max())
        if tallest < 0.05:
            return np.zeros_like(height_m)
        steps = max(1, int(np.ceil(np.log2(tallest / fall + 1.0))))
        dx, dy = cos(self.azimuth_rad), sin(self.azimuth_rad)
        blocking = _seen_from(height_m, dx, dy) - np.float32(fall)
        for k in range(steps):
            reach = 2**k
            farther = _seen_from(blocking, dx * reach, dy * reach) - np.float32(reach * fall)
            np.maximum(blocking, farther, out=blocking)
        hidden = np.clip((blocking - height_m - 0.08) * (1.0 / 0.25), 0.0, 1.0)
        return np.asarray(cv2.GaussianBlur(hidden, (3, 3), 0.7), np.float32)


def _seen_from(image: FloatImage, columns: float, rows: float) -> FloatImage:
    """Return the image at (x + columns, y + rows); outside there is nothing."""
    dx, dy = round(columns), round(rows)
    height, width = image.shape
    moved = np.full_like(image, -1e3)
    if abs(dx) < width and abs(dy) < height:
        moved[max(0, -dy) : height - max(0, dy), max(0, -dx) : width - max(0, dx)] = image[
            max(0, dy) : height - max(0, -dy), max(0, dx) : width - max(0, -dx)
        ]
    return moved
