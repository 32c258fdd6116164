# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Does the velocity over ground change as the vehicle was accelerated? If not, the ground moves.

Pictures show motion against the ground. Where all of the ground in view moves (waves, grass in the
downwash), nothing in the pictures differs from a vehicle that moves. Accelerometers differ: a
vehicle that begins to move was accelerated.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

_PULL_RAD_S = 0.25
"""Natural frequency of the observer: an error of the acceleration that changes in less than about
4 s is not learned."""
_LEARNED_M_S2 = 0.5
"""Largest horizontal error of the acceleration that is learned: 3 degrees of tilt."""
_AGREES_AGAIN = 0.8
"""Of the limit, below which a doubt ends."""
_DRIFT_M_S2 = 0.15
"""Error of the acceleration: after a time without pictures the limit is wider."""
_KEPT = 64
"""Moments whose velocity is remembered: 3 s at 20 Hz."""


class AccelerationCheck:
    """Carries the velocity forward by accelerations, and compares that of the pictures with it.

    An observer with critical damping learns a constant error of the acceleration. It learns
    nothing while it doubts, so that ground that moves is not accepted after a while.

    Args:
        limit_m_s: A velocity that differs by more is doubted.
    """

    def __init__(self, limit_m_s: float) -> None:
        self._limit_m_s = limit_m_s
        self._carried: deque[tuple[int, Vector]] = deque([(0, np.zeros(2))], _KEPT)
        self._error_m_s2 = np.zeros(2)
        self._agreed_ns = 0
        self.doubts = False
        """The newest velocity by pictures was not as accelerations say."""
        self.off_m_s = 0.0
        """By how much it differed."""

    def begin(self, stamp_ns: int, velocity_m_s: Vector) -> None:
        """Begin with a known velocity (3,); its horizontal part counts."""
        self._carried.clear()
        self._carried.append((stamp_ns, velocity_m_s[:2].copy()))
        self._error_m_s2 = np.zeros(2)
        self._agreed_ns = stamp_ns
        self.doubts = False
        self.off_m_s = 0.0

    def accelerate(self, stamp_ns: int, change_m_s: Vector) -> None:
        """Take the change of the velocity (3,) up to a stamp, by accelerometers."""
        before_ns, velocity = self._carried[-1]
        span_s = (stamp_ns - before_ns) * 1e-9
        self._carried.append((stamp_ns, velocity + change_m_s[:2] - span_s * self._error_m_s2))

    def compare(self, stamp_ns: int, velocity_m_s: Vector) -> bool:
        """Compare the velocity by pictures (3,) of a stamp; return whether it is doubted."""
        stamps_ns = [stamp for stamp, _ in self._carried]
        ages_s = (np.array(stamps_ns, np.int64) - stamp_ns) * 1e-9
        carried = np.array([velocity for _, velocity in self._carried]).T
        off = velocity_m_s[:2] - [np.interp(0.0, ages_s, each) for each in carried]
        self.off_m_s = float(np.hypot(*off))
        span_s = (stamps_ns[-1] - self._agreed_ns) * 1e-9
        limit = self._limit_m_s
        limit = limit * _AGREES_AGAIN if self.doubts else limit + _DRIFT_M_S2 * span_s
        self.doubts = self.off_m_s > limit
        if not self.doubts:
            pull = min(1.0, 2.0 * _PULL_RAD_S * span_s) * off
            self._carried = deque(((stamp, each + pull) for stamp, each in self._carried), _KEPT)
            learned = self._error_m_s2 - _PULL_RAD_S**2 * min(1.0, span_s) * off
            self._error_m_s2 = np.clip(learned, -_LEARNED_M_S2, _LEARNED_M_S2)
            self._agreed_ns = stamps_ns[-1]
        return self.doubts
