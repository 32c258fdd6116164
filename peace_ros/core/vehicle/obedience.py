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
from math import dist, hypot

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
LATERAL_SPAN_S = 2.0
"""Sideways ways are compared over this time,"""
LATERAL_LAG_S = 1.0
"""with this lag and without, for the vehicle leans before it moves,"""
SETTLED_S = 2.5
"""and only when what it was told has pointed that way for so long before: it has to turn round."""
POINTING = 0.7
"""Cosine of the angle up to which it points the same way."""
LEAST_M = 1.0
"""Shorter ways down are not conclusive."""
LEAST_LATERAL_M = 1.0
"""Nor are shorter ones sideways: gusts move the vehicle."""
LEAST_PART = 0.2
"""Of the way that it was told to go, the position has to show this part."""
GAP_S = 0.5
STEP_M = 3.0
"""No vehicle flies this far between two reports."""
_MEMORY_S = max(SPANS_S[-1] + LAG_S + CALM_S, LATERAL_SPAN_S + SETTLED_S) + GAP_S
_REMEDY = 'is not believed; take over, engage again when it is right'


@dataclass(frozen=True)
class _Mark:
    at_s: float
    boot_s: float
    seen_m: Vector
    """Reported position."""
    told_m: Vector
    """Way that was told since the first mark."""


class ObedienceWatch:
    """Compares what was told with what is reported; doubt stays until :meth:`forget`."""

    def __init__(self) -> None:
        self.problem = ''
        """Why the position is not believed, empty when it is."""
        self._marks: deque[_Mark] = deque()
        self._told_m: Vector = (0.0, 0.0, 0.0)
        self._velocity_m_s: Vector = (0.0, 0.0, 0.0)

    def forget(self) -> None:
        """Forget all reports and the doubt."""
        self.problem = ''
        self._marks.clear()
        self._told_m = self._velocity_m_s = (0.0, 0.0, 0.0)

    def tell(self, velocity_m_s: Vector) -> None:
        """Note what the vehicle is told from now on."""
        self._velocity_m_s = velocity_m_s

    def take(self, position_m: Vector | None, steady_ns: int, boot_ns: int | None = None) -> None:
        """Look at a position; the same report twice is looked at once.

        Args:
            position_m: None is unknown, and proves nothing.
            steady_ns: When it was reported.
            boot_ns: The same by the autopilot's clock, None: it runs as ours. In a simulation it
                may run slower, and a slow descent is no lie then.
        """
        at_s = steady_ns / 1e9
        boot_s = at_s if boot_ns is None else boot_ns / 1e9
        last = self._marks[-1] if self._marks else None
        if position_m is None or (last is not None and not 0.0 <= at_s - last.at_s <= GAP_S):
            self._marks.clear()
            return
        if last is not None and at_s == last.at_s:
            return
        if last is not None and dist(position_m, last.seen_m) > STEP_M:
            # Jumps are handled by JumpWatch.
            self._marks.clear()
            return
        if last is not None:
            flown_s = min(at_s - last.at_s, max(0.0, boot_s - last.boot_s))
            self._told_m = _moved(self._told_m, self._velocity_m_s, flown_s)
        self._marks.append(_Mark(at_s, boot_s, position_m, self._told_m))
        while at_s - self._marks[0].at_s > _MEMORY_S:
            self._marks.popleft()
        for span_s in SPANS_S:
            self.problem = self.problem or self._sinks(at_s, span_s)
        self.problem = self.problem or self._goes_there(at_s)

    def _sinks(self, at_s: float, span_s: float) -> str:
        late_begin, late_end = self._before(at_s - span_s - LAG_S), self._before(at_s - LAG_S)
        begin, end = self._before(at_s - span_s), self._marks[-1]
        if late_begin is None or late_end is None or begin is None:
            return ''
        # With lag and without: after a change of mind either may be right.
        late_m = late_end.told_m[2] - late_begin.told_m[2]
        told_m = min(late_m, end.told_m[2] - begin.told_m[2])
        sunk_m = end.seen_m[2] - begin.seen_m[2]
        if told_m <= LEAST_M or sunk_m >= LEAST_PART * told_m:
            return ''
        if self._climbed_since(at_s - span_s - LAG_S - CALM_S):
            return ''
        return (
            f'the vehicle was told to sink {told_m:.1f} m in {span_s:g} s and reports '
            f'{sunk_m:.1f} m: its altitude {_REMEDY}'
        )

    def _climbed_since(self, begin_s: float) -> bool:
        recent = (mark for mark in self._marks if mark.at_s >= begin_s)
        return any(b.told_m[2] < a.told_m[2] for a, b in pairwise(recent))

    def _goes_there(self, at_s: float) -> str:
        late_s = at_s - LATERAL_LAG_S
        late_begin, late_end = self._before(late_s - LATERAL_SPAN_S), self._before(late_s)
        begin, end = self._before(at_s - LATERAL_SPAN_S), self._marks[-1]
        if late_begin is None or late_end is None or begin is None:
            return ''
        north, east, _ = _way(begin.told_m, end.told_m)
        now_m = hypot(north, east)
        if now_m <= LEAST_LATERAL_M:
            return ''
        along = (north / now_m, east / now_m)
        told_m = min(now_m, _along(_way(late_begin.told_m, late_end.told_m), along))
        went_m = _along(_way(begin.seen_m, end.seen_m), along)
        if told_m <= LEAST_LATERAL_M or went_m >= LEAST_PART * told_m:
            return ''
        if not self._pointed(along, at_s):
            return ''
        return (
            f'the vehicle was told to go {told_m:.1f} m sideways in {LATERAL_SPAN_S:g} s and '
            f'reports {went_m:.1f} m that way: its position {_REMEDY}'
        )

    def _pointed(self, along: tuple[float, float], at_s: float) -> bool:
        """Tell whether what was told has pointed one way for long enough."""
        begin_s = at_s - LATERAL_SPAN_S - SETTLED_S
        if self._before(begin_s) is None:
            return False
        recent = (mark for mark in self._marks if mark.at_s >= begin_s)
        ways = (_way(a.told_m, b.told_m) for a, b in pairwise(recent))
        return all(_along(way, along) > max(0.0, POINTING * hypot(way[0], way[1])) for way in ways)

    def _before(self, at_s: float) -> _Mark | None:
        return next((mark for mark in reversed(self._marks) if mark.at_s <= at_s), None)


def _way(begin: Vector, end: Vector) -> Vector:
    return end[0] - begin[0], end[1] - begin[1], end[2] - begin[2]


def _along(way_m: Vector, direction: tuple[float, float]) -> float:
    return way_m[0] * direction[0] + way_m[1] * direction[1]


def _moved(from_m: Vector, velocity_m_s: Vector, seconds: float) -> Vector:
    return (
        from_m[0] + velocity_m_s[0] * seconds,
        from_m[1] + velocity_m_s[1] * seconds,
        from_m[2] + velocity_m_s[2] * seconds,
    )
