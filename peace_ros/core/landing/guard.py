# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The last check of every set-point: knows nothing of states, and only makes motion smaller.

Each component of the result lies between zero and what was asked for: zero stays zero, a climb
never becomes a descent, and the most restrictive limit wins.
"""

from __future__ import annotations

from dataclasses import replace
from math import copysign, hypot, isfinite

from peace_ros.core.domain import Pose, Setpoint
from peace_ros.core.landing.parameters import CELL_SCORE_FLOOR, LandingParameters
from peace_ros.core.landing.situation import Situation

_NS = 1e-9
_STEP_LIMIT_S = 0.5
"""After a late step the set-point grows by no more than this time allows."""
_REACTION_S = 1.0
"""Time constants of the slow-down above the floor and before the fence: the measured autopilot
overshoots by 0.7 m at 1 m/s (vertical) and by 7 m at 5 m/s (lateral)."""
_FENCE_REACTION_S = 1.5


class Guard:
    """Limits speed, growth of speed, floor, fence, ages of data, and what descent is above."""

    def __init__(self, parameters: LandingParameters) -> None:
        self._p = parameters
        self._last = Setpoint(0)
        self._last_ns: int | None = None

    def limit(self, wish: Setpoint, given: Situation) -> tuple[Setpoint, tuple[str, ...]]:
        """Return what may be flown, and a note for each limit that acted."""
        notes: list[str] = []
        allowed = wish
        for rule in (_finite, self._data, self._descent, self._floor, self._speed, self._fence):
            limited, note = rule(allowed, given)
            if limited != allowed:
                notes.append(note)
            allowed = limited
        limited = self._growth(allowed, given.now_ns)
        if limited != allowed:
            notes.append('acceleration limited')
        self._last, self._last_ns = limited, given.now_ns
        return limited, tuple(notes)

    def _data(self, wish: Setpoint, given: Situation) -> tuple[Setpoint, str]:
        """No motion at all without a position of now."""
        pose = given.pose
        if pose is None or not given.telemetry_age_s <= self._p.telemetry_age_limit_s:
            return Setpoint(wish.stamp_ns), 'stopped: telemetry is missing or old'
        if not pose.has_position:
            return Setpoint(wish.stamp_ns), 'stopped: the position is not a number'
        return wish, ''

    def _descent(self, wish: Setpoint, given: Situation) -> tuple[Setpoint, str]:
        """Down only within the clearance of a SITE, on ground that the map has just seen safe.

        A search may also go down to its floor, above the safe altitude.
        """
        p, pose, seen = self._p, given.pose, given.sighting
        site = seen.verdict.site
        if wish.v_down_m_s <= 0.0 or pose is None:
            return wish, ''
        if not seen.map_age_s <= p.descent_heatmap_age_limit_s:
            problem = 'the map is old'
        elif not pose.altitude_agl_m <= p.altitude_limit_m:
            problem = 'the altitude is not valid'
        elif self._above_search_floor(pose, given):
            return wish, ''
        elif site is None or not site.distance_m(pose) + p.safety_radius_m <= site.clearance_m:
            problem = 'no site under the vehicle'
        elif not seen.ground_score >= CELL_SCORE_FLOOR:
            problem = 'the ground below is not safe'
        elif not seen.ground_age_s <= p.descent_heatmap_age_limit_s:
            problem = 'the ground below is not in view'
        else:
            return wish, ''
        return replace(wish, v_down_m_s=0.0), f'descent stopped: {problem}'

    def _above_search_floor(self, pose: Pose, given: Situation) -> bool:
        if given.search_floor_m is None:
            return False
        lowest_m = pose.altitude_agl_m - given.above_lowest_m
        return lowest_m > max(given.search_floor_m, self._p.safe_altitude_m)

    def _floor(self, wish: Setpoint, given: Situation) -> tuple[Setpoint, str]:
        if given.pose is None:
            return wish, ''
        height_m = given.pose.altitude_agl_m - given.above_lowest_m
        room_m = height_m - self._p.handover_altitude_m
        down = min(wish.v_down_m_s, _slow_enough(room_m, _REACTION_S))
        return replace(wish, v_down_m_s=down), 'descent limited: the floor is near'

    def _speed(self, wish: Setpoint, _given: Situation) -> tuple[Setpoint, str]:
        limit = self._p.lateral_speed_limit
        scale = limit / max(limit, hypot(wish.v_north_m_s, wish.v_east_m_s))
        down = min(self._p.z_speed_landing, max(-self._p.z_speed_climbing, wish.v_down_m_s))
        return (
            Setpoint(wish.stamp_ns, wish.v_north_m_s * scale, wish.v_east_m_s * scale, down),
            'speed limited',
        )

    def _fence(self, wish: Setpoint, given: Situation) -> tuple[Setpoint, str]:
        radius = self._p.geofence_radius_m
        if radius == 0.0 or given.pose is None or given.home is None:
            return wish, ''
        north, east = given.pose.north_m - given.home.north_m, given.pose.east_m - given.home.east_m
        distance = hypot(north, east)
        outward = 0.0
        if distance > 0.0:
            outward = (wish.v_north_m_s * north + wish.v_east_m_s * east) / distance
        allowed = _slow_enough(radius - distance, _FENCE_REACTION_S)
        if outward <= allowed:
            return wish, ''
        # Both components shrink: the direction stays.
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


def _finite(wish: Setpoint, _given: Situation) -> tuple[Setpoint, str]:
    if all(isfinite(v) for v in (wish.v_north_m_s, wish.v_east_m_s, wish.v_down_m_s)):
        return wish, ''
    return Setpoint(wish.stamp_ns), 'stopped: the set-point was not finite'


def _slow_enough(room_m: float, reaction_s: float) -> float:
    """Return the highest speed towards a limit that is ``room_m`` away, 0 beyond it."""
    return max(0.0, room_m / reaction_s)


def _grown(last: float, wish: float, room: float) -> float:
    """Return the wish, at most ``room`` farther from zero than the last; stops are at once."""
    start = abs(last) if last * wish > 0.0 else 0.0
    return copysign(min(abs(wish), start + room), wish)
