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
from copy import deepcopy
from dataclasses import dataclass
from itertools import product
from math import cos, hypot, inf, pi, sin
from random import Random

from peace_ros.core.domain import Pose, Setpoint
from peace_ros.core.domain.geometry import lean_acceleration
from peace_ros.core.landing.drift import Drift
from peace_ros.core.vehicle.obedience import ObedienceWatch, ReportedMotion
from peace_ros.simulation.autopilot.estimate_errors import PX4_ERRORS, ErrorSizes, EstimateErrors
from peace_ros.simulation.autopilot.flight import Flight
from peace_ros.simulation.autopilot.guided import PositionTarget
from peace_ros.simulation.autopilot.hovering import hovering
from peace_ros.simulation.autopilot.personality import Kind, Personality
from peace_ros.simulation.autopilot.physics import Physics

TIME_LIMIT_S, WAY_LIMIT_M = 3.0, 4.0
"""A fault has to be found within both."""
LEG_SPEEDS_M_S = (1.0, 1.5, 2.0, 3.0)
_START_M = 60.0
_TICK_S = 0.02
_REPORT_S = 0.04
_DELAY_S = 0.06
"""Age of a report when it is heard."""
_STALL_SHARE, _STALL_S = 0.02, 0.45
"""After so many reports none comes for so long, as on a busy machine."""
_FLIGHT_S = 180.0
_HOVER_S, _HOVER_M_S = 6.0, 1.5
_FASTEST_M_S = 5.0
_LEG_S = 10.0
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
_EXACT, _SWAPPED = 'frozen', 'swapped axes'


@dataclass(frozen=True)
class BrokenReport:
    """What is wrong with the reports since the vehicle was at a place."""

    fault: str
    velocity_too: bool
    at_m: Plane

    def of(self, flight: Flight) -> tuple[Plane, Plane]:
        """Return the reported position and velocity, north and east."""
        north, east, _ = flight.velocity_m_s
        going = self._distorted((north, east)) if self.velocity_too else (north, east)
        true = (flight.physics.north_m - self.at_m[0], flight.physics.east_m - self.at_m[1])
        way = self._distorted(true)
        noise = (0.0, 0.0) if self.fault == _EXACT else flight.errors.position_m
        return (self.at_m[0] + way[0] + noise[0], self.at_m[1] + way[1] + noise[1]), going

    def _distorted(self, way: Plane) -> Plane:
        (nn, ne), (en, ee) = FAULTS[self.fault]
        return nn * way[0] + ne * way[1], en * way[0] + ee * way[1]


class Observer:
    """A watch that hears true or broken reports.

    Args:
        watch: That may have seen something.
        broken: None: the reports are true.
    """

    def __init__(self, watch: ObedienceWatch, broken: BrokenReport | None = None) -> None:
        self.watch, self.broken = watch, broken
        self._reports: deque[tuple[float, ReportedMotion]] = deque()

    def report(self, flight: Flight) -> None:
        """Send a report of now."""
        north, east, down = flight.position_m
        place, going = (north, east), flight.velocity_m_s[:2]
        if self.broken is not None:
            place, going = self.broken.of(flight)
        lean = lean_acceleration(flight.physics.quaternion_ned_frd)
        self._reports.append((flight.time_s, ReportedMotion((*place, down), going, lean)))

    def hear(self, now_s: float) -> None:
        """Let the watch take what has arrived."""
        while self._reports and self._reports[0][0] + _DELAY_S <= now_s:
            at_s, motion = self._reports.popleft()
            self.watch.take(motion, round(at_s * 1e9))


@dataclass(frozen=True)
class Found:
    """One fault that was found, or not."""

    broken: BrokenReport
    seconds: float
    """From the begin of the leg; infinite: never."""
    way_m: float
    """True way over ground."""

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
        self.flight = hovering(physics, _START_M, Personality(kind), EstimateErrors(sizes, seed))
        self.observers = [Observer(ObedienceWatch())]
        """The first hears true reports."""
        self._line = Random(seed)
        self._due_s = self.flight.time_s

    def break_reports(self) -> None:
        """Let further watches, which know what the first one does, hear broken reports from now."""
        physics, first = self.flight.physics, self.observers[0]
        for fault, velocity_too in product(FAULTS, (True, False)):
            broken = BrokenReport(fault, velocity_too, (physics.north_m, physics.east_m))
            observer = deepcopy(first)
            observer.broken = broken
            self.observers.append(observer)

    def tick(self, velocity: tuple[float, float, float]) -> str:
        """Fly on with a set-point; return why true reports are not believed."""
        flight = self.flight
        flight.take_velocity(PositionTarget(_LOCAL_NED, _VELOCITY_AND_RATE, velocity))
        reports = flight.time_s + _TICK_S + 1e-9 >= self._due_s
        if reports:
            self._due_s += _STALL_S if self._line.random() < _STALL_SHARE else _REPORT_S
        for observer in self.observers:
            observer.watch.tell(velocity, round(flight.time_s * 1e9))
        flight.step(_TICK_S)
        for observer in self.observers:
            if reports:
                observer.report(flight)
            observer.hear(flight.time_s)
        return self.observers[0].watch.problem

    def guided(self, target_m: Plane, limit_m_s: float) -> Plane:
        """Return the velocity towards a place, as the landing guides."""
        at_m = self.flight.position_m
        north, east = target_m[0] - at_m[0], target_m[1] - at_m[1]
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
        at = flown.flight.position_m
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


