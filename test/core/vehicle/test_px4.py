# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The link against a simulated PX4: OFFBOARD wants a stream, before and after."""

import time

import pytest

from peace_ros.core.domain import Setpoint
from peace_ros.core.vehicle import Answer, SetpointSender, open_vehicle
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim
from peace_ros.simulation.demo.pilot import Pilot


@pytest.fixture
def px4(hovering, eventually):
    """PX4 in AUTO.LOITER, 10 m above home."""
    with hovering(10.0, 1.0, autopilot='px4') as sim:
        link = open_vehicle(sim.url)
        assert eventually(lambda: link.telemetry().pose is not None)
        yield sim, link
        link.close()


def test_offboard_from_take_off_to_failsafe(px4, eventually):
    sim, link = px4
    assert link.dialect.name == 'px4'
    assert eventually(lambda: link.telemetry().mode == 'AUTO.LOITER')
    assert sim.truth().altitude_agl_m == pytest.approx(10.0, abs=0.7)
    refused = link.set_mode('OFFBOARD')
    assert (refused.answer, refused.code) == (Answer.REFUSED, 1)
    assert 'OFFBOARD is currently not available' in refused.reason

    heading_rad = sim.truth().quaternion_ned_frd
    sender = SetpointSender(link)
    assert link.request_control(), 'zero velocity flows before it is asked for'
    sender.start()
    sender.submit(Setpoint(0, v_east_m_s=2.0))
    until = time.monotonic() + 0.9
    while time.monotonic() < until:
        sender.submit(Setpoint(0, v_east_m_s=2.0))
        time.sleep(0.02)
    assert sim.mode_name == 'OFFBOARD'
    assert link.telemetry().v_east_m_s > 0.5
    assert sim.truth().quaternion_ned_frd[3] == pytest.approx(heading_rad[3], abs=0.02)

    sender.stop()
    assert eventually(lambda: link.telemetry().mode == 'AUTO.RTL', 3.0)
    assert link.taken_over, 'a failsafe is a takeover'
    assert any('offboard control signal lost' in text for text in link.status_texts())
    assert not link.request_control()


def test_a_pilot_shows_within_0_3_s_although_px4_tells_modes_only_regularly(px4, eventually):
    sim, link = px4
    reactions_s = []
    for _ in range(3):  # a busy machine may be late once
        assert link.request_control(by_person=True)
        assert sim.pilot_mode('POSCTL')
        begin = time.monotonic()
        assert eventually(lambda: link.taken_over, 2.0)
        reactions_s.append(time.monotonic() - begin)
    assert min(reactions_s) < 0.3


def test_the_pilot_takes_off_to_a_height_above_home():
    with AutopilotSim(AutopilotParameters(port=0, autopilot='px4', speed=20.0)) as sim:
        link = open_vehicle(sim.url)
        Pilot(link, retry_s=0.1).take_off(10.0, timeout_s=60.0, arm=True)
        assert sim.truth().altitude_agl_m == pytest.approx(10.0, abs=1.2)
        link.close()


def test_lands_and_holds_in_its_own_modes(px4, eventually):
    sim, link = px4
    assert link.request_control()
    assert link.request_land()
    assert sim.mode_name == 'AUTO.LAND'
    assert not link.taken_over
    assert link.request_hold()
    assert sim.mode_name == 'AUTO.LOITER'
    level = link.request_level_hold()
    assert 'cannot hold its height without a position' in level.reason
