# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The last word on every set-point: knows nothing of states, only ever makes motion smaller.

Each component of what leaves lies between zero and what came in, so that zero stays zero, a
climb never becomes a descent, and the most restrictive limit wins.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot, inf, isfinite

from peace_ros.core.domain import Pose, Setpoint, Site
from peace_ros.core.landing.parameters import CELL_SCORE_FLOOR, LandingParameters

_NS = 1e-9
_STEP_LIMIT_S = 0.5
"""A late step does not earn a larger change of the set-point than this much time would."""
_REACTION_S = 1.0
"""Time constant of the slow-down above the floor and before the fence: the measured autopilot
passes 0.7 m beyond at 1 m/s (vertical), 7 m at 5 m/s (lateral)."""
_FENCE_REACTION_S = 1.5


@dataclass(frozen=True)
class GuardInput:
    """What the guard looks at besides the wish; None is unknown."""

    now_ns: int
    pose: Pose | None
    telemetry_age_s: float
    map_age_s: float
    home: tuple[float, float] | None
    """North and east of where the landing began."""
    site: Site | None = None
    """The SITE of the verdict, None without one."""
    ground_score: float = 0.0
    """Worst safety score of the map under the vehicle and its radius; 0 is unknown."""
    ground_age_s: float = inf
    """Age of the oldest look at that ground."""


class Guard:
    """Limits speed, growth of speed, floor, fence, ages of data, and what descent is above."""

    def __init__(self, parameters: LandingParameters) -> None:
        self._p = parameters
        self._last = Setpoint(0)
        self._last_ns: int | None = None

    def limit(self, wish: Setpoint, given: GuardInput) -> tuple[Setpoint, tuple[str, ...]]:
        """Return what may be flown, and a note for each limit that acted."""
        notes: list[str] = []
        allowed = wish
        rules = (_finite, self._ages, self._ground, self._floor, self._speed, self._fence)
        for rule in rules:
            limited, note = rule(allowed, given)
            if limited != allowed:
                notes.append(note)
            allowed = limited
        limited = self._growth(allowed, given.now_ns)
        if limited != allowed:
            notes.append('acceleration limited')
        self._last, self._last_ns = limited, given.now_ns
        return limited, tuple(notes)

    def _ages(self, wish: Setpoint, given: GuardInput) -> tuple[Setpoint, str]:
        pose = given.pose
        if pose is None or not given.telemetry_age_s <= self._p.telemetry_age_limit_s:
            return Setpoint(wish.stamp_ns), 'stopped: telemetry is missing or old'
        if not isfinite(pose.north_m) or not isfinite(pose.east_m):
            return Setpoint(wish.stamp_ns), 'stopped: the position is not a number'
        if wish.v_down_m_s > 0.0 and not given.map_age_s <= self._p.descent_heatmap_age_limit_s:
            return replace(wish, v_down_m_s=0.0), 'descent stopped: the map is old'
        return wish, ''

    def _ground(self, wish: Setpoint, given: GuardInput) -> tuple[Setpoint, str]:
        """Down only within the clearance of a SITE, on ground that the map has just seen safe."""
        if wish.v_down_m_s <= 0.0 or given.pose is None:
            return wish, ''
        site = given.site
        if site is None or not (
            site.distance_m(given.pose) + self._p.safety_radius_m <= site.clearance_m
        ):
            return replace(wish, v_down_m_s=0.0), 'descent stopped: no site under the vehicle'
        if not given.ground_score >= CELL_SCORE_FLOOR:
            return replace(wish, v_down_m_s=0.0), 'descent stopped: the ground below is not safe'
        if not given.ground_age_s <= self._p.descent_heatmap_age_limit_s:
            return replace(wish, v_down_m_s=0.0), 'descent stopped: the ground below is not in view'
        return wish, ''

    def _floor(self, wish: Setpoint, given: GuardInput) -> tuple[Setpoint, str]:
        if wish.v_down_m_s <= 0.0 or given.pose is None:
            return wish, ''
        room_m = given.pose.altitude_agl_m - self._p.handover_altitude_m
        if not isfinite(room_m) or given.pose.altitude_agl_m > self._p.altitude_limit_m:
            return replace(wish, v_down_m_s=0.0), 'descent stopped: altitude is not valid'
        allowed = max(0.0, room_m / _REACTION_S)
        if wish.v_down_m_s <= allowed:
            return wish, ''
        return replace(wish, v_down_m_s=allowed), 'descent limited: the floor is near'

    def _speed(self, wish: Setpoint, _given: GuardInput) -> tuple[Setpoint, str]:
        lateral = hypot(wish.v_north_m_s, wish.v_east_m_s)
        scale = min(1.0, self._p.lateral_speed_limit / lateral) if lateral > 0.0 else 1.0
        down = min(self._p.z_speed_landing, max(-self._p.z_speed_climbing, wish.v_down_m_s))
        return (
            Setpoint(wish.stamp_ns, wish.v_north_m_s * scale, wish.v_east_m_s * scale, down),
            'speed limited',
        )

    def _fence(self, wish: Setpoint, given: GuardInput) -> tuple[Setpoint, str]:
        radius = self._p.geofence_radius_m
        if radius == 0.0 or given.pose is None or given.home is None:
            return wish, ''
        north, east = given.pose.north_m - given.home[0], given.pose.east_m - given.home[1]
        distance = hypot(north, east)
        outward = 0.0
        if distance > 0.0:
            outward = (wish.v_north_m_s * north + wish.v_east_m_s * east) / distance
        allowed = max(0.0, (radius - distance) / _FENCE_REACTION_S)
        # Also a speed across the radius leads out when the room is used up by it.
        if outward <= allowed:
            return wish, ''
        scale = allowed / outward
        limited = Setpoint(
            wish.stamp_ns, wish.v_north_m_s * scale, wish.v_east_m_s * scale, wish.v_down_m_s
        )
        return limited, 'stopped at the fence' if scale == 0.0 else 'slowed before the fence'

    def _growth(self, wish: Setpoint, now_ns: int) -> Setpoint:
        elapsed_s = 0.1
        if self._last_ns is not None:
            elapsed_s = min(_STEP_LIMIT_S, max(0.0, (now_ns - self._last_ns) * _NS))
        room = self._p.acceleration_limit * elapsed_s
        return Setpoint(
            wish.stamp_ns,
            _grown(self._last.v_north_m_s, wish.v_north_m_s, room),
            _grown(self._last.v_east_m_s, wish.v_east_m_s, room),
            _grown(self._last.v_down_m_s, wish.v_down_m_s, room),
        )


def _finite(wish: Setpoint, _given: GuardInput) -> tuple[Setpoint, str]:
    if all(isfinite(v) for v in (wish.v_north_m_s, wish.v_east_m_s, wish.v_down_m_s)):
        return wish, ''
    return Setpoint(wish.stamp_ns), 'stopped: the set-point was not finite'


def _grown(last: float, wish: float, room: float) -> float:
    """Move from the last value towards the wish: away from zero by room at most, to it at once."""
    start = last if last * wish > 0.0 else 0.0
    if wish >= 0.0:
        return min(wish, start + room)
    return max(wish, start - room)
