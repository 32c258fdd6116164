# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Figures and their intervals: pixels of one frame are alike, so whole frames are drawn again."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

REPLICATES = 1000
LEVEL = 0.95
_CHUNK = 256


class Bootstrap:
    """Draws frames with replacement; the same seed and number of frames draw the same ones."""

    def __init__(self, frames: int, replicates: int = REPLICATES, seed: int = 0) -> None:
        rng = np.random.Generator(np.random.PCG64([seed, frames]))
        chances = np.full(max(1, frames), 1.0 / max(1, frames))
        self._weights = rng.multinomial(frames, chances, size=replicates).astype(np.float64)
        self._frames = frames

    def sums(self, per_frame: NDArray[np.generic]) -> NDArray[np.float64]:
        """Return [replicates, ...] sums over drawn frames of [frames, ...]."""
        flat = per_frame.reshape(len(per_frame), -1)
        out = np.zeros((len(self._weights), flat.shape[1]))
        for start in range(0, len(flat), _CHUNK):
            part = slice(start, start + _CHUNK)
            out += self._weights[:, part] @ flat[part].astype(np.float64)
        return out.reshape(len(self._weights), *per_frame.shape[1:])

    def interval(self, values: NDArray[np.float64]) -> list[float] | None:
        """Return the limits of the middle LEVEL of [replicates]; None for fewer than two frames.

        Draws without a value (a rate of nothing) are left out.
        """
        values = values[np.isfinite(values)]
        if self._frames < 2 or not values.size:
            return None
        tail = (1.0 - LEVEL) / 2.0
        return [rounded(each) for each in np.quantile(values, [tail, 1.0 - tail])]


def rounded(value: float | np.floating[Any] | NDArray[np.float64]) -> float:
    """Return a figure as it is written."""
    return round(float(value), 5)


def known(value: float | np.floating[Any] | NDArray[np.float64]) -> float | None:
    """Return a figure as it is written, None when it is not a number."""
    return rounded(value) if np.isfinite(value) else None
