# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Value noise fixed to the ground in metres, so that resolution changes nothing but detail."""

from __future__ import annotations

from functools import lru_cache
from math import cos, floor, log2, pi, sin

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.simulation.drawing.window import DrawnWindow

FloatImage = NDArray[np.float32]

_LATTICE_SIZE = 1024


@lru_cache(maxsize=1)
def _lattice() -> FloatImage:
    rng = np.random.Generator(np.random.PCG64(20261122))
    points = rng.standard_normal((_LATTICE_SIZE, _LATTICE_SIZE), dtype=np.float32)
    # Interpolation between its points takes away variance, which the factor gives back.
    return np.asarray(points * np.float32(1.25), np.float32)


class Noise:
    """Octaves of smooth random ground texture over one window.

    Octave k has a wavelength of ``2**k`` metres, zero mean and about unit variance. Octaves finer
    than a pixel are left out, as a camera would average them away. The same seed gives the same
    ground at any resolution and in any window.
    """

    def __init__(self, window: DrawnWindow, seed: int) -> None:
        self._window = window
        self._seed = seed
        self._octaves: dict[tuple[int, int], FloatImage] = {}

    def octave(self, exponent: int, variant: int = 0) -> FloatImage:
        """Return octave ``2**exponent`` m, float32 height x width; another variant, other noise."""
        key = (exponent, variant)
        if key not in self._octaves:
            self._octaves[key] = self._draw(exponent, variant)
        return self._octaves[key]

    def band(
        self, finest_m: float, coarsest_m: float, slope: float = 0.5, variant: int = 0
    ) -> FloatImage:
        """Return the sum of the octaves between two wavelengths, about unit variance.

        Amplitude grows with wavelength to the power ``slope`` (natural scenes: near 1, that is a
        power spectrum near 1/f^2 over octaves).
        """
        low, high = round(log2(finest_m)), round(log2(coarsest_m))
        weights = {k: 2.0 ** (slope * k) for k in range(low, high + 1)}
        norm = sum(w * w for w in weights.values()) ** 0.5
        total = np.zeros(self._window.shape, np.float32)
        for k, weight in weights.items():
            fade = self._visibility(2.0**k)
            if fade > 0.0:
                cv2.scaleAdd(self.octave(k, variant), weight * fade / norm, total, total)
        return total

    def _visibility(self, wavelength_m: float) -> float:
        """Return how much of a wavelength pixels of this size still show."""
        return float(np.clip(1.5 * wavelength_m / self._window.gsd_m - 0.5, 0.0, 1.0))

    def _draw(self, exponent: int, variant: int) -> FloatImage:
        # Smooth octaves are drawn with larger pixels and enlarged: the eye sees no difference.
        w = self._window
        factor = int(np.clip(2.0**exponent / (3.0 * w.gsd_m), 1.0, 4.0))
        if factor == 1:
            return self._sampled(w, exponent, variant)
        coarse_gsd = w.gsd_m * factor
        rows, columns = -(-w.height_px // factor) + 2, -(-w.width_px // factor) + 2
        coarse = DrawnWindow(w.left_m - coarse_gsd, w.top_m - coarse_gsd, columns, rows, coarse_gsd)
        small = self._sampled(coarse, exponent, variant)
        large = cv2.resize(small, (columns * factor, rows * factor))
        return np.ascontiguousarray(
            large[factor : factor + w.height_px, factor : factor + w.width_px], np.float32
        )

    def _sampled(self, w: DrawnWindow, exponent: int, variant: int) -> FloatImage:
        wavelength = 2.0**exponent
        rng = np.random.Generator(np.random.PCG64([self._seed, exponent + 64, variant]))
        angle = rng.uniform(0.0, 2.0 * pi)
        shift = rng.integers(0, _LATTICE_SIZE, 2)
        c, s = cos(angle) / wavelength, sin(angle) / wavelength
        ends = np.array([[x, y] for x in (w.left_m, w.right_m) for y in (w.top_m, w.bottom_m)])
        grid = ends @ np.array([[c, s], [-s, c]])
        first = np.array([floor(v) - 2 for v in grid.min(0)])
        count = np.ceil(grid.max(0)).astype(int) + 3 - first
        columns = (np.arange(count[0]) + first[0] + shift[0]) % _LATTICE_SIZE
        rows = (np.arange(count[1]) + first[1] + shift[1]) % _LATTICE_SIZE
        patch = _lattice().take(rows, axis=0).take(columns, axis=1)
        g = w.gsd_m
        x, y = w.left_m + 0.5 * g, w.top_m + 0.5 * g
        to_patch = np.array(
            [
                [c * g, -s * g, c * x - s * y - first[0]],
                [s * g, c * g, s * x + c * y - first[1]],
            ]
        )
        flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
        size = (w.shape[1], w.shape[0])
        image = cv2.warpAffine(patch, to_patch, size, flags=flags, borderMode=cv2.BORDER_REFLECT)
        return np.asarray(image, np.float32)
