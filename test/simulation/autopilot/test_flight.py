# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state machine: boot, arming, take-off, landing, failsafes, on the simulated clock."""

from math import cos, pi, sin

import pytest

from peace_ros.simulation.autopilot.flight import Flight
from peace_ros.simulation.autopilot.guided import PlaceTarget, PositionTarget
from peace_ros.simulation.autopilot.modes import LandedState, Mode, Result
from peace_ros.simulation.autopilot.personality import Kind, Personality
from peace_ros.simulation.autopilot.physics import Physics


def until(flight, predicate, limit_s):
    start_s = flight.time_s
    while not predicate():
        flight.step(0.01)
        if flight.time_s - start_s > limit_s:
            pytest.fail(f'not within {limit_s} s')
    return flight.time_s - start_s


def let(flight, seconds):
    start_s = flight.time_s
    while flight.time_s - start_s < seconds:
        flight.step(0.01)


def steer(flight, seconds, velocity, frame=1, mask=0x5C7):
    for _ in range(round(seconds / 0.05)):
        flight.take_velocity(PositionTarget(frame, mask, velocity))
        let(flight, 0.045)


def texts(flight):
    return ' | '.join(text for _, text in flight.texts)


@pytest.fixture
def booted():
    flight = Flight(Physics())
    let(flight, 43.0)
    return flight


@pytest.fixture
def hovering(booted):
    assert booted.set_mode(Mode.GUIDED) is Result.ACCEPTED
    assert booted.arm() is Result.ACCEPTED
    assert booted.take_off(20.0) is Result.ACCEPTED
    until(booted, lambda: booted.landed_state is LandedState.IN_AIR, 30.0)
    return booted


def test_boots_as_slowly_as_the_real_one():
    flight = Flight(Physics())
    origin_s = until(flight, lambda: flight.estimator.reports_position(flight.time_s), 60.0)
    ready_s = origin_s + until(flight, lambda: not flight.prearm_problem(), 60.0)
    assert (origin_s, ready_s) == (pytest.approx(20.0, abs=0.1), pytest.approx(42.0, abs=0.1))


@pytest.mark.parametrize(
    ('at_s', 'reason'), [(10.0, 'GPS 1: Bad fix'), (30.0, 'Need Position Estimate')]
)
def test_before_it_is_ready_guided_may_be_chosen_but_not_armed(at_s, reason):
    flight = Flight(Physics())
    let(flight, at_s)
    assert flight.set_mode(Mode.GUIDED) is Result.ACCEPTED
    assert flight.arm() is Result.FAILED
    assert f'Arm: {reason}' in texts(flight)
    assert f'PreArm: {reason}' in texts(flight) or at_s > 20.0


@pytest.mark.parametrize('mode', [Mode.LAND, Mode.RTL, Mode.BRAKE])
def test_refuses_arming_in_modes_that_are_not_for_it(booted, mode):
    booted.set_mode(mode)
    assert booted.arm() is Result.FAILED
    assert f'{mode.name} mode not armable' in texts(booted)


def test_disarms_by_itself_ten_seconds_after_arming_on_the_ground(booted):
    booted.arm()
    assert until(booted, lambda: not booted.armed, 20.0) == pytest.approx(10.0, abs=0.2)


def test_takes_off_only_in_guided_and_armed(booted):
    booted.arm()
    assert booted.take_off(10.0) is Result.FAILED
    booted.set_mode(Mode.GUIDED)
    booted.disarm()
    assert booted.take_off(10.0) is Result.FAILED


def test_climbs_100_m_in_45_s_and_passes_from_takeoff_to_air(booted):
    booted.set_mode(Mode.GUIDED)
    booted.arm()
    booted.take_off(100.0)
    assert booted.landed_state is LandedState.TAKEOFF
    took_s = until(booted, lambda: booted.landed_state is LandedState.IN_AIR, 60.0)
    assert took_s == pytest.approx(45.0, abs=3.0)
    let(booted, 5.0)
    assert booted.physics.down_m == pytest.approx(-100.0, abs=0.3)


