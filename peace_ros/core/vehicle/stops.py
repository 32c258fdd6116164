# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What keeps the vehicle from following our set-points, as far as the autopilot reports it; pure.

Sources: FENCE_STATUS, POSITION_TARGET_LOCAL_NED, BATTERY_STATUS, STATUSTEXT.
"""

from __future__ import annotations

from collections import deque
from math import dist, isfinite
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

Vector = tuple[float, float, float]
"""North, east, down."""
MESSAGES = frozenset({'FENCE_STATUS', 'POSITION_TARGET_LOCAL_NED', 'BATTERY_STATUS'})
FENCE_LIMIT_NS = 1_000_000_000
"""An older FENCE_STATUS says nothing of now."""
BATTERY_LIMIT_NS = 5_000_000_000
TEXT_LIMIT_NS = 3_000_000_000
"""A STATUSTEXT may explain what happens so long after it."""
BREACHES = {
    mavlink.FENCE_BREACH_MINALT: 'least altitude',
    mavlink.FENCE_BREACH_MAXALT: 'greatest altitude',
    mavlink.FENCE_BREACH_BOUNDARY: 'boundary',
}
LOW = {
    mavlink.MAV_BATTERY_CHARGE_STATE_LOW: 'low',
    mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL: 'critically low',
    mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY: 'so low that it must land at once',
    mavlink.MAV_BATTERY_CHARGE_STATE_FAILED: 'failed',
    mavlink.MAV_BATTERY_CHARGE_STATE_UNHEALTHY: 'unhealthy',
}
"""MAV_BATTERY_CHARGE_STATE of a battery that may end the flight, in words."""
SETTLED_NS = 1_000_000_000
"""Targets are judged once our set-points have flowed for so long,"""
PAUSE_NS = 500_000_000
"""without such a pause."""
NEW_NS = 1_500_000_000
"""The target that is reported should be one of our set-points of this time."""
OURS_NS = 5_000_000_000
"""One that we sent so long ago is not somebody else's: an autopilot that does not receive us keeps
the last one (ArduPilot for GUID_TIMEOUT, 3 s)."""
TOLERANCE_M_S = 0.15
RECENT, FOREIGN = 10, 4
"""So many of the recent targets must not be ours: some may be late, or older than the report of a
fence that changes them."""
CALM_NS = 3_000_000_000
"""A second commander counts as gone when no target of theirs was seen for so long."""
PLACE_IGNORED, VELOCITY_IGNORED = 0x007, 0x038
"""Bits of type_mask."""


class TargetWatch:
    """Compares the target that the autopilot follows with the set-points that we sent.

    A target is ours when each component lies between zero and that of one of our recent
    set-points: the autopilot may limit speeds, and stops when none come. Nobody is accused before
    one of our set-points was seen as the target: an autopilot may report something else.
    """

    def __init__(self) -> None:
        self._comparable = False
        """A target was one of our set-points."""
        self._told: deque[tuple[int, Vector]] = deque()
        """Steady clock and set-point: those of the last ``OURS_NS``."""
        self._since_ns = 0
        """Our set-points have flowed since then."""
        self._foreign: deque[bool] = deque(maxlen=RECENT)
        self._other: deque[bool] = deque(maxlen=RECENT)
        """Of the recent targets: none of our new set-points."""
        self._seen_ns = 0
        self._found = ''

    def tell(self, velocity_m_s: Vector, steady_ns: int) -> None:
        """Note a set-point that is sent now."""
        if not self._told or steady_ns - self._told[-1][0] > PAUSE_NS:
            self._since_ns = steady_ns
            self._foreign.clear()
            self._other.clear()
        self._told.append((steady_ns, velocity_m_s))
        while steady_ns - self._told[0][0] > OURS_NS:
            self._told.popleft()

    def take(self, message: Any, steady_ns: int, *, limited: bool) -> None:
        """Take POSITION_TARGET_LOCAL_NED; nothing is judged while a fence changes the target."""
        told = self._told
        flows = told and steady_ns - told[-1][0] <= PAUSE_NS
        if limited:
            self._foreign.clear()
        if limited or not flows or steady_ns - self._since_ns < SETTLED_NS:
            return
        velocity = (message.vx, message.vy, message.vz)
        unused = message.type_mask & VELOCITY_IGNORED
        is_place = unused == VELOCITY_IGNORED and not message.type_mask & PLACE_IGNORED
        if not is_place and (unused or not all(map(isfinite, velocity))):
            return
        foreign = is_place or not any(_explains(each, velocity) for _, each in told)
        self._foreign.append(foreign)
        new = (each for at_ns, each in told if steady_ns - at_ns <= NEW_NS)
        same = any(dist(each, velocity) <= TOLERANCE_M_S for each in new)
        self._other.append(not same)
        self._comparable = self._comparable or same
        if not foreign or not self._comparable or sum(self._foreign) < FOREIGN:
            return
        self._seen_ns = steady_ns
        what = 'a place' if is_place else '{:.1f}, {:.1f}, {:.1f} m/s'.format(*velocity)
        self._found = (
            f'a second commander: the autopilot follows a target that was not sent from here '
            f'({what} in POSITION_TARGET_LOCAL_NED); end the other one, or sign the connection'
        )

    @property
    def is_other(self) -> bool:
        """The autopilot does not follow our new set-points as they are."""
        return sum(self._other) >= FOREIGN

    def problem(self, steady_ns: int) -> str:
        """Return who else commands the vehicle, empty when nobody was seen lately."""
        return self._found if self._found and steady_ns - self._seen_ns <= CALM_NS else ''


class Stops:
    """Keeps the newest report of each thing that may stop the vehicle."""

    def __init__(self) -> None:
        self._targets = TargetWatch()
        self._fence = (0, '', False)
        """Steady clock, what it says, whether it limits the speed."""
        self._battery = (0, '')
        self._text = (0, '')

    def tell(self, velocity_m_s: Vector, steady_ns: int) -> None:
        """Note a set-point that is sent now."""
        self._targets.tell(velocity_m_s, steady_ns)

    def take(self, message: Any, steady_ns: int) -> None:
        """Take one of ``MESSAGES``."""
        kind = message.get_type()
        if kind == 'FENCE_STATUS':
            self._fence = (steady_ns, *_fence(message))
        elif kind == 'BATTERY_STATUS':
            self._battery = (steady_ns, LOW.get(message.charge_state, ''))
        elif kind == 'POSITION_TARGET_LOCAL_NED':
            self._targets.take(message, steady_ns, limited=self.limits_speed(steady_ns))

    def take_text(self, text: str, steady_ns: int) -> None:
        """Take a whole STATUSTEXT that warns."""
        self._text = (steady_ns, text)

    def fence(self, steady_ns: int) -> str:
        """Return what a fence does to the vehicle now, empty when nothing."""
        at_ns, words, _ = self._fence
        return words if steady_ns - at_ns <= FENCE_LIMIT_NS else ''

    def limits_speed(self, steady_ns: int) -> bool:
        """Return whether a fence makes the vehicle slower than it is told."""
        return bool(self.fence(steady_ns)) and self._fence[2]

    def other_commander(self, steady_ns: int) -> str:
        """Return who else commands the vehicle, empty when nobody was seen lately."""
        return self._targets.problem(steady_ns)

    def battery(self, steady_ns: int) -> str:
        """Return that the battery is low or broken, empty when it is not reported to be."""
        at_ns, words = self._battery
        fresh = words and steady_ns - at_ns <= BATTERY_LIMIT_NS
        return f'the battery is {words} (BATTERY_STATUS)' if fresh else ''

    def explanation(self, steady_ns: int) -> str:
        """Return what the autopilot reports that may explain its behaviour, empty without it."""
        at_ns, text = self._text
        said = f'"{text}"' if text and steady_ns - at_ns <= TEXT_LIMIT_NS else ''
        return '; '.join(filter(None, (self.fence(steady_ns), self.battery(steady_ns), said)))

    def hindrance(self, steady_ns: int) -> str:
        """Return the same, and whether it follows other targets than our new set-points."""
        other = (
            'the targets that it follows are not our newest set-points: it may not receive them, '
            'or limit them, or somebody else commands too'
        )
        known = (self.explanation(steady_ns), other if self._targets.is_other else '')
        return '; '.join(filter(None, known))


def _explains(told: Vector, target: Vector) -> bool:
    return all(
        min(0.0, ours) - TOLERANCE_M_S <= reported <= max(0.0, ours) + TOLERANCE_M_S
        for ours, reported in zip(told, target, strict=True)
    )


def _fence(message: Any) -> tuple[str, bool]:
    """Return what FENCE_STATUS says, and whether the fence limits the speed.

    ArduPilot reports a velocity limit while it keeps the vehicle inside, without the type of the
    fence, and the type once it is crossed.
    """
    if message.breach_mitigation == mavlink.FENCE_MITIGATE_VEL_LIMIT:
        return 'a fence limits the speed of the vehicle (FENCE_STATUS)', True
    if message.breach_status:
        which = BREACHES.get(message.breach_type, 'type unknown')
        return f'the vehicle is outside of its fence ({which}, FENCE_STATUS)', False
    return '', False
