# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How a gimbal is turned, as the autopilot reports it over MAVLink."""

import time
from math import cos, nan, radians, sin

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.geometry import angle_between
from peace_ros.core.vehicle import VehicleParameters, open_vehicle
from peace_ros.core.vehicle.assembler import Assembler
from peace_ros.core.vehicle.dialects import ArduPilot

SECOND = 10**9
HALF = radians(-75.0) / 2.0
DOWN_AHEAD = (cos(HALF), 0.0, sin(HALF), 0.0)
VEHICLE, EARTH, LOCK = (
    mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME,
    mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME,
    mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK,
)


def report(boot_ms=1000, q=DOWN_AHEAD, flags=VEHICLE, failure=0, device=1):
    return mavlink.MAVLink_gimbal_device_attitude_status_message(
        0, 0, boot_ms, flags, list(q), 0.0, 0.0, 0.0, failure, nan, nan, device
    )


def listener(**parameters):
    return Assembler(ArduPilot(), VehicleParameters(follow_gimbal=True, **parameters))


def heard(assembler, *messages, steady_ns=0):
    for message in messages:
        assembler.take(message, 77, steady_ns)
    return assembler.telemetry(steady_ns).gimbal


@pytest.mark.parametrize(
    ('flags', 'in_earth'),
    [(VEHICLE, False), (EARTH, True), (LOCK, True), (0, False), (VEHICLE | LOCK, False)],
)
def test_the_flags_say_whether_yaw_counts_from_north(flags, in_earth):
    told = heard(listener(), report(flags=flags))
    assert told.in_earth is in_earth
    assert told.stamp_ns == 77
    assert told.quaternion == pytest.approx(DOWN_AHEAD)
    assert told.problem == ''


def test_gimbals_that_report_in_the_same_millisecond_are_told_apart():
    both = [report(boot_ms=1000, device=1), report(boot_ms=1000, device=2)]
    assert 'set vehicle.gimbal_id' in heard(listener(), *both).problem
    assert heard(listener(gimbal_id=2), *both).problem == ''


def test_nothing_is_known_before_the_first_report_and_after_a_stale_one():
    assembler = listener(pose_limit_s=0.5)
    assert assembler.telemetry(0).gimbal is None
    assert heard(assembler, report()) is not None
    assert assembler.telemetry(SECOND // 2).gimbal is not None
    assert assembler.telemetry(SECOND // 2 + 1).gimbal is None


def test_a_gimbal_that_nobody_follows_is_not_read():
    assembler = Assembler(ArduPilot(), VehicleParameters())
    assert heard(assembler, report()) is None


@pytest.mark.parametrize('q', [(nan, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), (1.2, 0.0, 0.0, 0.0)])
def test_what_is_no_rotation_is_rejected(q):
    assembler = listener()
    assert heard(assembler, report(q=q)) is None
    assert assembler.rejected == 1


def test_an_older_report_that_comes_late_changes_nothing():
    level = (1.0, 0.0, 0.0, 0.0)
    told = heard(listener(), report(1100), report(1050, q=level))
    assert told.quaternion == pytest.approx(DOWN_AHEAD)


def test_a_failure_of_the_gimbal_is_a_problem_and_the_end_of_its_range_is_none():
    limit = mavlink.GIMBAL_DEVICE_ERROR_FLAGS_AT_PITCH_LIMIT
    assert heard(listener(), report(failure=limit)).problem == ''
    broken = mavlink.GIMBAL_DEVICE_ERROR_FLAGS_ENCODER_ERROR
    assert 'failure (flags 0x8)' in heard(listener(), report(failure=broken)).problem


def test_of_two_gimbals_one_must_be_chosen():
    both = report(1000, device=1), report(1010, device=2)
    assert 'gimbals 1 and 2' in heard(listener(), *both).problem
    level = report(1010, q=(1.0, 0.0, 0.0, 0.0), device=2)
    chosen = heard(listener(gimbal_id=1), report(1000, device=1), level)
    assert (chosen.problem, chosen.quaternion) == ('', pytest.approx(DOWN_AHEAD))


def test_the_simulated_autopilot_reports_its_gimbal_over_the_line(hovering, eventually):
    with hovering(20.0, 5.0, has_gimbal=True, gimbal_pitch_deg=-75.0) as sim:
        parameters = VehicleParameters(follow_gimbal=True)
        link = open_vehicle(sim.url, parameters=parameters, clock_ns=time.time_ns)
        try:
            assert eventually(lambda: link.telemetry().gimbal is not None)
            told = link.telemetry()
            assert angle_between(told.gimbal.quaternion, DOWN_AHEAD) < 1e-3
            assert not told.gimbal.in_earth
            assert abs(told.gimbal.stamp_ns - told.pose.stamp_ns) < SECOND // 5
        finally:
            link.close()
