# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Velocity set-points of each state: towards the site, then down over it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import hypot

from peace_ros.core.domain import Pose, Setpoint, Site
from peace_ros.core.landing.parameters import LandingParameters
from peace_ros.core.landing.situation import Situation
from peace_ros.core.landing.states import STILL_STATES, State
from peace_ros.core.landing.watch import at_safe_altitude

_FLOOR_GAIN = 0.6
"""1/s: descent speed per metre of height left. The autopilot, which overshoots by 0.7 m at 1 m/s,
stops above the floor with it."""
_CREEP_M_S = 0.3
_HIGHEST_SEARCH_M = 120.0
_NEAR_M = 1.0
"""Of the altitude of the search."""
_Wish = tuple[tuple[float, float, float], str]
"""Speed to the north, to the east and down, and what motion waits for."""
_STAND = (0.0, 0.0, 0.0)


def over_site(pose: Pose, site: Site, radius_m: float) -> bool:
    """Return whether the vehicle and its radius lie within the clearance of the site."""
    return site.distance_m(pose) + radius_m <= site.clearance_m


def velocity(
    state: State, situation: Situation, parameters: LandingParameters
) -> tuple[Setpoint, str]:
    """Return the set-point before the guard, and what motion waits for (empty: nothing)."""
    stamp_ns, fly = situation.sighting.stamp_ns, _FLIGHTS.get(state)
    if situation.pose is None or fly is None or state in STILL_STATES:
        return Setpoint(stamp_ns), ''
    (north, east, down), note = fly(situation.pose, situation, parameters)
    return Setpoint(stamp_ns, north, east, down), note


def _towards(
    pose: Pose, north_m: float, east_m: float, gain: float, limit_m_s: float
) -> tuple[float, float]:
    """Return north and east speed, proportional to the error in metres up to a limit.

    With gain 0.5 the distance left, 2 s x speed, exceeds the measured distances of stopping
    (3.1 m at 3 m/s, 7.0 m at 5 m/s) at every speed.
    """
    north, east = north_m - pose.north_m, east_m - pose.east_m
    distance = hypot(north, east)
    if distance < 1e-6:
        return 0.0, 0.0
    speed = min(limit_m_s, gain * distance)
    return speed * north / distance, speed * east / distance


def _descent_speed(altitude_m: float, parameters: LandingParameters) -> float:
    p = parameters
    speed = p.z_gain_landing * p.z_speed_landing * altitude_m
    return min(p.z_speed_landing, max(p.z_min_speed_landing, speed))


def _down(
    pose: Pose,
    situation: Situation,
    parameters: LandingParameters,
    *,
    floor_m: float,
    tolerance_m: float,
    share: float,
) -> tuple[float, str]:
    """Return the speed of descent towards a floor, and what it waits for.

    Args:
        pose: Of the vehicle.
        situation: With the site below.
        parameters: Speeds.
        floor_m: Altitude at which the descent ends.
        tolerance_m: Distance to the middle of the site from which on nothing descends.
        share: Of the usual speed.
    """
    site, room_m = situation.site, pose.altitude_agl_m - situation.above_lowest_m - floor_m
    if site is None or room_m <= 0.0:
        return 0.0, ''
    if not situation.sighting.ground_is_fresh:
        return 0.0, 'waiting for a fresh look at the ground below'
    error_m = site.distance_m(pose)
    if not error_m < tolerance_m:
        limit_m = max(tolerance_m, 0.0)
        return 0.0, f'{error_m:.1f} m beside the site: descends within {limit_m:.1f} m'
    # Full speed within half of the tolerance, none at its edge.
    centred = min(1.0, 2.0 * (1.0 - error_m / tolerance_m))
    speed = share * _descent_speed(pose.altitude_agl_m, parameters) * centred
    return min(speed, max(_CREEP_M_S, _FLOOR_GAIN * room_m)), ''


def _lateral_to_site(
    pose: Pose, situation: Situation, parameters: LandingParameters, gain: float
) -> tuple[float, float]:
    limit_m_s, site = parameters.lateral_speed_limit, situation.site
    if site is None:
        return 0.0, 0.0
    if not at_safe_altitude(pose, parameters, situation.above_lowest_m):
        if site.distance_m(pose) > site.clearance_m:
            return 0.0, 0.0
        limit_m_s = min(limit_m_s, parameters.landing_lateral_speed_limit)
    return _towards(pose, site.north_m, site.east_m, gain, limit_m_s)


def _aim(pose: Pose, situation: Situation, parameters: LandingParameters) -> _Wish:
    p, site = parameters, situation.site
    north, east = _lateral_to_site(pose, situation, p, p.gain * p.aiming_gain_mult)
    tolerance_m = 0.0 if site is None else site.clearance_m - p.safety_radius_m
    floor_m = p.aiming_floor * p.safe_altitude_m
    down, note = _down(pose, situation, p, floor_m=floor_m, tolerance_m=tolerance_m, share=0.5)
    return (north, east, down), note


