# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""False accusations and late ones: does the obedience watch tell faults from biased estimates?

``python -m peace_ros.lab.evaluation.obedience --hours 3`` flies random sequences of set-points
like those of landings against the physics and the offboard mode of the simulated autopilots, in
simulated time, with errors of the estimates larger than the measured ones. Then it breaks the
reported position, with or without the velocity, where a leg begins, and measures how long the
watch takes.
"""

from __future__ import annotations

import argparse
import sys
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import cos, hypot, pi, sin
from random import Random

from peace_ros.core.domain import Pose, Setpoint
from peace_ros.core.domain.geometry import lean_acceleration
from peace_ros.core.landing.drift import Drift
from peace_ros.core.vehicle.obedience import ObedienceWatch, ReportedMotion
from peace_ros.lab.evaluation.wind import flying
from peace_ros.simulation.autopilot.estimate_errors import PX4_ERRORS, ErrorSizes, EstimateErrors
from peace_ros.simulation.autopilot.guided import PositionTarget
from peace_ros.simulation.autopilot.personality import Kind, Personality
from peace_ros.simulation.autopilot.physics import Physics

TIME_LIMIT_S, WAY_LIMIT_M = 3.0, 4.0
"""A fault has to be found within both."""
LEG_SPEEDS_M_S = (1.0, 1.5, 2.0, 3.0)
_TICK_S = 0.02
_REPORT_S = 0.04
_DELAY_S = 0.06
"""Age of a report when it is heard."""
_STALL_SHARE, _STALL_S = 0.02, 0.45
"""After so many reports none comes for so long, as on a busy machine."""
_FLIGHT_S = 180.0
_HOVER_S, _HOVER_M_S = 6.0, 1.5
_FASTEST_M_S = 5.0
_LEVEL = (1.0, 0.0, 0.0, 0.0)
_GUST_SHARE = 0.3
_VELOCITY_AND_RATE = 0x5C7
_LOCAL_NED = 1
_GUIDE_GAIN = 0.5

Plane = tuple[float, float]
FAULTS: dict[str, tuple[Plane, Plane]] = {
    'swapped axes': ((0.0, 1.0), (1.0, 0.0)),
    'swapped signs': ((-1.0, 0.0), (0.0, -1.0)),
    'frozen': ((0.0, 0.0), (0.0, 0.0)),
    'frozen, with noise': ((0.0, 0.0), (0.0, 0.0)),
}
"""Reported way since the fault began (rows: north, east) of the true one."""
_EXACT = 'frozen'


@dataclass(frozen=True)
class BrokenLeg:
    """What is broken, and the speed of the leg that shows it."""

    fault: str
    velocity_too: bool
    speed_m_s: float


@dataclass(frozen=True)
class Found:
    """One fault."""

    seconds: float
    """From the begin of the leg; infinite: never."""
    way_m: float
    """True way over ground."""
    sentence: str

    @property
    def in_time(self) -> bool:
        """Whether it kept the limits."""
        return self.seconds <= TIME_LIMIT_S and self.way_m <= WAY_LIMIT_M


class WatchedFlight:
    """A vehicle in the air whose reports the watch sees.

    Args:
        kind: Which autopilot.
        sizes: Errors of its estimates.
        wind_m_s: Mean speed of the wind; its direction comes from the seed.
        seed: Of wind, errors and set-points.
    """

    def __init__(self, kind: Kind, sizes: ErrorSizes, wind_m_s: float, seed: int) -> None:
        self.random = Random(seed)
        turn = self.random.uniform(0.0, 2.0 * pi)
        wind = (wind_m_s * cos(turn), wind_m_s * sin(turn))
        physics = Physics(wind_to_m_s=wind, gust_m_s=_GUST_SHARE * wind_m_s, seed=seed)
        self.flight = flying(physics, Personality(kind), EstimateErrors(sizes, seed))
        self.watch = ObedienceWatch()
        self._line = Random(seed)
        self._fault, self._velocity_too = '', False
        self._fault_at_m: Plane = (0.0, 0.0)
        self._reports: deque[tuple[float, ReportedMotion]] = deque()
        self._due_s = self.flight.time_s

    @property
    def seen_m(self) -> tuple[float, float, float]:
        """The position that is reported now."""
        north, east, down = self.flight.position_m
        if not self._fault:
            return north, east, down
        physics, begun = self.flight.physics, self._fault_at_m
        way = self._distorted((physics.north_m - begun[0], physics.east_m - begun[1]))
        noise = (0.0, 0.0) if self._fault == _EXACT else self.flight.errors.position_m
        return begun[0] + way[0] + noise[0], begun[1] + way[1] + noise[1], down

    @property
    def seen_m_s(self) -> Plane:
        """The horizontal velocity that is reported now."""
        north, east, _ = self.flight.velocity_m_s
        return self._distorted((north, east)) if self._velocity_too else (north, east)

    def _distorted(self, way: Plane) -> Plane:
        (nn, ne), (en, ee) = FAULTS[self._fault]
        return nn * way[0] + ne * way[1], en * way[0] + ee * way[1]

    def break_position(self, fault: str, *, velocity_too: bool) -> None:
        """Put in a fault; the position goes on from where it is."""
        self._fault, self._velocity_too = fault, velocity_too
        self._fault_at_m = (self.flight.physics.north_m, self.flight.physics.east_m)

    def tick(self, velocity: tuple[float, float, float]) -> str:
        """Fly on with a set-point; return why the position is not believed."""
        flight = self.flight
        flight.take_velocity(PositionTarget(_LOCAL_NED, _VELOCITY_AND_RATE, velocity))
        self.watch.tell(velocity, round(flight.time_s * 1e9))
        flight.step(_TICK_S)
        if flight.time_s + 1e-9 >= self._due_s:
            stalls = self._line.random() < _STALL_SHARE
            self._due_s += _STALL_S if stalls else _REPORT_S
            lean = lean_acceleration(flight.physics.quaternion_ned_frd)
            motion = ReportedMotion(self.seen_m, self.seen_m_s, lean)
            self._reports.append((flight.time_s, motion))
        while self._reports and self._reports[0][0] + _DELAY_S <= flight.time_s:
            at_s, motion = self._reports.popleft()
            self.watch.take(motion, round(at_s * 1e9))
        return self.watch.problem

    def guided(self, target_m: Plane, limit_m_s: float) -> Plane:
        """Return the velocity towards a place, as the landing guides."""
        north, east = target_m[0] - self.seen_m[0], target_m[1] - self.seen_m[1]
        distance = hypot(north, east)
        speed = min(limit_m_s, _GUIDE_GAIN * distance)
        return (speed * north / distance, speed * east / distance) if distance else (0.0, 0.0)


def accusation(flown: WatchedFlight, seconds: float) -> str:
    """Fly like landings do: sites, searches, stops, climbs; return the accusation, if any."""
    chance, until_s = flown.random, flown.flight.time_s + seconds
    while flown.flight.time_s < until_s:
        leg_s = chance.uniform(1.0, 15.0)
        kind = chance.choice(('site', 'site', 'leg', 'stop', 'down', 'climb'))
        limit_m_s = chance.choice((1.5, 5.0))
        at = flown.seen_m
        target = (at[0] + chance.uniform(-30.0, 30.0), at[1] + chance.uniform(-30.0, 30.0))
        turn, speed = chance.uniform(0.0, 2.0 * pi), chance.uniform(0.3, 3.0)
        end_s = min(until_s, flown.flight.time_s + leg_s)
        while flown.flight.time_s < end_s:
            north, east, down = 0.0, 0.0, 0.0
            low = -flown.flight.physics.down_m < 20.0
            if kind in {'site', 'down'}:
                north, east = flown.guided(target if kind == 'site' else at[:2], limit_m_s)
            if kind == 'down' and not low:
                down = min(speed, 2.0)
            elif kind == 'climb' or low:
                down = -1.0
            elif kind == 'leg':
                north, east = speed * cos(turn), speed * sin(turn)
            if problem := flown.tick((north, east, down)):
                return problem
    return ''


def find(flown: WatchedFlight, broken: BrokenLeg) -> Found:
    """Hover over a place, break the position, tell one leg; return when it was found.

    As in a landing, what the vehicle is told makes up for its drift: a vehicle that truly goes to
    the north-east while it is told to go north shows no swapped axes.
    """
    place, drift, told = flown.seen_m[:2], Drift(), Setpoint(0)
    until_s = flown.flight.time_s + _HOVER_S
    while flown.flight.time_s < until_s:
        north, east, down = flown.seen_m
        stamp_ns = round(flown.flight.time_s * 1e9)
        drift.see(Pose(stamp_ns, north, east, down, _LEVEL, -down), told)
        told = drift.made_up(Setpoint(0, *flown.guided(place, _HOVER_M_S)), _HOVER_M_S)
        flown.tick((told.v_north_m_s, told.v_east_m_s, 0.0))
    flown.break_position(broken.fault, velocity_too=broken.velocity_too)
    turn = flown.random.uniform(0.0, 2.0 * pi)
    if broken.fault == 'swapped axes':  # a leg to the north-east looks the same
        turn = flown.random.choice((0.0, 0.5, 1.0, 1.5)) * pi + flown.random.uniform(-0.25, 0.25)
    wish = Setpoint(0, broken.speed_m_s * cos(turn), broken.speed_m_s * sin(turn))
    told = drift.made_up(wish, _FASTEST_M_S)
    velocity = (told.v_north_m_s, told.v_east_m_s, 0.0)
    begin_s, physics = flown.flight.time_s, flown.flight.physics
    begun = (physics.north_m, physics.east_m)
    while flown.flight.time_s < begin_s + 20.0:
        problem = flown.tick(velocity)
        if problem:
            way_m = hypot(physics.north_m - begun[0], physics.east_m - begun[1])
            return Found(round(flown.flight.time_s - begin_s, 2), round(way_m, 2), problem)
    return Found(float('inf'), float('inf'), '')


def main(args: Sequence[str] | None = None) -> int:
    """Fly from the command line; 1 when something was accused falsely or found late."""
    parser = argparse.ArgumentParser(
        prog='python -m peace_ros.lab.evaluation.obedience',
        description=(__doc__ or '').splitlines()[0],
    )
    parser.add_argument('--hours', type=float, default=3.0, help='without a fault, per autopilot')
    parser.add_argument('--trials', type=int, default=20, help='of each fault and speed')
    parser.add_argument('--errors', type=float, default=2.0, help='times those measured on PX4')
    parser.add_argument('--wind', type=float, default=8.0, help='the strongest, m/s')
    parser.add_argument('--seed', type=int, default=1, help='of the first flight')
    given = parser.parse_args(args)
    sizes = {Kind.PX4: PX4_ERRORS.times(given.errors), Kind.ARDUPILOT: ErrorSizes()}
    failed = 0
    for kind, size in sizes.items():
        flights = round(given.hours * 3600.0 / _FLIGHT_S)
        false = 0
        for seed in range(given.seed, given.seed + flights):
            wind_m_s = Random(seed).uniform(0.0, given.wind)
            problem = accusation(WatchedFlight(kind, size, wind_m_s, seed), _FLIGHT_S)
            if problem:
                false += 1
                sys.stdout.write(f'{kind.value}, seed {seed}, wind {wind_m_s:.1f} m/s: {problem}\n')
        hours = flights * _FLIGHT_S / 3600.0
        sys.stdout.write(f'{kind.value}: {false} false accusations in {hours:g} h\n')
        failed += false
        for fault, velocity_too in product(FAULTS, (True, False)):
            for speed_m_s in LEG_SPEEDS_M_S:
                broken = BrokenLeg(fault, velocity_too, speed_m_s)
                failed += given.trials - _trials(kind, size, broken, given)
    return 0 if failed == 0 else 1


def _trials(kind: Kind, size: ErrorSizes, broken: BrokenLeg, given: argparse.Namespace) -> int:
    all_found = []
    for seed in range(given.seed, given.seed + given.trials):
        wind_m_s = Random(seed).uniform(0.0, given.wind)
        all_found.append(find(WatchedFlight(kind, size, wind_m_s, seed), broken))
    count = sum(each.in_time for each in all_found)
    if all_found:
        of = 'position and velocity' if broken.velocity_too else 'position only'
        sys.stdout.write(
            f'{kind.value}, {of}, {broken.fault} at {broken.speed_m_s:g} m/s: {count} of '
            f'{len(all_found)} within {TIME_LIMIT_S:g} s and {WAY_LIMIT_M:g} m; the latest after '
            f'{max(each.seconds for each in all_found):g} s, '
            f'{max(each.way_m for each in all_found):g} m\n'
        )
        sys.stdout.flush()
    return count


if __name__ == '__main__':
    sys.exit(main())