def test_a_velocity_setpoint_aborts_the_takeoff(booted):
    booted.set_mode(Mode.GUIDED)
    booted.arm()
    booted.take_off(100.0)
    until(booted, lambda: booted.physics.down_m < -33.0, 30.0)
    steer(booted, 0.1, (0, 0, 0))
    let(booted, 10.0)
    assert -37.0 < booted.physics.down_m < -33.0


def test_ignores_setpoints_on_the_ground(booted):
    booted.set_mode(Mode.GUIDED)
    booted.arm()
    steer(booted, 3.0, (1, 0, -2))
    assert booted.physics.on_ground


def test_holds_full_speed_for_three_seconds_without_setpoints_then_hovers(hovering):
    steer(hovering, 8.0, (4, 0, 0))
    from_m = hovering.physics.north_m
    let(hovering, 12.0)
    assert hovering.physics.north_m - from_m == pytest.approx(16.5, rel=0.05)
    assert hovering.mode is Mode.GUIDED


def test_body_frames_follow_the_nose_and_frame_12_stops(hovering):
    hovering.physics.yaw_rad = pi / 2
    steer(hovering, 4.0, (2, 0, 0), frame=8)
    assert hovering.physics.velocity_ned_m_s[1] == pytest.approx(2.0, abs=0.1)
    steer(hovering, 4.0, (2, 0, 0), frame=12)
    assert hovering.physics.velocity_ned_m_s == pytest.approx((0, 0, 0), abs=0.05)


def test_the_mask_decides_about_the_nose(hovering):
    steer(hovering, 4.0, (0, 3, 0), mask=0x5C7)
    assert hovering.physics.yaw_rad == pytest.approx(0.0, abs=0.01)
    steer(hovering, 4.0, (0, 3, 0), mask=0xDC7)
    assert hovering.physics.yaw_rad == pytest.approx(pi / 2, abs=0.05)


def test_the_yaw_stick_turns_it_in_guided_too(hovering):
    hovering.turn_stick(0.5)
    steer(hovering, 2.0, (0, 0, 0))
    assert hovering.physics.yaw_rad > 0.7


def test_lands_from_20_m_in_28_s_ignores_setpoints_and_disarms(hovering):
    hovering.set_mode(Mode.LAND)
    touch_s = 0.0
    while not hovering.physics.on_ground and touch_s < 60.0:
        steer(hovering, 0.05, (5, 0, -3))
        touch_s += 0.05
    assert touch_s == pytest.approx(28.0, rel=0.1)
    assert hovering.physics.touchdown_speed_m_s == pytest.approx(0.5, abs=0.05)
    assert hovering.physics.north_m == pytest.approx(0.0, abs=0.1)
    until(hovering, lambda: not hovering.armed, 3.0)
    assert hovering.landed_state is LandedState.ON_GROUND


@pytest.mark.parametrize('mode', [Mode.LOITER, Mode.BRAKE, Mode.ALT_HOLD, Mode.STABILIZE])
def test_pilot_modes_ignore_setpoints(hovering, mode):
    let(hovering, 5.0)
    hovering.set_mode(mode)
    steer(hovering, 4.0, (3, 0, 2))
    assert hovering.physics.north_m == pytest.approx(0.0, abs=0.2)
    assert hovering.physics.down_m == pytest.approx(-20.0, abs=0.5)


def test_reentering_guided_holds_without_remembering_the_old_setpoint(hovering):
    steer(hovering, 3.0, (3, 0, 0))
    hovering.set_mode(Mode.LOITER)
    hovering.set_mode(Mode.GUIDED)
    let(hovering, 5.0)
    stands_m = hovering.physics.north_m
    let(hovering, 5.0)
    assert hovering.physics.north_m == pytest.approx(stands_m, abs=0.05)