def _land(pose: Pose, situation: Situation, parameters: LandingParameters) -> _Wish:
    p, site = parameters, situation.site
    north, east = _lateral_to_site(pose, situation, p, p.gain)
    room_m = 0.0 if site is None else site.clearance_m - p.safety_radius_m
    tolerance_m = min(max(0.5, 0.5 * room_m), room_m)
    floor_m = p.handover_altitude_m
    down, note = _down(pose, situation, p, floor_m=floor_m, tolerance_m=tolerance_m, share=1.0)
    return (north, east, down), note


def _climb(_pose: Pose, _situation: Situation, parameters: LandingParameters) -> _Wish:
    return (0.0, 0.0, -parameters.z_speed_climbing), ''


def _search(pose: Pose, situation: Situation, parameters: LandingParameters) -> _Wish:
    """Look from where the landing began, from elsewhere, and then from lower down.

    All of it where lateral motion meets no obstacle.
    """
    p = parameters
    safe = at_safe_altitude(pose, p, situation.above_lowest_m)
    if not safe or situation.site is not None:
        return _STAND, 'looking'
    begun_m = (situation.home or pose).altitude_agl_m
    down = _to_altitude(pose, situation, min(begun_m, _HIGHEST_SEARCH_M), p)
    if situation.search_target is None:
        return (0.0, 0.0, down), 'looking'
    north, east = _towards(pose, *situation.search_target, p.gain, p.search_speed)
    note = 'flying an expanding square'
    return (north, east, down), f'{note} lower down' if situation.search_floor_m else note


def _to_altitude(
    pose: Pose, situation: Situation, begun_m: float, parameters: LandingParameters
) -> float:
    """Return the speed down to the altitude of the search; within a metre of it none."""
    p, floor_m = parameters, situation.search_floor_m
    wanted_m = begun_m if floor_m is None else min(begun_m, floor_m)
    missing_m = wanted_m - pose.altitude_agl_m
    if missing_m > _NEAR_M:
        return -min(p.z_speed_climbing, 0.5 * missing_m)
    if floor_m is None:
        return 0.0
    room_m = pose.altitude_agl_m - situation.above_lowest_m - floor_m
    if room_m <= _NEAR_M:
        return 0.0
    return min(0.5 * _descent_speed(pose.altitude_agl_m, p), 0.5 * room_m)


def _return(pose: Pose, situation: Situation, parameters: LandingParameters) -> _Wish:
    """Up to where lateral motion meets no obstacle, then straight home."""
    p, home = parameters, situation.home
    if home is None:
        return _STAND, 'where the landing began is not known'
    if not at_safe_altitude(pose, p, situation.above_lowest_m):
        return _climb(pose, situation, p)
    north, east = _towards(pose, home.north_m, home.east_m, p.gain, p.search_speed)
    return (north, east, 0.0), ''


_FLIGHTS: dict[State, Callable[[Pose, Situation, LandingParameters], _Wish]] = {
    State.AIMING: _aim,
    State.LANDING: _land,
    State.CLIMBING: _climb,
    State.SEARCHING: _search,
    State.RESTARTING: _search,
    State.RETURNING: _return,
}
"""States that move; in every other one the vehicle hovers."""


class ExpandingSquare:
    """Way-points of an expanding square (IAMSAR), clockwise from north; restarts at its limit."""

    _ARRIVED_M = 5.0
    _TURNS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))

    def __init__(self, home: tuple[float, float], spacing_m: float, radius_m: float) -> None:
        self.way = tuple(self._way_points(home, spacing_m, radius_m))
        """Home and the way-points of one round (north, east), all within the radius of home."""
        self._next = 0
        self.advance()

    def _way_points(
        self, home: tuple[float, float], spacing_m: float, radius_m: float
    ) -> Iterator[tuple[float, float]]:
        (north, east), leg = home, 0
        while hypot(north - home[0], east - home[1]) <= radius_m:
            yield north, east
            turn_north, turn_east = self._TURNS[leg % 4]
            north += turn_north * (leg // 2 + 1) * spacing_m
            east += turn_east * (leg // 2 + 1) * spacing_m
            leg += 1

    def advance(self) -> None:
        """Go on to the next way-point: this one is reached, or cannot be."""
        rounds = max(1, len(self.way) - 1)
        self._next = min(self._next % rounds + 1, len(self.way) - 1)

    def target(self, pose: Pose) -> tuple[float, float]:
        """Return the way-point to fly to from here (north, east)."""
        north, east = self.way[self._next]
        if hypot(north - pose.north_m, east - pose.east_m) <= self._ARRIVED_M:
            self.advance()
        return self.way[self._next]
