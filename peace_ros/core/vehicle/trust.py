# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Accepts or rejects reported positions: a jump is rejected until it has persisted; pure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import dist, hypot

Vector = tuple[float, float, float]
SLACK_M_S = 3.0
"""How much the velocity may be wrong or change between two reports."""
FASTEST_M_S = 20.0
LED_S = 0.3
"""Longest way by velocity to a single report: a time stamp ahead of its time leads no farther."""
GAP_S = 1.0
"""Reports farther apart are compared by the fastest speed only."""
SETTLED_S = 2.0
"""Reports that agree with each other for so long are believed again, when somebody else flies."""
FASTEST_CHANGE_M_S2 = 20.0
RESET_S = 15.0
"""The same while we fly and stand still, when the height has stayed as it was."""
SAME_HEIGHT_M = 2.0


@dataclass(frozen=True)
class PoseReport:
    """One LOCAL_POSITION_NED."""

    boot_ms: int
    position_m: Vector
    velocity_m_s: Vector


class JumpWatch:
    """Compares each position with where the one before it led.

    Neither the position nor the velocity of a single message moves what is believed by more than
    the limit: what lies farther off and is possible needs a second report that agrees with it.
    A jump is a reset of the position filter or a fault; in both cases the map is no longer valid.
    While we have control the vehicle stands until the position comes back to where it was, or has
    been steady at the old height for fifteen seconds: GNSS that returns moves the position for
    good, and without a radio nobody could help a vehicle that waits for ever. A height that jumped
    stays rejected, since every descent relies on it. While somebody else flies two steady seconds
    are enough.

    Args:
        limit_m: Deviation that is still believed.
    """

    def __init__(self, limit_m: float) -> None:
        self._limit_m = limit_m
        self._believed: PoseReport | None = None
        self._newest: PoseReport | None = None
        self._steady_since_ms = 0
        self._height_jumped_m = 0.0
        self.problem = ''
        """Why the position is not believed, empty when it is."""

    def forget(self) -> None:
        """Accept the next report, whatever it is."""
        self._believed = self._newest = None
        self._height_jumped_m = 0.0
        self.problem = ''

    def shift(self, by_ms: int) -> None:
        """Follow a clock of the autopilot that was set; places stay."""
        self._steady_since_ms += by_ms
        self._believed, self._newest = (
            each and replace(each, boot_ms=each.boot_ms + by_ms)
            for each in (self._believed, self._newest)
        )

    def believes(self, report: PoseReport, *, in_control: bool) -> bool:
        """Take a report; tell whether it may be used."""
        newest, self._newest = self._newest, report
        if newest is None or self._deviation_m(newest, report) > 0.0:
            self._steady_since_ms = report.boot_ms
            self._height_jumped_m += 0.0 if newest is None else _off_course(newest, report)[2]
        if self._believed is None:
            return self._believe(report)
        if self.problem:
            # The vehicle has been told to stand still since: it must be where it was.
            back = dist(report.position_m, self._believed.position_m) <= self._limit_m
            if back or self._has_settled(report, in_control=in_control):
                return self._believe(report)
            return False
        if self._deviation_m(self._believed, report) <= 0.0:
            near = any(each and self._is_near(each, report) for each in (self._believed, newest))
            return near and self._believe(report)
        jump_m = dist(report.position_m, self._believed.position_m)
        self.problem = (
            f'the reported position jumped by {jump_m:.1f} m, more than it can have flown (limit '
            f'{self._limit_m:g} m): holding until it comes back, or has been steady at the same '
            f'height for {RESET_S:g} s'
        )
        return False

    def _has_settled(self, report: PoseReport, *, in_control: bool) -> bool:
        """Tell whether it has been steady for long enough; sinking to a stop is no jump."""
        settled_s = (report.boot_ms - self._steady_since_ms) / 1e3
        if not in_control:
            return settled_s >= SETTLED_S
        return settled_s >= RESET_S and abs(self._height_jumped_m) <= SAME_HEIGHT_M

    def _believe(self, report: PoseReport) -> bool:
        self._believed, self._height_jumped_m, self.problem = report, 0.0, ''
        return True

    def _is_near(self, before: PoseReport, after: PoseReport) -> bool:
        """Tell whether place and velocity are as the report before foretold, within the limits."""
        dt_s = (after.boot_ms - before.boot_ms) / 1e3
        dt_s = min(dt_s, LED_S) if 0.0 <= dt_s <= GAP_S else 0.0
        led_to = [p + dt_s * v for p, v in zip(before.position_m, before.velocity_m_s, strict=True)]
        change_m_s = dist(before.velocity_m_s, after.velocity_m_s)
        return (
            dist(led_to, after.position_m) <= self._limit_m
            and change_m_s <= SLACK_M_S + FASTEST_CHANGE_M_S2 * dt_s
        )

    def _deviation_m(self, before: PoseReport, after: PoseReport) -> float:
        """Return by how much a step exceeds what is allowed; 0 or less when it does not."""
        dt_s = (after.boot_ms - before.boot_ms) / 1e3
        allowed_m_s = SLACK_M_S if 0.0 <= dt_s <= GAP_S else FASTEST_M_S
        return hypot(*_off_course(before, after)) - self._limit_m - allowed_m_s * abs(dt_s)


def _off_course(before: PoseReport, after: PoseReport) -> Vector:
    """Return how far a report lies from where the one before it led; over a gap, from its place."""
    dt_s = (after.boot_ms - before.boot_ms) / 1e3
    if not 0.0 <= dt_s <= GAP_S:
        dt_s = 0.0
    north, east, down = (
        q - p - dt_s * (v + w) / 2.0
        for p, q, v, w in zip(
            before.position_m,
            after.position_m,
            before.velocity_m_s,
            after.velocity_m_s,
            strict=True,
        )
    )
    return north, east, down


class Pairwise:
    """Believes a number when it lies near the one of the message before it.

    Args:
        limit: Difference that is still believed.
        first: Believe the first number too. Not for what a vehicle may lack: there a forged
            message is the first, at any time of a flight.
    """

    def __init__(self, limit: float, *, first: bool = True) -> None:
        self._limit, self._first = limit, first
        self._last: float | None = None

    def believes(self, value: float) -> bool:
        """Take a number; tell whether it may be used."""
        last, self._last = self._last, value
        return self._first if last is None else abs(value - last) <= self._limit
