# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The physics against what was measured on ArduCopter 4.7."""

from math import degrees, isclose, pi

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peace_ros.simulation.autopilot.physics import Physics, VelocityCommand

DT_S = 0.01
TOLERANCE = 0.15


def flying(**kwargs):
    physics = Physics(**kwargs)
    physics.down_m = -100.0
    return physics


def fly(physics, seconds, command, look=lambda _: None):
    seen = []
    for _ in range(round(seconds / DT_S)):
        physics.step(DT_S, command)
        seen.append(look(physics))
    return seen


def north_speed(physics):
    return physics.velocity_ned_m_s[0]


@pytest.mark.parametrize(('share', 'measured_s'), [(0.1, 0.5), (0.9, 1.65)])
def test_gathers_lateral_speed_as_measured(share, measured_s):
    speeds = fly(flying(), 4.0, VelocityCommand(3.0), north_speed)
    reached_s = next(i for i, v in enumerate(speeds) if v >= share * 3.0) * DT_S
    assert reached_s == pytest.approx(measured_s, rel=TOLERANCE)


@pytest.mark.parametrize(
    ('speed', 'distance_m', 'tilt_deg'),
    [(1.0, 0.75, 9.0), (2.0, 1.8, 16.0), (3.0, 3.1, 18.0), (5.0, 7.0, 21.0)],
)
def test_stops_and_tilts_as_measured(speed, distance_m, tilt_deg):
    physics = flying()
    tilts = fly(physics, 8.0, VelocityCommand(speed), lambda p: p.tilt_rad)
    start_m = physics.north_m
    tilts += fly(physics, 8.0, VelocityCommand(), lambda p: p.tilt_rad)
    assert physics.north_m - start_m == pytest.approx(distance_m, rel=TOLERANCE)
    assert degrees(max(tilts)) == pytest.approx(tilt_deg, rel=TOLERANCE)


@pytest.mark.parametrize(
    ('speed', 'duration_s', 'past_m'),
    [(1.0, 81, 0.7), (1.5, 54, 1.4), (2.0, 41, 1.6), (3.0, 28, 2.6), (5.0, 18, 4.4)],
)
def test_descends_and_overshoots_as_measured(speed, duration_s, past_m):
    physics = flying()
    steps = 0
    while -physics.down_m > 20.0:
        physics.step(DT_S, VelocityCommand(v_down_m_s=speed))
        steps += 1
    at_m = physics.down_m
    lowest = max(fly(physics, 6.0, VelocityCommand(), lambda p: p.down_m))
    assert steps * DT_S == pytest.approx(duration_s, rel=TOLERANCE)
    assert lowest - at_m == pytest.approx(past_m, rel=TOLERANCE)


def test_leans_22_degrees_to_hold_against_8_m_s_of_wind():
    physics = flying(wind_to_m_s=(0.0, 8.0))
    fly(physics, 5.0, VelocityCommand())
    assert degrees(physics.tilt_rad) == pytest.approx(22.0, abs=0.5)
    assert physics.roll_rad < 0.0, 'leans into the wind'
    assert physics.east_m == pytest.approx(0.0, abs=0.01)


def test_nose_goes_down_to_fly_forward():
    physics = flying(heading_rad=pi / 2)
    fly(physics, 0.6, VelocityCommand(v_east_m_s=3.0))
    assert physics.pitch_rad < -0.1
    assert physics.roll_rad == pytest.approx(0.0, abs=0.01)


def test_a_level_vehicle_drifts_with_the_wind():
    physics = flying(wind_to_m_s=(5.0, 0.0))
    fly(physics, 20.0, VelocityCommand(lean_rad=(0.0, 0.0)))
    assert 2.0 < north_speed(physics) < 5.0


def test_turns_the_shorter_way_and_stays():
    physics = flying(heading_rad=3.0)
    fly(physics, 4.0, VelocityCommand(yaw_rad=-3.0))
    assert isclose(physics.yaw_rad, -3.0, abs_tol=0.02)


def test_the_ground_stops_it_and_keeps_it():
    physics = flying()
    physics.down_m = -2.0
    fly(physics, 6.0, VelocityCommand(1.0, 0.0, 1.0))
    assert physics.on_ground
    assert physics.down_m == 0.0
    assert physics.velocity_ned_m_s == (0.0, 0.0, 0.0)
    assert physics.touchdown_speed_m_s == pytest.approx(1.0, rel=0.05)


def test_gusts_push_and_the_seed_repeats_them():
    runs = []
    for seed in (1, 1, 2):
        physics = flying(gust_m_s=2.0, seed=seed)
        runs.append(fly(physics, 5.0, VelocityCommand(), lambda p: p.north_m)[-1])
    assert runs[0] == runs[1] != runs[2]
    assert runs[0] != 0.0


@settings(max_examples=20, deadline=None)
@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3), st.sampled_from([0.0025, 0.01, 0.05]))
def test_reaches_any_velocity_and_stands_still_on_zero(north, east, down, dt_s):
    physics = flying()
    for _ in range(round(8.0 / dt_s)):
        physics.step(dt_s, VelocityCommand(north, east, down))
    assert physics.velocity_ned_m_s == pytest.approx((north, east, down), abs=0.15)
    for _ in range(round(8.0 / dt_s)):
        physics.step(dt_s, VelocityCommand())
    assert physics.velocity_ned_m_s == pytest.approx((0.0, 0.0, 0.0), abs=0.01)
