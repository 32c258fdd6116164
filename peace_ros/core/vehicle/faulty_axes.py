# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Is the position a faulty one? Follow what was told under each explanation, and compare. Pure.

An autopilot flies by its estimate of the velocity, which is biased (measured on PX4: 0.13 to
0.33 m/s), so "told to move and did not" proves nothing by itself. Each explanation (the position is
right, its axes are swapped, mirrored, turned, it stands still) predicts the next report from what
was told and from a bias that it learns. The evidence for a fault is the log likelihood by which it
predicts better, summed since it last predicted worse (CUSUM, Page 1954).
"""

from __future__ import annotations

from collections import deque
from math import exp, hypot

import numpy as np
from numpy.typing import NDArray

Plane = tuple[float, float]
"""North, east."""
PERIOD_S = 0.1
"""Reports are compared this often."""
BIAS_M_S = 0.5
"""Standard deviation of the bias: twice the measured one,"""
BIAS_TIME_S = 15.0
"""and how long it stays alike."""
NOISE_M2_S = 0.06
"""Growth of the variance of reported ways by the noise of the position and gusts."""
QUICK_S = 0.5
"""A vehicle leans before it moves. A quick one follows with this time constant,"""
SLOW_S, SLOW_M_S2 = 0.7, 3.0
"""a slow one with this, and with no more than this acceleration (measured: ArduCopter 4.7)."""
UNSETTLED_S = 1.0
"""While they differ, little is concluded: half of the difference is an error for so long."""
EVIDENCE = 18.0
"""Enough of it; a right position rarely reaches 10 with errors of twice the measured size."""
EVIDENCE_PER_S = 30.0
"""A gust may not convince at once,"""
RECENT = 16
"""nor without a way over so many periods"""
RECENT_M = 1.2
"""that is so long at least, by what was told,"""
COMPARABLE = 0.5
"""and of which the position shows this part where the fault says (a gust pushes less far)."""
DRIFT_LIMIT_M_S = 2.0
"""A larger bias than this is none (six times the largest measured),"""
DRIFT_M = 3.0
"""when over this way the position runs away from what was told."""
EXPLANATIONS: dict[str, tuple[Plane, Plane]] = {
    '': ((1.0, 0.0), (0.0, 1.0)),
    'north and east are swapped': ((0.0, 1.0), (1.0, 0.0)),
    'north and east are mirrored': ((-1.0, 0.0), (0.0, -1.0)),
    'north is mirrored': ((-1.0, 0.0), (0.0, 1.0)),
    'east is mirrored': ((1.0, 0.0), (0.0, -1.0)),
    'it is turned by 90 degrees': ((0.0, -1.0), (1.0, 0.0)),
    'it is turned by -90 degrees': ((0.0, 1.0), (-1.0, 0.0)),
    'north and east are swapped and mirrored': ((0.0, -1.0), (-1.0, 0.0)),
    'it stands still': ((0.0, 0.0), (0.0, 0.0)),
}
"""Fault -> reported velocity (rows: north, east) of the told one. The first is no fault."""
_GAINS = np.array(list(EXPLANATIONS.values()))
_NAMES = tuple(EXPLANATIONS)
STILL_M = 0.01
"""A position that stays within this while the vehicle is told to go STILL_WAY_M is frozen: every
real one has noise."""
STILL_NOISY_M = 0.6
STILL_BIAS_M_S = 2.2
"""So much may be noise, where the way that remains after such a bias is as long."""
STILL_WAY_M = 1.0
LEAST_PART = 0.2
"""A vehicle that shows this part of the way that it was told moves there, only slower."""


class _ExpectedMotion:
    """How fast a vehicle probably goes that follows what it is told."""

    def __init__(self) -> None:
        self._quick, self._limited, self.slow_m_s = np.zeros(2), np.zeros(2), np.zeros(2)

    @property
    def velocity_m_s(self) -> NDArray[np.float64]:
        """North, east."""
        return (self._quick + self.slow_m_s) / 2.0

    def step(self, told_m_s: NDArray[np.float64], seconds: float) -> float:
        """Follow for a time; return by how much the variance of the way grows, per second."""
        self._quick = self._quick + (told_m_s - self._quick) * (1.0 - exp(-seconds / QUICK_S))
        change = told_m_s - self._limited
        size = float(np.hypot(*change))
        share = min(1.0, SLOW_M_S2 * seconds / size) if size > 0.0 else 1.0
        self._limited = self._limited + share * change
        self.slow_m_s = self.slow_m_s + (self._limited - self.slow_m_s) * (
            1.0 - exp(-seconds / SLOW_S)
        )
        half = (self._quick - self.slow_m_s) / 2.0
        return UNSETTLED_S * float(half @ half)


class _Still:
    """How far the vehicle should have gone since the position last left a small square."""

    def __init__(self, half_m: float) -> None:
        self._half_m = half_m
        self._at_m: NDArray[np.float64] | None = None
        self.way_m = 0.0

    def see(self, seen_m: NDArray[np.float64], way_m: float) -> None:
        if self._at_m is None or float(np.abs(seen_m - self._at_m).max()) > self._half_m:
            self._at_m, self.way_m = seen_m, 0.0
        else:
            self.way_m += way_m


class AxesWatch:
    """Looks at reported ways over ground for axes that are not north and east."""

    def __init__(self) -> None:
        self._model = _ExpectedMotion()
        self.restart()

    def restart(self) -> None:
        """Forget all evidence, and what the bias was; what was told last is kept."""
        self._bias = np.zeros((len(_GAINS), 2))
        self._bias_variance = BIAS_M_S**2
        self._evidence = np.zeros(len(_GAINS))
        self._drift_m = 0.0
        self._recent: deque[tuple[NDArray[np.float64], NDArray[np.float64]]] = deque(maxlen=RECENT)
        self._last_m: NDArray[np.float64] | None = None
        self._still = (_Still(STILL_M), _Still(STILL_NOISY_M))
        self._begin_period()

    def _begin_period(self) -> None:
        self._seconds = self._gap_m2 = 0.0
        self._way_m = np.zeros(2)

    def take(self, seen_m: Plane, told_m_s: Plane, seconds: float) -> str:
        """Look at a report.

        Args:
            seen_m: Reported position.
            told_m_s: Velocity that the vehicle was told to fly since the last report.
            seconds: Since the last report.

        Returns:
            Why the position is not believed, empty when it is.
        """
        seen = np.array(seen_m)
        gap = self._model.step(np.array(told_m_s), seconds)
        moved = self._model.velocity_m_s * seconds
        self._way_m += moved
        self._seconds += seconds
        self._gap_m2 += gap * seconds
        problem = self._stands_still(seen, seconds)
        if self._last_m is None:
            self._last_m = seen
            self._begin_period()
        elif self._seconds >= PERIOD_S:
            problem = problem or self._compare(seen - self._last_m)
            self._last_m = seen
            self._begin_period()
        return problem

    def _stands_still(self, seen: NDArray[np.float64], seconds: float) -> str:
        """Return why the position is frozen: exactly, or but for noise, against any bias."""
        exact, noisy = self._still
        slow_m_s = float(np.hypot(*self._model.slow_m_s))
        exact.see(seen, slow_m_s * seconds)
        noisy.see(seen, max(0.0, slow_m_s - STILL_BIAS_M_S) * seconds)
        if max(exact.way_m, noisy.way_m) < STILL_WAY_M:
            return ''
        return (
            'the vehicle was told to go sideways by a metre or more and its position stands still'
        )

    def _compare(self, seen_m: NDArray[np.float64]) -> str:
        """Let each explanation predict the way of this period, and learn its bias."""
        seconds = self._seconds
        self._recent.append((self._way_m, seen_m))
        keep = exp(-seconds / BIAS_TIME_S)
        before = self._bias_variance
        self._bias_variance = keep * keep * before + (1.0 - keep * keep) * BIAS_M_S**2
        variance = seconds * seconds * self._bias_variance + NOISE_M2_S * seconds + self._gap_m2
        error_m = seen_m - _GAINS @ self._way_m - keep * self._bias * seconds
        gain = self._bias_variance * seconds / variance
        self._bias = keep * self._bias + gain * error_m
        self._bias[-1] = 0.0  # what stands still has none
        self._bias_variance *= 1.0 - gain * seconds
        square = (error_m * error_m).sum(axis=1)
        better = (square[0] - square) / (2.0 * variance)
        limit = EVIDENCE_PER_S * seconds
        self._evidence += np.clip(better, -limit, limit)
        right = self._evidence <= 0.0
        self._evidence[right] = 0.0
        self._bias[right] = _GAINS[right] @ self._bias[0]
        return self._verdict(seconds)

    def _verdict(self, seconds: float) -> str:
        told = self._model.velocity_m_s
        seen = told + self._bias[0]
        worst = int(self._evidence.argmax())
        shows = float(told @ seen) >= LEAST_PART * float(told @ told)
        if self._evidence[worst] >= EVIDENCE and self._shows_fault(worst):
            return f'the position does not follow what was told sideways: {_NAMES[worst]}'
        drift = hypot(*self._bias[0])
        if drift <= DRIFT_LIMIT_M_S or shows:
            self._drift_m = 0.0
            return ''
        self._drift_m += drift * seconds
        if self._drift_m < DRIFT_M:
            return ''
        return (
            f'the position runs away sideways from what was told, at {drift:.1f} m/s (limit '
            f'{DRIFT_LIMIT_M_S:g} m/s)'
        )

    def _shows_fault(self, fault: int) -> bool:
        """Tell whether the last way was long, and comparably far where the fault says."""
        told_m = sum((told for told, _ in self._recent), np.zeros(2))
        seen_m = sum((seen for _, seen in self._recent), np.zeros(2))
        square = float(told_m @ told_m)
        if square < RECENT_M**2:
            return False
        if not _GAINS[fault].any():
            # A bias may stop a vehicle that is slow.
            return (
                square >= (2.0 * RECENT_M) ** 2
                and float(seen_m @ seen_m) <= (1.0 - COMPARABLE) ** 2 * square
            )
        return float(seen_m @ (_GAINS[fault] @ told_m)) >= COMPARABLE * square
