# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The link against a simulated PX4: OFFBOARD wants a stream, before and after."""

import time

import pytest

from peace_ros.core.domain import Setpoint
from peace_ros.core.vehicle import Answer, SenderState, SetpointSender, open_vehicle
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim
from peace_ros.simulation.autopilot.faults import inject
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


def test_after_a_silent_line_nothing_is_sent_and_the_failsafe_of_the_autopilot_stays(
    px4, eventually
):
    sim, link = px4
    sender = SetpointSender(link)
    assert link.request_control(by_person=True)
    sender.start()
    sender.submit(Setpoint(0))
    assert eventually(lambda: sim.mode_name == 'OFFBOARD')
    inject(sim, 'silence', seconds=3.0)
    begin = time.monotonic()
    assert eventually(lambda: not link.telemetry().mode_known, 2.0)
    silent_s = time.monotonic() - begin
    assert 0.7 < silent_s < 1.2
    assert link.telemetry().in_control, 'the last mode that was reported'
    modes = set()
    while time.monotonic() < begin + 5.0:
        sender.submit(Setpoint(0))
        modes.add(sim.mode_name)
        time.sleep(0.02)
    assert modes == {'OFFBOARD', 'AUTO.RTL'}
    assert sim.mode_name == 'AUTO.RTL', 'set-points would have brought OFFBOARD back'
    assert link.taken_over
    assert link.telemetry().mode_known
    assert sender.statistics().state is SenderState.NOT_IN_CONTROL
    sender.stop()


def test_a_mode_that_is_not_known_stops_the_dead_man_and_the_last_zeros(px4, eventually):
    sim, link = px4
    assert link.request_control(by_person=True)
    assert eventually(lambda: sim.mode_name == 'OFFBOARD')
    sender = SetpointSender(link)
    sender.start()
    sender.submit(Setpoint(0))
    inject(sim, 'silence')
    assert eventually(lambda: sender.statistics().state is SenderState.MODE_UNKNOWN, 2.0)
    sent = sender.statistics().zeros
    assert not link.stop_at_once()
    time.sleep(0.3)
    assert sender.statistics().zeros == sent
    sender.stop()
