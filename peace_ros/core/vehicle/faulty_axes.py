# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Are position and velocity those of the vehicle? Compare them with each other and the told. Pure.

An autopilot flies by its estimate of the velocity, which is biased (measured on PX4: 0.13 to
0.33 m/s), so "told to move and did not" proves nothing by itself. Two comparisons do not mix the
errors: the reported velocity follows what was told but for gusts and lag, whatever the bias; and
the position follows the reported velocity but for bias and noise, whatever the gusts. Each
explanation (no fault, axes swapped, mirrored, turned, it stands still) predicts the next report.
The evidence for a fault is the log likelihood by which it predicts better, summed since it last
predicted worse (CUSUM, Page 1954).
"""

from __future__ import annotations

from collections import deque
from math import exp, hypot

import numpy as np
from numpy.typing import NDArray

Plane = tuple[float, float]
"""North, east."""
Array = NDArray[np.float64]
PERIOD_S = 0.1
"""Reports are compared this often."""
EVIDENCE = 12.0
"""Enough of it. In 3 h without a fault it reached 10 (docs/vehicle.md)."""
EVIDENCE_PER_S = 30.0
"""A moment may not convince at once."""
BIAS_M_S, BIAS_TIME_S = 0.46, 15.0
"""Of the position against the reported velocity: standard deviation of the bias, per axis, twice
the measured one, how long it stays alike,"""
NOISE_M2_S = 0.06
"""and growth of the variance of the way by the noise of the position."""
OUTLIER = 3.0
"""Standard deviations. A larger error counts as this: positions step by a metre or two."""
OFFSET_M_S, OFFSET_TIME_S = 0.1, 5.0
"""The same of the reported velocity against what was told,"""
CALM_M2_S = 0.03
"""in calm air. Gusts add to it,"""
WINDY_M_S2, WINDY_POWER = 3.7, 4
"""as much where the vehicle holds against the wind with this acceleration, as its lean shows (about
8 m/s), and steeply more above: what is left to answer a gust with becomes less."""
WIND_TIME_S = 5.0
QUICK_S = 0.4
"""A vehicle leans before it moves. A quick one follows with this time constant,"""
SLOW_S, SLOW_M_S2 = 0.4, 4.0
"""a slow one with this, twice, and with no more than this acceleration (as ArduCopter 4.7 does),"""
QUICKNESS = 0.2
"""and the expected one lies so far from the slow one to the quick one."""
UNSETTLED_S = 0.7
"""While they differ, little is concluded: half of the difference is an error for so long."""
STEP_S = 0.05
DRIFT_M, DRIFT_S = 15.0, 6.0
"""So far from what was told no vehicle drifts in this time, with a bias of seven times the largest
measured one (in gusts, and with twice the errors: 12 m)."""
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
"""Fault -> reported way (rows: north, east) of the expected one. The first is no fault."""
_GAINS = np.array(list(EXPLANATIONS.values()))
_NAMES = tuple(EXPLANATIONS)
STILL_M = 0.01
"""A position that stays within this while the vehicle is told to go STILL_WAY_M is frozen: every
real one has noise."""
STILL_WAY_M = 1.0


class _ExpectedMotion:
    """Where a vehicle probably goes that follows what it is told."""

    def __init__(self) -> None:
        self._quick, self._limited, self._half, self._slow = np.zeros((4, 2))
        self.restart()

    def restart(self) -> None:
        """Begin the ways at zero."""
        self.way_m, self.slow_way_m, self.unsettled_m2 = np.zeros(2), 0.0, 0.0

    def step(self, told_m_s: Array, seconds: float) -> None:
        """Follow for a time."""
        self._quick = self._quick + (told_m_s - self._quick) * (1.0 - exp(-seconds / QUICK_S))
        change = told_m_s - self._limited
        size = hypot(*change)
        share = min(1.0, SLOW_M_S2 * seconds / size) if size > 0.0 else 1.0
        self._limited = self._limited + share * change
        follow = 1.0 - exp(-seconds / SLOW_S)
        self._half = self._half + (self._limited - self._half) * follow
        self._slow = self._slow + (self._half - self._slow) * follow
        difference = self._quick - self._slow
        self.way_m += (self._slow + QUICKNESS * difference) * seconds
        self.slow_way_m += hypot(*self._slow) * seconds
        self.unsettled_m2 += UNSETTLED_S * float(difference @ difference) / 4.0 * seconds


class _Comparison:
    """Evidence for each explanation, from an expected way and a reported one.

    Args:
        bias_m_s: Standard deviation of their difference, per axis,
        bias_time_s: and how long it stays alike.
    """

    def __init__(self, bias_m_s: float, bias_time_s: float) -> None:
        self._bias_m_s, self._bias_time_s = bias_m_s, bias_time_s
        self.restart()

    def restart(self) -> None:
        """Forget all evidence and the bias."""
        self._bias = np.zeros((len(_GAINS), 2))
        self._bias_variance = self._bias_m_s**2
        self._evidence = np.zeros(len(_GAINS))

    def step(self, expected_m: Array, seen_m: Array, seconds: float, noise_m2: float) -> str:
        """Let each explanation predict the way of a period, and learn its bias.

        Args:
            expected_m: Way without a fault.
            seen_m: Reported way.
            seconds: Of the period.
            noise_m2: Variance of the way, per axis, without that of the bias.

        Returns:
            The fault, empty for none.
        """
        keep = exp(-seconds / self._bias_time_s)
        before = keep * keep * self._bias_variance
        self._bias_variance = before + (1.0 - keep * keep) * self._bias_m_s**2
        variance = seconds * seconds * self._bias_variance + noise_m2
        error_m = seen_m - _GAINS @ expected_m - keep * self._bias * seconds
        most_m = OUTLIER * variance**0.5
        error_m = np.clip(error_m, -most_m, most_m)
        gain = self._bias_variance * seconds / variance
        self._bias = keep * self._bias + gain * error_m
        self._bias[-1] = 0.0  # what stands still has none
        self._bias_variance *= 1.0 - gain * seconds
        square = (error_m * error_m).sum(axis=1)
        limit = EVIDENCE_PER_S * seconds
        self._evidence += np.clip((square[0] - square) / (2.0 * variance), -limit, limit)
        right = self._evidence <= 0.0
        self._evidence[right] = 0.0
        self._bias[right] = _GAINS[right] @ self._bias[0]
        worst = int(self._evidence.argmax())
        return _NAMES[worst] if self._evidence[worst] >= EVIDENCE else ''


class AxesWatch:
    """Looks at reported motion over ground for axes that are not north and east."""

    def __init__(self) -> None:
        self._expected = _ExpectedMotion()
        self._position = _Comparison(BIAS_M_S, BIAS_TIME_S)
        self._velocity = _Comparison(OFFSET_M_S, OFFSET_TIME_S)
        self.restart()

    def restart(self) -> None:
        """Forget all evidence; what was told last is kept."""
        self._position.restart()
        self._velocity.restart()
        self._recent: deque[tuple[Array, float]] = deque()
        self._recent_s = self._still_way_m = 0.0
        self._wind_m_s2 = np.zeros(2)
        self._still_at_m: Array | None = None
        self._last: tuple[Array, Array] | None = None
        self._begin_period(np.zeros(2))

    def _begin_period(self, seen_m: Array) -> None:
        self._expected.restart()
        self._begin_m, self._seconds, self._way_m = seen_m, 0.0, np.zeros(2)

    def follow(self, told_m_s: Plane, seconds: float) -> None:
        """Note what the vehicle was told for a time between two reports."""
        told = np.array(told_m_s)
        while seconds > 0.0:
            self._expected.step(told, min(seconds, STEP_S))
            seconds -= STEP_S

    def take(self, seen_m: Plane, seen_m_s: Plane, lean_m_s2: Plane, seconds: float) -> str:
        """Look at a report.

        Args:
            seen_m: Reported position.
            seen_m_s: Reported velocity.
            lean_m_s2: Horizontal acceleration by the lean of the thrust.
            seconds: Since the last report.

        Returns:
            Why the report is not believed, empty when it is.
        """
        place, velocity = np.array(seen_m), np.array(seen_m_s)
        follow = 1.0 - exp(-seconds / WIND_TIME_S) if self._last else 1.0
        self._wind_m_s2 = self._wind_m_s2 + follow * (np.array(lean_m_s2) - self._wind_m_s2)
        problem = ''
        if self._last is None:
            self._begin_period(place)
        else:
            self._way_m += (velocity + self._last[1]) / 2.0 * seconds
            self._seconds += seconds
        self._last = (place, velocity)
        if self._seconds >= PERIOD_S:
            problem = self._compare(place)
            self._begin_period(place)
        return problem

    def _compare(self, place_m: Array) -> str:
        seen_m, told_m, seconds = place_m - self._begin_m, self._expected.way_m, self._seconds
        if problem := self._stands_still(place_m) or self._runs_away(seen_m - told_m):
            return problem
        windy = (hypot(*self._wind_m_s2) / WINDY_M_S2) ** WINDY_POWER
        noise_m2 = CALM_M2_S * (1.0 + windy) * seconds + self._expected.unsettled_m2
        if fault := self._velocity.step(told_m, self._way_m, seconds, noise_m2):
            return f'the reported velocity does not follow what was told sideways: {fault}'
        if fault := self._position.step(self._way_m, seen_m, seconds, NOISE_M2_S * seconds):
            return f'the position does not follow the reported velocity sideways: {fault}'
        return ''

    def _stands_still(self, place_m: Array) -> str:
        at_m = self._still_at_m
        if at_m is None or np.abs(place_m - at_m).max() > STILL_M:
            self._still_at_m, self._still_way_m = place_m, 0.0
            return ''
        self._still_way_m += self._expected.slow_way_m
        if self._still_way_m < STILL_WAY_M:
            return ''
        return (
            'the vehicle was told to go sideways by a metre or more and its position stands still'
        )

    def _runs_away(self, drift_m: Array) -> str:
        self._recent.append((drift_m, self._seconds))
        self._recent_s += self._seconds
        while self._recent_s > DRIFT_S:
            self._recent_s -= self._recent.popleft()[1]
        away_m = hypot(*np.sum([each for each, _ in self._recent], axis=0))
        if away_m <= DRIFT_M:
            return ''
        return (
            f'the position runs away sideways from what was told, {away_m:.1f} m in '
            f'{self._recent_s:.1f} s (limit {DRIFT_M:g} m in {DRIFT_S:g} s)'
        )
