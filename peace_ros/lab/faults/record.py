# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What was seen of one fault; times are seconds of the steady clock since the injection."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf, nan

from peace_ros.core.landing import State

STANDING_M_S = 0.3
"""Slower descents than this are standing: the height control of the autopilot breathes."""
_SLOPE_S = 0.3
"""Speeds of the ground truth are taken over this time."""


@dataclass(frozen=True)
class Said:
    """One ``landing/status``, at the time at which it was published."""

    at_s: float
    state: str
    reason: str = ''


@dataclass(frozen=True)
class TruthSample:
    """Where the vehicle truly was when the simulator published it."""

    at_s: float
    north_m: float
    east_m: float
    altitude_agl_m: float
    stamp_ns: int = 0
    """Of the pose, by the node clock."""


@dataclass(frozen=True)
class Sent:
    """A velocity set-point of the companion, as it was on the wire."""

    at_s: float
    v_north_m_s: float
    v_east_m_s: float
    v_down_m_s: float

    @property
    def is_zero(self) -> bool:
        """Every component is exactly zero."""
        return self.v_north_m_s == self.v_east_m_s == self.v_down_m_s == 0.0


@dataclass(frozen=True)
class Ended:
    """A process that has ended."""

    at_s: float
    name: str
    status: int
    meant: bool
    """The fault ended it; otherwise it ended by itself."""
    last_words: str = ''


@dataclass
class Record:
    """Everything that the judge may look at."""

    injected_s: float = 0.0
    """Since the engagement."""
    state_before: str = ''
    altitude_before_m: float = nan
    ended_s: float | None = None
    """When the fault was taken away; None: it never was."""
    closed_s: float = 0.0
    """When the observation ended."""
    said: list[Said] = field(default_factory=list)
    truths: list[TruthSample] = field(default_factory=list)
    sent: list[Sent] = field(default_factory=list)
    ended: list[Ended] = field(default_factory=list)
    refusal: str | None = None
    """What the landing node answered when it refused the engagement."""
    stopped_s: list[tuple[float, float]] = field(default_factory=list)
    """Spans in which the landing node was meant to be silent: killed, stopped or starting."""
    unsafe: list[tuple[float, str]] = field(default_factory=list)
    """Hand-overs over ground that the truth calls unsafe: when, and why it is."""
    handovers: int = 0
    over_person_s: float | None = None
    """How long the vehicle descended with a person below; None where there is none."""
    lost_control_s: float = inf
    """When the companion lost control of the vehicle."""
    trouble: str = ''
    """Why the fault could not be tried at all."""
    slow: str = ''
    """Why the machine was too slow for a verdict, empty when it kept up."""

    @property
    def fault_end_s(self) -> float:
        """When the fault was over, or the observation if it never was."""
        return self.closed_s if self.ended_s is None else self.ended_s

    def first(self, states: tuple[str, ...], after_s: float = 0.0) -> Said | None:
        """Return the first status since a moment that names one of the states."""
        return next((s for s in self.said if s.at_s >= after_s and s.state in states), None)

    def state_at(self, at_s: float) -> str:
        """Return the state that was said last before a moment."""
        index = bisect_right([s.at_s for s in self.said], at_s)
        return self.said[index - 1].state if index else self.state_before

    def descents(self, begin_s: float, end_s: float) -> list[tuple[float, float]]:
        """Return (moment, true downward speed in m/s) between two moments."""
        points = [t for t in self.truths if begin_s - _SLOPE_S <= t.at_s <= end_s]
        speeds = []
        first = 0
        for point in points:
            while first + 1 < len(points) and point.at_s - points[first + 1].at_s >= _SLOPE_S:
                first += 1
            before = points[first]
            span_s = point.at_s - before.at_s
            if span_s >= 0.5 * _SLOPE_S and point.at_s >= begin_s:
                speed = (before.altitude_agl_m - point.altitude_agl_m) / span_s
                speeds.append((point.at_s, speed))
        return speeds

    def fastest_descent_m_s(self, begin_s: float, end_s: float) -> float:
        """Return the highest true downward speed between two moments, 0 when nothing was seen."""
        return max((speed for _, speed in self.descents(begin_s, end_s)), default=0.0)

    def still_since_s(self, end_s: float, limit_m_s: float) -> float:
        """Return since when the vehicle has not descended faster than a limit."""
        fast = [at_s for at_s, speed in self.descents(0.0, end_s) if speed > limit_m_s]
        return fast[-1] if fast else 0.0

    def truth_gap_s(self, begin_s: float, end_s: float) -> float:
        """Return the longest time between two moments without ground truth."""
        return longest_gap_s((t.at_s for t in self.truths), begin_s, end_s)

    def lowest_m(self, until_s: float = inf) -> float:
        """Return the lowest true altitude since the injection."""
        heights = [t.altitude_agl_m for t in self.truths if t.at_s <= until_s]
        return min(heights, default=nan)


def longest_gap_s(times_s: Iterable[float], begin_s: float, end_s: float) -> float:
    """Return the longest time between two moments in which nothing came."""
    inside = [at_s for at_s in times_s if begin_s < at_s < end_s]
    return max(b - a for a, b in pairwise((begin_s, *inside, end_s)))


STILL = frozenset(
    state.value for state in (State.IDLE, State.WAITING, State.HANDOVER, State.HOLD, State.ABORTED)
) | {'FAILED'}
"""States in which the set-point has to be zero. They are listed here a second time on purpose: the
judge does not rely on what the landing says of itself."""
