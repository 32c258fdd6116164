# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Does the altitude sink when the vehicle is told to sink? Pure.

An altitude that has frozen looks valid in every single message, and whoever believes it descends
through the floor.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

SPANS_S = (1.5, 3.5)
"""The way told and the way reported are compared over these times: fast descents soon, slow ones
at last."""
LAG_S = 0.5
"""The vehicle is behind what it is told by about this much."""
LEAST_M = 1.0
"""Shorter ways prove nothing."""
LEAST_PART = 0.2
"""Of the way that it was told to sink, the altitude has to show this part."""
GAP_S = 0.5
STEP_M = 3.0
"""No vehicle flies this far between two reports."""


@dataclass(frozen=True)
class _Mark:
    at_s: float
    boot_s: float
    altitude_m: float
    told_m: float
    """Way down that was told since the first mark."""


class SinkWatch:
    """Compares what was told with what is reported; doubt stays until :meth:`forget`."""

    def __init__(self) -> None:
        self.problem = ''
        """Why the altitude is not believed, empty when it is."""
        self._marks: deque[_Mark] = deque()
        self._told_m = 0.0
        self._down_m_s = 0.0

    def forget(self) -> None:
        """Believe whatever comes next."""
        self.problem = ''
        self._marks.clear()
        self._told_m = self._down_m_s = 0.0

    def tell(self, v_down_m_s: float) -> None:
        """Note what the vehicle is told from now on; a climb is a negative way."""
        self._down_m_s = v_down_m_s

    def take(self, altitude_m: float | None, steady_ns: int, boot_ns: int | None = None) -> None:
        """Look at an altitude; the same report twice is looked at once.

        Args:
            altitude_m: None is unknown, and proves nothing.
            steady_ns: When it was reported.
            boot_ns: The same by the autopilot's clock, None: it runs as ours. In a simulation it
                may run slower, and a slow descent is no lie then.
        """
        at_s = steady_ns / 1e9
        boot_s = at_s if boot_ns is None else boot_ns / 1e9
        last = self._marks[-1] if self._marks else None
        if altitude_m is None or (last is not None and not 0.0 <= at_s - last.at_s <= GAP_S):
            self._marks.clear()
            return
        if last is not None and at_s == last.at_s:
            return
        if last is not None and abs(altitude_m - last.altitude_m) > STEP_M:
            # A jump has its own watch, and its own answer.
            self._marks.clear()
            return
        if last is not None:
            flown_s = min(at_s - last.at_s, max(0.0, boot_s - last.boot_s))
            self._told_m += self._down_m_s * flown_s
        self._marks.append(_Mark(at_s, boot_s, altitude_m, self._told_m))
        while at_s - self._marks[0].at_s > SPANS_S[-1] + LAG_S + GAP_S:
            self._marks.popleft()
        for span_s in SPANS_S:
            if not self.problem:
                self._compare(at_s, span_s)

    def _compare(self, at_s: float, span_s: float) -> None:
        told_begin = self._before(at_s - span_s - LAG_S)
        told_end, seen_begin = self._before(at_s - LAG_S), self._before(at_s - span_s)
        if told_begin is None or told_end is None or seen_begin is None:
            return
        # With lag and without: after a change of mind either may be right.
        newest_m = self._marks[-1].told_m
        told_m = min(told_end.told_m - told_begin.told_m, newest_m - seen_begin.told_m)
        sunk_m = seen_begin.altitude_m - self._marks[-1].altitude_m
        if told_m > LEAST_M and sunk_m < LEAST_PART * told_m:
            self.problem = (
                f'the vehicle was told to sink {told_m:.1f} m in {span_s:g} s and reports '
                f'{sunk_m:.1f} m: its altitude is not believed; take over, engage again when it '
                'is right'
            )

    def _before(self, at_s: float) -> _Mark | None:
        return next((mark for mark in reversed(self._marks) if mark.at_s <= at_s), None)