def test_rtl_comes_home_and_lands_and_stays_rtl(hovering):
    steer(hovering, 10.0, (3, 2, 0))
    hovering.lose_radio()
    assert hovering.mode is Mode.RTL
    until(hovering, lambda: hovering.landed_state is LandedState.LANDING, 120.0)
    until(hovering, lambda: not hovering.armed, 120.0)
    assert hovering.mode is Mode.RTL
    assert abs(hovering.physics.north_m) < 2.0
    assert abs(hovering.physics.east_m) < 2.0


@pytest.mark.parametrize(('kind', 'reckons_s'), [(Kind.ARDUPILOT, 7.1), (Kind.PX4, 5.4)])
def test_a_lost_gnss_is_bridged_by_dead_reckoning(kind, reckons_s):
    flight = Flight(Physics(), Personality(kind))
    let(flight, 43.0)
    flight.lose_gps(stale=False)
    took_s = until(flight, lambda: not flight.estimator.reports_position(flight.time_s), 20.0)
    assert took_s == pytest.approx(reckons_s, abs=0.1)
    flight.restore_gps()
    let(flight, 0.1)
    flight.lose_gps(stale=False)
    let(flight, 3.5)
    assert 0.0 < flight.position_m[0] - flight.physics.north_m < 0.5
    flight.restore_gps()
    let(flight, 0.1)
    assert flight.position_m[0] == flight.physics.north_m


def test_without_gps_it_lands_after_7_9_s_and_refuses_guided(hovering):
    hovering.lose_gps(stale=False)
    assert hovering.estimator.reports_position(hovering.time_s)
    took_s = until(hovering, lambda: hovering.mode is Mode.LAND, 20.0)
    assert took_s == pytest.approx(7.9, abs=0.1)
    assert 'EKF Failsafe' in texts(hovering)
    assert hovering.set_mode(Mode.GUIDED) is Result.FAILED
    assert 'Mode change to GUIDED failed: requires position' in texts(hovering)
    until(hovering, lambda: not hovering.armed, 60.0)


def test_a_stale_position_repeats_the_last_numbers(hovering):
    steer(hovering, 4.0, (3, 0, 0))
    hovering.lose_gps(stale=True)
    before = hovering.position_m
    let(hovering, 2.0)
    assert hovering.estimator.reports_position(hovering.time_s)
    assert hovering.position_m == before
    assert hovering.physics.north_m > before[0] + 1.0


def test_external_navigation_carries_guided_and_its_end_lands_after_8_s(hovering):
    hovering.estimator.use_source(2)
    hovering.lose_gps(stale=False)
    for _ in range(120):
        p = hovering.physics
        hovering.see((p.north_m + 5.0, p.east_m, p.down_m))
        let(hovering, 0.1)
    assert hovering.mode is Mode.GUIDED
    assert hovering.position_m[0] == pytest.approx(hovering.physics.north_m + 5.0)
    took_s = until(hovering, lambda: hovering.mode is Mode.LAND, 20.0)
    assert took_s == pytest.approx(8.0, abs=0.3)


@pytest.mark.parametrize(('thrust', 'climb'), [(0.5, 0.0), (0.75, 1.2), (0.25, -0.7), (0.0, -1.5)])
def test_guided_nogps_takes_thrust_but_no_velocity(hovering, thrust, climb):
    hovering.set_mode(Mode.GUIDED_NOGPS)
    for _ in range(50):
        hovering.take_attitude((0.0, 0.0), None, thrust)
        hovering.take_velocity(PositionTarget(1, 0x5C7, (3, 0, 0)))
        let(hovering, 0.1)
    assert -hovering.physics.velocity_ned_m_s[2] == pytest.approx(climb, abs=0.1)
    assert hovering.physics.north_m == pytest.approx(0.0, abs=0.1)


def test_guided_into_the_ground_is_a_landing_and_disarms(hovering):
    steer(hovering, 15.0, (0, 0, 2))
    assert hovering.landed
    steer(hovering, 10.0, (0, 0, 2))
    assert not hovering.armed