def find(flown: WatchedFlight, speed_m_s: float, *, along_an_axis: bool) -> list[Found]:
    """Hover over a place, break the reports, tell one leg; return what was found.

    As in a landing, what the vehicle is told makes up for its drift: a vehicle that truly goes to
    the north-east while it is told to go north shows no swapped axes.

    Args:
        flown: In the air.
        speed_m_s: Of the leg.
        along_an_axis: Within 0.25 rad; to the north-east swapped axes look as right ones do.
    """
    place, drift, told = flown.flight.position_m[:2], Drift(), Setpoint(0)
    until_s = flown.flight.time_s + _HOVER_S
    while flown.flight.time_s < until_s:
        north, east, down = flown.flight.position_m
        stamp_ns = round(flown.flight.time_s * 1e9)
        drift.see(Pose(stamp_ns, north, east, down, _LEVEL, -down), told)
        told = drift.made_up(Setpoint(0, *flown.guided(place, _HOVER_M_S)), _HOVER_M_S)
        flown.tick((told.v_north_m_s, told.v_east_m_s, 0.0))
    flown.break_reports()
    turn = flown.random.uniform(0.0, 2.0 * pi)
    if along_an_axis:
        turn = flown.random.choice((0.0, 0.5, 1.0, 1.5)) * pi + flown.random.uniform(-0.25, 0.25)
    wish = Setpoint(0, speed_m_s * cos(turn), speed_m_s * sin(turn))
    told = drift.made_up(wish, _FASTEST_M_S)
    begin_s, physics = flown.flight.time_s, flown.flight.physics
    begun, all_found = (physics.north_m, physics.east_m), []
    while len(flown.observers) > 1 and flown.flight.time_s < begin_s + _LEG_S:
        flown.tick((told.v_north_m_s, told.v_east_m_s, 0.0))
        way_m = hypot(physics.north_m - begun[0], physics.east_m - begun[1])
        for observer in flown.observers[1:]:
            if observer.broken is not None and observer.watch.problem:
                seconds = round(flown.flight.time_s - begin_s, 2)
                all_found.append(Found(observer.broken, seconds, round(way_m, 2)))
                flown.observers.remove(observer)
    never = [each.broken for each in flown.observers if each.broken is not None]
    return [*all_found, *(Found(each, inf, inf) for each in never)]


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
    parser.add_argument('--autopilot', choices=[each.value for each in Kind], help='only this one')
    parser.add_argument('--seed', type=int, default=1, help='of the first flight')
    given = parser.parse_args(args)
    sizes = {Kind.PX4: PX4_ERRORS.times(given.errors), Kind.ARDUPILOT: ErrorSizes()}
    failed = 0
    for kind, size in sizes.items():
        if given.autopilot not in {None, kind.value}:
            continue
        flights = round(given.hours * 3600.0 / _FLIGHT_S)
        false = 0
        for seed in range(given.seed, given.seed + flights):
            wind_m_s = Random(seed).uniform(0.0, given.wind)
            problem = accusation(WatchedFlight(kind, size, wind_m_s, seed), _FLIGHT_S)
            if problem:
                false += 1
                sys.stdout.write(f'{kind.value}, seed {seed}, wind {wind_m_s:.1f} m/s: {problem}\n')
                sys.stdout.flush()
        hours = flights * _FLIGHT_S / 3600.0
        sys.stdout.write(f'{kind.value}: {false} false accusations in {hours:g} h\n')
        sys.stdout.flush()
        failed += false
        for speed_m_s in LEG_SPEEDS_M_S:
            failed += _legs(kind, size, speed_m_s, given)
    return 0 if failed == 0 else 1


def _legs(kind: Kind, size: ErrorSizes, speed_m_s: float, given: argparse.Namespace) -> int:
    """Fly legs, write what was found, return how many faults were not found in time."""
    all_found: list[Found] = []
    for seed in range(given.seed, given.seed + given.trials):
        wind_m_s = Random(seed).uniform(0.0, given.wind)
        for along in (True, False):
            flown = WatchedFlight(kind, size, wind_m_s, seed)
            found = find(flown, speed_m_s, along_an_axis=along)
            all_found += [each for each in found if (each.broken.fault == _SWAPPED) == along]
    for fault, velocity_too in product(FAULTS, (True, False)):
        of_it = [
            each
            for each in all_found
            if each.broken.fault == fault and each.broken.velocity_too == velocity_too
        ]
        if not of_it:
            continue
        what = 'position and velocity' if velocity_too else 'position only'
        sys.stdout.write(
            f'{kind.value} at {speed_m_s:g} m/s, {what} {fault}: '
            f'{sum(each.in_time for each in of_it)} of {len(of_it)} within {TIME_LIMIT_S:g} s and '
            f'{WAY_LIMIT_M:g} m; the latest after {max(each.seconds for each in of_it):g} s, '
            f'{max(each.way_m for each in of_it):g} m\n'
        )
    sys.stdout.flush()
    return sum(not each.in_time for each in all_found)


if __name__ == '__main__':
    sys.exit(main())
