# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What gyroscopes and accelerometers measured between two moments, summed up in one step.

The sum is taken in the axes of the vehicle at the first moment, so that it does not depend on its
attitude (preintegration: Forster et al., 2017).
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import InertialSample
from peace_ros.core.domain.camera import Quaternion
from peace_ros.core.domain.geometry import (
    multiply,
    quaternion_from_rotation_vector,
    rotation_matrix,
)

_KEPT_NS = 10_000_000_000
_PRUNED = 500
"""So many samples are forgotten at once."""
_FASTEST_RAD_S = 35.0
"""Gyroscopes of autopilots measure up to 2000 deg/s."""
_STRONGEST_M_S2 = 160.0
"""Their accelerometers measure up to 16 g."""
_LONGEST_GAP_NS = 100_000_000
"""Between samples farther apart the rates are not known."""


@dataclass(frozen=True)
class InertialMotion:
    """What a vehicle did between two moments."""

    turn: Quaternion
    """Rotates vectors of the axes at the end into those at the start."""
    velocity_m_s: NDArray[np.float64]
    """(3,) Change of the velocity without gravity, in the axes at the start."""
    rates_rad_s: NDArray[np.float64]
    """(3,) Angular velocity at the end."""


class InertialHistory:
    """The samples of the last ten seconds."""

    def __init__(self) -> None:
        self._stamps_ns: list[int] = []
        self._measured: list[NDArray[np.float64]] = []

    def add(self, sample: InertialSample) -> bool:
        """Keep a sample; False when it is not newer than the last one, or cannot be measured."""
        rates, force = np.array(sample.rates_rad_s), np.array(sample.specific_force_m_s2)
        # A comparison with NaN is false, so values that are not numbers are rejected too.
        possible = (abs(rates) <= _FASTEST_RAD_S).all() and (abs(force) <= _STRONGEST_M_S2).all()
        if not possible or (self._stamps_ns and sample.stamp_ns <= self._stamps_ns[-1]):
            return False
        self._stamps_ns.append(sample.stamp_ns)
        self._measured.append(np.concatenate((rates, force)))
        beyond = min(_PRUNED, len(self._stamps_ns) - 1)
        if self._stamps_ns[beyond] < sample.stamp_ns - _KEPT_NS:
            del self._stamps_ns[:beyond], self._measured[:beyond]
        return True

    def between(self, from_ns: int, to_ns: int) -> InertialMotion | None:
        """Return the motion between two stamps; None when samples do not cover it without a gap."""
        first = bisect_right(self._stamps_ns, from_ns) - 1
        last = bisect_left(self._stamps_ns, to_ns)
        if first < 0 or last == len(self._stamps_ns):
            return None
        stamps = np.array(self._stamps_ns[first : last + 1], np.int64)
        if np.diff(stamps).max() > _LONGEST_GAP_NS:
            return None
        measured = np.array(self._measured[first : last + 1])
        times_s = (stamps - from_ns) * 1e-9
        ends_s = np.array([0.0, *times_s[1:-1], (to_ns - from_ns) * 1e-9])
        at_ends = np.stack([np.interp(ends_s, times_s, each) for each in measured.T], axis=1)
        turn, velocity = (1.0, 0.0, 0.0, 0.0), np.zeros(3)
        for step_s, mean in zip(np.diff(ends_s), 0.5 * (at_ends[1:] + at_ends[:-1]), strict=True):
            half = quaternion_from_rotation_vector(0.5 * step_s * mean[:3])
            middle = multiply(turn, half)
            velocity += step_s * (rotation_matrix(middle) @ mean[3:])
            turn = multiply(middle, half)
        return InertialMotion(turn, velocity, at_ends[-1, :3])
