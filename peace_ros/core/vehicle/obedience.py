# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Does the vehicle report that it goes where it is told? Pure.

An altitude that has frozen, and a position whose axes are swapped or mirrored, look valid in every
single message. Whoever believes the one descends through the floor; whoever corrects by the other
flies away from where they want to be, the faster the farther they are.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import dist, inf

from peace_ros.core.vehicle.faulty_axes import AxesWatch, Plane

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
_TOLD = 63
"""So many set-points are remembered: more than come in GAP_S."""
_MEMORY_S = SPANS_S[-1] + LAG_S + CALM_S + GAP_S
_REMEDY = 'is not believed; take over, engage again when it is right'


@dataclass(frozen=True)
class ReportedMotion:
    """What the autopilot reports of one moment."""

    position_m: Vector
    velocity_m_s: Plane
    lean_m_s2: Plane = (0.0, 0.0)
    """Horizontal acceleration by the lean of the thrust."""


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
        self.forget()

    def forget(self) -> None:
        """Forget all reports, all that was told, and the doubt."""
        self.problem = ''
        """Why the position is not believed, empty when it is."""
        self._marks: deque[_Mark] = deque()
        self._axes = AxesWatch()
        self._told_m = 0.0
        # Not changed in place: another thread may tell while this one takes.
        self._told: tuple[tuple[float, Vector], ...] = ((-inf, (0.0, 0.0, 0.0)),)

    def tell(self, velocity_m_s: Vector, steady_ns: int) -> None:
        """Note what the vehicle is told from now on."""
        if velocity_m_s != self._told[-1][1]:
            self._told = (*self._told[-_TOLD:], (steady_ns / 1e9, velocity_m_s))

    def take(
        self, motion: ReportedMotion | None, steady_ns: int, boot_ns: int | None = None
    ) -> None:
        """Look at a report; the same report twice is looked at once.

        Args:
            motion: None is unknown, and proves nothing.
            steady_ns: When it was reported.
            boot_ns: The same by the autopilot's clock, None: it runs as ours. In a simulation it
                may run slower, and a slow descent is no lie then, or faster, and the vehicle goes
                farther than it was told by our clock.
        """
        at_s = steady_ns / 1e9
        boot_s = at_s if boot_ns is None else boot_ns / 1e9
        last = self._marks[-1] if self._marks else None
        if last is not None and motion is not None and at_s == last.at_s:
            return
        # Jumps are handled by JumpWatch.
        if motion is None or (
            last is not None
            and not (
                0.0 <= at_s - last.at_s <= GAP_S and dist(motion.position_m, last.seen_m) <= STEP_M
            )
        ):
            self._marks.clear()
            self._axes.restart()
            return
        boot_step_s = flown_s = 0.0
        if last is not None:
            boot_step_s = min(GAP_S, max(0.0, boot_s - last.boot_s))
            flown_s = min(at_s - last.at_s, boot_step_s)
            for told_m_s, share in self._told_between(last.at_s, at_s):
                self._told_m += told_m_s[2] * flown_s * share
                self._axes.follow(told_m_s[:2], boot_step_s * share)
        self._marks.append(_Mark(at_s, boot_s, motion.position_m, self._told_m))
        while at_s - self._marks[0].at_s > _MEMORY_S:
            self._marks.popleft()
        for span_s in SPANS_S:
            self.problem = self.problem or self._sinks(at_s, span_s)
        found = self._axes.take(
            motion.position_m[:2], motion.velocity_m_s, motion.lean_m_s2, boot_step_s
        )
        self.problem = self.problem or (f'{found}: it {_REMEDY}' if found else '')

    def _told_between(self, begin_s: float, end_s: float) -> Iterator[tuple[Vector, float]]:
        """Yield what the vehicle was told between two moments, and for which share of the time."""
        told = self._told
        ends_s = (*(at_s for at_s, _ in told[1:]), inf)
        for (since_s, velocity_m_s), until_s in zip(told, ends_s, strict=True):
            told_s = min(until_s, end_s) - max(since_s, begin_s)
            if told_s > 0.0:
                yield velocity_m_s, told_s / (end_s - begin_s)

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
