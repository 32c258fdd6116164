# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Does the vehicle report that it goes where it is told? Pure.

An altitude that has frozen, and a position whose axes are swapped or mirrored, look valid in every
single message. Whoever believes the one descends through the floor; whoever corrects by the other
flies away from where they want to be, the faster the farther they are.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from math import dist, inf

from peace_ros.core.vehicle.faulty_axes import AxesWatch

Vector = tuple[float, float, float]
"""North, east, down."""
SPANS_S = (1.5, 3.5)
"""The way told and the way reported are compared over these times: fast descents soon, slow ones
after longer."""
LAG_S = 0.5
"""The vehicle is behind what it is told by about this much when it changes its height."""
CALM_S = 1.0
"""Nothing is said of sinking until the last climb told is so much older than what is compared: a
vehicle that climbs has to stop first."""
LEAST_M = 1.0
"""Shorter ways down are not conclusive."""
LEAST_PART = 0.2
"""Of the way that it was told to sink, the altitude has to show this part,"""
BIAS_M_S = 0.33
"""unless this bias of the vertical speed (the largest measured) explains what is missing."""
FROZEN_M = 0.01
"""No bias explains an altitude that changes by less than this."""
GAP_S = 0.5
STEP_M = 3.0
"""No vehicle flies this far between two reports."""
_MEMORY_S = SPANS_S[-1] + LAG_S + CALM_S + GAP_S
_REMEDY = 'is not believed; take over, engage again when it is right'


@dataclass(frozen=True)
class _Mark:
    at_s: float
    boot_s: float
    seen_m: Vector
    """Reported position."""
    told_m: float
    """Way down that was told since the first mark."""


class ObedienceWatch:
    """Compares what was told with what is reported; doubt stays until :meth:`forget`."""

    def __init__(self) -> None:
        self.problem = ''
        """Why the position is not believed, empty when it is."""
        self._marks: deque[_Mark] = deque()
        self._axes = AxesWatch()
        self._told_m, self._least_down_m_s = 0.0, inf
        self._velocity_m_s: Vector = (0.0, 0.0, 0.0)

    def forget(self) -> None:
        """Forget all reports and the doubt."""
        self.problem = ''
        self._marks.clear()
        self._axes = AxesWatch()
        self._told_m, self._least_down_m_s = 0.0, inf
        self._velocity_m_s = (0.0, 0.0, 0.0)

    def tell(self, velocity_m_s: Vector) -> None:
        """Note what the vehicle is told from now on."""
        self._velocity_m_s = velocity_m_s
        self._least_down_m_s = min(self._least_down_m_s, velocity_m_s[2])

    def take(self, position_m: Vector | None, steady_ns: int, boot_ns: int | None = None) -> None:
        """Look at a position; the same report twice is looked at once.

        Args:
            position_m: None is unknown, and proves nothing.
            steady_ns: When it was reported.
            boot_ns: The same by the autopilot's clock, None: it runs as ours. In a simulation it
                may run slower, and a slow descent is no lie then, or faster, and the vehicle goes
                farther than it was told by our clock.
        """
        at_s = steady_ns / 1e9
        boot_s = at_s if boot_ns is None else boot_ns / 1e9
        last = self._marks[-1] if self._marks else None
        if last is not None and position_m is not None and at_s == last.at_s:
            return
        # Jumps are handled by JumpWatch.
        if position_m is None or (
            last is not None
            and not (0.0 <= at_s - last.at_s <= GAP_S and dist(position_m, last.seen_m) <= STEP_M)
        ):
            self._marks.clear()
            self._axes.restart()
            return
        flown_s = boot_step_s = 0.0
        if last is not None:
            boot_step_s = min(GAP_S, max(0.0, boot_s - last.boot_s))
            flown_s = min(at_s - last.at_s, boot_step_s)
        north, east, down = self._velocity_m_s
        # Any of those since the last report may have held.
        self._told_m += min(down, self._least_down_m_s) * flown_s
        self._least_down_m_s = inf
        self._marks.append(_Mark(at_s, boot_s, position_m, self._told_m))
        while at_s - self._marks[0].at_s > _MEMORY_S:
            self._marks.popleft()
        for span_s in SPANS_S:
            self.problem = self.problem or self._sinks(at_s, span_s)
        found = self._axes.take(position_m[:2], (north, east), boot_step_s)
        self.problem = self.problem or (f'{found}: it {_REMEDY}' if found else '')

    def _sinks(self, at_s: float, span_s: float) -> str:
        late_begin, late_end = self._before(at_s - span_s - LAG_S), self._before(at_s - LAG_S)
        begin, end = self._before(at_s - span_s), self._marks[-1]
        if late_begin is None or late_end is None or begin is None:
            return ''
        # With lag and without: after a change of mind either may be right.
        told_m = min(late_end.told_m - late_begin.told_m, end.told_m - begin.told_m)
        sunk_m = end.seen_m[2] - begin.seen_m[2]
        if told_m <= LEAST_M or sunk_m >= LEAST_PART * told_m:
            return ''
        biased = told_m - sunk_m < BIAS_M_S * span_s
        if biased and not self._frozen_since(at_s - span_s):
            return ''
        if self._climbed_since(at_s - span_s - LAG_S - CALM_S):
            return ''
        return (
            f'the vehicle was told to sink {told_m:.1f} m in {span_s:g} s and reports '
            f'{sunk_m:.1f} m: its altitude {_REMEDY}'
        )

    def _frozen_since(self, begin_s: float) -> bool:
        heights_m = [mark.seen_m[2] for mark in self._marks if mark.at_s >= begin_s]
        return max(heights_m) - min(heights_m) < FROZEN_M

    def _climbed_since(self, begin_s: float) -> bool:
        recent = (mark for mark in self._marks if mark.at_s >= begin_s)
        return any(b.told_m < a.told_m for a, b in pairwise(recent))

    def _before(self, at_s: float) -> _Mark | None:
        return next((mark for mark in reversed(self._marks) if mark.at_s <= at_s), None)