def test_flies_a_circle_without_leaving_it(hovering):
    for i in range(80):
        steer(hovering, 0.25, (2 * cos(i / 8), 2 * sin(i / 8), 0))
    assert abs(hovering.physics.down_m + 20.0) < 0.5


def test_flies_to_a_place_and_stays_there_without_more_setpoints(hovering):
    hovering.take_place(PlaceTarget((30.0, -12.0, -25.0)))
    let(hovering, 30.0)
    assert hovering.position_m == pytest.approx((30.0, -12.0, -25.0), abs=0.3)
    assert hovering.target_place_m == (30.0, -12.0, -25.0)
    steer(hovering, 1.0, (0, 0, 0))
    assert hovering.target_place_m is None, 'a velocity ends it'


def test_a_place_is_flown_to_at_the_chosen_speed(hovering):
    assert hovering.change_speed(2.0) is Result.ACCEPTED
    hovering.take_place(PlaceTarget((60.0, 0.0, -20.0)))
    let(hovering, 8.0)
    assert hovering.velocity_m_s[0] == pytest.approx(2.0, abs=0.1)
    assert hovering.change_speed(0.0) is Result.DENIED


def test_repositioning_needs_guided_or_leave_to_change_the_mode(hovering):
    place = PlaceTarget((5.0, 0.0, -20.0))
    hovering.set_mode(Mode.LOITER)
    assert hovering.reposition(place, change_mode=False) is Result.DENIED
    assert hovering.mode is Mode.LOITER
    assert hovering.reposition(place, change_mode=True) is Result.ACCEPTED
    assert hovering.mode is Mode.GUIDED
    let(hovering, 12.0)
    assert hovering.position_m[0] == pytest.approx(5.0, abs=0.2)


def test_a_place_that_cannot_be_stops_the_vehicle(hovering):
    hovering.take_place(PlaceTarget((100.0, 0.0, -20.0)))
    let(hovering, 4.0)
    hovering.refuse_place()
    let(hovering, 8.0)
    assert hovering.velocity_m_s == pytest.approx((0, 0, 0), abs=0.05)
    assert hovering.position_m[0] < 60.0


@pytest.mark.parametrize(('stick', 'climb_m_s'), [(1.0, 2.5), (-0.4, -1.0)])
def test_the_throttle_stick_climbs_and_sinks_in_loiter(hovering, stick, climb_m_s):
    let(hovering, 5.0)
    hovering.move_throttle(stick, 5.0)
    let(hovering, 2.0)
    assert hovering.velocity_m_s[2] == pytest.approx(0.0, abs=0.05), 'not in GUIDED'
    hovering.set_mode(Mode.LOITER)
    let(hovering, 2.5)
    assert hovering.velocity_m_s[2] == pytest.approx(-climb_m_s, abs=0.1)
    let(hovering, 5.0)
    assert hovering.velocity_m_s[2] == pytest.approx(0.0, abs=0.05), 'it was let go'


def test_turns_where_condition_yaw_says_and_a_setpoint_ends_it(hovering):
    hovering.turn(pi / 2)
    let(hovering, 5.0)
    assert hovering.physics.yaw_rad == pytest.approx(pi / 2, abs=0.05)
    steer(hovering, 6.0, (3, 0, 0), mask=0xDC7)
    assert hovering.physics.yaw_rad == pytest.approx(0.0, abs=0.05)


def test_px4_takes_off_to_its_own_altitude_when_it_is_told_none():
    flight = Flight(Physics(), Personality(Kind.PX4))
    let(flight, 43.0)
    assert flight.arm() is Result.ACCEPTED
    assert flight.take_off(float('nan')) is Result.ACCEPTED
    until(flight, lambda: flight.landed_state is LandedState.IN_AIR, 20.0)
    assert -flight.physics.down_m == pytest.approx(2.5, abs=0.3)
