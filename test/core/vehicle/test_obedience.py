# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A position that does not show what the vehicle was told is not believed."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Callable
from itertools import accumulate
from math import hypot, inf

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from peace_ros.core.domain.geometry import lean_acceleration
from peace_ros.core.vehicle.obedience import ObedienceWatch, ReportedMotion
from peace_ros.simulation.autopilot.physics import Physics, VelocityCommand

STEP_S = 0.04


def at_height(altitude_m: float | None) -> ReportedMotion | None:
    return None if altitude_m is None else ReportedMotion((0.0, 0.0, -altitude_m), (0.0, 0.0))


def fly(
    watch: ObedienceWatch,
    seconds: float,
    told: Callable[[float], float],
    reported: Callable[[float, float], float | None],
    begin_s: float = 0.0,
) -> float:
    """Follow what is told with 0.4 s of lag; return how far it truly sank until it was noticed."""
    altitude_m = speed = 0.0
    for step in range(round(seconds / STEP_S)):
        at_s = step * STEP_S
        watch.tell((0.0, 0.0, told(at_s)), round((begin_s + at_s) * 1e9))
        speed += (told(at_s) - speed) * STEP_S / 0.4
        altitude_m -= speed * STEP_S
        said_m = reported(at_s, 50.0 + altitude_m)
        watch.take(at_height(said_m), round((begin_s + at_s) * 1e9))
        if watch.problem:
            return -altitude_m
    return float('inf')


@pytest.mark.parametrize('speed', [0.5, 1.0, 2.0, 3.0])
def test_an_altitude_that_froze_is_noticed_within_few_metres(speed: float) -> None:
    frozen: list[float] = []

    def reported(at_s: float, true_m: float) -> float:
        if at_s >= 4.0:
            frozen.append(true_m)
        return frozen[0] if frozen else true_m

    watch = ObedienceWatch()
    sunk_m = fly(watch, 12.0, lambda _: speed, reported)
    assert sunk_m - (50.0 - frozen[0]) < 4.5
    assert 'told to sink' in watch.problem


@settings(deadline=None)
@given(
    st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=8),
    st.floats(-0.3, 0.3),
)
def test_a_vehicle_that_follows_is_believed(speeds: list[float], drift: float) -> None:
    watch = ObedienceWatch()
    fly(
        watch,
        2.0 * len(speeds),
        lambda at_s: speeds[min(len(speeds) - 1, int(at_s / 2.0))],
        lambda at_s, true_m: true_m + 0.1 * drift * at_s,
    )
    assert watch.problem == ''


def test_standing_and_climbing_prove_nothing() -> None:
    watch = ObedienceWatch()
    fly(watch, 10.0, lambda _: 0.0, lambda _, __: 40.0)
    fly(watch, 10.0, lambda _: -2.0, lambda _, __: 40.0, begin_s=20.0)
    assert watch.problem == ''


@pytest.mark.parametrize('pause_s', [0.0, 0.5, 1.0, 1.5, 2.0, 3.0])
def test_a_climb_that_has_to_end_before_a_descent_is_no_disobedience(pause_s: float) -> None:
    physics = Physics()
    physics.down_m = -40.0
    watch, late = ObedienceWatch(), deque([0.0] * 10)
    for step in range(round(12.0 / STEP_S)):
        at_s = step * STEP_S
        down = -2.0 if at_s < 5.0 else 0.0 if at_s < 5.0 + pause_s else 1.0
        watch.tell((0.0, 0.0, down), round(at_s * 1e9))
        # Of a busy machine both ways are late.
        late.append(down)
        physics.step(STEP_S, VelocityCommand(0.0, 0.0, late.popleft()))
        watch.take(at_height(-physics.down_m), round(at_s * 1e9))
    assert watch.problem == ''


def test_silence_proves_nothing() -> None:
    watch = ObedienceWatch()
    fly(watch, 10.0, lambda _: 2.0, lambda at_s, _: 40.0 if at_s % 1.0 < 0.8 else None)
    assert watch.problem == ''


def test_an_old_report_is_no_altitude_that_stands_still() -> None:
    watch = ObedienceWatch()
    watch.tell((0.0, 0.0, 2.0), 0)
    for step in range(100):
        watch.take(at_height(50.0 - 0.08 * step), round(step * STEP_S * 1e9))
    for _ in range(100):
        watch.take(at_height(42.08), round(99 * STEP_S * 1e9))
    assert watch.problem == ''


def test_a_jump_is_left_to_others() -> None:
    watch = ObedienceWatch()
    fly(watch, 10.0, lambda _: 2.0, lambda at_s, true_m: true_m + (30.0 if at_s >= 5.0 else 0.0))
    assert watch.problem == ''


def test_doubt_stays_until_somebody_else_flies() -> None:
    watch = ObedienceWatch()
    fly(watch, 10.0, lambda _: 2.0, lambda _, __: 40.0)
    assert watch.problem
    fly(watch, 5.0, lambda _: 2.0, lambda _, true_m: true_m, begin_s=20.0)
    assert watch.problem
    watch.forget()
    fly(watch, 5.0, lambda _: 2.0, lambda _, true_m: true_m, begin_s=40.0)
    assert watch.problem == ''


