# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Velocity as the slope of the positions of the last moments."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_FEWEST = 3
_LEAST_SPAN = 0.6
"""Of the window."""
_JITTER_S = 0.02
"""Frames do not come exactly on time."""


@dataclass(frozen=True)
class Velocity:
    """Mean velocity over a window, which is that of its middle."""

    stamp_ns: int
    mean_m_s: NDArray[np.float64]
    """(3,): north, east, down."""
    variance_m2_s2: NDArray[np.float64]
    """(3,)."""


class PositionTrack:
    """Positions of the last moments, against one key frame or several that join."""

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._fixes: deque[tuple[int, NDArray[np.float64], NDArray[np.float64]]] = deque()

    def clear(self) -> None:
        """Forget the positions: the next one does not continue them."""
        self._fixes.clear()

    def add(
        self, stamp_ns: int, position_m: NDArray[np.float64], variance_m2: NDArray[np.float64]
    ) -> None:
        """Keep a position (3,) with the variances of its error that others do not share."""
        self._fixes.append((stamp_ns, position_m, variance_m2))
        oldest_ns = stamp_ns - round((self._window_s + _JITTER_S) * 1e9)
        while self._fixes[0][0] < oldest_ns:
            self._fixes.popleft()

    def velocity(self) -> Velocity | None:
        """Return the slope by least squares; None when positions are too few or too near."""
        if len(self._fixes) < _FEWEST:
            return None
        stamps = np.array([stamp for stamp, _, _ in self._fixes], np.int64)
        times_s = (stamps - stamps[0]) * 1e-9
        if times_s[-1] < _LEAST_SPAN * self._window_s:
            return None
        middle_s = float(times_s.mean())
        off_s = times_s - middle_s
        spread = float(off_s @ off_s)
        positions = np.array([position for _, position, _ in self._fixes])
        variances = np.array([variance for _, _, variance in self._fixes])
        return Velocity(
            int(stamps[0]) + round(middle_s * 1e9),
            off_s @ positions / spread,
            off_s**2 @ variances / spread**2,
        )
