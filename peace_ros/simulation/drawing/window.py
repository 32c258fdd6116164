# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A rectangle of ground and the pixels that show it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_SHIFT_BITS = 5


@dataclass(frozen=True)
class DrawnWindow:
    """Pixels of ``gsd_m`` metres; x grows east (right), y grows south (down)."""

    left_m: float
    top_m: float
    width_px: int
    height_px: int
    gsd_m: float

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) in pixels."""
        return self.height_px, self.width_px

    @property
    def right_m(self) -> float:
        """East edge."""
        return self.left_m + self.width_px * self.gsd_m

    @property
    def bottom_m(self) -> float:
        """South edge."""
        return self.top_m + self.height_px * self.gsd_m

    def finer(self, factor: int) -> DrawnWindow:
        """Return the same ground with pixels ``factor`` times smaller."""
        return DrawnWindow(
            self.left_m,
            self.top_m,
            self.width_px * factor,
            self.height_px * factor,
            self.gsd_m / factor,
        )

    def grown(self, left_px: int, top_px: int, right_px: int, bottom_px: int) -> DrawnWindow:
        """Return a larger window with the same pixels."""
        return DrawnWindow(
            self.left_m - left_px * self.gsd_m,
            self.top_m - top_px * self.gsd_m,
            self.width_px + left_px + right_px,
            self.height_px + top_px + bottom_px,
            self.gsd_m,
        )

    def pixels(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (N, 2) columns and rows of points in metres; pixel centres are whole numbers."""
        return (points_m - (self.left_m, self.top_m)) / self.gsd_m - 0.5

    def fixed_point(self, points_m: NDArray[np.float64]) -> NDArray[np.int32]:
        """Return pixels as the fixed-point numbers of OpenCV's drawing functions."""
        scaled = np.rint(self.pixels(points_m) * (1 << _SHIFT_BITS))
        return np.clip(scaled, -(2**28), 2**28).astype(np.int32)

    @property
    def shift_bits(self) -> int:
        """Fraction bits of :meth:`fixed_point`."""
        return _SHIFT_BITS

    def sees(self, low_m: NDArray[np.float64], high_m: NDArray[np.float64]) -> bool:
        """Tell whether a box (x, y of its low and high corner) touches this window."""
        return bool(
            low_m[0] < self.right_m
            and high_m[0] > self.left_m
            and low_m[1] < self.bottom_m
            and high_m[1] > self.top_m
        )

    def sees_disc(self, x_m: float, y_m: float, radius_m: float) -> bool:
        """Tell whether a disc may touch this window."""
        return (
            self.left_m - radius_m < x_m < self.right_m + radius_m
            and self.top_m - radius_m < y_m < self.bottom_m + radius_m
        )