Place = tuple[float, float]


def drive(
    watch: ObedienceWatch,
    told: Callable[[float, Place], Place],
    seconds: float,
    reported: Callable[[Place], Place] = lambda place: place,
    wind_m_s: float = 0.0,
    seed: int = 0,
    *,
    velocity_too: bool = True,
) -> float:
    """Let the simulated autopilot follow; return how far it truly went until it was noticed."""
    physics = Physics(wind_to_m_s=(0.0, wind_m_s), gust_m_s=0.3 * wind_m_s, seed=seed)
    physics.down_m = -50.0
    physics.step(1.0, VelocityCommand())  # it has leaned against the wind
    for step in range(round(seconds / STEP_S)):
        place = reported((physics.north_m, physics.east_m))
        velocity, now_ns = told(step * STEP_S, place), round(step * STEP_S * 1e9)
        watch.tell((*velocity, 0.0), now_ns)
        going = physics.velocity_ned_m_s[:2]
        going = reported(going) if velocity_too else going
        lean = lean_acceleration(physics.quaternion_ned_frd)
        watch.take(ReportedMotion((*place, physics.down_m), going, lean), now_ns)
        if watch.problem:
            return hypot(physics.north_m, physics.east_m)
        physics.step(STEP_S, VelocityCommand(*velocity))
    return inf


def towards(north_m: float, east_m: float) -> Callable[[float, Place], Place]:
    """Guide to a place as the landing does below the safe altitude."""

    def told(_at_s: float, place: Place) -> Place:
        north, east = north_m - place[0], east_m - place[1]
        distance = hypot(north, east)
        speed = min(1.5, 0.5 * distance)
        return (
            (0.0, 0.0) if distance == 0.0 else (speed * north / distance, speed * east / distance)
        )

    return told


@pytest.mark.parametrize('velocity_too', [True, False])
@pytest.mark.parametrize(
    ('reported', 'beside_m'),
    [
        (lambda place: (-place[0], -place[1]), 0.3),
        (lambda place: (-place[0], -place[1]), 2.0),
        (lambda place: (place[1], place[0]), 0.3),
        (lambda _place: (0.0, 0.0), 2.0),
    ],
    ids=['mirrored', 'mirrored far', 'swapped', 'frozen'],
)
def test_a_position_that_is_no_north_and_east_is_noticed_on_the_way(
    reported: Callable[[Place], Place], beside_m: float, velocity_too: bool
) -> None:
    watch = ObedienceWatch()
    told = towards(beside_m, -0.7 * beside_m)
    assert drive(watch, told, 30.0, reported, velocity_too=velocity_too) < 4.0
    assert 'sideways' in watch.problem


@pytest.mark.parametrize('wind_m_s', [0.0, 10.0])
def test_a_vehicle_that_is_guided_in_wind_is_believed(wind_m_s: float) -> None:
    watch = ObedienceWatch()
    drive(watch, towards(8.0, -5.0), 30.0, wind_m_s=wind_m_s)
    assert watch.problem == ''


@settings(max_examples=12, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.3, 4.0)),
        min_size=2,
        max_size=5,
    ),
    st.sampled_from([0.0, 5.0, 8.0, 10.0]),
    st.integers(0, 1000),
)
# A crawl that points the same way as the dash after it: the vehicle has to lean first.
@example([(0.0, 0.0625, 4.0), (0.0, 2.0, 1.0)], 0.0, 0)
@example([(0.0, 0.0625, 4.0), (0.0, 3.0, 4.0)], 8.0, 3)
# Gusts of 3 m/s push it the other way.
@example([(0.0, 0.0, 1.0), (0.0, 0.0, 2.0), (0.0, 0.0, 4.0), (0.0, 1.0, 2.0)], 10.0, 47)
@example([(0.0, 0.0, 6.0), (0.0, 1.0, 2.0)], 10.0, 996)
def test_a_vehicle_that_is_sent_here_and_there_is_believed(
    legs: list[tuple[float, float, float]], wind_m_s: float, seed: int
) -> None:
    ends = list(accumulate(length for *_, length in legs))

    def told(at_s: float, _place: Place) -> Place:
        north, east, _ = legs[min(bisect_right(ends, at_s), len(legs) - 1)]
        return north, east

    watch = ObedienceWatch()
    drive(watch, told, ends[-1], wind_m_s=wind_m_s, seed=seed)
    assert watch.problem == ''


def test_set_points_of_the_time_between_two_reports_count_as_long_as_they_held() -> None:
    """On a busy machine a report is 0.4 s late, and the vehicle was told several things since."""
    physics, watch = Physics(), ObedienceWatch()
    physics.down_m = -50.0
    for step in range(round(30.0 / STEP_S)):
        now_ns, north_m_s = round(step * STEP_S * 1e9), 2.0 if step % 150 < 75 else -2.0
        if step % 11 == 0:
            place = (physics.north_m, physics.east_m, physics.down_m)
            watch.take(ReportedMotion(place, physics.velocity_ned_m_s[:2]), now_ns)
        watch.tell((north_m_s, 0.0, 0.0), now_ns)
        physics.step(STEP_S, VelocityCommand(north_m_s))
    assert watch.problem == ''
