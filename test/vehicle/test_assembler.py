# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Telemetry and poses out of messages, without a line."""

from math import cos, inf, nan, radians

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.vehicle.assembler import Assembler
from peace_ros.vehicle.dialects import ArduPilot
from peace_ros.vehicle.parameters import VehicleParameters

SECOND = 10**9


@pytest.fixture
def assembler():
    return Assembler(ArduPilot(), VehicleParameters())


def position(boot_ms=1000, *, x=1.0, vx=0.0, vz=0.0):
    return mavlink.MAVLink_local_position_ned_message(boot_ms, x, 2.0, -30.0, vx, 0.0, vz)


def attitude(boot_ms=1000, roll=0.0, pitch=0.0, yaw=0.0):
    return mavlink.MAVLink_attitude_message(boot_ms, roll, pitch, yaw, 0, 0, 0)


def heartbeat(mode, base=129):
    return mavlink.MAVLink_heartbeat_message(2, 3, base, mode, 4, 3)


def test_a_field_that_was_not_said_is_none(assembler):
    told = assembler.telemetry(0)
    assert (told.pose, told.landed, told.mode, told.in_control) == (None, None, '', False)


def test_a_pose_has_the_node_clock_of_its_attitude_and_position_brought_to_it(assembler):
    assembler.take(position(1000, vx=4.0), 70, 0)
    assembler.take(attitude(1050, yaw=0.5), 99, 50_000_000)
    (pose,) = assembler.poses
    assert pose.stamp_ns == 99
    assert pose.north_m == pytest.approx(1.2)
    assert (pose.east_m, pose.down_m, pose.altitude_agl_m) == (2.0, -30.0, 30.0)


@pytest.mark.parametrize('bad', [nan, inf, -inf])
def test_numbers_that_are_none_are_counted_and_not_believed(assembler, bad):
    assembler.take(position(), 0, 0)
    assembler.take(attitude(), 0, 0)
    for message in (
        position(x=bad),
        position(vz=bad),
        attitude(roll=bad),
        mavlink.MAVLink_attitude_quaternion_message(1000, bad, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_attitude_quaternion_message(1000, 0, 0, 0, 0, 0, 0, 0),
    ):
        assembler.take(message, 0, 0)
    assert assembler.rejected == 5
    assert assembler.telemetry(0).pose.north_m == 1.0


def test_an_old_position_is_no_position(assembler):
    assembler.take(position(), 0, 0)
    assembler.take(attitude(), 0, 0)
    assert assembler.telemetry(SECOND // 2).pose is not None
    assembler.take(attitude(2500), 0, int(1.5 * SECOND))
    told = assembler.telemetry(int(1.5 * SECOND))
    assert told.pose is None, 'a fresh attitude must not refresh an old position'
    assert told.received_ns == int(1.5 * SECOND)


def test_control_is_the_mode_and_needs_a_living_heartbeat(assembler):
    assembler.take(heartbeat(4), 0, 0)
    assert assembler.telemetry(0).in_control
    assert not assembler.telemetry(4 * SECOND).in_control
    assembler.take(heartbeat(5, base=1), 0, 4 * SECOND)
    told = assembler.telemetry(4 * SECOND)
    assert (told.in_control, told.mode, told.armed) == (False, 'LOITER', False)


@pytest.mark.parametrize(('state', 'landed'), [(0, None), (1, True), (2, False), (3, False)])
def test_landed_is_what_the_autopilot_says(assembler, state, landed):
    assembler.take(mavlink.MAVLink_extended_sys_state_message(0, state), 0, 0)
    assert assembler.telemetry(0).landed is landed


def test_a_boot_time_that_goes_back_is_a_reboot_and_forgets_the_place(assembler):
    assembler.take(position(90_000), 0, 0)
    assembler.take(attitude(90_000), 0, 0)
    assembler.take(attitude(2_000), 0, 0)
    assert assembler.reboots == 1
    assert assembler.telemetry(0).pose is None


def test_altitude_is_above_home(assembler):
    home = mavlink.MAVLink_home_position_message(0, 0, 0, 0, 0, -4.0, [1, 0, 0, 0], 0, 0, 0)
    assembler.take(home, 0, 0)
    assembler.take(position(), 0, 0)
    assembler.take(attitude(), 0, 0)
    assert assembler.telemetry(0).pose.altitude_agl_m == pytest.approx(26.0)


def range_message(distance_cm, orientation=25):
    return mavlink.MAVLink_distance_sensor_message(0, 20, 4000, distance_cm, 0, 0, orientation, 255)


@pytest.mark.parametrize(
    ('message', 'altitude_m'),
    [
        (range_message(2500), 25.0 * cos(radians(20))),
        (range_message(4100), 30.0),
        (range_message(5), 30.0),
        (range_message(2500, orientation=0), 30.0),
    ],
)
def test_the_rangefinder_counts_downward_and_in_range(message, altitude_m):
    assembler = Assembler(ArduPilot(), VehicleParameters(altitude_source='rangefinder'))
    assembler.take(message, 0, 0)
    assembler.take(position(), 0, 0)
    assembler.take(attitude(roll=radians(20)), 0, 0)
    assert assembler.telemetry(0).pose.altitude_agl_m == pytest.approx(altitude_m)


def test_long_texts_are_put_together(assembler):
    for chunk, text in enumerate((b'x' * 50, b'yz')):
        assembler.take(mavlink.MAVLink_statustext_message(4, text, 7, chunk), 0, 0)
    assembler.take(mavlink.MAVLink_statustext_message(4, b'short'), 0, 0)
    assert [text for _, text in assembler.texts] == ['x' * 50 + 'yz', 'short']
