# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Body rates and accelerations from the messages of either autopilot."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.vehicle import VehicleParameters, open_vehicle
from peace_ros.core.vehicle.assembler import Assembler
from peace_ros.core.vehicle.clock import TimeMap
from peace_ros.core.vehicle.dialects import ArduPilot, Px4
from peace_ros.core.vehicle.streams import StreamKeeper

SECOND = 10**9
OFFSET_NS = 40 * SECOND


@pytest.fixture
def clock():
    return TimeMap()


@pytest.fixture
def heard(clock):
    """Of an autopilot whose clock is 40 s behind ours."""
    assembler = Assembler(ArduPilot(), VehicleParameters(), clock)
    for number in range(5):
        sent_ns = 50 * SECOND + number * SECOND
        clock.add(sent_ns, sent_ns + 500_000 - OFFSET_NS, sent_ns + 1_000_000)
    return assembler


def raw(at_us=30_000_000, values=(10, -20, -1000, 100, -200, 300)):
    return mavlink.MAVLink_raw_imu_message(at_us, *values, 0, 0, 0)


def fine(values=(0.1, -0.2, -9.8, 0.1, -0.2, 0.3), fields=0x3F, at_us=30_000_000):
    return mavlink.MAVLink_highres_imu_message(at_us, *values, *(0.0,) * 7, fields)


@pytest.mark.parametrize(
    'message',
    [
        raw(),
        mavlink.MAVLink_scaled_imu_message(30_000, 10, -20, -1000, 100, -200, 300, 0, 0, 0),
        fine((0.0980665, -0.196133, -9.80665, 0.1, -0.2, 0.3)),
        fine((0.0980665, -0.196133, -9.80665, 0.1, -0.2, 0.3), fields=0),
    ],
)
def test_each_message_gives_the_same_sample(heard, message):
    heard.take(message, 70 * SECOND + 4_000_000, 0)
    (sample,) = heard.inertial.drain()
    assert sample.stamp_ns == 70 * SECOND
    assert sample.rates_rad_s == pytest.approx((0.1, -0.2, 0.3))
    assert sample.specific_force_m_s2 == pytest.approx((0.0980665, -0.196133, -9.80665))
    assert heard.inertial.drain() == []


def test_a_moment_that_is_not_known_gives_no_sample(heard, clock):
    heard.take(raw(at_us=10_000_000), 70 * SECOND, 0)
    clock.forget()
    heard.take(raw(), 70 * SECOND, 0)
    assert heard.inertial.drain() == []
    assert heard.inertial.undated == 2


@pytest.mark.parametrize('axis', [0, 3])
@pytest.mark.parametrize('bad', [float('nan'), 1e4])
def test_values_that_cannot_be_are_rejected(heard, axis, bad):
    values = [0.1, -0.2, -9.8, 0.1, -0.2, 0.3]
    values[axis] = bad
    heard.take(fine(values), 70 * SECOND, 0)
    assert heard.inertial.drain() == []
    assert heard.rejected == 1


def test_fields_that_are_not_new_give_no_sample(heard):
    heard.take(fine(fields=0x1C0), 70 * SECOND, 0)
    assert heard.inertial.drain() == []


def test_they_are_asked_for_only_when_wanted():
    for dialect, message in ((ArduPilot(), 27), (Px4(), 105)):
        rates = StreamKeeper(VehicleParameters(inertial_rate_hz=80.0), dialect).rates_hz
        assert rates[message] == 80.0
        assert message not in StreamKeeper(VehicleParameters(), dialect).rates_hz


@pytest.mark.parametrize('autopilot', ['ardupilot', 'px4'])
def test_the_link_reports_what_the_vehicle_does(hovering, eventually, autopilot):
    parameters = VehicleParameters(inertial_rate_hz=50.0)
    with hovering(20.0, 1.0, autopilot=autopilot) as sim:
        link = open_vehicle(sim.url, parameters=parameters)
        try:
            sim.pilot_yaw_stick(0.4)
            taken = []
            assert eventually(lambda: taken.extend(link.take_inertial()) or len(taken) > 60, 15.0)
        finally:
            link.close()
    stamps = [sample.stamp_ns for sample in taken]
    assert stamps == sorted(stamps)
    assert max(sample.rates_rad_s[2] for sample in taken) == pytest.approx(0.4, abs=0.05)
    assert taken[-1].specific_force_m_s2[2] == pytest.approx(-9.8, abs=0.3)
